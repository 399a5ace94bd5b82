"""Reading and checking of the reference data files."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

ParamValue = float | int | str | bool | None


class ReferenceDataError(ValueError):
    """A reference data file is missing, or its content is not what its format asks for."""


def read_toml(path: Path) -> dict[str, Any]:
    """Content of a TOML file; `ReferenceDataError` if it is missing or no TOML."""
    try:
        with path.open("rb") as file:
            return tomllib.load(file)
    except FileNotFoundError:
        raise ReferenceDataError(f"{path} does not exist") from None
    except (OSError, tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ReferenceDataError(f"{path} cannot be read as TOML: {error}") from error


def check_keys(
    data: object, *, required: Mapping[str, type], optional: Mapping[str, type], where: str
) -> dict[str, Any]:
    """The table itself if it has every required key, no unknown key, and values of the given types.

    ``float`` accepts whole numbers and refuses booleans and non-finite numbers.
    """
    if not isinstance(data, dict):
        raise ReferenceDataError(f"{where}: expected a table, found {data!r}")
    types = {**required, **optional}
    unknown = sorted(set(data) - set(types))
    if unknown:
        raise ReferenceDataError(f"{where}: unknown key {unknown[0]!r}; allowed: {', '.join(sorted(types))}")
    missing = sorted(set(required) - set(data))
    if missing:
        raise ReferenceDataError(f"{where}: the key {missing[0]!r} is missing; required: {', '.join(sorted(required))}")
    for key, value in data.items():
        check_type(value, types[key], where=f"{where}: {key}")
    return data


def check_type(value: object, wanted: type, *, where: str) -> None:
    """Raise `ReferenceDataError` unless the value has the type that its key asks for."""
    if wanted is float:
        right = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    elif wanted is int:
        right = isinstance(value, int) and not isinstance(value, bool)
    else:
        right = isinstance(value, wanted)
    if not right:
        name = {float: "a finite number", int: "a whole number", str: "text", dict: "a table", list: "a list"}[wanted]
        raise ReferenceDataError(f"{where} = {value!r} is not {name}")


def check_selector(selector: Mapping[str, Any], *, where: str) -> None:
    """Raise `ReferenceDataError` unless every entry is a number, text, boolean or a non-empty list of these."""
    for key, wanted in selector.items():
        options = wanted if isinstance(wanted, list) else [wanted]
        if not options or not all(isinstance(option, str | int | float) for option in options):
            raise ReferenceDataError(f"{where}: params.{key} = {wanted!r} is no value and no list of values")


def selects(selector: Mapping[str, Any], params: Mapping[str, Any]) -> bool:
    """Whether a variant's parameters fulfil a selector.

    Every key of the selector must agree exactly; a list means any of its values; the word "none" also means None or a
    parameter that the variant does not have. Parameters that the selector does not name are free.
    """
    for key, wanted in selector.items():
        options = wanted if isinstance(wanted, list) else [wanted]
        if not any(same(option, params.get(key)) for option in options):
            return False
    return True


def same(a: ParamValue, b: ParamValue) -> bool:
    """Exact equality of two parameter values: 1 equals 1.0 but not True, and "none" equals None."""
    a, b = (None if value == "none" else value for value in (a, b))
    return isinstance(a, bool) == isinstance(b, bool) and a == b
