"""Rows in the theta scheme: against two disks, Newton's law for touching rows, and the program's own conditions."""

from __future__ import annotations

import numpy as np
import pytest

from ninedisk.references.analytic.impact.chain import touching_row
from ninedisk.references.exact_steps.chain import chain_theta
from ninedisk.references.exact_steps.impact import collision_step_theta


@pytest.mark.parametrize("theta", [0.5, 0.7, 1.0])
@pytest.mark.parametrize("gap", [0.05, 0.0525, 0.057])
def test_two_disks_are_the_known_collision(theta, gap):
    found = chain_theta(gaps=(gap,), speed=1.0, dt=0.01, theta=theta, restitution=None, n_steps=12)
    known = collision_step_theta(gap=gap, speed=1.0, dt=0.01, theta=theta, n_steps=12, mass_1=1.0, mass_2=1.0)
    np.testing.assert_allclose(found.v, np.column_stack([known.vx_1, known.vx_2]), atol=1e-12)
    np.testing.assert_allclose(found.gap[:, 0], known.gap, atol=1e-14)


@pytest.mark.parametrize("n", [3, 5])
def test_touching_rows_follow_newton_s_law_by_either_impact_law(n):
    for theta in (0.5, 0.8, 1.0):
        e = (1.0 - theta) / theta
        for restitution in (None, e):
            found = chain_theta(
                gaps=(0.0,) * (n - 1), speed=1.0, dt=0.01, theta=theta, restitution=restitution, n_steps=1
            )
            np.testing.assert_allclose(found.v[1], touching_row(n=n, speed=1.0, restitution=e), atol=1e-14)


def test_newton_s_law_hands_the_velocity_on_at_any_phase():
    for gap in (0.05, 0.053, 0.0571):
        found = chain_theta(gaps=(gap,) * 3, speed=1.0, dt=0.01, theta=0.5, restitution=1.0, n_steps=30)
        np.testing.assert_allclose(found.v[-1], [0.0, 0.0, 0.0, 1.0], atol=1e-13)


@pytest.mark.parametrize("restitution", [None, 0.6])
def test_every_step_keeps_momentum_and_its_gaps(restitution):
    found = chain_theta(gaps=(0.013, 0.002, 0.03), speed=1.0, dt=0.01, theta=0.6, restitution=restitution, n_steps=40)
    np.testing.assert_allclose(found.v.sum(axis=1), 1.0, rtol=1e-13)
    assert np.all(np.diff((found.v**2).sum(axis=1)) <= 1e-13)
    path = 0.01 * (0.6 * found.v[1:] + 0.4 * found.v[:-1])
    np.testing.assert_allclose(np.diff(found.gap, axis=0), np.diff(path, axis=1), atol=1e-15)
    assert restitution is not None or found.gap.min() > -1e-13


@pytest.mark.parametrize("change", [{"theta": 0.3}, {"dt": 0.0}, {"gaps": (0.1,) * 8}, {"speed": -1.0}])
def test_impossible_arguments_are_refused(change):
    case = {"gaps": (0.1,), "speed": 1.0, "dt": 0.01, "theta": 0.5, "restitution": None, "n_steps": 1}
    with pytest.raises(ValueError, match="not allowed"):
        chain_theta(**{**case, **change})
