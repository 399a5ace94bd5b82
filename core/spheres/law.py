"""Contact laws of spheres: linear, Hertz-Mindlin, and the pull of surfaces on the latter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import log, pi, sqrt
from typing import Any, Literal

from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.law import LEVER_ARMS, SLIP_AT, LeverArm, Rolling, SlipAt
from ninedisk.core.validate import at_least, flag, kind_of, one_of, within

Unloading = Literal["none", "force", "rescale"]
Surface = Literal["dmt", "jkr"]

UNLOADING: tuple[Unloading, ...] = ("none", "force", "rescale")
SURFACES: tuple[Surface, ...] = ("dmt", "jkr")


@dataclass(frozen=True, kw_only=True)
class Elastic:
    """Isotropic elastic material: Young's modulus ``E`` [Pa] > 0 and Poisson's ratio ``nu`` in [0, 0.5]."""

    E: float
    nu: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "E", at_least("E", self.E, 0.0, strict=True))
        object.__setattr__(self, "nu", within("nu", self.nu, 0.0, 0.5))


def moduli(one: Elastic, two: Elastic | None) -> tuple[float, float]:
    """``E*, G*`` [Pa] of a contact: ``1/E* = sum (1 - nu^2)/E`` and ``1/G* = sum 2 (2 - nu)(1 + nu)/E``; None: a rigid body."""
    both = (one,) if two is None else (one, two)
    normal = sum((1.0 - body.nu**2) / body.E for body in both)
    shear = sum(2.0 * (2.0 - body.nu) * (1.0 + body.nu) / body.E for body in both)
    return 1.0 / normal, 1.0 / shear


def damping_ratio(restitution: float) -> float:
    """Damping ratio ``beta = -ln e / sqrt(pi^2 + ln^2 e)`` whose contact rebounds with the coefficient ``e`` in (0, 1].

    Exact for both laws where the dashpot may pull at the end of the contact; for Hertz by Antypov & Elliott, EPL 94 (2011) 50004.
    """
    e = within("restitution", restitution, 0.0, 1.0, open_low=True)
    return -log(e) / sqrt(pi**2 + log(e) ** 2)


@dataclass(frozen=True, kw_only=True)
class SphereLaw:
    """Contact of two spheres, or of a sphere and a plane: normal force, incremental shear, Coulomb cap, dashpot, resistances.

    With the overlap ``delta``, ``1/R = 1/R_i + 1/R_j`` (at a plane R_i), ``1/m = 1/m_i + 1/m_j`` and the contact radius
    ``a = sqrt(R delta)``:

    - linear: ``fn = kn delta + c delta'``, ``c = 2 beta sqrt(m kn)``; shear stiffness ``ks``;
    - Hertz-Mindlin: ``fn = (4/3) E* a delta + c delta'``, ``c = 2 sqrt(5/6) beta sqrt(m S)`` with the tangent stiffness ``S = 2 E* a``
      (Tsuji, Tanaka & Ishida, Powder Technology 71 (1992) 239: ``alpha = sqrt(5) beta``); shear stiffness ``8 G* a``.

    The shear spring is turned with the contact, and cut off at ``mu`` times the repulsive part of fn. Dashpots may pull at the end of a
    contact. There is no dashpot along the surface.

    Parameters
    ----------
    kn, ks : float
        Stiffnesses [N/m] of the linear law, kn > 0; 0 for Hertz-Mindlin.
    e_star, g_star : float
        ``E*`` and ``G*`` [Pa] of Hertz-Mindlin (`moduli`), E* > 0; 0 for the linear law.
    mu : float
        Coulomb friction coefficient [-], >= 0.
    beta : float
        Damping ratio [-], >= 0 (`damping_ratio`).
    unloading : {"none", "force", "rescale"}
        Shear spring of Hertz-Mindlin while the contact radius changes, as LAMMPS names it: the spring keeps its displacement s and the
        force is ``8 G* a s`` ("none": mindlin), the same with s scaled by a over its former value where a falls ("rescale":
        mindlin_rescale), or the force itself is kept and grows by ``8 G* a ds`` ("force": mindlin/force).
    lever_arm, slip_at
        As in `ninedisk.core.law.ContactLaw`.
    rolling, twisting : Rolling or None
        Resistance to relative spin across the normal and about it: models "constant" and "elastic-plastic" of `ninedisk.core.law.Rolling`
        (torques as vectors; the moments of inertia of the dashpot are about the contact for rolling and about the centres for twisting).
    surface_energy : float
        Surface energy g of one face [J/m^2], >= 0, of Hertz-Mindlin.
    surface : {"dmt", "jkr"}
        Pull-off ``4 pi g R`` acting while spheres overlap (Derjaguin, Muller & Toporov), or Johnson, Kendall & Roberts' force, which holds
        until the neck breaks, ``3 pi g R`` at most.
        It begins at overlap 0, with 8/9 of that, and its contact radius is the ``a`` of the dashpot and of the shear stiffness.
    friction_pull : float
        Share of the pull-off that stands beside fn in the limit of friction, ``mu (fn + friction_pull F)``, and in those of the
        resistances, in [0, 2]. 1: where the surfaces pull each other most nothing rubs. 2: Thornton (1991) of JKR's law, LAMMPS of both.
    restitution : float or None
        Coefficient of restitution [-] in [0, 1] for engines that have an impact law; None: the scene prescribes none.
    regularised : bool
        True if the stiffness only regularises a contact that is meant to be rigid.

    Raises
    ------
    InvalidSceneError
        If a value is outside its range, or the two laws are mixed.
    """

    kn: float = 0.0
    ks: float = 0.0
    e_star: float = 0.0
    g_star: float = 0.0
    mu: float = 0.0
    beta: float = 0.0
    unloading: Unloading = "force"
    lever_arm: LeverArm = "radius"
    slip_at: SlipAt = "middle"
    rolling: Rolling | None = None
    twisting: Rolling | None = None
    surface_energy: float = 0.0
    surface: Surface = "dmt"
    friction_pull: float = 1.0
    restitution: float | None = None
    regularised: bool = False

    def __post_init__(self) -> None:
        for name in ("kn", "ks", "e_star", "g_star", "mu", "beta", "surface_energy"):
            object.__setattr__(self, name, at_least(name, getattr(self, name), 0.0))
        if (self.kn > 0.0) == (self.e_star > 0.0):
            raise InvalidSceneError(
                f"kn = {self.kn:g} with e_star = {self.e_star:g} is not allowed: give kn for the linear law, or e_star for Hertz-Mindlin"
            )
        for name in ("g_star", "surface_energy") if self.kn > 0.0 else ("ks",):
            if getattr(self, name) > 0.0:
                law, other = ("linear", "e_star") if self.kn > 0.0 else ("Hertz-Mindlin", "kn")
                raise InvalidSceneError(
                    f"{name} = {getattr(self, name):g} is not allowed in the {law} law: leave it out, or give {other}"
                )
        if self.restitution is not None:
            object.__setattr__(self, "restitution", within("restitution", self.restitution, 0.0, 1.0))
        for name in ("rolling", "twisting"):
            resistance = getattr(self, name)
            if resistance is not None and kind_of(name, resistance, Rolling).model == "viscous":
                raise InvalidSceneError(
                    f"{name} model 'viscous' is not allowed for spheres: use one of constant, elastic-plastic"
                )
        one_of("unloading", self.unloading, UNLOADING)
        one_of("lever_arm", self.lever_arm, LEVER_ARMS)
        one_of("slip_at", self.slip_at, SLIP_AT)
        one_of("surface", self.surface, SURFACES)
        object.__setattr__(self, "friction_pull", within("friction_pull", self.friction_pull, 0.0, 2.0))
        object.__setattr__(self, "regularised", flag("regularised", self.regularised))

    @property
    def sticks(self) -> bool:
        """Whether the law is that of Johnson, Kendall and Roberts."""
        return self.surface == "jkr" and self.surface_energy > 0.0

    @property
    def hertz(self) -> bool:
        """Whether the law is Hertz-Mindlin's, and not the linear one."""
        return self.e_star > 0.0

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON: what differs from the defaults."""
        plain = {
            name: value for name, value in vars(self).items() if value != type(self).__dataclass_fields__[name].default
        }
        for name in ("rolling", "twisting"):
            if name in plain:
                plain[name] = dict(vars(plain[name]))
        return plain

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> SphereLaw:
        """Inverse of `to_dict`."""
        both = {name: Rolling(**data[name]) for name in ("rolling", "twisting") if data.get(name) is not None}
        return cls(**{**data, **both})
