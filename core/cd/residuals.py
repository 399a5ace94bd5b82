"""How far velocities and contact forces are from a solution: figures without units, one definition for all solvers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd import residual_kernels as sums_of
from ninedisk.core.cd.problem import ContactProblem

FloatArray = NDArray[np.float64]
Sliding = Literal["associated", "coulomb"]


@dataclass(frozen=True)
class Residuals:
    """Figures of merit of a pair ``(v, r)``; all are relative and independent of the units.

    Let ``u = H v + g + C (r - (0, q0))`` (for Coulomb with ``mu |u_t|`` added to ``u_n``), ``rho_k`` the inverse of the
    largest diagonal entry of contact k's Delassus block, P the projection on the friction cones and
    ``E = (|r' W r| + |b' r|) / 2``, which equals ``r' W r`` at the solution: twice the optimum's absolute value.

    Attributes
    ----------
    natural_map : float
        ``|r - P(r - rho u)| / max(|r|, |P(-rho b)|)`` in the Euclidean norm over all contacts.
    complementarity : float
        ``sum_k |r_k . u_k| / E``.
    duality_gap : float
        ``(|r . u| + p_max sum_k max(0, mu |u_t| - u_n) + 1/2 |M v - f - H' r|^2_{M^-1}) / E``. For the convex program
        this bounds the relative error of the objective, provided that no normal force of the solution exceeds
        ``p_max``, the largest one found; u need not be feasible. For Coulomb it is the same figure of the
        program that holds ``mu |u_t|`` fixed.
    stationarity : float
        ``|M v - f - H' r|_{M^-1} / sqrt(E)``: error of the bodies' balance of momentum.
    floor_map, floor_gap : float
        Values of ``natural_map`` and ``duality_gap`` that the round-off error of evaluating u alone explains; where the offsets'
        resolution explains more than `UNRESOLVED` of a problem, that too.
    """

    natural_map: float
    complementarity: float
    duality_gap: float
    stationarity: float
    floor_map: float
    floor_gap: float

    def reached(self, tolerance: float) -> bool:
        """Whether natural map and duality gap are below ``tolerance`` or at the floor of round-off."""
        return self.natural_map <= max(tolerance, self.floor_map) and self.duality_gap <= max(tolerance, self.floor_gap)

    @property
    def worst(self) -> float:
        """The larger one of natural map and duality gap."""
        return max(self.natural_map, self.duality_gap)


def measure(problem: ContactProblem, v: FloatArray, r: FloatArray, *, sliding: Sliding = "associated") -> Residuals:
    """Residuals of the velocities ``v``, shape (b, 3), and contact forces ``r``, shape (c, 2), inside the cones."""
    sums, figures = np.empty(sums_of.SUMS), np.empty(6)
    sums_of.sum_residuals(
        problem.bodies,
        problem.normal,
        problem.arms,
        problem.offset,
        problem.compliance,
        problem.shear_0,
        problem.mu,
        problem.rho,
        problem.b,
        v,
        r,
        sliding == "coulomb",
        sums,
    )
    sums_of.sum_kinetic(problem.inverse_mass, v, problem.body_velocity(r), sums)
    sums_of.figures_of(sums, problem.n_contacts, problem.resolution, figures)
    return Residuals(*figures.tolist())
