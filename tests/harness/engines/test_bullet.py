"""The Bullet adapter: exact steps, pair coefficients, signs, and what its own settings would spoil."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ninedisk.core.errors import InvalidNumericsError
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall, WallSegment
from ninedisk.harness import run_case
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.engine import Engine, EngineError, EngineNotInstalledError, SupportLevel, run_session
from ninedisk.harness.engines import package
from ninedisk.harness.engines import plane as plane_geometry
from ninedisk.harness.engines.bullet import adapter as adapter
from ninedisk.harness.engines.bullet.adapter import ENGINE
from ninedisk.harness.engines.package import product_factors

G = 10.0
INFO = ENGINE.info()
needs_bullet = pytest.mark.skipif(not INFO.installed, reason=f"Bullet: {INFO.not_installed_because}")


def numerics(n_steps, dt=0.01, **options) -> Numerics:
    return Numerics(dt=dt, n_steps=n_steps, options={f"bullet.{name}": value for name, value in options.items()})


def run(scene, n_steps=100, *, dt=0.01, watch=((0, 1),), **options):
    """Run in this process: what is tested is the session; the process around it has tests of its own."""
    from ninedisk.harness.engines.bullet.session import BulletSession

    return run_session(BulletSession, scene, numerics(n_steps, dt, **options), watch)


def test_facts():
    assert isinstance(ENGINE, Engine)
    assert (INFO.scheme, INFO.contact, INFO.licence) == ("semi-implicit-euler", "impulse", "zlib")
    assert Capability.LINEAR_CONTACT not in INFO.capabilities


def test_what_is_refused_is_named(rigid, on_plane):
    stiff = ContactLaw(kn=1e6, ks=1e6, mu=0.3, beta=0.1)
    missing = ENGINE.supports(on_plane(stiff), numerics(1)).missing
    assert {Capability.LINEAR_CONTACT, Capability.SHEAR_SPRING, Capability.CONTACT_DAMPING} <= set(missing)
    damped = on_plane(rigid()).replace(xi=3.0)
    assert ENGINE.supports(damped, numerics(1)).missing == (Capability.GLOBAL_DAMPING_CENTRAL,)
    rough = ENGINE.supports(on_plane(rigid(mu=11.0)), numerics(1))
    assert rough.level is SupportLevel.NO
    assert "caps the friction of a pair at 10, the scene has 11" in rough.notes[0]
    assert ENGINE.supports(on_plane(rigid(mu=10.0)), numerics(1)).level is SupportLevel.EXACT
    assert ENGINE.supports(on_plane(rigid(restitution=None)), numerics(1)).level is SupportLevel.EQUIVALENT


def test_factors_multiply_to_the_pairs_coefficients():
    disk, walls = product_factors(0.36, [0.5, 0.0])
    np.testing.assert_allclose([disk * disk, disk * walls[0], disk * walls[1]], [0.36, 0.5, 0.0], rtol=1e-15)
    assert product_factors(None, [0.3]) == (1.0, [0.3])
    assert product_factors(0.0, [0.0]) == (0.0, [0.0])
    disk, walls = product_factors(0.0, [0.5])
    assert disk * disk <= 1.1e-16
    assert disk * walls[0] == pytest.approx(0.5, rel=1e-15)


@needs_bullet
@pytest.mark.parametrize("degrees", [*range(0, 360, 45), 7.3, 111.1, 233.0])
def test_a_touching_disk_is_in_contact_from_the_first_step(rigid, on_plane, degrees):
    slope, mu = 0.5, 0.3
    history = run(on_plane(rigid(mu=mu), degrees=degrees, slope=slope)).history
    down, normal = G * (math.sin(slope) - mu * math.cos(slope)), 2.0 * G * math.cos(slope)
    # A gap of rounding is closed at once, by a velocity of gap/dt: 1e-15/0.01.
    np.testing.assert_allclose(history.fn[1:, 0], normal, rtol=1e-11)
    np.testing.assert_allclose(history.fs[1:, 0], -mu * normal, rtol=1e-11)
    np.testing.assert_allclose(history.gap[:, 0], 0.0, atol=1e-13)
    np.testing.assert_allclose(np.hypot(*history.v[-1, 0]), down, rtol=1e-12)


@needs_bullet
def test_forces_follow_the_scene_s_signs_and_are_step_means(rigid, on_plane):
    history = run(on_plane(rigid(mu=0.4), v=(-1.0, 0.0)), 3).history
    assert history.force_meaning == "step-mean"
    assert np.isnan(history.fn[0, 0])
    # n points from the disk down into the wall, t = +x; the disk slides to the left, friction pushes it to the right.
    assert (history.fn[1, 0], history.fs[1, 0]) == (pytest.approx(20.0, rel=1e-13), pytest.approx(8.0, rel=1e-13))
    np.testing.assert_allclose(history.wall_force[1, 0], [-8.0, -20.0], rtol=1e-13)
    np.testing.assert_allclose(history.v[1, 0], [-0.96, 0.0], atol=1e-14)


@needs_bullet
def test_each_pair_has_its_own_friction_and_restitution(rigid):
    disks = Disks(x=[[0.0, 0.5], [3.0, 0.5]], v=[[4.0, 0.0], [0.0, 0.0]], radius=0.5, mass=[2.0, 3.0], rotating=False)
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=rigid(mu=0.25))
    back = Wall(name="back", point=(3.7, 0.0), normal=(-1.0, 0.0), law=rigid(restitution=0.8))
    scene = Scene(disks=disks, disk_disk=rigid(restitution=0.3), walls=(floor, back), gravity=(0.0, -G))
    history = run(scene, 400, dt=0.0025, watch=((0, 1), (0, 2), (1, 2), (1, 3))).history
    speed, fall = history.v[:, :, 0], 0.25 * G * 0.0025
    hit = int(np.flatnonzero(history.fn[:, 0] > 0)[0])
    assert speed[0, 0] - speed[hit - 1, 0] == pytest.approx((hit - 1) * fall, rel=1e-9)
    parted, met = speed[hit, 1] - speed[hit, 0], speed[hit - 1, 0] - speed[hit - 1, 1]
    assert parted / met == pytest.approx(0.3, abs=0.02)  # the floor's friction over the step of the impact
    turn = int(np.flatnonzero(history.fn[:, 3] > 0)[0])
    assert -speed[turn, 1] / speed[turn - 1, 1] == pytest.approx(0.8, abs=0.02)


@needs_bullet
@pytest.mark.parametrize("restitution", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("height", [0.05, 0.0525])
def test_restitution_of_a_wall_wherever_in_the_step_it_is_met(rigid, on_plane, restitution, height):
    scene = on_plane(rigid(restitution=restitution), v=(0.0, -1.0), height=height, g=0.0)
    assert run(scene, 12).history.v[-1, 0, 1] == pytest.approx(restitution, abs=1e-11)


@needs_bullet
def test_bullet_s_own_settings_would_change_the_restitution(rigid, on_plane, monkeypatch):
    scene = on_plane(rigid(restitution=1.0), v=(0.0, -1.0), height=0.0525, g=0.0)
    assert run(scene, 12, contact_erp=0.2).history.v[-1, 0, 1] > 1.05
    # Contacts from about 0.01 m on, as with Bullet's own 0.02 m.
    monkeypatch.setattr(plane_geometry, "TOUCH_ULPS", 1e14)
    assert run(scene, 12).history.v[-1, 0, 1] < 0.9


@needs_bullet
@pytest.mark.parametrize("restitution", [0.0, 0.3, 1.0])
def test_oblique_impact_of_two_disks(rigid, restitution):
    line = np.array([0.6, 0.8])
    x = [[0.0, 0.0], 2.0 * line + 1e-3]
    disks = Disks(x=x, v=[line + np.array([-0.8, 0.6]), [0.0, 0.0]], radius=1.0, mass=[1.0, 3.0])
    history = run(Scene(disks=disks, disk_disk=rigid(restitution=restitution)), 3).history
    hit = int(np.flatnonzero(history.fn[:, 0] > 0)[0])
    # Bullet solves where the step begins, at the positions of the sample before.
    apart = history.x[hit - 1, 1] - history.x[hit - 1, 0]
    normal = apart / np.hypot(*apart)
    approach = (disks.v[0] - disks.v[1]) @ normal
    assert (history.v[-1, 1] - history.v[-1, 0]) @ normal == pytest.approx(restitution * approach, abs=1e-12)
    np.testing.assert_allclose(history.v[-1, 0] + 3.0 * history.v[-1, 1], disks.v[0], atol=1e-13)


@needs_bullet
def test_a_stack_carries_its_weight(rigid):
    disks = Disks(x=[[0.0, 0.5], [0.0, 1.5], [0.0, 2.5]], radius=0.5, mass=[1.0, 2.0, 3.0])
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=rigid(mu=0.5))
    scene = Scene(disks=disks, disk_disk=rigid(mu=0.5), walls=(floor,), gravity=(0.0, -G))
    watch = ((0, 3), (0, 1), (1, 2))
    history = run(scene, 20, watch=watch).history
    np.testing.assert_allclose(history.fn[1:], [[60.0, 50.0, 30.0]] * 20, rtol=1e-9)
    np.testing.assert_allclose(history.gap, 0.0, atol=1e-12)
    few = run(scene, 1, watch=watch, iterations=10).history
    assert few.fn[1, 0] < 50.0


@needs_bullet
def test_moving_walls_reach_their_exact_pose(rigid, on_plane):
    motion = (
        WallSegment(duration=0.25, velocity=(0.3, 0.2)),
        WallSegment(duration=0.25, amplitude=(0.0, 0.05), frequency=3.0),
    )
    history = run(on_plane(rigid(mu=2.0), motion=motion), 60).history
    np.testing.assert_allclose(history.wall_point[25, 0], [0.075, 0.05], atol=1e-14)
    np.testing.assert_allclose(history.wall_point[-1, 0], [0.075, 0.05 + 0.05 * math.sin(0.75)], atol=1e-14)
    np.testing.assert_allclose(history.v[2:25, 0], [[0.3, 0.2]] * 23, atol=1e-12)
    np.testing.assert_allclose(history.gap[:25, 0], 0.0, atol=1e-12)


@needs_bullet
def test_a_turning_wall_carries_the_disk(rigid, on_plane):
    motion = (WallSegment(angular_velocity=0.5, pivot=(-1.0, 0.0)),)
    history = run(on_plane(rigid(mu=2.0), motion=motion), 40).history
    np.testing.assert_allclose(history.wall_angle[:, 0], math.pi / 2 + 0.5 * history.t, atol=1e-14)
    # Velocity-level contacts leave the second-order drift of a straight step along a circle: omega^2 r dt^2/2 a step.
    assert np.abs(history.gap[:, 0]).max() < 40 * 0.5 * (0.5 * 0.01) ** 2 * 1.5


@needs_bullet
def test_a_disk_has_its_own_inertia_and_one_that_cannot_turn_keeps_its_spin(rigid):
    disks = Disks(
        x=[[0.0, 0.5], [5.0, 0.5]], v=[[1.0, 0.0]] * 2, omega=[0.0, 0.7], radius=0.5, mass=1.0, rotating=[True, False]
    )
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=rigid(mu=0.3))
    history = run(Scene(disks=disks, disk_disk=rigid(), walls=(floor,), gravity=(0.0, -G)), watch=()).history
    np.testing.assert_array_equal(history.omega[:, 1], 0.7)
    assert history.omega[-1, 0] == pytest.approx(-2.0 / 3.0 / 0.5, rel=1e-12)  # a sphere would roll at 5/7


@needs_bullet
def test_fast_bodies_are_not_slowed_down_and_angles_are_not_wrapped(rigid, on_plane):
    scene = on_plane(rigid(), v=(300.0, 0.0), height=1.0, g=0.0, rotating=True, omega=40.0)
    history = run(scene).history
    np.testing.assert_allclose(history.x[-1, 0, 0], 300.0, rtol=1e-12)
    np.testing.assert_allclose(history.angle[-1, 0], 40.0, rtol=1e-12)


@needs_bullet
def test_settings_are_recorded_and_runs_repeat_to_the_bit(rigid, on_plane):
    scene = on_plane(rigid(mu=0.3), slope=0.5, degrees=33.0)
    one, two = (run(scene, 50, iterations=7, contact_erp=0.5) for _ in range(2))
    wanted = {"iterations": 7, "contact_erp": 0.5, "contactERP": 0.5, "contactSlop": 0.0, "linearDamping": 0.0}
    assert {f"bullet.{name}": value for name, value in wanted.items()}.items() <= one.settings.items()
    assert one.settings["bullet.restitutionVelocityThreshold"] == 0.0
    assert 0.0 < one.settings["bullet.contactBreakingThreshold"] < 1e-11
    np.testing.assert_array_equal(one.history.x, two.history.x)


@pytest.mark.parametrize(
    ("option", "words"),
    [
        ({"iterations": 0}, "bullet.iterations = 0"),
        ({"iterations": 2.5}, "bullet.iterations = 2.5"),
        ({"iterations": True}, "bullet.iterations = True"),
        ({"iterations": "many"}, "bullet.iterations = 'many'"),
        ({"contact_erp": 2.0}, r"in \[0, 1\]"),
        ({"contact_erp": math.nan}, r"in \[0, 1\]"),
        ({"slop": 1.0}, "'bullet.slop' is unknown"),
    ],
)
@needs_bullet
def test_bad_settings_are_refused_before_a_process_starts(rigid, on_plane, option, words):
    with pytest.raises(InvalidNumericsError, match=words):
        ENGINE.run(on_plane(rigid()), numerics(1, **option), [])


@needs_bullet
def test_settings_of_other_engines_are_left_alone(rigid, on_plane):
    other = Numerics(dt=0.01, n_steps=1, options={"pymunk.iterations": 2})
    assert ENGINE.run(on_plane(rigid()), other, []).history.x.shape == (2, 1, 2)


@needs_bullet
def test_a_state_that_is_no_longer_finite_is_an_error(rigid, on_plane, monkeypatch):
    from ninedisk.harness.engines.bullet.session import BulletSession

    def explode(self, _n_steps):
        self.world.resetBaseVelocity(self.disks[0], [math.inf, 0.0, 0.0])

    monkeypatch.setattr(BulletSession, "advance", explode)
    with pytest.raises(EngineError, match="no longer finite"):
        run(on_plane(rigid()), 2)


def test_without_pybullet_the_adapter_says_how_to_get_it(rigid, on_plane, monkeypatch):
    monkeypatch.setattr(package, "package_version", lambda name: (None, f"no {name}"))
    assert not ENGINE.info().installed
    with pytest.raises(EngineNotInstalledError, match="pip install pybullet"):
        ENGINE.run(on_plane(rigid()), numerics(1), [])


@needs_bullet
@pytest.mark.parametrize("params", [{"kind": "elastic"}, {"kind": "plastic"}, {"kind": "elastic", "gap": 0.5025}])
def test_collisions_are_exact(params):
    assert run_case("binary-collision", engine="bullet", params=params).status == "pass"


@needs_bullet
@pytest.mark.parametrize("mu", [0.36, 0.4])
def test_the_incline_meets_the_exact_steps(mu):
    result = run_case("incline-block", engine="bullet", params={"mu": mu, "dt": 0.005})
    assert set(result.measurements.status) <= {"pass", "known-gap"}
    exact = result.measurements[result.measurements.truth == "exact-step"]
    assert len(exact)
    assert exact.abs_error.max() < 1e-12


@needs_bullet
@pytest.mark.parametrize(("dt", "onset"), [(0.01, 0.12), (0.005, 0.115), (0.0025, 0.1125)])
def test_slip_ends_in_the_right_step(dt, onset):
    result = run_case("slip-to-roll", engine="bullet", params={"mu": 0.3, "dt": dt})
    assert result.status == "pass"
    scalars = result.observed.scalars
    assert scalars["slip_end"][1] == pytest.approx(onset, abs=1e-12)
    assert scalars["vx_final"][1] == pytest.approx(2.0 / 3.0, rel=1e-12)


@needs_bullet
def test_plastic_disks_bounce_off_an_elastic_wall(rigid):
    disks = Disks(x=[[0.0, 0.0], [1.05, 0.0]], v=[[1.0, 0.0], [0.0, 0.0]], radius=0.5, mass=2.0)
    back = Wall(name="back", point=(1.6, 0.0), normal=(-1.0, 0.0), law=rigid(restitution=1.0))
    v = run(Scene(disks=disks, disk_disk=rigid(), walls=(back,)), 30).history.v
    assert v[10, :, 0] == pytest.approx([0.5, 0.5], abs=1e-12)
    # Newton's law at both contacts at once: the wall turns the outer disk round, the inner one must not lag behind it.
    assert v[-1, :, 0] == pytest.approx([-0.5, -0.5], abs=1e-10)
