"""Where bodies are in a step, the frames of their contacts, and the forces that contacts keep from step to step."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.core.cd.contact_kernels import (
    Frames,
    carry_over,
    complete_frames,
    gap_round_off,
    gaps_before,
    mark_covered,
    measure_frames,
    wall_displacement,
)
from ninedisk.core.cd.laws import LawTable
from ninedisk.core.errors import NonFiniteStateError
from ninedisk.core.nurbs.features import NurbsFeatures
from ninedisk.core.nurbs.intersect import NurbsGrains
from ninedisk.core.nurbs.shapes import body_shapes
from ninedisk.core.nurbs.state import ContactRows
from ninedisk.core.scene import Scene

IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class Place:
    """Where bodies are: disks at the start of a step, walls at both its ends.

    Attributes
    ----------
    x : ndarray, shape (n, 2)
        Centres [m].
    angle : ndarray, shape (n,)
        Angles [rad].
    radius : ndarray, shape (n,)
        Radii [m]; of bodies with outlines, those of circles around them.
    before, after : ndarray, shape (m, 11)
        Walls.
    origin : ndarray, shape (2,)
        That of these coordinates in the scene's [m].
    """

    x: FloatArray
    angle: FloatArray
    radius: FloatArray
    before: FloatArray
    after: FloatArray
    origin: FloatArray = field(default_factory=lambda: np.zeros(2))

    def round_off(self) -> float:
        """Error of a gap [m] that the rounding of coordinates explains."""
        return gap_round_off(self.x, self.radius, self.after)

    def wall_displacement(self) -> float:
        """Bound on the displacement of a wall's surface over the step near the disks [m]."""
        return wall_displacement(self.x, self.before, self.after)


def empty_frames(pairs: IntArray, n: int, laws: LawTable) -> Frames:
    """Frames of pairs of n disks and of walls, that are yet to be measured."""
    c, disk = len(pairs), pairs < n
    return Frames(
        pairs=pairs,
        bodies=np.where(disk, pairs, -1).astype(np.int32),
        row=laws.rows(pairs),
        normal=np.empty((c, 2)),
        gap=np.empty(c),
        gap_before=np.empty(c),
        shift=np.empty(c),
        arms=np.empty((c, 4)),
        place=np.zeros((c, 2)),
    )


def contact_frames(pairs: IntArray, place: Place, laws: LawTable) -> Frames:
    """Frames of the pairs.

    Parameters
    ----------
    pairs : ndarray of int64, shape (c, 2)
        Body numbers, disks first.
    place : Place
    laws : LawTable

    Returns
    -------
    Frames

    Raises
    ------
    NonFiniteStateError
        If the centres of two disks coincide: their contact has no normal.
    """
    frames = empty_frames(pairs, len(place.x), laws)
    same = measure_frames(place.x, place.radius, place.before, place.after, laws.arrays, frames)
    if same >= 0:
        (i, j), (px, py) = pairs[same], place.x[pairs[same, 0]] + place.origin
        raise NonFiniteStateError(
            f"the centres of disks {i} and {j} coincide at ({px:g}, {py:g}): their contact has no normal"
        )
    return frames


class Meetings(NamedTuple):
    """Where c pairs of bodies meet: columns of `Frames`, and points and ``tip`` as `complete_frames` takes them."""

    pairs: IntArray
    first: FloatArray
    second: FloatArray
    tip: FloatArray
    normal: FloatArray
    gap: FloatArray
    place: FloatArray

    def pick(self, which: NDArray[np.bool_] | IntArray) -> Meetings:
        """Those chosen by a mask or by their numbers."""
        columns: list[Any] = [column[which] for column in self]
        return Meetings(*columns)


class GrainFrames:
    """Makes the frames of pairs of which some have outlines.

    Bodies that are apart, or rigid, meet at the features of their outlines: a pair can have several. Elastic bodies that overlap have
    the contacts of the DEM: one for each common area, across its chord. Disks have the frames that they have without grains.

    Parameters
    ----------
    scene : Scene
    laws : LawTable
    """

    def __init__(self, scene: Scene, laws: LawTable) -> None:
        disks = scene.disks
        table, shape, _ = body_shapes(scene.outlines, disks.outline, disks.radius)
        self._round, self._laws, self._n, self._bodies = disks.outline < 0, laws, len(disks), scene.n_bodies
        self._features, self._grains = NurbsFeatures(table, shape, scene.body_name), NurbsGrains.of_table(table, shape)
        self._ring = np.diff(table.first_span)[shape].astype(np.float64)
        self._convex = table.smallest_radius[shape] > 0.0

    def frames(self, place: Place, pairs: IntArray, reach: float) -> Frames:
        """Frames of the contacts of the pairs with a gap below ``reach`` [m], ordered by pair and by place on the first outline.

        Raises
        ------
        InvalidSceneError
            If rigid bodies overlap by too much, or elastic ones in a way that has no chord.
        """
        of_wall = pairs[:, 1] >= self._n
        alone = self._round[pairs[:, 0]] & (of_wall | self._round[np.where(of_wall, 0, pairs[:, 1])])
        at_walls, between = pairs[~alone & of_wall], pairs[~alone & ~of_wall]
        meetings = self._features_of(place, at_walls, between, reach)
        if self._laws.elastic.any():
            meetings = self._with_chords(place, at_walls, between, meetings)
        found = self._complete(place, at_walls, reach, meetings)
        if not alone.any():
            return found
        disks = contact_frames(pairs[alone], place, self._laws)
        both = Frames(*_joined(disks, found))
        return both.pick(self._order(both.pairs, both.place))

    def gaps(self, place: Place, pairs: IntArray) -> FloatArray:
        """Smallest gap [m] of each pair, negative where it overlaps."""
        gaps = np.full(len(pairs), np.inf)
        reach = float(place.radius.min())
        while not np.isfinite(gaps).all():
            left = ~np.isfinite(gaps)
            frames = self.frames(place, np.unique(pairs[left], axis=0), reach)
            for k in np.flatnonzero(left):
                gaps[k] = frames.gap[(frames.pairs == pairs[k]).all(axis=1)].min(initial=np.inf)
            reach *= 4.0
        return gaps

    def inherited(self, memory: ContactMemory, frames: Frames) -> FloatArray:
        """Forces of the last step, shape (c, 2) [N], each by the contact that it belongs to now."""
        forces, bodies = np.empty((frames.size, 2)), frames.pairs.copy()
        of_wall = bodies[:, 1] >= self._n
        bodies[of_wall, 1] = bodies[of_wall, 0]
        spans = np.where(self._round[bodies], 0.0, self._ring[bodies])
        spans[of_wall, 1] = 0.0
        single = np.logical_and(*self._convex[bodies].T)
        keys = memory.keys_of(frames.pairs)
        carry_over(memory.keys, memory.places, memory.forces, keys, frames.place, spans, single, forces)
        return forces

    def _features_of(self, place: Place, at_walls: IntArray, between: IntArray, reach: float) -> Meetings:
        elastic = self._laws.elastic
        deep = elastic[self._laws.rows(between)]
        of, rows = self._features.of_pairs(place.x, place.angle, between, reach, deep=deep)
        deep = elastic[self._laws.rows(at_walls)]
        of_wall, more = self._features.of_walls(place.x, place.angle, at_walls, place.after, reach, deep=deep)
        first, second, normal, gap, at = _joined(rows, more)
        pairs = np.concatenate([between[of], at_walls[of_wall]])
        found = Meetings(pairs, first, second, np.zeros((len(pairs), 2)), normal, gap, at)
        return found.pick(self._order(pairs, at))

    def _with_chords(self, place: Place, at_walls: IntArray, between: IntArray, near: Meetings) -> Meetings:
        """Chords of the elastic bodies that overlap, and the features that no chord represents."""
        touching, rows = self._chords(place, at_walls, between)
        covered = np.zeros(len(near.pairs), dtype=np.bool_)
        keys, chord_keys = (pairs[:, 0] * self._bodies + pairs[:, 1] for pairs in (near.pairs, touching))
        mark_covered(keys, near.place, near.gap, chord_keys, rows.place, self._ring[touching[:, 0]], covered)
        of_wall = touching[:, 1] >= self._n
        middles = np.zeros((len(touching), 2))
        for body, begin, end, column in ((touching[:, 0], 0, 2, 0), (np.where(of_wall, 0, touching[:, 1]), 3, 1, 1)):
            ring = self._ring[body]
            middles[:, column] = (
                rows.place[:, begin] + 0.5 * ((rows.place[:, end] - rows.place[:, begin]) % ring)
            ) % ring
        middles[of_wall, 1] = 0.0
        other = place.x[np.where(of_wall, touching[:, 0], touching[:, 1])]
        points = (rows.point - place.x[touching[:, 0]], rows.point - other)
        tip = np.column_stack([rows.beyond, rows.overlap - rows.beyond])
        both = Meetings(*_joined(near.pick(~covered), (touching, *points, tip, rows.normal, -rows.overlap, middles)))
        return both.pick(self._order(both.pairs, both.place))

    def _chords(self, place: Place, at_walls: IntArray, between: IntArray) -> tuple[IntArray, ContactRows]:
        """Contacts across chords, and their pairs in ascending order."""
        x, angle, radius = place.x, place.angle, place.radius
        close = between[self._laws.elastic[self._laws.rows(between)]]
        if len(close):
            apart = np.hypot(*(x[close[:, 1]] - x[close[:, 0]]).T)
            close = close[apart < radius[close[:, 0]] + radius[close[:, 1]]]
        of, rows = self._grains.pair_contacts(x, angle, close)
        pairs = close[of]
        soft = at_walls[self._laws.elastic[self._laws.rows(at_walls)]]
        for w in np.unique(soft[:, 1]) - self._n:
            wall, mine = place.after[w], soft[soft[:, 1] == self._n + w]
            mine = mine[(x[mine[:, 0]] - wall[0:2]) @ wall[2:4] < radius[mine[:, 0]]]
            if len(mine):
                some = self._grains.chosen(mine[:, 0])
                of, more = some.wall_contacts(x[mine[:, 0]], angle[mine[:, 0]], wall[0:2], wall[2:4])
                pairs, rows = np.concatenate([pairs, mine[of]]), ContactRows(*_joined(rows, more))
        order = self._order(pairs, rows.place)
        columns: list[Any] = [column[order] for column in rows]
        return pairs[order], ContactRows(*columns)

    def _complete(self, place: Place, at_walls: IntArray, reach: float, meetings: Meetings) -> Frames:
        pairs, first, second, tip, normal, gap, at = meetings
        frames = empty_frames(pairs, self._n, self._laws)._replace(normal=normal, gap=gap, place=at)
        complete_frames(place.x, first, second, tip, place.before, place.after, self._laws.arrays, frames)
        turned = np.any(place.before[:, 2:4] != place.after[:, 2:4], axis=1)
        if turned.any():
            self._look_back(place, at_walls[turned[at_walls[:, 1] - self._n]], reach, frames)
        return frames

    def _look_back(self, place: Place, at_walls: IntArray, reach: float, frames: Frames) -> None:
        """Mend ``gap_before``, and the arms that depend on it, at walls that turn in the step: outlines touched them elsewhere."""
        material, reach = frames.gap_before.copy(), reach + place.wall_displacement()
        of, rows = self._features.of_walls(place.x, place.angle, at_walls, place.before, reach, deep=True)
        keys, near_keys = (pairs[:, 0] * self._bodies + pairs[:, 1] for pairs in (frames.pairs, at_walls[of]))
        ring = self._ring[frames.pairs[:, 0]]
        gaps_before(keys, frames.place, near_keys, rows.place, rows.gap, ring, frames.gap_before)
        shorter = 0.5 * self._laws.arm_overlap[frames.row]
        frames.arms[:, 2] += shorter * (np.maximum(0.0, -material) - np.maximum(0.0, -frames.gap_before))

    def _order(self, pairs: IntArray, at: FloatArray) -> IntArray:
        return np.lexsort((at[:, 0], pairs[:, 1], pairs[:, 0]))


def _joined(one: tuple[NDArray[Any], ...], other: tuple[NDArray[Any], ...]) -> list[NDArray[Any]]:
    """Columns of two tables, one below the other."""
    return [np.concatenate(column) for column in zip(one, other, strict=True)]


class ContactMemory:
    """Forces of the last step by contact: the shear springs' state and the solvers' warm start.

    Parameters
    ----------
    n_bodies : int
        Disks and walls.
    pairs : ndarray of int64, shape (c, 2)
        In ascending order; a pair of outlines can occur several times.
    forces : ndarray, shape (c, 2)
        Normal and shear forces ``(p, q)`` [N].
    places : ndarray, shape (c, 2)
        Places on both outlines, 0 on disks and walls.
    shear : ndarray, shape (c,), optional
        Shear forces with which the next step begins [N]; None: those of the last one.
    spring : ndarray, shape (c,), optional
        Forces of the normal springs, without dashpots [N]; None: the normal forces.
    pull : ndarray, shape (c,), optional
        Attraction beside ``forces``, which are those of the step's problem [N]; None: none.

    Attributes
    ----------
    keys : ndarray of int64, shape (c,)
        One number for each pair, ascending.
    acting : ndarray, shape (c, 2)
        Forces that act on the bodies [N].
    """

    def __init__(
        self,
        n_bodies: int,
        pairs: IntArray,
        forces: FloatArray,
        places: FloatArray,
        shear: FloatArray | None = None,
        spring: FloatArray | None = None,
        pull: FloatArray | None = None,
    ) -> None:
        self._n = n_bodies
        self.pairs, self.forces, self.places = pairs, forces, places
        self.shear = forces[:, 1] if shear is None else shear
        self.spring = forces[:, 0] if spring is None else spring
        self.acting = forces if pull is None else np.column_stack([forces[:, 0] - pull, forces[:, 1]])
        self.keys = self.keys_of(pairs)

    def keys_of(self, pairs: IntArray) -> IntArray:
        """One number for each pair, in the order of the pairs."""
        return np.asarray(pairs[:, 0] * self._n + pairs[:, 1])

    def of(self, pairs: IntArray, *, acting: bool = False) -> FloatArray:
        """Forces of these pairs of disks and walls, of the problem or acting, shape (c, 2); 0 where there was no contact."""
        found = np.zeros((len(pairs), 2))
        if len(self.keys) and len(pairs):
            keys = self.keys_of(pairs)
            at = np.minimum(np.searchsorted(self.keys, keys), len(self.keys) - 1)
            known = self.keys[at] == keys
            found[known] = (self.acting if acting else self.forces)[at[known]]
        return found

    def sums(self, pairs: IntArray) -> FloatArray:
        """Sums of the acting forces of all contacts of each of these pairs, shape (c, 2)."""
        keys = self.keys_of(pairs)
        begin, end = (np.searchsorted(self.keys, keys, side) for side in ("left", "right"))
        return np.array([self.acting[i:j].sum(axis=0) for i, j in zip(begin, end, strict=True)]).reshape(len(pairs), 2)

    def same(self, pairs: IntArray, others: IntArray) -> NDArray[np.bool_]:
        """Which of the pairs are among the others, shape (c,)."""
        return np.isin(self.keys_of(pairs), self.keys_of(others))

    def renewed(
        self,
        pairs: IntArray,
        forces: FloatArray,
        places: FloatArray,
        shear: FloatArray | None = None,
        spring: FloatArray | None = None,
        pull: FloatArray | None = None,
    ) -> ContactMemory:
        """Memory of the next step."""
        return ContactMemory(self._n, pairs, forces, places, shear, spring, pull)

    def springs(self) -> ContactMemory:
        """The same with the shear forces with which the next step begins."""
        return self.renewed(self.pairs, np.column_stack([self.forces[:, 0], self.shear]), self.places)
