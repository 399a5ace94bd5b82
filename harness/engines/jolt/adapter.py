"""Jolt (jolt-physics): rigid contacts, sequential impulses at velocity level, single precision, WebAssembly in Node.js.

One step detects contacts at its begin, solves for velocities, moves positions with them and takes overlaps out: ``semi-implicit-euler``.
``harness/engines/javascript/jolt.mjs`` says how a scene is realised.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ninedisk.core.numerics import Numerics
from ninedisk.core.options import PROFILE, Option
from ninedisk.core.scene import SphereScene
from ninedisk.harness.api.capabilities import OF_RIGID, OF_RIGID_SPHERES, Capability
from ninedisk.harness.api.engine import Difference
from ninedisk.harness.api.knobs import Knob
from ninedisk.harness.engines.javascript.adapter import NodeEngine, npm_facts
from ninedisk.harness.engines.javascript.session import NodeSession

OPTIONS = {
    "profile": PROFILE,
    "velocity_steps": Option(
        default=100, stock=10, low=2, high=255, whole=True, why="a hundred bring a stack of three disks to equilibrium"
    ),
    "position_steps": Option(
        default=10, stock=2, low=1, high=255, whole=True, why="each takes out a fifth of an overlap, without momentum"
    ),
}

KNOBS = {
    "velocity_steps": Knob(
        default=10,
        low=2,
        high=255,
        whole=True,
        ladder=(30, 100),
        dear=True,
        why="mNumVelocitySteps, sweeps of the solver",
    ),
    "position_steps": Knob(
        default=2, low=1, high=255, whole=True, ladder=(10,), dear=True, why="mNumPositionSteps, sweeps over overlaps"
    ),
    "damping": Knob(default=0.05, high=1.0, ladder=(0.0,), why="linear and angular damping of a body [1/s]"),
    "restitution_threshold": Knob(
        default=1.0, high=1e9, ladder=(0.0,), why="mMinVelocityForRestitution [m/s]: slower impacts are plastic"
    ),
    "penetration_slop": Knob(default=0.02, high=1e3, ladder=(1e-3, 1e-5), why="overlap that is left [m]"),
    "speculative_distance": Knob(
        default=0.02, high=1e3, ladder=(1e-3, 1e-5), why="gap from which on contacts are made [m]"
    ),
    "convex_radius": Knob(default=0.05, high=1e3, ladder=(0.005, 0.0), why="by which edges of boxes are rounded [m]"),
}
"""Settings under the profile stock."""


class JoltEngine(NodeEngine):
    """Adapter of Jolt."""

    id = "jolt"
    session = "ninedisk.harness.engines.jolt.adapter:JoltSession"
    distribution = "jolt-physics"
    knobs = KNOBS
    capabilities_3d = OF_RIGID_SPHERES | {Capability.BODY_FORCES_3D, Capability.BOXES}
    facts = npm_facts(
        "jolt-physics",
        id="jolt",
        name="Jolt",
        licence="MIT",
        precision="float32",
        contact_forces="none",
        sweeps="velocity_steps",
        options=OPTIONS,
        differences={
            Difference.ARM_LESS_OVERLAP: "Jolt's contact point is midway in the overlap that the step of an impact makes",
            Difference.BOX_FRICTION_ASKEW: "a box that is longer than wide leaves its straight path by up to 4 % of it",
        },
        capabilities=OF_RIGID
        | {
            Capability.DISK_INERTIA,
            Capability.BODY_FORCES,
            Capability.BODY_FORCES_3D,
            Capability.SPHERES,
            Capability.BOXES,
        },
    )

    def refusals(self, scene: Any, numerics: Numerics) -> Sequence[str]:
        """Also elastic planes that move: they would throw spheres aside by 4e-5 of their speed."""
        walls = scene.walls if isinstance(scene, SphereScene) else ()
        return [
            *super().refusals(scene, numerics),
            *(
                f"wall {wall.name!r} moves and is elastic: a plane that moves is the face of a box, whose normal Jolt iterates to 4e-5"
                for wall in walls
                if wall.motion and wall.law.restitution
            ),
        ]


ENGINE = JoltEngine()


class JoltSession(NodeSession):
    """The `Session` of one run."""

    adapter = ENGINE
    module = "jolt.mjs"
