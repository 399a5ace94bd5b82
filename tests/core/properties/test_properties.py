"""Laws of motion on random scenes, by the DEM and by contact dynamics; each law has been seen failing on a planted defect."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import laws_of_motion as laws
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from random_worlds import Run, World, world, worlds

from ninedisk.core.dem.session import DemSession
from ninedisk.core.history import History
from ninedisk.core.law import ContactLaw
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Disks, Scene

METHODS = ("dem", "cd")
fixed = settings(
    max_examples=15,
    derandomize=True,  # the same examples on every machine
    database=None,
    deadline=None,  # the first one compiles
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture, HealthCheck.differing_executors],
)
ANGLES = st.floats(-3.0, 3.0)
SHIFTS = st.tuples(st.floats(-20.0, 20.0), st.floats(-20.0, 20.0))


@pytest.mark.parametrize("method", METHODS)
class TestLaws:
    @fixed
    @given(data=st.data())
    def test_action_equals_reaction(self, method: str, data: st.DataObject) -> None:
        drawn = data.draw(worlds(method))
        laws.action_equals_reaction(drawn, drawn.core)

    @fixed
    @given(data=st.data())
    def test_momentum_is_conserved(self, method: str, data: st.DataObject) -> None:
        drawn = data.draw(worlds(method, walls=0))
        laws.momentum_is_conserved(drawn, drawn.core)

    @fixed
    @given(data=st.data(), angle=ANGLES, shift=SHIFTS, mirror=st.booleans())
    def test_frame_does_not_matter(
        self, method: str, data: st.DataObject, angle: float, shift: tuple[float, float], mirror: bool
    ) -> None:
        drawn = data.draw(worlds(method))
        laws.frame_does_not_matter(drawn, drawn.core, angle=angle, shift=shift, mirror=mirror)

    @fixed
    @given(data=st.data(), boost=st.tuples(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0)))
    def test_steady_motion_does_not_matter(self, method: str, data: st.DataObject, boost: tuple[float, float]) -> None:
        drawn = data.draw(worlds(method))
        laws.steady_motion_does_not_matter(drawn, drawn.core, boost=boost)

    @fixed
    @given(data=st.data(), seed=st.integers(0, 999))
    def test_numbers_do_not_matter(self, method: str, data: st.DataObject, seed: int) -> None:
        drawn = data.draw(worlds(method))
        laws.numbers_do_not_matter(drawn, drawn.core, seed=seed)

    @fixed
    @given(data=st.data(), length=st.integers(-20, 20), mass=st.integers(-20, 20), time=st.integers(-12, 12))
    def test_units_do_not_matter(self, method: str, data: st.DataObject, length: int, mass: int, time: int) -> None:
        drawn = data.draw(worlds(method))
        laws.units_do_not_matter(drawn, drawn.core, length=length, mass=mass, time=time)

    @fixed
    @given(data=st.data())
    def test_forces_lie_in_the_cone(self, method: str, data: st.DataObject) -> None:
        drawn = data.draw(worlds(method))
        laws.forces_lie_in_the_cone(drawn, drawn.core)


@fixed
@given(drawn=worlds("dem"), at=st.integers(0, 60))
def test_restart_changes_no_bit(drawn: World, at: int, tmp_path: Path) -> None:
    laws.restart_changes_no_bit(drawn, at=at, file=tmp_path / "checkpoint.npz")


@fixed
@given(drawn=worlds("cd"), at=st.integers(0, 11))
def test_restart_of_contact_dynamics(drawn: World, at: int) -> None:
    laws.restart_of_contact_dynamics(drawn, drawn.core, at=at)


@fixed
@given(drawn=worlds("cd"))
def test_bodies_do_not_pass_each_other(drawn: World) -> None:
    laws.bodies_do_not_pass_each_other(drawn, drawn.core)


@pytest.mark.parametrize("method", METHODS)
def test_the_random_scenes_touch_slide_and_stick(method: str) -> None:
    """What the laws above are tried on: most scenes have contacts, with and without slip."""
    touched, slid, stuck = 0, 0, 0
    for sample in samples(method):
        history = sample.watched(sample.core)
        mu = np.array([sample.scene.law(pair).mu for pair in sample.pairs])
        on = history.fn[1:] > 1e-6 * history.fn[1:].max()
        ratio = np.abs(history.fs[1:]) / np.where(on, mu * history.fn[1:], np.inf)
        touched += bool(on.any())
        slid += bool((ratio > 1.0 - 1e-6).any())
        stuck += bool(((ratio > 1e-3) & (ratio < 0.99)).any())
    assert touched >= 3
    assert slid >= 2
    assert stuck >= 2


def samples(method: str) -> Iterator[World]:
    """A few scenes with everything in them, for the defects."""
    for seed in range(4):
        extra: dict[str, Any] = {"beta": 0.1, "lever_arm": "overlap"}
        if method == "cd":
            extra = {"regularised": True, "restitution": 0.0}
        law = ContactLaw(kn=1e4, ks=5e3, mu=0.5, **extra)
        yield world(method, seed=seed, n=6, law=law, walls=3, pull=1.0, steps=60 if method == "dem" else 12)


def changed(scene: Scene, **columns: Any) -> Scene:
    """A scene with other columns of its disks."""
    return scene.replace(disks=Disks(**{**vars(scene.disks), **columns}))


def heavier_first(run: Run) -> Run:
    """Disk 0 is treated as a millionth heavier than it is: its forces are not those of its partners."""
    factor = 1.0 + 1e-6

    def broken(scene: Scene, numerics: Numerics, watch: list[tuple[int, int]]) -> History:
        mass = scene.disks.mass.copy()
        mass[0] *= factor
        return run(changed(scene, mass=mass), numerics, watch)

    return broken


def windy(run: Run) -> Run:
    """Something pulls along x, in whatever frame and unit: a thousandth of the speed in a run."""

    def broken(scene: Scene, numerics: Numerics, watch: list[tuple[int, int]]) -> History:
        wind = 1e-3 * float(np.abs(scene.disks.v).max()) / (numerics.n_steps * numerics.dt)
        return run(scene.replace(gravity=(scene.gravity[0] + wind, scene.gravity[1])), numerics, watch)

    return broken


def rounded_to_a_grid(run: Run) -> Run:
    """Positions are kept to a micrometre: neither shifts nor units leave that alone."""

    def broken(scene: Scene, numerics: Numerics, watch: list[tuple[int, int]]) -> History:
        return run(changed(scene, x=np.round(scene.disks.x, 6)), numerics, watch)

    return broken


def dragged(run: Run) -> Run:
    """Air at rest slows everything a little."""

    def broken(scene: Scene, numerics: Numerics, watch: list[tuple[int, int]]) -> History:
        return run(scene.replace(xi=1e-4 / (numerics.n_steps * numerics.dt)), numerics, watch)

    return broken


def too_rough(run: Run) -> Run:
    """Friction bounded by a ten-thousandth too much."""

    def broken(scene: Scene, numerics: Numerics, watch: list[tuple[int, int]]) -> History:
        def rough(law: ContactLaw) -> ContactLaw:
            return ContactLaw(**{**vars(law), "mu": 1.0001 * law.mu})

        walls = tuple(type(w)(**{**vars(w), "law": rough(w.law)}) for w in scene.walls)
        return run(scene.replace(disk_disk=rough(scene.disk_disk), walls=walls), numerics, watch)

    return broken


def too_small(run: Run) -> Run:
    """Radii shrunk by a millionth: bodies pass into each other by that much."""

    def broken(scene: Scene, numerics: Numerics, watch: list[tuple[int, int]]) -> History:
        history = run(changed(scene, radius=scene.disks.radius * (1.0 - 1e-6)), numerics, watch)
        n = len(scene.disks)
        radius = np.append(scene.disks.radius, np.zeros(len(scene.walls)))
        less = np.array([1e-6 * (radius[i] + (radius[j] if j < n else 0.0)) for i, j in watch])
        history.gap[:] -= less
        return history

    return broken


def forgetful(run: Run) -> Run:
    """Runs shorter than the whole begin with other spins: what a state that lacks them would do."""

    def broken(scene: Scene, numerics: Numerics, watch: list[tuple[int, int]]) -> History:
        whole = numerics.n_steps == 12
        return run(scene if whole else changed(scene, omega=np.zeros(len(scene.disks))), numerics, watch)

    return broken


DEFECTS: dict[str, tuple[Callable[[Run], Run], Callable[[World, Run], None]]] = {
    "action": (heavier_first, laws.action_equals_reaction),
    "momentum": (windy, laws.momentum_is_conserved),
    "turn": (windy, lambda w, r: laws.frame_does_not_matter(w, r, angle=1.0, shift=(0.0, 0.0), mirror=False)),
    "mirror": (windy, lambda w, r: laws.frame_does_not_matter(w, r, angle=2.0, shift=(0.0, 0.0), mirror=True)),
    "shift": (rounded_to_a_grid, lambda w, r: laws.frame_does_not_matter(w, r, angle=0.0, shift=(np.pi, 1.0), mirror=False)),
    "boost": (dragged, lambda w, r: laws.steady_motion_does_not_matter(w, r, boost=(2.0, -1.0))),
    "numbers": (heavier_first, lambda w, r: laws.numbers_do_not_matter(w, r, seed=1)),
    "units": (rounded_to_a_grid, lambda w, r: laws.units_do_not_matter(w, r, length=-3, mass=2, time=1)),
    "cone": (too_rough, laws.forces_lie_in_the_cone),
    "gap": (too_small, laws.bodies_do_not_pass_each_other),
    "restart": (forgetful, lambda w, r: laws.restart_of_contact_dynamics(w, r, at=5)),
}  # fmt: skip
BOTH = [(name, method) for name in DEFECTS for method in METHODS if method == "cd" or name not in ("gap", "restart")]


@pytest.mark.long
@pytest.mark.parametrize(("name", "method"), BOTH)
def test_planted_defects_are_found(name: str, method: str) -> None:
    plant, law = DEFECTS[name]
    found = 0
    for sample in samples(method):
        law(sample, sample.core)
        try:
            law(sample, plant(sample.core))
        except AssertionError:
            found += 1
    assert found >= 2, "the law does not see this defect"


def test_a_checkpoint_that_forgets_the_shear_forces_is_found(tmp_path: Path) -> None:
    def forgetting(file: Path) -> DemSession:
        session = DemSession.load(file)
        session._lists.pairs.shear[:] = 0.0
        session._lists.wall_pairs.shear[:] = 0.0
        return session

    found = 0
    for sample in samples("dem"):
        laws.restart_changes_no_bit(sample, at=30, file=tmp_path / "c.npz")
        try:
            laws.restart_changes_no_bit(sample, at=30, file=tmp_path / "c.npz", load=forgetting)
        except AssertionError:
            found += 1
    assert found >= 2
