"""Convergence: the error of each engine against the step, with the fitted order."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from ninedisk.reports.draw_points import Dots, PointChart, fitted_order
from ninedisk.reports.figures import varying
from ninedisk.reports.load import Row
from ninedisk.reports.model import CaseData
from ninedisk.reports.plans import VALUE_PLANS
from ninedisk.reports.style import Look
from ninedisk.reports.text import as_float, parameters

STEPS = ("dt", "increment")
"""Parameters of cases that are step sizes."""

CONTINUOUS = ("analytic", "converged")
"""Truths of the continuous problem: the error against them is what shrinks with the step."""

ROUND_OFF = 1e-12
"""Errors below this share of the quantity are round-off of some hundred steps: they have no order."""

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
    """Numbers whose value, not error, tells engines apart as the step shrinks, with the levels they are held against."""
    made = []
    for plan in VALUE_PLANS.get(case.id, ()):
        charts = []
        for (heading, step, quantity, _), engines in _grouped(case, "scalar", None, plan.quantity).items():
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
                title = f"{plan.label}{', ' if heading else ''}{heading}"
                charts.append(PointChart(title, _label(step), f"{quantity} [-]", tuple(dots), guides, y_log=False))
        if charts:
            made.append((plan, charts))
    return made


Grouped = dict[tuple[str, str, str, str], dict[str, list[tuple[float, Row]]]]


def _grouped(case: CaseData, norm: str, truths: tuple[str, ...] | None, only: str = "") -> Grouped:
    """Rows by (other parameters, step parameter, quantity, truth) and engine, with their step sizes.

    Without ``truths`` the rows of different truths are one: their value is the same. A group keeps at least two sizes.
    """
    held: dict[tuple[str, str, str, str], dict[str, list[tuple[float, Row]]]] = {}
    groups: dict[str, dict[str, Any]] = {}
    for row in case.measurements:
        params = case.variants.get(row["variant"], {})
        step = next((name for name in STEPS if isinstance(params.get(name), int | float)), None)
        skip = row["norm"] != norm or (truths is not None and row["truth"] not in truths)
        if step is None or skip or (only and row["quantity"] != only):
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
    told = varying(groups[group] for group in dict.fromkeys(key[0] for key in kept))
    return {(parameters(groups[key[0]], told), *key[1:]): engines for key, engines in kept.items()}


def _label(step: str) -> str:
    return {"dt": "dt [s]", "increment": "increment [m]"}[step]


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
