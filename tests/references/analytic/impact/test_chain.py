"""Rows of disks: hand calculations, conservation, and springs against a step-by-step integration."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ninedisk.references.analytic.impact.chain import chain_of_collisions, chain_of_springs, touching_row
from ninedisk.references.analytic.impact.spring_dashpot import contact_duration, restitution_of_beta

MASS, KN = 2.0, 1e5


def test_an_elastic_row_with_gaps_hands_the_velocity_on():
    found = chain_of_collisions(gaps=(0.1, 0.2, 0.3), speed=2.0, restitution=1.0)
    np.testing.assert_allclose(found.t, [0.0, 0.05, 0.15, 0.3], rtol=1e-14)
    np.testing.assert_allclose(found.v[-1], [0.0, 0.0, 0.0, 2.0], atol=1e-15)
    np.testing.assert_allclose(
        found.velocities([0.0, 0.1, 0.2]), [[2, 0, 0, 0], [0, 2, 0, 0], [0, 0, 2, 0]], atol=1e-15
    )


def test_a_dissipative_row_by_hand():
    # e = 1/2: (1, 0, 0) -> (1/4, 3/4, 0) -> (1/4, 3/16, 9/16), and disk 1 meets disk 2 once more: relative 1/16.
    found = chain_of_collisions(gaps=(0.1, 0.1), speed=1.0, restitution=0.5)
    np.testing.assert_allclose(found.v[2], [1 / 4, 3 / 16, 9 / 16], rtol=1e-14)
    np.testing.assert_allclose(found.v[3], [1 / 4 - 0.75 / 16, 3 / 16 + 0.75 / 16, 9 / 16], rtol=1e-14)


@pytest.mark.parametrize("e", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("n", [2, 3, 5])
def test_newton_s_law_at_all_contacts(n, e):
    v = touching_row(n=n, speed=1.5, restitution=e)
    assert v.sum() == pytest.approx(1.5, rel=1e-14)
    np.testing.assert_allclose(np.diff(v), [e * 1.5, *([0.0] * (n - 2))], atol=1e-15)
    assert e < 1.0 or (v**2).sum() == pytest.approx(2.25, rel=1e-14)


@pytest.mark.parametrize("beta", [0.0, 0.2, 1.0, 3.0])
def test_two_disks_are_the_known_contact(beta):
    found, end = chain_of_springs(gaps=(0.1,), speed=1.0, mass=MASS, kn=KN, beta=beta)
    e = restitution_of_beta(beta)
    np.testing.assert_allclose(found.v[-1], [(1 - e) / 2, (1 + e) / 2], atol=1e-10)
    assert end - 0.1 == pytest.approx(contact_duration(kn=KN, m_eff=MASS / 2, beta=beta), rel=1e-8)


def test_three_touching_disks_on_springs_by_their_modes():
    """Until the first contact ends the row has modes with omega^2 = k/m and 3 k/m."""
    found, _ = chain_of_springs(gaps=(0.0, 0.0), speed=1.0, mass=1.0, kn=1.0)
    t = found.t[1]
    slow, fast = 0.5 * math.cos(t), math.cos(math.sqrt(3.0) * t) / 6.0
    np.testing.assert_allclose(found.v[1], [1 / 3 + slow + fast, 1 / 3 - 2.0 * fast, 1 / 3 - slow + fast], atol=1e-11)
    assert found.x[1, 0] == pytest.approx(found.x[1, 1], abs=1e-11)


def integrated(gaps, beta, t_end, n=30_000):
    rub, dt = 2.0 * beta * math.sqrt(0.5 * MASS * KN), t_end / n
    x = np.concatenate(([0.0], np.cumsum(gaps)))
    v = np.zeros(len(x))
    v[0] = 1.0
    for _ in range(n):
        overlap, rate = x[:-1] - x[1:], v[:-1] - v[1:]
        push = np.where(overlap > 0.0, np.maximum(KN * overlap + rub * rate, 0.0), 0.0) / MASS
        v = v + dt * np.diff(push, prepend=0.0, append=0.0) * -1.0
        x = x + dt * v
    return v


@pytest.mark.long
@pytest.mark.parametrize(
    ("gaps", "beta"), [((0.0, 0.0), 0.0), ((0.0,) * 4, 0.0), ((2e-4, 1e-4), 0.0), ((0.0, 0.0), 0.3)]
)
def test_springs_are_those_of_a_step_by_step_integration(gaps, beta):
    found, end = chain_of_springs(gaps=gaps, speed=1.0, mass=MASS, kn=KN, beta=beta)
    np.testing.assert_allclose(found.v[-1], integrated(gaps, beta, 1.1 * end), atol=2e-5 if beta == 0.0 else 2e-4)
    assert found.v.sum(axis=1) == pytest.approx(np.ones(len(found.t)), rel=1e-10)
    if beta == 0.0:
        assert (found.v[-1] ** 2).sum() == pytest.approx(1.0, rel=1e-9)
    assert np.all(np.diff(found.v[-1]) >= -1e-12)  # all have parted


def test_touching_springs_do_not_depend_on_stiffness():
    one, _ = chain_of_springs(gaps=(0.0,) * 3, speed=1.0, mass=1.0, kn=1e3)
    two, _ = chain_of_springs(gaps=(0.0,) * 3, speed=4.0, mass=3.0, kn=1e8)
    np.testing.assert_allclose(4.0 * one.v[-1], two.v[-1], atol=1e-9)


@pytest.mark.parametrize(
    "call",
    [
        lambda: chain_of_collisions(gaps=(0.0, 0.1), speed=1.0, restitution=1.0),
        lambda: chain_of_collisions(gaps=(0.1,), speed=1.0, restitution=1.1),
        lambda: touching_row(n=1, speed=1.0, restitution=1.0),
        lambda: chain_of_springs(gaps=(-0.1,), speed=1.0, mass=1.0, kn=1.0),
    ],
)
def test_impossible_arguments_are_refused(call):
    with pytest.raises(ValueError, match="not allowed"):
        call()
