"""Kernels that write a sample: synchronised velocities, watched contacts of disks or outlines, walls, energies."""

from __future__ import annotations

from math import atan2, sqrt

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import fused_kernel, inline_kernel, kernel
from ninedisk.core.dem.plane.force_kernels import law_at_wall, law_of_pair, normal_force
from ninedisk.core.dem.plane.kick_kernels import gravity_factor, is_free, mass_of
from ninedisk.core.dem.state import (
    BETA,
    COHESION,
    COUNT,
    DASHPOT,
    ENERGY,
    FN,
    FRICTION,
    FS,
    KN,
    KR,
    KS,
    MODEL,
    OF_LAW,
    OVERLAP,
    ROLLING,
    ROLLING_DASHPOT,
    SIDE,
    SPRING,
    DiskArrays,
    Laws,
    Losses,
    NeighbourList,
    Outlines,
    Progress,
    Samples,
    StepConstants,
    System,
    WallArrays,
)
from ninedisk.core.nurbs.curve_kernels import Pose
from ninedisk.core.nurbs.features_kernels import gap_of_shapes, reach_of_shape
from ninedisk.core.pose import DASHPOT_VX, DASHPOT_VY, NORMAL_X, NORMAL_Y, PIVOT_X, PIVOT_Y, POINT_X, POINT_Y, TURN_RATE

TINY = 1e-300
"""Below every inverse mass, in the place of that of a fixed disk."""


@inline_kernel
def synchronised(value: float, acceleration: float, step: StepConstants, start: bool) -> float:
    """Velocity at ``t_n`` [m/s or rad/s]: the mean of ``v_{n-1/2}`` and ``v_{n+1/2}``; at the start the value itself."""
    if start:
        return value
    return 0.5 * (value + step.kick.keep * value + step.kick.gain * acceleration)


@inline_kernel
def synchronised_part(
    disks: DiskArrays, i: int, d: int, acceleration: float, step: StepConstants, start: bool
) -> float:
    """The same of component d of the disk in row i, which keeps it where it is held."""
    return synchronised(disks.v[i, d], acceleration, step, start or not is_free(disks, i, d))


@inline_kernel
def listed_shear(pairs: NeighbourList, row: int, other: int) -> float:
    """Shear force [N] of a pair; 0 if it is not in the list."""
    for k in range(pairs.start[row], pairs.start[row + 1]):
        if pairs.other[k] == other:
            return float(pairs.shear[k])
    return 0.0


@inline_kernel
def watched_disk_pair(
    disks: DiskArrays, pairs: NeighbourList, all_pairs: NDArray[np.float64], laws: Laws | None, i: int, j: int
) -> tuple[float, float, float]:
    """Gap [m], normal and shear force [N] of the disks in rows i and j; the same numbers from either one."""
    dx, dy = disks.x[j, 0] - disks.x[i, 0], disks.x[j, 1] - disks.x[i, 1]
    d = sqrt(dx * dx + dy * dy)
    gap = d - (disks.radius[i] + disks.radius[j])
    if gap >= 0.0:
        return gap, 0.0, 0.0
    law = all_pairs
    if laws is not None:
        law = laws.rows[law_of_pair(laws, disks, i, j)]
    dashpot_v = disks.v_now if disks.v_now.shape[0] > 0 else disks.v
    rate = ((dashpot_v[i, 0] - dashpot_v[j, 0]) * dx + (dashpot_v[i, 1] - dashpot_v[j, 1]) * dy) / d
    fn = normal_force(-gap, rate, law[KN], law[BETA], disks.inv_mass[i] + disks.inv_mass[j], law[COHESION])
    return gap, fn, listed_shear(pairs, min(i, j), max(i, j))


@inline_kernel
def watched_wall_pair(
    disks: DiskArrays, walls: WallArrays, pairs: NeighbourList, laws: Laws | None, i: int, w: int
) -> tuple[float, float, float]:
    """Gap [m], normal and shear force [N] of a disk and a wall."""
    ux, uy = walls.now[w, NORMAL_X], walls.now[w, NORMAL_Y]
    height = (disks.x[i, 0] - walls.now[w, POINT_X]) * ux + (disks.x[i, 1] - walls.now[w, POINT_Y]) * uy
    gap = height - disks.radius[i]
    if gap >= 0.0:
        return gap, 0.0, 0.0
    law = walls.law[w]
    if laws is not None:
        law = laws.rows[law_at_wall(laws, disks, i, w)]
    # The wall's normal velocity at the foot: v_pivot.u + spin (u x q) with q from the pivot to the foot.
    qx = disks.x[i, 0] - height * ux - walls.now[w, PIVOT_X]
    qy = disks.x[i, 1] - height * uy - walls.now[w, PIVOT_Y]
    dashpot_v = disks.v_now if disks.v_now.shape[0] > 0 else disks.v
    rate = walls.now[w, DASHPOT_VX] * ux + walls.now[w, DASHPOT_VY] * uy + walls.now[w, TURN_RATE] * (qx * uy - qy * ux)
    rate -= dashpot_v[i, 0] * ux + dashpot_v[i, 1] * uy
    fn = normal_force(-gap, rate, law[KN], law[BETA], disks.inv_mass[i], law[COHESION])
    return gap, fn, listed_shear(pairs, w, i)


@fused_kernel
def contact_energy(system: System) -> tuple[float, float]:
    """Elastic energy of the normal and of the shear springs [J]; a contact that is open has no shear force."""
    disks, views, walls, law = system.disks, system.views, system.walls, system.law
    pairs, wall_pairs = system.lists.pairs, system.lists.wall_pairs
    x, radius, row, other, shear_of = disks.x, disks.radius, views.row, pairs.other, pairs.shear
    squares, shears = 0.0, 0.0
    # Not row by row: how many pairs a disk has is more than the processor can guess.
    for k in range(np.uint64(pairs.start[x.shape[0]])):
        i, j = np.uint64(row[k]), np.uint64(other[k])
        dx, dy = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1]
        overlap = max(radius[i] + radius[j] - sqrt(dx * dx + dy * dy), 0.0)
        squares += overlap * overlap
        shears += shear_of[k] * shear_of[k]
    normal = 0.5 * law[KN] * squares
    shear = 0.5 * shears / law[KS] if law[KS] > 0.0 else 0.0
    for w in range(walls.now.shape[0]):
        px, py, ux, uy = walls.now[w, POINT_X], walls.now[w, POINT_Y], walls.now[w, NORMAL_X], walls.now[w, NORMAL_Y]
        squares, shears = 0.0, 0.0
        for k in range(np.uint64(wall_pairs.start[w]), np.uint64(wall_pairs.start[w + 1])):
            j = np.uint64(wall_pairs.other[k])
            overlap = max(radius[j] - ((x[j, 0] - px) * ux + (x[j, 1] - py) * uy), 0.0)
            squares += overlap * overlap
            shears += wall_pairs.shear[k] * wall_pairs.shear[k]
        normal += 0.5 * walls.law[w, KN] * squares
        if walls.law[w, KS] > 0.0:
            shear += 0.5 * shears / walls.law[w, KS]
    return normal, shear


@fused_kernel
def energy_by_laws(system: System, laws: Laws) -> tuple[float, float, float]:
    """Elastic energy of the normal, shear and rolling springs [J] where contacts have separate ``laws``."""
    disks, walls, pairs, wall_pairs = system.disks, system.walls, system.lists.pairs, system.lists.wall_pairs
    x, radius = disks.x, disks.radius
    normal, shear, rolling = 0.0, 0.0, 0.0
    for i in range(x.shape[0]):
        for k in range(pairs.start[i], pairs.start[i + 1]):
            j = int(pairs.other[k])
            law = laws.rows[law_of_pair(laws, disks, i, j)]
            dx, dy = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1]
            overlap = max(radius[i] + radius[j] - sqrt(dx * dx + dy * dy), 0.0)
            normal += 0.5 * (law[KN] - law[COHESION]) * overlap * overlap
            if law[KS] > 0.0:
                shear += 0.5 * pairs.shear[k] * pairs.shear[k] / law[KS]
            if law[MODEL] == SPRING:
                rolling += 0.5 * pairs.bending[k] * pairs.bending[k] / law[KR]
    for w in range(walls.now.shape[0]):
        px, py, ux, uy = walls.now[w, POINT_X], walls.now[w, POINT_Y], walls.now[w, NORMAL_X], walls.now[w, NORMAL_Y]
        for k in range(wall_pairs.start[w], wall_pairs.start[w + 1]):
            i = int(wall_pairs.other[k])
            law = laws.rows[law_at_wall(laws, disks, i, w)]
            overlap = max(radius[i] - ((x[i, 0] - px) * ux + (x[i, 1] - py) * uy), 0.0)
            normal += 0.5 * (law[KN] - law[COHESION]) * overlap * overlap
            if law[KS] > 0.0:
                shear += 0.5 * wall_pairs.shear[k] * wall_pairs.shear[k] / law[KS]
            if law[MODEL] == SPRING:
                rolling += 0.5 * wall_pairs.bending[k] * wall_pairs.bending[k] / law[KR]
    return normal, shear, rolling


@inline_kernel
def elastic_energy(system: System, laws: Laws | None) -> tuple[float, float, float]:
    """Elastic energy of the normal, shear and rolling springs [J]."""
    if laws is None:
        normal, shear = contact_energy(system)
        return normal, shear, 0.0
    return energy_by_laws(system, laws)


@inline_kernel
def lost_so_far(losses: Losses, channel: int) -> float:
    """Energy that contacts have lost in a channel since time 0 [J], in an order that does not depend on the number of threads."""
    total = 0.0
    for s in range(losses.contacts.shape[0]):
        total += losses.contacts[s, channel]
    return total


@inline_kernel
def lost_by_now(losses: Losses, channel: int) -> float:
    """The same at the time of a sample, to which only half of the step of a force that depends on velocities belongs."""
    return float(0.5 * (losses.before[channel] + lost_so_far(losses, channel)))


@kernel
def record_losses(system: System, losses: Losses | None, samples: Samples, row: int, start: bool) -> None:
    """Write what was lost since time 0 to row ``row`` of ``samples``."""
    if losses is None:
        return
    disks, kick = system.disks, system.step.kick
    energy = samples.energy
    energy[row, 8] = lost_so_far(losses, FRICTION)
    energy[row, 9] = lost_by_now(losses, DASHPOT) if not start else 0.0
    energy[row, 10] = lost_so_far(losses, ROLLING)
    energy[row, 10] += lost_by_now(losses, ROLLING_DASHPOT) if not start else 0.0
    taken = 0.0
    for name in range(disks.braked.shape[0]):
        i = disks.place[name]
        taken += disks.braked[i]
        if start:
            continue
        # What the damping does from t_{n-1/2} to t_n: its force is known once the velocity of t_{n+1/2} is.
        weight = gravity_factor(disks.inv_mass[i])
        for d in range(2):
            gravity = kick.gravity_x if d == 0 else kick.gravity_y
            before = disks.v[i, d]
            change = (kick.keep - 1.0) * before + kick.gain * (disks.force[i, d] * disks.inv_mass[i] + gravity)
            taken += weight * 0.5 * kick.drag * (before + kick.seen * change) * before / max(disks.inv_mass[i], TINY)
        if disks.inv_inertia[i] > 0.0:
            before = disks.omega[i]
            change = (kick.keep - 1.0) * before + kick.gain * (disks.torque[i] * disks.inv_inertia[i])
            taken += 0.5 * kick.drag * (before + kick.seen * change) * before / disks.inv_inertia[i]
    energy[row, 11] = taken
    energy[row, 12] = lost_so_far(losses, OF_LAW)


@kernel
def record(system: System, samples: Samples, row: int, start: bool, progress: Progress) -> None:
    """Write row ``row`` of ``samples`` from the state at ``t_n`` with its forces; ``start`` is True at n = 0."""
    disks, walls, step = system.disks, system.walls, system.step
    translation, rotation, gravity = 0.0, 0.0, 0.0
    for i in range(disks.x.shape[0]):
        weight = gravity_factor(disks.inv_mass[i])
        ax = disks.force[i, 0] * disks.inv_mass[i] + weight * step.kick.gravity_x
        ay = disks.force[i, 1] * disks.inv_mass[i] + weight * step.kick.gravity_y
        vx, vy = synchronised_part(disks, i, 0, ax, step, start), synchronised_part(disks, i, 1, ay, step, start)
        mass = mass_of(disks, i)
        translation += 0.5 * mass * (vx * vx + vy * vy)
        gravity -= mass * (step.kick.gravity_x * disks.x[i, 0] + step.kick.gravity_y * disks.x[i, 1])
        if disks.inv_inertia[i] > 0.0:
            spin = synchronised(disks.omega[i], disks.torque[i] * disks.inv_inertia[i], step, start)
            rotation += 0.5 * spin * spin / disks.inv_inertia[i]
    for c in range(samples.chosen.shape[0]):
        i = disks.place[samples.chosen[c]]
        weight = gravity_factor(disks.inv_mass[i])
        ax = disks.force[i, 0] * disks.inv_mass[i] + weight * step.kick.gravity_x
        ay = disks.force[i, 1] * disks.inv_mass[i] + weight * step.kick.gravity_y
        samples.x[row, c, 0], samples.x[row, c, 1] = disks.x[i, 0], disks.x[i, 1]
        samples.v[row, c, 0] = synchronised_part(disks, i, 0, ax, step, start)
        samples.v[row, c, 1] = synchronised_part(disks, i, 1, ay, step, start)
        samples.angle[row, c] = disks.angle[i]
        samples.omega[row, c] = disks.omega[i]
        if disks.inv_inertia[i] > 0.0:
            spin_rate = disks.torque[i] * disks.inv_inertia[i]
            samples.omega[row, c] = synchronised(disks.omega[i], spin_rate, step, start)
    n = disks.x.shape[0]
    for c in range(samples.pairs.shape[0]):
        i, j = int(disks.place[samples.pairs[c, 0]]), samples.pairs[c, 1]
        if j < n:
            other = int(disks.place[j])
            gap, fn, fs = watched_disk_pair(disks, system.lists.pairs, system.law, system.laws, i, other)
        else:
            gap, fn, fs = watched_wall_pair(disks, walls, system.lists.wall_pairs, system.laws, i, j - n)
        samples.gap[row, c], samples.fn[row, c], samples.fs[row, c] = gap, fn, fs
    for w in range(walls.now.shape[0]):
        samples.wall_point[row, w, 0], samples.wall_point[row, w, 1] = walls.now[w, POINT_X], walls.now[w, POINT_Y]
        samples.wall_angle[row, w] = atan2(walls.now[w, NORMAL_Y], walls.now[w, NORMAL_X])
        samples.wall_force[row, w, 0], samples.wall_force[row, w, 1] = walls.load[w, 0], walls.load[w, 1]
    normal, shear, rolling = elastic_energy(system, system.laws)
    samples.energy[row, 0], samples.energy[row, 1] = translation, rotation
    samples.energy[row, 2], samples.energy[row, 3], samples.energy[row, 4] = normal, shear, gravity
    samples.energy[row, 5], samples.energy[row, 6], samples.energy[row, 7] = rolling, progress.work[0], progress.work[1]
    record_losses(system, system.losses, samples, row, start)


@inline_kernel
def contacts_between(outlines: Outlines, a: int, b: int) -> tuple[float, float, float]:
    """Largest overlap [m], and the sums of normal and shear forces [N], of all contacts of bodies a and b; zeros if there is none."""
    memory = outlines.memory
    side = memory.mark[SIDE]
    row = memory.head[side, a]
    overlap, fn, fs = 0.0, 0.0, 0.0
    while row >= 0:
        if memory.body[side, row, 1] == b:
            overlap = max(overlap, memory.contact[side, row, OVERLAP])
            fn += memory.contact[side, row, FN]
            fs += memory.contact[side, row, FS]
        row = memory.body[side, row, 2]
    return overlap, fn, fs


@inline_kernel
def pair_gap(disks: DiskArrays, outlines: Outlines, a: int, b: int) -> float:
    """Smallest distance [m] of two bodies that do not touch."""
    i, j = int(disks.place[a]), int(disks.place[b])
    dx, dy = disks.x[j, 0] - disks.x[i, 0], disks.x[j, 1] - disks.x[i, 1]
    if outlines.round[a] and outlines.round[b]:
        return float(sqrt(dx * dx + dy * dy) - (disks.radius[i] + disks.radius[j]))
    c, s, p, q = outlines.turn[a, 0], outlines.turn[a, 1], outlines.turn[b, 0], outlines.turn[b, 1]
    pose = Pose(c * p + s * q, c * q - s * p, c * dx + s * dy, c * dy - s * dx)
    return gap_of_shapes(outlines.table, outlines.shape[a], outlines.shape[b], pose)


@inline_kernel
def wall_gap(disks: DiskArrays, walls: WallArrays, outlines: Outlines, a: int, w: int) -> float:
    """Smallest distance [m] of a body from a wall, negative where it is deeper than the wall's surface."""
    i = int(disks.place[a])
    ux, uy = walls.now[w, NORMAL_X], walls.now[w, NORMAL_Y]
    height = (disks.x[i, 0] - walls.now[w, POINT_X]) * ux + (disks.x[i, 1] - walls.now[w, POINT_Y]) * uy
    if outlines.round[a]:
        return float(height - disks.radius[i])
    c, s = outlines.turn[a, 0], outlines.turn[a, 1]
    reach = reach_of_shape(outlines.table, outlines.shape[a], -c * ux - s * uy, s * ux - c * uy)
    return float(height - reach)


@kernel
def record_contacts(system: System, outlines: Outlines, samples: Samples, row: int) -> None:
    """Write watched pairs and elastic energies to row ``row`` of ``samples``, in the place of what `record` takes them to be on disks.

    A pair's gap is the smallest one: the negative of the largest overlap of its contacts, or the distance of its outlines; its forces are
    the sums over its contacts, each along its own normal and tangent.
    """
    disks, walls, law = system.disks, system.walls, system.law
    n = disks.x.shape[0]
    for c in range(samples.pairs.shape[0]):
        a, b = int(samples.pairs[c, 0]), int(samples.pairs[c, 1])
        overlap, fn, fs = contacts_between(outlines, a, b)
        gap = -overlap
        if overlap == 0.0:
            gap = pair_gap(disks, outlines, a, b) if b < n else wall_gap(disks, walls, outlines, a, b - n)
        samples.gap[row, c], samples.fn[row, c], samples.fs[row, c] = gap, fn, fs
    memory = outlines.memory
    side = memory.mark[SIDE]
    normal, shear = 0.0, 0.0
    for k in range(memory.mark[COUNT + side]):
        b, fs = memory.body[side, k, 1], memory.contact[side, k, FS]
        ks = law[KS] if b < n else walls.law[b - n, KS]
        normal += memory.contact[side, k, ENERGY]
        if ks > 0.0:
            shear += 0.5 * fs * fs / ks
    samples.energy[row, 2], samples.energy[row, 3] = normal, shear
