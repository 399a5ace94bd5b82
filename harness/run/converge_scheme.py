"""What a scheme declares about its order, which step it has, and what round-off makes of a scene's quantities."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.case import Case, Setup
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.engines.spring import laws_in_use

STEP_PARAMETERS = ("dt", "increment")
"""Parameters of cases that are the step of engines without an own one."""

FIRST_ORDER = ("theta", "moreau-jean", "semi-implicit-euler", "position-first-euler")

RELATIVE = {"float64": 1e-10, "float32": 1e-5}
"""Share of a quantity's natural size below which it is round-off: the round-off of some hundred steps, 1e-14, and a solver's
residual; in single precision a hundred units in the last place."""

ROUNDINGS = 64.0
"""Roundings of a coordinate that add up in a force: each body is moved by a sum of thousands, which add like their root."""


def expected_order(case: Case, params: Mapping[str, Any], setup: Setup, engine: EngineInfo) -> tuple[float | None, str]:
    """Order in the step that the engine's scheme has on this scene, and why; None where the engine declares none.

    A case whose contacts never slip, although its laws have friction, says so by a method ``slips(params)``; one whose contacts neither
    open nor close nor begin or cease to slide, by a method ``sticks(params)``.
    """
    scheme = engine.scheme
    if scheme == "runge-kutta-3":
        return None, "runge-kutta-3 in substeps of the engine's own: the step dt is none of the scheme's"
    if scheme == "central-difference":
        if setup.scene.xi > 0.0 and setup.numerics.damping_form == "lagged":
            return 1.0, "central differences; global damping sees the velocity of half a step before"
        if any(law.beta > 0.0 for law in laws_in_use(setup.scene)):
            return 1.0, "central differences; a dashpot's force jumps at touch, anywhere within a step"
        slips = getattr(case, "slips", None)
        rough = [law for law in laws_in_use(setup.scene) if law.ks > 0.0 and law.mu > 0.0]
        if rough and (slips is None or slips(params)):
            late = Capability.SLIP_MIDDLE not in engine.capabilities
            if late or any(law.slip_at == "end" for law in rough):
                return (
                    1.0,
                    "central differences; slip is that of the half step, turned to the contact at the step's end",
                )
            if getattr(case, "sticks", lambda _: False)(params):
                return 2.0, "central differences, slip of the middle of the step; contacts stick, and stay closed"
            return 1.0, "central differences; contacts open, close, stick and slip anywhere within a step"
        return 2.0, "central differences" + ("; by symmetry no contact slips" if rough else "")
    if scheme in FIRST_ORDER:
        return 1.0, f"{scheme}: contacts act for whole steps"
    return None, f"a scheme of the engine's own: {scheme}"


def step_name(case: Case, setup: Setup, engine: EngineInfo) -> str:
    """The step that this engine takes: ``"contact_dt"``, or the case's own parameter.

    Contact dynamics has an own step where all contacts are elastic (`ninedisk.core.cd.session.CdSession`).

    Raises
    ------
    UsageError
        If the engine steps by ``dt`` and the case has no such parameter.
    """
    elastic = not any(law.regularised for law in laws_in_use(setup.scene))
    if engine.contact == "spring" or (engine.contact == "cd" and elastic):
        return "contact_dt"
    known = {parameter.name for parameter in case.parameters}
    found = next((name for name in STEP_PARAMETERS if name in known), None)
    if found is None:
        raise UsageError(
            f"the case {case.id!r} has no step that could be halved for {engine.id!r}: none of its parameters is "
            f"{' or '.join(STEP_PARAMETERS)}; use an engine with contact springs"
        )
    return found


def round_off(setup: Setup, engine: EngineInfo, history: History, contact_dt: float) -> Callable[[str, float], float]:
    """Function of a quantity's unit and largest value: the size below which it is round-off.

    A coordinate of size L is known to one unit in the last place, u; a contact spring makes ``kn u`` of it, and of that a
    velocity ``omega u``. Rigid contacts find velocities, not positions.
    """
    share = RELATIVE.get(engine.precision, RELATIVE["float32"])
    disks = setup.scene.disks
    length = float(np.nanmax(np.abs(history.x), initial=0.0)) + float(disks.radius.max())
    unit = float(np.spacing(length if engine.precision == "float64" else np.float32(length)))
    stiff = max((law.kn for law in laws_in_use(setup.scene)), default=0.0) if engine.contact == "spring" else 0.0
    omega = min(math.sqrt(2.0 * stiff / float(disks.mass.min())), 2.0 / contact_dt)
    speed = float(np.nanmax(np.abs(history.v), initial=0.0))
    of_length, of_speed = share * length, share * speed + ROUNDINGS * unit * omega
    mass = float(disks.mass.sum())
    absolute = {
        "m": of_length,
        "m/s": of_speed,
        "rad/s": of_speed / float(disks.radius.min()),
        "N": ROUNDINGS * unit * stiff,
        "kg m/s": mass * of_speed,
        "J": mass * speed * of_speed,
        "s": share * float(history.t[-1]),
    }
    tiny = float(np.finfo(np.float64).tiny)
    return lambda name, largest: max(absolute.get(name, share), share * largest, tiny)
