"""Point charts: error against step size, accuracy against speed, a number against step size."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ninedisk.reports.draw import log_label
from ninedisk.reports.style import INK, SOFT, Look, rc_params
from ninedisk.reports.svg import write_svg

MOST_LETTERS = 30
"""Letters of all labels of a horizontal axis together: what its width has room for."""

GUIDE = "reference guide"
"""Key of lines that are no data: slopes and levels to compare with."""


@dataclass(frozen=True)
class Dots:
    """Points of one engine (``key`` is its legend key), joined by a line or not; ``names`` label single points."""

    key: str
    look: Look
    x: tuple[float, ...]
    y: tuple[float, ...]
    joined: bool = True
    names: tuple[str, ...] = ()


@dataclass(frozen=True)
class PointChart:
    """A chart of points; ``guides`` are labelled lines to compare with, as (label, x, y).

    Labels of guides stand at their ends, or with ``labels_along`` upon them, from where they begin. ``limits``, (low, high) of either
    axis, replaces those that the points suggest. Few points have their own marks on a logarithmic horizontal axis, unless ``decades``
    are asked for, as for what has been measured.
    """

    title: str
    x_label: str
    y_label: str
    dots: tuple[Dots, ...]
    guides: tuple[tuple[str, tuple[float, ...], tuple[float, ...]], ...] = ()
    x_log: bool = True
    y_log: bool = True
    limits: tuple[tuple[float, float], tuple[float, float]] | None = None
    labels_along: bool = False
    decades: bool = False

    @property
    def x_limits(self) -> tuple[float, float]:
        """Limits of the horizontal axis with some room."""
        if self.limits is not None:
            return self.limits[0]
        return _limits([x for d in self.dots for x in d.x], self.x_log, marked=False)

    @property
    def y_limits(self) -> tuple[float, float]:
        """Limits of the vertical axis with some room; levels to compare with are inside."""
        if self.limits is not None:
            return self.limits[1]
        level = [] if self.y_log else [y for _, _, ys in self.guides for y in ys]
        return _limits([y for d in self.dots for y in d.y] + level, self.y_log)

    @property
    def looks(self) -> dict[str, Look]:
        """Looks by legend key."""
        return {d.key: d.look for d in self.dots}

    def spec(self) -> dict[str, Any]:
        """Plain data of the interactive chart."""
        guides = [
            {"key": GUIDE, "name": label, "colour": SOFT, "dash": [5, 4], "width": 1.2, "line": True, "guide": True,
             "x": xs, "y": ys}
            for label, xs, ys in self.guides
        ]  # fmt: skip
        data = [
            {"key": d.key, "name": d.look.label, "colour": d.look.colour, "dash": d.look.dash, "width": d.look.width,
             "shape": d.look.shape, "line": d.joined, "guide": False, "x": d.x, "y": d.y, "names": d.names}
            for d in self.dots
        ]  # fmt: skip
        return {
            "kind": "points", "title": self.title, "x_label": self.x_label, "y_label": self.y_label, "unit": "",
            "points": guides + data, "xlog": self.x_log, "ylog": self.y_log, "limits": {"x": self.x_limits},
            "y": self.y_limits, "error": None,
        }  # fmt: skip

    def alt(self) -> str:
        """Text alternative."""
        names = ", ".join(dict.fromkeys(d.look.label for d in self.dots))
        return f"{self.title}: {self.y_label} over {self.x_label}. Shown: {names}."


def spread(values: list[tuple[float, float, str]]) -> list[tuple[float, float, str]]:
    """Points in order of x, equal x moved apart by a part in a million so that each can be pointed at."""
    made: list[tuple[float, float, str]] = []
    for x, y, name in sorted(values):
        made.append((max(x, made[-1][0] * (1.0 + 1e-6)) if made else x, y, name))
    return made


def draw_points(chart: PointChart, path: Path) -> None:
    """Write the chart as SVG."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure
    from matplotlib.ticker import FuncFormatter

    powers = FuncFormatter(lambda value, _: log_label(value))
    with rc_context(rc_params()):
        figure = Figure(figsize=(3.6, 2.7))
        axes = figure.subplots()
        figure.subplots_adjust(left=0.2, right=0.975, top=0.87, bottom=0.17)
        figure.text(0.02, 0.985, chart.title, fontsize=9.0, va="top")
        axes.set_xscale("log" if chart.x_log else "linear")
        axes.set_yscale("log" if chart.y_log else "linear")
        for label, x, y in chart.guides:
            axes.plot(x, y, color=SOFT, linewidth=1.0, dashes=(4, 3), zorder=1)
            if chart.labels_along:
                continue
            below = y[-1] == min(ys[-1] for _, _, ys in chart.guides)
            axes.annotate(
                label, (x[-1], y[-1]), (0, -2 if below else 2), textcoords="offset points", fontsize=7, color=INK,
                ha="right", va="top" if below else "bottom",
            )  # fmt: skip
        for d in chart.dots:
            line: dict[str, Any] = {"linestyle": "none"} if not d.joined else {"linewidth": d.look.width}
            if d.joined and d.look.dash:
                line["dashes"] = list(d.look.dash)
            axes.plot(
                d.x, d.y, color=d.look.colour, marker=d.look.marker or "o", markersize=4.5, markeredgewidth=0, **line
            )
        axes.set_xlim(*chart.x_limits)
        axes.set_ylim(*chart.y_limits)
        axes.set_xlabel(chart.x_label)
        axes.set_ylabel(chart.y_label)
        if chart.labels_along:
            _label_along(axes, chart)
        axes.minorticks_off()
        if chart.x_log:
            axes.xaxis.set_major_formatter(powers)
        if chart.y_log:
            axes.yaxis.set_major_formatter(powers)
        steps = sorted({x for d in chart.dots for x in d.x})
        if chart.x_log and len(steps) < 7 and not (chart.decades and _holds_decade(*chart.x_limits)):
            axes.set_xticks(steps, _tick_labels(steps))
        write_svg(figure, path)


def _holds_decade(low: float, high: float) -> bool:
    """Whether a power of ten lies between two numbers."""
    return math.floor(math.log10(high)) >= math.ceil(math.log10(low))


def _label_along(axes: Any, chart: PointChart) -> None:
    """Labels of the guides on their lines: at the right on a level, else turned like the line, from where it begins."""
    for label, x, y in chart.guides:
        (ax, ay), (bx, by) = axes.transData.transform([(x[0], y[0]), (x[1], y[1])])
        angle = math.atan2(by - ay, bx - ax)
        level = ay == by
        along, off = (-3.0 if level else 8.0), 1.5
        shift = (along * math.cos(angle) - off * math.sin(angle), along * math.sin(angle) + off * math.cos(angle))
        axes.annotate(
            label, (x[1 if level else 0], y[0]), shift, textcoords="offset points", fontsize=6.5, color=INK,
            ha="right" if level else "left", va="bottom", rotation=math.degrees(angle), rotation_mode="anchor",
        )  # fmt: skip


def _tick_labels(steps: list[float]) -> list[str]:
    """Labels that do not run into each other: shortened, and every second one left out where there is no room."""
    labels = [f"{x:g}" for x in steps]
    if sum(map(len, labels)) <= MOST_LETTERS:
        return labels
    labels = [f"{x:.2g}" for x in steps]
    crowded = sum(map(len, labels)) > MOST_LETTERS
    return [label if not crowded or (len(labels) - 1 - k) % 2 == 0 else "" for k, label in enumerate(labels)]


def _limits(values: list[float], log: bool, *, marked: bool = True) -> tuple[float, float]:
    low, high = min(values), max(values)
    if log:
        room = max(1.3, (high / low) ** 0.08)
        low, high = low / room, high * room
        # Less than a decade and a half: a third of a decade more on each side, so that a mark of the axis lies inside.
        return (low / 2.2, high * 2.2) if marked and high / low < 30.0 else (low, high)
    room = 0.1 * (high - low) or 0.1 * abs(high) or 1.0
    return low - room, high + room


def fitted_order(steps: list[float], errors: list[float]) -> float:
    """Slope of ``log error`` over ``log step`` by least squares; NaN with fewer than two points."""
    if len(steps) < 2:
        return math.nan
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])
