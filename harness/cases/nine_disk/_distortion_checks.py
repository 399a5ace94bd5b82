"""Truths of the nine-disk distortion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ninedisk.core.law import LeverArm
from ninedisk.harness.api.capabilities import LEVER_ARMS
from ninedisk.harness.api.case import Check, Observed, Setup
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.nine_disk._compression_checks import outline_check
from ninedisk.harness.cases.nine_disk.converged import consensus_checks, converged_checks
from ninedisk.harness.cases.nine_disk.scene import LOAD_CASES, MASS, RADIUS, friction, shear_growth
from ninedisk.harness.cases.nurbs.grains import as_disks
from ninedisk.harness.run.matched import core_history, slip_of
from ninedisk.references.analytic.compression import row_frequency

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
            first_order_rtol=0.5 * row_frequency(kn=load.kn, mass=MASS) * load.dt,
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
            )
        )
    outlined = params["shape"] == "nurbs"
    if outlined:
        found.append(outline_check())
    if engine.scheme == "central-difference" and (outlined or engine.id != "dem"):
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


def _even_walls(params: Mapping[str, Any]) -> bool:
    """Whether walls turn at a constant rate and do nothing else: an engine that sees mean velocities then sees the exact ones."""
    return not str(params["walls"]).endswith("caps-translate")


def _other_arm(setup: Setup, engine: EngineInfo) -> tuple[str, float]:
    """Reason and relative size of the difference that another lever arm makes; empty and 0 where the arms agree."""
    turning = [wall for wall in setup.scene.walls if wall.law.mu > 0.0 and any(s.angular_velocity for s in wall.motion)]
    if engine.fixed_wall_shear and turning:
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
