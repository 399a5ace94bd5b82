"""Siconos' Coulomb solvers on saved contact problems: an independent check of the core's, in one process for all.

Siconos solves ``u = W r + q`` under the Coulomb law of `ninedisk.core.cd.problem`. Its status says little about how well:
judge its answers by `ninedisk.core.cd.problem.measure`, as `judge` does.
"""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ninedisk.core.cd.problem import ContactProblem, Residuals, measure
from ninedisk.core.validate import FloatArray
from ninedisk.harness.api.engine import EngineError, EngineNotInstalledError
from ninedisk.harness.engines.process import SYSTEM_PYTHON, clean_environment, system_python
from ninedisk.harness.engines.siconos.adapter import INSTALL, installed_siconos
from ninedisk.harness.run.isolation import run_isolated

Solver = Literal["nsgs", "lemke"]
ProblemFile = str | os.PathLike[str]
DRIVER = Path(__file__).with_name("solver_driver.py")


@dataclass(frozen=True, kw_only=True)
class Evaluation:
    """Siconos' error function at contact forces ``r``.

    Attributes
    ----------
    r, u : ndarray, shape (c, 2)
        Contact forces, and the contact velocities ``W r + q`` that Siconos computes from them.
    error : float
        ``|r - P(r - (u_n + mu |u_t|, u_t))| / max(|r|, |u|)``, as `fc2d_compute_error` has it: it depends on the units.
    scaled_error : float
        Its numerator for the problem whose rows are multiplied by each contact's ``rho``: ``|r - P(r - rho u)|`` [N], the
        numerator of `Residuals.natural_map`.
    """

    r: FloatArray
    u: FloatArray
    error: float
    scaled_error: float


@dataclass(frozen=True, kw_only=True)
class Solution(Evaluation):
    """What one of Siconos' solvers answers.

    Attributes
    ----------
    solver : {"nsgs", "lemke"}
    status : int
        Siconos' own word, 0 for success.
    iterations : int
        Sweeps of Gauss-Seidel, pivots of Lemke.
    reported_residual : float
        What the solver believes its residual to be, NaN if nothing; the definition differs by solver.
    seconds : float
        Wall-clock time of the solver alone.
    """

    solver: Solver
    status: int
    iterations: int
    reported_residual: float
    seconds: float


def solve_saved(
    files: Sequence[ProblemFile],
    solver: Solver = "nsgs",
    *,
    tolerance: float = 1e-12,
    max_iterations: int = 100_000,
) -> list[Solution]:
    """Solve problems that `ContactProblem.save` wrote, in their order.

    Parameters
    ----------
    files : sequence of path
    solver : {"nsgs", "lemke"}
        Gauss-Seidel, or Lemke's pivoting; both work on the dense matrix.
    tolerance : float
        Of Siconos' own criterion: for Gauss-Seidel the consistency of the velocities, relative to ``|q|``.
    max_iterations : int

    Raises
    ------
    EngineNotInstalledError
        If Siconos is not on this machine.
    EngineTimeoutError, EngineError
        If the process is stopped at its time limit, or fails.
    """
    jobs = [{"problem": os.fspath(Path(file).resolve()), "solver": solver, "reaction": []} for file in files]
    answers = _run(jobs, tolerance, max_iterations)
    return [
        Solution(
            **_evaluated(answer),
            solver=solver,
            status=answer["status"],
            iterations=answer["iterations"],
            reported_residual=np.nan if answer["reported_residual"] is None else answer["reported_residual"],
            seconds=answer["seconds"],
        )
        for answer in answers
    ]


def evaluate_saved(files: Sequence[ProblemFile], forces: Sequence[FloatArray]) -> list[Evaluation]:
    """Siconos' error function on saved problems at given contact forces, each of shape (c, 2); raises as `solve_saved`."""
    jobs = [
        {"problem": os.fspath(Path(file).resolve()), "solver": None, "reaction": np.ravel(r).tolist()}
        for file, r in zip(files, forces, strict=True)
    ]
    return [Evaluation(**_evaluated(answer)) for answer in _run(jobs, 1.0, 1)]


def judge(problem: ContactProblem, answer: Evaluation) -> Residuals:
    """Residuals of Siconos' contact forces under Coulomb's law, by the definition that all of the core's solvers obey."""
    return measure(problem, problem.body_velocity(answer.r), answer.r, sliding="coulomb")


def _evaluated(answer: dict[str, Any]) -> dict[str, Any]:
    r, u = (np.array(answer[name], dtype=np.float64).reshape(-1, 2) for name in ("r", "u"))
    return {"r": r, "u": u, "error": answer["error"], "scaled_error": answer["scaled_error"]}


def _run(jobs: list[dict[str, Any]], tolerance: float, max_iterations: int) -> list[dict[str, Any]]:
    version, reason = installed_siconos(SYSTEM_PYTHON)
    if version is None:
        raise EngineNotInstalledError(f"Siconos is not installed ({reason}): {INSTALL}")
    with tempfile.TemporaryDirectory(prefix="ninedisk-siconos-", ignore_cleanup_errors=True) as folder:
        answer_file = Path(folder) / "answer.json"
        request = {
            "jobs": jobs,
            "tolerance": tolerance,
            "max_iterations": max_iterations,
            "answer_file": str(answer_file),
        }
        done = run_isolated(
            system_python(str(DRIVER)),
            stdin=json.dumps(request, allow_nan=False),
            cwd=folder,
            env={**clean_environment(), "TMPDIR": folder},
        )
        try:
            answers = json.loads(answer_file.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise EngineError(f"Siconos ended without a readable answer ({error}):\n{done.last_lines()}") from error
    if isinstance(answers, dict):
        raise EngineError(f"Siconos gave up: {answers['error']}")
    found: list[dict[str, Any]] = answers
    return found
