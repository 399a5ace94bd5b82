"""Tables in the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table
PIPE_WIDTH = 200
"""Columns where standard output is no terminal: wide enough that ids are not broken up."""


def console() -> Console:
    """A console on standard output."""
    from rich.console import Console

    found = Console(highlight=False, markup=False, emoji=False)
    return found if found.is_terminal else Console(width=PIPE_WIDTH, highlight=False, markup=False, emoji=False)


def table(*headers: str, right: tuple[str, ...] = ()) -> Table:
    """A plain table that folds long text instead of cutting it."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    made = Table(box=SIMPLE_HEAD, pad_edge=False)
    for header in headers:
        made.add_column(header, overflow="fold", justify="right" if header in right else "left")
    return made
