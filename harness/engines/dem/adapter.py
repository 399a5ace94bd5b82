"""The in-house DEM, treated like any other engine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import ninedisk
from ninedisk.core.dem.plane.grains import needs_outlines
from ninedisk.core.history import Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.options import Option, read_options
from ninedisk.core.scene import Scene, SphereScene
from ninedisk.core.threads import MOST_THREADS
from ninedisk.harness.api.capabilities import ROLLING, Capability, capabilities_needed
from ninedisk.harness.api.engine import EngineInfo, EngineRun, Stopwatch, Support, SupportLevel, Timings, timings_of

if TYPE_CHECKING:
    from ninedisk.core.dem.session import DemSession
    from ninedisk.core.dem.space.session import SphereSession

OPTIONS: Mapping[str, Option] = {
    "threads": Option(
        default=1,
        low=1,
        high=MOST_THREADS,
        whole=True,
        why="threads of scenes of 2,000 disks and more; no result depends on them",
    ),
}

LACKS = frozenset(
    {
        Capability.RESTITUTION,
        Capability.QUASI_STATIC,
        Capability.ADHESION,
        Capability.BOXES,
    }
)

DISKS_ALONE = LACKS | {
    Capability.HERTZ_MINDLIN_2D,
    Capability.MATERIALS,
    Capability.COHESION,
    Capability.ENERGY_BUDGET,
    *ROLLING.values(),
}
"""What is lacking where contacts are those of outlines."""

LACKS_IN_CELL = LACKS | {Capability.ENERGY_BUDGET, Capability.SURFACE_JKR}
"""And in a periodic cell."""


class DemEngine:
    """`ninedisk.core.dem` and, in 3D, `ninedisk.core.dem.space`: central differences, contact springs."""

    id = "dem"

    def info(self) -> EngineInfo:
        """Facts about the engine."""
        return EngineInfo(
            id=self.id,
            name="ninedisk DEM",
            version=ninedisk.__version__,
            scheme="central-difference",
            contact="spring",
            licence="BSD-3-Clause",
            how_it_runs="in-process (Numba)",
            precision="float64",
            threads=1,
            install="part of ninedisk",
            capabilities=frozenset(Capability) - LACKS,
            second_order_dashpots=True,
            reference=True,
            options=OPTIONS,
        )

    def supports(self, scene: Scene | SphereScene, numerics: Numerics) -> Support:
        """Every motion with inertia is expressed; a rigid contact only through its regularising spring."""
        missing = capabilities_needed(scene, numerics) & _lacks(scene)
        if missing:
            return Support(SupportLevel.NO, tuple(sorted(missing)))
        if isinstance(scene, Scene) and any(law.hertz for law in scene.laws_in_use):
            from ninedisk.core.dem.disks_as_spheres import cannot_be_spheres

            if words := cannot_be_spheres(scene):
                return Support(SupportLevel.NO, (Capability.HERTZ_MINDLIN_2D,), (f"the DEM does not have {words}",))
        if any(law.regularised for law in scene.laws_in_use):
            return Support(
                SupportLevel.APPROXIMATE, notes=("rigid contacts are replaced by springs kn, ks and a dashpot",)
            )
        return Support(SupportLevel.EXACT)

    def run(self, scene: Scene | SphereScene, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:
        """Run the scene on `ninedisk.core.dem.session.DemSession` or `ninedisk.core.dem.space.session.SphereSession`."""
        from ninedisk.core.dem.arrays import FIRST_SKIN, LEAST_SKIN, MOST_SKIN

        setup, warm_up, stepping = Stopwatch(), Stopwatch(), Stopwatch()
        options = read_options(self.id, OPTIONS, numerics)
        plain = numerics.replace(
            options={name: numerics.options[name] for name in numerics.options.keys() - options.keys()}
        )
        with setup:
            session = _session(scene, plain, watch, options["dem.threads"])
        with warm_up:  # on a copy of the scene: the session's state stays as it is
            once = plain.replace(n_steps=1, sample_every=1, sample_until=None)
            _session(scene, once, watch, options["dem.threads"]).run()
        with stepping:
            history = session.run()
        settings = {
            "contact_dt [s]": session.contact_dt,
            "critical step of the initial state [s]": session.critical_dt,
            "damping_form": numerics.damping_form,
            "lever_arm": scene.law_of_bodies.lever_arm,
            "skin / mean radius": f"{LEAST_SKIN:g} to {MOST_SKIN:g}, adapted at each rebuild, first {FIRST_SKIN:g}",
        }
        return EngineRun(history=history, timings=timings_of(setup, warm_up, stepping), settings=settings | options)

    def save(
        self, scene: Scene | SphereScene, numerics: Numerics, watch: Sequence[Pair], steps: int, path: str
    ) -> None:
        """Run ``steps`` steps of a scene and write a checkpoint."""
        session = _session(scene, numerics, watch, 1)
        session.advance(steps)
        session.save(path)

    def resume(self, path: str) -> EngineRun:
        """Go on from a checkpoint to the last step; timings count nothing."""
        from ninedisk.core.archive import read_arrays
        from ninedisk.core.dem.session import DemSession
        from ninedisk.core.dem.space.session import SphereSession

        head = str(read_arrays(path, "checkpoint of a DEM run").get("head", ""))
        kind: type[DemSession | SphereSession] = SphereSession if '"dimension": 3' in head else DemSession
        return EngineRun(history=kind.load(path).run(), timings=Timings(setup=0.0, warm_up=0.0, advance=0.0))


def _lacks(scene: Scene | SphereScene) -> frozenset[Capability]:
    if isinstance(scene, Scene) and needs_outlines(scene):
        return DISKS_ALONE
    return LACKS if scene.cell is None else LACKS_IN_CELL


def _session(
    scene: Scene | SphereScene, numerics: Numerics, watch: Sequence[Pair], threads: int
) -> DemSession | SphereSession:
    if isinstance(scene, SphereScene):
        from ninedisk.core.dem.space.session import SphereSession

        return SphereSession(scene, numerics, watch, threads=threads)
    from ninedisk.core.dem.session import DemSession

    return DemSession(scene, numerics, watch, threads=threads)


ENGINE = DemEngine()
