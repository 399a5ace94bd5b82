"""Copies of a run in progress go on as the original does, and a run that is called again does not begin in the middle."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scenes import KN, numerics

from ninedisk.core import (
    ContactLaw,
    Disks,
    History,
    InterruptedRunError,
    Numerics,
    Scene,
    SolverNotConvergedError,
    Wall,
)
from ninedisk.core.cd import session as cd_session
from ninedisk.core.cd.session import CdSession
from ninedisk.core.dem.session import DemSession
from ninedisk.core.nurbs.mass import uniform_grain
from ninedisk.core.nurbs.shapes import ellipse

COPIES: dict[str, Callable[[Any], Any]] = {
    "deepcopy": copy.deepcopy,
    "copy": copy.copy,
    "pickle": lambda session: pickle.loads(pickle.dumps(session)),
}
DT, STEPS = 1e-3, 60


def bits(history: History) -> bytes:
    arrays = {**vars(history), **history.energy}
    return b"".join(array.tobytes() for array in arrays.values() if isinstance(array, np.ndarray))


def packed(n: int, beta: float = 0.1) -> Scene:
    """Disks that fall on each other, enough of them to be kept in the order of the cells."""
    side = int(np.ceil(np.sqrt(n)))
    rng = np.random.default_rng(n)
    x = np.array([(1.0 + 2.0 * (k % side), 1.0 + 2.0 * (k // side)) for k in range(n)]) + rng.uniform(
        -0.05, 0.05, (n, 2)
    )
    law = ContactLaw(kn=KN, ks=KN, mu=0.5, beta=beta)
    walls = (Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law),)
    return Scene(disks=Disks(x=x, v=rng.normal(0.0, 1.0, (n, 2)), radius=1.0, mass=1.0), disk_disk=law, walls=walls)


@pytest.mark.parametrize("form", ["central", "lagged"])
@pytest.mark.parametrize("n", [12, 2500])
@pytest.mark.parametrize("way", COPIES)
def test_a_copy_of_a_dem_run_goes_on_to_the_same_bits(way: str, n: int, form: str) -> None:
    session = DemSession(packed(n), numerics(DT, STEPS, sample_every=10, damping_form=form))
    session.advance(STEPS // 2)
    other = COPIES[way](session)
    before = other.snapshot()[1]["x"]
    mine, its = session.run(), other.run()
    assert bits(mine) == bits(its)
    assert np.abs(other.snapshot()[1]["x"] - before).max() > 0.0  # it moves, and
    assert bits(session.history()) == bits(mine)  # it is not the original that it moves


def test_a_copy_of_a_run_with_outlines_goes_on_to_the_same_bits() -> None:
    grain = uniform_grain(ellipse(1.2, 0.8), 1.0)
    disks = Disks(
        x=[[0.0, 0.78], [0.3, 2.3]],
        v=[[0.0, 0.0], [0.0, -3.0]],
        radius=1.2,
        mass=grain.mass,
        inertia=grain.inertia,
        outline=0,
    )
    law = ContactLaw(kn=KN, ks=KN, mu=0.5)
    walls = (Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law),)
    scene = Scene(disks=disks, disk_disk=law, walls=walls, outlines=(grain.outline,))
    session = DemSession(scene, numerics(DT, STEPS))
    session.advance(STEPS // 2)
    other = copy.deepcopy(session)
    assert bits(other.run()) == bits(session.run())


class StopError(Exception):
    pass


def stop_at(step: int) -> Callable[[int, int], None]:
    def told(done: int, _: int) -> None:
        if done >= step:
            raise StopError

    return told


def cd_run(**changes: Any) -> CdSession:
    how = Numerics(**{"dt": 5e-3, "n_steps": 40, "sample_every": 5, "sliding": "coulomb", **changes})
    return CdSession(packed(12, beta=0.0).replace(gravity=(0.0, -10.0)), how, [(0, 1), (0, 12)])


@pytest.mark.parametrize("changes", [{}, {"solver": "interior-point", "sliding": "associated"}, {"contact_dt": 2.5e-3}])
def test_contact_dynamics_goes_on_after_an_exception_in_the_callback(
    monkeypatch: pytest.MonkeyPatch, changes: dict[str, Any]
) -> None:
    whole = cd_run(**changes)
    expected = bits(whole.run())
    assert bits(whole.run()) == expected  # again: the same, not a run from its end
    monkeypatch.setattr(cd_session, "PROGRESS_EVERY", 0.0)
    for way in COPIES.values():
        session = cd_run(**changes)
        with pytest.raises(StopError):
            session.run(stop_at(15))
        other = way(session)
        assert bits(session.run()) == expected
        assert bits(other.run()) == expected


def test_a_run_of_contact_dynamics_that_failed_says_the_same_again() -> None:
    session = cd_run(options={"cd.max_iterations": 1}, solver="gauss-seidel")
    said = set()
    for _ in range(2):
        with pytest.raises(SolverNotConvergedError) as caught:
            session.run()
        said.add(str(caught.value))
    assert len(said) == 1


def test_a_run_that_was_stopped_inside_a_step_does_not_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    session = cd_run()
    with monkeypatch.context() as patched:
        patched.setattr(session, "_advance_to", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            session.run()
    with pytest.raises(InterruptedRunError, match=r"stopped inside a step after step 0.*begin a new session"):
        session.run()
