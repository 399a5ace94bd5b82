"""Oblique impact: conservation, limits, and the springs against a step-by-step integration."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ninedisk.references.analytic.impact.oblique_impact import rigid_rebound, spring_rebound
from ninedisk.references.analytic.impact.spring_dashpot import contact_duration, contact_history, restitution_of_beta

DISK = {"radius": 0.8, "inertia_ratio": 0.5}
MASS, KN = 2.0, 1e6


def slip(found, radius=0.8):
    return found.vx - radius * found.spin


@pytest.mark.parametrize(("vt", "spin"), [(0.4, 0.0), (5.0, 0.0), (-5.0, 1.0), (1.0, -2.0), (0.8, 1.0)])
def test_friction_has_no_moment_about_the_plane_and_stays_in_its_cone(vt, spin):
    found = rigid_rebound(velocity=(vt, -1.0), spin=spin, mu=0.3, restitution=0.7, **DISK)
    assert found.vy == pytest.approx(0.7)
    moment = [v * 0.8 + 0.5 * 0.8**2 * w for v, w in ((vt, spin), (found.vx, found.spin))]
    assert moment[1] == pytest.approx(moment[0], rel=1e-13, abs=1e-15)
    ratio = abs(vt - found.vx) / 1.7
    assert ratio <= 0.3 * (1.0 + 1e-13)
    before, after = vt - 0.8 * spin, slip(found)
    assert abs(after) < 1e-14 or (ratio == pytest.approx(0.3) and after * before > 0.0)


def test_the_border_between_sticking_and_sliding():
    limit = 3.0 * 0.3 * (1.0 + 0.5)
    for vt, sticks in ((0.999 * limit, True), (1.001 * limit, False)):
        found = rigid_rebound(velocity=(vt, -1.0), spin=0.0, mu=0.3, restitution=0.5, **DISK)
        assert (abs(slip(found)) < 1e-14) == sticks


def test_the_associated_rule_opens_by_mu_times_the_slip_that_is_left():
    found = rigid_rebound(velocity=(3.0, -1.0), spin=0.0, mu=0.3, restitution=0.5, dilates=True, **DISK)
    assert found.vy == pytest.approx(0.5 + 0.3 * slip(found), rel=1e-14)
    assert 3.0 - found.vx == pytest.approx(0.3 * (found.vy + 1.0), rel=1e-14)
    rolls = {"velocity": (0.5, -1.0), "spin": 0.0, "mu": 0.3, "restitution": 0.5, **DISK}
    assert rigid_rebound(dilates=True, **rolls) == rigid_rebound(**rolls)


def integrated(vt, mu, ks, beta, n=40_000):
    """Slip after the contact, explicitly: spring increment, cap, velocity."""
    end = contact_duration(kn=KN, m_eff=MASS, beta=beta)
    dt = end / n
    _, _, fn = contact_history((np.arange(n) + 0.5) * dt, kn=KN, m_eff=MASS, beta=beta, speed=1.0)
    u, f = vt, 0.0
    for cap in mu * fn / MASS:
        f = max(-cap, min(cap, f + ks / MASS * u * dt))
        u -= 3.0 * f * dt
    return u


@pytest.mark.parametrize("beta", [0.0, 0.25, 1.5])
@pytest.mark.parametrize("vt", [0.05, 0.4, 1.0, -2.0])
@pytest.mark.parametrize("ratio", [2 / 3, 0.2])
def test_the_phases_are_those_of_a_step_by_step_integration(vt, beta, ratio):
    found = spring_rebound(velocity=(vt, -1.0), spin=0.0, mu=0.3, mass=MASS, kn=KN, ks=ratio * KN, beta=beta, **DISK)
    assert found.vy == restitution_of_beta(beta)
    assert slip(found) == pytest.approx(integrated(vt, 0.3, ratio * KN, beta), abs=6e-5 * max(1.0, abs(vt)))


def test_without_a_cap_the_spring_swings_freely():
    ks = 0.3 * KN
    found = spring_rebound(velocity=(0.2, -1.0), spin=0.0, mu=1e6, mass=MASS, kn=KN, ks=ks, beta=0.0, **DISK)
    turn = math.pi * math.sqrt(3.0 * ks / KN)
    assert slip(found) == pytest.approx(0.2 * math.cos(turn), rel=1e-9)


@pytest.mark.parametrize("rotating", [True, False])
def test_a_disk_that_slides_all_the_while_does_as_a_rigid_one(rotating):
    case = {"velocity": (4.0, -1.0), "spin": 0.5, "mu": 0.3, "radius": 0.8}
    case["inertia_ratio"] = 0.5 if rotating else math.inf
    springs = spring_rebound(mass=MASS, kn=KN, ks=2 / 3 * KN, beta=0.0, **case)
    np.testing.assert_allclose(springs, rigid_rebound(restitution=1.0, **case), rtol=1e-13)


def test_energy_is_lost_to_sliding_only():
    def energy(v, w):
        return v[0] ** 2 + v[1] ** 2 + 0.5 * 0.64 * w**2

    free = spring_rebound(velocity=(0.2, -1.0), spin=1.0, mu=1e6, mass=MASS, kn=KN, ks=4 / 3 * KN, beta=0.0, **DISK)
    stored = energy((0.2, -1.0), 1.0) - energy((free.vx, free.vy), free.spin)
    assert stored >= -1e-12  # what the shear spring holds as the contact ends is gone
    slides = spring_rebound(velocity=(2.0, -1.0), spin=0.0, mu=0.3, mass=MASS, kn=KN, ks=KN, beta=0.0, **DISK)
    assert energy((slides.vx, slides.vy), slides.spin) < energy((2.0, -1.0), 0.0)


@pytest.mark.parametrize(
    "change", [{"velocity": (1.0, 1.0)}, {"radius": 0.0}, {"mu": -0.1}, {"kn": 0.0}, {"beta": -1.0}]
)
def test_impossible_arguments_are_refused(change):
    case = {"velocity": (1.0, -1.0), "spin": 0.0, "mu": 0.3, "mass": 1.0, "kn": KN, "ks": KN, "beta": 0.0, **DISK}
    with pytest.raises(ValueError, match="is not allowed"):
        spring_rebound(**{**case, **change})
