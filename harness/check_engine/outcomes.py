"""What a check of an adapter found, and the bench that its runs are made on."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from ninedisk.core.history import History, Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene
from ninedisk.harness.api.capabilities import Capability
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
from ninedisk.harness.api.text import with_unit
from ninedisk.harness.cases.adapter.probes import Probe
from ninedisk.harness.results.whole_file import write_whole
from ninedisk.harness.run.judge import blank_history, check_timings
from ninedisk.harness.run.plan import plan_case
from ninedisk.harness.run.runner import LATE_CELLS, last_lines, run_cell

MUST_BE_NUMBERS = ("step", "t", "x", "v")
"""Arrays that no engine may leave unobserved."""

PASS, FAIL, REFUSED, UNSEEN = "pass", "fail", "refused", "not-observed"
"""``refused``: the engine says that it cannot express the scene, and why. ``not-observed``: it ran, and reports none of the
numbers that the check is about, which the protocol allows. Neither is a defect."""


@dataclass(frozen=True, kw_only=True)
class Fault:
    """What was found, what to mend, and the numbers where a quantity misses its closed form."""

    found: str
    mend: str = ""
    quantity: str = ""
    unit: str = ""
    value: float = math.nan
    expected: float = math.nan
    allowed: float = math.nan

    @property
    def likeness(self) -> str:
        """What the wrong number is to the right one, where that is a simple relation: it often names the mistake."""
        if math.isnan(self.value) or abs(self.expected) <= 3.0 * self.allowed:
            return ""
        near = 2.0 * max(self.allowed / abs(self.expected), 1e-6)
        ratio = self.value / self.expected
        return next(
            (words for factor, words in LIKENESS.items() if abs(ratio - factor) <= near * abs(factor or 1.0)), ""
        )


LIKENESS = {
    -1.0: "the sign is reversed",
    0.0: "it is zero",
    2.0: "twice too large",
    0.5: "half of it",
    -2.0: "the sign is reversed, and it is twice too large",
    -0.5: "the sign is reversed, and it is half of it",
    180.0 / math.pi: "degrees for radians",
    1e3: "a thousand times too large",
    1e-3: "a thousandth of it",
}
"""What a ratio of a wrong number to the right one says."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """A check, its status, what was found, and what to mend.

    ``faults`` are what is wrong, one by one; ``needs`` what the scene asks of an engine; ``unseen`` the quantities that the
    engine does not report; ``declared`` whether a capability that was refused is one of the engine's.
    """

    check: str
    status: str
    found: str = ""
    mend: str = ""
    faults: tuple[Fault, ...] = ()
    needs: frozenset[Capability] = frozenset()
    unseen: tuple[str, ...] = ()
    declared: bool = False

    def row(self) -> Mapping[str, Any]:
        """Plain data for JSON; the numbers of the faults beside the texts."""
        faults = [
            {
                "quantity": fault.quantity,
                "unit": fault.unit,
                **{name: _plain(getattr(fault, name)) for name in ("value", "expected", "allowed")},
                "found": fault.found,
                "mend": fault.mend,
            }
            for fault in self.faults
        ]
        texts = {name: getattr(self, name) for name in ("check", "status", "found", "mend")}
        return {**texts, "faults": faults, "not_observed": list(self.unseen)}


def _plain(number: float) -> float | None:
    return number if math.isfinite(number) else None


def outcome(check: str, faults: Sequence[tuple[str, str] | Fault], found: str = "") -> Outcome:
    """Pass without faults; else what each says, and each way to mend once. A pair is what was found, and what to mend."""
    if not faults:
        return Outcome(check=check, status=PASS, found=found)
    each = tuple(fault if isinstance(fault, Fault) else Fault(found=fault[0], mend=fault[1]) for fault in faults)
    mends = "; ".join(dict.fromkeys(fault.mend for fault in each if fault.mend))
    return Outcome(check=check, status=FAIL, found="; ".join(fault.found for fault in each), mend=mends, faults=each)


class Bench:
    """An engine on the bench, an `Engine` itself: each run is made once and kept, and probes are run as any case is."""

    keeps_runs = True
    """Its `run` may take no time at all, whatever the timings say."""

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
        begin = time.perf_counter()
        try:
            found = self.engine.run(scene, numerics, watch)
        except Exception as error:
            self._late = self._late + 1 if isinstance(error, EngineTimeoutError) else 0
            raise
        self._late = 0
        check_timings(found.timings, numerics, time.perf_counter() - begin)
        return found

    def run_of(self, probe: Probe) -> EngineRun:
        """The run of a probe, as the engine gives it."""
        return self.run(probe.setup.scene, probe.setup.numerics, probe.setup.watch)

    def faults(self, probe: Probe, *, coarse: bool = False) -> list[Fault]:
        """What the probe's closed forms say against its run, each quantity once, where it is farthest off.

        A number that the engine may leave unobserved, and does, is no fault: `unseen` has it.

        Raises
        ------
        EngineError
            If the probe does not run to its end; EngineUnsupportedError if the engine refuses it once it has it.
        """
        result = run_cell(plan_case(probe, self, {"coarse": coarse}))
        if result.status not in ("pass", "fail", "no-truth", "not-observed"):
            raise (EngineUnsupportedError if result.status == "unsupported" else EngineError)(result.reason)
        mends = {form.quantity: form.mend for form in probe.closed_forms(blank_history(probe.setup))}
        unseen = self.unseen(probe)
        found: dict[str, tuple[float, Fault]] = {}
        for row in result.rows:
            quantity, _, entry = row["quantity"].partition("[")
            if row["status"] != "fail" or (quantity in unseen and math.isnan(row["value"])):
                continue
            size = abs(row["value"] - row["expected"])
            size = math.inf if math.isnan(size) else size
            if quantity in found and found[quantity][0] >= size:
                continue
            where = f" in entry {entry[:-1]}" if entry else ""
            expected = with_unit(f"{row['expected']:.9g}", row["unit"])
            fault = Fault(
                found=f"{quantity} is {row['value']:.9g} instead of {expected}{where} "
                f"(allowed: {row['atol']:.2g}, {row['why']})",
                mend=mends[quantity],
                quantity=quantity,
                unit=row["unit"],
                value=row["value"],
                expected=row["expected"],
                allowed=row["atol"],
            )
            found[quantity] = size, fault
        return [fault for _, fault in found.values()]

    def unseen(self, probe: Probe) -> list[str]:
        """The quantities of a probe whose numbers are missing for no other reason than that the engine need not observe them.

        They have numbers as soon as those arrays do that may hold none: a quotient by zero has not.
        """
        history = self.run_of(probe).history
        arrays = {each.name: getattr(history, each.name) for each in fields(History)}
        filled: dict[str, Any] = {
            name: np.where(np.isnan(array), 1.0, array)
            for name, array in arrays.items()
            if name not in MUST_BE_NUMBERS and isinstance(array, np.ndarray) and array.dtype.kind == "f"
        }
        return [
            form.quantity
            for form, reported in zip(
                probe.closed_forms(history), probe.closed_forms(replace(history, **filled)), strict=True
            )
            if np.isnan(form.value).any() and not np.isnan(reported.value).any()
        ]


def attempt(check: str, make: Callable[[], Outcome], needs: frozenset[Capability] = frozenset()) -> Outcome:
    """The outcome of a check, whatever the adapter does to it; ``needs`` is what its scene asks for."""
    try:
        found = make()
    except EngineUnsupportedError as error:
        return Outcome(check=check, status=REFUSED, found=str(error) or "refused once it had the scene")
    except (Exception, SystemExit) as error:
        found = outcome(check, [(last_lines(error), "a scene that `supports` accepts must run")])
    return replace(found, needs=needs)


def write_json(path: Path, engine_id: str, version: str, outcomes: Sequence[Outcome]) -> None:
    """Write the outcomes; the file appears whole or not at all.

    Raises
    ------
    StoreError
        If it cannot be written.
    """
    data = {"engine": engine_id, "version": version, "findings": [dict(each.row()) for each in outcomes]}
    write_whole("--json", path, json.dumps(data, indent=1) + "\n")
