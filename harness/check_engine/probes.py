"""The probe of each capability: a scene that needs it, and little else, with its closed form."""

from __future__ import annotations

from ninedisk.core.law import LeverArm
from ninedisk.harness.api.capabilities import LEVER_ARMS, Capability
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.check_engine.claims import Probe
from ninedisk.harness.check_engine.contacts import driven, impact, passing, rolling, squeezed
from ninedisk.harness.check_engine.grains import ellipse_at_rest, lens_on_floor
from ninedisk.harness.check_engine.held import fixed, held
from ninedisk.harness.check_engine.scenes import damped, fall, rebound, sliding

SHALLOW = 1e-4
"""Overlap over radius at which all lever arms are the same to that part."""


def probe_of(capability: Capability, info: EngineInfo) -> Probe:
    """The probe of a capability, in the engine's own kind of contact where it may be springs or rigid."""
    arms: dict[Capability, LeverArm] = {held_by: name for name, held_by in LEVER_ARMS.items()}
    own: LeverArm = next((arm for held_by, arm in arms.items() if held_by in info.capabilities), "radius")
    if capability in arms:
        return rolling(arms[capability])
    return {
        Capability.LINEAR_CONTACT: lambda: impact(),
        Capability.SHEAR_SPRING: lambda: rolling(own, sunk=SHALLOW),
        Capability.FRICTION: lambda: sliding(info, rotating=False),
        Capability.CONTACT_DAMPING: lambda: impact(beta=0.2),
        Capability.RESTITUTION: lambda: rebound(info),
        Capability.GLOBAL_DAMPING_CENTRAL: lambda: damped(info, "central"),
        Capability.GLOBAL_DAMPING_LAGGED: lambda: damped(info, "lagged"),
        Capability.MOVING_WALLS: lambda: driven(info, "moving"),
        Capability.ROTATING_WALLS: lambda: driven(info, "turning"),
        Capability.CURVED_WALL_MOTION: lambda: driven(info, "curved"),
        Capability.GRAVITY: lambda: fall(info),
        Capability.BLOCKED_ROTATION: lambda: sliding(info, rotating=False),
        Capability.HELD_MOTION: lambda: held(info),
        Capability.FIXED_DISKS: lambda: fixed(info),
        Capability.QUASI_STATIC: lambda: squeezed(info),
        Capability.PRELOAD: lambda: rolling(own, sunk=SHALLOW, speed=0.0, force=-1.0),
        Capability.DISK_INERTIA: lambda: sliding(info, rotating=True),
        Capability.SLIP_MIDDLE: lambda: passing(info, "middle"),
        Capability.SLIP_END: lambda: passing(info, "end"),
        Capability.OUTLINES: lambda: ellipse_at_rest(info),
        Capability.AREA_CONTACT: lambda: lens_on_floor(),
    }[capability]()
