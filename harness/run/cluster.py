"""Cells on a Dask cluster, an optional extra: ``pip install 'ninedisk[dask]'``.

The workers are the cluster's: how many there are, and that one which dies is replaced, is its business. A cell whose worker dies
is begun again by the scheduler as often as its setting ``distributed.scheduler.allowed-failures`` says (3 by default), then once
more in a process of this machine, which tells what became of it.
"""

from __future__ import annotations

import pickle
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import ninedisk
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.results.tables import CaseResult
from ninedisk.harness.run.plan import Cell
from ninedisk.harness.run.provenance import COMPUTING, cpu_model, package_folder
from ninedisk.harness.run.runner import Progress
from ninedisk.harness.run.workers import Task, TaskResult, pickled, run_in_workers, run_task

if TYPE_CHECKING:
    from distributed import Client, Future
PATIENCE = 10.0
"""Seconds in which the scheduler has to answer, and a first worker to be there."""

_ONE_CELL = threading.Lock()
"""A worker's threads share one process; engines are not made for that, and timings would mean nothing."""


@dataclass(frozen=True)
class Cluster:
    """A Dask cluster that answers and whose workers have this very version."""

    client: Client

    def run(
        self,
        cells: Sequence[Cell],
        progress: Progress | None = None,
        *,
        published: Path | None = None,
        raise_users_mistakes: bool = False,
        memory: float | None = None,
    ) -> list[CaseResult]:
        """Results in the order of the cells; see `ninedisk.harness.run.workers.run_cells`."""
        from distributed import as_completed

        folder = None if published is None else published.resolve()
        results: dict[int, CaseResult] = {}
        numbers: dict[Any, int] = {}
        here: list[int] = []
        try:
            for number, cell in enumerate(cells):
                mistakes = raise_users_mistakes
                payload = pickled(Task(cell=cell, published=folder, raise_users_mistakes=mistakes, memory=memory))
                if payload is None:
                    here.append(number)
                else:  # not pure: equal cells of two runs are two measurements
                    numbers[self.client.submit(one_cell, payload, pure=False)] = number
            _tell(progress, results, cells, cells[0].name if cells else "")
            for future in as_completed(list(numbers), loop=self.client.loop):
                number = numbers[future]
                result = _result(future)
                if result is None:
                    here.append(number)
                else:
                    results[number] = result
                _tell(progress, results, cells, cells[number].name)
        finally:
            self.client.cancel(list(numbers))
        # Dask blames a worker's death on all cells that it held; a process for each tells which of them it was.
        mine = [cells[number] for number in sorted(here)]
        again = run_in_workers(mine, jobs=1, published=folder, raise_users_mistakes=raise_users_mistakes, memory=memory)
        results |= dict(zip(sorted(here), again, strict=True))
        _tell(progress, results, cells, "")
        return [results[number] for number in range(len(cells))]

    def facts(self) -> dict[str, Any]:
        """What the provenance says of it: cells at once, and the processors of the workers."""
        models = self.client.run(cpu_model)
        return {"jobs": len(models), "cpu": " + ".join(sorted(set(models.values()))), "dask": version("distributed")}


@contextmanager
def connected(address: str) -> Iterator[Cluster]:
    """The cluster whose scheduler listens at ``address``, ``tcp://host:8786`` for instance.

    Raises
    ------
    UsageError
        If Dask is not installed here, nobody answers, no worker comes, or the workers have another version of ninedisk.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise UsageError("--dask needs an extra: pip install 'ninedisk[dask]'") from error
    try:
        client = Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise UsageError(
            f"--dask {address!r}: no Dask scheduler answers there ({error}); start one with dask scheduler, or give --jobs"
        ) from error
    with client:
        _check_workers(client, address)
        yield Cluster(client)


def _result(future: Future[bytes]) -> CaseResult | None:
    """Result of a cell; None where it has to be run in a process of this machine."""
    from distributed import KilledWorker

    try:
        outcome: TaskResult = pickle.loads(future.result())
    except KilledWorker:
        return None
    finally:
        future.release()
    if outcome.mistake is not None:
        raise outcome.mistake
    return outcome.result


def one_cell(payload: bytes) -> bytes:
    """What a worker of the cluster does: `ninedisk.harness.run.workers.run_task`, one at a time in a process."""
    with _ONE_CELL:
        return run_task(payload)


def fingerprint() -> str:
    """Version and hash of the sources that compute: equal on all machines, or results are not those of this version."""
    from ninedisk.core.compile import source_hash

    return " ".join([ninedisk.__version__, *(source_hash(package_folder(name)) for name in COMPUTING)])


def _check_workers(client: Client, address: str) -> None:
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
        found: dict[str, Any] = client.run(fingerprint, on_error="return")
    except TimeoutError as error:
        raise UsageError(
            f"--dask {address!r}: the scheduler has no worker; start some with dask worker {address}"
        ) from error
    own = fingerprint()
    for worker, print_ in found.items():
        if isinstance(print_, BaseException):
            raise UsageError(
                f"--dask: ninedisk cannot be used on the worker {worker} ({type(print_).__name__}: {print_}); install it there"
            )
        if print_ != own:
            raise UsageError(
                f"--dask: the worker {worker} has another version of ninedisk ({print_.split()[0]} or changed sources, "
                f"{own.split()[0]} here); install the same one there"
            )


def _tell(progress: Progress | None, results: dict[int, CaseResult], cells: Sequence[Cell], name: str) -> None:
    if progress is not None:
        progress(len(results), len(cells), name)
