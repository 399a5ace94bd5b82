"""What an engine with rigid contacts makes of a scene whose springs only regularise such contacts."""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene
from ninedisk.harness.api.capabilities import Capability, capabilities_needed
from ninedisk.harness.api.engine import Support, SupportLevel
from ninedisk.harness.engines.spring import NOTE_SLIP_AT, OF_SLIP_AT, laws_in_use

NOTE_PRELOAD = "rigid contacts: the preload of the regularising springs is left out, disks start touching"
NOTE_RESTITUTION = "the scene prescribes no restitution: 0 is used"


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


def rigid_support(
    scene: Scene,
    numerics: Numerics,
    capabilities: Set[Capability],
    *,
    refused: Sequence[str] = (),
    remarks: Sequence[str] = (),
    approximations: Sequence[str] = (),
    preload_note: str = NOTE_PRELOAD,
) -> Support:
    """How an engine with rigid contacts expresses a scene; one whose stiffness matters is refused.

    Parameters
    ----------
    scene, numerics
    capabilities : set of Capability
        The engine's own.
    refused : sequence of str
        Reasons why this very scene cannot be expressed although no capability is missing.
    remarks : sequence of str
        Notes that do not lower the level.
    approximations : sequence of str
        In what the engine only comes near to the scene.
    preload_note : str
        What becomes of the preload of regularising springs.
    """
    need = set(rigid_needs(scene, numerics))
    laws = laws_in_use(scene)
    if any(law.restitution for law in laws):
        need.add(Capability.RESTITUTION)
    missing = need - capabilities
    if missing - OF_SLIP_AT:
        return Support(SupportLevel.NO, missing=tuple(sorted(missing)))
    if refused:
        return Support(SupportLevel.NO, notes=tuple(refused))
    differs = [preload_note] if has_spring_preload(scene) else []
    if any(law.restitution is None for law in laws):
        differs.append(NOTE_RESTITUTION)
    if missing:
        differs.append(NOTE_SLIP_AT)
    level = SupportLevel.EQUIVALENT if differs else SupportLevel.EXACT
    return Support(SupportLevel.APPROXIMATE if approximations else level, notes=(*differs, *remarks, *approximations))


def has_spring_preload(scene: Scene) -> bool:
    """Whether `without_spring_preload` changes anything."""
    return without_spring_preload(scene) is not scene


def without_spring_preload(scene: Scene) -> Scene:
    """The same scene with the initial state of the regularising springs undone.

    Each body that overlaps a wall is moved along the wall's normal until it touches, and initial shear forces of
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
        gap = (x - np.array(wall.point)) @ normal - _reach(scene, normal)
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


def _reach(scene: Scene, normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far each body reaches towards a wall with this inward normal [m], shape (n,)."""
    disks = scene.disks
    reach = np.array(disks.radius)
    for i in np.flatnonzero(disks.outline >= 0):
        from ninedisk.core.nurbs.mass import extent

        c, s = np.cos(disks.angle[i]), np.sin(disks.angle[i])
        towards = -np.array([[c, s], [-s, c]]) @ normal
        reach[i] = extent(scene.outlines[disks.outline[i]], towards)
    return reach
