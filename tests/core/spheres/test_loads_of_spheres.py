"""Damping, forces and preload in 3D, beyond what a scene at z = 0 shows (`tests/core/test_both_dimensions.py`)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_spheres import HERTZ, LINEAR, SPRING, THROWN, assert_same_bits, box, column, free_cloud
from twin import rotation

from ninedisk.core import BodyForce, InvalidSceneError, Numerics, Rolling, SphereScene, simulate
from ninedisk.core.dem.space.session import SphereSession
from ninedisk.core.history import History

__all__ = ["column"]

TURN = rotation(np.array([0.6, 0.0, 0.8]), 1.1)


def loads(n: int, turn: Any = None) -> tuple[BodyForce, ...]:
    """One on every third body, with all components, and a second one on body 3."""
    turn = np.eye(3) if turn is None else turn
    rng, found = np.random.default_rng(5), []
    for disk in (*range(0, n, 3), 3):
        force, torque = rng.normal(0.0, 4.0, (2, 3)) * [[1.0], [0.02]]
        begin = float(rng.uniform(0.0, 4e-3))
        force, torque = turn @ force, turn @ torque
        found.append(BodyForce(disk=disk, force=tuple(force), torque=tuple(torque), begin=begin, end=begin + 0.0050013))
    return tuple(found)


def preload(scene: SphereScene, share: float, turn: Any = None) -> dict[tuple[int, int], tuple[float, ...]]:
    """A force across the normal on every pair that touches, of different sizes and directions."""
    x, radius = scene.spheres.x, scene.spheres.radius
    found: dict[tuple[int, int], tuple[float, ...]] = {}
    for i in range(len(x)):
        for j in range(i + 1, len(x)):
            apart = x[j] - x[i]
            if np.linalg.norm(apart) < radius[i] + radius[j]:
                force = np.cross(apart, [1.0, 0.3 * i, -0.2 * j]) * share
                found[i, j] = tuple(force if turn is None else turn @ force)
    return found


def close_cloud(**law: Any) -> SphereScene:
    scene = free_cloud(replace(LINEAR, **law))
    return replace(scene, spheres=replace(scene.spheres, x=0.93 * scene.spheres.x, v=0.1 * scene.spheres.v))


@pytest.mark.parametrize("rolling", [SPRING, Rolling(model="viscous", mu=0.5)], ids=lambda rolling: rolling.model)
@pytest.mark.parametrize("form", ["central", "lagged"])
def test_a_turned_scene_runs_the_same(form: Any, rolling: Rolling) -> None:
    """Any axis; rounding, grown by some collisions."""
    scene = replace(close_cloud(rolling=rolling), xi=15.0)
    rows = {name: getattr(scene.spheres, name) @ TURN.T for name in ("x", "v", "omega")}
    n = len(scene.spheres)
    one = replace(scene, forces=loads(n), initial_shear=preload(scene, 20.0))
    two = replace(
        scene,
        spheres=replace(scene.spheres, **rows),
        forces=loads(n, TURN),
        initial_shear=preload(scene, 20.0, TURN),
    )
    numerics = Numerics(
        dt=2e-5,
        n_steps=400,
        contact_dt=2e-5,
        sample_every=200,
        damping_form=form,
        allow_unstable=True,
        energy_budget=True,
    )
    assert len(one.initial_shear) > 5
    found, turned = (simulate(each, numerics) for each in (one, two))
    assert np.abs(found.v[-1] - found.v[0]).max() > 0.01
    np.testing.assert_allclose(turned.x[-1], found.x[-1] @ TURN.T, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(turned.omega[-1], found.omega[-1] @ TURN.T, rtol=0.0, atol=1e-9)
    assert found.energy["rolling_loss"][-1] > 0.0
    for name in ("force_work", "damping_loss", "elastic_shear", "rolling_loss"):
        assert turned.energy[name] == pytest.approx(found.energy[name], rel=1e-9)


def test_bits_do_not_depend_on_threads_and_on_how_the_run_is_cut(tmp_path: Path, column: SphereScene) -> None:
    """Spheres change their rows on the way, and their forces go along."""
    scene = replace(column, xi=20.0, forces=loads(len(column.spheres)))
    numerics = THROWN.replace(n_steps=30)
    exact = SphereSession(scene, numerics).run()
    session = SphereSession(scene, numerics, threads=2)
    session.advance(11)
    session.save(tmp_path / "half.npz")
    for found in (session.run(), SphereSession.load(tmp_path / "half.npz", threads=3).run()):
        assert_same_bits(found, exact)
    assert exact.energy["damping_loss"][-1] > 0.0
    assert exact.energy["force_work"][-1] != 0.0


def test_the_order_of_the_spheres_does_not_matter(column: SphereScene, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = replace(column, xi=20.0, forces=loads(len(column.spheres)))
    ordered = simulate(scene, THROWN.replace(n_steps=10))
    monkeypatch.undo()
    as_given = simulate(scene, THROWN.replace(n_steps=10))
    np.testing.assert_allclose(ordered.x[-1], as_given.x[-1], rtol=0.0, atol=1e-12)
    assert ordered.energy["force_work"][-1] == pytest.approx(as_given.energy["force_work"][-1], rel=1e-9)


@pytest.mark.parametrize("form", ["central", "lagged"])
def test_a_free_sphere_slows_down_as_the_scheme_says(form: Any) -> None:
    """v' = keep v + gain F/m. A component that is held keeps its velocity, and so does a spin that is blocked."""
    xi, dt, steps, force = 3.0, 1e-3, 200, (2.0, -1.0, 4.0)
    scene = box(HERTZ)
    spheres = replace(scene.spheres, x=3.0 * scene.spheres.x + 0.2)
    k = 2  # its x is held, its spin is blocked
    free = replace(
        scene, spheres=spheres, walls=(), gravity=(0.0, 0.0, 0.0), xi=xi, forces=(BodyForce(disk=k, force=force),)
    )
    history = simulate(free, Numerics(dt=dt, n_steps=steps, contact_dt=dt, damping_form=form, allow_unstable=True))
    a = 0.5 * xi * dt
    keep, gain = ((1.0 - a) / (1.0 + a), dt / (1.0 + a)) if form == "central" else (1.0 - 2.0 * a, dt)
    for c in range(3):
        v, x = spheres.v[k, c], spheres.x[k, c]
        for step in range(steps):
            if c > 0:
                pushed = force[c] / spheres.mass[k]
                v = (1.0 - a) * v + 0.5 * dt * pushed if step == 0 else keep * v + gain * pushed
            x += dt * v
        assert history.x[-1, k, c] == pytest.approx(x, rel=1e-13)
    assert history.omega[-1, k] == pytest.approx(spheres.omega[k])
    spin = spheres.omega[4] * (1.0 - a) * keep ** (steps - 1)
    assert history.omega[-1, 4] == pytest.approx(0.5 * (1.0 + keep) * spin, rel=1e-13)


@pytest.mark.parametrize("unloading", ["none", "force", "rescale"])
def test_a_preload_of_hertz_is_the_force_of_time_0(unloading: Any) -> None:
    """Up to the limit of friction; what a session gives back starts the next one."""
    scene = close_cloud(kn=0.0, ks=0.0, e_star=2e7, g_star=7e6, mu=0.3, unloading=unloading)
    given = preload(scene, 1500.0)
    pairs, loaded = list(given), replace(scene, initial_shear=given)
    numerics = Numerics(dt=2e-5, n_steps=1, contact_dt=2e-5, allow_unstable=True)
    history = simulate(loaded, numerics, pairs)
    cap, wanted = 0.3 * np.maximum(history.fn[0], 0.0), np.array(list(given.values()))
    size = np.linalg.norm(wanted, axis=1)
    limited = wanted * np.minimum(1.0, cap / size)[:, None]
    assert (cap < size).any()
    assert (cap > size).any()
    np.testing.assert_allclose(history.fs[0], limited, rtol=0.0, atol=1e-12 * size.max())
    back = SphereSession(loaded, numerics).shear_forces()
    assert back.keys() == {pair for pair, fs in zip(pairs, limited, strict=True) if fs.any()}
    again: History = simulate(replace(scene, initial_shear=back), numerics, pairs)
    np.testing.assert_allclose(again.fs[0], history.fs[0], rtol=0.0, atol=1e-12 * size.max())


def test_what_a_scene_cannot_mean_is_refused() -> None:
    scene = close_cloud()
    pair = next(iter(preload(scene, 1.0)))
    x = scene.spheres.x
    numerics = Numerics(dt=2e-5, n_steps=1, contact_dt=2e-5, allow_unstable=True)
    along = tuple(x[pair[1]] - x[pair[0]])
    for changes, words in (
        ({"initial_shear": {pair: along}}, "along their normal"),
        ({"initial_shear": {(0, 11): (1.0, 0.0, 0.0)}}, "do not touch"),
        ({"initial_shear": {pair: 1.0}}, "shape"),
        ({"forces": [BodyForce(disk=99, force=(1.0, 0.0, 0.0))]}, r"0\.\.11"),
        ({"forces": [BodyForce(disk=0, force=(1.0, 0.0))]}, "3 components"),
        ({"xi": -1.0}, "xi"),
    ):
        with pytest.raises(InvalidSceneError, match=words):
            simulate(replace(scene, **changes), numerics)
    smooth = replace(scene, sphere_sphere=replace(scene.sphere_sphere, mu=0.0), initial_shear=preload(scene, 1.0))
    with pytest.raises(InvalidSceneError, match="smooth"):
        simulate(smooth, numerics)


def test_the_lagged_form_limits_the_step() -> None:
    """|1 - xi dt| <= 1 of a free sphere; with a contact lambda_max(dt^2/4 K + dt/2 C) + xi dt/2 <= 1; the central form never."""
    xi, one = 2e3, Numerics(dt=1e-6, n_steps=1, damping_form="lagged")
    smooth = replace(LINEAR, mu=0.0, ks=0.0)
    scene = free_cloud(smooth)
    spheres = scene.spheres
    alone = replace(spheres, **{name: getattr(spheres, name)[:1] for name in ("x", "v", "omega", "radius", "mass", "inertia")},
                    held=False, rotating=True, material="steel", half_sizes=None, quaternion=None)  # fmt: skip
    free = SphereSession(replace(scene, spheres=alone, xi=xi), one)
    assert free.critical_dt == pytest.approx(2.0 / xi)
    s = 1.0 / SphereSession(scene, one).critical_dt
    damped, central = (
        SphereSession(replace(scene, xi=xi), one),
        SphereSession(replace(scene, xi=xi), one.replace(damping_form="central")),
    )
    undamped = SphereSession(replace(scene, sphere_sphere=replace(smooth, beta=0.0)), one)
    w = 2.0 / undamped.critical_dt
    c = s - 0.25 * w**2 / s + 0.5 * xi
    # The step errs to the safe side by up to 1e-4.
    assert 1.0 / damped.critical_dt == pytest.approx(0.5 * (c + np.hypot(c, w)), rel=2e-4)
    assert central.critical_dt == SphereSession(scene, one.replace(damping_form="central")).critical_dt
