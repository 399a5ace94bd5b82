"""Synthetic stores, written as the harness writes them, and the report of one."""

from __future__ import annotations

import importlib.util
import json
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from ninedisk.harness.results.schema import SCHEMA_VERSION, TABLES

Row = dict[str, Any]
TYPES = {"string": pa.string(), "int64": pa.int64(), "float64": pa.float64()}
EMPTY = {"string": "", "int64": -1, "float64": math.nan}


def sibling(name: str) -> ModuleType:
    """Module beside this file; pytest's importlib mode puts no test folder on the path."""
    spec = importlib.util.spec_from_file_location(f"ninedisk_tests_{name}", Path(__file__).with_name(f"{name}.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


SCENES, PANEL, DEVTOOLS = sibling("synthetic_scenes"), sibling("synthetic_panel"), sibling("devtools")


def write_run(
    store: Path,
    run_id: str,
    tables: Mapping[str, Sequence[Row]],
    *,
    started: str = "2026-01-02T03:04:05+00:00",
    schema: int = SCHEMA_VERSION,
    finished: bool = True,
) -> Path:
    """Write a run; missing columns get an empty value."""
    folder = store / "runs" / run_id
    folder.mkdir(parents=True)
    for name, columns in TABLES.items():
        rows = [{**{c: EMPTY[kind] for c, kind in columns.items()}, **row} for row in tables.get(name, ())]
        fields = pa.schema([(column, TYPES[kind]) for column, kind in columns.items()])
        pq.write_table(pa.Table.from_pylist(rows, schema=fields), folder / f"{name}.parquet")
    if finished:
        about = {
            "run_id": run_id,
            "schema_version": schema,
            "started": started,
            "finished": started,
            "provenance": {
                "ninedisk": "0.1.0",
                "commit": "0123456789abcdef",
                "cpu": "a processor",
                "packages": {"numpy": "2.0"},
            },
            "argv": ["ninedisk", "run"],
        }
        (folder / "run.json").write_text(json.dumps(about), encoding="utf-8")
    return folder


@pytest.fixture(scope="session")
def panel_store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with the whole panel in one run."""
    store = tmp_path_factory.mktemp("store")
    write_run(store, "20260102T030405Z-abcdef", PANEL.panel_tables(SCENES))
    return store


def small_tables(engine: str = "dem", case: str = "demo/one", **changes: Any) -> dict[str, list[Row]]:
    """One case, one engine, one quantity; ``changes`` go into the cell and the measurement alike."""
    common = {
        "case": case,
        "case_version": 1,
        "variant": "k=1",
        "params": '{"k": 1}',
        "engine": engine,
        "support": "exact",
    }
    cell = {
        **common,
        "case_title": "Demo",
        "engine_name": engine.upper(),
        "status": "pass",
        "setup": json.dumps(SCENES.small_setup(1)),
    }
    row = {
        **common,
        "quantity": "x",
        "unit": "m",
        "norm": "max",
        "truth": "analytic",
        "source": "closed form",
        "value": 1.0,
        "expected": 1.5,
        "abs_error": 0.5,
        "rel_error": 0.5,
        "scale": 1.0,
        "atol": 0.0,
        "rtol": 1.0,
        "why": "a reason",
        "worst_step": 3,
        "status": "pass",
    }
    series = [
        {
            **{k: common[k] for k in ("case", "variant", "engine")},
            "quantity": "x",
            "unit": "m",
            "step": k,
            "t": 0.1 * k,
            "value": 1.0 + 0.01 * k,
            "expected": 1.5,
            "truth": "analytic",
        }
        for k in range(5)
    ]
    reference = {
        "case": case,
        "variant": "k=1",
        "label": "r",
        "truth": "analytic",
        "source": "s",
        "quantity": "x",
        "unit": "m",
    }
    return {
        "cells": [{**cell, **{k: v for k, v in changes.items() if k in TABLES["cells"]}}],
        "measurements": [{**row, **{k: v for k, v in changes.items() if k in TABLES["measurements"]}}],
        "series": series,
        "references": [{**reference, "step": k, "t": 0.1 * k, "value": 1.5, "uncertainty": 0.0} for k in range(5)],
        "claims": [],
    }


@pytest.fixture(scope="session")
def write() -> Callable[..., Path]:
    """`write_run`."""
    return write_run


@pytest.fixture(scope="session")
def small() -> Callable[..., dict[str, list[Row]]]:
    """`small_tables`."""
    return small_tables


@pytest.fixture(scope="session")
def panel_report(panel_store: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the whole panel's report."""
    from ninedisk.reports.build import build_report

    return build_report(panel_store, tmp_path_factory.mktemp("out") / "report").parent


@pytest.fixture(scope="session")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A browser's tab without a network, see `tab`."""
    if DEVTOOLS.CHROMIUM is None:
        pytest.skip("chromium is not installed: apt-get install chromium")
    pytest.importorskip("websockets", reason="the package websockets is not installed: pip install 'ninedisk[dev]'")
    with DEVTOOLS.browser(tmp_path_factory.mktemp("profile")) as page:
        yield page


@pytest.fixture
def tab(browser: Any) -> Any:
    """A browser tab without a network; what it asked for and complained about is empty at the start."""
    browser.call("Page.navigate", url="about:blank")
    browser.requests.clear()
    browser.complaints.clear()
    return browser
