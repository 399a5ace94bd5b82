"""Charts of a line's history as small inline SVG: drawn without scripts, with the exact values for those that hover."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from markupsafe import Markup, escape

from ninedisk.harness.results.schema import Line, Point, Shift
from ninedisk.reports import text
from ninedisk.reports.dashboard_marks import over_tolerance

BOTTOM = 1e-4
"""Smallest error over tolerance that is drawn at its own height: what is below is round-off."""


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
        f'<svg class="line{"" if frame.labels else " spark"}" {size} role="img" aria-label="{escape(spoken(line))}"{data}>'
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
    ratio = over_tolerance(point.value, point.tolerance)
    unit = f" {line.unit}" if line.unit not in ("", "-", "1") else ""
    amount = "no number" if math.isinf(point.value) else f"{point.value:.6g}{unit}"
    return f"{amount} = {text.ratio(ratio)} × tolerance, {point.status}"


def spoken(line: Line) -> str:
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
    return math.log10(max(over_tolerance(point.value, point.tolerance), BOTTOM))


def _limits(line: Line, heights: Sequence[float]) -> tuple[float, float]:
    finite = [height for height in heights if math.isfinite(height)]
    if line.kind == "cell":
        return -0.2, 1.2
    low, high = min(finite, default=0.0), max(finite, default=0.0)
    if line.kind == "timing":  # a factor of two at least, so that noise of ten per cent looks like that
        middle, half = (low + high) / 2.0, max(0.16, 0.56 * (high - low))
        return middle - half, middle + half
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
    names = {-4: "≤1e-4", -3: "1/1000", -2: "1/100", -1: "1/10", 0: "tolerance", 1: "10 ×", 2: "100 ×"}
    step = max(1, math.ceil((high - low) / 4))
    return [
        (float(k), names.get(k, f"1e{k} ×"))
        for k in range(math.ceil(low), math.floor(high) + 1)
        if k % step == 0 or k == 0
    ]
