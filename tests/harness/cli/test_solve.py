"""``ninedisk solve``: 0 only for solutions, planted wrong answers refused in every form."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from ninedisk.core.cd.delassus import DelassusProblem
from ninedisk.core.cd.problem import ContactProblem
from ninedisk.core.cd.problem_files import Form, read_problem, write_problem
from ninedisk.harness.cli.app import app

# Three disks of radius 1 in a row on a floor, the first pushed along: contacts with the floor slide, stick or open.
ROW = ContactProblem(
    mass=[[2.0, 2.0, 1.0]] * 3,
    force=[[9.0, -10.0, 0.0], [0.0, -10.0, 0.0], [0.0, 3.0, 0.0]],
    bodies=[[0, -1], [1, -1], [2, -1], [0, 1], [1, 2]],
    normal=[[0.0, -1.0], [0.0, -1.0], [0.0, -1.0], [1.0, 0.0], [1.0, 0.0]],
    arms=[[0.0, 0.0, 1.0, 0.0]] * 3 + [[0.0, 0.0, 1.0, 1.0]] * 2,
    offset=np.zeros((5, 2)),
    mu=[0.2, 0.3, 0.4, 0.1, 0.0],
)
FORMS: tuple[Form, ...] = ("npz", "fc2d", "fclib")


def ninedisk(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(each) for each in arguments], prog_name="ninedisk")


@pytest.mark.parametrize("sliding", ["coulomb", "associated"])
@pytest.mark.parametrize("form", FORMS)
def test_solved_written_and_judged_again(form: Form, sliding: str, tmp_path: Path) -> None:
    write_problem(tmp_path / "p", ROW, form)
    done = ninedisk("solve", tmp_path / "p", "--sliding", sliding, "--tolerance", "1e-11", "--out", tmp_path / "s")
    assert done.exit_code == 0, done.output
    assert "solved to 1e-11" in done.stdout
    assert ("duality gap" in done.stdout) == (sliding == "associated")
    assert ninedisk("solve", tmp_path / "s", "--check", "--sliding", sliding).exit_code == 0
    other = "associated" if sliding == "coulomb" else "coulomb"
    assert ninedisk("solve", tmp_path / "s", "--check", "--sliding", other).exit_code == 1


@pytest.mark.parametrize(
    ("digits", "tolerance", "said"), [(6, 1e-8, True), (6, 1e-5, False), (16, 1e-8, False), (9, 1e-10, True)]
)
def test_text_of_fewer_digits_than_the_tolerance_is_mentioned(
    digits: int, tolerance: float, said: bool, tmp_path: Path
) -> None:
    write_problem(tmp_path / "p", replace(ROW, mass=[[2.1234567890123, 2.1234567890123, 1.0]] * 3), "fc2d")
    text = (tmp_path / "p").read_text()
    short = re.sub(r"-?[0-9]\.[0-9]+e[-+][0-9]+", lambda found: f"{float(found.group()):.{digits}g}", text)
    (tmp_path / "p").write_text(short)
    done = ninedisk("solve", tmp_path / "p", "--tolerance", tolerance)
    assert done.exit_code == 0, done.output
    assert (f"at most {digits} significant digits" in done.stdout) == said


@pytest.mark.parametrize("lines", [0, 1])
def test_the_file_is_written_though_the_reader_of_the_output_leaves(lines: int, tmp_path: Path) -> None:
    write_problem(tmp_path / "p", ROW, "fc2d")
    command = [sys.executable, "-m", "ninedisk", "solve", str(tmp_path / "p"), "--out", str(tmp_path / "s")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        for _ in range(lines):
            process.stdout.readline()
        process.stdout.close()
        assert process.wait(60) == 0
    assert read_problem(tmp_path / "s").answer is not None


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("planted", ["slip turned", "contact pulled", "force scaled", "velocity turned"])
def test_planted_wrong_answers_are_refused(form: Form, planted: str, tmp_path: Path) -> None:
    write_problem(tmp_path / "p", ROW, form)
    ninedisk("solve", tmp_path / "p", "--tolerance", "1e-11", "--out", tmp_path / "s")
    found = read_problem(tmp_path / "s")
    assert found.answer is not None
    r, u = found.answer.r.copy(), found.answer.u.copy()
    slides = 2 * int(np.argmax(np.abs(u[1::2]) * r[::2]))
    assert abs(u[slides + 1]) > 0.1
    assert r[slides] > 0.1
    if planted == "slip turned":
        r[slides + 1] *= -1.0
    elif planted == "contact pulled":
        r[2 * int(np.argmin(r[::2]))] = -0.01
    elif planted == "force scaled":
        r[slides : slides + 2] *= 1.0 + 1e-6
    else:
        u[slides + 1] *= -1.0
    replace(found, answer=found.answer._replace(r=r, u=u)).save(tmp_path / "wrong")
    done = ninedisk("solve", tmp_path / "wrong", "--check")
    assert done.exit_code == 1, done.output
    assert "NOT solved" in done.stdout


# Three contacts of one body in space: one slips, one sticks, one opens.
SPACE = DelassusProblem(
    w=np.kron(np.array([[2.0, 0.5, 0.25], [0.5, 3.0, 0.5], [0.25, 0.5, 4.0]]), np.eye(3)) + 0.1 * np.eye(9),
    b=[[-3.0, 4.0, 1.0], [-2.0, 0.1, 0.2], [5.0, 1.0, 0.0]],
    mu=[0.3, 0.7, 0.5],
)


@pytest.mark.parametrize("sliding", ["coulomb", "associated"])
@pytest.mark.parametrize("form", ["npz", "fc3d", "fclib"])
def test_a_problem_in_space_is_solved_and_wrong_answers_are_refused(form: Form, sliding: str, tmp_path: Path) -> None:
    write_problem(tmp_path / "p", SPACE, form)
    done = ninedisk("solve", tmp_path / "p", "--sliding", sliding, "--tolerance", "1e-11", "--out", tmp_path / "s")
    assert done.exit_code == 0, done.output
    assert "3 contacts of a matrix in 3D" in done.stdout
    assert ninedisk("solve", tmp_path / "s", "--check", "--sliding", sliding).exit_code == 0
    found = read_problem(tmp_path / "s")
    assert found.answer is not None
    r = found.answer.r.reshape(3, 3)
    assert np.hypot(*r[0, 1:]) == pytest.approx(0.3 * r[0, 0])
    assert np.hypot(*r[1, 1:]) < 0.69 * r[1, 0]
    assert (r[2] == 0.0).all()
    for fault in (
        r * [[1, np.cos(1e-5), np.cos(1e-5)]] + [[0.0, 1e-5 * r[0, 2], -1e-5 * r[0, 1]]] * np.eye(3)[0][:, None],
        r * [[1.0, -1.0, -1.0], [1.0, 1.0, 1.0], [1.0, 1.0, 1.0]],
        r - np.array([[0.0] * 3, [0.0] * 3, [0.01, 0.0, 0.0]]),
        r * (1.0 + 1e-6),
    ):
        replace(found, answer=found.answer._replace(r=fault.ravel())).save(tmp_path / "wrong")
        refused = ninedisk("solve", tmp_path / "wrong", "--check", "--sliding", sliding)
        assert refused.exit_code == 1, refused.output


def test_a_matrix_that_is_not_symmetric_and_another_solver_are_named(tmp_path: Path) -> None:
    w = SPACE.w.toarray()
    w[0, 1] += 0.01
    write_problem(tmp_path / "p", replace(SPACE, w=w), "fc3d")
    done = ninedisk("solve", tmp_path / "p")
    assert done.exit_code == 0, done.output
    assert "W is unsymmetric by 0.002 of its largest entry" in done.stdout
    refused = ninedisk("solve", tmp_path / "p", "--solver", "gauss-seidel")
    assert (refused.exit_code, "works on bodies in the plane" in refused.output) == (2, True)


def test_what_no_forces_can_hold_apart_is_not_solved(tmp_path: Path) -> None:
    """Two obstacles that close in on a disk."""
    squeezed = ContactProblem(
        mass=[[1.0, 1.0, 1.0]],
        force=[[0.0, 0.0, 0.0]],
        bodies=[[0, -1], [0, -1]],
        normal=[[1.0, 0.0], [-1.0, 0.0]],
        arms=np.zeros((2, 4)),
        offset=[[-1.0, 0.0], [-1.0, 0.0]],
        mu=[0.0, 0.0],
    )
    for form in FORMS:
        write_problem(tmp_path / "p", squeezed, form)
        done = ninedisk("solve", tmp_path / "p", "--time-limit", "1")
        assert done.exit_code == 1, done.output
        assert "NOT solved" in done.stdout


def test_what_a_solver_had_when_it_gave_up_is_judged(tmp_path: Path) -> None:
    write_problem(tmp_path / "p", ROW, "npz")
    done = ninedisk(
        "solve", tmp_path / "p", "--solver", "gauss-seidel", "--time-limit", "1e-9", "--out", tmp_path / "s"
    )
    assert done.exit_code == 1
    assert "NOT solved: gauss-seidel stopped" in done.stdout
    assert "complementarity" in done.stdout
    assert "the forces it had (worst error 0.9" in done.stdout
    assert ninedisk("solve", tmp_path / "s", "--check").exit_code == 1


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (("--solver", "best"), "--solver 'best' is unknown: use one of auto"),
        (("--sliding", "free"), "use one of coulomb, associated"),
        (("--tolerance", "0"), "tolerance = 0.0 is not allowed"),
        (("--time-limit", "-1"), "time_limit = -1.0 is not allowed"),
        (("--check",), "holds no solution to check"),
        (("--check", "--out", "x"), "give one of them"),
        (("--out", "no/folder/x"), "cannot be written"),
        (("--solver", "interior-point"), "this file has a matrix alone"),
    ],
)
def test_wrong_usage_is_named(flags: tuple[str, ...], said: str, tmp_path: Path) -> None:
    write_problem(tmp_path / "p.dat", ROW, "fc2d")
    done = ninedisk("solve", tmp_path / "p.dat", *flags)
    assert done.exit_code == 2
    assert said in done.output
    absent = ninedisk("solve", tmp_path / "absent")
    assert (absent.exit_code, f"{str(tmp_path / 'absent')!r} cannot be read" in absent.output) == (2, True)
    assert "PosixPath" not in absent.output
