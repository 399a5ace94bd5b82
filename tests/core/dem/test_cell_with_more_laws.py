"""Materials, cohesion, rolling resistance and Hertz' law in a periodic cell in 2D, which run by the loop of spheres.

The truth is the other loop, that of disks: in a cell with one law for all pairs, and without a cell, where no image touches.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ninedisk.core import (
    BodyForce,
    Cell,
    ContactLaw,
    Disks,
    History,
    InvalidNumericsError,
    Numerics,
    Rolling,
    Scene,
    simulate,
)
from ninedisk.core.dem.session import DemSession

LAW = ContactLaw(kn=2e4, ks=1.5e4, mu=0.4, beta=0.1, slip_at="end")
"""Where slip is that of the middle of a step the loops differ, to second order in the step."""
HERTZ = ContactLaw(e_star=2e6, g_star=1e6, mu=0.4, beta=0.1)
NUMERICS = Numerics(dt=1e-4, n_steps=1_000, contact_dt=1e-4, sample_every=50, allow_unstable=True)
WATCH = [(0, 1), (0, 4), (3, 8), (2, 22), (12, 13)]


def disks() -> Disks:
    """Disks of unequal size, mass and material on a disturbed grid of 1 m by 1 m, one held; rows of them touch each other."""
    rng = np.random.default_rng(7)
    grid = np.stack(np.meshgrid(np.arange(5), np.arange(5), indexing="ij"), axis=-1).reshape(-1, 2)
    n, moves = len(grid), np.arange(len(grid)) != 12
    return Disks(
        x=(grid + 0.5 + rng.uniform(-0.1, 0.1, grid.shape)) / 5.0,
        v=np.where(moves[:, None], rng.normal(0.0, 0.4, (n, 2)), 0.0),
        omega=np.where(moves, rng.normal(0.0, 3.0, n), 0.0),
        radius=rng.uniform(0.45, 0.55, n) / 5.0,
        mass=rng.uniform(0.5, 2.0, n),
        rotating=moves,
        held=np.repeat(~moves[:, None], 2, axis=1),
        material=["glass" if k % 3 else "steel" for k in range(n)],
    )


def agree(one: History, two: History, least: dict[str, float], names: str = "x v angle omega gap fn fs") -> None:
    """Round-off of two loops over 1,000 steps with impacts, 1e-9 of each quantity's size; each is as large as ``least`` says."""
    for name in names.split():
        a, b = getattr(one, name), getattr(two, name)
        size = float(np.abs(a).max())
        assert size >= least.get(name, 0.01), name
        np.testing.assert_allclose(b, a, rtol=0.0, atol=1e-9 * size, err_msg=name)


@pytest.mark.parametrize("form", ["central", "lagged"])
def test_the_two_loops_agree_in_a_cell_that_deforms(form: Any) -> None:
    """A law of materials that is the law of all others changes nothing but the loop. The dashpots, strong ones, do not pull."""
    cell = Cell(size=(1.0, 1.0), rate=((0.4, 2.0), (0.0, -0.5)))
    scene = Scene(
        disks=disks(), disk_disk=replace(LAW, beta=0.6), gravity=(0.5, -1.0), xi=0.5, cell=cell,
        forces=[BodyForce(disk=5, force=(3.0, -8.0), torque=0.2, begin=0.01, end=0.05)], initial_shear={(2, 22): 3.0},
    )  # fmt: skip
    how = NUMERICS.replace(damping_form=form)
    flat, solid = (
        DemSession(each, how, WATCH) for each in (scene, scene.replace(laws={("glass", "steel"): scene.disk_disk}))
    )
    assert flat._spheres is None
    assert solid._spheres is not None
    one, two = flat.run(), solid.run()
    agree(one, two, {"fn": 10.0, "fs": 1.0, "stress": 10.0}, "x v angle omega gap fn fs stress")
    assert one.fs[0, 3] == pytest.approx(3.0)
    assert one.energy.keys() - two.energy.keys() == {"wall_work", "force_work"}  # spheres have them with a budget only
    for name, found in two.energy.items():
        values = one.energy[name]
        np.testing.assert_allclose(found, values, rtol=0.0, atol=1e-9 * (1.0 + np.abs(values).max()), err_msg=name)
    assert np.abs(one.energy["cell_work"]).max() > 0.01
    assert min(one.fn.min(), two.fn.min()) == 0.0
    shear = solid.shear_forces()
    assert len(shear) > 5
    for pair, force in flat.shear_forces().items():
        assert shear[pair] == pytest.approx(force, abs=1e-6)


MORE = {
    "materials": {"laws": {("glass", "steel"): replace(LAW, kn=3e4, mu=0.1, beta=0.3)}},
    "cohesion": {"disk_disk": replace(LAW, cohesion=2e3)},
    "constant rolling": {"disk_disk": replace(LAW, rolling=Rolling(model="constant", mu=0.1))},
    "viscous rolling": {"disk_disk": replace(LAW, rolling=Rolling(model="viscous", mu=0.2))},
    "elastic-plastic rolling": {"disk_disk": replace(LAW, rolling=Rolling(model="elastic-plastic", mu=0.1, kr=20.0, beta=0.2))},
    "Hertz": {"disk_disk": HERTZ},
    "Hertz and linear": {"disk_disk": HERTZ, "laws": {("glass", "steel"): replace(LAW, beta=0.6)}},
}  # fmt: skip


@pytest.mark.parametrize("law", MORE)
def test_images_are_the_same_disks(law: str) -> None:
    """A heap that is cut by all edges of a cell moves as the whole one does without a cell: by images of its disks, whichever they are."""
    given: dict[str, Any] = {"disk_disk": LAW, **MORE[law]}
    whole = Scene(disks=disks(), gravity=(0.0, 0.0), **given)
    cell = Cell(size=(3.0, 3.0))
    rng = np.random.default_rng(2)
    away = rng.integers(-2, 3, (25, 2)) * 3.0
    cut = whole.replace(disks=replace(disks(), x=disks().x + away), cell=cell)
    free = simulate(whole, NUMERICS, WATCH)
    held = simulate(cut, NUMERICS, WATCH)
    held.x[:] -= away
    agree(free, held, {"fn": 10.0, "fs": 1.0})


def test_a_linear_dashpot_beside_hertz_law_does_not_pull() -> None:
    """Two disks with the linear law, and a third under Hertz' law far off: motion and energies of those without the third, by the other
    loop. A dashpot that pulled would take more than the half of the energy that it takes here."""
    x = np.array([[0.0, 0.0], [0.8, 0.6], [50.0, 0.0]])
    both = Disks(x=x[:2], v=[[0.9, 0.5], [0.0, 0.0]], radius=[0.6, 0.4], mass=[2.0, 0.7], material=["steel", "steel"])
    three = Disks(
        x=x,
        v=[[0.9, 0.5], [0.0, 0.0], [0.0, 0.0]],
        radius=[0.6, 0.4, 0.5],
        mass=[2.0, 0.7, 1.0],
        material=["steel", "steel", "glass"],
    )
    law = replace(LAW, beta=0.5)
    how = Numerics(dt=1e-4, n_steps=600, contact_dt=1e-4, energy_budget=True)
    alone = simulate(Scene(disks=both, disk_disk=law), how, [(0, 1)])
    beside = DemSession(Scene(disks=three, disk_disk=law, laws={("glass", "glass"): HERTZ}), how, [(0, 1)])
    assert beside._spheres is not None
    found = beside.run()
    np.testing.assert_allclose(found.fn, alone.fn, rtol=0.0, atol=1e-9 * alone.fn.max())
    np.testing.assert_allclose(found.v[:, :2], alone.v, rtol=0.0, atol=1e-11)
    assert found.fn.min() == 0.0
    for name in ("dashpot_loss", "friction_loss", "elastic", "kinetic"):
        np.testing.assert_allclose(found.energy[name], alone.energy[name], rtol=0.0, atol=1e-10, err_msg=name)
    assert alone.energy["dashpot_loss"][-1] > 0.1


def test_a_checkpoint_in_a_cell_goes_on_to_the_bit(tmp_path: Path) -> None:
    """With materials and rolling resistance, in a cell that shears; more threads change nothing."""
    law = replace(LAW, rolling=Rolling(model="elastic-plastic", mu=0.1, kr=20.0))
    scene = Scene(
        disks=disks(),
        disk_disk=law,
        laws={("glass", "steel"): LAW},
        cell=Cell(size=(1.0, 1.0), rate=((0.0, 2.0), (0.0, 0.0))),
    )
    whole = DemSession(scene, NUMERICS, WATCH).run()
    half = DemSession(scene, NUMERICS, WATCH)
    half.advance(400)
    half.save(tmp_path / "half.npz")
    again = DemSession.load(tmp_path / "half.npz", threads=3).run()
    for name in ("x", "v", "angle", "omega", "gap", "fn", "fs", "stress"):
        assert np.array_equal(getattr(whole, name), getattr(again, name)), name


def test_an_energy_budget_in_a_cell_is_refused() -> None:
    scene = Scene(disks=disks(), disk_disk=HERTZ, cell=Cell(size=(1.0, 1.0)))
    with pytest.raises(InvalidNumericsError, match="energy_budget is not allowed in a periodic cell"):
        simulate(scene, NUMERICS.replace(energy_budget=True))
