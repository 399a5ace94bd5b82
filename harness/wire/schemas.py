"""The wire format as JSON Schema (draft 2020-12), for those who write engines; its version is the wire format's."""

from __future__ import annotations

import json
from functools import cache
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ninedisk.harness.api.errors import UsageError, close_matches
from ninedisk.harness.results.whole_file import write_whole

if TYPE_CHECKING:
    from jsonschema import Draft202012Validator
NAMES = ("describe", "request", "answer", "scene", "numerics", "history")
"""In the order in which the writer of an engine meets them."""


def schema_text(name: str) -> str:
    """The schema as it is published.

    Raises
    ------
    UsageError
        If there is none of this name.
    """
    if name not in NAMES:
        raise UsageError(f"there is no schema {name!r}.{close_matches(name, NAMES)} Schemas: {', '.join(NAMES)}")
    return resources.files(__package__).joinpath("schemas", f"{name}.json").read_text(encoding="utf-8")


def write_schemas(names: tuple[str, ...], folder: Path) -> list[Path]:
    """Write schemas as ``NAME.json`` into a folder, which is made if need be.

    Raises
    ------
    UsageError
        If they cannot be written.
    """
    texts = {folder / f"{name}.json": schema_text(name) for name in names}
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(
            f"--out {str(folder)!r} cannot be written ({error.strerror or error}): give a folder that can"
        ) from error
    for path, text in texts.items():
        write_whole("--out", path, text)
    return list(texts)


@cache
def validator(name: str) -> Draft202012Validator:
    """A validator of one schema that knows the others."""
    from jsonschema import Draft202012Validator
    from referencing import Registry, Resource

    schemas = {each: json.loads(schema_text(each)) for each in NAMES}
    known: Registry[Any] = Registry().with_resources(
        (found["$id"], Resource.from_contents(found)) for found in schemas.values()
    )
    return Draft202012Validator(schemas[name], registry=known)


def fault(name: str, data: Any) -> str | None:
    """Where and how ``data`` breaks a schema, most informative fault first; None if it keeps to it."""
    from jsonschema.exceptions import best_match

    found = best_match(validator(name).iter_errors(data))
    if found is None:
        return None
    place = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in found.absolute_path)
    low, high = (found.schema.get(key) for key in ("minimum", "maximum"))
    within = f" (it must lie between {low} and {high})" if None not in (low, high) else ""
    return f"{place.removeprefix('.') or 'the object'}: {found.message:.300}{within}"
