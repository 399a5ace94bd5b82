"""What readers of binary files share: vectors as named columns, roundings by precision, edges of boxes."""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.api.text import one_line
from ninedisk.harness.audit.readers.columns import column_names
from ninedisk.harness.audit.readers.rounding import Rounding


def library(name: str, extra: str, path: Path) -> Any:
    """The module that reads a file.

    Raises
    ------
    UsageError
        If it is not installed, naming the extra.
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise UsageError(
            f"{str(path)!r} needs the package {name.partition('.')[0]}, which is missing: install ninedisk[{extra}]"
        ) from error


@contextmanager
def readable(path: Path, form: str) -> Iterator[None]:
    """What libraries raise on a damaged file, in words; their kinds of errors are many.

    Raises
    ------
    UsageError
        Naming the file.
    """
    try:
        yield
    except UsageError:
        raise
    except (
        OSError,
        RuntimeError,
        ValueError,
        TypeError,
        LookupError,
        AttributeError,
        ArithmeticError,
        MemoryError,
    ) as error:
        raise UsageError(
            f"{path} is no {form} that can be read ({error}): cut off, damaged or still being written"
        ) from error


def split_vector(name: str, array: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """A column, or those of a vector as ``name:0``, ``name:1`` and so on."""
    if array.ndim == 1:
        return {name: array}
    return {f"{name}:{k}": array[:, k] for k in range(array.shape[1])}


def vector_names(name: str, parts: int) -> list[str]:
    """Names that `split_vector` gives; ``parts`` 0: it is no vector."""
    return [f"{name}:{k}" for k in range(parts)] if parts else [name]


def found_columns(
    names: Sequence[str], columns: Mapping[str, str], path: Path, needed: Sequence[str]
) -> dict[str, str]:
    """Name in the file -> name here; a needed one that lacks is an error."""
    found = column_names(names, columns, path)
    if lacking := [name for name in needed if name not in found.values()]:
        raise UsageError(
            f"{path}: there is no {' and no '.join(lacking)} among {one_line(', '.join(names))[:300] or 'nothing'}: name it in the TOML, "
            f'[columns] {lacking[0]} = "NAME"'
        )
    return found


def unread(names: Sequence[str], found: Mapping[str, str]) -> list[str]:
    """A remark on what a file has and no check uses."""
    left = list(dict.fromkeys(name.partition(":")[0] for name in names if name not in found))
    return [f"not used: {', '.join(left)}"] if left else []


def precision(array: Any) -> Rounding:
    """Rounding of an array by its kind of number."""
    return Rounding(bits=24 if np.dtype(array.dtype) == np.float32 else 53)


def oblique_edges(lengths: FloatArray, angles: FloatArray) -> FloatArray:
    """Edges (rows) out of lengths and angles [degrees] between b and c, a and c, a and b; the first along x, the second in x-y."""
    alpha, beta, gamma = np.where(angles == 90.0, 0.0, np.cos(np.radians(angles)))
    sine = np.sqrt(1.0 - gamma**2)
    with np.errstate(
        divide="ignore", invalid="ignore"
    ):  # angles of a damaged file have no cell: NaN, which is refused by name
        across = (alpha - beta * gamma) / sine
    up = np.sqrt(max(1.0 - beta**2 - across**2, 0.0))
    units = np.array([(1.0, 0.0, 0.0), (gamma, sine, 0.0), (beta, across, up)])
    return np.asarray(np.asarray(lengths, dtype=float)[:, None] * units)
