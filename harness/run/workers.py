"""Runs many cells: in this process, in workers beside it, or on a cluster.

Every worker has one cell at a time, so that it is known whose cell a dying worker had; pools of processes (concurrent.futures,
loky) give up everything that waits as soon as one of their processes dies, and cannot say what killed it.

A worker is a fresh interpreter, not a copy of this one: locks and threads of libraries do not survive a copy. It stays warm
from cell to cell, so that modules and compiled kernels are loaded once. It ends when its link closes, whatever happens to this
process; a cell in hand is then interrupted as by Ctrl-C, so that its external engine and temporary folder go with it. One that does
not heed that is killed by the guard of the process that it serves.
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
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from math import isinf
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import IO, Any, Protocol, cast

from ninedisk.harness.api.engine import Engine
from ninedisk.harness.results.tables import CaseResult
from ninedisk.harness.run.isolation import signal_name, warm_starts
from ninedisk.harness.run.limits import MEMORY_VARIABLE, default_limit, exceeds_memory, memory_limit, resident
from ninedisk.harness.run.plan import Cell, plan_matrix
from ninedisk.harness.run.process_guard import guarded_environment
from ninedisk.harness.run.runner import Patience, Progress, broken_cell, run_cell

LOOK = 0.5
"""Seconds between two looks at the memory of workers."""

GRACE = 5.0
"""Seconds that a worker gets to put away its cell before it is killed."""

_FRAME = re.compile(r'^  File "(?P<path>.*)", line (?P<line>\d+) in (?P<where>.*)$', re.MULTILINE)
_BOOT = "import sys; sys.path[:] = {path!r}; from ninedisk.harness.run.workers import serve; serve({link}, {dump})"


ATTEMPTS = 2
"""How often a cell is begun whose worker someone outside ends, the system short of memory for instance."""


Keep = Callable[[int, CaseResult], None]
"""Called with the number of a cell and its result."""


class CellRunner(Protocol):
    """Runs cells on other machines."""

    def run(
        self,
        cells: Sequence[Cell],
        progress: Progress | None,
        *,
        published: Path | None,
        raise_users_mistakes: bool,
        memory: float | None,
        kept: Mapping[int, CaseResult] | None,
        keep: Keep | None,
    ) -> list[CaseResult]:
        """Results in the order of the cells; see `run_cells`."""


def run_matrix(
    case_ids: Sequence[str],
    engine_ids: Sequence[str | Engine],
    overrides: Mapping[str, Any] | None = None,
    progress: Progress | None = None,
    *,
    jobs: int = 0,
) -> list[CaseResult]:
    """Run every (case variant, engine) cell; see `ninedisk.harness.run.plan.plan_matrix` for the variants and the errors.

    A cell that fails, hangs or crashes is a status and never the end of the run. Where the user's own parameters make
    the only cell impossible, the `CoreError` is raised, because there is nothing else to show. ``jobs`` as in `run_cells`.
    """
    return run_cells(plan_matrix(case_ids, engine_ids, overrides or {}), progress, jobs=jobs)


def run_cells(
    cells: Sequence[Cell],
    progress: Progress | None = None,
    *,
    published: Path | None = None,
    jobs: int = 0,
    cluster: CellRunner | None = None,
    memory: float | None = None,
    kept: Mapping[int, CaseResult] | None = None,
    keep: Keep | None = None,
) -> list[CaseResult]:
    """Run planned cells; the results are in their order, and the same, wherever they run.

    An engine that hangs is given up (`ninedisk.harness.run.runner.Patience`), except on a cluster, whose cells are all handed out at once.

    Parameters
    ----------
    cells : sequence of Cell
    progress : callable, optional
    published : Path, optional
        Folder with digitised curves of your own that join the truths.
    jobs : int
        0: one after the other in this process, which an engine's crash ends. Else in that many worker processes, where a
        crash is a status.
    cluster : CellRunner, optional
        Run them there instead (`ninedisk.harness.run.cluster`).
    memory : float, optional
        Bytes that a cell's engine may hold, in its own process or in a worker's; None: `ninedisk.harness.run.limits.memory_limit`,
        and on this machine with several jobs their share of `ninedisk.harness.run.limits.default_limit`.
    kept : mapping, optional
        Results of an interrupted run by the number of their cell, which are not run.
    keep : callable, optional
        Called with the number and the result of each cell that was run, as it comes in.
    """
    alone = len(cells) == 1 and cells[0].user_set
    if cluster is not None:
        return cluster.run(
            cells, progress, published=published, raise_users_mistakes=alone, memory=memory, kept=kept, keep=keep
        )
    if jobs:
        return run_in_workers(
            cells,
            progress,
            jobs=jobs,
            published=published,
            raise_users_mistakes=alone,
            memory=memory,
            kept=kept,
            keep=keep,
        )
    patience, have = Patience(), dict(kept or {})
    results = []
    for number, cell in enumerate(cells):
        if number in have:
            results.append(have[number])
        else:
            if progress is not None:
                progress(len(have), len(cells), cell.name)
            given_up = patience.given_up(cell)
            results.append(run_cell(cell, published=published, raise_users_mistakes=alone, given_up=given_up))
            have[number] = results[-1]
            if keep is not None:
                keep(number, results[-1])
        patience.record_outcome(cell, results[-1])
    if progress is not None:
        progress(len(cells), len(cells), "")
    return results


@dataclass(frozen=True, kw_only=True)
class Task:
    """A cell and how it is run; see `ninedisk.harness.run.runner.run_cell`."""

    cell: Cell
    published: Path | None
    raise_users_mistakes: bool
    given_up: str = ""
    memory: float | None = None


@dataclass(frozen=True, kw_only=True)
class TaskResult:
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


def run_task(payload: bytes) -> bytes:
    """Run a pickled `Task`; the pickled `TaskResult`."""
    from ninedisk.harness.run.runner import USERS_MISTAKES, run_cell

    try:
        task: Task = pickle.loads(payload)
    except Exception as error:
        outcome = TaskResult(unreadable=f"{type(error).__name__}: {error}")
    else:
        if task.memory is not None:
            os.environ[MEMORY_VARIABLE] = "none" if isinf(task.memory) else f"{task.memory / 1e9:.9f} GB"
        try:
            outcome = TaskResult(
                result=run_cell(
                    task.cell,
                    published=task.published,
                    raise_users_mistakes=task.raise_users_mistakes,
                    given_up=task.given_up,
                )
            )
        except USERS_MISTAKES as error:
            outcome = TaskResult(mistake=error)
    return pickle.dumps(outcome, protocol=pickle.HIGHEST_PROTOCOL)


def serve(link: int, dump: int) -> None:
    """Run tasks and answer each, until the link closes: the main function of a worker.

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
    threading.Thread(target=_end_process, args=(link,), daemon=True).start()
    connection = Connection(link)
    warm_starts()
    try:
        while True:
            payload = connection.recv_bytes()
            in_cell = True
            connection.send_bytes(run_task(payload))
            in_cell = False
    except (EOFError, OSError):
        pass
    except KeyboardInterrupt:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        os.kill(os.getpid(), signal.SIGTERM)


def _end_process(link: int) -> None:
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
        environment = guarded_environment()
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

    def take(self) -> TaskResult:
        """Receive the answer to the task given.

        Raises
        ------
        LostWorkerError
            If the worker ended instead, with how and where.
        """
        try:
            outcome: TaskResult = pickle.loads(self.link.recv_bytes())
        except (EOFError, OSError):
            raise self._lost() from None
        return outcome

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

    def kill(self) -> None:
        """End it now; its guard ends what it has started."""
        self._process.kill()
        self._process.wait()

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


def run_in_workers(
    cells: Sequence[Cell],
    progress: Progress | None = None,
    *,
    jobs: int,
    published: Path | None = None,
    raise_users_mistakes: bool = False,
    memory: float | None = None,
    kept: Mapping[int, CaseResult] | None = None,
    keep: Keep | None = None,
) -> list[CaseResult]:
    """Run cells in up to ``jobs`` workers; the results in the order of the cells, whichever ends first.

    A cell whose code ends its worker (a segmentation fault) is an error. A cell whose worker is ended from outside is run
    again, once; one whose worker holds too much memory is an error.
    An engine that uses several threads counts as that many cells. A cell that cannot be sent to another process
    is run in this one, after all others have begun.

    Raises
    ------
    CoreError
        A mistake in the user's parameters, if that was asked for.
    """
    if memory is None and not os.environ.get(MEMORY_VARIABLE):
        memory = default_limit(jobs)
    run = _Dispatch(
        cells, jobs, progress, published, raise_users_mistakes, memory_limit() if memory is None else memory
    )
    run.resume(kept or {}, keep)
    try:
        run.finish()
    finally:
        end_workers(run.workers)
    return [result for result in run.results if result is not None]


class _Dispatch:
    """Cells that wait, cells in the hands of workers, and results."""

    def __init__(
        self,
        cells: Sequence[Cell],
        jobs: int,
        progress: Progress | None,
        published: Path | None,
        raise_users_mistakes: bool,
        memory: float,
    ) -> None:
        self.cells, self.jobs, self.progress = cells, jobs, progress
        self.published, self.raise_users_mistakes, self.memory = published, raise_users_mistakes, memory
        self._patience = Patience()
        self.results: list[CaseResult | None] = [None] * len(cells)
        self.workers: list[Worker] = []
        self._idle: list[Worker] = []
        self._busy: dict[Worker, int] = {}
        self._waiting = deque(range(len(cells)))
        self._here: deque[int] = deque()
        self._begun = [0] * len(cells)
        self._threads: dict[str, int] = {}
        self._done = 0
        self._tell: Keep | None = None

    def resume(self, kept: Mapping[int, CaseResult], keep: Keep | None) -> None:
        """Take what an interrupted run has left, and whom to give what comes in."""
        for number, result in kept.items():
            self.results[number] = result
        self._done, self._tell = len(kept), keep

    def finish(self) -> None:
        """Until every cell has its result."""
        while self._waiting or self._busy or self._here:
            while self._waiting and self._free_slots(self._waiting[0]):
                number = self._waiting.popleft()
                known = self.results[number]
                if known is None:
                    self._start_task(number)
                else:
                    self._patience.record_outcome(self.cells[number], known)
            if self._here and not self._waiting:
                self._run_here(self._here.popleft())
            by_link = {worker.link: worker for worker in self._busy}
            for link in wait(list(by_link), 0.0 if self._here else LOOK) if by_link else []:
                self._receive(by_link[cast(Connection, link)])
            self._end_large_workers()
        self._report("")

    def _free_slots(self, number: int) -> bool:
        used = sum(self._share(busy) for busy in self._busy.values())
        return used + self._share(number) <= self.jobs

    def _share(self, number: int) -> int:
        """Jobs that a cell counts for: the threads of its engine, at most all there are."""
        engine = self.cells[number].engine
        if self.jobs == 1 or isinstance(engine, Exception):
            return 1
        name = self.cells[number].engine_id
        if name not in self._threads:
            self._threads[name] = _threads(engine)
        return max(1, min(self.jobs, self._threads[name]))

    def _start_task(self, number: int) -> None:
        cell = self.cells[number]
        task = Task(
            cell=cell,
            published=self.published,
            raise_users_mistakes=self.raise_users_mistakes,
            given_up=self._patience.given_up(cell),
            memory=self.memory,
        )
        payload = pickled(task)
        if payload is None:
            self._here.append(number)
            return
        self._begun[number] += 1
        self._report(cell.name)
        worker = self._worker()
        while not worker.give(payload):
            worker = self._worker()
        self._busy[worker] = number

    def _worker(self) -> Worker:
        if self._idle:
            return self._idle.pop()
        worker = Worker()
        self.workers.append(worker)
        return worker

    def _receive(self, worker: Worker) -> None:
        number = self._busy.pop(worker)
        try:
            outcome = worker.take()
        except LostWorkerError as error:
            self._restart_or_give_up(number, error)
            return
        self._idle.append(worker)
        self._accept(number, outcome)

    def _accept(self, number: int, outcome: TaskResult) -> None:
        if outcome.mistake is not None:
            raise outcome.mistake
        if outcome.result is None:
            self._here.append(number)
        else:
            self._keep(number, outcome.result)

    def _restart_or_give_up(self, number: int, error: LostWorkerError) -> None:
        if not error.own_doing and self._begun[number] < ATTEMPTS:
            self._waiting.appendleft(number)
            return
        times = "" if error.own_doing else f", {self._begun[number]} times in a row"
        self._keep(number, broken_cell(self.cells[number], f"{error}{times}"))

    def _end_large_workers(self) -> None:
        """Workers in which an engine takes too much memory; what runs beside them in its own process is watched there."""
        for worker, number in list(self._busy.items()):
            if (held := resident(worker.pid, children=False)) > self.memory:
                del self._busy[worker]
                worker.kill()
                self._keep(number, broken_cell(self.cells[number], f"its process {exceeds_memory(held, self.memory)}"))

    def _run_here(self, number: int) -> None:
        cell = self.cells[number]
        self._report(cell.name)
        mistakes, given_up = self.raise_users_mistakes, self._patience.given_up(cell)
        self._keep(number, run_cell(cell, published=self.published, raise_users_mistakes=mistakes, given_up=given_up))

    def _keep(self, number: int, result: CaseResult) -> None:
        self.results[number] = result
        self._patience.record_outcome(self.cells[number], result)
        if self._tell is not None:
            self._tell(number, result)
        self._done += 1
        self._report(self.cells[next(iter(self._busy.values()))].name if self._busy else "")

    def _report(self, name: str) -> None:
        if self.progress is not None:
            self.progress(self._done, len(self.cells), name)


def _threads(engine: Engine) -> int:
    try:
        return engine.info().threads
    except Exception:  # the cell says so itself
        return 1
