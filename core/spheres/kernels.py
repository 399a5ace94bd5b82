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

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Numbers = NDArray[np.uint32]
Vector = tuple[float, float, float]

HERTZ, KN, KS, MU, BETA, TORQUE_MID, SLIP_MID, MIDDLE, UNLOADING, PULL = range(10)
"""Columns of a law: whether it is Hertz'; ``kn`` [N/m] or ``(4/3) E*`` [Pa]; ``ks`` or ``8 G*``; mu; beta; whether the torque's arm ends in
the middle of the overlap, the slip's too; whether slip is that of mid-step; the rule of unloading; pull over the reduced radius [N/m]."""
ROLL, TWIST = 10, 14
"""First columns of the two resistances, four each: model, mu, stiffness [N m/rad], damping ratio."""
LAW_WIDTH = 18

NO_RESISTANCE, CONSTANT, SPRING = 0, 1, 2
KEEPS, FORCE, RESCALE = 0, 1, 2
"""Rules of unloading: the spring keeps its displacement, its force, or shrinks with the contact."""

NORMAL, RADIUS, OVERLAP, SHEAR, ROLLING, TWISTING = 0, 3, 4, 5, 8, 11
MEMORY_WIDTH, MEMORY_WIDTH_RESISTED = 8, 12
"""Columns of what a contact remembers: normal (3), contact radius and overlap of the step before, shear spring (3); with a resistance
also rolling torque (3), twisting torque. A radius of 0 means that it was open."""

REDUCED, DRAG, ROLL_DRAG, TWIST_DRAG = range(4)
NOTES_WIDTH, NOTES_WIDTH_RESISTED = 2, 4
"""Columns of what is noted of a listed pair: reduced radius; coefficients of its dashpots: along the normal [N s/m], with Hertz' law over
the root of the contact radius, and of the resistances [N m s]."""

CHUNK = 64
"""Listed pairs that go through the loops together."""


class State(NamedTuple):
    """Bodies: n spheres and m planes; s stripes.

    Spheres are in the order of their rows, which ``name`` tells in the scene's numbers. ``mobility`` is 1/m of the components that are not
    held, ``v_now`` has the velocities that dashpots see where these are not ``v``. Rows of ``now`` (at t_n) and ``middle`` (at
    t_{n-1/2}) are point, normal, pivot, its velocity, spin of a plane (3 each). ``load`` is the force on each plane, ``share`` what the
    stripes add to it, ``behind`` tells for each stripe 1 + sphere and plane where a centre is behind one.
    """

    x: Floats
    v: Floats
    omega: Floats
    angle: Floats
    v_now: Floats
    force: Floats
    torque: Floats
    mass: Floats
    mobility: Floats
    inv_mass: Floats
    inv_inertia: Floats
    radius: Floats
    name: Integers
    now: Floats
    middle: Floats
    load: Floats
    share: Floats
    behind: Integers
    built: Floats


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


@fused_inline_kernel
def spun(q: Vector, n: Vector, angle: float) -> Vector:
    """``q``, at right angles to the unit vector ``n``, turned about it by an angle [rad].

    Vector registers know no sine: that of an eighth of the angle, after whole turns have been taken off, by its series to 6e-19, and
    three times the formulas of the double angle.
    """
    turns = floor(angle / TURN + 0.5)
    a = 0.125 * (angle - turns * TURN - turns * TURN_REST)
    a2 = a * a
    s = a * (
        1.0
        - a2 / 6.0 * (1.0 - a2 / 20.0 * (1.0 - a2 / 42.0 * (1.0 - a2 / 72.0 * (1.0 - a2 / 110.0 * (1.0 - a2 / 156.0)))))
    )
    c = 1.0 - a2 / 2.0 * (
        1.0 - a2 / 12.0 * (1.0 - a2 / 30.0 * (1.0 - a2 / 56.0 * (1.0 - a2 / 90.0 * (1.0 - a2 / 132.0))))
    )
    for _ in range(3):
        s, c = 2.0 * s * c, 1.0 - 2.0 * s * s
    return plus(scaled(q, c), s, cross(n, q))


class Law(NamedTuple):
    """What `contact` reads of a law, columns above."""

    kn: float
    ks: float
    mu: float
    slip_mid: float
    unloading: float
    pull: float


@inline_kernel
def law_of(law: Floats) -> Law:
    """Numbers of a row of the laws: loops that write to the scratch then need not read the row again."""
    return Law(law[KN], law[KS], law[MU], law[SLIP_MID], law[UNLOADING], law[PULL])


@fused_inline_kernel
def contact(
    hertz: bool,
    middle: bool,
    law: Law,
    slip_dt: float,
    d: Vector,
    reach: float,
    reduced: float,
    drag: float,
    dv: Vector,
    dashpot_dv: Vector,
    roll: Vector,
    spin: Vector,
    before: Vector,
    radius_before: float,
    overlap_before: float,
    spring: Vector,
) -> tuple[float, float, Vector, Vector, Vector, float, float]:
    """The law of one contact without its resistances; the first two arguments are those of the law, known to the compiler.

    Parameters
    ----------
    d : vector
        From the first centre to the second one [m].
    reach, reduced : float
        Sum of the radii and reduced radius [m].
    drag : float
        `DRAG` of its notes.
    dv, dashpot_dv : vector
        Velocity of the first centre relative to the second one [m/s], and that which the dashpot sees.
    roll, spin : vector
        ``R_i w_i + R_j w_j`` [m/s] and ``w_i + w_j`` [rad/s].
    before, radius_before, overlap_before, spring
        Its memory; a contact radius of 0 if it was open.

    Returns
    -------
    fn, repulsive : float
        Normal force and its repulsive part [N].
    fs, spring, n : vector
        Shear force on the first body [N], spring to be remembered, normal.
    radius, overlap : float
        [m]
    """
    apart = sqrt(dot(d, d))
    n = scaled(d, 1.0 / apart)
    overlap = reach - apart
    radius = sqrt(reduced * overlap)
    if radius_before == 0.0:
        before, overlap_before, radius_before, spring = n, overlap, radius, (0.0, 0.0, 0.0)
    stiffness, damping, ks = law.kn, drag, law.ks
    if hertz:
        stiffness, damping, ks = law.kn * radius, drag * sqrt(radius), law.ks * radius
    spring_force = stiffness * overlap
    repulsive = max(spring_force + damping * dot(dashpot_dv, n), 0.0)
    fn = spring_force + damping * dot(dashpot_dv, n) - law.pull * reduced
    # Slip of the step that ends now.
    shown, mean_overlap = n, overlap
    if middle:
        both = (before[0] + n[0], before[1] + n[1], before[2] + n[2])
        shown = scaled(both, 1.0 / sqrt(dot(both, both)))
        mean_overlap = 0.5 * (overlap + overlap_before)
    cut = 0.5 * mean_overlap * law.slip_mid
    u = plus(dv, 1.0, cross(plus(roll, -cut, spin), shown))
    u = plus(u, -dot(u, shown), shown)
    # Spring turned into the present tangent plane; in the mid-step form also with the bodies' mean spin about the normal.
    if middle:
        u = carried(u, shown, n)
        spring = spun(carried(spring, before, n), n, 0.5 * slip_dt * dot(spin, shown))
    else:
        spring = projected(spring, n)
    in_force = True
    gain = ks
    if hertz:
        in_force = law.unloading == FORCE
        shrinks = law.unloading == RESCALE and radius < radius_before
        spring = scaled(spring, radius / radius_before if shrinks else 1.0)
        if middle:
            gain = law.ks * 0.5 * (radius + radius_before)
    cap = law.mu * repulsive
    soft = 1.0 / ks if ks > 0.0 else 0.0
    spring = plus(spring, -slip_dt * (gain if in_force else 1.0), u)
    spring = capped(spring, cap if in_force else cap * soft)
    fs = scaled(spring, 1.0 if in_force else ks)
    return fn, repulsive, fs, spring, n, radius, overlap


STEEP = 1e30
"""Torque over spin [N m s] below the limit of a constant torque, which makes it the limit wherever anything turns."""


@inline_kernel
def resistance(
    law: Floats,
    slip_dt: float,
    n: Vector,
    before: Vector,
    reduced: float,
    repulsive: float,
    roll_drag: float,
    twist_drag: float,
    spin: Vector,
    turn: Vector,
    rolled: Vector,
    twisted: float,
) -> tuple[Vector, Vector, float]:
    """Torque of both resistances on the second body [N m], and what is remembered of them.

    ``spin`` and ``turn`` are the sum of the spins and the first one relative to the second one [rad/s].
    """
    about = dot(turn, n)
    across = plus(turn, -about, n)
    m = (0.0, 0.0, 0.0)
    if law[ROLL] > 0.0:
        if law[MIDDLE] > 0.0:
            both = (before[0] + n[0], before[1] + n[1], before[2] + n[2])
            shown = scaled(both, 1.0 / sqrt(dot(both, both)))
            rolled = spun(carried(rolled, before, n), n, 0.5 * slip_dt * dot(spin, shown))
        else:
            rolled = projected(rolled, n)
        limit = law[ROLL + 1] * reduced * repulsive
        if law[ROLL] == CONSTANT:
            rolled = capped(scaled(across, STEEP), limit)
            m = rolled
        else:
            rolled = plus(rolled, law[ROLL + 2] * slip_dt, across)
            free = dot(rolled, rolled) < limit * limit
            rolled = capped(rolled, limit)
            m = plus(rolled, roll_drag if free else 0.0, across)
    if law[TWIST] > 0.0:
        limit = law[TWIST + 1] * reduced * repulsive
        if law[TWIST] == CONSTANT:
            twisted = min(max(STEEP * about, -limit), limit)
            torque = twisted
        else:
            twisted += law[TWIST + 2] * slip_dt * about
            free = abs(twisted) < limit
            twisted = min(max(twisted, -limit), limit)
            torque = twisted + (twist_drag * about if free else 0.0)
        m = plus(m, torque, n)
    return m, rolled, twisted


# Where the scratch holds, for each contact: differences of its bodies as `contact` wants them, its notes, its memory.
D, REACH, DV, DASHPOT_DV, ROLLS, SPINS = (np.uint64(c * CHUNK) for c in (0, 3, 4, 7, 10, 13))
ITS_REDUCED, ITS_DRAG, BEFORE, RADIUS_BEFORE, OVERLAP_BEFORE, SPRING_BEFORE = (
    np.uint64(c * CHUNK) for c in (16, 17, 18, 21, 22, 23)
)
# What the law finds: force on the first body, n x fs, present normal, fs, fn and its repulsive part.
PUSH, CROSSED, N, FS, FN, REPULSIVE = (np.uint64(c * CHUNK) for c in (26, 29, 32, 35, 38, 39))
# Resistances: spin of the first body relative to the second one, torque on the latter, memory, dashpots.
TURNS, MOMENT, ROLLED, TWISTED, ITS_ROLL_DRAG, ITS_TWIST_DRAG = (np.uint64(c * CHUNK) for c in (40, 43, 46, 49, 50, 51))
SCRATCH = 52 * CHUNK
ONE, TWO = np.uint64(CHUNK), np.uint64(2 * CHUNK)
"""From a vector's first column to its second and third one."""


@fused_inline_kernel
def vector(scratch: Floats, at: np.uint64) -> Vector:
    """A vector of the scratch."""
    return scratch[at], scratch[at + ONE], scratch[at + TWO]


@fused_inline_kernel
def put(scratch: Floats, at: np.uint64, a: Vector) -> None:
    """Write a vector into the scratch."""
    scratch[at], scratch[at + ONE], scratch[at + TWO] = a


@inline_kernel
def run_of_contacts(
    hertz: bool, middle: bool, law: Floats, slip_dt: float, begin: int, end: int, scratch: Floats
) -> None:
    """`contact` for ``begin .. end-1`` of the scratch, which have the same law."""
    its = law_of(law)
    for q in range(np.uint64(begin), np.uint64(end)):
        fn, repulsive, fs, spring, n, radius, overlap = contact(
            hertz,
            middle,
            its,
            slip_dt,
            vector(scratch, D + q),
            scratch[REACH + q],
            scratch[ITS_REDUCED + q],
            scratch[ITS_DRAG + q],
            vector(scratch, DV + q),
            vector(scratch, DASHPOT_DV + q),
            vector(scratch, ROLLS + q),
            vector(scratch, SPINS + q),
            vector(scratch, BEFORE + q),
            scratch[RADIUS_BEFORE + q],
            scratch[OVERLAP_BEFORE + q],
            vector(scratch, SPRING_BEFORE + q),
        )
        put(scratch, PUSH + q, plus(fs, -fn, n))
        put(scratch, CROSSED + q, cross(n, fs))
        put(scratch, N + q, n)
        put(scratch, FS + q, fs)
        put(scratch, SPRING_BEFORE + q, spring)
        scratch[FN + q], scratch[REPULSIVE + q] = fn, repulsive
        scratch[RADIUS_BEFORE + q], scratch[OVERLAP_BEFORE + q] = radius, overlap


@inline_kernel
def run_of_resistances(law: Floats, slip_dt: float, begin: int, end: int, scratch: Floats) -> None:
    """`resistance` for ``begin .. end-1`` of the scratch, after `run_of_contacts`."""
    for q in range(np.uint64(begin), np.uint64(end)):
        n, before = vector(scratch, N + q), vector(scratch, BEFORE + q)
        m, rolled, twisted = resistance(
            law,
            slip_dt,
            n,
            n if dot(before, before) == 0.0 else before,
            scratch[ITS_REDUCED + q],
            scratch[REPULSIVE + q],
            scratch[ITS_ROLL_DRAG + q],
            scratch[ITS_TWIST_DRAG + q],
            vector(scratch, SPINS + q),
            vector(scratch, TURNS + q),
            vector(scratch, ROLLED + q),
            scratch[TWISTED + q],
        )
        put(scratch, MOMENT + q, m)
        put(scratch, ROLLED + q, rolled)
        scratch[TWISTED + q] = twisted


@inline_kernel
def laws_of_chunk(
    contacts: Contacts, laws: Floats, slip_dt: float, picked: Integers, count: int, scratch: Floats
) -> None:
    """Both laws for the first ``count`` contacts of the scratch, run by run."""
    resisted = contacts.memory.shape[1] > MEMORY_WIDTH
    begin = 0
    while begin < count:
        number = contacts.law[picked[begin]]
        end = count
        if laws.shape[0] > 1:
            end = begin + 1
            while end < count and contacts.law[picked[end]] == number:
                end += 1
        law = laws[number]
        if law[HERTZ] > 0.0:
            if law[MIDDLE] > 0.0:
                run_of_contacts(True, True, law, slip_dt, begin, end, scratch)
            else:
                run_of_contacts(True, False, law, slip_dt, begin, end, scratch)
        elif law[MIDDLE] > 0.0:
            run_of_contacts(False, True, law, slip_dt, begin, end, scratch)
        else:
            run_of_contacts(False, False, law, slip_dt, begin, end, scratch)
        if resisted:
            run_of_resistances(law, slip_dt, begin, end, scratch)
        begin = end


@inline_kernel
def recall(contacts: Contacts, k: np.uint64, q: np.uint64, scratch: Floats) -> None:
    """Notes and memory of the listed pair k into the scratch."""
    notes, memory = contacts.notes, contacts.memory
    scratch[ITS_REDUCED + q], scratch[ITS_DRAG + q] = notes[k, REDUCED], notes[k, DRAG]
    put(scratch, BEFORE + q, row(memory, k, NORMAL))
    put(scratch, SPRING_BEFORE + q, row(memory, k, SHEAR))
    scratch[RADIUS_BEFORE + q], scratch[OVERLAP_BEFORE + q] = memory[k, RADIUS], memory[k, OVERLAP]
    if memory.shape[1] > MEMORY_WIDTH:
        scratch[ITS_ROLL_DRAG + q], scratch[ITS_TWIST_DRAG + q] = notes[k, ROLL_DRAG], notes[k, TWIST_DRAG]
        if memory[k, RADIUS] > 0.0:
            put(scratch, ROLLED + q, row(memory, k, ROLLING))
            scratch[TWISTED + q] = memory[k, TWISTING]
        else:
            put(scratch, BEFORE + q, (0.0, 0.0, 0.0))
            put(scratch, ROLLED + q, (0.0, 0.0, 0.0))
            scratch[TWISTED + q] = 0.0


@inline_kernel
def remember(contacts: Contacts, k: np.uint64, q: np.uint64, keep: bool, scratch: Floats) -> None:
    """The listed pair's memory out of the scratch; its force too if it is to be kept."""
    memory, force = contacts.memory, contacts.force
    for c in range(3):
        at = q + np.uint64(c * CHUNK)
        memory[k, NORMAL + c] = scratch[N + at]
        memory[k, SHEAR + c] = scratch[SPRING_BEFORE + at]
    memory[k, RADIUS], memory[k, OVERLAP] = scratch[RADIUS_BEFORE + q], scratch[OVERLAP_BEFORE + q]
    if memory.shape[1] > MEMORY_WIDTH:
        for c in range(3):
            memory[k, ROLLING + c] = scratch[ROLLED + q + np.uint64(c * CHUNK)]
        memory[k, TWISTING] = scratch[TWISTED + q]
    if keep:
        force[k, 0] = scratch[FN + q]
        for c in range(3):
            force[k, 1 + c] = scratch[FS + q + np.uint64(c * CHUNK)]


@inline_kernel
def forget(contacts: Contacts, k: np.uint64, keep: bool) -> None:
    """Note that a listed pair is open; one that was open already costs no write."""
    if contacts.memory[k, RADIUS] != 0.0:
        contacts.memory[k, RADIUS] = 0.0
    if keep:
        for c in range(4):
            contacts.force[k, c] = 0.0


@fused_kernel
def forces_of_spheres(
    state: State,
    pairs: Contacts,
    laws: Floats,
    slip_dt: float,
    central: bool,
    keep: bool,
    begin: int,
    end: int,
    scratch: Floats,
    picked: Integers,
) -> None:
    """Add the forces of the listed pairs of the rows ``begin .. end-1``; update their memory.

    Parameters
    ----------
    slip_dt : float
        Time over which slip accumulates [s]: ``dt``, or 0 for the forces at time 0.
    central : bool
        Whether dashpots see ``v_now``.
    keep : bool
        Whether the forces of the contacts are to be kept.
    scratch : ndarray, shape (SCRATCH,)
    picked : ndarray of int64, shape (2 * CHUNK,)
        This thread's own, as the scratch.
    """
    x, v, omega, radius, force, torque = state.x, state.v, state.omega, state.radius, state.force, state.torque
    rows, other = pairs.row, pairs.other
    resisted = pairs.memory.shape[1] > MEMORY_WIDTH
    last = np.uint64(pairs.start[end])
    for low in range(np.uint64(pairs.start[begin]), last, np.uint64(CHUNK)):
        high = min(low + np.uint64(CHUNK), last)
        count, opened = np.uint64(0), np.uint64(CHUNK)
        for k in range(low, high):
            i, j = np.uint64(rows[k]), np.uint64(other[k])
            dx, dy, dz = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
            reach = radius[i] + radius[j]
            put(scratch, D + count, (dx, dy, dz))
            scratch[REACH + count] = reach
            picked[count], picked[opened] = k, k
            touches = np.uint64(dx * dx + dy * dy + dz * dz < reach * reach)
            count += touches
            opened += np.uint64(1) - touches
        for m in range(np.uint64(CHUNK), opened):
            forget(pairs, np.uint64(picked[m]), keep)
        for q in range(count):
            k = np.uint64(picked[q])
            i, j = np.uint64(rows[k]), np.uint64(other[k])
            ri, rj = radius[i], radius[j]
            for c in range(3):
                at = q + np.uint64(c * CHUNK)
                wi, wj = omega[i, c], omega[j, c]
                scratch[DV + at] = v[i, c] - v[j, c]
                scratch[ROLLS + at], scratch[SPINS + at] = ri * wi + rj * wj, wi + wj
                scratch[DASHPOT_DV + at] = state.v_now[i, c] - state.v_now[j, c] if central else v[i, c] - v[j, c]
                if resisted:
                    scratch[TURNS + at] = wi - wj
            recall(pairs, k, q, scratch)
        laws_of_chunk(pairs, laws, slip_dt, picked, np.int64(count), scratch)
        for q in range(count):
            k = np.uint64(picked[q])
            i, j = np.uint64(rows[k]), np.uint64(other[k])
            arm = 0.5 * scratch[OVERLAP_BEFORE + q] * laws[pairs.law[k], TORQUE_MID]
            arm_i, arm_j = radius[i] - arm, radius[j] - arm
            for c in range(3):
                at = q + np.uint64(c * CHUNK)
                push, crossed = scratch[PUSH + at], scratch[CROSSED + at]
                force[i, c] += push
                force[j, c] -= push
                torque[i, c] += arm_i * crossed
                torque[j, c] += arm_j * crossed
                if resisted:
                    torque[i, c] -= scratch[MOMENT + at]
                    torque[j, c] += scratch[MOMENT + at]
            remember(pairs, k, q, keep, scratch)


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
def beside_plane(
    state: State,
    contacts: Contacts,
    law: Floats,
    slip_dt: float,
    central: bool,
    w: int,
    k: np.uint64,
    q: np.uint64,
    scratch: Floats,
) -> float:
    """Differences and memory of the listed pair k to place q of the scratch, if it touches; its overlap [m], the radius if it is behind."""
    i = np.uint64(contacts.other[k])
    xi, vi, wi, ri = row(state.x, i, 0), row(state.v, i, 0), row(state.omega, i, 0), state.radius[i]
    n = scaled(row(state.now, w, 3), -1.0)
    height = -dot(plus(xi, -1.0, row(state.now, w, 0)), n)
    overlap = ri - height
    if overlap <= 0.0 or height <= 0.0:
        return overlap
    foot, wj = plus(xi, height, n), row(state.middle, w, 12)
    # Where spheres have velocities of the half step, planes have theirs of its middle, about the pivot of its end.
    half = 0.5 * slip_dt
    vj = plane_velocity(state.middle, w, foot, half)
    seen, dashpot_vj = vi, vj
    if central:
        seen, dashpot_vj = row(state.v_now, i, 0), plane_velocity(state.now, w, foot, 0.0)
    mean_overlap = overlap
    shown = n
    fresh = contacts.memory[k, RADIUS] == 0.0
    if law[MIDDLE] > 0.0:
        before = n if fresh else row(contacts.memory, k, NORMAL)
        both = (before[0] + n[0], before[1] + n[1], before[2] + n[2])
        shown = scaled(both, 1.0 / sqrt(dot(both, both)))
        mean_overlap = 0.5 * (overlap + (overlap if fresh else contacts.memory[k, OVERLAP]))
        vj = plane_velocity(state.middle, w, plus(plus(xi, -half, vi), ri - mean_overlap, shown), 0.0)
    # The plane's velocity is that of the very place: what its spin adds with the overlap's middle is taken back.
    cut = 0.5 * mean_overlap * law[SLIP_MID]
    vj = plus(vj, -cut, cross(wj, shown))
    put(scratch, D + q, scaled(n, height))
    scratch[REACH + q] = ri
    put(scratch, DV + q, plus(vi, -1.0, vj))
    put(scratch, DASHPOT_DV + q, plus(seen, -1.0, dashpot_vj))
    put(scratch, ROLLS + q, scaled(wi, ri))
    put(scratch, SPINS + q, plus(wi, 1.0, wj))
    put(scratch, TURNS + q, plus(wi, -1.0, wj))
    recall(contacts, k, q, scratch)
    return overlap


@fused_kernel
def forces_of_planes(
    state: State,
    contacts: Contacts,
    laws: Floats,
    slip_dt: float,
    central: bool,
    keep: bool,
    begin: int,
    end: int,
    stripe: int,
    scratch: Floats,
    picked: Integers,
) -> None:
    """Add the forces of the contacts of the spheres ``begin .. end-1`` with planes, and the stripe's share of the planes' loads.

    Parameters are those of `forces_of_spheres`.
    """
    force, torque, radius, share = state.force, state.torque, state.radius, state.share
    resisted = contacts.memory.shape[1] > MEMORY_WIDTH
    for w in range(state.now.shape[0]):
        last = contacts.start[w + 1]
        k = np.uint64(first_from(contacts, contacts.start[w], last, begin))
        last = first_from(contacts, np.int64(k), last, end)
        while k < np.uint64(last):
            high = min(k + np.uint64(CHUNK), np.uint64(last))
            count = np.uint64(0)
            while k < high:
                law = laws[contacts.law[k]]
                i = np.uint64(contacts.other[k])
                overlap = beside_plane(state, contacts, law, slip_dt, central, w, k, count, scratch)
                if overlap >= radius[i]:
                    state.behind[stripe, 0], state.behind[stripe, 1] = 1 + state.name[i], w
                elif overlap > 0.0:
                    picked[count] = k
                    count += np.uint64(1)
                else:
                    forget(contacts, k, keep)
                k += np.uint64(1)
            laws_of_chunk(contacts, laws, slip_dt, picked, np.int64(count), scratch)
            for q in range(count):
                m = np.uint64(picked[q])
                i = np.uint64(contacts.other[m])
                arm = radius[i] - 0.5 * scratch[OVERLAP_BEFORE + q] * laws[contacts.law[m], TORQUE_MID]
                for c in range(3):
                    at = q + np.uint64(c * CHUNK)
                    force[i, c] += scratch[PUSH + at]
                    torque[i, c] += arm * scratch[CROSSED + at]
                    share[stripe, w, c] -= scratch[PUSH + at]
                    if resisted:
                        torque[i, c] -= scratch[MOMENT + at]
                remember(contacts, m, q, keep, scratch)
