"""Cells side by side in worker processes of this machine.

Every worker has one cell at a time, so that it is known whose cell a dying worker had; pools of processes (concurrent.futures,
loky) give up everything that waits as soon as one of their processes dies, and cannot say what killed it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import cast

from ninedisk.harness.api.engine import Engine
from ninedisk.harness.results.tables import CaseResult
from ninedisk.harness.run.cell_rows import broken_cell
from ninedisk.harness.run.plan import Cell
from ninedisk.harness.run.runner import Progress, run_cell
from ninedisk.harness.run.workers import Answer, LostWorkerError, Task, Worker, end_workers, pickled

ATTEMPTS = 2
"""How often a cell is begun whose worker someone outside ends, the system short of memory for instance."""


def run_in_workers(
    cells: Sequence[Cell],
    progress: Progress | None = None,
    *,
    jobs: int,
    published: Path | None = None,
    raise_users_mistakes: bool = False,
) -> list[CaseResult]:
    """Run cells in up to ``jobs`` workers; the results in the order of the cells, whichever ends first.

    A cell whose code ends its worker (a segmentation fault) is an error. A cell whose worker is ended from outside is run
    again, once. An engine that uses several threads counts as that many cells. A cell that cannot be sent to another process
    is run in this one, after all others have begun.

    Raises
    ------
    CoreError
        A mistake in the user's parameters, if that was asked for.
    """
    run = _Run(cells, jobs, progress, published, raise_users_mistakes)
    try:
        run.finish()
    finally:
        end_workers(run.workers)
    return [result for result in run.results if result is not None]


class _Run:
    """Cells that wait, cells in the hands of workers, and results."""

    def __init__(
        self,
        cells: Sequence[Cell],
        jobs: int,
        progress: Progress | None,
        published: Path | None,
        raise_users_mistakes: bool,
    ) -> None:
        self.cells, self.jobs, self.progress = cells, jobs, progress
        self.published, self.raise_users_mistakes = published, raise_users_mistakes
        self.results: list[CaseResult | None] = [None] * len(cells)
        self.workers: list[Worker] = []
        self._idle: list[Worker] = []
        self._busy: dict[Worker, int] = {}
        self._waiting = deque(range(len(cells)))
        self._here: deque[int] = deque()
        self._begun = [0] * len(cells)
        self._threads: dict[str, int] = {}
        self._done = 0

    def finish(self) -> None:
        """Until every cell has its result."""
        while self._waiting or self._busy or self._here:
            while self._waiting and self._room(self._waiting[0]):
                self._begin(self._waiting.popleft())
            if self._here and not self._waiting:
                self._run_here(self._here.popleft())
            by_link = {worker.link: worker for worker in self._busy}
            for link in wait(list(by_link), 0.0 if self._here else None) if by_link else []:
                self._receive(by_link[cast(Connection, link)])
        self._tell("")

    def _room(self, number: int) -> bool:
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

    def _begin(self, number: int) -> None:
        cell = self.cells[number]
        task = Task(cell=cell, published=self.published, raise_users_mistakes=self.raise_users_mistakes)
        payload = pickled(task)
        if payload is None:
            self._here.append(number)
            return
        self._begun[number] += 1
        self._tell(cell.name)
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
            answer = worker.take()
        except LostWorkerError as error:
            self._mourn(number, error)
            return
        self._idle.append(worker)
        self._accept(number, answer)

    def _accept(self, number: int, answer: Answer) -> None:
        if answer.mistake is not None:
            raise answer.mistake
        if answer.result is None:
            self._here.append(number)
        else:
            self._keep(number, answer.result)

    def _mourn(self, number: int, error: LostWorkerError) -> None:
        if not error.own_doing and self._begun[number] < ATTEMPTS:
            self._waiting.appendleft(number)
            return
        times = "" if error.own_doing else f", {self._begun[number]} times in a row"
        self._keep(number, broken_cell(self.cells[number], f"{error}{times}"))

    def _run_here(self, number: int) -> None:
        cell = self.cells[number]
        self._tell(cell.name)
        mistakes = self.raise_users_mistakes
        self._keep(number, run_cell(cell, published=self.published, raise_users_mistakes=mistakes))

    def _keep(self, number: int, result: CaseResult) -> None:
        self.results[number] = result
        self._done += 1
        self._tell(self.cells[next(iter(self._busy.values()))].name if self._busy else "")

    def _tell(self, name: str) -> None:
        if self.progress is not None:
            self.progress(self._done, len(self.cells), name)


def _threads(engine: Engine) -> int:
    try:
        return engine.info().threads
    except Exception:  # the cell says so itself
        return 1
