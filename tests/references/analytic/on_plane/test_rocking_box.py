"""A rocking box: the time of its flight as an elliptic integral, energy, small turns."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad

from ninedisk.references.analytic.on_plane.rocking_box import rocking_box, rocking_ratio

BOX = {"half_length": 0.2, "half_height": 0.5, "inertia": 0.11}
G = 9.81
SLENDER, RADIUS = math.atan2(0.2, 0.5), math.hypot(0.2, 0.5)
RATE = G * RADIUS / (0.11 + RADIUS**2)


def test_the_ratio_is_housners_for_a_uniform_box() -> None:
    inertia = (0.2**2 + 0.5**2) / 3.0
    found = rocking_ratio(half_length=0.2, half_height=0.5, inertia=inertia)
    assert found == pytest.approx(1.0 - 1.5 * math.sin(SLENDER) ** 2, rel=1e-14)


@pytest.mark.parametrize("most", [0.1, 0.5, 0.9])
def test_half_a_period_is_an_elliptic_integral(most: float) -> None:
    top = most * SLENDER
    spin = math.sqrt(2.0 * RATE * (math.cos(SLENDER - top) - math.cos(SLENDER)))

    # turn = top (1 - s^2): the root of the speed at the top cancels.
    def slowness(s: float) -> float:
        turn = top * (1.0 - s * s)
        square = 2.0 * RATE * (math.cos(SLENDER - top) - math.cos(SLENDER - turn))
        return (
            2.0 * top * s / math.sqrt(square)
            if s
            else 2.0 * top / math.sqrt(2.0 * RATE * math.sin(SLENDER - top) * top)
        )

    quarter = quad(slowness, 0.0, 1.0, epsabs=1e-13, epsrel=1e-13)[0]
    found = rocking_box(np.linspace(0.0, 1.99 * quarter, 301), spin=spin, g=G, **BOX)
    assert found.lands == pytest.approx(2.0 * quarter, rel=1e-9)
    assert float(found.angle.max()) == pytest.approx(top, rel=1e-4)
    energy = 0.5 * found.spin**2 + RATE * np.cos(SLENDER - found.angle)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-11)


def test_it_says_nothing_once_the_box_has_landed() -> None:
    found = rocking_box([0.0, 0.05, 5.0], spin=0.5, g=G, **BOX)
    assert np.isfinite(found.angle[:2]).all()
    assert np.isnan([found.angle[2], found.spin[2]]).all()
    assert found.lands < 5.0


def test_a_small_turn_is_a_throw_and_needs_what_the_edge_bears() -> None:
    found = rocking_box([0.0], spin=1e-5, g=G, **BOX)
    slow = RATE * math.sin(SLENDER)
    assert found.lands == pytest.approx(2e-5 / slow, rel=1e-4)
    level, upright = slow * RADIUS * math.cos(SLENDER), G - slow * RADIUS * math.sin(SLENDER)
    assert found.needed == pytest.approx(level / upright, rel=1e-4)


def test_what_falls_over_is_refused() -> None:
    with pytest.raises(ValueError, match=r"spin = 9\.0 is not allowed: the box falls over"):
        rocking_box([0.0], spin=9.0, g=G, **BOX)
