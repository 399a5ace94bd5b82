"""The page of a self-test: every defect, every number, the checks that never fired; nothing from outside."""

from __future__ import annotations

import re
from typing import Any

import pytest

from ninedisk.reports.folder import ReportError
from ninedisk.reports.selftest import Kind, matrix, selftest_page

Row = dict[str, Any]
GAP, FN, X = (
    "hill[mu=0.3,dt=1] gap (analytic)",
    "hill[mu=0.3,dt=1] fn (exact-step)",
    "box[default] x_2_final (converged)",
)


def row(defect: str, kind: str, checks: list[str], **more: Any) -> Row:
    by_case: dict[str, int] = {}
    for check in checks:
        by_case[check.partition("[")[0]] = by_case.get(check.partition("[")[0], 0) + 1
    made = {"defect": f"dem/{defect}", "engine": "dem", "kind": kind, "what": f"{defect} & <b>", "caught": bool(checks)}
    made |= {
        "checks": checks,
        "by_case": by_case,
        "hole": "",
        "errors": [],
        "judged": 3,
        "passed": [],
        "edits": [],
        "seconds": 1.0,
    }
    return made | more


@pytest.fixture
def rows() -> list[Row]:
    return [
        row("unchanged", "clean", [], passed=[GAP, FN, X]),
        row("one", "kernel", [GAP], edits=[["ninedisk.core.a", "x < 1", "x < 2"]]),
        row("some", "scene", [GAP, GAP.replace("0.3", "0.4")]),
        row("both", "history", [GAP, X]),
        row("none", "numerics", [], errors=["box[default]: it died"]),
        row("blind", "history", [], hole="no case looks there"),
    ]


def test_the_matrix_says_what_is_silent_and_what_hangs_by_a_thread(rows: list[Row]) -> None:
    found = matrix(rows)
    assert found.cases == ["box", "hill"]
    assert [row["defect"] for row in found.missed] == ["dem/none"]
    assert found.dirty == []
    assert [row["defect"] for row in found.holes] == ["dem/blind"]
    assert found.silent == [Kind("dem", "hill", "fn", "exact-step")]
    assert [(row["defect"], check) for row, check in found.single] == [("dem/one", GAP)]
    assert [(row["defect"], case) for row, case in found.single_case] == [("dem/some", "hill")]
    assert matrix([row("unchanged", "clean", [GAP]), *rows[1:]]).dirty != []


def test_the_page_shows_it_offline_and_escaped(rows: list[Row]) -> None:
    page = selftest_page(rows)
    assert "1 of 4 defects go unnoticed:</b> dem/none." in page
    assert "one &amp; &lt;b&gt;" in page
    assert "<del>x &lt; 1</del>" in page
    assert "it died" in page
    assert "known hole: no case looks there" in page
    assert "prefers-color-scheme: dark" in page
    assert "@media print" in page
    assert re.findall(r"(?:src|href)=\"(?!#)[^\"]*\"", page) == []
    assert "url(" not in page
    assert len(re.findall(r"<th scope=\"row\"", page)) == len(rows)
    right = selftest_page([row for row in rows if row["caught"] or row["kind"] == "clean"])
    assert "All 3 defects are caught</b>, and the unchanged engines pass" in right


def test_an_id_of_no_check_is_refused(rows: list[Row]) -> None:
    rows[1]["checks"] = ["nonsense"]
    with pytest.raises(ReportError, match="'nonsense' is no id of a check"):
        selftest_page(rows)
