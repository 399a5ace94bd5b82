"""Forces of disks on each other and on walls: linear spring, dashpot without tension, incremental shear, Coulomb cap.

Source: Cundall & Strack, Geotechnique 29 (1979) 47-65; conventions of `ninedisk.core.scene`: ``n`` points from ``i`` to
``j``, ``t = (-n_y, n_x)``, the force on ``i`` is ``-fn n + fs t``. With lever arms ``a_i, a_j`` the slip of ``i`` past ``j`` is
``vt = (v_i - v_j).t + a_i omega_i + a_j omega_j`` and both bodies receive the torque ``a fs``; a law may take another arm for the
torque than for the slip.

With velocities of ``t_{n-1/2}`` the slip of a step is the midpoint rule where normal, arms and walls are those of that time, too. Between
disks that are ``d = x_j - x_i`` apart at ``t_n`` these are those of ``m = d - (dt/2) d'``, and since ``m x d' = d x d'`` the turned
tangent ``t_m`` gives ``-t_m.d' = -(d x d')/|m|``: the slip by translation with the normal of ``t_n``, times ``|d|/|m|``. With the
normal of ``t_n`` it is of first order, and drifts along closed paths (`ContactLaw.slip_at`).

Contacts between disks are computed by chunks of the neighbour list. A loop that looks at a pair, decides whether it touches and finds its
forces is bound by branch mispredictions: which pairs touch, and how many partners a disk has. So the pairs of a chunk go through
three loops without any branch: differences of the two disks into a scratch in the fastest cache, forces of all pairs in vector registers
(a pair out of contact gets zero), sums into the disks.
"""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import fused_inline_kernel, fused_kernel, inline_kernel, kernel
from ninedisk.core.dem.plane.kick_kernels import is_fixed
from ninedisk.core.dem.state import (
    BEND,
    BEND_BETA,
    BETA,
    COHESION,
    DASHPOT,
    FRICTION,
    KN,
    KR,
    KS,
    MODEL,
    MU,
    OF_LAW,
    ROLLING,
    ROLLING_DASHPOT,
    SLIP_MIDDLE,
    SLIP_OVERLAP,
    SPRING,
    TORQUE_OVERLAP,
    VISCOUS,
    WALL_MID,
    DiskArrays,
    Laws,
    Losses,
    NeighbourList,
    Views,
    WallArrays,
)
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

Index = int | np.uint64
"""Entry of the list: kernels index with unsigned numbers, which plain Python's `range` turns into its own."""

CHUNK = 128
"""Pairs that go through the loops together."""

DX, DY, REACH, VX, VY, ROLL, SPIN, DASHPOT_X, DASHPOT_Y = (np.uint64(c * CHUNK) for c in range(9))
"""Where the scratch holds, for each pair: ``x_j - x_i``, sum of the radii, ``v_i - v_j``, ``R_i omega_i + R_j omega_j``, ``omega_i +
omega_j``, and the difference of the velocities that dashpots see, if they see other ones."""

TURN, TURN_NOW, BENT = (np.uint64(c * CHUNK) for c in range(9, 12))
"""With `Laws` also: ``omega_i - omega_j``, that of the spins that rolling resistance sees, if it sees other ones, and the torque of the
step before, which the present one replaces."""

(
    PAIR_KN,
    PAIR_COHESION,
    PAIR_KS,
    PAIR_MU,
    PAIR_HALF,
    PAIR_HALF_SLIP,
    PAIR_MIDDLE,
    PAIR_KR,
    PAIR_SPRING,
    PAIR_VISCOUS,
) = (np.uint64(c * CHUNK) for c in range(12, 22))
"""And its law: columns of `Laws.columns`. Those that all laws share are written once, before the run."""

GX, GY, SHEAR, ARM_LOSS, BENDING = DX, DY, REACH, VX, VY
"""Where the results take their place: the force on ``i``, ``fs``, what the overlap takes from each body's torque, and the torque of
rolling resistance on ``j``."""

LOST = (ROLL, SPIN, TURN, TURN_NOW, DASHPOT_X)
"""Where the energy takes its place that the pair has lost in this step, by channels of `Losses`."""

SCRATCH = 22 * CHUNK

STEEP, LEAST = 1e300, 1e-300
"""Stiffness that makes the rolling spring of an instant a constant torque: whatever turns is beyond its limit. And one in the place of
0, below which nothing is divided by, where no spring is."""


@inline_kernel
def dashpot(kn: float, beta: float, inv_m_eff: float) -> float:
    """Coefficient of the contact dashpot [N s/m] ``2 beta sqrt(m_eff kn)``, from ``inv_m_eff = 1/m_i + 1/m_j`` [1/kg].

    Two bodies that nothing moves have none.
    """
    if inv_m_eff == 0.0:
        return 0.0
    return 2.0 * beta * sqrt(kn / inv_m_eff)


@inline_kernel
def normal_force(overlap: float, rate: float, kn: float, beta: float, inv_m_eff: float, cohesion: float) -> float:
    """Normal force [N] ``(kn - cohesion) overlap + c rate`` with the dashpot ``c``; without cohesion it does not pull.

    Parameters
    ----------
    overlap : float
        [m], > 0.
    rate : float
        Time derivative of the overlap [m/s].
    kn : float
        [N/m].
    beta : float
        Contact damping ratio [-].
    inv_m_eff : float
        ``1/m_i + 1/m_j`` [1/kg].
    cohesion : float
        [N/m].
    """
    force = (kn - cohesion) * overlap
    if beta > 0.0:
        force += dashpot(kn, beta, inv_m_eff) * rate
        if cohesion == 0.0:
            force = max(force, 0.0)
    return force


@inline_kernel
def rolling_dashpot(law: NDArray[np.float64], inv_moment: float) -> float:
    """Coefficient of the dashpot of rolling resistance [N m s] ``2 beta sqrt(I kr)``, from ``1/I`` [1/(kg m^2)]."""
    if inv_moment == 0.0:
        return 0.0
    return float(2.0 * law[BEND_BETA] * sqrt(law[KR] / inv_moment))


@inline_kernel
def inverse_moment(radius: float, inv_mass: float, inv_inertia: float) -> float:
    """``1/(I + m R^2)`` [1/(kg m^2)] of a body about its contact; 0 where it is fixed or does not turn."""
    return inv_inertia * inv_mass / (inv_mass + radius * radius * inv_inertia) if inv_mass > 0.0 else 0.0


@inline_kernel
def torque_reach(law: NDArray[np.float64], reduced: float) -> float:
    """Torque of rolling resistance over the repulsive force [m], over the spin as well if it is viscous; from the reduced radius [m]."""
    reach = law[BEND] * reduced
    return float(reach * reduced if law[MODEL] == VISCOUS else reach)


@inline_kernel
def law_of_pair(laws: Laws, disks: DiskArrays, i: int, j: int) -> int:
    """Number of the law of the disks in rows i and j."""
    return int(laws.of_pair[laws.material[disks.name[i]], laws.material[disks.name[j]]])


@inline_kernel
def law_at_wall(laws: Laws, disks: DiskArrays, i: int, w: int) -> int:
    """Number of the law of the disk in row i and a wall."""
    return int(laws.of_wall[w, laws.material[disks.name[i]]])


@fused_inline_kernel
def shear_force(before: float, slip: float, ks: float, cap: float) -> float:
    """Shear force [N] after the slip increment [m], clipped to ``cap = mu fn`` with its sign kept."""
    force = before - ks * slip
    if force > cap:
        return cap
    if force < -cap:
        return -cap
    return force


@inline_kernel
def first_from(pairs: NeighbourList, low: int, high: int, disk: int) -> int:
    """First entry of ``low .. high-1`` whose disk is not below ``disk``; entries ascend."""
    while low < high:
        middle = (low + high) // 2
        if pairs.other[middle] < disk:
            low = middle + 1
        else:
            high = middle
    return low


@inline_kernel
def record_behind_wall(disks: DiskArrays, walls: WallArrays, stripe: int, i: int, w: int, height: float) -> None:
    """Note the disk in row i, whose centre lies ``height`` <= 0 above wall w; fixed disks, which have no contacts with walls, may.

    Every disk behind a wall is in the wall's list, which has no lower limit: one that got there in a single step has moved farther than
    the skin lasts, and the lists are new. Walls that face each other and cross leave every disk behind one of them.
    """
    walls.behind[stripe, 0], walls.behind[stripe, 1], walls.behind[stripe, 2] = 1.0 + disks.name[i], w, height
    walls.passed[0] = 1


@inline_kernel
def sliding_frame(walls: WallArrays, w: int, middle: float) -> tuple[float, float, float, float, float, float]:
    """Point, tangent and the velocity of the point with which a wall's slip is measured: in the middle of the step (1) or at its end."""
    sliding = walls.now
    if middle > 0.0:
        sliding = walls.middle
    spin = walls.now[w, TURN_RATE]
    sx, sy, tx, ty = sliding[w, POINT_X], sliding[w, POINT_Y], -sliding[w, NORMAL_Y], sliding[w, NORMAL_X]
    vx = sliding[w, PIVOT_VX] + spin * (sliding[w, PIVOT_Y] - sy)
    vy = sliding[w, PIVOT_VY] + spin * (sx - sliding[w, PIVOT_X])
    return sx, sy, tx, ty, vx, vy


@inline_kernel
def compliance(stiffness: float) -> float:
    """Its inverse, 0 for none."""
    return 1.0 / max(stiffness, LEAST) if stiffness > 0.0 else 0.0


@fused_inline_kernel
def friction_loss(before: float, after: float, slip: float, inv_ks: float) -> float:
    """Energy that sliding has taken from a shear spring of stiffness ``1/inv_ks`` in a step [J], or its limit from a rolling one; >= 0.

    The forces are those that resist. In the scheme they do the work ``(before + after)/2 slip``, of which the spring keeps
    ``(after^2 - before^2)/(2 ks)``: the rest is ``(before + after)/2`` times what slid, ``slip - (after - before)/ks``. Where a force
    turns round within a step, which takes one of O(dt), it slides against ``after`` alone.
    """
    slid = slip - (after - before) * inv_ks
    mean = 0.5 * (before + after)
    return mean * slid if mean * slid > 0.0 else max(after * slid, 0.0)


@fused_inline_kernel
def law_loss(before: float, after: float, more: float) -> float:
    """Energy that a law takes from the bodies in a step [J], < 0 where it feeds them.

    Its shear force, that of `shear_force`, works on ``more`` than the slip [m]: on what torque's arms have more than those of the slip,
    times the turn, and at a wall on what its surface moves more than the point where its velocity is felt.
    """
    return -0.5 * (before + after) * more


@inline_kernel
def wall_bending(
    disks: DiskArrays,
    pairs: NeighbourList,
    law: NDArray[np.float64],
    losses: Losses | None,
    repulsive: float,
    spin: float,
    slip_dt: float,
    loss_dt: float,
    i: int,
    k: int,
    stripe: int,
) -> float:
    """Torque of rolling resistance [N m] on the wall that turns with ``spin`` [rad/s]; the disk i receives its opposite."""
    turn = disks.omega[i] - spin
    turn_now = disks.omega_now[i] - spin if disks.omega_now.shape[0] > 0 else turn
    limit = torque_reach(law, disks.radius[i]) * repulsive
    before = pairs.bending[k]
    if law[MODEL] == VISCOUS:
        held = limit * turn_now
    elif law[MODEL] == SPRING:
        held = min(max(before + law[KR] * (slip_dt * turn), -limit), limit)
    else:
        held = min(max(STEEP * turn, -limit), limit)
    pairs.bending[k] = held
    damped = 0.0
    if abs(held) < limit and law[MODEL] == SPRING:
        damped = (
            rolling_dashpot(law, inverse_moment(disks.radius[i], disks.inv_mass[i], disks.inv_inertia[i])) * turn_now
        )
    if losses is not None:
        losses.contacts[stripe, ROLLING] += friction_loss(before, held, slip_dt * turn, compliance(law[KR]))
        losses.contacts[stripe, ROLLING_DASHPOT] += loss_dt * damped * turn_now
    return float(held + damped)


@inline_kernel
def end_at_wall(
    disks: DiskArrays,
    walls: WallArrays,
    pairs: NeighbourList,
    laws: Laws | None,
    losses: Losses,
    i: int,
    w: int,
    k: int,
    stripe: int,
) -> None:
    """Count the energy that the springs of a contact with a wall, which has opened, have left; what turned or slid since is O(dt^2)."""
    law = walls.law[w]
    if laws is not None:
        law = laws.rows[law_at_wall(laws, disks, i, w)]
    losses.contacts[stripe, FRICTION] += friction_loss(pairs.shear[k], 0.0, 0.0, compliance(law[KS]))
    if laws is not None:
        losses.contacts[stripe, ROLLING] += friction_loss(pairs.bending[k], 0.0, 0.0, compliance(law[KR]))


@kernel
def disk_wall_forces(
    disks: DiskArrays,
    walls: WallArrays,
    pairs: NeighbourList,
    laws: Laws | None,
    losses: Losses | None,
    slip_dt: float,
    loss_dt: float,
    begin: int,
    end: int,
    stripe: int,
) -> None:
    """Add the forces of the contacts between walls and some disks; update shear forces, add to this stripe's share of the loads.

    Parameters are those of `disk_disk_forces`, the disks being ``begin .. end-1``; rows of ``pairs`` are walls, with
    ascending disks. The normal from disk to wall is the opposite of
    the wall's. The wall's velocity at a point ``q`` is ``v_pivot + spin x (q - pivot)``, with ``q`` the foot of the disk's
    centre on the surface or the middle of the overlap, for the slip at ``t_{n-1/2}`` where that is measured there; the reaction acts at
    the foot.
    """
    dashpot_v = disks.v_now if disks.v_now.shape[0] > 0 else disks.v
    for w in range(walls.now.shape[0]):
        law = walls.law[w]
        kn, ks, mu, beta, cohesion = law[KN], law[KS], law[MU], law[BETA], law[COHESION]
        half, depth = 0.5 * law[TORQUE_OVERLAP], 0.5 * law[WALL_MID]
        half_slip = 0.5 * law[SLIP_OVERLAP]
        rough = mu > 0.0 and ks > 0.0
        px, py, ux, uy = walls.now[w, POINT_X], walls.now[w, POINT_Y], walls.now[w, NORMAL_X], walls.now[w, NORMAL_Y]
        cx, cy, spin = walls.now[w, PIVOT_X], walls.now[w, PIVOT_Y], walls.now[w, TURN_RATE]
        rate_x, rate_y = walls.now[w, DASHPOT_VX], walls.now[w, DASHPOT_VY]
        back = 0.5 * slip_dt * law[SLIP_MIDDLE]
        sx, sy, tx, ty, vx, vy = sliding_frame(walls, w, law[SLIP_MIDDLE])
        load_x, load_y, load_t = walls.share[stripe, w, 0], walls.share[stripe, w, 1], walls.share[stripe, w, 2]
        last = pairs.start[w + 1]
        for k in range(first_from(pairs, pairs.start[w], last, begin), last):
            i = pairs.other[k]
            if i >= end:
                break
            height = (disks.x[i, 0] - px) * ux + (disks.x[i, 1] - py) * uy
            overlap = disks.radius[i] - height
            if overlap <= 0.0:
                if losses is not None:
                    end_at_wall(disks, walls, pairs, laws, losses, i, w, k, stripe)
                pairs.shear[k] = 0.0
                if laws is not None:
                    pairs.bending[k] = 0.0
                continue
            if height <= 0.0 and not is_fixed(disks, i):
                record_behind_wall(disks, walls, stripe, i, w, height)
            if laws is not None:
                law = laws.rows[law_at_wall(laws, disks, i, w)]
                kn, ks, mu, beta, cohesion = law[KN], law[KS], law[MU], law[BETA], law[COHESION]
                half, depth, half_slip = 0.5 * law[TORQUE_OVERLAP], 0.5 * law[WALL_MID], 0.5 * law[SLIP_OVERLAP]
                rough = mu > 0.0 and ks > 0.0
                back = 0.5 * slip_dt * law[SLIP_MIDDLE]
                sx, sy, tx, ty, vx, vy = sliding_frame(walls, w, law[SLIP_MIDDLE])
            foot_x, foot_y = disks.x[i, 0] - height * ux, disks.x[i, 1] - height * uy
            qx, qy = foot_x - depth * overlap * ux - cx, foot_y - depth * overlap * uy - cy
            rate = (rate_x - spin * qy - dashpot_v[i, 0]) * ux + (rate_y + spin * qx - dashpot_v[i, 1]) * uy
            fn = normal_force(overlap, rate, kn, beta, disks.inv_mass[i], cohesion)
            gx, gy = fn * ux, fn * uy
            repulsive = fn
            if laws is not None:
                repulsive = max(fn + cohesion * overlap, 0.0)
                bending = wall_bending(disks, pairs, law, losses, repulsive, spin, slip_dt, loss_dt, i, k, stripe)
                disks.torque[i] -= bending
                load_t += bending
            if losses is not None:
                losses.contacts[stripe, DASHPOT] += loss_dt * (fn - (kn - cohesion) * overlap) * rate
            if rough:
                arm = disks.radius[i] - half * overlap
                # Along itself a wall moves at all points of its surface as at its own, and deeper down so much less.
                vt = (vx - disks.v[i, 0]) * tx + (vy - disks.v[i, 1]) * ty
                height = (disks.x[i, 0] - back * disks.v[i, 0] - sx) * ty - (
                    disks.x[i, 1] - back * disks.v[i, 1] - sy
                ) * tx
                sunk = disks.radius[i] - height
                vt -= spin * depth * sunk
                vt += (disks.radius[i] - half_slip * sunk) * disks.omega[i]
                fs = shear_force(pairs.shear[k], vt * slip_dt, ks, mu * repulsive)
                if losses is not None and slip_dt > 0.0:
                    losses.contacts[stripe, FRICTION] += friction_loss(
                        -pairs.shear[k], -fs, vt * slip_dt, compliance(ks)
                    )
                    more = (spin * depth + (half_slip - half) * disks.omega[i]) * sunk
                    losses.contacts[stripe, OF_LAW] += law_loss(pairs.shear[k], fs, more * slip_dt)
                pairs.shear[k] = fs
                gx += fs * uy
                gy -= fs * ux
                disks.torque[i] += arm * fs
            disks.force[i, 0] += gx
            disks.force[i, 1] += gy
            load_x -= gx
            load_y -= gy
            load_t -= foot_x * gy - foot_y * gx
        walls.share[stripe, w, 0], walls.share[stripe, w, 1], walls.share[stripe, w, 2] = load_x, load_y, load_t


@inline_kernel
def note_law(disks: DiskArrays, laws: Laws, law: NDArray[np.float64], i: int, j: int, k: int) -> None:
    """Law of the listed pair k, of the disks in rows i and j, and what its rolling resistance takes from their radii and masses."""
    number = law_of_pair(laws, disks, i, j)
    for m in range(laws.varying.shape[0]):
        laws.noted[m, k] = laws.columns[laws.varying[m], number]
    ri, rj = disks.radius[i], disks.radius[j]
    laws.reach[k] = torque_reach(law, ri * rj / (ri + rj))
    inverse = inverse_moment(ri, disks.inv_mass[i], disks.inv_inertia[i])
    laws.drag[k] = rolling_dashpot(law, inverse + inverse_moment(rj, disks.inv_mass[j], disks.inv_inertia[j]))


@kernel
def note_pairs(
    disks: DiskArrays, views: Views, pairs: NeighbourList, all_pairs: NDArray[np.float64], laws: Laws | None
) -> None:
    """Row and dashpot coefficient [N s/m] of each listed pair, into ``views``, and its law where pairs have separate ``laws``."""
    for i in range(disks.x.shape[0]):
        for k in range(pairs.start[i], pairs.start[i + 1]):
            j = int(pairs.other[k])
            law = all_pairs
            if laws is not None:
                law = laws.rows[law_of_pair(laws, disks, i, j)]
                note_law(disks, laws, law, i, j, k)
            views.row[k] = i
            views.damping[k] = dashpot(law[KN], law[BETA], disks.inv_mass[i] + disks.inv_mass[j])


@fused_inline_kernel
def gather(
    disks: DiskArrays,
    views: Views,
    pairs: NeighbourList,
    laws: Laws | None,
    begin: Index,
    end: Index,
    scratch: NDArray[np.float64],
) -> None:
    """Differences of the disks of the pairs ``begin .. end-1``, into the scratch."""
    x, v, radius, omega, row, other = views.x, views.v, disks.radius, disks.omega, views.row, pairs.other
    one = np.uint64(1)
    for k in range(begin, end):
        q, i, j = k - begin, np.uint64(row[k]), np.uint64(other[k])
        ix, iy, jx, jy = i + i, i + i + one, j + j, j + j + one
        ri, rj, wi, wj = radius[i], radius[j], omega[i], omega[j]
        scratch[DX + q], scratch[DY + q], scratch[REACH + q] = x[jx] - x[ix], x[jy] - x[iy], ri + rj
        scratch[VX + q], scratch[VY + q] = v[ix] - v[jx], v[iy] - v[jy]
        scratch[ROLL + q], scratch[SPIN + q] = ri * wi + rj * wj, wi + wj
        if laws is not None:
            scratch[TURN + q] = wi - wj


@fused_inline_kernel
def gather_dashpots(
    disks: DiskArrays,
    views: Views,
    pairs: NeighbourList,
    laws: Laws | None,
    begin: Index,
    end: Index,
    scratch: NDArray[np.float64],
) -> None:
    """Differences of the velocities that dashpots see, and of the spins that rolling resistance does, into the scratch."""
    dashpot_v, omega_now, row, other = views.dashpot_v, disks.omega_now, views.row, pairs.other
    one = np.uint64(1)
    for k in range(begin, end):
        q, i, j = k - begin, np.uint64(row[k]), np.uint64(other[k])
        scratch[DASHPOT_X + q] = dashpot_v[i + i] - dashpot_v[j + j]
        scratch[DASHPOT_Y + q] = dashpot_v[i + i + one] - dashpot_v[j + j + one]
        if laws is not None:
            scratch[TURN_NOW + q] = omega_now[i] - omega_now[j]


@inline_kernel
def gather_laws(pairs: NeighbourList, laws: Laws, begin: Index, end: Index, scratch: NDArray[np.float64]) -> None:
    """Laws and history of rolling resistance of the pairs ``begin .. end-1``, into the scratch."""
    noted, bending = laws.noted, pairs.bending
    for k in range(begin, end):
        scratch[BENT + (k - begin)] = bending[k]
    for m in range(laws.varying.shape[0]):
        at = PAIR_KN + np.uint64(laws.varying[m] * CHUNK)
        for k in range(begin, end):
            scratch[at + (k - begin)] = noted[m, k]


@inline_kernel
def keep_bending(pairs: NeighbourList, begin: Index, end: Index, scratch: NDArray[np.float64]) -> None:
    """History of rolling resistance of the pairs ``begin .. end-1``, out of the scratch."""
    bending = pairs.bending
    for k in range(begin, end):
        bending[k] = scratch[BENT + (k - begin)]


def _pair_forces(dashpot_x: np.uint64, dashpot_y: np.uint64, seen: np.uint64) -> Callable[..., None]:
    """Kernel of the forces where the scratch holds the velocities that dashpots see at ``dashpot_x`` and ``dashpot_y``, and the spins
    that rolling resistance sees at ``seen``.

    The compiler has to know all distances in the scratch: only then it finds that no pair waits for another one.
    """

    @fused_inline_kernel
    def pair_forces(
        pairs: NeighbourList,
        damping: NDArray[np.float64],
        law: NDArray[np.float64],
        laws: Laws | None,
        losses: Losses | None,
        slip_dt: float,
        loss_dt: float,
        begin: Index,
        end: Index,
        scratch: NDArray[np.float64],
    ) -> None:
        """Forces of the pairs ``begin .. end-1`` from their differences, which they replace; updates their history."""
        shear = pairs.shear
        begun, inv_ks = 1.0 if slip_dt > 0.0 else 0.0, compliance(law[KS])
        kn, ks = law[KN], law[KS]
        mu = law[MU] if ks > 0.0 else 0.0
        half, half_slip = 0.5 * law[TORQUE_OVERLAP], 0.5 * law[SLIP_OVERLAP]
        back = 0.5 * slip_dt * law[SLIP_MIDDLE]
        for q in range(end - begin):
            k = begin + q
            dx, dy = scratch[DX + q], scratch[DY + q]
            d = sqrt(dx * dx + dy * dy)
            overlap, inv_d = scratch[REACH + q] - d, 1.0 / d
            nx, ny = dx * inv_d, dy * inv_d
            rate = scratch[dashpot_x + q] * nx + scratch[dashpot_y + q] * ny
            if laws is None:
                stiff = kn
                fn = max(kn * overlap + damping[k] * rate, 0.0)
                repulsive = fn
            else:
                ks, mu, cohesion = scratch[PAIR_KS + q], scratch[PAIR_MU + q], scratch[PAIR_COHESION + q]
                stiff = scratch[PAIR_KN + q] - cohesion
                fn = stiff * overlap + damping[k] * rate
                fn = fn if cohesion > 0.0 else max(fn, 0.0)
                repulsive = max(fn + cohesion * overlap, 0.0)
                half, half_slip = scratch[PAIR_HALF + q], scratch[PAIR_HALF_SLIP + q]
                back = 0.5 * slip_dt * scratch[PAIR_MIDDLE + q]
            vx, vy = scratch[VX + q], scratch[VY + q]
            mx, my = dx + back * vx, dy + back * vy
            inv_m = 1.0 / sqrt(mx * mx + my * my)
            vt = (vy * dx - vx * dy) * inv_m
            vt += scratch[ROLL + q] - half_slip * (scratch[REACH + q] - (mx * mx + my * my) * inv_m) * scratch[SPIN + q]
            fs = shear_force(shear[k], vt * slip_dt, ks, mu * repulsive)
            if overlap <= 0.0:
                fn, fs = 0.0, 0.0
            if losses is not None:
                if laws is not None:
                    inv_ks = compliance(ks)
                # The overlap anew: a product with two uses would be rounded otherwise than where energies are not asked for.
                pull = fn - stiff * (scratch[REACH + q] - (dx * nx + dy * ny)) if overlap > 0.0 else 0.0
                deep = scratch[REACH + q] - (mx * mx + my * my) * inv_m
                more = (half_slip - half) * deep * scratch[SPIN + q]
                scratch[LOST[OF_LAW] + q] = law_loss(shear[k], fs, more * slip_dt)
                scratch[LOST[DASHPOT] + q] = loss_dt * pull * rate
                scratch[LOST[FRICTION] + q] = begun * friction_loss(-shear[k], -fs, vt * slip_dt, inv_ks)
            if laws is not None:
                turn, turn_now, before, kr = (
                    scratch[TURN + q],
                    scratch[seen + q],
                    scratch[BENT + q],
                    scratch[PAIR_KR + q],
                )
                limit = laws.reach[k] * repulsive
                trial = before + kr * (slip_dt * turn) if scratch[PAIR_SPRING + q] > 0.0 else STEEP * turn
                held = min(max(trial, -limit), limit)
                held = limit * turn_now if scratch[PAIR_VISCOUS + q] > 0.0 else held
                damped = laws.drag[k] * turn_now if abs(held) < limit else 0.0
                if overlap <= 0.0:
                    held, damped = 0.0, 0.0
                if losses is not None:
                    scratch[LOST[ROLLING] + q] = friction_loss(before, held, slip_dt * turn, compliance(kr))
                    scratch[LOST[ROLLING_DASHPOT] + q] = loss_dt * damped * turn_now
                scratch[BENT + q], scratch[BENDING + q] = held, held + damped
            shear[k] = fs
            scratch[GX + q], scratch[GY + q] = -fn * nx - fs * ny, fs * nx - fn * ny
            scratch[SHEAR + q], scratch[ARM_LOSS + q] = fs, half * overlap * fs

    return pair_forces


pair_forces_lagged = _pair_forces(VX, VY, TURN)
pair_forces_extrapolated = _pair_forces(DASHPOT_X, DASHPOT_Y, TURN_NOW)


@fused_inline_kernel
def scatter(
    disks: DiskArrays,
    views: Views,
    pairs: NeighbourList,
    laws: Laws | None,
    losses: Losses | None,
    stripe: int,
    begin: Index,
    end: Index,
    scratch: NDArray[np.float64],
) -> None:
    """Add the forces of the pairs ``begin .. end-1`` to their disks, and what they lost to the stripe's, in the order of the list."""
    force, torque, radius, row, other = views.force, disks.torque, disks.radius, views.row, pairs.other
    one = np.uint64(1)
    friction, dashpots, rolling, rolling_dashpots, own = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(begin, end):
        q, i, j = k - begin, np.uint64(row[k]), np.uint64(other[k])
        ix, iy, jx, jy = i + i, i + i + one, j + j, j + j + one
        gx, gy, fs, loss = scratch[GX + q], scratch[GY + q], scratch[SHEAR + q], scratch[ARM_LOSS + q]
        force[ix] += gx
        force[iy] += gy
        force[jx] -= gx
        force[jy] -= gy
        on_i, on_j = radius[i] * fs - loss, radius[j] * fs - loss
        if laws is not None:
            on_i -= scratch[BENDING + q]
            on_j += scratch[BENDING + q]
        torque[i] += on_i
        torque[j] += on_j
        if losses is not None:
            friction += scratch[LOST[FRICTION] + q]
            dashpots += scratch[LOST[DASHPOT] + q]
            own += scratch[LOST[OF_LAW] + q]
            if laws is not None:
                rolling += scratch[LOST[ROLLING] + q]
                rolling_dashpots += scratch[LOST[ROLLING_DASHPOT] + q]
    if losses is not None:
        losses.contacts[stripe, FRICTION] += friction
        losses.contacts[stripe, DASHPOT] += dashpots
        losses.contacts[stripe, ROLLING] += rolling
        losses.contacts[stripe, ROLLING_DASHPOT] += rolling_dashpots
        losses.contacts[stripe, OF_LAW] += own


@fused_kernel
def disk_disk_forces(
    disks: DiskArrays,
    views: Views,
    pairs: NeighbourList,
    law: NDArray[np.float64],
    laws: Laws | None,
    losses: Losses | None,
    stripe: int,
    slip_dt: float,
    loss_dt: float,
    begin: int,
    end: int,
    scratch: NDArray[np.float64],
) -> None:
    """Add the forces of the disk-disk contacts in some rows to ``disks.force`` and ``disks.torque``; update their history.

    Parameters
    ----------
    disks : DiskArrays
    views : Views
        The same disks, and the list's rows and dashpots as `note_pairs` finds them.
    pairs : NeighbourList
        Rows are the disks with the smaller number.
    law : ndarray, shape (LAW_COLUMNS,)
        Law row.
    laws : Laws or None
        None: all pairs have ``law``.
    losses : Losses or None
        None: nobody asks.
    stripe : int
        Whose losses they are.
    slip_dt : float
        Time over which slip accumulates [s]: ``dt``, or 0 for the forces at time 0.
    loss_dt : float
        Time over which forces that depend on velocities act [s]: ``dt``, or ``dt/2`` at time 0.
    begin, end : int
        Rows of the list.
    scratch : ndarray, shape (SCRATCH,)
        This thread's own.
    """
    chunk = np.uint64(CHUNK)
    extrapolated = disks.v_now.shape[0] > 0
    last = np.uint64(pairs.start[end])
    for low in range(np.uint64(pairs.start[begin]), last, chunk):
        high = min(low + chunk, last)
        gather(disks, views, pairs, laws, low, high, scratch)
        if laws is not None:
            gather_laws(pairs, laws, low, high, scratch)
        if extrapolated:
            gather_dashpots(disks, views, pairs, laws, low, high, scratch)
            pair_forces_extrapolated(pairs, views.damping, law, laws, losses, slip_dt, loss_dt, low, high, scratch)
        else:
            pair_forces_lagged(pairs, views.damping, law, laws, losses, slip_dt, loss_dt, low, high, scratch)
        scatter(disks, views, pairs, laws, losses, stripe, low, high, scratch)
        if laws is not None:
            keep_bending(pairs, low, high, scratch)
