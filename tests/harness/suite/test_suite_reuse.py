"""A stored cell is judged unchanged where nothing changed, and run again where anything did."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from ninedisk.harness.results.store import write_run
from ninedisk.harness.run import provenance as provenance_module
from ninedisk.harness.run.plan import Cell, plan_matrix
from ninedisk.harness.run.provenance import provenance, source_digest
from ninedisk.harness.run.workers import run_cells
from ninedisk.harness.suite import items
from ninedisk.harness.suite.items import CellCheck, Plan, make_plan
from ninedisk.harness.suite.reuse import open_store

CASE, ENGINE = "slip-to-roll", "pymunk"
FACTS = {"started": "2026-01-01T00:00:00+00:00", "finished": "2026-01-01T00:00:01+00:00", "argv": ["ninedisk", "run"]}


@pytest.fixture(scope="module")
def cells() -> list[Cell]:
    return plan_matrix([CASE], [ENGINE], {})[:2]


@pytest.fixture(scope="module")
def store(cells: list[Cell], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("store")
    write(folder, "20260101T000000Z-aaaaaa", cells, jobs=2)  # as the command notes it
    return folder


def write(folder: Path, run_id: str, cells: list[Cell], **changes: Any) -> None:
    results = run_cells(cells)
    facts = {**FACTS, "provenance": {**provenance(result.cell for result in results), **changes}}
    write_run(folder, run_id, results, [], facts)


def test_a_run_of_the_same_code_is_judged(store: Path, cells: list[Cell]) -> None:
    stored = open_store(store)
    assert "20260101T000000Z-aaaaaa are judged as they are stored" in stored.message
    for cell, fresh in zip(cells, run_cells(cells), strict=True):
        found = stored.find(cell)
        assert found is not None
        assert [row["value"] for row in found.rows] == [row["value"] for row in fresh.rows]
        assert found.statuses == fresh.statuses


@pytest.mark.parametrize(
    "changes", [{"source": "0" * 64}, {"cpu": "another"}, {"packages": {"numpy": "1"}}, {"cores": 999}, {"kernel": "x"}]
)
def test_a_run_from_elsewhere_is_not(tmp_path: Path, cells: list[Cell], changes: dict[str, Any]) -> None:
    write(tmp_path, "20260102T000000Z-bbbbbb", cells[:1], **changes)
    stored = open_store(tmp_path)
    assert stored.find(cells[0]) is None
    assert f"had other {next(iter(changes))}" in stored.message


def test_the_newest_fitting_run_counts(tmp_path: Path, cells: list[Cell]) -> None:
    write(tmp_path, "20260101T000000Z-aaaaaa", cells)
    write(tmp_path, "20260102T000000Z-bbbbbb", cells[:1])
    write(tmp_path, "20260103T000000Z-cccccc", cells, source="other")
    stored = open_store(tmp_path)
    assert [stored.cells[cell.case.id, cell.variant.id, ENGINE][0][-6:] for cell in cells] == ["bbbbbb", "aaaaaa"]


def _other_scene(cell: Cell) -> Cell:
    assert not isinstance(cell.setup, Exception)
    scene = cell.setup.scene.replace(gravity=(0.0, -9.0))
    return dataclasses.replace(cell, setup=dataclasses.replace(cell.setup, scene=scene))


def _other_version(cell: Cell) -> Cell:
    class Newer:
        version = cell.case.version + 1

        def __getattr__(self, name: str) -> Any:
            return getattr(cell.case, name)

    return dataclasses.replace(cell, case=Newer())


def _other_engine(cell: Cell) -> Cell:
    engine = cell.engine
    assert not isinstance(engine, Exception)

    class Newer:
        def info(self) -> Any:
            return dataclasses.replace(engine.info(), version="0.0")

    return dataclasses.replace(cell, engine=Newer())


@pytest.mark.parametrize("change", [_other_scene, _other_version, _other_engine])
def test_a_cell_that_changed_runs(store: Path, cells: list[Cell], change: Callable[[Cell], Cell]) -> None:
    assert open_store(store).find(change(cells[0])) is None


@pytest.mark.usefixtures("fakes")
def test_third_party_cells_run(tmp_path: Path) -> None:
    cells = plan_matrix(["fake/fall"], ["fake-good"], {})
    write(tmp_path, "20260101T000000Z-aaaaaa", cells)
    assert open_store(tmp_path).find(cells[0]) is None


def test_a_store_that_is_not_there(tmp_path: Path) -> None:
    assert "there is no finished run" in open_store(tmp_path / "nowhere").message


def test_the_suite_runs_only_what_it_must(store: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ran = []
    run_cell = items.run_cell
    monkeypatch.setattr(items, "run_cell", lambda cell, **how: ran.append(cell.name) or run_cell(cell, **how))
    plan = make_plan([CASE], [ENGINE], [], None, store)

    def check(plan: Plan, number: int, collected: tuple[str, ...]) -> CellCheck:
        return CellCheck(plan.cells[number], "cell", collected, plan)

    collected = [tuple(name for name, _, _ in plan.names(cell)) for cell in plan.cells]
    check(plan, 0, collected[0]).verify()
    assert ran == []
    check(plan, 2, collected[2]).result()
    assert len(ran) == 1
    check(plan, 1, (*collected[1], "one-more")).result()  # other checks than those stored: digitised curves, say
    assert len(ran) == 2


def test_a_changed_source_has_another_digest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import ninedisk.references

    before = source_digest()
    assert before == json.loads(json.dumps(provenance()))["source"]
    (tmp_path / "facts.toml").write_text("g = 9.81")
    monkeypatch.setattr(ninedisk.references, "__file__", str(tmp_path / "__init__.py"))
    digests = set()
    for text in ("g = 9.81", "g = 9.80"):
        (tmp_path / "facts.toml").write_text(text)
        provenance_module.source_digest.cache_clear()
        digests.add(source_digest())
    provenance_module.source_digest.cache_clear()
    assert len(digests | {before}) == 3


@pytest.mark.tree
def test_make_test_looks_into_the_store_of_make_report() -> None:
    makefile = (Path(__file__).resolve().parents[3] / "Makefile").read_text()
    report, test = (makefile.partition(f"\n{name}: ")[2].partition("\n\n")[0] for name in ("report", "test"))
    assert '--store "$(STORE)"' in report
    assert '--ninedisk-store "$(STORE)"' in test
