"""Tables lose no text, however narrow the terminal."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from ninedisk.harness.terminal import table

RUN = "20261127T235859Z-1a2b3c4d"
ROW = (RUN, "2026-11-27 23:58", "c47cf1dc0123", "a machine of ours", "dem, cd", "12 pass")


@pytest.mark.parametrize("width", [20, 30, 40, 60, 80, 120])
def test_words_that_stay_whole_are_folded_where_nothing_else_helps(width: int) -> None:
    shown = table("run", "started", "commit", "machine", "engines", "cells", whole=("run", "started", "commit"))
    shown.add_row(*ROW)
    out = io.StringIO()
    Console(file=out, width=width, highlight=False).print(shown)
    lines = out.getvalue().splitlines()
    assert max(map(len, lines)) <= width
    rule = next(row for row, line in enumerate(lines) if "─" in line)
    letters = "".join("".join(lines[rule + 1 :]).split())
    assert sorted(letters) == sorted("".join("".join(ROW).split()))
    if width >= 100:
        assert any(RUN in line for line in lines)
