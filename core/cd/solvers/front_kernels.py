"""Kernels that lay out the fronts of the supernodes: their rows, what the parent does with them, where everything lies."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import inline_kernel, kernel
from ninedisk.core.cd.solvers.factorise_kernels import (
    BODIES,
    CHILDREN,
    ENTRIES,
    FIRST,
    PANEL,
    PIVOTS,
    ROWS,
    UPDATE,
    padded,
)

Longs = NDArray[np.int64]


@kernel
def front_rows(
    order: Longs,
    rank: Longs,
    ptr: Longs,
    neighbour: Longs,
    node: Longs,
    upper: Longs,
    nodes: Longs,
    rows: Longs,
    mark: Longs,
) -> None:
    """Bodies below the pivots of each front, ascending; the first call counts them in ``nodes``, with empty ``rows``."""
    count = nodes.shape[0] - 1
    for s in range(count):
        mark[s] = -1
    for i in range(order.shape[0]):
        for q in range(ptr[order[i]], ptr[order[i] + 1]):
            k = rank[neighbour[q]]
            if k > i:
                continue
            s = node[k]
            while s != node[i] and mark[s] != i:
                mark[s] = i
                if rows.shape[0] > 0:
                    rows[nodes[s, ROWS] + nodes[s, BODIES] - nodes[s, PIVOTS]] = i
                nodes[s, BODIES] += 1
                s = upper[s]


@inline_kernel
def _front_place(nodes: Longs, s: int, rows: Longs, body: int) -> int:
    """Place of a body in a front, by bisection."""
    inside = body - nodes[s, FIRST]
    if inside < nodes[s, PIVOTS]:
        return int(inside)
    low, high = nodes[s, ROWS], nodes[s + 1, ROWS]
    start = low
    while low < high:
        middle = (low + high) // 2
        if rows[middle] < body:
            low = middle + 1
        else:
            high = middle
    return int(nodes[s, PIVOTS] + low - start)


@kernel
def lay_out(nodes: Longs, upper: Longs, rows: Longs, children: Longs, place: Longs, odd: Longs, sizes: Longs) -> None:
    """Children, places in parents' fronts, positions of panels and updates; ``sizes`` get the lengths of factor and stack.

    Updates wait on two stacks, for odd and for even generations: a front's children lie on top of the one while its own update is
    put on the other.
    """
    count = nodes.shape[0] - 1
    for s in range(count):
        nodes[s + 1, CHILDREN] = 0
    nodes[0, CHILDREN] = 0
    for s in range(count):
        if upper[s] >= 0:
            nodes[upper[s] + 1, CHILDREN] += 1
    for s in range(count):
        nodes[s + 1, CHILDREN] += nodes[s, CHILDREN]
    for s in range(count):
        if upper[s] >= 0:
            children[nodes[upper[s], CHILDREN]] = s
            nodes[upper[s], CHILDREN] += 1
    for s in range(count, 0, -1):
        nodes[s, CHILDREN] = nodes[s - 1, CHILDREN]
    nodes[0, CHILDREN] = 0
    for s in range(count - 1, -1, -1):
        odd[s] = 0 if upper[s] < 0 else 1 - odd[upper[s]]
    height, highest = (0, 0), (0, 0)
    panel = 0
    for s in range(count):
        nodes[s, PANEL] = panel
        panel += 3 * nodes[s, PIVOTS] * padded(nodes[s, BODIES])
        for q in range(nodes[s, ROWS], nodes[s + 1, ROWS]):
            place[q] = _front_place(nodes, upper[s], rows, rows[q])
        even_height, odd_height = height
        if nodes[s, CHILDREN] < nodes[s + 1, CHILDREN]:
            lowest = nodes[children[nodes[s, CHILDREN]], UPDATE]
            if odd[s] == 1:
                even_height = lowest
            else:
                odd_height = lowest
        below = nodes[s, BODIES] - nodes[s, PIVOTS]
        nodes[s, UPDATE] = odd_height if odd[s] == 1 else even_height
        if odd[s] == 1:
            odd_height += 3 * below * padded(below)
        else:
            even_height += 3 * below * padded(below)
        height = (even_height, odd_height)
        highest = (max(highest[0], even_height), max(highest[1], odd_height))
    for s in range(count):
        if odd[s] == 1:
            nodes[s, UPDATE] += highest[0]
    sizes[0], sizes[1] = panel, highest[0] + highest[1]


@kernel
def matrix_entries(
    order: Longs,
    rank: Longs,
    ptr: Longs,
    neighbour: Longs,
    edge: Longs,
    column: Longs,
    diagonal: Longs,
    block: Longs,
    node: Longs,
    nodes: Longs,
    rows: Longs,
    entries: Longs,
) -> None:
    """Where the blocks of the matrix go: ``entries`` as in `factorise_fronts`.

    ``diagonal`` and ``block`` are the positions of the columns of diagonal blocks and of those of the edges, shapes (b, 3), (e, 3);
    ``column`` is the body of each edge whose columns they are.
    """
    at = 0
    for i in range(order.shape[0]):
        s = node[i]
        if i == nodes[s, FIRST]:
            nodes[s, ENTRIES] = at
        ld = padded(nodes[s, BODIES])
        inside = i - nodes[s, FIRST]
        start = nodes[s, PANEL] + 3 * inside * ld
        body = order[i]
        for c in range(3):
            entries[at, c] = diagonal[body, c]
        entries[at, 3], entries[at, 4] = start + 3 * inside, 0
        at += 1
        for q in range(ptr[body], ptr[body + 1]):
            k = rank[neighbour[q]]
            if k > i:
                for c in range(3):
                    entries[at, c] = block[edge[q], c]
                entries[at, 3] = start + 3 * _front_place(nodes, s, rows, k)
                entries[at, 4] = 2 if column[edge[q]] == body else 1
                at += 1
    nodes[nodes.shape[0] - 1, ENTRIES] = at
