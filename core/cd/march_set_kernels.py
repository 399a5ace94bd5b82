"""Kernels of the set of contacts of a step: what it is chosen from, what it begins with, how it grows, and its forces.

Pairs enter that would close without contact forces, that carried a force in the last step, or that would close if velocities stayed;
later those that the motion found so far violates. A contact more than needed stays open and changes nothing, but for those under
Newton's law, whose condition does not contain the gap: these enter by the free flight and by finished solutions alone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import inline_kernel
from ninedisk.core.cd.cone_kernels import project_on_cone
from ninedisk.core.cd.contact_kernels import Laws, closing_gaps, surface_way
from ninedisk.core.cd.march_arrays import HELD, REACH, WALL_REACH, Chosen, Near, Scheme, State

Floats = NDArray[np.float64]


@inline_kernel
def moved_since(x: Floats, near: Near) -> float:
    """How far a disk has moved since the list was made, at most [m]."""
    moved = 0.0
    for i in range(x.shape[0]):
        moved = max(moved, np.hypot(x[i, 0] - near.x[i, 0], x[i, 1] - near.x[i, 1]))
    return moved


@inline_kernel
def covers(
    times: float,
    least: float,
    moved: float,
    turned: float,
    walls: float,
    tolerance: float,
    scheme: Scheme,
    state: State,
    near: Near,
    dx: Floats,
) -> bool:
    """Whether every pair is listed that ``times`` the displacements can bring together; how far the list has to reach.

    Disks have moved by ``moved`` and walls by ``turned`` since it was made; walls move by ``walls`` in the step.
    """
    factor = 1.0
    for k in range(scheme.dilation.shape[0]):
        factor = max(factor, 1.0 + scheme.dilation[k])
    way = surface_way(dx, scheme.radius)
    for_disks = max(times * (factor * 2.0 * way + 2.0 * tolerance), least)
    for_walls = max(times * (factor * (way + walls) + 2.0 * tolerance), least)
    state.totals[REACH], state.totals[WALL_REACH] = for_disks, for_walls
    return bool(for_disks <= near.reach[0] - 2.0 * moved and for_walls <= near.reach[1] - moved - turned)


@inline_kernel
def find_closing(scheme: Scheme, near: Near, dx: Floats) -> None:
    """Gaps of the listed pairs after the displacements ``dx``, less what sliding lifts [m], into ``near.closing``."""
    closing_gaps(near.bodies, near.normal, near.arms, near.gap, near.shift, near.row, scheme.dilation, dx, near.closing)


@inline_kernel
def begin_set(
    tolerance: float, scheme: Scheme, laws: Laws, state: State, near: Near, flight: Floats, onward: Floats
) -> None:
    """Mark the pairs that a step begins with, and look up the forces of the last one.

    ``flight`` and ``onward``, shape (n, 3), are the displacements without contact forces and with the velocities of the start.
    """
    find_closing(scheme, near, onward)
    at, held = 0, state.counts[HELD]
    for k in range(near.pairs.shape[0]):
        i, j = near.pairs[k, 0], near.pairs[k, 1]
        while at < held and (state.pairs[at, 0] < i or (state.pairs[at, 0] == i and state.pairs[at, 1] < j)):
            at += 1
        p, q = 0.0, 0.0
        near.shear[k] = 0.0
        if at < held and state.pairs[at, 0] == i and state.pairs[at, 1] == j:
            p, q = state.forces[at, 0], state.forces[at, 1]
            near.shear[k] = state.shear[at]
        near.force[k, 0], near.force[k, 1] = project_on_cone(p, q, laws.mu[near.row[k]])
        near.inside[k] = _harmless(k, laws, near) and (p > 0.0 or near.closing[k] < tolerance)
    find_closing(scheme, near, flight)
    for k in range(near.pairs.shape[0]):
        near.inside[k] |= near.closing[k] < tolerance


@inline_kernel
def grow_set(tolerance: float, finished: bool, scheme: Scheme, laws: Laws, near: Near, dx: Floats) -> int:
    """Mark the pairs outside the set that ``dx`` violates; their number, or -1 if ``dx`` is no number."""
    for i in range(dx.shape[0]):
        if not np.isfinite(dx[i, 0] + dx[i, 1] + dx[i, 2]):
            return -1
    find_closing(scheme, near, dx)
    missed = 0
    for k in range(near.pairs.shape[0]):
        if not near.inside[k] and near.closing[k] < -tolerance and (finished or _harmless(k, laws, near)):
            near.inside[k] = True
            near.force[k, 0] = near.force[k, 1] = 0.0
            missed += 1
    return missed


@inline_kernel
def keep_forces(near: Near, chosen: Chosen) -> None:
    """Copy the forces of the chosen contacts to their pairs."""
    c = 0
    for k in range(near.pairs.shape[0]):
        if near.inside[k]:
            near.force[k, 0], near.force[k, 1] = chosen.r[c, 0], chosen.r[c, 1]
            c += 1


@inline_kernel
def choose(laws: Laws, near: Near, chosen: Chosen) -> int:
    """Copy the pairs of the set with their forces; their number."""
    c = 0
    for k in range(near.pairs.shape[0]):
        if near.inside[k]:
            for d in range(2):
                chosen.pairs[c, d], chosen.bodies[c, d] = near.pairs[k, d], near.bodies[k, d]
                chosen.normal[c, d], chosen.r[c, d] = near.normal[k, d], near.force[k, d]
            for d in range(4):
                chosen.arms[c, d] = near.arms[k, d]
            chosen.row[c], chosen.gap[c], chosen.mu[c] = near.row[k], near.gap[k], laws.mu[near.row[k]]
            chosen.gap_before[c], chosen.shift[c] = near.gap_before[k], near.shift[k]
            chosen.shear_0[c] = near.shear[k]
            c += 1
    return c


@inline_kernel
def _harmless(k: int, laws: Laws, near: Near) -> bool:
    """Whether the pair leaves the solution as it is if it is in the set and need not be.

    Its condition has to contain its gap, as all but those under Newton's law do. And an open contact has to be without force, which one
    whose shear spring is stretched by ``q/ks`` is not under the associated rule: it would hold on until the gap is ``mu`` times that.
    """
    by_gap = np.isnan(laws.restitution[near.row[k]])
    return bool(by_gap and (near.shear[k] == 0.0 or not laws.elastic[near.row[k]]))
