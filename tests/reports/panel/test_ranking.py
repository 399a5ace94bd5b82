"""Engines of a case by their headline errors: places, orders, times at 1 %, reasons; known gaps by their cause."""

from __future__ import annotations

import json
import math

import pytest

from ninedisk.harness.results.schema import EvaluatedFinding
from ninedisk.reports.panel import ranking
from ninedisk.reports.panel.headlines import standings
from ninedisk.reports.panel.load import load_store
from ninedisk.reports.panel.model import build_panel, case_tables
from ninedisk.reports.panel.uses import uses


def headline(engine, dt, error, name="lift"):
    return {
        "case": "demo/one", "case_version": 1, "variant": f"dt={dt:g}", "engine": engine, "headline": name, "use": "sliding",
        "quantity": "x", "unit": "m", "value": error, "expected": 0.0, "scale": 1.0, "scale_is": "its way", "rel_error": error,
    }  # fmt: skip


@pytest.fixture
def panel(tmp_path, write, small):
    """Three steps: ``first`` is of order 1, ``exact`` is round-off, ``coarse`` stays 30 % off, ``absent`` did not run."""
    tables = {"cells": [], "measurements": [], "headlines": []}
    errors = {
        "first": {0.1: 0.04, 0.05: 0.02, 0.025: 0.01 / 2.0**0.5},
        "exact": {0.1: 3e-16, 0.05: 4e-15, 0.025: 2e-13},
        "coarse": {0.1: 0.3, 0.05: 0.3, 0.025: 0.3},
    }
    for engine, held in errors.items():
        for k, (dt, error) in enumerate(held.items()):
            own = small(engine, advance_s=1e-3 * 2**k, status="pass")
            for table in ("cells", "measurements"):
                tables[table] += [
                    {**row, "variant": f"dt={dt:g}", "params": json.dumps({"dt": dt})} for row in own[table]
                ]
            tables["headlines"].append(headline(engine, dt, error))
    absent = small("absent", status="not-installed", reason="there is no command")
    tables["cells"] += [{**absent["cells"][0], "variant": "dt=0.1", "params": json.dumps({"dt": 0.1})}]
    tables["measurements"][-3] |= {"truth": "exact-step", "source": "its own scheme"}
    write(tmp_path, "a", tables)
    return build_panel(load_store(tmp_path))


def test_engines_are_ranked_by_their_worst_headline(panel):
    ranked = ranking.rank(panel, panel.cases["demo/one"])
    assert [each.engine.id for each in ranked.engines] == ["exact", "first", "coarse", "absent"]
    assert [ranked.place(each) for each in ranked.measured] == [1, 2, 3]
    exact, first, coarse, absent = ranked.engines
    assert (first.error, first.decides["variant"]) == (0.04, "dt=0.1")
    assert math.isnan(exact.order), "errors below round-off have none"
    assert first.order == pytest.approx(math.log2(4.0 * 2.0**0.5) / 2.0, rel=1e-12)
    assert coarse.order == pytest.approx(0.0, abs=1e-12)
    # Between 2 % after 2 ms and 0.707 % after 4 ms, on straight lines of the logarithms: 2 ms * 2**(2/3).
    assert first.time == "3.17 ms"
    assert (exact.time, coarse.time, absent.time) == ("≤ 1 ms", "1 % not reached", ranking.NOTHING)
    assert absent.reasons == ["there is no command"]
    assert coarse.reasons == ["its scheme says so, and it meets that scheme's exact solution: its own scheme"]
    assert first.reasons == ["its error shrinks with the step, of order 1.3"]
    assert exact.reasons == []


def test_a_step_explains_its_own_error_only(tmp_path, write, small):
    """Order 1 of two variants says nothing of a third one that is farther off."""
    tables = {"cells": [], "measurements": [], "headlines": []}
    for k, (dt, other, error) in enumerate(((0.1, 0, 0.02), (0.05, 0, 0.01), (0.1, 1, 0.9))):
        own = small("a", advance_s=1e-3)
        params = {"variant": f"v{k}", "params": json.dumps({"dt": dt, "other": other})}
        for table in ("cells", "measurements"):
            tables[table] += [{**row, **params} for row in own[table]]
        tables["headlines"].append({**headline("a", dt, error), "variant": f"v{k}"})
    write(tmp_path, "a", tables)
    panel = build_panel(load_store(tmp_path))
    (only,) = ranking.rank(panel, panel.cases["demo/one"]).engines
    assert (only.error, round(only.order, 12)) == (0.9, 1.0)
    assert only.reasons == ["nothing stored says why: no note, no known difference"]


def test_what_errors_are_relative_to_is_that_of_the_rows_that_are_shown(panel):
    first = next(row for row in panel.stored.headlines if row["engine"] == "first" and row["rel_error"] == 0.04)
    for row in panel.stored.headlines:
        row["scale_is"] = "the other way"  # of rows that no engine's largest error is in
    first["scale_is"] = "its way"
    assert ranking.rank(panel, panel.cases["demo/one"]).scales == {"lift": "the other way or its way"}


def test_a_finding_says_why(panel):
    found = {
        "id": "first/off", "engine": "first", "versions": "1", "what": "it is off", "verdict": "there",
        "size": 0.04, "case": "demo/one",
    }  # fmt: skip
    other = found | {"id": "source/off"}
    object.__setattr__(panel.stored, "findings", [EvaluatedFinding(**each) for each in (found, other)])
    first = next(each for each in ranking.rank(panel, panel.cases["demo/one"]).engines if each.engine.id == "first")
    assert first.reasons == ["finding first/off: it is off", "its error shrinks with the step, of order 1.3"]


def test_errors_are_reported_in_per_cent_or_decades():
    reported = [ranking.percent(x) for x in (0.0, 2.2e-14, 1e-5, 0.0123, 0.996, 2.75, 37.0, math.inf, math.nan)]
    assert reported == ["0", "2.2e-14", "0.001 %", "1.2 %", "100 %", "275 %", "37 ×", "∞", "—"]


def test_known_gaps_are_reported_by_cause(tmp_path, write, small):
    tables = {"cells": [], "measurements": []}
    law = "the analytic truth is {}, the print says {} (Coulomb's law: no load)"
    for engine, reason in (
        ("a", law.format(0, 0.5)),
        ("a", law.format(0.25, 1e-3)),
        ("b", law.format(0, 0.5)),
        ("c", "misread 7 N"),
    ):
        own = small(engine, status="known-gap", reason=reason)
        tables["cells"] += own["cells"]
        tables["measurements"] += [{**own["measurements"][0], "quantity": f"q{len(tables['measurements'])}"}]
    write(tmp_path, "a", tables)
    panel = build_panel(load_store(tmp_path))
    coulomb, other = ranking.causes(panel, case_tables(panel.cases["demo/one"]).gaps)
    assert coulomb.text == "the print contradicts Coulomb's law: no load"
    assert (coulomb.engines, coulomb.count) == (["A", "B"], 3)
    assert (other.text, other.count) == ("misread 7 N", 1)


@pytest.mark.parametrize("status", ["fail", "error", "timeout"])
def test_a_wrong_engine_is_never_closest(tmp_path, write, small, status):
    """Its headline is exact, and one check fails or one cell breaks: it ranks last, after one that is off by half."""
    tables = {"cells": [], "measurements": [], "headlines": []}
    for engine, error, of in (("right", 0.5, "pass"), ("wrong", 1e-9, status)):
        own = small(engine, status=of)
        for table in ("cells", "measurements"):
            tables[table] += [{**row, "variant": "dt=0.1", "params": json.dumps({"dt": 0.1})} for row in own[table]]
        tables["headlines"].append(headline(engine, 0.1, error))
    write(tmp_path, "a", tables)
    panel = build_panel(load_store(tmp_path))
    ranked = ranking.rank(panel, panel.cases["demo/one"])
    assert [each.engine.id for each in ranked.engines] == ["right", "wrong"]
    assert [ranked.place(each) for each in ranked.measured] == [1, 2]
    assert [each.engine.id for each in ranked.closest] == ["right"]
    assert ranked.farthest.engine.id == "right"
    assert (
        ranked.engines[1].summary.wrong
        == {"fail": "1 variant fails", "error": "1 error", "timeout": "1 timeout"}[status]
    )
    [sliding] = [use for use in uses(panel) if use.id == "sliding"]
    assert (
        [rank.engine.id for rank in sliding.best]
        == [rank.engine.id for rank in sliding.widest or sliding.best]
        == ["right"]
    )
    assert [(rank.engine.id, sliding.place(rank)) for rank in sliding.ranks] == [("right", 1), ("wrong", 2)]
    assert "wrong" not in {rank.engine.id for rank in sliding.able}
    assert [each.rank for name in ("right", "wrong") for each in standings(panel, name)] == [1, 2]
