"""Findings: what each declares exists, and its verdict follows the stored numbers, whatever is planted there."""

from __future__ import annotations

import json
import math
import shlex
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from click.testing import Result
from typer.testing import CliRunner

from ninedisk.harness.api import finding
from ninedisk.harness.api.case import Setup, headlines_of
from ninedisk.harness.api.finding import Finding, Size, finding_problems, known_findings, sign_of
from ninedisk.harness.api.registry import engine_table, get_case
from ninedisk.harness.cli.app import app
from ninedisk.harness.cli.support import parse_settings
from ninedisk.harness.results.findings import GROWN, evaluate, shows_finding
from ninedisk.harness.results.schema import DETERMINISM_KINDS, TABLES, EvaluatedFinding
from ninedisk.harness.run.judge import blank_history
from ninedisk.harness.run.plan import Cell, plan_matrix
from ninedisk.harness.run.runner import dry_checks

FINDINGS = known_findings()
CHEAP = ("cd/restitution-depends-on-phase", "cd/sliding-lifts", "source/a4-needs-tension", "cd/ratchet")
"""Findings of our own engine whose cells run in a second or two."""


@cache
def planned(command: str) -> dict[str, Cell]:
    """The cells of a ``ninedisk run`` command, by variant: planned as the command line plans them, and not run.

    An engine behind a command, which may not be installed, is planned as if it were one with rigid contacts that we know.
    """
    program, word, case, *rest = shlex.split(command)
    assert (program, word) == ("ninedisk", "run")
    given: dict[str, list[str]] = {"--engine": [], "--engine-cmd": [], "--set": [], "--option": []}
    for flag, value in zip(rest[::2], rest[1::2], strict=True):
        given[flag].append(value)
    settings = parse_settings(given["--set"]), parse_settings(given["--option"], flag="--option")
    return {cell.variant.id: cell for cell in plan_matrix([case], given["--engine"] or ["pymunk"], *settings)}


def test_ids_are_unique_and_name_their_engine() -> None:
    assert finding_problems() == ()
    assert len(FINDINGS) == len({each.id for each in FINDINGS}) >= 25
    assert all(each.engine in engine_table() or "--engine-cmd" in each.command for each in FINDINGS)
    assert all(each.id.partition("/")[0] in (each.engine, "source") for each in FINDINGS)


@pytest.mark.long
@pytest.mark.parametrize("each", FINDINGS, ids=lambda each: each.id)
def test_what_a_finding_says_exists(each: Finding) -> None:
    """Its case, column, quantity and command; the command runs cells of that engine that the size is read from."""
    if each.size.table == "determinism":
        space = each.size.variant.startswith("spheres/")
        assert each.command == f"ninedisk determinism --engine {each.engine}{' --spheres' * space}"
        assert each.size.variant.removeprefix("spheres/") in DETERMINISM_KINDS
        assert (each.size.case, each.size.column) == ("determinism", "difference")
        return
    size, cells = each.size, planned(each.command)
    columns = {*TABLES[size.table], "broken"} if size.table == "cells" else set(TABLES[size.table])
    assert size.column in columns
    assert size.over >= 0.0
    assert size.over_why
    assert each.engine not in engine_table() or {cell.engine_id for cell in cells.values()} == {each.engine}
    assert {cell.case.id for cell in cells.values()} == {get_case(size.case).id}
    mine = [cell for variant, cell in cells.items() if fnmatchcase(variant, size.variant)]
    assert mine
    asked = {size.quantity, size.per} - {"", "1"}
    assert asked <= set().union(*(reported_on(cell, size) for cell in mine))


def reported_on(cell: Cell, size: Size) -> set[str]:
    """Quantities that a cell measures by the size's truth, or its headlines: whichever table the size is read from."""
    assert isinstance(cell.setup, Setup)
    assert not isinstance(cell.engine, Exception)
    if size.table == "headlines":
        observed = cell.case.observe(cell.variant.params, cell.setup, blank_history(cell.setup))
        return {each.name for each in headlines_of(cell.case, cell.variant.params, cell.setup, observed)}
    checks = dry_checks(cell, cell.engine.info())
    return {check.quantity for check in checks if check.truth == size.truth or not size.truth}


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with what the cheap findings' commands run."""
    store = tmp_path_factory.mktemp("store")
    runner = CliRunner()
    for each in FINDINGS:
        if each.id in CHEAP:
            done = runner.invoke(app, [*shlex.split(each.command)[1:], "--store", str(store)])
            assert done.exit_code == 0, done.output
    return store


@pytest.mark.long
def test_the_commands_show_what_they_should(measured: Path) -> None:
    found = {each.id: each for each in evaluate(measured, FINDINGS)}
    assert set(found) == {each.id for each in FINDINGS}, "a check allows for a difference that no finding describes"
    assert {name: found[name].verdict for name in CHEAP} == dict.fromkeys(CHEAP, "there")
    assert all(
        found[name].verdict == "not-measured" and found[name].reason for name in found if found[name].engine != "cd"
    )


@pytest.fixture
def store(measured: Path, tmp_path: Path) -> Path:
    """A copy of it that a test may change."""
    return Path(shutil.copytree(measured, tmp_path / "store"))


@contextmanager
def rows_of(store: Path, name: str, run: str = "*") -> Iterator[list[dict[str, Any]]]:
    """All rows of a table, to be changed in place; they are written back."""
    files = sorted(store.glob(f"runs/{run}/{name}.parquet"))
    tables = [pq.ParquetFile(file).read() for file in files]
    rows = [table.to_pylist() for table in tables]
    yield [row for each in rows for row in each]
    for file, table, changed in zip(files, tables, rows, strict=True):
        pq.write_table(pa.Table.from_pylist(changed, table.schema), file)


def scaled(row: dict[str, Any], factor: float) -> None:
    """Multiply a row's error, with all that is stored of it."""
    row["value"] = row["expected"] + factor * (row["value"] - row["expected"])
    for name in {"abs_error", "rel_error"} & set(row):
        row[name] *= factor


def of_lift(store: Path, change: Callable[[dict[str, Any]], None], run: str = "*") -> None:
    with rows_of(store, "headlines", run) as rows:
        chosen = [row for row in rows if row["headline"] == LIFT and row["variant"] == "dt=0.01,g0=0"]
        assert chosen
        for row in chosen:
            change(row)


def of_rise(store: Path, change: Callable[[dict[str, Any]], None]) -> None:
    """The printed rise of the sliding particle, which is wrong by all of it: a known gap."""
    with rows_of(store, "measurements") as rows:
        chosen = [
            row for row in rows
            if (row["variant"], row["quantity"], row["truth"]) == ("dt=0.001,g0=0.001", "du_y_1", "published") and row["expected"]
        ]  # fmt: skip
        assert chosen
        for row in chosen:
            change(row)


def earlier(store: Path) -> None:
    """A run before: all of them once more, a year older."""
    for folder in list((store / "runs").iterdir()):
        older = Path(shutil.copytree(folder, folder.with_name(f"before-{folder.name}")))
        about = json.loads((older / "run.json").read_text())
        about.update(run_id=older.name, started="2020" + about["started"][4:])
        (older / "run.json").write_text(json.dumps(about))


NEW = "[0-9]*"
"""Folders of the runs that are not those of `earlier`."""
LIFT = "lift of the sliding particle"
PRINTED_RISE = (0.001 - 0.3 * 0.001) / (1.0 + 0.3**2)
"""Of (A.4), downwards [m]: gap 0.001 m, step 0.001 s, 1 m/s, mu = 0.3."""
LIFTS, TENSION = "cd/sliding-lifts", "source/a4-needs-tension"


def reported(store: Path, name: str) -> tuple[EvaluatedFinding, Result]:
    """What is found of a finding, and the command's answer about it."""
    (found,) = (each for each in evaluate(store, FINDINGS) if each.id == name)
    answer = CliRunner().invoke(app, ["findings", name, "--store", str(store)])
    assert f"verdict: {found.verdict}" in answer.output
    return found, answer


def test_a_size_that_is_gone(store: Path) -> None:
    of_lift(store, lambda row: scaled(row, 0.0))
    found, answer = reported(store, LIFTS)
    assert (found.verdict, found.size, answer.exit_code) == ("gone", 0.0, 1)


@pytest.mark.parametrize(("factor", "verdict"), [(0.99 * GROWN, "there"), (1.01 * GROWN, "larger")])
def test_a_size_that_grew_since_the_run_before(store: Path, factor: float, verdict: str) -> None:
    earlier(store)
    of_lift(store, lambda row: scaled(row, factor), run=NEW)
    found, answer = reported(store, LIFTS)
    assert (found.verdict, answer.exit_code) == (verdict, int(verdict == "larger"))
    assert found.size == pytest.approx(factor * found.before)


def test_results_of_another_definition_of_the_case_are_no_run_before(store: Path) -> None:
    earlier(store)
    of_lift(store, lambda row: scaled(row, 2.0), run=NEW)
    with rows_of(store, "cells", "before-*") as rows:
        for row in rows:
            row["case_version"] -= 1
    found, _ = reported(store, LIFTS)
    assert (found.verdict, found.before_run) == ("there", "")


@pytest.mark.parametrize(
    ("change", "size"),
    [
        ({}, PRINTED_RISE / 5e-3),  # the check's own scale: the displacement of five steps
        (
            {"truth": "", "column": "abs_error"},
            0.0,
        ),  # the exact steps say that nothing rises; what is printed does not count
        ({"column": "abs_error"}, PRINTED_RISE / 5e-3),
        ({"column": "abs_error", "per": "1"}, PRINTED_RISE),
        ({"column": "abs_error", "per": "gap"}, PRINTED_RISE / 1e-3),
    ],
)
def test_what_a_size_is_relative_to(measured: Path, change: dict[str, str], size: float) -> None:
    known = next(each for each in FINDINGS if each.id == TENSION)
    found = {each.id: each for each in evaluate(measured, [replace(known, size=replace(known.size, **change))])}[
        TENSION
    ]
    assert found.size == pytest.approx(size, abs=1e-9)


def test_a_size_beyond_what_its_known_difference_explains(store: Path) -> None:
    """A known gap's tolerance bounds nothing; a known difference does."""

    def declare(row: dict[str, Any], share: float) -> None:
        row.update(status="known-difference", finding=TENSION, known_size=share * row["abs_error"])

    of_rise(store, lambda row: declare(row, 1.01))
    assert reported(store, TENSION)[0].verdict == "there"
    of_rise(store, lambda row: declare(row, 0.99))
    found, answer = reported(store, TENSION)
    assert (found.verdict, answer.exit_code) == ("larger", 1)


def test_a_cell_that_breaks_now(store: Path) -> None:
    earlier(store)
    with rows_of(store, "cells", NEW) as rows:
        for row in rows:
            row.update(status="timeout", reason="stopped after 3 s")
    for name in ("measurements", "headlines"):
        for file in store.glob(f"runs/{NEW}/{name}.parquet"):
            pq.write_table(pq.ParquetFile(file).read().slice(0, 0), file)
    found, answer = reported(store, LIFTS)
    assert (found.verdict, answer.exit_code) == ("not-measured", 0)
    assert "stopped after 3 s" in found.reason


@pytest.mark.parametrize("column", ["value", "expected", "abs_error", "rel_error"])
def test_a_number_that_was_changed_alone(store: Path, column: str) -> None:
    """A row whose numbers do not hold together says nothing."""

    def forge(row: dict[str, Any]) -> None:
        row[column] += 0.3 * (1.0 if column == "rel_error" else row["scale"])

    of_rise(store, forge)
    found, _ = reported(store, TENSION)
    assert found.verdict == "not-measured"
    assert "contradicts itself" in found.reason


def test_another_version_is_named(store: Path) -> None:
    with rows_of(store, "cells") as rows:
        for row in rows:
            row["engine_version"] = "9.9"
    found, answer = reported(store, LIFTS)
    assert (found.verdict, answer.exit_code) == ("there", 0)
    assert "this is 9.9" in found.reason


@pytest.mark.parametrize(("error", "verdict"), [(0.5, None), (2.0, "there"), (4.0, "larger")])
def test_a_difference_that_no_finding_describes(store: Path, error: float, verdict: str | None) -> None:
    """An engine that declares one in a check is believed as far as it goes: tolerance 1, known size 3. What no check needs is none."""

    def declare(row: dict[str, Any]) -> None:
        row.update(
            status="pass",
            finding="mine/something",
            reason="mine/something: softness",
            atol=1.0,
            rtol=0.0,
            known_size=3.0,
        )
        row.update(value=row["expected"] + error, abs_error=error, rel_error=error / row["scale"])

    of_rise(store, declare)
    if verdict is None:
        assert "mine/something" not in {each.id for each in evaluate(store, FINDINGS)}
        return
    found, answer = reported(store, "mine/something")
    assert (found.verdict, answer.exit_code, found.what) == (verdict, int(verdict != "there"), "softness")
    assert found.size == pytest.approx(error / found.scale)


def test_sizes_are_relative_and_ranked(store: Path) -> None:
    found = evaluate(store, FINDINGS)
    sizes = [each.size for each in found if not math.isnan(each.size)]
    assert sizes == sorted(sizes, reverse=True)
    assert found[: len(sizes)] == [each for each in found if not math.isnan(each.size)]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["cd/sliding-lift"], "Did you mean 'cd/sliding-lifts'"),
        (["--engine", "yode"], "Engines with findings"),
        (["--json", "/nowhere/at/all.json"], "--json"),
    ],
)
def test_a_mistake_is_explained(store: Path, words: list[str], says: str) -> None:
    answer = CliRunner().invoke(app, ["findings", "--store", str(store), *words])
    assert answer.exit_code == 2
    assert says in answer.output + answer.stderr


@pytest.mark.parametrize("place", ["nowhere", "here"])
def test_what_is_known_is_listed_without_a_stored_run(place: str, store: Path, tmp_path: Path) -> None:
    folder = str(tmp_path / "nowhere" if place == "nowhere" else store)
    few = ["kratos/*"] if place == "here" else []
    answer = CliRunner().invoke(app, ["findings", "--store", folder, *few])
    assert answer.exit_code == 0, answer.output
    assert "note: none is measured, the store has no " in answer.stderr
    shown = " ".join(answer.stdout.split())
    for each in (each for each in FINDINGS if each.engine == "kratos" or place == "nowhere"):
        assert each.id in shown
    one = CliRunner().invoke(app, ["findings", "--store", folder, "kratos/arm-at-walls"])
    assert one.exit_code == 0
    assert "verdict: not-measured: the store has no " in one.stdout
    assert "see it: ninedisk run" in one.stdout


def test_json_holds_every_number(store: Path, tmp_path: Path) -> None:
    file = tmp_path / "found.json"
    answer = CliRunner().invoke(app, ["findings", "--store", str(store), "--json", str(file)])
    assert answer.exit_code == 0
    rows = {row["id"]: row for row in json.loads(file.read_text())}
    assert set(rows) == {each.id for each in FINDINGS}
    assert rows[LIFTS]["size"] == next(each.size for each in evaluate(store, FINDINGS) if each.id == LIFTS)
    assert rows["kratos/arm-at-walls"]["size"] is None


@pytest.mark.tree
def test_an_engine_by_its_command_is_held_against_what_is_known_of_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The example in Python measures slip at the end of a step: it has the ratchet, and does not lift. Repetitions are no cells to run."""
    ids = ("lammps/ratchet", LIFTS, "yade/first-order-turn", "box2d/order-of-bodies")
    few = tuple(each for each in FINDINGS if each.id in ids)
    monkeypatch.setattr(finding, "known_findings", lambda: few)
    example = Path(__file__).parents[3] / "docs" / "examples" / "spring_dem.py"
    file = tmp_path / "found.json"
    words = [
        "findings",
        "--engine-cmd",
        f"{sys.executable} {example}",
        "--store",
        str(tmp_path / "store"),
        "--json",
        str(file),
    ]
    answer = CliRunner().invoke(app, words)
    assert answer.exit_code == 0, answer.output
    rows = {row["id"]: row for row in json.loads(file.read_text())}
    assert {name: row["verdict"] for name, row in rows.items()} == {
        "lammps/ratchet": "there", LIFTS: "gone", "yade/first-order-turn": "not-measured",
        "spring-dem/ratchet": "there",  # what it declares itself
    }  # fmt: skip
    assert {row["engine"] for row in rows.values()} == {"spring-dem"}
    assert "walls with prescribed rotation" in rows["yade/first-order-turn"]["reason"]


def test_what_is_wrong_with_a_package_s_findings_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    """A module that cannot be read, and one that takes an id of ours, whose finding stays."""
    thief = ModuleType("thief")
    thief.FINDINGS = (replace(FINDINGS[0], what="mine"),)  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "thief", thief)
    modules = {**finding._modules(), "thief": "acme", "nowhere.findings": "acme"}
    monkeypatch.setattr(finding, "_modules", lambda: modules)
    found, wrong = finding._collect.__wrapped__()
    assert found == FINDINGS
    assert [FINDINGS[0].id in text or "nowhere.findings" in text for text in wrong] == [True, True]


@pytest.mark.parametrize(
    ("value", "expected", "sign"),
    [
        (1.2, 1.0, 1),
        (0.8, 1.0, -1),
        (-1.2, -1.0, 1),
        (-0.8, -1.0, -1),
        (-0.1, 0.0, -1),
        (1.0, 1.0, 0),
        (math.nan, 1.0, 0),
    ],
)
def test_too_large_is_by_size(value: float, expected: float, sign: int) -> None:
    assert sign_of(value, expected) == sign


@pytest.mark.parametrize(
    ("sign", "verdict", "word"), [(1, "there", "similar size"), (-1, "gone", "no"), (0, "there", "similar size")]
)
def test_an_error_of_the_other_sign_is_another_finding(store: Path, sign: int, verdict: str, word: str) -> None:
    """Contact dynamics lifts a sliding particle; a finding of particles that sink is not there, however large the error."""
    [lifts] = [each for each in FINDINGS if each.id == LIFTS]
    assert lifts.size.sign == 1
    mine = replace(lifts, size=replace(lifts.size, sign=sign))  # type: ignore[arg-type]
    [found] = [each for each in evaluate(store, [mine]) if each.id == LIFTS]
    assert (found.verdict, shows_finding(mine, found, found.size)) == (verdict, word)
    assert ("other sign" in found.reason) == (sign == -1)


def test_yes_needs_a_size_that_shows_the_cause(store: Path) -> None:
    """Otherwise the size is similar, or another one where the finding's own engine differs by more than a factor of two."""
    [lifts] = [each for each in FINDINGS if each.id == LIFTS]
    [found] = [each for each in evaluate(store, [lifts]) if each.id == LIFTS]
    assert shows_finding(replace(lifts, cause_tested=True), found, math.nan) == "yes"
    words = [shows_finding(lifts, found, factor * found.size) for factor in (math.nan, 1.9, 2.1, 0.4)]
    assert words == ["similar size", "similar size", "other size", "other size"]
