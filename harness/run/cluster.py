"""Cells on a Dask cluster, an optional extra: ``pip install 'ninedisk[dask]'``.

The workers are the cluster's: how many there are, and that one which dies is replaced, is its business. A cell whose worker dies
is begun again by the scheduler as often as its setting ``distributed.scheduler.allowed-failures`` says (3 by default), then once
more in a process of this machine, which shows what became of it.

A cluster without a worker is waited for, `NO_WORKER` seconds, and one whose scheduler is gone as long as Dask tries to reach it; then
what is left of the cells ends as errors, and finished ones keep their results.
"""

from __future__ import annotations

import asyncio
import pickle
import queue
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import ninedisk
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.results.tables import CaseResult
from ninedisk.harness.run.plan import Cell
from ninedisk.harness.run.provenance import COMPUTING, cpu_model, package_folder
from ninedisk.harness.run.runner import Progress, broken_cell
from ninedisk.harness.run.workers import Keep, Task, TaskResult, pickled, run_in_workers, run_task

if TYPE_CHECKING:
    from distributed import Client, Future
PATIENCE = 10.0
"""Seconds in which the scheduler has to answer, and a first worker to be there."""

NO_WORKER = 60.0
"""Seconds that a cluster may be without any worker, in which a user may start one."""

LOOK = 1.0
"""Seconds between two looks at the cluster while no cell ends."""

_ONE_CELL = threading.Lock()
"""A worker's threads share one process; engines are not made for that, and timings would mean nothing."""


@dataclass(frozen=True)
class Cluster:
    """A Dask cluster that answers and whose workers have this very version."""

    client: Client
    about: dict[str, Any] = field(default_factory=dict)

    def run(
        self,
        cells: Sequence[Cell],
        progress: Progress | None = None,
        *,
        published: Path | None = None,
        raise_users_mistakes: bool = False,
        memory: float | None = None,
        kept: Mapping[int, CaseResult] | None = None,
        keep: Keep | None = None,
    ) -> list[CaseResult]:
        """Results in the order of the cells; see `ninedisk.harness.run.workers.run_cells`."""
        folder = None if published is None else published.resolve()
        results: dict[int, CaseResult] = dict(kept or {})
        numbers: dict[Any, int] = {}
        ended: queue.SimpleQueue[Future[bytes]] = queue.SimpleQueue()
        here: list[int] = []
        watch = _Watch(self.client)
        try:
            for number, cell in enumerate(cells):
                if number in results:
                    continue
                mistakes = raise_users_mistakes
                payload = pickled(Task(cell=cell, published=folder, raise_users_mistakes=mistakes, memory=memory))
                if payload is None:
                    here.append(number)
                else:  # not pure: equal cells of two runs are two measurements
                    future = self.client.submit(one_cell, payload, pure=False)
                    numbers[future] = number
                    future.add_done_callback(ended.put)
            _report_workers(progress, results, cells, cells[0].name if cells else "")
            waiting = set(numbers.values())
            while waiting and not watch.given_up:
                try:
                    future = ended.get(timeout=LOOK)
                except queue.Empty:
                    if note := watch.look():
                        _report_workers(progress, results, cells, note)
                    continue
                number = numbers[future]
                try:
                    result = _result(future)
                except (asyncio.CancelledError, CancelledError, OSError):  # nobody here cancels it
                    watch.given_up = LOST
                    continue
                waiting.discard(number)
                if result is None:
                    here.append(number)
                else:
                    results[number] = result
                    if keep is not None:
                        keep(number, result)
                _report_workers(progress, results, cells, cells[number].name)
            results |= {number: broken_cell(cells[number], f"not run: {watch.given_up}") for number in waiting}
        finally:
            if not watch.given_up:
                self.client.cancel(list(numbers))
        # Dask blames a worker's death on all cells that it held; a process for each shows which of them it was.
        here.sort()
        mine = [cells[number] for number in here]
        again = run_in_workers(
            mine,
            jobs=1,
            published=folder,
            raise_users_mistakes=raise_users_mistakes,
            memory=memory,
            keep=None if keep is None else lambda place, result: keep(here[place], result),
        )
        results |= dict(zip(here, again, strict=True))
        _report_workers(progress, results, cells, "")
        return [results[number] for number in range(len(cells))]

    def facts(self) -> dict[str, Any]:
        """What the provenance says of it: cells at once, and the processors of the workers."""
        return self.about


LOST = "the scheduler of the Dask cluster is lost; start it again, then run the rest of the cells"


class _Watch:
    """How a cluster is while no cell ends; ``given_up`` says why no more can be expected of it, ``""`` as long as it can."""

    def __init__(self, client: Client) -> None:
        self._client, self._without, self.given_up = client, 0.0, ""

    def look(self) -> str:
        """What to show of a cluster that is short of something; ``""`` where it is not."""
        if self._client.status in ("closing", "closed"):
            self.given_up = LOST
            return ""
        workers = 0
        if self._client.status == "running":
            with suppress(Exception):  # it is being lost: the status will say so
                workers = len(self._client.nthreads())
        if workers:
            self._without = 0.0
            return ""
        now = time.monotonic()
        self._without = self._without or now
        if now - self._without > NO_WORKER:
            running = self._client.status == "running"
            self.given_up = f"the Dask cluster had no worker for {NO_WORKER:g} s; start some" if running else LOST
        return f"no worker is left in the Dask cluster: waits {NO_WORKER:g} s for one"


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
    try:
        _check_workers(client, address)
        models = client.run(cpu_model)  # now: a cluster that is lost later cannot be asked
        cpus = " + ".join(sorted(set(models.values())))
        yield Cluster(client, {"jobs": len(models), "cpu": cpus, "dask": version("distributed")})
    finally:
        with suppress(Exception, asyncio.CancelledError):  # a client that is connecting again cannot be closed in order
            client.close(timeout=PATIENCE)


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


def _report_workers(
    progress: Progress | None, results: dict[int, CaseResult], cells: Sequence[Cell], name: str
) -> None:
    if progress is not None:
        progress(len(results), len(cells), name)
