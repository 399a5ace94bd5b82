"""(A.4) and (A.5) against the linear system (A.3)."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ninedisk.references.analytic.on_plane.sliding import critical_dt, normal_displacement_as_printed


@pytest.mark.parametrize("dt", [0.001, 0.01, 0.1])
def test_printed_rise_solves_the_printed_equations(dt: float) -> None:
    mu, g0, v, m = 0.4, 0.002, 1.2, 3.0
    # Unknowns du_x, du_y, p, q, lambda of (A.3).
    matrix = [
        [m, 0, 0, dt**2, 0],
        [0, m, -(dt**2), 0, 0],
        [0, 0, -mu, 1, 0],
        [1, 0, 0, 0, -1],
        [0, 1, 0, 0, -mu],
    ]
    du_y, p = np.linalg.solve(matrix, [m * v * dt, 0, 0, 0, -g0])[1:3]
    keys = {"mu": mu, "speed": v, "dt": dt, "g0": g0}
    assert normal_displacement_as_printed(**keys) == pytest.approx(du_y, rel=1e-12)
    assert (p < 0.0) == (dt < critical_dt(mu=mu, speed=v, g0=g0))


def test_critical_step_is_where_the_rise_vanishes() -> None:
    dt = critical_dt(mu=0.4, speed=1.2, g0=0.002)
    assert normal_displacement_as_printed(mu=0.4, speed=1.2, dt=dt, g0=0.002) == pytest.approx(0.0, abs=1e-18)
    assert critical_dt(mu=0.0, speed=1.2, g0=0.002) == math.inf
