"""From a history to pass or fail: its form, the errors of observed quantities against truths, statuses of checks and cells.

The rows and curves that are stored of a cell are made here too, where their numbers are.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.harness.api.boxes import has_boxes
from ninedisk.harness.api.case import Check, Headline, Observed, Setup
from ninedisk.harness.api.engine import EngineError, Timings
from ninedisk.harness.api.text import found_and_expected, with_unit
from ninedisk.harness.results.schema import (
    HEADLINE_COLUMNS,
    MEASUREMENT_COLUMNS,
    USES,
    Row,
    tolerance,
    worst_status,
)
from ninedisk.harness.results.statuses import TABLE
from ninedisk.harness.results.tables import CurveColumns, complete

FloatArray = NDArray[np.float64]

TRUTH_PREFERENCE = ("exact-step", "analytic", "converged", "published", "consensus")
"""Which truth a series shows beside its values: the first of these that speaks about the quantity."""


class CheckError(ValueError):
    """A check that does not fit the observed quantities; the mistake is the case's, not the engine's."""


def blank_history(setup: Setup) -> History:
    """A history of the right shapes that holds no number at all."""
    steps = setup.numerics.sampled_steps()
    return History.empty(
        steps,
        np.asarray(steps * setup.numerics.dt, dtype=np.float64),
        n_disks=len(setup.scene.bodies),
        n_walls=len(setup.scene.walls),
        pairs=tuple(setup.scene.check_pair(pair) for pair in setup.watch),
        dimension=setup.scene.dimension,
        boxes=has_boxes(setup.scene),
    )


def check_history(history: History, setup: Setup) -> None:
    """Refuse an answer of the wrong form, before anything is computed from it.

    Raises
    ------
    EngineError
        If an array's shape or the sampled steps are not those that were asked for, times are wrong, or a
        number is infinite.
    """
    wanted = blank_history(setup)
    for name in ("step", "t", "x", "v", "angle", "omega", "gap", "fn", "fs", "wall_point", "wall_angle", "wall_force"):
        array, want = np.asarray(getattr(history, name)), getattr(wanted, name)
        if array.shape != want.shape:
            raise EngineError(f"the engine answered {name} of shape {array.shape} instead of {want.shape}")
        if array.dtype.kind not in "iuf":
            raise EngineError(f"the engine answered {name} of type {array.dtype} instead of numbers")
        if np.isinf(array).any():
            row = int(np.argwhere(np.isinf(array))[0][0])
            raise EngineError(f"the engine answered an infinite {name} at step {int(wanted.step[row])}")
    if not np.array_equal(history.step, wanted.step):
        raise EngineError("the engine sampled other steps than it was asked for")
    # Engines may accumulate t by adding dt: round-off of n additions, far below a step.
    if not np.allclose(history.t, wanted.t, rtol=1e-6, atol=1e-6 * setup.numerics.dt):
        raise EngineError("the engine's times are not its steps times dt")
    if history.pairs != wanted.pairs:
        raise EngineError(f"the engine watched the contacts {history.pairs} instead of {wanted.pairs}")


LEAST_STEP, TICK = 5e-9, 1e-6
"""Seconds: no step takes less, a chain of some ten dependent operations of four cycles each; and what a clock may be off by."""

CLOCK_RATE, CLOCK_TICK = 0.1, 1.0
"""What a time by the engine's own clock may exceed ours by: this share of it, since clocks are set right while they run, and these
seconds, since some count whole ones."""


def check_timings(timings: Timings, numerics: Numerics, took: float) -> None:
    """Refuse a time that the steps cannot have taken: less than any machine needs, or more than the whole run took.

    ``took`` are the wall-clock seconds of the call of the engine, measured here; inf if they are not known.

    Raises
    ------
    EngineError
        If ``advance`` and a tick of the clock are less than the steps take at the very least, or more than ``took``.
    """
    least = LEAST_STEP * numerics.n_steps
    if not timings.advance + TICK >= least:
        raise EngineError(
            f"the engine answered timings.advance = {timings.advance:g} s for {numerics.n_steps} steps, which take {least:.2g} s "
            "at the very least: it is the wall-clock time of the steps themselves"
        )
    if timings.advance > (1.0 + CLOCK_RATE) * took + CLOCK_TICK:
        raise EngineError(
            f"the engine answered timings.advance = {timings.advance:g} s, and its whole run took {took:.3g} s: it is the "
            "wall-clock time of the steps in seconds, of no other unit and not summed over threads"
        )


@dataclass(frozen=True, kw_only=True)
class Deviation:
    """A check, measured.

    ``value`` and ``expected`` are those at the worst step; ``scale`` is the largest ``|expected|`` of the window, or the check's own
    where that is larger, and ``tolerance = atol + rtol scale``. ``spoken`` counts the steps at which the truth says something,
    ``missing`` those among them at which the engine gives no number.
    """

    unit: str
    value: float
    expected: float
    abs_error: float
    rel_error: float
    scale: float
    tolerance: float
    worst_step: int
    first_divergence_step: int
    spoken: int
    missing: int


def compare(check: Check, observed: Observed) -> Deviation:
    """Measure one check.

    Raises
    ------
    CheckError
        If the quantity is not observed, the truth has the wrong shape, or a tolerance is negative or not finite.
    """
    for name in ("atol", "rtol", "uncertainty", "scale"):
        if not getattr(check, name) >= 0.0:
            raise CheckError(f"check of {check.quantity!r}: {name} = {getattr(check, name)!r} must be >= 0")
    if check.norm == "scalar":
        return _compare_scalar(check, observed)
    return _compare_series(check, observed)


def expected_series(check: Check, observed: Observed) -> FloatArray:
    """The truth of a ``"max"`` check at each sampled step, shape (s,); a constant speaks within the window only."""
    shape = observed.step.shape
    expected = np.asarray(check.expected, dtype=np.float64)
    if expected.ndim == 0:
        return np.where(_window(check, observed), float(expected), np.nan)
    if expected.shape != shape:
        raise CheckError(
            f"check of {check.quantity!r}: the truth has shape {expected.shape}, the series has shape {shape}"
        )
    return expected


def _window(check: Check, observed: Observed) -> NDArray[np.bool_]:
    if check.window is None:
        return np.ones(observed.step.shape, dtype=np.bool_)
    first, last = check.window
    inside: NDArray[np.bool_] = (observed.step >= first) & (observed.step <= last)
    if not inside.any():
        raise CheckError(f"check of {check.quantity!r}: no sampled step lies in its window {first}..{last}")
    return inside


def _difference(value: FloatArray, expected: FloatArray) -> FloatArray:
    """``|value - expected|``, zero where both are the same infinity."""
    with np.errstate(invalid="ignore"):
        return np.where(value == expected, 0.0, np.abs(value - expected))


def _relative(error: float, scale: float) -> float:
    return error / scale if scale > 0.0 and np.isfinite(scale) else float("nan")


def largest(expected: FloatArray) -> float:
    """Largest finite ``|expected|``, what `Check.rtol` refers to; infinite where none is finite."""
    finite = np.abs(expected[np.isfinite(expected)])
    return float(finite.max()) if finite.size else float("inf")


def _compare_scalar(check: Check, observed: Observed) -> Deviation:
    if check.quantity not in observed.scalars:
        raise CheckError(_not_observed(check, list(observed.scalars)))
    unit, value = observed.scalars[check.quantity]
    expected = np.asarray(check.expected, dtype=np.float64)
    if expected.ndim:
        raise CheckError(f"check of {check.quantity!r}: a scalar needs one number, not shape {expected.shape}")
    truth, value = float(expected), float(value)
    speaks = not np.isnan(truth)
    scale = max(abs(truth), check.scale) if speaks else float("nan")
    error = float(_difference(np.array(value), np.array(truth)))
    return Deviation(
        unit=unit,
        value=value,
        expected=truth,
        abs_error=error,
        rel_error=_relative(error, scale),
        scale=scale,
        tolerance=tolerance(check.atol, check.rtol, scale),
        worst_step=-1,
        first_divergence_step=-1,
        spoken=int(speaks),
        missing=int(speaks and bool(np.isnan(value))),
    )


def _compare_series(check: Check, observed: Observed) -> Deviation:
    if check.quantity not in observed.series:
        raise CheckError(_not_observed(check, list(observed.series)))
    unit, series = observed.series[check.quantity]
    value = np.asarray(series, dtype=np.float64)
    if value.shape != observed.step.shape:
        raise CheckError(f"series {check.quantity!r} has shape {value.shape}; the samples are {observed.step.shape}")
    expected = expected_series(check, observed)
    speaks = _window(check, observed) & ~np.isnan(expected)
    missing = speaks & np.isnan(value)
    nan = float("nan")
    if not speaks.any():
        return Deviation(
            unit=unit, value=nan, expected=nan, abs_error=nan, rel_error=nan, scale=nan, tolerance=check.atol,
            worst_step=-1, first_divergence_step=-1, spoken=0, missing=0,
        )  # fmt: skip
    scale = max(largest(expected[speaks]), check.scale)
    allowed = tolerance(check.atol, check.rtol, scale)
    error = np.where(speaks, _difference(value, expected), 0.0)
    beyond = speaks & ~(error <= allowed)
    worst = int(np.argmax(np.where(speaks, error, -1.0)))  # the first missing value, if any: argmax ranks NaN highest
    return Deviation(
        unit=unit,
        value=float(value[worst]),
        expected=float(expected[worst]),
        abs_error=float(error[worst]),
        rel_error=_relative(float(error[worst]), scale),
        scale=scale,
        tolerance=allowed,
        worst_step=int(observed.step[worst]),
        first_divergence_step=int(observed.step[np.argmax(beyond)]) if beyond.any() else -1,
        spoken=int(speaks.sum()),
        missing=int(missing.sum()),
    )


def _not_observed(check: Check, known: list[str]) -> str:
    return (
        f"the {check.truth} check of {check.quantity!r} (norm {check.norm}) names a quantity that the case does not "
        f"observe; observed: {', '.join(known) or 'none'}"
    )


def motion_is_whole(history: History) -> bool:
    """Whether positions, velocities, spins and gaps have numbers: then one that is missing comes from forces."""
    return all(np.isfinite(each).all() for each in (history.x, history.v, history.omega, history.gap))


def judge(check: Check, deviation: Deviation, contact_forces: str = "all") -> tuple[str, str]:
    """Status and reason of one check, of an engine that reports these contact forces (`EngineInfo.contact_forces`).

    A number that is missing where the truth speaks is a failure even for a check with a known gap: the gap explains a
    difference, not the absence of a value.
    """
    if deviation.spoken == 0:
        return "no-truth", f"the {check.truth} truth says nothing here"
    if deviation.missing == deviation.spoken and contact_forces != "all":
        return "not-observed", f"of contact forces the engine reports {contact_forces}"
    if deviation.missing:
        return "fail", _missing(deviation)
    inside = deviation.abs_error <= deviation.tolerance
    if check.known is not None and not inside and deviation.abs_error <= check.known.size:
        return "known-difference", f"{check.known.finding}: {check.known.why}"
    if check.gap_reason:
        return ("gap-closed" if inside else "known-gap"), check.gap_reason
    return ("pass", "") if inside else ("fail", _beyond(check, deviation))


def _missing(deviation: Deviation) -> str:
    if deviation.spoken == 1:
        return "the engine gives no number (NaN)"
    if deviation.missing == deviation.spoken:
        return "the engine does not observe this quantity: every value is NaN"
    return f"NaN at {deviation.missing} of {deviation.spoken} compared steps, first at step {deviation.worst_step}"


def _beyond(check: Check, deviation: Deviation) -> str:
    found, expected = found_and_expected(deviation.value, deviation.expected)
    text = f"found {found}, expected {expected}: "
    text += f"error {with_unit(f'{deviation.abs_error:.3g}', deviation.unit)} exceeds the tolerance {deviation.tolerance:.3g}"
    if deviation.first_divergence_step >= 0:
        text += f"; first beyond it at step {deviation.first_divergence_step}, worst at {deviation.worst_step}"
    if check.uncertainty > deviation.tolerance:
        text += f" (the truth itself is uncertain by {check.uncertainty:.3g})"
    return text


def measurement_row(common: Mapping[str, Any], check: Check, observed: Observed, contact_forces: str = "all") -> Row:
    """Compare, judge, and write the row of `schema.MEASUREMENT_COLUMNS`; ``contact_forces`` as in `judge`."""
    found = compare(check, observed)
    status, reason = judge(check, found, contact_forces)
    return complete(
        {
            **common,
            "quantity": check.quantity,
            "unit": found.unit,
            "norm": check.norm,
            "truth": check.truth,
            "source": check.source,
            "value": found.value,
            "expected": found.expected,
            "uncertainty": check.uncertainty,
            "abs_error": found.abs_error,
            "rel_error": found.rel_error,
            "scale": found.scale,
            "atol": check.atol,
            "rtol": check.rtol,
            "why": check.why,
            "worst_step": found.worst_step,
            "first_divergence_step": found.first_divergence_step,
            "status": status,
            "reason": reason,
            "finding": check.known.finding if check.known else "",
            "known_size": check.known.size if check.known else float("nan"),
        },
        MEASUREMENT_COLUMNS,
    )


def headline_row(common: Mapping[str, Any], headline: Headline, observed: Observed) -> Row:
    """Measure a headline and write the row of `schema.HEADLINE_COLUMNS`.

    Raises
    ------
    CheckError
        If its quantity is not observed, its truth has the wrong shape, its scale is not positive or its use unknown.
    """
    if not (np.isfinite(headline.scale) and headline.scale > 0.0):
        raise CheckError(f"headline {headline.name!r}: scale = {headline.scale!r} must be finite and > 0")
    if headline.use not in USES:
        raise CheckError(f"headline {headline.name!r}: use = {headline.use!r} must be one of {', '.join(USES)}")
    found = compare(
        Check(
            quantity=headline.quantity,
            norm="max" if headline.quantity in observed.series else "scalar",
            truth="analytic",
            expected=headline.expected,
            source=headline.source,
            why="",
            window=headline.window,
        ),
        observed,
    )
    return complete(
        {
            **common,
            "headline": headline.name,
            "use": headline.use,
            "quantity": headline.quantity,
            "unit": found.unit,
            "source": headline.source,
            "value": found.value,
            "expected": found.expected,
            "scale": headline.scale,
            "scale_is": headline.scale_is,
            "rel_error": found.abs_error / headline.scale,
            "worst_step": found.worst_step,
        },
        HEADLINE_COLUMNS,
    )


def best_truth(quantity: str, checks: Sequence[Check], observed: Observed) -> tuple[NDArray[np.float64], str]:
    """The preferred truth about a series and its kind; NaN and ``""`` where none speaks.

    A truth that is itself known to be off (``gap_reason``) comes after every other.
    """
    candidates = [check for check in checks if check.quantity == quantity and check.norm == "max"]
    for check in sorted(candidates, key=lambda c: (bool(c.gap_reason), TRUTH_PREFERENCE.index(c.truth))):
        expected = expected_series(check, observed)
        if not np.isnan(expected).all():
            return expected, check.truth
    return np.full(observed.step.shape, np.nan), ""


def curves(names: tuple[str, str, str], observed: Observed, checks: Sequence[Check]) -> list[CurveColumns]:
    """Columns of `schema.SERIES_COLUMNS` of each observed series; ``names`` are case, variant and engine."""
    found: list[CurveColumns] = []
    for quantity, (unit, value) in observed.series.items():
        expected, truth = best_truth(quantity, checks, observed)
        found.append(
            dict(zip(("case", "variant", "engine"), names, strict=True))
            | {
                "quantity": quantity,
                "unit": unit,
                "step": observed.step,
                "t": observed.t,
                "value": np.asarray(value, dtype=np.float64),
                "expected": expected,
                "truth": truth,
            }
        )
    return found


def reference_curves(names: tuple[str, str], observed: Observed, checks: Sequence[Check]) -> list[CurveColumns]:
    """Columns of `schema.REFERENCE_COLUMNS` of the truths that are arrays, where they speak; ``names`` are case and variant.

    Consensus truths stay out: they are computed for one engine's conventions and do not belong to the variant.
    """
    found: list[CurveColumns] = []
    for check in checks:
        if check.norm != "max" or check.truth == "consensus" or np.ndim(check.expected) == 0:
            continue
        expected = expected_series(check, observed)
        speaks = ~np.isnan(expected)
        found.append(
            dict(zip(("case", "variant"), names, strict=True))
            | {
                "label": f"{check.truth}: {check.source}",
                "truth": check.truth,
                "source": check.source,
                "quantity": check.quantity,
                "unit": observed.series[check.quantity][0],
                "step": observed.step[speaks],
                "t": observed.t[speaks],
                "value": expected[speaks],
                "uncertainty": check.uncertainty,
            }
        )
    return found


def cell_verdict(measurements: Iterable[Mapping[str, Any]]) -> tuple[str, str]:
    """Status and reason of a cell: the worst of its measurements decides (`schema.WORST_FIRST`)."""
    rows = list(measurements)
    if not rows:
        return "no-truth", "no truth binds this engine on this variant"
    worst = worst_status(str(row["status"]) for row in rows)
    named = [f"{row['quantity']} ({row['truth']}): {row['reason']}" for row in rows if row["status"] == worst]
    if worst == "pass":
        return worst, ""
    more = f" (and {len(named) - 1} more)" if len(named) > 1 else ""
    return worst, named[0] + more


def exit_code(statuses: Iterable[str]) -> int:
    """Exit code of a run over its cells' and measurements' statuses: 3 crash, 1 failed check, 0 all pass or excused."""
    return max((TABLE[status].exit_code if status in TABLE else 1 for status in set(statuses)), default=0)
