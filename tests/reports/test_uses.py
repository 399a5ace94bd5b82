"""Which engine for what, on a store of four engines: two cases, two steps."""

from __future__ import annotations

import json
import math

import pytest

from ninedisk.harness.results.schema import USES
from ninedisk.reports.build import build_report
from ninedisk.reports.load import load_store
from ninedisk.reports.model import build_panel
from ninedisk.reports.uses import uses

ERRORS = {  # by engine: case, step (its variant) -> error; "own" is a variant of one engine alone
    "exact": {("a", 0.1): 1e-15, ("a", 0.2): 3e-14, ("b", 0.1): 0.0, ("b", 0.2): 1e-13},
    "first": {("a", 0.1): 0.01, ("a", 0.2): 0.02, ("b", 0.1): 0.005, ("b", 0.2): 0.01},
    "blunder": {("a", 0.1): 0.0, ("a", 0.2): 0.0, ("b", 0.1): 0.5, ("b", 0.2): 0.5, ("b", "own"): 7.0},
    "half": {("a", 0.1): 1e-13, ("b", 0.1): 1e-13},  # both headlines, on half of the variants
    "little": {("a", 0.1): math.nan, ("c", 0.1): 1e-6},
    "coarse": {("a", 0.1): 0.015, ("a", 0.2): 0.06, ("b", 0.1): 0.0025, ("b", 0.2): 0.04},
}
SECONDS = {"exact": 8.0, "first": 1.0, "blunder": 2.0, "little": 1.0, "half": 9.0, "coarse": 1.0}


@pytest.fixture
def store(tmp_path, write, small):
    tables = {"cells": [], "headlines": []}
    for engine, errors in ERRORS.items():
        for (case, step), error in errors.items():
            params = {"dt": 0.1, "k": 2} if step == "own" else {"dt": step, "k": 1}
            place = {"case": case, "variant": f"dt={step}", "params": json.dumps(params)}
            (cell,) = small(engine, **place)["cells"]
            tables["cells"].append({**cell, "advance_s": SECONDS[engine] * 0.1 / params["dt"]})
            row = {"case_version": 1, **place, "engine": engine, "headline": "way", "use": "sliding", "scale_is": "way"}
            tables["headlines"].append({**row, "value": error, "expected": 0.0, "scale": 1.0, "rel_error": error})
    write(tmp_path, "a", tables)
    return tmp_path


def test_engines_are_ordered_by_their_worst_error(store):
    """A mean would put the blunder, exact on all but one case, before the engine that is off by 2 % at most."""
    stored = load_store(store)
    found = {use.id: use for use in uses(stored, build_panel(stored).engines)}
    assert list(found) == list(USES)
    sliding = found["sliding"]
    assert sliding.headlines == 3
    assert [(rank.engine.id, rank.error, round(3.0 * rank.covers, 9)) for rank in sliding.ranks] == [
        ("exact", 1e-13, 2.0),
        ("first", 0.02, 2.0),
        ("coarse", 0.06, 2.0),
        ("blunder", 0.5, 2.0),
    ]
    assert [(rank.engine.id, rank.error, rank.covers) for rank in sliding.little] == [
        ("half", 1e-13, pytest.approx(1 / 3)),
        ("little", 1e-6, pytest.approx(1 / 3)),
    ]
    assert [rank.engine.id for rank in sliding.best] == ["exact"]
    assert all(use.headlines == 0 and not use.ranks for name, use in found.items() if name != "sliding")


def test_time_at_one_percent_is_compared_where_some_engine_gets_there(store):
    """By hand. `first`: a at 1 s, b at 0.5 s; `exact` takes its larger step, 4 s on both; `coarse` never gets there on a, and on b where
    ``0.0025 (h/0.1)^4 = 0.01``, h = 0.1 sqrt(2); `blunder` on a alone, 1 s."""
    stored = load_store(store)
    use = next(use for use in uses(stored, build_panel(stored).engines) if use.id == "sliding")
    found = {rank.engine.id: (rank.slower, rank.reached, rank.timed) for rank in use.ranks}
    assert found["first"] == pytest.approx((1.0, 2, 2))
    assert found["exact"] == pytest.approx((math.sqrt(4.0 * 8.0), 2, 2))
    assert found["coarse"] == pytest.approx((math.sqrt(2.0), 1, 2))
    assert found["blunder"] == pytest.approx((1.0, 1, 2))
    assert use.fastest is not None
    assert use.fastest.engine.id == "first"


def test_the_first_page_shows_it(store, tmp_path):
    html = (build_report(store, tmp_path / "out").parent / "index.html").read_text()
    assert (
        "Most accurate: <b>EXACT</b>, 1.0e-13 at the worst; next FIRST, 2 %. Fastest at 1 %: <b>FIRST</b>, 1 ×." in html
    )
    assert (
        '<li class="d0"><a href="engine/exact.html">EXACT</a> <b>1.0e-13</b> <small>5.7 ×</small> <small>2 of 3 headlines</small></li>'
        in html
    )
    assert "1 × in 1 of 2</small>" in html
    assert "ninedisk bench flow" in html
