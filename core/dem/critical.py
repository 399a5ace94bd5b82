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

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray, IntArray
from ninedisk.core.dem.neighbours import PairFinder
from ninedisk.core.dem.plane.critical_kernels import Network, lanczos
from ninedisk.core.dem.plane.grains import equal_radii, needs_outlines, outline_arrays
from ninedisk.core.dem.plane.images import close_images
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.numerics import DampingForm
from ninedisk.core.nurbs.curve import NurbsCurve
from ninedisk.core.nurbs.intersect import NurbsGrains
from ninedisk.core.nurbs.mass import farthest
from ninedisk.core.nurbs.state import ContactRows
from ninedisk.core.nurbs.table import outline_points
from ninedisk.core.pose import NORMAL_X, PIVOT_X, POINT_X, POSE
from ninedisk.core.scene import ContactLaw, Scene
from ninedisk.core.scene.motion import compile_motion, wall_poses

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

    Contacts that form later stiffen the network, up to `packed_time_step`: stay well below. A run with a step above that looks at its
    contacts whenever it renews its lists and at each sample, and ends with an error where they do not bear the step.

    A sliding contact has no shear spring, which only lowers frequencies. Cohesion lowers the stiffness to ``kn - cohesion``. A rolling
    spring and its dashpot count in full though they have a limit; the torque of viscous rolling resistance, which grows with the load,
    does not count. Of two unequal disks that touch alone the step with a rolling spring is a bound. Arms are the radii: exact for
    ``lever_arm="radius"``; with ``"overlap"``, and with ``"torque-overlap"``, whose matrix is not symmetric, they are too long by the
    relative overlap.

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
        If two centres coincide, or a law is Hertz', whose stiffness depends on the motion.
    """
    if any(law.hertz for law in scene.laws_in_use):
        raise InvalidSceneError("critical_time_step is of linear laws: for Hertz' law take critical_dt of a DemSession")
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


class Place(NamedTuple):
    """Where the bodies of a scene are at time t [s].

    Attributes
    ----------
    x, angle : ndarray, shape (n, 2), (n,)
        Centres [m] and angles [rad].
    walls : ndarray, shape (m, 11)
        Walls as `place_walls` fills them.
    t : float
    """

    x: FloatArray
    angle: FloatArray
    walls: FloatArray
    t: float


def start_of(scene: Scene) -> Place:
    """Where bodies are at time 0."""
    return Place(scene.disks.x, scene.disks.angle, wall_poses(compile_motion(scene.walls), 0.0), 0.0)


class _Kind(NamedTuple):
    """Contacts of one law: disks that can be the first body, and the second one; None where that is a wall."""

    law: ContactLaw
    first: NDArray[np.bool_]
    second: NDArray[np.bool_] | None


def _kinds(scene: Scene) -> list[_Kind]:
    """All laws that a pair of the scene can have, each with the disks that can have it."""
    disks, n = scene.disks, len(scene.disks)
    names = np.array(disks.material)
    masks = [names == name for name in np.unique(names)] if scene.laws else [np.ones(n, dtype=bool)] * bool(n)
    found = []
    for k, mask in enumerate(masks):
        for other in masks[k:]:
            i, j = int(np.argmax(mask)), n - 1 - int(np.argmax(other[::-1]))
            if i != j or scene.cell is not None:
                found.append(_Kind(scene.law_between(min(i, j), max(i, j)), mask, other))
        for w in range(len(scene.walls)):
            found.append(_Kind(scene.law((int(np.argmax(mask)), n + w)), mask, None))
    return found


def _largest(values: FloatArray, kind: _Kind) -> float:
    """Largest sum of the values of the disks of a contact."""
    if kind.second is None:
        return float(values[kind.first].max())
    if (kind.first == kind.second).all():
        return float(np.sort(values[kind.first])[::-1][:2].sum())
    return float(values[kind.first].max() + values[kind.second].max())


def _meets_itself(scene: Scene) -> bool:
    """Whether a disk can touch its own image at some time: the cell is, or becomes, narrower than a diameter."""
    cell = scene.cell
    if cell is None:
        return False
    return min(cell.size) < 2.0 * float(scene.disks.radius.max()) or min(cell.rate[0][0], cell.rate[1][1]) < 0.0


def _inverse_moments(scene: Scene) -> FloatArray:
    """``1/(I + m R^2)`` [1/(kg m^2)] of each disk about a contact, shape (n,)."""
    inverse, turn = _inverse_masses(scene)
    about = inverse + scene.disks.radius**2 * turn
    return inverse * turn / np.where(about > 0.0, about, np.inf)


def _shear_and_rolling(scene: Scene, kind: _Kind, kr: float, shear: FloatArray) -> float:
    """Largest eigenvalue [1/s^2] of shear and rolling spring of the worst contact, of unequal disks a bound; ``shear`` is each disk's part.

    In coordinates over the roots of the masses the two springs are vectors, of which this is the eigenvalue of the products.
    """
    turn, ks = _inverse_masses(scene)[1], kind.law.shear_stiffness
    rolling, both = kr * turn, np.sqrt(ks * kr) * scene.disks.radius * turn
    parts = [values[kind.first] for values in (shear, rolling, both)]
    if kind.second is not None:
        spread = np.ptp(both[kind.first | kind.second])
        parts = [np.array([part]) for part in (_largest(shear, kind), _largest(rolling, kind), spread)]
    a, b, c = parts
    return float(np.max(0.5 * (a + b) + np.sqrt(0.25 * (a - b) ** 2 + c**2)))


def _single_contact_rate(scene: Scene, form: DampingForm) -> float:
    """1/dt [1/s] of the limit of the worst contact on its own, or of global damping alone."""
    inverse, turn = _inverse_masses(scene)
    share, drag = _shares(scene, form)
    aside, about = normal_arms(scene), _inverse_moments(scene)
    worst = drag
    for kind in _kinds(scene):
        law = kind.law
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # an infinite one leaves no step
            normal = (law.kn - law.cohesion) * stiffening(scene, law) * (inverse + aside**2 * turn)
            shear = law.shear_stiffness * (inverse + scene.disks.radius**2 * turn)
            # c/m_eff is largest for the lightest; with arms, m_eff <= m_i of either body.
            damping = 2.0 * law.beta * np.sqrt(law.kn * _largest(inverse, kind))
            leaning = np.where(aside > 0.0, 2.0 * law.beta * np.sqrt(law.kn / inverse) * aside**2 * turn, 0.0)
            damping = share * (damping + _largest(leaning, kind)) + drag
        # On a disk the two springs move different coordinates; an arm of the normal force couples them.
        both = np.where(aside > 0.0, normal + shear, 0.0)
        stiffness = np.array([_largest(normal, kind), _largest(shear, kind), _largest(both, kind)])
        worst = max(worst, _rate(stiffness, np.array([damping, drag, damping])))
        if kind.second is not None and _meets_itself(scene):
            # Of a disk and its own image both ends turn alike, and none of them moves.
            alike = 4.0 * law.shear_stiffness * scene.disks.radius**2 * turn
            worst = max(worst, _rate(alike[kind.first & kind.second], np.array([drag])))
        if law.rolling is not None and law.rolling.kr > 0.0:
            # The dashpot's c (1/I_i + 1/I_j), c being of the moments about the contact, is exact for equal disks.
            more = np.max(np.where(about > 0.0, turn / np.where(about > 0.0, about, 1.0), 0.0))
            rolling = 2.0 * law.rolling.beta * np.sqrt(law.rolling.kr * _largest(about, kind)) * more
            springs = _shear_and_rolling(scene, kind, law.rolling.kr, shear)
            worst = max(worst, _rate(np.array([springs]), np.array([share * rolling + drag])))
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
    about = _inverse_moments(scene)
    walls = len(scene.walls)
    most = (
        room if scene.cell is not None else np.minimum(room, n - 1.0)
    )  # in a cell all neighbours may be images of one disk
    # Neighbours may all have the law that is worst for a disk.
    between, at_walls = np.zeros((2, n)), np.zeros((walls, 2, n))
    of_wall = 0
    for kind in _kinds(scene):
        law = kind.law
        count = np.ones(n) if kind.second is None else most
        concerned = kind.first if kind.second is None else kind.first | kind.second
        others, lightest = (0.0, 0.0) if kind.second is None else (float(inverse.min()), float(about.min()))
        kn, ks = (law.kn - law.cohesion) * stiffening(scene, law), law.shear_stiffness
        # Of contacts at angles that keep their distance the sum of cos^2 along any line is at most half their room and one more.
        along = np.minimum(count, 0.5 * room + 1.0)
        across = count * min(kn, ks) + along * abs(kn - ks)
        with np.errstate(over="ignore"):
            stiffness = across * inverse + count * (ks * radius**2 + kn * aside**2) * turn
            c = _dashpots(law, inverse + others)
            damping = c * (along * inverse + count * aside**2 * turn)
            if law.rolling is not None and law.rolling.kr > 0.0:
                stiffness += count * law.rolling.kr * turn
                inverse_moment = np.where(about + lightest > 0.0, about + lightest, np.inf)
                damping += count * 2.0 * law.rolling.beta * np.sqrt(law.rolling.kr / inverse_moment) * turn
        found = np.where(concerned, [stiffness, damping], 0.0)
        if kind.second is None:
            at_walls[of_wall % walls] += found
            of_wall += 1
        else:
            between = np.maximum(between, found)
    stiffness, damping = sum(at_walls, start=between)
    return _rate(2.0 * stiffness, 2.0 * share * damping + drag)


def present_time_step(scene: Scene, place: Place, damping_form: DampingForm) -> tuple[float, int]:
    """Critical step [s] of the contacts that bodies have at this place, as `critical_time_step` counts them; and the disk whose contacts
    are stiffest for its mass."""
    springs, bodies = contact_network(scene, NEAR * float(scene.disks.radius.min()), place)
    stiff = np.maximum(springs[:, 2], springs[:, 3])
    first, second = bodies.T
    sums = np.bincount(first, stiff, len(scene.disks))
    sums += np.bincount(second[second >= 0], stiff[second >= 0], len(scene.disks))
    return _step(_network_rate(scene, damping_form, place)), int(np.argmax(sums * _inverse_masses(scene)[0]))


def _network_rate(scene: Scene, form: DampingForm, place: Place | None = None) -> float:
    """1/dt [1/s] of the limit of the contacts at a place, at time 0 if None, plus the norm of the residual."""
    if len(scene.disks) == 0:
        return 0.0
    springs, bodies = contact_network(scene, NEAR * float(scene.disks.radius.min()), place)
    if len(bodies) == 0:
        return 0.0
    inverse, turn = _inverse_masses(scene)
    share, drag = _shares(scene, form)
    root = np.empty((len(inverse), 3))
    root[:, :2] = np.where(scene.disks.held, 0.0, 1.0 / np.sqrt(scene.disks.mass)[:, None])
    root[:, 2] = np.sqrt(turn)
    springs[:, 2:4] = 0.5 * np.sqrt(springs[:, 2:4])
    rolls, rolling = rolling_network(scene, NEAR * float(scene.disks.radius.min()), place)
    about = np.append(_inverse_moments(scene), 0.0)  # the last one represents a wall, body -1
    inverse_moment = about[rolling].sum(axis=1)
    rolls[:, 0] = 0.5 * np.sqrt(rolls[:, 0])
    rolls[:, 1] *= share * np.sqrt(1.0 / np.where(inverse_moment > 0.0, inverse_moment, np.inf))
    first, second = bodies.T
    inverse_m_eff = inverse[first] + np.where(second >= 0, inverse[second], 0.0)
    springs[:, 8] *= share * np.sqrt(1.0 / np.where(inverse_m_eff > 0.0, inverse_m_eff, np.inf))
    # A fixed irregular start vector: the result is the same on every call, and no mode is orthogonal to it by symmetry.
    size = root.size + springs.shape[0] * 2 + rolls.shape[0]
    vector = np.cos(np.arange(1.0, size + 1.0) ** 2)
    vector[: root.size] *= root.ravel() > 0.0
    before, work = np.zeros(size), np.empty(size)
    diagonal, beside = np.zeros(MOST), np.zeros(MOST)
    value, residual, done = 0.0, 0.0, 0
    norm = float(np.linalg.norm(vector))
    if norm == 0.0:
        return 0.0
    vector /= norm
    network = Network(springs, bodies, rolls, rolling, root, drag)
    while done < MOST:
        grown = lanczos(network, vector, before, work, diagonal, beside, done, done + BATCH)
        matrix = np.diag(diagonal[:grown]) + np.diag(beside[: grown - 1], 1) + np.diag(beside[: grown - 1], -1)
        values, vectors = np.linalg.eigh(matrix)
        value, residual = float(values[-1]), float(beside[grown - 1] * abs(vectors[-1, -1]))
        if residual <= TOLERANCE * value or grown < done + BATCH:
            break
        done = grown
    return value + residual


def contact_network(scene: Scene, reach: float, place: Place | None = None) -> tuple[FloatArray, IntArray]:
    """Springs and bodies of all pairs with a gap up to ``reach`` [m] at a place, at time 0 if None.

    Returns
    -------
    springs : ndarray, shape (c, 9)
        As `critical_kernels.Network` has them, but with kn, ks [N/m] in the place of half their roots, and ``2 beta sqrt(kn)`` in that
        of the dashpot.
    bodies : ndarray of int64, shape (c, 2)
    """
    if needs_outlines(scene):
        return grain_network(scene, reach, place or start_of(scene))
    pairs, normal = _touching(scene, reach, place or start_of(scene))
    n, (first, second) = len(scene.disks), pairs.T
    radius = np.append(scene.disks.radius, np.zeros(len(scene.walls)))
    springs = np.empty((len(pairs), 9))
    for law, rows in _by_law(scene, pairs):
        springs[rows] = disk_springs(normal[rows], law, 1.0, radius[first[rows]], radius[second[rows]])
    return springs, np.column_stack([first, np.where(second < n, second, -1)])


def rolling_network(scene: Scene, reach: float, place: Place | None = None) -> tuple[FloatArray, IntArray]:
    """Rolling springs of all pairs with a gap up to ``reach`` [m] at a place, at time 0 if None.

    Returns
    -------
    rolls : ndarray, shape (c, 2)
        As `critical_kernels.Network` has them, but with kr [N m/rad] in the place of half its root, and ``2 beta sqrt(kr)`` in that of
        the dashpot.
    bodies : ndarray of int64, shape (c, 2)
        The second one is -1 for a wall.
    """
    if not any(law.rolling is not None and law.rolling.kr > 0.0 for law in scene.laws_in_use):
        return np.empty((0, 2)), np.empty((0, 2), dtype=np.int64)
    pairs, _ = _touching(scene, reach, place or start_of(scene))
    rolls = np.zeros((len(pairs), 2))
    for law, rows in _by_law(scene, pairs):
        if law.rolling is not None:
            rolls[rows] = law.rolling.kr, 2.0 * law.rolling.beta * np.sqrt(law.rolling.kr)
    return rolls, np.where(pairs < len(scene.disks), pairs, -1)


def _touching(scene: Scene, reach: float, place: Place) -> tuple[IntArray, FloatArray]:
    """Pairs of bodies, by their numbers, with a gap up to ``reach`` [m], and their normals; of disks first."""
    disks, n = scene.disks, len(scene.disks)
    listed, normal, _ = _close_pairs(scene, reach, place)
    pairs, normals = [listed], [normal]
    for w, pose in enumerate(place.walls):
        height = (place.x - pose[POINT_X:NORMAL_X]) @ pose[NORMAL_X:PIVOT_X]
        near = np.flatnonzero(height - disks.radius <= reach)
        pairs.append(np.column_stack([near, np.full(len(near), n + w)]))
        normals.append(np.tile(-pose[NORMAL_X:PIVOT_X], (len(near), 1)))
    return np.vstack(pairs).astype(np.int64), np.vstack(normals)


def _by_law(scene: Scene, pairs: IntArray) -> list[tuple[ContactLaw, NDArray[np.bool_]]]:
    """Laws of some pairs of bodies, each with the pairs that have it."""
    n = len(scene.disks)
    _, material = np.unique([*scene.disks.material, *(wall.material for wall in scene.walls)], return_inverse=True)
    # Walls have their own law where there is none for the materials.
    kind = np.where(np.arange(scene.n_bodies) < n, material, scene.n_bodies + np.arange(scene.n_bodies))
    keys = kind[pairs].min(axis=1) * (3 * scene.n_bodies) + kind[pairs].max(axis=1)
    found = []
    for key in np.unique(keys):
        rows = keys == key
        i, j = pairs[np.argmax(rows)].tolist()
        found.append((scene.law_between(i, j), rows))
    return found


def _close_pairs(scene: Scene, reach: float, place: Place) -> tuple[IntArray, FloatArray, FloatArray]:
    """Pairs of bodies whose circles have a gap up to ``reach`` [m], their normals and gaps [m].

    Raises
    ------
    InvalidSceneError
        If two centres coincide.
    """
    x, radius = place.x, scene.disks.radius
    if scene.cell is not None:
        listed, d = close_images(scene, scene.cell, reach, x, place.t)
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


def grain_network(scene: Scene, reach: float, place: Place) -> tuple[FloatArray, IntArray]:
    """Springs and bodies of all contacts of bodies with outlines, in the form of `contact_network`.

    Bodies whose enclosing circles have a gap within ``reach`` [m] of 0, and no contact, count as touching disks.

    Raises
    ------
    InvalidSceneError
        If bodies penetrate each other so far that no chord defines their contact, or two centres coincide.
    """
    disks, outlines = scene.disks, outline_arrays(scene)
    grains = NurbsGrains.of_table(outlines.table, outlines.shape)
    listed, normal, gap = _close_pairs(scene, reach, place)
    alone = outlines.round[listed].all(axis=1)
    pair, rows = grains.pair_contacts(place.x, place.angle, listed[~alone])
    touching = np.flatnonzero(~alone)[pair]
    as_disks = alone | ((np.abs(gap) <= reach) & ~np.isin(np.arange(len(listed)), touching))
    law, factor = scene.disk_disk, stiffening(scene, scene.disk_disk)
    springs = [
        _springs(rows, law, factor, place.x[listed[touching, 0]], place.x[listed[touching, 1]]),
        disk_springs(normal[as_disks], law, factor, *disks.radius[listed[as_disks]].T),
    ]
    bodies = [listed[touching], listed[as_disks]]
    for wall, pose in zip(scene.walls, place.walls, strict=True):
        grain, rows = grains.wall_contacts(place.x, place.angle, pose[POINT_X:NORMAL_X], pose[NORMAL_X:PIVOT_X])
        gap = (place.x - pose[POINT_X:NORMAL_X]) @ pose[NORMAL_X:PIVOT_X] - disks.radius
        near = np.flatnonzero((np.abs(gap) <= reach) & ~np.isin(np.arange(len(disks)), grain))
        factor = stiffening(scene, wall.law)
        springs.append(_springs(rows, wall.law, factor, place.x[grain], None))
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
    return np.column_stack(
        [n, factor * (law.kn - law.cohesion) * ones, law.shear_stiffness * ones, *arms, dashpot * ones]
    )
