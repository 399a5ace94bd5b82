"""Blocks on slopes about the angle of friction, under loads over four decades: creep at rest, first slip, the cone of friction."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall
from ninedisk.harness.api.case import Check, FloatArray, Headline, Observed, Parameter, Setup, Value
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.cases.common import (
    CONTACT_DT,
    CONTACT_DYNAMICS,
    GRAVITY,
    SHEAR_STIFFNESS,
    STEP,
    STIFFNESS,
    THETA,
    contact_step,
    numerics_of,
    second_half,
    slack_time,
    whole_steps,
)
from ninedisk.harness.cases.differences import FINDING_WORDS, LIFTS, excused_checks
from ninedisk.harness.cases.incline.block import PHASE, RADIUS, block_chatters, first_order_bounds, spring_bounds
from ninedisk.harness.results.figures import Figure, Plotted
from ninedisk.references.analytic.on_plane.incline import acceleration

RATIOS = (0.5, 0.9, 0.99, 1.01, 1.1, 1.5)
"""Slopes tan(angle) over mu: as many that hold as that slide; Drake 1.51.1 crashes on scenes of more disks and planes than these."""

CLEAR = 0.02
"""Least gap [m] of a block to the planes that are not its own, whatever margin an engine looks for contacts in."""

CONTACT_BETA = 1.0
"""The planes' dashpots are critical; nothing moves along the normals."""

BELOW = 1e-6
"""Part of the limit of friction by which blocks that slide start below it: the overlaps that it follows from are rounded to 2e-8."""

FIRST = 0.5
"""A block slides if it is faster than this part of the speed that Coulomb's law gives the flattest slope that slides."""


class HoldAndCreep:
    """Blocks, each on a plane of its own slope; the planes are the edges of a convex valley, steepest first.

    No block reaches another one or a second plane. Spring engines start in equilibrium, so that all that moves on the flatter half of the
    slopes is creep: of a friction that is regularised, or of a contact that gives way. What a slope that slides does is given by
    the case of one block (`block.py`); here its speed only says that the slope slides, and how the speed jumps from one half to the
    other.
    """

    id = "friction/hold"
    version = 1
    title = "Hold and creep about the angle of friction"
    source = "Coulomb's law: a block holds if tan(angle) < mu, under any load"
    requirement = (
        "blocks up to 0.99 of the angle's tangent rest, those from 1.01 on slide, from a hundredth to a hundred kilogrammes; "
        "friction never exceeds mu times the normal force"
    )
    figures: tuple[Figure, ...] = (
        Figure(
            kind="places",
            title="Creep rate about the angle of friction",
            quantities=tuple(
                Plotted(f"speed_{ratio:g}", "creep rate, speed [m/s]", at=f"{ratio:g}") for ratio in RATIOS
            ),
            at_label="tan(angle)/mu",
            log="y",
            apart=True,
            shows="Mean speed of each block over the second half of the run, by its slope; a picture an engine, a line a load and "
            "friction, the engine that is farthest from Coulomb first.",
            allows="Left of 1 Coulomb's blocks rest: what is above round-off there is creep, and the load should not matter. Right of 1 "
            "they slide, as fast as the dashed truth says.",
        ),
    )
    parameters: tuple[Parameter, ...] = (
        Parameter.positive("mu", 0.5, high=2.0, unit="-", in_id=True, help="friction coefficient"),
        Parameter.positive("mass", 1.0, unit="kg", in_id=True, help="mass of each block"),
        replace(STEP, in_id=False),
        Parameter.positive("duration", 0.5, unit="s", help="length of the run"),
        GRAVITY,
        replace(STIFFNESS, default=1e6),
        SHEAR_STIFFNESS,
        CONTACT_DT,
        THETA,
        *(replace(each, default="coulomb") if each.name == "sliding" else each for each in CONTACT_DYNAMICS),
    )  # fmt: skip

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Loads over four decades at one friction, and a third of them at two others."""
        return [
            *({"mu": 0.5, "mass": mass} for mass in (0.01, 0.1, 1.0, 10.0, 100.0)),
            *({"mu": mu, "mass": 1.0} for mu in (0.2, 1.0)),
        ]

    def build(self, params: Mapping[str, Any]) -> Setup:
        """A block at the middle of each edge of a valley that descends to the right."""
        kn, mu, mass, g = params["kn"], params["mu"], params["mass"], params["g"]
        ks = kn if params["ks"] is None else params["ks"]
        law = ContactLaw(kn=kn, ks=ks, mu=mu, beta=CONTACT_BETA, restitution=0.0, regularised=True)
        slopes = slopes_of(mu)
        count = len(slopes)
        x = np.array([slope.middle + (RADIUS - mass * g * slope.normal[1] / kn) * slope.normal for slope in slopes])
        # Bodies are i, planes j: t = (ny, -nx) leads down the slope, friction up the slope is fs < 0.
        start = {
            (k, count + k): -mass * g * min(mu * slope.normal[1] * (1.0 - BELOW), slope.normal[0])
            for k, slope in enumerate(slopes)
        }
        scene = Scene(
            disks=Disks(
                x=x,
                radius=np.full(count, RADIUS),
                mass=np.full(count, mass),
                rotating=np.zeros(count, dtype=np.bool_),
            ),
            disk_disk=law,
            walls=tuple(
                Wall(
                    name=f"slope {ratio:g}",
                    point=(float(slope.middle[0]), float(slope.middle[1])),
                    normal=(float(slope.normal[0]), float(slope.normal[1])),
                    law=law,
                )
                for ratio, slope in zip(RATIOS[::-1], slopes, strict=True)
            ),
            gravity=(0.0, -g),
            initial_shear=start,
        )
        numerics = numerics_of(
            params,
            n_steps=whole_steps(params, params["duration"]),
            contact_dt=contact_step(params["dt"], PHASE / math.sqrt(max(kn, ks) / mass)),
            theta=params["theta"],
        )
        pairs = {f"{ratio:g}": (k, count + k) for k, ratio in enumerate(RATIOS[::-1])}
        return Setup(scene=scene, numerics=numerics, watch=tuple(pairs.values()), labels=pairs)

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """Mean speeds down the slopes over the second half of the run; which slope slides first; friction beyond the cone.

        ``first_slip`` lies in the middle between the steepest slope of those that hold and the flattest that slides: 1. ``cone`` is
        the largest ``|fs|/(mu m g cos) - fn/(m g cos)`` of the samples after the first, 0 within the cone.
        """
        normal, down = _normals(setup)
        path = np.einsum("snd,nd->sn", history.x - setup.scene.disks.x, down)[:, ::-1]
        half = second_half(history.t)
        elapsed = float(history.t[-1] - history.t[half])
        speed = (path[-1] - path[half]) / elapsed
        load = (params["mass"] * params["g"] * normal[:, 1])[::-1]
        beyond = (np.abs(history.fs[:, ::-1]) / params["mu"] - history.fn[:, ::-1]) / load
        beyond[0] = 0.0  # step-mean forces have no value before the first step
        holds = np.array(RATIOS) < 1.0
        series = {
            "creep": ("m", np.abs(path[:, holds]).max(axis=1)),
            "cone": ("1", np.maximum(beyond.max(axis=1), 0.0)),
        }
        least = FIRST * _coulomb(params, RATIOS[int(holds.sum())]) * 0.5 * float(history.t[-1] + history.t[half])
        scalars = {f"speed_{ratio:g}": ("m/s", float(each)) for ratio, each in zip(RATIOS, speed, strict=True)}
        scalars["creep_rate"] = ("m/s", float(np.abs(speed[holds]).max()))
        scalars["first_slip"] = ("1", math.nan if np.isnan(speed).any() else _first_slip(speed > least))
        scalars["cone_largest"] = ("1", float(series["cone"][1].max()))
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """Creep of the slopes that should hold, which slope slides first, and the cone of friction, the same at every load."""
        return (
            Headline(name="creep rate on slopes that hold", use="rest", quantity="creep_rate", expected=0.0, source=self.source,
                     scale=params["g"] * math.sin(math.atan(params["mu"])) * float(observed.t[-1]),
                     scale_is="speed without friction on the critical slope"),
            Headline(name="slope of first slip", use="sliding", quantity="first_slip", expected=1.0, source="tan(angle) = mu",
                     scale=1.0, scale_is="critical slope"),
            Headline(name="friction beyond the cone", use="sliding", quantity="cone_largest", expected=0.0,
                     source="|fs| <= mu fn", scale=1.0, scale_is="mu times the load"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Every slope by itself; what soft contacts and convex models add to rigid ones is a known difference of its derived size."""
        if engine.contact != "soft":
            return _checks(params, setup, observed, engine)
        rigid = replace(engine, contact="impulse", softness=None, dilates=False, differences={})
        right, wide = (_checks(params, setup, observed, each) for each in (rigid, engine))
        words = {check.quantity: "creeps-at-rest" for check in right}
        if engine.dilates:
            words |= {f"speed_{ratio:g}": LIFTS for ratio in RATIOS if ratio > 1.0}
        if Difference.FRICTION_LAGS in engine.differences:
            words["cone_largest"] = FINDING_WORDS[Difference.FRICTION_LAGS]
        return [
            check
            for one, two in zip(right, wide, strict=True)
            for check in excused_checks([one], [two], f"{engine.id}/{words[one.quantity]}")
        ]


class Slope(NamedTuple):
    """An edge of the valley: its middle [m], and its normal; the slope descends to the right."""

    middle: FloatArray
    normal: FloatArray


def slopes_of(mu: float) -> list[Slope]:
    """Edges of the valley, steepest first, about the origin.

    A block in the middle of an edge of half-length h is ``h sin(d) - R (1 - cos(d))`` from a plane that differs by the angle d: h has room
    for `CLEAR`, and is at least 2 R, more than what slides goes in the run.
    """
    angles = np.arctan(mu * np.array(RATIOS[::-1]))
    turns = np.abs(np.diff(angles))
    least = np.minimum(np.concatenate(([np.inf], turns)), np.concatenate((turns, [np.inf])))
    half = np.maximum(2.0 * RADIUS, CLEAR / np.sin(least) + RADIUS * np.tan(0.5 * least))
    down = np.column_stack([np.cos(angles), -np.sin(angles)])
    corners = np.concatenate([[[0.0, 0.0]], np.cumsum(2.0 * half[:, None] * down, axis=0)])
    middles = 0.5 * (corners[1:] + corners[:-1])
    middles -= 0.5 * (middles[0] + middles[-1])
    return [
        Slope(middle, np.array([math.sin(a), math.cos(a)])) for middle, a in zip(middles, angles.tolist(), strict=True)
    ]


def _normals(setup: Setup) -> tuple[FloatArray, FloatArray]:
    """Normals of the planes and the directions down them, shapes (n, 2), in the order of the scene."""
    normal = np.array([wall.normal for wall in setup.scene.walls])
    return normal, np.column_stack([normal[:, 1], -normal[:, 0]])


def _coulomb(params: Mapping[str, Any], ratio: float) -> float:
    """Acceleration down a slope [m/s^2]."""
    return acceleration(mu=params["mu"], angle=math.atan(params["mu"] * ratio), g=params["g"])


def _first_slip(slides: Any) -> float:
    """Middle between the flattest slope that slides and the one before it; the ends of the grid where all slide or none does."""
    first = int(np.argmax(slides)) if slides.any() else len(RATIOS)
    before = (0.0, *RATIOS)[first]
    return 0.5 * (before + (*RATIOS, 2.0 * RATIOS[-1])[first])


def _checks(params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo) -> list[Check]:
    t_end = float(observed.t[-1])
    middle = 0.5 * (t_end + float(observed.t[second_half(observed.t)]))
    free = params["g"] * math.sin(math.atan(params["mu"])) * t_end
    found, cone, why = [], 0.0, ""
    for ratio in RATIOS:
        limits = _limits(params, setup, observed, engine, ratio)
        cone, why = max(cone, limits.cone), limits.why["fs"]
        slides = ratio > 1.0
        found.append(
            Check(quantity=f"speed_{ratio:g}", norm="scalar", truth="analytic", expected=_coulomb(params, ratio) * middle,
                  source="Coulomb: g (sin - mu cos) t, at the middle of the second half" if slides else "Coulomb: the block rests",
                  atol=limits.slide if slides else limits.creep, scale=free, why=limits.why["vx" if slides else "creep"])
        )  # fmt: skip
    return [
        *found,
        Check(quantity="first_slip", norm="scalar", truth="analytic", expected=1.0, source="tan(angle) = mu",
              atol=1e-12, why="the slopes next to the critical one are a hundredth flatter and steeper: either does what it should"),
        Check(quantity="cone_largest", norm="scalar", truth="analytic", expected=0.0, source="|fs| <= mu fn",
              atol=cone, scale=1.0, why=why),
    ]  # fmt: skip


class Limits(NamedTuple):
    """Of one block: creep and, where it slides, error of the speed [m/s], how far the force leaves the cone, and why."""

    creep: float
    slide: float
    cone: float
    why: Mapping[str, str]


def _limits(params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo, ratio: float) -> Limits:
    """By the bounds of `ninedisk.harness.cases.incline.block`, which hold for one block on one slope.

    Positions of first-order schemes are those of half a step before or after, at either end of the second half. A soft contact creeps
    steadily, as `slack_time` says, where friction is linear in the slip, r = s of the limit; where it is ``s/sqrt(1 + s^2)`` of the
    limit, as in lagged models, ``r/sqrt(1 - r^2)`` in place of r. Spring contacts that slide start below the limit by `BELOW`: for all
    of the run, at worst. A block that lifts and lands keeps ``vx + mu vy = a t`` while it slides: its mean speed is off by mu times
    its rise over the time.
    """
    angle = math.atan(params["mu"] * ratio)
    block = {**params, "angle_deg": math.degrees(angle), "preload": True}
    elapsed = float(observed.t[-1] - observed.t[second_half(observed.t)])
    late = _coulomb(params, ratio) * setup.numerics.dt
    if engine.contact == "spring":
        # A coordinate is rounded to the size of the valley, not of the block, and so is the overlap.
        size = float(np.abs(setup.scene.disks.x).max())
        disks = replace(setup.scene.disks, radius=np.full(len(RATIOS), size), inertia=setup.scene.disks.inertia)
        bounds = spring_bounds(block, replace(setup, scene=setup.scene.replace(disks=disks)), observed)
        creep = bounds.atol["vx"]
        slide = creep + late + BELOW * params["mu"] * params["g"] * float(observed.t[-1])
    else:
        bounds = first_order_bounds(block, setup, engine)
        yields = params["g"] * math.sin(angle) * slack_time(engine, setup.numerics.dt)
        if Difference.FRICTION_LAGS in engine.differences and ratio < 1.0:
            yields /= math.sqrt(1.0 - ratio**2)
        creep = bounds.creep / elapsed if yields == 0.0 else yields * (1.0 + 1e-6) + 2e-12
        slide = late + (params["mu"] * bounds.atol["gap"] / elapsed if block_chatters(engine) else bounds.atol["vx"])
    load = params["mass"] * params["g"] * math.cos(angle)
    return Limits(creep, slide, (bounds.atol["fs"] / params["mu"] + bounds.atol["fn"]) / load, bounds.why)


CASE = HoldAndCreep()
