"""The energy budget of contact dynamics closes to round-off, channel by channel."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ninedisk.core.cd.session import CdSession
from ninedisk.core.errors import InvalidNumericsError
from ninedisk.core.history import History
from ninedisk.core.law import ContactLaw
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Disks, Scene, Wall, WallSegment
from ninedisk.core.scene.loads import BodyForce

ROUND_OFF = 1e-12
"""Of what all channels together exchange: a step's forces are exact to the solver's tolerance, 1e-12, and enter all channels alike."""
LOSSES = ("friction_loss", "impact_loss", "dashpot_loss", "damping_loss")
FED = ("wall_work", "force_work", "held_work")


def imbalance(history: History) -> np.ndarray:
    """Growth of all energies and losses less the works, over what was exchanged until then, shape (s,)."""
    energy = history.energy
    state = energy["kinetic"] + energy["elastic"] + energy["gravity"]
    lost = sum(energy[name] for name in LOSSES) + energy["scheme_loss"]
    off = state - state[0] + lost - sum(energy[name] for name in FED)
    size = np.abs(energy["kinetic"]) + sum(
        np.abs(np.diff(energy[name], prepend=energy[name][0])).cumsum() for name in energy
    )
    return np.asarray(off / size.max())


def random_scene(seed: int, contacts: str) -> Scene:
    """Sixteen unequal disks in a box whose floor rises and shakes and whose left wall turns; one disk is held in its course."""
    rng = np.random.default_rng(seed)
    x = np.array([(1.05 * i + 1.0, 1.05 * j + 0.6) for i in range(4) for j in range(4)])
    radius = rng.uniform(0.42, 0.5, 16)
    stiff = 2e4 if contacts == "soft" else 1e8
    mu, beta, restitution = rng.uniform(0.1, 0.8), rng.uniform(0.0, 0.6), rng.uniform(0.0, 0.9)
    law = ContactLaw(
        kn=stiff, ks=0.6 * stiff, mu=mu, beta=beta, restitution=restitution if contacts == "newton" else 0.0,
        lever_arm="overlap" if contacts == "soft" else "radius", regularised=contacts != "soft",
    )  # fmt: skip
    glide = replace(law, mu=0.05, adhesion=3.0 if contacts != "soft" and seed % 2 else 0.0)
    if contacts == "soft":
        glide = replace(glide, beta=0.0, cohesion=0.3 * stiff)
    other = replace(law, kn=4e4, ks=2e4, regularised=contacts in ("rigid", "newton"))
    shaken = WallSegment(velocity=(0.3, 0.2), amplitude=(0.02, 0.01), frequency=17.0)
    walls = (
        Wall(name="left", point=(0.3, 0.0), normal=(1.0, 0.0), law=law, motion=(WallSegment(angular_velocity=0.1),)),
        Wall(name="right", point=(4.9, 0.0), normal=(-1.0, 0.0), law=glide),
        Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=other, motion=(shaken,)),
        Wall(name="lid", point=(0.0, 6.0), normal=(0.0, -1.0), law=law),
    )
    held = np.zeros((16, 2), dtype=bool)
    held[5, 0] = held[6] = True
    disks = Disks(
        x=x + rng.uniform(-0.02, 0.02, x.shape), v=rng.normal(0.0, 1.0, x.shape), omega=rng.normal(0.0, 2.0, 16),
        radius=radius, mass=4.0 * radius**2, held=held, rotating=rng.random(16) < 0.8,
    )  # fmt: skip
    forces = [
        BodyForce(disk=int(rng.integers(16)), force=tuple(rng.normal(0.0, 5.0, 2)), torque=rng.normal(), begin=0.03 * k)
        for k in range(4)
    ]
    return Scene(disks=disks, disk_disk=law, walls=walls, gravity=(1.0, -9.0), xi=rng.uniform(0.0, 2.0), forces=forces)


def run(scene: Scene, *, singly: bool = False, **numerics: Any) -> History:
    session = CdSession(scene, Numerics(**{"energy_budget": True, **numerics}))
    # Contacts with adhesion are taken singly anyway.
    assert singly or session._batches is not None
    if singly:
        session._batches = None
    return session.run()


@pytest.mark.long
@pytest.mark.parametrize("sliding", ["associated", "coulomb"])
@pytest.mark.parametrize("contacts", ["soft", "rigid", "newton", "mixed"])
def test_the_budget_closes(contacts: str, sliding: Any) -> None:
    for seed in range(4):
        scene = random_scene(seed, contacts)
        numerics = {
            "dt": 2e-3, "n_steps": 120, "theta": (0.5, 0.7, 1.0, 0.6)[seed], "sliding": sliding,
            "impact": "newton" if contacts == "newton" else "theta",
        }  # fmt: skip
        history = run(scene, singly=bool(seed % 2), **numerics)
        assert np.abs(imbalance(history)).max() <= ROUND_OFF
        energy = history.energy
        size = max(float(np.abs(energy[name]).max()) for name in energy)
        for name in LOSSES:
            assert np.diff(energy[name]).min() >= -1e-11 * size, name
        sprung = contacts in ("soft", "mixed")
        assert energy["friction_loss"][-1] > 1e-3 * size
        assert (energy["dashpot_loss"][-1] > 1e-3 * size) == sprung
        assert (energy["impact_loss"][-1] > 1e-3 * size) == (contacts != "soft")
        assert energy["damping_loss"][-1] > 1e-3 * size
        assert min(abs(energy[name][-1]) for name in FED) > 1e-4 * size
        if (
            contacts == "soft" and sliding == "coulomb"
        ):  # dilation moves contacts beside their springs, which costs or feeds
            assert np.diff(energy["scheme_loss"]).min() >= -1e-11 * size


def test_nothing_else_changes_when_it_is_asked_for() -> None:
    scene = random_scene(0, "mixed")
    with_it, without = (run(scene, dt=2e-3, n_steps=60, energy_budget=asked) for asked in (True, False))
    assert np.array_equal(with_it.x, without.x)
    assert np.array_equal(with_it.v, without.v)
    assert set(with_it.energy) - set(without.energy) == {*LOSSES, "scheme_loss", "force_work", "held_work"}
    assert all(np.array_equal(without.energy[name], with_it.energy[name]) for name in without.energy)


def disk_on_floor(law: ContactLaw, *, gap: float = 0.0, **disk: Any) -> Scene:
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law)
    return Scene(
        disks=Disks(x=[[0.0, 1.0 + gap]], radius=1.0, mass=2.0, **disk),
        disk_disk=law,
        walls=(floor,),
        gravity=(0.0, -10.0),
    )


@pytest.mark.parametrize("rule", ["theta", "newton"])
def test_an_impact_loses_what_restitution_says(rule: Any) -> None:
    """``(1 - e^2) m v^2/2`` without load, e = (1 - theta)/theta under the theta scheme where whole steps close the gap."""
    law = ContactLaw(kn=1e6, restitution=0.25, regularised=True)
    scene = disk_on_floor(law, gap=0.3, v=[[0.0, -3.0]]).replace(gravity=(0.0, 0.0))
    energy = run(scene, dt=0.01, n_steps=30, theta=0.8, impact=rule).energy
    assert energy["impact_loss"][-1] == pytest.approx((1.0 - 0.0625) * 9.0, rel=1e-12)
    assert abs(energy["scheme_loss"][-1]) <= 1e-12


def test_friction_loses_what_slip_to_roll_says() -> None:
    """From sliding at v to rolling: ``m v^2/6``, a third of the energy, to the scheme's order."""
    law = ContactLaw(kn=1e6, ks=1e6, mu=0.2, restitution=0.0, regularised=True)
    lost = []
    for dt in (0.01, 0.005):
        scene = disk_on_floor(law, v=[[1.5, 0.0]])
        energy = run(scene, dt=dt, n_steps=round(0.5 / dt), theta=0.5, sliding="coulomb").energy
        lost.append(energy["friction_loss"][-1])
    assert lost[1] == pytest.approx(2.0 * 1.5**2 / 6.0, rel=1e-10)
    assert lost[0] == pytest.approx(lost[1], rel=1e-10)


def test_dashpots_lose_what_impacts_lose_and_the_scheme_first_order() -> None:
    from ninedisk.references.analytic.impact.spring_dashpot import restitution_of_beta

    off = []
    for dt in (4e-4, 2e-4, 1e-4):
        scene = disk_on_floor(ContactLaw(kn=1e4, beta=0.2), gap=0.0123, v=[[0.0, -1.0]]).replace(gravity=(0.0, 0.0))
        energy = run(scene, dt=dt, n_steps=round(0.1 / dt), theta=0.5).energy
        off.append(energy["dashpot_loss"][-1] - (1.0 - restitution_of_beta(0.2) ** 2))
        assert energy["scheme_loss"][-1] > 0.0
    assert abs(off[2]) < 0.02
    assert off[2] == pytest.approx(0.5 * off[1], rel=0.3)


def test_a_series_of_equilibria_has_no_budget() -> None:
    with pytest.raises(InvalidNumericsError, match="energy_budget = True is not allowed with regime = 'quasi-static'"):
        CdSession(
            disk_on_floor(ContactLaw(kn=1e4)), Numerics(dt=1.0, n_steps=1, regime="quasi-static", energy_budget=True)
        )
