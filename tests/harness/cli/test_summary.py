"""What a run says at its end fits on a screen; `ninedisk show` has the rest."""

from __future__ import annotations

import json
import re
import shlex
import time
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.cli import support
from ninedisk.harness.cli.app import app
from ninedisk.harness.cli.run import show_summary
from ninedisk.harness.results.lacking import Ranking, ranking
from ninedisk.harness.results.schema import AS_DEFAULT, CELL_COLUMNS, EMPTY, HEADLINE_COLUMNS, MEASUREMENT_COLUMNS, Row

SCREEN = 40
"""Lines; `tools/main_job.py` adds at most `AROUND`."""
AROUND = 6


def filled(columns: dict[str, str], **given: Any) -> Row:
    return {**{column: EMPTY[kind] for column, kind in columns.items()}, **given}


def matrix(failing: int) -> tuple[list[Row], list[Row]]:
    """All engines on all cases: many not installed, each refusing scenes for its own reasons, some failing at length."""
    cells, rows = [], []
    for k in range(400):
        place = {"case": f"nine-disk/case-{k // 16}", "variant": f"load_case=a{k},xi=3", "engine": f"engine-{k % 16}"}
        status, reason = "pass", ""
        if k % 16 < 8:
            status, reason = "not-installed", f"no package {k % 16}; install it with: pip install engine-{k % 16}"
        elif k % 3 == 0:
            status, reason = "unsupported", f"it lacks shear of kind {k} " + "and a long list of other things " * 9
        elif failing > 0:
            failing -= 1
            status, reason = ("error", "fail")[k % 2], "\n".join(f"line {n} of reason {k}" for n in range(12))
        numbers = {"quantity": "fn_wall_mid", "truth": "analytic", "abs_error": 1.0, "atol": 0.5, "rtol": 0.0}
        if status in ("not-installed", "unsupported", "error"):
            numbers = {}
        cells.append(filled(CELL_COLUMNS, **place, status=status, reason=reason))
        rows.append(filled(MEASUREMENT_COLUMNS, **place, status=status, reason=reason, **numbers))
    return cells, rows


def headlines(cells: list[Row]) -> list[Row]:
    """Two of each cell that ran, and one without a truth; one cell has a larger error than all others."""
    ran = [cell for cell in cells if cell["status"] != "not-installed"]
    return [
        filled(HEADLINE_COLUMNS, **{name: cell[name] for name in ("case", "variant", "engine")}, headline="way", scale_is="height",
               rel_error=error if error != 0.25 or cell is not ran[5] else 0.996)
        for cell in ran
        for error in (0.25, 1e-9, float("nan"))
    ]  # fmt: skip


def printed(capsys: pytest.CaptureFixture[str], *arguments: Any, **more: Any) -> list[str]:
    show_summary(*arguments, **more)
    return capsys.readouterr().out.splitlines()


@pytest.mark.parametrize("failing", [0, 1, 5, 200])
@pytest.mark.parametrize("width", ["200", "80"])
def test_the_end_of_a_run_fits_on_a_screen(
    failing: int, width: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", width)
    monkeypatch.setattr("ninedisk.harness.terminal.PIPE_WIDTH", int(width))
    cells, rows = matrix(failing)
    lines = printed(capsys, cells, rows, Path("results/runs/20260101T000000Z-abcdef"), headlines(cells))
    assert len(lines) <= SCREEN - AROUND
    first = next(
        k
        for k, line in enumerate(lines)
        if line.startswith("largest errors against exact physics (200 case-engine pairs)")
    )
    told = 3 if failing else 8
    assert [line.split()[:2] for line in lines[first + 1 : first + told + 1]] == [
        ["99.6", "%"],
        *[["25", "%"]] * (told - 1),
    ]
    assert lines[first + told + 1] == f"... and {200 - told} more, half of them at most 25 %"
    (missing,) = [line for line in lines if line.startswith("not-installed: ")]
    assert all(f"engine-{k}" in missing for k in range(8))
    assert sum(line.startswith("unsupported: ") for line in lines) == 1
    assert "all checks and reasons: ninedisk show 20260101T000000Z-abcdef --store results" in lines
    named = [line for line in lines if line.startswith(("error: ", "fail: "))]
    assert len(named) == min(failing, 8)
    for cell in [cell for cell in cells if cell["status"] == "error"][: min(failing, 2)]:
        said = cell["reason"].splitlines()
        found = next(k for k, line in enumerate(lines) if line.endswith(said[0]) or f"{said[0]} ... {said[-1]}" in line)
        if failing == 1:  # where there is room for all of its lines
            assert lines[found + 1 : found + 12] == said[1:]


def test_a_terminal_of_80_columns_keeps_words_whole(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Statuses, engines and numbers are not broken up, nor is the heading, whose colours are no letters."""
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setenv("FORCE_COLOR", "1")
    cells, rows = matrix(5)
    lines = [re.sub(r"\x1b\[[0-9;]*m", "", line) for line in printed(capsys, cells, rows, None)]
    (heading,) = [line.split() for line in lines if "status" in line]
    assert heading == ["status", "case", "[variant]", "engine", "quantity", "found", "expected", "error", "allowed"]
    assert sum(line.split()[:1] == ["pass"] and "engine-" in line and "0.5" in line for line in lines) > 1


def test_one_long_piece_is_no_silence(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """The first use compiles within one cell, for half a minute."""
    monkeypatch.setattr(support, "LINE_SECONDS", 0.05)
    with support.CellProgress() as progress:
        progress(0, 7, "the first cell")
        time.sleep(0.3)
    assert capsys.readouterr().err.splitlines()[0] == "[0/7] the first cell"


def test_progress_says_how_long_the_rest_takes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 40 cells 10 were kept of an interrupted run: 6 that took 60 s imply that 24 more take 4 min."""
    now = 1000.0
    monkeypatch.setattr(support.time, "monotonic", lambda: now)
    progress = support.CellProgress(10)
    progress(10, 40, "a")
    assert progress._text() == "[10/40] a"
    now += 50.0
    progress(15, 40, "b")
    now += 10.0
    progress(16, 40, "b")
    assert progress._text() == "[16/40] about 4 min left, b (for 10 s)"
    progress(16, 40, "c")
    assert progress._text() == "[16/40] about 4 min left, c"
    progress(40, 40, "")
    assert progress._text() == "[40/40]"
    progress(0, 0, "solving")
    assert progress._text() == "solving"
    assert (support.LINE_SECONDS, [support.duration(each) for each in (9.6, 89.0, 5000.0, 7800.0)]) == (
        10.0,
        ["10 s", "89 s", "83 min", "2 h 10 min"],
    )


def test_a_line_of_progress_comes_again_and_again(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(support, "LINE_SECONDS", 0.05)
    with support.CellProgress() as progress:
        progress(0, 7, "the first cell")
        time.sleep(1.0)
    assert len(capsys.readouterr().err.splitlines()) >= 5


def test_passes_that_allow_much_are_counted(capsys: pytest.CaptureFixture[str]) -> None:
    place = {"case": "c", "variant": "v", "engine": "e", "status": "pass"}
    numbers = {"quantity": "x", "unit": "m", "abs_error": 0.0, "scale": 2.0, "atol": 0.0}
    rows = [filled(MEASUREMENT_COLUMNS, **place, **numbers, rtol=rtol) for rtol in (0.04, 0.05, 0.06)]
    lines = printed(capsys, [filled(CELL_COLUMNS, **place)], rows, None)
    assert "ran: 1 engine on 1 case" in lines
    assert "checks: 3 pass (1 of them wide: the tolerance is more than 5% of the reference)" in lines


def test_numbers_say_what_is_wrong_and_what_has_none_hides_none(capsys: pytest.CaptureFixture[str]) -> None:
    """A sign is seen at once; failures without a number share one line of their cell, after all others."""
    place = {"case": "c", "variant": "v", "engine": "e", "truth": "analytic", "unit": "rad/s", "atol": 0.1, "rtol": 0.0}
    nan, why = float("nan"), "the engine does not observe this quantity: every value is NaN"
    checks = [
        ("angle", nan, 3.0, nan, "fail", why),
        ("gap", nan, 0.0, nan, "fail", why),
        ("spin", -1.2, 1.2, 2.4, "fail", "found -1.2, expected +1.2: error 2.4 rad/s exceeds the tolerance 0.1"),
        ("spin_2", 0.0, 1.2, 1.2, "fail", "found +0, expected +1.2: error 1.2 rad/s exceeds the tolerance 0.1"),
        ("x", 1.0, 1.0, 0.0, "pass", ""),
    ]
    names = ("quantity", "value", "expected", "abs_error", "status", "reason")
    rows = [
        filled(MEASUREMENT_COLUMNS, **place, **dict(zip(names, check, strict=True))) for check in checks
    ]  # fmt: skip
    cells = [filled(CELL_COLUMNS, **{name: place[name] for name in ("case", "variant", "engine")}, status="fail")]
    for everything in (False, True):
        lines = printed(capsys, cells, rows, None, everything=everything)
        failures = [line for line in lines if line.startswith("fail")]
        assert failures == [
            "fail: c [v] e spin: found -1.2, expected +1.2: error 2.4 rad/s exceeds the tolerance 0.1 (analytic)",
            "fail: c [v] e spin_2: found +0, expected +1.2: error 1.2 rad/s exceeds the tolerance 0.1 (analytic)",
            f"fail: c [v] e, no value of angle, gap: {why}",
        ]
        assert sum("spin_2" in line for line in lines) == 1, "each failure once"
        (passed,) = [line.strip() for line in lines if line.strip().startswith("pass")]
        assert ("found +1, expected +1: error 0 rad/s, tolerance 0.1" in passed) == everything
    assert "checks: 4 fail, 1 pass" in lines


def unsupported(lacks: list[Capability], reason: str = "it lacks what it lacks", **more: str) -> Row:
    return filled(CELL_COLUMNS, case="c", variant="v", engine="e", status="unsupported", missing=json.dumps([*map(str, lacks)]),
                  reason=reason, **more)  # fmt: skip


def test_what_to_declare_is_ranked(capsys: pytest.CaptureFixture[str]) -> None:
    """By the cells that each capability alone unlocks, then by what most cells need together; settings of other engines are none."""
    rolling = [Capability.ROTATING_WALLS, Capability.CURVED_WALL_MOTION]
    cells = [unsupported([Capability.PRELOAD])] * 29 + [unsupported([Capability.GRAVITY])] * 2
    cells += [unsupported(rolling)] * 10 + [unsupported([*rolling, Capability.PRELOAD])] * 4
    cells += [unsupported([], f"the variant sets sliding, {AS_DEFAULT}")] * 18
    assert ranking(cells) == Ranking(
        alone=[("preload", 29), ("gravity", 2)],
        together=[(("preload",), 29), (("curved-wall-motion", "rotating-walls"), 43), (("gravity",), 45)],
    )
    lines = printed(capsys, [{**cell, "engine_runs": "command `x`, wire protocol"} for cell in cells], [], None)
    assert "e: each of these alone would unlock: preload 29 cells, gravity 2" in lines
    assert (
        "e: declared in this order, cells unlocked in all: preload 29, curved-wall-motion and rotating-walls 43, gravity 45"
        in lines
    )
    assert "cells: 63 unsupported; 18 of the unsupported only repeat the default variant" in lines


def test_unsupported_cells_have_their_reasons_where_these_are_many(capsys: pytest.CaptureFixture[str]) -> None:
    several = list(Capability)[:9]
    cells = [unsupported([each]) for each in several] + [unsupported([Capability.SPHERES])] * 30
    cells += [unsupported([], f"the variant sets impact, {AS_DEFAULT}")] * 5
    cells = [{**cell, "reason": f"{cell['reason']} {k}"} if k < 9 else cell for k, cell in enumerate(cells)]
    (line,) = [line for line in printed(capsys, cells, [], None) if line.startswith("unsupported: ")]
    assert line.startswith("unsupported: 44 cells on e; lacking: 30 spheres, 1 contact-damping, ")
    assert line.endswith("4 for other reasons, 5 only repeat the default variant")


def test_everything_is_everything(capsys: pytest.CaptureFixture[str]) -> None:
    cells, rows = matrix(200)
    text = "\n".join(printed(capsys, cells, rows, None, everything=True))
    for cell in cells:
        assert all(line in text for line in cell["reason"].splitlines())


def ninedisk(*words: str) -> Any:
    return CliRunner().invoke(app, words)


@pytest.mark.usefixtures("cells_here")
def test_the_command_that_a_run_names_shows_the_stored_run(tmp_path: Path) -> None:
    store = tmp_path / "a store"
    ran = ninedisk("run", "binary-collision", "-e", "pymunk", "-e", "box2d", "--store", str(store))
    line = next(line for line in ran.stdout.splitlines() if line.startswith("all checks and reasons: "))
    shown = ninedisk(*shlex.split(line.partition(": ")[2])[1:])
    assert shown.exit_code == 0, shown.output
    counts = [text for text in ran.stdout.splitlines() if text.startswith("cells: ")]
    assert counts[0] in shown.stdout
    assert " pass " not in shown.stdout, "what passes is counted only"
    one = ninedisk("show", "--engine", "pymunk", "--case", "binary-*", "--status", "pass", "--store", str(store))
    assert "pymunk" in one.stdout
    assert "box2d" not in one.stdout


@pytest.mark.usefixtures("fakes", "here")
def test_show_takes_the_newest_run_that_has_the_engine() -> None:
    for name in ("fake-nan", "fake-good"):
        ninedisk("run", "fake/fall", "-e", name)
    shown = ninedisk("show", "--engine", "fake-nan", "--status", "no-value")
    assert shown.exit_code == 0, shown.output
    assert shown.stderr.startswith("note: the newest run that has it is ")
    assert len([line for line in shown.stdout.splitlines() if line.startswith("fail: ")]) == 2
    assert ninedisk("show", "--engine", "fake-good").stderr == ""


@pytest.mark.usefixtures("cells_here")
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--status", "green"], "--status 'green' is unknown: use one of no-value, pass, fail"),
        (["--engine", "yade"], "no run of the store has a cell of --case * --engine yade; its engines: pymunk"),
        (["latest", "--engine", "yade"], "its engines: pymunk; leave RUN out for the newest run that has it"),
        (["latest~7"], "too far back"),
        (["20"], ""),
    ],
)
def test_wrong_words_for_show(tmp_path: Path, words: list[str], said: str) -> None:
    ninedisk("run", "binary-collision", "-e", "pymunk", "--set", "kind=plastic", "--store", str(tmp_path))
    shown = ninedisk("show", *words, "--store", str(tmp_path))
    assert shown.exit_code == (2 if said else 0)
    assert said in shown.output
    assert "Traceback" not in shown.output
