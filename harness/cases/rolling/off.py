"""A disk that rolls off a larger held one, and a ball off a ball: where friction gives up, and where they part."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.law import SphereLaw
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Spheres, SphereScene
from ninedisk.harness.api.case import (
    Check,
    FloatArray,
    Headline,
    Observed,
    Parameter,
    Setup,
    SphereSetup,
    Value,
)
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import (
    CONTACT_DT,
    contact_softness,
    contact_step,
    single,
    single_precision,
    slack_time,
    soft_reason,
)
from ninedisk.harness.cases.differences import LIFTS, checks_with_allowance, follows_associated_rule
from ninedisk.harness.results.figures import Figure, Plotted
from ninedisk.references.analytic.on_plane.rolling_off import Departure, rolled_off

RADIUS, HELD, MASS, G = 0.25, 1.0, 1.0, 10.0
KN, KS_OVER_KN, BETA, PHASE = 1e7, 0.8, 0.3, 0.1
BEGIN = math.radians(15.0)
"""Angle from the top at which a run starts, with the speed and spin of a body that has rolled from rest at the top."""

FLIGHT = 0.08
"""Time after the contact [s]: long enough for every engine's last step in contact to be over."""

SOURCE = "Newton and Euler with Coulomb friction, for a body that rolls, slides and leaves"
PLANE = (np.array([0.0, 1.0]), np.array([1.0, 0.0]))
SPACE = (np.array([1.0, 2.0, 2.0]) / 3.0, np.array([2.0, 1.0, -2.0]) / 3.0)
"""Upwards and to the side."""


class RollsOff:
    """The contact ends where ``cos(theta) = p theta'^2/g``; after that the speed to the side and the spin stay.

    The angle at which the bodies part is read off that speed: ``v^2 = g p cos(theta)^3``.
    """

    version = 1
    source = SOURCE
    parameters: tuple[Parameter, ...] = (
        Parameter(
            name="mu",
            default=0.3,
            low=0.1,
            high=100.0,
            unit="-",
            in_id=True,
            help="friction coefficient; below 0.1 the body slips at once",
        ),
        Parameter.positive("dt", 5e-4, high=5e-3, unit="s", help="step; sampling of spring engines"),
        CONTACT_DT,
    )
    figures = (
        Figure(
            title="Rolling off",
            quantities=(
                Plotted("theta", "angle from the top"),
                Plotted("side", "speed to the side"),
                Plotted("spin", "spin"),
            ),
            compare="mu",
            shows="Angle, speed to the side and spin of a body that rolls off a round one.",
            allows="Speed to the side and spin are constant once the bodies have parted.",
        ),
    )

    def __init__(self, *, space: bool) -> None:
        self.space = space
        self.ratio = 0.4 if space else 0.5
        body, leaves = ("ball", "10/17") if space else ("disk", "4/7")
        self.id = "spheres/off-ball" if space else "rolling/off-disk"
        self.title = f"A {body} rolls off a larger one"
        self.requirement = f"slips where friction reaches mu fn and leaves where fn ends; at cos(theta) = {leaves} where it never slips"
        axes: tuple[FloatArray, FloatArray] = SPACE if space else PLANE
        self.up, self.side = axes

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Friction that gives up halfway, and one that holds nearly to the end."""
        return [{"mu": 0.3}, {"mu": 10.0}]

    def _truth(self, params: Mapping[str, Any]) -> tuple[Departure, float, float]:
        """Where it leaves; times of the slip and of the end of the contact [s]."""
        left = rolled_off(mu=params["mu"], inertia_ratio=self.ratio, arm=RADIUS + HELD, g=G)
        slips = self._rolling_time(left.slips)
        return left, slips, slips + left.lasts

    @property
    def _growth(self) -> float:
        """L of ``theta' = 2 L sin(theta/2)`` [1/s]."""
        return math.sqrt(G / ((1.0 + self.ratio) * (RADIUS + HELD)))

    def _rolling_time(self, angle: float) -> float:
        """Time from the start until an angle [s]."""
        return math.log(math.tan(0.25 * angle) / math.tan(0.25 * BEGIN)) / self._growth

    def build(self, params: Mapping[str, Any]) -> Setup:
        """The body that rolls is the first; springs start without load, and swing into it."""
        arm, dt = RADIUS + HELD, params["dt"]
        rate = 2.0 * self._growth * math.sin(0.5 * BEGIN)
        out = math.cos(BEGIN) * self.up + math.sin(BEGIN) * self.side
        along = math.cos(BEGIN) * self.side - math.sin(BEGIN) * self.up
        x = np.array([arm * out, 0.0 * out])
        v = np.array([arm * rate * along, 0.0 * out])
        spin = rate * arm / RADIUS
        still = {
            "radius": np.array([RADIUS, HELD]),
            "mass": np.array([MASS, 3.0 * MASS]),
            "rotating": np.array([True, False]),
        }
        held = np.repeat([[False], [True]], len(out), axis=1)
        gravity = tuple((-G * self.up).tolist())
        swing = math.sqrt(KS_OVER_KN * KN * (1.0 + 1.0 / self.ratio) / MASS)
        numerics = Numerics(
            dt=dt,
            n_steps=math.ceil((self._truth(params)[2] + FLIGHT) / dt),
            contact_dt=contact_step(dt, PHASE / swing) if params["contact_dt"] is None else params["contact_dt"],
            sample_every=10,
            sliding="coulomb",
            impact="newton",
        )
        watch, labels = ((0, 1),), {"contact": (0, 1)}
        if self.space:
            law = SphereLaw(kn=KN, ks=KS_OVER_KN * KN, mu=params["mu"], beta=BETA, restitution=0.0, regularised=True)
            omega = np.array([spin * np.cross(self.up, self.side), np.zeros(3)])
            spheres = Spheres(x=x, v=v, omega=omega, held=held, **still)  # type: ignore[arg-type]
            return SphereSetup(scene=SphereScene(spheres=spheres, sphere_sphere=law, gravity=gravity), numerics=numerics, watch=watch,
                               labels=labels)  # fmt: skip
        flat = ContactLaw(kn=KN, ks=KS_OVER_KN * KN, mu=params["mu"], beta=BETA, restitution=0.0, regularised=True)
        disks = Disks(x=x, v=v, omega=np.array([-spin, 0.0]), held=held, **still)  # type: ignore[arg-type]
        return Setup(
            scene=Scene(disks=disks, disk_disk=flat, gravity=gravity), numerics=numerics, watch=watch, labels=labels
        )

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:  # noqa: ARG002
        """Angle, speed to the side, spin that rolls forward; ``leaves``, the angle that the last speed belongs to."""
        x, v = history.x[:, 0], history.v[:, 0]
        side = v @ self.side
        spin = history.omega[:, 0] @ np.cross(self.up, self.side) if self.space else -history.omega[:, 0]
        cosine = float(np.cbrt(side[-1] ** 2 / (G * (RADIUS + HELD))))
        series = {
            "theta": ("rad", np.arctan2(x @ self.side, x @ self.up)),
            "side": ("m/s", side),
            "spin": ("rad/s", spin),
        }
        scalars = {
            "leaves": ("deg", math.degrees(math.acos(min(cosine, 1.0)))),
            "spin_final": ("rad/s", float(spin[-1])),
        }
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def _spin(self, left: Departure) -> float:
        return left.turned * left.rate * (RADIUS + HELD) / RADIUS

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """The angle at which the bodies part, and the spin then."""
        left, _, _ = self._truth(params)
        return (
            Headline(name="angle at which a rolling body leaves", use="rolling", quantity="leaves", expected=math.degrees(left.leaves),
                     source=SOURCE, scale=math.degrees(left.leaves), scale_is="angle of the rigid body"),
            Headline(name="spin of a body that left", use="rolling", quantity="spin_final", expected=self._spin(left), source=SOURCE,
                     scale=self._spin(left), scale_is="spin of the rigid body"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Where it leaves, with which spin, and the angle while it rolls."""
        left, slips, _ = self._truth(params)
        t, arm = observed.t, RADIUS + HELD
        truth: FloatArray = 4.0 * np.arctan(math.tan(0.25 * BEGIN) * np.exp(self._growth * np.minimum(t, slips)))
        truth = np.where(t <= slips, truth, np.nan)
        cosine = math.cos(left.leaves)
        speed = math.sqrt(G * arm * cosine**3)

        def found(setup: Any, engine: EngineInfo) -> list[Check]:
            bound, why = self._speed_tolerance(params, setup, engine, speed)
            # v^2 = g p cos^3: an error of the speed is one and a half times as large, relative, as that of the cosine.
            angle = math.degrees(bound / speed / 1.5 * cosine / math.sin(left.leaves))
            return [
                Check(quantity="leaves", norm="scalar", truth="analytic", expected=math.degrees(left.leaves), source=SOURCE, atol=angle,
                      scale=math.degrees(left.leaves), why=why),
                Check(quantity="spin_final", norm="scalar", truth="analytic", expected=self._spin(left), source=SOURCE,
                      atol=bound * (1.0 + 1.0 / self.ratio) / RADIUS, scale=self._spin(left), why=why),
                Check(quantity="theta", norm="max", truth="analytic", expected=truth, source=SOURCE, atol=bound * slips / arm,
                      scale=left.slips, why=why),
            ]  # fmt: skip

        return checks_with_allowance(LIFTS, setup, engine, found)

    def _speed_tolerance(
        self, params: Mapping[str, Any], setup: Setup, engine: EngineInfo, speed: float
    ) -> tuple[float, str]:
        """What the speed may be off by [m/s], and why."""
        dt, steps = setup.numerics.dt, setup.numerics.n_steps
        t_end = dt * steps
        bound = 1e-9 * speed + single(engine, speed, steps)
        if follows_associated_rule(engine, setup.numerics):
            bound += speed
        if engine.contact == "spring":
            friction = MASS * G * self.ratio / (1.0 + self.ratio)
            ks = KS_OVER_KN * KN
            # Shear springs bear friction from the start: the body swings about rolling by that over their rate.
            bound += 2.0 * friction / math.sqrt(ks * MASS) + MASS * G / KN / RADIUS * speed
            return bound, "springs that start without load swing into it; arms that shrink by the overlap"
        why = f"two steps of weight where it leaves, and one at the start, which grows{soft_reason(engine)}"
        # What is off at the start has grown by the ratio of the speeds when the bodies part.
        grown = math.sin(0.5 * self._truth(params)[0].slips) / math.sin(0.5 * BEGIN)
        bound += (2.0 + math.sin(BEGIN) * grown) * G * dt + G * (
            slack_time(engine, dt) + contact_softness(engine) * t_end
        )
        return bound, why + single_precision(engine)


OFF_DISK, OFF_BALL = RollsOff(space=False), RollsOff(space=True)
