"""Forces of the contacts of bodies with outlines, and which contact of the step before each one continues.

With M the middle of the chord, ``r = M - x_i`` and ``t = (-n_y, n_x)``, the arms of a contact about body i are ``b_i = r.t`` of the normal
and ``a_i = r.n + e_i`` of the shear force, where e_i moves the point of application along the normal to the extreme point of i's
outline ("radius") or to the middle of the overlap ("overlap"); about body j, with ``r = M - x_j``, they are ``b_j = r.t`` and
``a_j = -r.n + e_j``. Force and torque on i are ``-fn n + fs t`` and ``fn b_i + fs a_i``, those on j ``fn n - fs t`` and
``-fn b_j + fs a_j``. The slip is ``(v_i - v_j).t + a_i omega_i + a_j omega_j``, the overlap grows by ``(v_i - v_j).n - b_i omega_i +
b_j omega_j``. On disks b = 0 and a = R or R - overlap/2: what `force_kernels` has.

The slip of the middle of the step has the means of the arms at both ends of the step for its arms, and for its normal the direction of
``h_0 n_0 + h_1 n_1``, with h the distance of the bodies along the normal. On disks, where ``h n`` is ``x_j - x_i``, that is the direction
of half a step before; second order needs no more than weights that are equal but for O(dt). Its overlap is what the arms exceed the
distance in the middle by. A contact that began in this step has no normal of the step before: it turns as that of disks would.

One thread does all of it: bodies are visited in the order of the lists, and each contact is computed from the body with the smaller
number, so that neither the lists nor the number of threads change a bit of it.

Two grains, or a grain and a wall, can touch at several places, and each contact keeps its own shear force. A contact is known by the two
arcs that bound its common area, one on either outline, which roll and slide along the outlines by little in a step. The rule: the shear
force of a contact of the step before goes to that contact of the same pair whose arcs' middles are nearest (distances along both outlines,
each over the outline's length, summed), if on one outline at least the middles are no farther apart than the sum of both arcs' lengths;
otherwise the contact has opened. Contacts that merge add their shear forces; of a contact that divides the nearest part inherits. A pair of
strictly convex bodies has one contact at most, which needs no such condition: as on disks, it is the same as long as it is closed. With its
shear force a contact inherits the normal and the arms of the step before.
"""

from __future__ import annotations

from math import cos, sin, sqrt

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import inline_kernel, kernel
from ninedisk.core.dem.plane.force_kernels import normal_force, record_behind_wall, shear_force
from ninedisk.core.dem.plane.kick_kernels import is_fixed
from ninedisk.core.dem.state import (
    ARM_A,
    ARM_B,
    BEFORE_X,
    BEFORE_Y,
    BETA,
    CODE,
    COUNT,
    ENERGY,
    FIRST,
    FN,
    FS,
    KN,
    KS,
    LENGTH_A,
    LENGTH_B,
    MIDDLE_A,
    MIDDLE_B,
    MU,
    OVERLAP,
    ROOM,
    SECOND,
    SIDE,
    SLIP_MIDDLE,
    SLIP_OVERLAP,
    TORQUE_OVERLAP,
    WALL_MID,
    DiskArrays,
    Outlines,
    StepConstants,
    System,
    WallArrays,
)
from ninedisk.core.nurbs.curve_kernels import Pose
from ninedisk.core.nurbs.intersect_kernels import pair_contacts
from ninedisk.core.nurbs.lens_kernels import segment_area
from ninedisk.core.nurbs.state import CROSSED
from ninedisk.core.nurbs.wall_kernels import wall_contacts
from ninedisk.core.pose import (
    DASHPOT_VX,
    DASHPOT_VY,
    NORMAL_X,
    NORMAL_Y,
    PIVOT_VX,
    PIVOT_VY,
    PIVOT_X,
    PIVOT_Y,
    POINT_X,
    POINT_Y,
    TURN_RATE,
)


@inline_kernel
def circle_contact(dx: float, dy: float, ra: float, rb: float, outlines: Outlines) -> int:
    """Contact of two disks by themselves, the second at (dx, dy) from the first, to row 0 of ``outlines.found``; 0 or 1."""
    d = sqrt(dx * dx + dy * dy)
    nx, ny = dx / d, dy / d
    height = 0.5 * (d + (ra - rb) * (ra + rb) / d)
    found = outlines.found
    found.point[0, 0], found.point[0, 1], found.normal[0, 0], found.normal[0, 1] = height * nx, height * ny, nx, ny
    found.overlap[0], found.beyond[0] = ra + rb - d, ra - height
    return 1


@inline_kernel
def pair_found(outlines: Outlines, a: int, b: int, dx: float, dy: float, ra: float, rb: float) -> int:
    """Contacts of bodies a and b, the second one at (dx, dy) from the first, to ``outlines.found``; their number or a code."""
    if outlines.round[a] and outlines.round[b] and not outlines.area[0]:
        return circle_contact(dx, dy, ra, rb, outlines)
    turn = outlines.turn
    at, other = Pose(turn[a, 0], turn[a, 1], 0.0, 0.0), Pose(turn[b, 0], turn[b, 1], dx, dy)
    return pair_contacts(
        outlines.table, outlines.shape[a], at, outlines.shape[b], other, outlines.work, outlines.found, 0
    )


@inline_kernel
def wall_found(
    outlines: Outlines, a: int, px: float, py: float, ux: float, uy: float, radius: float, area: bool
) -> int:
    """Contacts of body a with a wall through (px, py), measured from the body, to ``outlines.found``; their number or a code."""
    if outlines.round[a] and not area:
        height, found = -(px * ux + py * uy), outlines.found
        found.point[0, 0], found.point[0, 1], found.normal[0, 0], found.normal[0, 1] = (
            -height * ux,
            -height * uy,
            -ux,
            -uy,
        )
        found.overlap[0], found.beyond[0] = radius - height, radius - height
        return 1
    at = Pose(outlines.turn[a, 0], outlines.turn[a, 1], 0.0, 0.0)
    return wall_contacts(outlines.table, outlines.shape[a], at, px, py, ux, uy, outlines.work, outlines.found, 0)


@inline_kernel
def spring(outlines: Outlines, m: int, a: int, b: int, kn: float, area: bool) -> tuple[float, float]:
    """Overlap that makes the elastic force ``kn`` times it [m], and that force's energy [J] (see `ContactLaw.contact`); b < 0: a wall."""
    found = outlines.found
    if not area:
        return found.overlap[m], 0.5 * kn * found.overlap[m] * found.overlap[m]
    place = found.place
    common = segment_area(outlines.table, outlines.shape[a], place[m, 0], place[m, 2])
    curvature = 1.0 / outlines.size[a]
    if b >= 0:
        common += segment_area(outlines.table, outlines.shape[b], place[m, 3], place[m, 1])
        curvature += 1.0 / outlines.size[b]
    # U = kn f^2/2 with f = (9 A^2/(32 R_e))^(1/3), so that U' = kn f (2/3) f/A.
    scaled = (9.0 / 32.0 * common * common * curvature) ** (1.0 / 3.0)
    return 2.0 / 3.0 * scaled * scaled / common * found.chord[m], 0.5 * kn * scaled * scaled


@inline_kernel
def begin_pass(disks: DiskArrays, outlines: Outlines, step: StepConstants, n: int) -> None:
    """Present angles; spins that dashpots see, extrapolated to ``t_n`` as `kick_and_drift` does velocities; an empty side."""
    ahead = 0.0 if step.lagged else (1.0 if n == 1 else 0.5)
    memory = outlines.memory
    new = 1 - memory.mark[SIDE]
    memory.mark[COUNT + new], memory.mark[CODE] = 0, 0
    for i in range(disks.x.shape[0]):
        k = disks.name[i]
        memory.head[new, k] = -1
        outlines.spin[k] = disks.omega[i] + ahead * (disks.omega[i] - memory.spin[k])
        angle = outlines.angle[k] + disks.angle[i]
        outlines.turn[k, 0], outlines.turn[k, 1] = cos(angle), sin(angle)


@inline_kernel
def ring_of(outlines: Outlines, body: int) -> float:
    """Number of spans of a body's outline."""
    shape = outlines.shape[body]
    return float(outlines.table.first_span[shape + 1] - outlines.table.first_span[shape])


@inline_kernel
def convex(outlines: Outlines, body: int) -> bool:
    """Whether a body is strictly convex."""
    return bool(outlines.table.smallest_radius[outlines.shape[body]] > 0.0)


@inline_kernel
def record_stop(outlines: Outlines, code: int, a: int, b: int) -> bool:
    """Note why the pass stops, at which bodies; False."""
    mark = outlines.memory.mark
    mark[CODE], mark[FIRST], mark[SECOND] = code, a, b
    return False


@inline_kernel
def normal_midway(
    outlines: Outlines, m: int, nx: float, ny: float, before_x: float, before_y: float, dx: float, dy: float
) -> tuple[float, float]:
    """Normal in the middle of the step, from the present one and that before, the second body at d and at ``before`` from the first."""
    ox, oy, new = outlines.before[m, 0], outlines.before[m, 1], nx * dx + ny * dy
    wx, wy = new * nx + before_x - dx, new * ny + before_y - dy
    if ox != 0.0 or oy != 0.0:
        old = ox * before_x + oy * before_y
        wx, wy = old * ox, old * oy
        if (
            not 0.5 * new < old < 2.0 * new
        ):  # bodies beside each other as looked at along the normal: weights that mean nothing
            wx, wy, new = ox, oy, 1.0
    elif not new * new > (before_x - dx) ** 2 + (before_y - dy) ** 2:
        return nx, ny
    mx, my = wx + new * nx, wy + new * ny
    length = sqrt(mx * mx + my * my)
    return mx / length, my / length


@inline_kernel
def arm_midway(outlines: Outlines, m: int, side: int, arm: float) -> float:
    """Arm of the first (2) or second body (3) in the middle of the step, from the present one and that before."""
    if outlines.before[m, 0] == 0.0 and outlines.before[m, 1] == 0.0:
        return arm
    return float(0.5 * (outlines.before[m, side] + arm))


@inline_kernel
def pair_forces(
    disks: DiskArrays,
    outlines: Outlines,
    law: NDArray[np.float64],
    slip_dt: float,
    i: int,
    j: int,
) -> bool:
    """Add the forces of all contacts of the bodies in rows i and j, the first having the smaller number; False if stopped."""
    dx, dy = disks.x[j, 0] - disks.x[i, 0], disks.x[j, 1] - disks.x[i, 1]
    reach = disks.radius[i] + disks.radius[j]
    if dx * dx + dy * dy >= reach * reach:
        return True
    a, b = int(disks.name[i]), int(disks.name[j])
    count = pair_found(outlines, a, b, dx, dy, disks.radius[i], disks.radius[j])
    if count < 0:
        return record_stop(outlines, count, a, b)
    if count == 0:
        return True
    if outlines.area[0]:  # areas are those of one arc of either outline
        for m in range(count):
            if outlines.found.corners[m] > 2:
                return record_stop(outlines, CROSSED, a, b)
    ring_a, ring_b = ring_of(outlines, a), ring_of(outlines, b)
    arcs_of(outlines, count, ring_a, ring_b)
    inherit(outlines, a, b, count, ring_a, ring_b, convex(outlines, a) and convex(outlines, b))
    dashpot_v = disks.v_now if disks.v_now.shape[0] > 0 else disks.v
    kn, ks, mu, beta = law[KN], law[KS], law[MU], law[BETA]
    found = outlines.found
    for m in range(count):
        nx, ny, overlap = found.normal[m, 0], found.normal[m, 1], found.overlap[m]
        rx, ry = found.point[m, 0], found.point[m, 1]
        arm_a, arm_b = rx * nx + ry * ny + found.beyond[m], (dx - rx) * nx + (dy - ry) * ny + overlap - found.beyond[m]
        side_a, side_b = ry * nx - rx * ny, (ry - dy) * nx - (rx - dx) * ny
        rate = 0.0
        if beta > 0.0:
            rate = (dashpot_v[i, 0] - dashpot_v[j, 0]) * nx + (dashpot_v[i, 1] - dashpot_v[j, 1]) * ny
            rate += side_b * outlines.spin[b] - side_a * outlines.spin[a]
        stretch, energy = spring(outlines, m, a, b, kn, outlines.area[0])
        fn = normal_force(stretch, rate, kn, beta, disks.inv_mass[i] + disks.inv_mass[j], 0.0)
        fs = 0.0
        if mu > 0.0 and ks > 0.0:
            vx, vy = disks.v[i, 0] - disks.v[j, 0], disks.v[i, 1] - disks.v[j, 1]
            mx, my, slip_a, slip_b, deep = nx, ny, arm_a, arm_b, overlap
            if law[SLIP_MIDDLE] > 0.0:
                mx, my = normal_midway(outlines, m, nx, ny, dx + slip_dt * vx, dy + slip_dt * vy, dx, dy)
                slip_a, slip_b = arm_midway(outlines, m, 2, arm_a), arm_midway(outlines, m, 3, arm_b)
                deep = slip_a + slip_b - (dx + 0.5 * slip_dt * vx) * mx - (dy + 0.5 * slip_dt * vy) * my
            back = 0.5 * law[SLIP_OVERLAP] * deep
            vt = vy * mx - vx * my + (slip_a - back) * disks.omega[i] + (slip_b - back) * disks.omega[j]
            fs = shear_force(outlines.carried[m], vt * slip_dt, ks, mu * fn)
        back = 0.5 * law[TORQUE_OVERLAP] * overlap
        gx, gy = -fn * nx - fs * ny, -fn * ny + fs * nx
        disks.force[i, 0] += gx
        disks.force[i, 1] += gy
        disks.force[j, 0] -= gx
        disks.force[j, 1] -= gy
        disks.torque[i] += fn * side_a + fs * (arm_a - back)
        disks.torque[j] += fs * (arm_b - back) - fn * side_b
        if not remember(outlines, a, b, m, fs, fn, energy, arm_a, arm_b):
            return record_stop(outlines, ROOM, a, b)
    return True


@inline_kernel
def wall_forces(disks: DiskArrays, walls: WallArrays, outlines: Outlines, slip_dt: float, i: int, w: int) -> bool:
    """Add the forces of all contacts of the body in row i with wall w and its load; False if stopped.

    The wall's velocity enters the slip at M, which is on its surface, or half an overlap deeper; the reaction acts in M.
    """
    ux, uy = walls.now[w, NORMAL_X], walls.now[w, NORMAL_Y]
    px, py = walls.now[w, POINT_X] - disks.x[i, 0], walls.now[w, POINT_Y] - disks.x[i, 1]
    height = -(px * ux + py * uy)
    if disks.radius[i] - height <= 0.0:
        return True
    if height <= 0.0 and not is_fixed(disks, i):
        record_behind_wall(disks, walls, 0, i, w, height)
        return True
    a, b = int(disks.name[i]), disks.x.shape[0] + w
    count = wall_found(outlines, a, px, py, ux, uy, disks.radius[i], outlines.area[1 + w])
    if count < 0:
        return record_stop(outlines, count, a, b)
    ring = ring_of(outlines, a)
    arcs_of(outlines, count, ring, 0.0)
    inherit(outlines, a, b, count, ring, 0.0, convex(outlines, a))
    dashpot_v = disks.v_now if disks.v_now.shape[0] > 0 else disks.v
    kn, ks, mu, beta = walls.law[w, KN], walls.law[w, KS], walls.law[w, MU], walls.law[w, BETA]
    middle, sliding = walls.law[w, SLIP_MIDDLE] > 0.0, walls.now
    if middle:
        sliding = walls.middle
    cx, cy, spin = walls.now[w, PIVOT_X] - disks.x[i, 0], walls.now[w, PIVOT_Y] - disks.x[i, 1], walls.now[w, TURN_RATE]
    found, load = outlines.found, walls.share
    for m in range(count):
        overlap = found.overlap[m]
        rx, ry = found.point[m, 0], found.point[m, 1]
        arm, side = found.beyond[m] - rx * ux - ry * uy, rx * uy - ry * ux
        rate = 0.0
        if beta > 0.0:
            deep = 0.5 * walls.law[w, WALL_MID] * overlap
            qx, qy = rx - deep * ux - cx, ry - deep * uy - cy
            rate = (walls.now[w, DASHPOT_VX] - spin * qy - dashpot_v[i, 0]) * ux
            rate += (walls.now[w, DASHPOT_VY] + spin * qx - dashpot_v[i, 1]) * uy - side * outlines.spin[a]
        stretch, energy = spring(outlines, m, a, -1, kn, outlines.area[1 + w])
        fn = normal_force(stretch, rate, kn, beta, disks.inv_mass[i], 0.0)
        fs = 0.0
        if mu > 0.0 and ks > 0.0:
            sx, sy, tx, ty = sliding[w, POINT_X], sliding[w, POINT_Y], -sliding[w, NORMAL_Y], sliding[w, NORMAL_X]
            slip_arm, sunk = arm, overlap
            if middle:
                slip_arm = arm_midway(outlines, m, 2, arm)
                hx = disks.x[i, 0] - 0.5 * slip_dt * disks.v[i, 0] - sx
                hy = disks.x[i, 1] - 0.5 * slip_dt * disks.v[i, 1] - sy
                sunk = slip_arm - (hx * ty - hy * tx)
            # M is on the surface, whose points all move along it as the wall's own does.
            vt = (sliding[w, PIVOT_VX] + spin * (sliding[w, PIVOT_Y] - sy) - disks.v[i, 0]) * tx
            vt += (sliding[w, PIVOT_VY] + spin * (sx - sliding[w, PIVOT_X]) - disks.v[i, 1]) * ty
            vt -= 0.5 * spin * walls.law[w, WALL_MID] * sunk
            vt += (slip_arm - 0.5 * walls.law[w, SLIP_OVERLAP] * sunk) * disks.omega[i]
            fs = shear_force(outlines.carried[m], vt * slip_dt, ks, mu * fn)
        gx, gy = fn * ux + fs * uy, fn * uy - fs * ux
        disks.force[i, 0] += gx
        disks.force[i, 1] += gy
        disks.torque[i] += fn * side + fs * (arm - 0.5 * walls.law[w, TORQUE_OVERLAP] * overlap)
        load[0, w, 0] -= gx
        load[0, w, 1] -= gy
        load[0, w, 2] -= (rx + disks.x[i, 0]) * gy - (ry + disks.x[i, 1]) * gx
        if not remember(outlines, a, b, m, fs, fn, energy, arm, 0.0):
            return record_stop(outlines, ROOM, a, b)
    return True


@kernel
def grain_forces(system: System, outlines: Outlines, n: int, slip_dt: float) -> bool:
    """Add all contact forces of step ``n`` to the bodies and the walls' shares; pass shear forces on to this step's side of the memory.

    Parameters
    ----------
    system : System
        The forces must be zero. The lists' own shear forces are not used.
    outlines : Outlines
    n : int
        Contact step.
    slip_dt : float
        Time over which slip accumulates [s]: ``dt``, or 0 for the forces at time 0.

    Returns
    -------
    bool
        False if a contact could not be computed or there was no room for it: ``memory.mark`` says which, and what the memory holds is
        still the step before.
    """
    disks, walls = system.disks, system.walls
    pairs, wall_pairs = system.lists.pairs, system.lists.wall_pairs
    begin_pass(disks, outlines, system.step, n)
    for i in range(disks.x.shape[0]):
        for k in range(pairs.start[i], pairs.start[i + 1]):
            j = int(pairs.other[k])
            first, second = (i, j) if disks.name[i] < disks.name[j] else (j, i)
            if not pair_forces(disks, outlines, system.law, slip_dt, first, second):
                return False
    for w in range(walls.now.shape[0]):
        for c in range(3):
            walls.share[0, w, c] = 0.0
        for k in range(wall_pairs.start[w], wall_pairs.start[w + 1]):
            if not wall_forces(disks, walls, outlines, slip_dt, int(wall_pairs.other[k]), w):
                return False
    memory = outlines.memory
    memory.mark[SIDE] = 1 - memory.mark[SIDE]
    for i in range(disks.x.shape[0]):
        memory.spin[disks.name[i]] = disks.omega[i]
    return True


@inline_kernel
def around(difference: float, ring: float) -> float:
    """Distance of two places along a closed outline of ``ring`` spans, the shorter way."""
    ahead = difference % ring
    return min(ahead, ring - ahead)


@inline_kernel
def arcs_of(outlines: Outlines, count: int, ring_a: float, ring_b: float) -> None:
    """Middles and lengths of the arcs of ``count`` found contacts; ``ring_b`` is 0 for a wall.

    On the first outline the arc runs forward from the entering to the leaving intersection, on the second one back again.
    """
    place, arc = outlines.found.place, outlines.arc
    for m in range(count):
        arc[m, 1] = (place[m, 2] - place[m, 0]) % ring_a
        arc[m, 0] = (place[m, 0] + 0.5 * arc[m, 1]) % ring_a
        arc[m, 2], arc[m, 3] = 0.0, 0.0
        if ring_b > 0.0:
            arc[m, 3] = (place[m, 1] - place[m, 3]) % ring_b
            arc[m, 2] = (place[m, 3] + 0.5 * arc[m, 3]) % ring_b


@inline_kernel
def inherit(outlines: Outlines, a: int, b: int, count: int, ring_a: float, ring_b: float, single: bool) -> None:
    """What the ``count`` found contacts of bodies a and b inherit: shear forces [N] to ``outlines.carried``, geometry to ``before``."""
    memory, arc, carried, before = outlines.memory, outlines.arc, outlines.carried, outlines.before
    old = memory.mark[SIDE]
    for m in range(count):
        carried[m] = 0.0
        for c in range(4):
            before[m, c] = 0.0
    row = memory.head[old, a]
    while row >= 0:
        if memory.body[old, row, 1] == b:
            contact = memory.contact[old, row]
            best, least = 0 if single else -1, 1e300
            for m in range(0 if single else count):
                off_a = around(arc[m, 0] - contact[MIDDLE_A], ring_a)
                near, distance = off_a <= arc[m, 1] + contact[LENGTH_A], off_a / ring_a
                if ring_b > 0.0:
                    off_b = around(arc[m, 2] - contact[MIDDLE_B], ring_b)
                    near = near or off_b <= arc[m, 3] + contact[LENGTH_B]
                    distance += off_b / ring_b
                if near and distance < least:
                    best, least = m, distance
            if best >= 0:
                carried[best] += contact[FS]
                for c in range(4):
                    before[best, c] = contact[BEFORE_X + c]
        row = memory.body[old, row, 2]


@inline_kernel
def remember(
    outlines: Outlines, a: int, b: int, m: int, fs: float, fn: float, energy: float, arm_a: float, arm_b: float
) -> bool:
    """Write found contact ``m`` of bodies a and b to the side of this step; False if there is no room."""
    memory = outlines.memory
    new = 1 - memory.mark[SIDE]
    row = memory.mark[COUNT + new]
    if row >= memory.contact.shape[1]:
        return False
    contact = memory.contact[new, row]
    contact[FS], contact[FN], contact[OVERLAP], contact[ENERGY] = fs, fn, outlines.found.overlap[m], energy
    contact[MIDDLE_A], contact[LENGTH_A] = outlines.arc[m, 0], outlines.arc[m, 1]
    contact[MIDDLE_B], contact[LENGTH_B] = outlines.arc[m, 2], outlines.arc[m, 3]
    contact[BEFORE_X], contact[BEFORE_Y] = outlines.found.normal[m, 0], outlines.found.normal[m, 1]
    contact[ARM_A], contact[ARM_B] = arm_a, arm_b
    memory.body[new, row, 0], memory.body[new, row, 1], memory.body[new, row, 2] = a, b, memory.head[new, a]
    memory.head[new, a] = row
    memory.mark[COUNT + new] = row + 1
    return True
