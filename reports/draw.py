"""Histories: a quantity over time, and below it every engine's distance from the truth on a log axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.reports.style import INK, Look, rc_params
from ninedisk.reports.svg import write_svg

FloatArray = NDArray[np.float64]
EPS = float(np.finfo(np.float64).eps)
MOST_POINTS = 300
MOST_ERRORS = 180
"""Errors jump from sample to sample; fewer points keep the files small and the extremes are kept anyway."""
MARKS = 7
FLAT = 2e-3
"""Relative span below which a quantity counts as constant."""


@dataclass(frozen=True)
class Line:
    """A curve of a panel; ``error`` is None for references and where no truth speaks."""

    look: Look
    x: FloatArray
    y: FloatArray
    error: FloatArray | None = None
    tolerance: float = float("nan")


@dataclass(frozen=True)
class HistoryPanel:
    """What one panel draws; limits are shared by the panels that are compared.

    ``floor`` is the round-off of the quantity: smaller errors are drawn on it.
    """

    title: str
    x_label: str
    y_label: str
    lines: tuple[Line, ...]
    references: tuple[Line, ...]
    y_limits: tuple[float, float]
    error_limits: tuple[float, float] | None
    floor: float


def value_limits(truths: Sequence[FloatArray], values: Sequence[FloatArray]) -> tuple[float, float]:
    """Common limits of a quantity: all curves, but at most twice the truths' own span beyond them, so that one engine
    that runs away does not flatten the others."""
    low, high = _span([*truths, *values])
    if truths and np.isfinite(_span(truths)).all():
        least, most = _span(truths)
        room = 2.0 * (most - least)
        if room > 0.0:
            low, high = max(low, least - room), min(high, most + room)
    if not np.isfinite([low, high]).all():
        return -1.0, 1.0
    # A constant is drawn as one: what happens around it (and round-off around zero) belongs to the error axis.
    size = max(abs(low), abs(high))
    if high - low < FLAT * size:
        low, high = low - 0.05 * size, high + 0.05 * size
    if size < 1e-12:
        low, high = -1e-12, 1e-12
    margin = 0.06 * (high - low)
    return low - margin, high + margin


def error_limits(errors: Sequence[FloatArray], tolerances: Sequence[float], floor: float) -> tuple[float, float] | None:
    """Common limits of the error axis, at least three decades and the tolerances; None where there is no error."""
    finite = [error[np.isfinite(error)] for error in errors]
    if not any(len(error) for error in finite):
        return None
    top = max(float(error.max()) for error in finite if len(error))
    top = max([top, *(limit for limit in tolerances if np.isfinite(limit))])
    return 0.5 * floor, max(4.0 * top, 500.0 * floor)


def round_off(scales: Sequence[float], errors: Sequence[FloatArray]) -> float:
    """Round-off of a quantity, ``eps max|expected|``.

    For a truth of zero it is the smallest error that is not zero, but no less than ``eps`` times the largest one.
    """
    scale = max((s for s in scales if np.isfinite(s)), default=0.0)
    if scale > 0.0:
        return EPS * scale
    positive = [error[np.isfinite(error) & (error > 0.0)] for error in errors]
    filled = [error for error in positive if len(error)]
    if not filled:
        return EPS
    return max(min(float(error.min()) for error in filled), EPS * max(float(error.max()) for error in filled))


def error_label(y_label: str) -> str:
    """Label of the error axis below an axis of values."""
    return f"|error| {y_label[y_label.rfind('[') :]}" if "[" in y_label else "|error|"


def draw_history(panel: HistoryPanel, path: Path) -> None:
    """Write the panel as SVG."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(rc_params()):
        if panel.error_limits is None:
            figure = Figure(figsize=(3.6, 2.3))
            top, bottom = figure.subplots(), None
        else:
            figure = Figure(figsize=(3.6, 3.6))
            top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(1.35, 1.0))
        # Fixed margins: measuring the texts takes longer than drawing everything else.
        below = 0.19 if bottom is None else 0.12
        figure.subplots_adjust(left=0.2, right=0.975, top=1.0 - 1.05 * below, bottom=below, hspace=0.1)
        figure.text(0.02, 0.985, panel.title, fontsize=9.0, va="top")
        top.set_ylabel(panel.y_label)
        top.set_ylim(*panel.y_limits)
        for line in panel.references:
            _plot(top, line.look, line.x, line.y, zorder=1.0)
        for line in panel.lines:
            _plot(top, line.look, line.x, line.y, zorder=2.0)
        if bottom is not None and panel.error_limits is not None:
            _errors(bottom, panel, panel.error_limits)
        (top if bottom is None else bottom).set_xlabel(panel.x_label)
        write_svg(figure, path)


def _errors(axes: Any, panel: HistoryPanel, limits: tuple[float, float]) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

    axes.set_yscale("log")
    axes.set_ylim(*limits)
    axes.yaxis.set_major_locator(LogLocator(numticks=6))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: log_label(value)))
    axes.set_ylabel(error_label(panel.y_label))
    axes.axhline(panel.floor, color=INK, linewidth=0.6, alpha=0.6, dashes=(1, 2))
    axes.text(0.01, panel.floor, "round-off", transform=axes.get_yaxis_transform(), fontsize=7, va="bottom")
    for line in panel.lines:
        if line.error is not None and np.isfinite(line.error).any():
            _plot(axes, line.look, line.x, np.maximum(line.error, panel.floor), zorder=2.0, most=MOST_ERRORS)
    limits_shown = sorted(
        {line.tolerance for line in panel.lines if np.isfinite(line.tolerance) and line.tolerance > 0}
    )
    if len(limits_shown) == 1:
        axes.axhline(limits_shown[0], color=INK, linewidth=0.8, alpha=0.8, dashes=(5, 2))
        axes.text(
            0.99,
            limits_shown[0],
            "tolerance",
            transform=axes.get_yaxis_transform(),
            fontsize=7,
            ha="right",
            va="bottom",
        )
    elif limits_shown:
        for line in panel.lines:
            if np.isfinite(line.tolerance) and line.tolerance > 0:
                mark = [line.tolerance, line.tolerance]
                axes.plot(
                    [0.94, 1.0], mark, transform=axes.get_yaxis_transform(), color=line.look.colour, linewidth=2.0
                )


def log_label(value: float) -> str:
    """Label of a power of ten on a log axis: ``1e-9``."""
    return f"1e{round(float(np.log10(value)))}" if value > 0.0 else ""


def _plot(axes: Any, look: Look, x: FloatArray, y: FloatArray, zorder: float, most: int = MOST_POINTS) -> None:
    x, y = joined(x, y)
    keep = thin(x, y, most)
    x, y = x[keep], y[keep]
    options: dict[str, Any] = {"color": look.colour, "linewidth": look.width, "zorder": zorder}
    if look.dash:
        options["dashes"] = [length / look.width * 0.8 for length in look.dash]
    if not look.marker:
        options["alpha"] = 0.55
    elif len(x):
        places = sorted({int((k + look.phase) / MARKS * len(x)) for k in range(MARKS)})
        options |= {"marker": look.marker, "markersize": 4.0, "markevery": places, "markeredgewidth": 0.0}
    axes.plot(x, y, **options)


def joined(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points to connect: a curve that speaks at scattered samples only loses its gaps, any other keeps them."""
    held = np.isfinite(y)
    neighbour = np.append(held[1:], False) | np.append(False, held[:-1])
    alone = held & ~neighbour
    return (x[held], y[held]) if 2 * alone.sum() > held.sum() else (x, y)


def thin(x: FloatArray, y: FloatArray, most: int = MOST_POINTS) -> NDArray[np.int64]:
    """Indices of at most ``most`` points that keep the ends and the extremes of every stretch."""
    if len(x) <= most:
        return np.arange(len(x))
    keep = {0, len(x) - 1}
    for part in np.array_split(np.arange(len(x)), most // 2 - 1):
        finite = part[np.isfinite(y[part])]
        keep |= (
            {int(finite[np.argmin(y[finite])]), int(finite[np.argmax(y[finite])])} if len(finite) else {int(part[0])}
        )
    return np.array(sorted(keep))


def _span(curves: Sequence[FloatArray]) -> tuple[float, float]:
    finite = [curve[np.isfinite(curve)] for curve in curves]
    filled = [curve for curve in finite if len(curve)]
    if not filled:
        return float("nan"), float("nan")
    return min(float(curve.min()) for curve in filled), max(float(curve.max()) for curve in filled)
