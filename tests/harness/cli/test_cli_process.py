"""The command line as a process: signals, exit codes as the shell sees them, progress, entry points."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from ninedisk.harness.results.reader import run_ids


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "ninedisk", *arguments]


def ninedisk(folder: Path, environment: dict[str, str], *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command(*arguments), cwd=folder, env=environment, capture_output=True, text=True, timeout=120, check=False
    )


def wait_for(path: Path) -> None:
    """Until a cell runs."""
    end = time.monotonic() + 120.0
    while not path.exists():
        assert time.monotonic() < end, "the engine did not start"
        time.sleep(0.02)


def test_the_shell_sees_the_exit_code(tmp_path: Path, fake_environment: dict[str, str]) -> None:
    done = ninedisk(tmp_path, fake_environment, "run", "fake/fall", "--engine", "fake-wrong")
    assert done.returncode == 1, done.stderr
    assert done.stderr == ""


@pytest.mark.sampled(1)
@pytest.mark.parametrize("jobs", ["1", "2"])
def test_ctrl_c(
    tmp_path: Path,
    fake_environment: dict[str, str],
    hears_signals: Callable[[], None],
    dies: Callable[[int], bool],
    jobs: str,
) -> None:
    """A run that is interrupted inside a cell says so, stores nothing, leaves earlier results alone and no process behind."""
    assert ninedisk(tmp_path, fake_environment, "run", "fake/fall", "-e", "fake-good").returncode == 0
    before = run_ids(tmp_path / "results")
    process = subprocess.Popen(
        command("run", "fake/fall", "-e", "fake-slow", "--json", "rows.json", "--jobs", jobs),
        cwd=tmp_path, env=fake_environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        preexec_fn=hears_signals,
    )  # fmt: skip
    wait_for(tmp_path / "slow.started")
    worker = int((tmp_path / "slow.started").read_text())
    assert worker != process.pid
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert errors.strip().endswith("interrupted: nothing was stored")
    assert dies(worker)
    assert "Traceback" not in errors
    assert run_ids(tmp_path / "results") == before
    assert sorted(path.name for path in (tmp_path / "results" / "runs").iterdir()) == before
    assert not (tmp_path / "rows.json").exists()


def test_kill_in_the_middle_of_a_run(
    tmp_path: Path, fake_environment: dict[str, str], dies: Callable[[int], bool]
) -> None:
    process = subprocess.Popen(command("run", "fake/fall", "-e", "fake-slow"), cwd=tmp_path, env=fake_environment)
    wait_for(tmp_path / "slow.started")
    process.kill()
    process.wait(timeout=60)
    assert dies(int((tmp_path / "slow.started").read_text()))
    assert run_ids(tmp_path / "results") == []
    assert ninedisk(tmp_path, fake_environment, "run", "fake/fall", "-e", "fake-good").returncode == 0
    assert len(run_ids(tmp_path / "results")) == 1


def test_a_closed_pipe_gives_no_traceback(tmp_path: Path, fake_environment: dict[str, str]) -> None:
    line = f"{sys.executable} -m ninedisk run fake/fall -e fake-good | head -c 1"
    done = subprocess.run(
        ["sh", "-c", line], cwd=tmp_path, env=fake_environment, capture_output=True, text=True, timeout=60
    )
    assert "Traceback" not in done.stderr
    assert "Error" not in done.stderr


@pytest.mark.sampled(1)
@pytest.mark.parametrize(("engine", "code"), [("fake-good", 0), ("fake-wrong", 1)])
def test_a_reader_that_leaves_changes_no_verdict(
    tmp_path: Path, fake_environment: dict[str, str], engine: str, code: int
) -> None:
    """Its end of the pipe is closed before the first line: exit code, results and files are those of the run all the same."""
    reads, writes = os.pipe()
    os.close(reads)
    done = subprocess.run(
        command("run", "fake/fall", "-e", engine, "--json", "rows.json"),
        cwd=tmp_path, env=fake_environment, stdout=writes, stderr=subprocess.PIPE, text=True, timeout=300, check=False,
    )  # fmt: skip
    os.close(writes)
    assert done.returncode == code, done.stderr
    assert "rror" not in done.stderr
    assert len(run_ids(tmp_path / "results")) == 1
    assert json.loads((tmp_path / "rows.json").read_text())
    for words in (["show"], ["run", "--help"]):
        reads, writes = os.pipe()
        os.close(reads)
        done = subprocess.run(command(*words), cwd=tmp_path, env=fake_environment, stdout=writes, stderr=subprocess.PIPE,
                              text=True, timeout=300, check=False)  # fmt: skip
        os.close(writes)
        assert done.returncode == 0, (words, done.stderr)
        assert "rror" not in done.stderr


def test_argv_is_recorded_without_folders(tmp_path: Path, fake_environment: dict[str, str]) -> None:
    store = tmp_path / "my store"
    assert (
        ninedisk(tmp_path, fake_environment, "run", "fake/fall", "-e", "fake-good", "--store", str(store)).returncode
        == 0
    )
    text = (store / "runs" / run_ids(store)[0] / "run.json").read_text()
    assert json.loads(text)["argv"] == ["ninedisk", "run", "fake/fall", "-e", "fake-good", "--store", "my store"]
    assert str(tmp_path) not in text
