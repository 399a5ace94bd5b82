"""The page of a benchmark record: scaling curves, memory, accuracy against cost."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from ninedisk.harness.bench.records import new_row
from ninedisk.harness.results.statuses import VERDICTS
from ninedisk.reports.bench import charts, write_bench
from ninedisk.reports.drawing.race import races


def row(problem: str, engine: str = "dem", disks: int = 10_000, seconds: float = 0.5, **more: Any) -> dict[str, Any]:
    """A row that has been timed."""
    times = {"median_s": seconds, "low_s": 0.8 * seconds, "high_s": 2.0 * seconds, "status": "pass", "threads": 1}
    rate = {"rate": disks * 1000 / seconds, "rate_unit": "particle-steps/s"}
    return new_row(
        **{
            "suite": "dem", "problem": problem, "engine": engine, "disks": disks, "steps": 1000, **times, **rate, **more,
        }
    )  # fmt: skip


def many_rows() -> list[dict[str, Any]]:
    sizes = (100, 1000, 10_000, 100_000, 1_000_000)
    rows = [row(f"settled-{n}", disks=n, bytes_per_disk=150.0 + 1e4 / n) for n in sizes]
    rows += [row(f"settled-{n}", "lammps", n, 4.0, resident_per_disk=900.0) for n in sizes]
    rows += [row("settled-10000-short", seconds=0.3), row("settled-10000-short", "lammps", seconds=2.0)]
    rows += [row("settled-10000-short", "yade", threads=k, seconds=9.0 / k, resident_per_disk=1.0) for k in (1, 2)]
    rows += [row("settled-100000", disks=100_000, seconds=0.5 / k, threads=k) for k in (2, 3, 4)]
    rows += [
        row("accuracy-nine-disks-overlap", name, 9, cost * k, steps=5500 * k, check_value=1e-4 / k)
        for name, cost in (("dem", 0.01), ("yade", 0.2))
        for k in (1, 2, 4)
    ]
    return [*rows, row("settled-10000"), row("nine-disks-overlap", disks=9)]


def test_charts_over_size_threads_memory_and_cost() -> None:
    drawn = {chart.title: chart for chart in charts(many_rows(), "dem")}
    assert list(drawn) == [
        "settled: rate over size",
        "rate over threads (dashed: in proportion)",
        "settled: memory over size",
        "nine-disks-overlap: error against cost",
    ]
    size = {dots.key: dots for dots in drawn["settled: rate over size"].dots}
    assert size["dem"].x[0] == 100.0
    assert size["dem"].x[-1] == 1e6
    assert set(size) == {
        "dem",
        "lammps",
        "yade (short runs)",
        "yade, 2 threads (short runs)",
        *(f"dem, {k} threads" for k in (2, 3, 4)),
    }
    threads = {dots.key: dots for dots in drawn["rate over threads (dashed: in proportion)"].dots}
    assert set(threads) == {"dem, settled-100000", "yade, settled-10000-short"}
    assert threads["dem, settled-100000"].x == (1.0, 2.0, 3.0, 4.0)
    memory = {dots.key: dots for dots in drawn["settled: memory over size"].dots}
    assert set(memory) == {"dem (arrays)", "lammps (resident)", "yade (resident)"}
    assert memory["dem (arrays)"].y[0] == 250.0
    cost = {dots.key: dots for dots in drawn["nine-disks-overlap: error against cost"].dots}
    assert cost["yade"].y == (1e-4, 5e-5, 2.5e-5)
    assert cost["yade"].names == ("5500 steps", "11000 steps", "22000 steps")


def test_the_chart_of_two_sizes_begins_with_one_size() -> None:
    rows = [
        row("mixed-20-10000", seconds=0.8),
        row("mixed-5-10000", seconds=0.6),
        row("settled-10000"),
        row("settled-1000"),
    ]
    rows += [row("mixed-5-10000", "lammps", seconds=2.0)]
    drawn = {chart.title: chart for chart in charts(rows, "dem")}
    dots = {each.key: each for each in drawn["two sizes: rate over the ratio of their radii"].dots}
    assert set(dots) == {"dem, 10000", "lammps, 10000"}
    assert dots["dem, 10000"].x == (1.0, 5.0, 20.0)
    assert dots["dem, 10000"].y == (2e7, 1e7 / 0.6, 1e7 / 0.8)
    assert "two sizes" not in "".join(chart.title for chart in charts([row("settled-10000")], "dem"))


def test_spheres_are_called_so(tmp_path: Path) -> None:
    rows = [{**each, "suite": "spheres"} for each in many_rows()[:10]]
    assert {chart.x_label for chart in charts(rows, "spheres")} == {"spheres"}
    page = page_of(rows, tmp_path)
    assert "Bytes a sphere" in page
    assert "Bytes a disk" not in page


def test_what_was_not_timed_is_not_drawn() -> None:
    lost = [{**each, "median_s": math.nan, "status": "fail"} for each in many_rows()]
    assert charts(lost, "dem") == []


def page_of(rows: list[dict[str, Any]], folder: Path) -> str:
    facts = {"commit": "", "cpu": "c", "cores": 2, "python": "3"}
    write_bench({"run_id": "r", "argv": [], "provenance": facts, "versions": {}, "rows": rows}, folder / "page.html")
    return (folder / "page.html").read_text(encoding="utf-8")


def test_a_page_of_many_rows_names_every_problem(tmp_path: Path) -> None:
    page = page_of(many_rows(), tmp_path)
    for each in many_rows():
        assert each["problem"] in page
    for word, meaning in VERDICTS["bench"].items():
        assert f"<dt>{word}</dt><dd>{meaning}" in page


def test_the_page_draws_its_charts_alone_and_silently(tab: Any, tmp_path: Path) -> None:
    """One file, no network: every chart of points gets its canvas, in a line that turns as much as its points do."""
    page_of(many_rows(), tmp_path)
    tab.open(tmp_path / "page.html", dark=True)
    tab.wait("document.querySelectorAll('figure.chart.drawn canvas').length === 4")
    assert tab.complaints == []
    assert {url.partition(":")[0] for url in tab.requests} <= {"file", "data"}
    assert len([url for url in tab.requests if url.startswith("file:")]) == 1
    tab.run("document.querySelector('figure.chart').focus()")
    tab.key("Home")
    tab.wait("!document.querySelector('.readout').hidden")
    assert "settled-100" in tab.run("document.querySelector('.readout').textContent")


def test_error_lines_lead_from_coarse_to_fine_steps_whatever_was_measured() -> None:
    """A slow minute under the coarsest step turns the line, and does not tangle it; its times have no separate marks."""
    rows = [
        row("accuracy-nine-disks-overlap", "dem", 9, seconds, steps=steps, check_value=error)
        for steps, seconds, error in ((22000, 0.02, 1e-5), (5500, 0.03, 4e-5), (11000, 0.011, 2e-5))
    ]
    (chart,) = charts(rows, "dem")
    assert chart.dots[0].x == (0.03, 0.011, 0.02)
    assert chart.dots[0].y == (4e-5, 2e-5, 1e-5)


@pytest.mark.parametrize(("longest", "marks"), [(0.5, None), (0.04, [0.02, 0.04])])
def test_measured_times_are_marked_by_decades_where_there_are_some(longest: float, marks: list[float] | None) -> None:
    rows = [
        row("accuracy-nine-disks-overlap", "dem", 9, seconds, steps=round(1e3 * seconds), check_value=1e-5)
        for seconds in (0.02 if longest < 0.1 else 0.008, longest)
    ]
    (chart,) = charts(rows, "dem")
    assert chart.spec()["marks"] == marks


def raced() -> list[dict[str, Any]]:
    """Three problems: ours solves all to 1e-8; the other one is five times faster on one, misses one, and lies about the third."""
    made = []
    for name, contacts, other in (("drum-10", 10, 0.2), ("drum-30", 30, None), ("lattice-10", 12, "lie")):
        for target in (1e-3, 1e-8):
            reported = {"start": "coulomb", "tolerance": target, "contacts": contacts, "suite": "coulomb", "repeats": 2}
            settings = '{"time limit [s]": 3.0, "claimed": %s}'
            made.append(row(name, "ninedisk", contacts, 1.0, settings=settings % "false", **reported))
            lost = {} if other == 0.2 else {"status": "not-reached", "median_s": math.nan, "reason": "<b>off</b>"}
            seconds = {"seconds": 0.2} if other == 0.2 else {}
            text = settings % ("true" if other == "lie" else "false")
            made.append({**row(name, "other", contacts, settings=text, **seconds, **reported), **lost})
    return made


def test_the_race_counts_all_problems_and_shows_the_hardest_first(tmp_path: Path) -> None:
    (race,) = races(raced(), "coulomb")
    assert [each.engine for each in race.standings] == ["ninedisk", "other"]
    ours, other = race.standings
    assert ours.shares == (1.0, 1.0)
    assert other.shares == pytest.approx((1 / 3, 1 / 3))
    assert (ours.fastest, other.fastest, ours.claimed, other.claimed) == (2, 1, 0, 1)
    assert race.families == (("lattice", 1, (1.0, 0.0)), ("drum", 2, (1.0, 0.5)))
    assert [name for name, _, _ in race.hardest] == ["drum-30", "lattice-10"]
    profile = next(chart for chart in race.charts if "profile, 1e-08" in chart.title)
    shares = {dots.key: dict(zip(dots.x, dots.y, strict=True)) for dots in profile.dots}
    # A problem that nobody else solves is won; the factor of five costs the third.
    assert shares["ninedisk"][3.0] == pytest.approx(200.0 / 3.0)
    assert shares["ninedisk"][5.0] == 100.0
    assert list(shares["other"].values()) == pytest.approx([100.0 / 3.0] * len(shares["other"]))
    page = page_of(raced(), tmp_path)
    assert "33.3 %" in page
    assert "at most 3 s for one answer, 2 repeat(s)" in page
    assert "<b>off</b>" not in page


def test_files_of_many_names_are_no_families(tmp_path: Path) -> None:
    rows = [{**each, "suite": "coulomb3d"} for each in raced()]
    many = [{**each, "problem": f"file{k}"} for k in range(5) for each in rows if each["problem"] == "drum-10"]
    (race,) = races(many, "coulomb3d")
    assert race.families == ()
    assert races(many, "coulomb") == []
    page = page_of(many, tmp_path)
    assert "Contact problems in space" in page
    assert "Families, least solved first" not in page


def test_records_of_flows_from_before_friction_was_judged_are_read(tmp_path: Path) -> None:
    reported = {
        "suite": "flow",
        "penetration": 1e-3,
        "equal_ratio": 2.5,
        "friction_error": 0.0125,
        "equal_friction_ratio": 3.75,
    }
    springs = row("drum-300", "dem, kn x 1", 300, suite="flow", penetration=1e-3)  # has neither
    new = [row("drum-300", "pymunk, 10 iterations", 300, **reported), springs]
    page = page_of(new, tmp_path)
    assert all(text in page for text in ("Friction error", "2.5", "0.013", "3.8"))
    added = ("friction_error", "equal_friction_ratio")
    page = page_of([{name: each[name] for name in each if name not in added} for each in new], tmp_path)
    assert "2.5" in page
    assert "0.013" not in page
