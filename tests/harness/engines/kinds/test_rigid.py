"""What all adapters of engines with rigid contacts owe a scene: signs, coefficients by pair, exact walls, settings on record."""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from ninedisk.core.errors import InvalidNumericsError
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall, WallSegment
from ninedisk.harness import run_case
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.engine import Engine, EngineError, EngineNotInstalledError, SupportLevel, run_session
from ninedisk.harness.api.registry import get_engine
from ninedisk.harness.engines import package
from ninedisk.harness.engines.dart.adapter import FORCE_MIXING
from ninedisk.harness.engines.pymunk import adapter as pymunk_adapter

G = 10.0
EPS = float(np.finfo(np.float32).eps)
SOFT = 2.0 * FORCE_MIXING
"""DART's contact gives way by FORCE_MIXING of a step's change of velocity; the sum of two such contacts, or 1 + e of it."""


@dataclass(frozen=True, kw_only=True)
class Expected:
    """What one engine is expected to give.

    Attributes
    ----------
    session : str
        Class in the engine's module ``session``; "" where only the adapter makes it.
    facts : tuple
        Scheme, contact, precision, licence.
    force, speed, gap : float
        Relative errors of forces and velocities, largest gap [m] of a contact at rest or sliding: round-off of the engine's
        precision, grown over a hundred steps; or its regularisation.
    impact : float
        Error of the velocity after an impact at 1 m/s.
    normal_before : bool
        Whether a step's contacts have the normals of its begin; else of its end.
    between : ContactLaw fields
        Friction between disks and restitution of the wall in the test of pairs: what the engine can combine.
    stack : tuple
        Relative error of a stack's weights after 20 steps, and settings that leave more than 1 N of them after the first.
    rides : (int, int, float)
        Samples from which on a disk has a moving wall's velocity and the gap below, and that gap [m].
    turning_gap : float
        Largest gap [m] on a turning wall, from the second of these samples on.
    given, recorded : mapping
        Options, and what must be on record beside them.
    touch : str
        Recorded length within which bodies touch, some units of round-off.
    bad : sequence of (options, words of the message)
    """

    session: str
    distribution: str
    facts: tuple[str, str, str, str]
    force: float = math.nan
    speed: float = math.nan
    gap: float = math.nan
    impact: float = math.nan
    normal_before: bool = True
    between: tuple[float, float] = (0.0, 0.8)
    stack: tuple[float, Mapping[str, Any]] = (1e-9, {})
    rides: tuple[int, int, float] = (2, 0, 1e-12)
    turning_gap: float = 40 * 0.5 * (0.5 * 0.01) ** 2 * 1.5  # drift of a straight step along a circle, omega^2 r dt^2/2
    given: Mapping[str, Any] = field(default_factory=dict)
    recorded: Mapping[str, Any] = field(default_factory=dict)
    touch: str = ""
    bad: tuple[tuple[Mapping[str, Any], str], ...] = ()


EXPECTED = {
    "pymunk": Expected(
        session="PymunkSession",
        distribution="pymunk",
        facts=("position-first-euler", "impulse", "float64", "MIT"),
        force=1e-12,
        speed=1e-12,
        gap=1e-13,
        impact=1e-12,
        normal_before=False,
        # The first step sinks the wall's way into the disk; from the second on the disk rides on it.
        rides=(5, 2, 1e-12),
        turning_gap=0.5 * 0.01 * 0.5 * 1.5 * 0.01,
        stack=(1e-9, {"iterations": 2}),
        given={"iterations": 7, "collision_bias": 0.5},
        recorded={"collision_persistence": 1},
        touch="collision_slop",
        bad=(
            ({"iterations": 0}, "pymunk.iterations = 0"),
            ({"iterations": 2.5}, "pymunk.iterations = 2.5"),
            ({"collision_bias": 2.0}, r"a number in \[0, 1\]"),
            ({"slop": 1.0}, "'pymunk.slop' is unknown"),
        ),
    ),
    "box2d": Expected(
        session="Box2DSession",
        distribution="Box2D",
        facts=("semi-implicit-euler", "impulse", "float32", "zlib"),
        # On a tilted plane each of the hundred iterations rounds a velocity of 2.2 m/s; a step changes it by g dt, a hundredth.
        force=100 * EPS * 2.2 / 0.1,
        speed=100 * EPS,
        gap=2e-5,
        impact=16 * EPS,
        # The slop, and the wall's way in the first step, which finds the disk at rest.
        rides=(5, 0, 0.2 * 0.01 + 1e-3),
        turning_gap=0.5 * 1.0 * 0.01 + 1e-3,
        stack=(1e-4, {"velocity_iterations": 2}),
        given={"velocity_iterations": 7},
        recorded={"allow_sleep": False},
        bad=(
            ({"velocity_iterations": 0}, "box2d.velocity_iterations = 0"),
            ({"position_iterations": 2.5}, "whole number"),
            ({"slop": 1.0}, "'box2d.slop' is unknown"),
        ),
    ),
    "bullet": Expected(
        session="BulletSession",
        distribution="pybullet",
        facts=("semi-implicit-euler", "impulse", "float64", "zlib"),
        force=1e-11,  # a gap of rounding is closed at once, by a velocity of gap/dt: 1e-15/0.01
        speed=1e-12,
        gap=1e-13,
        impact=1e-11,
        stack=(1e-9, {"iterations": 10}),
        given={"iterations": 7, "contact_erp": 0.5},
        recorded={"contactERP": 0.5, "contactSlop": 0.0, "linearDamping": 0.0, "restitutionVelocityThreshold": 0.0},
        touch="contactBreakingThreshold",
        bad=(
            ({"iterations": 0}, "bullet.iterations = 0"),
            ({"iterations": True}, "bullet.iterations = True"),
            ({"iterations": "many"}, "bullet.iterations = 'many'"),
            ({"contact_erp": math.nan}, r"in \[0, 1\]"),
            ({"slop": 1.0}, "'bullet.slop' is unknown"),
        ),
    ),
    "dart": Expected(
        session="DartSession",
        distribution="dartpy",
        facts=("semi-implicit Euler, regularised", "soft", "float64", "BSD-2-Clause"),
        force=SOFT,
        speed=SOFT,
        gap=SOFT * G * 0.01,
        impact=SOFT,
        rides=(2, 0, SOFT * 0.36),  # of the wall's velocity, for the whole way of 25 steps
        between=(0.4, 0.5),
        stack=(1e-9, {"solver": "dantzig"}),  # why it is not the default
        given={"solver": "nsgs"},
        recorded={"collision_detector": "dart", "split_impulse": True, "deactivation": False},
        touch="touch",
        bad=(
            ({"solver": "lemke"}, "use one of nsgs, dantzig"),
            ({"cfm": 0.0}, "'dart.cfm' is unknown"),
        ),
    ),
    "mujoco": Expected(
        session="MuJoCoSession",
        distribution="mujoco",
        facts=("semi-implicit-euler in substeps", "soft", "float64", "Apache-2.0"),
        stack=(1e-6, {}),
        given={"substeps": 50},
        recorded={"timestep": 0.01 / 50, "cone": "elliptic"},
        bad=(
            ({"substeps": 0}, "mujoco.substeps = 0"),
            ({"substeps": 2.5}, "whole number"),
            ({"impedance": 1.0}, "mujoco.impedance = 1.0"),
            ({"slip_damping": 2.0}, r"in \[1e-06, 1\]"),
            ({"solref": 1.0}, "'mujoco.solref' is unknown"),
        ),
    ),
}
RIGID = [engine for engine in EXPECTED if engine != "mujoco"]
"""Those whose contacts do not last: MuJoCo's have their own tests beside."""


@dataclass(frozen=True)
class Case:
    """An engine, and how a scene is run in this process: what is tested is the session, not the process around it."""

    engine: Any
    expected: Expected

    def numerics(self, n_steps: int, dt: float = 0.01, **options: Any) -> Numerics:
        named = {f"{self.engine.id}.{name}": value for name, value in options.items()}
        return Numerics(dt=dt, n_steps=n_steps, options=named)

    def run(self, scene: Scene, n_steps: int = 100, *, dt: float = 0.01, watch: Any = ((0, 1),), **options: Any) -> Any:
        numerics = self.numerics(n_steps, dt, **options)
        if self.engine.id == "pymunk":
            return self.engine.run(scene, numerics, watch)
        return run_session(self.session(), scene, numerics, watch)

    def session(self) -> Any:
        home = importlib.import_module(f"ninedisk.harness.engines.{self.engine.id}.session")
        return getattr(home, self.expected.session)


@pytest.fixture
def case(request: pytest.FixtureRequest) -> Case:
    """The engine of the parametrisation, where it is installed."""
    engine = get_engine(request.param)
    if not engine.info().installed:
        pytest.skip(f"{engine.info().name}: {engine.info().not_installed_because}")
    return Case(engine, EXPECTED[request.param])


each = pytest.mark.parametrize("case", EXPECTED, indirect=True)
each_rigid = pytest.mark.parametrize("case", RIGID, indirect=True)
Law, Plane = Callable[..., ContactLaw], Callable[..., Scene]


@pytest.mark.parametrize("engine", EXPECTED)
def test_facts(engine: str) -> None:
    info = get_engine(engine).info()
    assert isinstance(get_engine(engine), Engine)
    assert (info.scheme, info.contact, info.precision, info.licence) == EXPECTED[engine].facts


@pytest.mark.parametrize("engine", EXPECTED)
def test_what_is_not_installed_says_how_to_get_it(
    engine: str, rigid: Law, on_plane: Plane, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in (package, pymunk_adapter):
        monkeypatch.setattr(module, "package_version", lambda name: (None, f"no {name}"))
    info = get_engine(engine).info()
    assert not info.installed
    assert (info.not_installed_because, info.install) == (
        f"no {EXPECTED[engine].distribution}",
        f"pip install {EXPECTED[engine].distribution}",
    )
    if engine != "pymunk":  # which tries to import it
        with pytest.raises(EngineNotInstalledError, match=info.install):
            get_engine(engine).run(on_plane(rigid()), Numerics(dt=0.01, n_steps=1), [])


@pytest.mark.parametrize("engine", EXPECTED)
def test_a_stiffness_that_matters_is_refused_by_name(engine: str, rigid: Law, on_plane: Plane) -> None:
    numerics = Numerics(dt=0.01, n_steps=1)
    support = get_engine(engine).supports(on_plane(ContactLaw(kn=1e6, ks=1e6, mu=0.3, beta=0.1)), numerics)
    assert support.level is SupportLevel.NO
    assert {Capability.LINEAR_CONTACT, Capability.SHEAR_SPRING, Capability.CONTACT_DAMPING} <= set(support.missing)
    soft = get_engine(engine).info().contact == "soft"
    fits = get_engine(engine).supports(on_plane(rigid()), numerics)
    assert fits.level is (SupportLevel.APPROXIMATE if soft else SupportLevel.EXACT)
    assert soft or not fits.notes


@pytest.mark.parametrize(
    ("engine", "options", "words"), [(name, *bad) for name, expected in EXPECTED.items() for bad in expected.bad]
)
def test_bad_settings_are_refused_before_anything_starts(
    engine: str, options: Mapping[str, Any], words: str, rigid: Law, on_plane: Plane
) -> None:
    if not get_engine(engine).info().installed:
        pytest.skip("not installed")
    given = {f"{engine}.{name}": value for name, value in options.items()}
    with pytest.raises(InvalidNumericsError, match=words):
        get_engine(engine).run(on_plane(rigid()), Numerics(dt=0.01, n_steps=1, options=given), [])


@each_rigid
@pytest.mark.parametrize("degrees", [*range(0, 360, 45), 7.3, 30.0, 111.1, 233.0])
def test_a_touching_disk_is_in_contact_from_the_first_step(
    case: Case, rigid: Law, on_plane: Plane, degrees: float
) -> None:
    slope, mu = 0.5, 0.3
    history = case.run(on_plane(rigid(mu=mu), degrees=degrees, slope=slope)).history
    down, normal = G * (math.sin(slope) - mu * math.cos(slope)), 2.0 * G * math.cos(slope)
    np.testing.assert_allclose(history.fn[1:, 0], normal, rtol=case.expected.force)
    np.testing.assert_allclose(history.fs[1:, 0], -mu * normal, rtol=case.expected.force)
    np.testing.assert_allclose(history.gap[:, 0], 0.0, atol=case.expected.gap)
    np.testing.assert_allclose(np.hypot(*history.v[-1, 0]), down, rtol=case.expected.speed)


@each_rigid
def test_forces_follow_the_scene_s_signs_and_are_step_means(case: Case, rigid: Law, on_plane: Plane) -> None:
    history = case.run(on_plane(rigid(mu=0.4), v=(-1.0, 0.0)), 3).history
    rtol = min(case.expected.force, 4 * EPS) if case.expected.facts[2] == "float32" else max(case.expected.force, 1e-13)
    assert history.force_meaning == "step-mean"
    assert np.isnan(history.fn[0, 0])
    assert np.isnan(history.fs[0, 0])
    # n points from the disk down into the wall, t = +x; the disk slides to the left, friction pushes it to the right.
    np.testing.assert_allclose([history.fn[1, 0], history.fs[1, 0]], [20.0, 8.0], rtol=rtol)
    np.testing.assert_allclose(history.wall_force[1, 0], [-8.0, -20.0], rtol=rtol)
    np.testing.assert_allclose(history.v[1, 0], [-1.0 + 0.4 * G * 0.01, 0.0], atol=rtol)


@each_rigid
def test_each_pair_has_its_own_friction_and_restitution(case: Case, rigid: Law) -> None:
    """Two disks in a row between walls that all differ: engines would combine coefficients of bodies, each by its own rule."""
    mu, e = case.expected.between
    disks = Disks(x=[[0.0, 0.5], [3.0, 0.5]], v=[[4.0, 0.0], [0.0, 0.0]], radius=0.5, mass=[2.0, 3.0], rotating=False)
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=rigid(mu=0.25))
    back = Wall(name="back", point=(3.7, 0.0), normal=(-1.0, 0.0), law=rigid(restitution=e))
    scene = Scene(disks=disks, disk_disk=rigid(mu=mu, restitution=0.3), walls=(floor, back), gravity=(0.0, -G))
    history = case.run(scene, 400, dt=0.0025, watch=((0, 1), (0, 2), (1, 2), (1, 3))).history
    speed, fall = history.v[:, :, 0], 0.25 * G * 0.0025
    hit = int(np.flatnonzero(history.fn[:, 0] > 0)[0])
    # Round-off of hundreds of steps with velocities near 4, changed by 0.006 in each.
    rounding = 1e-4 if case.expected.facts[2] == "float32" else max(case.expected.speed, 1e-9)
    assert speed[0, 0] - speed[hit - 1, 0] == pytest.approx((hit - 1) * fall, rel=rounding)
    parted, met = speed[hit, 1] - speed[hit, 0], speed[hit - 1, 0] - speed[hit - 1, 1]
    assert parted / met == pytest.approx(0.3, abs=2 * fall)  # the floor's friction over the step of the impact
    turned = int(np.flatnonzero(history.fn[:, 3] > 0)[0])
    assert -speed[turned, 1] / speed[turned - 1, 1] == pytest.approx(e, abs=2 * fall)


@each_rigid
@pytest.mark.parametrize("restitution", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("height", [0.0, 0.05, 0.0525])
def test_restitution_of_a_wall_wherever_in_the_step_it_is_met(
    case: Case, rigid: Law, on_plane: Plane, restitution: float, height: float
) -> None:
    scene = on_plane(rigid(restitution=restitution), v=(0.0, -1.0), height=height, g=0.0)
    assert case.run(scene, 12).history.v[-1, 0, 1] == pytest.approx(restitution, abs=case.expected.impact)


@each_rigid
@pytest.mark.parametrize("restitution", [0.0, 0.3, 1.0])
def test_oblique_impact_of_two_disks(case: Case, rigid: Law, restitution: float) -> None:
    line = np.array([0.6, 0.8])
    x = [[0.0, 0.0], 2.0 * line + 1e-3]
    disks = Disks(x=x, v=[line + np.array([-0.8, 0.6]), [0.0, 0.0]], radius=1.0, mass=[1.0, 3.0])
    history = case.run(Scene(disks=disks, disk_disk=rigid(restitution=restitution)), 3).history
    hit = int(np.flatnonzero(history.fn[:, 0] > 0)[0])
    at = hit - 1 if case.expected.normal_before else hit
    apart = history.x[at, 1] - history.x[at, 0]
    normal = apart / np.hypot(*apart)
    approach = (disks.v[0] - disks.v[1]) @ normal
    parting = (history.v[-1, 1] - history.v[-1, 0]) @ normal
    assert parting == pytest.approx(restitution * approach, abs=case.expected.impact)
    # Momentum is exchanged: round-off of the precision, whatever the contact's regularisation.
    exchanged = 8 * EPS if case.expected.facts[2] == "float32" else 1e-12
    np.testing.assert_allclose(history.v[-1, 0] + 3.0 * history.v[-1, 1], disks.v[0], atol=exchanged)
    turned = 0.01 / 2.0  # the displacement in a step over the distance: normals of its begin and its end
    impulse = history.fn[hit, 0] * 0.01
    assert impulse == pytest.approx((1.0 + restitution) * approach * 0.75, rel=max(case.expected.impact, turned**2))


@each
def test_a_stack_carries_its_weight(case: Case, rigid: Law) -> None:
    disks = Disks(x=[[0.0, 0.5], [0.0, 1.5], [0.0, 2.5]], radius=0.5, mass=[1.0, 2.0, 3.0])
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=rigid(mu=0.5))
    scene = Scene(disks=disks, disk_disk=rigid(mu=0.5), walls=(floor,), gravity=(0.0, -G))
    weights, watch = [60.0, 50.0, 30.0], ((0, 3), (0, 1), (1, 2))
    rtol, poor = case.expected.stack
    steps = 100 if case.engine.id == "mujoco" else 20
    np.testing.assert_allclose(case.run(scene, steps, watch=watch).history.fn[-1], weights, rtol=rtol)
    if poor:
        assert np.abs(case.run(scene, 1, watch=watch, **poor).history.fn[1] - weights).max() > 0.5


@each_rigid
def test_moving_walls_reach_their_exact_pose_and_carry_a_disk(case: Case, rigid: Law, on_plane: Plane) -> None:
    motion = (
        WallSegment(duration=0.25, velocity=(0.3, 0.2)),
        WallSegment(duration=0.25, amplitude=(0.0, 0.05), frequency=3.0),
    )
    history = case.run(on_plane(rigid(mu=2.0), motion=motion), 60).history
    np.testing.assert_allclose(history.wall_point[25, 0], [0.075, 0.05], atol=1e-14)
    np.testing.assert_allclose(history.wall_point[-1, 0], [0.075, 0.05 + 0.05 * math.sin(0.75)], atol=1e-14)
    moves, sits, gap = case.expected.rides
    precise = 1e-5 if case.expected.facts[2] == "float32" else max(case.expected.speed, 1e-12)
    np.testing.assert_allclose(history.v[moves:25, 0], [[0.3, 0.2]] * (25 - moves), atol=precise)
    np.testing.assert_allclose(history.gap[sits:25, 0], 0.0, atol=gap)


@each_rigid
def test_a_turning_wall_carries_the_disk(case: Case, rigid: Law, on_plane: Plane) -> None:
    motion = (WallSegment(angular_velocity=0.5, pivot=(-1.0, 0.0)),)
    history = case.run(on_plane(rigid(mu=2.0), motion=motion), 40).history
    np.testing.assert_allclose(history.wall_angle[:, 0], math.pi / 2 + 0.5 * history.t, atol=1e-14)
    np.testing.assert_allclose(history.wall_point[-1, 0], [-1.0 + math.cos(0.2), math.sin(0.2)], atol=1e-14)
    assert np.abs(history.gap[case.expected.rides[1] :, 0]).max() < case.expected.turning_gap


@each_rigid
def test_a_disk_has_its_own_inertia(case: Case, rigid: Law, on_plane: Plane) -> None:
    scene = on_plane(rigid(mu=0.3), v=(1.0, 0.0), rotating=True)
    # A sphere would roll at 5/7.
    assert case.run(scene).history.omega[-1, 0] == pytest.approx(-2.0 / 3.0 / 0.5, rel=case.expected.speed)


@pytest.mark.parametrize("case", ["pymunk", "box2d", "bullet"], indirect=True)
def test_disks_that_cannot_turn_keep_their_spin(case: Case, rigid: Law, on_plane: Plane) -> None:
    history = case.run(on_plane(rigid(mu=0.3), v=(1.0, 0.0), omega=0.75)).history
    np.testing.assert_array_equal(history.omega[:, 0], 0.75)
    if case.engine.id == "box2d":
        assert history.angle[-1, 0] == pytest.approx(0.75, rel=1e-5)


@pytest.mark.parametrize("case", ["bullet", "dart"], indirect=True)
@pytest.mark.parametrize(("dt", "onset"), [(0.01, 0.12), (0.005, 0.115), (0.0025, 0.1125)])
def test_slip_ends_in_the_right_step(case: Case, dt: float, onset: float) -> None:
    result = run_case("slip-to-roll", engine=case.engine.id, params={"mu": 0.3, "dt": dt})
    assert result.status == "pass"
    assert result.observed.scalars["slip_end"][1] == pytest.approx(onset, abs=1e-12)
    assert result.observed.scalars["vx_final"][1] == pytest.approx(2.0 / 3.0, rel=case.expected.speed)


@each
def test_settings_are_recorded_and_runs_repeat_to_the_bit(case: Case, rigid: Law, on_plane: Plane) -> None:
    """In its own process, and the same there as here."""
    scene, given = on_plane(rigid(mu=0.3), slope=0.5, degrees=33.0), case.expected.given
    one, two = (case.engine.run(scene, case.numerics(20, **given), ((0, 1),)) for _ in range(2))
    wanted = {f"{case.engine.id}.{name}": value for name, value in {**given, **case.expected.recorded}.items()}
    assert wanted.items() <= one.settings.items()
    if case.expected.touch:
        assert 0.0 < one.settings[f"{case.engine.id}.{case.expected.touch}"] < 1e-11
    if case.engine.id != "pymunk":
        assert one.settings["engine_version"] == case.engine.info().version
    np.testing.assert_array_equal(one.history.x, two.history.x)
    np.testing.assert_array_equal(one.history.x, case.run(scene, 20, **given).history.x)


@each
def test_settings_of_other_engines_are_left_alone(case: Case, rigid: Law, on_plane: Plane) -> None:
    other = Numerics(dt=0.01, n_steps=1, options={"yade.threads": 2})
    assert case.engine.run(on_plane(rigid()), other, []).history.x.shape == (2, 1, 2)


@each_rigid
def test_a_state_that_is_no_longer_finite_is_an_error(
    case: Case, rigid: Law, on_plane: Plane, monkeypatch: pytest.MonkeyPatch
) -> None:
    copy = case.session().copy

    def explode(self: Any, history: Any, row: int) -> None:
        copy(self, history, row)
        history.v[row, 0, 0] = math.inf if row else 0.0

    monkeypatch.setattr(case.session(), "copy", explode)
    with pytest.raises(EngineError, match=f"{case.session().engine}: the state is no longer finite at step 1"):
        case.run(on_plane(rigid()), 2)
