"""Where planes are and how they move: poses as exact functions of time, velocities of their material, heights over them."""

from __future__ import annotations

from math import cos, sin

from ninedisk.core.compile import inline_kernel, kernel
from ninedisk.core.dem.space.state import (
    AMPLITUDE,
    AXIS,
    BEGIN,
    FREQUENCY,
    PHASE,
    PIVOT,
    POINT,
    POSE_WIDTH,
    SPIN,
    VELOCITY,
    Floats,
    Motion,
    Planes,
    Vector,
)
from ninedisk.core.dem.space.vector_kernels import cross, dot, plus, row, turned


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
