"""Cases in space on the pages: seen from the side and from above, turning under the hand, and apart from the plane's in the overview."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from ninedisk.core.law import Rolling, SphereLaw
from ninedisk.core.scene import PlaneSegment, PlaneWall, Spheres, SphereScene
from ninedisk.reports.build import build_report
from ninedisk.reports.drawing.draw import Projection, draw_projection, faces_of, numbers_of, read_scene, read_space
from ninedisk.reports.drawing.scenes import Arrays, read_frames, spaces

LAW = SphereLaw(kn=1e5, ks=1e5, mu=0.3, twisting=Rolling(model="constant", mu=0.1))


def stored(gravity: tuple[float, float, float] = (0.0, 0.0, -9.81), **walls: tuple[float, ...]) -> dict:
    """Two spheres, the second one nearer to who looks along y and higher, above planes by name and normal."""
    planes = tuple(
        PlaneWall(
            name=name, point=(0.0, -4.0, 0.0), normal=normal, law=LAW, motion=(PlaneSegment(angular_velocity=normal),)
        )
        for name, normal in (walls or {"floor": (0.0, 0.0, 1.0)}).items()
    )
    spheres = Spheres(
        x=[(0, 0, 1), (1, -2, 3)], radius=[1.0, 0.5], mass=1.0, v=[(2, 0, 0), (0, 0, 0)], omega=[(0, 3, 0), (0, 0, 0)]
    )
    scene = SphereScene(spheres=spheres, sphere_sphere=LAW, walls=planes, gravity=gravity)
    return json.loads(json.dumps({"scene": scene.to_dict(), "labels": {"below": [0, 2], "pair": [0, 1]}}))


def frames(view) -> dict:
    """Three configurations: the first sphere rolls along x, the plane rises."""
    x = view.x + np.arange(3.0)[:, None, None] * np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    angle = np.arange(3.0)[:, None, None] * np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
    point = np.arange(3.0)[:, None, None] * np.array([[0.0, 0.0, 0.1]])
    normal = np.tile([0.0, 0.0, 1.0], (3, 1, 1))
    reported = {
        "step": np.arange(3),
        "t": 0.1 * np.arange(3),
        "x": x,
        "angle": angle,
        "wall_point": point,
        "wall_angle": normal,
    }
    return {name: value.tolist() for name, value in reported.items()}


@pytest.mark.parametrize(
    ("gravity", "side", "above", "nearer"),
    [
        ((0.0, 0.0, -9.81), (0, 2), (0, 1), (-1.0, 1.0)),
        ((0.0, -9.81, 0.0), (0, 1), (0, 2), (1.0, 1.0)),
        ((9.81, 0.0, 1.0), (1, 0), (1, 2), (-1.0, -1.0)),
        ((0.0, 0.0, 0.0), (0, 2), (0, 1), (-1.0, 1.0)),
    ],
)
def test_the_axis_of_gravity_stands_upright_and_nearer_spheres_cover_others(gravity, side, above, nearer):
    setup = stored()
    setup["scene"]["gravity"] = list(gravity)
    view = read_space(setup)
    views = [Projection(view, False), Projection(view, True)]
    assert [each.axes for each in views] == [side, above]
    assert tuple(each.nearer for each in views) == nearer
    if views[0].axes == (0, 2):  # right x up is the way to the viewer
        assert np.cross(np.eye(3)[0], np.eye(3)[2])[1] == views[0].nearer


def test_a_drawing_has_every_sphere_what_moves_and_a_cut_of_oblique_planes():
    view = read_space(stored())
    drawn = draw_projection(Projection(view, False))
    for reported in ("2 m/s", "(0, 3, 0) rad/s", "9.81 m/s²", "floor turns: (0, 0, 1) rad/s", ">x<", ">z<"):
        assert reported in drawn
    # Seen from above the floor is nowhere and everywhere; the displacement along x is seen as it is.
    assert "9.81" not in draw_projection(Projection(view, True))
    sloped = read_space(stored(slope=(0.0, 0.6, 0.8), wall=(1.0, 0.0, 1.0)))
    assert draw_projection(Projection(sloped, False)).count("stroke-dasharray") > drawn.count("stroke-dasharray")
    for seen in (Projection(sloped, False), Projection(sloped, True)):
        (slope, _), (wall, edge_on) = seen.cuts()
        assert edge_on is (not seen.above)
        for cut, plane in zip((slope, wall), sloped.walls, strict=True):
            place = np.full(3, seen.middle)
            place[list(seen.axes)] = cut.point + 7.0 * cut.tangent
            assert (place - plane.point) @ plane.normal == pytest.approx(0.0, abs=1e-12)
    lines = numbers_of(Projection(view, True)).splitlines()
    assert lines[1].startswith("sphere,0,1.0,0.0,0.0,1.0,2.0,0.0,0.0,0.0,3.0,0.0")
    assert lines[3].startswith('plane,"floor",,0.0,-4.0,0.0')
    assert [mark[0] for mark in view.marks] == ["below", "pair"]
    assert np.allclose(view.marks[1][1], view.x[0] + (view.x[1] - view.x[0]) / 1.5)


HALF, QUATERNION = np.array([2.0, 1.0, 0.3]), np.array([0.8, 0.36, 0.48, 0.0])


def boxed(quaternion=QUATERNION) -> dict:
    """A turned box, and a ball that lies on the far side of its top where it turns about z."""
    spheres = Spheres(
        x=[(0, 0, 1), (0, 0.7, 1.5)],
        radius=[2.3, 0.2],
        mass=1.0,
        half_sizes=[HALF, (0, 0, 0)],
        quaternion=[quaternion, (1, 0, 0, 0)],
    )
    floor = PlaneWall(name="floor", point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), law=LAW)
    scene = SphereScene(spheres=spheres, sphere_sphere=LAW, walls=(floor,), gravity=(0.0, 0.0, -9.81))
    return json.loads(json.dumps({"scene": scene.to_dict(), "labels": {"below": [0, 2]}}))


def test_a_box_has_six_faces_whose_shadows_are_those_of_the_box():
    """``q a q*`` by Rodrigues' formula; what is seen from anywhere covers the sum of the faces' areas by their slant."""
    view = read_space(boxed())
    axis, angle = QUATERNION[1:] / np.linalg.norm(QUATERNION[1:]), 2.0 * np.arccos(QUATERNION[0])
    for edge, given in enumerate(np.eye(3)):
        by_hand = (
            np.cos(angle) * given
            + np.sin(angle) * np.cross(axis, given)
            + (1.0 - np.cos(angle)) * (axis @ given) * axis
        )
        np.testing.assert_allclose(view.turn[0][:, edge], by_hand, atol=1e-14)
    faces = faces_of(view.x[0], view.half[0], view.turn[0])
    assert len(faces) == 6
    seen = 0.0
    for normal, corners in faces:
        along = np.cross(corners[1] - corners[0], corners[3] - corners[0])
        assert np.linalg.norm(np.cross(along, normal)) < 1e-12
        assert (corners.mean(axis=0) - view.x[0]) @ normal > 0.0
        seen += np.linalg.norm(along) * max(normal[2], 0.0)
    areas = 4.0 * np.array([HALF[1] * HALF[2], HALF[0] * HALF[2], HALF[0] * HALF[1]])
    assert seen == pytest.approx(areas @ np.abs(view.turn[0][2]), rel=1e-12)
    assert np.linalg.norm(faces[0][1] - view.x[0], axis=1) == pytest.approx(np.linalg.norm(HALF))
    assert view.signature != read_space(stored()).signature


def test_nonsense_is_no_scene_and_neither_kind_is_taken_for_the_other():
    setup = stored()
    assert read_scene(setup) is None
    for nonsense in (
        {},
        {"scene": None},
        {"scene": {"dimension": 3}},
        {"scene": {**setup["scene"], "spheres": {"x": "abc"}}},
    ):
        assert read_space(nonsense) is None
    held = frames(read_space(setup))
    cell = {"variant": "v", "engine": "e", "frames": json.dumps(held), "setup": json.dumps(setup)}
    assert read_frames(cell) is None  # two spheres are no three disks
    arrays = Arrays()
    found = spaces(SimpleNamespace(cells=[cell]), arrays)["v"]
    assert found["engines"]["e"]["x"] == arrays(np.array(held["x"]))
    assert found["setup"]["x"] == arrays(np.array(held["x"][0]))
    for broken in ({**held, "x": held["x"][:2]}, {**held, "wall_angle": None}, "no json"):
        assert spaces(SimpleNamespace(cells=[{**cell, "frames": json.dumps(broken)}]), Arrays())["v"]["engines"] == {}


@pytest.fixture
def report(write, small, tmp_path):
    """A case of the plane and one in space."""
    setup = stored()
    reported = {"setup": json.dumps(setup), "frames": json.dumps(frames(read_space(setup)))}
    for k, tables in enumerate((small(), small(case="spheres/demo", **reported))):
        write(tmp_path / "store", f"2026010{k + 1}T030405Z-abcdef", tables)
    return build_report(tmp_path / "store", tmp_path / "report").parent


def test_the_overview_separates_plane_and_space(report: Path):
    page = (report / "index.html").read_text(encoding="utf-8")
    order = [page.index(text) for text in ("In the plane", "demo/one", "In space", "spheres/demo")]
    assert order == sorted(order)


def test_the_picture_turns_plays_and_prints(tab, report: Path):
    tab.open(report / "case" / "spheres-demo.html")
    tab.wait("document.querySelector('figure.turning.drawn')")
    tab.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-reduced-motion", "value": "reduce"}])
    tab.reload()
    tab.wait("document.querySelector('figure.turning.drawn')")
    places = "[...document.querySelectorAll('.turning .ball')].map(c => ['cx', 'cy', 'r'].map(name => Number(c.getAttribute(name))))"
    begin = tab.run(places)
    assert len(begin) == 2
    assert begin[0][2] == pytest.approx(2.0 * begin[1][2], rel=1e-3)  # the nearer, smaller one is painted last
    assert tab.run("document.querySelectorAll('.turning .plane').length") == 1
    tab.click(".turning svg")
    tab.key("ArrowLeft")
    turned = tab.run(places)
    assert turned != begin
    tab.run("(s => { s.value = 2; s.dispatchEvent(new Event('input')); })(document.querySelector('.turning input'))")
    assert tab.run(places) != turned
    assert tab.run("document.querySelector('.turning .told').textContent") == "t = 0.2 s"
    assert tab.run("document.querySelectorAll('.turning .pole').length") > 2
    tab.call("Emulation.setEmulatedMedia", media="print")
    assert tab.run("document.querySelector('.turning svg').getBoundingClientRect().height") > 100
    assert tab.run("getComputedStyle(document.querySelector('.turning .controls')).display") == "none"
    assert tab.complaints == []


def test_boxes_have_the_faces_that_are_seen_and_cover_what_is_behind(write, small, tab, tmp_path):
    """The ball's centre is farther than the box's, and the ball is in front of the box's top all the same."""
    setup = boxed((np.cos(0.15), 0.0, 0.0, np.sin(0.15)))
    write(
        tmp_path / "store",
        "20260101T030405Z-abcdef",
        small(case="box/demo", setup=json.dumps(setup), frames=json.dumps(frames(read_space(setup)))),
    )
    built = build_report(tmp_path / "store", tmp_path / "report").parent
    tab.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-reduced-motion", "value": "reduce"}])
    tab.open(built / "case" / "box-demo.html")
    tab.wait("document.querySelector('figure.turning.drawn')")
    drawn = "[...document.querySelectorAll('.turning .box, .turning .ball')].map(each => each.getAttribute('class')).join(' ')"
    assert tab.run(drawn) == "box box box ball"
    corners = "document.querySelector('.turning .box').getAttribute('points')"
    begin = tab.run(corners)
    tab.run("(s => { s.value = 2; s.dispatchEvent(new Event('input')); })(document.querySelector('.turning input'))")
    assert tab.run(corners) != begin
    tab.click(".turning svg")
    for _ in range(30):
        tab.key("ArrowUp")  # from below, where the box hides the ball
    assert tab.run(drawn).startswith("ball")
    assert "2 bodies" in tab.run("document.querySelector('.turning svg').getAttribute('aria-label')")
    assert tab.complaints == []
