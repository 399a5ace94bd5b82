"""What the harness makes of scenes in space: depths, contact steps, who is asked, what a rigid engine gets, orders of convergence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ninedisk.core.law import SphereLaw
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import PlaneWall, Spheres, SphereScene
from ninedisk.harness.api.capabilities import Capability, capabilities_asked
from ninedisk.harness.api.case import SphereSetup
from ninedisk.harness.api.engine import SupportLevel
from ninedisk.harness.api.registry import engine_table, get_case, get_engine
from ninedisk.harness.api.support import contact_steps, has_spring_preload, support_of, without_spring_preload
from ninedisk.harness.run.converge import expected_order, round_off
from ninedisk.harness.run.judge import blank_history
from ninedisk.harness.run.runner import penetration

UP = np.array([2.0, -1.0, 2.0]) / 3.0
RIGID = SphereLaw(kn=1e5, ks=1e5, mu=0.3, regularised=True)


def on_slope(law: SphereLaw, *heights: float) -> SphereScene:
    """Spheres of radius 1 at these heights above an oblique plane, 3 apart along it."""
    along = np.array([1.0, 2.0, 0.0]) / np.sqrt(5.0)
    x = [(3.0 + height) * UP + 3.0 * k * along for k, height in enumerate(heights)]
    floor = PlaneWall(name="floor", point=tuple(3.0 * UP), normal=tuple(UP), law=law)
    return SphereScene(
        spheres=Spheres(x=x, radius=1.0, mass=1.0), sphere_sphere=law, walls=(floor,), gravity=(0.0, 0.0, -9.81)
    )


def test_depths_are_those_of_spheres_and_oblique_planes() -> None:
    setup = SphereSetup(scene=on_slope(RIGID, 1.2, 1.1), numerics=Numerics(dt=0.01, n_steps=2), watch=())
    history = blank_history(setup)
    history.x[:] = setup.scene.spheres.x
    history.wall_point[:], history.wall_angle[:] = 3.0 * UP, UP
    assert penetration(setup, history) == 0.0
    history.x[1, 0] -= 0.25 * UP
    assert penetration(setup, history) == pytest.approx(0.05)
    history.x[2, 1] = history.x[2, 0] + [0.0, 1.2, 1.2]
    assert penetration(setup, history) == pytest.approx(2.0 - 1.2 * np.sqrt(2.0))


def test_a_rigid_engine_gets_spheres_that_touch() -> None:
    scene = on_slope(RIGID, 0.9, 1.3)
    freed = without_spring_preload(scene)
    np.testing.assert_allclose(freed.spheres.x @ UP, [4.0, 4.3], atol=1e-15)
    np.testing.assert_allclose(np.cross(freed.spheres.x[0] - scene.spheres.x[0], UP), 0.0, atol=1e-15)
    assert has_spring_preload(scene)
    springs = on_slope(replace(RIGID, regularised=False), 0.9)
    assert without_spring_preload(springs) is springs


def test_only_engines_of_spheres_are_asked() -> None:
    scene, numerics = on_slope(SphereLaw(e_star=1e7), 1.1), Numerics(dt=0.01, n_steps=2)
    for name in engine_table():
        engine = get_engine(name)
        support = support_of(engine, scene, numerics)
        if Capability.SPHERES not in engine.info().capabilities:
            assert support.missing == (Capability.SPHERES,)
    assert support_of(get_engine("dem"), scene, numerics).level is SupportLevel.EXACT
    assert support_of(
        get_engine("yade"), on_slope(SphereLaw(e_star=1e7, surface_energy=1.0, surface="jkr"), 1.1), numerics
    ).missing
    assert {Capability.SPHERES, Capability.HERTZ_MINDLIN, Capability.GRAVITY} == capabilities_asked(scene, numerics)


def test_steps_and_orders() -> None:
    law = SphereLaw(kn=1e5)
    setup = SphereSetup(scene=on_slope(law, 1.1), numerics=Numerics(dt=0.01, n_steps=2), watch=((0, 1),))
    count, step = contact_steps(setup.scene, setup.numerics)
    assert count * step == pytest.approx(0.01)
    assert step < 2.0 / np.sqrt(1e5)
    case, dem = get_case("binary-collision"), get_engine("dem").info()
    orders = {
        "linear": law,
        "damped": replace(law, beta=0.1),
        "hertz": SphereLaw(e_star=1e7),
        "tsuji": SphereLaw(e_star=1e7, beta=0.1),
    }
    orders |= {"rough": SphereLaw(e_star=1e7, g_star=1e7, mu=0.1)}
    found = {
        name: expected_order(case, {}, replace(setup, scene=on_slope(each, 1.1)), dem)[0]
        for name, each in orders.items()
    }
    assert found == {"linear": 2.0, "damped": 1.0, "hertz": 2.0, "tsuji": None, "rough": 1.0}
    history = blank_history(setup)
    history.x[:], history.v[:], history.gap[:] = 1.0, 1.0, -0.01
    hertz, linear = (
        round_off(replace(setup, scene=on_slope(each, 1.1)), dem, history, step)("N", 0.0)
        for each in (SphereLaw(e_star=1e7), SphereLaw(kn=2.0 * 1e7 * np.sqrt(0.01)))
    )
    assert hertz == pytest.approx(linear)
