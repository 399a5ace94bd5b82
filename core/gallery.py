"""Scenes that benchmarks, tests and users share: packings, a drum, biaxial compression, a column that collapses.

All are built from lengths in mean diameters of 1 m, masses of 1000 kg/m^2 and Earth's gravity; stiffness follows from the load,
so that the overlap at the bottom stays below a given fraction of a diameter.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall, WallSegment

FloatArray = NDArray[np.float64]

DENSITY, GRAVITY = 1000.0, 9.81
SPREAD = (0.4, 0.6)
"""Radii are uniform in this range [m]: mean diameter 1 m, no crystal."""

STILL = 1e-9
"""A packing has settled when its kinetic energy is this fraction of the energy of a fall by one diameter."""


def contact_law(height: float, *, overlap: float = 0.005, mu: float = 0.5, beta: float = 0.2) -> ContactLaw:
    """Law whose contacts overlap by about ``overlap`` diameters under a column of the given height [m]."""
    kn = DENSITY * GRAVITY * height / overlap
    return ContactLaw(kn=kn, ks=0.5 * kn, mu=mu, beta=beta, restitution=0.0)


def poured(columns: int, rows: int, *, seed: int = 0, mu: float = 0.5, overlap: float = 0.005) -> Scene:
    """Disks on a loose lattice between three walls, about to fall.

    Parameters
    ----------
    columns, rows : int
        Disks along and across the floor, >= 1.
    seed : int
        Of the radii and of small displacements.
    mu : float
        Friction coefficient, >= 0.
    overlap : float
        Overlap over diameter that the weight causes at the floor, in (0, 0.1].

    Returns
    -------
    Scene

    Raises
    ------
    InvalidSceneError
        If a value is out of range.
    """
    _positive(columns=columns, rows=rows)
    if not 0.0 < overlap <= 0.1:
        raise InvalidSceneError(f"overlap = {overlap!r} is not allowed: it must lie in (0, 0.1]")
    rng = np.random.default_rng(seed)
    pitch = 2.0 * SPREAD[1]
    grid = np.array([(i, j) for j in range(rows) for i in range(columns)], dtype=np.float64)
    x = pitch * (grid + 0.5) + rng.uniform(-0.05, 0.05, grid.shape)
    x[:, 0] += 0.1
    x[:, 1] += 0.1
    radius = rng.uniform(*SPREAD, len(x)) * 0.9
    law = contact_law(0.85 * pitch * rows, overlap=overlap, mu=mu)
    return Scene(
        disks=_disks(x, radius), disk_disk=law, walls=_box(pitch * columns + 0.2, law), gravity=(0.0, -GRAVITY)
    )


def settle(scene: Scene, *, progress: Callable[[int, int], None] | None = None, threads: int = 1) -> Scene:
    """The scene at rest: run by the DEM under heavy global damping until it is still.

    Parameters
    ----------
    scene : Scene
        Disks under gravity.
    progress : callable, optional
        Called with (steps done, at most to do).
    threads : int
        As in `DemSession`.

    Returns
    -------
    Scene
        Same disks, where they came to rest, without velocities; their contacts keep the shear forces.

    Raises
    ------
    InvalidSceneError
        If nothing pulls the disks together, or they do not come to rest.
    """
    from ninedisk.core.dem.critical import critical_time_step
    from ninedisk.core.dem.session import DemSession

    g = math.hypot(*scene.gravity)
    if g == 0.0:
        raise InvalidSceneError("a scene without gravity does not settle: give it one, or walls that press")
    disks = scene.disks
    height = float(np.ptp(disks.x @ np.array(scene.gravity)) / g)
    fall = math.sqrt(2.0 * max(height, 1.0) / g)
    dt = 0.2 * critical_time_step(scene)
    per = max(1, math.ceil(0.25 * fall / dt))
    target = STILL * float(disks.mass.sum()) * g * 2.0 * float(disks.radius.mean())
    rounds = 60
    damped = scene.replace(xi=4.0 / fall)
    numerics = Numerics(dt=per * dt, n_steps=rounds, contact_dt=dt, sample_every=1)
    session = DemSession(damped, numerics, threads=threads)
    for done in range(1, rounds + 1):
        session.advance(1)
        if progress is not None:
            progress(done, rounds)
        history = session.history()
        if done > 4 and history.energy["kinetic"][-1] < target:
            rest = _disks(history.x[-1], disks.radius, disks.mass)
            return scene.replace(disks=rest, initial_shear=session.shear_forces())
    raise InvalidSceneError(
        f"the scene has not come to rest after {rounds * per} steps: kinetic energy {history.energy['kinetic'][-1]:.3g} J, "
        f"still means {target:.3g} J; is a wall missing, or does one move?"
    )


def settled_packing(
    n: int, *, seed: int = 0, aspect: float = 1.0, progress: Callable[[int, int], None] | None = None, threads: int = 1
) -> Scene:
    """A settled packing of about ``n`` disks, ``aspect`` times as high as wide.

    Parameters
    ----------
    n : int
        Number of disks, >= 1; rounded to a whole lattice.
    seed : int
    aspect : float
        Height over width, > 0; 50 makes a tall column.
    progress, threads
        As in `settle`.
    """
    _positive(n=n, aspect=aspect)
    columns = max(1, round(math.sqrt(n / aspect)))
    return settle(poured(columns, max(1, round(n / columns)), seed=seed), progress=progress, threads=threads)


def side_by_side(scene: Scene, copies: int) -> Scene:
    """``copies`` of a box scene next to each other, without the walls between: size without another settling.

    Shear forces at walls start anew.

    Raises
    ------
    InvalidSceneError
        If the scene is not one of `poured`'s boxes.
    """
    _positive(copies=copies)
    if [wall.name for wall in scene.walls] != ["left", "right", "bottom"]:
        raise InvalidSceneError("side_by_side takes a box with the walls left, right, bottom")
    disks, width = scene.disks, scene.walls[1].point[0]
    n = len(disks)
    x = np.concatenate([disks.x + np.array([k * width, 0.0]) for k in range(copies)])
    tiled = _disks(x, np.tile(disks.radius, copies), np.tile(disks.mass, copies))
    shear = {
        (i + k * n, j + k * n): force for k in range(copies) for (i, j), force in scene.initial_shear.items() if j < n
    }
    return scene.replace(disks=tiled, walls=_box(copies * width, scene.disk_disk), initial_shear=shear)


def drum(n: int, *, seed: int = 0, turns_per_second: float = 0.05, sides: int = 24, fill: float = 0.4) -> Scene:
    """Disks in a rotating polygon, about to fall to its bottom.

    Parameters
    ----------
    n : int
        Number of disks, >= 1.
    seed : int
    turns_per_second : float
        Rate of rotation [1/s], counter-clockwise.
    sides : int
        Sides of the drum, >= 3.
    fill : float
        Part of the drum that the disks fill, in (0, 0.6].
    """
    _positive(n=n)
    if not (isinstance(sides, int) and sides >= 3):
        raise InvalidSceneError(f"sides = {sides!r} is not allowed: it must be a whole number >= 3")
    if not 0.0 < fill <= 0.6:
        raise InvalidSceneError(f"fill = {fill!r} is not allowed: it must lie in (0, 0.6]")
    rng = np.random.default_rng(seed)
    pitch = 2.0 * SPREAD[1]
    inner = max(2.0 * pitch, pitch * math.sqrt(n / (fill * math.pi)))
    side = math.ceil(2.0 * inner / pitch)
    grid = np.array([(i, j) for j in range(side) for i in range(side)], dtype=np.float64)
    places = pitch * (grid - 0.5 * (side - 1))
    places = places[np.hypot(places[:, 0], places[:, 1]) < inner - pitch][:n]
    if len(places) < n:
        raise InvalidSceneError(
            f"a drum filled by {fill:g} holds only {len(places)} of {n} disks on a lattice: fill less"
        )
    law = contact_law(inner)
    spin = 2.0 * math.pi * turns_per_second
    walls = []
    for k in range(sides):
        angle = 2.0 * math.pi * k / sides
        out = (math.cos(angle), math.sin(angle))
        motion = (WallSegment(angular_velocity=spin, pivot=(0.0, 0.0)),) if spin else ()
        walls.append(
            Wall(
                name=f"side {k}",
                point=(inner * out[0], inner * out[1]),
                normal=(-out[0], -out[1]),
                law=law,
                motion=motion,
            )
        )
    x = places + rng.uniform(-0.05, 0.05, places.shape)
    return Scene(
        disks=_disks(x, rng.uniform(*SPREAD, n) * 0.9), disk_disk=law, walls=tuple(walls), gravity=(0.0, -GRAVITY)
    )


def biaxial(columns: int, rows: int, *, seed: int = 0, strain: float = 0.02, duration: float = 10.0) -> Scene:
    """Disks without gravity between four walls of which top and bottom close in.

    Parameters
    ----------
    columns, rows : int
        Disks along the sides, >= 1.
    seed : int
    strain : float
        Part of the height by which each of the two walls moves in, in (0, 0.3].
    duration : float
        Time that they take [s], > 0.
    """
    if not 0.0 < strain <= 0.3:
        raise InvalidSceneError(f"strain = {strain!r} is not allowed: it must lie in (0, 0.3]")
    _positive(duration=duration)
    base = poured(columns, rows, seed=seed)
    height = 2.0 * SPREAD[1] * rows + 0.2
    law = base.disk_disk
    speed = strain * height / duration
    bottom = (WallSegment(duration=duration, velocity=(0.0, speed)),)
    top = (WallSegment(duration=duration, velocity=(0.0, -speed)),)
    walls = (
        *base.walls[:2],
        Wall(name="bottom", point=(0.0, 0.0), normal=(0.0, 1.0), law=law, motion=bottom),
        Wall(name="top", point=(0.0, height), normal=(0.0, -1.0), law=law, motion=top),
    )
    return base.replace(walls=walls, gravity=(0.0, 0.0), xi=1.0)


def collapse(scene: Scene, *, speed: float = 20.0) -> Scene:
    """A settled box whose right wall is pulled away: the collapse of a column.

    Parameters
    ----------
    scene : Scene
        One of `settled_packing`.
    speed : float
        Speed of the wall [m/s], > 0; faster than the grains fall.
    """
    _positive(speed=speed)
    walls = [
        Wall(
            name=wall.name,
            point=wall.point,
            normal=wall.normal,
            law=wall.law,
            motion=(WallSegment(velocity=(speed, 0.0)),),
        )
        if wall.name == "right"
        else wall
        for wall in scene.walls
    ]
    return scene.replace(walls=tuple(walls))


def _disks(x: FloatArray, radius: FloatArray, mass: FloatArray | None = None) -> Disks:
    return Disks(x=x, radius=radius, mass=DENSITY * math.pi * radius**2 if mass is None else mass)


def _box(width: float, law: ContactLaw) -> tuple[Wall, ...]:
    return (
        Wall(name="left", point=(0.0, 0.0), normal=(1.0, 0.0), law=law),
        Wall(name="right", point=(width, 0.0), normal=(-1.0, 0.0), law=law),
        Wall(name="bottom", point=(0.0, 0.0), normal=(0.0, 1.0), law=law),
    )


def _positive(**values: float) -> None:
    for name, value in values.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not value > 0:
            raise InvalidSceneError(f"{name} = {value!r} is not allowed: it must be > 0")
