"""Forces of spheres on each other and of planes on spheres.

As in 2D (`ninedisk.core.dem.plane.force_kernels`) contacts go through loops without branches, by chunks: which pairs of the list touch,
differences of their bodies into a scratch in the fastest cache, the law in vector registers, sums into the bodies. Only pairs that touch
get past the first loop. Contacts of a chunk that have the same law are one run, for which all that the law decides is decided once; in a
scene of many materials runs are short.

A plane enters as a sphere of no radius at the foot of the other one's centre: everything between the differences and the sums is the same.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from ninedisk.core.compile import fused_inline_kernel, fused_kernel, inline_kernel
from ninedisk.core.dem.space.image_kernels import add_share, image_vector, take_motion
from ninedisk.core.dem.space.law_kernels import (
    compliance,
    contact,
    law_of,
    resistance,
    resistance_losses,
    shear_losses,
    touch_of,
)
from ninedisk.core.dem.space.plane_kernels import above, at_rest, plane_velocity
from ninedisk.core.dem.space.registers import blend
from ninedisk.core.dem.space.scratch_kernels import (
    ARM_LOSS,
    CHUNK,
    CROSSED,
    CROSSED_ROWS,
    D_BEFORE,
    D_ROWS,
    DASHPOT_DV,
    DASHPOT_ROWS,
    DASHPOT_TURNS,
    DASHPOT_TURNS_ROWS,
    DV,
    DV_ROWS,
    FOUR,
    FS,
    ITS_DRAG,
    ITS_NECK,
    LANES,
    LAST,
    MOMENT,
    MOMENT_ROWS,
    NEXT,
    ONE,
    PUSH,
    PUSH_ROWS,
    REACH,
    REPULSIVE,
    ROLLED,
    ROLLS,
    ROLLS_ROWS,
    SPINS,
    SPINS_ROWS,
    SPRINGS,
    TURNS,
    TURNS_ROWS,
    TWO,
    D,
    get_extra,
    keep_memories,
    memories_to_columns,
    put_vector,
    recall,
    remember,
    results_to_rows,
    to_columns,
    vector,
    xyz,
)
from ninedisk.core.dem.space.state import (
    DASHPOT,
    FORCE,
    FRICTION,
    HERTZ,
    KN,
    KS,
    LEAST,
    MEMORY_WIDTH,
    MIDDLE,
    NECK,
    NOTES_WIDTH_STICKY,
    OF_LAW,
    ROLL,
    ROLLED_ON,
    ROLLING,
    ROLLING_DASHPOT,
    SHEAR,
    SLIP_MID,
    SPRING,
    STICKS,
    TWIST,
    TWISTING,
    UNLOADING,
    Contacts,
    Desk,
    Floats,
    Images,
    Index,
    Losses,
    Planes,
    State,
    Step,
)
from ninedisk.core.dem.space.vector_kernels import cross, dot, plus, row, scaled


@fused_inline_kernel
def run_of_contacts(
    hertz: bool, middle: bool, in_force: bool, sticks: bool, law: Floats, slip_dt: float, begin: int, end: int, scratch: Floats
) -> None:  # fmt: skip
    """`contact` for ``begin .. end-1`` of the scratch, which have the same law."""
    its = law_of(law)
    for q in range(np.uint64(begin), np.uint64(end)):
        touch = touch_of(sticks, SPRINGS, q, scratch)
        fn, repulsive, arm_loss, fs, spring, n = contact(hertz, middle, in_force, sticks, its, slip_dt, touch)
        put_vector(scratch, PUSH + q, plus(fs, -fn, n))
        put_vector(scratch, CROSSED + q, cross(n, fs))
        put_vector(scratch, FS + q, fs)
        put_vector(scratch, SPRINGS + q, spring)
        scratch[FS + LAST * NEXT + q], scratch[REPULSIVE + q], scratch[ARM_LOSS + q] = fn, repulsive, arm_loss


@inline_kernel
def run_of_resistances(law: Floats, slip_dt: float, begin: int, end: int, scratch: Floats) -> None:
    """`resistance` for ``begin .. end-1`` of the scratch, after `run_of_contacts`."""
    for q in range(np.uint64(begin), np.uint64(end)):
        m, rolled, twisted = resistance(law, slip_dt, q, scratch)
        put_vector(scratch, MOMENT + q, m)
        put_vector(scratch, ROLLED + q, rolled)
        scratch[ROLLED + LAST * NEXT + q] = twisted


@inline_kernel
def laws_of_chunk(contacts: Contacts, laws: Floats, slip_dt: float, count: int, desk: Desk) -> None:
    """Both laws for the first ``count`` contacts of the scratch, run by run.

    A run that is all of the chunk goes on to the end of the last vector: what is there is of no use and of no harm, and one by one they
    would take as long as whole vectors.
    """
    scratch, picked = desk.scratch, desk.picked
    resisted = contacts.memory.shape[1] > MEMORY_WIDTH
    begin = 0
    while begin < count:
        number = contacts.law[picked[begin]]
        end = count
        if laws.shape[0] > 1:
            end = begin + 1
            while end < count and contacts.law[picked[end]] == number:
                end += 1
        law, whole = laws[number], end
        if begin == 0 and end == count:
            whole = (count + LANES - 1) // LANES * LANES
        if law[STICKS] > 0.0:
            run_of_contacts(True, law[MIDDLE] > 0.0, law[UNLOADING] == FORCE, True, law, slip_dt, begin, end, scratch)
        elif law[HERTZ] > 0.0:
            if law[UNLOADING] == FORCE:
                if law[MIDDLE] > 0.0:
                    run_of_contacts(True, True, True, False, law, slip_dt, begin, whole, scratch)
                else:
                    run_of_contacts(True, False, True, False, law, slip_dt, begin, whole, scratch)
            elif law[MIDDLE] > 0.0:
                run_of_contacts(True, True, False, False, law, slip_dt, begin, whole, scratch)
            else:
                run_of_contacts(True, False, False, False, law, slip_dt, begin, whole, scratch)
        elif law[MIDDLE] > 0.0:
            run_of_contacts(False, True, True, False, law, slip_dt, begin, whole, scratch)
        else:
            run_of_contacts(False, False, True, False, law, slip_dt, begin, whole, scratch)
        if resisted:
            run_of_resistances(law, slip_dt, begin, end, scratch)
        begin = end


@fused_kernel
def losses_of_chunk(
    contacts: Contacts, laws: Floats, losses: Losses, step: Step, at_planes: bool, count: int, desk: Desk
) -> None:
    """Add what the first ``count`` contacts of the scratch have lost in this step to the stripe's; after the laws.

    It stands apart from these: a product with two uses would be rounded otherwise than where no losses are counted.
    """
    resisted, scratch = contacts.memory.shape[1] > MEMORY_WIDTH, desk.scratch
    stripe = desk.slot % losses.contacts.shape[0]
    for q in range(np.uint64(count)):
        law = laws[contacts.law[desk.picked[q]]]
        friction, own = shear_losses(law, step.slip_dt, at_planes, q, scratch)
        d = vector(scratch, D + q)
        apart = sqrt(dot(d, d))
        rate, drag = dot(vector(scratch, DASHPOT_DV + q), d) / apart, scratch[ITS_DRAG + q]
        if law[HERTZ] > 0.0:
            drag *= sqrt(sqrt(get_extra(scratch, SPRINGS + q) * max(scratch[REACH + q] - apart, 0.0)))
        losses.contacts[stripe, FRICTION] += friction
        damped = drag * rate
        if law[LEAST] == 0.0:
            damped = max(damped, -law[KN] * max(scratch[REACH + q] - apart, 0.0))
        losses.contacts[stripe, DASHPOT] += step.loss_dt * damped * rate
        losses.contacts[stripe, OF_LAW] += own
        if resisted:
            rolled, turned = resistance_losses(law, step, q, scratch)
            losses.contacts[stripe, ROLLED_ON] += rolled
            losses.contacts[stripe, ROLLING_DASHPOT] += turned


@inline_kernel
def end_of_contact(contacts: Contacts, laws: Floats, losses: Losses, stripe: int, k: Index) -> None:
    """Count the energy that the springs of a listed pair which has opened have left [J]; they have it no more.

    The shear spring of Hertz' law has none: its stiffness vanishes with the overlap.
    """
    law, memory = laws[contacts.law[k]], contacts.memory
    if law[HERTZ] == 0.0:
        left = 0.0
        for c in range(3):
            left += memory[k, SHEAR + c] ** 2
            memory[k, SHEAR + c] = 0.0
        losses.contacts[stripe, FRICTION] += 0.5 * left * compliance(law[KS])
    if memory.shape[1] > MEMORY_WIDTH:
        left = 0.0
        for c in range(3):
            left += memory[k, ROLLING + c] ** 2
            memory[k, ROLLING + c] = 0.0
        twisted = memory[k, TWISTING]
        memory[k, TWISTING] = 0.0
        if law[ROLL] == SPRING:
            losses.contacts[stripe, ROLLED_ON] += 0.5 * left * compliance(law[ROLL + 2])
        if law[TWIST] == SPRING:
            losses.contacts[stripe, ROLLED_ON] += 0.5 * twisted * twisted * compliance(law[TWIST + 2])


@inline_kernel
def end_of_contacts(
    state: State, pairs: Contacts, laws: Floats, losses: Losses, stripe: int, begin: np.uint64, end: np.uint64
) -> None:
    """`end_of_contact` of the listed pairs ``begin .. end-1`` that do not touch."""
    x, radius = state.x, state.radius
    for k in range(begin, end):
        i, j = np.uint64(pairs.row[k]), np.uint64(pairs.other[k])
        d, reach = plus(xyz(x, j), -1.0, xyz(x, i)), radius[i] + radius[j]
        if dot(d, d) >= reach * reach:
            end_of_contact(pairs, laws, losses, stripe, k)


@inline_kernel
def clear_forces(contacts: Contacts, begin: np.uint64, end: np.uint64) -> None:
    """No force of the listed pairs ``begin .. end-1``, until it is found."""
    for k in range(begin, end):
        for c in range(4):
            contacts.force[k, c] = 0.0


@inline_kernel
def is_active(contacts: Contacts, k: np.uint64, overlap: float, q: np.uint64, scratch: Floats) -> bool:
    """Whether a listed pair touches, or its neck still holds, which goes to place q of the scratch; if it does not there is none."""
    neck = contacts.notes[k, NECK]
    touches = bool(overlap > min(0.0, -neck))
    scratch[ITS_NECK + q] = neck
    contacts.notes[k, NECK] = abs(neck) if touches else -abs(neck)
    return touches


@inline_kernel
def pick(state: State, pairs: Contacts, k: np.uint64, end: np.uint64, desk: Desk) -> tuple[np.uint64, np.uint64]:
    """The next listed pairs from k on that touch, a chunk of them at most, with their distances; the next k, and how many they are."""
    x, radius, scratch, picked = state.x, state.radius, desk.scratch, desk.picked
    rows, other, count = pairs.row, pairs.other, np.uint64(0)
    while k < end and count < NEXT:
        i, j = np.uint64(rows[k]), np.uint64(other[k])
        blend(scratch, D_ROWS + count, 1.0, x, j, -1.0, x, i)
        dx, dy, dz = xyz(scratch, D_ROWS + count)
        reach = radius[i] + radius[j]
        scratch[REACH + count] = reach
        picked[count] = k
        count += np.uint64(dx * dx + dy * dy + dz * dz < reach * reach)
        k += ONE
    return k, count


@inline_kernel
def pick_with_necks(
    state: State, pairs: Contacts, k: np.uint64, end: np.uint64, desk: Desk
) -> tuple[np.uint64, np.uint64]:
    """`pick` where a pair touches as long as its neck holds, too."""
    x, radius, scratch, picked = state.x, state.radius, desk.scratch, desk.picked
    rows, other, count = pairs.row, pairs.other, np.uint64(0)
    while k < end and count < NEXT:
        i, j = np.uint64(rows[k]), np.uint64(other[k])
        blend(scratch, D_ROWS + count, 1.0, x, j, -1.0, x, i)
        d = xyz(scratch, D_ROWS + count)
        reach = radius[i] + radius[j]
        scratch[REACH + count] = reach
        picked[count] = k
        count += np.uint64(is_active(pairs, k, reach - sqrt(dot(d, d)), count, scratch))
        k += ONE
    return k, count


@inline_kernel
def pick_with_images(
    state: State, pairs: Contacts, images: Images, k: np.uint64, end: np.uint64, desk: Desk
) -> tuple[np.uint64, np.uint64]:
    """`pick` of spheres and images."""
    x, radius, scratch, picked = state.x, state.radius, desk.scratch, desk.picked
    rows, other, count = pairs.row, pairs.other, np.uint64(0)
    while k < end and count < NEXT:
        i, j = np.uint64(rows[k]), np.uint64(other[k])
        blend(scratch, D_ROWS + count, 1.0, x, j, -1.0, x, i)
        dx, dy, dz = plus(xyz(scratch, D_ROWS + count), 1.0, image_vector(images.now, pairs, k))
        at = FOUR * (D_ROWS + count)
        scratch[at], scratch[at + ONE], scratch[at + TWO] = dx, dy, dz
        reach = radius[i] + radius[j]
        scratch[REACH + count] = reach
        picked[count] = k
        count += np.uint64(dx * dx + dy * dy + dz * dz < reach * reach)
        k += ONE
    return k, count


@fused_kernel
def forces_of_spheres(
    state: State, pairs: Contacts, laws: Floats, losses: Losses | None, images: Images | None, step: Step, begin: int, end: int, desk: Desk
) -> None:  # fmt: skip
    """Add the forces of the listed pairs of the rows ``begin .. end-1``; update their memory.

    ``losses`` None: they are not counted, and the compiler leaves out whatever concerns them; likewise ``images``.
    """
    v, omega, radius, force, torque = state.v, state.omega, state.radius, state.force, state.torque
    rows, other, scratch, picked = pairs.row, pairs.other, desk.scratch, desk.picked
    resisted = pairs.memory.shape[1] > MEMORY_WIDTH
    sticky = pairs.notes.shape[1] == NOTES_WIDTH_STICKY
    first, end_of_list = np.uint64(pairs.start[begin]), np.uint64(pairs.start[end])
    if step.keep:
        clear_forces(pairs, first, end_of_list)
    if losses is not None:
        end_of_contacts(state, pairs, laws, losses, desk.slot % losses.contacts.shape[0], first, end_of_list)
    k = first
    while k < end_of_list:
        if images is not None:
            k, count = pick_with_images(state, pairs, images, k, end_of_list, desk)
        elif sticky:
            k, count = pick_with_necks(state, pairs, k, end_of_list, desk)
        else:
            k, count = pick(state, pairs, k, end_of_list, desk)
        for q in range(count):
            m = np.uint64(picked[q])
            i, j = np.uint64(rows[m]), np.uint64(other[m])
            blend(scratch, DV_ROWS + q, 1.0, v, i, -1.0, v, j)
            blend(scratch, ROLLS_ROWS + q, radius[i], omega, i, radius[j], omega, j)
            blend(scratch, SPINS_ROWS + q, 1.0, omega, i, 1.0, omega, j)
            if step.central:
                blend(scratch, DASHPOT_ROWS + q, 1.0, state.v_now, i, -1.0, state.v_now, j)
            if images is not None:
                take_motion(pairs, images, m, q, step.central, scratch)
            if resisted:
                blend(scratch, TURNS_ROWS + q, 1.0, omega, i, -1.0, omega, j)
                if step.central:
                    blend(scratch, DASHPOT_TURNS_ROWS + q, 1.0, state.omega_now, i, -1.0, state.omega_now, j)
            recall(pairs, m, q, resisted, scratch)
        to_columns(scratch, D, D_ROWS, count)
        to_columns(scratch, DV, DV_ROWS, count)
        to_columns(scratch, ROLLS, ROLLS_ROWS, count)
        to_columns(scratch, SPINS, SPINS_ROWS, count)
        if resisted:
            to_columns(scratch, TURNS, TURNS_ROWS, count)
            if step.central:
                to_columns(scratch, DASHPOT_TURNS, DASHPOT_TURNS_ROWS, count)
            else:
                for c in range(np.uint64(3 * CHUNK)):
                    scratch[DASHPOT_TURNS + c] = scratch[TURNS + c]
        memories_to_columns(scratch, resisted, count)
        for c in range(np.uint64(3 * CHUNK)):
            scratch[D_BEFORE + c] = scratch[D + c] + step.slip_dt * scratch[DV + c]
        if step.central:
            to_columns(scratch, DASHPOT_DV, DASHPOT_ROWS, count)
        else:
            for c in range(np.uint64(3 * CHUNK)):
                scratch[DASHPOT_DV + c] = scratch[DV + c]
        if losses is not None:
            keep_memories(resisted, scratch)
        laws_of_chunk(pairs, laws, step.slip_dt, int(np.int64(count)), desk)
        if losses is not None:
            losses_of_chunk(pairs, laws, losses, step, False, int(np.int64(count)), desk)
        results_to_rows(scratch, resisted, count)
        for q in range(count):
            m = np.uint64(picked[q])
            i, j = np.uint64(rows[m]), np.uint64(other[m])
            arm_loss = scratch[ARM_LOSS + q]
            if images is not None:
                add_share(pairs, images, m, q, scratch)
            blend(force, i, 1.0, force, i, 1.0, scratch, PUSH_ROWS + q)
            blend(force, j, 1.0, force, j, -1.0, scratch, PUSH_ROWS + q)
            blend(torque, i, 1.0, torque, i, radius[i] - arm_loss, scratch, CROSSED_ROWS + q)
            blend(torque, j, 1.0, torque, j, radius[j] - arm_loss, scratch, CROSSED_ROWS + q)
            if resisted:
                blend(torque, i, 1.0, torque, i, -1.0, scratch, MOMENT_ROWS + q)
                blend(torque, j, 1.0, torque, j, 1.0, scratch, MOMENT_ROWS + q)
            remember(pairs, m, q, resisted, step.keep, scratch)


@inline_kernel
def first_from(pairs: Contacts, low: int, high: int, sphere: int) -> int:
    """First entry of ``low .. high-1`` whose sphere is not below ``sphere``; entries ascend."""
    while low < high:
        middle = (low + high) // 2
        if pairs.other[middle] < sphere:
            low = middle + 1
        else:
            high = middle
    return low


@inline_kernel
def beside_plane(
    state: State, planes: Planes, contacts: Contacts, law: Floats, step: Step, moves: bool, w: int, k: np.uint64, q: np.uint64,
    scratch: Floats,
) -> tuple[float, bool]:  # fmt: skip
    """Differences and memory of the listed pair k to place q of the scratch, if it touches; its overlap [m], the radius if it is behind,
    and whether it touches."""
    i, slip_dt = np.uint64(contacts.other[k]), step.slip_dt
    xi, vi, ri = xyz(state.x, i), xyz(state.v, i), state.radius[i]
    height = above(planes.now, w, xi)
    overlap = ri - height
    touches, keeps = overlap > 0.0, False
    if contacts.notes.shape[1] == NOTES_WIDTH_STICKY:
        keeps = contacts.notes[k, NECK] > 0.0
        touches = is_active(contacts, k, overlap, q, scratch)
    if height <= 0.0 or not touches:
        return float(overlap), False
    wi, wj, n = xyz(state.omega, i), row(planes.middle, w, 12), scaled(row(planes.now, w, 3), -1.0)
    seen = xyz(state.v_now, i) if step.central else vi
    before, height_before, vj, dashpot_vj = n, height + slip_dt * dot(vi, n), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    if moves:
        height_before, before = above(planes.before, w, plus(xi, -slip_dt, vi)), scaled(row(planes.before, w, 3), -1.0)
        # Where spheres have velocities of the half step, planes have theirs of its middle, about the pivot of its end.
        half, foot = 0.5 * slip_dt, plus(xi, height, n)
        vj = plane_velocity(planes.middle, w, foot, half)
        dashpot_vj = plane_velocity(planes.now, w, foot, 0.0) if step.central else vj
        mean_overlap = overlap
        shown = n
        if law[MIDDLE] > 0.0:
            if height_before < ri or keeps:
                both = (before[0] + n[0], before[1] + n[1], before[2] + n[2])
                shown = scaled(both, 1.0 / sqrt(dot(both, both)))
                mean_overlap = 0.5 * (overlap + ri - height_before)
            vj = plane_velocity(planes.middle, w, plus(plus(xi, -half, vi), ri - mean_overlap, shown), 0.0)
        # The plane's velocity is that of the very place: what its spin adds with the overlap's middle is taken back.
        vj = plus(vj, -0.5 * mean_overlap * law[SLIP_MID], cross(wj, shown))
    put_vector(scratch, D + q, scaled(n, height))
    put_vector(scratch, D_BEFORE + q, scaled(before, height_before))
    scratch[REACH + q] = ri
    put_vector(scratch, DV + q, plus(vi, -1.0, vj))
    put_vector(scratch, DASHPOT_DV + q, plus(seen, -1.0, dashpot_vj))
    put_vector(scratch, ROLLS + q, scaled(wi, ri))
    put_vector(scratch, SPINS + q, plus(wi, 1.0, wj))
    put_vector(scratch, TURNS + q, plus(wi, -1.0, wj))
    spin_seen = wi
    if step.central and state.omega_now.shape[0] > 0:
        spin_seen, wj = xyz(state.omega_now, i), row(planes.now, w, 12)
    put_vector(scratch, DASHPOT_TURNS + q, plus(spin_seen, -1.0, wj))
    recall(contacts, k, q, contacts.memory.shape[1] > MEMORY_WIDTH, scratch)
    return float(overlap), True


@fused_kernel
def forces_of_planes(
    state: State, planes: Planes, contacts: Contacts, laws: Floats, losses: Losses | None, step: Step, begin: int, end: int, desk: Desk
) -> None:  # fmt: skip
    """Add the forces of the contacts of the spheres ``begin .. end-1`` with planes, and the stripe's share of the planes' loads.

    ``losses`` as in `forces_of_spheres`.
    """
    force, torque, radius, share = state.force, state.torque, state.radius, state.share
    resisted = contacts.memory.shape[1] > MEMORY_WIDTH
    scratch, picked, slot = desk.scratch, desk.picked, desk.slot
    number = planes.now.shape[0]
    w, k, end_of_rows, moves = -1, np.uint64(0), np.uint64(0), False
    while w < number:
        count = np.uint64(0)
        while w < number and count < NEXT:
            if k == end_of_rows:
                w += 1
                if w < number:
                    k = np.uint64(first_from(contacts, contacts.start[w], contacts.start[w + 1], begin))
                    end_of_rows = np.uint64(first_from(contacts, int(np.int64(k)), contacts.start[w + 1], end))
                    moves = not at_rest(planes, w)
                    if step.keep:
                        clear_forces(contacts, k, end_of_rows)
                continue
            overlap, touches = beside_plane(
                state, planes, contacts, laws[contacts.law[k]], step, moves, w, k, count, scratch
            )
            if overlap >= radius[contacts.other[k]]:
                state.behind[slot, 0], state.behind[slot, 1] = 1 + state.name[contacts.other[k]], w
            elif touches:
                picked[count] = k
                count += np.uint64(1)
            elif losses is not None:
                end_of_contact(contacts, laws, losses, slot % losses.contacts.shape[0], k)
            k += np.uint64(1)
        memories_to_columns(scratch, resisted, count)
        if losses is not None:
            keep_memories(resisted, scratch)
        laws_of_chunk(contacts, laws, step.slip_dt, int(np.int64(count)), desk)
        if losses is not None:
            losses_of_chunk(contacts, laws, losses, step, True, int(np.int64(count)), desk)
        results_to_rows(scratch, resisted, count)
        for q in range(count):
            m = np.uint64(picked[q])
            i, plane = np.uint64(contacts.other[m]), np.uint64(contacts.row[m])
            push, arm = vector(scratch, PUSH + q), radius[i] - scratch[ARM_LOSS + q]
            blend(force, i, 1.0, force, i, 1.0, scratch, PUSH_ROWS + q)
            blend(torque, i, 1.0, torque, i, arm, scratch, CROSSED_ROWS + q)
            if resisted:
                blend(torque, i, 1.0, torque, i, -1.0, scratch, MOMENT_ROWS + q)
            for c in range(3):
                share[slot, plane, c] -= push[c]
            if losses is not None:
                moment = cross(plus(xyz(state.x, i), 1.0, vector(scratch, D + q)), scaled(push, -1.0))
                if resisted:
                    moment = plus(moment, 1.0, vector(scratch, MOMENT + q))
                for c in range(3):
                    losses.torque[slot, plane, c] += moment[c]
            remember(contacts, m, q, resisted, step.keep, scratch)
