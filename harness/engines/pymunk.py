"""pymunk (Chipmunk 2-D): rigid contacts, sequential impulses, in process.

One step of pymunk moves positions first, then detects contacts there, then solves for velocities; hence the scheme
``position-first-euler``: velocities of a uniformly accelerated motion are exact, positions lag behind by half a step's
gain of speed per step.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError
from importlib.metadata import version as installed_version

from ninedisk.core.history import Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Scene
from ninedisk.harness.capabilities import Capability
from ninedisk.harness.engine import (
    EngineError,
    EngineInfo,
    EngineNotInstalledError,
    EngineRun,
    Support,
    SupportLevel,
    run_session,
)
from ninedisk.harness.engines._rigid import has_spring_preload, rigid_needs, without_spring_preload

CAPABILITIES = frozenset(
    {
        Capability.FRICTION,
        Capability.RESTITUTION,
        Capability.MOVING_WALLS,
        Capability.ROTATING_WALLS,
        Capability.CURVED_WALL_MOTION,
        Capability.GRAVITY,
        Capability.BLOCKED_ROTATION,
        Capability.DISK_INERTIA,
    }
)


class PymunkEngine:
    """Adapter of pymunk; `ninedisk.harness.engines._pymunk_session` says how a scene is realised."""

    id = "pymunk"

    def info(self) -> EngineInfo:
        """Facts about the installed pymunk; does not import it."""
        try:
            version, because = installed_version("pymunk"), ""
        except PackageNotFoundError:
            version, because = None, "the Python package pymunk is missing"
        return EngineInfo(
            id=self.id,
            name="pymunk",
            version=version,
            scheme="position-first-euler",
            contact="impulse",
            licence="MIT",
            how_it_runs="in process",
            precision="float64",
            threads=1,
            install="pip install pymunk",
            capabilities=CAPABILITIES,
            not_installed_because=because,
        )

    def supports(self, scene: Scene, numerics: Numerics) -> Support:
        """Rigid contacts only: a scene whose stiffness matters is refused."""
        missing = rigid_needs(scene, numerics) - CAPABILITIES
        if missing:
            return Support(SupportLevel.NO, missing=tuple(sorted(missing)))
        notes = []
        if has_spring_preload(scene):
            notes.append("rigid contacts: the preload of the regularising springs is left out, disks start touching")
        if any(law.restitution is None for law in _laws(scene)):
            notes.append("the scene prescribes no restitution: 0 is used")
        return Support(SupportLevel.EQUIVALENT if notes else SupportLevel.EXACT, notes=tuple(notes))

    def run(self, scene: Scene, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:
        """Run the scene; forces are the impulses of a step divided by its length.

        Raises
        ------
        EngineNotInstalledError
            If pymunk cannot be imported.
        EngineError
            If pymunk refuses a value, or the state stops being finite.
        InvalidNumericsError
            If ``numerics.options`` holds an unknown or impossible setting of this engine.
        """
        try:
            from ninedisk.harness.engines._pymunk_session import PymunkSession
        except ImportError as error:
            raise EngineNotInstalledError(f"pymunk cannot be imported ({error}): pip install pymunk") from error
        try:
            return run_session(PymunkSession, without_spring_preload(scene), numerics, watch)
        except AssertionError as error:  # pymunk checks its arguments by assert
            raise EngineError(f"pymunk refused a value: {error}") from error


def _laws(scene: Scene) -> list[ContactLaw]:
    laws = [wall.law for wall in scene.walls]
    return [*laws, scene.disk_disk] if len(scene.disks) > 1 else laws


ENGINE = PymunkEngine()
