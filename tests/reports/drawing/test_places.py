"""Numbers over their places: one chart for all or one an engine, worst first, with truths, and each point leads to its cell."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from urllib.parse import unquote

import numpy as np
import pytest

from ninedisk.harness.results.figures import Drawn, Figure, Plotted, figures_to_text
from ninedisk.reports.build import build_report
from ninedisk.reports.drawing.charts import engine_looks
from ninedisk.reports.drawing.figures import LEAST
from ninedisk.reports.drawing.places import place_figures
from ninedisk.reports.panel.load import Curve, load_store
from ninedisk.reports.panel.model import build_panel

ENGINES = {"dem": "DEM", "cd": "CD", "soft": "SOFT"}
TOLD = {"title": "Places", "shows": "All.", "allows": "Nothing.", "kind": "places", "at_label": "where"}
APART = Figure(quantities=(Plotted("a", "speed", at="0.5"), Plotted("b", "speed", at="2")), log="y", apart=True, **TOLD)
TOGETHER = Figure(quantities=(Plotted("a", "speed", at="b"),), compare="rule", **TOLD)


@pytest.fixture
def store(tmp_path, write, small):
    """Three engines on two variants: 'a' should be 0 and is, or creeps; 'b' should be k."""

    def made(*figures):
        for engine, creep in (("dem", 0.0), ("cd", 1e-3), ("soft", 1e-6)):
            tables = {"cells": [], "measurements": []}
            for k in (1, 2):
                own = {"variant": f"k={k}", "params": json.dumps({"k": k, "rule": "x" if k == 1 else "y"})}
                held = small(engine, **own)
                tables["cells"].append({**held["cells"][0], "case_figures": figures_to_text(figures)})
                for name, value, expected in (("a", k * creep, 0.0), ("b", float(k), float(k))):
                    row = {
                        "quantity": name,
                        "norm": "scalar",
                        "truth": "analytic",
                        "source": "law: of a",
                        "status": "pass",
                    }
                    row |= {"value": value, "expected": expected, "abs_error": abs(value - expected)}
                    tables["measurements"].append({**held["measurements"][0], **own, **row})
            write(tmp_path / "store", engine, tables)
        return tmp_path / "store"

    return made


def charts_of(store):
    panel = build_panel(load_store(store))
    return place_figures(panel.cases["demo/one"], engine_looks(ENGINES), panel.stored.series)


def test_a_picture_an_engine_the_farthest_first_on_common_axes(store):
    ((found),) = charts_of(store(APART))
    assert [chart.title for chart in found.charts] == ["CD", "SOFT", "DEM"]
    assert len({chart.y_limits for chart in found.charts} | {chart.x_limits for chart in found.charts}) == 2
    cd, _, dem = found.charts
    assert [dots.x for dots in cd.dots] == [(0.5, 2.0)] * 2
    assert [dots.y for dots in cd.dots] == [(1e-3, 1.0), (2e-3, 2.0)]
    assert dem.dots[0].y == (LEAST, 1.0)
    assert [unquote(link) for link in cd.dots[1].links] == ["#cell-cd-k=2"] * 2
    assert set(found.legend) == {"variant k=1", "variant k=2"}
    assert not any(chart.equal for chart in found.charts), "places that are no quantities have a scale of their own"


def test_one_chart_for_all_at_the_place_that_was_measured_with_a_line_for_each_rule(store):
    ((found),) = charts_of(store(TOGETHER))
    (chart,) = found.charts
    assert [(dots.look.label, dots.x) for dots in chart.dots[:2]] == [
        ("CD, rule = x", (1.0,)),
        ("CD, rule = y", (2.0,)),
    ]
    assert chart.guides == (("truth: law", (1.0, 2.0), (0.0, 0.0)),)
    assert [look.label for look in found.legend.values()] == ["CD", "DEM", "SOFT"]


def test_curves_replace_the_truths_of_their_quantity_and_readings_have_marks_alone(store):
    curves = (Drawn("speed", "law", (0.0, 4.0), (1.0, 2.0)), Drawn("speed", "printed", (1.0, 2.0), (3.0, 4.0), "me"))
    ((found),) = charts_of(store(replace(TOGETHER, curves=curves)))
    (chart,) = found.charts
    assert chart.guides == (("law", (0.0, 4.0), (1.0, 2.0)),)
    read = chart.dots[0]
    assert (read.look.label, read.x, read.y, read.joined) == ("printed, read by me", (1.0, 2.0), (3.0, 4.0), False)
    assert list(found.legend.values())[-1] == read.look


def test_samples_are_drawn_over_samples_of_the_same_cell(store):
    """Whatever is no number of its own is looked for among the series."""
    panel = build_panel(load_store(store(replace(TOGETHER, quantities=(Plotted("y", "push", at="x"),)))))
    series = {
        ("demo/one", "k=1", "dem", name): Curve(
            *(np.array(each) for each in ([0, 1], [0.0, 1.0], values, values)), "m", "analytic"
        )
        for name, values in (("x", [2.0, 1.0]), ("y", [5.0, 3.0]))
    }
    ((found),) = place_figures(panel.cases["demo/one"], engine_looks(ENGINES), series)
    assert [(dots.key, dots.x, dots.y) for dots in found.charts[0].dots] == [("dem", (1.0, 2.0), (3.0, 5.0))]


def test_what_was_not_measured_is_not_drawn(store):
    unknown = Figure(quantities=(Plotted("c", "speed", at="1"), Plotted("a", "speed", at="nowhere")), **TOLD)
    assert charts_of(store(unknown)) == []
    assert math.isfinite(LEAST)


def test_a_point_leads_to_its_cell(store, tab, tmp_path):
    report = build_report(store(APART), tmp_path / "report").parent
    tab.open(next((report / "case").glob("*.html")))
    tab.wait("document.querySelector('figure.chart.drawn canvas')")
    tab.run("document.querySelector('#cells').scrollIntoView()")
    hidden = "document.getElementById('cell-cd-k=2').closest('details').open"
    assert tab.run(hidden) is False
    place = (
        "(f => { f.scrollIntoView({block: 'center'}); const r = f.querySelector('.u-over').getBoundingClientRect();"
        " return [r.x, r.y, r.width, r.height]; })(document.querySelector('figure.chart'))"
    )
    x, y, width, height = tab.run(place)
    links = set()
    for across in range(0, int(width), 6):
        for down in range(0, int(height), 6):
            for kind in ("mousePressed", "mouseReleased"):
                tab.mouse(x + across, y + down, kind)
            link = tab.run("location.hash")
            if link:
                links.add(unquote(link))
                tab.run("history.replaceState(null, '', location.pathname)")
                x, y, *_ = tab.run(place)
        if len(links) == 2:
            break
    assert links == {"#cell-cd-k=1", "#cell-cd-k=2"}
    assert tab.run(hidden) is True
    tab.run("document.querySelector('figure.chart').focus()")
    tab.key("ArrowRight")
    tab.key("Enter")
    assert unquote(tab.run("location.hash")).startswith("#cell-cd-")
    assert tab.complaints == []


def test_a_path_whose_places_were_measured_each_keeps_its_order(store):
    """From b to a, which lies before it: sorted by places it would run backwards."""
    way = Figure(quantities=(Plotted("b", "way", at="b"), Plotted("a", "way", at="a")), apart=True, **TOLD)
    (found,) = charts_of(store(way))
    cd = next(chart for chart in found.charts if chart.title == "CD")
    assert [dots.x for dots in cd.dots] == [(1.0, 1e-3), (2.0, 2e-3)]
    assert (cd.equal, cd.engine) == (True, "cd")


def test_a_circle_is_drawn_as_one(store, tab, tmp_path):
    """Equal scales on both axes, at two widths of the window."""
    way = Figure(quantities=(Plotted("b", "way", at="b"), Plotted("a", "way", at="a")), apart=True, **TOLD)
    report = build_report(store(way, TOGETHER), tmp_path / "out").parent
    for width in (390, 1440):
        tab.open(report / "case" / "demo-one.html", width)
        tab.wait("document.querySelector('figure.chart.drawn .u-over')")
        tab.run("window.f = document.querySelector('figure.chart.drawn'); window.s = JSON.parse(f.dataset.chart)")
        over = "f.querySelector('.u-over')"
        x, y = f"{over}.clientWidth / (s.limits.x[1] - s.limits.x[0])", f"{over}.clientHeight / (s.y[1] - s.y[0])"
        tab.wait(f"Math.abs(({x}) / ({y}) - 1) < 0.02")
    tab.click("figure.chart.drawn .paper button:nth-of-type(3)")
    assert tab.run("document.querySelector('.paper p').textContent").startswith("Places. CD. Engines: CD")
    tab.run("URL.createObjectURL = blob => { blob.text().then(text => { window.svg = text; }); return '#'; }")
    tab.run(
        "HTMLAnchorElement.prototype.click = function () {}; window.last = [...document.querySelectorAll('figure.chart')].pop()"
    )
    tab.run("last.scrollIntoView()")
    tab.wait("last.querySelector('.paper button')")
    tab.run("last.querySelector('.paper button').click()")
    tab.wait("window.svg")
    assert ">speed</text>" in tab.run("svg")
    assert "undefined" not in tab.run("svg"), "an axis whose label is the title has none"
    assert tab.complaints == []
