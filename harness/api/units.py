"""Numbers with a unit, as users type them (``10 ms``, ``36 kN/m``, ``20 deg``, ``2/3``)."""

from __future__ import annotations

import re
from fractions import Fraction
from typing import Any

from ninedisk.harness.api.case import ParameterError

_NUMBER = re.compile(
    r"\s*(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?(?:/\d+(?:\.\d+)?(?![\w.]))?)\s*(?P<suffix>.*?)\s*"
)
_SUFFIX = re.compile(r"(?:[^\W\d_]|[µ°%]|[*/ .]|\^-?\d(?!\d|\s*\^)|(?<![\d^])1(?=\s*/))+")
"""Letters, unit signs and one-digit exponents: nothing that could make an expression expensive to evaluate."""


def split_number(text: str) -> tuple[str, str] | None:
    """Number (decimal or a fraction of two numbers) and the unit behind it; None if the text is no number."""
    if len(text) > 80:
        return None
    match = _NUMBER.fullmatch(text)
    return (match["number"], match["suffix"]) if match else None


def to_unit(name: str, number: str, suffix: str, unit: str) -> float:
    """Convert ``number suffix`` to ``unit``.

    ``number`` is a decimal or a fraction of two numbers, as `split_number` gives it.

    Raises
    ------
    ParameterError
        If the unit is unknown or has another dimension; the message names the expected unit.
    """
    expected = unit if unit != "-" else ""
    want = f"give it in {expected}" if expected else "it has no unit: give a bare number"
    shown = f"{name} = {number} {suffix} is not allowed"
    plain = suffix.replace("**", "^")
    if not _SUFFIX.fullmatch(plain):
        raise ParameterError(f"{shown}: {suffix!r} is no unit; {want}")
    import pint

    registry: Any = pint.UnitRegistry()
    try:
        converted = registry.Quantity(Fraction(number), registry.parse_units(plain)).to(expected or "dimensionless")
        return float(converted.magnitude)
    except pint.DimensionalityError:
        raise ParameterError(f"{shown}: {suffix!r} has the wrong dimension; {want}") from None
    except Exception:  # pint's parser leaks many kinds of errors for text that is no unit
        raise ParameterError(f"{shown}: the unit {suffix!r} is unknown; {want}") from None
