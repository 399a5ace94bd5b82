"""Linear cohesion: the table's number, the equation of motion integrated by itself, the limits of no cohesion and of capture."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ninedisk.references.analytic.impact.cohesion import cohesive_contact, cohesive_rebound, is_captured


def test_half_of_the_spring_makes_of_restitution_one_half_a_good_third():
    beta = math.log(2.0) / math.hypot(math.pi, math.log(2.0))  # exp(-pi beta/sqrt(1 - beta^2)) = 1/2
    plain = cohesive_rebound(kn=4.0, cohesion=0.0, beta=beta, m_eff=1.0, speed=1.0)
    assert plain.restitution == pytest.approx(0.5, rel=1e-14)
    assert cohesive_rebound(kn=4.0, cohesion=2.0, beta=beta, m_eff=1.0, speed=1.0).restitution == pytest.approx(
        0.3660, abs=5e-5
    )


@pytest.mark.parametrize("beta", [0.0, 0.3, 0.7, 1.5])
def test_closed_form_solves_the_equation_of_motion(beta):
    kn, share, mass, speed = 15.0, 0.4, 1.3, 0.8
    given = {"kn": kn, "cohesion": share * kn, "beta": beta, "m_eff": mass, "speed": speed}
    damping = 2.0 * beta * math.sqrt(mass * kn)

    def rates(_, state):
        return [state[1], -((1.0 - share) * kn * state[0] + damping * state[1]) / mass]

    def parts(_, state):
        return state[0]

    def turns(_, state):
        return state[1]

    parts.terminal, parts.direction, turns.direction = True, -1.0, -1.0
    run = solve_ivp(
        rates,
        (0.0, 6.0),
        [0.0, speed],
        method="DOP853",
        rtol=1e-12,
        atol=1e-14,
        events=(parts, turns),
        dense_output=True,
    )
    if is_captured(kn=kn, cohesion=share * kn, beta=beta):
        assert run.status == 0
        with pytest.raises(ValueError, match="beta"):
            cohesive_rebound(**given)
    else:
        found = cohesive_rebound(**given)
        assert found.deepest == pytest.approx(run.sol(run.t_events[1][0])[0], rel=1e-8)
        assert found.duration == pytest.approx(run.t_events[0][0], rel=1e-8)
        assert found.restitution == pytest.approx(-run.y[1, -1] / speed, rel=1e-8)
    t = np.linspace(0.0, 0.95 * run.t[-1], 20)
    history = cohesive_contact(t, **given)
    states = run.sol(t)
    assert history.overlap == pytest.approx(states[0], abs=1e-9)
    assert history.fn == pytest.approx((1.0 - share) * kn * states[0] + damping * states[1], abs=1e-7)


def test_after_the_contact_bodies_part_uniformly():
    given = {"kn": 10.0, "cohesion": 4.0, "beta": 0.1, "m_eff": 1.0, "speed": 2.0}
    found = cohesive_rebound(**given)
    after = cohesive_contact(found.duration + np.array([1e-9, 1.0]), **given)
    assert after.rate == pytest.approx([-2.0 * found.restitution] * 2, rel=1e-12)
    assert after.overlap[1] == pytest.approx(-2.0 * found.restitution, rel=1e-12)
    assert (after.fn == 0.0).all()


def test_attraction_beyond_the_spring_is_refused():
    with pytest.raises(ValueError, match="cohesion"):
        cohesive_rebound(kn=1.0, cohesion=1.0, beta=0.1, m_eff=1.0, speed=1.0)
