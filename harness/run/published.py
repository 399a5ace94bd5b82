"""Published values and digitised curves as checks, for every engine that runs the case."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ninedisk.harness.api.case import Check, Observed
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.results.schema import tolerance
from ninedisk.harness.run.judge import CheckError, blank_history
from ninedisk.references.published_curves import PUBLISHED_FOLDER, PublishedCurve, load_curves
from ninedisk.references.published_values import PublishedValue, published_values

if TYPE_CHECKING:
    from ninedisk.harness.run.plan import Cell
ROUND_OFF = 1e-9
"""Tolerance of an exactly printed value where no other truth says what an engine owes: round-off of 10^6 steps."""

_ROUNDED = ("analytic", "converged", "exact-step", "consensus")
"""Truths that a printed number may round, whose tolerance it borrows: print is of the continuous problem, so that first."""


def published_checks(
    case_id: str, params: Mapping[str, Any], observed: Observed, own: Sequence[Check], folder: Path | None
) -> list[Check]:
    """Checks against the source's numbers, the shipped curves and those of a user's folder.

    A printed number binds to half a unit of its last digit. An engine cannot be held to more than what it owes to the
    truth that the number rounds, hence the tolerance of the case's own check of the same quantity is added; where that
    truth differs from the print by more than both, the print cannot be met and the check carries that reason
    (`Check.gap_reason`).
    """
    checks = [_value_check(value, observed, own) for value in published_values(case_id, params)]
    for curve in [*_curves(PUBLISHED_FOLDER), *(_curves(folder) if folder is not None else [])]:
        if curve.applies_to(case_id, params):
            checks.append(_curve_check(curve, observed))
    return checks


def check_folder(folder: Path | None, cells: Sequence[Cell] = ()) -> list[str]:
    """Find every mistake in a user's curves before anything runs.

    Returns
    -------
    list of str
        A note for each curve that no variant of this run matches.

    Raises
    ------
    UsageError
        If the folder or a file in it is wrong, or a curve names a quantity or unit that its case does not observe.
    """
    if folder is None:
        return []
    try:
        curves = _curves(folder)
    except ValueError as error:
        raise UsageError(f"--published: {error}") from error
    unused = {curve.title: curve for curve in curves}
    for cell in cells:
        fitting = [curve for curve in curves if curve.applies_to(cell.case.id, cell.variant.params)]
        if not fitting or isinstance(cell.setup, Exception):
            continue
        observed = cell.case.observe(cell.variant.params, cell.setup, blank_history(cell.setup))
        for curve in fitting:
            unused.pop(curve.title, None)
            try:
                _curve_check(curve, observed)
            except CheckError as error:
                raise UsageError(f"--published: {error}") from error
    return [
        f"note: no variant of this run matches the curve {curve.title!r} "
        f"(case {curve.case!r}, params {dict(curve.params)})"
        for curve in unused.values()
    ]


@lru_cache(maxsize=8)
def _curves(folder: Path) -> tuple[PublishedCurve, ...]:
    return tuple(load_curves(folder))


def _value_check(value: PublishedValue, observed: Observed, own: Sequence[Check]) -> Check:
    _same_unit(f"published value {value.id!r}", value.quantity, value.unit, observed.scalars)
    rounded = _rounded_truth(value.quantity, own)
    known, of_series = rounded.known if rounded else None, value.quantity.removesuffix("_final")
    atol, why, gap = value.precision, "half a unit of the last printed digit", value.contradicted_by
    if value.precision == 0.0:
        why = "the source states it exactly"
    if rounded is None:
        atol += ROUND_OFF * max(1.0, abs(value.value))
        why += f"; round-off {ROUND_OFF:g}"
    else:
        truth = float(rounded.expected)
        atol += tolerance(rounded.atol, rounded.rtol, max(abs(truth), rounded.scale))
        why += f"; plus what the {rounded.truth} truth allows: {rounded.why}"
        if not gap and abs(truth - value.value) > atol:
            gap = rounded.gap_reason or (
                f"the {rounded.truth} truth is {truth:.9g}, the print says {value.value:.9g} ({rounded.source})"
            )
        gap = gap or rounded.gap_reason
    return Check(
        quantity=value.quantity,
        norm="scalar",
        truth="published",
        expected=value.value,
        uncertainty=value.precision,
        source=value.source,
        atol=atol,
        why=why,
        gap_reason=gap,
        scale=max((check.scale for check in own if check.quantity in (value.quantity, of_series)), default=0.0),
        known=known and replace(known, size=known.size + value.precision),
    )


def _rounded_truth(quantity: str, own: Sequence[Check]) -> Check | None:
    found = [
        check
        for check in own
        if check.quantity == quantity
        and check.norm == "scalar"
        and check.truth in _ROUNDED
        and np.isfinite(float(np.asarray(check.expected)))
    ]
    return min(found, key=lambda check: (bool(check.gap_reason), _ROUNDED.index(check.truth)), default=None)


def _curve_check(curve: PublishedCurve, observed: Observed) -> Check:
    _same_unit(f"published curve {curve.title!r}", curve.quantity, curve.unit, observed.series)
    abscissa = observed.t if curve.abscissa == "t" else observed.step.astype(np.float64)
    return Check(
        quantity=curve.quantity,
        norm="max",
        truth="published",
        expected=curve.at(abscissa),
        uncertainty=curve.uncertainty,
        source=f"{curve.title}: {curve.source}",
        atol=curve.uncertainty,
        why="reading error of the digitised curve",
    )


def _same_unit(what: str, quantity: str, unit: str, known: Mapping[str, tuple[str, Any]]) -> None:
    if quantity not in known:
        raise CheckError(f"{what} names {quantity!r}, which the case does not observe; it observes {', '.join(known)}")
    expected = known[quantity][0]
    if _plain_unit(unit) != _plain_unit(expected):
        raise CheckError(f"{what} is in {unit or '1'!r}; the case's {quantity!r} is in {expected or '1'!r}: convert it")


def _plain_unit(unit: str) -> str:
    return "1" if unit in ("", "-", "1") else unit
