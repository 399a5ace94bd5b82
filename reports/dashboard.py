"""The regression dashboard from a history: overview, a page per case and engine, comparisons around marks.

A page holds hundreds of short lines, so each is a small inline SVG, drawn without scripts, with the exact values for those who hover.
Marks say where a line changed for good: how bad that is, in words, grouped by what changed together, worst first.
"""

from __future__ import annotations

import json
import math
import shutil
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from markupsafe import Markup, escape

from ninedisk.harness.results.schema import ROUND_OFF, Line, Point, RunFacts, Shift, StoreHistory
from ninedisk.reports import studies
from ninedisk.reports.folder import fresh_folder
from ninedisk.reports.pages import HERE, sheet, statuses_page
from ninedisk.reports.panel import text
from ninedisk.reports.panel.ranking import percent

MARKER = ".ninedisk-dashboard"
"""File that says: this folder is a dashboard and may be replaced."""
BOTTOM = 1e-4
"""Smallest error over tolerance that is drawn at its own height: what is below is round-off."""
SEVERITIES = {
    "broke": ("‼", "breaks", "out3", "the engine fails, crashes or runs out of time where it ran before"),
    "outside": ("✗", "outside tolerance", "out3", "a check fails that passed before"),
    "larger": ("▲", "larger error", "out2", "still inside its tolerance, but more than twice as far from the truth"),
    "slower": ("◷", "slower", "out1", "takes longer, beyond the noise"),
    "better": ("✓", "better", "in0", "a smaller error, a faster run, or a cell that runs again"),
}
"""Symbol, words, colour class and meaning of each severity, worst first."""
Place = tuple[str, str]
"""Case and engine."""
SHOWN = 40
"""Groups of marks that the overview lists before the rest is folded."""


def build_dashboard(history: StoreHistory, out: Path, progress: Callable[[str, int, int], None]) -> Path:
    """Write the dashboard into the folder ``out``, which is replaced as a whole.

    Parameters
    ----------
    history : StoreHistory
    out : Path
    progress : callable
        Called with a stage, the number of pieces done and their number.

    Returns
    -------
    Path
        ``out/index.html``.

    Raises
    ------
    ReportError
        If ``out`` is something else than an earlier dashboard, or cannot be written.
    """
    with fresh_folder(out, MARKER, "dashboard") as folder:
        pages = Pages(history)
        for name in ("lines", "compare"):
            (folder / name).mkdir()
        (folder / "style.css").write_text(sheet("dashboard.css"), encoding="utf-8")
        shutil.copyfile(HERE / "assets" / "dashboard.js", folder / "dashboard.js")
        total = len(pages.places) + len(history.comparisons) + 1
        written = 0
        for place in pages.places:
            progress("writing pages", written, total)
            (folder / pages.file(place)).write_text(pages.lines(place), encoding="utf-8")
            written += 1
        for around in history.comparisons:
            progress("writing pages", written, total)
            (folder / pages.compare_file(around)).write_text(pages.compare(around), encoding="utf-8")
            written += 1
        (folder / "statuses.html").write_text(pages.statuses(), encoding="utf-8")
        (folder / "index.html").write_text(pages.index(), encoding="utf-8")
        progress("writing pages", total, total)
    return Path(out).absolute() / "index.html"


@dataclass(frozen=True)
class Frame:
    """Size of a chart and its margins, in its own units; ``labels`` says whether axes are written."""

    width: int
    height: int
    left: int = 52
    right: int = 10
    top: int = 16
    bottom: int = 18
    labels: bool = True


CARD = Frame(420, 150)
SPARK = Frame(180, 40, 4, 4, 5, 5, labels=False)


def chart(line: Line, columns: Mapping[int, int], dates: Sequence[str], frame: Frame = CARD) -> Markup:
    """Draw a line.

    Parameters
    ----------
    line : Line
    columns : mapping
        Place of each run among those of the line's machine, so that runs without the line leave a gap.
    dates : sequence of str
        First and last date, for the axis.
    frame : Frame
    """
    heights = [_height(line, point) for point in line.points]
    low, high = _limits(line, heights)
    last = max(columns.values(), default=0) or 1
    inner = frame.width - frame.left - frame.right

    def x(place: float) -> float:
        return round(frame.left + inner * place / last, 1)

    def y(height: float) -> float:
        share = (min(max(height, low), high) - low) / (high - low)
        return round(frame.top + (frame.height - frame.top - frame.bottom) * (1.0 - share), 1)

    spots = [
        (x(columns[point.run]), y(height)) for point, height in zip(line.points, heights, strict=True)
    ]  # fmt: skip
    shown = [k for k, height in enumerate(heights) if not math.isnan(height)]
    parts = [_axes(line, frame, low, high, y, dates)] if frame.labels else [_tolerance(line, frame, low, high, y)]
    bad = [k for k in shown if line.points[k].status in ("fail", "error", "timeout")]
    parts.append(f'<path class="thread" d="{_thread([(spots[k], k) for k in shown], columns, line.points)}"/>')
    parts.append(f'<path class="dots" d="{_dots([spots[k] for k in shown if k not in bad])}"/>')
    parts.append(f'<path class="crosses" d="{_crosses([spots[k] for k in bad])}"/>')
    if line.kind == "timing" and line.shifts:
        parts.append(f'<path class="level" d="{_levels(line, spots, y)}"/>')
    parts += [_mark(shift, spots, frame) for shift in line.shifts]
    data = ""
    if frame.labels:
        data = f' tabindex="0" data-points="{escape(_exact(line, spots))}"'
    size = f'viewBox="0 0 {frame.width} {frame.height}"'
    return Markup(
        f'<svg class="line{"" if frame.labels else " spark"}" {size} role="img" aria-label="{escape(text_alternative(line))}"{data}>'
        f"{''.join(parts)}</svg>"
    )


def _exact(line: Line, spots: Sequence[tuple[float, float]]) -> str:
    """For each point its place, its run, and value, engine version and reason in words; null: as at the point before."""
    found, before = [], ("", "", "")
    for spot, point in zip(spots, line.points, strict=True):
        words = (value(line, point), point.engine_version, point.reason[:200])
        height = None if math.isnan(spot[1]) else spot[1]
        found.append([spot[0], height, point.run, *(None if w == b else w for w, b in zip(words, before, strict=True))])
        before = words
    return json.dumps(found, ensure_ascii=False, separators=(",", ":"))


def value(line: Line, point: Point) -> str:
    """The exact value of a point in words."""
    if line.kind == "cell" or math.isnan(point.value):
        return point.status
    if line.kind == "timing":
        if line.unit != "s":
            return f"{point.value:.4g} × usual"
        usual = f", {text.seconds(point.value / point.shared)} at the machine's usual speed"
        return text.seconds(point.value) + (usual if point.shared != 1.0 else "")
    if line.kind == "headline":
        return percent(point.value)
    ratio = over_tolerance(point.value, point.tolerance)
    unit = f" {line.unit}" if line.unit not in ("", "-", "1") else ""
    amount = "no number" if math.isinf(point.value) else f"{point.value:.6g}{unit}"
    return f"{amount} = {text.ratio(ratio)} × tolerance, {point.status}"


def text_alternative(line: Line) -> str:
    """What the chart shows, for those who do not see it."""
    first, last = line.points[0], line.points[-1]
    said = f"{line.quantity or 'status'} of {line.case}, {line.engine_name}, over {len(line.points)} runs: "
    said += f"first {value(line, first)}, last {value(line, last)}"
    return said + "".join(f"; at run {s.at + 1}: {s.reason}" for s in line.shifts)


def _height(line: Line, point: Point) -> float:
    """Logarithm (base 10) of what is drawn; broken cells one step above whole ones."""
    if line.kind == "cell":
        return 1.0 if point.status in ("error", "timeout") else 0.0
    if math.isnan(point.value):
        return math.nan
    if line.kind == "timing":
        return math.log10(point.value / point.shared)
    if line.kind == "headline":
        return math.log10(max(point.value, ROUND_OFF))
    return math.log10(max(over_tolerance(point.value, point.tolerance), BOTTOM))


def _limits(line: Line, heights: Sequence[float]) -> tuple[float, float]:
    finite = [height for height in heights if math.isfinite(height)]
    if line.kind == "cell":
        return -0.2, 1.2
    low, high = min(finite, default=0.0), max(finite, default=0.0)
    if line.kind == "timing":  # a factor of two at least, so that noise of ten per cent looks like that
        middle, half = (low + high) / 2.0, max(0.16, 0.56 * (high - low))
        return middle - half, middle + half
    if line.kind == "headline":
        return low - 0.6, high + 0.6
    return min(low, -1.2) - 0.15, max(high, 0.0) + 0.35


def _thread(
    spots: Sequence[tuple[tuple[float, float], int]], columns: Mapping[int, int], points: Sequence[Point]
) -> str:
    """The curve, interrupted where runs are missing."""
    said, before = [], -2
    for (x, y), k in spots:
        place = columns[points[k].run]
        said.append(f"{'L' if place == before + 1 else 'M'}{x:g} {y:g}")
        before = place
    return "".join(said)


def _levels(line: Line, spots: Sequence[tuple[float, float]], y: Callable[[float], float]) -> str:
    """The medians between the marks."""
    edges = [0, *(shift.at for shift in line.shifts), len(spots)]
    heights = [line.shifts[0].before, *(shift.after for shift in line.shifts)]
    return "".join(
        f"M{spots[a][0]:g} {y(math.log10(height)):g}H{spots[b - 1][0]:g}"
        for (a, b), height in zip(pairwise(edges), heights, strict=True)
    )


def _dots(spots: Sequence[tuple[float, float]]) -> str:
    return "".join(f"M{x:g} {y:g}h0" for x, y in spots)


def _crosses(spots: Sequence[tuple[float, float]]) -> str:
    return "".join(f"M{x - 2.5:g} {y - 2.5:g}l5 5m0-5l-5 5" for x, y in spots)


def _mark(shift: Shift, spots: Sequence[tuple[float, float]], frame: Frame) -> str:
    """A vertical line before the first point of the new level, with a triangle that points to where it went."""
    x = (spots[shift.at - 1][0] + spots[shift.at][0]) / 2.0
    worse = shift.verdict == "worse"
    top, bottom = frame.top - 4, frame.height - frame.bottom
    triangle = f"M{x - 5:g} {top:g}h10l-5-8z" if worse else f"M{x - 5:g} {top - 8:g}h10l-5 8z"
    kind = "worse" if worse else "better"
    tip = f'<path class="{kind}" d="{triangle}"/>' if frame.labels else ""
    return f'<g><path class="at {kind}-at" d="M{x:g} {top:g}V{bottom:g}"/>{tip}</g>'


def _tolerance(line: Line, frame: Frame, low: float, high: float, y: Callable[[float], float]) -> str:
    if line.kind != "error" or not low < 0.0 < high:
        return ""
    return f'<path class="limit" d="M{frame.left} {y(0.0):g}H{frame.width - frame.right}"/>'


def _axes(line: Line, frame: Frame, low: float, high: float, y: Callable[[float], float], dates: Sequence[str]) -> str:
    right, base = frame.width - frame.right, frame.height - frame.bottom
    parts = [f'<path class="axis" d="M{frame.left} {base}H{right}"/>']
    for height, words in _ticks(line, low, high):
        kind = "limit" if line.kind == "error" and height == 0.0 else "grid"
        parts.append(f'<path class="{kind}" d="M{frame.left} {y(height):g}H{right}"/>')
        parts.append(f'<text x="{frame.left - 4}" y="{y(height) + 3.5:g}" text-anchor="end">{escape(words)}</text>')
    parts.append(f'<text x="{frame.left}" y="{frame.height - 4}">{escape(dates[0])}</text>')
    parts.append(f'<text x="{right}" y="{frame.height - 4}" text-anchor="end">{escape(dates[-1])}</text>')
    return "".join(parts)


def _ticks(line: Line, low: float, high: float) -> list[tuple[float, str]]:
    if line.kind == "cell":
        return [(0.0, "runs"), (1.0, "breaks")]
    if line.kind == "timing":
        middle = (low + high) / 2.0
        heights = [middle - 0.7 * (middle - low), middle, middle + 0.7 * (high - middle)]
        return [(h, text.seconds(10**h) if line.unit == "s" else f"{10**h:.2f}") for h in heights]
    if line.kind == "headline":
        step = max(1, math.ceil((high - low) / 4))
        return [(float(k), percent(10.0**k)) for k in range(math.ceil(low), math.floor(high) + 1) if k % step == 0]
    names = {-4: "≤1e-4", -3: "1/1000", -2: "1/100", -1: "1/10", 0: "tolerance", 1: "10 ×", 2: "100 ×"}
    step = max(1, math.ceil((high - low) / 4))
    return [
        (float(k), names.get(k, f"1e{k} ×"))
        for k in range(math.ceil(low), math.floor(high) + 1)
        if k % step == 0 or k == 0
    ]


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
        return f"{text.factor(self.factor)}× {words}" if math.isfinite(self.factor) else words

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
        """The mark that represents the group."""
        return self.marks[0]


def over_tolerance(value: float, tolerance: float) -> float:
    """Error over tolerance; infinite beyond a zero tolerance."""
    if tolerance > 0.0:
        return value / tolerance
    return 0.0 if value == 0.0 else math.inf


def level(line: Line, value: float, at: int) -> str:
    """A value of a line in words, at its point number ``at``."""
    if line.kind == "timing":
        return text.seconds(value) if line.unit == "s" else f"{value:.2f} × usual"
    if line.kind == "headline":
        return percent(value)
    tolerance = line.points[at].tolerance
    if tolerance > 0.0:
        return f"{text.ratio(value / tolerance)} × tolerance"
    return f"{text.error(value)} {line.unit}"


def marks(history: StoreHistory) -> list[Mark]:
    """Every mark, worst first."""
    found = [Mark(line, shift, k) for k, line in enumerate(history.lines) for shift in line.shifts]
    order = list(SEVERITIES)
    return sorted(found, key=lambda m: (order.index(m.severity), -m.size, m.line.case, m.line.variant, m.line.quantity))


@dataclass(frozen=True)
class Step:
    """A line between the newest run of its machine and the one before: a factor of its error (over tolerance if a check's) or time."""

    line: Line
    before: float
    after: float

    @property
    def words(self) -> str:
        """The factor and both ends: ``1.02 × (0.53 → 0.54 × tolerance)``."""
        if self.line.kind == "timing":
            reported = f"{text.seconds(self.before)} → {text.seconds(self.after)}"
        elif self.line.kind == "headline":
            reported = f"{percent(self.before)} → {percent(self.after)}"
        else:
            reported = f"{text.ratio(self.before)} → {text.ratio(self.after)} × tolerance"
        return f"{text.factor(self.after / self.before)} × ({reported})"

    @property
    def size(self) -> float:
        """What ranks changes: how far an error moved, a check's in tolerances, or the logarithm of a timing's factor; 0 for none."""
        if self.line.kind == "timing":
            return abs(math.log(self.after / self.before))
        return abs(self.after - self.before)


def last_steps(history: StoreHistory) -> dict[str, Step]:
    """The largest change of an error and of a timing between the newest run and the one before on its machine, by kind.

    The error that moved by the largest part of its tolerance is the one that changed most: round-off may triple, and is nothing.
    From timings is taken what all timings of a run share.
    """
    machine = history.runs[-1].machine
    last = [number for number, run in enumerate(history.runs) if run.machine == machine][-2:]
    found: dict[str, Step] = {}
    for line in history.lines:
        ends = line.points[-2:]
        heights = [_height(line, point) for point in ends]
        same = line.machine == machine and len(last) == 2 and [point.run for point in ends] == last
        if line.kind == "cell" or not line.engine or not same or not all(map(math.isfinite, heights)):
            continue
        step = Step(line, 10.0 ** heights[0], 10.0 ** heights[1])
        if line.kind not in found or step.size > found[line.kind].size:
            found[line.kind] = step
    return found


def groups(chosen: Iterable[Mark]) -> list[Group]:
    """Marks joined where one change of the code can be the cause of all; the order of the worst ones is kept.

    A line says only that the change lies after the run before its mark and not after the run at it. Lines of several
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


class Pages:
    """All pages of one history."""

    def __init__(self, history: StoreHistory) -> None:
        self._history = history
        self._marks = marks(history)
        self.places: dict[Place, list[Line]] = {}
        for line in history.lines:
            self.places.setdefault((line.case, line.engine), []).append(line)
        self._by_machine: dict[str, list[int]] = {}
        for number, run in enumerate(history.runs):
            self._by_machine.setdefault(run.machine, []).append(number)
        self._columns = {m: {run: k for k, run in enumerate(runs)} for m, runs in self._by_machine.items()}
        self._slug = text.Slugs()
        self._env = studies.environment()
        self._env.globals |= {
            "severities": SEVERITIES,
            "file": self.file,
            "anchor": self._anchor,
            "compare_file": self.compare_file,
            "draw": self._draw,
            "spark": self._spark,
            "run_of": self._run_of,
            "n_machines": len(self._by_machine),
            "newest_value": self._newest_value,
        }

    def file(self, place: Place) -> str:
        """Path of the page of a case and engine."""
        return f"lines/{self._slug('--'.join(part or 'every engine' for part in place))}.html"

    def compare_file(self, around: tuple[int, int]) -> str:
        """Path of the comparison of two runs."""
        return f"compare/{self._slug('--'.join(self._history.runs[number].run_id for number in around))}.html"

    def index(self) -> str:
        """The overview."""
        standing = [mark for mark in self._marks if mark.shift.open]
        past = [m for m in self._marks if not m.shift.open and m.shift.verdict == "worse"]
        better = [mark for mark in self._marks if mark.shift.verdict == "better"]
        lines = [line for line in self._history.lines if line.kind != "cell"]
        return self._env.get_template("dashboard/page.html").render(
            root="",
            standing=groups(standing),
            past=groups(past),
            better=groups(better),
            shown=SHOWN,
            n_lines=len(lines),
            n_headlines=sum(line.kind == "headline" for line in lines),
            n_timings=sum(line.kind == "timing" for line in lines),
            matrix=self._matrix(standing),
            engines=self._engines(),
            machines={machine: len(runs) for machine, runs in self._by_machine.items()},
            runs=[self._run(number) for number in reversed(range(len(self._history.runs)))],
            newest=self._history.runs[-1],
            last_steps=last_steps(self._history),
            rules=self._history.rules,
            ended=[line for line in lines if self._ends(line)],
            whole_runs=[line for line in self._history.lines if not line.engine],
        )

    def statuses(self) -> str:
        """The page of statuses."""
        return statuses_page(self._env)

    def lines(self, place: Place) -> str:
        """The page of a case and engine: every line, those with marks first."""
        held = self.places[place]
        found = [mark for mark in self._marks if (mark.line.case, mark.line.engine) == place]
        by_machine: dict[tuple[str, int], list[Line]] = {}
        for line in sorted(
            held,
            key=lambda line: (
                not line.shifts,
                line.kind == "timing",
                line.kind != "headline",
                line.variant,
                line.quantity,
            ),
        ):
            by_machine.setdefault((line.machine, line.case_version), []).append(line)
        return self._env.get_template("dashboard/lines.html").render(
            root="../",
            place=place,
            engine_name=held[0].engine_name,
            groups=groups(found),
            by_machine=by_machine,
            versions={version for _, version in by_machine},
            runs=[self._run(number) for number in range(len(self._history.runs))],
            rules=self._history.rules,
        )

    def compare(self, around: tuple[int, int]) -> str:
        """The comparison of the two runs around a mark."""
        values = studies.values(self._history.comparisons[around]) | {"root": "../"}
        return self._env.get_template("dashboard/compare.html").render(**values)

    def _engines(self) -> dict[str, str]:
        return {line.engine: line.engine_name for line in self._history.lines if line.engine}

    def _matrix(self, standing: list[Mark]) -> list[tuple[str, list[dict[str, Any] | None]]]:
        """Rows of cases, worst first; for each engine the worst standing severity with the counts of all."""
        order = {severity: k for k, severity in enumerate(SEVERITIES)}
        found: dict[Place, Counter[str]] = {}
        for mark in standing:
            found.setdefault((mark.line.case, mark.line.engine), Counter())[mark.severity] += 1
        rows = []
        for case in dict.fromkeys(line.case for line in self._history.lines if line.engine):
            squares: list[dict[str, Any] | None] = []
            for engine in self._engines():
                held = self.places.get((case, engine))
                counts = found.get((case, engine), Counter())
                worst = min(counts, key=order.__getitem__, default=None)
                squares.append(None if held is None else {"place": (case, engine), "worst": worst, "counts": counts,
                                                          "lines": sum(line.kind != "cell" for line in held)})  # fmt: skip
            rank = min((order[s["worst"]] for s in squares if s and s["worst"]), default=len(order))
            rows.append((rank, case, squares))
        rows.sort(key=lambda row: (row[0], row[1]))
        return [(case, squares) for _, case, squares in rows]

    def _run(self, number: int) -> dict[str, Any]:
        """Facts of a run, with the versions that changed since the one before on the same machine."""
        facts = self._history.runs[number]
        before = [k for k in self._by_machine[facts.machine] if k < number]
        changed = _changed(self._history.runs[before[-1]], facts) if before else ["first run on this machine"]
        return {"id": facts.run_id, "date": facts.started[:16].replace("T", " "), "commit": facts.commit[:12],
                "machine": facts.machine, "changed": changed, "ninedisk": facts.versions.get("ninedisk", "")}  # fmt: skip

    def _ends(self, line: Line) -> bool:
        """Whether the newest run of the line's machine has nothing of it."""
        return line.points[-1].run != self._by_machine[line.machine][-1]

    def _newest_value(self, line: Line) -> str:
        point = line.points[-1]
        when = f"last seen {self._run(point.run)['date'][:10]}" if self._ends(line) else "now"
        return f"{when}: {value(line, point)}"

    def _run_of(self, group: Group) -> dict[str, Any]:
        return self._run(group.since)

    def _anchor(self, line: Line) -> str:
        parts = (line.kind, str(line.case_version), line.variant, line.quantity, line.truth, line.machine)
        return self._slug("/".join(("anchor", line.case, line.engine, *parts)))

    def _draw(self, line: Line) -> Markup:
        runs = self._by_machine[line.machine]
        dates = [self._history.runs[number].started[:10] for number in (runs[0], runs[-1])]
        return chart(line, self._columns[line.machine], dates)

    def _spark(self, group: Group) -> Markup:
        line = group.worst.line
        return chart(line, self._columns[line.machine], ("", ""), SPARK)


def _changed(before: RunFacts, after: RunFacts) -> list[str]:
    names = sorted({*before.versions, *after.versions})
    old, new = before.versions, after.versions
    return [
        f"{name} {old.get(name, text.NOTHING)} → {new.get(name, text.NOTHING)}"
        for name in names
        if old.get(name) != new.get(name)
    ]
