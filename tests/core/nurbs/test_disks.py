"""NURBS disks against equation 2.5 of the source, delta = R1 + R2 - d, on 100,000 pairs.

What double precision allows. The overlap is stationary in the places of the extreme points: it is as good as the coordinates, a few
units of round-off of the radii, everywhere. The normal is at right angles to the chord; moving one circle by round-off u R turns it by
u R/d, whatever is computed and however short the chord is. So ``d n``, the vector between the centres, is known to round-off of the
radius always, and n itself to 1e-14 unless the centres are closer than a tenth of a radius. The middle of the chord moves by
``(R1^2 - R2^2)/(2 d)`` along it, and has the same factor.
"""

from __future__ import annotations

import numba
import numpy as np
import pytest
from nurbs_shapes_of_tests import placed

from ninedisk.core import InvalidSceneError
from ninedisk.core.nurbs.curve import NurbsCurve
from ninedisk.core.nurbs.intersect import NurbsGrains
from ninedisk.core.nurbs.shapes import QUARTERS, SQUARE, disk
from ninedisk.core.nurbs.state import ContactRows

N = 1_000 if numba.config.DISABLE_JIT else 100_000
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
    """The comparison has teeth: it tells radii apart that differ by ten times its tolerance."""
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
    k = np.flatnonzero((pairs.kind[index] == 1) & (pairs.overlap[index] < 1e-10 * pairs.radius[index]))[:200]
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
