"""Suite ``cd``: contact problems of packings at rest, on the core's solvers, Clarabel, PIQP and Siconos.

Problems are rigid and frictional, at rest under gravity: one step from velocity zero. Whatever a solver says of itself, its forces are
judged by `ninedisk.core.cd.problem.measure`, with the velocities that follow from them.

General solvers of quadratic programs get a convex program in the unknowns velocities and ray forces, ``r = G a`` with ``a >= 0``, every
one in units of sqrt(energy)::

    min 1/2 v' M v + 1/2 r' C r + (g - C (0, q0))' r    subject to    M v - H' r = f,  a >= 0

whose value at ``M v = f + H' r`` is the objective ``D(r) = 1/2 r' W r + b' r`` and a constant, but which is sparse and never forms W.
"""

from __future__ import annotations

import json
import math
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ninedisk.core.cd.problem import ContactProblem, Residuals, Sliding, measure
from ninedisk.core.cd.settings import SolverOptions
from ninedisk.core.cd.solvers.gauss_seidel import STRIPED_FROM, solve_gauss_seidel
from ninedisk.core.cd.solvers.interior_point import InteriorPoint
from ninedisk.core.cd.solvers.outcome import SolverResult
from ninedisk.core.cd.solvers.proximal import ProximalPoint
from ninedisk.core.errors import CoreError, SolverNotConvergedError
from ninedisk.core.law import ContactLaw
from ninedisk.core.numerics import Numerics
from ninedisk.core.packings import DENSITY, GRAVITY
from ninedisk.core.scene import Scene
from ninedisk.core.scene.bodies import Disks
from ninedisk.core.scene.walls import Wall
from ninedisk.harness.api.engine import EngineError, EngineNotInstalledError
from ninedisk.harness.bench.dem import packing
from ninedisk.harness.bench.measure import (
    DRIVERS,
    Contender,
    Measured,
    NotReachedError,
    Reporter,
    Sample,
    ask_driver,
    interleave,
    timings,
    usable_cores,
)
from ninedisk.harness.bench.records import new_row
from ninedisk.harness.engines.process import SYSTEM_PYTHON, clean_environment, package_version, system_python
from ninedisk.harness.engines.siconos.adapter import INSTALL, installed_siconos
from ninedisk.harness.results.schema import Row

FloatArray = NDArray[np.float64]
DT, MU = 1e-3, 0.3
SIZES, LARGE = (1_000, 10_000), (100_000,)
COLUMN = 50.0
"""Height over width of the tall column."""
ROWS, COLUMNS, MORE_COLUMNS = 50, 200, 2_000
"""Of the hexagonal lattice."""
TURN = math.radians(1.0)
"""Angle by which gravity is turned in the problem whose forces make the warm start."""
TOUCHING = 1e-6
"""Gap over radius up to which two bodies are in contact; the overlaps of a settled packing are closed contacts all the same."""
TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10)
BASE: Mapping[Sliding, str] = {
    "associated": "interior-point",
    "coulomb": "gauss-seidel, Coulomb",
}
"""Solver of each rule that the ratios refer to."""
REFERENCE = 1e-10
"""Tolerance of the solutions that start warm solvers and that objectives are compared with."""
TIGHTER = 0.1
"""Factor of an external solver's own tolerance where its answer misses the target: it measures something else."""
TIGHTEST = 1e-14
SICONOS_SWEEP = 3e-7
"""Seconds of a Siconos sweep per contact, on the slow side: bounds its sweeps, so that it answers before it is stopped."""
START_UP = 60.0
"""Seconds that an external process may take besides the solver's own time: imports, reading, setting up."""
UNBOUNDED = 10**9
"""Sweeps of Gauss-Seidel: the time limit alone stops them."""


def problems(
    sizes: list[int], *, large: bool, progress: Callable[[int, int], None] | None = None
) -> dict[str, Callable[[], ContactProblem]]:
    """Makers of the problems by name; the tall column has as many disks as the smallest packing."""
    made: dict[str, Callable[[], ContactProblem]] = {}
    for n in sizes:
        made[f"packing-{n}"] = lambda n=n: resting(packing(n, progress=progress))  # type: ignore[misc]
    if sizes:
        made[f"column-{sizes[0]}"] = lambda: resting(packing(sizes[0], aspect=COLUMN, progress=progress))
    for columns in (COLUMNS, MORE_COLUMNS)[: 2 if large else 1]:
        made[f"lattice-{ROWS}x{columns}"] = lambda columns=columns: resting(lattice(ROWS, columns))  # type: ignore[misc]
    return made


def lattice(rows: int, columns: int, radius: float = 0.5) -> Scene:
    """Equal disks in the densest lattice, each row shifted by a radius, between walls that all touch."""
    law = ContactLaw(kn=1.0, mu=MU, regularised=True)
    j, i = np.divmod(np.arange(rows * columns), columns)
    x = np.column_stack([radius * (1.0 + 2.0 * i + j % 2), radius * (1.0 + math.sqrt(3.0) * j)])
    width = radius * (2.0 * columns + 1.0)
    walls = (
        Wall(name="left", point=(0.0, 0.0), normal=(1.0, 0.0), law=law),
        Wall(name="right", point=(width, 0.0), normal=(-1.0, 0.0), law=law),
        Wall(name="bottom", point=(0.0, 0.0), normal=(0.0, 1.0), law=law),
    )
    ones = np.ones(len(x))
    disks = Disks(x=x, radius=radius * ones, mass=DENSITY * math.pi * radius**2 * ones)
    return Scene(disks=disks, disk_disk=law, walls=walls, gravity=(0.0, -GRAVITY))


def resting(scene: Scene) -> ContactProblem:
    """The contact problem of one step `DT` from rest, with every touching pair a rigid contact that is just closed.

    Parameters
    ----------
    scene : Scene
        Disks that touch or overlap; their own laws do not matter.
    """
    return step_problem(scene, mu=MU)


def step_problem(scene: Scene, *, mu: float, elastic: bool = False, moving: bool = False) -> ContactProblem:
    """The contact problem of one step `DT` of disks that touch or overlap, all with the friction coefficient ``mu``.

    Rigid contacts are just closed, whatever the overlap; elastic ones have that and the scene's own stiffness. ``moving``: from the
    velocities of disks and walls, instead of from rest.
    """
    from ninedisk.core.cd.contacts import Place, contact_frames
    from ninedisk.core.cd.laws import LawTable
    from ninedisk.core.cd.solvers.solver import ContactSolver
    from ninedisk.core.cd.step import DynamicStep, bodies_of
    from ninedisk.core.dem.neighbours import PairFinder
    from ninedisk.core.scene.motion import compile_motion, wall_poses

    def law(own: ContactLaw) -> ContactLaw:
        return replace(own, mu=mu, beta=0.0) if elastic else ContactLaw(kn=1.0, mu=mu, regularised=True)

    alike = scene.replace(
        disk_disk=law(scene.disk_disk),
        walls=tuple(replace(wall, law=law(wall.law)) for wall in scene.walls),
        initial_shear={},
    )
    radius, x = scene.disks.radius, scene.disks.x.copy()
    motion = compile_motion(alike.walls)
    poses = wall_poses(motion, 0.0)
    later = wall_poses(motion, DT) if moving else poses
    numerics = Numerics(dt=DT, n_steps=1)
    laws = LawTable(alike, numerics, "elastic" if elastic else "rigid")
    pairs = PairFinder(radius, len(alike.walls), scene.disks.fixed).within(x, poses, TOUCHING * float(radius.min()))
    place = Place(x, np.zeros(len(x)), radius, poses, later)
    frames = contact_frames(pairs, place, laws)
    if not elastic:
        frames = frames._replace(gap=np.zeros(len(pairs)), gap_before=np.zeros(len(pairs)))
    solver = ContactSolver("interior-point", SolverOptions(), "associated")
    start = np.column_stack([scene.disks.v, scene.disks.omega]) if moving else np.zeros((len(x), 3))
    step = DynamicStep(bodies_of(alike), laws, solver, start, DT, 1.0, place.round_off())
    made = step.problem(frames, np.zeros((len(pairs), 2)))
    # Contacts are closed by definition here, not by coordinates: nothing about them is unresolved.
    return made if elastic else replace(made, resolution=0.0)


def turned_gravity(problem: ContactProblem, angle: float = TURN) -> ContactProblem:
    """The same contacts under gravity turned by ``angle`` [rad]."""
    c, s = math.cos(angle), math.sin(angle)
    force = problem.force.copy()
    force[:, 0] = c * problem.force[:, 0] - s * problem.force[:, 1]
    force[:, 1] = s * problem.force[:, 0] + c * problem.force[:, 1]
    return replace(problem, force=force)


@dataclass(frozen=True)
class Task:
    """One problem to a tolerance, from nothing or from the forces ``start``; ``file`` holds the problem for other processes."""

    problem: ContactProblem
    file: Path
    sliding: Sliding
    tolerance: float
    start: FloatArray | None


@dataclass
class Solver:
    """A solver by name.

    Attributes
    ----------
    sliding : {"associated", "coulomb"}
        The rule that it solves.
    solve : callable
        ``solve(task, limit)`` gives a `Sample` whose facts hold the forces and their figures, or raises `NotReachedError`.
    warm : bool
        Whether it can start from given forces.
    version : str
    sweeps : bool
        Whether its iterations are sweeps over the contacts.
    threads : int
    """

    name: str
    sliding: Sliding
    solve: Callable[[Task, float], Sample]
    warm: bool = True
    version: str = ""
    sweeps: bool = False
    threads: int = 1
    settings: dict[str, Any] = field(default_factory=dict)


def solvers() -> list[Solver]:
    """All solvers, installed or not: one that is not says so when it is asked to solve."""
    import ninedisk

    own = ninedisk.__version__
    qp = {name: package_version(name)[0] or "" for name in ("clarabel", "piqp")}
    return [
        Solver("interior-point", "associated", _interior, version=own),
        Solver("gauss-seidel", "associated", _gauss_seidel(1.0), version=own, sweeps=True),
        *_with_two_cores("gauss-seidel", "associated", 1.0, own),
        Solver("clarabel", "associated", _quadratic("clarabel"), warm=False, version=qp["clarabel"]),
        Solver("piqp", "associated", _quadratic("piqp"), warm=False, version=qp["piqp"]),
        Solver("gauss-seidel, Coulomb", "coulomb", _gauss_seidel(1.0), version=own, sweeps=True),
        Solver("gauss-seidel 1.5, Coulomb", "coulomb", _gauss_seidel(1.5), version=own, sweeps=True),
        *_with_two_cores("gauss-seidel 1.5, Coulomb", "coulomb", 1.5, own),
        Solver("interior-point, Coulomb", "coulomb", _coulomb, warm=False, version=own),
        Solver(
            "siconos nsgs, Coulomb",
            "coulomb",
            _Siconos(),
            warm=False,
            version=installed_siconos(SYSTEM_PYTHON)[0] or "",
            sweeps=True,
            settings={"matrix": "sparse blocks of 2 x 2", "unit of force": "largest diagonal entry of W near 1"},
        ),
    ]


def _with_two_cores(name: str, sliding: Sliding, relaxation: float, version: str) -> list[Solver]:
    """Gauss-Seidel with two threads, where there are two cores."""
    if usable_cores() < 2:
        return []
    solve = _gauss_seidel(relaxation, threads=2)
    return [Solver(f"{name}, 2 threads", sliding, solve, version=version, sweeps=True, threads=2)]


def figures(problem: ContactProblem, r: FloatArray, sliding: Sliding) -> Residuals:
    """Residuals of contact forces and the velocities that follow from them."""
    return measure(problem, problem.body_velocity(r), r, sliding=sliding)


def facts_of(task: Task, r: FloatArray, iterations: int) -> dict[str, Any]:
    """What the check and the record need of a solution."""
    found = figures(task.problem, r, task.sliding)
    return {
        "reached": found.reached(task.tolerance),
        "natural_map": found.natural_map,
        "duality_gap": found.duality_gap,
        "objective": task.problem.objective(r),
        "iterations": iterations,
    }


def _own_solver(task: Task, limit: float, solve: Callable[[SolverOptions], SolverResult], **more: Any) -> Sample:
    options = SolverOptions(tolerance=task.tolerance, time_limit=limit, **more)
    begin = time.perf_counter()
    try:
        result = solve(options)
    except SolverNotConvergedError as error:
        facts: dict[str, Any] = {"iterations": error.iterations}
        if error.residuals is not None:
            facts |= {"natural_map": error.residuals.natural_map, "duality_gap": error.residuals.duality_gap}
        raise NotReachedError(str(error), {**facts, "seconds": time.perf_counter() - begin}) from error
    seconds = time.perf_counter() - begin
    return Sample(seconds=seconds, facts=facts_of(task, result.r, result.iterations))


def _interior(task: Task, limit: float) -> Sample:
    def with_options(options: SolverOptions) -> SolverResult:
        return InteriorPoint(options).solve(task.problem, start=task.start)

    return _own_solver(task, limit, with_options)


def _gauss_seidel(relaxation: float, threads: int = 1) -> Callable[[Task, float], Sample]:
    def solve(task: Task, limit: float) -> Sample:
        def with_options(options: SolverOptions) -> SolverResult:
            return solve_gauss_seidel(task.problem, options, sliding=task.sliding, start=task.start)

        return _own_solver(task, limit, with_options, relaxation=relaxation, threads=threads, max_iterations=UNBOUNDED)

    return solve


def _coulomb(task: Task, limit: float) -> Sample:
    return _own_solver(task, limit, lambda options: ProximalPoint(options).solve(task.problem))


def _quadratic(name: str) -> Callable[[Task, float], Sample]:
    """A solver of quadratic programs, with its own tolerance lowered until the target is met."""
    needed: dict[tuple[Path, float], float] = {}

    def solve(task: Task, limit: float) -> Sample:
        if package_version(name)[0] is None:
            raise EngineNotInstalledError(f"{name} is not installed: pip install {name}")
        command = [sys.executable, "-P", "-s", str(DRIVERS / "qp_bench.py")]

        def ask(own: float, left: float) -> dict[str, Any]:
            request = {"solver": name, "problem": str(task.file), "tolerance": own, "time_limit": left}
            return _ask_driver(command, request, left)

        return _tighten_until_met(task, needed, ask, limit)

    return solve


class _Siconos:
    def __init__(self) -> None:
        self._needed: dict[tuple[Path, float], float] = {}

    def __call__(self, task: Task, limit: float) -> Sample:
        version, reason = installed_siconos(SYSTEM_PYTHON)
        if version is None:
            raise EngineNotInstalledError(f"Siconos is not installed ({reason}): {INSTALL}")

        def ask(own: float, left: float) -> dict[str, Any]:
            sweeps = max(10, int(left / (SICONOS_SWEEP * task.problem.n_contacts)))
            request = {"problem": str(task.file), "tolerance": own, "max_iterations": sweeps}
            command = system_python(str(DRIVERS / "siconos_bench.py"))
            return _ask_driver(command, request, 2.0 * left, clean_environment())

        return _tighten_until_met(task, self._needed, ask, limit)


def _tighten_until_met(
    task: Task,
    needed: dict[tuple[Path, float], float],
    ask: Callable[[float, float], dict[str, Any]],
    limit: float,
) -> Sample:
    """The first answer that meets the target; ``needed`` remembers the solver's own tolerance for the next repeat.

    ``ask(own, left)`` solves to the solver's own tolerance within ``left`` seconds; all attempts share ``limit``.
    """
    key = (task.file, task.tolerance)
    own, left = needed.get(key, task.tolerance), limit
    best: dict[str, Any] = {}
    while own >= TIGHTEST and (left > 0.0 or not best):
        answer = ask(own, left)
        facts = facts_of(task, answer["r"], int(answer["iterations"]))
        facts |= {"own_tolerance": own, "word": str(answer["word"]), "seconds": float(answer["seconds"])}
        if facts["reached"]:
            needed[key] = own
            return Sample(seconds=facts["seconds"], facts=facts)
        if best and not _closer_tolerance(facts, best):
            break
        best, own, left = facts, own * TIGHTER, left - facts["seconds"]
    raise NotReachedError(
        f"natural-map residual {best['natural_map']:.3g} and duality gap {best['duality_gap']:.3g} with its own tolerance "
        f"{best['own_tolerance']:g} after {best['iterations']} iterations and {best['seconds']:.3g} s (it says: {best['word']})",
        best,
    )


def _closer_tolerance(one: dict[str, Any], other: dict[str, Any]) -> bool:
    return bool(max(one["natural_map"], one["duality_gap"]) < max(other["natural_map"], other["duality_gap"]))


def _ask_driver(
    command: Sequence[str], request: Mapping[str, Any], limit: float, environment: Mapping[str, str] | None = None
) -> dict[str, Any]:
    with tempfile.TemporaryDirectory(prefix="ninedisk-bench-", ignore_cleanup_errors=True) as folder:
        return ask_driver(command, request, Path(folder), limit=limit + START_UP, environment=environment)


@cache
def warm_up() -> None:
    """Compile or load the kernels of all in-house solvers, so that no measurement pays for it."""

    tiny = resting(lattice(3, 4))
    for solver in solvers():
        if solver.warm or solver.name == "interior-point, Coulomb":
            try:
                solver.solve(Task(tiny, Path(), solver.sliding, 1e-4, None), 60.0)
            except (EngineError, SolverNotConvergedError):
                continue


@dataclass(frozen=True, kw_only=True)
class Program:
    """``min 1/2 x' P x + c' x`` subject to ``A x = b``, and ``x[n:] >= 0``.

    Attributes
    ----------
    quadratic, equality : sparse matrix in compressed columns
        P (whole, not a triangle) and A.
    linear, right : ndarray
        c and b.
    n : int
        Unknowns that are velocities.
    """

    problem: ContactProblem
    quadratic: Any
    equality: Any
    linear: FloatArray
    right: FloatArray
    n: int
    _free: NDArray[np.int64]
    _motion: FloatArray
    _rays: Any
    _size: float

    def forces(self, x: FloatArray) -> FloatArray:
        """Contact forces, shape (c, 2), inside the cones, of a solution ``x``."""
        r: FloatArray = self._size * (self._rays @ np.maximum(x[self.n :], 0.0))
        return r.reshape(self.problem.n_contacts, 2)

    def velocities(self, x: FloatArray) -> FloatArray:
        """Body velocities, shape (b, 3), of a solution ``x``."""
        v = np.zeros(self.problem.mass.size)
        v[self._free] = self._size * self._motion * x[: self.n]
        return v.reshape(-1, 3)


def program(problem: ContactProblem) -> Program:
    """The program of a contact problem."""
    c = problem.n_contacts
    free = np.flatnonzero(problem.free.ravel())
    rough = np.flatnonzero(problem.mu > 0.0)
    k, sign = np.append(np.arange(c), rough), np.append(np.ones(c), -np.ones(len(rough)))
    scale = np.sqrt(problem.rho[k])
    rays = sp.csc_array(
        (
            np.concatenate([scale, scale * sign * problem.mu[k]]),
            (np.concatenate([2 * k, 2 * k + 1]), np.tile(np.arange(len(k)), 2)),
        ),
        shape=(2 * c, len(k)),
    )
    motion = 1.0 / np.sqrt(problem.mass.ravel()[free])
    pull = sp.diags_array(motion) @ problem.jacobian()[:, free].T @ rays
    offset = problem.offset - problem.compliance * np.column_stack([np.zeros(c), problem.shear_0])
    load, slack = motion * problem.force.ravel()[free], rays.T @ offset.ravel()
    n = len(free)
    soft = rays.T @ sp.diags_array(problem.compliance.ravel()) @ rays
    size = max(float(np.linalg.norm(load)), float(np.linalg.norm(np.minimum(slack, 0.0))), 1e-300)
    return Program(
        problem=problem,
        quadratic=sp.csc_matrix(sp.block_diag([sp.eye_array(n), soft])),
        equality=sp.csc_matrix(sp.hstack([sp.eye_array(n), -pull])),
        linear=np.append(np.zeros(n), slack) / size,
        right=load / size,
        n=n,
        _free=free,
        _motion=motion,
        _rays=rays,
        _size=size,
    )


def run_problem(
    name: str,
    make: Callable[[], ContactProblem],
    solvers: Sequence[Solver],
    *,
    repeats: int,
    time_limit: float,
    notify: Reporter,
) -> Iterator[list[Row]]:
    """Rows of one problem, cold and warm, one tolerance after the other.

    A solver that misses a tolerance is not asked for a tighter one.
    """
    warm_up()
    notify("making the problem")
    problem = make()
    with tempfile.TemporaryDirectory(prefix="ninedisk-bench-", ignore_cleanup_errors=True) as folder:
        file = Path(folder) / "problem.npz"  # what other processes read
        problem.save(file)
        yield from _rows(name, problem, file, solvers, repeats=repeats, time_limit=time_limit, notify=notify)


def _rows(
    name: str,
    problem: ContactProblem,
    file: Path,
    solvers: Sequence[Solver],
    *,
    repeats: int,
    time_limit: float,
    notify: Reporter,
) -> Iterator[list[Row]]:
    _ = problem.b, problem.rho, problem.blocks  # made once, by nobody's clock
    notify("reference solutions")
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
                notify=lambda text, start=start, tolerance=tolerance: notify(f"{start}, {tolerance:g}: {text}"),  # type: ignore[misc]
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
