"""Curves: one sampled quantity each, cut out of the long tables."""

from __future__ import annotations

from collections.abc import Container, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

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


def split_series(table: Any) -> dict[tuple[str, str, str, str], Curve]:
    """Curves of a ``series`` table by (case, variant, engine, quantity)."""
    return {
        (key[0], key[1], key[2], key[3]): _curve(table, rows)
        for key, rows in _groups(table, ("case", "variant", "engine", "quantity"))
    }


def split_references(table: Any) -> dict[tuple[str, str, str], list[Curve]]:
    """Curves of a ``references`` table by (case, variant, quantity); several labels share a key.

    Curves of one label that differ (a truth that depends on the engine's conventions) follow each other in the table:
    a step that does not increase begins the next one.
    """
    found: dict[tuple[str, str, str], list[Curve]] = {}
    for key, rows in _groups(table, ("case", "variant", "quantity", "label")):
        steps = table["step"].take(rows).to_numpy(zero_copy_only=False)
        for part in np.split(rows, np.flatnonzero(np.diff(steps) <= 0) + 1):
            found.setdefault((key[0], key[1], key[2]), []).append(_curve(table, part, label=key[3]))
    return found


def keep_rows(table: Any, columns: tuple[str, ...], wanted: Container[tuple[str, ...]]) -> Any:
    """The rows of a table whose ``columns``, texts, are among the combinations ``wanted``, in the table's order."""
    kept = [rows for key, rows in _groups(table, columns) if key in wanted]
    rows = np.sort(np.concatenate(kept)) if kept else np.empty(0, dtype=np.int64)
    return table if len(rows) == table.num_rows else table.take(rows)


def differences(one: Curve, two: Curve, scale: float) -> float:
    """``max |one - two| / scale`` over the steps that both have; NaN if they share none, 0 without a scale."""
    _, a, b = np.intersect1d(one.step, two.step, return_indices=True)
    both = np.isfinite(one.value[a]) & np.isfinite(two.value[b])
    if not both.any():
        return float("nan")
    worst = float(np.abs(one.value[a][both] - two.value[b][both]).max())
    return worst / scale if scale > 0.0 else 0.0


def _groups(table: Any, columns: tuple[str, ...]) -> list[tuple[tuple[str, ...], NDArray[np.int64]]]:
    """Row numbers of each distinct combination of text columns, each in the table's own order."""
    import pyarrow.compute as pc

    if table.num_rows == 0:
        return []
    code = np.zeros(table.num_rows, dtype=np.int64)
    names = []
    for column in columns:
        coded = pc.fill_null(table[column], "").combine_chunks().dictionary_encode()
        names.append(coded.dictionary.to_pylist())
        code = code * len(names[-1]) + coded.indices.to_numpy(zero_copy_only=False)
    order = np.argsort(code, kind="stable")
    cuts = np.flatnonzero(np.diff(code[order])) + 1
    groups = []
    for rows in np.split(order, cuts):
        rest, key = int(code[rows[0]]), []
        for values in reversed(names):
            rest, digit = divmod(rest, len(values))
            key.append(str(values[digit]))
        groups.append((tuple(reversed(key)), rows))
    return groups


def _curve(table: Any, rows: NDArray[np.int64], label: str = "") -> Curve:
    part = table.take(rows)

    def column(name: str) -> FloatArray:
        return np.asarray(part[name].to_numpy(zero_copy_only=False), dtype=np.float64)

    order = np.argsort(column("step"), kind="stable")
    is_series = "expected" in part.column_names
    truths = [truth for truth in part["truth"].unique().to_pylist() if truth]
    return Curve(
        step=column("step")[order],
        t=column("t")[order],
        value=column("value")[order],
        expected=(column("expected") if is_series else np.full(len(rows), np.nan))[order],
        unit=part["unit"][0].as_py() or "",
        truth=truths[0] if truths else "",
        label=label,
        source="" if is_series else part["source"][0].as_py() or "",
    )
