"""The record on disk, the packings in their cache."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from ninedisk.core import packings as scenes
from ninedisk.harness.api.errors import StoreError, UsageError
from ninedisk.harness.bench import dem_problems as packings
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


def test_a_packing_settles_once(packing_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = packings.packing(30)
    assert len(list(packing_folder.iterdir())) == 1
    with monkeypatch.context() as patch:
        patch.setattr(scenes, "settled_packing", lambda *_, **__: pytest.fail("settled again"))
        again = packings.packing(30)
    assert np.array_equal(first.disks.x, again.disks.x)
    assert first.initial_shear == again.initial_shear
    (file,) = packing_folder.iterdir()
    file.write_bytes(file.read_bytes()[:100])
    mended = packings.packing(30)
    assert np.array_equal(first.disks.x, mended.disks.x)


def test_large_packings_are_copies(packing_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:  # noqa: ARG001
    monkeypatch.setattr(packings, "LARGEST_SETTLED", 30)
    assert len(packings.packing(90).disks) == 3 * len(packings.packing(30).disks)


@pytest.mark.skipif(os.name == "posix" and os.geteuid() == 0, reason="root may write anywhere")
def test_a_cache_that_cannot_be_written_is_no_error(packing_folder: Path) -> None:
    packing_folder.mkdir()
    packing_folder.chmod(0o500)
    assert len(packings.packing(30).disks) > 20
