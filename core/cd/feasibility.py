"""Proof that contacts contradict each other, read from forces that grow without bound."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd.problem import ContactProblem
from ninedisk.core.errors import InvalidSceneError

FloatArray = NDArray[np.float64]

RESISTANCE = 1e-9
"""Largest relative velocity ``rho W r / r`` that still counts as none: real contact graphs resist with 1e-6 and more."""
WORK = 1e-7
"""Smallest relative work ``-g . r / |g| |r|`` of the obstacles that counts as a contradiction."""


class InfeasibleContactsError(InvalidSceneError):
    """No motion satisfies all rigid contacts, e.g. a rigid disk between two walls that close in on it.

    Attributes
    ----------
    contacts : tuple of int
        Contacts that take part in the contradiction, the most loaded one first.
    """

    def __init__(self, message: str, contacts: tuple[int, ...]) -> None:
        super().__init__(message)
        self.contacts = contacts


def check_feasible(problem: ContactProblem, r: FloatArray) -> None:
    """Raise `InfeasibleContactsError` if ``r`` proves that the contacts contradict each other.

    By Farkas' lemma the constraints ``H v + g`` in the dual cones have no solution if and only if some forces r inside
    the cones balance (``H' r = 0``, and ``C r = 0``) while ``g . r < 0``. A solver that runs into such a problem drives r
    along such a direction, so its last iterate is tested.
    """
    size = float(np.sqrt((r * r).sum()))
    if not (np.isfinite(size) and size > 0.0):
        return
    d = r / size
    dv = problem.body_velocity(d) - problem.body_velocity(np.zeros_like(d))
    no_force = np.zeros_like(d)
    response = problem.contact_velocity(dv, d) - problem.contact_velocity(np.zeros_like(dv), no_force)
    resistance = float(np.sqrt(((problem.rho[:, None] * response) ** 2).sum()))
    loaded = np.hypot(d[:, 0], d[:, 1]) > 1e-6
    work, scale = float((problem.b * d).sum()), float(np.sqrt((problem.b[loaded] ** 2).sum()))
    if resistance > RESISTANCE or work > -WORK * scale:
        return
    order = np.argsort(-np.hypot(d[:, 0], d[:, 1]))
    contacts = tuple(int(k) for k in order[: min(8, int(loaded.sum()))])
    pairs = ", ".join(f"{k} {tuple(int(i) for i in problem.bodies[k])}" for k in contacts)
    raise InfeasibleContactsError(
        f"no motion satisfies the rigid contacts: {int(loaded.sum())} of them squeeze their bodies against each other "
        f"(contact and bodies, -1 being prescribed: {pairs}). Give the contacts compliance, or let the obstacles leave room",
        contacts,
    )
