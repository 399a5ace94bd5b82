"""Closed forms: Hertz' impact, restitution, the sphere that comes to roll, energy and momentum; and the session around them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_against_twin import CONSTANT, SPRING, TWIST, box
from twin import law_of

from ninedisk.core import InvalidSceneError, Numerics, UnstableTimeStepError, damping_ratio, simulate
from ninedisk.core.dem.session import DemSession
from ninedisk.core.dem.space import session
from ninedisk.core.dem.space.session import SphereSession
from ninedisk.core.law import Rolling, SphereLaw
from ninedisk.core.scene import PlaneWall, Spheres, SphereScene

R, M, E, V = 0.01, 0.01, 5e7, 0.5


def head_on(law: SphereLaw) -> SphereScene:
    """Two spheres of unlike size that meet with the relative speed V along (1, 2, 2)/3, just touching at time 0."""
    n = np.array([1.0, 2.0, 2.0]) / 3.0
    spheres = Spheres(x=[[0.0, 0.0, 0.0], 3.0 * R * n], radius=[R, 2.0 * R], mass=[M, 8.0 * M], v=[V * n, [0.0] * 3])
    return SphereScene(spheres=spheres, sphere_sphere=law)


def impact(law: SphereLaw, steps: int) -> tuple[float, float, float, float]:
    """Largest force and overlap, duration (parabola and line through the samples), rebound over approach."""
    dt = 2e-3 / steps
    h = simulate(head_on(law), Numerics(dt=dt, n_steps=steps, contact_dt=dt), [(0, 1)])
    overlap, fn = -h.gap[:, 0], h.fn[:, 0]

    def top(a: Any) -> float:
        k = int(np.argmax(a))
        rise, bend = 0.5 * (a[k + 1] - a[k - 1]), a[k + 1] - 2.0 * a[k] + a[k - 1]
        return float(a[k] - 0.5 * rise**2 / bend)

    k = int(np.flatnonzero(overlap > 0.0)[-1])
    end = h.t[k] + dt * overlap[k] / (overlap[k] - overlap[k + 1])
    rebound = (h.v[-1, 1] - h.v[-1, 0]) @ np.array([1.0, 2.0, 2.0]) / 3.0 / V
    return top(fn), top(overlap), float(end), float(rebound)


def test_hertz_impact_is_the_closed_form_to_second_order() -> None:
    reduced, mass = 2.0 / 3.0 * R, 8.0 / 9.0 * M
    depth = (15.0 * mass * V**2 / (16.0 * E * np.sqrt(reduced))) ** 0.4
    exact = np.array(
        [
            4.0 / 3.0 * E * np.sqrt(reduced) * depth**1.5,
            depth,
            2.943275 * depth / V,
            1.0,
        ]  # 4 sqrt(pi) G(7/5) / (5 G(9/10))
    )
    law = SphereLaw(e_star=E)
    coarse, fine = (np.abs(np.array(impact(law, steps)) / exact - 1.0) for steps in (800, 3200))
    assert (fine < 1e-4).all()
    assert (fine[:2] < coarse[:2] / 10.0).all()  # second order: a sixteenth
    assert fine[2] < coarse[2] / 4.0  # the force's root at the end leaves the time more than first order


@pytest.mark.long
@pytest.mark.parametrize("e", [0.9, 0.4])
@pytest.mark.parametrize("stiffness", [{"e_star": E}, {"kn": 1e5}], ids=["hertz", "linear"])
def test_the_damping_ratio_gives_the_restitution(e: float, stiffness: dict[str, float]) -> None:
    rebound = impact(SphereLaw(beta=damping_ratio(e), **stiffness), 4000)[3]
    # The last step sees the dashpot switch off within it: (omega dt) of a collision of some 1000 steps, times the loss.
    assert rebound == pytest.approx(e, abs=2e-3)


def on_floor(law: SphereLaw, v: Any, omega: Any) -> SphereScene:
    """A sphere that rests on a plane with a tilted normal, pressed on by gravity, and begins to move along it."""
    n = np.array([2.0, -1.0, 2.0]) / 3.0
    along, side = np.array([1.0, 2.0, 0.0]) / np.sqrt(5.0), np.cross(n, np.array([1.0, 2.0, 0.0]) / np.sqrt(5.0))
    to = np.column_stack([along, side, n])
    sink = M * 9.81 / law.kn
    spheres = Spheres(x=[(R - sink) * n], radius=R, mass=M, v=[to @ np.array(v)], omega=[to @ np.array(omega)])
    floor = PlaneWall(name="floor", point=(0.0, 0.0, 0.0), normal=tuple(n), law=law)
    return SphereScene(spheres=spheres, sphere_sphere=law, walls=(floor,), gravity=tuple(-9.81 * n))


def test_a_sliding_sphere_keeps_its_momentum_about_the_floor_and_rolls_at_five_sevenths() -> None:
    scene = on_floor(SphereLaw(kn=1e5, ks=5e4, mu=0.5, slip_at="end"), (V, 0.3, 0.0), (0.0, 0.0, 7.0))
    h = simulate(scene, Numerics(dt=1e-5, n_steps=20_000, contact_dt=1e-5, sample_every=20))
    n = np.array(scene.walls[0].normal)
    about = h.v[:, 0] * M * R + 0.4 * M * R**2 * np.cross(h.omega[:, 0], n)
    np.testing.assert_allclose(about, np.broadcast_to(about[0], about.shape), atol=1e-11 * M * R * V)
    np.testing.assert_allclose(h.v[-300:, 0].mean(axis=0), 5.0 / 7.0 * scene.spheres.v[0], atol=1e-3 * V)
    assert h.omega[-1, 0] @ n == pytest.approx(7.0, rel=1e-12)  # nothing turns it about the normal


@pytest.mark.long
def test_springs_of_the_surface_keep_the_energy_to_second_order() -> None:
    springs = {
        name: Rolling(model="elastic-plastic", mu=9.0, kr=kr) for name, kr in (("rolling", 0.05), ("twisting", 0.02))
    }
    scene = on_floor(SphereLaw(kn=1e5, ks=5e4, mu=9.0, **springs), (0.01, 0.0, 0.0), (1.0, 2.0, 4.0))

    def drift(steps: int) -> float:
        dt = 0.02 / steps
        h = simulate(scene, Numerics(dt=dt, n_steps=steps, contact_dt=dt))
        total = h.energy["kinetic"] + h.energy["elastic"] + h.energy["gravity"]
        assert h.energy["elastic_rolling"].max() > 0.2 * h.energy["kinetic"][0]
        return float(np.abs(total - total[0]).max() / h.energy["kinetic"][0])

    coarse, fine = drift(1000), drift(4000)
    assert fine < 1e-3
    assert fine < coarse / 10.0


@pytest.mark.parametrize("law", [{**SPRING, **TWIST}, CONSTANT], ids=["springs", "constant"])
def test_pieces_and_a_checkpoint_leave_every_bit(law: dict[str, Any], tmp_path: Path) -> None:
    numerics = Numerics(dt=2e-5, n_steps=300, contact_dt=1e-5, sample_every=7)
    watch, reported = [(0, 1), (3, 12)], []
    whole = SphereSession(box(**law), numerics, watch, (4, 0)).run(lambda done, of: reported.append((done, of)))
    assert reported[-1] == (300, 300)
    first = SphereSession(box(**law), numerics.replace(n_steps=101), watch, (4, 0), threads=3)
    first.advance(40)
    first.advance(61)
    first.save(tmp_path / "half.npz")
    again = SphereSession.load(tmp_path / "half.npz", n_steps=300, threads=2).run()
    assert again.particles == (4, 0)
    for name in ("x", "v", "angle", "omega", "gap", "fn", "fs", "wall_point", "wall_angle", "wall_force"):
        np.testing.assert_array_equal(getattr(again, name), getattr(whole, name))
    for name, values in whole.energy.items():
        np.testing.assert_array_equal(again.energy[name], values)
    with pytest.raises(InvalidSceneError, match="a scene in 3D, not in 2D"):
        DemSession.load(tmp_path / "half.npz")


def test_a_contact_that_stiffens_beyond_the_step_is_refused() -> None:
    law = law_of(mu=0.0, beta=0.0)
    scene = SphereScene(
        spheres=Spheres(x=[[0.0, 0.0, 0.0], [1.9 * R, 0.0, 0.0], [5.0, 0.0, 0.0]], radius=R, mass=M), sphere_sphere=law
    )
    # At rest the fall through the scene expects no overlap at all; the given one has k = 2 E* sqrt(R* delta).
    critical = 2.0 / np.sqrt(2.0 * 5e6 * np.sqrt(0.5 * R * 0.1 * R) * 2.0 / M)
    numerics = Numerics(dt=1.01 * critical, n_steps=1, contact_dt=1.01 * critical)
    with pytest.raises(UnstableTimeStepError, match="that the contacts have"):
        simulate(scene, numerics)
    simulate(scene, numerics.replace(dt=0.99 * critical, contact_dt=0.99 * critical))


@pytest.mark.parametrize("sort_from", [1, 1000], ids=["in-order", "as-given"])
@pytest.mark.parametrize("spread", [(1.0, 1.0, 1.0), (40.0, 0.0, 0.2), (1e9, 1.0, 1.0)], ids=["cube", "strip", "far"])
def test_the_search_finds_the_pairs_of_all_against_all(
    spread: tuple[float, float, float], sort_from: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(1)
    x, radius = rng.uniform(-1.0, 1.0, (400, 3)) * spread, rng.uniform(0.02, 0.1, 400)
    x[200:] = x[:200] + 0.1 * rng.standard_normal((200, 3))
    gap = np.linalg.norm(x[:, None] - x[None], axis=2) - radius[:, None] - radius[None]
    expected = {(i, j) for i, j in np.argwhere(gap < 0.03).tolist() if i < j}
    monkeypatch.setattr(session, "SORT_FROM", sort_from)
    monkeypatch.setattr(session, "FIRST_SKIN", 0.03 / radius.mean())
    scene = SphereScene(spheres=Spheres(x=x, radius=radius, mass=1.0), sphere_sphere=SphereLaw(kn=1.0))
    run = SphereSession(scene, Numerics(dt=1.0, n_steps=1, contact_dt=1e-3))
    listed = run._state.name[run._contacts().bodies]
    found = [(min(pair), max(pair)) for pair in listed.tolist()]
    assert len(expected) > 50
    assert len(found) == len(set(found))
    assert set(found) == expected


def test_a_run_in_order_of_places_is_reported_in_the_scenes_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lists are made anew every few steps: what contacts remember goes along, whichever of two spheres comes first then."""
    scene = box(**SPRING, **TWIST)
    monkeypatch.setattr(session, "FIRST_SKIN", 0.01)
    monkeypatch.setattr(session, "MOST_SKIN", 0.01)
    numerics = Numerics(dt=1e-5, n_steps=150, contact_dt=1e-5, sample_every=30)
    watch = [(i, j) for i in range(12) for j in range(i + 1, 18)]
    plain = simulate(scene, numerics, watch, particles=(11, 3, 0))
    monkeypatch.setattr(session, "SORT_FROM", 1)
    other = simulate(scene, numerics, watch, particles=(11, 3, 0))
    assert np.abs(plain.fs).max() > 0.01
    for name in ("x", "v", "angle", "omega", "gap", "fn", "fs", "wall_force"):
        exact = getattr(plain, name)
        # Sums in another order: the round-off that the twin is held to.
        np.testing.assert_allclose(getattr(other, name), exact, rtol=0.0, atol=1e-12 * np.abs(exact).max())
    for name, exact in plain.energy.items():
        np.testing.assert_allclose(other.energy[name], exact, rtol=1e-11, atol=1e-15)
