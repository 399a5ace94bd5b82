"""The body-space matrix ``M + H' D H``: its pattern once per contact graph, its values once per iteration."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd.problem import ContactProblem
from ninedisk.core.cd.solvers.body_matrix_kernels import assemble, jacobian_rows
from ninedisk.core.cd.solvers.factorise import Factorisation

FloatArray = NDArray[np.float64]


class BodyGraph:
    """Sparsity pattern of a contact graph, with the symbolic factorisation that belongs to it.

    Parameters
    ----------
    n_bodies : int
    bodies : ndarray of int, shape (c, 2)
        Bodies of each contact, -1 for none.
    factoriser : str
        One of `options.FACTORISERS`.
    """

    def __init__(self, n_bodies: int, bodies: NDArray[np.int32], factoriser: str = "auto") -> None:
        self.n_bodies, self.bodies, self.factoriser = n_bodies, bodies, factoriser
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
        self.factorisation = Factorisation(self.indptr, self.indices, factoriser)

    def fits(self, problem: ContactProblem, factoriser: str) -> bool:
        """Whether ``problem`` has this very contact graph."""
        return (
            self.n_bodies == problem.n_bodies
            and self.factoriser == factoriser
            and np.array_equal(self.bodies, problem.bodies)
        )


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
