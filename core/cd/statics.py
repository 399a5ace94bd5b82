"""Equilibrium under prescribed motions: the static limit of a step."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd.contacts import Frames
from ninedisk.core.cd.laws import LawTable
from ninedisk.core.cd.problem import ContactProblem
from ninedisk.core.cd.solvers.solver import ContactSolver
from ninedisk.core.cd.step import Bodies, Solved, compliances, pair_bodies, relative
from ninedisk.core.errors import NoEquilibriumError, SolverNotConvergedError

FloatArray = NDArray[np.float64]

WEIGHT = 1e-3
"""Proximal stiffness over contact stiffness: small, so that a few iterations reach the limit, and large enough that displacements
follow from forces without loss of digits."""
BALANCE = 1e-10
"""Largest unbalanced force of an equilibrium, relative to the largest force: what the residual of the solver, 1e-12, leaves."""
MAX_ITERATIONS = 400


class StaticStep:
    """Series step without inertia: ``0 = f + H' r`` under the prescribed displacements.

    The mass matrix is dropped (``theta dt`` to infinity in the theta scheme). What remains can be singular: disks that no
    contact holds, modes without energy. It is solved by the proximal-point method: a small stiffness ``s M`` ties every disk to
    the last iterate, beginning with no displacement,

        s M (dx_k+1 - dx_k) = f + H' r_k+1,

    which tends to an equilibrium if there is one, and leaves the part of ``dx`` on which neither load nor contacts do work at
    zero: the displacement of least norm. Under a load that no contact forces balance, ``dx`` grows without bound.

    Parameters
    ----------
    bodies : Bodies
    laws : LawTable
    solver : ContactSolver
    prescribed : ndarray, shape (b, 3)
        Displacements of the unknowns that are not free [m], [m], [rad]; 0 elsewhere.
    radius : ndarray, shape (b,)
        Radii [m].
    length : float
        Displacement [m] that the walls prescribe, 0 if none.
    round_off : float
        Rounding error of a gap [m].

    Notes
    -----
    R. T. Rockafellar, "Monotone operators and the proximal point algorithm", SIAM J. Control Optim. 14 (1976) 877-898.
    """

    def __init__(
        self,
        bodies: Bodies,
        laws: LawTable,
        solver: ContactSolver,
        prescribed: FloatArray,
        radius: FloatArray,
        length: float,
        round_off: float,
    ) -> None:
        self._bodies, self._laws, self._solver = bodies, laws, solver
        self._prescribed, self._radius, self._round_off = prescribed, radius, round_off
        self._length = max(length, float(np.abs(prescribed[:, :2]).max())) or 1e-3 * float(radius.min())

    def guess(self) -> FloatArray:
        """Displacements that are prescribed; no disk moves by itself."""
        return self._prescribed

    def problem(self, frames: Frames, forces: FloatArray, mass: FloatArray, near: FloatArray) -> ContactProblem:
        """Proximal problem around the displacements ``near``, in displacements [m] and forces [N]."""
        free = self._bodies.free
        return ContactProblem(
            mass=np.where(free, mass, np.inf),
            force=np.where(free, self._bodies.load + mass * near, 0.0),
            bodies=pair_bodies(frames, len(mass)),
            normal=frames.normal,
            arms=frames.arms,
            offset=np.column_stack([frames.gap, frames.shift]) + relative(frames, self._prescribed),
            mu=self._laws.mu[frames.row],
            compliance=compliances(frames, self._laws),
            shear_0=forces[:, 1],
            resolution=self._round_off,
        )

    def solve(self, frames: Frames, forces: FloatArray, start: FloatArray) -> Solved:
        """Find the equilibrium.

        Raises
        ------
        NoEquilibriumError
            If the load drives a mechanism or exceeds what the contacts can bear, naming the disks that move.
        SolverNotConvergedError, InfeasibleContactsError
            As `ContactSolver.solve` does.
        """
        mass, elastic = self._proximal_mass(frames)
        arm = np.column_stack([np.ones((len(mass), 2)), 1.0 / self._radius])
        dx = np.zeros_like(mass)
        for _ in range(MAX_ITERATIONS):
            result = self._solver.solve(self.problem(frames, forces, mass, dx), start)
            unbalanced = np.where(self._bodies.free, mass * (result.v - dx), 0.0) * arm
            dx, start = result.v, result.r
            largest = max(float(np.abs(self._bodies.load * arm).max()), float(np.abs(start).max(initial=0.0)))
            if float(np.abs(unbalanced).max()) <= BALANCE * largest:
                total = dx + self._prescribed
                return Solved(total, np.zeros_like(total), result.r, result)
            way = np.hypot(dx[:, 0], dx[:, 1]) + np.abs(dx[:, 2]) * self._radius
            if (way > self._radius).any():
                raise NoEquilibriumError(_runaway(way, unbalanced, largest))
            if not elastic:
                mass = 0.5 * mass
        raise SolverNotConvergedError(
            f"the static step is not in balance after {MAX_ITERATIONS} iterations: unbalanced force "
            f"{float(np.abs(unbalanced).max()):.3g} N, largest force {largest:.3g} N; the contacts are close to their limit: "
            "reduce the load or the prescribed displacement, or give the contacts more friction",
            iterations=MAX_ITERATIONS,
        )

    def _proximal_mass(self, frames: Frames) -> tuple[FloatArray, bool]:
        mass = self._bodies.mass
        stiff = np.where(self._laws.elastic[frames.row], self._laws.kn[frames.row], 0.0)
        if (stiff > 0.0).any():
            return mass * (WEIGHT * float(stiff.max()) / float(mass[:, 0].max())), True
        force = float(np.abs(self._bodies.load[:, :2]).max()) or 1.0
        return mass * (force / self._length / float(mass[:, 0].max())), False


def _runaway(way: FloatArray, unbalanced: FloatArray, largest: float) -> str:
    order = np.argsort(-way)
    moving = [int(i) for i in order if way[i] > 0.5 * way[order[0]]]
    names = ", ".join(str(i) for i in moving[:8]) + (f" and {len(moving) - 8} more" if len(moving) > 8 else "")
    force = float(np.abs(unbalanced).max())
    return (
        f"there is no equilibrium near: the load moves disk(s) {names} by more than a radius and {force:.3g} N of at most "
        f"{largest:.3g} N stay unbalanced. Either a mechanism is free to follow the load, or friction and walls cannot bear it: "
        "hold or support these disks, reduce the load, or run with inertia (regime = dynamic)"
    )


def zero_energy_modes(problem: ContactProblem, r: FloatArray) -> int:
    """Number of independent displacements that strain no active contact: rattlers, gears, mechanisms without load.

    Parameters
    ----------
    problem : ContactProblem
    r : ndarray, shape (c, 2)
        Contact forces; a contact with ``p > 0`` holds its normal, one below the friction limit also its tangent.

    Returns
    -------
    int
        Rank deficiency of the active rows of the Jacobian on the free unknowns; a dense decomposition.
    """
    p, q = r[:, 0], np.abs(r[:, 1])
    bears = p > 1e-9 * float(p.max(initial=0.0))
    sticks = bears & (problem.mu > 0.0) & (q < problem.mu * p * (1.0 - 1e-9))
    rows = problem.jacobian().toarray()[np.column_stack([bears, sticks]).ravel()]
    free = problem.free.ravel() > 0.0
    if not len(rows):
        return int(free.sum())
    return int(free.sum()) - int(np.linalg.matrix_rank(rows[:, free]))
