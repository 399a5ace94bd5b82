"""The critical step of spheres against closed forms, and sharp on both sides in runs of a block of them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from ninedisk.core import InvalidSceneError, Numerics, UnstableTimeStepError, simulate
from ninedisk.core.dem.space.critical import critical_time_step
from ninedisk.core.dem.space.session import SphereSession
from ninedisk.core.errors import TooFastError
from ninedisk.core.law import Rolling, SphereLaw
from ninedisk.core.scene import PlaneWall, Spheres, SphereScene

R, MASS, KN, OVERLAP = 0.5, 2.0, 1e4, 0.05


def row(n: int, law: SphereLaw) -> SphereScene:
    """``n`` spheres between two planes, each contact with the same force of the linear law."""
    x = np.zeros((n, 3))
    x[:, 1] = (np.arange(n) + 0.5) * (2.0 * R - OVERLAP)
    ends = (0.5 * OVERLAP, 1.0), (n * (2.0 * R - OVERLAP) - 0.5 * OVERLAP, -1.0)
    walls = tuple(
        PlaneWall(name=f"end {y:g}", point=(0.0, y, 0.0), normal=(0.0, side, 0.0), law=law) for y, side in ends
    )
    return SphereScene(spheres=Spheres(x=x, radius=R, mass=MASS), sphere_sphere=law, walls=walls)


def block(law: SphereLaw) -> SphereScene:
    """Three spheres in a row that fixed ones hold from all sides, in balance, shaken a little."""
    step = 2.0 * R - OVERLAP
    free = [(k * step, 0.0, 0.0) for k in range(3)]
    ends = [(-step, 0.0, 0.0), (3 * step, 0.0, 0.0)]
    around = [(x, y * step, z * step) for x, _, _ in free for y, z in ((1, 0), (-1, 0), (0, 1), (0, -1))]
    x = np.array([*free, *ends, *around])
    fixed = np.arange(len(x)) >= 3
    shake = np.where(fixed[:, None], 0.0, 1e-7 * np.cos(np.arange(3 * len(x)).reshape(-1, 3) ** 2))
    spheres = Spheres(
        x=x, radius=R, mass=MASS, v=shake, omega=shake[:, ::-1], rotating=~fixed, held=np.repeat(fixed[:, None], 3, 1)
    )
    return SphereScene(spheres=spheres, sphere_sphere=law)


def limit_of(scene: SphereScene, form: str = "central") -> float:
    session = SphereSession(scene, Numerics(dt=1e-9, n_steps=1, contact_dt=1e-9, damping_form=form))
    return critical_time_step(session._network())


SPRUNG = Rolling(model="elastic-plastic", mu=1e3, kr=0.3 * KN * R**2, beta=0.1)
LINEAR = SphereLaw(kn=KN, ks=0.8 * KN, mu=1e3, rolling=SPRUNG, twisting=replace(SPRUNG, kr=0.5 * KN * R**2))
HERTZ = SphereLaw(e_star=1e5, g_star=1.2e5, mu=1e3)


@pytest.mark.parametrize("n", [1, 3, 40], ids=["one", "all eigenvalues", "the largest one"])
def test_a_row_between_planes_has_the_step_of_its_highest_mode(n: int) -> None:
    omega = np.sqrt((2.0 - 2.0 * np.cos(n * np.pi / (n + 1))) * KN / MASS)
    found = limit_of(row(n, SphereLaw(kn=KN))) * 0.5 * omega
    assert 1.0 - 2e-4 <= found <= 1.0 + 1e-12  # the residual that is enough, to the safe side; round-off


@pytest.mark.long
@pytest.mark.parametrize("form", ["central", "lagged"])
@pytest.mark.parametrize("law", [LINEAR, replace(LINEAR, beta=0.3), HERTZ, replace(HERTZ, beta=0.2)])
def test_the_step_is_sharp_on_both_sides(law: SphereLaw, form: str) -> None:
    scene = block(law)
    critical = limit_of(scene, form)

    def grown(fraction: float) -> float:
        dt = fraction * critical
        numerics = Numerics(dt=dt, n_steps=1500, contact_dt=dt, damping_form=form, allow_unstable=True)
        try:
            h = simulate(scene, numerics)
        except TooFastError:
            return math.inf
        moved = np.abs(h.v[:, :3]).max(axis=(1, 2)) + R * np.abs(h.omega[:, :3]).max(axis=(1, 2))
        return float(moved.max() / moved[0])

    # A mode that the step of 0.99 meets at z near -1 is shaken to some 1/sqrt(1 - 0.99^2) = 7 times its first velocity.
    assert grown(0.99) < 30.0
    # The root is -1.3 without dashpots and at least -1.01 with them: 3e6 times, or until contacts open.
    assert grown(1.01) > 1e3


def test_a_step_beyond_that_of_the_assembly_is_refused() -> None:
    scene = row(3, SphereLaw(kn=KN))
    alone, together = (2.0 / np.sqrt(factor * KN / MASS) for factor in (2.0, 2.0 + np.sqrt(2.0)))
    assert together < 0.99 * alone
    with pytest.raises(UnstableTimeStepError, match="that the contacts have at t = 0 s"):
        simulate(scene, Numerics(dt=1.01 * together, n_steps=1, contact_dt=1.01 * together))
    simulate(scene, Numerics(dt=0.99 * together, n_steps=1, contact_dt=0.99 * together))


@pytest.mark.parametrize("kr", [0.0, 1.0, 10.0])
@pytest.mark.parametrize("beta", [0.0, 0.3])
def test_the_default_step_counts_springs_that_roll_and_twist(kr: float, beta: float) -> None:
    """Grains of a millimetre whose rolling springs are stiffer than their normal ones: a tenth of the limit, as the default promises.

    Of two equal spheres the bounds of the single contact are exact but for shear and rolling together, at most 1/sqrt(2) too short.
    """
    spring = Rolling(model="elastic-plastic", mu=0.3, kr=kr, beta=beta) if kr else None
    law = SphereLaw(kn=2e4, ks=1e4, mu=0.5, rolling=spring, twisting=spring)
    spheres = Spheres(x=[[0.0, 0.0, 0.0], [1.9e-3, 0.0, 0.0]], radius=1e-3, mass=1e-5)
    scene = SphereScene(spheres=spheres, sphere_sphere=law)
    session = SphereSession(scene, Numerics(dt=1e-4, n_steps=3))
    limit = limit_of(scene)
    assert 0.06 * limit < session.contact_dt <= 0.1 * limit * (1.0 + 1e-3)
    session.run()


def test_the_critical_step_is_that_of_all_present_contacts() -> None:
    for n in (1, 3, 40):
        scene = row(n, SphereLaw(kn=KN))
        session = SphereSession(scene, Numerics(dt=1e-3, n_steps=1, contact_dt=1e-4))
        assert session.critical_dt == limit_of(scene) < 2.0 / np.sqrt(1.9 * KN / MASS)


def test_a_default_step_bears_a_large_sphere_among_many_small_ones() -> None:
    """200 spheres about a light one of ten times their radius: its limit is less than a tenth of that of one contact."""
    n, k = 200, np.arange(200)
    up = 1.0 - 2.0 * (k + 0.5) / n
    turn = k * np.pi * (3.0 - np.sqrt(5.0))
    flat = np.sqrt(1.0 - up**2)
    around = np.column_stack([flat * np.cos(turn), flat * np.sin(turn), up])
    x = np.vstack([np.zeros(3), 10.95 * around])
    spheres = Spheres(x=x, radius=[10.0] + [1.0] * n, mass=[1.0] + [1e4] * n)
    scene = SphereScene(spheres=spheres, sphere_sphere=SphereLaw(kn=KN, beta=1.0))
    session = SphereSession(scene, Numerics(dt=1e-2, n_steps=3))
    assert session.contact_dt < session.critical_dt
    session.run()


def test_centres_that_coincide_are_refused_by_name() -> None:
    spheres = Spheres(x=[[0.0, 0.0, 0.0], [5.0, 0.0, 1.0], [9.0, 0.0, 0.0], [5.0, 0.0, 1.0]], radius=R, mass=MASS)
    for step in (None, 1e-4):
        with pytest.raises(
            InvalidSceneError, match=r"spheres 1 and 3 coincide at \(5, 0, 1\): their contact has no normal; move"
        ):
            SphereSession(
                SphereScene(spheres=spheres, sphere_sphere=LINEAR), Numerics(dt=1e-3, n_steps=1, contact_dt=step)
            )
