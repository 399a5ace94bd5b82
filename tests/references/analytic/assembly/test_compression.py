"""The continuous row against numerical integration of three disks."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ninedisk.references.analytic.assembly.compression import (
    continuous_row,
    damping_ratio,
    row_frequency,
    steady_force,
    undamped_amplitude,
)

MASS = 1000.0 * math.pi * 50.0**2
LOAD_CASES = {
    "a1": (1.35e9, 0.01525, 40, 0.12),
    "a2": (1.35e9, 0.01525, 120, 0.04),
    "b1": (1.5e8, 0.04576, 40, 0.36),
    "b2": (1.5e8, 0.04576, 120, 0.12),
}


@pytest.mark.parametrize("xi", [0.0, 3.0, 37.0, 60.0])
def test_equals_three_integrated_disks(xi: float) -> None:
    kn, v_wall, t_wall = 1.35e9, 0.12, 0.61
    t = np.linspace(0.0, 3.0, 301)

    def overlaps(x: np.ndarray, time: float) -> np.ndarray:
        wall = v_wall * min(time, t_wall)
        return np.maximum([wall - x[0], x[0] - x[1], x[1] - x[2], x[2] + wall], 0.0)

    def rate(time: float, y: np.ndarray) -> np.ndarray:
        f = kn * overlaps(y[:3], time)
        return np.concatenate([y[3:], (f[:-1] - f[1:]) / MASS - xi * y[3:]])

    start, y = np.zeros(6), []
    for begin, end in ((0.0, t_wall), (t_wall, 3.0)):  # the kink of the load lies between two integrations
        at = t[(t >= begin) & (t < end + (end == 3.0))]
        run = solve_ivp(
            rate, (begin, end), start, t_eval=np.append(at, end) if at[-1] != end else at, rtol=1e-11, atol=1e-13
        )
        y.append(run.y[:, : len(at)])
        start = run.y[:, -1]
    x = np.concatenate(y, axis=1)
    f = kn * np.array([overlaps(column[:3], time) for column, time in zip(x.T, t, strict=True)])
    disk_disk, wall = continuous_row(t, kn=kn, mass=MASS, xi=xi, v_wall=v_wall, t_wall=t_wall)
    # Tolerance of the integrator, a hundred steps of it.
    assert np.abs(disk_disk - f[:, 1]).max() <= 1e-8 * f.max()
    assert np.abs(wall - f[:, 0]).max() <= 1e-8 * f.max()


def test_critical_damping_is_the_limit_of_both_sides() -> None:
    xi = 2.0 * row_frequency(kn=4.5, mass=1.0)  # omega = 3 exactly: the branch of equal roots
    assert xi == 6.0
    t = np.linspace(0.0, 4.0, 50)
    below, at, above = (
        continuous_row(t, kn=4.5, mass=1.0, xi=value, v_wall=1.0, t_wall=1.0)[0] for value in (xi - 1e-6, xi, xi + 1e-6)
    )
    # Even parts of the neighbours: their odd parts cancel, leaving the second order in 1e-6 and round-off.
    assert (below + above) / 2.0 == pytest.approx(at, abs=1e-10)


def test_steady_forces_and_frequencies_of_the_load_cases() -> None:
    for name, expected in {"a1": 4.94100e7, "a2": 4.94100e7, "b1": 4.94208e7, "b2": 4.94208e7}.items():
        kn, dt, n, v = LOAD_CASES[name]
        assert steady_force(kn=kn, v_wall=v, t_wall=n * dt) == pytest.approx(expected, abs=50.0)
    a, b = (row_frequency(kn=kn, mass=MASS) for kn in (1.35e9, 1.5e8))
    assert (a, b) == pytest.approx((18.5412, 6.1804), abs=5e-5)
    assert 2.0 * math.pi / a / 0.01525 == pytest.approx(22.22, abs=5e-3)
    ratios = [damping_ratio(kn=kn, mass=MASS, xi=3.0) for kn in (1.35e9, 1.5e8)]
    assert ratios == pytest.approx([0.0809, 0.2427], abs=5e-5)


def test_undamped_amplitude_is_the_swing_after_the_walls_stop() -> None:
    amplitude = undamped_amplitude(kn=1.35e9, mass=MASS, v_wall=0.12, t_wall=0.61)
    assert amplitude == pytest.approx(5.134e6, abs=500.0)
    t = np.linspace(0.61, 1.5, 20001)
    force, wall = continuous_row(t, kn=1.35e9, mass=MASS, xi=0.0, v_wall=0.12, t_wall=0.61)
    # A crest lies at most half a sample, omega dt/2 = 4e-4, from a sample: (4e-4)^2/2 of the amplitude.
    assert np.ptp(force) / 2.0 == pytest.approx(amplitude, rel=1e-7)
    assert np.ptp(wall) / 2.0 == pytest.approx(amplitude, rel=1e-7)


@pytest.mark.parametrize("xi", [0.0, 3.0, 100.0])
@pytest.mark.parametrize("t_wall", [1e-3, 0.2, 0.34, 2.0])
def test_no_contact_ever_opens(xi: float, t_wall: float) -> None:
    t = np.linspace(0.0, 6.0, 4001)
    forces = continuous_row(t, kn=1.35e9, mass=MASS, xi=xi, v_wall=0.12, t_wall=t_wall)
    # Round-off of the difference of two ramps of up to v t.
    assert min(map(np.min, forces)) >= -1.35e9 * 0.12 * 6.0 * 1e-15


def test_bad_times_are_named() -> None:
    with pytest.raises(ValueError, match="every time must be finite and >= 0"):
        continuous_row([-1.0], kn=1.0, mass=1.0, xi=0.0, v_wall=1.0, t_wall=1.0)
