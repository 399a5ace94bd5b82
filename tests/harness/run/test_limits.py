"""An engine that takes all memory is stopped, says so, and the run goes on."""

from __future__ import annotations

import json
import math
import os
import shlex
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from ninedisk.harness.api.engine import EngineError
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.cli.app import app
from ninedisk.harness.run.isolation import run_isolated
from ninedisk.harness.run.limits import MEMORY_VARIABLE, default_limit, read_size, resident
from ninedisk.harness.run.plan import plan_matrix
from ninedisk.harness.run.workers import run_cells

BAD = Path(__file__).parents[1] / "wire" / "bad_engine.py"

HOG = """
import sys, time, threading, subprocess
def take():
    held = []
    for _ in range(40):  # 800 MB in all, so that a limit that does not act harms nobody
        held.append(b"x" * 20_000_000)
        time.sleep(0.02)
def begin():
    subprocess.run([sys.executable, "-c", HOG, "alone"])
if sys.argv[1:] == ["alone"]:
    take()
else:
    thread = threading.Thread(target=begin)
    thread.start()
    thread.join()
"""


@pytest.mark.parametrize("alone", [True, False])
def test_a_command_and_what_it_starts_are_watched(monkeypatch: pytest.MonkeyPatch, alone: bool) -> None:
    """Also a child that another thread than the first has started."""
    monkeypatch.setenv(MEMORY_VARIABLE, "200 MB")
    code = HOG.replace("HOG", "sys.stdin.read()")
    with pytest.raises(
        EngineError, match=r"was stopped because it held 0\.2\d* GB of memory, more than the limit of 0\.2 GB"
    ):
        run_isolated([sys.executable, "-c", code, *(["alone"] if alone else [])], stdin=HOG)


@pytest.mark.usefixtures("fakes")
def test_an_engine_in_a_worker_is_watched(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    cells = plan_matrix(["fake/fall"], ["fake-hog", "fake-good"], {"a": 1})
    hog, good = run_cells(cells, jobs=1, memory=600e6)
    assert (hog.status, good.status) == ("error", "pass")
    assert "its process was stopped because it held" in hog.reason
    assert "--memory-limit" in hog.reason


def test_from_the_command_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    command = shlex.join([sys.executable, str(BAD), "hog"])
    arguments = ["--engine-cmd", command, "--memory-limit", "300 MB", "--engine", "pymunk", "--json", "rows.json"]
    done = CliRunner().invoke(app, ["run", "binary-collision", "--set", "kind=elastic", *arguments])
    assert done.exit_code == 3, done.output
    rows = json.loads(Path("rows.json").read_text())
    assert {row["status"] for row in rows if row["engine"] == "pymunk"} == {"pass"}
    bad = {row["variant"]: row["reason"] for row in rows if row["engine"] == "bad"}
    assert bad
    assert all("more than the limit of 0.3 GB" in reason for reason in bad.values()), bad


@pytest.mark.parametrize(("text", "size"), [("4 GB", 4e9), ("1.5gib", 1.5 * 2**30), ("none", math.inf)])
def test_sizes(text: str, size: float) -> None:
    assert read_size(text, "--memory-limit") == size


@pytest.mark.parametrize("text", ["4", "GB", "-1 GB", "0 MB", "1.2.3 GB", ""])
def test_what_is_no_size(text: str) -> None:
    with pytest.raises(UsageError, match="for instance '4 GB', or none"):
        read_size(text, "--memory-limit")


def test_what_a_process_holds() -> None:
    before = resident(os.getpid(), children=False)
    block = b"x" * 100_000_000
    assert 0.9e8 < resident(os.getpid(), children=False) - before < 1.5e8 < len(block) * 2
    assert resident(2**22 + 1) == 0
    assert default_limit(1000) <= default_limit(1)
