"""Nothing that a command starts outlives it, whatever signal ends it: also an engine that ignores signals and hides its children."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest

SECONDS = 30.0
"""After the end of a command. The guard takes 1.5 s, twice its grace, and what a busy machine adds; who survives it stays for good."""

ALL = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGKILL)
HARD = (signal.SIGTERM, signal.SIGKILL)


def carrying(mark: str) -> dict[int, str]:
    """Processes with this word in their environment, and their commands."""
    found = {}
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            with suppress(OSError):
                if mark.encode() in (folder / "environ").read_bytes().split(b"\0"):
                    found[int(folder.name)] = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode()[:200]
    return found


@pytest.fixture
def mark() -> Iterator[str]:
    """A word in the environment of the command, and so of all its offspring; whoever is left at the end is killed."""
    word = f"NINEDISK_TEST_SURVIVORS={os.urandom(8).hex()}"
    yield word
    for pid in carrying(word):
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)


COMMANDS = {
    "run": ("run", "fake/fall", "-e", "fake-stubborn"),
    "jobs": ("run", "fake/fall", "-e", "fake-stubborn", "--jobs", "2"),
    "converge": ("converge", "fake/fall", "-e", "fake-stubborn"),
    "check-engine": ("check-engine", "fake-stubborn"),
    "selftest": ("selftest", "--quick", "--only", "dem/*", "--jobs", "2"),
    "bench": ("bench", "harness"),
}
BUSY = {"selftest": ("selftest/driver.py", 2), "bench": ("ninedisk run", 1)}
"""Commands that run our own engines: what their children are called, and how many there are at once."""


@pytest.mark.sampled(6)
@pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="the warden needs /proc")
@pytest.mark.parametrize(
    ("name", "number"),
    [(name, number) for name in COMMANDS for number in (ALL if name in ("run", "selftest") else HARD)],
)
def test_nothing_outlives_a_command(
    tmp_path: Path,
    fake_environment: dict[str, str],
    mark: str,
    hears_signals: Callable[[], None],
    name: str,
    number: signal.Signals,
) -> None:
    key, value = mark.split("=")
    log = tmp_path / "printed"
    # Into a file: the end of a pipe would be that of the last process that holds it.
    with log.open("w") as out:
        process = subprocess.Popen(
            [sys.executable, "-m", "ninedisk", *COMMANDS[name]],
            cwd=tmp_path, env={**fake_environment, key: value}, preexec_fn=hears_signals,
            stdin=subprocess.DEVNULL, stdout=out, stderr=subprocess.STDOUT, start_new_session=True,
        )  # fmt: skip
    word, count = BUSY.get(name, ("", 0))
    end = time.monotonic() + 120.0
    while not (
        (tmp_path / "stubborn.started").exists()
        if not word
        else sum(word in said for said in carrying(mark).values()) >= count
    ):
        assert process.poll() is None, log.read_text()
        assert time.monotonic() < end, "it did not begin to work"
        time.sleep(0.05)
    assert len(carrying(mark)) > count
    process.send_signal(number)
    process.wait(timeout=60)
    left_at = time.monotonic() + SECONDS
    while carrying(mark) and time.monotonic() < left_at:
        time.sleep(0.02)
    assert carrying(mark) == {}
    printed = log.read_text()
    assert process.returncode == (-number if number == signal.SIGKILL else 130), printed
    assert "Traceback" not in printed
