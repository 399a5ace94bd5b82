"""Spinning disk: against the thrown disk in another frame, conservation, and a step-by-step sum."""

from __future__ import annotations

import numpy as np
import pytest

from ninedisk.references.analytic.on_plane.slip_to_roll import slip_end as thrown_slip_end
from ninedisk.references.analytic.on_plane.slip_to_roll import slip_to_roll
from ninedisk.references.analytic.on_plane.spinning_disk import energy_kept, slip_end, spinning_disk

T = np.linspace(0.0, 0.4, 81)


@pytest.mark.parametrize("ratio", [0.5, 0.4, 1.0])
def test_it_is_the_thrown_disk_seen_from_another_frame(ratio):
    case = {"mu": 0.2, "g": 9.81, "radius": 0.7, "inertia_ratio": ratio}
    found = spinning_disk(T, spin=3.0, **case)
    thrown = slip_to_roll(T, speed=0.7 * 3.0, **case)
    np.testing.assert_allclose(found.x, 2.1 * T - thrown.x, rtol=0, atol=1e-14)
    np.testing.assert_allclose(found.vx, 2.1 - thrown.vx, rtol=0, atol=1e-14)
    np.testing.assert_allclose(found.spin, 3.0 + thrown.spin, rtol=0, atol=1e-14)
    end = thrown_slip_end(mu=0.2, speed=2.1, g=9.81, inertia_ratio=ratio)
    assert slip_end(spin=3.0, **case) == pytest.approx(end, rel=1e-14)


def test_a_disk_rolls_at_a_third_of_its_rim_and_keeps_a_third_of_its_energy():
    last = spinning_disk([10.0], mu=0.3, spin=1.0, g=10.0, radius=1.0)
    assert last.vx[0] == pytest.approx(1 / 3, rel=1e-14)
    assert last.spin[0] == pytest.approx(1 / 3, rel=1e-14)
    assert slip_end(mu=0.3, spin=1.0, g=10.0, radius=1.0) == pytest.approx(1 / 9, rel=1e-14)
    kept = (last.vx[0] ** 2 + 0.5 * last.spin[0] ** 2) / 0.5
    assert kept == pytest.approx(energy_kept(), rel=1e-14) == pytest.approx(1 / 3)


def test_positions_are_the_integral_of_the_velocities():
    t = np.linspace(0.0, 0.3, 30001)
    found = spinning_disk(t, mu=0.3, spin=1.0, g=10.0, radius=1.0)
    summed = np.concatenate(([0.0], np.cumsum(0.5 * (found.vx[1:] + found.vx[:-1])) * 1e-5))
    np.testing.assert_allclose(found.x, summed, rtol=0, atol=1e-9)


@pytest.mark.parametrize("change", [{"mu": 0.0}, {"spin": -1.0}, {"g": 0.0}, {"radius": 0.0}, {"t": [-1.0]}])
def test_impossible_arguments_are_refused(change):
    case = {"t": [0.0], "mu": 0.3, "spin": 1.0, "g": 10.0, "radius": 1.0, **change}
    with pytest.raises(ValueError, match="is not allowed"):
        spinning_disk(case.pop("t"), **case)
