"""When an error got worse."""

from __future__ import annotations

import math
from typing import Any

import pytest

from ninedisk.harness.results.rules import QUIET, judge_errors


def row(error: float, status: str = "pass", rtol: float = 1e-12, scale: float = 2.0) -> dict[str, Any]:
    return {"abs_error": error, "status": status, "atol": 0.0, "rtol": rtol, "scale": scale}


@pytest.mark.parametrize(
    ("base", "head", "verdict"),
    [
        (row(1e-16), row(3e-16), "same"),  # round-off
        (row(0.0), row(1e-15), "same"),  # from exact to round-off
        (row(1e-15), row(1e-13), "same"),  # a hundred times, and still a twentieth of the tolerance
        (row(1e-14), row(2.1 * QUIET * 1e-12), "worse"),  # beyond round-off's share and more than doubled
        (row(1.1e-12), row(1.9e-12), "same"),  # not doubled
        (row(0.3e-12), row(3e-12, "fail"), "worse"),  # ten times, outside
        (row(1.99e-12), row(2.01e-12, "fail"), "worse"),  # hardly more, but the check fails now
        (row(3e-12, "fail"), row(1e-12), "better"),
        (row(3e-12, "fail"), row(3e-12, "fail"), "same"),
        (row(3e-12, "fail"), row(3e-11, "fail"), "worse"),
        (row(1e-12), row(0.2e-12), "better"),
        (row(1e-14), row(1e-16), "same"),
        (row(0.1), row(math.nan, "fail"), "worse"),  # no number any more
        (row(math.nan, "no-truth"), row(math.nan, "no-truth"), "same"),
        (row(5.0, "known-gap"), row(5.0, "gap-closed"), "better"),
        (row(5.0, "known-gap"), row(50.0, "known-gap"), "worse"),
        (row(0.0, rtol=0.0), row(1e-17, "fail", rtol=0.0), "worse"),  # no tolerance at all
        (row(3e-12, "fail"), row(3e-12, rtol=1e-11), "suspect"),  # passes because the tolerance was widened
        (row(1e-13), row(1e-13, rtol=1e-11), "suspect"),
    ],
)
def test_verdicts(base: dict[str, Any], head: dict[str, Any], verdict: str) -> None:
    assert judge_errors(base, head)[0] == verdict


def test_a_changed_tolerance_is_said() -> None:
    assert "tolerance changed from 2e-12 to 2e-11" in judge_errors(row(3e-12, "fail"), row(3e-12, rtol=1e-11))[1]
