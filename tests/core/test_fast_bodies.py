"""Bodies that move so far in a contact step that they could jump over a contact are refused, all others run."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from ninedisk.core import Cell, ContactLaw, Disks, History, NonFiniteStateError, Numerics, Scene, TooFastError, simulate
from ninedisk.core.dem.leaps import leaping_pair
from ninedisk.core.law import SphereLaw
from ninedisk.core.nurbs.mass import uniform_grain
from ninedisk.core.nurbs.shapes import ellipse
from ninedisk.core.scene import Spheres, SphereScene

R, KN = 0.5, 1e4


def shot(
    speed: float, *, space: bool, aside: float = 0.0, drift: float = 0.0, radius: float = R
) -> SphereScene | Scene:
    """A body that flies at another one, or past it ``aside``; both ``drift`` along."""
    x, v = np.zeros((2, 3)), np.zeros((2, 3))
    x[1], v[0, 0] = (5.0, aside, 0.0), speed
    v[:, 0] += drift
    if space:
        return SphereScene(spheres=Spheres(x=x, v=v, radius=[R, radius], mass=1.0), sphere_sphere=SphereLaw(kn=KN))
    return Scene(disks=Disks(x=x[:, :2], v=v[:, :2], radius=[R, radius], mass=1.0), disk_disk=ContactLaw(kn=KN))


def run(scene: SphereScene | Scene, steps: int = 20) -> History:
    return simulate(scene, Numerics(dt=1e-3, n_steps=steps, contact_dt=1e-3))


@pytest.mark.parametrize("space", [False, True])
@pytest.mark.parametrize("speed", [510.0, 1e3, 1e5, 1e12])
def test_bodies_that_would_pass_through_each_other_are_refused(speed: float, space: bool) -> None:
    noun = "sphere" if space else "disk"
    words = rf"{noun} 0 moves {speed * 1e-3:g} m against {noun} 1 in the contact step.*at most 0\.5 m.*contact_dt of at most".replace(
        "+", r"\+"
    )
    with pytest.raises(TooFastError, match=words):
        run(shot(speed, space=space))


@pytest.mark.parametrize("space", [False, True])
def test_the_smaller_radius_is_the_limit(space: bool) -> None:
    with pytest.raises(TooFastError, match=r"at most 0\.05 m"):
        run(shot(60.0, space=space, radius=0.05), 200)


@pytest.mark.parametrize(("space", "speed"), [(False, 490.0), (False, 100.0), (True, 100.0)])
def test_bodies_below_the_limit_run(speed: float, space: bool) -> None:
    """So soft a contact as this one disks do pass through at the higher speed, as the springs say; no step misses it."""
    history = run(shot(speed, space=space), 60)
    assert np.ptp(history.v[:, 1, 0]) > 1e-3 * speed


def test_spheres_that_go_through_each_other_head_on_are_named() -> None:
    """Their normal turns round within a step, about no axis: there are no forces then."""
    with pytest.raises(NonFiniteStateError, match="the state of sphere 0 stopped being finite"):
        run(shot(490.0, space=True), 60)


@pytest.mark.parametrize("space", [False, True])
def test_harmless_bodies_run(space: bool) -> None:
    """Far from everything, or side by side with all others: in straight lines, to round-off of the coordinates."""
    for scene in (shot(1e5, space=space, aside=20.0), shot(0.0, space=space, drift=1e5)):
        history = run(scene)
        bodies = scene.spheres if isinstance(scene, SphereScene) else scene.disks
        np.testing.assert_allclose(history.x[-1], bodies.x + 20e-3 * bodies.v, rtol=1e-12)


def test_a_cell_has_the_limit_for_all_its_disks_but_not_for_its_flow() -> None:
    def scene(speed: float, rate: float) -> Scene:
        x = np.array([[0.0, 0.0], [5.0, 3.0], [2.0, 99.0]])
        v = np.column_stack([rate * x[:, 1], np.zeros(3)])
        v[0, 0] += speed
        return Scene(
            disks=Disks(x=x, v=v, radius=R, mass=1.0),
            disk_disk=ContactLaw(kn=KN),
            cell=Cell(size=(100.0, 100.0), rate=((0.0, rate), (0.0, 0.0))),
        )

    run(scene(0.0, 100.0))
    with pytest.raises(TooFastError, match=r"disk 0 moves 0\.3 m against the cell's flow.*at most 0\.25 m"):
        run(scene(600.0, 0.0))


def test_the_limit_of_an_outline_is_its_smallest_distance_from_the_centre() -> None:
    """An ellipse of the half axes 2 and 0.1 m, which a step of 0.15 m jumps over."""
    grain = uniform_grain(ellipse(2.0, 0.1), 1.0)
    disks = Disks(
        x=[[0.0, 0.0], [0.0, 5.0]],
        v=[[0.0, 0.0], [0.0, -150.0]],
        radius=grain.radius,
        mass=1.0,
        inertia=grain.inertia,
        outline=0,
    )
    with pytest.raises(TooFastError, match=r"at most 0\.1 m"):
        run(Scene(disks=disks, disk_disk=ContactLaw(kn=KN), outlines=(ellipse(2.0, 0.1),)), 60)


def test_the_pair_is_that_of_brute_force(part: Callable[[int], int]) -> None:
    """Random clouds of both dimensions: a pair is found where, and only where, one breaks the rule."""
    rng = np.random.default_rng(3)
    found = 0
    for k in range(part(200)):
        n, d = int(rng.integers(2, 30)), 2 + k % 2
        x, radius = rng.uniform(-6.0, 6.0, (n, d)), rng.uniform(0.2, 1.0, n)
        step = rng.normal(0.0, 1.0, (n, d)) * rng.choice([0.01, 0.3, 3.0], (n, 1))
        fixed, skin = rng.random(n) < 0.2, 0.1
        bad = set()
        for i in range(n):
            for j in range(i):
                move, way = step[j] - step[i], float(np.linalg.norm(step[j] - step[i]))
                at = np.linspace(-(1.0 + skin / way), skin / way, 4001)
                nearest = np.linalg.norm(x[j] - x[i] + at[:, None] * move, axis=1).min()
                if way > min(radius[i], radius[j]) and nearest < radius[i] + radius[j] and not fixed[[i, j]].all():
                    bad.add((j, i))
        pair = leaping_pair(x, step, radius, radius, fixed, skin)
        assert (pair is None) == (not bad), k
        assert pair is None or (min(pair), max(pair)) in bad
        found += pair is not None
    assert 20 < found < 180


@pytest.mark.parametrize("aside", [0.0, 0.7, 0.999])
@pytest.mark.parametrize("speed", [1e3, 1e5])
def test_contact_dynamics_misses_no_fast_disk(speed: float, aside: float) -> None:
    """Its contacts bound the displacement of the step itself: what is approached is met, whatever the speed."""
    scene = shot(speed, space=False, aside=aside)
    history = simulate(scene, Numerics(dt=1e-3, n_steps=20), method="cd")
    assert history.v[-1, 1, 0] > 0.0
