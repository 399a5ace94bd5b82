"""Argument checks shared by all references: each names the argument that is out of its range, and none lets an array grow without bound."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from numbers import Real

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

MOST = 1_000_000
"""Entries of a table that a number of steps, disks or flights makes: hundreds of megabytes in extended precision."""


def positive(**values: object) -> None:
    """Raise ValueError unless every value is finite and > 0."""
    _each(values, lambda value: value > 0.0, "finite and > 0")


def not_negative(**values: object) -> None:
    """Raise ValueError unless every value is finite and >= 0."""
    _each(values, lambda value: value >= 0.0, "finite and >= 0")


def finite(**values: object) -> None:
    """Raise ValueError unless every value is a finite number."""
    _each(values, lambda _: True, "a finite number")


def fraction(**values: object) -> None:
    """Raise ValueError unless every value lies in [0, 1]."""
    _each(values, lambda value: 0.0 <= value <= 1.0, "a number in [0, 1]")


def count(*, least: int = 0, most: int = MOST, **values: object) -> None:
    """Raise ValueError unless every value is a whole number in ``least .. most``."""
    _each(values, lambda value: value == int(value) and least <= value <= most, f"a whole number {least} .. {most}")


def positive_or_inf(**values: object) -> None:
    """Raise ValueError unless every value is > 0, or infinite."""
    _each(
        {name: value for name, value in values.items() if number(value) != math.inf},
        lambda value: value > 0.0,
        "> 0, or inf",
    )


def theta_in_range(theta: object) -> None:
    """Raise ValueError unless 1/2 <= theta <= 1."""
    _each({"theta": theta}, lambda value: 0.5 <= value <= 1.0, "a number in [0.5, 1], where the scheme is defined")


def slope(angle: object) -> None:
    """Raise ValueError unless 0 <= angle < pi/2."""
    if not 0.0 <= number(angle) < math.pi / 2.0:
        raise ValueError(f"angle = {angle!r} rad is not allowed: it must lie in [0, pi/2); degrees must be converted")


def form_in_range(form: object) -> None:
    """Raise ValueError unless the damping form is "central" or "lagged"."""
    if not (isinstance(form, str) and form in ("central", "lagged")):
        raise ValueError(f"form = {form!r} is unknown: use 'central' or 'lagged'")


def flag(**values: object) -> None:
    """Raise ValueError unless every value is true or false."""
    for name, value in values.items():
        if not isinstance(value, bool | np.bool_):
            raise ValueError(f"{name} = {value!r} is not allowed: it must be true or false")


def array(name: str, values: ArrayLike, *, dimensions: tuple[int, ...] = ()) -> FloatArray:
    """``values`` as float64; raises ValueError unless they are finite numbers in as many dimensions (any, if none are named)."""
    try:
        found = np.asarray(values)
        if found.dtype.kind not in "iuf" or np.ma.is_masked(values):
            raise TypeError
        found = found.astype(np.float64)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{name} = {values!r:.200} is not allowed: it must be numbers in equal rows") from None
    if dimensions and found.ndim not in dimensions:
        raise ValueError(f"{name} of shape {found.shape} is not allowed: it must have {dimensions[0]} dimension(s)")
    if not np.isfinite(found).all():
        raise ValueError(f"{name} = {values!r:.200} is not allowed: every entry must be finite")
    return found


def pair_of(name: str, values: ArrayLike, length: int = 2) -> FloatArray:
    """Two finite numbers, or ``length``, as float64, shape (length,); raises ValueError."""
    found = array(name, values, dimensions=(1,))
    if found.shape != (length,):
        words = {2: "two", 3: "three", 4: "four"}
        raise ValueError(f"{name} = {values!r:.200} is not allowed: it must be {words[length]} numbers")
    return found


def times_of(t: ArrayLike) -> FloatArray:
    """Times as float64; raises ValueError unless each is finite and >= 0."""
    found = array("t", t)
    if (found < 0.0).any():
        raise ValueError(f"t = {t!r:.200} is not allowed: every time must be finite and >= 0")
    return found


def sizes(name: str, values: object, *, least: int = 1, most: int = 1_000, strict: bool = False) -> tuple[float, ...]:
    """A sequence of ``least .. most`` finite numbers >= 0, or > 0 if strict; raises ValueError."""
    found = array(name, values, dimensions=(1,))  # type: ignore[arg-type]
    if not least <= len(found) <= most:
        raise ValueError(f"{name} of {len(found)} entries is not allowed: use {least} to {most}")
    if (found <= 0.0 if strict else found < 0.0).any():
        raise ValueError(f"{name} = {values!r:.200} is not allowed: every one must be {'> 0' if strict else '>= 0'}")
    return tuple(found.tolist())


def pair(name: str, value: object) -> tuple[float, float]:
    """Two finite numbers; raises ValueError."""
    found = array(name, value)  # type: ignore[arg-type]
    if found.shape != (2,):
        raise ValueError(f"{name} = {value!r:.200} is not allowed: it must be two numbers")
    return float(found[0]), float(found[1])


def number(value: object) -> float:
    """``value`` as a float; NaN if it is no real number."""
    if isinstance(value, np.ndarray) and value.shape == ():
        value = value[()]
    if isinstance(value, bool) or not isinstance(value, Real):
        return math.nan
    try:
        return float(value)
    except OverflowError:
        return math.nan


def _each(values: Mapping[str, object], allowed: Callable[[float], bool], wanted: str) -> None:
    for name, value in values.items():
        found = number(value)
        if not (math.isfinite(found) and allowed(found)):
            shown = f"{value!r:.200}" if not isinstance(value, int) or abs(value) < 10**100 else "a huge integer"
            raise ValueError(f"{name} = {shown} is not allowed: it must be {wanted}")
