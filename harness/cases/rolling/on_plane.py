"""Spheres on a plane with friction: thrown, on a slope, sliding in all directions, on a turntable, spinning, against resistances.

Contacts are rigid: springs that regularise them are stiff. The shear springs begin unloaded, so that friction comes up over the slip
``mu fn/ks``, and where rolling begins they swing on, at ``omega^2 = ks (1/m + R^2/I)``, since nothing damps them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.law import Rolling, SphereLaw
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import PlaneSegment, PlaneWall, Spheres, SphereScene
from ninedisk.harness.api.case import (
    Check,
    FloatArray,
    Headline,
    KnownDifference,
    Observed,
    Parameter,
    SphereSetup,
    Value,
)
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.cases.common import (
    CONTACT_DT,
    contact_softness,
    contact_step,
    single,
    single_precision,
    slack_time,
    soft_reason,
)
from ninedisk.harness.cases.differences import FINDING_WORDS, LIFTS, checks_with_allowance, follows_associated_rule
from ninedisk.harness.cases.pyramid import throw_sphere
from ninedisk.harness.results.figures import Figure, Plotted
from ninedisk.references.analytic.on_plane.ball_on_plane import BallHistory, against_twisting, slide_and_roll, slip_of
from ninedisk.references.analytic.on_plane.rolling_incline import roll_down, roll_rates
from ninedisk.references.analytic.on_plane.rolling_resistance import (
    Rolled,
    against_constant_torque,
    against_spring,
    oscillation,
)
from ninedisk.references.analytic.on_plane.slip_to_roll import slip_to_roll
from ninedisk.references.analytic.on_plane.turntable import UNIFORM_SPHERE, turntable

RADIUS, MASS, G = 0.5, 2.0, 10.0
KN, KS_OVER_KN, BETA = 1e8, 0.8, 0.3
PHASE = 0.1
"""Of the swing of a shear spring under a sphere that turns, omega dt."""

WAY = np.array([0.6, 0.8, 0.0])
"""Direction of throws: along no axis, an exact unit vector."""

DIRECTIONS = 24
FIRST = math.radians(5.0)
"""The first direction: none lies on an axis or a diagonal of a pyramid of friction."""

MU = Parameter.positive("mu", 0.3, high=10.0, unit="-", in_id=True, help="friction coefficient")
STEP = Parameter.positive("dt", 1e-3, high=1e-2, unit="s", help="step; sampling of spring engines")


def _law(mu: float, kn: float = KN, beta: float = BETA) -> SphereLaw:
    return SphereLaw(kn=kn, ks=KS_OVER_KN * kn, mu=mu, beta=beta, restitution=0.0, regularised=True)


def _swing(kn: float, *, turning: bool = True) -> float:
    """Angular frequency of a shear spring under a sphere [rad/s]."""
    return math.sqrt(KS_OVER_KN * kn * (1.0 + (1.0 / UNIFORM_SPHERE if turning else 0.0)) / MASS)


def _spheres(x: FloatArray, v: FloatArray) -> Spheres:
    return Spheres(x=x, v=v, radius=np.full(len(x), RADIUS), mass=np.full(len(x), MASS))


def _numerics(params: Mapping[str, Any], duration: float, every: int = 1, kn: float = KN) -> Numerics:
    dt = params["dt"]
    contact_dt = contact_step(dt, PHASE / _swing(kn)) if params["contact_dt"] is None else params["contact_dt"]
    return Numerics(
        dt=dt,
        n_steps=max(1, math.ceil(duration / dt)),
        contact_dt=contact_dt,
        sample_every=every,
        impact="newton",
        sliding="coulomb",
    )


def _velocity_tolerance(setup: SphereSetup, engine: EngineInfo, pull: float, speed: float) -> float:
    """What a velocity may be off by [m/s], where friction pulls with ``pull`` [m/s^2] at most on what has ``speed`` [m/s]."""
    t_end = setup.numerics.dt * setup.numerics.n_steps
    bound = 1e-10 * (speed + G * t_end) + single(engine, max(speed, G * t_end), setup.numerics.n_steps)
    if engine.contact == "spring":
        turning, kn = bool(setup.scene.spheres.rotating.all()), setup.scene.walls[0].law.kn
        slow = _swing(kn, turning=False)
        bound += 2.0 * pull / _swing(kn) if turning else pull**2 / slow**2 / speed + pull * PHASE / slow
    bound += (
        pull * (slack_time(engine, setup.numerics.dt) + contact_softness(engine) * t_end)
        + contact_softness(engine) * speed
    )
    if Difference.FRICTION_LAGS in engine.differences:
        bound += 2.0 * pull * setup.numerics.dt
    if follows_associated_rule(engine, setup.numerics):
        bound += speed
    return bound


def _reason(engine: EngineInfo) -> str:
    springs = "; a shear spring comes up over its slip, and swings on undamped" if engine.contact == "spring" else ""
    return f"round-off of the steps{springs}{soft_reason(engine)}{single_precision(engine)}"


def _excused_checks(setup: SphereSetup, engine: EngineInfo, checks: Any) -> list[Check]:
    """Checks with what a known difference explains: friction that lags a step or is a pyramid, sliding that lifts."""
    for each in (Difference.FRICTION_LAGS, Difference.FRICTION_PYRAMID):
        if each in engine.differences:
            return checks_with_allowance(each, setup, engine, checks)
    return checks_with_allowance(LIFTS, setup, engine, checks)


SPOTS = 9
"""Places on a way that are given one by one, so that a figure shows it."""


def _path_points(history: History) -> dict[str, tuple[str, float]]:
    """Coordinates of the first sphere at as many instants, as far apart."""
    rows = np.linspace(0, len(history.t) - 1, SPOTS).round().astype(int)
    return {
        f"{axis}_{k}": ("m", float(history.x[row, 0, c])) for k, row in enumerate(rows) for c, axis in enumerate("xy")
    }


def _path_point_checks(truth: FloatArray, *, source: str, atol: float, scale: float, why: str) -> list[Check]:
    """Those places against a way of shape (s, 2)."""
    rows = np.linspace(0, len(truth) - 1, SPOTS).round().astype(int)
    return [
        Check(quantity=f"{axis}_{k}", norm="scalar", truth="analytic", expected=float(truth[row, c]), source=source, atol=atol,
              scale=scale, why=why)
        for k, row in enumerate(rows)
        for c, axis in enumerate("xy")
    ]  # fmt: skip


def _path_figure(title: str, shows: str, allows: str, **where: tuple[str, ...]) -> Figure:
    return Figure(
        title=title,
        kind="places",
        quantities=tuple(Plotted(f"y_{k}", "y [m]", at=f"x_{k}") for k in range(SPOTS)),
        where=where,
        apart=True,
        at_label="x [m]",
        shows=shows,
        allows=allows,
    )


def _speeds(history: History, normal: FloatArray, along: FloatArray) -> dict[str, tuple[str, FloatArray]]:
    """Speed along a direction in the plane and spin about the one across, and what is beside them."""
    across = np.cross(normal, along)
    v, omega = history.v[:, 0], history.omega[:, 0]
    return {
        "vx": ("m/s", v @ along),
        "spin": ("rad/s", omega @ across),
        "beside": ("m/s", np.abs([v @ across, RADIUS * (omega @ along), RADIUS * (omega @ normal)]).max(axis=0)),
    }


def _speed_checks(
    vx: FloatArray, spin: FloatArray, *, pull: float, setup: SphereSetup, engine: EngineInfo
) -> list[Check]:
    """Those against speed [m/s] and spin [rad/s] of a sphere that friction pulls by no more than ``pull`` [m/s^2]."""

    def found(setup: Any, engine: EngineInfo) -> list[Check]:
        speed = float(np.abs(vx).max())
        bound, why = _velocity_tolerance(setup, engine, pull, speed), _reason(engine)
        rows = (
            ("vx", vx, "rigid sphere with Coulomb friction", bound, speed),
            (
                "spin",
                spin,
                "rigid sphere with Coulomb friction",
                bound * (1.0 / (UNIFORM_SPHERE * RADIUS)),
                speed / RADIUS,
            ),
            ("beside", np.zeros_like(vx), "mirror symmetry", 2.5 * bound, speed),
        )
        return [
            Check(quantity=name, norm="max", truth="analytic", expected=expected, source=source, atol=atol, scale=scale, why=why)
            for name, expected, source, atol, scale in rows
        ]  # fmt: skip

    return _excused_checks(setup, engine, found)


class Thrown:
    """A sphere without spin is thrown along a plane in a direction of no axis; it slides, then rolls at 5/7 of its speed."""

    id = "spheres/rolling"
    version = 1
    title = "A sphere comes to roll"
    source = "classical rigid-body mechanics"
    requirement = "slides until 2 v0/(7 mu g), then rolls at 5 v0/7 in the direction of the throw"
    parameters: tuple[Parameter, ...] = (
        MU,
        Parameter.positive("speed", 1.0, high=100.0, unit="m/s", help="of the throw"),
        STEP,
        CONTACT_DT,
    )
    figures = (
        Figure(
            title="From sliding to rolling",
            quantities=(
                Plotted("vx", "velocity"),
                Plotted("spin", "spin"),
                Plotted("beside", "speed across the throw"),
            ),
            compare="mu",
            shows="A sphere thrown without spin: velocity and spin along the throw, and what leaves its direction.",
            allows="It slides until the speed is 5/7 of the first, whatever mu; nothing but an engine's own axes can push it aside.",
        ),
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Two coefficients."""
        return [{"mu": 0.1}, {"mu": 0.3}]

    def build(self, params: Mapping[str, Any]) -> SphereSetup:
        """Springs begin with the overlap of the weight."""
        law = _law(params["mu"])
        floor = PlaneWall(name="floor", point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), law=law)
        ball = _spheres(np.array([[0.0, 0.0, RADIUS - MASS * G / KN]]), params["speed"] * WAY[None])
        scene = SphereScene(spheres=ball, sphere_sphere=law, walls=(floor,), gravity=(0.0, 0.0, -G))
        numerics = _numerics(params, 1.6 * 2.0 * params["speed"] / (7.0 * params["mu"] * G))
        return SphereSetup(scene=scene, numerics=numerics, watch=((0, 1),), labels={"contact": (0, 1)})

    def observe(self, params: Mapping[str, Any], setup: SphereSetup, history: History) -> Observed:  # noqa: ARG002
        """Speed and spin along the throw and what is beside it."""
        series = _speeds(history, np.array([0.0, 0.0, 1.0]), WAY)
        scalars = {
            "vx_final": ("m/s", float(series["vx"][1][-1])),
            "beside_max": ("m/s", float(series["beside"][1].max())),
        }
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """Speed in the end; what has left the direction of the throw."""
        speed, source = params["speed"], "rigid sphere with Coulomb friction"
        return (
            Headline(name="final speed", use="rolling", quantity="vx_final", expected=5.0 / 7.0 * speed, source=source,
                     scale=speed, scale_is="initial speed"),
            Headline(name="speed across the throw", use="rolling", quantity="beside_max", expected=0.0, source=source, scale=speed,
                     scale_is="initial speed"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Speed and spin at all times, and the direction."""
        speed, mu = params["speed"], params["mu"]
        truth = slip_to_roll(observed.t, mu=mu, speed=speed, g=G, radius=RADIUS, inertia_ratio=UNIFORM_SPHERE)
        return _speed_checks(truth.vx, -truth.spin, pull=mu * G, setup=setup, engine=engine)


class Released:
    """A sphere at rest is released on a slope of no axis: it rolls if mu is beyond 2/7 of the slope, else it slides and spins."""

    id = "spheres/incline"
    version = 1
    title = "A sphere on a slope"
    source = "classical rigid-body mechanics"
    requirement = "rolls with 5/7 of g sin(angle) where mu > (2/7) tan(angle), else slides with g (sin - mu cos)"
    parameters: tuple[Parameter, ...] = (
        Parameter.positive("mu", 0.5, high=10.0, unit="-", in_id=True, help="friction coefficient"),
        Parameter.positive("duration", 0.5, high=10.0, unit="s", help="length of the run"),
        STEP,
        CONTACT_DT,
    )  # fmt: skip

    figures = (
        Figure(
            title="Down a slope",
            quantities=(
                Plotted("vx", "velocity down the slope"),
                Plotted("spin", "spin"),
                Plotted("beside", "speed across the slope"),
            ),
            compare="mu",
            shows="A sphere released at rest on a slope along no axis, with friction enough to roll and with less.",
            allows="5/7 of the pull along the slope where it rolls, the pull less mu g cos where it slides; it keeps to the line of fall.",
        ),
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Rolling and sliding; the limit is 0.106."""
        return [{"mu": 0.5}, {"mu": 0.05}]

    def _frame(self) -> tuple[FloatArray, FloatArray, float]:
        """Normal, direction down the slope, angle [rad]."""
        normal = np.array([1.0, 2.0, 6.0]) / math.sqrt(41.0)
        down = np.array([0.0, 0.0, -1.0]) + normal[2] * normal
        return normal, down / np.linalg.norm(down), math.acos(normal[2])

    def build(self, params: Mapping[str, Any]) -> SphereSetup:
        """Springs begin with the overlap of the weight."""
        law, (normal, _, angle) = _law(params["mu"]), self._frame()
        place = (RADIUS - MASS * G * math.cos(angle) / KN) * normal + [1.0, 1.0, 1.0]
        slope = PlaneWall(name="slope", point=(1.0, 1.0, 1.0), normal=(1.0, 2.0, 6.0), law=law)
        scene = SphereScene(
            spheres=_spheres(place[None], np.zeros((1, 3))),
            sphere_sphere=law,
            walls=(slope,),
            gravity=(0.0, 0.0, -G),
        )
        return SphereSetup(
            scene=scene, numerics=_numerics(params, params["duration"]), watch=((0, 1),), labels={"contact": (0, 1)}
        )

    def observe(self, params: Mapping[str, Any], setup: SphereSetup, history: History) -> Observed:  # noqa: ARG002
        """Speed down the slope and spin about the horizontal, and what is beside them."""
        normal, down, _ = self._frame()
        series = _speeds(history, normal, down)
        return Observed(
            step=history.step, t=history.t, series=series, scalars={"vx_final": ("m/s", float(series["vx"][1][-1]))}
        )

    def headlines(self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """Speed in the end."""
        _, _, angle = self._frame()
        end = roll_down(
            observed.t[-1:],
            roll_rates(mu=params["mu"], angle=angle, g=G, mass=MASS, radius=RADIUS, inertia_ratio=UNIFORM_SPHERE),
        )
        return (
            Headline(name="speed on a slope", use="rolling", quantity="vx_final", expected=float(end.vx[0]),
                     source="rigid sphere with Coulomb friction", scale=float(end.vx[0]), scale_is="speed of the rigid sphere"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Speed and spin at all times, and the direction."""
        _, _, angle = self._frame()
        mu = params["mu"]
        truth = roll_down(
            observed.t, roll_rates(mu=mu, angle=angle, g=G, mass=MASS, radius=RADIUS, inertia_ratio=UNIFORM_SPHERE)
        )
        pull = G * min(mu * math.cos(angle), 2.0 / 7.0 * math.sin(angle))
        return _speed_checks(truth.vx, truth.spin, pull=pull, setup=setup, engine=engine)


class Isotropy:
    """Twenty-four spheres that do not turn slide over a plane in as many directions, far apart.

    Friction is against the slip and as large in every direction. That of a pyramid of friction, one bound for each of two axes, pulls
    off the slip by up to 45 degrees and is up to root two times as strong.
    """

    id = "spheres/isotropy"
    version = 1
    title = "Friction in all directions"
    source = "Coulomb's law"
    requirement = "keeps its direction and loses mu g t, whatever the direction"
    parameters: tuple[Parameter, ...] = (
        MU,
        Parameter.positive("speed", 3.0, high=100.0, unit="m/s", help="of all"),
        STEP,
        CONTACT_DT,
    )

    figures = (
        Figure(
            title="Friction in all directions",
            kind="places",
            quantities=tuple(Plotted(f"lost_y_{k}", "loss along y, over mu g t [-]", at=f"lost_x_{k}") for k in range(DIRECTIONS)),
            apart=True,
            at_label="loss along x, over mu g t [-]",
            shows="What each of the 24 spheres has lost of its velocity, as a vector; a circle by Coulomb's law.",
            allows="A pyramid of friction makes a square of the circle: what lies beyond it brakes too much, and a sphere whose loss is "
            "off its direction is pushed aside.",
        ),
        Figure(
            title="Deviation by time",
            quantities=(
                Plotted("off", "largest angle off the direction"), Plotted("lost_least", "least loss"), Plotted("lost_most", "largest loss")
            ),
            shows="The sphere that is farthest off its direction, and the least and the largest loss of speed of all.",
            allows="Both losses are one line, mu g t, where friction knows no axes.",
        ),
    )  # fmt: skip

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """One."""
        return [{"mu": 0.3}]

    def build(self, params: Mapping[str, Any]) -> SphereSetup:
        """The run ends at half of the speed."""
        law, speed = _law(params["mu"]), params["speed"]
        angle = FIRST + 2.0 * math.pi / DIRECTIONS * np.arange(DIRECTIONS)
        ways = np.stack([np.cos(angle), np.sin(angle), np.zeros(DIRECTIONS)], axis=1)
        far = 4.0 * RADIUS * DIRECTIONS / (2.0 * math.pi)
        x = far * ways + [0.0, 0.0, RADIUS - MASS * G / KN]
        floor = PlaneWall(name="floor", point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), law=law)
        spheres = replace(_spheres(x, speed * ways), rotating=np.zeros(DIRECTIONS, dtype=bool))
        scene = SphereScene(spheres=spheres, sphere_sphere=law, walls=(floor,), gravity=(0.0, 0.0, -G))
        numerics = _numerics(params, 0.5 * speed / (params["mu"] * G), every=20)
        return SphereSetup(scene=scene, numerics=numerics, watch=(), labels={})

    def observe(self, params: Mapping[str, Any], setup: SphereSetup, history: History) -> Observed:
        """Least and largest loss of speed, largest angle off the first direction."""
        ways = setup.scene.spheres.v / params["speed"]
        along = np.einsum("sij,ij->si", history.v, ways)
        across = np.einsum("sij,ij->si", history.v, np.cross([0.0, 0.0, 1.0], ways))
        lost = params["speed"] - along
        series = {
            "lost_least": ("m/s", lost.min(axis=1)),
            "lost_most": ("m/s", lost.max(axis=1)),
            "off": ("rad", np.abs(np.arctan2(across, along)).max(axis=1)),
        }
        scalars = {name + "_final": (unit, float(values[-1])) for name, (unit, values) in series.items()}
        change = (setup.scene.spheres.v - history.v[-1]) / (params["mu"] * G * float(history.t[-1]))
        scalars |= {
            f"lost_{axis}_{k}": ("1", float(change[k, c])) for k in range(DIRECTIONS) for c, axis in enumerate("xy")
        }
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """Direction, and the loss where it is largest."""
        lost = params["mu"] * G * float(observed.t[-1])
        return (
            Headline(name="direction of sliding", use="sliding", quantity="off_final", expected=0.0, source="Coulomb's law", scale=1.0,
                     scale_is="radian"),
            Headline(name="friction in the worst direction", use="sliding", quantity="lost_most_final", expected=lost,
                     source="Coulomb's law", scale=lost, scale_is="loss of speed by mu g"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Both losses and the angle."""
        speed, pull = params["speed"], params["mu"] * G

        def found(setup: Any, engine: EngineInfo) -> list[Check]:
            bound, why = _velocity_tolerance(setup, engine, pull, speed), _reason(engine)
            lost = pull * observed.t
            return [
                *(
                    Check(quantity=name, norm="max", truth="analytic", expected=lost, source="Coulomb's law", atol=bound,
                          scale=float(lost[-1]), why=why)
                    for name in ("lost_least", "lost_most")
                ),
                Check(quantity="off", norm="max", truth="analytic", expected=np.zeros_like(lost), source="Coulomb's law",
                      atol=2.0 * bound / speed, scale=1.0, why=f"{why}; across half of the first speed"),
                *(
                    Check(quantity=f"lost_{axis}_{k}", norm="scalar", truth="analytic", expected=float(path[c]),
                          source=f"Coulomb's law: {'upper' if path[1] > 0.0 else 'lower'} half", atol=bound / float(lost[-1]), scale=1.0,
                          why=why)
                    for k, path in enumerate(setup.scene.spheres.v / speed)
                    for c, axis in enumerate("xy")
                ),
            ]  # fmt: skip

        return _excused_checks(setup, engine, found)


class Turntable:
    """A ball rolls on a plane that turns about its normal: on a circle, at 2/7 of the plane's angular speed, wherever the axis is."""

    id = "spheres/turntable"
    version = 1
    title = "A ball on a turntable"
    source = "Routh, Dynamics of a System of Rigid Bodies; Weckesser, Am. J. Phys. 65 (1997) 736"
    requirement = "the centre circles at 2/7 of the turntable's angular speed and keeps its own speed"
    parameters: tuple[Parameter, ...] = (
        Parameter(name="turn", default=2.0, low=0.01, high=100.0, unit="rad/s", in_id=True, help="angular speed of the plane"),
        Parameter(name="speed", default=0.7, low=1e-3, high=100.0, unit="m/s", help="of the ball"),
        Parameter.positive("mu", 1.0, high=10.0, unit="-", help="friction coefficient"),
        STEP,
        CONTACT_DT,
    )  # fmt: skip
    figures = (
        _path_figure(
            "The path on the turntable",
            "A quarter of the circle of the sphere's centre, from above.",
            "Whatever friction, radius and gravity are, the circle is run through with 2/7 of the plane's angular speed; slip that is let "
            "through, or a first-order step, shows as a spiral.",
        ),
    )
    START = (1.0, 2.0)

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """One turn."""
        return [{"turn": 2.0}]

    def build(self, params: Mapping[str, Any]) -> SphereSetup:
        """A ball that rolls from the start; the plane's own point is not on the axis. A quarter of its circle."""
        law, turn = _law(params["mu"]), params["turn"]
        x, v = np.array([*self.START, RADIUS - MASS * G / KN]), np.array([params["speed"], 0.0, 0.0])
        foot = np.cross([0.0, 0.0, turn], x)
        spin = np.cross(foot - v, [0.0, 0.0, 1.0]) / RADIUS
        motion = (PlaneSegment(angular_velocity=(0.0, 0.0, turn), pivot=(0.0, 0.0, 0.0)),)
        table = PlaneWall(name="table", point=(2.0, 1.0, 0.0), normal=(0.0, 0.0, 1.0), law=law, motion=motion)
        ball = replace(_spheres(x[None], v[None]), omega=spin[None])
        scene = SphereScene(spheres=ball, sphere_sphere=law, walls=(table,), gravity=(0.0, 0.0, -G))
        numerics = _numerics(params, 0.5 * math.pi / (2.0 / 7.0 * turn), every=10)
        return SphereSetup(scene=scene, numerics=numerics, watch=((0, 1),), labels={"contact": (0, 1)})

    def observe(self, params: Mapping[str, Any], setup: SphereSetup, history: History) -> Observed:  # noqa: ARG002
        """Velocity's components and size; ``rate``, the angular speed of its direction over the plane's."""
        v = history.v[:, 0]
        series = {"vx": ("m/s", v[:, 0]), "vy": ("m/s", v[:, 1]), "speed": ("m/s", np.hypot(v[:, 0], v[:, 1]))}
        turned = float(np.unwrap(np.arctan2(v[:, 1], v[:, 0]))[-1])
        rate = turned / float(history.t[-1]) / params["turn"]
        return Observed(
            step=history.step, t=history.t, series=series, scalars={"rate": ("1", rate), **_path_points(history)}
        )

    def headlines(self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """The angular speed."""
        return (
            Headline(name="angular speed on a turntable", use="rolling", quantity="rate", expected=2.0 / 7.0,
                     source="rolling without slip", scale=2.0 / 7.0, scale_is="2/7 of the table's angular speed"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Both components at all times, and the rate."""
        speed, turn, dt = params["speed"], params["turn"], params["dt"]
        truth = turntable(start=self.START, v=(speed, 0.0), turn=turn, t=observed.t)
        t_end = float(observed.t[-1])

        def found(setup: Any, engine: EngineInfo) -> list[Check]:
            pull = truth.rate * speed
            rolls = 2.0 * pull / _swing(KN) + 4.0 * pull * MASS * G / KN / RADIUS * t_end
            # A sphere of springs rolls on R - overlap; its shear spring bears the pull from the start, and swings about that.
            bound, why = 1e-10 * speed + single(engine, turn * 3.0, setup.numerics.n_steps), "round-off of the steps"
            if engine.contact == "spring":
                bound, why = bound + rolls, "a shear spring that begins unloaded swings on; overlaps shorten the arm"
            else:
                # Implicit steps turn the velocity by what the plane's speed is a step later: second order in each step.
                bound += speed * (truth.rate * dt + t_end / dt * (truth.rate * dt) ** 2)
                why = f"first order of steps that find the plane's speed at one end of the step{soft_reason(engine)}"
            if engine.contact == "cd":
                # The chord of the plane's material points where it moved half a step before. That turns the pull, and at the start, where
                # the ball rolls without slip, 2/7 of the difference to the plane's speed at up to 3 m from the axis is given to it.
                bound += truth.rate * 0.5 * turn * dt * (speed * t_end + 3.0)
                why += "; contact dynamics takes the plane's displacement over the step, a chord that lags by half its turn"
            bound += (pull + turn * 3.0) * (slack_time(engine, dt) + contact_softness(engine) * t_end)
            # Places of implicit steps are sums of the velocities at one end of each.
            lag = 0.0 if engine.contact == "spring" else speed * dt
            rows = (("vx", truth.v[:, 0]), ("vy", truth.v[:, 1]))
            return [
                *(
                    Check(quantity=name, norm="max", truth="analytic", expected=expected, source="rolling without slip", atol=bound,
                          scale=speed, why=why)
                    for name, expected in rows
                ),
                Check(quantity="rate", norm="scalar", truth="analytic", expected=2.0 / 7.0, source="rolling without slip",
                      atol=bound / (speed * t_end * turn), scale=2.0 / 7.0, why=why),
                *_path_point_checks(truth.x, source="rolling without slip", atol=bound * t_end + lag, scale=speed * t_end, why=why),
            ]  # fmt: skip

        return _excused_checks(setup, engine, found)


SOFT = 1e6
"""Stiffness of springs where spins are resisted [N/m]: overlaps of 4e-5 radii, and runs of 7,000 steps."""

LASTS = 0.6
"""Of their runs [s]: longer than any of them takes to stop."""

SPIN = 2.5
"""About the normal [rad/s], of spheres that spin."""

MU_R = Parameter.positive("mu_r", 0.1, high=0.5, unit="-", help="coefficient of the resistance to rolling, to twisting")  # fmt: skip
KR = Parameter(
    name="kr", default=6.0, low=0.1, high=1e3, unit="N m/rad", help="stiffness of an elastic-plastic resistance"
)


def _resistance(model: str, params: Mapping[str, Any]) -> Rolling:
    return Rolling(model=model, mu=params["mu_r"], kr=params["kr"] if model == "elastic-plastic" else 0.0)  # type: ignore[arg-type]


def _twisted(t: FloatArray, model: str, params: Mapping[str, Any]) -> FloatArray:
    """Spin about the normal under a resistance to it [rad/s].

    Against a spring it is that of a body that rolls (`against_spring`) with half of the sphere's ratio of inertia for its mass and none of
    the way's.
    """
    if model == "constant":
        return against_twisting(t, mu_t=params["mu_r"], spin=SPIN, g=G, radius=RADIUS)
    mass = 0.5 * UNIFORM_SPHERE * MASS
    rolled = against_spring(t, mu_r=params["mu_r"], kr=params["kr"], beta=0.0, angle=0.0, g=G * MASS / mass, mass=mass, radius=RADIUS,
                            speed=RADIUS * SPIN, inertia_ratio=1.0)  # fmt: skip
    return rolled.vx / RADIUS


def _twist_tolerance(setup: SphereSetup, engine: EngineInfo) -> float:
    """What a spin about the normal may be off by [rad/s].

    A constant torque acts a step too long where it ends, and to either side after that; a spring swings with its scheme's order.
    """
    numerics, law = setup.numerics, setup.scene.walls[0].law.twisting
    t_end = numerics.dt * numerics.n_steps
    bound = 1e-10 * SPIN + single(engine, SPIN, numerics.n_steps)
    if law is None:
        return bound
    pull = law.mu * G / (UNIFORM_SPHERE * RADIUS)
    h = (numerics.contact_dt or numerics.dt) if engine.contact == "spring" else numerics.dt
    bound += (
        pull * (slack_time(engine, numerics.dt) + contact_softness(engine) * t_end) + contact_softness(engine) * SPIN
    )
    # The normal force is off by what a gap is rounded to, of the overlap of the weight.
    bound += pull * t_end * 8.0 * float(np.spacing(RADIUS)) * SOFT / (MASS * G)
    if law.model == "constant":
        return bound + 2.0 * pull * h
    rate = math.sqrt(law.kr / (UNIFORM_SPHERE * MASS)) / RADIUS
    return bound + SPIN * (rate * h) ** 2 * max(1.0, rate * t_end)


class Top:
    """A sphere that spins: about the normal at a place, or about a skew axis while it is thrown, so that friction bends its path.

    ``resisted``: about the normal, against a resistance to twisting.
    """

    id = "spheres/top"
    version = 1
    title = "A spinning sphere"
    source = (
        "Euler and Coriolis for a rigid sphere with Coulomb friction, which has no moment about the normal at a point"
    )
    requirement = (
        "a spin about the normal stays; a sphere thrown with spin slides along a parabola until 2 |u0|/(7 mu g); a constant torque "
        "mu_r R m g stops the spin after I spin/(mu_r R m g)"
    )
    parameters: tuple[Parameter, ...] = (
        Parameter(name="kind", default="upright", choices=("upright", "thrown", "constant", "elastic-plastic"), in_id=True,
                  help="spin about the normal; about a skew axis, thrown; about the normal, against a resistance to twisting"),
        MU, MU_R, KR, replace(STEP, default=2e-3), CONTACT_DT,
    )  # fmt: skip
    figures = (
        Figure(
            title="Spin about the normal",
            quantities=(Plotted("spin_z", "spin about the normal"),),
            compare="kind",
            where={"kind": ("upright", "constant", "elastic-plastic")},
            shows="A sphere that spins freely, and against resistances to twisting.",
            allows="Friction at a point takes nothing of this spin; a constant torque stops it at one time, a spring swings about where it "
            "has yielded to.",
        ),
        _path_figure(
            "A throw with spin",
            "The path of a sphere thrown with a spin across its velocity, from above.",
            "Friction keeps its direction, so that the path is a parabola, and straight once the sphere rolls.",
            kind=("thrown",),
        ),
    )  # fmt: skip

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Each kind."""
        return [{"kind": kind} for kind in self.parameters[0].choices]

    def _thrown_sphere(self, params: Mapping[str, Any]) -> bool:
        return bool(params["kind"] == "thrown")

    def _start(self, params: Mapping[str, Any]) -> tuple[tuple[float, float], tuple[float, float, float]]:
        return ((WAY[0], WAY[1]), (1.5, -2.0, SPIN)) if self._thrown_sphere(params) else ((0.0, 0.0), (0.0, 0.0, SPIN))

    def build(self, params: Mapping[str, Any]) -> SphereSetup:
        """Springs begin with the overlap of the weight."""
        law, (v, spin) = _law(params["mu"], SOFT, 0.0), self._start(params)
        if params["kind"] in ("constant", "elastic-plastic"):
            law = replace(law, twisting=_resistance(params["kind"], params))
        floor = PlaneWall(name="floor", point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), law=law)
        ball = _spheres(np.array([[0.0, 0.0, RADIUS - MASS * G / SOFT]]), np.array([[*v, 0.0]]))
        scene = SphereScene(
            spheres=replace(ball, omega=np.array([spin])), sphere_sphere=law, walls=(floor,), gravity=(0.0, 0.0, -G)
        )
        numerics = _numerics(params, LASTS, every=5, kn=SOFT)
        return SphereSetup(scene=scene, numerics=numerics, watch=((0, 1),), labels={"contact": (0, 1)})

    def observe(self, params: Mapping[str, Any], setup: SphereSetup, history: History) -> Observed:  # noqa: ARG002
        """Velocity and spin by components, and the way."""
        v, spin = history.v[:, 0], history.omega[:, 0]
        series = {
            "vx": ("m/s", v[:, 0]), "vy": ("m/s", v[:, 1]), **{f"spin_{axis}": ("rad/s", spin[:, k]) for k, axis in enumerate("xyz")}
        }  # fmt: skip
        scalars = {**_path_points(history), "way_final": ("m", float(np.hypot(*history.x[-1, 0, :2])))}
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def _truth(self, params: Mapping[str, Any], t: FloatArray) -> BallHistory:
        v, spin = self._start(params)
        found = slide_and_roll(t, mu=params["mu"], g=G, radius=RADIUS, velocity=v, spin=spin)
        if params["kind"] in ("constant", "elastic-plastic"):
            found.spin[:, 2] = _twisted(t, params["kind"], params)
        return found

    def headlines(self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """The spin about the normal, and how far a throw gets."""
        truth = self._truth(params, observed.t)
        return (
            Headline(name="spin about the normal", use="rolling", quantity="spin_z", expected=truth.spin[:, 2], source=self.source,
                     scale=SPIN, scale_is="initial spin"),
            Headline(name="displacement of a throw with spin", use="rolling", quantity="way_final",
                     expected=float(np.hypot(*truth.x[-1])) if self._thrown_sphere(params) else math.nan, source=self.source, scale=LASTS,
                     scale_is="initial speed times 0.6 s"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Velocities and spins at all times."""
        truth = self._truth(params, observed.t)
        v, spin = self._start(params)
        slip = float(np.hypot(*slip_of(v, spin, RADIUS)))

        def found(setup: Any, engine: EngineInfo) -> list[Check]:
            speed, why = max(1.0, slip), _reason(engine)
            bound = _velocity_tolerance(setup, engine, params["mu"] * G if slip else 0.0, speed)
            askew, pushed = np.zeros(2), 0.0
            if slip and Difference.FRICTION_PYRAMID in engine.differences:
                askew, pushed = self._by_pyramid(params, setup, truth, observed)
                why += "; friction of a pyramid along the velocity"
            (x, y), turn = (bound + askew).tolist(), 1.0 / (UNIFORM_SPHERE * RADIUS)
            rows = (
                ("vx", truth.v[:, 0], x, speed), ("vy", truth.v[:, 1], y, speed),
                ("spin_x", truth.spin[:, 0], y * turn, speed / RADIUS), ("spin_y", truth.spin[:, 1], x * turn, speed / RADIUS),
                ("spin_z", truth.spin[:, 2], _twist_tolerance(setup, engine), SPIN),
            )  # fmt: skip
            found = [
                Check(
                    quantity=name,
                    norm="max",
                    truth="analytic",
                    expected=expected,
                    source=self.source,
                    atol=atol,
                    scale=scale,
                    why=why,
                )
                for name, expected, atol, scale in rows
            ]
            if self._thrown_sphere(params):
                # Places of rigid contacts are sums of the velocities at one end of each step.
                lag = 0.0 if engine.contact == "spring" else speed * params["dt"]
                t_end = float(observed.t[-1])
                found += _path_point_checks(
                    truth.x, source=self.source, atol=bound * t_end + lag + pushed, scale=t_end, why=why
                )
            return found

        return _excused_checks(setup, engine, found)

    def _by_pyramid(
        self, params: Mapping[str, Any], setup: Any, truth: BallHistory, observed: Observed
    ) -> tuple[FloatArray, float]:
        """Largest distance in both velocities [m/s] and in place [m] of a throw whose friction is a pyramid along its velocity."""
        (vx, vy), spin = self._start(params)
        numerics = setup.numerics
        velocity = throw_sphere(
            (vx, vy, 0.0), spin, radius=RADIUS, pull=params["mu"] * G, dt=numerics.dt, n_steps=numerics.n_steps
        )
        way = numerics.dt * np.cumsum(np.vstack([np.zeros(3), velocity[1:]]), axis=0)
        off = np.abs(velocity[observed.step, :2] - truth.v).max(axis=0)
        return off, float(np.abs(way[observed.step, :2] - truth.x).max())


SLOPES = {"level": 0.0, "incline": 10.0, "hold": 2.0, "twisting": 0.0}
"""[deg]: tan(10 deg) = 0.18 is above the coefficient of the resistance, 0.1, and tan(2 deg) = 0.035 is below half of it."""


class Resisted:
    """``plane=level``: a rolling sphere slows down; ``incline``: one at rest rolls down; ``hold``: one at rest stays, or swings.

    ``plane=twisting``: as on the level, while the sphere twists against a resistance of the same size; each has its own history. Springs
    keep to the plane there and do not turn with half of the twist, as they do where the law is symmetric in both bodies.
    """

    id = "spheres/rolling-resistance"
    version = 1
    title = "Rolling resistance of a sphere"
    source = "Ai, Chen, Rotter & Ooi, Powder Technology 206 (2011) 269-282, models A and C; Newton and Euler for a sphere that rolls"
    requirement = (
        "constant: a = (5/7) g (sin - mu_r cos), at rest where tan(angle) <= mu_r; elastic-plastic: a swing of omega^2 = 5 kr/(7 m R^2) "
        "that yields at mu_r R fn"
    )
    parameters: tuple[Parameter, ...] = (
        Parameter(name="model", default="constant", choices=("constant", "elastic-plastic"), in_id=True, help="of the resistance"),
        Parameter(name="plane", default="level", choices=tuple(SLOPES), in_id=True, help="level, to roll down, to hold, or also twisting"),
        replace(MU, default=0.5, in_id=False), MU_R, replace(KR, default=12.0), replace(STEP, default=2e-3), CONTACT_DT,
    )  # fmt: skip
    figures = (
        Figure(
            title="Against rolling resistance",
            quantities=(Plotted("way", "distance along the plane"), Plotted("along", "velocity along the plane")),
            compare="model",
            shows="A sphere that rolls along a level plane, and one put at rest on inclines.",
            allows="A constant torque stops it after 7 v^2/(10 mu_r g); a spring holds it, swinging.",
        ),
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Both models on all planes; the elastic-plastic one yields on the level, too."""
        return [
            *({"model": "constant", "plane": plane} for plane in SLOPES),
            *({"model": "elastic-plastic", "plane": plane} for plane in SLOPES if plane != "incline"),
        ]

    def _angle(self, params: Mapping[str, Any]) -> float:
        return math.radians(SLOPES[params["plane"]])

    def _speed(self, params: Mapping[str, Any]) -> float:
        return 0.4 if params["plane"] in ("level", "twisting") else 0.0

    def build(self, params: Mapping[str, Any]) -> SphereSetup:
        """On the plane z = 0 with gravity tilted towards `WAY`; springs begin with the overlap of the weight."""
        angle, speed, twists = self._angle(params), self._speed(params), params["plane"] == "twisting"
        resistance = _resistance(params["model"], params)
        law = replace(_law(params["mu"], SOFT, 0.0), rolling=resistance)
        if twists:
            law = replace(law, twisting=resistance, slip_at="end")
        floor = PlaneWall(name="floor", point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), law=law)
        spin = np.cross([0.0, 0.0, 1.0], WAY) * speed / RADIUS + [0.0, 0.0, SPIN if twists else 0.0]
        ball = _spheres(np.array([[0.0, 0.0, RADIUS - MASS * G * math.cos(angle) / SOFT]]), speed * WAY[None])
        pull = G * (math.sin(angle) * WAY - math.cos(angle) * np.array([0.0, 0.0, 1.0]))
        scene = SphereScene(
            spheres=replace(ball, omega=spin[None]),
            sphere_sphere=law,
            walls=(floor,),
            gravity=(float(pull[0]), float(pull[1]), float(pull[2])),
        )
        return SphereSetup(
            scene=scene,
            numerics=_numerics(params, LASTS, every=5, kn=SOFT),
            watch=((0, 1),),
            labels={"contact": (0, 1)},
        )

    def observe(self, params: Mapping[str, Any], setup: SphereSetup, history: History) -> Observed:  # noqa: ARG002
        """Way, velocity and spin along the plane, what is beside them, and the spin about the normal."""
        across = np.cross([0.0, 0.0, 1.0], WAY)
        v, spin, path = history.v[:, 0], history.omega[:, 0], history.x[:, 0] @ WAY
        series = {
            "way": ("m", path),
            "along": ("m/s", v @ WAY),
            "spin": ("rad/s", spin @ across),
            "beside": ("m/s", np.abs([v @ across, RADIUS * (spin @ WAY)]).max(axis=0)),
            "spin_z": ("rad/s", spin[:, 2]),
        }
        return Observed(step=history.step, t=history.t, series=series, scalars={"way_final": ("m", float(path[-1]))})

    def _exact_motion(self, params: Mapping[str, Any], t: FloatArray) -> Rolled:
        given: dict[str, float] = {
            "mu_r": params["mu_r"], "angle": self._angle(params), "g": G, "speed": self._speed(params), "inertia_ratio": UNIFORM_SPHERE,
        }  # fmt: skip
        if params["model"] == "constant":
            return against_constant_torque(t, **given)
        return against_spring(t, **given, kr=params["kr"], beta=0.0, mass=MASS, radius=RADIUS)

    def headlines(self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """How far it gets, in parts of the way without resistance; with twisting, the spin about the normal."""
        t_end, twists = float(observed.t[-1]), params["plane"] == "twisting"
        free = self._speed(params) * t_end + G * math.sin(self._angle(params)) * t_end**2 / (2.0 + 2.0 * UNIFORM_SPHERE)
        return (
            Headline(name="distance against rolling resistance", use="rolling", quantity="way_final",
                     expected=float(self._exact_motion(params, observed.t[-1:]).x[0]), source=self.source, scale=free,
                     scale_is="distance without resistance"),
            Headline(name="spin against twisting resistance", use="rolling", quantity="spin_z", source=self.source, scale=SPIN,
                     expected=_twisted(observed.t, params["model"], params) if twists else math.nan, scale_is="initial spin"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Newton and Euler for the sphere that rolls without slip.

        A constant torque whose sign is a step late turns the rim by ``mu_r R m g h/I`` to either side, and acts at once where it begins and
        ends, so that shear springs swing; a spring is followed to the order of the scheme (`ninedisk.harness.cases.rolling.resistance`).
        """
        truth, t_end, mu_r = self._exact_motion(params, observed.t), float(observed.t[-1]), params["mu_r"]
        pull = G * math.sin(self._angle(params))

        def found(setup: Any, engine: EngineInfo) -> list[Check]:
            springs, numerics = engine.contact == "spring", setup.numerics
            h = (numerics.contact_dt or numerics.dt) if springs else numerics.dt
            fastest = max(float(np.abs(truth.vx).max()), mu_r * G * h)
            bound, why = (
                _velocity_tolerance(setup, engine, 2.0 * (pull + mu_r * G), max(self._speed(params), pull * t_end)),
                _reason(engine),
            )
            bound += 2.0 * MASS * G / SOFT / RADIUS * fastest if springs else 0.0
            if params["model"] == "constant":
                bound += 4.0 * mu_r * G / UNIFORM_SPHERE * h
                why += f"; a torque whose sign is late, h = {h:.2g} s"
            else:
                rate = oscillation(mu_r=mu_r, kr=params["kr"], angle=self._angle(params), g=G, mass=MASS, radius=RADIUS,
                                   inertia_ratio=UNIFORM_SPHERE).omega  # fmt: skip
                swing = max(self._speed(params), (mu_r * G + pull) / rate)
                bound += swing * rate * h * max(1.0, rate * t_end) * (0.5 * rate * h if springs else 1.0)
                why += f"; swings of rate h = {rate * h:.2g}"
            lag = 0.0 if springs else fastest * h
            twist = np.full_like(observed.t, 0.0)
            if params["plane"] == "twisting":
                twist = _twisted(observed.t, params["model"], params)
            known = self._known(params, engine, observed.t)
            rows = (
                ("way", truth.x, bound * t_end + lag, max(fastest * t_end, 0.5 * mu_r * G * t_end**2)),
                ("along", truth.vx, bound, fastest),
                ("spin", truth.vx / RADIUS, 2.0 * bound / RADIUS, fastest / RADIUS),
                ("beside", np.zeros_like(observed.t), bound, fastest),
                ("spin_z", twist, _twist_tolerance(setup, engine), SPIN),
            )
            return [
                Check(quantity=name, norm="max", truth="analytic", expected=expected, source=self.source, atol=atol, scale=scale, why=why,
                      known=replace(known[name], size=known[name].size + atol) if name in known else None)
                for name, expected, atol, scale in rows
            ]  # fmt: skip

        return _excused_checks(setup, engine, found)

    def _known(self, params: Mapping[str, Any], engine: EngineInfo, t: FloatArray) -> dict[str, KnownDifference]:
        """What two known differences explain where a sphere both rolls and twists, by quantity.

        A spring that turns with half of the twist q has its torque, ``mu_r R m g`` at most, at the angle q/2 to the rolling: its part
        across it, ``sin(q/2)``, and what is lacking along it drive the sphere by ``mu_r g/(1 + k)`` times their sum over the time. Torques
        that share a cone are along the spin, as large as one of both: a sphere that rolls at v and twists at w slows down by
        ``mu_r g/(1 + k) v/u`` and ``mu_r g/(k R) w/u``, with ``u^2 = v^2 + (R w)^2``.
        """
        if params["plane"] != "twisting":
            return {}
        a, b = params["mu_r"] * G / (1.0 + UNIFORM_SPHERE), params["mu_r"] * G / UNIFORM_SPHERE
        dt = np.diff(t, prepend=0.0)
        sizes: dict[str, float] = {}
        if Difference.SPRINGS_TURN_WITH_TWIST in engine.differences and params["model"] == "elastic-plastic":
            half = 0.5 * np.cumsum(_twisted(t, params["model"], params) * dt)
            words, aside = Difference.SPRINGS_TURN_WITH_TWIST, a * float((np.abs(np.sin(half)) * dt).sum())
            lacks = a * float(((1.0 - np.cos(half)) * dt).sum())
            sizes = {"beside": aside, "along": lacks, "spin": lacks / RADIUS, "way": lacks * float(t[-1])}
        if Difference.RESISTANCES_SHARE_CONE in engine.differences and params["model"] == "constant":
            words = Difference.RESISTANCES_SHARE_CONE
            both = [np.array([self._speed(params), RADIUS * SPIN])]
            for step in dt[1:]:
                u = both[-1]
                loss = np.array([a, b]) * u / max(float(np.hypot(*u)), 1e-300) * step
                both.append(np.maximum(u - loss, 0.0))
            shared = np.array(both).T
            off = np.abs(shared[0] - self._exact_motion(params, t).vx)
            turned = np.abs(shared[1] / RADIUS - _twisted(t, "constant", params))
            sizes = {"along": float(off.max()), "spin": float(off.max()) / RADIUS, "way": float((off * dt).sum()),
                     "spin_z": float(turned.max())}  # fmt: skip
        return {
            name: KnownDifference(
                finding=f"{engine.id}/{FINDING_WORDS[words]}",
                size=1.1 * size,
                why="both resistances at once, by the engine's own law, against each alone",
            )
            for name, size in sizes.items()
        }


ROLLING, INCLINE, ISOTROPY, TURNTABLE, TOP, RESISTED = Thrown(), Released(), Isotropy(), Turntable(), Top(), Resisted()
