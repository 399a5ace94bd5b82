"""History of a run of contact dynamics in space."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.core.cd.space.bodies import Solid, State
from ninedisk.core.cd.space.contacts import ContactSearch
from ninedisk.core.cd.space.rotations import applied
from ninedisk.core.cd.space.step import Memory
from ninedisk.core.history import History, Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import SphereScene

ENERGIES = ("translation", "rotation", "kinetic", "gravity", "wall_work", "impact_gain")


class Recorder:
    """History in the making; contact forces are the impulses of a step over its length and have no value before the first one.

    Parameters
    ----------
    scene : SphereScene
    numerics : Numerics
    solid : Solid
    search : ContactSearch
    pairs : tuple of pairs
        Watched contacts.
    chosen : ndarray of int64, shape (k,)
        Bodies whose motion is recorded.

    Attributes
    ----------
    history : History
    """

    def __init__(
        self,
        scene: SphereScene,
        numerics: Numerics,
        solid: Solid,
        search: ContactSearch,
        pairs: tuple[Pair, ...],
        chosen: NDArray[np.int64],
    ) -> None:
        self._scene, self._solid, self._search, self._chosen = scene, solid, search, chosen
        steps = numerics.sampled_steps()
        self._at = {int(step): row for row, step in enumerate(steps)}
        history = History.empty(
            steps,
            np.multiply(steps, numerics.dt, dtype=np.float64),
            n_disks=len(chosen),
            n_walls=len(scene.walls),
            pairs=pairs,
            force_meaning="step-mean",
            energies=ENERGIES,
            dimension=3,
            boxes=bool(scene.spheres.boxes.any()),
        )
        everyone = len(chosen) == len(scene.spheres) and bool((chosen == np.arange(len(chosen))).all())
        self.history = history if everyone else replace(history, particles=tuple(int(i) for i in chosen))
        self._pairs = np.array(pairs, dtype=np.int64).reshape(len(pairs), 2)

    def stops(self, last: int) -> list[int]:
        """Steps after which there is something to do: those sampled, and the last one; not step 0."""
        return sorted({*self._at, last} - {0})

    def sample(
        self, step: int, state: State, walls: FloatArray, memory: Memory, wall_work: float, impact_gain: float
    ) -> None:
        """Write the state after ``step`` if it is a sampled one.

        Parameters
        ----------
        step : int
        state : State
        walls : ndarray, shape (m, 4, 3)
            Walls at this time (`ninedisk.core.cd.space.walls.WallPoses.at`).
        memory : Memory
            Contact forces of the step that ends here.
        wall_work, impact_gain : float
            Work of the walls, and energy fed by impacts, since time 0 [J].
        """
        row = self._at.get(step)
        if row is None:
            return
        history, chosen = self.history, self._chosen
        history.x[row], history.v[row] = state.x[chosen], state.v[chosen]
        history.angle[row], history.omega[row] = state.angle[chosen], state.omega[chosen]
        if history.quaternion is not None:
            history.quaternion[row] = state.quaternion[chosen]
        history.wall_point[row], history.wall_angle[row] = walls[:, 0], walls[:, 1]
        history.gap[row] = self._search.gaps(state.x, state.quaternion, walls, self._pairs)
        if step > 0:
            self._forces(row, memory)
        self._energies(row, state, wall_work, impact_gain)

    def _forces(self, row: int, memory: Memory) -> None:
        history, n = self.history, len(self._scene.spheres)
        for k, pair in enumerate(self._pairs):
            mine = (memory.pairs == pair).all(axis=1)
            friction = memory.friction[mine]
            history.fn[row, k], history.fs[row, k] = memory.r[mine, 0].sum(), friction.sum(axis=0)
            if history.moment is not None:
                history.moment[row, k] = np.cross(memory.arm[mine], memory.force[mine]).sum(axis=0)
        history.wall_force[row] = 0.0
        of_wall = memory.pairs[:, 1] >= n
        np.add.at(history.wall_force[row], memory.pairs[of_wall, 1] - n, -memory.force[of_wall])

    def _energies(self, row: int, state: State, wall_work: float, impact_gain: float) -> None:
        solid, energy = self._solid, self.history.energy
        momentum = applied(solid.inertia(state.quaternion), state.omega)
        energy["translation"][row] = 0.5 * float(np.sum(solid.mass * np.sum(state.v**2, axis=1)))
        energy["rotation"][row] = 0.5 * float(np.sum(state.omega * momentum))
        energy["kinetic"][row] = energy["translation"][row] + energy["rotation"][row]
        energy["gravity"][row] = -float(np.sum(solid.weight[:, :3] * state.x))
        energy["wall_work"][row], energy["impact_gain"][row] = wall_work, impact_gain
