"""Convex polyhedra: mass in closed form, faces against Qhull, refusals by name."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from hulls import EPS, about, random_corners, random_turn, rotation
from scipy.spatial import ConvexHull

from ninedisk.core import CoreError, InvalidSceneError
from ninedisk.core.shapes import ConvexPolyhedron, pack
from ninedisk.core.shapes.state import EDGES, FACES, VERTICES

GOLDEN = 0.5 * (1.0 + np.sqrt(5.0))
TETRAHEDRON = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]])
OCTAHEDRON = np.vstack([np.eye(3), -np.eye(3)])
ICOSAHEDRON = np.array([np.roll([0.0, a, b * GOLDEN], k) for a in (-1.0, 1.0) for b in (-1.0, 1.0) for k in range(3)])
DODECAHEDRON = np.vstack(
    [
        [[a, b, c] for a in (-1.0, 1.0) for b in (-1.0, 1.0) for c in (-1.0, 1.0)],
        [np.roll([0.0, a / GOLDEN, b * GOLDEN], k) for a in (-1.0, 1.0) for b in (-1.0, 1.0) for k in range(3)],
    ]
)
# Edge a: volumes and moments of inertia over m a^2 (for instance Satterly, Am. Math. Mon. 65, 1958).
REGULAR = {
    "tetrahedron": (TETRAHEDRON, np.sqrt(8.0), np.sqrt(2.0) / 12.0, 1.0 / 20.0, 4, 6),
    "octahedron": (OCTAHEDRON, np.sqrt(2.0), np.sqrt(2.0) / 3.0, 1.0 / 10.0, 8, 12),
    "icosahedron": (ICOSAHEDRON, 2.0, 5.0 * GOLDEN**2 / 6.0, GOLDEN**2 / 10.0, 20, 30),
    "dodecahedron": (
        DODECAHEDRON,
        2.0 / GOLDEN,
        (15.0 + 7.0 * np.sqrt(5.0)) / 4.0,
        (39.0 * GOLDEN + 28.0) / 150.0,
        12,
        30,
    ),
}
# Sums of up to 116 tetrahedra, each of some ten roundings.
ROUNDING = 200 * EPS


@pytest.mark.parametrize("size", [1.0, 1e-3, 1e3])
@pytest.mark.parametrize("name", REGULAR)
def test_regular_polyhedra_have_their_closed_forms(name: str, size: float) -> None:
    corners, edge, volume, inertia, faces, edges = REGULAR[name]
    turned = corners @ rotation(about([1.0, 2.0, 3.0], 0.7)).T
    for points in (corners, turned):
        found = ConvexPolyhedron(size * points)
        a = size * edge
        assert found.volume == pytest.approx(volume * a**3, rel=ROUNDING)
        assert np.allclose(found.moments, inertia * volume * a**5, rtol=ROUNDING, atol=0.0)
        assert (len(found.faces), len(found.edges)) == (faces, edges)
        assert found.radius == pytest.approx(size * np.linalg.norm(corners[0]), rel=ROUNDING)
        assert np.abs(found.centre).max() <= ROUNDING * size
        lengths = np.linalg.norm(found.vertices[found.edges[:, 1]] - found.vertices[found.edges[:, 0]], axis=1)
        assert np.allclose(lengths, a, rtol=ROUNDING, atol=0.0)


def test_a_box_is_exact() -> None:
    """No vertex, normal or axis of a box is rounded."""
    for half in ([1.0, 2.0, 3.0], [0.1, 0.7, 0.3], [1e-3, 5e-3, 2e2]):
        box = ConvexPolyhedron.box(half)
        assert np.array_equal(np.unique(np.abs(box.vertices), axis=0), [half])
        assert np.array_equal(box.axes, np.eye(3))
        assert np.array_equal(box.centre, np.zeros(3))
        assert np.array_equal(np.sort(box.normals @ [1.0, 2.0, 3.0]), [-3.0, -2.0, -1.0, 1.0, 2.0, 3.0])
        assert np.array_equal(box.directions, np.eye(3)[::-1])
        assert np.array_equal(np.sort(box.offsets), np.sort(half * 2))
        a, b, c = half
        mass = 8.0 * a * b * c
        assert box.volume == pytest.approx(mass, rel=ROUNDING)
        wanted = mass / 3.0 * np.array([b * b + c * c, a * a + c * c, a * a + b * b])
        assert np.allclose(box.moments, wanted, rtol=ROUNDING, atol=0.0)


def test_mass_of_a_skew_corner_against_the_integrals_of_the_unit_tetrahedron() -> None:
    """A linear map takes the integrals of x_i x_j with it: those of the unit tetrahedron are 1/60 and 1/120."""
    rng = np.random.default_rng(3)
    for _ in range(20):
        matrix, shift = rng.normal(size=(3, 3)), rng.normal(size=3)
        corner = ConvexPolyhedron(np.vstack([np.zeros(3), np.eye(3)]) @ matrix.T + shift)
        volume = abs(np.linalg.det(matrix)) / 6.0
        second = (
            6.0 * volume * matrix @ (np.full((3, 3), 1 / 120) + np.eye(3) / 120 - np.full((3, 3), 1 / 96)) @ matrix.T
        )
        inertia = np.trace(second) * np.eye(3) - second
        # A thin tetrahedron loses the digits of its aspect ratio.
        rounding = ROUNDING * np.linalg.cond(matrix)
        assert corner.volume == pytest.approx(volume, rel=rounding)
        assert np.allclose(corner.centre, 0.25 * matrix.sum(axis=1) + shift, rtol=0.0, atol=rounding * corner.radius)
        assert np.allclose(corner.inertia, inertia, rtol=0.0, atol=rounding * np.trace(inertia))
        assert np.allclose(
            corner.axes @ np.diag(corner.moments) @ corner.axes.T, corner.inertia, atol=rounding * np.trace(inertia)
        )
        assert np.linalg.det(corner.axes) == pytest.approx(1.0, abs=ROUNDING)


@pytest.mark.parametrize("count", [4, 5, 8, 20, 64])
def test_faces_and_volume_agree_with_qhull(count: int) -> None:
    rng = np.random.default_rng(count)
    points = random_corners(rng, count)
    found, hull = ConvexPolyhedron(points), ConvexHull(points)
    assert found.volume == pytest.approx(hull.volume, rel=1e-12)  # that of Qhull sums from an inner point
    assert len(found.faces) == len(hull.simplices) == 2 * count - 4
    wanted = {tuple(sorted(map(tuple, points[simplex]))) for simplex in hull.simplices}
    own = found.vertices + found.centre
    given = {
        tuple(sorted(tuple(points[np.argmin(np.linalg.norm(points - own[k], axis=1))]) for k in loop))
        for loop in found.faces
    }
    assert given == wanted
    for loop, normal, offset in zip(found.faces, found.normals, found.offsets, strict=True):
        heights = found.vertices @ normal
        assert np.allclose(heights[list(loop)], offset, atol=ROUNDING)
        assert heights.max() <= offset + ROUNDING
        a, b, c = found.vertices[list(loop[:3])]
        assert np.cross(b - a, c - b) @ normal > 0.0
    for a, b, left, right in found.edges:
        assert a < b
        loop = found.faces[left] * 2
        assert loop[loop.index(a) + 1] == b
        loop = found.faces[right] * 2
        assert loop[loop.index(b) + 1] == a
        assert np.cross(found.normals[left], found.normals[right]) @ (found.vertices[b] - found.vertices[a]) > 0.0
    assert len(found.vertices) - len(found.edges) + len(found.faces) == 2


def test_order_of_the_vertices_has_no_effect() -> None:
    rng = np.random.default_rng(8)
    points = random_corners(rng, 12)
    first = ConvexPolyhedron(points)
    for _ in range(10):
        other = ConvexPolyhedron(rng.permutation(points))
        assert other == first
        assert other.faces == first.faces
        for name in ("normals", "offsets", "edges", "inertia", "moments", "axes", "directions"):
            assert np.array_equal(getattr(other, name), getattr(first, name)), name
    assert first != ConvexPolyhedron(points[:-1])
    assert first != 3
    boxes = {str(ConvexPolyhedron(np.array(corners) * 1.0).faces) for corners in permutations(TETRAHEDRON)}
    assert len(boxes) == 1


def test_triangles_of_a_face_are_one_face() -> None:
    """Prisms with rounded corners, turned and far from the origin: two ends and as many sides as corners."""
    rng = np.random.default_rng(4)
    for count in (3, 5, 6, 17, 32):
        angle = 2.0 * np.pi * np.arange(count) / count
        ring = np.column_stack([np.cos(angle), np.sin(angle)])
        points = np.vstack([np.column_stack([ring, np.full(count, h)]) for h in (-0.3, 0.5)])
        points = points @ rotation(random_turn(rng)).T + 1e4 * rng.normal(size=3)
        found = ConvexPolyhedron(points)
        assert sorted(map(len, found.faces)) == sorted([4] * count + [count] * 2)
        area = 0.5 * count * np.sin(2.0 * np.pi / count)
        # Coordinates of 1e4 are known to 1e-12.
        assert found.volume == pytest.approx(0.8 * area, rel=1e-10)


def test_a_rigid_motion_turns_the_tensor_and_leaves_the_moments() -> None:
    rng = np.random.default_rng(6)
    points = random_corners(rng, 10)
    one, q = ConvexPolyhedron(points), rotation(random_turn(rng))
    two = ConvexPolyhedron(points @ q.T + 3.0)
    assert np.allclose(two.inertia, q @ one.inertia @ q.T, atol=ROUNDING * np.trace(one.inertia))
    assert np.allclose(two.moments, one.moments, rtol=ROUNDING)
    assert np.allclose(two.centre, q @ one.centre + 3.0, atol=ROUNDING)


CUBE = np.array([[i, j, k] for i in (0.0, 1.0) for j in (0.0, 1.0) for k in (0.0, 1.0)])


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (CUBE[:3], "a polyhedron of 3 vertices is not allowed: it must have 4 to 64"),
        (np.zeros((65, 3)), "a polyhedron of 65 vertices is not allowed"),
        (CUBE[:4], "the vertices of a polyhedron are in one plane"),
        (CUBE * [1.0, 1.0, 1e-10], "the vertices of a polyhedron are in one plane"),
        (np.zeros((5, 3)), "the vertices of a polyhedron are in one plane"),
        (np.vstack([CUBE, [0.5, 0.5, 0.5]]), "vertex 8 is no corner"),
        (np.vstack([[0.5, 0.5, 0.0], CUBE]), "vertex 0 is no corner"),
        (np.vstack([CUBE, [[0.5, 0.0, 0.0], [0.2, 0.2, 0.2]]]), "vertices 8, 9 are no corners"),
        (np.vstack([CUBE, CUBE[3] + 1e-12]), "vertex 8 is no corner"),
        (np.vstack([CUBE, CUBE[3] + 1e-10 * CUBE[5]]), "vertex 8 is no corner"),
        (np.where(CUBE[5] == CUBE, np.nan, CUBE), "is not allowed: it must be finite"),
        (CUBE[:, :2], "vertices has shape (8, 2); it must have shape (n, 3)"),
        (CUBE * 1e70, "change units"),
        (CUBE * 1e-70, "change units"),
        ([["a", 0, 0]] * 4, "vertices must be numbers"),
    ],
)
def test_what_is_no_solid_polyhedron_is_refused_by_name(points: object, message: str) -> None:
    with pytest.raises(InvalidSceneError) as refused:
        ConvexPolyhedron(points)  # type: ignore[arg-type]
    assert message in str(refused.value)


@pytest.mark.parametrize("half", [[1.0, 1.0], [1.0, 0.0, 1.0], [1.0, -1.0, 1.0], [1.0, np.inf, 1.0], "abc"])
def test_a_box_without_size_is_refused(half: object) -> None:
    with pytest.raises(CoreError, match="half_extents"):
        ConvexPolyhedron.box(half)  # type: ignore[arg-type]


def test_nearly_flat_roofs_are_right_or_refused() -> None:
    """A pyramid on a cube, lower and lower: an own corner down to 1e-9 of the size, none below."""
    for height in 10.0 ** np.arange(-1.0, -14.0, -0.5):
        points = np.vstack([CUBE - 0.5, [0.0, 0.0, 0.5 + height]])
        if height > 1e-8:
            assert len(ConvexPolyhedron(points).faces) == 9
        elif height < 1e-10:
            with pytest.raises(InvalidSceneError, match="no corner"):
                ConvexPolyhedron(points)


def test_limits_hold_for_any_polyhedron_with_the_most_vertices() -> None:
    solid = ConvexPolyhedron(random_corners(np.random.default_rng(1), VERTICES))
    assert (len(solid.edges), len(solid.faces)) == (EDGES, FACES)
    both = pack([solid, ConvexPolyhedron.box([1.0, 1.0, 1.0])])
    assert both.first_vertex.tolist() == [0, 64, 72]
    assert both.first_edge.tolist() == [0, 186, 198]
    assert both.first_loop[-1] == len(both.loop) == 3 * FACES + 24
    with pytest.raises(InvalidSceneError, match=r"shapes\[0\] = 3"):
        pack([3])  # type: ignore[list-item]
