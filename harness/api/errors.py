"""Mistakes of whoever calls the harness; the command line shows their messages unchanged and exits with 2."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping


class UsageError(ValueError):
    """The caller asked for something impossible; the message names the bad value and the way out.

    Examples
    --------
    >>> from ninedisk.harness.api.registry import get_case
    >>> try:
    ...     get_case("binary-colision")
    ... except UsageError as error:
    ...     print(str(error).split(" or ")[0])
    there is no case 'binary-colision'. Did you mean 'binary-collision'
    """


class StoreError(UsageError):
    """A store that cannot be written, or a run in it that cannot be read.

    Examples
    --------
    >>> from pathlib import Path
    >>> from ninedisk.harness.results.reader import read_about
    >>> read_about(Path("nowhere"), "run-1")
    Traceback (most recent call last):
    ninedisk.harness.api.errors.StoreError: the store 'nowhere' has no finished run 'run-1'; `ninedisk runs` lists them
    """


class NewerSchemaError(StoreError):
    """A run that a newer version wrote.

    Examples
    --------
    >>> from ninedisk.harness.results.reader import check_schema
    >>> check_schema("run 'run-1'", 1000)
    Traceback (most recent call last):
    ninedisk.harness.api.errors.NewerSchemaError: run 'run-1' was written with schema 1000, this version reads up to ...
    """


def close_matches(name: str, known: Iterable[str], shown: Mapping[str, str] | None = None) -> str:
    """Return a hint, ``" Did you mean 'a' or 'b'?"``; empty if nothing known comes close.

    Parameters
    ----------
    name : str
        What was given.
    known : iterable of str
        What there is.
    shown : mapping, optional
        What to print in place of some of the known names.

    Returns
    -------
    str

    Examples
    --------
    >>> close_matches("restituton", ["restitution", "mass"])
    " Did you mean 'restitution'?"
    """
    matches = difflib.get_close_matches(name, list(known), n=3, cutoff=0.5)
    matches = [(shown or {}).get(match, match) for match in matches]
    return f" Did you mean {' or '.join(repr(match) for match in matches)}?" if matches else ""


def not_one_of(what: str, name: str, known: Iterable[str]) -> str:
    """Return the message about an unknown name.

    Parameters
    ----------
    what : str
        What the name was given for.
    name : str
        What was given.
    known : iterable of str
        What there is.

    Returns
    -------
    str

    Examples
    --------
    >>> not_one_of("--form", "np", ["npz", "fc2d"])
    "--form 'np' is unknown: use one of npz, fc2d. Did you mean 'npz'?"
    """
    words = list(known)
    near = close_matches(name, words)
    return f"{what} {name!r} is unknown: use one of {', '.join(words)}{near and '.'}{near}"
