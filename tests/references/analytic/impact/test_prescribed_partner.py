"""Impacts on bodies whose motion is prescribed: the touch, the relative velocity, and refusals."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ninedisk.references.analytic.impact.prescribed_partner import (
    carried,
    rebound_from_held_disk,
    struck_by_turning_wall,
)


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_a_turning_wall_strikes_where_it_touches_and_parts_with_restitution(restitution):
    place, radius, rate = (1.3, 0.9), 0.4, 0.7
    found = struck_by_turning_wall(place=place, radius=radius, rate=rate, restitution=restitution)
    angle = rate * found.time
    along, normal = np.array([math.cos(angle), math.sin(angle)]), np.array([-math.sin(angle), math.cos(angle)])
    assert normal @ place == pytest.approx(radius)
    assert 0.0 < angle < math.atan2(*place[::-1])  # the first touch
    contact = (along @ place) * along  # of the wall's line, through the origin
    wall = rate * np.array([-contact[1], contact[0]])
    relative = np.array(found.velocity) - wall
    assert relative @ normal == pytest.approx(restitution * (wall @ normal))
    assert relative @ along == pytest.approx(0.0, abs=1e-14)
    assert found.approach == pytest.approx(float(wall @ normal))


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_a_held_disk_reflects_along_the_line_of_centres(restitution):
    place, speed, reach = (-3.0, 0.6), 2.0, 1.0
    found = rebound_from_held_disk(place=place, speed=speed, reach=reach, restitution=restitution)
    touch = np.array([place[0] + speed * found.time, place[1]])
    assert math.hypot(*touch) == pytest.approx(reach)
    before, after, across = np.array([speed, 0.0]), np.array(found.velocity), np.array([-touch[1], touch[0]])
    assert after @ touch == pytest.approx(-restitution * before @ touch)
    assert after @ across == pytest.approx(before @ across)


def test_a_carried_block_has_the_derivatives_of_its_path():
    t, h = np.linspace(0.1, 1.0, 9), 1e-5
    here, then, ago = (carried(t + d, amplitude=0.02, frequency=10.0) for d in (0.0, h, -h))
    np.testing.assert_allclose((then.x - ago.x) / (2.0 * h), here.v, atol=1e-8)
    np.testing.assert_allclose((then.v - ago.v) / (2.0 * h), here.a, atol=1e-7)
    assert carried(0.0, amplitude=0.02, frequency=10.0)[:2] == (0.0, 0.0)


@pytest.mark.parametrize(
    ("of", "change", "named"),
    [
        (struck_by_turning_wall, {"place": (1.0, 0.1)}, "above the wall"),
        (struck_by_turning_wall, {"rate": 0.0}, "rate"),
        (struck_by_turning_wall, {"restitution": 1.1}, "restitution"),
        (rebound_from_held_disk, {"place": (-3.0, 1.0)}, "place"),
        (rebound_from_held_disk, {"place": (-0.1, 0.1)}, "place"),
        (rebound_from_held_disk, {"speed": -1.0}, "speed"),
    ],
)
def test_what_does_not_meet_is_refused(of, change, named):
    fitting = {"place": (1.0, 1.0), "radius": 0.5, "rate": 1.0, "restitution": 0.5}
    if of is rebound_from_held_disk:
        fitting = {"place": (-3.0, 0.6), "speed": 2.0, "reach": 1.0, "restitution": 0.5}
    with pytest.raises(ValueError, match=named):
        of(**{**fitting, **change})
