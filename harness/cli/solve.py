"""``ninedisk solve``: one contact problem out of a file, solved, and the answer judged by code that shares nothing with the solvers."""

from __future__ import annotations

import re
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer

from ninedisk.harness.cli.support import CellProgress, guarded
from ninedisk.harness.terminal import console, table

if TYPE_CHECKING:
    from ninedisk.core.cd.problem import Sliding
    from ninedisk.core.cd.problem_files import Answer, ProblemFile
    from ninedisk.core.cd.settings import SolverOptions
    from ninedisk.references.contact_law import Errors

UNSOLVED = 1
ROUNDED = 1e-9
"""Difference of W from its transpose that is not mentioned."""
FEWEST = 4
"""Significant digits below which numbers may be exact, such as 0.5 and 1.25."""
MEANINGS = {
    "natural_map": "distance of the forces from their projection on the law",
    "complementarity": "normal force where a contact opens",
    "cone": "tension, or friction beyond mu p",
    "opening": "velocity into a contact",
    "slip": "friction that does not oppose slip",
    "dynamics": "balance of momentum, and velocities against forces",
    "duality_gap": "distance of the program's value from its optimum",
}


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("solve", short_help="Solve a contact problem out of a file.")(solve)


@guarded
def solve(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="Our .npz, Siconos' text (fc2d, gfc2d, fc3d, gfc3d) or FCLIB's HDF5, recognised by its content.",
        ),
    ],
    solver: Annotated[
        str, typer.Option("--solver", metavar="NAME", help="auto, gauss-seidel or interior-point (bodies only).")
    ] = "auto",
    sliding: Annotated[str, typer.Option("--sliding", metavar="RULE", help="coulomb or associated.")] = "coulomb",
    tolerance: Annotated[
        float,
        typer.Option("--tolerance", metavar="TOL", help="Largest relative error, in (0, 1), of all that are printed."),
    ] = 1e-8,
    time_limit: Annotated[float, typer.Option("--time-limit", metavar="S", help="Seconds for the solver.")] = 60.0,
    check: Annotated[bool, typer.Option("--check", help="Solve nothing: judge the solution in FILE.")] = False,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="Write problem and solution to FILE, in the same form.")
    ] = None,
) -> None:
    """Solve the frictional contact problem in FILE and print how far the answer is from a solution.

    The errors are those of `ninedisk.references.contact_law`, relative to the problem's own forces and works: derived from the law
    alone, without a line of the solvers. What of them the rounding of doubles explains is no reason to refuse. Text whose numbers have
    fewer digits than the tolerance is mentioned.

    \b
    Examples:
      ninedisk solve problem.npz
      ninedisk solve fc2d_granularflow.dat --tolerance 1e-6 --out solved.dat
      ninedisk solve Capsules-i100-1090.dat --tolerance 1e-9
      ninedisk solve Chain.hdf5 --sliding associated --solver interior-point
      ninedisk solve solved.hdf5 --check

    \b
    Exit codes:
      0  solved: no error exceeds the tolerance
      1  not solved, or no solution exists
      2  wrong usage: no such problem in the file, a value out of range, h5py missing
    """
    from dataclasses import replace

    from ninedisk.core.cd.delassus import DelassusProblem
    from ninedisk.core.cd.problem_files import read_problem
    from ninedisk.core.cd.settings import SolverOptions
    from ninedisk.core.cd.solvers.solver import SOLVERS
    from ninedisk.harness.api.errors import UsageError, not_one_of
    from ninedisk.harness.results.whole_file import check_writable

    options = SolverOptions(tolerance=tolerance, time_limit=time_limit)
    if solver not in SOLVERS:
        raise UsageError(not_one_of("--solver", solver, SOLVERS))
    if sliding not in ("coulomb", "associated"):
        raise UsageError(not_one_of("--sliding", sliding, ("coulomb", "associated")))
    rule: Sliding = "coulomb" if sliding == "coulomb" else "associated"
    if check and out is not None:
        raise UsageError("--check solves nothing, so that there is nothing for --out to write: give one of them")
    if out is not None:
        check_writable("--out", out)
    found = read_problem(str(file))
    matrix = isinstance(found.problem, DelassusProblem)
    if matrix and (solver == "interior-point" or (solver != "auto" and found.problem.b.shape[1] == 3)):
        raise UsageError(f"--solver {solver} works on bodies in the plane, and this file has a matrix alone: use auto")
    _describe(found)
    if found.form in ("fc2d", "fc3d"):
        _say_digits(file, tolerance)
    if check:
        if found.answer is None:
            raise UsageError(f"{str(file)!r} holds no solution to check: leave out --check")
        answer, said = found.answer, "judged"
        errors = judge(found, answer, rule)
    else:
        begin = perf_counter()
        with CellProgress() as progress:
            progress(0, 0, f"solving, at most {time_limit:g} s")
            for share in (1.0, 0.1, 1e-2, 1e-3):  # solvers stop by their own figures, which may be somewhat smaller
                reached, said = _find_answer(found, solver, replace(options, tolerance=share * tolerance), rule)
                if reached is None:
                    raise typer.Exit(UNSOLVED)
                answer, errors = reached, judge(found, reached, rule)
                if (
                    not said
                    or errors.solved(tolerance)
                    or errors.worst > 10.0 * tolerance
                    or perf_counter() - begin > time_limit
                ):
                    break
    good = bool(said) and errors.solved(tolerance)
    _show(errors, tolerance)
    verdict = f"{said}: {'solved' if good else 'NOT solved'} to {tolerance:g}" if said else "the forces it had"
    console().print(f"{verdict} (worst error {errors.worst:.2g})")
    if out is not None:
        replace(found, answer=answer).save(out)
    raise typer.Exit(0 if good else UNSOLVED)


def judge(found: ProblemFile, answer: Answer, sliding: Sliding) -> Errors:
    """Errors of an answer, in the terms in which the file itself states the problem: whatever reading it made of it is judged, too."""
    import numpy as np

    with np.errstate(over="ignore", invalid="ignore"):  # errors of extreme numbers are infinite
        return _errors_as_stated(found, answer, sliding)


def _errors_as_stated(found: ProblemFile, answer: Answer, sliding: Sliding) -> Errors:
    from ninedisk.core.cd.delassus import DelassusProblem
    from ninedisk.core.cd.problem_files import Reduced
    from ninedisk.references.contact_law import errors_of_forces, errors_of_motion, planar_bodies

    problem, stated, associated = found.problem, found.matrices, sliding == "associated"
    if isinstance(stated, Reduced):
        return errors_of_forces(stated.w, stated.q, stated.mu, answer.r, answer.u, associated=associated)
    if stated is not None:
        return errors_of_motion(*stated, answer.r, answer.v, answer.u, associated=associated)
    if isinstance(problem, DelassusProblem):
        return errors_of_forces(problem.w, problem.b, problem.mu, answer.r, answer.u, associated=associated)
    names = ("mass", "force", "bodies", "normal", "arms", "offset", "compliance", "shear_0")
    planar = planar_bodies(**{name: getattr(problem, name) for name in names})
    return errors_of_motion(*planar, problem.mu, answer.r, None, answer.u, associated=associated)


def _find_answer(
    found: ProblemFile, solver: str, options: SolverOptions, sliding: Sliding
) -> tuple[Answer | None, str]:
    """The answer and who found it; where a solver gave up, the best that it has, if any, and nobody."""
    from ninedisk.core.cd.delassus import DelassusProblem
    from ninedisk.core.cd.solvers.by_matrix.cone import load_kernels
    from ninedisk.core.cd.solvers.by_matrix.solve import solve_matrix
    from ninedisk.core.cd.solvers.feasibility import InfeasibleContactsError
    from ninedisk.core.cd.solvers.solver import ContactSolver
    from ninedisk.core.errors import SolverNotConvergedError

    problem = found.problem
    if problem.n_contacts == 0:
        raise _no_contacts()
    if isinstance(problem, DelassusProblem):
        if problem.dimension == 3:
            load_kernels()
        best = solve_matrix(problem, options, sliding=sliding)
        how = "gauss-seidel and statuses" if problem.dimension == 2 else "sweeps, interior point and statuses"
        return found.answer_of(best.r), f"{how}, {best.iterations} iterations, {best.seconds:.3g} s"
    try:
        result = ContactSolver(solver, options, sliding).solve(problem)
    except (SolverNotConvergedError, InfeasibleContactsError) as error:
        typer.echo(f"NOT solved: {error}")
        forces = error.forces if isinstance(error, SolverNotConvergedError) else None
        return None if forces is None else found.answer_of(forces, problem.body_velocity(forces)), ""
    return found.answer_of(
        result.r, result.v
    ), f"{result.solver}, {result.iterations} iterations, {result.seconds:.3g} s"


def _no_contacts() -> Exception:
    from ninedisk.harness.api.errors import UsageError

    return UsageError("the problem has no contacts: there is nothing to solve")


def _describe(found: ProblemFile) -> None:
    from ninedisk.core.cd.delassus import DelassusProblem

    problem = found.problem
    kind = (
        f"a matrix in {problem.dimension}D"
        if isinstance(problem, DelassusProblem)
        else f"{problem.n_bodies} bodies in 2D"
    )
    mu = f", mu {problem.mu.min():g} to {problem.mu.max():g}" if problem.n_contacts else ""
    console().print(f"{found.form}: {problem.n_contacts} contacts of {kind}{mu}")
    if isinstance(problem, DelassusProblem) and problem.w.nnz:
        lost = abs(problem.w - problem.w.T).max() / abs(problem.w).max()
        if lost > ROUNDED:
            console().print(f"W is unsymmetric by {lost:.1g} of its largest entry, and is solved unchanged")


def _say_digits(file: Path, tolerance: float) -> None:
    """Mention data whose printed digits are coarser than the tolerance."""
    numbers = re.findall(r"[-+]?([0-9]+\.[0-9]+|[0-9]+)(?:[eE][-+]?[0-9]+)?(?=\s)", file.read_text(encoding="ascii"))
    digits = max((len(each.replace(".", "").strip("0")) for each in numbers if "." in each), default=0)
    rounded = 0.5 * 10.0 ** (1 - digits)
    if digits >= FEWEST and rounded > tolerance:
        console().print(
            f"its numbers have at most {digits} significant digits, which they were rounded to by up to {rounded:.0e} of them: the "
            f"answer to {tolerance:g} is that of the rounded numbers"
        )


def _show(errors: Errors, tolerance: float) -> None:
    shown = table("error", "", "what it is", right=("",))
    for name, meaning in MEANINGS.items():
        value = getattr(errors, name)
        if value == value:
            mark = " !" if value > max(tolerance, errors.floor) else ""
            shown.add_row(name.replace("_", " "), f"{value:.2e}{mark}", meaning)
    shown.add_row("floor", f"{errors.floor:.2e}", "what rounding alone explains")
    console().print(shown)
