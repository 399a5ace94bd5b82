"""Observers in other units, along turned axes and in moving frames: there and back, on engines, with an absolute threshold planted."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from ninedisk.core.law import Rolling, SphereLaw
from ninedisk.core.scene import WallSegment
from ninedisk.harness.api.params import resolve
from ninedisk.harness.api.registry import get_case
from ninedisk.harness.cases.incline.block import CASE as INCLINE
from ninedisk.harness.cases.invariance.frames import Frame, SpaceFrame
from ninedisk.harness.cases.invariance.observers import CASES, SCENES, UNITS
from ninedisk.harness.cases.invariance.sphere_observers import AXES, SEEN
from ninedisk.harness.engines.bullet.adapter import ENGINE as BULLET
from ninedisk.harness.engines.dem.adapter import ENGINE as DEM
from ninedisk.harness.engines.esys_particle.adapter import ENGINE as ESYS
from ninedisk.harness.engines.lammps.adapter import ENGINE as LAMMPS
from ninedisk.harness.engines.pymunk.adapter import ENGINE as PYMUNK

UNIT, ROTATION, GALILEI = CASES
VARIANTS = [(case, params) for case in CASES for params in case.matrix()]
IDS = [f"{case.id}-{resolve(case, params).id}" for case, params in VARIANTS]


def needs(engine):
    return pytest.mark.skipif(not engine.info().installed, reason=f"{engine.id} is not installed")


@pytest.mark.parametrize(("case", "params"), VARIANTS, ids=IDS)
def test_the_matrix_passes(run_cell, case, params):
    engines = [DEM] if params["scene"] == "compression" else [DEM, PYMUNK]
    for engine in engines:
        cell = run_cell(case, engine, params)
        assert cell.failures == [], engine.id
        assert cell.checks


@pytest.mark.parametrize("scene", SCENES)
def test_there_and_back_is_the_identity(scene):
    case, overrides, _ = SCENES[scene]
    setup = case.build(resolve(case, overrides).params)
    there = Frame(length=1e3, mass=7.0, time=60.0, angle=0.7, velocity=(3.0, -2.0))
    steps = (Frame(length=1e-3, mass=1 / 7.0, time=1 / 60.0), Frame(velocity=(-3.0, 2.0)), Frame(angle=-0.7))
    back = there.setup(setup)
    assert back.numerics.n_steps == setup.numerics.n_steps
    for frame in steps:
        back = frame.setup(back)
    for name in ("x", "v", "omega", "radius", "mass", "inertia"):
        got, want = getattr(back.scene.disks, name), getattr(setup.scene.disks, name)
        assert np.allclose(got, want, rtol=1e-13, atol=1e-12)
    assert np.allclose(back.scene.gravity, setup.scene.gravity, rtol=1e-13, atol=1e-14)
    for one, two in zip(back.scene.walls, setup.scene.walls, strict=True):
        assert np.allclose([*one.point, *one.normal], [*two.point, *two.normal], atol=1e-12)
        for segment, other in zip(one.motion, two.motion, strict=False):
            assert np.allclose(segment.velocity, other.velocity, atol=1e-12)


def test_a_wall_of_a_moving_frame_never_rests():
    setup = INCLINE.build(resolve(INCLINE, {}).params)
    (wall,) = Frame(velocity=(3.0, 0.0)).setup(setup).scene.walls
    assert wall.motion[-1].velocity == (3.0, 0.0)
    assert wall.motion[-1].duration == float("inf")
    (still,) = Frame(angle=0.5).setup(setup).scene.walls
    assert still.motion == ()
    turning = dataclasses.replace(wall, motion=(WallSegment(angular_velocity=1.0),))
    with pytest.raises(ValueError, match="turn or swing"):
        Frame(angle=0.5).setup(dataclasses.replace(setup, scene=setup.scene.replace(walls=(turning,))))


@pytest.mark.parametrize("scene", SEEN)
def test_there_and_back_is_the_identity_in_space(scene):
    """Each rotation, shift, mirror and unit is undone by another observer; mirrors turn spins round once more."""
    case, overrides, _ = SEEN[scene]
    setup = case.build(resolve(case, overrides).params)
    axis = AXES["skew"]
    there = SpaceFrame(length=1e3, mass=7.0, time=60.0, angle=0.7, axis=axis, mirror=True, velocity=(3.0, -2.0, 1.0))
    back = there.setup(setup)
    assert np.linalg.det(there.matrix) == pytest.approx(-1.0)
    for frame in (
        SpaceFrame(length=1e-3, mass=1 / 7.0, time=1 / 60.0), SpaceFrame(velocity=(-3.0, 2.0, -1.0)), SpaceFrame(mirror=True),
        SpaceFrame(angle=-0.7, axis=axis),
    ):  # fmt: skip
        back = frame.setup(back)
    for name in ("x", "v", "omega", "radius", "mass", "inertia"):
        got, want = getattr(back.scene.spheres, name), getattr(setup.scene.spheres, name)
        assert np.allclose(got, want, rtol=1e-13, atol=1e-12)
    assert np.allclose(back.scene.gravity, setup.scene.gravity, rtol=1e-13, atol=1e-14)
    for one, two in zip(back.scene.walls, setup.scene.walls, strict=True):
        assert np.allclose([*one.point, *one.normal], [*two.point, *two.normal], atol=1e-12)
        assert np.allclose([one.law.kn, one.law.ks], [two.law.kn, two.law.ks], rtol=1e-13)
        for segment, other in zip(one.motion, two.motion, strict=False):
            for name in ("velocity", "angular_velocity", "pivot"):
                assert np.allclose(getattr(segment, name), getattr(other, name), atol=1e-12)


def test_stiffnesses_of_spheres_in_other_units():
    """E* is a force over an area, g one over a length, kr a moment: in mm, g and ms a newton is 1, a metre 1000."""
    law = SphereLaw(
        e_star=2e9, g_star=1e9, surface_energy=0.5, rolling=Rolling(model="elastic-plastic", mu=0.1, kr=3.0)
    )
    seen = SpaceFrame(length=1e3, mass=1e3, time=1e3).law(law)
    assert seen.rolling is not None
    assert (seen.e_star, seen.g_star, seen.surface_energy, seen.rolling.kr) == pytest.approx((2e3, 1e3, 5e-4, 3e3))


def test_a_sphere_that_is_held_is_seen_from_no_other_frame():
    setup = SEEN["throw"][0].build(resolve(SEEN["throw"][0], {}).params)
    held = setup.scene.replace(spheres=dataclasses.replace(setup.scene.spheres, held=True))
    with pytest.raises(ValueError, match="held"):
        SpaceFrame(angle=0.5).setup(dataclasses.replace(setup, scene=held))


def found(cell):
    return cell.seen


def test_an_absolute_slop_is_seen(run_cell):
    """0.005 of the engine's length, whatever that is: 5 nm and 5 km are as wrong as 5 mm."""
    length, _, _ = UNITS["um-ug-us"]

    def slop(history):
        history.gap[:] -= 0.005

    cell = run_cell(UNIT, PYMUNK, {"scene": "slide", "units": "um-ug-us"}, slop)
    assert "gap" in found(cell)
    assert cell.observed.series["gap"][1].min() == pytest.approx(-0.005 / length, rel=1e-3)


def test_damping_towards_the_rest_frame_is_seen(run_cell):
    def drag(history):
        history.v[:] *= np.exp(-1e-9 * history.t)[:, None, None]

    assert "vx" in found(run_cell(GALILEI, PYMUNK, {"scene": "slide", "frame_vx": 3.0}, drag))
    assert "vx_1" in found(
        run_cell(GALILEI, DEM, {"scene": "collision", "frame_vy": -2000.0 / 7}, lambda h: h.v.__imul__(1.001))
    )


def test_friction_along_fixed_axes_is_seen(run_cell):
    def axes(history):
        history.v[:, 0, 1] += 1e-9 * history.t
        history.x[:, 0, 1] += 1e-9 * history.t

    assert {"vx", "x"} & found(run_cell(ROTATION, PYMUNK, {"scene": "slide", "angle_deg": 217.0}, axes))


@needs(BULLET)
@pytest.mark.parametrize("units", ["um-ug-us", "km-Mg-min"])
def test_bullet_is_given_lengths_alone(run_cell, units):
    for scene in ("slide", "roll"):
        assert run_cell(UNIT, BULLET, {"scene": scene, "units": units}).failures == []


@needs(LAMMPS)
def test_lammps_in_units_that_make_large_numbers(run_cell):
    assert run_cell(UNIT, LAMMPS, {"scene": "slide", "units": "um-ug-us"}).failures == []


@needs(ESYS)
def test_esys_particle_takes_a_box_that_is_turned(run_cell):
    assert run_cell(ROTATION, ESYS, {"scene": "compression", "angle_deg": 30.0}).failures == []


def test_checks_do_not_depend_on_the_values(run_cell, judge_history):
    for case, params in VARIANTS[:2]:
        names = [(c.quantity, c.norm, c.truth) for c in run_cell(case, DEM, params).checks]
        blank = judge_history(case, DEM.info(), params, None)
        assert [(c.quantity, c.norm, c.truth) for c in blank.checks] == names
        assert len(blank.failures) == len(names)


def test_the_registry_finds_each():
    assert [get_case(case.id) is case for case in CASES] == [True] * 3
