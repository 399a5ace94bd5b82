"""Runs a wrong engine on the cells of its panel, and has its results judged like anyone's."""

from __future__ import annotations

import json
import os
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ninedisk.core.history import Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene
from ninedisk.harness.api.case import Setup
from ninedisk.harness.api.engine import Engine, EngineError, EngineInfo, EngineRun, Support
from ninedisk.harness.results.tables import CaseResult
from ninedisk.harness.run.isolation import run_isolated
from ninedisk.harness.run.plan import Cell
from ninedisk.harness.run.runner import run_cell
from ninedisk.harness.selftest.defect import Defect
from ninedisk.harness.selftest.edits import Edit, check_edits
from ninedisk.harness.wire.protocol import Request, decode_answer, encode_request

TIME_LIMIT = 300.0
"""Seconds for one wrong engine on its whole panel; the right ones take some ten, a minute where kernels are interpreted."""

INTERPRETED = frozenset({"dem"})
"""Engines whose kernels are never compiled: the DEM's step is a single kernel that takes a quarter of a minute to compile, and the
panel takes seconds to interpret. Results are the same."""

Outcome = EngineRun | EngineError


class Played:
    """The real engine's card with a result that is there already."""

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
    told = [_told(defect, setup) for setup in asked]
    with tempfile.TemporaryDirectory(prefix="ninedisk-selftest-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        files = [folder / f"answer-{k}.json" for k in range(len(told))]
        requests = [
            encode_request(Request(scene=scene, numerics=numerics, watch=setup.watch, answer_file=str(file)))
            for (scene, numerics), setup, file in zip(told, asked, files, strict=True)
        ]
        edits = [[edit.module, edit.old, edit.new] for edit in defect.edits]
        job = {"engine": defect.engine, "edits": edits, "requests": requests}
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
        for (scene, numerics), setup, file in zip(told, asked, files, strict=True):
            found.append(_read(file, scene, numerics, setup, ended))
        return found


def reported(defect: Defect, outcome: Outcome) -> Outcome:
    """What the wrong engine makes of its own result."""
    if defect.after is None or isinstance(outcome, EngineError):
        return outcome
    return replace(outcome, history=defect.after(outcome.history))


def judged(cells: Sequence[Cell], found: Sequence[Outcome]) -> list[CaseResult]:
    """Results of the cells, held against all truths that bind the real engine."""
    results = []
    for cell, outcome in zip(cells, found, strict=True):
        if isinstance(cell.engine, Exception):
            raise cell.engine
        with np.errstate(all="ignore"):  # a wrong engine's numbers may be of any size
            results.append(run_cell(replace(cell, engine=Played(cell.engine, outcome))))
    return results


def _setup(cell: Cell) -> Setup:
    if isinstance(cell.setup, Exception):
        raise cell.setup
    return cell.setup


def _told(defect: Defect, setup: Setup) -> tuple[Scene, Numerics]:
    if defect.before is None:
        return setup.scene, setup.numerics
    return defect.before(setup.scene, setup.numerics)


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
    """One thread; kernels interpreted where they would have to be compiled for this defect alone, which takes half a minute."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
    if defect.engine in INTERPRETED or any(touches_kernels(edit) for edit in defect.edits):
        environment["NUMBA_DISABLE_JIT"] = "1"
    return environment


def touches_kernels(edit: Edit) -> bool:
    """Whether the edited module holds kernels: those of the core are named so, which a test asserts."""
    return edit.module.endswith("_kernels")
