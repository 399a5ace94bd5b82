"""The dashboard's pages: worst first, links that lead somewhere, nothing from a run read as markup; drawn and silent in a browser."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from ninedisk.harness.results.compare import compare, side
from ninedisk.harness.results.history import history
from ninedisk.harness.results.schema import StoreHistory
from ninedisk.harness.results.store import HEADLINE, as_check
from ninedisk.reports.dashboard import build_dashboard, groups, last_steps, marks
from ninedisk.reports.folder import ReportError
from ninedisk.reports.studies import comparison_page

WIDTHS = (390, 1024, 1440)
LONG = "an-engine-with-a-name-that-goes-on-and-on-without-a-single-blank-or-anything-else-to-break-a-line-at"
HOSTILE = "<script>alert(1)</script>\"'&{{ 7*7 }}](x)"


def silent(*_: Any) -> None:
    pass


class Links(HTMLParser):
    """Targets of links, ids, scripts and event handlers of a page."""

    def __init__(self, page: Path) -> None:
        super().__init__()
        self.targets: list[str] = []
        self.ids: list[str] = []
        self.tags: list[str] = []
        self.handlers: list[str] = []
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        for name, value in attrs:
            if name in ("href", "src"):
                self.targets.append(value or "")
            if name == "id":
                self.ids.append(value or "")
            if name.startswith("on"):
                self.handlers.append(name)


@pytest.fixture(scope="session")
def planted(synthetic: ModuleType) -> StoreHistory:
    """Everything that can go wrong, in 50 runs on two machines."""
    plan = synthetic.Plan(
        runs=50,
        errors={
            ("nine-disk/distortion", "k=1", "dem", "energy_final"): (30, 10.0),
            ("incline-block", "k=0", "yade", "fn_wall_mid"): (20, 0.2),
        },
        timings={("slip-to-roll", "k=0", "dem"): (24, 1.5)},
        cells={("incline-block", "k=1", "pymunk"): (40, "error", HOSTILE)},
        versions={"nine-disk/compression": 25},
    )
    found: StoreHistory = history(synthetic.snapshots(plan))
    return found


@pytest.fixture(scope="session")
def pages(planted: StoreHistory, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_dashboard(planted, tmp_path_factory.mktemp("dash") / "out", silent).parent


def test_marks_are_grouped_worst_first(planted: StoreHistory, synthetic: ModuleType) -> None:
    """One change on two machines is one group, dated by the run that both allow."""
    standing = groups(mark for mark in marks(planted) if mark.shift.open)
    reported = [(g.worst.severity, g.worst.line.case, g.worst.line.engine, len(g.machines)) for g in standing]
    assert reported == [
        ("broke", "incline-block", "pymunk", 2),
        ("outside", "nine-disk/distortion", "dem", 2),
        ("slower", "slip-to-roll", "dem", 2),
    ]
    assert [planted.runs[g.since].commit for g in standing[:2]] == [synthetic.commit(40), synthetic.commit(30)]
    (better,) = groups(mark for mark in marks(planted) if mark.severity == "better")
    assert (better.worst.line.case, better.since) == ("incline-block", 20)


def test_the_first_lines_say_what_is_worst(pages: Path, synthetic: ModuleType) -> None:
    text = re.sub(
        r"<[^>]+>|\s+", " ", (pages / "index.html").read_text(encoding="utf-8").partition('<ul class="toc">')[0]
    )
    text = re.sub(r"\s+", " ", text)
    assert "Worst open regression: pymunk on incline-block" in text
    assert synthetic.commit(40)[:12] in text
    assert "3 open regressions, 0 that came back, 1 improvement" in text


def test_every_link_leads_somewhere(pages: Path) -> None:
    held = {page.relative_to(pages).as_posix(): Links(page) for page in pages.rglob("*.html")}
    assert len([name for name in held if name.startswith("lines/")]) == 5 * 3 + 1
    assert len([name for name in held if name.startswith("compare/")]) >= 4
    for name, page in held.items():
        assert len(set(page.ids)) == len(page.ids), name
        for target in page.targets:
            file, _, anchor = target.partition("#")
            assert "://" not in target, "no request leaves the folder"
            path = (pages / name).parent / file if file else pages / name
            assert path.is_file(), f"{name}: {target}"
            if anchor:
                assert anchor in held[path.resolve().relative_to(pages.resolve()).as_posix()].ids, f"{name}: {target}"


def test_one_click_from_a_mark_to_the_comparison(pages: Path, planted: StoreHistory) -> None:
    index = Links(pages / "index.html")
    for before, after in {mark.runs for group in groups(marks(planted)) for mark in [group.worst]}:
        runs = [planted.runs[number].run_id.lower() for number in (before, after)]
        assert any(all(run in target for run in runs) for target in index.targets if target.startswith("compare/"))


def test_lines_of_two_case_versions_stand_apart(pages: Path) -> None:
    text = (pages / "lines" / "nine-disk-compression-dem.html").read_text(encoding="utf-8")
    assert len(re.findall(r"<h2>[^<]*, version [12] of the case</h2>", text)) == 4


def test_rules_and_false_alarm_rate_are_stated(pages: Path) -> None:
    text = (pages / "index.html").read_text(encoding="utf-8")
    assert "at most one dashboard in a hundred" in text
    assert "above 10% of its tolerance" in text


def test_hostile_names_are_text(synthetic: ModuleType, tmp_path: Path) -> None:
    """In ids, engine names, reasons, versions, commits and machines."""
    plan = synthetic.Plan(
        runs=12,
        machines=(HOSTILE,),
        cases=(HOSTILE, "../../up"),
        engines={HOSTILE: HOSTILE},
        cells={(HOSTILE, "k=0", HOSTILE): (6, "error", HOSTILE)},
        errors={(HOSTILE, "k=1", HOSTILE, "energy_final"): (6, 50.0)},
    )
    rows = []
    for number in range(plan.runs):
        facts = synthetic.about(plan, number)
        facts["provenance"]["commit"] = f"{HOSTILE}{number}"
        facts["provenance"]["packages"][HOSTILE] = f"{HOSTILE}{number}"
        facts["run_id"] = f"{HOSTILE}{number}"
        tables = {name: synthetic.complete(name, each) for name, each in synthetic.tables(plan, number).items()}
        rows.append(synthetic.snapshot(synthetic.run_facts(facts), tables["cells"], tables["measurements"]))
    folder = build_dashboard(history(rows), tmp_path / "out", silent).parent
    assert {path.parent.name for path in folder.rglob("*.html")} == {"out", "lines", "compare"}
    for path in folder.rglob("*.html"):
        page = Links(path)
        assert page.handlers == []
        assert page.tags.count("script") == (2 if path.parent.name == "lines" else 0), path.name
        text = path.read_text(encoding="utf-8")
        assert "<script>alert" not in text
    assert "{{ 7*7 }}" in (folder / "index.html").read_text(encoding="utf-8"), "shown as it stands"


def test_one_run_alone(synthetic: ModuleType, tmp_path: Path) -> None:
    found = history(synthetic.snapshots(synthetic.Plan(runs=1)))
    text = build_dashboard(found, tmp_path / "out", silent).read_text(encoding="utf-8")
    assert "No open regression" in text


def test_the_largest_change_is_named_even_when_all_is_steady(synthetic: ModuleType, tmp_path: Path) -> None:
    """Of the newest machine's last two runs; round-off far below a tolerance, which triples here, is no change."""
    place = ("incline-block", "k=0", "yade", "fn_wall_mid")

    def steady(runs: int, **more: bool) -> StoreHistory:
        plan = synthetic.Plan(
            runs=runs, errors={place: (4, 1.02)}, noise=1e-3, outliers=0.0, drift=0.0, machines=("here",), **more
        )
        found: StoreHistory = history(synthetic.snapshots(plan))
        return found

    assert marks(steady(5)) == []
    step = last_steps(steady(5))["error"]
    assert (step.line.case, step.line.variant, step.line.engine, step.line.quantity) == place
    assert step.after / step.before == pytest.approx(1.02, rel=1e-9)
    index = build_dashboard(steady(5), tmp_path / "out", silent).read_text(encoding="utf-8")
    assert f"Largest change since the last run: a check, <b>{step.words}</b>" in index
    assert step.words.startswith("1.02 × (")
    after = last_steps(steady(6, round_off=False))
    assert after["error"].size == 0.0
    assert 0.0 < after["timing"].size < 0.02
    assert last_steps(steady(1)) == {}


def test_a_headline_has_a_line_of_its_own_in_per_cent(synthetic: ModuleType, tmp_path: Path) -> None:
    """From 0.2 % to 3 % of the weight in the third of four runs: marked there, though no check has moved."""
    runs = synthetic.snapshots(synthetic.Plan(runs=4, noise=1e-3, outliers=0.0, drift=0.0, machines=("here",)))
    key = ("incline-block", "k=0", "dem")
    reported = []
    for number, run in enumerate(runs):
        row = {
            "headline": "force at rest",
            "quantity": "fn",
            "scale_is": "weight",
            "rel_error": 2e-3 if number < 2 else 3e-2,
        }
        check = as_check(dict(zip(("case", "variant", "engine"), key, strict=True)) | row)
        own = {**run.checks[key], ("force at rest", "scalar", HEADLINE, 0): check}
        reported.append(replace(run, checks={**run.checks, key: own}))
    found = history(reported)
    (line,) = [line for line in found.lines if line.kind == "headline"]
    (mark,) = marks(found)
    assert mark.line == line
    assert (mark.severity, mark.runs, mark.levels) == ("larger", (1, 2), ("0.2 %", "3 %"))
    assert last_steps(found)["headline"].size == 0.0
    index = build_dashboard(found, tmp_path / "out", silent).read_text(encoding="utf-8")
    assert "1 headline," in index
    assert "no headline moved" in index
    (page,) = (tmp_path / "out" / "lines").glob("incline-block-dem.html")
    words = page.read_text(encoding="utf-8")
    assert "<b>force at rest</b>, headline error" in words
    assert "now: 3 %" in words


def test_a_foreign_folder_is_left_alone(planted: StoreHistory, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine.txt").write_text("mine")
    with pytest.raises(ReportError, match="no dashboard of ninedisk"):
        build_dashboard(planted, tmp_path / "out", silent)
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_an_old_dashboard_is_replaced(planted: StoreHistory, tmp_path: Path) -> None:
    for _ in range(2):
        build_dashboard(planted, tmp_path / "out", silent)
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_pages_are_light(pages: Path) -> None:
    """Fit for a store in a repository: the overview stays below 300 kB, 300 lines with 50 runs below 5 MB."""
    assert (pages / "index.html").stat().st_size < 300_000
    assert sum(path.stat().st_size for path in pages.rglob("*") if path.is_file()) < 5_000_000


def test_pages_in_a_browser(synthetic: ModuleType, tab: Any, tmp_path: Path) -> None:
    """From disk, at every width: no sideways scrolling, no message on the console, exact values by keyboard."""
    key = ("nine-disk/distortion", "k=1", "dem", "energy_final")
    plan = synthetic.Plan(
        runs=40,
        errors={key: (30, 10.0)},
        timings={("slip-to-roll", "k=0", "dem"): (20, 2.0)},
        cells={("incline-block", "k=1", LONG): (20, "error", LONG * 3)},
        engines={"dem": "ninedisk DEM", "yade": "YADE", LONG: LONG, **{f"e{k}": f"Engine {k}" for k in range(6)}},
    )
    runs = synthetic.snapshots(plan)
    found = history(runs)
    folder = build_dashboard(found, tmp_path / "out", silent).parent
    page = comparison_page(compare(side(runs[:30]), side(runs[30:])))
    (folder / "compare" / "alone.html").write_text(page, encoding="utf-8")
    around = next(iter((folder / "compare").glob("2026*.html"))).name
    for name in ("index.html", "lines/nine-disk-distortion-dem.html", f"compare/{around}", "compare/alone.html"):
        for width in WIDTHS:
            tab.open(folder / name, width)
            scroll, client = tab.run("[document.documentElement.scrollWidth, document.documentElement.clientWidth]")
            assert scroll <= client == width, name
            drawn = (
                "[...document.querySelectorAll('svg.line')].filter(s => s.getBoundingClientRect().height > 10).length"
            )
            assert tab.run(drawn) > 0 or name.startswith("compare"), name
    assert tab.complaints == []

    tab.open(folder / "lines" / "nine-disk-distortion-dem.html")
    tab.run("document.querySelector('svg[data-points]').focus()")
    tab.key("End")
    # The marked line of the first machine comes first; its last point, as the records have it.
    line = next(line for line in found.lines if line.shifts and line.case == key[0] and line.quantity == key[3])
    value, _, when, versions = tab.run("document.getElementById('tip').textContent").splitlines()[:4]
    assert value.startswith(f"{line.points[-1].value:.6g} J = ")
    assert float(value.split()[0]) == pytest.approx(line.points[-1].value, rel=1e-5)
    assert found.runs[line.points[-1].run].commit[:12] in when
    assert versions == "ninedisk 0.1.0, engine 1.0"
    tab.key("Escape")
    assert tab.run("document.getElementById('tip').hidden")
    assert tab.complaints == []


def test_an_error_on_the_console_is_seen(tab: Any, tmp_path: Path) -> None:
    """The test above would notice."""
    page = "<!doctype html><html><head></head><body><script>undefinedFunction();</script></body></html>"
    (tmp_path / "bad.html").write_text(page, encoding="utf-8")
    tab.open(tmp_path / "bad.html")
    assert any("undefinedFunction" in complaint for complaint in tab.complaints)
