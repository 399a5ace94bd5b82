"""Figures to SVG files: small, the same bytes every time, readable on light and dark pages."""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import Any

from ninedisk.reports.style import INK

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
