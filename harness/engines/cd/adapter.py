"""The in-house contact dynamics, treated like any other engine."""

from __future__ import annotations

import pickle
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import ninedisk
from ninedisk.core.cd.laws import ignored_restitution, sticking_wrongly, wedging_corners
from ninedisk.core.cd.settings import OPTIONS
from ninedisk.core.cd.space.scope import refused_settings, spheres_overlap
from ninedisk.core.history import Pair
from ninedisk.core.law import ContactLaw
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene, SphereScene
from ninedisk.harness.api.capabilities import OF_RIGID_SPHERES, ROLLING, SPACE, Capability
from ninedisk.harness.api.engine import EngineInfo, EngineRun, Stopwatch, Support, SupportLevel, Timings, timings_of
from ninedisk.harness.api.support import (
    NOTE_SLIP_AT,
    OF_SLIP_AT,
    AnyScene,
    has_spring_preload,
    rigid_needs,
    without_spring_preload,
)

if TYPE_CHECKING:
    from ninedisk.core.cd.session import CdSession
    from ninedisk.core.cd.space.session import SpaceSession

IN_PLANE = (
    frozenset(Capability)
    - frozenset(ROLLING.values())
    - SPACE
    - {
        Capability.AREA_CONTACT,
        Capability.GLOBAL_DAMPING_LAGGED,
        Capability.HERTZ_MINDLIN_2D,
        Capability.LEVER_ARM_TORQUE,
        Capability.PERIODIC_CELL,
        Capability.SLIP_END,
    }
)
"""What contact dynamics has in 2D."""

IN_SPACE = OF_RIGID_SPHERES | {
    Capability.BOXES,
    Capability.MATERIALS,
    Capability.GLOBAL_DAMPING_CENTRAL_3D,
    Capability.BODY_FORCES_3D,
}
"""And in 3D, where all contacts are rigid."""

CAPABILITIES = IN_PLANE | IN_SPACE

NOTE_PRELOAD = "the preload of regularising springs is undone: rigid contacts find their forces anew in each step"
NOTE_DAMPING = "global damping acts on the displacement of the step, dx/dt"
NOTE_ELASTIC_REBOUND = "the restitution of elastic contacts is left out: spring, dashpot and scheme decide"
NOTE_OVERLAP = "spheres overlap at the start, which rigid contacts cannot"
NOTE_ELASTIC = "elastic contact forces are those of the end of the step: first order, dissipative at every theta"


def expressible_scene(scene: AnyScene, numerics: Numerics) -> AnyScene:
    """The scene without the preload of springs, and without restitutions that contact dynamics refuses: `supports` notes both."""

    def heeded(law: ContactLaw) -> ContactLaw:
        ignored = ignored_restitution(law, not law.regularised, numerics)
        return replace(law, restitution=None) if ignored else law

    scene = without_spring_preload(scene)
    if not any(ignored_restitution(law, not law.regularised, numerics) for law in scene.laws_in_use):
        return scene
    return scene.with_laws(heeded)  # type: ignore[return-value]


class CdEngine:
    """`ninedisk.core.cd`: implicit theta scheme; a step is one convex program, or Coulomb's law where ``Numerics.sliding`` asks for it."""

    id = "cd"

    def info(self) -> EngineInfo:
        """Facts about the engine."""
        return EngineInfo(
            id=self.id,
            name="ninedisk CD",
            version=ninedisk.__version__,
            scheme="theta",
            contact="cd",
            licence="BSD-3-Clause",
            how_it_runs="in-process (NumPy, Numba)",
            precision="float64",
            threads=1,
            install="part of ninedisk",
            capabilities=CAPABILITIES,
            options=OPTIONS,
        )

    def supports(self, scene: Scene | SphereScene, numerics: Numerics) -> Support:
        """EXACT but for the slip of a step's end, and APPROXIMATE where a restitution is ignored; in 3D rigid contacts alone."""
        notes: list[str] = []
        level = SupportLevel.EXACT
        if has_spring_preload(scene):
            notes.append(NOTE_PRELOAD)
        if scene.xi > 0.0 and numerics.regime == "dynamic":
            notes.append(NOTE_DAMPING)
        if any(not law.regularised for law in scene.laws_in_use) and numerics.regime == "dynamic":
            notes.append(NOTE_ELASTIC)
        if isinstance(scene, Scene):
            notes += wedging_corners(scene, numerics)
        missing = rigid_needs(scene, numerics) - (IN_PLANE if isinstance(scene, Scene) else IN_SPACE)
        if missing & OF_SLIP_AT and isinstance(scene, Scene):
            missing -= OF_SLIP_AT
            level = SupportLevel.EQUIVALENT
            notes.append(NOTE_SLIP_AT)
        stuck = [sticking_wrongly(law, not law.regularised, law.shear_stiffness)[0] for law in scene.laws_in_use]
        refused = [f"a law with {wrong}" for wrong in stuck if wrong]
        if isinstance(scene, SphereScene):
            refused += refused_settings(numerics)
            refused += [NOTE_OVERLAP] if spheres_overlap(without_spring_preload(scene).spheres) else []
        if missing or refused:
            return Support(SupportLevel.NO, tuple(sorted(missing)), (*notes, *refused))
        asked = [law for law in scene.laws_in_use if law.regularised and law.restitution is not None]
        ignored = [law for law in scene.laws_in_use if ignored_restitution(law, not law.regularised, numerics)]
        scheme = (1.0 - numerics.theta) / numerics.theta
        if numerics.impact == "theta" and any(abs(scheme - (law.restitution or 0.0)) > 1e-12 for law in asked):
            reported = ", ".join(f"{e:g}" for e in sorted({law.restitution or 0.0 for law in asked}))
            notes.append(f"restitution of the theta scheme: (1 - theta)/theta = {scheme:g}; the scene says {reported}")
        if ignored:
            level = SupportLevel.APPROXIMATE
            if not all(law.regularised for law in ignored):
                notes.append(NOTE_ELASTIC_REBOUND)
        return Support(level, (), tuple(notes))

    def run(self, scene: Scene | SphereScene, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:
        """Run the scene on `ninedisk.core.cd.session.CdSession` or `ninedisk.core.cd.space.session.SpaceSession`."""
        setup, warm_up, stepping = Stopwatch(), Stopwatch(), Stopwatch()
        with setup:
            session = _session(scene, numerics, watch)
        with warm_up:
            session.warm_up()
        with stepping:
            history = session.run()
        settings = {
            "dt [s]": session.dt,
            "theta": numerics.theta,
            "impact": numerics.impact,
            "sliding": numerics.sliding,
            "regime": numerics.regime,
            "solver": numerics.solver,
            **session.settings.options,
            "problems solved": ", ".join(f"{name} {count}" for name, count in sorted(session.solves.items())),
            "iterations": session.iterations,
            **_figures(session),
            **({"steps that missed the tolerance": session.loose} if session.loose else {}),
            "remarks": "; ".join(session.remarks),
        }
        return EngineRun(history=history, timings=timings_of(setup, warm_up, stepping), settings=settings)

    def save(
        self, scene: Scene | SphereScene, numerics: Numerics, watch: Sequence[Pair], steps: int, path: str
    ) -> None:
        """Run ``steps`` steps at least, to the next sample, and write the session."""

        class ReachedError(Exception):
            pass

        def stop(done: int, _: int) -> None:
            if done >= steps:
                raise ReachedError

        session = _session(scene, numerics, watch)
        module: Any = sys.modules[type(session).__module__]
        usual, module.PROGRESS_EVERY = module.PROGRESS_EVERY, -1.0  # reported at every sample, whatever the clock says
        try:
            with suppress(ReachedError):
                session.run(stop)
        finally:
            module.PROGRESS_EVERY = usual
        Path(path).write_bytes(pickle.dumps(session))

    def resume(self, path: str) -> EngineRun:
        """Go on from a session that `save` wrote, a file to be trusted, to the last step; timings count nothing."""
        session = pickle.loads(Path(path).read_bytes())
        return EngineRun(history=session.run(), timings=Timings(setup=0.0, warm_up=0.0, advance=0.0))


def _session(scene: Scene | SphereScene, numerics: Numerics, watch: Sequence[Pair]) -> CdSession | SpaceSession:
    if isinstance(scene, SphereScene):
        from ninedisk.core.cd.space.session import SpaceSession

        return SpaceSession(expressible_scene(scene, numerics), numerics, watch)
    from ninedisk.core.cd.session import CdSession

    return CdSession(expressible_scene(scene, numerics), numerics, watch)


def _figures(session: CdSession | SpaceSession) -> dict[str, float]:
    """Largest errors of all steps."""
    if isinstance(session.worst, float):
        return {"largest relative error": session.worst}
    return {"largest natural-map residual": session.worst[0], "largest relative duality gap": session.worst[1]}


ENGINE = CdEngine()
