"""Runs one cell: a variant of a case on an engine, held against every truth that binds it; `ninedisk.harness.run.workers` runs many.

A cell that does not run to its end has a result too, with the columns that were known by then. `dry_checks` shows which checks a
cell will have, without running its engine.
"""

from __future__ import annotations

import json
import math
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.errors import CoreError, InvalidNumericsError, InvalidSceneError, TooFastError, UnstableTimeStepError
from ninedisk.core.history import History
from ninedisk.core.scene import Scene
from ninedisk.harness.api.capabilities import capabilities_asked
from ninedisk.harness.api.case import Case, Check, Setup, figures_of, headlines_of
from ninedisk.harness.api.engine import (
    Engine,
    EngineError,
    EngineInfo,
    EngineNotInstalledError,
    EngineRun,
    EngineTimeoutError,
    EngineUnsupportedError,
    Support,
    SupportLevel,
)
from ninedisk.harness.api.params import settings_of_other_engines
from ninedisk.harness.api.support import support_of
from ninedisk.harness.cases.common import with_slop
from ninedisk.harness.results.figures import figures_to_text
from ninedisk.harness.results.schema import AS_DEFAULT, CELL_COLUMNS, HEADLINE_COLUMNS, MEASUREMENT_COLUMNS, Row
from ninedisk.harness.results.tables import CaseResult, complete, plain_json
from ninedisk.harness.run.judge import (
    blank_history,
    cell_verdict,
    check_history,
    check_timings,
    curves,
    headline_row,
    measurement_row,
    motion_is_whole,
    reference_curves,
)
from ninedisk.harness.run.limits import TIME_LIMIT_VARIABLE
from ninedisk.harness.run.plan import Cell, plan_case, request_command, run_command
from ninedisk.harness.run.precision import in_single_precision
from ninedisk.harness.run.published import published_checks
from ninedisk.harness.run.timing import reference_seconds, timing_columns

Progress = Callable[[int, int, str], None]
"""Called with (cells done, cells in all, name of the cell that begins)."""

USERS_MISTAKES = (InvalidSceneError, InvalidNumericsError, UnstableTimeStepError, TooFastError)
"""Errors of an engine's run that come from the parameters, not from the engine."""

LATE_CELLS = 3
"""Cells in a row after whose time limits an engine is given up: one may be slow, three are a pattern."""

_KEPT_LINES = 12
_KEPT_LENGTH = 2000


MAX_FRAMES = 12
"""Sampled configurations that a stored cell keeps: enough to see a motion, small enough for every cell."""


def run_case(
    case: Case | str,
    *,
    engine: Engine | str = "dem",
    params: Mapping[str, Any] | None = None,
    options: Mapping[str, Any] | None = None,
    published: Path | None = None,
) -> CaseResult:
    """Run one variant of a case on one engine.

    Parameters
    ----------
    case : Case or str
        A case or its id, e.g. ``"nine-disk/compression"``.
    engine : Engine or str
        An engine or its id.
    params : mapping, optional
        Parameters that differ from the case's defaults; text may carry a unit (``{"dt": "10 ms"}``).
    options : mapping, optional
        Settings of the engine, ``{"siconos.theta": 1.0}``; ``ninedisk list engines siconos`` shows them.
    published : Path, optional
        Folder with digitised curves of your own that join the truths.

    Returns
    -------
    CaseResult
        With ``status``, ``reason``, ``measurements`` and ``series`` (DataFrames), ``setup`` and ``history``. A failing
        engine is a status, not an exception.

    Raises
    ------
    UsageError
        Unknown case or engine, or an option that the engine does not have.
    ParameterError, CoreError
        Unknown parameter, value out of range, or parameters that make an impossible scene or an unstable time step.

    Examples
    --------
    >>> result = run_case("nine-disk/compression", engine="dem", params={"load_case": "a2"})  # doctest: +SKIP
    >>> result.measurements[["quantity", "abs_error", "status"]]  # doctest: +SKIP
    """
    cell = plan_case(case, engine, params, options)
    return run_cell(cell, published=published, raise_users_mistakes=bool(params))


AT_OWN_SETTINGS = "measured by headlines alone: tolerances are those of an adapter's settings, not of the engine's own"
"""Reason of a cell of the profile ``stock``."""


class Patience:
    """Gives up engines that hang: after `LATE_CELLS` cells in a row that were stopped at their time limit."""

    def __init__(self) -> None:
        self._late: dict[str, list[Cell]] = {}

    def given_up(self, cell: Cell) -> str:
        """Why the cell's engine is not to be asked any more; ``""`` as long as it is."""
        late = self._late.get(cell.engine_id, [])
        if len(late) < LATE_CELLS:
            return ""
        names = ", ".join(f"{each.case.id}[{each.variant.id}]" for each in late)
        return (
            f"not run: the engine was stopped at its time limit in {LATE_CELLS} cells in a row ({names}); "
            f"set {TIME_LIMIT_VARIABLE} to allow more, or see what it does with this one alone: {run_command(cell)}"
        )

    def record_outcome(self, cell: Cell, result: CaseResult) -> None:
        """Take note of how a cell ended; one that never reached the engine says nothing."""
        late = self._late.setdefault(cell.engine_id, [])
        if result.status == "timeout" and len(late) < LATE_CELLS:
            late.append(cell)
        elif result.status not in ("timeout", "unsupported", "not-installed"):
            late.clear()


def run_cell(
    cell: Cell, *, published: Path | None = None, raise_users_mistakes: bool = False, given_up: str = ""
) -> CaseResult:
    """Run one cell; only a mistake in the user's parameters is raised, and only if asked for.

    Where ``given_up`` says why, the engine is not asked to run: a scene that it supports ends as timeout for that reason.
    """
    head = planned_columns(cell)
    if isinstance(cell.setup, Exception):
        return without_measurements(cell, head, "error", f"the case cannot be built: {last_lines(cell.setup)}")
    setup = cell.setup
    if isinstance(cell.engine, Exception):
        return without_measurements(cell, head, "error", last_lines(cell.engine))
    try:
        info = cell.engine.info()
        head |= engine_columns(info)
        if not info.installed:
            why = info.not_installed_because or "it is not on this machine"
            return without_measurements(cell, head, "not-installed", f"{why}; install it with: {info.install}")
        foreign = [] if cell.user_set else settings_of_other_engines(cell.case, cell.variant.params, info.contact)
        if foreign:
            why = f"the variant sets {', '.join(foreign)}, {AS_DEFAULT}"
            return without_measurements(cell, head, "unsupported", why)
        support = support_of(cell.engine, setup.scene, setup.numerics)
        head |= support_columns(support)
        if support.level is SupportLevel.NO:
            return without_measurements(cell, head, "unsupported", unsupported_reason(info, support))
        if given_up:
            return without_measurements(cell, head, "timeout", given_up)
        before, begin = reference_seconds(), time.perf_counter()
        run = cell.engine.run(setup.scene, setup.numerics, setup.watch)
        took = time.perf_counter() - begin
        check_history(run.history, setup)
        check_timings(run.timings, setup.numerics, math.inf if getattr(cell.engine, "keeps_runs", False) else took)
        result = _measure(cell, setup, info, run, head, published)
        if not np.isnan(result.cell["advance_s"]):
            engine, inputs = cell.engine, (setup.scene, setup.numerics, setup.watch)
            result.cell.update(timing_columns(lambda: engine.run(*inputs), run.timings, took, before))
        return result
    except EngineNotInstalledError as error:
        return without_measurements(cell, head, "not-installed", last_lines(error))
    except EngineUnsupportedError as error:
        return without_measurements(cell, head, "unsupported", last_lines(error))
    except EngineTimeoutError as error:
        return without_measurements(cell, head, "timeout", last_lines(error))
    except (Exception, SystemExit) as error:  # an adapter that calls sys.exit ends its cell alone
        if raise_users_mistakes and isinstance(error, USERS_MISTAKES):
            raise
        by_hand = request_command(cell) if isinstance(error, EngineError) else ""
        reason = f"{last_lines(error)}\nto see it by hand: {by_hand}" if by_hand else last_lines(error)
        return without_measurements(cell, head, "error", reason)


def unsupported_reason(info: EngineInfo, support: Support) -> str:
    """Why an engine does not run a scene: what it lacks, where its documentation says that this is deliberately, and notes."""
    lacks = ["it lacks " + ", ".join(support.missing)] if support.missing else []
    links: dict[str, list[str]] = {}
    for capability in support.missing:
        if capability in info.out_of_scope:
            links.setdefault(info.out_of_scope[capability], []).append(str(capability))
    scope = [f"out of scope by its own documentation ({link}): {', '.join(names)}" for link, names in links.items()]
    return "; ".join([*lacks, *scope, *support.notes])


def all_checks(cell: Cell, setup: Setup, observed: Any, info: EngineInfo, published: Path | None) -> list[Check]:
    """The case's own truths followed by the published ones."""
    params = cell.variant.params
    own = list(cell.case.checks(params, setup, observed, info))
    found = with_slop(own + published_checks(cell.case.id, params, observed, own, published), observed, info)
    # An observer's numbers are other ones than those of the scene that truths are about.
    seen = getattr(cell.case, "observed_problem", None)
    plain, drift = (setup, 0.0) if seen is None else seen(params)
    return in_single_precision(found, plain, observed, info, drift)


def last_lines(error: BaseException) -> str:
    """Message of an error, its first line and its last ones; with its kind and place where it is none of ours."""
    message = str(error).strip()
    if not isinstance(error, CoreError | EngineError | ValueError) or not message:
        frame = traceback.extract_tb(error.__traceback__)[-1:]
        where = f" at {Path(frame[0].filename).name}:{frame[0].lineno}" if frame else ""
        message = f"{type(error).__name__}{where}: {message}"
    lines = message.splitlines()
    if len(lines) > _KEPT_LINES:
        lines = [lines[0], *lines[1 - _KEPT_LINES :]]
    text = "\n".join(lines)
    # What went wrong is at the beginning, what the engine said last at the end.
    return text if len(text) <= _KEPT_LENGTH else f"{text[: _KEPT_LENGTH // 2]} ... {text[-_KEPT_LENGTH // 2 :]}"


def _measure(
    cell: Cell, setup: Setup, info: EngineInfo, run: EngineRun, head: Row, published: Path | None
) -> CaseResult:
    observed = cell.case.observe(cell.variant.params, setup, run.history)
    # Tolerances are those of an adapter's settings; at its own an engine is measured against the physics, by headlines.
    stock = info.profile == "stock"
    checks = [] if stock else all_checks(cell, setup, observed, info, published)
    common = {name: head[name] for name in head if name in MEASUREMENT_COLUMNS}
    forces = info.contact_forces if motion_is_whole(run.history) else "all"
    rows = [measurement_row(common, check, observed, forces) for check in checks]
    told = {name: head[name] for name in head if name in HEADLINE_COLUMNS}
    headlines = [
        headline_row(told, headline, observed)
        for headline in headlines_of(cell.case, cell.variant.params, setup, observed)
    ]
    status, reason = ("no-truth", AT_OWN_SETTINGS) if stock else cell_verdict(rows)
    failed = any(row["status"] == "fail" for row in rows)
    cell_row = head | {
        "settings": plain_json(dict(run.settings)),
        "status": status,
        "reason": reason,
        "setup_s": run.timings.setup,
        "warm_up_s": run.timings.warm_up,
        "advance_s": float("nan") if failed else run.timings.advance,
        "penetration": penetration(setup, run.history),
        "frames": plain_json(frames(run.history)),
    }
    if not rows:
        rows = [complete(common | {"status": status, "reason": reason}, MEASUREMENT_COLUMNS)]
    names = (cell.case.id, cell.variant.id, cell.engine_id)
    return CaseResult(
        cell=complete(cell_row, CELL_COLUMNS),
        rows=rows,
        headlines=headlines,
        curves=curves(names, observed, checks),
        reference_curves=reference_curves(names[:2], observed, checks),
        setup=setup,
        history=run.history,
        observed=observed,
        checks=tuple(checks),
    )


PLACES = 2_000_000
"""Pairs of bodies times samples whose gaps `penetration` computes at most: some 40 ms."""


def penetration(setup: Setup, history: History) -> float:
    """Deepest overlap beyond that with which the scene begins, over the smallest radius; NaN where no gap is known.

    Known are the gaps of watched contacts, at every sample, and those of disks, spheres and walls by their places, at every sample or, of
    many bodies, at as many, evenly spread, as `PLACES` allows. Of each contact counts how much deeper it is than at time 0:
    a scene that starts in equilibrium, or asks for overlaps, prescribes those.
    """
    deep = [_deeper(np.asarray(history.gap, dtype=np.float64))]
    scene = setup.scene
    bodies = scene.bodies
    round_ones = np.flatnonzero(bodies.outline < 0) if isinstance(scene, Scene) else np.arange(len(bodies))
    contacts = len(round_ones) * ((len(round_ones) - 1) // 2 + len(scene.walls))
    count = min(len(history.step), PLACES // contacts if contacts else 0)
    if count > 1:
        rows = np.linspace(0, len(history.step) - 1, count).round().astype(np.int64)
        x, radius = history.x[rows][:, round_ones], bodies.radius[round_ones]
        one, two = np.triu_indices(len(round_ones), 1)
        apart = reduce(np.hypot, np.moveaxis(x[:, two] - x[:, one], -1, 0))
        deep.append(_deeper(apart - radius[one] - radius[two]))
        angle = history.wall_angle[rows]
        normals = np.stack([np.cos(angle), np.sin(angle)], axis=2) if scene.dimension == 2 else angle
        for k in range(len(scene.walls)):
            away = x - history.wall_point[rows, k][:, None]
            parts = np.moveaxis(away, -1, 0) * np.moveaxis(normals[:, k], -1, 0)[..., None]
            deep.append(_deeper(reduce(np.add, parts) - radius))
    known = [each for each in deep if not np.isnan(each)]
    return max(known) / float(bodies.radius.min()) if known else float("nan")


def _deeper(gap: NDArray[np.float64]) -> float:
    """How much deeper than in the first row any column gets [m], >= 0; NaN where no later row has a number. Shape (s, contacts)."""
    if not np.isfinite(gap[1:]).any():
        return float("nan")
    first = np.minimum(np.nan_to_num(gap[0], nan=0.0), 0.0)
    return max(0.0, -float(np.nanmin(np.minimum(gap[1:], 0.0) - first)))


def frames(history: History) -> dict[str, Any]:
    """At most `MAX_FRAMES` sampled configurations as plain data: first and last, and the first of the regular samples.

    Regular sampling may begin long after step 0 (``Numerics.sample_from``); what happened until then is one frame.
    """
    count = len(history.step)
    rows = np.linspace(min(1, count - 1), count - 1, min(count, MAX_FRAMES - 1)).round().astype(np.int64)
    rows = np.unique(np.append(rows, 0))
    picked: dict[str, Any] = {"step": history.step[rows].tolist(), "t": history.t[rows].tolist()}
    for name in ("x", "angle", "wall_point", "wall_angle"):
        picked[name] = np.asarray(getattr(history, name))[rows].tolist()
    return picked


def broken_cell(cell: Cell, reason: str) -> CaseResult:
    """Result of a cell whose process did not live to report it: status error."""
    head = planned_columns(cell)
    if not isinstance(cell.engine, Exception):
        with suppress(Exception):  # facts that cannot be had are no reason to lose the cell
            head |= engine_columns(cell.engine.info())
    return without_measurements(cell, head, "error", reason)


def without_measurements(cell: Cell, head: Row, status: str, reason: str) -> CaseResult:
    """Result of a cell that was not run to its end, with one row that says so."""
    verdict = {"status": status, "reason": reason}
    common = {name: head[name] for name in head if name in MEASUREMENT_COLUMNS}
    return CaseResult(
        cell=complete(head | verdict, CELL_COLUMNS),
        rows=[complete(common | verdict, MEASUREMENT_COLUMNS)],
        setup=None if isinstance(cell.setup, Exception) else cell.setup,
    )


def planned_columns(cell: Cell) -> Row:
    """What a stored cell holds of its plan, known before it runs."""
    case = cell.case
    return {
        "case": case.id,
        "case_version": case.version,
        "case_title": case.title,
        "case_source": case.source,
        "case_requirement": case.requirement,
        "case_figures": figures_to_text(figures_of(case)),
        "variant": cell.variant.id,
        "params": plain_json(dict(cell.variant.params)),
        "engine": cell.engine_id,
        **({} if isinstance(cell.setup, Exception) else _setup_columns(cell.setup)),
    }


def _setup_columns(setup: Setup) -> Row:
    stored = {
        "scene": setup.scene.to_dict(),
        "numerics": setup.numerics.to_dict(),
        "watch": [list(pair) for pair in setup.watch],
        "labels": {name: list(pair) for name, pair in setup.labels.items()},
    }
    return {
        "n_steps": setup.numerics.n_steps,
        "n_disks": len(setup.scene.bodies),
        "setup": plain_json(stored),
        "asked": json.dumps(sorted(capabilities_asked(setup.scene, setup.numerics))),
    }


def engine_columns(info: EngineInfo) -> Row:
    """Columns of the facts about an engine."""
    return {
        "engine_name": info.name,
        "engine_version": info.version or "",
        "engine_licence": info.licence,
        "engine_runs": info.how_it_runs,
        "capabilities": json.dumps(sorted(info.capabilities)),
    }


def support_columns(support: Support) -> Row:
    """Columns of how faithfully the engine expresses the scene."""
    return {
        "support": str(support.level),
        "missing": json.dumps([str(capability) for capability in support.missing]),
        "notes": json.dumps(list(support.notes)),
    }


def check_ids(pairs: Iterable[tuple[str, str]]) -> list[str]:
    """``quantity-truth`` ids in order, numbered where the same pair comes again."""
    seen: Counter[str] = Counter()
    ids = []
    for quantity, truth in pairs:
        name = f"{quantity}-{truth}"
        seen[name] += 1
        ids.append(name if seen[name] == 1 else f"{name}-{seen[name]}")
    return ids


def dry_checks(cell: Cell, info: EngineInfo) -> list[Check]:
    """The checks of a cell over a history without numbers: quantities and truths are right, values are NaN.

    Which truths bind a cell follows from its parameters, its set-up and the engine's facts, never from the numbers that
    the engine computes; so the case's own ``observe`` and ``checks`` give them from a blank history.
    """
    if isinstance(cell.setup, Exception):
        raise cell.setup
    observed = cell.case.observe(cell.variant.params, cell.setup, blank_history(cell.setup))
    return all_checks(cell, cell.setup, observed, info, None)
