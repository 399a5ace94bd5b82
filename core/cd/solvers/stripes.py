"""Contacts in an order that several threads can sweep with the same result, and the sweeps over them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core import threads as sync
from ninedisk.core._crew import together
from ninedisk.core.cd.problem import ContactProblem
from ninedisk.core.cd.solvers import stripe_kernels as kernels
from ninedisk.core.cd.solvers.gauss_seidel_kernels import sweep_stripes

FloatArray = NDArray[np.float64]

MOST_STRIPES = 64
"""Stripes, half of which are swept at the same time: enough to share them out evenly, and each of many contacts."""


class Stripes:
    """The contacts of a problem in stripes; their order depends on the problem alone.

    Parameters
    ----------
    problem : ContactProblem
    r : ndarray, shape (c, 2)
        Contact forces to begin with.
    threads : int

    Attributes
    ----------
    order : ndarray of int32, shape (c,)
        The problem's contacts by stripes.
    pairs : ndarray of int32, shape (c, 2)
        Their bodies, renumbered so that contacts close in order have bodies close in memory; -1 for one that does not move.
    bounds : ndarray of int32, shape (s + 1,)
        Places in ``order`` of the first contacts of the stripes.
    """

    def __init__(self, problem: ContactProblem, r: FloatArray, threads: int) -> None:
        b, c = problem.n_bodies, problem.n_contacts
        moving, contacts = np.empty((c, 2), dtype=np.int32), np.empty(2 * c, dtype=np.int32)
        first, bounds = np.empty(b + 1, dtype=np.int32), np.empty(MOST_STRIPES + 1, dtype=np.int32)
        place, self._queue, level = (np.empty(b, dtype=np.int32) for _ in range(3))
        self.order = np.empty(c, dtype=np.int32)
        kernels.moving_bodies(problem.bodies, problem.inverse_mass, moving)
        kernels.list_contacts(moving, first, contacts)
        kernels.number_bodies(moving, first, contacts, place, self._queue, level)
        kernels.own_contacts(moving, place, first, contacts)
        count = kernels.cut_stripes(first, contacts, level, self.order, bounds)
        self.bounds = bounds[: count + 1]
        self.pairs, self._rows = np.empty((c, 2), dtype=np.int32), np.empty((c, kernels.ROW))
        kernels.pack_rows(
            self.order,
            place,
            moving,
            problem.normal,
            problem.arms,
            problem.offset,
            problem.compliance,
            problem.shear_0,
            problem.mu,
            problem.blocks,
            r,
            self.pairs,
            self._rows,
        )
        self._inverse_mass, self._v = np.empty((b, 3)), np.empty((b, 3))
        kernels.gather_bodies(self._queue, problem.inverse_mass, self._inverse_mass)
        self._crew = min(threads, count)
        self._flags = np.zeros(self._crew * sync.PAD, dtype=np.int64)

    def sweep(self, count: int, relaxation: float, coulomb: bool, v: FloatArray, r: FloatArray) -> None:
        """``count`` sweeps from the velocities ``v``, shape (b, 3), of the forces that it left; these into ``r``, shape (c, 2)."""
        kernels.gather_bodies(self._queue, v, self._v)
        shared = (self._flags, self.bounds, self.pairs, self._inverse_mass, relaxation, coulomb, count)
        together(sweep_stripes, self._crew, (*shared, self._v, self._rows))
        kernels.unpack_forces(self.order, self._rows, r)
