"""How engines express a scene: contact steps of those with springs, and what one with rigid contacts makes of springs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import PlaneWall, Scene, SphereScene, Wall
from ninedisk.harness.api.capabilities import SLIP_AT, Capability, capabilities_needed
from ninedisk.harness.api.engine import Engine, Support, SupportLevel

AnyScene = TypeVar("AnyScene", bound=Scene | SphereScene)

OF_SLIP_AT = frozenset(SLIP_AT.values())
"""What an engine may lack whose runs are those of the same physics, discretised otherwise: of first order in the step."""

NOTE_SLIP_AT = (
    "slip is not measured where in the step the scene's slip_at says: a difference of first order in the step"
)
NOTE_SLIP_END = (
    "the half step's slip is measured with the normal of the step's end (slip_at = end): of first order in the step"
)
NOTE_PRELOAD = "rigid contacts: the preload of the regularising springs is left out, bodies start touching"
NOTE_SOFT = "contacts are soft in a way of the engine's own"
NOTE_SPACE_ONLY = "it runs scenes in space only"
NOTE_RESTITUTION = "the scene prescribes no restitution: 0 is used"


def contact_steps(scene: Scene | SphereScene, numerics: Numerics) -> tuple[int, float]:
    """Contact steps in one ``dt`` and their length [s]: those of the in-house DEM, whose scheme it is.

    Raises
    ------
    UnstableTimeStepError
        If ``numerics.contact_dt`` exceeds the critical step and ``numerics.allow_unstable`` is False.
    """
    if isinstance(scene, SphereScene):
        from ninedisk.core.dem.space.session import contact_step as step_in_space

        contact_dt, _ = step_in_space(scene, numerics)
    else:
        from ninedisk.core.dem.arrays import contact_step

        contact_dt, _ = contact_step(scene, numerics)
    return numerics.substeps(contact_dt), contact_dt


def support_of(engine: Engine, scene: Scene | SphereScene, numerics: Numerics) -> Support:
    """`Engine.supports`, which is only asked about scenes of a dimension that the engine has."""
    if isinstance(scene, SphereScene) and Capability.SPHERES not in engine.info().capabilities:
        return Support(SupportLevel.NO, missing=(Capability.SPHERES,))
    if isinstance(scene, Scene) and not engine.info().plane:
        return Support(SupportLevel.NO, notes=(NOTE_SPACE_ONLY,))
    return engine.supports(scene, numerics)  # type: ignore[arg-type]


def rigid_needs(scene: Scene | SphereScene, numerics: Numerics) -> frozenset[Capability]:
    """Capabilities that a rigid engine needs: a preload of regularising springs is none of its business.

    Shear forces that contacts carry from the start and the overlaps that go with them are the state of the springs; a
    rigid contact finds its forces anew in each step. Where every preloaded contact is regularised, `PRELOAD` is
    therefore dropped.
    """
    need = capabilities_needed(scene, numerics)
    if all(scene.law(pair).regularised for pair, force in _initial_shear(scene).items() if force):
        need -= {Capability.PRELOAD}
    return need


def rigid_support(
    scene: Scene | SphereScene,
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
    laws = scene.laws_in_use
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


def has_spring_preload(scene: Scene | SphereScene) -> bool:
    """Whether `without_spring_preload` changes anything."""
    return without_spring_preload(scene) is not scene


def without_spring_preload(scene: AnyScene) -> AnyScene:
    """The same scene with the initial state of the regularising springs undone.

    Each body that overlaps a wall is moved along the wall's normal until it touches, and initial shear forces of
    regularised contacts are dropped. Overlaps between disks or spheres stay as they are: no single displacement undoes a chain of
    them.

    Parameters
    ----------
    scene : Scene or SphereScene

    Returns
    -------
    Scene or SphereScene
        The very same object where there is nothing to undo.
    """
    x = np.array(scene.bodies.x)
    moved = False
    walls: Sequence[PlaneWall | Wall] = scene.walls
    for w, wall in enumerate(walls, len(x)):
        normal = np.array(wall.normal)
        gap = (x - np.array(wall.point)) @ normal - _reach(scene, normal)
        inside = [i for i in np.flatnonzero(gap < 0.0).tolist() if scene.law((i, w)).regularised]
        x[inside] -= gap[inside, None] * normal
        moved = moved or bool(inside)
    before = _initial_shear(scene)
    shear = {pair: force for pair, force in before.items() if not scene.law(pair).regularised}
    if not moved and len(shear) == len(before):
        return scene
    placed = replace(scene.bodies, x=x)
    changed = {"spheres": placed} if isinstance(scene, SphereScene) else {"disks": placed, "initial_shear": shear}
    return scene.replace(**changed)  # type: ignore[return-value]


def _initial_shear(scene: Scene | SphereScene) -> Mapping[tuple[int, int], float]:
    return scene.initial_shear if isinstance(scene, Scene) else {}


def _reach(scene: Scene | SphereScene, normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far each body reaches towards a wall with this inward normal [m], shape (n,)."""
    reach = np.array(scene.bodies.radius)
    if isinstance(scene, SphereScene):
        return reach
    disks = scene.disks
    for i in np.flatnonzero(disks.outline >= 0):
        from ninedisk.core.nurbs.mass import extent

        c, s = np.cos(disks.angle[i]), np.sin(disks.angle[i])
        towards = -np.array([[c, s], [-s, c]]) @ normal
        reach[i] = extent(scene.outlines[disks.outline[i]], towards)
    return reach
