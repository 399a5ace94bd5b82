"""Problems of the suite ``flow``: many rigid frictional disks in motion, from states without overlap."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ninedisk.core import packings
from ninedisk.core.dem.neighbours import PairFinder
from ninedisk.core.law import ContactLaw
from ninedisk.core.motion import compile_motion, wall_poses
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene, Wall
from ninedisk.harness.bench.packings import kept, packing

FloatArray = NDArray[np.float64]
Tell = Callable[[int, int], None]

SIZES, LARGE = (1_000,), (10_000,)
STEP, STEPS = 5e-3, 40
"""Step [s] and number of steps; at 10 m/s a disk moves by a tenth of its radius in a step."""
FROUDE, LEAD = 0.1, 0.5
"""Centrifugal over gravity at the rim of a drum, and the turns that it makes before the measurement: the disks lie in a slope and flow
down it. The same rate of turns at every size would press the disks of a large drum to its rim."""
OPEN = 1.5
"""Time that a hopper discharges before the measurement [s]: the disks inside flow, those outside fall as far as 11 m."""
OUTLET = 10.0
"""Width of a hopper's outlet in mean diameters: wide enough that no arch stops the flow."""


@dataclass(frozen=True, kw_only=True)
class FlowProblem:
    """A scene of rigid disks and how long it is followed."""

    name: str
    scene: Scene
    dt: float = STEP
    steps: int = STEPS

    @property
    def n(self) -> int:
        """Number of disks."""
        return len(self.scene.disks)

    @property
    def seconds(self) -> float:
        """Simulated time [s]."""
        return self.dt * self.steps

    def numerics(self) -> Numerics:
        """Sampled four times on the way."""
        return Numerics(dt=self.dt, n_steps=self.steps, sample_every=self.steps // 4)

    def with_stiffness(self, kn: float) -> Scene:
        """The scene with springs of this stiffness [N/m] in all contacts, damped almost to no rebound."""

        def law(old: ContactLaw) -> ContactLaw:
            return replace(old, kn=kn, ks=0.5 * kn, beta=0.7)

        walls = tuple(replace(wall, law=law(wall.law)) for wall in self.scene.walls)
        return self.scene.replace(disk_disk=law(self.scene.disk_disk), walls=walls)


def problems(sizes: list[int], tell: Tell | None = None) -> dict[str, Callable[[], FlowProblem]]:
    """Makers of the problems by name."""
    made: dict[str, Callable[[], FlowProblem]] = {}
    for n in sizes:
        made[f"drum-{n}"] = lambda n=n: FlowProblem(name=f"drum-{n}", scene=apart(turning_drum(n, tell)))  # type: ignore[misc]
        made[f"collapse-{n}"] = lambda n=n: FlowProblem(  # type: ignore[misc]
            name=f"collapse-{n}", scene=apart(packings.collapse(packing(n, progress=tell)))
        )
        made[f"hopper-{n}"] = lambda n=n: FlowProblem(name=f"hopper-{n}", scene=apart(open_hopper(n, tell)))  # type: ignore[misc]
    return made


def turning_drum(n: int, tell: Tell | None = None) -> Scene:
    """A drum of ``n`` disks after `LEAD` turns on the in-house DEM, with the velocities of that time."""
    rim = math.hypot(*packings.drum(n).walls[0].point)
    turns = math.sqrt(FROUDE * packings.GRAVITY / rim) / (2.0 * math.pi)
    name = f"drum-{n}-{FROUDE:g}-{LEAD:g}"
    return kept(name, lambda: _after(LEAD / turns, packings.drum(n, turns_per_second=turns), tell))


def open_hopper(n: int, tell: Tell | None = None) -> Scene:
    """A hopper of ``n`` grains `OPEN` seconds after its plug has gone, with the velocities of that time and all walls at rest."""

    def full() -> Scene:
        return packings.settle(packings.hopper(n, outlet=OUTLET), progress=tell)

    def flowing() -> Scene:
        scene = _after(OPEN, packings.discharge(kept(f"hopper-{n}-{OUTLET:g}", full)), tell)
        return scene.replace(walls=tuple(replace(wall, motion=()) for wall in scene.walls))

    return kept(f"hopper-{n}-{OUTLET:g}-{OPEN:g}", flowing)


def _after(lead: float, scene: Scene, tell: Tell | None) -> Scene:
    """The scene ``lead`` seconds [s] later on the in-house DEM, walls and velocities as they are then."""
    from ninedisk.core.dem.critical import critical_time_step
    from ninedisk.core.dem.session import DemSession

    steps = int(np.ceil(lead / (0.2 * critical_time_step(scene))))
    dt = lead / steps
    numerics = Numerics(dt=dt, n_steps=steps, contact_dt=dt, sample_every=steps)
    history = DemSession(scene, numerics).run(tell)
    disks = replace(scene.disks, x=history.x[-1], v=history.v[-1], omega=history.omega[-1])
    return scene.replace(disks=disks, walls=tuple(_wall_at(wall, lead) for wall in scene.walls), initial_shear={})


def _wall_at(wall: Wall, time: float) -> Wall:
    """A wall as it is at a time [s], with its motion."""
    pose = wall_poses(compile_motion((wall,)), time)[0]
    return replace(wall, point=(pose[0], pose[1]), normal=(pose[2], pose[3]))


def apart(scene: Scene) -> Scene:
    """The scene with rigid contacts and all radii scaled down so far that nothing overlaps; masses stay.

    Rigid engines would take the overlaps of springs for errors to be mended, each in its own way.
    """

    def rigid(law: ContactLaw) -> ContactLaw:
        return replace(law, beta=0.0, restitution=0.0, regularised=True)

    radius = scene.disks.radius
    deepest = max(0.0, float(-relative_gaps(scene, scene.disks.x, 0.0).min(initial=0.0)))
    disks = replace(scene.disks, radius=radius * (1.0 - 1.001 * deepest))
    walls = tuple(replace(wall, law=rigid(wall.law)) for wall in scene.walls)
    return scene.replace(disks=disks, walls=walls, disk_disk=rigid(scene.disk_disk), initial_shear={})


def relative_gaps(scene: Scene, x: FloatArray, time: float) -> FloatArray:
    """Gaps of all pairs that touch or overlap, over the sum of the two radii (a wall has none), shape (k,).

    Parameters
    ----------
    scene : Scene
    x : ndarray, shape (n, 2)
        Centres [m] at ``time`` [s].
    """
    radius, n = scene.disks.radius, len(scene.disks)
    poses = wall_poses(compile_motion(scene.walls), time)
    pairs = PairFinder(radius, len(scene.walls), scene.disks.fixed).within(
        np.ascontiguousarray(x), poses, 1e-12 * float(radius.min())
    )
    i, j = pairs[pairs[:, 1] < n].T
    apart_by = np.hypot(*(x[j] - x[i]).T)
    reach = radius[i] + radius[j]
    k, w = pairs[pairs[:, 1] >= n].T
    wall = poses[w - n]
    height = ((x[k] - wall[:, 0:2]) * wall[:, 2:4]).sum(axis=1)
    return np.concatenate([apart_by / reach - 1.0, height / radius[k] - 1.0])
