"""Kernels of the symbolic factorisation on the graph of bodies: elimination tree and supernodes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import inline_kernel, kernel
from ninedisk.core.cd.solvers.factorise_kernels import padded

Longs = NDArray[np.int64]

FRONT, PIVOT, BLOCK, ENTRY = 45.0, 30.0, 2.0, 0.25
"""Cost [ns] of a front, a pivot body, a 3 x 3 block added to the parent and an entry of the factor (read by every solve)."""
PRODUCT = 0.07
"""Cost [ns] of a product of two entries."""


@kernel
def both_ways(column: Longs, row: Longs, ptr: Longs, neighbour: Longs, edge: Longs) -> None:
    """Adjacency of an undirected graph from its edges: neighbours of i at ``ptr[i]:ptr[i + 1]``, with the edges' numbers."""
    n = ptr.shape[0] - 1
    for i in range(n + 1):
        ptr[i] = 0
    for e in range(column.shape[0]):
        ptr[column[e] + 1] += 1
        ptr[row[e] + 1] += 1
    for i in range(n):
        ptr[i + 1] += ptr[i]
    for e in range(column.shape[0]):
        for i, k in ((column[e], row[e]), (row[e], column[e])):
            neighbour[ptr[i]] = k
            edge[ptr[i]] = e
            ptr[i] += 1
    for i in range(n, 0, -1):
        ptr[i] = ptr[i - 1]
    ptr[0] = 0


@kernel
def elimination_tree(
    order: Longs, rank: Longs, ptr: Longs, neighbour: Longs, parent: Longs, height: Longs, work: Longs
) -> None:
    """Parent of each body, -1 for roots, and bodies in its column of the factor with itself, by rank of elimination."""
    n = order.shape[0]
    for i in range(n):
        parent[i], work[i] = -1, -1
        for q in range(ptr[order[i]], ptr[order[i] + 1]):
            k = rank[neighbour[q]]
            while k < i and k >= 0:
                above = work[k]
                work[k] = i
                if above < 0:
                    parent[k] = i
                    break
                k = above
    for i in range(n):
        height[i], work[i] = 1, i
        for q in range(ptr[order[i]], ptr[order[i] + 1]):
            k = rank[neighbour[q]]
            while k < i and work[k] != i:
                work[k] = i
                height[k] += 1
                k = parent[k]


@inline_kernel
def _cost(pivots: int, bodies: int) -> float:
    """Time that a front takes, the update's way into the parent included."""
    below = bodies - pivots
    panel = 3.0 * pivots * padded(bodies)
    update = 1.5 * below * padded(below)
    products = 1.5 * pivots * (panel + 2.0 * update) - 1.5 * pivots * panel / 3.0
    return FRONT + PIVOT * pivots + ENTRY * panel + 0.5 * BLOCK * below * (below + 1) + PRODUCT * products


@kernel
def merge_supernodes(
    parent: Longs, height: Longs, pivots: Longs, bodies: Longs, top: Longs, head: Longs, after: Longs
) -> None:
    """Join bodies with their parents to supernodes where the larger front takes less time than the two.

    ``top[i]`` becomes the body that stands for i's supernode, its last one; ``pivots`` and ``bodies`` are right for those.
    """
    n = parent.shape[0]
    for i in range(n):
        pivots[i], bodies[i], top[i], head[i] = 1, height[i], i, -1
    for p in range(n):
        # Children in descending order: the ones eliminated last have the largest fronts.
        child = head[p]
        while child >= 0:
            k, m = pivots[child] + pivots[p], pivots[child] + bodies[p]
            if _cost(k, m) <= _cost(pivots[child], bodies[child]) + _cost(pivots[p], bodies[p]):
                top[child] = p
                pivots[p], bodies[p] = k, m
            child = after[child]
        if parent[p] >= 0:
            after[p] = head[parent[p]]
            head[parent[p]] = p
    for i in range(n - 1, -1, -1):
        top[i] = top[top[i]]


@kernel
def number_supernodes(
    parent: Longs, top: Longs, pivots: Longs, node: Longs, upper: Longs, first: Longs, place: Longs, work: Longs
) -> int:
    """Number supernodes in postorder and the bodies in them; returns the number of supernodes.

    Parameters
    ----------
    parent, top, pivots
        From `elimination_tree` and `merge_supernodes`.
    node : ndarray
        Out: supernode of each body, by rank.
    upper, first : ndarray
        Out: parent of each supernode or -1, and its first body in the new order, both by supernode.
    place : ndarray
        Out: new rank of each old one.
    work : ndarray, shape (3, b)
    """
    n = parent.shape[0]
    head, after, waiting = work[0], work[1], work[2]
    roots = -1
    for i in range(n):
        head[i] = -1
    # Lists come out in ascending order: the last child's update is the next one to be used.
    for i in range(n - 1, -1, -1):
        if top[i] != i:
            continue
        if parent[i] < 0:
            after[i], roots = roots, i
        else:
            p = top[parent[i]]
            after[i], head[p] = head[p], i
    count = at = depth = 0
    while roots >= 0 or depth > 0:
        if depth == 0:
            waiting[0], roots, depth = roots, after[roots], 1
        i = waiting[depth - 1]
        if head[i] >= 0:
            waiting[depth] = head[i]
            head[i] = after[head[i]]
            depth += 1
            continue
        depth -= 1
        node[i], first[count] = count, at
        at += pivots[i]
        count += 1
    for s in range(count):
        work[0, s] = first[s]
    for i in range(n):
        node[i] = node[top[i]]
        place[i] = head[node[i]]
        head[node[i]] += 1
        if top[i] == i:
            upper[node[i]] = -1 if parent[i] < 0 else top[parent[i]]
    for s in range(count):
        if upper[s] >= 0:
            upper[s] = node[upper[s]]
    return count
