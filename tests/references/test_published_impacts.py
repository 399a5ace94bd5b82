"""What was read off Chung & Ooi's figures: where a sphere slides all through the impact, the law of friction alone decides."""

from __future__ import annotations

import numpy as np
import pytest

from ninedisk.references.published_impacts import READINGS, UNCERTAINTY

FOUR, SIX = (0.092, 0.98), (0.4, 0.5)
"""Friction coefficient and restitution."""


def sliding(quantity: str, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where a sphere on a plane slides throughout, with some distance, and what it then does; test 4 has 3.9 m/s and 2.5 mm."""
    tan = np.tan(np.radians(x))
    (mu, e), (rough, soft) = FOUR, SIX
    lost = mu * (1.0 + e) / tan  # of the velocity along the plane
    slide = 3.5 * rough * (1.0 + soft)
    return {
        "tangential_restitution": (x > 39.0, 1.0 - lost),
        "spin": (x > 39.0, -2.5 * mu * (1.0 + e) * 3.9 * np.cos(np.radians(x)) / 0.0025),
        "rebound_angle": (x > 39.0, np.degrees(np.arctan2(tan - 3.5 * lost * tan, e))),
        "slip_scaled": (x > 9.0, x - 7.0),
        "spin_scaled": (x > 9.0, np.full_like(x, -5.0)),
        "surface_restitution": (x < 0.6, x - 1.0),
        "recoil": ((x > 2.7) & (x < 7.0), (x - slide) / soft),
    }[quantity]


@pytest.mark.parametrize("quantity", UNCERTAINTY)
def test_readings_of_sliding_impacts_are_as_sure_as_they_say(quantity):
    """DEM within the reading's error; experiment and finite elements have their own errors, four times as large."""
    farthest = 0.0
    for each in READINGS:
        x, y = np.array(each.x), np.array(each.y)
        assert len(x) == len(y)
        assert (np.diff(x) > 0.0).all()
        if each.quantity == quantity:
            there, expected = sliding(quantity, x)
            assert there.sum() > 1
            off = float(np.abs(y - expected)[there].max())
            if each.name not in ("experiment", "finite elements"):
                farthest = max(farthest, off)
            assert off < 4.0 * UNCERTAINTY[quantity], (each, off)
    assert 0.3 * UNCERTAINTY[quantity] < farthest < UNCERTAINTY[quantity]
