"""What a DEM problem asks of the machine: its pairs, contacts and rebuilds, and the columns of the roofline estimate."""

from __future__ import annotations

from ninedisk.core.dem.session import Counts
from ninedisk.harness.bench.dem_problems import DemProblem
from ninedisk.harness.bench.kernel_work import work_of
from ninedisk.harness.bench.measure import on_cores
from ninedisk.harness.bench.roofline import measure
from ninedisk.harness.results.schema import Row

READINGS = 10
"""Of the counts, spread over the run."""


def mean_counts(problem: DemProblem) -> Counts:
    """Counts of a run of its own, means of `READINGS` over its steps; rebuilds are those of the whole run."""
    from ninedisk.core.dem.session import DemSession

    # The same contact steps, each of them a step at which the run may be stopped, only the last one sampled.
    numerics = problem.numerics().replace(
        dt=problem.contact_dt, n_steps=problem.steps, sample_from=problem.steps, sample_every=problem.steps
    )
    session = DemSession(problem.scene, numerics, particles=[0])
    seen, done = [], 0
    for k in range(1, READINGS + 1):
        until = k * problem.steps // READINGS
        if until > done:
            session.advance(until - done)
            seen.append(session.counts)
        done = until
    means = (round(sum(each) / len(seen)) for each in list(zip(*seen, strict=True))[1:])
    return Counts(seen[-1].rebuilds, *means)


def counted(problem: DemProblem) -> tuple[Counts, Row]:
    """Counts of the problem and their columns: listed pairs and contacts, walls included."""
    counts = mean_counts(problem)
    listed, touching = counts.pairs + counts.wall_pairs, counts.contacts + counts.wall_contacts
    return counts, {"listed_pairs": listed, "contacts": touching, "rebuilds": counts.rebuilds}


def roofline(problem: DemProblem, counts: Counts) -> Row:
    """Columns of the roofline estimate: work of a particle-step, and the roofs of one core for a working set of this size."""
    work = work_of(problem.scene, problem.numerics(), counts)
    with on_cores(1):
        roofs = measure(work.held * problem.n)
    return {"flops": work.flops, "traffic": work.traffic, "working_set": work.held * problem.n, **vars(roofs)}
