"""Scenes of the gallery and frames on disk."""

from __future__ import annotations

import base64
import struct
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ninedisk.core import InvalidNumericsError, InvalidSceneError, Numerics, Scene, packings, simulate
from ninedisk.core.dem.files import FrameWriter
from ninedisk.core.dem.session import DemSession


def deepest(scene: Scene) -> float:
    """Largest overlap between disks or with walls [m]."""
    x, r = scene.disks.x, scene.disks.radius
    apart = np.hypot(*(x[:, None] - x[None]).transpose(2, 0, 1)) - r[:, None] - r[None]
    np.fill_diagonal(apart, np.inf)
    apart[np.ix_(scene.disks.fixed, scene.disks.fixed)] = np.inf
    x, r = x[~scene.disks.fixed], r[~scene.disks.fixed]
    walls = [((x - np.array(wall.point)) @ np.array(wall.normal) - r).min() for wall in scene.walls]
    return -min(float(apart.min()), *walls)


SCENES = {
    "poured": lambda: packings.poured(12, 10),
    "drum": lambda: packings.drum(150),
    "biaxial": lambda: packings.biaxial(12, 10, strain=0.2),
    "hopper": lambda: packings.hopper(60, outlet=3.0),
    "silo": lambda: packings.hopper(60, outlet=3.0, half_angle=0.5 * np.pi),
}


@pytest.mark.parametrize("name", SCENES)
def test_scenes_start_apart_and_run(name: str) -> None:
    scene = SCENES[name]()
    assert deepest(scene) <= 0.0
    again = SCENES[name]()
    assert np.array_equal(scene.disks.x, again.disks.x)
    history = simulate(scene, Numerics(dt=0.2, n_steps=20), particles=[0, 1])
    assert np.isfinite(history.x).all()
    assert history.energy["kinetic"][-1] > 0.0


@pytest.fixture(scope="module")
def packing() -> Scene:
    return packings.settled_packing(150)


def test_a_settled_packing_rests_with_small_overlaps(packing: Scene) -> None:
    """Walls bear the weight, overlaps are below 1 % of a diameter, nothing moves by more than a tenth of an overlap."""
    assert 0.0 < deepest(packing) < 0.01
    history = simulate(packing, Numerics(dt=0.2, n_steps=10))
    weight = float(packing.disks.mass.sum()) * packings.GRAVITY
    floor = packing.wall_index("bottom") - len(packing.disks)
    sides = float(history.wall_force[-1, :2, 1].sum())
    assert -float(history.wall_force[-1, floor, 1]) - sides == pytest.approx(weight, rel=1e-3)
    assert np.abs(history.x[-1] - packing.disks.x).max() < 0.1 * deepest(packing)


def test_copies_and_collapse(packing: Scene) -> None:
    three = packings.side_by_side(packing, 3)
    assert len(three.disks) == 3 * len(packing.disks)
    assert deepest(three) < 0.02
    history = simulate(packings.collapse(packing), Numerics(dt=0.1, n_steps=20))
    spread = np.ptp(history.x[:, :, 0], axis=1)
    assert spread[-1] > 1.2 * spread[0]


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda: packings.poured(0, 3), "columns = 0"),
        (lambda: packings.poured(3, 3, overlap=0.5), "overlap = 0.5"),
        (lambda: packings.drum(10, sides=2), "sides = 2"),
        (lambda: packings.drum(10, fill=0.9), "fill = 0.9"),
        (lambda: packings.biaxial(3, 3, strain=0.0), "strain = 0.0"),
        (lambda: packings.settled_packing(10, aspect=-1.0), "aspect = -1.0"),
        (lambda: packings.settle(packings.biaxial(3, 3)), "without gravity"),
        (lambda: packings.side_by_side(packings.drum(10), 2), "takes a box"),
        (lambda: packings.hopper(10, outlet=1.0), "outlet = 1.0"),
        (lambda: packings.hopper(10, half_angle=1.6), "half_angle = 1.6"),
        (lambda: packings.discharge(packings.drum(10)), "no wall 'plug'"),
    ],
)
def test_values_out_of_range_are_named(make: Any, word: str) -> None:
    with pytest.raises(InvalidSceneError, match=word):
        make()


def test_frames_hold_the_state_in_the_scenes_order(tmp_path: Path) -> None:
    scene = packings.poured(8, 8)
    session = DemSession(scene, Numerics(dt=0.01, n_steps=30))
    writers = [FrameWriter(tmp_path / form, form) for form in ("npz", "vtk")]  # type: ignore[arg-type]
    for _ in range(3):
        session.advance(10)
        for writer in writers:
            writer.write(*session.snapshot())
    history = session.history()
    with np.load(tmp_path / "npz" / "frame-000002.npz") as data:
        assert float(data["t"]) == pytest.approx(0.3)
        assert np.array_equal(data["x"], history.x[-1])
    root = ET.parse(tmp_path / "vtk" / "frame-000002.vtp").getroot()
    arrays = {node.get("Name"): node for node in root.iter("DataArray")}
    raw = base64.b64decode(str(arrays["x"].text))
    assert struct.unpack("<Q", raw[:8])[0] == len(raw) - 8
    x = np.frombuffer(raw[8:]).reshape(-1, 3)
    assert np.array_equal(x[:, :2], history.x[-1])
    assert int(str(root.find(".//Piece").get("NumberOfPoints"))) == 64  # type: ignore[union-attr]
    index = ET.parse(tmp_path / "vtk" / "frames.pvd").getroot()
    assert [node.get("file") for node in index.iter("DataSet")] == [f"frame-{k:06d}.vtp" for k in range(3)]
    assert not list(tmp_path.glob("*/.*"))
    with pytest.raises(InvalidNumericsError, match="form = 'csv'"):
        FrameWriter(tmp_path, "csv")  # type: ignore[arg-type]
