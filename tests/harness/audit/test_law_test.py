"""``ninedisk law-test``: an independent integrator and our own DEM pass by files alone; each wrong convention is named."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from ninedisk.core import ContactLaw, Numerics, Spheres, SphereScene
from ninedisk.core.dem.space.session import WIDE, SphereSession
from ninedisk.harness.audit.law_test import MOTIONS, WORDS, judge_law_test, write_law_test
from ninedisk.harness.cli.app import app

pytestmark = pytest.mark.long
R, KN, KS, MU, C = 1.0, 1e7, 5e6, 0.5, 2e6
HEAD = "t,fx,fy,fz,tq1x,tq1y,tq1z,tq2x,tq2y,tq2z"


def ninedisk(*args: Any) -> Result:
    return CliRunner().invoke(app, ["law-test", *map(str, args)])


@pytest.fixture(scope="module")
def paths(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("law")
    write_law_test(folder)
    return folder


@pytest.fixture(scope="module")
def elastic(paths: Path) -> str:
    return integrated(paths / "shear-elastic.csv", "shear-elastic")


def copy_of(paths: Path, to: Path) -> Path:
    (to / "law.toml").write_text((paths / "law.toml").read_text())
    return to


def integrated(path: Path, motion: str, **how: Any) -> str:
    """Forces along a path of the file alone, written for this test: it shares nothing with the closed forms."""
    with path.open() as text:
        names = text.readline().strip().split(",")
    rows = np.loadtxt(path, delimiter=",", skiprows=1)
    column = {name: rows[:, k] for k, name in enumerate(names)}
    x, v, w = (
        [np.stack([column[f"{p}{a}{k}"] for a in "xyz"], axis=1) for k in (1, 2)] for p in ("", "v", "w")
    )  # fmt: skip
    t, spring, dn, lines = column["t"], np.zeros(3), np.array([0.0, 0.0, 1.0]), [HEAD]
    for k in range(len(t)):
        apart = x[1][k] - x[0][k]
        d = float(np.linalg.norm(apart))
        n, delta = apart / d, 2 * R - d
        h = t[k] - t[k - 1] if k else 0.0
        relative = v[1][k] - v[0][k]
        arm = R if how.get("slip_arm") == "radius" else R - delta / 2
        slip = relative - (relative @ n) * n - np.cross(arm * (w[0][k] + w[1][k]), n)
        if not how.get("kept"):
            spring = spring + np.cross(np.cross(dn, n), spring)
        if not how.get("untwisted"):
            spring = spring + h * 0.5 * ((w[0][k] + w[1][k]) @ n) * np.cross(n, spring)
        dn = n
        spring = spring + h * slip
        if not how.get("kept"):
            spring = spring - (spring @ n) * n
        fn = KN * delta * how.get("stiffer", 1.0) - (C * (relative @ n) if motion == "viscous" else 0.0)
        if not how.get("pulls"):
            fn = max(fn, 0.0)
        ks = KS * how.get("softer", 1.0)
        flat = spring - (spring @ n) * n
        limit = MU * how.get("mu", 1.0) * max(fn, 0.0)
        size = ks * float(np.linalg.norm(flat))
        shear = ks * flat * (min(1.0, limit / size) if size > 0 else 1.0)
        if size > limit and not how.get("uncut"):
            spring = shear / ks
        force = (-fn * n + how.get("shear_sign", 1.0) * shear) * how.get("sign", 1.0)
        lever = {"radius": R, "overlap": R - delta / 2, "none": 0.0}[how.get("torque_arm", "overlap")]
        torques = [lever * np.cross(n, force) * how.get(f"torque_{each}", 1.0) for each in (1, 2)]
        lines.append(",".join(f"{each:.9g}" for each in (t[k], *force, *torques[0], *torques[1])))
    return "\n".join(lines) + "\n"


def answered(paths: Path, to: Path, only: tuple[str, ...] = MOTIONS, **how: Any) -> dict[str, Any]:
    copy_of(paths, to)
    for motion in only:
        (to / f"{motion}.forces.csv").write_text(integrated(paths / f"{motion}.csv", motion, **how))
    return judge_law_test(to)


def violated(record: dict[str, Any]) -> set[str]:
    return {check["id"] for check in record["checks"] if check["verdict"] == "violated"}


def test_an_independent_integrator_passes_and_its_conventions_are_named(paths: Path, tmp_path: Path) -> None:
    record = answered(paths, tmp_path)
    assert violated(record) == set()
    found = {key: given["found"] for key, given in record["conventions"].items()}
    assert found == {
        "torque_arm": "overlap", "slip_arm": "overlap", "spring_turned": True, "spring_twisted": True, "spring_cut": True, "tension": False,
    }  # fmt: skip
    done = ninedisk("judge", tmp_path, "--json", tmp_path / "law.json")
    assert done.exit_code == 0, done.output
    assert "0 violated" in done.output
    assert json.loads((tmp_path / "law.json").read_text())["conventions"]["torque_arm"]["found"] == "overlap"


WRONG: list[tuple[dict[str, Any], set[str], str]] = [
    ({"kept": True}, {"rotation-in-plane/shear", "rotation-out-of-plane/shear"}, WORDS["spring_turned", False]),
    ({"uncut": True}, {"shear-plastic/shear", "unloading/shear"}, WORDS["spring_cut", False]),
    ({"pulls": True}, {"viscous/normal"}, WORDS["tension", True]),
    ({"torque_arm": "none"}, {"torque"}, "the arm that fits best is 0 m of sphere 1 and 0 m of sphere 2"),
    ({"torque_2": -1.0}, {"torque"}, "-0.97"),
    ({"sign": -1.0}, {"shear-elastic/normal", "viscous/normal"}, "all forces are reversed"),
    ({"shear_sign": -1.0}, {"shear-elastic/shear", "twist/shear"}, "the shear force is reversed"),
    ({"mu": 1.1}, {"shear-plastic/cone", "shear-plastic/shear"}, "beyond mu fn"),
    ({"softer": 0.95}, {"shear-elastic/shear"}, "shear force off"),
    ({"stiffer": 1.02}, {"shear-elastic/normal"}, "normal force off"),
]


@pytest.mark.parametrize(("how", "expected", "words"), WRONG, ids=[str(how) for how, _, _ in WRONG])
def test_a_wrong_law_is_named(how: dict[str, Any], expected: set[str], words: str, paths: Path, tmp_path: Path) -> None:
    only = tuple(m for m in MOTIONS if any(each.startswith(m) for each in expected))
    record = answered(paths, tmp_path, only or ("shear-elastic",), **how)
    assert expected <= violated(record)
    assert any(words in check["said"] for check in record["checks"] if check["id"] in expected)


@pytest.mark.parametrize(
    ("how", "key", "value", "only"),
    [
        ({"torque_arm": "radius"}, "torque_arm", "radius", ("shear-elastic", "spin")),
        ({"slip_arm": "radius"}, "slip_arm", "radius", ("spin", "rotation-in-plane", "rotation-out-of-plane")),
        ({"untwisted": True}, "spring_twisted", False, ("twist",)),
    ],
)
def test_a_declared_convention_is_held(
    how: dict[str, Any], key: str, value: Any, only: tuple[str, ...], paths: Path, tmp_path: Path
) -> None:
    record = answered(paths, tmp_path, only, **how)
    assert violated(record) == set()
    assert record["conventions"][key]["found"] == value
    text = (tmp_path / "law.toml").read_text()
    other = {"radius": '"overlap"', False: "true"}[value]
    (tmp_path / "law.toml").write_text(text + f"\n{key} = {other}\n")
    assert violated(judge_law_test(tmp_path))
    assert ninedisk("judge", tmp_path).exit_code == 1
    (tmp_path / "law.toml").write_text(
        text + f"\n{key} = {'false' if value is False else f'{value!r}'}\n".replace("'", '"')
    )
    assert not violated(judge_law_test(tmp_path))


@pytest.mark.parametrize("arm", ["radius", "overlap"])
def test_our_own_dem_passes(arm: Any, paths: Path, tmp_path: Path) -> None:
    """Held spheres whose velocities are set before each step."""
    copy_of(paths, tmp_path)
    for motion in MOTIONS:
        if motion == "viscous":  # the dashpot of this DEM pulls in space, and is given by a ratio
            continue
        (tmp_path / f"{motion}.forces.csv").write_text(own(paths / f"{motion}.csv", arm))
    record = judge_law_test(tmp_path)
    assert violated(record) == set()
    found = {key: given["found"] for key, given in record["conventions"].items()}
    assert found["slip_arm"] == arm
    assert found["spring_turned"] is True
    assert found["spring_twisted"] is True
    assert found["spring_cut"] is True


def own(path: Path, arm: Any) -> str:
    rows = np.loadtxt(path, delimiter=",", skiprows=1)
    t, x, w = rows[:, 0], rows[:, 1:7].reshape(-1, 2, 3), rows[:, 13:19].reshape(-1, 2, 3)
    h = float(t[1] - t[0])
    law = ContactLaw(kn=KN, ks=KS, mu=MU, lever_arm=arm)
    spheres = Spheres(
        x=x[0],
        radius=R,
        mass=np.full(2, 1e9),
        held=True,
        rotating=False,
        v=(x[1] - x[0]) / h,
        omega=0.5 * (w[0] + w[1]),
    )
    scene = SphereScene(spheres=spheres, sphere_sphere=law)
    session = SphereSession(scene, Numerics(dt=h, n_steps=len(t) - 1, contact_dt=h), watch=[(0, 1)])
    for k in range(len(t) - 1):
        session._state.v.reshape(-1, WIDE)[:2, :3] = (x[k + 1] - x[k]) / h
        session._state.omega.reshape(-1, WIDE)[:2, :3] = 0.5 * (w[k] + w[k + 1])
        session.advance(1)
    history = session.history()
    lines = ["t,fx,fy,fz"]
    for k in range(len(history.t)):
        apart = history.x[k, 1] - history.x[k, 0]
        force = -history.fn[k, 0] * apart / np.linalg.norm(apart) + history.fs[k, 0]
        lines.append(",".join(f"{each:.9g}" for each in (history.t[k], *force)))
    return "\n".join(lines) + "\n"


BAD: list[tuple[str, Callable[[str], str], str]] = [
    ("shear-elastic.forces.csv", lambda s: s.replace("fx", "gx", 1), "line 1: there is no column fx"),
    ("shear-elastic.forces.csv", lambda s: s.replace("fy", "fx", 1), "line 1: there is no column fy"),
    ("shear-elastic.forces.csv", lambda s: s + "1,2\n", "2 columns, expected 10"),
    ("shear-elastic.forces.csv", lambda s: "\n".join(s.split("\n")[:50]) + "\n", "at least 200 are needed"),
    ("shear-elastic.forces.csv", lambda s: "\n".join(s.split("\n")[:2000]) + "\n", "leave out more than 2 %"),
    ("shear-elastic.forces.csv", lambda s: s.replace(s.split("\n")[9], "a" + s.split("\n")[9]), "line 10, column 1 (t)"),
    ("shear-elastic.forces.csv", lambda s: s.replace(s.split("\n")[9], "nan" + ",1" * 9), "line 10: t = nan"),
    ("shear-elastic.forces.csv", lambda s: s.replace(s.split("\n")[9], s.split("\n")[5]), "line 10: t = "),
    ("shear-elastic.forces.csv", lambda _: "", "line 1: there is no column t"),
    ("law.toml", lambda s: s.replace("kn = 1e7", "kn = -1"), "kn = -1"),
    ("law.toml", lambda s: s.replace("mu = 0.5 ", "mu = 'x' "), "mu = 'x'"),
    ("law.toml", lambda s: s.replace("mu = 0.5 ", "mue = 1 "), "Did you mean 'mu'"),
    ("law.toml", lambda s: s + "torque_arm = 'wide'\n", "conventions.torque_arm = 'wide' is not allowed"),
    ("law.toml", lambda s: s + "tension = 0\n", "conventions.tension = 0 is not allowed"),
    ("law.toml", lambda s: s + "[", "is no TOML"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "spoil", "words"), BAD, ids=[words for _, _, words in BAD])
def test_bad_files_are_named(
    name: str, spoil: Callable[[str], str], words: str, paths: Path, elastic: str, tmp_path: Path
) -> None:
    copy_of(paths, tmp_path)
    (tmp_path / "shear-elastic.forces.csv").write_text(elastic)
    (tmp_path / name).write_text(spoil((tmp_path / name).read_text()))
    done = ninedisk("judge", tmp_path)
    assert done.exit_code == 2, done.output
    assert words in " ".join(done.output.split())
    assert name in done.output


def test_paths_follow_the_law_that_is_there(paths: Path, elastic: str, tmp_path: Path) -> None:
    """Paths of another radius are refused, as their forces would be judged by another motion; written anew they are judged."""
    text = (paths / "law.toml").read_text().replace("radius = 1.0", "radius = 0.9") + "\ntension = true\n"
    (tmp_path / "law.toml").write_text(text)
    (tmp_path / "shear-elastic.csv").write_text((paths / "shear-elastic.csv").read_text())
    (tmp_path / "shear-elastic.forces.csv").write_text(elastic)
    done = ninedisk("judge", tmp_path)
    assert done.exit_code == 2, done.output
    assert "line 2: this is not the path for radius = 0.9" in " ".join(done.output.split())
    assert ninedisk("write", tmp_path).exit_code == 0
    assert (tmp_path / "law.toml").read_text() == text
    assert ninedisk("judge", tmp_path).exit_code == 1  # the forces are still those of the smaller spheres


def test_what_is_missing_is_named(paths: Path, tmp_path: Path) -> None:
    assert "there is no folder" in ninedisk("judge", tmp_path / "none").output
    assert "law.toml" in ninedisk("judge", tmp_path).output
    copy_of(paths, tmp_path)
    assert "has no forces" in ninedisk("judge", tmp_path).output
    (tmp_path / "file").write_text("")
    assert ninedisk("write", tmp_path / "file").exit_code == 2
    assert ninedisk("write", tmp_path / "new").exit_code == 0
    assert len(list((tmp_path / "new").iterdir())) == len(MOTIONS) + 2


def test_motions_without_forces_are_an_error_unless_others_are_named(paths: Path, elastic: str, tmp_path: Path) -> None:
    """Exit code 0 says that what was asked was judged."""
    copy_of(paths, tmp_path)
    (tmp_path / "shear-elastic.forces.csv").write_text(elastic)
    done = ninedisk("judge", tmp_path)
    assert done.exit_code == 2, done.output
    assert "no forces for shear-plastic" in done.output
    assert "--only" in done.output
    done = ninedisk("judge", tmp_path, "--only", "shear-elastic")
    assert done.exit_code == 0, done.output
    done = ninedisk("judge", tmp_path, "--only", "shear-elastic", "--only", "spin")
    assert done.exit_code == 2
    assert "no forces for spin:" in done.output
    done = ninedisk("judge", tmp_path, "--only", "shear")
    assert done.exit_code == 2
    assert "there is no motion 'shear'" in done.output
    (tmp_path / "shear-elastic.forces.csv").write_text(
        integrated(paths / "shear-elastic.csv", "shear-elastic", stiffer=1.02)
    )
    assert ninedisk("judge", tmp_path).exit_code == 1


def test_the_page_shows_returned_forces_and_the_closed_form_worst_first(
    paths: Path, elastic: str, tmp_path: Path
) -> None:
    copy_of(paths, tmp_path)
    (tmp_path / "shear-elastic.forces.csv").write_text(elastic)
    (tmp_path / "spin.forces.csv").write_text(integrated(paths / "spin.csv", "spin", stiffer=1.02))
    words = ["--only", "shear-elastic", "--only", "spin", "--out", tmp_path / "page"]
    done = ninedisk("judge", tmp_path, *words)
    assert done.exit_code == 1, done.output
    page = (tmp_path / "page" / "index.html").read_text()
    assert page.index('id="spin"') < page.index('id="shear-elastic"')
    assert "✗ spin: violated" in page
    assert "✓ shear-elastic: holds" in page
    record = json.loads((tmp_path / "page" / "law-test.json").read_text())
    worst, other = record["motions"]
    assert worst["id"] == "spin"
    assert worst["ratio"] > 1.0 > other["ratio"]
    returned, expected = np.array(worst["curves"]["fz"])
    assert np.abs(returned).max() > 1.015 * np.abs(expected).max() > 0.0
    returned, expected = np.array(other["curves"]["fz"])
    np.testing.assert_allclose(returned, expected, atol=2e-3 * np.abs(expected).max())
    for words in ("fz returned", "fz closed form", "fx closed form"):
        assert words in page
    assert "fy returned" not in page  # it is zero
    done = ninedisk("judge", tmp_path, "--out", "/proc/x")
    assert done.exit_code == 2
    assert "'/proc/x' cannot be written" in done.output
