"""The Drake adapters: a time-converged spring engine without slip, and two discrete contact models."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ninedisk.core.errors import InvalidNumericsError
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall, WallSegment
from ninedisk.harness import run_case
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.engine import Engine, EngineNotInstalledError, SupportLevel, run_session
from ninedisk.harness.api.params import resolve
from ninedisk.harness.cases.nine_disk.compression import CASE as COMPRESSION
from ninedisk.harness.cases.nine_disk.compression import WATCH
from ninedisk.harness.cases.nine_disk.scene import LOAD_CASES, MASS
from ninedisk.harness.engines import package
from ninedisk.harness.engines.drake import adapter as adapter
from ninedisk.harness.engines.drake.adapter import ENGINES, no_contact_can_slip, shares_in_series
from ninedisk.references.analytic.assembly.compression import continuous_row

G = 10.0
CONTINUOUS, SAP, LAGGED = ENGINES
INFO = CONTINUOUS.info()
needs_drake = pytest.mark.skipif(not INFO.installed, reason=f"Drake: {INFO.not_installed_because}")


def numerics(n_steps, dt=0.01, engine="drake", **options) -> Numerics:
    return Numerics(dt=dt, n_steps=n_steps, options={f"{engine}.{name}": value for name, value in options.items()})


def run(scene, n_steps=100, *, engine="drake", dt=0.01, watch=((0, 1),), **options):
    """Run in this process: what is tested is the session; the process around it has its own tests."""
    from ninedisk.harness.engines.drake import session as drake_session

    sessions = {
        "drake": drake_session.DrakeSession,
        "drake-sap": drake_session.SapSession,
        "drake-lagged": drake_session.LaggedSession,
    }
    return run_session(sessions[engine], scene, numerics(n_steps, dt, engine, **options), watch)


def compression(**params) -> Scene:
    return COMPRESSION.build(resolve(COMPRESSION, params).params).scene


def row_errors(xi: float, phase: float) -> float:
    """Largest error of the rows' forces over 200 cycles of load case a1, relative to the largest force."""
    load = LOAD_CASES["a1"]
    found = run(compression(load_case="a1", xi=xi), 200, dt=load.dt, watch=WATCH, phase=phase).history
    t_wall = load.load_cycles * load.dt
    exact = continuous_row(found.t, kn=load.kn, mass=MASS, xi=xi, v_wall=load.v_wall, t_wall=t_wall)
    expected = np.stack([exact[0], exact[0], exact[1], exact[1]], axis=1)
    return float(np.abs(found.fn - expected).max() / expected.max())


def test_facts():
    assert [engine.id for engine in ENGINES] == ["drake", "drake-sap", "drake-lagged"]
    assert all(isinstance(engine, Engine) for engine in ENGINES)
    assert [engine.info().contact for engine in ENGINES] == ["spring", "soft", "soft"]
    assert INFO.licence == "BSD-3-Clause"


def test_shares_in_series():
    disk, walls = shares_in_series(3.0, [3.0, 1.0, 0.0])
    pairs = [disk * b / (disk + b) for b in (disk, *walls)]
    np.testing.assert_allclose(pairs, [3.0, 3.0, 1.0, 0.0], rtol=1e-15)
    assert shares_in_series(None, [5.0]) == (10.0, [10.0])


def test_smooth_walls_are_supported_and_rough_ones_are_not():
    smooth = CONTINUOUS.supports(compression(load_case="a1", xi=3.0), numerics(1))
    assert smooth.level is SupportLevel.EQUIVALENT
    assert any("no contact of this scene ever slips" in note for note in smooth.notes)
    rough = CONTINUOUS.supports(compression(load_case="a1", xi=3.0, wall_mu="mu"), numerics(1))
    assert rough.level is SupportLevel.NO
    assert {Capability.SHEAR_SPRING, Capability.FRICTION} <= set(rough.missing)


def test_only_the_symmetric_box_keeps_contacts_from_slipping():
    scene = compression(load_case="a1", xi=3.0)
    assert no_contact_can_slip(scene)
    disks, walls = scene.disks, scene.walls
    fields = {"x": disks.x, "radius": disks.radius, "mass": disks.mass}
    heavy = np.array(disks.mass)
    heavy[4] *= 2.0
    aside = WallSegment(duration=1.0, velocity=(0.1, 0.1))
    left, others = walls[0], walls[1:]

    def with_left(**changes):
        wall = {"name": "left", "point": left.point, "normal": left.normal, "law": left.law, "motion": left.motion}
        return scene.replace(walls=(Wall(**{**wall, **changes}), *others))

    spoilt = {
        "gravity": scene.replace(gravity=(0.0, -1.0)),
        "a mass": scene.replace(disks=Disks(**{**fields, "mass": heavy})),
        "a hole": scene.replace(disks=Disks(**{name: value[:8] for name, value in fields.items()})),
        "a spin": scene.replace(disks=Disks(**fields, omega=1.0)),
        "a velocity": scene.replace(disks=Disks(**fields, v=np.ones((9, 2)))),
        "a rough wall": with_left(law=ContactLaw(kn=left.law.kn, ks=left.law.ks, mu=0.1)),
        "a tilted wall": with_left(normal=(1.0, 0.01)),
        "a wall that rubs": with_left(motion=(aside,)),
        "a wall that turns": with_left(motion=(WallSegment(angular_velocity=0.1),)),
    }
    assert [name for name, other in spoilt.items() if no_contact_can_slip(other)] == []


def test_what_the_continuous_plant_lacks_is_named(rigid, on_plane):
    def missing(law):
        return CONTINUOUS.supports(on_plane(law), numerics(1)).missing

    assert missing(ContactLaw(kn=1e6, beta=0.1, regularised=True)) == (Capability.CONTACT_DAMPING,)
    assert set(missing(rigid(mu=0.3))) == {Capability.FRICTION, Capability.SHEAR_SPRING}
    assert CONTINUOUS.supports(on_plane(rigid()), numerics(1)).level is SupportLevel.APPROXIMATE
    assert CONTINUOUS.supports(on_plane(ContactLaw(kn=1e6)), numerics(1)).level is SupportLevel.EXACT
    motion = (WallSegment(angular_velocity=0.1),)
    turning = CONTINUOUS.supports(on_plane(ContactLaw(kn=1e6), motion=motion), numerics(1))
    assert turning.missing == (Capability.ROTATING_WALLS,)


def test_stiffnesses_that_no_series_gives_are_refused():
    disks = Disks(x=[[0.0, 0.5], [3.0, 0.5]], radius=0.5, mass=2.0)
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=ContactLaw(kn=2e6))
    scene = Scene(disks=disks, disk_disk=ContactLaw(kn=1e6), walls=(floor,))
    support = CONTINUOUS.supports(scene, numerics(1))
    assert support.level is SupportLevel.NO
    assert "wall 'floor' cannot have kn = 2e+06" in support.notes[0]


@needs_drake
def test_the_compression_converges_with_the_third_order():
    assert row_errors(3.0, 0.04) < 1e-6
    coarse, fine = row_errors(0.0, 0.08), row_errors(0.0, 0.04)
    assert fine < 1e-5
    assert coarse / fine == pytest.approx(8.0, rel=0.15)


@needs_drake
def test_wrong_shares_are_noticed(monkeypatch):
    from ninedisk.harness.engines.drake import session as drake_session

    def as_they_are(between, with_walls):
        return between, list(with_walls)

    monkeypatch.setattr(drake_session, "shares_in_series", as_they_are)
    assert row_errors(3.0, 0.08) > 0.3


@needs_drake
def test_no_contact_of_the_box_slips():
    load = LOAD_CASES["a1"]
    history = run(compression(load_case="a1", xi=0.0), 100, dt=load.dt, watch=WATCH).history
    grid = history.x.reshape(-1, 3, 3, 2)
    assert np.ptp(grid[..., 0], axis=1).max() < 1e-10  # columns stay straight, 1e-12 of a radius
    assert np.ptp(grid[..., 1], axis=2).max() < 1e-10
    assert np.abs(history.omega).max() < 1e-12


@needs_drake
def test_a_wall_s_motion_may_end_within_a_step(on_plane, monkeypatch):
    from ninedisk.harness.engines.drake import session as drake_session

    motion = (WallSegment(duration=0.0625, velocity=(0.0, 0.2)),)
    scene = on_plane(ContactLaw(kn=1e3), motion=motion, g=0.0)
    fine = run(scene, 80, dt=0.0125, phase=0.01).history
    coarse = run(scene, 20, dt=0.05, phase=0.01).history
    np.testing.assert_allclose(coarse.wall_point[-1, 0], [0.0, 0.0125], atol=1e-15)
    np.testing.assert_allclose(coarse.v[-1, 0], fine.v[-1, 0], atol=2e-6)  # the kink where contact ends: h^2
    monkeypatch.setattr(drake_session, "moving_until", lambda _scene: 0.0)  # a wall that nobody stops
    assert np.abs(run(scene, 20, dt=0.05).history.v[-1, 0] - fine.v[-1, 0]).max() > 1e-4


@needs_drake
def test_forces_are_instantaneous_and_of_the_scene_s_signs(on_plane):
    kn, weight = 1e5, 20.0
    scene = on_plane(ContactLaw(kn=kn), height=-weight / kn)
    history = CONTINUOUS.run(scene, numerics(20), ((0, 1),)).history
    assert history.force_meaning == "instantaneous"
    np.testing.assert_allclose(history.fn[:, 0], weight, rtol=1e-9)  # kn times the round-off of the height
    np.testing.assert_allclose(history.wall_force[:, 0], [[0.0, -weight]] * 21, rtol=1e-9)
    np.testing.assert_array_equal(history.fs, 0.0)


@needs_drake
def test_global_damping_acts_on_velocity_and_spin(on_plane):
    scene = on_plane(ContactLaw(kn=1e3), height=1.0, g=0.0, rotating=True, v=(2.0, 0.0), omega=3.0).replace(xi=1.5)
    history = run(scene, phase=0.02).history
    np.testing.assert_allclose(history.v[-1, 0, 0], 2.0 * math.exp(-1.5), rtol=1e-7)
    np.testing.assert_allclose(history.omega[-1, 0], 3.0 * math.exp(-1.5), rtol=1e-7)
    blocked = on_plane(ContactLaw(kn=1e3), height=1.0, g=0.0, omega=3.0).replace(xi=1.5)
    np.testing.assert_allclose(run(blocked).history.omega[-1, 0], 3.0, rtol=1e-12)


@needs_drake
def test_an_elastic_collision_is_that_of_springs():
    result = run_case("binary-collision", engine="drake", params={"kind": "elastic", "gap": 0.5025})
    assert result.status == "pass"
    assert result.observed.scalars["restitution_effective"][1] == pytest.approx(1.0, abs=1e-6)


def test_what_discrete_plants_lack_is_named(rigid, on_plane):
    for engine in (SAP, LAGGED):
        assert engine.supports(on_plane(rigid(restitution=0.5)), numerics(1)).missing == (Capability.RESTITUTION,)
        moving = on_plane(rigid(), motion=(WallSegment(velocity=(0.1, 0.0)),))
        assert engine.supports(moving, numerics(1)).missing == (Capability.MOVING_WALLS,)
        assert "disk 0 spins" in engine.supports(on_plane(rigid(), omega=1.0), numerics(1)).notes[0]
        assert engine.supports(on_plane(rigid(mu=0.3)), numerics(1)).level is SupportLevel.APPROXIMATE
        preloaded = on_plane(rigid(mu=0.3), height=-1e-7).replace(initial_shear={(0, 1): -1.0})
        assert "overlaps are kept" in engine.supports(preloaded, numerics(1)).notes[0]


@pytest.mark.parametrize(("disk_mu", "wall_mu", "word"), [(0.2, 0.4, "twice"), (0.0, 0.3, "0 for smooth disks")])
def test_frictions_that_no_harmonic_mean_gives_are_refused(rigid, disk_mu, wall_mu, word):
    disks = Disks(x=[[0.0, 0.5], [3.0, 0.5]], radius=0.5, mass=2.0)
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=rigid(mu=wall_mu))
    scene = Scene(disks=disks, disk_disk=rigid(mu=disk_mu), walls=(floor,))
    support = LAGGED.supports(scene, numerics(1))
    assert support.level is SupportLevel.NO
    assert word in support.notes[0]
    assert LAGGED.supports(scene.replace(disk_disk=rigid(mu=wall_mu)), numerics(1)).level is not SupportLevel.NO


@needs_drake
@pytest.mark.parametrize("engine", ["drake-sap", "drake-lagged"])
@pytest.mark.parametrize("degrees", [0, 33, 90, 200])
def test_a_disk_at_rest_weighs_what_it_weighs(rigid, on_plane, engine, degrees):
    mu, slope = 0.4, math.radians(20.0)
    sink = -20.0 * math.cos(slope) / 1e8
    history = run(on_plane(rigid(mu=mu), degrees=degrees, slope=slope, height=sink), engine=engine).history
    assert history.force_meaning == "step-mean"
    assert np.isnan(history.fn[0, 0])
    np.testing.assert_allclose(history.fn[2:, 0], 20.0 * math.cos(slope), rtol=1e-4)
    np.testing.assert_allclose(history.fs[-1, 0], -20.0 * math.sin(slope), rtol=1e-4)
    np.testing.assert_allclose(history.wall_force[-1, 0], np.array(scene_weight(degrees, slope)), rtol=1e-4, atol=1e-3)
    assert np.hypot(*history.v[-1, 0]) < 1e-4


def scene_weight(degrees: float, slope: float) -> tuple[float, float]:
    """Weight [N] of the disk of `on_plane`, which the wall bears."""
    angle = math.radians(degrees) + slope - math.pi / 2
    return 20.0 * math.cos(angle), 20.0 * math.sin(angle)


@needs_drake
def test_each_pair_has_its_own_friction(rigid):
    disks = Disks(
        x=[[0.0, 0.5 - 2e-7], [5.0, 0.5 - 3e-7]], v=[[1.0, 0.0]] * 2, radius=0.5, mass=[2.0, 3.0], rotating=False
    )
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=rigid(mu=0.25))
    scene = Scene(disks=disks, disk_disk=rigid(mu=0.4), walls=(floor,), gravity=(0.0, -G))
    history = run(scene, 20, engine="drake-lagged", watch=((0, 2), (1, 2))).history
    np.testing.assert_allclose(history.v[-1, :, 0], 1.0 - 0.25 * G * 0.2, rtol=1e-4)


@needs_drake
@pytest.mark.parametrize(("engine", "rise"), [("drake-sap", 0.3 * 0.01 / (1.0 + 0.3**2)), ("drake-lagged", 0.0)])
def test_only_the_convex_model_dilates(rigid, on_plane, engine, rise):
    history = run(on_plane(rigid(mu=0.3), v=(1.0, 0.0), g=0.0), 1, engine=engine).history
    # The rise of the associated rule in its first step, mu v dt/(1 + mu^2); relaxation_time 0.1 s is no rigid contact.
    assert history.gap[1, 0] == pytest.approx(rise, abs=0.01 * 0.003)


@needs_drake
def test_friction_of_the_lagged_model_comes_a_step_late(rigid, on_plane):
    slope, sink = math.radians(20.0), -20.0 * math.cos(math.radians(20.0)) / 1e8
    pull = G * math.sin(slope) * 0.01
    landing = run(on_plane(rigid(mu=0.4), slope=slope), 1, engine="drake-lagged").history
    assert landing.v[1, 0, 0] == pytest.approx(pull, rel=1e-3)
    resting = run(on_plane(rigid(mu=0.4), slope=slope, height=sink), 1, engine="drake-lagged").history
    assert abs(resting.v[1, 0, 0]) < 0.01 * pull


@needs_drake
@pytest.mark.parametrize(("engine", "e"), [("drake-sap", 1e-4), ("drake-lagged", 1.1e-4)])
def test_a_plastic_collision_parts_slowly(engine, e):
    result = run_case("binary-collision", engine=engine, params={"kind": "plastic"})
    assert result.status == "pass"
    assert 0.0 <= result.observed.scalars["restitution_effective"][1] < e


@needs_drake
def test_the_convex_model_slides_off_and_the_lagged_one_does_not():
    exact = 3.730799842741606e-2
    lagged = run_case("incline-block", engine="drake-lagged", params={"mu": 0.36, "dt": 0.0025})
    assert set(lagged.measurements.status) <= {"pass", "known-gap"}
    assert lagged.observed.scalars["vx_final"][1] == pytest.approx(exact, rel=1e-3)
    sap = run_case("incline-block", engine="drake-sap", params={"mu": 0.36, "dt": 0.0025})
    assert set(sap.measurements.status) <= {"pass", "known-gap", "known-difference"}
    assert sap.status == "known-difference"  # it chatters
    force = sap.observed.series["fn"][1][1:]
    assert force.min() == 0.0  # it leaves the plane
    assert force.mean() == pytest.approx(7.854 * G * math.cos(math.radians(20.0)), rel=0.02)
    gap = sap.observed.series["gap"][1]
    assert 0.5 < gap.max() / (0.36 * exact * 0.0025) < 2.0  # about mu v dt


@needs_drake
@pytest.mark.parametrize(("dt", "onset"), [(0.01, 0.12), (0.005, 0.115), (0.0025, 0.1125)])
def test_slip_ends_in_the_right_step(dt, onset):
    lagged = run_case("slip-to-roll", engine="drake-lagged", params={"mu": 0.3, "dt": dt})
    assert lagged.status == "pass"
    assert lagged.observed.scalars["slip_end"][1] == pytest.approx(onset, abs=1e-12)
    assert lagged.observed.scalars["vx_final"][1] == pytest.approx(2.0 / 3.0, rel=1e-6)
    sap = run_case("slip-to-roll", engine="drake-sap", params={"mu": 0.3, "dt": dt})
    assert sap.observed.scalars["vx_final"][1] == pytest.approx(2.0 / 3.0, rel=2e-4)


@needs_drake
def test_settings_are_recorded_and_runs_repeat_to_the_bit(rigid, on_plane):
    scene = on_plane(rigid(mu=0.3), slope=0.5, degrees=33.0)
    one, two = (run(scene, 20, engine="drake-sap", relaxation_time=0.2) for _ in range(2))
    assert one.settings["drake-sap.relaxation_time"] == 0.2
    assert one.settings["drake-sap.near_rigid_threshold"] == 0.0
    np.testing.assert_array_equal(one.history.x, two.history.x)
    springs = run(on_plane(ContactLaw(kn=1e5)), 1, phase=0.01).settings
    assert springs["drake.phase"] == 0.01
    assert springs["drake.step [s]"] <= 0.01 / math.sqrt(1e5)


@needs_drake
@pytest.mark.parametrize(
    ("engine", "option", "words"),
    [
        (CONTINUOUS, {"phase": 1.0}, r"drake.phase = 1.0 is not allowed: it must be a number in \[0.0001, 0.5\]"),
        (CONTINUOUS, {"integrator": "rk2"}, "'drake.integrator' is unknown"),
        (SAP, {"relaxation_time": -1.0}, "drake-sap.relaxation_time = -1.0"),
        (LAGGED, {"relaxation_time": 1.0}, "'drake-lagged.relaxation_time' is unknown"),
        (LAGGED, {"stiction_tolerance": 0.0}, "drake-lagged.stiction_tolerance = 0.0"),
    ],
)
def test_bad_settings_are_refused_before_a_process_starts(rigid, on_plane, engine, option, words):
    with pytest.raises(InvalidNumericsError, match=words):
        engine.run(on_plane(rigid()), numerics(1, engine=engine.id, **option), [])


def test_without_drake_the_adapters_say_how_to_get_it(rigid, on_plane, monkeypatch):
    monkeypatch.setattr(package, "package_version", lambda name: (None, f"no {name}"))
    for engine in ENGINES:
        assert not engine.info().installed
        with pytest.raises(EngineNotInstalledError, match="pip install drake"):
            engine.run(on_plane(rigid()), numerics(1), [])
