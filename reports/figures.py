"""From plans and curves to panels: which picture shows what, with common scales where values are compared."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ninedisk.reports.curves import Curve
from ninedisk.reports.draw import HistoryPanel, Line, error_label, error_limits, round_off, value_limits
from ninedisk.reports.model import CaseData, Panel
from ninedisk.reports.plans import GENERIC, PLANS, FigurePlan, Plotted
from ninedisk.reports.style import Look, engine_looks, reference_looks
from ninedisk.reports.text import parameter, parameters

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


@dataclass
class FigureBlock:
    """A figure of the source: its plan, its groups and the looks that its legend explains."""

    plan: FigurePlan
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
    for plan in PLANS.get(case.id, ()):
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

    def block(self, plan: FigurePlan, variants: dict[str, dict[str, Any]]) -> FigureBlock:
        block = FigureBlock(plan)
        others = [name for name in varying(variants.values()) if name != plan.compare]
        groups: dict[str, dict[str, dict[str, Any]]] = {}
        for name, params in variants.items():
            groups.setdefault(parameters(params, others), {})[name] = params
        for heading, members in groups.items():
            rank = {_text(value): k for k, value in enumerate(plan.where.get(plan.compare, ()))}
            order = sorted(members, key=lambda name: rank.get(_text(members[name].get(plan.compare)), len(rank)))
            panels = []
            for quantity in plan.quantities or self._every_quantity(order):
                panels += self._row(plan, quantity, [(name, members[name]) for name in order], heading, block.legend)
            if panels:
                block.groups.append(Group(heading, max(1, len(order)), panels))
        return block

    def _every_quantity(self, variants: list[str]) -> list[Plotted]:
        names = {quantity: None for variant, quantity in self.series if variant in variants}
        return [Plotted(name, name) for name in names]

    def _row(
        self, plan: FigurePlan, quantity: Plotted, variants: list[tuple[str, dict[str, Any]]], heading: str,
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
            )
            spec = {
                "kind": "history", "variant": name, "quantity": quantity.name, "x": plan.x, "last": plan.last,
                "references": any(c.label for c in self.references.get((name, quantity.name), [])), "unit": unit,
                "title": numbered, "x_label": picture.x_label, "y_label": picture.y_label,
                "error_label": error_label(picture.y_label), "y": limits, "error": bounds, "floor": floor,
            }  # fmt: skip
            shown.append(Shown(picture, _alt(picture, heading), spec))
        return shown

    def _line(self, plan: FigurePlan, variant: str, quantity: Plotted, engine: str, whole: Curve) -> Line:
        curve = _window(whole, plan.last)
        return Line(
            look=self.looks.engines[engine],
            x=_axis(curve, plan),
            y=curve.value,
            error=curve.error if np.isfinite(curve.error).any() else None,
            tolerance=self.tolerance.get((variant, engine, quantity.name, curve.truth), math.nan),
        )

    def _references(self, plan: FigurePlan, variant: str, quantity: Plotted, engines: dict[str, Curve]) -> list[Line]:
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


def _axis(curve: Curve, plan: FigurePlan) -> Any:
    return curve.step if plan.x == "cycle" else curve.t


def _text(value: Any) -> str:
    """Parameter as text for matching the plan's order: numbers to three digits."""
    return f"{value:.3g}" if isinstance(value, int | float) and not isinstance(value, bool) else str(value)


def _alt(picture: HistoryPanel, heading: str) -> str:
    engines = ", ".join(line.look.label for line in picture.lines)
    worst = [(float(np.nanmax(line.error)), line.look.label) for line in picture.lines if line.error is not None]
    told = f" Largest error {max(worst)[0]:.1e} ({max(worst)[1]})." if worst else " No truth to compare with."
    where = f" ({heading})" if heading else ""
    return f"{picture.title}{where}: {picture.y_label} over {picture.x_label}. Engines: {engines}.{told}"
