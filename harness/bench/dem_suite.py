"""Suite ``dem``: particle-steps per second, memory and threads of the in-house DEM beside LAMMPS and YADE."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.dem.arrays import SORT_FROM
from ninedisk.core.dem.session import Counts
from ninedisk.core.errors import CoreError
from ninedisk.harness.api.engine import Engine
from ninedisk.harness.bench.dem_engines import PEERS, Peer, core_memory, cores, run_core, runner
from ninedisk.harness.bench.dem_problems import DemProblem
from ninedisk.harness.bench.measure import Contender, Measured, Sample, Tell, interleave, timings
from ninedisk.harness.bench.records import new_row
from ninedisk.harness.results.tables import Row

UNIT = "particle-steps/s"
MOST_THREADS = 4
READINGS = 10
"""Of pairs and contacts, spread over the run."""


def run_problem(
    problem: DemProblem, engines: Mapping[str, Engine], *, repeats: int, time_limit: float, tell: Tell
) -> list[Row]:
    """Rows of one problem: the core with 1, 2, .. threads, and every peer that has the time for it.

    Parameters
    ----------
    problem : DemProblem
    engines : mapping
        Registered engines by id; "dem" stands for the core, which is always run: ratios refer to it.
    """
    peers = [peer for peer in PEERS if peer.id in engines and (problem.short or not peer.short)]
    more = range(2, 2 if problem.n < SORT_FROM else min(MOST_THREADS, cores()) + 1)
    teams = [] if problem.short else more
    crews = [(peer, k) for peer in peers for k in (1, *(more if peer.threads_by else ()))]
    contenders = [Contender(name="dem", run=partial(run_core, problem, 1))]
    contenders += [
        Contender(name=_team(peer.id, k), run=runner(peer, engines[peer.id], problem, k), cores=k) for peer, k in crews
    ]
    contenders += [Contender(name=_team("dem", k), run=partial(run_core, problem, k), cores=k) for k in teams]
    measured = interleave(contenders, repeats=repeats, time_limit=time_limit, tell=tell)
    base = measured["dem"]
    rows = [_core_row(problem, 1, base, base)]
    rows[0] |= _of_the_run(problem, tell)
    rows += [_core_row(problem, k, measured[_team("dem", k)], base) for k in teams]
    rows += [_peer_row(problem, peer, k, measured[_team(peer.id, k)], base, tell) for peer, k in crews]
    return [new_row(**row) for row in rows]


def _team(engine: str, threads: int) -> str:
    return engine if threads == 1 else f"{engine}, {threads} threads"


def _head(problem: DemProblem, engine: str, threads: int, measured: Measured) -> Row:
    version = measured.samples[0].facts["version"] if measured.samples else ""
    return {
        "suite": "dem",
        "problem": problem.name,
        "engine": engine,
        "engine_version": version,
        "threads": threads,
        "disks": problem.n,
        "steps": problem.steps,
    }


def _core_row(problem: DemProblem, threads: int, measured: Measured, base: Measured) -> Row:
    head = _head(problem, "dem", threads, measured)
    if not measured.samples or not base.samples:
        return head | timings(measured, None, "")
    same = all(sample.facts["state"] == base.samples[0].facts["state"] for sample in measured.samples)
    what = "every repeat" if threads == 1 else f"one thread and {threads}"
    head |= {
        "check": f"state after the last step equal to the last bit in {what}",
        "check_value": 0.0 if same else 1.0,
        "check_bound": 0.0,
        "settings": json.dumps({"contact_dt [s]": problem.contact_dt, "damping_form": "lagged"}),
    }
    if not same:
        return head | {"status": "fail", "reason": "the final states differ: nothing was timed"}
    return head | _timed(problem, measured, base)


def _peer_row(problem: DemProblem, peer: Peer, threads: int, measured: Measured, base: Measured, tell: Tell) -> Row:
    head = _head(problem, peer.id, threads, measured)
    if not measured.samples:
        return head | timings(measured, None, "")
    tell(f"dem, with the conventions of {peer.id}, for the check")
    try:
        ours = run_core(problem.with_conventions(*peer.arms, peer.slip_at), 1, float("inf"))
    except CoreError as error:
        return head | {"status": "error", "reason": f"no in-house run to check against: {error}"}
    start = problem.scene.disks.x
    errors = [position_error(sample, ours, start) for sample in measured.samples]
    worst = max(errors)
    head |= {
        "check": f"positions against the in-house DEM with the same lever arms and slip of the step's {peer.slip_at}, "
        f"over the largest displacement ({peer.why})",
        "check_value": worst,
        "check_bound": peer.bound,
        "resident_per_disk": float(np.median([sample.facts["resident"] for sample in measured.samples])),
        "settings": json.dumps({"threads": threads, **peer.settings, "contact_dt [s]": problem.contact_dt}),
    }
    if not worst <= peer.bound:
        return head | {"status": "fail", "reason": f"positions differ by {worst:.3g}: other physics is not timed"}
    return head | _timed(problem, measured, base)


def position_error(sample: Sample, ours: Sample, start: NDArray[np.float64]) -> float:
    """Largest difference of a position from the in-house run, over that run's largest displacement; inf for no numbers."""
    x, own = sample.facts["x"], ours.facts["x"]
    moved = float(np.abs(own - start).max())
    apart = float(np.abs(x - own).max())
    return apart / moved if np.isfinite(apart) and moved > 0.0 else float("inf")


def _timed(problem: DemProblem, measured: Measured, base: Measured) -> Row:
    row = timings(measured, base, "dem")
    return row | {"status": "pass", "rate": problem.n * problem.steps / row["median_s"], "rate_unit": UNIT}


def _of_the_run(problem: DemProblem, tell: Tell) -> Row:
    """Memory, and mean numbers of listed pairs and contacts, walls included."""
    if problem.short:
        return {}
    tell("memory")
    memory = core_memory(problem)
    tell("pairs and contacts")
    counts = mean_counts(problem)
    return {
        "bytes_per_disk": memory,
        "listed_pairs": counts.pairs + counts.wall_pairs,
        "contacts": counts.contacts + counts.wall_contacts,
        "rebuilds": counts.rebuilds,
    }


def mean_counts(problem: DemProblem) -> Counts:
    """Counts of a run of its own, means of `READINGS` over its steps; rebuilds are those of the whole run."""
    from ninedisk.core.dem.session import DemSession

    # The same contact steps, each of them a step at which the run may be stopped, only the last one sampled.
    numerics = problem.numerics().replace(
        dt=problem.contact_dt, n_steps=problem.steps, sample_from=problem.steps, sample_every=problem.steps
    )
    session = DemSession(problem.scene, numerics, particles=[0])
    readings, done = [], 0
    for k in range(1, READINGS + 1):
        until = k * problem.steps // READINGS
        if until > done:
            session.advance(until - done)
            readings.append(session.counts)
        done = until
    means = (round(sum(each) / len(readings)) for each in list(zip(*readings, strict=True))[1:])
    return Counts(readings[-1].rebuilds, *means)


def run(
    makers: Mapping[str, Callable[[], list[DemProblem]]],
    engines: Mapping[str, Engine],
    *,
    repeats: int,
    time_limit: float,
    tell: Callable[[str, str], None],
) -> Iterator[list[Row]]:
    """Rows of all problems, one problem after the other."""
    for first, make in makers.items():
        tell(first, "settling")
        for problem in make():

            def told(what: str, first: str = first, name: str = problem.name) -> None:
                tell(first, f"{name}: {what}")

            yield run_problem(problem, engines, repeats=repeats, time_limit=time_limit, tell=told)
