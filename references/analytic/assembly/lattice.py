"""Triangular lattice of equal disks with linear springs in a periodic cell that deforms affinely; rows of touching disks lie along x.

Every disk is a centre of inversion, so that forces cancel and disks move with the cell; what is left are the contacts, three for each
disk, at 0, 60 and 120 degrees. A contact ``d(t) = (I + t rate) d_0`` has ``fn = kn (2 R - |d|)`` and, between disks that do not turn,
``fs' = ks (d x d')/|d|``, where ``d x d' = d_0 x d_0'`` stays the same: ``fs = ks (d_0 x d_0')/|d_0'| [asinh(d_0'.d/|d_0 x d_0'|)]``.

Compression is positive in ``sigma = (1/A) sum (fn n - fs t) (x) d`` with the area ``A = (sqrt3/2) |d_0|^2 det(I + t rate)`` of a disk.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.references._validate import finite, not_negative, pair, positive, times_of

FloatArray = NDArray[np.float64]


class Moduli(NamedTuple):
    """Moduli of the plane [N/m] and Poisson's ratio."""

    bulk: float
    shear: float
    young: float
    poisson: float


def moduli(*, kn: float, ks: float) -> Moduli:
    """Moduli of the lattice of disks that just touch.

    A strain e stretches a contact by ``d n.e.n`` and shears it by ``d t.e.n``: the energy of an area is ``(1/(sqrt3 d^2)) sum d^2 (kn
    (n.e.n)^2 + ks (t.e.n)^2)`` over three contacts. For e = 1 it is ``sqrt3 kn = 2 K``; for a shear g it is ``(sqrt3/8)(kn + ks) g^2 = G
    g^2/2``, whatever its direction. ``E = 4 K G/(K + G)`` and ``nu = (K - G)/(K + G)`` in the plane.

    Parameters
    ----------
    kn, ks : float
        Normal and shear stiffness [N/m], > 0 and >= 0.

    Notes
    -----
    Source: derived here; textbooks have the same.
    """
    positive(kn=kn)
    not_negative(ks=ks)
    bulk, shear = math.sqrt(3.0) / 2.0 * kn, math.sqrt(3.0) / 4.0 * (kn + ks)
    return Moduli(bulk, shear, 4.0 * bulk * shear / (bulk + shear), (bulk - shear) / (bulk + shear))


class Stretched(NamedTuple):
    """Stress [N/m], shape (s, 2, 2), compression positive, and elastic energy of a disk [J], shape (s,)."""

    stress: FloatArray
    energy: FloatArray


def stretched(
    *, t: ArrayLike, rate: tuple[float, float], spacing: float, radius: float, kn: float, ks: float
) -> Stretched:
    """Lattice that is stretched along x and y at the rates ``rate`` [1/s]: exact at any strain.

    The mirror symmetries leave no torque, so that disks do not turn.

    Parameters
    ----------
    t : array_like
        Times [s], at which the lattice is still compressed.
    rate : (float, float)
        Rates of the edges over their lengths at time 0 [1/s]; < 0 compresses.
    spacing, radius : float
        Distance of neighbours at time 0, at most two radii, and radius [m], > 0.
    kn, ks : float
        Stiffnesses [N/m].

    Notes
    -----
    Source: the closed forms above, derived here.
    """
    positive(spacing=spacing, radius=radius, kn=kn)
    not_negative(ks=ks)
    rate, times = pair("rate", rate), times_of(t)
    if spacing > 2.0 * radius:
        raise ValueError(f"spacing = {spacing!r} is not allowed: disks must touch, at most {2.0 * radius!r}")
    along, across = 1.0 + times * rate[0], 1.0 + times * rate[1]
    area = 0.5 * math.sqrt(3.0) * spacing**2 * along * across
    stress, energy = np.zeros((len(times), 2, 2)), np.zeros(len(times))
    for turn in (0.0, math.pi / 3.0, 2.0 * math.pi / 3.0):
        first = spacing * np.array([math.cos(turn), math.sin(turn)])
        change = np.array(rate) * first
        d = first + times[:, None] * change
        length = np.hypot(d[:, 0], d[:, 1])
        fn = kn * (2.0 * radius - length)
        if fn.min(initial=0.0) < 0.0:
            raise ValueError(f"t up to {float(times.max())!r} is not allowed: a contact has opened by then")
        cross = float(first[0] * change[1] - first[1] * change[0])
        fs = np.zeros(len(times))
        if cross != 0.0:
            scaled = np.arcsinh(d @ change / abs(cross)) - math.asinh(float(first @ change) / abs(cross))
            fs = ks * cross / float(np.hypot(*change)) * scaled
        n = d / length[:, None]
        force = fn[:, None] * n - fs[:, None] * np.column_stack([-n[:, 1], n[:, 0]])
        stress += force[:, :, None] * d[:, None, :] / area[:, None, None]
        energy += 0.5 * fn**2 / kn + (0.5 * fs**2 / ks if ks > 0.0 else 0.0)
    return Stretched(stress, energy)


class Sheared(NamedTuple):
    """Stress [N/m], shape (s, 2, 2), compression positive; angle [rad] and spin [rad/s] of every disk, shape (s,)."""

    stress: FloatArray
    angle: FloatArray
    omega: FloatArray


def sheared(
    *,
    t: ArrayLike,
    rate: float,
    spacing: float,
    radius: float,
    kn: float,
    ks: float,
    inertia: float,
    dt: float = 0.0,
) -> Sheared:
    """Lattice in simple shear, ``x' = rate y``, whose disks start without spin: to first order in the shear ``rate t``.

    With the shear g, the angle a, and ``q = d/(2 R)`` the contact at the angle p has ``fs = -2 R ks (q g sin^2 p + a)`` and
    ``fn = fn_0 - kn d g sin p cos p``. Six contacts turn a disk by ``I a'' = -12 ks R^2 (a + q g/2)``, so it swings about half the flow's
    rotation: ``a = -(q rate/2)(t - sin(W t)/W)``, ``W^2 = 12 ks R^2/I``. The sums of ``sin^4``, ``sin^2 cos^2``, ``sin^2`` over the three
    contacts are 9/8, 3/8, 3/2; the turning of ``fn_0 n (x) d`` adds ``(9/8) fn_0 d g``. The stress is symmetric but for the inertia of the
    spins: ``sigma_xy - sigma_yx = q I a''/A``, where q represents arms R of contacts that are d < 2 R long.

    Central differences of the step dt have ``a_{n+1} - 2 a_n + a_{n-1} = -(W dt)^2 (a_n + q g_n/2)`` and ``a_1 = 0``: the same with ``sin(w
    t)/sin(w dt) dt`` for the sine over W, where ``sin(w dt/2) = W dt/2``, and with ``cos(w t)`` in the mean of the spins beside ``t_n``.

    Parameters
    ----------
    t : array_like
        Times [s].
    rate : float
        [1/s].
    spacing, radius, kn, ks
        As in `stretched`; ks > 0.
    inertia : float
        Moment of inertia of a disk [kg m^2], > 0.
    dt : float
        Step of central differences [s], below 2/W; 0: continuous time.

    Notes
    -----
    Source: derived here.
    """
    positive(spacing=spacing, radius=radius, kn=kn, ks=ks, inertia=inertia)
    finite(rate=rate)
    times = times_of(t)
    if spacing > 2.0 * radius:
        raise ValueError(f"spacing = {spacing!r} is not allowed: disks must touch, at most {2.0 * radius!r}")
    q, swing = 0.5 * spacing / radius, math.sqrt(12.0 * ks * radius**2 / inertia)
    g = rate * times
    not_negative(dt=dt)
    if swing * dt >= 2.0:
        raise ValueError(f"dt = {dt!r} is not allowed: central differences are stable below {2.0 / swing!r} s")
    width = 1.0 / swing
    if dt > 0.0:
        swing = 2.0 / dt * math.asin(0.5 * swing * dt)
        width = dt / math.sin(swing * dt)
    angle = -0.5 * q * rate * (times - width * np.sin(swing * times))
    omega = -0.5 * q * rate * (1.0 - np.cos(swing * times))
    force, area = kn * (2.0 * radius - spacing), 0.5 * math.sqrt(3.0) * spacing**2
    stress = np.zeros((len(times), 2, 2))
    stress[:, 0, 0] = stress[:, 1, 1] = 1.5 * force * spacing / area
    shared = (-0.375 * kn * spacing**2 + 1.125 * force * spacing) * g
    arm = 2.0 * radius * ks * spacing
    stress[:, 0, 1] = (shared - arm * (1.125 * q * g + 1.5 * angle)) / area
    stress[:, 1, 0] = (shared + arm * (0.375 * q * g + 1.5 * angle)) / area
    return Sheared(stress, angle, omega)
