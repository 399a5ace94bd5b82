"""What a scene can ask of an engine, in words that go into the reports."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from enum import StrEnum

import numpy as np

from ninedisk.core.law import RollingModel, Unloading
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, LeverArm, Scene, SlipAt, SphereScene


class Capability(StrEnum):
    """A capability that an engine has or lacks; the value is its description.

    Examples
    --------
    >>> Capability.FRICTION.value
    'Coulomb friction'
    """

    LINEAR_CONTACT = "linear normal contact of a given stiffness kn"
    SHEAR_SPRING = "incremental shear spring of a given stiffness ks"
    FRICTION = "Coulomb friction"
    CONTACT_DAMPING = "contact dashpot (beta)"
    RESTITUTION = "impact law with a given coefficient of restitution"
    GLOBAL_DAMPING_CENTRAL = "global damping xi, central form"
    GLOBAL_DAMPING_LAGGED = "global damping xi, lagged form"
    MOVING_WALLS = "walls with prescribed translation"
    ROTATING_WALLS = "walls with prescribed rotation about a pivot"
    CURVED_WALL_MOTION = "walls whose translation is not piecewise linear in time"
    GRAVITY = "gravity"
    BLOCKED_ROTATION = "bodies that do not rotate"
    HELD_MOTION = "disks with a prescribed velocity component"
    FIXED_DISKS = "disks that stay where they are"
    QUASI_STATIC = "the static limit: a series of equilibria"
    PRELOAD = "shear forces that contacts carry from the start"
    DISK_INERTIA = "inertia of a disk (not of a sphere)"
    LEVER_ARM_RADIUS = "shear torque with the full radius as lever arm"
    LEVER_ARM_OVERLAP = "shear torque with the lever arm R - overlap/2"
    LEVER_ARM_TORQUE = "shear torque with the lever arm R - overlap/2, slip with R"
    SLIP_MIDDLE = "slip measured in the middle of the step"
    SLIP_END = "slip of the half step, measured with the normal of the step's end"
    MATERIALS = "contact laws by pairs of materials"
    BODY_FORCES = "forces and torques on single disks, by segments of time"
    ROLLING_CONSTANT = "rolling resistance by a constant torque (model A)"
    ROLLING_VISCOUS = "rolling resistance by a viscous torque (model B)"
    ROLLING_SPRING = "rolling resistance by a spring with a cap (model C)"
    COHESION = "linear cohesion beside the normal spring"
    ADHESION = "rigid contacts that take a pull of a given size"
    PERIODIC_CELL = "periodic cell, at rest or deforming affinely"
    ENERGY_BUDGET = "energies that were lost and fed since time 0, by channels"
    OUTLINES = "grains with NURBS outlines"
    AREA_CONTACT = "normal contact with an energy of the common area"
    SPHERES = "spheres in space"
    HERTZ_MINDLIN = "Hertz-Mindlin contact of given moduli"
    UNLOADING_NONE = "Mindlin's shear spring that keeps its displacement while the contact shrinks"
    UNLOADING_FORCE = "Mindlin's shear spring that keeps its force while the contact shrinks"
    UNLOADING_RESCALE = "Mindlin's shear spring that shrinks with the contact"
    TWISTING_CONSTANT = "resistance to twisting by a constant torque"
    TWISTING_SPRING = "resistance to twisting by a spring with a cap"
    SURFACE_DMT = "pull-off of Derjaguin, Muller and Toporov"
    SURFACE_JKR = "adhesive contact of Johnson, Kendall and Roberts"
    GLOBAL_DAMPING_CENTRAL_3D = "global damping xi of spheres, central form"
    GLOBAL_DAMPING_LAGGED_3D = "global damping xi of spheres, lagged form"
    PRELOAD_3D = "shear forces that contacts of spheres carry from the start"
    BODY_FORCES_3D = "forces and torques on single spheres, by segments of time"
    COHESION_3D = "linear cohesion of spheres beside the normal spring"
    PERIODIC_CELL_3D = "periodic cell of spheres, at rest or deforming affinely"
    ROLLING_VISCOUS_3D = "rolling resistance of spheres by a viscous torque (model B)"
    BOXES = "boxes in space, with contacts at corners, edges and faces"
    HERTZ_MINDLIN_2D = "Hertz-Mindlin contact of disks, as of spheres whose centres stay in a plane"


def wire_name(capability: Capability) -> str:
    """Return the name of a capability in the description of an engine behind a command.

    Parameters
    ----------
    capability : Capability

    Returns
    -------
    str

    Examples
    --------
    >>> wire_name(Capability.LINEAR_CONTACT)
    'linear-contact'
    """
    return capability.name.lower().replace("_", "-")


LEVER_ARMS: Mapping[LeverArm, Capability] = {
    "radius": Capability.LEVER_ARM_RADIUS,
    "overlap": Capability.LEVER_ARM_OVERLAP,
    "torque-overlap": Capability.LEVER_ARM_TORQUE,
}
"""What a law's lever arm asks of an engine."""

SLIP_AT: Mapping[SlipAt, Capability] = {"middle": Capability.SLIP_MIDDLE, "end": Capability.SLIP_END}
"""What a law's place of the slip in the step asks of an engine."""

ROLLING: Mapping[RollingModel, Capability] = {
    "constant": Capability.ROLLING_CONSTANT,
    "viscous": Capability.ROLLING_VISCOUS,
    "elastic-plastic": Capability.ROLLING_SPRING,
}
"""What a law's rolling resistance asks of an engine."""

TWISTING: Mapping[RollingModel, Capability] = {
    "constant": Capability.TWISTING_CONSTANT,
    "elastic-plastic": Capability.TWISTING_SPRING,
}
"""As `ROLLING`, of spin about the normal."""

EXTRAS = frozenset(ROLLING.values()) | {
    Capability.MATERIALS,
    Capability.BODY_FORCES,
    Capability.COHESION,
    Capability.ADHESION,
    Capability.PERIODIC_CELL,
    Capability.ENERGY_BUDGET,
    Capability.HERTZ_MINDLIN_2D,
}
"""What few engines have beside disks, walls and Coulomb's law."""

OF_RIGID = frozenset(
    {
        Capability.FRICTION,
        Capability.RESTITUTION,
        Capability.MOVING_WALLS,
        Capability.ROTATING_WALLS,
        Capability.CURVED_WALL_MOTION,
        Capability.GRAVITY,
        Capability.BLOCKED_ROTATION,
        Capability.FIXED_DISKS,
    }
)
"""What most engines with rigid contacts have."""

OF_RIGID_SPHERES = OF_RIGID | {Capability.SPHERES, Capability.HELD_MOTION}
"""And what most of those have in space."""

GRAINS = frozenset({Capability.OUTLINES, Capability.AREA_CONTACT})
"""What only engines of grains have, not those of disks."""


UNLOADING: Mapping[Unloading, Capability] = {
    "none": Capability.UNLOADING_NONE,
    "force": Capability.UNLOADING_FORCE,
    "rescale": Capability.UNLOADING_RESCALE,
}
"""What the shear spring of Hertz-Mindlin asks of an engine."""

IN_3D: Mapping[Capability, Capability] = {
    Capability.GLOBAL_DAMPING_CENTRAL: Capability.GLOBAL_DAMPING_CENTRAL_3D,
    Capability.GLOBAL_DAMPING_LAGGED: Capability.GLOBAL_DAMPING_LAGGED_3D,
    Capability.PRELOAD: Capability.PRELOAD_3D,
    Capability.BODY_FORCES: Capability.BODY_FORCES_3D,
    Capability.COHESION: Capability.COHESION_3D,
    Capability.PERIODIC_CELL: Capability.PERIODIC_CELL_3D,
    Capability.ROLLING_VISCOUS: Capability.ROLLING_VISCOUS_3D,
}
"""What a scene in 3D asks for instead: an engine that has these in 2D need not have them in 3D."""

IN_2D: Mapping[Capability, Capability] = {Capability.HERTZ_MINDLIN: Capability.HERTZ_MINDLIN_2D}
"""And a scene in 2D."""

SPACE = (
    frozenset(UNLOADING.values())
    | frozenset(IN_3D.values())
    | {
        Capability.SPHERES,
        Capability.HERTZ_MINDLIN,
        Capability.TWISTING_CONSTANT,
        Capability.TWISTING_SPRING,
        Capability.SURFACE_DMT,
        Capability.SURFACE_JKR,
        Capability.BOXES,
    }
)
"""What only engines of bodies in space have."""


def capabilities_needed(scene: Scene | SphereScene, numerics: Numerics) -> frozenset[Capability]:
    """Return the capabilities that a scene and its numerics require of an engine.

    A contact whose stiffness only regularises a rigid one (`ContactLaw`, ``regularised``) asks for either the linear
    contact or an impact law; it is therefore left to the engine's ``supports`` and not listed here.

    Parameters
    ----------
    scene : Scene or SphereScene
    numerics : Numerics

    Returns
    -------
    frozenset of Capability

    Examples
    --------
    A smooth disk on a floor, under gravity:

    >>> law = ContactLaw(kn=1e6)
    >>> floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law)
    >>> disk = Disks(x=[[0.0, 0.5]], radius=0.5, mass=1.0)
    >>> scene = Scene(disks=disk, disk_disk=law, walls=[floor], gravity=(0.0, -10.0))
    >>> sorted(need.name for need in capabilities_needed(scene, Numerics(dt=0.01, n_steps=1)))
    ['GRAVITY', 'LINEAR_CONTACT']
    """
    bodies = scene.bodies
    turning = bool(bodies.rotating.any())
    need: set[Capability] = set() if isinstance(scene, Scene) else {Capability.SPHERES}
    for law in scene.laws_in_use:
        if turning and law.rolling is not None:
            need.add(ROLLING[law.rolling.model])
        if turning and law.twisting is not None:
            need.add(TWISTING[law.twisting.model])
        if law.cohesion > 0.0:
            need.add(Capability.COHESION)
        if law.adhesion > 0.0:
            need.add(Capability.ADHESION)
        if law.surface_energy > 0.0:
            need.add(Capability.SURFACE_DMT if law.surface == "dmt" else Capability.SURFACE_JKR)
        if law.contact == "area":
            need.add(Capability.AREA_CONTACT)
        if law.mu > 0.0:
            need.add(Capability.FRICTION)
        if law.regularised:
            continue
        need.add(Capability.HERTZ_MINDLIN if law.hertz else Capability.LINEAR_CONTACT)
        if law.beta > 0.0:
            need.add(Capability.CONTACT_DAMPING)
        if law.mu > 0.0:
            need.add(Capability.SHEAR_SPRING)
            if law.g_star > 0.0:
                need.add(UNLOADING[law.unloading])
            if turning:
                need.add(LEVER_ARMS[law.lever_arm])
    need |= {SLIP_AT[law.slip_at] for law in _turning(scene)}
    for wall in scene.walls:
        for segment in wall.motion:
            if any(segment.velocity):
                need.add(Capability.MOVING_WALLS)
            if np.any(segment.angular_velocity):
                need.add(Capability.ROTATING_WALLS)
            if any(segment.amplitude) or any(getattr(segment, "tan_lever", ())):
                need.add(Capability.CURVED_WALL_MOTION)
    if any(scene.gravity):
        need.add(Capability.GRAVITY)
    fixed = bodies.fixed
    if fixed.any():
        need.add(Capability.FIXED_DISKS)
    if not bodies.rotating[~fixed].all():
        need.add(Capability.BLOCKED_ROTATION)
    if bodies.held[~fixed].any():
        need.add(Capability.HELD_MOTION)
    if scene.laws:
        need.add(Capability.MATERIALS)
    if numerics.energy_budget:
        need.add(Capability.ENERGY_BUDGET)
    if numerics.regime == "quasi-static":
        need.add(Capability.QUASI_STATIC)
    if scene.xi > 0.0:
        central = numerics.damping_form == "central"
        need.add(Capability.GLOBAL_DAMPING_CENTRAL if central else Capability.GLOBAL_DAMPING_LAGGED)
    if scene.forces:
        need.add(Capability.BODY_FORCES)
    if any(np.any(force) for force in scene.initial_shear.values()):
        need.add(Capability.PRELOAD)
    if scene.cell is not None:
        need.add(Capability.PERIODIC_CELL)
    if isinstance(scene, SphereScene) and scene.spheres.boxes.any():
        need.add(Capability.BOXES)
    if isinstance(scene, Scene):
        return frozenset(IN_2D.get(each, each) for each in need | _needed_in_2d(scene))
    return frozenset(IN_3D.get(each, each) for each in need)


def _needed_in_2d(scene: Scene) -> set[Capability]:
    """Return what only scenes in 2D can ask for."""
    need = set()
    if (scene.disks.outline >= 0).any():
        need.add(Capability.OUTLINES)
    if scene.disks.rotating.any() and any(law.mu > 0.0 for law in scene.laws_in_use):
        need.add(Capability.DISK_INERTIA)
    return need


def capabilities_asked(scene: Scene | SphereScene, numerics: Numerics) -> frozenset[Capability]:
    """Return what a scene asks of whatever engine runs it.

    These are `capabilities_needed`, and of a contact whose stiffness only regularises a rigid one both the springs and the
    impact law, of which an engine uses one.

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
    >>> sorted(need.name for need in capabilities_asked(scene, Numerics(dt=0.01, n_steps=1)))
    ['GRAVITY', 'LINEAR_CONTACT', 'RESTITUTION']
    """
    sprung = scene.with_laws(lambda law: replace(law, regularised=False))
    impact = any(law.restitution for law in scene.laws_in_use)
    return (
        capabilities_needed(scene, numerics)
        | capabilities_needed(sprung, numerics)
        | ({Capability.RESTITUTION} if impact else frozenset())
    )


def _turning(scene: Scene | SphereScene) -> list[ContactLaw]:
    """Laws of shear springs whose slip is not the same in the middle of a step and at its end.

    Between bodies the normal turns. At walls it does where they rotate; else only the overlap changes in a step, which shortens the arm
    of a spin. In 3D all laws count where bodies turn or there are several.
    """
    if not isinstance(scene, Scene):
        together = scene.bodies.rotating.any() or len(scene.bodies) > 1
        return [law for law in scene.laws_in_use if law.mu > 0.0 and not law.regularised and together]
    laws = [scene.disk_disk] if len(scene.disks) > 1 else []
    for wall in scene.walls:
        rotates = any(segment.angular_velocity for segment in wall.motion)
        if rotates or (wall.law.lever_arm == "overlap" and scene.disks.rotating.any()):
            laws.append(wall.law)
    laws += scene.laws.values()
    return [law for law in laws if law.mu > 0.0 and max(law.ks, law.g_star) > 0.0 and not law.regularised]
