"""Laws that hold for every observer: the exact cases in other units, along turned axes, in a moving frame.

Each variant is a case with an exact solution, seen by another observer: the engine is given the observer's numbers, and its
history, brought back, has to meet the original truths. The truths' own tolerances are widened by nothing but the rounding of
the observer's coordinates.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.harness.api.case import Case, Check, Headline, Observed, Parameter, Setup, Value
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.api.params import resolve
from ninedisk.harness.cases.common import last, single
from ninedisk.harness.cases.impact import binary as binary_collision
from ninedisk.harness.cases.incline import block as incline_block
from ninedisk.harness.cases.invariance.frames import Frame
from ninedisk.harness.cases.nine_disk import compression as nine_disk_compression
from ninedisk.harness.cases.nine_disk.scene import LOAD_CASES
from ninedisk.harness.cases.rolling import incline_disk as rolling_incline
from ninedisk.harness.cases.rolling import slip_to_roll
from ninedisk.harness.engines.drake.adapter import DISCRETE_OPTIONS
from ninedisk.references.analytic.on_plane.incline import acceleration
from ninedisk.references.analytic.on_plane.rolling_incline import roll_rates
from ninedisk.references.analytic.on_plane.slip_to_roll import rolling_speed

Scenes = Mapping[str, tuple[Any, Mapping[str, Value], frozenset[str]]]

SCENES: Scenes = {
    "collision": (
        binary_collision.CASE,
        {"kind": "elastic"},
        frozenset({"vx_1", "vx_2", "vy_1", "vy_2", "restitution_effective"}),
    ),
    "slide": (
        incline_block.CASE,
        {"mu": 0.36, "dt": 0.0025, "duration": 0.5},
        frozenset({"x", "vx", "gap", "fn", "fs"}),
    ),
    "roll": (
        rolling_incline.CASE,
        {"mu": 0.3, "dt": 0.0025, "duration": 0.5},
        frozenset({"x", "vx", "spin", "slip", "gap", "fn", "fs"}),
    ),
    "belt": (
        slip_to_roll.CASE,
        {"mu": 0.3, "dt": 0.0025, "duration": 0.5},
        frozenset({"x", "vx", "spin", "slip", "gap"}),
    ),
    "compression": (
        nine_disk_compression.CASE,
        {"load_case": "a1", "xi": 0.0, "phi_deg": 0.0, "substeps": 20},
        frozenset({"fn_disk_disk_centre", "fn_disk_disk_edge", "fn_wall_mid", "fn_wall_corner", "symmetry_error"}),
    ),
}
"""Case, its parameters, and the quantities that count, with their final values."""

UNITS = {
    "SI": (1.0, 1.0, 1.0),
    "cm-g-s": (1e2, 1e3, 1.0),
    "mm-g-ms": (1e3, 1e3, 1e3),
    "um-ug-us": (1e6, 1e9, 1e6),
    "km-Mg-min": (1e-3, 1e-3, 1.0 / 60.0),
}
"""Numbers of a metre, a kilogram and a second."""

SCENE = Parameter(
    name="scene",
    default="slide",
    choices=tuple(SCENES),
    in_id=True,
    help="elastic collision, block that slides down an incline, disk that rolls down one, disk thrown along a plane, "
    "nine disks compressed without friction",
)
UNIT = Parameter(name="units", default="SI", choices=tuple(UNITS), help="units of the numbers that the engine is given")
ANGLE = Parameter(name="angle_deg", default=0.0, low=-360.0, high=360.0, unit="deg", help="rotation of the whole scene")
SPEEDS = tuple(
    Parameter(
        name=f"frame_v{axis}", default=0.0, low=-1e3, high=1e3, unit="m/s", help=f"velocity of the whole scene along {axis}"
    )
    for axis in "xy"
)  # fmt: skip

ROUNDINGS = 16.0
"""Of a gap: two coordinates turned and shifted there, two brought back, a few roundings each."""


def settings_with_dimension() -> dict[str, tuple[float, int, int]]:
    """Defaults of engines' settings that are times or velocities, with their powers of length and time."""
    sap, lagged = DISCRETE_OPTIONS["drake-sap"], DISCRETE_OPTIONS["drake-lagged"]
    return {
        "drake-sap.relaxation_time": (sap["relaxation_time"].default, 0, 1),
        "drake-lagged.stiction_tolerance": (lagged["stiction_tolerance"].default, 1, -1),
        "drake-lagged.dissipation": (lagged["dissipation"].default, -1, 1),
    }


@dataclass(frozen=True, kw_only=True)
class Invariance:
    """A case of this family: which of the observer's parameters its variants set."""

    id: str
    title: str
    requirement: str
    variants: tuple[Mapping[str, Value], ...]
    version: int = 2
    source: str = "dimensional analysis, Galilei's relativity and isotropy; truths of the original cases"
    parameters: tuple[Parameter, ...] = (SCENE, UNIT, ANGLE, *SPEEDS)

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """A few observers."""
        return self.variants

    @property
    def scenes(self) -> Scenes:
        """What is seen, by name."""
        return SCENES

    def frame(self, params: Mapping[str, Any]) -> Frame:
        """The observer of a variant."""
        length, mass, time = UNITS[params["units"]]
        velocity = (params["frame_vx"], params["frame_vy"])
        return Frame(length=length, mass=mass, time=time, angle=math.radians(params["angle_deg"]), velocity=velocity)

    def original(self, params: Mapping[str, Any]) -> tuple[Case, Mapping[str, Any], Setup]:
        """The case that is seen, its parameters and its problem."""
        case, overrides, _ = self.scenes[params["scene"]]
        full = resolve(case, overrides).params
        return case, full, case.build(full)

    def observed_problem(self, params: Mapping[str, Any]) -> tuple[Setup, float]:
        """The problem that is seen, in its own units, and the speed of the observer [m/s]."""
        return self.original(params)[2], math.hypot(*self.frame(params).velocity)

    def build(self, params: Mapping[str, Any]) -> Setup:
        """The original scene as the observer sees it."""
        return self.frame(params).setup(self.original(params)[2], settings_with_dimension())

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:  # noqa: ARG002
        """The original case's quantities, from the history brought back; of the compression, what a half row's contacts bear in the end."""
        case, full, original = self.original(params)
        found = case.observe(full, original, self.frame(params).history(history))
        if params["scene"] != "compression":
            return found
        force = sum(last(found.series[name][1]) for name in ("fn_disk_disk_centre", "fn_wall_mid"))
        return replace(found, scalars={**found.scalars, "row_force": ("N", force)})

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """A quantity of the scene that has one value in every scheme: what is off is off by the observer."""
        scene, full = params["scene"], self.original(params)[1]
        if scene == "collision":
            quantity, expected, source, scale_is = (
                "restitution_effective",
                1.0,
                "Newton's restitution",
                "speed of approach",
            )
        elif scene == "compression":
            load = LOAD_CASES[full["load_case"]]
            quantity, expected, scale_is = (
                "row_force",
                load.kn * load.v_wall * load.load_cycles * load.dt,
                "force of a smooth row",
            )
            source = "the two contacts of a half row are closed by their wall's way: kn v T"
        elif scene == "belt":
            quantity, expected, source = "vx_final", rolling_speed(speed=full["speed"]), "disk that rolls in the end"
            scale_is = "final speed, seen from the belt"
        else:
            case = {"mu": full["mu"], "angle": math.radians(full["angle_deg"]), "g": full["g"]}
            rolls = roll_rates(mass=rolling_incline.MASS, radius=rolling_incline.RADIUS, **case).along
            rate = rolls if scene == "roll" else acceleration(**case)
            quantity, expected, source = (
                "vx_final",
                rate * float(observed.t[-1]),
                "Newton and Euler with Coulomb friction",
            )
            scale_is = "final speed"
        return (
            Headline(name="motion seen by the observer", use="invariance", quantity=quantity, expected=expected, source=source,
                     scale=expected, scale_is=scale_is),
        )  # fmt: skip

    def checks(
        self,
        params: Mapping[str, Any],
        setup: Setup,  # noqa: ARG002
        observed: Observed,
        engine: EngineInfo,
    ) -> Sequence[Check]:
        """The original case's truths with the rounding of the observer's coordinates added."""
        case, full, original = self.original(params)
        counted = self.scenes[params["scene"]][2]
        rounding = _rounding(self.frame(params), original, engine)
        return [
            replace(
                check,
                atol=check.atol + rounding[_unit(check, observed)],
                known=check.known and replace(check.known, size=check.known.size + rounding[_unit(check, observed)]),
                why=f"{check.why}; rounding of the observer's numbers",
            )
            for check in case.checks(full, original, observed, engine)
            if check.quantity.removesuffix("_final") in counted and check.truth in ("exact-step", "analytic")
        ]  # fmt: skip


def _unit(check: Check, observed: Observed) -> str:
    return (observed.series.get(check.quantity) or observed.scalars[check.quantity])[0]


def _rounding(frame: Frame, original: Setup, engine: EngineInfo) -> dict[str, float]:
    """What the rounding of the observer's coordinates, as large as the displacement of the frame, adds, by unit.

    A force balance through a contact spring leaves velocities of a unit of the coordinates in a contact step (see
    `ninedisk.harness.cases.common.round_off_speed`); without springs, velocities are rounded to their own last bit, and impulses
    are what changes them in a step.
    """
    scene, numerics, bodies = original.scene, original.numerics, original.scene.bodies
    t_end = numerics.dt * numerics.n_steps
    drift = math.hypot(*frame.velocity)
    reach = float(np.abs(bodies.x).max() + bodies.radius.max()) + drift * t_end
    length = ROUNDINGS * float(np.spacing(reach))
    kn = max(law.kn for law in (scene.law_of_bodies, *(wall.law for wall in scene.walls)))
    mass, radius = float(bodies.mass.max()), float(bodies.radius.min())
    if engine.contact == "spring":
        # A step is resolved to some 1e-2 of a contact's period: what a gap's rounding does to a force lasts at most that long.
        speed = length / (numerics.contact_dt or numerics.dt)
        force = kn * length
    else:
        # Loads and contacts each round the velocity in every step.
        speed = (
            length / numerics.dt + ROUNDINGS * float(np.spacing(drift)) + single(engine, drift, 2 * numerics.n_steps)
        )
        force = mass * speed / numerics.dt
        if frame.angle and engine.contact in ("impulse", "soft"):
            # A contact along no axis closes within a step what rounding opens: sqrt(3) units of a place, and of the speeds that cancel.
            moved = float(np.abs(bodies.v).max()) + math.hypot(*scene.gravity) * t_end
            force += mass * single(engine, moved, 8) / numerics.dt
            if engine.contact == "impulse":
                force += mass * 0.25 * math.sqrt(3.0) * single(engine, reach, 8) / numerics.dt**2
        length += single(engine, reach, numerics.n_steps)
    top = float(np.abs(bodies.v).max())
    return {
        "m": length + speed * t_end,
        "m/s": speed,
        "rad/s": 2.0 * speed / radius,
        "N": force,
        "1": 2.0 * speed / top if top else 0.0,
    }


CASES = (
    Invariance(
        id="invariance/units",
        title="The same scene in other units",
        requirement="numbers in mm-g-ms and other units give the same physics to round-off: no absolute thresholds",
        variants=(
            {"scene": "collision", "units": "mm-g-ms"},
            {"scene": "slide", "units": "um-ug-us"},
            {"scene": "roll", "units": "km-Mg-min"},
            {"scene": "compression", "units": "mm-g-ms"},
        ),
    ),
    Invariance(
        id="invariance/rotation",
        title="The same scene along turned axes",
        requirement="a scene turned by any angle gives the turned motion to round-off: no direction is special",
        variants=(
            {"scene": "collision", "angle_deg": 30.0},
            {"scene": "slide", "angle_deg": 217.0},
            {"scene": "compression", "angle_deg": 30.0},
        ),
    ),
    Invariance(
        id="invariance/galilei",
        title="The same scene in a moving frame",
        requirement="a scene that moves as a whole, walls and all, gives the same relative motion and forces to round-off",
        variants=(
            {"scene": "collision", "frame_vx": 3.0, "frame_vy": -2.0},
            {"scene": "slide", "frame_vx": 3.0},
            {"scene": "slide", "frame_vx": -3.0},  # a wall taken for one at rest would push the other way
            {"scene": "belt", "frame_vx": -1.0},  # a disk at rest on a belt
            {"scene": "compression", "frame_vx": 3.0, "frame_vy": -2.0},
        ),
    ),
)
