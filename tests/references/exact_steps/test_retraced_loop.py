"""Steps along retraced paths: first order of the end, none of the middle, and the line integral in the limit."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from ninedisk.references.analytic.contact.retraced_loop import (
    passing_drift,
    passing_shear,
    turning_wall_drift,
    turning_wall_shear,
)
from ninedisk.references.exact_steps.retraced_loop import oscillation_central, pair_shear, turning_wall_steps

AHEAD, ASIDE, AMPLITUDE, FREQUENCY = 0.2, -0.55, 0.02, 2.0 * math.pi
WALL = {"radius": 0.5, "overlap": 0.05, "path": 0.03, "angle": 0.07}


def test_the_oscillation_obeys_its_recurrence():
    dt = 0.03
    x = oscillation_central(frequency=FREQUENCY, speed=2.0, dt=dt, n_steps=500)
    assert x[1] == pytest.approx(2.0 * dt, rel=1e-15)
    np.testing.assert_allclose(x[2:] - 2.0 * x[1:-1] + x[:-2], -((FREQUENCY * dt) ** 2) * x[1:-1], atol=1e-14)


def astray(steps, cycles, slip_at):
    """Drift of fs/ks per cycle against the place on the path that is reached."""
    shift = oscillation_central(
        frequency=FREQUENCY, speed=AMPLITUDE * FREQUENCY, dt=1.0 / steps, n_steps=cycles * steps
    )
    d = np.column_stack([AHEAD - shift, np.full_like(shift, ASIDE)])
    shear = pair_shear(d, slip_at=slip_at)
    return (shear - passing_shear(shift, ahead=AHEAD, aside=ASIDE))[-1] / cycles


def test_the_end_drifts_to_first_order_and_linearly_in_cycles():
    for steps in (100, 200, 400):
        predicted = passing_drift(amplitude=AMPLITUDE, frequency=FREQUENCY, ahead=AHEAD, aside=ASIDE, dt=1.0 / steps)
        for cycles in (1, 10):
            assert astray(steps, cycles, "end") == pytest.approx(predicted, rel=0.3 / steps)


def test_the_middle_drifts_to_fourth_order():
    """Each step's midpoint rule errs by ``(shift' dt)^2/24`` times the way's second derivative, with a sign that is turned on the way back.

    What is left of the sum at the end of a cycle is that of the place where the scheme, whose period is longer by ``(w dt)^2/24`` of
    itself, is by then: the product of two terms of second order.
    """
    found = [abs(astray(steps, 10, "middle")) for steps in (20, 40, 80)]
    assert found[0] < 1e-8
    assert [math.log2(a / b) for a, b in pairwise(found)] == pytest.approx([4.0, 4.0], abs=0.1)


def test_a_reversal_within_a_step_leaves_the_third_order():
    """Way gone at a constant speed and back, turned a third of a step before a step ends."""
    drift = []
    for steps in (100, 200, 400, 800):
        t = np.arange(3 * steps + 1) / steps
        path = 0.02 * np.abs((t + 1.0 / 3.0) % 2.0 - 1.0)
        d = np.column_stack([AHEAD - path, np.full_like(path, ASIDE)])
        whole = pair_shear(d, slip_at="middle")
        drift.append(abs(whole[2 * steps] - whole[0]))
    orders = [math.log2(a / b) for a, b in pairwise(drift)]
    assert orders == pytest.approx([3.0, 3.0, 3.0], abs=0.1)


@pytest.mark.parametrize("mid", [False, True])
def test_steps_on_a_turning_wall(mid):
    for half in (50, 100):
        middle = turning_wall_steps(half=half, cycles=3, mid_overlap=mid, slip_at="middle", **WALL)
        exact = turning_wall_shear(np.arange(half + 1) / half, mid_overlap=mid, **WALL)
        assert np.abs(middle[: half + 1] - exact).max() < 0.03 * 0.07**2 / half**2
        assert np.abs(middle[:: 2 * half]).max() < 1e-17
        end = turning_wall_steps(half=half, cycles=3, mid_overlap=mid, slip_at="end", **WALL)
        drift = turning_wall_drift(path=0.03, angle=0.07, period=1.0, dt=0.5 / half, mid_overlap=mid)
        assert end[:: 2 * half] == pytest.approx(drift * np.arange(4), rel=1e-9, abs=1e-15)


def test_arguments_out_of_range_are_refused():
    with pytest.raises(ValueError, match="stable below"):
        oscillation_central(frequency=1.0, speed=1.0, dt=2.0, n_steps=3)
    with pytest.raises(ValueError, match="slip_at = 'begin' is unknown"):
        pair_shear(np.zeros((3, 2)), slip_at="begin")
    with pytest.raises(ValueError, match="half"):
        turning_wall_steps(half=0, cycles=1, mid_overlap=True, slip_at="end", **WALL)
