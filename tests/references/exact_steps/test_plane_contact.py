"""One contact in the theta scheme: against the special cases that are known, and the program's own conditions."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from ninedisk.references.exact_steps.impact import effective_restitution
from ninedisk.references.exact_steps.plane_contact import plane_contact_theta
from ninedisk.references.exact_steps.rolling import associated_rolling

BASE = {
    "radius": 1.0, "inertia_ratio": 0.5, "gap": 0.0, "velocity": (1.0, 0.0), "spin": 0.0, "g": 10.0,
    "mu": 0.3, "dt": 0.01, "theta": 1.0, "restitution": None, "dilates": True, "n_steps": 40,
}  # fmt: skip


def test_theta_1_is_the_rolling_of_the_associated_rule():
    found = plane_contact_theta(**BASE)
    known = associated_rolling(mu=0.3, g=10.0, mass=3.0, radius=1.0, inertia_ratio=0.5, speed=1.0, dt=0.01, n_steps=40)
    for name in ("x", "vx", "gap", "vy", "spin"):
        np.testing.assert_allclose(getattr(found, name), getattr(known, name), rtol=0, atol=1e-16)


@pytest.mark.parametrize("theta", [0.5, 0.6, 1.0])
@pytest.mark.parametrize("gap", [0.05, 0.0525, 0.057])
def test_a_head_on_impact_has_the_restitution_of_its_phase(theta, gap):
    found = plane_contact_theta(**{**BASE, "velocity": (0.0, -1.0), "gap": gap, "g": 0.0, "theta": theta})
    assert found.vy[-1] == pytest.approx(
        float(effective_restitution(gap=gap, speed=1.0, dt=0.01, theta=theta)), abs=1e-13
    )
    assert np.all(found.vx == 0.0)


def test_newton_s_restitution_does_not_depend_on_the_phase():
    for gap in (0.05, 0.0525, 0.057):
        steps = plane_contact_theta(
            **{**BASE, "velocity": (0.0, -1.0), "gap": gap, "g": 0.0, "theta": 0.5, "restitution": 0.7}
        )
        assert steps.vy[-1] == pytest.approx(0.7, rel=1e-14)


def test_theta_s_impact_law_acts_along_the_plane_as_well():
    steps = plane_contact_theta(
        **{**BASE, "velocity": (0.5, -1.0), "g": 0.0, "theta": 0.5, "mu": 5.0, "dilates": False}
    )
    assert steps.vx[-1] - steps.spin[-1] == pytest.approx(
        -0.5, rel=1e-12
    )  # (1 - theta)/theta = 1: the slip turns round


@pytest.mark.parametrize(("dilates", "restitution"), list(itertools.product([True, False], [None, 0.5])))
def test_every_impact_meets_the_conditions_of_its_program(dilates, restitution):
    theta, mu, dt = 0.6, 0.3, 0.01
    for vt in (0.2, 3.0):
        case = {**BASE, "velocity": (vt, -1.0), "gap": 0.0, "g": 0.0, "theta": theta, "n_steps": 1}
        steps = plane_contact_theta(**{**case, "dilates": dilates, "restitution": restitution})
        normal, shear = steps.vy[1] + 1.0, vt - steps.vx[1]
        slip = steps.vx[1] - steps.spin[1]
        back = (1.0 - theta) / theta if restitution is None else 0.0
        un = steps.vy[1] - (back if restitution is None else restitution)
        ut = slip + back * vt
        assert abs(shear) <= mu * normal + 1e-15
        assert un == pytest.approx(mu * abs(ut) if dilates else 0.0, abs=1e-15)
        assert abs(ut) < 1e-15 or shear == pytest.approx(mu * normal * np.sign(ut), rel=1e-14)
        assert steps.spin[1] == pytest.approx(2.0 * shear, rel=1e-14)
        assert steps.gap[1] == pytest.approx(dt * (theta * steps.vy[1] - (1.0 - theta)), abs=1e-17)


@pytest.mark.parametrize(
    "change", [{"theta": 0.4}, {"dt": 0.0}, {"mu": -1.0}, {"restitution": 1.5}, {"inertia_ratio": 0.0}]
)
def test_impossible_arguments_are_refused(change):
    with pytest.raises(ValueError, match=r"is not allowed"):
        plane_contact_theta(**{**BASE, **change})
