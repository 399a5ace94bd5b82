"""Findings: what an engine, or a source, is known to do otherwise than the physics or its own documentation says.

A finding holds no measured number: its size is read from the store, so that it can be seen to be still there, gone or larger.
The findings of an engine stand beside its adapter (``harness/engines/<engine>/findings.py``, a tuple ``FINDINGS``).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, kw_only=True)
class Size:
    """Where the size of a finding stands in a store: the largest value of a column over the rows that match.

    Parameters
    ----------
    table : {"measurements", "headlines", "cells"}
        Table of `ninedisk.harness.results.schema`.
    case, variant : str
        Id of the case, and a glob of its variants' ids.
    column : str
        Column that is read, such as ``abs_error``, ``rel_error`` or ``value``; its absolute value counts.
    quantity : str
        Quantity of the row, or the headline's name; empty for ``cells``.
    truth : str
        Kind of truth of a measurement, "" for any.
    over : float
        The finding is there while the size is larger than this, in the column's unit.
    over_why : str
        Why that and no other number: round-off, the order of the scheme, what a right engine shows.
    """

    table: Literal["measurements", "headlines", "cells"]
    case: str
    column: str
    over: float
    over_why: str
    quantity: str = ""
    variant: str = "*"
    truth: str = ""


@dataclass(frozen=True, kw_only=True)
class Finding:
    """What is otherwise than it should be, and how to see it.

    Parameters
    ----------
    id : str
        ``<engine>/<words>``, as in ``kratos-dem/arm-at-walls``; ``source/<words>`` for errata of the source.
    engine : str
        Id of the engine; the engine that shows it where the source is wrong.
    versions : str
        Versions in which it was seen.
    what : str
        What happens, in one sentence.
    size : Size
        How large it is.
    documented : str
        Where the engine's documentation says so; "" where it does not.
    thread : str
        Address of an upstream issue or discussion; "" where none is known.
    command : str
        Complete ``ninedisk`` command that shows it.
    """

    id: str
    engine: str
    versions: str
    what: str
    size: Size
    documented: str
    thread: str
    command: str
