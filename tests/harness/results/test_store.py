"""The store: whole runs or none, whatever kills the writer."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from ninedisk.harness import run_matrix
from ninedisk.harness.api.errors import StoreError
from ninedisk.harness.results import store as store_module
from ninedisk.harness.results.claims import judge_claims
from ninedisk.harness.results.reader import read_rows, read_run, run_ids
from ninedisk.harness.results.schema import RUN_KEYS, SCHEMA_VERSION, TABLES
from ninedisk.harness.results.store import new_run_id, prepare_store, write_run
from ninedisk.reports.drawing.figures import case_figures
from ninedisk.reports.pages import errata
from ninedisk.reports.panel.load import load_store
from ninedisk.reports.panel.model import build_panel

pytestmark = pytest.mark.usefixtures("fakes")

FACTS: dict[str, Any] = {"started": "then", "finished": "now", "provenance": {"a": float("nan")}, "argv": ["ninedisk"]}


def written(store: Path, engines: tuple[str, ...] = ("fake-good", "fake-wrong", "fake-crash")) -> str:
    results = run_matrix(["fake/fall"], engines)
    prepare_store(store)
    return write_run(store, new_run_id(), results, judge_claims(results), FACTS).name


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_an_outsider_s_figures_and_claims_reach_the_report(tmp_path: Path) -> None:
    """A case of another package shows its own figure, with the claim of its source that an engine contradicts."""
    results = run_matrix(["fake/fall"], ("fake-good", "fake-wrong", "fake-absent"))
    verdicts = {row["engine"]: row["verdict"] for row in judge_claims(results)}
    assert verdicts == {"fake-good": "confirmed", "fake-wrong": "confirmed", "fake-absent": "undecided"}
    prepare_store(tmp_path)
    contradicted = [row | {"verdict": "contradicted"} for row in judge_claims(results)]
    write_run(tmp_path, new_run_id(), results, contradicted, FACTS)
    panel = build_panel(load_store(tmp_path))
    (figure,) = case_figures(panel, panel.cases["fake/fall"])
    assert [panel.picture.title for group in figure.groups for panel in group.panels] == ["way"] * 2
    assert errata(panel)[0].derivation == ("Nothing else can follow.",)


def test_round_trip(tmp_path: Path) -> None:
    run_id = written(tmp_path)
    about, tables = read_run(tmp_path, run_id)
    assert tuple(about) == RUN_KEYS
    assert (about["run_id"], about["schema_version"], about["provenance"]) == (run_id, SCHEMA_VERSION, {"a": None})
    for name, columns in TABLES.items():
        kinds = {"string": "string", "int64": "int64", "double": "float64"}
        held = pq.read_schema(tmp_path / "runs" / run_id / f"{name}.parquet")
        assert {field.name: kinds[str(field.type)] for field in held} == columns
        assert list(tables[name].columns) == list(columns)
    assert len(tables["cells"]) == 6
    assert list(tables["measurements"]["status"]) == ["pass"] * 2 + ["fail"] * 2 + ["error"] + (
        ["pass"] * 2 + ["fail"] * 2 + ["error"]
    )
    series = tables["series"]
    assert len(series) == 4 * 2 * 11
    moved = series[(series.variant == "a=2") & (series.quantity == "x") & (series.engine == "fake-good")]
    assert moved.value.to_list() == pytest.approx([0.01 * n * n for n in range(11)])
    assert len(tables["references"]) == 2 * 11
    assert [path.name for path in (tmp_path / "runs").iterdir()] == [run_id]


def test_a_run_without_series(tmp_path: Path) -> None:
    _, tables = read_run(tmp_path, written(tmp_path, ("fake-absent",)))
    assert len(tables["series"]) == len(tables["references"]) == 0
    assert list(tables["cells"]["status"]) == ["not-installed"] * 2


def test_a_store_written_before_is_read_as_it_was(tmp_path: Path) -> None:
    """Earlier writers left NaN where a number is null now, and no word for pandas in the files."""
    run_id = written(tmp_path)
    about, new = read_run(tmp_path, run_id)
    rows = {name: read_rows(tmp_path, about, name) for name in TABLES}
    assert repr(rows) == repr({name: table.to_dict("records") for name, table in new.items()})
    arrow = {"string": pa.string(), "int64": pa.int64(), "float64": pa.float64()}
    for name, columns in TABLES.items():
        fields = pa.schema([(column, arrow[kind]) for column, kind in columns.items()])
        earlier = pa.Table.from_pylist(new[name].to_dict("records"), schema=fields)
        pq.write_table(earlier, tmp_path / "runs" / run_id / f"{name}.parquet", compression="zstd")
    assert sum(table["value"].isna().sum() for table in new.values() if "value" in table) > 0
    _, old = read_run(tmp_path, run_id)
    for name in TABLES:
        pd.testing.assert_frame_equal(old[name], new[name])
    assert repr({name: read_rows(tmp_path, about, name) for name in TABLES}) == repr(rows)


def test_half_a_character_does_not_cost_a_run(tmp_path: Path) -> None:
    """A file name or an engine's message need not be UTF-8; Python then has lone surrogates in its text."""
    (result,) = run_matrix(["fake/fall"], ["fake-good"], {"a": 1})
    odd = replace(result, cell=result.cell | {"reason": "odd \udcff"}, curves=[{**result.curves[0], "unit": "\ud800"}])
    prepare_store(tmp_path)
    write_run(tmp_path, "odd", [odd], [], FACTS)
    _, tables = read_run(tmp_path, "odd")
    assert list(tables["cells"]["reason"]) == ["odd \\udcff"]
    assert set(tables["series"]["unit"]) == {"\\ud800"}


@pytest.mark.parametrize("moment", ["rename", "fsync"])
def test_kill_leaves_the_store_readable(fake_environment: dict[str, str], tmp_path: Path, moment: str) -> None:
    first = written(tmp_path)
    before = contents(tmp_path / "runs" / first)
    code = (
        "import os, signal, sys; from pathlib import Path\n"
        f"os.{moment} = lambda *_: os.kill(os.getpid(), signal.SIGKILL)\n"
        "from ninedisk.harness import run_matrix; from ninedisk.harness.results.store import write_run\n"
        "results = run_matrix(['fake/fall'], ['fake-good'])\n"
        "facts = {'started': '', 'finished': '', 'provenance': {}, 'argv': []}\n"
        "write_run(Path(sys.argv[1]), '99990101T000000Z-killed', results, [], facts)\n"
    )
    done = subprocess.run([sys.executable, "-c", code, str(tmp_path)], env=fake_environment, timeout=60, check=False)
    assert done.returncode == -signal.SIGKILL
    assert (tmp_path / "runs" / ".tmp-99990101T000000Z-killed").is_dir()
    assert run_ids(tmp_path) == [first]
    assert contents(tmp_path / "runs" / first) == before
    read_run(tmp_path, first)
    second = written(tmp_path)
    assert run_ids(tmp_path) == sorted([first, second])


def test_a_failed_write_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = written(tmp_path)

    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(store_module, "_flush", full)
    with pytest.raises(StoreError, match="No space left on device"):
        written(tmp_path)
    assert [path.name for path in (tmp_path / "runs").iterdir()] == [first]


@pytest.mark.parametrize("damage", ["run.json", "series.parquet"])
def test_damage_is_said(tmp_path: Path, damage: str) -> None:
    run_id = written(tmp_path)
    (tmp_path / "runs" / run_id / damage).write_text("garbage")
    with pytest.raises(StoreError, match=f"run '{run_id}' is damaged"):
        read_run(tmp_path, run_id)


def test_unknown_run_and_empty_store(tmp_path: Path) -> None:
    assert run_ids(tmp_path / "nowhere") == []
    with pytest.raises(StoreError, match="no finished run 'x'"):
        read_run(tmp_path, "x")


def test_unwritable_stores(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("")
    for store in (file, file / "below", Path("/proc/nowhere")):
        with pytest.raises(StoreError, match=r"cannot be written .*--store DIR"):
            prepare_store(store)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_without_permission(tmp_path: Path) -> None:
    (tmp_path / "runs").mkdir(mode=0o500)
    with pytest.raises(StoreError, match="Permission denied"):
        prepare_store(tmp_path)


def test_run_ids_sort_by_time_and_do_not_collide() -> None:
    ids = [new_run_id() for _ in range(100)]
    assert len(set(ids)) == 100
    assert all("/" not in run_id and " " not in run_id for run_id in ids)
