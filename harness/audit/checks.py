"""Physics held against a trajectory, interval by interval: each check's value, and the allowance that digits, sampling and step give it.

What may have touched during an interval is grouped; a group that met no wall keeps its momentum and angular momentum and gains no energy,
whatever its contacts do inside, and what walls gave to one lies in the cone of their normals and friction. Nothing here integrates.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.core.scene.motion import compile_motion, wall_poses
from ninedisk.harness.audit.scene import AuditScene

EPS = 2.0**-52
"""Rounding of an engine's own step, relative; in single precision 2^29 times that."""
ROUNDS = 5
"""How often groups of coarse frames are widened: each hit may throw a disk at another that none seemed to touch."""
TITLES = {
    "finite": ("Every number is finite", ""),
    "particles": ("No disk is lost, duplicated or new", ""),
    "time": ("Times grow", "s"),
    "motion": ("Positions change as velocities say", "m"),
    "turning": ("Angles change as spins say", "rad"),
    "free": ("Velocities change only at contacts", "m/s"),
    "momentum": ("Momentum changes only by gravity and walls", "N s"),
    "spin": ("Angular momentum is conserved", "N m s"),
    "energy": ("Energy grows only by the work of walls", "J"),
    "kept": ("Energy is conserved without friction and damping", "J"),
    "overlap": ("No overlap beyond springs or slop", "m"),
    "cone": ("Contact forces lie in the friction cone", "N"),
    "reversal": ("The reversed run retraces the path", "m"),
}
"""Checks: title, unit of value and allowance."""
Words = Callable[[int], str]


@dataclass(frozen=True)
class State:
    """One frame, disks in the order of the first frame's ids; errors are half units of the last printed place, NaN where a disk lacks."""

    step: int
    t: float
    et: float
    place: str
    x: FloatArray
    v: FloatArray
    omega: FloatArray | None
    angle: FloatArray | None
    ex: FloatArray
    ev: FloatArray
    eo: FloatArray
    ea: FloatArray
    here: NDArray[np.bool_]


@dataclass(frozen=True)
class Bodies:
    """What does not change: ids, radii [m], masses [kg], moments of inertia [kg m^2], which disks are fixed."""

    id: NDArray[np.int64]
    radius: FloatArray
    mass: FloatArray
    inertia: FloatArray
    fixed: NDArray[np.bool_]


@dataclass
class Tally:
    """What one check has found so far.

    Attributes
    ----------
    judged, undecided, beyond : int
        Comparisons made, not made, and lost.
    why_not : Counter
        Reasons why some could not be made.
    first, worst : dict or None
        The earliest violation and the largest value over its allowance.
    series : list of (t, value, allowance)
        The worst of each instant.
    """

    name: str
    judged: int = 0
    undecided: int = 0
    beyond: int = 0
    why_not: Counter[str] = field(default_factory=Counter)
    first: dict[str, Any] | None = None
    worst: dict[str, Any] | None = None
    scene: State | None = None
    series: list[tuple[float, float, float]] = field(default_factory=list)

    def skip(self, count: int, why: str) -> None:
        """Note comparisons that cannot be made."""
        if count > 0:
            self.undecided += int(count)
            self.why_not[why] += int(count)

    def judge(
        self,
        state: State,
        value: FloatArray,
        parts: Mapping[str, FloatArray],
        who: Words,
        members: Callable[[int], NDArray[np.int64]],
    ) -> None:
        """Compare values with allowances, the sum of their parts.

        Parameters
        ----------
        state : State
            The instant.
        value : ndarray, shape (k,)
        parts : mapping from reason to ndarray, shape (k,)
        who, members : function of int
            Whom the k-th value is about: words, and numbers of disks.
        """
        if len(value) == 0:
            return
        allowance = np.sum([np.broadcast_to(part, value.shape) for part in parts.values()], axis=0)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.where(value <= 0.0, 0.0, value / allowance)
        if not (np.isfinite(ratio).all() and np.isfinite(value).all() and np.isfinite(allowance).all()):
            ratio, value, allowance = (
                np.nan_to_num(ratio, posinf=np.inf),
                np.nan_to_num(value),
                np.nan_to_num(allowance),
            )
        k = int(np.argmax(ratio))
        self.judged += len(value)
        lost = int((ratio > 1.0).sum())
        self.beyond += lost
        self.series.append((state.t, float(value[k]), float(allowance[k])))
        worse = self.worst is None or ratio[k] > self.worst["ratio"]
        if worse or (lost and self.first is None):
            given = {
                "step": state.step, "t": state.t, "place": state.place, "who": who(k), "value": float(value[k]),
                "allowance": float(allowance[k]), "ratio": min(float(ratio[k]), 1e300),
                "parts": {name: float(np.nan_to_num(np.broadcast_to(part, value.shape)[k])) for name, part in parts.items()},
                "disks": members(k)[:50].tolist(),
            }  # fmt: skip
            if lost and self.first is None:
                self.first = given
            if worse:
                self.worst, self.scene = given, state if ratio[k] > 1.0 else None


@dataclass(frozen=True)
class _Contacts:
    """What may have touched in an interval: pairs of disks, disks with walls, groups of the former."""

    pairs: NDArray[np.int64]
    walled: NDArray[np.int64]
    anchored: NDArray[np.bool_]
    degree: NDArray[np.int64]
    label: NDArray[np.int64]
    groups: int


class _Interval(NamedTuple):
    """From frame ``b`` to ``c``, ``h`` [s] later, in engine's steps of ``dt`` [s].

    Attributes
    ----------
    use : ndarray of bool, shape (n,)
        Disks that move and are in both frames.
    touch : _Contacts
    dv, ev : ndarray, shape (n, 2) and (n,)
        Change of velocity beyond those of gravity and damping, and its digits [m/s].
    hidden : float
        Round-off of the engine's steps, relative.
    squeeze : ndarray, shape (n,)
        Sum of the spring forces on each disk [N], the larger of both frames'.
    """

    b: State
    c: State
    h: float
    dt: float
    use: NDArray[np.bool_]
    touch: _Contacts
    dv: FloatArray
    ev: FloatArray
    hidden: float
    squeeze: FloatArray


class Auditor:
    """Takes the states of a trajectory one after the other; three are held.

    Parameters
    ----------
    scene : AuditScene
    bodies : Bodies
    has_velocity : bool
        False: velocities are central differences, whose error contacts show.
    digits : mapping
        How each column was rounded, in words.
    """

    def __init__(self, scene: AuditScene, bodies: Bodies, *, has_velocity: bool, digits: Mapping[str, str]) -> None:
        self.scene, self.bodies, self.digits, self.has_velocity = scene, bodies, digits, has_velocity
        self.tallies = {name: Tally(name) for name in TITLES}
        self.motion = compile_motion(scene.walls)
        self.eps = EPS * 2.0**29 if scene.single else EPS
        self.totals: list[dict[str, float]] = []
        self._held: list[State] = []
        self._start: dict[str, Any] | None = None
        self._growth: list[tuple[float, float]] = []
        self._least: dict[str, Any] | None = None
        self._cache: dict[int, Any] = {}
        self._ways = np.zeros(2)
        self._clear: NDArray[np.bool_] | None = None
        self.frames = 0
        self.intervals: list[float] = []

    def feed(self, state: State) -> None:
        """Take the next state."""
        self.frames += 1
        self._held.append(state)
        held = self._held
        if len(held) == 1:
            self._check_state(state, None)
        elif len(held) == 3:
            self._interval(None, held[0], held[1], held[2])
        elif len(held) == 4:
            self._interval(held[0], held[1], held[2], held[3])
            del held[0]

    def finish(self) -> None:
        """Judge what is left."""
        if not self.scene.conservative:
            self.tallies["kept"].skip(
                1, "energy is kept only with restitution = 1 and mu = 0, both given, and no damping"
            )
        held = self._held
        if len(held) == 2:
            self._interval(None, held[0], held[1], None)
        elif len(held) == 3:
            self._interval(held[0], held[1], held[2], None)

    def clock_hint(self) -> str:
        """How far positions move for what velocities say, where that is not once."""
        scale = self._ways[0] / self._ways[1] if self._ways[1] > 0.0 else 1.0
        if abs(scale - 1.0) < 0.01:
            return ""
        return f"; over all, positions move {scale:.4g} times as far as velocities say: is time.dt, time.interval or a unit wrong?"

    # One interval, from b to c; a and d are its neighbours.

    def _interval(self, a: State | None, b: State, c: State, d: State | None) -> None:
        scene, bodies = self.scene, self.bodies
        h = c.t - b.t
        if not h > 0.0:
            self._start = None
            return
        self.intervals.append(h)
        use = b.here & c.here & ~bodies.fixed
        dt = min(scene.dt or h, h)
        hidden = self.eps * max(1.0, h / dt)
        g = scene.gravity
        eh = self._clock_error(b, c, h) + 2.0 * EPS * abs(c.t)
        mean = 0.5 * (b.v + c.v)
        speed = np.maximum(_norm(b.v), _norm(c.v))
        squeeze = self._spring_forces(b, c)
        ev = b.ev + c.ev + 4.0 * hidden * (speed + _norm(g) * h + squeeze * h / bodies.mass) + eh * _norm(g)
        ex = b.ex + c.ex + 2.0 * hidden * np.maximum(_norm(b.x), _norm(c.x)) + 0.5 * h * (b.ev + c.ev) + eh * speed
        drag = scene.damping * h
        dv = c.v - b.v - g * h + drag * mean
        lag = drag * _norm(c.v - b.v)
        r = c.x - b.x - h * mean
        bulge = 0.25 * h * _norm(dv) + _norm(r) + ex + 0.5 * dt * speed
        for _ in range(ROUNDS):
            touch = self._possible_contacts(b, c, use, bulge)
            resolved, reach = self._resolved_disks(b, c, use, touch, h, dt)
            wider = np.maximum(bulge, np.where(touch.degree > 1, reach, 0.0))
            if (wider <= bulge).all():
                break
            bulge = wider
        whole = _Interval(b, c, h, dt, use, touch, dv, ev, hidden, squeeze)
        self._motion(a, whole, d, r, ex, resolved, reach)
        self._momentum(whole, ev + lag)
        if c.omega is not None and b.omega is not None:
            self._spin(whole)
        else:
            self.tallies["spin"].skip(1, "the file has no spins: add a column omega")
        gain = self._energy(whole)
        self._check_state(c, gain)
        vrel = float(2.0 * np.nanmax(speed, initial=0.0))
        self._growth.append(
            (h, 2.0 * vrel / float(bodies.radius.min()) if len(touch.pairs) or len(touch.walled) else 0.0)
        )

    def _clock_error(self, b: State, c: State, h: float) -> float:
        """Most by which an interval is off: the digits of t, unless it is one of the engine's steps, of which t is a multiple."""
        dt = self.scene.dt
        if dt is not None and all(
            abs(t / dt - round(t / dt)) < 1e-6 * max(1.0, abs(t / dt) * 1e-6) for t in (b.t, c.t)
        ):
            even = abs(h - self.intervals[0]) < 1e-6 * h
            if even or max(b.et, c.et) < 0.5 * dt:
                return 0.0
        return b.et + c.et

    def _spring_forces(self, *states: State) -> FloatArray:
        """Sum of the spring forces on each disk [N], the larger of the states'; 0 without kn."""
        n = len(self.bodies.id)
        found = np.zeros(n)
        if self.scene.kn is None and not any(self.scene.wall_kn):
            return found
        for state in states:
            i, j, depth, kn, _ = self._overlaps(state)
            force = np.nan_to_num(kn) * depth
            total = np.bincount(i, force, n)
            disks = j < n
            found = np.maximum(found, total + np.bincount(j[disks], force[disks], n))
        return found

    def _resolved_disks(
        self, b: State, c: State, use: NDArray[np.bool_], touch: _Contacts, h: float, dt: float
    ) -> tuple[NDArray[np.bool_], FloatArray]:
        """Disks whose contacts the sampling resolves or whose one contact is a single event, and how far others may get [m].

        A contact is resolved where its group's fastest oscillation has two frames a period, or where every step is a frame. Else a
        disk goes no faster between two frames than if all the energy of its group were spent on it alone.
        """
        scene, bodies, n = self.scene, self.bodies, len(use)
        if dt >= h * (1.0 - 1e-9):
            return np.ones(n, dtype=bool), np.zeros(n)
        busy = (touch.degree > 1) | _of_walls(touch, n)
        if scene.kn is not None:
            busy &= np.sqrt(4.0 * scene.kn * touch.degree / bodies.mass) * h > np.pi
        coarse = (np.bincount(touch.label, busy & use, touch.groups) > 0)[touch.label] & (touch.degree > 0) & use
        if not coarse.any():
            return ~coarse, np.zeros(n)
        m = bodies.mass
        V = _groups(touch, m[:, None] * b.v, use) / np.maximum(_groups(touch, m, use), 1e-300)[:, None]
        energy = np.zeros(touch.groups)
        mu = max([scene.mu or 0.0, *(each or 0.0 for each in scene.wall_mu)])
        for state in (b, c):
            u = state.v - V[touch.label]
            store = self._spring_energies(state, mu)
            energy += _groups(touch, 0.5 * m * (u * u).sum(axis=1) + store["normal"] + store["shear"], use)
        fall = _norm(scene.gravity) * h
        most = energy[touch.label] + m * fall**2
        return ~coarse, np.where(coarse, h * (np.sqrt(2.0 * most / m) + fall), 0.0)

    def _possible_contacts(self, b: State, c: State, use: NDArray[np.bool_], bulge: FloatArray) -> _Contacts:
        """What may have touched between two frames.

        The way from b to c, if one event bends it, departs from its chord by at most h/4 of the change of velocity, which is ``bulge``.
        """
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        n, R = len(use), self.bodies.radius
        both = b.here & c.here
        at = np.flatnonzero(both)
        middle, half = 0.5 * (b.x + c.x), 0.5 * (c.x - b.x)
        bow = np.where(self.bodies.fixed, 0.0, bulge)
        reach = R + _norm(half) + bow
        pairs = at[_close_pairs(middle[at], reach[at])]
        i, j = pairs[:, 0], pairs[:, 1]
        d0, d1 = b.x[j] - b.x[i], c.x[j] - c.x[i]
        displacement = d1 - d0
        length = (displacement * displacement).sum(axis=1)
        share = np.clip(-(d0 * displacement).sum(axis=1) / np.where(length > 0.0, length, 1.0), 0.0, 1.0)
        gap = _norm(d0 + share[:, None] * displacement) - R[i] - R[j]
        pairs = pairs[(gap <= bow[i] + bow[j]) & (use[i] | use[j])]
        i, j = pairs[:, 0], pairs[:, 1]
        anchored = np.zeros(n, dtype=bool)
        held = ~(use[i] & use[j])
        anchored[pairs[held].ravel()] = True
        anchored &= use
        walled = []
        h = c.t - b.t
        for share_t, x in ((0.0, b.x), (0.5, middle), (1.0, c.x)):
            poses = wall_poses(self.motion, b.t + share_t * h)
            height = _heights(x, poses) - R[:, None]
            walled.append(height <= (bow + 0.125 * _norm(self.scene.gravity) * h * h)[:, None])
        on_wall = (
            np.argwhere(np.any(walled, axis=0) & use[:, None])
            if len(self.scene.walls)
            else np.empty((0, 2), dtype=np.int64)
        )
        degree = np.bincount(pairs.ravel(), minlength=n) + np.bincount(on_wall[:, 0], minlength=n)
        inner = pairs[~held]
        graph = coo_array((np.ones(len(inner)), (inner[:, 0], inner[:, 1])), shape=(n, n))
        groups, label = connected_components(graph, directed=False)
        return _Contacts(pairs, on_wall, anchored, degree, label.astype(np.int64), int(groups))

    def _name(self, disk: int) -> str:
        return f"disk {self.bodies.id[disk]}"

    def _group_words(self, touch: _Contacts, groups: NDArray[np.int64], use: NDArray[np.bool_]) -> tuple[Words, Any]:
        def members(k: int) -> NDArray[np.int64]:
            return np.flatnonzero((touch.label == groups[k]) & use)

        def who(k: int) -> str:
            disks = members(k)
            if len(disks) == 1:
                return self._name(disks[0])
            named = ", ".join(str(self.bodies.id[each]) for each in disks[:6])
            return f"{len(disks)} disks that may have touched ({named}{', ...' if len(disks) > 6 else ''})"

        return who, members

    def _motion(
        self, a: State | None, interval: _Interval, d: State | None, r: FloatArray, ex: FloatArray, resolved: NDArray[np.bool_],
        reach: FloatArray,
    ) -> None:  # fmt: skip
        """Trapezoid of the velocities against the way, ``r`` and its digits ``ex`` [m]; the same of spins and angles."""
        scene, bodies = self.scene, self.bodies
        b, c, h, dt, use, touch, *_ = interval
        jump = c.v - b.v
        before = jump if a is None else (b.v - a.v) * (h / (b.t - a.t) if b.t > a.t else 1.0)
        after = jump if d is None else (d.v - c.v) * (h / (d.t - c.t) if d.t > c.t else 1.0)
        bend = np.nan_to_num(_norm(jump - before)) + np.nan_to_num(_norm(after - jump))
        if a is None or d is None:
            bend = np.maximum(bend, 2.0 * _norm(jump - scene.gravity * h))
        met = (touch.degree > 0) & use
        # A contact shorter than the sampling may begin in one interval and end in the next: differences cancel, the change itself counts.
        if scene.kn is None:
            bend = np.where(met, np.maximum(bend, 2.0 * _norm(jump - scene.gravity * h)), bend)
        each_step = dt >= h * (1.0 - 1e-9)
        if each_step:
            bend = np.where(met, np.maximum(bend, 2.0 * _norm(jump)), bend)
        # A spring whose force comes and goes within the interval bends the way by at most h^2/4 of its acceleration, unseen by differences.
        pulse = np.where(
            met & resolved & (scene.kn is not None),
            0.25 * h * h * interval.squeeze * np.hypot(1.0, scene.mu or 0.0) / bodies.mass,
            0.0,
        )
        tally = self.tallies["motion"]
        said = h * 0.5 * (b.v + c.v)[use]
        self._ways += [(said * (c.x - b.x)[use]).sum(), (said * said).sum()]
        if not self.has_velocity:
            tally.skip(1, "velocities are differences of the positions: add vx, vy")
            self._second_differences(a, b, c, use & ~met, h)
        else:
            at = np.flatnonzero(use)
            parts = {
                "digits of x, v and t": ex[at],
                "half a step's change of velocity, which engines of first order lag": 0.5 * dt * _norm(jump)[at],
                "one contact at an unknown instant, h/4 of the second differences of v": np.where(
                    met, 0.25 * h * bend, 0.0
                )[at],
                "springs' forces that come and go, h^2/4 of the acceleration": pulse[at],
                "contacts shorter than the sampling: what the energy lets a disk move": reach[at],
            }
            tally.judge(c, _norm(r)[at], parts, lambda k: self._name(at[k]), lambda k: at[k : k + 1])
        if b.omega is not None and c.omega is not None and b.angle is not None and c.angle is not None:
            turn = c.angle - b.angle - 0.5 * h * (b.omega + c.omega)
            one = c.omega - b.omega
            second = sum(
                (np.abs(np.nan_to_num(one - other)) for other in self._spin_steps(a, b, c, d, h)), np.zeros(len(one))
            )
            whole = a is None or d is None or each_step or scene.kn is None
            second = np.maximum(second, 2.0 * np.abs(one)) if whole else second
            judged = np.flatnonzero(use & (~met | resolved))
            parts = {
                "digits of angle and omega": (
                    b.ea + c.ea + 0.5 * h * (b.eo + c.eo) + self.eps * max(1.0, h / dt) * np.abs(c.angle)
                )[judged],
                "half a step's change of spin": 0.5 * dt * np.abs(one)[judged],
                "one contact at an unknown instant": np.where(met, 0.25 * h * second, 0.0)[judged],
            }
            self.tallies["turning"].judge(
                c, np.abs(turn)[judged], parts, lambda k: self._name(judged[k]), lambda k: judged[k : k + 1]
            )
            self.tallies["turning"].skip(
                int((use & met & ~resolved).sum()), "contacts are shorter than the sampling interval"
            )
        else:
            self.tallies["turning"].skip(1, "the file has no angles with spins: add angle, omega")

    def _second_differences(self, a: State | None, b: State, c: State, clear: NDArray[np.bool_], h: float) -> None:
        """Without velocities: in free flight the second differences of the positions are those of gravity, and of damping."""
        before, self._clear = self._clear, clear
        if a is None or before is None or not b.t > a.t:
            return
        scene = self.scene
        at = np.flatnonzero(before & clear)
        back = b.t - a.t
        change = (c.x - b.x) / h - (b.x - a.x) / back
        drag = scene.damping * (c.x - a.x) / 2.0
        parts = {
            "digits of x and t": ((a.ex + b.ex) / back + (b.ex + c.ex) / h + 2.0 * self.eps * _norm(b.x) / min(h, back)
                                  + self._clock_error(b, c, h) * 2.0 * _norm(b.v) / h)[at],
            "damping": (scene.damping * h * _norm(change))[at],
        }  # fmt: skip
        value = _norm(change - 0.5 * (h + back) * scene.gravity + drag)[at]
        self.tallies["free"].judge(c, value, parts, lambda k: self._name(at[k]), lambda k: at[k : k + 1])

    @staticmethod
    def _spin_steps(a: State | None, b: State, c: State, d: State | None, h: float) -> list[FloatArray]:
        found = []
        for one, two in ((a, b), (c, d)):
            if (
                one is not None
                and two is not None
                and one.omega is not None
                and two.omega is not None
                and two.t > one.t
            ):
                found.append((two.omega - one.omega) * (h / (two.t - one.t)))
        return found

    def _momentum(self, interval: _Interval, ev: FloatArray) -> None:
        b, c, use, touch = interval.b, interval.c, interval.use, interval.touch
        m = np.where(use, self.bodies.mass, 0.0)
        got = _groups(touch, m[:, None] * interval.dv, use)
        allowed = _groups(touch, m * ev, use)
        size = np.bincount(touch.label, use, touch.groups)
        walls = _wall_sets(touch, len(self.scene.walls))
        anchored = np.bincount(touch.label, touch.anchored, touch.groups) > 0
        clear = (walls == 0) & ~anchored
        alone = np.flatnonzero(clear & (size == 1))
        who, members = self._group_words(touch, alone, use)
        mass = np.maximum(_groups(touch, m, use), 1e-300)
        if self.has_velocity:
            self.tallies["free"].judge(
                c, _norm(got[alone]) / mass[alone], {"digits of v and t": allowed[alone] / mass[alone]}, who, members
            )
        self.tallies["free"].skip(int((size > 0).sum() - len(alone)), "the disk may have touched something")
        tally = self.tallies["momentum"]
        several = np.flatnonzero(clear & (size > 1))
        who, members = self._group_words(touch, several, use)
        tally.judge(c, _norm(got[several]), {"digits of v and t": allowed[several]}, who, members)
        tally.skip(int((anchored & (size > 0)).sum()), "fixed disks take momentum")
        cones = {}
        for code in np.unique(walls[(walls > 0) & ~anchored & (size > 0)]):
            chosen = np.flatnonzero((walls == code) & ~anchored & (size > 0))
            cones[code] = cone = self._cone(int(code), b, c)
            if cone is None:
                tally.skip(
                    len(chosen),
                    "walls on several sides can push any way" if not self.scene.cohesive else "walls may pull",
                )
                continue
            who, members = self._group_words(touch, chosen, use)

            def impulse(k: int, who: Words = who, chosen: NDArray[np.int64] = chosen) -> str:
                x, y = got[chosen[k]]
                return f"{who(k)}, to whom walls gave ({x:.4g}, {y:.4g}) N s"

            tally.judge(
                c, _distance_from_cone(got[chosen], cone), {"digits of v and t": allowed[chosen]}, impulse, members
            )
        self._total_momentum(c, got, allowed, use, anchored, cones)

    def _total_momentum(
        self, c: State, got: FloatArray, allowed: FloatArray, use: NDArray[np.bool_], anchored: NDArray[np.bool_], cones: Mapping[int, Any],
    ) -> None:  # fmt: skip
        """Sums since the start: what every interval hides in its digits adds up."""
        start = self._start
        if start is None or not np.array_equal(start["use"], use):
            self._start = start = {"use": use, "got": np.zeros(2), "lost": None, "noise": 0.0, "rays": [], "any": False}
            start["first"] = float(allowed.sum())
        if anchored.any() or any(cone is None for cone in cones.values()):
            start["any"] = True
        start["got"] = start["got"] + got.sum(axis=0)
        start["rays"] = [*start["rays"], *(cone for cone in cones.values() if cone is not None)][-64:]
        if start["any"] or not use.any():
            return
        # Readings in between cancel; their digits count at both ends, an engine's round-off all the way.
        hull = _narrowest_cone([angle for cone in start["rays"] for angle in cone])
        if start["rays"] and hull is None:
            start["any"] = True
            return
        value = _distance_from_cone(start["got"][None], hull) if hull is not None else _norm(start["got"])[None]
        steps = len(self.intervals)
        mass = self.bodies.mass
        speed = np.nan_to_num(_norm(c.v))
        parts = {"digits of v at both ends": np.array([max(start["first"], float(allowed.sum()))]),
                 "round-off of the sum": np.array([self.eps * steps * float((mass * speed)[use].sum())])}  # fmt: skip
        at = np.flatnonzero(use)
        self.tallies["momentum"].judge(c, value, parts, lambda _: "all disks since the start", lambda _: at)

    def _cone(self, code: int, b: State, c: State) -> tuple[float, float] | None:
        """Directions that the impulse of some walls may have, as two angles [rad]; None: any."""
        if self.scene.cohesive:
            return None
        angles = []
        for state in (b, c):
            poses = wall_poses(self.motion, state.t)
            for w in range(len(self.scene.walls)):
                if code >> w & 1:
                    mu = self.scene.wall_mu[w]
                    half = 0.5 * np.pi if mu is None else float(np.arctan(mu))
                    middle = float(np.arctan2(poses[w, 3], poses[w, 2]))
                    angles += [middle - half, middle + half]
        return _narrowest_cone(angles)

    def _spin(self, interval: _Interval) -> None:
        scene, bodies, tally = self.scene, self.bodies, self.tallies["spin"]
        b, c, h, _, use, touch, dv, ev, hidden, squeeze = interval
        assert b.omega is not None
        assert c.omega is not None
        m, inertia = np.where(use, bodies.mass, 0.0), np.where(use, bodies.inertia, 0.0)
        turned = inertia * (c.omega - b.omega)
        err = inertia * (b.eo + c.eo + 4.0 * hidden * np.maximum(np.abs(b.omega), np.abs(c.omega)))
        if not scene.frictional and not scene.rolling and scene.damping == 0.0:
            at = np.flatnonzero(use)
            tally.judge(c, np.abs(turned[at]), {"digits of omega": err[at]}, lambda k: f"{self._name(at[k])}, without friction",
                        lambda k: at[k : k + 1])  # fmt: skip
        if scene.damping > 0.0:
            tally.skip(1, "global damping takes angular momentum")
            return
        walls = _wall_sets(touch, len(scene.walls))
        size = np.bincount(touch.label, use, touch.groups)
        anchored = np.bincount(touch.label, touch.anchored, touch.groups) > 0
        mass = np.maximum(_groups(touch, m, use), 1e-300)
        change, noise = _groups(touch, turned, use), _groups(touch, err, use)
        arms = np.zeros(len(use))
        for state, sign in ((c, 1.0), (b, -1.0)):
            X, V = (_groups(touch, m[:, None] * each, use) / mass[:, None] for each in (state.x, state.v))
            xi, u = state.x - X[touch.label], state.v - V[touch.label]
            change += sign * _groups(touch, m * _cross(xi, u), use)
            noise += _groups(
                touch,
                m
                * (_norm(xi) * (state.ev + hidden * _norm(state.v)) + _norm(u) * (state.ex + hidden * _norm(state.x))),
                use,
            )
            arms = np.maximum(arms, _norm(xi))
        noise += _groups(touch, m * arms * np.maximum(ev - b.ev - c.ev, 0.0), use)
        # An engine forms arms out of coordinates: their rounding times the impulses.
        passed = m * _norm(dv) + squeeze * h
        noise += _groups(touch, 2.0 * self.eps * np.maximum(_norm(b.x), _norm(c.x)) * passed, use)
        clear = np.flatnonzero((walls == 0) & ~anchored & (size > 0))
        who, members = self._group_words(touch, clear, use)
        tally.judge(c, np.abs(change[clear]), {"digits of omega, x and v": noise[clear]}, who, members)
        lone = np.flatnonzero((walls > 0) & (walls & (walls - 1) == 0) & ~anchored & (size == 1))
        if scene.rolling:
            tally.skip(len(lone), "rolling resistance turns disks on walls")
        elif len(lone):
            disk = np.array([np.flatnonzero((touch.label == group) & use)[0] for group in lone])
            wall = np.log2(walls[lone]).astype(int)
            n0, n1 = (wall_poses(self.motion, state.t)[wall, 2:4] for state in (b, c))
            impulse = m[disk, None] * dv[disk]
            R = bodies.radius[disk]
            expected = -R * _cross(0.5 * (n0 + n1), impulse)
            depth = self._depth_on_wall(disk, wall, b, c)
            parts = {
                "digits of omega and v": err[disk] + R * m[disk] * ev[disk],
                "arm between R and R less the overlap": depth * np.abs(_cross(n1, impulse)),
                "the wall's turning": _norm(n1 - n0) * R * _norm(impulse),
            }
            tally.judge(
                c,
                np.abs(turned[disk] - expected),
                parts,
                lambda k: f"{self._name(disk[k])} on a wall",
                lambda k: disk[k : k + 1],
            )
        tally.skip(
            int(((walls > 0) & (size > 0)).sum() - len(lone)), "several disks or walls: the walls' torque is not known"
        )
        tally.skip(int((anchored & (size > 0)).sum()), "fixed disks take angular momentum")

    def _depth_on_wall(self, disk: NDArray[np.int64], wall: NDArray[np.int64], b: State, c: State) -> FloatArray:
        """Deepest overlap with the wall: at both ends, and what the speed makes of a spring in between."""
        depth = np.zeros(len(disk))
        for state in (b, c):
            height = _heights(state.x[disk], wall_poses(self.motion, state.t))[np.arange(len(disk)), wall]
            depth = np.maximum(depth, self.bodies.radius[disk] - height)
        speed = np.maximum(_norm(b.v[disk]), _norm(c.v[disk]))
        if self.scene.kn:
            depth = np.maximum(depth, speed * np.sqrt(self.bodies.mass[disk] / self.scene.kn))
        elif not self.scene.rigid:
            depth = np.maximum(depth, speed * (c.t - b.t))
        return depth

    def _overlaps(self, state: State) -> tuple[Any, ...]:
        """Contacts of a state: disk, other body (disks, then walls), overlap [m] > 0, kn, ks (NaN: not given)."""
        cached: tuple[Any, ...] | None = self._cache.get(id(state))
        if cached is not None and cached[0] is state:
            return tuple(cached[1:])
        scene, bodies = self.scene, self.bodies
        n, R = len(bodies.id), bodies.radius
        at = np.flatnonzero(state.here)
        pairs = at[_close_pairs(state.x[at], R[at])]
        i, j = pairs[:, 0], pairs[:, 1]
        depth = R[i] + R[j] - _norm(state.x[j] - state.x[i])
        kept = depth > 0.0
        i, j, depth = i[kept], j[kept], depth[kept]
        kn, ks = (np.full(len(i), np.nan if value is None else value) for value in (scene.kn, scene.ks))
        if scene.walls:
            over = np.nan_to_num(R[:, None] - _heights(state.x, wall_poses(self.motion, state.t)), nan=-1.0)
            on = np.argwhere((over > 0.0) & state.here[:, None])
            i, j, depth = np.r_[i, on[:, 0]], np.r_[j, n + on[:, 1]], np.r_[depth, over[on[:, 0], on[:, 1]]]
            kn, ks = (np.r_[own, np.array([np.nan if each is None else each for each in given], dtype=float)[on[:, 1]]]
                      for own, given in ((kn, scene.wall_kn), (ks, scene.wall_ks)))  # fmt: skip
        found = (i.astype(np.int64), j.astype(np.int64), depth, kn, ks)
        self._cache = dict(list(self._cache.items())[-3:]) | {id(state): (state, *found)}
        return found

    def _spring_energies(self, state: State, mu: float) -> dict[str, FloatArray]:
        """Energies of springs by disk [J] and their errors; a pair's stand at its first disk."""
        n = len(self.bodies.id)
        i, j, depth, kn, ks = self._overlaps(state)
        other = np.where(j < n, j, i)
        err = state.ex[i] + np.where(j < n, state.ex[other], 0.0)
        known = np.nan_to_num(kn)
        with np.errstate(divide="ignore", invalid="ignore"):
            shear = 0.5 * (mu * known * depth) ** 2 / ks
        unknown = (np.isnan(kn) & (depth > err) & (not self.scene.rigid)) | (
            np.isnan(shear) & (mu > 0.0) & ~np.isnan(kn)
        )
        made = {
            "normal": 0.5 * known * depth * depth,
            "error": known * depth * err + 0.5 * known * err * err,
            "shear": np.nan_to_num(shear, posinf=0.0),
            "unknown": unknown.astype(float),
        }
        return {name: np.bincount(i, values, n).astype(float) for name, values in made.items()}

    def _energy(self, interval: _Interval) -> dict[str, float] | None:
        """Energy of each group, and the most that may have come into all: ``work`` of walls and ``order``, errors of the scheme."""
        scene, bodies = self.scene, self.bodies
        b, c, _, dt, use, touch, dv, ev, hidden, squeeze = interval
        m, g = np.where(use, bodies.mass, 0.0), scene.gravity
        tally = self.tallies["energy"]
        mu = max([scene.mu or 0.0, *(each or 0.0 for each in scene.wall_mu)])
        size = np.bincount(touch.label, use, touch.groups)
        walls = _wall_sets(touch, len(scene.walls))
        touched = np.bincount(touch.label, np.where(use, touch.degree, 0), touch.groups) > 0
        gain = np.zeros(touch.groups)
        parts = {
            name: np.zeros(touch.groups)
            for name in ("digits", "engine's step", "springs' step", "shear springs", "walls' work")
        }
        parts["digits"] += _groups(
            touch, m * 4.0 * hidden * (np.maximum((b.v**2).sum(1), (c.v**2).sum(1)) + np.abs(c.x @ g)), use
        )
        blind = np.zeros(touch.groups, dtype=bool)
        before = np.zeros(touch.groups, dtype=bool)
        for state, sign in ((c, 1.0), (b, -1.0)):
            own, err = self._body_energies(state, use)
            store = self._spring_energies(state, mu)
            gain += sign * _groups(touch, own + np.where(use, store["normal"], 0.0), use)
            parts["digits"] += _groups(touch, err + store["error"], use)
            blind |= _groups(touch, store["unknown"], use) > 0
            if state is b:
                before = _groups(touch, store["unknown"], use) > 0
                parts["shear springs"] += _groups(touch, store["shear"], use)
            parts["engine's step"] += _groups(touch, 0.5 * dt * squeeze * _norm(state.v), use)
        # An engine of first order has velocities half a step off the positions.
        parts["engine's step"] += 0.5 * dt * np.abs(_groups(touch, m[:, None] * (c.v - b.v), use) @ g)
        # Central differences keep the sum less dt^2/8 F^2/m; a contact that begins within a step errs by kn (v dt)^2/8 (its half step).
        parts["springs' step"] += _groups(touch, dt * dt / 8.0 * squeeze**2 * (1.0 + 3.0 * mu * mu) / bodies.mass, use)
        if scene.kn is not None:
            i, j = touch.pairs[:, 0], touch.pairs[:, 1]
            near = np.maximum(((b.v[i] - b.v[j]) ** 2).sum(1), ((c.v[i] - c.v[j]) ** 2).sum(1))
            first = np.where(use[i], i, j)
            parts["springs' step"] += np.bincount(touch.label[first], scene.kn * near * dt * dt / 8.0, touch.groups)
            for disk, w in touch.walled:
                speed = max(float((b.v[disk] ** 2).sum()), float((c.v[disk] ** 2).sum()))
                parts["springs' step"][touch.label[disk]] += (scene.wall_kn[w] or 0.0) * speed * dt * dt / 8.0
        if b.omega is None and scene.frictional:
            blind |= touched
            before |= touched
        if scene.cohesive:
            blind |= touched
            before |= touched
        anchored = np.bincount(touch.label, touch.anchored, touch.groups) > 0
        moving = self._moving_walls(b.t, c.t)
        unknown_work = anchored & bool((np.nan_to_num(_norm(b.v))[bodies.fixed] > 0.0).any())
        for group in np.flatnonzero((walls & moving > 0) & (size > 0)):
            disks = np.flatnonzero((touch.label == group) & use)
            work = self._wall_work(
                int(walls[group]), disks, (m[disks, None] * dv[disks]).sum(axis=0), float((m * ev)[disks].sum()), b, c
            )
            if work is None:
                unknown_work[group] = True
            else:
                parts["walls' work"][group] = work
        real = size > 0
        judged = np.flatnonzero(real & ~before & ~unknown_work)
        who, members = self._group_words(touch, judged, use)
        shown = {name: part[judged] for name, part in parts.items()}
        tally.judge(c, gain[judged], shown, who, members)
        tally.skip(int((real & before & ~unknown_work).sum()), "overlaps at the start may store energy: give kn (and ks), or rigid = true"
                   if not scene.cohesive else "cohesion may have stored energy")  # fmt: skip
        tally.skip(
            int((real & unknown_work).sum()),
            "moving walls on several sides, or of unknown friction, or fixed disks that move, work",
        )
        if scene.conservative:
            still = np.flatnonzero(real & ~blind & ~unknown_work & (parts["walls' work"] == 0.0))
            who, members = self._group_words(touch, still, use)
            self.tallies["kept"].judge(
                c, -gain[still], {name: part[still] for name, part in parts.items()}, who, members
            )
            self.tallies["kept"].skip(int(real.sum()) - len(still), "springs of unknown stiffness, or moving walls")
        if (real & unknown_work).any() or (scene.cohesive and touched.any()) or (b.omega is None and scene.frictional):
            return None
        return {"work": float(parts["walls' work"].sum()), "order": float(parts["springs' step"].sum())}

    def _body_energies(self, state: State, use: NDArray[np.bool_]) -> tuple[FloatArray, FloatArray]:
        """Kinetic and potential energy of each disk [J], and its error by the digits."""
        bodies, g = self.bodies, self.scene.gravity
        m, inertia = np.where(use, bodies.mass, 0.0), np.where(use, bodies.inertia, 0.0)
        speed = _norm(state.v)
        own = m * (0.5 * speed**2 - state.x @ g)
        err = m * (speed * state.ev + 0.5 * state.ev**2 + _norm(g) * state.ex)
        if state.omega is not None:
            own = own + 0.5 * inertia * state.omega**2
            err = err + inertia * (np.abs(state.omega) * state.eo + 0.5 * state.eo**2)
        return np.where(use, own, 0.0), np.where(use, err, 0.0)

    def _moving_walls(self, t0: float, t1: float) -> int:
        """Walls, as bits, that move between two times."""
        poses = [wall_poses(self.motion, t) for t in (t0, 0.5 * (t0 + t1), t1)]
        return sum(
            1 << w
            for w in range(len(self.scene.walls))
            if any((pose[w, :4] != poses[0][w, :4]).any() for pose in poses[1:])
        )

    def _wall_work(
        self, code: int, disks: NDArray[np.int64], impulse: FloatArray, err: float, b: State, c: State
    ) -> float | None:
        """Most that walls can have worked on disks to which they gave an impulse [J]; None: any amount.

        A linear program: the impulse is a sum of rays, the edges of the walls' cones, and each ray works by its wall's velocity.
        """
        rays, speeds = [], []
        h = c.t - b.t
        for share, state in ((0.25, b), (0.75, c)):
            poses = wall_poses(self.motion, b.t + share * h)
            for w in range(len(self.scene.walls)):
                if not code >> w & 1:
                    continue
                mu = self.scene.wall_mu[w]
                if mu is None:
                    return None
                normal, pivot, rate = poses[w, 2:4], poses[w, 4:6], poses[w, 8]
                points = state.x[disks] - self.bodies.radius[disks, None] * normal
                velocity = poses[w, 6:8] + rate * np.column_stack([-(points - pivot)[:, 1], (points - pivot)[:, 0]])
                for sign in (-1.0, 1.0):
                    ray = normal + sign * mu * np.array([-normal[1], normal[0]])
                    rays.append(ray)
                    speeds.append(float((velocity @ ray).max()))
        angles = [float(np.arctan2(ray[1], ray[0])) for ray in rays]
        hull = _narrowest_cone(angles)
        if hull is None:
            return None
        impulse = _nearest_in_cone(impulse, hull)
        best = -np.inf
        for k in range(len(rays)):
            for other in range(k, len(rays)):
                matrix = np.column_stack([rays[k], rays[other]])
                if abs(np.linalg.det(matrix)) > 1e-12:
                    share_of = np.linalg.solve(matrix, impulse)
                    if share_of.min() >= -1e-9 * max(1e-300, np.abs(share_of).max()):
                        best = max(best, float(share_of @ [speeds[k], speeds[other]]))
                else:
                    along = float(rays[k] @ impulse) / float(rays[k] @ rays[k])
                    if np.linalg.norm(impulse - along * rays[k]) <= 1e-9 * np.linalg.norm(impulse):
                        best = max(best, along * speeds[k], along * speeds[other])
        if best == -np.inf:
            return None
        return max(best, 0.0) + err * max(map(abs, speeds))

    def _check_state(self, c: State, gain: dict[str, float] | None) -> None:
        """One instant: overlaps, totals, and the energy of all disks against the least since the start."""
        scene, bodies = self.scene, self.bodies
        use = c.here & ~bodies.fixed
        mu = max([scene.mu or 0.0, *(each or 0.0 for each in scene.wall_mu)])
        own, err = self._body_energies(c, use)
        store = self._spring_energies(c, mu)
        stored, doubt = float(store["normal"].sum()), float(err.sum() + store["error"].sum())
        low = float(own.sum()) + stored
        known = not (store["unknown"].any() or scene.cohesive)
        high = low + float(store["shear"].sum()) if known else np.inf
        squeeze = self._spring_forces(c)
        dt = scene.dt or (min(self.intervals) if self.intervals else 0.0)
        lag = (
            0.5
            * dt
            * float(np.abs((np.where(use, bodies.mass, 0.0)[:, None] * np.nan_to_num(c.v)).sum(axis=0) @ scene.gravity))
        )
        lag += 0.5 * dt * float((squeeze * np.nan_to_num(_norm(c.v))).sum())
        least = self._least
        if least is None or gain is None or not np.array_equal(least["use"], use):
            least = {"high": np.inf, "err": 0.0, "use": use}
        else:
            least = least | {"high": least["high"] + gain["work"] + gain["order"]}
            if np.isfinite(least["high"]):
                parts = {
                    "digits at both ends": np.array([doubt + least["err"]]),
                    "engine's step": np.array([lag + least.get("lag", 0.0)]),
                }
                at = np.flatnonzero(use)
                self.tallies["energy"].judge(
                    c,
                    np.array([low - least["high"]]),
                    parts,
                    lambda _: "all disks, since their least energy",
                    lambda _: at,
                )
        budget = least["high"] + least["err"] if np.isfinite(least["high"]) else (high if np.isfinite(high) else np.inf)
        if high <= least["high"]:
            least = {"high": high, "err": doubt, "use": use, "lag": lag}
        self._least = least
        self._depths(c, budget - float(own.sum()) + doubt + lag)
        m = np.where(use, bodies.mass, 0.0)
        flat = {name: np.nan_to_num(array) for name, array in (("x", c.x), ("v", c.v))}
        spin = np.zeros(len(m)) if c.omega is None else np.nan_to_num(c.omega)
        P = (m[:, None] * flat["v"]).sum(axis=0)
        _, _, depth, _, _ = self._overlaps(c)
        self.totals.append({
            "t": c.t, "px": float(P[0]), "py": float(P[1]),
            "L": float((m * _cross(flat["x"], flat["v"])).sum() + (np.where(use, bodies.inertia, 0.0) * spin).sum()),
            "kinetic": float((0.5 * m * (flat["v"] ** 2).sum(axis=1) + 0.5 * np.where(use, bodies.inertia, 0.0) * spin**2).sum()),
            "potential": float(-(m * (flat["x"] @ scene.gravity)).sum()), "springs": stored,
            "overlap": float(depth.max()) if len(depth) else 0.0, "disks": int(c.here.sum()),
        })  # fmt: skip

    def _depths(self, c: State, left: float) -> None:
        """Overlaps: of rigid disks none, of springs what the energy left [J] can squeeze; of unknown ones short of a centre."""
        scene, bodies, tally = self.scene, self.bodies, self.tallies["overlap"]
        n = len(bodies.id)
        i, j, depth, kn, _ = self._overlaps(c)
        other = np.where(j < n, j, i)
        err = c.ex[i] + np.where(j < n, c.ex[other], 0.0)
        swallowed = np.where(j < n, np.minimum(bodies.radius[i], bodies.radius[other]), bodies.radius[i])

        def who(k: int) -> str:
            return f"{self._name(i[k])} and {self._name(j[k]) if j[k] < n else f'wall {scene.walls[j[k] - n].name!r}'}"

        def members(k: int) -> NDArray[np.int64]:
            return np.array([i[k]] if j[k] >= n else [i[k], j[k]])

        if not len(depth):
            tally.judge(
                c,
                np.zeros(1),
                {"digits of x": np.full(1, 2.0 * float(np.nanmax(c.ex, initial=0.0)))},
                lambda _: "no contact",
                lambda _: i,
            )
            return
        if scene.rigid:
            tally.judge(c, depth, {"digits of x": err, "the given slop": np.full(len(i), scene.slop)}, who, members)
            return
        with np.errstate(invalid="ignore"):
            spring = np.sqrt(2.0 * max(left, 0.0) / kn)
        known = np.isfinite(spring)
        allowed = np.where(known, np.minimum(spring, swallowed), swallowed)
        decided = known | (depth > swallowed)
        at = np.flatnonzero(decided)
        tally.judge(
            c, depth[at], {"digits of x": err[at], "what the energy at hand squeezes, short of a centre": allowed[at]},
            lambda k: who(at[k]), lambda k: members(at[k]),
        )  # fmt: skip
        tally.skip(int((~decided).sum()), "how deep springs of unknown stiffness may go: give kn, or rigid = true")


def _norm(array: FloatArray) -> Any:
    return np.sqrt((np.asarray(array) ** 2).sum(axis=-1))


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _heights(x: FloatArray, poses: FloatArray) -> FloatArray:
    """Heights of points above walls, shape (n, m)."""
    return np.asarray(x @ poses[:, 2:4].T - (poses[:, :2] * poses[:, 2:4]).sum(axis=1))


def _close_pairs(x: FloatArray, reach: FloatArray) -> NDArray[np.int64]:
    """Pairs whose distance is at most the sum of their reaches, shape (k, 2); few that reach far do not slow the rest."""
    from scipy.spatial import cKDTree

    if len(x) < 2:
        return np.empty((0, 2), dtype=np.int64)
    common = 3.0 * float(np.median(reach))
    usual = np.flatnonzero(reach <= common)
    pairs = np.empty((0, 2), dtype=np.int64)
    if len(usual) > 1:
        found = cKDTree(x[usual]).query_pairs(2.0 * float(reach[usual].max()), output_type="ndarray")
        pairs = usual[found].reshape(-1, 2)
    extra = [
        np.column_stack([np.full(len(x) - 1, i), np.delete(np.arange(len(x)), i)])
        for i in np.flatnonzero(reach > common)
    ]
    if extra:
        pairs = np.unique(np.sort(np.vstack([pairs, *extra]), axis=1), axis=0)
    close: NDArray[np.bool_] = _norm(x[pairs[:, 0]] - x[pairs[:, 1]]) <= reach[pairs[:, 0]] + reach[pairs[:, 1]]
    return np.asarray(pairs[close], dtype=np.int64)


def _groups(touch: _Contacts, values: FloatArray, use: NDArray[np.bool_]) -> Any:
    """Sums by group, of numbers or vectors."""
    values = np.where(use if values.ndim == 1 else use[:, None], values, 0.0)
    if values.ndim == 1:
        return np.bincount(touch.label, values, touch.groups)
    return np.column_stack([np.bincount(touch.label, values[:, k], touch.groups) for k in range(values.shape[1])])


def _wall_sets(touch: _Contacts, walls: int) -> NDArray[np.int64]:
    """Walls of each group, as bits."""
    found = np.zeros(touch.groups, dtype=np.int64)
    for w in range(walls):
        mine = touch.walled[touch.walled[:, 1] == w, 0]
        found[touch.label[mine]] |= 1 << w
    return found


def _of_walls(touch: _Contacts, n: int) -> NDArray[np.bool_]:
    found = np.zeros(n, dtype=bool)
    found[touch.walled[:, 0]] = True
    return found


def _narrowest_cone(angles: Sequence[float]) -> tuple[float, float] | None:
    """Narrowest pair of angles that has all others between them, less than a half turn apart; None if there is none."""
    if not angles:
        return None
    sorted_angles = np.sort(np.mod(angles, 2.0 * np.pi))
    holes = np.diff(np.append(sorted_angles, sorted_angles[0] + 2.0 * np.pi))
    k = int(np.argmax(holes))
    if holes[k] < np.pi * (1.0 - 1e-12):
        return None
    begin = float(sorted_angles[(k + 1) % len(sorted_angles)])
    return begin, begin + 2.0 * np.pi - float(holes[k])


def _distance_from_cone(vectors: FloatArray, cone: tuple[float, float]) -> FloatArray:
    """Distance of vectors from a cone, 0 inside."""
    low, high = (np.array([np.cos(angle), np.sin(angle)]) for angle in cone)
    inside = (
        (_cross(low, vectors) >= 0.0)
        & (_cross(vectors, high) >= 0.0)
        & ((vectors @ (low + high) > 0.0) | (cone[1] - cone[0] > 3.1))
    )
    off = [_norm(vectors - np.maximum(vectors @ ray, 0.0)[:, None] * ray) for ray in (low, high)]
    return np.where(inside, 0.0, np.minimum(*off))


def _nearest_in_cone(vector: FloatArray, cone: tuple[float, float]) -> FloatArray:
    """The vector of a cone that is nearest."""
    if _distance_from_cone(vector[None], cone)[0] == 0.0:
        return vector
    rays = [np.array([np.cos(angle), np.sin(angle)]) for angle in cone]
    near = [max(float(vector @ ray), 0.0) * ray for ray in rays]
    return min(near, key=lambda each: float(np.linalg.norm(vector - each)))
