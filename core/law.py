"""Contact laws of disks and spheres: linear or Hertz-Mindlin, with the resistances and the pull of surfaces."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from math import log, pi, sqrt
from typing import Any, Literal

from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.validate import at_least, flag, kind_of, one_of, real, short_repr, within

LeverArm = Literal["radius", "overlap", "torque-overlap"]
WallVelocityAt = Literal["surface", "mid-overlap"]
SlipAt = Literal["middle", "end"]
Contact = Literal["chord", "area"]
RollingModel = Literal["constant", "viscous", "elastic-plastic"]
Unloading = Literal["none", "force", "rescale"]
Surface = Literal["dmt", "jkr"]

LEVER_ARMS: tuple[LeverArm, ...] = ("radius", "overlap", "torque-overlap")
WALL_VELOCITY_AT: tuple[WallVelocityAt, ...] = ("surface", "mid-overlap")
SLIP_AT: tuple[SlipAt, ...] = ("middle", "end")
CONTACTS: tuple[Contact, ...] = ("chord", "area")
ROLLING_MODELS: tuple[RollingModel, ...] = ("constant", "viscous", "elastic-plastic")
UNLOADING: tuple[Unloading, ...] = ("none", "force", "rescale")
SURFACES: tuple[Surface, ...] = ("dmt", "jkr")


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

    Examples
    --------
    The torque of a contact with the reduced radius 0.5 m under 10 N is at most ``mu R fn``:

    >>> rolling = Rolling(model="constant", mu=0.1)
    >>> rolling.mu * 0.5 * 10.0
    0.5
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
class Elastic:
    """Isotropic elastic material.

    Parameters
    ----------
    E : float
        Young's modulus [Pa], > 0.
    nu : float
        Poisson's ratio [-], in [0, 0.5].

    Raises
    ------
    InvalidSceneError
        If a value is outside its range.

    Examples
    --------
    The shear modulus is ``E / (2 (1 + nu))``:

    >>> rubber = Elastic(E=3e6, nu=0.5)
    >>> rubber.E / (2.0 * (1.0 + rubber.nu))
    1000000.0
    """

    E: float
    nu: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "E", at_least("E", self.E, 0.0, strict=True))
        object.__setattr__(self, "nu", within("nu", self.nu, 0.0, 0.5))


def moduli(one: Elastic, two: Elastic | None) -> tuple[float, float]:
    """Return the moduli ``E*`` and ``G*`` [Pa] of a Hertz-Mindlin contact.

    ``1/E* = sum (1 - nu^2)/E`` and ``1/G* = sum 2 (2 - nu)(1 + nu)/E`` over the two bodies.

    Parameters
    ----------
    one : Elastic
        Material of the first body.
    two : Elastic or None
        Material of the second body; None: it is rigid.

    Returns
    -------
    tuple of float
        ``(E*, G*)`` [Pa].

    Examples
    --------
    Two bodies of one material with nu = 0 have ``E* = E/2`` and ``G* = E/8``:

    >>> glass = Elastic(E=8e10, nu=0.0)
    >>> [f"{modulus:g}" for modulus in moduli(glass, glass)]
    ['4e+10', '1e+10']
    """
    both = (one,) if two is None else (one, two)
    normal = sum((1.0 - body.nu**2) / body.E for body in both)
    shear = sum(2.0 * (2.0 - body.nu) * (1.0 + body.nu) / body.E for body in both)
    return 1.0 / normal, 1.0 / shear


def damping_ratio(restitution: float) -> float:
    """Return the damping ratio ``beta = -ln e / sqrt(pi^2 + ln^2 e)`` whose contact rebounds with the coefficient e.

    Exact for both laws where the dashpot may pull at the end of the contact; for Hertz by Antypov & Elliott, EPL 94 (2011) 50004.

    Parameters
    ----------
    restitution : float
        Coefficient of restitution e [-], in (0, 1].

    Returns
    -------
    float
        Damping ratio [-].

    Raises
    ------
    InvalidSceneError
        If the coefficient is outside its range.

    Examples
    --------
    ``ln e = -pi`` gives ``1/sqrt(2)``:

    >>> round(damping_ratio(np.exp(-np.pi)), 4)
    0.7071
    """
    e = within("restitution", restitution, 0.0, 1.0, open_low=True)
    return -log(e) / sqrt(pi**2 + log(e) ** 2)


@dataclass(frozen=True, kw_only=True)
class ContactLaw:
    """Contact of two bodies, or of a body and a wall: normal force, incremental shear, Coulomb cap, dashpot, resistances, impact law.

    With the overlap ``delta``, ``1/R = 1/R_i + 1/R_j`` (at a wall R_i), ``1/m = 1/m_i + 1/m_j`` and the contact radius
    ``a = sqrt(R delta)``:

    - linear: ``fn = kn delta + c delta'``, ``c = 2 beta sqrt(m kn)``; shear stiffness ``ks``;
    - Hertz-Mindlin: ``fn = (4/3) E* a delta + c delta'``, ``c = 2 sqrt(5/6) beta sqrt(m S)`` with the tangent stiffness
      ``S = 2 E* a`` (Tsuji, Tanaka & Ishida, Powder Technology 71 (1992) 239: ``alpha = sqrt(5) beta``); shear stiffness ``8 G* a``.
      In 2D disks are taken for spheres of the same radii whose centres stay in the plane, as other programs do.

    The shear spring is cut off at ``mu`` times the repulsive part of fn, and in 3D it is turned with the contact. There is no dashpot
    along the surface. In 2D linear dashpots do not pull (but see ``cohesion``); in 3D and with Hertz' law they may, at the end of a
    contact.

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
        Normal contact stiffness [N/m], > 0; 0 for Hertz-Mindlin.
    ks : float
        Shear contact stiffness [N/m], >= 0. Springs without it carry no friction: the DEM and elastic contacts of contact dynamics
        refuse ``mu > 0`` with ``ks = 0``.
    e_star, g_star : float
        ``E*`` and ``G*`` [Pa] of Hertz-Mindlin (`moduli`), E* > 0; 0 for the linear law.
    mu : float
        Coulomb friction coefficient [-], >= 0; 0 means a smooth contact.
    beta : float
        Contact damping ratio [-], >= 0 (`damping_ratio`).
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
        of the overlap (no effect on disk-disk contacts, nor on walls that do not rotate). 2D only; in 3D it is the surface.
    slip_at : {"middle", "end"}
        Where in a step its slip is measured: velocities are those of the middle of the step, and so are normal, overlap and the wall's
        pose ("middle"), or these are those of its end ("end": Cundall & Strack 1979, YADE, LAMMPS, LIGGGHTS, Kratos).

        With the distance r and the angle phi of the normal, "end" adds ``-(dt/2) r' phi' dt`` to fs/ks in each step: its error is
        of first order and its integral along a closed path is not 0, so that shear forces drift with every cycle ("ratchet"). With
        "middle" each step's slip is the midpoint rule of its integral, and a retraced path of disks leaves O(dt^3). Contact dynamics
        knows a step's displacement once it has solved it: "middle" then corrects the spring's state, and "end" leaves it as the step's
        program has it, with the tangent of its start; its outlines keep the arms of the start, and with them an error of first order.
    unloading : {"none", "force", "rescale"}
        Shear spring of Hertz-Mindlin while the contact radius changes, as LAMMPS names it: the spring keeps its displacement s and the
        force is ``8 G* a s`` ("none": mindlin), the same with s scaled by a over its former value where a falls ("rescale":
        mindlin_rescale), or the force itself is kept and grows by ``8 G* a ds`` ("force": mindlin/force).
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
        2D only.
    rolling : Rolling or None
        Rolling resistance; None: none. In 3D the torque is a vector across the normal.
    twisting : Rolling or None
        Resistance to relative spin about the normal, as ``rolling`` but not "viscous"; the moments of inertia of its dashpot are about the
        centres. 3D only.
    surface_energy : float
        Surface energy g of one face [J/m^2], >= 0, of Hertz-Mindlin. 3D only.
    surface : {"dmt", "jkr"}
        Pull-off ``4 pi g R`` acting while spheres overlap (Derjaguin, Muller & Toporov), or Johnson, Kendall & Roberts' force, which holds
        until the neck breaks, ``3 pi g R`` at most.
        It begins at overlap 0, with 8/9 of that, and its contact radius is the ``a`` of the dashpot and of the shear stiffness.
    friction_pull : float
        Share of the pull-off that is beside fn in the limit of friction, ``mu (fn + friction_pull F)``, and in those of the
        resistances, in [0, 2]. 1: where the surfaces pull each other most nothing rubs. 2: Thornton (1991) of JKR's law, LAMMPS of both.
    cohesion : float
        Linear cohesion [N/m], >= 0 and below ``kn``: overlapping bodies attract each other by ``cohesion`` times the overlap, so that
        ``fn = (kn - cohesion) overlap`` and the dashpot, which then may pull as well. Friction and rolling resistance see the repulsive
        part, ``fn + cohesion overlap``, where that is positive. Linear law only.
    adhesion : float
        Pull [N], >= 0, that a closed contact takes before it opens, ``fn >= -adhesion``, for rigid contacts; friction and rolling
        resistance see ``fn + adhesion``. 2D only.
    regularised : bool
        True if ``kn, ks, beta`` only regularise a contact that is meant to be rigid, so that an
        engine with rigid contacts and an impact law expresses the same physics.

    Raises
    ------
    InvalidSceneError
        If a value is outside its range, or the two laws are mixed.

    Examples
    --------
    A weight of 1 kN overlaps by 1 mm at rest; without friction there is no shear spring:

    >>> law = ContactLaw(kn=1e6, ks=5e5, mu=0.5, beta=damping_ratio(0.5))
    >>> 1e3 / law.kn, law.shear_stiffness
    (0.001, 500000.0)
    >>> ContactLaw(kn=1e6, ks=5e5).shear_stiffness
    0.0
    """

    kn: float = 0.0
    ks: float = 0.0
    e_star: float = 0.0
    g_star: float = 0.0
    mu: float = 0.0
    beta: float = 0.0
    restitution: float | None = None
    lever_arm: LeverArm = "radius"
    wall_velocity_at: WallVelocityAt = "surface"
    slip_at: SlipAt = "middle"
    unloading: Unloading = "force"
    contact: Contact = "chord"
    rolling: Rolling | None = None
    twisting: Rolling | None = None
    surface_energy: float = 0.0
    surface: Surface = "dmt"
    friction_pull: float = 1.0
    cohesion: float = 0.0
    adhesion: float = 0.0
    regularised: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "e_star", at_least("e_star", self.e_star, 0.0, strict=real(self.e_star) != 0.0))
        for name in ("g_star", "ks", "mu", "beta", "surface_energy", "cohesion", "adhesion"):
            object.__setattr__(self, name, at_least(name, getattr(self, name), 0.0))
        if real(self.kn) == 0.0 and not self.hertz:
            raise InvalidSceneError(
                f"kn = {short_repr(self.kn)} is not allowed: it must be a finite number > 0; give kn for the linear law, or e_star for "
                "Hertz-Mindlin"
            )
        object.__setattr__(self, "kn", at_least("kn", self.kn, 0.0, strict=not self.hertz))
        self._check_one_law()
        if self.restitution is not None:
            object.__setattr__(self, "restitution", within("restitution", self.restitution, 0.0, 1.0))
        for name in ("rolling", "twisting"):
            if getattr(self, name) is not None:
                kind_of(name, getattr(self, name), Rolling)
        one_of("lever_arm", self.lever_arm, LEVER_ARMS)
        one_of("wall_velocity_at", self.wall_velocity_at, WALL_VELOCITY_AT)
        one_of("slip_at", self.slip_at, SLIP_AT)
        one_of("unloading", self.unloading, UNLOADING)
        one_of("contact", self.contact, CONTACTS)
        one_of("surface", self.surface, SURFACES)
        object.__setattr__(self, "friction_pull", within("friction_pull", self.friction_pull, 0.0, 2.0))
        object.__setattr__(self, "regularised", flag("regularised", self.regularised))

    def _check_one_law(self) -> None:
        if self.hertz and self.kn > 0.0:
            raise InvalidSceneError(
                f"kn = {self.kn:g} with e_star = {self.e_star:g} is not allowed: give kn for the linear law, or e_star for Hertz-Mindlin"
            )
        for name in ("ks", "cohesion") if self.hertz else ("g_star", "surface_energy"):
            if getattr(self, name) > 0.0:
                law, other = ("Hertz-Mindlin", "kn") if self.hertz else ("linear", "e_star")
                raise InvalidSceneError(
                    f"{name} = {getattr(self, name):g} is not allowed in the {law} law: leave it out, or give {other}"
                )
        if self.cohesion >= self.kn and not self.hertz:
            raise InvalidSceneError(
                f"cohesion = {self.cohesion:g} is not allowed: it must be below kn = {self.kn:g}, beyond which bodies attract each other "
                "the more the deeper they overlap and collapse into each other; lower the cohesion or raise kn"
            )

    @property
    def hertz(self) -> bool:
        """Whether the law is Hertz-Mindlin's, and not the linear one."""
        return self.e_star > 0.0

    @property
    def sticks(self) -> bool:
        """Whether the law is that of Johnson, Kendall and Roberts."""
        return self.surface == "jkr" and self.surface_energy > 0.0

    @property
    def shear_stiffness(self) -> float:
        """``ks`` [N/m] of the linear law, or 0 where no friction lets the shear spring act."""
        return self.ks if self.mu > 0.0 else 0.0

    def check_dimension(self, name: str, dimension: int) -> None:
        """Refuse what the law has and a scene of this dimension lacks; ``name`` says which law of the scene it is.

        Raises
        ------
        InvalidSceneError
        """
        for each in ONLY_IN[5 - dimension]:
            value = getattr(self, each)
            if value != ContactLaw.__dataclass_fields__[each].default:
                shown = (
                    f"{value:g}" if isinstance(value, float) else value.model if isinstance(value, Rolling) else value
                )
                raise InvalidSceneError(
                    f"{name}: {each} = {shown} is not allowed in {dimension}D, which does not have it: leave it out"
                )
        if self.twisting is not None and self.twisting.model == "viscous":
            raise InvalidSceneError(
                f"{name}: twisting model 'viscous' is not allowed: use one of constant, elastic-plastic"
            )

    def to_dict(self, dimension: int = 2) -> dict[str, Any]:
        """Return plain data for JSON in a scene of this dimension: what differs from the defaults, and in 2D what `ALWAYS` names."""
        plain = {
            each.name: getattr(self, each.name)
            for each in fields(self)
            if getattr(self, each.name) != each.default or (dimension == 2 and each.name in ALWAYS)
        }
        for name in ("rolling", "twisting"):
            if name in plain:
                plain[name] = dict(vars(plain[name]))
        return plain

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> ContactLaw:
        """Build a law from `to_dict` data."""
        if "kn" not in data and "e_star" not in data:
            raise InvalidSceneError("a law lacks the key 'kn': give kn for the linear law, or e_star for Hertz-Mindlin")
        both = {name: Rolling(**data[name]) for name in ("rolling", "twisting") if data.get(name) is not None}
        return cls(**{**data, **both})


SphereLaw = ContactLaw
"""The name that a law in 3D had; both are one class."""

ONLY_IN: dict[int, tuple[str, ...]] = {
    2: ("wall_velocity_at", "contact", "adhesion"),
    3: ("twisting", "surface_energy", "surface", "friction_pull"),
}
"""What a law may have in scenes of one dimension only."""

ALWAYS = ("kn", "ks", "mu", "beta", "restitution", "lever_arm", "wall_velocity_at", "regularised")
"""Fields that a law's plain data hold in 2D whatever their value."""


def check_shear_springs(laws: Iterable[ContactLaw]) -> None:
    """Refuse friction of contact springs without a shear spring, which would carry none.

    Raises
    ------
    InvalidSceneError
    """
    for law in laws:
        if law.mu > 0.0 and law.ks == 0.0 and law.g_star == 0.0:
            if law.hertz:
                raise InvalidSceneError(
                    f"mu = {law.mu:g} with g_star = 0 is not allowed: friction acts through a shear spring, which the contact does not "
                    "have; give g_star > 0 (in proportion to e_star), or mu = 0"
                )
            raise InvalidSceneError(f"mu = {law.mu:g} with ks = 0 is not allowed: {NO_SHEAR_SPRING}")


NO_SHEAR_SPRING = "friction of a contact spring acts through its shear spring; give ks > 0 (kn/2 is usual), or mu = 0"
