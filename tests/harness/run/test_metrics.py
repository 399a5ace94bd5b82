"""Errors and verdicts of single checks."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from ninedisk.harness.api.case import Check, Headline, KnownDifference, Observed
from ninedisk.harness.results.schema import EXCUSED, STATUSES, WORST_FIRST, row_tolerance, tolerance, worst_status
from ninedisk.harness.run.judge import CheckError, cell_verdict, compare, exit_code, headline_row, judge, largest

NAN = float("nan")
STEP = np.arange(0, 50, 10)


def observed(values: Any = (0.0, 1.0, 2.0, 3.0, 4.0), number: float = 2.0) -> Observed:
    series = {"x": ("m", np.array(values, dtype=float))}
    return Observed(step=STEP, t=0.1 * STEP, series=series, scalars={"n": ("N", number)})


def check(expected: Any, **fields: Any) -> Check:
    number = fields.pop("number", False)
    return Check(
        quantity=fields.pop("quantity", "n" if number else "x"),
        norm="scalar" if number else "max",
        truth=fields.pop("truth", "analytic"),
        expected=expected if number else np.array(expected, dtype=float),
        source="test",
        why="test",
        **fields,
    )


TRUTH = [0.0, 1.0, 2.0, 3.0, 4.0]


def verdict(one: Check, seen: Observed) -> tuple[str, str]:
    return judge(one, compare(one, seen))


def test_worst_step_and_first_divergence() -> None:
    found = compare(check(TRUTH, rtol=0.01), observed([0.0, 1.0, 2.1, 3.0, 4.5]))
    assert (found.worst_step, found.first_divergence_step) == (40, 20)
    assert found.scale == 4.0
    assert found.tolerance == pytest.approx(0.04)
    assert found.abs_error == pytest.approx(0.5)
    assert found.rel_error == pytest.approx(0.125)
    assert (found.value, found.expected, found.unit) == (4.5, 4.0, "m")


def test_the_check_s_own_size_counts_where_the_truth_is_smaller() -> None:
    still = compare(check([0.0] * 5, atol=0.1, scale=8.0), observed())
    assert (still.scale, still.rel_error, still.tolerance) == (8.0, 0.5, 0.1)
    assert compare(check(0.5, number=True, rtol=0.1, scale=8.0), observed()).tolerance == pytest.approx(0.8)
    assert compare(check(TRUTH, scale=1.0), observed()).scale == 4.0
    with pytest.raises(CheckError, match=r"scale = -1\.0 must be >= 0"):
        compare(check(TRUTH, scale=-1.0), observed())


def test_a_known_difference_explains_no_more_than_its_size() -> None:
    known = KnownDifference(finding="engine/words", size=0.5, why="derived")
    told = {1.95: "pass", 1.5: "known-difference", 1.4: "fail", NAN: "fail"}
    for value, status in told.items():
        found, reason = verdict(check(2.0, number=True, atol=0.1, known=known), observed(number=value))
        assert found == status
        assert reason.startswith("engine/words: derived") == (status == "known-difference")
    assert exit_code(["pass", "known-difference"]) == 0


def headline(**fields: Any) -> Headline:
    given = {"name": "way", "use": "sliding", "quantity": "x", "expected": np.array(TRUTH), "source": "test",
             "scale": 8.0, "scale_is": "twice the way", **fields}  # fmt: skip
    return Headline(**given)


def test_headline_is_relative_to_its_own_scale() -> None:
    row = headline_row({"case": "c", "engine": "e"}, headline(), observed([0.0, 1.0, 2.0, 3.0, 5.0]))
    assert (row["rel_error"], row["value"], row["expected"], row["worst_step"]) == (0.125, 5.0, 4.0, 40)
    row = headline_row({}, headline(quantity="n", expected=0.0, scale=4.0), observed(number=2.0))
    assert (row["rel_error"], row["worst_step"], row["unit"]) == (0.5, -1, "N")
    assert math.isnan(headline_row({}, headline(quantity="n", expected=0.0), observed(number=NAN))["rel_error"])


@pytest.mark.parametrize("wrong", [{"scale": 0.0}, {"scale": NAN}, {"use": "fun"}, {"quantity": "nothing"}])
def test_headline_that_makes_no_sense_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(CheckError):
        headline_row({}, headline(**wrong), observed())


def test_tolerance_is_inclusive_and_its_parts_add() -> None:
    assert verdict(check(TRUTH, atol=0.25), observed([0.0, 1.0, 2.25, 3.0, 4.0]))[0] == "pass"
    assert verdict(check(TRUTH, atol=0.125, rtol=0.03125), observed([0.0, 1.0, 2.25, 3.0, 4.0]))[0] == "pass"
    assert verdict(check(TRUTH, atol=0.2), observed([0.0, 1.0, 2.25, 3.0, 4.0]))[0] == "fail"


@pytest.mark.parametrize(
    ("parts", "expected"),
    [
        ((0.5, 0.25, 2.0), 1.0),
        ((0.5, 0.25, math.inf), 0.5),  # the truth has no finite value
        ((0.5, 0.0, math.inf), 0.5),
        ((0.5, 0.25, math.nan), 0.5),  # the truth says nothing
        ((math.nan, math.nan, math.nan), 0.0),  # no check
        ((None, None, None), 0.0),  # columns that an older run lacks
        ((None, 0.25, 2.0), 0.5),
    ],
)
def test_one_tolerance_for_judge_tables_comparisons_and_pages(
    parts: tuple[float, float, float], expected: float
) -> None:
    assert tolerance(*parts) == expected
    assert row_tolerance(dict(zip(("atol", "rtol", "scale"), parts, strict=True))) == expected


def test_infinite_truths_do_not_count_in_the_scale() -> None:
    """Neither when a run is judged nor where the documentation says what is allowed."""
    truth = np.array([0.0, 1.0, math.inf, 3.0, 4.0])
    assert compare(check(truth, rtol=0.5), observed(truth)).tolerance == 2.0
    assert largest(truth) == 4.0
    assert largest(np.array(-3.0)) == 3.0
    assert largest(np.array(math.nan)) == math.inf


def test_window_limits_error_and_scale() -> None:
    found = compare(check(TRUTH, window=(10, 20)), observed([9.0, 1.0, 2.0, 9.0, 9.0]))
    assert (found.abs_error, found.scale, found.spoken) == (0.0, 2.0, 2)
    with pytest.raises(CheckError, match="no sampled step"):
        compare(check(TRUTH, window=(41, 49)), observed())


def test_constant_truth_speaks_in_its_window() -> None:
    found = compare(check(3.0, window=(30, 40)), observed())
    assert (found.abs_error, found.worst_step, found.spoken) == (1.0, 40, 2)


def test_truth_is_silent_where_it_is_nan() -> None:
    found = compare(check([NAN, 1.0, NAN, NAN, NAN]), observed([NAN, 1.0, 7.0, 7.0, 7.0]))
    assert (found.abs_error, found.spoken, found.missing) == (0.0, 1, 0)


def test_no_truth() -> None:
    assert verdict(check([NAN] * 5), observed())[0] == "no-truth"
    assert verdict(check(NAN, number=True), observed())[0] == "no-truth"


def test_missing_number_fails_even_with_a_known_gap() -> None:
    for gap in ("", "known to be off"):
        status, reason = verdict(check(TRUTH, gap_reason=gap), observed([0.0, 1.0, NAN, 3.0, 4.0]))
        assert status == "fail"
        assert reason == "NaN at 1 of 5 compared steps, first at step 20"
        assert verdict(check(1.0, number=True, gap_reason=gap), observed(number=NAN))[0] == "fail"
    assert "does not observe" in verdict(check(TRUTH), observed([NAN] * 5))[1]


def test_known_gap_and_gap_closed() -> None:
    assert verdict(check(3.0, number=True, gap_reason="why"), observed()) == ("known-gap", "why")
    assert verdict(check(2.0, number=True, gap_reason="why"), observed()) == ("gap-closed", "why")


def test_scalar() -> None:
    found = compare(check(-2.5, number=True, rtol=0.1), observed())
    assert (found.abs_error, found.scale, found.tolerance) == (4.5, 2.5, 0.25)
    assert (found.worst_step, found.first_divergence_step) == (-1, -1)


def test_infinite_truth_is_met_by_the_same_infinity_only() -> None:
    never = check(float("inf"), number=True, rtol=0.1)
    assert verdict(never, observed(number=float("inf")))[0] == "pass"
    assert verdict(never, observed(number=1e300))[0] == "fail"
    assert verdict(never, observed(number=float("-inf")))[0] == "fail"


def test_infinite_value_fails() -> None:
    assert verdict(check(TRUTH, rtol=1.0), observed([0.0, 1.0, float("inf"), 3.0, 4.0]))[0] == "fail"


def test_zero_truth_has_no_relative_error() -> None:
    found = compare(check(0.0, number=True, atol=1.0), observed())
    assert np.isnan(found.rel_error)
    assert found.scale == 0.0


def test_uncertainty_is_reported_but_not_added() -> None:
    status, reason = verdict(check(2.5, number=True, atol=0.1, uncertainty=1.0), observed())
    assert status == "fail"
    assert "uncertain by 1" in reason


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (check(TRUTH, quantity="y"), "does not observe; observed: x"),
        (check(1.0, number=True, quantity="x"), "does not observe; observed: n"),
        (check([1.0, 2.0]), r"shape \(2,\)"),
        (check(TRUTH, atol=-1.0), "atol = -1.0 must be >= 0"),
        (check(TRUTH, rtol=NAN), "rtol = nan must be >= 0"),
    ],
)
def test_a_check_that_fits_nothing_is_an_error(wrong: Check, said: str) -> None:
    with pytest.raises(CheckError, match=said):
        compare(wrong, observed())


def test_cell_takes_the_worst() -> None:
    def row(status: str, quantity: str = "x") -> dict[str, str]:
        return {"status": status, "quantity": quantity, "truth": "analytic", "reason": f"because {quantity}"}

    assert cell_verdict([row("pass"), row("pass")]) == ("pass", "")
    rows = [row("pass"), row("fail", "a"), row("known-gap"), row("fail", "b")]
    assert cell_verdict(rows) == ("fail", "a (analytic): because a (and 1 more)")
    assert cell_verdict([])[0] == "no-truth"
    for earlier, later in pairwise(WORST_FIRST):
        assert worst_status([later, earlier, later]) == earlier
    assert set(WORST_FIRST) == set(STATUSES)
    assert worst_status([]) == "", "nothing at all is no pass"
    assert worst_status(["error", "skipped"]) == "skipped", "a word that nobody knows is seen"
    assert exit_code([worst_status(["pass", "skipped"])]) == 1
    assert cell_verdict([row("pass"), row("skipped")])[0] == "skipped"


def test_exit_codes() -> None:
    assert exit_code([]) == 0
    for status in STATUSES:
        wanted = 3 if status in ("error", "timeout") else 0 if status in EXCUSED else 1
        assert exit_code(["pass", status]) == wanted
    assert exit_code(["fail", "error"]) == 3


def test_no_number_is_no_failure_only_where_the_engine_cannot_report_forces() -> None:
    silent, torn = observed([NAN] * 5), observed([0.0, 1.0, NAN, 3.0, 4.0])
    one = check(TRUTH)
    assert judge(one, compare(one, silent))[0] == "fail"
    assert judge(one, compare(one, silent), "none") == ("not-observed", "of contact forces the engine reports none")
    assert judge(one, compare(one, torn), "none")[0] == "fail"  # it has reported some
    assert judge(one, compare(one, observed()), "none")[0] == "pass"
    number = check(2.0, number=True)
    assert judge(number, compare(number, observed(number=NAN)), "normal")[0] == "not-observed"
    rows = [{"quantity": "x", "truth": "analytic", "reason": "", "status": each} for each in ("pass", "not-observed")]
    assert cell_verdict(rows) == ("pass", "")
