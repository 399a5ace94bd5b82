"""SAPIEN: the rigid bodies of PhysX 5 on the CPU, single precision, a separate process.

With the solver PGS a step detects contacts at its begin, solves for velocities and moves positions with them: ``semi-implicit-euler``.
`ninedisk.harness.engines.sapien.session` says how a scene is realised.
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
from ninedisk.harness.engines.package import RigidPackageEngine, package_facts, prescribed_spins
from ninedisk.harness.engines.sapien.channels import MOST_PAIRS, pairs_of_classes
from ninedisk.harness.engines.world import partly_held

UNABLE = {Capability.ROTATING_WALLS}
"""The solver PGS takes no spin from a kinematic body: what turns rubs as if it moved along."""

CAPABILITIES = (OF_RIGID - UNABLE) | {
    Capability.DISK_INERTIA,
    Capability.MATERIALS,
    Capability.BODY_FORCES,
    Capability.SPHERES,
    Capability.BOXES,
}
CAPABILITIES_3D = (OF_RIGID_SPHERES - UNABLE) | {Capability.MATERIALS, Capability.BOXES}

RIGID_BODIES = "https://nvidia-omniverse.github.io/PhysX/physx/5.3.1/docs/RigidBodyDynamics.html"
"""Bodies are rigid and contacts solved for velocities; compliant contacts are another feature, which SAPIEN leaves out."""

OPTIONS = {
    "profile": PROFILE,
    "solver": Option(
        default="pgs",
        stock="tgs",
        choices=("pgs", "tgs"),
        why="with tgs restitution depends on where in the step an impact falls: e = 1 becomes 0.997 with 10 position iterations",
    ),
    "position_iterations": Option(
        default=100,
        stock=10,
        low=1,
        high=255,
        whole=True,
        why="sweeps; the first step misses the weights of three stacked disks by 8e-4 with 50, by 5e-5 with 100 and with 255, the most",
    ),
    "velocity_iterations": Option(
        default=255,
        stock=1,
        high=255,
        whole=True,
        why="sweeps after those; a box in box/stop at 70 degrees is off by 2e-4 m/s after 50 of them, by 1e-6 after 255, the most",
    ),
}

KNOBS = {
    "position_iterations": Knob(
        default=10, low=1, high=255, whole=True, ladder=(30, 100), dear=True, why="sweeps over overlaps and velocities"
    ),
    "velocity_iterations": Knob(
        default=1, high=255, whole=True, ladder=(10, 50), dear=True, why="sweeps over velocities after those"
    ),
    "solver": Knob(default="tgs", choices=("pgs", "tgs"), ladder=("pgs",), why="temporal or projected Gauss-Seidel"),
    "bounce_threshold": Knob(default=2.0, high=1e9, ladder=(0.2, 0.0), why="slower impacts are plastic [m/s]"),
    "contact_offset": Knob(
        default=0.01,
        low=1e-7,
        high=1e3,
        ladder=(1e-3, 1e-4),
        why="gap of each body from which on contacts are made [m]",
    ),
}
"""Settings under the profile stock."""

FACTS = package_facts(
    "sapien",
    id="sapien",
    name="SAPIEN (PhysX)",
    scheme="semi-implicit-euler",
    contact="impulse",
    sweeps="position_iterations",
    differences={
        Difference.FRICTION_PYRAMID: "PGS has axes along and across the velocity of the centres",
        Difference.FRICTION_AT_TWO_CORNERS: "PhysX's friction patch of a face has two anchors",
        Difference.IMPULSES_OF_OTHERS: "PGS reports the impulse at a floor as that at a wall",
        Difference.BOXES_ROCK: "the boxes of a tower, each turned against the other, lift corners by 0.001 of their size",
    },
    options=OPTIONS,
    out_of_scope=dict.fromkeys((Capability.LINEAR_CONTACT, Capability.SHEAR_SPRING), RIGID_BODIES),
    licence="MIT, BSD-3-Clause (PhysX)",
    precision="float32",
    contact_forces="normal",
    capabilities=CAPABILITIES,
)


class SapienEngine(RigidPackageEngine):
    """Adapter of SAPIEN."""

    id = "sapien"
    session = "ninedisk.harness.engines.sapien.session:SapienSession"
    capabilities_3d = CAPABILITIES_3D
    distribution = "sapien"
    knobs = KNOBS
    facts = FACTS

    def refusals(self, scene: Any, numerics: Numerics) -> Sequence[str]:  # noqa: ARG002
        """Bodies held in part, prescribed spins of bodies that are free otherwise, and more pairs of materials than a mask has bits."""
        found = partly_held(scene, "PhysX") if isinstance(scene, SphereScene) else []
        found += prescribed_spins(scene, "PhysX")
        pairs = len(pairs_of_classes(scene))
        if pairs > MOST_PAIRS:
            found.append(
                f"collision groups distinguish {MOST_PAIRS} pairs of materials and walls, the scene has {pairs}"
            )
        return found


ENGINE = SapienEngine()
