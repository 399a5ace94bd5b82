"""A bad value of any option of any command: a message and exit code 2, never a traceback, a wrong number or half a file."""

from __future__ import annotations

import resource
import shutil
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import click
import pytest
import typer.main
from typer.testing import CliRunner

from ninedisk.harness.cli.app import app

VALUES = ("", " ", "-1", "0.5", "nan", "1e400", "\x00x", "no/such/place", "é", "a=b=c", "--", "*", "9" * 400)
"""What no option means, but for `TAKEN`."""

NO_NAME = ("\x00x", "9" * 400)
"""Names that no file can have."""
MISSING = tuple(value for value in VALUES[1:] if value not in NO_NAME)
"""Names of a file or a folder that is not there. The first value, the empty name, is the folder itself."""
TOP = tuple(value for value in MISSING if "/" not in value)
"""Those in a folder that is there."""
ALL_DIGITS = VALUES[-1:]

TAKEN: dict[tuple[str, str], tuple[str, ...]] = {
    # A store that is not there is an empty one, which has nothing to show, to compare, to export or to draw.
    **{(words, "--store"): ("", *MISSING) for words in ("run", "runs", "prune", "merge", "findings")},
    # A folder without curves.
    ("run", "--published"): ("",),
    # Files and an engine's folder are made in folders that are there; pages and schemas bring theirs along.
    **{(words, "--json"): TOP for words in ("run", "compare", "findings")},
    ("run", "--write-known-gaps"): TOP,
    **{("compare", option): TOP for option in ("--markdown", "--junit", "--html")},
    **{(words, "--out"): MISSING for words in ("report", "dashboard", "site")},
    **dict.fromkeys((("schema", "--out"), ("audit", "--example"), ("cd-problems make", "--out")), ("", *MISSING)),
    ("new-engine", "--out"): TOP,
    # A pattern, and whole numbers.
    ("show", "--case"): ("*",),
    **dict.fromkeys((("run", "--jobs"), ("dashboard", "--last"), ("prune", "--keep")), ALL_DIGITS),
}
"""Values that mean something to an option of a command: exit code 0. Any other is a mistake: 2, and nothing is written."""

NEEDED = {
    "run": ["fake/fall", "-e", "fake-good"],
    "converge": ["fake/fall"],
    "request": ["fake/fall"],
    "compare": ["latest", "latest"],
    "schema": ["--all"],
    "new-engine": ["acme"],
    "merge": ["before/results"],
    "check-engine": ["fake-good"],
    "cd-problems make": ["--family", "pyramid", "--disks", "10"],
}
"""Arguments with which a command goes as far as an option takes it."""
ALSO = {("export", "--store"): ["--csv", "rows.csv"]}
"""What an option needs beside it."""

SLOW = ("bench", "selftest", "docs", "check-engine", "converge", "determinism")
"""Commands that take minutes where an odd value happens to be a right one: `REFUSED` has values that never are."""

REFUSED = (
    ("bench", "nope"),
    *(("bench", "--time-limit", value) for value in ("nan", "0", "-1", "inf", "-inf", "ten", "")),
    *(("bench", "--repeats", value) for value in ("0", "-1", "1.5", "nan", "")),
    *(("bench", "--size", value) for value in ("3", "-1", "999999999", "9" * 400, "1e3", "")),
    *(("bench", suite, "--problem", "zz*") for suite in ("dem", "cd", "flow", "harness")),
    *(("bench", "harness", "--problem", "zz", "--out", value) for value in ("file", "file/below", "\x00x", "9" * 400)),
    *(("selftest", "--only", value) for value in ("zz*", "", "[", "\x00")),
    *(("selftest", "--jobs", value) for value in ("0", "-1", "1.5", "nan", "")),
    *(
        ("selftest", flag, value)
        for flag in ("--json", "--html")
        for value in ("folder", "missing/f", "file/f", "\x00x", "9" * 400)
    ),
    *(("docs", "--out", value) for value in ("file", "file/below", "\x00x", "9" * 400)),
    *(("docs", "--guides", value) for value in ("file", "missing", "folder", "\x00x", "9" * 400)),
    ("check-engine", "nope"),
    *(("check-engine", "dem", "--check", value) for value in ("zz*", "", "[")),
    *(("check-engine", "dem", "--json", value) for value in ("folder", "missing/f", "file/f", "\x00x", "9" * 400)),
    *(("determinism", "--engine", value) for value in ("nope", "", "*")),
    *(("determinism", "-e", "dem", "--store", value) for value in ("file", "file/below", "\x00x", "9" * 400)),
    *(("determinism", "-e", "dem", "--json", value) for value in ("missing/f", "file/f", "\x00x", "9" * 400)),
    *(("converge", value) for value in ("nope", "", "*")),
    *(("converge", "slip-to-roll", "--halvings", value) for value in ("0", "2", "13", "-1", "1.5", "nan", "9" * 400)),
    *(("converge", "slip-to-roll", "--engine", value) for value in ("nope", "", "*")),
    *(
        ("converge", "slip-to-roll", "--set", value)
        for value in ("", "=", "mu", "mu=x", "no=1", "speed=1e30", "kn=nan")
    ),
    *(("converge", "slip-to-roll", "--option", value) for value in ("", "x=1", "dem.no=1")),
    *(
        ("converge", "slip-to-roll", flag, value)
        for flag in ("--json", "--html")
        for value in ("folder", "missing/f", "file/f", "\x00x")
    ),
    *(("run", "impact/bouncing-disk", "--engine", "dem", "--set", value) for value in ("restitution=1e-300",)),
    ("run", "binary-collision", "--engine", "dem", "--set", "beta=1e7"),
)
"""Command lines that mean nothing, or a run that no machine holds."""

QUICK = 10.0
"""Seconds of this process in which a bad value is refused: imports, and no run."""


def commands() -> dict[str, click.Command]:
    def below(words: str, command: click.Command) -> dict[str, click.Command]:
        children = getattr(command, "commands", {})
        found = {} if children else {words: command}
        for name, child in children.items():
            found |= below(f"{words} {name}".strip(), child)
        return found

    return below("", typer.main.get_command(app))


def options() -> list[tuple[str, str]]:
    """Every option of every command that takes a value."""
    return [
        (words, parameter.opts[0])
        for words, command in commands().items()
        if words not in SLOW
        for parameter in command.params
        if parameter.param_type_name == "option" and not getattr(parameter, "is_flag", False)
    ]


def test_there_are_options() -> None:
    assert len(options()) >= 15


def written(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture(scope="module")
def begun(fake_environment: dict[str, str], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a run in its store, and the same again in its own folder."""
    folder = tmp_path_factory.mktemp("begun")
    command = [sys.executable, "-m", "ninedisk", "run", *NEEDED["run"]]
    subprocess.run(command, cwd=folder, env=fake_environment, capture_output=True, check=True)
    shutil.copytree(folder / "results", folder / "before/results")
    return folder


@pytest.mark.sampled(40)
@pytest.mark.usefixtures("fakes", "cells_here")
@pytest.mark.parametrize(("words", "option"), options())
def test_odd_values_of_every_option(
    words: str, option: str, begun: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    invoke = partial(CliRunner().invoke, app, prog_name="ninedisk")
    before = written(begun)
    taken = TAKEN.get((words, option), ())
    here: Path | None = None
    for k, value in enumerate(VALUES):
        if here is None:
            here = shutil.copytree(begun, tmp_path / str(k))
            monkeypatch.chdir(here)
        done = invoke([*words.split(), *NEEDED.get(words, []), *ALSO.get((words, option), []), option, value])
        assert done.exception is None or isinstance(done.exception, SystemExit), (value, done.exception)
        assert "Traceback" not in done.output, value
        assert done.exit_code == (0 if value in taken else 2), (value, done.output)
        half = [path for path in here.rglob("*") if ".tmp" in path.name or path.suffix == ".part"]
        assert not half, (value, half)
        if done.exit_code == 2:
            assert done.output.strip(), value
            assert written(here) == before, value
        else:  # what was written is in no other value's way
            here = None


@pytest.mark.parametrize("words", REFUSED, ids=lambda words: " ".join(words)[:60].replace("\x00", "0"))
def test_refused_at_once_and_nothing_written(
    words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("before")
    (tmp_path / "folder").mkdir()
    begin = time.process_time()
    done = CliRunner().invoke(app, list(words), prog_name="ninedisk")
    took = time.process_time() - begin
    assert isinstance(done.exception, SystemExit), done.exception
    assert (done.exit_code, "Traceback" in done.output) == (2, False), done.output
    assert done.output.strip()
    assert took < QUICK
    assert (tmp_path / "file").read_text() == "before"
    assert [path.name for path in tmp_path.rglob("*") if path.is_file()] == ["file"]


@pytest.mark.usefixtures("cells_here")
@pytest.mark.parametrize(
    ("case_id", "setting"),
    [
        ("impact/bouncing-disk", "restitution=0.999999"),
        ("binary-collision", "beta=1e-6"),
        ("binary-collision", "beta=200"),
    ],
)
def test_weak_and_strong_damping_ask_for_no_more_than_other_values(
    case_id: str, setting: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A truth that samples the motion by a length that grows with the damping, or its inverse, would ask for gigabytes."""
    monkeypatch.chdir(tmp_path)
    words = ["run", case_id, "--engine", "dem", "--set", setting]
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    done = CliRunner().invoke(app, words, prog_name="ninedisk")
    assert done.exit_code == 0, done.output
    assert (
        resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 1_000_000
    )  # KiB: kernels, compiled, take some 0.3 GB
