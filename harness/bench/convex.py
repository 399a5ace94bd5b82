"""The convex program of a contact problem for general solvers of quadratic programs.

In the unknowns velocities and ray forces, ``r = G a`` with ``a >= 0``, every one in units of sqrt(energy)::

    min 1/2 v' M v + 1/2 r' C r + (g - C (0, q0))' r    subject to    M v - H' r = f,  a >= 0

whose value at ``M v = f + H' r`` is the objective ``D(r) = 1/2 r' W r + b' r`` and a constant, but which is sparse and never
forms W.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ninedisk.core.cd.problem import ContactProblem

FloatArray = NDArray[np.float64]


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
