"""Kernels of the loop over central-difference steps.

One cycle: positions of disks and walls at ``t_n``, forces at ``t_n``, velocities at ``t_{n+1/2}``, positions at ``t_{n+1}``.
"""

from __future__ import annotations

from math import sqrt

from ninedisk.core.compile import inline_kernel, kernel
from ninedisk.core.dem.loads_kernels import share_of_kick
from ninedisk.core.dem.plane.force_kernels import disk_disk_forces, disk_wall_forces, note_pairs
from ninedisk.core.dem.plane.grain_kernels import grain_forces
from ninedisk.core.dem.plane.image_kernels import (
    beside_flow,
    clear_image_share,
    displacement_limit,
    gather_shares,
    image_forces,
    place_cell,
    record_images,
)
from ninedisk.core.dem.plane.kick_kernels import farther, farthest, kick_and_drift
from ninedisk.core.dem.plane.neighbour_kernels import REBUILD_COST, next_skin
from ninedisk.core.dem.plane.rebuild_kernels import rebuild, rebuild_images
from ninedisk.core.dem.plane.sample_kernels import lost_so_far, record, record_contacts
from ninedisk.core.dem.plane.watch_kernels import may_be_unstable, spread
from ninedisk.core.dem.state import (
    BEHIND_WALL,
    BUILT,
    CODE,
    GRAINS_STOPPED,
    LOOK,
    OK,
    PENDING,
    REBUILDS,
    ROW,
    STEP,
    DiskArrays,
    Images,
    Kick,
    Laws,
    Loads,
    Losses,
    Outlines,
    Progress,
    Samples,
    StepConstants,
    System,
    WallArrays,
    Watch,
)
from ninedisk.core.pose import NORMAL_X, NORMAL_Y, PIVOT_VX, PIVOT_VY, PIVOT_X, PIVOT_Y, POINT_X, POINT_Y, TURN_RATE
from ninedisk.core.scene.motion_kernels import WallMotion, place_walls
from ninedisk.core.thread_kernels import PAD, wait_for_all

BLOCK = 2048
"""Disks whose forces are found before they are kicked, so many as stay in the second cache (300 kB) and the memory behind it still
sees long runs."""

SURE = 1.001
"""Squared displacements count a thousandth more: 5e-6 mean radii of the least skin, far above the rounding of any distance."""


@inline_kernel
def wall_drift(walls: WallArrays, skin: float) -> float:
    """Bound on how far a wall's surface came closer to any disk since the last rebuild [m].

    The height ``h = (x - p).n`` changes by ``(x - p).(n - n_b) - (p - p_b).n_b``; a wall that slides along itself counts 0.
    """
    worst = 0.0
    for w in range(walls.now.shape[0]):
        px, py = walls.now[w, POINT_X] - walls.built[w, POINT_X], walls.now[w, POINT_Y] - walls.built[w, POINT_Y]
        nx, ny = walls.now[w, NORMAL_X] - walls.built[w, NORMAL_X], walls.now[w, NORMAL_Y] - walls.built[w, NORMAL_Y]
        along = abs(px * walls.built[w, NORMAL_X] + py * walls.built[w, NORMAL_Y])
        turn = sqrt(nx * nx + ny * ny)
        if turn > 0.0:
            turn *= walls.extent[w] + skin + sqrt(px * px + py * py)
        worst = max(worst, along + turn)
    return worst


@inline_kernel
def clear_forces(disks: DiskArrays) -> None:
    """Take back the forces of a step that is not finished."""
    for i in range(disks.x.shape[0]):
        disks.force[i, 0], disks.force[i, 1], disks.torque[i] = 0.0, 0.0, 0.0


@inline_kernel
def clear_share(walls: WallArrays, stripe: int) -> None:
    """Begin a new sum of the stripe's share of the loads."""
    for w in range(walls.now.shape[0]):
        for c in range(3):
            walls.share[stripe, w, c] = 0.0


@inline_kernel
def note_before(losses: Losses | None) -> None:
    """Keep the sums of what was lost before a step."""
    if losses is not None:
        for c in range(losses.before.shape[0]):
            losses.before[c] = lost_so_far(losses, c)


@inline_kernel
def push(disks: DiskArrays, loads: Loads, step: StepConstants, n: int) -> float:
    """Add to the forces those of `Scene.forces`, as means over the time of the kick from ``t_n``.

    Returns
    -------
    float
        Their work during the step that ended at ``t_n`` [J], by the trapezoidal rule.
    """
    dt = step.kick.dt
    work = 0.0
    for k in range(loads.disk.shape[0]):
        i = disks.place[loads.disk[k]]
        now, before = share_of_kick(loads.time[k], n, dt), share_of_kick(loads.time[k], n - 1, dt)
        fx, fy, torque = loads.load[k, 0], loads.load[k, 1], loads.load[k, 2]
        if n > 0 and now + before > 0.0:
            power = fx * disks.v[i, 0] + fy * disks.v[i, 1] + torque * disks.omega[i]
            work += 0.5 * dt * (now + before) * power
        disks.force[i, 0] += now * fx
        disks.force[i, 1] += now * fy
        disks.torque[i] += now * torque
    return work


@inline_kernel
def farthest_allowed(walls: WallArrays, images: Images | None, skin: float, widest: float) -> float:
    """Displacement of a disk since the last rebuild up to which the lists are complete [m]."""
    if images is not None:
        return displacement_limit(images, skin, widest)
    return min(0.5 * skin, skin - wall_drift(walls, skin))


@inline_kernel
def kicked(system: System, images: Images | None, kick: Kick, n: int, begin: int, end: int) -> float:
    """Kick of the disks ``begin .. end-1`` after step n.

    Returns
    -------
    float
        Largest squared displacement since the last rebuild of the lists, in a cell from its flow [m^2]; NaN if any is NaN.
    """
    kick_and_drift(system.disks, system.views, kick, begin, end)
    if images is not None:
        return beside_flow(system.views, images, (n + 1) * kick.dt, begin, end)
    return farthest(system.views.x, system.views.built, begin, end)


@inline_kernel
def stripe_forces(
    system: System,
    laws: Laws | None,
    losses: Losses | None,
    images: Images | None,
    n: int,
    slip_dt: float,
    moves_on: bool,
    parity: int,
    thread: int,
    threads: int,
) -> float:
    """Forces of every ``threads``-th even (parity 0) or odd (1) stripe, beginning with the first one of this thread.

    Disks that are in order and have been a row of the list have all their forces, and no later row reads them. So, if the step
    ``moves_on``, they are kicked block by block, while they are in the fast caches: all in odd stripes, whose even neighbours are
    done; in even ones all except those of the border, which the odd stripe before still touches.

    Returns
    -------
    float
        Largest squared displacement of the kicked disks since the last rebuild [m^2]; NaN if any is NaN.
    """
    disks, views, walls, lists, team = system.disks, system.views, system.walls, system.lists, system.team
    stripe = team.stripe
    far = 0.0
    loss_dt = slip_dt if slip_dt > 0.0 else 0.5 * system.step.kick.dt
    for s in range(parity + 2 * thread, stripe.shape[0] - 1, 2 * threads):
        end = stripe[s + 1]
        kicked_from = team.border[s] if parity == 0 else stripe[s]
        clear_share(walls, s)
        if images is not None:
            clear_image_share(images, s)
        for low in range(stripe[s], end, BLOCK):
            high = min(low + BLOCK, end)
            scratch = team.scratch[thread]
            if images is None:
                disk_disk_forces(
                    disks, views, lists.pairs, system.law, laws, losses, s, slip_dt, loss_dt, low, high, scratch
                )
            else:
                image_forces(disks, views, lists.pairs, images, system.law, slip_dt, low, high, scratch, s)
            # Disks at a wall are few and far between: the pairs have brought them into the caches.
            disk_wall_forces(disks, walls, lists.wall_pairs, laws, losses, slip_dt, loss_dt, low, high, s)
            if moves_on:
                far = farther(far, kicked(system, images, system.step.kick, n, max(low, kicked_from), high))
    return far


@inline_kernel
def kick_borders(system: System, images: Images | None, n: int, thread: int, threads: int) -> float:
    """Kick of the borders of the even stripes of a thread; returns what `kicked` does."""
    stripe, border = system.team.stripe, system.team.border
    far = 0.0
    for s in range(2 * thread, stripe.shape[0] - 1, 2 * threads):
        far = farther(far, kicked(system, images, system.step.kick, n, stripe[s], border[s]))
    return far


@inline_kernel
def gather_loads(walls: WallArrays) -> None:
    """Loads of the walls from the shares of the stripes, summed in the order of the stripes."""
    for w in range(walls.now.shape[0]):
        for c in range(3):
            total = 0.0
            for s in range(walls.share.shape[0]):
                total += walls.share[s, w, c]
            walls.load[w, c] = total


@inline_kernel
def wall_work_of_step(walls: WallArrays, dt: float) -> float:
    """Work of the walls on the disks during the last step [J], loads by the trapezoidal rule; keeps the loads."""
    work = 0.0
    for w in range(walls.now.shape[0]):
        fx = 0.5 * (walls.load[w, 0] + walls.load_before[w, 0])
        fy = 0.5 * (walls.load[w, 1] + walls.load_before[w, 1])
        torque = 0.5 * (walls.load[w, 2] + walls.load_before[w, 2])
        torque -= walls.now[w, PIVOT_X] * fy - walls.now[w, PIVOT_Y] * fx
        work -= dt * (fx * walls.now[w, PIVOT_VX] + fy * walls.now[w, PIVOT_VY] + torque * walls.now[w, TURN_RATE])
        for c in range(3):
            walls.load_before[w, c] = walls.load[w, c]
    return work


@kernel
def advance(
    thread: int,
    threads: int,
    system: System,
    motion: WallMotion,
    loads: Loads,
    outlines: Outlines | None,
    images: Images | None,
    samples: Samples,
    progress: Progress,
    watch: Watch,
    least: float,
    target: int,
) -> int:
    """Advance to contact step ``target``; sample on the way. All threads call it with the same arguments but their number.

    Thread 0 alone moves the walls, rebuilds, sums loads and samples; a barrier separates what one thread writes from what another
    one reads.

    Parameters
    ----------
    thread, threads : int
        This thread's number and the number of threads.
    system, motion, loads, samples, progress, watch
        See their classes.
    outlines : Outlines or None
        None, for which the compiler leaves out whatever concerns outlines, if all bodies are disks with the disks' law.
    images : Images or None
        None, likewise, without a periodic cell.
    least : float
        Displacement of two disks relative to each other in a step up to which no contact is jumped over [m].
    target : int

    Returns
    -------
    int
        OK when ``target`` is reached. Otherwise why not, with ``clock[PENDING]`` = 1 (`ninedisk.core.dem.state`): the caller removes
        the cause (grows a list) and calls again, also after it has looked whether the step is too long; after `BEHIND_WALL` nothing can
        go on.
    """
    disks, views, walls, team, step = system.disks, system.views, system.walls, system.team, system.step
    clock, skin = progress.clock, progress.skin
    n, row = clock[STEP], clock[ROW]
    pending = clock[PENDING] == 1
    stale = pending and clock[BUILT] < n and watch.checked[0] < n
    moved_on = False
    far, fed = 0.0, 0.0
    if images is not None and thread == 0:
        place_cell(images, n * step.kick.dt)
    wait_for_all(team.flags, thread, threads)
    while n < target or pending:
        if not pending:
            if not moved_on:
                count = disks.x.shape[0]
                kick = step.first if n == 0 else step.kick
                far = kicked(system, images, kick, n, count * thread // threads, count * (thread + 1) // threads)
            team.far[thread * PAD] = far
            n += 1
            if thread == 0:
                clock[STEP], clock[PENDING] = n, 1
                t, t_half = n * step.kick.dt, (n - 0.5) * step.kick.dt
                place_walls(motion, t, t_half, t_half if step.lagged else t, walls.now)
                place_walls(motion, t_half, t_half, t_half, walls.middle)
                if images is not None:
                    place_cell(images, n * step.kick.dt)
            wait_for_all(team.flags, thread, threads)
            for other in range(threads):
                far = farther(far, team.far[other * PAD])
            limit = farthest_allowed(walls, images, skin[0], step.widest)
            stale = not (limit > 0.0 and SURE * far < limit * limit)
        if stale:
            wait_for_all(team.flags, thread, threads)
            if thread == 0:
                wider = next_skin(skin[0], n - clock[BUILT], REBUILD_COST, step.radius, step.least_skin, step.most_skin)
                if images is None:
                    team.code[0] = rebuild(disks, walls, system.lists, team, step, wider)
                else:
                    team.code[0] = rebuild_images(disks, walls, system.lists, images, team, step, wider)
                if team.code[0] == OK:
                    note_pairs(disks, views, system.lists.pairs, system.law, system.laws)
                    skin[0], clock[BUILT] = wider, n
                    clock[REBUILDS] += 1
                    if spread(system, images, n * step.kick.dt) > least:
                        team.code[0], watch.checked[0] = LOOK, n
            wait_for_all(team.flags, thread, threads)
            if team.code[0] != OK:
                return int(team.code[0])
        slip_dt = step.kick.dt if n > 0 else 0.0
        sampled = row < samples.at.shape[0] and samples.at[row] == n
        if step.watched and (stale or sampled):
            if thread == 0:
                # Not in team.code, which other threads may still be reading after the rebuild.
                watch.verdict[0] = OK
                if watch.checked[0] < n:
                    watch.checked[0] = n
                    watch.verdict[0] = LOOK if may_be_unstable(system, system.laws, images, watch) else OK
            wait_for_all(team.flags, thread, threads)
            if watch.verdict[0] != OK:
                return LOOK
        pending, stale = False, False
        moved_on = False
        if loads.disk.shape[0] > 0:
            if thread == 0:
                fed = push(disks, loads, step, n)
            wait_for_all(team.flags, thread, threads)
        if sampled and system.losses is not None:
            if thread == 0:
                note_before(system.losses)
            wait_for_all(team.flags, thread, threads)
        if outlines is None:
            # Samples and the end of the run need the forces at this step, which a kick clears.
            moved_on = 0 < n < target and not sampled
            far = stripe_forces(system, system.laws, system.losses, images, n, slip_dt, moved_on, 0, thread, threads)
            wait_for_all(team.flags, thread, threads)
            odd = stripe_forces(system, system.laws, system.losses, images, n, slip_dt, moved_on, 1, thread, threads)
            far = farther(far, odd)
            wait_for_all(team.flags, thread, threads)
            if moved_on and walls.passed[0] == 0:
                far = farther(far, kick_borders(system, images, n, thread, threads))
        else:
            if thread == 0:
                grain_forces(system, outlines, n, slip_dt)
            wait_for_all(team.flags, thread, threads)
            if outlines.memory.mark[CODE] != 0:
                if thread == 0:
                    clear_forces(disks)
                return GRAINS_STOPPED
        if walls.passed[0] != 0:
            return BEHIND_WALL
        if thread == 0:
            gather_loads(walls)
            progress.work[0] += wall_work_of_step(walls, slip_dt)
            progress.work[1] += fed
            if images is not None:
                gather_shares(images, slip_dt)
            clock[PENDING] = 0
            if sampled:
                record(system, samples, row, n == 0, progress)
                if outlines is not None:
                    record_contacts(system, outlines, samples, row)
                if images is not None:
                    record_images(system, images, samples, row, n)
                clock[ROW] = row + 1
        if sampled:
            row += 1
            wait_for_all(team.flags, thread, threads)
    wait_for_all(team.flags, thread, threads)
    return OK
