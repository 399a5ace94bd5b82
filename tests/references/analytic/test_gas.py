"""Collision rates: against points counted one by one."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ninedisk.references.analytic.gas import pair_rate, wall_rate


def test_hits_of_walls_are_those_of_points_that_fly_straight():
    rng = np.random.default_rng(5)
    n, side, thermal, time = 20_000, 2.0, 1.5, 3.0
    x, v = rng.uniform(0.0, side, (n, 2)), thermal * rng.standard_normal((n, 2))
    hits = np.abs(np.floor((x + v * time) / side)).sum()  # each image of the box that is crossed is a hit
    rate = wall_rate(n=n, area=side**2, length=4.0 * side, thermal=thermal)
    assert hits / time == pytest.approx(rate, rel=0.02)


def test_a_dilute_gas_sweeps_its_free_path():
    # Disks that all stand but one: 2 sigma v rho a second; all of them move: the mean relative speed, sqrt(pi) v in place of v.
    n, area, radius, thermal = 50, 1e6, 0.5, 2.0
    rng = np.random.default_rng(6)
    apart = thermal * math.sqrt(2.0) * rng.standard_normal((200_000, 2))
    swept = n / area * 4.0 * radius * np.hypot(*apart.T).mean()
    assert pair_rate(n=n, area=area, radius=radius, thermal=thermal) == pytest.approx(0.5 * n * swept, rel=5e-3)


def test_dense_gases_collide_more_and_solids_are_refused():
    rates = [pair_rate(n=9, area=area, radius=1.0, thermal=1.0) * area for area in (1e4, 81.0)]
    assert rates[1] / rates[0] > 1.9
    with pytest.raises(ValueError, match="not allowed"):
        pair_rate(n=9, area=30.0, radius=1.0, thermal=1.0)
    with pytest.raises(ValueError, match="not allowed"):
        wall_rate(n=9, area=0.0, length=1.0, thermal=1.0)
