"""What comes out of a cell (one variant of a case on one engine), and the tables that a run of many cells is stored as."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from ninedisk.harness.results.schema import (
    CELL_COLUMNS,
    CLAIM_COLUMNS,
    EMPTY,
    HEADLINE_COLUMNS,
    MEASUREMENT_COLUMNS,
    REFERENCE_COLUMNS,
    SERIES_COLUMNS,
    Row,
)

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

    from ninedisk.core.history import History
    from ninedisk.harness.api.case import Check, Observed, Setup

CurveColumns = Mapping[str, Any]
"""A curve as columns of its table: arrays of one value a sample (``step`` is one), and what all of its rows share."""


Columns = Mapping[str, Any]
"""A table by columns: a sequence of values each, None or NaN where a value is unknown."""


@dataclass(frozen=True, kw_only=True)
class CaseResult:
    """One variant of a case on one engine.

    Attributes
    ----------
    cell : dict
        The row of `schema.CELL_COLUMNS`.
    rows : list of dict
        Rows of `schema.MEASUREMENT_COLUMNS`; a cell that did not run has one with its status.
    headlines : list of dict
        Rows of `schema.HEADLINE_COLUMNS`.
    curves, reference_curves : sequence of CurveColumns
        What `schema.SERIES_COLUMNS` and `schema.REFERENCE_COLUMNS` hold of it, a curve each.
    setup, history, observed : or None
        What was run and what came out; None where it did not get that far.
    checks : sequence of Check
        The truths that it was held against.
    """

    cell: Row
    rows: list[Row]
    headlines: Sequence[Row] = ()
    curves: Sequence[CurveColumns] = ()
    reference_curves: Sequence[CurveColumns] = ()
    setup: Setup | None = None
    history: History | None = None
    observed: Observed | None = None
    checks: Sequence[Check] = ()

    @property
    def status(self) -> str:
        """Status of the cell, one of `schema.STATUSES`."""
        return str(self.cell["status"])

    @property
    def reason(self) -> str:
        """Why the status is what it is; empty for a pass."""
        return str(self.cell["reason"])

    @property
    def params(self) -> dict[str, Any]:
        """The complete parameters of the variant."""
        params: dict[str, Any] = json.loads(self.cell["params"])
        return params

    @property
    def statuses(self) -> set[str]:
        """Statuses of the cell and of all of its measurements."""
        return {self.status, *(str(row["status"]) for row in self.rows)}

    @property
    def measurements(self) -> pd.DataFrame:
        """A row per checked quantity, columns of `schema.MEASUREMENT_COLUMNS`."""
        import pandas as pd

        return pd.DataFrame(of_rows(self.rows, MEASUREMENT_COLUMNS))

    @property
    def series(self) -> pd.DataFrame:
        """A row per quantity and sampled step, columns of `schema.SERIES_COLUMNS`."""
        import pandas as pd

        return pd.DataFrame(_of_curves(self.curves, SERIES_COLUMNS))


def complete(row: Mapping[str, Any], columns: Mapping[str, str]) -> Row:
    """A row with every column of the table, empty values where ``row`` has none; KeyError for an unknown column."""
    unknown = set(row) - set(columns)
    if unknown:
        raise KeyError(f"no such column: {', '.join(sorted(unknown))}")
    return {name: row.get(name, EMPTY[kind]) for name, kind in columns.items()}


def tables(results: Sequence[CaseResult], claims: Sequence[Row]) -> dict[str, Columns]:
    """Every table of `schema.TABLES`, with exactly its columns; KeyError where a row lacks one."""
    return {
        "cells": of_rows([result.cell for result in results], CELL_COLUMNS),
        "measurements": of_rows([row for result in results for row in result.rows], MEASUREMENT_COLUMNS),
        "series": _of_curves([curve for result in results for curve in result.curves], SERIES_COLUMNS),
        "references": _of_curves(distinct_curves(results), REFERENCE_COLUMNS),
        "claims": of_rows(claims, CLAIM_COLUMNS),
        "headlines": of_rows([row for result in results for row in result.headlines], HEADLINE_COLUMNS),
    }


def distinct_curves(results: Sequence[CaseResult]) -> list[CurveColumns]:
    """Each reference curve once: the same truth binds several engines; curves that differ keep both."""
    kept: dict[tuple[Any, ...], CurveColumns] = {}
    for curve in (curve for result in results for curve in result.reference_curves):
        names = tuple(curve[name] for name in ("case", "variant", "label", "quantity"))
        kept.setdefault((*names, curve["step"].tobytes(), curve["value"].tobytes()), curve)
    return list(kept.values())


def write_table(table: Columns, columns: Mapping[str, str], stream: IO[bytes]) -> None:
    """Write a table as Parquet, its columns of the kinds that the schema names; an unknown number is null in the file."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    found = {
        name: _arrow_of_texts(table[name]) if kind == "string" else _arrow_of_numbers(table[name], kind)
        for name, kind in columns.items()
    }
    pq.write_table(pa.table(found), stream, compression="zstd")


# Arrow is handed the bytes of its arrays: `pyarrow.array` loads pandas, which takes longer than many a run.
def _arrow_of_numbers(values: Any, kind: str) -> pa.Array:
    import pyarrow as pa

    # A float never becomes an integer; of no values NumPy does not know the kind.
    held = np.asarray(values, dtype=kind if kind == "float64" or not len(values) else None).astype(kind, casting="safe")
    unknown = np.isnan(held)
    valid = pa.py_buffer(np.packbits(~unknown, bitorder="little")) if unknown.any() else None
    return pa.Array.from_buffers(pa.from_numpy_dtype(held.dtype), len(held), [valid, pa.py_buffer(held)])


def _arrow_of_texts(values: Sequence[str]) -> pa.Array:
    import pyarrow as pa

    places = {text: place for place, text in enumerate(dict.fromkeys(values))}  # the rows of a curve share theirs
    codes = np.fromiter(map(places.__getitem__, values), np.int64, len(values))
    texts = [text.encode() for text in places]
    ends, data = np.cumsum([0, *map(len, texts)], dtype=np.int32), pa.py_buffer(b"".join(texts))
    each = pa.Array.from_buffers(pa.string(), len(texts), [None, pa.py_buffer(ends), data])
    return pa.DictionaryArray.from_arrays(_arrow_of_numbers(codes, "int64"), each).dictionary_decode()


def of_rows(rows: Sequence[Row], columns: Mapping[str, str]) -> Columns:
    """The columns of a table from its rows; KeyError where a row lacks one."""
    return {name: [_storable(row[name]) for row in rows] for name in columns}


def _of_curves(curves: Sequence[CurveColumns], columns: Mapping[str, str]) -> Columns:
    lengths = [len(curve["step"]) for curve in curves]

    def column(name: str) -> Any:
        values = [_storable(curve[name]) for curve in curves]
        if values and isinstance(values[0], np.ndarray):
            return np.concatenate(values)
        return np.repeat(np.array(values, dtype=object), lengths)

    return {name: column(name) for name in columns}


def _storable(value: Any) -> Any:
    """Text as UTF-8 can hold it: a path or an engine's message may have halves of characters (surrogates)."""
    return value.encode("utf-8", errors="backslashreplace").decode("utf-8") if isinstance(value, str) else value


def plain_json(data: Any) -> str:
    """JSON text of plain data; numbers that JSON does not know become null, NumPy values become Python's."""
    return json.dumps(_plain(data), allow_nan=False)


def _plain(data: Any) -> Any:
    if isinstance(data, Mapping):
        return {_storable(str(key)): _plain(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_plain(value) for value in data]
    if isinstance(data, np.ndarray | np.generic):
        return _plain(data.tolist())
    if isinstance(data, float) and not math.isfinite(data):
        return None
    if data is None or isinstance(data, int | float | bool):
        return data
    return _storable(str(data))
