"""The Kratos adapter: what it claims, and that what Kratos computes is the scene that was sent.

Runs of the real Kratos are held against exact time-discrete solutions, the in-house DEM, and a plain numpy DEM with Kratos' own
conventions; they are skipped only where Kratos is absent.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ninedisk.core.errors import UnstableTimeStepError
from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall, WallSegment
from ninedisk.core.simulate import simulate
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.case import Setup
from ninedisk.harness.api.engine import EngineError, EngineNotInstalledError, EngineTimeoutError, SupportLevel
from ninedisk.harness.api.params import resolve
from ninedisk.harness.api.registry import get_case
from ninedisk.harness.api.wall_path import wall_path
from ninedisk.harness.cases.nine_disk.scene import LOAD_CASES, MASS
from ninedisk.harness.engines.kratos import adapter as adapter
from ninedisk.harness.engines.kratos.adapter import Kratos
from ninedisk.references.exact_steps.compression import smooth_row

needs_kratos = pytest.mark.skipif(
    not Kratos().info().installed, reason="Kratos is not installed: pip install KratosMultiphysics KratosDEMApplication"
)

ROUND_OFF = 1e-10
"""Of the largest force: it is kn times a difference of positions near 300 m (ulp 5.7e-14 m) over overlaps of some 0.04 m,
1.5e-12 in each evaluation; some hundred cycles add up to less than a hundred of them."""


def variant(case_id: str, **params: object) -> Setup:
    """A variant with Kratos' own place of the slip in the step, where the case has a word for it."""
    case = get_case(case_id)
    if any(parameter.name == "slip_at" for parameter in case.parameters):
        params = {"slip_at": "end", **params}
    return case.build(resolve(case, params).params)


def worst(one: np.ndarray, two: np.ndarray, scale: float | None = None) -> float:
    """Largest difference over the history, relative to the largest value."""
    return float(np.abs(one - two).max() / (np.abs(two).max() if scale is None else scale))


def assert_same(engine: History, core: History, tolerance: float, *names: str) -> None:
    """Observed quantities agree, each relative to the largest value of its kind in the history."""
    force = float(np.abs(core.fn).max())
    scales = {"gap": float(np.abs(core.gap).max()), "fn": force, "fs": force, "wall_force": force}
    for name in ("x", "v", "gap", "fn", "fs", "wall_point", "wall_angle", "wall_force", *names):
        one, two = getattr(engine, name), getattr(core, name)
        assert one.shape == two.shape
        if two.size and np.abs(two).max() > 0.0:
            assert worst(one, two, scales.get(name)) <= tolerance, name
    total = max(float(np.abs(core.energy[key]).max()) for key in ("kinetic", "elastic", "gravity"))
    for name in ("kinetic", "elastic", "gravity"):
        assert worst(engine.energy[name], core.energy[name], total) <= 4.0 * tolerance, name


def plain_dem(setup: Setup, *, wall_arm: str, turns_with_wall: bool) -> np.ndarray:
    """(fn, fs) of the watched disk-disk contacts by a plain numpy DEM with Kratos' conventions and lagged damping, from rest.

    Between disks the arm is R - overlap/2 and shear turns with the normal. At walls the arm is ``wall_arm``, R or R - overlap
    ("height"), and slip is that of the wall's material points over the step; a force there is kept along fixed axes, normal part and
    all, unless ``turns_with_wall``.
    """
    scene, numerics = setup.scene, setup.numerics
    disks, law, dt, n = scene.disks, scene.disk_disk, numerics.dt, len(scene.disks)
    x, v, w = np.array(disks.x), np.zeros((n, 2)), np.zeros(n)
    first, second = np.triu_indices(n, 1)
    reach, radii = disks.radius[first] + disks.radius[second], disks.radius[first]
    shear, kept_at_wall = np.zeros(len(first)), np.zeros((len(scene.walls), n, 2))
    path = wall_path(scene, dt, numerics.n_steps)
    columns = [int(np.flatnonzero((first == i) & (second == j))[0]) for i, j in setup.watch]
    rows = []
    for step in range(numerics.n_steps + 1):
        h = dt if step else 0.0
        force, torque = np.zeros((n, 2)), np.zeros(n)
        d = x[second] - x[first]
        distance = np.linalg.norm(d, axis=1)
        overlap, normal = reach - distance, d / distance[:, None]
        tangent, arm = np.column_stack([-normal[:, 1], normal[:, 0]]), radii - 0.5 * overlap
        fn = np.where(overlap > 0.0, law.kn * overlap, 0.0)
        slip = ((v[first] - v[second]) * tangent).sum(axis=1) + arm * (w[first] + w[second])
        shear = np.clip(shear - law.ks * h * slip, -law.mu * fn, law.mu * fn)
        pull = -fn[:, None] * normal + shear[:, None] * tangent
        np.add.at(force, first, pull)
        np.add.at(force, second, -pull)
        for body in (first, second):
            np.add.at(torque, body, arm * shear)
        rows.append(np.column_stack([fn[columns], shear[columns]]))
        now, before = (path[min(max(k, 0), len(path) - 1)] for k in (step, step - 1))
        for k, wall in enumerate(scene.walls):
            (px, py, ux, uy), (qx, qy, wx, wy) = now[k, :4], before[k, :4]
            height, tangent_w = (x - (px, py)) @ (ux, uy), np.array([uy, -ux])
            along = (x - (px, py)) @ (-uy, ux)
            way = np.array([px - qx, py - qy]) + along[:, None] * np.array([wy - uy, ux - wx])
            load = np.maximum(wall.law.kn * (disks.radius - height), 0.0)
            arm_w = height if wall_arm == "height" else disks.radius
            rub = kept_at_wall[k] @ tangent_w - wall.law.ks * h * ((v - way / dt) @ tangent_w + arm_w * w)
            rub = np.clip(rub, -wall.law.mu * load, wall.law.mu * load)
            total = load[:, None] * (ux, uy) + rub[:, None] * tangent_w
            if turns_with_wall:
                later = path[min(step + 1, len(path) - 1), k, 2:4]
                kept_at_wall[k] = rub[:, None] * np.array([later[1], -later[0]])
            else:
                kept_at_wall[k] = total
            force += total
            torque += arm_w * rub
        kick = dt if step else 0.5 * dt
        v = v + kick * (force / disks.mass[:, None] - scene.xi * v)
        w = w + kick * (torque / disks.inertia - scene.xi * w)
        x = x + dt * v
    return np.array(rows)


@needs_kratos
@pytest.mark.parametrize("load_case", LOAD_CASES)
@pytest.mark.parametrize(("xi", "form"), [(3.0, "central"), (3.0, "lagged"), (0.0, "central")])
def test_smooth_compression_is_the_exact_recurrence(load_case: str, xi: float, form: str) -> None:
    setup = variant("nine-disk/compression", load_case=load_case, xi=xi, damping_form=form, settle_cycles=0)
    history = Kratos().run(setup.scene, setup.numerics, setup.watch).history
    load = LOAD_CASES[load_case]
    middle, wall = smooth_row(
        kn=load.kn,
        mass=MASS,
        xi=xi,
        dt=load.dt,
        n_load=load.load_cycles,
        v_wall=load.v_wall,
        n_steps=200,
        form=form,  # type: ignore[arg-type]
    )
    for column, expected in enumerate((middle, middle, wall, wall)):
        assert worst(history.fn[:, column], expected) <= ROUND_OFF
    assert history.fn[1, 2] == pytest.approx(load.kn * load.v_wall * load.dt, rel=1e-9)  # walls have moved in step 1


@needs_kratos
@pytest.mark.parametrize("load_case", LOAD_CASES)
@pytest.mark.parametrize("form", ["central", "lagged"])
def test_rough_compression_is_the_in_house_dem(load_case: str, form: str) -> None:
    """Corner disks rub on two walls at once: their shear forces are told apart."""
    setup = variant("nine-disk/compression", load_case=load_case, wall_mu="mu", damping_form=form, settle_cycles=0)
    history = Kratos().run(setup.scene, setup.numerics, setup.watch).history
    core = simulate(setup.scene, setup.numerics, setup.watch)
    assert_same(history, core, ROUND_OFF)
    assert np.abs(core.fs).max() > 1e6  # the walls do rub
    # Forces of 1e7 N are rounded by 1e-9 N; times R/I and 200 steps of 0.015 s that turns a disk of 1e10 kg m^2 by 1e-15.
    assert np.abs(history.omega).max() <= 1e-12


@needs_kratos
def test_distortion_is_a_plain_dem_that_keeps_wall_forces_along_fixed_axes() -> None:
    setup = variant("nine-disk/distortion", damping_form="lagged")
    history = Kratos().run(setup.scene, setup.numerics, setup.watch).history
    rows, before = history.step, history.step <= 5000
    own = plain_dem(setup, wall_arm="height", turns_with_wall=False)[rows]
    assert worst(history.fn, own[:, :, 0]) <= 1e-8  # its arms between disks are those of the step before: second order
    assert worst(history.fs, own[:, :, 1]) <= 1e-7
    objective = plain_dem(setup, wall_arm="height", turns_with_wall=True)[rows]
    assert worst(history.fn[before], objective[before, :, 0]) <= ROUND_OFF
    error = worst(history.fn, objective[:, :, 0])
    assert 0.005 < error < 0.05  # what the note about turning walls says
    arm = plain_dem(setup, wall_arm="radius", turns_with_wall=False)[rows]
    assert worst(history.fn, arm[:, :, 0]) > 1e-3  # the convention does make a difference


@needs_kratos
@pytest.mark.parametrize("form", ["central", "lagged"])
def test_rolling_disks_of_disk_inertia_under_gravity_and_damping(form: str) -> None:
    """Disks that overlap at first collide off-centre; the floor under one of them is smooth, so that arms are Kratos' own."""
    law = ContactLaw(kn=1e5, ks=8e4, mu=0.4, lever_arm="overlap", slip_at="end")
    floor = Wall(
        name="floor",
        point=(0, 0),
        normal=(0.1, 1),
        law=ContactLaw(kn=1e5),
        motion=(WallSegment(amplitude=(0.0, 0.05), frequency=30.0, phase=0.4),),
    )
    disks = Disks(
        x=[(0.0, 1.2), (1.79, 1.3), (0.9, 2.53)],  # type: ignore[arg-type]
        radius=[1.0, 0.8, 0.6],  # type: ignore[arg-type]
        mass=[1.0, 2.0, 0.5],  # type: ignore[arg-type]
        v=[(0.0, -1.0), (-1.0, 1.0), (-1.0, -3.0)],  # type: ignore[arg-type]
        omega=[3.0, 0.0, -20.0],  # type: ignore[arg-type]
    )
    scene = Scene(disks=disks, disk_disk=law, walls=(floor,), gravity=(0.5, -9.81), xi=0.5)
    numerics = Numerics(dt=0.001, n_steps=300, contact_dt=1e-4, damping_form=form)  # type: ignore[arg-type]
    watch = [(0, 1), (0, 2), (1, 2), (0, 3)]
    assert Kratos().supports(scene, numerics).level is SupportLevel.EXACT
    history, core = Kratos().run(scene, numerics, watch).history, simulate(scene, numerics, watch)
    assert (np.abs(core.fs).max(axis=0)[:2] > 10.0).all()
    assert core.fn[:, 3].max() > 10.0
    # Kratos takes arms and normals of either end of a step for its slip: normals turn by up to 1e-3 in a step, squared and halved, over
    # the tens of steps of a contact.
    assert_same(history, core, 1e-5, "omega", "angle")


@needs_kratos
@pytest.mark.parametrize("restitution", [1.0, 0.5])
def test_collision_is_the_in_house_dem(restitution: float) -> None:
    setup = variant("binary-collision", restitution=restitution)
    numerics = setup.numerics.replace(damping_form="lagged")
    history = Kratos().run(setup.scene, numerics, setup.watch).history
    core = simulate(setup.scene, numerics, setup.watch)
    # Positions of 3 m are kept as displacements: some thousand steps, each rounded by 4e-16 m, times omega/dt of the contact.
    assert np.abs(history.v - core.v).max() <= 1e-11
    assert np.abs(history.x - core.x).max() <= 1e-11


@needs_kratos
def test_shear_of_a_disk_between_parallel_walls_is_not_observed() -> None:
    rough = ContactLaw(kn=1e5, ks=1e5, mu=0.3)
    sideways = (WallSegment(velocity=(0.1, 0.0)),)
    walls = (
        Wall(name="floor", point=(0, 0), normal=(0, 1), law=rough, motion=sideways),
        Wall(name="lid", point=(0, 1.999), normal=(0, -1), law=rough),
    )
    scene = Scene(disks=Disks(x=[(0.0, 0.9995)], radius=1.0, mass=1.0), disk_disk=rough, walls=walls)  # type: ignore[arg-type]
    history = Kratos().run(scene, Numerics(dt=1e-3, n_steps=5, contact_dt=1e-3), [(0, 1), (0, 2)]).history
    assert history.fn[0].tolist() == pytest.approx([50.0, 50.0])
    assert np.isnan(history.fs).all()


@needs_kratos
def test_run_stopped_half_way_is_a_timeout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    setup, engine = variant("nine-disk/compression"), Kratos()
    engine.time_limit = 2.5
    numerics = setup.numerics.replace(n_steps=200_000, sample_every=200_000)
    with pytest.raises(EngineTimeoutError, match=r"was stopped at its time limit of 2.5 s"):
        engine.run(setup.scene, numerics, [])
    assert list(tmp_path.iterdir()) == []


@needs_kratos
def test_state_that_explodes_is_an_error() -> None:
    scene = variant("nine-disk/compression").scene
    numerics = Numerics(dt=1.0, n_steps=2000, contact_dt=1.0, allow_unstable=True)
    with pytest.raises(EngineError, match=r"stopped being finite|gave up|ended"):
        Kratos().run(scene, numerics, [])


@needs_kratos
def test_step_beyond_the_critical_one_is_the_users_mistake() -> None:
    scene = variant("nine-disk/compression").scene
    with pytest.raises(UnstableTimeStepError, match="exceeds the critical step"):
        Kratos().run(scene, Numerics(dt=1.0, n_steps=1, contact_dt=1.0), [])


@needs_kratos
def test_scene_without_disks_is_an_error() -> None:
    scene = Scene(disks=Disks(x=np.empty((0, 2)), radius=1.0, mass=1.0), disk_disk=ContactLaw(kn=1.0))  # type: ignore[arg-type]
    with pytest.raises(EngineError, match="there is no disk"):
        Kratos().run(scene, Numerics(dt=1.0, n_steps=1, contact_dt=1.0), [])


@needs_kratos
def test_info_and_settings_of_the_real_one() -> None:
    info = Kratos().info()
    assert info.licence == "BSD-4-Clause"
    setup = variant("nine-disk/compression")
    settings = Kratos().run(setup.scene, Numerics(dt=0.01, n_steps=1), setup.watch).settings
    assert settings["engine_version"] == info.version
    assert settings["contact law"] == "DEM_D_Linear_Custom_Constants"
    assert settings["contact_dt"] * settings["contact_steps_per_dt"] == pytest.approx(0.01)


def test_conventions_are_graded_honestly() -> None:
    for wall_mu in (0.0, "mu"):
        setup = variant("nine-disk/compression", wall_mu=wall_mu, lever_arm="radius")
        answer = Kratos().supports(setup.scene, setup.numerics)
        assert (answer.level, answer.notes) == (SupportLevel.EXACT, (adapter.NOTE_SYMMETRY,))
    for arm, capability in (("radius", Capability.LEVER_ARM_RADIUS), ("overlap", Capability.LEVER_ARM_OVERLAP)):
        setup = variant("nine-disk/distortion", lever_arm=arm)
        answer = Kratos().supports(setup.scene, setup.numerics)
        assert (answer.level, answer.missing) == (SupportLevel.APPROXIMATE, (capability,))
        assert {adapter.NOTE_ARMS, adapter.NOTE_ROTATION, adapter.NOTE_TURNING} <= set(answer.notes)
    smooth = variant("nine-disk/distortion", lever_arm="overlap", wall_mu=0.0)
    assert Kratos().supports(smooth.scene, smooth.numerics).level is SupportLevel.EXACT


def test_what_it_lacks_is_graded_honestly() -> None:
    plastic = variant("binary-collision", kind="plastic")
    assert Kratos().supports(plastic.scene, plastic.numerics).level is SupportLevel.EQUIVALENT
    assert Kratos().supports(plastic.scene, plastic.numerics.replace(damping_form="lagged")).level is SupportLevel.EXACT
    for case in ("incline-block", "slip-to-roll"):
        setup = variant(case)
        answer = Kratos().supports(setup.scene, setup.numerics)
        assert answer.level is SupportLevel.NO
        assert Capability.CONTACT_DAMPING in answer.missing
        assert adapter.NOTE_NO_DASHPOT in answer.notes


def test_missing_packages_are_no_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    for absent in adapter.PACKAGES:
        monkeypatch.setattr(
            adapter, "package_version", lambda name, absent=absent: (None, "gone") if name == absent else ("1.0", "")
        )
        assert not Kratos().info().installed
        assert Kratos().info().not_installed_because == "gone"
    setup = variant("nine-disk/compression")
    with pytest.raises(EngineNotInstalledError, match=r"\(gone\): pip install KratosMultiphysics KratosDEMApplication"):
        Kratos().run(setup.scene, setup.numerics, [])
