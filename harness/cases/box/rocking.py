"""A box that rocks: it passes from one edge to the other, which takes a part of its spin, and comes back."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.harness.api.case import (
    Check,
    FloatArray,
    Headline,
    Observed,
    Parameter,
    ParameterError,
    SphereSetup,
    Value,
)
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.cases.box.scene import (
    OFF,
    PAIR,
    SOLVED,
    G,
    askew_of,
    box_checks,
    box_on_plane,
    frame_at,
    seen,
    slack,
    spring_step,
    turned_angle,
)
from ninedisk.harness.cases.common import (
    numerics_of,
    single,
    single_precision,
    soft_reason,
    whole_steps,
)
from ninedisk.harness.results.figures import Figure, Plotted
from ninedisk.references.analytic.on_plane.rocking_box import Rocking, rocking_box, rocking_ratio

SOURCE = "Housner 1963: angular momentum about the new edge, then rotation about it"
YAW = 0.4
"""Angle of the direction of rocking to the x axis [rad]: no edge of the box lies along an axis of the scene."""

HALF_HEIGHT, HALF_WIDTH = 0.3, 0.25
"""Half the edges of the box of size 1, upright and along the axis of rocking [m]."""

SEEN = 0.9
"""Default length of the run, in times of the landing."""


class BoxRocking:
    """At time 0 the box lands flat, turning about its rear edge; the front edge catches it, and it goes on about that one.

    In the first step the spin is the old one by Housner's ratio, less what gravity takes; then the box rises, and comes down again.
    """

    id = "box/rocking"
    version = 1
    title = "A box rocks from edge to edge"
    source = SOURCE
    requirement = "passes to the new edge with 1 - (3/2) sin^2(alpha) of its spin and turns about it: mg R sin(alpha - turn) against it"
    parameters: tuple[Parameter, ...] = (
        Parameter(name="aspect", default=0.5, low=0.1, high=0.8, unit="-", in_id=True, help="width of the box over its height"),
        Parameter(name="rise", default=0.5, low=0.05, high=0.9, unit="-", in_id=True,
                  help="largest turn over the one in which the box balances on its edge"),
        Parameter(name="mu", default=0.8, low=0.1, high=2.0, unit="-", help="friction coefficient"),
        Parameter.positive("size", 1.0, high=100.0, unit="-", in_id=True, help="factor of all lengths; the mass stays"),
        Parameter.positive("dt", 0.001, high=0.01, unit="s", help="step"),
        Parameter.positive("duration", None, unit="s", help="length of the run; none: 0.9 of the time of the next landing"),
    )  # fmt: skip
    figures = (
        Figure(
            title="Rocking",
            quantities=(Plotted("spin", "spin"), Plotted("turned", "turn")),
            compare="rise",
            shows="Spin and turn of the box from the impact on.",
            allows="An engine that loses more or less in the impact rises less or more.",
        ),
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Two widths, two rises, three sizes."""
        return [{}, {"aspect": 0.3}, {"rise": 0.8}, {"size": 0.1, "dt": 0.0003}, {"size": 10.0, "dt": 0.003}]

    def build(self, params: Mapping[str, Any]) -> SphereSetup:
        """One box that stands flat and turns."""
        half, frame, spin = _half(params), frame_at(YAW), _spin(params)
        after = rocking_ratio(**_shape(params)) * spin
        motion = rocking_box([0.0], spin=after, g=G, **_shape(params))
        b, h = float(half[0]), float(half[2])
        needed = max(motion.needed, (spin - after) * h / ((spin + after) * b))
        if needed > 0.95 * params["mu"]:
            raise ParameterError(
                f"mu = {params['mu']:g} is not allowed: the edge would slip; it must be > {needed / 0.95:.3g}"
            )
        n_steps = whole_steps(params, SEEN * motion.lands)
        if n_steps * params["dt"] > 0.95 * motion.lands:
            raise ParameterError(
                f"duration = {n_steps * params['dt']:g} s is not allowed: the box lands at {motion.lands:.4g} s; use at most 0.95 of that"
            )
        scene = box_on_plane(
            half=half,
            mu=params["mu"],
            yaw=YAW,
            gravity=-G * frame.up,
            v=spin * (h * frame.along - b * frame.up),
            omega=spin * frame.across,
        )
        return SphereSetup(
            scene=scene,
            numerics=numerics_of(params, n_steps=n_steps, contact_dt=spring_step(params["dt"], half)),
            watch=(PAIR,),
            labels={"floor": PAIR},
        )

    def observe(self, params: Mapping[str, Any], setup: SphereSetup, history: History) -> Observed:  # noqa: ARG002
        """Spin and turn about the edge, what leaves the plane of the motion, and the part of the spin that the impact leaves."""
        frame = frame_at(YAW)
        found = seen(history, frame)
        series = {name: found[name] for name in ("spin", "turning", "across", "gap")}
        series["turned"] = ("rad", turned_angle(history))
        spin = found["spin"][1]
        scalars = {
            "kept": ("-", float(spin[1] / spin[0])),
            "largest_turn": ("rad", float(series["turned"][1].max())),
        }
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """What the impact leaves, and how far the box rises."""
        balance = math.atan(params["aspect"])
        rises = float(observed.t[-1]) > 0.5 * _motion(params, observed.t).lands
        return (
            Headline(name="spin that rocking keeps", use="impacts", quantity="kept", expected=rocking_ratio(**_shape(params)),
                     source=SOURCE, scale=1.0, scale_is="spin before the impact"),
            Headline(name="largest turn of a rocking box", use="impacts", quantity="largest_turn",
                     expected=params["rise"] * balance if rises else math.nan, source=SOURCE, scale=balance,
                     scale_is="turn in which the box balances"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """The first step of engines that have it; the motion of all."""
        return box_checks((_exact, _continuous), params, setup, observed, engine)


def _half(params: Mapping[str, Any]) -> FloatArray:
    size = float(params["size"])
    return size * np.array([params["aspect"] * HALF_HEIGHT, HALF_WIDTH, HALF_HEIGHT])


def _shape(params: Mapping[str, Any]) -> dict[str, float]:
    b, _, h = (float(each) for each in _half(params))
    return {"half_length": b, "half_height": h, "inertia": (b * b + h * h) / 3.0}


def _rate(params: Mapping[str, Any]) -> float:
    """Square of the rate at which a turn from the balance grows [1/s^2]: g R/(I + R^2)."""
    b, _, h = (float(each) for each in _half(params))
    return 0.75 * G / math.hypot(b, h)


def _spin(params: Mapping[str, Any]) -> float:
    """Spin before the impact [rad/s], with which the box rises as far as it should."""
    balance = math.atan(params["aspect"])
    lifted = math.cos((1.0 - params["rise"]) * balance) - math.cos(balance)
    return math.sqrt(2.0 * _rate(params) * lifted) / rocking_ratio(**_shape(params))


def _motion(params: Mapping[str, Any], t: FloatArray) -> Rocking:
    shape = _shape(params)
    return rocking_box(t, spin=rocking_ratio(**shape) * _spin(params), g=G, **shape)


def _exact(params: Mapping[str, Any], setup: SphereSetup, observed: Observed, engine: EngineInfo) -> list[Check]:
    """One step keeps the angular momentum about the new edge, but for the weight's: w' = r w - g b dt/(I + R^2)."""
    numerics = setup.numerics
    if engine.scheme != "semi-implicit-euler" and not (engine.scheme == "theta" and numerics.theta == 1.0):
        return []
    shape, spin = _shape(params), _spin(params)
    b, h = shape["half_length"], shape["half_height"]
    first = np.full_like(observed.t, np.nan)
    # Engines in single precision make what touches overlap by eight units in the last place: arms are off by that.
    place = single(engine, math.hypot(b, h) * (1.0 + spin * float(observed.t[-1])), 16)
    first[1] = rocking_ratio(**shape) * spin - G * b * numerics.dt / (shape["inertia"] + b * b + h * h)
    return [
        Check(quantity="spin", norm="max", truth="exact-step", expected=first, source="angular momentum about the new edge in one step",
              atol=(1e-8 + SOLVED + place / b) * spin + single(engine, spin, 1), scale=spin,
              why=f"exact in the first step: the solver's tolerance, 1e-8{single_precision(engine)}")
    ]  # fmt: skip


def _continuous(params: Mapping[str, Any], setup: Any, observed: Observed, engine: EngineInfo) -> list[Check]:
    numerics, t, half = setup.numerics, observed.t, _half(params)
    dt, t_end, spin = numerics.dt, float(t[-1]), _spin(params)
    motion = _motion(params, t)
    off = slack(engine, half, dt=dt, n_steps=numerics.n_steps)
    b, radius, rate = float(half[0]), float(np.hypot(half[0], half[2])), _rate(params)
    # An error of the spin grows as a turn from the balance does.
    growth = math.cosh(math.sqrt(rate) * t_end)
    late = rate * math.sin(math.atan(params["aspect"])) * dt
    soft = off.share * spin + off.speed / b + single(engine, spin, numerics.n_steps)
    why = f"a step late or early, and what grows of it{soft_reason(engine)}{single_precision(engine)}"
    turning = soft * growth
    atol = {
        "spin": (soft + late) * growth,
        "turning": turning + off.speed / float(half.min()),
        "across": off.overlap + turning * t_end * radius,
    }
    if engine.precision == "float32" and engine.contact == "impulse":
        # Rounding decides which corners of an edge that the last step has lifted touch: one alone may bear a step, and turn the box by
        # v y/(I + y^2), v what a step without contact gives the edge.
        inertia = (HALF_WIDTH**2 + HALF_HEIGHT**2) / 3.0 * float(params["size"]) ** 2
        y = HALF_WIDTH * float(params["size"])
        atol["turning"] += (G + spin**2 * radius) * dt * y / (inertia + y**2)
        why += "; one corner of the edge may bear a step alone"
    if Difference.FRICTION_LAGS in engine.differences:
        # An impact without friction leaves w (I - b^2)/(I + b^2), and what slips by then stops later.
        inertia = _shape(params)["inertia"]
        slips = abs(rocking_ratio(**_shape(params)) - (inertia - b * b) / (inertia + b * b)) * spin
        atol["spin"] += 2.0 * slips * growth
        why += "; no friction in the first step"
    atol["turned"] = atol["spin"] * t_end + spin * dt
    # In a step the edge, lifted by the rotation of the step before, may have lost the plane.
    atol["gap"] = off.overlap + G * dt**2 + t_end * radius * spin**2 * dt
    if askew_of(engine):
        gained = OFF * params["mu"] * G * t_end / float(half.min())
        for name, size in (
            ("spin", gained),
            ("turning", gained),
            ("turned", gained * t_end),
            ("across", gained * t_end * radius),
        ):
            atol[name] += size
        why += f"; friction is off by up to {OFF:g} of its bound"
    zero, moved = np.zeros_like(t), np.where(t > 0.0, motion.spin, np.nan)
    rows: list[tuple[str, FloatArray, float, float]] = [
        ("spin", moved, atol["spin"], spin),
        ("turned", motion.angle, atol["turned"], math.atan(params["aspect"])),
        ("turning", zero, atol["turning"], spin),
        ("across", zero, atol["across"], radius),
        ("gap", zero, atol["gap"], radius),
    ]
    return [
        Check(quantity=name, norm="max", truth="analytic", expected=expected, source=SOURCE, atol=bound, scale=scale, why=why)
        for name, expected, bound, scale in rows
    ]  # fmt: skip


CASE = BoxRocking()
