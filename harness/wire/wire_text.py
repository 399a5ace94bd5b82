"""From the text of a message to its JSON object; what is wrong with a bad one is said in words that help to mend it."""

from __future__ import annotations

import json
import re
from typing import Any

from ninedisk.harness.wire.wire_fields import WireError

WIRE_VERSION = 1

_BARE_NUMBER = re.compile(r"[\[,:]\s*[-+]?(nan|inf(?:inity)?)\b", re.IGNORECASE)
_OBJECT = re.compile(r'\{\s*"')
_NEAR = 30


def parse_message(text: str, what: str) -> dict[str, Any]:
    """The JSON object of this wire version that ``text`` holds; ``what`` names the message in errors.

    Raises
    ------
    WireError
        Where there is none; the text says what is there in its place.
    """
    if not text.strip():
        raise WireError(f"the {what} is empty; expected one JSON object")
    try:
        data = json.loads(text)
    except ValueError as error:
        raise WireError(
            f"the {what} is not JSON, or was cut off ({error}); it has {len(text)} characters, begins with "
            f"{text[:60]!r} and ends with {text[-60:]!r}{_advice(text, error)}"
        ) from error
    except RecursionError:
        raise WireError(f"the {what} is nested too deeply; expected one JSON object") from None
    if not isinstance(data, dict):
        raise WireError(f"the {what} must be a JSON object, not {type(data).__name__}")
    version = data.get("wire_version")
    if version != WIRE_VERSION or isinstance(version, bool):
        raise WireError(f"wire_version of the {what} is {version!r}; this harness speaks version {WIRE_VERSION}")
    return data


def _advice(text: str, error: ValueError) -> str:
    """What probably happened, and the way out; empty where nothing is recognised."""
    found = _OBJECT.search(text)
    begin = found.start() if found else -1
    if begin > 0 and text[:begin].strip() and _object_ends(text, begin) is not None:
        return "; other text stands before the JSON object: print messages on standard error"
    end = _object_ends(text, begin) if begin >= 0 else None
    if end is not None:
        return (
            f"; other text follows the JSON object ({text[end:].strip()[:_NEAR]!r}): print messages on standard error"
        )
    at = getattr(error, "pos", 0)
    near = text[max(0, at - _NEAR) : at + _NEAR]
    if _BARE_NUMBER.search(near):
        return f"; near {near!r}: JSON has no NaN or infinity; write null for a number that cannot be observed"
    return f"; the fault is near {near!r}" if 0 < at < len(text) else ""


def _object_ends(text: str, begin: int) -> int | None:
    """Where the JSON object that begins at ``begin`` ends; None if there is none."""
    try:
        _, end = json.JSONDecoder().raw_decode(text, begin)
    except (ValueError, RecursionError):
        return None
    return end
