"""Contact problems as files: the same set from the same seed, every problem a file that can be solved, those of a run as they were."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from ninedisk.core.cd.problem import ContactProblem
from ninedisk.core.cd.problem_files import read_problem
from ninedisk.harness.bench.problem_set import FAMILIES, FRICTION, MANIFEST, content_hash, pyramid
from ninedisk.harness.cli.app import app


def ninedisk(*arguments: object) -> Result:
    return CliRunner().invoke(app, ["cd-problems", *(str(each) for each in arguments)], prog_name="ninedisk")


def test_the_set_of_a_seed_is_the_same_and_another_seed_makes_another(tmp_path: Path) -> None:
    found = []
    for folder, seed, form in (("a", 0, "fclib"), ("b", 0, "npz"), ("c", 1, "npz")):
        done = ninedisk("make", "--disks", 10, "--seed", seed, "--form", form, "--out", tmp_path / folder)
        assert done.exit_code == 0, done.output
        found.append(json.loads((tmp_path / folder / MANIFEST).read_text()))
    first, again, other = ([row["sha256"] for row in rows] for rows in found)
    assert first == again
    assert not set(first) & set(other)
    assert {row["family"] for row in found[0]} == set(FAMILIES)
    assert {row["mu"] for row in found[0]} == set(FRICTION)
    assert len(set(first)) == len(first)
    for row in found[0]:
        problem = read_problem(tmp_path / "a" / row["file"]).problem
        assert isinstance(problem, ContactProblem)
        assert content_hash(problem) == row["sha256"]
        assert (problem.n_contacts, set(problem.mu)) == (row["contacts"], {row["mu"]})
        assert (problem.compliance.max() > 0.0) == row["elastic"]
    moved = problem.offset.copy()
    moved[0, 0] = np.nextafter(moved[0, 0], 1.0)
    assert content_hash(ContactProblem(**{**vars_of(problem), "offset": moved})) != row["sha256"]


def vars_of(problem: ContactProblem) -> dict[str, np.ndarray]:
    names = ("mass", "force", "bodies", "normal", "arms", "offset", "mu", "compliance", "shear_0")
    return {name: getattr(problem, name) for name in names}


def test_a_pyramid_has_more_forces_than_equations() -> None:
    scene = pyramid(55, 0)
    assert len(scene.disks) == 55
    gaps = np.linalg.norm(scene.disks.x[:, None] - scene.disks.x[None], axis=2)[np.triu_indices(55, 1)] - 1.0
    assert gaps.min() > -1e-12
    assert 2 * ((gaps < 1e-9).sum() + 10) > 3 * 55


def test_the_problems_of_a_run_are_kept(tmp_path: Path) -> None:
    setting = ("--set", "sliding=coulomb", "--every", 50)
    done = ninedisk("collect", "incline-block", *setting, "--out", tmp_path / "p")
    assert done.exit_code == 0, done.output
    rows = json.loads((tmp_path / "p" / MANIFEST).read_text())
    assert len(rows) >= 2
    assert all(row["step"] % 50 == 0 and not row["failed"] for row in rows)
    for row in rows[:2]:
        done = CliRunner().invoke(app, ["solve", str(tmp_path / "p" / row["file"])], prog_name="ninedisk")
        assert done.exit_code == 0, done.output


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (("make", "--family", "heap"), "--family 'heap' is unknown: use one of settling"),
        (("make", "--disks", 5), "disks 10 .. 3000"),
        (("make", "--form", "csv"), "--form 'csv' is unknown: use one of npz"),
        (("collect", "incline-block", "--every", 0), "--every 0 is not allowed"),
        (("collect", "no-case"), "no case"),
        (("collect", "spheres/top"), "'spheres/top' is a case of spheres"),
    ],
)
def test_wrong_usage_is_named(flags: tuple[object, ...], said: str, tmp_path: Path) -> None:
    done = ninedisk(*flags, "--out", tmp_path / "p")
    assert done.exit_code == 2
    assert said in done.output
    assert not (tmp_path / "p").exists()
