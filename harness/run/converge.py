"""Orders of convergence: one variant of a case on one engine, its step halved again and again.

Level ``k`` has the step ``h/2^k``. Errors against a truth fall like ``h^p``; so do the differences of neighbouring levels,
which need no truth. `judge_order` is the rule, on plain numbers; what a scheme declares about its order, which step it has and
what round-off makes of a scene's quantities stand at the end.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.history import History
from ninedisk.harness.api.case import Case, Check, Observed, Setup
from ninedisk.harness.api.engine import Engine, EngineInfo, facts_of
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.api.support import contact_steps
from ninedisk.harness.api.text import duration
from ninedisk.harness.cases.matched import slip_of
from ninedisk.harness.results.schema import Row
from ninedisk.harness.results.tables import CaseResult
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
        As `ninedisk.harness.run.runner.run_case` takes them; the step that they set is the coarsest.
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
        errors, differences, floor`` and the fields of `ObservedOrder`.

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
    info = facts_of(cell.engine)
    name = step_name(cell.case, cell.setup, info)
    coarsest = contact_steps(cell.setup.scene, cell.setup.numerics)[1] if name == "contact_dt" else None
    sizes, results = [], []
    left, begin = "", time.monotonic()
    for level in range(halvings + 1):
        finer, size = refined(cell, name, coarsest, level, params or {}, options)
        if progress is not None:
            progress(level, halvings + 1, f"{cell.name}, {name} = {size:.4g}{left}")
        results.append(_completed_result(run_cell(finer, raise_users_mistakes=True), f"{name} = {size:.4g}"))
        sizes.append(size)
        # Each level takes twice the time of the one before: what is left is that of the last one times 2 + 4 + ...
        took, begin = time.monotonic() - begin, time.monotonic()
        left = f", about {duration(took * (2.0 ** (halvings - level + 1) - 2.0))} left"
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


def _completed_result(result: CaseResult, level: str) -> CaseResult:
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
        expected = []
        for check, each, rows in zip(checks, observed, at, strict=True):
            if check is None:
                break
            full = np.array([check.expected]) if norm == "scalar" else expected_series(check, each)[rows]
            expected.append(np.asarray(full, dtype=np.float64))
        if checks[-1] is None or len(expected) < len(results):
            continue
        curves = np.array(expected)
        silent = ~np.isfinite(curves).all(axis=0)
        curves[:, silent] = np.nan
        if silent.all():
            continue
        spread = float(np.nanmax(np.abs(curves - curves[-1])))
        if spread <= SAME * float(np.nanmax(np.abs(curves[-1]))):
            return checks[-1], curves[-1]
    return None


STEADY = 0.3
"""Levels are asymptotic where all orders between neighbours lie this close to their median: less than half of the half
order that separates kinks (1/2, 3/2) from smooth schemes (1, 2)."""

MARGIN = 0.25
"""An observed order may miss the expected one by this much, or by its own uncertainty: half the way to the next half order."""

LEVELLED = 4.0
"""Errors that are this many times the last difference have levelled off: ``1/(2^p - 1)``, p = 0.32, below any scheme's order."""

FEWEST = 3
"""Levels that an order needs: two orders between neighbours, so that they can disagree."""

GOOD = ("undecided", "not judged", "converges", "step-independent", "exact")
BAD = ("wrong order", "wrong limit")
VERDICTS = (*BAD, *GOOD)
"""Worst first; those of `BAD` fail."""

RULES = (
    "The step is halved each time and everything else stays; values are compared at the times that all levels have.",
    "Error: against a truth of the continuous problem (analytic, converged) that is the same at every step; where there is "
    "none, or where the errors have levelled off above "
    f"{LEVELLED:g} times the last difference (the limit is another than the truth's), the differences of neighbouring levels.",
    "Round-off: values below 1e-10 (single precision: 1e-5) of the scene's own size in that unit, below what one unit in the "
    "last place of a coordinate makes of forces and velocities through the stiffness, or below the truth's own uncertainty, "
    "and all finer levels, do not count. The differences of a single number (a peak, a count) may cancel, or jump where "
    "another sample becomes the peak: their order is shown, not judged.",
    f"Pre-asymptotic: coarse levels are left out until all orders between neighbours lie within {STEADY:g} of their median; "
    f"at least {FEWEST} levels must remain, else all count and the order is irregular.",
    "Order: slope of log error over log step by least squares. Uncertainty: half the range of the orders between neighbours, "
    "and at least what the last of them still has to go: the next term of the expansion halves with the step, so that it "
    "will move once more by what it moved last.",
    f"Wrong order: the expected one lies above the observed one by more than its uncertainty and more than {MARGIN:g}. "
    "A higher order is no fault. Wrong limit: the limit misses the truth by more than the check's tolerance.",
)
"""The rule in words, for the page and the record."""


@dataclass(frozen=True, kw_only=True)
class ObservedOrder:
    """Observed order of one quantity.

    ``by`` is ``"error"`` or ``"difference"``, ``used`` the levels that counted, ``regular`` whether they are asymptotic;
    ``order`` and ``uncertainty`` are NaN where there are too few.
    """

    verdict: str
    order: float
    uncertainty: float
    by: str
    used: tuple[int, ...]
    regular: bool
    reason: str


def judge_order(
    errors: Sequence[float] | None,
    differences: Sequence[float],
    *,
    floor: float,
    expected: float | None,
    tolerance: float = math.inf,
    number: bool = False,
) -> ObservedOrder:
    """Order of a quantity and its verdict.

    Parameters
    ----------
    errors : sequence of float or None
        Against a truth, by level, coarsest first; None where there is no truth.
    differences : sequence of float
        Between level k and k + 1, in the quantity's unit; one less than there are levels.
    floor : float
        Values at most this large are round-off, > 0.
    expected : float or None
        Order that the scheme declares.
    tolerance : float
        What the truth's check allows at the finest level.
    number : bool
        A single number; its differences may cancel or jump, and their order is shown only.
    """
    values = [*(errors or ()), *differences]
    if not all(math.isfinite(value) for value in values):
        return _no_order("undecided", "", "some levels give no number")
    if max(differences) <= floor:
        if errors is not None and errors[-1] > max(tolerance, floor):
            return _no_order(
                "wrong limit", "error", _missed_order(errors[-1], tolerance) + "; the step changes nothing"
            )
        if errors is not None and errors[-1] > floor:
            return _no_order("step-independent", "error", f"{errors[-1]:.2g} from the truth (allowed: {tolerance:.2g})")
        return _no_order(
            "exact", "error" if errors is not None else "difference", "the step changes nothing but round-off"
        )
    note, by, series = "", "difference", list(differences)
    if errors is not None:
        if errors[-1] > LEVELLED * differences[-1] and errors[-1] > floor:
            if errors[-1] > tolerance:
                return _no_order("wrong limit", "difference", _missed_order(errors[-1], tolerance))
            note = f"levels off {errors[-1]:.2g} from the truth (allowed: {tolerance:.2g})"
        else:
            by, series = "error", list(errors)
    above = next((k for k, value in enumerate(series) if value <= floor), len(series))
    if above < 2:
        return _no_order("exact", by, _join_rows(note, "round-off from the first halving on"))
    found = _fitted(series[:above], by)
    reason = _join_rows(note, _left_out_levels(found, len(series), above))
    return _judge_series(found, expected, reason, shown_only=number and by == "difference")


def _join_rows(*parts: str) -> str:
    return "; ".join(part for part in parts if part)


def _no_order(verdict: str, by: str, reason: str) -> ObservedOrder:
    return ObservedOrder(
        verdict=verdict, order=math.nan, uncertainty=math.nan, by=by, used=(), regular=False, reason=reason
    )


def _missed_order(error: float, tolerance: float) -> str:
    return f"the limit misses the truth by {error:.2g}, allowed are {tolerance:.2g}"


def _fitted(series: Sequence[float], by: str) -> ObservedOrder:
    """Order over the asymptotic levels, or over all where there is no such range."""
    logs = np.log2(np.asarray(series))
    local = -np.diff(logs)
    regular, first = False, 0
    for start in range(len(series) - FEWEST + 1):
        tail = local[start:]
        if np.abs(tail - np.median(tail)).max() <= STEADY:
            regular, first = True, start
            break
    levels = np.arange(first, len(series))
    slope = -float(np.polyfit(levels, logs[first:], 1)[0])
    spread = math.nan
    if len(levels) >= FEWEST:
        to_go = abs(float(local[-1]) - slope) + abs(float(local[-1] - local[-2]))
        spread = max(0.5 * float(np.ptp(local[first:])), to_go)
    return ObservedOrder(
        verdict="", order=slope, uncertainty=spread, by=by, used=tuple(map(int, levels)), regular=regular, reason=""
    )


def _left_out_levels(found: ObservedOrder, count: int, above: int) -> str:
    parts = [f"first {found.used[0]} left out as pre-asymptotic"] if found.used[0] else []
    parts += [f"last {count - above} left out as round-off"] if above < count else []
    return _join_rows(*parts)


def _judge_series(found: ObservedOrder, expected: float | None, reason: str, *, shown_only: bool) -> ObservedOrder:
    verdict = "converges"
    if expected is None or shown_only:
        verdict = "not judged"
    elif math.isnan(found.uncertainty):
        verdict, reason = "undecided", _join_rows(reason, "too few levels above round-off")
    elif found.order + max(found.uncertainty, MARGIN) < expected:
        verdict = "wrong order"
    elif not found.regular:
        verdict, reason = "undecided", _join_rows(reason, "irregular: no asymptotic range")
    return replace(found, verdict=verdict, reason=reason)


STEP_PARAMETERS = ("dt", "increment")
"""Parameters of cases that are the step of engines without an own one."""

FIRST_ORDER = ("theta", "moreau-jean", "semi-implicit-euler", "position-first-euler")

RELATIVE = {"float64": 1e-10, "float32": 1e-5}
"""Share of a quantity's natural size below which it is round-off: the round-off of some hundred steps, 1e-14, and a solver's
residual; in single precision a hundred units in the last place."""

ROUNDINGS = 64.0
"""Roundings of a coordinate that add up in a force: each body is moved by a sum of thousands, which add like their root."""


def expected_order(case: Case, params: Mapping[str, Any], setup: Setup, engine: EngineInfo) -> tuple[float | None, str]:
    """Order in the step that the engine's scheme has on this scene, and why; None where the engine declares none.

    A case whose contacts never slip, although its laws have friction, says so by a method ``slips(params)``; one whose contacts neither
    open nor close nor begin or cease to slide, by a method ``sticks(params)``.
    """
    scheme = engine.scheme
    if scheme == "runge-kutta-3":
        return None, "runge-kutta-3 in substeps of the engine's own: the step dt is none of the scheme's"
    if scheme == "central-difference":
        laws: Sequence[Any] = setup.scene.laws_in_use
        if getattr(setup.scene, "xi", 0.0) > 0.0 and setup.numerics.damping_form == "lagged":
            return 1.0, "central differences; global damping sees the velocity of half a step before"
        damped = [law for law in laws if law.beta > 0.0]
        if any(getattr(law, "hertz", False) for law in damped):
            # c v with c as overlap^(1/4): order 5/4, by a factor that jumps with the place of the touch within its step.
            return (
                None,
                "central differences; Tsuji's dashpot begins as the fourth root of the overlap, anywhere within a step",
            )
        if damped:
            return 1.0, "central differences; a dashpot's force jumps at touch, anywhere within a step"
        slips = getattr(case, "slips", None)
        rough = [law for law in laws if law.mu > 0.0 and (law.ks > 0.0 or getattr(law, "g_star", 0.0) > 0.0)]
        if rough and (slips is None or slips(params)):
            if any(slip_of(law.slip_at, engine) == "end" for law in rough):
                return (
                    1.0,
                    "central differences; slip is that of the half step, turned to the contact at the step's end",
                )
            if getattr(case, "sticks", lambda _: False)(params):
                return 2.0, "central differences, slip of the middle of the step; contacts stick, and stay closed"
            return 1.0, "central differences; contacts open, close, stick and slip anywhere within a step"
        return 2.0, "central differences" + ("; by symmetry no contact slips" if rough else "")
    if scheme in FIRST_ORDER:
        return 1.0, f"{scheme}: contacts act for whole steps"
    return None, f"a scheme of the engine's own: {scheme}"


def step_name(case: Case, setup: Setup, engine: EngineInfo) -> str:
    """The step that this engine takes: ``"contact_dt"``, or the case's own parameter.

    Contact dynamics has an own step where all contacts are elastic (`ninedisk.core.cd.session.CdSession`).

    Raises
    ------
    UsageError
        If the engine steps by ``dt`` and the case has no such parameter.
    """
    elastic = not any(law.regularised for law in setup.scene.laws_in_use)
    if engine.contact == "spring" or (engine.contact == "cd" and elastic):
        return "contact_dt"
    known = {parameter.name for parameter in case.parameters}
    found = next((name for name in STEP_PARAMETERS if name in known), None)
    if found is None:
        raise UsageError(
            f"the case {case.id!r} has no step that could be halved for {engine.id!r}: none of its parameters is "
            f"{' or '.join(STEP_PARAMETERS)}; use an engine with contact springs"
        )
    return found


def round_off(setup: Setup, engine: EngineInfo, history: History, contact_dt: float) -> Callable[[str, float], float]:
    """Function of a quantity's unit and largest value: the size below which it is round-off.

    A coordinate of size L is known to one unit in the last place, u; a contact spring makes ``kn u`` of it, and of that a
    velocity ``omega u``. Rigid contacts find velocities, not positions.
    """
    share = RELATIVE.get(engine.precision, RELATIVE["float32"])
    bodies = setup.scene.bodies
    length = float(np.nanmax(np.abs(history.x), initial=0.0)) + float(bodies.radius.max())
    unit = float(np.spacing(length if engine.precision == "float64" else np.float32(length)))
    # The tangent stiffness of Hertz, 2 E* sqrt(R overlap), at the deepest overlap that was watched.
    root = math.sqrt(float(bodies.radius.max()) * -float(np.nanmin(history.gap, initial=0.0)))
    laws: Sequence[Any] = setup.scene.laws_in_use if engine.contact == "spring" else ()
    stiff = max((law.kn or 2.0 * law.e_star * root for law in laws), default=0.0)
    omega = min(math.sqrt(2.0 * stiff / float(bodies.mass.min())), 2.0 / contact_dt)
    speed = float(np.nanmax(np.abs(history.v), initial=0.0))
    of_length, of_speed = share * length, share * speed + ROUNDINGS * unit * omega
    mass = float(bodies.mass.sum())
    absolute = {
        "m": of_length,
        "m/s": of_speed,
        "rad/s": of_speed / float(bodies.radius.min()),
        "N": ROUNDINGS * unit * stiff,
        "kg m/s": mass * of_speed,
        "J": mass * speed * of_speed,
        "s": share * float(history.t[-1]),
    }
    tiny = float(np.finfo(np.float64).tiny)
    return lambda name, largest: max(absolute.get(name, share), share * largest, tiny)
