"""A box with balls on it: work and energy, and both sides of the push that moves it."""

from __future__ import annotations

import math

import pytest

from ninedisk.references.analytic.on_plane.carried_balls import carried_balls

SCENE = {"mass": 3.0, "carried": 7.0, "mu": 0.3, "g": 9.81}
HOLDS = 0.3 * 10.0 * 9.81


@pytest.mark.parametrize("push", [1.01 * HOLDS, 2.0 * HOLDS, 5.0 * HOLDS])
def test_the_work_is_the_energy(push: float) -> None:
    found = carried_balls(push=push, **SCENE)
    t, radius = 0.7, 0.13
    speed, rolls = found.box * t, found.balls * t
    spin = (speed - rolls) / radius  # the lowest point of a ball moves with the box
    kinetic = 0.5 * 3.0 * speed**2 + 7.0 * (0.5 * rolls**2 + 0.5 * 0.4 * (radius * spin) ** 2)
    assert (push - HOLDS) * 0.5 * found.box * t * t == pytest.approx(kinetic, rel=1e-12)
    # One force moves a ball and turns it.
    force = found.balls
    assert force * radius * t == pytest.approx(0.4 * radius**2 * spin, rel=1e-12)
    assert found.needed == pytest.approx(force / 9.81, rel=1e-12)


def test_friction_holds_up_to_its_bound() -> None:
    assert carried_balls(push=math.nextafter(HOLDS, 0.0), **SCENE) == (0.0, 0.0, 0.0)
    assert carried_balls(push=1.001 * HOLDS, **SCENE).box > 0.0


def test_a_bare_box_and_the_published_number() -> None:
    bare = carried_balls(push=50.0, mass=3.0, carried=0.0, mu=0.3, g=10.0)
    assert bare.box == pytest.approx((50.0 - 9.0) / 3.0, rel=1e-14)
    simbenchmark = carried_balls(push=150.0, mass=10.0, carried=25.0, mu=0.4, g=9.81)
    assert simbenchmark.box == pytest.approx(0.7385, rel=1e-12)
