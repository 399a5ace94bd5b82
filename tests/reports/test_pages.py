"""The whole panel's pages: links, order, weight, alternatives."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from ninedisk.reports.build import build_report
from ninedisk.reports.panel.load import load_store
from ninedisk.reports.panel.model import build_panel
from ninedisk.reports.panel.ranking import percent


class Page(HTMLParser):
    """Collects what the tests ask of a page."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.ids: set[str] = set()
        self.images: list[dict[str, str | None]] = []
        self.tags: set[str] = set()
        self.attributes: set[str] = set()
        self.scripts: list[str] = []
        self.inline_scripts = 0
        self.charts: list[dict[str, str | None]] = []
        self.keys: set[str] = set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        held = dict(attrs)
        self.tags.add(tag)
        self.attributes |= set(held)
        self.links += [held[name] for name in ("href", "src") if name in held]
        if held.get("id"):
            self.ids.add(held["id"])
        if "data-chart" in held:
            self.charts.append(held)
        if "data-key" in held:
            self.keys.add(held["data-key"])
        if tag == "script":
            self.scripts += [held["src"]] if "src" in held else []
            self.inline_scripts += "src" not in held
        if tag == "img":
            self.images.append(held)


@pytest.fixture(scope="module")
def pages(panel_report):
    return {path: Page(path) for path in panel_report.rglob("*.html")}


def test_every_link_leads_to_a_file_of_the_report(panel_report, pages):
    assert len(pages) == 3 + 6 + 6
    for path, page in pages.items():
        for link in page.links:
            parts = urlsplit(link)
            assert not parts.scheme, link
            assert not parts.netloc, link
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            assert target.is_file(), (path, link)
            assert target.is_relative_to(panel_report.resolve())
            if parts.fragment:
                assert parts.fragment in pages[target].ids, (path, link)


def test_scripts_are_files_of_the_report_and_nothing_else_runs(panel_report, pages):
    for path, page in pages.items():
        assert not {name for name in page.attributes if name.startswith("on")}
        for source in page.scripts:
            target = (path.parent / source).resolve()
            assert target.parent in (panel_report.resolve() / "assets", panel_report.resolve() / "data")
        assert page.inline_scripts == 0
    for path in panel_report.rglob("*.css"):
        assert not re.search(r"@import|url\(", path.read_text(encoding="utf-8"))
    licence = (panel_report / "assets" / "uplot-LICENSE.txt").read_text(encoding="utf-8")
    assert "Permission is hereby granted" in licence


def test_every_chart_has_a_text_alternative_and_legends_know_their_engines(pages):
    charts = [held for page in pages.values() for held in page.charts]
    assert len(charts) > 100
    for held in charts:
        assert len(held["data-alt"]) > 20
        assert json.loads(held["data-chart"])["kind"] in ("history", "points")
    keys = {key for page in pages.values() for key in page.keys}
    assert {"dem", "yade", "reference analytic: closed form"} <= keys


def test_every_figure_is_used_and_has_a_text_alternative(panel_report, pages):
    used = set()
    for path, page in pages.items():
        for image in page.images:
            assert len(image["alt"]) > 20
            assert int(image["width"]) > 100
            assert int(image["height"]) > 100
            used.add((path.parent / image["src"]).resolve())
        saved = re.findall(r'href="([^"]+)" download', path.read_text(encoding="utf-8"))
        used |= {(path.parent / name).resolve() for name in saved}
    assert used == {path.resolve() for path in (panel_report / "figures").iterdir()}


def test_pages_are_light(panel_report):
    assert (panel_report / "index.html").stat().st_size < 300_000
    assert sum(path.stat().st_size for path in panel_report.rglob("*") if path.is_file()) < 15_000_000
    assert max(path.stat().st_size for path in panel_report.rglob("*.html")) < 1_000_000


def test_overview_ranks_the_worst_first(panel_store, panel_report):
    rows = build_panel(load_store(panel_store)).worst_of_pairs()
    html = (panel_report / "index.html").read_text(encoding="utf-8")
    table = html[html.index('id="worst"') : html.index('id="broken"')]
    shown = re.findall(r'<td class="n \w+"><b>([^<]+)</b>', table)
    assert len(shown) == 10
    assert [float(value) for value in shown] == sorted((float(value) for value in shown), reverse=True)
    assert float(f"{rows[0]['ratio']:.1e}") == float(shown[0])
    values = re.findall(r'<td>(\w+) \[[^<]*<small>[^<]*</small></td>\s*<td class="n">([^<]+)</td>', table)
    assert values == [(row["quantity"], f"{row['value']:.7g}") for row in rows[:10]]


def test_the_matrix_shows_what_is_farthest_from_the_physics_first(panel_store, panel_report):
    html = (panel_report / "index.html").read_text(encoding="utf-8")
    rows = load_store(panel_store).headlines
    sizes = {}
    for row in rows:
        key = row["case"], row["engine"]
        sizes[key] = max(sizes.get(key, 0.0), row["rel_error"])
    table = html[html.index('class="matrix"') : html.index("Not installed")]
    shown = re.findall(r'class="v v-error d\d+"[^>]*>([^<]+)<', table)
    assert sorted(shown) == sorted(percent(size) for size in sizes.values())
    assert shown[0] == percent(max(sizes.values()))
    assert "Chrono" not in table
    assert 'Not installed where this ran: <a href="engine/chrono.html">Chrono</a>' in html
    assert percent(max(sizes.values())) in html[html.index("Farthest from the physics") : html.index('id="matrix"')]


def test_overview_shows_claims_gaps_breaks_and_provenance(panel_report):
    html = (panel_report / "index.html").read_text(encoding="utf-8")
    claims = html[html.index('id="claims"') : html.index('id="provenance"')]
    assert claims.count("✗ contradicted") == 1
    assert "ninedisk DEM, YADE" in claims
    for words in (
        "◷ timeout",
        "‼ error",
        "○</b> unsupported",
        "△ known-gap",
        "0123456789abcdef",
        "a processor",
    ):
        assert words in html, words


def test_case_page_orders_its_errors(panel_report):
    html = (panel_report / "case" / "incline-block.html").read_text(encoding="utf-8")
    errors = html[html.index('id="errors"') : html.index("Known gaps and differences, by cause</h3>")]
    shown = [float(value) for value in re.findall(r'<td class="n \w+"><b>([^<]+)</b>', errors)]
    assert len(shown) > 30
    assert shown == sorted(shown, reverse=True)
    assert html.index("Figure A.17–A.21") < html.index("Figure A.22–A.26") < html.index('id="errors"')
    assert "order of the scheme at this step" in html


def test_difference_table_names_engines_with_histories(panel_report):
    html = (panel_report / "case" / "nine-disk-compression.html").read_text(encoding="utf-8")
    table = html[html.index('id="differences"') : html.index('id="errors"')]
    assert {"Box2D", "ninedisk DEM", "LAMMPS", "YADE"} == set(re.findall(r'<th scope="row">([^<]+)<', table))


def test_errata_are_reported_with_verdicts(panel_report):
    html = (panel_report / "errata.html").read_text(encoding="utf-8")
    assert html.count("<blockquote>") == 1
    assert "by every engine that decides it" in html
    assert "ninedisk DEM, YADE" in html
    assert "fn = 73.80 N against 78.54 N" in html


def test_lists_report_what_they_leave_out_and_engines_of_one_program_know_each_other(tmp_path, write, small):
    tables = {"cells": [], "headlines": [], "measurements": []}
    for engine in ("demo one", "demo two", "other"):
        own = small(
            engine, status="known-difference", finding="demo/slips", reason=f"demo/slips: up to {len(engine)} m s"
        )
        tables["cells"].append({**own["cells"][0], "engine_version": "1.0"})
        tables["measurements"] += own["measurements"]
        for k in range(12):
            row = {
                "case": "demo/one",
                "case_version": 1,
                "variant": "k=1",
                "engine": engine,
                "headline": f"h{k}",
                "scale_is": "push",
            }
            tables["headlines"].append({**row, "value": 0.5, "expected": 0.0, "scale": 1.0, "rel_error": 0.5})
    write(tmp_path / "store", "a", tables)
    out = build_report(tmp_path / "store", tmp_path / "out").parent
    own = (out / "engine" / "demo-one.html").read_text(encoding="utf-8")
    assert "10 of 12 shown; the other 2</summary>" in own
    assert own.index('id="otherwise"') < own.index('id="well"'), "what is worst comes first"
    assert re.findall(r'Of the same program: <a href="(.*?)">', own) == ["demo-two.html"]
    assert "Of the same program" not in (out / "engine" / "other.html").read_text(encoding="utf-8")
    first = (out / "index.html").read_text(encoding="utf-8")
    assert "3 simulation engines (2 programs) stand" in first
    assert "<b>demo/slips</b>: DEMO ONE, DEMO TWO, OTHER, 3 checks" in first
