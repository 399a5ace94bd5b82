"""Symbols and words of the pages: no meaning is told by colour alone."""

from __future__ import annotations

import math

STATUS_SYMBOL = {
    "pass": "✓",
    "fail": "✗",
    "error": "‼",
    "timeout": "◷",
    "unsupported": "○",
    "not-installed": "∅",
    "known-gap": "△",
    "gap-closed": "▲",
    "no-truth": "?",
}
STATUS_MEANING = {
    "pass": "every checked quantity lies within its tolerance",
    "fail": "a checked quantity lies outside its tolerance",
    "error": "the engine broke",
    "timeout": "the engine was stopped at its time limit",
    "unsupported": "the engine lacks a capability that the case needs",
    "not-installed": "the engine is not on the machine that ran the cases",
    "known-gap": "outside a truth that is itself known to be off; the reason is given",
    "gap-closed": "within a truth that is known to be off: the recorded reason no longer holds",
    "no-truth": "nothing to compare with",
}
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
