"""The self-test: right engines first, then every wrong one, each run on the cells of its panel and held against all their checks."""

from __future__ import annotations

import json
import math
import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import astuple, replace
from fnmatch import fnmatchcase
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
from ninedisk.harness.run import isolation
from ninedisk.harness.run.isolation import end_commands, run_isolated
from ninedisk.harness.run.plan import Cell
from ninedisk.harness.run.runner import run_cell
from ninedisk.harness.selftest.declared import DECLARED, RUNS, as_rigid
from ninedisk.harness.selftest.defect import Defect
from ninedisk.harness.selftest.edits import Edit, check_edits
from ninedisk.harness.selftest.mutants import CLEAN
from ninedisk.harness.selftest.panel import PANELS, panel_cells
from ninedisk.harness.wire.protocol import Request, decode_answer, encode_request

Progress = Callable[[int, int, str], None]

JUDGED = ("pass", "fail")
"""Statuses of checks that can fail; a known difference does not."""


TIME_LIMIT = 300.0
"""Seconds for one wrong engine on its whole panel; the right ones take some ten, minutes where kernels are interpreted."""

TOGETHER = 8
"""Runs of the unchanged core that share a process where each is short: to start one takes longer than such a run."""

DRIVER = str(Path(__file__).with_name("driver.py"))

Outcome = EngineRun | EngineError


def run_selftest(
    defects: Sequence[Defect], *, jobs: int = 1, quick: bool = False, progress: Progress = lambda *_: None
) -> list[Row]:
    """Run the right engines and the wrong ones.

    Parameters
    ----------
    defects : sequence of Defect
    jobs : int
        Wrong engines that run at the same time, each in its own process.
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
    total = len(clean) + len(defects)

    def own_cells(defect: Defect) -> list[Cell]:
        if quick and defect.kind != "clean":
            return panel_cells(defect.engine, [defect.witness])
        return cells[defect.engine]

    def row_of(defect: Defect, own: Sequence[Cell], found: Sequence[Outcome], seconds: float) -> Row:
        begin = time.perf_counter()
        if defect.kind == "clean" and not defect.edits:
            right[defect.engine] = {cell.name: outcome for cell, outcome in zip(own, found, strict=True)}
        results = judged_results(own, [altered_report(defect, outcome) for outcome in found])
        if defect.kind == "clean" and not defect.edits:
            shown[defect.engine] = headline_errors(results)
        row = selftest_row(defect, results, seconds + time.perf_counter() - begin)
        return row | {"headlines": headline_moves(results, shown.get(defect.engine, {}))}

    def rows_of(unit: Sequence[Defect]) -> list[Row]:
        begin = time.perf_counter()
        asked = [(defect, own_cells(defect)) for defect in unit]
        if unit[0].kind == "history":
            known = [[right[defect.engine][cell.name] for cell in own] for defect, own in asked]
            return [row_of(*each, found, 0.0) for each, found in zip(asked, known, strict=True)]
        # What a declared engine computes does not depend on what it is declared as: it runs once.
        once = {_run_of(defect): (defect, own) for defect, own in reversed(asked)}
        told = dict(zip(once, run_in_one_process(list(once.values())), strict=True))
        seconds = (time.perf_counter() - begin) / len(unit)
        return [row_of(defect, own, told[_run_of(defect)], seconds) for defect, own in asked]

    rows: list[Row] = []
    with _warm_starts():
        for batch in (clean, defects):
            units = _units(batch, TOGETHER if quick else 1)
            rows += _in_parallel(rows_of, batch, units, jobs, lambda done, name: progress(done, total, name), len(rows))
    return rows


def _run_of(defect: Defect) -> tuple[str, ...]:
    """What distinguishes the runs of two defects."""
    return ("declared", defect.name) if defect.engine in DECLARED else (defect.engine, defect.name)


def _units(defects: Sequence[Defect], most: int) -> list[list[Defect]]:
    """Defects that share a process: one that edits the core has its own; up to ``most`` runs of the unchanged core share one.

    The same run under several declarations is one. Unchanged engines and reports of finished runs are a unit each.
    """
    units: list[list[Defect]] = []
    runs: dict[str, dict[tuple[str, ...], list[Defect]]] = {}
    for defect in defects:
        if defect.edits or defect.kind == "history":
            units.append([defect])
        else:
            runs.setdefault(RUNS.get(defect.engine, defect.engine), {}).setdefault(_run_of(defect), []).append(defect)
    for shared in runs.values():
        sets = list(shared.values())
        units += [[defect for same in sets[k : k + most] for defect in same] for k in range(0, len(sets), most)]
    return units


@contextmanager
def _warm_starts() -> Iterator[None]:
    """Processes of wrong engines start as copies of one that has loaded all except the core (`isolation.ForkServer`); they end here."""
    before = isolation._fork_servers
    isolation.warm_starts()
    mine = isolation._fork_servers
    try:
        yield
    finally:
        isolation._fork_servers = before
        if before is None and mine is not None:
            for fork_server in mine.values():
                fork_server.end()


def selftest_row(defect: Defect, results: Sequence[CaseResult], seconds: float) -> Row:
    """One row of the result.

    Returns
    -------
    dict
        ``defect, engine, kind, what``; ``caught``: whether a check failed; ``checks``: ids of those that did; ``by_case``: their
        number by case; ``hole``: why the suite cannot see this defect, where that is known; ``errors``: cells that ended without
        numbers, with the reason; ``judged``: number of checks that could fail; ``passed``: ids of those that passed, for the right
        engines only; ``edits``: place, code and replacement of each; ``seconds``. `run_selftest` adds ``headlines``, see
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
        # A report that the harness refuses is no result; an engine that fails by itself has reported nothing wrong.
        "caught": bool(failed or (broken and defect.kind == "history")),
        "checks": [check_id(row) for row in failed],
        "by_case": dict(Counter(str(row["case"]) for row in failed)),
        "hole": defect.hole,
        "errors": [f"{_cell(result.cell)}: {result.reason}" for result in broken],
        "judged": len(rows),
        "passed": [check_id(row) for row in rows if row["status"] == "pass"] if clean else [],
        "edits": [[edit.place, edit.old, edit.new] for edit in defect.edits],
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


def headlines_agree(row: Mapping[str, Any]) -> list[str]:
    """Cases whose checks catch a wrong engine and whose headlines do not move: there it looks as accurate as the right one.

    Left out are cases that say why for each quantity whose check fails (`unseen_quantities`).
    """
    return [
        case
        for case in row["by_case"]
        if row["headlines"].get(case, 0.0) <= MOVED and unseen_quantities(case, row["checks"])
    ]


def unseen_quantities(case: str, checks: Sequence[str]) -> list[str]:
    """Quantities of a case's failed checks (`check_id`) of which it does not say why its headlines need not show them.

    The case's attribute ``beside_headlines`` pairs patterns of names with reasons.
    """
    patterns = [pattern for pattern, _ in getattr(get_case(case), "beside_headlines", ())]
    quantities = {each.rpartition("] ")[2].partition(" (")[0] for each in checks if each.startswith(f"{case}[")}
    return sorted(name for name in quantities if not any(fnmatchcase(name, pattern) for pattern in patterns))


def check_id(row: Mapping[str, Any]) -> str:
    """``case[variant] quantity (truth)``."""
    return f"{_cell(row)} {row['quantity']} ({row['truth']})"


def is_as_expected(row: Mapping[str, Any]) -> bool:
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
    rows_of: Callable[[Sequence[Defect]], list[Row]],
    defects: Sequence[Defect],
    units: Sequence[Sequence[Defect]],
    jobs: int,
    progress: Callable[[int, str], None],
    before: int,
) -> list[Row]:
    """Rows in the order of the defects; the first exception ends it, and what has not begun is dropped."""
    rows: dict[str, Row] = {}
    with ThreadPoolExecutor(max(1, jobs)) as pool:
        waiting: dict[Future[list[Row]], Sequence[Defect]] = {pool.submit(rows_of, unit): unit for unit in units}
        try:
            while waiting:
                progress(before + len(rows), next(iter(waiting.values()))[0].id)
                done, _ = wait(waiting, timeout=1.0, return_when=FIRST_COMPLETED)
                for future in done:
                    unit = waiting.pop(future)
                    rows |= {defect.id: row for defect, row in zip(unit, future.result(), strict=True)}
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            while any(not future.done() for future in waiting):
                end_commands()
                time.sleep(0.02)
            raise
    return [rows[defect.id] for defect in defects]


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


def run_in_one_process(asked: Sequence[tuple[Defect, Sequence[Cell]]]) -> list[list[Outcome]]:
    """Run defects with the same edits on their cells, in one process; one that it ended before is run again, alone."""
    if len(asked) == 1:
        ((defect, cells),) = asked
        return [outcomes(defect, cells, compiled=len(cells) == 1 and _takes_long(defect))]
    found = _outcomes(asked)
    # Where the process ended early, its end is the answer of all that were to come.
    return [
        outcomes(*each) if any(isinstance(outcome, _ProcessEndedError) for outcome in one) else one
        for each, one in zip(asked, found, strict=True)
    ]


def outcomes(defect: Defect, cells: Sequence[Cell], *, compiled: bool = False) -> list[Outcome]:
    """Run the wrong engine on all cells, in its own process; ``compiled``: with kernels compiled for it, not interpreted.

    Raises
    ------
    StaleEditError
        If an edit no longer fits.
    """
    return _outcomes([(defect, cells)], compiled=compiled)[0]


def _takes_long(defect: Defect) -> bool:
    """Whether the witness takes longer with interpreted kernels than their compilation does."""
    return PANELS[defect.engine][defect.witness].long if defect.witness else False


class _ProcessEndedError(EngineError):
    """The process ended before it answered."""


def _outcomes(asked: Sequence[tuple[Defect, Sequence[Cell]]], *, compiled: bool = False) -> list[list[Outcome]]:
    first = asked[0][0]
    check_edits(first.edits)
    setups = [[_setup(cell) for cell in cells] for _, cells in asked]
    given = [[_engine_answers(defect, setup) for setup in own] for (defect, _), own in zip(asked, setups, strict=True)]
    with tempfile.TemporaryDirectory(prefix="ninedisk-selftest-", ignore_cleanup_errors=True) as name:
        files = [[Path(name) / f"answer-{k}-{n}.json" for n in range(len(own))] for k, own in enumerate(setups)]
        runs = [
            [(scene, numerics, setup, file) for (scene, numerics), setup, file in zip(*each, strict=True)]
            for each in zip(given, setups, files, strict=True)
        ]
        requests = [
            encode_request(Request(scene=scene, numerics=numerics, watch=setup.watch, answer_file=str(file)))
            for own in runs
            for scene, numerics, setup, file in own
        ]
        edits = [astuple(edit) for edit in first.edits]
        job = {"engine": RUNS.get(first.engine, first.engine), "edits": edits, "requests": requests}
        ended = ""
        # Kernels with edits are compiled into a folder that nobody else reads, by a process that others are no copies of.
        cache = Path(name) / "kernels" if compiled and any(map(touches_kernels, first.edits)) else None
        try:
            run_isolated(
                [sys.executable, "-P", DRIVER],
                stdin=json.dumps(job),
                time_limit=TIME_LIMIT,
                env=_environment(first, cache),
                driver=DRIVER if cache is None else None,
            )
        except EngineError as error:
            ended = str(error)
        return [[_read(file, scene, numerics, setup, ended) for scene, numerics, setup, file in own] for own in runs]


def altered_report(defect: Defect, outcome: Outcome) -> Outcome:
    """What the wrong engine makes of its own result."""
    if isinstance(outcome, EngineError):
        return outcome
    if defect.timed is not None:
        outcome = replace(outcome, timings=defect.timed(outcome.timings))
    return outcome if defect.after is None else replace(outcome, history=defect.after(outcome.history))


def judged_results(cells: Sequence[Cell], found: Sequence[Outcome]) -> list[CaseResult]:
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


def _engine_answers(defect: Defect, setup: Setup) -> tuple[Scene, Numerics]:
    scene, numerics = setup.scene, setup.numerics
    if defect.engine in DECLARED:
        scene, numerics = as_rigid(scene, numerics)
    return (scene, numerics) if defect.before is None else defect.before(scene, numerics)


def _read(file: Path, scene: Scene, numerics: Numerics, setup: Setup, ended: str) -> Outcome:
    """One answer; its times are those that were asked for, whatever the engine was given."""
    try:
        text = file.read_text(encoding="utf-8")
    except OSError:
        return _ProcessEndedError(ended or "the process gave no answer")
    try:
        run = decode_answer(text, scene=scene, numerics=numerics, watch=setup.watch).run
    except EngineError as error:
        return error
    asked = np.multiply(setup.numerics.sampled_steps(), setup.numerics.dt, dtype=np.float64)
    return replace(run, history=replace(run.history, t=asked))


def _environment(defect: Defect, cache: Path | None = None) -> dict[str, str]:
    """One thread; kernels interpreted where they would have to be compiled for this defect alone, which takes a minute.

    With ``cache`` they are compiled, into this folder; the optimiser does its least, since one run is all that the kernels are for.
    Results are the same. Edits elsewhere are of no module that kernels take a constant from, which a test asserts: they neither need
    other kernels nor leave wrong ones in the cache.
    """
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
    if cache is not None:
        environment |= {"NUMBA_CACHE_DIR": str(cache), "NUMBA_OPT": "1"}
    elif any(touches_kernels(edit) for edit in defect.edits):
        environment["NUMBA_DISABLE_JIT"] = "1"
    return environment


def touches_kernels(edit: Edit) -> bool:
    """Whether the edited module holds kernels: those of the core are named so, which a test asserts."""
    return edit.module.endswith("kernels")
