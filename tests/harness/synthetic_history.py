"""Stores with many runs: deterministic errors, noisy timings, and whatever change a test plants."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ninedisk.harness.results.reader import run_facts
from ninedisk.harness.results.schema import SCHEMA_VERSION, TABLES
from ninedisk.harness.results.store import Snapshot, snapshot

Row = dict[str, Any]
TYPES = {"string": pa.string(), "int64": pa.int64(), "float64": pa.float64()}
EMPTY = {"string": "", "int64": -1, "float64": math.nan}
QUANTITIES = (("fn_wall_mid", "N", "analytic"), ("x", "m", "exact-step"), ("energy_final", "J", "converged"))
CASES = ("nine-disk/compression", "nine-disk/distortion", "binary-collision", "incline-block", "slip-to-roll")
ENGINES = {"dem": "ninedisk DEM", "yade": "YADE", "pymunk": "pymunk"}


@dataclass
class Plan:
    """What the runs are like; planted factors hold from their run on.

    ``errors`` maps (case, variant, engine, quantity), ``timings`` (case, variant, engine) to (run, factor);
    ``cells`` maps (case, variant, engine) to (run, status, reason).
    """

    runs: int = 50
    variants: int = 2
    noise: float = 0.10
    outliers: float = 0.02
    drift: float = 0.15
    machines: tuple[str, ...] = ("AMD EPYC", "Intel Xeon")
    errors: Mapping[tuple[str, str, str, str], tuple[int, float]] = field(default_factory=dict)
    timings: Mapping[tuple[str, str, str], tuple[int, float]] = field(default_factory=dict)
    cells: Mapping[tuple[str, str, str], tuple[int, str, str]] = field(default_factory=dict)
    versions: Mapping[str, int] = field(default_factory=dict)  # case: run from which its version is 2
    cases: tuple[str, ...] = CASES
    engines: Mapping[str, str] = field(default_factory=lambda: dict(ENGINES))
    round_off: bool = True
    cpu: bool = True  # whether CPU times are known, or wall-clock times only as in old stores
    seed: int = 1


def commit(number: int) -> str:
    """Commit of a run."""
    return hashlib.sha256(f"commit {number}".encode()).hexdigest()[:40]


def about(plan: Plan, number: int) -> Row:
    """``run.json`` of a run."""
    started = datetime(2026, 1, 5, 3, 0, tzinfo=UTC) + timedelta(days=number)
    machine = plan.machines[number % len(plan.machines)]
    return {
        "run_id": f"{started:%Y%m%dT%H%M%SZ}-{number:06x}",
        "schema_version": SCHEMA_VERSION,
        "started": started.isoformat(),
        "finished": (started + timedelta(minutes=4)).isoformat(),
        "provenance": {
            "ninedisk": "0.1.0",
            "commit": commit(number),
            "python": "3.11.7",
            "platform": "Linux x86_64",
            "cpu": machine,
            "cores": 2,
            "packages": {"numpy": "2.4.6" if number < 20 else "2.5.0"},
            "engines": dict.fromkeys(plan.engines, "1.0"),
        },
        "argv": ["ninedisk", "run"],
    }


def tables(plan: Plan, number: int) -> dict[str, list[Row]]:
    """Cells and measurements of a run."""
    random = np.random.default_rng((plan.seed, number))
    machine = number % len(plan.machines)
    speed = (1.0 + 0.4 * machine) * (1.0 + plan.drift * math.sin(number / 6.0)) * math.exp(0.03 * random.normal())
    found: dict[str, list[Row]] = {name: [] for name in TABLES}
    for case in plan.cases:
        for k in range(plan.variants):
            for engine, name in plan.engines.items():
                _cell(plan, number, (case, f"k={k}", engine), name, speed, random, found)
    return found


def _cell(plan: Plan, number: int, key: tuple[str, str, str], name: str, speed: float, random: Any, found: Row) -> None:
    case, variant, engine = key
    since = plan.versions.get(case)
    common = {
        "case": case,
        "case_version": 2 if since is not None and number >= since else 1,
        "variant": variant,
        "params": json.dumps({"k": variant}),
        "engine": engine,
        "engine_version": "1.0",
        "support": "exact",
    }
    fixed = np.random.default_rng(int.from_bytes(hashlib.sha256(repr(key).encode()).digest()[:6], "big"))
    status, reason = "pass", ""
    planted = plan.cells.get(key)
    if planted is not None and number >= planted[0]:
        status, reason = planted[1:]
    seconds = []
    for usual in (10 ** fixed.uniform(-2, 0), 10 ** fixed.uniform(-1.5, -0.5)):
        noise = math.exp(plan.noise * random.normal()) * (2.0 if random.random() < plan.outliers else 1.0)
        seconds.append(usual * speed * noise)
    at, factor = plan.timings.get(key, (number + 1, 1.0))
    seconds[0] *= factor if number >= at else 1.0
    ran = status not in ("error", "timeout", "unsupported", "not-installed")
    for quantity, unit, truth in QUANTITIES if ran else ():
        row = _check(plan, number, (*key, quantity), truth, fixed, random)
        found["measurements"].append({**common, "quantity": quantity, "unit": unit, "truth": truth, **row})
        status = "fail" if row["status"] == "fail" else status
    if not ran:
        found["measurements"].append({**common, "status": status, "reason": reason})
    cpu = seconds[0] if status == "pass" else math.nan
    timing = {"advance_s": cpu, "setup_s": seconds[1], "warm_up_s": 0.0}
    if plan.cpu:
        timing |= {"cpu_s": cpu, "cpu_of": "stepping", "reference_s": 1e-3 * speed, "repeats": 1}
    found["cells"].append(
        {
            **common,
            "case_title": case.title(),
            "engine_name": name,
            "status": status,
            "reason": reason,
            **(timing if ran else {}),
        }
    )


def _check(plan: Plan, number: int, key: tuple[str, str, str, str], truth: str, fixed: Any, random: Any) -> Row:
    """An error: a few units of round-off that any run may change, or a fixed part of a scheme's tolerance."""
    share = fixed.uniform(0.05, 0.6)
    if truth == "exact-step":
        rtol, error = 1e-12, 1e-16 * (1 + 4 * random.random() if plan.round_off else 1.0)
    else:
        rtol, error = 1e-3, 1e-3 * share
    at, factor = plan.errors.get(key, (number + 1, 1.0))
    error *= factor if number >= at else 1.0
    return {
        "norm": "max",
        "source": "closed form",
        "value": 2.0,
        "expected": 2.0,
        "uncertainty": 0.0,
        "abs_error": 2.0 * error,
        "rel_error": error,
        "scale": 2.0,
        "atol": 0.0,
        "rtol": rtol,
        "why": "order of the scheme",
        "status": "fail" if error > rtol else "pass",
        "reason": "beyond" if error > rtol else "",
    }


def complete(name: str, rows: list[Row]) -> list[Row]:
    """Rows with every column of a table."""
    return [{**{c: EMPTY[kind] for c, kind in TABLES[name].items()}, **row} for row in rows]


def snapshots(plan: Plan) -> list[Snapshot]:
    """The runs without the way over the disk."""
    found = []
    for number in range(plan.runs):
        rows = tables(plan, number)
        cells, checks = (complete(name, rows[name]) for name in ("cells", "measurements"))
        found.append(snapshot(run_facts(about(plan, number)), cells, checks))
    return found


def write_run(store: Path, facts: Row, rows: Mapping[str, list[Row]]) -> str:
    """Write a run as the harness writes it; its id."""
    folder = store / "runs" / facts["run_id"]
    folder.mkdir(parents=True)
    for name, columns in TABLES.items():
        fields = pa.schema([(column, TYPES[kind]) for column, kind in columns.items()])
        table = pa.Table.from_pylist(complete(name, list(rows.get(name, ()))), schema=fields)
        pq.write_table(table, folder / f"{name}.parquet", compression="zstd")
    (folder / "run.json").write_text(json.dumps(facts), encoding="utf-8")
    return str(facts["run_id"])


def write_store(store: Path, plan: Plan) -> list[str]:
    """Write all runs; their ids, oldest first."""
    return [write_run(store, about(plan, number), tables(plan, number)) for number in range(plan.runs)]
