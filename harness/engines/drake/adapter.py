"""Drake: a continuous plant under Runge-Kutta steps, and two discrete plants, each in its own process.

- ``drake``: contacts are the scene's linear springs, integrated to convergence in time. Drake's friction is a regularised
  function of the slip velocity and has no shear spring; scenes whose contacts can slip are refused.
- ``drake-sap``: discrete plant, convex contact model. As in every convex model a sliding contact opens, so that a sliding
  block flies about ``mu v dt`` high.
- ``drake-lagged``: discrete plant, friction bounded by the normal force of the step before, which leaves no dilation.

`ninedisk.harness.engines.drake.session` says how a scene is realised.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ninedisk.core.numerics import Numerics
from ninedisk.core.options import PROFILE, Option
from ninedisk.core.scene import Scene, SphereScene
from ninedisk.harness.api.boxes import has_boxes
from ninedisk.harness.api.capabilities import Capability, capabilities_needed
from ninedisk.harness.api.engine import Difference, Support, SupportLevel
from ninedisk.harness.api.knobs import Knob
from ninedisk.harness.engines.package import PackageEngine, RigidPackageEngine, package_facts, prescribed_spins
from ninedisk.harness.engines.symmetry import OF_SLIP, no_contact_can_slip

SPRINGS = frozenset(
    {
        Capability.LINEAR_CONTACT,
        Capability.GLOBAL_DAMPING_CENTRAL,
        Capability.GLOBAL_DAMPING_LAGGED,
        Capability.MOVING_WALLS,
        Capability.GRAVITY,
        Capability.BLOCKED_ROTATION,
        Capability.DISK_INERTIA,
    }
)
"""Of the continuous plant. In the limit of small steps both forms of global damping are the same."""

RIGID = frozenset(
    {
        Capability.FRICTION,
        Capability.GRAVITY,
        Capability.BLOCKED_ROTATION,
        Capability.DISK_INERTIA,
        Capability.SPHERES,
        Capability.BOXES,
    }
)
"""Of the discrete plants: their walls rest, and all they know of impacts is dissipation.

Walls of 3D rest as well: in the solver's tolerance, part of all momenta together, those of a wall too heavy to be moved would hide the
spheres'."""

REGULARISED = "https://drake.mit.edu/doxygen_cxx/group__stribeck__approximation.html"
"""States that friction is a continuous function of the slip velocity."""

FRICTION_REGULARISATION = 1e-3
"""Drake's sigma: the slip of a discrete plant's contact is that part of what friction prevents in a step; no setting of it."""

OPTIONS = {
    "phase": Option(
        default=0.04,
        low=1e-4,
        high=0.5,
        why="omega times the step, omega of two disks on the stiffest contact: the third order then leaves 1e-5 of the "
        "forces after 200 cycles of the undamped compression",
    ),
}

DISCRETE_OPTIONS: Mapping[str, Mapping[str, Option]] = {
    "drake-sap": {
        "profile": PROFILE,
        "relaxation_time": Option(default=0.1, high=1e6, why="dissipation of a contact [s]; Drake's own value"),
        "near_rigid_threshold": Option(
            default=0.0,
            stock=1.0,
            high=1e6,
            why="the scene's stiffness; Drake's own value, 1, makes contacts softer than that where they respond within a "
            "step, here by a factor of 300",
        ),
    },
    "drake-lagged": {
        "profile": PROFILE,
        "stiction_tolerance": Option(
            default=1e-6,
            stock=1e-4,
            low=1e-12,
            high=1.0,
            why="slip velocity [m/s] of full friction; Drake's own, 1e-4, makes creep",
        ),
        "dissipation": Option(
            default=1e4,
            high=1e12,
            why="Hunt and Crossley's, in s/m: a plastic impact parts with 1/d, a ten-thousandth",
        ),
    },
}

STIFFNESS = Knob(
    default=1e6,
    low_open=True,
    high=1e15,
    ladder=(1e7, 1e8, 1e9),
    why="point_stiffness of each geometry [N/m]; two act in series",
)

KNOBS: Mapping[str, Mapping[str, Knob]] = {
    "drake-sap": {
        "near_rigid_threshold": Knob(
            default=1.0, high=1e6, ladder=(0.1, 0.0), why="contacts that respond within a step are made softer below it"
        ),
        "relaxation_time": Knob(default=0.1, high=1e6, ladder=(0.01, 0.0), why="dissipation of a contact [s]"),
        "stiffness": STIFFNESS,
    },
    "drake-lagged": {
        "stiction_tolerance": Knob(
            default=1e-4, low=1e-12, high=1.0, ladder=(1e-5, 1e-6, 1e-7), why="slip velocity [m/s] of full friction"
        ),
        "dissipation": Knob(default=50.0, high=1e12, ladder=(1e3, 1e4), why="Hunt and Crossley's [s/m]"),
        "stiffness": STIFFNESS,
    },
}
"""Settings under the profile stock."""


class DrakeEngine(PackageEngine):
    """Adapter of Drake's continuous plant."""

    id = "drake"
    session = "ninedisk.harness.engines.drake.session:DrakeSession"
    distribution = "drake"
    keeps_overlaps = True
    facts = package_facts(
        "drake",
        id="drake",
        name="Drake",
        scheme="runge-kutta-3",
        contact="spring",
        licence="BSD-3-Clause",
        capabilities=SPRINGS,
        options=OPTIONS,
        out_of_scope=dict.fromkeys((Capability.FRICTION, Capability.SHEAR_SPRING), REGULARISED),
    )

    def supports(self, scene: Scene, numerics: Numerics) -> Support:
        """Linear springs without dashpots, in scenes whose contacts do not slip."""
        need = set(capabilities_needed(scene, numerics))
        laws = scene.laws_in_use
        if any(law.beta > 0.0 for law in laws):
            need.add(Capability.CONTACT_DAMPING)
        if any(law.mu > 0.0 for law in laws):
            need |= {Capability.FRICTION, Capability.SHEAR_SPRING}
        notes = []
        if need & OF_SLIP and no_contact_can_slip(scene):
            need -= OF_SLIP
            notes.append("the disks' friction is left out: by symmetry no contact of this scene ever slips")
        missing = need - SPRINGS
        if missing:
            return Support(SupportLevel.NO, missing=tuple(sorted(missing)))
        if refused := stiffness_refusals(scene):
            return Support(SupportLevel.NO, notes=tuple(refused))
        if scene.xi > 0.0:
            notes.append("global damping of the continuous equations, neither central nor lagged")
        if any(law.regularised for law in laws):
            notes.append("rigid contacts are replaced by springs kn")
            return Support(SupportLevel.APPROXIMATE, notes=tuple(notes))
        return Support(SupportLevel.EQUIVALENT if notes else SupportLevel.EXACT, notes=tuple(notes))


MOST_SPHERES = 12
"""Spheres on one wall with which Drake's discrete plants still run; with 14 the process ends by SIGSEGV."""


class DrakeDiscreteEngine(RigidPackageEngine):
    """Adapter of Drake's discrete plants.

    Their contacts have the scene's stiffness and keep its overlaps; without them they would land first.
    """

    capabilities_3d = RIGID - {Capability.DISK_INERTIA}
    preload_note = "the shear forces of the preload are left out, its overlaps are kept: there is no shear spring"

    distribution = "drake"
    keeps_overlaps = True

    def __init__(
        self, engine_id: str, name: str, session: str, scheme: str, model: str, *, dilates: bool, friction_lags: bool
    ) -> None:
        self.id, self.model = engine_id, model
        self.knobs = KNOBS[engine_id]
        differences = {Difference.KEEPS_KN: "contacts have the scene's stiffness"}
        if friction_lags:
            differences[Difference.FRICTION_LAGS] = "Drake's lagged approximation"
        self.facts = package_facts(
            "drake",
            id=engine_id,
            name=name,
            scheme=scheme,
            contact="soft",
            licence="BSD-3-Clause",
            capabilities=RIGID,
            dilates=dilates,
            differences=differences,
            softness=FRICTION_REGULARISATION,
            softness_why="regularisation of friction: slip is sigma times what friction prevents in a step",
            options=DISCRETE_OPTIONS[engine_id],
            out_of_scope={Capability.SHEAR_SPRING: REGULARISED},
        )
        self.session = f"ninedisk.harness.engines.drake.session:{session}"

    def refusals(self, scene: Any, numerics: Numerics) -> Sequence[str]:  # noqa: ARG002
        """Coefficients that no two bodies' shares give, and spins that nothing may change."""
        between = None if len(scene.bodies) < 2 else 0.5 * scene.law_of_bodies.mu
        found = stiffness_refusals(scene) + prescribed_spins(scene, "Drake")
        if scene.dimension == 3 and len(scene.bodies) > MOST_SPHERES:
            found.append(f"Drake ends with a segmentation fault where more than {MOST_SPHERES} spheres rest on a plane")
        if has_boxes(scene) and len(scene.bodies) > 1:
            found.append(
                "Drake's point contact has one point between a box and another body: here boxes are alone, on walls that meet their corners"
            )
        if between is not None and any(0.5 * wall.law.mu >= 2.0 * between > 0.0 for wall in scene.walls):
            found.append(
                "Drake gives a pair the harmonic mean of its bodies' friction: that of a wall must be below twice the "
                f"{scene.noun}s' own, {scene.law_of_bodies.mu:g}"
            )
        if between == 0.0 and any(wall.law.mu > 0.0 for wall in scene.walls):
            found.append(
                "Drake gives a pair the harmonic mean of its bodies' friction: 0 for smooth "
                + f"{scene.noun}s on any wall"
            )
        return found

    def approximations(self, scene: Any, numerics: Numerics) -> Sequence[str]:  # noqa: ARG002
        """The contact model."""
        return [self.model]


def shares_in_series(between: float | None, with_walls: Sequence[float]) -> tuple[float, list[float]]:
    """Shares of a disk and of each wall whose values in series, ``ab/(a + b)``, are those of the pairs.

    Parameters
    ----------
    between : float or None
        Value of two disks; None: there is one disk only, and its share is free.
    with_walls : sequence of float
        Value of a disk with each wall, below the disk's share.
    """
    disk = 2.0 * (max(with_walls, default=0.0) if between is None else between)
    return disk, [wall * disk / (disk - wall) if wall else 0.0 for wall in with_walls]


def stiffness_refusals(scene: Scene | SphereScene) -> list[str]:
    """Reasons why stiffnesses in series cannot be those of the scene."""
    if len(scene.bodies) < 2:
        return []
    return [
        f"Drake's stiffnesses act in series: wall {wall.name!r} cannot have kn = {wall.law.kn:g} N/m where {scene.noun}s have "
        f"{scene.law_of_bodies.kn:g} among themselves, it must be below twice that"
        for wall in scene.walls
        if wall.law.kn >= 2.0 * scene.law_of_bodies.kn
    ]


ENGINES = (
    DrakeEngine(),
    DrakeDiscreteEngine(
        "drake-sap",
        "Drake SAP",
        "SapSession",
        "semi-implicit Euler, convex contact",
        "Drake's convex model: contacts are compliant and dissipate, a sliding contact opens by about mu v dt and lands again",
        dilates=True,
        friction_lags=False,
    ),
    DrakeDiscreteEngine(
        "drake-lagged",
        "Drake lagged",
        "LaggedSession",
        "semi-implicit Euler, regularised friction",
        "Drake's lagged model: contacts are compliant and dissipate, friction is a function of the slip velocity",
        dilates=False,
        friction_lags=True,
    ),
)
