"""What a NURBS contact costs beside a disk's, and grains of 20 control points; best of interleaved runs."""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt
from time import perf_counter

import numba
import numpy as np
import pytest
from nurbs_shapes_of_tests import outline, periodic, ring

from ninedisk.core import ContactLaw, Disks, Scene
from ninedisk.core.compile import fused_kernel
from ninedisk.core.dem.arrays import disk_arrays, disk_views, law_row
from ninedisk.core.dem.levels import no_levels
from ninedisk.core.dem.neighbours import empty_cells, empty_list
from ninedisk.core.dem.plane.force_kernels import SCRATCH, disk_disk_forces, shear_force
from ninedisk.core.dem.state import (
    BETA,
    KN,
    KS,
    MU,
    SLIP_OVERLAP,
    TORQUE_OVERLAP,
    DiskArrays,
    Lists,
    NeighbourList,
    Views,
)
from ninedisk.core.nurbs.curve import NurbsCurve
from ninedisk.core.nurbs.intersect import NurbsGrains
from ninedisk.core.nurbs.intersect_kernels import contacts_of_pairs
from ninedisk.core.nurbs.mass import centred
from ninedisk.core.nurbs.shapes import disk, fitted
from ninedisk.core.nurbs.state import contact_rows, workspace

pytestmark = [
    pytest.mark.timing,
    pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled"),
]


def best(*runs: Callable[[], object], times: int = 15) -> list[float]:
    """Shortest time [s] of each run; the runs take turns, so that the machine's moods meet all of them."""
    for run in runs:
        run()
    least = [np.inf] * len(runs)
    for _ in range(times):
        for k, run in enumerate(runs):
            begin = perf_counter()
            run()
            least[k] = min(least[k], perf_counter() - begin)
    return least


def nurbs_run(
    curves: list[NurbsCurve], shape: np.ndarray, x: np.ndarray, turn: np.ndarray, pairs: np.ndarray
) -> Callable[[], int]:
    grains = NurbsGrains(curves, shape)
    work, count, out = workspace(grains.table), np.zeros(len(pairs), dtype=np.int64), contact_rows(3 * len(pairs))
    placed = np.column_stack([np.cos(turn), np.sin(turn)])
    return lambda: contacts_of_pairs(grains.table, grains.shape, x, placed, pairs, work, count, out)


@fused_kernel
def one_by_one(
    disks: DiskArrays, views: Views, pairs: NeighbourList, law: np.ndarray, slip_dt: float, begin: int, end: int
) -> None:
    """Forces of the contacts of disks, one pair after the other: the loop of the DEM when the bound was set."""
    x, v, dashpot_v, force, damping = views.x, views.v, views.dashpot_v, views.force, views.damping
    radius, omega, torques = disks.radius, disks.omega, disks.torque
    start, other, shear = pairs.start, pairs.other, pairs.shear
    kn, ks, mu = law[KN], law[KS], law[MU]
    half, half_slip = 0.5 * law[TORQUE_OVERLAP], 0.5 * law[SLIP_OVERLAP]
    rough, damped = mu > 0.0 and ks > 0.0, law[BETA] > 0.0
    one = np.uint64(1)
    for i in range(np.uint64(begin), np.uint64(end)):
        ix, iy = i + i, i + i + one
        xi, yi, ri = x[ix], x[iy], radius[i]
        vxi, vyi, wi = v[ix], v[iy], omega[i]
        fx, fy, torque = 0.0, 0.0, 0.0
        for k in range(np.uint64(start[i]), np.uint64(start[i + one])):
            j = np.uint64(other[k])
            jx, jy = j + j, j + j + one
            dx, dy, reach = x[jx] - xi, x[jy] - yi, ri + radius[j]
            d2 = dx * dx + dy * dy
            if d2 >= reach * reach:
                shear[k] = 0.0
                continue
            d = sqrt(d2)
            overlap, inv_d = reach - d, 1.0 / d
            nx, ny = dx * inv_d, dy * inv_d
            fn = kn * overlap
            if damped:
                rate = (dashpot_v[ix] - dashpot_v[jx]) * nx + (dashpot_v[iy] - dashpot_v[jy]) * ny
                fn = max(fn + damping[k] * rate, 0.0)
            gx, gy = -fn * nx, -fn * ny
            if rough:
                ai, aj = ri - half * overlap, radius[j] - half * overlap
                vt = (v[jx] - vxi) * ny + (vyi - v[jy]) * nx
                vt += (ri - half_slip * overlap) * wi + (radius[j] - half_slip * overlap) * omega[j]
                fs = shear_force(shear[k], vt * slip_dt, ks, mu * fn)
                shear[k] = fs
                gx -= fs * ny
                gy += fs * nx
                torque += ai * fs
                torques[j] += aj * fs
            fx += gx
            fy += gy
            force[jx] -= gx
            force[jy] -= gy
        force[ix] += fx
        force[iy] += fy
        torques[i] += torque


def test_contact_of_disks_against_disks(record_property: Callable[[str, object], None]) -> None:
    """At most 30 times a disk's contact, shear force included, if that one is found by itself, too.

    The DEM finds those of disks several at a time; what they take there is given beside it.
    """
    n = 2_000
    rng = np.random.default_rng(1)
    radii = np.linspace(0.8, 1.2, 8)
    shape = rng.integers(0, 8, 2 * n)
    way, overlap = rng.uniform(-np.pi, np.pi, n), 10.0 ** rng.uniform(-4.0, -1.5, n)
    x = np.zeros((2 * n, 2))
    x[0::2] = 10.0 * rng.uniform(0.0, 1.0, (n, 2))
    reach = radii[shape[0::2]] + radii[shape[1::2]] - overlap
    x[1::2] = x[0::2] + reach[:, None] * np.column_stack([np.cos(way), np.sin(way)])
    law = ContactLaw(kn=1e6, ks=8e5, mu=0.3)
    disks = disk_arrays(Scene(disks=Disks(x=x, radius=radii[shape], mass=1.0), disk_disk=law), lagged=False)
    pairs = empty_list(2 * n, n)
    pairs.start[0::2], pairs.start[1::2] = np.arange(n + 1), np.arange(1, n + 1)
    pairs.other[:] = np.arange(1, 2 * n, 2)
    row = np.array(law_row(law))
    views = disk_views(
        disks, Lists(pairs, empty_list(0, 0), empty_list(2 * n, n), empty_list(0, 0), empty_cells(0), no_levels()), row
    )
    scratch = np.zeros(SCRATCH)
    run = nurbs_run(
        [disk(float(r)) for r in radii], shape, x, rng.uniform(-3.0, 3.0, 2 * n), np.arange(2 * n).reshape(-1, 2)
    )
    assert run() == n
    one_by_one(disks, views, pairs, row, 1e-6, 0, 2 * n)
    alone = disks.force.copy()
    disks.force[:] = 0.0
    disk_disk_forces(disks, views, pairs, row, None, None, 0, 1e-6, 1e-6, 0, 2 * n, scratch)
    assert np.all(np.any(alone != 0.0, axis=1))
    np.testing.assert_allclose(disks.force, alone, rtol=0.0, atol=1e-13 * np.abs(alone).max())  # rounding
    disk_time, many_time, nurbs_time = best(
        lambda: one_by_one(disks, views, pairs, row, 1e-6, 0, 2 * n),
        lambda: disk_disk_forces(disks, views, pairs, row, None, None, 0, 1e-6, 1e-6, 0, 2 * n, scratch),
        run,
    )
    record_property(
        "ns a pair, disk, disks of the DEM and NURBS", [t / n * 1e9 for t in (disk_time, many_time, nurbs_time)]
    )
    print(
        f"disk {disk_time / n * 1e9:.1f} ns a pair ({many_time / n * 1e9:.1f} in the DEM), NURBS {nurbs_time / n * 1e9:.0f} ns, "
        f"{nurbs_time / disk_time:.1f} times ({nurbs_time / many_time:.1f})"
    )
    assert nurbs_time <= 30.0 * disk_time


@pytest.mark.parametrize("kind", ["convex", "wavy"])
def test_a_thousand_grains_of_20_control_points(kind: str, record_property: Callable[[str, object], None]) -> None:
    """Two neighbours a grain in a square lattice, all near or in contact: contacts for over 100,000 grains a second."""
    if kind == "convex":
        curves = [fitted(outline(lambda a, e=e: 1.0 + e * np.cos(2.0 * a)), 20).curve for e in (0.02, 0.04, 0.06, 0.08)]
    else:
        curves = [periodic(ring(20, seed, spread=0.06), 3) for seed in range(4)]
    curves = [centred(curve) for curve in curves]
    rng = np.random.default_rng(2)
    side = 32
    shape = rng.integers(0, 4, side * side)
    gx, gy = (grid.ravel() for grid in np.meshgrid(np.arange(side), np.arange(side)))
    x = 1.97 * np.column_stack([gx, gy]) + rng.uniform(-0.03, 0.03, (side * side, 2))
    here = np.arange(side * side)
    right, up = here[gx < side - 1], here[gy < side - 1]
    pairs = np.concatenate([np.column_stack([right, right + 1]), np.column_stack([up, up + side])])
    run = nurbs_run(curves, shape, x, rng.uniform(-np.pi, np.pi, side * side), pairs)
    contacts = run()
    assert contacts > 0.3 * len(pairs)
    (seconds,) = best(run)
    rate = side * side / seconds
    record_property("grains a second", rate)
    print(
        f"{kind}: {contacts} contacts in {len(pairs)} pairs, {seconds / len(pairs) * 1e9:.0f} ns a pair, {rate:.0f} grains/s"
    )
    assert rate > 100_000
