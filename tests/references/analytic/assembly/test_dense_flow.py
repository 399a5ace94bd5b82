"""The law of dense flows: its two lines, and its range."""

from __future__ import annotations

import pytest

from ninedisk.references.analytic.assembly.dense_flow import simple_shear


def test_friction_grows_and_the_fraction_falls_with_the_inertial_number() -> None:
    assert simple_shear(inertial_number=0.1) == pytest.approx((0.36, 0.78))
    with pytest.raises(ValueError, match="inertial_number"):
        simple_shear(inertial_number=-1.0)
