"""A box on an incline: it stands, slides or tips, as friction and its shape decide."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.harness.api.case import Check, Headline, Observed, Parameter, ParameterError, SphereSetup, Value
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.cases.box.scene import (
    MASS,
    OFF,
    PAIR,
    SOLVED,
    SOLVED_IN_SINGLE,
    G,
    askew_of,
    box_checks,
    box_on_plane,
    frame_at,
    pressure_centre,
    seen,
    slack,
    spring_step,
)
from ninedisk.harness.cases.common import (
    EXACT_STEP_RTOL,
    THETA,
    last,
    numerics_of,
    second_half,
    single,
    single_precision,
    soft_reason,
    whole_steps,
)
from ninedisk.harness.cases.differences import follows_associated_rule
from ninedisk.harness.results.figures import Figure, Plotted
from ninedisk.references.analytic.on_plane.box import BoxStart, box_start, tipping_box

HALF_HEIGHT, HALF_WIDTH = 0.5, 0.45
"""Half the edges [m] normal to the incline and across; that along it is the aspect times the height: no two alike."""

DOWN = 0.3
"""Angle of the slope's direction to the x axis [rad]."""

SOURCE = "statics and dynamics of a rigid box with Coulomb friction"


class BoxIncline:
    """The box is put on the plane at rest, under tilted gravity.

    ``turned_deg`` turns it about the plane's normal: sliding and standing do not depend on it, and its edges lie neither along the slope
    nor along an axis. A box that slides while it tips has no closed form and is refused.
    """

    id = "box/incline"
    version = 1
    title = "A box on an incline stands, slides or tips"
    source = SOURCE
    requirement = (
        "stands where tan(slope) is below mu and b/h, its pressure centred h tan(slope) down the incline; slides with g (sin - mu cos); "
        "tips with m g (h sin - b cos)/I about the lower edge"
    )
    parameters: tuple[Parameter, ...] = (
        Parameter(name="mu", default=0.35, low=0.0, high=10.0, unit="-", in_id=True, help="friction coefficient"),
        Parameter(name="slope_deg", default=20.0, low=1.0, high=80.0, unit="deg", in_id=True, help="slope of the incline"),
        Parameter.positive("aspect", 0.6, high=10.0, unit="-", in_id=True,
                           help="edge of the box down the incline over its height"),
        Parameter(name="turned_deg", default=0.0, low=-90.0, high=90.0, unit="deg", in_id=True,
                  help="turn of the box about the plane's normal"),
        Parameter.positive("dt", 0.005, unit="s", help="step"),
        Parameter.positive("duration", 0.2, unit="s", help="length of the run"),
        THETA,
    )  # fmt: skip
    figures = (
        Figure(
            title="Down the incline, and over",
            quantities=(Plotted("speed", "speed down the incline"), Plotted("spin", "spin about the lower edge")),
            compare="mu",
            shows="Speed and spin of a box that is put at rest on the incline.",
            allows="A box that stands has neither; one that slides has no spin; one that tips has both.",
        ),
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Both sides of each threshold: tan(20 deg) = 0.364, tan(30 deg) = 0.577."""
        return [
            {"mu": 0.35}, {"mu": 0.38}, {"mu": 0.35, "turned_deg": 25.0}, {"mu": 0.38, "turned_deg": 25.0},
            {"mu": 0.8, "aspect": 0.35}, {"mu": 0.8, "aspect": 0.38},
            {"mu": 0.5, "slope_deg": 30.0, "aspect": 0.4}, {"mu": 0.38, "slope_deg": 30.0, "aspect": 0.4},
        ]  # fmt: skip

    def build(self, params: Mapping[str, Any]) -> SphereSetup:
        """One box on a plane."""
        first, slope = start_of(params), math.radians(params["slope_deg"])
        if first.mode == "slides and tips":
            raise ParameterError(
                f"mu = {params['mu']:g} is not allowed: the box would slide while it tips; use less than the aspect, or more"
            )
        frame = frame_at(DOWN)
        if params["turned_deg"]:
            off = first.centre * np.array([math.cos(_turned(params)), -math.sin(_turned(params))])
            if first.mode == "tips" or np.any(np.abs(off) >= _half(params)[:2]):
                raise ParameterError(
                    f"turned_deg = {params['turned_deg']:g} is not allowed: the turned box would tip; use 0, or a larger aspect"
                )
        scene = box_on_plane(
            half=_half(params),
            mu=params["mu"],
            yaw=DOWN + _turned(params),
            gravity=G * (math.sin(slope) * frame.along - math.cos(slope) * frame.up),
        )
        n_steps = whole_steps(params, params["duration"], at_least=4.0 * params["dt"], event="half of the run")
        if first.mode == "tips":
            try:
                needed = tipping_box(params["dt"] * np.arange(n_steps + 1), **_tipping(params)).needed
            except ValueError:
                raise ParameterError(
                    f"duration = {n_steps * params['dt']:g} s is not allowed: the box has fallen long before; use a shorter one"
                ) from None
            if needed.max() > params["mu"] or not np.all(needed > 0.0):
                raise ParameterError(
                    f"duration = {params['duration']:g} is not allowed: the lower edge would slip; use a shorter one, or more friction"
                )
        numerics = numerics_of(
            params, n_steps=n_steps, contact_dt=spring_step(params["dt"], _half(params)), theta=params["theta"]
        )
        return SphereSetup(scene=scene, numerics=numerics, watch=(PAIR,), labels={"floor": PAIR})

    def observe(self, params: Mapping[str, Any], setup: SphereSetup, history: History) -> Observed:  # noqa: ARG002
        """Motion, spins and forces; means of the forces, and ``centre`` of the pressure, over the second half of the run."""
        frame = frame_at(DOWN)
        series = seen(history, frame)
        half = second_half(history.t) + 1
        scalars = {
            f"{name}_final": (unit, last(values))
            for name, (unit, values) in series.items()
            if name in ("down", "speed", "spin")
        }
        scalars |= {f"{name}_mean": ("N", float(series[name][1][half:].mean())) for name in ("fn", "fs")}
        scalars["centre"] = ("m", pressure_centre(history, frame, half))
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """How far the box slides, how fast it tips, where it presses on the plane."""
        first, t_end, slope = start_of(params), float(observed.t[-1]), math.radians(params["slope_deg"])
        tips = first.mode == "tips"
        down = math.nan if tips else 0.5 * first.acceleration * t_end**2
        spin = float(tipping_box(observed.t, **_tipping(params)).spin[-1]) if tips else 0.0
        rate = G * math.sin(slope) * t_end
        return (
            Headline(name="distance of a box down the incline", use="rest" if first.mode == "stands" else "sliding", quantity="down_final",
                     expected=down, source="g (sin - mu cos) t^2/2, or 0", scale=0.5 * rate * t_end, scale_is="distance without friction"),
            Headline(name="spin of a box on an incline", use="rest", quantity="spin_final", expected=spin,
                     source="rotation about the lower edge, or 0", scale=rate / HALF_HEIGHT,
                     scale_is="speed without friction over half the height"),
            Headline(name="centre of pressure under a box", use="rest", quantity="centre", expected=math.nan if tips else first.centre,
                     source="statics", scale=float(_half(params)[0]), scale_is="half the edge"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """The motion in continuous time for all engines; exact steps where the scheme has them."""
        return box_checks((_exact, _continuous), params, setup, observed, engine)


def start_of(params: Mapping[str, Any]) -> BoxStart:
    """What the box does at the first instant."""
    half = _half(params)
    return box_start(
        mu=params["mu"],
        angle=math.radians(params["slope_deg"]),
        half_length=float(half[0]),
        half_height=HALF_HEIGHT,
        inertia=float(half[0] ** 2 + HALF_HEIGHT**2) / 3.0,
        g=G,
    )


def _half(params: Mapping[str, Any]) -> np.ndarray[Any, Any]:
    return np.array([params["aspect"] * HALF_HEIGHT, HALF_WIDTH, HALF_HEIGHT])


def _turned(params: Mapping[str, Any]) -> float:
    return math.radians(params["turned_deg"])


def _tipping(params: Mapping[str, Any]) -> dict[str, float]:
    half = _half(params)
    return {
        "angle": math.radians(params["slope_deg"]),
        "half_length": float(half[0]),
        "half_height": HALF_HEIGHT,
        "inertia": float(half[0] ** 2 + HALF_HEIGHT**2) / 3.0,
        "g": G,
    }


def _exact(params: Mapping[str, Any], setup: SphereSetup, observed: Observed, engine: EngineInfo) -> list[Check]:
    """Positions are sums of exact speeds where the box does not tip; the first step's spin and forces where it does."""
    numerics, first = setup.numerics, start_of(params)
    if engine.scheme == "semi-implicit-euler":
        lag = numerics.dt
    elif engine.scheme == "theta" and numerics.sliding == "coulomb":
        lag = (2.0 * numerics.theta - 1.0) * numerics.dt
    else:
        return []
    t, source = observed.t, f"{engine.scheme}: sum of the exact speeds"
    why = f"exact solution of this very scheme: round-off and the solver's tolerance{single_precision(engine)}"
    t_end = float(t[-1])
    rough = SOLVED_IN_SINGLE * single(engine, G * t_end, numerics.n_steps)
    aside = 0.5 * OFF * params["mu"] * G * t_end**2 if askew_of(engine) else 0.0
    if first.mode != "tips":
        down = 0.5 * first.acceleration * t * (t + lag)
        return [
            Check(quantity="down", norm="max", truth="exact-step", expected=down, source=source, rtol=EXACT_STEP_RTOL,
                  atol=SOLVED * G * t_end**2 + rough * t_end + aside, scale=0.5 * G * t_end**2, why=why),
        ]  # fmt: skip
    if engine.scheme == "theta" and numerics.theta != 1.0:
        return []  # what the first step leaves of an impact depends on theta
    first_step = np.full_like(t, np.nan)
    first_step[1] = 1.0
    expected = {"spin": first.tipping * numerics.dt, "fn": MASS * first.fn, "fs": MASS * first.fs}
    sizes = {"spin": G * numerics.dt / HALF_HEIGHT, "fn": MASS * G, "fs": MASS * G}
    # In single precision what touches overlaps by eight units in the last place: the arms of the weight are off by that.
    extent = math.hypot(float(_half(params)[0]), HALF_HEIGHT) + 0.5 * G * t_end**2
    place = single(engine, extent, 16) / HALF_HEIGHT
    return [
        Check(quantity=name, norm="max", truth="exact-step", expected=value * first_step,
              source="first step from rest about the lower edge", rtol=1e-8, scale=sizes[name],
              atol=(1e-8 + place) * sizes[name] + single(engine, sizes[name], 1),
              why=f"exact in the first step: the solver's tolerance, 1e-8{single_precision(engine)}")
        for name, value in expected.items()
    ]  # fmt: skip


def _continuous(params: Mapping[str, Any], setup: Any, observed: Observed, engine: EngineInfo) -> list[Check]:
    first, numerics, t = start_of(params), setup.numerics, observed.t
    dt, t_end, slope = numerics.dt, float(t[-1]), math.radians(params["slope_deg"])
    half, mu = _half(params), params["mu"]
    off = slack(engine, half, dt=dt, n_steps=numerics.n_steps)
    tips = first.mode == "tips"
    turning = off.speed / float(half[:2].min())
    atol = {
        "down": off.overlap + 0.5 * first.acceleration * t_end * dt,
        "across": off.overlap + single(engine, math.sqrt(0.5) * first.acceleration * t_end**2, numerics.n_steps),
        "speed": off.speed,
        "gap": off.overlap,
        "spin": turning,
        "turning": turning,
        "force": MASS * G * (2.0 * off.share + 2.0 * off.speed / (G * t_end)),
        "centre": HALF_HEIGHT * (4.0 * off.share + 4.0 * off.speed / (G * t_end)) + off.overlap,
    }
    why = f"first order in the step{soft_reason(engine)}{single_precision(engine)}"
    if Difference.KEEPS_KN in engine.differences:
        why += "; overlaps of the load over kn"
    if askew_of(engine):
        # So much of the friction acts across the path and turns the box, which rocks by a hundredth of that.
        gained = OFF * mu * G * t_end
        for name in ("down", "across"):
            atol[name] += 0.5 * gained * t_end
        atol["gap"] += 5e-3 * gained * t_end
        atol["speed"] += gained
        atol["spin"] += gained / float(half.min())
        atol["turning"] += gained / float(half.min())
        atol["force"] += OFF * mu * MASS * G
        atol["centre"] += OFF * mu * HALF_HEIGHT
        why += f"; friction is off by up to {OFF:g} of its bound"
    if Difference.FRICTION_LAGS in engine.differences:
        # The first step has no friction; what slides then goes on sliding, or stops against mu g cos, and pushes the box over meanwhile.
        offset = min(mu * math.cos(slope), math.sin(slope)) * G * dt
        spare = G * (mu * math.cos(slope) - math.sin(slope))
        stop = offset / spare if spare > 0.0 else t_end
        atol["speed"] += offset
        atol["down"] += offset * (min(stop, t_end) + dt)
        atol["across"] += 1e-2 * offset * t_end
        atol["spin"] += offset / HALF_HEIGHT
        atol["turning"] += 1e-2 * offset / float(half.min())
        atol["gap"] += offset * (min(stop, t_end) + dt) * (1.0 if tips else 1e-2)
        if stop > 0.5 * t_end and spare > 0.0:
            atol["force"] += 2.0 * MASS * offset / t_end
            atol["centre"] += HALF_HEIGHT * 2.0 * offset / (G * t_end)
        if tips:  # an edge that slides at first may go on sliding, and the box with it, without tipping
            atol["spin"] += float(tipping_box(t, **_tipping(params)).spin[-1])
        elif first.mode == "stands":  # what stops rocks on its lower edge and comes back
            length = float(half[0])
            back = G * (length * math.cos(slope) - HALF_HEIGHT * math.sin(slope))
            back /= (length**2 + HALF_HEIGHT**2) * 4.0 / 3.0
            rocks = 2.0 * offset / HALF_HEIGHT / back
            atol["down"] += offset * min(rocks, t_end)
            if rocks > 0.5 * t_end:
                atol["force"] += MASS * (length + HALF_HEIGHT) * back
                atol["centre"] += length - first.centre
        why += f"; no friction in the first step: {offset:.3g} m/s"
    if follows_associated_rule(engine, numerics):
        # As of a block that chatters: the box falls in a step without contact and is lifted by mu times its slip, at one edge perhaps.
        fall = G * math.cos(slope) * dt
        lift = mu * (first.acceleration * t_end + mu * fall) if first.mode == "slides" else mu * fall
        depth = (fall + lift) * dt + lift**2 / (2.0 * G * math.cos(slope))
        atol["speed"] += mu * (fall + 2.0 * lift)
        atol["down"] += mu * lift * t_end + mu * depth
        atol["across"] += depth
        atol["gap"] += depth
        if first.mode == "stands":
            # A flight of a step or two has the free speed; friction takes it back before the next.
            atol["speed"] += 2.0 * G * math.sin(slope) * dt
            atol["down"] += 2.0 * G * math.sin(slope) * dt * t_end
        for name in ("spin", "turning"):
            atol[name] += (fall + lift) / float(half[:2].min())
        atol["force"] += 2.0 * MASS * (fall + lift) / t_end
        atol["centre"] += HALF_HEIGHT * 4.0 * (fall + lift) / (G * t_end)
        why += f"; a sliding contact opens and lands again: up to {fall + lift:.3g} m/s"
    zero = np.zeros_like(t)
    rows: list[tuple[str, Any, float, float]] = [
        ("across", zero, atol["across"], float(half[0])),
        ("turning", zero, atol["turning"], G * t_end),
    ]
    if tips:
        motion = tipping_box(t, **_tipping(params))
        # A step late or early, and one in which the edge, lifted by the rotation of the step before, has lost the plane.
        late = 2.0 * float(np.ptp(motion.spin)) / len(t)
        rows += [
            ("spin", motion.spin, atol["spin"] + late, float(motion.spin[-1])),
            ("gap", zero, atol["gap"] + G * dt**2 + t_end * HALF_HEIGHT * float(motion.spin[-1]) ** 2 * dt, HALF_HEIGHT),
        ]  # fmt: skip
    else:
        rows += [
            ("spin", zero, atol["spin"], G * t_end),
            ("down", 0.5 * first.acceleration * t**2, atol["down"], 0.5 * G * t_end**2),
            ("speed", first.acceleration * t, atol["speed"], G * t_end),
            ("gap", zero, atol["gap"], HALF_HEIGHT),
        ]  # fmt: skip
    found = [
        Check(
            quantity=name,
            norm="max",
            truth="analytic",
            expected=expected,
            source=SOURCE,
            atol=bound,
            scale=scale,
            why=why,
        )
        for name, expected, bound, scale in rows
    ]
    numbers = []
    if not tips:
        numbers = [(f"{name}_mean", MASS * getattr(first, name), atol["force"], MASS * G) for name in ("fn", "fs")]
        numbers += [("centre", first.centre, atol["centre"], float(half[0]))]
    return found + [
        Check(quantity=name, norm="scalar", truth="analytic", expected=expected, source=SOURCE, atol=bound, scale=scale,
              why=f"mean over half the run; {why}")
        for name, expected, bound, scale in numbers
    ]  # fmt: skip


CASE = BoxIncline()
