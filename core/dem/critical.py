"""Critical time step of the explicit scheme on a scene."""

from __future__ import annotations

import numpy as np

from ninedisk.core.contacts.finder import PairFinder
from ninedisk.core.dem.critical_kernels import largest_eigenvalue
from ninedisk.core.dem.grain_arrays import needs_outlines
from ninedisk.core.dem.grain_network import grain_network, normal_arms, stiffening
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.geometry.motion import compile_motion, wall_poses
from ninedisk.core.numerics import DampingForm
from ninedisk.core.scene import FloatArray, Scene

NEAR = 1e-3
"""Pairs with a gap below this fraction of the smaller radius count as contacts of the network."""

ITERATIONS, TOLERANCE = 300, 1e-3


def critical_time_step(scene: Scene, *, damping_form: DampingForm = "central") -> float:
    """Largest stable contact step of the central-difference scheme [s]: exact for one mode, else on the safe side.

    The highest frequency of the scene's present contact network (all contacts sticking; contacts within a gap of 1e-3
    radii included) is found by power iteration, the norm of the residual added; every disk is further taken to touch
    a wall, and the two lightest each other, so that free flight has a limit as well. Undamped, the limit is ``2/omega``. A dashpot
    with ratio ``zeta`` at that frequency lowers it to ``(2/omega)(sqrt(1 + z^2) - z)`` with ``z = zeta`` where dashpots see
    ``v_{n-1/2}`` (lagged) and ``z = 2 zeta`` where they see the extrapolated ``v_n`` (central): the root z = -1 of the
    characteristic polynomial; lagged global damping adds ``xi/(2 omega)`` to ``zeta``, the central form leaves the limit as it is.
    Every spring, those of the shear included, is taken to have the largest of all damping times ``c/kn``. Contacts that form later
    stiffen the network: stay well below.

    Grains with outlines have the springs of their contacts at time 0, with the arms of the normal forces. A single contact is bounded by
    the largest arms that the outline allows, normal and shear spring together. The law of the common area is stiffer than ``kn`` where
    outlines are flatter than the disk of the same area (`ninedisk.core.dem.grain_network.stiffening`).

    Parameters
    ----------
    scene : Scene
    damping_form : {"central", "lagged"}

    Returns
    -------
    float
        ``inf`` for a scene in which nothing can touch.
    """
    lagged = damping_form == "lagged"
    laws = [wall.law for wall in scene.walls] + ([scene.disk_disk] if len(scene.disks) > 1 else [])
    if not laws or len(scene.disks) == 0:
        return 2.0 / scene.xi if lagged and scene.xi > 0.0 else float("inf")
    square = max(_network_square(scene), _single_contact_square(scene))
    omega = float(np.sqrt(square))
    # c/kn = 2 beta sqrt(m_eff/kn) is largest for the heaviest bodies; a mode of frequency omega has zeta = omega (c/kn)/2.
    heaviest = float(scene.disks.mass.max())
    zeta = max(omega * law.beta * np.sqrt(heaviest / law.kn) for law in laws)
    z = zeta + 0.5 * scene.xi / omega if lagged else 2.0 * zeta
    return float(2.0 / omega / (np.sqrt(1.0 + z * z) + z))


def _single_contact_square(scene: Scene) -> float:
    """Largest ``omega^2`` [1/s^2] of one contact on its own."""
    disks = scene.disks
    inv_mass = 1.0 / disks.mass
    turn = np.where(disks.rotating, 1.0 / disks.inertia, 0.0)
    aside = normal_arms(scene)
    worst = 0.0
    for law, other in [(scene.disk_disk, True)] * (len(disks) > 1) + [(wall.law, False) for wall in scene.walls]:
        with np.errstate(over="ignore"):  # an infinite one leaves no step
            normal = law.kn * stiffening(scene, law) * (inv_mass + aside**2 * turn)
            shear = law.shear_stiffness * (inv_mass + disks.radius**2 * turn)
        # On a disk the two springs move different coordinates; an arm of the normal force couples them.
        for square in (normal, shear, np.where(aside > 0.0, normal + shear, 0.0)):
            two = np.sort(square)[::-1][: 2 if other else 1]
            worst = max(worst, float(two.sum()))
    return worst


def _network_square(scene: Scene) -> float:
    springs, bodies = contact_network(scene, NEAR * float(scene.disks.radius.min()))
    if len(bodies) == 0:
        return 0.0
    disks = scene.disks
    root = np.empty((len(disks), 3))
    root[:, 0] = root[:, 1] = 1.0 / np.sqrt(disks.mass)
    root[:, 2] = np.where(disks.rotating, 1.0 / np.sqrt(disks.inertia), 0.0)
    # A fixed irregular start vector: the result is the same on every call, and no mode is orthogonal to it by symmetry.
    start = np.cos(np.arange(1.0, 3.0 * len(disks) + 1.0) ** 2).reshape(-1, 3)
    return float(largest_eigenvalue(springs, bodies, root, start, np.empty_like(start), ITERATIONS, TOLERANCE))


def contact_network(scene: Scene, reach: float) -> tuple[FloatArray, np.ndarray[tuple[int, int], np.dtype[np.int64]]]:
    """Springs and bodies of all pairs with a gap up to ``reach`` [m] at time 0, as `apply_stiffness` reads them."""
    if needs_outlines(scene):
        return grain_network(scene, reach)
    disks = scene.disks
    first, second = PairFinder(disks.radius, 0).within(disks.x, np.empty((0, 11)), reach).T
    d = disks.x[second] - disks.x[first]
    distance = np.hypot(d[:, 0], d[:, 1])
    if len(distance) and distance.min() == 0.0:
        k = int(np.argmin(distance))
        x, y = disks.x[first[k]]
        raise InvalidSceneError(
            f"the centres of disks {first[k]} and {second[k]} coincide at ({x:g}, {y:g}): their contact has no normal; move one"
        )
    n = d / distance[:, None]
    law = scene.disk_disk
    ones = np.ones(len(first))
    springs = [
        np.column_stack(
            [
                n,
                law.kn * ones,
                law.shear_stiffness * ones,
                disks.radius[first],
                disks.radius[second],
                0.0 * ones,
                0.0 * ones,
            ]
        )
    ]
    bodies = [np.column_stack([first, second])]
    poses = wall_poses(compile_motion(scene.walls), 0.0)
    for wall, pose in zip(scene.walls, poses, strict=True):
        height = (disks.x - pose[0:2]) @ pose[2:4]
        near = np.flatnonzero(height - disks.radius <= reach)
        row = [-pose[2], -pose[3], wall.law.kn, wall.law.shear_stiffness]
        springs.append(np.column_stack([np.tile(row, (len(near), 1)), disks.radius[near], np.zeros((len(near), 3))]))
        bodies.append(np.column_stack([near, np.full(len(near), -1)]))
    return np.vstack(springs), np.vstack(bodies).astype(np.int64)
