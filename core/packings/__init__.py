"""Scenes that benchmarks, tests and users share: packings, a drum, a hopper, biaxial compression, a column that collapses.

All are built from lengths in mean diameters of about 1 m, masses of 1000 kg/m^2 and Earth's gravity; stiffness follows from the
load, so that the overlap at the bottom stays below a given fraction of a diameter.
"""

from ninedisk.core.packings.boxes import biaxial, collapse, poured, settled_packing, side_by_side
from ninedisk.core.packings.drum import drum
from ninedisk.core.packings.hopper import discharge, hopper
from ninedisk.core.packings.parts import DENSITY, GRAVITY, SPREAD, STILL, contact_law, settle

__all__ = [
    "DENSITY",
    "GRAVITY",
    "SPREAD",
    "STILL",
    "biaxial",
    "collapse",
    "contact_law",
    "discharge",
    "drum",
    "hopper",
    "poured",
    "settle",
    "settled_packing",
    "side_by_side",
]
