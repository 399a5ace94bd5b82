"""Box2D: rigid contacts, sequential impulses at velocity level, single precision, a separate process.

One step detects contacts at its begin, solves for velocities and then moves positions with them: ``semi-implicit-euler``.
`ninedisk.harness.engines.box2d.session` says how a scene is realised.
"""

from __future__ import annotations

from ninedisk.core.options import PROFILE, Option
from ninedisk.harness.api.capabilities import OF_RIGID, Capability
from ninedisk.harness.api.knobs import Knob
from ninedisk.harness.engines.package import RigidPackageEngine, package_facts

CAPABILITIES = OF_RIGID | {Capability.DISK_INERTIA, Capability.MATERIALS, Capability.BODY_FORCES}

RIGID_BODIES = "https://box2d.org/documentation/"
"""States that bodies are rigid and that contacts prevent penetration by impulses."""

OPTIONS = {
    "profile": PROFILE,
    "velocity_iterations": Option(
        default=100,
        stock=6,
        low=1,
        high=1e9,
        whole=True,
        why="a single contact needs one; a hundred bring a stack of three disks to equilibrium within single precision",
    ),
    "position_iterations": Option(
        default=10,
        stock=2,
        high=1e9,
        whole=True,
        why="each takes out a fifth of an overlap beyond the slop, without momentum: ten leave a tenth of an impact's",
    ),
}

KNOBS = {
    "velocity_iterations": Knob(
        default=6, low=1, high=1e9, whole=True, ladder=(30, 100), dear=True, why="sweeps over the contacts' velocities"
    ),
    "position_iterations": Knob(
        default=2, high=1e9, whole=True, ladder=(10,), dear=True, why="sweeps over the contacts' overlaps"
    ),
    "length_unit": Knob(
        default=1.0,
        low=1e-9,
        high=1e9,
        ladder=(0.1, 1e-2, 1e-3),
        why="metres in Box2D's unit of length: its slop is 0.005 units, and impacts below 1 unit/s are plastic",
    ),
    "continuous": Knob(
        default="on", choices=("on", "off"), ladder=("off",), why="bodies are moved back to the time of an impact"
    ),
}
"""Settings under the profile stock."""


FACTS = package_facts(
    "Box2D",
    id="box2d",
    name="Box2D",
    scheme="semi-implicit-euler",
    contact="impulse",
    options=OPTIONS,
    out_of_scope=dict.fromkeys((Capability.LINEAR_CONTACT, Capability.SHEAR_SPRING), RIGID_BODIES),
    licence="zlib",
    precision="float32",
    capabilities=CAPABILITIES,
)


class Box2DEngine(RigidPackageEngine):
    """Adapter of Box2D."""

    id = "box2d"
    session = "ninedisk.harness.engines.box2d.session:Box2DSession"
    distribution = "Box2D"
    facts = FACTS
    knobs = KNOBS


ENGINE = Box2DEngine()
