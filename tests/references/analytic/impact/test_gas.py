"""Collision rates: against points and collisions counted one by one; Haff's law against gases without a time step."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest

from ninedisk.references.analytic.impact.gas import haff_spread, haff_time, pair_rate, rate_in_box, wall_rate
from ninedisk.references.analytic.impact.hard_disks import hard_disks


def test_hits_of_walls_are_those_of_points_that_fly_straight():
    rng = np.random.default_rng(5)
    n, side, thermal, time = 20_000, 2.0, 1.5, 3.0
    x, v = rng.uniform(0.0, side, (n, 2)), thermal * rng.standard_normal((n, 2))
    hits = np.abs(np.floor((x + v * time) / side)).sum()  # each image of the box that is crossed is a hit
    rate = wall_rate(n=n, area=side**2, length=4.0 * side, thermal=thermal)
    assert hits / time == pytest.approx(rate, rel=0.02)


@pytest.mark.parametrize(("dimension", "target"), [(2, 2.0), (3, math.pi)])
def test_a_dilute_gas_sweeps_its_free_path(dimension, target):
    # What one hits in a second at the mean relative speed: 2 sigma v rho disks, pi sigma^2 v rho spheres.
    n, area, radius, thermal = 50, 1e6, 0.5, 2.0
    rng = np.random.default_rng(6)
    apart = thermal * math.sqrt(2.0) * rng.standard_normal((200_000, dimension))
    swept = n / area * target * (2.0 * radius) ** (dimension - 1) * np.linalg.norm(apart, axis=1).mean()
    rate = pair_rate(n=n, area=area, radius=radius, thermal=thermal, dimension=dimension)
    assert rate == pytest.approx(0.5 * n * swept, rel=5e-3)


def test_dense_gases_collide_more_and_solids_are_refused():
    rates = [pair_rate(n=9, area=area, radius=1.0, thermal=1.0) * area for area in (1e4, 81.0)]
    assert rates[1] / rates[0] > 1.9
    with pytest.raises(ValueError, match="not allowed"):
        pair_rate(n=9, area=30.0, radius=1.0, thermal=1.0)
    with pytest.raises(ValueError, match="not allowed"):
        wall_rate(n=9, area=0.0, length=1.0, thermal=1.0)


ROWS, SPACING, E = {2: 10, 3: 4}, {2: 5.6, 3: 4.2}, 0.7
"""By the dimension."""


def gases(seeds, restitution, times, d=2):
    """Event-driven gases of disks or spheres of radius 1, ten elastic collisions of each after a lattice."""
    side, thermal, n = ROWS[d] * SPACING[d], 1.0, ROWS[d] ** d
    rate = 2.0 / n * pair_rate(n=n, area=side**d, radius=1.0, thermal=thermal, dimension=d)
    place = SPACING[d] * (np.arange(ROWS[d]) + 0.5)
    for seed in seeds:
        v = np.random.default_rng(seed).standard_normal((n, d))
        v *= math.sqrt(d * n / (v**2).sum())
        box = {"radius": 1.0, "side": side}
        x = np.array([each[::-1] for each in product(place, repeat=d)])
        mixed = hard_disks(x=x, v=v, restitution=1.0, times=[10.0 / rate], **box)
        yield rate, hard_disks(x=mixed.x[0], v=mixed.v[0], restitution=restitution, times=times, **box)


@pytest.mark.sampled(1)
@pytest.mark.long
@pytest.mark.parametrize(("d", "time", "low", "high"), [(2, 70.0, 1.01, 1.02), (3, 60.0, 1.16, 1.18)])
def test_a_box_has_more_space_outside_than_partners_inside(d, time, low, high):
    """Counted in elastic gases: the mean of eight over 20 free times is known to 1 %."""
    n = ROWS[d] ** d
    factor = rate_in_box(n=n, side=ROWS[d] * SPACING[d], radius=1.0, dimension=d)
    counted = []
    for rate, flight in gases(range(8), 1.0, [time], d):
        counted.append(flight.collisions[-1] / time / (0.5 * n * rate))
    assert np.mean(counted) == pytest.approx(factor, abs=3.0 * np.std(counted) / math.sqrt(8) + 0.005)
    assert low < factor < high
    with pytest.raises(ValueError, match="wider than two disks"):
        rate_in_box(n=2, side=4.0, radius=1.0)


@pytest.mark.sampled(1)
@pytest.mark.long
@pytest.mark.parametrize("d", [2, 3])
def test_gases_cool_by_haffs_law_and_scatter_as_derived(d):
    """Twenty-four gases: the mean within its confidence interval and the 3 % of the rate that the theory may be off."""
    side, n = ROWS[d] * SPACING[d], ROWS[d] ** d
    time = haff_time(n=n, area=side**d, radius=1.0, thermal=1.0, restitution=E, dimension=d)
    time /= rate_in_box(n=n, side=side, radius=1.0, dimension=d)
    ends = []
    for _, flight in gases(range(100, 124), E, [0.0, time], d):
        energy = (flight.v**2).sum(axis=(1, 2))
        ends.append(math.log(energy[1] / energy[0]))
    sigma = haff_spread(n=n, restitution=E, elapsed=1.0, dimension=d)
    assert np.mean(ends) == pytest.approx(-2.0 * math.log(2.0), abs=3.0 * sigma / math.sqrt(24) + 0.03)
    assert np.std(ends, ddof=1) == pytest.approx(sigma, rel=0.45)  # 3 standard deviations of that of 24
    with pytest.raises(ValueError, match="do not cool"):
        haff_time(n=9, area=100.0, radius=1.0, thermal=1.0, restitution=1.0)
