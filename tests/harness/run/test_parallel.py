"""Cells in worker processes: the same results whatever their number, and no cell is lost with its worker."""

from __future__ import annotations

import pickle
import signal
import socket
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from ninedisk.core.errors import UnstableTimeStepError
from ninedisk.harness import run_matrix
from ninedisk.harness.results.tables import CaseResult
from ninedisk.harness.run.plan import plan_matrix
from ninedisk.harness.run.workers import crash_place, run_cells


def test_results_do_not_depend_on_the_number_of_jobs(bits: Callable[[CaseResult], bytes]) -> None:
    """Round-off included: warm kernels, other cells before and beside do not show."""
    cells = plan_matrix(["binary-collision"], ["pymunk", "cd", "dem"], {"kind": "elastic"})[:3]
    alone = run_cells(cells)
    assert [result.status for result in alone] == ["pass"] * 3
    for jobs in (1, 2):
        found = run_cells(cells, jobs=jobs)
        assert [bits(result) for result in found] == [bits(result) for result in alone], jobs
    alone[0].rows[0]["value"] = np.nextafter(alone[0].rows[0]["value"], 1e3)  # the comparison sees the last bit
    assert bits(found[0]) != bits(alone[0])


@pytest.mark.usefixtures("fakes")
def test_no_cell_is_lost_with_its_worker(here: Path) -> None:
    names = ["good", "segfault", "good", "exit", "killed", "wrong", "killed-once", "bug"]
    seen: list[tuple[int, int, str]] = []
    results = run_matrix(
        ["fake/fall"], [f"fake-{name}" for name in names], {"a": 1}, lambda *at: seen.append(at), jobs=2
    )
    assert [result.cell["engine"] for result in results] == [f"fake-{name}" for name in names]
    assert [r.status for r in results] == ["pass", "error", "pass", "error", "error", "fail", "pass", "error"]
    assert results[1].reason.startswith("its process was ended by SIGSEGV at ")
    assert results[3].reason == "its process ended with status 7"
    assert results[4].reason == "its process was ended by SIGKILL, 2 times in a row"
    assert "ZeroDivisionError" in results[7].reason
    assert (here / "killed-once").exists()
    assert results[1].cell["engine_name"] == "Fake segfault"
    assert results[1].cell["n_disks"] == 1
    done = [at[0] for at in seen]
    assert done == sorted(done)
    assert (done[0], seen[-1]) == (0, (8, 8, ""))
    assert {name.removeprefix("fake/fall[a=1] on fake-") for _, _, name in seen if name} == set(names)


@pytest.mark.usefixtures("fakes", "here")
def test_an_engine_with_threads_runs_alone() -> None:
    results = run_matrix(["fake/fall", "fake/spin"], ["fake-wide"], jobs=2)
    assert [result.reason for result in results] == ["", "", ""]


@pytest.mark.usefixtures("here")
def test_a_cell_that_cannot_be_sent_runs_here(fakes: ModuleType) -> None:
    class Local(fakes.FakeEngine):  # type: ignore[misc, name-defined]
        pass

    cells = plan_matrix(["fake/fall"], ["fake-good", "fake-wrong"], {"a": 1})
    cells.insert(1, replace(cells[0], engine=Local("good")))
    with pytest.raises((pickle.PicklingError, AttributeError)):
        pickle.dumps(cells[1])
    assert [result.status for result in run_cells(cells, jobs=1)] == ["pass", "pass", "fail"]


@pytest.mark.usefixtures("fakes")
def test_a_mistake_of_the_user_is_raised_from_a_worker() -> None:
    with pytest.raises(UnstableTimeStepError, match="exceeds the critical step"):
        run_matrix(["fake/fall"], ["fake-unstable"], {"dt": 1.0, "a": 1.0}, jobs=1)
    assert [r.status for r in run_matrix(["fake/fall"], ["fake-unstable"], {"dt": 1.0}, jobs=2)] == ["error", "error"]


def test_place_of_a_crash() -> None:
    dump = 'Fatal Python error: Segmentation fault\n\nCurrent thread 0x7f (most recent call first):\n  File "/a/b/c.py", line 3 in f'
    assert crash_place(dump) == " at c.py:3 in f"
    assert crash_place("") == ""


SLOW_TO_TIDY = """
import sys, time
from ninedisk.harness.run import workers

def run_task(payload):
    try:
        print("begun", flush=True)
        time.sleep(60)
    finally:
        time.sleep(0.5)
        print("tidied", flush=True)

workers.run_task = run_task
workers.serve(int(sys.argv[1]), sys.stderr.fileno())
"""


def test_a_worker_that_is_ended_twice_tidies_up_in_silence() -> None:
    """Its link closes and the one it serves ends it: two signals, the second one while it puts its cell away."""
    ours, theirs = socket.socketpair()
    process = subprocess.Popen(
        [sys.executable, "-c", SLOW_TO_TIDY, str(theirs.fileno())],
        pass_fds=[theirs.fileno()], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    theirs.close()
    link = Connection(ours.detach())
    link.send_bytes(b"a cell")
    assert process.stdout is not None
    assert process.stdout.readline() == "begun\n"
    process.send_signal(signal.SIGTERM)
    link.close()
    printed, errors = process.communicate(timeout=30)
    assert (printed, errors) == ("tidied\n", "")
    assert process.returncode == -signal.SIGTERM
