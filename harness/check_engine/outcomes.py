"""What a check of an adapter found, as a table and as JSON, and the bench that its runs are made on."""

from __future__ import annotations

import json
import shlex
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ninedisk.core.history import Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene
from ninedisk.harness.api.engine import (
    Engine,
    EngineError,
    EngineInfo,
    EngineRun,
    EngineTimeoutError,
    EngineUnsupportedError,
    Support,
)
from ninedisk.harness.api.support import support_of
from ninedisk.harness.api.text import printable
from ninedisk.harness.cases.adapter.probes import Probe
from ninedisk.harness.results.whole_file import write_whole
from ninedisk.harness.run.judge import blank_history
from ninedisk.harness.run.plan import plan_case
from ninedisk.harness.run.runner import LATE_CELLS, last_lines, run_cell
from ninedisk.harness.terminal import console, table

PASS, FAIL, REFUSED = "pass", "fail", "refused"
"""``refused``: the engine says that it cannot express the scene, and why; that is no defect."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """One line of the table: a check, its status, what was found, and what to mend."""

    check: str
    status: str
    found: str = ""
    mend: str = ""

    def row(self) -> Mapping[str, str]:
        """Plain data for JSON."""
        return dict(vars(self))


def outcome(check: str, faults: Sequence[tuple[str, str]], found: str = "") -> Outcome:
    """Pass without faults; else what each says, and each way to mend once. A fault is (what was found, what to mend)."""
    if not faults:
        return Outcome(check=check, status=PASS, found=found)
    mends = "; ".join(dict.fromkeys(mend for _, mend in faults if mend))
    return Outcome(check=check, status=FAIL, found="; ".join(text for text, _ in faults), mend=mends)


class Bench:
    """An engine on the bench, an `Engine` itself: each run is made once and kept, and probes are run as any case is."""

    def __init__(self, engine: Engine, info: EngineInfo) -> None:
        self.id, self.engine, self._info = engine.id, engine, info
        self._runs: dict[str, EngineRun | Exception] = {}
        self._late = 0

    def info(self) -> EngineInfo:
        """The engine's facts, asked for once."""
        return self._info

    def supports(self, scene: Scene, numerics: Numerics) -> Support:
        """What the engine answers."""
        return support_of(self.engine, scene, numerics)

    def run(self, scene: Scene, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:
        """The engine's run of this scene, or its error, kept."""
        key = json.dumps([scene.to_dict(), numerics.to_dict(), watch])
        if key not in self._runs:
            try:
                self._runs[key] = self.run_anew(scene, numerics, watch)
            except Exception as error:
                self._runs[key] = error
        if isinstance(found := self._runs[key], Exception):
            raise found
        return found

    def run_anew(self, scene: Scene, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:
        """One more run, which is not kept; EngineTimeoutError at once after `LATE_CELLS` in a row at their time limits."""
        if self._late >= LATE_CELLS:
            raise EngineTimeoutError(f"not run: the engine was stopped at its time limit {LATE_CELLS} times in a row")
        try:
            found = self.engine.run(scene, numerics, watch)
        except Exception as error:
            self._late = self._late + 1 if isinstance(error, EngineTimeoutError) else 0
            raise
        self._late = 0
        return found

    def run_of(self, probe: Probe) -> EngineRun:
        """The run of a probe, as the engine gives it."""
        return self.run(probe.setup.scene, probe.setup.numerics, probe.setup.watch)

    def faults(self, probe: Probe, *, coarse: bool = False) -> list[tuple[str, str]]:
        """What the probe's closed forms say against its run, each quantity once: (what was found, what to mend).

        Raises
        ------
        EngineError
            If the probe does not run to its end; EngineUnsupportedError if the engine refuses it once it has it.
        """
        result = run_cell(plan_case(probe, self, {"coarse": coarse}))
        if result.status not in ("pass", "fail", "no-truth"):
            raise (EngineUnsupportedError if result.status == "unsupported" else EngineError)(result.reason)
        mends = {form.quantity: form.mend for form in probe.closed_forms(blank_history(probe.setup))}
        found: dict[str, tuple[str, str]] = {}
        for row in result.rows:
            quantity = row["quantity"].partition("[")[0]
            if row["status"] == "fail":
                shown = f"{row['value']:.9g} instead of {row['expected']:.9g} {row['unit']}"
                text = f"{quantity} is {shown} (allowed: {row['atol']:.2g}, {row['why']})"
                found.setdefault(quantity, (text, mends[quantity]))
        return list(found.values())


def attempt(check: str, make: Callable[[], Outcome]) -> Outcome:
    """The outcome of a check, whatever the adapter does to it."""
    try:
        return make()
    except EngineUnsupportedError as error:
        return Outcome(check=check, status=REFUSED, found=str(error) or "refused once it had the scene")
    except Exception as error:
        return Outcome(
            check=check, status=FAIL, found=last_lines(error), mend="a scene that `supports` accepts must run"
        )


def show(engine_id: str, outcomes: Sequence[Outcome], command: Sequence[str]) -> None:
    """The table, a line that counts, and the command that does the first failing check again; ``command`` does them all."""
    shown = table("check", "status", "found", "mend")
    for each in outcomes:
        shown.add_row(each.check, each.status, printable(each.found), printable(each.mend))
    out = console()
    out.print(shown)
    counts = Counter(each.status for each in outcomes)
    parts = [f"{counts[status]} {status}" for status in (PASS, FAIL, REFUSED) if counts[status]]
    out.print(f"{engine_id}: {', '.join(parts)}")
    first = next((each.check for each in outcomes if each.status == FAIL), None)
    if first is not None:
        out.print(f"the first failing check again: {shlex.join([*command, '--check', first])}", soft_wrap=True)


def write_json(path: Path, engine_id: str, version: str, outcomes: Sequence[Outcome]) -> None:
    """Write the outcomes; the file appears whole or not at all.

    Raises
    ------
    StoreError
        If it cannot be written.
    """
    data = {"engine": engine_id, "version": version, "findings": [dict(each.row()) for each in outcomes]}
    write_whole("--json", path, json.dumps(data, indent=1) + "\n")
