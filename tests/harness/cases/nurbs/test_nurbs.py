"""Cases of grains with outlines: the DEM meets their truths, and defects are seen."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ninedisk.core.history import History
from ninedisk.core.nurbs.shapes import disk
from ninedisk.core.scene import Scene
from ninedisk.harness.api.case import Case
from ninedisk.harness.api.params import resolve
from ninedisk.harness.cases.nine_disk.compression import CASE as COMPRESSION
from ninedisk.harness.cases.nine_disk.distortion import CASE as DISTORTION
from ninedisk.harness.cases.nurbs.collision import CASE as COLLISION
from ninedisk.harness.cases.nurbs.overlap import CASE as OVERLAP
from ninedisk.harness.cases.nurbs.overlap import expected_gaps
from ninedisk.harness.cases.nurbs.settle import CASE as SETTLE
from ninedisk.harness.engines.dem.adapter import ENGINE
from ninedisk.harness.run.judge import blank_history

Judge = Callable[..., Any]
QUICK: Mapping[str, Any] = {"shape": "nurbs", "cycles": 100, "settle_cycles": 400}


def quantities(cell: Any, truth: str) -> set[str]:
    """Quantities whose check against this truth fails."""
    return {text.split(" (")[0] for text in cell.failures if f"({truth})" in text}


def spoilt(judge: Judge, case: Case, params: Mapping[str, Any], change: Callable[[Scene], Scene]) -> Any:
    """The case's verdict on a run of another scene than it asks for."""
    setup = case.build(resolve(case, params).params)
    history = ENGINE.run(change(setup.scene), setup.numerics, setup.watch).history
    return judge(case, ENGINE.info(), params, history, setup)


def smaller(scene: Scene) -> Scene:
    """Outlines that are too small by a millionth of a millionth of their radius, ten times over."""
    return scene.replace(outlines=tuple(disk(float(curve.points[0, 0]) * (1.0 - 1e-11)) for curve in scene.outlines))


@pytest.mark.parametrize(
    ("case", "params"),
    [(COMPRESSION, QUICK), (COMPRESSION, {**QUICK, "wall_mu": "mu"}), (DISTORTION, {"shape": "nurbs"})],
    ids=["smooth", "rough", "distortion"],
)
def test_nine_disks_given_as_outlines(run_cell: Judge, case: Case, params: Mapping[str, Any]) -> None:
    """The disks' truths, and the disks' own run to round-off: three orders below what is allowed."""
    cell = run_cell(case, ENGINE, params)
    assert (cell.setup.scene.disks.outline == 0).all()
    assert cell.failures == []
    matched = [check for check in cell.checks if check.truth == "consensus"]
    assert len(matched) == 4
    assert all(cell.margin(check.quantity, "consensus") < 1e-2 for check in matched)
    assert cell.margin("overlap_error", "analytic") < 1e-2
    assert abs(cell.observed.scalars["overlap_error"][1]) > 0.0


def test_defects_of_the_nine_disks_are_seen(run_cell: Judge, judge_history: Judge) -> None:
    """Forces off by 2e-9, outlines smaller by 1e-11, and an overlap that is not the disks'."""
    forces = ("fn_disk_disk_centre", "fn_disk_disk_edge", "fn_wall_mid", "fn_wall_corner")

    def more(history: History) -> None:
        history.fn[:] *= 1.0 + 2e-9

    assert set(forces) <= quantities(run_cell(COMPRESSION, ENGINE, QUICK, more), "consensus")
    cell = spoilt(judge_history, COMPRESSION, QUICK, smaller)
    assert "overlap_error" in quantities(cell, "analytic")

    def deeper(history: History) -> None:
        history.gap[-1, 0] -= 1e-10

    assert quantities(run_cell(COMPRESSION, ENGINE, QUICK, deeper), "analytic") == {"overlap_error"}


def test_disks_are_not_held_against_themselves(run_cell: Judge) -> None:
    cell = run_cell(COMPRESSION, ENGINE, {**QUICK, "shape": "disk"})
    assert cell.failures == []
    assert not {check.quantity for check in cell.checks if check.truth == "consensus"}
    assert np.isfinite(cell.observed.scalars["overlap_error"][1])


def test_overlaps_off_by_round_off_times_a_hundred_are_seen(run_cell: Judge, judge_history: Judge) -> None:
    """Of a single pair of each grade, and of all of them by outlines that are too small, or turned by another angle."""
    few = {"pairs": 12}
    for shape in ("disk", "ellipse"):
        run = run_cell(OVERLAP, ENGINE, {"shape": shape, **few})
        assert run.failures == []
        gap, fn = run.history.gap[-1].copy(), run.history.fn.copy()

        def found(cell: Any = run) -> set[str]:
            return quantities(judge_history(OVERLAP, ENGINE.info(), cell.params, cell.history, cell.setup), "analytic")

        for column, grade in enumerate(("grazing", "shallow", "deep")):
            run.history.gap[-1, column] -= 1e-12
            assert found() == {"gap_error", f"gap_error_{grade}"}
            run.history.gap[-1] = gap
        run.history.fn[:] = fn * (1.0 + 1e-9)
        assert found() == {"fn_error"}
    assert "gap_error_grazing" in quantities(spoilt(judge_history, OVERLAP, few, smaller), "analytic")

    def turned(scene: Scene) -> Scene:
        return scene.replace(disks=replace(scene.disks, angle=scene.disks.angle + 1e-6))

    assert spoilt(judge_history, OVERLAP, {"shape": "disk", **few}, turned).failures == []
    assert "gap_error" in quantities(spoilt(judge_history, OVERLAP, {"shape": "ellipse", **few}, turned), "analytic")


def test_what_the_chord_s_force_loses_is_the_law_s_and_proportional_to_the_overlap(run_cell: Judge) -> None:
    """Independent of the step, of order 1 in the overlap, off its leading order by order 2; the area law's falls with the step squared."""

    def change(**params: Any) -> tuple[float, float]:
        scalars = run_cell(COLLISION, ENGINE, params).observed.scalars
        return scalars["energy_change"][1], scalars["overlap_over_size"][1]

    soft, deep = change(contact="chord")
    stiff, shallow = change(contact="chord", kn=3.2e4)
    assert change(contact="chord", phase=0.0075)[0] == pytest.approx(soft, rel=0.02)
    assert np.log(soft / stiff) / np.log(deep / shallow) == pytest.approx(1.0, abs=0.2)
    rest = []
    for kn in (500.0, 2e3, 8e3):
        cell = run_cell(COLLISION, ENGINE, {"kn": kn, "phase": 0.0075})
        truth = next(check.expected for check in cell.checks if check.quantity == "energy_change")
        rest.append(cell.observed.scalars["energy_change"][1] - truth)
    assert np.log2(np.array(rest[:-1]) / np.array(rest[1:])) == pytest.approx(2.0, abs=0.2)
    coarse, fine = (abs(change(contact="area", phase=phase)[0]) for phase in (0.12, 0.015))
    assert np.log2(coarse / fine) / 3.0 == pytest.approx(2.0, abs=0.35)
    assert abs(soft) > 30.0 * fine


def test_defects_of_collisions_are_seen(run_cell: Judge, judge_history: Judge) -> None:
    """A force on one body only, a wrong inertia, the chord's force for the area's, energy from nowhere."""

    def pushed(history: History) -> None:
        history.v[-1, 0] += 1e-9

    assert "momentum_drift" in quantities(run_cell(COLLISION, ENGINE, {}, pushed), "analytic")

    def spun(history: History) -> None:
        history.omega[-1, 0] += 1e-9

    assert quantities(run_cell(COLLISION, ENGINE, {}, spun), "analytic") == {"angular_momentum_drift"}

    def heavier(scene: Scene) -> Scene:
        return scene.replace(disks=replace(scene.disks, inertia=1.01 * scene.disks.inertia))

    assert "angular_momentum_drift" in quantities(spoilt(judge_history, COLLISION, {}, heavier), "analytic")

    def chords(scene: Scene) -> Scene:
        return scene.replace(disk_disk=replace(scene.disk_disk, contact="chord"))

    changed = {"energy_change", "energy_total"}
    assert quantities(spoilt(judge_history, COLLISION, {"contact": "area"}, chords), "analytic") == changed

    def areas(scene: Scene) -> Scene:
        return scene.replace(disk_disk=replace(scene.disk_disk, contact="area"))

    def weak_dashpot(scene: Scene) -> Scene:
        return scene.replace(disk_disk=replace(scene.disk_disk, beta=1e-3))

    for change in (areas, weak_dashpot):
        assert quantities(spoilt(judge_history, COLLISION, {}, change), "analytic") == {"energy_change"}

    def arms(scene: Scene) -> Scene:
        return scene.replace(disk_disk=replace(scene.disk_disk, lever_arm="torque-overlap"))

    def dashpot(scene: Scene) -> Scene:
        return scene.replace(disk_disk=replace(scene.disk_disk, beta=0.1))

    assert quantities(spoilt(judge_history, COLLISION, {}, dashpot), "analytic") == {"energy_change"}
    # Arms that only differ between torque and slip keep angular momentum: the check is of the torque's balance.
    assert spoilt(judge_history, COLLISION, {"mu": 0.5}, arms).failures == []

    def radius(scene: Scene) -> Scene:
        return scene.replace(disk_disk=replace(scene.disk_disk, lever_arm="radius"))

    assert quantities(spoilt(judge_history, COLLISION, {"mu": 0.5}, radius), "analytic") == {"angular_momentum_drift"}


@pytest.mark.parametrize("slope", [0.0, 0.25])
def test_defects_of_the_grain_at_rest_are_seen(judge_history: Judge, slope: float) -> None:
    """No dashpot, another weight, no friction, another stiffness, circles for the outline."""

    def law(**changes: Any) -> Callable[[Scene], Scene]:
        def change(scene: Scene) -> Scene:
            walls = tuple(replace(wall, law=replace(wall.law, **changes)) for wall in scene.walls)
            return scene.replace(walls=walls)

        return change

    def found(change: Callable[[Scene], Scene]) -> set[str]:
        return quantities(spoilt(judge_history, SETTLE, {"slope": slope}, change), "analytic")

    def round_(scene: Scene) -> Scene:
        return scene.replace(disks=replace(scene.disks, outline=np.array([-1]), x=scene.disks.x + 1.0), outlines=())

    assert {"kinetic_settled", "way_settled"} <= found(law(beta=0.0))
    assert "fn_final" in found(lambda scene: scene.replace(gravity=(scene.gravity[0], 1.001 * scene.gravity[1])))
    assert found(round_)
    if slope:
        assert {"fs_final", "kinetic_settled"} <= found(law(mu=0.1))
    else:
        assert found(law(kn=1.01 * 2e4)) == {"y_final"}


def test_ellipses_that_are_apart_have_no_overlap_and_one_inside_another_has_no_truth() -> None:
    """Places of single precision part grains that graze: an engine that reports an overlap then is wrong by that."""
    params = resolve(OVERLAP, {"shape": "ellipse"}).params
    setup = OVERLAP.build(params)
    blank = blank_history(setup)
    x = np.repeat(setup.scene.disks.x[None], len(blank.t), axis=0)
    (one, two), (outer, inner) = setup.watch[:2]
    x[:, two] += 0.5 * (x[:, two] - x[:, one])
    x[:, inner] = x[:, outer]
    for gap, truth in ((0.2, 0.2), (-0.2, 0.0)):
        history = replace(blank, x=x, gap=np.full_like(blank.gap, gap))
        found = expected_gaps(params, setup, history)
        assert found[-1, 0] == truth
        assert math.isnan(found[-1, 1])
