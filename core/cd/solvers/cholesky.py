"""Sparse Cholesky factorisation of matrices of 3 x 3 blocks, a block for each body and each pair that touches."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd.solvers import front_kernels as fronts
from ninedisk.core.cd.solvers import supernode_kernels as symbolic
from ninedisk.core.cd.solvers.factorise_kernels import (
    BODIES,
    FIELDS,
    FIRST,
    PIVOTS,
    ROWS,
    factorise_fronts,
    solve_fronts,
)
from ninedisk.core.cd.solvers.ordering import elimination_order
from ninedisk.core.cd.solvers.vector_kernels import LANES

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


class SupernodalCholesky:
    """``L L'`` of symmetric positive definite matrices of one pattern of 3 x 3 blocks.

    Bodies are put in an order that keeps the factor sparse and joined to supernodes, whose columns have nearly the same rows:
    the work is done in dense blocks [Duff, Reid 1983, The multifrontal solution of indefinite sparse symmetric
    linear equations, ACM Trans. Math. Softw. 9].
    After the first creation of this pattern nothing is allocated but solutions.

    Parameters
    ----------
    indptr, indices : ndarray of int
        Compressed columns of the upper triangle, rows ascending, all blocks complete.
    """

    def __init__(self, indptr: IntArray, indices: IntArray) -> None:
        indptr = indptr.astype(np.int64)
        n = (len(indptr) - 1) // 3
        start = indptr[:-1].reshape(n, 3)
        above = np.diff(indptr)[::3] // 3
        diagonal = start + 3 * above[:, None]
        column = np.repeat(np.arange(n), above)
        rank_in_column = np.arange(len(column)) - np.repeat(np.cumsum(above) - above, above)
        block = start[column] + 3 * rank_in_column[:, None]
        row = indices[block[:, 0]].astype(np.int64) // 3
        self._analyse(n, column, row, diagonal, block)

    def _analyse(self, n: int, column: IntArray, row: IntArray, diagonal: IntArray, block: IntArray) -> None:
        def longs(*shape: int) -> IntArray:
            return np.empty(shape, dtype=np.int64)

        ptr, neighbour, edge = longs(n + 1), longs(2 * len(row)), longs(2 * len(row))
        symbolic.both_ways(column, row, ptr, neighbour, edge)
        order = elimination_order(ptr, neighbour)
        rank = longs(n)
        rank[order] = np.arange(n)
        parent, height, pivots, bodies, top, node, upper, first, place = (longs(n) for _ in range(9))
        work = longs(3, n)
        symbolic.elimination_tree(order, rank, ptr, neighbour, parent, height, work[0])
        symbolic.merge_supernodes(parent, height, pivots, bodies, top, work[0], work[1])
        count = symbolic.number_supernodes(parent, top, pivots, node, upper, first, place, work)
        self._order = longs(n)
        self._order[place] = order
        node_of = longs(n)
        node_of[place] = node
        rank[self._order] = np.arange(n)
        self._nodes = nodes = np.zeros((count + 1, FIELDS), dtype=np.int64)
        nodes[:count, FIRST] = first[:count]
        nodes[:count, PIVOTS] = nodes[:count, BODIES] = np.diff(np.append(first[:count], n))
        fronts.front_rows(self._order, rank, ptr, neighbour, node_of, upper, nodes, longs(0), work[0])
        nodes[1:, ROWS] = np.cumsum(nodes[:count, BODIES] - nodes[:count, PIVOTS])
        nodes[:count, BODIES] = nodes[:count, PIVOTS]
        self._rows, self._place = longs(nodes[-1, ROWS]), longs(nodes[-1, ROWS])
        fronts.front_rows(self._order, rank, ptr, neighbour, node_of, upper, nodes, self._rows, work[0])
        self._children, sizes = longs(count), longs(2)
        fronts.lay_out(nodes, upper, self._rows, self._children, self._place, work[0], sizes)
        self._entries = longs(n + len(row), 5)
        fronts.matrix_entries(
            self._order, rank, ptr, neighbour, edge, column, diagonal, block, node_of, nodes, self._rows, self._entries
        )
        # Blocks of rows that are longer than the last column reach beyond it.
        self._factor, self._stack = np.zeros(sizes[0] + LANES), np.zeros(sizes[1] + LANES)
        front = int(nodes[:, BODIES].max(initial=0))
        self._work = np.empty(3 * n + 3 * front + 2 * LANES)

    def update(self, data: FloatArray) -> bool:
        """Factorise the matrix with these entries; False if it is not positive definite to round-off."""
        return bool(
            factorise_fronts(self._nodes, self._children, self._place, self._entries, data, self._factor, self._stack)
        )

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve with the last factorisation."""
        solution = np.empty(len(right))
        solve_fronts(self._nodes, self._rows, self._order, self._factor, right, self._work, solution)
        return solution
