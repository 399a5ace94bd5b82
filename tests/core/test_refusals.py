"""What is refused, and how: values, odd inputs of every kind, files that cannot be written."""

from __future__ import annotations

import errno
import inspect
import math
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from scenes import KN, floor_scene, numerics, pair_scene, run

from ninedisk.core import (
    BehindWallError,
    BodyForce,
    Cell,
    ContactLaw,
    CoreError,
    Disks,
    InvalidNumericsError,
    InvalidSceneError,
    NonFiniteStateError,
    Numerics,
    PlaneWall,
    Rolling,
    Scene,
    SphereLaw,
    Spheres,
    SphereScene,
    UnwritableFileError,
    Wall,
    WallSegment,
    errors,
    simulate,
)
from ninedisk.core.archive import whole_file
from ninedisk.core.cd.problem import ContactProblem
from ninedisk.core.cd.session import CdSession
from ninedisk.core.cd.settings import SolverOptions
from ninedisk.core.dem.files import FrameWriter, write_checkpoint
from ninedisk.core.dem.session import DemSession
from ninedisk.core.nurbs.curve import NurbsCurve
from ninedisk.core.nurbs.intersect import NurbsGrains
from ninedisk.core.nurbs.mass import area_moments, extent, uniform_grain
from ninedisk.core.nurbs.shapes import ellipse, fitted, polygon, regular_polygon, traced
from ninedisk.core.packings import (
    biaxial,
    collapse,
    contact_law,
    discharge,
    drum,
    hopper,
    poured,
    settled_packing,
    side_by_side,
)

LAW = ContactLaw(kn=KN, ks=KN, mu=0.5)
NAN, INF = float("nan"), float("inf")


def test_every_error_is_a_core_error_with_a_meaning() -> None:
    kinds = [kind for _, kind in inspect.getmembers(errors, inspect.isclass)]
    found = [kind for kind in kinds if issubclass(kind, BaseException)]
    assert len(found) >= 7
    for kind in found:
        assert issubclass(kind, CoreError)
        assert issubclass(kind, ValueError)
        assert kind.__doc__


def test_a_refused_number_is_named_and_shown() -> None:
    """All kinds of odd values, of every argument, are below; here the value is in the message, too."""
    for bad in (-1.0, NAN, "5", 10**400):
        for name in ("kn", "ks", "mu", "beta", "restitution"):
            with pytest.raises(
                InvalidSceneError, match=rf"{name} = .* is not allowed: it must be a (finite )?number"
            ) as law:
                ContactLaw(**{"kn": 1.0, name: bad})
            assert repr(bad) in str(law.value)
        for name in ("dt", "contact_dt", "n_steps", "sample_every", "sample_from", "sample_until", "theta"):
            with pytest.raises(InvalidNumericsError, match=name) as numbers:
                Numerics(**{"dt": 1.0, "n_steps": 3, name: bad})
            assert repr(bad) in str(numbers.value)


def test_stiffness_of_zero_and_choices_that_do_not_exist() -> None:
    with pytest.raises(InvalidSceneError, match=r"kn = 0\.0 is not allowed: it must be a finite number > 0"):
        ContactLaw(kn=0.0)
    for bad in (-0.1, 1.1, NAN):
        with pytest.raises(InvalidSceneError, match="restitution"):
            ContactLaw(kn=1.0, restitution=bad)
    with pytest.raises(
        InvalidSceneError, match="lever_arm = 'R' is unknown: use one of radius, overlap, torque-overlap"
    ):
        ContactLaw(kn=1.0, lever_arm="R")
    with pytest.raises(
        InvalidSceneError, match="wall_velocity_at = 'foot' is unknown: use one of surface, mid-overlap"
    ):
        ContactLaw(kn=1.0, wall_velocity_at="foot")
    for bad in ("start", None, 1):
        with pytest.raises(InvalidSceneError, match=f"slip_at = {bad!r} is unknown: use one of middle, end"):
            ContactLaw(kn=1.0, slip_at=bad)


def test_marks_of_a_law_and_names_of_walls() -> None:
    with pytest.raises(InvalidSceneError, match="regularised = 'no' is not allowed: it must be true or false"):
        ContactLaw(kn=1.0, regularised="no")
    with pytest.raises(InvalidSceneError, match="the name of a wall must be a string, not 3"):
        wall(3, (0, 0), (0, 1))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"x": [[0.0, 0.0, 0.0]]}, r"disks\.x has shape \(1, 3\); it must have shape \(n, 2\)"),
        ({"x": [0.0, 0.0]}, r"disks\.x has shape \(2,\)"),
        ({"x": [[0.0, NAN], [3.0, 0.0]]}, r"disks\.x must be finite; it holds nan"),
        ({"x": [[0.0], [3.0, 0.0]]}, r"disks\.x must be numbers"),
        ({"x": "abc"}, r"disks\.x must be numbers, not 'abc'"),
        ({"v": [[0.0, 0.0]]}, r"disks\.v has shape \(1, 2\); it must have shape \(2, 2\)"),
        ({"v": [[0.0, INF], [0.0, 0.0]]}, r"disks\.v must be finite"),
        ({"omega": [1.0, 2.0, 3.0]}, r"disks\.omega has shape \(3,\)"),
        ({"omega": NAN}, r"disks\.omega must be finite"),
        ({"radius": [1.0, -2.0]}, r"disks\.radius\[1\] = -2 is not allowed: it must be > 0"),
        ({"radius": [1.0, INF]}, r"disks\.radius must be finite"),
        ({"radius": "wide"}, r"disks\.radius must be numbers"),
        ({"mass": 0.0}, r"disks\.mass\[0\] = 0 is not allowed: it must be > 0"),
        ({"mass": [1.0]}, r"disks\.mass has shape \(1,\)"),
        ({"inertia": [1.0, 0.0]}, r"disks\.inertia\[1\] = 0 is not allowed: it must be > 0"),
        ({"rotating": [True]}, r"disks\.rotating"),
        ({"rotating": "no"}, r"disks\.rotating"),
        ({"rotating": [[True], [True, False]]}, r"disks\.rotating"),
        ({"held": [True, False]}, r"disks\.held"),
        ({"mass": "5"}, r"disks\.mass must be numbers, not '5'"),
        ({"mass": [1.0, True]}, r"disks\.mass must be numbers"),
    ],
)
def test_disks(change: dict[str, object], message: str) -> None:
    with pytest.raises(InvalidSceneError, match=message):
        Disks(**{"x": [[0.0, 0.0], [3.0, 0.0]], "radius": 1.0, "mass": 1.0, **change})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"duration": 0.0}, r"duration = 0\.0 is not allowed: it must be a number > 0"),
        ({"duration": NAN}, "duration = nan"),
        ({"duration": "long"}, "duration = 'long'"),
        ({"duration": "5"}, "duration = '5'"),
        ({"duration": True}, "duration = True"),
        ({"phase": "5"}, "segment phase must be numbers, not '5'"),
        ({"velocity": (1.0, NAN)}, "segment velocity must be finite"),
        ({"velocity": 1.0}, r"segment velocity has shape \(\); it must have shape \(2,\)"),
        ({"pivot": (1.0,)}, r"segment pivot has shape \(1,\)"),
        ({"angular_velocity": INF}, "segment angular_velocity must be finite"),
        ({"frequency": "fast"}, "segment frequency must be numbers"),
        ({"tan_rate": 1.0, "duration": 2.0}, r"tan_rate \* duration = 2 is not allowed: it must stay below pi/2"),
        ({"tan_rate": -1e-9}, r"tan_rate \* duration"),
    ],
)
def test_segments(change: dict[str, object], message: str) -> None:
    with pytest.raises(InvalidSceneError, match=message):
        WallSegment(**change)


def scene(**changes: object) -> Scene:
    disks = Disks(x=[[0.0, 0.0], [1.9, 0.0]], radius=1.0, mass=1.0)
    return Scene(**{"disks": disks, "disk_disk": LAW, **changes})


def wall(name: str, point: object, normal: object, **changes: object) -> Wall:
    return Wall(name=name, point=point, normal=normal, law=LAW, **changes)


def test_walls() -> None:
    with pytest.raises(InvalidSceneError, match="wall 'a' has a zero normal: give it a direction"):
        wall("a", (0, 0), (0, 0))
    with pytest.raises(InvalidSceneError, match="wall 'a' point must be finite"):
        wall("a", (0, NAN), (0, 1))
    with pytest.raises(InvalidSceneError, match="only the last segment may be endless"):
        wall("a", (0, 0), (0, 1), motion=(WallSegment(), WallSegment()))
    with pytest.raises(InvalidSceneError, match="wall names must be unique: a, a"):
        scene(walls=(wall("a", (0, -1), (0, 1)), wall("a", (-1, 0), (1, 0))))
    with pytest.raises(InvalidSceneError, match=r"the centre of disk 1 lies 0\.1 m behind wall 'r'"):
        scene(walls=(wall("r", (1.8, 0), (-1, 0)),))
    with pytest.raises(InvalidSceneError, match=r"walls 'l' and 'r' overlap.*-2 m; it must be > 0"):
        scene(walls=(wall("l", (1, 0), (1, 0)), wall("r", (-1, 0), (-1, 0))))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"xi": -1.0}, r"xi = -1\.0 is not allowed: it must be a finite number >= 0"),
        ({"xi": NAN}, "xi"),
        ({"xi": "a"}, "xi = 'a'"),
        ({"xi": "5"}, r"xi = '5' is not allowed: it must be a finite number >= 0"),
        ({"xi": True}, "xi = True"),
        ({"gravity": ("0", "1")}, "gravity must be numbers"),
        ({"initial_shear": {(0, 1): "5"}}, r"initial shear of \(0, 1\) must be numbers"),
        ({"initial_shear": {(0, 1.5): 1.0}}, r"a pair is two body numbers, not \(0, 1\.5\)"),
        ({"gravity": (0.0, INF)}, "gravity must be finite"),
        ({"gravity": 9.81}, "gravity has shape"),
        ({"initial_shear": {(0, 1): NAN}}, r"initial shear of \(0, 1\) must be finite"),
        ({"initial_shear": {(1, 0): 1.0}}, r"pair \(1, 0\) is not allowed"),
        ({"initial_shear": {(0, 7): 1.0}}, r"pair \(0, 7\) is not allowed.*up to 1"),
    ],
)
def test_scene_values(change: dict[str, object], message: str) -> None:
    with pytest.raises(InvalidSceneError, match=message):
        scene(**change)


def test_preload_that_could_not_act() -> None:
    apart = Disks(x=[[0.0, 0.0], [2.05, 0.0]], radius=1.0, mass=1.0)
    with pytest.raises(
        InvalidSceneError, match=r"7 N belongs to disk 0 and disk 1, which do not touch \(gap 0\.05 m\)"
    ):
        run(scene(disks=apart, initial_shear={(0, 1): 7.0}), numerics(1e-3, 1))
    with pytest.raises(InvalidSceneError, match="whose contact is smooth"):
        run(scene(disk_disk=ContactLaw(kn=KN, ks=KN), initial_shear={(0, 1): 7.0}), numerics(1e-3, 1))
    high = wall("floor", (0, -1.0), (0, 1))
    with pytest.raises(InvalidSceneError, match=r"disk 0 and wall 'floor', which do not touch \(gap 0 m\)"):
        run(scene(walls=(high,), initial_shear={(0, 2): 1.0}), numerics(1e-3, 1))


def test_what_the_dem_cannot_express_is_refused() -> None:
    disks = Disks(
        x=[[0.0, 0.0], [1.9, 0.0]],
        v=[[0.0, 0.0], [0.0, 0.1]],
        radius=1.0,
        mass=1.0,
        held=[[True, False], [False, True]],
    )
    with pytest.raises(
        InvalidNumericsError, match="disk 1 held in a motion, whose work is not counted: hold it at rest"
    ):
        DemSession(scene(disks=disks), numerics(1e-3, 1, energy_budget=True))
    with pytest.raises(InvalidNumericsError, match="regime = 'quasi-static' needs contact dynamics"):
        DemSession(scene(), numerics(1e-3, 1, regime="quasi-static"))


def on_floor(law: ContactLaw) -> Scene:
    """A disk that falls onto a floor at 1 m/s."""
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law)
    disks = Disks(x=[[0.0, 1.0]], v=[[0.3, -1.0]], radius=1.0, mass=1.0)
    return Scene(disks=disks, disk_disk=law, walls=(floor,))


def test_friction_of_springs_needs_a_shear_spring() -> None:
    law, few = ContactLaw(kn=1e5, mu=0.5), Numerics(dt=1e-3, n_steps=2)
    words = "mu = 0.5 with ks = 0.*give ks > 0 .*or mu = 0"
    with pytest.raises(InvalidSceneError, match=words):
        simulate(on_floor(law), few)
    with pytest.raises(InvalidSceneError, match=f"wall 'floor' is elastic and has {words}.*rigid"):
        simulate(on_floor(law), few, method="cd")
    simulate(on_floor(replace(law, regularised=True)), few, method="cd")
    for spheres, name in ((SphereLaw(kn=1e5, mu=0.5), "ks"), (SphereLaw(e_star=1e7, mu=0.5), "g_star")):
        scene = SphereScene(spheres=Spheres(x=[(0.0, 0.0, 0.0)], radius=1.0, mass=1.0), sphere_sphere=spheres)
        plane = PlaneWall(name="floor", point=(0.0, 0.0, -1.0), normal=(0.0, 0.0, 1.0), law=spheres)
        with pytest.raises(InvalidSceneError, match=f"mu = 0.5 with {name} = 0 is not allowed.*give {name} > 0"):
            simulate(replace(scene, walls=(plane,)), few)


def test_a_restitution_that_nothing_obeys_is_refused() -> None:
    rigid, steps = ContactLaw(kn=1e5, restitution=0.8, regularised=True), Numerics(dt=1e-2, n_steps=3)
    with pytest.raises(
        InvalidSceneError, match=r"restitution = 0.8, but .*theta = 1 gives .* = 0: .*'newton', or theta = 0.555556"
    ):
        simulate(on_floor(rigid), steps, method="cd")
    with pytest.raises(InvalidSceneError, match=r"restitution = 0.8, which an elastic contact does not obey.*'newton'"):
        simulate(on_floor(replace(rigid, regularised=False)), steps, method="cd")
    for heeded in (steps.replace(impact="newton"), steps.replace(theta=0.555556)):
        assert simulate(on_floor(rigid), heeded, method="cd").v[-1, 0, 1] == pytest.approx(0.8, abs=1e-5)
    assert simulate(on_floor(replace(rigid, restitution=None)), steps, method="cd").v[-1, 0, 1] == pytest.approx(
        0.0, abs=1e-12
    )
    plastic = CdSession(on_floor(replace(rigid, restitution=0.0)), steps.replace(theta=0.5))
    assert any("restitution is 0 rebound with (1 - theta)/theta = 1" in remark for remark in plastic.remarks)
    assert CdSession(on_floor(replace(rigid, restitution=0.0)), steps).remarks == []
    # A series of equilibria has no impacts.
    static = steps.replace(regime="quasi-static")
    simulate(on_floor(rigid).replace(disks=Disks(x=[[0.0, 1.0]], radius=1.0, mass=1.0)), static, method="cd")


def test_questions_about_bodies_that_do_not_exist() -> None:
    with pytest.raises(InvalidSceneError, match="there is no wall 'top': the scene's walls are none"):
        scene().wall_index("top")
    with pytest.raises(InvalidSceneError, match=r"pair \(1, 1\) is not allowed"):
        simulate(scene(), numerics(1e-3, 1), [(1, 1)])
    with pytest.raises(InvalidSceneError, match=r"a pair is two body numbers, not \(1, 2, 3\)"):
        simulate(scene(), numerics(1e-3, 1), [(1, 2, 3)])
    for bad in (-1, 2):
        with pytest.raises(InvalidSceneError, match=rf"particle {bad} does not exist: disks are numbered 0\.\.1"):
            simulate(scene(), numerics(1e-3, 1), particles=[bad])
    for word in (0.5, "0", None):
        with pytest.raises(
            InvalidSceneError, match=rf"particle {word!r} is no whole number: disks are numbered 0\.\.1"
        ):
            simulate(scene(), numerics(1e-3, 1), particles=[word])
    empty = Disks(x=np.empty((0, 2)), radius=1.0, mass=1.0)
    with pytest.raises(InvalidSceneError, match="the scene has no disk"):
        simulate(scene(disks=empty), numerics(1e-3, 1))


def test_numerics_choices() -> None:
    for name in ("damping_form", "impact", "sliding", "regime"):
        with pytest.raises(InvalidNumericsError, match=rf"{name} = 'best' is unknown: use one of \w+, \w+"):
            Numerics(dt=1.0, n_steps=1, **{name: "best"})


@pytest.mark.parametrize(
    ("name", "bad", "allowed"),
    [
        ("allow_unstable", "no", "true or false"),
        ("allow_unstable", 1, "true or false"),
        ("solver", 3, "name of a solver"),
        ("options", [1], "mapping"),
    ],
)
def test_numerics_of_the_wrong_kind(name: str, bad: object, allowed: str) -> None:
    with pytest.raises(InvalidNumericsError, match=allowed) as caught:
        Numerics(**{"dt": 1.0, "n_steps": 1, name: bad})
    assert f"{name} = {bad!r}" in str(caught.value)


def test_contact_step_that_does_not_divide_the_step() -> None:
    with pytest.raises(InvalidNumericsError, match=r"contact_dt = 0\.3 s does not divide dt = 1 s.*for instance 0\.25"):
        Numerics(dt=1.0, contact_dt=0.3, n_steps=1)
    with pytest.raises(InvalidNumericsError, match="does not divide"):
        Numerics(dt=1.0, contact_dt=2.0, n_steps=1)
    assert Numerics(dt=0.3, contact_dt=0.1, n_steps=1).substeps(0.1) == 3


@pytest.mark.parametrize("factor", [1.5, 3.0, 30.0])
def test_blow_up_is_reported_with_its_step(factor: float) -> None:
    """A disk between two walls far beyond the limit: the amplitude grows until its centre is behind one of them.

    Once its amplitude exceeds the overlap, the disk touches one wall at a time, and omega falls by sqrt(2): what overflows
    is unstable there as well, that is beyond sqrt(2) times the limit.
    """
    walls = (wall("l", (-1, 0), (1, 0)), wall("r", (1, 0), (-1, 0)))
    disks = Disks(x=[[0.1, 0.0], [-0.1, 3.0]], v=[[1.0, 0.0], [-1.0, 0.0]], radius=1.5, mass=1.0)
    dt = factor * 2.0 / np.sqrt(2.0 * KN)
    with pytest.raises(
        BehindWallError, match=r"behind wall '[lr]' at contact step \d+ .*reduce contact_dt = .*\(critical step"
    ):
        run(Scene(disks=disks, disk_disk=LAW, walls=walls), numerics(dt, 5000))


def test_velocity_that_overflows_before_the_position_does() -> None:
    light = floor_scene(ContactLaw(kn=1e150), height=0.5, mass=1e-150)
    with pytest.raises(NonFiniteStateError):
        run(light, numerics(1e10, 10))


def test_centres_that_come_to_coincide_are_reported() -> None:
    """Two disks that meet head on, at rest relative to nothing else: their normal vanishes."""
    soft = ContactLaw(kn=1e-150)
    disks = Disks(x=[[-0.25, 0.0], [0.25, 0.0]], v=[[0.25, 0.0], [-0.25, 0.0]], radius=1.0, mass=1.0)
    with pytest.raises(NonFiniteStateError, match="two centres coincide"):
        run(Scene(disks=disks, disk_disk=soft), numerics(1.0, 3))


def test_a_failed_session_says_the_same_again() -> None:
    session = DemSession(pair_scene(ContactLaw(kn=1e10), overlap=0.5, closing=0.0), numerics(1e150, 50))
    for _ in range(2):
        with pytest.raises(NonFiniteStateError):
            session.run()


ANY_LAW = ContactLaw(kn=1e4, ks=1e4, mu=0.5)
DISKS = Disks(x=[[0.0, 0.0], [1.9, 0.0]], radius=1.0, mass=1.0)
SCENE = Scene(disks=DISKS, disk_disk=ANY_LAW)
STEPS = Numerics(dt=1e-3, n_steps=2)
WALL = {"name": "floor", "point": (0.0, -2.0), "normal": (0.0, 1.0), "law": ANY_LAW}
CIRCLE = ellipse(1.0, 1.0)
BOX = poured(2, 2)


class Broken:
    """What raises whatever it is asked for."""

    def __repr__(self) -> str:
        raise RuntimeError("no name")

    def __array__(self, *_: object, **__: object) -> Any:
        raise RuntimeError("no array")

    def __iter__(self) -> Any:
        raise RuntimeError("no items")

    def __len__(self) -> int:
        raise RuntimeError("no length")

    def __float__(self) -> float:
        raise RuntimeError("no number")


def generator() -> Iterator[float]:
    """A sequence that is none."""
    yield 1.0


ODD: dict[str, Callable[[], Any]] = {
    "None": lambda: None, "True": lambda: True, "np.True": lambda: np.bool_(True), "text": lambda: "wide", "number as text": lambda: "1",
    "empty text": lambda: "", "bytes": lambda: b"1", "complex": lambda: 1 + 0j, "complex of NumPy": lambda: np.complex128(1.0),
    "nan": lambda: math.nan, "inf": lambda: math.inf, "-inf": lambda: -math.inf, "-1": lambda: -1, "-0.0": lambda: -0.0, "0": lambda: 0,
    "denormal": lambda: 5e-324, "1e-320": lambda: 1e-320, "1e-200": lambda: 1e-200, "1e308": lambda: 1e308, "half": lambda: 0.5,
    "1": lambda: 1, "1.0": lambda: 1.0, "1.5": lambda: 1.5, "2**63": lambda: 2**63, "1e400": lambda: 10**400, "1e5000": lambda: 10**5000,
    "int8": lambda: np.int8(1), "uint64": lambda: np.uint64(2**63), "float16": lambda: np.float16(0.5), "0-d": lambda: np.array(1.0),
    "0-d int": lambda: np.array(1), "0-d text": lambda: np.array("1"), "fraction": lambda: Fraction(1, 2), "decimal": lambda: Decimal(1),
    "masked": lambda: np.ma.masked, "empty list": list, "list": lambda: [1.0], "nested": lambda: [[1.0]], "mapping": dict,
    "set": lambda: {1.0}, "generator": generator, "function": lambda: generator, "class": lambda: Scene,
    "date": lambda: np.datetime64("2020"),
    "broken": Broken, "object": object, "law": lambda: ANY_LAW, "scene": lambda: SCENE, "numerics": lambda: STEPS, "ellipsis": lambda: ...,
}  # fmt: skip
REFUSED, SKIPPED = object(), object()
"""An odd value that represents nothing; one of which nothing is asked."""


def number(value: Any) -> float | None:
    """The number that an odd value represents: a real one, not a truth value, alone or in an array without dimensions."""
    if isinstance(value, np.ndarray) and not isinstance(value, np.ma.MaskedArray) and value.shape == ():
        value = value[()]
    if isinstance(value, bool | np.bool_) or not isinstance(value, int | float | Fraction | np.integer | np.floating):
        return None
    try:
        return float(value)
    except OverflowError:
        return math.inf


def between(
    low: float, high: float, *, open_low: bool = False, open_high: bool = False, whole: bool = False
) -> Callable[[Any], Any]:
    """Numbers of a range."""

    def represents(value: Any) -> Any:
        found = number(value)
        if found is None or math.isnan(found) or found < low or found > high:
            return REFUSED
        if (open_low and found == low) or (open_high and found == high) or (whole and found != int(found)):
            return REFUSED
        return int(found) if whole else found

    return represents


def optional(kind: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """None, or what the kind allows."""
    return lambda value: None if value is None else kind(value)


def word(*choices: str) -> Callable[[Any], Any]:
    """One of some words."""
    return lambda value: value if isinstance(value, str) and value in choices else REFUSED


def is_a(*kinds: type) -> Callable[[Any], Any]:
    """An object of a kind."""
    return lambda value: value if isinstance(value, kinds) else REFUSED


def flag(value: Any) -> Any:
    """True or false."""
    return bool(value) if isinstance(value, bool | np.bool_) else REFUSED


def nothing(value: Any) -> Any:
    """No odd value but an empty sequence is right."""
    return () if isinstance(value, list | dict) and not value else REFUSED


def no_rows(value: Any) -> Any:
    """An empty list, which is an array of no rows."""
    return value if isinstance(value, list) and not value else REFUSED


def one_number(value: Any) -> Any:
    """A list of one number, which is an array of one row."""
    return value if isinstance(value, list) and value == [1.0] else REFUSED


SIZE = between(1e-150, 1e150)
AMOUNT = between(0.0, 1e150)
SIGNED = between(-1e150, 1e150)
LATER = between(0.0, 1.7976931348623157e308, open_low=True)
PLAIN = between(-1.8e308, 1.7976931348623157e308)
COUNT = between(1, 10**7, whole=True)
STEP_COUNT = between(1, 2**53, whole=True)


class Column(NamedTuple):
    """An argument that is an array: a right one, and which number may represent a whole column."""

    right: Any
    scalar: Callable[[Any], Any] = lambda _: REFUSED
    none: bool = False
    """Whether None may be given."""
    rows: bool = False
    """Whether it may have any number of rows."""
    any_size: bool = False
    """Whether numbers of any size are right."""
    not_finite: bool = False
    """Whether what is not finite goes through, as NaN and infinity do in arithmetic."""


@dataclass(frozen=True)
class Target:
    """A callable, arguments that are right, and the kind of each argument that is tried."""

    call: Callable[..., Any]
    right: dict[str, Any]
    kinds: dict[str, Any]
    names: tuple[str, ...] = ()
    """Other words of which a message may have one in the place of the argument's name."""


def positions_after(**arguments: Any) -> Any:
    """Positions after a run, so that results can be compared."""
    history = simulate(**arguments)
    return [history.x.tolist(), history.pairs, history.particles]


PAIR = {
    "mass": np.ones((2, 3)), "force": np.zeros((2, 3)), "bodies": np.array([[0, 1]]), "normal": np.array([[1.0, 0.0]]),
    "arms": np.array([[0.0, 0.0, 1.0, 1.0]]), "offset": np.zeros((1, 2)), "mu": np.array([0.5]),
}  # fmt: skip


def problem(**arguments: Any) -> Any:
    """The fields of a contact problem."""
    made = ContactProblem(**arguments)
    return [np.asarray(getattr(made, field.name)).tolist() for field in fields(made) if field.name != "notes"]


def velocities(r: Any, v: Any) -> Any:
    """Velocities of a problem's bodies and contacts."""
    made = ContactProblem(**PAIR)
    return [made.body_velocity(r).tolist(), made.contact_velocity(v, r).tolist()]


def advanced(steps: Any) -> Any:
    """Positions after some steps of a session."""
    session = DemSession(SCENE, STEPS)
    session.advance(steps)
    return session.snapshot()[1]["x"].tolist()


def watched(watch: Any, particles: Any) -> Any:
    """What a session of contact dynamics was asked to record."""
    return simulate(SCENE, STEPS, watch, method="cd", particles=particles).particles


def plain(result: Any) -> Any:
    """Something that ``==`` compares."""
    if isinstance(result, np.ndarray):
        return result.tolist()
    return vars(result) if type(result).__name__ in ("Fit", "UniformGrain") else result


def parameter(value: Any) -> Any:
    """A place on the circle, or a list of places."""
    if isinstance(value, list) and all(isinstance(item, float) for item in value):
        return value
    return between(0.0, 4.0)(value)


SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
ROUND = np.column_stack([np.cos(np.arange(24) * np.pi / 12), np.sin(np.arange(24) * np.pi / 12)])
PIXELS = np.array([[False, False, False], [False, True, True], [False, True, True]])
TARGETS: dict[str, Target] = {
    "ContactLaw": Target(
        ContactLaw,
        {"kn": 1.0},
        {
            "kn": SIZE, "ks": AMOUNT, "mu": AMOUNT, "beta": AMOUNT, "restitution": optional(between(0.0, 1.0)), "regularised": flag,
            "lever_arm": word("radius"), "wall_velocity_at": word("surface"), "slip_at": word("middle"), "contact": word("chord"),
            "cohesion": between(0.0, 1.0, open_high=True), "adhesion": AMOUNT, "rolling": optional(is_a(Rolling)),
        },
    ),
    "ContactLaw of Hertz-Mindlin": Target(
        ContactLaw,
        {"e_star": 1.0, "surface_energy": 1.0},
        {
            "e_star": SIZE, "g_star": AMOUNT, "unloading": word("none"), "twisting": optional(is_a(Rolling)), "surface_energy": AMOUNT,
            "surface": word("jkr"), "friction_pull": between(0.0, 2.0),
        },
    ),
    "Rolling": Target(
        Rolling,
        {"model": "elastic-plastic", "mu": 1.0, "kr": 1.0},
        {"model": word("elastic-plastic"), "mu": AMOUNT, "kr": SIZE, "beta": AMOUNT},
        ("rolling",),
    ),
    "BodyForce": Target(
        BodyForce,
        {"disk": 0, "torque": 1.0},  # a number, as in 2D
        {
            "disk": between(0, 2**31 - 1, whole=True), "force": Column(np.array([1.0, 2.0])), "torque": SIGNED, "begin": AMOUNT,
            "end": lambda value: math.inf if number(value) == math.inf and isinstance(value, float) else LATER(value),
        },
        ("force", "torque"),
    ),
    "Cell": Target(
        Cell,
        {"size": (1.0, 1.0), "rate": ((0.0, 1.0), (0.0, 2.0))},
        {"size": Column(np.array([1.0, 2.0]), SIZE), "rate": Column(np.array([[0.0, 1.0], [0.0, 2.0]]), rows=True)},
        ("size", "rate"),
    ),
    "WallSegment": Target(
        WallSegment,
        {},
        {
            "duration": lambda value: math.inf if number(value) == math.inf and isinstance(value, float) else SIZE(value),
            "angular_velocity": SIGNED, "frequency": SIGNED, "phase": SIGNED,
            "tan_rate": between(0.0, 0.0), "velocity": Column(np.array([1.0, 2.0])), "amplitude": Column(np.array([1.0, 2.0])),
            "tan_lever": Column(np.array([1.0, 2.0])), "pivot": Column(np.array([1.0, 2.0]), none=True),
        },
    ),
    "Wall": Target(
        Wall,
        WALL,
        {
            "name": is_a(str), "point": Column(np.array([0.0, 1.0])), "normal": Column(np.array([3.0, 4.0]), any_size=True),
            "law": is_a(ContactLaw), "material": is_a(str),
            "motion": nothing,
        },
    ),
    "Disks": Target(
        Disks,
        {"x": [[0.0, 0.0], [3.0, 1.0]], "radius": 1.0, "mass": 1.0},
        {
            "x": Column(np.array([[0.0, 0.0], [3.0, 1.0]]), no_rows, rows=True),
            "v": Column(np.array([[1.0, 0.0], [3.0, 1.0]]), none=True, any_size=True),
            "radius": Column(np.array([1.0, 2.0]), SIZE), "mass": Column(np.array([1.0, 2.0]), SIZE),
            "inertia": Column(np.array([1.0, 2.0]), between(1e-300, 1e300), none=True),
            "omega": Column(np.array([1.0, 2.0]), PLAIN, none=True, any_size=True), "angle": Column(np.array([1.0, 2.0]), SIGNED),
            "rotating": flag, "held": flag, "outline": between(-1, 2**31 - 1, whole=True),
            "material": is_a(str),
        },
    ),
    "Scene": Target(
        Scene,
        {"disks": DISKS, "disk_disk": ANY_LAW},
        {
            "disks": is_a(Disks), "disk_disk": is_a(ContactLaw), "walls": nothing, "gravity": Column(np.array([0.0, -9.81]),
            any_size=True), "xi": AMOUNT,
            "initial_shear": lambda value: {} if value == {} and isinstance(value, dict) else REFUSED, "outlines": nothing,
            "laws": lambda value: {} if value == {} and isinstance(value, dict) else REFUSED, "forces": nothing,
            "cell": optional(is_a(Cell)),
        },
    ),
    "Numerics": Target(
        Numerics,
        {"dt": 1.0, "n_steps": 3},
        {
            "dt": SIZE, "contact_dt": lambda value: value if value is None else 0.5 if number(value) == 0.5 else
            1.0 if number(value) == 1.0 else REFUSED,
            "n_steps": between(1, 10**8, whole=True), "sample_every": STEP_COUNT, "sample_from": between(0, 2**53, whole=True),
            "sample_until": optional(between(0, 2**53, whole=True)), "damping_form": word("central"), "theta": between(0.5, 1.0),
            "impact": word("theta"), "sliding": word("coulomb"), "regime": word("dynamic"), "solver": is_a(str), "allow_unstable": flag,
            "energy_budget": flag, "options": is_a(dict),
        },
    ),
    "SolverOptions": Target(
        SolverOptions,
        {},
        {
            "tolerance": between(0.0, 1.0, open_low=True, open_high=True), "max_iterations": optional(between(1, 10**15, whole=True)),
            "time_limit": between(0.0, math.inf, open_low=True, open_high=True),
            "relaxation": between(0.0, 2.0, open_low=True, open_high=True), "threads": between(1, 64, whole=True),
            "accept": optional(between(0.0, 1.0, open_low=True, open_high=True)),
        },
    ),
    "ContactProblem": Target(
        problem,
        PAIR,
        {
            **{name: Column(array) for name, array in PAIR.items()}, "mass": Column(PAIR["mass"], any_size=True),
            "offset": Column(PAIR["offset"], any_size=True), "mu": Column(PAIR["mu"], one_number),
            "compliance": Column(np.zeros((1, 2)), none=True, any_size=True),
            "shear_0": Column(np.zeros(1), one_number, none=True, any_size=True), "resolution": AMOUNT, "notes": is_a(dict),
        },
    ),
    "ContactProblem.velocities": Target(
        velocities, {"r": np.ones((1, 2)), "v": np.ones((2, 3))},
        {"r": Column(np.ones((1, 2)), any_size=True, not_finite=True), "v": Column(np.ones((2, 3)), any_size=True, not_finite=True)},
    ),
    "simulate": Target(
        positions_after,
        {"scene": SCENE, "numerics": STEPS},
        {
            "scene": is_a(Scene), "numerics": is_a(Numerics), "watch": nothing, "method": word("dem"), "threads": between(1, 64,
            whole=True),
            "particles": lambda value: None if value is None else nothing(value),
            "progress": lambda value: None if value is None else SKIPPED if callable(value) else REFUSED,
        },
        names=("pair", "particle"),
    ),
    "CdSession": Target(
        watched, {"watch": (), "particles": (0,)}, {"watch": nothing, "particles": optional(nothing)}, names=("pair", "particle")
    ),
    "DemSession.advance": Target(advanced, {"steps": 1}, {"steps": between(0, 2**53, whole=True)}),
    "Scene.body_name": Target(SCENE.body_name, {"body": 0}, {"body": between(0, 1, whole=True)}),
    "Scene.wall_index": Target(BOX.wall_index, {"name": "left"}, {"name": lambda _: REFUSED}, names=("wall",)),
    "Scene.law": Target(SCENE.law, {"pair": (0, 1)}, {"pair": lambda _: REFUSED}),
    "poured": Target(
        poured,
        {"columns": 2, "rows": 2},
        {"columns": between(1, 10, whole=True), "rows": between(1, 10, whole=True), "seed": between(0, 2**63 - 1, whole=True),
         "mu": AMOUNT, "overlap": between(1e-9, 0.1)},
    ),
    "settled_packing": Target(settled_packing, {"n": 1}, {"n": between(1, 1, whole=True), "aspect": between(1.0, 1.0)}),
    "side_by_side": Target(side_by_side, {"scene": BOX, "copies": 2}, {"copies": between(1, 10, whole=True), "scene": lambda _: REFUSED}),
    "biaxial": Target(
        biaxial, {"columns": 2, "rows": 2}, {"columns": between(1, 10, whole=True), "strain": between(0.0, 0.3, open_low=True),
                                             "duration": between(1e-150, 1e100)}
    ),
    "collapse": Target(collapse, {"scene": BOX}, {"scene": lambda _: REFUSED, "speed": SIZE}),
    "contact_law": Target(
        contact_law, {"height": 1.0}, {"height": between(1e-140, 1e140), "overlap": between(1e-9, 0.1), "mu": AMOUNT, "beta": AMOUNT}
    ),
    "drum": Target(
        drum,
        {"n": 5, "fill": 0.2},
        {"n": between(1, 10, whole=True), "sides": between(3, 1000, whole=True), "fill": between(1e-3, 0.6),
         "turns_per_second": between(-1e149, 1e149)},
    ),
    "hopper": Target(
        hopper,
        {"n": 20},
        {"n": between(1, 30, whole=True), "outlet": between(1.5, 1000.0), "half_angle": between(0.01, math.pi / 2.0), "mu": AMOUNT,
         "aspect": between(0.05, 20.0)},
    ),
    "discharge": Target(discharge, {"scene": hopper(20)}, {"scene": lambda _: REFUSED}, names=("wall",)),
    "ellipse": Target(ellipse, {"a": 1.0, "b": 0.5}, {"a": between(1e-3, 1e3), "b": between(1e-3, 1e3)}, names=("points", "outline")),
    "regular_polygon": Target(
        regular_polygon,
        {"faces": 4, "apothem": 1.0},
        {"faces": between(3, 100, whole=True), "apothem": SIZE, "roundness": between(0.0, 1.0, open_high=True)},
        names=("points",),
    ),
    "polygon": Target(polygon, {"vertices": SQUARE}, {"vertices": Column(SQUARE, rows=True)}, names=("points", "outline", "curve")),
    "fitted": Target(
        fitted,
        {"outline": ROUND, "n": 8},
        {"outline": Column(ROUND, rows=True), "n": between(4, 23, whole=True), "degree": between(1, 7, whole=True), "rounds": between(0,
        1000, whole=True)},
        names=("curve", "points", "knots"),
    ),
    "traced": Target(traced, {"image": PIXELS}, {"image": lambda _: REFUSED, "pixel": SIZE}),
    "NurbsCurve": Target(
        NurbsCurve,
        {"degree": 2, "knots": CIRCLE.knots, "points": CIRCLE.points, "weights": CIRCLE.weights},
        {"degree": between(2, 2, whole=True), "knots": Column(CIRCLE.knots), "points": Column(CIRCLE.points),
        "weights": Column(CIRCLE.weights, none=True)},
        names=("knot", "curve", "outline", "weights"),
    ),
    "NurbsCurve.evaluate": Target(
        CIRCLE.evaluate, {"parameter": [1.0]}, {"parameter": Column(np.array([0.5, 1.0]), parameter, rows=True), "order": between(0, 2,
        whole=True)}
    ),
    "NurbsCurve.moved": Target(
        CIRCLE.moved, {}, {"angle": between(-1e100, 1e100), "shift": Column(np.array([1.0, 2.0]))}, names=("points",)
    ),
    "uniform_grain": Target(uniform_grain, {"curve": CIRCLE, "density": 1.0}, {"curve": lambda _: REFUSED, "density": SIZE}),
    "area_moments": Target(
        lambda **given: area_moments(**given).area, {"curve": CIRCLE}, {"curve": lambda _: REFUSED, "nodes": between(1, 100, whole=True)}
    ),
    "extent": Target(extent, {"curve": CIRCLE, "direction": (1.0, 0.0)}, {"curve": lambda _: REFUSED, "direction": Column(np.array([0.6,
    0.8]))}),
    "NurbsGrains": Target(
        lambda **given: NurbsGrains(**given).shape, {"curves": [CIRCLE], "shape": [0]}, {"curves": lambda _: REFUSED,
        "shape": Column(np.array([0, 0]), no_rows, rows=True)}
    ),
}  # fmt: skip


def odd_arrays(right: np.ndarray[Any, Any]) -> dict[str, tuple[Any, bool]]:
    """Odd forms of an array, and whether each represents the same numbers."""
    strided = np.repeat(right, 2, axis=0)[::2]
    read_only = right.copy()
    read_only.setflags(write=False)
    hidden = np.ma.MaskedArray(right, mask=np.arange(right.size).reshape(right.shape) == 0)
    holed = right.astype(np.float64).copy()
    holed.flat[-1] = np.nan
    endless = right.astype(np.float64).copy()
    endless.flat[0] = -np.inf
    some = right.astype(object)
    some.flat[0] = None
    return {
        "nested lists": (right.tolist(), True), "tuple of rows": (tuple(right), True), "column order": (np.asfortranarray(right), True),
        "strided": (strided, True), "read-only": (read_only, True), "objects": (right.astype(object), True),
        "long double": (right.astype(np.longdouble), True), "other byte order": (right.astype(right.dtype.newbyteorder()), True),
        "masked nowhere": (np.ma.MaskedArray(right), True), "masked": (hidden, False), "nan": (holed, False), "infinite": (endless, False),
        "None inside": (some, False), "complex": (right.astype(complex), False), "truth values": (right.astype(bool), False),
        "text": (right.astype(str), False), "bytes": (right.astype("S"), False), "dates": (right.astype("datetime64[s]"), False),
        "fields": (np.zeros(right.shape, dtype=[("a", float)]), False), "further axis": (right[None], False),
        "one row less": (right[:-1], False), "one row more": (np.concatenate([right, right[:1]]), False), "flat": (right.ravel()[None,
        None], False),
        "ragged": ([[1.0], [1.0, 2.0]], False), "no row": (right[:0], False), "rows of text": ([["a", "b"]], False),
        "masked items": ([np.ma.masked] * len(right), False), "mapping": (dict(enumerate(right.tolist())), False), "huge": (right + 1e308,
        False),
    }  # fmt: skip


ROWS = ("one row less", "one row more", "no row")


def cases() -> list[tuple[str, str, str, Any, Any]]:
    """Target, argument, what is odd, how it is made, and what it represents."""
    found: list[tuple[str, str, str, Any, Any]] = []
    for name, target in TARGETS.items():
        for argument, kind in target.kinds.items():
            for label, make in ODD.items():
                value = make()
                if isinstance(kind, Column):
                    meant = kind.scalar(value) if value is not None else None if kind.none else REFUSED
                else:
                    meant = kind(value)
                if meant is not SKIPPED:
                    found.append((name, argument, label, make, meant))
            if isinstance(kind, Column):
                for label, (array, same) in odd_arrays(np.asarray(kind.right)).items():
                    as_given = (
                        (kind.rows and label in ROWS)
                        or (kind.any_size and label == "huge")
                        or (kind.not_finite and label in ("nan", "infinite"))
                    )
                    meant = array if as_given else kind.right if same else REFUSED
                    found.append((name, argument, f"array: {label}", lambda array=array: array, meant))
    return found


CASES = cases()
SLOW = 20.0
"""Seconds after which an answer counts as a hang, on a machine that is busy."""


def outcome(name: str, argument: str, value: Any, meant: Any) -> str:
    """What is wrong with the answer to one odd value; empty if nothing is."""
    target = TARGETS[name]
    begun = time.perf_counter()
    try:
        result = plain(target.call(**{**target.right, argument: value}))
    except CoreError as error:
        known = (argument, *target.names)
        if meant is not REFUSED and not allowed_to_refuse(name, argument, meant):
            return f"refused although it stands for {meant!r}: {error}"
        return "" if any(word in str(error) for word in known) else f"the message does not name {argument}: {error}"
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    finally:
        took = time.perf_counter() - begun
    if took > SLOW:
        return f"took {took:.0f} s"
    if meant is REFUSED:
        return f"taken, with the result {str(result)[:200]}"
    wanted = plain(target.call(**{**target.right, argument: meant}))
    return (
        ""
        if result == wanted or repr(result) == repr(wanted)
        else f"{str(result)[:100]} instead of {str(wanted)[:100]}, that of {meant!r}"
    )


def allowed_to_refuse(name: str, argument: str, meant: Any) -> bool:
    """Whether the plain value that is meant is refused as well, by a rule between arguments."""
    target = TARGETS[name]
    try:
        target.call(**{**target.right, argument: meant})
    except CoreError:
        return True
    return False


@pytest.fixture(scope="module", autouse=True)
def _compiled() -> None:
    """Kernels are compiled once, and that time is none of an input's."""
    for name in ("simulate", "CdSession", "ContactProblem.velocities"):
        TARGETS[name].call(**TARGETS[name].right)


def test_there_are_many_odd_inputs_and_right_ones() -> None:
    """A check of odd values means something only where the other arguments are right, and both answers occur."""
    assert len(CASES) >= 300
    assert min(sum((case[4] is REFUSED) == refused for case in CASES) for refused in (True, False)) >= 300
    for name, target in TARGETS.items():
        assert target.call(**target.right) is not None, name


def test_every_argument_of_the_public_classes_is_tried() -> None:
    for kind in (
        ContactLaw,
        Rolling,
        BodyForce,
        Cell,
        WallSegment,
        Wall,
        Disks,
        Scene,
        Numerics,
        SolverOptions,
        ContactProblem,
        NurbsCurve,
    ):
        targets = [target for name, target in TARGETS.items() if name.split()[0] == kind.__name__]
        tried = {argument for target in targets for argument in target.kinds}
        missing = {field.name for field in fields(kind)} - tried
        assert not missing, f"{kind.__name__}: {missing}"


@pytest.mark.long
@pytest.mark.parametrize(("name", "argument"), sorted({case[:2] for case in CASES}))
def test_every_odd_value_is_refused_by_name_or_right(name: str, argument: str) -> None:
    wrong = []
    for label, make, meant in [case[2:] for case in CASES if case[:2] == (name, argument)]:
        fault = outcome(name, argument, make(), meant)
        if fault:
            wrong.append(f"{argument} = {label}: {fault}")
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Scene(disks=None, disk_disk=ANY_LAW), "disks = None is not allowed: it must be of the type Disks"),
        (lambda: Scene(disks=ANY_LAW, disk_disk=DISKS), "disks = ContactLaw"),
        (lambda: SCENE.replace(walls=None), "walls = None is not allowed: it must be a sequence of Wall, "),
        (lambda: SCENE.replace(walls=[42]), r"walls\[0\] = 42 is not allowed: it must be of the type Wall"),
        (lambda: SCENE.replace(initial_shear=[((0, 1), 1.0)]), "initial_shear = .* must be of the type Mapping"),
        (lambda: SCENE.replace(initial_shear={(True, 1): 1.0}), r"a pair is two body numbers, not \(True, 1\)"),
        (lambda: Wall(**{**WALL, "law": None}), "wall 'floor' law = None is not allowed: it must be of the type ContactLaw"),
        (lambda: Wall(**WALL, motion=[1]), r"wall 'floor' motion\[0\] = 1 is not allowed: it must be of the type WallSegment"),
        (lambda: simulate(STEPS, SCENE), "scene = Numerics"),
        (lambda: CdSession(SCENE, SCENE), "numerics = Scene"),
        (lambda: simulate(SCENE, STEPS, particles=[True]), "particle True is no whole number"),
        (lambda: simulate(SCENE, STEPS, 3), "watch = 3 is not allowed: it must be a sequence of pairs"),
        (lambda: Numerics(dt=1.0, n_steps=2**63), "n_steps = 9223372036854775808 is not allowed: .* number 1..9007199254740992"),
        (lambda: Numerics(dt=1.0, n_steps=10**9), "n_steps = 1000000000 with sample_every = 1 is not allowed: .* raise sample_every"),
        (lambda: Numerics(dt=1e308, n_steps=1), r"dt = 1e\+308 is not allowed: it must lie between 1e-150 and 1e\+150"),
        (lambda: Numerics(dt=1.0, n_steps=10**6, contact_dt=1e-14, sample_every=10),
        "n_steps = 1000000 with 100000000000000 contact steps"),
        (lambda: Numerics(dt=1.0, n_steps=1, options={1: 2}), "options = {1: 2} is not allowed"),
        (lambda: Disks(x=[[0.0, 0.0]], radius=1.0, mass=1e-320), r"disks.mass\[0\] = .* it must lie between 1e-150 and 1e\+150"),
        (lambda: Disks(x=[[0.0, 0.0]], radius=np.ma.MaskedArray([1.0], mask=[True]), mass=1.0), "disks.radius must be numbers"),
        (lambda: Disks(x=[[0.0, 0.0]], radius=1.0, mass=1.0, held=np.ma.MaskedArray([[True, True]], mask=[[False, True]])), "disks.held"),
        (lambda: ContactProblem(**{**PAIR, "bodies": [(0, 0)]}),
        r"bodies\[0\] = \(0, 0\) is not allowed: a body has no contact with itself"),
        (lambda: ContactProblem(**{**PAIR, "bodies": [(0.7, 1)]}), r"bodies\[0\] = \(0.7, 1\) is not allowed: bodies are numbered 0..1"),
        (lambda: ContactProblem(**{**PAIR, "bodies": [(0, 2)]}), r"bodies\[0\] = \(0, 2\) is not allowed"),
        (lambda: ContactProblem(**{**PAIR, "mass": np.full((2, 3), 1e-320)}), r"mass\[0, 0\] = .* is not allowed"),
        (lambda: ContactProblem(**{**PAIR, "notes": {"scene": 3}}), r"notes\['scene'\] = 3 is not allowed"),
        (lambda: DemSession.load(None), "None is no checkpoint of a DEM run, or damaged"),
        (lambda: ContactProblem.load(3.5), "3.5 is no contact problem, or damaged"),
    ],
)  # fmt: skip
def test_odd_inputs_one_by_one(make: Callable[[], object], message: str) -> None:
    with pytest.raises(CoreError, match=message):
        make()


def test_samples_that_no_machine_can_hold_are_refused_before_they_are_allocated() -> None:
    many = Disks(x=np.column_stack([2.0 * np.arange(100_000), np.zeros(100_000)]), radius=0.5, mass=1.0)
    for method in ("dem", "cd"):
        with pytest.raises(
            CoreError, match=r"1000001 samples of 100000 disks need .* GiB, and this machine has .* raise sample_every"
        ):
            simulate(Scene(disks=many, disk_disk=ANY_LAW), Numerics(dt=1e-3, n_steps=10**6), method=method)


@pytest.mark.parametrize("method", ["dem", "cd"])
def test_disks_in_one_place_are_refused_at_once(method: str) -> None:
    """1e5 disks in one cell have 5e9 pairs, which no memory holds."""
    rng = np.random.default_rng(1)
    crowd = Disks(x=1e-3 * rng.uniform(size=(100_000, 2)), radius=1.0, mass=1.0)
    begun = time.perf_counter()
    with pytest.raises(CoreError, match=r"disks lie on top of each other: more than \d+ pairs of the 100000 disks"):
        simulate(Scene(disks=crowd, disk_disk=ANY_LAW), STEPS, method=method)
    assert time.perf_counter() - begun < SLOW


def scenes_with_everything() -> tuple[Scene, Scene]:
    """Two scenes of the same content, made anew."""

    def made() -> Scene:
        disks = Disks(x=[[0.0, 0.0], [1.9, 0.0]], radius=[1.0, 1.2], mass=1.0, inertia=1.0, outline=[-1, 0])
        walls = [Wall(**WALL, motion=[WallSegment(duration=1.0, velocity=(1.0, 0.0)), WallSegment()])]
        return Scene(
            disks=disks, disk_disk=ANY_LAW, walls=walls, initial_shear={(0, 1): 1.0}, outlines=[ellipse(1.0, 1.1)]
        )

    return made(), made()  # fmt: skip


def test_scenes_are_equal_by_content_and_no_keys() -> None:
    one, two = scenes_with_everything()
    assert one == one
    assert one == two
    assert one == Scene.from_dict(one.to_dict())
    assert one != 3
    assert one.disks != one
    assert one.outlines[0] != 3
    changes: list[dict[str, Any]] = [
        {"disks": Disks(**{**vars(one.disks), "x": one.disks.x + np.array([[0.0, 0.0], [0.0, 1e-16]])})},
        {"disk_disk": ContactLaw(kn=2.0)}, {"walls": ()}, {"gravity": (0.0, 1.0)}, {"xi": 1.0}, {"initial_shear": {}},
        {"outlines": [ellipse(1.0, 1.11)]},
    ]  # fmt: skip
    for change in changes:
        assert one != one.replace(**change), change
    for held in (one, one.disks, one.outlines[0]):
        with pytest.raises(TypeError, match=f"unhashable type: '{type(held).__name__}'"):
            hash(held)
    assert hash(ANY_LAW) == hash(ContactLaw(kn=1e4, ks=1e4, mu=0.5))


def test_numerics_keep_their_options() -> None:
    options = {"cd.threads": 1}
    numerics = Numerics(dt=1.0, n_steps=1, options=options)
    options["cd.threads"] = 2
    assert numerics.options["cd.threads"] == 1


ONE_DISK = Scene(disks=Disks(x=[[0.0, 0.0]], radius=1.0, mass=1.0), disk_disk=ContactLaw(kn=1e4))
STATE = {"x": np.zeros((1, 2)), "v": np.zeros((1, 2)), "angle": np.zeros(1), "omega": np.zeros(1), "radius": np.ones(1)}


def save_problem(path: Any) -> None:
    ContactProblem(
        mass=np.ones((2, 3)), force=np.zeros((2, 3)), bodies=np.array([[0, 1]]), normal=np.array([[1.0, 0.0]]),
        arms=np.zeros((1, 4)), offset=np.zeros((1, 2)), mu=np.ones(1),
    ).save(path)  # fmt: skip


def save_checkpoint(path: Any) -> None:
    write_checkpoint(path, ONE_DISK, Numerics(dt=1e-3, n_steps=1), {"clock": np.zeros(3)})


@pytest.mark.parametrize("save", [save_problem, save_checkpoint])
@pytest.mark.parametrize("place", ["missing/file.npz", "folder", "file/below.npz", "a\x00b", "", "9" * 400, None, 42])
def test_paths_that_cannot_be_written(save: Callable[[Any], None], place: Any, tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("before")
    given = tmp_path / place if isinstance(place, str) and place else place
    with pytest.raises(UnwritableFileError, match=r"cannot be written .*give a path in a folder that exists") as caught:
        save(given)
    named = Path(given).name[:20].replace("\x00", "\\x00") if isinstance(given, Path) else repr(place)
    assert named in str(caught.value)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "folder"]
    assert (tmp_path / "file").read_text() == "before"


def test_folders_of_frames_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("before")
    for folder in (tmp_path / "file", tmp_path / "file" / "below", tmp_path / "a\x00b", None):
        with pytest.raises(UnwritableFileError, match="cannot be written"):
            FrameWriter(folder)  # type: ignore[arg-type]
    assert (tmp_path / "file").read_text() == "before"


@pytest.mark.parametrize("form", ["npz", "vtk"])
def test_a_folder_of_frames_that_vanishes(form: Any, tmp_path: Path) -> None:
    writer = FrameWriter(tmp_path / "frames", form)
    (tmp_path / "frames").rmdir()
    with pytest.raises(UnwritableFileError, match="frame-000000"):
        writer.write(0.0, STATE)


def half_written(target: Path, failure: Exception) -> None:
    with whole_file(target) as stream:
        stream.write(b"half")
        raise failure


def test_a_failure_during_the_run_leaves_the_file_as_it_was(tmp_path: Path) -> None:
    target = tmp_path / "run.npz"
    target.write_bytes(b"before")
    for failure, seen in (
        (OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)), UnwritableFileError),
        (CoreError("the content's own"), CoreError),
    ):
        with pytest.raises(seen, match=r"No space left|the content's own"):
            half_written(target, failure)
    assert target.read_bytes() == b"before"
    assert os.listdir(tmp_path) == ["run.npz"]
