"""The DART adapter: rigid contacts up to DART's constraint force mixing, pair coefficients, signs."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Disks, Scene, Wall
from ninedisk.harness import run_case
from ninedisk.harness.api.engine import SupportLevel, run_session
from ninedisk.harness.engines.dart import adapter as adapter
from ninedisk.harness.engines.dart.adapter import ENGINE, FORCE_MIXING

G = 10.0
INFO = ENGINE.info()
needs_dart = pytest.mark.skipif(not INFO.installed, reason=f"DART: {INFO.not_installed_because}")

SOFT = 2.0 * FORCE_MIXING
"""A contact gives way by FORCE_MIXING of a step's change of velocity; the sum of two such contacts, or 1 + e of it."""


def numerics(n_steps, dt=0.01, **options) -> Numerics:
    return Numerics(dt=dt, n_steps=n_steps, options={f"dart.{name}": value for name, value in options.items()})


def run(scene, n_steps=100, *, dt=0.01, watch=((0, 1),), **options):
    """Run in this process: what is tested is the session; the process around it has its own tests."""
    from ninedisk.harness.engines.dart.session import DartSession

    return run_session(DartSession, scene, numerics(n_steps, dt, **options), watch)


def test_the_regularisation_is_said(rigid, on_plane):
    support = ENGINE.supports(on_plane(rigid(mu=0.3)), numerics(1))
    assert support.level is SupportLevel.APPROXIMATE
    assert "1e-05" in support.notes[-1]


def test_what_the_smaller_friction_cannot_express_is_refused(rigid):
    disks = Disks(x=[[0.0, 0.5], [3.0, 0.5]], radius=0.5, mass=2.0)
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=rigid(mu=0.5))
    scene = Scene(disks=disks, disk_disk=rigid(mu=0.2), walls=(floor,))
    support = ENGINE.supports(scene, numerics(1))
    assert support.level is SupportLevel.NO
    assert "wall 'floor' cannot have 0.5 where disks have 0.2" in support.notes[0]
    assert ENGINE.supports(scene.replace(disk_disk=rigid(mu=0.5)), numerics(1)).level is SupportLevel.APPROXIMATE


def test_what_a_product_of_factors_below_1_cannot_express_is_refused(rigid):
    disks = Disks(x=[[0.0, 0.5], [3.0, 0.5]], radius=0.5, mass=2.0)
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=rigid(restitution=0.6))
    scene = Scene(disks=disks, disk_disk=rigid(restitution=0.25), walls=(floor,))
    support = ENGINE.supports(scene, numerics(1))
    assert support.level is SupportLevel.NO
    assert "wall 'floor' cannot have 0.6 where disks have 0.25" in support.notes[0]
    assert ENGINE.supports(scene.replace(disk_disk=rigid(restitution=0.36)), numerics(1)).level is not SupportLevel.NO


def test_a_prescribed_spin_is_refused(rigid, on_plane):
    support = ENGINE.supports(on_plane(rigid(mu=0.3), omega=1.0), numerics(1))
    assert support.level is SupportLevel.NO
    assert "disk 0 spins" in support.notes[0]
    assert ENGINE.supports(on_plane(rigid(mu=0.3), omega=1.0, rotating=True), numerics(1)).level is not SupportLevel.NO


@needs_dart
@pytest.mark.parametrize("detector", ["dart", "fcl", "ode", "bullet"])
@pytest.mark.parametrize("solver", ["dantzig", "nsgs"])
def test_detectors_and_solvers_agree(rigid, on_plane, detector, solver):
    scene = on_plane(rigid(mu=0.3), slope=0.5, degrees=20.0)
    history = run(scene, collision_detector=detector, solver=solver).history
    np.testing.assert_allclose(history.v[-1], run(scene).history.v[-1], rtol=1e-6)


@needs_dart
def test_momentum_stays_and_the_mixing_shows(rigid):
    disks = Disks(x=[[0.0, 0.0], [2.001, 0.0]], v=[[1.0, 0.0], [0.0, 0.0]], radius=1.0, mass=[1.0, 3.0])
    v = run(Scene(disks=disks, disk_disk=rigid(restitution=1.0)), 3).history.v[-1]
    assert v[0, 0] + 3.0 * v[1, 0] == pytest.approx(1.0, abs=1e-14)
    lost = 1.0 - (v[1, 0] - v[0, 0])
    assert lost == pytest.approx(SOFT, rel=1e-3)  # (1 + e) of it: were DART to change it, FORCE_MIXING would be wrong


@needs_dart
def test_split_impulses_leave_no_momentum_behind(rigid, on_plane, monkeypatch):
    import dartpy

    scene = on_plane(rigid(), v=(0.0, -1.0), height=0.0525, g=0.0)
    assert abs(run(scene, 12).history.v[-1, 0, 1]) < SOFT
    solver = dartpy.constraint.ConstraintSolver
    monkeypatch.setattr(solver, "setSplitImpulseEnabled", lambda _self, _on: None, raising=True)
    assert run(scene, 12).history.v[-1, 0, 1] > 1e-4


@needs_dart
def test_a_stack_carries_its_weight(rigid):
    disks = Disks(x=[[0.0, 0.5], [0.0, 1.5], [0.0, 2.5]], radius=0.5, mass=[1.0, 2.0, 3.0])
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=rigid(mu=0.5))
    scene = Scene(disks=disks, disk_disk=rigid(mu=0.5), walls=(floor,), gravity=(0.0, -G))
    weights, watch = np.array([60.0, 50.0, 30.0]), ((0, 3), (0, 1), (1, 2))
    history = run(scene, 20, watch=watch).history
    # The first step moves the stack by the mixing, summed over three contacts of up to six times a disk's weight each.
    np.testing.assert_allclose(history.fn[1], weights, rtol=18 * FORCE_MIXING)
    np.testing.assert_allclose(history.fn[-1], weights, rtol=1e-9)
    dantzig = run(scene, 20, watch=watch, solver="dantzig").history
    assert abs(dantzig.fn[1, 0] - 60.0) > 0.5  # why it is not the default
    np.testing.assert_allclose(dantzig.fn[-1], weights, rtol=1e-6)


@needs_dart
def test_a_free_disk_turns_on(rigid, on_plane):
    free = run(on_plane(rigid(), height=1.0, g=0.0, rotating=True, omega=40.0)).history
    np.testing.assert_allclose(free.angle[-1, 0], 40.0, rtol=1e-12)


@needs_dart
def test_nothing_falls_asleep(rigid, on_plane):
    history = run(on_plane(rigid(mu=0.4), slope=math.radians(20.0)), 300).history
    np.testing.assert_allclose(history.fn[1:, 0], 20.0 * math.cos(math.radians(20.0)), rtol=SOFT)
    assert np.all(history.v[1:, 0, 0] > 0.0)  # the creep of the mixing goes on


@needs_dart
@pytest.mark.parametrize(
    ("kind", "e"), [({"kind": "elastic"}, 1.0), ({"kind": "plastic"}, 0.0), ({"restitution": 0.5}, 0.5)]
)
def test_collisions(kind, e):
    result = run_case("binary-collision", engine="dart", params=kind)
    assert result.status == "pass"
    assert result.observed.scalars["restitution_effective"][1] == pytest.approx(e, abs=SOFT)


@needs_dart
@pytest.mark.parametrize("dt", [0.01, 0.0025])
def test_the_incline_is_that_of_semi_implicit_euler(dt):
    result = run_case("incline-block", engine="dart", params={"mu": 0.36, "dt": dt})
    assert set(result.measurements.status) <= {"pass", "known-gap"}
    scalars, gravity = result.observed.scalars, 10.0
    assert scalars["vx_final"][1] == pytest.approx(3.730799842741606e-2, abs=FORCE_MIXING * gravity * dt)
    assert scalars["x_final"][1] == pytest.approx(1.865399921370803e-2 * (1.0 + dt), abs=FORCE_MIXING * gravity * dt)
    stuck = run_case("incline-block", engine="dart", params={"mu": 0.4, "dt": dt})
    assert stuck.status == "pass"
    assert stuck.observed.scalars["creep_rate"][1] == pytest.approx(FORCE_MIXING * gravity * dt * 0.342, rel=1e-2)
