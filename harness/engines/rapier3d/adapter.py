"""Rapier 3D (npm): rigid contacts, sequential impulses at velocity level, single precision, WebAssembly in Node.js.

A step is divided into substeps, each of which solves for velocities and then moves positions with them.
``harness/engines/javascript/rapier.mjs`` says how a scene is realised.
"""

from __future__ import annotations

from ninedisk.core.options import PROFILE, Option
from ninedisk.harness.api.capabilities import OF_RIGID, OF_RIGID_SPHERES, Capability
from ninedisk.harness.engines.javascript.adapter import NodeEngine, npm_facts
from ninedisk.harness.engines.javascript.session import NodeSession

OPTIONS = {
    "profile": PROFILE,
    "substeps": Option(
        default=1, stock=4, low=1, high=1e6, whole=True, why="one substep is a step of semi-implicit Euler's rule"
    ),
    "sweeps": Option(
        default=100, stock=1, low=1, high=1e6, whole=True, why="a hundred bring a stack of three disks to equilibrium"
    ),
}


class Rapier3DEngine(NodeEngine):
    """Adapter of Rapier 3D."""

    id = "rapier3d"
    session = "ninedisk.harness.engines.rapier3d.adapter:Rapier3DSession"
    distribution = "@dimforge/rapier3d-compat"
    capabilities_3d = OF_RIGID_SPHERES | {Capability.BOXES}
    facts = npm_facts(
        "@dimforge/rapier3d-compat",
        id="rapier3d",
        name="Rapier 3D",
        licence="Apache-2.0",
        precision="float32",
        contact_forces="normal",
        sweeps="sweeps",
        options=OPTIONS,
        capabilities=OF_RIGID
        | {Capability.DISK_INERTIA, Capability.BODY_FORCES, Capability.SPHERES, Capability.BOXES},
    )


ENGINE = Rapier3DEngine()


class Rapier3DSession(NodeSession):
    """The `Session` of one run."""

    adapter = ENGINE
    module = "rapier3d.mjs"
