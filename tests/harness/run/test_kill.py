"""Kill -9 at any moment: the store stays readable, no run is there by half, and `--resume` runs what is missing and nothing else."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pandas as pd
import pytest
from typer.testing import CliRunner

from ninedisk.harness.api.errors import StoreError
from ninedisk.harness.cli.app import app
from ninedisk.harness.results.reader import read_about, read_run, run_ids
from ninedisk.harness.results.store import unfinished_folders
from ninedisk.harness.run.journal import journals

QUICK = ["pymunk"]
ALL = ["cd", "dem", "pymunk"]
"""Engines of the short and of the long test: the kernels of ours take seconds to load, which no kill strikes more often for."""


# Makes a run visible before it is complete, as a store without a rename would.
IN_PLACE = """
import pathlib, shutil, sys, time
source, store = map(pathlib.Path, sys.argv[1:])
made = store / "runs" / "20990101T000000Z-ffffff"
made.mkdir(parents=True)
for path in sorted(source.iterdir(), key=lambda path: path.suffix):
    shutil.copy(path, made)
    time.sleep(0.3)
"""


def run_of(engines: list[str], store: Path) -> list[str]:
    """Arguments of a run of a few cells."""
    chosen = [word for engine in engines for word in ("-e", engine)]
    settings = ["--set", "duration=0.05", "--set", "mu=0.36", "--set", "dt=0.01"]
    return ["-m", "ninedisk", "run", "incline-block", *chosen, *settings, "--store", str(store)]


def start(store: Path, *arguments: str) -> subprocess.Popen[bytes]:
    """A run in its own process group."""
    return subprocess.Popen(
        [sys.executable, *arguments],
        start_new_session=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        cwd=store.parent,
    )


def kill(process: subprocess.Popen[bytes]) -> None:
    """End the whole group at once; the leader is not reaped before, so that its number is its own."""
    os.killpg(process.pid, signal.SIGKILL)
    process.wait(timeout=60)


def kill_while_writing(process: subprocess.Popen[bytes], store: Path, delay: float) -> None:
    """Kill ``delay`` seconds after the folder of the new run appears, or when the process ends on its own."""
    known = set(unfinished_folders(store)) | set((store / "runs").glob("*"))
    end = time.monotonic() + 120.0
    while time.monotonic() < end and process.poll() is None:
        if set((store / "runs").glob(".tmp-2*")) - known:
            time.sleep(delay)
            break
        time.sleep(0.0005)
    if process.poll() is None:
        kill(process)


def check(store: Path, engines: list[str]) -> int:
    """Every visible run is complete, to the library and to the command; the number of runs."""
    for run_id in run_ids(store):
        _, tables = read_run(store, run_id)
        assert sorted({row["engine"] for row in tables["cells"].to_dict("records")}) == engines
        assert len(tables["measurements"]) > 10 * len(engines)
    result = CliRunner().invoke(app, ["runs", "--store", str(store)])
    assert result.exit_code == 0, result.output
    assert "damaged" not in result.output
    return len(run_ids(store))


def killed_and_run_again(store: Path, engines: list[str], times: int, seed: int) -> tuple[int, int]:
    """Kill ``times`` runs, every second one while it writes; numbers of finished runs before and after a last, whole one."""
    rng = random.Random(seed)
    begin = time.monotonic()
    assert start(store, *run_of(engines, store)).wait(timeout=300) in (0, 1)
    whole = time.monotonic() - begin
    for k in range(times):
        process = start(store, *run_of(engines, store))
        if k % 2:
            kill_while_writing(process, store, rng.uniform(0.0, 0.03))
        else:
            time.sleep(rng.uniform(0.0, 1.2 * whole))
            if process.poll() is None:
                kill(process)
        check(store, engines)
    before = check(store, engines)
    assert start(store, *run_of(engines, store)).wait(timeout=300) in (0, 1)
    return before, check(store, engines)


def test_three_kills(tmp_path: Path) -> None:
    before, after = killed_and_run_again(tmp_path / "results", QUICK, 3, seed=1)
    assert after == before + 1


@pytest.mark.slow
def test_fifty_kills(tmp_path: Path) -> None:
    store = tmp_path / "results"
    before, after = killed_and_run_again(store, ALL, 50, seed=2)
    assert after == before + 1
    assert len(unfinished_folders(store)) >= 5, "hardly a kill struck while a run was being written"
    result = CliRunner().invoke(app, ["prune", "--keep", "1", "--yes", "--store", str(store)])
    assert result.exit_code == 0, result.output
    assert check(store, ALL) == 1


TIMINGS = frozenset({"setup_s", "warm_up_s", "advance_s", "cpu_s", "cpu_spread", "reference_s", "repeats"})


def same_rows(store: Path, run_id: str, other: Path) -> None:
    """The run has the rows of the only run of another store, bit by bit, but for timings."""
    (whole,) = run_ids(other)
    found, expected = read_run(store, run_id)[1], read_run(other, whole)[1]
    for name, table in expected.items():
        left = [frame.drop(columns=[each for each in frame if each in TIMINGS]) for frame in (found[name], table)]
        pd.testing.assert_frame_equal(*left, check_exact=True)


def kill_when_kept(process: subprocess.Popen[bytes], store: Path, size: int) -> None:
    """Kill once the journals have more than ``size`` bytes, or when the process ends on its own."""
    end = time.monotonic() + 120.0
    while time.monotonic() < end and process.poll() is None and kept_bytes(store) <= size:
        time.sleep(0.001)
    if process.poll() is None:
        kill(process)


def kept_bytes(store: Path) -> int:
    total = 0
    for path in journals(store):
        with suppress(FileNotFoundError):
            total += path.stat().st_size
    return total


def resumed_after_kills(folder: Path, engines: list[str], times: int, seed: int, share: float) -> int:
    """Kill runs, resume each, compare every finished one with a run that nobody killed; the number of cells that were not run again.

    A kill comes at a random time up to ``share`` of what a run takes, every second one at a random number of kept bytes.
    """
    whole, store, rng = folder / "whole", folder / "killed", random.Random(seed)
    begin = time.monotonic()
    assert start(whole, *run_of(engines, whole)).wait(timeout=300) in (0, 1)
    took, most = time.monotonic() - begin, 0
    for k in range(times):
        process = start(store, *run_of(engines, store), "--resume")
        if k % 2:
            time.sleep(rng.uniform(0.0, share * took))
            if process.poll() is None:
                kill(process)
        else:
            kill_when_kept(process, store, kept_bytes(store) + rng.randrange(20_000))
        most = max(most, kept_bytes(store))
    assert most > 0, "no kill struck between two cells"
    assert start(store, *run_of(engines, store), "--resume").wait(timeout=300) in (0, 1)
    assert journals(store) == []
    for run_id in run_ids(store):
        same_rows(store, run_id, whole)
    return sum(int(read_about(store, run_id)["provenance"].get("resumed", 0)) for run_id in run_ids(store))


def test_a_killed_run_is_resumed(tmp_path: Path) -> None:
    assert resumed_after_kills(tmp_path, QUICK, 3, seed=3, share=0.8) >= 1


@pytest.mark.slow
def test_twenty_kills_and_resumptions(tmp_path: Path) -> None:
    assert resumed_after_kills(tmp_path, ALL, 20, seed=4, share=1.1) >= 5


def test_a_store_that_writes_in_place_is_found(tmp_path: Path) -> None:
    store = tmp_path / "results"
    assert start(store, *run_of(QUICK, store)).wait(timeout=300) in (0, 1)
    (finished,) = run_ids(store)
    process = start(store, "-c", IN_PLACE, str(store / "runs" / finished), str(store))
    half = store / "runs" / "20990101T000000Z-ffffff" / "run.json"
    end = time.monotonic() + 60.0
    while not half.exists() and time.monotonic() < end:
        time.sleep(0.01)
    kill(process)
    with pytest.raises(StoreError, match="damaged"):
        check(store, QUICK)
