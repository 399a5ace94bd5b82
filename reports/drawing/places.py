"""Numbers of all variants over the places that a case gives them: one chart for all engines, or one an engine on common axes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any
from urllib.parse import quote

import numpy as np

from ninedisk.harness.results.figures import Figure, Plotted
from ninedisk.harness.results.schema import Row
from ninedisk.reports.drawing.charts import MARKERS, SOFT, Dots, Look, PointChart, numbered_look
from ninedisk.reports.drawing.figures import LEAST, varying
from ninedisk.reports.panel.load import Series
from ninedisk.reports.panel.model import CaseData
from ninedisk.reports.panel.text import as_float, parameters

Cell = tuple[str, str]
"""Engine and variant."""

READ = "read off"
"""Beginning of the keys of what was read off a figure."""

MANY = 50
"""Points of one engine that are samples rather than places."""


@dataclass(frozen=True)
class PlaceFigure:
    """Charts of one plan, with what their legend explains."""

    plan: Figure
    legend: dict[str, Look]
    charts: list[PointChart]


def place_figures(case: CaseData, looks: dict[str, Look], series: Series) -> list[PlaceFigure]:
    """The figures of kind ``places`` that a case declares, where anything of them was measured or sampled."""
    found = []
    for plan in case.figures:
        if plan.kind != "places":
            continue
        rows = _rows(case, plan) or _samples(case, plan, series)
        variants = [name for name, params in case.variants.items() if any(cell[1] == name for cell in rows)]
        apart = varying(case.variants[name] for name in variants)
        reported = {name: parameters(case.variants[name], apart) or name for name in variants}
        charts = []
        for label in dict.fromkeys(plotted.label for plotted in plan.quantities):
            quantities = [plotted for plotted in plan.quantities if plotted.label == label]
            charts += (_separate_series if plan.apart else _joined_series)(
                plan, label, quantities, rows, looks, reported, case.variants
            )
        if charts:
            legend = {key: looks.get(key, look) for chart in charts for key, look in chart.looks.items()}
            legend = dict(sorted(legend.items(), key=lambda each: each[0].startswith(READ)))
            found.append(PlaceFigure(plan, legend, charts))
    return found


def cell_anchor(engine: str, variant: str) -> str:
    """Id of a cell on its case's page."""
    return f"cell-{engine}-{variant}"


def _rows(case: CaseData, plan: Figure) -> dict[Cell, dict[str, Row]]:
    """Rows of the plan's quantities and of their places, by cell; of several truths the first, whose value is the same."""
    wanted = {name for plotted in plan.quantities for name in (plotted.name, plotted.at)}
    found: dict[Cell, dict[str, Row]] = {}
    for row in case.measurements:
        if (
            row["norm"] == "scalar"
            and row["quantity"] in wanted
            and row["variant"] in case.variants
            and plan.matches(case.variants[row["variant"]])
        ):
            found.setdefault((row["engine"], row["variant"]), {}).setdefault(row["quantity"], row)
    return found


def _samples(case: CaseData, plan: Figure, series: Series) -> dict[Cell, dict[str, Row]]:
    """Curves of the plan's quantities and of their places as rows whose values are arrays, by cell."""
    found: dict[Cell, dict[str, Row]] = {}
    for plotted in plan.quantities:
        for (case_id, variant, engine, quantity), curve in series.items():
            at = series.get((case_id, variant, engine, plotted.at))
            wanted = case_id == case.id and quantity == plotted.name and variant in case.variants
            if wanted and at is not None and plan.matches(case.variants[variant]):
                row = {"value": curve.value, "expected": curve.expected, "source": curve.truth}
                found.setdefault((engine, variant), {}).update({quantity: row, plotted.at: {"value": at.value}})
    return found


@dataclass(frozen=True)
class _Point:
    x: float
    y: float
    expected: float
    source: str
    off: float
    engine: str
    variant: str


def _points(
    plan: Figure, quantities: list[Plotted], rows: dict[Cell, dict[str, Row]], variants: dict[str, dict[str, Any]]
) -> list[_Point]:
    """Points in the order of their places; what a logarithmic axis cannot hold is at its lower end.

    Quantities whose places were measured, each its own, are a way: they keep the order in which they are declared.
    """
    found = []
    for (engine, variant), held in rows.items():
        for plotted in quantities:
            at = held[plotted.at]["value"] if plotted.at in held else variants[variant].get(plotted.at, plotted.at)
            row = held.get(plotted.name)
            if row is None:
                continue
            places = at if isinstance(at, np.ndarray) else [_number(at)]
            for x, y, truth in zip(places, np.atleast_1d(row["value"]), np.atleast_1d(row["expected"]), strict=True):
                x, y, truth = float(x), as_float(y), as_float(truth)
                if not (math.isfinite(x) and math.isfinite(y)):
                    continue
                off = abs(y - truth)
                if "y" in plan.log:
                    y, level = max(abs(y), LEAST), max(abs(truth), LEAST)
                    off, truth = abs(math.log(y / level)), level if truth else math.nan
                if "x" not in plan.log or x > 0.0:
                    found.append(_Point(x, y, truth, str(row["source"]), off, engine, variant))
    if _is_path(quantities) and any(plotted.at in held for plotted in quantities for held in rows.values()):
        return found
    return sorted(found, key=lambda point: point.x)


def _is_path(quantities: Sequence[Plotted]) -> bool:
    """Whether quantities have places that are quantities, each its own: points of a curve in the plane."""
    return len({plotted.at for plotted in quantities}) > 1 and all(
        math.isnan(_number(plotted.at)) for plotted in quantities
    )


def _number(given: Any) -> float:
    try:
        return float(given)
    except (TypeError, ValueError):
        return math.nan


def _dots(key: str, look: Look, points: list[_Point], names: list[str], short: str = "") -> Dots:
    links = tuple(f"#{quote(cell_anchor(point.engine, point.variant))}" for point in points)
    return Dots(
        key, look, tuple(p.x for p in points), tuple(p.y for p in points), names=tuple(names), links=links, short=short
    )


Guide = tuple[str, tuple[float, ...], tuple[float, ...]]


def _truths(points: list[_Point]) -> tuple[Guide, ...]:
    """Curves of the truths that the points were held against: one a source, or one a variant where these differ at one place.

    A truth of one place alone is no curve; those that end together share their name.
    """
    held: dict[str, dict[str, dict[float, float]]] = {}
    for point in points:
        if math.isfinite(point.expected):
            held.setdefault(point.source, {}).setdefault(point.variant, {})[point.x] = point.expected
    found: dict[tuple[tuple[float, ...], tuple[float, ...]], str] = {}
    for source, variants in held.items():
        joined: dict[float, set[str]] = {}
        for curve in variants.values():
            for x, y in curve.items():
                joined.setdefault(x, set()).add(f"{y:.6g}")
        alike = all(len(values) == 1 for values in joined.values())
        whole = {x: y for curve in variants.values() for x, y in curve.items()}
        for curve in [whole] if alike else variants.values():
            if len(curve) > 1:
                places = tuple(sorted(curve))
                found.setdefault((places, tuple(curve[place] for place in places)), source.partition(":")[0])
    ends: dict[str, list[str]] = {}
    for (xs, ys), name in found.items():
        ends.setdefault(f"{xs[-1]:.3g} {ys[-1]:.3g}", []).append(name)
    named = {names[0]: f"truth: {', '.join(dict.fromkeys(names))}" for names in ends.values()}
    return tuple((named.pop(name, ""), xs, ys) for (xs, ys), name in found.items())


def _joined_series(
    plan: Figure, label: str, quantities: list[Plotted], rows: dict[Cell, dict[str, Row]], looks: dict[str, Look],
    reported: dict[str, str], variants: dict[str, dict[str, Any]],
) -> list[PointChart]:  # fmt: skip
    """One chart for all engines; one whose cells differ in the plan's ``compare`` has a line for each value."""
    points = _points(plan, quantities, rows, variants)
    dots = []
    for engine in dict.fromkeys(point.engine for point in points):
        lines: dict[str, list[_Point]] = {}
        for point in points:
            if point.engine == engine:
                lines.setdefault(
                    parameters(variants[point.variant], [plan.compare] if plan.compare else []), []
                ).append(point)
        for value, mine in lines.items():
            own, short = looks[engine], ""
            if len(lines) > 1:
                own, short = replace(own, label=f"{own.label}, {value}"), value.rpartition(" ")[2]
            dots.append(_dots(engine, own, mine, [reported[point.variant] for point in mine], short))
    curves = [curve for curve in plan.curves if curve.label == label]
    truths = tuple((curve.name, curve.x, curve.y) for curve in curves if not curve.reader)
    if truths:  # they lead from place to place: of few places marks alone, of many samples a line alone
        many = any(len(each.x) > MANY for each in dots)
        dots = [
            replace(each, joined=many, look=replace(each.look, marker="" if many else each.look.marker))
            for each in dots
        ]
    read = list(dict.fromkeys((curve.name, curve.reader) for curve in plan.curves if curve.reader))
    for curve in (each for each in curves if each.reader) if dots else ():
        k = read.index((curve.name, curve.reader))
        look = Look(f"{curve.name}, read by {curve.reader}", SOFT, (), 1.0, MARKERS[k % len(MARKERS)])
        dots.insert(0, Dots(f"{READ} {k}", look, curve.x, curve.y, joined=False))  # beneath the engines
    return [_chart(plan, label, label, dots, truths or _truths(points))] if dots else []


def _separate_series(
    plan: Figure, label: str, quantities: list[Plotted], rows: dict[Cell, dict[str, Row]], looks: dict[str, Look],
    reported: dict[str, str], variants: dict[str, dict[str, Any]],
) -> list[PointChart]:  # fmt: skip
    """One chart an engine on the axes that hold them all, the one whose points are drawn farthest from their truths first."""
    points = _points(plan, quantities, rows, variants)
    lines = {name: Look(words, *numbered_look(k)) for k, (name, words) in enumerate(reported.items())}
    drawn = []
    for engine in dict.fromkeys(point.engine for point in points):
        mine = [point for point in points if point.engine == engine]
        dots = [
            _dots(f"variant {name}", lines[name], held, [reported[name]] * len(held))
            for name in reported
            if (held := [point for point in mine if point.variant == name])
        ]
        truths = tuple(("", x, y) for _, x, y in _truths(mine))  # lines of many engines hide them: no room for names
        drawn.append((max(point.off for point in mine), engine, dots, truths))
    whole = _chart(plan, label, "", [each for _, _, dots, _ in drawn for each in dots], ()) if drawn else None
    drawn.sort(key=lambda each: (-each[0], each[1]))
    return [
        replace(_chart(plan, label, looks[engine].label, dots, truths, (whole.x_limits, whole.y_limits)), engine=engine)
        for _, engine, dots, truths in drawn
        if whole is not None
    ]


def _chart(
    plan: Figure, label: str, title: str, dots: list[Dots], guides: tuple[Guide, ...],
    limits: tuple[tuple[float, float], tuple[float, float]] | None = None,
) -> PointChart:  # fmt: skip
    return PointChart(
        title, plan.at_label, label, tuple(dots), guides, x_log="x" in plan.log, y_log="y" in plan.log, limits=limits,
        decades=True, bare=plan.apart or bool(plan.curves), equal=plan.apart and _is_path(plan.quantities),
    )  # fmt: skip
