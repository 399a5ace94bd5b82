"""What the pages are made of: the newest rows of each case variant and engine of a store, and its curves."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ninedisk.harness.results.reader import (
    CELL_KEY,
    CellKey,
    cell_key,
    read_about,
    read_determinism,
    read_rows,
    read_table,
    read_tuning,
    run_ids,
    run_time,
)
from ninedisk.harness.results.schema import Comparison, EvaluatedFinding, Row
from ninedisk.reports.folder import ReportError

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Stored:
    """What the pages are made of.

    Parameters
    ----------
    runs : list of dict
        ``run.json`` of every run that contributes a row, newest first.
    cells, measurements, claims, headlines : list of dict
        Rows with the columns of `ninedisk.harness.results.schema`.
    series, references : mapping
        Curves by (case, variant, engine, quantity), and by (case, variant, quantity).
    outdated : list of str
        Cells that were left out because their case has a newer version.
    findings : sequence of EvaluatedFinding
        What the store says of known findings, largest first; whoever builds the report evaluates them.
    changes : Comparison or None
        The newest run against the one before, where whoever builds the report compared them.
    determinism : sequence of dict
        Rows of `ninedisk.harness.results.schema.DETERMINISM_COLUMNS`.
    tuning : sequence of dict
        Records of ``ninedisk tune --all``.
    """

    runs: list[Row]
    cells: list[Row]
    measurements: list[Row]
    claims: list[Row]
    headlines: list[Row]
    series: Series
    references: References
    outdated: list[str] = field(default_factory=list)
    findings: Sequence[EvaluatedFinding] = ()
    changes: Comparison | None = None
    determinism: Sequence[Row] = ()
    tuning: Sequence[Row] = ()


def load_store(store: Path) -> Stored:
    """Read every finished run below ``store/runs`` and keep the newest rows.

    For each (case, variant, engine) the newest run by ``started`` wins; reference curves follow the newest run of their
    (case, variant), claims the newest run that states them. Cells of an older case version than the newest stored one
    are left out, because results of two definitions must not stand in one table.

    Which cells are shown is found from their keys alone: of a cell that a newer run replaces, no scene, frame, measurement or
    curve is read or made.

    Raises
    ------
    ReportError
        If the store has no finished run, or none with cells.
    StoreError
        If a run was written by a newer schema, or is damaged.
    """
    runs = _finished_runs(store)
    owner: dict[CellKey, int] = {}
    versions: dict[CellKey, int] = {}
    for index, run in enumerate(runs):
        for row in read_rows(store, run, "cells", (*CELL_KEY, "case_version")):
            owner[cell_key(row)], versions[cell_key(row)] = index, row["case_version"]
    version: dict[str, int] = {}
    for key, number in versions.items():
        version[key[0]] = max(version.get(key[0], 0), number)
    old = [key for key, number in versions.items() if number < version[key[0]]]
    for key in old:
        del owner[key]
    if not owner:
        raise ReportError(f"{store} holds no results: its runs have no cells; run `ninedisk run --store {store}` first")

    reference_owner: dict[tuple[str, str], int] = {}
    for (case, variant, _), index in owner.items():
        reference_owner[case, variant] = max(index, reference_owner.get((case, variant), -1))
    cells: dict[CellKey, Row] = {}
    measurements: list[Row] = []
    claims: dict[tuple[str, str, str], Row] = {}
    headlines: list[Row] = []
    series: dict[tuple[str, str, str, str], Curve] = {}
    references: dict[tuple[str, str, str], list[Curve]] = {}
    shown = set(owner.values())
    for index, run in enumerate(runs):
        claims |= {(row["claim"], row["case"], row["engine"]): row for row in read_rows(store, run, "claims")}
        if index not in shown:
            continue
        own = {key for key, run_index in owner.items() if run_index == index}
        places = {place for place, run_index in reference_owner.items() if run_index == index}
        cells |= {cell_key(row): row for row in _rows_of(own, store, run, "cells")}
        measurements += _rows_of(own, store, run, "measurements")
        headlines += _rows_of(own, store, run, "headlines")
        series |= split_series(keep_rows(read_table(store, run, "series"), CELL_KEY, own))
        references |= split_references(keep_rows(read_table(store, run, "references"), CELL_KEY[:2], places))
    used = [run for index, run in reversed(list(enumerate(runs))) if index in shown]
    outdated = [f"{case} / {variant} on {engine}" for case, variant, engine in sorted(old)]
    return Stored(
        runs=used,
        cells=[cells[key] for key in owner],
        measurements=measurements,
        claims=list(claims.values()),
        headlines=headlines,
        series=series,
        references=references,
        outdated=outdated,
        determinism=read_determinism(store),
        tuning=read_tuning(store),
    )


def _finished_runs(store: Path) -> list[Row]:
    """``run.json`` of every finished run, oldest first."""
    if not (store / "runs").is_dir():
        raise ReportError(f"{store} is no store: it has no folder 'runs'; name the folder that `ninedisk run` wrote")
    runs = [read_about(store, run_id) for run_id in run_ids(store)]
    if not runs:
        raise ReportError(f"{store} holds no finished run: run `ninedisk run --store {store}` first")
    return sorted(runs, key=lambda run: (run_time(str(run["started"])), str(run["run_id"])))


def _rows_of(own: Container[CellKey], store: Path, run: Row, name: str) -> list[Row]:
    """The rows of a run's table that belong to the cells ``own``."""
    return keep_rows(read_table(store, run, name), CELL_KEY, own).to_dict("records")  # type: ignore[return-value]


FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Curve:
    """One quantity over the samples of a run or of a reference, ordered by step.

    Parameters
    ----------
    step, t, value, expected : ndarray, shape (s,)
        Step numbers, times [s], values and best truth in ``unit`` (NaN where none speaks).
    unit : str
    truth : str
        Kind of the truth behind ``expected`` (series) or of the curve itself (references).
    label, source : str
        Name and origin of a reference curve; empty for series.
    """

    step: FloatArray
    t: FloatArray
    value: FloatArray
    expected: FloatArray
    unit: str
    truth: str
    label: str = ""
    source: str = ""

    @property
    def error(self) -> FloatArray:
        """``|value - expected|``; NaN where there is no truth."""
        with np.errstate(invalid="ignore"):  # inf - inf
            return np.abs(self.value - self.expected)

    @property
    def scale(self) -> float:
        """Largest finite ``|expected|``; 0 without truth."""
        size = np.abs(self.expected[np.isfinite(self.expected)])
        return float(size.max()) if len(size) else 0.0


Series = Mapping[tuple[str, str, str, str], Curve]
References = Mapping[tuple[str, str, str], list[Curve]]


def split_series(table: pd.DataFrame) -> dict[tuple[str, str, str, str], Curve]:
    """Curves of a ``series`` table by (case, variant, engine, quantity)."""
    return {key: _curve(rows) for key, rows in table.groupby([*CELL_KEY, "quantity"], sort=False)}  # type: ignore[misc]


def split_references(table: pd.DataFrame) -> dict[tuple[str, str, str], list[Curve]]:
    """Curves of a ``references`` table by (case, variant, quantity); several labels share a key.

    Curves of one label that differ (a truth that depends on the engine's conventions) follow each other in the table:
    a step that does not increase begins the next one.
    """
    found: dict[tuple[str, str, str], list[Curve]] = {}
    for key, rows in table.groupby(["case", "variant", "quantity", "label"], sort=False):
        case, variant, quantity, label = map(str, key)
        cuts = [0, *(np.flatnonzero(np.diff(rows["step"]) <= 0) + 1), len(rows)]
        curves = [_curve(rows.iloc[begin:end], label) for begin, end in pairwise(cuts)]
        found.setdefault((case, variant, quantity), []).extend(curves)
    return found


def keep_rows(table: pd.DataFrame, columns: tuple[str, ...], wanted: Container[tuple[str, ...]]) -> pd.DataFrame:
    """The rows of a table whose ``columns``, texts, are among the combinations ``wanted``, in the table's order."""
    keys = zip(*(table[column].tolist() for column in columns), strict=True)
    return table[np.fromiter((key in wanted for key in keys), dtype=np.bool_, count=len(table))]


def differences(one: Curve, two: Curve, scale: float) -> float:
    """``max |one - two| / scale`` over the steps that both have; NaN if they share none, 0 without a scale."""
    _, a, b = np.intersect1d(one.step, two.step, return_indices=True)
    both = np.isfinite(one.value[a]) & np.isfinite(two.value[b])
    if not both.any():
        return float("nan")
    worst = float(np.abs(one.value[a][both] - two.value[b][both]).max())
    return worst / scale if scale > 0.0 else 0.0


def _curve(rows: pd.DataFrame, label: str = "") -> Curve:
    ordered = rows.sort_values("step", kind="stable")

    def column(name: str) -> FloatArray:
        return ordered[name].to_numpy(dtype=np.float64)

    is_series = "expected" in rows
    return Curve(
        step=column("step"),
        t=column("t"),
        value=column("value"),
        expected=column("expected") if is_series else np.full(len(rows), np.nan),
        unit=str(rows["unit"].iloc[0]),
        truth=next((str(truth) for truth in rows["truth"].unique() if truth), ""),
        label=label,
        source="" if is_series else str(rows["source"].iloc[0]),
    )
