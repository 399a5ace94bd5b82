"""Contacts of polyhedra in degenerate positions, each against its exact points, normal and gap.

All in three sizes, near the origin and 10,000 sizes from it, turned, and with either body first.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
import pytest
from hulls import about, matched, product, random_turn, rotation
from pairs import STILL, Pair, middles, pair, rounding
from scipy.spatial import ConvexHull, HalfspaceIntersection

from ninedisk.core.shapes import ConvexPolyhedron
from ninedisk.core.shapes.state import COINCIDE, EDGE, FACE

CUBE = ConvexPolyhedron.box([1.0, 1.0, 1.0])
PLATE = ConvexPolyhedron.box([2.0, 2.0, 0.5])
EDGE_UP = about([1.0, 0.0, 0.0], np.pi / 4)  # an edge of the cube along x at the height sqrt(2)
EDGE_ALONG_Y = about([0.0, 1.0, 0.0], np.pi / 4)
CORNER_UP = about([-1.0, 1.0, 0.0], np.arctan(np.sqrt(2.0)))  # a corner on the z axis at sqrt(3)
R2, R3 = np.sqrt(2.0), np.sqrt(3.0)
UP = (0.0, 0.0, 1.0)


class Case(NamedTuple):
    """A pair, the margin, what is wanted: middles of the contact points (c, 3), gaps, normal (None: not unique), kinds of features."""

    bodies: Pair
    margin: float
    points: list[tuple[float, float, float]]
    gap: float
    normal: tuple[float, float, float] | None
    kinds: str


def square(half: float, z: float) -> list[tuple[float, float, float]]:
    """Corners of a square across z."""
    return [(a, b, z) for a in (-half, half) for b in (-half, half)]


def octagon(inner: float, z: float) -> list[tuple[float, float, float]]:
    """Corners of a regular octagon with sides along x and y."""
    short = inner * (R2 - 1.0)
    return [(a * u, b * w, z) for u, w in ((inner, short), (short, inner)) for a in (-1, 1) for b in (-1, 1)]


QUARTER = about([0.0, 0.0, 1.0], np.pi / 4)
CASES = {
    "face on face, aligned": Case(pair(CUBE, CUBE, [0, 0, 2]), 0.1, square(1, 1), 0.0, UP, "v v"),
    "face over face, aligned": Case(pair(CUBE, CUBE, [0, 0, 2.05]), 0.1, square(1, 1.025), 0.05, UP, "v v"),
    "face in face, aligned": Case(pair(CUBE, CUBE, [0, 0, 1.75]), 0.1, square(1, 0.875), -0.25, UP, "v v"),
    "face on face, turned by 45 degrees": Case(pair(CUBE, CUBE, [0, 0, 2], QUARTER), 0.1, octagon(1, 1), 0.0, UP, "e e"),
    "face over face, turned by 45 degrees": Case(
        pair(CUBE, CUBE, [0, 0, 2.0625], QUARTER), 0.1, octagon(1, 1.03125), 0.0625, UP, "e e"
    ),
    "small face on large face": Case(pair(PLATE, CUBE, [0.5, -0.25, 1.5]), 0.1,
        [(0.5 + a, -0.25 + b, 0.5) for a in (-1, 1) for b in (-1, 1)], 0.0, UP, "f v"),
    "face on face, shifted": Case(pair(CUBE, CUBE, [0.5, 0.75, 2]), 0.1,
        [(1, 1, 1), (-0.5, -0.25, 1), (1, -0.25, 1), (-0.5, 1, 1)], 0.0, UP, "v f, f v, e e, e e"),
    "face on face, shifted along an edge": Case(pair(CUBE, CUBE, [0.5, 0, 2]), 0.1,
        [(1, 1, 1), (-0.5, -1, 1), (1, -1, 1), (-0.5, 1, 1)], 0.0, UP, "v e, v e, e v, e v"),
    "faces share an edge": Case(pair(CUBE, CUBE, [2, 0, 2]), 0.1, [(1, 1, 1), (1, -1, 1)], 0.0, None, "v v"),
    "edge on edge, collinear, shifted": Case(pair(CUBE, CUBE, [2, 0.5, 2]), 0.1, [(1, 1, 1), (1, -0.5, 1)], 0.0, None, "v e, e v"),
    "edge beside edge, collinear": Case(pair(CUBE, CUBE, [2.03, 0.5, 2.04]), 0.1,
        [(1.015, 1, 1.02), (1.015, -0.5, 1.02)], 0.05, (0.6, 0.0, 0.8), "v e, e v"),
    "edge over edge, parallel": Case(pair(CUBE, CUBE, [0.5, 0, 2 * R2 + 0.05], EDGE_UP, EDGE_UP), 0.06,
        [(1, 0, R2 + 0.025), (-0.5, 0, R2 + 0.025)], 0.05, UP, "v e, e v"),
    "edge in edge, parallel": Case(pair(CUBE, CUBE, [0.5, 0, 2 * R2 - 0.05], EDGE_UP, EDGE_UP), 0.0,
        [], -0.05 / R2, None, ""),
    "edge on edge, crossed": Case(pair(CUBE, CUBE, [0.25, 0.5, 2 * R2], EDGE_ALONG_Y, EDGE_UP), 0.1, [(0.25, 0, R2)], 0.0, UP, "e e"),
    "edge over edge, crossed": Case(pair(CUBE, CUBE, [0.25, 0.5, 2 * R2 + 0.05], EDGE_ALONG_Y, EDGE_UP), 0.1,
        [(0.25, 0, R2 + 0.025)], 0.05, UP, "e e"),
    "edge in edge, crossed": Case(pair(CUBE, CUBE, [0.25, 0.5, 2 * R2 - 0.05], EDGE_ALONG_Y, EDGE_UP), 0.1,
        [(0.25, 0, R2 - 0.025)], -0.05, UP, "e e"),
    "edge on face": Case(pair(PLATE, CUBE, [0.5, 0, 0.5 + R2], EDGE_UP), 0.1, [(1.5, 0, 0.5), (-0.5, 0, 0.5)], 0.0, UP, "f v"),
    "edge on face, past its end": Case(pair(PLATE, CUBE, [1.5, 0, 0.5 + R2], EDGE_UP), 0.1,
        [(2, 0, 0.5), (0.5, 0, 0.5)], 0.0, UP, "e e, f v"),
    "edge along the edge of a face": Case(pair(PLATE, CUBE, [0.5, 2, 0.55 + R2], EDGE_UP), 0.1,
        [(1.5, 2, 0.525), (-0.5, 2, 0.525)], 0.05, UP, "e v"),
    "corner on face": Case(pair(PLATE, CUBE, [0.5, 0.25, 0.5 + R3], CORNER_UP), 0.1, [(0.5, 0.25, 0.5)], 0.0, UP, "f v"),
    "corner in face": Case(pair(PLATE, CUBE, [0.5, 0.25, 0.25 + R3], CORNER_UP), 0.1, [(0.5, 0.25, 0.375)], -0.25, UP, "f v"),
    "corner over edge": Case(pair(CUBE, CUBE, [0.25, 0, R2 + R3 + 0.05], CORNER_UP, EDGE_UP), 0.1,
        [(0.25, 0, R2 + 0.025)], 0.05, UP, "e v"),
    "corner over the edge of a face": Case(pair(PLATE, CUBE, [0.25, 2, 0.55 + R3], CORNER_UP), 0.1, [(0.25, 2, 0.525)], 0.05, UP, "e v"),
    "corner over corner": Case(pair(CUBE, CUBE, [0, 0, 2 * R3 + 0.05], CORNER_UP, CORNER_UP), 0.1,
        [(0, 0, R3 + 0.025)], 0.05, UP, "v v"),
    "corner on corner": Case(pair(CUBE, CUBE, [2, 2, 2]), 0.1, [(1, 1, 1)], 0.0, None, "v v"),
    "corner beside corner": Case(pair(CUBE, CUBE, [2.02, 2.03, 2.06]), 0.1, [(1.01, 1.015, 1.03)], 0.07,
        (2 / 7, 3 / 7, 6 / 7), "v v"),
    "corner over the corner of a face": Case(pair(PLATE, CUBE, [2, 2, 0.55 + R3], CORNER_UP), 0.1, [(2, 2, 0.525)], 0.05, UP, "v v"),
    "one in the other": Case(pair(PLATE, ConvexPolyhedron.box([0.5, 0.5, 0.25]), [0.25, 0, 0.125]), 0.0,
        [(0.25 + a, b, 0.1875) for a in (-0.5, 0.5) for b in (-0.5, 0.5)], -0.625, UP, "f v"),
}  # fmt: skip


def kinds(features: np.ndarray) -> list[str]:
    """Kinds of what touches, sorted."""
    names = ("v", "e", "f")
    return sorted(" ".join(names[int(code) // EDGE] for code in row) for row in features)


def wanted_kinds(case: Case, flipped: bool) -> list[str]:
    each = case.kinds.split(", ")
    each = each * (len(case.points) if len(each) == 1 else 1)
    return sorted(kind[::-1] if flipped else kind for kind in each)


@pytest.mark.parametrize("far", [0.0, 1e4])
@pytest.mark.parametrize("size", [1.0, 1e-3, 1e3])
@pytest.mark.parametrize("name", CASES)
def test_a_degenerate_position_has_its_exact_contacts(name: str, size: float, far: float) -> None:
    case = CASES[name]
    rng = np.random.default_rng(sum(map(ord, name)))
    for turn in (STILL, about([0.0, 0.0, 1.0], 0.5), random_turn(rng), random_turn(rng)):
        shift = size * far * rng.normal(size=3)
        matrix = rotation(turn)
        moved = case.bodies.moved(size, turn, shift)
        for bodies, sign in ((moved, 1.0), (moved.swapped(), -1.0)):
            contacts = bodies.contacts(size * case.margin)
            error = rounding(bodies)
            assert contacts.gap.min() == pytest.approx(size * case.gap, abs=error)
            if not case.points:
                continue
            origin = bodies.x_one - moved.x_one
            found = middles(contacts)[:, :3] + origin
            assert matched(found, size * np.array(case.points) @ matrix.T) <= error
            assert np.allclose(contacts.gap, size * case.gap, rtol=0.0, atol=error)
            if case.normal is not None:
                # Of two points at a small distance, the direction has their rounding over the distance.
                angle = error / size / (abs(case.gap) if case.kinds in ("v v", "e v") and case.gap else 0.04)
                assert np.allclose(contacts.normal, sign * matrix @ case.normal, rtol=0.0, atol=angle)
            assert kinds(contacts.feature) == wanted_kinds(case, flipped=sign < 0.0)


FACES = [name for name in CASES if "face o" in name or "face in" in name]


@pytest.mark.parametrize("name", FACES)
def test_a_face_contact_is_continuous(name: str) -> None:
    """Turned by a small angle about any axis, the support polygon moves by the angle, and by what counts as the same place.

    It may gain points on its sides.
    """
    case = CASES[name]
    rng = np.random.default_rng(1)
    before = case.bodies.contacts(case.margin)
    for power in np.arange(-16.0, -5.9, 0.5):
        for _ in range(5):
            angle = 10.0**power
            turn = about(rng.normal(size=3), angle)
            bodies = case.bodies._replace(q_two=product(turn, case.bodies.q_two))
            after = bodies.contacts(case.margin)
            # Arms are up to 3, and crossings of edges at 45 degrees move by twice the distance of the edges.
            error = 10.0 * (angle + COINCIDE * (angle > 1e-14)) + 1e-14
            polygon = ConvexHull(before.arm_i[:, :2]).equations
            assert (after.arm_i[:, :2] @ polygon[:, :2].T + polygon[:, 2]).max() <= error
            far = np.linalg.norm(middles(after)[:, None] - middles(before)[None], axis=2)
            assert far.min(axis=0).max() <= error
            assert np.ptp(np.append(after.gap, before.gap)) <= error
            assert np.allclose(after.normal, before.normal[0], rtol=0.0, atol=2.0 * angle + 1e-15)
            if angle <= 1e-10:
                assert len(after.gap) == len(before.gap)
            if angle <= 1e-12:
                assert far.min(axis=1).max() <= 10.0 * angle + 1e-14
                assert np.array_equal(np.sort(after.feature, axis=0), np.sort(before.feature, axis=0))


@pytest.mark.parametrize("margin", [1e-9, 0.1, 3.0, 30.0])
def test_faces_along_the_normal_add_nothing(margin: float) -> None:
    """Sides of both boxes are along the normal: with a margin beyond their height, their far edges are behind the near ones."""
    for turn in (STILL, about([0.0, 0.0, 1.0], 0.3), random_turn(np.random.default_rng(2))):
        for q in (STILL, QUARTER, about([0.0, 0.0, 1.0], 0.1)):
            bodies = pair(CUBE, CUBE, [0, 0, 2], q).moved(1.0, turn, np.zeros(3))
            assert len(bodies.contacts(margin).gap) == (4 if q is STILL else 8)


def test_the_support_polygon_of_two_turned_faces_is_their_intersection() -> None:
    """Any angle and shift: the area against that of Qhull's intersection of eight half-planes."""
    rng = np.random.default_rng(5)
    for _ in range(20 if numba.config.DISABLE_JIT else 200):
        angle, shift = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(-0.6, 0.6, size=2)
        bodies = pair(CUBE, CUBE, [*shift, 2.01], about([0.0, 0.0, 1.0], angle))
        contacts = bodies.contacts(0.02)
        sides = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
        turned = sides @ rotation(about([0.0, 0.0, 1.0], angle))[:2, :2].T
        half = np.vstack([np.column_stack([sides, -np.ones(4)]), np.column_stack([turned, -1.0 - turned @ shift])])
        corners = HalfspaceIntersection(half, 0.5 * shift).intersections
        assert ConvexHull(contacts.arm_i[:, :2]).volume == pytest.approx(ConvexHull(corners).volume, rel=1e-12)
        assert matched(contacts.arm_i[:, :2], np.unique(np.round(corners, 10), axis=0)) <= 1e-10


def test_a_resting_point_keeps_its_feature_while_it_slides() -> None:
    features = set()
    for shift in np.linspace(0.0, 0.9, 10):
        contacts = pair(PLATE, CUBE, [shift, 0.5 * shift, 1.5]).contacts(0.01)
        features.add(tuple(sorted(map(tuple, contacts.feature))))
    (only,) = features
    assert {first // FACE for first, _ in only} == {1}
    assert len(only) == 4
