"""Critical time step of the explicit scheme on a scene.

With u the displacements over the roots of the masses, K and C the stiffness and the dashpots of all contacts over the masses, and global
damping xi, central differences read

``u_{n+1} - 2 u_n + u_{n-1} + dt^2 K u_n + dt C w_n + (global damping) = 0``,

with ``w_n = u_n - u_{n-1}`` where dashpots see ``v_{n-1/2}`` ("lagged") and ``w_n = (3 (u_n - u_{n-1}) - (u_{n-1} - u_{n-2}))/2`` where
they see the extrapolated ``v_n`` ("central"). K and C are symmetric and not negative. Let z on the unit circle be a root with vector u, and
k, c >= 0 the values of ``dt^2 u* K u`` and ``dt u* C u`` for ``u* u = 1``; with a = xi dt/2 and the angle p of z they obey, divided by z,

- lagged: ``-2 (1 - cos p) + k + (c + 2 a)(1 - exp(-i p)) = 0``, imaginary part ``(c + 2 a) sin p``;
- central: ``-2 (1 - cos p) + 2 i a sin p + k + (c/2)(1 - exp(-i p))(3 - exp(-i p)) = 0``, imaginary part ``sin p (2 a + c (2 - cos p))``.

So with any damping ``sin p = 0``, and without any ``k = 2 (1 - cos p) <= 4``: roots leave the circle at z = -1 only (z = 1 is a mode
without stiffness, which stays). There ``k + 2 c + 4 a = 4`` and ``k + 4 c = 4``, so the limit is the largest dt with

``lambda_max(dt^2/4 K + dt/2 C) + xi dt/2 <= 1`` (lagged), ``lambda_max(dt^2/4 K + dt C) <= 1`` (central).

With K = B B', s = 1/dt and C' = C/2 + xi/2 or C, the limit has ``s^2 u = s C' u + B B' u/4``, which is ``s u = C' u + B y/2`` with
``y = B' u/(2 s)``: s is the largest eigenvalue of the symmetric matrix ``[[C', B/2], [B'/2, 0]]``, which Lanczos' method finds.
"""

from __future__ import annotations

import numpy as np

from ninedisk.core.array_types import FloatArray, IntArray
from ninedisk.core.dem.critical_kernels import lanczos
from ninedisk.core.dem.grains import equal_radii, needs_outlines, outline_arrays
from ninedisk.core.dem.images import close_images
from ninedisk.core.dem.neighbours import PairFinder
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.motion import compile_motion, wall_poses
from ninedisk.core.motion_kernels import NORMAL_X, PIVOT_X, POINT_X, POSE
from ninedisk.core.numerics import DampingForm
from ninedisk.core.nurbs.curve import NurbsCurve
from ninedisk.core.nurbs.intersect import NurbsGrains
from ninedisk.core.nurbs.mass import farthest
from ninedisk.core.nurbs.state import ContactRows
from ninedisk.core.nurbs.table import outline_points
from ninedisk.core.scene import ContactLaw, Scene

NEAR = 1e-3
"""Pairs with a gap below this fraction of the smaller radius count as contacts of the network."""

MOST, BATCH, TOLERANCE = 400, 10, 1e-4
"""Vectors of Lanczos' method at most, how many are found between two looks at the residual, and the relative residual that is enough."""

FLATTEST = 100.0
"""Radius of curvature, over that of the disk of the same area, beyond which an outline is not taken to be flatter. Flat faces, and
convex in concave ones, have no bound: at a first touch of faces of width w the force of the common area grows as overlap^(1/3)."""

SAMPLES = 9
"""Points of a piece at which curvature and arms are measured."""


def critical_time_step(scene: Scene, *, damping_form: DampingForm = "central") -> float:
    """Largest stable contact step of the central-difference scheme on the scene's present contacts [s].

    The limit of the linear scheme (see the module) with all contacts sticking, those within a gap of 1e-3 radii included, each with its
    own spring and its own dashpot ``2 beta sqrt(m_eff kn)``: exact but for the residual of the eigenvector, at most 1e-4, which errs to
    the safe side. A component of a velocity that is held has no inertia to count with: its inverse mass is 0. Every disk is further taken
    to touch each wall alone, and the two lightest each other, so that free flight has a limit as well.

    Contacts that form later stiffen the network, up to `packed_time_step`: stay well below. A sliding contact has no shear spring,
    which only lowers frequencies. Arms are the radii: exact for ``lever_arm="radius"``; with ``"overlap"``, and with ``"torque-overlap"``,
    whose matrix is not symmetric, they are too long by the relative overlap.

    Grains with outlines have the springs of their contacts at time 0, with the arms of the normal forces. A single contact is bounded by
    the largest arms that the outline allows, normal and shear spring together. The law of the common area is stiffer than ``kn`` where
    outlines are flatter than the disk of the same area (`stiffening`).

    Parameters
    ----------
    scene : Scene
    damping_form : {"central", "lagged"}

    Returns
    -------
    float
        ``inf`` for a scene in which nothing can touch.

    Raises
    ------
    InvalidSceneError
        If two centres coincide.
    """
    return _step(max(_network_rate(scene, damping_form), _single_contact_rate(scene, damping_form)))


def packed_time_step(scene: Scene, *, damping_form: DampingForm = "central") -> float:
    """Contact step that is stable for whatever contacts the disks can come to have [s]: a bound, not the limit.

    A disk of radius R has room for ``z = pi/asin(r/(R + r))`` neighbours of the smallest radius r. Every neighbour may be the heaviest
    body, and every wall may touch. Contacts all around a disk give its coordinates the stiffness ``z (kn + ks)/2`` and its spin
    ``z ks R^2``, over mass and inertia; with ``(p - q)^2 <= 2 p^2 + 2 q^2`` for the two ends of each contact the largest eigenvalue of
    the network is at most twice the largest sum of a disk, and likewise for the dashpots. Contacts of dented outlines, of which one pair
    can have several, count once.
    """
    return _step(_packed_rate(scene, damping_form))


def _step(rate: float) -> float:
    return 1.0 / rate if rate > 0.0 else float("inf")


def _rate(stiffness: FloatArray, damping: FloatArray) -> float:
    """Largest root s [1/s] of ``s^2 = s C' + K/4`` for numbers K [1/s^2] and C' [1/s]."""
    with np.errstate(over="ignore"):  # an infinite one leaves no step
        half = 0.5 * damping
        return float(np.max(half + np.sqrt(half * half + 0.25 * stiffness), initial=0.0))


def _shares(scene: Scene, form: DampingForm) -> tuple[float, float]:
    """C' over C, and what global damping adds to C' [1/s]."""
    return (0.5, 0.5 * scene.xi) if form == "lagged" else (1.0, 0.0)


def _inverse_masses(scene: Scene) -> tuple[FloatArray, FloatArray]:
    """Inverse masses [1/kg] and moments of inertia [1/(kg m^2)], shape (n,); 0 where the motion is prescribed."""
    disks = scene.disks
    return np.where(disks.held.all(axis=1), 0.0, 1.0 / disks.mass), np.where(disks.rotating, 1.0 / disks.inertia, 0.0)


def _dashpots(law: ContactLaw, inverse_m_eff: FloatArray) -> FloatArray:
    """Coefficients ``2 beta sqrt(m_eff kn)`` [N s/m] of contacts with these ``1/m_eff`` [1/kg]; 0 where nothing moves."""
    return 2.0 * law.beta * np.sqrt(law.kn / np.where(inverse_m_eff > 0.0, inverse_m_eff, np.inf))


def _largest(values: FloatArray, count: int) -> float:
    return float(np.sort(values)[::-1][:count].sum())


def _single_contact_rate(scene: Scene, form: DampingForm) -> float:
    """1/dt [1/s] of the limit of the worst contact on its own, or of global damping alone."""
    inverse, turn = _inverse_masses(scene)
    share, drag = _shares(scene, form)
    aside = normal_arms(scene)
    worst = drag
    for law, count in [(scene.disk_disk, 2)] * (len(inverse) > 1) + [(wall.law, 1) for wall in scene.walls]:
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # an infinite one leaves no step
            normal = law.kn * stiffening(scene, law) * (inverse + aside**2 * turn)
            shear = law.shear_stiffness * (inverse + scene.disks.radius**2 * turn)
            # c/m_eff is largest for the lightest; with arms, m_eff <= m_i of either body.
            damping = 2.0 * law.beta * np.sqrt(law.kn * _largest(inverse, count))
            leaning = np.where(aside > 0.0, 2.0 * law.beta * np.sqrt(law.kn / inverse) * aside**2 * turn, 0.0)
            damping = share * (damping + _largest(leaning, count)) + drag
        # On a disk the two springs move different coordinates; an arm of the normal force couples them.
        both = np.where(aside > 0.0, normal + shear, 0.0)
        stiffness = np.array([_largest(normal, count), _largest(shear, count), _largest(both, count)])
        worst = max(worst, _rate(stiffness, np.array([damping, drag, damping])))
    return worst


def _packed_rate(scene: Scene, form: DampingForm) -> float:
    """1/dt [1/s] of a step that is stable for every arrangement; see `packed_time_step`."""
    inverse, turn = _inverse_masses(scene)
    share, drag = _shares(scene, form)
    n, radius, aside = len(inverse), scene.disks.radius, normal_arms(scene)
    if n == 0:
        return drag
    smallest = float(radius.min())
    # Six equal disks fit around one exactly, which round-off must not make five.
    room = np.floor(np.pi / np.arcsin(smallest / (radius + smallest)) * (1.0 + 1e-9))
    stiffness, damping = np.zeros(n), np.zeros(n)
    heaviest = float(inverse.min())
    most = (
        room if scene.cell is not None else np.minimum(room, n - 1.0)
    )  # in a cell all neighbours may be images of one disk
    for law, count, other in [(scene.disk_disk, most, heaviest)] + [
        (wall.law, np.ones(n), 0.0) for wall in scene.walls
    ]:
        kn, ks = law.kn * stiffening(scene, law), law.shear_stiffness
        # Of contacts at angles that keep their distance the sum of cos^2 along any line is at most half their room and one more.
        along = np.minimum(count, 0.5 * room + 1.0)
        across = count * min(kn, ks) + along * abs(kn - ks)
        with np.errstate(over="ignore"):
            stiffness += across * inverse + count * (ks * radius**2 + kn * aside**2) * turn
            c = _dashpots(law, inverse + other)
            damping += c * (along * inverse + count * aside**2 * turn)
    return _rate(2.0 * stiffness, 2.0 * share * damping + drag)


def _network_rate(scene: Scene, form: DampingForm) -> float:
    """1/dt [1/s] of the limit of the present contacts, plus the norm of the residual."""
    if len(scene.disks) == 0:
        return 0.0
    springs, bodies = contact_network(scene, NEAR * float(scene.disks.radius.min()))
    if len(bodies) == 0:
        return 0.0
    inverse, turn = _inverse_masses(scene)
    share, drag = _shares(scene, form)
    root = np.empty((len(inverse), 3))
    root[:, :2] = np.where(scene.disks.held, 0.0, 1.0 / np.sqrt(scene.disks.mass)[:, None])
    root[:, 2] = np.sqrt(turn)
    springs[:, 2:4] = 0.5 * np.sqrt(springs[:, 2:4])
    first, second = bodies.T
    inverse_m_eff = inverse[first] + np.where(second >= 0, inverse[second], 0.0)
    springs[:, 8] *= share * np.sqrt(1.0 / np.where(inverse_m_eff > 0.0, inverse_m_eff, np.inf))
    # A fixed irregular start vector: the result is the same on every call, and no mode is orthogonal to it by symmetry.
    size = root.size + springs.shape[0] * 2
    vector = np.cos(np.arange(1.0, size + 1.0) ** 2)
    vector[: root.size] *= root.ravel() > 0.0
    before, work = np.zeros(size), np.empty(size)
    diagonal, beside = np.zeros(MOST), np.zeros(MOST)
    value, residual, done = 0.0, 0.0, 0
    norm = float(np.linalg.norm(vector))
    if norm == 0.0:
        return 0.0
    vector /= norm
    while done < MOST:
        grown = lanczos(springs, bodies, root, drag, vector, before, work, diagonal, beside, done, done + BATCH)
        matrix = np.diag(diagonal[:grown]) + np.diag(beside[: grown - 1], 1) + np.diag(beside[: grown - 1], -1)
        values, vectors = np.linalg.eigh(matrix)
        value, residual = float(values[-1]), float(beside[grown - 1] * abs(vectors[-1, -1]))
        if residual <= TOLERANCE * value or grown < done + BATCH:
            break
        done = grown
    return value + residual


def contact_network(scene: Scene, reach: float) -> tuple[FloatArray, IntArray]:
    """Springs and bodies of all pairs with a gap up to ``reach`` [m] at time 0.

    Returns
    -------
    springs : ndarray, shape (c, 9)
        As `critical_kernels.lanczos` reads them, but with kn, ks [N/m] in the place of half their roots, and ``2 beta sqrt(kn)`` in that
        of the dashpot.
    bodies : ndarray of int64, shape (c, 2)
    """
    if needs_outlines(scene):
        return grain_network(scene, reach)
    disks = scene.disks
    listed, normal, _ = _close_pairs(scene, reach)
    first, second = listed.T
    springs = [disk_springs(normal, scene.disk_disk, 1.0, disks.radius[first], disks.radius[second])]
    bodies = [listed]
    for wall, pose in zip(scene.walls, wall_poses(compile_motion(scene.walls), 0.0), strict=True):
        height = (disks.x - pose[POINT_X:NORMAL_X]) @ pose[NORMAL_X:PIVOT_X]
        near = np.flatnonzero(height - disks.radius <= reach)
        springs.append(_wall_springs(pose, wall.law, 1.0, disks.radius[near]))
        bodies.append(np.column_stack([near, np.full(len(near), -1)]))
    return np.vstack(springs), np.vstack(bodies).astype(np.int64)


def _close_pairs(scene: Scene, reach: float) -> tuple[IntArray, FloatArray, FloatArray]:
    """Pairs of bodies whose circles have a gap up to ``reach`` [m], their normals and gaps [m].

    Raises
    ------
    InvalidSceneError
        If two centres coincide.
    """
    x, radius = scene.disks.x, scene.disks.radius
    if scene.cell is not None:
        listed, d = close_images(scene, scene.cell, reach)
    else:
        listed = PairFinder(radius, 0).within(x, np.empty((0, POSE)), reach)
        d = x[listed[:, 1]] - x[listed[:, 0]]
    distance = np.hypot(d[:, 0], d[:, 1])
    if len(distance) and distance.min() == 0.0:
        i, j = listed[np.argmin(distance)]
        raise InvalidSceneError(
            f"the centres of disks {i} and {j} coincide at ({x[i, 0]:g}, {x[i, 1]:g}): their contact has no normal; move one"
        )
    return listed, d / distance[:, None], distance - radius[listed[:, 0]] - radius[listed[:, 1]]


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
    """Springs and bodies of all contacts at time 0, in the form of `contact_network`.

    Bodies whose enclosing circles have a gap within ``reach`` [m] of 0, and no contact, count as touching disks.

    Raises
    ------
    InvalidSceneError
        If bodies penetrate each other so far that no chord defines their contact, or two centres coincide.
    """
    disks, outlines = scene.disks, outline_arrays(scene)
    grains = NurbsGrains.of_table(outlines.table, outlines.shape)
    listed, normal, gap = _close_pairs(scene, reach)
    alone = outlines.round[listed].all(axis=1)
    pair, rows = grains.pair_contacts(disks.x, disks.angle, listed[~alone])
    touching = np.flatnonzero(~alone)[pair]
    as_disks = alone | ((np.abs(gap) <= reach) & ~np.isin(np.arange(len(listed)), touching))
    law, factor = scene.disk_disk, stiffening(scene, scene.disk_disk)
    springs = [
        _springs(rows, law, factor, disks.x[listed[touching, 0]], disks.x[listed[touching, 1]]),
        disk_springs(normal[as_disks], law, factor, *disks.radius[listed[as_disks]].T),
    ]
    bodies = [listed[touching], listed[as_disks]]
    for wall, pose in zip(scene.walls, wall_poses(compile_motion(scene.walls), 0.0), strict=True):
        grain, rows = grains.wall_contacts(disks.x, disks.angle, pose[POINT_X:NORMAL_X], pose[NORMAL_X:PIVOT_X])
        gap = (disks.x - pose[POINT_X:NORMAL_X]) @ pose[NORMAL_X:PIVOT_X] - disks.radius
        near = np.flatnonzero((np.abs(gap) <= reach) & ~np.isin(np.arange(len(disks)), grain))
        factor = stiffening(scene, wall.law)
        springs.append(_springs(rows, wall.law, factor, disks.x[grain], None))
        springs.append(_wall_springs(pose, wall.law, factor, disks.radius[near]))
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
    """Springs of disks of radii ``first`` and ``second`` [m], 0 for a wall; columns of `contact_network`."""
    zeros = np.zeros(len(n))
    return _rows(n, law, factor, [first, second, zeros, zeros])


def _wall_springs(pose: FloatArray, law: ContactLaw, factor: float, radius: FloatArray) -> FloatArray:
    """Springs of disks of these radii [m] at a wall."""
    normal = np.tile(-pose[NORMAL_X:PIVOT_X], (len(radius), 1))
    return disk_springs(normal, law, factor, radius, np.zeros(len(radius)))


def _rows(n: FloatArray, law: ContactLaw, factor: float, arms: list[FloatArray]) -> FloatArray:
    ones = np.ones(len(n))
    dashpot = 2.0 * law.beta * np.sqrt(law.kn)
    return np.column_stack([n, factor * law.kn * ones, law.shear_stiffness * ones, *arms, dashpot * ones])
