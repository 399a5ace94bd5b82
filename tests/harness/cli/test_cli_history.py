"""The commands over stored runs: exit codes, messages, files."""

from __future__ import annotations

import json
import os
from pathlib import Path
from types import ModuleType
from xml.etree import ElementTree

import pytest
from typer.testing import CliRunner, Result

from ninedisk.harness.cli.app import app
from ninedisk.harness.results.reader import run_ids
from ninedisk.harness.results.schema import SCHEMA_VERSION


@pytest.fixture(scope="session")
def stores(synthetic: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """``same`` has four equal runs; in ``worse`` one error is ten times as large from the last run on."""
    folder = tmp_path_factory.mktemp("stores")
    quiet = {"runs": 4, "noise": 0.005, "outliers": 0.0, "machines": ("AMD EPYC",)}
    synthetic.write_store(folder / "same", synthetic.Plan(**quiet))
    planted = {("incline-block", "k=1", "yade", "energy_final"): (3, 10.0)}
    synthetic.write_store(folder / "worse", synthetic.Plan(**quiet, errors=planted))
    return folder


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("GITHUB_STEP_SUMMARY", raising=False)
    return tmp_path


def ninedisk(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments], prog_name="ninedisk")


def test_compare_exit_codes(stores: Path) -> None:
    same = ninedisk("compare", "latest~1", "latest", "--store", stores / "same")
    assert same.exit_code == 0, same.output
    assert "Nothing got worse (120 same)." in same.stdout
    worse = ninedisk("compare", "latest~1", "latest", "--store", stores / "worse")
    assert worse.exit_code == 1
    row = next(line for line in worse.stdout.splitlines() if line.split()[:1] == ["worse"])
    assert "incline-block" in row
    assert "10.00x" in row
    assert ninedisk("compare", stores / "same", stores / "worse").exit_code == 1
    assert ninedisk("compare", stores / "worse", stores / "same").exit_code == 0, "better is no failure"


def test_compare_writes_every_format(stores: Path, here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    summary = here / "step.md"
    summary.write_text("before\n")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(summary))
    files = ("--markdown", "c.md", "--junit", "c.xml", "--html", "c.html", "--json", "c.json")
    done = ninedisk("compare", "latest~1", "latest", "--store", stores / "worse", *files)
    assert done.exit_code == 1, done.output
    assert "1 worse" in (here / "c.md").read_text()
    assert summary.read_text() == "before\n" + (here / "c.md").read_text() + "\n"
    assert ElementTree.parse(here / "c.xml").getroot().get("failures") == "1"
    assert json.loads((here / "c.json").read_text())["counts"]["worse"] == 1
    page = (here / "c.html").read_text()
    assert "1 got worse" in page
    assert "<link" not in page, "one file, to be sent by mail"


def test_compare_reads_exported_files(stores: Path) -> None:
    assert ninedisk("export", "latest~1", "--json", "base.json", "--store", stores / "worse").exit_code == 0
    assert ninedisk("export", "latest", "--csv", "head.csv", "--store", stores / "worse").exit_code == 0
    assert ninedisk("compare", "base.json", "head.csv").exit_code == 1
    text = Path("head.csv").read_text()
    Path("head.csv").write_text(text[: len(text) // 2])
    cut = ninedisk("compare", "base.json", "head.csv")
    assert (cut.exit_code, "cut off in its last line" in cut.stderr) == (2, True), cut.output


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            ("compare", "latest", "latest"),
            "the store 'results' has no finished run: run `ninedisk run --store results` first",
        ),
        (("compare", "x", "y"), "names no run of the store 'results'"),
        (("compare", "latest~1", "latest", "--html", "no/c.html"), "--html 'no/c.html' cannot be written"),
        (("compare", "latest~1", "latest", "--json", "."), "--json '.' is a folder: give a file"),
        (("compare", "latest~1", "latest", "--junit", "/proc/c.xml"), "--junit '/proc/c.xml' cannot be written"),
        (("dashboard",), "the store 'results' has no finished run"),
        (("merge", "nowhere"), "'nowhere' holds no finished run"),
        (("export", "--csv", "a.csv"), "has no finished run"),
        (("export",), "nothing to write"),
        (("export", "--csv", "a.txt"), "must end in .csv"),
        (("prune", "--before", "yesterday"), "is no date: write year-month-day"),
    ],
)
def test_wrong_usage(arguments: tuple[str, ...], said: str) -> None:
    done = ninedisk(*arguments)
    assert done.exit_code == 2, done.output
    assert said in done.stderr
    assert "Traceback" not in done.stderr


def test_a_newer_schema_stops_every_reader(stores: Path, here: Path) -> None:
    ninedisk("merge", stores / "same", "--store", "new")
    path = here / "new" / "runs" / run_ids(here / "new")[-1] / "run.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "schema_version": SCHEMA_VERSION + 1}))
    for command in (("compare", "latest~1", "latest"), ("dashboard",), ("export", "--csv", "a.csv")):
        done = ninedisk(*command, "--store", "new")
        assert done.exit_code == 2, done.output
        assert f"was written with schema {SCHEMA_VERSION + 1}" in done.stderr
    assert "upgrade" in ninedisk("runs", "--store", "new").stdout


def test_runs(stores: Path, here: Path) -> None:
    shown = ninedisk("runs", "--store", stores / "same").stdout
    ids = run_ids(stores / "same")
    assert [line.split()[0] for line in shown.splitlines() if line.strip().startswith("2026")] == ids
    assert "no runs in" in ninedisk("runs", "--store", here / "nowhere").stdout


def test_merge_and_prune(stores: Path, here: Path) -> None:
    assert "4 runs copied into all, 0 already there" in ninedisk("merge", stores / "same", "--store", "all").stdout
    ids = run_ids(here / "all")
    dry = ninedisk("prune", "--keep", "1", "--store", "all")
    assert dry.stdout.count("would remove") == 3
    assert "nothing was removed: add --yes" in dry.stdout
    assert run_ids(here / "all") == ids
    assert ninedisk("prune", "--keep", "1", "--yes", "--store", "all").exit_code == 0
    assert run_ids(here / "all") == ids[-1:]
    assert "nothing to remove" in ninedisk("prune", "--store", "all").stdout


def test_dashboard(stores: Path, here: Path) -> None:
    done = ninedisk("dashboard", "--store", stores / "worse", "--out", "pages")
    assert done.exit_code == 0, done.output
    assert f"dashboard: {here / 'pages' / 'index.html'}" in done.stdout
    (here / "foreign").mkdir()
    (here / "foreign" / "thesis.tex").write_text("mine")
    refused = ninedisk("dashboard", "--store", stores / "worse", "--out", "foreign")
    assert refused.exit_code == 2
    assert "holds files that are no dashboard" in refused.stderr
    assert os.listdir(here / "foreign") == ["thesis.tex"]


@pytest.mark.parametrize("command", ["compare", "dashboard", "runs", "merge", "export", "prune"])
def test_help_teaches(command: str) -> None:
    text = ninedisk(command, "--help").stdout
    assert "Example" in text
    assert f"ninedisk {command}" in text
