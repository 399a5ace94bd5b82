"""Result tables in Arrow's memory layout.

Columns are made from buffers: `pyarrow.array` would import pandas to look whether it was given a Series, a third of a
second that a run of 0.1 s should not pay.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ninedisk.harness.results.schema import TABLES
from ninedisk.harness.results.tables import EMPTY, Block, CaseResult, Row
from ninedisk.harness.results.tables_part import distinct_references

if TYPE_CHECKING:
    import pyarrow as pa
_DTYPES = {"float64": np.float64, "int64": np.int64}


def arrow_tables(results: Sequence[CaseResult], claims: Sequence[Row]) -> dict[str, pa.Table]:
    """Every table of `records.TABLES`, with exactly its columns; KeyError where a row lacks one."""
    series = [block for result in results for block in result.series_blocks]
    references = distinct_references([block for result in results for block in result.reference_blocks])
    return {
        "cells": _from_rows("cells", [result.cell for result in results]),
        "measurements": _from_rows("measurements", [row for result in results for row in result.rows]),
        "series": _from_blocks("series", series),
        "references": _from_blocks("references", references),
        "claims": _from_rows("claims", claims),
    }


def _from_rows(name: str, rows: Sequence[Row]) -> pa.Table:
    columns = TABLES[name]
    return _table(name, {column: [_array([row[column] for row in rows], kind)] for column, kind in columns.items()})


def _from_blocks(name: str, blocks: Sequence[Block]) -> pa.Table:
    def part(block: Block, column: str, kind: str) -> pa.Array:
        value = block.columns[column]
        return _array(value if isinstance(value, np.ndarray) else [value] * block.length, kind)

    return _table(name, {c: [part(block, c, kind) for block in blocks] for c, kind in TABLES[name].items()})


def _table(name: str, chunks: dict[str, list[Any]]) -> pa.Table:
    import pyarrow as pa

    schema = pa.schema([(column, _arrow_type(kind)) for column, kind in TABLES[name].items()])
    joined = [pa.chunked_array(chunks[field.name], type=field.type).combine_chunks() for field in schema]
    return pa.Table.from_arrays(joined, schema=schema)


def empty_column(kind: str, length: int) -> pa.Array:
    """A column of ``length`` unknown values: NaN, -1 or empty text."""
    return _array([EMPTY[kind]] * length, kind)


def _arrow_type(kind: str) -> pa.DataType:
    import pyarrow as pa

    return {"string": pa.string(), "int64": pa.int64(), "float64": pa.float64()}[kind]


def _array(values: Any, kind: str) -> pa.Array:
    """Column of numbers or texts without missing entries (an unknown number is NaN, an unknown text is empty)."""
    import pyarrow as pa

    if kind != "string":
        data = np.ascontiguousarray(values, dtype=_DTYPES[kind])
        return pa.Array.from_buffers(_arrow_type(kind), len(data), [None, pa.py_buffer(data)])
    texts = [text.encode("utf-8", errors="replace") for text in values]
    ends = np.zeros(len(texts) + 1, dtype=np.int32)
    np.cumsum([len(text) for text in texts], out=ends[1:])
    return pa.StringArray.from_buffers(len(texts), pa.py_buffer(ends), pa.py_buffer(b"".join(texts)))
