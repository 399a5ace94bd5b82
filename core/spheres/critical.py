"""Critical time step of spheres in contact: the scheme's limit on all present contacts together.

The limit is that of the plane (`ninedisk.core.dem.critical`): 1/dt is the largest eigenvalue of ``[[C', B/2], [B'/2, 0]]``, with
``K = B B'`` and C' half the dashpots over the masses where these see ``v_{n-1/2}``, and all of them where they see the extrapolated
``v_n``. Each contact that carries load has its present tangent stiffness, sticks, and rolls on its springs.

Few runs come near the limit, so a bound is looked at first (`ninedisk.core.spheres.neighbour_kernels.stiffest`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ninedisk.core.array_types import FloatArray, IntArray

TOLERANCE = 1e-4
"""Relative residual of the eigenvalue that is enough; the step errs to the safe side by it."""

DENSE = 200
"""Rows of a matrix up to which all eigenvalues are found."""


class Network(NamedTuple):
    """Loaded contacts c of n spheres.

    Attributes
    ----------
    bodies : ndarray of int, shape (c, 2)
        Spheres of each contact; the second is n for a plane.
    normal : ndarray, shape (c, 3)
        Unit normals from the first to the second body.
    springs, dashpots : ndarray, shape (c, 4)
        Stiffnesses along the normal and across it [N/m], of rolling and of twisting [N m/rad]; dashpots likewise [N s/m, N m s],
        as they are in C': half of those that see the velocities of the last half step.
    mobility : ndarray, shape (n, 3)
        1/m [1/kg] of the components of the velocity; 0 where held.
    turn : ndarray, shape (n,)
        1/I [1/(kg m^2)]; 0 where the spin is held.
    radius : ndarray, shape (n,)
        [m].
    """

    bodies: IntArray
    normal: FloatArray
    springs: FloatArray
    dashpots: FloatArray
    mobility: FloatArray
    turn: FloatArray
    radius: FloatArray


def critical_time_step(network: Network) -> float:
    """Largest stable contact step [s], found to `TOLERANCE`; ``inf`` without contacts."""
    if not len(network.bodies):
        return float("inf")
    import scipy.sparse as sp
    import scipy.sparse.linalg as linalg

    n = len(network.radius)
    root = np.sqrt(np.column_stack([network.mobility, np.repeat(network.turn[:, None], 3, axis=1)]))
    springs, dashpots = (
        _rows(network, np.sqrt(values)) @ sp.diags(root.ravel()) for values in (network.springs, network.dashpots)
    )
    springs = springs[np.diff(springs.indptr) > 0]
    matrix = sp.csr_array(sp.bmat([[dashpots.T @ dashpots, 0.5 * springs.T], [0.5 * springs, None]]))
    if matrix.shape[0] <= DENSE:
        return 1.0 / float(np.linalg.eigvalsh(matrix.toarray())[-1])
    # A fixed irregular start: the same on every call, and no mode is orthogonal to it by symmetry.
    start = np.cos(np.arange(1.0, matrix.shape[0] + 1.0) ** 2)
    start[: 6 * n] *= root.ravel() > 0.0
    largest = linalg.eigsh(matrix, k=1, which="LA", v0=start, tol=TOLERANCE, return_eigenvectors=False)
    return 1.0 / (float(largest[0]) * (1.0 + TOLERANCE))


def _rows(network: Network, strength: FloatArray):  # type: ignore[no-untyped-def]
    """Six rows for each contact (normal, two across, two of rolling, twisting), in velocities and spins, times ``strength``."""
    import scipy.sparse as sp

    n, (c, _) = len(network.radius), network.bodies.shape
    normal, arm = network.normal, np.append(network.radius, 0.0)[network.bodies]
    helper = np.eye(3)[np.argmin(np.abs(normal), axis=1)]
    first = np.cross(normal, helper)
    first /= np.linalg.norm(first, axis=1)[:, None]
    tangents = first, np.cross(normal, first)
    entries = np.zeros((c, 6, 2, 6))
    for body, side in ((0, 1.0), (1, -1.0)):
        entries[:, 0, body, :3] = side * normal
        for k, tangent in enumerate(tangents):
            entries[:, 1 + k, body, :3] = side * tangent
            entries[:, 1 + k, body, 3:] = arm[:, body, None] * np.cross(normal, tangent)
            entries[:, 3 + k, body, 3:] = side * tangent
        entries[:, 5, body, 3:] = side * normal
    entries *= strength[:, [0, 1, 1, 2, 2, 3], None, None]
    columns = 6 * network.bodies[:, None, :, None] + np.arange(6)
    rows = np.broadcast_to(np.arange(6 * c).reshape(c, 6, 1, 1), entries.shape)
    used = (entries != 0.0) & (columns < 6 * n)
    return sp.csr_matrix((entries[used], (rows[used], np.broadcast_to(columns, entries.shape)[used])), (6 * c, 6 * n))
