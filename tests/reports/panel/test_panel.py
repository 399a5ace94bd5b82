"""Ratings: error over tolerance, what counts as worst, names that are safe."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ninedisk.harness.results.schema import STATUSES
from ninedisk.reports.panel import text
from ninedisk.reports.panel.load import Curve, differences
from ninedisk.reports.panel.model import difference_matrix, error_ratio, summarise, worst_first
from ninedisk.reports.panel.text import SHADES, STATUS_MEANING, STATUS_SYMBOL, shade


def row(**changes):
    base = {
        "status": "pass",
        "abs_error": 2.0,
        "atol": 1.0,
        "rtol": 0.1,
        "scale": 10.0,
        "engine": "e",
        "variant": "v",
        "quantity": "q",
    }
    made = {**base, **changes}
    return {**made, "ratio": error_ratio(made), "share": math.nan}


@pytest.mark.parametrize(
    ("changes", "ratio"),
    [
        ({}, 1.0),
        ({"scale": math.nan}, 2.0),
        ({"atol": 0.0, "rtol": 0.0}, math.inf),
        ({"atol": 0.0, "rtol": 0.0, "abs_error": 0.0}, 0.0),
        ({"status": "fail", "abs_error": math.nan}, math.inf),
        ({"status": "pass", "abs_error": math.nan}, math.nan),
        ({"status": "timeout", "abs_error": 0.0}, math.nan),
        ({"status": "no-truth", "abs_error": None, "atol": None, "rtol": None, "scale": None}, math.nan),
    ],
)
def test_error_over_tolerance(changes, ratio):
    assert row(**changes)["ratio"] == pytest.approx(ratio, nan_ok=True)


def test_worst_first():
    rows = [row(abs_error=1.0), row(abs_error=math.nan), row(abs_error=9.0), row(status="fail", abs_error=math.nan)]
    assert [r["ratio"] for r in worst_first(rows)] == pytest.approx([math.inf, 4.5, 0.5, math.nan], nan_ok=True)


def test_known_gaps_do_not_hide_other_errors():
    cell = {"status": "known-gap", "support": "exact"}
    found = summarise([cell], [row(status="known-gap", abs_error=1e9), row(abs_error=3.0)])
    assert found is not None
    assert found.ratio == 1.5
    assert found.gaps == 1


def test_a_cell_shows_a_status_that_nobody_knows():
    cells = [{"status": status, "support": "exact"} for status in ("pass", "unheard-of", "fail")]
    found = summarise(cells, [])
    assert found is not None
    assert found.status == "unheard-of"


def test_every_status_has_a_symbol_of_its_own_and_a_meaning():
    assert set(STATUS_SYMBOL) == set(STATUS_MEANING) == set(STATUSES)
    assert len(set(STATUS_SYMBOL.values())) == len(STATUSES)


def test_shades_bound_the_ratio():
    assert [shade(most) for _, most, _ in SHADES] == [name for name, _, _ in SHADES]
    assert shade(1.0000001) == "out1"
    assert shade(math.nan) == "none"


def test_numbers_as_text():
    assert [text.error(x) for x in (1.23e-13, 0, None, math.nan, math.inf)] == ["1.2e-13", "0", "—", "—", "—"]
    assert {f(x) for f in (text.error, text.ratio) for x in (0.00996, 0.01, 0.0104)} == {"0.01"}
    assert [text.ratio(x) for x in (0.5, 12345.0, 3e-9, math.inf, math.nan)] == ["0.5", "1.2e4", "3.0e-9", "∞", "—"]
    near = (0.996, 0.99996, 1.0 - 1e-16, 1.0, 1.0 + 1e-9, 1.0002, 1.004)
    assert [text.ratio(x) for x in near] == ["0.996", "1", "1", "1", "> 1", "> 1", "1.004"]
    assert [text.seconds(x) for x in (2.0, 0.0123, 4e-6, math.nan)] == ["2 s", "12.3 ms", "4 µs", "—"]
    assert text.number(-math.inf) == "—"
    factors = (1.5, 9.94, 12.3, 12345.0, 1e-3, math.inf)
    assert [text.factor(x) for x in factors] == ["1.50", "9.94", "12", "1.2e4", "1.0e-3", "∞"]


def test_decades_bound_the_error():
    sizes = (0.0, 1e-12, 1.1e-12, 1e-6, 1.1e-6, 0.5, 1.0, 1.1, math.inf, math.nan)
    assert [text.decade(x) for x in sizes] == ["d0", "d0", "d1", "d6", "d7", "d12", "d12", "d13", "d13", "none"]


def test_slugs_stay_in_their_folder_and_apart():
    slugs = text.Slugs()
    made = [
        slugs(name)
        for name in ("nine-disk/compression", "nine-disk compression", "../../etc/passwd", "", "Ω", "a" * 500)
    ]
    assert len(set(made)) == len(made)
    assert all(set(slug) <= set("abcdefghijklmnopqrstuvwxyz0123456789-") and 0 < len(slug) < 80 for slug in made)
    assert slugs("nine-disk/compression") == "nine-disk-compression"


def test_damaged_json_is_empty():
    assert text.decoded("{", dict) == {}
    assert text.decoded("[1]", dict) == {}
    assert text.decoded("", list) == []


def curve(step, value):
    values = np.array(value, dtype=float)
    return Curve(
        np.array(step, dtype=float), np.array(step, dtype=float), values, np.full(len(values), np.nan), "N", ""
    )


def test_difference_of_two_engines_uses_common_steps_and_ignores_nan():
    one, two = curve([0, 1, 2, 3], [0.0, 4.0, np.nan, 9.0]), curve([1, 2, 3], [3.0, 5.0, -10.0])
    assert differences(one, two, 10.0) == pytest.approx(19.0 / 10.0)
    assert differences(one, two, 10.0) == differences(two, one, 10.0)
    assert math.isnan(differences(one, curve([7], [1.0]), 1.0))
    assert differences(curve([0], [0.0]), curve([0], [0.0]), 0.0) == 0.0


def test_round_off_where_nothing_moves_is_no_difference():
    def history(value, expected):
        made = curve([0, 1], value)
        return Curve(made.step, made.t, made.value, np.full(2, expected), "m", "analytic")

    series = {
        ("c", "slides", "a", "x"): history([0.0, 2.0], 2.0),
        ("c", "slides", "b", "x"): history([0.0, 2.0], 2.0),
        ("c", "sticks", "a", "x"): history([0.0, 1e-16], 0.0),
        ("c", "sticks", "b", "x"): history([0.0, -1e-16], 0.0),
        ("other", "v", "a", "x"): history([0.0, 9e9], 9e9),
    }
    names, found = difference_matrix(series, "c", [])
    assert sorted(names) == ["a", "b"]
    assert found["a", "b"] == found["b", "a"]
    assert found["a", "b"].size == pytest.approx(1e-16)
    assert found["a", "b"].variant == "sticks"


def test_round_off_of_what_is_0_in_all_variants_is_held_against_the_size_that_its_checks_state():
    series = {("c", "v", engine, "off"): curve([0, 1], [0.0, value]) for engine, value in (("a", 1e-15), ("b", 4e-15))}
    assert difference_matrix(series, "c", [])[1]["a", "b"].size == pytest.approx(0.75)
    rows = [{"quantity": "off", "scale": scale} for scale in (2.0, math.nan, None)] + [
        {"quantity": "no_history", "scale": 9.0}
    ]
    assert difference_matrix(series, "c", rows)[1]["a", "b"].size == pytest.approx(1.5e-15)


def test_what_no_engine_was_asked_to_run_does_not_decide():
    cells = [{"status": "pass", "support": "exact"}, {"status": "unsupported", "support": "no"}]
    found = summarise(cells, [row()])
    assert (found.status, found.support, found.ran, found.variants) == ("pass", ("exact",), 1, 2)
    assert summarise(cells[1:], []).status == "unsupported"


def test_what_is_wrong_counts_variants():
    """A square joins cells: two checks of one variant that fail are one."""
    cells = [{"status": status, "support": "exact", "variant": name} for name, status in (("a", "fail"), ("b", "pass"))]
    rows = [row(status="fail", variant="a"), row(status="fail", variant="a", quantity="r"), row(variant="b")]
    found = summarise(cells, rows)
    assert (found.fails, found.wrong) == (1, "1 variant fails")


@pytest.mark.parametrize("truth", ["published", "analytic"])
def test_a_square_has_the_status_of_the_stored_cell(truth):
    cell = {"status": "known-gap", "support": "exact", "variant": "k=1"}
    gap = row(status="known-gap", truth=truth, variant="k=1")
    found = summarise([cell], [gap, row(variant="k=1")])
    assert (found.status, found.counts) == ("known-gap", (("known-gap", 1),))
    assert found.wrong == "", "a known gap is no failure"
