"""Marks of a history: how bad each is, in words, grouped by what changed together, worst first."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from ninedisk.harness.results.schema import History, Line, Shift
from ninedisk.reports import text

SEVERITIES = {
    "broke": ("‼", "breaks", "out3", "the engine fails, crashes or runs out of time where it ran before"),
    "outside": ("✗", "outside tolerance", "out3", "a check fails that passed before"),
    "larger": ("▲", "larger error", "out2", "still inside its tolerance, but more than twice as far from the truth"),
    "slower": ("◷", "slower", "out1", "takes longer, beyond the noise"),
    "better": ("✓", "better", "in0", "a smaller error, a faster run, or a cell that runs again"),
}
"""Symbol, words, colour class and meaning of each severity, worst first."""


@dataclass(frozen=True)
class Mark:
    """A shift of a line; ``number`` is the line's in its history."""

    line: Line
    shift: Shift
    number: int

    @property
    def severity(self) -> str:
        """One of `SEVERITIES`."""
        if self.shift.verdict == "better":
            return "better"
        if self.line.kind == "cell":
            return "broke"
        if self.line.kind == "timing":
            return "slower"
        return "outside" if self.line.points[self.shift.at].status == "fail" else "larger"

    @property
    def runs(self) -> tuple[int, int]:
        """Numbers of the runs before and at the mark."""
        return self.line.points[self.shift.at - 1].run, self.line.points[self.shift.at].run

    @property
    def span(self) -> tuple[int, int]:
        """Numbers of two runs: the change lies after the first, and not after the second."""
        return self.line.points[self.shift.first - 1].run, self.line.points[self.shift.last].run

    @property
    def size(self) -> float:
        """What ranks marks of one severity: the error over its tolerance, else the factor of the change."""
        if self.line.kind == "cell":
            return 0.0
        if self.severity == "outside":
            return over_tolerance(self.shift.after, self.line.points[self.shift.at].tolerance)
        return self.factor

    @property
    def factor(self) -> float:
        """How many times as large or as small, at least 1."""
        small, large = sorted((self.shift.before, self.shift.after))
        return large / small if small > 0.0 else math.inf

    @property
    def change(self) -> str:
        """The factor in words."""
        if self.line.kind == "cell":
            status = self.line.points[self.shift.at].status
            return "runs again" if self.severity == "better" else f"ends in {status}"
        down = self.shift.after < self.shift.before
        words = ("faster" if down else "slower") if self.line.kind == "timing" else ("smaller" if down else "larger")
        return f"{_plain(self.factor)}× {words}" if math.isfinite(self.factor) else words

    @property
    def levels(self) -> tuple[str, str]:
        """Level before and after: the error over its tolerance, or a duration."""
        if self.line.kind == "cell":
            points = (self.line.points[self.shift.at - 1], self.line.points[self.shift.at])
            return points[0].status, points[1].status
        at = self.shift.at
        return level(self.line, self.shift.before, at), level(self.line, self.shift.after, at)


@dataclass(frozen=True)
class Group:
    """Marks of one severity, case and engine that one change may have caused on all their machines, the worst first.

    ``span`` is what is common to the spans of all: the change lies after its first run, and not after its second.
    """

    marks: tuple[Mark, ...]
    span: tuple[int, int]

    @property
    def since(self) -> int:
        """The run that the change is most likely in: that of the worst mark, as far as it lies in the span."""
        return min(max(self.worst.runs[1], self.span[0] + 1), self.span[1])

    @property
    def machines(self) -> list[str]:
        """Machines of the marks, that of the worst first."""
        return list(dict.fromkeys(mark.line.machine for mark in self.marks))

    @property
    def worst(self) -> Mark:
        """The mark that stands for the group."""
        return self.marks[0]


def _plain(factor: float) -> str:
    """A factor of at least 1: two decimals, none, or a power of ten."""
    if factor < 9.95:
        return f"{factor:.2f}"
    return f"{factor:.0f}" if factor < 1000.0 else f"{factor:.1e}".replace("e+0", "e").replace("e+", "e")


def over_tolerance(value: float, tolerance: float) -> float:
    """Error over tolerance; infinite beyond a zero tolerance."""
    if tolerance > 0.0:
        return value / tolerance
    return 0.0 if value == 0.0 else math.inf


def level(line: Line, value: float, at: int) -> str:
    """A value of a line in words, at its point number ``at``."""
    if line.kind == "timing":
        return text.seconds(value) if line.unit == "s" else f"{value:.2f} × usual"
    tolerance = line.points[at].tolerance
    if tolerance > 0.0:
        return f"{text.ratio(value / tolerance)} × tolerance"
    return f"{text.error(value)} {line.unit}"


def marks(history: History) -> list[Mark]:
    """Every mark, worst first."""
    found = [Mark(line, shift, k) for k, line in enumerate(history.lines) for shift in line.shifts]
    order = list(SEVERITIES)
    return sorted(found, key=lambda m: (order.index(m.severity), -m.size, m.line.case, m.line.variant, m.line.quantity))


def groups(chosen: Iterable[Mark]) -> list[Group]:
    """Marks joined where one change of the code can be the cause of all; the order of the worst ones is kept.

    A line tells only that the change lies after the run before its mark and not after the run at it. Lines of several
    machines have their runs at different times: they are joined if these spans have a run in common.
    """
    found: list[tuple[tuple[str, str, str], list[int], list[Mark]]] = []
    for mark in chosen:
        key, (before, at) = (mark.severity, mark.line.case, mark.line.engine), mark.span
        for place, span, members in found:
            if place == key and max(span[0], before) < min(span[1], at):
                span[:] = max(span[0], before), min(span[1], at)
                members.append(mark)
                break
        else:
            found.append((key, [before, at], [mark]))
    return [Group(tuple(members), (span[0], span[1])) for _, span, members in found]
