"""Probes of what belongs to a body, to a pair or to a wall: variants of cases in which no two of them are alike."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.case import Value
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.api.params import resolve
from ninedisk.harness.cases.adapter.probes import ClosedForm, Probe, has_springs
from ninedisk.harness.cases.contact.belt import CASE as BELT
from ninedisk.harness.cases.contact.cluster import CASE as CLUSTER
from ninedisk.harness.cases.contact.moving_wall import CASE as MOVING_WALL
from ninedisk.harness.cases.contact.orbit import CASE as ORBIT
from ninedisk.harness.cases.contact.reopening import CASE as REOPENING
from ninedisk.harness.cases.contact.unequal_spheres import CASE as SPHERES
from ninedisk.harness.cases.impact.binary import CASE as BINARY
from ninedisk.harness.cases.impact.two_disks import CASE as TWO_DISKS

HEAVY: Mapping[str, Value] = {"restitution": 0.5, "mass": 3e3, "mass_2": 5e3, "radius": 0.4, "radius_2": 0.7}
"""Of a head-on impact: masses far from 1."""


def from_case(case: Any, info: EngineInfo, title: str, mend: str, params: Mapping[str, Value]) -> Probe:
    """A variant of a case as a probe: its checks of this engine are the closed forms."""
    full = resolve(case, params).params
    setup = case.build(full)

    def closed_forms(history: History) -> list[ClosedForm]:
        observed = case.observe(full, setup, history)
        found = []
        for check in case.checks(full, setup, observed, info):
            unit, value = (observed.series if check.norm == "max" else observed.scalars)[check.quantity]
            expected: Any = check.expected
            size = np.abs(np.asarray(expected, dtype=np.float64))
            largest = max(float(size[np.isfinite(size)].max(initial=0.0)), check.scale)
            bound = max(check.atol + check.rtol * largest, check.known.size if check.known else 0.0)
            if check.norm == "max":
                expected = np.broadcast_to(expected, np.shape(value))
            found.append(
                ClosedForm(
                    quantity=check.quantity,
                    unit=unit,
                    value=value,
                    expected=expected,
                    bound=bound,
                    why=check.why,
                    mend=mend,
                )
            )
        return found

    return Probe(title=title, setup=setup, closed_forms=closed_forms)


def unequal_probes(info: EngineInfo) -> Iterator[tuple[str, Probe]]:
    """Name and probe of each, in the engine's own kind of contact."""

    def probe(name: str, case: Any, mend: str, **params: Value) -> tuple[str, Probe]:
        return name, from_case(case, info, name.partition(": ")[2], mend, params)

    mend = "each body has its own radius, mass and inertia; both get a torque of the same sign, their own arm times fs"
    yield probe("pairs: oblique impact", TWO_DISKS, mend, across=3.0, restitution=0.5)
    yield probe("pairs: oblique impact that sticks", TWO_DISKS, mend, across=-1.2, restitution=0.5, mass_2=100.0)
    yield probe("pairs: impact of heavy disks", BINARY, "the effective mass of a pair is m1 m2/(m1 + m2)", **HEAVY)
    mend = (
        "a wall has the pose and the velocity of the segment that holds the time, also after it has stopped or reversed"
    )
    yield probe("walls: belt", BELT, mend)
    if not has_springs(info):
        return
    mend = "every pair in touch has its contact, whatever their number, sizes and direction"
    yield probe("pairs: six around one", CLUSTER, mend, arrangement="six")
    yield probe("pairs: nine around one", CLUSTER, mend, arrangement="many")
    mend = "each wall has its own law; a disk may have any inertia, and may be kept from turning while others turn"
    yield probe(
        "walls: four laws", CLUSTER, mend, arrangement="box", blocked=Capability.BLOCKED_ROTATION in info.capabilities
    )
    yield probe(
        "walls: pushed", MOVING_WALL, "a dashpot sees the velocity of the disk relative to the wall's", beta=0.2
    )
    arm = "radius" if Capability.LEVER_ARM_RADIUS in info.capabilities else "overlap"
    mend = "a shear force turns with the contact, and is kept as long as it is closed; angles count from time 0, not modulo a turn"
    yield probe("pairs: three revolutions", ORBIT, mend, arm=arm)
    yield probe("pairs: reopening", REOPENING, "a contact that has opened begins without shear force")


OF_SPHERES: Mapping[str, tuple[Mapping[str, Value], str]] = {
    "impacts of springs": (
        {"kind": "impacts"},
        "each contact has the law of its own pair or plane, its reduced mass and radius, its two arms and spins",
    ),
    "elastic impacts": (
        {"kind": "impacts", "heavy": 100.0},
        "Hertz' force goes with the reduced radius of both bodies",
    ),
    "impacts that slide": (
        {"kind": "impacts", "law": "linear"},
        "each body has its own mass, radius and moment of inertia; impulses on both bodies are equal and opposite",
    ),
    "flight": (
        {"kind": "flight"},
        "weights go with the body's own mass; angles are integrals of its own spin, whatever their size",
    ),
    "belt": (
        {"kind": "belt"},
        "each plane has its own normal, law and motion, segment by segment, and rests after the last one",
    ),
    "held": ({"kind": "held"}, "each sphere has its own rotating and held; what is held keeps its first value"),
    "crowd": (
        {"kind": "crowd"},
        "a sphere has all its contacts: there is no largest number, and reach goes with both radii",
    ),
    "resisted": (
        {"kind": "resisted"},
        "torques of rolling and twisting act on both spheres, with their reduced radius",
    ),
    "resisted by springs": (
        {"kind": "resisted", "model": "elastic-plastic"},
        "torques of rolling and twisting act on both spheres, with their own moments of inertia",
    ),
}
"""Variants of `spheres/unequal` by the name of their check, and what is wrong with an adapter that misses them."""


def unequal_spheres(info: EngineInfo) -> Iterator[tuple[str, Probe]]:
    """Name and probe of each variant of `spheres/unequal`."""
    for name, (params, mend) in OF_SPHERES.items():
        yield f"unequal spheres: {name}", from_case(SPHERES, info, name, mend, params)
