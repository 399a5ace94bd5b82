"""Strict reading of single fields of the wire format; every message names the key and what was expected."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.harness.engine import EngineError


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
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value) or value < low:
        raise WireError(f"{name} is {value!r}; expected a finite number >= {low:g}")
    return float(value)


def step_array(value: Any, expected: NDArray[np.int64]) -> NDArray[np.int64]:
    """The sampled steps, which must be those of the request."""
    if not isinstance(value, list) or any(isinstance(step, bool) or not isinstance(step, int) for step in value):
        raise WireError(f"history.step is {value!r:.80}; expected a list of whole numbers")
    if len(value) != len(expected):
        raise WireError(
            f"history.step has {len(value)} steps; expected the {len(expected)} sampled steps of the request"
        )
    steps = np.array(value, dtype=np.int64)
    if (steps != expected).any():
        row = int(np.argmax(steps != expected))
        raise WireError(f"history.step[{row}] is {steps[row]}; expected the sampled step {expected[row]}")
    return steps


def float_array(value: Any, name: str, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Nested lists of numbers, null meaning NaN, as an array of this shape; null alone is an array of NaN.

    Raises
    ------
    WireError
        On another shape, ragged lists, or anything that is neither a number nor null.
    """
    if value is None:
        return np.full(shape, np.nan)
    if not isinstance(value, list):
        raise WireError(f"{name} is {value!r:.80}; expected nested lists of numbers of shape {shape}")
    try:
        raw = np.array(value)
    except ValueError as error:
        raise WireError(f"{name} has rows of different lengths; expected nested lists of shape {shape}") from error
    if raw.size == 0 and 0 in shape and raw.shape == shape[: raw.ndim]:
        return np.empty(shape)
    if raw.shape != shape:
        raise WireError(f"{name} has shape {raw.shape}; expected {shape}")
    if raw.dtype.kind not in "iuf":
        for entry in np.array(value, dtype=object).flat:
            if entry is not None and (isinstance(entry, bool) or not isinstance(entry, int | float)):
                raise WireError(f"{name} holds {entry!r:.80}; expected numbers, or null for what was not observed")
    return np.array(value, dtype=np.float64)
