"""The contact solvers of the suite ``cd``: the core's own, general solvers of quadratic programs, and Siconos.

Whatever a solver says of itself, its forces are judged by `ninedisk.core.cd.problem.measure`, with the velocities that follow
from them.

The convex program of a contact problem for general solvers of quadratic programs.

In the unknowns velocities and ray forces, ``r = G a`` with ``a >= 0``, every one in units of sqrt(energy)::

    min 1/2 v' M v + 1/2 r' C r + (g - C (0, q0))' r    subject to    M v - H' r = f,  a >= 0

whose value at ``M v = f + H' r`` is the objective ``D(r) = 1/2 r' W r + b' r`` and a constant, but which is sparse and never
forms W.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ninedisk.core.cd.problem import ContactProblem, Residuals, Sliding, measure
from ninedisk.core.cd.settings import SolverOptions, SolverResult
from ninedisk.core.cd.solvers.coulomb import CoulombInteriorPoint
from ninedisk.core.cd.solvers.gauss_seidel import solve_gauss_seidel
from ninedisk.core.cd.solvers.interior_point import InteriorPoint
from ninedisk.core.errors import SolverNotConvergedError
from ninedisk.harness.api.engine import EngineError, EngineNotInstalledError
from ninedisk.harness.bench.dem_engines import cores
from ninedisk.harness.bench.measure import NotReachedError, Sample
from ninedisk.harness.engines.process import SYSTEM_PYTHON, clean_environment, package_version, system_python
from ninedisk.harness.engines.siconos.adapter import INSTALL, installed_siconos
from ninedisk.harness.run.isolation import run_isolated

FloatArray = NDArray[np.float64]
DRIVER = Path(__file__).parent / "drivers" / "siconos_bench.py"

TIGHTER = 0.1
"""Factor of an external solver's own tolerance where its answer misses the target: it measures something else."""
TIGHTEST = 1e-14
SICONOS_SWEEP = 3e-7
"""Seconds of a Siconos sweep per contact, on the slow side: bounds its sweeps, so that it answers before it is stopped."""
START_UP = 60.0
"""Seconds that an external process may take besides the solver's own time: imports, reading, setting up."""
UNBOUNDED = 10**9
"""Sweeps of Gauss-Seidel: the time limit alone stops them."""


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
        *_on_two_cores("gauss-seidel", "associated", 1.0, own),
        Solver("clarabel", "associated", _quadratic("clarabel"), warm=False, version=qp["clarabel"]),
        Solver("piqp", "associated", _quadratic("piqp"), warm=False, version=qp["piqp"]),
        Solver("gauss-seidel, Coulomb", "coulomb", _gauss_seidel(1.0), version=own, sweeps=True),
        Solver("gauss-seidel 1.5, Coulomb", "coulomb", _gauss_seidel(1.5), version=own, sweeps=True),
        *_on_two_cores("gauss-seidel 1.5, Coulomb", "coulomb", 1.5, own),
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


def _on_two_cores(name: str, sliding: Sliding, relaxation: float, version: str) -> list[Solver]:
    """Gauss-Seidel with two threads, where there are two cores."""
    if cores() < 2:
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


def _own(task: Task, limit: float, solve: Callable[[SolverOptions], SolverResult], **more: Any) -> Sample:
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

    return _own(task, limit, with_options)


def _gauss_seidel(relaxation: float, threads: int = 1) -> Callable[[Task, float], Sample]:
    def solve(task: Task, limit: float) -> Sample:
        def with_options(options: SolverOptions) -> SolverResult:
            return solve_gauss_seidel(task.problem, options, sliding=task.sliding, start=task.start)

        return _own(task, limit, with_options, relaxation=relaxation, threads=threads, max_iterations=UNBOUNDED)

    return solve


def _coulomb(task: Task, limit: float) -> Sample:
    return _own(task, limit, lambda options: CoulombInteriorPoint(options).solve(task.problem))


def _quadratic(name: str) -> Callable[[Task, float], Sample]:
    """A solver of quadratic programs, with its own tolerance lowered until the target is met."""
    needed: dict[tuple[Path, float], float] = {}

    def solve(task: Task, limit: float) -> Sample:
        if package_version(name)[0] is None:
            raise EngineNotInstalledError(f"{name} is not installed: pip install {name}")
        command = [sys.executable, "-P", "-s", "-m", "ninedisk.harness.bench.qp_worker"]

        def ask(own: float, left: float) -> dict[str, Any]:
            request = {"solver": name, "problem": str(task.file), "tolerance": own, "time_limit": left}
            return _ask(command, request, left, None)

        return _tightened(task, needed, ask, limit)

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
            return _ask(system_python(str(DRIVER)), request, 2.0 * left, clean_environment())

        return _tightened(task, self._needed, ask, limit)


def _tightened(
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
        if best and not _closer(facts, best):
            break
        best, own, left = facts, own * TIGHTER, left - facts["seconds"]
    raise NotReachedError(
        f"natural-map residual {best['natural_map']:.3g} and duality gap {best['duality_gap']:.3g} with its own tolerance "
        f"{best['own_tolerance']:g} after {best['iterations']} iterations and {best['seconds']:.3g} s (it says: {best['word']})",
        best,
    )


def _closer(one: dict[str, Any], other: dict[str, Any]) -> bool:
    return bool(max(one["natural_map"], one["duality_gap"]) < max(other["natural_map"], other["duality_gap"]))


def _ask(
    command: Sequence[str], request: dict[str, Any], limit: float, environment: dict[str, str] | None
) -> dict[str, Any]:
    with tempfile.TemporaryDirectory(prefix="ninedisk-bench-", ignore_cleanup_errors=True) as folder:
        answer = Path(folder) / "answer.npz"
        text = json.dumps({**request, "answer": str(answer)})
        done = run_isolated(command, stdin=text, time_limit=limit + START_UP, cwd=folder, env=environment)
        try:
            with np.load(answer) as data:
                found: dict[str, Any] = {key: data[key] for key in data.files}
        except (OSError, ValueError) as error:
            raise EngineError(f"no readable answer ({error}): {done.last_lines() or 'it printed nothing'}") from error
    if "error" in found:
        raise EngineError(f"it gave up: {found['error']}")
    return found


@cache
def warm_up() -> None:
    """Compile or load the kernels of all in-house solvers, so that no measurement pays for it."""
    from ninedisk.harness.bench.cd_problems import lattice, resting

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
    load, room = motion * problem.force.ravel()[free], rays.T @ offset.ravel()
    n = len(free)
    soft = rays.T @ sp.diags_array(problem.compliance.ravel()) @ rays
    size = max(float(np.linalg.norm(load)), float(np.linalg.norm(np.minimum(room, 0.0))), 1e-300)
    return Program(
        problem=problem,
        quadratic=sp.csc_matrix(sp.block_diag([sp.eye_array(n), soft])),
        equality=sp.csc_matrix(sp.hstack([sp.eye_array(n), -pull])),
        linear=np.append(np.zeros(n), room) / size,
        right=load / size,
        n=n,
        _free=free,
        _motion=motion,
        _rays=rays,
        _size=size,
    )
