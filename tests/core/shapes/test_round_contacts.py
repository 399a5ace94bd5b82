"""Contacts of spheres and planes with each other and with polyhedra."""

from __future__ import annotations

import numba
import numpy as np
import pytest
from hulls import EPS, about, least_norm, matched, product, random_corners, random_turn, rotation

from ninedisk.core import InvalidSceneError
from ninedisk.core.shapes import Contacts, ConvexPolyhedron, find_contacts, near_pairs, pack, place
from ninedisk.core.shapes.state import EDGE, FACE, SPHERE, WHOLE

STILL = [1.0, 0.0, 0.0, 0.0]
BOX = ConvexPolyhedron.box([1.0, 2.0, 3.0])
COUNT = 50 if numba.config.DISABLE_JIT else 1000
FLOOR = [[0.0, 0.0, 0.0, 0.0, 0.0, 1.0]]


def spheres(x: object, radius: object, margin: float, planes: object = None, pairs: object = ((0, 1),)) -> Contacts:
    """Contacts of spheres."""
    solids = pack([])
    count = len(np.asarray(x))
    placed = place(solids, x, [STILL] * count, [SPHERE] * count, radius)
    return find_contacts(solids, placed, pairs, margin, planes)


@pytest.mark.parametrize("size", [1.0, 1e-3, 1e3])
@pytest.mark.parametrize("gap", [-0.5, -1e-9, 0.0, 1e-9, 0.1])
def test_two_spheres(size: float, gap: float) -> None:
    n = np.array([2.0, 3.0, 6.0]) / 7.0
    x = size * np.array([1e3 * n, 1e3 * n + (1.5 + gap) * n])
    found = spheres(x, [size, 0.5 * size], 0.2 * size)
    error = 1e3 * 8 * EPS  # of the coordinates
    assert found.gap == pytest.approx([size * gap], abs=size * error)
    assert np.allclose(found.normal, [n], rtol=0.0, atol=2 * error)
    assert np.allclose(found.arm_i, [size * n], rtol=0.0, atol=2 * size * error)
    assert np.allclose(found.arm_j, [-0.5 * size * n], rtol=0.0, atol=2 * size * error)
    assert found.feature.tolist() == [[WHOLE, WHOLE]]
    assert len(spheres(x, [size, 0.5 * size], size * (gap - 1e-6)).gap) == 0


def test_concentric_spheres_have_a_normal() -> None:
    found = spheres([[1.0, 2.0, 3.0]] * 2, [1.0, 2.0], 0.0)
    assert (found.gap.tolist(), found.normal.tolist()) == ([-3.0], [[1.0, 0.0, 0.0]])


@pytest.mark.parametrize("size", [1.0, 1e-3, 1e3])
def test_a_sphere_on_a_plane(size: float) -> None:
    out = np.array([2.0, -3.0, 6.0]) / 7.0
    point = size * np.array([5.0, 6.0, 7.0])
    side = np.cross(out, [0.0, 0.0, 1.0])
    plane = [[*point, *out]]
    for gap in (-0.5, 0.0, 0.25):
        x = point + size * (4.0 * side + (1.0 + gap) * out)
        found = spheres([x], [size], 0.3 * size, plane, [[0, 1]])
        assert found.body.tolist() == [[0, 1]]
        assert found.gap == pytest.approx([gap * size], abs=64 * EPS * size)
        assert np.array_equal(found.normal, [-out])
        assert np.allclose(found.arm_i, [-size * out], rtol=0.0, atol=8 * EPS * size)
        assert np.allclose(point + found.arm_j, [point + 4.0 * size * side], rtol=0.0, atol=64 * EPS * size)
    assert len(spheres([point + size * 1.31 * out], [size], 0.3 * size, plane, [[0, 1]]).gap) == 0


@pytest.mark.parametrize("size", [1.0, 1e-3, 1e3])
@pytest.mark.parametrize("flip", [False, True])
def test_a_sphere_at_a_box_by_the_clamped_centre(size: float, flip: bool) -> None:
    """Outside, the nearest point of a box has the centre's coordinates clamped to its sides; inside, the nearest side decides."""
    half = np.array([1.0, 2.0, 3.0])
    solids = pack([ConvexPolyhedron.box(size * half)])
    rng = np.random.default_rng(1)
    kinds = set()
    for _ in range(COUNT):
        turn, shift = random_turn(rng), 10.0 * rng.normal(size=3)
        c = rng.uniform(-1.6, 1.6, size=3) * half
        radius = rng.uniform(0.1, 1.0)
        if np.all(np.abs(c) < half):
            k = int(np.argmin(half - np.abs(c)))
            far, out = -(half - np.abs(c))[k], np.sign(c[k]) * np.eye(3)[k]
            wanted_kind = FACE
        else:
            w = c - np.clip(c, -half, half)
            far = np.linalg.norm(w)
            out = w / far
            wanted_kind = (FACE, EDGE, 0)[np.count_nonzero(w) - 1]
        matrix = rotation(turn)
        x = size * np.array([shift + matrix @ c, shift])
        turns, shapes, radii = [STILL, turn], [SPHERE, 0], [size * radius, 0.0]
        if flip:
            x, turns, shapes, radii = x[::-1], turns[::-1], shapes[::-1], radii[::-1]
        placed = place(solids, x, turns, shapes, radii)
        found = find_contacts(solids, placed, [[0, 1]], 2.0 * size)
        # Coordinates up to 30 are rounded to 4e-15.
        error = 200 * EPS
        if far - radius > 2.0 + error:
            assert len(found.gap) == 0
            continue
        assert found.gap == pytest.approx([size * (far - radius)], abs=error * size)
        sign = 1.0 if flip else -1.0
        assert np.allclose(
            found.normal, [sign * matrix @ out], rtol=0.0, atol=error / min(1.0, abs(far)) if far > 0 else error
        )
        apart = placed.x[1] + found.arm_j[0] - placed.x[0] - found.arm_i[0]
        assert np.allclose(apart, found.gap[0] * found.normal[0], rtol=0.0, atol=error * size)
        code = found.feature[0, 0 if flip else 1]
        assert found.feature[0, 1 if flip else 0] == WHOLE
        assert code // EDGE * EDGE == wanted_kind
        if wanted_kind == 0:
            assert np.array_equal(solids.vertex[code], size * np.clip(c, -half, half))
        kinds.add(int(code))
    assert len(kinds) == 8 + 12 + 6 or numba.config.DISABLE_JIT


def test_a_sphere_at_any_polyhedron_by_least_norms() -> None:
    """Distance of the centre against Lawson and Hanson's method."""
    rng = np.random.default_rng(2)
    for _ in range(COUNT):
        solid = ConvexPolyhedron(random_corners(rng, rng.integers(4, 15)))
        solids, turn = pack([solid]), random_turn(rng)
        c = rng.normal(size=3)
        c *= solid.radius * rng.uniform(0.0, 1.5) / np.linalg.norm(c)
        depth = solid.normals @ c - solid.offsets
        far = depth.max() if depth.max() <= 0.0 else np.linalg.norm(least_norm(solid.normals, -depth))
        placed = place(solids, [rotation(turn) @ c, [0.0, 0.0, 0.0]], [STILL, turn], [SPHERE, 0], [0.3, 0.0])
        found = find_contacts(solids, placed, [[0, 1]], 10.0)
        assert found.gap == pytest.approx([far - 0.3], abs=1e-12 * solid.radius)  # the precision of the reference


def test_a_sphere_whose_centre_is_on_the_surface_has_the_normal_of_the_face() -> None:
    """On faces, edges and corners to rounding, where the closest points have no direction."""
    solids = pack([BOX])
    for c in ([1.0, 0.3, 0.2], [1.0, 2.0, 0.5], [1.0, 2.0, 3.0]):
        for k in range(-3, 4):
            for turn in (np.array(STILL), about([1.0, 2.0, 3.0], 1.0)):
                at = rotation(turn) @ (np.array(c) * (1.0 + k * EPS))
                placed = place(solids, [at, [0.0] * 3], [STILL, turn], [SPHERE, 0], [0.5, 0.0])
                found = find_contacts(solids, placed, [[0, 1]], 0.0)
                out = -rotation(turn).T @ found.normal[0]
                assert found.gap == pytest.approx([-0.5], abs=64 * EPS)
                assert np.abs(BOX.normals @ out - 1.0).min() <= 8 * EPS


@pytest.mark.parametrize("size", [1.0, 1e-3, 1e3])
@pytest.mark.parametrize("far", [0.0, 1e4])
def test_a_box_on_a_plane(size: float, far: float) -> None:
    """Face, edge and corner: gaps and points in closed form, on a plane in any place."""
    rng = np.random.default_rng(3)
    solids = pack([ConvexPolyhedron.box([size, size, size])])
    r2, r3 = np.sqrt(2.0), np.sqrt(3.0)
    cases = [
        (np.array(STILL), 1.0, [(a, b) for a in (-1.0, 1.0) for b in (-1.0, 1.0)]),
        (about([1.0, 0.0, 0.0], np.pi / 4), r2, [(-1.0, 0.0), (1.0, 0.0)]),
        (about([-1.0, 1.0, 0.0], np.arctan(r2)), r3, [(0.0, 0.0)]),
    ]
    for turn, height, corners in cases:
        for gap in (-0.05, 0.0, 0.05):
            whole, shift = random_turn(rng), size * far * rng.normal(size=3)
            matrix = rotation(whole)
            plane = [[*(shift + matrix @ [3.0 * size, 4.0 * size, 0.0]), *matrix[:, 2]]]
            x = shift + matrix @ [0.0, 0.0, size * (height + gap)]
            placed = place(solids, [x], [product(whole, turn)], [0])
            found = find_contacts(solids, placed, [[0, 1]], 0.1 * size, plane)
            error = size * (64 * EPS + 16 * EPS * far)
            assert np.allclose(found.gap, size * gap, rtol=0.0, atol=error)
            assert np.array_equal(found.normal, np.tile(-matrix[:, 2], (len(corners), 1)))
            wanted = size * np.array([[*corner, -height] for corner in corners])
            assert matched(found.arm_i @ matrix, wanted) <= error
            on_plane = size * np.array([[a - 3.0, b - 4.0, 0.0] for a, b in corners])
            assert matched(found.arm_j @ matrix, on_plane) <= error
            assert set(found.feature[:, 1]) == {WHOLE}
            assert np.allclose(
                solids.vertex[found.feature[:, 0]] @ rotation(product(whole, turn)).T, found.arm_i, atol=error
            )


def test_a_large_margin_does_not_reach_the_far_side() -> None:
    """The upper corners of a box are hidden behind its lower face."""
    solids = pack([BOX])
    placed = place(solids, [[0.0, 0.0, 3.0]], [STILL], [0])
    assert len(find_contacts(solids, placed, [[0, 1]], 100.0, FLOOR).gap) == 4


def test_a_scene_of_all_kinds_has_its_contacts_in_the_order_of_the_pairs() -> None:
    solids = pack([BOX, ConvexPolyhedron.box([1.0, 1.0, 1.0])])
    x = [[0.0, 0.0, 3.0], [0.0, 0.0, 7.0], [0.0, 0.0, 9.0], [0.0, 0.0, 11.0], [0.0, 9.0, 1.0]]
    placed = place(solids, x, [STILL] * 5, [0, 1, SPHERE, SPHERE, SPHERE], [9.0, 9.0, 1.0, 1.0, 1.0])
    assert np.allclose(placed.radius, [np.sqrt(14.0), np.sqrt(3.0), 1.0, 1.0, 1.0], rtol=4 * EPS)
    pairs = np.vstack([near_pairs(placed.x, placed.radius, 0.01), [[0, 5], [1, 5], [4, 5], [2, 6]]])
    planes = [*FLOOR, [0.0, 2.0, 0.0, 0.0, -1.0, 0.0]]
    found = find_contacts(solids, placed, pairs, 0.01, planes)
    assert found.body.tolist() == [[0, 1]] * 4 + [[1, 2], [2, 3]] + [[0, 5]] * 4 + [[4, 5]]
    assert np.array_equal(found.gap, np.zeros(11))
    found = find_contacts(solids, placed, [[2, 6]], 1.5, planes)
    assert (found.gap.tolist(), found.normal.tolist(), found.arm_j.tolist()) == (
        [1.0],
        [[0.0, 1.0, 0.0]],
        [[0.0, 0.0, 9.0]],
    )


def test_more_contacts_than_expected_are_all_found() -> None:
    """Octagons on octagons: eight contacts of each of many pairs."""
    cube = pack([ConvexPolyhedron.box([1.0, 1.0, 1.0])])
    turns = [STILL if k % 2 else about([0.0, 0.0, 1.0], np.pi / 4) for k in range(30)]
    placed = place(cube, [[0.0, 0.0, 2.0 * k] for k in range(30)], turns, [0] * 30)
    found = find_contacts(cube, placed, [[k, k + 1] for k in range(29)], 0.01)
    assert found.body.tolist() == [[k, k + 1] for k in range(29) for _ in range(8)]
    assert np.abs(found.gap).max() <= 64 * EPS


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"x": [[0.0, 0.0]]}, "x has shape (1, 2)"),
        ({"x": [[0.0, 0.0, np.nan]]}, "x must be finite"),
        (
            {"quaternion": [[1.0, 1.0, 0.0, 0.0]]},
            "quaternion[0] = [1.0, 1.0, 0.0, 0.0] is not allowed: its size must be 1",
        ),
        ({"shape": [1]}, "shape[0] = 1 is not allowed: it must be the number of one of 1 polyhedra, or -1"),
        ({"shape": [-2]}, "shape[0] = -2 is not allowed"),
        ({"shape": [0.5]}, "shape[0] = 0.5 is not allowed"),
        ({"shape": [-1]}, "radius is missing and body 0 is a sphere"),
        ({"shape": [-1], "radius": [0.0]}, "radius[0] = 0 is not allowed: that of a sphere must be > 0"),
        ({"pairs": [[0, 0]]}, "pairs[0] = [0.0, 0.0] is not allowed"),
        ({"pairs": [[0, 2]]}, "pairs[0] = [0.0, 2.0] is not allowed"),
        ({"pairs": [[1, 0]]}, "pairs[0] = [1.0, 0.0] is not allowed"),
        ({"pairs": [0, 1]}, "pairs has shape (2,)"),
        ({"margin": np.nan}, "margin = nan is not allowed"),
        (
            {"planes": [[0.0, 0.0, 0.0, 0.0, 0.0, 2.0]]},
            "the normal [0.0, 0.0, 2.0] of plane 0 is not allowed: its size must be 1",
        ),
        ({"planes": [[0.0, 0.0, 1.0]]}, "planes has shape (1, 3); it must have shape (1, 6)"),
    ],
)
def test_what_is_not_allowed_is_refused_by_name(changed: dict[str, object], message: str) -> None:
    given = {
        "x": [[0.0, 0.0, 0.0]],
        "quaternion": [STILL],
        "shape": [0],
        "radius": None,
        "pairs": [[0, 1]],
        "margin": 0.1,
        "planes": FLOOR,
    } | changed

    def found() -> Contacts:
        solids = pack([BOX])
        placed = place(solids, given["x"], given["quaternion"], given["shape"], given["radius"])  # type: ignore[arg-type]
        return find_contacts(solids, placed, given["pairs"], given["margin"], given["planes"])  # type: ignore[arg-type]

    with pytest.raises(InvalidSceneError) as refused:
        found()
    assert message in str(refused.value)
