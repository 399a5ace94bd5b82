"""Stores over time: schemas old and new, merging, exporting, clearing."""

from __future__ import annotations

import json
import math
import os
import shutil
import time
from datetime import UTC, datetime
from pathlib import Path
from types import ModuleType

import pyarrow.parquet as pq
import pytest

from ninedisk.harness.api.errors import NewerSchemaError, StoreError, UsageError
from ninedisk.harness.results import reader
from ninedisk.harness.results import schema as records
from ninedisk.harness.results.compare import resolve
from ninedisk.harness.results.export import export_rows, read_export, write_export
from ninedisk.harness.results.reader import read_run, read_table, run_ids
from ninedisk.harness.results.schema import SCHEMA_VERSION
from ninedisk.harness.results.store import Snapshot, list_folders, load_snapshots, merge, prune, prune_candidates


@pytest.fixture(scope="session")
def stored(synthetic: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with six runs; tests copy it before they change it."""
    store = tmp_path_factory.mktemp("stored")
    synthetic.write_store(store, synthetic.Plan(runs=6, cells={("slip-to-roll", "k=0", "dem"): (3, "error", "broke")}))
    return store


@pytest.fixture
def store(stored: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(stored, tmp_path / "store"))


def set_schema(store: Path, run_id: str, version: int) -> None:
    path = store / "runs" / run_id / "run.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "schema_version": version}))


def plain(run: Snapshot) -> object:
    """A run with NaN as None, so that equal ones compare equal."""
    checks = {key: [{n: _none(v) for n, v in row.items() if n in records.MEASUREMENT_COLUMNS} for row in each.values()]
              for key, each in run.checks.items()}  # fmt: skip
    cells = {key: [_none(row[n]) for n in ("status", "reason", "advance_s", "setup_s", "case_version", "engine_name")]
             for key, row in run.cells.items()}  # fmt: skip
    return run.facts, cells, checks


def _none(value: object) -> object:
    return None if isinstance(value, float) and math.isnan(value) else value


def test_a_newer_schema_is_refused_and_never_pruned(store: Path) -> None:
    newest = run_ids(store)[-1]
    set_schema(store, newest, SCHEMA_VERSION + 1)
    with pytest.raises(
        NewerSchemaError, match=rf"schema {SCHEMA_VERSION + 1}.*up to {SCHEMA_VERSION}: upgrade ninedisk"
    ):
        load_snapshots(store)
    assert [run.problem.partition(":")[0] for run in list_folders(store)[-1:]] == [
        f"run {newest!r} was written with schema {SCHEMA_VERSION + 1}, this version reads up to {SCHEMA_VERSION}"
    ]
    assert prune_candidates(store, unreadable=True) == []
    assert len(resolve(run_ids(store)[0], store)) == 1, "another run may still be asked for by its name"


def test_an_older_schema_is_migrated(store: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Columns that came later are empty; the same gap in a run of today's schema is damage."""
    old, new = run_ids(store)[:2]
    later = {**records.MEASUREMENT_COLUMNS, "added_text": "string", "added": "float64"}
    monkeypatch.setitem(records.TABLES, "measurements", later)
    monkeypatch.setattr(reader, "SCHEMA_VERSION", SCHEMA_VERSION + 1)
    set_schema(store, new, SCHEMA_VERSION + 1)
    _, tables = read_run(store, old)
    assert len(tables["measurements"]) > 0
    assert tables["measurements"]["added"].isna().all()
    assert set(tables["measurements"]["added_text"]) == {""}
    with pytest.raises(StoreError, match=r"is damaged: measurements.parquet lacks the column\(s\) added, added_text"):
        read_run(store, new)


def test_too_old_a_schema_is_said_to_be_unreadable(store: Path) -> None:
    first = run_ids(store)[0]
    set_schema(store, first, records.OLDEST_SCHEMA - 1)
    with pytest.raises(StoreError, match="which is unreadable now"):
        read_run(store, first)
    assert [each.path.name for each in prune_candidates(store, unreadable=True)] == [first]


def test_half_written_runs_are_never_read(store: Path) -> None:
    ids = run_ids(store)
    os.rename(store / "runs" / ids[0], store / "runs" / f".tmp-{ids[0]}")
    (store / "runs" / ids[1] / "run.json").unlink()
    assert run_ids(store) == ids[2:]
    assert [run.facts.run_id for run in load_snapshots(store)] == ids[2:]
    assert [run.name for run in list_folders(store)[-2:]] == [f".tmp-{ids[0]}", ids[1]]
    with pytest.raises(UsageError, match="names no run"):
        resolve(ids[1], store)


def test_a_run_json_without_a_key_is_damage(store: Path) -> None:
    path = store / "runs" / run_ids(store)[0] / "run.json"
    path.write_text(json.dumps({"schema_version": SCHEMA_VERSION}))
    with pytest.raises(StoreError, match="lacks run_id, started"):
        read_run(store, run_ids(store)[0])


def test_single_columns_are_read(store: Path) -> None:
    about, tables = read_run(store, run_ids(store)[0])
    table = read_table(store, about, "cells", ("engine", "status"))
    assert list(table.columns) == ["engine", "status"]
    assert list(table["status"]) == list(tables["cells"]["status"])


def test_words_for_runs(store: Path, tmp_path: Path) -> None:
    ids = run_ids(store)

    def names(word: str) -> list[str]:
        return [run.facts.run_id for run in resolve(word, store)]

    assert names("latest") == ids[-1:]
    assert names("latest~2") == ids[-3:-2]
    assert names("latest~3..latest~1") == ids[2:5]
    assert names(f"{ids[0]}..{ids[1]}") == ids[:2]
    assert names(ids[1]) == names(ids[1][:-1]) == ids[1:2]
    assert names(str(store)) == ids
    assert names(str(store / "runs" / ids[3])) == ids[3:4]
    write_export(export_rows(load_snapshots(store)[:2]), tmp_path / "two.json")
    assert names(str(tmp_path / "two.json")) == ids[:2]


@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("latest~6", "too far back: the store .* has 6 finished run"),
        ("2026", "is the beginning of 6 runs"),
        ("main", "names no run"),
        ("latest..latest~2", "write the older run first"),
        ("gone.csv", "there is no file 'gone.csv'"),
        ("", "names no run"),
    ],
)
def test_words_that_name_nothing(store: Path, word: str, said: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(store.parent)
    if not word:  # an empty word is this folder for pathlib, which is no store
        said = "holds no finished run"
    with pytest.raises(UsageError, match=said):
        resolve(word, store)


@pytest.mark.parametrize("suffix", [".csv", ".json", ".parquet"])
def test_export_and_back(store: Path, tmp_path: Path, suffix: str) -> None:
    """Nothing that a comparison reads is lost: names, statuses, and every digit of the numbers."""
    runs = load_snapshots(store)
    write_export(export_rows(runs), tmp_path / f"all{suffix}")
    assert [plain(run) for run in read_export(tmp_path / f"all{suffix}")] == [plain(run) for run in runs]


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.csv", "a,b\n1,2\n", "lacks the column"),
        ("a.json", "{}", "cannot be read as a file of `ninedisk export`"),
        ("a.json", "[", "cannot be read"),
        ("a.parquet", "garbage", "cannot be read"),
        ("a.txt", "", "no exported file"),
    ],
)
def test_files_that_are_no_exports(tmp_path: Path, name: str, content: str, said: str) -> None:
    (tmp_path / name).write_text(content)
    with pytest.raises(StoreError, match=said):
        read_export(tmp_path / name)


def test_an_export_of_a_newer_schema_is_refused(store: Path, tmp_path: Path) -> None:
    rows = [{**row, "schema_version": SCHEMA_VERSION + 1} for row in export_rows(load_snapshots(store)[:1])]
    write_export(rows, tmp_path / "new.parquet")
    with pytest.raises(NewerSchemaError, match="upgrade ninedisk"):
        read_export(tmp_path / "new.parquet")


def test_merge(store: Path, tmp_path: Path) -> None:
    ids, other = run_ids(store), tmp_path / "other"
    (store / "runs" / ".tmp-half").mkdir()
    assert merge([store], other) == (ids, [])
    assert merge([store], other) == ([], ids)
    assert run_ids(other) == ids
    assert [path.name for path in (other / "runs").iterdir() if path.name.startswith(".")] == []
    shutil.rmtree(other / "runs" / ids[2])
    assert merge([store], other) == ([ids[2]], [run_id for run_id in ids if run_id != ids[2]])


def test_merge_stops_at_damage_and_at_another_content(store: Path, tmp_path: Path) -> None:
    ids, other = run_ids(store), tmp_path / "other"
    merge([store], other)
    path = store / "runs" / ids[0] / "run.json"
    path.write_text(path.read_text() + " ")
    with pytest.raises(StoreError, match="differs from the one in"):
        merge([store], other)
    (store / "runs" / ids[0] / "series.parquet").write_text("garbage")
    with pytest.raises(StoreError, match="is damaged"):
        merge([store], tmp_path / "third")
    assert run_ids(tmp_path / "third") == []
    with pytest.raises(UsageError, match="holds no finished run"):
        merge([tmp_path / "nowhere"], other)


def test_prune(store: Path) -> None:
    ids = run_ids(store)
    fresh, stale = store / "runs" / ".tmp-fresh", store / "runs" / ".tmp-stale"
    for folder in (fresh, stale):
        folder.mkdir()
    day_ago = time.time() - 86500
    os.utime(stale, (day_ago, day_ago))
    assert [each.path for each in prune_candidates(store)] == [stale], "a folder that may still be written to stays"
    assert [each.path.name for each in prune_candidates(store, keep=4)] == [stale.name, *ids[:2]]
    old = prune_candidates(store, before=datetime(2026, 1, 8, tzinfo=UTC))
    assert [each.path.name for each in old] == [stale.name, *ids[:3]]
    assert run_ids(store) == ids
    prune(old)
    assert run_ids(store) == ids[3:]
    assert sorted(path.name for path in (store / "runs").iterdir()) == sorted([".tmp-fresh", *ids[3:]])


def test_exported_parquet_has_types(store: Path, tmp_path: Path) -> None:
    write_export(export_rows(load_snapshots(store)), tmp_path / "all.parquet")
    table = pq.read_table(tmp_path / "all.parquet")
    assert str(table.schema.field("abs_error").type) == "double"
    assert str(table.schema.field("case_version").type) == "int64"
