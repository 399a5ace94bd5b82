"""The page of an audit: verdicts worst first, pictures of violations, each check's value beside its allowance over time."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ninedisk.reports import pages
from ninedisk.reports.drawing.charts import Dots, Look, PointChart, numbered_look, on_page
from ninedisk.reports.folder import fresh_folder

MARKER = ".ninedisk-audit"
SHADE = {"violated": "out3", "holds": "in0", "not decidable": "none"}
"""Colour class of each verdict; the word itself is beside it."""
SYMBOL = {"violated": "✗", "holds": "✓", "not decidable": "?"}
WIDTH, HEIGHT = 620.0, 360.0
"""Largest size of a picture [CSS pixels]."""
CURVES = {
    "Energy [J]": {"kinetic": "kinetic", "potential": "gravity", "springs": "normal springs"},
    "Momentum [N s]": {"px": "x", "py": "y", "pz": "z"},
    "Deepest overlap [m]": {"overlap": "overlap"},
}
"""Curves of what the disks have together: chart, column, name."""


def write_audit(record: Mapping[str, Any], out: Path) -> Path:
    """Write the page of an audit, one file that holds its style sheet and scripts, and the record beside it.

    Parameters
    ----------
    record : mapping
        What ``ninedisk audit --json`` writes.
    out : Path
        Folder, replaced as a whole.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    ReportError
        If the folder is a foreign one or cannot be written.
    """
    checks = record["checks"]
    shown = [{**check, "chart": on_page(chart) if (chart := _over_time(check)) else None} for check in checks]
    page = pages.environment().get_template("audit.html").render(
        record=record,
        checks=shown,
        counts={verdict: sum(check["verdict"] == verdict for check in checks) for verdict in SHADE},
        totals=[on_page(chart) for chart in _totals(record["totals"])],
        pictures={name: _picture(picture) for name, picture in record["pictures"].items()},
        shades_of=SHADE,
        symbols=SYMBOL,
        **pages.single_file(),
    )  # fmt: skip
    with fresh_folder(out, MARKER, "audit") as fresh:
        (fresh / "index.html").write_text(page, encoding="utf-8")
        (fresh / "audit.json").write_text(json.dumps(record, allow_nan=False), encoding="utf-8")
    return out / "index.html"


def _over_time(check: Mapping[str, Any]) -> PointChart | None:
    """Value and allowance of the worst of each instant; what is below a part in 10,000 of any allowance is there."""
    rows = [row for row in check["series"] if all(math.isfinite(each) for each in row)]
    positive = [each for _, value, allowed in rows for each in (value, allowed) if each > 0.0]
    if len(rows) < 3 or not positive or not any(value > 0.0 for _, value, _ in rows):
        return None
    floor = max(min(positive) / 3.0, 1e-4 * min((allowed for _, _, allowed in rows if allowed > 0.0), default=0.0))
    t = tuple(row[0] for row in rows)
    curves = (("value", 1), ("allowance", 2))
    dots = [
        Dots(name, _look(name, 1 if k == 1 else 0), t, tuple(max(row[k], floor) for row in rows)) for name, k in curves
    ]
    return PointChart(check["title"], "t [s]", f"[{check['unit']}]" if check["unit"] else "", tuple(dots), x_log=False)


def _look(name: str, k: int) -> Look:
    colour, dash, width, _ = numbered_look(k)
    return Look(name, colour, dash, width)


def _totals(rows: Sequence[Mapping[str, float]]) -> list[PointChart]:
    made = []
    t = tuple(row["t"] for row in rows)
    for title, columns in CURVES.items():
        reported = {column: name for column, name in columns.items() if any(row.get(column) for row in rows)}
        dots = [
            Dots(name, _look(name, k), t, tuple(row[column] for row in rows))
            for k, (column, name) in enumerate(reported.items())
        ]
        if title.startswith("Energy") and dots:
            sums = tuple(sum(row[column] for column in columns) for row in rows)
            dots.append(Dots("all of these", _look("all of these", len(dots)), t, sums))
        if dots:
            made.append(PointChart(title, "t [s]", title, tuple(dots), x_log=False, y_log=False))
    return made


def _flattened(picture: Mapping[str, Any]) -> tuple[Mapping[str, Any], str]:
    """A picture of space as one of the plane, seen along the axis in which the marked bodies differ least; nearest bodies last."""
    if len(picture["x"][0]) == 2:
        return picture, ""
    marked = set(picture["marked"])
    chosen = [place for place, each in zip(picture["x"], picture["id"], strict=True) if each in marked] or picture["x"]
    spread = [max(place[axis] for place in chosen) - min(place[axis] for place in chosen) for axis in range(3)]
    depth = min((1, 0, 2), key=lambda axis: spread[axis])
    a, b = (axis for axis in range(3) if axis != depth)
    middle = sum(place[depth] for place in chosen) / len(chosen)
    sign = -1.0 if depth == 1 else 1.0
    # Before the marked bodies nothing is drawn, or it would hide them.
    shown = [
        k
        for k, place in enumerate(picture["x"])
        if picture["id"][k] in marked or sign * (place[depth] - middle) <= picture["radius"][k]
    ]
    shown.sort(key=lambda k: (picture["id"][k] in marked, sign * picture["x"][k][depth]))
    walls = []
    for name, *numbers in picture["walls"]:
        point, normal = numbers[:3], numbers[3:]
        if abs(normal[depth]) < 1e-9:
            walls.append([name, point[a], point[b], normal[a], normal[b]])
    flat = {
        **picture,
        "x": [[picture["x"][k][a], picture["x"][k][b]] for k in shown],
        "radius": [picture["radius"][k] for k in shown],
        "id": [picture["id"][k] for k in shown],
        "walls": walls,
    }
    return flat, f"seen along {'xyz'[depth]}, {'xyz'[a]} to the right and {'xyz'[b]} up, without what is in front"


def _picture(picture: Mapping[str, Any]) -> dict[str, Any]:
    """Circles and lines in pixels, the marked bodies and some space around them in the middle."""
    picture, view = _flattened(picture)
    places, radii = picture["x"], picture["radius"]
    marked = set(picture["marked"])
    chosen = [k for k, each in enumerate(picture["id"]) if each in marked] or list(range(len(places)))
    biggest = max(radii)
    room = 8.0 * biggest if marked else 1.5 * biggest
    spans = []
    for axis in (0, 1):
        low, high = (min(places[k][axis] for k in chosen), max(places[k][axis] for k in chosen))
        all_low, all_high = (
            min(place[axis] for place in places) - biggest,
            max(place[axis] for place in places) + biggest,
        )
        spans.append((max(low - room, all_low - biggest), min(high + room, all_high + biggest)))
    (x0, x1), (y0, y1) = spans
    scale = min(WIDTH / (x1 - x0), HEIGHT / (y1 - y0))
    width, height = scale * (x1 - x0), scale * (y1 - y0)

    def at(x: float, y: float) -> tuple[float, float]:
        return round((x - x0) * scale, 2), round((y1 - y) * scale, 2)

    circles = []
    for place, radius, each in zip(places, radii, picture["id"], strict=True):
        x, y = at(*place)
        if -radius * scale <= x <= width + radius * scale and -radius * scale <= y <= height + radius * scale:
            circles.append({"x": x, "y": y, "r": round(radius * scale, 2), "id": each, "marked": each in marked})
    far = 2.0 * (x1 - x0 + y1 - y0)
    lines = []
    for name, px, py, nx, ny in picture["walls"]:
        foot = ((x0 + x1) / 2.0 - px) * -ny + ((y0 + y1) / 2.0 - py) * nx
        mx, my = px - ny * foot, py + nx * foot
        lines.append({"name": name, "a": at(mx - far * ny, my + far * nx), "b": at(mx + far * ny, my - far * nx)})
    return {
        "width": round(width, 1),
        "height": round(height, 1),
        "circles": circles,
        "lines": lines,
        "t": picture["t"],
        "step": picture["step"],
        "view": view,
    }
