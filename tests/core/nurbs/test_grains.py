"""Scenes of grains and their JSON; in the DEM: at rest, on an incline, over rebuilds and restarts; what is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from nurbs_shapes_of_tests import peanut, periodic, ring
from scenes import numerics, run

from ninedisk.core import ContactLaw, Disks, InvalidSceneError, NonFiniteStateError, Scene, Wall
from ninedisk.core.dem import session as session_module
from ninedisk.core.dem.critical import critical_time_step
from ninedisk.core.dem.session import DemSession
from ninedisk.core.dem.state import REBUILDS
from ninedisk.core.nurbs.curve import NurbsCurve
from ninedisk.core.nurbs.mass import UniformGrain, farthest, uniform_grain
from ninedisk.core.nurbs.shapes import disk, ellipse

LAW = ContactLaw(kn=2e4, ks=1e4, mu=0.6, beta=0.3, lever_arm="overlap")
PEANUT, ELLIPSE = uniform_grain(peanut(), 1.0), uniform_grain(ellipse(1.2, 0.8), 1.0)


def grains(kinds: list[UniformGrain], x: object, **more: object) -> dict[str, object]:
    """Disks and outlines of a scene in which every grain has its own outline."""
    disks = Disks(
        x=x,  # type: ignore[arg-type]
        radius=[kind.radius for kind in kinds],
        mass=[kind.mass for kind in kinds],
        inertia=[kind.inertia for kind in kinds],
        outline=np.arange(len(kinds)),
        **more,  # type: ignore[arg-type]
    )
    return {"disks": disks, "outlines": tuple(kind.outline for kind in kinds)}


def on_incline(kind: UniformGrain, slope: float, height: float, law: ContactLaw = LAW, **more: object) -> Scene:
    """A grain at ``height`` above a floor in gravity that is turned by ``slope`` [rad]."""
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law)
    gravity = (9.81 * np.sin(slope), -9.81 * np.cos(slope))
    return Scene(**grains([kind], [(0.0, height)], **more), disk_disk=law, walls=(floor,), gravity=gravity)  # type: ignore[arg-type]


def test_a_dented_grain_settles_on_two_contacts_and_stays() -> None:
    """On a slope below friction: after settling it keeps its place, weight and slope being carried by both contacts."""
    slope = 0.25
    scene = on_incline(PEANUT, slope, 0.78, angle=0.05)
    history = run(scene, numerics(5e-4, 12_000, sample_every=1000), [(0, 1)])
    weight = PEANUT.mass * 9.81
    assert history.fn[-1, 0] == pytest.approx(weight * np.cos(slope), rel=1e-6)
    assert abs(history.fs[-1, 0]) == pytest.approx(weight * np.sin(slope), rel=1e-6)
    still = np.abs(history.x[-4:] - history.x[-1]).max()
    assert still <= 1e-6
    assert np.abs(history.v[-1]).max() <= 1e-6
    session = DemSession(scene, numerics(5e-4, 12_000))
    session.advance(12_000)
    assert (session.counts.wall_contacts, session.counts.contacts) == (2, 0)


def test_angular_grains_roll_less_than_disks() -> None:
    """Down the same slope a disk turns on and on; an ellipse and a dented grain rock and stay."""
    turned = {}
    for name, kind, height in (
        ("disk", uniform_grain(disk(1.0), 1.0), 1.0),
        ("ellipse", ELLIPSE, 0.8),
        ("peanut", PEANUT, 0.75),
    ):
        history = run(on_incline(kind, 0.12, height), numerics(1e-3, 4000, sample_every=500), [(0, 1)])
        turned[name] = float(np.abs(history.angle[-1, 0]))
    assert turned["disk"] > 4.0
    assert turned["ellipse"] < 1.0
    assert turned["peanut"] < 0.1


def heap(side: int, **more: object) -> Scene:
    """Dented grains, ellipses and disks falling onto a floor between walls, shuffled, fast: rebuilds, rolling, several contacts."""
    rng = np.random.default_rng(8)
    x = rng.permutation(np.array([(2.7 * i, 2.7 * j + 1.4) for i in range(side) for j in range(side)]))
    n = len(x)
    kinds = [PEANUT, ELLIPSE]
    outline = rng.integers(-1, 2, n)
    disks = Disks(
        x=x,
        v=rng.normal(0.0, 4.0, (n, 2)),
        omega=rng.normal(0.0, 3.0, n),
        radius=np.where(outline < 0, 1.0, np.array([k.radius for k in kinds])[outline]),
        mass=3.0,
        inertia=1.5,
        outline=outline,
        angle=rng.uniform(-3.0, 3.0, n),
    )
    law = replace(LAW, beta=0.05)
    walls = [
        Wall(name="floor", point=(0.0, 0.0), normal=(0.05, 1.0), law=law),
        Wall(name="left", point=(-1.5, 0.0), normal=(1.0, 0.0), law=law),
        Wall(name="right", point=(2.7 * side - 1.0, 0.0), normal=(-1.0, 0.0), law=law),
    ]
    outlines = tuple(kind.outline for kind in kinds)
    return Scene(disks=disks, disk_disk=law, walls=walls, gravity=(0.0, -9.81), outlines=outlines, **more)  # type: ignore[arg-type]


def bits(session: DemSession) -> bytes:
    history = session.run()
    return b"".join(
        getattr(history, name).tobytes() for name in ("x", "v", "angle", "omega", "gap", "fn", "fs", "wall_force")
    )


def test_rebuilds_threads_and_restarts_change_no_bit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Disks kept in the order of the cells, one thread or two, stopped and gone on with."""
    scene, how, watch = heap(7), numerics(4e-4, 400, sample_every=50), [(0, 1), (3, 49), (5, 9)]
    monkeypatch.setattr(session_module, "SORT_FROM", 10)
    whole = DemSession(scene, how, watch)
    reference = bits(whole)
    assert whole._progress.clock[REBUILDS] > 5
    assert np.any(whole._disks.name != np.arange(49))
    assert len(whole.shear_forces()) >= 4
    two = DemSession(scene, how, watch, threads=2)
    assert bits(two) == reference
    assert two.counts == whole.counts
    assert whole.counts.contacts > 0
    part = DemSession(scene, how, watch)
    part.advance(211)
    part.save(tmp_path / "grains.npz")
    assert bits(DemSession.load(tmp_path / "grains.npz", threads=2)) == reference


def test_the_memory_of_contacts_grows() -> None:
    """Begun without room for a single contact, the run is the same."""
    scene, how = heap(4), numerics(4e-4, 300, sample_every=50)
    reference = bits(DemSession(scene, how))
    small = DemSession(scene, how)
    assert small._outlines is not None
    memory = small._outlines.memory
    less = memory._replace(contact=memory.contact[:, :0].copy(), body=memory.body[:, :0].copy())
    small._outlines = small._outlines._replace(memory=less)
    assert bits(small) == reference


def test_preload_and_its_refusals() -> None:
    law = replace(LAW, beta=0.0)
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law)
    two = Scene(**grains([PEANUT], [(0.0, 0.72)]), disk_disk=law, walls=(floor,))  # type: ignore[arg-type]
    one = Scene(**grains([ELLIPSE], [(0.0, 0.79)]), disk_disk=law, walls=(floor,))  # type: ignore[arg-type]
    history = run(one.replace(initial_shear={(0, 1): 2.5}), numerics(1e-6, 1))
    assert history.fs[0, 0] == 2.5
    with pytest.raises(InvalidSceneError, match="disk 0 and wall 'floor', which touch at 2 places"):
        run(two.replace(initial_shear={(0, 1): 2.5}), numerics(1e-6, 1))
    up = one.replace(disks=replace(one.disks, x=[(0.0, 0.81)]), initial_shear={(0, 1): 2.5})
    with pytest.raises(InvalidSceneError, match="which do not touch"):
        run(up, numerics(1e-6, 1))


def test_gaps_of_outlines_that_graze() -> None:
    """Circles that touch to the last bit or two have the gap 0, not the root of a rounding; dented grains likewise."""
    for way in np.linspace(0.0, 6.0, 13):
        step = 100.0 * np.array([np.cos(way), np.sin(way)])
        disks = Disks(
            x=np.array([150.0, 250.0]) + np.outer([0.0, 1.0], step),
            radius=50.0,
            mass=1.0,
            inertia=1.0,
            outline=0,
            angle=[0.7, 3.1],
        )
        scene = Scene(disks=disks, disk_disk=ContactLaw(kn=1.0), outlines=(disk(50.0),))
        assert abs(run(scene, numerics(1e-9, 1), [(0, 1)]).gap[0, 0]) <= 1e-13
    grain = uniform_grain(peanut(), 1.0)
    for apart in (1e-9, 1e-6):
        disks = Disks(
            x=[(-grain.radius, 0.0), (grain.radius + apart, 0.0)], radius=grain.radius, mass=1.0, inertia=1.0, outline=0
        )
        scene = Scene(disks=disks, disk_disk=ContactLaw(kn=1.0), outlines=(grain.outline,))
        assert abs(run(scene, numerics(1e-9, 1), [(0, 1)]).gap[0, 0] - apart) <= 1e-13


def test_gaps_of_open_pairs() -> None:
    """Distances of outlines by dense sampling, of strictly convex and of dented ones; a wall's is the lowest point's height."""
    wavy = uniform_grain(periodic(ring(12, 5), 3), 1.0)
    kinds = [ELLIPSE, wavy, PEANUT, uniform_grain(ellipse(0.9, 0.3), 1.0)]
    x, angle = np.array([(0.0, 0.0), (2.6, 0.4), (-0.3, 2.4), (4.3, 1.2)]), np.array([0.3, 1.0, -0.4, 2.0])
    floor = Wall(name="floor", point=(0.0, -1.5), normal=(0.1, 1.0), law=LAW)
    scene = Scene(**grains(kinds, x, angle=angle), disk_disk=LAW, walls=(floor,))  # type: ignore[arg-type]
    history = run(scene, numerics(1e-9, 1))
    for (i, j), gap in zip(history.pairs, history.gap[0], strict=True):
        ends = []
        for body in (i, j):
            if body < 4:
                curve = kinds[body].outline
                p = curve.evaluate(np.linspace(curve.breaks[0], curve.breaks[-1], 3001))
                c, s = np.cos(angle[body]), np.sin(angle[body])
                ends.append(p @ np.array([[c, s], [-s, c]]) + x[body])
        if j < 4:
            dense = min(float(np.hypot(*(ends[1] - p).T).min()) for p in ends[0])
        else:
            dense = float(((ends[0] - floor.point) @ floor.normal).min())
        assert gap > 0.0
        assert -1e-14 <= dense - gap <= 1e-5  # the sampling's error: (step)^2/(8 R) and step^2/(2 gap)


def test_the_critical_step_of_grains() -> None:
    """An ellipse standing upright on a spring, alone: 2/omega with the arms that its outline allows; below it stays bounded, above it does
    not."""
    law = ContactLaw(kn=1e4)
    scene = on_incline(ELLIPSE, 0.0, 0.79, law)
    limit = critical_time_step(scene)
    arm = 1.2 - 0.8  # largest distance of an ellipse's normal from its centre
    assert limit == pytest.approx(2.0 / np.sqrt(law.kn * (1.0 / ELLIPSE.mass + arm**2 / ELLIPSE.inertia)), rel=0.01)
    assert limit <= 2.0 * np.sqrt(ELLIPSE.mass / law.kn)
    area = critical_time_step(on_incline(ELLIPSE, 0.0, 0.79, replace(law, contact="area")))
    flattest = 1.2**2 / 0.8 / np.sqrt(1.2 * 0.8)
    assert area == pytest.approx(limit / flattest ** (1.0 / 3.0), rel=0.01)


@pytest.mark.parametrize(
    ("x", "message"),
    [
        ([(0.0, 0.0), (0.1, 0.0)], "grain 0, near grain 1, lies wholly inside"),
        ([(0.0, 0.0), (0.0, 0.0)], "the centres of disks 0 and 1 coincide"),
    ],
)
def test_grains_that_no_chord_parts_at_the_start(x: list[tuple[float, float]], message: str) -> None:
    kinds = [uniform_grain(ellipse(2.0, 1.0), 1.0), uniform_grain(ellipse(0.4, 0.3), 1.0)]
    with pytest.raises(InvalidSceneError, match=message):
        run(Scene(**grains(kinds, x), disk_disk=LAW), numerics(1e-4, 1))  # type: ignore[arg-type]


def test_grains_that_run_through_each_other() -> None:
    kinds = [uniform_grain(ellipse(2.0, 1.0), 1.0), uniform_grain(ellipse(0.4, 0.3), 1.0)]
    scene = Scene(
        **grains(kinds, [(0.0, 0.0), (4.0, 0.0)], v=[(0.0, 0.0), (-40.0, 0.0)]), disk_disk=replace(LAW, kn=1.0)
    )  # type: ignore[arg-type]
    with pytest.raises(
        NonFiniteStateError, match=r"disk 0, near disk 1, lies wholly inside .*contact step \d+, t = .*raise kn"
    ):
        run(scene, numerics(1e-3, 200))


def test_contacts_that_merge_and_divide_keep_their_shear_force() -> None:
    """A dented grain pressed on a floor until the dent touches, and released: two contacts, one, two again, with no jump of the force."""
    law = ContactLaw(kn=2e3, ks=1e3, mu=10.0, lever_arm="overlap")
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law)
    scene = Scene(**grains([PEANUT], [(0.0, 0.735)], v=[(0.3, -1.5)]), disk_disk=law, walls=(floor,))  # type: ignore[arg-type]
    session = DemSession(scene, numerics(1e-4, 1500))
    count, force = [], []
    for _ in range(1500):
        session.advance(1)
        assert session._outlines is not None
        mark = session._outlines.memory.mark
        count.append(int(mark[1 + mark[0]]))
        force.append(session.shear_forces().get((0, 1), 0.0))
    # They close together, merge, divide; on the way up one opens before the other.
    merged, divided = np.flatnonzero(np.diff(count))[:2]
    assert [count[0], count[merged + 1], count[divided + 1]] == [2, 1, 2]
    for turn in (merged, divided):
        assert abs(force[turn]) > 5.0
        # A step slips by 0.03 mm at most: 0.06 N for two contacts.
        assert abs(force[turn + 1] - force[turn]) <= 0.06


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
