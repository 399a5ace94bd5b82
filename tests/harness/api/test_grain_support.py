"""Who has grains: the DEM and contact dynamics do, the law of the common area is the DEM's alone; every other engine refuses by name."""

from __future__ import annotations

from dataclasses import replace

import pytest

from ninedisk.core import ContactLaw, Disks, InvalidSceneError, Numerics, Scene, simulate
from ninedisk.core.nurbs.mass import uniform_grain
from ninedisk.core.nurbs.shapes import ellipse
from ninedisk.harness.api.capabilities import GRAINS, Capability, capabilities_needed
from ninedisk.harness.api.engine import SupportLevel
from ninedisk.harness.api.registry import BUILTIN_ENGINES, get_engine

GRAIN = uniform_grain(ellipse(1.0, 0.6), 1.0)
PAIR = Scene(
    disks=Disks(
        x=[(0.0, 0.0), (3.0, 0.0)], radius=GRAIN.radius, mass=GRAIN.mass, inertia=GRAIN.inertia, outline=[0, -1]
    ),
    disk_disk=ContactLaw(kn=1e3),
    outlines=(GRAIN.outline,),
)
ROUND = PAIR.replace(disks=replace(PAIR.disks, outline=[-1, -1]))
HOW = Numerics(dt=1e-3, n_steps=1)


def test_what_scenes_of_grains_need() -> None:
    assert capabilities_needed(PAIR, HOW) & GRAINS == {Capability.OUTLINES}
    area = ROUND.replace(disk_disk=ContactLaw(kn=1e3, contact="area"))
    assert capabilities_needed(area, HOW) & GRAINS == {Capability.AREA_CONTACT}
    assert not capabilities_needed(ROUND, HOW) & GRAINS


@pytest.mark.parametrize("engine_id", BUILTIN_ENGINES)
def test_engines(engine_id: str) -> None:
    engine = get_engine(engine_id)
    area = ROUND.replace(disk_disk=ContactLaw(kn=1e3, contact="area", regularised=True, restitution=0.0))
    for scene, asked in ((PAIR, Capability.OUTLINES), (area, Capability.AREA_CONTACT)):
        support = engine.supports(scene, HOW)
        if engine_id == "dem" or (engine_id == "cd" and asked == Capability.OUTLINES):
            assert support.level is not SupportLevel.NO
            assert asked in engine.info().capabilities
        else:
            assert support.level is SupportLevel.NO
            assert asked in support.missing
            assert asked not in engine.info().capabilities


def test_contact_dynamics_names_the_remedy() -> None:
    with pytest.raises(InvalidSceneError, match=r"contact = 'area'.*'chord'"):
        simulate(ROUND.replace(disk_disk=ContactLaw(kn=1e3, contact="area")), HOW, method="cd")
