"""What a check of an adapter found.

Findings as a table and as JSON.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ninedisk.harness.api.engine import Engine, EngineInfo, EngineRun
from ninedisk.harness.api.text import printable
from ninedisk.harness.check_engine.probes import Probe
from ninedisk.harness.cli.support import console, table
from ninedisk.harness.results.whole_file import write_whole
from ninedisk.harness.run.runner import last_lines

PASS, FAIL, REFUSED = "pass", "fail", "refused"
"""``refused``: the engine says that it cannot express the scene, and why; that is no defect."""


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One line of the table: a check, its status, what was found, and what to mend."""

    check: str
    status: str
    found: str = ""
    mend: str = ""

    def row(self) -> Mapping[str, str]:
        """Plain data for JSON."""
        return dict(vars(self))


def finding(check: str, faults: Sequence[tuple[str, str]], found: str = "") -> Finding:
    """Pass without faults; else what each says, and each way to mend once. A fault is (what was found, what to mend)."""
    if not faults:
        return Finding(check=check, status=PASS, found=found)
    mends = "; ".join(dict.fromkeys(mend for _, mend in faults if mend))
    return Finding(check=check, status=FAIL, found="; ".join(text for text, _ in faults), mend=mends)


@dataclass(frozen=True)
class Bench:
    """An engine on the bench: its facts, and its runs of probes, each run once and kept."""

    engine: Engine
    info: EngineInfo
    runs: dict[str, EngineRun]

    def run(self, probe: Probe, *, again: bool = False) -> EngineRun:
        """The run of a probe; ``again``: one more, which is not kept."""
        if again:
            return _run(self.engine, probe)
        setup = probe.setup
        key = json.dumps([setup.scene.to_dict(), setup.numerics.to_dict(), setup.watch])
        if key not in self.runs:
            self.runs[key] = _run(self.engine, probe)
        return self.runs[key]


def _run(engine: Engine, probe: Probe) -> EngineRun:
    setup = probe.setup
    return engine.run(setup.scene, setup.numerics, setup.watch)


def attempt(check: str, make: Callable[[], Finding]) -> Finding:
    """The finding of a check, whatever the adapter does to it."""
    try:
        return make()
    except Exception as error:
        return Finding(
            check=check, status=FAIL, found=last_lines(error), mend="a scene that `supports` accepts must run"
        )


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
