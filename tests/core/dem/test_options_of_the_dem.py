"""Materials, forces on disks, rolling resistance, cohesion and the energy budget of the DEM: twins, closed forms, bits."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracle import Oracle
from scenes import (
    KN,
    all_pairs,
    difference,
    imploding,
    numerics,
    orders,
    pair_scene,
    random_law,
    random_scene,
    run,
    with_options,
)
from test_laws_of_motion import ENERGIES, FIELDS, STEP, STEPS, TOLERANCE, steps_behind_walls
from test_threads import assert_same_bits, pouring

from ninedisk.core import (
    BodyForce,
    ContactLaw,
    Disks,
    History,
    InvalidNumericsError,
    InvalidSceneError,
    Rolling,
    Scene,
    Wall,
    WallSegment,
)
from ninedisk.core.dem import session as session_module
from ninedisk.core.dem.session import DemSession
from ninedisk.core.dem.state import REBUILDS
from ninedisk.core.law import LEVER_ARMS, SLIP_AT, WALL_VELOCITY_AT
from ninedisk.core.packings import settled_packing

LOSSES = ("friction_loss", "dashpot_loss", "rolling_loss", "damping_loss", "law_loss")
STATE = ("kinetic", "elastic", "gravity")
MODELS = ("constant", "viscous", "elastic-plastic")


def assert_twins(scene: Scene, steps: int = STEPS, **how: Any) -> Counter[str]:
    """A run against the plain-Python twin, up to where a centre gets behind a wall; what its contacts went through."""
    settings = numerics(STEP, steps, **how)
    twin = Oracle(scene, settings)
    expected = twin.run()
    lost = steps_behind_walls(scene, expected)
    if len(lost):
        return Counter() if lost[0] < 2 else assert_twins(scene, int(lost[0]) - 1, **how)
    found = run(scene, settings)
    budget = LOSSES if settings.energy_budget else ()
    far = difference(found, expected, (*FIELDS, *ENERGIES, *(("elastic_rolling", "force_work") if budget else ())))
    # A channel in which nearly nothing is lost has the round-off of the others.
    most = max(float(np.abs(expected.energy[name]).max()) for name in (*STATE, *LOSSES))
    far |= {name: float(np.abs(found.energy[name] - expected.energy[name]).max()) / most for name in budget}
    assert not {name: value for name, value in far.items() if not value < TOLERANCE}
    return twin.events


@pytest.mark.long
def test_random_scenes_with_options(part: Callable[[int], int]) -> None:
    events: Counter[str] = Counter()
    for seed in range(part(60)):
        rng = np.random.default_rng([seed, 18])
        scene = with_options(rng, random_scene(rng, STEP, STEPS), STEP * STEPS)
        events += assert_twins(scene, damping_form=("central", "lagged")[seed % 2], energy_budget=seed % 4 < 2)
    # The scenes reach every branch of the laws, many times over.
    assert min(
        events[name] for name in ("close", "open", "stick", "slip", "no-tension", "pull", "bend", "roll")
    ) >= part(20), events


def mixed(scene: Scene) -> Scene:
    """The pouring disks of three materials, with every model of rolling resistance, cohesion and forces."""
    names, base = ("", "ash", "oak"), scene.disk_disk
    rolling = [
        Rolling(model="elastic-plastic", mu=0.2, kr=0.1 * KN, beta=0.1),
        Rolling(model="elastic-plastic", mu=3.0, kr=0.3 * KN),
        Rolling(model="constant", mu=0.1),
        Rolling(model="viscous", mu=0.01),
        None,
    ]
    laws = {
        pair: replace(base, kn=KN * (0.7 + 0.1 * k), mu=0.2 + 0.1 * k, cohesion=0.02 * KN * (k % 3), rolling=rolling[k])
        for k, pair in enumerate([("ash", "ash"), ("oak", "ash"), ("oak", "oak"), ("", "oak"), ("", "")])
    }
    n = len(scene.disks)
    forces = [
        BodyForce(disk=k, force=(30.0, -20.0), torque=5.0, begin=0.003 * k, end=0.01 + 0.003 * k)
        for k in range(0, n, 7)
    ]
    disks = replace(scene.disks, material=[names[k % 3] for k in range(n)])
    walls = tuple(replace(wall, material="oak", law=replace(wall.law, rolling=rolling[0])) for wall in scene.walls)
    return scene.replace(disks=disks, walls=walls, laws=laws, forces=forces)


@pytest.mark.long
def test_sorted_and_striped_disks_with_options_follow_the_twin(monkeypatch: pytest.MonkeyPatch) -> None:
    """Disks change their order in the lists, and with it the sign of the torque that a contact remembers."""
    monkeypatch.setattr(session_module, "SORT_FROM", 1)
    scene, how = mixed(pouring(4, 16)), numerics(5e-4, 200, energy_budget=True)
    session = DemSession(scene, how, all_pairs(scene))
    found, twin = session.run(), Oracle(scene, how).run()
    assert session._progress.clock[REBUILDS] > 5
    assert (
        max(difference(found, twin, ("x", "v", "angle", "omega", "fn", "fs", "elastic_rolling", *LOSSES)).values())
        < 1e-9
    )


@pytest.mark.long
@pytest.mark.parametrize("threads", [2, 3])
def test_any_number_of_threads_gives_the_same_bits(threads: int) -> None:
    scene, how = mixed(pouring(46)), numerics(2e-4, 200, sample_every=50, energy_budget=True)
    one, many = DemSession(scene, how), DemSession(scene, how, threads=threads)
    assert_same_bits(one.run(), many.run())
    assert many._progress.clock[REBUILDS] > 3


@pytest.mark.parametrize("sort_from", [1, 10**9])
def test_a_checkpoint_changes_no_bit(sort_from: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(session_module, "SORT_FROM", sort_from)
    scene, how = mixed(pouring(7, 21)), numerics(5e-4, 120, sample_every=3, energy_budget=True)
    whole, halted = DemSession(scene, how), DemSession(scene, how)
    halted.advance(55)
    halted.save(tmp_path / "half.npz")
    assert_same_bits(whole.run(), DemSession.load(tmp_path / "half.npz").run())


def test_lists_grow_with_the_history_of_rolling_springs() -> None:
    rolling = Rolling(model="elastic-plastic", mu=0.5, kr=0.3, beta=0.1)
    law = ContactLaw(kn=1.0, ks=0.5, mu=0.5, cohesion=0.2, rolling=rolling)
    crowd = imploding(40)
    spins = np.random.default_rng(1).normal(0.0, 3.0, 40)
    scene = crowd.replace(disks=replace(crowd.disks, omega=spins), disk_disk=law)
    session = DemSession(scene, numerics(1e-3, 14), all_pairs(scene))
    room = len(session._lists.pairs.bending)
    found, twin = session.run(), Oracle(scene, numerics(1e-3, 14)).run()
    assert len(session._lists.pairs.bending) == len(session._laws.reach) > 1.5 * room
    # Speeds of 570 m/s bring the round-off of positions into slips.
    assert max(difference(found, twin, ("x", "v", "omega", "fn", "elastic_rolling")).values()) < 1e-10


@pytest.mark.parametrize("seed", range(10))
def test_two_materials_are_two_scenes(seed: int) -> None:
    """Far from each other, disks of two materials move to the bits of scenes that have one of the laws each.

    Few pairs: the last ones of a list are not found several at a time, and their sums may be rounded elsewhere.
    """
    rng = np.random.default_rng(seed)
    laws = [random_law(rng), random_law(rng)]
    names, n = ("ash", "oak"), 3
    parts = []
    for k in range(2):
        x = np.array([[0.0, 0.0], [1.9, 0.05], [0.9, 1.6]]) + np.array([1000.0 * k, 0.0])
        columns = {"x": x, "v": rng.normal(0.0, 5.0, x.shape), "omega": rng.normal(0.0, 5.0, n)}
        parts.append({**columns, "radius": rng.uniform(0.9, 1.0, n), "mass": rng.uniform(0.5, 2.0, n)})
    # One floor under both, of its own material.
    floor = Wall(name="floor", point=(0.0, -1.0), normal=(0.0, 1.0), law=ContactLaw(kn=1.0), material="floor")
    both = Scene(
        disks=Disks(
            **{key: np.concatenate([part[key] for part in parts]) for key in parts[0]},
            material=[names[0]] * n + [names[1]] * n,
        ),
        disk_disk=ContactLaw(kn=1.0),
        walls=(floor,),
        gravity=(0.0, -9.0),
        laws={(name, other): law for name, law in zip(names, laws, strict=True) for other in (name, "floor")},
    )
    how = numerics(1e-3, 300, sample_every=10)
    found = run(both, how, [])
    for k, law in enumerate(laws):
        scene = Scene(disks=Disks(**parts[k]), disk_disk=law, walls=(replace(floor, law=law),), gravity=(0.0, -9.0))
        alone, mine = run(scene, how, []), slice(k * n, (k + 1) * n)
        for name in ("x", "v", "angle", "omega"):
            np.testing.assert_array_equal(
                getattr(found, name)[:, mine], getattr(alone, name), err_msg=f"{name} of {names[k]}"
            )


def rolling_scene(
    rng: np.random.Generator, rolling: Rolling, *, slope: float, speed: float, deceleration: float
) -> Scene:
    """A disk that rolls down a slope [rad] at ``speed`` [m/s] and whose contact carries what ``deceleration`` [m/s^2] asks for."""
    g, radius, mass = 9.81, rng.uniform(0.3, 3.0), rng.uniform(0.5, 5.0)
    law = ContactLaw(kn=1e6, ks=5e5, mu=2.0, rolling=rolling)
    weight, pull = mass * g * np.cos(slope), mass * g * np.sin(slope)
    disks = Disks(
        x=[[0.0, radius - weight / law.kn]], v=[[speed, 0.0]], omega=-speed / radius, radius=radius, mass=mass
    )
    return Scene(
        disks=disks,
        disk_disk=law,
        walls=(Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law),),
        gravity=(g * np.sin(slope), -g * np.cos(slope)),
        initial_shear={(0, 1): -mass * deceleration - pull},
    )


@pytest.mark.parametrize("seed", range(6))
def test_a_constant_torque_slows_a_rolling_disk_evenly(seed: int) -> None:
    """``a = (2/3) g (mu_r cos(beta) - sin(beta))``: to round-off, for nothing but v and omega changes; it stops where a > 0."""
    rng = np.random.default_rng(seed)
    mu, slope, speed = rng.uniform(0.02, 0.3), rng.choice([0.0, rng.uniform(0.02, 0.4)]), rng.uniform(0.5, 3.0)
    a = 2.0 / 3.0 * 9.81 * (mu * np.cos(slope) - np.sin(slope))
    scene = rolling_scene(rng, Rolling(model="constant", mu=mu), slope=slope, speed=speed, deceleration=a)
    end = 0.9 * speed / abs(a)
    history = run(scene, numerics(1e-4, int(min(end, 1.0) / 1e-4), sample_every=100), [(0, 1)])
    t = history.t
    # The overlap's spring swings by the round-off of a position, 1e-16 R kn, in each of 1e4 steps.
    assert np.abs(history.v[:, 0, 0] - (speed - a * t)).max() < 1e-9 * speed
    assert np.abs(history.x[:, 0, 0] - (speed * t - 0.5 * a * t * t)).max() < 1e-9 * speed * max(end, 1.0)
    assert np.abs(history.omega[:, 0] * scene.disks.radius[0] + history.v[:, 0, 0]).max() < 1e-9 * speed


def test_a_rolling_disk_stops_under_a_constant_torque() -> None:
    """``t = 3 v0/(2 mu_r g)``, way ``3 v0^2/(4 mu_r g)``; afterwards it swings about rest by what the contact's shear spring gives."""
    rng, mu, speed = np.random.default_rng(1), 0.2, 1.0
    a = 2.0 / 3.0 * 9.81 * mu
    scene = rolling_scene(rng, Rolling(model="constant", mu=mu), slope=0.0, speed=speed, deceleration=a)
    law = replace(scene.disk_disk, beta=0.2)
    scene = scene.replace(walls=(replace(scene.walls[0], law=law),))
    history = run(scene, numerics(1e-4, 15_000, sample_every=100), [(0, 1)])
    after = history.t > 1.05 * speed / a
    assert after.sum() > 50
    springs = float(scene.disks.mass[0]) * 9.81 / law.ks
    assert history.x[after, 0, 0] == pytest.approx(0.75 * speed**2 / (mu * 9.81), abs=4.0 * springs)


@pytest.mark.parametrize("seed", range(3))
def test_a_viscous_torque_slows_a_rolling_disk_exponentially(seed: int) -> None:
    """``v = v0 exp(-b t)``, ``b = (2/3) mu_r g/(1 m/s)``: of second order in dt, and off by ``m b^2/ks``, 1e-5, as the spring gives."""
    rng = np.random.default_rng(seed)
    mu, speed = rng.uniform(0.05, 0.2), rng.uniform(0.5, 2.0)
    rate = 2.0 / 3.0 * 9.81 * mu
    scene = rolling_scene(rng, Rolling(model="viscous", mu=mu), slope=0.0, speed=speed, deceleration=rate * speed)
    history = run(scene, numerics(1e-4, 10_000, sample_every=100), [(0, 1)])
    assert history.v[:, 0, 0] == pytest.approx(speed * np.exp(-rate * history.t), abs=1e-5 * speed)


@pytest.mark.parametrize("seed", range(5))
def test_a_rolling_spring_swings_at_its_frequency(seed: int) -> None:
    """Two disks that only turn: ``omega^2 = kr (1/I_i + 1/I_j)``, in the scheme ``sin(omega' dt/2) = omega dt/2``: to round-off."""
    rng = np.random.default_rng(seed)
    kr = rng.uniform(10.0, 1000.0)
    law = ContactLaw(kn=KN, rolling=Rolling(model="elastic-plastic", mu=1e6, kr=kr))
    radius, mass = rng.uniform(0.5, 1.5, 2), rng.uniform(0.5, 2.0, 2)
    inertia = 0.5 * mass * radius**2
    spins = rng.normal(0.0, 1.0, 2)
    # Overlaps of 1e-3 m everywhere: walls press the disks together, and nothing moves but the spins.
    x = [[radius[0] - 1e-3, 0.0], [2.0 * radius[0] + radius[1] - 2e-3, 0.0]]
    smooth = ContactLaw(kn=KN)
    walls = (
        Wall(name="left", point=(0.0, 0.0), normal=(1.0, 0.0), law=smooth),
        Wall(name="right", point=(x[1][0] + radius[1] - 1e-3, 0.0), normal=(-1.0, 0.0), law=smooth),
    )
    scene = Scene(disks=Disks(x=x, radius=radius, mass=mass, omega=spins), disk_disk=law, walls=walls)
    omega, dt = np.sqrt(kr * np.sum(1.0 / inertia)), 1e-3
    discrete = 2.0 / dt * np.arcsin(0.5 * omega * dt)
    history = run(scene, numerics(dt, 2000), [(0, 1)])
    turned = history.angle[:, 0] - history.angle[:, 1]
    mean = (inertia * history.omega).sum(axis=1)
    assert mean == pytest.approx(float((inertia * spins).sum()), rel=1e-12, abs=1e-12)
    # Half a kick leads to the first half step, where there is no torque yet.
    swing = (spins[0] - spins[1]) * dt / np.sin(discrete * dt)
    assert np.abs(turned - swing * np.sin(discrete * history.t)).max() < 1e-10 * abs(swing)


@pytest.mark.parametrize("holds", [True, False])
def test_a_rolling_spring_holds_a_disk_up_to_its_limit(holds: bool) -> None:
    """At rest on a slope if mu_r >= tan(beta), else ``a = (2/3) g (sin(beta) - mu_r cos(beta))``: a percent from that angle either way."""
    mu = 0.2
    slope = np.arctan(mu) * (0.99 if holds else 1.01)
    rng = np.random.default_rng(0)
    rolling = Rolling(model="elastic-plastic", mu=mu, kr=2000.0, beta=0.5)
    scene = rolling_scene(rng, rolling, slope=slope, speed=0.0, deceleration=0.0)
    scene = scene.replace(walls=(replace(scene.walls[0], law=replace(scene.disk_disk, beta=0.3)),), initial_shear={})
    # Laid down by degrees: with its weight at once a spring swings to twice the torque that it holds.
    weight = scene.disks.mass[0] * np.array(scene.gravity)
    ramp = [
        BodyForce(disk=0, force=(-weight[0] * (1.0 - k / 40), 0.0), begin=0.05 * k, end=0.05 * (k + 1))
        for k in range(40)
    ]
    history = run(scene.replace(forces=ramp), numerics(1e-4, 60_000, sample_every=1000), [(0, 1)])
    v, x = history.v[history.t >= 5.0, 0, 0], history.x[history.t >= 5.0, 0, 0]
    if holds:
        assert (
            np.ptp(x) < 1e-6 * scene.disks.radius[0]
        )  # nothing damps the shear spring, which has taken up the last of the ramp
    else:
        a = 2.0 / 3.0 * 9.81 * (np.sin(slope) - mu * np.cos(slope))
        assert v[-1] - v[0] == pytest.approx(a, rel=0.01)


@pytest.mark.parametrize(("zeta", "share"), [(0.2155, 0.5), (0.05, 0.2), (0.4, 0.7), (0.0, 0.9)])
def test_rebound_with_linear_cohesion(zeta: float, share: float) -> None:
    """Restitution of the damping ratio ``zeta/sqrt(1 - c/kn)`` without a clip, in the time ``t_c/sqrt(1 - c/kn)``.

    ``zeta`` 0.2155, a restitution of 0.5 without cohesion, and c = kn/2 give 0.3660.
    """
    dt = 2e-4 / np.sqrt(2.0 * KN)
    scene = pair_scene(ContactLaw(kn=KN, beta=zeta, cohesion=share * KN), overlap=1e-13, closing=1.0)
    history = run(scene, numerics(dt, 80_000, sample_every=20))
    ratio, omega = zeta / np.sqrt(1.0 - share), np.sqrt(2.0 * KN * (1.0 - share))
    rebound = float(history.v[-1, 1, 0] - history.v[-1, 0, 0])
    # The contact opens within a step, at whose end the dashpot still pulls: its impulse in half a step, 2 zeta omega dt/2, relative.
    expected = np.exp(-np.pi * ratio / np.sqrt(1.0 - ratio**2))
    assert rebound == pytest.approx(expected, abs=1e-6 + 2e-4 * zeta * expected * 2.0)
    closed = history.t[history.gap[:, 0] < 0.0]
    assert closed[-1] == pytest.approx(np.pi / (omega * np.sqrt(1.0 - ratio**2)), abs=40.0 * dt)
    if share == 0.5:
        assert rebound == pytest.approx(0.3660, abs=5e-5)
        assert history.fn.min() < 0.0, "the dashpot pulls"


@pytest.mark.parametrize("seed", range(5))
def test_forces_on_a_free_disk(seed: int) -> None:
    """Impulses exact wherever forces begin and end; half-step velocities are those of the exact motion, whatever the step."""
    rng = np.random.default_rng(seed)
    dt, count = 0.01, 100
    forces = []
    for _ in range(4):
        begin, end = np.sort(rng.uniform(0.02, 0.97, 2))
        forces.append(
            BodyForce(disk=1, force=tuple(rng.normal(0.0, 3.0, 2)), torque=rng.normal(), begin=begin, end=end)
        )
    disks = Disks(
        x=[[0.0, 0.0], [9.0, 0.0]], v=[[0.0, 0.0], [1.0, -2.0]], omega=[0.0, 0.5], radius=[1.0, 2.0], mass=[1.0, 3.0]
    )
    scene = Scene(disks=disks, disk_disk=ContactLaw(kn=1.0), forces=forces)
    session = DemSession(scene, numerics(dt, count))
    for n in range(1, count):
        session.advance(1)
        v, omega = disks.v[1].copy(), float(disks.omega[1])
        for force in forces:
            span = max(min((n - 0.5) * dt, force.end) - min(force.begin, (n - 0.5) * dt), 0.0)
            v += span * np.array(force.force) / disks.mass[1]
            omega += span * force.torque / disks.inertia[1]
        now = session.snapshot()[1]
        assert now["v"][1] == pytest.approx(v, abs=1e-13)
        assert now["omega"][1] == pytest.approx(omega, abs=1e-13)
    assert (now["v"][0] == 0.0).all()
    energy = session.run().energy
    fed = energy["kinetic"][-1] - energy["kinetic"][0]
    assert energy["force_work"][-1] == pytest.approx(fed, abs=1e-12)


def balance(history: History) -> np.ndarray:
    """Energy that nothing accounts for [J]."""
    energy = history.energy
    total = sum(energy[name] for name in (*STATE, *LOSSES)) - energy["wall_work"] - energy["force_work"]
    return np.asarray(total - total[0])


ARMS = list(itertools.product(LEVER_ARMS, WALL_VELOCITY_AT, SLIP_AT))


@pytest.mark.sampled(4)
@pytest.mark.long
@pytest.mark.parametrize(("arm", "at", "slip_at", "xi"), [*((*each, 0.0) for each in ARMS), (*ARMS[0], 2.0)])
def test_the_channels_close_at_the_order_of_the_scheme(arm: Any, at: Any, slip_at: Any, xi: float) -> None:
    """Kinetic, elastic, gravity and what was lost, less what was fed, through impacts, sliding, rolling, cohesion, and walls that shake
    and turn, for every place where torque acts and slip is measured."""
    worst, scale = np.zeros(3), 0.0
    for seed in range(5):
        rng = np.random.default_rng([seed, 4])
        rolling = [Rolling(model="elastic-plastic", mu=0.2, kr=0.05 * KN, beta=0.2), Rolling(model="viscous", mu=0.3)]
        rolling += [Rolling(model="constant", mu=0.1), None]
        laws = [
            random_law(
                rng,
                kn=KN,
                ks=0.5 * KN,
                mu=0.4,
                beta=0.1,
                lever_arm=arm,
                slip_at=slip_at,
                wall_velocity_at=at,
                rolling=rolling[k],
            )
            for k in range(4)
        ]
        laws[1] = replace(laws[1], cohesion=0.2 * KN)
        shake = (WallSegment(amplitude=(0.05, 0.03), frequency=20.0),)
        turn = (WallSegment(angular_velocity=0.7, pivot=(-1.0, -1.0)),)
        walls = (
            Wall(name="floor", point=(0.0, -1.0), normal=(0.0, 1.0), law=laws[3], material="ash", motion=shake),
            Wall(name="left", point=(-1.2, 0.0), normal=(1.0, 0.1), law=laws[0], motion=turn),
            Wall(name="right", point=(5.0, 0.0), normal=(-1.0, 0.1), law=laws[1]),
        )
        disks = Disks(
            x=[[2.0 * i + 0.1 * j, 2.0 * j] for i in range(3) for j in range(3)],
            v=rng.normal(0.0, 3.0, (9, 2)),
            omega=rng.normal(0.0, 3.0, 9),
            radius=rng.uniform(0.7, 0.95, 9),
            mass=1.0,
            material=["ash", "", "oak"] * 3,
        )
        pairs = {("ash", "ash"): laws[1], ("ash", "oak"): laws[0], ("oak", "oak"): laws[2], ("", "oak"): laws[3]}
        force = BodyForce(disk=4, force=(5.0, 3.0), torque=2.0, begin=0.0113, end=0.3337)
        scene = Scene(
            disks=disks, disk_disk=laws[3], walls=walls, laws=pairs, gravity=(0.0, -9.81), xi=xi, forces=[force]
        )
        for k in range(3):
            steps = 400 * 2**k
            history = run(scene, numerics(0.6 / steps, steps, energy_budget=True), [])
            worst[k] += float(np.abs(balance(history)).max())
            for name in set(LOSSES) - {"law_loss"}:
                assert np.diff(history.energy[name]).min() >= -1e-9, (name, seed)
                assert (history.energy[name][-1] > 0.01) == (name != "damping_loss" or xi > 0.0)
        scale += float(history.energy["kinetic"].max())
        # Where torque and slip have one arm, and walls are felt on their surface, the law itself takes nothing.
        if arm != "torque-overlap" and at == "surface":
            assert not history.energy["law_loss"].any()
    assert worst[-1] < 2e-3 * scale
    assert np.mean(orders(worst.tolist())) == pytest.approx(2.0, abs=0.35), worst


def test_channels_cost_no_bit() -> None:
    scene, how = settled_packing(300), numerics(1e-4, 200, sample_every=20)
    assert_same_bits(run(scene, how, []), run(scene, how.replace(energy_budget=True), []))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"disk_disk": ContactLaw(kn=KN, cohesion=1.0)}, "has cohesion, which the DEM of outlines"),
        ({"disk_disk": ContactLaw(kn=KN, rolling=Rolling(model="constant", mu=0.1))}, "has rolling resistance, which"),
        ({"disk_disk": ContactLaw(kn=KN, adhesion=1.0)}, "has adhesion, which the DEM does not"),
    ],
)
def test_what_outlines_or_the_dem_lack_is_refused(changes: dict[str, Any], message: str) -> None:
    area = Wall(name="floor", point=(0.0, -9.0), normal=(0.0, 1.0), law=ContactLaw(kn=KN, contact="area"))
    scene = pair_scene(ContactLaw(kn=KN), overlap=0.01, closing=0.0, walls=(area,))
    with pytest.raises(InvalidSceneError, match=message):
        run(scene.replace(**changes), numerics(1e-3, 1), [])
    with pytest.raises(InvalidNumericsError, match="energy_budget is not allowed for outlines"):
        run(scene, numerics(1e-3, 1, energy_budget=True), [])


@pytest.mark.parametrize("model", MODELS)
def test_rolling_resistance_pulls_neither_momentum_nor_angular_momentum_from_nowhere(model: str) -> None:
    """Two smooth disks far from walls: the torque on one is the opposite of that on the other, so that the spins' sum stays."""
    rolling = Rolling(model=model, mu=0.3, **({"kr": 50.0, "beta": 0.1} if model == "elastic-plastic" else {}))  # type: ignore[arg-type]
    scene = pair_scene(ContactLaw(kn=KN, rolling=rolling), overlap=0.02, closing=0.3)
    scene = scene.replace(disks=replace(scene.disks, omega=[3.0, -1.0]))
    history = run(scene, numerics(1e-4, 500))
    assert history.omega.sum(axis=1) == pytest.approx(2.0, abs=1e-13)
    assert history.omega[-1, 0] < 2.9
