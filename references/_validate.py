"""Argument checks shared by the closed forms."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping


def positive(**values: float) -> None:
    """Raise ValueError unless every value is finite and > 0."""
    _each(values, lambda value: value > 0.0, "> 0")


def not_negative(**values: float) -> None:
    """Raise ValueError unless every value is finite and >= 0."""
    _each(values, lambda value: value >= 0.0, ">= 0")


def count(**values: int) -> None:
    """Raise ValueError unless every value is a whole number >= 0."""
    _each(values, lambda value: value >= 0 and value == int(value), "a whole number >= 0")


def theta_in_range(theta: float) -> None:
    """Raise ValueError unless 1/2 <= theta <= 1."""
    if not 0.5 <= theta <= 1.0:
        raise ValueError(f"theta = {theta!r} is not allowed: the scheme is defined for theta in [0.5, 1]")


def slope(angle: float) -> None:
    """Raise ValueError unless 0 <= angle < pi/2."""
    if not 0.0 <= angle < math.pi / 2.0:
        raise ValueError(f"angle = {angle!r} rad is not allowed: it must lie in [0, pi/2); degrees must be converted")


def _each(values: Mapping[str, float], allowed: Callable[[float], bool], wanted: str) -> None:
    for name, value in values.items():
        if not (math.isfinite(value) and allowed(value)):
            raise ValueError(f"{name} = {value!r} is not allowed: it must be finite and {wanted}")
