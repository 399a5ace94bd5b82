"""What a run of the DEM has done and holds at present, in numbers."""

from __future__ import annotations

from typing import NamedTuple


class Counts(NamedTuple):
    """What a run has done and holds at present; the same for any number of threads.

    Attributes
    ----------
    rebuilds : int
        Rebuilds of the neighbour lists since time 0, not counting the lists that a session begins with; a checkpoint carries it on.
    pairs, wall_pairs : int
        Pairs of disks, and of a disk and a wall, that the present lists hold: those whose gap was below the skin at the last rebuild.
        Each costs in every step: a pair of disks as much as a contact, one with a wall a distance.
    contacts, wall_contacts : int
        Pairs of disks, and of a disk and a wall, that overlap at the present positions; of bodies with outlines the contacts of
        the last finished step, of which a pair can have several (before the first step those that carry a preload).
    """

    rebuilds: int
    pairs: int
    wall_pairs: int
    contacts: int
    wall_contacts: int
