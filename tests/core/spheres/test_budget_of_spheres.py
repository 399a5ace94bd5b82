"""Where the energy of spheres goes: the balance at the order of the scheme, closed forms of every channel, no bit for the asking."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from test_against_twin import CONSTANT, DT, SPRING, TWIST, box
from twin import law_of

from ninedisk.core import History, InvalidNumericsError, Numerics, PlaneSegment, PlaneWall, Spheres, SphereScene
from ninedisk.core.law import Rolling
from ninedisk.core.simulate import simulate

LOST = ("friction_loss", "dashpot_loss", "rolling_loss", "law_loss")
UNDAMPED = {name: replace(each, beta=0.0) for name, each in {**SPRING, **TWIST}.items()}


def at_rest(**law: Any) -> SphereScene:
    """The box with nothing held in a motion, and walls that only turn and swing."""
    scene = box(**law)
    spheres, walls = scene.spheres, scene.walls
    still = np.where(spheres.rotating[:, None], spheres.omega, 0.0)
    smooth = tuple(replace(wall, motion=() if wall.name == "back" else wall.motion) for wall in walls)
    return replace(scene, walls=smooth, spheres=replace(spheres, v=spheres.v * ~spheres.held, omega=still))


def budget(scene: SphereScene, dt: float, end: float = 3e-3, **settings: Any) -> History:
    numerics = Numerics(dt=5e-5, n_steps=round(end / 5e-5), contact_dt=dt, energy_budget=True, **settings)
    return simulate(scene, numerics)


def unbalanced(history: History) -> float:
    energy = history.energy
    total = sum(energy[name] for name in ("kinetic", "elastic", "gravity", *LOST)) - energy["wall_work"]
    return float(np.abs(total - total[0]).max() / energy["kinetic"][0])


@pytest.mark.long
@pytest.mark.parametrize(
    ("law", "form", "order"),
    [
        ({}, "central", 2.0),
        ({"unloading": "rescale", **UNDAMPED}, "central", 2.0),
        ({"unloading": "none", "lever_arm": "overlap", **CONSTANT}, "central", 2.0),
        ({"lever_arm": "torque-overlap"}, "central", 2.0),
        ({**SPRING, **TWIST}, "central", 2.0),
        ({"slip_at": "end"}, "lagged", 1.0),
        ({"surface_energy": 2.0, "mu": 0.0}, "central", 1.0),  # a pull that is there or not
    ],
    ids=["force", "rescale", "none-overlap", "arms", "damped-springs", "lagged", "dmt"],
)
def test_the_balance_closes_at_the_order_of_the_scheme(law: dict[str, Any], form: Any, order: float) -> None:
    histories = [budget(at_rest(**law), DT / 2**k, damping_form=form) for k in range(4)]
    off = [unbalanced(each) for each in histories]
    assert off[-1] < 1e-3
    assert np.log2(off[0] / off[-1]) / 3.0 > order - 0.25, off
    for name in ("friction_loss", "dashpot_loss", "rolling_loss"):
        reported = [each.energy[name] for each in histories]
        assert np.diff(reported[-1]).min() >= -1e-12
        if (name == "rolling_loss") == ("rolling" in law) and law.get("mu", 1.0) > 0.0:
            assert reported[-1][-1] > 0.1 * histories[-1].energy["kinetic"][0]


def test_asking_costs_no_bit_and_motions_that_are_held_are_refused() -> None:
    scene = at_rest(**SPRING)
    numerics = Numerics(dt=5e-5, n_steps=20, contact_dt=DT)
    without = simulate(scene, numerics)
    with_it = simulate(scene, numerics.replace(energy_budget=True))
    for name in ("x", "v", "omega", "wall_force"):
        np.testing.assert_array_equal(getattr(with_it, name), getattr(without, name))
    assert not set(without.energy) & {*LOST, "wall_work"}
    with pytest.raises(InvalidNumericsError, match="sphere 5 held in a motion"):
        simulate(box(), numerics.replace(energy_budget=True))


R, M = 5e-3, 1e-3


def thrown(law: Any, v: Any, *, overlap: float = 0.0, gravity: float = 0.0, **sphere: Any) -> SphereScene:
    motion = sphere.pop("motion", ())
    floor = PlaneWall(name="floor", point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), law=law, motion=motion)
    spheres = Spheres(x=[(0.0, 0.0, R - overlap)], v=[v], radius=R, mass=M, **sphere)
    return SphereScene(spheres=spheres, sphere_sphere=law, walls=(floor,), gravity=(0.0, 0.0, -gravity))


def test_friction_takes_the_slip_and_dashpots_what_the_rebound_lacks() -> None:
    """mu m g times the slip, which falls by 7/2 mu g; (1 - e^2) of the energy of approach, e^2 what is left."""
    mu, g, speed, end = 0.2, 9.81, 0.5, 0.05
    law = law_of(kn=2e5, ks=1e5, mu=mu, beta=0.0)
    slides = budget(thrown(law, (speed, 0.0, 0.0), overlap=M * g / 2e5, gravity=g), 1e-6, end)
    lost = mu * M * g * (speed * end - 1.75 * mu * g * end**2)
    # The spring is stretched first: (mu m g)^2/(2 ks) of it, and the step in which that happens.
    assert slides.energy["friction_loss"][-1] == pytest.approx(
        lost, abs=(mu * M * g) ** 2 / 1e5 + mu * M * g * speed * 1e-6
    )
    hit = budget(thrown(law_of(mu=0.0, beta=0.2), (0.0, 0.0, -0.3)), 2e-7, 3e-3)
    energy = hit.energy
    assert energy["dashpot_loss"][-1] == pytest.approx(energy["kinetic"][0] - energy["kinetic"][-1], rel=1e-5)
    assert energy["dashpot_loss"][-1] > 0.5 * energy["kinetic"][0]


def test_resistances_take_their_torque_times_the_turn() -> None:
    mu, g, spin, end = 0.05, 9.81, 20.0, 0.05
    law = law_of(kn=2e5, mu=0.0, beta=0.0, twisting=Rolling(model="constant", mu=mu))
    scene = thrown(law, (0.0, 0.0, 0.0), overlap=M * g / 2e5, gravity=g, omega=[(0.0, 0.0, spin)])
    torque, inertia = mu * R * M * g, 0.4 * M * R**2
    lost = torque * (spin * end - 0.5 * torque / inertia * end**2)
    assert budget(scene, 1e-6, end).energy["rolling_loss"][-1] == pytest.approx(lost, rel=1e-4)


@pytest.mark.parametrize("unloading", ["force", "none", "rescale"])
def test_the_law_takes_what_a_spring_of_changing_stiffness_lacks(unloading: Any) -> None:
    """A floor shears a held sphere by s at the contact radius a_1 and leaves it to a_2, without slip: F^2/2 (1/k_1 - 1/k_2) < 0 where the
    force is kept, (k_1 - k_2) s^2/2 where the displacement is, (k_1 - k_2 (a_2/a_1)^2) s^2/2 where that shrinks."""
    s, deep, shallow, time = 2e-6, 2e-5, 1.2e-5, 1e-4
    law = law_of(mu=50.0, beta=0.0, unloading=unloading)
    motion = (
        PlaneSegment(duration=time, velocity=(-s / time, 0.0, 0.0)),
        PlaneSegment(duration=time, velocity=(0.0, 0.0, -(deep - shallow) / time)),
    )
    scene = thrown(law, (0.0, 0.0, 0.0), overlap=deep, motion=motion, held=True, inertia=1e9)
    k_1, k_2 = (8.0 * law.g_star * np.sqrt(R * each) for each in (deep, shallow))
    expected = {
        "force": 0.5 * (k_1 * s) ** 2 * (1.0 / k_1 - 1.0 / k_2),
        "none": 0.5 * (k_1 - k_2) * s**2,
        "rescale": 0.5 * (k_1 - k_2 * shallow / deep) * s**2,
    }[unloading]
    energy = budget(scene, 1e-7, 2.0 * time).energy
    assert energy["law_loss"][-1] == pytest.approx(expected, rel=1e-5)
    stored = 8.0 / 15.0 * law.e_star * np.sqrt(R) * (shallow**2.5 - deep**2.5)
    assert energy["wall_work"][-1] == pytest.approx(0.5 * k_1 * s**2 + stored, rel=1e-3)
