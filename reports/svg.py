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
_STYLE = re.compile(r' style="([^"]*)"')


def write_svg(figure: Any, path: Path) -> None:
    """Write a matplotlib figure.

    Coordinates are rounded to 0.1 pt, a tenth of a line's width; styles that matplotlib repeats at every tick and
    marker become classes. Together that makes the file a third as large.
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
    text = re.sub(r">\n+<", "><", text)
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
