"""What comes out of a cell (one variant of a case on one engine), ready for the store and for Python users."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.harness.results.schema import MEASUREMENT_COLUMNS, SERIES_COLUMNS

if TYPE_CHECKING:
    import pandas as pd

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
