"""Force chains: the normal force at every contact of a stored configuration."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Springs:
    """Linear contacts of a scene: ``kn`` between disks and of each wall [N/m], radii [m]."""

    radius: FloatArray
    disk_disk: float
    walls: FloatArray


def springs(setup: Mapping[str, Any]) -> Springs | None:
    """Springs of a stored scene; None where the distance of disks alone does not give the force.

    That is so with dashpots, a restitution, no stiffness, other outlines than disks, and the law of the common area.
    """
    try:
        scene = setup["scene"]
        laws = [scene["disk_disk"], *(wall["law"] for wall in scene["walls"])]
        if any(law.get("beta") or law.get("restitution") is not None or not law["kn"] for law in laws):
            return None
        n = len(scene["disks"]["x"])
        if max(scene["disks"].get("outline", (-1,)), default=-1) >= 0 or any(
            law.get("contact") == "area" for law in laws
        ):
            return None
        radius = np.array(np.broadcast_to(np.asarray(scene["disks"]["radius"], dtype=np.float64), (n,)))
        kn = np.array([law["kn"] for law in laws], dtype=np.float64)
    except (KeyError, TypeError, ValueError):
        return None
    return Springs(radius, float(kn[0]), kn[1:])


def contact_forces(
    held: Springs, x: FloatArray, wall_point: FloatArray, wall_angle: FloatArray
) -> tuple[list[tuple[int, int]], FloatArray]:
    """Contacts and their normal forces ``kn overlap`` over several configurations.

    Parameters
    ----------
    held : Springs
        Of n disks and m walls.
    x : ndarray, shape (f, n, 2)
        Centres [m].
    wall_point, wall_angle : ndarray, shapes (f, m, 2) and (f, m)
        A point of each wall [m] and the direction of its normal [rad].

    Returns
    -------
    pairs : list of (int, int)
        Contacts that bear a force in some configuration; walls are numbered after the disks.
    forces : ndarray, shape (f, len(pairs))
        Normal forces [N].
    """
    n, radius = len(held.radius), held.radius
    i, j = np.triu_indices(n, 1)
    overlap = radius[i] + radius[j] - np.linalg.norm(x[:, j] - x[:, i], axis=2)
    normal = np.stack([np.cos(wall_angle), np.sin(wall_angle)], axis=2)
    depth = radius - np.einsum("fnmk,fmk->fnm", x[:, :, None] - wall_point[:, None], normal).transpose(0, 2, 1)
    forces = np.concatenate([held.disk_disk * overlap, (held.walls[:, None] * depth).reshape(len(x), -1)], axis=1).clip(
        min=0.0
    )
    pairs = [*zip(i.tolist(), j.tolist(), strict=True), *((k, n + w) for w in range(len(held.walls)) for k in range(n))]
    # An overlap at the level of round-off of the coordinates is a disk that just touches.
    touching = 1e-12 * held.disk_disk * float(radius.max(initial=0.0))
    used = np.flatnonzero((np.nan_to_num(forces) > touching).any(axis=0))
    return [pairs[k] for k in used], forces[:, used]


def ends(pair: tuple[int, int], x: FloatArray, wall_point: FloatArray, wall_angle: FloatArray) -> FloatArray:
    """Ends of a chain's link in one configuration, shape (2, 2): both centres, or a centre and its foot on the wall."""
    one, two = pair
    if two < len(x):
        return np.array([x[one], x[two]])
    wall = two - len(x)
    normal = np.array([np.cos(wall_angle[wall]), np.sin(wall_angle[wall])])
    return np.array([x[one], x[one] - ((x[one] - wall_point[wall]) @ normal) * normal])
