"""Numbers, durations, file names, symbols and words as the pages print them: no meaning is given by colour alone."""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Iterable
from typing import Any

from ninedisk.harness.results.schema import short_variant as short_variant
from ninedisk.harness.results.statuses import TABLE

NOTHING = "—"
"""What represents a number that is missing, not a number or infinite."""


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
    # Rounded first: else 0.00999 would be 1.0e-2 beside the 0.01 of 0.01001.
    return "0" if x == 0.0 else f"{x:.2g}" if 0.01 <= abs(float(f"{x:.1e}")) < 99.5 else _scientific(x)


def _scientific(x: float) -> str:
    """Two significant digits and a bare exponent: ``4.6e5``."""
    mantissa, exponent = f"{x:.1e}".split("e")
    return f"{mantissa}e{int(exponent)}"


def number(value: Any) -> str:
    """A value, seven significant digits."""
    x = as_float(value)
    return f"{x + 0.0:.7g}" if math.isfinite(x) else NOTHING


def ratio(value: Any) -> str:
    """Error over tolerance: plain near 1, where what is larger never reads as 1, scientific elsewhere."""
    x = as_float(value)
    if math.isinf(x):
        return "∞"
    if math.isnan(x):
        return NOTHING
    if x == 0.0:
        return "0"
    if f"{x:.2g}" == "1":
        reported = f"{x:.4g}"
        return reported if reported != "1" or x <= 1.0 else "> 1"
    return f"{x:.2g}" if 0.01 <= float(f"{x:.1e}") < 99.5 else f"{x:.0f}" if 99.5 <= x < 1000.0 else _scientific(x)


def factor(value: float) -> str:
    """A factor of change: two decimals near 1, else like a ratio."""
    return f"{value:.2f}" if 0.01 < value < 9.95 else ratio(value)


def order(value: Any) -> str:
    """A fitted order of convergence; errors that are round-off have none."""
    x = as_float(value)
    return f"{round(x, 2) + 0.0:.2f}" if math.isfinite(x) else NOTHING


def factor_text(value: Any) -> str:
    """How many times as long something took: ``1``, ``3.4``, ``120``."""
    x = as_float(value)
    return f"{x:.2g}" if x < 99.5 else f"{x:.0f}" if math.isfinite(x) else NOTHING


def count_noun(number: int, word: str) -> str:
    """A number and a noun: ``1,162 checks``, ``1 check``."""
    return f"{number:,} {word}{'' if number == 1 else 's'}"


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


STATUS_SYMBOL = {status: each.symbol for status, each in TABLE.items()}
STATUS_MEANING = {status: each.meaning for status, each in TABLE.items()}
VERDICT_SYMBOL = {"confirmed": "✓", "contradicted": "✗", "undecided": "?"}
SUPPORT_PIPS = {"exact": "●●●", "equivalent": "●●○", "approximate": "●○○", "no": "○○○"}
SUPPORT_MEANING = {
    "exact": "the engine expresses the very scene",
    "equivalent": "another scene with the same physics",
    "approximate": "a scene whose physics differs, as the notes say",
    "no": "not expressible",
}
SHADES = (
    ("in0", 0.1, "error at most 0.1 × tolerance"),
    ("in1", 1.0, "at most 1 × tolerance"),
    ("out1", 10.0, "up to 10 × tolerance"),
    ("out2", 1000.0, "up to 1000 × tolerance"),
    ("out3", math.inf, "more than 1000 × tolerance"),
)
"""Classes of error over tolerance: CSS class, largest ratio, words."""


def shade(ratio: float) -> str:
    """CSS class of an error over tolerance; ``none`` where nothing was measured."""
    return "none" if math.isnan(ratio) else next(name for name, most, _ in SHADES if ratio <= most)


DECADES = 12
"""Decades of a relative error that have a colour each, those below 1; all that is smaller looks like the smallest."""


def decade(size: float) -> str:
    """CSS class of a relative error by its decade, ``d0`` for at most 1e-12 to ``d13`` above 1; ``none`` for no number."""
    if math.isnan(size):
        return "none"
    return f"d{0 if size <= 10.0**-DECADES else DECADES + 1 if size > 1.0 else math.ceil(math.log10(size)) + DECADES}"


SLOWER = (1.5, 3.0, 10.0, 30.0, 100.0, 1000.0)
"""Bounds of the classes of time over that of the fastest engine."""


def slower_shade(factor: float) -> str:
    """CSS class of a time over that of the fastest engine: every second colour of the decades."""
    return "none" if math.isnan(factor) else f"d{2 * sum(factor > bound for bound in SLOWER)}"


def symbol(word: str) -> str:
    """Symbol of a status or verdict; ``‼`` for one that this version does not know."""
    return STATUS_SYMBOL.get(word) or VERDICT_SYMBOL.get(word) or "‼"


PAIR_SHADES = (
    ("in0", 1e-9, "differ by at most 1e-9"),
    ("in1", 1e-4, "at most 1e-4"),
    ("out1", 1e-2, "at most 1 %"),
    ("out2", 0.3, "at most 30 %"),
    ("out3", math.inf, "more"),
)
"""Classes of the relative difference of two engines."""


def pair_shade(size: float) -> str:
    """CSS class of a relative difference."""
    return next(name for name, most, _ in PAIR_SHADES if size <= most)
