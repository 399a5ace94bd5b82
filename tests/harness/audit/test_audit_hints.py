"""Faults of what a user gives or of printed digits: rounded times, inertias that nobody gave, one stiffness for contacts of many."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from ninedisk.core import ContactLaw, Disks, Numerics, Scene, Spheres, SphereScene, simulate
from ninedisk.harness.cli.app import app

G = 9.81
FLIGHT = "gravity = [0.0, -9.81]\nwalls = []\nspheres = {radius = 0.1, mass = 2.0}\n"


def said(table: pd.DataFrame, toml: str, folder: Path) -> dict[str, tuple[str, str]]:
    """Verdict and words of each check, with what it could not decide."""
    table.to_csv(folder / "a.csv", index=False, float_format="%.12g")
    (folder / "a.toml").write_text(toml)
    done = CliRunner().invoke(app, ["audit", str(folder / "a.csv"), "--json", str(folder / "a.json")])
    assert done.exit_code in (0, 1), done.output
    return {
        check["id"]: (check["verdict"], "; ".join([check["said"], *check["why_not"]]))
        for check in json.loads((folder / "a.json").read_text())["checks"]
    }


def flight(t: np.ndarray, digits: int, spin: float = 37.123456) -> pd.DataFrame:
    """A disk that flies and spins, whose times are printed with so many digits behind the point."""
    return pd.DataFrame({
        "t": t.round(digits), "id": 1, "x": 0.31 * t, "y": 1.0 - t - 0.5 * G * t * t, "vx": 0.31, "vy": -1.0 - G * t,
        "angle": 0.1 + spin * t, "omega": 37.123456,
    })  # fmt: skip


@pytest.mark.parametrize("dt", ["", "time = {dt = 1e-5}\n"])
@pytest.mark.parametrize(("every", "digits"), [(123, 4), (102, 4), (123, 5), (100, 3)])
def test_rounded_times_violate_nothing(tmp_path: Path, every: int, digits: int, dt: str) -> None:
    """Steps of 1e-5 s, times of fewer digits. The first intervals look even: 1.02 ms is 0.0010 s forty-eight times of fifty."""
    checks = said(flight(np.arange(60) * every * 1e-5, digits), FLIGHT + dt, tmp_path)
    assert [name for name, (verdict, _) in checks.items() if verdict == "violated"] == []
    assert checks["turning"][0] == "holds"


@pytest.mark.parametrize(("every", "digits", "allowed"), [(123, 4, 0.2), (123, 5, 0.02)])
def test_angles_that_go_wrong_are_found_beside_rounded_times(
    tmp_path: Path, every: int, digits: int, allowed: float
) -> None:
    """A rounding of half a unit at both ends of an interval is the allowance: an angle beyond three of it is violated."""
    for share, verdict in ((0.0, "holds"), (3.0 * allowed, "violated")):
        table = flight(np.arange(60) * every * 1e-5, digits)
        table["angle"] += 37.123456 * share * 1e-5 * every * np.maximum(table.index - 30, 0)
        assert said(table, FLIGHT, tmp_path)["turning"][0] == verdict


def test_even_times_of_few_digits_are_exact(tmp_path: Path) -> None:
    """Times 0.001, 0.002 are multiples of the step: a spin off by 1e-6 is named, though the digits of t alone hide it."""
    t = np.arange(60) * 100e-5
    assert said(flight(t, 3, 37.123493), FLIGHT + "time = {dt = 1e-5}\n", tmp_path)["turning"][0] == "violated"


def sliding(inertia: float) -> pd.DataFrame:
    """Two bodies in the plane that meet, turn each other by friction and part; our own DEM, overlap arms."""
    law = ContactLaw(kn=1e5, ks=8e4, mu=0.3, lever_arm="overlap")
    scene = Scene(
        disks=Disks(
            x=[(0.0, 0.0), (0.25, 0.05)], radius=[0.1, 0.12], mass=[2.0, 3.0], v=[(1.0, 0.0), (-1.0, 0.0)],
            omega=[9.0, 4.0], inertia=[inertia * 2.0 * 0.01, inertia * 3.0 * 0.0144],
        ),
        disk_disk=law,
    )  # fmt: skip
    history = simulate(scene, Numerics(dt=2e-4, n_steps=200, contact_dt=2e-5))
    return frames(history.t, history.x, history.v, radius=[0.1, 0.12], mass=[2.0, 3.0]).assign(
        omega=history.omega.ravel()
    )


def frames(t: np.ndarray, x: np.ndarray, v: np.ndarray, **bodies: list[float]) -> pd.DataFrame:
    """A row for each body and frame."""
    n, d = x.shape[1:]
    columns = {name: np.tile(values, len(t)) for name, values in bodies.items()}
    for k, axis in enumerate("xyz"[:d]):
        columns |= {axis: x[:, :, k].ravel(), f"v{axis}": v[:, :, k].ravel()}
    return pd.DataFrame({"t": np.repeat(t, n), "id": np.tile(np.arange(1, n + 1), len(t))} | columns)


BARE = "dimension = 2\ntime = {dt = 2e-5}\ncontact = {mu = 0.3, kn = 1e5, ks = 8e4}\nwalls = []\n"
HINT = 'inertia is not given and that of disks, m R^2/2: spheres in a plane (LAMMPS, YADE) have 2/5, inertia = "sphere"'


@pytest.mark.parametrize(
    ("given", "walls", "verdict", "hint"),
    [
        ("", "[]", "violated", True),
        ("", '"unknown"', "not decidable", True),
        ('spheres = {inertia = "disk"}\n', "[]", "violated", False),
        ('spheres = {inertia = "sphere"}\n', "[]", "holds", False),
    ],
)
def test_spheres_in_a_plane_without_an_inertia_are_asked_for_it(
    tmp_path: Path, given: str, walls: str, verdict: str, hint: bool
) -> None:
    checks = said(sliding(0.4), BARE.replace("[]", walls) + given, tmp_path)
    assert checks["spin"][0] == verdict
    assert (HINT in checks["spin"][1]) == hint
    assert all("different stiffnesses" not in words for _, words in checks.values())


def test_disks_without_an_inertia_hold(tmp_path: Path) -> None:
    assert said(sliding(0.5), BARE, tmp_path)["spin"][0] == "holds"


def test_one_stiffness_for_contacts_of_several_is_asked_for(tmp_path: Path) -> None:
    """Two pairs, with kn in proportion to the radii as YADE's, and the larger one's given for both; without kn nothing is violated."""
    radius = [0.1, 0.1, 0.02, 0.02]
    laws = {("large", "large"): ContactLaw(kn=1e5), ("small", "small"): ContactLaw(kn=2e4)}
    scene = SphereScene(
        spheres=Spheres(
            x=[(0.0, 0.0, 0.0), (0.21, 0.0, 0.0), (0.0, 1.0, 0.0), (0.042, 1.0, 0.0)], radius=radius, mass=[2.0, 2.0, 0.1, 0.1],
            v=[(1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)] * 2, material=["large", "large", "small", "small"],
        ),
        sphere_sphere=ContactLaw(kn=1e5),
        laws=laws,
    )  # fmt: skip
    history = simulate(scene, Numerics(dt=1e-4, n_steps=250, contact_dt=1e-5))
    table = frames(history.t, history.x, history.v, radius=radius, mass=[2.0, 2.0, 0.1, 0.1])
    stated = "dimension = 3\ntime = {dt = 1e-5}\ncontact = {mu = 0.0, restitution = 1.0, kn = 1e5}\nwalls = []\n"
    checks = said(table, stated, tmp_path)
    assert {name for name, (verdict, _) in checks.items() if verdict == "violated"} == {"energy", "kept", "overlap"}
    assert "if contacts have different stiffnesses (Hertz, YADE), take kn out of the TOML" in checks["energy"][1]
    checks = said(table, stated.replace(", kn = 1e5", ""), tmp_path)
    assert [name for name, (verdict, _) in checks.items() if verdict == "violated"] == []
    assert "the engine's step may gain as much in contacts of unknown stiffness: give kn" in checks["energy"][1]
    faster = table.assign(vx=table.vx * np.where((table.t > 0.0201) & (table.id < 3), 1.1, 1.0))
    assert said(faster, stated.replace(", kn = 1e5", ""), tmp_path)["energy"][0] == "violated"


def leapfrog(kick: float, last: float = 1.0) -> pd.DataFrame:
    """Two disks in flight, with velocities of half a step of 1e-4 s before the positions, ``kick`` of it; the first are of the start."""
    t = np.arange(30) * 1e-3
    tables = []
    for body, share in ((1, 1.0), (2, last)):
        late = np.where(t > 0.0, kick * share * 0.5e-4, 0.0)
        y, vy = 1.0 - t - 0.5 * G * t * t, -1.0 - G * (t - late)
        tables.append(pd.DataFrame({"t": t, "id": body, "x": 2.0 * body, "y": y, "vx": 0.0, "vy": vy}))
    return pd.concat(tables).sort_values(["t", "id"])


@pytest.mark.parametrize(
    ("kick", "last", "verdict"),
    [(1.0, 1.0, "holds"), (-1.0, 1.0, "holds"), (0.0, 1.0, "holds"), (0.9, 1.0, "violated"), (1.0, 0.0, "violated")],
)
def test_the_start_of_a_leapfrog_is_no_jump(tmp_path: Path, kick: float, last: float, verdict: str) -> None:
    """Half a step of gravity, of all bodies in flight, is one; any other share, or of one body alone, is not."""
    checks = said(leapfrog(kick, last), FLIGHT + "time = {dt = 1e-4}\n", tmp_path)
    assert checks["free"][0] == verdict
    assert checks["momentum"][0] == verdict
