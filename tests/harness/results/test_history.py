"""Synthetic histories: what is planted is marked at its commit, noise is not, and no line joins what differs."""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest

from ninedisk.harness.results.history import history
from ninedisk.harness.results.marks import error_shifts, timing_shifts
from ninedisk.harness.results.schema import Line, Point, Shift, StoreHistory

EPYC, XEON = "AMD EPYC, 2 cores, Linux x86_64", "Intel Xeon, 2 cores, Linux x86_64"


def shifts(found: StoreHistory, **wanted: str) -> list[tuple[Line, Shift]]:
    lines = [line for line in found.lines if all(getattr(line, name) == value for name, value in wanted.items())]
    return [(line, shift) for line in lines for shift in line.shifts]


def run_of(line: Line, shift: Shift) -> int:
    return line.points[shift.at].run


@pytest.mark.sampled(1)
@pytest.mark.long
@pytest.mark.parametrize("seed", range(2))
def test_fifty_noisy_runs_raise_no_alarm(synthetic: ModuleType, seed: int) -> None:
    """Log-normal noise of 10 %, 2 % doubled timings, drifting machines of different speed; 300 timings."""
    found = history(synthetic.snapshots(synthetic.Plan(runs=50, variants=5, seed=seed)))
    assert sum(line.kind == "timing" for line in found.lines) == 150 + 2
    assert [(line.quantity, shift) for line, shift in shifts(found)] == []
    assert found.comparisons == {}


def test_planted_changes_are_marked_at_their_commit(synthetic: ModuleType) -> None:
    plan = synthetic.Plan(
        runs=50,
        variants=3,
        machines=("AMD EPYC",),
        errors={("nine-disk/distortion", "k=1", "dem", "energy_final"): (31, 10.0)},
        timings={("slip-to-roll", "k=2", "dem"): (24, 1.3)},
        cells={("incline-block", "k=0", "yade"): (40, "error", "exit code -11")},
    )
    found = history(synthetic.snapshots(plan))
    ((line, shift),) = shifts(found, kind="error")
    assert (line.case, line.variant, line.engine, line.quantity) == (
        "nine-disk/distortion", "k=1", "dem", "energy_final",
    )  # fmt: skip
    assert found.runs[run_of(line, shift)].commit == synthetic.commit(31)
    assert (shift.verdict, shift.open) == ("worse", True)
    assert shift.after == pytest.approx(10.0 * shift.before)
    ((line, shift),) = shifts(found, kind="timing")
    assert (line.case, line.variant, line.engine, line.quantity) == ("slip-to-roll", "k=2", "dem", "stepping")
    assert synthetic.commit(24) in {found.runs[line.points[k].run].commit for k in range(shift.first, shift.last + 1)}
    assert abs(run_of(line, shift) - 24) <= 2
    assert shift.after / shift.before == pytest.approx(1.3, abs=0.12)
    assert shift.chance < 0.01
    around = (run_of(line, shift) - 1, run_of(line, shift))
    ((line, shift),) = shifts(found, kind="cell")
    assert found.runs[run_of(line, shift)].commit == synthetic.commit(40)
    assert shift.reason == "error: exit code -11"
    assert set(found.comparisons) == {(30, 31), around, (39, 40)}
    worse = {c.kind for c in found.comparisons[around].changes if c.verdict == "worse"}
    assert worse == {"timing"}, "the comparison around the mark takes the neighbours' timings, too"


@pytest.mark.long
def test_a_slowdown_is_placed_within_one_run_in_most_histories(synthetic: ModuleType) -> None:
    key = ("slip-to-roll", "k=1", "pymunk")
    places = []
    for seed in range(12):
        plan = synthetic.Plan(runs=45, machines=("AMD EPYC",), timings={key: (25, 1.3)}, seed=100 + seed)
        marks = shifts(history(synthetic.snapshots(plan)), kind="timing")
        assert {(line.case, line.variant, line.engine) for line, _ in marks} <= {key}
        places += [run_of(line, shift) for line, shift in marks]
    assert len(places) >= 10
    assert np.mean(np.abs(np.array(places) - 25) <= 1) > 0.8


def test_under_little_noise_a_slowdown_is_marked_at_its_very_commit(synthetic: ModuleType) -> None:
    plan = synthetic.Plan(noise=0.03, timings={("slip-to-roll", "k=1", "pymunk"): (24, 1.3)})
    found = history(synthetic.snapshots(plan))
    marks = shifts(found)
    assert [run_of(line, shift) for line, shift in marks] == [24, 25], "the first run on each of two machines"
    assert {(line.case, line.variant, line.quantity) for line, _ in marks} == {("slip-to-roll", "k=1", "stepping")}


def test_machines_and_case_versions_are_never_joined(synthetic: ModuleType) -> None:
    plan = synthetic.Plan(
        runs=40,
        versions={"nine-disk/compression": 20},
        errors={("nine-disk/compression", "k=0", "dem", "energy_final"): (20, 50.0)},
        cases=("nine-disk/compression", "slip-to-roll"),
        engines={"dem": "DEM"},
    )
    found = history(synthetic.snapshots(plan))
    for line in found.lines:
        assert {found.runs[point.run].machine for point in line.points} == {line.machine}
    two = [line for line in found.lines if line.case == "nine-disk/compression" and line.quantity == "energy_final"]
    spans = {(line.machine, line.case_version, line.variant): {p.run // 20 for p in line.points} for line in two}
    assert len(spans) == 2 * 2 * 2
    assert all(span == {version - 1} for (_, version, _), span in spans.items())
    assert shifts(found, kind="error") == [], "the error changed with the version: nothing to compare it with"


def test_a_whole_run_that_slows_down_has_its_own_line(synthetic: ModuleType) -> None:
    plan = synthetic.Plan(runs=40, machines=("AMD EPYC",), drift=0.0)
    runs = synthetic.snapshots(plan)
    slower = []
    for number, run in enumerate(runs):
        factor = 1.5 if number >= 20 else 1.0
        cells = {key: {**cell, "cpu_s": cell["cpu_s"] * factor} for key, cell in run.cells.items()}
        slower.append(replace(run, cells=cells))
    ((line, shift),) = shifts(history(slower), kind="timing")
    assert (line.case, line.quantity, run_of(line, shift)) == ("all timings", "speed of the whole run", 20)


def points(*errors: float, tolerance: float = 1.0) -> list[Point]:
    return [Point(k, e, tolerance, "fail" if e > tolerance else "pass", "") for k, e in enumerate(errors)]


@pytest.mark.parametrize(
    ("errors", "marks"),
    [
        ((0.3,) * 5 + (0.31,) * 5, []),
        ((1e-4,) * 5 + (5e-2,) * 5, []),  # below a tenth of the tolerance
        ((0.04,) * 5 + (0.4,) * 5, [(5, "worse", True)]),
        ((0.3,) * 5 + (3.0,) * 5, [(5, "worse", True)]),
        ((0.9,) * 5 + (1.1,) * 5, [(5, "worse", True)]),
        ((0.3,) * 4 + (3.0,) * 3 + (0.3,) * 4, [(4, "worse", False), (7, "better", False)]),
        ((0.2,) * 4 + (0.5,) * 4 + (0.8,) * 4 + (1.6,) * 4, [(4, "worse", True), (12, "worse", True)]),
        ((0.9,) * 3 + (1.1, 0.9, 1.1, 0.9, 1.1), [(3, "worse", True)]),  # flickers around its tolerance
        ((0.15, 0.8, 0.2, 0.6, 0.16, 0.9, 0.3, 0.7, 0.2), []),  # restless: no level to leave
        ((float("nan"), 0.3, 0.3, float("nan"), 0.9), [(4, "worse", True)]),
        ((0.0,) * 3 + (0.5,) * 3, [(3, "worse", True)]),
    ],
)
def test_marks_of_errors(errors: tuple[float, ...], marks: list[tuple[int, str, bool]]) -> None:
    assert [(s.at, s.verdict, s.open) for s in error_shifts(points(*errors))] == marks


def test_two_changes_of_a_timing() -> None:
    random = np.random.default_rng(4)
    logs = 0.05 * random.normal(size=60) + np.repeat([0.0, 0.5, 0.05], 20)
    found = timing_shifts(logs, lines=300)
    assert [(s.at, s.verdict, s.open) for s in found] == [(20, "worse", False), (40, "better", False)]


def test_only_the_newest_part_of_a_long_line_is_searched() -> None:
    logs = 0.02 * np.random.default_rng(4).normal(size=200)
    logs[170:] += 0.5
    (shift,) = timing_shifts(logs, lines=300)
    assert shift.at == 170
