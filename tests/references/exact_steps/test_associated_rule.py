"""Incline and sliding solutions against the step's convex program, solved in rational arithmetic."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np
import pytest
from scipy.optimize import linprog

from ninedisk.references.analytic.on_plane.incline import incline
from ninedisk.references.exact_steps.incline import (
    associated_incline,
    coulomb_incline_theta,
    position_first_euler_incline,
    semi_implicit_euler_incline,
)
from ninedisk.references.exact_steps.sliding import dynamic_sliding, quasistatic_sliding

BLOCK = {"angle": math.radians(20.0), "g": 10.0, "mass": 7.854}


class Body(NamedTuple):
    """Position, gap, velocities and the last contact forces."""

    x: Fraction
    gap: Fraction
    vx: Fraction
    vy: Fraction
    p: Fraction
    q: Fraction


def program_step(body: Body, *, mass: Fraction, dt: Fraction, mu: Fraction, force: tuple[Fraction, Fraction]) -> Body:
    """Minimise ``1/2 Mbar |d|^2 - d.(force + M v/dt)`` subject to ``gap + dy >= mu |dx|``, the dual of Coulomb's cone.

    Every active set is tried: none, either side, both (stick at gap 0).
    """
    mbar = mass / dt**2
    free = [(f + mass * v / dt) / mbar for f, v in zip(force, (body.vx, body.vy), strict=True)]
    candidates = [(free[0], free[1]), (Fraction(0), -body.gap)]
    for side in (1, -1):
        excess = (body.gap + free[1] - side * mu * free[0]) / (1 + mu**2)
        candidates.append((free[0] + side * mu * excess, free[1] - excess))
    allowed = [d for d in candidates if body.gap + d[1] >= mu * abs(d[0])]
    dx, dy = min(allowed, key=lambda d: (d[0] - free[0]) ** 2 + (d[1] - free[1]) ** 2)
    return Body(body.x + dx, body.gap + dy, dx / dt, dy / dt, mbar * (dy - free[1]), mbar * (free[0] - dx))


def history(body: Body, *, n_steps: int, **step) -> dict[str, np.ndarray]:
    states = [body]
    for _ in range(n_steps):
        states.append(program_step(states[-1], **step))
    x, gap, vx, vy, p, q = (np.array(column, dtype=float) for column in zip(*states, strict=True))
    p[0] = q[0] = np.nan
    return {"x": x, "gap": gap, "vx": vx, "vy": vy, "fn": p, "fs": q}


def assert_equal_histories(ours, exact: dict[str, np.ndarray], rtol: float) -> None:
    for name, values in exact.items():
        mine = getattr(ours, name)
        assert np.array_equal(np.isnan(mine), np.isnan(values)), name
        scale = np.nanmax(np.abs(values))
        assert np.nanmax(np.abs(mine - values)) <= rtol * scale, name


@pytest.mark.parametrize(("mu", "angle_deg"), [(0.36, 20.0), (0.0, 20.0), (0.9, 60.0), (0.4, 20.0), (3.0, 10.0)])
def test_incline_solves_the_program_of_every_step(mu: float, angle_deg: float) -> None:
    angle, n = math.radians(angle_deg), 40
    # sin and cos to 1e-18 or better from extended precision, as exact fractions.
    sine, cosine = (Fraction(*f(np.longdouble(angle)).as_integer_ratio()) for f in (np.sin, np.cos))
    mass, weight = Fraction(7.854), Fraction(7.854) * 10
    start = Body(*[Fraction(0)] * 6)
    exact = history(
        start, n_steps=n, mass=mass, dt=Fraction(0.01), mu=Fraction(mu), force=(weight * sine, -weight * cosine)
    )
    ours = associated_incline(mu=mu, angle=angle, g=10.0, mass=7.854, dt=0.01, n_steps=n)
    assert_equal_histories(ours, exact, rtol=1e-15)


@pytest.mark.parametrize(
    ("dt", "x", "v", "gap"),
    [
        (0.01, 0.018792251, 0.037259647, 1.341347e-4),
        (0.005, 0.018723109, 0.037283823, 6.711088e-5),
        (0.0025, 0.018688550, 0.037295911, 3.356632e-5),
    ],
)
def test_incline_table(dt: float, x: float, v: float, gap: float) -> None:
    steps = associated_incline(mu=0.36, **BLOCK, dt=dt, n_steps=round(1 / dt))
    assert steps.x[-1] == pytest.approx(x, abs=5e-10)  # half a unit of the last digit
    assert steps.vx[-1] == pytest.approx(v, abs=5e-10)
    assert steps.gap[-1] == pytest.approx(gap, rel=5e-7)
    assert steps.fn[-1] == pytest.approx(73.803458, abs=1e-6)
    assert steps.fs[-1] == pytest.approx(26.569245, abs=1e-6)


def test_incline_sticks_above_the_critical_friction() -> None:
    steps = associated_incline(mu=0.4, **BLOCK, dt=0.01, n_steps=100)
    assert not np.any([steps.x, steps.vx, steps.gap, steps.vy])
    assert steps.fs[1:] == pytest.approx(26.862262, abs=1e-6)


def theta_steps(theta: float, n: int, a: Fraction, dt: Fraction) -> list[Fraction]:
    x, v, out = Fraction(0), Fraction(0), [Fraction(0)]
    for _ in range(n):
        new = v + a * dt
        x += dt * (Fraction(theta) * new + (1 - Fraction(theta)) * v)
        v = new
        out.append(x)
    return out


@pytest.mark.parametrize(
    ("steps", "theta"),
    [
        (lambda **k: coulomb_incline_theta(theta=0.5, **k), 0.5),
        (lambda **k: coulomb_incline_theta(theta=0.75, **k), 0.75),
        (lambda **k: coulomb_incline_theta(theta=1.0, **k), 1.0),
        (semi_implicit_euler_incline, 1.0),
        (position_first_euler_incline, 0.0),
    ],
)
def test_schemes_without_dilation_are_sums_of_their_steps(steps, theta: float) -> None:
    n, dt = 50, 0.01
    ours = steps(mu=0.36, **BLOCK, dt=dt, n_steps=n)
    angle = np.longdouble(BLOCK["angle"])
    a = 10 * (
        Fraction(*np.sin(angle).as_integer_ratio()) - Fraction(0.36) * Fraction(*np.cos(angle).as_integer_ratio())
    )
    exact = np.array(theta_steps(theta, n, a, Fraction(dt)), dtype=float)
    assert np.abs(ours.x - exact).max() <= 1e-15 * exact.max()
    truth = incline(dt * np.arange(n + 1), mu=0.36, **BLOCK)
    # The continuous closed form is in double precision; a/g = 0.0037 costs it two digits.
    assert ours.vx == pytest.approx(truth.vx, rel=1e-12)
    assert ours.fn[1:] == pytest.approx(truth.fn[1:], rel=1e-14)
    assert ours.fs[1:] == pytest.approx(truth.fs[1:], rel=1e-14)
    t = dt * np.arange(1, n + 1)
    assert ours.x[1:] == pytest.approx(truth.x[1:] * (1.0 + (2.0 * theta - 1.0) * dt / t), rel=1e-12)


def test_incline_names_bad_values() -> None:
    with pytest.raises(ValueError, match=r"angle = 20.0 rad .* degrees must be converted"):
        associated_incline(mu=0.36, angle=20.0, g=10.0, mass=1.0, dt=0.01, n_steps=1)
    with pytest.raises(ValueError, match=r"mu = -0\.1"):
        semi_implicit_euler_incline(mu=-0.1, **BLOCK, dt=0.01, n_steps=1)


@pytest.mark.parametrize("dt", [0.001, 0.0039, 0.0041, 0.01, 0.1])
@pytest.mark.parametrize("mu", [0.5, 2.0])
def test_dynamic_sliding_solves_the_program_of_every_step(dt: float, mu: float) -> None:
    g0 = 0.004 * mu * 1.5  # critical step 0.004
    zero = Fraction(0)
    start = Body(zero, Fraction(g0), Fraction(1.5), zero, zero, zero)
    exact = history(start, n_steps=6, mass=Fraction(2), dt=Fraction(dt), mu=Fraction(mu), force=(zero, zero))
    ours = dynamic_sliding(mu=mu, g0=g0, speed=1.5, dt=dt, mass=2.0, n_steps=6)
    for name, values in exact.items():
        scale = max(np.nanmax(np.abs(values)), 1e-300)
        assert np.nanmax(np.abs(getattr(ours, name) - values)) <= 1e-15 * scale, name
    assert (ours.gap[1] > g0) == (dt > 0.004)


def test_dynamic_sliding_from_touch_always_dilates() -> None:
    ours = dynamic_sliding(mu=0.5, g0=0.0, speed=1.0, dt=1e-6, mass=1.0, n_steps=3)
    assert ours.gap[1] == pytest.approx(0.5e-6 / 1.25, rel=1e-15)
    assert ours.gap[1] == pytest.approx(0.5 * ours.x[1], rel=1e-15)
    assert np.all(np.diff(ours.gap) > 0.0)
    assert np.all(ours.fn[2:] == 0.0)


@pytest.mark.parametrize(("increment", "gap_0"), [(0.01, 0.0), (-0.01, 0.0), (0.01, 0.02), (0.01, 0.003)])
def test_quasistatic_sliding_solves_its_linear_program(increment: float, gap_0: float) -> None:
    mu, load, n = 0.4, 3.0, 4
    ours = quasistatic_sliding(mu=mu, increment=increment, n_steps=n, normal_load=load, gap_0=gap_0)
    gap = gap_0
    for step in range(1, n + 1):
        # Static limit: minimise load * dy subject to gap + dy >= mu |increment|.
        found = linprog([load], A_ub=[[-1.0]], b_ub=[gap - mu * abs(increment)], bounds=[(None, None)])
        gap += found.x[0]
        assert ours.gap[step] == pytest.approx(gap, abs=1e-15)
        assert ours.fn[step] == pytest.approx(-found.ineqlin.marginals[0], rel=1e-12)
    assert ours.x[-1] == pytest.approx(n * increment)
    assert ours.fs[1:] == pytest.approx(mu * load)


def test_quasistatic_sliding_needs_a_load() -> None:
    with pytest.raises(ValueError, match=r"normal_load = 0\.0"):
        quasistatic_sliding(mu=0.4, increment=0.01, n_steps=1, normal_load=0.0)
