"""Kernels of contact geometry and of the contacts' part in a step: one definition for single steps and for many at once.

Array arguments of c contacts are those of `ninedisk.core.cd.frames.Frames`: ``normal`` (c, 2), ``gap``, ``gap_before``, ``shift`` (c,),
``arms`` (c, 4); ``row`` (c,) is the contact's row of the law table.
"""

from __future__ import annotations

from math import hypot, inf, pi, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd._jit import inline_kernel, kernel
from ninedisk.core.cd.contact_kernels import contact_velocity

Floats = NDArray[np.float64]

ROUND_OFF = 8.881784197001252e-16
"""Of the largest coordinate, four units in the last place: gaps are differences of a few of them."""


MISSED = 16.0
"""Multiple of a gap's rounding beyond which a contact outside the set is violated: that of the gap, of the displacements and of
those of earlier steps that a contact still carries."""

NEARBY = 1e-2
"""Gap over the smallest radius of the pairs that are looked at in any case: contact forces move disks that would rest without."""


class Laws(NamedTuple):
    """Columns of `ninedisk.core.cd.laws.LawTable`, shape (1 + m,) each."""

    kn: Floats
    ks: Floats
    mu: Floats
    elastic: NDArray[np.bool_]
    restitution: Floats
    arm_overlap: Floats
    wall_mid: Floats


@kernel
def measure_frames(
    pairs: NDArray[np.int64],
    row: NDArray[np.int64],
    x: Floats,
    radius: Floats,
    before: Floats,
    after: Floats,
    laws: Laws,
    normal: Floats,
    gap: Floats,
    gap_before: Floats,
    shift: Floats,
    arms: Floats,
) -> None:
    """Frames of the pairs, shape (c, 2): disks at ``x``, shape (n, 2 or 3), walls, shape (m, 11), at both ends of the step."""
    n = x.shape[0]
    for k in range(pairs.shape[0]):
        i, j = pairs[k, 0], pairs[k, 1]
        if j < n:
            ax, ay = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1]
            distance = sqrt(ax * ax + ay * ay)
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
def wall_way(x: Floats, before: Floats, after: Floats) -> float:
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
        way = hypot(after[w, 0] - before[w, 0], after[w, 1] - before[w, 1])
        turned = hypot(after[w, 2] - before[w, 2], after[w, 3] - before[w, 3])
        if turned > 0.0:
            # No disk is farther from the wall's point than the far corner of the box around all of them.
            px, py = after[w, 0], after[w, 1]
            far = hypot(max(right - px, px - left), max(high - py, py - low))
            # The chord of the normal's turn times pi/2 bounds the angle.
            way += 0.5 * pi * turned * far
        largest = max(largest, way)
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
def surface_way(dx: Floats, radius: Floats) -> float:
    """Largest displacement of a point of a disk's outline [m], under displacements of shape (n, 3)."""
    largest = 0.0
    for i in range(dx.shape[0]):
        largest = max(largest, hypot(dx[i, 0], dx[i, 1]) + radius[i] * abs(dx[i, 2]))
    return largest


@kernel
def closing_gaps(
    bodies: NDArray[np.int32],
    normal: Floats,
    arms: Floats,
    gap: Floats,
    shift: Floats,
    row: NDArray[np.int64],
    dilation: Floats,
    dx: Floats,
    out: Floats,
) -> None:
    """Gap after the displacements ``dx``, shape (n, 3), less ``dilation`` (of a law row) times the slip [m], shape (c,)."""
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


@kernel
def dynamic_offsets(
    bodies: NDArray[np.int32],
    normal: Floats,
    gap: Floats,
    gap_before: Floats,
    shift: Floats,
    arms: Floats,
    row: NDArray[np.int64],
    laws: Laws,
    kept: Floats,
    prescribed: Floats,
    dt: float,
    theta: float,
    round_off: float,
    offset: Floats,
) -> None:
    """Offsets ``g`` of `ninedisk.core.cd.step.DynamicStep`, shape (c, 2).

    A gap of rigid bodies within `MISSED` times the rounding of gaps is none: bodies at rest have more contacts than freedom, gaps that
    are round-off contradict each other, and divided by a small step they would be velocities that no force at rest allows.

    ``kept`` and ``prescribed``, shape (n, 3), are the velocities at the start of the step of the unknowns that are free and of
    those that are not, 0 elsewhere. Under Newton's law (restitution not NaN) walls count by their displacement over the step,
    held disks by their speed.
    """
    for k in range(bodies.shape[0]):
        held_n, held_t = contact_velocity(k, bodies, normal, arms, prescribed)
        kept_n, kept_t = contact_velocity(k, bodies, normal, arms, kept)
        e = laws.restitution[row[k]]
        if np.isnan(e):
            touching = not laws.elastic[row[k]] and abs(gap[k]) <= MISSED * round_off
            room = 0.0 if touching else gap[k]
            offset[k, 0] = room / (theta * dt) + (held_n / theta + (1.0 - theta) / theta * kept_n)
            offset[k, 1] = shift[k] / (theta * dt) + (held_t / theta + (1.0 - theta) / theta * kept_t)
        else:
            un = (gap[k] - gap_before[k]) / dt + held_n
            offset[k, 0] = un + e * min(0.0, un + kept_n)
            offset[k, 1] = shift[k] / dt + held_t
