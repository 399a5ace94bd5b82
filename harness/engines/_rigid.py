"""What an engine with rigid contacts makes of a scene whose springs only regularise such contacts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene
from ninedisk.harness.capabilities import Capability, capabilities_needed


def rigid_needs(scene: Scene, numerics: Numerics) -> frozenset[Capability]:
    """Capabilities that a rigid engine needs: a preload of regularising springs is none of its business.

    Shear forces that contacts carry from the start and the overlaps that go with them are the state of the springs; a
    rigid contact finds its forces anew in each step. Where every preloaded contact is regularised, `PRELOAD` is
    therefore dropped.
    """
    need = capabilities_needed(scene, numerics)
    if all(scene.law(pair).regularised for pair, force in scene.initial_shear.items() if force):
        need -= {Capability.PRELOAD}
    return need


def has_spring_preload(scene: Scene) -> bool:
    """Whether `without_spring_preload` changes anything."""
    return without_spring_preload(scene) is not scene


def without_spring_preload(scene: Scene) -> Scene:
    """The same scene with the initial state of the regularising springs undone.

    Each disk that overlaps a wall is moved along the wall's normal until it touches, and initial shear forces of
    regularised contacts are dropped. Overlaps between disks stay as they are: no single displacement undoes a chain of
    them.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    Scene
        The very same object where there is nothing to undo.
    """
    x = np.array(scene.disks.x)
    moved = False
    for wall in scene.walls:
        if not wall.law.regularised:
            continue
        normal = np.array(wall.normal)
        gap = (x - np.array(wall.point)) @ normal - scene.disks.radius
        inside = gap < 0.0
        x[inside] -= gap[inside, None] * normal
        moved = moved or bool(inside.any())
    shear = {pair: force for pair, force in scene.initial_shear.items() if not scene.law(pair).regularised}
    if not moved and len(shear) == len(scene.initial_shear):
        return scene
    return scene.replace(
        disks=replace(scene.disks, x=x),
        initial_shear=shear,
    )
