"""Row of equal disks hit at one end: one collision after the other, and all at once through linear springs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.references._validate import count, fraction, not_negative, positive, sizes, times_of

FloatArray = NDArray[np.float64]

POINTS = 256
"""Points per period of the fastest mode between which a contact's opening or closing is bracketed."""
MOST_DISKS, MOST_SPRINGS = 100, 20
"""Disks of a row of collisions; gaps of a row of springs, each event of which takes many exponentials."""
STRIDES, CONTACTS = 30_000, 200
"""Points in time, and events, after which a row of springs is given up: it creeps, or moves by less than the rounding of its gaps."""
EVENTS = 10_000
"""Events after which a row is given up: it collapses inelastically, with infinitely many collisions."""


class ChainHistory(NamedTuple):
    """Piecewise motion: ``t`` (k,) begins of the pieces [s]; ``x`` [m] and ``v`` [m/s] there, both of shape (k, n).

    ``x`` are displacements that count from the position in which all disks of the row just touch.
    """

    t: FloatArray
    x: FloatArray
    v: FloatArray

    def velocities(self, t: ArrayLike) -> FloatArray:
        """Velocities at times ``t``, shape (s, n), for pieces of uniform motion; a time at an event counts as after it."""
        return np.asarray(self.v[np.searchsorted(self.t, times_of(t), side="right") - 1])


def chain_of_collisions(*, gaps: Sequence[float], speed: float, restitution: float) -> ChainHistory:
    """Equal disks in a row at rest, the first one with a velocity towards the others: each collision is one of two disks.

    Two equal disks that meet exchange ``(1 + e)/2`` of their relative velocity. With e = 1 the velocity is handed on, and the last
    disk leaves with all of it; with e < 1 disks meet again.

    Parameters
    ----------
    gaps : sequence of float
        Gaps between neighbours [m], > 0: collisions at one time have no truth by this law.
    speed : float
        Velocity of the first disk [m/s], > 0.
    restitution : float
        Coefficient of restitution, in [0, 1].

    Raises
    ------
    ValueError
        If an argument is out of range, collisions coincide, or they do not end.
    """
    positive(speed=speed)
    gaps = sizes("gaps", gaps, most=MOST_DISKS - 1, strict=True)
    fraction(restitution=restitution)
    n = len(gaps) + 1
    x, v = np.concatenate(([0.0], np.cumsum(np.asarray(gaps, dtype=np.float64)))), np.zeros(n)
    v[0] = speed
    times, places, velocities = [0.0], [x.copy()], [v.copy()]
    for _ in range(EVENTS):
        closing = v[:-1] - v[1:]
        room = np.diff(x)
        with np.errstate(divide="ignore", invalid="ignore"):
            wait = np.where(closing > 1e-14 * speed, room / closing, np.inf)
        k = int(np.argmin(wait))
        if not np.isfinite(wait[k]):
            return ChainHistory(np.array(times), np.array(places), np.array(velocities))
        next_two = np.sort(wait)[:2]
        if len(next_two) == 2 and next_two[1] - next_two[0] <= 1e-12 * next_two[0]:
            raise ValueError(f"gaps = {tuple(gaps)!r} are not allowed: two collisions coincide")
        x = x + v * wait[k]
        x[k + 1] = x[k]
        exchanged = 0.5 * (1.0 + restitution) * closing[k]
        v = v.copy()
        v[k] -= exchanged
        v[k + 1] += exchanged
        times.append(times[-1] + float(wait[k]))
        places.append(x.copy())
        velocities.append(v.copy())
    raise ValueError(
        f"restitution = {restitution!r} is not allowed here: the row collapses with more than {EVENTS} collisions"
    )


def touching_row(*, n: int, speed: float, restitution: float) -> FloatArray:
    """Velocities after Newton's law at all contacts of a touching row at once, shape (n,) [m/s].

    Every contact gives back e times its approach: the first one ``e v``, the others nothing. All except the first disk therefore go on
    together with ``(1 + e) v/n``, and the first one with ``e v`` less. Momentum is kept for any e, energy for e = 1.

    Parameters
    ----------
    n : int
        Number of equal disks, >= 2.
    speed : float
        Velocity of the first disk [m/s], > 0.
    restitution : float
        Coefficient of restitution e, in [0, 1].

    Notes
    -----
    Source: Moreau (1988), CISM Courses and Lectures 302: the complementarity problem whose solution has all impulses > 0.
    """
    positive(speed=speed)
    count(n=n, least=2)
    fraction(restitution=restitution)
    v = np.full(n, (1.0 + restitution) * speed / n)
    v[0] -= restitution * speed
    return v


def chain_of_springs(
    *, gaps: Sequence[float], speed: float, mass: float, kn: float, beta: float = 0.0
) -> tuple[ChainHistory, float]:
    """Equal disks in a row, contacts being springs and dashpots that push only; velocities once all have parted, and the time.

    While the set of contacts that push stays the same, the row is a linear system, ``z' = A z``, solved by the exponential of A. A
    contact ends where its force ``kn delta + c delta'`` vanishes, and begins where an overlap does, or where that force becomes
    positive again within an overlap. Each event is found to round-off.

    Parameters
    ----------
    gaps : sequence of float
        Gaps between neighbours [m], >= 0.
    speed : float
        Velocity of the first disk [m/s], > 0.
    mass : float
        Mass of each disk [kg], > 0.
    kn : float
        Stiffness [N/m], > 0.
    beta : float
        Contact damping ratio [-], >= 0.

    Returns
    -------
    ChainHistory
        Pieces between events; in the last one all disks move uniformly and apart.
    float
        Time of the last event [s].

    Notes
    -----
    Source: Herrmann & Schmaelzle (1981), Am. J. Phys. 49, 761, who show that touching balls do not hand the velocity on; solved
    here. With gaps in touch and beta = 0 the outcome depends neither on mass nor on stiffness.
    """
    positive(speed=speed, mass=mass, kn=kn)
    not_negative(beta=beta)
    gaps = sizes("gaps", gaps, most=MOST_SPRINGS)
    row = _Row(len(gaps) + 1, mass, kn, beta)
    z = np.concatenate((np.concatenate(([0.0], np.cumsum(np.asarray(gaps, dtype=np.float64)))), np.zeros(row.n)))
    z[row.n] = speed
    t, times, states = 0.0, [0.0], [z]
    for _ in range(CONTACTS):
        active = row.pushing(z)
        wait = row.next_event(z, active, speed)
        if not math.isfinite(wait):
            pieces = np.array(states)
            return ChainHistory(np.array(times), pieces[:, : row.n], pieces[:, row.n :]), t
        z = row.flow(active, wait) @ z
        t += wait
        times.append(t)
        states.append(z)
    raise ValueError(f"beta = {beta!r} is not allowed here: the row has more than {CONTACTS} contacts")


class _Row:
    """The linear systems of a row; a state is positions, then velocities."""

    def __init__(self, n: int, mass: float, kn: float, beta: float) -> None:
        self.n, self.stiff = n, kn / mass
        self.rub = 2.0 * beta * math.sqrt(0.5 * mass * kn) / mass
        fast = math.sqrt(4.0 * self.stiff) * (1.0 + 2.0 * beta)
        self.grain = 2.0 * math.pi / fast / POINTS
        self.strides = 0
        self.given = f"speed, mass = {mass:g} kg, kn = {kn:g} N/m, beta = {beta:g}"

    def push(self, z: FloatArray) -> FloatArray:
        """Force of each contact over the mass, were it active; negative where it would pull."""
        x, v = z[..., : self.n], z[..., self.n :]
        return np.asarray(self.stiff * (x[..., :-1] - x[..., 1:]) + self.rub * (v[..., :-1] - v[..., 1:]))

    def pushing(self, z: FloatArray) -> NDArray[np.bool_]:
        """Contacts that act from this state on: closed ones whose force is positive, or is about to be.

        A contact of two disks at rest that just touch is among them if it pushes after a moment.
        """
        x, v = z[: self.n], z[self.n :]
        overlap, rate = x[:-1] - x[1:], v[:-1] - v[1:]
        fastest = float(np.abs(v).max())
        scale = 1e-13 * (np.abs(x).max() + fastest * self.grain)
        force = self.push(z)
        small = 1e-12 * (self.stiff * scale + self.rub * fastest + self.stiff * fastest * self.grain)
        active = (overlap >= -scale) & ((force > small) | ((np.abs(force) <= small) & (rate > 1e-12 * fastest)))
        neutral = (np.abs(overlap) <= scale) & (np.abs(rate) <= 1e-12 * fastest)
        if neutral.any() and active.any():
            active |= neutral & (self.push(self.flow(active | neutral, self.grain) @ z) > 0.0)
        return np.asarray(active)

    def matrix(self, active: NDArray[np.bool_]) -> FloatArray:
        """A of ``z' = A z``."""
        n = self.n
        a = np.zeros((2 * n, 2 * n))
        a[:n, n:] = np.eye(n)
        for k in np.flatnonzero(active):
            for i, sign in ((k, -1.0), (k + 1, 1.0)):
                a[n + i, [k, k + 1]] += sign * self.stiff * np.array([1.0, -1.0])
                a[n + i, [n + k, n + k + 1]] += sign * self.rub * np.array([1.0, -1.0])
        return a

    def flow(self, active: NDArray[np.bool_], time: float) -> FloatArray:
        """The system's exponential over a time."""
        from scipy.linalg import expm  # slow to import, and most runs do not need it

        return np.asarray(expm(self.matrix(active) * time))

    def next_event(self, z: FloatArray, active: NDArray[np.bool_], speed: float) -> float:
        """Time until a contact stops or begins to push; infinite where none does any more."""
        if not active.any():
            return self._meeting(z, speed)
        stride, now, t = self.flow(active, self.grain), z, 0.0
        while True:
            self.strides += 1
            if self.strides > STRIDES or not np.isfinite(now).all():
                raise ValueError(
                    f"gaps of the row with {self.given} are not allowed: no contact has ended after {STRIDES} points in time; "
                    "the row creeps, or moves by less than the rounding of its gaps"
                )
            then = stride @ now
            changed = self._changes(then, active)
            if changed.any():
                return t + min(self._when(z, active, t, int(k)) for k in np.flatnonzero(changed))
            now, t = then, t + self.grain

    def _changes(self, z: FloatArray, active: NDArray[np.bool_]) -> NDArray[np.bool_]:
        force, overlap = self.push(z), z[: self.n - 1] - z[1 : self.n]
        return np.where(active, force < 0.0, (overlap > 0.0) & (force > 0.0))

    def _when(self, z: FloatArray, active: NDArray[np.bool_], t: float, k: int) -> float:
        """Time since ``t``, at most a grain, at which contact k changes."""
        from scipy.optimize import brentq  # slow to import, and most runs do not need it

        def sign(since: float) -> float:
            return self._sign(z, active, t + since, k)

        if sign(0.0) * sign(self.grain) >= 0.0:
            return self.grain
        return float(brentq(sign, 0.0, self.grain, xtol=1e-300, rtol=1e-15))

    def _sign(self, z: FloatArray, active: NDArray[np.bool_], t: float, k: int) -> float:
        """What changes its sign as contact k stops, or begins: its force; its overlap where that comes later."""
        state = self.flow(active, t) @ z
        force, overlap = float(self.push(state)[k]), float(state[k] - state[k + 1])
        return force if active[k] else min(force, self.stiff * overlap)

    def _meeting(self, z: FloatArray, speed: float) -> float:
        """Time until two of the freely moving disks touch, or push within an overlap that a dashpot has left."""
        x, v = z[: self.n], z[self.n :]
        closing, room = v[:-1] - v[1:], x[1:] - x[:-1]
        with np.errstate(divide="ignore", invalid="ignore"):
            wait = np.where(closing > 1e-13 * speed, np.maximum(room, 0.0) / closing, np.inf)
        return float(wait.min())
