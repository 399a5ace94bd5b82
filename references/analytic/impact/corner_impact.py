"""A rigid body hits a plane with one point: Newton's restitution of the normal velocity, Coulomb's friction against the slip at the end."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from ninedisk.references._validate import array, flag, fraction, not_negative, pair_of, positive, sizes

FloatArray = NDArray[np.float64]

DIRECTIONS = 720
"""Directions of slip between which a change of sign is looked for."""


class CornerImpact(NamedTuple):
    """What the impact does.

    ``impulse`` on the body [N s], ``velocity`` of its centre [m/s] and ``spin`` [rad/s] after it, and ``slip``, the velocity of the point
    that has hit [m/s]; all of shape (3,), along the axes of space.
    """

    mode: Literal["sticks", "slides"]
    impulse: FloatArray
    velocity: FloatArray
    spin: FloatArray
    slip: FloatArray


def corner_impact(
    *, mass: float, inertia: ArrayLike, axes: ArrayLike, arm: ArrayLike, velocity: ArrayLike, spin: ArrayLike, mu: float,
    restitution: float, dilates: bool = False,
) -> CornerImpact:  # fmt: skip
    """The one impulse p at a point of a body on the plane z = 0 that fulfils both laws.

    With ``W = 1/m - [r] I^-1 [r]`` of the arm r, the point's velocity changes by ``W p``. It sticks, ``W p = (0, 0, -e v_n) - v``, where
    that p is within the cone. Else ``p = p_n (-mu d, 1)``, d the direction of the slip at the end: a root of the one angle of d. The law
    of time-stepping schemes, which know the end of the impact alone; where the direction of slip changes within the impact Routh's
    integration of it gives another impulse.

    Parameters
    ----------
    mass : float
        Mass [kg], > 0.
    inertia : array_like, shape (3,)
        Principal moments [kg m^2], > 0.
    axes : array_like, shape (3, 3)
        Principal axes along the axes of space, as columns: a rotation.
    arm : array_like, shape (3,)
        From the centre of mass to the point that hits [m].
    velocity, spin : array_like, shape (3,)
        Of the centre [m/s], and about the axes of space [rad/s], before the impact.
    mu : float
        Friction coefficient, >= 0.
    restitution : float
        Newton's coefficient, in [0, 1].
    dilates : bool
        The associated rule: a point that slips parts from the plane by mu times its slip, beyond the rebound.

    Raises
    ------
    ValueError
        If a value is out of its range, the point does not approach the plane, or friction jams it or has several answers.

    Examples
    --------
    A cube falls on a corner below its centre: no moment, it comes to rest.

    >>> found = corner_impact(mass=2.0, inertia=[1.0, 1.0, 1.0], axes=np.eye(3), arm=[0.0, 0.0, -1.0], velocity=[0.0, 0.0, -3.0],
    ...                       spin=[0.0, 0.0, 0.0], mu=0.5, restitution=0.0)
    >>> found.mode, float(found.impulse[2])
    ('sticks', 6.0)
    """
    positive(mass=mass)
    not_negative(mu=mu)
    fraction(restitution=restitution)
    flag(dilates=dilates)
    moments = np.array(sizes("inertia", inertia, least=3, most=3, strict=True))
    turned = _rotation(axes)
    r, v, w = pair_of("arm", arm, 3), pair_of("velocity", velocity, 3), pair_of("spin", spin, 3)
    inverse = turned @ np.diag(1.0 / moments) @ turned.T
    cross = np.array([[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]])
    response = np.eye(3) / mass - cross @ inverse @ cross
    before = v + np.cross(w, r)
    if not before[2] < 0.0:
        raise ValueError(
            f"velocity = {velocity!r:.200} is not allowed: the point must approach the plane, it parts at {before[2]:g} m/s"
        )
    rebound = -restitution * before[2]
    impulse = np.linalg.solve(response, np.array([0.0, 0.0, rebound]) - before)
    mode: Literal["sticks", "slides"] = "sticks"
    if not math.hypot(impulse[0], impulse[1]) <= mu * impulse[2]:
        mode, impulse = "slides", _sliding(response, before, rebound, mu, mu if dilates else 0.0)
    return CornerImpact(
        mode, impulse, v + impulse / mass, w + inverse @ np.cross(r, impulse), before + response @ impulse
    )


def _sliding(response: FloatArray, before: FloatArray, rebound: float, mu: float, dilation: float) -> FloatArray:
    """The impulse on the cone's edge whose friction is against the slip at the end; the point then parts by ``dilation`` of its slip."""
    coupling, normal = response[:2, 2], float(response[2, 2])
    jams = mu * float(np.linalg.norm(coupling))
    if not (dilation or jams < normal):
        raise ValueError(f"mu = {mu!r} is not allowed: friction jams the point; it must be < {mu * normal / jams:g}")

    def along(angle: float) -> FloatArray:
        d = np.array([math.cos(angle), math.sin(angle)])
        force, parting = np.array([-mu * d[0], -mu * d[1], 1.0]), np.array([-dilation * d[0], -dilation * d[1], 1.0])
        return float((rebound - parting @ before) / (parting @ response @ force)) * force

    def slip(angle: float) -> FloatArray:
        return (before + response @ along(angle))[:2]

    def aside(angle: float) -> float:
        end = slip(angle)
        return float(end[1] * math.cos(angle) - end[0] * math.sin(angle))

    angles = np.linspace(-math.pi, math.pi, DIRECTIONS + 1)
    signs = np.sign([aside(angle) for angle in angles])
    roots = [
        float(brentq(aside, angles[k], angles[k + 1], xtol=1e-15, rtol=1e-15))
        for k in np.flatnonzero(signs[:-1] * signs[1:] <= 0.0)
        if signs[k] != 0.0
    ]
    found = [
        angle for angle in roots if slip(angle) @ [math.cos(angle), math.sin(angle)] > 0.0 and along(angle)[2] > 0.0
    ]
    if len(found) != 1:
        raise ValueError(
            f"mu = {mu!r} is not allowed: {len(found)} impulses fulfil the law of friction; take a smaller one"
        )
    return along(found[0])


def _rotation(axes: ArrayLike) -> FloatArray:
    found = array("axes", axes)
    if found.shape != (3, 3) or not np.abs(found.T @ found - np.eye(3)).max() <= 1e-9:
        raise ValueError(f"axes = {axes!r:.200} is not allowed: it must be a rotation, shape (3, 3)")
    return found
