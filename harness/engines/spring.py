"""What adapters of engines with contact springs share."""

from __future__ import annotations

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Scene
from ninedisk.harness.api.capabilities import SLIP_AT

OF_SLIP_AT = frozenset(SLIP_AT.values())
"""What an engine may lack whose runs are those of the same physics, discretised otherwise: of first order in the step."""

NOTE_SLIP_AT = (
    "slip is not measured where in the step the scene's slip_at says: a difference of first order in the step"
)
NOTE_SLIP_END = (
    "the half step's slip is measured with the normal of the step's end (slip_at = end): of first order in the step"
)


def contact_steps(scene: Scene, numerics: Numerics) -> tuple[int, float]:
    """Contact steps in one ``dt`` and their length [s]: those of the in-house DEM, whose scheme it is.

    Raises
    ------
    UnstableTimeStepError
        If ``numerics.contact_dt`` exceeds the critical step and ``numerics.allow_unstable`` is False.
    """
    from ninedisk.core.dem.arrays import contact_step

    contact_dt, _ = contact_step(scene, numerics)
    return numerics.substeps(contact_dt), contact_dt


def laws_in_use(scene: Scene) -> list[ContactLaw]:
    """Laws of the pairs that the scene can have: between disks (of two or more), then of each wall."""
    return ([scene.disk_disk] if len(scene.disks) > 1 else []) + [wall.law for wall in scene.walls]
