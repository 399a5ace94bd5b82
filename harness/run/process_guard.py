"""Nothing that a process of ours starts outlives it, whatever ends it.

A process that starts others first starts its guard: this file as a program, in its own session, with the reading end of a pipe
whose only writing end its owner holds. When that end closes, by a return, an exception or any signal, SIGKILL included, the guard
ends all that carry the owner's mark in their environment: SIGTERM first, so that a worker can put away its cell, SIGKILL after `GRACE`.
Children inherit the mark, so that neither a process group nor a session hides them. Between fork and exec a child holds the writing end
as well: the guard begins when it is marked.

It needs /proc; without it workers still see their link close, and engines end with their groups as long as their owner can find them.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

MARK = "NINEDISK_OWNER"
GRACE = 0.75
"""Seconds between SIGTERM and SIGKILL: a worker that has to be killed leaves engines behind, whose own guard takes as long again."""
PATIENCE = 10.0
"""Seconds after which the guard gives up on a process that even SIGKILL does not end (one that waits for a device)."""

_PROCESSES = Path("/proc")
_lock = threading.Lock()
_token, _pipe = "", -1


def guarded_environment(environment: Mapping[str, str] | None = None) -> dict[str, str]:
    """Environment for a process that ends with this one, if not before.

    Parameters
    ----------
    environment : mapping, optional
        What else it holds; None: this process's own.

    Raises
    ------
    OSError
        If the guard cannot be started.
    """
    global _token, _pipe
    kept = dict(os.environ if environment is None else environment)
    if not (_PROCESSES / "self" / "environ").exists():
        return kept
    with _lock:
        if not _token:
            _token, _pipe = _start_guard()
        return {**kept, MARK: _token}


def _start_guard() -> tuple[str, int]:
    """Start the guard; its mark, and the descriptor that this process holds until it ends."""
    token = os.urandom(16).hex()
    reading, writing = os.pipe()
    own = {name: value for name, value in os.environ.items() if name != MARK}
    try:
        # The program makes a copy of itself and ends: the guard is nobody's child.
        subprocess.run(
            [sys.executable, "-I", "-S", __file__, str(reading), token],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            pass_fds=(reading,),
            env=own,
            start_new_session=True,
            check=True,
        )
    except BaseException as error:
        os.close(writing)
        if isinstance(error, subprocess.CalledProcessError):
            raise OSError(f"the process that ends others with this one cannot be started: {error}") from error
        raise
    finally:
        os.close(reading)
    return token, writing


def _forget_guard() -> None:
    """In a copy of this process: its end is not its owner's, and what it starts is its own."""
    global _token, _pipe, _lock
    if _pipe >= 0:
        os.close(_pipe)
    _token, _pipe, _lock = "", -1, threading.Lock()


os.register_at_fork(after_in_child=_forget_guard)


def watch_owner(reading: int, token: str) -> None:
    """Wait until nobody holds the other end of the pipe, then end every process that carries the mark."""
    while os.read(reading, 1):
        pass
    mark = f"{MARK}={token}".encode()
    begin, asked = time.monotonic(), set[int]()
    while (alive := _guarded_processes(mark)) and time.monotonic() < begin + PATIENCE:
        late = time.monotonic() >= begin + GRACE
        for pid in alive if late else alive - asked:
            with suppress(ProcessLookupError, PermissionError):
                os.kill(pid, signal.SIGKILL if late else signal.SIGTERM)
        asked |= alive
        time.sleep(0.02)


def _guarded_processes(mark: bytes) -> set[int]:
    found = set()
    for folder in _PROCESSES.iterdir():
        if folder.name.isdigit():
            with suppress(OSError):  # it has ended, or belongs to another process
                if mark in (folder / "environ").read_bytes().split(b"\0"):
                    found.add(int(folder.name))
    return found


if __name__ == "__main__":
    if os.fork():
        os._exit(0)
    watch_owner(int(sys.argv[1]), sys.argv[2])
