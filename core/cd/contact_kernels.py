"""Kernels of contact geometry and of the contacts' part in a step: one definition for single steps and for many at once.

The second half is about bodies with outlines, whose contacts have places along them.
"""

from __future__ import annotations

from math import hypot, inf, pi, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd.problem_kernels import contact_velocity
from ninedisk.core.compile import inline_kernel, kernel
from ninedisk.core.dem.plane.force_kernels import dashpot

Floats = NDArray[np.float64]

ROUND_OFF = 8.881784197001252e-16
"""Of the largest coordinate, four units in the last place: gaps are differences of a few of them."""


MISSED = 16.0
"""Multiple of a gap's rounding beyond which a contact outside the set is violated: that of the gap, of the displacements and of
those of earlier steps that a contact still carries."""

NEARBY = 1e-2
"""Gap over the smallest radius of the pairs that are looked at in any case: contact forces move disks that would rest without."""

GAIN_STEPS, GAIN_TOTAL, GAIN_LARGEST, GAIN_STEP, GAIN_I, GAIN_J = range(6)
"""Entries of ``gains``: steps in which impacts fed energy; that energy [J]; the largest of a step [J]; that step, and the bodies of the
contact that fed most in it."""

FRICTION, IMPACT, DASHPOT, DAMPING, SCHEME, FORCE_WORK, HELD_WORK, STORED = range(8)
"""Entries of ``losses`` [J]: what was lost since time 0 by channel; what forces on single disks and what holds disks did; and the
energy of the springs at the end of the last step."""

FED = 100.0
"""Multiple of a solver's tolerance that the energy fed has to exceed: figures are norms over all contacts, relative to the forces."""


class Laws(NamedTuple):
    """Columns of `ninedisk.core.cd.laws.LawTable`, shape (l,) each."""

    kn: Floats
    ks: Floats
    mu: Floats
    beta: Floats
    elastic: NDArray[np.bool_]
    restitution: Floats
    arm_overlap: Floats
    wall_mid: Floats
    slip_middle: NDArray[np.bool_]
    viscous_pull: NDArray[np.bool_]


class Bodies(NamedTuple):
    """Data of b disks, of which nothing but the load changes from step to step.

    Attributes
    ----------
    mass : ndarray, shape (b, 3)
        Mass [kg], mass [kg], moment of inertia [kg m^2].
    inverse : ndarray, shape (b,)
        Inverse of the mass that dashpots see [1/kg]: 0 where neither component of the velocity is free.
    free : ndarray of bool, shape (b, 3)
        False for unknowns whose motion is prescribed.
    load : ndarray, shape (b, 3)
        External force [N], force [N], torque [N m], means over the step at hand (`place_loads`).
    xi : float
        Global damping [1/s].
    """

    mass: Floats
    inverse: Floats
    free: NDArray[np.bool_]
    load: Floats
    xi: float


class Loads(NamedTuple):
    """External loads of b disks: ``steady`` (b, 3) beside k forces, each ``force`` (k, 3) on a ``disk`` (k,) from ``begin`` to ``end``
    (k,), in [N], [N], [N m] and [s].
    """

    steady: Floats
    disk: NDArray[np.int64]
    force: Floats
    begin: Floats
    end: Floats


class Start(NamedTuple):
    """What a dynamic step of b disks starts with; all of shape (b, 3).

    Attributes
    ----------
    force : ndarray
        Right-hand side of the momentum balance [N], [N], [N m]; 0 for unknowns that are not free.
    kept, prescribed : ndarray
        Velocities of the unknowns that are free and of those that are not, 0 elsewhere [m/s], [m/s], [rad/s].
    """

    force: Floats
    kept: Floats
    prescribed: Floats


class Frames(NamedTuple):
    """Contacts of c pairs: disks where they are at the start of the step, walls where they are at its end.

    A wall's end pose makes its gap exact: with the disk's displacement ``dx``, the gap after the step is
    ``gap + n_wall . dx`` whatever the wall did meanwhile. Between disks it is linear in ``dx`` and never above the true gap.

    Attributes
    ----------
    pairs : ndarray of int64, shape (c, 2)
        Body numbers, disks first.
    bodies : ndarray of int32, shape (c, 2)
        Bodies of the contact problem: a wall is a prescribed one, -1.
    row : ndarray of int64, shape (c,)
        Row of the law table.
    normal : ndarray, shape (c, 2)
        Unit normal from body i to body j.
    gap : ndarray, shape (c,)
        Gap [m] if no disk moved.
    gap_before : ndarray, shape (c,)
        Gap at the start of the step [m]: walls at the start, too.
    shift : ndarray, shape (c,)
        Tangential displacement of i's surface against j's [m] if no disk moved: minus that of the wall.
    arms : ndarray, shape (c, 4)
        Rotation columns ``(a_ni, a_nj, a_ti, a_tj)`` of the Jacobian [m].
    place : ndarray, shape (c, 2)
        Where on both outlines the contact is (span + u + 1/2); 0 on disks and walls.
    """

    pairs: NDArray[np.int64]
    bodies: NDArray[np.int32]
    row: NDArray[np.int64]
    normal: Floats
    gap: Floats
    gap_before: Floats
    shift: Floats
    arms: Floats
    place: Floats

    @property
    def size(self) -> int:
        """Number of contacts, c."""
        return len(self.pairs)

    def pick(self, which: NDArray[np.bool_] | NDArray[np.int64]) -> Frames:
        """The contacts chosen by a mask, shape (c,), or by their numbers."""
        columns: list[Any] = [column[which] for column in self]
        return Frames(*columns)


@kernel
def measure_frames(x: Floats, radius: Floats, before: Floats, after: Floats, laws: Laws, frames: Frames) -> int:
    """Fill the frames of pairs of disks at ``x``, shape (n, 2 or 3), and walls, shape (m, 11), at both ends of the step.

    Returns
    -------
    int
        A pair whose centres coincide, which has no normal; -1: none.
    """
    n, same = x.shape[0], -1
    pairs, row, normal, arms = frames.pairs, frames.row, frames.normal, frames.arms
    gap, gap_before, shift = frames.gap, frames.gap_before, frames.shift
    for k in range(pairs.shape[0]):
        i, j = pairs[k, 0], pairs[k, 1]
        if j < n:
            ax, ay = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1]
            distance = sqrt(ax * ax + ay * ay)
            if distance == 0.0:
                same, distance = k, 1.0
            normal[k, 0], normal[k, 1] = ax / distance, ay / distance
            gap[k] = gap_before[k] = distance - (radius[i] + radius[j])
            shift[k] = 0.0
        else:
            w = j - n
            nx, ny = after[w, 2], after[w, 3]
            height = (x[i, 0] - after[w, 0]) * nx + (x[i, 1] - after[w, 1]) * ny
            normal[k, 0], normal[k, 1] = -nx, -ny
            gap[k] = height - radius[i]
            gap_before[k] = (
                (x[i, 0] - before[w, 0]) * before[w, 2] + (x[i, 1] - before[w, 1]) * before[w, 3] - radius[i]
            )
            deep = height + laws.wall_mid[row[k]] * 0.5 * max(0.0, -gap[k])
            mx, my = material_shift(x[i, 0] - deep * nx, x[i, 1] - deep * ny, w, before, after)
            # t = (-n_y, n_x) of the contact's normal n = -inward.
            shift[k] = -(mx * ny - my * nx)
        shorter = 0.5 * laws.arm_overlap[row[k]] * max(0.0, -gap_before[k])
        arms[k, 0] = arms[k, 1] = 0.0
        arms[k, 2] = radius[i] - shorter
        arms[k, 3] = radius[j] - shorter if j < n else 0.0
    return same


@inline_kernel
def material_shift(px: float, py: float, w: int, before: Floats, after: Floats) -> tuple[float, float]:
    """Displacement over the step [m] of the material of wall ``w`` that is at the point p at its end."""
    ax, ay = px - after[w, 0], py - after[w, 1]
    bx, by = ax, ay
    # A wall that does not turn keeps its normal to the last bit: no round-off of a rotation by nothing.
    if before[w, 2] != after[w, 2] or before[w, 3] != after[w, 3]:
        cos = before[w, 2] * after[w, 2] + before[w, 3] * after[w, 3]
        sin = after[w, 2] * before[w, 3] - after[w, 3] * before[w, 2]
        bx, by = cos * ax - sin * ay, cos * ay + sin * ax
    return after[w, 0] - before[w, 0] + ax - bx, after[w, 1] - before[w, 1] + ay - by


@kernel
def wall_displacement(x: Floats, before: Floats, after: Floats) -> float:
    """Bound on the displacement of a wall's surface near the disks between two poses [m]."""
    turns = False
    for w in range(after.shape[0]):
        turns |= before[w, 2] != after[w, 2] or before[w, 3] != after[w, 3]
    left, right, low, high = inf, -inf, inf, -inf
    if turns:
        for i in range(x.shape[0]):
            left, right = min(left, x[i, 0]), max(right, x[i, 0])
            low, high = min(low, x[i, 1]), max(high, x[i, 1])
    largest = 0.0
    for w in range(after.shape[0]):
        moved = hypot(after[w, 0] - before[w, 0], after[w, 1] - before[w, 1])
        turned = hypot(after[w, 2] - before[w, 2], after[w, 3] - before[w, 3])
        if turned > 0.0:
            # No disk is farther from the wall's point than the far corner of the box around all of them.
            px, py = after[w, 0], after[w, 1]
            far = hypot(max(right - px, px - left), max(high - py, py - low))
            # The chord of the normal's turn times pi/2 bounds the angle.
            moved += 0.5 * pi * turned * far
        largest = max(largest, moved)
    return largest


@kernel
def gap_round_off(x: Floats, radius: Floats, after: Floats) -> float:
    """Error of a gap [m] that the rounding of coordinates explains."""
    largest = 0.0
    for i in range(x.shape[0]):
        largest = max(largest, abs(x[i, 0]), abs(x[i, 1]), radius[i])
    for w in range(after.shape[0]):
        largest = max(largest, abs(after[w, 0]), abs(after[w, 1]))
    return ROUND_OFF * largest


@kernel
def surface_displacement(dx: Floats, radius: Floats) -> float:
    """Largest displacement of a point of a disk's outline [m], under displacements of shape (n, 3)."""
    largest = 0.0
    for i in range(dx.shape[0]):
        largest = max(largest, hypot(dx[i, 0], dx[i, 1]) + radius[i] * abs(dx[i, 2]))
    return largest


@kernel
def closing_gaps(frames: Frames, dilation: Floats, dx: Floats, out: Floats) -> None:
    """Gap after the displacements ``dx``, shape (n, 3), less ``dilation`` (of a law row) times the slip [m], shape (c,)."""
    bodies, row, normal, arms = frames.bodies, frames.row, frames.normal, frames.arms
    gap, shift = frames.gap, frames.shift
    for k in range(bodies.shape[0]):
        un, ut = contact_velocity(k, bodies, normal, arms, dx)
        out[k] = gap[k] + un - dilation[row[k]] * abs(shift[k] + ut)


@kernel
def contact_compliances(row: NDArray[np.int64], laws: Laws, scale: float, out: Floats) -> None:
    """``(1/kn, 1/ks)/scale``, shape (c, 2); 0 where the contact is rigid or carries no shear force."""
    for k in range(row.shape[0]):
        out[k, 0] = out[k, 1] = 0.0
        if laws.elastic[row[k]]:
            out[k, 0] = 1.0 / laws.kn[row[k]] / scale
            if laws.ks[row[k]] > 0.0:
                out[k, 1] = 1.0 / laws.ks[row[k]] / scale


@inline_kernel
def damping_of_step(k: int, frames: Frames, laws: Laws, inverse: Floats, dt: float) -> float:
    """Stiffness ``c/dt`` [N/m] that the dashpot of contact ``k`` adds in a step of length ``dt``; ``inverse`` as in `Bodies`."""
    law, i, j = frames.row[k], frames.bodies[k, 0], frames.bodies[k, 1]
    other = inverse[j] if j >= 0 else 0.0
    return dashpot(laws.kn[law], laws.beta[law], inverse[i] + other) / dt


@kernel
def place_loads(loads: Loads, begin: float, end: float, static: bool, load: Floats) -> None:
    """Fill ``load``, shape (b, 3), with the mean loads of the step from ``begin`` to ``end`` [s], or for ``static`` with those of its end.

    The mean makes the impulse exact wherever in the step a force begins or ends. A load that begins or ends with a step, but for the
    rounding of times, does so there: the static step up to the end of a load still has it.
    """
    instant = end - 1e-6 * (end - begin)
    for k in range(loads.disk.shape[0]):
        i = loads.disk[k]
        for d in range(3):
            load[i, d] = loads.steady[i, d]
    for k in range(loads.disk.shape[0]):
        share = max(0.0, min(end, loads.end[k]) - max(begin, loads.begin[k])) / (end - begin)
        if static:
            share = 1.0 if loads.begin[k] < instant < loads.end[k] else 0.0
        for d in range(3):
            load[loads.disk[k], d] += share * loads.force[k, d]


@kernel
def start_step(bodies: Bodies, v: Floats, dt: float, theta: float, start: Start) -> None:
    """Fill ``start`` from the velocities ``v``, shape (b, 3), at the start of the step."""
    rate = 1.0 / dt - (1.0 - theta) * bodies.xi
    for i in range(v.shape[0]):
        for d in range(3):
            if bodies.free[i, d]:
                start.force[i, d] = bodies.load[i, d] + bodies.mass[i, d] * v[i, d] * rate
                start.kept[i, d], start.prescribed[i, d] = v[i, d], 0.0
            else:
                start.force[i, d] = start.kept[i, d] = 0.0
                start.prescribed[i, d] = v[i, d]


@kernel
def step_displacements(bodies: Bodies, start: Start, v: Floats, dt: float, theta: float, dx: Floats) -> None:
    """``dx``, shape (b, 3) [m], [m], [rad], of the velocities ``v`` at the end of the step."""
    for i in range(v.shape[0]):
        for d in range(3):
            rate = start.prescribed[i, d]
            if bodies.free[i, d]:
                rate = theta * v[i, d] + (1.0 - theta) * start.kept[i, d]
            dx[i, d] = dt * rate


@inline_kernel
def newton_offset(e: float, before: float) -> float:
    """What the opening velocity at the end of a step is increased by under Newton's law, ``before`` the one at its start [m/s].

    The condition ``0 <= P`` complementary to ``u_n + newton_offset >= 0`` lets a contact that closes rebound with e, and one
    that opens be pushed back with the speed that it had, no more and no less: then ``u_n + before`` is ``(1 - e) min(0, before)``
    wherever ``P > 0``, and no contact feeds energy (see `ninedisk.core.cd.step.DynamicStep`).
    """
    return e * before if before < 0.0 else before


@kernel
def dynamic_terms(
    frames: Frames,
    laws: Laws,
    inverse: Floats,
    start: Start,
    dt: float,
    theta: float,
    round_off: float,
    offset: Floats,
    compliance: Floats,
) -> None:
    """Offsets ``g`` and compliances of the problem of `ninedisk.core.cd.step.DynamicStep`, shape (c, 2) each.

    A gap of rigid bodies within `MISSED` times the rounding of gaps is none: bodies at rest have more contacts than freedom, gaps that
    are round-off contradict each other, and divided by a small step they would be velocities that no force at rest allows.

    A dashpot ``c`` acts in parallel with the spring by the mean rate of the step: with the overlaps ``d_0`` and ``d_1`` at its ends
    ``p = kn d_1 + c (d_1 - d_0)/dt``, which is a spring of stiffness ``kn + c/dt`` whose overlap is less by ``d_0 (c/dt)/(kn + c/dt)``;
    ``inverse`` are the inverse masses of `Bodies`. It never pulls: ``p >= 0`` is a condition of the problem, so that bodies part
    where spring and dashpot cancel, before the overlap is gone, as in the DEM. Beside cohesion it may pull: then ``p + c d_0/dt``, which
    is ``(kn + c/dt) d_1``, is the problem's force, and what is added to p a load (`pulls_of_step`).

    Under Newton's law (restitution not NaN) walls count by their displacement over the step,
    held disks by their speed.
    """
    contact_compliances(frames.row, laws, theta * dt, compliance)
    bodies, row, normal, arms = frames.bodies, frames.row, frames.normal, frames.arms
    gap, gap_before, shift = frames.gap, frames.gap_before, frames.shift
    for k in range(bodies.shape[0]):
        held_n, held_t = contact_velocity(k, bodies, normal, arms, start.prescribed)
        kept_n, kept_t = contact_velocity(k, bodies, normal, arms, start.kept)
        e = laws.restitution[row[k]]
        if np.isnan(e):
            touching = not laws.elastic[row[k]] and abs(gap[k]) <= MISSED * round_off
            room = 0.0 if touching else gap[k]
            if laws.beta[row[k]] > 0.0 and laws.elastic[row[k]]:
                viscous = damping_of_step(k, frames, laws, inverse, dt)
                stiff = laws.kn[row[k]] + viscous
                compliance[k, 0] = 1.0 / stiff / (theta * dt)
                if not laws.viscous_pull[row[k]]:
                    room -= viscous / stiff * min(0.0, gap_before[k])
            offset[k, 0] = room / (theta * dt) + (held_n / theta + (1.0 - theta) / theta * kept_n)
            offset[k, 1] = shift[k] / (theta * dt) + (held_t / theta + (1.0 - theta) / theta * kept_t)
        else:
            un = (gap[k] - gap_before[k]) / dt + held_n
            offset[k, 0] = un + newton_offset(e, un + kept_n)
            offset[k, 1] = shift[k] / dt + held_t


@kernel
def pulls_of_step(
    frames: Frames, laws: Laws, adhesion: Floats, inverse: Floats, dt: float, touching: float, out: Floats
) -> None:
    """Forces [N], shape (c,), by which contacts attract in a step beside the forces ``r`` of its problem: they act with ``p - out``.

    A rigid contact that is closed at the step's start, its gap at most ``touching``, has its ``adhesion`` (of a law row): then
    ``p >= 0`` of the problem is ``fn >= -adhesion`` and the cone is that of ``fn + adhesion``. A dashpot that may pull has ``c d_0/dt``.
    """
    for k in range(frames.row.shape[0]):
        law = frames.row[k]
        out[k] = adhesion[law] if frames.gap_before[k] <= touching else 0.0
        if laws.viscous_pull[law]:
            out[k] = damping_of_step(k, frames, laws, inverse, dt) * max(0.0, -frames.gap_before[k])


@kernel
def note_losses(
    frames: Frames,
    laws: Laws,
    bodies: Bodies,
    steady: Floats,
    start: Start,
    v: Floats,
    dx: Floats,
    r: Floats,
    shear_0: Floats,
    spring: Floats,
    dt: float,
    theta: float,
    losses: Floats,
) -> None:
    """Add what a step lost and was fed to ``losses``, channel by channel.

    With the mean velocity ``v_m``, ``dv = v_1 - v_0`` and ``dx/dt = v_m + (theta - 1/2) dv`` the momentum balance gives::

        Delta T = dt v_m.(f - xi M dx/dt + H' r)

    - Loads: ``dt v_m.f = f.dx - (theta - 1/2) dt dv.f``; ``f.dx`` is the work of gravity (`steady`) and of the other forces.
    - Global damping: ``xi dt (dx/dt).M (dx/dt)`` is lost; the rest is ``(theta - 1/2) xi dt dv.M (dx/dt)``.
    - Rigid contacts: impulses times mean contact velocities. Where the work is negative it is lost, of p in an impact, of q by friction.
    - Elastic contacts: ``r.(H dx) - (theta - 1/2) dt r.(H dv)``. With the spring's overlaps ``a_0`` of the step's start and ``a_1`` of its
      end, ``p = kn a_1 + p_d`` and ``d_n = Delta_n + a_1 - a_0``, 0 in a contact that stays closed under Coulomb's law,
      ``p Delta_n = -Delta(kn a^2/2) - kn (a_1 - a_0)^2/2 - p_d (a_1 - a_0) + p d_n``: the spring's energy, the scheme's damping, the
      dashpot's loss ``p_d (a_1 - a_0) >= 0``, and what a force that is the same all through the step does before the contact closes. In
      the same way ``q Delta_t`` with ``s = q/ks``; ``-q d_t >= 0`` is lost by friction.

    Everything with ``theta - 1/2``, the squares of the springs' increments, ``-p d_n``, positive work of rigid contacts (as a negative
    loss) and the energy of springs that were stretched at the end of the last step and are not, or less, at the start of this one
    (contacts turn, dilate, open) are the scheme's. What is prescribed has no balance: bodies that are held get the work of what holds
    them, the walls' is counted elsewhere.

    Parameters
    ----------
    frames, laws, bodies, start
        Of the step.
    steady : ndarray, shape (b, 3)
        Loads of gravity.
    v, dx : ndarray, shape (b, 3)
        Velocities at the end of the step, 0 where prescribed, and displacements.
    r : ndarray, shape (c, 2)
        Forces that act [N].
    shear_0, spring : ndarray, shape (c,)
        Shear forces at the start of the step, and normal forces of the springs at its end [N].
    dt, theta : float
    losses : ndarray, shape (8,)
        Updated.
    """
    ahead = theta - 0.5
    for i in range(v.shape[0]):
        for d in range(3):
            load, way = bodies.load[i, d], dx[i, d]
            losses[FORCE_WORK] += (load - steady[i, d]) * way
            if bodies.free[i, d]:
                rate, change = way / dt, v[i, d] - start.kept[i, d]
                drag = bodies.xi * bodies.mass[i, d] * rate
                losses[DAMPING] += drag * way
                losses[SCHEME] += ahead * dt * change * (load - drag)
            else:
                losses[HELD_WORK] -= load * way
    stored = 0.0
    losses[SCHEME] += losses[STORED]
    for k in range(frames.row.shape[0]):
        law, p, q = frames.row[k], r[k, 0], r[k, 1]
        held_n, held_t = contact_velocity(k, frames.bodies, frames.normal, frames.arms, start.prescribed)
        n_0, t_0 = contact_velocity(k, frames.bodies, frames.normal, frames.arms, start.kept)
        n_1, t_1 = contact_velocity(k, frames.bodies, frames.normal, frames.arms, v)
        given_n = frames.gap[k] - frames.gap_before[k] + dt * held_n
        given_t = frames.shift[k] + dt * held_t
        losses[HELD_WORK] -= dt * (p * held_n + q * held_t)
        if not laws.elastic[law]:
            work_n = p * (given_n + 0.5 * dt * (n_0 + n_1))
            work_t = q * (given_t + 0.5 * dt * (t_0 + t_1))
            losses[IMPACT] += max(0.0, -work_n)
            losses[FRICTION] += max(0.0, -work_t)
            losses[SCHEME] -= max(0.0, work_n) + max(0.0, work_t)
            continue
        kn, ks = laws.kn[law], laws.ks[law]
        losses[SCHEME] += ahead * dt * (p * (n_1 - n_0) + q * (t_1 - t_0))
        opening = given_n + dt * (theta * n_1 + (1.0 - theta) * n_0)
        slip = given_t + dt * (theta * t_1 + (1.0 - theta) * t_0)
        a_0, a_1 = max(0.0, -frames.gap_before[k]), spring[k] / kn
        losses[DASHPOT] += (p - spring[k]) * (a_1 - a_0)
        losses[SCHEME] += 0.5 * kn * ((a_1 - a_0) ** 2 - a_0 * a_0) - p * (opening + a_1 - a_0)
        stored += 0.5 * kn * a_1 * a_1
        if ks > 0.0:
            s_0, s_1 = shear_0[k] / ks, q / ks
            losses[FRICTION] -= q * (slip + s_1 - s_0)
            losses[SCHEME] += 0.5 * ks * ((s_1 - s_0) ** 2 - s_0 * s_0)
            stored += 0.5 * ks * s_1 * s_1
    losses[STORED] = stored


@kernel
def note_impact_work(
    step: int,
    slack: float,
    resolution: float,
    frames: Frames,
    blocks: Floats,
    laws: Laws,
    start: Start,
    v: Floats,
    r: Floats,
    dt: float,
    gains: Floats,
) -> None:
    """Add the energy that contacts under Newton's law feed in a step to ``gains``, shape (6,), where it is more than round-off.

    Impulses ``dt r`` do the work ``dt r.(u_0 + u_1)/2`` on the bodies, with ``u_0, u_1`` the contact velocities at both ends of the
    step (walls apart, whose work is counted as theirs). Contacts that feed are summed, those that dissipate left out: what one feeds
    would hide behind what others lose in the same step. The sum counts if it exceeds ``slack`` times what all impulses exchange, for
    the solver's tolerance, and what contact velocities of the size ``resolution`` [m/s] make of it.

    ``v`` are the velocities at the end of the step, 0 where prescribed, and ``blocks`` the Delassus blocks.
    """
    bodies, pairs, row = frames.bodies, frames.pairs, frames.row
    normal, arms = frames.normal, frames.arms
    gap, gap_before, shift = frames.gap, frames.gap_before, frames.shift
    total, size, most, at = 0.0, 0.0, 0.0, -1
    for k in range(bodies.shape[0]):
        p, q = r[k, 0], r[k, 1]
        if np.isnan(laws.restitution[row[k]]) or (p == 0.0 and q == 0.0):
            continue
        held_n, held_t = contact_velocity(k, bodies, normal, arms, start.prescribed)
        n_0, t_0 = contact_velocity(k, bodies, normal, arms, start.kept)
        n_1, t_1 = contact_velocity(k, bodies, normal, arms, v)
        wall_n, wall_t = (gap[k] - gap_before[k]) / dt + held_n, shift[k] / dt + held_t
        work = 0.5 * dt * (p * (2.0 * wall_n + n_0 + n_1) + q * (2.0 * wall_t + t_0 + t_1))
        force = p + abs(q)
        speed = abs(wall_n + n_0) + abs(wall_n + n_1) + abs(wall_t + t_0) + abs(wall_t + t_1)
        size += dt * force * (slack * (speed + force * max(blocks[k, 0], blocks[k, 2])) + resolution)
        total += max(work, 0.0)
        if work > most:
            most, at = work, k
    if total > size:
        gains[GAIN_STEPS] += 1.0
        gains[GAIN_TOTAL] += total
        if total > gains[GAIN_LARGEST]:
            gains[GAIN_LARGEST], gains[GAIN_STEP] = total, step
            gains[GAIN_I], gains[GAIN_J] = pairs[at, 0], pairs[at, 1]


@kernel
def carry_springs(
    frames: Frames,
    x: Floats,
    before: Floats,
    after: Floats,
    dx: Floats,
    laws: Laws,
    inverse: Floats,
    dt: float,
    forces: Floats,
    spring: Floats,
    shear: Floats,
) -> None:
    """What of the forces of the step that was solved, (c, 2), is the normal springs', shape (c,), and the shear forces with which the
    next step begins, (c,); x and dx are the step's own.

    A normal force less its dashpot's share (`dynamic_terms`) is the spring's. Where none acts although bodies still overlap, the spring
    has the force of the overlap.

    The program of a step has the slip ``s_0 = shift + H_t dx`` along the tangent of its start, which is of first order and drifts along
    closed paths. With ``dx`` known, the spring's own slip is that along the tangent of the middle of the step, ``s_m``: with a and b the
    difference of the positions before and after, ``m = (a + b)/2`` and ``-(b - a).t_m = -(a x b)/|m|`` between disks. So the next step
    begins with ``q - ks (s_m - s_0)``, within the cone. The step itself keeps the frame of its start, its error is of first order
    as before, but nothing of it stays: a retraced path leaves what the midpoint rule leaves.

    Outlines have ``a = h n``, h the distance of the bodies along the normal: their contacts turn as those of disks would.
    """
    pairs, bodies, row = frames.pairs, frames.bodies, frames.row
    normal, arms, gap_before, shift = frames.normal, frames.arms, frames.gap_before, frames.shift
    for k in range(pairs.shape[0]):
        law, i, j = row[k], pairs[k, 0], pairs[k, 1]
        spring[k], shear[k] = forces[k, 0], forces[k, 1]
        if laws.beta[law] > 0.0 and laws.elastic[law]:
            viscous, opening = (
                damping_of_step(k, frames, laws, inverse, dt),
                contact_velocity(k, bodies, normal, arms, dx)[0],
            )
            if forces[k, 0] > 0.0:
                kept = 0.0 if laws.viscous_pull[law] else viscous * max(0.0, -gap_before[k])
                overlap = (forces[k, 0] + kept) / (laws.kn[law] + viscous)
            else:
                overlap = max(0.0, -frames.gap[k] - opening)
            spring[k] = laws.kn[law] * overlap
        if not (laws.elastic[law] and laws.slip_middle[law]) or laws.ks[law] == 0.0 or laws.mu[law] == 0.0:
            continue
        nx, ny = normal[k, 0], normal[k, 1]
        shorter = 0.5 * laws.arm_overlap[law] * max(0.0, -gap_before[k])
        arm_i, arm_j = arms[k, 2] + shorter, 0.0
        _, slip = contact_velocity(k, bodies, normal, arms, dx)
        if j < x.shape[0]:
            wx, wy = dx[j, 0] - dx[i, 0], dx[j, 1] - dx[i, 1]
            h = (x[j, 0] - x[i, 0]) * nx + (x[j, 1] - x[i, 1]) * ny
            mx, my = h * nx + 0.5 * wx, h * ny + 0.5 * wy
            far = sqrt(mx * mx + my * my)
            arm_j = arms[k, 3] + shorter
            middle = (my * wx - mx * wy) / far + arm_j * dx[j, 2]
            deep = max(0.0, arm_i + arm_j - far)
            middle -= 0.5 * laws.arm_overlap[law] * deep * dx[j, 2]
        else:
            w = j - x.shape[0]
            ux, uy = before[w, 2] + after[w, 2], before[w, 3] + after[w, 3]
            length = sqrt(ux * ux + uy * uy)
            ux, uy = ux / length, uy / length
            turned = before[w, 2] * after[w, 3] - before[w, 3] * after[w, 2]
            wx, wy = after[w, 0] - before[w, 0], after[w, 1] - before[w, 1]
            height = (x[i, 0] + 0.5 * dx[i, 0] - before[w, 0] - 0.5 * wx) * ux
            height += (x[i, 1] + 0.5 * dx[i, 1] - before[w, 1] - 0.5 * wy) * uy
            deep = max(0.0, arm_i - height)
            # Half the overlap times twice the sine of half the turn: how far the middle of the overlap moves.
            middle = (dx[i, 0] - wx) * uy - (dx[i, 1] - wy) * ux - laws.wall_mid[law] * deep * turned / length
            slip += shift[k]
        middle += (arm_i - 0.5 * laws.arm_overlap[law] * deep) * dx[i, 2]
        cap = laws.mu[law] * forces[k, 0]
        shear[k] = max(-cap, min(cap, forces[k, 1] - laws.ks[law] * (middle - slip)))


FARTHEST = 0.1
"""Path along an outline, over its length, that a contact is followed in one step; a strictly convex pair's one contact always is."""


@kernel
def complete_frames(
    x: Floats,
    first: Floats,
    second: Floats,
    tip: Floats,
    before: Floats,
    after: Floats,
    laws: Laws,
    frames: Frames,
) -> None:
    """Fill ``gap_before``, ``shift`` and ``arms`` of contacts whose normals and gaps are known.

    The point of body i is at ``first``, shape (c, 2), from its centre, that of j at ``second``; a wall's is measured from i's centre. With
    ``r`` one of them, a normal force has the arm ``r.t`` about i and ``-r.t`` about j, a shear force ``r.n + tip`` and ``-r.n + tip``, less
    half the overlap where the law says so. ``tip``, shape (c, 2), moves the points along the normal to the extreme points of the outlines.
    """
    n = x.shape[0]
    pairs, row, normal, arms = frames.pairs, frames.row, frames.normal, frames.arms
    gap, gap_before, shift = frames.gap, frames.gap_before, frames.shift
    for k in range(pairs.shape[0]):
        i, j = pairs[k, 0], pairs[k, 1]
        nx, ny = normal[k, 0], normal[k, 1]
        rx, ry, sx, sy = first[k, 0], first[k, 1], second[k, 0], second[k, 1]
        gap_before[k], shift[k] = gap[k], 0.0
        if j >= n:
            w = j - n
            # The material point of the body that is deepest, seen from the wall as it was. Where the wall turns, see `gaps_before`.
            px, py = x[i, 0] + rx + tip[k, 0] * nx, x[i, 1] + ry + tip[k, 0] * ny
            gap_before[k] = (px - before[w, 0]) * before[w, 2] + (py - before[w, 1]) * before[w, 3]
            deep = laws.wall_mid[row[k]] * 0.5 * max(0.0, -gap[k])
            mx, my = material_shift(x[i, 0] + sx + deep * nx, x[i, 1] + sy + deep * ny, w, before, after)
            shift[k] = mx * ny - my * nx
        shorter = 0.5 * laws.arm_overlap[row[k]] * max(0.0, -gap_before[k])
        arms[k, 0], arms[k, 2] = nx * ry - ny * rx, nx * rx + ny * ry + tip[k, 0] - shorter
        arms[k, 1], arms[k, 3] = 0.0, 0.0
        if j < n:
            arms[k, 1], arms[k, 3] = ny * sx - nx * sy, tip[k, 1] - nx * sx - ny * sy - shorter


@inline_kernel
def turns_apart(one: float, other: float, spans: float) -> float:
    """Distance of two places along a closed outline over its length in spans, the shorter way; 0 where there is no outline."""
    if spans <= 0.0:
        return 0.0
    ahead = (one - other) % spans
    return min(ahead, spans - ahead) / spans


@kernel
def gaps_before(
    keys: NDArray[np.int64],
    place: Floats,
    near_keys: NDArray[np.int64],
    near_place: Floats,
    near_gap: Floats,
    spans: Floats,
    gap_before: Floats,
) -> None:
    """Gap before a wall turned: that of the nearest feature which the same pair then had; all keys ascend.

    ``spans``, shape (c,), are those of the outline. A contact without such a feature keeps what it has.
    """
    begin = 0
    for k in range(keys.shape[0]):
        while begin < near_keys.shape[0] and near_keys[begin] < keys[k]:
            begin += 1
        least, m = FARTHEST, begin
        while m < near_keys.shape[0] and near_keys[m] == keys[k]:
            off = turns_apart(place[k, 0], near_place[m, 0], spans[k])
            if off <= least:
                least, gap_before[k] = off, near_gap[m]
            m += 1


@kernel
def carry_over(
    old_keys: NDArray[np.int64],
    old_place: Floats,
    old_forces: Floats,
    keys: NDArray[np.int64],
    place: Floats,
    spans: Floats,
    single: NDArray[np.bool_],
    forces: Floats,
) -> None:
    """Give each contact of the last step's forces to the nearest contact of the same pair, to ``forces``, shape (c, 2).

    Keys of pairs, shape (k,) and (c,), ascend. ``spans``, shape (c, 2), are the numbers of spans of both outlines of each new contact, 0
    on disks and walls; ``single``, shape (c,), says that its pair never has two. Contacts that merge add their forces; one that would have
    moved by more than `FARTHEST` along each of its outlines has opened.
    """
    forces[:] = 0.0
    begin = 0
    for m in range(old_keys.shape[0]):
        while begin < keys.shape[0] and keys[begin] < old_keys[m]:
            begin += 1
        best, least, k = -1, 1e300, begin
        while k < keys.shape[0] and keys[k] == old_keys[m]:
            off_a = turns_apart(place[k, 0], old_place[m, 0], spans[k, 0])
            off_b = turns_apart(place[k, 1], old_place[m, 1], spans[k, 1])
            followed = (
                single[k] or (spans[k, 0] > 0.0 and off_a <= FARTHEST) or (spans[k, 1] > 0.0 and off_b <= FARTHEST)
            )
            if followed and off_a + off_b < least:
                best, least = k, off_a + off_b
            k += 1
        if best >= 0:
            forces[best, 0] += old_forces[m, 0]
            forces[best, 1] += old_forces[m, 1]


@kernel
def mark_covered(
    keys: NDArray[np.int64],
    place: Floats,
    gap: Floats,
    chord_keys: NDArray[np.int64],
    chord_place: Floats,
    spans: Floats,
    covered: NDArray[np.bool_],
) -> None:
    """Mark the features, of c pairs' keys, that overlap on the arc of a chord of the same pair; both sorts of keys ascend.

    ``chord_place``, shape (k, 4), begins with where the first outline enters the common area and holds where it leaves it in column 2;
    ``spans``, shape (k,), are the spans of that outline.
    """
    begin = 0
    for m in range(chord_keys.shape[0]):
        while begin < keys.shape[0] and keys[begin] < chord_keys[m]:
            begin += 1
        k = begin
        while k < keys.shape[0] and keys[k] == chord_keys[m]:
            inside = (place[k, 0] - chord_place[m, 0]) % spans[m] <= (chord_place[m, 2] - chord_place[m, 0]) % spans[m]
            covered[k] = covered[k] or (inside and gap[k] <= 0.0)
            k += 1
