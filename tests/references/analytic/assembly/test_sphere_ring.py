"""A heap's forces against the equilibrium of every sphere in space, force by force and moment by moment."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ninedisk.references.analytic.assembly.sphere_ring import ring_angle, ring_forces, top_displacement


def wrenches(n, angle):  # type: ignore[no-untyped-def]
    """Matrix from contact forces (three each; the legs at the top, then the floor's) to force and moment on ring spheres and top."""
    matrix = np.zeros((6 * (n + 1), 6 * n))

    def acts(body, column, arm):  # type: ignore[no-untyped-def]
        for c, axis in enumerate(np.eye(3)):
            matrix[6 * body : 6 * body + 3, column + c] += axis
            matrix[6 * body + 3 : 6 * body + 6, column + c] += np.cross(arm, axis)

    def reacts(body, column, arm):  # type: ignore[no-untyped-def]
        for c, axis in enumerate(np.eye(3)):
            matrix[6 * body : 6 * body + 3, column + c] -= axis
            matrix[6 * body + 3 : 6 * body + 6, column + c] -= np.cross(arm, axis)

    ways = []
    for k in range(n):
        turn = 2.0 * math.pi * k / n + 0.3
        out = np.array([math.cos(turn), math.sin(turn), 0.0])
        up = math.cos(angle) * np.array([0.0, 0.0, 1.0]) - math.sin(angle) * out
        acts(n, 3 * k, -up)
        reacts(k, 3 * k, up)
        acts(k, 3 * (n + k), np.array([0.0, 0.0, -1.0]))
        ways.append((out, up))
    return matrix, ways


@pytest.mark.parametrize(("n", "spread"), [(3, 1.0), (3, 1.15), (4, 1.1)])
def test_every_sphere_is_in_equilibrium(n: int, spread: float) -> None:
    top, each = 3.0, 2.0
    angle = ring_angle(n=n, spread=spread)
    matrix, ways = wrenches(n, angle)
    load = np.zeros(6 * (n + 1))
    load[2::6] = [each] * n + [top]
    forces, *_ = np.linalg.lstsq(matrix, load, rcond=None)
    np.testing.assert_allclose(matrix @ forces, load, atol=1e-12)
    # A tetrahedron has but one solution; the least one of a pyramid is that without alternating parts.
    assert (np.linalg.matrix_rank(matrix) == 6 * n) == (n == 3)
    found = ring_forces(n=n, angle=angle, top=top, each=each)
    for k, (out, up) in enumerate(ways):
        leg, foot = forces[3 * k : 3 * k + 3], forces[3 * (n + k) : 3 * (n + k) + 3]
        assert leg @ up == pytest.approx(found.top_n)
        assert np.linalg.norm(leg - (leg @ up) * up) == pytest.approx(found.top_s)
        assert foot[2] == pytest.approx(found.floor_n)
        assert -foot @ out == pytest.approx(found.floor_s)
    assert found.top_mu == pytest.approx(found.top_s / found.top_n)
    assert found.floor_mu == pytest.approx(found.floor_s / found.floor_n)


def test_angles():
    assert math.sin(ring_angle(n=3)) == pytest.approx(1.0 / math.sqrt(3.0))
    assert math.tan(ring_angle(n=4)) == pytest.approx(1.0)
    with pytest.raises(ValueError, match="falls through"):
        ring_angle(n=4, spread=1.5)
    with pytest.raises(ValueError, match="angle"):
        ring_forces(n=3, angle=1.6, top=1.0, each=1.0)


@pytest.mark.parametrize(("n", "mu"), [(3, 0.0), (4, 0.3)])
def test_a_heap_that_falls_obeys_newton_and_euler_sphere_by_sphere(n: int, mu: float) -> None:
    """The forces that the motion asks for, by differences of it, are along the slip and at mu; without friction energy stays."""
    radius, g, top, each = 0.5, 10.0, 20.0, 15.0
    angle, mass = ring_angle(n=n, spread=1.1), each / g
    h, t = 1e-3, 0.2
    given = {"n": n, "angle": angle, "mu": mu, "top": top, "each": each, "radius": radius, "g": g}
    down = top_displacement(t + h * np.arange(-2, 3), **given)
    height = 2.0 * radius * math.cos(angle) - down
    out = np.sqrt(4.0 * radius**2 - height**2)
    bend = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / (12.0 * h**2)
    fall, spread = float(bend @ height), float(bend @ out)
    cos, sin = height[2] / (2.0 * radius), out[2] / (2.0 * radius)
    load = (top / g * fall + top) / n  # of a leg on the top, upwards
    normal = load / (cos + mu * sin)
    # The floor's friction turns the leg as fast as it rolls, against that of the top.
    floor = mu * normal + 0.4 * mass * spread
    assert mass * spread == pytest.approx(normal * sin - mu * normal * cos - floor, rel=1e-6)
    if mu == 0.0:
        speed = (down[0] - 8.0 * down[1] + 8.0 * down[3] - down[4]) / (12.0 * h)
        rolls = speed * cos / sin
        assert top * down[2] == pytest.approx(0.5 * top / g * speed**2 + 0.7 * n * mass * rolls**2, rel=1e-8)
    with pytest.raises(ValueError, match="stands"):
        top_displacement([0.1], **{**given, "mu": 1.0})
    with pytest.raises(ValueError, match="is down"):
        top_displacement([100.0], **given)
