"""Arrays of a DEM run of spheres, grouped as the kernels read them, and the names of their columns."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Numbers = NDArray[np.uint32]
Vector = tuple[float, float, float]
Index = int | np.uint64

HERTZ, KN, KS, MU, BETA, TORQUE_MID, SLIP_MID, MIDDLE, UNLOADING, PULL = range(10)
"""Columns of a law: whether it is Hertz'; ``kn`` [N/m] or ``(4/3) E*`` [Pa]; ``ks`` or ``8 G*``; mu; beta; whether the torque's arm ends in
the middle of the overlap, the slip's too; whether slip is that of mid-step; the rule of unloading; pull [N/m] over the reduced
radius, in the linear law over the overlap."""
ROLL, TWIST = 10, 14
"""First columns of the two resistances, four each: model, mu, stiffness [N m/rad], damping ratio."""
HELD, STICKS, LEAST = 18, 19, 20
"""What friction has beside fn and `PULL`, over the reduced radius [N/m]; of JKR's law ``(pi g/(4 E*))^(2/3)`` [m^(2/3)], else 0;
least force of spring and dashpot together [N], 0 where the dashpot may not pull, else -inf."""

NO_RESISTANCE, CONSTANT, SPRING, VISCOUS = 0, 1, 2, 3
KEEPS, FORCE, RESCALE = 0, 1, 2
"""Rules of unloading: the spring keeps its displacement, its force, or shrinks with the contact."""

SHEAR, REDUCED, ROLLING, TWISTING = 0, 3, 4, 7
MEMORY_WIDTH, MEMORY_WIDTH_RESISTED = 4, 8
"""Columns of what a contact remembers: shear spring (3), and its reduced radius; with a resistance also rolling torque (3), twisting one.
Where it was in the step before, and whether it was open then, so that it has nothing to remember, follows from ``x - dt v``."""

DRAG, ROLL_DRAG, TWIST_DRAG, NECK = range(4)
NOTES_WIDTH, NOTES_WIDTH_RESISTED, NOTES_WIDTH_STICKY, NOTES_WIDTH_IMAGES = 1, 3, 4, 7
"""Columns of what is noted of a listed pair, coefficients of its dashpots: along the normal [N s/m], with Hertz' law over the root of the
contact radius, and of the resistances [N m s]; with JKR's law the gap [m] at which its neck breaks, < 0 while there is none. In a
periodic cell, which has no such necks, the whole numbers of its image follow."""
IMAGE = 4
"""First of the columns of the image."""

FRICTION, DASHPOT, ROLLED_ON, ROLLING_DASHPOT, OF_LAW = range(5)
"""Channels of `Losses`: sliding, dashpots, resistances beyond their springs, their dashpots, and what the law itself takes (< 0: feeds): a
shear spring whose stiffness changes with the contact radius, a torque whose arm is not that of the slip."""


class State(NamedTuple):
    """Bodies: n spheres and m planes; a slot for each stripe in each of the steps that are done at once, those of one step in a row.

    Spheres are in the order of their rows, which ``name`` gives in the scene's numbers; their vectors are in one dimension, `WIDE` numbers
    each, the last one 0. ``mobility`` is 1/m of the components that are not held, ``built`` the positions at the last rebuild of the lists,
    ``v_now`` and ``omega_now`` have what dashpots see where that is not ``v`` and ``omega``; ``braked`` is the energy that global damping
    has taken from each [J], where it is counted. ``now`` is where planes are, as in
    `Planes`, ``load`` the force on each, ``share`` what the slots add to it; ``behind`` reports for each slot 1 + sphere and plane where a
    centre is behind one.
    """

    x: Floats
    v: Floats
    omega: Floats
    angle: Floats
    v_now: Floats
    omega_now: Floats
    force: Floats
    torque: Floats
    mass: Floats
    mobility: Floats
    inv_mass: Floats
    inv_inertia: Floats
    radius: Floats
    name: Integers
    now: Floats
    load: Floats
    share: Floats
    behind: Integers
    built: Floats
    braked: Floats


class Planes(NamedTuple):
    """Planes in a step: at its end t_n, in its middle and at its begin; rows are point, normal, pivot, its velocity, spin (3 each)."""

    now: Floats
    middle: Floats
    before: Floats


class Contacts(NamedTuple):
    """Listed pairs by rows, ``start[r] .. start[r+1]-1``; room for k of them.

    Rows are spheres, with spheres of higher rows, or planes, with ascending spheres. ``law`` is a row of the laws, ``notes`` and
    ``memory`` have columns above; ``force`` (fn, fs on the first body) is that of the last step before `advance` returned.
    """

    start: Integers
    row: Numbers
    other: Numbers
    law: Numbers
    notes: Floats
    memory: Floats
    force: Floats


class Losses(NamedTuple):
    """Energy that contacts of each stripe have lost since time 0 [J], by channels above; m planes.

    ``before`` has that before the step that `advance` ended with. ``torque`` is what the slots add to the torque on each plane about
    the origin; ``loads``, force and torque, those of the last step and of the one before; ``fed`` what the slots add to the work of
    forces on single spheres; ``work`` that of the planes on spheres, ``force_work`` of those forces [J].
    """

    contacts: Floats
    before: Floats
    torque: Floats
    loads: Floats
    fed: Floats
    work: Floats
    force_work: Floats


class Pushes(NamedTuple):
    """Forces and torques on single spheres (`AnyScene.forces`) by ascending rows; k of them.

    Attributes
    ----------
    row : ndarray of int64, shape (k,)
    load : ndarray, shape (k, 6)
        Force [N] and torque [N m].
    time : ndarray, shape (k, 2)
        Begin and end [s].
    """

    row: Integers
    load: Floats
    time: Floats


class Images(NamedTuple):
    """A periodic cell of n spheres.

    Attributes
    ----------
    size, rate : ndarray, shape (3,) and (3, 3)
        Edges at time 0 [m], and ``h'`` [m/s].
    now, built : ndarray, shape (3, 3)
        ``h`` [m] in this step and at the last rebuild.
    home : ndarray, shape (n, 3)
        How many edges each sphere is away from the cell, at the last rebuild.
    widest : ndarray, shape (1,)
        Largest radius [m].
    share : ndarray, shape (10,)
        ``sum g (x) d`` of this step row by row [N m], and the power of the images [W].
    power, work : ndarray, shape (1,)
        That power in the step before [W], and the work of the images so far [J].
    boxes : ndarray of int64, shape (3,)
        Boxes of the cell along its edges.
    scratch : ndarray, shape (3,)
    """

    size: Floats
    rate: Floats
    now: Floats
    built: Floats
    home: Floats
    widest: Floats
    share: Floats
    power: Floats
    work: Floats
    boxes: Integers
    scratch: Floats


class Step(NamedTuple):
    """A step as its contacts see it.

    Attributes
    ----------
    slip_dt, loss_dt : float
        Time over which slip accumulates [s]: ``dt``, or 0 for the forces at time 0; and forces that depend on velocities, then dt/2.
    central : bool
        Whether dashpots see ``v_now``.
    keep : bool
        Whether the forces of the contacts are to be kept.
    """

    slip_dt: float
    loss_dt: float
    central: bool
    keep: bool


class Desk(NamedTuple):
    """What a thread writes to while it finds the forces of a stripe.

    Attributes
    ----------
    slot : int
        Of the stripe in this step, see `State`.
    scratch : ndarray, shape (SCRATCH,) or (SCRATCH_COUNTED,)
        The contacts of a chunk, by columns of `ninedisk.core.dem.space.scratch_kernels`.
    picked : ndarray of int64, shape (CHUNK,)
        Where they stand in their list.
    """

    slot: int
    scratch: Floats
    picked: Integers


class Motion(NamedTuple):
    """Segments of the planes' motion: those of plane w are ``first[w] .. first[w+1]-1``; columns of ``row`` below."""

    first: Integers
    row: Floats


BEGIN, POINT, AXIS, PIVOT, VELOCITY, SPIN, AMPLITUDE, FREQUENCY, PHASE = 0, 1, 4, 7, 10, 13, 16, 19, 20
SEGMENT_WIDTH = 21
POSE_WIDTH = 15
