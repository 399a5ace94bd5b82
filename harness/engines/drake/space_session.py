"""Spheres in space in Drake's discrete plants: as disks of the plane, see `ninedisk.harness.engines.drake.session`."""

from __future__ import annotations

from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.harness.engines.drake.session import ENGINE_VERSION, SapSession, copy_state
from ninedisk.harness.engines.space import PlanePoses, write_contacts

__all__ = ["ENGINE_VERSION", "LaggedSessionInSpace", "SapSessionInSpace"]


class SapSessionInSpace(SapSession):
    """Discrete plant; planes rest."""

    def __init__(self, scene: Any, numerics: Any, pairs: Any) -> None:
        self.angle = np.zeros_like(scene.spheres.omega)
        super().__init__(scene, numerics, pairs)

    def wall_poses(self) -> Any:
        """What gives the planes' poses."""
        return PlanePoses(self.scene)

    def advance(self, n_steps: int) -> None:
        """Step the plant, and sum the spins: Drake moves bodies with those of the step's end."""
        for _ in range(n_steps):
            self.done += 1
            self.world.simulator.AdvanceTo(self.done * self.dt)
            self.angle += self.dt * self.world.state()[3]

    def observe(self, history: History, row: int) -> None:
        """Copy the state, and the contact impulses of the last step as forces."""
        copy_state(self.world, history, row, self.done)
        history.angle[row] = self.angle
        impulses = {pair: force * self.dt for pair, force in self.world.forces().items()} if self.done else None
        write_contacts(self.scene, history, row, self.poses(self.done * self.dt), impulses, self.dt)


class LaggedSessionInSpace(SapSessionInSpace):
    """Discrete plant whose friction is bounded by the normal force of the step before."""

    approximation = "lagged"
