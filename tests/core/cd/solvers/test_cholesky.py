"""The supernodal Cholesky factorisation against dense algebra, on graphs of every shape and on matrices as solvers make them."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import problems
import pytest
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from ninedisk.core.cd.problem import ContactProblem
from ninedisk.core.cd.solvers.factorise import BodyGraph, BodyMatrix, SupernodalCholesky, elimination_order
from ninedisk.core.cd.solvers.factorise_kernels import BODIES, CHILDREN, PIVOTS, ROWS

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Edges = list[tuple[int, int]]

EPSILON = np.finfo(np.float64).eps


def lattice(side: int) -> Edges:
    right = [(i, i + 1) for i in range(side * side) if (i + 1) % side]
    return right + [(i, i + side) for i in range(side * (side - 1))]


def random_edges(n: int, count: int, seed: int = 1) -> Edges:
    return [(int(i), int(k)) for i, k in np.random.default_rng(seed).integers(0, n, (count, 2))]


GRAPHS: dict[str, tuple[int, Edges]] = {
    "one body": (1, [(0, -1)]),
    "bodies apart": (7, [(0, -1), (5, -1)]),
    "two": (2, [(1, 0)]),
    "chain": (50, list(pairwise(range(50)))),
    "chain, shuffled": (50, list(pairwise(np.random.default_rng(2).permutation(50).tolist()))),
    "ring": (31, [(i, (i + 1) % 31) for i in range(31)]),
    "star": (300, [(17, i) for i in range(300) if i != 17]),
    "clique": (23, [(i, k) for i in range(23) for k in range(i)]),
    "two cliques, one link": (
        20,
        [(10 * s + i, 10 * s + k) for s in (0, 1) for i in range(10) for k in range(i)] + [(3, 14)],
    ),
    "disconnected": (60, lattice(5) + [(25 + i, 25 + k) for i, k in lattice(4)] + [(59, -1)]),
    "lattice": (400, lattice(20)),
    "tree": (200, [(i, (i - 1) // 3) for i in range(1, 200)]),
    "sparse, random": (150, random_edges(150, 200)),
    "dense, random": (80, random_edges(80, 600)),
    "many contacts of a pair": (4, [(0, 1), (1, 0), (0, 1), (2, 1), (3, 3)]),
}
each_graph = pytest.mark.parametrize("name", GRAPHS)


def graph_of(name: str) -> BodyGraph:
    n, edges = GRAPHS[name]
    return BodyGraph(n, np.array(edges, dtype=np.int32))


def whole(graph: BodyGraph, data: FloatArray) -> FloatArray:
    """The symmetric matrix of upper-triangle entries."""
    upper = sp.csc_array((data, graph.indices, graph.indptr)).toarray()
    full: FloatArray = upper + np.triu(upper, 1).T
    return full


def positive_definite(graph: BodyGraph, seed: int = 0) -> FloatArray:
    """Random entries with a dominant diagonal."""
    data = np.random.default_rng(seed).uniform(-1.0, 1.0, len(graph.data))
    rows = np.abs(whole(graph, data)).sum(axis=1).reshape(-1, 3)
    for c in range(3):
        data[graph.diagonal[:, c] + c] = rows[:, c] + 1.0
    return data


def backward_error(matrix: FloatArray, x: FloatArray, right: FloatArray) -> float:
    """Largest entry of the residual over ``|A| |x| + |b|``: the change of the matrix's entries, relative, that explains it."""
    return float((np.abs(matrix @ x - right) / (np.abs(matrix) @ np.abs(x) + np.abs(right))).max())


@each_graph
def test_solutions_are_exact_to_round_off(name: str) -> None:
    """The normwise bound of Cholesky's method is a small multiple of the order of the largest front, times round-off.

    SuperLU, which shares nothing with it, finds the same solution.
    """
    graph = graph_of(name)
    data = positive_definite(graph)
    matrix = whole(graph, data)
    right = np.random.default_rng(3).normal(size=len(matrix))
    factors = SupernodalCholesky(graph.indptr, graph.indices)
    assert factors.update(data)
    x = factors.solve(right)
    assert backward_error(matrix, x, right) <= 3 * int(factors._nodes[:, BODIES].max()) * EPSILON
    # Diagonally dominant: the condition number is below a few times the number of neighbours.
    np.testing.assert_allclose(x, splu(sp.csc_matrix(matrix)).solve(right), rtol=0.0, atol=1e-12 * np.abs(x).max())


@each_graph
def test_a_pattern_is_used_again_and_again_with_the_same_bits(name: str) -> None:
    graph = graph_of(name)
    first, second = positive_definite(graph, 1), positive_definite(graph, 2)
    right = np.random.default_rng(3).normal(size=3 * graph.n_bodies)
    factors, other = (SupernodalCholesky(graph.indptr, graph.indices) for _ in range(2))
    found = []
    for data in (first, second, first, np.full_like(first, np.nan), first):
        assert factors.update(data) == bool(np.isfinite(data[0]))
        found.append(factors.solve(right))
    assert other.update(first)
    assert found[0].tobytes() == found[2].tobytes() == found[4].tobytes() == other.solve(right).tobytes()
    assert found[0].tobytes() != found[1].tobytes()


@each_graph
def test_a_matrix_that_is_not_positive_definite_is_refused(name: str) -> None:
    """Each body in turn: its diagonal block gets an eigenvalue below that of the positive definite matrix, or none at all."""
    graph = graph_of(name)
    data = positive_definite(graph)
    factors = SupernodalCholesky(graph.indptr, graph.indices)
    for body in {0, graph.n_bodies // 2, graph.n_bodies - 1}:
        for c in range(3):
            for wrong in (-1.0, 0.0, np.nan, np.inf, -np.inf):
                changed = data.copy()
                changed[graph.diagonal[body, c] + c] = wrong
                assert not factors.update(changed), (body, c, wrong)
    assert factors.update(data)


def test_entries_that_are_no_numbers_are_refused_wherever_they_are() -> None:
    graph = graph_of("disconnected")
    data = positive_definite(graph)
    factors = SupernodalCholesky(graph.indptr, graph.indices)
    for i in range(len(data)):
        for wrong in (np.nan, np.inf):
            changed = data.copy()
            changed[i] = wrong
            assert not factors.update(changed), (i, wrong)


def test_positive_definite_is_distinguished_from_indefinite_to_round_off() -> None:
    """Shifts of the spectrum by twice the round-off of the factorisation to either side of the smallest eigenvalue."""
    graph = graph_of("dense, random")
    data = positive_definite(graph)
    matrix = whole(graph, data)
    least = float(np.linalg.eigvalsh(matrix)[0])
    shift = 3 * graph.n_bodies * EPSILON * float(np.abs(matrix).sum(axis=1).max())
    factors = SupernodalCholesky(graph.indptr, graph.indices)
    for sign in (-1.0, 1.0):
        changed = data.copy()
        for c in range(3):
            changed[graph.diagonal[:, c] + c] += sign * shift - least
        assert factors.update(changed) == (sign > 0.0)


def interior_point_matrices(problem: ContactProblem, spread: float) -> tuple[BodyGraph, FloatArray]:
    """``M + H' D H`` with D as late iterations have it: contacts that stick and contacts that are open, ``10^(+-spread)``."""
    rng = np.random.default_rng(5)
    graph = BodyGraph(problem.n_bodies, problem.bodies)
    matrix = BodyMatrix(problem, graph)
    weights = 10.0 ** rng.uniform(-spread, spread, (problem.n_contacts, 2))
    mixed = rng.uniform(-0.99, 0.99, problem.n_contacts) * np.sqrt(weights.prod(axis=1))
    assert matrix.factorise(np.column_stack([weights[:, 0], mixed, weights[:, 1]]))
    return graph, graph.data


@pytest.mark.parametrize("builder", problems.BUILDERS, ids=lambda builder: builder.__name__)
def test_ill_conditioned_matrices_are_solved_with_small_backward_errors(
    builder: Callable[[np.random.Generator, int], problems.Choice],
) -> None:
    """Normwise, as the theory of Cholesky's method has it: condition numbers reach 1e16, entries of the diagonal span as much."""
    problem = problems.of_kind(builder, 100)
    graph, data = interior_point_matrices(problem, 8.0)
    matrix = whole(graph, data)
    right = np.random.default_rng(6).normal(size=len(matrix))
    x = graph.factorisation.solve(right)
    factors = graph.factorisation
    assert isinstance(factors, SupernodalCholesky)
    # Scaled to a diagonal of ones, the bound holds for the scaled norm (Demmel; Higham, Accuracy and stability, theorem 10.6).
    scale = np.sqrt(np.diag(matrix))
    residual = float(np.linalg.norm((matrix @ x - right) / scale))
    size = float(np.linalg.norm(matrix / np.outer(scale, scale), 2) * np.linalg.norm(scale * x))
    assert residual <= 3 * int(factors._nodes[:, BODIES].max()) * EPSILON * size


def wrong_place(factors: SupernodalCholesky) -> None:
    """An update's last row goes to the parent's row before."""
    nodes = factors._nodes
    tall = next(
        s
        for s in range(len(nodes) - 1)
        if nodes[s + 1, ROWS] > nodes[s, ROWS] and factors._place[nodes[s + 1, ROWS] - 1] > 0
    )
    factors._place[nodes[tall + 1, ROWS] - 1] -= 1


def forgotten_child(factors: SupernodalCholesky) -> None:
    """A front leaves out its last child: the lists of all later ones begin one child later."""
    nodes = factors._nodes
    s = next(s for s in range(len(nodes) - 1) if nodes[s + 1, CHILDREN] > nodes[s, CHILDREN])
    nodes[: s + 1, CHILDREN] += 1


def transposed_block(factors: SupernodalCholesky) -> None:
    entry = np.flatnonzero(factors._entries[:, 4] != 0)[0]
    factors._entries[entry, 4] = 3 - factors._entries[entry, 4]


@pytest.mark.parametrize("plant", [wrong_place, forgotten_child, transposed_block])
def test_defects_do_not_stay_below_the_tolerance(plant: Callable[[SupernodalCholesky], None]) -> None:
    graph = graph_of("lattice")
    data = positive_definite(graph)
    matrix = whole(graph, data)
    right = np.random.default_rng(3).normal(size=len(matrix))
    factors = SupernodalCholesky(graph.indptr, graph.indices)
    plant(factors)
    assert not factors.update(data) or backward_error(matrix, factors.solve(right), right) > 1e-6


@each_graph
def test_fronts_hold_the_factor_and_every_body_once(name: str) -> None:
    """Rows of a front ascend, pivots are each body once, and the dense factor has no entry outside of the fronts."""
    graph = graph_of(name)
    data = positive_definite(graph)
    factors = SupernodalCholesky(graph.indptr, graph.indices)
    nodes, order = factors._nodes, factors._order
    assert sorted(order) == list(range(graph.n_bodies))
    assert nodes[:-1, PIVOTS].sum() == graph.n_bodies
    unknowns = (3 * order[:, None] + np.arange(3)).ravel()
    lower = np.linalg.cholesky(whole(graph, data)[np.ix_(unknowns, unknowns)])
    n = graph.n_bodies
    filled = np.abs(lower).reshape(n, 3, n, 3).max(axis=(1, 3)) > 1e-14
    inside = np.zeros_like(filled)
    first = 0
    for s in range(len(nodes) - 1):
        pivots = np.arange(first, first + nodes[s, PIVOTS])
        rows = factors._rows[nodes[s, ROWS] : nodes[s + 1, ROWS]]
        assert len(pivots) + len(rows) == nodes[s, BODIES]
        assert (np.diff(rows) > 0).all()
        inside[np.ix_(np.concatenate([pivots, rows]), pivots)] = True
        first += int(nodes[s, PIVOTS])
    assert not (filled & ~inside).any()


def fill(n: int, edges: Edges, order: IntArray) -> int:
    """Entries of the factor's graph, by eliminating one body after another."""
    touching: list[set[int]] = [set() for _ in range(n)]
    for i, k in edges:
        touching[i].add(k)
        touching[k].add(i)
    entries = n
    for i in order.tolist():
        entries += len(touching[i])
        for k in touching[i]:
            touching[k] |= touching[i]
            touching[k] -= {i, k}
    return entries


def order_of(n: int, edges: Edges) -> IntArray:
    ends = np.array(edges)
    ends = np.concatenate([ends, ends[:, ::-1]])
    ends = ends[np.lexsort(ends.T[::-1])]
    ptr = np.concatenate([[0], np.cumsum(np.bincount(ends[:, 0], minlength=n))]).astype(np.int64)
    return elimination_order(ptr, np.ascontiguousarray(ends[:, 1]).astype(np.int64))


def test_trees_are_eliminated_without_fill() -> None:
    """Minimum degree takes leaves first: exactly an entry for each body and each edge."""
    for name in ("chain", "chain, shuffled", "star", "tree"):
        n, edges = GRAPHS[name]
        assert fill(n, edges, order_of(n, edges)) == n + len(edges)


def test_the_order_keeps_factors_as_sparse_as_the_best_known_orders_do() -> None:
    """A square lattice of m x m: nested dissection has 31/4 n log2(n) entries to leading order (George 1973), minimum degree as few;
    elimination row by row has m^3."""
    side = 40
    n, edges = side * side, lattice(side)
    found = fill(n, edges, order_of(n, edges))
    assert found <= 7.75 * n * np.log2(n) / 2.0
    assert found <= 0.4 * fill(n, edges, np.arange(n))


INTERPRETED = """
import numpy as np
from ninedisk.core.cd.solvers.factorise import factorisation
full = np.array([[5.0, 1.0, 2.0], [1.0, 6.0, 1.0], [2.0, 1.0, 7.0]])
found = factorisation(np.array([0, 1, 3, 6]), np.array([0, 0, 1, 0, 1, 2]))
assert found.update(np.array([5.0, 1.0, 6.0, 2.0, 1.0, 7.0]))
assert np.allclose(full @ found.solve(np.arange(3.0)), np.arange(3.0), rtol=0.0, atol=1e-14)
for wrong in (-1.0, np.nan):
    assert not found.update(np.array([5.0, 1.0, 6.0, 2.0, 1.0, wrong]))
"""


def test_without_compilation_another_factorisation_takes_over() -> None:
    """Planted defects are run without it: the vectors of the fronts are machine code."""
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(
        [sys.executable, "-c", INTERPRETED], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
