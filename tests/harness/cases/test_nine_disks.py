"""The nine-disk cases: conventions, converged tables, and defects that their checks must see."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from ninedisk.core.history import History
from ninedisk.core.scene.motion import compile_motion, wall_poses
from ninedisk.core.simulate import simulate
from ninedisk.harness.api.params import resolve
from ninedisk.harness.cases.nine_disk.compression import CASE as COMPRESSION
from ninedisk.harness.cases.nine_disk.distortion import CASE as DISTORTION
from ninedisk.harness.cases.nine_disk.distortion import COMPRESS, RATE, SETTLE, wall_motions
from ninedisk.harness.engines.cd.adapter import ENGINE as CD
from ninedisk.harness.engines.dem.adapter import ENGINE
from ninedisk.harness.engines.yade.adapter import ENGINE as YADE
from ninedisk.harness.run.judge import compare
from ninedisk.references.converged_tables import load_converged


def history_of(case: Any, **overrides: Any) -> tuple[dict[str, Any], Any, History]:
    """Complete parameters, set-up and history of a variant on the in-house DEM."""
    params = dict(resolve(case, overrides).params)
    setup = case.build(params)
    return params, setup, simulate(setup.scene, setup.numerics, setup.watch)


def failing(case: Any, params: dict[str, Any], setup: Any, history: History, engine: Any = ENGINE) -> set[str]:
    """``quantity:truth`` of every check that a history does not pass."""
    observed = case.observe(params, setup, history)
    found = set()
    for check in case.checks(params, setup, observed, engine.info()):
        measured = compare(check, observed)
        if not measured.abs_error <= measured.tolerance:
            found.add(f"{check.quantity}:{check.truth}")
    return found


@pytest.mark.parametrize("load_case", ["a1", "b2"])
def test_lever_arm_has_no_effect_on_the_compression(load_case: str) -> None:
    """Mirror symmetry keeps every spin at 0; what is left is round-off of positions near 300 m."""
    runs = [
        history_of(COMPRESSION, load_case=load_case, wall_mu="mu", lever_arm=arm)[2] for arm in ("radius", "overlap")
    ]
    assert np.abs(runs[0].fn - runs[1].fn).max() <= 1e-10 * runs[0].fn.max()
    assert np.abs(runs[0].omega).max() < 1e-9


@pytest.mark.parametrize(
    ("load_case", "edge", "centre", "corner", "middle"),
    [
        ("a1", 4.495, 4.718, 5.387, 5.164),
        ("a2", 4.390, 4.666, 5.492, 5.216),
        ("b1", 4.447, 4.695, 5.437, 5.190),
        ("b2", 4.380, 4.661, 5.504, 5.223),
    ],
)
def test_settled_forces_between_rough_walls(
    load_case: str, edge: float, centre: float, corner: float, middle: float
) -> None:
    """Four printed digits of an independent simulation, in 1e7 N; the sum over a row is that of smooth walls."""
    history = history_of(COMPRESSION, load_case=load_case, wall_mu="mu")[2]
    found = history.fn[-1] / 1e7
    assert found == pytest.approx([centre, edge, middle, corner], abs=6e-4)
    settled = 4.941e7 if load_case[0] == "a" else 4.94208e7
    assert (history.fn[-1, 0] + history.fn[-1, 2]) / 2.0 == pytest.approx(settled, rel=1e-8)


@pytest.mark.parametrize(
    ("walls", "wall_mu", "phi", "expected"),
    [
        ("mid-pivot", "mu", 15, [(4.647, 0), (4.853, 0.769), (5.202, 1.329), (4.797, 1.285)]),
        ("mid-pivot", "mu", 30, [(4.239, 0), (4.410, 0.653), (4.722, 1.613), (5.279, 3.048)]),
        ("mid-pivot", 0.0, 15, [(4.941, 0), (4.931, 0.947), (4.829, 1.294), (4.367, 1.170)]),
        ("mid-pivot", 0.0, 30, [(4.941, 0), (4.931, 0.947), (4.875, 2.369), (4.486, 2.590)]),
    ],
)
def test_distortion_with_pivots_at_mid_height(
    walls: str, wall_mu: Any, phi: float, expected: list[tuple[float, float]]
) -> None:
    """Forces in 1e9 N at cycles 0, 100, 250, 500, to the four printed digits of an independent simulation.

    That one measures slip with the normal of the step's end, as Cundall & Strack do: an error of first order, at these steps up to 3.3e-4
    of that unit, which is more than half of the last printed digit leaves room for.
    """
    history = history_of(DISTORTION, walls=walls, wall_mu=wall_mu, phi_deg=phi, slip_at="end")[2]
    rows = np.searchsorted(history.step, COMPRESS + SETTLE + np.array([0, 100, 250, 500]))
    found = np.column_stack([history.fn[rows, 0], np.abs(history.fs[rows, 0])]) / 1e9
    assert found == pytest.approx(np.array(expected, dtype=float), abs=6e-4)


@pytest.mark.parametrize("walls", ["mid-pivot-caps-translate", "corner-pivot-caps-translate"])
def test_caps_keep_up_with_the_side_walls(walls: str) -> None:
    """The point of a cap that met a side wall when the distortion began meets it ever after; the width stays the same."""
    setup = DISTORTION.build(resolve(DISTORTION, {"walls": walls}).params)
    motion, dt = compile_motion(setup.scene.walls), setup.numerics.dt
    start = wall_poses(motion, (COMPRESS + SETTLE) * dt)
    corner = np.array([start[0, 0], start[3, 1]])
    for cycle in (1, 250, 499):
        left, right, _, top = wall_poses(motion, (COMPRESS + SETTLE + cycle) * dt)
        moved = corner + (top[0:2] - start[3, 0:2])
        assert abs((moved - left[0:2]) @ left[2:4]) < 1e-10
        width = (right[0:2] - left[0:2]) @ left[2:4] / left[2]
        assert width == pytest.approx(300.0 - 2 * start[0, 0], abs=1e-9)
        assert np.arctan2(left[3], left[2]) == pytest.approx(-RATE * cycle * dt, abs=1e-12)
    assert wall_motions("mid-pivot")["top"][2].tan_rate == 0.0


@pytest.mark.parametrize("number", [8, 21, 31])
def test_converged_table_is_the_limit(number: int) -> None:
    """A coarser refinement lies as far from the table as second order and its uncertainty allow; the orders are seen."""
    variant = resolve(DISTORTION, DISTORTION.matrix()[number])
    table = load_converged(DISTORTION.id, variant.params)
    assert table is not None
    errors = []
    for substeps in (1, 2, 4):
        params = {**variant.params, "substeps": substeps}
        setup = DISTORTION.build(params)
        observed = DISTORTION.observe(params, setup, simulate(setup.scene, setup.numerics, setup.watch))
        errors.append(
            {
                name: np.abs(observed.series[name][1][table.step] - table.quantities[name]).max()
                for name in table.quantities
            }
        )
    for name in ("fs_up", "fs_right"):
        orders = np.log2([errors[k][name] / errors[k + 1][name] for k in (0, 1)])
        assert orders == pytest.approx([2.0, 2.0], abs=0.35)
        assert table.uncertainty[name] < 0.02 * errors[0][name]


DEFECTS: dict[str, Callable[[History], History]] = {
    "one cycle late": lambda h: dataclasses.replace(
        h, fn=np.vstack([h.fn[:1], h.fn[:-1]]), fs=np.vstack([h.fs[:1], h.fs[:-1]])
    ),
    "force 1e-3 too large": lambda h: dataclasses.replace(h, fn=h.fn * 1.001),
    "not a number": lambda h: dataclasses.replace(h, fn=np.where(h.step[:, None] == h.step[-1], np.nan, h.fn)),
    "one disk off": lambda h: dataclasses.replace(h, x=h.x + 1e-3 * (np.arange(9) == 3)[None, :, None]),
}


@pytest.mark.parametrize(
    ("case", "wall_mu", "defect"),
    [
        pytest.param(case, wall_mu, defect, id=f"{case.id}-{wall_mu}-{defect}")
        for case in (COMPRESSION, DISTORTION)
        for wall_mu in (0.0, "mu")
        for defect in DEFECTS
    ],
)
def test_defects_are_seen(case: Any, wall_mu: Any, defect: str) -> None:
    params, setup, history = history_of(case, wall_mu=wall_mu)
    assert failing(case, params, setup, history) == set()
    assert failing(case, params, setup, DEFECTS[defect](history))


@pytest.mark.parametrize("case", [COMPRESSION, DISTORTION], ids=lambda case: case.id)
def test_cross_checks_see_small_differences(case: Any) -> None:
    """An engine of the same scheme and conventions is held against the in-house DEM far below the step's own error."""
    params, setup, history = history_of(case, wall_mu="mu", lever_arm="overlap", slip_at="end")
    assert failing(case, params, setup, history, YADE) == set()
    middle = history_of(case, wall_mu="mu", lever_arm="overlap")[2]
    assert any(name.endswith(":consensus") for name in failing(case, params, setup, middle, YADE)), "not YADE's slip"
    wrong = dataclasses.replace(history, fn=history.fn * (1.0 + 1e-4))
    assert any(name.endswith(":consensus") for name in failing(case, params, setup, wrong, YADE))


@pytest.mark.long
def test_half_rows_bear_their_wall_s_path_whoever_shares_it() -> None:
    """Between rough walls, moving or in the static limit, the sums see what the step's own error hides in each force."""
    for engine, regime in ((ENGINE, "dynamic"), (CD, "quasi-static")):
        params = dict(resolve(COMPRESSION, {"wall_mu": "mu", "regime": regime, "settle_cycles": 400}).params)
        setup = COMPRESSION.build(params)
        history = engine.run(setup.scene, setup.numerics, setup.watch).history
        assert failing(COMPRESSION, params, setup, history, engine) == set()
        scalars = COMPRESSION.observe(params, setup, history).scalars
        assert scalars["row_sum_centre"][1] == pytest.approx(1.35e9 * 0.12 * 40 * 0.01525, rel=1e-9)
        assert scalars["fn_wall_mid_settled"][1] > 1.02 * scalars["fn_disk_disk_centre_settled"][1]
        for column, row in ((0, "centre"), (3, "edge")):
            wrong = dataclasses.replace(history, fn=history.fn * np.where(np.arange(4) == column, 1.0 + 1e-3, 1.0))
            assert f"row_sum_{row}:analytic" in failing(COMPRESSION, params, setup, wrong, engine)


def test_shear_beyond_the_cone_is_seen() -> None:
    params, setup, history = history_of(DISTORTION, wall_mu=0.0)
    wrong = dataclasses.replace(history, fs=history.fs * (1.0 + 1e-9))
    assert "cone_excess:analytic" in failing(DISTORTION, params, setup, wrong)


def test_no_bound_of_an_amplitude_exceeds_it(scheme_info: Callable[..., Any]) -> None:
    """Such a check could not fail; first-order schemes run on steps for which theirs does."""
    params, setup, history = history_of(COMPRESSION, xi=0.0)
    observed = COMPRESSION.observe(params, setup, history)
    found = {}
    for engine in (ENGINE.info(), CD.info(), scheme_info("semi-implicit-euler", "spring")):
        checks = COMPRESSION.checks(params, setup, observed, engine)
        found[engine.id] = [c for c in checks if c.quantity.endswith("_amplitude") and c.truth == "analytic"]
        assert all(check.atol < check.expected for check in found[engine.id])
    assert len(found["dem"]) == 4
    assert found["cd"] == []


def test_final_coordinates_are_judged_by_the_walls_path_not_by_the_origin() -> None:
    params, setup, history = history_of(DISTORTION)
    off = dataclasses.replace(history, x=history.x + 1.5)
    final = {f"{axis}_{disk}_final:converged" for axis in "xy" for disk in (2, 8)}
    assert not final & failing(DISTORTION, params, setup, history, CD)
    assert final <= failing(DISTORTION, params, setup, off, CD)


@pytest.mark.filterwarnings("error")
def test_contacts_without_any_force_are_within_the_cone_unless_they_shear() -> None:
    params, setup, history = history_of(DISTORTION)
    history = dataclasses.replace(history, fn=np.zeros_like(history.fn), fs=np.zeros_like(history.fs))
    assert DISTORTION.observe(params, setup, history).scalars["cone_excess"][1] == 0.0
    history.fs[-1] = 1.0
    assert DISTORTION.observe(params, setup, history).scalars["cone_excess"][1] == np.inf
