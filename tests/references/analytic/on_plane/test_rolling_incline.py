"""Rates of a disk on an incline: energy, momentum, the border of the branches, and the associated scheme's limit."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ninedisk.references.analytic.on_plane.rolling_incline import roll_down, roll_rates, rolling_mu
from ninedisk.references.exact_steps.rolling import associated_rolling

BODY = {"angle": 0.4, "g": 9.81, "mass": 3.0, "radius": 0.7}


@pytest.mark.parametrize("ratio", [0.4, 0.5, 1.0])
def test_rolling_keeps_energy_and_sliding_loses_friction_s_work(ratio):
    for mu in (0.5, 0.05):
        rates = roll_rates(**BODY, mu=mu, inertia_ratio=ratio)
        end = roll_down(2.0, rates)
        kinetic = 0.5 * 3.0 * (end.vx**2 + ratio * (0.7 * end.spin) ** 2)
        fallen = 3.0 * 9.81 * math.sin(0.4) * end.x
        slipped = 0.5 * rates.slip * 2.0**2
        assert kinetic == pytest.approx(fallen - rates.fs * slipped, rel=1e-12)


def test_the_branches_meet_where_friction_just_suffices():
    border = rolling_mu(angle=0.4)
    assert border == pytest.approx(math.tan(0.4) / 3.0)
    below, above = (roll_rates(**BODY, mu=border * factor) for factor in (1 - 1e-9, 1.0))
    assert below == pytest.approx(above, rel=1e-8, abs=1e-8)


@pytest.mark.parametrize("mu", [0.3, 0.05])
def test_the_associated_scheme_converges_with_order_one(mu):
    rates = roll_rates(**BODY, mu=mu)
    errors = []
    for n in (100, 200):
        steps = associated_rolling(
            mu=mu, g=9.81 * math.cos(0.4), pull=9.81 * math.sin(0.4), mass=3.0, radius=0.7, inertia_ratio=0.5, speed=0.0,
            dt=1.0 / n, n_steps=n,
        )  # fmt: skip
        errors.append(abs(steps.x[-1] - rates.along / 2.0))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(1.0, abs=0.02)


def test_bad_arguments():
    with pytest.raises(ValueError, match="mu"):
        roll_rates(**BODY, mu=-0.1)
    with pytest.raises(ValueError, match="t = "):
        roll_down(-1.0, roll_rates(**BODY, mu=0.1))
