"""Contacts that planes drive or close again: a shaken floor under a disk, a disk that goes to and fro between two planes."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.references._validate import MOST, finite, not_negative, positive, times_of

FloatArray = NDArray[np.float64]


class ShakenContact(NamedTuple):
    """Overlap [m], its rate [m/s] and ``swing`` [N], the amplitude of the force of the driven oscillation and of what fades."""

    overlap: FloatArray
    rate: FloatArray
    swing: float


def shaken_contact(
    t: ArrayLike, *, kn: float, mass: float, beta: float, g: float, amplitude: float, frequency: float, phase: float
) -> ShakenContact:
    """Disk that rests on a floor which at time 0 begins to move by ``w = A (sin(W t + p) - sin p)``, as long as they touch.

    The overlap's deviation z from ``m g/kn`` obeys ``z'' + 2 beta omega z' + omega^2 z = w''``, ``z(0) = 0``, ``z'(0) = w'(0)``. With
    ``w'' = Im(-A W^2 exp(i (W t + p)))`` the driven part is ``Im(-A W^2/(omega^2 - W^2 + 2 i beta omega W) exp(i (W t + p)))``; the free
    part makes up for the start.

    Parameters
    ----------
    t : array_like
        Times [s], >= 0.
    kn, mass, g : float
        [N/m], [kg], [m/s^2], > 0.
    beta : float
        Contact damping ratio, in [0, 1).
    amplitude, frequency, phase : float
        A [m], W [rad/s], p [rad].

    Raises
    ------
    ValueError
        If an argument is out of range, or an undamped contact is shaken at its own frequency.

    Notes
    -----
    Source: driven linear oscillator, Landau & Lifshitz, Mechanics, section 26; derived here.
    """
    positive(kn=kn, mass=mass, g=g)
    not_negative(beta=beta, frequency=frequency)
    finite(amplitude=amplitude, phase=phase)
    if beta >= 1.0:
        raise ValueError(f"beta = {beta!r} is not allowed: this closed form is that of beta < 1")
    times, omega = times_of(t), math.sqrt(kn / mass)
    response = omega**2 - frequency**2 + 2j * beta * omega * frequency
    if response == 0.0:
        raise ValueError(f"frequency = {frequency!r} is not allowed: it is the undamped contact's own")
    driven = -amplitude * frequency**2 / response
    turning = driven * np.exp(1j * (frequency * times + phase))
    start = driven * np.exp(1j * phase)
    root = complex(-beta * omega, omega * math.sqrt(1.0 - beta**2))
    # Re((a - i b) exp(root t)) with value and rate at time 0 that cancel the driven part's.
    value = -start.imag
    rate = amplitude * frequency * math.cos(phase) - (1j * frequency * start).imag
    free = complex(value, -(rate + beta * omega * value) / root.imag)
    fading = free * np.exp(root * times)
    return ShakenContact(
        overlap=mass * g / kn + turning.imag + fading.real,
        rate=(1j * frequency * turning).imag + (root * fading).real,
        swing=kn * (abs(driven) + abs(free)),
    )


class Shuttle(NamedTuple):
    """At the times asked for: ``place`` of the disk [m], 0 where it touches the first plane and positive beyond; ``velocity`` [m/s];
    ``age`` of the contact with the first plane [s], NaN where open. ``changes``: times at which contacts begin or end [s]."""

    place: FloatArray
    velocity: FloatArray
    age: FloatArray
    changes: FloatArray


def shuttle(t: ArrayLike, *, speed: float, gap: float, path: float, omega_first: float, omega_second: float) -> Shuttle:
    """Disk that flies to a plane at distance ``gap``, rebounds, flies ``path`` to a second plane, rebounds, and so on.

    An elastic contact of stiffness kn and mass m lasts ``pi/omega``, ``omega^2 = kn/m``, and is half a sine; flights are uniform.

    Parameters
    ----------
    t : array_like
        Times [s], >= 0.
    speed, gap, way : float
        [m/s], [m], [m], > 0; ``gap <= path``.
    omega_first, omega_second : float
        Of the two contacts [rad/s], > 0.
    """
    positive(speed=speed, gap=gap, path=path, omega_first=omega_first, omega_second=omega_second)
    if not gap <= path:
        raise ValueError(
            f"gap = {gap!r} m is not allowed: it must be at most way = {path!r} m, the distance of the planes"
        )
    times = times_of(t)
    lengths = (math.pi / omega_first, path / speed, math.pi / omega_second, path / speed)
    period = sum(lengths)
    # Time 0 lies in the last flight, gap before the first plane.
    tau = times - gap / speed
    phase = np.where(tau < 0.0, tau + period, np.mod(tau, period))
    ends = np.cumsum(lengths)
    first, second = phase < ends[0], (phase >= ends[1]) & (phase < ends[2])
    out, back = (phase >= ends[0]) & (phase < ends[1]), phase >= ends[2]
    within = phase - ends[1]
    place = np.select(
        [first, out, second, back],
        [
            speed / omega_first * np.sin(omega_first * phase),
            -speed * (phase - ends[0]),
            -path - speed / omega_second * np.sin(omega_second * within),
            -path + speed * (phase - ends[2]),
        ],
    )
    velocity = np.select(
        [first, out, second, back],
        [
            speed * np.cos(omega_first * phase),
            np.full_like(phase, -speed),
            -speed * np.cos(omega_second * within),
            np.full_like(phase, speed),
        ],
    )
    passed = float(times.max(initial=0.0)) / period
    if not passed < MOST:
        raise ValueError(
            f"t = {float(times.max()):g} s is not allowed: it must be less than {MOST} periods of {period:g} s"
        )
    periods = math.ceil(passed) + 1
    starts = gap / speed + period * np.arange(periods)
    changes = (starts[:, None] + np.concatenate([[0.0], ends[:3]])).ravel()
    return Shuttle(place, velocity, np.where(first, phase, np.nan), changes)
