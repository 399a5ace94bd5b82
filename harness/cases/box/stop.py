"""A box that is thrown along a plane stops after v0^2/(2 mu g), in every direction."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.harness.api.case import Check, Headline, Observed, Parameter, ParameterError, SphereSetup, Value
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.cases.box.scene import (
    OFF,
    PAIR,
    SOLVED_IN_SINGLE,
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
    EXACT_STEP_RTOL,
    last,
    numerics_of,
    single,
    single_precision,
    soft_reason,
    whole_steps,
)
from ninedisk.harness.cases.differences import follows_associated_rule
from ninedisk.harness.results.figures import Figure, Plotted
from ninedisk.references.analytic.on_plane.box import stopping_box

HALF = np.array([0.5, 0.35, 0.2])
"""Half the edges [m]: no two alike, and flat enough to slide with mu up to 1."""

SOURCE = "Coulomb's law for a rigid box"
BEYOND = 1.2
"""Default length of the run, in times of the stop: what goes on moving shows."""


class BoxStop:
    """The box stands on a face; ``direction_deg`` is that of its velocity, ``yaw_deg`` that of its longest edge, both to the x axis.

    The pressure is centred ``mu h`` ahead of the centre of mass, on the line of the motion: friction has no moment about the normal, and
    the box goes straight whatever its yaw. A pyramid of friction stops it earlier across its edges and turns it aside elsewhere.
    """

    id = "box/stop"
    version = 1
    title = "A box slides to a stop"
    source = SOURCE
    requirement = (
        "stops after v0^2/(2 mu g), on a straight line, without rising and without turning, in every direction"
    )
    parameters: tuple[Parameter, ...] = (
        Parameter(name="direction_deg", default=15.0, low=-360.0, high=360.0, unit="deg", in_id=True, help="direction of the velocity"),
        Parameter(name="yaw_deg", default=20.0, low=-360.0, high=360.0, unit="deg", in_id=True, help="direction of the longest edge"),
        Parameter(name="mu", default=0.3, low=1e-3, high=1.0, unit="-", in_id=True, help="friction coefficient"),
        Parameter.positive("speed", 1.5, unit="m/s", help="initial speed"),
        Parameter.positive("dt", 0.005, unit="s", help="step"),
        Parameter.positive("duration", None, unit="s", help="length of the run; none: 1.2 v0/(mu g)"),
    )  # fmt: skip
    figures = (
        Figure(
            title="The stop",
            quantities=(Plotted("speed", "speed"), Plotted("across", "displacement across")),
            compare="direction_deg",
            shows="Speed along the initial direction, and what leaves the straight line.",
            allows="Both are the same in all directions; a box whose friction is not against its slip turns aside.",
        ),
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Directions of a quarter of the circle, and one where the box lies across."""
        rows = [{"direction_deg": angle} for angle in (0.0, 15.0, 30.0, 45.0, 70.0, 90.0)]
        return [*rows, {"direction_deg": 200.0, "yaw_deg": 77.0}, {"direction_deg": 15.0, "mu": 0.7}]

    def build(self, params: Mapping[str, Any]) -> SphereSetup:
        """One box on a plane."""
        ahead = params["mu"] * HALF[2]
        angle = math.radians(params["direction_deg"] - params["yaw_deg"])
        if ahead * abs(math.cos(angle)) >= HALF[0] or ahead * abs(math.sin(angle)) >= HALF[1]:
            raise ParameterError(f"mu = {params['mu']:g} is not allowed: the box would tip")  # pragma: no cover
        frame = _frame(params)
        scene = box_on_plane(
            half=HALF,
            mu=params["mu"],
            yaw=math.radians(params["yaw_deg"]),
            gravity=-G * frame.up,
            v=params["speed"] * frame.along,
        )
        n_steps = whole_steps(params, BEYOND * params["speed"] / (params["mu"] * G))
        return SphereSetup(
            scene=scene,
            numerics=numerics_of(params, n_steps=n_steps, contact_dt=spring_step(params["dt"], HALF)),
            watch=(PAIR,),
            labels={"floor": PAIR},
        )

    def observe(self, params: Mapping[str, Any], setup: SphereSetup, history: History) -> Observed:  # noqa: ARG002
        """Motion along and across the initial direction, and the angle by which the box has turned."""
        series = {
            name: each
            for name, each in seen(history, _frame(params)).items()
            if name in ("down", "across", "speed", "gap")
        }
        series["distance"] = series.pop("down")
        series["turned"] = ("rad", turned_angle(history))
        scalars = {
            f"{name}_final": (series[name][0], last(series[name][1])) for name in ("distance", "speed", "turned")
        }
        scalars["aside"] = ("m", float(np.abs(series["across"][1]).max()))
        scalars["lift"] = ("m", float(np.maximum(series["gap"][1], 0.0).max()))
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """The distance, what leaves the line, the turn."""
        path = float(_path(params, observed)[0][-1])
        whole = "stopping distance"
        return (
            Headline(name="stopping distance of a box", use="sliding", quantity="distance_final", expected=path, source="v0^2/(2 mu g)",
                     scale=path, scale_is=whole),
            Headline(name="displacement aside of a box", use="sliding", quantity="aside", expected=0.0, source="friction against the slip",
                     scale=path, scale_is=whole),
            Headline(name="turn of a box that slides", use="sliding", quantity="turned_final", expected=0.0,
                     source="friction without moment", scale=path / float(np.linalg.norm(HALF[:2])),
                     scale_is="stopping distance over half the diagonal of the face"),
            Headline(name="lift of a box that slides", use="sliding", quantity="lift", expected=0.0, source="Coulomb's law: no dilation",
                     scale=path, scale_is=whole),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """The motion in continuous time for all engines; exact steps where the scheme has them."""
        return box_checks((_exact, _continuous), params, setup, observed, engine, Difference.FRICTION_AT_TWO_CORNERS)


def _frame(params: Mapping[str, Any]) -> Any:
    return frame_at(math.radians(params["direction_deg"]))


def _path(params: Mapping[str, Any], observed: Observed) -> Any:
    """Distance [m] and speed [m/s] at the samples."""
    return stopping_box(observed.t, mu=params["mu"], speed=params["speed"], g=G)


def _exact(params: Mapping[str, Any], setup: SphereSetup, observed: Observed, engine: EngineInfo) -> list[Check]:
    """Each step takes mu g dt of the speed, the last one what is left; places are sums of the speeds."""
    numerics = setup.numerics
    if engine.scheme == "semi-implicit-euler":
        theta = 1.0
    elif engine.scheme == "theta" and numerics.sliding == "coulomb":
        theta = numerics.theta
    else:
        return []
    steps = np.arange(numerics.n_steps + 1)
    speed = np.maximum(params["speed"] - params["mu"] * G * numerics.dt * steps, 0.0)
    path = np.concatenate([[0.0], np.cumsum(numerics.dt * (theta * speed[1:] + (1.0 - theta) * speed[:-1]))])
    # Rounding decides whether a stop that ends with a step takes one more.
    rough = 1e-9 * params["speed"] + SOLVED_IN_SINGLE * single(engine, params["speed"], numerics.n_steps)
    length = single(engine, float(path[-1]), numerics.n_steps)
    off = OFF if askew_of(engine) else 0.0
    source, why = (
        f"{engine.scheme}: exact speeds and their sum",
        f"exact solution of this very scheme: round-off and the solver's tolerance{single_precision(engine)}",
    )
    return [
        Check(quantity="distance", norm="max", truth="exact-step", expected=path[observed.step], source=source, rtol=EXACT_STEP_RTOL,
              atol=rough * float(observed.t[-1]) + length + off * float(path[-1]), scale=float(path[-1]), why=why),
        Check(quantity="speed", norm="max", truth="exact-step", expected=speed[observed.step], source=source, rtol=EXACT_STEP_RTOL,
              atol=rough + off * params["speed"], scale=params["speed"], why=why),
    ]  # fmt: skip


def _continuous(params: Mapping[str, Any], setup: Any, observed: Observed, engine: EngineInfo) -> list[Check]:
    numerics, t, mu, v0 = setup.numerics, observed.t, params["mu"], params["speed"]
    dt, t_end = numerics.dt, float(t[-1])
    path, speed = _path(params, observed)
    off = slack(engine, HALF, dt=dt, n_steps=numerics.n_steps)
    slow, sunk = off.speed, off.overlap
    lever = float(HALF[:2].min())
    atol = {
        "distance": 0.5 * v0 * dt + slow * t_end + sunk,
        "speed": slow + 0.5 * mu * G * dt,
        "across": slow * t_end + sunk,
        "gap": sunk,
        "turned": (off.speed * t_end + sunk) / lever,
    }
    why = f"first order in the step: v0 dt/2{soft_reason(engine)}{single_precision(engine)}"
    if Difference.KEEPS_KN in engine.differences:
        why += "; overlaps of the load over kn"
    if Difference.FRICTION_LAGS in engine.differences:
        offset = mu * G * dt
        atol["speed"] += offset
        atol["distance"] += offset * (v0 / (mu * G) + dt)
        atol["turned"] += offset * dt / lever
        why += f"; no friction in the first step: {offset:.3g} m/s"
    if askew_of(engine):
        # So much of the friction acts across the path and turns the box, which rocks by a hundredth of that: 5e-4 m are known.
        aside = OFF * float(path[-1])
        atol["speed"] += OFF * v0
        for name, size in (("distance", aside), ("across", aside), ("gap", 1e-2 * aside), ("turned", aside / lever)):
            atol[name] += size
        why += f"; friction is off by up to {OFF:g} of its bound"
    if Difference.FRICTION_AT_TWO_CORNERS in engine.differences:
        # In each step friction takes out what rounding moves both corners by, across the motion by a turn: four roundings of two
        # coordinates each, of the centre, the turned arm, their sum and the place that is kept.
        moved = 4.0 * math.sqrt(2.0) * single(engine, float(np.hypot(*HALF[:2])) + float(path[-1]), numerics.n_steps)
        angle = math.radians(params["direction_deg"] - params["yaw_deg"])
        arm = min(abs(HALF[0] * math.cos(angle) + sign * HALF[1] * math.sin(angle)) for sign in (1.0, -1.0))
        atol["turned"] += min(moved / max(arm, 1e-9), float(path[-1]) / lever)
        why += f"; two corners that are {2.0 * arm:.2g} m apart along the motion"
    if follows_associated_rule(engine, numerics):
        # A step in touch lifts by mu times the slip; a flight has no friction, and a landing takes as much as it has left out.
        fall, lift = G * dt, mu * v0
        depth = (fall + lift) * dt + lift**2 / (2.0 * G)
        flight = 2.0 * (lift + fall) / G
        atol["speed"] += mu * (fall + 2.0 * lift)
        atol["distance"] += mu * lift * (v0 / (mu * G) + flight)
        atol["gap"] += depth
        atol["turned"] += (fall + lift) * (v0 / (mu * G) + flight) / lever
        atol["across"] += depth
        why += f"; a sliding contact opens and lands again: up to {fall + lift:.3g} m/s"
    zero = np.zeros_like(t)
    rows: list[tuple[str, Any, float]] = [
        ("distance", path, float(path[-1])), ("speed", speed, v0), ("across", zero, float(path[-1])), ("gap", zero, float(HALF[2])),
        ("turned", zero, float(path[-1]) / lever),
    ]  # fmt: skip
    return [
        Check(
            quantity=name,
            norm="max",
            truth="analytic",
            expected=expected,
            source=SOURCE,
            atol=atol[name],
            scale=scale,
            why=why,
        )
        for name, expected, scale in rows
    ]


CASE = BoxStop()
