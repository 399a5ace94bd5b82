"""Which engine for what, on small stores whose ranking is known by hand."""

from __future__ import annotations

import json
import math
import re

import pytest

from ninedisk.harness.results.schema import USES, EvaluatedFinding
from ninedisk.reports.build import build_report
from ninedisk.reports.panel.load import load_store
from ninedisk.reports.panel.model import build_panel
from ninedisk.reports.panel.uses import uses

ERRORS = {  # by engine: case, step (its variant) -> error; "own" is a variant of one engine alone
    "exact": {("a", 0.1): 1e-15, ("a", 0.2): 3e-14, ("b", 0.1): 0.0, ("b", 0.2): 1e-13},
    "first": {("a", 0.1): 0.01, ("a", 0.2): 0.02, ("b", 0.1): 0.005, ("b", 0.2): 0.01},
    "blunder": {("a", 0.1): 0.0, ("a", 0.2): 0.0, ("b", 0.1): 0.5, ("b", 0.2): 0.5, ("b", "own"): 7.0},
    "half": {("a", 0.1): 1e-13, ("b", 0.1): 1e-13},  # both headlines, on half of the variants
    "little": {("a", 0.1): math.nan, ("c", 0.1): 1e-6},
    "coarse": {("a", 0.1): 0.015, ("a", 0.2): 0.06, ("b", 0.1): 0.0025, ("b", 0.2): 0.04},
}
SECONDS = {"exact": 8.0, "first": 1.0, "blunder": 2.0, "little": 1.0, "half": 9.0, "coarse": 1.0}


@pytest.fixture(scope="module")
def make(tmp_path_factory, write, small):
    """Writes a store of errors by engine, case and step; a case is named by its use, one letter represents sliding."""

    def stored(errors, seconds, **named):
        tables = {"cells": [], "headlines": []}
        for engine, own in errors.items():
            for (case, step), error in own.items():
                params = {"dt": 0.1, "k": 2} if step == "own" else {"dt": step, "k": 1}
                place = {"case": case, "variant": f"dt={step}", "params": json.dumps(params)}
                (cell,) = small(engine, **place, **named.get(engine, {}))["cells"]
                spent = seconds.get(engine, math.nan) * 0.1 / params["dt"]
                tables["cells"].append({**cell, "engine_version": "1", "advance_s": spent})
                if error is None:  # unsupported: a cell, and no row
                    tables["cells"][-1] |= {"status": "unsupported", "support": "no"}
                    continue
                row = {"case_version": 1, **place, "engine": engine, "headline": "way", "scale_is": "way"}
                row |= {"use": case.split("/")[0] if "/" in case else "sliding", **named.get("headlines", {})}
                tables["headlines"].append({**row, "value": error, "expected": 0.0, "scale": 1.0, "rel_error": error})
        store = tmp_path_factory.mktemp("store")
        write(store, "a", tables)
        return store

    return stored


@pytest.fixture(scope="module")
def store(make):
    return make(ERRORS, SECONDS)


@pytest.fixture(scope="module")
def report(store, tmp_path_factory):
    """Folder of the store's report."""
    return build_report(store, tmp_path_factory.mktemp("out") / "report").parent


def found_in(store):
    """The uses of a store by their id."""
    return {use.id: use for use in uses(build_panel(load_store(store)))}


def ids(ranks):
    return [rank.engine.id for rank in ranks]


def one_step(**errors):
    """Errors of one case at one step."""
    return {engine: {("a", 0.1): error} for engine, error in errors.items()}


def test_engines_are_ordered_by_their_worst_error(store):
    """A mean would put the blunder, exact on all except one case, before the engine that is off by 2 % at most."""
    found = found_in(store)
    assert list(found) == ["all", *USES]
    sliding = found["sliding"]
    assert sliding.headlines == 3
    assert [(rank.engine.id, rank.error, round(3.0 * rank.covers, 9)) for rank in sliding.ranks] == [
        ("exact", 1e-13, 2.0),
        ("first", 0.02, 2.0),
        ("coarse", 0.06, 2.0),
        ("blunder", 0.5, 2.0),
    ]
    assert [(rank.engine.id, rank.error, rank.covers) for rank in sliding.little] == [
        ("half", 1e-13, pytest.approx(1 / 3)),
        ("little", 1e-6, pytest.approx(1 / 3)),
    ]
    assert ids(sliding.best) == ["exact"]
    assert (ids(sliding.farthest), sliding.farthest[0].error) == (["blunder"], 0.5), (
        "the 7 of its own variant is not shared"
    )
    assert [sliding.place(rank) for rank in sliding.ranks] == [1, 2, 3, 4]
    assert found["all"].ranks == sliding.ranks
    assert all(use.headlines == 0 and not use.ranks for name, use in found.items() if name not in ("all", "sliding"))


def test_time_at_one_percent_is_compared_where_some_engine_gets_there(store):
    """By hand. `first`: a at 1 s, b at 0.5 s; `exact` takes its larger step, 4 s on both; `coarse` never gets there on a, and on b where
    ``0.0025 (h/0.1)^4 = 0.01``, h = 0.1 sqrt(2); `blunder` on a alone, 1 s."""
    use = found_in(store)["sliding"]
    found = {rank.engine.id: (rank.slower, rank.reached, rank.timed) for rank in use.ranks}
    assert found["first"] == pytest.approx((1.0, 2, 2))
    assert found["exact"] == pytest.approx((math.sqrt(4.0 * 8.0), 2, 2))
    assert found["coarse"] == pytest.approx((math.sqrt(2.0), 1, 2))
    assert found["blunder"] == pytest.approx((1.0, 1, 2))
    assert ids(use.able) == ["exact", "first"]
    assert ids(use.fastest) == ["first"]


def test_everything_takes_the_headlines_of_all_uses_together(make):
    """One engine is the best of each use and the other the farthest, and over both the worst of the two errors decides."""
    use = found_in(
        make({"one": {("sliding/a", 0.1): 1e-3, ("impacts/a", 0.1): 0.2},
              "two": {("sliding/a", 0.1): 0.1, ("impacts/a", 0.1): 0.05}}, {})
    )  # fmt: skip
    reported = {name: (ids(use[name].best), ids(use[name].farthest)) for name in ("sliding", "impacts", "all")}
    assert reported == {"sliding": (["one"], ["two"]), "impacts": (["two"], ["one"]), "all": (["two"], ["one"])}
    assert [(rank.error, rank.worst["case"]) for rank in use["all"].ranks] == [(0.1, "sliding/a"), (0.2, "impacts/a")]
    assert (use["all"].title, use["all"].headlines) == ("everything", 2)


def test_what_is_in_space_is_distinguished_where_a_store_has_both(make):
    """One engine is exact in the plane and off by a tenth in space; with either alone there is nothing to distinguish."""
    plane, space = ("sliding/a", 0.1), ("impacts/a", 0.1)
    store = make({"one": {plane: 1e-13, space: 0.1}, "two": {plane: 0.2, space: 1e-3}}, {})
    assert "space" not in found_in(store)
    panel = build_panel(load_store(store))
    for cell in panel.cases["impacts/a"].cells:
        cell["setup"] = json.dumps({"scene": {"dimension": 3}})
    found = {use.id: use for use in uses(panel)}
    assert list(found)[:2] == ["all", "space"]
    assert (ids(found["space"].best), ids(found["space"].farthest), found["space"].headlines) == (["two"], ["one"], 1)
    assert (ids(found["all"].best), found["all"].headlines) == (["one"], 2)
    for cell in panel.cases["sliding/a"].cells:
        cell["setup"] = json.dumps({"scene": {"dimension": 3}})
    assert "space" not in {use.id for use in uses(panel)}


def test_beside_the_most_accurate_stands_who_has_numbers_on_more(make, tmp_path):
    """`few` has no number on the hard headline, which `all` and `far` are off on."""
    errors = {"few": {("a", 0.1): 1e-3, ("b", 0.1): 1e-3}}
    errors |= {name: {(case, 0.1): error for case in "abc"} for name, error in (("all", 0.1), ("far", 0.2))}
    store = make(errors, {})
    sliding = found_in(store)["sliding"]
    assert (ids(sliding.best), ids(sliding.widest)) == (["few"], ["all"])
    html = (build_report(store, tmp_path / "out").parent / "index.html").read_text()
    assert table_of(html)[1][1] == "FEW 2 of 3 headlines 0.1 % on 3 headlines: ALL 10 %"


def test_a_headline_of_an_unknown_use_counts_in_everything_alone(make):
    found = found_in(make(one_step(one=0.1, two=0.2), {}, headlines={"use": "of a later version"}))
    assert [name for name, use in found.items() if use.ranks] == ["all"]


def test_who_has_too_few_headlines_or_none_is_not_the_farthest(make):
    """`few` is worse than all on one headline of three; a headline without a number, or a cell that is not supported, is no error."""
    errors = {
        "one": {("a", 0.1): 0.01, ("b", 0.1): 0.01, ("c", 0.1): 0.01},
        "two": {("a", 0.1): 0.02, ("b", 0.1): 0.03, ("c", 0.1): None},
        "few": {("a", 0.1): 9.0, ("b", 0.1): None, ("c", 0.1): math.nan},
        "none": {("a", 0.1): math.nan, ("b", 0.1): math.nan, ("c", 0.1): math.nan},
        "unsupported": {("a", 0.1): None, ("b", 0.1): None, ("c", 0.1): None},
    }
    use = found_in(make(errors, {}))["all"]
    assert (ids(use.ranks), ids(use.little)) == (["one", "two"], ["few"])
    assert (ids(use.farthest), use.farthest[0].error) == (["two"], 0.03)


@pytest.mark.parametrize(
    ("errors", "best", "farthest"),
    [
        ({"a": 0.0, "b": 3e-13, "c": 0.49, "d": 0.5, "e": 0.4}, {"a", "b"}, {"d"}),
        ({"a": 0.02, "b": 0.0201, "c": 0.5, "d": 0.4999}, {"a", "b"}, {"c", "d"}),  # print alike: 2 %, 50 %
        ({"a": 0.2, "b": 0.91}, {"a"}, {"b"}),  # of one decade, and not alike
        ({"a": 2.0, "b": 50.0}, {"a"}, {"b"}),  # all above 1, of one colour
        ({"a": 0.3, "b": math.inf}, {"a"}, {"b"}),
        ({"a": 0.0, "b": 1e-13}, {"a", "b"}, set()),  # nobody is farther off than another
        ({"a": 0.5}, {"a"}, set()),
    ],
)
def test_engines_tie_whose_errors_print_alike(make, errors, best, farthest):
    use = found_in(make(one_step(**errors), {}))["all"]
    assert set(ids(use.best)) == best
    assert set(ids(use.farthest)) == farthest
    assert {rank.engine.id for rank in use.ranks if use.place(rank) == 1} == best
    assert {use.place(rank) for rank in use.farthest} <= {1 + len(errors) - len(farthest)}


def test_fastest_are_all_whose_factors_print_alike_and_nobody_without_a_time(make):
    """Steps are good to 1 % at once, so that factors are those of the times: 1, 1.04 and 2; `untimed` would be the most accurate."""
    errors = one_step(untimed=1e-6, one=1e-3, two=2e-3, three=3e-3, far=0.5)
    use = found_in(make(errors, {"one": 2.0, "two": 1.04, "three": 1.0, "far": 0.1}))["all"]
    assert ids(use.best) == ["untimed"]
    assert ids(use.able) == ["one", "two", "three"]
    assert ids(use.fastest) == ["two", "three"]
    assert math.isnan(use.ranks[0].slower)


def test_nobody_is_fastest_where_no_time_is_stored(make):
    use = found_in(make(one_step(one=1e-3, two=2e-3), {}))["all"]
    assert (ids(use.able), ids(use.fastest)) == ([], [])


def table_of(html):
    """Rows of the first page's verdicts, cell by cell without tags."""
    table = html[html.index('<table class="verdicts"') :]
    table = table[: table.index("</table>")]
    rows = re.findall(r"<tr>(.*?)</tr>", table, re.DOTALL)
    return [[plain(cell) for cell in re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row, re.DOTALL)] for row in rows]


def plain(html):
    return " ".join(re.sub(r"<[^>]*>", " ", html).split())


def card_of(html):
    """What the card of an engine's page says, by its lines."""
    card = html[html.index('<dl class="headline fine card">') :]
    found = re.findall(r"<dt>(.*?)</dt><dd>(.*?)</dd>", card[: card.index("</dl>")], re.DOTALL)
    return {name: plain(reported) for name, reported in found}


def test_the_first_page_begins_with_verdicts(report):
    html = (report / "index.html").read_text()
    head, *rows = table_of(html)
    assert head == ["Use", "Most accurate", "Fastest to 1 %", "Least accurate"]
    assert [row[0] for row in rows] == [f"{title} 3 headlines, 4 engines" for title in ("Everything", "Sliding")]
    reported = [
        "EXACT 2 of 3 headlines 1.0e-13",
        "FIRST 2 of 3 headlines 1 × 2 of 4 engines reach it wherever they ran",
        "BLUNDER 2 of 3 headlines 50 % Demo : way",
    ]
    assert rows[0][1:] == rows[1][1:] == reported
    main = html[html.index("<main") :]
    assert main.index('<table class="verdicts"') < main.index('<div class="headline') < main.index('class="toc"')
    assert re.findall(r'<th scope="row"><a href="#(use-[^"]*)"', main) == ["use-all", "use-sliding"]
    assert re.findall(r'<section id="([^"]*)"', main) == [f"use-{name}" for name in ("all", *USES)]
    assert (
        main.count(
            '<a href="engine/exact.html">EXACT</a> <small>2 of 3 headlines</small> <b class="size d0">1.0e-13</b>'
        )
        == 2
    )
    assert "Most accurate:" not in html


def test_the_first_page_has_the_engines_of_each_use(report):
    html = (report / "index.html").read_text()
    assert (
        '<li class="d0"><a href="engine/exact.html">EXACT</a> <b>1.0e-13</b> <small>5.7 ×</small> <small>2 of 3 headlines</small></li>'
        in html
    )
    assert "1 × in 1 of 2</small>" in html
    assert "ninedisk bench flow" in html


@pytest.mark.parametrize(
    ("errors", "seconds", "reported"),
    [
        ({"one": 0.1}, {}, ["ONE 10 %", "no time is known", "one engine alone"]),
        ({"one": 0.0, "two": 1e-13}, {"one": 1.0}, None),
        ({"one": 0.1, "two": math.inf}, {}, ["ONE 10 %", "no time is known", "TWO ∞ Demo : way"]),
    ],
)
def test_a_verdict_that_cannot_be_given_says_why(make, tmp_path, errors, seconds, reported):
    html = (build_report(make(one_step(**errors), seconds), tmp_path / "out").parent / "index.html").read_text()
    reported = reported or ["ONE , TWO 1.0e-13", "ONE 1 × 1 of 2 engines reach it wherever they ran", "all are alike"]
    assert table_of(html)[1][1:] == reported


def test_who_never_comes_to_one_percent_is_reported_so(make, tmp_path):
    errors = {"one": {("a", 0.1): 1e-3, ("b", 0.1): 1e-3}, "far": {("a", 0.1): 0.5, ("b", 0.1): 0.2}}
    report = build_report(make(errors, {"one": 1.0, "far": 1.0}), tmp_path / "out").parent
    reported = card_of((report / "engine" / "far.html").read_text())["How fast"]
    assert reported == "it never comes to an error of 1 %, which another engine does in each of 2 series of steps"


def test_nobody_comes_to_one_percent_wherever_it_ran(make, tmp_path):
    errors = {"one": {("a", 0.1): 1e-3, ("b", 0.1): 0.5}, "two": {("a", 0.1): 0.5, ("b", 0.1): 1e-3}}
    html = (build_report(make(errors, {"one": 1.0, "two": 1.0}), tmp_path / "out").parent / "index.html").read_text()
    assert table_of(html)[1][2] == "no engine wherever it ran"


def test_a_store_without_headlines_has_no_verdicts(tmp_path, write, small):
    write(tmp_path / "store", "a", small("dem", engine_version="1"))
    report = build_report(tmp_path / "store", tmp_path / "out").parent
    assert '<table class="verdicts"' not in (report / "index.html").read_text()
    assert set(card_of((report / "engine" / "dem.html").read_text()).values()) == {
        "no headline has a number of it",
        "no time at an error of 1 % is known",
        "nothing known",
    }


def test_an_engines_page_begins_with_how_wrong_how_fast_and_its_largest_finding(report):
    html = {name: (report / "engine" / f"{name}.html").read_text() for name in ERRORS}
    cards = {name: card_of(page) for name, page in html.items()}
    wrong = {name: card["How wrong"] for name, card in cards.items()}
    assert wrong["blunder"] == "50 % at the worst of what another engine ran as well: place 4 of 4 in everything"
    assert wrong["little"] == "1.0e-6 at the worst, and no place in everything : it has numbers on 33 % of that"
    fast = {name: card["How fast"] for name, card in cards.items()}
    assert (
        fast["coarse"]
        == "1.4 × the time of the fastest engine at an error of 1 %, to which it comes in 1 of 2 series of steps"
    )
    assert cards["blunder"]["Largest finding"] == "700 % of the way: way 7 where the truth is 0, Demo (dt=own)"
    main = html["blunder"][html["blunder"].index("<main") :]
    assert main.index("<dl") < main.index('class="toc"')
    assert 'href="../index.html#use-all"' in main
    assert 'href="../case/b.html">Demo</a> (dt=own)' in main[: main.index("</dl>")]


@pytest.mark.parametrize(("size", "reported"), [(0.3, "20 % finding"), (0.2, "20 % finding"), (0.1, "20 % headline")])
def test_the_largest_of_headlines_and_declared_findings_is_reported(make, tmp_path, size, reported):
    """A finding that is as large as the worst headline explains it; `other` is no engine of this page."""
    found = [
        EvaluatedFinding(id=name, verdict="there", size=share, engine=name.split("/")[0], versions="1", what="it slips", case="a",
                         variant="dt=0.1", quantity="x", value=1.0, expected=1.0)
        for name, share in (("other/worse", 5.0), ("one/slips", size), ("one/less", 0.01))
    ]  # fmt: skip
    report = build_report(make(one_step(one=0.2, two=0.01), {}), tmp_path / "out", findings=found).parent
    html = (report / "engine" / "one.html").read_text()
    largest = card_of(html)["Largest finding"]
    if reported.endswith("finding"):
        assert largest == f"{100 * size:.0f} % : it slips one/slips"
        assert 'href="../findings.html#one-slips">one/slips</a>' in html[: html.index("</dl>", html.index("card"))]
    else:
        assert largest.startswith("20 % of the way: way 0.2")


def test_names_are_escaped(make, tmp_path):
    hostile = "<script>alert('x')</script>"
    named = {
        "one": {"engine_name": hostile, "case_title": hostile},
        "headlines": {"headline": hostile, "scale_is": hostile},
    }
    report = build_report(make(one_step(one=0.5, two=0.01), {"one": 1.0, "two": 1.0}, **named), tmp_path / "out").parent
    index, own = ((report / name).read_text() for name in ("index.html", "engine/one.html"))
    for html in (index, own):
        assert hostile not in html
    escaped = "&lt;script&gt;alert(&#39;x&#39;)&lt;/script&gt;"
    assert table_of(index)[1][3] == f"{escaped} 50 % {escaped} : {escaped}"
    assert card_of(own)["Largest finding"].startswith(f"50 % of the {escaped}: {escaped} 0.5")


def test_verdicts_need_no_sideways_scroll(tab, make, tmp_path):
    """Six engines that tie, one of them with a long name, in a row: the row wraps, the page stays as wide as the window."""
    names = {f"e{k}": {"engine_name": f"engine of a long name {k}" + 40 * "x" * (k == 0)} for k in range(6)}
    report = build_report(make(one_step(**dict.fromkeys(names, 0.1), far=0.5), {}, **names), tmp_path / "out").parent
    inside = "[...document.querySelectorAll('.verdicts *, .card *')].every(e => e.getBoundingClientRect().right <= innerWidth)"
    lefts = "new Set([...document.querySelectorAll('.verdicts tbody tr:first-child > *')].map(e => e.getBoundingClientRect().left)).size"
    for width, columns in ((390, 1), (1440, 4)):
        for page in (report / "engine" / "e0.html", report / "index.html"):
            tab.open(page, width)
            assert tab.run(inside), page
            assert tab.run("document.documentElement.scrollWidth <= document.documentElement.clientWidth"), page
        assert tab.run(lefts) == columns, "verdicts stand below one another where there is no room"
    assert tab.complaints == []
