"""Contact step, law rows and scalars of the scheme for a scene and its numerics."""

from __future__ import annotations

import numpy as np

from ninedisk.core.dem.critical import critical_time_step, packed_time_step
from ninedisk.core.dem.state import DiskArrays, Kick, StepConstants, WallArrays
from ninedisk.core.errors import BehindWallError, NonFiniteStateError, UnstableTimeStepError
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Scene

SAFETY = 0.1
"""Fraction of the critical step that ``contact_dt = None`` stands for, unless contacts that form later ask for less."""

FIRST_SKIN, LEAST_SKIN, MOST_SKIN = 0.05, 0.02, 0.4
"""Skin of the first lists and limits of later ones as fractions of the mean radius."""


def contact_step(scene: Scene, numerics: Numerics) -> tuple[float, float]:
    """Contact step that a run will use and the critical step of the scene [s].

    Raises
    ------
    UnstableTimeStepError
        If ``numerics.contact_dt`` exceeds the critical step and ``numerics.allow_unstable`` is False.
    """
    critical = critical_time_step(scene, damping_form=numerics.damping_form)
    if numerics.contact_dt is None:
        wanted = min(SAFETY * critical, packed_time_step(scene, damping_form=numerics.damping_form))
        return numerics.dt / max(1, int(np.ceil(numerics.dt / wanted))), critical
    if numerics.contact_dt > critical and not numerics.allow_unstable:
        raise UnstableTimeStepError(
            f"contact_dt = {numerics.contact_dt:g} s exceeds the critical step {critical:g} s of the explicit scheme on "
            f"this scene: use at most {SAFETY * critical:g} s (a tenth of it) for accurate results, or set "
            f"allow_unstable=True to run all the same"
        )
    return numerics.contact_dt, critical


def law_row(law: ContactLaw) -> list[float]:
    """Law as the kernels read it (columns of `ninedisk.core.dem.state`)."""
    torque, slip = law.lever_arm != "radius", law.lever_arm == "overlap"
    wall_mid, middle = law.wall_velocity_at == "mid-overlap", law.slip_at == "middle"
    return [law.kn, law.ks, law.mu, law.beta, float(torque), float(slip), float(wall_mid), float(middle)]


def step_constants(scene: Scene, numerics: Numerics, dt: float, in_order: bool) -> StepConstants:
    """Scalars of the scheme for contact step ``dt`` [s]; ``in_order``: disks are kept in the order of the cells."""
    a = 0.5 * scene.xi * dt
    central = numerics.damping_form == "central"
    shared = {"dt": dt, "gravity_x": scene.gravity[0], "gravity_y": scene.gravity[1]}
    radius = float(scene.disks.radius.mean())
    return StepConstants(
        # Half the kick is still missing at t_n, or all of it after the half kick.
        first=Kick(keep=1.0 - a, gain=0.5 * dt, ahead=1.0, **shared),
        kick=Kick(
            keep=(1.0 - a) / (1.0 + a) if central else 1.0 - 2.0 * a,
            gain=dt / (1.0 + a) if central else dt,
            ahead=0.5,
            **shared,
        ),
        radius=radius,
        first_skin=FIRST_SKIN * radius,
        least_skin=LEAST_SKIN * radius,
        most_skin=MOST_SKIN * radius,
        lagged=not central,
        sorted=in_order,
    )


def behind_wall(scene: Scene, walls: WallArrays, step: int, contact_dt: float, critical: float) -> BehindWallError:
    """The error of the disk that `WallArrays.behind` holds at contact step ``step``; steps in s."""
    disk, wall, height = walls.behind[np.argmax(walls.behind[:, 0] > 0.0)].tolist()
    when = f"contact step {step} (t = {step * contact_dt:g} s)"
    name = f"contact_dt = {contact_dt:g} s (critical step of the initial state: {critical:g} s)"
    return scene.behind_wall(int(disk) - 1, int(wall), height, when, name)


def not_finite(disks: DiskArrays, step: int, contact_dt: float, critical: float) -> NonFiniteStateError:
    """The error of a position that stopped being finite by contact step ``step``; steps in s."""
    bad = np.sort(disks.name[~np.isfinite(disks.x).all(axis=1)])
    some = "a disk" if len(bad) == 0 else f"disk {bad[0]}" if len(bad) == 1 else f"disks {bad[0]} and {bad[1]}"
    named = some if len(bad) <= 2 else f"{some} and {len(bad) - 2} more"
    return NonFiniteStateError(
        f"the position of {named} is no finite number at contact step {step} (t = {step * contact_dt:g} s): two centres coincided "
        f"at the step before, so that their contact had no normal, or contact_dt = {contact_dt:g} s is unstable here; reduce "
        f"contact_dt (critical step of the initial state: {critical:g} s)"
    )
