"""Schema of stored results: the only thing that the reports know.

A run is a folder with ``run.json`` (`RUN_KEYS`) and the Parquet tables of `TABLES`. Columns are never renamed or
reused; `SCHEMA_VERSION` grows when one is added.
"""

from __future__ import annotations

SCHEMA_VERSION = 1

STATUSES = (
    "pass",
    "fail",
    "error",
    "timeout",
    "unsupported",
    "not-installed",
    "known-gap",
    "gap-closed",
    "no-truth",
)
"""Every status that a cell or a measurement can have."""

EXCUSED = frozenset({"pass", "unsupported", "not-installed", "known-gap", "no-truth", "gap-closed"})
"""Statuses that leave the exit code at 0."""

WORST_FIRST = (
    "error",
    "timeout",
    "fail",
    "gap-closed",
    "known-gap",
    "no-truth",
    "unsupported",
    "not-installed",
    "pass",
)
"""Order in which a cell's measurements decide its status: the first one present wins."""

RUN_KEYS = ("run_id", "schema_version", "started", "finished", "provenance", "argv")

CELL_COLUMNS: dict[str, str] = {
    "case": "string",
    "case_version": "int64",
    "case_title": "string",
    "case_source": "string",
    "case_requirement": "string",
    "variant": "string",
    "params": "string",  # JSON object
    "engine": "string",
    "engine_name": "string",
    "engine_version": "string",
    "engine_licence": "string",
    "engine_runs": "string",
    "support": "string",
    "missing": "string",  # JSON list of capability descriptions
    "notes": "string",  # JSON list
    "settings": "string",  # JSON object
    "status": "string",
    "reason": "string",
    "setup_s": "float64",
    "warm_up_s": "float64",
    "advance_s": "float64",  # recorded only where the physics checks pass
    "n_steps": "int64",
    "n_disks": "int64",
    "setup": "string",  # JSON: scene, numerics, watch, labels
    "frames": "string",  # JSON: {"step": [...], "x": [[[x, y]]], "angle": [...], "wall_point":..., "wall_angle":...}
}
"""One row per case variant and engine."""

MEASUREMENT_COLUMNS: dict[str, str] = {
    "case": "string",
    "case_version": "int64",
    "variant": "string",
    "params": "string",
    "engine": "string",
    "engine_version": "string",
    "support": "string",
    "quantity": "string",
    "unit": "string",
    "norm": "string",
    "truth": "string",
    "source": "string",
    "value": "float64",
    "expected": "float64",
    "uncertainty": "float64",
    "abs_error": "float64",
    "rel_error": "float64",
    "scale": "float64",  # largest |expected|: what rel_error and rtol refer to
    "atol": "float64",
    "rtol": "float64",
    "why": "string",
    "worst_step": "int64",  # -1 for numbers
    "first_divergence_step": "int64",  # -1: never
    "status": "string",
    "reason": "string",
}
"""One row per checked quantity; a cell that did not run has one row with its status and empty numbers."""

SERIES_COLUMNS: dict[str, str] = {
    "case": "string",
    "variant": "string",
    "engine": "string",
    "quantity": "string",
    "unit": "string",
    "step": "int64",
    "t": "float64",
    "value": "float64",
    "expected": "float64",  # of the best truth that speaks about the quantity; NaN where none does
    "truth": "string",  # kind of that truth, "" where none
}
"""One row per sampled step and quantity."""

REFERENCE_COLUMNS: dict[str, str] = {
    "case": "string",
    "variant": "string",
    "label": "string",
    "truth": "string",
    "source": "string",
    "quantity": "string",
    "unit": "string",
    "step": "int64",
    "t": "float64",
    "value": "float64",
    "uncertainty": "float64",
}
"""Reference curves that belong to a variant whatever engine runs (exact-step, analytic, converged, digitised)."""

CLAIM_COLUMNS: dict[str, str] = {
    "claim": "string",
    "place": "string",
    "text": "string",
    "case": "string",
    "engine": "string",
    "verdict": "string",  # confirmed | contradicted | undecided
    "evidence": "string",
}
"""One row per claim of the source and engine."""

TABLES: dict[str, dict[str, str]] = {
    "cells": CELL_COLUMNS,
    "measurements": MEASUREMENT_COLUMNS,
    "series": SERIES_COLUMNS,
    "references": REFERENCE_COLUMNS,
    "claims": CLAIM_COLUMNS,
}
