"""Findings as a table and as JSON."""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from ninedisk.harness.check_engine.findings import FAIL, PASS, REFUSED, Finding
from ninedisk.harness.cli_tables import console, table
from ninedisk.harness.errors import UsageError
from ninedisk.harness.text import printable


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


def prepare_json(path: Path) -> None:
    """Refuse a file that cannot be written, before anything runs; raises `UsageError`."""
    folder = path.parent
    if path.is_dir() or not folder.is_dir() or not os.access(folder, os.W_OK):
        raise UsageError(
            f"--json {str(path)!r} cannot be written: give a file in a folder that exists and can be written"
        )


def write_json(path: Path, engine_id: str, version: str, findings: Sequence[Finding]) -> None:
    """Write the findings; the file appears whole or not at all.

    Raises
    ------
    UsageError
        If it cannot be written.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    data = {"engine": engine_id, "version": version, "findings": [dict(each.row()) for each in findings]}
    try:
        try:
            temporary.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise UsageError(f"--json {str(path)!r} cannot be written ({error.strerror or error})") from error
