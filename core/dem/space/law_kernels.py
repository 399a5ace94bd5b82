"""The contact law of spheres: normal force, shear spring, resistances to rolling and twisting, and what they take of the energy."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from ninedisk.core.compile import fused_inline_kernel, inline_kernel
from ninedisk.core.dem.space.scratch_kernels import (
    D_BEFORE,
    DASHPOT_DV,
    DASHPOT_TURNS,
    DV,
    FS,
    ITS_DRAG,
    ITS_NECK,
    ITS_ROLL_DRAG,
    ITS_TWIST_DRAG,
    MOMENT,
    OLD_ROLLED,
    OLD_SPRINGS,
    REACH,
    REPULSIVE,
    ROLLED,
    ROLLS,
    SPINS,
    SPRINGS,
    TURNS,
    D,
    get_extra,
    vector,
)
from ninedisk.core.dem.space.state import (
    CONSTANT,
    FORCE,
    HELD,
    HERTZ,
    KN,
    KS,
    LEAST,
    MIDDLE,
    MU,
    PULL,
    RESCALE,
    ROLL,
    SLIP_MID,
    SPRING,
    STICKS,
    TORQUE_MID,
    TWIST,
    UNLOADING,
    VISCOUS,
    Floats,
    Index,
    Step,
    Vector,
)
from ninedisk.core.dem.space.vector_kernels import capped, carried, cross, dot, half_spun, plus, projected, scaled, spun


class Law(NamedTuple):
    """What `contact` reads of a law, columns of `ninedisk.core.dem.space.state`."""

    kn: float
    ks: float
    mu: float
    torque_mid: float
    slip_mid: float
    rescale: bool
    pull: float
    held: float
    least: float


@inline_kernel
def law_of(law: Floats) -> Law:
    """Numbers of a row of the laws: loops that write to the scratch then need not read the row again."""
    return Law(
        law[KN],
        law[KS],
        law[MU],
        law[TORQUE_MID],
        law[SLIP_MID],
        law[UNLOADING] == RESCALE,
        law[PULL],
        law[HELD],
        law[LEAST],
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
        What it remembers [N or m]; is ignored if the contact was open.
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
        Known to the compiler, so their own arguments: whether the law is Hertz', slip that of mid-step, the spring remembered as a
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
    pushed = max(pushed + damping * dot(touch.dashpot_dv, n), law.least)
    repulsive = max(pushed + law.held * reduced, 0.0)
    fn = pushed - law.pull * (reduced if hertz else overlap)
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


@inline_kernel
def touch_of(sticks: bool, springs: np.uint64, q: Index, scratch: Floats) -> Touch:
    """The contact at place q of the scratch, with what it remembers from the column ``springs``."""
    return Touch(
        neck=scratch[ITS_NECK + q] if sticks else 0.0,
        d=vector(scratch, D + q),
        d_before=vector(scratch, D_BEFORE + q),
        reach=scratch[REACH + q],
        reduced=get_extra(scratch, SPRINGS + q),
        drag=scratch[ITS_DRAG + q],
        dv=vector(scratch, DV + q),
        dashpot_dv=vector(scratch, DASHPOT_DV + q),
        roll=vector(scratch, ROLLS + q),
        spin=vector(scratch, SPINS + q),
        spring=vector(scratch, springs + q),
    )


STEEP = 1e30
"""Torque over spin [N m s] below the limit of a constant torque, which makes it the limit wherever anything turns."""


@inline_kernel
def resistance(law: Floats, slip_dt: float, q: Index, scratch: Floats) -> tuple[Vector, Vector, float]:
    """Torque of both resistances on the second body [N m], and what is remembered of them, after `run_of_contacts`."""
    d, before = vector(scratch, D + q), vector(scratch, D_BEFORE + q)
    rolled, twisted = vector(scratch, ROLLED + q), get_extra(scratch, ROLLED + q)
    n, apart = scaled(d, 1.0 / sqrt(dot(d, d))), sqrt(dot(before, before))
    before = scaled(before, 1.0 / apart)
    begins = apart >= scratch[REACH + q]
    if law[STICKS] > 0.0:
        begins = scratch[ITS_NECK + q] < 0.0
    if begins:
        before, rolled, twisted = n, (0.0, 0.0, 0.0), 0.0
    reduced, repulsive = get_extra(scratch, SPRINGS + q), scratch[REPULSIVE + q]
    turn, dashpot_turn = vector(scratch, TURNS + q), vector(scratch, DASHPOT_TURNS + q)
    about, damped_about = dot(turn, n), dot(dashpot_turn, n)
    across = plus(turn, -about, n)
    path = across
    m = (0.0, 0.0, 0.0)
    if law[ROLL] > 0.0:
        if law[MIDDLE] > 0.0:
            both = (before[0] + n[0], before[1] + n[1], before[2] + n[2])
            shown = scaled(both, 1.0 / sqrt(dot(both, both)))
            angle = 0.5 * slip_dt * dot(vector(scratch, SPINS + q), shown)
            rolled, path = spun(carried(rolled, before, n), n, angle), half_spun(across, n, angle)
        else:
            rolled = projected(rolled, n)
        limit = law[ROLL + 1] * reduced * repulsive
        if law[ROLL] == CONSTANT:
            rolled = capped(scaled(across, STEEP), limit)
            m = rolled
        elif law[ROLL] == VISCOUS:
            rolled = scaled(plus(dashpot_turn, -damped_about, n), limit * reduced)
            m = rolled
        else:
            rolled = plus(rolled, law[ROLL + 2] * slip_dt, path)
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
def dissipated_energy(before: Vector, after: Vector, path: Vector) -> float:
    """Energy [J] that a force or torque which goes from ``before`` to ``after`` takes on a way; that of ``after`` alone where it has turned
    round within the step (`ninedisk.core.dem.plane.force_kernels.friction_loss`)."""
    mean = 0.5 * (dot(before, path) + dot(after, path))
    return mean if mean > 0.0 else max(dot(after, path), 0.0)


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
    return dissipated_energy(f_before, f, slid), work - dot(mean, slid) - stored


@inline_kernel
def resistance_losses(law: Floats, step: Step, q: Index, scratch: Floats) -> tuple[float, float]:
    """Energy that the resistances have taken beyond their springs, and in their dashpots, in this step [J], after `run_of_resistances`."""
    n, _, before, _, rolled = pose_of(True, False, touch_of(False, OLD_ROLLED, q, scratch))
    both = (before[0] + n[0], before[1] + n[1], before[2] + n[2])
    shown = scaled(both, 1.0 / sqrt(dot(both, both)))
    turn, kept, kept_twist = vector(scratch, TURNS + q), vector(scratch, ROLLED + q), get_extra(scratch, ROLLED + q)
    about = dot(turn, n)
    path = scaled(plus(turn, -about, n), step.slip_dt)
    lost = 0.0
    if law[ROLL] > 0.0:
        if law[MIDDLE] > 0.0:
            angle = 0.5 * step.slip_dt * dot(vector(scratch, SPINS + q), shown)
            rolled, path = spun(carried(rolled, before, n), n, angle), half_spun(path, n, angle)
        else:
            rolled = projected(vector(scratch, OLD_ROLLED + q), n)
        if law[ROLL] == SPRING:
            path = plus(path, -compliance(law[ROLL + 2]), plus(kept, -1.0, rolled))
        lost += dissipated_energy(rolled, kept, path)
    if law[TWIST] > 0.0:
        twisted, angle = get_extra(scratch, OLD_ROLLED + q), step.slip_dt * about
        if law[TWIST] == SPRING:
            angle -= (kept_twist - twisted) * compliance(law[TWIST + 2])
        lost += dissipated_energy(scaled(n, twisted), scaled(n, kept_twist), scaled(n, angle))
    damped = plus(plus(vector(scratch, MOMENT + q), -1.0, kept), -kept_twist, n)
    return lost, step.loss_dt * dot(damped, vector(scratch, DASHPOT_TURNS + q))
