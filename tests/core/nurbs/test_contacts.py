"""Contacts of outlines by their intersections: circles, walls, dented outlines, polygons."""

from __future__ import annotations

import numba
import numpy as np
import pytest
from nurbs.polygon_oracle import area, clipped, common, exact
from nurbs_shapes_of_tests import peanut, periodic, placed, ring

from ninedisk.core import ContactLaw, Disks, InvalidSceneError, Numerics, Scene, Wall, simulate
from ninedisk.core.nurbs.curve import NurbsCurve
from ninedisk.core.nurbs.intersect import NurbsGrains
from ninedisk.core.nurbs.intersect_kernels import contacts_of_pairs
from ninedisk.core.nurbs.mass import centred, uniform_grain
from ninedisk.core.nurbs.shapes import QUARTERS, SQUARE, disk, ellipse, polygon, regular_polygon
from ninedisk.core.nurbs.state import CROSSED, UNDECIDED, ContactRows, contact_rows, workspace
from ninedisk.core.nurbs.table import joined_tables
from ninedisk.core.validate import IntArray

N = 1_000 if numba.config.DISABLE_JIT else 30_000
PRECISION = 1e-14
KINDS = ("uniform", "grazing", "inside", "usual")


class Pairs:
    """Random pairs of disks that intersect, and their exact contacts.

    A quarter has distances uniform in ``|R1 - R2| .. R1 + R2``, a quarter is within 1e-12 .. 1e-1 R of touching from outside, a
    quarter within that of touching from inside, a quarter has overlaps of 1e-3 .. 1e-1 of the distance.
    """

    def __init__(self, n: int, curves: list[NurbsCurve], radii: np.ndarray, far: float = 0.0, seed: int = 1) -> None:
        rng = np.random.default_rng(seed)
        shape = rng.integers(0, len(radii), 2 * n)
        # Circles of equal radius coincide where they touch from inside: two different ones there.
        same = np.flatnonzero((shape[0::2] == shape[1::2]) & (np.arange(n) % 4 == 2))
        shape[2 * same + 1] = (shape[2 * same + 1] + 1) % len(radii)
        r1, r2 = radii[shape[0::2]], radii[shape[1::2]]
        low, high, least = np.abs(r1 - r2), r1 + r2, np.minimum(r1, r2)
        self.kind = np.arange(n) % 4
        graze = 10.0 ** rng.uniform(-12.0, -1.0, n)
        graze = np.minimum(graze * least, 0.5 * (high - low))
        d = np.choose(
            self.kind,
            [
                np.maximum(low + (high - low) * rng.uniform(0.0, 1.0, n), 1e-3 * least),
                high - graze,
                low + graze,
                high * (1.0 - 10.0 ** rng.uniform(-3.0, -1.0, n)),
            ],
        )
        angle = rng.uniform(-np.pi, np.pi, n)
        x = np.zeros((2 * n, 2))
        x[0::2] = far * rng.uniform(-1.0, 1.0, (n, 2))
        x[1::2] = x[0::2] + d[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
        # The distance that the rounded positions really have.
        between = x[1::2] - x[0::2]
        self.d = np.hypot(*between.T)
        self.normal = between / self.d[:, None]
        self.overlap = high - self.d
        self.radius, self.largest = least, np.maximum(r1, r2)
        self.middle = x[0::2] + self.normal * ((self.d**2 + r1**2 - r2**2) / (2.0 * self.d))[:, None]
        self.r1 = r1
        self.clear = np.minimum(self.d - low, self.overlap) > 1e-12 * least
        self.x, self.turn = x, rng.uniform(-np.pi, np.pi, 2 * n)
        self.pairs = np.arange(2 * n).reshape(-1, 2)
        self.grains = NurbsGrains(curves, shape)

    def contacts(self) -> tuple[np.ndarray, ContactRows]:
        return self.grains.pair_contacts(self.x, self.turn, self.pairs)


RADII = np.exp(np.random.default_rng(0).uniform(np.log(0.5), np.log(2.0), 24))


@pytest.fixture(scope="module")
def pairs() -> Pairs:
    return Pairs(N, [disk(r) for r in RADII], RADII)


@pytest.fixture(scope="module")
def found(pairs: Pairs) -> tuple[np.ndarray, ContactRows]:
    # Within 1e-12 R of touching from inside, "no contact" is an answer: the public function would refuse it as enclosed.
    clear = pairs.pairs[pairs.clear]
    index, rows = pairs.grains.pair_contacts(pairs.x, pairs.turn, clear)
    return np.flatnonzero(pairs.clear)[index], rows


def test_every_pair_has_one_contact(pairs: Pairs, found: tuple[np.ndarray, ContactRows]) -> None:
    index, _ = found
    assert np.array_equal(index, np.flatnonzero(pairs.clear))
    assert len(index) > 0.99 * N


@pytest.mark.parametrize("kind", range(4), ids=KINDS)
def test_overlap_is_equation_2_5(pairs: Pairs, found: tuple[np.ndarray, ContactRows], kind: int) -> None:
    index, rows = found
    mine = pairs.kind[index] == kind
    k = index[mine]
    assert np.all(np.abs(rows.overlap[mine] - pairs.overlap[k]) <= PRECISION * pairs.radius[k])


@pytest.mark.parametrize("kind", range(4), ids=KINDS)
def test_normal_is_that_of_the_centres(pairs: Pairs, found: tuple[np.ndarray, ContactRows], kind: int) -> None:
    index, rows = found
    mine = pairs.kind[index] == kind
    k = index[mine]
    off = np.hypot(*(rows.normal[mine] - pairs.normal[k]).T)
    assert np.all(off * pairs.d[k] <= PRECISION * pairs.radius[k])
    apart = pairs.d[k] >= 0.1 * pairs.largest[k]
    assert np.all(off[apart] <= PRECISION)
    if kind in (1, 3):
        assert np.all(apart)


@pytest.mark.parametrize("kind", range(4), ids=KINDS)
def test_point_is_the_middle_of_the_chord(pairs: Pairs, found: tuple[np.ndarray, ContactRows], kind: int) -> None:
    """At ``(d^2 + R1^2 - R2^2)/(2 d)`` from the first centre, which is not the middle of the overlap for unequal radii."""
    index, rows = found
    mine = pairs.kind[index] == kind
    k = index[mine]
    off = np.hypot(*(rows.point[mine] - pairs.middle[k]).T)
    scale = pairs.radius[k] * np.maximum(1.0, pairs.largest[k] / pairs.d[k])
    assert np.all(off <= PRECISION * scale)
    if kind == 3:
        of_overlap = (pairs.r1 - 0.5 * pairs.overlap)[k]
        along = np.sum((rows.point[mine] - pairs.x[0::2][k]) * pairs.normal[k], axis=1)
        assert np.mean(np.abs(along - of_overlap) > 1e-3 * pairs.radius[k]) > 0.3


def test_length_of_the_chord(pairs: Pairs, found: tuple[np.ndarray, ContactRows]) -> None:
    """``c^2/4 = R1^2 - h^2`` with h the centre's distance from the chord: c is known to round-off over c, not better."""
    index, rows = found
    h = np.sum((pairs.middle - pairs.x[0::2]) * pairs.normal, axis=1)[index]
    expected = (pairs.r1[index] - h) * (pairs.r1[index] + h)
    off = np.abs(0.25 * rows.chord**2 - expected)
    assert np.all(off <= 20.0 * PRECISION * pairs.largest[index] ** 2 * np.maximum(1.0, pairs.largest / pairs.d)[index])


def test_order_of_the_pair_does_not_matter(pairs: Pairs) -> None:
    usual = pairs.pairs[pairs.kind == 3]
    _, rows = pairs.grains.pair_contacts(pairs.x, pairs.turn, usual)
    _, other = pairs.grains.pair_contacts(pairs.x, pairs.turn, usual[:, ::-1])
    assert np.abs(rows.normal + other.normal).max() <= PRECISION
    assert np.abs(rows.point - other.point).max() <= PRECISION
    assert np.abs(rows.overlap - other.overlap).max() <= PRECISION


def test_usual_weights_and_places_far_away_serve_as_well() -> None:
    """With weights 1, sqrt(1/2) the curve is a circle to round-off only; the overlap is that of the rounded positions."""
    weights = np.where(np.arange(9) % 2 == 0, 1.0, np.sqrt(0.5))
    curves = [NurbsCurve(degree=2, knots=QUARTERS, points=r * SQUARE, weights=weights) for r in RADII[:6]]
    pairs = Pairs(4_000, curves, RADII[:6], far=1e3, seed=2)
    chosen = pairs.clear & (pairs.kind % 2 == 1)
    _, rows = pairs.grains.pair_contacts(pairs.x, pairs.turn, pairs.pairs[chosen])
    assert np.all(np.abs(rows.overlap - pairs.overlap[chosen]) <= PRECISION * pairs.radius[chosen])
    assert np.hypot(*(rows.normal - pairs.normal[chosen]).T).max() <= PRECISION


def test_a_disk_off_by_1e13_of_its_radius_is_seen() -> None:
    """The comparison has teeth: it distinguishes radii that differ by ten times its tolerance."""
    wrong = [disk(r * (1.0 + 1e-13)) for r in RADII[:6]]
    pairs = Pairs(2_000, wrong, RADII[:6], seed=3)
    chosen = pairs.kind == 3
    _, rows = pairs.grains.pair_contacts(pairs.x, pairs.turn, pairs.pairs[chosen])
    assert np.abs(rows.overlap - pairs.overlap[chosen]).min() > 5.0 * PRECISION * RADII[:6].min()


def test_differences_of_intersections_lose_half_of_the_digits(
    pairs: Pairs, found: tuple[np.ndarray, ContactRows]
) -> None:
    """Why the chord is not the difference of two points: the same places, differenced, miss the normal by 1e-11 and more."""
    index, rows = found
    k = np.flatnonzero((pairs.kind[index] == 1) & (pairs.overlap[index] < 1e-10 * pairs.radius[index]))[:40]
    worst = 0.0
    for row in k:
        i = pairs.pairs[index[row], 0]
        curve = disk(float(RADII[pairs.grains.shape[i]]))
        ends = placed(curve, rows.place[row, [0, 2]] % 4.0, pairs.x[i], pairs.turn[i])
        along = (ends[1] - ends[0]) / np.hypot(*(ends[1] - ends[0]))
        worst = max(worst, float(np.hypot(*(np.array([along[1], -along[0]]) - pairs.normal[index[row]]))))
    assert worst > 1e-11


@pytest.mark.parametrize("gap", [1e-11, 1e-6, 0.1])
def test_disks_apart_have_no_contact(gap: float) -> None:
    grains = NurbsGrains([disk(1.0), disk(0.5)], [0, 1])
    angle = np.linspace(0.0, 6.0, 200)
    for a in angle:
        x = [(0.0, 0.0), (1.5 + gap) * np.array([np.cos(a), np.sin(a)])]
        assert len(grains.pair_contacts(x, [0.3, a], [(0, 1)])[0]) == 0


def test_what_is_no_contact_is_refused_by_name() -> None:
    grains = NurbsGrains([disk(1.0), disk(0.4)], [0, 1, 0])
    with pytest.raises(InvalidSceneError, match="grain 0, near grain 1, lies wholly inside"):
        grains.pair_contacts([(0, 0), (0.3, 0.1), (9, 9)], [0, 0, 0], [(0, 1)])
    with pytest.raises(InvalidSceneError, match="grain 1, near grain 0, lies wholly inside"):
        grains.pair_contacts([(0, 0), (0.3, 0.1), (9, 9)], [0, 0, 0], [(1, 0)])
    with pytest.raises(InvalidSceneError, match="coincides"):
        grains.pair_contacts([(0, 0), (5, 5), (0, 0)], [0, 0, 0.1], [(0, 2)])
    with pytest.raises(InvalidSceneError, match="shape must be"):
        NurbsGrains([disk(1.0)], [0, 1])


def test_disks_on_a_wall() -> None:
    """Overlap R - h, normal into the wall, point on the wall below the centre; grazing ones included."""
    rng = np.random.default_rng(1)
    n = 20_000
    radius = np.exp(rng.uniform(np.log(0.5), np.log(2.0), 16))
    shape = rng.integers(0, 16, n)
    r = radius[shape]
    depth = r * np.where(np.arange(n) % 2, 10.0 ** rng.uniform(-12.0, -1.0, n), rng.uniform(1e-3, 1.9, n))
    way = 0.7
    normal, along = np.array([np.cos(way), np.sin(way)]), np.array([-np.sin(way), np.cos(way)])
    x = (r - depth)[:, None] * normal + rng.uniform(-1.0, 1.0, n)[:, None] * along
    grains = NurbsGrains([disk(float(value)) for value in radius], shape)
    index, rows = grains.wall_contacts(x, rng.uniform(-np.pi, np.pi, n), (0.0, 0.0), normal)
    assert np.array_equal(index, np.arange(n))
    height = x @ normal
    assert np.abs((rows.overlap - (r - height)) / r).max() <= PRECISION
    assert np.abs(rows.normal + normal).max() <= 2.0**-52
    assert np.hypot(*((rows.point - (x - height[:, None] * normal)) / r[:, None]).T).max() <= PRECISION
    assert np.all(np.abs(0.25 * rows.chord**2 - (r - height) * (r + height)) <= 20.0 * PRECISION * r**2)


def test_ellipses_on_a_wall() -> None:
    """Overlap from the support function; the chord's middle lies on the diameter that is conjugate to the wall's direction."""
    a, b = 2.0, 0.7
    rng = np.random.default_rng(2)
    n = 2_000
    turn = rng.uniform(-np.pi, np.pi, n)
    support = np.hypot(a * np.sin(turn), b * np.cos(turn))
    height = support * (1.0 - 10.0 ** rng.uniform(-12.0, -0.1, n))
    x = np.column_stack([rng.uniform(-1.0, 1.0, n), height])
    index, rows = NurbsGrains([ellipse(a, b)], np.zeros(n, dtype=int)).wall_contacts(x, turn, (5.0, 0.0), (0.0, 1.0))
    assert np.array_equal(index, np.arange(n))
    assert np.abs(rows.overlap - (support - height)).max() <= PRECISION * a
    # The extreme point below is R(turn) (a^2 mx, b^2 my)/support for m the downward direction in the ellipse's frame.
    mx, my = -np.sin(turn), -np.cos(turn)
    px, py = a * a * mx / support, b * b * my / support
    lowest_x = np.cos(turn) * px - np.sin(turn) * py
    middle = x[:, 0] + lowest_x * height / support
    assert np.abs(rows.point[:, 0] - middle).max() <= PRECISION * a * a / b
    assert np.abs(rows.point[:, 1]).max() <= PRECISION


def test_a_waisted_grain_stands_on_two_feet() -> None:
    """Two contacts, the mirror images of each other; tilted, the lower foot is deeper by the tilt times their distance."""
    grains = NurbsGrains([peanut()], [0])
    points = peanut().evaluate(np.linspace(0.0, 20.0, 100_001))
    lowest = float(points[:, 1].min())
    index, rows = grains.wall_contacts([(0.0, -lowest - 0.01)], [0.0], (0.0, 0.0), (0.0, 1.0))
    assert index.tolist() == [0, 0]
    assert rows.overlap == pytest.approx([0.01, 0.01], abs=1e-8)  # the sampled minimum is above the true one by 1e-9
    assert rows.point[0, 0] == pytest.approx(
        -rows.point[1, 0], abs=1e-5
    )  # the fit is symmetric to its parameters' rounds
    assert abs(rows.point[0, 0]) > 0.4
    assert np.abs(rows.point[:, 1]).max() <= PRECISION
    tilt = 1e-3
    _, tilted = grains.wall_contacts([(0.0, -lowest - 0.01)], [tilt], (0.0, 0.0), (0.0, 1.0))
    feet = np.sort(rows.point[:, 0])
    gain = tilted.overlap[np.argsort(tilted.point[:, 0])] - 0.01
    assert gain == pytest.approx(-tilt * feet, rel=0.02)


def test_far_and_near_the_wall() -> None:
    grains = NurbsGrains([disk(1.0), peanut()], [0, 1])
    assert len(grains.wall_contacts([(0, 1.0 + 1e-11), (5, 3)], [0.1, 0.2], (0, 0), (0, 1))[0]) == 0
    with pytest.raises(InvalidSceneError, match="grain 0, at the wall, lies wholly inside"):
        grains.wall_contacts([(0, -1.0 - 1e-11), (5, 3)], [0.1, 0.2], (0, 0), (0, 1))


def test_one_wall_normal_serves_whatever_its_length() -> None:
    grains = NurbsGrains([disk(1.0)], [0])
    _, rows = grains.wall_contacts([(0.0, 0.9)], [0.0], (0.0, 0.0), (0.0, 5.0))
    assert rows.overlap[0] == pytest.approx(0.1, abs=PRECISION)


def test_two_waisted_grains_side_by_side_touch_twice() -> None:
    grains = NurbsGrains([peanut()], [0, 0])
    points = peanut().evaluate(np.linspace(0.0, 20.0, 100_001))
    height = float(points[:, 1].max() - points[:, 1].min())
    index, rows = grains.pair_contacts([(0.0, 0.0), (0.0, height - 0.02)], [0.0, 0.0], [(0, 1)])
    assert index.tolist() == [0, 0]
    assert rows.overlap == pytest.approx([0.02, 0.02], abs=1e-4)
    assert np.abs(rows.normal[:, 1] - 1.0).max() < 1e-3
    feet = np.sort(rows.point[:, 0])
    assert feet[0] < -0.4
    assert feet[1] > 0.4
    assert rows.point[:, 1] == pytest.approx(0.5 * (height - 0.02), abs=1e-3)


def crossings_of_polygons(p: np.ndarray, q: np.ndarray) -> int:
    """Number of proper crossings of two closed polygons."""
    d, e = np.roll(p, -1, axis=0) - p, np.roll(q, -1, axis=0) - q
    start = q[None] - p[:, None]
    cross = d[:, None, 0] * e[None, :, 1] - d[:, None, 1] * e[None, :, 0]
    s = (start[..., 0] * e[None, :, 1] - start[..., 1] * e[None, :, 0]) / cross
    t = (start[..., 0] * d[:, None, 1] - start[..., 1] * d[:, None, 0]) / cross
    return int(np.count_nonzero((s >= 0) & (s < 1) & (t >= 0) & (t < 1)))


def grains_of_tests() -> list[NurbsCurve]:
    weights = np.random.default_rng(8).uniform(0.5, 2.0, 20)
    made = [periodic(ring(20, seed, spread=0.25), 3) for seed in (11, 12)]
    made += [periodic(ring(20, 13, spread=0.25), 2, weights), periodic(ring(9, 14, spread=0.3), 1), peanut()]
    return [centred(curve) for curve in made]


def test_contacts_of_random_grains_are_those_of_fine_polygons() -> None:
    """Each contact has two intersections: their number, from polygons of 800 sides, is twice the contacts' unless the grains are crossed.

    Polygons miss intersections closer than a chord's sagitta; 1 % of the pairs may differ for that.
    """
    rng = np.random.default_rng(21)
    curves = grains_of_tests()
    n = 150
    shape = rng.integers(0, len(curves), 2 * n)
    grains = NurbsGrains(curves, shape)
    turn = rng.uniform(-np.pi, np.pi, 2 * n)
    way, distance = rng.uniform(-np.pi, np.pi, n), rng.uniform(1.5, 2.3, n)
    x = np.zeros((2 * n, 2))
    x[1::2] = distance[:, None] * np.column_stack([np.cos(way), np.sin(way)])
    pairs = np.arange(2 * n).reshape(-1, 2)
    count, out = np.zeros(n, dtype=np.int64), contact_rows(4 * n)
    turned = np.column_stack([np.cos(turn), np.sin(turn)])
    total = contacts_of_pairs(grains.table, grains.shape, x, turned, pairs, workspace(grains.table), count, out)
    polygons = [curve.evaluate(np.linspace(*curve.breaks[[0, -1]], 801)[:-1]) for curve in curves]
    differ, several = 0, 0
    for k in range(n):
        p, q = (polygons[shape[i]] @ np.array([turned[i], [-turned[i, 1], turned[i, 0]]]) + x[i] for i in pairs[k])
        found = crossings_of_polygons(p, q)
        several += count[k] > 1
        differ += found != 2 * count[k] if count[k] >= 0 else found < 4
    assert differ <= 0.01 * n
    assert several >= 3
    assert total == count[count > 0].sum()
    assert np.all(out.overlap[:total] > 0.0)
    assert np.abs(np.hypot(*out.normal[:total].T) - 1.0).max() <= 2.0**-51


def test_intersections_lie_on_both_outlines_and_the_normal_points_to_the_second() -> None:
    curves = grains_of_tests()[:2]
    grains = NurbsGrains(curves, [0, 1])
    rng = np.random.default_rng(4)
    seen = 0
    for _ in range(100):
        turn, way = rng.uniform(-np.pi, np.pi, 2), float(rng.uniform(-np.pi, np.pi))
        x = np.array([[0.0, 0.0], [1.85 * np.cos(way), 1.85 * np.sin(way)]])
        _, rows = grains.pair_contacts(x, turn, [(0, 1)])
        for row in range(len(rows.overlap)):
            ends = np.array([placed(curves[k], rows.place[row, [k, k + 2]] % 20.0, x[k], turn[k]) for k in (0, 1)])
            assert np.abs(ends[0] - ends[1]).max() <= 1e-12
            along = ends[0, 1] - ends[0, 0]
            assert abs(along @ rows.normal[row]) <= 1e-12
            assert rows.chord[row] == pytest.approx(np.hypot(*along), abs=1e-12)
            assert rows.point[row] == pytest.approx(ends[0].mean(axis=0), abs=1e-12)
            if rows.overlap[row] < 0.1:
                assert rows.normal[row] @ x[1] > 0.0
            seen += 1
    assert seen > 50


def test_corner_of_a_square_in_a_disk() -> None:
    """A corner 0.1 deep: the chord is that of the corner's two sides with the circle; the overlap ends in the corner itself."""
    square = NurbsCurve(degree=1, knots=[0, 0, 1, 2, 3, 4, 4], points=[(0, -1), (1, 0), (0, 1), (-1, 0), (0, -1)])
    grains = NurbsGrains([square, disk(1.0)], [0, 1])
    for turn in (0.0, 1.0, -2.5):
        c, s = np.cos(turn), np.sin(turn)
        x = np.array([(0.0, 0.0), (1.9 * c, 1.9 * s)])
        _, rows = grains.pair_contacts(x, [turn, 0.3], [(0, 1)])
        assert rows.overlap == pytest.approx([0.1], abs=1e-14)
        assert rows.normal[0] == pytest.approx([c, s], abs=1e-14)
        # On the side y = 1 - x and the circle about (1.9, 0): 2 x^2 - 5.8 x + 3.61 = 0.
        foot = (5.8 - np.sqrt(5.8**2 - 8.0 * 3.61)) / 4.0
        assert rows.point[0] == pytest.approx([foot * c, foot * s], abs=1e-14)
        assert rows.chord[0] == pytest.approx(2.0 * (1.0 - foot), abs=1e-14)


def test_rows_are_made_as_needed() -> None:
    """Every pair of a wall of waisted grains has two contacts: more than the first guess has room for."""
    n = 40
    grains = NurbsGrains([peanut()], np.zeros(2 * n, dtype=int))
    x = np.zeros((2 * n, 2))
    x[1::2, 1] = 1.4
    index, rows = grains.pair_contacts(x, np.zeros(2 * n), np.tile(np.arange(2 * n).reshape(-1, 2), (3, 1)))
    assert np.array_equal(index, np.repeat(np.arange(3 * n), 2))
    assert np.ptp(rows.overlap) <= 1e-14


def test_order_of_two_dented_grains_does_not_matter() -> None:
    """Deep and shallow pairs of unlike grains: the same contacts, turned round, to round-off (as for disks, see there).

    The room for normals and points is ten times that of disks: chords of corners and waists are conditioned by their angle.
    """
    rng = np.random.default_rng(7)
    curves = [*grains_of_tests(), ellipse(1.0, 0.1), disk(0.7)]
    n = 200 if numba.config.DISABLE_JIT else 5_000
    grains = NurbsGrains(curves, rng.integers(0, len(curves), 2 * n))
    way, distance = rng.uniform(-np.pi, np.pi, n), rng.uniform(0.3, 2.4, n)
    x = np.zeros((2 * n, 2))
    x[1::2] = distance[:, None] * np.column_stack([np.cos(way), np.sin(way)])
    turn = rng.uniform(-np.pi, np.pi, 2 * n)
    turned = np.column_stack([np.cos(turn), np.sin(turn)])
    found = []
    for pairs in (np.arange(2 * n).reshape(-1, 2), np.arange(2 * n).reshape(-1, 2)[:, ::-1].copy()):
        count, out = np.zeros(n, dtype=np.int64), contact_rows(4 * n)
        total = contacts_of_pairs(grains.table, grains.shape, x, turned, pairs, workspace(grains.table), count, out)
        found.append((count, *(column[:total] for column in out)))
    (count, point, normal, overlap, *_), (other, its_point, its_normal, its_overlap, *_) = found
    assert np.array_equal(count, other)
    assert not np.any(count == UNDECIDED)
    single = np.repeat(count, np.maximum(count, 0)) == 1
    assert np.count_nonzero(single) > 0.5 * n
    assert np.abs(overlap - its_overlap)[single].max() <= 1e-14
    assert np.abs(normal + its_normal)[single].max() <= 1e-13
    assert np.abs(point - its_point)[single].max() <= 1e-13


PLATE = polygon([(-1.5, -0.25), (1.5, -0.25), (1.5, 0.25), (-1.5, 0.25)])
POLYGONS = [regular_polygon(3, 0.6), regular_polygon(4, 0.8), regular_polygon(6, 1.0), PLATE]


def contacts(
    curves: list[NurbsCurve], shape: IntArray, x: np.ndarray, angle: np.ndarray
) -> tuple[IntArray, ContactRows]:
    """Counts and contacts of bodies 2 k and 2 k + 1, codes and all."""
    table = joined_tables([curve.table for curve in curves])
    pairs = np.arange(len(shape)).reshape(-1, 2)
    count, out = np.zeros(len(pairs), dtype=np.int64), contact_rows(4 * len(pairs))
    turn = np.column_stack([np.cos(angle), np.sin(angle)])
    contacts_of_pairs(table, shape, x, turn, pairs, workspace(table), count, out)
    return count, out


def turned_and_shifted(curve: NurbsCurve, x: np.ndarray, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(curve.points[:-1] @ np.array([[c, s], [-s, c]]) + x)


def random_pairs(n: int, seed: int) -> tuple[IntArray, np.ndarray, np.ndarray]:
    """Half of them anywhere in reach, half nearly aligned plates and squares, face on face, which cut each other's corners off."""
    rng = np.random.default_rng(seed)
    shape, angle = rng.integers(0, 4, 2 * n), rng.uniform(-np.pi, np.pi, 2 * n)
    x = np.zeros((2 * n, 2))
    way, reach = rng.uniform(-np.pi, np.pi, n), rng.uniform(0.5, 2.2, n)
    x[1::2] = reach[:, None] * np.column_stack([np.cos(way), np.sin(way)])
    for k in range(n // 2):
        both = rng.integers(0, 2)
        size = 10.0 ** rng.uniform(-6, -1)
        shape[2 * k : 2 * k + 2] = 1 if both else 3
        angle[2 * k + 1] = angle[2 * k] + size * rng.normal()
        off = np.array([size * rng.normal(), (1.6 if both else 0.5) - size * abs(rng.normal())])
        c, s = np.cos(angle[2 * k]), np.sin(angle[2 * k])
        x[2 * k + 1] = [c * off[0] - s * off[1], s * off[0] + c * off[1]]
    return shape, x, angle


def test_contacts_are_the_gradient_of_the_exact_area() -> None:
    """Chord times normal is the gradient of the common area, the overlap its extent, with two corners or more; and none is missed.

    An error of a corner is that of rounding, 1e-15, over the sine of the angle at which the sides meet, 1e-6 at least.
    """
    n = 1000
    shape, x, angle = random_pairs(n, 5)
    count, out = contacts(POLYGONS, shape, x, angle)
    assert not np.any(count == UNDECIDED)
    row, seen = 0, {0: 0, 2: 0, 4: 0, 6: 0, CROSSED: 0}
    for k in range(n):
        one, other = (exact(turned_and_shifted(POLYGONS[shape[b]], x[b], angle[b])) for b in (2 * k, 2 * k + 1))
        if count[k] == 0:
            assert area(clipped(one, other)) < 1e-13
            seen[0] += 1
            continue
        truth = common(one, other)
        if count[k] == CROSSED:
            # Only where there are more than two corners, and chords that cancel: far less than the sides that take part.
            assert truth.crossings > 2
            assert np.hypot(*truth.gradient) < 2.0
            seen[CROSSED] += 1
        elif count[k] > 0:
            assert count[k] == 1
            gradient = out.chord[row] * out.normal[row]
            room = 1e-9 if truth.area < 1e-3 else 1e-12
            assert gradient == pytest.approx(-truth.gradient, abs=room), (k, truth)
            assert out.overlap[row] == pytest.approx(truth.extent, abs=1e-11)
            assert out.corners[row] == truth.crossings
            seen[truth.crossings] += 1
            row += 1
    assert min(seen[0], seen[2], seen[4], seen[CROSSED]) > 10, seen


def test_faces_that_coincide() -> None:
    """Rectangles on a grid, whose boundaries coincide all the time: no contact to speak of without common area, a decided one with it."""
    n = 2000
    rng = np.random.default_rng(8)
    sizes = [(1, 1), (2, 1), (1, 3), (4, 4)]
    boxes = [polygon([(-a / 8, -b / 8), (a / 8, -b / 8), (a / 8, b / 8), (-a / 8, b / 8)]) for a, b in sizes]
    shape = rng.integers(0, len(boxes), 2 * n)
    x = rng.integers(-4, 5, (2 * n, 2)) / 8.0
    angle = np.repeat(rng.choice([0.0, 0.4], n), 2)
    c, s = np.cos(angle), np.sin(angle)
    # On the grid exactly where it is not turned, to rounding where it is.
    turned = np.column_stack([c * x[:, 0] - s * x[:, 1], s * x[:, 0] + c * x[:, 1]])
    count, out = contacts(boxes, shape, turned, angle)
    row, touching = 0, 0
    for k in range(n):
        one, other = (exact(turned_and_shifted(boxes[shape[b]], x[b], 0.0)) for b in (2 * k, 2 * k + 1))
        shared = clipped(one, other)
        if not area(shared):
            # Seen from the side, a face that touches may be shifted into the other: by 1e-11 of the size.
            assert count[k] in (0, 1)
            assert not count[k] or out.overlap[row] < 1e-11
            row += count[k]
            touching += len(shared) > 1
            continue
        assert count[k] != 0
        if count[k] > 0:
            extent = [float(max(p[d] for p in shared) - min(p[d] for p in shared)) for d in (0, 1)]
            assert min(extent) * (1.0 - 1e-9) <= out.overlap[row] <= np.hypot(*extent) * (1.0 + 1e-9)
            row += count[k]
        else:
            assert count[k] != UNDECIDED or (shape[2 * k] == shape[2 * k + 1] and np.all(x[2 * k] == x[2 * k + 1]))
    assert touching > 100


def pile(numbers: list[int], x: np.ndarray, angle: np.ndarray, width: float, contact: str = "chord") -> Scene:
    """Polygons in a box of ``width`` [m], under gravity."""
    kinds = [uniform_grain(curve, 1.0) for curve in POLYGONS]
    law = ContactLaw(kn=2e4, ks=1e4, mu=0.4, beta=0.5, lever_arm="overlap", contact=contact)  # type: ignore[arg-type]
    each = {name: [getattr(kinds[k], name) for k in numbers] for name in ("radius", "mass", "inertia")}
    walls = [
        ("floor", (0.0, 0.0), (0.0, 1.0)),
        ("left", (-width / 2, 0.0), (1.0, 0.0)),
        ("right", (width / 2, 0.0), (-1.0, 0.0)),
    ]
    return Scene(
        disks=Disks(x=x, angle=angle, outline=numbers, **each),
        outlines=tuple(kind.outline for kind in kinds),
        disk_disk=law,
        walls=tuple(Wall(name=name, point=point, normal=normal, law=law) for name, point, normal in walls),
        gravity=(0.0, -9.81),
        xi=1.0,
    )


def test_a_pile_of_polygons_comes_down() -> None:
    """Triangles, squares, hexagons and plates fall into a box: no configuration on the way stops the run, and the floor bears them."""
    rng = np.random.default_rng(3)
    numbers = rng.integers(0, 4, 12).tolist()
    x = np.column_stack([np.tile([-2.4, 0.0, 2.4], 4), np.repeat(1.9 + 3.2 * np.arange(4), 3)])
    scene = pile(numbers, x + rng.uniform(-0.1, 0.1, x.shape), rng.uniform(-3.0, 3.0, 12), 8.0)
    history = simulate(scene, Numerics(dt=0.01, n_steps=800, contact_dt=2.5e-4, sample_every=5))
    late = history.wall_force[-60:, 0, 1].mean()
    # The walls' friction bears some of it.
    assert -late == pytest.approx(9.81 * scene.disks.mass.sum(), rel=0.1)
    assert history.energy["kinetic"][-1] < 0.01 * history.energy["kinetic"].max()


def test_squares_that_are_stacked_to_the_last_bit() -> None:
    """Columns between walls, sides on one line, faces on one line with the floor and with each other: forces are the weights above."""
    x = np.array([(-1.6 + 1.6 * column, 0.8 + 1.6 * row) for row in range(3) for column in range(3)])
    scene = pile([1] * 9, x, np.zeros(9), 4.8)
    watch = [(0, 9), (0, 3), (3, 6)]
    history = simulate(scene, Numerics(dt=0.01, n_steps=600, contact_dt=2.5e-4, sample_every=100), watch=watch)
    weight = 9.81 * scene.disks.mass[0]
    assert history.fn[-1] == pytest.approx(weight * np.array([3.0, 2.0, 1.0]), rel=1e-3)
    assert -history.wall_force[-1, 0, 1] == pytest.approx(9.0 * weight, rel=1e-4)


def test_what_has_no_chord_names_the_bodies() -> None:
    plus = pile([1, 3], np.array([(0.0, 2.0), (0.1, 2.0)]), np.array([0.3, 0.3]), 8.0)
    with pytest.raises(InvalidSceneError, match=r"grain 0, near grain 1, crosses the other body.*no chord"):
        simulate(plus, Numerics(dt=0.01, n_steps=1, contact_dt=2.5e-4))
