"""Restitution, duration and history of the damped contact against integration up to the zero of the force."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ninedisk.references.analytic.impact.spring_dashpot import (
    beta_of_restitution,
    contact_duration,
    contact_history,
    restitution_of_beta,
)

BETAS = [0.01, 0.3, 0.7, 1.0, 1.7, 6.0]


@pytest.mark.parametrize("beta", BETAS)
def test_equals_the_integrated_contact(beta: float) -> None:
    kn, m_eff, speed = 200.0, 0.5, 0.7
    omega, c = math.sqrt(kn / m_eff), 2.0 * beta * math.sqrt(m_eff * kn)

    def force(_: float, y: np.ndarray) -> float:
        return kn * y[0] + c * y[1]

    force.terminal, force.direction = True, -1.0
    run = solve_ivp(
        lambda t, y: [y[1], -force(t, y) / m_eff], (0.0, 10.0 / omega), [0.0, speed], events=force, rtol=1e-12,
        atol=1e-15, dense_output=True,
    )  # fmt: skip
    end = run.t_events[0][0]
    assert contact_duration(kn=kn, m_eff=m_eff, beta=beta) == pytest.approx(end, rel=1e-9)
    assert restitution_of_beta(beta) == pytest.approx(-run.y_events[0][0][1] / speed, rel=1e-8)
    t = np.linspace(0.0, end * (1 - 1e-9), 40)
    delta, rate, fn = contact_history(t, kn=kn, m_eff=m_eff, beta=beta, speed=speed)
    y = run.sol(t)
    assert delta == pytest.approx(y[0], abs=1e-9 * np.abs(y[0]).max())
    assert rate == pytest.approx(y[1], abs=1e-9 * speed)
    assert fn == pytest.approx(force(0.0, y), abs=1e-8 * np.abs(fn).max())


def test_after_the_contact_the_bodies_part_uniformly() -> None:
    keys = {"kn": 200.0, "m_eff": 0.5, "beta": 0.4}
    end = contact_duration(**keys)
    t = end + np.array([0.0, 0.1, 0.2])
    delta, rate, fn = contact_history(t, **keys, speed=2.0)
    assert not fn.any()
    assert rate == pytest.approx(-2.0 * restitution_of_beta(0.4))
    assert np.diff(delta) == pytest.approx(0.1 * rate[0])
    before, _, _ = contact_history([end * (1 - 1e-12)], **keys, speed=2.0)
    assert delta[0] == pytest.approx(before[0], rel=1e-9)
    assert delta[0] > 0.0


def literature(beta: float) -> float:
    s = math.sqrt(abs(1.0 - beta**2))
    if beta < 1.0:
        return math.exp(-beta / s * (math.pi - math.atan2(2.0 * beta * s, 1.0 - 2.0 * beta**2)))
    return math.exp(-beta / s * math.log((beta + s) / (beta - s))) if beta > 1.0 else math.exp(-2.0)


@pytest.mark.parametrize("beta", [0.0, *BETAS, 20.0])
def test_equals_the_literature_form(beta: float) -> None:
    # beta - s cancels in the literature's form: 20 loses three digits.
    assert restitution_of_beta(beta) == pytest.approx(literature(beta), rel=1e-12)


@pytest.mark.parametrize("offset", [-1e-2, -1e-5, -1e-9, -1e-13, 1e-15, 1e-12, 1e-7, 1e-3])
def test_stays_accurate_near_critical_damping(offset: float) -> None:
    beta = 1.0 + offset
    u = 1 - Fraction(beta)
    # (1 - b^2) h' = b h - 1 gives h = sum c_k u^k with c_k = k/(2 k + 1) c_{k-1}.
    term, h = Fraction(1), Fraction(1)
    for k in range(1, 12):
        term *= u * Fraction(k, 2 * k + 1)
        h += term
    assert restitution_of_beta(beta) == pytest.approx(math.exp(-2.0 * beta * float(h)), rel=2e-15)


@pytest.mark.parametrize("e", [1e-200, 1e-6, 0.01, math.exp(-2.0), 0.5, 0.99, 1.0 - 1e-12, 1.0])
def test_beta_of_restitution_is_the_inverse(e: float) -> None:
    beta = beta_of_restitution(e)
    assert restitution_of_beta(beta) == pytest.approx(e, rel=1e-12)
    if e == 1.0:
        assert beta == 0.0
    elif e > 0.99:
        assert beta == pytest.approx((1.0 - e) / math.pi, rel=1e-3)  # e = 1 - pi beta for a small beta


def test_strong_damping_tends_to_its_limit() -> None:
    assert restitution_of_beta(1e6) * 4e12 == pytest.approx(1.0, rel=1e-9)


@pytest.mark.parametrize("e", [0.0, -0.1, 1.5, math.nan])
def test_unreachable_restitution_names_the_remedy(e: float) -> None:
    with pytest.raises(ValueError, match=r"must lie in \(0, 1\].*choose a small e such as 0.001 \(beta = 15.7\)"):
        beta_of_restitution(e)
    assert beta_of_restitution(0.001) == pytest.approx(15.7, abs=0.05)


def test_negative_damping_is_named() -> None:
    with pytest.raises(ValueError, match=r"beta = -0\.1"):
        restitution_of_beta(-0.1)
