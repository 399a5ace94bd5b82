"""Suite ``harness``: wall-clock time of all verification cases, with kernels cached and from an empty cache."""

from __future__ import annotations

import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import ninedisk
from ninedisk.harness.api.engine import EngineError, EngineTimeoutError
from ninedisk.harness.bench.measure import Contender, Measured, Reporter, Sample, interleave, timings
from ninedisk.harness.bench.records import new_row
from ninedisk.harness.results.schema import Row
from ninedisk.harness.run.process_guard import guarded_environment

ENGINES = ("dem", "cd", "pymunk")
CACHE = "NUMBA_CACHE_DIR"
CACHED, COLD, ALL = "appendix, kernels cached", "appendix, empty cache", "all cases, kernels cached"
PROBLEMS = (CACHED, COLD, ALL)
APPENDIX = "appendix A"
"""How the source of a case begins that is one of the appendix's."""
JOBS = (1, 2)
"""Cells at once; the first is what the others are held against, and has one core."""
COMPLETE = (0, 1)
"""Exit codes of a run that did all it should: failed checks of an engine are findings, errors and crashes are not."""


def run(
    globs: Sequence[str], problem: str, *, repeats: int, time_limit: float, notify: Reporter
) -> Iterator[list[Row]]:
    """Rows of the whole run of ``ninedisk run`` on `ENGINES`, with each of `JOBS`.

    Parameters
    ----------
    globs : sequence of str
        Cases; none: those that the problem means.
    problem : str
        One of `PROBLEMS`.
    """
    chosen = tuple(globs) or (() if problem == ALL else _appendix_cases())
    if problem != COLD:
        notify("a first run, to fill the cache")
        first = interleave([_contender(chosen, problem, 1)], repeats=1, time_limit=time_limit)
        if not first[_name(1)].samples:
            yield _rows(problem, first, JOBS[:1])
            return
    contenders = [_contender(chosen, problem, count) for count in JOBS]
    yield _rows(problem, interleave(contenders, repeats=repeats, time_limit=time_limit, notify=notify), JOBS)


def _appendix_cases() -> tuple[str, ...]:
    from ninedisk.harness.api.registry import case_table, get_case

    return tuple(name for name in case_table() if get_case(name).source.startswith(APPENDIX))


def _name(jobs: int) -> str:
    return f"ninedisk run, {jobs} job" + ("s" if jobs > 1 else "")


def _contender(globs: tuple[str, ...], problem: str, jobs: int) -> Contender:
    return Contender(name=_name(jobs), run=partial(_run, globs, problem == COLD, jobs), cores=jobs)


def _rows(problem: str, found: dict[str, Measured], jobs: Sequence[int]) -> list[Row]:
    base = found[_name(jobs[0])]
    rows = []
    for count in jobs:
        measured = found[_name(count)]
        row: Row = {
            "suite": "harness",
            "problem": problem,
            "engine": _name(count),
            "engine_version": ninedisk.__version__,
            "threads": count,
            "settings": json.dumps({"engines": ENGINES}),
            **timings(measured, base, _name(jobs[0])),
        }
        if measured.samples:
            outcomes = {sample.facts["outcome"] for sample in (*base.samples, *measured.samples)}
            row |= {
                "check": f"every repeat complete, with the same outcome: {'; '.join(sorted(outcomes))}",
                "check_value": float(len(outcomes) - 1),
                "check_bound": 0.0,
                "status": "pass",
                "cpu_s": statistics.median(sample.facts["cpu"] for sample in measured.samples),
            }
            if len(outcomes) > 1:
                lost = dict.fromkeys(("median_s", "low_s", "high_s", "ratio", "whole_s", "cpu_s"), float("nan"))
                row |= lost | {"status": "fail", "reason": "the outcomes differ: nothing was timed"}
        rows.append(new_row(**row))
    return rows


def _run(globs: tuple[str, ...], cold: bool, jobs: int, limit: float) -> Sample:
    with tempfile.TemporaryDirectory(prefix="ninedisk-bench-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        options = [word for engine in ENGINES for word in ("--engine", engine)]
        options += ["--jobs", str(jobs)]
        command = [sys.executable, "-m", "ninedisk", "run", *globs, *options, "--store", str(folder / "store")]
        environment = {**os.environ, CACHE: str(folder / "kernels")} if cold else dict(os.environ)
        begin, before = time.perf_counter(), _processor_seconds()
        try:
            done = subprocess.run(
                command,
                capture_output=True,
                text=True,
                timeout=limit,
                env=guarded_environment(environment),
                cwd=folder,
                check=False,
            )
        except subprocess.TimeoutExpired as error:
            raise EngineTimeoutError(f"ninedisk run was stopped at its time limit of {limit:g} s") from error
        seconds, cpu = time.perf_counter() - begin, _processor_seconds() - before
    if done.returncode not in COMPLETE:
        last = "\n".join((done.stderr.strip() or done.stdout.strip()).splitlines()[-5:])
        raise EngineError(f"ninedisk run ended with exit code {done.returncode}: {last}")
    counts = [line for line in done.stdout.splitlines() if line.startswith(("cells:", "checks:"))]
    return Sample(seconds=seconds, whole=seconds, facts={"outcome": ", ".join(counts), "cpu": cpu})


def _processor_seconds() -> float:
    """Processor time of all processes that this one started and that have ended, and of those they waited for."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
