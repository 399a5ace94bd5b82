"""The DEM of spheres: closed forms, a plain twin of all its options, balances, and what it refuses."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from sphere_twin import Twin, rotation

from ninedisk.core import (
    BehindWallError,
    CoreError,
    Elastic,
    History,
    Numerics,
    PlaneSegment,
    PlaneWall,
    Rolling,
    SphereLaw,
    Spheres,
    SphereScene,
    UnstableTimeStepError,
    damping_ratio,
    moduli,
    simulate,
)

GLASS, LIME = Elastic(E=4.8e10, nu=0.20), Elastic(E=2e10, nu=0.25)
SPRING = Rolling(model="elastic-plastic", mu=0.1, kr=40.0, beta=0.3)
CONSTANT = Rolling(model="constant", mu=0.05)
LINEAR = SphereLaw(kn=1e5, ks=6e4, mu=0.4, beta=0.1)
HERTZ = SphereLaw(e_star=2e7, g_star=7e6, mu=0.4, beta=0.1)


def head_on(density: float, law: SphereLaw, dt: float, steps: int, speed: float = 10.0) -> History:
    radius = 0.01
    mass = 4.0 / 3.0 * np.pi * radius**3 * density
    spheres = Spheres(x=[[-radius, 0, 0], [radius, 0, 0]], radius=radius, mass=mass, v=[[speed, 0, 0], [-speed, 0, 0]])
    return simulate(
        SphereScene(spheres=spheres, sphere_sphere=law), Numerics(dt=dt, n_steps=steps, contact_dt=dt), [(0, 1)]
    )


@pytest.mark.parametrize(
    ("material", "density", "force", "depth", "duration"),
    [(GLASS, 2800.0, 10696.9, 274.11e-6, 40.34e-6), (LIME, 2500.0, 7108.2, 368.30e-6, 54.20e-6)],
)
def test_hertz_meets_its_closed_forms_in_second_order(
    material: Elastic, density: float, force: float, depth: float, duration: float
) -> None:
    """Chung & Ooi's first test; their numbers have five digits, the closed forms all."""
    e_star, _ = moduli(material, material)
    mass, reduced = 0.5 * 4.0 / 3.0 * np.pi * 1e-6 * density, 0.005
    deep = (15.0 * mass * 20.0**2 / (16.0 * e_star * np.sqrt(reduced))) ** 0.4
    most = 4.0 / 3.0 * e_star * np.sqrt(reduced) * deep**1.5
    assert (most, deep) == (pytest.approx(force, rel=1e-4), pytest.approx(depth, rel=1e-4))
    errors = []
    for steps in (100, 200, 400):
        history = head_on(density, SphereLaw(e_star=e_star), duration / steps, steps + 3)
        assert history.gap[-1, 0] > 0.0
        # A parabola through the highest sample and its neighbours: the peak lies between samples.
        k = int(np.argmax(history.fn[:, 0]))
        left, top, right = history.fn[k - 1 : k + 2, 0]
        errors.append(abs(top + (right - left) ** 2 / (8.0 * (2.0 * top - left - right)) - most) / most)
        assert history.v[-1, 1, 0] == pytest.approx(10.0, rel=2.0 / steps**2)
    assert errors[0] < 2e-4
    assert errors[0] / errors[2] > 10.0, errors


@pytest.mark.parametrize(("law", "e"), product((SphereLaw(kn=1e6), SphereLaw(e_star=5e9)), (0.9, 0.5)))
def test_dashpots_rebound_with_the_wanted_restitution(law: SphereLaw, e: float) -> None:
    """Where the dashpot may pull until the overlap is gone. Entry and exit fall anywhere in a step: a share of omega dt, first order."""
    damped, omega = replace(law, beta=damping_ratio(e)), 1.4e4
    for dt in (4e-8, 1e-8):
        assert _rebound(damped, dt) == pytest.approx(e, abs=0.3 * omega * dt)


def _rebound(law: SphereLaw, dt: float) -> float:
    steps = round(6e-4 / dt)
    radius = 0.01
    spheres = Spheres(x=[[0, 0, 0], [0, 2 * radius, 0]], radius=radius, mass=0.01, v=[[0, 5, 0], [0, -5, 0]])
    scene = SphereScene(spheres=spheres, sphere_sphere=law)
    history = simulate(scene, Numerics(dt=dt, n_steps=steps, contact_dt=dt, sample_every=steps))
    return float(-history.v[-1, 0, 1] / 5.0)


def box(law: SphereLaw, *, motion: tuple[PlaneSegment, ...] = (), **changes: Any) -> SphereScene:
    """A dozen spheres of three sizes thrown into a corner of a floor that moves and two walls, two of them tied in some way."""
    rng = np.random.default_rng(7)
    grid = np.array(list(product((0.055, 0.14, 0.225), (0.055, 0.14), (0.05, 0.135))))
    n = len(grid)
    held = np.zeros((n, 3), dtype=bool)
    held[1], held[2, 0] = True, True
    rotating = np.arange(n) > 2
    v = rng.normal(0.0, 0.5, (n, 3)) - [0.5, 0.4, 1.0]
    v[1], omega = 0.0, rng.normal(0.0, 8.0, (n, 3))
    omega[1] = 0.0
    spheres = Spheres(
        x=grid + rng.uniform(-0.004, 0.004, (n, 3)), radius=rng.uniform(0.04, 0.046, n), mass=rng.uniform(0.2, 0.6, n), v=v, omega=omega,
        held=held, rotating=rotating, material=["steel" if k % 2 else "glass" for k in range(n)],
    )  # fmt: skip
    walls = tuple(
        PlaneWall(
            name=name,
            point=(0.0, 0.0, 0.0),
            normal=normal,
            law=law,
            motion=motion if name == "floor" else (),
            material="wood",
        )
        for name, normal in (("floor", (0.0, 0.1, 1.0)), ("left", (1.0, 0.0, 0.0)), ("front", (0.0, 1.0, 0.0)))
    )
    scene = SphereScene(
        spheres=spheres,
        sphere_sphere=law,
        walls=walls,
        gravity=(0.3, 0.0, -9.81),
        laws={("glass", "steel"): replace(law, mu=0.2, beta=0.05)},
    )
    return replace(scene, **changes)


TURNS = (
    PlaneSegment(
        angular_velocity=(0.2, -0.1, 3.0),
        pivot=(0.1, 0.1, -0.02),
        amplitude=(0.004, 0.0, 0.003),
        frequency=40.0,
        phase=0.3,
    ),
)
OPTIONS = {
    "linear, end": replace(LINEAR, slip_at="end"),
    "linear, middle, arms of LAMMPS": replace(LINEAR, lever_arm="torque-overlap"),
    "linear, springs against rolling and twisting": replace(LINEAR, rolling=SPRING, twisting=replace(SPRING, mu=0.04)),
    "linear, constant torques": replace(LINEAR, rolling=CONSTANT, twisting=CONSTANT, slip_at="end"),
    "Hertz, keeps force": HERTZ,
    "Hertz, keeps displacement": replace(HERTZ, unloading="none", slip_at="end", lever_arm="overlap"),
    "Hertz, shrinks": replace(HERTZ, unloading="rescale", lever_arm="torque-overlap"),
    "Hertz, pull-off": replace(HERTZ, surface_energy=2.0, rolling=SPRING),
}


@pytest.mark.parametrize("name", OPTIONS)
@pytest.mark.parametrize("damping_form", ["central", "lagged"])
def test_plain_twin(name: str, damping_form: Any) -> None:
    """Two programs of one scheme: rounding, grown by some collisions, of places of 0.1 m and velocities of 1 m/s."""
    scene, dt, steps = box(OPTIONS[name], motion=TURNS), 2e-5, 1000
    n = len(scene.spheres)
    pairs = [(i, j) for i in range(n) for j in range(i + 1, n + 3)]
    numerics = Numerics(
        dt=dt, n_steps=steps, contact_dt=dt, sample_every=200, damping_form=damping_form, allow_unstable=True
    )
    history = simulate(scene, numerics, pairs)
    twin = Twin(scene, dt, central=damping_form == "central")
    touched: set[tuple[int, int]] = set()
    for _ in range(steps):
        twin.advance()
        touched |= set(twin.memory)
    assert len(touched) >= 15
    np.testing.assert_allclose(history.x[-1], twin.x, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(
        history.v[-1],
        twin.v + 0.5 * dt * twin.force / scene.spheres.mass[:, None] * ~scene.spheres.held,
        rtol=0.0,
        atol=1e-9,
    )
    scale = max(twin.fn.values())
    for column, pair in enumerate(pairs):
        if not (scene.spheres.fixed[pair[0]] and (pair[1] >= n or scene.spheres.fixed[pair[1]])):
            assert history.fn[-1, column] == pytest.approx(twin.fn[pair], abs=1e-8 * scale)
            np.testing.assert_allclose(history.fs[-1, column], twin.fs[pair], atol=1e-8 * scale)


def free_cloud(law: SphereLaw) -> SphereScene:
    scene = box(law)
    spheres = replace(
        scene.spheres, held=False, rotating=True, inertia=0.4 * scene.spheres.mass * scene.spheres.radius**2
    )
    return replace(scene, spheres=spheres, walls=(), gravity=(0.0, 0.0, 0.0), laws={})


@pytest.mark.parametrize("law", [LINEAR, replace(HERTZ, unloading="rescale")])
def test_momentum_and_angular_momentum_stay(law: SphereLaw) -> None:
    """Forces act in pairs at one point where the arms end in the middle of the overlap."""
    scene = free_cloud(replace(law, lever_arm="overlap"))
    history = simulate(scene, Numerics(dt=2e-5, n_steps=1000, contact_dt=2e-5, sample_every=100, allow_unstable=True))
    mass, inertia = scene.spheres.mass[:, None], scene.spheres.inertia[:, None]
    p = np.sum(mass * history.v, axis=1)
    spin = np.sum(mass * np.cross(history.x, history.v) + inertia * history.omega, axis=1)
    assert not np.allclose(history.v[-1], history.v[0])
    np.testing.assert_allclose(p, np.broadcast_to(p[0], p.shape), atol=1e-12)
    np.testing.assert_allclose(spin, np.broadcast_to(spin[0], spin.shape), atol=1e-12)


def test_a_turned_scene_runs_the_same() -> None:
    """Any axis; rounding, grown by some collisions."""
    turn = rotation(np.array([0.6, 0.0, 0.8]), 1.1)
    scene = free_cloud(replace(HERTZ, rolling=SPRING, twisting=CONSTANT))
    rows = {name: getattr(scene.spheres, name) @ turn.T for name in ("x", "v", "omega")}
    numerics = Numerics(dt=2e-5, n_steps=600, contact_dt=2e-5, sample_every=600, allow_unstable=True)
    one, two = simulate(scene, numerics), simulate(replace(scene, spheres=replace(scene.spheres, **rows)), numerics)
    np.testing.assert_allclose(two.x[-1], one.x[-1] @ turn.T, rtol=0.0, atol=1e-11)
    np.testing.assert_allclose(two.omega[-1], one.omega[-1] @ turn.T, rtol=0.0, atol=1e-7)


def test_bits_do_not_depend_on_threads_and_on_how_the_run_is_cut() -> None:
    from ninedisk.core.spheres.session import SphereSession

    scene, numerics = box(HERTZ), Numerics(dt=1e-4, n_steps=40, contact_dt=2e-5, allow_unstable=True)
    whole = simulate(scene, numerics, threads=3)
    session = SphereSession(scene, numerics)
    for steps in (1, 7, 2, 30):
        session.advance(steps)
    assert np.array_equal(session.run().x, whole.x)
    assert np.array_equal(simulate(scene, numerics, particles=[3, 1]).v, whole.v[:, [3, 1]])


def test_a_closed_path_of_contacts_leaves_no_shear() -> None:
    """The floor goes deeper while it tilts, and back: slip of mid-step leaves rounding, that of the step's end first order."""
    end = [_ratchet("end", dt) for dt in (4e-4, 2e-4)]
    assert _ratchet("middle", 4e-4) < 1e-14
    assert end[0] / end[1] == pytest.approx(2.0, rel=1e-3)


def _ratchet(rule: Any, dt: float) -> float:
    """Shear force that is left after a floor has pressed deeper while it tilts, and come back on the same path, over the largest fn."""
    law = SphereLaw(kn=1e4, ks=8e3, mu=10.0, slip_at=rule)
    go = PlaneSegment(velocity=(0, 0, 0.1), angular_velocity=(0, 5, 0), pivot=(0, 0, 0.1), duration=0.02)
    back = PlaneSegment(velocity=(0, 0, -0.1), angular_velocity=(0, -5, 0), pivot=(0, 0, 0.102), duration=0.02)
    floor = PlaneWall(name="floor", point=(0, 0, 0), normal=(0, 0, 1), law=law, motion=(go, back))
    spheres = Spheres(x=[[0.03, 0.0, 0.09]], radius=0.1, mass=1.0, held=True, rotating=False, v=[[0, 0, 1e-300]])
    scene = SphereScene(spheres=spheres, sphere_sphere=law, walls=(floor,))
    history = simulate(scene, Numerics(dt=dt, n_steps=round(0.04 / dt), contact_dt=dt, allow_unstable=True), [(0, 1)])
    return float(np.linalg.norm(history.fs[-1, 0]) / history.fn.max())


def test_scenes_and_laws_survive_json() -> None:
    scene = box(OPTIONS["linear, springs against rolling and twisting"], motion=TURNS)
    assert SphereScene.from_dict(scene.to_dict()) == scene


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: SphereLaw(), "give kn for the linear law, or e_star"),
        (lambda: SphereLaw(kn=1.0, e_star=1.0), "give kn for the linear law, or e_star"),
        (lambda: SphereLaw(kn=1.0, g_star=1.0), "g_star = 1 is not allowed in the linear law"),
        (lambda: SphereLaw(e_star=1.0, ks=1.0), "ks = 1 is not allowed in the Hertz-Mindlin law"),
        (lambda: SphereLaw(kn=1.0, rolling=Rolling(model="viscous", mu=0.1)), "'viscous' is not allowed for spheres"),
        (lambda: Elastic(E=1.0, nu=0.6), r"nu = 0.6 is not allowed: it must be a number in \[0, 0.5\]"),
        (lambda: Spheres(x=[[0, 0]], radius=1.0, mass=1.0), r"spheres.x has shape \(1, 2\); it must have shape \(n, 3\)"),
        (lambda: Spheres(x=[[0, 0, 0]], radius=-1.0, mass=1.0), r"spheres.radius\[0\] = -1 is not allowed"),
        (lambda: PlaneWall(name="w", point=(0, 0, 0), normal=(0, 0, 0), law=LINEAR), "zero normal"),
        (lambda: PlaneSegment(duration=-1.0), "segment duration = -1.0 is not allowed"),
        (lambda: simulate(box(replace(HERTZ, surface="jkr", surface_energy=1.0)), Numerics(dt=1e-5, n_steps=1)), "'jkr' is not allowed"),
        (lambda: simulate(box(LINEAR), Numerics(dt=1e-5, n_steps=1), method="cd"), "method = 'cd' is not allowed for spheres"),
    ],
)  # fmt: skip
def test_bad_input_names_the_value_and_the_way_out(make: Any, words: str) -> None:
    with pytest.raises(CoreError, match=words):
        make()


def test_too_long_a_step_and_a_sphere_behind_a_wall_are_named() -> None:
    with pytest.raises(UnstableTimeStepError, match="exceeds the critical step"):
        simulate(box(LINEAR), Numerics(dt=0.1, n_steps=1, contact_dt=0.1))
    fast = replace(box(LINEAR), gravity=(0.0, 0.0, -1e7))
    with pytest.raises(BehindWallError, match="behind wall 'floor'"):
        simulate(fast, Numerics(dt=1e-4, n_steps=100, contact_dt=1e-4, allow_unstable=True))
