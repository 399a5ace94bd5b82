"""pymunk (Chipmunk 2-D): rigid contacts, sequential impulses, in process.

One step of pymunk moves positions first, then detects contacts there, then solves for velocities; hence the scheme
``position-first-euler``: velocities of a uniformly accelerated motion are exact, positions lag behind by half a step's
gain of speed per step.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from ninedisk.core.history import Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.options import PROFILE, Option, read_options
from ninedisk.core.scene import Scene
from ninedisk.harness.api.capabilities import OF_RIGID, Capability
from ninedisk.harness.api.engine import (
    EngineError,
    EngineInfo,
    EngineNotInstalledError,
    EngineRun,
    Support,
    run_session,
)
from ninedisk.harness.api.knobs import Knob, given_knobs
from ninedisk.harness.api.support import rigid_support, without_spring_preload
from ninedisk.harness.engines.process import package_version

CAPABILITIES = OF_RIGID | {Capability.DISK_INERTIA, Capability.MATERIALS, Capability.BODY_FORCES}

OPTIONS = {
    "profile": PROFILE,
    "iterations": Option(
        default=100,
        stock=10,
        low=1,
        high=1e9,
        whole=True,
        why="a single contact needs one; 100 serve groups of a few dozen, where 10, pymunk's default, do not",
    ),
    "collision_bias": Option(
        default=0.0,
        stock=0.9**60,
        high=1.0,
        why="part of an overlap that is left after a second; 0 takes out in one step, by a pseudo-velocity that leaves no "
        "momentum behind, the overlap that an impact within a step causes",
    ),
}

KNOBS = {
    "iterations": Knob(
        default=10,
        low=1,
        high=1e9,
        whole=True,
        ladder=(30, 100),
        dear=True,
        why="sweeps of the solver over all contacts",
    ),
    "collision_slop": Knob(default=0.1, high=1e9, ladder=(1e-2, 1e-3, 1e-6), why="overlap that is left [m]"),
    "collision_bias": Knob(
        default=0.9**60, high=1.0, ladder=(1e-6, 0.0), why="part of an overlap that is left after a second"
    ),
    "collision_persistence": Knob(
        default=3, low=1, high=1e9, whole=True, ladder=(1,), why="steps for which an open contact is remembered"
    ),
}
"""Settings under the profile stock."""

RIGID_BODIES = "https://chipmunk-physics.net/release/ChipmunkLatest-Docs/"
"""Of Chipmunk, pymunk's library: states that bodies are rigid and that collisions are solved by impulses."""


class PymunkEngine:
    """Adapter of pymunk; `ninedisk.harness.engines.pymunk.session` says how a scene is realised."""

    id = "pymunk"
    distribution = "pymunk"
    knobs = KNOBS

    def info(self) -> EngineInfo:
        """Facts about the installed pymunk; does not import it."""
        version, because = package_version("pymunk")
        return EngineInfo(
            id=self.id,
            name="pymunk",
            version=version,
            scheme="position-first-euler",
            contact="impulse",
            sweeps="iterations",
            options=OPTIONS,
            out_of_scope=dict.fromkeys((Capability.LINEAR_CONTACT, Capability.SHEAR_SPRING), RIGID_BODIES),
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
        return rigid_support(scene, numerics, CAPABILITIES)

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
            from ninedisk.harness.engines.pymunk.session import PymunkSession
        except ImportError as error:
            raise EngineNotInstalledError(f"pymunk cannot be imported ({error}): pip install pymunk") from error
        try:
            given = given_knobs(self.id, KNOBS, numerics)
            make = partial(PymunkSession, options=read_options(self.id, OPTIONS, numerics), knobs=given)
            return run_session(make, without_spring_preload(scene), numerics, watch)
        except AssertionError as error:  # pymunk checks its arguments by assert
            raise EngineError(f"pymunk refused a value: {error}") from error


ENGINE = PymunkEngine()
