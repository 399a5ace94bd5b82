"""How far given contact forces are from a solution of a contact problem in 2D or 3D, from the law alone.

Bodies and contacts obey, with ``p >= 0`` pressing, ``u_n > 0`` opening and friction against the slip::

    M v = f + H r,     u = H' v + w     or, the bodies eliminated,     u = W r + q
    0 <= p  complementary to  u_n >= 0,     |r_t| <= mu p,     mu p |u_t| + r_t . u_t = 0

which is Coulomb's law; under the associated rule ``u_n - mu |u_t|`` replaces u_n. (H as Siconos and FCLIB have it, a
column for each contact force.) Nothing is solved here and nothing is taken from those who solve: a solution is judged by what it
claims.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray
from scipy.sparse.linalg import splu

FloatArray = NDArray[np.float64]
Matrix = sp.csr_array | sp.csc_array | sp.coo_array | ArrayLike


MOST_FLOOR = 1e-8
"""Errors above this are never put down to rounding."""


class Errors(NamedTuple):
    """Errors of forces r and velocities u, all relative to the problem's own forces and works, so that no units matter; 0 is exact.

    Forces are compared with F, the largest force, or the largest ``|P(-b/W_max)|`` where that is more: b are the velocities without
    contact forces, W_max is the larger diagonal entry of a contact's block of W, P the projection on the cones. Works are compared with
    E, the larger one of ``|r' W r|`` and ``|b' r|``, which are equal at a solution.

    Attributes
    ----------
    natural_map : float
        ``|r - P(r - u*/W_max)| / |r|`` over all contacts, ``u* = u``, with ``mu |u_t|`` added to u_n under Coulomb's law; relative to
        ``|P(-b/W_max)|`` where that is larger. Zero at solutions only.
    complementarity : float
        ``sum |p u_n| / E``; under the associated rule ``sum |r . u| / E``.
    cone : float
        Largest tension ``-p`` or friction beyond ``mu p``, over F.
    opening : float
        Largest velocity into the contact, ``-u_n`` (``mu |u_t| - u_n`` under the associated rule), over ``F W_max``, and,
        beyond what its rounding explains, over the largest ``|b|``: the larger ratio counts: large forces elsewhere hide no contact.
    slip : float
        ``sum |mu p |u_t| + r_t . u_t| / E``: friction that does not oppose slip, or is too weak for it.
    dynamics : float
        ``|M v - f - H r|`` over the larger one of ``|f|`` and ``|H r|``, in the norm of the inverse masses, or ``|u - H' v - w|`` and
        ``|u - W r - q|`` over the largest norm of their terms, whichever is worse.
    duality_gap : float
        Associated rule only, else NaN: bound on the relative error of ``1/2 r' W r + b' r``, if no normal force of the solution exceeds the
        largest one found.
    floor : float
        What rounding of the terms of u alone explains of the natural map and of works, at most `MOST_FLOOR`.
    """

    natural_map: float
    complementarity: float
    cone: float
    opening: float
    slip: float
    dynamics: float
    duality_gap: float
    floor: float

    def solved(self, tolerance: float) -> bool:
        """Whether no error exceeds the tolerance, or what rounding explains."""
        return self.worst <= max(tolerance, self.floor)

    @property
    def worst(self) -> float:
        """The largest error; NaN counts as infinite but for the gap."""
        errors = [*self[:6], *([] if np.isnan(self.duality_gap) else [self.duality_gap])]
        return float("inf") if np.isnan(errors).any() else max(errors)


def errors_of_forces(
    w: Matrix, q: ArrayLike, mu: ArrayLike, r: ArrayLike, u: ArrayLike | None = None, *, associated: bool = False
) -> Errors:
    """Errors of the forces ``r`` in ``u = W r + q``.

    Parameters
    ----------
    w : sparse or dense matrix, shape (d c, d c)
        d = 2 or 3 unknowns for each contact.
    q, r : array_like, d c numbers
        For each contact normal, then tangential.
    mu : array_like, shape (c,)
    u : array_like, d c numbers, optional
        Velocities that the solution claims; None: those of its forces.
    associated : bool
        The associated rule instead of Coulomb's law.

    Raises
    ------
    ValueError
        If a shape does not fit.
    """
    matrix, b, forces, friction = _checked("W", w, q, mu, r)
    if matrix.shape != (b.size, b.size):
        raise ValueError(f"W has shape {matrix.shape}; it must be {b.size} square")
    push = matrix @ forces.ravel()
    noise = (abs(matrix) @ np.abs(forces.ravel())).reshape(b.shape) + np.abs(b)
    own = push.reshape(b.shape) + b
    claimed = own if u is None else _by_contact("u", u, *b.shape)
    off = _ratio(np.linalg.norm(claimed - own), np.linalg.norm(push), np.linalg.norm(b), np.linalg.norm(claimed))
    return _errors(b, push.reshape(b.shape), matrix.diagonal(), friction, forces, claimed, off, noise, associated)


def errors_of_motion(
    m: Matrix,
    h: Matrix,
    f: ArrayLike,
    w: ArrayLike,
    mu: ArrayLike,
    r: ArrayLike,
    v: ArrayLike | None = None,
    u: ArrayLike | None = None,
    *,
    associated: bool = False,
) -> Errors:
    """Errors of the forces ``r``, and the motion ``v`` if the solution gives it, in ``M v = f + H r``, ``u = H' v + w``.

    Parameters
    ----------
    m, h : sparse or dense matrix, shapes (n, n) and (n, d c)
        M symmetric and positive definite.
    f, v : array_like, n numbers
        Loads; velocities that the solution claims, None: those of its forces.
    w, r, u, mu, associated
        As in `errors_of_forces`, w the part of u that no body has.

    Raises
    ------
    ValueError
        If a shape does not fit, or M is singular.
    """
    turned, offset, forces, friction = _checked("H'", _sparse(h).T, w, mu, r)
    mass, load = _sparse(m), np.asarray(f, dtype=np.float64).ravel()
    n = len(load)
    if mass.shape != (n, n) or turned.shape != (offset.size, n):
        raise ValueError(f"M has shape {mass.shape} and H {turned.shape[::-1]}; f has {n} unknowns")
    pull = turned.T @ forces.ravel()
    if (mass - sp.diags_array(mass.diagonal())).count_nonzero():
        try:
            factors = splu(sp.csc_matrix(mass))
        except RuntimeError as error:
            raise ValueError("M is singular") from error
        free, moved = (np.asarray(factors.solve(each)) for each in (load, pull))
        columns = np.asarray(factors.solve(turned.T.toarray()))
        diagonal = np.einsum("ij,ji->i", turned.toarray(), columns)
    else:
        masses = mass.diagonal()
        if n and not masses.min() > 0.0:
            raise ValueError("M is singular")
        free, moved, diagonal = load / masses, pull / masses, turned.multiply(turned) @ (1.0 / masses)
    motion = free + moved if v is None else np.asarray(v, dtype=np.float64).ravel()
    if motion.shape != (n,):
        raise ValueError(f"v has {motion.size} numbers; it must have {n}")
    rest = motion - free - moved
    balance = _ratio(*(np.sqrt(abs(each @ (mass @ each))) for each in (rest, free, moved)))
    b = (turned @ free).reshape(offset.shape) + offset
    own = (turned @ motion).reshape(offset.shape) + offset
    claimed = own if u is None else _by_contact("u", u, *offset.shape)
    push = (turned @ moved).reshape(offset.shape)
    # As by the forces alone: velocities of bodies at rest are what rounding leaves of these.
    off = _ratio(np.linalg.norm(claimed - own), np.linalg.norm(push), np.linalg.norm(b), np.linalg.norm(claimed))
    noise = (abs(turned) @ (np.abs(free) + np.abs(moved))).reshape(offset.shape) + np.abs(offset)
    return _errors(b, push, diagonal, friction, forces, claimed, max(off, balance), noise, associated)


def friction_error(fn: ArrayLike, fs: ArrayLike, slip: ArrayLike, mu: ArrayLike) -> float:
    """How far friction is from Coulomb's law at the normal forces and slips that go with it, over what it could bear in all.

    The law asks for ``-mu fn sign(slip)`` of a contact that slips, and of one that sticks for the nearest force with ``|fs| <= mu fn``.
    The error is the sum of ``|fs - asked|`` over the sum of ``mu fn``: 0 is exact, 1 a slide without friction, 2 one pushed along.

    A natural map ``|fs - clip(fs - rho slip, -mu fn, mu fn)|`` is the same for rho without bound. Any other rho is a mass over a time
    that a user has to choose, and decides how much of the error a slow slip is forgiven; here nothing is chosen. The price is a
    jump at slip 0, which no rounded velocity hits: who measures slips knows how well, and hands over 0 for those that it cannot decide
    from none. Such a contact is held to the cone alone, so that the error is a lower bound as far as slips that slow go. Weights
    are forces and not works ``fs slip``, or else a few fast slips would be all that counts, and contacts that stick outside the cone
    nothing. Whether ``fn`` itself is right is asked by `errors_of_forces`, with the bodies' equations.

    Parameters
    ----------
    fn, fs : array_like, shape (..., k)
        Normal forces, pressing > 0 (less counts as 0), and friction, or the impulses of a step; any one unit.
    slip : array_like, shape (..., k)
        Velocity, or displacement in a step, in the direction in which fs > 0 pushes; 0: sticks.
    mu : array_like, shape (k,)

    Returns
    -------
    float
        NaN if a number is; infinite if there is friction and no pressure at all.

    Raises
    ------
    ValueError
        If mu is negative.
    """
    pressure, friction, moved, factor = (np.asarray(each, dtype=np.float64) for each in (fn, fs, slip, mu))
    if not (factor >= 0.0).all():
        raise ValueError("mu must be >= 0")
    most = factor * np.maximum(pressure, 0.0)
    asked = np.where(moved == 0.0, np.clip(friction, -most, most), -np.sign(moved) * most)
    error = float(np.abs(friction - asked).sum())
    return error if np.isnan(error) else _ratio(error, most.sum())


class Planar(NamedTuple):
    """``m``, ``h`` and ``f``, ``w`` of `errors_of_motion`."""

    m: sp.csr_array
    h: sp.csr_array
    f: FloatArray
    w: FloatArray


def planar_bodies(
    *,
    mass: FloatArray,
    force: FloatArray,
    bodies: NDArray[np.integer],
    normal: FloatArray,
    arms: FloatArray,
    offset: FloatArray,
    compliance: FloatArray,
    shear_0: FloatArray,
) -> Planar:
    """Matrices of rigid bodies in the plane with elastic contacts, fields and signs as docs/reference/notation.md has them.

    A contact opens with ``(v_j - v_i) . n`` and slides with ``(v_i - v_j) . t``, t being n turned counter-clockwise. Unknowns with an
    infinite mass are left out, at rest. A compliance is its own unknown s, with the mass 1/C: ``s/C = r`` adds ``C r`` to u.

    Parameters
    ----------
    mass, force : ndarray, shape (b, 3)
        For x, y and rotation.
    bodies : ndarray, shape (c, 2)
        Body i and j, -1 for none.
    normal : ndarray, shape (c, 2)
    arms : ndarray, shape (c, 4)
        What the rotations of i and j add to u_n and to u_t.
    offset, compliance : ndarray, shape (c, 2)
    shear_0 : ndarray, shape (c,)
        Shear force at which a tangential compliance is without strain.
    """
    c = len(bodies)
    tangent = np.column_stack([-normal[:, 1], normal[:, 0]])
    rows, columns, values = [], [], []
    for side, sign in ((0, 1.0), (1, -1.0)):
        k = np.flatnonzero(bodies[:, side] >= 0)
        first = 3 * bodies[k, side].astype(np.int64)
        for axis in range(2):
            rows += [first + axis, first + axis]
            columns += [2 * k, 2 * k + 1]
            values += [-sign * normal[k, axis], sign * tangent[k, axis]]
        rows += [first + 2, first + 2]
        columns += [2 * k, 2 * k + 1]
        values += [arms[k, side], arms[k, 2 + side]]
    entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    every = sp.csr_array(entries, shape=(mass.size, 2 * c))
    finite = np.flatnonzero(np.isfinite(mass.ravel()))
    soft = np.flatnonzero(compliance.ravel() > np.finfo(np.float64).tiny)  # below, 1/C is no number
    springs = sp.csr_array((np.ones(len(soft)), (np.arange(len(soft)), soft)), shape=(len(soft), 2 * c))
    w = offset.copy()
    w[:, 1] -= compliance[:, 1] * shear_0
    return Planar(
        m=sp.csr_array(sp.diags_array(np.concatenate([mass.ravel()[finite], 1.0 / compliance.ravel()[soft]]))),
        h=sp.csr_array(sp.vstack([every[finite], springs])),
        f=np.concatenate([force.ravel()[finite], np.zeros(len(soft))]),
        w=w,
    )


def _errors(
    b: FloatArray,
    push: FloatArray,
    diagonal: FloatArray,
    mu: FloatArray,
    r: FloatArray,
    u: FloatArray,
    dynamics: float,
    noise: FloatArray,
    associated: bool,
) -> Errors:
    if not len(mu):
        return Errors(0.0, 0.0, 0.0, 0.0, 0.0, dynamics, 0.0 if associated else np.nan, 0.0)
    if not (np.isfinite(r).all() and np.isfinite(u).all()):
        lost = np.inf if associated else np.nan
        return Errors(np.inf, np.inf, np.inf, np.inf, np.inf, np.inf, lost, 0.0)
    stiffness = diagonal.reshape(b.shape)
    stiff = np.where(mu > 0.0, stiffness.max(axis=1), stiffness[:, 0])
    p, friction = r[:, 0], np.linalg.norm(r[:, 1:], axis=1)
    slides = (mu > 0.0)[:, None]  # a smooth contact has no tangential law
    u_t = np.where(slides, u[:, 1:], 0.0)
    slip = np.linalg.norm(u_t, axis=1)
    starred = u[:, 0] + (0.0 if associated else mu * slip)
    target = _nearest(p - starred / stiff, np.where(slides, r[:, 1:] - u_t / stiff[:, None], 0.0), mu)
    alone = _nearest(-b[:, 0] / stiff, np.where(slides, -b[:, 1:] / stiff[:, None], 0.0), mu)
    size = max(float(np.linalg.norm(r)), float(np.linalg.norm(alone)))
    force = max(float(np.abs(r).max()), float(np.linalg.norm(alone, axis=1).max()))
    work = max(abs(float((r * push).sum())), abs(float((b * r).sum())))
    room = u[:, 0] - (mu * slip if associated else 0.0)
    gained = (r * u).sum(axis=1)
    product = gained if associated else p * u[:, 0]
    speed = float(np.linalg.norm(b, axis=1).max())
    unit = 32.0 * np.finfo(np.float64).eps
    rounding = (unit * np.linalg.norm(noise / stiff[:, None]), size), (unit * (np.abs(r) * noise).sum(), work)
    gap = np.nan
    if associated:
        lost = abs(float(gained.sum())) + max(float(p.max()), 0.0) * float(np.maximum(-room, 0.0).sum())
        gap = _ratio(lost, work)
    return Errors(
        natural_map=_ratio(np.linalg.norm(r - target), size),
        complementarity=_ratio(np.abs(product).sum(), work),
        cone=_ratio(max(float((-p).max()), float((friction - mu * np.maximum(p, 0.0)).max()), 0.0), force),
        opening=max(
            _ratio(max(float((-room / stiff).max()), 0.0), force),
            _ratio(max(float((-room - unit * noise[:, 0]).max()), 0.0), speed),
        ),
        slip=0.0 if associated else _ratio(np.abs(mu * p * slip + (r[:, 1:] * u_t).sum(axis=1)).sum(), work),
        dynamics=float(dynamics),
        duality_gap=gap,
        floor=min(max(_ratio(*each) for each in rounding), MOST_FLOOR),
    )


def _nearest(p: FloatArray, q: FloatArray, mu: FloatArray) -> FloatArray:
    """The point of each cone nearest to (p, q), q of shape (c, d - 1): itself, or that on the ray towards q, or the tip."""
    # Distances are not compared: their squares do not see a small force beside a large velocity.
    size = np.linalg.norm(q, axis=1)
    along = np.maximum(p + mu * size, 0.0) / (1.0 + mu * mu)
    towards = q / np.where(size > 0.0, size, 1.0)[:, None]
    inside = (p >= 0.0) & (size <= mu * p)
    return np.where(inside[:, None], np.column_stack([p, q]), np.column_stack([along, (mu * along)[:, None] * towards]))


def _ratio(error: float | np.floating, *scales: float | np.floating) -> float:
    """The error over the largest scale; 0 where there is none to speak of, infinite where there is no scale."""
    size, scale = float(error), max(float(each) for each in scales)
    if size == 0.0:
        return 0.0
    return size / scale if scale > 0.0 else np.inf


def _sparse(value: Matrix) -> sp.csr_array:
    return sp.csr_array(value if sp.issparse(value) else np.atleast_2d(np.asarray(value, dtype=np.float64)))


def _by_contact(name: str, value: ArrayLike, c: int, d: int) -> FloatArray:
    array = np.asarray(value, dtype=np.float64)
    if array.size != d * c:
        raise ValueError(f"{name} has {array.size} numbers; it must have {d * c}, {d} for each mu")
    return array.reshape(c, d)


def _checked(
    name: str, matrix: Matrix, b: ArrayLike, mu: ArrayLike, r: ArrayLike
) -> tuple[sp.csr_array, FloatArray, FloatArray, FloatArray]:
    friction = np.asarray(mu, dtype=np.float64).ravel()
    if not (friction >= 0.0).all():
        raise ValueError("mu must be >= 0")
    found, c = _sparse(matrix), len(friction)
    if not np.isfinite(found.data).all():
        raise ValueError(f"{name} must be finite")
    d = 3 if c and found.shape[0] == 3 * c else 2
    return found, _by_contact("w or q", b, c, d), _by_contact("r", r, c, d), friction
