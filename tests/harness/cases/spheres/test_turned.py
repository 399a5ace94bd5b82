"""Contacts that stick and turn: the DEM's order, and what a force that turns otherwise is off by."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from ninedisk.harness.api.registry import get_case
from ninedisk.harness.engines.dem.adapter import ENGINE as DEM

CASE = get_case("spheres/turned")


@pytest.mark.parametrize(("kind", "ratio"), [("passed", 4.0), ("spun", 4.0)])
def test_the_error_falls_with_the_order_of_the_scheme(run_cell: Any, kind: str, ratio: float) -> None:
    """Second order, also where slip feeds a spring that twists."""
    errors = []
    for steps in (1000, 2000):
        cell = run_cell(CASE, DEM, {"kind": kind, "steps": steps})
        assert cell.failures == []
        errors.append(cell.observed.scalars["astray"][1])
    assert errors[0] / errors[1] == pytest.approx(ratio, rel=0.01)


def test_slip_of_the_end_does_not_twist(run_cell: Any) -> None:
    """That form turns springs with the normal alone: right about an axis across it, and a force that stays behind about another."""
    assert run_cell(CASE, DEM, {"kind": "plane"}, law={"slip_at": "end"}).failures == []
    cell = run_cell(CASE, DEM, {"kind": "plane", "axis": "skew"}, law={"slip_at": "end"})
    assert cell.failures
    # The mean spin about the normal is two thirds of it: 4 pi/3 behind after a turn, a chord of root three.
    assert cell.observed.scalars["astray"][1] == pytest.approx(np.sqrt(3.0), abs=0.06)
