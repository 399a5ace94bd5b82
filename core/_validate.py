"""Checks that the parts of a scene share."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.core.errors import InvalidSceneError

FloatArray = NDArray[np.float64]


def numbers(name: str, value: ArrayLike) -> FloatArray:
    """Copy of ``value`` as float64; raises `InvalidSceneError` if it is no number."""
    try:
        return np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidSceneError(f"{name} must be numbers, not {value!r}") from error


def finite(name: str, value: ArrayLike, shape: tuple[int, ...]) -> FloatArray:
    """Read-only copy of ``value``, of the given shape and finite, or `InvalidSceneError`."""
    array = numbers(name, value)
    if array.shape != shape:
        raise InvalidSceneError(f"{name} has shape {array.shape}; it must have shape {shape}")
    if not np.all(np.isfinite(array)):
        raise InvalidSceneError(f"{name} must be finite; it holds {array[~np.isfinite(array)][0]}")
    array.setflags(write=False)
    return array


def at_least(name: str, value: float, low: float, *, strict: bool = False) -> None:
    """Raise `InvalidSceneError` unless ``value >= low`` (``> low`` if strict) and finite."""
    finite(name, value, ())
    bad = not np.isfinite(value) or (value <= low if strict else value < low)
    if bad:
        sign = ">" if strict else ">="
        raise InvalidSceneError(f"{name} = {value!r} is not allowed: it must be finite and {sign} {low:g}")
