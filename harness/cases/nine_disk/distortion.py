"""Nine disks, compressed, settled, then sheared at constant volume by turning the side walls (appendix A.1.2)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.law import LeverArm
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import WallSegment
from ninedisk.harness.api.capabilities import LEVER_ARMS
from ninedisk.harness.api.case import Check, Headline, Observed, Parameter, Setup, Value
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.cases.differences import checks_with_allowance
from ninedisk.harness.cases.matched import core_history, slip_of
from ninedisk.harness.cases.nine_disk.compression import outline_check
from ninedisk.harness.cases.nine_disk.converged import FirstOrder, Limit, consensus_checks, converged_checks
from ninedisk.harness.cases.nine_disk.figures import DISTORTION_CLAIMS, DISTORTION_FIGURES
from ninedisk.harness.cases.nine_disk.scene import (
    CENTRE,
    DAMPING_FORM,
    LEVER_ARM,
    LOAD_CASES,
    MASS,
    NINE_DISK_CD,
    RADIUS,
    SIDE,
    SLIP_AT,
    cd_settings,
    contact_laws,
    friction,
    nine_disks,
    shear_growth,
)
from ninedisk.harness.cases.nurbs.grains import SHAPE, as_disks, as_outlines, overlap_error
from ninedisk.references.analytic.assembly.compression import row_frequency, steady_force

COMPRESS, SETTLE, DISTORT = 4000, 1000, 500
"""Cycles of the three stages."""

RATE, XI = 0.0175, 3.0
"""Rotation rate of the side walls [rad/s] (per unit of time, clockwise) and global damping [1/s]."""

UP, RIGHT = (CENTRE, 7), (CENTRE, 5)

WALLS = ("mid-pivot", "mid-pivot-caps-translate", "corner-pivot-caps-translate")

READINGS: tuple[tuple[str, Value], ...] = (*((walls, "mu") for walls in WALLS), ("mid-pivot", 0.0))
"""Readings of the source in the matrix: motion of the walls, their friction."""

SLIPPING = 1.0 - 1e-9
"""A contact slips where |Fs| reaches this fraction of mu Fn: at the cap up to round-off."""


HISTORIES = ("fn_up", "fs_up", "fn_right", "fs_right")

NUMBERS = ("x_2_final", "y_2_final", "x_8_final", "y_8_final")
"""Coordinates: what a run decides are displacements, which are of the size of the walls' way."""

MATCHED = 1e-9
"""Of the largest force: agreement of two codes with the same conventions throughout."""

ARM_WORDS: Mapping[LeverArm, str] = {
    "radius": "R",
    "overlap": "R - overlap/2",
    "torque-overlap": "R - overlap/2 of the torque with R of the slip",
}


class Distortion:
    """Constant-volume distortion of the compressed assembly.

    The source leaves open where the side walls pivot, whether the caps move along, and whether walls are rough; each reading
    is a separate variant, with its own converged reference. No agreement with the curves of 1979 is claimed.
    """

    id = "nine-disk/distortion"
    version = 1
    title = "Nine disks, constant-volume distortion"
    source = "appendix A.1.2, Figures A.4 and A.5"
    requirement = "Forces at the centre disk follow the converged history; shear never exceeds mu times normal force."
    figures = DISTORTION_FIGURES
    claims = DISTORTION_CLAIMS
    parameters: tuple[Parameter, ...] = (
        Parameter(
            name="phi_deg",
            default=15.0,
            low=0.0,
            high=89.0,
            unit="deg",
            in_id=True,
            help="angle of friction between disks",
        ),
        Parameter(name="ks_over_kn", default=1.0, low=0.0, in_id=True, help="shear over normal contact stiffness"),
        Parameter(
            name="walls",
            default="mid-pivot",
            choices=WALLS,
            in_id=True,
            help="where the side walls pivot (mid-height or bottom corner) and whether the caps move with their ends",
        ),
        Parameter(
            name="wall_mu",
            default="mu",
            words=("mu",),
            low=0.0,
            in_id=True,
            help="friction of the walls; the word mu means the disks' own tan(phi)",
        ),
        Parameter(name="substeps", default=1, low=1, whole=True, help="contact steps in one cycle"),
        replace(LEVER_ARM, in_id=True),
        DAMPING_FORM,
        SLIP_AT,
        SHAPE,
        *NINE_DISK_CD,
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Four readings of the walls, two friction angles, two ratios; lever arms R, R - overlap/2 and LAMMPS'; a static one; outlines."""
        rows: list[Mapping[str, Value]] = [
            {"walls": walls, "wall_mu": wall_mu, "phi_deg": phi, "ks_over_kn": ratio, "lever_arm": arm}
            for arm in ("radius", "overlap")
            for walls, wall_mu in READINGS
            for phi in (15.0, 30.0)
            for ratio in (1.0, 2.0 / 3.0)
        ]
        rows += [
            {"phi_deg": phi, "ks_over_kn": ratio, "lever_arm": "torque-overlap-disks"}
            for phi in (15.0, 30.0)
            for ratio in (1.0, 2.0 / 3.0)
        ]
        return [*rows, {"walls": "mid-pivot", "wall_mu": 0.0, "regime": "quasi-static"}, {"shape": "nurbs"}]

    def build(self, params: Mapping[str, Any]) -> Setup:
        """Scene with three stages of wall motion."""
        load = LOAD_CASES["a1"]
        disk_law, wall_law = contact_laws(params, load.kn)
        scene = nine_disks(disk_law, wall_law, wall_motions(params["walls"]), XI)
        if params["shape"] == "nurbs":
            scene = as_outlines(scene)
        numerics = Numerics(
            dt=load.dt,
            n_steps=COMPRESS + SETTLE + DISTORT,
            contact_dt=load.dt / params["substeps"],
            sample_from=COMPRESS + SETTLE,
            damping_form=params["damping_form"],
            **cd_settings(params),
        )
        return Setup(scene=scene, numerics=numerics, watch=(UP, RIGHT), labels={"centre/up": UP, "centre/right": RIGHT})

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """Forces at the centre disk over distortion cycles 0..500; slip, cone, symmetry, deformed configuration."""
        shown = history.step >= COMPRESS + SETTLE
        step = history.step[shown] - (COMPRESS + SETTLE)
        t = history.t[shown] - (COMPRESS + SETTLE) * setup.numerics.dt
        mu, _ = friction(params)
        series, scalars, excess = {}, {}, -math.inf
        for name, pair in (("up", UP), ("right", RIGHT)):
            column = history.contact(pair)
            fn, fs = history.fn[shown, column], history.fs[shown, column]
            series[f"fn_{name}"] = ("N", fn)
            series[f"fs_{name}"] = ("N", fs)
            slipping = np.flatnonzero((fn > 0.0) & (np.abs(fs) >= SLIPPING * mu * fn))
            known = bool(np.isfinite(fn).all() and np.isfinite(fs).all())
            ratio = float(np.divide(np.abs(fs), fn, out=np.zeros_like(fs), where=fn > 0.0).max())
            first = float(step[slipping[0]]) if len(slipping) else math.inf
            scalars[f"first_slip_{name}"] = ("cycle", first if known else math.nan)
            scalars[f"plateau_ratio_{name}"] = ("1", ratio if known else math.nan)
            excess = max(excess, _relative(float((np.abs(fs) - mu * fn).max()), float(fn.max()))) if known else math.nan
        x = history.x[shown]
        scalars["cone_excess"] = ("1", max(excess, 0.0))
        scalars["symmetry_error"] = ("m", float(np.abs(0.5 * (x + x[:, ::-1, :]) - 0.5 * SIDE).max()))
        scalars["overlap_error"] = ("m", overlap_error(setup, history))
        for disk in (2, 8):
            scalars[f"x_{disk}_final"] = ("m", float(x[-1, disk, 0]))
            scalars[f"y_{disk}_final"] = ("m", float(x[-1, disk, 1]))
        return Observed(step=step, t=t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """Forces above the centre disk against the fine-step limit of the scene's own law; none is known for the static limit."""
        limit = None if params["regime"] == "quasi-static" else Limit.of(self.id, params, observed)
        load = LOAD_CASES["a1"]
        pressed = steady_force(kn=load.kn, v_wall=load.v_wall, t_wall=COMPRESS * load.dt)
        return tuple(
            Headline(name=words, use="moving-walls", quantity=name, expected=limit.series(name) if limit else math.nan,
                     source=limit.source if limit else "no converged reference", scale=pressed,
                     scale_is="normal force after the compression")
            for words, name in (("normal force in shear", "fn_up"), ("shear force", "fs_up"), ("shear force aside", "fs_right"))
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Converged histories, the friction cone, symmetry, and the in-house DEM for engines of its scheme."""
        return checks_with_allowance(
            Difference.FIXED_WALL_SHEAR,
            setup,
            engine,
            lambda setup, engine: distortion_checks(params, setup, observed, engine),
        )


def _relative(over: float, force: float) -> float:
    """Excess of the shear force over its cap [N], of the largest normal force; a contact without any bears none."""
    if force > 0.0:
        return over / force
    return math.inf if over > 0.0 else 0.0


def wall_motions(walls: str) -> dict[str, tuple[WallSegment, ...]]:
    """Motion of the four walls: in, rest, then the distortion.

    The side walls turn clockwise at `RATE` about a point of their moved inner face, at mid-height or at the lower corner. A
    cap that translates keeps up with the side walls' intersection with it, ``lever tan(RATE t)``, where ``lever`` is its height
    above the pivots: constant width at every height, hence constant volume.
    """
    load = LOAD_CASES["a1"]
    squeeze, rest, turn = COMPRESS * load.dt, SETTLE * load.dt, DISTORT * load.dt
    inset = load.v_wall * squeeze
    pivot_height = inset if walls.startswith("corner") else 0.5 * SIDE
    translate = walls.endswith("caps-translate")

    def stages(nx: float, ny: float, last: WallSegment) -> tuple[WallSegment, ...]:
        velocity = (load.v_wall * nx, load.v_wall * ny)
        return (WallSegment(duration=squeeze, velocity=velocity), WallSegment(duration=rest), last)

    def side(x: float) -> WallSegment:
        return WallSegment(duration=turn, angular_velocity=-RATE, pivot=(x, pivot_height))

    def cap(height: float) -> WallSegment:
        lever = height - pivot_height if translate else 0.0
        return WallSegment(duration=turn, tan_lever=(lever, 0.0), tan_rate=RATE if lever else 0.0)

    return {
        "left": stages(1.0, 0.0, side(inset)),
        "right": stages(-1.0, 0.0, side(SIDE - inset)),
        "bottom": stages(0.0, 1.0, cap(inset)),
        "top": stages(0.0, -1.0, cap(SIDE - inset)),
    }


def distortion_checks(
    params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
) -> Sequence[Check]:
    """Truths that bind ``engine`` on a variant of the distortion."""
    load = LOAD_CASES["a1"]
    arm_reason, arm_rtol = _other_arm(setup, engine)
    static = engine.contact == "cd" and params["regime"] == "quasi-static"
    found = (
        []
        if static
        else converged_checks(
            "nine-disk/distortion",
            params,
            observed,
            engine,
            series=HISTORIES,
            scalars=NUMBERS,
            first_order=_first_order(),
            other_arm=arm_reason,
            other_arm_rtol=arm_rtol,
            scales=dict.fromkeys(NUMBERS, load.v_wall * setup.scene.walls[0].motion[0].duration),
        )
    )
    found += _cone(params)
    if not arm_reason:
        found += _first_slip(params, engine)
    if params["walls"].startswith("mid-pivot"):
        found.append(
            Check(
                quantity="symmetry_error",
                norm="scalar",
                truth="analytic",
                expected=0.0,
                source="set-up and motion are their own image under a half turn about the centre",
                atol=1e-8 * RADIUS,
                why="round-off of positions (6e-14 m a step over 5500 steps, amplified where contacts slip) stays below 1e-8 radii",
                scale=RADIUS,
            )
        )
    outlined = params["shape"] == "nurbs"
    if outlined:
        found.append(outline_check())
    if engine.scheme == "central-difference" and (outlined or not engine.reference):
        history = core_history(as_disks(setup) if outlined else setup, engine)
        rows = np.searchsorted(history.step, observed.step + history.step[-1] - observed.step[-1])
        expected = {}
        for name, pair in (("up", setup.watch[0]), ("right", setup.watch[1])):
            expected[f"fn_{name}"] = history.fn[rows, history.contact(pair)]
            expected[f"fs_{name}"] = history.fs[rows, history.contact(pair)]
        growth = shear_growth(history, engine, setup.scene.disk_disk)
        if arm_reason:
            rtol, why = arm_rtol, arm_reason
        elif growth or not _even_walls(params):
            rtol, why = (
                1e-6,
                "same scheme; the slip's reference point and the tangent within a step differ, 1e-7 over the history",
            )
        else:
            rtol, why = (
                MATCHED,
                "same scheme, same arithmetic up to round-off: 1e-12 of a force a step, over 500 cycles",
            )
        if growth:
            why += f"; the engine turns shear forces to first order, which adds at most {growth:.1g}"
        found += consensus_checks(observed, expected, rtol=rtol + growth, why=why)
    return found


def _first_order() -> FirstOrder:
    """What a scheme of first order may make of the distortion.

    The walls' start gives neighbouring disks a relative speed of the distortion's rate times their distance, and so an oscillation of
    that over omega, which such a scheme may damp whole; what follows lags by a step's way at most.
    """
    load = LOAD_CASES["a1"]
    apart = 2.0 * RADIUS * RATE
    omega = row_frequency(kn=load.kn, mass=MASS)
    path = apart / omega + apart * load.dt
    return FirstOrder(
        force=load.kn * path,
        length=path,
        lag=0.5 * omega * load.dt,
        why="first-order scheme: the oscillation of neighbours from the walls' start, kn v/omega, and a lag of one step, kn v dt",
    )


def _even_walls(params: Mapping[str, Any]) -> bool:
    """Whether walls turn at a constant rate and do nothing else: an engine that sees mean velocities then sees the exact ones."""
    return not str(params["walls"]).endswith("caps-translate")


def _other_arm(setup: Setup, engine: EngineInfo) -> tuple[str, float]:
    """Reason and relative size of the difference that another lever arm makes; empty and 0 where the arms agree."""
    turning = [wall for wall in setup.scene.walls if wall.law.mu > 0.0 and any(s.angular_velocity for s in wall.motion)]
    if Difference.FIXED_WALL_SHEAR in engine.differences and turning:
        angle = sum(abs(segment.angular_velocity) * segment.duration for segment in turning[0].motion)
        return (
            "the engine keeps shear forces at walls along fixed axes: a turning wall adds fn times its rotation, up to "
            f"{angle:.3g} fn in all",
            angle,
        )
    asked = setup.scene.disk_disk.lever_arm
    if LEVER_ARMS[asked] in engine.capabilities:
        return "", 0.0
    has = [ARM_WORDS[arm] for arm, capability in LEVER_ARMS.items() if capability in engine.capabilities]
    load = LOAD_CASES["a1"]
    # The settled overlap of a contact is half a wall's displacement; the arms R and R - overlap/2 differ by overlap/(2R).
    overlap = 0.5 * setup.scene.walls[0].motion[0].duration * load.v_wall
    return (
        f"the scene asks for the lever arm {ARM_WORDS[asked]}, the engine has {' or '.join(has) or 'none'}: torque or slip by "
        "rotation, and with it shear, differs by overlap/(2R)",
        overlap / (2.0 * RADIUS),
    )


def _cone(params: Mapping[str, Any]) -> list[Check]:
    mu, _ = friction(params)
    source = "Coulomb: |Fs| <= mu Fn"
    return [
        Check(
            quantity="cone_excess",
            norm="scalar",
            truth="analytic",
            expected=0.0,
            source=source,
            atol=1e-14 * max(mu, 1.0),
            why="round-off of one product",
            scale=1.0,
        )
    ]


def _first_slip(params: Mapping[str, Any], engine: EngineInfo) -> list[Check]:
    """Cycle of the first slip and the plateau Fs/Fn = mu, where the converged reference slips."""
    from ninedisk.references.converged_tables import load_converged

    table = load_converged("nine-disk/distortion", params)
    if table is None or engine.scheme != "central-difference":
        return []
    mu, _ = friction(params)
    found = []
    for name in ("up", "right"):
        entry = table.scalars.get(f"first_slip_{name}")
        if entry is None:
            continue
        scheme = f"{params['damping_form']}_{slip_of(params['slip_at'], engine)}"
        measured = table.scalars[f"step_error_{scheme}_first_slip_{name}"].value
        found.append(
            Check(
                quantity=f"first_slip_{name}",
                norm="scalar",
                truth="converged",
                expected=entry.value,
                uncertainty=entry.uncertainty,
                source=table.method,
                atol=measured + entry.uncertainty + 1.0,
                why="difference between the tabulated and half the step, plus the cycle that sampling resolves",
            )
        )
        found.append(
            Check(
                quantity=f"plateau_ratio_{name}",
                norm="scalar",
                truth="analytic",
                expected=mu,
                source="a contact that slips has Fs = mu Fn",
                rtol=1e-9,
                why="round-off of the quotient; the contact slips in the converged reference",
            )
        )
    return found


CASE = Distortion()
