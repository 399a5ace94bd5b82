"""(A.7) against integration and the exact values of the block."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ninedisk.references.analytic.on_plane.incline import acceleration, critical_mu, incline

ANGLE = math.radians(20.0)


def test_values_of_the_sliding_block() -> None:
    h = incline([0.0, 1.0], mu=0.36, angle=ANGLE, g=10.0, mass=7.854)
    assert h.vx[1] == pytest.approx(0.037307998, abs=5e-10)
    assert h.x[1] == pytest.approx(0.018653999, abs=5e-10)
    assert h.fn[1] == pytest.approx(73.803458, abs=5e-7)
    assert h.fs[1] == pytest.approx(26.569245, abs=5e-7)


@pytest.mark.parametrize("mu", [0.0, 0.2, 0.36])
def test_equals_the_integrated_balance_of_forces(mu: float) -> None:
    t = np.linspace(0.0, 2.0, 11)
    h = incline(t, mu=mu, angle=ANGLE, g=10.0, mass=3.0)
    run = solve_ivp(
        lambda _, y: [y[1], (3.0 * 10.0 * math.sin(ANGLE) - h.fs[0]) / 3.0], (0.0, 2.0), [0.0, 0.0], t_eval=t
    )
    assert h.x == pytest.approx(run.y[0], abs=1e-12)
    assert h.vx == pytest.approx(run.y[1], abs=1e-12)
    assert h.fs == pytest.approx(mu * h.fn, rel=1e-15)


def test_sticking_block_is_in_equilibrium() -> None:
    h = incline([0.0, 5.0], mu=0.4, angle=ANGLE, g=10.0, mass=7.854)
    assert not np.any([h.x, h.vx])
    assert h.fs == pytest.approx(26.862262, abs=5e-7)
    assert np.hypot(h.fn, h.fs) == pytest.approx(78.54, rel=1e-14)
    assert np.all(h.fs <= 0.4 * h.fn)


def test_critical_friction_separates_the_branches() -> None:
    mu = critical_mu(angle=ANGLE)
    assert mu == pytest.approx(0.364, abs=5e-4)
    assert acceleration(mu=mu * (1 + 1e-12), angle=ANGLE, g=10.0) == 0.0
    # Just below, a = g cos (tan - mu) without cancellation.
    assert acceleration(mu=mu - 1e-9, angle=ANGLE, g=10.0) == pytest.approx(1e-8 * math.cos(ANGLE), rel=1e-6)


def test_degrees_are_refused() -> None:
    with pytest.raises(ValueError, match=r"angle = 20.0 rad"):
        critical_mu(angle=20.0)
