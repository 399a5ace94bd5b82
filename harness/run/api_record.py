"""What the API reference says of every public object, taken from its docstring and signature; plain data for the pages."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import logging
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from enum import Enum
from typing import TYPE_CHECKING, Any

import ninedisk
from ninedisk.harness.results.schema import Row

if TYPE_CHECKING:
    import griffe

MODULES = (
    "ninedisk.core",
    "ninedisk.core.shapes",
    *(
        f"ninedisk.harness.api.{name}"
        for name in (
            *("case", "params", "claims", "engine", "capabilities", "support", "wall_path"),
            *("finding", "shared_findings", "registry", "errors", "text"),
        )
    ),
)
"""Modules with public objects, in the order of the reference."""

KINDS = {
    "positional_only": "positional-only",
    "positional_or_keyword": "positional or keyword",
    "var_positional": "variadic positional",
    "keyword_only": "keyword-only",
    "var_keyword": "variadic keyword",
}
"""Kinds of parameters of `inspect`, and griffe's names for them."""

ORDER = {"function": 0, "exception": 2}
"""Place of a kind of object in its module; others are 1."""

WIDE = 100
"""Characters of a signature on one line; a longer one has a line for each parameter."""


def public_objects(module: str) -> dict[str, Any]:
    """Return the public classes and functions of a module by name: those in ``__all__``, else those that it defines.

    Parameters
    ----------
    module : str
        Dotted name.
    """
    found = importlib.import_module(module)
    names = getattr(found, "__all__", None)
    if names is not None:
        return {name: getattr(found, name) for name in sorted(names)}
    objects = {name: value for name, value in vars(found).items() if not name.startswith("_")}
    return {
        name: value
        for name, value in objects.items()
        if callable(value) and getattr(value, "__module__", "") == module and hasattr(value, "__qualname__")
    }


def api_record(modules: Sequence[str] = MODULES) -> list[Row]:
    """Return a record of every module: ``name, about, objects``.

    Each object has ``name, alias, home, kind, signature, place, sections, members, warnings``; ``sections`` are what its docstring
    says, in order.

    Parameters
    ----------
    modules : sequence of str
        Dotted names.
    """
    record = []
    for name in modules:
        objects = [object_record(each, value) for each, value in public_objects(name).items()]
        objects.sort(key=lambda each: ORDER.get(each["kind"], 1))
        record.append(
            {"name": name, "about": inspect.cleandoc(importlib.import_module(name).__doc__ or ""), "objects": objects}
        )
    return record


def object_record(name: str, value: Any) -> Row:
    """Return the record of one public object.

    Parameters
    ----------
    name : str
        Its public name.
    value : class or function
    """
    home = inspect.unwrap(value)
    is_class = inspect.isclass(value)
    sections, warnings = parsed(value)
    members = list(_members(value)) if is_class else []
    return {
        "name": name,
        "alias": home.__name__ if home.__name__ != name else "",
        "home": f"{home.__module__}.{home.__qualname__}",
        "kind": _kind(value),
        "signature": _signature(name, value),
        "place": _place(home),
        "sections": sections,
        "members": members,
        "warnings": [*warnings, *(each for member in members for each in member.pop("warnings"))],
    }


def parsed(value: Any) -> tuple[list[Row], list[str]]:
    """Return the sections of an object's docstring, and what is wrong with it.

    Parameters
    ----------
    value : class, function or property
        A parameter that a class documents as that of a base gets the base's text.

    Returns
    -------
    list of Row
        Each has ``kind``: "text" (``text``), "items" (``title``, ``items``) or "examples" (``parts``).
    list of str
        Warnings of the parser, of parameters without a text as well.
    """
    parameters = _parameters(value)
    with _warnings() as warnings:  # first with the signature, against which names are held; then for the text
        _sections(value, parameters)
    sections = [_section(each) for each in _sections(value, None)]
    given: list[Row] = next((each["items"] for each in sections if each.get("title") == "Parameters"), [])
    inherited = _inherited(value)
    for item in given:
        if item["text"].startswith("As in `") and item["name"] in inherited:
            item |= inherited[item["name"]]
        item["default"] = _default(value, parameters, item["name"])
    for name in set(parameters) - {item["name"].lstrip("*") for item in given}:
        warnings.append(f"{getattr(value, '__qualname__', value)}: no text for the parameter {name!r}")
    return sections, warnings


def _sections(value: Any, parameters: Mapping[str, inspect.Parameter] | None) -> list[griffe.DocstringSection]:
    import griffe

    text = inspect.cleandoc(value.__doc__ or "")
    if parameters is None:
        return griffe.Docstring(text).parse("numpy", warnings=False)
    listed = [
        griffe.Parameter(
            each.name, annotation=str(each.annotation), kind=griffe.ParameterKind(KINDS[each.kind.name.lower()])
        )
        for each in parameters.values()
    ]
    name = getattr(value, "__qualname__", "property")
    parent = griffe.Function(name, parameters=griffe.Parameters(*listed), returns="returned")
    return griffe.Docstring(text, parent=parent).parse("numpy")


def _section(section: griffe.DocstringSection) -> Row:
    kind = section.kind.value
    if kind == "text":
        return {"kind": "text", "text": section.value}
    if kind == "examples":
        return {"kind": "examples", "parts": [(part.value, text) for part, text in section.value]}
    items = [
        {"name": getattr(each, "name", ""), "type": str(each.annotation or ""), "text": each.description, "default": ""}
        for each in section.value
    ]
    return {"kind": "items", "title": kind.capitalize(), "items": items}


@contextmanager
def _warnings() -> Iterator[list[str]]:
    """Collect what griffe logs."""
    found: list[str] = []

    class Collect(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            found.append(record.getMessage())

    logger, handler = logging.getLogger("griffe"), Collect(logging.WARNING)
    logger.addHandler(handler)
    before, logger.propagate = logger.propagate, False
    try:
        yield found
    finally:
        logger.removeHandler(handler)
        logger.propagate = before


def _inherited(value: Any) -> dict[str, Row]:
    """Parameters that the bases of a class document, by name; the nearest base counts."""
    found: dict[str, Row] = {}
    for base in value.__mro__[1:] if inspect.isclass(value) else ():
        if base.__module__.startswith("ninedisk") and base.__doc__:
            for section in map(_section, _sections(base, None)):
                if section.get("title") == "Parameters":
                    for item in section["items"]:
                        found.setdefault(item["name"], {"type": item["type"], "text": item["text"]})
    return found


def _parameters(value: Any) -> dict[str, inspect.Parameter]:
    """Parameters that a caller gives, by name."""
    if isinstance(value, property) or (inspect.isclass(value) and not _made_by_call(value)):
        return {}
    found = dict(inspect.signature(value).parameters)
    return {name: each for name, each in found.items() if name not in ("self", "cls")}


def _made_by_call(value: type) -> bool:
    """Whether a class has a signature worth showing: enumerations, protocols and plain errors have none."""
    return not (
        issubclass(value, Enum)
        or getattr(value, "_is_protocol", False)
        or (issubclass(value, BaseException) and "__init__" not in vars(value))
    )


def _kind(value: Any) -> str:
    if not inspect.isclass(value):
        return "function"
    if issubclass(value, BaseException):
        return "exception"
    return (
        "enumeration" if issubclass(value, Enum) else "protocol" if getattr(value, "_is_protocol", False) else "class"
    )


def _default(value: Any, parameters: Mapping[str, inspect.Parameter], name: str) -> str:
    """Default of a parameter as code; empty where it has none."""
    default = parameters[name].default if name in parameters else inspect.Parameter.empty
    if default is inspect.Parameter.empty:
        return ""
    fields = {each.name: each for each in dataclasses.fields(value)} if dataclasses.is_dataclass(value) else {}
    factory = fields[name].default_factory if name in fields else dataclasses.MISSING
    if callable(factory):
        default = factory()
    return repr(default.value) if isinstance(default, Enum) else repr(default)


def _signature(name: str, value: Any, *, bound: bool = False) -> str:
    """Code that calls an object, with types and defaults."""
    if isinstance(value, property):
        returned = inspect.signature(value.fget).return_annotation if value.fget else ""
        return f"{name}: {_annotation(returned)}"
    if inspect.isclass(value) and not _made_by_call(value):
        bases = [base.__name__ for base in value.__bases__ if base is not object]
        return f"class {name}({', '.join(bases)})" if bases else f"class {name}"
    signature = inspect.signature(value)
    parts: list[str] = []
    keyword_only = False
    for each in list(signature.parameters.values())[int(bound) :]:
        if each.kind is each.KEYWORD_ONLY and not keyword_only:
            parts.append("*")
            keyword_only = True
        star = "*" if each.kind is each.VAR_POSITIONAL else "**" if each.kind is each.VAR_KEYWORD else ""
        keyword_only = keyword_only or star == "*"
        text = f"{star}{each.name}"
        if each.annotation is not each.empty:
            text += f": {_annotation(each.annotation)}"
        default = _default(value, signature.parameters, each.name)
        parts.append(f"{text} = {default}" if default else text)
    head = f"class {name}" if inspect.isclass(value) else name
    returned = signature.return_annotation
    tail = "" if inspect.isclass(value) or returned is signature.empty else f" -> {_annotation(returned)}"
    line = f"{head}({', '.join(parts)}){tail}"
    return line if len(line) <= WIDE else "\n".join([f"{head}(", *(f"    {part}," for part in parts), f"){tail}"])


def _annotation(annotation: Any) -> str:
    return annotation if isinstance(annotation, str) else getattr(annotation, "__name__", str(annotation))


def _place(value: Any) -> str:
    """File, from the top of the source tree, and line of an object."""
    module = importlib.import_module(value.__module__)
    parts = value.__module__.split(".")[1:]
    path = "/".join(parts) + ("/__init__.py" if hasattr(module, "__path__") else ".py")
    return f"{path}, line {inspect.getsourcelines(value)[1]}"


def _members(cls: type) -> Iterator[Row]:
    """Records of the values of an enumeration, and of the public methods and properties that are ours, inherited ones too."""
    if issubclass(cls, Enum):
        for member in cls:
            yield _member(member.name, "value", f"{member.name} = {member.value!r}", [], [])
    seen = set()
    for base in cls.__mro__:
        if not base.__module__.startswith(f"{ninedisk.__name__}."):
            continue
        for name, raw in vars(base).items():
            if name.startswith("_") or name in seen:
                continue
            seen.add(name)
            value = raw.__func__ if isinstance(raw, classmethod | staticmethod) else raw
            if isinstance(value, property) or inspect.isfunction(value):
                kind = (
                    "property"
                    if isinstance(value, property)
                    else "class method"
                    if isinstance(raw, classmethod)
                    else "method"
                )
                sections = [_section(each) for each in _sections(value, None)]
                with _warnings() as warnings:
                    _sections(value, _parameters(value))
                yield _member(name, kind, _signature(name, value, bound=kind != "property"), sections, warnings)


def _member(name: str, kind: str, signature: str, sections: list[Row], warnings: list[str]) -> Row:
    return {"name": name, "kind": kind, "signature": signature, "sections": sections, "warnings": warnings}
