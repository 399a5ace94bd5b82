"""Velocities that are held in 2D: exact steps of the scheme, threads, order, checkpoints, walls, energies."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import numerics

from ninedisk.core import (
    BehindWallError,
    BodyForce,
    ContactLaw,
    Disks,
    InvalidNumericsError,
    Numerics,
    Scene,
    Wall,
    simulate,
)
from ninedisk.core.dem import session as session_module
from ninedisk.core.dem.session import DemSession
from ninedisk.core.nurbs.shapes import disk

MASS = np.array([2.0, 0.7, 1.3, 0.4])
HELD = np.array([[False, False], [True, False], [False, True], [True, True]])


@pytest.mark.parametrize("form", ["central", "lagged"])
def test_a_component_is_free_or_stays(form: Any) -> None:
    """``v' = keep v + gain (F/m + g)`` where it is free; gravity, a force, global damping leave what is held alone."""
    xi, dt, steps, force, g = 3.0, 1e-3, 200, np.array([2.0, -1.0]), np.array([0.5, -9.0])
    v0 = np.array([[0.3, -0.2], [0.4, 0.1], [-0.5, 0.6], [0.7, 0.8]])
    disks = Disks(
        x=5.0 * np.arange(8.0).reshape(4, 2), v=v0, omega=[1.0, 2.0, 3.0, 4.0], radius=1.0, mass=MASS, held=HELD
    )
    scene = Scene(
        disks=disks, disk_disk=ContactLaw(kn=1e4, beta=0.1), gravity=tuple(g), xi=xi,
        forces=[BodyForce(disk=k, force=tuple(force)) for k in range(4)],
    )  # fmt: skip
    history = simulate(scene, numerics(dt, steps, damping_form=form))
    a = 0.5 * xi * dt
    keep, gain = ((1.0 - a) / (1.0 + a), dt / (1.0 + a)) if form == "central" else (1.0 - 2.0 * a, dt)
    v, x = v0.copy(), disks.x.copy()
    for step in range(steps + 1):
        pushed = force / MASS[:, None] + g
        after = np.where(HELD, v, (1.0 - a) * v + 0.5 * dt * pushed if step == 0 else keep * v + gain * pushed)
        # Velocities are reported at the step's time: the mean of both half steps.
        np.testing.assert_allclose(history.v[step], v if step == 0 else 0.5 * (v + after), rtol=1e-13)
        np.testing.assert_allclose(history.x[step], x, rtol=1e-13)
        v, x = after, x + dt * after
    assert np.array_equal(history.v[:, HELD], np.broadcast_to(v0[HELD], history.v[:, HELD].shape))
    speed = history.v[-1]
    assert history.energy["translation"][-1] == pytest.approx(0.5 * np.sum(MASS[:, None] * speed**2), rel=1e-13)
    assert history.energy["gravity"][-1] == pytest.approx(-np.sum(MASS[:, None] * history.x[-1] * g), rel=1e-13)


@pytest.mark.parametrize("outline", [False, True])
def test_a_driven_disk_pushes_a_free_one_as_the_scheme_says(outline: bool) -> None:
    """Touching at speed u, the overlap of step n is ``u dt sin(n a)/sin(a)`` with ``2 - 2 cos(a) = dt^2 kn/m``: the partner has no mass
    here. Round-off of the distance, and of the chord of outlines, over an overlap of 1e-2."""
    u, kn, dt, steps = 0.3, 1e4, 1e-4, 100
    shape: dict[str, Any] = {"outline": [-1, 0], "inertia": [1.0, 1.0]} if outline else {}
    disks = Disks(x=[[0.0, 0.0], [1.5, 0.0]], v=[[u, 0.0], [0.0, 0.0]], radius=[1.0, 0.5], mass=MASS[:2],
                  held=[[True, True], [False, False]], **shape)  # fmt: skip
    scene = Scene(disks=disks, disk_disk=ContactLaw(kn=kn), outlines=[disk(0.5)] if outline else [])
    history = simulate(scene, numerics(dt, steps), [(0, 1)])
    a = np.arccos(1.0 - 0.5 * dt**2 * kn / MASS[1])
    overlap = u * dt * np.sin(np.arange(steps + 1) * a) / np.sin(a)
    np.testing.assert_allclose(history.fn[:, 0], kn * overlap, rtol=0.0, atol=kn * (1e-9 if outline else 1e-14))
    assert history.fn.max() > 20.0
    np.testing.assert_allclose(history.x[:, 0, 0], u * history.t, rtol=1e-13)


def test_on_a_slope_one_component_has_part_of_the_stiffness() -> None:
    """A disk that keeps its x bounces along y with ``kn cos^2/m`` on a slope: ``y_n - y_e = A cos(n a)``."""
    kn, dt, steps, g, tilt, v = 1e4, 1e-4, 500, 10.0, 0.4, 0.2
    n = np.array([np.sin(tilt), np.cos(tilt)])
    law = ContactLaw(kn=kn)
    slope = Wall(name="slope", point=(0.0, 0.0), normal=tuple(n), law=law)
    disks = Disks(x=[[0.0, 0.999 / n[1]]], radius=1.0, mass=0.7, held=[[True, False]])
    scene = Scene(disks=disks, disk_disk=law, walls=[slope], gravity=(3.0, -g))
    history = simulate(scene, numerics(dt, steps, energy_budget=True), [(0, 1)])
    rest = (1.0 - 0.7 * g / (kn * n[1])) / n[1]
    a = np.arccos(1.0 - 0.5 * dt**2 * kn * n[1] ** 2 / 0.7)
    expected = rest + (disks.x[0, 1] - rest) * np.cos(np.arange(steps + 1) * a)
    assert (history.fn > 0.0).all()
    np.testing.assert_allclose(history.x[:, 0, 1], expected, rtol=1e-13)
    driven = scene.replace(disks=Disks(x=disks.x, v=[[v, 0.0]], radius=1.0, mass=0.7, held=[[True, False]]))
    with pytest.raises(InvalidNumericsError, match="energy_budget = True is not allowed with disk 0 held in a motion"):
        simulate(driven, numerics(dt, steps, energy_budget=True))


def test_a_disk_that_is_driven_behind_a_wall_is_reported_and_a_fixed_one_is_not() -> None:
    law = ContactLaw(kn=1e4)
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law, motion=())
    disks = Disks(
        x=[[0.0, 0.5], [9.0, 1.0]],
        v=[[0.0, -10.0], [0.0, 0.0]],
        radius=1.0,
        mass=1.0,
        held=[[True, True], [False, False]],
    )
    scene = Scene(disks=disks, disk_disk=law, walls=[floor])
    with pytest.raises(BehindWallError, match="the centre of disk 0"):
        simulate(scene, numerics(1e-2, 20))


def crowd() -> Scene:
    """Disks of unequal size that fall past held, driven and fixed ones."""
    rng = np.random.default_rng(4)
    x = np.array([[1.95 * i + 0.9 * (j % 2), 1.75 * j] for i in range(9) for j in range(8)])
    n = len(x)
    x = rng.permutation(x + rng.uniform(-0.05, 0.05, x.shape))
    held = rng.random((n, 2)) < 0.2
    fixed = np.arange(n) % 7 == 3
    held[fixed] = True
    v = np.where(fixed[:, None], 0.0, rng.normal(0.0, 2.0, x.shape))
    law = ContactLaw(kn=1e4, ks=5e3, mu=0.5, beta=0.05)
    return Scene(
        disks=Disks(x=x, v=v, omega=np.where(fixed, 0.0, rng.normal(0.0, 9.0, n)), radius=rng.uniform(0.7, 1.0, n),
                    mass=rng.uniform(0.5, 2.0, n), held=held, rotating=~fixed),
        disk_disk=law, walls=[Wall(name="floor", point=(0.0, -9.0), normal=(0.05, 1.0), law=law)], gravity=(0.0, -9.0), xi=1.0,
    )  # fmt: skip


def test_threads_order_and_checkpoints_change_no_bit(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Disks change their rows many times; a checkpoint written before there were held velocities lacks their array."""
    scene, how = crowd(), numerics(2e-4, 1_000, sample_every=250)
    as_given = simulate(scene, how)
    monkeypatch.setattr(session_module, "SORT_FROM", 1)
    histories = [DemSession(scene, how, threads=threads).run() for threads in (1, 3)]
    half = DemSession(scene, how)
    half.advance(430)
    half.save(tmp_path / "half.npz")
    histories.append(DemSession.load(tmp_path / "half.npz", threads=2).run())
    for history in histories:
        assert np.array_equal(history.x, histories[0].x)
        assert np.array_equal(history.v, histories[0].v)
        kept = np.broadcast_to(scene.disks.held, history.v.shape)
        assert np.array_equal(history.v[kept], np.broadcast_to(scene.disks.v, history.v.shape)[kept])
    # Sums of forces in another order: round-off, which contacts have multiplied since.
    np.testing.assert_allclose(histories[0].x, as_given.x, rtol=0.0, atol=1e-9)
    free = scene.replace(disks=Disks(**{**vars(scene.disks), "held": np.zeros((72, 2), dtype=bool), "rotating": True}))
    session = DemSession(free, how)
    session.advance(430)
    session.save(tmp_path / "new.npz")
    with np.load(tmp_path / "new.npz") as saved:
        former = {name: saved[name] for name in saved.files if name != "disks.free"}
    assert len(former) == len(np.load(tmp_path / "new.npz").files) - 1
    np.savez(tmp_path / "former.npz", **former)
    assert np.array_equal(DemSession.load(tmp_path / "former.npz").run().x, session.run().x)


def test_the_step_that_numerics_leave_open_is_stable() -> None:
    """A light disk between driven ones: the critical step is that separate mass."""
    disks = Disks(x=[[0.0, 0.0], [1.99, 0.0], [3.98, 0.0]], v=[[0.1, 0.0], [0.0, 0.0], [0.1, 0.0]], radius=1.0, mass=[9.0, 0.1, 9.0],
                  held=[[True, True], [False, False], [True, True]])  # fmt: skip
    session = DemSession(Scene(disks=disks, disk_disk=ContactLaw(kn=1e4)), Numerics(dt=1e-3, n_steps=10))
    assert session.critical_dt == pytest.approx(2.0 / np.sqrt(2e4 / 0.1), rel=1e-3)
