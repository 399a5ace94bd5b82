"""Scenes of probes whose disks are held."""

from __future__ import annotations

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene
from ninedisk.harness.api.case import Setup
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.check_engine.claims import Claim, Probe, contact_error, round_off
from ninedisk.harness.check_engine.scenes import G, M, R, has_springs, law, resting_overlap, some_disks


def held(info: EngineInfo) -> Probe:
    """A disk whose x velocity is prescribed falls freely along y."""
    moved = some_disks(x=[[0.0, 0.0]], v=[[0.3, 0.0]], held=[[True, False]])
    scene = Scene(disks=moved, disk_disk=law(info), gravity=(1.0, -2.0))
    numerics = Numerics(dt=0.01, n_steps=20)

    def claims(history: History) -> list[Claim]:
        t = numerics.sampled_steps() * numerics.dt
        return [
            Claim(quantity="v", unit="m/s", value=history.v[:, 0], expected=np.column_stack([np.full(len(t), 0.3), -2.0 * t]),
                  bound=10 * round_off(info), why="round-off", mend="a held component keeps its velocity, the other one stays free"),
            Claim(quantity="x", unit="m", value=history.x[:, 0, 0], expected=0.3 * t, bound=10 * round_off(info), why="round-off"),
        ]  # fmt: skip

    return Probe(name="held", setup=Setup(scene=scene, numerics=numerics, watch=()), claims=claims)


def fixed(info: EngineInfo) -> Probe:
    """A disk at rest on top of a fixed one, which stays where it is; a second fixed one overlaps the first without a force."""
    sunk = resting_overlap(info)
    x = [[0.0, 0.0], [0.0, 2.0 * R - sunk], [0.0, -R]]
    still = [True, False, True]
    disks = some_disks(x=x, held=np.column_stack([still, still]), rotating=[False, True, False])
    scene = Scene(disks=disks, disk_disk=law(info), gravity=(0.0, -G))
    numerics = Numerics(dt=0.002, n_steps=20)
    allowed = contact_error(info)

    def claims(history: History) -> list[Claim]:
        why = "round-off: nothing moves it"
        slack = 1e-9 if has_springs(info) else max(1e-3, allowed) * R
        return [
            Claim(quantity="x of the fixed disks", unit="m", value=history.x[-1, [0, 2]], expected=[x[0], x[2]], bound=round_off(info),
                  why=why, mend="a disk that is held at rest in both directions and does not turn stays: gravity and contacts move it not"),
            Claim(quantity="v of the fixed disks", unit="m/s", value=history.v[-1, [0, 2]], expected=np.zeros((2, 2)), bound=0.0, why=why),
            Claim(quantity="y of the disk on top", unit="m", value=history.x[-1, 1, 1], expected=x[1][1], bound=slack,
                  why="kn gap = weight" if has_springs(info) else "rigid disks may sink by a thousandth of their radius",
                  mend="a fixed disk bears contacts as a wall does"),
            Claim(quantity="fn of the pair (0, 1)", unit="N", value=history.fn[-1, 0], expected=M * G, bound=float(allowed * M * G),
                  why="equilibrium: round-off and the solver's tolerance"),
        ]  # fmt: skip

    return Probe(name="fixed", setup=Setup(scene=scene, numerics=numerics, watch=((0, 1),)), claims=claims)
