"""The mutants: every defect changes something, and only what it says; what no longer fits is reported."""

from __future__ import annotations

import ast
import importlib.util
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import ninedisk.core as core_of
from ninedisk.harness.api.case import Setup
from ninedisk.harness.api.engine import Timings
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.run.judge import blank_history
from ninedisk.harness.selftest.defect import KINDS, Defect
from ninedisk.harness.selftest.edits import Edit, StaleEditError, by_module, check_edits, edited
from ninedisk.harness.selftest.histories import STATE, WALLS
from ninedisk.harness.selftest.mutants import CLEAN, MUTANTS, chosen_defects, repeated_ids
from ninedisk.harness.selftest.panel import PANELS, panel_cells
from ninedisk.harness.selftest.run import touches_kernels


def of_kind(*kinds: str) -> list[Defect]:
    return [defect for defect in MUTANTS if defect.kind in kinds]


def setup_of(defect: Defect) -> Setup:
    (cell,) = panel_cells(defect.engine, [defect.witness])
    assert isinstance(cell.setup, Setup)
    return cell.setup


def source_of(module: str) -> str:
    spec = importlib.util.find_spec(module)
    assert spec is not None
    assert spec.origin is not None
    return Path(spec.origin).read_text(encoding="utf-8")


def test_it_is_large_and_has_every_kind_for_both_engines() -> None:
    assert len(MUTANTS) >= 40
    assert len(of_kind("kernel", "python")) >= 15
    assert {defect.kind for defect in MUTANTS} == set(KINDS) - {"clean"}
    assert {defect.engine for defect in MUTANTS} == set(PANELS)
    assert repeated_ids((*CLEAN, *MUTANTS)) == []
    assert all(defect.what and defect.witness in PANELS[defect.engine] for defect in MUTANTS)


@pytest.mark.parametrize("defect", of_kind("kernel", "python"), ids=lambda defect: defect.id)
def test_edits_change_what_the_modules_do(defect: Defect) -> None:
    check_edits(defect.edits)
    for module, edits in by_module(defect.edits).items():
        before = source_of(module)
        assert ast.dump(edited(before, edits)) != ast.dump(ast.parse(before))
        # The names of the core's modules say which hold kernels.
        holds = "core.compile import" in before
        assert all(touches_kernels(edit) == holds for edit in edits)
    assert any(touches_kernels(edit) for edit in defect.edits) == (defect.kind == "kernel")


def test_no_kernel_takes_a_constant_from_a_module_that_is_edited_beside_compiled_kernels() -> None:
    core = Path(core_of.__file__).parent
    read = {
        name
        for path in core.rglob("*kernels.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom)
        for name in (node.module, *(f"{node.module}.{each.name}" for each in node.names))
    }
    assert "ninedisk.core.dem.state" in read
    edits = [
        edit for defect in (*CLEAN, *MUTANTS) if not any(map(touches_kernels, defect.edits)) for edit in defect.edits
    ]
    assert edits
    assert read.isdisjoint(edit.name for edit in edits)


@pytest.mark.parametrize("defect", of_kind("scene", "numerics"), ids=lambda defect: defect.id)
def test_what_the_engine_is_reported_differs(defect: Defect) -> None:
    setup = setup_of(defect)
    assert defect.before is not None
    scene, numerics = defect.before(setup.scene, setup.numerics)
    assert (scene.to_dict() != setup.scene.to_dict()) == (defect.kind == "scene")
    assert (numerics.to_dict() != setup.numerics.to_dict()) == (defect.kind == "numerics")
    # The answer must still fit the question.
    assert numerics.sampled_steps().tolist() == setup.numerics.sampled_steps().tolist()


@pytest.mark.parametrize("defect", of_kind("history"), ids=lambda defect: defect.id)
def test_what_the_engine_reports_differs(defect: Defect) -> None:
    history = replace(blank_history(setup_of(defect)), energy={"kinetic": np.ones(1)})
    if defect.timed is not None:
        took = Timings(setup=1.0, warm_up=1.0, advance=1.0)
        assert defect.after is None
        assert defect.timed(took) != took
        return
    random = np.random.default_rng(1)
    names = (*STATE, *WALLS)
    for name in names:
        array = getattr(history, name)
        array[...] = random.standard_normal(array.shape)
    assert defect.after is not None
    report = defect.after(history)
    changed = {name for name in names if not np.array_equal(getattr(report, name), getattr(history, name))}
    assert changed or not np.array_equal(report.energy["kinetic"], history.energy["kinetic"])
    assert {name: getattr(report, name).shape for name in names} == {
        name: getattr(history, name).shape for name in names
    }
    assert np.array_equal(report.t, history.t)


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (Edit("dem.plane.force_kernels", "shear_force", "before - kx + slip", "before"), "occurs 0 times"),
        (Edit("dem.plane.force_kernels", "shear_force", "force", "0.0 * force"), "occurs [2-9] times"),
        (
            Edit("dem.plane.force_kernels", "shear_force", "before - ks * slip", "before - (ks * slip)"),
            "is its own replacement",
        ),
        (Edit("dem.no_such_module", "", "a", "b"), "there is no module"),
        (Edit("dem.plane.force_kernels", "no_such_function", "a", "b"), "is defined 0 times"),
    ],
    ids=["gone", "ambiguous", "idle", "no-module", "no-function"],
)
def test_an_edit_that_went_stale_is_reported(edit: Edit, said: str) -> None:
    with pytest.raises(StaleEditError, match=rf"went stale.*{said}") as caught:
        check_edits((edit,))
    assert edit.name in str(caught.value)


def test_patterns_choose_by_id_or_name() -> None:
    assert {defect.engine for defect in chosen_defects(["reaction"])} == {"dem", "cd"}
    assert [defect.id for defect in chosen_defects(["dem/reaction"])] == ["dem/reaction"]
    assert chosen_defects([]) == list(MUTANTS)
    with pytest.raises(UsageError, match=r"no planted defect matches 'dem/torqe-sign'.*Did you mean 'dem/torque-sign'"):
        chosen_defects(["dem/torqe-sign"])


def test_the_same_name_twice_is_found() -> None:
    assert repeated_ids((*MUTANTS, MUTANTS[0])) == [MUTANTS[0].id]
