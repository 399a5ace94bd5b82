"""Repeats of several engines on one problem: interleaved, on fixed cores, within a time limit; and asking engines in processes."""

from __future__ import annotations

import json
import os
import statistics
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ninedisk.core.errors import CoreError
from ninedisk.harness.api.engine import EngineError, EngineInfo, EngineNotInstalledError, EngineTimeoutError
from ninedisk.harness.results.schema import Row
from ninedisk.harness.run.isolation import run_isolated

Reporter = Callable[[str], None]
DRIVERS = Path(__file__).parent / "drivers"
"""Scripts for engines that run in their own processes."""


@dataclass(frozen=True, kw_only=True)
class Sample:
    """One timed run.

    Attributes
    ----------
    seconds : float
        Wall-clock time of the work that all engines of the problem do.
    whole : float
        With start-up, set-up and transport; NaN if not measured.
    facts : mapping
        What the check and the record need.
    """

    seconds: float
    whole: float = float("nan")
    facts: Mapping[str, Any] = field(default_factory=dict)


class NotReachedError(EngineError):
    """A solver stopped short of its target; ``facts`` says how far it got."""

    def __init__(self, message: str, facts: Mapping[str, Any]) -> None:
        super().__init__(message)
        self.facts = dict(facts)


class UnsupportedProblemError(EngineError):
    """An engine that cannot express the problem; the message names what it lacks."""


@dataclass(frozen=True, kw_only=True)
class Contender:
    """An engine on a problem; ``run(limit)`` does one repeat and is stopped after ``limit`` seconds where it can be."""

    name: str
    run: Callable[[float], Sample]
    cores: int = 1


@dataclass(frozen=True)
class Measured:
    """Samples of a contender, or why there are none and how far it got."""

    samples: tuple[Sample, ...]
    status: str
    reason: str
    facts: Mapping[str, Any] = field(default_factory=dict)

    @property
    def seconds(self) -> list[float]:
        """Seconds of every repeat."""
        return [sample.seconds for sample in self.samples]


def installed(info: EngineInfo) -> EngineInfo:
    """The same; EngineNotInstalledError, with the way to install it, for an engine that is not there."""
    if not info.installed:
        raise EngineNotInstalledError(f"{info.name} is not installed ({info.not_installed_because}): {info.install}")
    return info


def ask_driver(
    command: Sequence[str],
    request: Mapping[str, Any],
    folder: Path,
    *,
    limit: float,
    environment: Mapping[str, str] | None = None,
) -> dict[str, Any]:
    """Arrays that a driver answers with: JSON on its standard input, the answer in a file of ``folder`` that the request names.

    Raises
    ------
    EngineTimeoutError, EngineError
    """
    answer = folder / "answer.npz"
    text = json.dumps({**request, "answer": str(answer)})
    # The limit of a contender is on the wall, that of a process counts the CPU time of all its threads.
    done = run_isolated(command, stdin=text, time_limit=limit * usable_cores(), cwd=folder, env=environment)
    try:
        with np.load(answer) as data:
            found: dict[str, Any] = {key: data[key] for key in data.files}
    except (OSError, ValueError) as error:
        raise EngineError(f"no readable answer ({error}): {done.last_lines() or 'it printed nothing'}") from error
    if "error" in found:
        raise EngineError(f"it gave up: {found['error']}")
    return found


def usable_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def on_cores(count: int) -> Iterator[int]:
    """Keep this process, and what it starts, on ``count`` of its cores; gives the number that it really has.

    Where the system cannot do that, nothing changes.
    """
    if not hasattr(os, "sched_setaffinity"):
        yield count
        return
    before = os.sched_getaffinity(0)
    chosen = sorted(before)[-count:]  # the first core is where systems like to put interrupts
    os.sched_setaffinity(0, chosen)
    try:
        yield len(chosen)
    finally:
        os.sched_setaffinity(0, before)


def interleave(
    contenders: Sequence[Contender], *, repeats: int, time_limit: float, notify: Reporter = lambda _: None
) -> dict[str, Measured]:
    """Run A B A B ...: slow and fast minutes of a shared machine meet all contenders alike.

    Parameters
    ----------
    contenders : sequence of Contender
    repeats : int
        Of each, >= 1.
    time_limit : float
        Seconds for all repeats of one contender together; one that has used them up gets no further repeat.
    notify : callable
        Called with what begins.

    Returns
    -------
    dict
        `Measured` by name; a contender that failed keeps no samples: half a run is no measurement.
    """
    found: dict[str, list[Sample]] = {each.name: [] for each in contenders}
    spent = dict.fromkeys(found, 0.0)
    failed: dict[str, Exception] = {}
    for repeat in range(repeats):
        for each in contenders:
            if each.name in failed or (repeat and spent[each.name] >= time_limit):
                continue
            notify(f"{each.name}, repeat {repeat + 1} of {repeats}")
            begin = time.perf_counter()
            try:
                with on_cores(each.cores):
                    found[each.name].append(each.run(max(1.0, time_limit - spent[each.name])))
            except (EngineError, CoreError) as error:
                if repeat == 0 or not isinstance(error, EngineTimeoutError):
                    failed[each.name] = error
                else:  # what it did before stands
                    spent[each.name] = time_limit
            spent[each.name] += time.perf_counter() - begin
    return {
        name: _failure(failed[name]) if name in failed else Measured(tuple(samples), "pass", "")
        for name, samples in found.items()
    }


def _failure(error: Exception) -> Measured:
    return Measured((), status_of(error), str(error), getattr(error, "facts", {}))


def status_of(error: Exception) -> str:
    """Status of a row whose engine raised ``error``."""
    kinds = (
        (EngineNotInstalledError, "not-installed"),
        (EngineTimeoutError, "timeout"),
        (NotReachedError, "not-reached"),
        (UnsupportedProblemError, "unsupported"),
    )
    return next((status for kind, status in kinds if isinstance(error, kind)), "error")


def timings(measured: Measured, base: Measured | None, name_of_base: str) -> Row:
    """Columns of the timings: median, spread (smallest and largest), and the ratio to the base, repeat by repeat."""
    if not measured.samples:
        return {"status": measured.status, "reason": measured.reason}
    seconds = measured.seconds
    row: Row = {
        "repeats": len(seconds),
        "median_s": statistics.median(seconds),
        "low_s": min(seconds),
        "high_s": max(seconds),
        "samples_s": "[" + ", ".join(f"{each:.6g}" for each in seconds) + "]",
        "whole_s": statistics.median(sample.whole for sample in measured.samples),
    }
    if base is not None and base.samples:
        pairs = zip(seconds, base.seconds, strict=False)  # a contender may have run out of time
        row |= {"ratio": statistics.median(one / other for one, other in pairs), "base": name_of_base}
    return row
