"""Lists of neighbours miss no contact, however slow bodies are and however many steps lie between two rebuilds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ninedisk.core import Cell, ContactLaw, Disks, History, Numerics, Scene
from ninedisk.core.dem.session import DemSession
from ninedisk.core.dem.space.session import SphereSession
from ninedisk.core.law import SphereLaw
from ninedisk.core.scene import Spheres, SphereScene

DT, KN = 1e-3, 1e4
GAP = 0.05
"""Skin of the first lists over the mean radius (`FIRST_SKIN`)."""
KINDS = ("plane", "cell", "space")


def pair(kind: str, x: np.ndarray, v: np.ndarray) -> Scene | SphereScene:
    """Two bodies of radius and mass 1 along x; in a cell whose edges are far away."""
    if kind == "space":
        centres, velocities = (np.column_stack([values, np.zeros(2)]) for values in (x, v))
        return SphereScene(
            spheres=Spheres(x=centres, v=velocities, radius=1.0, mass=1.0), sphere_sphere=SphereLaw(kn=KN)
        )
    cell = Cell(size=(40.0, 40.0)) if kind == "cell" else None
    return Scene(disks=Disks(x=x, v=v, radius=1.0, mass=1.0), disk_disk=ContactLaw(kn=KN), cell=cell)


def session(scene: Scene | SphereScene, steps: int, samples: int = 1) -> DemSession | SphereSession:
    kind = SphereSession if isinstance(scene, SphereScene) else DemSession
    how = Numerics(dt=steps * DT, n_steps=samples, contact_dt=DT)
    return kind(scene, how, [(0, 1)])  # type: ignore[arg-type]


def met(kind: str, steps: int) -> History:
    """Both bodies close by half of the skin in ``steps`` steps, and touch one step in 10,000 later."""
    half, u = 0.5 * GAP * 1.0001, 0.5 * GAP / steps
    x = np.array([[-1.0 - half, 0.0], [1.0 + half, 0.0]])
    v = np.array([[u / DT, 0.0], [-u / DT, 0.0]])
    return session(pair(kind, x, v), int(1.02 * steps)).run()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("steps", [330_000, 1_000_000])
def test_slow_bodies_rebound_with_the_speed_that_they_come_with(kind: str, steps: int) -> None:
    """A list that is late by 0.4 % of its skin lets the overlap begin at 2e-4 radii, which drives them apart 80 times as fast.

    The scheme's own error is at most an overlap of one step, (omega dt)^2/8 = 3e-3 of the energy with omega^2 = 2 kn/m.
    """
    v = met(kind, steps).v[:, :, 0]
    np.testing.assert_allclose(v[-1], v[0, ::-1], rtol=3e-3)


@pytest.mark.sampled(1)
@pytest.mark.long
@pytest.mark.parametrize("kind", ["plane", "space"])
def test_a_body_that_takes_two_hundred_million_steps_per_radius_is_not_passed_through(kind: str) -> None:
    """Below 7e-10 radii a step a sum in single precision stops growing before the skin is used up."""
    u = 9e-10
    x, v = np.array([[0.0, 0.0], [2.051, 0.0]]), np.array([[u / DT, 0.0], [0.0, 0.0]])
    history = session(pair(kind, x, v), 3_000_000, 20).run()
    np.testing.assert_allclose(history.v[-1, :, 0] * DT / u, [0.0, 1.0], atol=3e-3)
    assert history.gap.min() > -2.0 * u * np.sqrt(0.5 / KN) / DT


@settings(max_examples=60, deadline=None)
@given(
    kind=st.sampled_from(KINDS),
    exponent=st.floats(-16.0, -1.0),
    left=st.floats(1.0, 30.0),
    share=st.floats(0.0, 1.0),
)
def test_no_pair_is_missed_at_any_speed(kind: str, exponent: float, left: float, share: float) -> None:
    """The lists are of long ago: since then bodies have come so close that ``left`` more steps bring them together.

    ``share`` of the speed is the first body's. A contact is missed where an overlap of several steps carries no force.
    """
    u = 10.0**exponent
    start = np.array([[-0.5 * GAP * 1.001, 0.0], [2.0 + 0.5 * GAP * 1.001, 0.0]])
    v = np.array([[share * u / DT, 0.0], [-(1.0 - share) * u / DT, 0.0]])
    steps = int(left) + 40
    run = session(pair(kind, start, v), 1, steps)
    assert run.counts.pairs == 0
    x = run._state.x.reshape(-1, 4)[:, :2] if isinstance(run, SphereSession) else run._disks.x
    x[0, 0], x[1, 0] = 0.0, 2.0 + left * u
    history = run.run()
    # A distance near 2 has a rounding of 4e-16; an overlap of 8 roundings must be felt in the same step.
    deep = history.gap[:, 0] < -4e-15
    assert (history.fn[deep, 0] > 0.0).all()
    if u > 1e-15 and left < 20.0:
        assert history.fn.max() > 0.0
