"""Contact laws as columns, one row for disk-disk contacts and one a wall."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd.contact_kernels import Laws
from ninedisk.core.cd.options import Stiffness
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.law import ContactLaw
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene

FloatArray = NDArray[np.float64]


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

    def __init__(self, scene: Scene, numerics: Numerics, contacts: Stiffness) -> None:
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


def _is_elastic(law: ContactLaw, contacts: Stiffness) -> bool:
    return not law.regularised if contacts == "auto" else contacts == "elastic"
