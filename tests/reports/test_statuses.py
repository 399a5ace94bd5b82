"""Statuses on pages, sites and badges: the stored word itself, and a way to its meaning from every page."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from ninedisk.harness.results.schema import CHANGE_VERDICTS, Change, Comparison, RunFacts
from ninedisk.harness.results.statuses import TABLE, VERDICTS
from ninedisk.reports.build import build_report
from ninedisk.reports.site import build_site
from ninedisk.reports.studies import comparison_page

NOT_RUN = ("unsupported", "not-installed")
FAILED = ("fail", "error", "timeout")


def silent(*_: object) -> None:
    pass


def text_of(page: Path) -> str:
    """A page without its markup, each run of white space one blank."""
    return " ".join(re.sub(r"<[^>]*>", " ", page.read_text(encoding="utf-8")).split())


@pytest.fixture(scope="module")
def pages(write: Callable[..., Path], small: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report and a site of one engine for each status; each fails, or is excused, against a printed number."""
    folder = tmp_path_factory.mktemp("statuses")
    tables: dict[str, list[dict[str, Any]]] = {"cells": [], "measurements": [], "claims": []}
    for word in TABLE:
        own = small(f"e-{word}", status=word, reason=f"why {word}", truth="published")
        tables["cells"] += [{**row, "engine_version": "1.0"} for row in own["cells"]]
        tables["measurements"] += [{**row, "engine_version": "1.0"} for row in own["measurements"]]
    write(folder / "store", "a", tables)
    build_report(folder / "store", folder / "report")
    build_site([folder / "store"], folder / "site", silent)
    return folder


@pytest.mark.parametrize("word", TABLE)
def test_pages_print_the_stored_word(pages: Path, word: str) -> None:
    shown = f"{TABLE[word].symbol} {word}"
    assert shown in text_of(pages / "report" / "case" / "demo-one.html")
    assert shown in text_of(pages / "report" / "engine" / f"e-{word}.html")
    index = text_of(pages / "report" / "index.html")
    assert f"{shown} {TABLE[word].meaning.replace('&', '&amp;')}" in index, "in the table of the page itself"
    if word not in (*NOT_RUN, "error", "timeout"):
        assert re.search(rf"\d {word}\b", index), "among the counts of checks"
    if word not in NOT_RUN:
        assert shown in text_of(pages / "site" / "engine" / f"e-{word}" / "1.0" / "demo~one.html")
        assert shown in text_of(pages / "site" / "case" / "demo~one.html")


@pytest.mark.parametrize("word", TABLE)
def test_a_square_has_the_sign_of_its_status(pages: Path, word: str) -> None:
    html = (pages / "report" / "index.html").read_text(encoding="utf-8")
    (square,) = re.findall(rf'<td [^>]*data-engine="E-{word.upper()}">.*?</td>', html, re.DOTALL) or [""]
    if word == "not-installed":
        assert square == ""
    else:
        assert TABLE[word].symbol in square
        assert f'<span class="vh"> {word}</span>' in square


@pytest.mark.parametrize("word", FAILED)
def test_a_badge_names_failures_by_their_status(pages: Path, word: str) -> None:
    assert {each for each, status in TABLE.items() if status.fails} == set(FAILED)
    badge = (pages / "site" / "badge" / f"e-{word}.svg").read_text(encoding="utf-8")
    assert re.search(rf", 1 {word}[,<]", badge)
    assert "1 " + word not in (pages / "site" / "badge" / "e-pass.svg").read_text(encoding="utf-8")


@pytest.mark.parametrize("kind", ["report", "site"])
def test_every_page_leads_to_the_table(pages: Path, kind: str) -> None:
    held = list((pages / kind).rglob("*.html"))
    assert len(held) > 10
    for page in held:
        links = re.findall(r'href="((?:\.\./)*statuses\.html)"', page.read_text(encoding="utf-8"))
        assert links, page
        assert all((page.parent / link).is_file() for link in links)
    table = text_of(pages / kind / "statuses.html").replace("&#39;", "'")
    for word, status in TABLE.items():
        failure = "yes" if status.fails else "no"
        assert f"{status.symbol} {word} {failure} {status.exit_code} {status.meaning}" in table
    for words in VERDICTS.values():
        assert all(f"{word} {meaning}" in table for word, meaning in words.items())


def test_a_page_does_not_contradict_its_own_counts(pages: Path) -> None:
    """A known gap to a printed number is no contradicted claim, and the page says what it is."""
    index = text_of(pages / "report" / "index.html")
    counts = index[index.index("Checks against each engine") :][:400]
    assert "1 known-gap" in counts
    assert "contradicted" not in counts
    assert "No claim of the source is contradicted (0 verdicts stored)" in index
    assert "has the status known-gap : 1 check." in index
    assert "time-out" not in index


def test_a_comparison_has_the_table_on_its_page() -> None:
    """It is one file, so that it has no other page to lead to."""
    facts = RunFacts(run_id="r", started="", commit="", machine="", versions={}, command="")
    place = {
        "case": "c",
        "case_version": 1,
        "variant": "v",
        "engine": "e",
        "quantity": "x",
        "unit": "m",
        "truth": "analytic",
    }
    changes = tuple(
        Change(
            verdict=verdict, kind="error", base=1.0, head=2.0, tolerance=1.5, reason="why",
            base_status="pass", head_status="known-gap", **place,
        )
        for verdict in CHANGE_VERDICTS
    )  # fmt: skip
    html = comparison_page(Comparison(base=facts, head=facts, base_runs=1, head_runs=1, changes=changes, rules=()))
    for word, meaning in VERDICTS["compare"].items():
        assert f"<dt>{word}</dt><dd>{meaning}" in html
        assert (f'<h2 id="{word}">' in html) == (word != "same")
        assert f"1 {word}" in html.replace("1 got worse", "1 worse")
    for status in TABLE.values():
        assert f"{status.symbol} {status.id}</span></dt><dd>{status.meaning}" in html
    assert "pass → known-gap" in html
