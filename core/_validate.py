"""Checks that the parts of a scene and its numerics share."""

from __future__ import annotations

import math
from numbers import Real

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.core.errors import InvalidSceneError

FloatArray = NDArray[np.float64]


def real(value: object) -> float:
    """``value`` as a float; NaN, which no range contains, if it is no real number (a string or a truth value is none)."""
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value[()]
    if not _is_real(type(value)):
        return math.nan
    try:
        return float(value)  # type: ignore[arg-type]
    except OverflowError:
        return math.nan


def numbers(name: str, value: ArrayLike) -> FloatArray:
    """Copy of ``value`` as float64; raises `InvalidSceneError` unless it holds real numbers in equal rows.

    A string or a truth value is no number, although NumPy would convert it.
    """
    try:
        if isinstance(value, np.ndarray | np.generic) and value.dtype.kind in "iuf":
            return np.array(value, dtype=np.float64)
        items = np.array(value, dtype=object)
        if all(_is_real(kind) for kind in {type(item) for item in items.flat}):
            return items.astype(np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidSceneError(f"{name} must be numbers, not {value!r}") from error
    raise InvalidSceneError(f"{name} must be numbers, not {value!r}")


def finite(name: str, value: ArrayLike, shape: tuple[int, ...]) -> FloatArray:
    """Read-only copy of ``value``, of the given shape and finite, or `InvalidSceneError`."""
    array = numbers(name, value)
    if array.shape != shape:
        raise InvalidSceneError(f"{name} has shape {array.shape}; it must have shape {shape}")
    if not np.all(np.isfinite(array)):
        raise InvalidSceneError(f"{name} must be finite; it holds {array[~np.isfinite(array)][0]}")
    array.setflags(write=False)
    return array


def at_least(name: str, value: object, low: float, *, strict: bool = False) -> float:
    """``value`` as a float; raises `InvalidSceneError` unless it is a finite number ``>= low`` (``> low`` if strict)."""
    number = real(value)
    if not (math.isfinite(number) and (number > low if strict else number >= low)):
        sign = ">" if strict else ">="
        raise InvalidSceneError(f"{name} = {value!r} is not allowed: it must be a finite number {sign} {low:g}")
    return number


def _is_real(kind: type) -> bool:
    return issubclass(kind, Real) and not issubclass(kind, bool)
