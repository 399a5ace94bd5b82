"""Contacts that contradict each other are found by every solver, and no others are accused."""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter

import numpy as np
import problems
import pytest
from methods import Solve, each_solver
from numpy.typing import NDArray
from problems import FLOOR, LEFT, RIGHT, ROOF

from ninedisk.core.cd.problem import ContactProblem
from ninedisk.core.cd.solvers.feasibility import InfeasibleContactsError, check_feasible

FloatArray = NDArray[np.float64]


def squeezed(x: FloatArray, walls: tuple[tuple[float, float], ...], by: float, mu: float = 0.3) -> ContactProblem:
    """Rigid disks of radius 1/2 at ``x`` that exactly fill the room between walls, all of which close in by ``by``."""
    packing = problems.pack(x, np.full(len(x), 0.5), 0.01, walls)
    c = len(packing.bodies)
    offset = np.zeros((c, 2))
    offset[packing.bodies[:, 1] < 0, 0] = -by
    return ContactProblem(
        mass=packing.mass,
        force=np.random.default_rng(1).normal(0.0, 1.0, packing.mass.shape),
        bodies=packing.bodies,
        normal=packing.normal,
        arms=packing.arms,
        offset=offset,
        mu=np.full(c, mu),
    )


def refusal(solve: Solve, problem: ContactProblem) -> InfeasibleContactsError:
    """The error of a second try, which comes at once: the first may have to compile kernels, which takes a minute."""
    for _ in range(2):
        begin = perf_counter()
        with pytest.raises(InfeasibleContactsError, match="squeeze") as error:
            solve(problem)
    assert perf_counter() - begin < 10.0
    return error.value


@each_solver
@pytest.mark.parametrize("by", [1.0, 1e-6])
@pytest.mark.parametrize("mu", [0.0, 0.3, 2.0])
def test_a_squeezed_rigid_disk_is_a_contradiction(solve: Solve, by: float, mu: float) -> None:
    problem = squeezed(problems.lattice(1, 1), (LEFT, RIGHT), by, mu)
    assert sorted(refusal(solve, problem).contacts) == [0, 1]


@each_solver
def test_one_squeezed_row_is_found_in_a_lattice(solve: Solve) -> None:
    """Only the contacts of the row are accused: 10 disks and the two walls, of which one closes in on that row alone."""
    problem = squeezed(problems.lattice(10, 10), (LEFT, RIGHT, FLOOR), 0.0)
    offset = np.array(problem.offset)
    at_wall = np.flatnonzero((problem.bodies[:, 0] == 40) & (problem.bodies[:, 1] < 0))
    offset[at_wall, 0] = -0.01
    error = refusal(solve, replace(problem, offset=offset))
    assert "11 of them squeeze" in str(error)
    accused = set(problem.bodies[list(error.contacts)].ravel().tolist())
    assert accused <= set(range(40, 50)) | {-1}


def test_nobody_is_accused_without_proof() -> None:
    """All problems can be satisfied, even those where every wall is tight; so can a squeeze with room, with compliance, or by round-off."""
    for index in range(0, problems.COUNT, 3):
        check_feasible(problems.problem(index), seconds=5.0)
    tight = squeezed(problems.lattice(4, 4), (LEFT, RIGHT, FLOOR, ROOF), 1e-3)
    with pytest.raises(InfeasibleContactsError):
        check_feasible(tight)
    check_feasible(squeezed(problems.lattice(4, 4), (LEFT, RIGHT, FLOOR, ROOF), 0.0))
    check_feasible(squeezed(problems.lattice(4, 4), (LEFT, FLOOR), 1e-3))
    check_feasible(squeezed(problems.lattice(4, 4), (LEFT, RIGHT, FLOOR, ROOF), 1e-15))
    check_feasible(replace(tight, resolution=1e-2))
    check_feasible(replace(tight, compliance=np.full((tight.n_contacts, 2), 1e-9)))


def test_sliding_walls_contradict_the_associated_rule_but_not_coulombs_law() -> None:
    """Between walls without room that slide in opposite senses a held-back disk would have to dilate; Coulomb's need not."""
    still = squeezed(problems.lattice(1, 1), (LEFT, RIGHT), 0.0)
    problem = replace(still, mass=[[1.0, 1.0, np.inf]], offset=[[0.0, 1.0], [0.0, 1.0]], force=[[0.0, -1.0, 0.0]])
    with pytest.raises(InfeasibleContactsError):
        check_feasible(problem)
    check_feasible(problem, sliding="coulomb")
    closing = replace(problem, offset=[[-1e-3, 1.0], [-1e-3, 1.0]])
    with pytest.raises(InfeasibleContactsError):
        check_feasible(closing, sliding="coulomb")
