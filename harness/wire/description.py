"""What an engine says about itself on ``describe``, read and checked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ninedisk.core.errors import InvalidNumericsError
from ninedisk.core.options import Option
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.api.text import printable
from ninedisk.harness.wire.schemas import fault
from ninedisk.harness.wire.wire_fields import WireError
from ninedisk.harness.wire.wire_text import parse_message

SCHEME_OPTIONS = {"moreau-jean": "theta", "runge-kutta-3": "phase"}
"""Schemes whose truths read an option of the engine."""

NOTE_SOFT = "contacts are soft in a way of the engine's own"

_TRAITS = (
    "turns_shear",
    "fixed_wall_shear",
    "keeps_opened_shear",
    "dilates",
    "friction_lags",
    "softness",
    "softness_why",
    "keeps_kn",
    "impact_as_springs",
    "normal_turns_in_impact",
    "precision",
    "threads",
)

_ARMS = ("turns_exactly_with", "arms_at_walls")
"""Traits that are sets of lever arms."""


@dataclass(frozen=True)
class Description:
    """Facts about an engine, and in what it only comes near to any scene."""

    info: EngineInfo
    approximations: tuple[str, ...]


def wire_name(capability: Capability) -> str:
    """Name of a capability in a description: ``linear-contact``."""
    return capability.name.lower().replace("_", "-")


def read_description(text: str, *, how_it_runs: str) -> Description:
    """The description in what an engine printed.

    Parameters
    ----------
    text : str
        Standard output of ``ENGINE describe``.
    how_it_runs : str
        For reports; the command.

    Raises
    ------
    WireError
        Naming the key at fault and what was expected there.
    """
    data = parse_message(text, "description")
    if wrong := fault("describe", data):
        raise WireError(f"the description breaks its schema at {wrong}; see: ninedisk schema describe")
    options = {name: _option(f"{data['id']}.{name}", given) for name, given in data.get("options", {}).items()}
    asked = SCHEME_OPTIONS.get(data["scheme"])
    if asked is not None and asked not in options:
        raise WireError(
            f"the scheme {data['scheme']!r} needs the option {asked!r}: describe it, or name another scheme"
        )
    names = {wire_name(capability): capability for capability in Capability}
    traits: dict[str, Any] = {"precision": "float64", "threads": 1}
    traits |= {trait: data[trait] for trait in _TRAITS if trait in data}
    traits |= {trait: frozenset(names[name] for name in data[trait]) for trait in _ARMS if trait in data}
    out_of_scope = {names[name]: printable(link) for name, link in data.get("out_of_scope", {}).items()}
    both = sorted(set(data["capabilities"]) & set(data.get("out_of_scope", {})))
    if both:
        raise WireError(
            f"the description has {both[0]!r} among capabilities and out_of_scope: leave it out of one of them"
        )
    info = EngineInfo(
        id=data["id"],
        name=printable(data.get("name", data["id"])),
        version=None if data["version"] is None else printable(data["version"]),
        scheme=printable(data["scheme"]),
        contact=data["contact"],
        licence=printable(data.get("licence", "not stated")),
        how_it_runs=how_it_runs,
        install=printable(data.get("install", "given by --engine-cmd")),
        not_installed_because="its description gives no version" if data["version"] is None else "",
        capabilities=frozenset(names[name] for name in data["capabilities"]),
        options=options,
        out_of_scope=out_of_scope,
        **traits,
    )
    near = tuple(printable(text) for text in data.get("approximations", ()))
    return Description(info, near or (NOTE_SOFT,) if info.contact == "soft" else near)


def _option(name: str, given: Mapping[str, Any]) -> Option:
    if "choices" in given:
        option = Option(default=given["default"], why=printable(given["why"]), choices=tuple(given["choices"]))
    else:
        rest = {key: value for key, value in given.items() if key not in ("default", "why", "none")}
        meaning = printable(given.get("none", ""))
        option = Option(default=given["default"], why=printable(given["why"]), none=meaning, **rest)
    try:
        option.checked(name, option.default)
    except InvalidNumericsError as error:
        raise WireError(f"the description's default does not fit: {error}") from error
    return option
