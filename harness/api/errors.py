"""Mistakes of whoever calls the harness; the command line shows their messages as they stand and exits with 2."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping


class UsageError(ValueError):
    """The caller asked for something impossible; the message names the bad value and the way out."""


class StoreError(UsageError):
    """A store that cannot be written, or a run in it that cannot be read."""


class NewerSchemaError(StoreError):
    """A run that a newer version wrote."""


def close_matches(name: str, known: Iterable[str], shown: Mapping[str, str] | None = None) -> str:
    """``" Did you mean 'a' or 'b'?"``, or an empty string where nothing known comes close.

    Parameters
    ----------
    name : str
        What was given.
    known : iterable of str
        What there is.
    shown : mapping, optional
        What to print in place of some of the known names.
    """
    matches = difflib.get_close_matches(name, list(known), n=3, cutoff=0.5)
    matches = [(shown or {}).get(match, match) for match in matches]
    return f" Did you mean {' or '.join(repr(match) for match in matches)}?" if matches else ""


def not_one_of(what: str, name: str, known: Iterable[str]) -> str:
    """``--form 'np' is unknown: use one of npz, fc2d. Did you mean 'npz'?``; ``what`` is what the name was given for."""
    words = list(known)
    near = close_matches(name, words)
    return f"{what} {name!r} is unknown: use one of {', '.join(words)}{near and '.'}{near}"
