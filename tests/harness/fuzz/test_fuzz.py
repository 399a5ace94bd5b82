"""Ten thousand damaged inputs: no traceback, no hang, nothing accepted in part. Every run tries the same ones."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path
from random import Random

import pytest
import targets
from mutations import ODD_TEXTS
from targets import TARGETS, FaultError, attempt, clean, invoke

from ninedisk.harness.errors import UsageError

SHORT, LONG = 3, 100
"""Inputs for each hundredth of a target's share: three hundred always, ten thousand in the slow run."""


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Relative paths of odd options lead nowhere but here."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("NINEDISK_TRACEBACK", raising=False)


@pytest.mark.parametrize("name", TARGETS)
def test_a_few_hundred_inputs(name: str) -> None:
    for seed in range(SHORT * TARGETS[name][1]):
        attempt(name, seed)


@pytest.mark.slow
@pytest.mark.parametrize("name", TARGETS)
def test_ten_thousand_inputs(name: str) -> None:
    for seed in range(LONG * TARGETS[name][1]):
        attempt(name, seed)


def test_the_shares_make_a_hundred() -> None:
    assert sum(share for _, share in TARGETS.values()) == 100


@pytest.mark.parametrize("seed", range(6))
def test_real_processes(seed: int, tmp_path: Path) -> None:
    """The console entry itself, with bytes that are no text among its arguments."""
    rng = Random(seed)
    odd = [text.encode("utf-8", "surrogatepass").replace(b"\x00", b"") for text in ODD_TEXTS] + [
        b"\xff\xfe",
        b"dt=\xb5s",
    ]
    form = [
        [b"run", b"incline-block", b"-e", b"pymunk", b"--set", rng.choice(odd)],
        [b"list", b"cases", rng.choice(odd)],
        [b"runs", b"--store", rng.choice(odd)],
        [b"converge", rng.choice(odd)],
        [b"compare", rng.choice(odd), rng.choice(odd)],
        [rng.choice(odd), rng.choice(odd)],
    ][seed]
    done = subprocess.run(
        [sys.executable, "-m", "ninedisk", *form],
        capture_output=True,
        timeout=120,
        cwd=tmp_path,
        env={**os.environ, "PYTHONIOENCODING": "utf-8"},
    )
    assert done.returncode in (0, 2), (form, done.stderr[-500:])
    assert b"Traceback" not in done.stderr + done.stdout, (form, done.stderr[-1500:])
    assert b"internal error" not in done.stderr, (form, done.stderr[-500:])


def test_faults_are_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """The harness of these tests finds a foreign exception, a silent error, a hang, and an internal error of a command."""
    with clean("fine"):
        raise UsageError("give another file")
    with pytest.raises(FaultError, match="KeyError"), clean("a lookup"):
        raise KeyError("x")
    with pytest.raises(FaultError, match="without a message"), clean("a silent one"):
        raise UsageError("")
    with pytest.raises(FaultError, match="no answer within"), clean("a hang", seconds=0.05):
        time.sleep(5.0)

    def broken() -> None:
        raise ZeroDivisionError("float division by zero")

    monkeypatch.setattr("ninedisk.harness.cli_list.show_cases", broken)
    with pytest.raises(FaultError, match="internal error"):
        invoke(["list", "cases"])


def test_a_run_that_is_there_in_part_is_seen(tmp_path: Path) -> None:
    folder = tmp_path / "results" / "runs" / "20260101T000000Z-abcdef"
    folder.mkdir(parents=True)
    (folder / "run.json").write_text("{")
    with pytest.raises(UsageError, match="damaged"):
        targets.whole(tmp_path / "results")
