"""Contacts of random pairs of polyhedra, against distances, depths and surfaces of gaps that SciPy and Qhull find."""

from __future__ import annotations

import numba
import numpy as np
import pytest
from hulls import EPS, gap_corners, matched, plane_frame, random_corners, random_turn, rotation, separation
from pairs import STILL, Pair, middles, rounding

from ninedisk.core.shapes import ConvexPolyhedron
from ninedisk.core.shapes.state import STEEP

COUNT = 40 if numba.config.DISABLE_JIT else 1000


def random_pair(rng: np.random.Generator, low: float, high: float) -> Pair:
    """Two polyhedra of 4 to 12 vertices or boxes of random size, whose centres are so many times their radii apart."""
    solids = []
    for _ in range(2):
        if rng.random() < 0.3:
            solids.append(ConvexPolyhedron.box(rng.uniform(0.2, 1.0, size=3)))
        else:
            solids.append(ConvexPolyhedron(random_corners(rng, rng.integers(4, 13))))
    t = rng.normal(size=3)
    t *= rng.uniform(low, high) * (solids[0].radius + solids[1].radius) / np.linalg.norm(t)
    return Pair(*solids, np.zeros(3), t, random_turn(rng), random_turn(rng))


def solid_error(bodies: Pair) -> float:
    """1e-12 of the size of the pair, which is what the reference itself has where its hull has small facets."""
    return 1e-12 * (bodies.one.radius + bodies.two.radius)


@pytest.mark.long
def test_the_smallest_gap_is_the_distance_or_the_least_translation() -> None:
    """Of 1,000 random pairs, separated or not: value, normal and both points."""
    rng = np.random.default_rng(11)
    separated = 0
    for _ in range(COUNT):
        bodies = random_pair(rng, 0.0, 1.1)
        one, two = bodies.corners()
        wanted, normal = separation(one, two)
        contacts = bodies.contacts(abs(wanted) + 0.1)
        error = solid_error(bodies)
        k = int(np.argmin(contacts.gap))
        assert contacts.gap[k] == pytest.approx(wanted, abs=error)
        if wanted > 0.0:
            separated += 1
            assert np.allclose(contacts.normal[k], normal, rtol=0.0, atol=error / wanted)
            assert len(bodies.contacts(wanted + error).gap) >= 1
            assert len(bodies.contacts(wanted - error).gap) == 0
        # The normal's own gap, by all vertices: no error of the axis is hidden.
        n = contacts.normal[0]
        assert (two @ n).min() - (one @ n).max() == pytest.approx(wanted, abs=error)
        assert np.array_equal(contacts.normal, np.tile(n, (len(contacts.gap), 1)))
    assert 0.3 * COUNT < separated < 0.7 * COUNT


@pytest.mark.long
def test_contacts_are_all_corners_of_the_surface_of_gaps() -> None:
    """No corner below the margin is missing but for those on steep faces, and nothing else is found; each point is on its body."""
    rng = np.random.default_rng(12)
    several, left_out, total = 0, 0, 0
    for _ in range(COUNT // 2):
        bodies = random_pair(rng, 0.4, 0.95)
        one, two = bodies.corners()
        wanted, _ = separation(one, two)
        margin = wanted + rng.uniform(0.02, 0.3)
        contacts = bodies.contacts(margin)
        n = contacts.normal[0]
        corners = gap_corners(one, two, n, margin)
        if not len(corners):
            continue
        several += len(corners) > 1
        frame = plane_frame(n)
        found = np.column_stack([contacts.arm_i @ frame.T, contacts.gap])
        # Steep faces take the rounding of the reference's intersections with them.
        found, corners = found[contacts.gap < margin - 1e-8], corners[corners[:, 2] < margin - 1e-8]
        far = np.linalg.norm(found[:, None] - corners[None], axis=2)
        if len(found):
            assert far.min(axis=1).max() <= 1e-7
            assert len(set(far.argmin(axis=1))) == len(found)
        missing = corners[(far > 1e-7).all(axis=0)]
        left_out += len(missing)
        total += len(found)
        assert all(on_steep_faces(each, bodies, n) for each in missing)
        for solid, turn, arms, features in (
            (bodies.one, bodies.q_one, contacts.arm_i, contacts.feature[:, 0]),
            (bodies.two, bodies.q_two, contacts.arm_j, contacts.feature[:, 1]),
        ):
            local = arms @ rotation(turn)
            heights = local @ solid.normals.T - solid.offsets
            # A point over a steep face has the rounding of the gap over its slope: 1e-6 is the steepest of the sample.
            assert np.abs(heights.max(axis=1)).max() <= 1e-10
            for point, code in zip(local, features, strict=True):
                kind, number = code // 256, code % 256
                if kind == 0:
                    assert np.linalg.norm(solid.vertices[number] - point) <= rounding(bodies)
                elif kind == 1:
                    a, b = solid.vertices[solid.edges[number, :2]]
                    along = (b - a) / np.linalg.norm(b - a)
                    assert np.linalg.norm(np.cross(point - a, along)) <= 1e-10
                else:
                    assert abs(solid.normals[number] @ point - solid.offsets[number]) <= 1e-10
    assert several > COUNT // 8
    assert left_out < 0.1 * total


def on_steep_faces(corner: np.ndarray, bodies: Pair, n: np.ndarray) -> bool:
    """Whether a corner of the surface of gaps is on no face of one of the bodies that is less steep than `STEEP`."""
    frame = plane_frame(n)
    for solid, turn, points, sign in (
        (bodies.one, bodies.q_one, bodies.corners()[0], 1.0),
        (bodies.two, bodies.q_two, bodies.corners()[1], -1.0),
    ):
        normals = solid.normals @ rotation(turn).T
        offsets = (points @ normals.T).max(axis=0)
        across = corner[:2] @ frame
        slopes = sign * normals @ n
        facing = slopes > 0.0
        heights = (offsets - normals @ across)[facing] / (sign * slopes[facing])
        surface = sign * (sign * heights).min()
        near = np.abs(heights - surface) < 1e-8
        if not np.any(slopes[facing][near] > STEEP):
            return True
    return False


def test_order_of_bodies_vertices_and_a_turn_of_the_whole_have_no_effect() -> None:
    rng = np.random.default_rng(13)
    for _ in range(COUNT // 4):
        bodies = random_pair(rng, 0.3, 1.0)
        wanted, _ = separation(*bodies.corners())
        margin = wanted + 0.1
        contacts = bodies.contacts(margin)
        if np.abs(contacts.gap - margin).min() < 1e-9 or runner_up(bodies, contacts.normal[0]):
            continue
        shuffled = bodies._replace(
            one=ConvexPolyhedron(rng.permutation(bodies.one.vertices)),
            two=ConvexPolyhedron(rng.permutation(bodies.two.vertices)),
        )
        again = shuffled.contacts(margin)
        assert matched(middles(again), middles(contacts)) <= 1e-10
        swapped = bodies.swapped().contacts(margin)
        moved = middles(swapped) + np.array([*(bodies.x_two - bodies.x_one), 0.0])
        assert np.allclose(swapped.normal, -contacts.normal[0], rtol=0.0, atol=1e-9)
        assert matched(moved, middles(contacts)) <= 1e-9
        turn = random_turn(rng)
        whole = bodies.moved(1.0, turn, 10.0 * rng.normal(size=3))
        turned = middles(whole.contacts(margin))
        turned[:, :3] = turned[:, :3] @ rotation(turn)
        assert matched(turned, middles(contacts)) <= 1e-9


def runner_up(bodies: Pair, n: np.ndarray) -> bool:
    """Whether another normal is as good to rounding, so that rounding decides between two sets of contacts."""
    one, two = bodies.corners()
    wanted, _ = separation(one, two)
    axes = np.vstack([bodies.one.normals @ rotation(bodies.q_one).T, -bodies.two.normals @ rotation(bodies.q_two).T])
    apart = (two @ axes.T).min(axis=0) - (one @ axes.T).max(axis=0)
    return bool(np.any((apart > wanted - 1e-9) & (axes @ n < 1.0 - 1e-9)))


@pytest.mark.parametrize("size", [1e-3, 1e3, 1e-40, 1e40])
def test_contacts_scale_with_the_bodies(size: float) -> None:
    """By a power of two nearly exactly; by powers of ten to rounding."""
    rng = np.random.default_rng(14)
    for _ in range(20):
        bodies = random_pair(rng, 0.3, 1.0)
        wanted, _ = separation(*bodies.corners())
        one = bodies.contacts(wanted + 0.1)
        two = bodies.moved(size, STILL, np.zeros(3)).contacts(size * (wanted + 0.1))
        assert matched(middles(two) / size, middles(one)) <= 1e-10
        assert np.array_equal(one.feature, two.feature)


def test_bodies_of_very_different_sizes() -> None:
    """A small box on the face of a box 10,000 times as large: as on a plane."""
    rng = np.random.default_rng(15)
    large, small = ConvexPolyhedron.box([1.0, 1.0, 1.0]), ConvexPolyhedron.box([1e-4, 2e-4, 3e-4])
    for _ in range(20):
        turn = np.array([np.cos(0.3), 0.0, 0.0, np.sin(0.3)])
        bodies = Pair(large, small, np.zeros(3), np.array([*rng.uniform(-0.9, 0.9, 2), 1.0003]), STILL, turn)
        contacts = bodies.contacts(1e-5)
        assert len(contacts.gap) == 4
        assert np.abs(contacts.gap).max() <= 8 * EPS
