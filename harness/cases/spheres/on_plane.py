"""Spheres on a plane with friction: thrown, released on a slope, sliding in all directions, rolling on a turntable.

Contacts are rigid: springs that regularise them are stiff. The shear springs begin unloaded, so that friction comes up over the slip
``mu fn/ks``, and where rolling begins they swing on, at ``Omega^2 = ks (1/m + R^2/I)``, since nothing damps them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.spheres.law import SphereLaw
from ninedisk.core.spheres.scene import PlaneSegment, PlaneWall, Spheres, SphereScene
from ninedisk.harness.api.case import Check, FloatArray, Headline, Observed, Parameter, SphereSetup, Value
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.cases.common import (
    CONTACT_DT,
    LIFTS,
    allowing,
    contact_step,
    follows_associated_rule,
    single,
    single_precision,
    slack_time,
    soft_reason,
    softness,
)
from ninedisk.references.analytic.rolling_incline import roll_down, roll_rates
from ninedisk.references.analytic.slip_to_roll import slip_to_roll
from ninedisk.references.analytic.turntable import UNIFORM_SPHERE, turntable

RADIUS, MASS, G = 0.5, 2.0, 10.0
KN, KS, BETA = 1e8, 8e7, 0.3
OMEGA = math.sqrt(KS * (1.0 + 1.0 / UNIFORM_SPHERE) / MASS)
"""Swing of a shear spring under a sphere that turns [rad/s]."""

SLIDES = math.sqrt(KS / MASS)
"""The same where it does not turn."""

PHASE = 0.1
"""Of the faster of the two, omega dt."""

WAY = np.array([0.6, 0.8, 0.0])
"""Direction of throws: along no axis, an exact unit vector."""

DIRECTIONS = 24
FIRST = math.radians(5.0)
"""The first direction: none lies on an axis or a diagonal of a pyramid of friction."""

MU = Parameter(
    name="mu", default=0.3, low=0.0, low_open=True, high=10.0, unit="-", in_id=True, help="friction coefficient"
)
STEP = Parameter(
    name="dt", default=1e-3, low=0.0, low_open=True, high=1e-2, unit="s", help="step; sampling of spring engines"
)


def _law(mu: float) -> SphereLaw:
    return SphereLaw(kn=KN, ks=KS, mu=mu, beta=BETA, restitution=0.0, regularised=True)


def _spheres(x: FloatArray, v: FloatArray) -> Spheres:
    return Spheres(x=x, v=v, radius=np.full(len(x), RADIUS), mass=np.full(len(x), MASS))


def _numerics(params: Mapping[str, Any], duration: float, every: int = 1) -> Numerics:
    dt = params["dt"]
    contact_dt = contact_step(dt, PHASE / OMEGA) if params["contact_dt"] is None else params["contact_dt"]
    return Numerics(dt=dt, n_steps=max(1, math.ceil(duration / dt)), contact_dt=contact_dt, sample_every=every)


def _room(setup: SphereSetup, engine: EngineInfo, pull: float, speed: float) -> float:
    """What a velocity may be off by [m/s], where friction pulls with ``pull`` [m/s^2] at most on what has ``speed`` [m/s]."""
    t_end = setup.numerics.dt * setup.numerics.n_steps
    room = 1e-10 * (speed + G * t_end) + single(engine, max(speed, G * t_end), setup.numerics.n_steps)
    if engine.contact == "spring":
        turning = bool(setup.scene.spheres.rotating.all())
        room += 2.0 * pull / OMEGA if turning else pull**2 * MASS / KS / speed + pull * PHASE / SLIDES
    room += pull * (slack_time(engine, setup.numerics.dt) + softness(engine) * t_end) + softness(engine) * speed
    if Difference.FRICTION_LAGS in engine.differences:
        room += 2.0 * pull * setup.numerics.dt
    if follows_associated_rule(engine, setup.numerics):
        room += speed
    return room


def _why(engine: EngineInfo) -> str:
    springs = "; a shear spring comes up over its slip, and swings on undamped" if engine.contact == "spring" else ""
    return f"round-off of the steps{springs}{soft_reason(engine)}{single_precision(engine)}"


def _excused(setup: SphereSetup, engine: EngineInfo, checks: Any) -> list[Check]:
    """Checks with what two known differences explain: friction that lags a step, sliding that lifts."""
    if Difference.FRICTION_LAGS in engine.differences:
        return allowing(Difference.FRICTION_LAGS, setup, engine, checks)
    return allowing(LIFTS, setup, engine, checks)


class Thrown:
    """A sphere without spin is thrown along a plane in a direction of no axis; it slides, then rolls at 5/7 of its speed."""

    id = "spheres/rolling"
    version = 1
    title = "A sphere comes to roll"
    source = "classical rigid-body mechanics"
    requirement = "slides until 2 v0/(7 mu g), then rolls at 5 v0/7 in the direction of the throw"
    parameters: tuple[Parameter, ...] = (
        MU,
        Parameter(name="speed", default=1.0, low=0.0, low_open=True, high=100.0, unit="m/s", help="of the throw"),
        STEP,
        CONTACT_DT,
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
        across = np.cross([0.0, 0.0, 1.0], WAY)
        v, omega = history.v[:, 0], history.omega[:, 0]
        beside = np.abs([v @ across, RADIUS * (omega @ WAY), RADIUS * omega[:, 2]]).max(axis=0)
        series = {
            "vx": ("m/s", v @ WAY),
            "spin": ("rad/s", omega @ across),
            "beside": ("m/s", beside),
        }
        scalars = {"vx_final": ("m/s", float(series["vx"][1][-1])), "beside_max": ("m/s", float(beside.max()))}
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """Speed in the end; what has left the direction of the throw."""
        speed, source = params["speed"], "rigid sphere with Coulomb friction"
        return (
            Headline(name="speed in the end", use="rolling", quantity="vx_final", expected=5.0 / 7.0 * speed, source=source,
                     scale=speed, scale_is="first speed"),
            Headline(name="speed across the throw", use="rolling", quantity="beside_max", expected=0.0, source=source, scale=speed,
                     scale_is="first speed"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Speed and spin at all times, and the direction."""
        speed, mu = params["speed"], params["mu"]
        truth = slip_to_roll(observed.t, mu=mu, speed=speed, g=G, radius=RADIUS, inertia_ratio=UNIFORM_SPHERE)

        def found(setup: Any, engine: EngineInfo) -> list[Check]:
            room, why, source = _room(setup, engine, mu * G, speed), _why(engine), "rigid sphere with Coulomb friction"
            rows = (
                ("vx", truth.vx, 1.0, speed),
                ("spin", -truth.spin, 1.0 / (UNIFORM_SPHERE * RADIUS), speed / RADIUS),
            )
            return [
                *(
                    Check(quantity=name, norm="max", truth="analytic", expected=expected, source=source, atol=room * share,
                          scale=scale, why=why)
                    for name, expected, share, scale in rows
                ),
                Check(quantity="beside", norm="max", truth="analytic", expected=np.zeros_like(observed.t),
                      source="mirror symmetry", atol=2.5 * room, scale=speed, why=why),
            ]  # fmt: skip

        return _excused(setup, engine, found)


class Released:
    """A sphere at rest is released on a slope of no axis: it rolls if mu is beyond 2/7 of the slope, else it slides and spins."""

    id = "spheres/incline"
    version = 1
    title = "A sphere on a slope"
    source = "classical rigid-body mechanics"
    requirement = "rolls with 5/7 of g sin(angle) where mu > (2/7) tan(angle), else slides with g (sin - mu cos)"
    parameters: tuple[Parameter, ...] = (
        Parameter(name="mu", default=0.5, low=0.0, low_open=True, high=10.0, unit="-", in_id=True, help="friction coefficient"),
        Parameter(name="duration", default=0.5, low=0.0, low_open=True, high=10.0, unit="s", help="length of the run"),
        STEP,
        CONTACT_DT,
    )  # fmt: skip

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
        across = np.cross(normal, down)
        v, omega = history.v[:, 0], history.omega[:, 0]
        series = {
            "vx": ("m/s", v @ down),
            "spin": ("rad/s", omega @ across),
            "beside": ("m/s", np.abs([v @ across, RADIUS * (omega @ down), RADIUS * (omega @ normal)]).max(axis=0)),
        }
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

        def found(setup: Any, engine: EngineInfo) -> list[Check]:
            pull = G * min(mu * math.cos(angle), 2.0 / 7.0 * math.sin(angle))
            speed = float(np.abs(truth.vx).max())
            room, why, source = _room(setup, engine, pull, speed), _why(engine), "rigid sphere with Coulomb friction"
            rows = (("vx", truth.vx, 1.0, speed), ("spin", truth.spin, 1.0 / (UNIFORM_SPHERE * RADIUS), speed / RADIUS))
            return [
                *(
                    Check(quantity=name, norm="max", truth="analytic", expected=expected, source=source, atol=room * share,
                          scale=scale, why=why)
                    for name, expected, share, scale in rows
                ),
                Check(quantity="beside", norm="max", truth="analytic", expected=np.zeros_like(observed.t),
                      source="mirror symmetry", atol=2.5 * room, scale=speed, why=why),
            ]  # fmt: skip

        return _excused(setup, engine, found)


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
        Parameter(name="speed", default=3.0, low=0.0, low_open=True, high=100.0, unit="m/s", help="of all"),
        STEP,
        CONTACT_DT,
    )

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
            room, why = _room(setup, engine, pull, speed), _why(engine)
            lost = pull * observed.t
            return [
                *(
                    Check(quantity=name, norm="max", truth="analytic", expected=lost, source="Coulomb's law", atol=room,
                          scale=float(lost[-1]), why=why)
                    for name in ("lost_least", "lost_most")
                ),
                Check(quantity="off", norm="max", truth="analytic", expected=np.zeros_like(lost), source="Coulomb's law",
                      atol=2.0 * room / speed, scale=1.0, why=f"{why}; across half of the first speed"),
            ]  # fmt: skip

        return _excused(setup, engine, found)


class Turntable:
    """A ball rolls on a plane that turns about its normal: on a circle, at 2/7 of the plane's angular speed, wherever the axis is."""

    id = "spheres/turntable"
    version = 1
    title = "A ball on a turntable"
    source = "Routh, Dynamics of a System of Rigid Bodies; Weckesser, Am. J. Phys. 65 (1997) 736"
    requirement = "the centre goes round at 2/7 of the turntable's angular speed and keeps its own speed"
    parameters: tuple[Parameter, ...] = (
        Parameter(name="turn", default=2.0, low=0.01, high=100.0, unit="rad/s", in_id=True, help="angular speed of the plane"),
        Parameter(name="speed", default=0.7, low=1e-3, high=100.0, unit="m/s", help="of the ball"),
        Parameter(name="mu", default=1.0, low=0.0, low_open=True, high=10.0, unit="-", help="friction coefficient"),
        STEP,
        CONTACT_DT,
    )  # fmt: skip
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
        return Observed(step=history.step, t=history.t, series=series, scalars={"rate": ("1", rate)})

    def headlines(self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """The angular speed."""
        return (
            Headline(name="angular speed on a turntable", use="rolling", quantity="rate", expected=2.0 / 7.0,
                     source="rolling without slip", scale=2.0 / 7.0, scale_is="2/7 of the plane's"),
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
            rolls = 2.0 * pull / OMEGA + 4.0 * pull * MASS * G / KN / RADIUS * t_end
            # A sphere of springs rolls on R - overlap; its shear spring bears the pull from the start, and swings about that.
            room, why = 1e-10 * speed + single(engine, turn * 3.0, setup.numerics.n_steps), "round-off of the steps"
            if engine.contact == "spring":
                room, why = room + rolls, "a shear spring that begins unloaded swings on; overlaps shorten the arm"
            else:
                # Implicit steps turn the velocity by what the plane's speed is a step later: second order in each step.
                room += speed * (truth.rate * dt + t_end / dt * (truth.rate * dt) ** 2)
                why = f"first order of steps that find the plane's speed at one end of the step{soft_reason(engine)}"
            room += (pull + turn * 3.0) * (slack_time(engine, dt) + softness(engine) * t_end)
            rows = (("vx", truth.v[:, 0]), ("vy", truth.v[:, 1]))
            return [
                *(
                    Check(quantity=name, norm="max", truth="analytic", expected=expected, source="rolling without slip", atol=room,
                          scale=speed, why=why)
                    for name, expected in rows
                ),
                Check(quantity="rate", norm="scalar", truth="analytic", expected=2.0 / 7.0, source="rolling without slip",
                      atol=room / (speed * t_end * turn), scale=2.0 / 7.0, why=why),
            ]  # fmt: skip

        return _excused(setup, engine, found)


ROLLING, INCLINE, ISOTROPY, TURNTABLE = Thrown(), Released(), Isotropy(), Turntable()
