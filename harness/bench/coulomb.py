"""Suite ``coulomb``: the open set of contact problems, solved by ours and by Siconos' solvers of the plane, and the associated
problems by quadratic programming.

Whatever a solver says of itself, its forces are judged by `ninedisk.references.contact_law`, with the velocities that follow from
them. Each solver climbs the same ladder of its own tolerances, whose meaning is its own, too; what counts for a target is the loosest
of them whose answer meets it, in time.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd.delassus import DelassusProblem
from ninedisk.core.cd.problem import ContactProblem, Sliding
from ninedisk.core.cd.settings import SolverOptions
from ninedisk.core.cd.solvers.by_matrix.solve import solve_matrix
from ninedisk.core.cd.solvers.feasibility import InfeasibleContactsError
from ninedisk.core.cd.solvers.solver import ContactSolver
from ninedisk.core.errors import InvalidSceneError, SolverNotConvergedError
from ninedisk.harness.api.engine import EngineError, EngineNotInstalledError
from ninedisk.harness.bench import problem_set
from ninedisk.harness.bench.cd import SICONOS_SWEEP, START_UP, lattice, resting
from ninedisk.harness.bench.measure import DRIVERS, Measured, Reporter, Sample, on_cores, timings
from ninedisk.harness.bench.records import new_row
from ninedisk.harness.engines.process import SYSTEM_PYTHON, clean_environment, package_version, system_python
from ninedisk.harness.engines.siconos.adapter import INSTALL, installed_siconos
from ninedisk.harness.results.schema import Row
from ninedisk.harness.run.isolation import run_isolated
from ninedisk.references import contact_law
from ninedisk.references.contact_law import Errors, errors_of_forces, errors_of_motion, planar_bodies

FloatArray = NDArray[np.float64]
SIZES, LARGE = (10, 30, 100), (300, 1_000, 3_000)
"""Disks of the states."""
SEED = 0
TOLERANCES = (1e-3, 1e-6, 1e-8, 1e-10, 1e-12)
"""Targets: the largest of all errors that the law reports."""
LADDER = tuple(10.0**-k for k in range(3, 16))
"""Own tolerances that a solver is asked for, one after the other."""
DENSE = 1_500
"""Contacts up to which a solver with a dense matrix is asked: the unknowns of its linear complementarity are three for each, whose
matrix, and the copy that pivots work on, then take a third of a gigabyte."""
DENSE_ENTRY = 1e-9
"""Seconds of a product with a dense matrix per entry, on the slow side."""
IN_TIME = 0.95
"""Share of the limit of one answer after which ours gives up, so that the forces that it has count: Siconos gets iterations that fit."""
BASE: dict[Sliding, str] = {"coulomb": "ninedisk", "associated": "ninedisk, associated"}


@dataclass(frozen=True)
class Attempt:
    """An answer to one tolerance of the solver's own: forces, shape (c, d), its cost, and whether the solver calls it solved."""

    own: float
    r: FloatArray
    seconds: float
    iterations: int
    good: bool


@dataclass(frozen=True)
class Climb:
    """Answers, each more accurate than the one before by the solver's own measure, and why there is no further one."""

    attempts: tuple[Attempt, ...]
    status: str = "not-reached"
    reason: str = ""


@dataclass(frozen=True)
class Job:
    """A problem, its file, and own tolerances to be tried in turn until an answer meets ``until``."""

    problem: ContactProblem | DelassusProblem
    file: Path
    tolerances: tuple[float, ...]
    until: float


@dataclass(frozen=True)
class Racer:
    """A solver: ``climb(jobs, limit)``, a `Climb` for each; ``limit`` is that of one answer [s]."""

    name: str
    sliding: Sliding
    climb: Callable[[Sequence[Job], float], list[Climb]]
    version: str = ""
    ladder: tuple[float, ...] = LADDER
    most: int = sys.maxsize
    matrix: str = ""


def racers() -> list[Racer]:
    """All solvers, installed or not: one that is not says so when it is asked."""
    import ninedisk

    own, siconos = ninedisk.__version__, installed_siconos(SYSTEM_PYTHON)[0] or ""
    qp = {name: package_version(name)[0] or "" for name in ("clarabel", "piqp")}
    return [
        Racer(BASE["coulomb"], "coulomb", partial(own_climbs, "coulomb"), own),
        Racer("siconos nsgs", "coulomb", partial(siconos_climbs, "NSGS", 2), siconos, matrix="sparse blocks of 2 x 2"),
        # A direct method: its tolerance judges the answer and does not change it.
        Racer(
            "siconos lemke", "coulomb", partial(siconos_climbs, "LEMKE", 2), siconos, (1e-12,), DENSE, "dense matrix"
        ),
        Racer("siconos cpg", "coulomb", partial(siconos_climbs, "CPG", 2), siconos, LADDER, DENSE, "dense matrix"),
        Racer(BASE["associated"], "associated", partial(own_climbs, "associated"), own),
        *(Racer(name, "associated", partial(_quadratic, name), version) for name, version in qp.items()),
    ]


def judge(problem: ContactProblem | DelassusProblem, r: FloatArray, sliding: Sliding) -> Errors:
    """Errors of contact forces r, shape (c, d), and the motion that they make, from the law and the bodies alone."""
    if not np.isfinite(r).all():  # nothing can be multiplied by them
        r = np.full(r.shape, np.inf)
    if isinstance(problem, DelassusProblem):
        with np.errstate(invalid="ignore", over="ignore"):
            return errors_of_forces(problem.w, problem.b, problem.mu, r, associated=sliding == "associated")
    names = ("mass", "force", "bodies", "normal", "arms", "offset", "compliance", "shear_0")
    planar = planar_bodies(**{name: getattr(problem, name) for name in names})
    with np.errstate(invalid="ignore", over="ignore"):
        return errors_of_motion(*planar, problem.mu, r, associated=sliding == "associated")


def own_climbs(sliding: Sliding, jobs: Sequence[Job], limit: float) -> list[Climb]:
    """Climbs of our solvers, of bodies and of matrices."""
    return [_climb_own_solver(sliding, job, limit) for job in jobs]


def _climb_own_solver(sliding: Sliding, job: Job, limit: float) -> Climb:
    found: list[Attempt] = []
    for tolerance in job.tolerances:
        options = SolverOptions(tolerance=tolerance, time_limit=IN_TIME * limit)
        begin = time.perf_counter()
        r, iterations, why = _solved(job.problem, options, sliding)
        if r is not None:
            found.append(Attempt(tolerance, r, time.perf_counter() - begin, iterations, good=not why))
        if why:
            return Climb(tuple(found), reason=why)
        if judge(job.problem, found[-1].r, sliding).solved(job.until):
            break
    return Climb(tuple(found))


def _solved(
    problem: ContactProblem | DelassusProblem, options: SolverOptions, sliding: Sliding
) -> tuple[FloatArray | None, int, str]:
    """Forces, iterations, and why they are no solution in the solver's own opinion; "" if they are."""
    if isinstance(problem, DelassusProblem):
        answer = solve_matrix(problem, options, sliding=sliding)
        why = "" if answer.error <= options.tolerance else f"its own error stays at {answer.error:.3g}"
        return answer.r, answer.iterations, why
    try:
        result = ContactSolver("auto", options, sliding).solve(problem)
    except InfeasibleContactsError as error:
        return None, 0, str(error)
    except SolverNotConvergedError as error:
        return error.forces, error.iterations, str(error)
    return result.r, result.iterations, ""


def siconos_climbs(name: str, dimension: int, jobs: Sequence[Job], limit: float) -> list[Climb]:
    """Climbs of a solver of Siconos in 2D or 3D, by its name there.

    Raises
    ------
    EngineNotInstalledError
    """
    version, reason = installed_siconos(SYSTEM_PYTHON)
    if version is None:
        raise EngineNotInstalledError(f"Siconos is not installed ({reason}): {INSTALL}")

    def most(c: int) -> int:
        """Iterations that fit into the limit, so that it answers before it is stopped.

        Conjugate gradients end after as many steps as there are unknowns, for given statuses; they get fifty times as many, since
        here they often have the answer and go on.
        """
        fit = int(limit / (SICONOS_SWEEP * c if name == "NSGS" else DENSE_ENTRY * (2 * c) ** 2))
        if dimension == 3 and name != "NSGS":
            return 1_000  # iterations with a factorisation; what takes longer than its limit is stopped
        return max(1_000, min(fit, 100 * c) if name == "CPG" else fit)

    requests = [
        {
            **_request(job, 2.0 * limit, "coulomb"),
            "solver": name,
            "dimension": dimension,
            "max_iterations": most(job.problem.n_contacts),
        }
        for job in jobs
    ]
    return _ask_driver(system_python(str(DRIVERS / "siconos_bench.py"), "--race"), requests, clean_environment())


def _quadratic(name: str, jobs: Sequence[Job], limit: float) -> list[Climb]:
    if package_version(name)[0] is None:
        raise EngineNotInstalledError(f"{name} is not installed: pip install {name}")
    requests = [{**_request(job, limit, "associated"), "solver": name} for job in jobs]
    return _ask_driver([sys.executable, "-P", "-s", str(DRIVERS / "qp_bench.py"), "--race"], requests, None)


def _request(job: Job, limit: float, sliding: Sliding) -> dict[str, Any]:
    given = {"problem": str(job.file), "tolerances": job.tolerances, "until": job.until, "limit": limit}
    return {**given, "associated": sliding == "associated"}


def _ask_driver(
    command: Sequence[str], requests: list[dict[str, Any]], environment: dict[str, str] | None
) -> list[Climb]:
    """Climbs of a driver; where one answer takes too long, or crashes it, a new process goes on with the next problem."""
    found: list[Climb] = []
    with tempfile.TemporaryDirectory(prefix="ninedisk-bench-", ignore_cleanup_errors=True) as folder:
        for k, request in enumerate(requests):
            request["answer"] = str(Path(folder) / f"{k}.npz")
        while len(found) < len(requests):
            left = requests[len(found) :]
            text = json.dumps({"law": contact_law.__file__, "problems": left})
            limit = START_UP + sum(len(each["tolerances"]) * each["limit"] for each in left)
            why = "it did not answer"
            try:
                run_isolated(command, stdin=text, time_limit=limit, cwd=folder, env=environment)
            except EngineError as error:
                why = str(error)
            for request in left:
                climb, done = _read(Path(request["answer"]), request["limit"], why)
                found.append(climb)
                if not done:
                    break
    return found


def _read(answer: Path, limit: float, why: str) -> tuple[Climb, bool]:
    """What a driver wrote of one problem, and whether it came to its end."""
    stopped = ("timeout", f"no answer in {limit:g} s") if "SIGALRM" in why else ("error", why)
    try:
        with np.load(answer) as data:
            held = {key: data[key] for key in data.files}
    except (OSError, ValueError):
        return Climb((), *stopped), False
    columns = zip(held["own"], held["r"], held["seconds"], held["iterations"], held["good"], strict=True)
    attempts = tuple(Attempt(float(o), r, float(s), int(i), good=bool(g)) for o, r, s, i, g in columns)
    if not held["done"]:
        return Climb(attempts, *stopped), False
    error = str(held["error"])
    return Climb(attempts, "error" if error else "not-reached", error), True


@dataclass(frozen=True)
class _Judged:
    """A climb with the errors of its answers."""

    climb: Climb
    errors: tuple[Errors, ...]

    def first(self, tolerance: float, limit: float) -> int | None:
        """The loosest attempt that meets a target in time."""
        for k, (attempt, errors) in enumerate(zip(self.climb.attempts, self.errors, strict=True)):
            if attempt.seconds <= limit and errors.solved(tolerance):
                return k
        return None


def run_state(
    family: str, disks: int, racers: Sequence[Racer], *, repeats: int, time_limit: float, notify: Reporter
) -> Iterator[list[Row]]:
    """Rows of the problems of one state: one for each problem, solver and target."""
    notify("making the problems")
    try:
        kept = problem_set.stored_state(family, disks, seed=SEED)
    except InvalidSceneError as error:
        notify(f"left out: {error}")
        return
    problems = [ContactProblem.load(file) for file, _ in kept]
    for problem in problems:
        _ = problem.b, problem.rho, problem.blocks  # made once, by nobody's clock
    _warm_up(racers)
    given = [Given(problem, *each) for problem, each in zip(problems, kept, strict=True)]
    yield race("coulomb", given, racers, repeats=repeats, time_limit=time_limit, notify=notify)


@dataclass(frozen=True)
class Given:
    """A problem, the file that drivers read, and what is known of it: ``file``, ``disks``, ``sha256``."""

    problem: ContactProblem | DelassusProblem
    file: Path
    facts: dict[str, Any]


def race(
    suite: str, given: Sequence[Given], racers: Sequence[Racer], *, repeats: int, time_limit: float, notify: Reporter
) -> list[Row]:
    """One row for each problem, solver and target; repeats are interleaved."""
    judged: dict[str, list[_Judged]] = {}
    seconds: dict[tuple[str, int, float], list[float]] = {}
    for repeat in range(repeats):
        for racer in racers:
            notify(f"{racer.name}, repeat {repeat + 1} of {repeats}")
            if repeat == 0:
                whole = [Job(each.problem, each.file, racer.ladder, TOLERANCES[-1]) for each in given]
                judged[racer.name] = _first(racer, whole, time_limit)
            needed = [_needed_tolerances(its, time_limit) for its in judged[racer.name]]
            again = {k: its.climb for k, its in enumerate(judged[racer.name])}
            if repeat:  # the same answers, for their times alone
                jobs = {
                    k: Job(given[k].problem, given[k].file, tuple(sorted(set(rungs.values()), reverse=True)), 0.0)
                    for k, rungs in enumerate(needed)
                    if rungs
                }
                again = dict(zip(jobs, _climbs(racer, list(jobs.values()), time_limit), strict=True))
            for k, climb in again.items():
                times = {attempt.own: attempt.seconds for attempt in climb.attempts}
                for target, own in needed[k].items():
                    if own in times:
                        seconds.setdefault((racer.name, k, target), []).append(times[own])
    return [
        _row(suite, each, racer, judged[racer.name][k], seconds, k, target, time_limit)
        for k, each in enumerate(given)
        for racer in racers
        for target in TOLERANCES
    ]


def _first(racer: Racer, jobs: list[Job], limit: float) -> list[_Judged]:
    climbs = _climbs(racer, jobs, limit)
    return [
        _Judged(climb, tuple(judge(job.problem, attempt.r, racer.sliding) for attempt in climb.attempts))
        for job, climb in zip(jobs, climbs, strict=True)
    ]


def _climbs(racer: Racer, jobs: list[Job], limit: float) -> list[Climb]:
    """Climbs of those problems that are not too large for the solver."""
    fit = [job for job in jobs if job.problem.n_contacts <= racer.most]
    too_large = f"more than {racer.most} contacts: its matrix is dense"
    try:
        with on_cores(1):
            found = iter(racer.climb(fit, limit) if fit else [])
    except EngineNotInstalledError as error:
        return [Climb((), "not-installed", str(error))] * len(jobs)
    return [
        next(found) if job.problem.n_contacts <= racer.most else Climb((), "unsupported", too_large) for job in jobs
    ]


def _needed_tolerances(its: _Judged, limit: float) -> dict[float, float]:
    """Own tolerance by target, of those that are met."""
    found = {target: its.first(target, limit) for target in TOLERANCES}
    return {target: its.climb.attempts[k].own for target, k in found.items() if k is not None}


_warm: set[str] = set()


def _warm_up(racers: Sequence[Racer]) -> None:
    """Compile or load the kernels of our solvers."""
    for racer in racers:
        if racer.name in BASE.values() and racer.name not in _warm:
            _warm.add(racer.name)
            racer.climb([Job(resting(lattice(3, 4)), Path(), (1e-4, 1e-10), 0.0)], 60.0)


def _row(
    suite: str,
    given: Given,
    racer: Racer,
    its: _Judged,
    seconds: dict[tuple[str, int, float], list[float]],
    number: int,
    target: float,
    limit: float,
) -> Row:
    row: Row = {
        "suite": suite,
        "problem": Path(given.facts["file"]).stem,
        "engine": racer.name,
        "engine_version": racer.version,
        "threads": 1,
        "disks": given.facts["disks"],
        "contacts": given.problem.n_contacts,
        "start": racer.sliding,
        "tolerance": target,
        "check": f"largest error of the forces found, from the law alone ({racer.sliding} rule)",
        "check_bound": target,
    }
    attempts, errors = its.climb.attempts, its.errors
    met = its.first(target, limit)
    # Of answers that miss the target: the best one.
    shown = met if met is not None else min(range(len(errors)), key=lambda k: errors[k].worst, default=None)
    more: dict[str, Any] = {"problem sha256": given.facts["sha256"], "time limit [s]": limit}
    if racer.matrix:
        more["matrix"] = racer.matrix
    if shown is not None:
        one = errors[shown]
        row |= {"check_value": one.worst, "natural_map": one.natural_map, "duality_gap": one.duality_gap}
        row["iterations"] = attempts[shown].iterations
        more |= {
            "own tolerance": attempts[shown].own,
            "errors": {name: value if np.isfinite(value) else str(value) for name, value in one._asdict().items()},
        }
    if met is not None:
        own, base = (_timed_row(seconds.get((name, number, target), [])) for name in (racer.name, BASE[racer.sliding]))
        return new_row(
            **row, settings=json.dumps(more), **{**timings(own, base, BASE[racer.sliding]), "status": "pass"}
        )
    # It calls an answer solved to the target that is no solution by any target.
    pairs = zip(attempts, errors, strict=True)
    more["claimed"] = any(each.good and each.own <= target and not its.solved(TOLERANCES[0]) for each, its in pairs)
    why = its.climb.reason
    if not why and shown is not None:
        why = f"worst error {errors[shown].worst:.3g} with its own tolerance {attempts[shown].own:g}" + (
            "; it says that it is solved" if attempts[shown].good else ""
        )
    return new_row(**row, settings=json.dumps(more), status=its.climb.status, reason=why)


def _timed_row(seconds: list[float]) -> Measured:
    return Measured(tuple(Sample(seconds=each) for each in seconds), "pass", "")
