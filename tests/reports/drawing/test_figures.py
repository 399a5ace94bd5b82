"""Figures that cases declare, and pictures: which variants a figure takes, which limits and points a panel has."""

from __future__ import annotations

import json
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from ninedisk.harness.api.case import figures_of
from ninedisk.harness.api.registry import BUILTIN_CASES, get_case
from ninedisk.harness.results.figures import figures_from_text, figures_to_text
from ninedisk.reports.build import CaseDrawing, Job, render
from ninedisk.reports.drawing import draw as draw_history
from ninedisk.reports.drawing.draw import error_limits, read_scene, round_off, thinned_indices, value_limits
from ninedisk.reports.drawing.figures import GENERIC, case_budgets, case_figures, looks_of
from ninedisk.reports.drawing.scenes import Arrays, case_configurations, moving_scenes
from ninedisk.reports.panel.load import Curve, load_store
from ninedisk.reports.panel.model import build_panel

FIGURES = {f"A.{k}" for k in (2, 3, 4, *range(6, 14), *range(17, 27))} | {
    "A.1",
    "A.5 (a)",
    "A.5 (b)",
    "A.14",
    "A.15",
    "A.16",
}


def declared():
    return [figure for case_id in BUILTIN_CASES for figure in figures_of(get_case(case_id))]


def test_the_cases_show_every_figure_of_the_source():
    numbers = set()
    for figure in declared():
        numbers |= {quantity.number for quantity in figure.quantities} if "–" in figure.number else {figure.number}
    assert numbers - {""} == FIGURES


def test_every_figure_says_what_is_seen_and_concluded():
    for figure in declared():
        if figure.kind != "setup":
            assert figure.title
            assert figure.shows.endswith(".")
            assert figure.allows.endswith(".")


def test_figures_survive_the_store_and_nonsense_is_none():
    assert all(figures_from_text(figures_to_text([figure])) == (figure,) for figure in declared())
    for text in (
        "",
        "{",
        "[1]",
        '[{"title": 3}]',
        '[{"where": {"a": [{}]}}]',
        '[{"last": "x"}]',
        '[{"quantities": [{}]}]',
        '[{"curves": [{}]}]',
        '[{"curves": [{"x": [1], "y": []}]}]',
        "null",
    ):
        assert figures_from_text(text) == (), text


def test_figures_match_numbers_by_value_and_words_exactly():
    figure = next(figure for figure in get_case("nine-disk/distortion").figures if figure.number == "A.5 (a)")
    assert figure.matches({"phi_deg": 15.0, "ks_over_kn": 0.6667})
    assert not figure.matches({"phi_deg": 15.0, "ks_over_kn": 0.7})
    assert not figure.matches({"phi_deg": "15", "ks_over_kn": 1.0})
    elastic = get_case("binary-collision").figures[0]
    assert elastic.matches({"kind": "elastic", "restitution": None})
    assert not elastic.matches({"kind": "elastic", "restitution": 0.5})


def test_figures_of_the_panel(panel_store):
    panel = build_panel(load_store(panel_store))
    blocks = case_figures(panel, panel.cases["nine-disk/compression"])
    assert [block.plan.number for block in blocks] == ["A.2", "A.3", ""]
    smooth = blocks[0].groups[0]
    assert (smooth.heading, smooth.columns, len(smooth.panels)) == ("wall_mu = 0", 2, 8)
    assert [panel.picture.title for panel in smooth.panels[:2]] == [
        "Fn disk–disk, centre row, xi = 3",
        "Fn disk–disk, centre row, xi = 0",
    ]
    left, right = (shown.picture for shown in smooth.panels[:2])
    assert left.y_limits == right.y_limits
    assert left.error_limits == right.error_limits
    assert len(left.lines) == 4
    assert len(left.references) == 1


def test_variants_that_no_plan_takes_are_shown_too(tmp_path, write, small):
    write(tmp_path, "a", small(case="incline-block"))
    panel = build_panel(load_store(tmp_path))
    (block,) = case_figures(panel, panel.cases["incline-block"])
    assert block.plan.title == GENERIC.title
    assert block.groups[0].panels[0].picture.y_label == "x [m]"


def test_runaway_does_not_flatten_the_others():
    truth = np.array([0.0, 1.0])
    low, high = value_limits([truth], [np.array([0.5, 1e9, np.inf, np.nan])])
    assert -3.0 < low <= 0.0
    assert 1.0 <= high < 4.0


def test_round_off_is_no_signal():
    low, high = value_limits([np.full(3, 2.0)], [2.0 + 1e-15 * np.arange(3)])
    assert high - low > 0.1
    assert value_limits([np.zeros(3)], [np.array([0.0, 1e-20, -1e-20])])[1] > 1e-13
    assert value_limits([], [np.full(3, np.nan)]) == (-1.0, 1.0)


def test_error_axis_holds_errors_and_tolerance():
    floor = round_off([2.0], [])
    assert floor == pytest.approx(4.44e-16, rel=1e-2)
    low, high = error_limits([np.array([1e-9, np.nan])], [1e-3, np.nan], floor)
    assert low < floor
    assert high > 1e-3
    assert error_limits([np.full(2, np.nan)], [1.0], floor) is None
    assert round_off([0.0], [np.array([0.0, 1e-40, 1e-3])]) == pytest.approx(2.2e-19, rel=1e-2)


def test_thinning_keeps_ends_and_extremes():
    x = np.arange(5000.0)
    y = np.sin(x / 300.0)
    y[1234], y[4321] = 9.0, np.nan
    keep = thinned_indices(x, y)
    assert len(keep) <= draw_history.MOST_POINTS
    assert {0, 1234, 4999} <= set(keep)
    assert np.nanmin(y) in y[keep]
    assert list(thinned_indices(np.arange(3.0), np.full(3, np.nan))) == [0, 1, 2]


def test_scattered_samples_are_joined_but_a_gap_stays_a_gap():
    x = np.arange(9.0)
    scattered = np.where(x % 4 == 0, 1.0, np.nan)
    assert list(draw_history.joined(x, scattered)[0]) == [0.0, 4.0, 8.0]
    gap = np.where((x > 2) & (x < 6), np.nan, 1.0)
    assert list(draw_history.joined(x, gap)[0]) == list(x)


def test_configurations_begin_with_the_distortion(panel_store):
    panel = build_panel(load_store(panel_store))
    case = panel.cases["nine-disk/distortion"]
    plan, groups = case_configurations(case, looks_of(panel, case).engines)
    assert plan.number == "A.4"
    assert len(groups) == 2
    assert [picture.title for picture in groups[0][1]] == ["cycle 5000", "cycle 5500"]
    assert len(groups[0][1][1].bodies) == 3


def test_sketch_reads_every_motion_and_survives_nonsense(panel_store):
    panel = build_panel(load_store(panel_store))
    setup = json.loads(panel.cases["nine-disk/distortion"].cells[0]["setup"])
    scene = read_scene(setup)
    assert [wall.spin for wall in scene.walls] == [-0.0175, -0.0175, 0.0, 0.0]
    assert scene.marks[0][0] == "fn_disk_disk_centre"
    assert np.allclose(scene.marks[0][1], [100.0, 150.0])
    assert np.allclose(scene.marks[2][1], [0.0, 150.0])
    for nonsense in (
        {},
        {"scene": None},
        {"scene": {"disks": {"x": "abc"}}},
        {"scene": {"disks": {"x": [], "radius": []}}},
    ):
        assert read_scene(nonsense) is None


def test_grains_are_drawn_as_their_outlines():
    """An ellipse's polygon has its extent, turned as given; its forces are not those of the circle around it."""
    from ninedisk.harness.api.params import resolve
    from ninedisk.harness.cases.nurbs.collision import CASE
    from ninedisk.reports.drawing.draw import Configuration, draw_configuration, draw_sketch, turned
    from ninedisk.reports.drawing.scenes import springs

    setup = CASE.build(resolve(CASE, {}).params)
    stored = {"scene": setup.scene.to_dict(), "labels": setup.labels}
    view = read_scene(stored)
    upright = [turned(edge, -angle) for edge, angle in zip(view.edges, (0.5, -0.9), strict=True)]
    assert np.allclose([np.ptp(edge, axis=0) for edge in upright], (2.0, 1.2), atol=1e-3)
    assert springs(stored) is None
    disks = {key: values for key, values in stored["scene"]["disks"].items() if key not in ("outline", "angle")}
    plain = read_scene({"scene": {**stored["scene"], "disks": disks}})
    assert plain.edges == (None, None)
    assert springs({"scene": {**stored["scene"], "disks": disks}}) is not None
    assert plain.signature != view.signature
    assert draw_sketch(view) != draw_sketch(plain)
    frames = {"step": [0, 1], "x": [view.x.tolist(), (view.x + 1.0).tolist()], "angle": [[0.0, 0.0], [0.3, 0.3]]}
    cell = {"variant": "v", "engine": "e", "frames": json.dumps(frames), "setup": json.dumps(stored)}
    arrays = Arrays()
    edges = moving_scenes(SimpleNamespace(cells=[cell]), arrays)["v"]["edges"]
    assert edges == [arrays(edge) for edge in view.edges]
    assert len(set(edges)) == 2
    look = SimpleNamespace(colour="#123456", dash=())
    bodies = ((look, view.x, np.array([0.3, np.nan]), ()),)
    moved = draw_configuration(Configuration("", view.radius, bodies, edges=view.edges))
    assert moved.count("#123456") == 2  # one outline and its spoke; an unknown angle is not drawn as any


def test_a_block_is_a_square_on_its_incline_and_gravity_points_down():
    from ninedisk.harness.api.params import resolve

    case = get_case("incline-block")
    setup = case.build(resolve(case, {}).params)
    view = read_scene({"scene": setup.scene.to_dict(), "labels": setup.labels})
    assert view.block
    level = draw_history.with_gravity_down(view)
    assert np.allclose(level.gravity / np.hypot(*view.gravity), (0.0, -1.0))
    assert level.walls[0].normal == pytest.approx((np.sin(np.radians(20.0)), np.cos(np.radians(20.0))))
    edge = level.edges[0]
    assert np.allclose(np.diff(edge, axis=0)[0], 2.0 * view.radius[0] * level.walls[0].tangent)
    assert np.allclose(np.hypot(*edge.T), view.radius[0] * np.sqrt(2.0))
    assert "20°" in draw_history.draw_sketch(view)
    kind, number, *place = draw_history.numbers_of(view).splitlines()[1].split(",")[1:5]
    assert (kind, number, [float(cell) for cell in place]) == ("block", "0", setup.scene.disks.x[0].tolist())
    turning = json.loads(json.dumps(setup.scene.to_dict()))
    turning["disks"]["rotating"] = [True]
    assert read_scene({"scene": turning, "labels": setup.labels}).edges == (None,)


def test_drawing_is_deterministic_in_any_number_of_processes(panel_store, tmp_path):
    panel = build_panel(load_store(panel_store))
    written = []
    for workers in (1, 2):
        folder = tmp_path / str(workers)
        (folder / "figures").mkdir(parents=True)
        jobs = CaseDrawing(panel, panel.cases["nine-disk/distortion"], folder).jobs
        heard = []
        render(
            [Job(job.picture, job.path) for job in jobs[:4]],
            lambda done, count, heard=heard: heard.append((done, count)),
            workers,
        )
        assert heard[-1] == (4, 4)
        written.append({path.name: path.read_bytes() for path in sorted(Path(folder, "figures").iterdir())})
    assert written[0] == written[1]
    for name, text in written[0].items():
        if name.endswith(".csv"):
            continue
        assert b"<metadata>" not in text
        assert b"prefers-color-scheme: dark" in text
        assert not re.search(rb'(?:href|src)="(?!#)', text)


def test_a_budget_stacks_what_an_engine_reports_whole():
    """Three engines: one reports all, one lacks a loss, one has it as NaN; what is taken off makes the sum flat, zeros are left out."""
    plan = next(figure for figure in get_case("energy/budget").figures if figure.kind == "budget")
    t = np.linspace(0.0, 1.0, 5)
    values = dict.fromkeys((quantity.name for quantity in plan.quantities), 0.0 * t)
    values |= {"energy_kinetic": 3.0 - t, "energy_friction_loss": 3.0 * t, "energy_wall_work": 2.0 * t}
    stored = {
        ("energy/budget", "v", engine, name): Curve(t, t, 0.0 * t + curve, 0.0 * t, "J", "")
        for engine in ("whole", "silent", "blank")
        for name, curve in values.items()
        if (engine, name) != ("silent", "energy_friction_loss")
    }
    stored[("energy/budget", "v", "blank", "energy_elastic")].value[:] = np.nan
    panel = SimpleNamespace(
        engines={name: SimpleNamespace(name=name.title()) for name in ("whole", "silent", "blank")},
        stored=SimpleNamespace(series=stored),
    )
    case = SimpleNamespace(id="energy/budget", figures=(plan,), variants={"v": {"mu": 0.4}})
    ((found, ((heading, (stack,)),)),) = case_budgets(panel, case)
    assert (found, heading, stack.title) == (plan, "", "Whole")
    assert [name for name, *_ in stack.bands] == ["kinetic energy", "lost by friction"]
    assert stack.base_name == "work of the wall"
    np.testing.assert_allclose(stack.base + sum(curve for *_, curve in stack.bands), 3.0)
    svg = draw_history.draw_stack(stack)
    assert all(name in svg for name in ("lost by friction", "work of the wall", "sum"))
    assert "lost by the scheme" not in svg
