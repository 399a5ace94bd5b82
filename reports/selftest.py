"""The page of a self-test: which planted defect which check caught, which checks never fired, what hangs by one thread."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ninedisk.reports import pages
from ninedisk.reports.folder import ReportError

Row = Mapping[str, Any]

CHECK = re.compile(r"(?P<case>[^\[]+)\[(?P<variant>.*)\] (?P<quantity>\S+) \((?P<truth>[^()]+)\)")
LISTED = 12
"""Failing checks of one defect that the page names at once; the rest is folded."""

KINDS = {
    "kernel": "a compiled kernel of the core, code replaced",
    "python": "another module of the core, code replaced",
    "scene": "a right engine on a wrong scene",
    "numerics": "a right engine with wrong numerics",
    "history": "a right engine whose report is wrong",
}


@dataclass(frozen=True, order=True)
class Kind:
    """A check of all variants of a case on one engine."""

    engine: str
    case: str
    quantity: str
    truth: str


@dataclass(frozen=True)
class Matrix:
    """What the page shows of the rows.

    Attributes
    ----------
    cases : list of str
        Columns.
    clean, wrong : list of Row
        Rows of the unchanged engines and of the defects.
    missed, dirty, holes : list of Row
        Defects that nothing caught; unchanged engines that fail; defects that no case is known to see.
    silent : list of Kind
        Kinds of checks that fired on no defect.
    single : list of (Row, str)
        Defects that one check of one variant alone caught, with its id.
    single_case : list of (Row, str)
        Other defects that one case alone caught.
    """

    cases: list[str]
    clean: list[Row]
    wrong: list[Row]
    missed: list[Row]
    dirty: list[Row]
    holes: list[Row]
    silent: list[Kind]
    single: list[tuple[Row, str]]
    single_case: list[tuple[Row, str]]


def selftest_page(rows: Sequence[Row]) -> str:
    """The page of a self-test, one file that holds its style sheet.

    Parameters
    ----------
    rows : sequence of mapping
        As ``ninedisk selftest --json`` writes them.

    Raises
    ------
    ReportError
        If the id of a check cannot be read.
    """
    return (
        pages.environment()
        .get_template("selftest.html")
        .render(
            matrix=matrix(rows),
            kinds=KINDS,
            listed=LISTED,
            sheet=pages.sheet("selftest.css"),
        )
    )


def matrix(rows: Sequence[Row]) -> Matrix:
    """Sort the rows, and find what never fires and what hangs by one check."""
    clean = [row for row in rows if row["kind"] == "clean"]
    wrong = [row for row in rows if row["kind"] != "clean"]
    judged = {kind for row in clean for kind in kinds(row, (*row["passed"], *row["checks"]))}
    fired = {kind for row in wrong for kind in kinds(row, row["checks"])}
    known = {kind.case for kind in judged} | {case for row in rows for case in row["by_case"]}
    one = [(row, row["checks"][0]) for row in wrong if len(row["checks"]) == 1]
    alone = [(row, next(iter(row["by_case"]))) for row in wrong if len(row["by_case"]) == 1 and len(row["checks"]) > 1]
    return Matrix(
        cases=sorted(known),
        clean=clean,
        wrong=wrong,
        missed=[row for row in wrong if not row["caught"] and not row["hole"]],
        dirty=[row for row in clean if row["caught"] or row["errors"]],
        holes=[row for row in wrong if row["hole"]],
        silent=sorted(judged - fired),
        single=one,
        single_case=alone,
    )


def kinds(row: Row, checks: Iterable[str]) -> set[Kind]:
    """Kinds of the named checks of a row.

    Raises
    ------
    ReportError
        If an id is not of the form ``case[variant] quantity (truth)``.
    """
    found = set()
    for check in checks:
        match = CHECK.fullmatch(check)
        if match is None:
            raise ReportError(f"{check!r} is no id of a check: expected case[variant] quantity (truth)")
        found.add(Kind(row["engine"], match["case"], match["quantity"], match["truth"]))
    return found
