"""Values of a TOML, each refused with its place, what is allowed and the way out."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ninedisk.core.array_types import FloatArray
from ninedisk.harness.api.errors import UsageError, close_matches
from ninedisk.harness.audit.scene import LARGEST, Fact


class TomlReader:
    """Values of a TOML with the places where they stand, for messages.

    Parameters
    ----------
    path : Path
        The file; of a text without one, a name for messages.
    keys : mapping
        Every key by its table.
    text : str or None
        None: that of the file.

    Raises
    ------
    UsageError
        If it cannot be read or is no TOML, and by each method for a value that is not allowed: file, line, column, value, allowed form.
    """

    def __init__(self, path: Path, keys: Mapping[str, tuple[str, ...]], text: str | None = None) -> None:
        self.path, self.keys = path, keys
        try:
            self.text = path.read_text(encoding="utf-8-sig") if text is None else text
        except (OSError, UnicodeDecodeError) as error:
            raise UsageError(
                f"{str(path)!r} cannot be read ({getattr(error, 'strerror', None) or 'it is no UTF-8 text'}): give a TOML by --scene "
                "FILE; `ninedisk audit --example DIR` writes one"
            ) from error
        try:
            self.data = tomllib.loads(self.text)
        except tomllib.TOMLDecodeError as error:
            raise UsageError(f"{path} is no TOML: {error}") from error

    def wrong(self, where: str, key: str, value: Any, allowed: str) -> UsageError:
        """The error of a value."""
        return UsageError(f"{self.place(where, key)}: {_dotted_key(where, key)} = {value!r} is not allowed: {allowed}")

    def place(self, where: str, key: str) -> str:
        """File, line and column of a key, as well as they can be found."""
        begin = 0
        if where and (table := re.search(rf"^\s*\[+\s*{re.escape(where)}\b", self.text, re.M)):
            begin = table.start()
        found = re.compile(rf"(?:^|[{{,\[])\s*({re.escape(key)})\s*[=.\]]", re.M).search(self.text, begin)
        at = found.start(1) if found else begin
        line = self.text.count("\n", 0, at) + 1
        return f"{self.path}, line {line}, column {at - (self.text.rfind(chr(10), 0, at) + 1) + 1}"

    def table(self, data: Mapping[str, Any], where: str, key: str) -> Mapping[str, Any]:
        """A table; empty where there is none."""
        value = data.get(key, {})
        if not isinstance(value, dict):
            raise self.wrong(where, key, value, f"it must be a table, [{key}]")
        return value

    def known(self, data: Mapping[str, Any], where: str) -> None:
        """Refuse keys that nobody reads."""
        for key in data:
            if key not in self.keys[where]:
                raise UsageError(
                    f"{self.place(where, key)}: {_dotted_key(where, key)} is no key of an audit: allowed are "
                    f"{', '.join(self.keys[where])}.{close_matches(key, self.keys[where])}"
                )

    def number(
        self, data: Mapping[str, Any], where: str, key: str, *, strict: bool = False, most: float = np.inf
    ) -> float | None:
        """A number >= 0 (> 0), or None."""
        value = data.get(key)
        if value is None:
            return None
        right = isinstance(value, int | float) and not isinstance(value, bool) and np.isfinite(value)
        if not right or value < 0.0 or (strict and value == 0.0) or value > most:
            bound = f" and <= {most:g}" if np.isfinite(most) else ""
            raise self.wrong(where, key, value, f"it must be a number {'>' if strict else '>='} 0{bound}")
        return float(value)

    def vector(self, data: Mapping[str, Any], where: str, key: str, dimension: int) -> FloatArray:
        """So many numbers; zeros where they are not given."""
        value = data.get(key, (0.0,) * dimension)
        try:
            array = np.array(value, dtype=float)
        except (TypeError, ValueError):
            array = np.empty(0)
        if array.shape != (dimension,) or not (np.abs(array) < LARGEST).all():
            example = "two numbers, e.g. [0.0, -9.81]" if dimension == 2 else "three numbers, e.g. [0.0, 0.0, -9.81]"
            raise self.wrong(where, key, value, f"it must be {example}")
        return array

    def flag(self, data: Mapping[str, Any], where: str, key: str) -> bool:
        """True or false; false where it is not given."""
        value = data.get(key, False)
        if not isinstance(value, bool):
            raise self.wrong(where, key, value, "it must be true or false")
        return value

    def fact(self, data: Mapping[str, Any], where: str, key: str) -> Fact | None:
        """A positive number, a list of them, or a table by type."""
        value = data.get(key)
        if value is None:
            return None
        given = list(value.values()) if isinstance(value, dict) else value if isinstance(value, list) else [value]
        right = given and all(
            isinstance(v, int | float) and not isinstance(v, bool) and 0.0 < v < np.inf for v in given
        )
        if not right or (isinstance(value, dict) and not all(re.fullmatch(r"\d+", name) for name in value)):
            raise self.wrong(
                where,
                key,
                value,
                "it must be a number > 0, a list with one a disk (ids in order), or a table by type {1 = 0.01}",
            )
        if isinstance(value, dict):
            return {int(name): float(v) for name, v in value.items()}
        return np.array(value, dtype=float) if isinstance(value, list) else float(value)


def _dotted_key(where: str, key: str) -> str:
    return f"{where}.{key}" if where else key
