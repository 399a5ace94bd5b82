"""The record on disk."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from ninedisk.harness.api.errors import StoreError, UsageError
from ninedisk.harness.bench.records import COLUMNS, new_row, prepare_folder, write_records


def test_json_and_parquet_hold_the_same_rows(tmp_path: Path) -> None:
    rows = [
        new_row(suite="dem", problem="p", engine="a", status="pass", median_s=0.1 + 0.2, disks=7),
        new_row(suite="cd", problem="q", engine="ü", status="timeout", reason="late"),
    ]
    facts = {"provenance": {"cpu": "x"}, "argv": ["ninedisk", "bench"]}
    one, other = write_records(tmp_path, "run", facts, rows)
    record, table = json.loads(one.read_text()), pq.read_table(other)
    assert record["run_id"] == "run"
    assert record["provenance"] == {"cpu": "x"}
    assert table.column_names == list(COLUMNS) == list(record["rows"][0])
    for plain, row in zip(record["rows"], table.to_pylist(), strict=True):
        for name, value in row.items():
            missing = isinstance(value, float) and math.isnan(value)
            assert plain[name] is None if missing else plain[name] == value
    assert record["rows"][0]["median_s"] == 0.1 + 0.2
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.json", "run.parquet"]


def test_unknown_columns_and_statuses_are_refused() -> None:
    with pytest.raises(KeyError, match="colour"):
        new_row(status="pass", colour="red")
    with pytest.raises(ValueError, match="fine"):
        new_row(status="fine")


def test_a_folder_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match="--out"):
        prepare_folder(tmp_path / "file")
    with pytest.raises(StoreError, match="cannot be written"):
        write_records(tmp_path / "nowhere", "run", {}, [])
