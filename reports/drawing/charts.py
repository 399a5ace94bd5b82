"""Looks of engines, and charts that `assets/charts.js` draws: points as plain data, text alternative, legend.

Every curve of a page is drawn there and nowhere else; figures of the source have a picture besides, for print and for readers
without scripts.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

SOFT = "#8a9099"
"""Colour of grids and hatches, readable on white and on black."""
PALETTE = ("#1470b5", "#f86507", "#2ca45a", "#fd44b3", "#a00bfe", "#826710", "#a55c89", "#9582f9")
"""Any two lie 0.16 or more apart in OKLab, for readers without green cones as well, and stand out 3 : 1 from white and from dark pages."""
DASHES = ((), (7.0, 2.5), (2.0, 2.0), (7.0, 2.0, 2.0, 2.0))
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "p")
REFERENCE_DASHES = {
    "exact-step": ((), 4.5),
    "analytic": ((2.5, 1.0), 3.6),
    "converged": ((1.0, 1.0), 3.6),
    "published": ((5.0, 1.0, 1.0, 1.0), 3.0),
    "consensus": ((5.0, 1.0, 1.0, 1.0), 2.4),
}
"""Dash and width of a reference by the kind of its truth."""
SHAPES = {
    "o": "M13 5a3 3 0 1 0 6 0a3 3 0 1 0 -6 0z",
    "s": "M13 2h6v6h-6z",
    "^": "M16 1.5l3.5 6.5h-7z",
    "D": "M16 1.2l3.8 3.8l-3.8 3.8l-3.8 -3.8z",
    "v": "M16 8.5l3.5 -6.5h-7z",
    "P": "M15 1.5h2v2.5h2.5v2h-2.5v2.5h-2v-2.5h-2.5v-2h2.5z",
    "X": "M13 3.3l1.4 -1.4l1.6 1.7l1.6 -1.7l1.4 1.4l-1.7 1.7l1.7 1.7l-1.4 1.4l-1.6 -1.7l-1.6 1.7l-1.4 -1.4l1.7 -1.7z",
    "p": "M16 1.3l3.6 2.6l-1.4 4.2h-4.4l-1.4 -4.2z",
}
"""Markers of matplotlib as SVG paths in a 32 x 10 box."""


@dataclass(frozen=True)
class Look:
    """How one engine or reference is drawn; ``phase`` staggers the markers of coinciding curves."""

    label: str
    colour: str
    dash: tuple[float, ...]
    width: float
    marker: str = ""
    phase: float = 0.0

    @property
    def shape(self) -> str:
        """SVG path of the marker in a 32 x 10 box; empty for references."""
        return SHAPES.get(self.marker, "")


def engine_looks(names: dict[str, str]) -> dict[str, Look]:
    """Looks by engine id, given the engines' display names by id: those of one colour differ in dash and mark."""
    return {
        engine: Look(name, *numbered_look(k), (k % MOST_LOOKS + 0.5) / MOST_LOOKS)
        for k, (engine, name) in enumerate(names.items())
    }


def numbered_look(k: int) -> tuple[str, tuple[float, ...], float, str]:
    """Colour, dash, width and mark of the k-th of some lines; the first `MOST_LOOKS` are all different."""
    many = len(PALETTE)
    return PALETTE[k % many], DASHES[k // many % len(DASHES)], 1.3, MARKERS[(k + 3 * (k // many)) % len(MARKERS)]


MOST_LOOKS = len(PALETTE) * len(DASHES)
"""Looks that differ from one another."""


def reference_looks(labels: dict[str, str]) -> dict[str, Look]:
    """Looks of reference curves by label, given their truth kinds: wide and grey, drawn beneath the engines.

    Several of one kind differ in the length of their dashes.
    """
    looks: dict[str, Look] = {}
    for label, truth in labels.items():
        dash, width = REFERENCE_DASHES.get(truth, REFERENCE_DASHES["consensus"])
        alike = sum(labels[other] == truth for other in looks)
        looks[label] = Look(label, SOFT, tuple(length * (1.0 + 0.8 * alike) for length in dash), width)
    return looks


FEW = 7
"""Places on a logarithmic horizontal axis below which each has its own mark."""

GUIDE = "reference guide"
"""Key of lines that are no data: slopes and levels to compare with."""


@dataclass(frozen=True)
class Dots:
    """Points of one engine (``key`` is its legend key), joined by a line or not; ``names`` label single points, ``links`` are where
    they lead to, ``short`` is the name at the line's end where its look's is too long."""

    key: str
    look: Look
    x: tuple[float, ...]
    y: tuple[float, ...]
    joined: bool = True
    names: tuple[str, ...] = ()
    links: tuple[str, ...] = ()
    short: str = ""


@dataclass(frozen=True)
class PointChart:
    """A chart of points; ``guides`` are lines to compare with, as (label, x, y), labelled at their ends.

    ``limits``, (low, high) of either axis, replaces those that the points suggest. Few points have their own marks on a
    logarithmic horizontal axis, unless ``decades`` are asked for, as for what has been measured. A ``bare`` chart leaves the names
    of its lines to the legend. An ``equal`` one has the same scale on both axes, so that a circle is one; ``engine`` is whose it
    is, if its points do not report.
    """

    title: str
    x_label: str
    y_label: str
    dots: tuple[Dots, ...]
    guides: tuple[tuple[str, tuple[float, ...], tuple[float, ...]], ...] = ()
    x_log: bool = True
    y_log: bool = True
    limits: tuple[tuple[float, float], tuple[float, float]] | None = None
    decades: bool = False
    bare: bool = False
    equal: bool = False
    engine: str = ""

    @property
    def x_limits(self) -> tuple[float, float]:
        """Limits of the horizontal axis with some room."""
        if self.limits is not None:
            return self.limits[0]
        return _limits([x for d in self.dots for x in d.x], self.x_log, marked=False)

    @property
    def y_limits(self) -> tuple[float, float]:
        """Limits of the vertical axis with some room; what is to compare with is inside, as far as the horizontal axis goes."""
        if self.limits is not None:
            return self.limits[1]
        low, high = self.x_limits
        level = [
            y for _, xs, ys in self.guides for x, y in zip(xs, ys, strict=True) if low <= x <= high and not self.y_log
        ]
        return _limits([y for d in self.dots for y in d.y] + level, self.y_log)

    @property
    def marks(self) -> list[float] | None:
        """Marks of the horizontal axis; None where decades, or round numbers, do."""
        places = sorted({x for d in self.dots for x in d.x})
        low, high = self.x_limits
        if not self.x_log or len(places) >= FEW or (self.decades and _holds_decade(low, high)):
            return None
        return places

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
             "shape": d.look.shape, "line": d.joined, "guide": False, "x": d.x, "y": d.y,
             "names": d.names, "links": d.links, "short": d.short}
            for d in self.dots
        ]  # fmt: skip
        return {
            "kind": "points", "title": self.title, "x_label": self.x_label, "y_label": self.y_label, "unit": "",
            "points": guides + data, "xlog": self.x_log, "ylog": self.y_log, "limits": {"x": self.x_limits},
            "y": self.y_limits, "error": None, "marks": self.marks, "bare": self.bare, "equal": self.equal, "engine": self.engine,
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


def slopes(dots: list[Dots]) -> tuple[tuple[str, tuple[float, ...], tuple[float, ...]], ...]:
    """Lines of order 1 and 2 through the middle of the points."""
    sizes = sorted({x for d in dots for x in d.x})
    if len(sizes) < 2:
        return ()
    level = math.exp(sum(math.log(y) for d in dots for y in d.y) / sum(len(d.y) for d in dots))
    low, high = sizes[0], sizes[-1]
    return tuple(
        (f"order {order}", (low, high), (level * (low / high) ** (order / 2), level * (high / low) ** (order / 2)))
        for order in (1, 2)
    )


def _holds_decade(low: float, high: float) -> bool:
    """Whether a power of ten lies between two numbers."""
    return math.floor(math.log10(high)) >= math.ceil(math.log10(low))


def _limits(values: list[float], log: bool, *, marked: bool = True) -> tuple[float, float]:
    low, high = min(values), max(values)
    if log:
        room = max(1.3, (high / low) ** 0.08)
        low, high = low / room, high * room
        # Less than a decade and a half: a third of a decade more on each side, so that a mark of the axis lies inside.
        return (low / 2.2, high * 2.2) if marked and high / low < 30.0 else (low, high)
    room = 0.1 * (high - low) or 0.1 * abs(high) or 1.0
    return low - room, high + room


@dataclass(frozen=True)
class Image:
    """An image of a page: address from the report's folder, text alternative, caption, size in CSS pixels, address of its numbers."""

    src: str
    alt: str
    width: int
    height: int
    caption: str = ""
    data: str = ""


@dataclass(frozen=True)
class Chart:
    """An interactive chart: its description as JSON, text alternative, legend, and the picture of a figure of the source."""

    spec: str
    alt: str
    legend: Mapping[str, Look]
    image: Image | None = None


def on_page(chart: PointChart) -> Chart:
    """What a page holds of a chart of points."""
    return Chart(json.dumps(chart.spec(), allow_nan=False), chart.alt(), chart.looks)
