"""Contact dynamics against the exact solutions of its own scheme, with every solver."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from ninedisk.core.cd.session import CdSession
from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall
from ninedisk.core.simulate import simulate
from ninedisk.references.exact_steps.impact import collision_step_theta, effective_restitution
from ninedisk.references.exact_steps.incline import associated_incline, coulomb_incline_theta
from ninedisk.references.exact_steps.rolling import associated_rolling
from ninedisk.references.exact_steps.sliding import dynamic_sliding, quasistatic_sliding

SOLVERS = ("auto", "interior-point", "gauss-seidel")
RULES = [(sliding, solver) for sliding in ("associated", "coulomb") for solver in SOLVERS]
ANGLE, G, MASS = math.radians(20.0), 10.0, 7.854

TOLERANCE = 1e-10
"""Of the largest value in a quantity's history: solvers stop at 1e-12, some hundred steps add up their residuals."""


def disk_on_plane(
    *,
    mu: float,
    gap: float = 0.0,
    v: float = 0.0,
    mass: float = MASS,
    gravity: tuple[float, float] = (0.0, 0.0),
    **disk: Any,
) -> Scene:
    law = ContactLaw(kn=1e8, ks=1e8, mu=mu, restitution=0.0, regularised=True)
    return Scene(
        disks=Disks(x=[[0.0, 1.0 + gap]], v=[[v, 0.0]], radius=1.0, mass=mass, **disk),
        disk_disk=law,
        walls=(Wall(name="plane", point=(0.0, 0.0), normal=(0.0, 1.0), law=law),),
        gravity=gravity,
    )


def head_on(gap: float, *, e: float | None = None, masses: tuple[float, float] = (math.pi, math.pi)) -> Scene:
    law = ContactLaw(kn=1e6, restitution=e, regularised=True)
    disks = Disks(x=[[0.0, 0.0], [2.0 + gap, 0.0]], v=[[1.0, 0.0], [0.0, 0.0]], radius=[1.0, 1.0], mass=masses)
    return Scene(disks=disks, disk_disk=law)


def worst(found: dict[str, np.ndarray], steps: Any) -> dict[str, float]:
    """Largest error of each quantity relative to the largest value of its history; ``vy`` to the largest velocity."""
    errors = {}
    for name, values in found.items():
        expected = getattr(steps, name)
        scale = float(np.nanmax(np.abs(steps.vx if name == "vy" else expected)))
        errors[name] = float(np.nanmax(np.abs(values - expected))) / (scale or 1.0)
    return errors


def particle(history: History) -> dict[str, np.ndarray]:
    """Quantities of one disk on a plane; friction is positive up the incline."""
    return {
        "x": history.x[:, 0, 0],
        "vx": history.v[:, 0, 0],
        "vy": history.v[:, 0, 1],
        "gap": history.gap[:, 0],
        "fn": history.fn[:, 0],
        "fs": -history.fs[:, 0],
    }


@pytest.mark.long
@pytest.mark.parametrize("dt", [0.01, 0.0025])
@pytest.mark.parametrize("mu", [0.36, 0.4])
@pytest.mark.parametrize(("sliding", "solver"), RULES)
def test_incline(sliding: Any, solver: str, mu: float, dt: float) -> None:
    """Appendix A.3.4: a hundred steps."""
    scene = disk_on_plane(mu=mu, gravity=(G * math.sin(ANGLE), -G * math.cos(ANGLE)), rotating=False)
    numerics = Numerics(dt=dt, n_steps=100, sliding=sliding, solver=solver)
    history = simulate(scene, numerics, [(0, 1)], method="cd")
    block = {"mu": mu, "angle": ANGLE, "g": G, "mass": MASS, "dt": dt, "n_steps": numerics.n_steps}
    steps = associated_incline(**block) if sliding == "associated" else coulomb_incline_theta(**block, theta=1.0)
    errors = worst(particle(history), steps)
    # A solver stops at 1e-12 of the forces, about m g: steps of 1 s in all leave g 1e-12 of a speed of g times the pull that
    # friction leaves, a small part of g at the smaller mu.
    pull = math.sin(ANGLE) - mu * math.cos(ANGLE)
    assert max(errors.values()) <= max(TOLERANCE, 1e-12 / pull if pull > 0.0 else 0.0), errors
    if mu == 0.4:
        assert np.abs(history.x[:, 0, 0]).max() < 1e-12
        assert history.fn[-1, 0] == pytest.approx(MASS * G * math.cos(ANGLE), rel=1e-11)
        assert history.fs[-1, 0] == pytest.approx(-MASS * G * math.sin(ANGLE), rel=1e-11)


def test_the_sources_statement_on_the_blocks_forces_is_contradicted() -> None:
    """The source prints mg and mu mg; equilibrium asks for mg cos and mu mg cos, 6 % less."""
    scene = disk_on_plane(mu=0.36, gravity=(G * math.sin(ANGLE), -G * math.cos(ANGLE)), rotating=False)
    history = simulate(scene, Numerics(dt=0.01, n_steps=100), [(0, 1)], method="cd")
    assert history.fn[-1, 0] == pytest.approx(73.803458, abs=1e-6)
    assert -history.fs[-1, 0] == pytest.approx(26.569245, abs=1e-6)
    assert abs(history.fn[-1, 0] - MASS * G) > 4.7


@pytest.mark.long
@pytest.mark.parametrize("theta", [0.5, 0.6, 0.75, 1.0])
@pytest.mark.parametrize("solver", SOLVERS)
def test_restitution_over_fifty_gaps(theta: float, solver: str) -> None:
    """e_eff(gap, theta) and momentum; unequal masses in every other run."""
    dt = 0.01
    for k, gap in enumerate(np.linspace(0.0, 0.0497, 50 if solver == "auto" else 10)):
        masses = (math.pi, math.pi) if k % 2 else (2.0, 0.7)
        numerics = Numerics(dt=dt, n_steps=12, theta=theta, solver=solver)
        history = simulate(head_on(float(gap), masses=masses), numerics, [(0, 1)], method="cd")
        v = history.v[:, :, 0]
        e = float(effective_restitution(gap=gap, speed=1.0, dt=dt, theta=theta))
        assert v[-1, 1] - v[-1, 0] == pytest.approx(e, abs=1e-12), gap
        momentum = v @ np.array(masses)
        assert np.abs(momentum / masses[0] - 1.0).max() <= 1e-13
        assert np.abs(history.v[:, :, 1]).max() == 0.0
        steps = collision_step_theta(
            gap=float(gap), speed=1.0, dt=dt, theta=theta, n_steps=12, mass_1=masses[0], mass_2=masses[1]
        )
        assert np.abs(v[:, 0] - steps.vx_1).max() <= 1e-12
        assert np.abs(v[:, 1] - steps.vx_2).max() <= 1e-12
        assert np.nanmax(np.abs(history.fn[:, 0] - steps.fn)) <= 1e-12 * np.nanmax(steps.fn)


@pytest.mark.parametrize("e", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("theta", [0.5, 1.0])
@pytest.mark.parametrize("gap", [0.0, 0.013, 0.05])
def test_newtons_law_whatever_the_phase(e: float, theta: float, gap: float) -> None:
    numerics = Numerics(dt=0.01, n_steps=12, theta=theta, impact="newton")
    history = simulate(head_on(gap, e=e), numerics, method="cd")
    assert history.v[-1, :, 0] == pytest.approx([(1.0 - e) / 2.0, (1.0 + e) / 2.0], abs=1e-14)


def test_one_step_multiplier_of_the_collision() -> None:
    """Appendix A.2: p dt = pi (elastic), pi/2 (plastic)."""
    for theta, impulse in ((0.5, math.pi), (1.0, math.pi / 2.0)):
        history = simulate(head_on(0.5), Numerics(dt=0.01, n_steps=60, theta=theta), [(0, 1)], method="cd")
        assert np.nanmax(history.fn) * 0.01 == pytest.approx(impulse, rel=1e-12)
        assert np.nansum(history.fn) * 0.01 == pytest.approx(impulse, rel=1e-12)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("dt", [0.001, 1.0 / 300.0, 0.005, 0.1])
@pytest.mark.parametrize("g0", [0.0, 0.001])
def test_dynamic_sliding(solver: str, dt: float, g0: float) -> None:
    """(A.4) above dt_cr = 1/300 s, free flight at and below it, and the steps after."""
    scene = disk_on_plane(mu=0.3, gap=g0, v=1.0, mass=math.pi, rotating=False)
    history = simulate(scene, Numerics(dt=dt, n_steps=5, solver=solver), [(0, 1)], method="cd")
    steps = dynamic_sliding(mu=0.3, g0=g0, speed=1.0, dt=dt, mass=math.pi, n_steps=5)
    found = particle(history)
    assert np.abs(found["gap"] - steps.gap).max() <= 1e-14 + TOLERANCE * np.abs(steps.gap).max()
    for name in ("x", "vx", "vy"):
        scale = max(float(np.abs(steps.vx).max()), float(np.abs(steps.x).max()))
        assert np.abs(found[name] - getattr(steps, name)).max() <= TOLERANCE * scale, name
    largest = max(float(np.nanmax(steps.fn)), math.pi / dt)
    assert np.nanmax(np.abs(found["fn"] - steps.fn)) <= TOLERANCE * largest
    assert np.nanmax(np.abs(found["fs"] - steps.fs)) <= TOLERANCE * largest


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("gap_0", [0.0, 1e-4, 5e-4])
@pytest.mark.parametrize("mu", [0.0, 0.3, 1.2])
def test_quasistatic_sliding(solver: str, gap_0: float, mu: float) -> None:
    scene = disk_on_plane(mu=mu, gap=gap_0, v=0.001, gravity=(0.0, -3.0), rotating=False, held=[[True, False]])
    numerics = Numerics(dt=1.0, n_steps=5, regime="quasi-static", solver=solver)
    history = simulate(scene, numerics, [(0, 1)], method="cd")
    load = 3.0 * MASS
    steps = quasistatic_sliding(mu=mu, increment=0.001, n_steps=5, normal_load=load, gap_0=gap_0)
    found = particle(history)
    assert np.abs(found["gap"] - steps.gap).max() <= 1e-14
    assert np.abs(found["x"] - steps.x).max() <= 1e-16 * 10
    assert np.nanmax(np.abs(found["fn"] - load)) <= TOLERANCE * load
    assert np.nanmax(np.abs(found["fs"] - mu * load)) <= TOLERANCE * load


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("rotating", [True, False])
@pytest.mark.parametrize("gap_0", [0.0, 0.003])
def test_slip_to_roll_keeps_a6_in_every_step(solver: str, rotating: bool, gap_0: float) -> None:
    scene = disk_on_plane(mu=0.3, gap=gap_0, v=1.0, mass=math.pi, gravity=(0.0, -10.0), rotating=rotating)
    history = simulate(scene, Numerics(dt=0.01, n_steps=100, solver=solver), [(0, 1)], method="cd")
    ratio = 0.5 if rotating else math.inf
    steps = associated_rolling(
        mu=0.3, g=10.0, mass=math.pi, radius=1.0, inertia_ratio=ratio, speed=1.0, dt=0.01, n_steps=100, gap_0=gap_0
    )
    found = {**particle(history), "spin": -history.omega[:, 0]}
    errors = worst(found, steps)
    assert max(errors.values()) <= TOLERANCE, errors
    assert history.gap[-1, 0] == pytest.approx(0.0, abs=1e-14)
    # (A.6) itself, from the engine's own numbers: where the contact bears, the gap is mu times the slip of the step.
    slip = np.diff(history.x[:, 0, 0]) + np.diff(history.angle[:, 0])
    bears = history.fn[1:, 0] > 1e-6
    residual = history.gap[1:, 0] - 0.3 * np.abs(slip)
    assert np.abs(residual[bears]).max() <= 1e-13
    assert residual.min() >= -1e-13


def test_a_planted_defect_is_seen() -> None:
    """The incline's steps at a friction 1e-6 off are not those of the reference: the check has teeth."""
    scene = disk_on_plane(mu=0.36 * (1 + 1e-6), gravity=(G * math.sin(ANGLE), -G * math.cos(ANGLE)), rotating=False)
    history = simulate(scene, Numerics(dt=0.01, n_steps=100), [(0, 1)], method="cd")
    steps = associated_incline(mu=0.36, angle=ANGLE, g=G, mass=MASS, dt=0.01, n_steps=100)
    assert max(worst(particle(history), steps).values()) > 1e-7


def test_explicit_session_reports_its_solves() -> None:
    session = CdSession(head_on(0.05), Numerics(dt=0.01, n_steps=12, solver="interior-point"))
    session.run()
    assert sum(session.solves.values()) == 12
    assert set(session.solves) == {"interior-point"}
    assert max(session.worst) <= 1e-11
