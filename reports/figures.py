"""From plans and curves to panels: which picture shows what, with common scales where values are compared.

Plans of the figures, as data: variants and quantities that a figure shows, and what it lets one conclude.

Convergence: the error of each engine against the step, with the fitted order.

Accuracy against speed: one point a variant, for engines whose physics passed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from ninedisk.reports.charts import (
    PALETTE,
    SOFT,
    Dots,
    Look,
    PointChart,
    engine_looks,
    fitted_order,
    reference_looks,
    slopes,
    spread,
)
from ninedisk.reports.draw import HistoryPanel, Line, error_label, error_limits, round_off, value_limits
from ninedisk.reports.load import Curve, Row
from ninedisk.reports.model import CaseData, Panel
from ninedisk.reports.text import as_float, parameter, parameters

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


Allowed = float | str | bool | None
"""A value of a parameter that a figure admits; None also stands for a parameter that the case does not have."""


@dataclass(frozen=True)
class Plotted:
    """A series quantity of a figure: its name in the records, axis label and the number of its figure in the source."""

    name: str
    label: str
    number: str = ""


@dataclass(frozen=True, kw_only=True)
class FigurePlan:
    """One figure of the source.

    Parameters
    ----------
    number, title : str
        Figure number in the source ("" for a figure of our own) and heading.
    quantities : tuple of Plotted
        Panels; empty means every series quantity of the variants.
    where : mapping from parameter to allowed values
        Variants that the figure shows. Numbers match to 1e-3 relative (2/3 is stored in full), words exactly.
    compare : str
        Parameter whose values stand side by side with a common scale; the other parameters that vary split the figure
        into titled groups.
    x : {"cycle", "time"}
        Horizontal axis.
    last : int or None
        Show the last so many steps, counted from their beginning.
    kind : {"history", "configuration"}
        Histories, or the stored configurations.
    shows, allows : str
        What is to be seen, and which conclusion it allows.
    """

    number: str
    title: str
    quantities: tuple[Plotted, ...] = ()
    where: Mapping[str, tuple[Allowed, ...]] = field(default_factory=dict)
    compare: str = ""
    x: Literal["cycle", "time"] = "time"
    last: int | None = None
    kind: Literal["history", "configuration"] = "history"
    shows: str = ""
    allows: str = ""

    def matches(self, params: Mapping[str, Any]) -> bool:
        """Whether a variant belongs to the figure."""
        return all(any(_same(params.get(name), value) for value in allowed) for name, allowed in self.where.items())


def _same(value: Any, wanted: Allowed) -> bool:
    if isinstance(wanted, str | bool) or wanted is None or isinstance(value, str | bool) or value is None:
        return bool(value == wanted)
    return bool(abs(float(value) - wanted) <= 1e-3 * abs(wanted))


_COMPRESSION = (
    Plotted("fn_disk_disk_centre", "Fn disk–disk, centre row"),
    Plotted("fn_disk_disk_edge", "Fn disk–disk, edge row"),
    Plotted("fn_wall_mid", "Fn wall–middle disk"),
    Plotted("fn_wall_corner", "Fn wall–corner disk"),
)
_DISTORTION = (
    Plotted("fn_up", "Fn, centre–upper disk"),
    Plotted("fs_up", "Fs, centre–upper disk"),
    Plotted("fn_right", "Fn, centre–right disk"),
    Plotted("fs_right", "Fs, centre–right disk"),
)


def _collision(first: int) -> tuple[Plotted, ...]:
    numbers = [f"A.{first + k}" for k in range(4)]
    return (
        Plotted("energy", "kinetic energy", numbers[0]),
        Plotted("momentum_x", "momentum along x", numbers[1]),
        Plotted("vx_1", "vx, disk 1", numbers[2]),
        Plotted("vx_2", "vx, disk 2", numbers[2]),
        Plotted("vy_1", "vy, disk 1", numbers[3]),
        Plotted("vy_2", "vy, disk 2", numbers[3]),
    )


def _incline(first: int) -> tuple[Plotted, ...]:
    names = (
        ("x", "displacement along x"),
        ("vx", "velocity along x"),
        ("gap", "gap (dilation)"),
        ("fs", "shear force"),
        ("fn", "normal force"),
    )
    return tuple(Plotted(name, label, f"A.{first + k}") for k, (name, label) in enumerate(names))


_BY_KIND: Mapping[str, tuple[Allowed, ...]] = {"restitution": (None,), "beta": (None,), "theta": (None,)}
"""Collisions that nothing but their kind describes, as in the source."""

PLANS: Mapping[str, tuple[FigurePlan, ...]] = {
    "nine-disk/compression": (
        FigurePlan(
            number="A.2",
            title="Normal force with and without global damping, load case a1",
            quantities=_COMPRESSION,
            where={"load_case": ("a1",), "xi": (3.0, 0.0)},
            compare="xi",
            x="cycle",
            shows="Normal force over 200 cycles at the four kinds of contact that the source's point C may be; the "
            "walls stop at cycle 40. Left and right differ in the global damping alone and share one scale.",
            allows="With xi = 3 the oscillation decays to the steady force; with xi = 0 it goes on unchanged. An "
            "engine that gives any other amplitude or phase damps differently.",
        ),
        FigurePlan(
            number="A.3",
            title="Normal force of all load cases, xi = 3",
            quantities=_COMPRESSION,
            where={"xi": (3.0,), "load_case": ("a1", "a2", "b1", "b2")},
            compare="load_case",
            x="cycle",
            shows="The four load cases side by side on one scale: two stiffnesses, walls that stop at cycle 40 or 120.",
            allows="All load cases settle at about the same force: exactly the same with smooth walls, within a few "
            "per cent with rough ones.",
        ),
    ),
    "nine-disk/distortion": (
        FigurePlan(
            number="A.4",
            title="Deformed configurations",
            where={"phi_deg": (30.0,), "ks_over_kn": (1.0,)},
            kind="configuration",
            last=500,
            shows="Disks and walls after compression and settlement, and after the distortion; each spoke turns with "
            "its disk.",
            allows="Whether all engines distort the assembly alike, and whether the disks turn with it or against it.",
        ),
        *(
            FigurePlan(
                number=f"A.5 ({letter})",
                title=f"Normal and shear force during distortion, friction angle {phi}°",
                quantities=_DISTORTION,
                where={"phi_deg": (float(phi),), "ks_over_kn": (1.0, 2.0 / 3.0)},
                compare="ks_over_kn",
                shows="Forces between the centre disk and its upper and right neighbour over the 500 cycles of "
                "distortion, with ks/kn = 1 and 2/3. The source does not say which contact is its point C.",
                allows="A softer shear spring delays the first slip; once a contact slides, Fs follows mu Fn.",
                x="cycle",
                last=500,
            )
            for letter, phi in (("a", 15), ("b", 30))
        ),
    ),
    "binary-collision": (
        FigurePlan(
            number="A.6–A.9",
            title="Elastic collision",
            quantities=_collision(6),
            where={"kind": ("elastic",), **_BY_KIND},
            shows="Energy, momentum and the velocities of both disks over time.",
            allows="Energy and momentum are conserved if both curves are level; disk 1 stops and disk 2 leaves "
            "at vx = 1 m/s.",
        ),
        FigurePlan(
            number="A.10–A.13",
            title="Plastic collision",
            quantities=_collision(10),
            where={"kind": ("plastic",), **_BY_KIND},
            shows="Energy, momentum and the velocities of both disks over time.",
            allows="Momentum is conserved, half of the energy is lost, and both disks move on together "
            "at vx = 0.5 m/s.",
        ),
    ),
    "incline-block": (
        FigurePlan(
            number="A.17–A.21",
            title="Block that slides, mu = 0.36",
            quantities=_incline(17),
            where={"mu": (0.36,), "dt": (0.01, 0.005, 0.0025), "preload": (True, None)},
            compare="dt",
            shows="Motion, gap and contact forces of a block that slides down, for three time steps on one scale.",
            allows="The associated sliding rule opens a gap of mu vx dt that halves with dt; Coulomb engines open "
            "none. The forces are m g cos and mu m g cos, not m g and mu m g.",
        ),
        FigurePlan(
            number="A.22–A.26",
            title="Block that sticks, mu = 0.4",
            quantities=_incline(22),
            where={"mu": (0.4,), "dt": (0.01, 0.005, 0.0025), "preload": (True, None)},
            compare="dt",
            shows="The same quantities with friction above the critical 0.364.",
            allows="The block stays put; any slope of x is creep of the engine's friction model.",
        ),
    ),
    "slip-to-roll": (
        FigurePlan(
            number="",
            title="From sliding to rolling",
            quantities=(
                Plotted("x", "displacement along x"),
                Plotted("vx", "velocity along x"),
                Plotted("spin", "spin"),
            ),
            compare="dt",
            shows="A disk thrown with slip and no spin onto a plane.",
            allows="It slides until t = v0/(3 mu g) and then rolls at 2 v0/3, if the engine has the inertia of a disk.",
        ),
    ),
    "spinning-disk": (
        FigurePlan(
            number="",
            title="From spinning to rolling",
            quantities=(
                Plotted("vx", "velocity along x"),
                Plotted("spin", "spin"),
                Plotted("energy", "kinetic energy"),
            ),
            compare="dt",
            shows="A disk put on a plane with a spin and no velocity; friction drives it.",
            allows="It rolls at R omega0/3 from t = R omega0/(3 mu g) on and has lost two thirds of its energy, whatever mu.",
        ),
    ),
}
"""Plans by case id; a case without a plan, and variants that no plan takes, get `GENERIC`."""

GENERIC = FigurePlan(
    number="",
    title="Every recorded quantity",
    shows="Each quantity over time, every engine overlaid.",
    allows="Where the engines part, and when: the lower axes show each engine's distance from the best truth.",
)


@dataclass(frozen=True, kw_only=True)
class ValuePlan:
    """A number whose value over the step size tells engines apart, and the levels that it is held against."""

    quantity: str
    label: str
    levels: tuple[tuple[str, float], ...]
    shows: str
    allows: str


VALUE_PLANS: Mapping[str, tuple[ValuePlan, ...]] = {
    "incline-block": (
        ValuePlan(
            quantity="dilation",
            label="gap/(mu v dt)",
            levels=(("associated rule: 1", 1.0), ("Coulomb: 0", 0.0)),
            shows="Gap of the sliding block over mu v dt, for each time step.",
            allows="Which sliding rule an engine has: 1 for the associated rule, which opens a gap by mu times the slip "
            "of a step, 0 for Coulomb's. Anything else is a gap that neither rule explains.",
        ),
    ),
}
"""Plans of numbers against the step size, by case id."""

SETUP_FIGURES: Mapping[str, str] = {
    "nine-disk/compression": "A.1",
    "nine-disk/distortion": "A.1",
    "sliding/quasistatic": "A.14",
    "sliding/dynamic": "A.15",
    "incline-block": "A.16",
}
"""Figures of the source that show a case's set-up."""


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
