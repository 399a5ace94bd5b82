"""The Siconos adapter: what it claims, and that what Siconos computes is the scene that was sent.

Runs of the real Siconos are held against exact time-discrete solutions and closed forms; they are skipped only where
Siconos is absent.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from ninedisk.core.errors import InvalidNumericsError
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall, WallSegment
from ninedisk.harness import run_case
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.engine import EngineError, EngineNotInstalledError, SupportLevel
from ninedisk.harness.api.support import NOTE_PRELOAD, NOTE_RESTITUTION
from ninedisk.harness.engines import process
from ninedisk.harness.engines.siconos import adapter as siconos
from ninedisk.harness.engines.siconos.adapter import NOTE_THETA, Siconos, installed_siconos
from ninedisk.references.analytic.on_plane.slip_to_roll import slip_to_roll
from ninedisk.references.exact_steps.incline import coulomb_incline_theta

VERSION, REASON = installed_siconos(process.SYSTEM_PYTHON)
needs_siconos = pytest.mark.skipif(VERSION is None, reason=f"Siconos is not installed ({REASON}): {siconos.INSTALL}")

ROUND_OFF = 1e-13
"""Some hundred steps of sums of a few terms each, half a unit in the last place per term."""

SOLVED = 1e-11
"""Relative to the size of forces and velocities: ten times the tolerance of the contact solver, for several contacts."""


def rigid(mu: float = 0.0, restitution: float | None = 0.0) -> ContactLaw:
    return ContactLaw(kn=1e8, ks=1e8, mu=mu, beta=1.0, restitution=restitution, regularised=True)


def one_disk(
    law: ContactLaw,
    *,
    v: tuple[float, float] = (0.0, 0.0),
    omega: float = 0.0,
    rotating: bool = True,
    gravity: tuple[float, float] = (0.0, -10.0),
    gap: float = 0.0,
    motion: tuple[WallSegment, ...] = (),
    xi: float = 0.0,
) -> Scene:
    disks = Disks(x=[(0.0, 0.5 + gap)], radius=0.5, mass=3.0, v=[v], omega=omega, rotating=rotating)  # type: ignore[arg-type]
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law, motion=motion)
    return Scene(disks=disks, disk_disk=law, walls=(floor,), gravity=gravity, xi=xi)


def numerics(dt: float, n_steps: int, options: Mapping[str, object] | None = None) -> Numerics:
    return Numerics(dt=dt, n_steps=n_steps, options=options or {})


@needs_siconos
@pytest.mark.parametrize("theta", [0.5, 0.75, 1.0])
@pytest.mark.parametrize("mu", [0.36, 0.4])
def test_block_on_an_incline_is_the_exact_theta_scheme(mu: float, theta: float) -> None:
    angle, g, dt, n = np.radians(20.0), 10.0, 0.01, 100
    scene = one_disk(rigid(mu), rotating=False, gravity=(g * np.sin(angle), -g * np.cos(angle)))
    history = Siconos().run(scene, numerics(dt, n, {"siconos.theta": theta}), [(0, 1)]).history
    exact = coulomb_incline_theta(mu=mu, angle=angle, g=g, mass=3.0, dt=dt, n_steps=n, theta=theta)
    assert history.x[:, 0, 0] == pytest.approx(exact.x, rel=0, abs=ROUND_OFF)
    assert history.v[:, 0, 0] == pytest.approx(exact.vx, rel=0, abs=ROUND_OFF)
    assert np.abs(history.gap).max() <= ROUND_OFF
    assert history.fn[1:, 0] == pytest.approx(exact.fn[1:], rel=1e-12)
    assert history.fs[1:, 0] == pytest.approx(-exact.fs[1:], rel=1e-12)  # against +x, the contact's tangent
    assert np.isnan(history.fn[0]).all()
    assert np.isnan(history.wall_force[0]).all()
    assert history.wall_force[1:, 0] == pytest.approx(np.column_stack([exact.fs, -exact.fn])[1:], rel=1e-12)


@needs_siconos
def test_slip_to_roll_has_exact_velocities_and_their_trapezoidal_sum() -> None:
    dt, n, mu, speed = 0.01, 60, 0.3, 1.0
    scene = one_disk(rigid(mu), v=(speed, 0.0))
    history = Siconos().run(scene, numerics(dt, n), [(0, 1)]).history
    exact = slip_to_roll(history.t, mu=mu, speed=speed, g=10.0, radius=0.5)
    assert history.v[:, 0, 0] == pytest.approx(exact.vx, rel=0, abs=ROUND_OFF)
    assert -history.omega[:, 0] == pytest.approx(np.abs(exact.spin), rel=0, abs=ROUND_OFF)
    vx, omega = history.v[:, 0, 0], history.omega[:, 0]
    assert np.diff(history.x[:, 0, 0]) == pytest.approx(0.5 * dt * (vx[1:] + vx[:-1]), rel=0, abs=ROUND_OFF)
    assert np.diff(history.angle[:, 0]) == pytest.approx(0.5 * dt * (omega[1:] + omega[:-1]), rel=0, abs=ROUND_OFF)
    assert history.energy["kinetic"][0] == pytest.approx(0.5 * 3.0 * speed**2)


@needs_siconos
@pytest.mark.parametrize(("mu", "e"), [(0.0, 1.0), (0.01, 0.5), (5.0, 0.0)])
def test_oblique_collision_of_unequal_spinning_disks(mu: float, e: float) -> None:
    """One contact: its impulse in closed form, with the normal at the end of the step as the velocities predict it.

    The approach that restitution multiplies is the one that Siconos recorded before, with the normal at the step's begin.
    """
    m, r, inertia = np.array([1.0, 2.5]), np.array([1.0, 0.7]), np.array([0.5, 0.9])
    v0, w0 = np.array([(1.0, 0.1), (-0.5, 0.0)]), np.array([0.4, -0.3])
    disks = Disks(x=[(0.0, 0.0), (2.2, 0.5)], radius=r, mass=m, inertia=inertia, v=v0, omega=w0)  # type: ignore[arg-type]
    scene, dt = Scene(disks=disks, disk_disk=rigid(mu, e)), 1e-2
    history = Siconos().run(scene, numerics(dt, 60), [(0, 1)]).history
    hit = int(np.flatnonzero(history.fn[1:, 0] > 0.0)[0]) + 1
    assert np.count_nonzero(history.fn[1:]) == 1
    rate = history.gap[hit - 1, 0] - history.gap[hit - 2, 0]
    assert history.gap[hit - 1, 0] + 0.5 * rate <= 0.0 < history.gap[hit - 2, 0] + 0.5 * rate  # half a step ahead
    before = history.x[hit - 1, 1] - history.x[hit - 1, 0]
    apart = v0[1] - v0[0]
    n = (before + dt * apart) / np.hypot(*(before + dt * apart))
    t = np.array([-n[1], n[0]])
    slip = float(t @ (v0[0] - v0[1]) + r @ w0)
    p = -(n @ apart + e * (before @ apart) / np.hypot(*before)) / (1.0 / m).sum()
    q = float(np.clip(-slip / (1.0 / m + r**2 / inertia).sum(), -mu * p, mu * p))
    assert (abs(q) == mu * p) == (mu < 0.1)
    assert history.fn[hit, 0] * dt == pytest.approx(p, rel=1e-12)
    assert history.fs[hit, 0] * dt == pytest.approx(q, rel=1e-12, abs=1e-15)
    after = v0 + np.array([-p * n + q * t, p * n - q * t]) / m[:, None]
    assert history.v[hit:] == pytest.approx(np.broadcast_to(after, history.v[hit:].shape), rel=0, abs=ROUND_OFF)
    assert history.omega[-1] == pytest.approx(w0 + q * r / inertia, rel=0, abs=ROUND_OFF)


@needs_siconos
def test_disk_on_a_shaking_rising_floor_follows_it() -> None:
    """Positions of the wall are exact, its velocity is the chord's; friction holds as long as a omega^2 < mu g."""
    motion = (WallSegment(duration=0.3, amplitude=(0.01, 0.0), frequency=10.0, velocity=(0.0, 0.2)), WallSegment())
    dt, n = 0.01, 50
    scene = one_disk(rigid(mu=0.5), rotating=False, motion=motion)
    history = Siconos().run(scene, numerics(dt, n), [(0, 1)]).history
    chord = np.diff(history.wall_point[:, 0], axis=0) / dt
    assert np.abs(chord[:, 0]).max() > 0.05
    assert history.wall_point[5, 0] == pytest.approx([0.01 * np.sin(0.5), 0.01], rel=1e-14)
    assert history.v[1:31, 0] == pytest.approx(chord[:30], rel=0, abs=ROUND_OFF)
    assert np.abs(np.diff(history.v[1:31, 0, 0])).max() < 0.5 * 10.0 * dt
    # The floor stops at step 30; a rigid contact does not hold the disk back, which flies with the floor's last velocity.
    assert history.fn[31, 0] == 0.0
    assert history.v[31, 0, 1] == pytest.approx(0.2 - 10.0 * dt, rel=0, abs=ROUND_OFF)


@needs_siconos
def test_impact_on_a_moving_wall_reverses_the_relative_velocity() -> None:
    scene = one_disk(
        rigid(restitution=0.5), v=(0.0, -1.0), gravity=(0.0, 0.0), gap=0.3, motion=(WallSegment(velocity=(0.0, 0.4)),)
    )
    history = Siconos().run(scene, numerics(0.01, 60), [(0, 1)]).history
    assert history.v[-1, 0, 1] == pytest.approx(0.4 + 0.5 * 1.4, rel=0, abs=ROUND_OFF)


@needs_siconos
def test_global_damping_is_the_central_form() -> None:
    xi, dt, n = 3.0, 0.02, 80
    scene = one_disk(rigid(), v=(1.0, 2.0), omega=5.0, gap=50.0, xi=xi)
    history = Siconos().run(scene, numerics(dt, n), []).history
    a, v, omega = 0.5 * xi * dt, np.array([1.0, 2.0]), 5.0
    for step in range(1, n + 1):
        v = ((1.0 - a) * v + dt * np.array([0.0, -10.0])) / (1.0 + a)
        omega *= (1.0 - a) / (1.0 + a)
        assert history.v[step, 0] == pytest.approx(v, rel=0, abs=10.0 * ROUND_OFF)
        assert history.omega[step, 0] == pytest.approx(omega, rel=0, abs=ROUND_OFF)


@needs_siconos
def test_blocked_spin_is_prescribed() -> None:
    """The disk's surface drives it until it rolls, v = -R omega; its spin never changes and carries no energy."""
    scene = one_disk(rigid(mu=0.5), omega=2.0, rotating=False)
    history = Siconos().run(scene, numerics(0.01, 40), [(0, 1)]).history
    assert (history.omega == 2.0).all()
    assert history.v[:, 0, 0] == pytest.approx(np.maximum(-5.0 * history.t, -1.0), rel=0, abs=ROUND_OFF)
    assert history.energy["kinetic"][0] == 0.0


def heap(masses: float = 1.0, mus: tuple[float, float] = (0.4, 0.4)) -> Scene:
    """Three disks side by side on a rough floor, two on top of them, the ones at the ends pressed inwards by walls."""
    h = np.sqrt(3.0)
    x = [(0.0, 1.0), (2.0, 1.0), (4.0, 1.0), (1.0, 1.0 + h), (3.0, 1.0 + h)]
    sides = [("left", (-1.0, 0.0), (1.0, 0.0)), ("right", (5.0, 0.0), (-1.0, 0.0)), ("floor", (0.0, 0.0), (0.0, 1.0))]
    walls = tuple(Wall(name=name, point=p, normal=n, law=rigid(mus[0])) for name, p, n in sides)
    disks = Disks(x=x, radius=1.0, mass=masses)  # type: ignore[arg-type]
    return Scene(disks=disks, disk_disk=rigid(mus[1]), walls=walls, gravity=(0.5, -10.0))


@needs_siconos
def test_heap_at_rest_balances() -> None:
    history = Siconos().run(heap(), numerics(0.01, 20), [(0, 3), (0, 5), (2, 6)]).history
    assert np.abs(history.v).max() <= 10.0 * 0.01 * SOLVED
    assert history.wall_force[1:].sum(axis=1) == pytest.approx(
        np.broadcast_to([2.5, -50.0], (20, 2)), rel=0, abs=50.0 * SOLVED
    )
    assert history.fn[-1, 0] > 1.0  # the upper disks rest on the lower ones


@needs_siconos
def test_units_of_mass_change_no_bit_of_the_motion() -> None:
    """Siconos' Gauss-Seidel has thresholds and a residual that depend on units; the adapter's unit of mass hides them."""
    moving = heap().replace(gravity=(3.0, -10.0), walls=heap().walls[2:])
    heavy = moving.replace(disks=heap(2.0**24).disks)
    one, two = (Siconos().run(scene, numerics(0.01, 50), [(0, 3)]).history for scene in (moving, heavy))
    assert np.abs(one.v[-1]).max() > 0.1
    assert np.array_equal(one.x, two.x)
    assert np.array_equal(one.omega, two.omega)
    assert np.array_equal(one.fn[1:] * 2.0**24, two.fn[1:])


@needs_siconos
def test_solver_that_stops_short_is_an_error() -> None:
    with pytest.raises(EngineError, match=r"left the residual .* in step 1, after 1 iterations"):
        Siconos().run(heap(), numerics(0.01, 5, {"siconos.max_iterations": 1}), [])


@needs_siconos
def test_lemke_is_found_out_where_coefficients_differ() -> None:
    """Siconos sets Lemke's problem up with the wrong contact's coefficient, and answers without a word."""
    sliding = heap(mus=(0.1, 0.8)).replace(gravity=(6.0, -10.0))
    lemke = {"siconos.solver": "lemke"}
    with pytest.raises(EngineError, match=r"the contact solver left the residual"):
        Siconos().run(sliding, numerics(0.01, 5, lemke), [])
    same = heap(mus=(0.1, 0.1)).replace(gravity=(6.0, -10.0), walls=heap(mus=(0.1, 0.1)).walls[2:])
    one, two = (Siconos().run(same, numerics(0.01, 5, options), []).history for options in (lemke, {}))
    assert one.v == pytest.approx(two.v, rel=0, abs=0.6 * SOLVED)


@needs_siconos
@pytest.mark.parametrize(
    ("case", "params"),
    [("binary-collision", {"kind": "plastic"}), ("incline-block", {"mu": 0.36}), ("slip-to-roll", {"mu": 0.3})],
)
def test_cases_pass(case: str, params: Mapping[str, object]) -> None:
    measured = run_case(case, engine="siconos", params=params).measurements
    assert len(measured) > 5
    assert set(measured.status) <= {"pass", "known-gap"}


@needs_siconos
def test_info_and_settings_of_the_real_one() -> None:
    info = Siconos().info()
    assert info.version == VERSION
    assert (info.scheme, info.contact, info.licence) == ("moreau-jean", "impulse", "Apache-2.0")
    settings = Siconos().run(one_disk(rigid(0.3)), numerics(0.01, 3, {"siconos.theta": 0.75}), []).settings
    assert settings["siconos.theta"] == 0.75
    assert settings["siconos.solver"] == "nsgs"
    assert settings["engine_version"] == VERSION
    assert 0.0 <= settings["largest_solver_residual"] <= 1e-12


def test_what_is_supported() -> None:
    plain = numerics(0.01, 1)
    assert Siconos().supports(one_disk(rigid(0.3)), plain) == Siconos().supports(one_disk(rigid(0.3)), plain)
    answer = Siconos().supports(one_disk(rigid(0.3)), plain)
    assert (answer.level, answer.notes) == (SupportLevel.EXACT, (NOTE_THETA,))
    sunk = one_disk(rigid(0.3, None), gap=-1e-6).replace(initial_shear={(0, 1): -1.0})
    answer = Siconos().supports(sunk, plain)
    assert (answer.level, answer.notes) == (SupportLevel.EQUIVALENT, (NOTE_PRELOAD, NOTE_RESTITUTION, NOTE_THETA))
    elastic = one_disk(ContactLaw(kn=1e5, ks=1e5, mu=0.2))
    assert Siconos().supports(elastic, plain).level is SupportLevel.NO
    assert Capability.LINEAR_CONTACT in Siconos().supports(elastic, plain).missing
    damped = one_disk(rigid(), xi=1.0)
    assert Siconos().supports(damped, plain).level is SupportLevel.EXACT
    implicit = Siconos().supports(damped, numerics(0.01, 1, {"siconos.theta": 1.0}))
    assert implicit.missing == (Capability.GLOBAL_DAMPING_CENTRAL,)
    turning = one_disk(rigid(), motion=(WallSegment(angular_velocity=0.1),))
    assert Siconos().supports(turning, plain).missing == (Capability.ROTATING_WALLS,)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("siconos.theta", 0.4),
        ("siconos.theta", "half"),
        ("siconos.solver", "cpg"),
        ("siconos.max_iterations", 1.5),
        ("siconos.tol", 1e-3),
    ],
)
def test_impossible_settings_are_refused(name: str, value: object) -> None:
    with pytest.raises(InvalidNumericsError, match=name):
        Siconos().run(one_disk(rigid()), numerics(0.01, 1, {name: value}), [])


@pytest.mark.parametrize(
    ("program", "reason"),
    [(sys.executable, "cannot import it: ModuleNotFoundError"), ("no/such/python", "cannot be run")],
)
def test_missing_siconos_is_no_failure(program: str, reason: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(siconos, "SYSTEM_PYTHON", program)
    info = Siconos().info()
    assert not info.installed
    assert reason in info.not_installed_because
    with pytest.raises(EngineNotInstalledError, match="apt-get install python3-siconos"):
        Siconos().run(one_disk(rigid()), numerics(0.01, 1), [])


def test_mute_siconos_is_not_installed(tmp_path: Path) -> None:
    program = tmp_path / "python3"
    program.write_text("#!/bin/sh\nexit 0\n")
    program.chmod(0o755)
    assert installed_siconos(str(program)) == (None, f"{program} cannot import it: it prints no version")


def test_scenes_of_more_pairs_than_it_steps_in_reasonable_time_are_refused() -> None:
    def many(n: int) -> Scene:
        return Scene(disks=Disks(x=[(3.0 * k, 0.0) for k in range(n)], radius=1.0, mass=1.0), disk_disk=rigid())  # type: ignore[arg-type]

    assert Siconos().supports(many(45), numerics(0.01, 1)).level is not SupportLevel.NO  # 990 pairs
    refused = Siconos().supports(many(46), numerics(0.01, 1))
    assert refused.level is SupportLevel.NO
    assert "1035 here" in refused.notes[0]
