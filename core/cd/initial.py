"""Contact forces at time 0."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd.contact_set import frames_within
from ninedisk.core.cd.laws import LawTable
from ninedisk.core.cd.memory import ContactMemory
from ninedisk.core.cd.place import Place
from ninedisk.core.dem.neighbours import PairFinder
from ninedisk.core.errors import InvalidSceneError, NonFiniteStateError
from ninedisk.core.scene import Scene

if TYPE_CHECKING:
    from ninedisk.core.cd.grain_frames import GrainFrames
FloatArray = NDArray[np.float64]

TOUCHING = 1e-9
"""Overlap over radius up to which a rigid contact counts as touching: the rounding of a scene's coordinates."""


def initial_forces(
    scene: Scene, laws: LawTable, finder: PairFinder, place: Place, grains: GrainFrames | None
) -> ContactMemory:
    """Forces at time 0: elastic contacts by their overlap and the scene's shear forces, rigid ones by nothing.

    A shear force of a pair that touches at several places belongs to the deepest contact. More than ``mu`` times the normal force
    is cut off to that, as the DEM does it: a contact cannot hold it.

    Raises
    ------
    InvalidSceneError
        If rigid bodies overlap, centres coincide, or a shear force belongs to a contact that cannot hold one.
    """
    n, radius = len(scene.disks), scene.disks.radius
    reach = 1e-12 * float(radius.max())
    try:
        frames = frames_within(reach, place, finder, laws, grains)
    except NonFiniteStateError as error:
        raise InvalidSceneError(f"{error}; move one") from error
    pairs, elastic, depth = frames.pairs, laws.elastic[frames.row], np.maximum(0.0, -frames.gap)
    smaller = np.where(pairs[:, 1] < n, radius[np.minimum(pairs[:, 1], n - 1)], np.inf)
    bad = ~elastic & (depth > TOUCHING * np.minimum(radius[pairs[:, 0]], smaller))
    if bad.any():
        k = int(np.argmax(np.where(bad, depth, 0.0)))
        names = " and ".join(scene.body_name(int(body)) for body in pairs[k])
        raise InvalidSceneError(
            f"{names} overlap by {depth[k]:g} m and their contact is rigid: move them apart, or make it elastic "
            "(cd.contacts = elastic)"
        )
    forces = np.column_stack([np.where(elastic, laws.kn[frames.row] * depth, 0.0), np.zeros(len(pairs))])
    at = {(int(pairs[k, 0]), int(pairs[k, 1])): int(k) for k in np.argsort(depth, kind="stable")}
    for pair, shear in scene.initial_shear.items():
        if shear == 0.0:
            continue
        names = " and ".join(scene.body_name(body) for body in pair)
        k = at.get(pair, -1)
        if k < 0 or not elastic[k] or laws.mu[frames.row[k]] == 0.0:
            raise InvalidSceneError(
                f"the initial shear force {shear:g} N belongs to {names}, whose contact does not hold one (open, rigid or "
                "smooth): give it an overlap, elasticity, mu > 0 and ks > 0, or drop the entry"
            )
        most = laws.mu[frames.row[k]] * forces[k, 0]
        forces[k, 1] = min(max(shear, -most), most)
    return ContactMemory(scene.n_bodies, pairs, forces, frames.place)
