"""Every mistake has its exception, and the message names the value, the range and the way out."""

from __future__ import annotations

import inspect

import numpy as np
import pytest
from scenes import KN, floor_scene, numerics, pair_scene, run

from ninedisk.core import (
    BehindWallError,
    ContactLaw,
    CoreError,
    Disks,
    InvalidNumericsError,
    InvalidSceneError,
    NonFiniteStateError,
    Numerics,
    Scene,
    Wall,
    WallSegment,
    errors,
    simulate,
)
from ninedisk.core.dem.session import DemSession

LAW = ContactLaw(kn=KN, ks=KN, mu=0.5)
NAN, INF = float("nan"), float("inf")
NO_NUMBER = ("x", "5", True, np.bool_(False), None, [1.0], {}, 1j, 10**400)


def test_every_error_is_a_core_error_with_a_meaning() -> None:
    kinds = [kind for _, kind in inspect.getmembers(errors, inspect.isclass)]
    found = [kind for kind in kinds if issubclass(kind, BaseException)]
    assert len(found) >= 7
    for kind in found:
        assert issubclass(kind, CoreError)
        assert issubclass(kind, ValueError)
        assert kind.__doc__


@pytest.mark.parametrize("name", ["kn", "ks", "mu", "beta"])
@pytest.mark.parametrize("bad", [-1.0, NAN, INF, -INF])
def test_law_values(name: str, bad: float) -> None:
    with pytest.raises(InvalidSceneError, match=name) as caught:
        ContactLaw(**{"kn": 1.0, name: bad})
    assert repr(bad).lstrip("-") in str(caught.value)


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


@pytest.mark.parametrize("bad", [bad for bad in NO_NUMBER if bad is not None])
@pytest.mark.parametrize("name", ["kn", "ks", "mu", "beta", "restitution"])
def test_law_values_that_are_no_numbers(name: str, bad: object) -> None:
    with pytest.raises(
        InvalidSceneError, match=rf"{name} = .* is not allowed: it must be a (finite )?number"
    ) as caught:
        ContactLaw(**{"kn": 1.0, name: bad})
    assert repr(bad) in str(caught.value)


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
    for law in (ContactLaw(kn=KN, ks=KN), ContactLaw(kn=KN, mu=0.5)):
        with pytest.raises(InvalidSceneError, match="whose contact is smooth"):
            run(scene(disk_disk=law, initial_shear={(0, 1): 7.0}), numerics(1e-3, 1))
    high = wall("floor", (0, -1.0), (0, 1))
    with pytest.raises(InvalidSceneError, match=r"disk 0 and wall 'floor', which do not touch \(gap 0 m\)"):
        run(scene(walls=(high,), initial_shear={(0, 2): 1.0}), numerics(1e-3, 1))


def test_what_the_dem_cannot_express_is_refused() -> None:
    disks = Disks(x=[[0.0, 0.0], [1.9, 0.0]], radius=1.0, mass=1.0, held=[[False, False], [False, True]])
    with pytest.raises(InvalidSceneError, match="disk 1 is held in a motion, which the DEM cannot express"):
        DemSession(scene(disks=disks), numerics(1e-3, 1))
    with pytest.raises(InvalidNumericsError, match="regime = 'quasi-static' needs contact dynamics"):
        DemSession(scene(), numerics(1e-3, 1, regime="quasi-static"))


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


@pytest.mark.parametrize(
    "name", ["dt", "contact_dt", "n_steps", "sample_every", "sample_from", "sample_until", "theta"]
)
@pytest.mark.parametrize("bad", [-1, NAN, INF, *NO_NUMBER])
def test_numerics_values(name: str, bad: object) -> None:
    if bad is None and name in ("contact_dt", "sample_until"):
        assert getattr(Numerics(dt=1.0, n_steps=3, **{name: None}), name) is None
        return
    with pytest.raises(InvalidNumericsError, match=name) as caught:
        Numerics(**{"dt": 1.0, "n_steps": 3, name: bad})
    assert repr(bad) in str(caught.value)


@pytest.mark.parametrize("name", ["damping_form", "impact", "sliding", "regime"])
def test_numerics_choices(name: str) -> None:
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
