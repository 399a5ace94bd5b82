"""What may have touched between two frames, overlaps and springs of an instant: the base of all checks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.harness.audit.geometry import close_pairs, norm
from ninedisk.harness.audit.scene import AuditScene
from ninedisk.harness.audit.tally import TITLES, Bodies, State, Tally, Words
from ninedisk.harness.audit.walls import WallTrack

EPS = 2.0**-52
"""Rounding of an engine's own step, relative; in single precision 2^29 times that."""


@dataclass(frozen=True)
class Contacts:
    """What may have touched in an interval: pairs of bodies, bodies with walls, groups of the former, which cross a periodic edge.

    ``size`` counts the bodies of each group that move; ``held`` are groups with one that touched a fixed body, or one that is in one of
    both frames alone: of the latter are ``passing``.
    """

    pairs: NDArray[np.int64]
    walled: NDArray[np.int64]
    anchored: NDArray[np.bool_]
    degree: NDArray[np.int64]
    label: NDArray[np.int64]
    groups: int
    across: NDArray[np.bool_]
    size: NDArray[np.int64]
    held: NDArray[np.bool_]
    passing: NDArray[np.bool_]


class Interval(NamedTuple):
    """From frame ``b`` to ``c``, ``h`` [s] later, in engine's steps of ``dt`` [s].

    Attributes
    ----------
    use : ndarray of bool, shape (n,)
        Disks that move and are in both frames.
    touch : Contacts
    dv, ev : ndarray, shape (n, d) and (n,)
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
    touch: Contacts
    dv: FloatArray
    ev: FloatArray
    hidden: float
    squeeze: FloatArray


class Touching:
    """State of an audit that all checks share; see `Auditor`."""

    def __init__(
        self,
        scene: AuditScene,
        bodies: Bodies,
        *,
        has_velocity: bool,
        digits: Mapping[str, str],
        even_clock: bool = True,
    ) -> None:
        self.scene, self.bodies, self.digits, self.has_velocity = scene, bodies, digits, has_velocity
        self.even_clock, self.even_intervals, self.uneven_intervals = even_clock, 0, 0
        self.tallies = {name: Tally(name) for name in TITLES}
        self.track = WallTrack(scene.walls, scene.dimension)
        self.radius_arms = Tally("spin")
        self.eps = EPS * 2.0**29 if scene.single else EPS
        self.totals: list[dict[str, float]] = []
        self._held: list[State] = []
        self._start: dict[str, Any] | None = None
        self._growth: list[tuple[float, float]] = []
        self._least: dict[str, Any] | None = None
        self._cache: dict[int, tuple[State | None, dict[str, Any]]] = {}
        self._ways = np.zeros(2)
        self._lag = np.zeros(3)
        self._starts_whole = False
        self._clear: NDArray[np.bool_] | None = None
        self.frames = 0
        self.intervals: list[float] = []

    def _clock_error(self, b: State, c: State, h: float) -> float:
        """Most by which an interval is off: the digits of t, unless it is one of the engine's steps, of which t is a multiple.

        Digits coarser than a step leave that open; intervals that are all alike are taken as exact.
        """
        dt = self.scene.dt
        if dt is None:
            return b.et + c.et
        whole = all(abs(t / dt - round(t / dt)) < 1e-6 * max(1.0, abs(t / dt) * 1e-6) for t in (b.t, c.t))
        if whole and max(b.et, c.et) < 0.5 * dt:
            return 0.0
        even = whole and abs(h - self.intervals[0]) < 1e-6 * h
        self.even_intervals += even
        self.uneven_intervals += not even
        return 0.0 if even and self.even_clock else b.et + c.et

    @property
    def clock_is_rounded(self) -> bool:
        """Whether intervals were taken as exact, being all alike until then, that a later one shows to be rounded."""
        return self.even_clock and self.even_intervals > 0 and self.uneven_intervals > 0

    def _spring_forces(self, *states: State) -> FloatArray:
        """Sum of the spring forces on each disk [N], the larger of the states'; 0 without kn."""
        n = len(self.bodies.id)
        if self.scene.kn is None and not any(self.scene.wall_kn):
            return np.zeros(n)

        def made(state: State) -> FloatArray:
            i, j, depth, kn, _ = self._overlaps(state)
            force = np.nan_to_num(kn) * depth
            disks = j < n
            # Of no contacts NumPy counts in integers.
            return np.asarray(np.bincount(i, force, n) + np.bincount(j[disks], force[disks], n), dtype=float)

        found = [self._once(state, "forces", partial(made, state)) for state in states]
        return np.asarray(found[0] if len(found) == 1 else np.maximum(*found))

    def _once(self, state: State, what: str, made: Callable[[], Any]) -> Any:
        """What is made of a state alone; kept for as long as the state is needed."""
        owner, found = self._cache.get(id(state), (None, {}))
        if owner is not state:
            found = {}
            self._cache = dict(list(self._cache.items())[-1:]) | {id(state): (state, found)}
        if what not in found:
            found[what] = made()
        return found[what]

    def _resolved_disks(
        self, b: State, c: State, use: NDArray[np.bool_], touch: Contacts, h: float, dt: float
    ) -> tuple[NDArray[np.bool_], FloatArray]:
        """Disks whose contacts the sampling resolves or whose one contact is a single event, and how far others may get [m].

        A contact is resolved where its group's fastest oscillation has two frames a period, or where every step is a frame. Else a
        disk goes no faster between two frames than if all the energy of its group were spent on it alone.
        """
        scene, bodies, n = self.scene, self.bodies, len(use)
        if dt >= h * (1.0 - 1e-9):
            return np.ones(n, dtype=bool), np.zeros(n)
        busy = (touch.degree > 1) | of_walls(touch, n)
        if scene.kn is not None:
            busy &= np.sqrt(4.0 * scene.kn * touch.degree / bodies.mass) * h > np.pi
        coarse = (np.bincount(touch.label, busy & use, touch.groups) > 0)[touch.label] & (touch.degree > 0) & use
        if not coarse.any():
            return ~coarse, np.zeros(n)
        m = bodies.mass
        V = groups_of(touch, m[:, None] * b.v, use) / np.maximum(groups_of(touch, m, use), 1e-300)[:, None]
        energy = np.zeros(touch.groups)
        mu = max([scene.mu or 0.0, *(each or 0.0 for each in scene.wall_mu)])
        for state in (b, c):
            u = state.v - V[touch.label]
            store = self._spring_energies(state, mu)
            energy += groups_of(touch, 0.5 * m * (u * u).sum(axis=1) + store["normal"] + store["shear"], use)
        fall = norm(scene.gravity) * h
        most = energy[touch.label] + m * fall**2
        return ~coarse, np.where(coarse, h * (np.sqrt(2.0 * most / m) + fall), 0.0)

    def _possible_contacts(self, b: State, c: State, use: NDArray[np.bool_], bulge: FloatArray) -> Contacts:
        """What may have touched between two frames.

        The way from b to c, if one event bends it, departs from its chord by at most h/4 of the change of velocity, which is ``bulge``.
        """
        from ninedisk.harness.audit.kernels import pair_groups, touching_pairs

        n, R = len(use), self.bodies.radius
        both = b.here & c.here
        bow = np.where(self.bodies.fixed, 0.0, bulge)
        x0, x1 = b.x, c.x
        passing = b.here ^ c.here
        if passing.any():
            x0, x1, bow = self._passing_paths(b, c, bow)
            both = b.here | c.here
        middle = 0.5 * (x0 + x1)
        reach = R + 0.5 * norm(x1 - x0) + bow
        pairs, shift = _close_pairs_of(both, middle, reach, b.cell)
        if not (c.here & ~b.here).any():
            self._overlaps(c, (pairs, shift))  # what overlaps in c was near in between
        near = np.empty(len(pairs), dtype=bool)
        touching_pairs(pairs, shift, x0, x1, R, bow, use, near)
        pairs, shift = pairs[near], shift[near]
        i, j = pairs[:, 0], pairs[:, 1]
        anchored = np.zeros(n, dtype=bool)
        held = ~(use[i] & use[j])
        anchored[pairs[held].ravel()] = True
        anchored &= use
        on_wall = np.empty((0, 2), dtype=np.int64)
        if self.scene.walls:
            h = c.t - b.t
            slack = R + bow + 0.125 * norm(self.scene.gravity) * h * h
            walled = np.zeros((n, len(self.scene.walls)), dtype=bool)
            for share_t, x in ((0.0, x0), (0.5, middle), (1.0, x1)):
                self.track.at(b.t + share_t * h).mark_low(x, slack, walled)
            on_wall = np.argwhere(walled)
            on_wall = on_wall[use[on_wall[:, 0]]]
        degree = np.bincount(pairs.ravel(), minlength=n) + np.bincount(on_wall[:, 0], minlength=n)
        label = np.empty(n, dtype=np.int64)
        groups = pair_groups(pairs, ~held, label)
        across = np.zeros(groups, dtype=bool)
        across[label[pairs[(shift != 0.0).any(axis=1)].ravel()]] = True
        size = np.bincount(label if use.all() else label[use], minlength=groups)
        fixed, left = np.zeros(groups, dtype=bool), np.zeros(groups, dtype=bool)
        fixed[label[anchored]] = True
        left[label[pairs[(passing[i] | passing[j])].ravel()]] = True
        return Contacts(pairs, on_wall, anchored, degree, label, int(groups), across, size, fixed, left)

    def _passing_paths(self, b: State, c: State, bow: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Places at both ends and bows of paths, also of bodies that one frame alone has: those go straight on, give or take a way."""
        h = c.t - b.t
        x0, x1, bow = b.x.copy(), c.x.copy(), bow.copy()
        fastest = 0.0 if self.has_velocity else max(float(np.nanmax(norm(each.v), initial=0.0)) for each in (b, c))
        for only, state, other, sign in ((c.here & ~b.here, c, x0, -1.0), (b.here & ~c.here, b, x1, 1.0)):
            v = np.nan_to_num(state.v[only])
            other[only] = state.x[only] + sign * h * v
            bow[only] = h * np.maximum(norm(v), fastest) + 0.5 * h * h * norm(self.scene.gravity)
        return x0, x1, bow

    def _name(self, disk: int) -> str:
        return f"{self.bodies.noun} {self.bodies.id[disk]}"

    def _group_words(self, touch: Contacts, groups: NDArray[np.int64], use: NDArray[np.bool_]) -> tuple[Words, Any]:
        def members(k: int) -> NDArray[np.int64]:
            return np.flatnonzero((touch.label == groups[k]) & use)

        def who(k: int) -> str:
            disks = members(k)
            if len(disks) == 1:
                return self._name(disks[0])
            named = ", ".join(str(self.bodies.id[each]) for each in disks[:6])
            return (
                f"{len(disks)} {self.bodies.noun}s that may have touched ({named}{', ...' if len(disks) > 6 else ''})"
            )

        return who, members

    def _depth_on_wall(self, disk: NDArray[np.int64], wall: NDArray[np.int64], b: State, c: State) -> FloatArray:
        """Deepest overlap with the wall: at both ends, and what the speed makes of a spring in between."""
        depth = np.zeros(len(disk))
        for state in (b, c):
            height = self.track.at(state.t).heights(state.x[disk])[np.arange(len(disk)), wall]
            depth = np.maximum(depth, self.bodies.radius[disk] - height)
        speed = np.maximum(norm(b.v[disk]), norm(c.v[disk]))
        if self.scene.kn:
            depth = np.hypot(depth, speed * np.sqrt(self.bodies.mass[disk] / self.scene.kn))
        elif not self.scene.rigid:
            depth = np.maximum(depth, speed * (c.t - b.t))
        return depth

    def _overlaps(self, state: State, near: tuple[NDArray[np.int64], FloatArray] | None = None) -> tuple[Any, ...]:
        """Contacts of a state: disk, other body (disks, then walls), overlap [m] > 0, kn, ks (NaN: not given).

        ``near`` has all pairs that may overlap, and shifts as of `close_pairs`, where they are known.
        """
        found: tuple[Any, ...] = self._once(state, "overlaps", lambda: self._find_overlaps(state, near))
        return found

    def _find_overlaps(self, state: State, near: tuple[NDArray[np.int64], FloatArray] | None) -> tuple[Any, ...]:
        from ninedisk.harness.audit.kernels import pair_depths

        scene, bodies = self.scene, self.bodies
        n, R = len(bodies.id), bodies.radius
        if near is None:
            near = _close_pairs_of(state.here, state.x, R, state.cell)
        depth = np.empty(len(near[0]))
        pair_depths(*near, state.x, R, depth)
        kept = np.flatnonzero(depth > 0.0)
        depth = depth[kept]
        i, j = near[0][kept].T
        kn, ks = (np.full(len(i), np.nan if value is None else value) for value in (scene.kn, scene.ks))
        if scene.walls:
            marks = np.zeros((n, len(scene.walls)), dtype=bool)
            poses = self.track.at(state.t)
            poses.mark_low(state.x, R, marks)
            on = np.argwhere(marks)
            over = R[on[:, 0]] - poses.heights(state.x[on[:, 0]])[np.arange(len(on)), on[:, 1]]
            real = (over > 0.0) & state.here[on[:, 0]]
            on, over = on[real], over[real]
            i, j, depth = np.r_[i, on[:, 0]], np.r_[j, n + on[:, 1]], np.r_[depth, over]
            kn, ks = (np.r_[own, np.array([np.nan if each is None else each for each in given], dtype=float)[on[:, 1]]]
                      for own, given in ((kn, scene.wall_kn), (ks, scene.wall_ks)))  # fmt: skip
        return i.astype(np.int64), j.astype(np.int64), depth, kn, ks

    def _spring_energies(self, state: State, mu: float) -> dict[str, FloatArray]:
        """Energies of springs by disk [J] and their errors; a pair's stand at its first disk."""
        found: dict[str, FloatArray] = self._once(state, "springs", lambda: self._find_spring_energies(state, mu))
        return found

    def _find_spring_energies(self, state: State, mu: float) -> dict[str, FloatArray]:
        n = len(self.bodies.id)
        i, j, depth, kn, ks = self._overlaps(state)
        other = np.where(j < n, j, i)
        er = self.bodies.er
        err = state.ex[i] + er[i] + np.where(j < n, state.ex[other] + er[other], 0.0)
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
        return {name: np.asarray(np.bincount(i, values, n), dtype=float) for name, values in made.items()}


def _close_pairs_of(
    here: NDArray[np.bool_], x: FloatArray, reach: FloatArray, cell: FloatArray | None
) -> tuple[NDArray[np.int64], FloatArray]:
    """`close_pairs` of some bodies, by the numbers of all."""
    if here.all():
        return close_pairs(x, reach, cell)
    at = np.flatnonzero(here)
    found, shift = close_pairs(x[at], reach[at], cell)
    return at[found], shift


def groups_of(touch: Contacts, values: FloatArray, use: NDArray[np.bool_]) -> Any:
    """Sums by group, of numbers or vectors."""
    from ninedisk.harness.audit.sums import sum_groups

    columns = values.reshape(len(values), -1)
    found = np.zeros((touch.groups, columns.shape[1]))
    sum_groups(touch.label, use, columns, found)
    return found[:, 0] if values.ndim == 1 else found


def wall_sets(touch: Contacts, walls: int) -> NDArray[np.int64]:
    """Walls of each group, as bits."""
    found = np.zeros(touch.groups, dtype=np.int64)
    for w in range(walls):
        mine = touch.walled[touch.walled[:, 1] == w, 0]
        found[touch.label[mine]] |= 1 << w
    return found


def of_walls(touch: Contacts, n: int) -> NDArray[np.bool_]:
    """Bodies that may have touched a wall."""
    found = np.zeros(n, dtype=bool)
    found[touch.walled[:, 0]] = True
    return found


def first_members(touch: Contacts, use: NDArray[np.bool_]) -> NDArray[np.int64]:
    """One body of each group, -1 where it has none."""
    found = np.full(touch.groups, -1, dtype=np.int64)
    at = np.flatnonzero(use)[::-1]
    found[touch.label[at]] = at
    return found
