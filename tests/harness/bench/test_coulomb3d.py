"""Suite ``coulomb3d``: problems in space out of a folder, answers judged by their forces alone, Siconos on the same files."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from typer.testing import CliRunner

from ninedisk.core.cd.delassus import DelassusProblem
from ninedisk.core.cd.problem_files import write_problem
from ninedisk.core.cd.settings import SolverOptions
from ninedisk.core.cd.solvers.by_matrix.solve import solve_matrix
from ninedisk.harness.bench.coulomb import TOLERANCES, Attempt, Climb, Given, Job, Racer, race, siconos_climbs
from ninedisk.harness.bench.coulomb3d import problem_files, racers
from ninedisk.harness.cli.app import app
from ninedisk.harness.engines import process
from ninedisk.harness.engines.siconos.adapter import installed_siconos
from ninedisk.references.contact_law import errors_of_forces

SICONOS = installed_siconos(process.SYSTEM_PYTHON)[0]


def problem(c: int = 8, seed: int = 0) -> DelassusProblem:
    """Contacts of bodies that press and slide, masses and friction unequal."""
    rng = np.random.default_rng(seed)
    h = rng.normal(size=(3 * c, 6 * c // 2)) * (rng.random((3 * c, 6 * c // 2)) < 0.3)
    w = h @ np.diag(rng.uniform(0.2, 5.0, h.shape[1])) @ h.T + 0.1 * np.eye(3 * c)
    b = rng.normal(size=(c, 3)) - [1.0, 0.0, 0.0]
    return DelassusProblem(w=sp.csr_array(w), b=b, mu=rng.uniform(0.1, 0.9, c))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "set").mkdir()
    write_problem(tmp_path / "set" / "eight.dat", problem(), "fc3d")
    write_problem(tmp_path / "set" / "five.npz", problem(5, 1), "npz")
    write_problem(tmp_path / "set" / "flat.npz", DelassusProblem(w=np.eye(2), b=[[-1.0, 0.0]], mu=[0.1]), "npz")
    (tmp_path / "set" / "readme.txt").write_text("no problem", encoding="ascii")
    return tmp_path / "set"


def test_problems_in_space_are_found_and_others_are_named(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert sorted(problem_files(folder)) == ["eight.dat", "five.npz"]
    said = " ".join(capsys.readouterr().out.split())
    assert "left out: flat.npz: its problem is of the plane" in said
    assert "left out: readme.txt:" in said
    assert "must be the dimension" in said


def test_the_command_prints_shares_and_writes_record_and_page(folder: Path, tmp_path: Path) -> None:
    arguments = ["bench", "--files", str(folder), "--engine", "none", "--repeats", "1", "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(app, arguments, prog_name="ninedisk")
    assert done.exit_code == 0, done.output
    (line,) = [line.split() for line in done.output.splitlines() if "ninedisk" in line and "%" in line]
    assert line[-1] == "2"
    assert line.count("100.0") == len(TOLERANCES)
    (page,) = (tmp_path / "out").glob("*.html")
    assert "Contact problems in space: who solves what" in page.read_text(encoding="utf-8")
    (record,) = (tmp_path / "out").glob("*.json")
    rows = json.loads(record.read_text(encoding="utf-8"))["rows"]
    assert {(row["problem"], row["contacts"]) for row in rows} == {("eight", 8), ("five", 5)}


def turned(r: np.ndarray, k: int) -> np.ndarray:
    """Friction of contact k turned by a hundredth of a radian: the cone does not see it."""
    wrong = r.copy()
    wrong[k, 1:] = np.array([[np.cos(0.01), -np.sin(0.01)], [np.sin(0.01), np.cos(0.01)]]) @ r[k, 1:]
    return wrong


def test_a_planted_answer_is_refused(tmp_path: Path) -> None:
    given = Given(problem(), tmp_path / "p", {"file": "p", "disks": 0, "sha256": ""})
    r = solve_matrix(problem(), SolverOptions(tolerance=1e-13), sliding="coulomb").r
    u = problem().velocity(r)
    k = int(np.argmax(np.hypot(r[:, 1], r[:, 2]) * np.hypot(u[:, 1], u[:, 2])))
    assert np.hypot(u[k, 1], u[k, 2]) > 0.1

    def answers(forces: np.ndarray, jobs: Sequence[Job], limit: float) -> list[Climb]:  # noqa: ARG001
        return [Climb((Attempt(1e-12, forces, 1e-9, 1, good=True),)) for _ in jobs]

    chosen = [
        replace(racers()[0]),
        Racer("right", "coulomb", partial(answers, r)),
        Racer("wrong", "coulomb", partial(answers, turned(r, k))),
    ]
    rows = race("coulomb3d", [given], chosen, repeats=1, time_limit=5.0, notify=lambda _: None)
    passed = {name: [row["status"] == "pass" for row in rows if row["engine"] == name] for name in ("right", "wrong")}
    assert passed["right"] == [True] * len(TOLERANCES)
    assert not any(passed["wrong"][1:])


@pytest.mark.skipif(SICONOS is None, reason="Siconos is not installed")
@pytest.mark.parametrize("name", ["NSGS", "NSN_AC", "ADMM"])
def test_siconos_solves_the_same_problem(name: str, tmp_path: Path) -> None:
    """W is regular and friction moderate: the solution is unique, so that forces agree and not the errors alone."""
    given = problem()
    write_problem(tmp_path / "p.npz", given, "npz")
    (climb,) = siconos_climbs(name, 3, [Job(given, tmp_path / "p.npz", (1e-6, 1e-9, 1e-12), 1e-7)], 20.0)
    last = climb.attempts[-1]
    assert errors_of_forces(given.w, given.b, given.mu, last.r).worst < 1e-6
    ours = solve_matrix(given, SolverOptions(tolerance=1e-12), sliding="coulomb").r
    np.testing.assert_allclose(last.r, ours, atol=1e-5 * np.abs(ours).max())
