"""Suite ``cd``: contact problems of packings at rest, on the core's solvers, Clarabel, PIQP and Siconos."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd.problem import ContactProblem, Sliding
from ninedisk.core.cd.settings import SolverOptions
from ninedisk.core.cd.solvers.gauss_seidel import STRIPED_FROM
from ninedisk.core.cd.solvers.interior_point import InteriorPoint
from ninedisk.core.errors import CoreError
from ninedisk.harness.bench.cd_problems import turned_gravity
from ninedisk.harness.bench.cd_solvers import Solver, Task, warm_up
from ninedisk.harness.bench.measure import Contender, Measured, Tell, interleave, timings
from ninedisk.harness.bench.records import new_row
from ninedisk.harness.results.schema import Row

FloatArray = NDArray[np.float64]

TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10)
BASE: Mapping[Sliding, str] = {
    "associated": "interior-point",
    "coulomb": "gauss-seidel, Coulomb",
}
"""Solver of each rule that the ratios refer to."""
REFERENCE = 1e-10
"""Tolerance of the solutions that start warm solvers and that objectives are compared with."""


def run(
    makers: Mapping[str, Callable[[], ContactProblem]],
    solvers: Sequence[Solver],
    *,
    repeats: int,
    time_limit: float,
    tell: Callable[[str, str], None],
) -> Iterator[list[Row]]:
    """Rows of all problems, cold and warm, one tolerance after the other.

    A solver that misses a tolerance is not asked for a tighter one.
    """
    warm_up()
    for name, make in makers.items():
        tell(name, "making the problem")
        problem = make()
        with tempfile.TemporaryDirectory(prefix="ninedisk-bench-", ignore_cleanup_errors=True) as folder:
            yield from run_problem(
                name, problem, solvers, Path(folder), repeats=repeats, time_limit=time_limit, tell=partial(tell, name)
            )


def run_problem(
    name: str,
    problem: ContactProblem,
    solvers: Sequence[Solver],
    folder: Path,
    *,
    repeats: int,
    time_limit: float,
    tell: Tell,
) -> Iterator[list[Row]]:
    """Rows of one problem, one tolerance after the other; ``folder`` takes the file that other processes read."""
    file = folder / "problem.npz"
    problem.save(file)
    _ = problem.b, problem.rho, problem.blocks  # made once, by nobody's clock
    tell("reference solutions")
    optimum = _solution(problem, time_limit)
    near = _solution(turned_gravity(problem), time_limit)
    best = None if optimum is None else problem.objective(optimum)
    for start, forces in (("cold", None), ("warm", near)):
        if start == "warm" and forces is None:
            continue
        alive = [solver for solver in solvers if (start == "cold" or solver.warm) and _can_share(solver, problem)]
        for tolerance in TOLERANCES:
            found = interleave(
                [
                    Contender(
                        name=solver.name,
                        run=partial(solver.solve, Task(problem, file, solver.sliding, tolerance, forces)),
                        cores=solver.threads,
                    )
                    for solver in alive
                ],
                repeats=repeats,
                time_limit=time_limit,
                tell=lambda text, start=start, tolerance=tolerance: tell(f"{start}, {tolerance:g}: {text}"),  # type: ignore[misc]
            )
            head = {"problem": name, "disks": problem.n_bodies, "start": start, "tolerance": tolerance}
            measured = [(solver, found[solver.name], found.get(BASE[solver.sliding])) for solver in alive]
            yield [
                new_row(**head, **_row(problem, solver, its, base, best, tolerance)) for solver, its, base in measured
            ]
            alive = [solver for solver in alive if found[solver.name].samples]


def _can_share(solver: Solver, problem: ContactProblem) -> bool:
    """Whether a solver's threads have anything to do: a small problem is left to one of them."""
    return solver.threads == 1 or problem.n_contacts >= STRIPED_FROM


def _solution(problem: ContactProblem, time_limit: float) -> FloatArray | None:
    """Forces of the associated rule to `REFERENCE`; None where they are not found in ten times the limit."""
    options = SolverOptions(tolerance=REFERENCE, time_limit=10.0 * time_limit)
    try:
        return InteriorPoint(options).solve(problem).r
    except CoreError:
        return None


def _row(
    problem: ContactProblem,
    solver: Solver,
    measured: Measured,
    base: Measured | None,
    best: float | None,
    tolerance: float,
) -> Row:
    row: Row = {
        "suite": "cd",
        "engine": solver.name,
        "engine_version": solver.version,
        "threads": solver.threads,
        "contacts": problem.n_contacts,
        "check": f"natural map and duality gap ({solver.sliding} rule) of the forces found, by one definition for all solvers",
        "check_bound": tolerance,
        "settings": json.dumps(solver.settings),
        **timings(measured, base, BASE[solver.sliding]),
    }
    facts = measured.samples[0].facts if measured.samples else measured.facts
    for key in ("natural_map", "duality_gap", "iterations"):
        if key in facts:
            row[key] = facts[key]
    if "natural_map" in facts:
        row["check_value"] = max(facts["natural_map"], facts["duality_gap"])
    if "own_tolerance" in facts:
        row["settings"] = json.dumps({**solver.settings, "own tolerance": facts["own_tolerance"]})
    if best is not None and solver.sliding == "associated" and "objective" in facts:
        row["objective_error"] = abs(facts["objective"] - best) / abs(best)
    if solver.sweeps and facts.get("iterations"):
        seconds = float(row.get("median_s", facts.get("seconds", float("nan"))))
        row |= {"rate": 1e9 * seconds / facts["iterations"] / problem.n_contacts, "rate_unit": "ns/contact/sweep"}
    if not measured.samples:
        return row
    if not all(sample.facts["reached"] for sample in measured.samples):
        lost = dict.fromkeys(("median_s", "low_s", "high_s", "ratio", "rate"), float("nan"))
        return row | lost | {"status": "fail", "reason": "the solver claims what its forces do not show: not timed"}
    return row | {"status": "pass"}
