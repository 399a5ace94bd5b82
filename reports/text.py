"""Numbers, durations and file names as the pages print them."""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Iterable
from typing import Any

NOTHING = "—"
"""What stands for a number that is missing, not a number or infinite."""


def as_float(value: Any) -> float:
    """``value`` as a float; NaN for None and for what is no number."""
    try:
        return float(value)
    except (TypeError, ValueError):
        return math.nan


def error(value: Any) -> str:
    """An error or tolerance, two significant digits: ``1.2e-13``, ``0.25``."""
    x = as_float(value)
    if not math.isfinite(x):
        return NOTHING
    return "0" if x == 0.0 else f"{x:.2g}" if 0.01 <= abs(x) < 99.5 else _scientific(x)


def _scientific(x: float) -> str:
    """Two significant digits and a bare exponent: ``4.6e5``."""
    mantissa, exponent = f"{x:.1e}".split("e")
    return f"{mantissa}e{int(exponent)}"


def number(value: Any) -> str:
    """A value, seven significant digits."""
    x = as_float(value)
    return f"{x + 0.0:.7g}" if math.isfinite(x) else NOTHING


def ratio(value: Any) -> str:
    """Error over tolerance: plain near 1 (and never rounded across it), scientific elsewhere."""
    x = as_float(value)
    if math.isinf(x):
        return "∞"
    if math.isnan(x):
        return NOTHING
    if x == 0.0:
        return "0"
    if x != 1.0 and f"{x:.2g}" == "1":
        return "<1" if x < 1.0 else ">1"
    return f"{x:.2g}" if 0.01 <= x < 99.5 else f"{x:.0f}" if 99.5 <= x < 1000.0 else _scientific(x)


def order(value: Any) -> str:
    """A fitted order of convergence; errors that are round-off have none."""
    x = as_float(value)
    return f"{round(x, 2) + 0.0:.2f}" if math.isfinite(x) else NOTHING


def short_variant(name: str) -> str:
    """A variant's id with its numbers cut to four digits."""
    return re.sub(r"(?<==)-?\d+\.\d{5,}(?=,|$)", lambda m: f"{float(m[0]):.4g}", name)


def seconds(value: Any) -> str:
    """A wall-clock duration with its unit."""
    x = as_float(value)
    if not math.isfinite(x):
        return NOTHING
    for unit, factor in (("s", 1.0), ("ms", 1e3), ("µs", 1e6)):
        if x * factor >= 1.0 or unit == "µs":
            return f"{x * factor:.3g} {unit}"
    raise AssertionError("unreachable: the last unit always returns")


def parameter(value: Any) -> str:
    """A parameter's value: short, numbers without trailing noise."""
    if isinstance(value, bool) or value is None:
        return {True: "yes", False: "no", None: "none"}[value]
    return f"{value:.4g}" if isinstance(value, int | float) else str(value)


def parameters(params: dict[str, Any], names: Iterable[str]) -> str:
    """``name = value`` of some parameters, joined by commas."""
    return ", ".join(f"{name} = {parameter(params.get(name))}" for name in names)


def decoded(text: Any, kind: type) -> Any:
    """JSON ``text`` if it holds a ``kind`` (dict or list), else an empty one: damaged text never stops a report."""
    try:
        data = json.loads(text) if text else None
    except (TypeError, ValueError):
        data = None
    return data if isinstance(data, kind) else kind()


class Slugs:
    """File names for ids: ``[a-z0-9-]`` only, so no id leaves its folder, and one name for each id."""

    def __init__(self) -> None:
        self._slug: dict[str, str] = {}

    def __call__(self, name: str) -> str:
        if name not in self._slug:
            slug = re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")[:60] or "unnamed"
            if slug in self._slug.values():
                slug = f"{slug}-{hashlib.sha256(name.encode('utf-8', 'replace')).hexdigest()[:8]}"
            self._slug[name] = slug
        return self._slug[name]
