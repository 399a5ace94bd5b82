"""Arrays of a DEM run, of disks and of bodies with outlines, grouped as the kernels read them. All are float64 unless said."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray, IntArray
from ninedisk.core.nurbs.curve_kernels import ShapeTable
from ninedisk.core.nurbs.state import ContactRows, Workspace

KN, KS, MU, BETA, TORQUE_OVERLAP, SLIP_OVERLAP, WALL_MID, SLIP_MIDDLE, COHESION, MODEL, BEND, KR, BEND_BETA = range(13)
"""Columns of a law row: kn [N/m], ks [N/m], mu, beta, lever arm R - overlap/2 (1) or R (0) of the torque and of the slip, wall
velocity at mid-overlap (1) or on the surface (0), slip in the middle of the step (1) or at its end (0), cohesion [N/m], model of
rolling resistance (below), its mu, kr [N m/rad] and beta."""

LAW_COLUMNS = 13

CONSTANT, VISCOUS, SPRING = range(3)
"""Models of rolling resistance. A contact without any is one of CONSTANT with the coefficient 0."""

MASS = 2
"""Column of `DiskArrays.free` after those of the components."""

FRICTION, DASHPOT, ROLLING, ROLLING_DASHPOT, OF_LAW = range(5)
"""Channels of `Losses`."""

STEP, PENDING, ROW, REBUILDS, BUILT = range(5)
"""Entries of the clock: contact steps done; 1 if forces at this step are still to be found; next sample row; list
rebuilds so far; step of the last one."""

OK, PAIRS_FULL, WALL_PAIRS_FULL, NOT_FINITE, GRAINS_STOPPED, BEHIND_WALL, LOOK = range(7)
"""What `step_kernels.advance` returns: done; no room for another pair of disks, or of a disk and a wall, in the lists; a position
that is no number; a contact of outlines that stops the step (`Memory.mark` says why); the centre of a disk behind a wall
(`WallArrays.behind` says which); the contact step may be too long for the present contacts or velocities (`Watch`)."""


FS, FN, OVERLAP, ENERGY, MIDDLE_A, LENGTH_A, MIDDLE_B, LENGTH_B, BEFORE_X, BEFORE_Y, ARM_A, ARM_B = range(12)
"""Columns of a contact: shear and normal force [N], overlap [m], energy of the normal force [J], the arcs of the first and of the second
outline that bound the common area: middle and length, in spans; the normal, and the arms [m] of the two bodies' own outlines."""

SIDE, COUNT, CODE, FIRST, SECOND = 0, 1, 3, 4, 5
"""Entries of `Memory.mark`: which of the two sides holds the last finished step; contacts of either side (2 entries); what stopped
the step that is not finished, a code of `ninedisk.core.nurbs.state` or `ROOM`, and the two bodies."""

ROOM = -5
"""No room for another contact in the memory."""


class DiskArrays(NamedTuple):
    """State of n disks at ``t_n``: positions at ``t_n``, velocities at ``t_{n-1/2}`` (at n = 0: ``t_0``).

    Large runs keep the disks in the order of the cells of the contact search; ``name`` and ``place`` translate.

    Attributes
    ----------
    x, v : shape (n, 2), [m], [m/s]
    angle, omega : shape (n,), [rad], [rad/s]
    radius, inv_mass, inv_inertia : shape (n,), [m], [1/kg], [1/(kg m^2)]; ``inv_mass`` is 0 for a disk that is held in both
        directions, and ``inv_inertia`` for one that does not rotate
    force : shape (n, 2), contact forces at ``t_n`` [N]; scratch during a rebuild
    torque : shape (n,), contact torques at ``t_n`` [N m]; scratch during a rebuild
    v_now : shape (n, 2), velocity that contact dashpots see [m/s]; shape (0, 2) where there is none, or where it is ``v``
    omega_now : shape (n,), spin that rolling resistance sees [rad/s]; shape (0,) where there is no `Laws`, or where it is ``omega``
    braked : shape (n,), energy that global damping has taken from each disk [J]; shape (0,) where nobody asks for it
    built : shape (n, 2), positions at the last rebuild of the lists [m]
    name : ndarray of uint32, shape (n,), number that the scene gives to the disk in this row
    place : ndarray of uint32, shape (n,), row of the scene's disk
    listed : ndarray of uint32, shape (n,), row that this disk had when the lists in use were built
    free : shape (n, 3), by the scene's numbers: 1 where the components x and y of the velocity are free, 0 where they are held; mass [kg]
        of a disk that is not fixed; shape (0, 3) where no disk is held but those that are fixed
    """

    x: FloatArray
    v: FloatArray
    angle: FloatArray
    omega: FloatArray
    radius: FloatArray
    inv_mass: FloatArray
    inv_inertia: FloatArray
    force: FloatArray
    torque: FloatArray
    v_now: FloatArray
    omega_now: FloatArray
    braked: FloatArray
    built: FloatArray
    name: NDArray[np.uint32]
    place: NDArray[np.uint32]
    listed: NDArray[np.uint32]
    free: FloatArray


class Views(NamedTuple):
    """What the force kernel reads of the disks as plain vectors, and what stays the same for each listed pair; n disks.

    Arrays of one dimension and unsigned indices spare the address arithmetic of rows, strides and negative indices, a third of the
    kernel's instructions.

    Attributes
    ----------
    x, v, dashpot_v, force, built : shape (2 n,)
        The memory of ``DiskArrays.x``, ``v``, the velocities that dashpots see (``v_now`` or ``v``), ``force`` and ``built``.
    row : ndarray of uint32, shape (capacity of the list,)
        First disk of each listed disk-disk pair.
    damping : shape (capacity of the list,)
        Dashpot coefficient of each listed disk-disk pair [N s/m].
    """

    x: FloatArray
    v: FloatArray
    dashpot_v: FloatArray
    force: FloatArray
    built: FloatArray
    row: NDArray[np.uint32]
    damping: FloatArray


class NeighbourList(NamedTuple):
    """Pairs closer than the skin, by rows.

    Attributes
    ----------
    start : ndarray of int32, shape (rows + 1,)
        Row pointers; a row is a disk (disk-disk list) or a wall (wall list).
    other : ndarray of uint32, shape (capacity,)
        The other disk of each pair.
    shear : ndarray, shape (capacity,)
        Shear force ``fs`` [N] on the row's body (disk-disk list) or on the disk (wall list).
    bending : ndarray, shape (capacity,) or (0,)
        Torque [N m] of rolling resistance without its dashpot, counter-clockwise positive on the other body: that of the spring, or of
        the step before. None where no contact has any.
    """

    start: NDArray[np.int32]
    other: NDArray[np.uint32]
    shear: NDArray[np.float64]
    bending: NDArray[np.float64]


class Cells(NamedTuple):
    """Work arrays of the cell list.

    Attributes
    ----------
    start : ndarray of int32, shape (cells + 1,)
    order : ndarray of uint32, shape (n,)
        Disks sorted by cell, row by row. Rows lie along the shorter side of the box around the centres: the next row is then not far
        away in memory.
    cell : ndarray of int32, shape (n,)
        Cell of each disk.
    grid : ndarray, shape (5,)
        Lower corner [m] along and across the rows, width of a cell [m], cells of a row, rows.
    """

    start: NDArray[np.int32]
    order: NDArray[np.uint32]
    cell: NDArray[np.int32]
    grid: NDArray[np.float64]


class Levels(NamedTuple):
    """Grids of n bodies by their sizes (`ninedisk.core.dem.levels`); k levels, ascending.

    Attributes
    ----------
    widest : ndarray, shape (k,)
        Largest radius [m]; a body is in the first level that it fits into.
    room : ndarray of int64, shape (k,)
        Most cells of each.
    base : ndarray of int64, shape (k,)
        First cell of each level.
    width : ndarray, shape (k,)
        Width of its cells [m].
    counts : ndarray of int64, shape (k, 3)
        Its cells along each of ``axes``.
    shift : ndarray of int64, shape (k,)
        Rows or layers of the finest cells by which its bodies come later in memory: larger ones are after all that they can touch.
    low : ndarray, shape (3,)
        Lower corner along each of ``axes`` [m].
    axes : ndarray of int64, shape (3,)
        Coordinates along which cells follow each other, fastest first.
    start, order, cell : ndarray
        As in `Cells`, of all levels together.
    """

    widest: FloatArray
    room: IntArray
    base: IntArray
    width: FloatArray
    counts: IntArray
    shift: IntArray
    low: FloatArray
    axes: IntArray
    start: NDArray[np.int32]
    order: NDArray[np.uint32]
    cell: NDArray[np.int32]


class Lists(NamedTuple):
    """Neighbour lists in use and what a rebuild works with.

    Attributes
    ----------
    pairs, wall_pairs : NeighbourList
        Rows are the disks with the smaller row number; rows are the walls.
    spare, wall_spare : NeighbourList
        Where a rebuild puts the new lists before it copies them.
    cells : Cells
    levels : Levels
        None of them, shape (0,), where one grid serves all disks.
    """

    pairs: NeighbourList
    wall_pairs: NeighbourList
    spare: NeighbourList
    wall_spare: NeighbourList
    cells: Cells
    levels: Levels


class WallArrays(NamedTuple):
    """State of m walls; s stripes.

    Attributes
    ----------
    now, built : shape (m, 11)
        Pose and velocity (columns of `place_walls`) at ``t_n`` and at the last rebuild.
    middle : shape (m, 11)
        Pose and velocity at ``t_{n-1/2}`` (at n = 0: ``t_0``).
    extent : shape (m,)
        Largest distance of a disk's centre from the wall's point at the last rebuild [m].
    law : shape (m, LAW_COLUMNS)
        Law rows.
    load, load_before : shape (m, 3)
        Force of the disks on the wall [N] and its torque about the origin [N m], at ``t_n`` and ``t_{n-1}``.
    share : shape (s, m, 3)
        Part of the load that each stripe contributes.
    behind : shape (s, 3)
        1 + number of a disk of each stripe whose centre is behind a wall, that wall, and the height [m]; 0 where there is none.
    passed : ndarray of int64, shape (1,)
        1 if there is such a disk in any stripe.
    """

    now: FloatArray
    built: FloatArray
    middle: FloatArray
    extent: FloatArray
    law: FloatArray
    load: FloatArray
    load_before: FloatArray
    share: FloatArray
    behind: FloatArray
    passed: NDArray[np.int64]


class Images(NamedTuple):
    """Images of n disks in a periodic cell (`ninedisk.core.dem.plane.image_kernels`); s stripes.

    Attributes
    ----------
    size : shape (2,)
        Edges at time 0 [m].
    now, built : shape (6,), shape (3,)
        Edges at ``t_n`` and their rate; edges at the last rebuild.
    shift : shape (2 capacity of the list,)
        Whole numbers ``s`` of edges along and across by which the image that is in contact lies away, for each listed pair.
    spare : shape (2 capacity,)
        Where a rebuild puts the new ones before it copies them.
    home : shape (n, 2)
        Scratch of a rebuild.
    share : shape (s, 5)
        What each stripe contributes to the loads.
    load : shape (5,)
        ``sum g (x) d`` over the contacts, row by row [N m], and the power of the images [W], at ``t_n``.
    work : shape (1,)
        Work of the images on the disks since time 0 [J].
    """

    size: FloatArray
    now: FloatArray
    built: FloatArray
    shift: FloatArray
    spare: FloatArray
    home: FloatArray
    share: FloatArray
    load: FloatArray
    work: FloatArray


class Team(NamedTuple):
    """What the threads of a run share; s stripes, at most t threads.

    Disks are divided into stripes of whole rows of cells, in ascending order; a pair belongs to the stripe of its first disk and
    touches no further than the next stripe. Even stripes at once, then odd ones, never write to the same disk at the same time, and
    every sum is formed in an order that does not depend on the number of threads.

    Attributes
    ----------
    stripe : ndarray of int64, shape (s + 1,)
        First row of each stripe; unused stripes are empty.
    border : ndarray of int64, shape (s,)
        First row of each stripe whose disk no pair of the stripe before touches.
    flags : ndarray of int64, shape (t * PAD,)
        Barrier, see `ninedisk.core.threads`.
    far : ndarray, shape (t * PAD,)
        Largest squared displacement since the last rebuild among each thread's disks [m^2].
    code : ndarray of int64, shape (1,)
        Outcome of the last rebuild.
    scratch : ndarray, shape (t, SCRATCH + 2 * PAD), or (t, CELL_SCRATCH + 2 * PAD) in a periodic cell
        Scratch of each thread's pairs; the rest keeps two threads' apart.
    """

    stripe: NDArray[np.int64]
    border: NDArray[np.int64]
    flags: NDArray[np.int64]
    far: FloatArray
    code: NDArray[np.int64]
    scratch: FloatArray


class Kick(NamedTuple):
    """Scalars of a kick and drift: ``v+ = keep v- + gain (F/m + g)``, ``x+ = x + dt v+``.

    Attributes
    ----------
    keep, gain : float
        [-] and [s].
    ahead : float
        ``v_n`` that dashpots see is extrapolated from ``v_{n-1/2}`` by this part of the last change of velocity.
    drag, seen, mean : float
        Global damping takes ``drag m v.w`` [J], with drag = xi times the kick's own time [-], and parts ``seen`` and ``mean`` of the
        change of velocity added to ``v-``: v is what the damping sees, w the displacement over its time.
    dt : float
        Contact step [s].
    gravity_x, gravity_y : float
        [m/s^2].
    """

    keep: float
    gain: float
    ahead: float
    drag: float
    seen: float
    mean: float
    dt: float
    gravity_x: float
    gravity_y: float


class StepConstants(NamedTuple):
    """Scalars of the scheme.

    Attributes
    ----------
    first, kick : Kick
        The half kick from ``t_0`` to ``t_{1/2}``, and all later ones.
    radius : float
        Radius that skins are measured by (`ninedisk.core.dem.levels.size_of_skins`) [m].
    widest : float
        Largest radius [m].
    first_skin, least_skin, most_skin : float
        Skin of the first neighbour lists and limits of later ones [m].
    lagged : bool
        Whether dashpots see ``v_{n-1/2}`` instead of ``v_n``.
    sorted : bool
        Whether disks are kept in the order of the cells.
    watched : bool
        Whether contacts that form later may make the contact step unstable.
    """

    first: Kick
    kick: Kick
    radius: float
    widest: float
    first_skin: float
    least_skin: float
    most_skin: float
    lagged: bool
    sorted: bool
    watched: bool


class Laws(NamedTuple):
    """Laws of scenes with materials, cohesion or rolling resistance; n disks, m walls, k laws, a materials.

    Attributes
    ----------
    rows : shape (k, LAW_COLUMNS)
        Law rows.
    material : ndarray of uint32, shape (n,)
        Number of each disk's material, by the scene's numbers.
    of_pair : ndarray of uint32, shape (a, a)
        Law between disks of two materials.
    of_wall : ndarray of uint32, shape (m, a)
        Law between a wall and disks of a material.
    columns : shape (10, k)
        What the force of disk-disk pairs reads of a law: kn, cohesion, ks, mu, half the columns of the arms of torque and slip, that of
        the slip's place in the step, kr, 1 for the models SPRING and VISCOUS.
    varying : ndarray of int64, shape (v,)
        Columns that are not the same in all laws between disks.
    noted : shape (v, capacity of the list)
        These columns of the law of each listed disk-disk pair.
    reach : shape (capacity of the list,)
        ``mu R`` of the pair's rolling resistance [m], ``mu R^2/(1 m/s)`` [m s] of a viscous one.
    drag : shape (capacity of the list,)
        Coefficient of the pair's rolling dashpot [N m s].
    """

    rows: FloatArray
    material: NDArray[np.uint32]
    of_pair: NDArray[np.uint32]
    of_wall: NDArray[np.uint32]
    columns: FloatArray
    varying: IntArray
    noted: FloatArray
    reach: FloatArray
    drag: FloatArray


class Watch(NamedTuple):
    """What decides whether the contact step is too long for the present state; n disks by the scene's numbers, m walls.

    Attributes
    ----------
    size : shape (n,)
        Radius; of an outline its smallest distance from the centre [m].
    arm : shape (n,)
        Bound of the arm of a normal force about the centre [m], 0 on disks.
    stiff : shape (1 + m,)
        Largest ``fn/(kn overlap)`` of the law between disks and of each wall's.
    near : shape (1,)
        Gap up to which a pair counts as a contact [m].
    sums : shape (n, 2)
        Scratch: stiffness [1/s^2] and dashpots [1/s] over the masses.
    checked : ndarray of int64, shape (1,)
        Step that was looked at last.
    verdict : ndarray of int64, shape (1,)
        `LOOK` if the contact step may be unstable there, else `OK`.
    """

    size: FloatArray
    arm: FloatArray
    stiff: FloatArray
    near: FloatArray
    sums: FloatArray
    checked: IntArray
    verdict: IntArray


class Loads(NamedTuple):
    """Forces and torques on single disks (`Scene.forces`), k of them.

    Attributes
    ----------
    disk : ndarray of int64, shape (k,)
        By the scene's numbers.
    load : shape (k, 3)
        Force [N] and torque [N m].
    time : shape (k, 2)
        Begin and end [s].
    """

    disk: IntArray
    load: FloatArray
    time: FloatArray


class Losses(NamedTuple):
    """Energy that contacts have lost since time 0 [J]; s stripes.

    Attributes
    ----------
    contacts : shape (s, 5)
        Channels above.
    before : shape (5,)
        Sums of all before a step that is sampled.
    """

    contacts: FloatArray
    before: FloatArray


class System(NamedTuple):
    """All that the forces of a step depend on.

    ``law`` is the law row of disks among each other, shape (LAW_COLUMNS,). Where ``laws`` or ``losses`` are None the compiler leaves out
    whatever concerns them.
    """

    disks: DiskArrays
    views: Views
    walls: WallArrays
    lists: Lists
    law: FloatArray
    step: StepConstants
    team: Team
    laws: Laws | None = None
    losses: Losses | None = None


class Progress(NamedTuple):
    """How far a run has come.

    Attributes
    ----------
    clock : ndarray of int64, shape (5,)
        Entries above.
    work : ndarray, shape (2,)
        Work of the walls on the disks so far, and of `Loads` [J].
    skin : ndarray, shape (1,)
        Skin of the lists in use [m].
    """

    clock: IntArray
    work: FloatArray
    skin: FloatArray


class Samples(NamedTuple):
    """Where the kernels write sampled steps; s samples, k chosen disks, c watched pairs, m walls.

    Attributes
    ----------
    at : ndarray of int64, shape (s,)
        Contact steps to sample, ascending.
    chosen : ndarray of int64, shape (k,)
        Disks whose motion is recorded, by their number in the scene.
    pairs : ndarray of int64, shape (c, 2)
        Watched pairs as body numbers.
    x, v : shape (s, k, 2)
    angle, omega : shape (s, k)
    gap, fn, fs : shape (s, c)
    wall_point : shape (s, m, 2)
    wall_angle : shape (s, m)
    wall_force : shape (s, m, 2)
    energy : shape (s, 12)
        `ninedisk.core.dem.arrays.ENERGIES` [J].
    stress : shape (s, 2, 2, 2)
        Stress of a periodic cell [N/m]: by contacts, by velocities; shape (0, 2, 2, 2) without a cell.
    cell_work : shape (s,)
        Work of the deforming cell since time 0 [J]; shape (0,) without one.
    """

    at: NDArray[np.int64]
    chosen: NDArray[np.int64]
    pairs: NDArray[np.int64]
    x: FloatArray
    v: FloatArray
    angle: FloatArray
    omega: FloatArray
    gap: FloatArray
    fn: FloatArray
    fs: FloatArray
    wall_point: FloatArray
    wall_angle: FloatArray
    wall_force: FloatArray
    energy: FloatArray
    stress: FloatArray
    cell_work: FloatArray


class Memory(NamedTuple):
    """What the contacts of one step leave to the next, for n bodies; two sides, which take turns.

    Everything is by the scene's numbers of the bodies: rebuilds of the lists and the order of the disks do not touch it. The first
    body of a contact is the one with the smaller number; a wall w is body n + w.

    Attributes
    ----------
    contact : ndarray, shape (2, room, 12)
        Columns above.
    body : ndarray of int64, shape (2, room, 3)
        First body, second body, next contact of the same first body or -1.
    head : ndarray of int64, shape (2, n)
        Newest contact of each first body, or -1.
    mark : ndarray of int64, shape (6,)
        Entries above.
    spin : ndarray, shape (n,)
        Spin at the step before [rad/s], from which that at ``t_n`` is extrapolated.
    """

    contact: FloatArray
    body: IntArray
    head: IntArray
    mark: IntArray
    spin: FloatArray


class Outlines(NamedTuple):
    """Outlines of n bodies, by the scene's numbers; m walls.

    Attributes
    ----------
    table : ShapeTable
        The scene's outlines and circles of the disks' radii.
    shape : ndarray of int64, shape (n,)
        Row of the table.
    round : ndarray of bool, shape (n,)
        Whether the body is a disk by itself, not by its outline.
    angle : ndarray, shape (n,)
        Angles at time 0 [rad].
    size : ndarray, shape (n,)
        Radius of the disk of the same area [m].
    area : ndarray of bool, shape (1 + m,)
        Whether the law between disks, and that of each wall, has the energy of the common area.
    turn : ndarray, shape (n, 2)
        Cosine and sine of the present angle.
    spin : ndarray, shape (n,)
        Spin that contact dashpots see [rad/s].
    carried : ndarray, shape (MOST_ROOTS / 2,)
        Shear forces that the contacts of one pair inherit [N].
    arc : ndarray, shape (MOST_ROOTS / 2, 4)
        Their arcs: these four columns of a contact.
    before : ndarray, shape (MOST_ROOTS / 2, 4)
        Normal and arms that they had a step before, the last four columns of a contact; zeros where there was none.
    work : Workspace
    found : ContactRows
        Contacts of one pair, in the frame that has the first body's position as its origin and the scene's axes.
    memory : Memory
    """

    table: ShapeTable
    shape: IntArray
    round: NDArray[np.bool_]
    angle: FloatArray
    size: FloatArray
    area: NDArray[np.bool_]
    turn: FloatArray
    spin: FloatArray
    carried: FloatArray
    arc: FloatArray
    before: FloatArray
    work: Workspace
    found: ContactRows
    memory: Memory
