"""Strict reading of single fields of the wire format; every message names the key and what was expected."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from types import NoneType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.harness.api.engine import EngineError
from ninedisk.harness.api.text import printable

SETTINGS_DEPTH = 8
"""Levels of lists and objects within settings: more than any table needs."""


class WireError(EngineError):
    """A message does not keep to the wire format; the text names the key and what was expected there."""


def expect_keys(data: Any, keys: Sequence[str], where: str) -> None:
    """Raise `WireError` unless ``data`` is an object with exactly these keys."""
    if not isinstance(data, Mapping):
        raise WireError(f"{where} must be an object with the keys {', '.join(keys)}, not {data!r:.80}")
    missing = [key for key in keys if key not in data]
    if missing:
        raise WireError(f"{where} lacks the key(s) {', '.join(missing)}; expected {', '.join(keys)}")
    unknown = sorted(set(data) - set(keys))
    if unknown:
        raise WireError(f"{where} has the unknown key(s) {', '.join(unknown)}; expected {', '.join(keys)}")


def number(value: Any, name: str, *, low: float) -> float:
    """A finite number not below ``low``."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= sys.float_info.max:
        raise WireError(f"{name} is {value!r}; expected a finite number >= {low:g}")
    return float(value)


def text_field(value: Any, name: str) -> str:
    """A string, without control characters and halves of characters, which no terminal and no file can show."""
    if not isinstance(value, str):
        raise WireError(f"{name} must be a string, not {value!r:.80}")
    return printable(value)


def settings_field(value: Any) -> dict[str, Any]:
    """An object of settings as it can be stored and shown: texts printable, numbers beyond doubles and 64 bits as text."""
    if not isinstance(value, Mapping):
        raise WireError(f"settings must be an object, not {value!r:.80}")
    return {printable(str(key)): _storable(entry, SETTINGS_DEPTH) for key, entry in value.items()}


def _storable(value: Any, depth: int) -> Any:
    if depth == 0:
        raise WireError(f"settings are nested more than {SETTINGS_DEPTH} deep: write them flat, or as text")
    if isinstance(value, str):
        return printable(value)
    if isinstance(value, Mapping):
        return {printable(str(key)): _storable(entry, depth - 1) for key, entry in value.items()}
    if isinstance(value, list):
        return [_storable(entry, depth - 1) for entry in value]
    if isinstance(value, float) and not np.isfinite(value):
        return str(value)
    if isinstance(value, int) and abs(value) >= 1 << 63:
        return f"{value:.17e}" if abs(value) < 10**300 else "beyond a double"
    return value


def step_array(value: Any, expected: NDArray[np.int64]) -> NDArray[np.int64]:
    """The sampled steps, which must be those of the request."""
    if isinstance(value, np.ndarray) and value.ndim == 1 and value.dtype.kind in "iu":
        value = value.tolist()
    if not isinstance(value, list) or any(isinstance(step, bool) or not isinstance(step, int) for step in value):
        raise WireError(f"history.step is {value!r:.80}; expected a list of whole numbers")
    if len(value) != len(expected):
        raise WireError(
            f"history.step has {len(value)} steps; expected the {len(expected)} sampled steps of the request"
        )
    for row, (step, wanted) in enumerate(zip(value, expected.tolist(), strict=True)):
        if step != wanted:
            raise WireError(f"history.step[{row}] is {step}; expected the sampled step {wanted}")
    return np.array(value, dtype=np.int64)


def float_array(value: Any, name: str, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Nested lists of numbers, null meaning NaN, as an array of this shape; null alone is an array of NaN.

    An array, as a file has it, is checked likewise.

    Raises
    ------
    WireError
        On another shape, ragged lists, or anything that is neither a number nor null.
    """
    if value is None:
        return np.full(shape, np.nan)
    if not isinstance(value, list | np.ndarray):
        raise WireError(f"{name} is {value!r:.80}; expected nested lists of numbers of shape {shape}")
    try:
        raw = np.array(value)
    except ValueError as error:
        raise WireError(f"{name} has rows of different lengths; expected nested lists of shape {shape}") from error
    if raw.size == 0 and 0 in shape and raw.shape == shape[: raw.ndim]:
        return np.empty(shape)
    if raw.shape != shape:
        raise WireError(f"{name} has shape {raw.shape}; expected {shape}")
    kinds = {type(entry) for entry in _entries(value, len(shape))}
    if not kinds <= {int, float, NoneType}:
        odd = next(entry for entry in _entries(value, len(shape)) if type(entry) not in (int, float, NoneType))
        raise WireError(f"{name} holds {odd!r:.80}; expected numbers, or null for what was not observed")
    try:
        return np.array(value, dtype=np.float64)
    except OverflowError:
        raise WireError(f"{name} holds a whole number beyond the range of a double") from None


def _entries(value: Any, depth: int) -> Iterable[Any]:
    """Entries of regular nested lists, as Python objects: NumPy would take true for 1 beside numbers."""
    if isinstance(value, np.ndarray):
        return [] if value.dtype.kind in "iuf" else value.astype(object).flat
    for _ in range(depth - 1):
        value = chain.from_iterable(value)
    return value  # type: ignore[no-any-return]
