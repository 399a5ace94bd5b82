"""Random scenes for the two methods of the core, and the same scene in another frame, numbering or unit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from hypothesis import strategies as st

from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall, WallSegment
from ninedisk.core.simulate import simulate

Run = Callable[[Scene, Numerics, list[tuple[int, int]]], History]
"""What a check asks of an engine; a planted defect is another one."""

KN = 1e4


@dataclass(frozen=True)
class World:
    """A scene with its numerics and the method that runs it."""

    method: str
    scene: Scene
    numerics: Numerics

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """All pairs of bodies."""
        n = len(self.scene.disks)
        return [(i, j) for i in range(n) for j in range(i + 1, self.scene.n_bodies)]

    @property
    def rigid(self) -> bool:
        return self.method == "cd"

    def core(self, scene: Scene, numerics: Numerics, watch: list[tuple[int, int]]) -> History:
        """The core as it is."""
        return simulate(scene, numerics, watch, method=self.method)  # type: ignore[arg-type]

    def watched(self, run: Run) -> History:
        return run(self.scene, self.numerics, self.pairs)


def world(method: str, *, seed: int, n: int, law: ContactLaw, walls: int, pull: float, steps: int) -> World:
    """A loose cluster that is thrown together on up to four walls; contacts open, close, slide and stick within the run."""
    rng = np.random.default_rng(seed)
    side = int(np.ceil(np.sqrt(n)))
    radius = rng.uniform(0.5, 1.0, n)
    x = np.array([[2.1 * (k % side), 2.1 * (k // side)] for k in range(n)]) + rng.uniform(-0.04, 0.04, (n, 2))
    centre = x.mean(axis=0)
    size = 2.1 * side
    # Each disk crosses its distance to the next in half of the run.
    dt = 1e-3 if method == "dem" else 2e-2
    v = (0.6 * (centre - x) + rng.normal(0.0, 0.3, (n, 2))) / (steps * dt)
    faces = [((0.0, 1.0), -1.05), ((1.0, 0.0), -1.05), ((-1.0, 0.0), -1.05), ((0.0, -1.0), -1.05)]
    made = []
    for k, (normal, reach) in enumerate(faces[:walls]):
        corner = np.array([0.0, 0.0]) if sum(normal) > 0 else np.array([size - 2.1, size - 2.1])
        made.append(Wall(name=f"w{k}", point=tuple(corner + reach * np.array(normal)), normal=normal, law=law))
    scene = Scene(
        disks=Disks(
            x=x,
            v=v,
            omega=rng.normal(0.0, 1.0, n) / (steps * dt),
            radius=radius,
            mass=radius**2 * rng.uniform(1.0, 3.0, n),
        ),
        disk_disk=law,
        walls=tuple(made),
        gravity=(0.3 * pull / (steps * dt) ** 2, -pull / (steps * dt) ** 2),
    )
    if method == "dem":
        return World(method, scene, Numerics(dt=dt, contact_dt=dt, n_steps=steps))
    return World(method, scene, Numerics(dt=dt, n_steps=steps, theta=1.0, solver="interior-point"))


@st.composite
def worlds(draw: st.DrawFn, method: str, *, walls: int = 4, most: int = 7) -> World:
    """Scenes whose features come one by one, so that a failure shrinks to the fewest that it takes."""
    soft = method == "dem"
    law: dict[str, Any] = {
        "kn": KN,
        "ks": KN * draw(st.sampled_from([0.0, 0.5, 1.0])),
        "mu": draw(st.sampled_from([0.0, 0.1, 0.5, 2.0])),
    }
    if soft:
        law["mu"] *= law["ks"] > 0.0  # friction needs a shear spring
        law |= {
            "beta": draw(st.sampled_from([0.0, 0.1])),
            "lever_arm": draw(st.sampled_from(["radius", "overlap", "torque-overlap"])),
        }
    else:
        law |= {"ks": KN, "regularised": True, "restitution": 0.0}
    return world(
        method,
        seed=draw(st.integers(0, 2**20)),
        n=draw(st.integers(2, most)),
        law=ContactLaw(**law),
        walls=draw(st.integers(0, walls)),
        pull=draw(st.sampled_from([0.0, 1.0])),
        steps=60 if soft else 12,
    )


def moved(scene: Scene, *, angle: float = 0.0, shift: tuple[float, float] = (0.0, 0.0), mirror: bool = False,
          boost: tuple[float, float] = (0.0, 0.0)) -> Scene:  # fmt: skip
    """The scene seen from another frame: mirrored (y -> -y), turned, shifted, and in steady motion."""
    sign = -1.0 if mirror else 1.0
    turn = rotation(angle, mirror)
    walls = tuple(
        Wall(
            name=wall.name,
            point=tuple(turn @ wall.point + shift),
            normal=tuple(turn @ wall.normal),
            law=wall.law,
            motion=(WallSegment(velocity=boost),) if any(boost) else (),
        )
        for wall in scene.walls
    )
    disks = scene.disks
    seen = {"x": disks.x @ turn.T + shift, "v": disks.v @ turn.T + boost, "omega": sign * disks.omega}
    return scene.replace(
        disks=Disks(**{**vars(disks), **seen}), walls=walls, gravity=tuple(turn @ np.array(scene.gravity))
    )


def rotation(angle: float, mirror: bool = False) -> np.ndarray:
    """Matrix of the change of frame, shape (2, 2)."""
    sign = -1.0 if mirror else 1.0
    return np.array([[np.cos(angle), -sign * np.sin(angle)], [np.sin(angle), sign * np.cos(angle)]])


def renumbered(scene: Scene, order: np.ndarray) -> Scene:
    """The same disks with other numbers: new disk k is old disk ``order[k]``."""
    return scene.replace(disks=Disks(**{name: np.asarray(value)[order] for name, value in vars(scene.disks).items()}))


def in_units(world: World, *, length: float, mass: float, time: float) -> World:
    """The same physics where the units of length, mass and time are 1/length, 1/mass, 1/time of the old ones."""
    stiffness, scene, disks = mass / time**2, world.scene, world.scene.disks

    def scaled(law: ContactLaw) -> ContactLaw:
        return ContactLaw(**{**vars(law), "kn": law.kn * stiffness, "ks": law.ks * stiffness})

    return World(
        world.method,
        Scene(
            disks=Disks(
                x=disks.x * length,
                v=disks.v * (length / time),
                omega=disks.omega / time,
                radius=disks.radius * length,
                mass=disks.mass * mass,
            ),
            disk_disk=scaled(scene.disk_disk),
            walls=tuple(
                Wall(name=w.name, point=tuple(np.array(w.point) * length), normal=w.normal, law=scaled(w.law))
                for w in scene.walls
            ),
            gravity=tuple(np.array(scene.gravity) * (length / time**2)),
        ),
        world.numerics.replace(
            dt=world.numerics.dt * time,
            contact_dt=None if world.numerics.contact_dt is None else world.numerics.contact_dt * time,
        ),
    )
