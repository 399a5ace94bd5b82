"""Random scenes and small helpers shared by the tests of the core."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ninedisk.core.dem.session import DemSession
from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import BodyForce, ContactLaw, Disks, Rolling, Scene, Wall, WallSegment

KN = 1e4
RNG = np.random.Generator


def numerics(dt: float, n_steps: int, **changes: Any) -> Numerics:
    """Every contact step is a sample, and the step is taken as it is."""
    return Numerics(**{"dt": dt, "contact_dt": dt, "n_steps": n_steps, "allow_unstable": True, **changes})


def random_law(rng: RNG, **fixed: Any) -> ContactLaw:
    """A contact law; each of shear spring, friction and dashpot is absent in a part of them."""
    values = {
        "kn": KN * rng.uniform(0.3, 1.0),
        "ks": KN * rng.choice([0.0, 0.2, 0.8, 0.8]),
        "mu": rng.choice([0.0, 0.05, 0.5, 2.0]),
        "beta": rng.choice([0.0, 0.1, 0.8]),
        "lever_arm": rng.choice(["radius", "overlap", "torque-overlap"]).item(),
        "wall_velocity_at": rng.choice(["surface", "mid-overlap"]).item(),
        "slip_at": rng.choice(["middle", "end"]).item(),
    }
    values |= fixed
    if values["ks"] == 0.0 and "mu" not in fixed:
        values["mu"] = 0.0  # friction needs a shear spring
    return ContactLaw(**values)


def random_motion(rng: RNG, dt: float, n_steps: int) -> tuple[WallSegment, ...]:
    """Up to three segments that end on steps: translation, rotation, oscillation and tangent ramp, also together."""
    span = n_steps * dt
    motion = []
    for _ in range(int(rng.integers(0, 4))):
        uses = rng.random(4) < 0.5
        motion.append(
            WallSegment(
                duration=dt * int(rng.integers(1, n_steps // 2)),
                velocity=tuple(uses[0] * rng.normal(0.0, 0.5, 2) / span),
                angular_velocity=uses[1] * rng.normal(0.0, 0.4) / span,
                pivot=tuple(rng.normal(0.0, 2.0, 2)) if rng.random() < 0.5 else None,
                amplitude=tuple(uses[2] * rng.normal(0.0, 0.2, 2)),
                frequency=rng.uniform(1.0, 10.0) / span,
                phase=rng.uniform(-3.0, 3.0),
                tan_lever=tuple(uses[3] * rng.normal(0.0, 0.5, 2)),
                tan_rate=uses[3] * rng.uniform(-1.0, 1.0) / span,
            )
        )
    return tuple(motion)


def random_scene(rng: RNG, dt: float, n_steps: int, **fixed: Any) -> Scene:
    """A few polydisperse disks with overlaps and gaps, fast enough to meet and part; up to three walls around them."""
    n = int(rng.integers(1, 11))
    radius = rng.uniform(0.5, 1.5, n)
    x = rng.uniform(-1.0, 1.0, (n, 2)) * 1.6 * np.sqrt(n)
    span = n_steps * dt
    disk_disk = random_law(rng)
    walls = []
    for k in range(int(rng.integers(0, 4))):
        direction = rng.uniform(0.0, 2.0 * np.pi)
        normal = np.array([np.cos(direction), np.sin(direction)])
        height = x @ normal
        lowest = int(np.argmin(height))
        point = normal * (height[lowest] - radius[lowest] * rng.uniform(0.7, 1.1)) + rng.normal() * np.array(
            [-normal[1], normal[0]]
        )
        motion = random_motion(rng, dt, n_steps)
        walls.append(Wall(name=f"w{k}", point=tuple(point), normal=tuple(normal), law=random_law(rng), motion=motion))
    shear = {}
    if disk_disk.mu > 0.0 and disk_disk.ks > 0.0:
        for i in range(n):
            for j in range(i + 1, n):
                if np.hypot(*(x[j] - x[i])) < radius[i] + radius[j] and rng.random() < 0.5:
                    shear[i, j] = 0.3 * KN * rng.normal()
    disks = Disks(
        x=x,
        v=rng.normal(0.0, 1.0, (n, 2)) / span,
        omega=rng.normal(0.0, 2.0, n) / span,
        radius=radius,
        mass=radius**2 * rng.uniform(1.0, 3.0, n),
        inertia=0.5 * radius**4 * rng.uniform(0.5, 3.0, n),
        rotating=rng.random(n) < 0.8,
    )
    scene = Scene(
        disks=disks,
        disk_disk=disk_disk,
        walls=tuple(walls),
        gravity=tuple(rng.choice([0.0, 1.0]) * rng.normal(0.0, 1.0, 2) / span**2),
        xi=float(rng.choice([0.0, 1.0, 10.0])) / span,
        initial_shear=shear,
    )
    return scene.replace(**fixed)


def random_rolling(rng: RNG, span: float) -> Rolling | None:
    """Any model of rolling resistance, or none; springs that bend to their limit in a part of the ``span`` [s]."""
    model = rng.choice(["", "constant", "viscous", "elastic-plastic", "elastic-plastic"]).item()
    if not model:
        return None
    mu = rng.choice([0.02, 0.3, 3.0]) * (span if model == "viscous" else 1.0)
    spring = {"kr": KN * rng.choice([0.05, 0.5]), "beta": rng.choice([0.0, 0.1, 0.5])} if model[0] == "e" else {}
    return Rolling(model=model, mu=mu, **spring)


def with_options(rng: RNG, scene: Scene, span: float) -> Scene:
    """The scene of three materials, with laws between most pairs of them, cohesion, rolling resistance, and forces on disks."""
    names = np.array(["", "ash", "oak"])

    def law() -> ContactLaw:
        found = random_law(rng, rolling=random_rolling(rng, span))
        return replace(found, cohesion=found.kn * rng.choice([0.0, 0.2, 0.7]))

    walls = tuple(replace(wall, material=str(rng.choice(names)), law=law()) for wall in scene.walls)
    disks = replace(scene.disks, material=[str(name) for name in rng.choice(names, len(scene.disks))])
    used = sorted({*disks.material, *(wall.material for wall in walls)})
    pairs = [(a, b) for k, a in enumerate(used) for b in used[k:] if rng.random() < 0.8]
    forces = []
    for _ in range(int(rng.integers(0, 5))):
        begin = rng.choice([0.0, rng.uniform(0.0, 0.8)]) * span
        i = int(rng.integers(len(disks)))
        push = disks.mass[i] * rng.normal(0.0, 2.0, 2) / span**2
        end = rng.choice([np.inf, begin + rng.uniform(0.0, 0.5) * span])
        torque = disks.inertia[i] * rng.normal(0.0, 4.0) / span**2
        forces.append(BodyForce(disk=i, force=tuple(push), torque=torque, begin=begin, end=end))
    laws = {pair if rng.random() < 0.5 else pair[::-1]: law() for pair in pairs}
    return scene.replace(disks=disks, walls=walls, disk_disk=law(), laws=laws, forces=tuple(forces), initial_shear={})


def all_pairs(scene: Scene) -> list[tuple[int, int]]:
    return [(i, j) for i in range(len(scene.disks)) for j in range(i + 1, scene.n_bodies)]


def run(scene: Scene, how: Numerics, watch: list[tuple[int, int]] | None = None) -> History:
    """Run with every pair watched, or the given ones."""
    return DemSession(scene, how, all_pairs(scene) if watch is None else watch).run()


def difference(one: History, two: History, fields: tuple[str, ...]) -> dict[str, float]:
    """Largest difference of each field, relative to the largest value that the field takes."""
    found = {}
    for name in fields:
        a, b = (h.energy[name] if name in h.energy else getattr(h, name) for h in (one, two))
        if a.size:
            found[name] = float(np.max(np.abs(a - b)) / max(float(np.max(np.abs(b))), 1e-300))
    return found


def pair_scene(
    law: ContactLaw, *, overlap: float, closing: float, radius: float = 1.0, mass: float = 1.0, **changes: Any
) -> Scene:
    """Two equal disks on the x axis with an overlap [m] and a closing speed [m/s], centre of mass at rest."""
    d = radius - 0.5 * overlap
    disks = Disks(x=[[-d, 0.0], [d, 0.0]], v=[[0.5 * closing, 0.0], [-0.5 * closing, 0.0]], radius=radius, mass=mass)
    return Scene(disks=disks, disk_disk=law, **changes)


def floor_scene(
    law: ContactLaw, *, height: float, v: tuple[float, float] = (0.0, 0.0), mass: float = 1.0, **changes: Any
) -> Scene:
    """A disk of radius 1 with its centre at ``height`` above a floor at y = 0."""
    motion = changes.pop("motion", ())
    disks = Disks(x=[[0.0, height]], v=[v], radius=1.0, mass=mass)
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law, motion=motion)
    return Scene(disks=disks, disk_disk=law, walls=(floor,), **changes)


def orders(errors: list[float], ratio: float = 2.0) -> np.ndarray:
    """Observed orders of convergence between successive refinements by ``ratio``."""
    e = np.asarray(errors)
    return np.log(e[:-1] / e[1:]) / np.log(ratio)


def imploding(n: int, walls: tuple[Wall, ...] = ()) -> Scene:
    """Disks on a loose grid that all fly to the middle: at first no pair, later nearly all."""
    rng = np.random.default_rng(2)
    side = int(np.ceil(np.sqrt(n)))
    x = 3.0 * np.array([[k % side, k // side] for k in range(n)]) + rng.uniform(-0.1, 0.1, (n, 2))
    x += 2.0 - np.array([0.0, x[:, 1].min()])
    # Beside walls all come down to y = -0.5 by step 12, within the overlaps of those walls.
    v = -60.0 * (x - x.mean(axis=0)) if not walls else np.array([0.0, -1.0]) * (x[:, 1:] + 0.5) / 12e-3
    soft = ContactLaw(kn=1.0, ks=0.5, mu=0.5)
    return Scene(disks=Disks(x=x, v=v, radius=1.0, mass=1.0), disk_disk=soft, walls=walls)
