"""Published numbers and curves as checks."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ninedisk.harness import run_case
from ninedisk.harness.api.case import Check, Observed
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.api.params import resolve
from ninedisk.harness.api.registry import BUILTIN_CASES, case_table, get_case
from ninedisk.harness.run.judge import blank_history, compare, judge
from ninedisk.harness.run.plan import plan_matrix
from ninedisk.harness.run.published import check_folder, published_checks
from ninedisk.references.published_values import load_entries, published_values

pytestmark = pytest.mark.usefixtures("fakes")


def variants(case_id: str) -> list[tuple[Any, dict[str, Any]]]:
    case = get_case(case_id)
    rows = [{}, *case.matrix()]
    return [(case, dict(resolve(case, row).params)) for row in rows]


@pytest.mark.parametrize("case_id", BUILTIN_CASES)
def test_every_shipped_value_names_what_the_case_observes(case_id: str) -> None:
    seen = set()
    for case, params in variants(case_id):
        setup = case.build(params)
        observed = case.observe(params, setup, blank_history(setup))
        published_checks(case_id, params, observed, [], None)  # raises where a quantity or a unit does not fit
        seen |= {value.id for value in published_values(case_id, params)}
    entries = {
        entry.fields["id"]
        for entry in load_entries()
        if entry.fields["case"] == case_id and entry.fields["kind"] == "result"
    }
    assert seen == entries, "no variant that runs by default shows these values"


def test_shipped_values_of_cases_that_do_not_exist_are_known() -> None:
    """A value of a case that is not registered would never be shown: only these wait for their case."""
    waiting = {entry.fields["case"] for entry in load_entries()} - set(case_table())
    assert waiting <= {"sliding/quasistatic", "sliding/dynamic"}


def observed(**scalars: float) -> Observed:
    steps = np.arange(3)
    return Observed(
        step=steps, t=0.1 * steps, series={}, scalars={name: ("N", value) for name, value in scalars.items()}
    )


def own(expected: float, atol: float = 0.0, truth: Any = "analytic", **fields: Any) -> Check:
    return Check(
        quantity="fn",
        norm="scalar",
        truth=truth,
        expected=expected,
        atol=atol,
        source="own",
        why="order of dt",
        **fields,
    )


@pytest.fixture
def printed(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A way to plant one published value."""
    from ninedisk.harness.run import published

    def plant(value: float, precision: float = 0.0, contradicted_by: str = "", unit: str = "N") -> None:
        fields = {"id": "planted", "quantity": "fn", "unit": unit, "value": value, "precision": precision}
        record = SimpleNamespace(**fields, source="A.1: words", contradicted_by=contradicted_by)
        monkeypatch.setattr(published, "published_values", lambda *_: [record])

    return plant


@pytest.mark.parametrize(
    ("value", "print_", "checks", "status"),
    [
        (78.542, (78.54, 0.005), [], "pass"),
        (78.546, (78.54, 0.005), [], "fail"),
        (1.0 + 5e-10, (1.0, 0.0), [], "pass"),
        (1.0 + 5e-9, (1.0, 0.0), [], "fail"),
        (1.009, (1.0, 0.0), [own(1.0, 0.01)], "pass"),
        (1.011, (1.0, 0.0), [own(1.0, 0.01)], "fail"),
        (1.009, (1.0, 0.0), [own(1.0, 1e-9, "exact-step"), own(1.0, 0.01)], "pass"),
        (0.95, (1.0, 0.0), [own(0.95, 0.01)], "known-gap"),
        (1.0, (1.0, 0.0), [own(0.95, 0.01)], "gap-closed"),
        (1.2, (1.0, 0.0), [own(1.0, 0.01, gap_reason="off")], "known-gap"),
        (float("nan"), (1.0, 0.0), [own(1.0, 0.01)], "fail"),
    ],
)
def test_tolerance_of_a_printed_number(
    printed: Any, value: float, print_: tuple[float, float], checks: list[Check], status: str
) -> None:
    printed(*print_)
    seen = observed(fn=value)
    (check,) = published_checks("case", {}, seen, checks, None)
    assert judge(check, compare(check, seen))[0] == status
    assert check.why
    assert check.source == "A.1: words"


def test_a_contradicted_value_is_a_known_gap(printed: Any) -> None:
    printed(78.54, 0.005, "the weight is not normal to the plane")
    seen = observed(fn=73.8)
    (check,) = published_checks("case", {}, seen, [own(73.8, 0.1)], None)
    assert judge(check, compare(check, seen)) == ("known-gap", "the weight is not normal to the plane")


def test_wrong_unit_and_quantity_are_errors(printed: Any) -> None:
    printed(1.0, unit="J")
    with pytest.raises(ValueError, match="is in 'J'; the case's 'fn' is in 'N'"):
        published_checks("case", {}, observed(fn=1.0), [], None)
    with pytest.raises(ValueError, match="names 'fn', which the case does not observe; it observes fs"):
        published_checks("case", {}, observed(fs=1.0), [], None)


CURVE = """case = "{case}"
quantity = "{quantity}"
abscissa = "t"
unit = "{unit}"
uncertainty = {uncertainty}
title = "Digitised fall"
source = "somebody 1979, figure 1"
params = {{ a = {a} }}
"""


def digitise(
    folder: Path,
    *,
    case: str = "fake/fall",
    quantity: str = "x",
    unit: str = "m",
    a: float = 2.0,
    uncertainty: float = 0.02,
) -> Path:
    folder.mkdir(exist_ok=True)
    text = CURVE.format(case=case, quantity=quantity, unit=unit, a=a, uncertainty=uncertainty)
    (folder / "fall.toml").write_text(text)
    points = "".join(f"{t / 10},{(t / 10) ** 2 + 0.01}\n" for t in range(2, 9))
    (folder / "fall.csv").write_text("t [s],x [m]\n" + points)
    return folder


def test_a_users_curve_joins(tmp_path: Path) -> None:
    folder = digitise(tmp_path / "mine")
    result = run_case("fake/fall", engine="fake-good", params={"a": 2}, published=folder)
    rows = result.measurements.set_index("truth")
    assert result.status == "pass"
    assert rows.loc["published", "abs_error"] == pytest.approx(0.01)
    assert rows.loc["published", "atol"] == 0.02
    assert rows.loc["published", "source"] == "Digitised fall: somebody 1979, figure 1"
    curves = [curve for curve in result.reference_curves if curve["truth"] == "published"]
    assert [len(curve["step"]) for curve in curves] == [7]
    assert len(run_case("fake/fall", engine="fake-good", params={"a": 1}, published=folder).rows) == 2
    strict = digitise(tmp_path / "strict", uncertainty=0.005)
    assert run_case("fake/fall", engine="fake-good", params={"a": 2}, published=strict).status == "fail"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"quantity": "z"}, "names 'z', which the case does not observe; it observes x, v"),
        ({"unit": "mm"}, "is in 'mm'; the case's 'x' is in 'm'"),
    ],
)
def test_mistakes_of_a_curve_are_found_before_the_run(tmp_path: Path, change: dict[str, str], said: str) -> None:
    cells = plan_matrix(["fake/fall"], ["fake-good"], {})
    with pytest.raises(UsageError, match=said):
        check_folder(digitise(tmp_path / "mine", **change), cells)  # type: ignore[arg-type]


def test_a_curve_that_nothing_matches_is_reported(tmp_path: Path) -> None:
    cells = plan_matrix(["fake/fall"], ["fake-good"], {})
    assert check_folder(digitise(tmp_path / "mine"), cells) == []
    (note,) = check_folder(digitise(tmp_path / "other", a=77.0), cells)
    assert "no variant of this run matches the curve 'Digitised fall'" in note
    (tmp_path / "other" / "fall.csv").unlink()
    with pytest.raises(UsageError, match="--published"):
        check_folder(digitise_broken(tmp_path / "broken"), cells)


def digitise_broken(folder: Path) -> Path:
    digitise(folder)
    (folder / "fall.csv").write_text("t,x\n0,1\n0,2\n")
    return folder
