"""Scenes with outlines: their checks and their JSON form."""

from __future__ import annotations

import json

import numpy as np
import pytest
from nurbs_shapes_of_tests import peanut, ring

from ninedisk.core import ContactLaw, Disks, InvalidSceneError, Scene
from ninedisk.core.nurbs.curve import NurbsCurve
from ninedisk.core.nurbs.mass import farthest, uniform_grain
from ninedisk.core.nurbs.shapes import disk, ellipse

LAW_OF_GRAINS = ContactLaw(kn=1e4)


def disk_and_grains(**changes: object) -> Disks:
    values = {"x": [(0.0, 0.0), (4.0, 0.0)], "radius": 2.0, "mass": 1.0, "inertia": 1.0, "outline": [0, -1]}
    return Disks(**{**values, **changes})  # type: ignore[arg-type]


def test_json_is_exact_and_old_json_still_loads() -> None:
    law = ContactLaw(kn=1e4, contact="area")
    scene = Scene(
        disks=disk_and_grains(angle=[0.1, -1.0 / 3.0]),
        disk_disk=law,
        outlines=(ellipse(2.0, 0.7), uniform_grain(peanut(), 1.0).outline),
    )
    data = scene.to_dict()
    again = Scene.from_dict(json.loads(json.dumps(data)))
    assert again.to_dict() == data
    assert again.disk_disk.contact == "area"
    for one, two in zip(scene.outlines, again.outlines, strict=True):
        for name in ("knots", "points", "weights"):
            assert getattr(one, name).tobytes() == getattr(two, name).tobytes()
    for name in ("outline", "angle"):
        assert getattr(scene.disks, name).tobytes() == getattr(again.disks, name).tobytes()


def test_scenes_of_disks_keep_their_form() -> None:
    scene = Scene(disks=Disks(x=[(0.0, 0.0)], radius=1.0, mass=1.0, angle=-0.0), disk_disk=LAW_OF_GRAINS)
    data = scene.to_dict()
    assert "outlines" not in data
    assert not {"outline", "angle"} & set(data["disks"])
    assert "contact" not in data["disk_disk"]
    again = Scene.from_dict(data)
    assert again.outlines == ()
    assert again.disks.outline.tolist() == [-1]
    assert again.disk_disk.contact == "chord"
    with pytest.raises(InvalidSceneError, match=r"unknown key\(s\) in the scene: outline"):
        Scene.from_dict({**data, "outline": []})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"outline": [1, -1]}, r"disks.outline\[0\] = 1 is not allowed: the scene has outlines 0 .. 0"),
        ({"outline": [-2, -1]}, r"disks.outline\[0\] = -2 is not allowed"),
        ({"outline": [0.5, -1]}, r"disks.outline\[0\] = 0.5 is not allowed"),
        ({"outline": [0]}, r"disks.outline has shape \(1,\)"),
        ({"outline": "a"}, "disks.outline must be numbers"),
        ({"angle": [0.0, np.inf]}, "disks.angle must be finite"),
        ({"inertia": None}, "disks.inertia is missing and grain 0 has an outline"),
        ({"radius": 1.9}, r"disks.radius\[0\] = 1.8999999999999999 is not allowed: outline 0 reaches 2 m"),
    ],
)
def test_values(change: dict[str, object], message: str) -> None:
    with pytest.raises(InvalidSceneError, match=message):
        Scene(disks=disk_and_grains(**change), disk_disk=LAW_OF_GRAINS, outlines=(ellipse(2.0, 1.0),))


def test_outlines_are_curves_about_their_centroids() -> None:
    with pytest.raises(InvalidSceneError, match="the scene has no outlines"):
        Scene(disks=disk_and_grains(), disk_disk=LAW_OF_GRAINS)
    with pytest.raises(InvalidSceneError, match=r"outlines\[0\] is no NurbsCurve but str"):
        Scene(disks=disk_and_grains(), disk_disk=LAW_OF_GRAINS, outlines=("disk",))  # type: ignore[arg-type]
    shifted = ellipse(1.0, 1.0).moved(shift=(1e-3, 0.0))
    with pytest.raises(InvalidSceneError, match=r"outlines\[1\] has its centroid at \(0.001, .* shift it by"):
        Scene(disks=disk_and_grains(), disk_disk=LAW_OF_GRAINS, outlines=(ellipse(2.0, 1.0), shifted))
    with pytest.raises(InvalidSceneError, match="contact = 'volume' is unknown"):
        ContactLaw(kn=1.0, contact="volume")  # type: ignore[arg-type]


def test_a_uniform_grain() -> None:
    grain = uniform_grain(ellipse(2.0, 0.5).moved(shift=(3.0, -1.0), angle=0.4), 3.0)
    assert grain.mass == pytest.approx(3.0 * np.pi, rel=1e-14)
    assert grain.inertia == pytest.approx(grain.mass * (4.0 + 0.25) / 4.0, rel=1e-13)
    assert grain.radius == pytest.approx(2.0, rel=1e-13)
    with pytest.raises(InvalidSceneError, match="density = 0 is not allowed"):
        uniform_grain(disk(1.0), 0)


def test_the_farthest_point() -> None:
    assert farthest(disk(1.3)) == pytest.approx(1.3, rel=1e-15)
    corners = ring(7, 3)
    polygon = NurbsCurve(degree=1, knots=np.r_[0.0, np.arange(8), 7.0], points=np.r_[corners, corners[:1]])
    assert farthest(polygon) == pytest.approx(np.hypot(*corners.T).max(), rel=1e-15)
    curve = uniform_grain(peanut(), 1.0).outline
    dense = curve.evaluate(np.linspace(curve.breaks[0], curve.breaks[-1], 20_001))
    away = farthest(curve) - np.hypot(*dense.T).max()
    assert -1e-15 <= away <= 1e-7
