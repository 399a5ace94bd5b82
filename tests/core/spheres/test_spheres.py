"""The DEM of spheres: balances, objectivity, closed paths, and what it refuses."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from twin import rotation

from ninedisk.core import (
    BehindWallError,
    CoreError,
    Elastic,
    Numerics,
    PlaneSegment,
    PlaneWall,
    Rolling,
    SphereLaw,
    Spheres,
    SphereScene,
    UnstableTimeStepError,
    simulate,
)
from ninedisk.core.dem.space import session as sessions
from ninedisk.core.dem.space.session import SphereSession
from ninedisk.core.dem.space.step_kernels import BATCH, Plan
from ninedisk.core.history import History

SPRING = Rolling(model="elastic-plastic", mu=0.1, kr=40.0, beta=0.3)
CONSTANT = Rolling(model="constant", mu=0.05)
LINEAR = SphereLaw(kn=1e5, ks=6e4, mu=0.4, beta=0.1)
HERTZ = SphereLaw(e_star=2e7, g_star=7e6, mu=0.4, beta=0.1)


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


@pytest.fixture
def column(monkeypatch: pytest.MonkeyPatch) -> SphereScene:
    """A column of many layers, thrown about, that runs in order: lists are made anew on the way, spheres change their order."""
    monkeypatch.setattr(sessions, "SORT_FROM", 1)
    rng = np.random.default_rng(2)
    x = 0.09 * np.array(list(product(range(4), range(4), range(40)))) + 0.05
    spheres = Spheres(x=x, v=rng.normal(0.0, 1.0, x.shape), radius=rng.uniform(0.04, 0.048, len(x)), mass=0.3)
    return SphereScene(spheres=spheres, sphere_sphere=HERTZ, walls=box(HERTZ).walls, gravity=(0.3, 0.0, -9.81))


THROWN = Numerics(dt=4e-4, n_steps=60, contact_dt=2e-5, sample_every=60, allow_unstable=True, energy_budget=True)


def assert_same_bits(found: History, exact: History) -> None:
    for name in ("x", "v", "omega", "angle", "wall_force"):
        np.testing.assert_array_equal(getattr(found, name), getattr(exact, name))
    for name, values in exact.energy.items():
        assert found.energy[name][-1] == values[-1], name


@pytest.mark.long
def test_bits_do_not_depend_on_threads_and_on_how_the_run_is_cut(tmp_path: Path, column: SphereScene) -> None:
    whole = SphereSession(column, THROWN)
    assert np.count_nonzero(np.diff(whole._batch.stripe)) >= 4
    exact = whole.run()
    assert whole.counts.rebuilds > 3
    assert whole.counts.contacts > 100
    assert np.any(whole._state.name[1:] < whole._state.name[:-1])
    for threads in (2, 3):
        session = SphereSession(column, THROWN, threads=threads)
        for steps in (1, 7, 2, 30):
            session.advance(steps)
        session.save(tmp_path / "half.npz")
        for found in (session.run(), SphereSession.load(tmp_path / "half.npz", threads=4 - threads).run()):
            assert_same_bits(found, exact)
    assert np.array_equal(simulate(column, THROWN, particles=[3, 1]).v, exact.v[:, [3, 1]])


@pytest.mark.long
def test_bits_do_not_depend_on_how_many_steps_go_at_once(column: SphereScene, monkeypatch: pytest.MonkeyPatch) -> None:
    """Singly, eight at a time, and those by threes through the stripes; light spheres that heavy ones hit are not foreseen."""
    light = np.where(np.arange(640) % 5 == 0, 5e-4, 0.3)
    hit = replace(column.spheres, v=5.0 * column.spheres.v, mass=light, inertia=0.4 * light * column.spheres.radius**2)
    returns: list[SphereSession] = []
    back = SphereSession._return
    monkeypatch.setattr(SphereSession, "_return", lambda session: (returns.append(session), back(session)))

    def run(scene: SphereScene, threads: int, most: int, front: int) -> History:
        monkeypatch.setattr(
            sessions, "Plan", lambda target, at_once, _, block: Plan(target, min(at_once, most), front, block)
        )
        return SphereSession(scene, THROWN.replace(n_steps=20), threads=threads).run()

    for scene in (column, replace(column, spheres=hit)):
        exact = run(scene, 1, 1, 1)
        assert not returns
        for threads, front in ((1, 1), (1, 3), (2, 3), (3, 1)):
            assert_same_bits(run(scene, threads, BATCH, front), exact)
    assert returns


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


def facing(gap: float) -> SphereScene:
    """A floor and a roof that face each other, and no sphere."""
    law = SphereLaw(kn=1.0)
    walls = tuple(
        PlaneWall(name=name, point=(0, 0, z), normal=(0, 0, up), law=law)
        for name, z, up in (("floor", 0.0, 1.0), ("roof", gap, -1.0))
    )
    return SphereScene(spheres=Spheres(x=np.zeros((0, 3)), radius=1.0, mass=1.0), sphere_sphere=law, walls=walls)


def test_scenes_and_laws_survive_json() -> None:
    turns = PlaneSegment(angular_velocity=(0, 0, 3), pivot=(0.1, 0, 0), amplitude=(0.1, 0, 0), frequency=2.0)
    scene = box(replace(LINEAR, rolling=SPRING, twisting=CONSTANT), motion=(turns,))
    assert SphereScene.from_dict(scene.to_dict()) == scene


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: SphereLaw(), "give kn for the linear law, or e_star"),
        (lambda: SphereLaw(kn=1.0, e_star=1.0), "give kn for the linear law, or e_star"),
        (lambda: SphereLaw(kn=1.0, g_star=1.0), "g_star = 1 is not allowed in the linear law"),
        (lambda: SphereLaw(e_star=1.0, ks=1.0), "ks = 1 is not allowed in the Hertz-Mindlin law"),
        (lambda: box(SphereLaw(kn=1.0, twisting=Rolling(model="viscous", mu=0.1))), "twisting model 'viscous' is not allowed"),
        (lambda: facing(gap=-0.1), "walls 'floor' and 'roof' overlap"),
        (lambda: box(SphereLaw(kn=1.0, adhesion=0.1)), "adhesion = 0.1 is not allowed in 3D, which does not have it"),
        (lambda: Elastic(E=1.0, nu=0.6), r"nu = 0.6 is not allowed: it must be a number in \[0, 0.5\]"),
        (lambda: Spheres(x=[[0, 0]], radius=1.0, mass=1.0), r"spheres.x has shape \(1, 2\); it must have shape \(n, 3\)"),
        (lambda: Spheres(x=[[0, 0, 0]], radius=-1.0, mass=1.0), r"spheres.radius\[0\] = -1 is not allowed"),
        (lambda: PlaneWall(name="w", point=(0, 0, 0), normal=(0, 0, 0), law=LINEAR), "zero normal"),
        (lambda: PlaneSegment(duration=-1.0), "segment duration = -1.0 is not allowed"),
        (lambda: simulate(box(replace(HERTZ, surface="jkr", surface_energy=1.0)), Numerics(dt=1e-5, n_steps=1, energy_budget=True)),
         "not allowed with surface = 'jkr'"),
        (lambda: SphereLaw(e_star=1.0, friction_pull=3.0), "friction_pull = 3"),
        (lambda: simulate(box(LINEAR), Numerics(dt=1e-5, n_steps=1), method="cd"), "elastic contacts, which contact dynamics"),
    ],
)  # fmt: skip
def test_bad_input_names_the_value_and_the_remedy(make: Any, words: str) -> None:
    with pytest.raises(CoreError, match=words):
        make()


def test_too_long_a_step_and_a_sphere_behind_a_wall_are_named() -> None:
    with pytest.raises(UnstableTimeStepError, match="exceeds the critical step"):
        simulate(box(LINEAR), Numerics(dt=0.1, n_steps=1, contact_dt=0.1))
    alone = Spheres(x=[[0.2, 0.2, 0.5]], radius=0.1, mass=1.0)
    fast = replace(box(LINEAR), spheres=alone, laws={}, gravity=(0.0, 0.0, -1e7))
    with pytest.raises(BehindWallError, match="behind wall 'floor'"):
        simulate(fast, Numerics(dt=1e-4, n_steps=100, contact_dt=1e-4, allow_unstable=True))


def test_a_centre_behind_a_plane_is_reported_where_it_is_at_that_time() -> None:
    """Free fall through a plane that hardly pushes, in leapfrog ``z0 - g t^2/2`` exactly; one step at 1.3 m/s is 1.3 mm."""
    law = SphereLaw(kn=1e-6)
    floor = PlaneWall(name="floor", point=(0, 0, 0), normal=(0, 0, 1), law=law)
    sphere = Spheres(x=[[0.0, 0.0, 0.09]], radius=0.05, mass=1.0)
    scene = SphereScene(spheres=sphere, sphere_sphere=law, walls=(floor,), gravity=(0.0, 0.0, -9.81))
    numerics = Numerics(dt=1e-3, n_steps=1000, contact_dt=1e-3, sample_every=1000)
    with pytest.raises(BehindWallError) as found:
        simulate(scene, numerics)
    t = np.ceil(np.sqrt(2.0 * 0.09 / 9.81) / 1e-3) * 1e-3
    assert f"is {0.5 * 9.81 * t**2 - 0.09:g} m behind" in str(found.value)
    assert f"t = {t:g} s" in str(found.value)
