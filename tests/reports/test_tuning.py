"""What to change in an engine, on the pages of an engine and of a case."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from ninedisk.harness.api.errors import StoreError
from ninedisk.harness.results.reader import read_tuning
from ninedisk.reports.build import build_report
from ninedisk.reports.tuning import front, lines

OWN: dict[str, Any] = {
    "step": 0.002,
    "halvings": 0,
    "changed": {},
    "error": 0.4,
    "errors": {},
    "seconds": 0.01,
    "reason": "",
}
FINE = {**OWN, "halvings": 1, "step": 0.001, "changed": {"impedance": 0.9999}, "error": 0.002, "seconds": 0.025}
ADAPTED = {**OWN, "step": None, "error": 0.0005, "seconds": 0.35}


def record(**changes: Any) -> dict[str, Any]:
    """A record of an engine that comes to 1 % and not to 0.1 %."""
    return {
        "case": "demo/one",
        "variant": "mu=0.3",
        "headline": "distance",
        "headlines": [{"name": "distance", "use": "sliding", "scale_is": "way without friction"}],
        "engine": "dem",
        "engine_name": "DEM",
        "own_step": 0.002,
        "points": [OWN, FINE, {**FINE, "halvings": 2, "error": None, "reason": "error: it crashed"}],
        "tuned": ADAPTED,
        "answers": [
            {**FINE, "target": 0.01, "reached": True, "times": 2.5},
            {**FINE, "target": 0.001, "reached": False, "times": 2.5},
        ],
        **changes,
    }


def stored(store: Path, *records: dict[str, Any]) -> Path:
    (store / "tune").mkdir(parents=True, exist_ok=True)
    (store / "tune" / "dem.json").write_text(json.dumps(list(records)))
    return store


def test_the_lines_of_a_table() -> None:
    assert lines(record()) == [
        ("stock", "2 ms", "nothing", "40 %", "10 ms", "1 ×", ""),
        ("1 %", "1 ms", "impedance = 0.9999", "0.2 %", "25 ms", "2.5 ×", ""),
        (
            "0.1 %",
            "1 ms",
            "impedance = 0.9999",
            "0.2 %",
            "25 ms",
            "2.5 ×",
            "no setting of the ladder reaches it; this is the closest",
        ),
        ("tuned", "—", "all settings of the adapter", "0.05 %", "350 ms", "35 ×", ""),
    ]


def test_an_engine_whose_own_settings_cannot_run_the_case_says_why() -> None:
    refused = {**OWN, "error": None, "seconds": None, "reason": "unsupported: it lacks restitution"}
    found = lines(record(points=[refused], answers=[{**refused, "target": 0.01, "reached": False, "times": None}]))
    assert [line[3:6] for line in found] == [("—", "—", "—"), ("—", "—", "—"), ("0.05 %", "350 ms", "—")]
    assert "it lacks restitution" in found[1][6]


def test_a_curve_leaves_out_what_takes_longer_and_is_no_closer() -> None:
    slow = {**FINE, "error": 0.3, "seconds": 1.0}
    assert front(record(points=[OWN, slow, FINE])) == [
        (0.01, 0.4, "stock"),
        (0.025, 0.002, "step 1 ms, impedance = 0.9999"),
        (0.35, 0.0005, "tuned"),
    ]


@pytest.mark.parametrize("measured", [True, False])
def test_pages_show_what_is_stored(
    measured: bool, tmp_path: Path, write: Callable[..., Path], small: Callable[..., Any]
) -> None:
    store = tmp_path / "store"
    write(store, "20260101T000000Z-000001", small())
    if measured:
        stored(store, record())
    build_report(store, tmp_path / "report")
    engine = (tmp_path / "report" / "engine" / "dem.html").read_text()
    case = (tmp_path / "report" / "case" / "demo-one.html").read_text()
    assert ("What to change for 1 %" in engine) is measured
    assert ('id="tuning"' in case) is measured
    if measured:
        row = re.search(r"<b>1 %</b>.*?</tr>", engine, re.DOTALL)
        assert row
        assert [part in row[0] for part in ("1 ms", "impedance = 0.9999", "0.2 %", "2.5 ×")] == [True] * 4
        assert "Sliding: <a href" in engine
        assert "stepping, s per simulated second" in case


def test_pages_say_how_to_measure_what_is_not_stored(
    tmp_path: Path, write: Callable[..., Path], small: Callable[..., Any]
) -> None:
    store = tmp_path / "store"
    write(store, "20260101T000000Z-000001", small())
    of_stock = small(engine="dem-stock")
    common = {
        name: of_stock["measurements"][0][name]
        for name in ("case", "variant", "params", "engine", "unit", "value", "expected")
    }
    measured = {
        "headline": "distance",
        "use": "sliding",
        "quantity": "x",
        "scale": 1.0,
        "scale_is": "way",
        "rel_error": 0.5,
    }
    write(
        store, "20260102T000000Z-000001", {**of_stock, "headlines": [{**common, **measured, "source": "closed form"}]}
    )
    build_report(store, tmp_path / "report")
    page = (tmp_path / "report" / "engine" / "dem.html").read_text()
    assert "Not measured. <code>ninedisk tune --all --engine dem</code>" in page


def test_a_damaged_file_is_named(tmp_path: Path) -> None:
    assert read_tuning(tmp_path) == []
    assert read_tuning(stored(tmp_path, record()))[0]["engine"] == "dem"
    broken = record()
    del broken["points"]
    with pytest.raises(StoreError, match=r"dem\.json' is damaged .*ninedisk tune --all --engine dem"):
        read_tuning(stored(tmp_path, broken))
