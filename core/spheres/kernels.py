"""Kernels of the DEM of spheres: where planes are, and the forces of contacts.

As in the plane (`ninedisk.core.dem.force_kernels`) contacts go through loops without branches, by chunks: which pairs of the list touch,
differences of their bodies into a scratch in the fastest cache, the law in vector registers, sums into the bodies. Only pairs that touch
get past the first loop. Contacts of a chunk that have the same law are one run, for which all that the law decides is decided once; in a
scene of many materials runs are short.

A plane enters as a sphere of no radius at the foot of the other one's centre: everything between the differences and the sums is the same.
"""

from __future__ import annotations

from math import cos, floor, sin, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import fused_inline_kernel, fused_kernel, inline_kernel, kernel
from ninedisk.core.spheres.registers import INTERPRETED, WIDE, blend, scale, transpose

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Numbers = NDArray[np.uint32]
Vector = tuple[float, float, float]
Index = int | np.uint64

HERTZ, KN, KS, MU, BETA, TORQUE_MID, SLIP_MID, MIDDLE, UNLOADING, PULL = range(10)
"""Columns of a law: whether it is Hertz'; ``kn`` [N/m] or ``(4/3) E*`` [Pa]; ``ks`` or ``8 G*``; mu; beta; whether the torque's arm ends in
the middle of the overlap, the slip's too; whether slip is that of mid-step; the rule of unloading; pull over the reduced radius [N/m]."""
ROLL, TWIST = 10, 14
"""First columns of the two resistances, four each: model, mu, stiffness [N m/rad], damping ratio."""
HELD, STICKS = 18, 19
"""What friction has beside fn and `PULL`, over the reduced radius [N/m]; of JKR's law ``(pi g/(4 E*))^(2/3)`` [m^(2/3)], else 0."""

NO_RESISTANCE, CONSTANT, SPRING = 0, 1, 2
KEEPS, FORCE, RESCALE = 0, 1, 2
"""Rules of unloading: the spring keeps its displacement, its force, or shrinks with the contact."""

SHEAR, REDUCED, ROLLING, TWISTING = 0, 3, 4, 7
MEMORY_WIDTH, MEMORY_WIDTH_RESISTED = 4, 8
"""Columns of what a contact remembers: shear spring (3), and its reduced radius; with a resistance also rolling torque (3), twisting one.
Where it was in the step before, and whether it was open then, so that it has nothing to remember, follows from ``x - dt v``."""

DRAG, ROLL_DRAG, TWIST_DRAG, NECK = range(4)
NOTES_WIDTH, NOTES_WIDTH_RESISTED, NOTES_WIDTH_STICKY = 1, 3, 4
"""Columns of what is noted of a listed pair, coefficients of its dashpots: along the normal [N s/m], with Hertz' law over the root of the
contact radius, and of the resistances [N m s]; with JKR's law the gap [m] at which its neck breaks, < 0 while there is none."""

FRICTION, DASHPOT, ROLLED_ON, ROLLING_DASHPOT, OF_LAW = range(5)
"""Channels of `Losses`: sliding, dashpots, resistances beyond their springs, their dashpots, and what the law itself takes (< 0: feeds): a
shear spring whose stiffness changes with the contact radius, a torque whose arm is not that of the slip."""

LANES = 1 if INTERPRETED else 8
"""Numbers in the widest vectors of processors; `CHUNK` is a multiple."""
CHUNK = 64
"""Contacts that go through the loops together."""


class State(NamedTuple):
    """Bodies: n spheres and m planes; a slot for each stripe in each of the steps that are done at once, those of one step in a row.

    Spheres are in the order of their rows, which ``name`` tells in the scene's numbers; their vectors are in one dimension, `WIDE` numbers
    each, the last one 0. ``mobility`` is 1/m of the components that are not held, ``moved`` the displacement since the last rebuild of the
    lists, ``v_now`` and ``omega_now`` have what dashpots see where that is not ``v`` and ``omega``. ``now`` is where planes are, as in
    `Planes`, ``load`` the force on each, ``share`` what the slots add to it; ``behind`` tells for each slot 1 + sphere and plane where a
    centre is behind one.
    """

    x: Floats
    v: Floats
    omega: Floats
    angle: Floats
    v_now: Floats
    omega_now: Floats
    force: Floats
    torque: Floats
    mass: Floats
    mobility: Floats
    inv_mass: Floats
    inv_inertia: Floats
    radius: Floats
    name: Integers
    now: Floats
    load: Floats
    share: Floats
    behind: Integers
    moved: NDArray[np.float32]


class Planes(NamedTuple):
    """Planes in a step: at its end t_n, in its middle and at its begin; rows are point, normal, pivot, its velocity, spin (3 each)."""

    now: Floats
    middle: Floats
    before: Floats


class Contacts(NamedTuple):
    """Listed pairs by rows, ``start[r] .. start[r+1]-1``; room for k of them.

    Rows are spheres, with spheres of higher rows, or planes, with ascending spheres. ``law`` is a row of the laws, ``notes`` and
    ``memory`` have columns above; ``force`` (fn, fs on the first body) is that of the last step before `advance` returned.
    """

    start: Integers
    row: Numbers
    other: Numbers
    law: Numbers
    notes: Floats
    memory: Floats
    force: Floats


class Losses(NamedTuple):
    """Energy that contacts of each stripe have lost since time 0 [J], by channels above; m planes.

    ``before`` has that before the step that `advance` ended with. ``torque`` is what the slots add to the torque on each plane about
    the origin; ``loads``, force and torque, those of the last step and of the one before; ``work`` that of the planes on spheres [J].
    """

    contacts: Floats
    before: Floats
    torque: Floats
    loads: Floats
    work: Floats


class Step(NamedTuple):
    """A step as its contacts see it.

    Attributes
    ----------
    slip_dt, loss_dt : float
        Time over which slip accumulates [s]: ``dt``, or 0 for the forces at time 0; and forces that depend on velocities, then dt/2.
    central : bool
        Whether dashpots see ``v_now``.
    keep : bool
        Whether the forces of the contacts are to be kept.
    """

    slip_dt: float
    loss_dt: float
    central: bool
    keep: bool


class Desk(NamedTuple):
    """What a thread writes to while it finds the forces of a stripe.

    Attributes
    ----------
    slot : int
        Of the stripe in this step, see `State`.
    scratch : ndarray, shape (SCRATCH,) or (SCRATCH_COUNTED,)
        The contacts of a chunk, by columns below.
    picked : ndarray of int64, shape (CHUNK,)
        Where they stand in their list.
    """

    slot: int
    scratch: Floats
    picked: Integers


class Motion(NamedTuple):
    """Segments of the planes' motion: those of plane w are ``first[w] .. first[w+1]-1``; columns of ``row`` below."""

    first: Integers
    row: Floats


BEGIN, POINT, AXIS, PIVOT, VELOCITY, SPIN, AMPLITUDE, FREQUENCY, PHASE = 0, 1, 4, 7, 10, 13, 16, 19, 20
SEGMENT_WIDTH = 21
POSE_WIDTH = 15


@fused_inline_kernel
def dot(a: Vector, b: Vector) -> float:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@fused_inline_kernel
def cross(a: Vector, b: Vector) -> Vector:
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@fused_inline_kernel
def plus(a: Vector, s: float, b: Vector) -> Vector:
    """``a + s b``."""
    return a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]


@inline_kernel
def row(table: Floats, i: int, first: int) -> Vector:
    """Three columns of a row."""
    return table[i, first], table[i, first + 1], table[i, first + 2]


@inline_kernel
def turned(a: Vector, axis: Vector, time: float) -> Vector:
    """``a`` turned by ``time`` times the angular velocity ``axis`` [rad/s] (Rodrigues)."""
    rate = sqrt(dot(axis, axis))
    if rate == 0.0:
        return a
    u = (axis[0] / rate, axis[1] / rate, axis[2] / rate)
    c, s = cos(rate * time), sin(rate * time)
    part = plus((c * a[0], c * a[1], c * a[2]), s, cross(u, a))
    return plus(part, (1.0 - c) * dot(u, a), u)


@kernel
def place_planes(motion: Motion, t: float, table: Floats) -> None:
    """Fill the poses (m, 15) of all planes at time ``t`` [s]."""
    for w in range(table.shape[0]):
        k = motion.first[w + 1] - 1
        while k > motion.first[w] and motion.row[k, BEGIN] > t:
            k -= 1
        tau = t - motion.row[k, BEGIN]
        frequency, phase = motion.row[k, FREQUENCY], motion.row[k, PHASE]
        wave, rate = sin(frequency * tau + phase) - sin(phase), frequency * cos(frequency * tau + phase)
        spin, pivot = row(motion.row, k, SPIN), row(motion.row, k, PIVOT)
        arm = turned(plus(row(motion.row, k, POINT), -1.0, pivot), spin, tau)
        normal = turned(row(motion.row, k, AXIS), spin, tau)
        for d in range(3):
            velocity, amplitude = motion.row[k, VELOCITY + d], motion.row[k, AMPLITUDE + d]
            place = motion.row[k, PIVOT + d] + velocity * tau + amplitude * wave
            table[w, d] = place + arm[d]
            table[w, 3 + d] = normal[d]
            table[w, 6 + d] = place
            table[w, 9 + d] = velocity + amplitude * rate
            table[w, 12 + d] = spin[d]


@inline_kernel
def plane_velocity(table: Floats, w: int, place: Vector, ahead: float) -> Vector:
    """Velocity [m/s] of the plane's material at a place [m], the pivot having moved on for a time [s] since the table's."""
    velocity = row(table, w, 9)
    arm = plus(plus(place, -1.0, row(table, w, 6)), -ahead, velocity)
    return plus(velocity, 1.0, cross(row(table, w, 12), arm))


@fused_inline_kernel
def scaled(q: Vector, s: float) -> Vector:
    """``s q``."""
    return s * q[0], s * q[1], s * q[2]


@fused_inline_kernel
def carried(q: Vector, before: Vector, n: Vector) -> Vector:
    """A vector at right angles to ``before``, turned with the normal into ``n`` on the shortest way: its size stays to round-off."""
    share = dot(q, n) / (1.0 + dot(before, n))
    return plus(q, -share, (before[0] + n[0], before[1] + n[1], before[2] + n[2]))


@fused_inline_kernel
def projected(q: Vector, n: Vector) -> Vector:
    """A vector's part at right angles to ``n``, stretched to the size that the vector had."""
    flat = plus(q, -dot(q, n), n)
    now = dot(flat, flat)
    return scaled(flat, sqrt(dot(q, q) / now) if now > 0.0 else 1.0)


@fused_inline_kernel
def capped(q: Vector, limit: float) -> Vector:
    """``q`` shortened to ``limit``."""
    size = sqrt(dot(q, q))
    return scaled(q, limit / size if size > limit else 1.0)


TURN, TURN_REST = 6.283185307179586, 2.4492935982947064e-16
"""A turn [rad] as the sum of two numbers."""
PER_TURN = 1.0 / TURN
S3, S5, S7, S9, S11, S13 = (-1.0 / (m * (m - 1.0)) for m in (3.0, 5.0, 7.0, 9.0, 11.0, 13.0))
C2, C4, C6, C8, C10, C12 = (-1.0 / (m * (m - 1.0)) for m in (2.0, 4.0, 6.0, 8.0, 10.0, 12.0))
"""Factors from one term of the series of sine and cosine to the next."""


@fused_inline_kernel
def spun(q: Vector, n: Vector, angle: float) -> Vector:
    """``q``, at right angles to the unit vector ``n``, turned about it by an angle [rad].

    Vector registers know no sine: that of an eighth of the angle, after whole turns have been taken off, by its series to 6e-19, and
    three times the formulas of the double angle.
    """
    turns = floor(angle * PER_TURN + 0.5)
    a = 0.125 * (angle - turns * TURN - turns * TURN_REST)
    a2 = a * a
    s = a + a * (S3 * a2 * (1.0 + S5 * a2 * (1.0 + S7 * a2 * (1.0 + S9 * a2 * (1.0 + S11 * a2 * (1.0 + S13 * a2))))))
    c = 1.0 + C2 * a2 * (1.0 + C4 * a2 * (1.0 + C6 * a2 * (1.0 + C8 * a2 * (1.0 + C10 * a2 * (1.0 + C12 * a2)))))
    for _ in range(3):
        s, c = 2.0 * s * c, 1.0 - 2.0 * s * s
    return plus(scaled(q, c), s, cross(n, q))


@fused_inline_kernel
def half_spun(q: Vector, n: Vector, angle: float) -> Vector:
    """A rate at right angles to ``n`` as a spring feels it that turns by a small ``angle`` [rad] meanwhile: turned by half of it."""
    return plus(q, 0.5 * angle, cross(n, q))


class Law(NamedTuple):
    """What `contact` reads of a law, columns above."""

    kn: float
    ks: float
    mu: float
    torque_mid: float
    slip_mid: float
    rescale: bool
    pull: float
    held: float


@inline_kernel
def law_of(law: Floats) -> Law:
    """Numbers of a row of the laws: loops that write to the scratch then need not read the row again."""
    return Law(
        law[KN], law[KS], law[MU], law[TORQUE_MID], law[SLIP_MID], law[UNLOADING] == RESCALE, law[PULL], law[HELD]
    )


@fused_inline_kernel
def neck_of(overlap: float, gap: float, reduced: float) -> tuple[float, float]:
    """Radius ``a_c`` [m] at which a neck breaks, and the root s of the present radius over it; ``gap`` > 0 that at which it breaks.

    With ``s = 1 + t`` JKR's ``overlap = (a_c^2/R) (s^4 - 4 s)`` is ``t sqrt(t^2 + 4 t + 6) = q``, ``q^2 = 3 (overlap + gap)/gap``, without
    a difference of large numbers at the break, t = 0. Newton's method falls to the root from any larger t, as both starts are, of which
    the smaller one is within a factor of 1.6: six steps leave round-off.
    """
    q = sqrt(3.0 * (overlap + gap) / gap)
    t = min(q * 0.40824829046386302, sqrt(q))
    for _ in range(6):
        root = sqrt(t * t + 4.0 * t + 6.0)
        t -= (t * root - q) * root / (2.0 * t * t + 6.0 * t + 6.0)
    return sqrt(gap * reduced / 3.0), 1.0 + t


class Touch(NamedTuple):
    """Two bodies in contact, as a law sees them.

    Attributes
    ----------
    neck : float
        `NECK` of its notes, with the sign of the step before.
    d, d_before : vector
        From the first centre to the second one [m], now and a step before.
    reach, reduced : float
        Sum of the radii and reduced radius [m].
    drag : float
        `DRAG` of its notes.
    dv, dashpot_dv : vector
        Velocity of the first centre relative to the second one [m/s], and that which the dashpot sees.
    roll, spin : vector
        ``R_i w_i + R_j w_j`` [m/s] and ``w_i + w_j`` [rad/s].
    spring : vector
        What it remembers [N or m]; counts for nothing if the contact was open.
    """

    neck: float
    d: Vector
    d_before: Vector
    reach: float
    reduced: float
    drag: float
    dv: Vector
    dashpot_dv: Vector
    roll: Vector
    spin: Vector
    spring: Vector


class Pose(NamedTuple):
    """Normal and overlap [m] of a contact now and a step before, and its spring."""

    n: Vector
    overlap: float
    before: Vector
    overlap_before: float
    spring: Vector


@fused_inline_kernel
def pose_of(middle: bool, sticks: bool, touch: Touch) -> Pose:
    """The pose of a contact; one that was open begins now. ``middle`` and ``sticks`` as in `contact`."""
    d, d_before, reach, neck, spring = touch.d, touch.d_before, touch.reach, touch.neck, touch.spring
    apart2, apart2_before = dot(d, d), dot(d_before, d_before)
    inv_apart = 1.0 / sqrt(apart2)
    # Squares that touch by a rounding do not always: that contact has no overlap, and no root of a negative number.
    n, overlap = scaled(d, inv_apart), max(reach - apart2 * inv_apart, -abs(neck) if sticks else 0.0)
    before, overlap_before = n, reach - sqrt(apart2_before)
    if middle:
        inv_before = 1.0 / sqrt(apart2_before)
        before, overlap_before = scaled(d_before, inv_before), reach - apart2_before * inv_before
    if neck < 0.0 if sticks else overlap_before <= 0.0:
        before, overlap_before, spring = n, overlap, (0.0, 0.0, 0.0)
    return Pose(n, overlap, before, overlap_before, spring)


@fused_inline_kernel
def slip(middle: bool, slip_mid: float, slip_dt: float, pose: Pose, touch: Touch) -> tuple[Vector, Vector]:
    """Speed of slip [m/s] of the step that ends now, and the spring turned into the present tangent plane, in the mid-step form also with
    the bodies' mean spin about the normal.

    Both turn on the shortest way, where 1 + a.b of unit vectors is half the square of |a + b|.
    """
    n, before, spring, dv, roll, spin = pose.n, pose.before, pose.spring, touch.dv, touch.roll, touch.spin
    if middle:
        both = (before[0] + n[0], before[1] + n[1], before[2] + n[2])
        inv_both = 1.0 / sqrt(dot(both, both))
        shown = scaled(both, inv_both)
        cut = 0.25 * (pose.overlap + pose.overlap_before) * slip_mid
        u = plus(dv, 1.0, cross(plus(roll, -cut, spin), shown))
        u = plus(u, -dot(u, shown), shown)
        u = plus(u, -dot(u, n) / (1.0 + dot(shown, n)), (shown[0] + n[0], shown[1] + n[1], shown[2] + n[2]))
        spring = plus(spring, -2.0 * inv_both * inv_both * dot(spring, n), both)
        twist = 0.5 * slip_dt * dot(spin, shown)
        spring, u = spun(spring, n, twist), half_spun(u, n, twist)
    else:
        u = plus(dv, 1.0, cross(plus(roll, -0.5 * pose.overlap * slip_mid, spin), n))
        u = plus(u, -dot(u, n), n)
        spring = projected(spring, n)
    return u, spring


@fused_inline_kernel
def contact(
    hertz: bool, middle: bool, in_force: bool, sticks: bool, law: Law, slip_dt: float, touch: Touch
) -> tuple[float, float, float, Vector, Vector, Vector]:
    """The law of one contact without its resistances.

    Parameters
    ----------
    hertz, middle, in_force, sticks : bool
        Known to the compiler, so arguments of their own: whether the law is Hertz', slip that of mid-step, the spring remembered as a
        force, the law JKR's.
    slip_dt : float
        As in `Step`.
    Returns
    -------
    fn, repulsive, arm_loss : float
        Normal force and its repulsive part [N], what the torque's arms lack to the radii [m].
    fs, spring, n : vector
        Shear force on the first body [N], spring to be remembered, normal.
    """
    pose = pose_of(middle, sticks, touch)
    n, overlap, overlap_before, reduced, drag = pose.n, pose.overlap, pose.overlap_before, touch.reduced, touch.drag
    stiffness, damping, ks, gain = law.kn, drag, law.ks, law.ks
    shrunk = overlap / overlap_before
    pushed = stiffness * overlap
    if sticks:
        neck = abs(touch.neck)
        a_c, s = neck_of(overlap, neck, reduced)
        radius, s_before = a_c * s * s, neck_of(max(overlap_before, -neck), neck, reduced)[1]
        damping, ks, shrunk = drag * sqrt(radius), law.ks * radius, (s * s / (s_before * s_before)) ** 2
        gain = 0.5 * law.ks * a_c * (s * s + s_before * s_before) if middle else ks
        pushed = law.kn * a_c * a_c * a_c / reduced * (s * s * s) * (s * s * s - 6.0)
    elif hertz:
        radius = sqrt(reduced * overlap)
        stiffness, damping, ks, gain = law.kn * radius, drag * sqrt(radius), law.ks * radius, law.ks * radius
        if middle:
            gain = 0.5 * law.ks * (radius + sqrt(reduced * overlap_before))
        pushed = stiffness * overlap
    pushed = pushed + damping * dot(touch.dashpot_dv, n)
    repulsive = max(pushed + law.held * reduced, 0.0)
    fn = pushed - law.pull * reduced
    u, spring = slip(middle, law.slip_mid, slip_dt, pose, touch)
    cap = law.mu * repulsive
    if in_force:
        spring = capped(plus(spring, -slip_dt * gain, u), cap)
        fs = spring
    else:
        if law.rescale and shrunk < 1.0:
            spring = scaled(spring, sqrt(shrunk))
        spring = capped(plus(spring, -slip_dt, u), cap / ks if ks > 0.0 else 0.0)
        fs = scaled(spring, ks)
    return fn, repulsive, 0.5 * overlap * law.torque_mid, fs, spring, n


# Columns of the scratch, `WIDE` for each vector of the contacts: differences of their bodies as in `Touch`; springs, with the
# reduced radius; force on the first body, n x fs, fs with fn; for resistances spins of the first body relative to the second one, torque
# on the latter, rolling torque with the twisting one.
D, DV, ROLLS, SPINS, SPRINGS, DASHPOT_DV, D_BEFORE, PUSH, CROSSED, FS, TURNS, MOMENT, ROLLED = (
    np.uint64(c * WIDE * CHUNK) for c in range(13)
)
# And of numbers: sum of the radii, dashpots, repulsive part of fn, loss of the arms.
REACH, ITS_DRAG, REPULSIVE, ARM_LOSS, ITS_ROLL_DRAG, ITS_TWIST_DRAG = (
    np.uint64((13 * WIDE + c) * CHUNK) for c in range(6)
)
# Vectors row by row, as they come from the bodies (some of those above) and go to them.
D_ROWS, DV_ROWS, ROLLS_ROWS, SPINS_ROWS, SPRINGS_ROWS, DASHPOT_ROWS, TURNS_ROWS, ROLLED_ROWS = (
    np.uint64((13 * WIDE + 6) * CHUNK // WIDE + c * CHUNK) for c in range(8)
)
PUSH_ROWS, CROSSED_ROWS, MOMENT_ROWS = D_ROWS, DV_ROWS, ROLLS_ROWS
ITS_NECK = np.uint64((13 * WIDE + 6 + 8 * WIDE) * CHUNK)
# Spins of the first body relative to the second one, as dashpots see them.
DASHPOT_TURNS = np.uint64((13 * WIDE + 7 + 8 * WIDE) * CHUNK)
DASHPOT_TURNS_ROWS = np.uint64((13 * WIDE + 7 + 9 * WIDE) * CHUNK // WIDE)
SCRATCH = (13 * WIDE + 7 + 10 * WIDE) * CHUNK
OLD_SPRINGS, OLD_ROLLED = np.uint64(SCRATCH), np.uint64(SCRATCH + WIDE * CHUNK)
SCRATCH_COUNTED = SCRATCH + 2 * WIDE * CHUNK
"""Room with what contacts remembered before the step, which losses are counted from."""
ONE, TWO, LAST, FOUR, NEXT = (np.uint64(c) for c in (1, 2, 3, WIDE, CHUNK))


@fused_inline_kernel
def xyz(values: Floats, at: np.uint64) -> Vector:
    """A vector of a sphere, or of a row of the scratch."""
    first = FOUR * at
    return values[first], values[first + ONE], values[first + TWO]


@fused_inline_kernel
def vector(scratch: Floats, at: np.uint64) -> Vector:
    """A vector of the scratch's columns."""
    return scratch[at], scratch[at + NEXT], scratch[at + TWO * NEXT]


@fused_inline_kernel
def last(scratch: Floats, at: np.uint64) -> float:
    """The number beside a vector."""
    return float(scratch[at + LAST * NEXT])


@fused_inline_kernel
def put(scratch: Floats, at: np.uint64, a: Vector) -> None:
    """Write a vector into the scratch's columns."""
    scratch[at], scratch[at + NEXT], scratch[at + TWO * NEXT] = a


@inline_kernel
def to_columns(scratch: Floats, column: np.uint64, rows: np.uint64, count: np.uint64) -> None:
    """Vectors of ``count`` contacts from rows to columns."""
    for q in range(np.uint64(0), count, FOUR):
        transpose(scratch, column + q, NEXT, FOUR * (rows + q), FOUR)


@inline_kernel
def to_rows(scratch: Floats, rows: np.uint64, column: np.uint64, count: np.uint64) -> None:
    """Vectors of ``count`` contacts from columns to rows."""
    for q in range(np.uint64(0), count, FOUR):
        transpose(scratch, FOUR * (rows + q), FOUR, column + q, NEXT)


@inline_kernel
def touch_of(sticks: bool, springs: np.uint64, q: Index, scratch: Floats) -> Touch:
    """The contact at place q of the scratch, with what it remembers from the column ``springs``."""
    return Touch(
        neck=scratch[ITS_NECK + q] if sticks else 0.0,
        d=vector(scratch, D + q),
        d_before=vector(scratch, D_BEFORE + q),
        reach=scratch[REACH + q],
        reduced=last(scratch, SPRINGS + q),
        drag=scratch[ITS_DRAG + q],
        dv=vector(scratch, DV + q),
        dashpot_dv=vector(scratch, DASHPOT_DV + q),
        roll=vector(scratch, ROLLS + q),
        spin=vector(scratch, SPINS + q),
        spring=vector(scratch, springs + q),
    )


@fused_inline_kernel
def run_of_contacts(
    hertz: bool, middle: bool, in_force: bool, sticks: bool, law: Floats, slip_dt: float, begin: int, end: int, scratch: Floats
) -> None:  # fmt: skip
    """`contact` for ``begin .. end-1`` of the scratch, which have the same law."""
    its = law_of(law)
    for q in range(np.uint64(begin), np.uint64(end)):
        touch = touch_of(sticks, SPRINGS, q, scratch)
        fn, repulsive, arm_loss, fs, spring, n = contact(hertz, middle, in_force, sticks, its, slip_dt, touch)
        put(scratch, PUSH + q, plus(fs, -fn, n))
        put(scratch, CROSSED + q, cross(n, fs))
        put(scratch, FS + q, fs)
        put(scratch, SPRINGS + q, spring)
        scratch[FS + LAST * NEXT + q], scratch[REPULSIVE + q], scratch[ARM_LOSS + q] = fn, repulsive, arm_loss


STEEP = 1e30
"""Torque over spin [N m s] below the limit of a constant torque, which makes it the limit wherever anything turns."""


@inline_kernel
def resistance(law: Floats, slip_dt: float, q: Index, scratch: Floats) -> tuple[Vector, Vector, float]:
    """Torque of both resistances on the second body [N m], and what is remembered of them, after `run_of_contacts`."""
    d, before = vector(scratch, D + q), vector(scratch, D_BEFORE + q)
    rolled, twisted = vector(scratch, ROLLED + q), last(scratch, ROLLED + q)
    n, apart = scaled(d, 1.0 / sqrt(dot(d, d))), sqrt(dot(before, before))
    before = scaled(before, 1.0 / apart)
    begins = apart >= scratch[REACH + q]
    if law[STICKS] > 0.0:
        begins = scratch[ITS_NECK + q] < 0.0
    if begins:
        before, rolled, twisted = n, (0.0, 0.0, 0.0), 0.0
    reduced, repulsive = last(scratch, SPRINGS + q), scratch[REPULSIVE + q]
    turn, dashpot_turn = vector(scratch, TURNS + q), vector(scratch, DASHPOT_TURNS + q)
    about, damped_about = dot(turn, n), dot(dashpot_turn, n)
    across = plus(turn, -about, n)
    way = across
    m = (0.0, 0.0, 0.0)
    if law[ROLL] > 0.0:
        if law[MIDDLE] > 0.0:
            both = (before[0] + n[0], before[1] + n[1], before[2] + n[2])
            shown = scaled(both, 1.0 / sqrt(dot(both, both)))
            angle = 0.5 * slip_dt * dot(vector(scratch, SPINS + q), shown)
            rolled, way = spun(carried(rolled, before, n), n, angle), half_spun(across, n, angle)
        else:
            rolled = projected(rolled, n)
        limit = law[ROLL + 1] * reduced * repulsive
        if law[ROLL] == CONSTANT:
            rolled = capped(scaled(across, STEEP), limit)
            m = rolled
        else:
            rolled = plus(rolled, law[ROLL + 2] * slip_dt, way)
            free = dot(rolled, rolled) < limit * limit
            rolled = capped(rolled, limit)
            m = plus(rolled, scratch[ITS_ROLL_DRAG + q] if free else 0.0, plus(dashpot_turn, -damped_about, n))
    if law[TWIST] > 0.0:
        limit = law[TWIST + 1] * reduced * repulsive
        if law[TWIST] == CONSTANT:
            twisted = min(max(STEEP * about, -limit), limit)
            torque = twisted
        else:
            twisted += law[TWIST + 2] * slip_dt * about
            free = abs(twisted) < limit
            twisted = min(max(twisted, -limit), limit)
            torque = twisted + (scratch[ITS_TWIST_DRAG + q] * damped_about if free else 0.0)
        m = plus(m, torque, n)
    return m, rolled, twisted


@inline_kernel
def run_of_resistances(law: Floats, slip_dt: float, begin: int, end: int, scratch: Floats) -> None:
    """`resistance` for ``begin .. end-1`` of the scratch, after `run_of_contacts`."""
    for q in range(np.uint64(begin), np.uint64(end)):
        m, rolled, twisted = resistance(law, slip_dt, q, scratch)
        put(scratch, MOMENT + q, m)
        put(scratch, ROLLED + q, rolled)
        scratch[ROLLED + LAST * NEXT + q] = twisted


@inline_kernel
def laws_of_chunk(contacts: Contacts, laws: Floats, slip_dt: float, count: int, desk: Desk) -> None:
    """Both laws for the first ``count`` contacts of the scratch, run by run.

    A run that is all of the chunk goes on to the end of the last vector: what is there is of no use and of no harm, and one by one they
    would take as long as whole vectors.
    """
    scratch, picked = desk.scratch, desk.picked
    resisted = contacts.memory.shape[1] > MEMORY_WIDTH
    begin = 0
    while begin < count:
        number = contacts.law[picked[begin]]
        end = count
        if laws.shape[0] > 1:
            end = begin + 1
            while end < count and contacts.law[picked[end]] == number:
                end += 1
        law, whole = laws[number], end
        if begin == 0 and end == count:
            whole = (count + LANES - 1) // LANES * LANES
        if law[STICKS] > 0.0:
            run_of_contacts(True, law[MIDDLE] > 0.0, law[UNLOADING] == FORCE, True, law, slip_dt, begin, end, scratch)
        elif law[HERTZ] > 0.0:
            if law[UNLOADING] == FORCE:
                if law[MIDDLE] > 0.0:
                    run_of_contacts(True, True, True, False, law, slip_dt, begin, whole, scratch)
                else:
                    run_of_contacts(True, False, True, False, law, slip_dt, begin, whole, scratch)
            elif law[MIDDLE] > 0.0:
                run_of_contacts(True, True, False, False, law, slip_dt, begin, whole, scratch)
            else:
                run_of_contacts(True, False, False, False, law, slip_dt, begin, whole, scratch)
        elif law[MIDDLE] > 0.0:
            run_of_contacts(False, True, True, False, law, slip_dt, begin, whole, scratch)
        else:
            run_of_contacts(False, False, True, False, law, slip_dt, begin, whole, scratch)
        if resisted:
            run_of_resistances(law, slip_dt, begin, end, scratch)
        begin = end


@inline_kernel
def taken(before: Vector, after: Vector, way: Vector) -> float:
    """Energy [J] that a force or torque which goes from ``before`` to ``after`` takes on a way; that of ``after`` alone where it has turned
    round within the step (`ninedisk.core.dem.force_kernels.friction_loss`)."""
    mean = 0.5 * (dot(before, way) + dot(after, way))
    return mean if mean > 0.0 else max(dot(after, way), 0.0)


@inline_kernel
def compliance(stiffness: float) -> float:
    """Its inverse, 0 for none."""
    return 1.0 / stiffness if stiffness > 0.0 else 0.0


@inline_kernel
def shear_losses(law: Floats, slip_dt: float, at_planes: bool, q: Index, scratch: Floats) -> tuple[float, float]:
    """Energy that friction, and that the law itself, has taken in this step [J], after `run_of_contacts`.

    In the scheme the shear force does the work ``(f_before + f)/2 . u dt``. Of that what the spring did not follow is friction's, and the
    difference to what the spring gains of ``f^2/(2 ks)`` the law's: none of constant stiffness, if slip and torque have the same arms.
    """
    middle, hertz = law[MIDDLE] > 0.0, law[HERTZ] > 0.0
    touch = touch_of(False, OLD_SPRINGS, q, scratch)
    pose = pose_of(middle, False, touch)
    n, overlap, overlap_before, spin = pose.n, pose.overlap, pose.overlap_before, touch.spin
    u, spring = slip(middle, law[SLIP_MID], slip_dt, pose, touch)
    ks, ks_before = law[KS], law[KS]
    if hertz:
        ks, ks_before = ks * sqrt(touch.reduced * overlap), ks * sqrt(touch.reduced * overlap_before)
    f, kept = vector(scratch, FS + q), vector(scratch, SPRINGS + q)
    if hertz and law[UNLOADING] != FORCE:
        f_before = scaled(spring, ks_before)
        if law[UNLOADING] == RESCALE and overlap < overlap_before:
            spring = scaled(spring, sqrt(overlap / overlap_before))
        slid = plus(plus(spring, -slip_dt, u), -1.0, kept)
    else:
        f_before = spring
        gain = 0.5 * (ks + ks_before) if middle else ks
        slid = scaled(plus(plus(spring, -slip_dt * gain, u), -1.0, kept), compliance(gain))
    mean = scaled(plus(f_before, 1.0, f), 0.5)
    arms = 0.5 * overlap * (law[TORQUE_MID] - law[SLIP_MID])
    if at_planes:  # A plane's force acts where the plane is.
        spin = scaled(plus(spin, 1.0, vector(scratch, TURNS + q)), 0.5)
    work = -slip_dt * dot(mean, plus(u, -arms, cross(spin, n)))
    stored = 0.5 * (dot(f, f) * compliance(ks) - dot(f_before, f_before) * compliance(ks_before))
    return taken(f_before, f, slid), work - dot(mean, slid) - stored


@inline_kernel
def resistance_losses(law: Floats, step: Step, q: Index, scratch: Floats) -> tuple[float, float]:
    """Energy that the resistances have taken beyond their springs, and in their dashpots, in this step [J], after `run_of_resistances`."""
    n, _, before, _, rolled = pose_of(True, False, touch_of(False, OLD_ROLLED, q, scratch))
    both = (before[0] + n[0], before[1] + n[1], before[2] + n[2])
    shown = scaled(both, 1.0 / sqrt(dot(both, both)))
    turn, kept, kept_twist = vector(scratch, TURNS + q), vector(scratch, ROLLED + q), last(scratch, ROLLED + q)
    about = dot(turn, n)
    way = scaled(plus(turn, -about, n), step.slip_dt)
    lost = 0.0
    if law[ROLL] > 0.0:
        if law[MIDDLE] > 0.0:
            angle = 0.5 * step.slip_dt * dot(vector(scratch, SPINS + q), shown)
            rolled, way = spun(carried(rolled, before, n), n, angle), half_spun(way, n, angle)
        else:
            rolled = projected(vector(scratch, OLD_ROLLED + q), n)
        if law[ROLL] == SPRING:
            way = plus(way, -compliance(law[ROLL + 2]), plus(kept, -1.0, rolled))
        lost += taken(rolled, kept, way)
    if law[TWIST] > 0.0:
        twisted, angle = last(scratch, OLD_ROLLED + q), step.slip_dt * about
        if law[TWIST] == SPRING:
            angle -= (kept_twist - twisted) * compliance(law[TWIST + 2])
        lost += taken(scaled(n, twisted), scaled(n, kept_twist), scaled(n, angle))
    damped = plus(plus(vector(scratch, MOMENT + q), -1.0, kept), -kept_twist, n)
    return lost, step.loss_dt * dot(damped, vector(scratch, DASHPOT_TURNS + q))


@inline_kernel
def keep_memories(resisted: bool, scratch: Floats) -> None:
    """What contacts remember, before the laws replace it."""
    for c in range(np.uint64(WIDE * CHUNK)):
        scratch[OLD_SPRINGS + c] = scratch[SPRINGS + c]
    if resisted:
        for c in range(np.uint64(WIDE * CHUNK)):
            scratch[OLD_ROLLED + c] = scratch[ROLLED + c]


@fused_kernel
def losses_of_chunk(
    contacts: Contacts, laws: Floats, losses: Losses, step: Step, at_planes: bool, count: int, desk: Desk
) -> None:
    """Add what the first ``count`` contacts of the scratch have lost in this step to the stripe's; after the laws.

    It stands apart from these: a product with two uses would be rounded otherwise than where no losses are counted.
    """
    resisted, scratch = contacts.memory.shape[1] > MEMORY_WIDTH, desk.scratch
    stripe = desk.slot % losses.contacts.shape[0]
    for q in range(np.uint64(count)):
        law = laws[contacts.law[desk.picked[q]]]
        friction, own = shear_losses(law, step.slip_dt, at_planes, q, scratch)
        d = vector(scratch, D + q)
        apart = sqrt(dot(d, d))
        rate, drag = dot(vector(scratch, DASHPOT_DV + q), d) / apart, scratch[ITS_DRAG + q]
        if law[HERTZ] > 0.0:
            drag *= sqrt(sqrt(last(scratch, SPRINGS + q) * max(scratch[REACH + q] - apart, 0.0)))
        losses.contacts[stripe, FRICTION] += friction
        losses.contacts[stripe, DASHPOT] += step.loss_dt * drag * rate * rate
        losses.contacts[stripe, OF_LAW] += own
        if resisted:
            rolled, damped = resistance_losses(law, step, q, scratch)
            losses.contacts[stripe, ROLLED_ON] += rolled
            losses.contacts[stripe, ROLLING_DASHPOT] += damped


@inline_kernel
def recall(contacts: Contacts, k: np.uint64, q: Index, resisted: bool, scratch: Floats) -> None:
    """Notes and memory of the listed pair k into the scratch, the latter into rows."""
    notes, memory = contacts.notes, contacts.memory
    scratch[ITS_DRAG + q] = notes[k, DRAG]
    if resisted:
        scale(scratch, SPRINGS_ROWS + q, 1.0, memory, TWO * k)
        scale(scratch, ROLLED_ROWS + q, 1.0, memory, TWO * k + ONE)
        scratch[ITS_ROLL_DRAG + q], scratch[ITS_TWIST_DRAG + q] = notes[k, ROLL_DRAG], notes[k, TWIST_DRAG]
    else:
        scale(scratch, SPRINGS_ROWS + q, 1.0, memory, k)


@inline_kernel
def remember(contacts: Contacts, k: np.uint64, q: Index, resisted: bool, keep: bool, scratch: Floats) -> None:
    """The listed pair's memory out of rows of the scratch; its force too if it is to be kept."""
    memory, force = contacts.memory, contacts.force
    if resisted:
        scale(memory, TWO * k, 1.0, scratch, SPRINGS_ROWS + q)
        scale(memory, TWO * k + ONE, 1.0, scratch, ROLLED_ROWS + q)
    else:
        scale(memory, k, 1.0, scratch, SPRINGS_ROWS + q)
    if keep:
        force[k, 0] = last(scratch, FS + q)
        force[k, 1], force[k, 2], force[k, 3] = vector(scratch, FS + q)


@inline_kernel
def memories_to_columns(scratch: Floats, resisted: bool, count: np.uint64) -> None:
    """What ``count`` contacts remember, from rows."""
    to_columns(scratch, SPRINGS, SPRINGS_ROWS, count)
    if resisted:
        to_columns(scratch, ROLLED, ROLLED_ROWS, count)


@inline_kernel
def results_to_rows(scratch: Floats, resisted: bool, count: np.uint64) -> None:
    """What the laws have found of ``count`` contacts, to rows."""
    to_rows(scratch, SPRINGS_ROWS, SPRINGS, count)
    to_rows(scratch, PUSH_ROWS, PUSH, count)
    to_rows(scratch, CROSSED_ROWS, CROSSED, count)
    if resisted:
        to_rows(scratch, MOMENT_ROWS, MOMENT, count)
        to_rows(scratch, ROLLED_ROWS, ROLLED, count)


@inline_kernel
def clear_kept(contacts: Contacts, begin: np.uint64, end: np.uint64) -> None:
    """No force of the listed pairs ``begin .. end-1``, until it is found."""
    for k in range(begin, end):
        for c in range(4):
            contacts.force[k, c] = 0.0


@inline_kernel
def holds(contacts: Contacts, k: np.uint64, overlap: float, q: np.uint64, scratch: Floats) -> bool:
    """Whether a listed pair touches, or its neck still holds, which goes to place q of the scratch; if it does not there is none."""
    neck = contacts.notes[k, NECK]
    touches = bool(overlap > min(0.0, -neck))
    scratch[ITS_NECK + q] = neck
    contacts.notes[k, NECK] = abs(neck) if touches else -abs(neck)
    return touches


@inline_kernel
def pick(state: State, pairs: Contacts, k: np.uint64, end: np.uint64, desk: Desk) -> tuple[np.uint64, np.uint64]:
    """The next listed pairs from k on that touch, a chunk of them at most, with their distances; the next k, and how many they are."""
    x, radius, scratch, picked = state.x, state.radius, desk.scratch, desk.picked
    rows, other, count = pairs.row, pairs.other, np.uint64(0)
    while k < end and count < NEXT:
        i, j = np.uint64(rows[k]), np.uint64(other[k])
        blend(scratch, D_ROWS + count, 1.0, x, j, -1.0, x, i)
        dx, dy, dz = xyz(scratch, D_ROWS + count)
        reach = radius[i] + radius[j]
        scratch[REACH + count] = reach
        picked[count] = k
        count += np.uint64(dx * dx + dy * dy + dz * dz < reach * reach)
        k += ONE
    return k, count


@inline_kernel
def pick_with_necks(
    state: State, pairs: Contacts, k: np.uint64, end: np.uint64, desk: Desk
) -> tuple[np.uint64, np.uint64]:
    """`pick` where a pair touches as long as its neck holds, too."""
    x, radius, scratch, picked = state.x, state.radius, desk.scratch, desk.picked
    rows, other, count = pairs.row, pairs.other, np.uint64(0)
    while k < end and count < NEXT:
        i, j = np.uint64(rows[k]), np.uint64(other[k])
        blend(scratch, D_ROWS + count, 1.0, x, j, -1.0, x, i)
        d = xyz(scratch, D_ROWS + count)
        reach = radius[i] + radius[j]
        scratch[REACH + count] = reach
        picked[count] = k
        count += np.uint64(holds(pairs, k, reach - sqrt(dot(d, d)), count, scratch))
        k += ONE
    return k, count


@fused_kernel
def forces_of_spheres(
    state: State, pairs: Contacts, laws: Floats, losses: Losses | None, step: Step, begin: int, end: int, desk: Desk
) -> None:
    """Add the forces of the listed pairs of the rows ``begin .. end-1``; update their memory.

    ``losses`` None: they are not counted, and the compiler leaves out whatever concerns them.
    """
    v, omega, radius, force, torque = state.v, state.omega, state.radius, state.force, state.torque
    rows, other, scratch, picked = pairs.row, pairs.other, desk.scratch, desk.picked
    resisted = pairs.memory.shape[1] > MEMORY_WIDTH
    sticky = pairs.notes.shape[1] == NOTES_WIDTH_STICKY
    first, end_of_list = np.uint64(pairs.start[begin]), np.uint64(pairs.start[end])
    if step.keep:
        clear_kept(pairs, first, end_of_list)
    k = first
    while k < end_of_list:
        if sticky:
            k, count = pick_with_necks(state, pairs, k, end_of_list, desk)
        else:
            k, count = pick(state, pairs, k, end_of_list, desk)
        for q in range(count):
            m = np.uint64(picked[q])
            i, j = np.uint64(rows[m]), np.uint64(other[m])
            blend(scratch, DV_ROWS + q, 1.0, v, i, -1.0, v, j)
            blend(scratch, ROLLS_ROWS + q, radius[i], omega, i, radius[j], omega, j)
            blend(scratch, SPINS_ROWS + q, 1.0, omega, i, 1.0, omega, j)
            if step.central:
                blend(scratch, DASHPOT_ROWS + q, 1.0, state.v_now, i, -1.0, state.v_now, j)
            if resisted:
                blend(scratch, TURNS_ROWS + q, 1.0, omega, i, -1.0, omega, j)
                if step.central:
                    blend(scratch, DASHPOT_TURNS_ROWS + q, 1.0, state.omega_now, i, -1.0, state.omega_now, j)
            recall(pairs, m, q, resisted, scratch)
        to_columns(scratch, D, D_ROWS, count)
        to_columns(scratch, DV, DV_ROWS, count)
        to_columns(scratch, ROLLS, ROLLS_ROWS, count)
        to_columns(scratch, SPINS, SPINS_ROWS, count)
        if resisted:
            to_columns(scratch, TURNS, TURNS_ROWS, count)
            if step.central:
                to_columns(scratch, DASHPOT_TURNS, DASHPOT_TURNS_ROWS, count)
            else:
                for c in range(np.uint64(3 * CHUNK)):
                    scratch[DASHPOT_TURNS + c] = scratch[TURNS + c]
        memories_to_columns(scratch, resisted, count)
        for c in range(np.uint64(3 * CHUNK)):
            scratch[D_BEFORE + c] = scratch[D + c] + step.slip_dt * scratch[DV + c]
        if step.central:
            to_columns(scratch, DASHPOT_DV, DASHPOT_ROWS, count)
        else:
            for c in range(np.uint64(3 * CHUNK)):
                scratch[DASHPOT_DV + c] = scratch[DV + c]
        if losses is not None:
            keep_memories(resisted, scratch)
        laws_of_chunk(pairs, laws, step.slip_dt, int(np.int64(count)), desk)
        if losses is not None:
            losses_of_chunk(pairs, laws, losses, step, False, int(np.int64(count)), desk)
        results_to_rows(scratch, resisted, count)
        for q in range(count):
            m = np.uint64(picked[q])
            i, j = np.uint64(rows[m]), np.uint64(other[m])
            arm_loss = scratch[ARM_LOSS + q]
            blend(force, i, 1.0, force, i, 1.0, scratch, PUSH_ROWS + q)
            blend(force, j, 1.0, force, j, -1.0, scratch, PUSH_ROWS + q)
            blend(torque, i, 1.0, torque, i, radius[i] - arm_loss, scratch, CROSSED_ROWS + q)
            blend(torque, j, 1.0, torque, j, radius[j] - arm_loss, scratch, CROSSED_ROWS + q)
            if resisted:
                blend(torque, i, 1.0, torque, i, -1.0, scratch, MOMENT_ROWS + q)
                blend(torque, j, 1.0, torque, j, 1.0, scratch, MOMENT_ROWS + q)
            remember(pairs, m, q, resisted, step.keep, scratch)


@inline_kernel
def first_from(pairs: Contacts, low: int, high: int, sphere: int) -> int:
    """First entry of ``low .. high-1`` whose sphere is not below ``sphere``; entries ascend."""
    while low < high:
        middle = (low + high) // 2
        if pairs.other[middle] < sphere:
            low = middle + 1
        else:
            high = middle
    return low


@inline_kernel
def above(table: Floats, w: int, place: Vector) -> float:
    """Height [m] of a place over a plane."""
    return dot(plus(place, -1.0, row(table, w, 0)), row(table, w, 3))


@inline_kernel
def at_rest(planes: Planes, w: int) -> bool:
    """Whether a plane stays where it is in this step."""
    rests = True
    for c in range(9, POSE_WIDTH):
        rests = rests and planes.middle[w, c] == 0.0 and planes.now[w, c] == 0.0
    for c in range(6):
        rests = rests and planes.before[w, c] == planes.now[w, c]
    return rests


@inline_kernel
def beside_plane(
    state: State, planes: Planes, contacts: Contacts, law: Floats, step: Step, moves: bool, w: int, k: np.uint64, q: np.uint64,
    scratch: Floats,
) -> tuple[float, bool]:  # fmt: skip
    """Differences and memory of the listed pair k to place q of the scratch, if it touches; its overlap [m], the radius if it is behind,
    and whether it touches."""
    i, slip_dt = np.uint64(contacts.other[k]), step.slip_dt
    xi, vi, ri = xyz(state.x, i), xyz(state.v, i), state.radius[i]
    height = above(planes.now, w, xi)
    overlap = ri - height
    touches, keeps = overlap > 0.0, False
    if contacts.notes.shape[1] == NOTES_WIDTH_STICKY:
        keeps = contacts.notes[k, NECK] > 0.0
        touches = holds(contacts, k, overlap, q, scratch)
    if height <= 0.0 or not touches:
        return float(overlap), False
    wi, wj, n = xyz(state.omega, i), row(planes.middle, w, 12), scaled(row(planes.now, w, 3), -1.0)
    seen = xyz(state.v_now, i) if step.central else vi
    before, height_before, vj, dashpot_vj = n, height + slip_dt * dot(vi, n), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    if moves:
        height_before, before = above(planes.before, w, plus(xi, -slip_dt, vi)), scaled(row(planes.before, w, 3), -1.0)
        # Where spheres have velocities of the half step, planes have theirs of its middle, about the pivot of its end.
        half, foot = 0.5 * slip_dt, plus(xi, height, n)
        vj = plane_velocity(planes.middle, w, foot, half)
        dashpot_vj = plane_velocity(planes.now, w, foot, 0.0) if step.central else vj
        mean_overlap = overlap
        shown = n
        if law[MIDDLE] > 0.0:
            if height_before < ri or keeps:
                both = (before[0] + n[0], before[1] + n[1], before[2] + n[2])
                shown = scaled(both, 1.0 / sqrt(dot(both, both)))
                mean_overlap = 0.5 * (overlap + ri - height_before)
            vj = plane_velocity(planes.middle, w, plus(plus(xi, -half, vi), ri - mean_overlap, shown), 0.0)
        # The plane's velocity is that of the very place: what its spin adds with the overlap's middle is taken back.
        vj = plus(vj, -0.5 * mean_overlap * law[SLIP_MID], cross(wj, shown))
    put(scratch, D + q, scaled(n, height))
    put(scratch, D_BEFORE + q, scaled(before, height_before))
    scratch[REACH + q] = ri
    put(scratch, DV + q, plus(vi, -1.0, vj))
    put(scratch, DASHPOT_DV + q, plus(seen, -1.0, dashpot_vj))
    put(scratch, ROLLS + q, scaled(wi, ri))
    put(scratch, SPINS + q, plus(wi, 1.0, wj))
    put(scratch, TURNS + q, plus(wi, -1.0, wj))
    spin_seen = wi
    if step.central and state.omega_now.shape[0] > 0:
        spin_seen, wj = xyz(state.omega_now, i), row(planes.now, w, 12)
    put(scratch, DASHPOT_TURNS + q, plus(spin_seen, -1.0, wj))
    recall(contacts, k, q, contacts.memory.shape[1] > MEMORY_WIDTH, scratch)
    return float(overlap), True


@fused_kernel
def forces_of_planes(
    state: State, planes: Planes, contacts: Contacts, laws: Floats, losses: Losses | None, step: Step, begin: int, end: int, desk: Desk
) -> None:  # fmt: skip
    """Add the forces of the contacts of the spheres ``begin .. end-1`` with planes, and the stripe's share of the planes' loads.

    ``losses`` as in `forces_of_spheres`.
    """
    force, torque, radius, share = state.force, state.torque, state.radius, state.share
    resisted = contacts.memory.shape[1] > MEMORY_WIDTH
    scratch, picked, slot = desk.scratch, desk.picked, desk.slot
    number = planes.now.shape[0]
    w, k, end_of_rows, moves = -1, np.uint64(0), np.uint64(0), False
    while w < number:
        count = np.uint64(0)
        while w < number and count < NEXT:
            if k == end_of_rows:
                w += 1
                if w < number:
                    k = np.uint64(first_from(contacts, contacts.start[w], contacts.start[w + 1], begin))
                    end_of_rows = np.uint64(first_from(contacts, int(np.int64(k)), contacts.start[w + 1], end))
                    moves = not at_rest(planes, w)
                    if step.keep:
                        clear_kept(contacts, k, end_of_rows)
                continue
            overlap, touches = beside_plane(
                state, planes, contacts, laws[contacts.law[k]], step, moves, w, k, count, scratch
            )
            if overlap >= radius[contacts.other[k]]:
                state.behind[slot, 0], state.behind[slot, 1] = 1 + state.name[contacts.other[k]], w
            elif touches:
                picked[count] = k
                count += np.uint64(1)
            k += np.uint64(1)
        memories_to_columns(scratch, resisted, count)
        if losses is not None:
            keep_memories(resisted, scratch)
        laws_of_chunk(contacts, laws, step.slip_dt, int(np.int64(count)), desk)
        if losses is not None:
            losses_of_chunk(contacts, laws, losses, step, True, int(np.int64(count)), desk)
        results_to_rows(scratch, resisted, count)
        for q in range(count):
            m = np.uint64(picked[q])
            i, plane = np.uint64(contacts.other[m]), np.uint64(contacts.row[m])
            push, arm = vector(scratch, PUSH + q), radius[i] - scratch[ARM_LOSS + q]
            blend(force, i, 1.0, force, i, 1.0, scratch, PUSH_ROWS + q)
            blend(torque, i, 1.0, torque, i, arm, scratch, CROSSED_ROWS + q)
            if resisted:
                blend(torque, i, 1.0, torque, i, -1.0, scratch, MOMENT_ROWS + q)
            for c in range(3):
                share[slot, plane, c] -= push[c]
            if losses is not None:
                moment = cross(plus(xyz(state.x, i), 1.0, vector(scratch, D + q)), scaled(push, -1.0))
                if resisted:
                    moment = plus(moment, 1.0, vector(scratch, MOMENT + q))
                for c in range(3):
                    losses.torque[slot, plane, c] += moment[c]
            remember(contacts, m, q, resisted, step.keep, scratch)
