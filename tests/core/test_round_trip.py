"""Scenes and numerics as JSON: to the last bit and back, and no data but these are taken."""

from __future__ import annotations

import copy
import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import random_scene

from ninedisk.core import (
    BodyForce,
    Cell,
    ContactLaw,
    CoreError,
    Disks,
    InvalidNumericsError,
    InvalidSceneError,
    Numerics,
    Rolling,
    Scene,
    Wall,
    WallSegment,
)

ANY = st.floats(allow_nan=False, allow_infinity=False)
"""Every finite float, -0.0 and subnormal ones among them."""

SMALLEST, LARGEST = 1e-150, 1e150
"""Of what a scene is computed with."""
BOUNDED, POSITIVE, NOT_NEGATIVE = st.floats(-LARGEST, LARGEST), st.floats(SMALLEST, LARGEST), st.floats(0.0, LARGEST)
SIZE, PLACE = st.floats(1e-9, 1e9), st.floats(-1e9, 1e9)
POINT, BOUNDED_POINT = st.tuples(ANY, ANY), st.tuples(BOUNDED, BOUNDED)

LAWS = st.builds(
    ContactLaw,
    kn=POSITIVE,
    ks=NOT_NEGATIVE,
    mu=NOT_NEGATIVE,
    beta=NOT_NEGATIVE,
    restitution=st.none() | st.floats(0.0, 1.0),
    lever_arm=st.sampled_from(["radius", "overlap", "torque-overlap"]),
    wall_velocity_at=st.sampled_from(["surface", "mid-overlap"]),
    slip_at=st.sampled_from(["middle", "end"]),
    rolling=st.none()
    | st.builds(Rolling, model=st.sampled_from(["constant", "viscous"]), mu=NOT_NEGATIVE)
    | st.builds(Rolling, model=st.just("elastic-plastic"), mu=NOT_NEGATIVE, kr=POSITIVE, beta=NOT_NEGATIVE),
    adhesion=NOT_NEGATIVE,
    regularised=st.booleans(),
).flatmap(lambda law: st.floats(0.0, 0.99).map(lambda part: replace(law, cohesion=part * law.kn)))
"""Laws with everything that one can have."""


@st.composite
def forces(draw: st.DrawFn, n: int) -> BodyForce:
    begin = draw(st.floats(0.0, 1e6))
    return BodyForce(
        disk=draw(st.integers(0, n - 1)),
        force=draw(BOUNDED_POINT),
        torque=draw(BOUNDED),
        begin=begin,
        end=draw(st.just(math.inf) | st.floats(1e-6, 1e6).map(lambda span: begin + span)),
    )


@st.composite
def segments(draw: st.DrawFn, *, last: bool) -> WallSegment:
    rate = draw(st.just(0.0) | st.floats(-10.0, 10.0))
    longest = 1.5 / max(abs(rate), 1e-300)
    return WallSegment(
        duration=np.inf
        if last and rate == 0.0 and draw(st.booleans())
        else draw(st.floats(SMALLEST, min(longest, LARGEST))),
        velocity=draw(BOUNDED_POINT),
        angular_velocity=draw(BOUNDED),
        pivot=draw(st.none() | BOUNDED_POINT),
        amplitude=draw(BOUNDED_POINT),
        frequency=draw(BOUNDED),
        phase=draw(BOUNDED),
        tan_lever=draw(BOUNDED_POINT),
        tan_rate=rate,
    )


@st.composite
def scenes(draw: st.DrawFn) -> Scene:
    n, m = draw(st.integers(0, 4)), draw(st.integers(0, 3))

    def many(item: st.SearchStrategy[Any]) -> list[Any]:
        return draw(st.lists(item, min_size=n, max_size=n))

    x = np.array(many(st.tuples(PLACE, PLACE))).reshape(n, 2)
    walls = []
    for k in range(m):
        angle = draw(st.floats(-4.0, 4.0))
        normal = np.array([math.cos(angle), math.sin(angle)])
        lowest = (x @ normal).min() if n else -1e9
        # The length of the normal is the wall's to mend, from the smallest to the largest one.
        stretch = draw(st.sampled_from([1.0, 3.0, 1e-300, 1e300]))
        point = tuple((lowest - draw(st.floats(10.0, 1e9))) * normal)
        motion = [draw(segments(last=False)) for _ in range(draw(st.integers(0, 2)))]
        if draw(st.booleans()):
            motion.append(draw(segments(last=True)))
        name = f"{k}{draw(st.text(max_size=5))}"
        walls.append(Wall(name=name, point=point, normal=tuple(normal * stretch), law=draw(LAWS), motion=tuple(motion)))
    pairs = [(i, j) for i in range(n) for j in range(i + 1, n + m)]
    materials = many(st.sampled_from(["", "steel", "glass"]))
    made_of = sorted(set(materials))
    rate = draw(st.tuples(BOUNDED, BOUNDED, BOUNDED))
    return Scene(
        disks=Disks(
            x=x,
            v=many(POINT),
            omega=many(ANY),
            radius=many(SIZE),
            mass=many(SIZE),
            inertia=draw(st.none() | st.lists(POSITIVE, min_size=n, max_size=n)),
            rotating=many(st.booleans()),
            held=many(st.tuples(st.booleans(), st.booleans())),
            material=materials,
        ),
        disk_disk=draw(LAWS),
        walls=walls,
        gravity=draw(POINT),
        xi=draw(NOT_NEGATIVE),
        initial_shear=draw(st.dictionaries(st.sampled_from(pairs), ANY)) if pairs else {},
        laws={(made_of[0], made_of[-1]): draw(LAWS)} if n else {},
        forces=draw(st.lists(forces(n), max_size=2)) if n else (),
        cell=None if m else draw(st.none() | st.just(Cell(size=(3.0, 2.0), rate=((rate[0], rate[1]), (0.0, rate[2]))))),
    )


@st.composite
def all_numerics(draw: st.DrawFn) -> Numerics:
    dt, n_steps = draw(st.floats(1e6 * SMALLEST, LARGEST)), draw(st.integers(1, 2**53))
    return Numerics(
        dt=dt,
        n_steps=n_steps,
        contact_dt=draw(st.none() | st.integers(1, min(10**6, 2**53 // n_steps)).map(lambda k: dt / k)),
        sample_every=draw(st.integers(1 + n_steps // 10**8, 2**53)),
        sample_from=draw(st.integers(0, 2**53)),
        sample_until=draw(st.none() | st.integers(0, 2**53)),
        damping_form=draw(st.sampled_from(["central", "lagged"])),
        theta=draw(st.floats(0.5, 1.0)),
        impact=draw(st.sampled_from(["theta", "newton"])),
        sliding=draw(st.sampled_from(["associated", "coulomb"])),
        regime=draw(st.sampled_from(["dynamic", "quasi-static"])),
        solver=draw(st.text()),
        allow_unstable=draw(st.booleans()),
        options=draw(st.dictionaries(st.text(), ANY | st.text() | st.booleans() | st.none() | st.lists(ANY))),
    )


def text(one: Scene | Numerics) -> str:
    """JSON as the standard writes it; Python prints a float so that it reads back to the same bits, -0.0 included."""
    return json.dumps(one.to_dict(), allow_nan=False)


@pytest.mark.long
@settings(max_examples=200, deadline=None)
@given(scenes())
def test_scene_comes_back_to_the_last_bit(scene: Scene) -> None:
    again = Scene.from_dict(json.loads(text(scene)))
    assert text(again) == text(scene)
    for name, value in vars(scene.disks).items():
        found = getattr(again.disks, name)
        if name == "material":
            assert found == value
            continue
        assert (found.tobytes(), found.shape, found.dtype) == (value.tobytes(), value.shape, value.dtype), name
    assert [vars(w) for w in again.walls] == [vars(w) for w in scene.walls]
    for name in ("disk_disk", "gravity", "xi", "initial_shear", "laws", "forces", "cell"):
        assert getattr(again, name) == getattr(scene, name), name
    # A copy goes through the constructors once more; nothing may drift with the number of copies.
    assert text(scene.replace(walls=[Wall(**vars(w)) for w in scene.walls])) == text(scene)


@settings(max_examples=200, deadline=None)
@given(all_numerics())
def test_numerics_come_back_to_the_last_bit(numerics: Numerics) -> None:
    again = Numerics.from_dict(json.loads(text(numerics)))
    assert again == numerics
    assert text(again) == text(numerics)


def test_normals_have_length_one_however_long_they_were_given() -> None:
    law = ContactLaw(kn=1.0)
    for size in (5e-324, 1e-200, 1.0, 1e200, 1.7e308):
        found = Wall(name="w", point=(0.0, 0.0), normal=(size, -size), law=law).normal
        assert found == pytest.approx((math.sqrt(0.5), -math.sqrt(0.5)), rel=4e-16)


def test_numbers_of_numpy_become_plain_ones() -> None:
    """A record that NumPy's scalars entered serialises like any other."""
    law = ContactLaw(kn=np.float32(2.0), ks=np.int64(3), mu=np.array(0.5), beta=1, restitution=np.float64(1))
    segment = WallSegment(duration=np.int32(2), angular_velocity=np.float32(1.0), tan_rate=0)
    wall = Wall(name="w", point=np.zeros(2), normal=(0, 1), law=law, motion=[segment])
    scene = Scene(disks=Disks(x=[[0, 1]], radius=1, mass=1), disk_disk=law, walls=[wall], xi=np.int8(1))
    assert json.loads(text(scene))["walls"][0]["law"]["kn"] == 2.0
    found = Numerics(dt=np.float32(0.5), n_steps=np.int64(3), theta=1, sample_every=2.0)
    assert json.loads(text(found))["sample_every"] == 2
    assert {type(value) for value in vars(law).values()} == {float, str, bool, type(None)}
    assert [type(getattr(found, name)) for name in ("dt", "n_steps", "theta")] == [float, int, float]


def sample() -> dict[str, Any]:
    """A scene with something in every place."""
    law = ContactLaw(kn=1.0, ks=1.0, mu=0.5, restitution=0.2)
    motion = (WallSegment(duration=1.0, velocity=(1.0, 0.0), pivot=(0.0, 0.0)), WallSegment())
    floor = Wall(name="floor", point=(0.0, -1.0), normal=(0.0, 1.0), law=law, motion=motion)
    disks = Disks(x=[[0.0, 0.0], [1.9, 0.0]], radius=1.0, mass=1.0)
    scene = Scene(disks=disks, disk_disk=law, walls=(floor,), initial_shear={(0, 1): 2.0})
    data: dict[str, Any] = json.loads(text(scene))
    return data


PARTS: dict[str, tuple[str | int, ...]] = {
    "scene": (),
    "disks": ("disks",),
    "law": ("disk_disk",),
    "wall": ("walls", 0),
    "wall's law": ("walls", 0, "law"),
    "segment": ("walls", 0, "motion", 1),
}
NEEDED = {
    "scene": ["disks", "disk_disk", "walls", "gravity", "xi", "initial_shear"],
    "disks": ["x", "radius", "mass"],
    "law": ["kn"],
    "wall": ["name", "point", "normal", "law", "motion"],
    "wall's law": ["kn"],
    "segment": [],
}


def part(data: Any, path: tuple[str | int, ...]) -> Any:
    for key in path:
        data = data[key]
    return data


@pytest.mark.parametrize("where", PARTS)
def test_unknown_and_missing_keys_of_a_scene_are_named(where: str) -> None:
    data = sample()
    part(data, PARTS[where])["colour"] = 1
    with pytest.raises(InvalidSceneError, match=r"'colour'|: colour$"):
        Scene.from_dict(data)
    for key in NEEDED[where]:
        data = sample()
        del part(data, PARTS[where])[key]
        with pytest.raises(InvalidSceneError, match=f"'{key}'"):
            Scene.from_dict(data)


def test_unknown_and_missing_keys_of_numerics_are_named() -> None:
    with pytest.raises(InvalidNumericsError, match="'colour'"):
        Numerics.from_dict({"dt": 1.0, "n_steps": 1, "colour": 1})
    for given_key, missing in (("dt", "n_steps"), ("n_steps", "dt")):
        with pytest.raises(InvalidNumericsError, match=f"'{missing}'"):
            Numerics.from_dict({given_key: 1})


JUNK = st.recursive(
    st.none() | st.booleans() | st.integers() | st.just(10**400) | st.floats() | st.text(max_size=4) | st.just("inf"),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner, max_size=3),
    max_leaves=5,
)


def paths(data: Any, here: tuple[str | int, ...] = ()) -> list[tuple[str | int, ...]]:
    """Every place of a tree of JSON data below its root."""
    keys = list(data) if isinstance(data, dict) else range(len(data)) if isinstance(data, list) else ()
    return [place for key in keys for place in ((*here, key), *paths(data[key], (*here, key)))]


@pytest.mark.long
@settings(max_examples=600, deadline=None)
@given(st.data(), JUNK)
@pytest.mark.filterwarnings("ignore:overflow encountered")
def test_junk_in_any_place_is_refused_or_means_something(data: st.DataObject, junk: Any) -> None:
    """Never another exception than ours, and what is taken is a scene that serialises to what it was read from."""
    scene, how = sample(), Numerics(dt=1.0, n_steps=3, contact_dt=0.5).to_dict()
    for tree, build in ((scene, Scene.from_dict), (how, Numerics.from_dict)):
        broken = copy.deepcopy(tree)
        *path, key = data.draw(st.sampled_from(paths(tree)))
        part(broken, tuple(path))[key] = junk
        try:
            taken = build(broken)
        except CoreError:
            continue
        # With NaN, which JSON proper lacks: an engine's own options are not for the core to judge.
        written = json.dumps(taken.to_dict())
        assert json.dumps(build(json.loads(written)).to_dict()) == written


@pytest.mark.parametrize("data", [None, 3, [], "scene", {}])
def test_data_that_are_no_mapping(data: Any) -> None:
    with pytest.raises(InvalidSceneError):
        Scene.from_dict(data)
    with pytest.raises(InvalidNumericsError):
        Numerics.from_dict(data)


def test_strings_and_truth_values_are_no_numbers_in_arrays() -> None:
    for bad in ("2", True, [1.0, "2"], [1.0, True], np.array([True, False]), [b"1", b"2"], [1j, 2.0], [None, 1.0]):
        with pytest.raises(InvalidSceneError, match=r"disks\.radius must be numbers"):
            Disks(x=[[0.0, 0.0], [3.0, 0.0]], radius=bad, mass=1.0)


def test_scenes_of_the_generator_come_back_too() -> None:
    for seed in range(20):
        scene = random_scene(np.random.default_rng(seed), 1e-3, 60)
        assert text(Scene.from_dict(json.loads(text(scene)))) == text(scene)
