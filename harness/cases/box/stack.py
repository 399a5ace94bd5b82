"""A tower of unequal boxes stands on an incline: what each face bears, and where; nothing moves."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.law import SphereLaw
from ninedisk.core.scene import PlaneWall, Spheres, SphereScene
from ninedisk.harness.api.case import (
    Check,
    Headline,
    Observed,
    Parameter,
    ParameterError,
    SphereSetup,
    Value,
)
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.cases.box.scene import KN, SOLVED, G, about_z, box_checks, corner_response, frame_at, spring_step
from ninedisk.harness.cases.common import (
    last,
    numerics_of,
    second_half,
    single,
    single_precision,
    slack_time,
    soft_reason,
    whole_steps,
)
from ninedisk.harness.results.figures import Figure, Plotted
from ninedisk.references.analytic.assembly.box_tower import TowerForces, tower_forces

MASSES = np.array([3.0, 1.0, 2.0])
"""Of the boxes, the lowest first [kg]."""

HALVES = np.array([[0.5, 0.4, 0.15], [0.4, 0.45, 0.1], [0.35, 0.3, 0.2]])
"""Half the edges of the boxes of size 1 [m]."""

PLACES = np.array([[0.0, 0.0], [-0.06, 0.05], [-0.1, -0.04]])
"""Of their centres in the plane, down the slope and across [m]."""

YAWS = np.array([0.3, 0.9, 0.1])
"""Angles of their first edges to the x axis [rad]: no face lies along another one or along an axis."""

DOWN = 0.5
"""Angle of the slope's direction to the x axis [rad]."""

ORDERS = {"upwards": (0, 1, 2), "shuffled": (1, 2, 0)}
"""Boxes in the order of the scene."""

ROCKS = 0.002
"""By how much corners lift that do not come to rest, over the size: twice what was measured on PhysX, which is 0.0011."""

SOURCE = "statics: each face holds the weight above it, on its line of action"


class BoxStack:
    """Single corners of a face are statically indeterminate; the resultant of each face and its centre are not.

    Three boxes of unequal mass and size, turned and shifted against each other, stand with a face on a face.
    """

    id = "box/stack"
    version = 1
    title = "A tower of boxes stands"
    source = SOURCE
    requirement = (
        "each face bears the weight above it, by fn and by friction, centred on its line of action; nothing moves"
    )
    parameters: tuple[Parameter, ...] = (
        Parameter(name="slope_deg", default=15.0, low=0.0, high=20.0, unit="deg", in_id=True, help="slope of the incline"),
        Parameter(name="mu", default=0.5, low=0.0, high=10.0, unit="-", help="friction coefficient"),
        Parameter(name="order", default="upwards", choices=tuple(ORDERS), in_id=True, help="order of the boxes in the scene"),
        Parameter.positive("size", 1.0, high=100.0, unit="-", in_id=True, help="factor of all lengths; the masses stay"),
        Parameter.positive("dt", 0.005, high=0.01, unit="s", help="step"),
        Parameter.positive("duration", 0.06, unit="s", help="length of the run"),
    )  # fmt: skip
    figures = (
        Figure(
            title="A tower at rest",
            quantities=(Plotted("speed", "largest speed"), Plotted("creep", "largest displacement")),
            compare="size",
            shows="The fastest of the boxes, and the one that is farthest from where it was.",
            allows="Rigid contacts hold at once; soft ones let the tower creep.",
        ),
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """On a slope, and level; in two orders, in three sizes."""
        return [{}, {"slope_deg": 0.0, "order": "shuffled", "size": 0.1}, {"order": "shuffled", "size": 10.0}]

    def build(self, params: Mapping[str, Any]) -> SphereSetup:
        """Three boxes on a plane, under tilted gravity."""
        slope, size, order = math.radians(params["slope_deg"]), float(params["size"]), list(ORDERS[params["order"]])
        if math.tan(slope) > 0.95 * params["mu"]:
            raise ParameterError(
                f"slope_deg = {params['slope_deg']:g} is not allowed with mu = {params['mu']:g}: the tower would slide; use less, or more "
                "friction"
            )
        frame = frame_at(DOWN)
        heights = 2.0 * np.cumsum(HALVES[:, 2]) - HALVES[:, 2]
        x = PLACES[:, :1] * frame.along + PLACES[:, 1:] * frame.across + heights[:, None] * frame.up
        law = SphereLaw(kn=KN, ks=KN, mu=params["mu"], restitution=0.0, regularised=True)
        bodies = Spheres(
            x=size * x[order],
            mass=MASSES[order],
            half_sizes=size * HALVES[order],
            quaternion=np.array([about_z(float(angle)) for angle in YAWS[order]]),
        )
        floor = PlaneWall(name="floor", point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), law=law)
        gx, gy, gz = (G * (math.sin(slope) * frame.along - math.cos(slope) * frame.up)).tolist()
        pairs = _pairs(params)
        numerics = numerics_of(
            params,
            n_steps=whole_steps(params, params["duration"]),
            contact_dt=spring_step(params["dt"], HALVES[2], float(MASSES.min())),
        )
        return SphereSetup(
            scene=SphereScene(spheres=bodies, sphere_sphere=law, walls=(floor,), gravity=(gx, gy, gz)),
            numerics=replace(numerics, sample_every=min(3, numerics.n_steps)),
            watch=tuple(pairs),
            labels={f"below {k + 1}": pair for k, pair in enumerate(pairs)},
        )

    def observe(self, params: Mapping[str, Any], setup: SphereSetup, history: History) -> Observed:
        """Forces of each face, upwards, and their centres from below that of the box; the fastest of the boxes."""
        frame, late = frame_at(DOWN), max(1, second_half(history.t))
        size, scene = float(params["size"]), setup.scene
        moved = np.linalg.norm(history.x - history.x[0], axis=2)
        series = {
            "creep": ("m", moved.max(axis=1)),
            "speed": ("m/s", np.linalg.norm(history.v, axis=2).max(axis=1)),
            "turning": ("rad/s", np.linalg.norm(history.omega, axis=2).max(axis=1)),
            "gap": ("m", np.abs(history.gap).max(axis=1)),
        }
        scalars = {"creep_final": ("m", last(series["creep"][1]))}
        for k, (i, _) in enumerate(setup.watch):
            above = _number(params, k)
            # The force on the first body of the pair, which is the upper one or the one below it.
            sign = 1.0 if i == above else -1.0
            force = sign * history.fn[:, k, None] * frame.up + history.fs[:, k]
            level = -sign * size * HALVES[k if i == above else k - 1, 2]
            centre = np.full((len(history.t), 2), np.nan)
            if history.moment is not None:
                moment = history.moment[:, k]
                with np.errstate(divide="ignore", invalid="ignore"):
                    centre[:, 0] = (level * force[:, 0] - moment[:, 1]) / force[:, 2]
                    centre[:, 1] = (level * force[:, 1] + moment[:, 0]) / force[:, 2]
                centre += scene.spheres.x[i, :2] - scene.spheres.x[above, :2]
            number = k + 1
            series[f"fn_{number}"] = ("N", history.fn[:, k])
            series[f"fs_{number}"] = ("N", -sign * history.fs[:, k] @ frame.along)
            for name, axis in (("down", frame.along), ("across", frame.across)):
                scalars[f"{name}_{number}"] = ("m", float((centre[late:] @ axis[:2]).mean()))
            for name in ("fn", "fs"):
                scalars[f"{name}_{number}_mean"] = ("N", float(series[f"{name}_{number}"][1][late:].mean()))
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """The lowest face, and how far a box creeps."""
        forces, t_end = _statics(params), float(observed.t[-1])
        size, weight = float(params["size"]), float(MASSES.sum() * G)
        return (
            Headline(name="normal force under a tower", use="rest", quantity="fn_1_mean", expected=float(forces.fn[0]), source=SOURCE,
                     scale=weight, scale_is="weight of the tower"),
            Headline(name="centre of pressure under a tower", use="rest", quantity="down_1", expected=float(forces.centre[0, 0]),
                     source=SOURCE, scale=size * float(HALVES[0].min()), scale_is="shortest half edge"),
            Headline(name="creep of a tower", use="rest", quantity="creep_final", expected=0.0, source="friction holds",
                     scale=0.5 * G * t_end**2, scale_is="free fall"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Rest and resultants for all engines; forces from the first step on where the scheme is exact."""
        return box_checks((_exact, _statically), params, setup, observed, engine, Difference.BOXES_ROCK)


def _number(params: Mapping[str, Any], k: int) -> int:
    """Number in the scene of the box at place ``k``, from below."""
    return ORDERS[params["order"]].index(k)


def _pairs(params: Mapping[str, Any]) -> list[tuple[int, int]]:
    """Bodies that share the face below each box."""
    one, two, three = (_number(params, k) for k in range(3))
    return [(one, 3), (min(one, two), max(one, two)), (min(two, three), max(two, three))]


def _statics(params: Mapping[str, Any]) -> TowerForces:
    """Forces of the faces; their centres [m] from below those of the boxes."""
    size = float(params["size"])
    found = tower_forces(
        MASSES.tolist(), (size * HALVES[:, 2]).tolist(), size * PLACES, angle=math.radians(params["slope_deg"]), g=G
    )
    return found._replace(centre=found.centre - size * PLACES)


def _response() -> float:
    """Largest response of a box to a force at a corner that bears all above it, over free fall."""
    above = np.cumsum(MASSES[::-1])[::-1] / MASSES
    return float(max(corner_response(half) * load for half, load in zip(HALVES, above, strict=True)))


def _rocks(engine: EngineInfo) -> str:
    """What a tolerance says of corners that lift."""
    lifts = Difference.BOXES_ROCK in engine.differences
    return f"; corners that lift by {ROCKS:g} of the size, and their falls" if lifts else ""


def _rocking(params: Mapping[str, Any], engine: EngineInfo) -> tuple[float, float]:
    """By how much corners lift [m], and the speed of a fall from there [m/s]."""
    lift = ROCKS * float(params["size"]) if Difference.BOXES_ROCK in engine.differences else 0.0
    return lift, math.sqrt(2.0 * G * lift)


def _exact(params: Mapping[str, Any], setup: Any, observed: Observed, engine: EngineInfo) -> list[Check]:
    """From the first step on each face bears what statics says."""
    numerics = setup.numerics
    if engine.scheme != "semi-implicit-euler" and not (engine.scheme == "theta" and numerics.sliding == "coulomb"):
        return []
    forces, weight = _statics(params), float(MASSES.sum() * G)
    thrown = float(MASSES.sum()) * 2.0 * _rocking(params, engine)[1] / numerics.dt
    known = np.where(observed.t > 0.0, 1.0, np.nan)
    return [
        Check(quantity=f"{name}_{k + 1}", norm="max", truth="exact-step", expected=known * float(values[k]), source="rest in every step",
              atol=(1e-8 + SOLVED) * weight + single(engine, weight, 16) + thrown, scale=weight,
              why=f"exact in every step: the solver's tolerance, 1e-8{single_precision(engine)}{_rocks(engine)}")
        for name, values in (("fn", forces.fn), ("fs", forces.fs))
        for k in range(3)
    ]  # fmt: skip


def _statically(params: Mapping[str, Any], setup: Any, observed: Observed, engine: EngineInfo) -> list[Check]:
    numerics, size, forces = setup.numerics, float(params["size"]), _statics(params)
    t_end, weight = float(observed.t[-1]), float(MASSES.sum() * G)
    falls = _response() * G
    speed = falls * slack_time(engine, numerics.dt) + SOLVED * falls * t_end
    speed += single(engine, G * t_end, numerics.n_steps)
    length = size * float(np.abs(HALVES).max())
    place = speed * t_end + 1e-12 * size + single(engine, 2.0 * length, numerics.n_steps)
    lift, fall = _rocking(params, engine)
    place, speed = place + lift, speed + fall
    # What the momentum changes by over half the run.
    share = 1e-8 + SOLVED + 4.0 * speed / (G * t_end)
    lever = size * float(HALVES.min())
    why = f"rest: the solver's tolerance, 1e-8{soft_reason(engine)}{single_precision(engine)}{_rocks(engine)}"
    zero = np.zeros_like(observed.t)
    rows = (
        ("creep", place, 0.5 * G * t_end**2),
        ("speed", speed, G * t_end),
        ("turning", speed / lever, G * t_end / lever),
        ("gap", 2.0 * place, lever),
    )
    found = [
        Check(quantity=name, norm="max", truth="analytic", expected=zero, source="friction holds, and no box tips", atol=atol, scale=scale,
              why=why)
        for name, atol, scale in rows
    ]  # fmt: skip
    for k in range(3):
        numbers = (
            (f"fn_{k + 1}_mean", float(forces.fn[k]), share * weight, weight),
            (f"fs_{k + 1}_mean", float(forces.fs[k]), share * weight, weight),
            (
                f"down_{k + 1}",
                float(forces.centre[k, 0]),
                2.0 * share * weight / float(forces.fn[k]) * length + place,
                lever,
            ),
            (
                f"across_{k + 1}",
                float(forces.centre[k, 1]),
                2.0 * share * weight / float(forces.fn[k]) * length + place,
                lever,
            ),
        )
        found += [
            Check(quantity=name, norm="scalar", truth="analytic", expected=expected, source=SOURCE, atol=atol, scale=scale,
                  why=f"mean over half the run; {why}")
            for name, expected, atol, scale in numbers
        ]  # fmt: skip
    return found


CASE = BoxStack()
