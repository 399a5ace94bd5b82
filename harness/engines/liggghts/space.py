"""Spheres in space in LIGGGHTS: what of them it has, and how its conventions are the scene's."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import SphereScene
from ninedisk.core.validate import FloatArray
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.support import contact_steps
from ninedisk.harness.engines.plane import wall_reach
from ninedisk.harness.engines.spring import (
    IN_SPACE,
    NOTE_OVERDAMPED,
    NOTE_UNIFORM,
    Fit,
    InSpace,
    fit_arms,
    rough,
    sphere_laws,
    uniform,
)

NOTE_ARM = "lever arm of shear torque and slip: R - overlap/2, for spheres and planes"
NOTE_PROJECTION = (
    "shear displacements are projected on the new tangent plane: each step takes half the square of its rotation off"
)
NOTE_DASHPOT = "dashpot with the velocity of t_{n-1/2}; it may pull (limitForce off)"
NOTE_PULLED = "where a dashpot pulls LIGGGHTS cuts off friction at mu times its pull, the scene at 0"
NOTE_KEPT = "two spheres that part and soon touch again go on from the shear displacement that they parted with"
NOTE_ONE_LAW = "one normal model for all contacts: linear and Hertz' beside each other are two"
NOTE_MATERIALS = (
    "E* and G* of a contact come of the E and nu (0 to 0.5) of each body: no such materials have those of this scene"
)
NOTE_SEGMENTS = "walls change their velocity at contact steps only: a segment of motion ends within a step"
NOTE_KINDS = "constants are tables of atom types: at most 50 masses with dashpots of the linear law"
KINDS = 50
RIGID = 1e-13
"""Compliance of a rigid wall in units of the spheres': below what forces show."""


def materials(scene: SphereScene) -> list[tuple[float, float]] | None:
    """E [Pa] and nu of the spheres' materials and of the walls whose contacts have the scene's E* and G*; None where there are none.

    The compliances ``(1 - nu^2)/E`` of two bodies add up to ``1/E*``, and ``2 (2 - nu)(1 + nu)/E`` to ``1/G*`` where there is friction.
    """
    names = sorted(set(scene.spheres.material))
    first = [scene.spheres.material.index(name) for name in names]
    last = [len(scene.spheres) - 1 - scene.spheres.material[::-1].index(name) for name in names]
    pairs = [(a, b) for a in range(len(names)) for b in range(a, len(names))]
    bodies = [(a, b, tuple(sorted((first[a], last[b])))) for a, b in pairs]
    found = [(a, b, scene.law((i, j))) for a, b, (i, j) in bodies if i != j]
    found += [
        (a, len(names) + w, scene.law((i, len(scene.spheres) + w)))
        for a, i in enumerate(first)
        for w in range(len(scene.walls))
    ]
    size = len(names) + len(scene.walls)

    def shares(wanted: list[tuple[int, int, float]]) -> FloatArray | None:
        matrix = np.zeros((len(wanted), size))
        for row, (a, b, _) in zip(matrix, wanted, strict=True):
            row[a] += 1.0
            row[b] += 1.0
        values = np.array([value for *_, value in wanted])
        solved: FloatArray = np.linalg.lstsq(matrix, values, rcond=None)[0]
        return solved if np.abs(matrix @ solved - values).max(initial=0.0) <= 1e-12 * values.max(initial=0.0) else None

    normal = shares([(a, b, 1.0 / law.e_star) for a, b, law in found])
    shear = shares([(a, b, 1.0 / law.g_star) for a, b, law in found if rough(law)])
    if normal is None or shear is None:
        return None
    least = RIGID * np.abs(normal).max(initial=0.0)
    answer = []
    for k in range(size):
        asked = any(rough(law) for a, b, law in found if k in (a, b))
        if normal[k] < -least or (asked and shear[k] < -4.0 * least):
            return None
        rigid = normal[k] <= 10.0 * least
        ratio = shear[k] / normal[k] if asked and not rigid else 5.0
        if not 4.0 - 1e-12 <= ratio <= 6.0 + 1e-12:
            return None
        nu = (ratio - 4.0) / (ratio - 2.0)
        nu = min(max(nu, 0.0), 0.5)
        answer.append(((1.0 - nu**2) / max(float(normal[k]), least), float(nu)))
    return answer


def fit(scene: SphereScene, numerics: Numerics, fit: Fit) -> None:
    """One normal model, materials that have the scene's moduli, walls on polygons in time."""
    fit_arms(scene, fit, "overlap", "overlap")
    laws = scene.laws_in_use
    if any(map(rough, laws)):
        fit.notes += [NOTE_ARM, NOTE_PROJECTION]
    if any(map(rough, sphere_laws(scene))):
        fit.approximate = True
        fit.notes.append(NOTE_KEPT)
    if any(law.beta > 0.0 and rough(law) for law in laws):
        fit.approximate = True
        fit.notes.append(NOTE_PULLED)
    if not uniform(scene):
        fit.lacks(Capability.DISK_INERTIA, NOTE_UNIFORM)
    if any(law.beta >= 1.0 and law.hertz for law in laws):
        fit.lacks(Capability.CONTACT_DAMPING, NOTE_OVERDAMPED)
    if len({law.hertz for law in laws}) > 1:
        fit.lacks(Capability.MATERIALS, NOTE_ONE_LAW)
    elif laws and laws[0].hertz and materials(scene) is None:
        fit.lacks(Capability.HERTZ_MINDLIN, NOTE_MATERIALS)
    elif any(law.beta > 0.0 and not law.hertz for law in laws) and len(set(scene.spheres.mass.tolist())) > KINDS:
        fit.lacks(Capability.CONTACT_DAMPING, NOTE_KINDS)
    if not fit.missing & {Capability.ROTATING_WALLS, Capability.CURVED_WALL_MOTION} and legs(scene, numerics) is None:
        fit.lacks(Capability.MOVING_WALLS, NOTE_SEGMENTS)


def legs(scene: SphereScene, numerics: Numerics) -> list[list[tuple[int, int, tuple[float, float, float]]]] | None:
    """Of each wall the contact steps after which and up to which it moves, and its velocity [m/s]; None where it changes within one."""
    contact_dt = contact_steps(scene, numerics.replace(allow_unstable=True))[1]
    found = []
    for wall in scene.walls:
        begin, end, own = 0, 0.0, []
        for segment in wall.motion:
            end += segment.duration
            last = 2**31 - 2 if np.isinf(end) else round(end / contact_dt)
            if np.isfinite(end) and abs(end / contact_dt - last) > 1e-9 * end / contact_dt:
                return None
            if any(segment.velocity):
                own.append((begin, last, segment.velocity))
            begin = last
        found.append(own)
    return found


def extra(scene: SphereScene, numerics: Numerics) -> Mapping[str, Any]:
    """Materials, the walls' velocities by contact step, and the length of walls."""
    hertz = any(law.hertz for law in scene.laws_in_use)
    return {
        "elastic": materials(scene) if hertz else [],
        "wall_legs": legs(scene, numerics),
        "reach": wall_reach(scene, numerics, "liggghts"),
    }


CHOSEN: dict[str, Any] = {
    "reported_velocities": "synchronised to t_n with the forces at t_n",
    "walls": "one triangle each, fix move/mesh linear/variable",
    "tangential_damping": "off",
    "limitForce": "off",
    "neigh_modify": "delay 0 every 1 check yes",
}

LIGGGHTS_IN_SPACE = InSpace(
    capabilities=(IN_SPACE - {Capability.CURVED_WALL_MOTION})
    | {Capability.LEVER_ARM_OVERLAP, Capability.UNLOADING_NONE},
    fit=fit,
    chosen=CHOSEN,
    dashpot_note=NOTE_DASHPOT,
    extra=extra,
)
