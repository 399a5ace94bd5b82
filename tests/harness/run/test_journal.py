"""What an interrupted run keeps: every finished cell, bit by bit; nothing of other code, and nothing damaged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import Result
from typer.testing import CliRunner

from ninedisk.harness.cli.app import app
from ninedisk.harness.results.reader import read_about, read_run, run_ids
from ninedisk.harness.results.store import STALE_SECONDS, prune_candidates
from ninedisk.harness.results.tables import CaseResult
from ninedisk.harness.run import journal as module
from ninedisk.harness.run import workers
from ninedisk.harness.run.journal import KEPT, Journal, cell_digest, journals, packed_result, unpacked_result
from ninedisk.harness.run.plan import Cell, plan_matrix
from ninedisk.harness.run.workers import run_cells


def silent(_: str) -> None:
    raise AssertionError


@pytest.fixture
def cells(fakes: object, here: Path) -> list[Cell]:  # noqa: ARG001
    return plan_matrix(["fake/fall", "fake/spin"], ["fake-good", "fake-wrong", "fake-bug"], {})


def start(cells: list[Cell], run: bytes = b"r" * 32, *, resume: bool = True) -> Journal:
    return Journal.start(Path("results"), cells, run, resume=resume, notify=silent)


def test_a_result_comes_back_bit_by_bit(bits: Callable[[CaseResult], bytes]) -> None:
    (cell,) = plan_matrix(["binary-collision"], ["pymunk"], {"kind": "elastic"})[:1]
    (result,) = run_cells([cell])
    result.rows[0] |= {
        "value": -0.0,
        "abs_error": 0.1,
        "rel_error": 1.0 + 2.0**-52,
        "reason": "\udcff \u00e9",
    }
    back = unpacked_result(packed_result(result), cell)
    assert bits(back) == bits(replace(result, history=None))
    assert back.headlines == result.headlines
    same = replace(result, rows=[{"x": np.float64(0.1), "k": np.int64(3), "is": np.bool_(True)}])
    assert unpacked_result(packed_result(same), cell).rows == [{"x": 0.1, "k": 3, "is": True}]
    assert result.observed is not None
    assert back.observed is not None
    for name, (unit, values) in result.observed.series.items():
        assert back.observed.series[name][0] == unit
        assert back.observed.series[name][1].tobytes() == np.asarray(values).tobytes()
    assert back.observed.scalars == result.observed.scalars
    assert back.setup is cell.setup
    with pytest.raises(TypeError, match="a PosixPath is not kept"):
        packed_result(replace(result, rows=[{"x": Path()}]))


def test_finished_cells_are_kept_and_failed_ones_are_not(cells: list[Cell]) -> None:
    first = start(cells, resume=False)
    assert first.notes == []
    results = run_cells(cells, keep=first.keep)
    failed = [number for number, result in enumerate(results) if result.status == "error"]
    assert 0 < len(failed) < len(cells)
    assert start(cells).kept == {}  # the first run still goes on
    first.close_unfinished()
    again = start(cells)
    assert sorted(again.kept) == [number for number in range(len(cells)) if number not in failed]
    kept = len(cells) - len(failed)
    assert again.notes == [f"resumed: {kept} of {len(cells)} cells are kept of an interrupted run"]
    again.done()
    assert journals(Path("results")) == []


def test_a_run_that_is_not_resumed_says_what_is_kept(cells: list[Cell]) -> None:
    first = start(cells, resume=False)
    run_cells(cells[:2], keep=first.keep)
    said = first.close_unfinished()
    assert said.startswith(f"interrupted: 2 of {len(cells)} cells are kept in results/interrupted/")
    assert said.endswith("the same command with --resume runs the others")
    second = start(cells, resume=False)
    assert second.notes == [f"note: an interrupted run with 2 of {len(cells)} cells is kept: --resume continues it"]
    assert second.kept == {}
    second.done()  # it has had all cells of the first
    assert journals(Path("results")) == []


def test_nothing_to_resume(cells: list[Cell]) -> None:
    assert start(cells).notes == ["note: nothing to resume, no interrupted run is kept: every cell runs"]
    first = start(cells, resume=False)
    assert first.close_unfinished() == "interrupted: nothing was stored"
    run_cells(cells[:1], keep=first.keep)
    first.close_unfinished()
    other = start(cells, run=b"q" * 32)
    assert (other.kept, len(journals(Path("results")))) == ({}, 1)
    assert "what is kept is of other code, versions, cells or jobs" in other.notes[0]


@pytest.mark.parametrize("cut", [1, 40, 200, -1])
def test_a_torn_or_damaged_record_is_run_again(cells: list[Cell], cut: int) -> None:
    first = start(cells, resume=False)
    run_cells(cells[:2], keep=first.keep)
    first.close_unfinished()
    (path,) = journals(Path("results"))
    data = path.read_bytes()
    if cut > 0:
        path.write_bytes(data[:-cut])
    else:
        path.write_bytes(data[:-9] + bytes([data[-9] ^ 1]) + data[-8:])
    second = start(cells)
    assert sorted(second.kept) == [0]
    assert ("1 more are damaged" in second.notes[0]) is (cut < 0)
    run_cells(cells[:2], kept=second.kept, keep=second.keep)
    second.close_unfinished()
    assert sorted(start(cells).kept) == [0, 1]


@pytest.mark.parametrize("content", [b"", b"nothing of ours", bytes(400), b"\xff" * 400])
def test_a_file_that_is_no_journal_is_ignored(cells: list[Cell], content: bytes) -> None:
    path = Path("results/interrupted/20260101T000000Z-abcdef.journal")
    path.parent.mkdir(parents=True)
    path.write_bytes(content)
    journal = start(cells)
    assert journal.kept == {}
    assert journal.notes[0].startswith(f"note: {path} is damaged and ignored: ")


def test_cells_of_other_runs_stay_kept(cells: list[Cell]) -> None:
    """A run of two cells takes its own of a larger one, which stays for the others."""
    first = start(cells, resume=False)
    run_cells(cells[:4], keep=first.keep)
    first.close_unfinished()
    small = start(cells[:2])
    assert sorted(small.kept) == [0, 1]
    assert len(journals(Path("results"))) == 2
    small.done()
    assert len(journals(Path("results"))) == 1
    assert len(start(cells).kept) >= 3


def test_old_journals_go(cells: list[Cell], monkeypatch: pytest.MonkeyPatch) -> None:
    for _ in range(KEPT + 2):
        each = start(cells, resume=False)
        run_cells(cells[:1], keep=each.keep)
        each.close_unfinished()
    start(cells, resume=False)
    assert len(journals(Path("results"))) == KEPT
    assert prune_candidates(Path("results")) == []
    late = module.time.time() + 2.0 * STALE_SECONDS
    monkeypatch.setattr("ninedisk.harness.results.store.time.time", lambda: late)
    assert {each.reason for each in prune_candidates(Path("results"))} == {"interrupted run, untouched for a day"}
    done = CliRunner().invoke(app, ["prune", "--yes"])
    assert (done.exit_code, journals(Path("results"))) == (0, [])


def test_a_disk_that_is_full_ends_no_run(cells: list[Cell], monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    said: list[str] = []
    journal = Journal.start(Path("results"), cells, b"r" * 32, resume=False, notify=said.append)
    monkeypatch.setattr(Journal, "_append", full)
    assert len(run_cells(cells, keep=journal.keep)) == len(cells)
    assert said == ["note: cells are no longer kept for --resume: No space left on device"]


def test_what_decides_a_result_is_in_the_digest(cells: list[Cell], tmp_path: Path) -> None:
    digests = [cell_digest(cell) for cell in cells]
    assert len({*digests, None}) == len(cells) + 1
    assert [cell_digest(cell) for cell in cells] == digests
    assert cell_digest(replace(cells[0], setup=ValueError())) is None
    setup: Any = cells[0].setup
    changed = replace(setup, numerics=setup.numerics.replace(options={"fake-good.x": 1}))
    assert cell_digest(replace(cells[0], setup=changed)) not in digests
    script, beside = tmp_path / "engine.py", tmp_path / "helper.py"
    script.write_text("pass")
    before = module._of_command(f"python3 {script}")
    beside.write_text("1")
    module._of_command.cache_clear()
    after = module._of_command(f"python3 {script}")
    assert set(before) < set(after)


@pytest.mark.parametrize("jobs", ["1", "2"])
@pytest.mark.usefixtures("fakes", "here")
def test_ctrl_c_then_resume(monkeypatch: pytest.MonkeyPatch, jobs: str) -> None:
    words = ["run", "fake/fall", "fake/spin", "-e", "fake-good", "-e", "fake-wrong", "-e", "fake-bug", "--jobs", jobs]

    def ninedisk(*more: str) -> Result:
        return CliRunner().invoke(app, [*words, *more])

    def rows(run_id: str) -> list[dict[str, Any]]:
        return [
            {name: row[name] for name in ("case", "variant", "engine", "quantity", "value", "status", "reason")}
            for row in read_run(Path("results"), run_id)[1]["measurements"].replace(np.nan, None).to_dict("records")
        ]

    assert ninedisk().exit_code == 3
    (whole,) = run_ids(Path("results"))
    keep, kept = Journal.keep, 0

    def interrupted(self: Journal, number: int, result: CaseResult) -> None:
        nonlocal kept
        keep(self, number, result)
        if self._count == 2:
            kept = 2
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Journal, "keep", interrupted)
        done = ninedisk()
    assert done.exit_code == 130
    assert done.stderr.splitlines()[-1].startswith("interrupted: 2 of ")
    assert run_ids(Path("results")) == [whole]
    ran: list[str] = []
    real = workers.Task
    monkeypatch.setattr(workers, "Task", lambda **given: ran.append(given["cell"].name) or real(**given))
    done = ninedisk("--resume")
    assert done.exit_code == 3
    assert "resumed: 2 of " in done.stderr
    (resumed,) = {*run_ids(Path("results"))} - {whole}
    assert rows(resumed) == rows(whole)
    about = read_about(Path("results"), resumed)
    assert about["provenance"]["resumed"] == 2
    assert len(ran) == len({(row["case"], row["variant"], row["engine"]) for row in rows(whole)}) - 2
    assert journals(Path("results")) == []
