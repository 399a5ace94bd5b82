"""Contact laws as columns, one row for disk-disk contacts and one a wall; and corners where Newton's law can have no solution."""

from __future__ import annotations

from itertools import combinations
from math import acos, atan, degrees, pi

import numpy as np

from ninedisk.core.cd.contact_kernels import Laws
from ninedisk.core.cd.settings import ContactKind
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.law import ContactLaw
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene

ADVICE = "use impact = 'theta', with which a solution always exists, or a restitution of 0"


class LawTable:
    """Laws of a scene; row 0 is the disk-disk law, row ``1 + w`` that of wall w.

    Parameters
    ----------
    scene : Scene
    numerics : Numerics
    contacts : {"auto", "rigid", "elastic"}
        Which contacts are elastic; auto: those whose law is not ``regularised``.

    Attributes
    ----------
    kn, ks : ndarray, shape (1 + m,)
        Stiffness [N/m].
    mu : ndarray, shape (1 + m,)
        Friction coefficient; 0 where an elastic contact has no shear stiffness and thus carries no shear force.
    elastic : ndarray of bool, shape (1 + m,)
    restitution : ndarray, shape (1 + m,)
        Newton's coefficient; NaN where the theta scheme (or the contact's elasticity) decides.
    newton : bool
        Whether any contact obeys Newton's law.
    arm_overlap, wall_mid : ndarray, shape (1 + m,)
        1 where the lever arm is R - overlap/2, and where a wall's motion is taken in the middle of the overlap; else 0.
    slip_middle : ndarray of bool, shape (1 + m,)
        Whether a shear spring's slip is that of the middle of the step; else it is that of the step's program, at its start.
    arrays : Laws
        All of these, as the kernels read them.

    Raises
    ------
    InvalidSceneError
        If a rigid contact is to obey Newton's law but its restitution is not given, or an elastic one has a dashpot or another
        lever arm for the torque than for the slip; or if a law is that of the common area.
    """

    def __init__(self, scene: Scene, numerics: Numerics, contacts: ContactKind) -> None:
        laws = [scene.disk_disk, *(wall.law for wall in scene.walls)]
        names = ["disks", *(f"wall {wall.name!r}" for wall in scene.walls)]
        used = [len(scene.disks) > 1] + [True] * len(scene.walls)
        self.elastic = np.array([_is_elastic(law, contacts) for law in laws])
        self.kn = np.array([law.kn for law in laws])
        self.ks = np.array([law.ks for law in laws])
        self.mu = np.array([law.mu for law in laws])
        self.mu[self.elastic & (self.ks == 0.0)] = 0.0
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
            if self.elastic[k] and law.beta > 0.0 and used[k]:
                raise InvalidSceneError(
                    f"the law of {names[k]} has a dashpot (beta = {law.beta:g}), which contact dynamics does not have: use "
                    "beta = 0, or make the contact rigid with a restitution (cd.contacts = rigid)"
                )
            if law.lever_arm == "torque-overlap" and self.elastic[k] and self.mu[k] > 0.0 and used[k]:
                raise InvalidSceneError(
                    f"the law of {names[k]} has lever_arm = 'torque-overlap', which contact dynamics does not have: its friction "
                    "does work with one arm; use radius or overlap"
                )
            if numerics.impact == "newton" and not self.elastic[k] and used[k]:
                if law.restitution is None:
                    raise InvalidSceneError(
                        f"impact = 'newton' needs a restitution in [0, 1], and the law of {names[k]} has none: give one, or use "
                        "impact = 'theta'"
                    )
                self.restitution[k] = law.restitution
        self.newton = bool(np.isfinite(self.restitution).any())
        self.arrays = Laws(
            self.kn, self.ks, self.mu, self.elastic, self.restitution, self.arm_overlap, self.wall_mid, self.slip_middle
        )


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
    can wedge as well, which no scene tells in advance: then the step itself ends in an error.

    Parameters
    ----------
    scene : Scene
    numerics : Numerics
    """
    if numerics.impact != "newton" or numerics.regime != "dynamic":
        return []
    sentences = []
    for one, two in combinations(scene.walls, 2):
        inner = one.normal[0] * two.normal[0] + one.normal[1] * two.normal[1]
        alpha = pi - acos(min(1.0, max(-1.0, inner)))
        friction = atan(one.law.mu) + atan(two.law.mu)
        bounces = max(one.law.restitution or 0.0, two.law.restitution or 0.0) > 0.0
        if bounces and 1e-9 < alpha <= friction and one.law.mu > 0.0 and two.law.mu > 0.0:
            sentences.append(
                f"walls {one.name!r} and {two.name!r} meet at {degrees(alpha):.3g} degrees, no more than their angles of friction "
                f"together ({degrees(friction):.3g}): Newton's restitution can have no solution for a disk that is wedged there; {ADVICE}"
            )
    return sentences
