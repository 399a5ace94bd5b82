"""One disk between planes that may move, along their normal: exact steps of central differences and of the theta scheme."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.references._validate import array, count, finite, not_negative, positive, theta_in_range

FloatArray = NDArray[np.float64]


class Plane(NamedTuple):
    """A plane below (``side`` = 1) or above (-1) the disk.

    ``place`` and ``rate`` are its position [m] and velocity [m/s] at ``t_0 .. t_n``, each of shape (n + 1,), such that the disk's
    coordinate ``y`` touches it at ``y = place``; ``kn`` [N/m]; ``beta`` the contact damping ratio [-] for the mass of the disk.
    """

    side: int
    place: FloatArray
    rate: FloatArray
    kn: float
    beta: float = 0.0


class NormalSteps(NamedTuple):
    """``y`` [m] and ``vy`` [m/s] at ``t_0 .. t_n``, each of shape (n + 1,); ``overlap`` [m] (negative where open) and ``fn`` [N] of
    each plane, shape (n + 1, planes)."""

    y: FloatArray
    vy: FloatArray
    overlap: FloatArray
    fn: FloatArray


def normal_contact_central(
    planes: Sequence[Plane], *, mass: float, g: float, y: float, vy: float, dt: float, n_steps: int
) -> NormalSteps:
    """Velocities at half steps, forces ``max(kn overlap + c overlap', 0)`` at the positions of ``t_n``, planes included.

    The start is synchronised, ``v_{1/2} = v_0 + dt a_0/2``; ``vy`` at ``t_n`` is the mean of its neighbours at half steps. The dashpot
    sees ``v_n`` to second order, extrapolated: ``v_{n-1/2} + (v_{n-1/2} - v_{n-3/2})/2``, at n = 1 ``v_{1/2} + (v_{1/2} - v_0)``.

    Parameters
    ----------
    planes : sequence of Plane
    mass : float
        [kg], > 0.
    g : float
        Gravity towards negative y [m/s^2], >= 0.
    y, vy : float
        Start [m], [m/s].
    dt : float
        Contact step [s], > 0.
    n_steps : int

    Returns
    -------
    NormalSteps

    Raises
    ------
    ValueError
        If an argument is out of range.

    Notes
    -----
    Source: Cundall & Strack, Geotechnique 29 (1979) 47-65; the extrapolation of `ninedisk.core.numerics.Numerics.damping_form`.
    """
    _check(planes, mass, g, y, vy, dt, n_steps)
    step, place, velocity, seen = np.longdouble(dt), np.longdouble(y), np.longdouble(vy), np.longdouble(vy)
    found = NormalSteps(*(np.zeros((n_steps + 1, *more)) for more in ((), (), (len(planes),), (len(planes),))))
    for n in range(n_steps + 1):
        total = np.longdouble(0.0)
        for k, plane in enumerate(planes):
            overlap = plane.side * (np.longdouble(plane.place[n]) - place)
            damping = 2 * plane.beta * np.sqrt(np.longdouble(mass) * plane.kn)
            closing = plane.side * (np.longdouble(plane.rate[n]) - seen)
            fn = max(plane.kn * overlap + damping * closing, np.longdouble(0.0)) if overlap > 0 else np.longdouble(0.0)
            found.overlap[n, k], found.fn[n, k] = overlap, fn
            total += plane.side * fn
        before = velocity
        velocity = before + (step / 2 if n == 0 else step) * (total / mass - g)
        found.y[n], found.vy[n] = place, before if n == 0 else (before + velocity) / 2
        seen = velocity + (velocity - before) / (1 if n == 0 else 2)
        place += step * velocity
    return found


def normal_contact_theta(
    planes: Sequence[Plane], *, mass: float, g: float, y: float, vy: float, dt: float, n_steps: int, theta: float
) -> NormalSteps:
    """Implicit steps ``m (v_1 - v_0)/dt = sum of fn - m g``, ``y_1 = y_0 + dt (theta v_1 + (1 - theta) v_0)``.

    With the overlaps ``d_0`` and ``d_1`` at both ends of a step, negative ones being none, spring and dashpot give
    ``fn = max(kn d_1 + c (d_1 - d_0)/dt, 0)``: the force is that of the step's end, and so is ``vy``. In each step the planes that bear are
    found by trying all sets of them: exactly one is consistent.

    Parameters
    ----------
    planes, mass, g, y, vy, dt, n_steps
        As in `normal_contact_central`.
    theta : float
        Parameter of the scheme, in [1/2, 1].

    Returns
    -------
    NormalSteps

    Raises
    ------
    ValueError
        If an argument is out of range.

    Notes
    -----
    First order: without dashpot an oscillation shrinks by ``1/(1 + theta (omega dt)^2)`` in the determinant of each step. Derived here.
    """
    _check(planes, mass, g, y, vy, dt, n_steps)
    theta_in_range(theta)
    step, place, velocity = np.longdouble(dt), np.longdouble(y), np.longdouble(vy)
    part, sides = np.longdouble(theta), [plane.side for plane in planes]
    dashpots = [2 * plane.beta * np.sqrt(np.longdouble(mass) * plane.kn) for plane in planes]
    found = NormalSteps(*(np.zeros((n_steps + 1, *more)) for more in ((), (), (len(planes),), (len(planes),))))
    overlaps = [plane.side * (np.longdouble(plane.place[0]) - place) for plane in planes]
    forces = [
        max(plane.kn * d + c * plane.side * (np.longdouble(plane.rate[0]) - velocity), np.longdouble(0.0))
        if d > 0
        else 0.0
        for plane, d, c in zip(planes, overlaps, dashpots, strict=True)
    ]
    for n in range(n_steps + 1):
        found.y[n], found.vy[n], found.overlap[n], found.fn[n] = place, velocity, overlaps, forces
        if n == n_steps:
            break
        ends = [np.longdouble(plane.place[n + 1]) for plane in planes]
        stiff = [plane.kn + c / step for plane, c in zip(planes, dashpots, strict=True)]
        kept = [c / step * max(d, 0) for c, d in zip(dashpots, overlaps, strict=True)]
        for bears in product((False, True), repeat=len(planes)):
            some = [k for k, held in enumerate(bears) if held]
            # fn = stiff side (end - y_1) - kept, and y_1 = y_0 + dt (v_0 + theta dt (sum of side fn/m - g)).
            flight = place + step * (velocity - part * step * g)
            push = sum(stiff[k] * ends[k] - sides[k] * kept[k] for k in some)
            share = part * step * step / mass
            end = (flight + share * push) / (1 + share * sum(stiff[k] for k in some))
            trial = [stiff[k] * sides[k] * (ends[k] - end) - kept[k] for k in range(len(planes))]
            if all((force > 0) == held for force, held in zip(trial, bears, strict=True)):
                break
        forces = [force if held else 0.0 for force, held in zip(trial, bears, strict=True)]
        velocity += step * (sum(side * force for side, force in zip(sides, forces, strict=True)) / mass - g)
        place = end
        overlaps = [side * (at - place) for side, at in zip(sides, ends, strict=True)]
    return found


def _check(planes: Sequence[Plane], mass: float, g: float, y: float, vy: float, dt: float, n_steps: int) -> None:
    positive(mass=mass, dt=dt)
    not_negative(g=g)
    finite(y=y, vy=vy)
    count(n_steps=n_steps)
    for k, plane in enumerate(planes):
        if not isinstance(plane, Plane) or plane.side not in (1, -1):
            raise ValueError(f"planes[{k}] = {plane!r:.200} is not allowed: it must be a Plane whose side is 1 or -1")
        for name in ("place", "rate"):
            if array(f"planes[{k}].{name}", getattr(plane, name), dimensions=(1,)).shape != (n_steps + 1,):
                raise ValueError(f"planes[{k}].{name} is not allowed: it must have n_steps + 1 = {n_steps + 1} entries")
        positive(**{f"planes[{k}].kn": plane.kn})
        not_negative(**{f"planes[{k}].beta": plane.beta})
