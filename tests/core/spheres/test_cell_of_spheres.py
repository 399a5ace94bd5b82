"""A periodic cell in 3D: the cell in 2D where nothing moves along an axis; images are the same spheres; its work closes the balance."""

from __future__ import annotations

import json
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
    InvalidSceneError,
    Numerics,
    Rolling,
    Scene,
    Spheres,
    SphereScene,
    TooFastError,
    simulate,
)
from ninedisk.core.dem.space.session import SphereSession

LAW = ContactLaw(kn=2e4, ks=1.5e4, mu=0.4, beta=0.1, lever_arm="overlap", slip_at="end")
HERTZ = ContactLaw(e_star=2e6, g_star=1e6, mu=0.4, beta=0.1, lever_arm="overlap")
SIZE = 1.0
NUMERICS = Numerics(dt=1e-4, n_steps=1_000, contact_dt=1e-4, sample_every=100, allow_unstable=True)


def packing(d: int, seed: int = 3) -> dict[str, Any]:
    """Bodies of unequal size and mass on a disturbed grid of a cell of edges near 1, some of them in other images of it."""
    rng = np.random.default_rng(seed)
    count = 5 if d == 2 else 4
    grid = np.stack(np.meshgrid(*[np.arange(count)] * d, indexing="ij"), axis=-1).reshape(-1, d)
    x = (grid + 0.5 + rng.uniform(-0.1, 0.1, grid.shape)) / count
    n = len(x)
    x[::3] += rng.integers(-2, 3, (len(x[::3]), d))
    return {
        "x": x,
        "v": rng.normal(0.0, 0.4, (n, d)),
        "omega": rng.normal(0.0, 3.0, n if d == 2 else (n, 3)),
        "radius": rng.uniform(0.45, 0.62, n) / count,
        "mass": rng.uniform(0.5, 2.0, n),
    }


def flat_and_solid(axes: tuple[int, int], rate: tuple[float, float, float]) -> tuple[Scene, SphereScene]:
    """A cell in 2D and the same in the plane of two axes in 3D, whose third edge is so long that no image touches; a body is fixed, one
    keeps a component of its velocity, and one is driven."""
    bodies = packing(2)
    moves = np.arange(len(bodies["x"])) != 12
    bodies["v"][~moves], bodies["omega"][~moves] = 0.0, 0.0
    bodies["rotating"] = moves
    inertia = 0.5 * bodies["mass"] * bodies["radius"] ** 2
    held = np.tile(~moves[:, None], 2)
    held[7, 0], held[17] = True, True
    law = replace(LAW, beta=0.0)  # in 2D dashpots do not pull
    flow = np.array([[rate[0], rate[1]], [0.0, rate[2]]])
    flat = Scene(
        disks=Disks(**bodies, held=held, inertia=inertia),
        disk_disk=law,
        cell=Cell(size=(SIZE, SIZE), rate=flow),
        xi=0.5,
    )
    a, b = axes
    third = 3 - a - b
    sign = 1.0 if (b - a) % 3 == 1 else -1.0
    x, v, omega, size, turn = (
        np.zeros((len(inertia), 3)),
        np.zeros((len(inertia), 3)),
        np.zeros((len(inertia), 3)),
        np.full(3, SIZE),
        np.zeros((3, 3)),
    )
    x[:, [a, b]], v[:, [a, b]], omega[:, third] = bodies["x"], bodies["v"], sign * bodies["omega"]
    size[third] = 3.0
    turn[np.ix_([a, b], [a, b])] = flow
    same = {name: bodies[name] for name in ("radius", "mass", "rotating")}
    keeps = np.tile(held.all(axis=1)[:, None], 3)
    keeps[:, [a, b]] = held
    spheres = Spheres(x=x, v=v, omega=omega, held=keeps, inertia=inertia, **same)
    cell = Cell(size=tuple(size), rate=tuple(map(tuple, turn)))
    return flat, SphereScene(spheres=spheres, sphere_sphere=law, cell=cell, xi=0.5)


@pytest.mark.parametrize("axes", [(0, 1), (0, 2), (1, 2)])
def test_a_cell_in_a_plane_is_the_cell_in_2d(axes: tuple[int, int]) -> None:
    """Stretched, sheared over 0.3 of its height and compressed; bodies leave it through all edges. Round-off of 1,000 steps."""
    flat, solid = flat_and_solid(axes, (0.4, 3.0, -0.5))
    pairs = [(0, 1), (0, 5), (3, 24), (7, 12), (6, 11)]
    one, two = simulate(flat, NUMERICS, pairs), simulate(solid, NUMERICS, pairs)
    third = 3 - sum(axes)
    depth = 3.0
    found = {
        "x": (one.x, two.x[..., axes]),
        "v": (one.v, two.v[..., axes]),
        "gap": (one.gap, two.gap),
        "fn": (one.fn, two.fn),
        "stress": (one.stress, depth * two.stress[..., axes, :][..., axes]),
        "cell work": (one.energy["cell_work"], two.energy["cell_work"]),
        "springs": (one.energy["elastic"], two.energy["elastic"]),
        "out of the plane": (np.zeros_like(two.x[..., third]), two.x[..., third]),
    }
    assert np.abs(one.x[-1] - one.x[0]).max() > 0.1
    assert (one.fn > 0.0).any()
    worst = {name: float(np.abs(a - b).max() / (np.abs(a).max() or 1.0)) for name, (a, b) in found.items()}
    assert max(worst.values()) <= 1e-11, worst


def cell_3d(law: ContactLaw = LAW, rate: Any = ((0.2, 1.5, -0.7), (0.0, -0.3, 0.9), (0.0, 0.0, -0.4))) -> SphereScene:
    return SphereScene(spheres=Spheres(**packing(3)), sphere_sphere=law, cell=Cell(size=(1.0, 1.1, 0.95), rate=rate))


@pytest.mark.parametrize("law", [LAW, replace(HERTZ, rolling=Rolling(model="constant", mu=0.1))])
def test_twice_the_cell_is_the_same_cell(law: ContactLaw) -> None:
    """Two periods side by side along each axis in turn: the same motion, half of the stress' contacts in twice the volume."""
    scene = cell_3d(law)
    numerics = NUMERICS.replace(n_steps=300)
    one = simulate(scene, numerics)
    s, edges = scene.spheres, np.array(scene.cell.size)  # type: ignore[union-attr]
    flow = np.array(scene.cell.rate) @ np.diag(edges)  # type: ignore[union-attr]
    for axis in range(3):
        size = edges.copy()
        size[axis] *= 2.0
        step = np.zeros(3)
        step[axis] = edges[axis]
        twice = {name: np.concatenate([getattr(s, name)] * 2) for name in ("omega", "radius", "mass", "inertia")}
        both = Spheres(x=np.concatenate([s.x, s.x + step]), v=np.concatenate([s.v, s.v + flow[:, axis]]), **twice)
        two = simulate(
            replace(scene, spheres=both, cell=replace(scene.cell, size=tuple(size))),
            numerics,  # type: ignore[type-var]
        )
        n = len(s)
        np.testing.assert_allclose(two.x[-1, :n], one.x[-1], rtol=0.0, atol=1e-11)
        moved = step + numerics.dt * numerics.n_steps * flow[:, axis]
        np.testing.assert_allclose(two.x[-1, n:], one.x[-1] + moved, rtol=0.0, atol=1e-11)
        assert two.stress is not None
        assert one.stress is not None
        np.testing.assert_allclose(two.stress[-1, 0], one.stress[-1, 0], rtol=0.0, atol=1e-9 * np.abs(one.stress).max())
        assert two.energy["cell_work"][-1] == pytest.approx(2.0 * one.energy["cell_work"][-1], rel=1e-9)


def test_the_work_of_the_images_is_what_the_spheres_have_gained() -> None:
    """Without friction and dashpots: kinetic and elastic energy change by it, to second order in the step."""
    law = replace(LAW, mu=0.0, ks=0.0, beta=0.0)
    scene = cell_3d(law)

    def drift(dt: float) -> float:
        history = simulate(
            scene, Numerics(dt=dt, n_steps=round(0.06 / dt), contact_dt=dt, sample_every=10, allow_unstable=True)
        )
        energy = history.energy
        gained = energy["kinetic"] + energy["elastic"]
        assert np.abs(energy["cell_work"]).max() > 0.1
        return float(np.abs(gained - gained[0] - energy["cell_work"]).max())

    coarse, fine = drift(2e-4), drift(1e-4)
    assert fine < 0.35 * coarse
    assert fine < 0.01 * float(np.sum(scene.spheres.mass * np.sum(scene.spheres.v**2, axis=1)))


def test_one_sphere_touches_its_own_images() -> None:
    """A cubic lattice of one sphere in a cell below its diameter: three contacts, sigma = kn overlap/size^2 on each axis."""
    radius, size = 0.5, 0.96
    law = ContactLaw(kn=1e4)
    scene = SphereScene(
        spheres=Spheres(x=[[7.3, -4.1, 0.2]], radius=radius, mass=1.0),
        sphere_sphere=law,
        cell=Cell(size=(size, 0.98, 0.99)),
    )
    session = SphereSession(scene, NUMERICS.replace(n_steps=10))
    history = session.run()
    assert session.counts.contacts == 3
    volume = size * 0.98 * 0.99
    expected = [1e4 * (2.0 * radius - edge) * edge / volume for edge in (size, 0.98, 0.99)]
    assert history.stress is not None
    np.testing.assert_allclose(history.stress[-1, 0], np.diag(expected), rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(history.x[-1], history.x[0], atol=1e-12)


def test_a_checkpoint_goes_on_to_the_same_bits(tmp_path: Path) -> None:
    scene = cell_3d(replace(HERTZ, rolling=Rolling(model="elastic-plastic", mu=0.1, kr=1.0)))
    numerics = NUMERICS.replace(n_steps=200, sample_every=50)
    exact = SphereSession(scene, numerics)
    whole: History = exact.run()
    assert exact.counts.rebuilds > 3
    session = SphereSession(scene, numerics)
    session.advance(73)
    session.save(tmp_path / "half.npz")
    for found in (session.run(), SphereSession.load(tmp_path / "half.npz").run()):
        for name in ("x", "v", "omega", "stress"):
            np.testing.assert_array_equal(getattr(found, name), getattr(whole, name))
        assert found.energy["cell_work"][-1] == whole.energy["cell_work"][-1]


def test_plain_data_give_the_same_scene() -> None:
    scene = replace(
        cell_3d(replace(LAW, cohesion=3.0)),
        xi=0.3,
        forces=(BodyForce(disk=3, force=(1.0, 0.1, -2.0), torque=(0.1, 0.2, 0.3), begin=0.1),),
        initial_shear={(0, 1): (0.1, 0.2, 1.0 / 3.0)},
    )
    assert SphereScene.from_dict(json.loads(json.dumps(scene.to_dict()))) == scene


def test_what_a_cell_cannot_have_is_refused() -> None:
    scene = cell_3d()
    with pytest.raises(InvalidSceneError, match=r"cell rate\[2\]\[1\] = 1"):
        Cell(size=(1.0, 1.0, 1.0), rate=((0, 0, 0), (0, 0, 0), (0, 1.0, 0)))
    with pytest.raises(InvalidSceneError, match="3 edges"):
        replace(scene, cell=Cell(size=(1.0, 1.0)))
    for changes, numerics, error, words in (
        ({"cell": Cell(size=(1.0, 1.0, 0.05))}, NUMERICS, InvalidSceneError, "largest radius"),
        ({"cell": Cell(size=(1.0, 1.0, 1.0), rate=((0, 0, 0), (0, -20, 0), (0, 0, 0)))}, NUMERICS, InvalidNumericsError, "along y"),
        ({}, NUMERICS.replace(energy_budget=True), InvalidNumericsError, "energy_budget"),
        ({"sphere_sphere": replace(HERTZ, surface_energy=1.0, surface="jkr")}, NUMERICS, InvalidSceneError, "jkr"),
        ({"spheres": replace(scene.spheres, v=1e4 * scene.spheres.v)}, NUMERICS, TooFastError, "moves"),
    ):  # fmt: skip
        with pytest.raises(error, match=words):
            simulate(replace(scene, **changes), numerics)
