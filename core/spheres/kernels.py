"""Kernels of the DEM of spheres: contacts, resistances, planes, and the steps.

Leapfrog: ``v_{n+1/2} = v_{n-1/2} + dt F_n/m``, ``x_{n+1} = x_n + dt v_{n+1/2}``, begun by half a kick.
"""

from __future__ import annotations

from math import cos, sin, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import inline_kernel, kernel

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
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
MEMORY_WIDTH = 12
"""Columns of what a contact remembers: normal (3), contact radius and overlap of the step before, shear spring (3), rolling torque (3),
twisting torque. A radius of 0 means that it was open."""

OK, FAR, BEHIND = 0, 1, 2
"""Why `advance` ended: all steps done, the list of neighbours is too old, a centre is behind a wall."""


class State(NamedTuple):
    """Bodies: n spheres and m planes. Rows of ``now`` are point, normal, pivot, its velocity, spin (3 each)."""

    x: Floats
    v: Floats
    omega: Floats
    angle: Floats
    v_now: Floats
    omega_now: Floats
    force: Floats
    torque: Floats
    inv_mass: Floats
    inv_inertia: Floats
    free: Floats
    radius: Floats
    now: Floats
    middle: Floats
    load: Floats
    built: Floats


class Contacts(NamedTuple):
    """Neighbours, k of them: bodies ``(k, 2)`` (the second one may be a wall, from n on), law, memory and forces ``(k, 4)`` (fn, fs)."""

    bodies: Integers
    law: Integers
    memory: Floats
    force: Floats


class Motion(NamedTuple):
    """Segments of the planes' motion: those of plane w are ``first[w] .. first[w+1]-1``; columns of ``row`` below."""

    first: Integers
    row: Floats


BEGIN, POINT, AXIS, PIVOT, VELOCITY, SPIN, AMPLITUDE, FREQUENCY, PHASE = 0, 1, 4, 7, 10, 13, 16, 19, 20
SEGMENT_WIDTH = 21
POSE_WIDTH = 15


@inline_kernel
def dot(a: Vector, b: Vector) -> float:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inline_kernel
def cross(a: Vector, b: Vector) -> Vector:
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inline_kernel
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


@inline_kernel
def carried(q: Vector, before: Vector, n: Vector) -> Vector:
    """A vector at right angles to ``before``, turned with the normal into ``n`` on the shortest way: its size stays to round-off."""
    share = dot(q, n) / (1.0 + dot(before, n))
    return plus(q, -share, (before[0] + n[0], before[1] + n[1], before[2] + n[2]))


@inline_kernel
def projected(q: Vector, n: Vector) -> Vector:
    """A vector's part at right angles to ``n``, stretched to the size that the vector had."""
    size = sqrt(dot(q, q))
    flat = plus(q, -dot(q, n), n)
    now = sqrt(dot(flat, flat))
    if now == 0.0:
        return flat
    return flat[0] * size / now, flat[1] * size / now, flat[2] * size / now


@inline_kernel
def capped(q: Vector, limit: float) -> Vector:
    """``q`` shortened to ``limit``."""
    size = sqrt(dot(q, q))
    if size <= limit or size == 0.0:
        return q
    return q[0] * limit / size, q[1] * limit / size, q[2] * limit / size


@inline_kernel
def note_open(contacts: Contacts, k: int) -> None:
    """Forget what a contact remembered; one that was open already costs no write."""
    if contacts.memory[k, RADIUS] != 0.0:
        contacts.memory[k, RADIUS] = 0.0
        for c in range(4):
            contacts.force[k, c] = 0.0


@kernel
def contact(state: State, contacts: Contacts, laws: Floats, k: int, central: bool, slip_dt: float) -> bool:
    """Add the forces of contact k; False if its sphere's centre is behind its plane."""
    n_spheres = state.x.shape[0]
    i, j = contacts.bodies[k, 0], contacts.bodies[k, 1]
    law, memory, at_wall = laws[contacts.law[k]], contacts.memory, j >= n_spheres
    w = j - n_spheres
    xi, ri = row(state.x, i, 0), state.radius[i]
    if at_wall:
        n = row(state.now, w, 3)
        n = (-n[0], -n[1], -n[2])
        height = -dot(plus(xi, -1.0, row(state.now, w, 0)), n)
        overlap, reduced = ri - height, ri
        if height <= 0.0:
            return False
    else:
        d = plus(row(state.x, j, 0), -1.0, xi)
        apart2 = dot(d, d)
        reach = ri + state.radius[j]
        if apart2 >= reach * reach:
            note_open(contacts, k)
            return True
        apart = sqrt(apart2)
        n = (d[0] / apart, d[1] / apart, d[2] / apart)
        overlap, reduced = reach - apart, ri * state.radius[j] / reach
        height = 0.0
    if overlap <= 0.0:
        note_open(contacts, k)
        return True
    middle = law[MIDDLE] > 0.0
    fresh = memory[k, RADIUS] == 0.0
    hertz = law[HERTZ] > 0.0
    radius = sqrt(reduced * overlap)
    before = n if fresh else row(memory, k, NORMAL)
    overlap_before = overlap if fresh else memory[k, OVERLAP]
    radius_before = radius if fresh else memory[k, RADIUS]
    inv_mass = state.inv_mass[i] + (0.0 if at_wall else state.inv_mass[j])
    # Normal force.
    stiffness = law[KN] * radius if hertz else law[KN]
    tangent = 1.5 * stiffness if hertz else stiffness
    damping = 0.0
    if law[BETA] > 0.0 and inv_mass > 0.0:
        damping = 2.0 * law[BETA] * sqrt(tangent / inv_mass) * (sqrt(5.0 / 6.0) if hertz else 1.0)
    vi = row(state.v_now if central else state.v, i, 0)
    foot = plus(xi, ri - overlap, n)
    # Where spheres have velocities of the half step, planes have theirs of its middle, about the pivot of its end.
    half = 0.5 * slip_dt
    vj = (0.0, 0.0, 0.0)
    if at_wall:
        vj = plane_velocity(state.now, w, foot, 0.0) if central else plane_velocity(state.middle, w, foot, half)
    else:
        vj = row(state.v_now if central else state.v, j, 0)
    closing = dot(plus(vi, -1.0, vj), n)
    pull = law[PULL] * reduced
    fn = stiffness * overlap + damping * closing - pull
    repulsive = max(fn + pull, 0.0)
    # Slip of the step that ends now.
    shown = n
    mean_overlap = overlap
    if middle:
        both = (before[0] + n[0], before[1] + n[1], before[2] + n[2])
        length = sqrt(dot(both, both))
        shown = (both[0] / length, both[1] / length, both[2] / length)
        mean_overlap = 0.5 * (overlap + overlap_before)
    cut = 0.5 * mean_overlap if law[SLIP_MID] > 0.0 else 0.0
    wi = row(state.omega, i, 0)
    if at_wall:
        wj = row(state.middle, w, 12)
        if middle:
            touched = plus(plus(xi, -half, row(state.v, i, 0)), ri - mean_overlap, shown)
            vj = plane_velocity(state.middle, w, touched, 0.0)
        else:
            vj = plane_velocity(state.middle, w, foot, half)
        u = plus(row(state.v, i, 0), -1.0, vj)
        u = plus(u, ri - cut, cross(wi, shown))
    else:
        wj = row(state.omega, j, 0)
        u = plus(row(state.v, i, 0), -1.0, row(state.v, j, 0))
        u = plus(plus(u, ri - cut, cross(wi, shown)), state.radius[j] - cut, cross(wj, shown))
    u = plus(u, -dot(u, shown), shown)
    # Memory turned into the present tangent plane; in the mid-step form also with the bodies' mean spin about the normal.
    rolls = law[ROLL] > 0.0
    spring, rolled = row(memory, k, SHEAR), row(memory, k, ROLLING)
    twisted = memory[k, TWISTING]
    if fresh:
        spring, rolled, twisted = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0
    if middle:
        spin = 0.5 * slip_dt * dot(plus(wi, 1.0, wj), shown)
        u = carried(u, shown, n)
        spring = carried(spring, before, n)
        if spin != 0.0:
            spring = turned(spring, n, spin)
        if rolls:
            rolled = turned(carried(rolled, before, n), n, spin)
    else:
        spring = projected(spring, n)
        if rolls:
            rolled = projected(rolled, n)
    ks = law[KS] * radius if hertz else law[KS]
    rule = int(law[UNLOADING])
    in_force = not hertz or rule == FORCE
    if not in_force and rule == RESCALE and radius < radius_before:
        share = radius / radius_before
        spring = (spring[0] * share, spring[1] * share, spring[2] * share)
    gain = 1.0
    if in_force:
        gain = law[KS] * 0.5 * (radius + radius_before) if hertz and middle else ks
    spring = plus(spring, -gain * slip_dt, u)
    cap = law[MU] * repulsive
    if in_force:
        spring = capped(spring, cap)
        fs = spring
    else:
        spring = capped(spring, cap / ks if ks > 0.0 else 0.0)
        fs = (ks * spring[0], ks * spring[1], ks * spring[2])
    # Resistances: torque -(rolled + damped) - (twisted) n on the first body.
    relative = plus(wi, -1.0, wj)
    about = dot(relative, n)
    across = plus(relative, -about, n)
    m = (0.0, 0.0, 0.0)
    if rolls:
        limit = law[ROLL + 1] * reduced * repulsive
        if law[ROLL] == CONSTANT:
            rolled = capped((across[0] * STEEP, across[1] * STEEP, across[2] * STEEP), limit)
            m = rolled
        else:
            rolled = plus(rolled, law[ROLL + 2] * slip_dt, across)
            free = dot(rolled, rolled) < limit * limit
            rolled = capped(rolled, limit)
            m = rolled
            if free and law[ROLL + 3] > 0.0:
                inv = about_contact(state, i)
                if not at_wall:
                    inv += about_contact(state, j)
                if inv > 0.0:
                    m = plus(m, 2.0 * law[ROLL + 3] * sqrt(law[ROLL + 2] / inv), across)
    if law[TWIST] > 0.0:
        limit = law[TWIST + 1] * reduced * repulsive
        torque = 0.0
        if law[TWIST] == CONSTANT:
            twisted = min(max(STEEP * about, -limit), limit)
            torque = twisted
        else:
            twisted += law[TWIST + 2] * slip_dt * about
            free = abs(twisted) < limit
            twisted = min(max(twisted, -limit), limit)
            torque = twisted
            inv = state.inv_inertia[i] + (0.0 if at_wall else state.inv_inertia[j])
            if free and inv > 0.0:
                torque += 2.0 * law[TWIST + 3] * sqrt(law[TWIST + 2] / inv) * about
        m = plus(m, torque, n)
    # Sums.
    f = plus(fs, -fn, n)
    arm = 0.5 * overlap if law[TORQUE_MID] > 0.0 else 0.0
    twist = cross(n, fs)
    for c in range(3):
        state.force[i, c] += f[c]
        state.torque[i, c] += (ri - arm) * twist[c] - m[c]
        if at_wall:
            state.load[w, c] -= f[c]
        else:
            state.force[j, c] -= f[c]
            state.torque[j, c] += (state.radius[j] - arm) * twist[c] + m[c]
        memory[k, NORMAL + c] = n[c]
        memory[k, SHEAR + c] = spring[c]
        if rolls:
            memory[k, ROLLING + c] = rolled[c]
        contacts.force[k, 1 + c] = fs[c]
    contacts.force[k, 0] = fn
    memory[k, RADIUS], memory[k, OVERLAP], memory[k, TWISTING] = radius, overlap, twisted
    return True


STEEP = 1e30
"""Torque over spin [N m s] below the limit of a constant torque, which makes it the limit wherever anything turns."""


@inline_kernel
def about_contact(state: State, i: int) -> float:
    """``1/(I + m R^2)`` of a sphere about its contact [1/(kg m^2)]; 0 where it is fixed or does not turn."""
    a, b = state.inv_inertia[i], state.inv_mass[i]
    return a * b / (b + a * state.radius[i] * state.radius[i]) if b > 0.0 else 0.0


@kernel
def forces(
    state: State,
    contacts: Contacts,
    laws: Floats,
    motion: Motion,
    gravity: Vector,
    t: float,
    dt: float,
    slip_dt: float,
    central: bool,
) -> int:
    """Forces and torques at ``t`` [s], contact by contact in the order of the list; -1, or the contact whose sphere is behind its plane."""
    place_planes(motion, t, state.now)
    place_planes(motion, max(t - 0.5 * dt, 0.0), state.middle)
    for i in range(state.x.shape[0]):
        weight = 1.0 / state.inv_mass[i] if state.inv_mass[i] > 0.0 else 0.0
        for c in range(3):
            state.force[i, c] = weight * gravity[c]
            state.torque[i, c] = 0.0
    for w in range(state.load.shape[0]):
        for c in range(3):
            state.load[w, c] = 0.0
    for k in range(contacts.bodies.shape[0]):
        if not contact(state, contacts, laws, k, central, slip_dt):
            return k
    return -1


@kernel
def advance(
    state: State,
    contacts: Contacts,
    laws: Floats,
    motion: Motion,
    gravity: Vector,
    clock: Integers,
    target: int,
    dt: float,
    skin: float,
    central: bool,
) -> int:
    """Steps until ``clock[0]`` is ``target``; `FAR` before a step that wants new neighbours, `BEHIND` with the contact in ``clock[1]``."""
    while clock[0] < target:
        kick = dt if clock[0] > 0 else 0.5 * dt
        farthest = 0.0
        for i in range(state.x.shape[0]):
            moved = 0.0
            for c in range(3):
                gain = kick * state.free[i, c] * state.inv_mass[i] * state.force[i, c]
                state.v[i, c] += gain
                turn = kick * state.inv_inertia[i] * state.torque[i, c]
                state.omega[i, c] += turn
                state.x[i, c] += dt * state.v[i, c]
                state.angle[i, c] += dt * state.omega[i, c]
                half = 0.5 * dt / kick
                state.v_now[i, c] = state.v[i, c] + half * gain
                state.omega_now[i, c] = state.omega[i, c] + half * turn
                away = state.x[i, c] - state.built[i, c]
                moved += away * away
            farthest = max(farthest, moved)
        clock[0] += 1
        if 4.0 * farthest >= skin * skin:
            return FAR
        behind = forces(state, contacts, laws, motion, gravity, clock[0] * dt, dt, dt, central)
        if behind >= 0:
            clock[1] = behind
            return BEHIND
    return OK
