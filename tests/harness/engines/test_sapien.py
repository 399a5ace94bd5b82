"""The SAPIEN adapter: coefficients by pair, moving walls, what it cannot observe, and the settings that PhysX's own would spoil."""

from __future__ import annotations

import numpy as np
import pytest

from ninedisk.core.errors import InvalidNumericsError
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, PlaneWall, Scene, Spheres, SphereScene, Wall, WallSegment
from ninedisk.harness import run_case
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.engine import SupportLevel, run_session
from ninedisk.harness.api.registry import get_engine
from ninedisk.harness.engines import package
from ninedisk.harness.engines.sapien.adapter import ENGINE
from ninedisk.harness.engines.sapien.channels import MOST_PAIRS

INFO = ENGINE.info()
needs_sapien = pytest.mark.skipif(not INFO.installed, reason=f"SAPIEN: {INFO.not_installed_because}")


def numerics(n_steps, dt=0.01, **options) -> Numerics:
    return Numerics(dt=dt, n_steps=n_steps, options={f"sapien.{name}": value for name, value in options.items()})


def run(scene, n_steps=100, *, dt=0.01, watch=((0, 1),), **options):
    from ninedisk.harness.engines.sapien.session import SapienSession

    return run_session(SapienSession, scene, numerics(n_steps, dt, **options), watch)


def test_what_is_refused_is_named(rigid, on_plane):
    stiff = ContactLaw(kn=1e6, ks=1e6, mu=0.3, beta=0.1)
    missing = ENGINE.supports(on_plane(stiff), numerics(1)).missing
    assert {Capability.LINEAR_CONTACT, Capability.SHEAR_SPRING, Capability.CONTACT_DAMPING} <= set(missing)
    turning = on_plane(rigid(), motion=(WallSegment(angular_velocity=0.5, pivot=(-1.0, 0.0)),))
    assert ENGINE.supports(turning, numerics(1)).missing == (Capability.ROTATING_WALLS,)
    spinning = ENGINE.supports(on_plane(rigid(), omega=1.0), numerics(1))
    assert spinning.level is SupportLevel.NO
    assert "spins at a prescribed rate" in spinning.notes[0]


def test_a_driven_sphere_may_move_but_not_spin(rigid):
    def ball(**given):
        spheres = Spheres(x=[[0.0, 0.0, 0.0]], radius=1.0, mass=1.0, held=[[True] * 3], rotating=[False], **given)
        return ENGINE.supports(SphereScene(spheres=spheres, sphere_sphere=rigid()), numerics(1))

    assert ball(v=[[1.0, 0.0, 0.0]]).level is SupportLevel.EXACT
    assert ball(omega=[[1.0, 0.0, 0.0]]).level is SupportLevel.NO


def test_more_pairs_of_laws_than_bits_are_refused(rigid):
    walls = tuple(
        Wall(name=f"w{k}", point=(0.0, -1.0 - k), normal=(0.0, 1.0), law=rigid(mu=0.01 * k))
        for k in range(MOST_PAIRS + 1)
    )
    scene = Scene(disks=Disks(x=[[0.0, 0.0]], radius=0.5, mass=1.0), disk_disk=rigid(), walls=walls)
    support = ENGINE.supports(scene, numerics(1))
    assert support.level is SupportLevel.NO
    assert f"the scene has {MOST_PAIRS + 1}" in support.notes[0]


def test_where_it_is_not_installed_its_cells_say_how(monkeypatch):
    monkeypatch.setattr(package, "package_version", lambda name: (None, f"no {name}"))
    result = run_case("binary-collision", engine="sapien")
    assert result.status == "not-installed"
    assert "pip install sapien" in result.reason


@needs_sapien
@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"solver": "jacobi"}, "use one of pgs, tgs"),
        ({"position_iterations": 256}, "sapien.position_iterations = 256"),
        ({"velocity_iterations": 2.5}, "whole number"),
        ({"slop": 1.0}, "'sapien.slop' is unknown"),
    ],
)
def test_bad_settings_are_refused(options, words, rigid, on_plane):
    with pytest.raises(InvalidNumericsError, match=words):
        ENGINE.run(on_plane(rigid()), numerics(1, **options), [])


@needs_sapien
def test_friction_is_not_observed_and_no_failure():
    result = run_case("incline-block", engine="sapien", params={"mu": 0.36, "dt": 0.005})
    status = result.measurements.set_index(["quantity", "truth"]).status
    assert status["fs", "exact-step"] == "not-observed"
    assert status["fn", "exact-step"] == "pass"
    assert status["x", "exact-step"] == "pass"
    assert result.status in ("pass", "known-gap")


@needs_sapien
@pytest.mark.parametrize(
    ("case", "params"),
    [
        ("binary-collision", {"kind": "elastic"}),
        ("binary-collision", {"kind": "plastic"}),
        ("slip-to-roll", {"mu": 0.3, "dt": 0.01}),
        ("contact/belt", {}),
        ("contact/materials", {}),
        ("spheres/saddle", {"ratio": 2.0}),
    ],
)
def test_it_passes(case, params):
    assert run_case(case, engine="sapien", params=params).status in ("pass", "known-gap")


@needs_sapien
def test_forces_of_smooth_pairs_are_whole_and_those_of_rough_ones_normal(rigid):
    """Two disks on floors apart, one smooth: only what rubs has no numbers."""
    disks = Disks(x=[[0.0, 0.5], [3.0, 0.5]], v=[[0.5, 0.0], [0.5, 0.0]], radius=0.5, mass=[2.0, 3.0])
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=rigid(mu=0.0))
    scene = Scene(disks=disks, disk_disk=rigid(mu=0.4), walls=(floor,), gravity=(0.0, -10.0))
    history = run(scene, 5, watch=((0, 1), (0, 2), (1, 2))).history
    np.testing.assert_allclose(history.fn[-1], [0.0, 20.0, 30.0], rtol=1e-5)
    np.testing.assert_array_equal(history.fs[1:, 1:], 0.0)
    assert np.isnan(history.fs[:, 0]).all()
    np.testing.assert_allclose(history.wall_force[-1, 0], [0.0, -50.0], rtol=1e-5)
    rough = scene.replace(walls=(Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=rigid(mu=0.1)),))
    assert np.isnan(run(rough, 5).history.wall_force).all()


@needs_sapien
def test_a_wall_that_moves_beside_one_at_rest(rigid):
    """A floor at rest and a piston that pushes a disk along it, and stops."""
    disk = Disks(x=[[0.0, 0.5]], radius=0.5, mass=2.0)
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=rigid())
    motion = (WallSegment(duration=0.5, velocity=(0.4, 0.0)),)
    piston = Wall(name="piston", point=(-0.5, 0.0), normal=(1.0, 0.0), law=rigid(), motion=motion)
    scene = Scene(disks=disk, disk_disk=rigid(), walls=(floor, piston), gravity=(0.0, -10.0))
    history = run(scene, 100, watch=((0, 1), (0, 2))).history
    np.testing.assert_allclose(history.v[2:, 0], [[0.4, 0.0]] * 99, atol=1e-5)
    np.testing.assert_allclose(history.gap[:, 0], 0.0, atol=1e-5)


@needs_sapien
@pytest.mark.parametrize("radius", [1e-3, 1.0, 1e3])
def test_a_disk_rolls_without_slip_whatever_its_size(rigid, radius):
    """In PhysX's lengths of metres a disk of 1 m slips by 4e-4 of its speed for good: friction pulls it back."""
    law = rigid(mu=0.3)
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law)
    disk = Disks(x=[[0.0, radius]], v=[[radius, 0.0]], radius=radius, mass=2.0)
    history = run(Scene(disks=disk, disk_disk=law, walls=(floor,), gravity=(0.0, -10.0 * radius)), 200).history
    slip = history.v[40:, 0, 0] / radius + history.omega[40:, 0]
    np.testing.assert_allclose(slip, 0.0, atol=2e-5)
    assert history.v[-1, 0, 0] / radius == pytest.approx(2.0 / 3.0, abs=2e-5)


@needs_sapien
def test_each_pair_has_its_own_restitution(rigid):
    disks = Disks(x=[[0.0, 0.0], [1.05, 0.0]], v=[[1.0, 0.0], [0.0, 0.0]], radius=0.5, mass=2.0)
    back = Wall(name="back", point=(2.2, 0.0), normal=(-1.0, 0.0), law=rigid(restitution=1.0))
    v = run(Scene(disks=disks, disk_disk=rigid(), walls=(back,)), 200).history.v
    assert v[10, :, 0] == pytest.approx([0.5, 0.5], abs=1e-5)
    assert v[-1, :, 0].sum() == pytest.approx(-1.0, abs=1e-4)


@needs_sapien
def test_forces_of_boxes_without_friction_have_their_moments(rigid):
    """A ball off the axis of a smooth box presses on it: the moment about the box's centre is balanced by the floor."""
    law = rigid()
    half = [[0.5, 0.35, 0.3], [0.0, 0.0, 0.0]]
    bodies = Spheres(x=[[0.0, 0.0, 0.3], [0.1, 0.05, 0.85]], radius=[0.7, 0.25], mass=[3.0, 1.0], half_sizes=half)
    floor = PlaneWall(name="floor", point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), law=law)
    scene = SphereScene(spheres=bodies, sphere_sphere=law, walls=(floor,), gravity=(0.0, 0.0, -10.0))
    history = run(scene, 20, dt=0.005, watch=((0, 1), (0, 2))).history
    np.testing.assert_allclose(history.fn[-1], [10.0, 40.0], rtol=1e-4)
    load = np.cross([0.1, 0.05, 0.3], [0.0, 0.0, -10.0])
    np.testing.assert_allclose(history.moment[-1], [load, -load], atol=2e-3)


@needs_sapien
def test_its_own_settings_differ(rigid, on_plane):
    scene = on_plane(rigid(restitution=1.0), height=1.5, v=(0.0, -1.0), g=0.0)
    assert run(scene, 200).history.v[-1, 0, 1] == pytest.approx(1.0, abs=1e-5)
    stock = run(scene, 200, profile="stock")
    assert stock.history.v[-1, 0, 1] == pytest.approx(0.0, abs=0.1)  # below its bounce threshold of 2 m/s
    assert stock.settings["sapien.bounce_threshold"] == 2.0
    assert stock.settings["sapien.solver"] == "tgs"
    info = get_engine("sapien-stock").info()
    assert (info.profile, dict(info.differences)) == ("stock", {})


@needs_sapien
def test_runs_repeat_to_the_bit(rigid, on_plane):
    scene = on_plane(rigid(mu=0.3), slope=0.5, degrees=33.0)
    one, two = (ENGINE.run(scene, numerics(50), ((0, 1),)).history for _ in range(2))
    np.testing.assert_array_equal(one.x, two.x)
    np.testing.assert_array_equal(one.fn, two.fn)
    assert ENGINE.run(scene, numerics(1), ()).settings["engine_version"] == INFO.version
