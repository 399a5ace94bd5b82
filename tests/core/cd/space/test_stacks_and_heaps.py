"""Many bodies: reactions of a stack, energy of a collapse, orders of bodies, moving walls, a judge's errors of each step."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from solids import FLOOR, G, on_floor, rigid, steps

from ninedisk.core import PlaneSegment, PlaneWall, Spheres, SphereScene, simulate
from ninedisk.core.cd.delassus import DelassusProblem
from ninedisk.core.cd.solvers.outcome import MatrixSolution
from ninedisk.core.cd.space import step
from ninedisk.core.cd.space.session import SpaceSession
from ninedisk.core.cd.space.step import Solved
from ninedisk.core.cd.space.walls import WallPoses, material_shift
from ninedisk.core.errors import SolverNotConvergedError
from ninedisk.references.contact_law import errors_of_forces

MIXED_HALF = [[0.5, 0.5, 0.2], [0.4, 0.3, 0.1], [0.0, 0.0, 0.0], [0.3, 0.35, 0.15]]


def heap(law: Any, seed: int = 3, count: int = 50) -> SphereScene:
    """Spheres and some boxes above a floor between two walls."""
    rng = np.random.default_rng(seed)
    x = np.array([[i, j, k] for k in range(4) for i in range(4) for j in range(4)])[:count] * 0.42 + 0.25
    n = len(x)
    box = np.arange(n) % 5 == 0
    half = np.where(box[:, None], rng.uniform(0.08, 0.11, (n, 3)), 0.0)
    radius = np.where(box, np.linalg.norm(half, axis=1) * (1.0 + 1e-13), rng.uniform(0.15, 0.2, n))
    spheres = Spheres(
        x=x + rng.uniform(-0.005, 0.005, (n, 3)),
        v=rng.normal(0.0, 0.3, (n, 3)),
        omega=rng.normal(0.0, 2.0, (n, 3)),
        radius=radius,
        half_sizes=half,
        mass=rng.uniform(0.5, 1.5, n),
    )
    scene = on_floor(law, x=[[0.0, 0.0, 9.0]], radius=1.0, mass=1.0).replace(spheres=spheres)
    sides = (((1.0, 0.0, 0.0), "left"), ((0.0, 1.0, 0.0), "back"))
    walls = tuple(PlaneWall(name=name, point=(0.0, 0.0, 0.0), normal=normal, law=law) for normal, name in sides)
    return scene.replace(walls=scene.walls + walls)


def stack() -> dict[str, Any]:
    """Two boxes, a ball and no more: the last box is on the floor, beside them."""
    return {
        "x": [[0.0, 0.0, 0.2], [0.05, 0.02, 0.5], [0.0, 0.0, 0.8], [2.0, 0.0, 0.15]],
        "half_sizes": MIXED_HALF,
        "radius": [0.8, 0.6, 0.2, 0.6],
        "mass": [3.0, 2.0, 1.0, 5.0],
    }


@pytest.mark.parametrize("sliding", ["associated", "coulomb"])
def test_each_level_of_a_stack_bears_what_is_above_it(sliding: str) -> None:
    pairs = [(0, 4), (0, 1), (1, 2), (3, 4)]
    history = simulate(on_floor(rigid(mu=0.5), **stack()), steps(0.01, 20, sliding=sliding), pairs, method="cd")
    assert history.fn[1:] == pytest.approx(np.broadcast_to(G * np.array([6.0, 3.0, 1.0, 5.0]), (20, 4)), rel=1e-7)
    assert history.wall_force[1:, 0] == pytest.approx(np.broadcast_to([0.0, 0.0, -11.0 * G], (20, 3)), abs=1e-6)
    assert np.abs(history.v).max() < 1e-8
    # The moment on the lower box is that of the load of both bodies above, where their common centre is.
    assert history.moment is not None
    assert history.moment[-1, 1] == pytest.approx(
        np.cross([(2 * 0.05) / 3, (2 * 0.02) / 3, 0.2], [0, 0, -3.0 * G]), abs=1e-6
    )


@pytest.mark.parametrize(("sliding", "impact"), [("coulomb", "theta"), ("associated", "theta"), ("coulomb", "newton")])
def test_an_inelastic_collapse_never_gains_energy_and_each_step_is_a_solution(
    sliding: Any, impact: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = heap(rigid(mu=0.3, e=0.0 if impact == "newton" else None))
    spheres_only = scene.replace(
        spheres=replace(scene.spheres, half_sizes=None, inertia=0.4 * scene.spheres.mass * scene.spheres.radius**2)
    )
    worst, noted = 0.0, SpaceSession._note

    def judge(self: SpaceSession, number: int, solved: Solved, *others: Any) -> None:
        nonlocal worst
        if solved.problem is not None:
            w, b, mu = solved.problem.w, solved.problem.b, solved.problem.mu
            worst = max(worst, errors_of_forces(w, b, mu, solved.r, associated=sliding == "associated").worst)
        noted(self, number, solved, *others)

    monkeypatch.setattr(SpaceSession, "_note", judge)
    history = simulate(spheres_only, steps(0.005, 60, sliding=sliding, impact=impact), method="cd")
    assert 0.0 < worst < 1e-6
    energy = history.energy["kinetic"] + history.energy["gravity"]
    if impact == "newton":
        energy = energy - history.energy["impact_gain"]
    assert np.diff(energy).max() <= 1e-7 * energy[0]
    assert energy[-1] < 0.8 * energy[0]


def test_problems_of_the_associated_rule_lead_to_coulombs_law(monkeypatch: pytest.MonkeyPatch) -> None:
    """The last resort of a step alone, after a solver that finds nothing: a block slides with ``v0 - mu g t``."""

    def nothing(problem: DelassusProblem, *_: Any, **__: Any) -> MatrixSolution:
        return MatrixSolution(np.zeros((problem.n_contacts, 3)), 1.0, 0, 0.0)

    monkeypatch.setattr(step, "solve_cones", nothing)
    scene = on_floor(rigid(mu=0.4), x=[[0.0, 0.0, 0.2]], half_sizes=[[0.5, 0.6, 0.2]], mass=3.0, v=[[1.2, 1.6, 0.0]])
    history = simulate(scene, steps(0.01, 3), method="cd")
    speed = 2.0 - 0.4 * G * 0.01 * np.arange(4)
    assert np.abs(history.v[:, 0] - np.outer(speed, [0.6, 0.8, 0.0])).max() < 1e-5
    with pytest.raises(SolverNotConvergedError):
        simulate(scene, steps(0.01, 3, sliding="associated"), method="cd")


def test_the_order_of_bodies_and_the_names_of_axes_do_not_matter() -> None:
    scene, numerics = heap(rigid(mu=0.3), count=20), steps(0.005, 40, options={"cd.tolerance": 1e-11})
    first = simulate(scene, numerics, method="cd")
    order = np.random.default_rng(1).permutation(20)
    bodies = {
        name: getattr(scene.spheres, name)[order]
        for name in ("x", "v", "omega", "radius", "mass", "inertia", "half_sizes")
    }
    second = simulate(scene.replace(spheres=Spheres(**bodies), walls=scene.walls[::-1]), numerics, method="cd")
    assert np.abs(second.x - first.x[:, order]).max() < 1e-6
    assert np.abs(second.v - first.v[:, order]).max() < 1e-5


def test_the_same_run_has_the_same_bits_and_a_copy_goes_on() -> None:
    import copy

    scene, numerics = heap(rigid(mu=0.3), count=20), steps(0.005, 20)
    one, session = simulate(scene, numerics, method="cd"), SpaceSession(scene, numerics)
    for _ in range(7):
        session._take_step()
    for each in (copy.deepcopy(session), session):
        again = each.run()
        assert again.x[-1].tobytes() == one.x[-1].tobytes()
        assert again.omega[-1].tobytes() == one.omega[-1].tobytes()


def test_a_floor_that_moves_carries_a_box_and_does_work_on_it() -> None:
    """Lifted at w and pushed along at s: the box follows in one step, and energy grows by the walls' work less the impact's loss."""
    move = PlaneSegment(velocity=(0.3, 0.1, 0.5))
    law = rigid(mu=2.0)
    floor = PlaneWall(**FLOOR, law=law, motion=(move,))  # type: ignore[arg-type]
    scene = on_floor(law, x=[[0.1, 0.2, 0.2]], half_sizes=[[0.5, 0.6, 0.2]], mass=3.0).replace(walls=(floor,))
    history = simulate(scene, steps(0.01, 20), [(0, 1)], method="cd")
    assert np.abs(history.v[1:, 0] - [0.3, 0.1, 0.5]).max() < 1e-8
    assert np.abs(history.gap[1:]).max() < 1e-10
    work = history.energy["wall_work"]
    assert np.diff(work)[1:] == pytest.approx(3.0 * G * 0.5 * 0.01, rel=1e-6)
    first = (3.0 * np.array([0.3, 0.1, 0.5]) / 0.01 + [0.0, 0.0, 3.0 * G]) @ [0.3, 0.1, 0.5] * 0.01
    assert work[1] == pytest.approx(first, rel=1e-6)


def test_the_material_of_a_wall_moves_with_its_turn() -> None:
    """A turn about the wall's own normal moves its material along the surface, which no normal shows."""
    segment = PlaneSegment(angular_velocity=(0.0, 0.0, 2.0), pivot=(1.0, 0.0, 0.0), velocity=(0.5, 0.0, 0.0))
    poses = WallPoses([PlaneWall(**FLOOR, law=rigid(), motion=(segment,))])  # type: ignore[arg-type]
    place = np.array([[1.05, 0.7, 0.0], [1.05, 0.0, 0.0]])
    shift = material_shift(place, np.zeros(2, dtype=np.int64), poses.at(0.0), poses.at(0.1))
    # The pivot has moved by 0.05; a point at the distance 0.7 from it comes from where the turn by 0.2 back leads.
    from_arm = 0.7 * np.array([np.sin(0.2), np.cos(0.2), 0.0])
    assert shift[0] == pytest.approx(np.array([0.05, 0.7, 0.0]) - from_arm, abs=1e-14)
    assert shift[1] == pytest.approx([0.05, 0.0, 0.0], abs=1e-14)
