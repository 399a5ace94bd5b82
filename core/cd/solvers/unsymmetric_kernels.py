"""Kernels of the supernodal factorisation of ``M + H' D H`` where its values are not symmetric, though its pattern is.

As in `factorise_kernels`, with two panels for each front: L, the pivots' columns, and V, the transpose of their rows. A pivot block of
3 x 3 is factorised as ``B = Q R`` by rotations. Columns of L are divided by R, those of V turned by Q, so that ``L V'`` is what
elimination takes off the rest. Where the inverses of R's diagonal and Q' are kept, the diagonal blocks of L and V, nothing else is needed.
Pivots are taken in the order of elimination, without looking for larger ones: with the blocks D of statuses the errors of solutions are
those of a factorisation that does.

Updates stay where they are, so that fronts whose entries and children are as before need not be made again.
"""

from __future__ import annotations

from math import inf, sqrt

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd.solvers.factorise_kernels import (
    AHEAD,
    BODIES,
    CHILDREN,
    FIRST,
    FRONTS_AHEAD,
    LANES,
    PANEL,
    PIVOTS,
    ROWS,
    UPDATE,
    add_children,
    divide,
    downdate,
    fetch,
    padded,
    reduce,
    subtract_product,
    three_products,
    turn,
)
from ninedisk.core.compile import inline_kernel, kernel

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]
Ints = NDArray[np.int32]

CONTACT, SIDE, PAIR, AT = range(4)
"""Columns of the table of terms, the products of rows that the matrix is the sum of: contact, the side of it whose columns they are, 1
if the rows are those of its other side, and the position in the panel."""
TINY = 1e-300
"""Size of a pivot below which its inverse is no number."""


@inline_kernel
def _place_terms(
    nodes: Longs,
    s: int,
    ld: int,
    order: Longs,
    terms: Longs,
    start: Longs,
    mass: Floats,
    rows: Floats,
    d: Floats,
    left: Floats,
    right: Floats,
) -> None:
    """The panels as the matrix has them."""
    panel = nodes[s, PANEL]
    for i in range(panel, panel + 3 * nodes[s, PIVOTS] * ld):
        left[i] = right[i] = 0.0
    for i in range(nodes[s, PIVOTS]):
        for c in range(3):
            left[panel + (3 * i + c) * (ld + 1)] = mass[order[nodes[s, FIRST] + i], c]
    for t in range(start[s], start[s + 1]):
        k, o, at = terms[t, CONTACT], 3 * terms[t, SIDE], terms[t, AT]
        nn, nt, tn, tt = d[k, 0, 0], d[k, 0, 1], d[k, 1, 0], d[k, 1, 1]
        for c in range(3):
            n, q = rows[k, 0, o + c], rows[k, 1, o + c]
            if terms[t, PAIR] == 0:
                for a in range(3):
                    left[at + c * ld + a] += rows[k, 0, o + a] * (nn * n + nt * q) + rows[k, 1, o + a] * (
                        tn * n + tt * q
                    )
            else:
                for a in range(3):
                    en, et = rows[k, 0, 3 - o + a], rows[k, 1, 3 - o + a]
                    left[at + c * ld + a] += en * (nn * n + nt * q) + et * (tn * n + tt * q)
                    right[at + c * ld + a] += en * (nn * n + tn * q) + et * (nt * n + tt * q)


@inline_kernel
def _rotation(a: float, b: float) -> tuple[float, float]:
    """Cosine and sine of the turn that takes ``b`` to 0."""
    size = sqrt(a * a + b * b)
    return (a / size, b / size) if size > 0.0 else (1.0, 0.0)


@inline_kernel
def _pivot(left: Floats, right: Floats, at: int, ld: int, top: int, below: int) -> bool:
    """Factorise the 3 x 3 block at ``at`` and work the rows of its columns, ``top`` of them above, ``below`` from it on."""
    a00, a10, a20 = left[at], left[at + 1], left[at + 2]
    a01, a11, a21 = left[at + ld], left[at + ld + 1], left[at + ld + 2]
    a02, a12, a22 = left[at + 2 * ld], left[at + 2 * ld + 1], left[at + 2 * ld + 2]
    c, s = _rotation(a00, a10)
    a00, a01, a11, a02, a12 = (
        c * a00 + s * a10,
        c * a01 + s * a11,
        c * a11 - s * a01,
        c * a02 + s * a12,
        c * a12 - s * a02,
    )
    q00, q01, q10, q11 = c, s, -s, c
    c, s = _rotation(a00, a20)
    a00, a01, a21, a02, a22 = (
        c * a00 + s * a20,
        c * a01 + s * a21,
        c * a21 - s * a01,
        c * a02 + s * a22,
        c * a22 - s * a02,
    )
    q00, q01, q02, q20, q21, q22 = c * q00, c * q01, s, -s * q00, -s * q01, c
    c, s = _rotation(a11, a21)
    a11, a12, a22 = c * a11 + s * a21, c * a12 + s * a22, c * a22 - s * a12
    q10, q20 = c * q10 + s * q20, c * q20 - s * q10
    q11, q21 = c * q11 + s * q21, c * q21 - s * q11
    q12, q22 = s * q22, c * q22
    if not (TINY < abs(a00) < inf and TINY < abs(a11) < inf and TINY < abs(a22) < inf):
        return False
    i0, i1, i2 = 1.0 / a00, 1.0 / a11, 1.0 / a22
    for i in range(-top, below, LANES):
        divide(left, at + i, ld, i0, i1, i2, a01, a02, a12)
        turn(right, at + i, ld, q00, q01, q02, q10, q11, q12, q20, q21, q22)
    # Entries above the diagonal are read, times 0, by blocks of rows that are longer than a column.
    for k in range(3):
        for i in range(-top, 3):
            left[at + k * ld + i] = right[at + k * ld + i] = 0.0
    left[at], left[at + ld], left[at + 2 * ld] = i0, a01, a02
    left[at + ld + 1], left[at + 2 * ld + 1], left[at + 2 * ld + 2] = i1, a12, i2
    right[at], right[at + ld], right[at + 2 * ld] = q00, q01, q02
    right[at + 1], right[at + ld + 1], right[at + 2 * ld + 1] = q10, q11, q12
    right[at + 2], right[at + ld + 2], right[at + 2 * ld + 2] = q20, q21, q22
    return True


@kernel
def factorise_unsymmetric(
    nodes: Longs,
    children: Longs,
    place: Longs,
    order: Longs,
    terms: Longs,
    start: Longs,
    mass: Floats,
    rows: Floats,
    d: Floats,
    due: NDArray[np.bool_],
    left: Floats,
    right: Floats,
    left_update: Floats,
    right_update: Floats,
) -> bool:
    """Factorise ``M + H' D H``; False if a pivot is 0 or not finite.

    Parameters
    ----------
    nodes, children, place
        As in `factorise_fronts`; updates have their own places.
    order : ndarray of int64, shape (b,)
        Bodies in the order of elimination.
    terms : ndarray of int64, shape (t, 4)
        By supernode, whose first one is ``start``.
    mass : ndarray, shape (b, 3)
    rows : ndarray, shape (c, 2, 6)
        From `jacobian_rows`.
    d : ndarray, shape (c, 2, 2)
    due : ndarray of bool
        Supernodes whose entries are new; those above are marked in passing.
    left, right, left_update, right_update : ndarray
        Out.
    """
    for s in range(nodes.shape[0] - 1):
        for q in range(nodes[s, CHILDREN], nodes[s + 1, CHILDREN]):
            due[s] |= due[children[q]]
        if not due[s]:
            continue
        pivots, panel = nodes[s, PIVOTS], nodes[s, PANEL]
        ld, count = padded(nodes[s, BODIES]), nodes[s, BODIES] - pivots
        _place_terms(nodes, s, ld, order, terms, start, mass, rows, d, left, right)
        add_children(nodes, s, children, place, left_update, 0, pivots, left, panel, ld)
        add_children(nodes, s, children, place, right_update, 0, pivots, right, panel, ld)
        for j in range(0, 3 * pivots, 3):
            downdate(left, right, panel, ld, j)
            downdate(right, left, panel, ld, j)
            if not _pivot(left, right, panel + j * ld + j, ld, j % LANES, ld - j):
                return False
        if count > 0:
            update, u_ld = nodes[s, UPDATE], padded(count)
            origin = update - 3 * pivots * (u_ld + 1)
            reduce(left, right, panel, ld, 3 * pivots, left_update, update, count)
            add_children(nodes, s, children, place, left_update, pivots, pivots + count, left_update, origin, u_ld)
            reduce(right, left, panel, ld, 3 * pivots, right_update, update, count)
            add_children(nodes, s, children, place, right_update, pivots, pivots + count, right_update, origin, u_ld)
    return True


@kernel
def determinant_sign(nodes: Longs, left: Floats) -> int:
    """Sign of the determinant of what was factorised."""
    sign = 1
    for s in range(nodes.shape[0] - 1):
        ld = padded(nodes[s, BODIES])
        for j in range(3 * nodes[s, PIVOTS]):
            if left[nodes[s, PANEL] + j * (ld + 1)] < 0.0:
                sign = -sign
    return sign


@kernel
def solve_unsymmetric(
    nodes: Longs, rows: Longs, order: Longs, left: Floats, right: Floats, x: Floats, w: Floats, z: Floats
) -> None:
    """Solve for ``x``, shape (b, 3); other arguments as in `solve_fronts` and `factorise_unsymmetric`."""
    n = order.shape[0]
    f = 3 * n
    for i in range(n):
        for c in range(3):
            w[3 * i + c] = x[order[i], c]
    for s in range(nodes.shape[0] - 1):
        k, first, panel, bodies = 3 * nodes[s, PIVOTS], 3 * nodes[s, FIRST], nodes[s, PANEL], nodes[s, BODIES]
        ld, below = padded(bodies), nodes[s, ROWS]
        for i in range(k):
            w[f + i] = w[first + i]
        for i in range(k, ld + LANES):
            w[f + i] = 0.0
        fetch(left, panel + AHEAD, k * ld)
        for j in range(0, k, 3):
            at = panel + j * ld + j
            y0, y1, y2 = w[f + j], w[f + j + 1], w[f + j + 2]
            x0 = right[at] * y0 + right[at + ld] * y1 + right[at + 2 * ld] * y2
            x1 = right[at + 1] * y0 + right[at + ld + 1] * y1 + right[at + 2 * ld + 1] * y2
            x2 = right[at + 2] * y0 + right[at + ld + 2] * y1 + right[at + 2 * ld + 2] * y2
            w[first + j], w[first + j + 1], w[first + j + 2] = x0, x1, x2
            blocks = (3 * bodies - j - 3 + LANES - 1) // LANES
            subtract_product(w, f + j + 3, left, at + 3, ld, x0, x1, x2, blocks)
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
        if s >= FRONTS_AHEAD:
            before = nodes[s - FRONTS_AHEAD, PANEL]
            fetch(right, before, nodes[s - FRONTS_AHEAD + 1, PANEL] - before)
        for j in range(k - 3, -1, -3):
            at = panel + j * ld + j
            blocks = (3 * bodies - j - 3 + LANES - 1) // LANES
            p0, p1, p2 = three_products(right, at + 3, ld, w, f + j + 3, blocks)
            x2 = (w[first + j + 2] - p2) * left[at + 2 * ld + 2]
            x1 = (w[first + j + 1] - p1 - left[at + 2 * ld + 1] * x2) * left[at + ld + 1]
            x0 = (w[first + j] - p0 - left[at + ld] * x1 - left[at + 2 * ld] * x2) * left[at]
            w[first + j], w[first + j + 1], w[first + j + 2] = x0, x1, x2
            w[f + j], w[f + j + 1], w[f + j + 2] = x0, x1, x2
    for i in range(n):
        for c in range(3):
            z[order[i], c] = w[3 * i + c]


@kernel
def load_of_velocities(bodies: Ints, rows: Floats, d: Floats, u: Floats, load: Floats) -> None:
    """``H' D u``, shape (b, 3), of contact velocities ``u``, shape (c, 2)."""
    for i in range(load.shape[0]):
        for c in range(3):
            load[i, c] = 0.0
    for k in range(bodies.shape[0]):
        p = d[k, 0, 0] * u[k, 0] + d[k, 0, 1] * u[k, 1]
        q = d[k, 1, 0] * u[k, 0] + d[k, 1, 1] * u[k, 1]
        for side in range(2):
            i = bodies[k, side]
            if i >= 0:
                for c in range(3):
                    load[i, c] += rows[k, 0, 3 * side + c] * p + rows[k, 1, 3 * side + c] * q


@kernel
def forces_of_velocities(bodies: Ints, rows: Floats, d: Floats, u: Floats, v: Floats, r: Floats) -> None:
    """``D (u - H v)``, shape (c, 2), of contact velocities ``u``, shape (c, 2), and body velocities ``v``, shape (b, 3)."""
    for k in range(bodies.shape[0]):
        n, t = u[k, 0], u[k, 1]
        for side in range(2):
            i = bodies[k, side]
            if i >= 0:
                for c in range(3):
                    n -= rows[k, 0, 3 * side + c] * v[i, c]
                    t -= rows[k, 1, 3 * side + c] * v[i, c]
        r[k, 0] = d[k, 0, 0] * n + d[k, 0, 1] * t
        r[k, 1] = d[k, 1, 0] * n + d[k, 1, 1] * t
