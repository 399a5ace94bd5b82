"""Runs a case, or a matrix of cells: in this process, in workers beside it, or on a cluster."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ninedisk.harness.api.case import Case
from ninedisk.harness.api.engine import Engine
from ninedisk.harness.results.tables import CaseResult
from ninedisk.harness.run.plan import Cell, plan_case, plan_matrix
from ninedisk.harness.run.runner import Progress, run_cell

if TYPE_CHECKING:
    from ninedisk.harness.run.cluster import Cluster


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


def run_matrix(
    case_ids: Sequence[str],
    engine_ids: Sequence[str | Engine],
    overrides: Mapping[str, Any] | None = None,
    progress: Progress | None = None,
    *,
    published: Path | None = None,
    jobs: int = 0,
) -> list[CaseResult]:
    """Run every (case variant, engine) cell; see `ninedisk.harness.run.plan.plan_matrix` for the variants and the errors.

    A cell that fails, hangs or crashes is a status and never the end of the run. Where the user's own parameters make
    the only cell impossible, the `CoreError` is raised, because there is nothing else to show. ``jobs`` as in `run_cells`.
    """
    return run_cells(plan_matrix(case_ids, engine_ids, overrides or {}), progress, published=published, jobs=jobs)


def run_cells(
    cells: Sequence[Cell],
    progress: Progress | None = None,
    *,
    published: Path | None = None,
    jobs: int = 0,
    cluster: Cluster | None = None,
) -> list[CaseResult]:
    """Run planned cells; the results are in their order, and the same, wherever they run.

    Parameters
    ----------
    cells : sequence of Cell
    progress : callable, optional
    published : Path, optional
        Folder with digitised curves of your own that join the truths.
    jobs : int
        0: one after the other in this process, which an engine's crash ends. Else in that many worker processes, where a
        crash is a status.
    cluster : Cluster, optional
        Run them there instead.
    """
    alone = len(cells) == 1 and cells[0].user_set
    if cluster is not None:
        return cluster.run(cells, progress, published=published, raise_users_mistakes=alone)
    if jobs:
        from ninedisk.harness.run.workers import run_in_workers

        return run_in_workers(cells, progress, jobs=jobs, published=published, raise_users_mistakes=alone)
    results = []
    for done, cell in enumerate(cells):
        if progress is not None:
            progress(done, len(cells), cell.name)
        results.append(run_cell(cell, published=published, raise_users_mistakes=alone))
    if progress is not None:
        progress(len(cells), len(cells), "")
    return results
