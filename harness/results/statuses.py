"""The words of verdicts: one table of statuses and one of other verdicts, for the terminal, pages, sites and badges.

Ids are stored, so they never change. A page or a command prints the id itself; the symbol and the meaning explain it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Status:
    """A status of a check or a cell.

    Parameters
    ----------
    id : str
        The word that is stored and printed.
    symbol : str
        One sign for narrow places of pages; no two statuses have the same.
    meaning : str
        One line.
    exit_code : int
        What ``ninedisk run`` ends with if no other status is worse; 0 means that the status is no failure.
    """

    id: str
    symbol: str
    meaning: str
    exit_code: int = 0

    @property
    def fails(self) -> bool:
        """Whether the status counts as a failure."""
        return self.exit_code != 0


TABLE: Mapping[str, Status] = {
    each.id: each
    for each in (
        Status("pass", "✓", "every check is within its tolerance"),
        Status("fail", "✗", "a check is outside its tolerance, or has no number although its truth gives one", 1),
        Status("error", "‼", "the engine failed or crashed", 3),
        Status("timeout", "◷", "the engine was stopped at its limit of CPU time or of idle time", 3),
        Status("unsupported", "○", "not run: the engine lacks a capability that the case needs"),
        Status("not-installed", "∅", "not run: the engine is not on the machine that ran the cases"),
        Status(
            "known-gap",
            "△",
            "outside a printed number that a better truth contradicts, or an expected failure of --known-gaps",
        ),
        Status("gap-closed", "▲", "a known gap that passes: remove its entry (with --known-gaps the run ends with 1)"),
        Status(
            "known-difference",
            "≠",
            "outside its tolerance, within the size predicted for a documented deviation of the engine (a finding)",
        ),
        Status("no-truth", "?", "no reference value"),
        Status(
            "not-observed",
            "∙",
            "not judged: contact forces that the engine has no way to report, as its adapter declares",
        ),
    )
}
"""Every status by its id."""

VERDICTS: Mapping[str, Mapping[str, str]] = {
    "claims of the source": {
        "confirmed": "the engine's results agree with what the source states",
        "contradicted": "the engine's results disagree with what the source states",
        "undecided": "the engine did not run the case, or its results do not decide",
    },
    "findings": {
        "larger": "the size grew by a tenth since the run before, or exceeds what its check explains",
        "gone": "the size no longer exceeds what a correct engine shows",
        "there": "the size exceeds what a correct engine shows",
        "not-measured": "the store has no such cell, or the cell has no number",
    },
    "compare": {
        "worse": "a check, a timing or a cell got worse beyond its noise or tolerance",
        "suspect": "a change that is too close to the noise, or that comes with another tolerance",
        "lost": "in BASE, not in HEAD",
        "not-comparable": "of different case versions or machines",
        "better": "a check, a timing or a cell got better",
        "new": "in HEAD, not in BASE",
        "same": "no change beyond noise or tolerance",
    },
    "determinism": {
        "different": "farther apart than rounding or the solver's tolerance can explain",
        "broken": "the engine ended without an answer",
        "round-off": "no farther apart than rounding or the solver's tolerance can explain",
        "bitwise": "equal to the last bit",
        "not applicable": "the engine has no such feature: no threads, no restart, one run per process",
    },
    "converge": {
        "wrong order": "the order is lower than that of the engine's scheme",
        "wrong limit": "the limit misses the truth by more than the check's tolerance",
        "undecided": "too few levels, or an irregular order",
        "not judged": "no expected order, or differences that may cancel",
        "converges": "the order is at least that of the engine's scheme",
        "step-independent": "the error does not depend on the step",
        "exact": "the error is round-off at every step",
    },
    "audit": {
        "violated": "the trajectory breaks this law beyond the allowance",
        "holds": "the trajectory obeys this law within the allowance",
        "not decidable": "the file says too little to decide",
    },
    "check-engine": {
        "pass": "the check found no fault",
        "fail": "the check found a fault",
        "refused": "not run: the engine refuses the scene for a stated reason",
        "not-observed": "it ran, and reports none of the numbers that the check needs, which the protocol allows",
    },
    "bench": {
        "pass": "the physics check passed, and the time counts",
        "fail": "the physics check failed: no time is given",
        "not-reached": "the solver did not reach its tolerance within the time limit",
        "unsupported": "the engine cannot express the problem",
        "not-installed": "the engine is not on this machine",
        "timeout": "the engine was stopped at the time limit",
        "error": "the engine failed or crashed",
    },
}
"""Verdicts besides statuses, by the command or the pages that print them; worst first where the order matters."""
