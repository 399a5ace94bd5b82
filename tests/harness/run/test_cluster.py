"""Cells on a local Dask cluster of two workers."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

import ninedisk
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.cli.app import app
from ninedisk.harness.results.reader import run_facts, run_ids
from ninedisk.harness.results.tables import CaseResult
from ninedisk.harness.run.cluster import connected
from ninedisk.harness.run.plan import plan_matrix
from ninedisk.harness.run.workers import run_cells

distributed = pytest.importorskip("distributed")


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory, fake_folder: Path) -> Iterator[str]:
    """Scheduler of two workers whose working directory is empty; it begins a cell twice at most."""
    import dask

    with pytest.MonkeyPatch.context() as patch, dask.config.set({"distributed.scheduler.allowed-failures": 1}):
        patch.chdir(tmp_path_factory.mktemp("workers"))
        patch.syspath_prepend(str(fake_folder))
        with distributed.LocalCluster(n_workers=2, threads_per_worker=2, dashboard_address=None) as local:
            yield local.scheduler_address


def test_the_same_results_as_here(address: str, bits: Callable[[CaseResult], bytes], tmp_path: Path) -> None:
    cells = plan_matrix(["binary-collision"], ["pymunk", "dem"], {"kind": "elastic"})
    with connected(address) as cluster:
        found = run_cells(cells, cluster=cluster)
    assert [bits(result) for result in found] == [bits(result) for result in run_cells(cells)]
    words = [
        "run",
        "binary-collision",
        "--engine",
        "dem",
        "--set",
        "kind=elastic",
        "--store",
        str(tmp_path),
        "--dask",
        address,
    ]
    assert CliRunner().invoke(app, words).exit_code == 0
    about = json.loads((tmp_path / "runs" / run_ids(tmp_path)[0] / "run.json").read_text())
    assert about["provenance"]["jobs"] == 2
    assert run_facts(about).machine.endswith(", 2 cells at once on a Dask cluster")


@pytest.mark.usefixtures("fakes")
def test_a_dying_worker_costs_no_other_cell(address: str) -> None:
    names = ["good", "killed-once", "wrong", "killed", "good", "bug"]
    seen: list[tuple[int, int, str]] = []
    cells = plan_matrix(["fake/fall"], [f"fake-{name}" for name in names], {"a": 1})
    with connected(address) as cluster:
        results = run_cells(cells, lambda *at: seen.append(at), cluster=cluster)
    assert [result.cell["engine"] for result in results] == [f"fake-{name}" for name in names]
    assert [result.status for result in results] == ["pass", "pass", "fail", "error", "pass", "error"]
    assert results[3].reason == "its process was ended by SIGKILL, 2 times in a row"
    assert [at[0] for at in seen] == sorted(at[0] for at in seen)
    assert seen[-1] == (6, 6, "")


def start(*words: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen([sys.executable, "-m", "distributed.cli." + words[0], *words[1:]], stdout=subprocess.DEVNULL,
                            stderr=subprocess.DEVNULL)  # fmt: skip


@pytest.mark.sampled(1)
@pytest.mark.parametrize("lost", ["worker", "scheduler"])
@pytest.mark.usefixtures("fakes")
def test_a_cluster_that_is_lost_keeps_what_is_done(
    tmp_path: Path, fake_folder: Path, monkeypatch: pytest.MonkeyPatch, lost: str
) -> None:
    """Its only worker, or its scheduler, ends while a cell runs: the run says so, gives up, and stores the cells that are done."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(fake_folder))
    for name in ("PATIENCE", "NO_WORKER"):
        monkeypatch.setattr(f"ninedisk.harness.run.cluster.{name}", 30.0 if name == "PATIENCE" else 3.0)
    about = tmp_path / "scheduler.json"
    ours = {"scheduler": start("dask_scheduler", "--port", "0", "--no-dashboard", "--scheduler-file", str(about))}
    try:
        ours["worker"] = start("dask_worker", "--scheduler-file", str(about), "--nworkers", "1", "--nthreads", "1", "--no-nanny",
                               "--no-dashboard")  # fmt: skip
        end = time.monotonic() + 120.0
        while not about.exists():
            assert time.monotonic() < end
            time.sleep(0.1)

        def kill() -> None:
            while not (tmp_path / "slow.started").exists() and time.monotonic() < end:
                time.sleep(0.05)
            for name in {"worker": ["worker"], "scheduler": ["scheduler", "worker"]}[lost]:
                ours[name].kill()

        threading.Thread(target=kill, daemon=True).start()
        words = [
            "run",
            "fake/fall",
            "-e",
            "fake-good",
            "-e",
            "fake-slow",
            "--set",
            "a=1",
            "--dask",
            str(json.loads(about.read_text())["address"]),
        ]
        done = CliRunner().invoke(app, words)
    finally:
        for process in ours.values():
            process.kill()
            process.wait()
    assert done.exit_code == 3, done.output
    why = {"worker": "the Dask cluster had no worker for 3 s", "scheduler": "the scheduler of the Dask cluster is lost"}
    assert f"fake-slow: not run: {why[lost]}" in done.stdout, done.output
    assert "cells: 1 error, 1 pass" in done.stdout
    assert len(run_ids(tmp_path / "results")) == 1


def test_a_worker_of_another_version_is_refused(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ninedisk, "__version__", "0.0.0.other")
    with (
        pytest.raises(UsageError, match=r"has another version of ninedisk \(.*0\.0\.0\.other here\)"),
        connected(address),
    ):
        pass


def test_nobody_at_the_address(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ninedisk.harness.run.cluster.PATIENCE", 1.0)
    with pytest.raises(UsageError, match="no Dask scheduler answers there"), connected("tcp://127.0.0.1:1"):
        pass
    with pytest.raises(UsageError, match="no Dask scheduler answers there"), connected("nonsense://x"):
        pass
