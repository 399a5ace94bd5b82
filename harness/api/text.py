"""Numbers and foreign text as the terminal and text files show them."""

from __future__ import annotations

import math
import re

_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]")


def short(value: float) -> str:
    """Two or three significant digits; ``-`` for no number."""
    return "-" if math.isnan(value) else f"{value:.3g}"


def some(count: int, word: str) -> str:
    """A number and a noun: ``1,162 checks``, ``1 check``."""
    return f"{count:,} {word}{'' if count == 1 else 's'}"


def times(base: float, head: float) -> str:
    """How many times as large, ``1.30x``; ``-`` where that means nothing."""
    if math.isnan(base) or math.isnan(head) or base <= 0.0:
        return "-"
    return f"{head / base:.2f}x" if head < 100.0 * base else f"{head / base:.1e}x"


def duration(seconds: float) -> str:
    """Seconds with a fitting unit."""
    if math.isnan(seconds):
        return "-"
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds * 1e6:.3g} us"


def printable(text: str) -> str:
    """Text on one line without control characters, which could move a terminal's cursor or break a file's syntax."""
    return _CONTROL.sub(" ", text)


def found_and_expected(value: float, expected: float) -> tuple[str, str]:
    """Both numbers with their signs, with as many digits as it takes to see that they differ, at least four."""
    for digits in range(4, 17):
        found, wanted = (f"{number:+.{digits}g}" for number in (value, expected))
        if found != wanted or value == expected:
            break
    return found, wanted
