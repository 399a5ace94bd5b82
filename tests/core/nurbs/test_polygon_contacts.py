"""Contacts of sharp polygons against rational arithmetic; faces and sides that coincide; piles of polygons."""

from __future__ import annotations

import numpy as np
import pytest
from nurbs.polygon_oracle import area, clipped, common, exact

from ninedisk.core import ContactLaw, Disks, InvalidSceneError, Numerics, Scene, Wall, simulate
from ninedisk.core.nurbs.curve import NurbsCurve, powers
from ninedisk.core.nurbs.intersect_kernels import contacts_of_pairs
from ninedisk.core.nurbs.mass import uniform_grain
from ninedisk.core.nurbs.shapes import polygon, regular_polygon
from ninedisk.core.nurbs.state import CROSSED, UNDECIDED, ContactRows, contact_rows, workspace
from ninedisk.core.nurbs.table import shape_table
from ninedisk.core.validate import IntArray

PLATE = polygon([(-1.5, -0.25), (1.5, -0.25), (1.5, 0.25), (-1.5, 0.25)])
POLYGONS = [regular_polygon(3, 0.6), regular_polygon(4, 0.8), regular_polygon(6, 1.0), PLATE]


def contacts(
    curves: list[NurbsCurve], shape: IntArray, x: np.ndarray, angle: np.ndarray
) -> tuple[IntArray, ContactRows]:
    """Counts and contacts of bodies 2 k and 2 k + 1, codes and all."""
    table = shape_table([powers(curve.spans) for curve in curves])
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
    n = 2000
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
    assert min(seen[0], seen[2], seen[4], seen[CROSSED]) > 20, seen


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
