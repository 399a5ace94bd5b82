"""What the first page and an engine's page say of headlines: partly rated squares, wide passes, ranks, disagreement, idle capabilities."""

from __future__ import annotations

import json
import math

import pytest

from ninedisk.harness.results.schema import allowed_shares
from ninedisk.reports.pages import environment, index_page, squares, verdict_counts
from ninedisk.reports.panel.headlines import disagreements, ratings, standings, without_headline
from ninedisk.reports.panel.load import load_store
from ninedisk.reports.panel.model import build_panel


@pytest.fixture
def panel(tmp_path, write, small):
    """Two engines on two variants of a case; `two` refuses the second variant, `three` does not have its setting."""
    tables = {"cells": [], "measurements": [], "headlines": []}
    signed = {("one", 1): 0.0, ("one", 2): 0.5, ("two", 1): -0.2, ("three", 1): 1e-3}
    for engine in ("one", "two", "three"):
        for k in (1, 2):
            ran = (engine, k) in signed
            place = {"variant": f"k={k}", "params": json.dumps({"k": k})}
            support = "exact" if ran else {"two": "no", "three": ""}[engine]
            made = small(engine, **place, support=support, status="pass" if ran else "unsupported")
            (cell,) = made["cells"]
            tables["cells"].append(
                {
                    **cell,
                    "engine_version": "1",
                    "advance_s": 0.1 * k,
                    "asked": '["gravity"]',
                    "capabilities": '["gravity", "held"]',
                }
            )
            tables["measurements"] += made["measurements"]
            for name in ("way", "spin") if ran else ():
                error = signed[engine, k] if name == "way" else math.nan if engine == "two" else 0.0
                tables["headlines"].append(
                    {"case": "demo/one", "case_version": 1, **place, "engine": engine, "headline": name, "use": "sliding",
                     "value": 1.0 + 2.0 * error, "expected": 1.0, "scale": 2.0, "scale_is": "width", "rel_error": abs(error)}
                )  # fmt: skip
    write(tmp_path, "a", tables)
    return build_panel(load_store(tmp_path))


def test_a_headline_without_a_number_leaves_a_square_partly_rated(panel):
    found = ratings(panel.cases["demo/one"])
    assert {name: (rating.rated, rating.of) for name, rating in found.items()} == {
        "one": (4, 4),
        "two": (1, 4),
        "three": (2, 2),
    }
    assert [name for name, rating in found.items() if rating.partly] == ["two"]
    assert found["one"].error == 0.5
    html = index_page(environment(), panel)
    assert "<small>1/4</small>" in html
    assert html.count('<td class="ran partly') == 1


def test_ranks_compare_the_same_variants(panel):
    (way,) = (each for each in standings(panel, "two") if each.row["headline"] == "way")
    assert (way.error, way.rank, way.of) == (0.2, 3, 3)
    (way,) = (each for each in standings(panel, "one") if each.row["headline"] == "way")
    assert (way.error, way.rank, way.of) == (0.5, 1, 3), "nobody else ran the variant where it is wrong"


def test_disagreement_is_that_of_signed_errors_on_one_variant(panel):
    (worst,) = disagreements(panel)
    assert (worst.low["engine"], worst.high["engine"], worst.low["variant"]) == ("two", "three", "k=1")
    assert worst.apart == pytest.approx(0.201)
    assert (worst.near, worst.engines) == (2, 3)


def test_what_an_engine_declares_and_no_cell_asked_for(panel):
    assert without_headline(panel, panel.engines["one"]) == (["held"], ["gravity"])


def test_a_pass_is_wide_by_what_its_tolerance_is_of_the_reference(panel):
    row = {"case": "c", "quantity": "q", "unit": "N", "atol": 1.0, "rtol": 0.0, "scale": 10.0}
    zero, noise = {**row, "scale": 0.0}, {**row, "scale": 1e-15}
    other = {**row, "quantity": "other", "scale": 1e-16}
    assert allowed_shares([row, zero, noise, other]) == pytest.approx([0.1] * 4)
    assert math.isnan(allowed_shares([zero])[0])
    assert {square.summary.wide for square in squares(panel).values()} == {1.0}
    html = index_page(environment(), panel)
    assert "4 pass</span> (4 of them wide)" in html
    assert "pass, wide: 100 %" in html


def test_a_known_difference_is_no_pass(tmp_path, write, small):
    why = "one/slips: friction lags by a step"
    write(tmp_path, "a", small("one", engine_version="1", status="known-difference", reason=why, abs_error=3.0))
    panel = build_panel(load_store(tmp_path))
    counts = verdict_counts(panel)
    assert (counts["known-difference"], counts["pass"]) == (1, 0)
    html = index_page(environment(), panel)
    assert 'class="mark st-known-difference"' in html
    assert why in html[html.index('id="gaps"') :]
