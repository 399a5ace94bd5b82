"""Kernels of the supernodal Cholesky factorisation: multifrontal, in blocks of 3 x 3; and those that assemble its matrix.

A supernode's front is a dense lower trapezoid: its pivots' columns, the panel, are part of the factor; what is left of the rest
after their elimination, the update, waits on a stack until the parent adds it to its own front. Panels and updates lie by columns,
padded to a multiple of `LANES` rows. What is above the diagonal of a front is never used.

The order of elimination is that of minimum degree, on a quotient graph of what is left. Bodies that are yet to be eliminated are
variables. An eliminated one becomes an element: the clique of the variables that it touched. A variable's list holds its elements
first, then the variables it still touches directly. Variables with the same neighbours are joined to one; the degrees are upper bounds
that are cheap to keep [Amestoy, Davis, Duff 1996, An approximate minimum degree ordering algorithm, SIAM J. Matrix Anal. Appl. 17].

The loops of small dense blocks are too short for the compiler's own vectoriser, and it would have to prove that the columns read
and the columns written do not overlap. Here the vectors of the processor are spelled out; where it has shorter ones, the compiler
splits them. Products and sums are fused where the processor can, lane by lane and in a fixed order: the same bits at each call. Blocks
are given by an array and the position of their first entry; columns lie one after another, ``ld`` entries apart.
"""

# The arguments of an intrinsic are types; the code that it builds reads their values elsewhere.
# ruff: noqa: ARG001

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from ninedisk.core.compile import inline_kernel, kernel

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

FIRST, PIVOTS, BODIES, PANEL, UPDATE, ROWS, CHILDREN, ENTRIES = range(8)
"""Columns of the table of supernodes, which has one more line than supernodes: first body and number of bodies eliminated, bodies
of the front, position of the panel and of the update, first of its other rows, of its children and of its matrix entries."""
FIELDS = 8

LANES = 4
"""Rows of the shortest block of rows; columns are padded to a multiple of it."""

LINE = 8
"""Numbers in a line of the cache."""

FRONT, PIVOT, BLOCK, ENTRY = 45.0, 30.0, 2.0, 0.25
"""Cost [ns] of a front, a pivot body, a 3 x 3 block added to the parent and an entry of the factor (read by every solve)."""
PRODUCT = 0.07
"""Cost [ns] of a product of two entries."""

START, LENGTH, ELEMENTS, WEIGHT, DEGREE, FLAG, NEXT, BEFORE, HEAD, MEMBER, LAST, BUCKET, CHAIN, HASH = range(14)
"""Rows of the table of bodies: start, length and elements of the list, members of the variable (0: none, it has been joined or
eliminated), degree, work, degree lists (neighbours and heads), members (next and last), hash buckets, next in a bucket, hash."""
LINES = 14

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
def add_children(
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
def downdate(target: Floats, other: Floats, panel: int, ld: int, j: int) -> None:
    """Take the columns before off the columns ``j : j + 3`` of a panel, times the rows j of another."""
    i, at = j - j % LANES, panel + j * ld
    if j == 0:
        return
    while i + 16 <= ld:
        downdate_16(target, at + i, ld, target, panel + i, other, panel + j, ld, j)
        i += 16
    if i + 8 <= ld:
        downdate_8(target, at + i, ld, target, panel + i, other, panel + j, ld, j)
        i += 8
    if i < ld:
        downdate_4(target, at + i, ld, target, panel + i, other, panel + j, ld, j)


@inline_kernel
def _eliminate(factor: Floats, panel: int, ld: int, pivots: int) -> bool:
    """Dense Cholesky factorisation of a panel, looking left."""
    for j in range(0, 3 * pivots, 3):
        downdate(factor, factor, panel, ld, j)
        if not _pivot(factor, panel + j * ld + j, ld, j % LANES, ld - j):
            return False
    return True


@inline_kernel
def reduce(factor: Floats, other: Floats, panel: int, ld: int, k: int, stack: Floats, update: int, count: int) -> None:
    """The update ``- L V'`` with the rows L and V of two panels below their ``k`` pivots; children are yet to be added."""
    u_ld = padded(count)
    for j in range(0, 3 * count, 3):
        i = j - j % LANES
        while i + 16 <= u_ld:
            negative_16(stack, update + j * u_ld + i, u_ld, factor, panel + k + i, other, panel + k + j, ld, k)
            i += 16
        if i + 8 <= u_ld:
            negative_8(stack, update + j * u_ld + i, u_ld, factor, panel + k + i, other, panel + k + j, ld, k)
            i += 8
        if i < u_ld:
            negative_4(stack, update + j * u_ld + i, u_ld, factor, panel + k + i, other, panel + k + j, ld, k)


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
        add_children(nodes, s, children, place, stack, 0, pivots, factor, panel, ld)
        if not _eliminate(factor, panel, ld, pivots):
            return False
        if count > 0:
            update, u_ld = nodes[s, UPDATE], padded(count)
            reduce(factor, factor, panel, ld, 3 * pivots, stack, update, count)
            origin = update - 3 * pivots * (u_ld + 1)
            add_children(nodes, s, children, place, stack, pivots, pivots + count, stack, origin, u_ld)
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


@kernel
def symmetric_adjacency(column: Longs, row: Longs, ptr: Longs, neighbour: Longs, edge: Longs) -> None:
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

    ``top[i]`` becomes the body that represents i's supernode, its last one; ``pivots`` and ``bodies`` are right for those.
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


@inline_kernel
def _insert(t: Longs, i: int, degree: int) -> None:
    """Put a variable at the head of a list of its degree."""
    first = t[HEAD, degree]
    t[NEXT, i], t[BEFORE, i], t[HEAD, degree] = first, -1, i
    if first >= 0:
        t[BEFORE, first] = i


@inline_kernel
def _remove(t: Longs, i: int) -> None:
    """Take a variable out of its list of degrees."""
    before, after = t[BEFORE, i], t[NEXT, i]
    if before >= 0:
        t[NEXT, before] = after
    else:
        t[HEAD, t[DEGREE, i]] = after
    if after >= 0:
        t[BEFORE, after] = before


@inline_kernel
def _join(t: Longs, i: int, k: int) -> None:
    """Append the members of k to those of i."""
    t[MEMBER, t[LAST, i]] = k
    t[LAST, i] = t[LAST, k]


@inline_kernel
def _clique(t: Longs, lists: Longs, pivot: int, free: int) -> int:
    """Write the variables that ``pivot`` touches to ``lists[free:]``, their weights negative from now on; returns the end.

    The elements that ``pivot`` belonged to are part of the new one and vanish (`FLAG` 0).
    """
    t[WEIGHT, pivot] = -t[WEIGHT, pivot]
    end, start = free, t[START, pivot]
    elements = t[ELEMENTS, pivot]
    for q in range(elements + 1):
        if q < elements:
            e = lists[start + q]
            low, high = t[START, e], t[START, e] + t[LENGTH, e]
            t[FLAG, e] = 0
        else:
            low, high = start + elements, start + t[LENGTH, pivot]
        for p in range(low, high):
            i = lists[p]
            if t[WEIGHT, i] > 0:
                t[WEIGHT, i] = -t[WEIGHT, i]
                lists[end] = i
                end += 1
                _remove(t, i)
    return end


@inline_kernel
def _outside(t: Longs, lists: Longs, free: int, end: int, flag: int) -> None:
    """For each element of the clique's variables: ``FLAG - flag`` becomes the weight of what lies outside of the clique."""
    for p in range(free, end):
        i = lists[p]
        for q in range(t[START, i], t[START, i] + t[ELEMENTS, i]):
            e = lists[q]
            if t[FLAG, e] >= flag:
                t[FLAG, e] += t[WEIGHT, i]
            elif t[FLAG, e] > 0:
                t[FLAG, e] = t[DEGREE, e] + flag + t[WEIGHT, i]


@inline_kernel
def _prune(t: Longs, lists: Longs, pivot: int, free: int, end: int, flag: int) -> int:
    """New lists and degrees of the clique's variables; returns the weight of those that touch nothing else and go with ``pivot``."""
    n = t.shape[1]
    gone = 0
    for p in range(free, end):
        i = lists[p]
        start = t[START, i]
        at, degree, code = start, 0, 0
        for q in range(start, start + t[ELEMENTS, i]):
            e = lists[q]
            if t[FLAG, e] > flag:
                degree += t[FLAG, e] - flag
                lists[at] = e
                at += 1
                code += e
            else:
                t[FLAG, e] = 0
        elements = at - start + 1
        stop = start + t[LENGTH, i]
        # The new element takes the first place: a variable or an element has just left the list, so that there is room.
        first_variable = at
        for q in range(start + t[ELEMENTS, i], stop):
            k = lists[q]
            if t[WEIGHT, k] > 0:
                degree += t[WEIGHT, k]
                lists[at] = k
                at += 1
                code += k
        if degree == 0:
            gone -= t[WEIGHT, i]
            t[WEIGHT, i] = 0
            _join(t, pivot, i)
            continue
        if first_variable < at:
            lists[at] = lists[first_variable]
        lists[first_variable] = lists[start]
        lists[start] = pivot
        t[ELEMENTS, i], t[LENGTH, i] = elements, at + 1 - start
        t[DEGREE, i] = min(t[DEGREE, i], degree)
        code = (code + pivot) % n
        t[HASH, i] = code
        t[CHAIN, i], t[BUCKET, code] = t[BUCKET, code], i
    return gone


@inline_kernel
def _same(t: Longs, lists: Longs, k: int, mark: int) -> bool:
    """Whether all of k's list is marked."""
    q, end = t[START, k], t[START, k] + t[LENGTH, k]
    while q < end and t[FLAG, lists[q]] == mark:
        q += 1
    return bool(q == end)


@inline_kernel
def _join_equals(t: Longs, lists: Longs, free: int, end: int, flag: int) -> int:
    """Join the clique's variables with equal lists; returns the next free flag."""
    for p in range(free, end):
        i = lists[p]
        if t[WEIGHT, i] == 0:
            continue
        code = t[HASH, i]
        i = t[BUCKET, code]
        t[BUCKET, code] = -1
        while i >= 0 and t[CHAIN, i] >= 0:
            for q in range(t[START, i], t[START, i] + t[LENGTH, i]):
                t[FLAG, lists[q]] = flag
            last, k = i, t[CHAIN, i]
            while k >= 0:
                after = t[CHAIN, k]
                alike = t[LENGTH, k] == t[LENGTH, i] and t[ELEMENTS, k] == t[ELEMENTS, i] and _same(t, lists, k, flag)
                if alike:
                    t[WEIGHT, i] += t[WEIGHT, k]
                    t[WEIGHT, k] = 0
                    _join(t, i, k)
                    t[CHAIN, last] = after
                else:
                    last = k
                k = after
            flag += 1
            i = t[CHAIN, i]
    return flag


@kernel
def minimum_degree(ptr: Longs, neighbour: Longs, dense: int, t: Longs, lists: Longs, order: Longs) -> bool:
    """Order in which bodies are eliminated; False if ``lists`` is too short.

    Parameters
    ----------
    ptr, neighbour : ndarray of int64
        Neighbours of each body, without itself.
    dense : int
        Bodies with more neighbours than this are eliminated last.
    t : ndarray of int64, shape (LINES, b)
        Work.
    lists : ndarray of int64
        Work: as long as the graph's lists and the cliques of all eliminations.
    order : ndarray of int64, shape (b,)
        Out.
    """
    n = ptr.shape[0] - 1
    for i in range(n):
        t[HEAD, i] = t[BUCKET, i] = t[MEMBER, i] = -1
    free = ptr[n]
    for p in range(free):
        lists[p] = neighbour[p]
    done = 0
    for i in range(n):
        t[START, i], t[LENGTH, i], t[ELEMENTS, i] = ptr[i], ptr[i + 1] - ptr[i], 0
        t[LAST, i], t[WEIGHT, i], t[FLAG, i] = i, 1, 1
        if t[LENGTH, i] > dense:
            t[WEIGHT, i] = 0
            done += 1
            order[n - done] = i
        else:
            t[DEGREE, i] = t[LENGTH, i]
            _insert(t, i, t[DEGREE, i])
    at = least = 0
    flag, largest = 2, 0
    while done < n:
        while t[HEAD, least] < 0:
            least += 1
        pivot = t[HEAD, least]
        _remove(t, pivot)
        if free + n - done > lists.shape[0]:
            return False
        weight = t[WEIGHT, pivot]
        end = _clique(t, lists, pivot, free)
        degree = 0
        for p in range(free, end):
            degree -= t[WEIGHT, lists[p]]
        _outside(t, lists, free, end, flag)
        gone = _prune(t, lists, pivot, free, end, flag)
        degree -= gone
        done += weight + gone
        largest = max(largest, degree)
        flag = _join_equals(t, lists, free, end, flag + largest + 1)
        t[WEIGHT, pivot], t[START, pivot], t[DEGREE, pivot] = 0, free, degree
        for p in range(free, end):
            i = lists[p]
            if t[WEIGHT, i] == 0:
                continue
            t[WEIGHT, i] = -t[WEIGHT, i]
            bound = min(t[DEGREE, i] + degree - t[WEIGHT, i], n - done - t[WEIGHT, i])
            t[DEGREE, i] = bound
            _insert(t, i, bound)
            least = min(least, bound)
            lists[free] = i
            free += 1
        t[LENGTH, pivot] = free - t[START, pivot]
        t[FLAG, pivot] = 1 if t[LENGTH, pivot] > 0 else 0
        i = pivot
        while i >= 0:
            order[at] = i
            at += 1
            i = t[MEMBER, i]
    return True


_tools: Any = cgutils
_types: Any = types

_DOUBLE, _LONG, _INT = ir.DoubleType(), ir.IntType(64), ir.IntType(32)
_FUSED = ("contract",)


class _Vectors:
    """Instructions on vectors of ``lanes`` numbers."""

    def __init__(self, context: Any, builder: Any, lanes: int) -> None:
        self.context, self.builder, self.lanes = context, builder, lanes
        self.kind = ir.VectorType(_DOUBLE, lanes)
        self.zero = ir.Constant(self.kind, [0.0] * lanes)

    def base(self, kind: Any, array: Any) -> Any:
        return self.context.make_array(kind)(self.context, self.builder, array).data

    def _at(self, base: Any, index: Any) -> Any:
        return self.builder.bitcast(self.builder.gep(base, [index]), self.kind.as_pointer())

    def load(self, base: Any, index: Any) -> Any:
        return self.builder.load(self._at(base, index), align=8)

    def store(self, value: Any, base: Any, index: Any) -> None:
        self.builder.store(value, self._at(base, index), align=8)

    def spread(self, number: Any) -> Any:
        """The number in every lane."""
        one = self.builder.insert_element(self.zero, number, ir.Constant(_INT, 0))
        return self.builder.shuffle_vector(
            one, self.zero, ir.Constant(ir.VectorType(_INT, self.lanes), [0] * self.lanes)
        )

    def less(self, total: Any, a: Any, b: Any) -> Any:
        """``total - a b``."""
        return self.builder.fsub(total, self.builder.fmul(a, b, flags=_FUSED), flags=_FUSED)

    def more(self, total: Any, a: Any, b: Any) -> Any:
        """``total + a b``."""
        return self.builder.fadd(total, self.builder.fmul(a, b, flags=_FUSED), flags=_FUSED)


def _plus(builder: Any, *terms: Any) -> Any:
    total = terms[0]
    for term in terms[1:]:
        total = builder.add(total, term)
    return total


def _long(value: int) -> Any:
    return ir.Constant(_LONG, value)


def _tile(lanes: int, parts: int, *, fresh: bool) -> Callable[..., None]:
    """Kernel for ``lanes parts`` rows; ``fresh``: what was there before is forgotten, as if it had been 0."""

    @intrinsic
    def tile(
        typingctx: Any, target: Any, t: Any, t_ld: Any, source: Any, s: Any, other: Any, b: Any, ld: Any, count: Any
    ) -> Any:
        def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            to, at, to_ld, source, rows, other, factors, ld, count = args
            vectors = _Vectors(context, builder, lanes)
            to = vectors.base(signature.args[0], to)
            source, other = vectors.base(signature.args[3], source), vectors.base(signature.args[5], other)
            places = [
                [_plus(builder, at, builder.mul(to_ld, _long(c)), _long(lanes * part)) for part in range(parts)]
                for c in range(3)
            ]
            totals = [[_tools.alloca_once(builder, vectors.kind) for _ in range(parts)] for _ in range(3)]
            for c in range(3):
                for part in range(parts):
                    start = vectors.zero if fresh else vectors.load(to, places[c][part])
                    builder.store(start, totals[c][part])
            with _tools.for_range(builder, count) as loop:
                column = builder.mul(ld, loop.index)
                factor = builder.add(factors, column)
                by = [
                    vectors.spread(builder.load(builder.gep(other, [builder.add(factor, _long(c))]))) for c in range(3)
                ]
                for part in range(parts):
                    a = vectors.load(source, _plus(builder, rows, column, _long(lanes * part)))
                    for c in range(3):
                        builder.store(vectors.less(builder.load(totals[c][part]), a, by[c]), totals[c][part])
            for c in range(3):
                for part in range(parts):
                    vectors.store(builder.load(totals[c][part]), to, places[c][part])
            return context.get_dummy_value()

        return _types.void(target, _types.int64, _types.int64, source, _types.int64, other, *[_types.int64] * 3), build

    kernel: Callable[..., None] = tile
    return kernel


downdate_16 = _tile(8, 2, fresh=False)
"""``target[t:, :3] -= source[s:, :count] other[b : b + 3, :count]'`` for 16 rows; the arguments are ``target, t, t_ld, source, s,
other, b, ld, count``."""
downdate_8 = _tile(8, 1, fresh=False)
downdate_4 = _tile(4, 1, fresh=False)
negative_16 = _tile(8, 2, fresh=True)
"""``target[t:, :3] = - source[s:, :count] other[b : b + 3, :count]'`` for 16 rows."""
negative_8 = _tile(8, 1, fresh=True)
negative_4 = _tile(4, 1, fresh=True)


@intrinsic
def _divide(typingctx: Any, a: Any, at: Any, ld: Any, i0: Any, i1: Any, i2: Any, l10: Any, l20: Any, l21: Any) -> Any:
    """Four rows of three columns times the inverse of a lower triangle, transposed.

    Arguments are the array, the position, ``ld``, the inverses of the triangle's diagonal and its entries below.
    """

    def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        vectors = _Vectors(context, builder, LANES)
        data = vectors.base(signature.args[0], args[0])
        at, ld = args[1], args[2]
        i0, i1, i2, l10, l20, l21 = (vectors.spread(number) for number in args[3:])
        places = [at, builder.add(at, ld), _plus(builder, at, ld, ld)]
        x0, x1, x2 = (vectors.load(data, place) for place in places)
        x0 = builder.fmul(x0, i0)
        x1 = builder.fmul(vectors.less(x1, x0, l10), i1)
        x2 = builder.fmul(vectors.less(vectors.less(x2, x0, l20), x1, l21), i2)
        for value, place in zip((x0, x1, x2), places, strict=True):
            vectors.store(value, data, place)
        return context.get_dummy_value()

    return _types.void(a, _types.int64, _types.int64, *[_types.float64] * 6), build


@intrinsic
def _turn(
    typingctx: Any,
    a: Any,
    at: Any,
    ld: Any,
    q00: Any,
    q01: Any,
    q02: Any,
    q10: Any,
    q11: Any,
    q12: Any,
    q20: Any,
    q21: Any,
    q22: Any,
) -> Any:
    """Four rows of three columns times the transpose of a 3 x 3 matrix: the array, the position, ``ld``, and the matrix by rows."""

    def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        vectors = _Vectors(context, builder, LANES)
        data = vectors.base(signature.args[0], args[0])
        at, ld = args[1], args[2]
        q = [vectors.spread(number) for number in args[3:]]
        places = [at, builder.add(at, ld), _plus(builder, at, ld, ld)]
        x = [vectors.load(data, place) for place in places]
        for row, place in enumerate(places):
            total = builder.fmul(x[0], q[3 * row])
            for c in (1, 2):
                total = vectors.more(total, x[c], q[3 * row + c])
            vectors.store(total, data, place)
        return context.get_dummy_value()

    return _types.void(a, _types.int64, _types.int64, *[_types.float64] * 9), build


@intrinsic
def _subtract_product(
    typingctx: Any, w: Any, i: Any, a: Any, at: Any, ld: Any, x0: Any, x1: Any, x2: Any, count: Any
) -> Any:
    """``w[i:] -= a[at:, :3] (x0, x1, x2)`` for ``count`` times four rows."""

    def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        vectors = _Vectors(context, builder, LANES)
        w, i, data, at, ld = args[:5]
        w, data = vectors.base(signature.args[0], w), vectors.base(signature.args[2], data)
        x = [vectors.spread(number) for number in args[5:8]]
        columns = [at, builder.add(at, ld), _plus(builder, at, ld, ld)]
        with _tools.for_range(builder, args[8]) as loop:
            row = builder.mul(loop.index, _long(LANES))
            place = builder.add(i, row)
            total = vectors.load(w, place)
            for column, factor in zip(columns, x, strict=True):
                total = vectors.less(total, vectors.load(data, builder.add(column, row)), factor)
            vectors.store(total, w, place)
        return context.get_dummy_value()

    return _types.void(w, _types.int64, a, _types.int64, _types.int64, *[_types.float64] * 3, _types.int64), build


@intrinsic
def _three_products(typingctx: Any, a: Any, at: Any, ld: Any, w: Any, i: Any, count: Any) -> Any:
    """``a[at:, :3]' w[i:]`` over ``count`` times four rows, as three numbers."""

    def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        vectors = _Vectors(context, builder, LANES)
        data, at, ld, w, i, count = args
        data, w = vectors.base(signature.args[0], data), vectors.base(signature.args[3], w)
        columns = [at, builder.add(at, ld), _plus(builder, at, ld, ld)]
        totals = [_tools.alloca_once_value(builder, vectors.zero) for _ in columns]
        with _tools.for_range(builder, count) as loop:
            row = builder.mul(loop.index, _long(LANES))
            factor = vectors.load(w, builder.add(i, row))
            for column, total in zip(columns, totals, strict=True):
                a = vectors.load(data, builder.add(column, row))
                builder.store(vectors.more(builder.load(total), a, factor), total)
        sums = []
        for total in totals:
            value = builder.load(total)
            lanes = [builder.extract_element(value, ir.Constant(_INT, lane)) for lane in range(LANES)]
            sums.append(builder.fadd(builder.fadd(lanes[0], lanes[1]), builder.fadd(lanes[2], lanes[3])))
        return context.make_tuple(builder, signature.return_type, sums)

    triple = _types.UniTuple(_types.float64, 3)
    return triple(a, _types.int64, _types.int64, w, _types.int64, _types.int64), build


@intrinsic
def _fetch(typingctx: Any, a: Any, at: Any, count: Any) -> Any:
    """Have ``a[at : at + count]`` brought to the cache, wherever that lies: nothing is read."""

    def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        data = _Vectors(context, builder, LANES).base(signature.args[0], args[0])
        byte, flag = ir.IntType(8).as_pointer(), ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [byte, flag, flag, flag])
        fetch = _tools.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
        # To be read, kept in all caches, data.
        how = [ir.Constant(flag, value) for value in (0, 3, 1)]
        end = builder.add(args[1], args[2])
        with _tools.for_range_slice(builder, args[1], end, _long(LINE)) as (index, _):
            builder.call(fetch, [builder.bitcast(builder.gep(data, [index]), byte), *how])
        return context.get_dummy_value()

    return _types.void(a, _types.int64, _types.int64), build


divide: Callable[..., None] = _divide
turn: Callable[..., None] = _turn
subtract_product: Callable[..., None] = _subtract_product
fetch: Callable[..., None] = _fetch
three_products: Callable[..., tuple[float, float, float]] = _three_products


@kernel
def jacobian_rows(normal: Floats, arms: Floats, bodies: NDArray[np.int32], free: Floats, rows: Floats) -> None:
    """Jacobian as dense rows, shape (c, 2, 6): columns of body i, then j; blocked unknowns have zeros."""
    for k in range(bodies.shape[0]):
        nx, ny = normal[k, 0], normal[k, 1]
        for side in range(2):
            b = bodies[k, side]
            sign = -1.0 if side == 0 else 1.0
            c = 3 * side
            for d in range(3):
                rows[k, 0, c + d] = 0.0
                rows[k, 1, c + d] = 0.0
            if b >= 0:
                rows[k, 0, c] = sign * nx * free[b, 0]
                rows[k, 0, c + 1] = sign * ny * free[b, 1]
                rows[k, 0, c + 2] = arms[k, side] * free[b, 2]
                rows[k, 1, c] = sign * ny * free[b, 0]
                rows[k, 1, c + 1] = -sign * nx * free[b, 1]
                rows[k, 1, c + 2] = arms[k, 2 + side] * free[b, 2]


@kernel
def assemble(
    bodies: NDArray[np.int32],
    rows: Floats,
    mass: Floats,
    free: Floats,
    d: Floats,
    diagonal: Longs,
    block: Longs,
    data: Floats,
) -> None:
    """Upper triangle of ``M + H' D H`` in compressed columns; rows of blocked unknowns are those of the identity.

    Parameters
    ----------
    bodies, mass, free
        As in `ContactProblem`.
    rows : ndarray, shape (c, 2, 6)
        From `jacobian_rows`.
    d : ndarray, shape (c, 3)
        Symmetric 2 x 2 blocks ``(D_nn, D_nt, D_tt)``.
    diagonal : ndarray of int64, shape (b, 3)
        Position in ``data`` of the entry (0, k) of each body's diagonal block.
    block : ndarray of int64, shape (c, 4)
        Position of the entries (0, k), k = 0..2, of the off-diagonal block of each contact, and 1 if the block's rows
        belong to body i (0: to body j); -1 if there is none.
    data : ndarray
        Out.
    """
    for m in range(data.shape[0]):
        data[m] = 0.0
    for i in range(mass.shape[0]):
        for c in range(3):
            data[diagonal[i, c] + c] = mass[i, c] if free[i, c] > 0.0 else 1.0
    for k in range(bodies.shape[0]):
        nn, nt, tt = d[k, 0], d[k, 1], d[k, 2]
        for side in range(2):
            i = bodies[k, side]
            if i < 0:
                continue
            o = 3 * side
            for c in range(3):
                en = nn * rows[k, 0, o + c] + nt * rows[k, 1, o + c]
                et = nt * rows[k, 0, o + c] + tt * rows[k, 1, o + c]
                for a in range(c + 1):
                    data[diagonal[i, c] + a] += rows[k, 0, o + a] * en + rows[k, 1, o + a] * et
        if block[k, 0] >= 0:
            above, left = (0, 3) if block[k, 3] == 1 else (3, 0)
            for c in range(3):
                en = nn * rows[k, 0, left + c] + nt * rows[k, 1, left + c]
                et = nt * rows[k, 0, left + c] + tt * rows[k, 1, left + c]
                for a in range(3):
                    data[block[k, c] + a] += rows[k, 0, above + a] * en + rows[k, 1, above + a] * et
