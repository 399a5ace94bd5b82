"""Elastic contact dynamics on the nine disks: its own recurrence, the DEM as the limit, steps beyond stability, statics."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest

from ninedisk.core.cd.session import CdSession
from ninedisk.core.dem.critical import critical_time_step
from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall, WallSegment
from ninedisk.core.simulate import simulate
from ninedisk.references.exact_steps.cd_row import smooth_row_cd

KN, RADIUS, DENSITY, SPEED, DT, LOAD = 1.35e9, 50.0, 1000.0, 0.12, 0.01525, 40
ANGLE = 0.003
MASS = DENSITY * math.pi * RADIUS**2
WATCH = ((3, 4), (0, 1), (3, 9), (0, 9))
STEADY = KN * SPEED * LOAD * DT / 2.0


def box(*, mu: float, wall_mu: float, xi: float, turn: float = 0.0, rest: float = 0.0, slow: float = 1.0) -> Scene:
    """Walls move in for LOAD steps; after ``rest`` [s] the side walls turn about mid-height, for 0.003 rad / turn."""
    disk_law = ContactLaw(kn=KN, ks=KN, mu=mu)
    wall_law = ContactLaw(kn=KN, ks=KN, mu=wall_mu)
    walls = []
    for name, point, nx, ny in (
        ("left", (0, 0), 1, 0),
        ("right", (300, 0), -1, 0),
        ("bottom", (0, 0), 0, 1),
        ("top", (0, 300), 0, -1),
    ):
        motion = [WallSegment(duration=LOAD * DT * slow, velocity=(SPEED / slow * nx, SPEED / slow * ny))]
        if turn:
            inset = SPEED * LOAD * DT
            pivot = (inset if nx > 0 else 300.0 - inset, 150.0)
            motion.append(WallSegment(duration=rest))
            motion.append(
                WallSegment(duration=ANGLE / turn, angular_velocity=-turn, pivot=pivot)
                if nx
                else WallSegment(duration=ANGLE / turn)
            )
        walls.append(Wall(name=name, point=point, normal=(nx, ny), law=wall_law, motion=tuple(motion)))
    x = [[RADIUS * (1 + 2 * i), RADIUS * (1 + 2 * j)] for j in range(3) for i in range(3)]
    return Scene(disks=Disks(x=x, radius=RADIUS, mass=MASS), disk_disk=disk_law, walls=tuple(walls), xi=xi)


def run(scene: Scene, method: Any = "cd", **numerics: Any) -> History:
    given = {"dt": DT, "n_steps": 200, **numerics}
    return simulate(scene, Numerics(**given), WATCH, method=method)


@pytest.mark.parametrize(
    ("solver", "theta", "xi"),
    [
        *itertools.product(["auto"], [0.5, 0.75, 1.0], [0.0, 3.0]),
        ("interior-point", 0.75, 3.0),
        ("gauss-seidel", 0.75, 3.0),
    ],
)
def test_smooth_rows_follow_their_recurrence(solver: str, theta: float, xi: float) -> None:
    """To 1e-10 of the largest force: 200 solves to 1e-12, and kn times the rounding of positions near 300 m, 1e-12 a step."""
    history = run(box(mu=0.3, wall_mu=0.0, xi=xi), theta=theta, solver=solver)
    rows = smooth_row_cd(kn=KN, mass=MASS, xi=xi, dt=DT, n_load=LOAD, v_wall=SPEED, n_steps=200, theta=theta)
    for column in range(4):
        expected = rows[0 if column < 2 else 1]
        assert np.abs(history.fn[:, column] - expected).max() <= 1e-10 * expected.max()
    assert np.abs(history.fs).max() <= 1e-9 * STEADY


def test_a_planted_defect_is_seen() -> None:
    """Force at the start of the step instead of its end, theta off by 1e-6: both leave the recurrence."""
    history = run(box(mu=0.0, wall_mu=0.0, xi=3.0), theta=0.5)
    off = smooth_row_cd(kn=KN, mass=MASS, xi=3.0, dt=DT, n_load=LOAD, v_wall=SPEED, n_steps=200, theta=0.5 + 1e-6)
    assert np.abs(history.fn[:, 0] - off[0]).max() > 1e-8 * off[0].max()
    assert np.abs(history.fn[1:, 0] - off[0][:-1]).max() > 1e-3 * off[0].max()


@pytest.mark.parametrize("sliding", ["associated", "coulomb"])
@pytest.mark.parametrize("wall_mu", [0.0, 0.2])
def test_tends_to_the_dem_at_first_order(wall_mu: float, sliding: str) -> None:
    """Halved steps halve the distance to a fine explicit run; under friction too, for both rules."""
    scene = box(mu=0.2, wall_mu=wall_mu, xi=3.0)
    fine = run(scene, "dem", contact_dt=DT / 64)
    errors = []
    for k in (16, 32, 64):
        history = run(scene, contact_dt=DT / k, theta=0.5, sliding=sliding, n_steps=100)
        errors.append(float(np.abs(history.fn - fine.fn[:101]).max()) / STEADY)
    orders = [math.log2(a / b) for a, b in itertools.pairwise(errors)]
    assert min(orders) > 0.8, (errors, orders)
    assert max(orders) < 1.2, (errors, orders)
    assert errors[-1] < 0.03


@pytest.mark.parametrize("factor", [10.0, 100.0, 1000.0])
def test_settles_far_beyond_the_explicit_limit(factor: float) -> None:
    """theta = 1: settled force to 1e-8 within 50 steps after the walls have stopped."""
    scene = box(mu=0.0, wall_mu=0.0, xi=3.0)
    dt = factor * critical_time_step(scene)
    steps = math.ceil(LOAD * DT / dt) + 50
    history = run(scene, dt=dt, n_steps=steps, theta=1.0)
    assert np.abs(history.fn[-1] / STEADY - 1.0).max() <= 1e-8


def test_static_compression_and_the_gear_mode() -> None:
    """Equilibrium in every step; between smooth walls the disks can turn against each other, and the run says so."""
    session = CdSession(box(mu=0.3, wall_mu=0.0, xi=3.0), Numerics(dt=DT, n_steps=60, regime="quasi-static"), WATCH)
    history = session.run()
    way = SPEED * DT * np.minimum(history.step, LOAD)
    assert np.abs(history.fn - 0.5 * KN * way[:, None]).max() <= 1e-9 * STEADY
    assert np.abs(history.angle).max() < 1e-12
    assert session.remarks[0].startswith("1 displacement mode(s) without energy")


@pytest.mark.long
def test_static_distortion_is_the_limit_of_slow_walls() -> None:
    """DEM with ever slower walls against the static curve (Coulomb, 100 increments), after the start-up of the distortion.

    The walls' speed enters through global damping, hence at first order: a quarter of the speed has to leave less than a third
    of the distance. Static increments are of first order too, but so small that they stay below what is compared.
    """

    def distortion(method: str, slow: float, increments: int, **numerics: Any) -> np.ndarray:
        turn, rest = ANGLE / slow, 4.0
        begin, dt = LOAD * DT + rest, slow / increments
        steps = round((begin + slow) / dt)
        history = run(box(mu=0.3, wall_mu=0.0, xi=3.0, turn=turn, rest=rest), method, dt=dt, n_steps=steps, **numerics)
        turned = (history.t - begin) / slow
        return np.array([np.interp(np.linspace(0.3, 1.0, 100), turned, history.fn[:, k]) for k in range(4)]) / STEADY

    static = distortion("cd", 16.0, 100, regime="quasi-static", sliding="coulomb")
    distances = [float(np.abs(distortion("dem", slow, 200) - static).max()) for slow in (4.0, 16.0, 64.0)]
    ratios = [a / b for a, b in itertools.pairwise(distances)]
    assert min(ratios) > 3.0, (distances, ratios)
    assert distances[-1] < 0.01
    associated = [float(np.abs(distortion("cd", 16.0, n, regime="quasi-static") - static).max()) for n in (25, 50, 100)]
    orders = [math.log2(a / b) for a, b in itertools.pairwise(associated)]
    assert min(orders) > 0.8, (associated, orders)
