"""Periodic cells: images, their forces, the stress and the work of a deforming cell."""

from __future__ import annotations

import copy
from pathlib import Path

import numpy as np
import pytest
from oracle import Oracle
from scenes import difference
from test_threads import assert_same_bits

from ninedisk.core import Cell, ContactLaw, Disks, History, InvalidNumericsError, InvalidSceneError, Numerics, Scene
from ninedisk.core.dem import session as session_module
from ninedisk.core.dem.session import DemSession
from ninedisk.core.dem.state import REBUILDS

KN, SHEAR = 1000.0, 2.0
LAW = ContactLaw(kn=KN, ks=0.5 * KN, mu=0.4, beta=0.1)
RATE = ((0.1, SHEAR), (0.0, -0.15))


def crowd(columns: int, rows: int, rate: tuple[tuple[float, float], ...] = RATE, law: ContactLaw = LAW) -> Scene:
    """Shuffled disks of several sizes that fill a deforming cell, in its flow and with some motion beside it."""
    rng = np.random.default_rng(4)
    x = np.array([[1.7 * i + 0.85 * (j % 2), 1.5 * j] for i in range(columns) for j in range(rows)])
    x = rng.permutation(x + rng.uniform(-0.05, 0.05, x.shape))
    disks = Disks(
        x=x,
        v=x @ np.array(rate).T + rng.normal(0.0, 0.5, x.shape),
        omega=rng.normal(0.0, 1.0, len(x)),
        radius=rng.uniform(0.7, 1.0, len(x)),
        mass=rng.uniform(0.5, 2.0, len(x)),
    )
    return Scene(disks=disks, disk_disk=law, cell=Cell(size=(1.7 * columns, 1.5 * rows), rate=rate))  # type: ignore[arg-type]


def how(n_steps: int, **more: object) -> Numerics:
    return Numerics(dt=1e-3, contact_dt=1e-3, n_steps=n_steps, **more)  # type: ignore[arg-type]


NEAR = np.array([[p, q] for p in range(-3, 4) for q in (-1, 0, 1)])
"""Images about the one that rounding finds; the cell leans by less than three of its first edge."""


class Images(Oracle):
    """The twin in a cell: every pair is visited at each of the images that may be near."""

    def __init__(self, scene: Scene, numerics: Numerics) -> None:
        super().__init__(scene, numerics)
        self.image_shear: dict[tuple[int, int], dict[tuple[int, int], float]] = {}
        self.stress, self.feed = np.zeros((2, 2)), 0.0

    def _disk_disk(self, i: int, j: int) -> None:
        cell = self.scene.cell
        assert cell is not None
        h, motion = cell.edges(self.step * self.dt), np.array(cell.rate) @ np.diag(cell.size)
        middle = np.round(np.linalg.solve(h, self.x[i] - self.x[j]))
        near = middle + NEAR
        distance = np.hypot(*(self.x[j] - self.x[i] + near @ h.T).T)
        reach = self.scene.disks.radius[i] + self.scene.disks.radius[j]
        shear, normal = 0.0, 0.0
        saved = [array[j].copy() for array in (self.x, self.v, self.v_before)]
        kept, self.image_shear[i, j] = self.image_shear.get((i, j), {}), {}
        for q in np.flatnonzero(distance < reach):
            whole = (int(near[q, 0]), int(near[q, 1]))
            self.x[j] += h @ whole
            for v in (self.v, self.v_before):
                v[j] += motion @ whole
            self.shear[i, j] = kept.get(whole, 0.0)
            before = self.force[i].copy()
            super()._disk_disk(i, j)
            self.image_shear[i, j][whole] = self.shear[i, j]
            force, branch = self.force[i] - before, self.x[j] - self.x[i]
            self.stress -= np.outer(force, branch) / np.linalg.det(h)
            self.feed += force @ motion @ whole
            if q == np.argmin(distance):
                shear, normal = self.shear[i, j], self.normal[i, j]
            for array, value in zip((self.x, self.v, self.v_before), saved, strict=True):
                array[j] = value
        self.gap[i, j], self.shear[i, j], self.normal[i, j] = distance.min() - reach, shear, normal

    def find_forces(self) -> None:
        self.stress, self.feed = np.zeros((2, 2)), 0.0
        super().find_forces()


@pytest.mark.long
@pytest.mark.parametrize(("sort_from", "form", "steps"), [(1, "central", 200), (10**9, "lagged", 50)])
def test_disks_and_images_follow_the_twin(
    sort_from: int, form: str, steps: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Through a strain of 0.4, so that images change rows and the least tilt changes."""
    monkeypatch.setattr(session_module, "SORT_FROM", sort_from)
    scene = crowd(3, 8)
    numerics = how(steps, damping_form=form)
    twin = Images(scene, numerics)
    expected = twin.run()
    session = DemSession(scene, numerics, twin.pairs)
    found = session.run()
    assert session._progress.clock[REBUILDS] > 2
    if sort_from == 1:
        assert len(set(session._team.stripe.tolist())) > 2, "a ring of stripes"
    assert max(difference(found, expected, ("x", "v", "omega", "gap", "fn", "fs")).values()) < 1e-9
    assert np.abs(found.fs).max() > 1.0


def test_stress_and_work_are_those_of_the_twin() -> None:
    """Of every sample; the work by the trapezoidal rule."""
    scene, steps = crowd(4, 4), 20
    twin = Images(scene, how(steps))
    stress, power = [], []
    for _ in range(steps + 1):
        twin.find_forces()
        stress.append(twin.stress)
        power.append(twin.feed)
        twin.move()
    found = DemSession(scene, how(steps)).run()
    assert found.stress is not None
    np.testing.assert_allclose(found.stress[:, 0], stress, rtol=0, atol=1e-10 * np.abs(stress).max())
    work = np.concatenate([[0.0], np.cumsum(0.5e-3 * (np.array(power[1:]) + power[:-1]))])
    np.testing.assert_allclose(found.energy["cell_work"], work, rtol=0, atol=1e-11 * np.abs(work).max())
    h = scene.cell.edges(found.t[-1])  # type: ignore[union-attr]
    flow = np.array(RATE) @ np.linalg.inv(np.eye(2) + found.t[-1] * np.array(RATE))
    beside = found.v[-1] - found.x[-1] @ flow.T
    beside -= np.average(beside, axis=0, weights=scene.disks.mass)
    kinetic = np.einsum("i,ia,ib->ab", scene.disks.mass, beside, beside) / np.linalg.det(h)
    np.testing.assert_allclose(found.stress[-1, 1], kinetic, rtol=0, atol=1e-12 * np.abs(kinetic).max())


def tiled(scene: Scene, times: tuple[int, int]) -> Scene:
    """The same arrangement in a cell that holds it several times."""
    cell, disks = scene.cell, scene.disks
    assert cell is not None
    motion = np.array(cell.rate) @ np.diag(cell.size)
    copies = [np.array(s) for s in np.ndindex(times)]
    many = {
        name: np.concatenate([getattr(disks, name)] * len(copies)) for name in ("omega", "radius", "mass", "inertia")
    }
    return scene.replace(
        disks=Disks(
            x=np.concatenate([disks.x + np.diag(cell.size) @ s for s in copies]),
            v=np.concatenate([disks.v + motion @ s for s in copies]),
            **many,
        ),
        cell=Cell(size=(cell.size[0] * times[0], cell.size[1] * times[1]), rate=cell.rate),
    )


@pytest.mark.parametrize("columns", [1, 2])
def test_a_cell_may_be_smaller_than_a_disk(columns: int) -> None:
    """A pair then touches through several images, a disk its own: as its copies do in a cell that has room for all."""
    small = crowd(columns, 2, rate=((-0.05, 0.8), (0.0, 0.05)))
    found = DemSession(small, how(600, sample_every=100)).run()
    n = len(small.disks)
    large = DemSession(tiled(small, (4, 3)), how(600, sample_every=100)).run()
    np.testing.assert_allclose(large.x[:, :n], found.x, rtol=0, atol=1e-9)
    np.testing.assert_allclose(large.omega[:, n : 2 * n], found.omega, rtol=0, atol=1e-9)
    assert found.stress is not None
    assert large.stress is not None
    np.testing.assert_allclose(large.stress, found.stress, rtol=0, atol=1e-8 * np.abs(found.stress).max())


def test_which_image_the_scene_names_and_who_looks_does_not_matter() -> None:
    """Disks moved by whole edges with the edges' motion, in a frame that flies along."""
    scene = crowd(5, 4)
    cell, s = scene.cell, np.array([[(i * 3) % 4 - 2, i % 3 - 1] for i in range(20)])
    assert cell is not None
    motion, fly = np.array(cell.rate) @ np.diag(cell.size), np.array([3.0, -2.0])
    disks = Disks(
        x=scene.disks.x + s * np.array(cell.size),
        v=scene.disks.v + s @ motion.T + fly,
        **{name: getattr(scene.disks, name) for name in ("omega", "radius", "mass", "inertia")},
    )
    one = DemSession(scene, how(300)).run()
    two = DemSession(scene.replace(disks=disks), how(300)).run()
    edges = np.array([cell.edges(t) for t in one.t])
    back = two.x - fly * one.t[:, None, None] - np.einsum("tab,ib->tia", edges, s)
    np.testing.assert_allclose(back, one.x, rtol=0, atol=1e-9)
    assert one.stress is not None
    assert two.stress is not None
    np.testing.assert_allclose(two.stress, one.stress, rtol=0, atol=1e-7 * np.abs(one.stress).max())


def test_momentum_stays_and_energy_grows_by_the_work_of_the_cell() -> None:
    """Smooth springs lose nothing but to the second order of the scheme; with losses, momentum still stays to round-off."""
    law = ContactLaw(kn=KN)

    def error(dt: float) -> float:
        numerics = Numerics(dt=0.02, contact_dt=dt, n_steps=20)
        energy = DemSession(crowd(4, 4, law=law), numerics).run().energy
        total = energy["kinetic"] + energy["elastic"] - energy["cell_work"]
        assert np.ptp(energy["cell_work"]) > 0.1 * energy["kinetic"][0]
        return float(np.ptp(total))

    errors = [error(dt) for dt in (1e-3, 5e-4, 2.5e-4)]
    assert errors[0] / errors[2] > 8.0, "second order: 16, less what contacts that open and close within a step change"
    scene = crowd(6, 6)
    history = DemSession(scene, how(1000, sample_every=100)).run()
    momentum = np.einsum("i,tia->ta", scene.disks.mass, history.v)
    np.testing.assert_allclose(momentum, np.broadcast_to(momentum[0], momentum.shape), rtol=0, atol=1e-10)


def big() -> Scene:
    return crowd(45, 46)


def test_threads_pauses_and_checkpoints_leave_every_bit(tmp_path: Path) -> None:
    scene, watch = big(), [(0, 1), (5, 1000)]
    numerics = how(120, sample_every=20)
    one = DemSession(scene, numerics, watch)
    history = one.run()
    assert one._progress.clock[REBUILDS] > 3
    for threads in (2, 3):
        assert_same_bits(history, DemSession(scene, numerics, watch, threads=threads).run())
    paused = DemSession(scene, numerics, watch, threads=2)
    paused.advance(53)
    twin = copy.copy(paused)
    paused.save(tmp_path / "half")
    assert_same_bits(history, DemSession.load(tmp_path / "half").run())
    assert_same_bits(history, twin.run())


def test_contacts_are_counted_and_preloaded_through_the_edges() -> None:
    scene = Scene(
        disks=Disks(x=[[0.4, 1.0], [5.6, 1.0]], radius=0.5, mass=1.0),
        disk_disk=ContactLaw(kn=KN, ks=KN, mu=0.5),
        cell=Cell(size=(6.0, 3.0)),
        initial_shear={(0, 1): -3.0},
    )
    session = DemSession(scene, how(5), [(0, 1)])
    assert session.counts.contacts == 1
    assert session.shear_forces() == {(0, 1): -3.0}
    history = session.run()
    assert history.gap[0, 0] == pytest.approx(-0.2)
    assert history.fn[0, 0] == pytest.approx(0.2 * KN)
    assert history.fs[0, 0] == -3.0
    with pytest.raises(InvalidSceneError, match=r"gap 0\.1 m"):
        DemSession(scene.replace(cell=Cell(size=(6.3, 3.0))), how(5))


@pytest.mark.parametrize(
    ("cell", "error", "words"),
    [
        (Cell(size=(6.0, 0.4)), InvalidSceneError, r"cell size\[1\] = 0.4 m .* at least the largest radius, 0.5 m"),
        (Cell(size=(6.0, 2.0), rate=((0.0, 0.0), (0.0, -100.0))), InvalidNumericsError, "after 0.0075 s.*n_steps up to 7"),
    ],
)  # fmt: skip
def test_a_cell_without_space_is_refused(cell: Cell, error: type[Exception], words: str) -> None:
    scene = Scene(disks=Disks(x=[[1.0, 1.0]], radius=0.5, mass=1.0), disk_disk=LAW, cell=cell)
    with pytest.raises(error, match=words):
        DemSession(scene, how(20))


@pytest.mark.parametrize("step", [None, 1e-3])
def test_a_disk_that_touches_its_own_image_bears_the_stress_of_its_overlap(step: float | None) -> None:
    """``fn L/(L Ly)`` with ``fn = kn (2 R - L)``, of one disk and of two in rows that do not touch each other."""
    radius, length, height = 0.5, 0.9, 3.0
    for x in ([[0.1, 0.2]], [[0.1, 0.2], [0.4, 1.7]]):
        disks = Disks(x=x, radius=radius, mass=1.0)
        scene = Scene(disks=disks, disk_disk=ContactLaw(kn=KN, ks=KN, mu=0.5), cell=Cell(size=(length, height)))
        history = DemSession(scene, Numerics(dt=1e-3, contact_dt=step, n_steps=10)).run()
        assert history.stress is not None
        expected = np.zeros((2, 2))
        expected[0, 0] = len(x) * KN * (2.0 * radius - length) / height
        np.testing.assert_allclose(history.stress[:, 0], np.broadcast_to(expected, (11, 2, 2)), rtol=1e-13, atol=1e-10)
        np.testing.assert_array_equal(history.x, np.broadcast_to(disks.x, history.x.shape))


def test_a_disk_between_its_own_images_swings_as_fast_as_the_critical_step_says() -> None:
    """Both ends of the shear spring turn alike: ``omega^2 = ks (2 R)^2/I`` of one image on either side, counted once."""
    ks, inertia = 40.0 * KN, 0.125
    scene = Scene(
        disks=Disks(x=[[0.1, 0.2]], radius=0.5, mass=1.0, inertia=inertia, omega=[1e-4]),
        disk_disk=ContactLaw(kn=KN, ks=ks, mu=1e3),
        cell=Cell(size=(0.9, 3.0)),
    )
    fast = np.sqrt(ks / inertia)
    session = DemSession(scene, Numerics(dt=0.01 / fast, n_steps=700, contact_dt=0.01 / fast))
    assert session.critical_dt == pytest.approx(2.0 / fast, rel=2e-4)
    turned = session.run().angle[:, 0]
    t = np.arange(701) * 0.01 / fast
    np.testing.assert_allclose(turned, 1e-4 / fast * np.sin(fast * t), rtol=0, atol=1e-3 * 1e-4 / fast)


def test_laws_of_a_single_disk_in_a_cell_are_those_of_its_images() -> None:
    """It touches its images along x: a stress ``(kn - cohesion) overlap d/area``, compression positive, whatever the loop."""
    for cohesion in (0.0, 0.2 * KN):
        scene = Scene(
            disks=Disks(x=[[0.1, 0.2]], radius=0.5, mass=1.0),
            disk_disk=ContactLaw(kn=KN, cohesion=cohesion),
            cell=Cell(size=(0.9, 3.0)),
        )
        stress = DemSession(scene, how(1)).run().stress
        assert stress is not None
        truth = [[(KN - cohesion) * 0.1 * 0.9 / 2.7, 0.0], [0.0, 0.0]]
        np.testing.assert_allclose(stress[:, 0], [truth] * len(stress), rtol=1e-12, atol=1e-12 * KN)


def test_scenes_without_a_cell_have_no_stress() -> None:
    scene = Scene(disks=Disks(x=[[0.0, 0.0]], radius=0.5, mass=1.0), disk_disk=LAW)
    history: History = DemSession(scene, how(2)).run()
    assert history.stress is None
    assert "cell_work" not in history.energy
