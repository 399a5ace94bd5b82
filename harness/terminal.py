"""What is printed on a terminal: the console, tables, relative errors."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderResult
    from rich.table import Table

PIPE_WIDTH = 200
"""Columns where standard output is no terminal: wide enough that ids are not broken up."""

FOLDED = 8
"""Columns of a terminal that folded text should have at least."""


def console() -> Console:
    """A console on standard output."""
    from rich.console import Console

    found = Console(highlight=False, markup=False, emoji=False)
    return found if found.is_terminal else Console(width=PIPE_WIDTH, highlight=False, markup=False, emoji=False)


def table(*headers: str, right: tuple[str, ...] = (), whole: tuple[str, ...] = ()) -> Table:
    """A plain table that folds long text instead of cutting it; columns of words that stay ``whole`` leave the folding to the others.

    On a terminal too narrow for these columns they are folded, too: no text is lost.
    """
    from rich.box import SIMPLE_HEAD
    from rich.cells import cell_len
    from rich.table import Table

    class Folding(Table):
        def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
            widths = [max(cell_len(str(cell)) for cell in (column.header, *column.cells)) for column in self.columns]
            least = sum(
                width if column.no_wrap else min(width, FOLDED)
                for width, column in zip(widths, self.columns, strict=True)
            )
            if least + len(widths) > options.max_width:
                for column in self.columns:
                    column.no_wrap, column.min_width = False, None
            return super().__rich_console__(console, options)

    made = Folding(box=SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    for header in headers:
        made.add_column(
            header,
            overflow="fold",
            justify="right" if header in right else "left",
            no_wrap=header in whole,
            min_width=len(header),
        )
    return made


def share(error: float) -> str:
    """A relative error, three digits: in percent as long as that is readable; ``-`` for no number."""
    return "-" if math.isnan(error) else f"{100.0 * error:.3g} %" if 1e-5 <= error < 9.995 else f"{error:.2g}"
