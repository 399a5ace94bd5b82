"""Adapters of engines in JavaScript and WebAssembly: rigid contacts, each world in its own Node.js process."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import SphereScene
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.api.knobs import Knob
from ninedisk.harness.engines.javascript.node import HOW_TO_INSTALL, npm_version
from ninedisk.harness.engines.package import RigidPackageEngine, prescribed_spins
from ninedisk.harness.engines.world import driven_spheres, partly_held


class NodeEngine(RigidPackageEngine):
    """Adapter of an engine that is an npm package; a subclass gives `id`, `facts`, `session`, `distribution` (the package) and `knobs`."""

    knobs: Mapping[str, Knob]

    def installed(self) -> tuple[str | None, str]:
        """Version of the npm package."""
        return npm_version(self.distribution)

    def refusals(self, scene: Any, numerics: Numerics) -> Sequence[str]:  # noqa: ARG002
        """Bodies that are held in part, and blocked ones that spin."""
        name = self.facts.name
        if not isinstance(scene, SphereScene):
            return prescribed_spins(scene, name)
        spheres = scene.spheres
        spinning = np.flatnonzero(~spheres.rotating & spheres.omega.any(axis=1))
        driven = driven_spheres(scene)
        return [
            *partly_held(scene, name),
            *(
                f"sphere {i} spins at a prescribed rate: {name}'s blocked bodies have no rotation at all"
                for i in spinning
                if i not in driven
            ),
        ]


def npm_facts(package: str, **facts: Any) -> EngineInfo:
    """`EngineInfo` of an engine that is this npm package, where its keywords do not say otherwise."""
    how = f"separate process (npm package {package} in Node.js)"
    return EngineInfo(how_it_runs=how, install=HOW_TO_INSTALL, scheme="semi-implicit-euler", contact="impulse", **facts)
