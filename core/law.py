"""Contact laws."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ninedisk.core._validate import at_least, real
from ninedisk.core.errors import InvalidSceneError

LeverArm = Literal["radius", "overlap", "torque-overlap"]
WallVelocityAt = Literal["surface", "mid-overlap"]

LEVER_ARMS: tuple[LeverArm, ...] = ("radius", "overlap", "torque-overlap")
WALL_VELOCITY_AT: tuple[WallVelocityAt, ...] = ("surface", "mid-overlap")


@dataclass(frozen=True, kw_only=True)
class ContactLaw:
    """Linear contact: normal spring, incremental shear spring, Coulomb cap, dashpot, impact law.

    Parameters
    ----------
    kn : float
        Normal contact stiffness [N/m], > 0.
    ks : float
        Shear contact stiffness [N/m], >= 0.
    mu : float
        Coulomb friction coefficient [-], >= 0; 0 means a smooth contact.
    beta : float
        Contact damping ratio [-], >= 0; the dashpot is ``c = 2 beta sqrt(m_eff kn)``.
    restitution : float or None
        Coefficient of restitution [-] in [0, 1] for engines that have an impact law.
        None: the scene prescribes none.
    lever_arm : {"radius", "overlap", "torque-overlap"}
        Arm of the shear torque and of the slip by rotation: R (Cundall & Strack 1979), R - overlap/2, or R - overlap/2 for the
        torque and R for the slip (LAMMPS ``pair_style granular``).
    wall_velocity_at : {"surface", "mid-overlap"}
        Point at which a wall's velocity enters the slip: on the wall's surface or in the middle
        of the overlap (no effect on disk-disk contacts, nor on walls that do not rotate).
    regularised : bool
        True if ``kn, ks, beta`` only regularise a contact that is meant to be rigid, so that an
        engine with rigid contacts and an impact law expresses the same physics.

    Raises
    ------
    InvalidSceneError
        If a value is outside its range.
    """

    kn: float
    ks: float = 0.0
    mu: float = 0.0
    beta: float = 0.0
    restitution: float | None = None
    lever_arm: LeverArm = "radius"
    wall_velocity_at: WallVelocityAt = "surface"
    regularised: bool = False

    def __post_init__(self) -> None:
        for name in ("kn", "ks", "mu", "beta"):
            object.__setattr__(self, name, at_least(name, getattr(self, name), 0.0, strict=name == "kn"))
        if self.restitution is not None:
            restitution = real(self.restitution)
            if not 0.0 <= restitution <= 1.0:
                raise InvalidSceneError(
                    f"restitution = {self.restitution!r} is not allowed: it must be a number in [0, 1], or None"
                )
            object.__setattr__(self, "restitution", restitution)
        if self.lever_arm not in LEVER_ARMS:
            raise InvalidSceneError(f"lever_arm = {self.lever_arm!r} is unknown: use one of {', '.join(LEVER_ARMS)}")
        if self.wall_velocity_at not in WALL_VELOCITY_AT:
            raise InvalidSceneError(
                f"wall_velocity_at = {self.wall_velocity_at!r} is unknown: use one of {', '.join(WALL_VELOCITY_AT)}"
            )
        if not isinstance(self.regularised, bool):
            raise InvalidSceneError(f"regularised = {self.regularised!r} is not allowed: it must be true or false")
