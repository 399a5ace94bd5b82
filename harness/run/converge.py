"""Orders of convergence: one variant of a case on one engine, its step halved again and again."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.harness.api.case import Case, Check, Observed
from ninedisk.harness.api.engine import Engine, EngineInfo
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.engines.spring import contact_steps
from ninedisk.harness.results.tables import CaseResult, Row
from ninedisk.harness.run.converge_rule import RULES, VERDICTS, judge_order
from ninedisk.harness.run.converge_scheme import expected_order, round_off, step_name
from ninedisk.harness.run.judge import expected_series
from ninedisk.harness.run.plan import Cell, plan_case
from ninedisk.harness.run.runner import run_cell

FloatArray = NDArray[np.float64]
Progress = Callable[[int, int, str], None]

CONTINUOUS = ("analytic", "converged")
"""Truths of the continuous problem, the better one first."""

FEWEST_HALVINGS, MOST_HALVINGS = 3, 12
"""Three differences are the fewest that can agree or not; twelve halvings make a run four thousand times as long."""

SAME = 1e-9
"""Relative change between levels from which on a truth depends on the step: beyond the round-off of its closed form."""


class BrokenLevelError(RuntimeError):
    """A level's run failed, crashed or ran out of time; there is no order to be had."""


def converge(
    case: Case | str,
    *,
    engine: Engine | str = "dem",
    params: Mapping[str, Any] | None = None,
    options: Mapping[str, Any] | None = None,
    halvings: int = 5,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Measure orders of convergence.

    Parameters
    ----------
    case, engine, params, options
        As `ninedisk.harness.run.matrix.run_case` takes them; the step that they set is the coarsest.
    halvings : int
        How often the step is halved, 3..12.
    progress : callable, optional
        Called with (levels done, levels in all, name of the level that begins).

    Returns
    -------
    dict
        ``case, variant, params, engine, engine_name, engine_version, scheme``; ``step`` (name), ``unit`` and ``steps``
        (sizes, coarsest first); ``expected`` (None: none declared) and ``expected_why``; ``rules``; ``rows``, one a
        quantity, worst verdict first, with ``quantity, unit, norm, truth`` (empty: none independent of the step)``, source,
        errors, differences, floor`` and the fields of `converge_rule.Order`.

    Raises
    ------
    UsageError, ParameterError, CoreError
        Unknown names, values out of range, an engine that is not installed or cannot express the scene, no step to halve.
    BrokenLevelError
        If a run failed.
    """
    if not FEWEST_HALVINGS <= halvings <= MOST_HALVINGS:
        raise UsageError(f"halvings = {halvings} is not allowed: use {FEWEST_HALVINGS} to {MOST_HALVINGS}")
    cell = plan_case(case, engine, params, options)
    if isinstance(cell.setup, Exception):
        raise cell.setup
    if isinstance(cell.engine, Exception):
        raise cell.engine
    info = cell.engine.info()
    name = step_name(cell.case, cell.setup, info)
    coarsest = contact_steps(cell.setup.scene, cell.setup.numerics)[1] if name == "contact_dt" else None
    sizes, results = [], []
    for level in range(halvings + 1):
        finer, size = refined(cell, name, coarsest, level, params or {}, options)
        if progress is not None:
            progress(level, halvings + 1, f"{cell.name}, {name} = {size:.4g}")
        results.append(_ran(run_cell(finer, raise_users_mistakes=True), f"{name} = {size:.4g}"))
        sizes.append(size)
    if progress is not None:
        progress(halvings + 1, halvings + 1, "")
    expected, why = expected_order(cell.case, cell.variant.params, cell.setup, info)
    own_step = coarsest or cell.setup.numerics.dt
    rows = _rows(results, info, expected, own_step, by_fraction=name == "increment")
    return {
        "case": cell.case.id,
        "variant": cell.variant.id,
        "params": dict(cell.variant.params),
        "engine": cell.engine_id,
        "engine_name": info.name,
        "engine_version": info.version or "",
        "scheme": info.scheme,
        "step": name,
        "unit": "m" if name == "increment" else "s",
        "steps": sizes,
        "expected": expected,
        "expected_why": why,
        "rules": list(RULES),
        "rows": sorted(rows, key=lambda row: VERDICTS.index(row["verdict"])),
    }


def refined(
    cell: Cell,
    name: str,
    coarsest: float | None,
    level: int,
    params: Mapping[str, Any],
    options: Mapping[str, Any] | None,
) -> tuple[Cell, float]:
    """The cell with its step halved ``level`` times, and the step's size; the run's end stays where it was.

    A step of springs is set by the case's parameter (``substeps``, ``contact_dt``), so that its tolerances know it; where it
    has none, in the numerics. A case's own step brings along what counts steps (``steps``) or follows from it
    (``duration``, where it is left to the case).
    """
    assert not isinstance(cell.setup, Exception)
    assert not isinstance(cell.engine, Exception)
    numerics = cell.setup.numerics
    known = {parameter.name for parameter in cell.case.parameters}
    changes: dict[str, Any] = {}
    if coarsest is not None:
        size = coarsest / 2**level
        if "substeps" in known:
            changes["substeps"] = numerics.substeps(size)
        elif "contact_dt" in known:
            changes["contact_dt"] = size
        else:
            return replace(cell, setup=replace(cell.setup, numerics=numerics.replace(contact_dt=size))), size
        return plan_case(cell.case, cell.engine, {**params, **changes}, options), size
    size = float(cell.variant.params[name]) / 2**level
    changes[name] = size
    if "steps" in known:
        changes["steps"] = int(cell.variant.params["steps"]) * 2**level
    if "duration" in known and cell.variant.params["duration"] is None:
        changes["duration"] = numerics.n_steps * numerics.dt
    return plan_case(cell.case, cell.engine, {**params, **changes}, options), size


def _ran(result: CaseResult, level: str) -> CaseResult:
    """A result with numbers, or the reason why there are none."""
    if result.status in ("unsupported", "not-installed"):
        raise UsageError(f"{result.cell['engine']} cannot run {result.cell['case']}: {result.status}, {result.reason}")
    if result.observed is None:
        raise BrokenLevelError(f"{result.cell['engine']} at {level}: {result.status}, {result.reason}")
    return result


def _rows(
    results: Sequence[CaseResult], info: EngineInfo, expected: float | None, own_step: float, *, by_fraction: bool
) -> list[Row]:
    observed = [result.observed for result in results if result.observed is not None]
    finest = results[-1]
    assert finest.setup is not None
    assert finest.history is not None
    floor_of = round_off(finest.setup, info, finest.history, own_step / 2 ** (len(results) - 1))
    at = common_samples(observed, by_fraction=by_fraction)
    rows = []
    for norm, names in (("max", observed[0].series), ("scalar", observed[0].scalars)):
        for quantity in names:
            found = _truth(results, observed, at, quantity, norm)
            values = _values(observed, at, quantity, norm)
            if not np.isfinite(values).any():
                continue
            rows.append(_row(quantity, norm, values, found, floor_of, expected, observed[0]))
    return rows


def _row(
    quantity: str,
    norm: str,
    values: FloatArray,
    found: tuple[Check, FloatArray] | None,
    floor_of: Callable[[str, float], float],
    expected: float | None,
    observed: Observed,
) -> Row:
    unit = (observed.series if norm == "max" else observed.scalars)[quantity][0]
    speaks: NDArray[np.bool_] = np.isfinite(found[1] if found else values.sum(axis=0))
    if not speaks.any():  # no sample at which every level has a number: all of them show it
        speaks = np.ones_like(speaks)
    values = values[:, speaks]
    largest = float(np.abs(values).max(initial=0.0))
    errors, tolerance, floor = None, math.inf, floor_of(unit, largest)
    if found:
        check, truth = found[0], found[1][speaks]
        scale = float(np.abs(truth).max())
        errors = [float(np.abs(level - truth).max()) for level in values]
        floor = max(floor, check.uncertainty)
        tolerance = math.inf if check.gap_reason else check.atol + check.rtol * scale
    differences = [float(np.abs(fine - coarse).max()) for coarse, fine in pairwise(values)]
    order = judge_order(
        errors, differences, floor=floor, expected=expected, tolerance=tolerance, number=norm == "scalar"
    )
    return {
        "quantity": quantity,
        "unit": unit,
        "norm": norm,
        "truth": found[0].truth if found else "",
        "source": found[0].source if found else "",
        "errors": errors,
        "differences": differences,
        "floor": floor,
        **asdict(order),
    }


def common_samples(observed: Sequence[Observed], *, by_fraction: bool = False) -> list[NDArray[np.int64]]:
    """Samples of each level at the times that all levels have, or at the same fractions of their runs.

    Where the step is no time but an increment of a way, the same way is the same fraction of the run.

    Raises
    ------
    UsageError
        If they share none but the beginning.
    """
    spans = [float((each if by_fraction else observed[0]).t[-1]) for each in observed]
    ticks = [np.round(each.t / span * 2.0**40).astype(np.int64) for each, span in zip(observed, spans, strict=True)]
    shared = ticks[0]
    for other in ticks[1:]:
        shared = shared[[bool(np.abs(other - tick).min() <= 64) for tick in shared]]
    if len(shared) < 2:
        raise UsageError("the levels share no time but the first: give a duration that the steps divide")
    return [np.array([int(np.abs(mine - tick).argmin()) for tick in shared], dtype=np.int64) for mine in ticks]


def _values(observed: Sequence[Observed], at: Sequence[NDArray[np.int64]], quantity: str, norm: str) -> FloatArray:
    if norm == "scalar":
        return np.array([[each.scalars[quantity][1]] for each in observed], dtype=np.float64)
    return np.array([each.series[quantity][1][rows] for each, rows in zip(observed, at, strict=True)], dtype=np.float64)


def _truth(
    results: Sequence[CaseResult],
    observed: Sequence[Observed],
    at: Sequence[NDArray[np.int64]],
    quantity: str,
    norm: str,
) -> tuple[Check, FloatArray] | None:
    """The finest level's check and what it expects at the common samples; None where no truth holds for every step.

    Where a truth is silent at some level (an event that it spreads over a step), it is silent for all.
    """
    for kind in CONTINUOUS:
        checks = [
            next((c for c in result.checks if (c.quantity, c.norm, c.truth) == (quantity, norm, kind)), None)
            for result in results
        ]
        told = []
        for check, each, rows in zip(checks, observed, at, strict=True):
            if check is None:
                break
            full = np.array([check.expected]) if norm == "scalar" else expected_series(check, each)[rows]
            told.append(np.asarray(full, dtype=np.float64))
        if checks[-1] is None or len(told) < len(results):
            continue
        curves = np.array(told)
        silent = ~np.isfinite(curves).all(axis=0)
        curves[:, silent] = np.nan
        if silent.all():
            continue
        spread = float(np.nanmax(np.abs(curves - curves[-1])))
        if spread <= SAME * float(np.nanmax(np.abs(curves[-1]))):
            return checks[-1], curves[-1]
    return None
