"""Suite ``coulomb``: solvers are believed by their forces alone; the set is kept and checked."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from ninedisk.core.cd.problem import ContactProblem
from ninedisk.core.cd.settings import SolverOptions
from ninedisk.core.cd.solvers.solver import ContactSolver
from ninedisk.harness.api.engine import EngineError
from ninedisk.harness.bench import coulomb, problem_set
from ninedisk.harness.bench.coulomb import BASE, TOLERANCES, Attempt, Climb, Job, Racer, judge, racers, run_state
from ninedisk.harness.cli.app import app
from ninedisk.harness.results.schema import Row

FAMILY, DISKS = "collapse", 10


@pytest.fixture(scope="module", autouse=True)
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An empty cache of problems."""
    made = tmp_path_factory.mktemp("problems")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(problem_set, "problem_folder", lambda: made)
        problem_set.stored_state(FAMILY, DISKS, seed=0)
    return made


@pytest.fixture(autouse=True)
def kept(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(problem_set, "problem_folder", lambda: folder)


def rows_of(some: Sequence[Racer], repeats: int = 1) -> list[Row]:
    found = run_state(FAMILY, DISKS, some, repeats=repeats, time_limit=20.0, notify=lambda _: None)
    return list(chain.from_iterable(found))


def by_name(name: str) -> Racer:
    return next(each for each in racers() if each.name == name)


def answer(problem: ContactProblem) -> np.ndarray:
    return ContactSolver("auto", SolverOptions(tolerance=1e-13), "coulomb").solve(problem).r


def slipping() -> tuple[ContactProblem, np.ndarray, int]:
    """A problem with its solution, and the contact with the largest friction of those that slide."""
    for file, row in problem_set.stored_state(FAMILY, DISKS, seed=0):
        if row["mu"] == 0.3:
            problem = ContactProblem.load(file)
            r = answer(problem)
            u = problem.contact_velocity(problem.body_velocity(r), r)
            sliding = (np.abs(r[:, 1]) >= problem.mu * r[:, 0] * (1.0 - 1e-9)) & (np.abs(u[:, 1]) > 1e-6)
            return problem, r, int(np.argmax(np.where(sliding, r[:, 0], -1.0)))
    raise AssertionError


def turned(r: np.ndarray, k: int) -> np.ndarray:
    """Friction of contact k along its slip."""
    wrong = r.copy()
    wrong[k, 1] *= -1.0
    return wrong


def pulled(r: np.ndarray, k: int) -> np.ndarray:
    """A force that pulls at contact k, a thousandth of the largest."""
    wrong = r.copy()
    wrong[k] = -2e-3 * np.abs(r).max(), 0.0
    return wrong


@pytest.mark.parametrize("plant", [turned, pulled])
def test_a_planted_answer_is_refused_at_every_tolerance(plant: object) -> None:
    """One slip turned, one contact pulled: nothing but the forces shows it, and the solver says that it is solved."""
    problem, r, k = slipping()
    assert judge(problem, r, "coulomb").solved(1e-12)
    assert r[k, 1] != 0.0
    assert judge(problem, plant(r, k), "coulomb").worst > TOLERANCES[0]  # type: ignore[operator]

    def faulty_solver(jobs: Sequence[Job], limit: float) -> list[Climb]:  # noqa: ARG001
        return [Climb((Attempt(1e-12, plant(answer(job.problem), k), 1e-9, 1, good=True),)) for job in jobs]  # type: ignore[operator]

    rows = rows_of([by_name(BASE["coulomb"]), Racer("liar", "coulomb", faulty_solver)])
    told = [row for row in rows if row["engine"] == "liar" and "mu0.3" in row["problem"]]
    assert [row["status"] for row in told] == ["not-reached"] * len(TOLERANCES)
    assert all('"claimed": true' in row["settings"] and row["median_s"] != row["median_s"] for row in told)
    assert {row["status"] for row in rows if row["engine"] == BASE["coulomb"]} == {"pass"}


def test_forces_that_are_no_numbers_are_no_solution() -> None:
    problem, r, k = slipping()
    lost = r.copy()
    lost[k, 0] = np.nan
    assert judge(problem, lost, "coulomb").worst == np.inf


@pytest.mark.parametrize("name", ["siconos nsgs", "siconos lemke", "siconos cpg", "clarabel"])
def test_solvers_beside_ours_solve_small_problems_or_are_not_there(name: str) -> None:
    racer = by_name(name)
    repeats = 2 if name == "siconos nsgs" else 1
    rows = [row for row in rows_of([by_name(BASE[racer.sliding]), racer], repeats) if row["engine"] == name]
    assert len(rows) == len(problem_set.FRICTION) * len(TOLERANCES)
    if not racer.version:
        assert {row["status"] for row in rows} == {"not-installed"}
        return
    loose = [row for row in rows if row["tolerance"] == 1e-3 and row["status"] == "pass"]
    assert len(loose) >= 3, [row["reason"] for row in rows]
    assert all(row["repeats"] == repeats and row["ratio"] > 0.0 and row["base"] == BASE[racer.sliding] for row in loose)
    assert all(row["check_value"] <= max(1e-3, row["check_bound"]) for row in loose)


def test_an_answer_that_comes_too_late_is_none() -> None:
    """Right forces, twice the limit."""

    def late(jobs: Sequence[Job], limit: float) -> list[Climb]:
        return [Climb((Attempt(1e-12, answer(job.problem), 2.0 * limit, 1, good=True),)) for job in jobs]

    rows = rows_of([Racer("late", "coulomb", late)])
    assert {row["status"] for row in rows} == {"not-reached"}
    assert max(row["check_value"] for row in rows) < 1e-10


def test_a_driver_that_is_stopped_costs_one_problem(monkeypatch: pytest.MonkeyPatch) -> None:
    """The signal of the limit ends the process; the problems behind it are asked for again."""
    asked: list[int] = []

    def run(command: object, *, stdin: str, **_: object) -> None:  # noqa: ARG001
        problems = json.loads(stdin)["problems"]
        asked.append(len(problems))
        for each in problems:
            if each["name"] == "slow":
                raise EngineError("ended by signal SIGALRM")
            none = {key: np.zeros(0) for key in ("own", "r", "seconds", "iterations", "good")}
            np.savez(each["answer"], done=True, error="", **none)  # type: ignore[arg-type]

    monkeypatch.setattr(coulomb, "run_isolated", run)
    requests = [{"name": name, "tolerances": [1e-3], "limit": 1.0} for name in ("one", "slow", "other", "last")]
    found = coulomb._ask_driver([], requests, None)
    assert [climb.status for climb in found] == ["not-reached", "timeout", "not-reached", "not-reached"]
    assert asked == [4, 2]


def test_problems_are_kept_and_made_again_where_a_file_is_another_one() -> None:
    (first, row), (second, _), *_ = problem_set.stored_state(FAMILY, DISKS, seed=0)
    stamp = first.stat().st_mtime_ns
    assert problem_set.stored_state(FAMILY, DISKS, seed=0)[0][0].stat().st_mtime_ns == stamp
    problem = ContactProblem.load(first)
    replace(problem, mu=np.nextafter(problem.mu, 9.0)).save(second)
    again = problem_set.stored_state(FAMILY, DISKS, seed=0)
    assert first.stat().st_mtime_ns != stamp
    assert again[0] == (first, row)
    assert [problem_set.content_hash(ContactProblem.load(file)) for file, _ in again] == [
        its["sha256"] for _, its in again
    ]


def test_the_command_prints_shares_and_writes_record_and_page(tmp_path: Path) -> None:
    arguments = [
        "bench",
        "coulomb",
        "--size",
        "10",
        "--problem",
        f"{FAMILY}-{DISKS}",
        "--engine",
        "none",
        "--repeats",
        "1",
    ]
    done = CliRunner().invoke(app, [*arguments, "--out", str(tmp_path)], prog_name="ninedisk")
    assert done.exit_code == 0, done.output
    assert [line.split()[-1] for line in done.output.splitlines() if "ninedisk" in line and "%" in line] == ["6", "6"]
    (page,) = tmp_path.glob("*.html")
    assert "who solves what" in page.read_text()
    (record,) = tmp_path.glob("*.json")
    rows = json.loads(record.read_text())["rows"]
    assert {(row["engine"], row["start"]) for row in rows} == {(name, rule) for rule, name in BASE.items()}
    assert len(rows) == 2 * len(problem_set.FRICTION) * len(TOLERANCES)
