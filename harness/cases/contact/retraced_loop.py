"""Contacts that retrace a path: no shear is left after a cycle, whatever the number of cycles."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.law import SlipAt
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall, WallSegment
from ninedisk.harness.api.capabilities import LEVER_ARMS
from ninedisk.harness.api.case import Check, FloatArray, Headline, Observed, Parameter, ParameterError, Setup, Value
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.cases.differences import checks_with_allowance, excused_checks
from ninedisk.harness.cases.matched import slip_of
from ninedisk.harness.cases.nine_disk.scene import NINE_DISK_CD, cd_settings
from ninedisk.references.analytic.contact.retraced_loop import (
    passing_drift,
    passing_shear,
    turning_wall_drift,
    turning_wall_shear,
)
from ninedisk.references.exact_steps.retraced_loop import oscillation_central, pair_shear, turning_wall_steps

RADIUS, MASS, PERIOD = 0.5, 1.0, 5e-3
FREQUENCY = 2.0 * math.pi / PERIOD

KN = 1e-12
"""Normal and shear stiffness of the rough contact [N/m]: it moves a disk by some 1e-17 m in a run, and its shear is a length fs/ks."""

OTHER_RADIUS, AHEAD, ASIDE = 0.2, 0.2, -0.55
"""Of the disk that is passed [m], and its place seen from the middle of the oscillation."""

SQUEEZE = 0.06
"""Overlap [m] with either smooth wall in the middle of the oscillation: more than the largest amplitude, so that springs stay linear."""

SUNK = 0.05
"""Overlap [m] with the turning wall at first; with mu = 1 friction bears that much of fs/ks, and more between the disks."""

SAMPLES = 20
"""Samples of a cycle."""

PAIR = (0, 1)


class RetracedLoop:
    """A rough contact whose distance and normal go to and fro on one path: its net slip is 0 after every cycle.

    ``kind=pair``: a disk between two smooth walls oscillates past another disk, obliquely to the line of centres. ``kind=wall``: a
    wall comes nearer to a disk, turning about its centre, and goes the same way back. The rough contact is too weak to move anything:
    its shear spring records slip and nothing else.

    A contact model that adds up the slip of half steps with the normal of the step's end errs by ``-(dt/2) r' phi' dt`` in each step,
    r the distance and phi the angle of the normal. On the way back both rates have changed their sign and their product has not: the
    error of a cycle is of first order in the step and grows with the cycles (the "ratchet"). With the normal of the middle of the step
    the way back undoes the errors of the way there, but for O(dt^3) where the path turns within a step; here the oscillation mirrors
    itself in time, which leaves O(dt^4), and the wall turns at the end of a step, which leaves nothing.

    ``drift`` is what an engine does in a cycle, in units of the amplitude. For an engine with the form of the end it is a finding: its
    error against the net slip of 0 is shown, the tolerance is what that form's own error is to first order, and its exact steps are
    judged beside it.
    """

    id = "contact/retraced-loop"
    version = 1
    title = "Contact that retraces a path"
    source = "line integral of slip; the ratchet: Vyas, Ottino, Lueptow & Umbanhowar, Comput. Phys. Commun. 310 (2025) 109524"
    requirement = "a contact that has gone to and fro on a path has the shear force that it began with"
    parameters: tuple[Parameter, ...] = (
        Parameter(name="kind", default="pair", choices=("pair", "wall"), in_id=True, help="contact of two disks, or with a wall"),
        Parameter(
            name="slip_at", default="middle", choices=("middle", "end"), in_id=True,
            help="where in a step the scene's contact law measures slip",
        ),
        Parameter(
            name="arm", default="radius", choices=("radius", "overlap"), in_id=True,
            help="lever arm R, walls felt on their surface, or R - overlap/2, walls felt there",
        ),
        Parameter(
            name="rotation", default="blocked", choices=("blocked", "free"), in_id=True,
            help="whether disks could turn if something turned them; nothing does",
        ),
        Parameter.positive("amplitude", 0.02, high=0.04, unit="m",
                           help="of the oscillation; way of the wall, by which its surface slides along as well"),
        Parameter(
            name="steps", default=100, low=SAMPLES, whole=True, help=f"steps of every engine in a cycle, a multiple of {SAMPLES}"
        ),
        Parameter(name="cycles", default=5, low=1, whole=True, help="cycles of the run"),
        *NINE_DISK_CD,
    )  # fmt: skip

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Pair and wall with either place of the slip; the end with the other arm and free disks, as further engines have it."""
        return [
            {"kind": kind, **more}
            for kind in ("pair", "wall")
            for more in (
                {"slip_at": "middle"},
                {"slip_at": "end"},
                {"slip_at": "end", "arm": "overlap", "rotation": "free"},
            )
        ]

    def sticks(self, params: Mapping[str, Any]) -> bool:  # noqa: ARG002
        """All contacts stay closed, and none slides: `build` sees to that."""
        return True

    def build(self, params: Mapping[str, Any]) -> Setup:
        """The disk in the origin; the passed disk below it between the smooth walls, or the turning wall below it."""
        if params["steps"] % SAMPLES:
            raise ParameterError(
                f"steps = {params['steps']} is not allowed: a cycle has {SAMPLES} samples; use a multiple of {SAMPLES}"
            )
        drift = params["cycles"] * abs(predicted_drift(params, params["steps"], mid=True))
        if not drift + params["amplitude"] < SUNK:
            raise ParameterError(
                f"cycles = {params['cycles']}, steps = {params['steps']} are not allowed: slip of the step's end would let the shear force "
                f"drift by {drift:g} m, to the friction limit; the drift must stay below {SUNK - params['amplitude']:g} m "
                "(fewer cycles, or more steps)"
            )
        rough = ContactLaw(
            kn=KN, ks=KN, mu=1.0, lever_arm=params["arm"], slip_at=params["slip_at"],
            wall_velocity_at="mid-overlap" if params["arm"] == "overlap" else "surface",
        )  # fmt: skip
        free, amplitude = params["rotation"] == "free", float(params["amplitude"])
        if params["kind"] == "pair":
            # Two springs act on the disk.
            smooth = ContactLaw(kn=0.5 * MASS * FREQUENCY**2)
            disks: dict[str, Any] = {
                "x": [(0.0, 0.0), (AHEAD, ASIDE)],
                "v": [(amplitude * FREQUENCY, 0.0), (0.0, 0.0)],
                "radius": [RADIUS, OTHER_RADIUS],
            }
            walls = tuple(
                Wall(name=name, point=(-side * (RADIUS - SQUEEZE), 0.0), normal=(side, 0.0), law=smooth)
                for name, side in (("left", 1.0), ("right", -1.0))
            )
        else:
            disks = {"x": [(0.0, 0.0)], "radius": RADIUS}
            half = 0.5 * PERIOD
            motion = tuple(
                WallSegment(
                    duration=half, velocity=(0.0, sign * amplitude / half), angular_velocity=sign * _angle(params) / half,
                    pivot=(0.0, 0.0 if sign > 0.0 else amplitude),
                )
                for _ in range(params["cycles"]) for sign in (1.0, -1.0)
            )  # fmt: skip
            walls = (Wall(name="floor", point=(0.0, SUNK - RADIUS), normal=(0.0, 1.0), law=rough, motion=motion),)
        numerics = Numerics(
            dt=PERIOD / SAMPLES,
            n_steps=SAMPLES * params["cycles"],
            contact_dt=PERIOD / params["steps"],
            **cd_settings(params),
        )
        scene = Scene(disks=Disks(mass=MASS, rotating=free, **disks), disk_disk=rough, walls=walls)  # type: ignore[arg-type]
        return Setup(scene=scene, numerics=numerics, watch=(PAIR,), labels={"contact": PAIR})

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """``shear``: fs/ks; ``astray``: that less the shear of the place on the path where the engine has the contact."""
        shear = history.fs[:, 0] / KN
        if params["kind"] == "pair":
            start = setup.scene.disks.x
            travel = (history.x[:, 0, 0] - start[0, 0]) - (history.x[:, 1, 0] - start[1, 0])
        else:
            travel = float(params["amplitude"]) * _path_fraction(history.t)
        astray = shear - _path(params, travel, mid=_mid_overlap(params))
        series = {"shear": ("m", shear), "astray": ("m", astray), "way": ("m", travel)}
        drift = float(astray[-1]) / (params["cycles"] * params["amplitude"])
        return Observed(step=history.step, t=history.t, series=series, scalars={"drift": ("-", drift)})

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """Net slip on a path that goes to and fro, which is 0 after a cycle, wherever in a step the scene's law measures it."""
        return (
            Headline(name="drift in a cycle", use="moving-walls", quantity="drift", expected=0.0,
                     source="line integral of slip along the path", scale=1.0, scale_is="amplitude of the path"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Exact steps of central differences in the engine's own form; net slip 0 for all with contact springs.

        Tolerances: round-off; where shear forces are turned to first order, half the square of each step's rotation, of the shear
        force; against the path, the midpoint rule's error of a cycle, or what the form of the end adds to first order.
        """
        if params["regime"] == "quasi-static":
            return []
        return checks_with_allowance(
            Difference.FIXED_WALL_SHEAR,
            setup,
            engine,
            lambda setup, engine: self._checks(params, setup, observed, engine),
        )

    def _checks(self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo) -> list[Check]:
        count = round(PERIOD / (setup.numerics.contact_dt or PERIOD / params["steps"]))
        place, mid = _place(params, engine), _mid_overlap(params, engine)
        stepped = _stepped(params, count, place, mid=mid)
        growth, _, turned = _turning_error(params, engine, count, stepped)
        rounding = _rounding(params, engine, count)
        why = "round-off of coordinates, added up" + turned
        found = []
        if engine.scheme == "central-difference":
            exact = stepped[:: count // SAMPLES]
            source = f"slip of half steps with the normal of the {place} of the step"
            atol = rounding + growth
            found.append(
                Check(
                    quantity="shear", norm="max", truth="exact-step", expected=exact, source=source, atol=atol, why=why
                )
            )
        wide = self._along_path(params, observed, engine, count, place)
        if place == "end" and params["slip_at"] == "middle":
            # The scene asks for the middle, and the engine has the end of a step alone.
            right = self._along_path(params, observed, engine, count, "middle")
            return [*found, *excused_checks(right, wide, f"{engine.id}/ratchet")]
        return [*found, *wide]

    def _along_path(
        self, params: Mapping[str, Any], observed: Observed, engine: EngineInfo, count: int, place: SlipAt
    ) -> list[Check]:
        """Against the line integral of slip, for an engine that measures slip at ``place``."""
        mid = _mid_overlap(params, engine)
        growth, remains, turned = _turning_error(params, engine, count, _stepped(params, count, place, mid=mid))
        rounding = _rounding(params, engine, count)
        why = "round-off of coordinates, added up" + turned
        within, drift, left = _midpoint(params, count), 0.0, _unfinished(params, count)
        first = "the midpoint rule's error within a cycle"
        if place == "end":
            # Halfway through a cycle the sum of ends is ahead by half of the cycle's drift, and by half of what its integrand grew by.
            drift, left = 1.1 * abs(predicted_drift(params, count, mid=mid)), 0.0
            within += 2.0 * drift
            first = "what slip of the step's end adds to first order, and a tenth more for the next order"
        elif engine.contact == "cd":
            # The last step's force still has the tangent of its begin; rates of an oscillation are at most twice their mean square.
            one = 2.0 * abs(predicted_drift(params, count, mid=mid)) / count
            left, within = within + one, within + one
            first += ", and one step's error of first order, which the next step mends"
        cycles, path = float(params["cycles"]), "line integral of slip along the path: 0 after a cycle"
        # An engine that feels a wall in another place has another integral within a cycle.
        travel = float(params["amplitude"]) * _path_fraction(observed.t)
        other = _path(params, travel, mid=mid) - _path(params, travel, mid=_mid_overlap(params))
        return [
            Check(
                quantity="astray", norm="max", truth="analytic", expected=other, source=path,
                atol=within + cycles * drift + rounding + growth, why=f"{first}; {why}", scale=float(params["amplitude"]),
            ),
            Check(
                quantity="drift", norm="scalar", truth="analytic", expected=0.0, source=path,
                atol=(drift + (remains + rounding + left) / cycles) / float(params["amplitude"]), why=f"{first}; {why}",
                scale=1.0,
            ),
        ]  # fmt: skip


def predicted_drift(params: Mapping[str, Any], count: int, *, mid: bool) -> float:
    """What slip of the step's end adds to fs/ks per cycle of ``count`` steps, to first order [m]; ``mid`` as for `_mid_overlap`."""
    amplitude, dt = float(params["amplitude"]), PERIOD / count
    if params["kind"] == "pair":
        return passing_drift(amplitude=amplitude, frequency=FREQUENCY, ahead=AHEAD, aside=ASIDE, dt=dt)
    return turning_wall_drift(path=amplitude, angle=_angle(params), period=PERIOD, dt=dt, mid_overlap=mid)


def _angle(params: Mapping[str, Any]) -> float:
    """By which the wall turns [rad]."""
    return float(params["amplitude"]) / RADIUS


def _mid_overlap(params: Mapping[str, Any], engine: EngineInfo | None = None) -> bool:
    """Whether walls are felt in the middle of the overlap: as the scene asks for it, or as an engine without that arm has it."""
    arms = LEVER_ARMS["radius"], LEVER_ARMS["overlap"]
    asked = arms[params["arm"] == "overlap"]
    if engine is None:
        return asked is arms[1]
    known = engine.capabilities if engine.arms_at_walls is None else engine.arms_at_walls
    return asked is arms[1] if asked in known else arms[1] in known


def _path_fraction(t: FloatArray) -> FloatArray:
    """Part of its path that the wall has gone: to 1 in half a period, and back."""
    at = np.mod(t / (0.5 * PERIOD), 2.0)
    return np.asarray(np.minimum(at, 2.0 - at))


def _path(params: Mapping[str, Any], travel: FloatArray, *, mid: bool) -> FloatArray:
    """fs/ks [m] by the place on the path."""
    if params["kind"] == "pair":
        shear = np.full_like(travel, np.nan)
        known = np.isfinite(travel)  # a history without numbers shows which checks there are
        shear[known] = passing_shear(travel[known], ahead=AHEAD, aside=ASIDE)
        return shear
    amplitude = float(params["amplitude"])
    return turning_wall_shear(
        travel / amplitude, radius=RADIUS, overlap=SUNK, path=amplitude, angle=_angle(params), mid_overlap=mid
    )


def _place(params: Mapping[str, Any], engine: EngineInfo) -> SlipAt:
    """Where this engine measures slip: where the scene asks for it if it can, else where it can.

    Contact dynamics has a step's begin where it should have the end: an error of the same size and the other sign.
    """
    return params["slip_at"] if engine.contact == "cd" else slip_of(params["slip_at"], engine)


def _centres(params: Mapping[str, Any], count: int) -> FloatArray:
    """``x_j - x_i`` [m] of the pair at every step of central differences."""
    speed, dt = params["amplitude"] * FREQUENCY, PERIOD / count
    travel = oscillation_central(frequency=FREQUENCY, speed=speed, dt=dt, n_steps=count * int(params["cycles"]))
    return np.column_stack([AHEAD - travel, np.full_like(travel, ASIDE)])


def _stepped(params: Mapping[str, Any], count: int, place: str, *, mid: bool) -> FloatArray:
    """fs/ks [m] at every step."""
    if params["kind"] == "pair":
        return pair_shear(_centres(params, count), slip_at=place)
    return turning_wall_steps(
        radius=RADIUS, overlap=SUNK, path=params["amplitude"], angle=_angle(params), half=count // 2,
        cycles=params["cycles"], mid_overlap=mid, slip_at=place,
    )  # fmt: skip


def _turning_error(
    params: Mapping[str, Any], engine: EngineInfo, count: int, stepped: FloatArray
) -> tuple[float, float, str]:
    """What an engine's way of turning shear forces makes of fs/ks at most and what of that remains after the run [m], and its words.

    To first order a force changes by half the square of the rotation of each step, of its value then. Along fixed axes a wall's shear
    force gains fn times the rotation: up to the largest overlap times the angle, of which a sum of ends leaves ``dt phi' travel`` a cycle.
    """
    if params["kind"] == "wall" and Difference.FIXED_WALL_SHEAR in engine.differences:
        most = (SUNK + params["amplitude"]) * _angle(params)
        remains = 2.0 / count * params["cycles"] * params["amplitude"] * _angle(params)
        return most, remains, "; shear forces at walls along fixed axes gain fn times the rotation"
    if engine.turns_shear == "exactly" or LEVER_ARMS[params["arm"]] in engine.turns_exactly_with:
        return 0.0, 0.0, ""
    turn: float | FloatArray = 2.0 * _angle(params) / count
    if params["kind"] == "pair":
        d = _centres(params, count)
        turn = np.diff(np.arctan2(d[:, 1], d[:, 0]), prepend=math.atan2(ASIDE, AHEAD))
    grown = float(np.abs(np.cumsum(0.5 * np.square(turn) * stepped)).max())
    # The force that is turned is that of the step before: at most one rotation's difference, relative.
    grown += 2.0 / count * grown + 0.5 * float(np.square(turn).max() * np.abs(stepped).max())
    return grown, grown, "; shear forces turned to first order, by half the square of each step's rotation"


def _rounding(params: Mapping[str, Any], engine: EngineInfo, count: int) -> float:
    """[m]: each step adds a difference of coordinates; contact dynamics solves to 1e-9."""
    roundings = float(np.spacing(2.0 * RADIUS)) * (8.0 + params["cycles"] * count)
    return float(roundings) + (1e-9 * float(params["amplitude"]) if engine.contact == "cd" else 0.0)


def _midpoint(params: Mapping[str, Any], count: int) -> float:
    """Error [m] of the midpoint rule of a cycle's half: ``(travel of a step)^2/24`` times what the integrand's slope changes by.

    The slope of ``aside/|d|`` along the way is at most ``1/(2 |aside|)``, of either sign. On the wall the integrands by the part of the way
    are the amplitude times ``sin(angle s)`` and ``angle s cos(angle s)/2``: their slopes change by less than twice the angle's square.
    """
    if params["kind"] == "pair":
        step = 2.0 * math.pi / count * params["amplitude"]
        return float(step**2 / (24.0 * abs(ASIDE)))
    return float((2.0 * _angle(params) / count) ** 2 / 12.0 * params["amplitude"])


def _unfinished(params: Mapping[str, Any], count: int) -> float:
    """Part of `_midpoint` [m] that is left at the run's end, where the scheme's period is off by ``(w dt)^2/12`` of itself at most."""
    late = 2.0 * math.pi * params["cycles"] * (2.0 * math.pi / count) ** 2 / 12.0
    return _midpoint(params, count) * min(late, 1.0) if params["kind"] == "pair" else 0.0


CASE = RetracedLoop()
