"""The page of findings: what changed first, then the largest; nothing of it runs or leaves the folder."""

from __future__ import annotations

import re

import pytest

from ninedisk.harness.results.schema import EvaluatedFinding
from ninedisk.reports.build import build_report
from ninedisk.reports.findings import of_engines
from ninedisk.reports.panel.load import load_store

HOSTILE = "<script>alert('x')</script>"


def finding(name: str, verdict: str = "there", size: float = float("nan"), **more: str | float) -> EvaluatedFinding:
    reported = {
        "engine": "demo",
        "versions": "1.0",
        "what": f"what {name}",
        "case": "case/one",
        "variant": "k=1",
        "quantity": "x",
    }
    return EvaluatedFinding(id=name, verdict=verdict, size=size, value=1.5, expected=1.0, **{**reported, **more})  # type: ignore[arg-type]


FOUND = (
    finding("demo/a", size=1.82, documented="https://demo.org/manual", of=0.5, per="push", unit="N"),
    finding("source/print", size=0.5, truth="published"),
    finding("demo/b", "gone", 0.06, thread="javascript:alert(1)", reason="the size is at most 0.1"),
    finding("demo/c", size=0.031, what=HOSTILE, command="ninedisk run case/one --engine demo"),
    finding("demo/d", "not-measured", reason="the store has no such cell"),
)


@pytest.fixture
def page(tmp_path, write, small):
    write(tmp_path / "store", "a", small(engine="demo", case="case/one"))
    return build_report(tmp_path / "store", tmp_path / "out", findings=FOUND).parent / "findings.html"


def test_what_changed_comes_first_then_engines_then_the_source(page):
    html = page.read_text(encoding="utf-8")
    assert re.findall(r'<article class="finding" id="(.*?)"', html) == ["demo-b", "demo-a", "demo-c", "source-print"]
    assert re.findall(r"<b>([^<]* %)</b>", html) == ["6 %", "182 %", "3.1 %", "50 %"]
    assert "of the push = 0.5 N</small><small>there" in html
    assert "the source prints 1, DEMO gives 1.5" in re.sub("<.*?>", "", html)
    assert "the store has no such cell" in html
    assert HOSTILE not in html
    assert set(re.findall(r'href="(\w+:.*?)"', html)) == {"https://demo.org/manual"}
    for link in re.findall(r'href="([^:"#]+)"', html):
        assert (page.parent / link).is_file(), link


def test_the_first_page_and_the_engines_page_lead_to_what_they_name(page):
    first = (page.parent / "index.html").read_text(encoding="utf-8")
    assert re.findall(r"<li><b>([^<]* %)</b>", first) == ["182 %", "3.1 %"]
    assert "of the push = 0.5 N: <a" in first
    own = (page.parent / "engine" / "demo.html").read_text(encoding="utf-8")
    for html, card in ((first, []), (own, ["demo-a"])):  # an engine's page begins with its largest
        assert HOSTILE not in html
        named = re.findall(r"findings\.html#([\w-]+)", html)
        assert named == [*card, "demo-a", "demo-c"]


def test_other_pages_get_what_was_measured_of_engines(tmp_path, write, small):
    write(tmp_path / "store", "a", small())
    stored = load_store(tmp_path / "store")
    assert of_engines(stored) == []
    object.__setattr__(stored, "findings", FOUND)
    assert [each.id for each in of_engines(stored)] == ["demo/a", "demo/c"]


def test_without_findings_there_is_no_page(tmp_path, write, small):
    write(tmp_path / "store", "a", small())
    assert not (build_report(tmp_path / "store", tmp_path / "out").parent / "findings.html").exists()


@pytest.mark.parametrize("width", [390, 1440])
def test_it_fits_a_browser(tab, page, width):
    tab.open(page, width)
    assert tab.run("document.documentElement.scrollWidth <= document.documentElement.clientWidth")
    assert tab.complaints == []
