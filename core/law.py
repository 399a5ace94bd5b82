"""Contact laws."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.validate import at_least, flag, kind_of, one_of, real, shown

LeverArm = Literal["radius", "overlap", "torque-overlap"]
WallVelocityAt = Literal["surface", "mid-overlap"]
SlipAt = Literal["middle", "end"]
Contact = Literal["chord", "area"]
RollingModel = Literal["constant", "viscous", "elastic-plastic"]

LEVER_ARMS: tuple[LeverArm, ...] = ("radius", "overlap", "torque-overlap")
WALL_VELOCITY_AT: tuple[WallVelocityAt, ...] = ("surface", "mid-overlap")
SLIP_AT: tuple[SlipAt, ...] = ("middle", "end")
CONTACTS: tuple[Contact, ...] = ("chord", "area")
ROLLING_MODELS: tuple[RollingModel, ...] = ("constant", "viscous", "elastic-plastic")


@dataclass(frozen=True, kw_only=True)
class Rolling:
    """Rolling resistance of a contact: models A, B and C of Ai, Chen, Rotter & Ooi, Powder Technology 206 (2011) 269-282.

    With ``omega = omega_i - omega_j`` [rad/s] and the reduced radius ``R = 1/(1/R_i + 1/R_j)`` (at a wall R_i), body i gets the torque
    ``-M`` and body j ``M``, ``fn`` being the repulsive part of the normal force [N]:

    - "constant" (A): ``M = mu R fn sign(omega)``, and 0 where omega is 0;
    - "viscous" (B): ``M = mu R fn |omega| R sign(omega) / (1 m/s)``;
    - "elastic-plastic" (C): a spring ``kr``, ``dM = kr omega dt``, cut off at ``mu R fn`` with its sign kept; below that a dashpot adds
      ``2 beta sqrt(I kr) omega`` with ``1/I = 1/(I_i + m_i R_i^2) + 1/(I_j + m_j R_j^2)``, the moments about the contact.

    Parameters
    ----------
    model : {"constant", "viscous", "elastic-plastic"}
    mu : float
        Coefficient of rolling friction [-], >= 0.
    kr : float
        Rolling stiffness [N m/rad] of "elastic-plastic", > 0 there and 0 elsewhere.
    beta : float
        Damping ratio [-] of "elastic-plastic", >= 0; 0 elsewhere.

    Raises
    ------
    InvalidSceneError
        If a value is outside its range.
    """

    model: RollingModel
    mu: float
    kr: float = 0.0
    beta: float = 0.0

    def __post_init__(self) -> None:
        one_of("rolling model", self.model, ROLLING_MODELS)
        sprung = self.model == "elastic-plastic"
        object.__setattr__(self, "mu", at_least("rolling mu", self.mu, 0.0))
        object.__setattr__(self, "kr", at_least("rolling kr", self.kr, 0.0, strict=sprung))
        object.__setattr__(self, "beta", at_least("rolling beta", self.beta, 0.0))
        for name in ("kr", "beta"):
            if not sprung and getattr(self, name) > 0.0:
                raise InvalidSceneError(
                    f"rolling {name} = {getattr(self, name):g} is not allowed: the model {self.model!r} has no spring; leave it out, or "
                    "use the model 'elastic-plastic'"
                )


@dataclass(frozen=True, kw_only=True)
class ContactLaw:
    """Linear contact: normal spring, incremental shear spring, Coulomb cap, dashpot, impact law.

    On disks the overlap is ``R_i + R_j - d``. On outlines a contact is a chord: between the two points where the outlines intersect,
    with the normal at right angles to it; the overlap is the extent of the common area along the normal, and normal forces act in
    the chord's middle M. That is the disk's overlap and normal where both outlines are circles.

    Where the lever arm is measured follows from the disk's in the same way: the point of application lies on the line through M along
    the normal, for "radius" where the extreme point of each body's own outline along the normal is (on a disk, R from the centre),
    for "overlap" in the middle between the two (on a disk, R - overlap/2), which is M where both curve alike. Shear forces act and slip
    is measured there; the arm of a normal force, the distance of M from the body's centre along the tangent, is 0 on a disk.

    Parameters
    ----------
    kn : float
        Normal contact stiffness [N/m], > 0.
    ks : float
        Shear contact stiffness [N/m], >= 0. Springs without it carry no friction: the DEM and elastic contacts of contact dynamics
        refuse ``mu > 0`` with ``ks = 0``.
    mu : float
        Coulomb friction coefficient [-], >= 0; 0 means a smooth contact.
    beta : float
        Contact damping ratio [-], >= 0; the dashpot is ``c = 2 beta sqrt(m_eff kn)``.
    restitution : float or None
        Coefficient of restitution [-] in [0, 1] for engines that have an impact law. None: the scene prescribes none. In the DEM
        spring and dashpot decide. In contact dynamics Newton's law (``impact = "newton"``) has it at rigid contacts; the theta scheme has
        ``(1 - theta)/theta`` there; any other value above 0 is refused, as is one at elastic contacts, and of 0 a remark says so.
    lever_arm : {"radius", "overlap", "torque-overlap"}
        Arm of the shear torque and of the slip by rotation (see above for outlines): R (Cundall & Strack 1979), R - overlap/2, or
        R - overlap/2 for the torque and R for the slip (LAMMPS ``pair_style granular``).

        "radius", the default, does not conserve angular momentum: the forces ``fs`` of a pair act at d from each other, and the arms add
        up to ``R_i + R_j = d + overlap``, so that each contact of two disks feeds ``dL/dt = overlap fs``: 3e-4 to 5e-3 of what a
        packing at overlaps of 1e-3 to 1e-2 radii exchanges. The other two have arms that add up to d, and conserve it.
        "torque-overlap" does other work with its torque than its slip does: `Numerics.energy_budget` has that as ``law_loss``.
    wall_velocity_at : {"surface", "mid-overlap"}
        Point at which a wall's velocity enters the slip: on the wall's surface or in the middle
        of the overlap (no effect on disk-disk contacts, nor on walls that do not rotate).
    slip_at : {"middle", "end"}
        Where in a step its slip is measured: velocities are those of the middle of the step, and so are normal, overlap and the wall's
        pose ("middle"), or these are those of its end ("end": Cundall & Strack 1979, YADE, LAMMPS, LIGGGHTS, Kratos).

        With the distance r and the angle phi of the normal, "end" adds ``-(dt/2) r' phi' dt`` to fs/ks in each step: its error is
        of first order and its integral along a closed path is not 0, so that shear forces drift with every cycle ("ratchet"). With
        "middle" each step's slip is the midpoint rule of its integral, and a retraced path of disks leaves O(dt^3). Contact dynamics
        knows a step's displacement once it has solved it: "middle" then corrects the spring's state, and "end" leaves it as the step's
        program has it, with the tangent of its start; its outlines keep the arms of the start, and with them an error of first order.
    contact : {"chord", "area"}
        Normal force of outlines: ``kn`` times the overlap ("chord"), which away from circles has no potential, or the gradient of an
        energy of the common area ("area"). Its derivation, with A the common area of a contact and c its chord:

        Moving body i by dx sweeps ``dA = dx . (integral of the outward normal along i's arc)``, and that integral is the chord turned
        clockwise, ``c n``. Turning it by da about its centre sweeps ``dA = da (integral of r x normal)``, which is
        ``-(|r_1|^2 - |r_0|^2)/2 = -c (r_M . t)`` with r from the centre to the chord's ends and its middle M. The gradient
        of an energy U(A) is therefore ``-U'(A) c n`` on body i, acting in M, and the opposite on body j: the chord's force with
        ``fn = U'(A) c``, so momentum and angular momentum are kept as well.

        Circles that overlap little have ``A = (4/3) sqrt(2 R_e) overlap^(3/2)`` with ``1/R_e = 1/R_i + 1/R_j``. The energy
        is ``U = (kn/2) (9 A^2/(32 R_e))^(2/3)``, which makes ``fn = kn overlap (1 + O(overlap/R))`` on them: kn is the normal stiffness
        of disks. R of an outline is the radius of the disk of the same area, and a wall has 1/R = 0.
    rolling : Rolling or None
        Rolling resistance; None: none.
    cohesion : float
        Linear cohesion [N/m], >= 0 and below ``kn``: overlapping bodies attract each other by ``cohesion`` times the overlap, so that
        ``fn = (kn - cohesion) overlap`` and the dashpot, which then may pull as well. Friction and rolling resistance see the repulsive
        part, ``fn + cohesion overlap``, where that is positive.
    adhesion : float
        Pull [N], >= 0, that a closed contact takes before it opens, ``fn >= -adhesion``, for rigid contacts; friction and rolling
        resistance see ``fn + adhesion``.
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
    slip_at: SlipAt = "middle"
    contact: Contact = "chord"
    rolling: Rolling | None = None
    cohesion: float = 0.0
    adhesion: float = 0.0
    regularised: bool = False

    def __post_init__(self) -> None:
        for name in ("kn", "ks", "mu", "beta", "cohesion", "adhesion"):
            object.__setattr__(self, name, at_least(name, getattr(self, name), 0.0, strict=name == "kn"))
        if self.restitution is not None:
            restitution = real(self.restitution)
            if not 0.0 <= restitution <= 1.0:
                raise InvalidSceneError(
                    f"restitution = {shown(self.restitution)} is not allowed: it must be a number in [0, 1], or None"
                )
            object.__setattr__(self, "restitution", restitution)
        if self.cohesion >= self.kn:
            raise InvalidSceneError(
                f"cohesion = {self.cohesion:g} is not allowed: it must be below kn = {self.kn:g}, beyond which bodies attract each other "
                "the more the deeper they overlap and collapse into each other; lower the cohesion or raise kn"
            )
        if self.rolling is not None:
            kind_of("rolling", self.rolling, Rolling)
        one_of("lever_arm", self.lever_arm, LEVER_ARMS)
        one_of("wall_velocity_at", self.wall_velocity_at, WALL_VELOCITY_AT)
        one_of("slip_at", self.slip_at, SLIP_AT)
        one_of("contact", self.contact, CONTACTS)
        object.__setattr__(self, "regularised", flag("regularised", self.regularised))

    @property
    def shear_stiffness(self) -> float:
        """``ks`` [N/m], or 0 where no friction lets the shear spring act."""
        return self.ks if self.mu > 0.0 else 0.0

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON; what most laws lack is left out where it is not there."""
        plain = {name: value for name, value in vars(self).items() if (name, value) not in ABSENT}
        if self.rolling is not None:
            plain["rolling"] = dict(vars(self.rolling))
        return plain

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> ContactLaw:
        """Inverse of `to_dict`."""
        rolling = data.get("rolling")
        return cls(**{**data, "rolling": None if rolling is None else Rolling(**rolling)})


def check_shear_springs(laws: Iterable[ContactLaw]) -> None:
    """Refuse friction of contact springs without a shear spring, which would carry none.

    Raises
    ------
    InvalidSceneError
    """
    for law in laws:
        if law.mu > 0.0 and law.ks == 0.0:
            raise InvalidSceneError(f"mu = {law.mu:g} with ks = 0 is not allowed: {NO_SHEAR_SPRING}")


NO_SHEAR_SPRING = "friction of a contact spring acts through its shear spring; give ks > 0 (kn/2 is usual), or mu = 0"


ABSENT = (("contact", "chord"), ("slip_at", "middle"), ("rolling", None), ("cohesion", 0.0), ("adhesion", 0.0))
"""Values that a law's plain data leave out, so that laws keep the form that they had before there were these fields."""
