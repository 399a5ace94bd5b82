"""Kernel that takes many dynamic steps at once: the same step as `DynamicStep` by `solve_with_contacts`, without Python between.

A step that needs more than a few sweeps over the contacts found at its start is left to those: it is not begun.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd._jit import inline_kernel, kernel
from ninedisk.core.cd.cone_kernels import project_on_cone
from ninedisk.core.cd.contact_kernels import (
    body_velocities,
    contact_scales,
    contact_velocities,
    delassus_blocks,
)
from ninedisk.core.cd.frame_kernels import (
    MISSED,
    NEARBY,
    Laws,
    closing_gaps,
    contact_compliances,
    dynamic_offsets,
    gap_round_off,
    measure_frames,
    surface_way,
    wall_way,
)
from ninedisk.core.cd.gauss_seidel_kernels import next_batch, sweep
from ninedisk.core.cd.march_arrays import (
    HELD,
    ITERATIONS,
    REACH,
    STEP,
    WORK,
    WORST_GAP,
    WORST_MAP,
    Chosen,
    Near,
    Scheme,
    Scratch,
    State,
)
from ninedisk.core.cd.residual_kernels import (
    DUALITY_GAP,
    FLOOR_GAP,
    FLOOR_MAP,
    NATURAL_MAP,
    UNRESOLVED,
    figures_of,
    reached,
    sum_kinetic,
    sum_residuals,
)
from ninedisk.core.geometry.motion_kernels import WallMotion, place_walls

Floats = NDArray[np.float64]

DONE, LISTS, ALONE = range(3)
"""Why the kernel returns: all steps are done; the list of pairs is too short for the next one; the next one needs the long way."""


@kernel
def march(
    last: int,
    scheme: Scheme,
    laws: Laws,
    motion: WallMotion,
    state: State,
    near: Near,
    chosen: Chosen,
    scratch: Scratch,
) -> int:
    """Advance to step ``last`` or as far as it goes; DONE, LISTS or ALONE. What is not done leaves no trace in ``state``."""
    counts = state.counts
    while counts[STEP] < last:
        t = (counts[STEP] + 1) * scheme.dt
        place_walls(motion, t, t, t, scratch.after)
        why = _step(scheme, laws, state, near, chosen, scratch)
        if why != DONE:
            return why
        counts[STEP] += 1
    return DONE


@inline_kernel
def _step(scheme: Scheme, laws: Laws, state: State, near: Near, chosen: Chosen, scratch: Scratch) -> int:
    x, after, dx = state.x, scratch.after, scratch.dx
    round_off = gap_round_off(x, scheme.radius, after)
    tolerance = MISSED * round_off
    _loads(scheme, state.v, scratch)
    for i in range(x.shape[0]):
        for d in range(3):
            scratch.v[i, d] = scheme.inverse_mass[i, d] * scratch.force[i, d]
    _displacements(scheme, state.v, scratch)
    walls = wall_way(x, state.wall, after)
    covered = _covered(x, after, near)
    needed = max(2.0 * _reach_of(scheme, dx, walls, tolerance), NEARBY * scheme.smallest)
    state.totals[REACH] = needed
    if not needed <= covered:
        return LISTS
    measure_frames(near.pairs, near.row, x, scheme.radius, state.wall, after, laws,
                   near.normal, near.gap, near.gap_before, near.shift, near.arms)  # fmt: skip
    closing_gaps(near.bodies, near.normal, near.arms, near.gap, near.shift, near.row, scheme.dilation, dx, near.closing)
    c = _choose(tolerance, near, chosen)
    if not _pose(c, scheme, laws, state, chosen, scratch):
        return ALONE
    sweeps = _solve(c, round_off / (scheme.theta * scheme.dt), scheme, chosen, scratch)
    if sweeps < 0:
        return ALONE
    _displacements(scheme, state.v, scratch)
    needed = _reach_of(scheme, dx, walls, tolerance)
    if not needed <= covered:
        state.totals[REACH] = needed
        return LISTS
    if _misses(tolerance, scheme, near, dx):
        return ALONE
    _accept(c, sweeps, state, chosen, scratch)
    return DONE


@inline_kernel
def _loads(scheme: Scheme, v: Floats, scratch: Scratch) -> None:
    """Right-hand side of the momentum balance, and the velocities at the start split into free and prescribed ones."""
    rate = 1.0 / scheme.dt - (1.0 - scheme.theta) * scheme.xi
    for i in range(v.shape[0]):
        for d in range(3):
            if scheme.free[i, d]:
                scratch.force[i, d] = scheme.load[i, d] + scheme.mass[i, d] * v[i, d] * rate
                scratch.kept[i, d], scratch.prescribed[i, d] = v[i, d], 0.0
            else:
                scratch.force[i, d] = scratch.kept[i, d] = 0.0
                scratch.prescribed[i, d] = v[i, d]


@inline_kernel
def _displacements(scheme: Scheme, v: Floats, scratch: Scratch) -> None:
    """``dx`` of the velocities ``scratch.v`` at the end of the step."""
    for i in range(v.shape[0]):
        for d in range(3):
            rate = scratch.prescribed[i, d]
            if scheme.free[i, d]:
                rate = scheme.theta * scratch.v[i, d] + (1.0 - scheme.theta) * v[i, d]
            scratch.dx[i, d] = scheme.dt * rate


@inline_kernel
def _reach_of(scheme: Scheme, dx: Floats, walls: float, tolerance: float) -> float:
    factor = 1.0
    for k in range(scheme.dilation.shape[0]):
        factor = max(factor, 1.0 + scheme.dilation[k])
    return factor * (2.0 * surface_way(dx, scheme.radius) + walls) + 2.0 * tolerance


@inline_kernel
def _covered(x: Floats, after: Floats, near: Near) -> float:
    """Gap below which every pair of the step is in the list [m], after what moved since it was made."""
    moved = 0.0
    for i in range(x.shape[0]):
        moved = max(moved, np.hypot(x[i, 0] - near.x[i, 0], x[i, 1] - near.x[i, 1]))
    return float(near.reach[0] - 2.0 * moved - wall_way(x, near.wall, after))


@inline_kernel
def _choose(tolerance: float, near: Near, chosen: Chosen) -> int:
    """Copy the pairs that close without contact forces; their number."""
    c = 0
    for k in range(near.pairs.shape[0]):
        near.inside[k] = near.closing[k] < tolerance
        if near.inside[k]:
            for d in range(2):
                chosen.pairs[c, d], chosen.bodies[c, d] = near.pairs[k, d], near.bodies[k, d]
                chosen.normal[c, d] = near.normal[k, d]
            for d in range(4):
                chosen.arms[c, d] = near.arms[k, d]
            chosen.row[c], chosen.gap[c] = near.row[k], near.gap[k]
            chosen.gap_before[c], chosen.shift[c] = near.gap_before[k], near.shift[k]
            c += 1
    return c


@inline_kernel
def _pose(c: int, scheme: Scheme, laws: Laws, state: State, chosen: Chosen, scratch: Scratch) -> bool:
    """The contact problem of the step; False if a contact can neither open nor close."""
    bodies, normal, arms, row = chosen.bodies[:c], chosen.normal[:c], chosen.arms[:c], chosen.row[:c]
    compliance, offset, blocks, mu, b = (
        chosen.compliance[:c], chosen.offset[:c], chosen.blocks[:c], chosen.mu[:c], chosen.b[:c],
    )  # fmt: skip
    contact_compliances(row, laws, scheme.theta * scheme.dt, compliance)
    dynamic_offsets(bodies, normal, chosen.gap, chosen.gap_before, chosen.shift, arms, row, laws,
                    scratch.kept, scratch.prescribed, scheme.dt, scheme.theta, offset)  # fmt: skip
    delassus_blocks(bodies, normal, arms, scheme.inverse_mass, compliance, blocks)
    at, held = 0, state.counts[HELD]
    for k in range(c):
        if not blocks[k, 0] > 0.0:
            return False
        mu[k] = laws.mu[row[k]]
        i, j = chosen.pairs[k, 0], chosen.pairs[k, 1]
        while at < held and (state.pairs[at, 0] < i or (state.pairs[at, 0] == i and state.pairs[at, 1] < j)):
            at += 1
        p, q = 0.0, 0.0
        if at < held and state.pairs[at, 0] == i and state.pairs[at, 1] == j:
            p, q = state.forces[at, 0], state.forces[at, 1]
        chosen.shear_0[k] = q
        chosen.r[k, 0], chosen.r[k, 1] = project_on_cone(p, q, mu[k])
    contact_scales(blocks, mu, chosen.rho)
    contact_velocities(bodies, normal, arms, scratch.v, b)  # of the free flight, which scratch.v still holds
    for k in range(c):
        b[k, 0] += offset[k, 0]
        b[k, 1] += offset[k, 1] - compliance[k, 1] * chosen.shear_0[k]
    return True


@inline_kernel
def _solve(c: int, resolution: float, scheme: Scheme, chosen: Chosen, scratch: Scratch) -> int:
    """Gauss-Seidel as `solve_gauss_seidel` does it; the number of sweeps, or -1 where ``scheme.sweeps`` are not enough."""
    bodies, normal, arms, offset = chosen.bodies[:c], chosen.normal[:c], chosen.arms[:c], chosen.offset[:c]
    v, r, sums, figures = scratch.v, chosen.r, scratch.sums, scratch.figures
    done = 0
    while True:
        body_velocities(bodies, normal, arms, scheme.inverse_mass, scratch.force, r, v)
        sum_residuals(bodies, normal, arms, offset, chosen.compliance, chosen.shear_0, chosen.mu, chosen.rho, chosen.b,
                      v, r, scheme.coulomb, sums)  # fmt: skip
        sum_kinetic(scheme.inverse_mass, v, v, sums)
        figures_of(sums, c, resolution, figures)
        if reached(figures, scheme.tolerance):
            return done
        if done >= scheme.sweeps:
            return -1
        count = min(next_batch(done), scheme.sweeps - done)
        sweep(bodies, normal, arms, scheme.inverse_mass, offset, chosen.compliance, chosen.shear_0, chosen.mu,
              chosen.blocks, scheme.relaxation, scheme.coulomb, count, v, r)  # fmt: skip
        done += count


@inline_kernel
def _misses(tolerance: float, scheme: Scheme, near: Near, dx: Floats) -> bool:
    """Whether a pair outside the contacts is violated by the solution, or the solution is no number."""
    for i in range(dx.shape[0]):
        if not np.isfinite(dx[i, 0] + dx[i, 1] + dx[i, 2]):
            return True
    closing_gaps(near.bodies, near.normal, near.arms, near.gap, near.shift, near.row, scheme.dilation, dx, near.closing)
    missed = False
    for k in range(near.pairs.shape[0]):
        missed |= not near.inside[k] and near.closing[k] < -tolerance
    return missed


@inline_kernel
def _accept(c: int, sweeps: int, state: State, chosen: Chosen, scratch: Scratch) -> None:
    """Make the solution the state; its forces are the memory of the next step."""
    totals, figures = state.totals, scratch.figures
    for k in range(c):
        p, q = chosen.r[k, 0], chosen.r[k, 1]
        totals[WORK] -= p * (chosen.gap[k] - chosen.gap_before[k]) + q * chosen.shift[k]
        state.pairs[k, 0], state.pairs[k, 1] = chosen.pairs[k, 0], chosen.pairs[k, 1]
        state.forces[k, 0], state.forces[k, 1] = p, q
    state.counts[HELD] = c
    state.counts[ITERATIONS] += sweeps
    for i in range(state.x.shape[0]):
        for d in range(3):
            state.x[i, d] += scratch.dx[i, d]
            state.v[i, d] = scratch.v[i, d] + scratch.prescribed[i, d]
    for w in range(state.wall.shape[0]):
        for d in range(state.wall.shape[1]):
            state.wall[w, d] = scratch.after[w, d]
    if max(figures[FLOOR_MAP], figures[FLOOR_GAP]) <= UNRESOLVED:
        totals[WORST_MAP] = max(totals[WORST_MAP], figures[NATURAL_MAP])
        totals[WORST_GAP] = max(totals[WORST_GAP], figures[DUALITY_GAP])
