"""Kernels that find out cheaply whether the contact step may be too long for the present state; the session then looks closer."""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import inline_kernel
from ninedisk.core.dem.plane.force_kernels import dashpot, inverse_moment, law_at_wall, law_of_pair, rolling_dashpot
from ninedisk.core.dem.plane.image_kernels import XX, XY, YY, flow_at
from ninedisk.core.dem.state import BETA, COHESION, KN, KR, KS, MODEL, MU, SPRING, Images, Laws, System, Watch
from ninedisk.core.pose import NORMAL_X, NORMAL_Y, POINT_X, POINT_Y


@inline_kernel
def spread(system: System, images: Images | None, t: float) -> float:
    """Bound on the displacement of two disks relative to each other in the last step, in a cell without its flow [m]."""
    x, v, dt = system.disks.x, system.disks.v, system.step.kick.dt
    xx, xy, yy = 0.0, 0.0, 0.0
    if images is not None:
        xx, xy, yy = flow_at(images, t)
    low_x, high_x, low_y, high_y = np.inf, -np.inf, np.inf, -np.inf
    for i in range(v.shape[0]):
        vx, vy = v[i, 0] - (xx * x[i, 0] + xy * x[i, 1]), v[i, 1] - yy * x[i, 1]
        low_x, high_x = min(low_x, vx), max(high_x, vx)
        low_y, high_y = min(low_y, vy), max(high_y, vy)
    return float(dt * sqrt((high_x - low_x) * (high_x - low_x) + (high_y - low_y) * (high_y - low_y)))


@inline_kernel
def add_contact(
    system: System, watch: Watch, law: NDArray[np.float64], stiff: float, share: float, i: int, j: int
) -> None:
    """Add the stiffness and the dashpots of a contact of the disks in rows i and j, or with a wall (-1), to the sums of its disks.

    Any split of a contact between its two ends leaves no eigenvalue of all contacts above the largest sum of a disk
    (`ninedisk.core.dem.space.neighbour_kernels.stiffest`). Normal and shear spring of disks move different coordinates.
    """
    disks = system.disks
    inverse, turn = disks.inv_mass[i], disks.inv_inertia[i]
    arm, about = watch.arm[disks.name[i]], inverse_moment(disks.radius[i], inverse, turn)
    leaning, arms = arm * arm * turn, disks.radius[i] * disks.radius[i] * turn
    if j >= 0:
        mass, inertia, other = disks.inv_mass[j], disks.inv_inertia[j], watch.arm[disks.name[j]]
        about += inverse_moment(disks.radius[j], mass, inertia)
        leaning += other * other * inertia
        arms += disks.radius[j] * disks.radius[j] * inertia
        inverse, turn = inverse + mass, turn + inertia
    normal = (law[KN] - law[COHESION]) * stiff * (inverse + leaning)
    shear = (law[KS] if law[MU] > 0.0 else 0.0) * (inverse + arms)
    drag = share * dashpot(law[KN], law[BETA], inverse) * (inverse + leaning)
    if law[MODEL] == SPRING:
        shear += law[KR] * turn
        drag = max(drag, share * rolling_dashpot(law, about) * turn)
    stiffness = normal + shear if leaning > 0.0 else max(normal, shear)
    watch.sums[i, 0] += stiffness
    watch.sums[i, 1] += drag
    if j >= 0:
        watch.sums[j, 0] += stiffness
        watch.sums[j, 1] += drag


@inline_kernel
def may_be_unstable(system: System, laws: Laws | None, images: Images | None, watch: Watch) -> bool:
    """Whether a bound on the present contacts, those that nearly touch included, does not exclude that the contact step is unstable."""
    disks, walls, step = system.disks, system.walls, system.step
    pairs, wall_pairs, near = system.lists.pairs, system.lists.wall_pairs, watch.near[0]
    share = 0.5 if step.lagged else 1.0
    for i in range(disks.x.shape[0]):
        watch.sums[i, 0], watch.sums[i, 1] = 0.0, 0.0
    for i in range(disks.x.shape[0]):
        for k in range(pairs.start[i], pairs.start[i + 1]):
            j = int(pairs.other[k])
            dx, dy = disks.x[j, 0] - disks.x[i, 0], disks.x[j, 1] - disks.x[i, 1]
            if images is not None:
                along, across = images.shift[2 * k], images.shift[2 * k + 1]
                dx += images.now[XX] * along + images.now[XY] * across
                dy += images.now[YY] * across
            reach = disks.radius[i] + disks.radius[j] + near
            if dx * dx + dy * dy <= reach * reach:
                law = system.law
                if laws is not None:
                    law = laws.rows[law_of_pair(laws, disks, i, j)]
                add_contact(system, watch, law, watch.stiff[0], share, i, j)
    for w in range(walls.now.shape[0]):
        px, py, ux, uy = walls.now[w, POINT_X], walls.now[w, POINT_Y], walls.now[w, NORMAL_X], walls.now[w, NORMAL_Y]
        for k in range(wall_pairs.start[w], wall_pairs.start[w + 1]):
            i = int(wall_pairs.other[k])
            if (disks.x[i, 0] - px) * ux + (disks.x[i, 1] - py) * uy <= disks.radius[i] + near:
                law = walls.law[w]
                if laws is not None:
                    law = laws.rows[law_at_wall(laws, disks, i, w)]
                add_contact(system, watch, law, watch.stiff[1 + w], share, i, -1)
    dt, drag = step.kick.dt, 0.5 * step.kick.drag if step.lagged else 0.0
    worst = 0.0
    for i in range(disks.x.shape[0]):
        worst = max(worst, (0.25 * dt * watch.sums[i, 0] + watch.sums[i, 1]) * dt)
    return worst + drag > 1.0
