"""Checks that the parts of a scene and its numerics share.

Whatever is given, the answer is a checked value or a `CoreError` that names it: no other exception, no silent conversion of what is no
number (strings, truth values, complex numbers, masked entries).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from numbers import Real
from operator import index
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from ninedisk.core.array_types import FloatArray as FloatArray
from ninedisk.core.array_types import IntArray as IntArray
from ninedisk.core.errors import CoreError, InvalidNumericsError, InvalidSceneError

Item = TypeVar("Item")

LARGEST, SMALLEST = 1e150, 1e-150
"""Sizes of lengths, masses, stiffnesses and steps: squares, products and quotients of two of them stay normal doubles. Beyond, the squared
distance of two disks that overlap would be 0 or infinite, and the contact would be missed."""

SHOWN = 500
"""Characters of a bad value that a message shows."""


def short_repr(value: object) -> str:
    """``repr(value)``, shortened; whatever the value does when asked for it."""
    try:
        text = repr(value)
    except Exception:  # an integer of more than 4300 digits, or an object that is broken
        return f"a value of type {type(value).__name__}"
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."


def real(value: object) -> float:
    """``value`` as a float; NaN, which no range contains, if it is no real number (a string or a truth value is none)."""
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value[()]
    if not _is_real(type(value)):
        return math.nan
    try:
        return float(value)  # type: ignore[arg-type]
    except (OverflowError, TypeError, ValueError):
        return math.nan


def numbers(name: str, value: ArrayLike) -> FloatArray:
    """Copy of ``value`` as float64; raises `InvalidSceneError` unless it holds real numbers in equal rows.

    A string or a truth value is no number, although NumPy would convert it, and neither is what a mask hides.
    """
    try:
        if isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
            raise TypeError
        if isinstance(value, np.ndarray | np.generic) and value.dtype.kind in "iuf":
            return np.array(value, dtype=np.float64)
        items = np.array(value, dtype=object)
        if all(_is_real(kind) for kind in {type(item) for item in items.flat}):
            return items.astype(np.float64)
    except Exception as error:  # whatever an object does that is asked to be an array
        raise InvalidSceneError(f"{name} must be numbers, not {short_repr(value)}") from error
    raise InvalidSceneError(f"{name} must be numbers, not {short_repr(value)}")


def finite(name: str, value: ArrayLike, shape: tuple[int, ...], *, most: float = math.inf) -> FloatArray:
    """Read-only copy of ``value``, of the given shape, finite and of size ``most`` at most, or `InvalidSceneError`."""
    array = numbers(name, value)
    if array.shape != shape:
        raise InvalidSceneError(f"{name} has shape {array.shape}; it must have shape {shape}")
    if not np.all(np.isfinite(array)):
        raise InvalidSceneError(f"{name} must be finite; it holds {array[~np.isfinite(array)][0]}")
    if np.any(np.abs(array) > most):
        raise InvalidSceneError(f"{name} must be at most {most:g} in size; it holds {array[np.abs(array) > most][0]:g}")
    array.setflags(write=False)
    return array


def rows_of(name: str, value: ArrayLike, width: int) -> FloatArray:
    """Numbers in rows of this width; an empty list, as JSON has it for no row at all, has lost its second dimension.

    Raises
    ------
    InvalidSceneError
        If it has another shape.
    """
    array = numbers(name, value)
    if array.shape == (0,):
        return array.reshape(0, width)
    if array.ndim != 2 or array.shape[1] != width:
        raise InvalidSceneError(f"{name} has shape {array.shape}; it must have shape (n, {width})")
    return array


def at_least(
    name: str, value: object, low: float, *, strict: bool = False, error: type[CoreError] = InvalidSceneError
) -> float:
    """``value`` as a float; raises ``error`` unless it is a number ``>= low`` of size `LARGEST` at most.

    With ``strict`` it must be ``> low``, and where that is 0, `SMALLEST` at least.
    """
    number = real(value)
    if not (math.isfinite(number) and (number > low if strict else number >= low)):
        sign = ">" if strict else ">="
        raise error(f"{name} = {short_repr(value)} is not allowed: it must be a finite number {sign} {low:g}")
    if number > LARGEST or (strict and low == 0.0 and number < SMALLEST):
        first = SMALLEST if strict and low == 0.0 else low
        raise error(
            f"{name} = {short_repr(value)} is not allowed: it must lie between {first:g} and {LARGEST:g}; change units"
        )
    return number


def within(
    name: str,
    value: object,
    low: float,
    high: float,
    *,
    open_low: bool = False,
    error: type[CoreError] = InvalidSceneError,
) -> float:
    """``value`` as a float in ``[low, high]``, or in ``(low, high]``; else ``error``."""
    number = real(value)
    if not ((number > low if open_low else number >= low) and number <= high):
        raise error(
            f"{name} = {short_repr(value)} is not allowed: it must be a number in {'(' if open_low else '['}{low:g}, {high:g}]"
        )
    return number


def whole(name: str, value: object, low: int, high: int, *, error: type[CoreError] = InvalidNumericsError) -> int:
    """``value`` as an int in ``low .. high``, from any whole number; else ``error``."""
    number = real(value)
    if not (number.is_integer() and low <= number <= high):
        raise error(f"{name} = {short_repr(value)} is not allowed: it must be a whole number {low}..{high}")
    return int(value) if isinstance(value, int) else int(number)


def flag(name: str, value: object, *, error: type[CoreError] = InvalidSceneError) -> bool:
    """``value`` if it is true or false; else ``error``."""
    if not isinstance(value, bool | np.bool_):
        raise error(f"{name} = {short_repr(value)} is not allowed: it must be true or false")
    return bool(value)


def one_of(name: str, value: object, choices: Iterable[str], *, error: type[CoreError] = InvalidSceneError) -> None:
    """Raise ``error`` unless ``value`` is one of the words."""
    known = tuple(choices)
    if not (isinstance(value, str) and value in known):
        raise error(f"{name} = {short_repr(value)} is unknown: use one of {', '.join(known)}")


def kind_of(name: str, value: object, kind: type[Item], *, error: type[CoreError] = InvalidSceneError) -> Item:
    """``value`` if it is of the kind asked for; else ``error``."""
    if not isinstance(value, kind):
        raise error(f"{name} = {short_repr(value)} is not allowed: it must be of the type {kind.__name__}")
    return value


def all_of_kind(name: str, values: object, kind: type[Item]) -> tuple[Item, ...]:
    """The values as a tuple; `InvalidSceneError` unless they are a sequence of the kind asked for."""
    found = items_of(name, values, f"a sequence of {kind.__name__}, () for none")
    for k, value in enumerate(found):
        kind_of(f"{name}[{k}]", value, kind)
    return found


def items_of(name: str, values: object, wanted: str) -> tuple[Any, ...]:
    """What a sequence holds; `InvalidSceneError` if it is none."""
    try:
        if isinstance(values, str | bytes):
            raise TypeError
        return tuple(values)  # type: ignore[arg-type]
    except Exception as error:  # whatever an object does that is asked for its items
        raise InvalidSceneError(f"{name} = {short_repr(values)} is not allowed: it must be {wanted}") from error


def body_numbers(name: str, value: object) -> tuple[int, ...]:
    """The whole numbers of a sequence; `InvalidSceneError` if it is none (a truth value is no number)."""
    try:
        items = items_of(name, value, "a sequence")
        if any(isinstance(item, bool | np.bool_ | np.ma.MaskedArray) for item in items):
            raise TypeError
        return tuple(index(item) for item in items)
    except Exception as error:  # whatever an object does that is asked for its items
        raise InvalidSceneError(f"{name}, not {short_repr(value)}") from error


def _is_real(kind: type) -> bool:
    return issubclass(kind, Real) and not issubclass(kind, bool)
