"""A process that runs cells one after the other, and the handle by which it is fed.

The process is a fresh interpreter, not a copy of this one: locks and threads of libraries do not survive a copy. It stays warm
from cell to cell, so that modules and compiled kernels are loaded once. It ends when its link closes, whatever happens to this
process; a cell in hand is then interrupted as by Ctrl-C, so that its external engine and temporary folder go with it. One that does not
heed that is killed by the warden of the process that it serves.
"""

from __future__ import annotations

import faulthandler
import os
import pickle
import re
import select
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import IO

from ninedisk.harness.results.tables import CaseResult
from ninedisk.harness.run.isolation import signal_name
from ninedisk.harness.run.plan import Cell
from ninedisk.harness.run.warden import owned

GRACE = 5.0
"""Seconds that a worker gets to put away its cell before it is killed."""

_FRAME = re.compile(r'^  File "(?P<path>.*)", line (?P<line>\d+) in (?P<where>.*)$', re.MULTILINE)
_BOOT = "import sys; sys.path[:] = {path!r}; from ninedisk.harness.run.workers import serve; serve({link}, {dump})"


@dataclass(frozen=True, kw_only=True)
class Task:
    """A cell and how it is run; see `ninedisk.harness.run.runner.run_cell`."""

    cell: Cell
    published: Path | None
    raise_users_mistakes: bool


@dataclass(frozen=True, kw_only=True)
class Answer:
    """What became of a task: its result, or the mistake of the user to raise, or why the task could not be read there."""

    result: CaseResult | None = None
    mistake: Exception | None = None
    unreadable: str = ""


class LostWorkerError(Exception):
    """A worker ended inside a task.

    Attributes
    ----------
    own_doing : bool
        Whether the code that ran there ended it (a crash, an exit), as opposed to someone outside (SIGKILL, SIGTERM).
    """

    def __init__(self, message: str, *, own_doing: bool) -> None:
        super().__init__(message)
        self.own_doing = own_doing


def answered(payload: bytes) -> bytes:
    """Run a pickled `Task`; the pickled `Answer`."""
    from ninedisk.harness.run.runner import USERS_MISTAKES, run_cell

    try:
        task: Task = pickle.loads(payload)
    except Exception as error:
        answer = Answer(unreadable=f"{type(error).__name__}: {error}")
    else:
        try:
            mistakes = task.raise_users_mistakes
            answer = Answer(result=run_cell(task.cell, published=task.published, raise_users_mistakes=mistakes))
        except USERS_MISTAKES as error:
            answer = Answer(mistake=error)
    return pickle.dumps(answer, protocol=pickle.HIGHEST_PROTOCOL)


def serve(link: int, dump: int) -> None:
    """Answer tasks until the link closes: the main function of a worker.

    Parameters
    ----------
    link, dump : int
        File descriptors of the socket of tasks and answers, and of the file that takes the stack of a crash.
    """
    in_cell = False

    def stop(*_: object) -> None:
        if in_cell:
            # Once: this process and the one that it serves may both end it, and the second signal would fall into the tidying up.
            signal.signal(signal.SIGTERM, lambda *_: None)
            raise KeyboardInterrupt
        os._exit(0)

    # Handlers, not SIG_IGN: what an external engine inherits is the default again.
    signal.signal(signal.SIGINT, lambda *_: None)  # the terminal's Ctrl-C is the parent's to handle
    signal.signal(signal.SIGTERM, stop)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
    faulthandler.enable(file=dump, all_threads=False)
    threading.Thread(target=_end_with, args=(link,), daemon=True).start()
    connection = Connection(link)
    try:
        while True:
            payload = connection.recv_bytes()
            in_cell = True
            connection.send_bytes(answered(payload))
            in_cell = False
    except (EOFError, OSError):
        pass
    except KeyboardInterrupt:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        os.kill(os.getpid(), signal.SIGTERM)


def _end_with(link: int) -> None:
    """End this process when nobody holds the other end of the link any more, whatever it is doing."""
    hung_up = select.poll()
    hung_up.register(link, 0)
    hung_up.poll()
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(GRACE)
    os.kill(os.getpid(), signal.SIGKILL)


class Worker:
    """Handle of a worker process; it starts at once and can be given a task while it still loads."""

    def __init__(self) -> None:
        ours, theirs = socket.socketpair()
        self._dump: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115  (closed by `end`)
        boot = _BOOT.format(path=sys.path, link=theirs.fileno(), dump=self._dump.fileno())
        environment = owned()
        masked = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-c", boot],
                stdin=subprocess.DEVNULL,
                pass_fds=(theirs.fileno(), self._dump.fileno()),
                env=environment,
            )
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, masked)
            theirs.close()
        self.link = Connection(ours.detach())

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self._process.pid

    def give(self, payload: bytes) -> bool:
        """Send a pickled `Task`; False if the worker is gone."""
        try:
            self.link.send_bytes(payload)
        except OSError:
            return False
        return True

    def take(self) -> Answer:
        """Receive the answer to the task given.

        Raises
        ------
        LostWorkerError
            If the worker ended instead, with how and where.
        """
        try:
            answer: Answer = pickle.loads(self.link.recv_bytes())
        except (EOFError, OSError):
            raise self._lost() from None
        return answer

    def _lost(self) -> LostWorkerError:
        try:
            status = self._process.wait(GRACE)
        except subprocess.TimeoutExpired:  # it closed its link and lives on
            self._process.kill()
            status = self._process.wait()
        self._dump.seek(0)
        where = crash_place(self._dump.read().decode(errors="replace"))
        how = f"was ended by {signal_name(-status)}" if status < 0 else f"ended with status {status}"
        outside = status in (-signal.SIGKILL, -signal.SIGTERM, -signal.SIGINT, -signal.SIGHUP)
        return LostWorkerError(f"its process {how}{where}", own_doing=not outside)

    def ask_to_end(self) -> None:
        """Close the link, which ends an idle worker, and interrupt a busy one."""
        self.link.close()
        with suppress(ProcessLookupError):
            self._process.terminate()

    def end(self, deadline: float) -> None:
        """Wait for the end until ``deadline`` (`time.monotonic`), then kill."""
        try:
            self._process.wait(max(0.0, deadline - time.monotonic()))
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._dump.close()


def end_workers(workers: list[Worker]) -> None:
    """End all of them, together within `GRACE` seconds."""
    for worker in workers:
        worker.ask_to_end()
    deadline = time.monotonic() + GRACE
    for worker in workers:
        worker.end(deadline)


def crash_place(dump: str) -> str:
    """``" at file.py:line in function"`` from what `faulthandler` wrote; empty if it wrote nothing."""
    frame = _FRAME.search(dump)
    return f" at {Path(frame['path']).name}:{frame['line']} in {frame['where']}" if frame else ""


def pickled(task: Task) -> bytes | None:
    """The task as bytes; None if it holds something that cannot leave this process (a local class, a lambda)."""
    try:
        return pickle.dumps(task, protocol=pickle.HIGHEST_PROTOCOL)
    except Exception:
        return None
