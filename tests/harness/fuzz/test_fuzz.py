"""Ten thousand damaged inputs: no traceback, no hang, nothing accepted in part. Every run tries the same ones."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from random import Random

import pytest
import targets
from mutations import ODD_TEXTS
from targets import TARGETS, FaultError, attempt, clean, invoke, requests

from ninedisk.core.dem.session import DemSession
from ninedisk.core.errors import InvalidSceneError
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.wire.protocol import WireError, decode_request, encode_request

SHORT, LONG = 3, 100
"""Inputs for each hundredth of a target's share: three hundred always, ten thousand in the slow run."""


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Relative paths of odd options lead nowhere but here."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("NINEDISK_TRACEBACK", raising=False)


@pytest.mark.sampled(3)
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

    monkeypatch.setattr("ninedisk.harness.cli.list.show_cases", broken)
    with pytest.raises(FaultError, match="internal error"):
        invoke(["list", "cases"])


def test_a_run_that_is_there_in_part_is_seen(tmp_path: Path) -> None:
    folder = tmp_path / "results" / "runs" / "20260101T000000Z-abcdef"
    folder.mkdir(parents=True)
    (folder / "run.json").write_text("{")
    with pytest.raises(UsageError, match="damaged"):
        targets.whole(tmp_path / "results")


@pytest.mark.parametrize(
    ("argv", "said"),
    [
        (["run", "sliding/dynamic", "-e", "dem", "--set", "mu=1.8e308"], "mu = 1.8e308 is not allowed"),
        (["run", "sliding/dynamic", "-e", "dem", "--set", "mu=1e200"], "its size must lie between 1e-100 and 1e+100"),
        (["run", "slip-to-roll", "-e", "dem", "--set", "dt=1e-200"], "its size must lie between"),
        (["run", "nine-disk/compression", "-e", "dem", "--set", "substeps=2147483648"], "contact steps, at most 1e+07"),
        (["run", "incline-block", "-e", "pymunk", "--set", "dt=1e-7"], "steps dt, at most 1e+06"),
        (["runs", "--store", "x" * 5000], "cannot be used: File name too long"),
        (["report", "--store", "x" * 5000], "File name too long"),
    ],
)
def test_found_by_fuzzing(argv: list[str], said: str) -> None:
    code, output = invoke(argv)
    assert code == 2
    assert said in output


def test_a_request_that_is_no_list_of_pairs() -> None:
    for key, value in (("watch", 3.0), ("watch", [True]), ("extra", [1])):
        data = json.loads(encode_request(requests()[0])) | {key: value}
        with pytest.raises(WireError, match=f"{key} must be"):
            decode_request(json.dumps(data))


def test_files_that_are_no_archive(tmp_path: Path) -> None:
    for data in (b"", b"PK\x03\x04", targets.checkpoint()[:-100], targets.problem("npz")):
        (tmp_path / "c.npz").write_bytes(data)
        with pytest.raises(InvalidSceneError, match="checkpoint of a DEM run"):
            DemSession.load(tmp_path / "c.npz")
