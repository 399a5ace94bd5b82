"""Why cells of a run are unsupported: what their engines lack, ranked, and what each should declare first."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from ninedisk.harness.api.capabilities import Capability, wire_name
from ninedisk.harness.results.schema import AS_DEFAULT, Row

MOST_STEPS = 4
"""Entries of a ranking that are printed."""

_NAMES = {str(capability): wire_name(capability) for capability in Capability}


class Ranking(NamedTuple):
    """What would unlock the unsupported cells of an engine.

    ``alone`` has each capability that is all that some cells lack, with their number, most first. ``together`` adds capabilities
    one after the other, those first that unlock most cells each; the number is that of all cells unlocked by then.
    """

    alone: list[tuple[str, int]]
    together: list[tuple[tuple[str, ...], int]]


def as_default(cell: Row) -> bool:
    """Whether a cell did not run because its variant only sets what engines of another kind have, so that it is no gap of the engine."""
    return bool(cell["status"] == "unsupported" and str(cell["reason"]).endswith(AS_DEFAULT))


def missing_capabilities(cell: Row) -> tuple[str, ...]:
    """Names of the capabilities that an unsupported cell lacks, as a description has them; none where its reason is another."""
    if cell["status"] != "unsupported" or as_default(cell):
        return ()
    return tuple(sorted(_NAMES.get(name, name) for name in json.loads(cell["missing"] or "[]")))


def reasons(cells: Iterable[Row]) -> list[tuple[str, int]]:
    """What unsupported cells lack and how many of them, most first; cells that run as the default variant are left out."""
    found: Counter[str] = Counter()
    for cell in cells:
        if cell["status"] == "unsupported" and not as_default(cell):
            names = missing_capabilities(cell)
            found[", ".join(names) if names else str(cell["reason"]).partition("\n")[0]] += 1
    return sorted(found.items(), key=lambda each: (-each[1], each[0]))


def ranking(cells: Iterable[Row]) -> Ranking:
    """Rank what one engine should declare; ``cells`` are all of that engine."""
    sets = Counter(frozenset(names) for cell in cells if (names := missing_capabilities(cell)))
    alone = sorted(
        ((next(iter(each)), n) for each, n in sets.items() if len(each) == 1), key=lambda it: (-it[1], it[0])
    )
    together: list[tuple[tuple[str, ...], int]] = []
    declared: frozenset[str] = frozenset()
    while left := [each - declared for each in sets if each - declared]:

        def gain(more: frozenset[str], declared: frozenset[str] = declared) -> int:
            return sum(n for each, n in sets.items() if each - declared and each <= declared | more)

        best = min(set(left), key=lambda more: (-gain(more) / len(more), len(more), sorted(more)))
        declared |= best
        together.append((tuple(sorted(best)), sum(n for each, n in sets.items() if each <= declared)))
    return Ranking(alone, together)


def ranking_lines(engine: str, cells: Sequence[Row]) -> list[str]:
    """The ranking of an engine in at most two lines; none where nothing that it could declare is lacking."""
    alone, together = ranking([cell for cell in cells if cell["engine"] == engine])
    lines = []
    if alone:
        words = [f"{name} {_cells(count)}" if k == 0 else f"{name} {count}" for k, (name, count) in enumerate(alone)]
        lines.append(f"{engine}: each of these alone would unlock: {_short_list(words)}")
    if len(together) > 1 or (together and not alone):
        words = [f"{' and '.join(names)} {count}" for names, count in together]
        lines.append(f"{engine}: declared in this order, cells unlocked in all: {_short_list(words)}")
    return lines


def _cells(count: int) -> str:
    return f"{count} cell{'' if count == 1 else 's'}"


def _short_list(words: Sequence[str]) -> str:
    return ", ".join(words[:MOST_STEPS]) + (
        f", ... ({len(words) - MOST_STEPS} more)" if len(words) > MOST_STEPS else ""
    )
