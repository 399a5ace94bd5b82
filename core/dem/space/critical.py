"""Critical time step of spheres in contact: the scheme's limit on all present contacts together.

The limit is that of the plane (`ninedisk.core.dem.critical`): 1/dt is the largest eigenvalue of ``[[C', B/2], [B'/2, 0]]``, with
``K = B B'`` and C' half the dashpots over the masses where these see ``v_{n-1/2}``, and all of them where they see the extrapolated
``v_n``. Each contact that carries load has its present tangent stiffness, sticks, and rolls on its springs.

Few runs come near the limit, so a bound is looked at first (`ninedisk.core.dem.space.neighbour_kernels.stiffest`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ninedisk.core.array_types import FloatArray, IntArray

MOST, BATCH, TOLERANCE = 400, 10, 1e-4
"""Vectors of Lanczos' method at most, how many are found between two looks at the residual, and the relative residual that is enough; the
step errs to the safe side by it."""


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
    drag : float
        Half of the global damping [1/s], part of C' where that is lagged.
    """

    bodies: IntArray
    normal: FloatArray
    springs: FloatArray
    dashpots: FloatArray
    mobility: FloatArray
    turn: FloatArray
    radius: FloatArray
    drag: float = 0.0


def critical_time_step(network: Network) -> float:
    """Largest stable contact step [s] by Lanczos' method; without contacts of what can move that of global damping alone."""
    if not len(network.bodies):
        return 1.0 / network.drag if network.drag > 0.0 else float("inf")
    directions = _directions(network)
    at = (6 * network.bodies[:, :, None] + np.arange(6)).ravel()
    springs, dashpots = (
        np.repeat(values, (1, 2, 2, 1), axis=1) for values in (0.5 * np.sqrt(network.springs), network.dashpots)
    )
    root = np.sqrt(np.column_stack([network.mobility, np.repeat(network.turn[:, None], 3, axis=1)]))
    root = np.vstack([root, np.zeros(6)]).ravel()  # planes are one body more, which nothing moves
    size, drag = len(root), network.drag * (root > 0.0)

    def apply(vector: FloatArray) -> FloatArray:
        moved = np.einsum("crbk,cbk->cr", directions, (root * vector[:size])[at].reshape(-1, 2, 6))
        pulled = springs * vector[size:].reshape(-1, 6) + dashpots * moved
        back = np.bincount(at, np.einsum("crbk,cr->cbk", directions, pulled).ravel(), size)
        return np.concatenate([root * back + drag * vector[:size], (springs * moved).ravel()])

    # A fixed irregular start: the same on every call, and no mode is orthogonal to it by symmetry.
    vector = np.cos(np.arange(1.0, size + springs.size + 1.0) ** 2)
    vector[:size] *= root > 0.0
    vector /= np.linalg.norm(vector)
    before, diagonal, beside = np.zeros_like(vector), np.zeros(MOST), np.zeros(MOST + 1)
    for k in range(MOST):
        image = apply(vector)
        diagonal[k] = vector @ image
        image -= diagonal[k] * vector + beside[k] * before
        beside[k + 1] = np.linalg.norm(image)
        exhausted = beside[k + 1] <= 1e-14 * np.abs(diagonal[: k + 1]).max(initial=beside[: k + 2].max())
        if exhausted or (k + 1) % BATCH == 0:
            inner = beside[1 : k + 1]
            values, vectors = np.linalg.eigh(np.diag(diagonal[: k + 1]) + np.diag(inner, 1) + np.diag(inner, -1))
            residual = 0.0 if exhausted else float(beside[k + 1] * abs(vectors[-1, -1]))
            if residual <= TOLERANCE * values[-1]:
                break
        before, vector = vector, image / beside[k + 1]
    largest = float(values[-1]) + residual
    return 1.0 / largest if largest > 0.0 else float("inf")  # nothing that can move is in contact


def _directions(network: Network) -> FloatArray:
    """Six rows for each contact (normal, two across, two of rolling, twisting) in velocity and spin of either body, shape (c, 6, 2, 6)."""
    normal, arm = network.normal, np.append(network.radius, 0.0)[network.bodies]
    helper = np.eye(3)[np.argmin(np.abs(normal), axis=1)]
    first = np.cross(normal, helper)
    first /= np.linalg.norm(first, axis=1)[:, None]
    found = np.zeros((len(normal), 6, 2, 6))
    for body, side in ((0, 1.0), (1, -1.0)):
        found[:, 0, body, :3] = side * normal
        for k, tangent in enumerate((first, np.cross(normal, first))):
            found[:, 1 + k, body, :3] = side * tangent
            found[:, 1 + k, body, 3:] = arm[:, body, None] * np.cross(normal, tangent)
            found[:, 3 + k, body, 3:] = side * tangent
        found[:, 5, body, 3:] = side * normal
    return found
