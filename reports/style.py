"""Looks of the figures: one colour, dash and marker for each engine, the same in the SVG and in the HTML legend.

Figures to SVG files: small, the same bytes every time, readable on light and dark pages.
"""

from __future__ import annotations

import io
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

INK = "#24292f"
"""Colour of text and axes; `ninedisk.reports.style` turns it light on dark pages."""

SOFT = "#8a9099"
"""Colour of grids and hatches, readable on white and on black."""

PALETTE = (
    "#1f77d0", "#e0701a", "#1a9a6a", "#c44e9a", "#8a63d2", "#a8871a", "#d64545", "#2aa7b8", "#9c6a3c", "#6f8f2a",
    "#5a62c9", "#b8456b", "#3f8a8a",
)  # fmt: skip
DASHES = ((), (7.0, 2.5), (2.0, 2.0), (7.0, 2.0, 2.0, 2.0), (11.0, 3.0), (4.0, 1.5), (1.0, 2.5), (9.0, 2.0, 1.0, 2.0))
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
    """Looks by engine id, given the engines' display names by id."""
    many = len(PALETTE)
    return {
        engine: Look(
            name,
            PALETTE[k % many],
            DASHES[(k + k // 8) % 8],
            1.3,
            MARKERS[(k + k // many) % 8],
            (k % many + 0.5) / many,
        )
        for k, (engine, name) in enumerate(names.items())
    }


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


def rc_params() -> Any:
    """Settings of matplotlib: transparent, text as text, no mathematics in labels, and the same bytes every time."""
    return {
        "font.family": "DejaVu Sans",
        "font.size": 8.5,
        "axes.titlesize": 9.0,
        "axes.titley": 1.0,
        "axes.titlelocation": "left",
        "axes.edgecolor": INK,
        "axes.labelcolor": INK,
        "axes.titlecolor": INK,
        "axes.facecolor": "none",
        "axes.linewidth": 0.7,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.grid": True,
        "axes.formatter.use_mathtext": False,
        "axes.formatter.useoffset": False,
        "axes.formatter.limits": (-3, 4),
        "axes.unicode_minus": True,
        "grid.color": SOFT,
        "grid.alpha": 0.25,
        "grid.linewidth": 0.6,
        "xtick.color": INK,
        "ytick.color": INK,
        "text.color": INK,
        "text.parse_math": False,
        "figure.facecolor": "none",
        "savefig.facecolor": "none",
        "svg.fonttype": "none",
        "svg.hashsalt": "ninedisk",
        "path.simplify": True,
        "path.simplify_threshold": 0.15,
    }


DARK = "#d7dce2"
"""What the ink becomes where the reader prefers a dark page."""

_NUMBER = re.compile(r"-?\d+\.\d{2,}")
_ATTRIBUTE = re.compile(r'( (?:d|x|y|width|height|points)=")([^"]*)(")')
_POLYLINE = re.compile(r'\bd="((?:M ?-?[\d.]+ -?[\d.]+(?:L ?-?[\d.]+ -?[\d.]+)+)+)"')
_PAIR = re.compile(r"(-?[\d.]+) (-?[\d.]+)")
STRAIGHT = 0.6
"""Distance from a straight line, in tenths of a point, below which a curve's point is left out: no pixel moves."""

_STYLE = re.compile(r' style="([^"]*)"')


def write_svg(figure: Any, path: Path) -> None:
    """Write a matplotlib figure.

    Coordinates are rounded to 0.1 pt, a tenth of a line's width, and points of a curve that lie on the line through
    their neighbours to that precision are left out; styles that matplotlib repeats at every tick and marker become
    classes. Together that makes the file a fifth as large.
    """
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = _ATTRIBUTE.sub(lambda m: m[1] + _NUMBER.sub(_short, m[2]) + m[3], text)
    text = re.sub(r"'DejaVu Sans'(, sans-serif)?", "system-ui, sans-serif", text)
    text = re.sub(r'<g id="[^"]*"', "<g", text)
    text = re.sub(r"\n\s*", "\n", text)
    text = re.sub(r" ?\n([LMCQz\"])", r"\1", text)
    text = _POLYLINE.sub(lambda m: f'd="{"".join(map(_shortened, re.split("(?=M)", m[1])))}"', text)
    text = re.sub(r">\n+<", "><", text)
    text = _short_ids(text)
    path.write_text(_with_classes(text), encoding="utf-8")


def _with_classes(text: str) -> str:
    """Replace style attributes by classes; those that use the ink get a second rule for dark pages."""
    names: dict[str, str] = {}
    text = _STYLE.sub(lambda m: f' class="{names.setdefault(m[1], f"s{len(names)}")}"', text)
    rules = "".join(f".{name}{{{style}}}" for style, name in names.items())
    dark = "".join(
        f".{name}{{{inked}}}"
        for style, name in names.items()
        if (inked := "".join(f"{what}:{DARK};" for what in ("fill", "stroke") if f"{what}: {INK}" in style))
    )
    head = text.index(">") + 1
    sheet = f"<style>{rules}@media screen and (prefers-color-scheme: dark){{{dark}}}</style>"
    return text[:head] + sheet + text[head:]


def _short(match: re.Match[str]) -> str:
    return f"{float(match[0]):.1f}".rstrip("0").rstrip(".") or "0"


def _short_ids(text: str) -> str:
    """Replace matplotlib's ids, which every marker repeats, by short ones."""
    names = {name: f"i{k}" for k, name in enumerate(dict.fromkeys(re.findall(r' id="([^"]+)"', text)))}
    return re.sub(r'(id="|href="#|url\(#)([^")]+)', lambda m: m[1] + names.get(m[2], m[2]), text)


def _shortened(line: str) -> str:
    """A polyline with absolute coordinates as one with relative ones, without the points that lie on their neighbours' line."""
    points = [(round(10 * float(x)), round(10 * float(y))) for x, y in _PAIR.findall(line)]
    if not points:
        return ""
    kept = _corners(points)
    (x, y), steps = kept[0], []
    for u, v in kept[1:]:
        steps.append(f"{_tenths(u - x)} {_tenths(v - y)}".replace(" -", "-"))
        x, y = u, v
    return f"M{_tenths(kept[0][0])} {_tenths(kept[0][1])}" + (f"l{' '.join(steps)}".replace(" -", "-") if steps else "")


def _corners(points: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Ramer-Douglas-Peucker with the tolerance `STRAIGHT`: no left-out point is farther from the line that stays."""
    keep = {0, len(points) - 1}
    stack = [(0, len(points) - 1)]
    while stack:
        a, b = stack.pop()
        (ax, ay), (bx, by) = points[a], points[b]
        dx, dy = bx - ax, by - ay
        length = dx * dx + dy * dy
        worst, far = STRAIGHT * STRAIGHT, -1
        for k in range(a + 1, b):
            px, py = points[k][0] - ax, points[k][1] - ay
            along = min(1.0, max(0.0, (px * dx + py * dy) / length)) if length else 0.0
            apart = (px - along * dx) ** 2 + (py - along * dy) ** 2
            if apart > worst:
                worst, far = apart, k
        if far > 0:
            keep.add(far)
            stack += [(a, far), (far, b)]
    return [points[k] for k in sorted(keep)]


def _tenths(value: int) -> str:
    return f"{value / 10:g}"
