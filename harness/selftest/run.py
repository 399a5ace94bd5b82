"""The self-test: right engines first, then every wrong one, each run on the cells of its panel and held against all their checks."""

from __future__ import annotations

import json
import math
import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ninedisk.core.history import Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene
from ninedisk.harness.api.case import Setup
from ninedisk.harness.api.engine import Engine, EngineError, EngineInfo, EngineRun, Support
from ninedisk.harness.api.registry import get_case
from ninedisk.harness.results.schema import Row
from ninedisk.harness.results.tables import CaseResult
from ninedisk.harness.run.isolation import end_commands, run_isolated
from ninedisk.harness.run.plan import Cell
from ninedisk.harness.run.runner import run_cell
from ninedisk.harness.selftest.declared import DECLARED, RUNS, as_rigid
from ninedisk.harness.selftest.defect import Defect, Edit, check_edits
from ninedisk.harness.selftest.gallery import CLEAN
from ninedisk.harness.selftest.panel import panel_cells
from ninedisk.harness.wire.protocol import Request, decode_answer, encode_request

Progress = Callable[[int, int, str], None]

JUDGED = ("pass", "fail")
"""Statuses of checks that can fail; a known difference does not."""


TIME_LIMIT = 300.0
"""Seconds for one wrong engine on its whole panel; the right ones take some ten, minutes where kernels are interpreted."""

Outcome = EngineRun | EngineError


def run_selftest(
    defects: Sequence[Defect], *, jobs: int = 1, quick: bool = False, progress: Progress = lambda *_: None
) -> list[Row]:
    """Run the right engines and the wrong ones.

    Parameters
    ----------
    defects : sequence of Defect
    jobs : int
        Wrong engines that run at the same time, each in a process of its own.
    quick : bool
        Run each wrong engine on its witness alone, and the right ones on all witnesses.
    progress : callable
        Called with (engines done, engines in all, name of one that begins).

    Returns
    -------
    list of dict
        See `selftest_row`; the right engines come first.

    Raises
    ------
    StaleEditError
        If a defect no longer fits the sources; nothing has run then.
    """
    for defect in defects:
        check_edits(defect.edits)
    engines = list(dict.fromkeys(defect.engine for defect in defects))
    clean = [defect for defect in CLEAN if defect.engine in engines]
    cells: dict[str, list[Cell]] = {engine: panel_cells(engine, _names(engine, defects, quick)) for engine in engines}
    right: dict[str, dict[str, Outcome]] = {}
    shown: dict[str, dict[tuple[str, str, str], float]] = {}
    told: dict[str, list[Outcome]] = {}
    total = len(clean) + len(defects)

    def one(defect: Defect) -> Row:
        begin = time.perf_counter()
        own = panel_cells(defect.engine, [defect.witness]) if quick and defect.kind != "clean" else cells[defect.engine]
        known = right.get(defect.engine, {})
        if defect.kind == "history":
            found = [known[cell.name] for cell in own]
        elif defect.engine in DECLARED:
            # What such an engine computes does not depend on what it is declared as.
            found = told.get(defect.name) or outcomes(defect, own)
            told[defect.name] = found
        else:
            found = outcomes(defect, own)
        if defect.kind == "clean" and not defect.edits:
            right[defect.engine] = {cell.name: outcome for cell, outcome in zip(own, found, strict=True)}
        results = judged(own, [reported(defect, outcome) for outcome in found])
        if defect.kind == "clean" and not defect.edits:
            shown[defect.engine] = headline_errors(results)
        row = selftest_row(defect, results, time.perf_counter() - begin)
        return row | {"headlines": headline_moves(results, shown.get(defect.engine, {}))}

    rows: list[Row] = []
    for batch in (clean, defects):
        rows += _in_parallel(one, batch, jobs, lambda done, name: progress(done, total, name), len(rows))
    return rows


def selftest_row(defect: Defect, results: Sequence[CaseResult], seconds: float) -> Row:
    """One row of the result.

    Returns
    -------
    dict
        ``defect, engine, kind, what``; ``caught``: whether a check failed; ``checks``: ids of those that did; ``by_case``: their
        number by case; ``hole``: why the suite cannot see this defect, where that is known; ``errors``: cells that ended without
        numbers, with the reason; ``judged``: number of checks that could fail; ``passed``: ids of those that passed, for the right
        engines only; ``edits``: module, text and replacement of each; ``seconds``. `run_selftest` adds ``headlines``, see
        `headline_moves`.
    """
    rows = [row for result in results for row in result.rows if row["status"] in JUDGED and row["quantity"]]
    failed = [row for row in rows if row["status"] == "fail"]
    broken = [result for result in results if result.status in ("error", "timeout")]
    clean = defect.kind == "clean"
    return {
        "defect": defect.id,
        "engine": defect.engine,
        "kind": defect.kind,
        "what": defect.what,
        # A report that the harness refuses is no result; an engine that fails by itself has told nothing wrong.
        "caught": bool(failed or (broken and defect.kind == "history")),
        "checks": [check_id(row) for row in failed],
        "by_case": dict(Counter(str(row["case"]) for row in failed)),
        "hole": defect.hole,
        "errors": [f"{_cell(result.cell)}: {result.reason}" for result in broken],
        "judged": len(rows),
        "passed": [check_id(row) for row in rows if row["status"] == "pass"] if clean else [],
        "edits": [[edit.name, edit.old, edit.new] for edit in defect.edits],
        "seconds": round(seconds, 3),
    }


def headline_errors(results: Sequence[CaseResult]) -> dict[tuple[str, str, str], float]:
    """Relative error by case, variant and headline; NaN where one has no number."""
    rows = [row for result in results for row in result.headlines]
    return {(row["case"], row["variant"], row["headline"]): float(row["rel_error"]) for row in rows}


def headline_moves(results: Sequence[CaseResult], right: Mapping[tuple[str, str, str], float]) -> dict[str, float]:
    """By case, how far a wrong engine moves the headline that it moves most from what the right one has, in parts of its scale.

    Infinite where one of the two has a number and the other none.
    """
    moved: dict[str, float] = {}
    for place, error in headline_errors(results).items():
        case, before = place[0], right.get(place, math.nan)
        apart = math.inf if math.isnan(error) != math.isnan(before) else abs(error - before)
        moved[case] = max(moved.get(case, 0.0), 0.0 if math.isnan(apart) else apart)
    return moved


MOVED = 1e-9
"""Part of its scale by which a headline has moved: round-off of a right engine is a thousandth of that."""


def looks_right(row: Mapping[str, Any]) -> list[str]:
    """Cases whose checks catch a wrong engine and whose headlines do not move: there it looks as accurate as the right one.

    Left out are cases that say why (`headlines_beside`).
    """
    return [case for case in row["by_case"] if row["headlines"].get(case, 0.0) <= MOVED and not headlines_beside(case)]


def headlines_beside(case: str) -> str:
    """Why the headlines of a case need not show each fault that its checks catch: the case's attribute ``beside_headlines``."""
    return str(getattr(get_case(case), "beside_headlines", ""))


def check_id(row: Mapping[str, Any]) -> str:
    """``case[variant] quantity (truth)``."""
    return f"{_cell(row)} {row['quantity']} ({row['truth']})"


def fine(row: Mapping[str, Any]) -> bool:
    """Whether a row is as it should be: a wrong engine caught or its hole known, a right one without a failure."""
    if row["kind"] == "clean":
        return not row["caught"] and not row["errors"]
    return bool(row["caught"] or row["hole"])


def _cell(row: Mapping[str, Any]) -> str:
    return f"{row['case']}[{row['variant']}]"


def _names(engine: str, defects: Sequence[Defect], quick: bool) -> list[str]:
    if not quick:
        return []
    return list(dict.fromkeys(defect.witness for defect in defects if defect.engine == engine))


def _in_parallel(
    one: Callable[[Defect], Row],
    defects: Sequence[Defect],
    jobs: int,
    progress: Callable[[int, str], None],
    before: int,
) -> list[Row]:
    """Rows in the order of the defects; the first exception ends it, and what has not begun is dropped."""
    rows: dict[int, Row] = {}
    with ThreadPoolExecutor(max(1, jobs)) as pool:
        waiting: dict[Future[Row], int] = {pool.submit(one, defect): k for k, defect in enumerate(defects)}
        try:
            while waiting:
                progress(before + len(rows), defects[min(waiting.values())].id)
                done, _ = wait(waiting, timeout=1.0, return_when=FIRST_COMPLETED)
                for future in done:
                    rows[waiting.pop(future)] = future.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            while any(not future.done() for future in waiting):
                end_commands()
                time.sleep(0.02)
            raise
    return [rows[k] for k in range(len(defects))]


class EngineWithResult:
    """The real engine's card with a result that is there already."""

    keeps_runs = True

    def __init__(self, real: Engine, outcome: Outcome) -> None:
        self.id, self._real, self._outcome = real.id, real, outcome

    def info(self) -> EngineInfo:
        """Facts about the real engine, which is what this one pretends to be."""
        return self._real.info()

    def supports(self, scene: Scene, numerics: Numerics) -> Support:
        """As the real engine."""
        return self._real.supports(scene, numerics)

    def run(self, scene: Scene, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:  # noqa: ARG002
        """Hand out the result, or raise what the engine raised."""
        if isinstance(self._outcome, EngineError):
            raise self._outcome
        return self._outcome


def outcomes(defect: Defect, cells: Sequence[Cell]) -> list[Outcome]:
    """Run the wrong engine on all cells, in one process of its own.

    Raises
    ------
    StaleEditError
        If an edit no longer fits.
    """
    check_edits(defect.edits)
    asked = [_setup(cell) for cell in cells]
    given = [_given(defect, setup) for setup in asked]
    with tempfile.TemporaryDirectory(prefix="ninedisk-selftest-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        files = [folder / f"answer-{k}.json" for k in range(len(given))]
        requests = [
            encode_request(Request(scene=scene, numerics=numerics, watch=setup.watch, answer_file=str(file)))
            for (scene, numerics), setup, file in zip(given, asked, files, strict=True)
        ]
        edits = [[edit.module, edit.old, edit.new] for edit in defect.edits]
        job = {"engine": RUNS.get(defect.engine, defect.engine), "edits": edits, "requests": requests}
        ended = ""
        try:
            run_isolated(
                [sys.executable, "-m", "ninedisk.harness.selftest.driver"],
                stdin=json.dumps(job),
                time_limit=TIME_LIMIT,
                env=_environment(defect),
            )
        except EngineError as error:
            ended = str(error)
        found = []
        for (scene, numerics), setup, file in zip(given, asked, files, strict=True):
            found.append(_read(file, scene, numerics, setup, ended))
        return found


def reported(defect: Defect, outcome: Outcome) -> Outcome:
    """What the wrong engine makes of its own result."""
    if isinstance(outcome, EngineError):
        return outcome
    if defect.timed is not None:
        outcome = replace(outcome, timings=defect.timed(outcome.timings))
    return outcome if defect.after is None else replace(outcome, history=defect.after(outcome.history))


def judged(cells: Sequence[Cell], found: Sequence[Outcome]) -> list[CaseResult]:
    """Results of the cells, held against all truths that bind the real engine."""
    results = []
    for cell, outcome in zip(cells, found, strict=True):
        if isinstance(cell.engine, Exception):
            raise cell.engine
        with np.errstate(all="ignore"):  # a wrong engine's numbers may be of any size
            results.append(run_cell(replace(cell, engine=EngineWithResult(cell.engine, outcome))))
    return results


def _setup(cell: Cell) -> Setup:
    if isinstance(cell.setup, Exception):
        raise cell.setup
    return cell.setup


def _given(defect: Defect, setup: Setup) -> tuple[Scene, Numerics]:
    scene, numerics = setup.scene, setup.numerics
    if defect.engine in DECLARED:
        scene, numerics = as_rigid(scene, numerics)
    return (scene, numerics) if defect.before is None else defect.before(scene, numerics)


def _read(file: Path, scene: Scene, numerics: Numerics, setup: Setup, ended: str) -> Outcome:
    """One answer; its times are those that were asked for, whatever the engine was told."""
    try:
        text = file.read_text(encoding="utf-8")
    except OSError:
        return EngineError(ended or "the process gave no answer")
    try:
        run = decode_answer(text, scene=scene, numerics=numerics, watch=setup.watch).run
    except EngineError as error:
        return error
    asked = np.multiply(setup.numerics.sampled_steps(), setup.numerics.dt, dtype=np.float64)
    return replace(run, history=replace(run.history, t=asked))


def _environment(defect: Defect) -> dict[str, str]:
    """One thread; kernels interpreted where they would have to be compiled for this defect alone, which takes half a minute.

    Results are the same. Edits elsewhere are of no module that kernels take a constant from, which a test asserts: they neither need
    other kernels nor leave wrong ones in the cache.
    """
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
    if any(touches_kernels(edit) for edit in defect.edits):
        environment["NUMBA_DISABLE_JIT"] = "1"
    return environment


def touches_kernels(edit: Edit) -> bool:
    """Whether the edited module holds kernels: those of the core are named so, which a test asserts."""
    return edit.module.endswith("kernels")
