"""Hertz-Mindlin in 2D: disks as spheres of the same radii. Exact steps, closed forms, energies, preload, checkpoints, refusals."""

from __future__ import annotations

import copy
import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import numerics

from ninedisk.core import (
    BodyForce,
    ContactLaw,
    Disks,
    History,
    InvalidNumericsError,
    InvalidSceneError,
    Numerics,
    Rolling,
    Scene,
    UnstableTimeStepError,
    Wall,
    WallSegment,
    simulate,
)
from ninedisk.core.dem.critical import critical_time_step
from ninedisk.core.dem.session import DemSession
from ninedisk.core.law import damping_ratio
from ninedisk.core.nurbs.shapes import disk

E, G_STAR = 2e6, 8e5
LAW = ContactLaw(e_star=E, g_star=G_STAR, mu=0.4, beta=0.1)
ALONG = np.array([0.8, 0.6])
"""The line of centres lies on no axis."""


def pair(law: ContactLaw, speed: float, **more: Any) -> Scene:
    """Two unequal disks that touch, and approach each other."""
    radius, mass = np.array([0.5, 0.3]), np.array([2.0, 0.7])
    disks = Disks(
        x=np.outer([0.0, radius.sum()], ALONG), v=np.outer([speed, 0.0], ALONG), radius=radius, mass=mass, **more
    )
    return Scene(disks=disks, disk_disk=law)


@pytest.mark.parametrize("form", ["central", "lagged"])
def test_an_impact_has_the_steps_of_the_scheme(form: Any) -> None:
    """``m x'' = -(4/3) E* sqrt(R) x^(3/2) - 2 sqrt(5/6) beta sqrt(m 2 E* sqrt(R x)) x'`` step by step; the dashpot sees the velocity of
    the half step before, or that extrapolated. Round-off of places near 1 m over an overlap of 1e-2 m."""
    speed, dt, steps = 1.5, 2e-5, 1_000
    scene = pair(replace(LAW, mu=0.0, g_star=0.0), speed)
    history = simulate(scene, numerics(dt, steps, damping_form=form), [(0, 1)])
    r, m = 1.0 / np.sum(1.0 / scene.disks.radius), 1.0 / np.sum(1.0 / scene.disks.mass)
    x, v, seen = 0.0, speed, speed
    for step in range(steps + 1):
        fn = 0.0
        if x > 0.0:
            a = np.sqrt(r * x)
            fn = 4.0 / 3.0 * E * a * x + 2.0 * np.sqrt(5.0 / 6.0) * LAW.beta * np.sqrt(m * 2.0 * E * a) * seen
        if step > 0:
            assert history.fn[step, 0] == pytest.approx(fn, abs=2e-6)
        change = -fn / m * (dt if step else 0.5 * dt)
        v += change
        seen = v + ((0.5 if step else 1.0) * change if form == "central" else 0.0)
        x += dt * v
    assert history.fn[-1, 0] == 0.0
    assert history.fn.max() > 250.0
    assert np.outer(scene.disks.mass, [1.0, 1.0]).ravel() @ history.v[-1].ravel() == pytest.approx(
        2.0 * speed * ALONG.sum(), rel=1e-12
    )


def test_the_rebound_is_that_of_the_damping_ratio() -> None:
    """Antypov & Elliott: e = 0.7 whatever the speed; of second order in the step, 1e-5 at 1,000 steps a contact, and how it ends."""
    law = replace(LAW, mu=0.0, g_star=0.0, beta=damping_ratio(0.7))
    for speed in (0.5, 2.0):
        history = simulate(pair(law, speed), numerics(1e-5, 3_000))
        apart = (history.v[-1, 1] - history.v[-1, 0]) @ ALONG
        assert apart / speed == pytest.approx(0.7, abs=1e-3)


@pytest.mark.parametrize("unloading", ["none", "force", "rescale"])
def test_a_driven_disk_stretches_mindlins_spring_until_it_slips(unloading: Any) -> None:
    """At constant overlap ``fs = 8 G* sqrt(R overlap) s``, cut off at ``mu fn``; the torque has the radius as its arm."""
    overlap, u, dt, steps, radius, mass = 5e-3, 0.03, 1e-4, 800, 0.5, 2.0
    law = replace(LAW, unloading=unloading)
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law)
    disks = Disks(
        x=[[0.0, radius - overlap]], v=[[u, 0.0]], radius=radius, mass=mass, inertia=1e13, held=[[True, True]]
    )
    history = simulate(Scene(disks=disks, disk_disk=law, walls=[floor]), numerics(dt, steps), [(0, 1)])
    a = np.sqrt(radius * overlap)
    fn = 4.0 / 3.0 * E * a * overlap
    np.testing.assert_allclose(history.fn[:, 0], fn, rtol=1e-11)
    stretched = 8.0 * G_STAR * a * u * history.t
    assert stretched[-1] > 1.5 * 0.4 * fn
    # fs acts on the disk against its motion: along t = (-n_y, n_x) of n = (0, -1), which is x.
    np.testing.assert_allclose(history.fs[:, 0], -np.minimum(stretched, 0.4 * fn), rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(
        history.omega[-1, 0] * 1e13, np.trapezoid(radius * history.fs[:, 0], history.t), rtol=1e-6
    )


def crowd(law: ContactLaw = LAW, **more: Any) -> Scene:
    """Disks of two materials that fall between walls that shake and turn, past fixed and driven ones."""
    rng = np.random.default_rng(4)
    x = np.array([[1.95 * i + 0.9 * (j % 2), 1.75 * j] for i in range(5) for j in range(5)])
    n = len(x)
    held = np.zeros((n, 2), dtype=bool)
    held[3], held[7, 0] = True, True
    rotating = np.arange(n) != 3
    v = np.where(held, 0.0, rng.normal(0.0, 2.0, x.shape))
    walls = [
        Wall(name="floor", point=(0.0, -1.05), normal=(0.05, 1.0), law=law, material="steel",
             motion=(WallSegment(duration=0.01, velocity=(0.5, 6.0)), WallSegment(amplitude=(0.01, 0.02), frequency=200.0, phase=0.3))),
        Wall(name="side", point=(-1.4, 0.0), normal=(1.0, 0.1), law=law, material="glass", motion=(WallSegment(angular_velocity=1.0),)),
    ]  # fmt: skip
    values: dict[str, Any] = {
        "walls": walls, "gravity": (1.0, -9.0), "xi": 1.0, "laws": {("glass", "steel"): replace(law, mu=0.1, e_star=3e6)},
        "forces": [BodyForce(disk=5, force=(30.0, -8.0), torque=2.0, begin=0.001, end=0.0173)], **more,
    }  # fmt: skip
    disks = Disks(
        x=x, v=v, omega=np.where(rotating, rng.normal(0.0, 9.0, n), 0.0), radius=rng.uniform(0.9, 1.0, n), held=held,
        mass=rng.uniform(0.5, 2.0, n), rotating=rotating, material=["glass" if k % 3 else "steel" for k in range(n)],
    )  # fmt: skip
    return Scene(disks=disks, disk_disk=law, **values)


def test_the_budget_closes() -> None:
    """Bodies, springs and losses, less what walls and forces have fed: a quarter of the drift with half of the step."""
    law = replace(LAW, rolling=Rolling(model="constant", mu=0.05))
    drifts = []
    for dt in (4e-5, 2e-5):
        energy = simulate(crowd(law), Numerics(dt=4e-4, n_steps=100, contact_dt=dt, energy_budget=True)).energy
        lost = sum(
            energy[name] for name in ("friction_loss", "dashpot_loss", "rolling_loss", "damping_loss", "law_loss")
        )
        total = (
            energy["kinetic"]
            + energy["elastic"]
            + energy["gravity"]
            + lost
            - energy["wall_work"]
            - energy["force_work"]
        )
        assert (
            min(energy[name][-1] for name in ("friction_loss", "dashpot_loss", "rolling_loss", "damping_loss")) > 1e-2
        )
        assert abs(energy["wall_work"][-1]) > 1e-2
        drifts.append(float(np.abs(total - total[0]).max() / energy["kinetic"][0]))
    assert drifts[1] <= 0.6 * drifts[0] <= 1e-3


def same(one: History, two: History) -> None:
    for name in ("x", "v", "angle", "omega", "gap", "fn", "fs", "wall_force", "wall_angle"):
        assert np.array_equal(getattr(one, name), getattr(two, name)), name


def test_checkpoints_and_copies_go_on_to_the_bit(tmp_path: Path) -> None:
    """Of the disks asked for, with the watched pairs beside them."""
    scene, how = crowd(), numerics(2e-4, 120, sample_every=20)
    watch, particles = [(0, 25), (1, 6), (2, 3)], [4, 2]
    whole = DemSession(scene, how, watch, particles).run()
    half = DemSession(scene, how, watch, particles)
    half.advance(50)
    half.save(tmp_path / "half.npz")
    for again in (copy.copy(half), pickle.loads(pickle.dumps(half)), DemSession.load(tmp_path / "half.npz", threads=2)):
        same(again.run(), whole)
    same(half.run(), whole)
    assert whole.particles == (4, 2)
    with pytest.raises(InvalidNumericsError, match="the checkpoint has done 50 steps"):
        DemSession.load(tmp_path / "half.npz", n_steps=49)
    assert half.counts.contacts > 0
    t, now = half.snapshot()
    assert t == whole.t[-1]
    assert np.array_equal(now["x"][[4, 2]], whole.x[-1])


def test_a_preload_is_the_force_of_time_0_and_a_session_gives_it_back() -> None:
    """The second one is beyond the limit of friction."""
    x = np.array([[0.0, 0.98], [1.65, 0.68]])
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=LAW)
    scene = Scene(disks=Disks(x=x, radius=[1.0, 0.7], mass=[2.0, 1.1]), disk_disk=LAW, walls=[floor],
                  initial_shear={(0, 2): -500.0, (1, 2): 1e9, (0, 1): 300.0})  # fmt: skip
    pairs = [(0, 2), (1, 2), (0, 1)]
    session = DemSession(scene, numerics(1e-5, 1), pairs)
    history = session.run()
    assert history.fs[0] == pytest.approx([-500.0, 0.4 * history.fn[0, 1], 300.0], rel=1e-12)
    assert session.shear_forces() == pytest.approx(dict(zip(pairs, history.fs[-1], strict=True)), rel=1e-12)
    smooth = scene.replace(disk_disk=replace(LAW, mu=0.0))
    with pytest.raises(InvalidSceneError, match="disk 0 and disk 1, whose contact is smooth"):
        simulate(smooth, numerics(1e-5, 1))


def test_the_critical_step_is_that_of_the_contacts_at_hand() -> None:
    """A disk between two held ones: ``2 sqrt(m/(2 k))`` with the tangent stiffness ``k = 2 E* sqrt(R overlap)``."""
    overlap, radius, mass = 0.01, 0.5, 0.3
    x = [[0.0, 0.0], [1.0 - overlap, 0.0], [2.0 - 2.0 * overlap, 0.0]]
    disks = Disks(x=x, radius=radius, mass=[1.0, mass, 1.0], held=[[True, True], [False, False], [True, True]])
    scene = Scene(disks=disks, disk_disk=ContactLaw(e_star=E))
    k = 2.0 * E * np.sqrt(0.5 * radius * overlap)
    limit = 2.0 * np.sqrt(mass / (2.0 * k))
    with pytest.raises(InvalidSceneError, match="for Hertz' law take critical_dt of a DemSession"):
        critical_time_step(scene)
    assert DemSession(scene, Numerics(dt=1e-3, n_steps=1)).critical_dt == pytest.approx(limit, rel=1e-3)
    with pytest.raises(UnstableTimeStepError, match="exceeds the critical step"):
        simulate(scene, Numerics(dt=1.1 * limit, n_steps=9, contact_dt=1.1 * limit))


def outlined() -> Scene:
    disks = Disks(x=[[0.0, 0.0], [3.0, 0.0]], radius=0.5, mass=1.0, inertia=1.0, outline=[0, -1])
    return Scene(disks=disks, disk_disk=LAW, outlines=[disk(0.5)])


TAN = WallSegment(duration=1.0, tan_lever=(0.1, 0.0), tan_rate=0.1)


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        (outlined(), "Hertz' law, which the DEM of outlines does not have"),
        (crowd(replace(LAW, wall_velocity_at="mid-overlap")), "use 'surface'"),
        (crowd(walls=[Wall(name="w", point=(0.0, -3.0), normal=(0.0, 1.0), law=LAW, motion=(TAN,))], laws={}), "moves by a tangent"),
        (crowd(replace(LAW, g_star=0.0), laws={}), "give g_star > 0"),
    ],
    ids=["outlines", "mid-overlap", "tangent", "no shear spring"],
)  # fmt: skip
def test_what_has_no_form_in_2d_is_refused_with_a_remedy(scene: Scene, words: str) -> None:
    with pytest.raises(InvalidSceneError, match=words):
        simulate(scene, numerics(1e-4, 1))


@pytest.mark.parametrize("change", [{"surface_energy": 0.1}, {"twisting": Rolling(model="constant", mu=0.1)}])
def test_surface_energy_and_twisting_stay_in_3d(change: dict[str, Any]) -> None:
    with pytest.raises(InvalidSceneError, match=f"{next(iter(change))} = .* is not allowed in 2D"):
        pair(replace(LAW, **change), 0.1)


def test_contact_dynamics_refuses_it() -> None:
    with pytest.raises(InvalidSceneError, match="the scene has Hertz' law, which contact dynamics does not have"):
        simulate(pair(LAW, 0.1), Numerics(dt=1e-3, n_steps=1), method="cd")
