"""The Kratos adapter: what it claims, and that what Kratos computes is the scene that was sent.

Runs of the real Kratos are held against exact time-discrete solutions, the in-house DEM, and a plain numpy DEM with Kratos' own
conventions; they are skipped only where Kratos is absent.
"""

from __future__ import annotations

import numpy as np
import pytest
from ninedisk_tests_comparison import ROUND_OFF, assert_same, variant, worst

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall, WallSegment
from ninedisk.core.simulate import simulate
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.case import Setup
from ninedisk.harness.api.engine import EngineNotInstalledError, SupportLevel
from ninedisk.harness.api.wall_path import wall_path
from ninedisk.harness.engines.kratos import adapter as adapter
from ninedisk.harness.engines.kratos.adapter import Kratos

needs_kratos = pytest.mark.skipif(
    not Kratos().info().installed, reason="Kratos is not installed: pip install KratosMultiphysics KratosDEMApplication"
)


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
def test_walls_have_their_own_dashpots_not_that_of_the_disks() -> None:
    """Disks that never meet go to and fro between two walls: elastic ones keep their speed, to the phase of a contact's step."""
    damped, elastic = (
        ContactLaw(kn=1e5, beta=beta, restitution=e, regularised=True) for beta, e in ((0.2, 0.5), (0.0, 1.0))
    )
    disks = Disks(
        x=np.array([(1.2, 2.0), (1.2, 8.0)]), v=np.array([(2.0, 0.0), (-1.0, 0.0)]), radius=np.ones(2), mass=np.ones(2)
    )
    walls = tuple(
        Wall(name=name, point=(at, 0.0), normal=(to, 0.0), law=elastic)
        for name, at, to in (("left", 0.0, 1.0), ("right", 3.0, -1.0))
    )
    scene, steps = Scene(disks=disks, disk_disk=damped, walls=walls), Numerics(dt=1e-3, n_steps=2000, contact_dt=1e-4)
    v = Kratos().run(scene, steps, []).history.v[:, :, 0]
    assert np.count_nonzero(np.diff(np.sign(v[:, 0]))) >= 3
    assert np.abs(v).max(axis=0) == pytest.approx([2.0, 1.0], rel=1e-3)
    assert np.abs(v[-40:]).max(axis=0) == pytest.approx([2.0, 1.0], rel=1e-2)


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
    assert_same(history, core, 1e-5)


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
