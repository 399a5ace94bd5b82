"""Lost shear history: a restart of our own DEM without its springs is named; the run that goes on is not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ninedisk.core import ContactLaw, History, Numerics, PlaneWall, Spheres, SphereScene, simulate
from ninedisk.harness.audit.run import audit
from ninedisk.harness.audit.scene_file import read_scene

LAW = ContactLaw(kn=1e5, ks=8e4, mu=0.5, beta=0.1, lever_arm="overlap")
PAIRS = [(0, 1), (0, 2), (1, 2)]
TOML = """gravity = [3.0, 0.0, -9.81]
time = {dt = 1e-5}
spheres = {radius = 0.1, mass = 4.0}
contact = {mu = 0.5, kn = 1e5, ks = 8e4}
walls = [{name = "floor", point = [0.0, 0.0, 0.0], normal = [0.0, 0.0, 1.0]}]
contacts = {file = "contacts.csv"}
"""


def scene() -> SphereScene:
    """Two spheres on a floor, touching, pushed along it."""
    return SphereScene(
        spheres=Spheres(
            x=[(0.0, 0.0, 0.0996), (0.1999, 0.0, 0.0996)], radius=0.1, mass=4.0, omega=[(0, 1, 0), (0, -2, 1)]
        ),
        walls=(PlaneWall(name="floor", point=(0, 0, 0), normal=(0, 0, 1), law=LAW),),
        sphere_sphere=LAW,
        gravity=(3.0, 0.0, -9.81),
    )


def run(start: SphereScene) -> History:
    return simulate(start, Numerics(dt=2e-4, n_steps=150, contact_dt=1e-5), watch=PAIRS)


def write(folder: Path, parts: list[History]) -> Path:
    rows, forces = ["t,id,x,y,z,vx,vy,vz,omegax,omegay,omegaz"], ["t,i,j,fn,fsx,fsy,fsz"]
    begin = 0.0
    for number, history in enumerate(parts):
        for k in range(1 if number else 0, len(history.t)):
            t = begin + history.t[k]
            for i in range(2):
                given = (*history.x[k, i], *history.v[k, i], *history.omega[k, i])
                rows.append(f"{t:.12g},{i}," + ",".join(f"{each:.15g}" for each in given))
            for column, (i, j) in enumerate(PAIRS):
                if history.fn[k, column] > 0.0:
                    shear = ",".join(f"{each:.12g}" for each in history.fs[k, column])
                    forces.append(f"{t:.12g},{i},{j if j < 2 else -1},{history.fn[k, column]:.12g},{shear}")
        begin += history.t[-1]
    (folder / "run.csv").write_text("\n".join(rows) + "\n")
    (folder / "contacts.csv").write_text("\n".join(forces) + "\n")
    (folder / "run.toml").write_text(TOML)
    return folder / "run.csv"


def check(file: Path, name: str = "history") -> dict[str, Any]:
    record = audit(file, read_scene(file.with_suffix(".toml")), lambda *_: None)
    return next(each for each in record["checks"] if each["id"] == name)


@pytest.mark.parametrize("lost", [False, True])
def test_a_restart_without_springs_is_named(lost: bool, tmp_path: Path) -> None:
    begin = scene()
    if not lost:
        found = check(write(tmp_path, [run(begin)]))
        assert found["verdict"] == "holds", found["said"]
        assert found["judged"] > 200
        return
    first = run(begin)
    spheres = replace(begin.spheres, x=first.x[-1], v=first.v[-1], omega=first.omega[-1])
    found = check(write(tmp_path, [first, run(replace(begin, spheres=spheres))]))
    assert found["verdict"] == "violated", found["said"]
    assert "lost history" in found["said"]
    assert found["first"]["t"] == pytest.approx(first.t[-1] + 2e-4)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("contacts = {", "# contacts = {", "no contact forces are given"),
        (", ks = 8e4", "", "needs contact.ks"),
        ("kn = 1e5", "kn = 1e9", "apart"),
    ],
)
def test_what_is_missing_is_named(old: str, new: str, words: str, tmp_path: Path) -> None:
    file = write(tmp_path, [run(scene())])
    (tmp_path / "run.toml").write_text(TOML.replace(old, new))
    found = check(file)
    assert found["verdict"] == "not decidable"
    assert words in found["said"]


def test_contacts_of_other_times_are_named(tmp_path: Path) -> None:
    file = write(tmp_path, [run(scene())])
    lines = (tmp_path / "contacts.csv").read_text().split("\n")
    shifted = [f"{float(t) + 1e-4:.12g},{rest}" for t, _, rest in (line.partition(",") for line in lines[1:-1])]
    (tmp_path / "contacts.csv").write_text("\n".join([lines[0], *shifted]) + "\n")
    assert "other times" in check(file)["said"]


@pytest.mark.parametrize(
    ("size", "change", "verdict"),
    [(1.0, {}, "holds"), (0.0, {}, "violated"), (1.0, {"0.1, m": '0.1, inertia = "disk", m'}, "violated")],
)
def test_torques_of_a_file_change_spins(size: float, change: dict[str, str], verdict: str, tmp_path: Path) -> None:
    """Torques of contacts by their arms; then none at all, and the inertia of disks."""
    history = run(scene())
    file = write(tmp_path, [history])
    lines = file.read_text().split("\n")
    for k in range(len(history.t)):
        torque = np.zeros((2, 3))
        for column, (i, j) in enumerate(PAIRS):
            apart = history.x[k, j] - history.x[k, i] if j < 2 else np.array([0.0, 0.0, -history.x[k, i, 2]])
            n = apart / np.linalg.norm(apart)
            each = np.cross(0.5 * (apart if j < 2 else apart + 0.1 * n), history.fs[k, column])
            torque[i] += each
            if j < 2:
                torque[j] += each
        for i in range(2):
            lines[1 + 2 * k + i] += "," + ",".join(f"{size * value:.12g}" for value in torque[i])
    lines[0] += ",tqx,tqy,tqz"
    file.write_text("\n".join(lines))
    text = TOML
    for old, new in change.items():
        text = text.replace(old, new)
    (tmp_path / "run.toml").write_text(text)
    assert check(file, "torque")["verdict"] == verdict, check(file, "torque")["said"]
