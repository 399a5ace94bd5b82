"""A rigid box on a plane with Coulomb friction: it stands, slides or tips on an incline, and comes to a stop."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

from ninedisk.references._validate import not_negative, positive, slope, times_of

FloatArray = NDArray[np.float64]
MOST_GROWTH = 20.0
"""Logarithm of the growth of a small turn up to which a box that tips is followed."""
Mode = Literal["stands", "slides", "tips", "slides and tips"]


class BoxStart(NamedTuple):
    """First instant of a box that is put at rest on an incline.

    ``acceleration`` of its centre down the incline [m/s^2], ``tipping`` angular acceleration [rad/s^2], forces ``fn`` and ``fs`` (up the
    incline) over the mass [m/s^2], and ``centre``, where the plane presses, down the incline from below the centre of mass [m].
    """

    mode: Mode
    acceleration: float
    tipping: float
    fn: float
    fs: float
    centre: float


def box_start(*, mu: float, angle: float, half_length: float, half_height: float, inertia: float, g: float) -> BoxStart:
    """What a box does that is put at rest on an incline, down which two of its edges run.

    It stands while ``tan(angle)`` exceeds neither mu nor ``half_length/half_height``. It slides where friction ends first, the pressure's
    centre at ``mu half_height``. It tips about the lower edge where the centre would leave the face, by ``g (h sin - b cos)/(I/m + b^2 +
    h^2)`` where the edge holds.

    Parameters
    ----------
    mu : float
        Friction coefficient, >= 0.
    angle : float
        Slope [rad], in [0, pi/2).
    half_length, half_height : float
        Half the edges down the incline and normal to it [m], > 0.
    inertia : float
        Moment of inertia about the level axis through the centre, over the mass [m^2], > 0.
    g : float
        Gravity [m/s^2], > 0.

    Raises
    ------
    ValueError
        If a value is out of its range, or the box is so slender and so light at its ends that friction at its edge jams it.
    """
    positive(half_length=half_length, half_height=half_height, inertia=inertia, g=g)
    not_negative(mu=mu)
    slope(angle)
    b, h = half_length, half_height
    pull, press = g * math.sin(angle), g * math.cos(angle)
    if pull <= min(mu, b / h) * press:
        return BoxStart("stands", 0.0, 0.0, press, pull, h * math.tan(angle))
    if mu * h <= b:
        return BoxStart("slides", pull - mu * press, 0.0, press, mu * press, mu * h)
    tipping = (h * pull - b * press) / (inertia + b * b + h * h)
    fn, fs = press + b * tipping, pull - h * tipping
    if fs <= mu * fn:
        return BoxStart("tips", h * tipping, tipping, fn, fs, b)
    lever = mu * h - b
    if not inertia > lever * b:
        raise ValueError(
            f"inertia = {inertia!r} is not allowed with mu = {mu!r}, half_length = {half_length!r} and half_height = {half_height!r}: it "
            f"must be > {lever * b:g}"
        )
    tipping = lever * press / (inertia - lever * b)
    fn = press + b * tipping
    return BoxStart("slides and tips", pull - mu * fn, tipping, fn, mu * fn, b)


class TippingHistory(NamedTuple):
    """``angle`` [rad] and ``spin`` [rad/s] of a box that tips about its lower edge, and the friction ``needed`` there [-]."""

    angle: FloatArray
    spin: FloatArray
    needed: FloatArray


def tipping_box(
    t: ArrayLike, *, angle: float, half_length: float, half_height: float, inertia: float, g: float
) -> TippingHistory:
    """Motion of a box that tips from rest about a held lower edge, integrated to 1e-12; parameters as of `box_start`."""
    times = times_of(t)
    positive(half_length=half_length, half_height=half_height, inertia=inertia, g=g)
    slope(angle)
    b, h = half_length, half_height
    about_edge = inertia + b * b + h * h
    if not h * math.sin(angle) > b * math.cos(angle):
        raise ValueError(
            f"half_length = {half_length!r} is not allowed with half_height = {half_height!r} and angle = {angle!r}: the box does not tip "
            "unless half_length < half_height tan(angle)"
        )
    if not math.sqrt(g * math.hypot(b, h) / about_edge) * float(times.max(initial=0.0)) <= MOST_GROWTH:
        raise ValueError(
            f"t = {t!r:.200} is not allowed with g = {g!r}, half_length = {half_length!r}, half_height = {half_height!r} and inertia = "
            f"{inertia!r}: the box has fallen long before"
        )

    def tipping(turned: FloatArray | float) -> FloatArray | float:
        return g * (h * np.sin(angle + turned) - b * np.cos(angle + turned)) / about_edge

    found = solve_ivp(
        lambda _, y: [y[1], tipping(y[0])],
        (0.0, max(float(times.max(initial=0.0)), 1e-300)),
        [0.0, 0.0],
        method="DOP853",
        rtol=1e-12,
        atol=1e-14,
        t_eval=times,
    )
    turned, spin = found.y
    alpha = np.asarray(tipping(turned))
    # In the frame of the turned box, whose centre is at (-b, h) from the edge: the edge's force along its floor and its normal.
    along = h * alpha + b * spin**2 - g * np.sin(angle + turned)
    normal = b * alpha - h * spin**2 + g * np.cos(angle + turned)
    # Those of the plane, from which the box has turned.
    fs = -along * np.cos(turned) - normal * np.sin(turned)
    fn = -along * np.sin(turned) + normal * np.cos(turned)
    return TippingHistory(turned, spin, np.abs(fs) / fn)


def stopping_box(t: ArrayLike, *, mu: float, speed: float, g: float) -> tuple[FloatArray, FloatArray]:
    """Distance [m] and speed [m/s] of what slides to a stop: ``v0 t - mu g t^2/2`` until ``v0/(mu g)``.

    Parameters
    ----------
    t : array_like
        Times [s], >= 0.
    mu, speed, g : float
        Friction coefficient, initial speed [m/s] and gravity [m/s^2], > 0.
    """
    times = times_of(t)
    positive(mu=mu, speed=speed, g=g)
    until = np.minimum(times, speed / (mu * g))
    return speed * until - 0.5 * mu * g * until**2, speed - mu * g * until
