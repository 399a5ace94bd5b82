"""Kernel that takes many dynamic steps at once: `ninedisk.core.cd.step.DynamicStep` by `solve_with_contacts`, without Python between.

A step that needs more sweeps than the scheme allows is left to those; what it leaves undone is no part of the state.

The set of contacts grows while its forces are found. Pairs enter that would close without contact forces, that carried a force in the
last step, or that would close if velocities stayed; later those that the motion found so far violates. A contact more than needed stays
open and changes nothing, but for those under Newton's law, whose condition does not contain the gap: these enter by the free flight and
by finished solutions alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd.contact_kernels import (
    FED,
    MISSED,
    NEARBY,
    Bodies,
    Frames,
    Laws,
    Loads,
    Start,
    carry_springs,
    closing_gaps,
    dynamic_terms,
    gap_round_off,
    measure_frames,
    note_impact_work,
    note_losses,
    place_loads,
    start_step,
    step_displacements,
    surface_displacement,
    wall_displacement,
)
from ninedisk.core.cd.problem_kernels import (
    DUALITY_GAP,
    FLOOR_GAP,
    FLOOR_MAP,
    NATURAL_MAP,
    UNRESOLVED,
    Contacts,
    body_velocities,
    contact_scales,
    contact_velocities,
    delassus_blocks,
    figures_of,
    project_on_cone,
    reached,
    sum_kinetic,
    sum_residuals,
)
from ninedisk.core.cd.solvers.gauss_seidel_kernels import next_batch, sweep
from ninedisk.core.compile import inline_kernel, kernel
from ninedisk.core.scene.motion_kernels import WallMotion, place_walls

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

DONE, LISTS, ALONE, MORE = range(4)
"""Why the kernel returns: all steps are done; the list of pairs is too short for the next one; the next one needs the long way; it
needs more sweeps, with which the next call goes on."""

CONTACT_SWEEPS = 20_000_000
"""Contacts times sweeps of one call, about a second: then Ctrl-C comes through."""

STRETCH_AFTER = 40
"""Sweeps of a step after which changes of forces are stretched: few contacts do without."""

STALLED = 3
"""Multiple of the sweeps in which the figures must have halved: else stretching ends for this step."""

LOOK_AFTER = 8
"""Sweeps after which the motion found so far is searched for pairs that it violates: it costs about as much as three."""


STEP, ITERATIONS, HELD, SWEEPS, CHOSEN, PLAIN = range(6)
"""Entries of ``counts``: last step done; sweeps of all steps; contacts in the memory; sweeps so far and contacts of the step
at hand, and 1 if its changes of forces are no longer stretched."""

WORK, WORST_MAP, WORST_GAP, REACH, WALL_REACH = range(5)
"""Entries of ``totals``: work of the walls [J]; largest residual figures that mean something; reach that the list needs for pairs of
disks and for those with walls [m]."""


class Scheme(NamedTuple):
    """Constants of a run. ``holds_rest``: where all bodies rest, the solver asks for equilibrium first; ``notes``: losses are noted."""

    dt: float
    theta: float
    tolerance: float
    sweeps: int
    most: int
    relaxation: float
    stretch: float
    coulomb: bool
    newton: bool
    notes: bool
    holds_rest: bool
    smallest: float
    radius: Floats
    bodies: Bodies
    loads: Loads
    inverse_mass: Floats
    dilation: Floats


class State(NamedTuple):
    """State of a run: centres and angles, velocities, walls, and by pair, in ascending order, the contact forces of the last step, those of
    the normal springs among them, and the shear forces with which the next step begins; ``gains`` and ``losses`` are
    those of `ninedisk.core.cd.contact_kernels.note_impact_work` and ``note_losses``.
    """

    x: Floats
    v: Floats
    wall: Floats
    pairs: Ints
    forces: Floats
    spring: Floats
    shear: Floats
    counts: Ints
    totals: Floats
    gains: Floats
    losses: Floats


class Near(NamedTuple):
    """Pairs of disks closer than ``reach[0]``, and with walls than ``reach[1]``, when disks and walls were at ``x`` and ``wall``; in the
    step at hand their frames, which of them are contacts, the shear forces of the last step and the forces found so far.
    """

    x: Floats
    wall: Floats
    reach: Floats
    frames: Frames
    closing: Floats
    inside: NDArray[np.bool_]
    shear: Floats
    force: Floats


class Chosen(NamedTuple):
    """The contacts of the step at hand with their forces, with room for all pairs: columns of `ninedisk.core.cd.problem.ContactProblem`.

    ``frames`` and ``contacts`` share the arrays of the same name.
    """

    frames: Frames
    contacts: Contacts
    offset: Floats
    shear_0: Floats
    blocks: Floats
    rho: Floats
    b: Floats
    r: Floats


class Scratch(NamedTuple):
    """Work arrays of a step, shape (n, 3) but for ``after`` (m, 11), ``sums`` and ``figures``."""

    after: Floats
    start: Start
    v: Floats
    dx: Floats
    sums: Floats
    figures: Floats


@kernel
def take_steps(
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
        if scheme.loads.disk.shape[0] > 0:
            place_loads(scheme.loads, counts[STEP] * scheme.dt, t, False, scheme.bodies.load)
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
    start_step(scheme.bodies, state.v, scheme.dt, scheme.theta, scratch.start)
    _free_velocities(scheme, scratch)
    step_displacements(scheme.bodies, scratch.start, scratch.v, scheme.dt, scheme.theta, dx)
    walls, moved, turned = (
        wall_displacement(x, state.wall, after),
        moved_since(x, near),
        wall_displacement(x, near.wall, after),
    )
    if not covers(2.0, NEARBY * scheme.smallest, moved, turned, walls, tolerance, scheme, state, near, dx):
        return LISTS
    if measure_frames(x, scheme.radius, state.wall, after, laws, near.frames) >= 0:
        return ALONE
    rests = False
    if state.counts[SWEEPS] == 0:
        for i in range(x.shape[0]):
            for d in range(3):
                scratch.v[i, d] = scheme.dt * state.v[i, d]
        begin_set(tolerance, scheme, laws, state, near, dx, scratch.v)
        rests = scheme.holds_rest and surface_displacement(scratch.v, scheme.radius) <= tolerance
    why = _solve(rests, round_off, moved, turned, walls, scheme, laws, state, near, chosen, scratch)
    if why == DONE:
        if _behind_wall(scheme, state, scratch):
            return ALONE
        _accept(round_off, scheme, laws, state, chosen, scratch)
    return why


@inline_kernel
def _behind_wall(scheme: Scheme, state: State, scratch: Scratch) -> bool:
    """Whether the step takes the centre of a free disk behind a wall."""
    x, dx, after = state.x, scratch.dx, scratch.after
    for w in range(after.shape[0]):
        px, py, nx, ny = after[w, 0], after[w, 1], after[w, 2], after[w, 3]
        for i in range(x.shape[0]):
            height = (x[i, 0] + dx[i, 0] - px) * nx + (x[i, 1] + dx[i, 1] - py) * ny
            if height <= 0.0 and (scheme.bodies.free[i, 0] or scheme.bodies.free[i, 1]):
                return True
    return False


@inline_kernel
def _pose(c: int, round_off: float, scheme: Scheme, laws: Laws, chosen: Chosen, scratch: Scratch) -> bool:
    """The contact problem of the chosen contacts; False if one can neither open nor close."""
    frames, contacts = first_frames(chosen.frames, c), first_contacts(chosen.contacts, c)
    bodies, normal, arms, mu, compliance = contacts
    offset, blocks, b = chosen.offset[:c], chosen.blocks[:c], chosen.b[:c]
    inverse = scheme.bodies.inverse
    dynamic_terms(frames, laws, inverse, scratch.start, scheme.dt, scheme.theta, round_off, offset, compliance)
    delassus_blocks(bodies, normal, arms, scheme.inverse_mass, compliance, blocks)
    for k in range(c):
        if not blocks[k, 0] > 0.0:
            return False
    contact_scales(blocks, mu, chosen.rho)
    _free_velocities(scheme, scratch)
    contact_velocities(bodies, normal, arms, scratch.v, b)
    for k in range(c):
        b[k, 0] += offset[k, 0]
        b[k, 1] += offset[k, 1] - compliance[k, 1] * chosen.shear_0[k]
    return True


@inline_kernel
def _free_velocities(scheme: Scheme, scratch: Scratch) -> None:
    """Velocities at the end of the step without contact forces."""
    for i in range(scratch.v.shape[0]):
        for d in range(3):
            scratch.v[i, d] = scheme.inverse_mass[i, d] * scratch.start.force[i, d]


@inline_kernel
def _solve(
    rests: bool,
    round_off: float,
    moved: float,
    turned: float,
    walls: float,
    scheme: Scheme,
    laws: Laws,
    state: State,
    near: Near,
    chosen: Chosen,
    scratch: Scratch,
) -> int:
    """Gauss-Seidel as `solve_gauss_seidel` does it, on a set of contacts that grows on the way; DONE, LISTS, ALONE or MORE.

    Waiting for a solution before the pairs that it violates are added would cost one solution for each of ten rounds and more.
    """
    tolerance, resolution = MISSED * round_off, round_off / (scheme.theta * scheme.dt)
    v, r, sums, figures, counts = scratch.v, chosen.r, scratch.sums, scratch.figures, state.counts
    c = choose(laws, near, chosen)
    if c > scheme.most or not _pose(c, round_off, scheme, laws, chosen, scratch):
        return ALONE
    budget, looked = counts[SWEEPS] + max(1, CONTACT_SWEEPS // (c + 1)), counts[SWEEPS]
    best, best_at = np.inf, counts[SWEEPS]
    while True:
        done = counts[SWEEPS]
        contacts = first_contacts(chosen.contacts, c)
        body_velocities(contacts.bodies, contacts.normal, contacts.arms, scheme.inverse_mass, scratch.start.force, r, v)
        sum_residuals(contacts, chosen.offset, chosen.shear_0, chosen.rho, chosen.b, v, r, scheme.coulomb, sums)
        sum_kinetic(scheme.inverse_mass, v, v, sums)
        figures_of(sums, c, resolution, figures)
        finished = reached(figures, scheme.tolerance)
        if rests and done == 0 and not finished:
            return ALONE
        if finished or done - looked >= LOOK_AFTER:
            looked = done
            step_displacements(scheme.bodies, scratch.start, v, scheme.dt, scheme.theta, scratch.dx)
            if covers(1.0, 0.0, moved, turned, walls, tolerance, scheme, state, near, scratch.dx):
                keep_forces(near, chosen)
                missed = grow_set(tolerance, finished, scheme, laws, near, scratch.dx)
                if missed < 0:
                    return ALONE
                if missed == 0 and finished:
                    counts[CHOSEN] = c
                    return DONE
                if missed > 0:
                    best, best_at = np.inf, done
                    c = choose(laws, near, chosen)
                    if c > scheme.most or not _pose(c, round_off, scheme, laws, chosen, scratch):
                        return ALONE
                    continue
            elif finished:
                return LISTS
        if done >= scheme.sweeps or done >= budget:
            keep_forces(near, chosen)
            return ALONE if done >= scheme.sweeps else MORE
        worst = max(figures[NATURAL_MAP], figures[DUALITY_GAP])
        if worst < 0.5 * best:
            best, best_at = worst, done
        elif done > STRETCH_AFTER + STALLED * best_at:
            counts[PLAIN] = 1
        stretch = scheme.stretch if done >= STRETCH_AFTER and counts[PLAIN] == 0 else 1.0
        count = min(next_batch(done), scheme.sweeps - done)
        relaxation = stretch * scheme.relaxation
        sweep(
            contacts,
            scheme.inverse_mass,
            chosen.offset,
            chosen.shear_0,
            chosen.blocks,
            relaxation,
            scheme.coulomb,
            count,
            v,
            r,
        )
        counts[SWEEPS] += count


@inline_kernel
def _accept(round_off: float, scheme: Scheme, laws: Laws, state: State, chosen: Chosen, scratch: Scratch) -> None:
    """Make the solution the state; its forces are the memory of the next step."""
    totals, figures, counts = state.totals, scratch.figures, state.counts
    c = counts[CHOSEN]
    frames = first_frames(chosen.frames, c)
    if scheme.newton:
        slack, resolution = FED * scheme.tolerance, round_off / scheme.dt
        note_impact_work(
            counts[STEP] + 1, slack, resolution, frames, chosen.blocks, laws,
            scratch.start, scratch.v, chosen.r, scheme.dt, state.gains,
        )  # fmt: skip
    carry_springs(
        frames, state.x, state.wall, scratch.after, scratch.dx, laws, scheme.bodies.inverse, scheme.dt, chosen.r,
        state.spring, state.shear,
    )  # fmt: skip
    if scheme.notes:
        note_losses(
            frames, laws, scheme.bodies, scheme.loads.steady, scratch.start, scratch.v, scratch.dx, chosen.r,
            chosen.shear_0, state.spring, scheme.dt, scheme.theta, state.losses,
        )  # fmt: skip
    for k in range(c):
        p, q = chosen.r[k, 0], chosen.r[k, 1]
        totals[WORK] -= p * (frames.gap[k] - frames.gap_before[k]) + q * frames.shift[k]
        state.pairs[k, 0], state.pairs[k, 1] = frames.pairs[k, 0], frames.pairs[k, 1]
        state.forces[k, 0], state.forces[k, 1] = p, q
    counts[HELD] = counts[CHOSEN]
    counts[ITERATIONS] += counts[SWEEPS]
    counts[SWEEPS] = counts[PLAIN] = 0
    for i in range(state.x.shape[0]):
        for d in range(3):
            state.x[i, d] += scratch.dx[i, d]
            state.v[i, d] = scratch.v[i, d] + scratch.start.prescribed[i, d]
    for w in range(state.wall.shape[0]):
        for d in range(state.wall.shape[1]):
            state.wall[w, d] = scratch.after[w, d]
    if max(figures[FLOOR_MAP], figures[FLOOR_GAP]) <= UNRESOLVED:
        totals[WORST_MAP] = max(totals[WORST_MAP], figures[NATURAL_MAP])
        totals[WORST_GAP] = max(totals[WORST_GAP], figures[DUALITY_GAP])


@inline_kernel
def first_frames(frames: Frames, c: int) -> Frames:
    """The first c frames."""
    return Frames(
        frames.pairs[:c], frames.bodies[:c], frames.row[:c], frames.normal[:c], frames.gap[:c], frames.gap_before[:c],
        frames.shift[:c], frames.arms[:c], frames.place[:c],
    )  # fmt: skip


@inline_kernel
def first_contacts(contacts: Contacts, c: int) -> Contacts:
    """The first c contacts."""
    return Contacts(
        contacts.bodies[:c], contacts.normal[:c], contacts.arms[:c], contacts.mu[:c], contacts.compliance[:c]
    )


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
    moves = surface_displacement(dx, scheme.radius)
    for_disks = max(times * (factor * 2.0 * moves + 2.0 * tolerance), least)
    for_walls = max(times * (factor * (moves + walls) + 2.0 * tolerance), least)
    state.totals[REACH], state.totals[WALL_REACH] = for_disks, for_walls
    return bool(for_disks <= near.reach[0] - 2.0 * moved and for_walls <= near.reach[1] - moved - turned)


@inline_kernel
def find_closing(scheme: Scheme, near: Near, dx: Floats) -> None:
    """Gaps of the listed pairs after the displacements ``dx``, less what sliding lifts [m], into ``near.closing``."""
    closing_gaps(near.frames, scheme.dilation, dx, near.closing)


@inline_kernel
def begin_set(
    tolerance: float, scheme: Scheme, laws: Laws, state: State, near: Near, flight: Floats, onward: Floats
) -> None:
    """Mark the pairs that a step begins with, and look up the forces of the last one.

    ``flight`` and ``onward``, shape (n, 3), are the displacements without contact forces and with the velocities of the start.
    """
    find_closing(scheme, near, onward)
    pairs, row = near.frames.pairs, near.frames.row
    at, held = 0, state.counts[HELD]
    for k in range(pairs.shape[0]):
        i, j = pairs[k, 0], pairs[k, 1]
        while at < held and (state.pairs[at, 0] < i or (state.pairs[at, 0] == i and state.pairs[at, 1] < j)):
            at += 1
        p, q = 0.0, 0.0
        near.shear[k] = 0.0
        if at < held and state.pairs[at, 0] == i and state.pairs[at, 1] == j:
            p, q = state.forces[at, 0], state.forces[at, 1]
            near.shear[k] = state.shear[at]
        near.force[k, 0], near.force[k, 1] = project_on_cone(p, q, laws.mu[row[k]])
        near.inside[k] = _needs_no_force(k, laws, near) and (p > 0.0 or near.closing[k] < tolerance)
    find_closing(scheme, near, flight)
    for k in range(near.inside.shape[0]):
        near.inside[k] |= near.closing[k] < tolerance


@inline_kernel
def grow_set(tolerance: float, finished: bool, scheme: Scheme, laws: Laws, near: Near, dx: Floats) -> int:
    """Mark the pairs outside the set that ``dx`` violates; their number, or -1 if ``dx`` is no number."""
    for i in range(dx.shape[0]):
        if not np.isfinite(dx[i, 0] + dx[i, 1] + dx[i, 2]):
            return -1
    find_closing(scheme, near, dx)
    missed = 0
    for k in range(near.inside.shape[0]):
        if not near.inside[k] and near.closing[k] < -tolerance and (finished or _needs_no_force(k, laws, near)):
            near.inside[k] = True
            near.force[k, 0] = near.force[k, 1] = 0.0
            missed += 1
    return missed


@inline_kernel
def keep_forces(near: Near, chosen: Chosen) -> None:
    """Copy the forces of the chosen contacts to their pairs."""
    c = 0
    for k in range(near.inside.shape[0]):
        if near.inside[k]:
            near.force[k, 0], near.force[k, 1] = chosen.r[c, 0], chosen.r[c, 1]
            c += 1


@inline_kernel
def choose(laws: Laws, near: Near, chosen: Chosen) -> int:
    """Copy the pairs of the set with their forces; their number."""
    c, frames, some, contacts = 0, near.frames, chosen.frames, chosen.contacts
    for k in range(near.inside.shape[0]):
        if near.inside[k]:
            for d in range(2):
                some.pairs[c, d], some.bodies[c, d] = frames.pairs[k, d], frames.bodies[k, d]
                some.normal[c, d], chosen.r[c, d] = frames.normal[k, d], near.force[k, d]
            for d in range(4):
                some.arms[c, d] = frames.arms[k, d]
            some.row[c], some.gap[c] = frames.row[k], frames.gap[k]
            some.gap_before[c], some.shift[c] = frames.gap_before[k], frames.shift[k]
            contacts.mu[c], chosen.shear_0[c] = laws.mu[frames.row[k]], near.shear[k]
            c += 1
    return c


@inline_kernel
def _needs_no_force(k: int, laws: Laws, near: Near) -> bool:
    """Whether the pair leaves the solution as it is if it is in the set and need not be.

    Its condition has to contain its gap, as all except those under Newton's law do. And an open contact has to be without force, which one
    whose shear spring is stretched by ``q/ks`` is not under the associated rule: it would hold on until the gap is ``mu`` times that.
    """
    row = near.frames.row[k]
    return bool(np.isnan(laws.restitution[row]) and (near.shear[k] == 0.0 or not laws.elastic[row]))
