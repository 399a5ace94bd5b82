"""Kernels of contact problems in space that are given by their Delassus matrix: one contact exactly, and sweeps over all."""

from __future__ import annotations

from math import atan2, cos, hypot, inf, pi, sin, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import inline_kernel, kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

TINY = 1e-300
ROUND_OFF = 32.0 * 2.0**-52
"""Of a sum of terms, relative to the sum of their sizes."""
DIRECTIONS = 24
"""Directions of slip between which signs are compared where the last direction leads to none."""
FIRST_STEP = 1e-3
"""First step [rad] away from the last direction."""
FARTHEST = 0.5
"""Step [rad] beyond which secants lead elsewhere."""
SECANTS, MOST_HALVINGS = 12, 40
"""Steps of secants, and of the search between two directions."""
ANGLE = 4e-16
"""Where a search for an angle stops: two roundings."""


@inline_kernel
def _slip(
    a: Floats, k: int, b0: float, b1: float, b2: float, mu: float, coulomb: bool, angle: float
) -> tuple[float, float, float]:
    """Contact k with friction at ``angle``: normal force, slip along this direction, and slip across it times the stiffness.

    The product is continuous where the normal force is not; a direction without normal force has none, -1.
    """
    c, s = cos(angle), sin(angle)
    w0 = a[k, 0, 0] + mu * (a[k, 0, 1] * c + a[k, 0, 2] * s)
    w1 = a[k, 1, 0] + mu * (a[k, 1, 1] * c + a[k, 1, 2] * s)
    w2 = a[k, 2, 0] + mu * (a[k, 2, 1] * c + a[k, 2, 2] * s)
    if coulomb:
        stiff, load = w0, b0
    else:  # the velocity is across the edge of the cone
        stiff, load = w0 + mu * (c * w1 + s * w2), b0 + mu * (c * b1 + s * b2)
    across = c * (b2 * stiff - w2 * load) - s * (b1 * stiff - w1 * load)
    p = -load / stiff if stiff > 0.0 else -1.0
    return p, c * (b1 + w1 * p) + s * (b2 + w2 * p), across


@inline_kernel
def _root(
    a: Floats, k: int, b0: float, b1: float, b2: float, mu: float, coulomb: bool,
    low: float, f_low: float, high: float, f_high: float,
) -> float:  # fmt: skip
    """The angle between two, where slip across has two signs, at which there is none (Illinois' rule of false position)."""
    for _ in range(MOST_HALVINGS):
        if abs(high - low) <= ANGLE * (abs(low) + abs(high)) or f_high == 0.0:
            break
        mid = high - f_high * (high - low) / (f_high - f_low)
        if not min(low, high) < mid < max(low, high):
            mid = 0.5 * (low + high)
        _, _, f = _slip(a, k, b0, b1, b2, mu, coulomb, mid)
        if (f < 0.0) != (f_high < 0.0):
            low, f_low = high, f_high
        else:
            f_low *= 0.5
        high, f_high = mid, f
    return high


@kernel
def solve_cone_contact(
    a: Floats, k: int, b0: float, b1: float, b2: float, mu: float, coulomb: bool, q1: float, q2: float
) -> tuple[float, float, float]:
    """Forces ``(p, q1, q2)`` of contact k alone, ``u = A r + b``: it opens, or sticks, or slips along the friction that it then has.

    Parameters
    ----------
    a : ndarray, shape (c, 3, 3)
        Blocks A of all contacts.
    b0, b1, b2 : float
        Velocity without this contact's force.
    mu : float
    coulomb : bool
        Coulomb's law instead of the associated rule.
    q1, q2 : float
        Friction that it had: where the search for the direction begins.
    """
    slide = hypot(b1, b2)
    if b0 >= (0.0 if coulomb else mu * slide):
        return 0.0, 0.0, 0.0
    if mu == 0.0:
        return -b0 / a[k, 0, 0], 0.0, 0.0
    c00 = a[k, 1, 1] * a[k, 2, 2] - a[k, 1, 2] * a[k, 2, 1]
    c01 = a[k, 1, 2] * a[k, 2, 0] - a[k, 1, 0] * a[k, 2, 2]
    c02 = a[k, 1, 0] * a[k, 2, 1] - a[k, 1, 1] * a[k, 2, 0]
    det = a[k, 0, 0] * c00 + a[k, 0, 1] * c01 + a[k, 0, 2] * c02
    if det > 0.0:
        c10 = a[k, 0, 2] * a[k, 2, 1] - a[k, 0, 1] * a[k, 2, 2]
        c11 = a[k, 0, 0] * a[k, 2, 2] - a[k, 0, 2] * a[k, 2, 0]
        c12 = a[k, 0, 1] * a[k, 2, 0] - a[k, 0, 0] * a[k, 2, 1]
        c20 = a[k, 0, 1] * a[k, 1, 2] - a[k, 0, 2] * a[k, 1, 1]
        c21 = a[k, 0, 2] * a[k, 1, 0] - a[k, 0, 0] * a[k, 1, 2]
        c22 = a[k, 0, 0] * a[k, 1, 1] - a[k, 0, 1] * a[k, 1, 0]
        p = -(c00 * b0 + c10 * b1 + c20 * b2) / det
        s1 = -(c01 * b0 + c11 * b1 + c21 * b2) / det
        s2 = -(c02 * b0 + c12 * b1 + c22 * b2) / det
        if p >= 0.0 and hypot(s1, s2) <= mu * p:
            return p, s1, s2
    first = atan2(q2, q1) if q1 != 0.0 or q2 != 0.0 else atan2(-b2, -b1)
    # In a later sweep the direction has hardly changed: secants find it.
    p, along, f = _slip(a, k, b0, b1, b2, mu, coulomb, first)
    angle, f_angle = first, f
    step = FIRST_STEP
    for _ in range(SECANTS):
        following = angle + step
        p, along, f_following = _slip(a, k, b0, b1, b2, mu, coulomb, following)
        if abs(step) <= ANGLE * (1.0 + abs(following)) or f_following == 0.0:
            if p > 0.0 and along <= 0.0:
                return p, mu * p * cos(following), mu * p * sin(following)
            break
        if f_following == f_angle:
            break
        step *= f_following / (f_angle - f_following)
        if not abs(step) < FARTHEST:
            break
        angle, f_angle = following, f_following
    # Else from there outwards to both sides: of several solutions, the nearest one.
    ends, values = (first, first), (f, f)
    step, reach = FIRST_STEP, 0.0
    while reach < pi:
        reach = min(reach + step, pi)
        step = min(2.0 * step, pi / DIRECTIONS)
        for side in range(2):
            before, f_before = ends[side], values[side]
            angle = first - reach if side == 1 else first + reach
            _, _, f = _slip(a, k, b0, b1, b2, mu, coulomb, angle)
            if (f < 0.0) != (f_before < 0.0):
                best = _root(a, k, b0, b1, b2, mu, coulomb, before, f_before, angle, f)
                p, along, _ = _slip(a, k, b0, b1, b2, mu, coulomb, best)
                if p > 0.0 and along <= 0.0:
                    return p, mu * p * cos(best), mu * p * sin(best)
            if side == 1:
                ends, values = (ends[0], angle), (values[0], f)
            else:
                ends, values = (angle, ends[1]), (f, values[1])
    return -b0 / a[k, 0, 0], 0.0, 0.0


class Delassus(NamedTuple):
    """A problem as the kernels read it.

    Attributes
    ----------
    pointers, columns, values
        W in compressed sparse rows.
    b : ndarray, shape (3 c,)
        Contact velocities without forces.
    mu, rho : ndarray, shape (c,)
        Friction coefficients; 1 / largest diagonal entry of each block.
    blocks : ndarray, shape (c, 3, 3)
        Diagonal blocks of W.
    """

    pointers: Ints
    columns: Ints
    values: Floats
    b: Floats
    mu: Floats
    rho: Floats
    blocks: Floats


@inline_kernel
def _velocity(problem: Delassus, r: Floats, k: int) -> tuple[float, float, float]:
    """Velocity ``W r + b`` of contact k; forces come first, so that large ones that cancel do not hide b."""
    u0 = u1 = u2 = 0.0
    for m in range(problem.pointers[3 * k], problem.pointers[3 * k + 1]):
        u0 += problem.values[m] * r[problem.columns[m]]
    for m in range(problem.pointers[3 * k + 1], problem.pointers[3 * k + 2]):
        u1 += problem.values[m] * r[problem.columns[m]]
    for m in range(problem.pointers[3 * k + 2], problem.pointers[3 * k + 3]):
        u2 += problem.values[m] * r[problem.columns[m]]
    return u0 + problem.b[3 * k], u1 + problem.b[3 * k + 1], u2 + problem.b[3 * k + 2]


@inline_kernel
def _project(z0: float, z1: float, z2: float, mu: float) -> tuple[float, float, float]:
    """The nearest forces inside the cone ``|z_t| <= mu z_n``."""
    size = hypot(z1, z2)
    if z0 >= 0.0 and size <= mu * z0:
        return z0, z1, z2
    foot = max(z0 + mu * size, 0.0) / (1.0 + mu * mu)
    along = mu * foot / size if size > 0.0 else 0.0
    return foot, along * z1, along * z2


@inline_kernel
def _over(error: float, scale: float) -> float:
    """The ratio; 0 where there is no error, infinite where there is one and no scale."""
    if error == 0.0:
        return 0.0
    return error / scale if scale > 0.0 else inf


@kernel
def largest_error(problem: Delassus, coulomb: bool, r: Floats) -> float:
    """The largest relative error of forces ``r``, shape (3 c,), inside the cones.

    Errors are the natural map ``|r - P(r - rho u*)|``, relative to the forces or to ``|P(-rho b)|`` where that is more; the works of
    contacts that open and slip, relative to the larger one of ``|r' W r|`` and ``|b' r|``; and the largest velocity into a contact,
    relative to what the largest force alone causes, and, beyond its rounding, to the largest ``|b|``. ``u* = u``, with ``mu |u_t|``
    added to u_n under Coulomb's law.
    """
    step = size = alone_size = pushed = loaded = lost = into = force = closing = speed = 0.0
    for k in range(problem.mu.shape[0]):
        mu, rho = problem.mu[k], problem.rho[k]
        u0, u1, u2 = _velocity(problem, r, k)
        b0, b1, b2 = problem.b[3 * k], problem.b[3 * k + 1], problem.b[3 * k + 2]
        p, q1, q2 = r[3 * k], r[3 * k + 1], r[3 * k + 2]
        slip = hypot(u1, u2) if mu > 0.0 else 0.0
        star = u0 + mu * slip if coulomb else u0
        z0, z1, z2 = _project(p - rho * star, q1 - rho * u1, q2 - rho * u2, mu)
        a0, a1, a2 = _project(-rho * b0, -rho * b1, -rho * b2, mu)
        step += (p - z0) ** 2 + (q1 - z1) ** 2 + (q2 - z2) ** 2
        size += p * p + q1 * q1 + q2 * q2
        alone = a0 * a0 + a1 * a1 + a2 * a2
        alone_size += alone
        force = max(force, abs(p), abs(q1), abs(q2), sqrt(alone))
        pushed += p * (u0 - b0) + q1 * (u1 - b1) + q2 * (u2 - b2)
        loaded += p * b0 + q1 * b1 + q2 * b2
        power = q1 * u1 + q2 * u2
        noise = abs(b0)
        for m in range(problem.pointers[3 * k], problem.pointers[3 * k + 1]):
            noise += abs(problem.values[m] * r[problem.columns[m]])
        closing = max(closing, (-u0 if coulomb else mu * slip - u0) - ROUND_OFF * noise)
        speed = max(speed, sqrt(b0 * b0 + b1 * b1 + b2 * b2))
        if coulomb:
            lost += abs(p * u0) + abs(mu * p * slip + power)
            into = max(into, -u0 * rho)
        else:
            lost += abs(p * u0 + power)
            into = max(into, (mu * slip - u0) * rho)
    worst = max(
        _over(sqrt(step), sqrt(max(size, alone_size))), _over(lost, max(abs(pushed), abs(loaded))), _over(into, force)
    )
    worst = max(worst, _over(closing, speed))
    return worst if worst == worst else inf


@kernel
def sweep_cones(
    problem: Delassus,
    coulomb: bool,
    tolerance: float,
    first: int,
    most: int,
    worthwhile: float,
    r: Floats,
    best: Floats,
) -> tuple[float, int]:
    """Nonsmooth Gauss-Seidel on ``u = W r + b``; each contact is solved exactly with the others held fixed.

    Parameters
    ----------
    problem : Delassus
    coulomb : bool
        Coulomb's law instead of the associated rule.
    tolerance : float
        `largest_error` at which it ends.
    first, most : int
        Sweeps of the first round, each round has twice as many as the one before, and of all.
    worthwhile : float
        Share of the error that may be left after a round that another one follows.
    r : ndarray, shape (3 c,)
        Forces, updated in place.
    best : ndarray, shape (3 c,)
        Out: the forces of the round with the least error.

    Returns
    -------
    error : float
        Of ``best``.
    sweeps : int
    """
    count, done, before, least = first, 0, inf, inf
    while done < most:
        for _ in range(min(count, most - done)):
            for k in range(problem.mu.shape[0]):
                u0, u1, u2 = _velocity(problem, r, k)
                p, q1, q2 = r[3 * k], r[3 * k + 1], r[3 * k + 2]
                w = problem.blocks
                b0 = u0 - w[k, 0, 0] * p - w[k, 0, 1] * q1 - w[k, 0, 2] * q2
                b1 = u1 - w[k, 1, 0] * p - w[k, 1, 1] * q1 - w[k, 1, 2] * q2
                b2 = u2 - w[k, 2, 0] * p - w[k, 2, 1] * q1 - w[k, 2, 2] * q2
                p, q1, q2 = solve_cone_contact(w, k, b0, b1, b2, problem.mu[k], coulomb, q1, q2)
                r[3 * k], r[3 * k + 1], r[3 * k + 2] = p, q1, q2
            done += 1
        error = largest_error(problem, coulomb, r)
        if error < least:
            least = error
            for i in range(r.shape[0]):
                best[i] = r[i]
        if error <= tolerance or not error < worthwhile * before:
            break
        count, before = 2 * count, error
    return least, done


@inline_kernel
def _size(a: Floats, k: int) -> float:
    """Square root of the product of both eigenvalues of ``a[k]``, a vector inside the cone ``|a_t| <= a_n``."""
    t = hypot(a[k, 1], a[k, 2])
    return sqrt(max((a[k, 0] - t) * (a[k, 0] + t), TINY))


@inline_kernel
def _product(matrix: Floats, k: int, x: Floats) -> tuple[float, float, float]:
    """``matrix[k] x[k]``."""
    x0, x1, x2 = x[k, 0], x[k, 1], x[k, 2]
    return (
        matrix[k, 0, 0] * x0 + matrix[k, 0, 1] * x1 + matrix[k, 0, 2] * x2,
        matrix[k, 1, 0] * x0 + matrix[k, 1, 1] * x1 + matrix[k, 1, 2] * x2,
        matrix[k, 2, 0] * x0 + matrix[k, 2, 1] * x1 + matrix[k, 2, 2] * x2,
    )


@kernel
def scale_cones(
    r: Floats, u: Floats, coulomb: bool, direct: Floats, inverse: Floats, turn: Floats, point: Floats
) -> None:
    """Scaling T of Nesterov and Todd of each contact, ``T u = T^-1 r``, and the slope of De Saxce's velocity.

    Parameters
    ----------
    r, u : ndarray, shape (c, 3)
        Forces and velocities inside the cones ``|a_t| <= a_n``.
    coulomb : bool
    direct, inverse : ndarray, shape (c, 3, 3)
        Out: T and its inverse.
    turn : ndarray, shape (c, 3, 3)
        Out: derivative J of ``u - (|u_t|, 0)`` by u; the identity under the associated rule.
    point : ndarray, shape (c, 3)
        Out: ``T u``.
    """
    for k in range(r.shape[0]):
        size_r, size_u = _size(r, k), _size(u, k)
        r0, r1, r2 = r[k, 0] / size_r, r[k, 1] / size_r, r[k, 2] / size_r
        u0, u1, u2 = u[k, 0] / size_u, u[k, 1] / size_u, u[k, 2] / size_u
        g = 2.0 * sqrt(max(0.5 * (1.0 + r0 * u0 + r1 * u1 + r2 * u2), 0.0))
        w0, w1, w2 = (r0 + u0) / g, (r1 - u1) / g, (r2 - u2) / g
        scale, d = sqrt(size_r / size_u), sqrt(2.0 * (w0 + 1.0))
        v0, v1, v2 = (w0 + 1.0) / d, w1 / d, w2 / d
        v = (v0, v1, v2)
        for i in range(3):
            for j in range(3):
                sign = 1.0 if (i == 0) == (j == 0) else -1.0
                unit = (-1.0 if i == 0 else 1.0) if i == j else 0.0
                direct[k, i, j] = scale * (2.0 * v[i] * v[j] + unit)
                inverse[k, i, j] = (2.0 * sign * v[i] * v[j] + unit) / scale
                turn[k, i, j] = 1.0 if i == j else 0.0
        if coulomb:
            slide = max(hypot(u[k, 1], u[k, 2]), TINY)
            turn[k, 0, 1], turn[k, 0, 2] = -u[k, 1] / slide, -u[k, 2] / slide
        point[k, 0], point[k, 1], point[k, 2] = _product(direct, k, u)


@kernel
def complementarity_target(
    point: Floats, nu: float, direct: Floats, inverse: Floats, dr: Floats, du: Floats, target: Floats
) -> None:
    """What ``point o (T^-1 dr + T du)`` must be, divided by ``point``: Mehrotra's corrector of the step (dr, du) towards ``nu``.

    Parameters
    ----------
    point, direct, inverse
        From `scale_cones`.
    nu : float
        Wanted product of forces and velocities.
    dr, du : ndarray, shape (c, 3)
        Step of the predictor; zero for none.
    target : ndarray, shape (c, 3)
        Out: x with ``point o x = nu e - point o point - (T^-1 dr) o (T du)``.
    """
    for k in range(point.shape[0]):
        a0, a1, a2 = _product(inverse, k, dr)
        b0, b1, b2 = _product(direct, k, du)
        p0, p1, p2 = point[k, 0], point[k, 1], point[k, 2]
        t0 = nu - (p0 * p0 + p1 * p1 + p2 * p2) - (a0 * b0 + a1 * b1 + a2 * b2)
        t1 = -2.0 * p0 * p1 - a0 * b1 - b0 * a1
        t2 = -2.0 * p0 * p2 - a0 * b2 - b0 * a2
        t = hypot(p1, p2)
        x0 = (p0 * t0 - p1 * t1 - p2 * t2) / max((p0 - t) * (p0 + t), TINY)
        target[k, 0], target[k, 1], target[k, 2] = x0, (t1 - p1 * x0) / p0, (t2 - p2 * x0) / p0


@kernel
def longest_step(x: Floats, d: Floats) -> float:
    """The largest a with all ``x + a d``, shape (c, 3), inside the cones ``|a_t| <= a_n``; x is inside."""
    longest = inf
    for k in range(x.shape[0]):
        a = d[k, 0] * d[k, 0] - d[k, 1] * d[k, 1] - d[k, 2] * d[k, 2]
        b = x[k, 0] * d[k, 0] - x[k, 1] * d[k, 1] - x[k, 2] * d[k, 2]
        t = hypot(x[k, 1], x[k, 2])
        c = (x[k, 0] - t) * (x[k, 0] + t)
        inside = b * b - a * c
        if inside >= 0.0:
            root = sqrt(inside)
            if b < 0.0:
                longest = min(longest, c / (root - b))
            elif a < 0.0:
                longest = min(longest, (-b - root) / a)
        if d[k, 0] < 0.0:
            longest = min(longest, -x[k, 0] / d[k, 0])
    return longest


@kernel
def statuses_system(
    r: Floats,
    u: Floats,
    mu: Floats,
    rho: Floats,
    coulomb: bool,
    of_u: Floats,
    of_r: Floats,
    error: Floats,
    fixed: Floats,
) -> None:
    """Equations of each contact that opens, sticks or slips, and their derivatives: Alart and Curnier's (1991) under Coulomb's law.

    Under the associated rule they are those of the natural map ``r - P(r - rho u)``.

    Parameters
    ----------
    r, u : ndarray, shape (c, 3)
        Forces and velocities ``W r + b``.
    mu, rho : ndarray, shape (c,)
    coulomb : bool
    of_u, of_r : ndarray, shape (c, 3, 3)
        Out: derivatives of the equations by u and by r.
    error : ndarray, shape (c, 3)
        Out: the equations' left sides, forces.
    fixed : ndarray, shape (c, 3)
        Out: 1 for the equations in which a force may be undetermined.
    """
    for k in range(r.shape[0]):
        for i in range(3):
            fixed[k, i] = 0.0
            for j in range(3):
                of_u[k, i, j] = of_r[k, i, j] = 0.0
        m, h = mu[k], rho[k]
        z0, z1, z2 = r[k, 0] - h * u[k, 0], r[k, 1] - h * u[k, 1], r[k, 2] - h * u[k, 2]
        size = hypot(z1, z2)
        if (z0 <= 0.0) if (coulomb or m == 0.0) else (z0 + m * size <= 0.0):
            for i in range(3):
                of_r[k, i, i], error[k, i] = 1.0, r[k, i]
            continue
        if m == 0.0:
            of_u[k, 0, 0], error[k, 0], fixed[k, 0] = h, h * u[k, 0], 1.0
            for i in range(1, 3):
                of_r[k, i, i], error[k, i] = 1.0, r[k, i]
            continue
        if size <= m * z0:
            for i in range(3):
                of_u[k, i, i], error[k, i], fixed[k, i] = h, h * u[k, i], 1.0
            continue
        t1, t2 = z1 / size, z2 / size
        if coulomb:
            most = m * z0
            bend = most / size
            of_u[k, 0, 0], error[k, 0], fixed[k, 0] = h, h * u[k, 0], 1.0
            error[k, 1], error[k, 2] = r[k, 1] - most * t1, r[k, 2] - most * t2
            across = (bend * (1.0 - t1 * t1), -bend * t1 * t2, bend * (1.0 - t2 * t2))
            of_r[k, 1, 0], of_r[k, 2, 0] = -m * t1, -m * t2
            of_u[k, 1, 0], of_u[k, 2, 0] = m * h * t1, m * h * t2
            of_r[k, 1, 1], of_r[k, 1, 2], of_r[k, 2, 2] = 1.0 - across[0], -across[1], 1.0 - across[2]
            of_r[k, 2, 1] = -across[1]
            of_u[k, 1, 1], of_u[k, 1, 2], of_u[k, 2, 2] = h * across[0], h * across[1], h * across[2]
            of_u[k, 2, 1] = h * across[1]
        else:
            foot = (z0 + m * size) / (1.0 + m * m)
            d = (1.0, m * t1, m * t2)
            bend = m * foot / size
            for i in range(3):
                error[k, i], fixed[k, i] = r[k, i] - foot * d[i], 1.0
                for j in range(3):
                    slope = d[i] * d[j] / (1.0 + m * m)
                    if i > 0 and j > 0:
                        slope += bend * ((1.0 if i == j else 0.0) - (t1 if i == 1 else t2) * (t1 if j == 1 else t2))
                    of_r[k, i, j] = (1.0 if i == j else 0.0) - slope
                    of_u[k, i, j] = h * slope
