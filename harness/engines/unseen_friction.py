"""Friction impulses of engines that report normal impulses alone: what the momentum of a step leaves for them, where that is unique."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ninedisk.core.history import Pair
from ninedisk.core.validate import FloatArray

MOST_BODIES = 40
"""Bodies that rough contacts join: more of them are left out, as their system grows with the square."""

ROUND_OFF = 1e-6
"""Relative size below which a singular value is none."""


@dataclass(frozen=True)
class Push:
    """Normal impulse of a pair in a step.

    Parameters
    ----------
    impulse : array
        On the first body [N s], shape (dimension,).
    place : array
        Mean place of the contact's points, weighted by their impulses [m].
    rough : bool
        Whether the pair has friction.
    """

    impulse: FloatArray
    place: FloatArray
    rough: bool


def tangent_basis(normal: FloatArray) -> FloatArray:
    """Unit vectors across a normal, shape (dimension - 1, dimension).

    Parameters
    ----------
    normal : array
        Unit vector, shape (2,) or (3,).

    Returns
    -------
    array

    Examples
    --------
    >>> tangent_basis(np.array([0.0, 1.0])).tolist()
    [[-1.0, 0.0]]
    """
    if len(normal) == 2:
        return np.array([[-normal[1], normal[0]]])
    one = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
    one /= np.linalg.norm(one)
    return np.array([one, np.cross(normal, one)])


def frictions(pushes: Mapping[Pair, Push], left: FloatArray, free: Sequence[bool], noise: float) -> dict[Pair, FloatArray]:
    """Friction impulse [N s] on the first body of each rough pair that pushes; NaN where momentum does not determine it.

    Parameters
    ----------
    pushes : mapping from pair to Push
        Pairs in contact.
    left : array
        Change of momentum of each body in the step less what gravity and loads gave it [N s], shape (n, dimension).
    free : sequence of bool
        Bodies whose momentum says something: those that are neither fixed nor driven.
    noise : float
        What round-off may leave of a balance [N s].

    Returns
    -------
    dict from pair to array
        Shape (dimension,).

    Examples
    --------
    A disk that slides on a floor, below it as body 1:

    >>> push = Push(np.array([0.0, 2.0]), np.zeros(2), rough=True)
    >>> frictions({(0, 1): push}, np.array([[-0.6, 2.0]]), [True], 1e-6)[0, 1].tolist()
    [-0.6, 0.0]
    """
    rest = np.array(left, dtype=np.float64)
    n = len(rest)
    for (i, j), push in pushes.items():
        rest[i] -= push.impulse
        if j < n:
            rest[j] += push.impulse
    rough = [pair for pair, push in sorted(pushes.items()) if push.rough and push.impulse.any()]
    found: dict[Pair, FloatArray] = {}
    for pairs in _joined(rough, free):
        found |= _solve(pairs, pushes, rest, free, noise)
    return found


def _joined(pairs: Iterable[Pair], free: Sequence[bool]) -> list[list[Pair]]:
    """Pairs in groups that share no free body."""
    groups: list[tuple[set[int], list[Pair]]] = []
    for pair in pairs:
        bodies = {k for k in pair if k < len(free) and free[k]}
        apart, members = [], [pair]
        for group in groups:
            if group[0] & bodies:
                bodies |= group[0]
                members += group[1]
            else:
                apart.append(group)
        groups = [*apart, (bodies, members)]
    return [sorted(members) for _, members in groups]


def _solve(
    pairs: Sequence[Pair], pushes: Mapping[Pair, Push], rest: FloatArray, free: Sequence[bool], noise: float
) -> dict[Pair, FloatArray]:
    size, n = rest.shape[1], len(rest)
    bodies = sorted({k for pair in pairs for k in pair if k < n and free[k]})
    if not bodies or len(bodies) > MOST_BODIES:
        return {pair: np.full(size, np.nan) for pair in pairs}
    row = {body: size * k for k, body in enumerate(bodies)}
    bases = [tangent_basis(pushes[pair].impulse / np.linalg.norm(pushes[pair].impulse)) for pair in pairs]
    matrix = np.zeros((size * len(bodies), (size - 1) * len(pairs)))
    for c, ((i, j), basis) in enumerate(zip(pairs, bases, strict=True)):
        columns = slice((size - 1) * c, (size - 1) * (c + 1))
        for body, sign in ((i, 1.0), (j, -1.0)):
            if body in row:
                matrix[row[body] : row[body] + size, columns] = sign * basis.T
    one, sizes, two = np.linalg.svd(matrix, full_matrices=True)
    rank = int((sizes > ROUND_OFF * sizes.max(initial=0.0)).sum())
    wanted = rest[bodies].ravel()
    solved = two[:rank].T @ ((one[:, :rank].T @ wanted) / sizes[:rank])
    if np.abs(matrix @ solved - wanted).max() > noise:  # something else pushes
        solved[:] = np.nan
    solved[(np.abs(two[rank:]) > ROUND_OFF).any(axis=0)] = np.nan
    return {pair: solved[(size - 1) * c : (size - 1) * (c + 1)] @ bases[c] for c, pair in enumerate(pairs)}
