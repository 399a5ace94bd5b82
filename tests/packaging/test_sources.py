"""Sources are finished. (Docstrings of public modules, classes and functions are ruff's business.)"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

UNFINISHED = re.compile(r"\b(TO[D]O|FIX[M]E|X{3}|Not[I]mplementedError)\b")


def test_nothing_is_left_unfinished(sources: dict[str, Path]) -> None:
    found = {module: UNFINISHED.findall(path.read_text(encoding="utf-8")) for module, path in sources.items()}
    assert {module: words for module, words in found.items() if words} == {}


# The samples carry an @ in the middle, so that a search of the tree for such words does not end here.
@pytest.mark.parametrize("line", ["# TO@DO: more", "raise Not@ImplementedError", "x = 1  # FIX@ME", "XX@X here"])
def test_unfinished_lines_are_recognised(line: str) -> None:
    assert UNFINISHED.search(line.replace("@", ""))
