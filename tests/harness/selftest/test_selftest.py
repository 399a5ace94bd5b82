"""``ninedisk selftest``: right engines pass, wrong ones are caught, and a defect that nothing catches is given."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import astuple, replace
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from ninedisk.harness.cli.app import app
from ninedisk.harness.results.schema import Row
from ninedisk.harness.results.tables import CaseResult
from ninedisk.harness.selftest import mutants
from ninedisk.harness.selftest.declared import DECLARED
from ninedisk.harness.selftest.defect import Defect
from ninedisk.harness.selftest.edits import Edit
from ninedisk.harness.selftest.mutants import CLEAN, MUTANTS
from ninedisk.harness.selftest.run import MOVED, headline_moves, headlines_agree, is_as_expected, run_selftest

SPRING = ("dem.plane.force_kernels", "normal_force", "(kn - cohesion) * overlap")
HARMLESS = Defect(
    name="harmless",
    engine="dem",
    kind="kernel",
    what="forces are multiplied by one",
    witness="slide",
    edits=(Edit(*SPRING, f"{SPRING[-1]} * 1.0"),),
)
HOLE = replace(HARMLESS, name="hole", hole="it changes nothing")
CAUGHT = Defect(
    name="planted",
    engine="dem",
    kind="kernel",
    what="forces are a hundredth too large",
    witness="slide",
    edits=(Edit(*SPRING, f"{SPRING[-1]} * 1.01"),),
)
STALE = Defect(
    name="stale",
    engine="dem",
    kind="kernel",
    what="",
    witness="slide",
    edits=(Edit("dem.session", "", "no_such_name", "0"),),
)
CRASH = Defect(
    name="crash",
    engine="dem",
    kind="python",
    what="the engine dies",
    witness="slide",
    edits=(
        Edit(
            "dem.session",
            "DemSession.__init__",
            "self.scene, self.numerics = scene, numerics",
            "os._exit(7)",
        ),
    ),
)


CLOSED = replace(CAUGHT, name="closed", hole="nobody looks")


SEEN_BY = {
    "cd/polish-unchecked": "cd/solvers/test_polish.py::test_polish_refuses_what_is_not_exact",
    "cd/behind-walls": "test_walls.py::test_walls_that_cross",
}
"""Tests of the core that see what no case can."""
CORE_TESTS = Path(__file__).parents[2] / "core"
WITH_EDITS = """
import json, sys
from ninedisk.harness.selftest.edits import Edit, plant
plant([Edit(*edit) for edit in json.loads(sys.argv[1])])
import pytest
sys.exit(pytest.main(["-q", "-x", "-p", "no:xdist", "-p", "no:cacheprovider", sys.argv[2]]))
"""


pytestmark = pytest.mark.usefixtures("here")


@pytest.fixture
def own_mutants(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mutants, "MUTANTS", (HARMLESS, CAUGHT, STALE, CRASH, HOLE, CLOSED))


def ninedisk(*arguments: str) -> Result:
    return CliRunner().invoke(app, ["selftest", *arguments], prog_name="ninedisk")


def by_id(rows: list[Row]) -> dict[str, Row]:
    return {row["defect"]: row for row in rows}


@pytest.mark.usefixtures("own_mutants")
def test_a_caught_defect_is_fine_a_known_hole_is_excused_and_a_closed_one_is_reported(here: Path) -> None:
    names = ("--only", "planted", "--only", "hole", "--only", "closed")
    done = ninedisk(*names, "--quick", "--json", "rows.json", "--html", "page.html")
    assert done.exit_code == 0, done.output
    assert "known holes: dem/hole (it changes nothing)" in done.output
    assert "closed holes, whose notes must go: dem/closed (nobody looks)" in done.output
    assert "caught: 1 of 1 defects" in done.output
    rows = by_id(json.loads((here / "rows.json").read_text()))
    clean, wrong = rows["dem/unchanged"], rows["dem/planted"]
    assert (clean["caught"], clean["checks"], clean["errors"], clean["kind"]) == (False, [], [], "clean")
    assert len(clean["passed"]) == clean["judged"] > 10
    assert (wrong["caught"], wrong["kind"], wrong["what"]) == (True, "kernel", CAUGHT.what)
    assert "incline-block[mu=0.36,dt=0.01,kn=1e+06] gap (analytic)" in wrong["checks"]
    assert wrong["by_case"] == {"incline-block": len(wrong["checks"])}
    assert "All 1 defects are caught" in (here / "page.html").read_text()


@pytest.mark.usefixtures("own_mutants")
def test_a_defect_that_nothing_catches_and_an_engine_that_dies_are_reported(here: Path) -> None:
    done = ninedisk("--only", "harmless", "--only", "crash", "--quick", "--html", "page.html")
    assert done.exit_code == 1, done.output
    assert "missed: dem/harmless" in done.output
    assert "ended with status 7" in done.output
    assert "go unnoticed:</b> dem/harmless" in (here / "page.html").read_text()


@pytest.mark.usefixtures("own_mutants")
def test_a_stale_defect_ends_it_before_anything_runs(here: Path) -> None:
    done = ninedisk("--json", "rows.json")
    assert done.exit_code == 3
    assert "a planted defect went stale: in ninedisk.core.dem.session the expression 'no_such_name'" in done.output
    assert not (here / "rows.json").exists()


def test_a_wrong_engine_in_the_place_of_the_right_one_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    fake = Defect(name="unchanged", engine="dem", kind="clean", what="not so", edits=CAUGHT.edits)
    monkeypatch.setattr("ninedisk.harness.selftest.run.CLEAN", (fake,))
    rows = by_id(run_selftest([CAUGHT], quick=True))
    assert not is_as_expected(rows["dem/unchanged"])
    assert is_as_expected(rows["dem/planted"])


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("--only", "nothing-like-this"), "no planted defect matches 'nothing-like-this'"),
        (("--json", "."), "--json '.' is a folder"),
        (("--html", "."), "--html '.' is a folder"),
        (("--json", "no/such/folder.json"), "--json 'no/such/folder.json' cannot be written"),
        (("--jobs", "0"), "--jobs"),
    ],
)
def test_mistakes_are_named(arguments: tuple[str, ...], word: str) -> None:
    done = ninedisk(*arguments)
    assert done.exit_code == 2
    assert word in done.output
    assert "Traceback" not in done.output


def test_help_and_list_teach() -> None:
    done = ninedisk("--help")
    assert done.exit_code == 0
    for word in ("--only", "--jobs", "--quick", "--json", "--html", "Examples:", "Exit codes:"):
        assert word in done.output
    listed = ninedisk("--list", "--only", "cd/*")
    assert listed.exit_code == 0
    assert "cd/spin-sign" in listed.output
    assert "dem/" not in listed.output


def test_faulty_answers_are_given_under_both_declarations_and_a_refused_report_is_caught() -> None:
    rows = by_id(
        run_selftest([d for d in MUTANTS if d.name in ("no-time", "mass-more", "velocities-late")], quick=True)
    )
    assert set(rows) == {
        f"{engine}/{name}" for engine in DECLARED for name in ("unchanged", "no-time", "mass-more", "velocities-late")
    }
    assert all(is_as_expected(row) for row in rows.values())
    assert all("timings.advance = 0 s for" in rows[f"{engine}/no-time"]["errors"][0] for engine in DECLARED)


def test_as_many_faulty_answers_under_each_declaration() -> None:
    printed = {engine: [d.name for d in MUTANTS if d.engine == engine] for engine in DECLARED}
    assert printed["impulse"] == printed["soft"]
    assert len(printed["soft"]) >= 27


def test_a_headline_moves_where_it_is_off_by_more_than_round_off_or_loses_its_number() -> None:
    """By case the headline that moves most; a caught defect that moves none makes the engine look right."""

    def result(error: float, name: str = "distance") -> CaseResult:
        row = {"case": "slip-to-roll", "variant": "mu=0.3", "headline": name, "rel_error": error}
        return CaseResult(cell={}, rows=[], headlines=[row])

    right = {("slip-to-roll", "mu=0.3", "distance"): 1e-3, ("slip-to-roll", "mu=0.3", "final spin"): float("nan")}
    assert headline_moves([result(1e-3 + 0.1 * MOVED)], right)["slip-to-roll"] < MOVED
    assert headline_moves([result(0.5)], right)["slip-to-roll"] == pytest.approx(0.499)
    assert headline_moves([result(float("nan"))], right) == {"slip-to-roll": float("inf")}
    assert headline_moves([result(float("nan"), "final spin")], right) == {"slip-to-roll": 0.0}
    row = {
        "by_case": {"slip-to-roll": 3, "spinning-disk": 1},
        "headlines": {"slip-to-roll": 0.0, "spinning-disk": 0.1},
        "checks": ["slip-to-roll[mu=0.3] vx (analytic)", "spinning-disk[mu=0.3] vx (analytic)"],
    }
    assert headlines_agree(row) == ["slip-to-roll"]
    reported = {"by_case": {"contact/reopening": 1}, "headlines": {"contact/reopening": 0.0}}
    assert headlines_agree(reported | {"checks": ["contact/reopening[pair=wall] angle_first (exact-step)"]}) == []
    both = ["contact/reopening[pair=wall] angle_first (exact-step)", "contact/reopening[pair=wall] fn (exact-step)"]
    assert headlines_agree(reported | {"checks": both}) == ["contact/reopening"]


@pytest.mark.slow
def test_every_defect_is_caught_by_its_witness() -> None:
    rows = run_selftest(MUTANTS, quick=True, jobs=os.cpu_count() or 1)
    assert len(rows) == len(MUTANTS) + len(CLEAN)
    assert {row["defect"]: row["errors"] or row["checks"] for row in rows if not is_as_expected(row)} == {}
    assert [row["defect"] for row in rows if row["hole"] and row["caught"]] == []
    # What a check catches on its witness moves a headline of the case, or the case says why not.
    wrong = [row for row in rows if row["kind"] != "clean"]
    assert {row["defect"]: cases for row in wrong if (cases := headlines_agree(row))} == {}


def test_the_tests_that_see_what_no_case_can_are_there() -> None:
    for place in SEEN_BY.values():
        file, _, name = place.partition("::")
        assert f"def {name}(" in (CORE_TESTS / file).read_text(encoding="utf-8"), place


@pytest.mark.slow
@pytest.mark.parametrize("name", SEEN_BY)
def test_what_no_case_can_see_is_seen_by_a_test_of_the_core(name: str) -> None:
    (defect,) = [defect for defect in MUTANTS if defect.id == name]
    assert "tests of the core look there" in defect.hole

    def ended(edits: Sequence[Edit]) -> str:
        job = [astuple(edit) for edit in edits]
        environment = {**os.environ, "NUMBA_DISABLE_JIT": str(int(defect.kind == "kernel"))}
        command = [sys.executable, "-c", WITH_EDITS, json.dumps(job), str(CORE_TESTS / SEEN_BY[name])]
        done = subprocess.run(command, cwd=CORE_TESTS, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode in (0, 1), done.stdout + done.stderr
        return done.stdout.splitlines()[-1]

    assert "failed" not in ended(())
    assert "failed" in ended(defect.edits)


def test_every_hole_that_a_test_of_the_core_fills_names_it() -> None:
    assert {defect.id for defect in MUTANTS if "tests of the core" in defect.hole} == set(SEEN_BY)
