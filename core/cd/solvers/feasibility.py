"""Proof that contacts contradict each other, by Farkas' lemma from a linear program."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.core.cd.problem import ContactProblem, Sliding
from ninedisk.core.errors import InvalidSceneError

RESISTANCE = 1e-9
"""Largest relative velocity ``rho W r / r`` that still counts as none: real contact graphs resist with 1e-6 and more."""
WORK = 1e-7
"""Smallest work ``-g . r / |r|`` of the obstacles that counts as a contradiction, relative to g and b."""
PROOF_AFTER = 5_000
"""Sweeps after which Gauss-Seidel looks for a contradiction, once: fewer cost less than the proof."""
LONGEST_PROOF = 60.0
"""Seconds after which the search ends without a verdict."""


class InfeasibleContactsError(InvalidSceneError):
    """No motion satisfies all rigid contacts, e.g. a rigid disk between two walls that close in on it.

    Attributes
    ----------
    contacts : tuple of int
        Contacts that take part in the contradiction, the most loaded one first.
    """

    def __init__(
        self, message: str, contacts: tuple[int, ...] = ()
    ) -> None:  # a copy in another process is made without
        super().__init__(message)
        self.contacts = contacts


def check_feasible(problem: ContactProblem, *, sliding: Sliding = "associated", seconds: float = LONGEST_PROOF) -> None:
    """Raise `InfeasibleContactsError` if the contacts contradict each other; nothing is said if time runs out.

    Parameters
    ----------
    problem : ContactProblem
    sliding : {"associated", "coulomb"}
        The associated rule asks for ``u_n >= mu |u_t|``, Coulomb's law for ``u_n >= 0`` only.
    seconds : float
        Time for the linear program [s]; never more than `LONGEST_PROOF`.

    Notes
    -----
    By Farkas' lemma the constraints ``u = H v + g`` in the dual cones have no solution if and only if some forces r inside
    the cones balance (``H' r = 0``, and ``C r = 0``) while ``g . r < 0``. Such forces are the multipliers of the linear
    program that asks for the smallest common violation t of all constraints. They are tested before they count, so that
    an inaccurate linear program accuses nobody.
    """
    slope = np.where(problem.compliance[:, 1] > 0.0, 0.0, problem.mu)
    if sliding == "coulomb":
        slope = np.zeros_like(slope)
    rigid = np.flatnonzero(problem.compliance[:, 0] == 0.0)
    g = problem.offset[rigid]
    if (g[:, 0] >= slope[rigid] * np.abs(g[:, 1])).all():
        return
    r = _violation_forces(problem, slope, rigid, min(seconds, LONGEST_PROOF))
    size = float(np.sqrt((r * r).sum()))
    if size == 0.0:
        return
    d = r / size
    # Balance of the bodies is all that resistance means here: the forces chosen meet no compliance.
    dv = problem.body_velocity(d) - problem.body_velocity(np.zeros_like(d))
    still = np.zeros_like(dv)
    response = problem.contact_velocity(dv, d) - problem.contact_velocity(still, np.zeros_like(d))
    resistance = float(np.sqrt(((problem.rho[:, None] * response) ** 2).sum()))
    loaded = np.hypot(d[:, 0], d[:, 1]) > 1e-6
    # A squeeze by less than the rounding of the gaps, or of the velocities in play, is none.
    scale = max(float(np.sqrt((w[loaded] ** 2).sum())) for w in (problem.offset, problem.b))
    needed = WORK * scale + problem.resolution * float(np.abs(d).sum())
    if resistance > RESISTANCE or float((problem.offset * d).sum()) > -needed:
        return
    order = np.argsort(-np.hypot(d[:, 0], d[:, 1]), kind="stable")
    contacts = tuple(int(k) for k in order[: min(8, int(loaded.sum()))])
    pairs = ", ".join(f"{k} {tuple(int(i) for i in problem.bodies[k])}" for k in contacts)
    raise InfeasibleContactsError(
        f"no motion satisfies the rigid contacts: {int(loaded.sum())} of them squeeze their bodies against each other "
        f"(contact and bodies, -1 being prescribed: {pairs}). Give the contacts compliance, or let the obstacles leave room",
        contacts,
    )


def _violation_forces(
    problem: ContactProblem, slope: FloatArray, rigid: NDArray[np.intp], seconds: float
) -> FloatArray:
    """Multipliers, shape (c, 2), of ``min t >= 0`` under ``u_n +- slope u_t >= -t`` for the rigid contacts; 0 if t = 0."""
    from scipy.optimize import linprog

    rough = rigid[slope[rigid] > 0.0]
    k = np.concatenate([rigid, rough])
    along = np.concatenate([slope[rigid], -slope[rough]])
    rows = np.arange(len(k))
    rays = sp.csr_array(
        (np.concatenate([np.ones(len(k)), along]), (np.tile(rows, 2), np.concatenate([2 * k, 2 * k + 1]))),
        shape=(len(k), 2 * problem.n_contacts),
    )
    # In units of sqrt(energy) all contacts and bodies compare.
    weight = np.sqrt(problem.rho[k])
    motion = sp.diags_array(np.sqrt(problem.inverse_mass.ravel()))
    constraint = sp.csr_array(sp.diags_array(weight) @ rays @ problem.jacobian() @ motion)
    room = weight * (rays @ problem.offset.ravel())
    n = constraint.shape[1]
    # The stubs deny that the matrix may be sparse; SciPy's manual says so.
    found = linprog(  # type: ignore[call-overload]
        np.append(np.zeros(n), 1.0),
        A_ub=sp.hstack([-constraint, sp.csr_array(-np.ones((len(k), 1)))]),
        b_ub=room / np.abs(room).max(),
        bounds=[(None, None)] * n + [(0.0, None)],
        method="highs",
        options={"time_limit": seconds, "primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
    )
    if found.status != 0 or found.fun <= 0.0:
        return np.zeros((problem.n_contacts, 2))
    forces = rays.T @ (weight * np.maximum(0.0, -np.asarray(found.ineqlin.marginals)))
    return np.asarray(forces, dtype=np.float64).reshape(-1, 2)
