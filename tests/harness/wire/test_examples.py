"""The example engines are real ones: on the cases they pass what the in-house DEM passes, and what they lack they say."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from ninedisk.harness import run_case
from ninedisk.harness.check_engine.check import check_engine
from ninedisk.harness.results.tables import CaseResult
from ninedisk.harness.wire.command import CommandEngine

pytestmark = pytest.mark.tree
EXAMPLES = Path(__file__).resolve().parents[3] / "docs" / "examples"
ENGINES = ("python", "c")
Run = Callable[..., CaseResult]


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("there is no C compiler cc")
    program = tmp_path_factory.mktemp("c") / "spring_dem"
    flags = ["-std=gnu11", "-O2", "-Wall", "-Wextra", "-Werror"]
    subprocess.run([compiler, *flags, "-o", str(program), str(EXAMPLES / "spring_dem.c"), "-lm"], check=True)
    return program


@pytest.fixture(scope="module", params=ENGINES)
def run(request: pytest.FixtureRequest) -> Run:
    """Runs a case on the example, the same variant once."""
    if request.param == "c":
        engine = CommandEngine(str(request.getfixturevalue("compiled")))
    else:
        engine = CommandEngine(f"{sys.executable} {EXAMPLES / 'spring_dem.py'}")

    @cache
    def run(case: str, **params: object) -> CaseResult:
        return run_case(case, engine=engine, params=params)

    return run


def test_compression_follows_the_exact_recurrence(run: Run) -> None:
    result = run("nine-disk/compression", load_case="a1", xi=3)
    assert result.status == "pass", result.reason
    exact = [row for row in result.rows if row["truth"] == "exact-step" and row["norm"] == "max"]
    assert len(exact) == 4
    assert all(row["abs_error"] <= 1e-9 * row["scale"] for row in exact)


@pytest.mark.parametrize(
    ("case", "params"),
    [
        # Their slip is that of the step's end.
        ("nine-disk/compression", {"load_case": "b2", "wall_mu": "mu", "xi": 0, "slip_at": "end"}),
        ("nine-disk/compression", {"damping_form": "lagged", "settle_cycles": 0, "slip_at": "end"}),
        ("binary-collision", {}),
        ("binary-collision", {"restitution": 0.5}),
        ("slip-to-roll", {"kn": 1e6}),
        ("incline-block", {"mu": 0.4, "preload": "false", "kn": 1e6}),
    ],
)
def test_they_pass(run: Run, case: str, params: dict[str, object]) -> None:
    result = run(case, **params)
    assert result.status in ("pass", "known-gap"), result.reason
    assert any(row["status"] == "pass" for row in result.rows)
    assert result.cell["support"] in ("exact", "approximate")


def test_what_they_lack_is_unsupported(run: Run) -> None:
    result = run("nine-disk/distortion")
    assert result.status == "unsupported"
    assert "walls with prescribed rotation" in result.reason


def test_both_compute_the_same(compiled: Path) -> None:
    """Rough walls, so that every force of the contact acts: to the round-off of 200 cycles, see the case's own tolerance."""
    params = {"load_case": "a2", "wall_mu": "mu", "xi": 0}
    engines = (CommandEngine(str(compiled)), CommandEngine(f"{sys.executable} {EXAMPLES / 'spring_dem.py'}"))
    one, two = (run_case("nine-disk/compression", engine=engine, params=params).history for engine in engines)
    assert one is not None
    assert two is not None
    for name in ("x", "v", "omega", "gap", "fn", "fs", "wall_point", "wall_angle", "wall_force"):
        first, second = getattr(one, name), getattr(two, name)
        np.testing.assert_allclose(first, second, rtol=0.0, atol=1e-9 * max(1e-3, np.abs(first).max()), err_msg=name)


SPHERES = EXAMPLES / "sphere_dem.py"


def test_spheres_mean_what_they_should_in_the_example() -> None:
    found = check_engine(CommandEngine(f"{sys.executable} {SPHERES}"))
    assert [each.check for each in found if each.status == "fail"] == []
    assert {each.check for each in found if each.status == "pass"} >= {
        *("supports: SPHERES", "supports: FRICTION", "supports: HERTZ_MINDLIN", "supports: UNLOADING_FORCE", "sampling")
    }


@pytest.mark.parametrize(
    ("right", "wrong", "check"),
    [
        ("kn * overlap / 1.5", "kn * overlap / 1.6", "HERTZ_MINDLIN"),
        ("min(1.0, a / a_before)", "1.0", "UNLOADING_RESCALE"),
        ('"none": a / a_before', '"none": 1.0', "UNLOADING_NONE"),
        ("torque[i] = plus(torque[i], turn, R[i])", "torque[i] = plus(torque[i], turn, -R[i])", "FRICTION"),
        ('"wall_force": force[n:]', '"wall_force": [[-each for each in f] for f in force[n:]]', "SPHERES"),
        ('"omega": middle[1]', '"omega": [[u, w, v] for u, v, w in middle[1]]', "SPHERES"),
    ],
)
def test_a_wrong_engine_of_spheres_is_found(right: str, wrong: str, check: str, tmp_path: Path) -> None:
    text = SPHERES.read_text(encoding="utf-8")
    assert text.count(right) == 1
    (tmp_path / "wrong.py").write_text(text.replace(right, wrong), encoding="utf-8")
    engine = CommandEngine(f"{sys.executable} {tmp_path / 'wrong.py'}")
    (found,) = check_engine(engine, only=[f"supports: {check}"])
    assert found.status == "fail", found


RIGID = EXAMPLES / "rigid_spheres.py"


def test_the_rigid_spheres_are_sound_and_obey_coulomb() -> None:
    engine = CommandEngine(f"{sys.executable} {RIGID}")
    found = check_engine(engine)
    assert [each.check for each in found if each.status == "fail"] == []
    assert {each.check for each in found if each.status == "pass"} >= {"supports: SPHERES", "supports: FRICTION"}
    for case in ("spheres/rolling", "spheres/incline"):
        result = run_case(case, engine=engine)
        assert result.status == "pass"
        assert {row["status"] for row in result.rows} == {"pass"}


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("spin[i] += turns[i] * radius[i] * np.cross(normal, change)", "spin[i] -= turns[i] * radius[i] * np.cross(normal, change)"),
        ('law.get("mu", 0.0) * pushed', '0.9 * law.get("mu", 0.0) * pushed'),
        ("v[i] += light[i] * change", "v[i] += 0.9 * light[i] * change"),
    ],
)  # fmt: skip
def test_wrong_rigid_spheres_are_found(right: str, wrong: str, tmp_path: Path) -> None:
    text = RIGID.read_text(encoding="utf-8")
    assert text.count(right) == 1
    (tmp_path / "wrong.py").write_text(text.replace(right, wrong), encoding="utf-8")
    found = check_engine(CommandEngine(f"{sys.executable} {tmp_path / 'wrong.py'}"), only=["supports: *"])
    assert "fail" in {each.status for each in found}


def test_scenes_of_the_plane_are_not_asked_of_an_engine_of_spheres() -> None:
    result = run_case("binary-collision", engine=CommandEngine(f"{sys.executable} {SPHERES}"))
    assert (result.status, "space only" in result.reason) == ("unsupported", True)


def test_a_wrong_stiffness_is_found(tmp_path: Path) -> None:
    text = (EXAMPLES / "spring_dem.py").read_text(encoding="utf-8")
    assert text.count('law["kn"] * gap') == 1
    wrong = tmp_path / "wrong.py"
    wrong.write_text(text.replace('law["kn"] * gap', '1.000001 * law["kn"] * gap'), encoding="utf-8")
    engine = CommandEngine(f"{sys.executable} {wrong}")
    assert run_case("nine-disk/compression", engine=engine, params={"settle_cycles": 0}).status == "fail"
