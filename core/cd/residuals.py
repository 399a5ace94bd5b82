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

ROUND_OFF = 16.0
"""Multiple of the estimated evaluation error below which a figure says nothing."""

UNRESOLVED = 1e-3
"""Where the offsets' resolution alone makes up more than this fraction of the forces, the forces are round-off of the scene."""


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
    sums = np.empty(12)
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
    kinetic = np.empty(2)
    sums_of.sum_kinetic(problem.inverse_mass, v, problem.body_velocity(r), kinetic)
    unbalance = float(kinetic[0])
    energy = 0.5 * (abs(sums[sums_of.ENERGY_W]) + abs(sums[sums_of.ENERGY_B]))
    force = max(np.sqrt(sums[sums_of.FORCE]), np.sqrt(sums[sums_of.FREE_MAP]))
    largest = sums[sums_of.LARGEST]
    gap = abs(sums[sums_of.GAP]) + largest * sums[sums_of.VIOLATION] + 0.5 * unbalance
    # A velocity of size |v| in the kinetic norm is known to eps |v| at best, whatever the contacts do.
    noise_v = (sums_of.EPSILON**2) * float(kinetic[1])
    noise = sums[sums_of.NOISE_WORK] + largest * sums[sums_of.NOISE] + 0.5 * noise_v
    floor_map = ROUND_OFF * np.sqrt(sums[sums_of.NOISE_MAP])
    floor_gap = ROUND_OFF * noise
    unsure = problem.resolution * problem.rho_norm
    if unsure > UNRESOLVED * force:
        floor_map += unsure
        floor_gap += problem.resolution * (float(np.abs(r).sum()) + largest * problem.n_contacts)
    return Residuals(
        natural_map=_ratio(np.sqrt(sums[sums_of.MAP]), force),
        complementarity=_ratio(sums[sums_of.WORK], energy),
        duality_gap=_ratio(gap, energy),
        stationarity=_ratio(np.sqrt(unbalance), np.sqrt(energy)),
        floor_map=_ratio(floor_map, force),
        floor_gap=_ratio(floor_gap, energy),
    )


def _ratio(value: float, scale: float) -> float:
    if value == 0.0:
        return 0.0
    return float(value / scale) if scale > 0.0 else float("inf")
