"""Declarations of figures: what the pages draw of a case, as cases state it and as runs store it."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Any, Literal

Allowed = float | str | bool | None
"""A value of a parameter that a figure admits; None also represents a parameter that the case does not have."""


@dataclass(frozen=True)
class Plotted:
    """A quantity of a figure: its name in the records, axis label and the number of its figure in the source.

    ``at`` is its place on the horizontal axis of ``places``: a number in digits, or the name of a quantity of the same cell or of a
    parameter.
    """

    name: str
    label: str
    number: str = ""
    at: str = ""


@dataclass(frozen=True)
class Drawn:
    """A curve to compare a quantity of ``places`` with: a truth, or what was read off a printed figure, whose points are drawn.

    Parameters
    ----------
    label : str
        The quantity's axis label.
    name : str
        What is beside the curve, or in the legend.
    x, y : tuple of float
        Points, x ascending.
    reader : str
        Who read the points; "" for a truth.
    """

    label: str
    name: str
    x: tuple[float, ...]
    y: tuple[float, ...]
    reader: str = ""


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A figure of a case: which of its variants and quantities are shown, and what that lets one conclude.

    Parameters
    ----------
    number, title : str
        Figure number in the source ("" for a figure of our own) and heading.
    kind : {"history", "budget", "configuration", "values", "places", "setup"}
        Histories; the quantities of each engine stacked, one picture an engine; the stored configurations; a number over the step
        size, held against ``levels``; numbers of all variants, or samples, over their places (`Plotted.at`); or the sketch of the set-up,
        of which only the number counts.
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
    levels : tuple of (str, float)
        Names and values of the horizontal lines of ``values``.
    at_label, log : str
        Of ``places``: label of the horizontal axis; which axes are logarithmic, ``"x"``, ``"y"`` or ``"xy"``.
    apart : bool
        Of ``places``: a picture an engine on common axes, worst first; otherwise one for all.
    curves : tuple of Drawn
        Of ``places``: what the points are compared with, in place of the truths that they were held against.
    shows, allows : str
        What is to be seen, and which conclusion it allows.
    """

    number: str = ""
    title: str = ""
    kind: Literal["history", "budget", "configuration", "values", "places", "setup"] = "history"
    quantities: tuple[Plotted, ...] = ()
    where: Mapping[str, tuple[Allowed, ...]] = field(default_factory=dict)
    compare: str = ""
    x: Literal["cycle", "time"] = "time"
    last: int | None = None
    levels: tuple[tuple[str, float], ...] = ()
    at_label: str = ""
    log: str = ""
    apart: bool = False
    curves: tuple[Drawn, ...] = ()
    shows: str = ""
    allows: str = ""

    def matches(self, params: Mapping[str, Any]) -> bool:
        """Whether a variant belongs to the figure."""
        return all(any(_same(params.get(name), value) for value in allowed) for name, allowed in self.where.items())


def _same(value: Any, wanted: Allowed) -> bool:
    if isinstance(wanted, str | bool) or wanted is None or isinstance(value, str | bool) or value is None:
        return bool(value == wanted)
    return bool(abs(float(value) - wanted) <= 1e-3 * abs(wanted))


def figures_to_text(figures: Iterable[Figure]) -> str:
    """Figures as the column ``case_figures`` holds them."""
    return json.dumps([asdict(figure) for figure in figures])


def figures_from_text(text: str) -> tuple[Figure, ...]:
    """Figures of a column ``case_figures``; those of another make, or of none, are left out."""
    try:
        stored = json.loads(text or "[]")
        return tuple(_figure(each) for each in stored)
    except (ValueError, TypeError, AttributeError):
        return ()


def _figure(stored: Mapping[str, Any]) -> Figure:
    known = {each.name for each in fields(Figure)}
    plain = {name: value for name, value in stored.items() if name in known}
    kinds = {"last": int | None, "apart": bool}
    if not all(isinstance(plain[name], kinds.get(name, str)) for name in plain.keys() - _COMPOSED):
        raise TypeError("a text, a number of steps, or a yes or no, is none")
    where = {name: tuple(allowed) for name, allowed in stored.get("where", {}).items()}
    if not all(isinstance(value, Allowed) for allowed in where.values() for value in allowed):
        raise TypeError("a value of a parameter is none")
    return Figure(
        **plain
        | {
            "quantities": tuple(
                Plotted(**{key: str(value) for key, value in each.items()}) for each in stored.get("quantities", ())
            ),
            "where": where,
            "levels": tuple((str(name), float(level)) for name, level in stored.get("levels", ())),
            "curves": tuple(_drawn(each) for each in stored.get("curves", ())),
        }
    )


_COMPOSED = {"quantities", "where", "levels", "curves"}


def _drawn(stored: Mapping[str, Any]) -> Drawn:
    x, y = (tuple(float(each) for each in stored.get(axis, "?")) for axis in "xy")
    if len(x) != len(y) or not all(map(math.isfinite, x + y)):
        raise ValueError("a curve has as many places as values, all of them finite")
    return Drawn(str(stored.get("label")), str(stored.get("name")), x, y, str(stored.get("reader", "")))
