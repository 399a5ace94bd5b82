"""Kernels of the supernodal Cholesky factorisation: multifrontal, in blocks of 3 x 3.

A supernode's front is a dense lower trapezoid: its pivots' columns, the panel, are part of the factor; what is left of the rest
after their elimination, the update, waits on a stack until the parent adds it to its own front. Panels and updates lie by columns,
padded to a multiple of `LANES` rows. What is above the diagonal of a front is never used.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import inline_kernel, kernel
from ninedisk.core.cd.solvers.vector_kernels import (
    LANES,
    divide,
    downdate_4,
    downdate_8,
    downdate_16,
    fetch,
    negative_4,
    negative_8,
    negative_16,
    subtract_product,
    three_products,
)

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

FIRST, PIVOTS, BODIES, PANEL, UPDATE, ROWS, CHILDREN, ENTRIES = range(8)
"""Columns of the table of supernodes, which has one more line than supernodes: first body and number of bodies eliminated, bodies
of the front, position of the panel and of the update, first of its other rows, of its children and of its matrix entries."""
FIELDS = 8

AHEAD, FRONTS_AHEAD = 1024, 3
"""How far ahead solutions fetch the factor, which they read once: in numbers on the way up, in fronts on the way down."""


@inline_kernel
def padded(bodies: int) -> int:
    """Rows of a column of so many bodies."""
    return (3 * bodies + LANES - 1) // LANES * LANES


@inline_kernel
def _place_matrix(nodes: Longs, s: int, ld: int, entries: Longs, data: Floats, factor: Floats) -> None:
    """The panel as the matrix has it."""
    start = nodes[s, PANEL]
    for i in range(start, start + 3 * nodes[s, PIVOTS] * ld):
        factor[i] = 0.0
    for e in range(nodes[s, ENTRIES], nodes[s + 1, ENTRIES]):
        at, kind = entries[e, 3], entries[e, 4]
        for c in range(3):
            source = entries[e, c]
            if kind == 0:
                for a in range(c + 1):
                    factor[at + a * ld + c] = data[source + a]
            elif kind == 1:
                for a in range(3):
                    factor[at + a * ld + c] = data[source + a]
            else:
                for a in range(3):
                    factor[at + c * ld + a] = data[source + a]


@inline_kernel
def _add_children(
    nodes: Longs,
    s: int,
    children: Longs,
    place: Longs,
    stack: Floats,
    low: int,
    high: int,
    target: Floats,
    t: int,
    ld: int,
) -> None:
    """Add the children's updates to the bodies' columns ``low:high`` of a front, whose origin is ``target[t]``."""
    for q in range(nodes[s, CHILDREN], nodes[s + 1, CHILDREN]):
        child = children[q]
        rows, end = nodes[child, ROWS], nodes[child + 1, ROWS]
        s_ld = padded(end - rows)
        for column in range(rows, end):
            if place[column] < low:
                continue
            if place[column] >= high:
                break
            source = nodes[child, UPDATE] + 3 * (column - rows) * s_ld
            to = t + 3 * place[column] * ld
            for row in range(column, end):
                i, k = to + 3 * place[row], source + 3 * (row - rows)
                for c in range(3):
                    for a in range(3):
                        target[i + c * ld + a] += stack[k + c * s_ld + a]


@inline_kernel
def _pivot(factor: Floats, at: int, ld: int, top: int, below: int) -> bool:
    """Factorise the 3 x 3 block at ``at`` and divide the rows of its columns, ``top`` of them above, ``below`` from it on.

    The inverses of the diagonal are kept.
    """
    a00 = factor[at]
    if not 0.0 < a00 < np.inf:
        return False
    i0 = 1.0 / np.sqrt(a00)
    l10, l20 = factor[at + 1] * i0, factor[at + 2] * i0
    a11 = factor[at + ld + 1] - l10 * l10
    if not 0.0 < a11 < np.inf:
        return False
    i1 = 1.0 / np.sqrt(a11)
    l21 = (factor[at + ld + 2] - l20 * l10) * i1
    a22 = factor[at + 2 * ld + 2] - l20 * l20 - l21 * l21
    if not 0.0 < a22 < np.inf:
        return False
    i2 = 1.0 / np.sqrt(a22)
    for i in range(-top, below, LANES):
        divide(factor, at + i, ld, i0, i1, i2, l10, l20, l21)
    factor[at], factor[at + 1], factor[at + 2] = i0, l10, l20
    factor[at + ld + 1], factor[at + ld + 2] = i1, l21
    factor[at + 2 * ld + 2] = i2
    # Entries above the diagonal are read, times 0, by blocks of rows that are longer than a column.
    for c in range(3):
        for i in range(-top, c):
            factor[at + c * ld + i] = 0.0
    return True


@inline_kernel
def _eliminate(factor: Floats, panel: int, ld: int, pivots: int) -> bool:
    """Dense Cholesky factorisation of a panel, looking left."""
    for j in range(0, 3 * pivots, 3):
        top = j % LANES
        i = j - top
        if j > 0:
            while i + 16 <= ld:
                downdate_16(factor, panel + j * ld + i, ld, factor, panel + i, panel + j, ld, j)
                i += 16
            if i + 8 <= ld:
                downdate_8(factor, panel + j * ld + i, ld, factor, panel + i, panel + j, ld, j)
                i += 8
            if i < ld:
                downdate_4(factor, panel + j * ld + i, ld, factor, panel + i, panel + j, ld, j)
        if not _pivot(factor, panel + j * ld + j, ld, top, ld - j):
            return False
    return True


@inline_kernel
def _reduce(factor: Floats, panel: int, ld: int, k: int, stack: Floats, update: int, count: int) -> None:
    """The update ``- L L'`` with the rows L of the panel below its ``k`` pivots; children are yet to be added."""
    u_ld = padded(count)
    for j in range(0, 3 * count, 3):
        i = j - j % LANES
        while i + 16 <= u_ld:
            negative_16(stack, update + j * u_ld + i, u_ld, factor, panel + k + i, panel + k + j, ld, k)
            i += 16
        if i + 8 <= u_ld:
            negative_8(stack, update + j * u_ld + i, u_ld, factor, panel + k + i, panel + k + j, ld, k)
            i += 8
        if i < u_ld:
            negative_4(stack, update + j * u_ld + i, u_ld, factor, panel + k + i, panel + k + j, ld, k)


@kernel
def factorise_fronts(
    nodes: Longs, children: Longs, place: Longs, entries: Longs, data: Floats, factor: Floats, stack: Floats
) -> bool:
    """Factorise ``L L'``; False if a pivot is not positive or not finite.

    Parameters
    ----------
    nodes : ndarray of int64, shape (s + 1, FIELDS)
        Supernodes, children before parents.
    children : ndarray of int64
        Children of each supernode.
    place : ndarray of int64
        Place of each of a supernode's rows in its parent's front, ascending.
    entries : ndarray of int64, shape (e, 5)
        Blocks of the matrix: positions of their columns in ``data``, position in ``factor``, and 0 if it is the upper triangle of
        a diagonal block, 1 if the block is to be transposed, else 2.
    data : ndarray
        Entries of the matrix.
    factor, stack : ndarray
        Out: panels; work.
    """
    for s in range(nodes.shape[0] - 1):
        pivots, panel = nodes[s, PIVOTS], nodes[s, PANEL]
        ld, count = padded(nodes[s, BODIES]), nodes[s, BODIES] - pivots
        _place_matrix(nodes, s, ld, entries, data, factor)
        _add_children(nodes, s, children, place, stack, 0, pivots, factor, panel, ld)
        if not _eliminate(factor, panel, ld, pivots):
            return False
        if count > 0:
            update, u_ld = nodes[s, UPDATE], padded(count)
            _reduce(factor, panel, ld, 3 * pivots, stack, update, count)
            origin = update - 3 * pivots * (u_ld + 1)
            _add_children(nodes, s, children, place, stack, pivots, pivots + count, stack, origin, u_ld)
    return True


@kernel
def solve_fronts(nodes: Longs, rows: Longs, order: Longs, factor: Floats, x: Floats, w: Floats, z: Floats) -> None:
    """Solve ``L L' z = x``; unknowns of ``x`` and ``z`` in the matrix's own order.

    Parameters
    ----------
    nodes : ndarray of int64, shape (s + 1, FIELDS)
    rows : ndarray of int64
        Bodies of each front that are eliminated later, in the order of elimination.
    order : ndarray of int64, shape (b,)
        Bodies in the order of elimination.
    factor, x : ndarray
    w : ndarray
        Work: all unknowns in the order of elimination, then those of a front, and `LANES` more.
    z : ndarray
        Out.
    """
    n = order.shape[0]
    f = 3 * n
    for i in range(n):
        for c in range(3):
            w[3 * i + c] = x[3 * order[i] + c]
    for s in range(nodes.shape[0] - 1):
        k, first, panel, bodies = 3 * nodes[s, PIVOTS], 3 * nodes[s, FIRST], nodes[s, PANEL], nodes[s, BODIES]
        ld, below = padded(bodies), nodes[s, ROWS]
        for i in range(k):
            w[f + i] = w[first + i]
        for i in range(k, ld + LANES):
            w[f + i] = 0.0
        fetch(factor, panel + AHEAD, k * ld)
        for j in range(0, k, 3):
            at = panel + j * ld + j
            x0 = w[f + j] * factor[at]
            x1 = (w[f + j + 1] - factor[at + 1] * x0) * factor[at + ld + 1]
            x2 = (w[f + j + 2] - factor[at + 2] * x0 - factor[at + ld + 2] * x1) * factor[at + 2 * ld + 2]
            w[first + j], w[first + j + 1], w[first + j + 2] = x0, x1, x2
            blocks = (3 * bodies - j - 3 + LANES - 1) // LANES
            subtract_product(w, f + j + 3, factor, at + 3, ld, x0, x1, x2, blocks)
        for i in range(bodies - nodes[s, PIVOTS]):
            for c in range(3):
                w[3 * rows[below + i] + c] += w[f + k + 3 * i + c]
    for s in range(nodes.shape[0] - 2, -1, -1):
        k, first, panel, bodies = 3 * nodes[s, PIVOTS], 3 * nodes[s, FIRST], nodes[s, PANEL], nodes[s, BODIES]
        ld, below = padded(bodies), nodes[s, ROWS]
        for i in range(bodies - nodes[s, PIVOTS]):
            for c in range(3):
                w[f + k + 3 * i + c] = w[3 * rows[below + i] + c]
        for i in range(3 * bodies, 3 * bodies + LANES):
            w[f + i] = 0.0
        # On the way back the processor does not foresee what comes next.
        if s >= FRONTS_AHEAD:
            before = nodes[s - FRONTS_AHEAD, PANEL]
            fetch(factor, before, nodes[s - FRONTS_AHEAD + 1, PANEL] - before)
        for j in range(k - 3, -1, -3):
            at = panel + j * ld + j
            blocks = (3 * bodies - j - 3 + LANES - 1) // LANES
            p0, p1, p2 = three_products(factor, at + 3, ld, w, f + j + 3, blocks)
            x2 = (w[first + j + 2] - p2) * factor[at + 2 * ld + 2]
            x1 = (w[first + j + 1] - p1 - factor[at + ld + 2] * x2) * factor[at + ld + 1]
            x0 = (w[first + j] - p0 - factor[at + 1] * x1 - factor[at + 2] * x2) * factor[at]
            w[first + j], w[first + j + 1], w[first + j + 2] = x0, x1, x2
            w[f + j], w[f + j + 1], w[f + j + 2] = x0, x1, x2
    for i in range(n):
        for c in range(3):
            z[3 * order[i] + c] = w[3 * i + c]
