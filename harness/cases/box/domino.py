"""A box is pushed at its top edge: it stands, slides or topples."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.scene import BodyForce
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
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.box.scene import (
    MASS,
    OFF,
    PAIR,
    SOLVED,
    G,
    askew_of,
    box_axes,
    box_checks,
    box_on_plane,
    frame_at,
    pressure_centre,
    seen,
    slack,
    spring_step,
)
from ninedisk.harness.cases.common import (
    last,
    numerics_of,
    second_half,
    single,
    single_precision,
    soft_reason,
    whole_steps,
)
from ninedisk.harness.results.figures import Figure, Plotted
from ninedisk.references.analytic.on_plane.pushed_box import PushStart, Toppling, push_start, toppling_box

HALF = np.array([0.2, 0.45, 0.5])
"""Half the edges of the box of size 1, along the push, across and upright [m]."""

ALONG = 0.3
"""Angle of the push to the x axis [rad]."""

SOURCE = "statics and dynamics of a rigid box with Coulomb friction"


class BoxDomino:
    """The push is a force through the centre of mass and a torque that brings it to the top edge; both stay what they are.

    ``share`` is the push over that from which on the box topples, ``m g b/(2 h)`` if friction holds its edge. A box that slides while it
    topples has no closed form and is refused.
    """

    id = "box/domino"
    version = 1
    title = "A box that is pushed at its top stands, slides or topples"
    source = SOURCE
    requirement = (
        "topples from 2 h F = m g b on, with (2 h F - m g b)/I about the edge; stands below, its pressure centred 2 h F/(m g) ahead; "
        "slides with F/m - mu g where friction ends first; energy never grows"
    )
    parameters: tuple[Parameter, ...] = (
        Parameter(name="share", default=1.5, low=0.0, high=5.0, unit="-", in_id=True,
                  help="push over the one from which on the box topples"),
        Parameter(name="mu", default=0.5, low=0.0, high=10.0, unit="-", in_id=True, help="friction coefficient"),
        Parameter.positive("size", 1.0, high=100.0, unit="-", in_id=True, help="factor of all lengths; the mass stays"),
        Parameter.positive("dt", 0.002, high=0.01, unit="s", help="step"),
        Parameter.positive("duration", 0.08, unit="s", help="length of the run"),
    )  # fmt: skip
    figures = (
        Figure(
            title="Over, or along",
            quantities=(Plotted("speed", "speed of the centre"), Plotted("spin", "spin about the front edge")),
            compare="share",
            shows="Speed and spin of a box that is pushed from rest.",
            allows="A box that stands has neither; one that slides has no spin; one that topples has both.",
        ),
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Both sides of the threshold, a box that slides, three sizes."""
        return [{}, {"share": 0.95}, {"share": 0.9, "mu": 0.15, "size": 10.0}, {"size": 0.1}]

    def build(self, params: Mapping[str, Any]) -> SphereSetup:
        """One box on a plane, and the push."""
        half, frame, first = _half(params), frame_at(ALONG), _start(params)
        if first.mode == "slides and topples":
            raise ParameterError(
                f"share = {params['share']:g} is not allowed with mu = {params['mu']:g}: the box would slide while it topples; "
                "use less, or another mu"
            )
        n_steps = whole_steps(params, params["duration"], at_least=4.0 * params["dt"], event="half of the run")
        if first.mode == "topples":
            try:
                motion = _motion(params, params["dt"] * np.arange(n_steps + 1))
            except ValueError:
                motion = None
            if motion is None or float(motion.angle[-1]) > 0.5 or float(motion.needed.max()) > 0.95 * params["mu"]:
                raise ParameterError(
                    f"duration = {n_steps * params['dt']:g} s is not allowed with size = {params['size']:g}, mu = {params['mu']:g} "
                    f"and share = {params['share']:g}: the box would have fallen or its edge slip; use a shorter one"
                )  # fmt: skip
        push = MASS * _push(params)
        scene = box_on_plane(half=half, mu=params["mu"], yaw=ALONG, gravity=-G * frame.up)
        fx, fy, fz = (push * frame.along).tolist()
        tx, ty, tz = (push * half[2] * frame.across).tolist()
        load = BodyForce(disk=0, force=(fx, fy, fz), torque=(tx, ty, tz))
        return SphereSetup(
            scene=scene.replace(forces=(load,)),
            numerics=numerics_of(params, n_steps=n_steps, contact_dt=spring_step(params["dt"], half)),
            watch=(PAIR,),
            labels={"floor": PAIR},
        )

    def observe(self, params: Mapping[str, Any], setup: SphereSetup, history: History) -> Observed:
        """Motion, spins and forces; ``energy`` beyond the work of the push, over the mass; means over the second half of the run."""
        frame = frame_at(ALONG)
        series = seen(history, frame)
        inertia = setup.scene.spheres.inertia[0] / MASS
        own = np.einsum("sji,sj->si", box_axes(history), history.omega[:, 0])
        moved = history.x[:, 0] - history.x[0, 0]
        turned = _turn(history, frame.across)
        work = _push(params) * (moved @ frame.along + float(_half(params)[2]) * turned)
        kinetic = 0.5 * (np.sum(history.v[:, 0] ** 2, axis=1) + own**2 @ inertia)
        series["energy"] = ("J/kg", kinetic + G * (moved @ frame.up) - work)
        late = second_half(history.t) + 1
        scalars = {f"{name}_final": (series[name][0], last(series[name][1])) for name in ("down", "spin")}
        scalars |= {f"{name}_mean": ("N", float(series[name][1][late:].mean())) for name in ("fn", "fs")}
        scalars["centre"] = ("m", pressure_centre(history, frame, late))
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """How fast the box topples, how far it slides, where it presses on the plane."""
        first, t_end, half = _start(params), float(observed.t[-1]), _half(params)
        topples = first.mode == "topples"
        spin = float(_motion(params, observed.t).spin[-1]) if topples else 0.0
        free = G * t_end
        return (
            Headline(name="spin of a box that is pushed at its top", use="rest", quantity="spin_final", expected=spin, source=SOURCE,
                     scale=free / float(half[2]), scale_is="speed of a fall over half the height"),
            Headline(name="distance of a box that is pushed at its top", use="sliding", quantity="down_final",
                     expected=math.nan if topples else 0.5 * first.acceleration * t_end**2, source=SOURCE, scale=0.5 * free * t_end,
                     scale_is="free fall"),
            Headline(name="centre of pressure under a pushed box", use="rest", quantity="centre",
                     expected=math.nan if topples else first.centre, source="statics", scale=float(half[0]), scale_is="half the edge"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """The motion in continuous time for all engines; exact steps where the scheme has them."""
        return box_checks((_exact, _continuous), params, setup, observed, engine)


def _half(params: Mapping[str, Any]) -> FloatArray:
    half: FloatArray = float(params["size"]) * HALF
    return half


def _push(params: Mapping[str, Any]) -> float:
    """Over the mass [m/s^2]."""
    return float(params["share"] * G * HALF[0] / (2.0 * HALF[2]))


def _shape(params: Mapping[str, Any]) -> dict[str, float]:
    b, _, h = (float(each) for each in _half(params))
    return {
        "push": _push(params),
        "height": 2.0 * h,
        "half_length": b,
        "half_height": h,
        "inertia": (b * b + h * h) / 3.0,
        "g": G,
    }


def _start(params: Mapping[str, Any]) -> PushStart:
    return push_start(mu=params["mu"], **_shape(params))


def _motion(params: Mapping[str, Any], t: FloatArray) -> Toppling:
    return toppling_box(t, **_shape(params))


def _turn(history: History, axis: FloatArray) -> FloatArray:
    """Angle [rad] by which the box has turned about an axis since time 0, of less than half a turn."""
    axes = box_axes(history)
    turned = np.einsum("sik,jk->sij", axes, axes[0])
    skew = 0.5 * np.stack(
        [turned[:, 2, 1] - turned[:, 1, 2], turned[:, 0, 2] - turned[:, 2, 0], turned[:, 1, 0] - turned[:, 0, 1]],
        axis=1,
    )
    angle: FloatArray = np.arctan2(skew @ axis, 0.5 * (np.trace(turned, axis1=1, axis2=2) - 1.0))
    return angle


def _exact(params: Mapping[str, Any], setup: Any, observed: Observed, engine: EngineInfo) -> list[Check]:
    """The speed or the spin of the first step, and its forces."""
    numerics, first = setup.numerics, _start(params)
    if engine.scheme != "semi-implicit-euler" and not (engine.scheme == "theta" and numerics.theta == 1.0):
        return []
    half, dt = _half(params), numerics.dt
    step = np.full_like(observed.t, np.nan)
    step[1] = 1.0
    # In single precision what touches overlaps by eight units in the last place: the arms of the push are off by that.
    off = 1e-8 + SOLVED + single(engine, float(half[2]), 16) / float(half[0])
    fast = G * dt
    spinning = single(engine, fast, 1) / float(half[2])
    aside = OFF * params["mu"] if askew_of(engine) else 0.0
    rows = (
        ("speed", first.acceleration * dt, (off + aside) * fast + single(engine, fast, 1), fast),
        ("spin", first.toppling * dt, (off + aside) * fast / float(half[2]) + spinning, fast / float(half[2])),
        ("fn", MASS * first.fn, off * MASS * G, MASS * G),
        ("fs", MASS * first.fs, (off + aside) * MASS * G, MASS * G),
    )
    return [
        Check(quantity=name, norm="max", truth="exact-step", expected=value * step, source="first step from rest", atol=atol, scale=scale,
              why=f"exact in the first step: the solver's tolerance, 1e-8{single_precision(engine)}")
        for name, value, atol, scale in rows
    ]  # fmt: skip


def _continuous(params: Mapping[str, Any], setup: Any, observed: Observed, engine: EngineInfo) -> list[Check]:
    first, numerics, t, half = _start(params), setup.numerics, observed.t, _half(params)
    dt, t_end, topples = numerics.dt, float(t[-1]), first.mode == "topples"
    motion = _motion(params, t) if topples else Toppling(*[np.zeros_like(t)] * 3)
    spin, radius = float(motion.spin[-1]), float(np.hypot(half[0], half[2]))
    off = slack(engine, half, dt=dt, n_steps=numerics.n_steps)
    turning, fast = off.speed / float(half[:2].min()), G * t_end
    # A step late or early, and one in which the edge, lifted by the rotation of the step before, has lost the plane: the push alone turns
    # the box then. Contact dynamics finds what closes within the step.
    shape = _shape(params)
    alone = shape["push"] * shape["half_height"] / shape["inertia"] if topples and engine.contact != "cd" else 0.0
    late = 2.0 * float(np.ptp(motion.spin)) / numerics.n_steps + alone * dt
    power = radius * late + off.speed
    atol = {
        "down": off.overlap + 0.5 * first.acceleration * t_end * dt,
        "across": off.overlap,
        "speed": off.speed,
        "gap": off.overlap + (((G + half[0] * alone) * dt + t_end * radius * spin**2) * dt if topples else 0.0),
        "spin": turning + late,
        "turning": turning,
        "energy": (fast + radius * spin) * power
        + G * off.overlap
        + 0.5 * _push(params) * first.acceleration * t_end * dt,
        "force": MASS * G * (2.0 * off.share + 4.0 * off.speed / fast),
        "centre": float(half[2]) * (4.0 * off.share + 8.0 * off.speed / fast) + off.overlap,
    }
    why = f"first order in the step{soft_reason(engine)}{single_precision(engine)}"
    if alone:
        why += "; the edge may be without contact in a step"
    if askew_of(engine):
        # So much of the friction acts across the path and turns the box, which rocks by a hundredth of that.
        gained = OFF * params["mu"] * G * t_end
        for name, size in (
            ("down", 0.5 * gained * t_end), ("across", 0.5 * gained * t_end), ("gap", 5e-3 * gained * t_end), ("speed", gained),
            ("spin", gained / float(half.min())), ("turning", gained / float(half.min())), ("energy", gained * fast),
            ("force", OFF * params["mu"] * MASS * G), ("centre", OFF * params["mu"] * float(half[2])),
        ):  # fmt: skip
            atol[name] += size
        why += f"; friction is off by up to {OFF:g} of its bound"
    zero = np.zeros_like(t)
    # What slides takes from the energy what friction does.
    lost = -first.fs * 0.5 * first.acceleration * t**2 if first.mode == "slides" else zero
    rows: list[tuple[str, FloatArray, float]] = [
        ("across", zero, float(half[0])),
        ("turning", zero, fast / float(half[2])),
        ("spin", motion.spin, fast / float(half[2])),
        ("gap", zero, float(half[2])),
        ("energy", lost, fast**2),
    ]
    if not topples:
        rows += [
            ("down", 0.5 * first.acceleration * t**2, 0.5 * fast * t_end),
            ("speed", first.acceleration * t, fast),
        ]
    found = [
        Check(quantity=name, norm="max", truth="analytic", expected=expected, source=SOURCE, atol=atol[name], scale=scale, why=why)
        for name, expected, scale in rows
    ]  # fmt: skip
    if topples:
        return found
    numbers = [(f"{name}_mean", MASS * getattr(first, name), atol["force"], MASS * G) for name in ("fn", "fs")]
    numbers += [("centre", first.centre, atol["centre"], float(half[0]))]
    return found + [
        Check(quantity=name, norm="scalar", truth="analytic", expected=expected, source=SOURCE, atol=bound, scale=scale,
              why=f"mean over half the run; {why}")
        for name, expected, bound, scale in numbers
    ]  # fmt: skip


CASE = BoxDomino()
