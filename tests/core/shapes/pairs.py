"""Pairs of bodies for tests, and their contacts in the frame of the first one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from hulls import EPS, product, rotation

from ninedisk.core.shapes import Contacts, ConvexPolyhedron, find_contacts, pack, place

STILL = np.array([1.0, 0.0, 0.0, 0.0])


class Pair(NamedTuple):
    """Two polyhedra and where they are."""

    one: ConvexPolyhedron
    two: ConvexPolyhedron
    x_one: np.ndarray
    x_two: np.ndarray
    q_one: np.ndarray
    q_two: np.ndarray

    def corners(self) -> tuple[np.ndarray, np.ndarray]:
        """Vertices of both about the first one's centre of mass."""
        one = self.one.vertices @ rotation(self.q_one).T
        two = self.two.vertices @ rotation(self.q_two).T + (self.x_two - self.x_one)
        return one, two

    def contacts(self, margin: float) -> Contacts:
        """Contacts within a margin."""
        solids = pack([self.one, self.two])
        placed = place(solids, [self.x_one, self.x_two], [self.q_one, self.q_two], [0, 1])
        return find_contacts(solids, placed, [[0, 1]], margin)

    def swapped(self) -> Pair:
        """The same with the other body first."""
        return Pair(self.two, self.one, self.x_two, self.x_one, self.q_two, self.q_one)

    def moved(self, size: float, turn: np.ndarray, shift: np.ndarray) -> Pair:
        """The same in another size, turned about the origin and then shifted."""
        matrix = rotation(turn)
        solids = (
            ConvexPolyhedron(size * self.one.vertices),
            ConvexPolyhedron(size * self.two.vertices),
        )
        places = (matrix @ (size * self.x_one) + shift, matrix @ (size * self.x_two) + shift)
        return Pair(*solids, *places, product(turn, self.q_one), product(turn, self.q_two))


def pair(
    one: ConvexPolyhedron, two: ConvexPolyhedron, t: object, q_two: np.ndarray = STILL, q_one: np.ndarray = STILL
) -> Pair:
    """The first body at the origin, the second one at ``t``."""
    return Pair(one, two, np.zeros(3), np.asarray(t, dtype=float), q_one, q_two)


def middles(contacts: Contacts) -> np.ndarray:
    """Middles of the contact points and gaps, shape (c, 4), from the centre of i."""
    return np.column_stack([contacts.arm_i + 0.5 * contacts.gap[:, None] * contacts.normal, contacts.gap])


def rounding(bodies: Pair) -> float:
    """Rounding of a gap or a contact point: 64 roundings of the size of the pair, and that of the difference of both places."""
    size = bodies.one.radius + bodies.two.radius
    return 64 * EPS * size + 4 * EPS * max(np.abs(bodies.x_one).max(), np.abs(bodies.x_two).max())
