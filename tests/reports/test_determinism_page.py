"""The page on determinism: who keeps least comes first, numbers stand in the squares, and engines' pages lead there."""

from __future__ import annotations

import json
import math
import re

import pytest

from ninedisk.harness.results.schema import DETERMINISM_COLUMNS, DETERMINISM_KINDS
from ninedisk.reports.build import build_report

BLANK = {"string": "", "float64": None, "int64": -1}


def measured(engine: str, **verdicts: tuple[str, float | None]) -> str:
    rows = [
        {name: BLANK[kind] for name, kind in DETERMINISM_COLUMNS.items()}
        | {"engine": engine, "engine_name": engine.upper(), "kind": kind, "scene": "pile", "reason": "<i>why</i>"}
        | dict(zip(("verdict", "difference"), verdicts.get(kind, ("bitwise", 0.0)), strict=True))
        for kind in DETERMINISM_KINDS
    ]
    return json.dumps(rows)


@pytest.fixture
def report(tmp_path, write, small):
    store = tmp_path / "store"
    write(store, "a", small(engine="demo", case="case/one"))
    (store / "determinism").mkdir()
    for engine, verdicts in {
        "exact": {"bodies": ("round-off", 1e-15)},
        "demo": {"bodies": ("different", 0.0123), "threads": ("not applicable", None)},
        "near": {"sampled": ("round-off", 2e-16), "twice": ("round-off", 2e-16)},
    }.items():
        (store / "determinism" / f"{engine}.json").write_text(measured(engine, **verdicts))
    return build_report(store, tmp_path / "out").parent


def test_who_keeps_least_comes_first_with_numbers(report):
    html = (report / "determinism.html").read_text(encoding="utf-8")
    assert re.findall(r'<th scope="row">(?:<a [^>]*>)?(\w+)', html) == ["DEMO", "NEAR", "EXACT"]
    squares = re.findall(r'<td class="n (\w+)" title="[^"]*">([^<]*)</td>', html)
    assert len(squares) == 3 * len(DETERMINISM_KINDS)
    assert {square: squares.count(square) for square in set(squares)} == {
        ("in0", "="): 25, ("out3", "0.012"): 1, ("none", "—"): 1, ("out1", "2.0e-16"): 2, ("in1", "1.0e-15"): 1,
    }  # fmt: skip
    assert "<i>why</i>" not in html
    assert not math.isnan(html.index("25 of 29"))


def test_the_overview_and_the_engines_page_lead_there(report):
    assert 'href="determinism.html"' in (report / "index.html").read_text(encoding="utf-8")
    html = (report / "engine" / "demo.html").read_text(encoding="utf-8")
    assert "<b>Bodies given in another order: different</b>, 0.012" in html
    assert 'href="../determinism.html"' in html
