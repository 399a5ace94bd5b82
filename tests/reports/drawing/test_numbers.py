"""What the pages compute or pack themselves: data files, force chains, orders, points, pictures' paths."""

from __future__ import annotations

import itertools
import json
import math
import re
import subprocess
import sys

import numpy as np
import pytest

from ninedisk.harness.api.registry import get_case
from ninedisk.harness.results.figures import figures_to_text
from ninedisk.reports.drawing import draw as svg
from ninedisk.reports.drawing.charts import engine_looks, spread
from ninedisk.reports.drawing.figures import case_speed, convergences, engine_speed, looks_of, values_against_step
from ninedisk.reports.drawing.scenes import (
    Arrays,
    Springs,
    contact_forces,
    ends,
    moving_scenes,
    pack_case,
    springs,
    unpack,
)
from ninedisk.reports.pages import errata
from ninedisk.reports.panel.load import load_store
from ninedisk.reports.panel.model import build_panel


@pytest.fixture(scope="module")
def panel(panel_store):
    return build_panel(load_store(panel_store))


def test_data_file_holds_every_sample_exactly(panel):
    case = panel.cases["nine-disk/compression"]
    head, arrays = unpack(pack_case(panel, case, looks_of(panel, case), Arrays(), {}))
    stored = {key[1:]: curve for key, curve in panel.stored.series.items() if key[0] == case.id}
    assert len(head["curves"]) == len(stored)
    for variant, engine, quantity, step, t, value, expected, truth, tolerance in head["curves"]:
        curve = stored[head["variants"][variant], head["engines"][engine]["id"], quantity]
        for number, column in ((step, curve.step), (t, curve.t), (value, curve.value), (expected, curve.expected)):
            assert np.array_equal(arrays[number], column, equal_nan=True)
        assert truth == "analytic"
        assert tolerance > 0.0
    assert len({row[3] for row in head["curves"]}) == 1  # all engines share one array of steps
    assert len(head["references"]) == len(case.variants) * 4


def test_equal_arrays_are_held_once():
    arrays = Arrays()
    assert [arrays([1.0, 2.0]), arrays([1.0, 3.0]), arrays(np.array([[1.0], [2.0]]))] == [0, 1, 0]
    assert arrays.lengths == [2, 2]


def row_of_disks():
    """Three disks of radius 1 between two walls: overlaps 0.1 and 0.2, at the walls 0.3 and none."""
    x = np.array([[[0.0, 0.0], [1.9, 0.0], [3.7, 0.0]]])
    points, angles = np.array([[[-0.7, 0.0], [5.0, 0.0]]]), np.array([[0.0, math.pi]])
    return Springs(np.ones(3), 10.0, np.array([100.0, 50.0])), x, points, angles


def test_chains_are_stiffness_times_overlap():
    held, x, points, angles = row_of_disks()
    pairs, forces = contact_forces(held, x, points, angles)
    assert dict(zip(pairs, forces[0], strict=True)) == pytest.approx({(0, 1): 1.0, (1, 2): 2.0, (0, 3): 30.0})
    assert ends((0, 3), x[0], points[0], angles[0]) == pytest.approx(np.array([[0.0, 0.0], [-0.7, 0.0]]))
    assert ends((1, 2), x[0], points[0], angles[0]) == pytest.approx(x[0, 1:])


def test_no_chains_without_plain_springs():
    law = {"kn": 10.0, "beta": 0.0, "restitution": None}
    scene = {"disks": {"x": [[0.0, 0.0]], "radius": [1.0]}, "disk_disk": law, "walls": [{"law": law}]}
    assert springs({"scene": scene}) is not None
    for change in ({"beta": 0.5}, {"restitution": 1.0}, {"kn": None}):
        assert springs({"scene": {**scene, "walls": [{"law": law | change}]}}) is None
    assert springs({"scene": None}) is None


def test_only_what_moves_is_played(panel):
    arrays = Arrays()
    scenes = moving_scenes(panel.cases["nine-disk/distortion"], arrays)
    assert scenes
    for scene in scenes.values():
        assert set(scene["engines"]) <= {"dem", "yade", "box2d", "lammps"}
        assert arrays.lengths[scene["radius"]] == 9
        for held in scene["engines"].values():
            assert arrays.lengths[held["x"]] == 3 * 9 * 2
            assert arrays.lengths[held["forces"]] == 3 * len(held["pairs"])
    assert moving_scenes(panel.cases["incline-block"], Arrays()) == {}


def steps_table(small, errors, *, quantity="x", norm="max", truth="analytic", value=0.0):
    """Tables of one engine at the step sizes 0.01 and its halves, with planted errors."""
    tables = small()
    cells, rows = tables["cells"], tables["measurements"]
    tables["cells"], tables["measurements"] = [], []
    for k, error in enumerate(errors):
        params = {"dt": 0.01 / 2**k, "mu": 0.36}
        names = {"variant": f"dt={params['dt']}", "params": json.dumps(params)}
        tables["cells"].append({**cells[0], **names, "advance_s": 0.1 * 2**k})
        about = {"quantity": quantity, "norm": norm, "truth": truth, "abs_error": error, "value": value}
        tables["measurements"].append({**rows[0], **names, **about})
    return tables


@pytest.mark.parametrize(("order", "size"), [(1.0, 1e-3), (2.0, 1e-4), (0.0, 1e-2)])
def test_fitted_order_is_that_of_the_errors(tmp_path, write, small, order, size):
    write(tmp_path, "a", steps_table(small, [size / 2 ** (order * k) for k in range(3)]))
    case = build_panel(load_store(tmp_path)).cases["demo/one"]
    (found,) = convergences(case, engine_looks({"dem": "DEM"}))
    assert (found.quantity, found.step, found.heading) == ("x", "dt", "")
    assert found.order_of("dem").order == pytest.approx(order, abs=1e-9)
    assert [step for step, _ in found.order_of("dem").errors] == [0.0025, 0.005, 0.01]


def test_round_off_has_no_order(tmp_path, write, small):
    write(tmp_path, "a", steps_table(small, [3e-15, 1e-15, 2e-15]))
    case = build_panel(load_store(tmp_path)).cases["demo/one"]
    (found,) = convergences(case, engine_looks({"dem": "DEM"}))
    assert math.isnan(found.order_of("dem").order)
    assert found.chart is None


def test_step_errors_against_the_scheme_itself_are_no_convergence(tmp_path, write, small):
    write(tmp_path, "a", steps_table(small, [1e-3, 5e-4], truth="exact-step"))
    assert convergences(build_panel(load_store(tmp_path)).cases["demo/one"], engine_looks({"dem": "DEM"})) == []


def test_dilation_is_shown_beside_the_levels_of_both_rules(tmp_path, write, small):
    tables = steps_table(small, [0.0, 0.0, 0.0], quantity="dilation", norm="scalar", value=1.0)
    declared = get_case("incline-block").figures
    for cell in tables["cells"]:
        cell["case_figures"] = figures_to_text(declared)
    write(tmp_path, "a", tables)
    ((plan, (chart,)),) = values_against_step(
        build_panel(load_store(tmp_path)).cases["demo/one"], engine_looks({"dem": "DEM"})
    )
    assert plan == declared[-1]
    assert [level for _, _, (level, _) in chart.guides] == [1.0, 0.0]
    assert chart.dots[0].y == (1.0, 1.0, 1.0)
    assert chart.y_limits[0] < 0.0 < 1.0 < chart.y_limits[1]


def test_speed_needs_a_time_and_the_number_of_a_headline(tmp_path, write, small):
    tables = steps_table(small, [1e-3, 5e-4, 2e-4])
    tables["cells"][1]["advance_s"] = math.nan
    named = [{k: row[k] for k in ("case", "case_version", "variant", "engine")} for row in tables["cells"]]
    tables["headlines"] = [
        {**name, "headline": "way", "rel_error": error}
        for name, error in zip(named, (1e-3, 5e-4, math.nan), strict=True)
    ]
    write(tmp_path, "a", tables)
    panel = build_panel(load_store(tmp_path))
    chart = case_speed(panel.cases["demo/one"], engine_looks({"dem": "DEM"}))
    assert [(d.key, d.x, d.y, d.names) for d in chart.dots] == [("dem", (0.1,), (1e-3,), ("dt=0.01",))]
    assert [d.key for d in engine_speed(panel, "dem").dots] == ["case demo/one"]
    assert engine_speed(panel, "nobody") is None


def test_points_at_one_place_can_be_distinguished():
    made = spread([(1.0, 5.0, "a"), (1.0, 6.0, "b"), (2.0, 1.0, "c")])
    assert len({x for x, _, _ in made}) == 3
    assert max(abs(x - round(x)) for x, _, _ in made) < 1e-5


def test_errata_name_numbers_that_a_better_truth_contradicts(tmp_path, write, small):
    tables = small(case="incline-block", quantity="fn_final", norm="scalar", expected=73.8, value=73.8, status="pass")
    stated = {"truth": "published", "expected": 78.54, "status": "known-gap", "uncertainty": 0.005}
    tables["measurements"].append({**tables["measurements"][0], **stated})
    claim = {"claim": "c", "case": "incline-block", "verdict": "contradicted", "evidence": "e", "derivation": '["why"]'}
    tables["claims"] = [{**claim, "engine": "dem"}, {**claim, "engine": "other"}]
    write(tmp_path, "a", tables)
    (found,) = errata(build_panel(load_store(tmp_path)))
    assert found.everywhere
    assert found.contradicted == {"e": ["DEM", "other"]}
    assert found.derivation == ("why",)
    (statement,) = found.statements
    assert (statement.stated, statement.follows, statement.middle) == (78.54, 73.8, 73.8)


def test_a_claim_that_some_engine_confirms_is_no_erratum_of_the_source(tmp_path, write, small):
    tables = small()
    claim = {"claim": "c", "case": "demo/one", "evidence": "e"}
    tables["claims"] = [
        {**claim, "engine": "dem", "verdict": "contradicted"},
        {**claim, "engine": "yade", "verdict": "confirmed"},
    ]
    write(tmp_path, "a", tables)
    (found,) = errata(build_panel(load_store(tmp_path)))
    assert not found.everywhere
    assert found.confirmed == ["yade"]


def test_left_out_points_lie_on_the_line_that_stays():
    random = np.random.default_rng(1)
    x = np.arange(0, 2000, 10)
    for y in (0.5 * x, 300 * np.sin(x / 200), random.uniform(0, 500, len(x)), np.where(x > 900, 400, 0)):
        points = [(int(a), round(b)) for a, b in zip(x, y, strict=True)]
        kept = svg._corners(points)
        assert kept[0] == points[0]
        assert kept[-1] == points[-1]
        for px, py in points:
            near = [
                abs((bx - ax) * (ay - py) - (ax - px) * (by - ay)) / math.hypot(bx - ax, by - ay)
                for (ax, ay), (bx, by) in itertools.pairwise(kept)
                if ax <= px <= bx
            ]
            assert min(near) <= svg.STRAIGHT + 1e-9
    assert len(svg._corners([(k, 2 * k) for k in range(50)])) == 2


def test_relative_paths_lead_where_the_absolute_ones_led():
    line = svg._shortened("M 1.2 3.4L 10 -2.5L 20.1 7")
    numbers = [float(number) for number in re.findall(r"-?[\d.]+", line)]
    assert list(np.cumsum(np.reshape(numbers, (-1, 2)), axis=0).ravel()) == pytest.approx([1.2, 3.4, 10, -2.5, 20.1, 7])


def test_results_of_engines_whose_code_is_gone_are_still_read(tmp_path, write, small):
    write(tmp_path / "store", "a", small(engine="forgotten", engine_name="Forgotten"))
    script = (
        "import sys\n"
        "class Gone:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        parts = ('core', 'references', 'harness.engines', 'harness.cases', 'harness.registry')\n"
        "        if any(name == f'ninedisk.{p}' or name.startswith(f'ninedisk.{p}.') for p in parts):\n"
        "            raise ImportError(f'{name} is gone')\n"
        "sys.meta_path.insert(0, Gone())\n"
        "from pathlib import Path\n"
        "from ninedisk.reports.build import build_report\n"
        "print(build_report(Path(sys.argv[1]), Path(sys.argv[2])))\n"
    )
    command = [sys.executable, "-c", script, str(tmp_path / "store"), str(tmp_path / "out")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "Forgotten" in (tmp_path / "out" / "engine" / "forgotten.html").read_text(encoding="utf-8")
