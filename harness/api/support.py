"""How engines express a scene: contact steps of those with springs, and what one with rigid contacts makes of springs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import PlaneWall, Scene, SphereScene, Wall
from ninedisk.harness.api.boxes import box_reach, rotation_matrix
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
    """Return the number of contact steps in one ``dt`` and their length [s]: those of the in-house DEM, whose scheme it is.

    Parameters
    ----------
    scene : Scene or SphereScene
    numerics : Numerics

    Returns
    -------
    tuple of int and float
        Number, and length [s].

    Raises
    ------
    UnstableTimeStepError
        If ``numerics.contact_dt`` exceeds the critical step and ``numerics.allow_unstable`` is False.

    Examples
    --------
    >>> scene = Scene(disks=Disks(x=[[0.0, 0.0]], radius=0.5, mass=1.0), disk_disk=ContactLaw(kn=1e6))
    >>> contact_steps(scene, Numerics(dt=0.01, n_steps=1, contact_dt=0.001))
    (10, 0.001)
    """
    if isinstance(scene, SphereScene):
        from ninedisk.core.dem.space.session import contact_step as step_in_space

        contact_dt, _ = step_in_space(scene, numerics)
    else:
        from ninedisk.core.dem.arrays import contact_step

        contact_dt, _ = contact_step(scene, numerics)
    return numerics.substeps(contact_dt), contact_dt


def support_of(engine: Engine, scene: Scene | SphereScene, numerics: Numerics) -> Support:
    """Return `Engine.supports`, which is asked only about scenes of a dimension that the engine has.

    Parameters
    ----------
    engine : Engine
    scene : Scene or SphereScene
    numerics : Numerics

    Returns
    -------
    Support

    Examples
    --------
    The in-house DEM has no rigid contacts that hold a pull:

    >>> from ninedisk.harness.api.registry import get_engine
    >>> disks = Disks(x=[[0.0, 0.0], [1.0, 0.0]], radius=0.5, mass=[1.0, 2.0])
    >>> scene = Scene(disks=disks, disk_disk=ContactLaw(kn=1e6, adhesion=2.0))
    >>> answer = support_of(get_engine("dem"), scene, Numerics(dt=0.01, n_steps=1))
    >>> answer.level.value, [capability.name for capability in answer.missing]
    ('no', ['ADHESION'])
    """
    if isinstance(scene, SphereScene) and Capability.SPHERES not in engine.info().capabilities:
        return Support(SupportLevel.NO, missing=(Capability.SPHERES,))
    if isinstance(scene, Scene) and not engine.info().plane:
        return Support(SupportLevel.NO, notes=(NOTE_SPACE_ONLY,))
    return engine.supports(scene, numerics)  # type: ignore[arg-type]


def rigid_needs(scene: Scene | SphereScene, numerics: Numerics) -> frozenset[Capability]:
    """Return the capabilities that a rigid engine needs, which ignores a preload of regularising springs.

    Shear forces that contacts carry from the start and the overlaps that go with them are the state of the springs; a
    rigid contact finds its forces anew in each step. Where every preloaded contact is regularised, `PRELOAD` is
    therefore dropped.

    Parameters
    ----------
    scene : Scene or SphereScene
    numerics : Numerics

    Returns
    -------
    frozenset of Capability

    Examples
    --------
    >>> law = ContactLaw(kn=1e6, restitution=0.5, regularised=True)
    >>> disks = Disks(x=[[0.0, 0.0], [2.0, 0.0]], radius=1.0, mass=1.0)
    >>> scene = Scene(disks=disks, disk_disk=law, gravity=(0.0, -10.0))
    >>> preloaded = scene.replace(initial_shear={(0, 1): 5.0})
    >>> [need.name for need in rigid_needs(preloaded, Numerics(dt=0.01, n_steps=1))]
    ['GRAVITY']
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
    """Report how an engine with rigid contacts expresses a scene; one whose stiffness matters is refused.

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

    Returns
    -------
    Support

    Examples
    --------
    >>> law = ContactLaw(kn=1e6, restitution=0.5, regularised=True)
    >>> disks = Disks(x=[[0.0, 0.0], [2.0, 0.0]], radius=1.0, mass=1.0)
    >>> scene = Scene(disks=disks, disk_disk=law, gravity=(0.0, -10.0))
    >>> from ninedisk.harness.api.capabilities import Capability
    >>> numerics, able = Numerics(dt=0.01, n_steps=1), {Capability.GRAVITY, Capability.RESTITUTION}
    >>> rigid_support(scene, numerics, able).level.value, rigid_support(scene, numerics, set()).level.value
    ('exact', 'no')
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
    """Decide whether `without_spring_preload` changes anything.

    Parameters
    ----------
    scene : Scene or SphereScene

    Returns
    -------
    bool

    Examples
    --------
    A disk of radius 0.5 m at a height of 0.4 m overlaps the floor:

    >>> law = ContactLaw(kn=1e6, regularised=True)
    >>> floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law)
    >>> sunk = Scene(disks=Disks(x=[[0.0, 0.4]], radius=0.5, mass=1.0), disk_disk=law, walls=[floor])
    >>> has_spring_preload(sunk)
    True
    """
    return without_spring_preload(scene) is not scene


def without_spring_preload(scene: AnyScene) -> AnyScene:
    """Return the same scene with the initial state of the regularising springs undone.

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

    Examples
    --------
    A disk of radius 0.5 m at a height of 0.4 m is lifted to 0.5 m:

    >>> law = ContactLaw(kn=1e6, regularised=True)
    >>> floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law)
    >>> sunk = Scene(disks=Disks(x=[[0.0, 0.4]], radius=0.5, mass=1.0), disk_disk=law, walls=[floor])
    >>> without_spring_preload(sunk).disks.x.tolist()
    [[0.0, 0.5]]
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
        for i in np.flatnonzero(scene.spheres.boxes):
            reach[i] = box_reach(scene.spheres.half_sizes[i], rotation_matrix(scene.spheres.quaternion[i]), normal)
        return reach
    disks = scene.disks
    for i in np.flatnonzero(disks.outline >= 0):
        from ninedisk.core.nurbs.mass import extent

        c, s = np.cos(disks.angle[i]), np.sin(disks.angle[i])
        towards = -np.array([[c, s], [-s, c]]) @ normal
        reach[i] = extent(scene.outlines[disks.outline[i]], towards)
    return reach
