"""A grain that rolls off the groove between two larger held spheres: friction must neither trap it nor feed it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.law import SphereLaw
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Spheres, SphereScene
from ninedisk.harness.api.case import Check, Headline, Observed, Parameter, SphereSetup, Value
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
from ninedisk.harness.results.figures import Figure, Plotted
from ninedisk.references.analytic.on_plane.rolling_off import Saddle, fall_time, falling, saddle

RADIUS, MASS, G, MU = 0.5, 2.0, 10.0, 2.0
"""Of the grain; MU is beyond the 0.93 that rolling without slip asks for until `END`, at the ratio 1."""

ALONG = np.array([2.0, -1.0, 2.0]) / 3.0
UP = np.array([1.0, 2.0, 0.0]) / math.sqrt(5.0)
SIDE = np.cross(ALONG, UP)
"""Direction of the line of held centres, upwards, and to the side on which the grain falls: none lies on an axis."""

BEGIN, END = math.radians(1.0), math.radians(45.0)
"""Angles from the top; rolling without slip lasts to 55 degrees at the ratio 1, where the normal force ends."""

SOFT = 3e-4
"""Overlap at the start, in radii of the grain: the arms that shrink by it change the growth rate by at most as much."""

KS_OVER_KN, STEPS_IN_CONTACT = 0.8, 50.0
STEPS, SAMPLES = 1000, 100
"""Steps of a rigid engine in a run; samples."""

RATIOS = (1.0, 2.0, 5.0, 20.0, 100.0)

SOURCE = "rolling without slip over two spheres; Vyas et al., Comput. Phys. Commun. 310 (2025) 109524"


class OnSaddle:
    """The grain starts at rest a degree off the top and falls to 45 degrees in the time of the exact motion.

    Its contacts stick all the time. Beyond some 60 degrees there is no truth: where mu > p/R the groove locks by itself, and what springs
    keep of their first load decides whether the grain leaves.
    """

    id = "spheres/saddle"
    version = 1
    title = "A grain on two larger spheres"
    source = SOURCE
    requirement = "theta'' = g p sin(theta)/J, p^2 = (R + r)^2 - R^2, J = p^2 + 2/5 (R + r)^2: the grain rolls down and stays in its plane"
    parameters: tuple[Parameter, ...] = (
        Parameter(name="ratio", default=1.0, low=0.5, high=200.0, unit="-", in_id=True, help="radius of the held spheres over the grain's"),
        CONTACT_DT,
    )  # fmt: skip
    figures = (
        Figure(
            title="Off the saddle",
            quantities=(Plotted("theta", "angle from the top"), Plotted("aside", "displacement along the line of held centres")),
            compare="ratio",
            shows="The angle of a grain that starts at rest a degree off the top, and what leaves its plane.",
            allows="A grain that shear springs hold where it was keeps its angle.",
        ),
    )  # fmt: skip

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Size ratios from 1 to 100."""
        return [{"ratio": ratio} for ratio in RATIOS]

    def _saddle(self, params: Mapping[str, Any], overlap: float = 0.0) -> tuple[Saddle, float]:
        """Geometry of rolling, of surfaces that overlap so much [m], and growth rate [1/s]."""
        found = saddle(radius=RADIUS - overlap, held_radius=params["ratio"] * RADIUS)
        return found, math.sqrt(G * found.arm / found.inertia)

    def _duration(self, params: Mapping[str, Any]) -> float:
        return float(fall_time(reached=END, start=BEGIN)) / self._saddle(params)[1]

    def build(self, params: Mapping[str, Any]) -> SphereSetup:
        """Springs begin with the overlaps of the weight, without shear; the grain is the first sphere, and the lightest."""
        ratio, overlap = params["ratio"], SOFT * RADIUS
        held, reach = ratio * RADIUS, (ratio + 1.0) * RADIUS - overlap
        arm = math.sqrt(reach**2 - held**2)
        kn = 0.5 * MASS * G * math.cos(BEGIN) * reach / arm / overlap
        law = SphereLaw(kn=kn, ks=KS_OVER_KN * kn, mu=MU, restitution=0.0, regularised=True)
        fixed = np.array([False, True, True])
        spheres = Spheres(
            x=np.array([arm * (math.cos(BEGIN) * UP + math.sin(BEGIN) * SIDE), -held * ALONG, held * ALONG]),
            radius=np.array([RADIUS, held, held]),
            mass=np.array([MASS, 2.0 * MASS, 3.0 * MASS]),
            rotating=~fixed,
            held=np.repeat(fixed[:, None], 3, axis=1),
        )
        x, y, z = (-G * UP).tolist()
        dt, own = self._duration(params) / STEPS, params["contact_dt"]
        contact_dt = contact_step(dt, math.pi * math.sqrt(MASS / kn) / STEPS_IN_CONTACT) if own is None else own
        return SphereSetup(
            scene=SphereScene(spheres=spheres, sphere_sphere=law, gravity=(x, y, z)),
            numerics=Numerics(
                dt=dt,
                n_steps=STEPS,
                contact_dt=contact_dt,
                sample_every=STEPS // SAMPLES,
                impact="newton",
                sliding="coulomb",
            ),
            watch=((0, 1), (0, 2)),
            labels={"left": (0, 1), "right": (0, 2)},
        )

    def observe(self, params: Mapping[str, Any], setup: SphereSetup, history: History) -> Observed:  # noqa: ARG002
        """Angle, what leaves the plane of motion, spin about the line; ``growth``, the rate whose exact motion has the last angle."""
        x, t = history.x[:, 0], history.t
        theta = np.arctan2(x @ SIDE, x @ UP)
        known = math.isfinite(float(theta[-1]))
        grown = float(fall_time(reached=float(theta[-1]), start=BEGIN)) / float(t[-1]) if known else math.nan
        series = {
            "theta": ("rad", theta),
            "aside": ("m", x @ ALONG),
            "spin": ("rad/s", history.omega[:, 0] @ np.cross(UP, SIDE)),
        }
        return Observed(step=history.step, t=t, series=series, scalars={"growth": ("1/s", grown)})

    def headlines(self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """The growth rate: 0 of a grain that is held where it was, an error of 1."""
        _, rate = self._saddle(params)
        return (
            Headline(name="growth rate on a saddle", use="rolling", quantity="growth", expected=rate, source=SOURCE, scale=rate,
                     scale_is="growth rate of rolling without slip"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Growth rate, the angle at all times, the spin of rolling, and the plane of motion."""
        (found, rate), ratio, t, numerics = self._saddle(params), params["ratio"], observed.t, setup.numerics
        truth, grown = falling(t=t, rate=rate, start=BEGIN), float(fall_time(reached=END, start=BEGIN))
        bound, why = self._rate_tolerance(params, engine, numerics, rate, grown)
        # A rate that is off by a share shifts the motion in time by that share; the fastest is at the end.
        fastest = rate * math.sqrt(2.0 * (math.cos(BEGIN) - math.cos(END)))
        angle = bound * grown / rate * fastest
        roll = ratio + 1.0
        turned = np.sqrt(np.maximum(2.0 * (math.cos(BEGIN) - np.cos(truth)), 0.0)) * rate * roll
        # Rigid engines find the line of centres and the speed a step earlier or later each.
        # The shear springs bear friction from the start: the spin swings about that of rolling by what they give way.
        swing, wobble = rate**2 * roll * (2.0 * numerics.dt + slack_time(engine, numerics.dt)), 0.0
        if engine.contact == "spring":
            law = setup.scene.sphere_sphere
            friction = 0.4 * MASS * roll * rate**2 / (found.arm / RADIUS) * RADIUS * math.sin(END)
            swing = friction / law.ks * math.sqrt(7.0 * law.ks / MASS) / (RADIUS * found.arm / (roll * RADIUS))
            wobble = SOFT * RADIUS
        rough = 1e-9 * RADIUS + single(engine, ratio * RADIUS, numerics.n_steps)
        # Either soft contact lets through a share of the speed of slip, along the line of centres, too.
        rough += 2.0 * contact_softness(engine) * fastest * found.arm * float(t[-1])
        return [
            Check(quantity="growth", norm="scalar", truth="analytic", expected=rate, source=SOURCE, atol=bound * rate, scale=rate, why=why),
            Check(quantity="theta", norm="max", truth="analytic", expected=truth, source=SOURCE, atol=angle, scale=END, why=why),
            Check(quantity="spin", norm="max", truth="analytic", expected=turned, source=SOURCE, atol=rate * angle * roll + swing,
                  scale=fastest * roll, why=why),
            Check(quantity="aside", norm="max", truth="analytic", expected=np.zeros_like(t), source="mirror symmetry",
                  atol=rough + wobble, scale=RADIUS,
                  why=f"round-off, and springs that give way{soft_reason(engine)}{single_precision(engine)}"),
        ]  # fmt: skip

    def _rate_tolerance(
        self, params: Mapping[str, Any], engine: EngineInfo, numerics: Numerics, rate: float, grown: float
    ) -> tuple[float, str]:
        """What the growth rate may be off by, as a share of it, and why."""
        ratio = params["ratio"]
        bound = 1e-9 + single(engine, ratio, numerics.n_steps) / math.sin(BEGIN) / grown
        if engine.contact == "spring":
            _, soft = self._saddle(params, SOFT * RADIUS)
            start = SOFT * (1.0 + 1.0 / KS_OVER_KN)
            h = numerics.contact_dt or numerics.dt
            bound += abs(soft / rate - 1.0) + start / grown + (rate * h) ** 2
            return (
                bound,
                f"arms that shrink by the overlap, {SOFT:g} radii; shear springs that give way as much before they bear friction",
            )
        # Half a step's displacement at the start counts as time, of which the run has `grown`/rate.
        bound += rate * numerics.dt / grown + rate * slack_time(engine, numerics.dt) / grown + contact_softness(engine)
        return (
            bound,
            f"a step of {rate * numerics.dt:.2g}/rate earlier or later{soft_reason(engine)}{single_precision(engine)}",
        )


CASE = OnSaddle()
