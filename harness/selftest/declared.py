"""An honest engine with rigid contacts, in the place of a third-party one: contact dynamics by Newton's and Coulomb's laws.

With Newton's restitution, Coulomb's sliding rule and theta = 1 a step of contact dynamics is that of any impulse-based engine:
velocities first, positions with the new ones. What it is declared as decides which tolerances it is judged by, not what it
computes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ninedisk.core.history import Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.engine import EngineInfo, EngineRun, Support
from ninedisk.harness.api.support import NOTE_SOFT, rigid_support, without_spring_preload
from ninedisk.harness.engines.cd.adapter import CAPABILITIES, ENGINE

DECLARED = ("impulse", "soft")
"""Kinds of contact that it is declared as; soft without a softness, which allows as much as the largest that may be stated."""

RUNS = {"spheres": "dem", **dict.fromkeys(DECLARED, ENGINE.id)}
"""The engine that runs in the place of each."""


def as_rigid(scene: Scene, numerics: Numerics) -> tuple[Scene, Numerics]:
    """What contact dynamics is asked so that it does what an impulse-based engine does."""
    return without_spring_preload(scene), numerics.replace(impact="newton", theta=1.0, sliding="coulomb", solver="auto")


OF_SPRINGS = frozenset(
    {
        Capability.LINEAR_CONTACT,
        Capability.SHEAR_SPRING,
        Capability.GLOBAL_DAMPING_CENTRAL,
        Capability.QUASI_STATIC,
    }
)
"""What contact dynamics can do beside, and an impulse-based engine cannot."""


class Declared:
    """The honest engine under one of the declarations."""

    def __init__(self, contact: str) -> None:
        self.id = self.contact = contact

    def info(self) -> EngineInfo:
        """Facts as a third-party engine would state them."""
        return replace(
            ENGINE.info(),
            id=self.id,
            name=f"honest engine, {self.contact}",
            # Solvers of soft contacts have their own steps, which no exact step binds.
            scheme="semi-implicit-euler" if self.contact == "impulse" else "semi-implicit Euler, regularised",
            contact=self.contact,
            options={},
            capabilities=CAPABILITIES - OF_SPRINGS,
        )

    def supports(self, scene: Scene, numerics: Numerics) -> Support:
        """As an engine behind a command of this kind."""
        near = (NOTE_SOFT,) if self.contact == "soft" else ()
        return rigid_support(scene, numerics, CAPABILITIES - OF_SPRINGS, approximations=near)

    def run(self, scene: Scene, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:
        """Run contact dynamics."""
        return ENGINE.run(*as_rigid(scene, numerics), watch)
