"""Non-convex grains against `GrainOracle`: lever arms, dashpots, shear history of several contacts of a pair; and planted defects."""

from __future__ import annotations

import numpy as np
import pytest
from grain_oracle import GrainOracle
from nurbs_shapes_of_tests import peanut
from scenes import numerics

from ninedisk.core import ContactLaw, Disks, Scene, Wall
from ninedisk.core.dem.session import DemSession
from ninedisk.core.dem.state import FS, SIDE
from ninedisk.core.nurbs.mass import uniform_grain
from ninedisk.core.nurbs.shapes import ellipse

DT, STEPS = 1e-3, 400

CLOSE = 1e-9
"""Round-off of some hundred steps; what the planted defects do is a millionfold."""


def tumble(seed: int, lever_arm: str, slip_at: str = "middle") -> Scene:
    """Peanuts and an ellipse thrown onto a floor and each other, rocking on both lobes, sliding and sticking."""
    rng = np.random.default_rng(seed)
    law = ContactLaw(kn=4e4, ks=2e4, mu=0.4, beta=0.1, lever_arm=lever_arm, slip_at=slip_at)
    kinds = [uniform_grain(peanut(), 1.0), uniform_grain(ellipse(1.2, 0.8), 1.0)]
    number = np.array([0, 0, 1])
    grain = [kinds[k] for k in number]
    disks = Disks(
        x=[(0.0, 0.75), (0.3, 2.3), (2.8, 0.85)],
        v=rng.normal([(0.4, 0.0), (0.3, -0.5), (-0.8, 0.0)], 0.1),
        omega=rng.normal([0.5, -0.5, 0.5], 0.1),
        radius=[g.radius for g in grain],
        mass=[g.mass for g in grain],
        inertia=[g.inertia for g in grain],
        outline=number,
        angle=rng.normal(0.0, 0.05, 3),
    )
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law)
    return Scene(
        disks=disks, disk_disk=law, walls=(floor,), gravity=(0.0, -9.81), outlines=tuple(k.outline for k in kinds)
    )


def farthest_apart(session: DemSession, oracle: GrainOracle, steps: int = STEPS) -> tuple[float, int]:
    """Largest difference of positions, angles and summed shear forces (over 10 N) on the way; most contacts of a pair. Advances both."""
    worst, most = 0.0, 0
    for _ in range(steps):
        session.advance(1)
        oracle.advance()
        _, now = session.snapshot()
        worst = max(worst, float(np.abs(now["x"] - oracle.x).max()))
        worst = max(worst, float(np.abs(now["angle"] + session.scene.disks.angle - oracle.angle).max()))
        sums: dict[tuple[int, int], float] = {}
        for contact in oracle.contacts:
            sums[contact.pair] = sums.get(contact.pair, 0.0) + contact.fs
            most = max(most, sum(other.pair == contact.pair for other in oracle.contacts))
        mine = session.shear_forces()
        for pair in {*sums, *mine}:
            worst = max(worst, abs(sums.get(pair, 0.0) - mine.get(pair, 0.0)) / 10.0)
    return worst, most


@pytest.mark.parametrize("lever_arm", ["radius", "overlap", "torque-overlap"])
@pytest.mark.parametrize("slip_at", ["middle", "end"])
def test_the_same_motion(lever_arm: str, slip_at: str) -> None:
    scene = tumble(1, lever_arm, slip_at)
    worst, most = farthest_apart(DemSession(scene, numerics(DT, STEPS)), GrainOracle(scene, DT))
    assert worst <= CLOSE
    assert most == 2


def test_a_lost_torque_of_normal_forces_is_seen() -> None:
    scene = tumble(1, "overlap")
    wrong = GrainOracle(scene, DT, normal_torque=False)
    assert farthest_apart(DemSession(scene, numerics(DT, STEPS)), wrong)[0] > 1e-3


@pytest.mark.parametrize("defect", ["lost", "swapped"])
def test_a_shear_history_that_follows_the_wrong_contact_is_seen(defect: str) -> None:
    """As if a rebuild lost the history, or the two contacts of a pair changed theirs, once."""
    scene = tumble(1, "overlap")
    session, oracle = DemSession(scene, numerics(DT, STEPS)), GrainOracle(scene, DT)
    assert farthest_apart(session, oracle, 100)[0] <= CLOSE
    assert session._outlines is not None
    memory = session._outlines.memory
    side = int(memory.mark[SIDE])
    rows = [k for k in range(int(memory.mark[1 + side])) if tuple(memory.body[side, k, :2]) == (0, 3)]
    assert len(rows) == 2
    assert abs(np.diff(memory.contact[side, rows, FS])[0]) > 1e-3
    if defect == "lost":
        memory.head[side] = -1
    else:
        memory.contact[side, rows, FS] = memory.contact[side, rows[::-1], FS]
    assert farthest_apart(session, oracle, 50)[0] > 1e3 * CLOSE
