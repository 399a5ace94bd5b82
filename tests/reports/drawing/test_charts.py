"""What distinguishes engines in a chart: looks, names at the ends of lines, notes on what is clipped or zero, truths of the strip."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from ninedisk.reports.drawing import charts
from ninedisk.reports.drawing.draw import end_labels
from ninedisk.reports.drawing.figures import case_figures
from ninedisk.reports.panel.load import load_store
from ninedisk.reports.panel.model import build_panel

PAGES = ("#ffffff", "#1b1f23")


def linear(colour):
    values = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def oklab(colour):
    """Björn Ottosson, A perceptual color space for image processing (2020)."""
    lms = np.array([[0.4122214708, 0.5363325363, 0.0514459929], [0.2119034982, 0.6806995451, 0.1073969566],
                    [0.0883024619, 0.2817188376, 0.6299787005]]) @ linear(colour)  # fmt: skip
    return np.array([[0.2104542553, 0.7936177850, -0.0040720468], [1.9779984951, -2.4285922050, 0.4505937099],
                     [0.0259040371, 0.7827717662, -0.8086757660]]) @ np.cbrt(lms)  # fmt: skip


def test_no_two_of_24_engines_look_alike():
    """In colour, by twice what is distinguished side by side at a glance, or in both dash and mark; and all stand out from the page."""
    looks = charts.engine_looks({str(k): str(k) for k in range(24)}).values()
    for one, two in combinations(looks, 2):
        apart = np.linalg.norm(oklab(one.colour) - oklab(two.colour))
        assert apart > 0.15 or (one.dash != two.dash and one.marker != two.marker), (one, two)
    for look in looks:
        for page in PAGES:
            light, dark = sorted(
                (float(linear(c) @ (0.2126, 0.7152, 0.0722)) + 0.05 for c in (look.colour, page)), reverse=True
            )
            assert light / dark >= 3.0, (look.colour, page)


def test_ends_of_lines_are_named_and_no_name_covers_another():
    a, b, c = charts.engine_looks({"a": "Able", "b": "Bullet", "c": "Chrono"}).values()
    truth = charts.Look("analytic: law", charts.SOFT, (), 3.6)
    assert [words for _, words, _ in end_labels([(0.1, truth), (0.11, a), (0.12, b), (0.9, c)], 0.025, 0.075)] == [
        "truth + 2",
        "Chrono",
    ]
    assert [label[1:] for label in end_labels([(0.5, a), (0.51, b)], 0.025, 0.075)] == [("Able, Bullet", "#24292f")]
    for low in (0.0, 0.97):
        crowd = [(low + 0.03 * k / 40, charts.Look(str(k), "#000000", (), 1.0, "o")) for k in range(0, 41, 20)]
        heights = [height for height, _, _ in end_labels(crowd, 0.001, 0.075)]
        assert len(heights) == 3
        assert np.diff(heights).min() >= 0.075 - 1e-12
        assert 0.0 <= min(heights) <= max(heights) <= 1.0


@pytest.fixture
def group(tmp_path, write, small):
    """Four quantities of two engines: one runs away, one is round-off beside another of its unit, one has two kinds of truth."""
    tables = {"cells": [], "measurements": [], "series": []}
    for engine in ("a", "b"):
        own = small(engine)
        tables["cells"] += own["cells"]
        for quantity, unit, value in (("x", "m", 1.0), ("y", "m", 1e-15), ("z", "m", 1e-3), ("alone", "rad", 1e-15)):
            for k, row in enumerate(own["series"]):
                runs_away = quantity == "x" and engine == "b" and k == 4
                truth = "exact-step" if quantity == "z" and engine == "b" else "analytic"
                expected = value * k if quantity in "xz" else 0.0
                reported = {"quantity": quantity, "unit": unit, "truth": truth, "expected": expected}
                tables["series"].append({**row, **reported, "value": 321.0 if runs_away else value * k})
    write(tmp_path, "a", tables)
    panel = build_panel(load_store(tmp_path))
    (block,) = case_figures(panel, panel.cases["demo/one"])
    return block.groups[0]


def test_what_is_clipped_and_the_truth_of_the_strip_are_reported(group):
    notes = {shown.picture.title: shown.picture.note for shown in group.panels}
    assert notes["x"] == "Clipped: 1 engine leaves the picture, B to 321 m. Strip: distance from the analytic truth."
    assert notes["z"] == (
        "Strip: distance from each engine's truth: analytic (A); exact-step (B). "
        "Exact steps are those of an engine's own scheme: near to them is not near to the physics."
    )


def test_quantities_that_are_zero_everywhere_are_a_sentence(group):
    """Round-off is so beside something; a unit that nothing else has cannot say."""
    assert group.zero == ["y"]
    assert [shown.picture.title for shown in group.panels] == ["x", "z", "alone"]
