"""The page of a benchmark record: scaling curves, accuracy against cost, the roofline and what it is said to mean."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import pytest

from ninedisk.harness.bench.records import new_row
from ninedisk.reports.bench import Estimate, charts, estimates, roofline_chart, write_bench
from ninedisk.reports.draw import PointChart, draw_points

ROOFS = {
    "working_set": 1.5e6,
    "bandwidth": 100e9,
    "bandwidth_cached": 200e9,
    "bandwidth_memory": 20e9,
    "flop_rate": 80e9,
    "flop_rate_single": 10e9,
    "root_rate": 0.4e9,
}


def row(problem: str, engine: str = "dem", disks: int = 10_000, seconds: float = 0.5, **more: Any) -> dict[str, Any]:
    """A row that has been timed."""
    times = {"median_s": seconds, "low_s": 0.8 * seconds, "high_s": 2.0 * seconds, "status": "pass", "threads": 1}
    rate = {"rate": disks * 1000 / seconds, "rate_unit": "particle-steps/s"}
    return new_row(
        **{
            "suite": "dem", "problem": problem, "engine": engine, "disks": disks, "steps": 1000, **times, **rate, **more,
        }
    )  # fmt: skip


def under_roofs(flops: float = 120.0, traffic: float = 240.0, **more: Any) -> dict[str, Any]:
    """A row with an estimate: 10,000 disks, 1,000 steps, 0.4 s at best."""
    counts = {"contacts": 16_000, "listed_pairs": 20_000, "rebuilds": 2}
    return row("settled-10000", **{"flops": flops, "traffic": traffic, **counts, **ROOFS, **more})


def test_the_best_repeat_is_held_against_the_roofs() -> None:
    (found,) = estimates([under_roofs(), row("settled-10000", "lammps")])
    assert found.rate == pytest.approx(25e6)
    assert found.of_bandwidth == pytest.approx(25e6 * 240 / 100e9)
    assert found.of_single == pytest.approx(0.3)
    assert found.of_vectors == pytest.approx(0.0375)
    assert found.of_roots == pytest.approx(25e6 * 2.0 / 0.4e9)
    assert found.intensity == 0.5


@pytest.mark.parametrize(
    ("flops", "traffic", "bound"),
    [(120.0, 240.0, "neither"), (120.0, 2900.0, "bandwidth"), (500.0, 240.0, "neither"), (2300.0, 240.0, "arithmetic")],
)
def test_what_binds_follows_from_the_numbers(flops: float, traffic: float, bound: str) -> None:
    """25 million particle-steps/s; 2,800 bytes and 2,240 operations are the lines; 400 could be done one by one."""
    assert estimates([under_roofs(flops, traffic)])[0].bound == bound


def test_records_without_the_columns_have_no_estimate() -> None:
    old = {name: value for name, value in under_roofs().items() if name not in ("flops", "bandwidth")}
    missing = under_roofs() | {"root_rate": None}
    assert estimates([old, missing, row("flowing-1000")]) == []
    assert roofline_chart([]) is None


def heights(chart: PointChart, at: float) -> list[float]:
    """Heights of the named roofs at an intensity, their lines drawn out."""
    return [y[0] * (at / x[0] if y[1] > y[0] else 1.0) for label, x, y in chart.guides if label]


def test_problems_lie_under_their_roofs_inside_the_axes() -> None:
    found = estimates([under_roofs(), under_roofs(disks=1000, bandwidth=150e9)])
    chart = roofline_chart(found)
    assert chart is not None
    (left, right), (low, high) = chart.x_limits, chart.y_limits
    for each, dot in zip(found, chart.dots, strict=True):
        assert left < dot.x[0] < right
        assert low < dot.y[0] < high
        cached, memory, vectors, single = heights(chart, each.intensity)
        assert cached == pytest.approx(200 * 0.5)
        assert memory == pytest.approx(20 * 0.5)
        assert (vectors, single) == (80.0, 10.0)
        assert dot.y[0] == pytest.approx(each.rate * each.flops / 1e9)
    assert [y[1] for label, _, y in chart.guides if not label] == pytest.approx([75.0, 50.0])
    for _, x, y in chart.guides:
        assert left <= min(x) <= max(x) <= right
        assert low <= min(y) <= max(y) <= high


def test_labels_of_roofs_are_turned_like_their_lines(tmp_path: Path) -> None:
    chart = roofline_chart(estimates([under_roofs()]))
    assert chart is not None
    draw_points(chart, tmp_path / "roof.svg")
    texts = {
        "".join(node.itertext()).strip(): node for node in ET.parse(tmp_path / "roof.svg").iter() if "text" in node.tag
    }
    turned = {
        name: "rotate(-" in str(node.attrib) and "rotate(-0" not in str(node.attrib) for name, node in texts.items()
    }
    assert turned["memory 20 GB/s"]
    assert turned["L2 cache 200 GB/s"]
    assert not turned["one by one: 10 Gflop/s"]


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
    return [*rows, under_roofs(), row("nine-disks-overlap", disks=9)]


def test_charts_over_size_threads_memory_and_cost() -> None:
    drawn = {chart.title: chart for chart in charts(many_rows(), "dem")}
    assert list(drawn) == [
        "settled: rate over size",
        "rate over threads (dashed: in proportion)",
        "settled: memory over size",
        "nine-disks-overlap: error against cost",
        "roofline: the DEM's step, one thread",
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


def test_what_was_not_timed_is_not_drawn() -> None:
    lost = [{**each, "median_s": math.nan, "status": "fail"} for each in many_rows()]
    assert charts(lost, "dem") == []


def page_of(rows: list[dict[str, Any]], folder: Path) -> str:
    facts = {"commit": "", "cpu": "c", "cores": 2, "python": "3"}
    write_bench({"run_id": "r", "argv": [], "provenance": facts, "versions": {}, "rows": rows}, folder / "page.html")
    return (folder / "page.html").read_text(encoding="utf-8")


def test_the_page_says_what_binds(tmp_path: Path) -> None:
    page = page_of(many_rows(), tmp_path)
    assert (
        "120 operations and 240 bytes a particle-step (1.6 contacts and 2 listed pairs a disk; 2 rebuilds in 1000 steps)"
        in page
    )
    assert "6 % of the bandwidth for its 1.5 MB, 30 % of the multiply-adds" in page
    assert "neither binds" in page
    assert "as far as is known" in page
    bound = page_of([under_roofs(traffic=2900.0)], tmp_path)
    assert "the bandwidth binds" in bound
    assert "as far as is known" not in bound
    assert "What bounds" not in page_of([row("settled-100")], tmp_path)


def test_an_estimate_names_its_problem() -> None:
    (found,) = estimates([under_roofs()])
    assert isinstance(found, Estimate)
    assert found.problem == "settled-10000"


def test_error_lines_lead_from_coarse_to_fine_steps_whatever_was_measured() -> None:
    """A slow minute under the coarsest step turns the line, and does not tangle it; its times have no marks of their own."""
    rows = [
        row("accuracy-nine-disks-overlap", "dem", 9, seconds, steps=steps, check_value=error)
        for steps, seconds, error in ((22000, 0.02, 1e-5), (5500, 0.03, 4e-5), (11000, 0.011, 2e-5))
    ]
    (chart,) = charts(rows, "dem")
    assert chart.dots[0].x == (0.03, 0.011, 0.02)
    assert chart.dots[0].y == (4e-5, 2e-5, 1e-5)


@pytest.mark.parametrize(("longest", "marks"), [(0.5, {"1e-2", "1e-1"}), (0.04, {"0.02", "0.04"})])
def test_measured_times_are_marked_by_decades_where_there_are_some(
    longest: float, marks: set[str], tmp_path: Path
) -> None:
    rows = [
        row("accuracy-nine-disks-overlap", "dem", 9, seconds, steps=round(1e3 * seconds), check_value=1e-5)
        for seconds in (0.02 if longest < 0.1 else 0.008, longest)
    ]
    (chart,) = charts(rows, "dem")
    draw_points(chart, tmp_path / "cost.svg")
    texts = {"".join(node.itertext()).strip() for node in ET.parse(tmp_path / "cost.svg").iter() if "text" in node.tag}
    assert marks <= texts
