"""Accuracy against speed: one point a variant, for engines whose physics passed."""

from __future__ import annotations

import math

from ninedisk.reports.convergence import CONTINUOUS
from ninedisk.reports.draw_points import Dots, PointChart, spread
from ninedisk.reports.model import CaseData, Panel
from ninedisk.reports.style import PALETTE, SOFT, Look
from ninedisk.reports.text import as_float

LEAST = 1e-17
"""Relative errors of exactly zero are drawn here: below round-off, on a log axis."""

Point = tuple[float, float, str]


def speed_points(case: CaseData) -> dict[str, list[Point]]:
    """By engine: seconds of stepping, largest relative error of any history against the continuous truth, variant.

    Timings are stored only where the run's physics checks pass.
    """
    errors: dict[tuple[str, str], float] = {}
    for row in case.measurements:
        error, scale = as_float(row["abs_error"]), as_float(row["scale"])
        if row["norm"] == "max" and row["truth"] in CONTINUOUS and scale > 0.0 and math.isfinite(error):
            key = row["variant"], row["engine"]
            errors[key] = max(errors.get(key, LEAST), error / scale)
    points: dict[str, list[Point]] = {}
    for cell in case.cells:
        seconds, largest = as_float(cell["advance_s"]), errors.get((cell["variant"], cell["engine"]))
        if seconds > 0.0 and math.isfinite(seconds) and largest is not None:
            points.setdefault(cell["engine"], []).append((seconds, largest, cell["variant"]))
    return points


def case_speed(case: CaseData, looks: dict[str, Look]) -> PointChart | None:
    """All engines on one case; None where nothing was timed."""
    dots = [_dots(engine, looks[engine], points) for engine, points in speed_points(case).items()]
    return _chart("Accuracy against speed", dots) if dots else None


def engine_speed(panel: Panel, engine: str) -> PointChart | None:
    """One engine on every case, a colour a case, the other engines in grey behind it; None where nothing was timed."""
    grey = Look("other engines", SOFT, (), 1.0, "o")
    own, others = [], []
    for k, case in enumerate(panel.cases.values()):
        look = Look(case.title, PALETTE[k % len(PALETTE)], (), 1.3, "os^DvPXp"[k % 8])
        for name, points in speed_points(case).items():
            told = [(x, y, f"{case.id} {variant}") for x, y, variant in points]
            if name == engine:
                own.append(_dots(f"case {case.id}", look, told))
            else:
                others += [(x, y, f"{panel.engines[name].name}, {case.id}") for x, y, _ in points]
    if not own:
        return None
    behind = [_dots("others", grey, others)] if others else []
    return _chart("Accuracy against speed", [*behind, *own])


def _dots(key: str, look: Look, points: list[Point]) -> Dots:
    x, y, names = zip(*spread(points), strict=True)
    return Dots(key, look, x, y, joined=False, names=names)


def _chart(title: str, dots: list[Dots]) -> PointChart:
    return PointChart(title, "stepping [s]", "largest relative error", tuple(dots))
