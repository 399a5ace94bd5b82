"""A rigid box on a plane that is pushed near its top: it stands, slides or topples."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

from ninedisk.references._validate import not_negative, positive, times_of

FloatArray = NDArray[np.float64]
MOST_GROWTH = 20.0
"""Logarithm of the growth of a small turn up to which a box that topples is followed."""


class PushStart(NamedTuple):
    """First instant of a box at rest that is pushed.

    ``acceleration`` of its centre along the push [m/s^2], ``toppling`` angular acceleration [rad/s^2], forces ``fn`` and ``fs``, against
    the push, over the mass [m/s^2], and ``centre``, where the plane presses, ahead of the centre of mass [m].
    """

    mode: Literal["stands", "slides", "topples", "slides and topples"]
    acceleration: float
    toppling: float
    fn: float
    fs: float
    centre: float


class Toppling(NamedTuple):
    """``angle`` [rad] and ``spin`` [rad/s] of a box that topples about its held front edge, and the friction ``needed`` there [-]."""

    angle: FloatArray
    spin: FloatArray
    needed: FloatArray


def push_start(
    *, push: float, height: float, mu: float, half_length: float, half_height: float, inertia: float, g: float
) -> PushStart:
    """What a box at rest does under a level push at some height.

    It topples where ``push height > g half_length`` and its edge holds, ``(push height - g b)/(I + b^2 + h^2)``; it slides where
    ``push > mu g``. The centre of the pressure is that of the moments: ``c = (push (height - h) + fs h)/g`` while it does not topple.

    Parameters
    ----------
    push : float
        Level force over the mass [m/s^2], >= 0.
    height : float
        Of the push above the plane [m], > 0.
    mu : float
        Friction coefficient, >= 0.
    half_length, half_height : float
        Half the edges along the push and upright [m], > 0.
    inertia : float
        Moment of inertia about the level axis across, over the mass [m^2], > 0.
    g : float
        Gravity [m/s^2], > 0.

    Returns
    -------
    PushStart
        NaN of a box that slides and topples at once.

    Raises
    ------
    ValueError
        If a value is out of its range.

    Examples
    --------
    >>> push_start(push=3.0, height=1.0, mu=0.5, half_length=0.2, half_height=0.5, inertia=0.1, g=10.0).mode
    'topples'
    """
    positive(height=height, half_length=half_length, half_height=half_height, inertia=inertia, g=g)
    not_negative(push=push, mu=mu)
    b, h = half_length, half_height
    fs = min(push, mu * g)
    centre = (push * (height - h) + fs * h) / g
    if centre <= b:
        return PushStart("stands" if push <= mu * g else "slides", push - fs, 0.0, g, fs, centre)
    toppling = (push * height - g * b) / (inertia + b * b + h * h)
    fn, fs = g + b * toppling, push - h * toppling
    if abs(fs) > mu * fn:
        return PushStart("slides and topples", *[math.nan] * 5)
    return PushStart("topples", h * toppling, toppling, fn, fs, b)


def toppling_box(
    t: ArrayLike, *, push: float, height: float, half_length: float, half_height: float, inertia: float, g: float
) -> Toppling:
    """Motion of a box from rest about its held front edge, integrated to 1e-12; parameters as of `push_start`.

    The push stays what it is at time 0: a level force through the centre of mass, and a torque of ``push (height - half_height)``.
    """
    times = times_of(t)
    positive(height=height, half_length=half_length, half_height=half_height, inertia=inertia, g=g)
    not_negative(push=push)
    b, h = half_length, half_height
    about_edge = inertia + b * b + h * h
    if not push * height > g * b:
        raise ValueError(
            f"push = {push!r} is not allowed with height = {height!r} and half_length = {b!r}: the box does not topple"
        )
    rate = math.sqrt(math.hypot(push, g) * math.hypot(b, h) / about_edge)
    if not rate * float(times.max(initial=0.0)) <= MOST_GROWTH:
        raise ValueError(
            f"t = {t!r:.200} is not allowed with push = {push!r}, g = {g!r}, half_length = {b!r}, half_height = {h!r} and inertia = "
            f"{inertia!r}: the box has fallen long before"
        )
    torque = push * (height - h)

    def turning(turned: FloatArray | float) -> FloatArray | float:
        level, upright = h * np.cos(turned) + b * np.sin(turned), b * np.cos(turned) - h * np.sin(turned)
        return (push * level - g * upright + torque) / about_edge

    found = solve_ivp(
        lambda _, y: [y[1], turning(y[0])],
        (0.0, max(float(times.max(initial=0.0)), 1e-300)),
        [0.0, 0.0],
        method="DOP853",
        rtol=1e-12,
        atol=1e-14,
        t_eval=times,
    )
    angle, spin = found.y
    alpha = np.asarray(turning(angle))
    along, up = h * np.sin(angle) - b * np.cos(angle), h * np.cos(angle) + b * np.sin(angle)
    fs = push - (up * alpha - along * spin**2)
    fn = g - along * alpha - up * spin**2
    return Toppling(angle, spin, np.abs(fs) / fn)
