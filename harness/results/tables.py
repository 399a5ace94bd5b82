"""What comes out of a cell (one variant of a case on one engine), ready for the store and for Python users.

Rows of the result tables, from checks and observed quantities.

Result tables in Arrow's memory layout.

Columns are made from buffers: `pyarrow.array` would import pandas to look whether it was given a Series, a third of a
second that a run of 0.1 s should not pay.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.harness.api.case import Check, Observed
from ninedisk.harness.results.schema import MEASUREMENT_COLUMNS, SERIES_COLUMNS, TABLES
from ninedisk.harness.run.judge import compare, expected_series, judge

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

    from ninedisk.core.history import History
    from ninedisk.harness.api.case import Check, Observed, Setup
FloatArray = NDArray[np.float64]
Row = dict[str, Any]

EMPTY: dict[str, Any] = {"string": "", "float64": float("nan"), "int64": -1}
"""What stands for an unknown value of each kind of column."""


@dataclass(frozen=True, kw_only=True)
class Block:
    """Consecutive rows of a columnar table: scalars repeat down the block, arrays hold one value a row."""

    length: int
    columns: Mapping[str, Any]


@dataclass(frozen=True, kw_only=True)
class CaseResult:
    """One variant of a case on one engine.

    Attributes
    ----------
    cell : dict
        The row of `records.CELL_COLUMNS`.
    rows : list of dict
        Rows of `records.MEASUREMENT_COLUMNS`; a cell that did not run has one with its status.
    series_blocks, reference_blocks : sequence of Block
        Rows of `records.SERIES_COLUMNS` and `records.REFERENCE_COLUMNS`.
    setup, history, observed : or None
        What was run and what came out; None where it did not get that far.
    checks : sequence of Check
        The truths that it was held against.
    """

    cell: Row
    rows: list[Row]
    series_blocks: Sequence[Block] = ()
    reference_blocks: Sequence[Block] = ()
    setup: Setup | None = None
    history: History | None = None
    observed: Observed | None = None
    checks: Sequence[Check] = field(default_factory=tuple)

    @property
    def status(self) -> str:
        """Status of the cell, one of `records.STATUSES`."""
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
        """A row per checked quantity, columns of `records.MEASUREMENT_COLUMNS`."""
        import pandas as pd

        return pd.DataFrame(self.rows, columns=list(MEASUREMENT_COLUMNS))

    @property
    def series(self) -> pd.DataFrame:
        """A row per quantity and sampled step, columns of `records.SERIES_COLUMNS`."""
        import pandas as pd

        frames = [pd.DataFrame(dict(block.columns), index=range(block.length)) for block in self.series_blocks]
        if not frames:
            return pd.DataFrame(columns=list(SERIES_COLUMNS))
        return pd.concat(frames, ignore_index=True)[list(SERIES_COLUMNS)]


def complete(row: Mapping[str, Any], columns: Mapping[str, str]) -> Row:
    """A row with every column of the table, empty values where ``row`` has none; KeyError for an unknown column."""
    unknown = set(row) - set(columns)
    if unknown:
        raise KeyError(f"no such column: {', '.join(sorted(unknown))}")
    return {name: row.get(name, EMPTY[kind]) for name, kind in columns.items()}


TRUTH_PREFERENCE = ("exact-step", "analytic", "converged", "published", "consensus")
"""Which truth a series shows beside its values: the first of these that speaks about the quantity."""


def measurement_row(common: Mapping[str, Any], check: Check, observed: Observed) -> Row:
    """Compare, judge, and write the row of `records.MEASUREMENT_COLUMNS`."""
    found = compare(check, observed)
    status, reason = judge(check, found)
    return complete(
        {
            **common,
            "quantity": check.quantity,
            "unit": found.unit,
            "norm": check.norm,
            "truth": check.truth,
            "source": check.source,
            "value": found.value,
            "expected": found.expected,
            "uncertainty": check.uncertainty,
            "abs_error": found.abs_error,
            "rel_error": found.rel_error,
            "scale": found.scale,
            "atol": check.atol,
            "rtol": check.rtol,
            "why": check.why,
            "worst_step": found.worst_step,
            "first_divergence_step": found.first_divergence_step,
            "status": status,
            "reason": reason,
        },
        MEASUREMENT_COLUMNS,
    )


def best_truth(quantity: str, checks: Sequence[Check], observed: Observed) -> tuple[NDArray[np.float64], str]:
    """The preferred truth about a series and its kind; NaN and ``""`` where none speaks.

    A truth that is itself known to be off (``gap_reason``) comes after every other.
    """
    candidates = [check for check in checks if check.quantity == quantity and check.norm == "max"]
    for check in sorted(candidates, key=lambda c: (bool(c.gap_reason), TRUTH_PREFERENCE.index(c.truth))):
        expected = expected_series(check, observed)
        if not np.isnan(expected).all():
            return expected, check.truth
    return np.full(observed.step.shape, np.nan), ""


def series_blocks(names: tuple[str, str, str], observed: Observed, checks: Sequence[Check]) -> list[Block]:
    """A block a series quantity; ``names`` are case, variant and engine."""
    case, variant, engine = names
    blocks = []
    for quantity, (unit, value) in observed.series.items():
        expected, truth = best_truth(quantity, checks, observed)
        columns = {
            "case": case,
            "variant": variant,
            "engine": engine,
            "quantity": quantity,
            "unit": unit,
            "step": observed.step,
            "t": observed.t,
            "value": np.asarray(value, dtype=np.float64),
            "expected": expected,
            "truth": truth,
        }
        blocks.append(Block(length=len(observed.step), columns=columns))
    return blocks


def reference_blocks(names: tuple[str, str], observed: Observed, checks: Sequence[Check]) -> list[Block]:
    """Curves of the truths that are arrays, where they speak.

    Consensus truths stay out: they are computed for one engine's conventions and do not belong to the variant.
    """
    case, variant = names
    blocks = []
    for check in checks:
        if check.norm != "max" or check.truth == "consensus" or np.ndim(check.expected) == 0:
            continue
        expected = expected_series(check, observed)
        speaks = ~np.isnan(expected)
        columns = {
            "case": case,
            "variant": variant,
            "label": f"{check.truth}: {check.source}",
            "truth": check.truth,
            "source": check.source,
            "quantity": check.quantity,
            "unit": observed.series[check.quantity][0],
            "step": observed.step[speaks],
            "t": observed.t[speaks],
            "value": expected[speaks],
            "uncertainty": check.uncertainty,
        }
        blocks.append(Block(length=int(speaks.sum()), columns=columns))
    return blocks


def distinct_references(blocks: Sequence[Block]) -> list[Block]:
    """Each curve once: the same truth binds several engines; curves that differ keep both."""
    kept: dict[tuple[Any, ...], Block] = {}
    for block in blocks:
        columns = block.columns
        text = tuple(columns[name] for name in ("case", "variant", "label", "quantity"))
        kept.setdefault((*text, columns["step"].tobytes(), columns["value"].tobytes()), block)
    return list(kept.values())


def plain_json(data: Any) -> str:
    """JSON text of plain data; numbers that JSON does not know become null, NumPy values become Python's."""
    return json.dumps(_plain(data), allow_nan=False)


def _plain(data: Any) -> Any:
    if isinstance(data, Mapping):
        return {str(key): _plain(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_plain(value) for value in data]
    if isinstance(data, np.ndarray | np.generic):
        return _plain(data.tolist())
    if isinstance(data, float) and not math.isfinite(data):
        return None
    if data is None or isinstance(data, str | int | float | bool):
        return data
    return str(data)


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
