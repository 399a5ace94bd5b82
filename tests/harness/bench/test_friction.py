"""Friction of runs: slips and errors in closed form, the frames in which engines solve contacts, friction that is planted wrong."""

from __future__ import annotations

import math
from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest

from ninedisk.core import packings
from ninedisk.core.history import History, Pair
from ninedisk.core.law import ContactLaw
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Disks, Scene, Wall
from ninedisk.core.scene.walls import WallSegment
from ninedisk.harness.api.registry import get_engine
from ninedisk.harness.bench import friction
from ninedisk.harness.bench.flow import without_contacts
from ninedisk.harness.bench.friction import friction_of, near_pairs, slips_of

LAW = ContactLaw(kn=1.0, mu=0.5, regularised=True)
DT, G = 1e-2, 10.0
SCHEMES = ["cd", pytest.param("pymunk", marks=pytest.mark.skipif(find_spec("pymunk") is None, reason="no pymunk"))]


def scene_of(x: list[list[float]], *walls: Wall) -> Scene:
    return Scene(disks=Disks(x=x, radius=1.0, mass=2.0), disk_disk=LAW, walls=walls, gravity=(0.0, -G))


FLOOR = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=LAW)


def test_slips_in_closed_form() -> None:
    """Normals point from i to j and tangents are these turned counter-clockwise: beside a disk on the right up, on a floor to the right."""
    scene = scene_of([[0.0, 1.0], [2.0, 1.0]], FLOOR)
    pairs, normal = np.array([[0, 1], [0, 2]]), np.array([[1.0, 0.0], [0.0, -1.0]])
    v, omega = np.array([[3.0, 0.5], [7.0, 0.25]]), np.array([0.125, 4.0])
    walls = (np.array([[0.0, 0.0]]), np.array([[0.0625, 9.0]]), np.array([0.0]))
    found = slips_of(scene, pairs, normal, scene.disks.x, (v, omega), walls)
    assert found.tolist() == [0.5 - 0.25 + 0.125 + 4.0, 3.0 - 0.0625 + 0.125]
    # A wall that turns about a point 5 below the contact carries the material there to the left.
    walls = (np.array([[0.0, -5.0]]), np.array([[0.0, 0.0]]), np.array([2.0]))
    assert slips_of(scene, pairs, normal, scene.disks.x, (0.0 * v, 0.0 * omega), walls)[1] == 10.0


def slide(sign: float = 1.0, scheme: str = "theta", **told: object) -> float:
    """Error of a disk that slides on a floor for four steps, with ``sign`` times the friction that it has."""
    scene = scene_of([[0.0, 1.0]], FLOOR)
    t = DT * np.arange(5)
    history = History.empty(
        range(5), t, n_disks=1, n_walls=1, pairs=((0, 1),), force_meaning=told.get("meaning", "step-mean")
    )
    speed = 4.0 - 0.5 * G * t
    history.v[:] = np.stack([speed, 0.0 * t], axis=1)[:, None]
    history.x[:] = np.stack([DT * np.cumsum(speed), 1.0 + 0.0 * t], axis=1)[:, None]
    history.omega[:] = -0.5 * G * t[:, None]
    history.fn[1:], history.fs[1:] = 2.0 * G, -sign * 0.5 * 2.0 * G
    if told.get("silent"):
        history.fs[:] = math.nan
    return friction_of(history, scene, scheme)


@pytest.mark.parametrize("scheme", friction.SOLVED_AT)
@pytest.mark.parametrize(("sign", "error"), [(1.0, 0.0), (0.5, 0.5), (1.2, 0.2), (-1.0, 2.0)])
def test_a_slide_with_friction_too_weak_too_strong_and_the_wrong_direction(
    scheme: str, sign: float, error: float
) -> None:
    assert slide(sign, scheme) == pytest.approx(error, abs=1e-15)


def test_what_has_no_rigid_law_or_reports_nothing_is_not_judged() -> None:
    assert math.isnan(slide(scheme="central-difference"))
    assert math.isnan(slide(meaning="instantaneous"))
    assert math.isnan(slide(silent=True))


def flowing(mu: float) -> Scene:
    """Disks that fall against each other and the sides of a drum that turns; all contacts with one coefficient of friction."""
    scene = packings.drum(40, turns_per_second=0.5)
    v = np.random.default_rng(1).normal(0.0, 3.0, (40, 2))
    disks = Disks(x=scene.disks.x, v=v, radius=scene.disks.radius, mass=scene.disks.mass)
    walls = tuple(replace(wall, law=replace(wall.law, mu=mu)) for wall in scene.walls)
    return without_contacts(scene.replace(disks=disks, walls=walls, disk_disk=replace(scene.disk_disk, mu=mu)))


def run_of(name: str, scene: Scene, pairs: list[Pair]) -> History:
    options = {"cd.tolerance": 1e-8} if name == "cd" else {"pymunk.iterations": 300}
    numerics = Numerics(dt=5e-3, n_steps=40, sliding="coulomb", options=options)
    return get_engine(name).run(scene, numerics, pairs).history


@pytest.mark.parametrize("name", SCHEMES)
def test_engines_that_solve_contacts_well_have_little_error_and_the_wrong_mu_shows(name: str) -> None:
    """Friction of 0.25 held to a law of 0.5: contacts that slide bear half of it; those that stick may."""
    scheme = get_engine(name).info().scheme
    scene, weak = flowing(0.5), flowing(0.25)
    pairs = near_pairs(scene)
    assert friction_of(run_of(name, scene, pairs), scene, scheme) < 1e-3
    assert friction_of(run_of(name, weak, pairs), weak, scheme) < 1e-3
    assert 0.1 < friction_of(run_of(name, weak, pairs), scene, scheme) < 0.5


@pytest.mark.parametrize("name", SCHEMES)
def test_torques_say_where_contacts_are_solved(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Friction in the right frame, times the radius, is what changes the spins; frames of the other end of the step miss it."""
    scheme = get_engine(name).info().scheme
    scene = flowing(0.5)
    scene = scene.replace(walls=tuple(replace(wall, motion=()) for wall in scene.walls))
    history = run_of(name, scene, [(i, j) for i in range(40) for j in range(i + 1, scene.n_bodies)])
    seen = {}

    def note(fn: np.ndarray, fs: np.ndarray, slip: np.ndarray, mu: np.ndarray) -> float:  # noqa: ARG001
        seen["fs"] = fs
        return 0.0

    monkeypatch.setattr(friction, "friction_error", note)

    def missed() -> float:
        friction_of(history, scene, scheme)
        disks, pairs = scene.disks, np.array(history.pairs)
        torque = np.zeros((len(seen["fs"]), len(disks)))
        for side in (0, 1):
            own = pairs[:, side] < len(disks)
            np.add.at(torque.T, pairs[own, side], (seen["fs"][:, own] * disks.radius[pairs[own, side]]).T)
        given = disks.inertia * np.diff(history.omega, axis=0) / 5e-3
        return float(np.abs(torque - given).max() / np.abs(given).max())

    assert missed() < 1e-9, "round-off, and lengths by which engines enlarge disks"
    if scheme != "theta":  # ours reports forces in the frames that it has solved them in
        monkeypatch.setitem(friction.SOLVED_AT, scheme, (0, 0))
        assert missed() > 1e-4


def test_pairs_that_are_near_and_not_yet_in_contact_are_watched() -> None:
    scene = scene_of([[0.0, 1.0], [2.4, 1.0], [0.0, 3.6]], FLOOR)
    assert sorted(near_pairs(scene)) == [(0, 1), (0, 3), (1, 3)]


def test_a_wall_that_turns_carries_what_sticks_to_it() -> None:
    """A disk on a floor that turns with it about a point 5 below: nothing slips, whatever is borne within the cone."""
    motion = (WallSegment(angular_velocity=0.2, pivot=(0.0, -5.0)),)
    scene = scene_of([[0.0, 1.0]], replace(FLOOR, motion=motion))
    t = DT * np.arange(5)
    history = History.empty(range(5), t, n_disks=1, n_walls=1, pairs=((0, 1),), force_meaning="step-mean")
    out = np.column_stack([-np.sin(0.2 * t), np.cos(0.2 * t)])
    history.x[:, 0] = 6.0 * out - [0.0, 5.0]
    history.v[:, 0] = 1.2 * np.column_stack([-out[:, 1], out[:, 0]])
    history.omega[:] = 0.2
    history.fn[1:], history.fs[1:] = 20.0, 3.0
    for scheme in friction.SOLVED_AT:
        assert friction_of(history, scene, scheme) == 0.0
    history.omega[:] = 0.21  # to the right where friction pushes to the right
    for scheme in friction.SOLVED_AT:
        assert friction_of(history, scene, scheme) == pytest.approx(1.3, rel=1e-2), "in frames that turn by 2e-3"
