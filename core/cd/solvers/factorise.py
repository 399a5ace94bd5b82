"""Factorisations of the body-space matrix, supernodal: Cholesky's, and one where Coulomb's law makes it unsymmetric.

The matrix is ``M + H' D H``, in blocks of 3 x 3: one for each body and each pair that touches. Its pattern and the order of elimination
that keeps its factors sparse hold for a contact graph, its entries for one iteration of a solver.
"""

from __future__ import annotations

from typing import Protocol

import numba
import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.core.cd.problem import ContactProblem
from ninedisk.core.cd.solvers import factorise_kernels as kernels
from ninedisk.core.cd.solvers.factorise_kernels import (
    BODIES,
    ENTRIES,
    FIELDS,
    FIRST,
    LANES,
    LINES,
    PIVOTS,
    ROWS,
    UPDATE,
    assemble,
    factorise_fronts,
    jacobian_rows,
    minimum_degree,
    solve_fronts,
)
from ninedisk.core.cd.solvers.unsymmetric_kernels import determinant_sign, factorise_unsymmetric, solve_unsymmetric

IntArray = NDArray[np.int64]


DENSE = 10.0
"""Bodies with more than this times ``sqrt(b)`` neighbours come last, as in AMD: they would slow down every step."""


class Factorisation(Protocol):
    """Factors of symmetric positive definite matrices of one pattern of 3 x 3 blocks."""

    def update(self, data: FloatArray) -> bool:
        """Factorise the matrix with these entries; False if it is not positive definite to round-off."""
        ...

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve with the last factorisation."""
        ...


def factorisation(indptr: IntArray, indices: IntArray) -> Factorisation:
    """The factorisation for a pattern: supernodal, or dense where Numba is set not to compile.

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
        # numpy reads the lower triangle: entry (row, column) of the upper one is at (column, row) of that.
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
        kernels.symmetric_adjacency(column, row, ptr, neighbour, edge)
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


class UnsymmetricMatrix:
    """``M + H' D H`` of one problem, with blocks D that need not be symmetric; the pattern is analysed once.

    Parameters
    ----------
    problem : ContactProblem
    seen : ndarray of bool, shape (c,), optional
        Contacts whose blocks are ever anything but 0: without the others factors are sparser. None: all.

    Attributes
    ----------
    rows : ndarray, shape (c, 2, 6)
        From `jacobian_rows`.
    """

    def __init__(self, problem: ContactProblem, seen: NDArray[np.bool_] | None = None) -> None:
        self._bodies = problem.bodies
        self.rows = np.empty((problem.n_contacts, 2, 6))
        jacobian_rows(problem.normal, problem.arms, problem.bodies, problem.free, self.rows)
        mass = np.where(problem.free > 0.0, problem.mass, 1.0)
        contacts = np.arange(problem.n_contacts) if seen is None else np.flatnonzero(seen)
        graph = BodyGraph(problem.n_bodies, problem.bodies[contacts])
        symmetric = graph.factorisation
        self._factors: SupernodalFactors | _DenseFactors = (
            SupernodalFactors(graph, symmetric, contacts, self.rows, mass)
            if isinstance(symmetric, SupernodalCholesky)
            else _DenseFactors(problem, mass)
        )

    def factorise(self, d: FloatArray, changed: IntArray | None = None) -> bool:
        """Factorise with the blocks ``d``, shape (c, 2, 2), of which, if given, those ``changed`` alone are new; False if impossible."""
        return self._factors.update(d, None if changed is None else self._bodies[changed])

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve for a right-hand side of shape (b, 3) with the last factorisation; blocked unknowns have to be 0 and stay so."""
        return self._factors.solve(right)

    def sign(self) -> float:
        """Sign of the determinant of the matrix: 1 or -1."""
        return self._factors.sign()


class _DenseFactors:
    """For kernels that are interpreted."""

    def __init__(self, problem: ContactProblem, mass: FloatArray) -> None:
        self._h, self._mass = problem.jacobian().toarray(), np.diag(mass.ravel())

    def update(self, d: FloatArray, bodies: NDArray[np.int32] | None) -> bool:
        del bodies
        h = self._h.reshape(-1, 2, self._h.shape[1])
        self._matrix = self._mass + self._h.T @ (d @ h).reshape(self._h.shape)
        return bool(np.isfinite(self._matrix).all() and self.sign() != 0.0)

    def solve(self, right: FloatArray) -> FloatArray:
        solution: FloatArray = np.linalg.solve(self._matrix, right.ravel()).reshape(-1, 3)
        return solution

    def sign(self) -> float:
        return float(np.linalg.slogdet(self._matrix)[0])


class SupernodalFactors:
    """Factors ``L V'`` of ``M + H' D H`` in the order and the supernodes of the symmetric factorisation.

    Where the blocks of one contact change, those fronts are made anew that its entries reach: on the way from its bodies to the root of
    the elimination tree.

    Parameters
    ----------
    graph : BodyGraph
    symmetric : SupernodalCholesky
        Of the graph.
    contacts : ndarray of int64
        Those of the graph.
    rows : ndarray, shape (c, 2, 6)
        Of all contacts.
    mass : ndarray, shape (b, 3)
    """

    def __init__(
        self, graph: BodyGraph, symmetric: SupernodalCholesky, contacts: IntArray, rows: FloatArray, mass: FloatArray
    ) -> None:
        self._tree = symmetric
        self._nodes = nodes = symmetric._nodes.copy()
        count = len(nodes) - 1
        below = 3 * (nodes[:-1, BODIES] - nodes[:-1, PIVOTS])
        sizes = below * -(-below // LANES * LANES)
        # Updates stay for those fronts that are not made anew.
        nodes[:-1, UPDATE] = np.cumsum(sizes) - sizes
        self._left, self._right = np.zeros((2, len(symmetric._factor)))
        self._left_update, self._right_update = np.zeros((2, int(sizes.sum()) + LANES))
        self._node = np.empty(graph.n_bodies, dtype=np.int64)
        self._node[symmetric._order] = np.repeat(np.arange(count), nodes[:-1, PIVOTS])
        entries, bodies = symmetric._entries, graph.bodies.astype(np.int64)
        entry = np.empty(len(graph.data), dtype=np.int64)
        entry[entries[:, 0]] = np.arange(len(entries))
        terms = []
        for side in (0, 1):
            k = np.flatnonzero(bodies[:, side] >= 0)
            terms.append(
                (k, np.full(len(k), side), np.zeros(len(k), dtype=np.int64), entry[graph.diagonal[bodies[k, side], 0]])
            )
        k = np.flatnonzero(graph.block[:, 0] >= 0)
        pair = entry[graph.block[k, 0]]
        low = 1 - graph.block[k, 3]
        terms.append((k, np.where(entries[pair, 4] == 1, low, 1 - low), np.ones(len(k), dtype=np.int64), pair))
        contact, whose, kind, place = (np.concatenate(column) for column in zip(*terms, strict=True))
        node = np.searchsorted(nodes[:, ENTRIES], place, side="right") - 1
        order = np.argsort(node, kind="stable")
        self._terms = np.column_stack([contacts[contact], whose, kind, entries[place, 3]])[order]
        self._start = np.searchsorted(node[order], np.arange(count + 1)).astype(np.int64)
        self._rows, self._mass, self._due = rows, mass, np.ones(count, dtype=np.bool_)
        self._good = False

    def update(self, d: FloatArray, bodies: NDArray[np.int32] | None) -> bool:
        """Factorise with the blocks ``d``, shape (c, 2, 2), which since the last time have changed at contacts of ``bodies`` alone."""
        tree = self._tree
        self._due[:] = bodies is None or not self._good
        if bodies is not None:
            self._due[self._node[bodies[bodies >= 0]]] = True
        self._good = bool(
            factorise_unsymmetric(
                *(self._nodes, tree._children, tree._place, tree._order, self._terms, self._start),
                *(self._mass, self._rows, d, self._due),
                *(self._left, self._right, self._left_update, self._right_update),
            )
        )
        return self._good

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve for a right-hand side of shape (b, 3)."""
        solution, tree = np.empty_like(right), self._tree
        solve_unsymmetric(self._nodes, tree._rows, tree._order, self._left, self._right, right, tree._work, solution)
        return solution

    def sign(self) -> float:
        """Sign of the determinant."""
        return float(determinant_sign(self._nodes, self._left))
