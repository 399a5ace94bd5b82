"""The probe of each capability."""

from __future__ import annotations

from ninedisk.harness.api.capabilities import UNLOADING, Capability
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.adapter import space_loads
from ninedisk.harness.cases.adapter.probes import Probe, probe_in_plane
from ninedisk.harness.cases.adapter.space import (
    elastic_impact,
    lifted_sphere,
    reported_losses,
    resting_sphere,
    sliding_sphere,
    spinning_box,
    sticky_sphere,
    twisting_sphere,
)


def probe_in_space(capability: Capability, info: EngineInfo) -> Probe | None:
    """The probe of a capability in space; None where the plane has it."""
    if capability in UNLOADING.values():
        return lifted_sphere(next(name for name, held_by in UNLOADING.items() if held_by is capability))
    make = {
        Capability.SPHERES: lambda: resting_sphere(info),
        Capability.HERTZ_MINDLIN: lambda: elastic_impact(),
        Capability.TWISTING_CONSTANT: lambda: twisting_sphere(info, spring=False),
        Capability.TWISTING_SPRING: lambda: twisting_sphere(info, spring=True),
        Capability.SURFACE_DMT: lambda: sticky_sphere(info, "dmt"),
        Capability.SURFACE_JKR: lambda: sticky_sphere(info, "jkr"),
        Capability.GLOBAL_DAMPING_CENTRAL_3D: lambda: space_loads.damped(info, "central"),
        Capability.GLOBAL_DAMPING_LAGGED_3D: lambda: space_loads.damped(info, "lagged"),
        Capability.BODY_FORCES_3D: lambda: space_loads.pushed(info),
        Capability.PRELOAD_3D: lambda: space_loads.preloaded(info),
        Capability.COHESION_3D: lambda: space_loads.stuck_deep(info),
        Capability.BOXES: lambda: spinning_box(info),
        Capability.PERIODIC_CELL_3D: lambda: space_loads.across_the_edge(info),
        Capability.ROLLING_VISCOUS_3D: lambda: space_loads.slowed(info),
        **(
            {}
            if info.plane
            else {
                Capability.FRICTION: lambda: sliding_sphere(info),
                Capability.ENERGY_BUDGET: lambda: reported_losses(info),
            }
        ),
    }.get(capability)
    return None if make is None else make()


def probe_of(capability: Capability, info: EngineInfo) -> Probe:
    """The probe of a capability, in the plane where it has a meaning there and the engine runs it."""
    return probe_in_space(capability, info) or probe_in_plane(capability, info)
