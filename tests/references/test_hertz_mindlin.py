"""The oblique impact and the struck row integrated: conserved quantities, closed limits, and central differences that converge to them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ninedisk.references.analytic.impact.hertz import contact_moduli, solitary_speed
from ninedisk.references.hertz_chain import stepped_row, struck_row
from ninedisk.references.hertz_mindlin import UNLOADING, Contact, impact, scheme_errors

E_STAR, G_STAR = contact_moduli((7e10, 0.33))


def contact(first=(0.2, 0.0, 2.0), e=1.0, unloading="force", **others):
    values = {
        "radius": 0.1,
        "mass": 11.0,
        "radius_2": math.inf,
        "mass_2": math.inf,
        "second": (0.0, 0.0, 0.0),
        "mu": 0.4,
    }
    beta = -math.log(e) / math.hypot(math.pi, math.log(e))
    return Contact(first=first, e_star=E_STAR, g_star=G_STAR, beta=beta, unloading=unloading, **(values | others))


@pytest.mark.parametrize("e", [1.0, 0.9, 0.5, 0.2])
def test_restitution_is_what_the_damping_ratio_says(e):
    """Antypov and Elliott (2011): the same function of e as for a linear spring."""
    truth, off = impact(contact(first=(0.2, 0.0, 0.0), e=e))
    assert -truth.first[0] / 0.2 == pytest.approx(e, abs=3e-9)
    assert off.first[0] < 1e-9


def test_one_that_slides_loses_mu_of_the_normal_impulse():
    truth, _ = impact(contact(first=(0.2, 3.0, 0.0)))
    assert truth.first[1] == pytest.approx(3.0 - 0.4 * 0.4, abs=1e-8)
    assert truth.first[2] == pytest.approx(-2.5 * 0.16 / 0.1, abs=1e-6)


@pytest.mark.parametrize("unloading", UNLOADING)
@pytest.mark.parametrize("e", [1.0, 0.5])
def test_momenta_about_the_touch_and_convergence_of_central_differences(unloading, e):
    """Two unequal spheres: momentum and angular momentum are kept; the scheme's error falls at least with the first order."""
    one = contact(first=(0.2, 0.05, 2.0), e=e, unloading=unloading, radius_2=0.15, mass_2=20.0, second=(-0.1, 0.0, 1.0))
    truth, off = impact(one)
    bodies = [(11.0, 0.1), (20.0, 0.15)]
    for k in (0, 1):
        before = 11.0 * one.first[k] + 20.0 * one.second[k]
        assert 11.0 * truth.first[k] + 20.0 * truth.second[k] == pytest.approx(before, abs=1e-12)
    # Both take the same tangential impulse at the arm of their radii: 2/5 m R times the change of spin is the same.
    turned = [0.4 * m * r * (b[2] - a[2]) for (m, r), a, b in zip(bodies, (one.first, one.second), truth, strict=True)]
    assert turned[0] == pytest.approx(turned[1], rel=1e-12)
    assert max(*off.first, *off.second) < 1e-7
    dt = one.elastic.duration / 200
    for lagged in (True, False):
        coarse, fine = (np.array(scheme_errors(one, step, lagged=lagged)) for step in (dt, dt / 8))
        assert (fine < 0.2 * coarse).all()


def test_the_rules_of_unloading_differ_where_the_contact_sticks():
    back = [impact(contact(first=(0.2, 0.02, 0.0), unloading=rule, mu=5.0))[0].first[1] for rule in UNLOADING]
    assert min(abs(a - b) for a, b in ((back[0], back[1]), (back[1], back[2]), (back[0], back[2]))) > 1e-4
    same = [impact(contact(first=(0.2, 3.0, 0.0), unloading=rule))[0].first[1] for rule in UNLOADING]
    assert same == pytest.approx([same[0]] * 3, rel=1e-9)


def test_a_bad_value_is_named():
    with pytest.raises(ValueError, match="unloading = 'other'"):
        impact(contact(unloading="other"))
    with pytest.raises(ValueError, match="part at"):
        impact(contact(first=(-0.2, 0.0, 0.0)))


def test_the_struck_row():
    """Momentum and energy in the end of all that has no contact left; Nesterenko's speed within a per cent; second order."""
    times = 0.1 * np.arange(201)
    exact, off = struck_row(18, times)
    assert off < 1e-7
    assert np.abs(exact.sum(axis=1) - 1.0).max() < 1e-12
    two, _ = struck_row(2, times)
    assert two[-1] == pytest.approx([0.0, 1.0], abs=1e-9)
    errors = [np.abs(stepped_row(18, 0.1 / k, 200 * k, k) - exact).max() for k in (4, 8, 16)]
    assert 3.5 < errors[0] / errors[1] < 4.5
    assert 3.5 < errors[1] / errors[2] < 4.5
    tops = [times[np.argmax(exact[:, k])] for k in (6, 13)]
    speed = 7.0 / (tops[1] - tops[0])
    # In the units of the row: A = 1, a diameter is 1, and v what the wave has.
    long_waves = solitary_speed(
        e_star=0.75 * math.sqrt(2.0 / 0.5), radius=0.5, mass=1.0, speed=float(exact[:, 13].max())
    )
    assert speed == pytest.approx(long_waves, rel=0.02)
