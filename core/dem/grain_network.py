"""Springs of the contacts of outlines, for the critical time step."""

from __future__ import annotations

import numpy as np

from ninedisk.core.dem.grain_arrays import equal_radii, outline_arrays
from ninedisk.core.dem.neighbours import PairFinder
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.motion import compile_motion, wall_poses
from ninedisk.core.nurbs.curve import NurbsCurve
from ninedisk.core.nurbs.intersect import NurbsGrains
from ninedisk.core.nurbs.nurbs_grain import farthest
from ninedisk.core.nurbs.state import ContactRows, IntArray
from ninedisk.core.nurbs.table import outline_points
from ninedisk.core.scene import ContactLaw, FloatArray, Scene

FLATTEST = 100.0
"""Radius of curvature, over that of the disk of the same area, beyond which an outline is not taken to be flatter. Flat faces, and
convex in concave ones, have no bound: at a first touch of faces of width w the force of the common area grows as overlap^(1/3)."""

SAMPLES = 9
"""Points of a piece at which curvature and arms are measured."""


def stiffening(scene: Scene, law: ContactLaw) -> float:
    """Largest ``fn/(kn overlap)`` of a law on the scene's outlines.

    1 for the chord. For the common area, ``(rho_e/R_e)^(2/3)`` where the outlines have the radii of curvature rho and the disks of the
    same areas the radii R: at most the larger ``rho/R`` of both bodies.
    """
    used = np.unique(scene.disks.outline[scene.disks.outline >= 0])
    if law.contact != "area" or not len(used):
        return 1.0
    radii = equal_radii(scene.outlines)
    flat = [min(float(_measures(scene.outlines[k])[0] / radii[k]), FLATTEST) for k in used]
    return float(max(1.0, *flat) ** (2.0 / 3.0))


def normal_arms(scene: Scene) -> FloatArray:
    """Bound of the arm of a normal force about each body's centre [m], shape (n,); 0 on disks."""
    arms = np.zeros(len(scene.disks))
    for k in np.unique(scene.disks.outline[scene.disks.outline >= 0]):
        curve = scene.outlines[k]
        arm, reach = _measures(curve)[1], farthest(curve)
        arms[scene.disks.outline == k] = 0.0 if arm <= 1e-9 * reach else arm
    return arms


def _measures(curve: NurbsCurve) -> tuple[float, float]:
    """Largest radius of curvature, infinite unless strictly convex, and largest distance of a normal from the centre [m].

    An outline that is not strictly convex has corners or chords across a dent: its contacts can have any arm that it has room for.
    """
    table = curve.table
    if table.smallest_radius[0] == 0.0:
        return np.inf, farthest(curve)
    largest, arm = 0.0, 0.0
    for k in range(len(table.piece_span)):
        span = int(table.piece_span[k])
        low, high = table.piece_range[k]
        at = np.linspace(low, high, SAMPLES)
        (point,), (slope,), (bend,) = outline_points(table.coef[span : span + 1], at)
        speed = np.hypot(*slope.T)
        largest = max(largest, float(np.max(speed**3 / (slope[:, 0] * bend[:, 1] - slope[:, 1] * bend[:, 0]))))
        arm = max(arm, float(np.max(np.abs(np.sum(point * slope, axis=1)) / speed)))
    return largest, arm


def grain_network(scene: Scene, reach: float) -> tuple[FloatArray, IntArray]:
    """Springs and bodies of all contacts at time 0, in the form of `ninedisk.core.dem.critical.contact_network`.

    Bodies whose enclosing circles have a gap within ``reach`` [m] of 0, and no contact, count as touching disks.

    Raises
    ------
    InvalidSceneError
        If bodies penetrate each other so far that no chord defines their contact, or two centres coincide.
    """
    disks, outlines = scene.disks, outline_arrays(scene)
    grains = NurbsGrains.of_table(outlines.table, outlines.shape)
    listed = PairFinder(disks.radius, 0).within(disks.x, np.empty((0, 11)), reach)
    d = disks.x[listed[:, 1]] - disks.x[listed[:, 0]]
    distance = np.hypot(d[:, 0], d[:, 1])
    if len(distance) and distance.min() == 0.0:
        i, j = listed[np.argmin(distance)]
        raise InvalidSceneError(f"the centres of grains {i} and {j} coincide: their contact has no normal; move one")
    gap = distance - disks.radius[listed[:, 0]] - disks.radius[listed[:, 1]]
    alone = outlines.round[listed].all(axis=1)
    pair, rows = grains.pair_contacts(disks.x, disks.angle, listed[~alone])
    touching = np.flatnonzero(~alone)[pair]
    as_disks = alone | ((np.abs(gap) <= reach) & ~np.isin(np.arange(len(listed)), touching))
    law, factor = scene.disk_disk, stiffening(scene, scene.disk_disk)
    springs = [
        _springs(rows, law, factor, disks.x[listed[touching, 0]], disks.x[listed[touching, 1]]),
        disk_springs(
            d[as_disks] / distance[as_disks, None], law, factor, *(disks.radius[listed[as_disks, k]] for k in (0, 1))
        ),
    ]
    bodies = [listed[touching], listed[as_disks]]
    for wall, pose in zip(scene.walls, wall_poses(compile_motion(scene.walls), 0.0), strict=True):
        grain, rows = grains.wall_contacts(disks.x, disks.angle, pose[0:2], pose[2:4])
        gap = (disks.x - pose[0:2]) @ pose[2:4] - disks.radius
        near = np.flatnonzero((np.abs(gap) <= reach) & ~np.isin(np.arange(len(disks)), grain))
        factor = stiffening(scene, wall.law)
        springs.append(_springs(rows, wall.law, factor, disks.x[grain], None))
        springs.append(
            disk_springs(np.tile(-pose[2:4], (len(near), 1)), wall.law, factor, disks.radius[near], np.zeros(len(near)))
        )
        bodies += [np.column_stack([own, np.full(len(own), -1)]) for own in (grain, near)]
    return np.vstack(springs), np.vstack(bodies).astype(np.int64)


def _springs(
    rows: ContactRows, law: ContactLaw, factor: float, first: FloatArray, second: FloatArray | None
) -> FloatArray:
    """Springs of contacts between bodies at ``first`` and ``second`` [m], or with a wall; arms are those of lever_arm "radius"."""
    n, ones = rows.normal, np.ones(len(rows.overlap))
    t = np.column_stack([-n[:, 1], n[:, 0]])
    mine = rows.point - first
    arms = [np.sum(mine * n, axis=1) + rows.beyond, 0.0 * ones, np.sum(mine * t, axis=1), 0.0 * ones]
    if second is not None:
        other = rows.point - second
        arms[1] = rows.overlap - rows.beyond - np.sum(other * n, axis=1)
        arms[3] = np.sum(other * t, axis=1)
    return _rows(n, law, factor, arms)


def disk_springs(n: FloatArray, law: ContactLaw, factor: float, first: FloatArray, second: FloatArray) -> FloatArray:
    """Springs of disks of radii ``first`` and ``second`` [m], 0 for a wall; columns of `ninedisk.core.dem.critical.contact_network`."""
    zeros = np.zeros(len(n))
    return _rows(n, law, factor, [first, second, zeros, zeros])


def _rows(n: FloatArray, law: ContactLaw, factor: float, arms: list[FloatArray]) -> FloatArray:
    ones = np.ones(len(n))
    dashpot = 2.0 * law.beta * np.sqrt(law.kn)
    return np.column_stack([n, factor * law.kn * ones, law.shear_stiffness * ones, *arms, dashpot * ones])
