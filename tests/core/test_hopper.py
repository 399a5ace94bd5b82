"""The hopper of the gallery: fixed disks bear and do not move, the plug holds, and the discharge obeys Beverloo's law."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from ninedisk.core import InvalidSceneError, Numerics, Scene, packings, simulate
from ninedisk.core.cd.session import CdSession
from ninedisk.core.dem.session import DemSession

OUTLET = 4.0


@pytest.fixture(scope="module")
def full() -> Scene:
    return packings.settle(packings.hopper(80, outlet=OUTLET))


def test_a_closed_hopper_holds_its_grains_and_an_open_one_lets_them_through_the_outlet_alone(full: Scene) -> None:
    disks, grains = full.disks, ~full.disks.fixed
    assert disks.x[grains, 1].min() > 0.0 - 0.5, "above the plug"
    assert (disks.v == 0.0).all()
    history = simulate(packings.discharge(full), Numerics(dt=0.05, n_steps=200))
    assert np.array_equal(history.x[:, ~grains], np.broadcast_to(disks.x[~grains], history.x[:, ~grains].shape))
    y = history.x[:, grains, 1]
    assert (y[-1] < -1.0).mean() > 0.9, "empty but for those that lie on the slopes"
    # Below the rows' lowest disks, as soon as it is past them, every grain is under the outlet.
    passing = (y < -0.5) & (y > -1.5)
    assert passing.any()
    assert np.abs(history.x[:, grains, 0][passing]).max() < 0.5 * OUTLET + 0.6


@pytest.mark.parametrize("spacing", [1.0, 0.8])
def test_fixed_disks_have_no_contacts_among_themselves_and_with_walls(spacing: float) -> None:
    """They touch or overlap, in springs and in rigid contacts; a grain that rests on them loads them as a wall is loaded."""
    scene = packings.hopper(1, outlet=1.5)
    x = np.array([[0.0, 0.5], *([[spacing * (k - 4), -0.5] for k in range(9)])])
    is_fixed = np.arange(10) > 0
    still = np.column_stack([is_fixed, is_fixed])
    disks = replace(
        scene.disks, x=x, radius=np.full(10, 0.5), mass=np.full(10, 700.0), inertia=np.full(10, 80.0), v=np.zeros((10, 2)),
        omega=np.zeros(10), held=still, rotating=~is_fixed, outline=np.full(10, -1), angle=np.zeros(10),
    )  # fmt: skip
    law = replace(scene.disk_disk, beta=0.0, regularised=True, restitution=0.0)
    plug = replace(scene.walls[2], point=(0.0, -1.0), law=law)
    scene = scene.replace(disks=disks, disk_disk=law, walls=(plug,))
    row = 5  # the fixed disk right below the grain
    rigid = CdSession(scene, Numerics(dt=1e-3, n_steps=20), watch=[(0, row), (row, row + 1), (row, 10)]).run()
    assert np.array_equal(rigid.x[-1, is_fixed], x[is_fixed])
    assert rigid.fn[-1] == pytest.approx([700.0 * packings.GRAVITY, 0.0, 0.0], rel=1e-9)
    damped = scene.replace(disk_disk=replace(law, beta=0.5), walls=(replace(plug, law=replace(law, beta=0.5)),))
    springs = DemSession(damped, Numerics(dt=1e-2, n_steps=100), watch=[(0, row)]).run()
    assert np.array_equal(springs.x[-1, is_fixed], x[is_fixed])
    assert springs.fn[-1] == pytest.approx([700.0 * packings.GRAVITY], rel=1e-6)
    for energy in springs.energy.values():
        assert np.isfinite(energy).all()
    moving = scene.replace(disks=replace(disks, v=np.where(still, 0.1, 0.0)))
    with pytest.raises(InvalidSceneError, match="disk 1 is held in a motion"):
        DemSession(moving, Numerics(dt=1e-3, n_steps=1))


@pytest.mark.slow
def test_discharge_obeys_beverloos_law() -> None:
    """``W = C rho sqrt(g) (D - k d)^(3/2)`` in two dimensions, whatever the height of the filling.

    W. A. Beverloo, H. A. Leniger and J. van de Velde, Chem. Eng. Sci. 15 (1961) 260-269: k = 1.4, and by others between 1 and 1.5.
    The slope of log W over log(D - 1.3 d) at four outlets of two hoppers each has a standard error of 0.03, and k's range moves it
    by 0.08: 3/2 is expected within 0.1. A liquid would have 1, and a rate that falls with the square root of the height.
    """
    n, diameter, rates = 600, 1.0, {}
    for outlet in (5.0, 7.0, 9.0, 11.0):
        rates[outlet] = np.mean([_rates(n, outlet, seed) for seed in (0, 1)], axis=0)
    early, late = np.array(list(rates.values())).T
    assert late / early == pytest.approx(1.0, abs=0.15), "a third of the height less, a liquid's rate falls by a fifth"
    width = np.log(np.array(list(rates)) - 1.3 * diameter)
    slope = np.polyfit(width, np.log(0.5 * (early + late)), 1)[0]
    assert slope == pytest.approx(1.5, abs=0.1)
    # C over the plane's filled part, 0.8: between half and twice Beverloo's 0.58 for three dimensions
    factor = 0.5 * (early + late) / (0.8 * packings.DENSITY * math.sqrt(packings.GRAVITY) * np.exp(1.5 * width))
    assert ((factor > 0.5) & (factor < 1.5)).all()


def _rates(n: int, outlet: float, seed: int) -> tuple[float, float]:
    """Mass flows [kg/s] while the parts 0.1 to 0.3 and 0.3 to 0.5 of the grains come out."""
    scene = packings.discharge(packings.settle(packings.hopper(n, outlet=outlet, seed=seed)))
    whole = n / (math.sqrt(packings.GRAVITY) * (outlet - 1.3) ** 1.5)
    history = simulate(scene, Numerics(dt=0.8 * whole / 200, n_steps=200), particles=range(n))
    out = (scene.disks.mass[:n] * (history.x[:, :, 1] < -0.5)).sum(axis=1) / float(scene.disks.mass[:n].sum())
    assert out[-1] > 0.5
    at = [float(np.interp(part, out, history.t)) for part in (0.1, 0.3, 0.5)]
    mass = 0.2 * float(scene.disks.mass[:n].sum())
    return mass / (at[1] - at[0]), mass / (at[2] - at[1])
