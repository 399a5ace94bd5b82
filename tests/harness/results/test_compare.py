"""Comparisons of synthetic runs, and what is written about them."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from types import ModuleType
from xml.etree import ElementTree

import pytest

from ninedisk.harness.results.compare import as_json, compare, counts, headline, junit, markdown, side
from ninedisk.harness.results.schema import EMPTY, HEADLINE_COLUMNS, Change, Comparison
from ninedisk.harness.results.store import Snapshot, as_check, snapshot
from ninedisk.harness.results.timing_rules import WALL_CLOCK

HOSTILE = '<script>alert(1)</script>|`x` [y](http://z) @all #1 &amp; "q"\x1b[31m\nnext'


def worse(found: Comparison) -> list[Change]:
    return [change for change in found.changes if change.verdict == "worse"]


def runs(synthetic: ModuleType, **plan: object) -> list[Snapshot]:
    given = {"runs": 2, "machines": ("AMD EPYC",), "noise": 0.005, "outliers": 0.0, **plan}
    found: list[Snapshot] = synthetic.snapshots(synthetic.Plan(**given))
    return found


def both(held: list[Snapshot]) -> Comparison:
    return compare(side(held[:1]), side(held[1:2]))


def test_unchanged_runs(synthetic: ModuleType) -> None:
    found = both(runs(synthetic))
    assert counts(found) == {**dict.fromkeys(counts(found), 0), "same": 30 * 3 + 30}
    assert headline(found) == "Nothing got worse (120 same)."


def test_a_planted_error_is_found(synthetic: ModuleType) -> None:
    found = both(runs(synthetic, errors={("incline-block", "k=1", "yade", "energy_final"): (1, 10.0)}))
    (change,) = worse(found)
    assert found.changes[0] is change
    assert (change.case, change.variant, change.engine, change.quantity) == (
        "incline-block", "k=1", "yade", "energy_final",
    )  # fmt: skip
    assert change.head == pytest.approx(10.0 * change.base)


def with_headline(run: Snapshot, error: float) -> Snapshot:
    """The run with a headline of this relative error on one cell."""
    key = ("incline-block", "k=1", "yade")
    place = dict(zip(("case", "variant", "engine"), key, strict=True)) | {"case_version": 1}
    row = {name: EMPTY[kind] for name, kind in HEADLINE_COLUMNS.items()} | place
    own = as_check(row | {"headline": "way", "scale_is": "height", "rel_error": error})
    held = snapshot(run.facts, run.cells.values(), [*run.checks[key].values(), own])
    return replace(run, checks={**run.checks, **held.checks})


def test_a_headline_gets_worse_by_its_size_alone(synthetic: ModuleType) -> None:
    """Twice as far from the physics, rounding apart; a run that reports no headlines says nothing of them."""
    old, new = runs(synthetic)
    (change,) = worse(both([with_headline(old, 1e-3), with_headline(new, 3e-3)]))
    assert (change.quantity, change.truth, change.reason) == ("way", "headline", "3 times the error")
    assert worse(both([with_headline(old, 1e-12), with_headline(new, 9e-8)])) == []
    assert worse(both([with_headline(old, 1e-3), with_headline(new, 1.9e-3)])) == []
    assert counts(both([old, with_headline(new, 1e-3)])) == counts(both([old, new]))


def test_a_planted_slowdown_is_found(synthetic: ModuleType) -> None:
    found = both(runs(synthetic, timings={("slip-to-roll", "k=0", "dem"): (1, 1.3)}))
    (change,) = worse(found)
    assert (change.case, change.variant, change.engine, change.quantity) == ("slip-to-roll", "k=0", "dem", "stepping")
    assert change.head / change.base == pytest.approx(1.3, rel=0.03)


def test_under_noise_more_runs_find_it(synthetic: ModuleType) -> None:
    plan = {"runs": 30, "noise": 0.10, "outliers": 0.02, "timings": {("slip-to-roll", "k=0", "dem"): (15, 1.4)}}
    held = runs(synthetic, **plan)
    found = compare(side(held[:15]), side(held[15:]))
    assert [(c.case, c.variant, c.engine, c.kind) for c in worse(found)] == [("slip-to-roll", "k=0", "dem", "timing")]
    assert (found.base_runs, found.head_runs) == (15, 15)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(3))
def test_noise_raises_no_alarm(synthetic: ModuleType, seed: int) -> None:
    """50 unchanged runs on two drifting machines: each against the one before it on its machine, and in two halves."""
    held = synthetic.snapshots(synthetic.Plan(runs=50, seed=seed))
    pairs = [compare(side([old]), side([new])) for old, new in zip(held, held[2:], strict=False)]
    assert [worse(found) for found in pairs] == [[]] * 48
    assert worse(compare(side(held[0:24:2]), side(held[24:50:2]))) == []


def test_a_cell_that_breaks_is_worse_and_one_that_cannot_run_is_lost(synthetic: ModuleType) -> None:
    cells = {
        ("incline-block", "k=0", "yade"): (1, "error", "exit code -11"),
        ("incline-block", "k=1", "yade"): (1, "timeout", "stopped after 60 s"),
        ("incline-block", "k=0", "dem"): (1, "unsupported", "it lacks walls"),
        ("incline-block", "k=0", "pymunk"): (1, "not-installed", "pip install pymunk"),
    }
    held = runs(synthetic, cells=cells)
    found = both(held)
    assert {(c.variant, c.engine, c.reason) for c in worse(found)} == {
        ("k=0", "yade", "exit code -11"),
        ("k=1", "yade", "stopped after 60 s"),
    }
    assert counts(found)["lost"] == 2
    back = compare(side(held[1:]), side(held[:1]))
    assert worse(back) == []
    assert counts(back)["better"] == 2


def test_other_case_versions_are_not_comparable(synthetic: ModuleType) -> None:
    plan = {"versions": {"incline-block": 1}, "errors": {("incline-block", "k=0", "dem", "energy_final"): (1, 99.0)}}
    found = both(runs(synthetic, **plan))
    reported = [change for change in found.changes if change.verdict == "not-comparable"]
    assert {(c.case, c.variant, c.engine) for c in reported} == {
        ("incline-block", v, e) for v in ("k=0", "k=1") for e in ("dem", "yade", "pymunk")
    }
    assert {c.reason for c in reported} == {"not comparable: the case has version 1 in BASE, 2 in HEAD"}
    assert worse(found) == []
    assert not any(c.case == "incline-block" for c in found.changes if c.verdict != "not-comparable")


def test_timings_of_other_machines_are_not_comparable(synthetic: ModuleType) -> None:
    plan = {"machines": ("AMD EPYC", "Intel Xeon"), "timings": {("slip-to-roll", "k=0", "dem"): (1, 9.0)}}
    found = both(runs(synthetic, **plan, errors={("incline-block", "k=1", "yade", "energy_final"): (1, 30.0)}))
    assert [c.kind for c in worse(found)] == ["error"], "errors are compared across machines, timings are not"
    (reported,) = [change for change in found.changes if change.verdict == "not-comparable"]
    assert reported.kind == "timing"
    assert "AMD EPYC, 2 cores, Linux x86_64 and of Intel Xeon" in reported.reason


def test_missing_and_additional_cells_and_checks(synthetic: ModuleType) -> None:
    base, head = runs(synthetic)
    key = ("incline-block", "k=0", "dem")
    fewer = replace(head, cells={k: v for k, v in head.cells.items() if k != key})
    found = compare(side([base]), side([fewer]))
    assert [(c.verdict, c.kind) for c in found.changes if c.verdict != "same"] == [("lost", "cell")]
    found = compare(side([fewer]), side([base]))
    assert [(c.verdict, c.kind) for c in found.changes if c.verdict != "same"] == [("new", "cell")]
    checks = {k: dict(list(v.items())[:2]) if k == key else v for k, v in head.checks.items()}
    found = compare(side([base]), side([replace(head, checks=checks)]))
    assert [(c.verdict, c.kind, c.quantity) for c in found.changes if c.verdict != "same"] == [
        ("lost", "error", "energy_final")
    ]


def test_a_machine_that_slows_down_is_no_regression(synthetic: ModuleType) -> None:
    base, head = runs(synthetic)
    for names, reported in ((("cpu_s", "reference_s"), []), (("cpu_s",), [("suspect", "all timings")])):
        cells = {k: {**c, **{name: 1.6 * c[name] for name in names}} for k, c in head.cells.items()}
        found = compare(side([base]), side([replace(head, cells=cells)]))
        assert [(c.verdict, c.case) for c in found.changes if c.verdict != "same"] == reported


def test_wall_clock_times_of_old_stores_are_suspect_at_most(synthetic: ModuleType) -> None:
    held = runs(synthetic, cpu=False, timings={("slip-to-roll", "k=0", "dem"): (1, 70.0)})
    found = both(held)
    (change,) = [change for change in found.changes if change.verdict != "same"]
    assert (change.verdict, change.quantity, counts(found)["worse"]) == ("suspect", WALL_CLOCK, 0)
    mixed = compare(side(held[:1]), side(runs(synthetic)[1:]))
    assert {change.quantity for change in mixed.changes if change.kind == "timing"} == {WALL_CLOCK}


def test_hostile_text_is_no_markup(synthetic: ModuleType) -> None:
    plan = {
        "cells": {(HOSTILE, "k=0", HOSTILE): (1, "error", HOSTILE)},
        "cases": (HOSTILE,),
        "engines": {HOSTILE: HOSTILE},
    }
    found = both(runs(synthetic, **plan))
    found = replace(found, head=replace(found.head, commit=HOSTILE, machine=HOSTILE))
    text = markdown(found)
    table = [line for line in text.splitlines() if line.startswith("|")]
    assert "next" in text
    own = ("<details><summary>", "</details>", "</summary>")
    active = re.compile(r"<[a-z/]|`|\]\(|@all|(?<!&)#1|\x1b|http://")
    assert not active.search(re.sub("|".join(own), "", text))
    assert {line.count("|") for line in table} == {7, 11}
    root = ElementTree.fromstring(junit(found))
    assert root.get("failures") == "1"
    (failure,) = root.iter("failure")
    assert "<script>alert(1)</script>" in str(failure.get("message"))
    assert json.loads(as_json(found))["changes"][0]["case"] == HOSTILE


def test_junit_counts(synthetic: ModuleType) -> None:
    plan = {"errors": {("incline-block", "k=1", "yade", "energy_final"): (1, 10.0)}, "versions": {"slip-to-roll": 1}}
    found = both(runs(synthetic, **plan))
    root = ElementTree.fromstring(junit(found))
    tests = list(root.iter("testcase"))
    assert int(root.get("tests", "")) == len(tests) == len(found.changes)
    assert len(list(root.iter("failure"))) == int(root.get("failures", "")) == 1
    assert len(list(root.iter("skipped"))) == int(root.get("skipped", "")) == 6


def test_json_has_every_change_and_no_bare_nan(synthetic: ModuleType) -> None:
    found = both(runs(synthetic, cells={("incline-block", "k=0", "yade"): (1, "error", "gone")}))
    data = json.loads(as_json(found), parse_constant=pytest.fail)
    assert len(data["changes"]) == len(found.changes)
    assert data["changes"][0]["base"] is None
    assert data["counts"]["worse"] == 1
    assert data["head"]["commit"] == synthetic.commit(1)
