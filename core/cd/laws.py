"""Contact laws as columns, one row a law; and corners where Newton's law can have no solution."""

from __future__ import annotations

from itertools import combinations
from math import acos, atan, degrees, pi

import numpy as np

from ninedisk.core.array_types import IntArray
from ninedisk.core.cd.contact_kernels import Laws
from ninedisk.core.cd.settings import ContactKind
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.law import NO_SHEAR_SPRING, ContactLaw
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import AnyScene, Scene

SAME_RESTITUTION = 1e-5
"""Difference of restitutions that are the same: theta given to six digits."""

ADVICE = "use impact = 'theta', with which a solution always exists, or a restitution of 0"


class LawTable:
    """Laws of a scene, in l rows: row 0 is that between bodies, row ``1 + w`` that of wall w, the others those of `Scene.laws`.

    Parameters
    ----------
    scene : Scene or SphereScene
    numerics : Numerics
    contacts : {"auto", "rigid", "elastic"}
        Which contacts are elastic; auto: those whose law is not ``regularised``.

    Attributes
    ----------
    kn, ks : ndarray, shape (l,)
        Stiffness [N/m]: with cohesion that of spring and attraction together, ``kn - cohesion``.
    mu : ndarray, shape (l,)
        Friction coefficient; with cohesion
        ``mu kn/(kn - cohesion)``: friction sees ``kn overlap``, and the problem's normal force is ``(kn - cohesion) overlap``.
    beta : ndarray, shape (l,)
        Damping ratio of the dashpots, of the stiffness in ``kn``; 0 where the contact is rigid.
    adhesion : ndarray, shape (l,)
        Pull [N] that a rigid contact takes.
    pulls : bool
        Whether any contact can pull.
    elastic, used : ndarray of bool, shape (l,)
        Which are elastic; which are those of `Scene.laws_in_use`.
    restitution : ndarray, shape (l,)
        Newton's coefficient; NaN where the theta scheme (or the contact's elasticity) decides.
    newton : bool
        Whether any contact obeys Newton's law.
    arm_overlap, wall_mid : ndarray, shape (l,)
        1 where the lever arm is R - overlap/2, and where a wall's motion is taken in the middle of the overlap; else 0.
    slip_middle : ndarray of bool, shape (l,)
        Whether a shear spring's slip is that of the middle of the step; else it is that of the step's program, at its start.
    viscous_pull : ndarray of bool, shape (l,)
        Whether the dashpot may pull, as it does beside cohesion.
    arrays : Laws
        All of these, as the kernels read them.

    Raises
    ------
    InvalidSceneError
        If a rigid contact is to obey Newton's law but its restitution is not given; if a restitution is given that nothing obeys
        (`ignored_restitution`); if an elastic contact has another lever arm for the torque than for the slip, or friction without a
        shear spring, or adhesion, or cohesion with dashpot and friction; if a rigid one has cohesion; or if a law is that of the common
        area.
    """

    def __init__(self, scene: AnyScene, numerics: Numerics, contacts: ContactKind) -> None:
        laws = [scene.law_of_bodies, *(wall.law for wall in scene.walls), *scene.laws.values()]
        names = [f"{scene.noun}s", *(f"wall {wall.name!r}" for wall in scene.walls)]
        names += [f"{one!r} and {other!r}" for one, other in scene.laws]
        self.used = used = np.array([len(scene.bodies) > 1] + [True] * (len(laws) - 1))
        self._n, self._of_materials = len(scene.bodies), rows_of_materials(scene)
        self.elastic = np.array([_is_elastic(law, contacts) for law in laws])
        self.kn = np.array([law.kn - law.cohesion for law in laws])
        stiffer = np.array([law.kn for law in laws]) / self.kn
        self.ks = np.array([law.ks for law in laws])
        self.mu = np.array([law.mu for law in laws])
        self.mu = np.where(stiffer > 1.0, self.mu * stiffer, self.mu)
        self.beta = np.where(self.elastic, [law.beta for law in laws], 0.0) * np.sqrt(stiffer)
        self.adhesion = np.where(used, [law.adhesion for law in laws], 0.0)
        self.viscous_pull = (stiffer > 1.0) & (self.beta > 0.0)
        self.pulls = bool((self.adhesion > 0.0).any() or (self.viscous_pull & used).any())
        self.arm_overlap = np.array([float(law.lever_arm == "overlap") for law in laws])
        self.wall_mid = np.array([float(law.wall_velocity_at == "mid-overlap") for law in laws])
        self.slip_middle = np.array([law.slip_at == "middle" for law in laws])
        self.restitution = np.full(len(laws), np.nan)
        for k, law in enumerate(laws):
            if law.contact == "area" and used[k]:
                raise InvalidSceneError(
                    f"the law of {names[k]} has contact = 'area', which contact dynamics does not have: use 'chord', or the DEM "
                    "(method = 'dem')"
                )
            wrong, way_out = sticking_wrongly(law, bool(self.elastic[k]), float(self.mu[k]))
            if wrong and used[k]:
                raise InvalidSceneError(
                    f"the law of {names[k]} has {wrong}, which contact dynamics does not have: {way_out}"
                )
            if law.lever_arm == "torque-overlap" and self.elastic[k] and self.mu[k] > 0.0 and used[k]:
                raise InvalidSceneError(
                    f"the law of {names[k]} has lever_arm = 'torque-overlap', which contact dynamics does not have: its friction "
                    "does work with one arm; use radius or overlap"
                )
            # Where materials have laws those of walls and disks may represent no pair at all.
            acts = used[k] and (k > len(scene.walls) or not scene.laws)
            if self.elastic[k] and law.mu > 0.0 and law.ks == 0.0 and acts:
                raise InvalidSceneError(
                    f"the law of {names[k]} is elastic and has mu = {law.mu:g} with ks = 0: {NO_SHEAR_SPRING}, or make the contact rigid "
                    "(regularised, or cd.contacts = rigid)"
                )
            ignored = ignored_restitution(law, bool(self.elastic[k]), numerics)
            if ignored and used[k]:
                raise InvalidSceneError(f"the law of {names[k]} has restitution = {law.restitution}, {ignored}")
            if numerics.impact == "newton" and not self.elastic[k] and used[k]:
                if law.restitution is None:
                    raise InvalidSceneError(
                        f"impact = 'newton' needs a restitution in [0, 1], and the law of {names[k]} has none: give one, or use "
                        "impact = 'theta'"
                    )
                self.restitution[k] = law.restitution
        self.newton = bool(np.isfinite(self.restitution).any())
        self.arrays = Laws(
            self.kn,
            self.ks,
            self.mu,
            self.beta,
            self.elastic,
            self.restitution,
            self.arm_overlap,
            self.wall_mid,
            self.slip_middle,
            self.viscous_pull,
        )

    def rows(self, pairs: IntArray) -> IntArray:
        """Row of the law of each pair, shape (c,), of body numbers, shape (c, 2)."""
        j = pairs[:, 1]
        rows = np.where(j < self._n, 0, j - self._n + 1)
        if self._of_materials is None:
            return rows
        kind, table = self._of_materials
        found = table[kind[pairs[:, 0]], kind[j]]
        return np.where(found < 0, rows, found)


def ignored_restitution(law: ContactLaw, elastic: bool, numerics: Numerics) -> str:
    """Why a law's restitution would have no effect, and the way out; empty: it has one, or none is given or needed.

    0 is what packings are given that are to come to rest: `rebounds` says where they do not.
    """
    if not law.restitution or numerics.regime != "dynamic":
        return ""
    if elastic:
        return (
            "which an elastic contact does not obey (spring and dashpot decide): leave it out, or make the contact rigid "
            "(regularised, or cd.contacts = rigid) with impact = 'newton'"
        )
    scheme = (1.0 - numerics.theta) / numerics.theta
    if numerics.impact == "newton" or abs(scheme - law.restitution) <= SAME_RESTITUTION:
        return ""
    return (
        f"but impact = 'theta' with theta = {numerics.theta:g} gives (1 - theta)/theta = {scheme:g}: use impact = 'newton', or theta = "
        f"{1.0 / (1.0 + law.restitution):.6g}, or leave the restitution out"
    )


def rebounds(scene: AnyScene, numerics: Numerics, table: LawTable) -> list[str]:
    """A sentence where rigid contacts rebound by the theta scheme though their law's restitution is 0."""
    laws = [scene.law_of_bodies, *(wall.law for wall in scene.walls), *scene.laws.values()]
    scheme = (1.0 - numerics.theta) / numerics.theta
    rigid = table.used & ~table.elastic
    plastic = any(law.restitution == 0.0 for law, own in zip(laws, rigid, strict=True) if own)
    if not plastic or scheme <= SAME_RESTITUTION or numerics.impact == "newton" or numerics.regime != "dynamic":
        return []
    return [
        f"rigid contacts whose restitution is 0 rebound with (1 - theta)/theta = {scheme:g}, which theta = {numerics.theta:g} gives them: "
        "theta = 1 and impact = 'newton' do not"
    ]


def rows_of_materials(scene: AnyScene) -> tuple[IntArray, IntArray] | None:
    """Number of each body's material, shape (n + m,), and row of the law of two materials, shape (k, k), -1 where they have none."""
    if not scene.laws:
        return None
    materials = (*scene.bodies.material, *(wall.material for wall in scene.walls))
    number = {name: k for k, name in enumerate(dict.fromkeys(materials))}
    table = np.full((len(number), len(number)), -1)
    for row, (one, other) in enumerate(scene.laws, 1 + len(scene.walls)):
        table[number[one], number[other]] = table[number[other], number[one]] = row
    return np.array([number[name] for name in materials]), table


def sticking_wrongly(law: ContactLaw, elastic: bool, mu: float) -> tuple[str, str]:
    """Which of a law's attractions contact dynamics does not have, and the way out; empty: it has them."""
    if elastic and law.adhesion > 0.0:
        return (
            f"adhesion = {law.adhesion:g} and an elastic contact",
            "leave the adhesion out, give a cohesion, or make the contact rigid (regularised, or cd.contacts = rigid)",
        )
    if not elastic and law.cohesion > 0.0:
        return (
            f"cohesion = {law.cohesion:g} and a rigid contact, which has no overlap",
            "leave the cohesion out, give an adhesion, or make the contact elastic (cd.contacts = elastic)",
        )
    if law.cohesion > 0.0 and law.beta > 0.0 and mu > 0.0:
        return (
            f"cohesion = {law.cohesion:g}, friction and a dashpot (beta = {law.beta:g})",
            "use beta = 0 or mu = 0, or the DEM (method = 'dem')",
        )
    return "", ""


def _is_elastic(law: ContactLaw, contacts: ContactKind) -> bool:
    return not law.regularised if contacts == "auto" else contacts == "elastic"


def wedging_corners(scene: Scene, numerics: Numerics) -> list[str]:
    """Sentences about the corners of walls at time 0 where a disk can be wedged; none under laws that always have a solution.

    With the offsets c of `ninedisk.core.cd.step.DynamicStep`, negative where a contact closes and ``e > 0``, the associated rule asks
    for ``u_n + c >= mu |u_t|``. By Farkas' lemma that is possible unless forces r in the friction cones balance each other and
    ``c.p < 0``; and without such forces Coulomb's law has a solution too (Anitescu & Potra, Nonlinear Dynamics 14 (1997) 231-247).
    On a disk between two walls whose free sides enclose the angle alpha, the normal forces enclose ``pi - alpha``, and each force
    leans from its normal by its angle of friction at most: they are opposite only if ``arctan(mu_1) + arctan(mu_2) >= alpha``. There
    Coulomb's law fails as well: a disk that comes into a right corner and cannot turn gets ``(1 - mu) (P_1 + P_2)``, added up over both
    directions, and has to leave in both of them.

    The theta scheme's own law always has a solution, as ``r.u`` of balanced forces is ``p.gap/(theta dt) >= 0`` with walls at rest, and so
    has ``e = 0``, where no c is negative. Parallel walls do not count: what closes one contact opens the other. Contacts between disks
    can wedge as well, which no scene shows in advance: then the step itself ends in an error.

    Parameters
    ----------
    scene : Scene
    numerics : Numerics
    """
    if numerics.impact != "newton" or numerics.regime != "dynamic":
        return []
    sentences = []
    n, disks = len(scene.disks), {material: i for i, material in enumerate(scene.disks.material)}
    for (a, one), (b, two) in combinations(enumerate(scene.walls), 2):
        inner = one.normal[0] * two.normal[0] + one.normal[1] * two.normal[1]
        alpha = pi - acos(min(1.0, max(-1.0, inner)))
        for disk in disks.values():
            laws = scene.law((disk, n + a)), scene.law((disk, n + b))
            friction = atan(laws[0].mu) + atan(laws[1].mu)
            bounces = max(law.restitution or 0.0 for law in laws) > 0.0
            if not (bounces and 1e-9 < alpha <= friction and min(law.mu for law in laws) > 0.0):
                continue
            sentences.append(
                f"walls {one.name!r} and {two.name!r} meet at {degrees(alpha):.3g} degrees, no more than their angles of friction "
                f"together ({degrees(friction):.3g}): Newton's restitution can have no solution for a disk that is wedged there; {ADVICE}"
            )
            break
    return sentences
