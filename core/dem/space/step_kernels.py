"""Kernels of the steps of the DEM of spheres, several at once, side by side in threads.

Leapfrog: ``v_{n+1/2} = v_{n-1/2} + dt F_n/m``, ``x_{n+1} = x_n + dt v_{n+1/2}``, begun by half a kick.

Spheres are divided into stripes of layers of cells, whose pairs reach no further than the next stripe. A step goes through the stripes in
ascending order and kicks the spheres of a stripe as soon as their forces are complete. Step n of stripe s thus needs of the step before
nothing but stripe s + 1, so that a step can follow the one before at a distance of a stripe:

- in one thread, which takes `Plan.front` steps through the stripes together, so that a stripe's numbers are used so many times before
  others drive them out of the caches;
- in several ones, each with its own steps.

Every sum is formed in an order that depends on neither.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ninedisk.core.compile import fused_kernel, inline_kernel, kernel
from ninedisk.core.dem.loads_kernels import share_of_kick
from ninedisk.core.dem.plane.kick_kernels import NUMBER, farther
from ninedisk.core.dem.space.force_kernels import forces_of_planes, forces_of_spheres
from ninedisk.core.dem.space.image_kernels import POWER, beside_flow, clear_share, displacement_limit, place_cell
from ninedisk.core.dem.space.plane_kernels import place_planes
from ninedisk.core.dem.space.registers import blend, scale
from ninedisk.core.dem.space.scratch_kernels import FOUR, ONE, TWO
from ninedisk.core.dem.space.state import (
    Contacts,
    Desk,
    Floats,
    Images,
    Integers,
    Losses,
    Motion,
    Planes,
    Pushes,
    State,
    Step,
)
from ninedisk.core.dem.space.vector_kernels import cross, dot, plus, row, scaled
from ninedisk.core.thread_kernels import PAD, signal, wait_for_all, wait_until

SURE = 1.001
"""Squared displacements count a thousandth more: 5e-6 mean radii of the least skin, far above the rounding of any distance."""

BLOCK = 512
"""Spheres whose forces are found before they are kicked, so many as stay in the second cache."""

STEP, PENDING, BUILT, REBUILDS, DUE = range(5)
"""Entries of the clock: contact steps done, 1 while the forces of this step are missing, step of the last rebuild, rebuilds so far, step
at which displacements are foreseen next."""

BATCH = 8
"""Steps from one look at the displacements to the next, which can be done at once."""

FORESEEN = 2 * BATCH + 2
"""Steps that a look foresees at the present velocities: more than are left to the next one, since spheres are accelerated on the way."""

OK, FAR, BEHIND, AGAIN = range(4)
"""Why `advance` ended: all steps done; the lists of neighbours are too old; a centre is behind a plane; one of the two happened within
steps that were done at once, from which there is no way back to it."""

NOW, MIDDLE, BEFORE = range(3)
"""Poses of a step: at its end, in its middle, at its begin."""


class Assembly(NamedTuple):
    """What moves, the lists of what may touch, the rows of the laws, and forces on single spheres."""

    state: State
    pairs: Contacts
    at_planes: Contacts
    laws: Floats
    pushes: Pushes


class Damping(NamedTuple):
    """Scalars of a kick with global damping, as in `ninedisk.core.dem.state.Kick`: ``v+ = keep v- + gain F/m``."""

    keep: float
    gain: float
    ahead: float
    drag: float
    seen: float
    mean: float


class Scheme(NamedTuple):
    """How a run steps: gravity [m/s^2], contact step [s], skin [m], whether dashpots see the velocities of the step's end, and global
    damping: whether there is any, in the half kick from ``t_0`` and in all later ones."""

    gravity: Floats
    dt: float
    skin: float
    central: bool
    damped: bool
    first: Damping
    later: Damping


class Plan(NamedTuple):
    """What `advance` is to do: steps until ``target``, at most ``at_once`` of them (1..BATCH) at a time, ``front`` in a thread.

    The forces of ``block`` spheres are found before they are kicked.
    """

    target: int
    at_once: int
    front: int
    block: int


class Batch(NamedTuple):
    """What the threads of a run share; s stripes, t threads, m planes.

    Attributes
    ----------
    stripe : ndarray of int64, shape (s + 1,)
        First row of each stripe; unused stripes are empty.
    flags, done : ndarray of int64, shape (t * PAD,)
        Barrier, and how far each thread is in the present steps.
    far : ndarray, shape (t * PAD,)
        Largest squared displacement since the last rebuild [m^2] among those of each thread: within its steps, and after the last one.
    pose : ndarray, shape (BATCH, 3, m, POSE_WIDTH)
        Planes in each step: `NOW`, `MIDDLE`, `BEFORE`.
    scratch, picked : ndarray
        Each thread's own, see `ninedisk.core.dem.space.state.Desk`; the rest keeps two threads' apart.
    """

    stripe: Integers
    flags: Integers
    done: Integers
    far: Floats
    pose: Floats
    scratch: Floats
    picked: Integers


@inline_kernel
def farthest(x: Floats, built: Floats, begin: int, end: int) -> float:
    """Largest square of the displacements from ``built`` to ``x`` of the spheres ``begin .. end-1`` [m^2]; NaN if any is NaN
    (`ninedisk.core.dem.plane.kick_kernels`)."""
    bits = np.int64(0)
    for i in range(np.uint64(begin), np.uint64(end)):
        k = FOUR * i
        a, b, c = x[k] - built[k], x[k + ONE] - built[k + ONE], x[k + TWO] - built[k + TWO]
        bits = max(bits, np.int64(np.float64(a * a + b * b + c * c).view(np.int64) & NUMBER))
    return float(np.int64(bits).view(np.float64))


@kernel
def foreseen(state: State, lag: float, begin: int, end: int) -> float:
    """Largest squared displacement since the last rebuild [m^2] of the spheres ``begin .. end-1``, now or after another time ``lag`` [s] at
    their present velocities; NaN if any is NaN."""
    x, built, v = state.x, state.built, state.v
    far = farthest(x, built, begin, end)
    for i in range(np.uint64(begin), np.uint64(end)):
        k = FOUR * i
        a, b = x[k] - built[k] + lag * v[k], x[k + ONE] - built[k + ONE] + lag * v[k + ONE]
        c = x[k + TWO] - built[k + TWO] + lag * v[k + TWO]
        far = farther(far, a * a + b * b + c * c)
    return far


@inline_kernel
def brake(state: State, damping: Damping, begin: int, end: int) -> None:
    """Energy that global damping takes from the spheres ``begin .. end-1`` in the kick that follows [J], into ``state.braked``."""
    v, omega, force, torque, mobility = state.v, state.omega, state.force, state.torque, state.mobility
    keep, gain, seen, mean = damping.keep, damping.gain, damping.seen, damping.mean
    for i in range(np.uint64(begin), np.uint64(end)):
        taken = 0.0
        for c in range(np.uint64(3)):
            q = FOUR * i + c
            if mobility[q] > 0.0:
                change = (keep - 1.0) * v[q] + gain * mobility[q] * force[q]
                taken += (v[q] + seen * change) * (v[q] + mean * change) / mobility[q]
            if state.inv_inertia[i] > 0.0:
                change = (keep - 1.0) * omega[q] + gain * state.inv_inertia[i] * torque[q]
                taken += (omega[q] + seen * change) * (omega[q] + mean * change) / state.inv_inertia[i]
        state.braked[i] += damping.drag * taken


@inline_kernel
def damped_kick(state: State, scheme: Scheme, first: bool, begin: int, end: int) -> None:
    """Velocities and spins of the spheres ``begin .. end-1`` to ``t_{n+1/2}`` under global damping; what is held keeps its own."""
    v, omega, mobility, inv_inertia = state.v, state.omega, state.mobility, state.inv_inertia
    damping = scheme.first if first else scheme.later
    if state.braked.shape[0] > 0:
        brake(state, damping, begin, end)
    less, gain, ahead = damping.keep - 1.0, damping.gain, damping.ahead
    sees_spins = state.omega_now.shape[0] > 0
    for q in range(FOUR * np.uint64(begin), FOUR * np.uint64(end)):
        change = (less if mobility[q] > 0.0 else 0.0) * v[q] + gain * mobility[q] * state.force[q]
        v[q] += change
        if scheme.central:
            state.v_now[q] = v[q] + ahead * change
    for i in range(np.uint64(begin), np.uint64(end)):
        for c in range(np.uint64(3)):
            k = FOUR * i + c
            change = (less if inv_inertia[i] > 0.0 else 0.0) * omega[k] + gain * inv_inertia[i] * state.torque[k]
            omega[k] += change
            if sees_spins:
                state.omega_now[k] = omega[k] + ahead * change


@fused_kernel
def kick_and_drift(state: State, scheme: Scheme, first: bool, begin: int, end: int) -> float:
    """Velocities to ``t_{n+1/2}``, positions to ``t_{n+1}`` of the spheres ``begin .. end-1``; their forces become their weights.

    ``first``: from ``t_0``, by half a kick. Each loop writes to few arrays, so that the compiler can take several spheres at a time.

    Returns
    -------
    float
        Largest squared displacement since the last rebuild of the lists [m^2]; NaN if any is NaN.
    """
    x, v, omega, angle, force, torque = state.x, state.v, state.omega, state.angle, state.force, state.torque
    mobility, inv_inertia, mass, v_now = state.mobility, state.inv_inertia, state.mass, state.v_now
    dt, gravity = scheme.dt, scheme.gravity
    kick, ahead = (0.5 * dt, 1.0) if first else (dt, 0.5)
    low, high = FOUR * np.uint64(begin), FOUR * np.uint64(end)
    sees_spins = state.omega_now.shape[0] > 0
    if scheme.damped:
        damped_kick(state, scheme, first, begin, end)
    elif scheme.central:
        for q in range(low, high):
            gain = kick * mobility[q] * force[q]
            v[q] += gain
            v_now[q] = v[q] + ahead * gain
    else:
        for q in range(low, high):
            v[q] += kick * mobility[q] * force[q]
    for q in range(low, high):
        x[q] += dt * v[q]
    for i in range(np.uint64(begin), np.uint64(end)):
        if not scheme.damped:
            blend(omega, i, 1.0, omega, i, kick * inv_inertia[i], torque, i)
            if sees_spins:
                blend(state.omega_now, i, 1.0, omega, i, ahead * kick * inv_inertia[i], torque, i)
        blend(angle, i, 1.0, angle, i, dt, omega, i)
        scale(force, i, mass[i], gravity, np.uint64(0))
    for q in range(low, high):
        torque[q] = 0.0
    return farthest(x, state.built, begin, end)


@inline_kernel
def planes_of(pose: Floats) -> Planes:
    """Planes of a step, from a table of shape (3, m, POSE_WIDTH)."""
    return Planes(pose[NOW], pose[MIDDLE], pose[BEFORE])


@inline_kernel
def push(
    state: State, pushes: Pushes, losses: Losses | None, n: int, dt: float, low: int, high: int, slot: int
) -> None:
    """Add to the forces of the rows ``low .. high-1`` those of `AnyScene.forces`, as means over the time of the kick from ``t_n``; their
    work in the step that ended at ``t_n`` goes to the slot, by the trapezoidal rule."""
    for k in range(np.searchsorted(pushes.row, low), np.searchsorted(pushes.row, high)):
        first = FOUR * np.uint64(pushes.row[k])
        now, before = share_of_kick(pushes.time[k], n, dt), share_of_kick(pushes.time[k], n - 1, dt)
        power = 0.0
        for c in range(3):
            q = first + np.uint64(c)
            power += pushes.load[k, c] * state.v[q] + pushes.load[k, 3 + c] * state.omega[q]
            state.force[q] += now * pushes.load[k, c]
            state.torque[q] += now * pushes.load[k, 3 + c]
        if losses is not None and n > 0:
            losses.fed[slot] += 0.5 * dt * (now + before) * power


@inline_kernel
def kicked(state: State, images: Images | None, scheme: Scheme, n: int, begin: int, end: int) -> float:
    """`kick_and_drift` after step n, in a periodic cell with the largest displacement beside its flow."""
    far = kick_and_drift(state, scheme, n == 0, begin, end)
    if images is not None:
        return beside_flow(state, images, (n + 1) * scheme.dt, begin, end)
    return far


@inline_kernel
def step_of_stripe(
    bodies: Assembly, losses: Losses | None, images: Images | None, batch: Batch, scheme: Scheme, plan: Plan,
    n: int, level: int, s: int, thread: int,
) -> float:  # fmt: skip
    """Forces of the rows of a stripe in step n; unless it is the last one the stripe's spheres are kicked, too.

    Rows ascend, and so do those of the stripe before: a sphere that has been a row has all its forces, and no later row reads it.

    Returns
    -------
    float
        What `kick_and_drift` does, 0 if the step is the last one.
    """
    state, laws, planes = bodies.state, bodies.laws, planes_of(batch.pose[level])
    moves_on = n < plan.target
    step = Step(
        slip_dt=scheme.dt if n > 0 else 0.0,
        loss_dt=scheme.dt if n > 0 else 0.5 * scheme.dt,
        central=scheme.central,
        keep=not moves_on,
    )
    desk = Desk(level * (batch.stripe.shape[0] - 1) + s, batch.scratch[thread], batch.picked[thread])
    for w in range(state.share.shape[1]):
        for c in range(3):
            state.share[desk.slot, w, c] = 0.0
            if losses is not None:
                losses.torque[desk.slot, w, c] = 0.0
    if losses is not None:
        losses.fed[desk.slot] = 0.0
    if losses is not None and not moves_on:
        for c in range(losses.before.shape[1]):
            losses.before[s, c] = losses.contacts[s, c]
    if images is not None:
        clear_share(images)
    far, end = 0.0, batch.stripe[s + 1]
    for low in range(batch.stripe[s], end, plan.block):
        high = min(low + plan.block, end)
        if bodies.pushes.row.shape[0] > 0:
            push(state, bodies.pushes, losses, n, scheme.dt, low, high, desk.slot)
        forces_of_spheres(state, bodies.pairs, laws, losses, images, step, low, high, desk)
        forces_of_planes(state, planes, bodies.at_planes, laws, losses, step, low, high, desk)
        if moves_on:
            far = farther(far, kicked(state, images, scheme, n, low, high))
    return far


@inline_kernel
def any_behind_plane(state: State) -> bool:
    """Whether a stripe has noted a centre behind a plane in a step."""
    found = False
    for slot in range(state.behind.shape[0]):
        found = found or state.behind[slot, 0] > 0
    return found


@inline_kernel
def moved_too_far(far: float, skin: float) -> bool:
    """Whether a squared displacement [m^2] exceeds half of the skin, or is NaN."""
    return not 4.0 * SURE * far < skin * skin


@inline_kernel
def farthest_of_all(batch: Batch, which: int, threads: int) -> float:
    """Largest squared displacement that the threads have noted [m^2]."""
    far = 0.0
    for other in range(threads):
        far = farther(far, batch.far[other * PAD + which])
    return far


@inline_kernel
def gather_loads(state: State, level: int, stripes: int) -> None:
    """Loads of the planes in a step, from the shares in the order of the stripes."""
    for w in range(state.load.shape[0]):
        for c in range(3):
            total = 0.0
            for s in range(stripes):
                total += state.share[level * stripes + s, w, c]
            state.load[w, c] = total


@inline_kernel
def work_of_step(state: State, planes: Planes, losses: Losses, dt: float, level: int, stripes: int) -> None:
    """Add the work on the spheres in a step: of the planes, forces and torques by the trapezoidal rule, and of forces on single spheres."""
    loads = losses.loads
    for w in range(state.load.shape[0]):
        for c in range(6):
            loads[w, 1, c] = loads[w, 0, c]
        for c in range(3):
            loads[w, 0, c], loads[w, 0, 3 + c] = state.load[w, c], 0.0
            for s in range(stripes):
                loads[w, 0, 3 + c] += losses.torque[level * stripes + s, w, c]
        force = scaled(plus(row(loads[w], 0, 0), 1.0, row(loads[w], 1, 0)), 0.5)
        torque = scaled(plus(row(loads[w], 0, 3), 1.0, row(loads[w], 1, 3)), 0.5)
        torque = plus(torque, -1.0, cross(row(planes.middle, w, 6), force))
        losses.work[0] -= dt * (dot(force, row(planes.middle, w, 9)) + dot(torque, row(planes.middle, w, 12)))
    for s in range(stripes):
        losses.force_work[0] += losses.fed[level * stripes + s]


@inline_kernel
def begin_batch(batch: Batch, motion: Motion, n: int, count: int, dt: float) -> None:
    """Planes of the ``count`` steps from n on."""
    for level in range(count):
        step, pose = n + level, batch.pose[level]
        place_planes(motion, step * dt, pose[NOW])
        place_planes(motion, max((step - 0.5) * dt, 0.0), pose[MIDDLE])
        place_planes(motion, max((step - 1) * dt, 0.0), pose[BEFORE])


@inline_kernel
def end_batch(
    state: State, losses: Losses | None, images: Images | None, batch: Batch, n: int, count: int, dt: float
) -> None:
    """Loads of the planes after ``count`` steps from n on, and what they have worked in each."""
    stripes = batch.stripe.shape[0] - 1
    if losses is not None:
        for level in range(count):
            gather_loads(state, level, stripes)
            work_of_step(state, planes_of(batch.pose[level]), losses, dt if n + level > 0 else 0.0, level, stripes)
    gather_loads(state, count - 1, stripes)
    if images is not None and n > 0:
        images.work[0] += 0.5 * dt * (images.power[0] + images.share[POWER])


@inline_kernel
def steps_at_once(
    bodies: Assembly, losses: Losses | None, images: Images | None, batch: Batch, scheme: Scheme, plan: Plan,
    n: int, count: int, thread: int, threads: int,
) -> None:  # fmt: skip
    """The ``count`` steps from n on: this thread's.

    Threads take ``front`` steps in turn. At its place p the first of a front is at stripe p, the next one at p - 1, and so on. The last
    step of the front before must have been at stripe p + 1.
    """
    batch.far[thread * PAD], batch.far[thread * PAD + 1] = 0.0, 0.0
    stripes = 0
    while stripes < batch.stripe.shape[0] - 1 and batch.stripe[stripes] < bodies.state.radius.shape[0]:
        stripes += 1
    places = stripes + plan.front - 1
    for turn in range(thread, (count + plan.front - 1) // plan.front, threads):
        first = turn * plan.front
        steps = min(plan.front, count - first)
        for p in range(places):
            if threads > 1 and turn > 0:
                before = (turn - 1) % threads
                wait_until(batch.done, before * PAD, (turn - 1) * places + min(p + plan.front + 1, places))
            for k in range(max(0, p - stripes + 1), min(steps, p + 1)):
                level = first + k
                far = step_of_stripe(bodies, losses, images, batch, scheme, plan, n + level, level, p - k, thread)
                at = thread * PAD + int(level == count - 1)
                batch.far[at] = farther(batch.far[at], far)
            if threads > 1:
                signal(batch.done, thread * PAD, turn * places + p + 1)


@kernel
def advance(
    thread: int, threads: int, bodies: Assembly, losses: Losses | None, images: Images | None, motion: Motion, batch: Batch,
    clock: Integers, scheme: Scheme, plan: Plan,
) -> int:  # fmt: skip
    """Steps until ``clock[STEP]`` is ``plan.target``, with its forces; all threads call it with the same arguments but their number.

    Lists are too old where a sphere has moved by more than half of the skin, or at ``clock[DUE]`` is foreseen to: that depends on the
    motion alone, not on how many steps are done at once. In a periodic cell, where one thread does one step at a time, nothing is foreseen.

    Returns
    -------
    int
        OK; FAR if step ``clock[STEP]`` wants new lists before its forces; BEHIND, with ``state.behind``; AGAIN.
    """
    state, dt, skin = bodies.state, scheme.dt, scheme.skin
    n, moved, due = clock[STEP], clock[PENDING] == 0, clock[DUE]
    begin, end = state.radius.shape[0] * thread // threads, state.radius.shape[0] * (thread + 1) // threads
    mine = thread * PAD
    wait_for_all(batch.flags, thread, threads)
    if moved:
        batch.far[mine + 1] = kicked(state, images, scheme, n, begin, end)
        n += 1
    while True:
        if thread == 0:
            clock[STEP], clock[PENDING] = n, 1
            place_planes(motion, n * dt, state.now)
        if images is not None:
            place_cell(images, n * dt)
            skin = 2.0 * displacement_limit(images, scheme.skin)
        if n == due:
            batch.far[mine + 1] = foreseen(state, FORESEEN * dt, begin, end)
        wait_for_all(batch.flags, thread, threads)
        if (moved or n == due) and moved_too_far(farthest_of_all(batch, 1, threads), skin):
            return FAR
        if n == due:
            due = n + BATCH
        count = min(min(plan.target, due - 1) - n + 1, plan.at_once)
        if thread == 0:
            clock[DUE] = due
            begin_batch(batch, motion, n, count, dt)
        batch.done[mine] = 0
        wait_for_all(batch.flags, thread, threads)
        steps_at_once(bodies, losses, images, batch, scheme, plan, n, count, thread, threads)
        wait_for_all(batch.flags, thread, threads)
        behind = any_behind_plane(state)
        if count > 1 and (behind or moved_too_far(farthest_of_all(batch, 0, threads), skin)):
            return AGAIN
        if behind:
            return BEHIND
        if thread == 0:
            end_batch(state, losses, images, batch, n, count, dt)
        n += count
        moved = True
        if n > plan.target:
            if thread == 0:
                clock[STEP], clock[PENDING] = plan.target, 0
                place_planes(motion, plan.target * dt, state.now)
            return OK
