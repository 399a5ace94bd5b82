"""Bounces: series and their sums, and contacts under weight against their limits and a step-by-step integration."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ninedisk.references.analytic.impact.bouncing import (
    landing_speed,
    loaded_contact,
    rigid_bounces,
    spring_bounces,
    zeno_time,
)
from ninedisk.references.analytic.impact.spring_dashpot import (
    beta_of_restitution,
    contact_duration,
    restitution_of_beta,
)

MASS, KN, G = 2.0, 1e5, 9.81
OMEGA = math.sqrt(KN / MASS)


def test_the_flights_add_up_to_the_time_of_rest():
    flights = rigid_bounces(height=0.3, g=G, restitution=0.6, bounces=60)
    assert flights.land[-1] == pytest.approx(zeno_time(height=0.3, g=G, restitution=0.6), rel=1e-12)
    heights, _ = flights.apex(G)
    np.testing.assert_allclose(heights[:8], 0.3 * 0.36 ** np.arange(8), rtol=1e-13)
    assert zeno_time(height=0.45, g=10.0, restitution=0.5) == pytest.approx(0.9, rel=1e-14)


def test_the_motion_of_a_flight_is_a_parabola_between_landings():
    flights = rigid_bounces(height=0.45, g=10.0, restitution=0.5, bounces=2)
    gap, vy = flights.motion([0.0, 0.1, 0.45, 0.7, 5.0], 10.0)
    np.testing.assert_allclose(gap[:4], [0.45, 0.4, 0.1125, 0.75 * 0.1 - 0.05], rtol=1e-12)
    np.testing.assert_allclose(vy[:3], [0.0, -1.0, 0.0], atol=1e-14)
    assert np.isnan(gap[4])


@pytest.mark.parametrize("beta", [0.0, 0.1, 0.9, 1.0, 2.0])
def test_without_weight_it_is_the_known_contact(beta):
    found = loaded_contact(kn=KN, mass=MASS, beta=beta, speed=1.5, g=0.0)
    assert found is not None
    assert found.speed == pytest.approx(1.5 * restitution_of_beta(beta), rel=1e-10)
    assert found.duration == pytest.approx(contact_duration(kn=KN, m_eff=MASS, beta=beta), rel=1e-10)


def test_an_elastic_contact_under_weight_gives_the_speed_back_and_lasts_longer():
    found = loaded_contact(kn=KN, mass=MASS, beta=0.0, speed=0.2, g=G)
    assert found is not None
    assert found.speed == pytest.approx(0.2, rel=1e-12)
    assert found.overlap == pytest.approx(0.0, abs=1e-15)
    # delta = d (1 - cos) + (v/omega) sin with d = g/omega^2: zero again after 2 (pi - atan(v/(omega d))) / omega.
    expected = 2.0 * (math.pi - math.atan(0.2 * OMEGA / G)) / OMEGA
    assert found.duration == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(("beta", "speed"), [(0.1, 0.5), (0.3, 0.2), (1.2, 3.0), (0.25, 2.0)])
def test_a_damped_contact_is_that_of_a_step_by_step_integration(beta, speed):
    found = loaded_contact(kn=KN, mass=MASS, beta=beta, speed=speed, g=G)
    assert found is not None
    dt = 2e-5 / OMEGA
    overlap, rate, t = 0.0, speed, 0.0
    while True:
        force = OMEGA**2 * overlap + 2.0 * beta * OMEGA * rate
        if t > 0.0 and force < 0.0:
            break
        rate += dt * (G - force)
        overlap += dt * rate
        t += dt
    assert t == pytest.approx(found.duration, rel=1e-4)
    assert -rate == pytest.approx(found.speed, rel=2e-4)
    assert overlap == pytest.approx(found.overlap, rel=2e-4, abs=1e-12)


def test_a_strong_dashpot_or_a_slow_touch_never_releases():
    assert loaded_contact(kn=KN, mass=MASS, beta=10.0, speed=1.0, g=G) is None
    assert loaded_contact(kn=KN, mass=MASS, beta=0.3, speed=1e-3, g=G) is None


def test_stiff_springs_bounce_as_rigid_disks_do():
    beta = beta_of_restitution(0.5)
    rigid = rigid_bounces(height=0.4, g=G, restitution=0.5, bounces=3).apex(G)
    offsets = []
    for kn in (1e8, 1e10):
        found = spring_bounces(height=0.4, g=G, kn=kn, mass=MASS, beta=beta, bounces=3).apex(G)
        offsets.append(np.abs(np.array(found) - rigid).max())
    assert offsets[1] < 2e-4
    assert offsets[0] / offsets[1] == pytest.approx(10.0, rel=0.05)  # 1/omega: overlap and length of the contact


def test_the_energy_of_elastic_springs_stays():
    flights = spring_bounces(height=0.4, g=G, kn=1e5, mass=MASS, beta=0.0, bounces=3)
    np.testing.assert_allclose(flights.apex(G)[0], 0.4, rtol=1e-12)
    assert np.all(flights.contact[1:] > math.pi / OMEGA)
    assert landing_speed(height=0.4, g=G) == pytest.approx(flights.speed[1], rel=1e-12)


def test_springs_come_to_rest_after_a_finite_number_of_bounces():
    assert len(spring_bounces(height=0.4, g=G, kn=1e5, mass=MASS, beta=0.2, bounces=50).land) < 12


@pytest.mark.parametrize(
    "call",
    [
        lambda: zeno_time(height=1.0, g=G, restitution=1.0),
        lambda: rigid_bounces(height=1.0, g=G, restitution=1.5, bounces=2),
        lambda: rigid_bounces(height=0.0, g=G, restitution=0.5, bounces=2),
        lambda: loaded_contact(kn=KN, mass=MASS, beta=-0.1, speed=1.0, g=G),
        lambda: spring_bounces(height=1.0, g=G, kn=KN, mass=MASS, beta=0.1, bounces=-1),
    ],
)
def test_impossible_arguments_are_refused(call):
    with pytest.raises(ValueError, match="is not allowed"):
        call()
