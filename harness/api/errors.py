"""Mistakes of whoever calls the harness; the command line shows their messages as they stand and exits with 2."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class UsageError(ValueError):
    """The caller asked for something impossible; the message names the bad value and the way out."""


class StoreError(UsageError):
    """A store that cannot be written, or a run in it that cannot be read."""


class NewerSchemaError(StoreError):
    """A run that a newer version wrote."""


def close_matches(name: str, known: Iterable[str]) -> str:
    """``" Did you mean 'a' or 'b'?"``, or an empty string where nothing known comes close."""
    matches = difflib.get_close_matches(name, list(known), n=3, cutoff=0.5)
    return f" Did you mean {' or '.join(repr(match) for match in matches)}?" if matches else ""
