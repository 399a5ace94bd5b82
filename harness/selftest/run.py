"""The self-test: right engines first, then every wrong one, each held against all checks of its panel."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from typing import Any

from ninedisk.harness.results.tables import CaseResult, Row
from ninedisk.harness.run.isolation import end_commands
from ninedisk.harness.run.plan import Cell
from ninedisk.harness.selftest.defect import Defect
from ninedisk.harness.selftest.edits import check_edits
from ninedisk.harness.selftest.gallery import CLEAN
from ninedisk.harness.selftest.panel import panel_cells
from ninedisk.harness.selftest.play import Outcome, judged, outcomes, reported

Progress = Callable[[int, int, str], None]

JUDGED = ("pass", "fail")
"""Statuses of checks that can fail; a known difference does not."""


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
    total = len(clean) + len(defects)

    def one(defect: Defect) -> Row:
        begin = time.perf_counter()
        own = panel_cells(defect.engine, [defect.witness]) if quick and defect.kind != "clean" else cells[defect.engine]
        known = right.get(defect.engine, {})
        found = [known[cell.name] for cell in own] if defect.kind == "history" else outcomes(defect, own)
        if defect.kind == "clean" and not defect.edits:
            right[defect.engine] = {cell.name: outcome for cell, outcome in zip(own, found, strict=True)}
        results = judged(own, [reported(defect, outcome) for outcome in found])
        return selftest_row(defect, results, time.perf_counter() - begin)

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
        engines only; ``edits``: module, text and replacement of each; ``seconds``.
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
        "caught": bool(failed),
        "checks": [check_id(row) for row in failed],
        "by_case": dict(Counter(str(row["case"]) for row in failed)),
        "hole": defect.hole,
        "errors": [f"{_cell(result.cell)}: {result.reason}" for result in broken],
        "judged": len(rows),
        "passed": [check_id(row) for row in rows if row["status"] == "pass"] if clean else [],
        "edits": [[edit.name, edit.old, edit.new] for edit in defect.edits],
        "seconds": round(seconds, 3),
    }


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
