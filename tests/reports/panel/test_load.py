"""The reader takes finished runs, the newest rows, and nothing that it does not understand."""

from __future__ import annotations

from pathlib import Path

import pyarrow.parquet as pq
import pytest

from ninedisk.harness.api.errors import StoreError
from ninedisk.reports.folder import ReportError
from ninedisk.reports.panel import load
from ninedisk.reports.panel.load import load_store


def test_newest_run_wins_cell_by_cell(tmp_path, write, small):
    write(tmp_path, "z-old", small(value=1.0), started="2026-01-01T00:00:00+00:00")
    write(tmp_path, "y-other", small(engine="yade", value=2.0), started="2026-01-01T12:00:00+00:00")
    write(tmp_path, "a-new", small(value=3.0), started="2026-01-02T00:00:00+01:00")
    stored = load_store(tmp_path)
    assert {row["engine"]: row["value"] for row in stored.measurements} == {"dem": 3.0, "yade": 2.0}
    assert [run["run_id"] for run in stored.runs] == ["a-new", "y-other"]
    assert len(stored.cells) == 2
    assert set(stored.series) == {("demo/one", "k=1", engine, "x") for engine in ("dem", "yade")}


def test_run_that_is_half_superseded_gives_only_its_other_half(tmp_path, write, small):
    both, newer = small(value=1.0), small(value=3.0)
    other = small(engine="yade", value=2.0)
    write(tmp_path, "a", {name: both[name] + other[name] for name in both}, started="2026-01-01T00:00:00+00:00")
    for row in newer["series"] + newer["references"]:
        row["value"] = 9.0
    write(tmp_path, "b", newer, started="2026-01-02T00:00:00+00:00")
    stored = load_store(tmp_path)
    assert sorted((row["engine"], row["value"]) for row in stored.measurements) == [("dem", 3.0), ("yade", 2.0)]
    assert set(stored.series["demo/one", "k=1", "dem", "x"].value) == {9.0}
    assert stored.series["demo/one", "k=1", "yade", "x"].value[0] == 1.0
    assert [set(curve.value) for curve in stored.references["demo/one", "k=1", "x"]] == [{9.0}]


def test_curves_of_a_cell_that_broke_since_are_gone(tmp_path, write, small):
    write(
        tmp_path, "a", {n: small()[n] + small(engine="yade")[n] for n in small()}, started="2026-01-01T00:00:00+00:00"
    )
    write(tmp_path, "b", {**small(status="error"), "series": []}, started="2026-01-02T00:00:00+00:00")
    assert {key[2] for key in load_store(tmp_path).series} == {"yade"}


def test_started_is_compared_as_time_not_as_text(tmp_path, write, small):
    write(tmp_path, "a", small(value=1.0), started="2026-01-01T23:30:00+00:00")
    write(tmp_path, "b", small(value=2.0), started="2026-01-02T00:15:00+01:00")
    assert load_store(tmp_path).measurements[0]["value"] == 1.0


def test_unfinished_and_hidden_runs_are_ignored(tmp_path, write, small):
    write(tmp_path, "a", small(value=1.0))
    write(tmp_path, "b", small(value=2.0), started="2027-01-01T00:00:00+00:00", finished=False)
    write(tmp_path, ".tmp-c", small(value=3.0), started="2027-01-01T00:00:00+00:00")
    assert [row["value"] for row in load_store(tmp_path).measurements] == [1.0]


@pytest.mark.parametrize("make", [lambda _: None, lambda store: (store / "runs").mkdir()])
def test_empty_store_is_an_error_that_names_the_remedy(tmp_path, make):
    make(tmp_path)
    with pytest.raises(ReportError, match="ninedisk run"):
        load_store(tmp_path)


def test_run_without_cells_is_an_error(tmp_path, write):
    write(tmp_path, "a", {})
    with pytest.raises(ReportError, match="no results"):
        load_store(tmp_path)


def test_older_case_version_is_left_out_and_said(tmp_path, write, small):
    write(tmp_path, "a", small(engine="yade", case_version=1))
    write(tmp_path, "b", small(engine="dem", case_version=2))
    stored = load_store(tmp_path)
    assert [cell["engine"] for cell in stored.cells] == ["dem"]
    assert {row["engine"] for row in stored.measurements} == {key[2] for key in stored.series} == {"dem"}
    assert stored.outdated == ["demo/one / k=1 on yade"]


def test_references_of_one_label_that_differ_stay_two_curves(tmp_path, write, small):
    tables = small()
    tables["references"] += [{**row, "value": 2.5} for row in tables["references"]]
    write(tmp_path, "a", tables)
    curves = load_store(tmp_path).references["demo/one", "k=1", "x"]
    assert [set(curve.value) for curve in curves] == [{1.5}, {2.5}]


def test_series_are_ordered_by_step(tmp_path, write, small):
    tables = small()
    tables["series"].reverse()
    write(tmp_path, "a", tables)
    curve = load_store(tmp_path).series["demo/one", "k=1", "dem", "x"]
    assert list(curve.step) == [0, 1, 2, 3, 4]
    assert curve.error[4] == pytest.approx(0.46)


def damage_column(path: Path, column: str) -> None:
    """Overwrite the stored values of one column of a Parquet file."""
    group = pq.read_metadata(path).row_group(0)
    chunk = next(c for c in map(group.column, range(group.num_columns)) if c.path_in_schema == column)
    begin = chunk.dictionary_page_offset or chunk.data_page_offset
    content = bytearray(path.read_bytes())
    content[begin : begin + chunk.total_compressed_size] = bytes([255]) * chunk.total_compressed_size
    path.write_bytes(content)


@pytest.mark.parametrize("column", ["setup", "frames"])
def test_scenes_and_frames_of_replaced_cells_are_never_read(tmp_path, write, small, column):
    old = write(tmp_path, "a", small(value=1.0), started="2026-01-01T00:00:00+00:00")
    new = write(tmp_path, "b", small(value=2.0), started="2026-01-02T00:00:00+00:00")
    damage_column(old / "cells.parquet", column)
    assert [row["value"] for row in load_store(tmp_path).measurements] == [2.0]
    damage_column(new / "cells.parquet", column)
    with pytest.raises(StoreError, match=r"run 'b' is damaged: cells\.parquet cannot be read"):
        load_store(tmp_path)


def test_of_a_run_that_is_half_replaced_only_the_other_half_is_made_into_rows_and_curves(tmp_path, write, small):
    both = {name: small()[name] + small(engine="yade")[name] for name in small()}
    write(tmp_path, "a", both, started="2026-01-01T00:00:00+00:00")
    write(tmp_path, "b", small(value=3.0), started="2026-01-02T00:00:00+00:00")
    made: list[int] = []
    keep_rows = load.keep_rows

    def counted(*args):
        made.append(len(kept := keep_rows(*args)))
        return kept

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(load, "keep_rows", counted)
        stored = load_store(tmp_path)
    assert made == [1, 1, 0, 5, 0, 1, 1, 0, 5, 5], (
        "cell, measurement, headlines, series and references of each run: those of its own cell"
    )
    assert {key[2] for key in stored.series} == {"dem", "yade"}
