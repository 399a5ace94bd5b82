"""How far friction in an engine's run is from Coulomb's law: forces that it reports of pairs, held against the slips of its own motion."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.dem.neighbours import PairFinder
from ninedisk.core.history import History, Pair
from ninedisk.core.scene import Scene
from ninedisk.core.scene.motion import compile_motion, wall_poses
from ninedisk.references.contact_law import friction_error

FloatArray = NDArray[np.float64]

SOLVED_AT = {
    "theta": (0, 1),
    "semi-implicit-euler": (0, 0),
    "semi-implicit-euler in substeps": (0, 0),
    "position-first-euler": (1, 1),
}
"""Where disks and walls are when an engine solves the contacts of a step, by its scheme: 0 at the step's start, 1 at its end. Engines of
other schemes are not judged: springs stick by a stretch that no velocity shows, or nobody knows where they have their contacts."""
NEAR = 0.5
"""Gap over the mean radius up to which a pair is watched from the beginning on. Radii of flows are scaled down by the deepest overlap that
there was, so that disks in contact begin up to 0.1 radii apart: within 0.02 there are 3 of the 86 loaded contacts that are watched in the
hopper of 300 disks, and 9 of 133 in the drum."""
TURNED = 1e-3
"""Slips up to this part of the disks' mean speed in the run count as none. A wall that turns by an angle a in a step has two velocities,
that of its point with its spin and the mean one, which differ by ``a^2/2`` times an arm over the step: in the drum 2e-4 of the speed."""


def near_pairs(scene: Scene) -> list[Pair]:
    """Pairs of bodies that are near each other at time 0."""
    disks = scene.disks
    finder = PairFinder(disks.radius, len(scene.walls), disks.fixed)
    poses = wall_poses(compile_motion(scene.walls), 0.0)
    pairs = finder.within(np.ascontiguousarray(disks.x), poses, NEAR * float(disks.radius.mean()))
    return [(int(i), int(j)) for i, j in pairs]


def friction_of(history: History, scene: Scene, scheme: str) -> float:
    """`friction_error` of the watched contacts, all steps together.

    Slips are those of the velocities after a step, in the frame in which its contacts were solved: friction in it, times the arm, is
    what changes the spins, while in the frame of the step's other end it is off by some per cent of the torques. A pair that is open bears
    nothing and is ignored; contacts of pairs that are not watched are not judged.

    Parameters
    ----------
    history : History
        Of a run that sampled every step.
    scene : Scene
    scheme : str
        The engine's.

    Returns
    -------
    float
        NaN if the scheme is none of `SOLVED_AT`, the engine does not report forces of pairs, or those of an instant, which springs have.
    """
    if scheme not in SOLVED_AT or history.force_meaning != "step-mean" or not history.pairs:
        return math.nan
    disks_at, walls_at = SOLVED_AT[scheme]
    motion, dt = compile_motion(scene.walls), float(history.t[1] - history.t[0])
    poses = [wall_poses(motion, float(t))[:, 0:4] for t in history.t]
    pairs = np.array(history.pairs)
    fn, fs, slip = history.fn[1:].copy(), history.fs[1:].copy(), np.empty_like(history.fn[1:])
    for step in range(len(slip)):
        begin, end = step, step + 1
        x, wall = history.x[(begin, end)[disks_at]], poses[(begin, end)[walls_at]]
        normal = normals_of(pairs, x, wall)
        if scheme != "theta":  # others know their forces as vectors, and report them in the frames of the sample
            given = normals_of(pairs, history.x[end], poses[end])
            force = fs[step, :, None] * perpendicular(given) - fn[step, :, None] * given
            fn[step], fs[step] = -(force * normal).sum(axis=1), (force * perpendicular(normal)).sum(axis=1)
        moved = _wall_velocities(poses[begin], poses[end], dt)
        slip[step] = slips_of(scene, pairs, normal, x, (history.v[end], history.omega[end]), (wall[:, 0:2], *moved))
    slip[np.abs(slip) <= TURNED * np.hypot(history.v[..., 0], history.v[..., 1]).mean()] = 0.0
    mu = np.array([scene.law(pair).mu for pair in history.pairs])
    return friction_error(fn, fs, slip, mu)


def slips_of(
    scene: Scene,
    pairs: NDArray[np.int64],
    normal: FloatArray,
    x: FloatArray,
    disks: tuple[FloatArray, FloatArray],
    walls: tuple[FloatArray, FloatArray, FloatArray],
) -> FloatArray:
    """Velocity of body i's surface against j's along the tangent, n turned counter-clockwise, shape (k,) [m/s].

    Parameters
    ----------
    scene : Scene
    pairs : ndarray of int, shape (k, 2)
    normal : ndarray, shape (k, 2)
        From body i to body j.
    x : ndarray, shape (n, 2)
        Centres [m].
    disks : (ndarray, ndarray), shapes (n, 2) and (n,)
        Velocities [m/s] and spins [rad/s].
    walls : (ndarray, ndarray, ndarray), shapes (m, 2), (m, 2) and (m,)
        Points [m], their velocities [m/s] and the walls' spins [rad/s].
    """
    n, radius = len(scene.disks), scene.disks.radius
    (v, omega), (point, drift, turn) = disks, walls
    i, j = pairs.T
    of_wall, disk = j >= n, np.minimum(j, n - 1)
    tangent = perpendicular(normal)
    own = (v[i] * tangent).sum(axis=1) + radius[i] * omega[i]
    other = (v[disk] * tangent).sum(axis=1) - radius[disk] * omega[disk]
    w = j[of_wall] - n
    arm = x[i[of_wall]] + radius[i[of_wall], None] * normal[of_wall] - point[w]
    material = drift[w] + turn[w, None] * perpendicular(arm)
    other[of_wall] = (material * tangent[of_wall]).sum(axis=1)
    return np.asarray(own - other)


def normals_of(pairs: NDArray[np.int64], x: FloatArray, wall: FloatArray) -> FloatArray:
    """Unit normals from body i to body j, shape (k, 2); walls as points and normals into their free side, shape (m, 4)."""
    n = len(x)
    i, j = pairs.T
    normal = x[np.minimum(j, n - 1)] - x[i]
    of_wall = j >= n
    normal[of_wall] = -wall[j[of_wall] - n, 2:4]
    return np.asarray(normal / np.hypot(*normal.T)[:, None])


def _wall_velocities(before: FloatArray, after: FloatArray, dt: float) -> tuple[FloatArray, FloatArray]:
    """Velocities [m/s] of the walls' points and spins [rad/s] that take them from pose to pose."""
    (ax, ay), (bx, by) = before[:, 2:4].T, after[:, 2:4].T
    return (after[:, 0:2] - before[:, 0:2]) / dt, np.arctan2(ax * by - ay * bx, ax * bx + ay * by) / dt


def perpendicular(vectors: FloatArray) -> FloatArray:
    """Turned counter-clockwise by a right angle."""
    return np.column_stack([-vectors[:, 1], vectors[:, 0]])
