"""Slip along retraced paths and rolling: what of it stays, at the level of the kernels and of runs."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from ninedisk.core import ContactLaw, Disks, Numerics, Scene, Wall, WallSegment, simulate
from ninedisk.core.dem.arrays import (
    disk_arrays,
    disk_views,
    first_lists,
    law_row,
    step_constants,
    team_arrays,
    wall_arrays,
)
from ninedisk.core.dem.neighbours import empty_list
from ninedisk.core.dem.plane.force_kernels import SCRATCH, disk_disk_forces, disk_wall_forces, note_pairs
from ninedisk.core.dem.plane.grain_kernels import grain_forces
from ninedisk.core.dem.plane.grains import outline_arrays
from ninedisk.core.dem.state import NeighbourList, System
from ninedisk.core.nurbs.curve import NurbsCurve
from ninedisk.core.nurbs.mass import uniform_grain
from ninedisk.core.nurbs.shapes import ellipse
from ninedisk.core.scene.motion import compile_motion

KS = 1e4
LAW = ContactLaw(kn=KS, ks=KS, mu=1e6)
STEPS = 400
CYCLES = 3

Array = np.ndarray


def retraced(rng: np.random.Generator, steps: int) -> tuple[Array, dict[str, float]]:
    """Phase s of a path that goes to and fro, sin(2 pi t/T + phase), at the steps of some cycles; its random numbers."""
    loop = {"size": 10.0 ** rng.uniform(-2, 2), "a": rng.uniform(0.003, 0.02), "b": rng.uniform(0.003, 0.02)}
    loop |= {"period": 10.0 ** rng.uniform(-3, 1), "phase": rng.uniform(0.0, 2.0 * np.pi)}
    s = np.sin(2.0 * np.pi * np.arange(CYCLES * steps + 1) / steps + loop["phase"])
    return s, loop


def listed(other: int) -> NeighbourList:
    """The list of the only pair: of row 0 with that disk."""
    pairs = empty_list(2, 4)
    pairs.start[:], pairs.other[0] = [0, 1, 1], other
    return pairs


def pair_shear(x: Array, dt: float, radius: float, law: ContactLaw, spins: Array) -> Array:
    """Shear force [N] of two disks that are led along x, shape (s, 2, 2), with spins of shape (s, 2) in the steps that end there."""
    scene = Scene(disks=Disks(x=x[0], radius=radius, mass=1.0), disk_disk=law)
    disks, lists, row = disk_arrays(scene, lagged=True), first_lists(2, 0), np.array(law_row(law))
    lists = lists._replace(pairs=listed(1))
    views = disk_views(disks, lists, row)
    note_pairs(disks, views, lists.pairs, row, None)
    scratch, found = np.zeros(SCRATCH), np.empty(len(x))
    for n in range(len(x)):
        disks.x[:] = x[n]
        if n:
            disks.v[:], disks.omega[:] = (x[n] - x[n - 1]) / dt, spins[n]
        disk_disk_forces(disks, views, lists.pairs, row, None, None, 0, dt if n else 0.0, dt, 0, 2, scratch)
        found[n] = lists.pairs.shear[0]
    return found


def pair_path(s: Array, loop: dict[str, float]) -> Array:
    """Two disks, sunk by a tenth of their radius, whose distance and direction follow s."""
    distance = loop["size"] * (1.9 + loop["a"] * s)
    angle = 0.7 + loop["b"] * s
    second = distance[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    return np.stack([0.0 * second, second], axis=1)


def drifts(shear: Array, steps: int) -> Array:
    """What each cycle adds to the slip [m]."""
    return np.diff(shear[::steps]) / KS


@pytest.mark.parametrize("arm", ["radius", "overlap"])
@pytest.mark.parametrize("seed", range(8))
def test_a_pair_that_retraces_its_path_returns(seed: int, arm: str) -> None:
    def drift(steps: int, slip_at: str) -> tuple[float, float]:
        s, loop = retraced(np.random.default_rng(seed), steps)
        law = replace(LAW, slip_at=slip_at, lever_arm=arm)  # type: ignore[arg-type]
        dt = loop["period"] / steps
        spins = np.repeat(np.diff(0.3 * loop["b"] * s, prepend=0.0)[:, None] / dt, 2, axis=1)
        found = drifts(pair_shear(pair_path(s, loop), dt, loop["size"], law, spins), steps)
        size, a, b = (loop[name] for name in ("size", "a", "b"))
        # -(dt/2) times the integral of r' phi', each the amplitude times a cosine; with arms R - overlap/2, which grow by half of r', the
        # spins of 0.3 phi' add the same.
        predicted = -(np.pi**2) / steps * size * a * b * (1.0 if arm == "radius" else 1.3)
        return float(np.abs(found).max() / (size * max(a, b))), float(np.abs(found - predicted).max() / abs(predicted))

    assert drift(STEPS, "middle")[0] <= 1e-9
    coarse, fine = drift(40, "middle")[0], drift(80, "middle")[0]
    # dt^3, or round-off: 2e-16 of the displacement of a hundred steps, over an amplitude of a hundredth.
    assert fine <= coarse / 6.0 + 1e-12
    # The prediction is the first term in dt.
    assert drift(STEPS, "end")[1] <= 0.02


def wall_shear(s: Array, loop: dict[str, float], steps: int, law: ContactLaw, outlined: bool) -> Array:
    """Shear force [N] of a fixed body at a wall that turns about its own point and comes and goes, both as s does.

    The wall is placed as the step kernel places it: at t_n, and in the middle of the step; the body does not move, so its path is the
    wall's.
    """
    dt, size = loop["period"] / steps, loop["size"]
    frequency, phase = 2.0 * np.pi / loop["period"], loop["phase"]
    point = np.array([0.4 * size, 0.1 * size])
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law)
    shape: dict[str, object] = {"radius": size, "mass": 1.0}
    outlines: tuple[NurbsCurve, ...] = ()
    if outlined:
        grain = uniform_grain(ellipse(1.2 * size, 0.8 * size), 1.0)
        shape = {"radius": grain.radius, "mass": 1.0, "inertia": 1.0, "outline": [0]}
        outlines = (grain.outline,)
    scene = Scene(
        disks=Disks(x=[[0.0, (0.8 if outlined else 1.0) * size]], held=[[True, True]], **shape),  # type: ignore[arg-type]
        disk_disk=law,
        walls=(floor,),
        outlines=outlines,
    )
    disks, walls = disk_arrays(scene, lagged=True), wall_arrays(scene, compile_motion(scene.walls), 1)
    pairs = empty_list(1, 4)
    pairs.start[:], pairs.other[0] = [0, 1], 0
    lists, row = first_lists(1, 1)._replace(wall_pairs=pairs), np.array(law_row(law))
    arrays = outline_arrays(scene) if outlined else None
    constants = step_constants(scene, Numerics(dt=dt, n_steps=1, contact_dt=dt, damping_form="lagged"), dt, False)
    system = System(disks, disk_views(disks, lists, row), walls, lists, row, constants, team_arrays(1, 1))

    def pose(t: float) -> Array:
        place, turn = (amount * np.sin(frequency * t + phase) for amount in (loop["a"] * size, loop["b"]))
        rate = frequency * np.cos(frequency * t + phase)
        x, y = point[0], point[1] + place
        return np.array(
            [x, y, -np.sin(turn), np.cos(turn), x, y, 0.0, loop["a"] * size * rate, loop["b"] * rate, 0.0, 0.0]
        )

    found = np.empty(len(s))
    for n in range(len(s)):
        walls.now[0], walls.middle[0] = pose(n * dt), pose((n - 0.5) * dt)
        walls.now[0, 6:9] = walls.middle[0, 6:9]
        if arrays is None:
            disk_wall_forces(disks, walls, pairs, None, None, dt if n else 0.0, dt, 0, 1, 0)
            found[n] = pairs.shear[0]
        else:
            assert grain_forces(system, arrays, n, dt if n else 0.0)
            side = int(arrays.memory.mark[0])
            found[n] = arrays.memory.contact[side, 0, 0]
    return found


@pytest.mark.long
@pytest.mark.parametrize("body", ["disk", "grain"])
@pytest.mark.parametrize("seed", range(4))
def test_a_wall_that_retraces_its_path_returns(seed: int, body: str) -> None:
    def drift(steps: int, slip_at: str, at: str) -> tuple[float, float]:
        s, loop = retraced(np.random.default_rng(seed), steps)
        law = replace(LAW, slip_at=slip_at, wall_velocity_at=at)  # type: ignore[arg-type]
        found = drifts(wall_shear(s, loop, steps, law, body == "grain"), steps)
        size, a, b = (loop[name] for name in ("size", "a", "b"))
        predicted = np.pi**2 / steps * size * a * b
        return float(np.abs(found).max() / (size * max(a, b))), float(
            np.abs(np.abs(found) - predicted).max() / predicted
        )

    for at in ("surface", "mid-overlap"):
        assert drift(STEPS, "middle", at)[0] <= 1e-9
        coarse, fine = drift(40, "middle", at)[0], drift(80, "middle", at)[0]
        assert fine <= coarse / 6.0 + 1e-12
    if body == "disk":  # the wall's point comes and goes by the path's a, and its normal turns by b
        assert drift(STEPS, "end", "surface")[1] <= 0.05


@pytest.mark.long
@pytest.mark.parametrize("seed", range(4))
def test_grains_that_retrace_their_path_return(seed: int) -> None:
    def drift(steps: int, slip_at: str) -> float:
        s, loop = retraced(np.random.default_rng(seed), steps)
        dt, size = loop["period"] / steps, loop["size"]
        law = replace(LAW, slip_at=slip_at, lever_arm="overlap")  # type: ignore[arg-type]
        grains = [
            uniform_grain(ellipse(1.2 * size, 0.8 * size), 1.0),
            uniform_grain(ellipse(0.9 * size, 1.1 * size), 1.0),
        ]
        path = pair_path(s, {**loop, "size": 0.97 * size})
        scene = Scene(
            disks=Disks(x=path[0], radius=[g.radius for g in grains], mass=1.0, inertia=1.0, outline=[0, 1]),
            disk_disk=law,
            outlines=tuple(g.outline for g in grains),
        )
        disks, walls = disk_arrays(scene, lagged=True), wall_arrays(scene, compile_motion(()), 1)
        arrays, row = outline_arrays(scene), np.array(law_row(law))
        constants = step_constants(scene, Numerics(dt=dt, n_steps=1, contact_dt=dt, damping_form="lagged"), dt, False)
        lists = first_lists(2, 0)._replace(pairs=listed(1))
        system = System(disks, disk_views(disks, lists, row), walls, lists, row, constants, team_arrays(1, 1))
        angle = loop["b"] * np.column_stack([s, -0.6 * s])
        found = np.empty(len(s))
        for n in range(len(s)):
            disks.x[:], disks.angle[:] = path[n], angle[n]
            if n:
                disks.v[:], disks.omega[:] = (path[n] - path[n - 1]) / dt, (angle[n] - angle[n - 1]) / dt
            assert grain_forces(system, arrays, n, dt if n else 0.0)
            side = int(arrays.memory.mark[0])
            assert arrays.memory.mark[1 + side] == 1
            found[n] = arrays.memory.contact[side, 0, 0]
        return float(np.abs(drifts(found, steps)).max() / (size * max(loop["a"], loop["b"])))

    assert drift(STEPS, "middle") <= 1e-9
    assert drift(STEPS, "end") > 1e-6


@pytest.mark.parametrize("method", ["dem", "cd"])
def test_runs_at_a_wall_that_swings(method: str) -> None:
    """A body too heavy to move; the wall turns to and fro by square waves while it comes up by 2 A and goes back."""
    rise, turn, period = 0.01, 0.1, 1.0

    def drift(steps: int, slip_at: str) -> float:
        law = replace(LAW, mu=100.0, slip_at=slip_at)  # type: ignore[arg-type]
        there = WallSegment(duration=0.5 * period, velocity=(0.0, 4.0 * rise / period), angular_velocity=turn)
        back = WallSegment(duration=0.5 * period, velocity=(0.0, -4.0 * rise / period), angular_velocity=-turn)
        floor = Wall(name="floor", point=(0.3, 0.05), normal=(0.0, 1.0), law=law, motion=(there, back) * CYCLES)
        disks = Disks(x=[[0.0, 1.0]], radius=1.0, mass=1e14, inertia=1e14)
        dt = period / steps
        numerics = Numerics(dt=dt, n_steps=steps * CYCLES, contact_dt=dt, sample_every=steps, theta=0.5)
        history = simulate(Scene(disks=disks, disk_disk=law, walls=(floor,)), numerics, [(0, 1)], method=method)
        return float(np.diff(history.fs[:, 0])[-1] / KS)

    # Forces of 1e3 N move 1e14 kg by 1e-11 m in a second.
    assert abs(drift(STEPS // 4, "middle")) <= 1e-11
    if method == "dem":
        dt = period / 100
        assert drift(100, "end") == pytest.approx(2.0 * rise * turn * dt, rel=0.01)
    else:
        assert drift(100, "end") > 1e-6


R, DENSITY, KN, STIFFNESS, G = 5e-3, 2500.0, 1e4, 8235.0, 9.81
BETA = -math.log(0.5) / math.hypot(math.pi, math.log(0.5))


def law(mu, slip_at):
    return ContactLaw(kn=KN, ks=STIFFNESS, mu=mu, beta=BETA, slip_at=slip_at)


def grain(ratio):
    """Radius and mass (that of a sphere) of the small disk, and a step of a seventh of the stable one's size."""
    r = R / ratio
    m = DENSITY * 4.0 / 3.0 * math.pi * r**3
    return r, m, 0.2 * math.sqrt(m / KN)


@pytest.mark.parametrize("ratio", [1.0, 3.0, 20.0])
def test_rolling_in_the_plane_adds_no_slip(ratio):
    """The end adds ``-(dt/2) r' phi' dt`` to a step's slip, and a rolling disk's distance r changes by its overlap alone.

    While it rolls off, the overlap falls from ``m g/kn`` to nothing: the slip that is added is below ``(dt/2) phi' m g/kn``, and its
    force below ``dt phi' ks/(2 mu kn)`` of the friction at full weight, twice that on half of it. In space a sphere that rolls in the
    groove between two others slides ``(dt/2) (v^2/rho) cos(alpha)`` per unit of time across the way that it rolls, away from the
    groove: (dt/2) times the acceleration of its turning, whatever r' is. In LAMMPS' example that has become sixty times the slip that
    friction bears after 48 degrees, and holds the sphere in the groove.
    """
    (r, m, dt), mu, start = grain(ratio), 0.5, math.radians(1.0)
    distance = R + r - m * G * math.cos(start) / KN
    disks = Disks(
        x=[(0.0, 0.0), (distance * math.sin(start), distance * math.cos(start))], radius=[R, r], mass=m,
        rotating=[False, True], held=[[True, True], [False, False]],
    )  # fmt: skip
    speed, found = math.sqrt(4.0 * G / (3.0 * (R + r))), {}
    for slip_at in ("middle", "end"):
        scene = Scene(disks=disks, disk_disk=law(mu, slip_at), gravity=(0.0, -G))
        count = math.ceil(9.0 / speed / (100.0 * dt))
        numerics = Numerics(dt=100.0 * dt, n_steps=count, contact_dt=dt, damping_form="lagged")
        found[slip_at] = simulate(scene, numerics, watch=[(0, 1)])
    middle, end = found["middle"], found["end"]
    held = middle.fn[:, 0] > 0.05 * m * G
    assert 0.3 * len(held) < held.sum() < len(held)
    added = np.abs(end.fs - middle.fs)[held, 0] / (mu * middle.fn[held, 0])
    assert added.max() < dt * speed * STIFFNESS / (mu * KN)
    assert added.max() < 1e-5
    # Both released it, at the same place.
    last = int(np.flatnonzero(held)[-1])
    assert middle.gap[-1, 0] > r
    np.testing.assert_allclose(end.x[last, 1], middle.x[last, 1], atol=1e-6 * r)


@pytest.mark.parametrize(("ratio", "sticks"), [(7.0, False), (10.0, True), (20.0, True)])
@pytest.mark.parametrize("slip_at", ["middle", "end"])
def test_a_disk_pressed_between_two_sticks_by_coulomb_s_law(ratio, sticks, slip_at):
    """Between two disks that touch, the normals rise by alpha, ``tan(alpha) = sqrt(2 q + 1)/q`` with the ratio q of the radii.

    Pressed in until it slides, it can stay against its own weight turned round if ``tan(alpha) <= mu``: from q = 8.5 on for mu = 1/2,
    1 + sqrt(2) for mu = 1. That is statics: it does so with slip measured in either place. In LAMMPS' example the same angle decides
    whether what the end adds can hold a sphere: from q = 12 on for mu = 1/2, 5 for mu = 1, not at 9 and 3, and never with the middle.
    """
    mu = 0.5
    assert (math.sqrt(2.0 * ratio + 1.0) / ratio <= mu) is sticks
    (r, m, dt), press = grain(ratio), 300.0
    height = math.sqrt((R + r) ** 2 - R**2)
    sunk, period = press * m * G / KN, 400.0 * dt
    motion = (
        WallSegment(duration=50.0 * period, amplitude=(0.0, 0.5 * sunk), frequency=2.0 * math.pi / period, phase=0.5 * math.pi),
        WallSegment(duration=50.0 * period, velocity=(0.0, r / (50.0 * period))),
    )  # fmt: skip
    lid = Wall(name="lid", point=(0.0, height + r), normal=(0.0, -1.0), law=ContactLaw(kn=KN), motion=motion)
    place = {
        "radius": [R, R, r],
        "mass": m,
        "rotating": [False, False, True],
        "held": [[True] * 2, [True] * 2, [False] * 2],
    }
    rough, watch = law(mu, slip_at), [(0, 2), (1, 2)]
    numerics = Numerics(dt=period, n_steps=150, contact_dt=dt, damping_form="lagged")
    pressed = simulate(
        Scene(disks=Disks(x=[(-R, 0.0), (R, 0.0), (0.0, height)], **place), disk_disk=rough, walls=(lid,), gravity=(0.0, -G)),
        numerics, watch=watch,
    )  # fmt: skip
    assert pressed.fn[-1].min() > 0.3 * m * G
    turned = simulate(
        Scene(
            disks=Disks(x=pressed.x[-1], v=pressed.v[-1], omega=pressed.omega[-1], **place), disk_disk=rough, gravity=(0.0, G),
            initial_shear={pair: float(pressed.fs[-1, k]) for k, pair in enumerate(watch)},
        ),
        numerics.replace(n_steps=300), watch=watch,
    )  # fmt: skip
    if sticks:
        assert turned.fn[-1].min() > 5.0 * m * G
        np.testing.assert_allclose(turned.fs[-1, 0] / turned.fn[-1, 0], math.sqrt(2.0 * ratio + 1.0) / ratio, rtol=0.1)
    else:
        assert turned.gap[-1].min() > 0.0
