"""Hostile names, missing numbers, unknown words, cases that nobody ran: the report is still right and safe."""

from __future__ import annotations

import json
import math
import re

import pytest

from ninedisk.harness.results.figures import Figure, figures_to_text
from ninedisk.reports.build import build_report

HOSTILE = "../../../<script>alert('x')</script>"


def pages(out):
    """Every page that shows something of the store, by its path."""
    return {
        path.relative_to(out).as_posix(): path.read_text(encoding="utf-8")
        for path in out.rglob("*.html")
        if path.name != "statuses.html"
    }


def test_hostile_names_run_nothing_and_stay_inside(tmp_path, write, small):
    tables = small(
        engine=HOSTILE,
        case=HOSTILE,
        engine_name=HOSTILE,
        engine_version=HOSTILE,
        engine_licence=HOSTILE,
        engine_runs=HOSTILE,
        case_title=HOSTILE,
        case_source=HOSTILE,
        case_requirement=HOSTILE,
        case_figures=figures_to_text(
            [
                Figure(number=HOSTILE, title=HOSTILE, compare=HOSTILE, shows=HOSTILE, allows=HOSTILE),
                Figure(kind="setup", number=HOSTILE),
            ]
        ),
        reason=HOSTILE,
        support=HOSTILE,
        status=HOSTILE,
        notes=json.dumps([HOSTILE]),
        settings=json.dumps({HOSTILE: HOSTILE}),
        missing=json.dumps([HOSTILE]),
        why=HOSTILE,
        source=HOSTILE,
        quantity=HOSTILE,
        unit=HOSTILE,
        truth=HOSTILE,
        norm=HOSTILE,
    )
    for row in tables["series"] + tables["references"]:
        row |= {"quantity": "$\\" + HOSTILE, "unit": HOSTILE}
        row["label" if "label" in row else "truth"] = HOSTILE
    tables["claims"] = [
        {
            "claim": HOSTILE,
            "place": HOSTILE,
            "text": HOSTILE,
            "case": HOSTILE,
            "engine": HOSTILE,
            "verdict": "contradicted",
            "evidence": HOSTILE,
            "derivation": json.dumps([HOSTILE]),
        }
    ]
    folder = write(tmp_path / "store", "a", tables)
    about = json.loads((folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps({**about, "provenance": {HOSTILE: HOSTILE}, "argv": [HOSTILE]}))
    before = set(tmp_path.rglob("*"))
    out = build_report(tmp_path / "store", tmp_path / "deep" / "er" / "out").parent
    assert all(path.is_relative_to(tmp_path / "deep") for path in set(tmp_path.rglob("*")) - before)
    assert {path.name for path in (tmp_path / "deep" / "er").iterdir()} == {"out"}
    found = pages(out)
    assert len(found) == 4
    for name, html in found.items():
        tags = re.findall(r"<script[^>]*>", html, re.IGNORECASE)
        assert all(re.fullmatch(r'<script src="[a-z0-9./-]+\.js"( data-numbers)? defer>', tag) for tag in tags), name
        assert "&lt;script&gt;" in html, name
    for path in (out / "data").iterdir():
        assert re.fullmatch(r'ninedisk\.load\("[A-Za-z0-9+/=]+"\);\n', path.read_text(encoding="utf-8"))
    for path in (out / "figures").glob("*.svg"):
        assert b"<script" not in path.read_bytes()


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
def test_numbers_that_are_none_show_as_a_dash(tmp_path, write, small, number):
    names = ("value", "expected", "uncertainty", "abs_error", "rel_error", "scale", "atol", "rtol")
    tables = small(status="fail", advance_s=number, **dict.fromkeys(names, number))
    for row in tables["series"] + tables["references"]:
        row |= {key: number for key in ("value", "expected") if key in row}
    write(tmp_path / "store", "a", tables)
    for html in pages(build_report(tmp_path / "store", tmp_path / "out").parent).values():
        shown = re.sub(r"<[^>]*>", " ", html)
        assert "—" in shown
        assert not re.search(r"\b(nan|inf|None)\b", shown, re.IGNORECASE), shown


def test_unknown_words_are_shown_as_they_are(tmp_path, write, small):
    tables = small(status="half-done", support="perhaps", truth="oracle", norm="median")
    write(tmp_path / "store", "a", tables)
    html = pages(build_report(tmp_path / "store", tmp_path / "out").parent)
    assert "‼ half-done" in html["index.html"]
    assert "perhaps" in html["index.html"]
    assert "oracle" in html["case/demo-one.html"]


def test_case_that_nobody_ran_says_why(tmp_path, write, small):
    why = "install it with: apt install yade"
    empty = dict.fromkeys(("value", "expected", "abs_error", "scale"), math.nan)
    tables = small(status="not-installed", reason=why, quantity="", truth="", **empty)
    tables["series"], tables["references"] = [], []
    write(tmp_path / "store", "a", tables)
    html = pages(build_report(tmp_path / "store", tmp_path / "out").parent)
    assert why in html["case/demo-one.html"]
    assert "No quantity of this case was measured" in html["case/demo-one.html"]
    assert why in html["engine/dem.html"]
    assert "∅ not-installed" in html["index.html"]


def test_damaged_json_columns_do_not_stop_the_report(tmp_path, write, small):
    write(
        tmp_path / "store",
        "a",
        small(setup="{", frames='{"step": [1], "x": [["a"]]}', notes="7", settings="[]", params="{"),
    )
    assert "Demo" in build_report(tmp_path / "store", tmp_path / "out").read_text(encoding="utf-8")
