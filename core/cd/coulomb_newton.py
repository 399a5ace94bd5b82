"""Proximal Newton method for Coulomb's law: long steps of ``dr/dt = -rho u``, each solved for what sticks, slips and is open.

Packings at rest have more forces than equations, and without dilation they have no energy that falls: Newton's method on the law
itself leaps between the ways in which contacts can slip. With a compliance that acts on the change of the forces only,
``u + e (r - r_0)/rho = 0`` instead of ``u = 0``, it settles after one to three changes of these states if e is large enough, and
the next step begins at the forces found. The solution does not know the compliance. Where the states settle, e falls.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd.problem import ContactProblem
from ninedisk.core.cd.start import starting_forces
from ninedisk.core.cd.unsymmetric_matrix import UnsymmetricMatrix, times

FloatArray = NDArray[np.float64]

OPEN, STICK, SLIP = 0, 1, 2
FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-3, 1e-12, 1e2
"""Compliance e of the change of the forces, over ``1/rho``."""
EASY, EASIER, HARDER = 2, 0.5, 4.0
"""Changes of states after which a step still counts as easy; factors of the damping after such a step and after a failure."""
CHANGES = 8
"""Changes of states that a step may take."""
EXACT = 0.3
"""Error of a step relative to the step that is small enough: the next one mends it."""


class ProximalNewton:
    """Improves contact forces step by step.

    Parameters
    ----------
    problem : ContactProblem
    r : ndarray, shape (c, 2)
        Contact forces to begin with, inside the cones.
    matrix : UnsymmetricMatrix
        Of the problem.

    Attributes
    ----------
    r : ndarray, shape (c, 2)
        Contact forces after the last step that succeeded, inside the cones.
    damping : float
    """

    def __init__(self, problem: ContactProblem, r: FloatArray, matrix: UnsymmetricMatrix) -> None:
        self.problem, self.r, self.damping = problem, r, FIRST_DAMPING
        self._matrix = matrix
        self._load = (problem.force * problem.free).ravel()

    def advance(self) -> int:
        """Try one step; number of factorisations, 0 if it can go on no longer. Forces stay as they are where it fails."""
        problem = self.problem
        elastic = self.damping / problem.rho[:, None]
        state, slope = self._states(self.r, self._velocity(self.r))
        last = np.inf
        for tries in range(1, CHANGES + 1):
            solved = self._solve(state, slope, elastic)
            if solved is None:
                break
            forces, u = solved
            r = starting_forces(problem, forces)
            change = float(np.linalg.norm(r - self.r))
            wrong = self._wrong(r, self._velocity(r) + elastic * (r - self.r))
            state, slope, before = *self._states(forces, u + elastic * (forces - self.r)), (state, slope)
            settled = np.array_equal(state, before[0]) and np.array_equal(slope, before[1])
            if settled or wrong < EXACT * self.damping * change:
                self.r = r
                if tries <= EASY:
                    self.damping = max(EASIER * self.damping, LEAST_DAMPING)
                return tries
            if tries > CHANGES // 2 and wrong > 2.0 * last:
                break
            last = min(last, wrong)
        self.damping *= HARDER
        return tries if self.damping <= MOST_DAMPING else 0

    def _velocity(self, r: FloatArray) -> FloatArray:
        return self.problem.contact_velocity(self.problem.body_velocity(r), r)

    def _states(self, r: FloatArray, u: FloatArray) -> tuple[NDArray[np.int64], FloatArray]:
        """What each contact does, by the forces that its velocities ask for, and the slope q/p where it slips."""
        mu, rho = self.problem.mu, self.problem.rho
        p, q = r[:, 0] - rho * u[:, 0], r[:, 1] - rho * u[:, 1]
        state = np.where(p <= 0.0, OPEN, np.where((np.abs(q) <= mu * p) & (mu > 0.0), STICK, SLIP))
        return state, np.where(state == SLIP, np.sign(q) * mu, 0.0)

    def _solve(
        self, state: NDArray[np.int64], slope: FloatArray, elastic: FloatArray
    ) -> tuple[FloatArray, FloatArray] | None:
        """Forces and contact velocities if every contact does what it is said to do; None if the matrix cannot be factorised.

        Forces are ``r = r_c - D H v``; with them the balance of momentum is ``(M + H' D H) v = f + H' r_c``.
        """
        problem = self.problem
        soft = problem.compliance + elastic
        still = elastic * self.r - problem.offset
        still[:, 1] += problem.compliance[:, 1] * problem.shear_0
        closed, stick = state != OPEN, state == STICK
        d = np.zeros((problem.n_contacts, 2, 2))
        d[:, 0, 0] = closed / soft[:, 0]
        d[:, 1, 0] = slope * d[:, 0, 0]
        d[:, 1, 1] = stick / soft[:, 1]
        if not self._matrix.factorise(d):
            return None
        constant = times(d, still)
        v = self._matrix.solve(self._load + self._matrix.h.T @ constant.ravel())
        forces = constant - times(d, (self._matrix.h @ v).reshape(-1, 2))
        return forces, problem.contact_velocity(v.reshape(-1, 3), forces)

    def _wrong(self, r: FloatArray, u: FloatArray) -> float:
        """Norm of the natural map of the damped problem."""
        problem = self.problem
        u = np.column_stack([u[:, 0] + problem.mu * np.abs(u[:, 1]), u[:, 1]])
        return float(np.linalg.norm(r - starting_forces(problem, r - problem.rho[:, None] * u)))
