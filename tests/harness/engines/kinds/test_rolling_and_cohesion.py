"""Rolling resistance, cohesion, materials, forces in engines with springs: closed forms of unlike pairs, and the in-house DEM."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import BodyForce, ContactLaw, Disks, Rolling, Scene, Wall
from ninedisk.core.simulate import simulate
from ninedisk.harness.api.capabilities import EXTRAS, Capability
from ninedisk.harness.api.engine import SupportLevel
from ninedisk.harness.api.registry import get_engine
from ninedisk.harness.cases.adapter.probe_of import probe_of
from ninedisk.harness.check_engine import conduct
from ninedisk.harness.check_engine.outcomes import Bench

ENGINES = ("lammps", "yade", "kratos", "siconos", "mujoco", "box2d", "pymunk", "bullet", "dart")

KN, PRESS, MU_R = 1e6, 50.0, 0.01
RADII, MASSES, SPINS = (0.5, 0.25), (2.0, 0.5), (2.0, 1.0)
"""Two unlike disks, pressed against each other by forces on both, with spins that differ by 1 rad/s."""


def installed(name: str) -> Any:
    engine = get_engine(name)
    if not engine.info().installed:
        pytest.skip(engine.info().not_installed_because)
    return engine


@pytest.mark.parametrize(
    ("name", "capability"),
    [(name, each) for name in ENGINES for each in sorted(EXTRAS & get_engine(name).info().capabilities)],
)
def test_every_extra_that_is_declared_passes_its_probe(name: str, capability: Capability) -> None:
    engine = installed(name)
    bench = Bench(engine, engine.info())
    found = conduct.capability(bench, probe_of(capability, engine.info()), capability)
    assert found.status == "pass", found


def pressed(rolling: Rolling) -> Scene:
    law = ContactLaw(kn=KN, rolling=rolling)
    return Scene(
        disks=Disks(x=[[0.0, 0.0], [sum(RADII) - PRESS / KN, 0.0]], radius=RADII, mass=MASSES, omega=SPINS),
        disk_disk=law,
        forces=(BodyForce(disk=0, force=(PRESS, 0.0)), BodyForce(disk=1, force=(-PRESS, 0.0))),
    )


T, DT = 0.02, 1e-4
REDUCED = 1.0 / sum(1.0 / radius for radius in RADII)
INVERSE = sum(2.0 / (mass * radius**2) for mass, radius in zip(MASSES, RADII, strict=True))


def viscous() -> float:
    return math.exp(-2.0 * MU_R * REDUCED**2 * PRESS * INVERSE * T)


def swinging() -> float:
    return math.cos(math.sqrt(2.0 * INVERSE) * T)


@pytest.mark.parametrize(
    ("name", "rolling", "left"),
    [
        ("yade", Rolling(model="viscous", mu=2.0 * MU_R), viscous),
        ("yade", Rolling(model="elastic-plastic", mu=0.5, kr=2.0), swinging),
        ("lammps", Rolling(model="elastic-plastic", mu=0.5, kr=2.0), swinging),
    ],
)
def test_two_unlike_disks_have_the_reduced_radius(name: str, rolling: Rolling, left: Callable[[], float]) -> None:
    """The spins' difference, 1 rad/s, decays or swings; the torques are opposite. First order of a viscous torque: rate dt/2."""
    scene, numerics = pressed(rolling), Numerics(dt=DT, n_steps=round(T / DT), contact_dt=DT, damping_form="lagged")
    spins = installed(name).run(scene, numerics, ((0, 1),)).history.omega[-1]
    inertia = np.array([0.5 * mass * radius**2 for mass, radius in zip(MASSES, RADII, strict=True)])
    assert inertia @ spins == pytest.approx(inertia @ np.array(SPINS), rel=1e-12)
    assert spins[0] - spins[1] == pytest.approx(left(), rel=1e-5)


def test_kratos_has_another_radius_between_disks() -> None:
    rolls = pressed(Rolling(model="constant", mu=MU_R))
    support = get_engine("kratos").supports(rolls, Numerics(dt=DT, n_steps=1, contact_dt=DT))
    assert Capability.ROLLING_CONSTANT in support.missing


@pytest.mark.parametrize(
    ("name", "law", "missing"),
    [
        ("lammps", {"cohesion": 0.5 * KN, "beta": 0.1, "mu": 0.5, "ks": KN}, Capability.COHESION),
        ("lammps", {"rolling": Rolling(model="elastic-plastic", mu=0.1, kr=1.0, beta=0.1)}, Capability.ROLLING_SPRING),
        ("yade", {"cohesion": 0.5 * KN, "beta": 0.1}, Capability.COHESION),
        ("yade", {"rolling": Rolling(model="elastic-plastic", mu=0.1, kr=1.0, beta=0.1)}, Capability.ROLLING_SPRING),
    ],
)
def test_what_an_engine_cannot_combine_is_refused(name: str, law: dict[str, Any], missing: Capability) -> None:
    contact = ContactLaw(kn=KN, **law)
    scene = Scene(disks=Disks(x=[[0.0, 0.0], [2.0, 0.0]], radius=0.5, mass=1.0), disk_disk=contact)
    support = get_engine(name).supports(scene, Numerics(dt=DT, n_steps=1, contact_dt=DT))
    assert support.level is SupportLevel.NO
    assert missing in support.missing


def heap(**law: Any) -> Scene:
    """Five disks of two materials and sizes that fall on a floor and on each other, two of them spinning, and are pushed."""
    common: dict[str, Any] = {"kn": 2e5, "ks": 1e5, "mu": 0.4, "slip_at": "end", "lever_arm": law.pop("lever_arm")}
    hard, soft = ContactLaw(**common, **law), ContactLaw(**{**common, **law, "kn": 1e5, "mu": 0.2})
    return Scene(
        disks=Disks(
            x=[[0.0, 0.499], [1.02, 0.499], [0.5, 1.37], [1.6, 1.3], [1.05, 2.2]],
            v=[[0.0, 0.0], [0.1, 0.0], [0.0, -0.5], [-0.3, -0.2], [0.1, -1.0]],
            omega=[3.0, 0.0, -2.0, 0.0, 1.0],
            radius=[0.5, 0.5, 0.5, 0.4, 0.5],
            mass=[1.0, 1.0, 1.0, 0.6, 1.0],
            material=["hard", "soft", "hard", "soft", "hard"],
        ),
        disk_disk=hard,
        walls=(Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=hard, material="ground"),),
        gravity=(0.0, -9.81),
        laws={("hard", "soft"): soft, ("ground", "soft"): soft},
        forces=(BodyForce(disk=4, force=(2.0, -1.0), torque=0.1, begin=0.0312, end=0.0871),),
    )


def along_floor(**law: Any) -> Scene:
    """A disk thrown along a floor, whose normal does not turn: rolling springs yield, and swing when it has stopped."""
    contact = ContactLaw(kn=2e5, ks=1e5, mu=0.4, slip_at="end", lever_arm="overlap", **law)
    return Scene(
        disks=Disks(x=[[0.0, 0.499]], v=[[0.5, 0.0]], omega=-1.0, radius=0.5, mass=1.0),
        disk_disk=contact,
        walls=(Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=contact),),
        gravity=(0.0, -9.81),
    )


ROLLING_C = {"rolling": Rolling(model="elastic-plastic", mu=0.05, kr=50.0)}
COHESIVE = {"cohesion": 2e4}


@pytest.mark.parametrize(
    ("name", "law"),
    [
        ("lammps", {"lever_arm": "torque-overlap", **ROLLING_C}),
        ("lammps", {"lever_arm": "torque-overlap", **COHESIVE}),
        ("lammps", {"lever_arm": "torque-overlap", **ROLLING_C, **COHESIVE}),
        ("yade", {"lever_arm": "overlap", **ROLLING_C}),
        ("yade", {"lever_arm": "overlap", **COHESIVE}),
    ],
)
def test_a_heap_is_that_of_the_in_house_dem(name: str, law: dict[str, Any]) -> None:
    """Over 1,000 steps with contacts that slide, roll, yield and open.

    Walls have the arm R in LAMMPS: so they have here. Engines turn shear forces to first order, the DEM exactly: YADE is off by that,
    the sum of half the squares of a step's turns.
    """
    scene = heap(**dict(law))
    if name == "lammps":
        arm_of_walls = {"lever_arm": "radius"}
        scene = scene.replace(
            walls=tuple(replace(wall, law=replace(wall.law, **arm_of_walls)) for wall in scene.walls),
            laws={
                pair: replace(each, **arm_of_walls) if "ground" in pair else each for pair, each in scene.laws.items()
            },
        )
    numerics = Numerics(dt=1e-4, n_steps=1000, contact_dt=1e-4, damping_form="lagged", sample_every=10)
    watch = [(0, 5), (1, 5), (0, 2), (2, 4), (1, 3)]
    engine: History = installed(name).run(scene, numerics, tuple(watch)).history
    core = simulate(scene, numerics, watch)
    same(engine, core, 1e-9 if name == "lammps" else 1e-7)


@pytest.mark.parametrize("law", [ROLLING_C, COHESIVE, {**ROLLING_C, **COHESIVE}], ids=["rolling", "cohesion", "both"])
def test_a_disk_on_a_floor_is_in_yade_as_in_the_in_house_dem(law: dict[str, Any]) -> None:
    """Where no shear force turns nothing but round-off is left, in 5,000 steps."""
    scene = along_floor(**law)
    numerics = Numerics(dt=1e-4, n_steps=5000, contact_dt=1e-4, damping_form="lagged", sample_every=10)
    same(installed("yade").run(scene, numerics, ((0, 1),)).history, simulate(scene, numerics, [(0, 1)]), 1e-9)


def same(engine: History, core: History, bound: float) -> None:
    for quantity in ("x", "v", "omega", "fn", "fs"):
        one, two = getattr(engine, quantity), getattr(core, quantity)
        scale = float(np.abs(core.fn).max()) if quantity in ("fn", "fs") else float(np.abs(two).max())
        assert float(np.abs(one - two).max()) <= bound * scale, quantity
