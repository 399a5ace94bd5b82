"""Rapier 2D (npm): rigid contacts, sequential impulses at velocity level, single precision, WebAssembly in Node.js.

As `ninedisk.harness.engines.rapier3d`, in a plane.
"""

from __future__ import annotations

from ninedisk.harness.api.capabilities import OF_RIGID, Capability
from ninedisk.harness.engines.javascript.adapter import NodeEngine, npm_facts
from ninedisk.harness.engines.javascript.session import NodeSession
from ninedisk.harness.engines.rapier3d.adapter import OPTIONS


class Rapier2DEngine(NodeEngine):
    """Adapter of Rapier 2D."""

    id = "rapier2d"
    session = "ninedisk.harness.engines.rapier2d.adapter:Rapier2DSession"
    distribution = "@dimforge/rapier2d-compat"
    facts = npm_facts(
        "@dimforge/rapier2d-compat",
        id="rapier2d",
        name="Rapier 2D",
        licence="Apache-2.0",
        precision="float32",
        sweeps="sweeps",
        options=OPTIONS,
        capabilities=OF_RIGID | {Capability.DISK_INERTIA, Capability.BODY_FORCES},
    )


ENGINE = Rapier2DEngine()


class Rapier2DSession(NodeSession):
    """The `Session` of one run."""

    adapter = ENGINE
    module = "rapier2d.mjs"
    flat = True
