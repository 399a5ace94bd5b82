"""Two spheres moved as prescribed, and the forces of a linear contact with a shear spring and Coulomb's limit, in closed form.

The motions are those of the contact-law tests of ON-DEM working group 4 (2025): shear within and beyond the limit of friction, rotation of
the pair in and out of the plane of shear, twist, spins, a dashpot that may pull, and unloading. The first sphere stays at the origin.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.references._validate import flag, not_negative, positive, times_of
from ninedisk.references.analytic.contact.turned_shear import turned_by

FloatArray = NDArray[np.float64]

MOTIONS = (
    "shear-elastic", "shear-plastic", "rotation-in-plane", "rotation-out-of-plane", "twist", "spin", "viscous", "unloading"
)  # fmt: skip
END = 6.0 * math.pi
"""Duration of every motion [s]."""
RAMP = math.pi
"""Until then the motions of rotation, twist and unloading shear the contact [s]."""
SHEAR = {"shear-elastic": 0.02, "shear-plastic": 0.08, "unloading": 0.04}
"""Shear over the radius; 0.02 in the others."""
SPIN = 0.01
"""Amplitude of the angle of both spheres in "spin" [rad]."""
TURN = math.pi
"""Angle of the rotations and of the twist at the end [rad]."""
ASIDE = math.pi / 6.0
"""Angle between the shear and the axis of the rotation out of the plane [rad]."""
OPENED = 0.6
"""Share of the overlap by which "unloading" opens the contact."""


class PairPath(NamedTuple):
    """Motion of the second sphere, ``x`` [m] and ``v`` [m/s], and of both: ``spin`` [rad/s], ``angle`` [rad], a turn about one axis.

    All have the shape (s, 3), one row for each time. The first sphere's centre is at rest at the origin; both spheres spin alike.
    """

    x: FloatArray
    v: FloatArray
    spin: FloatArray
    angle: FloatArray


class PairForces(NamedTuple):
    """Normal force ``fn`` [N], shape (s,), compression positive, and ``shear`` force on the first sphere [N], shape (s, 3)."""

    fn: FloatArray
    shear: FloatArray


def _checked(motion: object, radius: float, overlap: float, t: ArrayLike) -> FloatArray:
    if not (isinstance(motion, str) and motion in MOTIONS):
        raise ValueError(f"motion = {motion!r:.200} is unknown: use one of {', '.join(MOTIONS)}")
    positive(radius=radius, overlap=overlap)
    if overlap > 0.5 * radius:
        raise ValueError(f"overlap = {overlap:g} is not allowed: at most half of the radius, {0.5 * radius:g}")
    if overlap < 1e-6 * radius:
        raise ValueError(f"overlap = {overlap:g} is not allowed: at least 1e-6 of the radius, {radius:g}")
    times = times_of(t)
    if times.ndim != 1 or (times > END * (1.0 + 1e-9)).any():
        raise ValueError(f"t = {t!r:.200} is not allowed: one row of times, none after 6 pi s")
    return times


def pair_path(*, motion: str, radius: float, overlap: float, t: ArrayLike) -> PairPath:
    """Positions, velocities, spins and angles of the two spheres.

    Parameters
    ----------
    motion : str
        One of `MOTIONS`.
    radius : float
        Of both spheres [m], > 0.
    overlap : float
        At the start [m], in [1e-6, 1/2] radii; centres are at ``2 radius - overlap`` along z.
    t : array_like, shape (s,)
        Times [s], in [0, 6 pi].

    Returns
    -------
    PairPath

    Raises
    ------
    ValueError
        If an argument is outside its range; it is named.

    Examples
    --------
    After a quarter of a period the second sphere is 0.02 radii aside:

    >>> path = pair_path(motion="shear-elastic", radius=1.0, overlap=0.05, t=[0.0, np.pi / 2])
    >>> path.x.round(12).tolist()
    [[0.0, 0.0, 1.95], [0.02, 0.0, 1.95]]
    """
    times = _checked(motion, radius, overlap, t)
    length = 2.0 * radius - overlap
    x, v, spin, angle = (np.zeros((len(times), 3)) for _ in range(4))
    x[:, 2] = length
    if motion in ("shear-elastic", "shear-plastic"):
        aside = SHEAR[motion] * radius
        x[:, 0], v[:, 0] = aside * np.sin(times), aside * np.cos(times)
    elif motion == "spin":
        spin[:, 1], angle[:, 1] = SPIN * np.cos(times), SPIN * np.sin(times)
    elif motion == "viscous":
        x[:, 2], v[:, 2] = length - overlap * np.sin(times), -overlap * np.cos(times)
    else:
        aside = SHEAR.get(motion, 0.02) * radius
        ramp = np.minimum(times, RAMP)
        x[:, 0] = 0.5 * aside * (1.0 - np.cos(ramp))
        v[:, 0] = np.where(times < RAMP, 0.5 * aside * np.sin(ramp), 0.0)
        after = np.maximum(times - RAMP, 0.0)
        end = np.array([aside, 0.0, length])
        n, e, b = _frame(end)
        if motion == "unloading":
            opened = 0.5 * OPENED * overlap
            x += (opened * (1.0 - np.cos(0.4 * after)))[:, None] * n
            v += (0.4 * opened * np.sin(0.4 * after))[:, None] * n
            return PairPath(x, v, spin, angle)
        axis = {
            "rotation-in-plane": b, "rotation-out-of-plane": math.cos(ASIDE) * e + math.sin(ASIDE) * b, "twist": n
        }[motion]  # fmt: skip
        turn, rate = 0.5 * TURN * (1.0 - np.cos(0.2 * after)), 0.1 * TURN * np.sin(0.2 * after)
        spin, angle = rate[:, None] * axis, turn[:, None] * axis
        turned = turned_by(x, axis, turn)
        return PairPath(turned, v + np.cross(spin, turned), spin, angle)
    return PairPath(x, v, spin, angle)


def _frame(x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Normal, tangent in the plane of shear, and the direction at right angles to both."""
    n = x / np.linalg.norm(x)
    b = np.array([0.0, 1.0, 0.0])
    return n, np.cross(b, n), b


def pair_forces(
    *,
    motion: str,
    radius: float,
    overlap: float,
    kn: float,
    ks: float,
    mu: float,
    dashpot: float,
    t: ArrayLike,
    slip_arm: str = "overlap",
    spring_turned: bool = True,
    spring_twisted: bool = True,
    spring_cut: bool = True,
    tension: bool = False,
) -> PairForces:
    """Contact forces in a motion of `pair_path`, under the conventions that contact laws differ in.

    Spheres that do not spin slip at ``r phi'``, with the distance r and the angle phi of the normal. On the line ``x = u, z = L`` that is
    ``L u'/r``, so that the spring has ``L asinh(u/L)``. The pair then turns as one rigid body: nothing slips, and the spring turns along.
    A spring that keeps its direction in space holds ``(L atan(u/L), 0, -L ln(r/L))``, less what is along the normal. Spins about y give
    ``-2 a angle`` along x, with the arm a. The spring is clipped at ``mu kn overlap/ks`` between the ends of the strokes; that is exact if
    the limit changes more slowly than the spring, ``0.08 mu kn radius < ks L``.

    With the arm R the pair's own turn slips by ``q = (2 R - r) angle`` in a fixed direction of its frame. Once the spring has the length
    of its limit l, its angle psi from that direction obeys ``psi' = -sin(psi) q'/l``: ``tan(psi/2)`` falls as ``exp(-q/l)``.

    Parameters
    ----------
    motion, radius, overlap, t
        As in `pair_path`.
    kn, ks : float
        Stiffnesses [N/m], > 0. The shear force is ks times the spring.
    mu : float
        Coefficient of friction [-]. 0.04 radii of shear must not slip at the start: ``0.04 ks radius < mu kn overlap``, in "unloading"
        with the overlap that is left after the shear.
    dashpot : float
        Normal dashpot [N s/m], >= 0, of "viscous" alone.
    slip_arm : {"overlap", "radius"}
        Arm of the slip by spins: radius less half the overlap, or the radius. With the radius a pair that turns as one body slips.
    spring_turned, spring_twisted : bool
        The spring turns with the normal, which it must with ``slip_arm="radius"``; with the mean spin about the normal.
    spring_cut : bool
        Where friction limits the force, the spring is cut as well. False: the spring goes on, and only the force is limited.
    tension : bool
        The dashpot may pull.

    Returns
    -------
    PairForces

    Raises
    ------
    ValueError
        If an argument is outside its range; it is named.

    Notes
    -----
    Source: derived above.

    Examples
    --------
    The shear force at the end of the first elastic stroke, 0.02 m times ks less what the arc takes:

    >>> law = {"radius": 1.0, "overlap": 0.05, "kn": 1e7, "ks": 5e6, "mu": 0.5, "dashpot": 0.0}
    >>> forces = pair_forces(motion="shear-elastic", t=[np.pi / 2], **law)
    >>> round(float(np.linalg.norm(forces.shear)), 1)
    99998.2
    """
    times = _checked(motion, radius, overlap, t)
    positive(kn=kn, ks=ks, mu=mu)
    not_negative(dashpot=dashpot)
    flag(spring_turned=spring_turned, spring_twisted=spring_twisted, spring_cut=spring_cut, tension=tension)
    if slip_arm not in ("overlap", "radius"):
        raise ValueError(f"slip_arm = {slip_arm!r:.200} is unknown: use 'overlap' or 'radius'")
    length = 2.0 * radius - overlap
    most = SHEAR["unloading"] * radius
    if not ks * most < mu * kn * (2.0 * radius - math.hypot(length, most)):
        raise ValueError(
            f"ks = {ks:g}, mu = {mu:g}, kn = {kn:g}, overlap = {overlap:g}, radius = {radius:g} are not allowed: 0.04 radii of shear "
            "must not slip"
        )
    if not SHEAR["shear-plastic"] * mu * kn * radius < ks * length:
        raise ValueError(
            f"mu = {mu:g}, kn = {kn:g} are too large for ks = {ks:g}: 0.08 mu kn radius must be below ks L"
        )
    if slip_arm == "radius" and not spring_turned:
        raise ValueError("spring_turned = False is not allowed with slip_arm = 'radius': no closed form is known")
    path = pair_path(motion=motion, radius=radius, overlap=overlap, t=times)
    distance = np.linalg.norm(path.x, axis=1)
    n = path.x / distance[:, None]
    fn = kn * (2.0 * radius - distance)
    if motion == "viscous":
        fn = fn - dashpot * np.einsum("ij,ij->i", path.v, n)
        return PairForces(fn if tension else np.maximum(fn, 0.0), np.zeros((len(times), 3)))
    if motion == "spin":
        arm = radius - 0.5 * overlap if slip_arm == "overlap" else radius
        shear = np.zeros((len(times), 3))
        shear[:, 0] = -2.0 * ks * arm * path.angle[:, 1]
        return PairForces(fn, shear)
    if motion in ("shear-elastic", "shear-plastic"):
        spring = _stroked(motion, radius, overlap, mu * kn / ks, times, cut=spring_cut)
        e = np.stack([n[:, 2], np.zeros(len(times)), -n[:, 0]], axis=1)
        return PairForces(fn, ks * spring[:, None] * e)
    aside = SHEAR.get(motion, 0.02) * radius
    u = 0.5 * aside * (1.0 - np.cos(np.minimum(times, RAMP)))
    along, r = length * np.arcsinh(u / length), np.hypot(u, length)
    flat = np.stack([length / r, np.zeros(len(times)), -u / r], axis=1)
    if motion == "unloading":
        # The least overlap so far, which is at 7 pi/2.
        reached = np.where(times > 3.5 * math.pi, np.linalg.norm(_opened(radius, overlap)), distance)
        limit = mu * kn * (2.0 * radius - (reached if spring_cut else distance)) / ks
        return PairForces(fn, ks * np.minimum(along, limit)[:, None] * flat)
    if not spring_turned and motion != "twist":
        kept = np.stack([length * np.arctan(u / length), np.zeros(len(times)), -length * np.log(r / length)], axis=1)
        return PairForces(fn, ks * (kept - np.einsum("ij,ij->i", kept, n)[:, None] * n))
    shear = ks * along[:, None] * flat
    if motion == "twist" and not spring_twisted:
        return PairForces(fn, shear)
    size = np.linalg.norm(path.angle, axis=1)
    if not size.any():
        return PairForces(fn, shear)
    axis = path.angle[np.argmax(size)] / size.max()
    if motion != "twist" and slip_arm == "radius":
        deep = 2.0 * radius - math.hypot(length, aside)
        n0, e, b = _frame(np.array([aside, 0.0, length]))
        ahead = -np.cross(axis, n0)
        start = length * math.asinh(aside / length)
        slid = _dragged(start, complex(ahead @ e, ahead @ b), deep * size, mu * kn * deep / ks)
        moved = ks * (slid.real[:, None] * e + slid.imag[:, None] * b)
        shear = np.where((size > 0.0)[:, None], moved, shear)
    return PairForces(fn, turned_by(shear, axis, size))


def _dragged(start: float, ahead: complex, q: FloatArray, limit: float) -> NDArray[np.complex128]:
    """Spring that starts at ``start`` and is dragged by q in the direction ``ahead``, never longer than its limit."""
    local = start / ahead
    free = local + q
    until = math.sqrt(max(limit * limit - local.imag**2, 0.0)) - local.real
    psi = math.atan2(local.imag, local.real + until)
    tangent = math.tan(0.5 * psi) * np.exp(-np.maximum(q - until, 0.0) / limit)
    slides = limit * np.exp(2j * np.arctan(tangent))
    return np.asarray(np.where(q <= until, free, slides) * ahead)


def _opened(radius: float, overlap: float) -> FloatArray:
    """Place of the second sphere where "unloading" is widest."""
    return pair_path(motion="unloading", radius=radius, overlap=overlap, t=[3.5 * math.pi]).x


def _stroked(motion: str, radius: float, overlap: float, ratio: float, t: FloatArray, *, cut: bool) -> FloatArray:
    """Spring of a shear to and fro, limited by ``ratio`` times the overlap."""
    length = 2.0 * radius - overlap
    turns = math.pi * (np.arange(6) + 0.5)
    times, back = np.unique(np.concatenate([[0.0], t, turns]), return_inverse=True)
    u = SHEAR[motion] * radius * np.sin(times)
    free = length * np.arcsinh(u / length)
    limit = ratio * (2.0 * radius - np.hypot(u, length))
    if not cut:
        return np.asarray(np.clip(free, -limit, limit)[back[1 : 1 + len(t)]])
    spring = np.zeros(len(times))
    for k in range(1, len(times)):
        spring[k] = min(max(spring[k - 1] + free[k] - free[k - 1], -limit[k]), limit[k])
    return spring[back[1 : 1 + len(t)]]
