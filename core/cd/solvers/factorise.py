"""Factorisations of the body-space matrix: our own supernodal Cholesky, and LU where Coulomb's law makes it unsymmetric.

The matrix is ``M + H' D H``, in blocks of 3 x 3: one for each body and each pair that touches. Its pattern and the order of elimination
that keeps its factors sparse hold for a contact graph, its entries for one iteration of a solver.
"""

from __future__ import annotations

from typing import Any, Protocol

import numba
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.core.cd.problem import ContactProblem
from ninedisk.core.cd.solvers import factorise_kernels as kernels
from ninedisk.core.cd.solvers.factorise_kernels import (
    BODIES,
    FIELDS,
    FIRST,
    LANES,
    LINES,
    PIVOTS,
    ROWS,
    assemble,
    factorise_fronts,
    jacobian_rows,
    minimum_degree,
    solve_fronts,
)

IntArray = NDArray[np.int64]


DENSE = 10.0
"""Bodies with more than this times ``sqrt(b)`` neighbours come last, as in AMD: they would slow down every step."""
MOST_CHANGED = 12
"""Contacts whose blocks are changed by updates before factors are made anew: 24 columns cost about as much as these."""
MOST_CONDITION, CANCELLED = 1e6, 1e-6
"""Condition of the small matrix of updates, and what is left of a row after cancellation: beyond, factors are made anew."""
PIVOT = 1e-3
"""Diagonal entries above this fraction of their column stay pivots: the matrix is nearly symmetric, and so its ordering holds."""


class Factorisation(Protocol):
    """Factors of symmetric positive definite matrices of one pattern of 3 x 3 blocks."""

    def update(self, data: FloatArray) -> bool:
        """Factorise the matrix with these entries; False if it is not positive definite to round-off."""
        ...

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve with the last factorisation."""
        ...


def factorisation(indptr: IntArray, indices: IntArray) -> Factorisation:
    """The factorisation for a pattern: supernodal, or dense where Numba is told not to compile.

    The supernodal kernels spell out machine instructions, which have no form that could be interpreted.

    Parameters
    ----------
    indptr, indices : ndarray of int
        Compressed columns of the upper triangle, diagonal included, rows ascending, in complete blocks of 3 x 3.
    """
    interpreted = bool(numba.config.DISABLE_JIT)  # type: ignore[attr-defined]
    return _DenseCholesky(indptr, indices) if interpreted else SupernodalCholesky(indptr, indices)


class _DenseCholesky:
    def __init__(self, indptr: IntArray, indices: IntArray) -> None:
        n = len(indptr) - 1
        self._column, self._row = np.repeat(np.arange(n), np.diff(indptr)), indices
        self._matrix = np.zeros((n, n))

    def update(self, data: FloatArray) -> bool:
        # numpy reads the lower triangle: entry (row, column) of the upper one stands at (column, row) of that.
        self._matrix[self._column, self._row] = data
        try:
            self._factor = np.linalg.cholesky(self._matrix)
        except np.linalg.LinAlgError:
            return False
        return bool(np.isfinite(self._factor).all())

    def solve(self, right: FloatArray) -> FloatArray:
        solution: FloatArray = np.linalg.solve(self._factor.T, np.linalg.solve(self._factor, right))
        return solution


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
        kernels.both_ways(column, row, ptr, neighbour, edge)
        order = elimination_order(ptr, neighbour)
        rank = longs(n)
        rank[order] = np.arange(n)
        parent, height, pivots, bodies, top, node, upper, first, place = (longs(n) for _ in range(9))
        work = longs(3, n)
        kernels.elimination_tree(order, rank, ptr, neighbour, parent, height, work[0])
        kernels.merge_supernodes(parent, height, pivots, bodies, top, work[0], work[1])
        count = kernels.number_supernodes(parent, top, pivots, node, upper, first, place, work)
        self._order = longs(n)
        self._order[place] = order
        node_of = longs(n)
        node_of[place] = node
        rank[self._order] = np.arange(n)
        self._nodes = nodes = np.zeros((count + 1, FIELDS), dtype=np.int64)
        nodes[:count, FIRST] = first[:count]
        nodes[:count, PIVOTS] = nodes[:count, BODIES] = np.diff(np.append(first[:count], n))
        kernels.front_rows(self._order, rank, ptr, neighbour, node_of, upper, nodes, longs(0), work[0])
        nodes[1:, ROWS] = np.cumsum(nodes[:count, BODIES] - nodes[:count, PIVOTS])
        nodes[:count, BODIES] = nodes[:count, PIVOTS]
        self._rows, self._place = longs(nodes[-1, ROWS]), longs(nodes[-1, ROWS])
        kernels.front_rows(self._order, rank, ptr, neighbour, node_of, upper, nodes, self._rows, work[0])
        self._children, sizes = longs(count), longs(2)
        kernels.lay_out(nodes, upper, self._rows, self._children, self._place, work[0], sizes)
        self._entries = longs(n + len(row), 5)
        kernels.matrix_entries(
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


def elimination_order(ptr: IntArray, neighbour: IntArray) -> IntArray:
    """Bodies in the order of elimination, by approximate minimum degree.

    Parameters
    ----------
    ptr, neighbour : ndarray of int64
        Neighbours of body i, without itself: ``neighbour[ptr[i]:ptr[i + 1]]``.
    """
    n = len(ptr) - 1
    order, table = np.empty(n, dtype=np.int64), np.empty((LINES, n), dtype=np.int64)
    room = 4 * len(neighbour) + 2 * n
    while not minimum_degree(
        ptr, neighbour, max(16, int(DENSE * n**0.5)), table, np.empty(room, dtype=np.int64), order
    ):
        room *= 2
    return order


class BodyGraph:
    """Sparsity pattern of a contact graph, with the symbolic factorisation that belongs to it.

    Parameters
    ----------
    n_bodies : int
    bodies : ndarray of int, shape (c, 2)
        Bodies of each contact, -1 for none.
    """

    def __init__(self, n_bodies: int, bodies: NDArray[np.int32]) -> None:
        self.n_bodies, self.bodies = n_bodies, bodies
        low, high = bodies.min(axis=1).astype(np.int64), bodies.max(axis=1).astype(np.int64)
        joint = (low >= 0) & (low != high)
        # Blocks (low, high) in the order of the columns: unique keys sort by the column's body, then the row's.
        keys, slot = np.unique(high[joint] * n_bodies + low[joint], return_inverse=True)
        column, row = keys // n_bodies, keys % n_bodies
        per_body = np.bincount(column, minlength=n_bodies)
        heights = 3 * per_body[:, None] + np.arange(1, 4)[None, :]
        self.indptr = np.concatenate([[0], np.cumsum(heights.ravel())]).astype(np.int64)
        start = self.indptr[:-1].reshape(n_bodies, 3)
        self.diagonal = start + 3 * per_body[:, None]
        rank = np.arange(len(keys)) - np.concatenate([[0], np.cumsum(per_body)])[column]
        position = start[column] + 3 * rank[:, None]
        self.indices = np.empty(self.indptr[-1], dtype=np.int64)
        for c in range(3):
            for a in range(3):
                self.indices[position[:, c] + a] = 3 * row + a
                if a <= c:
                    self.indices[self.diagonal[:, c] + a] = 3 * np.arange(n_bodies) + a
        self.block = np.full((len(bodies), 4), -1, dtype=np.int64)
        self.block[joint, :3] = position[slot]
        self.block[joint, 3] = bodies[joint, 0] < bodies[joint, 1]
        self.data = np.empty(self.indptr[-1])
        self.factorisation = factorisation(self.indptr, self.indices)

    def fits(self, problem: ContactProblem) -> bool:
        """Whether ``problem`` has this very contact graph."""
        return self.n_bodies == problem.n_bodies and np.array_equal(self.bodies, problem.bodies)


class BodyMatrix:
    """``M + H' D H`` of one problem on a graph.

    Parameters
    ----------
    problem : ContactProblem
    graph : BodyGraph
    """

    def __init__(self, problem: ContactProblem, graph: BodyGraph) -> None:
        self.problem, self.graph = problem, graph
        self.rows = np.empty((problem.n_contacts, 2, 6))
        jacobian_rows(problem.normal, problem.arms, problem.bodies, problem.free, self.rows)
        self._mass = np.where(problem.free > 0.0, problem.mass, 1.0)

    def factorise(self, d: FloatArray) -> bool:
        """Factorise with the blocks ``d``, shape (c, 3); False if the matrix is not positive definite to round-off."""
        graph, problem = self.graph, self.problem
        assemble(problem.bodies, self.rows, self._mass, problem.free, d, graph.diagonal, graph.block, graph.data)
        return graph.factorisation.update(graph.data)

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve for a right-hand side of shape (b, 3); blocked unknowns give 0."""
        solution = self.graph.factorisation.solve((right * self.problem.free).ravel())
        return solution.reshape(-1, 3) * self.problem.free


def times(d: FloatArray, z: FloatArray) -> FloatArray:
    """``d z`` contact by contact, shapes (c, 2, 2) and (c, 2)."""
    product: FloatArray = (d @ z[:, :, None])[:, :, 0]
    return product


class UnsymmetricMatrix:
    """``M + H' D H`` with blocks D that need not be symmetric, in an order that keeps its factors sparse."""

    def __init__(self, problem: ContactProblem) -> None:
        self.h = problem.jacobian()
        self._rows, self._unknowns = problem.rows()
        self._mass = np.where(problem.free > 0.0, problem.mass, 1.0).ravel()
        self._pattern(np.arange(3 * problem.n_bodies))
        # One ordering for all factorisations: the graph does not change.
        lu = _factors(self._made(np.eye(2) * problem.rho[:, None, None]), "MMD_AT_PLUS_A")
        self._pattern(np.asarray(lu.perm_c))
        self._lu: Any = None

    def _pattern(self, position: NDArray[np.integer[Any]]) -> None:
        """Places of the entries of all contacts and of the masses, for unknowns in these positions."""
        n, unknowns = len(position), position[self._unknowns]
        row = np.append(np.repeat(unknowns, 6, axis=1).ravel(), position)
        column = np.append(np.tile(unknowns, (1, 6)).ravel(), position)
        places, self._slot = np.unique(column.astype(np.int64) * n + row, return_inverse=True)
        self._indices = (places % n).astype(np.int32)
        self._indptr = np.searchsorted(places, n * np.arange(n + 1)).astype(np.int32)
        self._place = np.argsort(position)

    def _made(self, d: FloatArray) -> sp.csc_matrix:
        blocks = np.swapaxes(self._rows, 1, 2) @ (d @ self._rows)
        data = np.bincount(self._slot, np.append(blocks.ravel(), self._mass), len(self._indices))
        return sp.csc_matrix((data, self._indices, self._indptr), shape=(len(self._place),) * 2)

    def factorise(self, d: FloatArray) -> bool:
        """Factorise with the blocks ``d``, shape (c, 2, 2); False if that is impossible."""
        if not np.isfinite(d).all():
            return False
        self._matrix = self._made(d)
        try:
            self._lu = _factors(self._matrix, "NATURAL")
        except RuntimeError:
            return False
        self._blocks = d.copy()
        self._changed, self._change = np.empty(0, dtype=np.int64), np.empty((0, 2, 2))
        self._gain, self._small = np.empty((len(self._place), 0)), np.empty((0, 0))
        return True

    def update(self, contact: int, block: FloatArray) -> bool:
        """Give one contact another block, shape (2, 2), by the formula of Sherman, Morrison and Woodbury; False if that is impossible.

        Few such changes cost less than the factors, which `factorise` is to make anew after `MOST_CHANGED`.
        """
        if contact not in self._changed:
            columns = np.zeros((len(self._place), 2))
            np.add.at(columns, self._unknowns[contact], self._rows[contact].T)
            self._gain = np.hstack([self._gain, self._through_factors(columns)])
            self._changed = np.append(self._changed, contact)
            self._change = np.concatenate([self._change, np.zeros((1, 2, 2))])
        self._change[self._changed == contact] = block - self._blocks[contact]
        size = 2 * self.changed
        update = (self._change @ self._seen(self._gain)).reshape(size, size)
        self._small = np.eye(size) + update
        rows = np.abs(self._small).max(axis=1)
        # Where a stiff contact opens, the update nearly cancels the unit matrix.
        kept = np.isfinite(update).all() and (rows > CANCELLED * np.abs(update).max(axis=1)).all()
        return bool(kept and np.linalg.cond(self._small / rows[:, None]) < MOST_CONDITION)

    @property
    def changed(self) -> int:
        """Contacts whose blocks are not those that were factorised."""
        return len(self._changed)

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve with the last factorisation and one refinement, since pivots are not always the largest ones; or with its updates."""
        out = self._through_factors(right)
        if self.changed:
            out -= self._gain @ np.linalg.solve(self._small, (self._change @ self._seen(out[:, None])).ravel())
        else:
            out += self._through_factors(right - self._image(out))
        return out

    def sign(self) -> float:
        """Sign of the determinant of the matrix: 1, -1, or 0."""
        lu = self._lu
        swaps = _odd(lu.perm_r) != _odd(lu.perm_c)
        whole = float(np.prod(np.sign(lu.U.diagonal()))) * (-1.0 if swaps else 1.0)
        return whole * float(np.linalg.slogdet(self._small)[0])

    def _through_factors(self, right: FloatArray) -> FloatArray:
        out = np.empty_like(right)
        out[self._place] = self._lu.solve(right[self._place])
        return out

    def _image(self, x: FloatArray) -> FloatArray:
        """The factorised matrix times ``x``."""
        out = np.empty_like(x)
        out[self._place] = self._matrix @ x[self._place]
        return out

    def _seen(self, x: FloatArray) -> FloatArray:
        """Velocities of the m changed contacts, shape (m, 2, k), of k columns of unknowns ``x``."""
        seen: FloatArray = self._rows[self._changed] @ x[self._unknowns[self._changed]]
        return seen


def _odd(permutation: NDArray[np.int32]) -> bool:
    """Whether a permutation is one of an odd number of swaps: its length less its cycles."""
    places, cycles = permutation.tolist(), 0
    for start in range(len(places)):
        cycles += places[start] >= 0
        while places[start] >= 0:
            places[start], start = -1, places[start]
    return bool((len(places) - cycles) % 2)


def _factors(matrix: sp.csc_matrix, order: str) -> Any:
    import scipy.sparse.linalg as linalg

    solver: Any = linalg.splu
    return solver(matrix, permc_spec=order, diag_pivot_thresh=PIVOT, options={"SymmetricMode": True})
