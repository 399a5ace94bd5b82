"""An engine given by its command: a good one is judged like any other, a bad one ends as a status that says what to mend."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from ninedisk.harness import run_case
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.engine import Engine, SupportLevel
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.results.tables import CaseResult
from ninedisk.harness.run.plan import plan_case
from ninedisk.harness.wire.command import CommandEngine, engines_given

BAD = Path(__file__).parent / "bad_engine.py"


def command(mode: str) -> str:
    return shlex.join([sys.executable, str(BAD), mode])


def run(mode: str) -> CaseResult:
    return run_case("binary-collision", engine=CommandEngine(command(mode)))


def test_a_good_engine_is_measured() -> None:
    engine = CommandEngine(command("good"))
    assert isinstance(engine, Engine)
    result = run_case("binary-collision", engine=engine, options={"bad.effort": 5})
    assert result.status == "fail"  # uniform motion passes through the other disk
    assert result.cell["engine"] == "bad"
    settings = json.loads(str(result.cell["settings"]))
    assert settings["effort"] == 5
    assert settings["engine_command"] == engine.command_line


@pytest.mark.parametrize("mode", ["answer-file", "npz", "escape"])
def test_other_answers(mode: str) -> None:
    result = run(mode)
    assert result.status == "fail", result.reason
    assert result.history is not None
    assert result.history.energy.keys() == ({"kinetic"} if mode == "npz" else set())
    assert "\x1b" not in str(result.cell["settings"])


@pytest.mark.parametrize(
    ("mode", "reason"),
    [
        ("silent", "printed no answer on standard output and wrote no answer_file"),
        ("banner", "begins with 'Welcome.*precedes the JSON object: print messages on standard error"),
        ("trailing", "follows the JSON object .'done in 3 s'.: print messages on standard error"),
        ("garbage", "is not JSON, .* begins with 'Segmentation fault"),
        ("cut", "is not JSON, or was cut off"),
        ("bare-nan", "JSON has no NaN or infinity; write null"),
        ("list", "must be a JSON object, not list"),
        ("deep", "nested too deeply"),
        ("binary", "is not JSON"),
        ("nan", "stopped being finite: history.x of disk 1 .* at step 2 "),
        ("missing-key", r"history lacks the key\(s\) fs; expected .*ninedisk schema answer"),
        ("extra-key", r"unknown key\(s\) velocity"),
        ("shape", r"history.v has shape \(102, 1, 2\); expected \(102, 2, 2\)"),
        ("ragged", "history.x has rows of different lengths"),
        ("few-steps", "history.step has 101 steps; expected the 102 sampled steps"),
        ("times", r"history.t\[3\] is .*; expected step \* dt"),
        ("infinite", "history.fn is infinite at step 0"),
        ("words", "history.t holds '0.01'; expected numbers"),
        ("huge", "history.t holds a whole number beyond the range"),
        ("version", "wire_version of the answer is 2; this harness speaks version 1"),
        ("gives-up", "the engine gave up: cannot do  .2J walls"),
        ("exit", "ended with status 3 .*no licence found"),
        (
            "loud",
            "^python.* ended with status 3 .*frame 42: z+ .*no licence found\nto see it by hand: ninedisk request binary-coll",
        ),
        ("killed", "ended by SIGKILL .*the machine runs out of memory"),
        ("flood", "more than 64 MiB on standard output: write the answer into the request's answer_file"),
        ("npz-nowhere", "expected a file in the folder of the request's answer_file"),
        ("npz-garbage", "is no NPZ file of plain arrays"),
        ("npz-objects", "is no NPZ file of plain arrays"),
        ("npz-names", r"unknown array\(s\) velocity"),
        ("npz-shape", r"history.v has shape \(102, 1, 2\)"),
    ],
)
def test_bad_engines_end_as_errors_that_say_what_to_mend(mode: str, reason: str) -> None:
    result = run(mode)
    assert result.status == "error"
    assert re.search(reason, result.reason, re.DOTALL), result.reason
    assert result.history is None


@pytest.mark.parametrize(
    ("mode", "reason"),
    [
        ("about-missing", "breaks its schema at the object: 'contact' is a required property"),
        ("about-capability", r"breaks its schema at capabilities\[0\]: 'friktion' is not one of"),
        ("about-id", "breaks its schema at id: 'no id.at all' does not match"),
        ("about-option", "default does not fit: bad.effort = 0 is not allowed: it must be a number >= 1"),
        ("about-scheme", "the scheme 'moreau-jean' needs the option 'theta'"),
        ("about-sweeps", "sweeps name the option 'efort': describe it"),
        ("about-exit", "ended with status 1 .*no licence found"),
        ("about-banner", "precedes the JSON object"),
    ],
)
def test_a_broken_description_is_one_error(mode: str, reason: str) -> None:
    """Of the whole engine, before anything runs."""
    with pytest.raises(
        UsageError, match=re.compile(f"describe` gives no description of the engine.*{reason}", re.DOTALL)
    ):
        CommandEngine(command(mode))


def test_a_late_description_is_one_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NINEDISK_TIME_LIMIT", "0.5")
    with pytest.raises(UsageError, match=r"time limit of 0\.5 s"):
        CommandEngine(command("about-late"))


@pytest.mark.parametrize("mode", ["late", "endless"])
def test_late_engines_are_stopped(mode: str, monkeypatch: pytest.MonkeyPatch) -> None:
    engine = CommandEngine(command(mode))  # described before the limit is short, on a machine that may be busy
    monkeypatch.setenv("NINEDISK_TIME_LIMIT", "0.5")
    result = run_case("binary-collision", engine=engine)
    assert result.status == "timeout"
    assert "time limit of 0.5 s (set NINEDISK_TIME_LIMIT to allow more)" in result.reason


def test_odd_settings_do_not_spoil_the_store(tmp_path: Path) -> None:
    """What cannot be written as text or as a number is stored so that pages can be made of it."""
    result = run("odd-settings")
    settings = json.loads(str(result.cell["settings"]))
    assert (settings["a"], settings["b"], settings["c"]) == ("nan", "  [2J", [[1], {"d": None}])
    (tmp_path / "page").write_text(str(result.cell["settings"]), encoding="utf-8")


def test_an_engine_may_refuse_a_scene() -> None:
    result = run("unsupported")
    assert (result.status, result.reason) == ("unsupported", "one disk only")


def test_support_is_by_the_kind_of_contacts() -> None:
    engine = CommandEngine(command("good"))
    cell = plan_case("nine-disk/compression", engine, {})
    assert not isinstance(cell.setup, Exception)
    refused = engine.supports(cell.setup.scene, cell.setup.numerics)
    assert refused.level is SupportLevel.NO
    assert Capability.LINEAR_CONTACT in refused.missing


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("", "there is no program"),
        ("no-such-program x", "no program 'no-such-program'"),
        ("./text", "'./text' is no program that may be run.*chmod"),
        ("a 'b", "mend its quotes"),
    ],
)
def test_commands_that_cannot_be_started(
    line: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("text").write_text("#!/bin/sh\n")
    with pytest.raises(UsageError, match=message):
        CommandEngine(line)


def test_ids_are_unique() -> None:
    with pytest.raises(UsageError, match="calls itself 'dem', and so does a known engine"):
        engines_given([], [command("about-taken")])
    with pytest.raises(UsageError, match="calls itself 'bad', and so does"):
        engines_given([], [command("good"), command("silent")])
    assert [each if isinstance(each, str) else each.id for each in engines_given(["dem"], [command("good")])] == [
        "dem",
        "bad",
    ]


def test_a_run_with_a_broken_engine_is_stored_whole(tmp_path: Path) -> None:
    """Through the command line: the others are measured, the exit code says so, no traceback, nothing half-stored."""
    done = subprocess.run(
        [
            *(
                sys.executable,
                "-m",
                "ninedisk",
                "run",
                "binary-collision",
                "--set",
                "kind=elastic",
                "--store",
                "results",
            ),
            *("--engine-cmd", command("banner"), "--engine", "dem"),
        ],
        capture_output=True,
        text=True,
        timeout=120,
        cwd=tmp_path,
    )
    said = done.stdout + done.stderr
    assert done.returncode == 3, said
    assert "Traceback" not in said
    assert "print messages on standard error" in done.stdout
    (folder,) = (tmp_path / "results" / "runs").iterdir()
    import pyarrow.parquet as pq

    cells = pq.read_table(folder / "cells.parquet").to_pylist()
    assert {cell["engine"]: cell["status"] for cell in cells} == {"dem": "pass", "bad": "error"}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["results"]
