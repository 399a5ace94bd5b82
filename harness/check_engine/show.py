"""Findings as a table and as JSON."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from ninedisk.harness.api.text import printable
from ninedisk.harness.check_engine.findings import FAIL, PASS, REFUSED, Finding
from ninedisk.harness.cli.cli_tables import console, table
from ninedisk.harness.results.whole_file import write_whole


def show(engine_id: str, findings: Sequence[Finding]) -> None:
    """The table, and a line that counts."""
    shown = table("check", "status", "found", "mend")
    for each in findings:
        shown.add_row(each.check, each.status, printable(each.found), printable(each.mend))
    out = console()
    out.print(shown)
    counts = Counter(each.status for each in findings)
    parts = [f"{counts[status]} {status}" for status in (PASS, FAIL, REFUSED) if counts[status]]
    out.print(f"{engine_id}: {', '.join(parts)}")


def write_json(path: Path, engine_id: str, version: str, findings: Sequence[Finding]) -> None:
    """Write the findings; the file appears whole or not at all.

    Raises
    ------
    StoreError
        If it cannot be written.
    """
    data = {"engine": engine_id, "version": version, "findings": [dict(each.row()) for each in findings]}
    write_whole("--json", path, json.dumps(data, indent=1) + "\n")
