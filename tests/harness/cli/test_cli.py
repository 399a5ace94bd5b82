"""The command line in process: exit codes, messages, output files."""

from __future__ import annotations

import json
from pathlib import Path
from shutil import rmtree

import pytest
from typer.testing import CliRunner, Result

from ninedisk.harness.cli.app import app
from ninedisk.harness.results.reader import run_facts, run_ids
from ninedisk.harness.results.schema import MEASUREMENT_COLUMNS

pytestmark = pytest.mark.usefixtures("fakes", "here")


def ninedisk(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments), prog_name="ninedisk")


@pytest.mark.long
@pytest.mark.usefixtures("cells_here")
@pytest.mark.parametrize(
    ("engines", "code"),
    [
        (("good",), 0),
        (("good", "incapable"), 3),
        (("good", "uninstalled"), 3),
        (("good", "wrong"), 1),
        (("nan",), 1),
        (("crash",), 3),
        (("timeout",), 3),
        (("wrong", "garbage", "good"), 3),
        (("broken", "good"), 3),
    ],
)
def test_exit_codes(here: Path, engines: tuple[str, ...], code: int) -> None:
    flags = [part for engine in engines for part in ("--engine", f"fake-{engine}")]
    done = ninedisk("run", "fake/fall", *flags)
    assert done.exit_code == code, done.output
    assert len(run_ids(here / "results")) == 1
    assert f"results: results/runs/{run_ids(here / 'results')[0]}" in done.stdout
    assert "warning: nothing ran" not in done.stderr


@pytest.mark.parametrize("case", [pytest.param((), marks=pytest.mark.slow), ("fake/*",)])
def test_an_engine_that_can_run_nothing_is_an_error(here: Path, case: tuple[str, ...]) -> None:
    """A check that cannot fail would look green; allowed where it was asked for."""
    refused = ninedisk("run", *case, "-e", "fake-incapable", "--json", "rows.json")
    assert refused.exit_code == 3, refused.output
    what = "no variant of fake/spin" if case else "no variant of any case"
    assert f"error: fake-incapable can run {what}: it lacks " in refused.stderr
    assert "--allow-unsupported" in refused.stderr
    assert "nothing is stored" in refused.stderr
    assert run_ids(here / "results") == []
    assert {row["status"] for row in json.loads((here / "rows.json").read_text())} == {"unsupported"}
    allowed = ninedisk("run", *case, "-e", "fake-incapable", "--allow-unsupported")
    assert allowed.exit_code == 0, allowed.output
    assert "warning: nothing ran" in allowed.stderr
    assert len(run_ids(here / "results")) == 1


def test_engines_that_nobody_named_may_lack_all(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All engines of the machine run what they can: `make report` ends well."""
    known = dict.fromkeys(("fake-good", "fake-absent", "fake-incapable"))
    monkeypatch.setattr("ninedisk.harness.wire.command.engine_table", lambda: known)
    done = ninedisk("run", "fake/fall", "--all-engines", "--set", "a=1")
    assert done.exit_code == 0, done.output
    assert "not-installed: " in done.stdout
    assert len(run_ids(here / "results")) == 1


@pytest.mark.parametrize(
    "words",
    [
        ("run", "fake/fall", "-e", "fake-absent"),
        ("run", "fake/fall", "-e", "fake-good", "-e", "fake-absent", "--allow-unsupported"),
        ("check-engine", "fake-absent"),
        ("converge", "fake/fall", "-e", "fake-absent"),
        ("determinism", "-e", "fake-absent"),
    ],
)
def test_a_named_engine_that_is_not_installed_is_an_error_in_all_commands(here: Path, words: tuple[str, ...]) -> None:
    done = ninedisk(*words)
    assert done.exit_code == 2, done.output
    said = "error: the engine 'fake-absent' is not installed (it was never built); install it with: pip install fake"
    assert done.stderr.strip() == said
    assert run_ids(here / "results") == []


@pytest.mark.long
@pytest.mark.parametrize(("truth", "code"), [("gap", 0), ("nan", 0), ("none", 0), ("broken", 3)])
def test_exit_codes_of_truths(truth: str, code: int) -> None:
    assert ninedisk("run", "fake/fall", "-e", "fake-good", "--set", f"truth={truth}").exit_code == code


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("run", "fake/fal"), "no case matches 'fake/fal'. Did you mean 'fake/fall'"),
        (("run", "fake/fall", "-e", "fake-god"), "no engine 'fake-god'. Did you mean 'fake-good'"),
        (("run", "fake/fall", "-e", "fake-good", "--all-engines"), "exclude each other"),
        (("run", "fake/fall", "--jobs", "0"), "--jobs 0 is not allowed: give a whole number >= 1, or auto"),
        (("run", "fake/fall", "--jobs", "two"), "--jobs two is not allowed"),
        (("run", "fake/fall", "--jobs", "2", "--dask", "tcp://x:1"), "--jobs and --dask exclude each other"),
        (("run", "fake/fall", "-e", "fake-good", "--set", "b=1"), "no parameter 'b'"),
        (("run", "fake/*", "-e", "fake-good", "--set", "a=1"), "unknown to fake/spin"),
        (("run", "fake/fall", "-e", "fake-good", "--set", "a"), "write NAME=VALUE"),
        (("run", "fake/fall", "-e", "fake-good", "--set", "a="), "write NAME=VALUE"),
        (("run", "fake/fall", "-e", "fake-good", "--set", "a=1", "--set", "a=2"), "gives 'a' twice"),
        (("run", "fake/fall", "-e", "fake-good", "--set", "a=-1"), "it must be a number >= 0"),
        (("run", "fake/fall", "-e", "fake-good", "--set", "a=1 kg"), "wrong dimension; give it in m/s^2"),
        (
            ("run", "fake/fall", "-e", "fake-good", "--set", "dt=1 parsnip"),
            "the unit 'parsnip' is unknown; give it in s",
        ),
        (("run", "fake/fall", "-e", "fake-good", "--set", "a=200"), "a = 200 is too much for this scene"),
        (
            ("run", "fake/fall", "-e", "fake-unstable", "--set", "a=1", "--set", "dt=1"),
            "exceeds the critical step 0.5 s",
        ),
        (("run", "fake/fall", "-e", "fake-good", "--store", "file"), "the store 'file' cannot be written"),
        (("run", "fake/fall", "-e", "fake-good", "--store", "/proc/x"), "the store '/proc/x' cannot be written"),
        (("run", "fake/fall", "-e", "fake-good", "--json", "no/where.json"), "'no/where.json' cannot be written"),
        (("run", "fake/fall", "-e", "fake-good", "--json", "."), "is a folder"),
        (("run", "fake/fall", "-e", "fake-good", "--published", "nowhere"), "nowhere is no folder"),
        (("list", "cases", "fake/fal"), "no case 'fake/fal'"),
        (("report", "--store", "nowhere"), "nowhere"),
    ],
)
def test_wrong_usage(here: Path, arguments: tuple[str, ...], said: str) -> None:
    (here / "file").write_text("")
    done = ninedisk(*arguments)
    assert done.exit_code == 2, done.output
    assert said in " ".join(done.stderr.split())
    assert done.stderr.startswith("error: ")
    assert "Traceback" not in done.output
    assert run_ids(here / "results") == []
    assert not [path for path in here.iterdir() if path.name.endswith(".tmp")]


@pytest.mark.parametrize("arguments", [("walk",), ("run", "--nosuch"), ("list", "nothing"), ("run", "--set")])
def test_wrong_commands(arguments: tuple[str, ...]) -> None:
    done = ninedisk(*arguments)
    assert done.exit_code == 2
    assert "Traceback" not in done.output


def test_the_table_is_worst_first() -> None:
    done = ninedisk("run", "fake/fall", "-e", "fake-good", "-e", "fake-wrong", "-e", "fake-crash")
    rows = [line.split() for line in done.stdout.splitlines() if " fake/fall " in line and "ninedisk" not in line]
    assert [row[0] for row in rows] == ["error:"] * 2 + ["fail:"] * 4 + ["pass"] * 4, "each check once, worst first"
    assert rows[2][1:5] == ["fake/fall", "[a=1]", "fake-wrong", "x_final:"] or rows[2][4] == "x:"
    assert "found +0.501, expected +0.5: error 0.001 m exceeds the tolerance" in done.stdout
    assert rows[6][1:4] == ["fake/fall", "a=1", "fake-good"]
    assert rows[6][5] == rows[6][6]
    assert "segmentation fault" in done.stdout
    assert "cells: 2 error, 2 fail, 2 pass" in done.stdout
    assert "checks: 2 error, 4 fail, 4 pass" in done.stdout


def test_json_rows(here: Path) -> None:
    (here / "rows.json").write_text("old")
    assert ninedisk("run", "fake/fall", "-e", "fake-nan", "-e", "fake-crash", "--json", "rows.json").exit_code == 3
    rows = json.loads((here / "rows.json").read_text())
    assert [row["status"] for row in rows] == ["fail", "pass", "error"] * 2
    assert all(set(row) == set(MEASUREMENT_COLUMNS) for row in rows)
    assert rows[0]["value"] is None
    assert rows[0]["worst_step"] == 3
    assert rows[2]["abs_error"] is None
    assert sorted(path.name for path in here.iterdir()) == ["results", "rows.json"]


def test_json_is_replaced_never_overwritten(here: Path) -> None:
    """Whoever reads the old file while the new one is written sees the old one whole."""
    (here / "rows.json").write_text("old")
    with (here / "rows.json").open() as reader:
        assert ninedisk("run", "fake/fall", "-e", "fake-good", "--json", "rows.json").exit_code == 0
        assert reader.read() == "old"


def test_a_store_that_fills_up_leaves_the_old_json(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from ninedisk.harness.results import store

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    (here / "rows.json").write_text("old")
    monkeypatch.setattr(store, "_flush", full)
    done = ninedisk("run", "fake/fall", "-e", "fake-good", "--json", "rows.json")
    assert done.exit_code == 3
    assert "No space left on device" in done.stderr
    assert (here / "rows.json").read_text() == "old"
    assert run_ids(here / "results") == []


def test_list() -> None:
    cases = ninedisk("list", "cases")
    assert cases.exit_code == 0
    assert "fake/fall" in cases.stdout
    one = ninedisk("list", "cases", "fake/fall").stdout
    assert "a number >= 0" in one
    assert "m/s^2" in one
    assert "2 variants run by default" in one
    engines = ninedisk("list", "engines")
    assert engines.exit_code == 0
    assert "not installed" in engines.stdout
    assert "fake-absent: it was never built" in engines.stdout
    assert "broken: info() of the engine 'fake-shy' must not fail" in " ".join(engines.stdout.split())
    assert "pip install fake" in engines.stdout


def test_version() -> None:
    import ninedisk as package

    assert package.__version__ in ninedisk("--version").stdout


@pytest.mark.parametrize(("jobs", "machine"), [("1", ""), ("2", ", 2 cells at once")])
def test_a_run_says_what_its_timings_shared_the_machine_with(here: Path, jobs: str, machine: str) -> None:
    assert ninedisk("run", "fake/fall", "-e", "fake-good", "--jobs", jobs).exit_code == 0
    about = json.loads((here / "results" / "runs" / run_ids(here / "results")[0] / "run.json").read_text())
    assert about["provenance"]["jobs"] == int(jobs)
    alone = run_facts({**about, "provenance": {**about["provenance"], "jobs": 1}}).machine
    assert run_facts(about).machine == alone + machine


def test_something_unforeseen_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **__: object) -> None:
        raise KeyError("lost")

    monkeypatch.setattr("ninedisk.harness.run.workers.run_cells", broken)
    done = ninedisk("run", "fake/fall", "-e", "fake-good")
    assert done.exit_code == 3
    assert done.stderr.startswith("error: internal error: KeyError: 'lost'")
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("name", ["NINEDISK_TIME_LIMIT", "NINEDISK_MEMORY_LIMIT"])
def test_a_limit_that_is_none_is_wrong_usage(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(name, "-2")
    done = ninedisk("run", "fake/fall", "-e", "fake-good")
    assert done.exit_code == 2
    assert name in done.stderr
    assert "internal" not in done.stderr


def test_interrupt(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def stopped(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("ninedisk.harness.run.workers.run_cells", stopped)
    monkeypatch.setattr("ninedisk.core.compile.cache_folder", lambda: str(here))
    for engine in ("fake-good", "dem"):
        done = ninedisk("run", "fake/fall", "-e", engine)
        assert done.exit_code == 130
        assert "interrupted: nothing was stored" in done.stderr
        assert ("kernels are compiled first" in done.stderr) == (engine == "dem"), (
            "nothing compiled lies in an empty folder"
        )
        assert run_ids(here / "results") == []
        rmtree(here / "results")
