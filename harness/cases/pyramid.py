"""Friction of engines that bound it along two axes by itself: along the velocity of the bodies' centres and across it, by mu times the
load each. Coulomb's friction where the slip is along that velocity; else up to 1.41 times as much, off the slip.

What such an engine does, to be held against Coulomb's law: the difference is what `Difference.FRICTION_PYRAMID` explains.
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import ArrayLike

from ninedisk.core.validate import FloatArray


def pyramid_impulse(
    response: FloatArray, before: FloatArray, *, rebound: float, mu: float, centre: FloatArray
) -> FloatArray:
    """Impulse [N s] at a point on the plane z = 0 with such friction, shape (3,).

    On each axis the point either sticks, or slips against the whole bound; of the nine combinations one fulfils all inequalities.

    Parameters
    ----------
    response : FloatArray, shape (3, 3)
        Change of the point's velocity by an impulse there [1/kg].
    before : FloatArray, shape (3,)
        Velocity of the point before [m/s].
    rebound : float
        Its normal velocity afterwards [m/s].
    mu : float
    centre : FloatArray, shape (3,)
        Velocity of the centre of mass before [m/s].

    Raises
    ------
    ValueError
        If none of the combinations fulfils the law.

    Examples
    --------
    A point mass slips along y while its centre is said to move at 45 degrees to that: both axes bear mu times the normal impulse.

    >>> pyramid_impulse(np.eye(3), np.array([0.0, 2.0, -1.0]), rebound=0.0, mu=0.5, centre=np.array([1.0, 1.0, 0.0])).round(4) + 0.0
    array([ 0.    , -0.7071,  1.    ])
    """
    turned = np.array([*axes_of(centre, np.array([0.0, 0.0, 1.0])), [0.0, 0.0, 1.0]])
    w, v = turned @ response @ turned.T, turned @ before
    for modes in itertools.product((0.0, 1.0, -1.0), repeat=2):
        system, right = w.copy(), np.array([0.0, 0.0, rebound]) - v
        for axis, sense in enumerate(modes):
            if sense:  # slips along ``sense``: friction is ``-sense mu`` times the normal impulse
                system[axis], right[axis] = 0.0, 0.0
                system[axis, axis], system[axis, 2] = 1.0, sense * mu
        p = np.linalg.solve(system, right)
        slip, bound = v + w @ p, mu * p[2] * (1.0 + 1e-12)
        if p[2] > 0.0 and all(
            slip[axis] * sense > 0.0 if sense else abs(p[axis]) <= bound for axis, sense in enumerate(modes)
        ):
            found: FloatArray = turned.T @ p
            return found
    raise ValueError(f"mu = {mu!r} is not allowed: no impulse fulfils the law of a pyramid of friction")


def axes_of(velocity: FloatArray, normal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Both axes in the plane with this normal, the first along the velocity; any where it has no part in the plane."""
    along = velocity - (velocity @ normal) * normal
    size = float(np.linalg.norm(along))
    if size == 0.0:
        along = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
        size = float(np.linalg.norm(along))
    return along / size, np.cross(normal, along / size)


def slide_sphere(
    v: FloatArray,
    spin: FloatArray,
    plane: FloatArray,
    normal: FloatArray,
    *,
    radius: float,
    pull: float,
    dt: float,
) -> tuple[FloatArray, FloatArray]:
    """Velocity [m/s] and spin [rad/s] of a uniform sphere a step later, which such friction pulls by ``pull`` [m/s^2] on each axis at most.

    ``plane`` is the velocity of the plane [m/s]. An axis whose slip ends within the step sticks.

    Examples
    --------
    >>> v, spin = slide_sphere(np.array([1.0, 0, 0]), np.zeros(3), np.zeros(3), np.array([0.0, 0, 1]), radius=0.5, pull=3.0, dt=0.01)
    >>> v.round(3), spin.round(3)
    (array([0.97, 0.  , 0.  ]), array([0.  , 0.15, 0.  ]))
    """
    relative = v - plane
    slip = relative - radius * np.cross(spin, normal)
    change = np.zeros(3)
    for axis in axes_of(relative, normal):
        change -= float(np.clip((slip @ axis) / 3.5, -pull * dt, pull * dt)) * axis
    return v + change, spin - 2.5 / radius * np.cross(normal, change)


def throw_sphere(
    velocity: ArrayLike, spin: ArrayLike, *, radius: float, pull: float, dt: float, n_steps: int
) -> FloatArray:
    """Velocities [m/s] of a uniform sphere on the plane z = 0 at rest at the end of each step, shape (n_steps + 1, 3).

    Examples
    --------
    Thrown without spin it rolls at 5/7 of its speed in the end, as with Coulomb's friction:

    >>> found = throw_sphere([1.0, 0.0, 0.0], [0.0, 0.0, 0.0], radius=0.5, pull=3.0, dt=0.01, n_steps=20)
    >>> found[[0, 1, -1], 0].round(4)
    array([1.    , 0.97  , 0.7143])
    """
    v, w, normal = np.asarray(velocity, dtype=np.float64), np.asarray(spin, dtype=np.float64), np.array([0.0, 0.0, 1.0])
    found = [v]
    for _ in range(n_steps):
        v, w = slide_sphere(v, w, np.zeros(3), normal, radius=radius, pull=pull, dt=dt)
        found.append(v)
    return np.array(found)
