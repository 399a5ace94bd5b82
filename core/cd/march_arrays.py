"""Arrays of a run of many dynamic steps at once, grouped as the kernel reads them; n disks, m walls, float64 unless said."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

STEP, ITERATIONS, HELD, SWEEPS, CHOSEN, PLAIN = range(6)
"""Entries of ``counts``: last step done; sweeps of all steps; contacts in the memory; sweeps so far and contacts of the step
at hand, and 1 if its changes of forces are no longer stretched."""

WORK, WORST_MAP, WORST_GAP, REACH, WALL_REACH = range(5)
"""Entries of ``totals``: work of the walls [J]; largest residual figures that mean something; reach that the list needs for pairs of
disks and for those with walls [m]."""


class Scheme(NamedTuple):
    """Constants of a run; arrays of shape (n, 3) as in `ninedisk.core.cd.step.Bodies`. ``holds_rest``: where all bodies rest, the solver
    asks for equilibrium first."""

    dt: float
    theta: float
    tolerance: float
    sweeps: int
    most: int
    relaxation: float
    stretch: float
    coulomb: bool
    newton: bool
    holds_rest: bool
    smallest: float
    xi: float
    radius: Floats
    mass: Floats
    free: NDArray[np.bool_]
    load: Floats
    inverse_mass: Floats
    dilation: Floats


class State(NamedTuple):
    """State of a run: centres and angles, velocities, walls, and by pair, in ascending order, the contact forces of the last step and the
    shear forces with which the next one begins; ``gains`` are those of `ninedisk.core.cd.contact_kernels.note_impact_work`.
    """

    x: Floats
    v: Floats
    wall: Floats
    pairs: Ints
    forces: Floats
    shear: Floats
    counts: Ints
    totals: Floats
    gains: Floats


class Near(NamedTuple):
    """Pairs of disks closer than ``reach[0]``, and with walls than ``reach[1]``, when disks and walls were at ``x`` and ``wall``; in the
    step at hand their frames, which of them are contacts, the shear forces of the last step and the forces found so far.
    """

    x: Floats
    wall: Floats
    reach: Floats
    pairs: Ints
    bodies: NDArray[np.int32]
    row: Ints
    normal: Floats
    gap: Floats
    gap_before: Floats
    shift: Floats
    arms: Floats
    closing: Floats
    inside: NDArray[np.bool_]
    shear: Floats
    force: Floats


class Chosen(NamedTuple):
    """The contacts of the step at hand: columns of `Near` and of `ninedisk.core.cd.problem.ContactProblem`, with room for all pairs."""

    pairs: Ints
    bodies: NDArray[np.int32]
    row: Ints
    normal: Floats
    gap: Floats
    gap_before: Floats
    shift: Floats
    arms: Floats
    offset: Floats
    compliance: Floats
    shear_0: Floats
    mu: Floats
    blocks: Floats
    rho: Floats
    b: Floats
    r: Floats


class Scratch(NamedTuple):
    """Work arrays of a step, shape (n, 3) but for ``after`` (m, 11), ``sums`` and ``figures``."""

    after: Floats
    force: Floats
    kept: Floats
    prescribed: Floats
    v: Floats
    dx: Floats
    sums: Floats
    figures: Floats
