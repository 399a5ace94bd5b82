"""Friction and restitution by pair, in PhysX: it gives a pair the mean of its bodies' coefficients.

A body therefore has one shape for each of its laws; bits say which shapes meet. Both shapes of a pair have the law's coefficients, and so
has their mean.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from ninedisk.core.scene import ContactLaw, Scene, SphereScene

MOST_PAIRS = 31
"""Pairs of classes that a mask of 32 bits distinguishes."""

BodyClass = tuple[str, object]


class Surface(NamedTuple):
    """One shape of a body: coefficients, and masks of SAPIEN's collision groups 0 and 1."""

    mu: float
    restitution: float
    mask: int
    meets: int


def class_of(scene: Scene | SphereScene, body: int) -> BodyClass:
    """What decides the laws of a body: its material; of a wall also its own law."""
    n = len(scene.bodies)
    if body < n:
        return "body", scene.bodies.material[body]
    wall = scene.walls[body - n]
    return f"wall {wall.material}", _coefficients(wall.law)


def pairs_of_classes(scene: Scene | SphereScene) -> dict[tuple[BodyClass, BodyClass], ContactLaw]:
    """Law of each pair of classes of which a scene has two bodies, at least one of them no wall."""
    n = len(scene.bodies)
    first: dict[BodyClass, list[int]] = {}
    for body in range(n + len(scene.walls)):
        first.setdefault(class_of(scene, body), []).append(body)
    found = {}
    known = list(first)
    for a, one in enumerate(known):
        for two in known[a:]:
            i, j = first[one][0], first[two][0] if one != two else first[two][min(1, len(first[two]) - 1)]
            if i != j and i < n:
                found[one, two] = scene.law_between(i, j)
    return found


def surfaces(scene: Scene | SphereScene) -> Mapping[BodyClass, tuple[Surface, ...]]:
    """Shapes of the bodies and walls of each class; a class that meets nothing has one smooth shape that meets nothing.

    Examples
    --------
    A disk on a floor has one shape, whose law is the floor's:

    >>> from ninedisk.core.scene import Disks, Wall
    >>> floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=ContactLaw(kn=1e6, mu=0.3))
    >>> disk = Disks(x=[[0.0, 0.5]], radius=0.5, mass=1.0)
    >>> scene = Scene(disks=disk, disk_disk=ContactLaw(kn=1e6), walls=[floor])
    >>> surfaces(scene)[class_of(scene, 0)]
    (Surface(mu=0.3, restitution=0.0, mask=1, meets=0),)
    """
    n = len(scene.bodies) + len(scene.walls)
    masks: dict[BodyClass, dict[tuple[float, float], list[int]]] = {class_of(scene, body): {} for body in range(n)}
    for number, ((one, two), law) in enumerate(pairs_of_classes(scene).items()):
        for each, side in ((one, 0), (two, 1)):
            masks[each].setdefault(_coefficients(law), [0, 0])[side] |= 1 << number
    return {
        each: tuple(Surface(*law, mask, meets) for law, (mask, meets) in held.items()) or (Surface(0.0, 0.0, 0, 0),)
        for each, held in masks.items()
    }


def _coefficients(law: Any) -> tuple[float, float]:
    return float(law.mu), float(law.restitution or 0.0)
