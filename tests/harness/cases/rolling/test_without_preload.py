"""Variants whose springs start without a shear force: what an engine sees that cannot set one."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from ninedisk.harness.api.capabilities import Capability, capabilities_needed
from ninedisk.harness.api.params import resolve, settings_of_other_engines
from ninedisk.harness.api.registry import get_case
from ninedisk.harness.cases.rolling.incline_disk import MASS
from ninedisk.harness.results.schema import row_tolerance
from ninedisk.harness.run.judge import measurement_row
from ninedisk.harness.run.runner import run_case

CASES = ("slip-to-roll", "spinning-disk", "rolling/incline-disk", "rolling/resistance", "incline-block")


@pytest.mark.parametrize("name", CASES)
def test_each_case_has_one_for_engines_without_preload(name: str) -> None:
    case = get_case(name)
    variants = [resolve(case, row) for row in case.matrix()]
    scenes = {
        each.id: case.build(each.params)
        for each in variants
        if not settings_of_other_engines(case, each.params, "spring")
    }
    assert any(Capability.PRELOAD not in capabilities_needed(each.scene, each.numerics) for each in scenes.values())


@pytest.mark.parametrize("name", CASES[:3])
def test_the_swing_that_the_start_leaves_is_allowed_and_little_more(name: str) -> None:
    """The largest error of the velocity, at the phase that samples meet, comes near to its bound: no slack hides there."""
    result = run_case(name, engine="dem", params={"mu": 0.3, "preload": False})
    assert result.status == "pass", result.reason
    rows = {row["quantity"]: row for row in result.rows if row["truth"] == "analytic"}
    assert 0.5 < rows["vx"]["abs_error"] / row_tolerance(rows["vx"]) <= 1.0


@pytest.mark.parametrize(("quantity", "factor"), [("spin", -1.0), ("spin", 1.01), ("vx", 1.01), ("x", 1.01)])
def test_a_wrong_rolling_disk_fails_on_the_incline(quantity: str, factor: float) -> None:
    """A friction torque of the wrong sign turns the spin; one per cent of any rate is seen, too."""
    result = run_case("rolling/incline-disk", engine="dem", params={"mu": 0.3, "preload": False})
    assert result.observed is not None
    unit, values = result.observed.series[quantity]
    wrong = replace(result.observed, series={**result.observed.series, quantity: (unit, factor * values)})
    (check,) = [each for each in result.checks if (each.quantity, each.norm) == (quantity, "max")]
    assert measurement_row({}, check, wrong)["status"] == "fail"


def test_the_closed_form_of_the_swing() -> None:
    """A disk that rolls from no shear force: vx = a t + F0 sin(omega t)/(m omega), by small steps of the equations of motion."""
    ks, force, h, u, fs, vx = 1e6, MASS * 9.81 * math.sin(math.radians(20.0)) / 3.0, 1e-6, 0.0, 0.0, 0.0
    omega, found, times = math.sqrt(3.0 * ks / MASS), [], h * np.arange(1, 20001)
    for _ in times:  # slip u and force fs, semi-implicit
        u += h * (9.81 * math.sin(math.radians(20.0)) - 3.0 * fs / MASS)
        fs += h * ks * u
        vx += h * (9.81 * math.sin(math.radians(20.0)) - fs / MASS)
        found.append(vx)
    exact = 2.0 / 3.0 * 9.81 * math.sin(math.radians(20.0)) * times + force * np.sin(omega * times) / (MASS * omega)
    # First order in the step: omega h of the swing, over the phase that it runs through.
    assert np.abs(np.array(found) - exact).max() < omega * h * omega * times[-1] * force / (MASS * omega)
