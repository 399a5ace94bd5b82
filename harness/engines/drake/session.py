"""Scenes in Drake: `DrakeSession` integrates in continuous time, `SapSession` and `LaggedSession` step in time."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np

from ninedisk.core.history import History, Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.options import read_options
from ninedisk.core.scene import Scene, SphereScene
from ninedisk.harness.api.knobs import given_knobs, recorded_knobs
from ninedisk.harness.api.wall_path import moving_until
from ninedisk.harness.engines.drake.adapter import DISCRETE_OPTIONS, KNOBS, OPTIONS, shares_in_series
from ninedisk.harness.engines.drake.world import ENGINE_VERSION, DrakeWorld, Surfaces
from ninedisk.harness.engines.lengths import touch_length
from ninedisk.harness.engines.world import finite_state, poses_of, write_contacts

__all__ = ["ENGINE_VERSION", "DrakeSession", "LaggedSession", "SapSession"]


class DrakeSession:
    """Continuous plant, third-order Runge-Kutta in fixed steps; contacts are linear springs without friction.

    Walls are bodies of `IMMOVABLE` mass that are given their exact position and velocity at the begin of each step; steps
    end where a wall's motion changes.
    """

    FORCE_MEANING = "instantaneous"

    def __init__(self, scene: Scene, numerics: Numerics, pairs: tuple[Pair, ...]) -> None:  # noqa: ARG002
        from pydrake.systems.analysis import ResetIntegratorFromFlags

        options = read_options("drake", OPTIONS, numerics)
        self.scene, self.dt, self.done = scene, numerics.dt, 0
        contact_dt = numerics.contact_dt or self.dt
        finer = max(1, math.ceil(fastest(scene) * contact_dt / options["drake.phase"]))
        self.substeps = numerics.substeps(contact_dt) * finer
        no_friction = (0.0, [0.0] * len(scene.walls))
        self.poses = poses_of(scene)
        self.world = DrakeWorld(
            scene,
            time_step=0.0,
            surfaces=Surfaces(stiffness=stiffness_shares(scene), friction=no_friction),
            driven=True,
            blocked=False,
        )
        step = self.dt / self.substeps
        integrator = ResetIntegratorFromFlags(self.world.simulator, "runge_kutta3", step)
        integrator.set_fixed_step_mode(True)
        self.breaks, self.rest_from = _breaks(scene), moving_until(scene)
        self._drive_walls(0.0, step)
        self.world.simulator.Initialize()
        self.settings: dict[str, Any] = {
            **options,
            "drake.integrator": "runge_kutta3, fixed steps",
            "drake.step [s]": step,
            "drake.contact_model": "point, stiffness in series",
            "drake.dissipation": 0.0,
            "drake.friction": 0.0,
        }

    def warm_up(self) -> None:
        """Compile the walls' motion where there is any; Drake itself is native code."""
        self.poses(0.0)

    def advance(self, n_steps: int) -> None:
        """Integrate; steps end at the ends of the walls' segments, too."""
        for _ in range(n_steps):
            times = [(self.done + k / self.substeps) * self.dt for k in range(self.substeps + 1)]
            times[-1] = (self.done + 1) * self.dt
            tiny = 1e-9 * self.dt
            between = [b for b in self.breaks if times[0] + tiny < b < times[-1] - tiny]
            times = sorted({*times, *between})
            for begin, end in pairwise(times):
                self._drive_walls(begin, end)
                self.world.simulator.AdvanceTo(end)
            self.done += 1

    def observe(self, history: History, row: int) -> None:
        """Copy the state, and the contact forces at this very time."""
        copy_state(self.world, history, row, self.done)
        pose = self.poses(self.done * self.dt)
        forces = self.world.forces(history.x[row]).impulses  # as impulses of one second
        write_contacts(self.scene, history, row, pose, forces, 1.0)

    def _drive_walls(self, begin: float, end: float) -> None:
        """Exact positions at ``begin``, and the velocities of the coming step; once more when the last motion has ended."""
        if begin > self.rest_from + self.dt:
            return
        here, there = self.poses(begin)[0], self.poses(end)[0]
        for k in range(len(self.scene.walls)):
            self.world.drive(k, here[k], (there[k] - here[k]) / (end - begin))


MATERIAL = {"stiffness": "point_stiffness", "dissipation": "dissipation"}
"""Drake's own names of the knobs that are properties of a surface."""


class SapSession:
    """Discrete plant; walls rest."""

    approximation = "sap"

    def __init__(self, scene: Any, numerics: Numerics, pairs: tuple[Pair, ...]) -> None:  # noqa: ARG002
        engine = f"drake-{self.approximation}"
        options = read_options(engine, DISCRETE_OPTIONS[engine], numerics)
        self.scene, self.dt, self.done = scene, numerics.dt, 0
        between = None if len(scene.bodies) < 2 else 0.5 * scene.law_of_bodies.mu
        friction = shares_in_series(between, [0.5 * wall.law.mu for wall in scene.walls])
        stock = options[f"{engine}.profile"] == "stock"
        given = given_knobs(engine, KNOBS[engine], numerics) if stock else {}
        options |= {f"{engine}.{name}": value for name, value in given.items() if f"{engine}.{name}" in options}
        touch = 0.0 if stock else touch_length(scene, numerics, "Drake")
        self.poses, self.angle = poses_of(scene), np.zeros_like(scene.bodies.omega)
        self.centres = np.array(scene.bodies.x)
        self.world = DrakeWorld(
            scene,
            time_step=self.dt,
            surfaces=Surfaces(
                stiffness=None if stock else stiffness_shares(scene),
                friction=friction,
                dissipation=options.get(f"{engine}.dissipation", 0.0),
                relaxation_time=given.get("relaxation_time") if stock else options.get(f"{engine}.relaxation_time"),
                changed={MATERIAL[name]: value for name, value in given.items() if name in MATERIAL},
            ),
            approximation=self.approximation,
            stiction_tolerance=options.get(f"{engine}.stiction_tolerance"),
            near_rigid_threshold=options.get(f"{engine}.near_rigid_threshold"),
            inflate=touch,
        )
        self.world.simulator.Initialize()
        self.settings: dict[str, Any] = {
            **options,
            f"{engine}.contact_model": "point, stiffness and dissipation Drake's own"
            if stock
            else "point, stiffness in series",
            f"{engine}.touch": touch,
            f"{engine}.friction_of_a_pair": "harmonic mean",
            **({f"{engine}.{name}": "Drake's own" for name in ("dissipation", "relaxation_time")} if stock else {}),
            **recorded_knobs(engine, given),
        }

    def warm_up(self) -> None:
        """Nothing: Drake is native code."""

    def advance(self, n_steps: int) -> None:
        """Step the plant; sum the spins of spheres: Drake moves bodies with those of the step's end."""
        flat = self.scene.dimension == 2
        for remaining in range(1 if flat else n_steps, 0, -1):
            if remaining == 1:
                self.centres = self.world.state()[0]  # contacts are found at the begin of a step
            self.done += n_steps if flat else 1
            self.world.simulator.AdvanceTo(self.done * self.dt)
            if not flat:
                self.angle += self.dt * self.world.state()[3]

    def observe(self, history: History, row: int) -> None:
        """Copy the state, and the contact impulses of the last step as forces."""
        copy_state(self.world, history, row, self.done)
        if self.scene.dimension == 3:
            history.angle[row] = self.angle
            if history.quaternion is not None:
                history.quaternion[row] = self.world.quaternions()
        sums = self.world.forces(self.centres) if self.done else None
        impulses, moments = (sums.impulses, sums.moments) if sums else (None, None)
        # Forces, as impulses of one second.
        write_contacts(self.scene, history, row, self.poses(self.done * self.dt), impulses, 1.0, moments)


class LaggedSession(SapSession):
    """Discrete plant whose friction is bounded by the normal force of the step before."""

    approximation = "lagged"


def stiffness_shares(scene: Scene | SphereScene) -> tuple[float, list[float]]:
    """Stiffness of the disks' and of each wall's geometry [N/m], in series those of the pairs.

    A single disk without walls meets nothing, yet Drake wants its stiffness to be above 0.
    """
    between = None if len(scene.bodies) < 2 and scene.walls else scene.law_of_bodies.kn
    return shares_in_series(between, [wall.law.kn for wall in scene.walls])


def fastest(scene: Scene) -> float:
    """Highest angular frequency [rad/s] of two disks on the stiffest contact."""
    kn = max((law.kn for law in scene.laws_in_use), default=0.0)
    return math.sqrt(2.0 * kn / float(scene.disks.mass.min())) if len(scene.disks) else 0.0


def _breaks(scene: Scene) -> list[float]:
    """Times [s] at which a wall's segment ends, in order."""
    ends = {float(t) for wall in scene.walls for t in np.cumsum([segment.duration for segment in wall.motion])}
    return sorted(filter(math.isfinite, ends))


def copy_state(world: DrakeWorld, history: History, row: int, step: int) -> None:
    history.x[row], history.v[row], history.angle[row], history.omega[row] = world.state()
    finite_state("Drake", step, history.x[row], history.v[row], history.omega[row])
