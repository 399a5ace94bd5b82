"""Contacts of bodies with outlines at the start of a step."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd.frames import Frames, contact_frames
from ninedisk.core.cd.grain_frame_kernels import carry_over, complete_frames, gaps_before, mark_covered
from ninedisk.core.cd.laws import LawTable
from ninedisk.core.cd.memory import ContactMemory
from ninedisk.core.cd.place import Place
from ninedisk.core.contacts.nurbs import NurbsGrains
from ninedisk.core.contacts.nurbs_features import NurbsFeatures
from ninedisk.core.contacts.nurbs_state import ContactRows, FeatureRows, feature_rows
from ninedisk.core.geometry.nurbs_bodies import body_shapes
from ninedisk.core.scene import Scene

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


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
        table, self._shape, _ = body_shapes(scene.outlines, disks.outline, disks.radius)
        self._round, self._laws, self._n = disks.outline < 0, laws, len(disks)
        self._features, self._grains = NurbsFeatures(table, self._shape), NurbsGrains.of_table(table, self._shape)
        self._ring = np.diff(table.first_span)[self._shape].astype(np.float64)
        self._convex = table.smallest_radius[self._shape] > 0.0

    def frames(self, place: Place, pairs: IntArray, reach: float) -> Frames:
        """Frames of the contacts of the pairs with a gap below ``reach`` [m], ordered by pair and by place on the first outline.

        Raises
        ------
        InvalidSceneError
            If rigid bodies overlap by too much, or elastic ones in a way that has no chord.
        """
        of_wall = pairs[:, 1] >= self._n
        alone = self._round[pairs[:, 0]] & (of_wall | self._round[np.where(of_wall, 0, pairs[:, 1])])
        parts = [contact_frames(pairs[alone], place.x, place.radius, place.before, place.after, self._laws)]
        parts.append(self._of_pairs(place, pairs[~alone & ~of_wall], reach))
        parts += [
            self._of_wall(place, pairs[~alone & (pairs[:, 1] == self._n + w)], reach) for w in range(len(place.after))
        ]
        columns = (np.concatenate(column) for column in zip(*(vars(part).values() for part in parts), strict=True))
        found = Frames(*columns)
        order = np.lexsort((found.place[:, 0], found.pairs[:, 1], found.pairs[:, 0]))
        return found.pick(order)

    def gap(self, place: Place, pair: IntArray) -> float:
        """Smallest gap [m] of a pair, negative where it overlaps."""
        reach = float(place.radius.min())
        while True:
            found = self.frames(place, pair.reshape(1, 2), reach)
            if len(found):
                return float(found.gap.min())
            reach *= 4.0

    def inherited(self, memory: ContactMemory, frames: Frames) -> FloatArray:
        """Forces of the last step, shape (c, 2) [N], each by the contact that it belongs to now."""
        forces, bodies = np.empty((len(frames), 2)), frames.pairs.copy()
        of_wall = bodies[:, 1] >= self._n
        bodies[of_wall, 1] = bodies[of_wall, 0]
        spans = np.where(self._round[bodies], 0.0, self._ring[bodies])
        spans[of_wall, 1] = 0.0
        single = np.logical_and(*self._convex[bodies].T)
        keys = memory.keys_of(frames.pairs)
        carry_over(memory.keys, memory.places, memory.forces, keys, frames.place, spans, single, forces)
        return forces

    def _of_pairs(self, place: Place, pairs: IntArray, reach: float) -> Frames:
        elastic = bool(self._laws.elastic[0])
        of, rows = self._features.of_pairs(place.x, place.angle, pairs, reach, deep=elastic)
        if not elastic:
            return self._from_features(place, pairs[of], rows)
        apart = np.hypot(*(place.x[pairs[:, 1]] - place.x[pairs[:, 0]]).T)
        close = pairs[apart < place.radius[pairs[:, 0]] + place.radius[pairs[:, 1]]]
        owner, chords = self._grains.pair_contacts(place.x, place.angle, close)
        return self._elastic(place, pairs[of], rows, close[owner], chords)

    def _of_wall(self, place: Place, pairs: IntArray, reach: float) -> Frames:
        if not len(pairs):
            return self._from_features(place, pairs, feature_rows(0))
        w = int(pairs[0, 1]) - self._n
        elastic = bool(self._laws.elastic[1 + w])
        of, rows = self._features.of_walls(place.x, place.angle, pairs, place.after, reach, deep=elastic)
        if not elastic:
            return self._before(place, pairs, reach, self._from_features(place, pairs[of], rows))
        wall = place.after[w]
        grains = NurbsGrains.of_table(self._grains.table, self._shape[pairs[:, 0]])
        owner, chords = grains.wall_contacts(place.x[pairs[:, 0]], place.angle[pairs[:, 0]], wall[0:2], wall[2:4])
        return self._before(place, pairs, reach, self._elastic(place, pairs[of], rows, pairs[owner], chords))

    def _before(self, place: Place, pairs: IntArray, reach: float, frames: Frames) -> Frames:
        """The frames with their gaps before the wall turned: outlines touch it elsewhere then."""
        w = int(pairs[0, 1]) - self._n
        if np.array_equal(place.before[w, 2:4], place.after[w, 2:4]):
            return frames
        frames = frames.pick(np.lexsort((frames.place[:, 0], frames.pairs[:, 0])))
        reach += place.wall_way()
        of, rows = self._features.of_walls(place.x, place.angle, pairs, place.before, reach, deep=True)
        ring, material = self._ring[frames.pairs[:, 0]], frames.gap_before.copy()
        gaps_before(frames.pairs[:, 0], frames.place, pairs[of, 0], rows.place, rows.gap, ring, frames.gap_before)
        shorter = 0.5 * self._laws.arm_overlap[1 + w]
        frames.arms[:, 2] += shorter * (np.maximum(0.0, -material) - np.maximum(0.0, -frames.gap_before))
        return frames

    def _elastic(
        self, place: Place, near: IntArray, rows: FeatureRows, touching: IntArray, chords: ContactRows
    ) -> Frames:
        """Chords, and the features that no chord stands for."""
        covered = np.zeros(len(near), dtype=np.bool_)
        keys, chord_keys = (pairs[:, 0] * (self._n + len(place.after)) + pairs[:, 1] for pairs in (near, touching))
        mark_covered(keys, rows.place, rows.gap, chord_keys, chords.place, self._ring[touching[:, 0]], covered)
        kept = FeatureRows(*(column[~covered] for column in rows))
        parts = (self._from_features(place, near[~covered], kept), self._from_chords(place, touching, chords))
        return Frames(
            *(np.concatenate(column) for column in zip(*(vars(part).values() for part in parts), strict=True))
        )

    def _from_features(self, place: Place, pairs: IntArray, rows: FeatureRows) -> Frames:
        tip = np.zeros((len(pairs), 2))
        return self._complete(place, pairs, rows.first, rows.second, tip, rows.normal, rows.gap, rows.place)

    def _from_chords(self, place: Place, pairs: IntArray, rows: ContactRows) -> Frames:
        first = rows.point - place.x[pairs[:, 0]]
        of_wall = pairs[:, 1] >= self._n
        other = place.x[np.where(of_wall, pairs[:, 0], pairs[:, 1])]
        tip = np.column_stack([rows.beyond, rows.overlap - rows.beyond])
        middles = []
        for body, begin, end in ((pairs[:, 0], 0, 2), (np.where(of_wall, 0, pairs[:, 1]), 3, 1)):
            ring = self._ring[body]
            middle = rows.place[:, begin] + 0.5 * ((rows.place[:, end] - rows.place[:, begin]) % ring)
            middles.append(middle % ring)
        at = np.column_stack([middles[0], np.where(of_wall, 0.0, middles[1])])
        return self._complete(place, pairs, first, rows.point - other, tip, rows.normal, -rows.overlap, at)

    def _complete(
        self,
        place: Place,
        pairs: IntArray,
        first: FloatArray,
        second: FloatArray,
        tip: FloatArray,
        normal: FloatArray,
        gap: FloatArray,
        at: FloatArray,
    ) -> Frames:
        c = len(pairs)
        row = np.where(pairs[:, 1] >= self._n, pairs[:, 1] - self._n + 1, 0)
        before, shift, arms = np.empty(c), np.empty(c), np.empty((c, 4))
        bodies = (pairs, row, place.x, first, second, tip, place.before, place.after, self._laws.arrays)
        complete_frames(*bodies, normal, gap, before, shift, arms)
        return Frames(pairs, row, normal, gap, before, shift, arms, at)
