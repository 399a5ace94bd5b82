"""Intersection-based contacts of NURBS grains with each other and with walls."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ninedisk.core.array_types import FloatArray, IntArray
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.nurbs.curve import NurbsCurve
from ninedisk.core.nurbs.curve_kernels import ShapeTable
from ninedisk.core.nurbs.intersect_kernels import contacts_of_pairs
from ninedisk.core.nurbs.state import CROSSED, ENCLOSED, FULL, UNDECIDED, ContactRows, contact_rows, workspace
from ninedisk.core.nurbs.table import joined_tables
from ninedisk.core.nurbs.wall_kernels import contacts_with_wall
from ninedisk.core.validate import all_of_kind, finite, numbers, short_repr

REASONS = {
    ENCLOSED: "lies wholly inside the other body: there is no chord; the overlap is far beyond a contact's",
    CROSSED: "crosses the other body: the common area has more than two corners and no chord that stands for them",
    UNDECIDED: "has a boundary that coincides with the other's over a length: its intersections cannot be told apart",
}


class NurbsGrains:
    """Grains of given shapes, whose contacts can be computed at any positions.

    Parameters
    ----------
    curves : sequence of NurbsCurve
        Shapes, each in its own frame.
    shape : array_like of int, shape (n,)
        Shape of each grain.

    Raises
    ------
    InvalidSceneError
        If a number in ``shape`` is no shape's.
    """

    def __init__(self, curves: Sequence[NurbsCurve], shape: ArrayLike) -> None:
        curves = all_of_kind("curves", curves, NurbsCurve)
        if not curves:
            raise InvalidSceneError("curves is empty: there is no shape that a grain could have")
        given = numbers("shape", shape)
        if given.ndim != 1 or not np.all((given >= 0) & (given < len(curves)) & (given == np.floor(given))):
            raise InvalidSceneError(
                f"shape must be one number in 0 .. {len(curves) - 1} for each grain, not {short_repr(shape)}"
            )
        self.shape = given.astype(np.int64)
        self.table = joined_tables([curve.table for curve in curves])
        self._work = workspace(self.table)

    @classmethod
    def of_table(cls, table: ShapeTable, shape: IntArray) -> NurbsGrains:
        """Grains whose shapes are rows of a table."""
        grains = cls.__new__(cls)
        grains.table, grains.shape, grains._work = table, shape, workspace(table)
        return grains

    def chosen(self, which: IntArray) -> NurbsGrains:
        """Some of the grains by themselves, numbered from 0."""
        grains = NurbsGrains.__new__(NurbsGrains)
        grains.table, grains.shape, grains._work = self.table, self.shape[which], self._work
        return grains

    def pair_contacts(self, x: ArrayLike, angle: ArrayLike, pairs: ArrayLike) -> tuple[IntArray, ContactRows]:
        """Contacts of pairs.

        Parameters
        ----------
        x : array_like, shape (n, 2)
            Positions of the frames' origins [m].
        angle : array_like, shape (n,)
            Rotations [rad].
        pairs : array_like of int, shape (k, 2)
            Grains i, j; normals point from i to j.

        Returns
        -------
        pair : ndarray of int64, shape (m,)
            Row of ``pairs`` to which each contact belongs.
        contacts : ContactRows, of m rows

        Raises
        ------
        InvalidSceneError
            If two grains penetrate each other so far that no chord defines their contact.
        """
        places, turn = self._placed(x, angle)
        given = numbers("pairs", pairs)
        given = given.reshape(-1, 2) if given.size == 0 else given
        if given.ndim != 2 or given.shape[1] != 2 or not np.isin(given, np.arange(len(self.shape))).all():
            raise InvalidSceneError(
                f"pairs must be two numbers 0..{len(self.shape) - 1} of grains in each row, not {short_repr(pairs)}"
            )
        chosen = given.astype(np.int64)
        count = np.zeros(len(chosen), dtype=np.int64)
        room = 2 * len(chosen) + 8
        while True:
            out = contact_rows(room)
            total = contacts_of_pairs(self.table, self.shape, places, turn, chosen, self._work, count, out)
            if not np.any(count == FULL):
                break
            room *= 2
        self._refuse(count, [f"grain {i}, near grain {j}," for i, j in chosen[count < 0]])
        return np.repeat(np.arange(len(chosen)), count), _first(out, total)

    def wall_contacts(
        self, x: ArrayLike, angle: ArrayLike, point: ArrayLike, normal: ArrayLike
    ) -> tuple[IntArray, ContactRows]:
        """Contacts of all grains with the half-plane wall through ``point`` [m] whose unit normal points into the free side.

        Returns
        -------
        grain : ndarray of int64, shape (m,)
            Grain of each contact.
        contacts : ContactRows, of m rows

        Raises
        ------
        InvalidSceneError
            If a grain is wholly beyond the wall, or its boundary lies along the wall's.
        """
        places, turn = self._placed(x, angle)
        surface = finite("normal", normal, (2,))
        wall = np.concatenate([finite("point", point, (2,)), surface / np.hypot(*surface)])
        count = np.zeros(len(places), dtype=np.int64)
        room = 2 * len(places) + 8
        while True:
            out = contact_rows(room)
            total = contacts_with_wall(self.table, self.shape, places, turn, wall, self._work, count, out)
            if not np.any(count == FULL):
                break
            room *= 2
        self._refuse(count, [f"grain {i}, at the wall," for i in np.flatnonzero(count < 0)])
        return np.repeat(np.arange(len(places)), count), _first(out, total)

    def _placed(self, x: ArrayLike, angle: ArrayLike) -> tuple[FloatArray, FloatArray]:
        n = len(self.shape)
        at = finite("angle", numbers("angle", angle), (n,))
        return finite("x", x, (n, 2)), np.column_stack([np.cos(at), np.sin(at)])

    def _refuse(self, count: IntArray, names: list[str]) -> None:
        bad = count[count < 0]
        if len(bad):
            raise InvalidSceneError(f"{names[0]} {REASONS[int(bad[0])]}; reduce the time step or raise the stiffness")


def _first(rows: ContactRows, n: int) -> ContactRows:
    return ContactRows(**{name: column[:n] for name, column in rows._asdict().items()})
