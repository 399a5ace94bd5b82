"""Defects of what a right engine is given: its scene or its numerics differ from the case's."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Scene, SphereScene, WallSegment
from ninedisk.harness.selftest.defect import Defect

AnyScene = TypeVar("AnyScene", Scene, SphereScene)


def with_disks(scene: Scene, **changes: Any) -> Scene:
    """The scene with columns of its disks changed."""
    return scene.replace(disks=replace(scene.disks, **changes))


def with_laws(scene: AnyScene, change: Callable[[Any], Any]) -> AnyScene:
    """The scene, of the plane or of space, with every contact law changed."""
    walls = tuple(replace(wall, law=change(wall.law)) for wall in scene.walls)
    laws = {pair: change(law) for pair, law in scene.laws.items()}
    of_bodies = {"disk_disk" if scene.dimension == 2 else "sphere_sphere": change(scene.law_of_bodies)}
    return scene.replace(**of_bodies, walls=walls, laws=laws)


def with_motion(scene: Scene, change: Callable[[WallSegment], WallSegment]) -> Scene:
    """The scene with every segment of its walls' motion changed."""
    walls = tuple(replace(wall, motion=tuple(change(segment) for segment in wall.motion)) for wall in scene.walls)
    return scene.replace(walls=walls)


def like_first(column: str) -> Callable[[Scene], Scene]:
    """Scenes in which every disk has the value of the first in this column."""

    def change(scene: Scene) -> Scene:
        values = getattr(scene.disks, column)
        return with_disks(scene, **{column: np.full_like(values, values[0])}) if len(values) else scene

    return change


def spins_swapped(scene: Scene) -> Scene:
    """The order of the spins is reversed."""
    return with_disks(scene, omega=scene.disks.omega[::-1])


def first_segment(scene: Scene) -> Scene:
    """Walls move by the first two segments of their motion alone: none that has started stops or turns back."""
    walls = tuple(
        replace(
            wall,
            motion=(wall.motion[0], replace(wall.motion[1], duration=math.inf))
            if len(wall.motion) > 1
            else wall.motion,
        )
        for wall in scene.walls
    )
    return scene.replace(walls=walls)


def laws_of_first_wall(scene: Scene) -> Scene:
    """Every wall has the law of the first."""
    return scene.replace(walls=tuple(replace(wall, law=scene.walls[0].law) for wall in scene.walls))


def _unequal(engine: str) -> tuple[Defect, ...]:
    """What belongs to a body or a wall, taken from the first."""
    return (
        _scene(engine, "mass-of-first", "every disk has the mass of the first", "unequal", like_first("mass")),
        _scene(engine, "radius-of-first", "every disk has the radius of the first", "unequal", like_first("radius")),
        _scene(engine, "inertia-of-first", "every disk has the moment of inertia of the first", "unequal", like_first("inertia")),
        _scene(engine, "rotation-of-first", "disks turn if the first one does", "box", like_first("rotating")),
        _scene(engine, "spins-swapped", "spins are given to the disks in the wrong order", "unequal", spins_swapped),
        _scene(engine, "laws-of-first-wall", "every wall has the law of the first", "box", laws_of_first_wall),
        _scene(engine, "walls-never-stop", "walls go on with the second segment of their motion", "belt-stops", first_segment),
    )  # fmt: skip


def _scene(engine: str, name: str, what: str, witness: str, change: Callable[[Scene], Scene]) -> Defect:
    def before(scene: Scene, numerics: Numerics) -> tuple[Scene, Numerics]:
        return change(scene), numerics

    return Defect(name=name, engine=engine, kind="scene", what=what, witness=witness, before=before)


def _numerics(engine: str, name: str, what: str, witness: str, change: Callable[[Numerics], Numerics]) -> Defect:
    def before(scene: Scene, numerics: Numerics) -> tuple[Scene, Numerics]:
        return scene, change(numerics)

    return Defect(name=name, engine=engine, kind="numerics", what=what, witness=witness, before=before)


def _swapped_mu(scene: Scene) -> Scene:
    """Disks have the walls' friction, walls that of the disks."""
    if not scene.walls:
        return scene
    of_disks, of_walls = scene.disk_disk.mu, scene.walls[0].law.mu
    walls = tuple(replace(wall, law=replace(wall.law, mu=of_disks)) for wall in scene.walls)
    return scene.replace(disk_disk=replace(scene.disk_disk, mu=of_walls), walls=walls)


def _stiffness_swapped(law: ContactLaw) -> ContactLaw:
    return replace(law, kn=law.ks, ks=law.kn) if law.ks > 0.0 else law


def _halved_step(numerics: Numerics) -> Numerics:
    contact = None if numerics.contact_dt is None else 0.5 * numerics.contact_dt
    return numerics.replace(dt=0.5 * numerics.dt, contact_dt=contact)


def _coarser_steps(numerics: Numerics) -> Numerics:
    """Half as many contact steps in a step, where there is more than one."""
    if numerics.contact_dt is None:
        return numerics
    count = numerics.substeps(numerics.contact_dt)
    return numerics.replace(contact_dt=numerics.dt / max(1, count // 2))


def _other_rule(numerics: Numerics) -> Numerics:
    return numerics.replace(sliding="coulomb" if numerics.sliding == "associated" else "associated", solver="auto")


def _loose_settings(numerics: Numerics) -> Numerics:
    return numerics.replace(options={**numerics.options, "cd.tolerance": 1e-3})


def _heavier_grains(scene: Scene) -> Scene:
    more = np.where(scene.disks.outline >= 0, 1.01, 1.0)
    return with_disks(scene, inertia=more * scene.disks.inertia)


def _rolling(**factors: float) -> Callable[[Scene], Scene]:
    """Scenes with parameters of the rolling resistance multiplied."""

    def change(law: ContactLaw) -> ContactLaw:
        if law.rolling is None:
            return law
        changed = {name: factor * getattr(law.rolling, name) for name, factor in factors.items()}
        return replace(law, rolling=replace(law.rolling, **changed))

    return lambda scene: with_laws(scene, change)


def mixed_friction(scene: Scene) -> Scene:
    """The friction of two unlike materials is the geometric mean of the means that each of them has with all; `ks` where there was none."""
    names = sorted({name for pair in scene.laws for name in pair})
    mean = {name: np.mean([law.mu for pair, law in scene.laws.items() if name in pair]) for name in names}
    return scene.replace(
        laws={
            (a, b): replace(law, mu=math.sqrt(mean[a] * mean[b]), ks=law.ks or law.kn)
            for (a, b), law in scene.laws.items()
        }
    )


def next_step(scene: Scene, numerics: Numerics) -> tuple[Scene, Numerics]:
    """Forces begin and end with the step in which they should."""

    def whole(time: float) -> float:
        return time if math.isinf(time) else math.floor(time / numerics.dt) * numerics.dt

    forces = tuple(replace(each, begin=whole(each.begin), end=whole(each.end)) for each in scene.forces)
    return scene.replace(forces=forces), numerics


DEM = (
    _scene("dem", "rolling-radius", "rolling resistance has the radius for the reduced one of two equal disks, twice", "resist-constant",
           _rolling(mu=2.0)),
    _scene("dem", "rolling-viscous", "viscous rolling resistance is one part in a hundred too strong", "resist-viscous",
           _rolling(mu=1.01)),
    _scene("dem", "rolling-stiffness", "rolling springs are one part in a hundred too stiff", "resist-spring", _rolling(kr=1.01)),
    _scene("dem", "rolling-cap", "rolling springs yield one part in a hundred too late", "resist-spring", _rolling(mu=1.01)),
    _scene("dem", "rolling-dashpot", "the rolling dashpot is made of half the damping ratio", "hold-spring", _rolling(beta=0.5)),
    _scene("dem", "rolling-spring-alone", "rolling springs have no dashpot", "hold-spring", _rolling(beta=0.0)),
    _scene("dem", "no-cohesion", "cohesion is ignored", "cohesive",
           lambda scene: with_laws(scene, lambda law: replace(law, cohesion=0.0))),
    _scene("dem", "cohesion-weak", "cohesion is one part in a hundred too weak", "cohesive",
           lambda scene: with_laws(scene, lambda law: replace(law, cohesion=0.99 * law.cohesion))),
    _scene("dem", "materials-ignored", "materials are ignored: walls and disks have one law each", "materials",
           lambda scene: scene.replace(laws={})),
    _scene("dem", "materials-mixed", "the friction of two materials is a mean of theirs", "materials", mixed_friction),
    Defect(name="forces-by-step", engine="dem", kind="scene", what="forces begin and end with a step", witness="forces",
           before=next_step),
    _scene("dem", "no-torques", "torques on disks are ignored", "forces",
           lambda scene: scene.replace(forces=tuple(replace(each, torque=0.0) for each in scene.forces))),
    _scene("dem", "grain-inertia", "grains have one part in a hundred too much inertia", "ovals", _heavier_grains),
    _scene("dem", "mass-of-a-sphere", "disks have the mass of spheres, 4/3 R times theirs", "press",
           lambda scene: with_disks(scene, mass=scene.disks.mass * 4.0 / 3.0 * scene.disks.radius)),
    _scene("dem", "radius", "disks are one part in five hundred too large", "throw",
           lambda scene: with_disks(scene, radius=1.002 * scene.disks.radius, inertia=scene.disks.inertia)),
    _scene("dem", "inertia-of-a-sphere", "disks have the moment of inertia of spheres, 2/5 m R^2", "roll",
           lambda scene: with_disks(scene, inertia=0.4 * scene.disks.mass * scene.disks.radius**2)),
    _scene("dem", "stiffness-in-series", "two springs in series replace each contact", "press",
           lambda scene: with_laws(scene, lambda law: replace(law, kn=0.5 * law.kn, ks=0.5 * law.ks))),
    _scene("dem", "stiffness-swapped", "normal and shear stiffness are exchanged", "shear-caps",
           lambda scene: with_laws(scene, _stiffness_swapped)),
    _scene("dem", "mu-swapped", "disks have the walls' friction and walls the disks'", "press", _swapped_mu),
    _scene("dem", "mu-is-the-angle", "the friction angle in radians replaces its tangent", "slide",
           lambda scene: with_laws(scene, lambda law: replace(law, mu=math.atan(law.mu)))),
    _scene("dem", "mu-small", "friction is two parts in a hundred too small", "hold",
           lambda scene: with_laws(scene, lambda law: replace(law, mu=0.98 * law.mu))),
    _scene("dem", "no-preload", "shear forces at the start are ignored", "slide",
           lambda scene: scene.replace(initial_shear={})),
    _scene("dem", "gravity-twice", "gravity acts twice", "roll",
           lambda scene: scene.replace(gravity=(2.0 * scene.gravity[0], 2.0 * scene.gravity[1]))),
    _scene("dem", "gravity-sign", "gravity pulls in the opposite direction along the slope", "slide",
           lambda scene: scene.replace(gravity=(-scene.gravity[0], scene.gravity[1]))),
    _scene("dem", "damping-twice", "global damping acts twice", "press",
           lambda scene: scene.replace(xi=2.0 * scene.xi)),
    _scene("dem", "no-damping", "global damping is ignored", "press", lambda scene: scene.replace(xi=0.0)),
    _scene("dem", "wall-speed", "walls move a millionth too fast", "press",
           lambda scene: with_motion(scene, lambda segment: replace(
               segment, velocity=(1.000001 * segment.velocity[0], 1.000001 * segment.velocity[1])))),
    _scene("dem", "wall-stops-late", "walls move for a thousandth longer", "press",
           lambda scene: with_motion(scene, lambda segment: replace(segment, duration=1.001 * segment.duration))),
    _scene("dem", "turns-blocked-disks", "disks that cannot turn do", "stop",
           lambda scene: with_disks(scene, rotating=True)),
    _numerics("dem", "half-step", "steps are half as long as they say", "press", _halved_step),
    _numerics("dem", "coarse-step", "contact steps are twice as long", "hit-damped", _coarser_steps),
)  # fmt: skip

CD = (
    _scene("cd", "mass", "disks are a millionth too heavy", "press",
           lambda scene: with_disks(scene, mass=1.000001 * scene.disks.mass)),
    _scene("cd", "inertia-of-a-sphere", "disks have the moment of inertia of spheres, 2/5 m R^2", "roll",
           lambda scene: with_disks(scene, inertia=0.4 * scene.disks.mass * scene.disks.radius**2)),
    _scene("cd", "restitution-squared", "the coefficient of restitution is applied twice", "hit-newton",
           lambda scene: with_laws(scene, lambda law: replace(
               law, restitution=None if law.restitution is None else law.restitution**2))),
    _scene("cd", "restitution", "disks give back a ten-thousandth too much", "cool",
           lambda scene: scene.replace(disk_disk=replace(scene.disk_disk, restitution=1.0001 * (scene.disk_disk.restitution or 0.0)))),
    _scene("cd", "mu-small", "friction is two parts in a hundred too small", "hold",
           lambda scene: with_laws(scene, lambda law: replace(law, mu=0.98 * law.mu))),
    _scene("cd", "mu-swapped", "disks have the walls' friction and walls the disks'", "press", _swapped_mu),
    _scene("cd", "wall-speed", "walls move a millionth too fast", "press",
           lambda scene: with_motion(scene, lambda segment: replace(
               segment, velocity=(1.000001 * segment.velocity[0], 1.000001 * segment.velocity[1])))),
    _numerics("cd", "theta-swapped", "theta is 3/2 - theta", "hit",
              lambda numerics: numerics.replace(theta=1.5 - numerics.theta)),
    _numerics("cd", "sliding-rule", "the associated rule and Coulomb's law are exchanged", "throw", _other_rule),
    _numerics("cd", "impact-law", "the theta scheme decides impacts that Newton's law should", "hit-newton",
              lambda numerics: numerics.replace(impact="theta", theta=1.0)),
    _numerics("cd", "loose-solver", "contact problems are solved to one part in a thousand", "press", _loose_settings),
    _numerics("cd", "half-step", "steps are half as long as they say", "slide", _halved_step),
)  # fmt: skip

DEFECTS = (*DEM, *_unequal("dem"), *CD, *_unequal("cd"))
