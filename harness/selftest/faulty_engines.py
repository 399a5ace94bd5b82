"""Faulty answers of a third-party engine: physics that is wrong by a little, given under either declaration of its contacts."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Scene, Wall, WallSegment
from ninedisk.harness.selftest.declared import DECLARED
from ninedisk.harness.selftest.defect import After, Before, Defect
from ninedisk.harness.selftest.histories import changed, delayed, negated
from ninedisk.harness.selftest.setups import (
    first_segment,
    like_first,
    mixed_friction,
    next_step,
    spins_swapped,
    with_disks,
    with_laws,
    with_motion,
)

SLOP = 2e-3
"""Overlap [m] that contacts leave alone, or gap at which they are reported: some thousandths of a radius."""


def _scaled_gravity(scene: Scene, *, factor: float = 1.0, turn: float = 0.0) -> Scene:
    c, s = math.cos(turn), math.sin(turn)
    gx, gy = scene.gravity
    return scene.replace(gravity=(factor * (c * gx - s * gy), factor * (s * gx + c * gy)))


def _restitution(factor: float) -> Callable[[ContactLaw], ContactLaw]:
    return lambda law: replace(law, restitution=None if law.restitution is None else min(1.0, factor * law.restitution))


def _friction(factor: float) -> Callable[[ContactLaw], ContactLaw]:
    return lambda law: replace(law, mu=factor * law.mu)


def _squared_mu(law: ContactLaw) -> ContactLaw:
    """A pair's coefficient as the product of the two bodies', each of which was given the pair's."""
    return replace(law, mu=law.mu**2)


def _walls_late(scene: Scene, numerics: Numerics) -> tuple[Scene, Numerics]:
    def wait(wall: Wall) -> Wall:
        return replace(wall, motion=(WallSegment(duration=numerics.dt), *wall.motion)) if wall.motion else wall

    return scene.replace(walls=tuple(wait(wall) for wall in scene.walls)), numerics


def _walls_sunk(scene: Scene) -> Scene:
    """Walls lie deeper than they are said to."""
    walls = tuple(
        replace(wall, point=(wall.point[0] - SLOP * wall.normal[0], wall.point[1] - SLOP * wall.normal[1]))
        for wall in scene.walls
    )
    return scene.replace(walls=walls)


def _released_disks(scene: Scene, *, moving: bool) -> Scene:
    """Disks that are held move freely: those that are held at rest, or at a velocity."""
    driven = np.any(scene.disks.v, axis=1)[:, None]
    return with_disks(scene, held=scene.disks.held & (driven != moving))


def _twice_the_step(scene: Scene, numerics: Numerics) -> tuple[Scene, Numerics]:
    contact = None if numerics.contact_dt is None else 2.0 * numerics.contact_dt
    return scene, numerics.replace(dt=2.0 * numerics.dt, contact_dt=contact)


def _swapped(history: History) -> History:
    order = np.arange(history.x.shape[1])[::-1]
    return replace(history, x=history.x[:, order], v=history.v[:, order])


def _frozen_history(history: History) -> History:
    def first(array: np.ndarray) -> np.ndarray:
        return np.repeat(array[:1], len(array), axis=0)

    return replace(
        history, x=first(history.x), v=first(history.v), angle=first(history.angle), omega=first(history.omega)
    )


def _impulses(history: History) -> History:
    step = history.t[-1] / float(history.step[-1])
    return replace(history, fn=step * history.fn, fs=step * history.fs)


def _scene(change: Callable[[Scene], Scene]) -> Before:
    return lambda scene, numerics: (change(scene), numerics)


def _without_motion(segment: WallSegment) -> WallSegment:
    return replace(segment, velocity=(0.0, 0.0))


SCENES: tuple[tuple[str, str, str, Before], ...] = (
    ("wall-turn-ignored", "walls do not turn", "turn",
     _scene(lambda scene: with_motion(scene, lambda segment: replace(segment, angular_velocity=0.0)))),
    ("wall-pivot", "walls turn about the point by which they are given", "turn",
     _scene(lambda scene: with_motion(scene, lambda segment: replace(segment, pivot=None)))),
    ("wall-speed-ignored", "walls that move along a line stay", "against", _scene(lambda scene: with_motion(scene, _without_motion))),
    ("wall-curve-ignored", "walls that swing stay", "shake",
     _scene(lambda scene: with_motion(scene, lambda segment: replace(segment, amplitude=(0.0, 0.0))))),
    ("walls-late", "walls are where they were a step before", "shake", _walls_late),
    ("friction-less", "friction is a fifth too small", "slide", _scene(lambda scene: with_laws(scene, _friction(0.8)))),
    ("friction-product", "friction is the square of what it should be", "slide", _scene(lambda scene: with_laws(scene, _squared_mu))),
    ("gravity-more", "gravity is a tenth too strong", "bounce", _scene(lambda scene: _scaled_gravity(scene, factor=1.1))),
    ("gravity-turned", "gravity is off by one degree", "slide",
     _scene(lambda scene: _scaled_gravity(scene, turn=math.radians(1.0)))),
    ("mass-more", "bodies are a fiftieth too heavy", "slide",
     _scene(lambda scene: with_disks(scene, mass=1.02 * scene.disks.mass, inertia=1.02 * scene.disks.inertia))),
    ("inertia-of-a-sphere", "disks have the moment of inertia of spheres, 2/5 m R^2", "roll",
     _scene(lambda scene: with_disks(scene, inertia=0.4 * scene.disks.mass * scene.disks.radius**2))),
    ("restitution-more", "restitution is a twentieth too large", "hit", _scene(lambda scene: with_laws(scene, _restitution(1.05)))),
    ("restitution-less", "restitution is a twentieth too small", "hit", _scene(lambda scene: with_laws(scene, _restitution(0.95)))),
    ("spin-ignored", "spins at the start are ignored", "graze", _scene(lambda scene: with_disks(scene, omega=0.0 * scene.disks.omega))),
    ("damped", "velocities fall by a hundredth a second", "stop", _scene(lambda scene: scene.replace(xi=0.01))),
    ("slop", "walls are two millimetres deeper", "stick", _scene(_walls_sunk)),
    ("step-twice", "steps are twice as long as they say", "slide", _twice_the_step),
    ("fixed-moves", "disks that are held at rest move", "fixed", _scene(lambda scene: _released_disks(scene, moving=False))),
    ("held-moves", "disks that are held at a velocity change it", "held", _scene(lambda scene: _released_disks(scene, moving=True))),
    ("materials-mixed", "the friction of two materials is a mean of theirs", "materials", _scene(mixed_friction)),
    ("forces-by-step", "forces on disks begin and end with a step", "forces", next_step),
    ("mass-of-first", "every disk has the mass of the first", "unequal", _scene(like_first("mass"))),
    ("radius-of-first", "every disk has the radius of the first", "unequal", _scene(like_first("radius"))),
    ("inertia-of-first", "every disk has the moment of inertia of the first", "unequal", _scene(like_first("inertia"))),
    ("rotation-of-first", "disks turn if the first one does", "belt-stops", _scene(like_first("rotating"))),
    ("spins-swapped", "spins are given to the disks in the wrong order", "unequal", _scene(spins_swapped)),
    ("walls-never-stop", "walls go on with the second segment of their motion", "belt-stops", _scene(first_segment)),
)  # fmt: skip
"""Name, what is wrong, witness, and what the engine sees in place of scene and numerics."""

REPORTS: tuple[tuple[str, str, str, After], ...] = (
    ("velocities-late", "velocities are those of the step before", "roll", changed(delayed, "v", "omega")),
    ("places-late", "places are those of the step before", "held", changed(delayed, "x")),
    ("forces-twice", "forces are reported twice as large", "stick", changed(lambda array: 2.0 * array, "fn", "fs")),
    ("impulses", "impulses of a step are reported as forces", "stick", _impulses),
    ("shear-sign", "shear forces have the wrong sign", "slide", changed(negated, "fs")),
    ("spin-sign", "spins are counted clockwise", "roll", changed(negated, "angle", "omega")),
    ("gap-offset", "gaps are two millimetres too large", "stick", changed(lambda array: array + SLOP, "gap")),
    ("bodies-swapped", "bodies are reported in the wrong order", "hit", _swapped),
    ("frozen", "nothing moves", "slide", _frozen_history),
)
"""Name, what is wrong, witness, and what the engine reports in place of its history."""

DEFECTS = tuple(
    defect
    for engine in DECLARED
    for defect in (
        *(
            Defect(name=name, engine=engine, kind="numerics" if before is _twice_the_step else "scene", what=what, witness=witness,
                   before=before)
            for name, what, witness, before in SCENES
        ),
        *(
            Defect(name=name, engine=engine, kind="history", what=what, witness=witness, after=after)
            for name, what, witness, after in REPORTS
        ),
        Defect(name="no-time", engine=engine, kind="history", what="steps take no time: timings.advance is 0", witness="shake",
               timed=lambda timings: replace(timings, advance=0.0)),
    )
)  # fmt: skip
