"""One saved contact problem on one general solver of quadratic programs, in its own process.

It reads ``{"solver", "problem", "answer", "tolerance", "time_limit"}`` as JSON from standard input and writes contact forces,
velocities, seconds, iterations and the solver's own word into ``answer``.
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any, NamedTuple

import numpy as np

from ninedisk.core.cd.problem import ContactProblem
from ninedisk.harness.bench.cd import Program, program
from ninedisk.harness.bench.drivers.ladder import climb


class Answer(NamedTuple):
    """Solution, iterations and the solver's own status."""

    x: Any
    iterations: int
    status: str


def clarabel(made: Program, tolerance: float, time_limit: float) -> Answer:
    """Clarabel: interior point on the homogeneous embedding.

    Its regularisation of 1e-8 of the matrix would cost it the last digits; the smaller one is the only other change.
    """
    import clarabel as package
    import scipy.sparse as sp

    n, m = made.n, made.equality.shape[1] - made.n
    settings = package.DefaultSettings()
    settings.verbose = False
    settings.time_limit = time_limit
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = tolerance
    if tolerance < 1e-9:
        settings.static_regularization_constant = 1e-12
    signs = sp.hstack([sp.csc_matrix((m, n)), -sp.eye_array(m)])
    constraint = sp.csc_matrix(sp.vstack([made.equality, signs]))
    solution = package.DefaultSolver(
        sp.csc_matrix(sp.triu(made.quadratic)),
        made.linear,
        constraint,
        np.append(made.right, np.zeros(m)),
        [package.ZeroConeT(n), package.NonnegativeConeT(m)],
        settings,
    ).solve()
    return Answer(np.array(solution.x), int(solution.iterations), str(solution.status))


def piqp(made: Program, tolerance: float, time_limit: float) -> Answer:  # noqa: ARG001
    """PIQP: proximal interior point; it has no time limit."""
    import piqp as package

    m = made.equality.shape[1] - made.n
    solver = package.SparseSolver()
    solver.settings.verbose = False
    solver.settings.eps_abs = solver.settings.eps_rel = tolerance
    solver.settings.check_duality_gap = True
    solver.settings.eps_duality_gap_abs = solver.settings.eps_duality_gap_rel = tolerance
    low = np.append(np.full(made.n, -np.inf), np.zeros(m))
    solver.setup(P=made.quadratic, c=made.linear, A=made.equality, b=made.right, x_l=low)
    status = solver.solve()
    return Answer(np.array(solver.result.x), int(solver.result.info.iter), str(status).rpartition(".")[2])


SOLVERS = {"clarabel": clarabel, "piqp": piqp}
GOOD = ("Solved", "PIQP_SOLVED")


def solution_record(request: dict[str, Any]) -> dict[str, Any]:
    """Contact forces and figures."""
    made = program(ContactProblem.load(request["problem"]))
    solve = SOLVERS[request["solver"]]
    __import__(request["solver"])  # the import is not part of the time
    begin = time.perf_counter()
    found = solve(made, request["tolerance"], request.get("time_limit", request.get("limit")))
    seconds = time.perf_counter() - begin
    return {
        "r": made.forces(found.x),
        "v": made.velocities(found.x),
        "seconds": seconds,
        "iterations": found.iterations,
        "word": found.status,
        "good": found.status in GOOD,
    }


def main() -> None:
    """Solve one request, where an exception becomes an ``error`` answer, or climb the ladders of the race."""
    if "--race" in sys.argv:
        climb(solution_record)
        return
    request = json.load(sys.stdin)
    try:
        answer = solution_record(request)
    except Exception as error:  # the harness shows the text; a traceback would only bury it
        answer = {"error": f"{type(error).__name__}: {error}"}
    with open(request["answer"], "wb") as file:
        np.savez(file, **answer)  # type: ignore[arg-type]


if __name__ == "__main__":
    main()
