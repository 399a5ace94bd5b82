"""Hertz' impact against quadrature and a step-by-step integration, and the speed of Nesterenko's wave by its own equation."""

from __future__ import annotations

import math

import pytest
from scipy.integrate import quad

from ninedisk.references.analytic.impact.hertz import (
    ROUND_TRIP,
    contact_moduli,
    hertz_impact,
    hertz_shift,
    solitary_speed,
)


def test_values_of_chung_and_oois_first_tests():
    """From the formulas by hand: two glass spheres, and an aluminium one on a rigid plane."""
    e_star, _ = contact_moduli((4.8e10, 0.2), (4.8e10, 0.2))
    mass = 4.0 / 3.0 * math.pi * 0.01**3 * 2800.0
    found = hertz_impact(e_star=e_star, radius=0.005, mass=0.5 * mass, speed=20.0)
    assert found.force == pytest.approx(10696.9, rel=1e-5)
    assert found.overlap == pytest.approx(274.11e-6, rel=1e-4)
    assert found.duration == pytest.approx(40.34e-6, rel=1e-4)
    e_star, _ = contact_moduli((7e10, 0.3))
    found = hertz_impact(e_star=e_star, radius=0.1, mass=4.0 / 3.0 * math.pi * 0.1**3 * 2699.0, speed=0.2)
    assert found.force == pytest.approx(11369.9, rel=1e-5)


def test_duration_and_energy_by_quadrature():
    x_of = quad(lambda s: 4.0 * s / math.sqrt(1.0 - (1.0 - s * s) ** 2.5) if s else 4.0 / math.sqrt(2.5), 0.0, 1.0)[0]
    assert pytest.approx(x_of, rel=1e-9) == ROUND_TRIP
    found = hertz_impact(e_star=3e9, radius=0.2, mass=1.7, speed=0.9)
    work = quad(lambda d: 4.0 / 3.0 * 3e9 * math.sqrt(0.2) * d**1.5, 0.0, found.overlap)[0]
    assert work == pytest.approx(0.5 * 1.7 * 0.9**2, rel=1e-9)
    assert found.force == pytest.approx(4.0 / 3.0 * 3e9 * math.sqrt(0.2) * found.overlap**1.5, rel=1e-12)


def test_shear_modulus_of_equal_spheres():
    """8 G* a with G* = G/(2 (2 - nu)) of each of two equal bodies: Johnson's compliance (2 - nu)/(8 a G) twice."""
    _, g_star = contact_moduli((2.6e9, 0.3), (2.6e9, 0.3))
    assert g_star == pytest.approx(1e9 / 1.7 / 2.0, rel=1e-14)


@pytest.mark.parametrize("place", [0.0, 0.3, 0.6, 0.9])
def test_the_shift_of_central_differences(place):
    """Overlap and duration of the scheme itself, in units of the impact; what is left shrinks faster than the second order."""
    left = []
    for h in (0.02, 0.005):
        x, v, t = -place * h, 1.0, -place * h
        path = [x]
        while x >= 0.0 or v > 0.0:
            v -= h * 1.25 * max(x, 0.0) ** 1.5
            x, t = x + h * v, t + h
            path.append(x)
        k = max(range(len(path)), key=path.__getitem__)
        a, b, c = path[k - 1 : k + 2]
        shift = hertz_shift(h)
        off = (b + (a - c) ** 2 / (8.0 * (2.0 * b - a - c)) - 1.0, (t - x / v) / ROUND_TRIP - 1.0)
        left.append([abs(off[0] - shift.overlap) / h**2, abs(off[1] - shift.duration) / h**2])
        assert abs(off[0]) < 2.0 * shift.overlap
        assert abs(off[1]) < 2.0 * abs(shift.duration)
    assert max(left[1]) < 0.6 * max(left[0])


def test_the_solitary_wave_solves_its_equation():
    """``xi = -u_x``: the wave ``(5 c^2/4)^2 cos^4`` has the speed ``(2/sqrt 5) c xi_max^(1/4)``, c^2 = A a^(5/2), and ``v = V xi``."""
    e_star, radius, mass, speed = 7e10, 0.01, 0.03, 1.4
    found = solitary_speed(e_star=e_star, radius=radius, mass=mass, speed=speed)
    c = math.sqrt(4.0 / 3.0 * e_star * math.sqrt(0.5 * radius) / mass * (2.0 * radius) ** 2.5)
    strain = speed / found
    assert found == pytest.approx(2.0 / math.sqrt(5.0) * c * strain**0.25, rel=1e-12)
