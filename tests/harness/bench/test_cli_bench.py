"""``ninedisk bench``: help, mistakes, a small run with its files and page."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from ninedisk.harness.api.engine import EngineError
from ninedisk.harness.bench import harness, plan
from ninedisk.harness.bench.measure import Sample
from ninedisk.harness.bench.records import new_row, print_rows
from ninedisk.harness.cli import bench as cli_bench
from ninedisk.harness.cli.app import app
from ninedisk.harness.results.schema import Row
from ninedisk.reports.bench import charts, write_bench

pytestmark = pytest.mark.usefixtures("here")


def ninedisk(*arguments: str) -> Result:
    return CliRunner().invoke(app, ["bench", *arguments], prog_name="ninedisk")


def test_help_teaches() -> None:
    done = ninedisk("--help")
    assert done.exit_code == 0
    for word in ("--large", "--repeats", "--time-limit", "--out", "Examples:", "Exit codes:", "interleaved"):
        assert word in done.output


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("speed",), "there is no suite 'speed': use dem, spheres, cd, coulomb, coulomb3d, flow, harness"),
        (("dem", "--time-limit", "0"), "--time-limit 0"),
        (("dem", "--time-limit", "nan"), "--time-limit nan"),
        (("dem", "--out", "file"), "--out"),
        (("dem", "--problem", "nothing-like-this"), "no problem matches"),
        (("dem", "--repeats", "0"), "--repeats"),
        (("cd", "--size", "1"), "--size"),
        (("coulomb", "--size", "11"), "--size 11 is not one of the set's in the suite coulomb: use 10, 30"),
        (("dem", "--size", "many"), "--size"),
        (("coulomb3d",), "the suite coulomb3d solves problems out of files: add --files FOLDER"),
        (("coulomb3d", "--files", "absent"), "--files 'absent' is no folder"),
        (("coulomb3d", "--files", "."), "--files '.' holds no contact problem in 3D"),
        (("dem", "--files", "."), "--files is for the suite coulomb3d"),
    ],
)
def test_mistakes_are_named(arguments: tuple[str, ...], word: str, here: Path) -> None:
    (here / "file").write_text("")
    done = ninedisk(*arguments)
    assert done.exit_code == 2
    assert word in done.output
    assert "Traceback" not in done.output


def test_a_small_run_writes_record_and_page(here: Path, packing_folder: Path) -> None:
    done = ninedisk(
        "dem", "--size", "40", "--repeats", "1", "--problem", "settled-40-short", "--engine", "none", "--out", "o"
    )
    assert done.exit_code == 0, done.output
    assert "settled-40-short" in done.stdout
    assert packing_folder.exists()
    by_suffix = {path.suffix: path for path in (here / "o").iterdir()}
    assert set(by_suffix) == {".json", ".parquet", ".html"}
    record = json.loads(by_suffix[".json"].read_text())
    assert record["rows"][0]["engine"] == "dem"
    assert record["rows"][0]["median_s"] > 0.0
    assert record["provenance"]["cpu"]
    assert record["argv"][0] == "ninedisk"
    page = by_suffix[".html"].read_text()
    assert "settled-40-short" in page
    assert '<figure class="chart"' in page


@pytest.mark.parametrize(("statuses", "code"), [(("pass", "not-reached"), 0), (("fail",), 1), (("fail", "error"), 3)])
def test_exit_codes(statuses: tuple[str, ...], code: int, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = [new_row(suite="cd", problem="p", engine="e", status=status, reason="because") for status in statuses]
    monkeypatch.setattr(plan, "run_suites", lambda *_: iter([rows]))
    done = ninedisk("cd")
    assert done.exit_code == code
    assert "because" in done.stdout


def test_libraries_use_one_thread_and_the_environment_comes_back(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MKL_NUM_THREADS", "3")
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    with cli_bench.one_thread():
        assert {os.environ[name] for name in cli_bench.ONE_THREAD} == {"1"}
    assert os.environ["MKL_NUM_THREADS"] == "3"
    assert "OMP_NUM_THREADS" not in os.environ


def harness_rows(monkeypatch: pytest.MonkeyPatch, outcomes: list[str]) -> list[Row]:
    left = list(outcomes)
    monkeypatch.setattr(
        harness,
        "_run",
        lambda *_: Sample(seconds=1.0, whole=1.0, facts={"outcome": left.pop(0), "cpu": 1.0}),
    )
    return list(chain.from_iterable(harness.run((), harness.COLD, repeats=2, time_limit=60.0, notify=lambda _: None)))


def test_jobs_have_to_agree_with_one_job(monkeypatch: pytest.MonkeyPatch) -> None:
    assert [row["status"] for row in harness_rows(monkeypatch, ["7 pass"] * 4)] == ["pass", "pass"]
    rows = harness_rows(monkeypatch, ["7 pass", "6 pass", "7 pass", "7 pass"])
    assert [(row["threads"], row["status"]) for row in rows] == [(1, "pass"), (2, "fail")]
    assert rows[1]["median_s"] != rows[1]["median_s"]


def test_the_harness_is_timed_on_a_case_with_cached_kernels() -> None:
    (rows,) = harness.run(("invariance/galilei",), harness.CACHED, repeats=1, time_limit=120.0, notify=lambda _: None)
    assert {row["status"] for row in rows} == {"pass"}, [row["reason"] for row in rows]
    assert "cells:" in rows[0]["check"]
    assert [row["threads"] for row in rows] == [1, 2]
    assert all(row["cpu_s"] > 0.1 for row in rows), "the workers' processor time is missing"


def test_the_appendix_is_meant_by_its_cases() -> None:
    cases = harness._appendix_cases()
    assert {"nine-disk/compression", "nine-disk/distortion", "binary-collision", "incline-block"} < set(cases)
    assert not {"gas/elastic", "invariance/units"} & set(cases)


def test_a_harness_run_that_fails_is_an_error() -> None:
    with pytest.raises(EngineError, match="exit code 2"):
        harness._run(("no-such-case",), False, 1, 60.0)


def test_tables_and_pages_bear_rows_without_numbers(here: Path) -> None:
    rows = [
        new_row(suite=suite, problem="settled-1", engine="<e>", status="not-installed", reason="<b>missing</b>")
        for suite in ("dem", "cd", "harness")
    ]
    print_rows(rows, [])
    assert all(charts(rows, suite) == [] for suite in ("dem", "cd", "harness"))
    facts = {"commit": "", "cpu": "c", "cores": 2, "python": "3"}
    write_bench({"run_id": "r", "argv": [], "provenance": facts, "versions": {}, "rows": rows}, here / "page.html")
    text = (here / "page.html").read_text()
    assert "<b>missing</b>" not in text
    assert "&lt;b&gt;missing" in text


def test_an_interrupted_run_keeps_what_was_measured(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def measured(*_: object) -> Iterator[list[Row]]:
        yield [new_row(suite="cd", problem="p", engine="e", status="pass", median_s=1.0)]
        raise KeyboardInterrupt

    monkeypatch.setattr(plan, "run_suites", measured)
    done = ninedisk("cd", "--out", "o")
    assert done.exit_code == 130
    assert "holds what was measured" in done.output
    by_suffix = {path.suffix: path for path in (here / "o").iterdir()}
    assert set(by_suffix) == {".json", ".parquet", ".html"}
    assert [row["problem"] for row in json.loads(by_suffix[".json"].read_text())["rows"]] == ["p"]
