"""From the figures that a case declares, and its curves, to panels: which picture shows what, on common scales.

Histories; the error of each engine against the step, with the fitted order; accuracy against speed, one point a variant, for
engines whose physics passed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ninedisk.harness.results.figures import Figure, Plotted
from ninedisk.harness.results.schema import ROUND_OFF, Row
from ninedisk.reports.drawing.charts import (
    SOFT,
    Dots,
    Look,
    PointChart,
    engine_looks,
    numbered_look,
    reference_looks,
    slopes,
    spread,
)
from ninedisk.reports.drawing.draw import (
    HistoryPanel,
    Line,
    StackPanel,
    error_label,
    error_limits,
    round_off,
    value_limits,
)
from ninedisk.reports.panel.load import Curve
from ninedisk.reports.panel.model import STEPS, CaseData, Panel
from ninedisk.reports.panel.ranking import fitted_order
from ninedisk.reports.panel.text import as_float, parameter, parameters

MOST_GENERIC = 24
"""Groups of the generic figure on one page; further variants are in the tables only, and the page says so."""


@dataclass(frozen=True)
class Shown:
    """A panel with its text alternative, and what its interactive chart shows."""

    picture: HistoryPanel
    alt: str
    spec: dict[str, Any]


@dataclass
class Group:
    """Panels under one heading; ``columns`` of them stand side by side."""

    heading: str
    columns: int
    panels: list[Shown]
    zero: list[str] = field(default_factory=list)  # quantities that are zero in every engine and truth: not drawn


@dataclass
class FigureBlock:
    """A figure: what the case declares, its groups and the looks that its legend explains."""

    plan: Figure
    groups: list[Group] = field(default_factory=list)
    legend: dict[str, Look] = field(default_factory=dict)
    left_out: int = 0


@dataclass(frozen=True)
class Looks:
    """Looks of a case's page."""

    engines: dict[str, Look]
    references: dict[str, Look]


def looks_of(panel: Panel, case: CaseData) -> Looks:
    """Looks by engine id, the same on every page, and by reference label of the case."""
    labels = {c.label: c.truth for key, found in panel.stored.references.items() if key[0] == case.id for c in found}
    for key, curve in panel.stored.series.items():
        if key[0] == case.id and curve.truth:
            labels[f"best truth ({curve.truth})"] = curve.truth
    return Looks(
        engine_looks({engine.id: engine.name for engine in panel.engines.values()}),
        reference_looks(labels),
    )


def case_figures(panel: Panel, case: CaseData) -> list[FigureBlock]:
    """History figures of a case: those of the source, then whatever no plan takes."""
    builder = _Builder(panel, case)
    plotted = {key[1] for key in panel.stored.series if key[0] == case.id}
    variants = {name: params for name, params in case.variants.items() if name in plotted}
    taken: set[str] = set()
    blocks = []
    for plan in case.figures:
        chosen = {name: params for name, params in variants.items() if plan.matches(params)}
        if plan.kind == "history":
            taken |= set(chosen)
            blocks.append(builder.block(plan, chosen))
    rest = {name: params for name, params in variants.items() if name not in taken}
    if rest:
        plan = replace(GENERIC, title="Other variants") if any(block.groups for block in blocks) else GENERIC
        block = builder.block(plan, dict(list(rest.items())[:MOST_GENERIC]))
        block.left_out = max(0, len(rest) - MOST_GENERIC)
        blocks.append(block)
    return [block for block in blocks if block.groups]


def case_budgets(panel: Panel, case: CaseData) -> list[tuple[Figure, list[tuple[str, list[StackPanel]]]]]:
    """Figures of stacked quantities: under the heading of each variant one panel for each engine that reports them all.

    A quantity whose number in the plan is "-" is taken off beneath; one that is zero throughout is left out.
    """
    found = []
    for plan in (figure for figure in case.figures if figure.kind == "budget"):
        groups = []
        chosen = {name: params for name, params in case.variants.items() if plan.matches(params)}
        for variant, params in chosen.items():
            panels = []
            for engine in sorted(panel.engines):
                curves = [(q, panel.stored.series.get((case.id, variant, engine, q.name))) for q in plan.quantities]
                reported = [(quantity, curve) for quantity, curve in curves if curve is not None]
                if len(reported) < len(curves) or not all(np.isfinite(curve.value).all() for _, curve in reported):
                    continue
                size = max(_largest(curve.value) for _, curve in reported)
                shown = [(q, curve.value) for q, curve in reported if _largest(curve.value) > ROUND_OFF * size]
                base = -sum((value for q, value in shown if q.number == "-"), start=np.zeros_like(reported[0][1].t))
                bands = tuple((q.label, plan.quantities.index(q), value) for q, value in shown if q.number != "-")
                name = "; ".join(q.label for q, _ in shown if q.number == "-")
                panels.append(
                    StackPanel(
                        panel.engines[engine].name,
                        f"energy [{reported[0][1].unit}]",
                        reported[0][1].t,
                        base,
                        name,
                        bands,
                    )
                )
            if panels:
                groups.append((parameters(params, varying(chosen.values())), panels))
        if groups:
            found.append((plan, groups))
    return found


def varying(variants: Iterable[dict[str, Any]]) -> list[str]:
    """Parameters whose value is not the same everywhere."""
    values: dict[str, set[str]] = {}
    every = list(variants)
    for params in every:
        for name in params:
            values.setdefault(name, set())
    for name, seen in values.items():
        seen |= {repr(params.get(name)) for params in every}
    return [name for name, seen in values.items() if len(seen) > 1]


def tolerances(case: CaseData) -> dict[tuple[str, str, str, str], float]:
    """Tolerances of histories by variant, engine, quantity and truth."""
    return {
        (row["variant"], row["engine"], row["quantity"], row["truth"]): row["tolerance"]
        for row in case.measurements
        if row["norm"] == "max"
    }


class _Builder:
    def __init__(self, panel: Panel, case: CaseData) -> None:
        self.case = case
        self.series: dict[tuple[str, str], dict[str, Curve]] = {}
        for (case_id, variant, engine, quantity), curve in panel.stored.series.items():
            if case_id == case.id:
                self.series.setdefault((variant, quantity), {})[engine] = curve
        self.references = {key[1:]: curves for key, curves in panel.stored.references.items() if key[0] == case.id}
        self.looks = looks_of(panel, case)
        self.tolerance = tolerances(case)
        self.sizes: dict[str, float] = {}
        for engines in self.series.values():
            for curve in engines.values():
                # An engine that runs away is no measure of what the others call zero: the truth's size goes before its own.
                size = curve.scale or (_largest(curve.value[np.isfinite(curve.value)]) if not curve.truth else 0.0)
                self.sizes[curve.unit] = max(size, self.sizes.get(curve.unit, 0.0))

    def block(self, plan: Figure, variants: dict[str, dict[str, Any]]) -> FigureBlock:
        block = FigureBlock(plan)
        others = [name for name in varying(variants.values()) if name != plan.compare]
        groups: dict[str, dict[str, dict[str, Any]]] = {}
        for name, params in variants.items():
            groups.setdefault(parameters(params, others), {})[name] = params
        for heading, members in groups.items():
            rank = {_text(value): k for k, value in enumerate(plan.where.get(plan.compare, ()))}
            order = sorted(members, key=lambda name: rank.get(_text(members[name].get(plan.compare)), len(rank)))
            panels, zero = [], []
            for quantity in plan.quantities or self._every_quantity(order):
                if self._is_zero(quantity.name, order):
                    zero.append(quantity.label)
                else:
                    panels += self._row(
                        plan, quantity, [(name, members[name]) for name in order], heading, block.legend
                    )
            if panels or zero:
                block.groups.append(Group(heading, max(1, len(order)), panels, zero))
        block.legend = dict(sorted(block.legend.items(), key=lambda item: not item[0].startswith("reference ")))
        return block

    def _is_zero(self, quantity: str, variants: list[str]) -> bool:
        """Whether a quantity is round-off in every engine and truth, beside the largest one of its unit in the case."""
        held = [self.series.get((variant, quantity), {}) for variant in variants]
        curves = [curve for engines in held for curve in engines.values()]
        beside = [curve for variant in variants for curve in self.references.get((variant, quantity), [])]
        if not curves:
            return False
        size = max(_largest(curve.value, curve.expected) for curve in [*curves, *beside])
        return size <= ROUND_OFF * self.sizes.get(curves[0].unit, 0.0)

    def _every_quantity(self, variants: list[str]) -> list[Plotted]:
        names = {quantity: None for variant, quantity in self.series if variant in variants}
        return [Plotted(name, name) for name in names]

    def _row(
        self, plan: Figure, quantity: Plotted, variants: list[tuple[str, dict[str, Any]]], heading: str,
        legend: dict[str, Look],
    ) -> list[Shown]:  # fmt: skip
        held = [(name, params, self.series.get((name, quantity.name), {})) for name, params in variants]
        curves = [_window(curve, plan.last) for _, _, engines in held for curve in engines.values()]
        if not curves:
            return []
        errors = [curve.error for curve in curves]
        floor = round_off([curve.scale for curve in curves], errors)
        references = [
            _window(c, plan.last) for name, _, _ in held for c in self.references.get((name, quantity.name), [])
        ]
        truths = [c.value for c in references] + [c.expected for c in curves]
        limits = value_limits(truths, [curve.value for curve in curves])
        tolerances = [
            self.tolerance.get((name, engine, quantity.name, curve.truth), math.nan)
            for name, _, engines in held
            for engine, curve in engines.items()
        ]
        bounds = error_limits(errors, tolerances, floor)
        shown = []
        for name, params, engines in held:
            if not engines:
                continue
            column = f"{plan.compare} = {parameter(params.get(plan.compare))}" if plan.compare else ""
            beneath = self._references(plan, name, quantity, engines)
            lines = [self._line(plan, name, quantity, engine, curve) for engine, curve in sorted(engines.items())]
            legend.update({f"reference {line.look.label}": line.look for line in beneath})
            legend.update({engine: self.looks.engines[engine] for engine in sorted(engines)})
            unit = next(iter(engines.values())).unit
            title = ", ".join(part for part in (quantity.label, column) if part)
            numbered = f"{quantity.number}  {title}" if quantity.number else title
            picture = HistoryPanel(
                title=numbered,
                x_label="cycle" if plan.x == "cycle" else "time [s]",
                y_label=f"{quantity.name} [{unit or '-'}]",
                lines=tuple(lines),
                references=tuple(beneath),
                y_limits=limits,
                error_limits=bounds,
                floor=floor,
                note=" ".join(
                    reported
                    for reported in (
                        _outside(lines, limits, f" {unit}" if unit not in ("", "-", "1") else ""),
                        _against(engines, self.looks.engines) if bounds else "",
                    )
                    if reported
                ),
            )
            spec = {
                "kind": "history", "variant": name, "quantity": quantity.name, "x": plan.x, "last": plan.last,
                "references": any(c.label for c in self.references.get((name, quantity.name), [])), "unit": unit,
                "title": numbered, "x_label": picture.x_label, "y_label": picture.y_label,
                "error_label": error_label(picture.y_label), "y": limits, "error": bounds, "floor": floor, "note": picture.note,
            }  # fmt: skip
            shown.append(Shown(picture, _alt(picture, heading), spec))
        return shown

    def _line(self, plan: Figure, variant: str, quantity: Plotted, engine: str, whole: Curve) -> Line:
        curve = _window(whole, plan.last)
        return Line(
            look=self.looks.engines[engine],
            x=_axis(curve, plan),
            y=curve.value,
            error=curve.error if np.isfinite(curve.error).any() else None,
            tolerance=self.tolerance.get((variant, engine, quantity.name, curve.truth), math.nan),
        )

    def _references(self, plan: Figure, variant: str, quantity: Plotted, engines: dict[str, Curve]) -> list[Line]:
        """Stored reference curves; where there are none, the best truths that the engines were judged by."""
        stored = [_window(c, plan.last) for c in self.references.get((variant, quantity.name), [])]
        if stored:
            return [Line(self.looks.references[c.label], _axis(c, plan), c.value) for c in stored]
        best = {c.truth: _window(c, plan.last) for c in engines.values() if c.truth}
        return [
            Line(self.looks.references[f"best truth ({truth})"], _axis(c, plan), c.expected)
            for truth, c in best.items()
            if np.isfinite(c.expected).any()
        ]


def _largest(*values: Any) -> float:
    """Largest finite absolute value; infinite where something is not finite but NaN."""
    every = np.abs(np.concatenate(values))
    return float(every[~np.isnan(every)].max(initial=0.0))


def _outside(lines: Iterable[Line], limits: tuple[float, float], unit: str) -> str:
    """Which curves leave the picture, and how far; empty where none does."""
    low, high = limits
    far = []
    for line in lines:
        values = line.y[~np.isnan(line.y)]
        if len(values) and (values.min() < low or values.max() > high):
            worst = float(values[np.argmax(np.maximum(low - values, values - high))])
            far.append((max(low - worst, worst - high), f"{line.look.label} to {worst + 0.0:.3g}{unit}"))
    if not far:
        return ""
    far.sort(key=lambda each: -each[0])
    more = f" and {len(far) - 3} more" if len(far) > 3 else ""
    reported = ", ".join(words for _, words in far[:3])
    return f"Clipped: {len(far)} engine{'' if len(far) == 1 else 's'} leave{'s' if len(far) == 1 else ''} the picture, {reported}{more}."


def _against(engines: dict[str, Curve], looks: dict[str, Look]) -> str:
    """The truths that the strip of errors measures from, and whose."""
    by: dict[str, list[str]] = {}
    for engine, curve in engines.items():
        if np.isfinite(curve.expected).any():
            by.setdefault(curve.truth, []).append(looks[engine].label)
    scheme = (
        " Exact steps are those of an engine's own scheme: near to them is not near to the physics."
        if "exact-step" in by
        else ""
    )
    if len(by) == 1:
        return f"Strip: distance from the {next(iter(by))} truth.{scheme}"
    reported = [
        f"{truth} ({', '.join(names) if len(names) < 3 else f'{len(names)} engines'})"
        for truth, names in sorted(by.items(), key=lambda item: len(item[1]))
    ]
    return f"Strip: distance from each engine's truth: {'; '.join(reported)}.{scheme}" if reported else ""


def _window(curve: Curve, last: int | None) -> Curve:
    """The last ``last`` steps of a curve, counted from their beginning."""
    if last is None or not len(curve.step):
        return curve
    begin = float(curve.step.max()) - last
    keep = curve.step >= begin
    return Curve(
        curve.step[keep] - max(0.0, begin), curve.t[keep], curve.value[keep], curve.expected[keep],
        curve.unit, curve.truth, curve.label, curve.source,
    )  # fmt: skip


def _axis(curve: Curve, plan: Figure) -> Any:
    return curve.step if plan.x == "cycle" else curve.t


def _text(value: Any) -> str:
    """Parameter as text for matching the plan's order: numbers to three digits."""
    return f"{value:.3g}" if isinstance(value, int | float) and not isinstance(value, bool) else str(value)


def _alt(picture: HistoryPanel, heading: str) -> str:
    engines = ", ".join(line.look.label for line in picture.lines)
    worst = [(float(np.nanmax(line.error)), line.look.label) for line in picture.lines if line.error is not None]
    reported = f" Largest error {max(worst)[0]:.1e} ({max(worst)[1]})." if worst else " No truth to compare with."
    where = f" ({heading})" if heading else ""
    return f"{picture.title}{where}: {picture.y_label} over {picture.x_label}. Engines: {engines}.{reported}"


GENERIC = Figure(
    title="Every recorded quantity",
    shows="Each quantity over time, every engine overlaid.",
    allows="Where the engines part, and when: the lower axes show each engine's distance from the best truth.",
)


CONTINUOUS = ("analytic", "converged")
"""Truths of the continuous problem: the error against them is what shrinks with the step."""

ABSOLUTE = 1e-15
"""The same where the truth is zero; the cases' lengths and speeds are of order one."""


@dataclass(frozen=True)
class Order:
    """Fitted order of an engine: NaN where the errors are round-off; ``errors`` by step, smallest first."""

    engine: str
    order: float
    errors: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Convergence:
    """One quantity of the variants that differ in the step alone."""

    quantity: str
    unit: str
    truth: str
    heading: str
    step: str
    orders: tuple[Order, ...]
    chart: PointChart | None

    def order_of(self, engine: str) -> Order | None:
        """Fitted order of an engine."""
        return next((order for order in self.orders if order.engine == engine), None)


def convergences(case: CaseData, looks: dict[str, Look]) -> list[Convergence]:
    """Every history quantity with two or more step sizes, by group of otherwise equal variants."""
    found = []
    for (heading, step, quantity, truth), engines in _grouped(case, "max", CONTINUOUS).items():
        unit = next(iter(engines.values()))[0][1]["unit"]
        orders, dots = [], []
        for engine, rows in engines.items():
            errors = sorted(
                (size, as_float(row["abs_error"])) for size, row in rows if math.isfinite(as_float(row["abs_error"]))
            )
            scale = max(as_float(row["scale"]) for _, row in rows)
            floor = ROUND_OFF * scale if scale > 0.0 else ABSOLUTE
            signal = [(size, error) for size, error in errors if error > floor]
            order = fitted_order(*(list(part) for part in zip(*signal, strict=True))) if len(signal) > 1 else math.nan
            orders.append(Order(engine, order, tuple(errors)))
            if signal and len(errors) > 1:
                x, y = zip(*signal, strict=True)
                dots.append(Dots(engine, looks[engine], x, y))
        if all(len(order.errors) < 2 for order in orders):
            continue
        title = f"{quantity} against the {truth} truth"
        chart = (
            PointChart(title, _label(step), f"max |error| [{unit or '-'}]", tuple(dots), slopes(dots))
            if any(len(d.x) > 1 for d in dots)
            else None
        )
        found.append(Convergence(quantity, unit, truth, heading, step, tuple(orders), chart))
    return found


def values_against_step(case: CaseData, looks: dict[str, Look]) -> list[tuple[Any, list[PointChart]]]:
    """Numbers whose value, not error, distinguishes engines as the step shrinks, with the levels they are held against."""
    made = []
    for plan in case.figures:
        if plan.kind != "values":
            continue
        charts = []
        labels = {plotted.name: plotted.label for plotted in plan.quantities}
        for (heading, step, quantity, _), engines in _grouped(case, "scalar", None, tuple(labels)).items():
            dots = []
            for engine, rows in engines.items():
                held = dict(
                    sorted((size, as_float(r["value"])) for size, r in rows if math.isfinite(as_float(r["value"])))
                )
                if held:
                    dots.append(Dots(engine, looks[engine], tuple(held), tuple(held.values())))
            if any(len(d.x) > 1 for d in dots):
                span = min(d.x[0] for d in dots), max(d.x[-1] for d in dots)
                guides = tuple((label, span, (level, level)) for label, level in plan.levels)
                title = f"{labels[quantity]}{', ' if heading else ''}{heading}"
                charts.append(PointChart(title, _label(step), f"{quantity} [-]", tuple(dots), guides, y_log=False))
        if charts:
            made.append((plan, charts))
    return made


Grouped = dict[tuple[str, str, str, str], dict[str, list[tuple[float, Row]]]]


def _grouped(case: CaseData, norm: str, truths: tuple[str, ...] | None, only: tuple[str, ...] = ()) -> Grouped:
    """Rows by (other parameters, step parameter, quantity, truth) and engine, with their step sizes.

    Without ``truths`` the rows of different truths are one: their value is the same. A group keeps at least two sizes.
    """
    held: dict[tuple[str, str, str, str], dict[str, list[tuple[float, Row]]]] = {}
    groups: dict[str, dict[str, Any]] = {}
    for row in case.measurements:
        params = case.variants.get(row["variant"], {})
        step = next((name for name in STEPS if isinstance(params.get(name), int | float)), None)
        skip = row["norm"] != norm or (truths is not None and row["truth"] not in truths)
        if step is None or skip or (only and row["quantity"] not in only):
            continue
        others = {name: value for name, value in params.items() if name != step}
        group = repr(sorted(others.items()))
        groups[group] = others
        key = group, step, row["quantity"], row["truth"] if truths else ""
        held.setdefault(key, {}).setdefault(row["engine"], []).append((float(params[step]), row))
    kept = {
        key: engines
        for key, engines in held.items()
        if len({size for rows in engines.values() for size, _ in rows}) > 1
    }
    reported = varying(groups[group] for group in dict.fromkeys(key[0] for key in kept))
    return {(parameters(groups[key[0]], reported), *key[1:]): engines for key, engines in kept.items()}


def _label(step: str) -> str:
    return {"dt": "dt [s]", "increment": "increment [m]"}[step]


LEAST = 1e-17
"""Relative errors of exactly zero are drawn here: below round-off, on a log axis."""

Point = tuple[float, float, str]


def speed_points(case: CaseData) -> dict[str, list[Point]]:
    """By engine: seconds of stepping, largest relative error of a headline, variant.

    Timings are stored only where the run's physics checks pass. A headline's error is relative to a scale that the case states: a
    reference that is zero makes it no larger.
    """
    errors: dict[tuple[str, str], float] = {}
    for row in case.headlines:
        error = as_float(row["rel_error"])
        if math.isfinite(error):
            key = row["variant"], row["engine"]
            errors[key] = max(errors.get(key, LEAST), error)
    points: dict[str, list[Point]] = {}
    for cell in case.cells:
        seconds, largest = as_float(cell["advance_s"]), errors.get((cell["variant"], cell["engine"]))
        if seconds > 0.0 and math.isfinite(seconds) and largest is not None:
            points.setdefault(cell["engine"], []).append((seconds, largest, cell["variant"]))
    return points


def case_speed(case: CaseData, looks: dict[str, Look]) -> PointChart | None:
    """All engines on one case; None where nothing was timed."""
    dots = [_dots(engine, looks[engine], points) for engine, points in speed_points(case).items()]
    return _chart(dots) if dots else None


def engine_speed(panel: Panel, engine: str) -> PointChart | None:
    """One engine on every case, a colour a case, the other engines in grey behind it; None where nothing was timed."""
    grey = Look("other engines", SOFT, (), 1.0, "o")
    own, others = [], []
    for k, case in enumerate(panel.cases.values()):
        look = Look(case.title, *numbered_look(k))
        for name, points in speed_points(case).items():
            reported = [(x, y, f"{case.id} {variant}") for x, y, variant in points]
            if name == engine:
                own.append(_dots(f"case {case.id}", look, reported))
            else:
                others += [(x, y, f"{panel.engines[name].name}, {case.id}") for x, y, _ in points]
    if not own:
        return None
    behind = [_dots("others", grey, others)] if others else []
    return _chart([*behind, *own])


def _dots(key: str, look: Look, points: list[Point]) -> Dots:
    x, y, names = zip(*spread(points), strict=True)
    return Dots(key, look, x, y, joined=False, names=names)


def _chart(dots: list[Dots]) -> PointChart:
    """Bare: names beside many points would cover some."""
    return PointChart(
        "Accuracy against speed", "stepping [s]", "largest relative error of a headline", tuple(dots), bare=True
    )
