"""MuJoCo: contacts soft by their own rules, forces from a convex problem, a separate process.

MuJoCo prescribes how a contact decelerates, per unit mass, and finds the forces that do it by minimising over friction
cones. Stiffness is no property of a contact: a contact at rest yields by ``(1 - d) g/omega^2`` where its impacts swing with
omega, d the impedance. No linear contact of a given kn has both; nor is there a shear spring.

The convex problem makes sliding contacts open, ``mu`` times as fast as the shear damper asks the slip to end. At MuJoCo's
usual impedance, 0.9 and above, a sliding block therefore leaves the plane and lands again and again. At a low impedance the
contact's compliance takes the opening up as a slightly smaller overlap, and sliding is Coulomb's; see
`ninedisk.harness.engines.mujoco.session`.
"""

from __future__ import annotations

from collections.abc import Sequence

from ninedisk.core.numerics import Numerics
from ninedisk.core.options import PROFILE, Option
from ninedisk.core.scene import Scene, SphereScene
from ninedisk.harness.api.boxes import has_boxes
from ninedisk.harness.api.capabilities import OF_RIGID_SPHERES, Capability
from ninedisk.harness.api.engine import Difference
from ninedisk.harness.api.knobs import Knob
from ninedisk.harness.engines.package import RigidPackageEngine, package_facts
from ninedisk.harness.engines.world import partly_held

CAPABILITIES = frozenset(
    {
        Capability.FRICTION,
        Capability.RESTITUTION,
        Capability.GRAVITY,
        Capability.BLOCKED_ROTATION,
        Capability.FIXED_DISKS,
        Capability.DISK_INERTIA,
        Capability.MATERIALS,
        Capability.BODY_FORCES,
        Capability.BODY_FORCES_3D,
        Capability.SPHERES,
        Capability.TWISTING_CONSTANT,
        Capability.BOXES,
    }
)
"""Walls of 2D do not move: a body whose pose is prescribed meets contacts as if it were at rest."""

CAPABILITIES_3D = OF_RIGID_SPHERES | {
    Capability.BODY_FORCES_3D,
    Capability.MATERIALS,
    Capability.ROLLING_CONSTANT,
    Capability.TWISTING_CONSTANT,
    Capability.BOXES,
}
"""Walls of 3D that move are boxes on joints, of an inertia beyond the reach of any force."""

SHARED_CONE = (
    "friction and resistances to rolling and twisting share one cone: a ball that rolls against a resistance slips by 5/7 (mu_r/mu)^2 "
    "of its rolling speed"
)

OWN_SOFTNESS = "https://mujoco.readthedocs.io/en/stable/computation/index.html"
"""States that contacts are soft by a stiffness and damping per unit mass, a property of the constraint solver."""

OPTIONS = {
    "profile": PROFILE,
    "substeps": Option(
        default=200,
        stock=1,
        low=1,
        high=1e6,
        whole=True,
        why="MuJoCo's own steps in one dt: an elastic contact of half a step then takes 100 of them, omega h = 0.03",
    ),
    "contact_time": Option(
        default=0.5,
        low=1e-6,
        high=1e6,
        why="duration of an elastic contact in steps dt: short beside what the scene's sampling can see",
    ),
    "impedance": Option(
        default=1e-3,
        low=1e-4,
        high=0.9999,
        why="MuJoCo's range; up to here sliding does not open contacts, see slip_damping",
    ),
    "slip_damping": Option(
        default=0.3,
        low=1e-6,
        high=1.0,
        why="part of the slip that the shear damper ends in one substep h of a contact that sticks; a sliding contact opens "
        "where mu d slip_damping slip/h exceeds (1 - d) fn/m: from 5.6 m/s on for h = 50 us, mu = 0.3, fn = m g",
    ),
    "slip_compliance": Option(
        default=1e-4,
        low=1e-12,
        high=1.0,
        why="1e-4, what MuJoCo's largest impedance leaves: creep is slip_compliance h/slip_damping times fs/m",
    ),
    "cone": Option(
        default="elliptic",
        stock="pyramidal",
        choices=("elliptic", "pyramidal"),
        why="the same friction in all directions; MuJoCo's own value, pyramidal, has edges and no slip_damping",
    ),
    "tolerance": Option(
        default=1e-14, stock=1e-8, high=1.0, why="relative improvement below which the solver ends: round-off"
    ),
    "iterations": Option(default=100, low=1, high=1e6, whole=True, why="Newton's method takes two or three"),
}

KNOBS = {
    "cone": Knob(
        default="pyramidal",
        choices=("pyramidal", "elliptic"),
        ladder=("elliptic",),
        why="shape of the friction cone",
    ),
    "impratio": Knob(
        default=1.0, low=1e-3, high=1e9, ladder=(10.0, 100.0, 1e4), why="impedance of friction over that of the normal"
    ),
    "solref_time": Knob(
        default=0.02,
        low=1e-6,
        high=1e3,
        ladder=(0.01, 0.004),
        why="time constant of contacts [s] (solref); MuJoCo takes two of its steps at least",
    ),
    "impedance": Knob(default=0.9, low=1e-4, high=0.9999, ladder=(0.99, 0.9999), why="smallest of solimp, and largest"),
    "noslip_iterations": Knob(
        default=0, high=1e6, whole=True, ladder=(10,), dear=True, why="sweeps of the solver that takes slip out"
    ),
}
"""Settings under the profile stock; a larger impedance than 0.95 is that of any overlap."""


MOST_PAIRS = 1_000_000
"""Of disks: 1,400 of them; a model of half as many pairs takes a gigabyte."""


FACTS = package_facts(
    "mujoco",
    id="mujoco",
    name="MuJoCo",
    scheme="semi-implicit-euler in substeps",
    contact="soft",
    softness=1.0 / OPTIONS["substeps"].default,
    softness_why="a contact takes its load up within one of MuJoCo's own steps in dt",
    differences={
        Difference.IMPACT_AS_SPRINGS: "an elastic contact takes contact_time, many of MuJoCo's own steps",
        Difference.RESISTANCES_SHARE_CONE: SHARED_CONE,
    },
    options=OPTIONS,
    out_of_scope=dict.fromkeys((Capability.LINEAR_CONTACT, Capability.SHEAR_SPRING), OWN_SOFTNESS),
    licence="Apache-2.0",
    capabilities=CAPABILITIES,
)


class MuJoCoEngine(RigidPackageEngine):
    """Adapter of MuJoCo."""

    id = "mujoco"
    session = "ninedisk.harness.engines.mujoco.session:MuJoCoSession"
    capabilities_3d = CAPABILITIES_3D
    distribution = "mujoco"
    facts = FACTS
    knobs = KNOBS

    def refusals(self, scene: Scene | SphereScene, numerics: Numerics) -> Sequence[str]:  # noqa: ARG002
        """More pairs than a model can hold: the friction that does not open contacts is a setting of explicit pairs alone."""
        pairs = len(scene.bodies) * (len(scene.bodies) - 1) // 2
        refused = partly_held(scene, "MuJoCo") if isinstance(scene, SphereScene) else []
        if has_boxes(scene) and any(law.restitution for law in scene.laws_in_use):
            refused.append(
                "at the low impedance of this adapter the restitution of a box would depend on where it is hit: boxes have none here"
            )
        if pairs <= MOST_PAIRS:
            return refused
        return (
            *refused,
            f"each two bodies need their own contact pair: {pairs:.2g} of them, at most {MOST_PAIRS:.2g} fit",
        )

    def approximations(self, scene: Scene | SphereScene, numerics: Numerics) -> Sequence[str]:  # noqa: ARG002
        """What soft contacts and the convex problem make of any scene with contacts."""
        laws = scene.laws_in_use if isinstance(scene, SphereScene) else ()
        resisted = any(law.rolling is not None or law.twisting is not None for law in laws)
        return (
            *((SHARED_CONE,) if resisted else ()),
            "contacts are soft in MuJoCo's own way: they last part of a step, and yield under load",
            "friction is that of a convex problem: settings are chosen so that sliding does not open the contact",
        )


ENGINE = MuJoCoEngine()
