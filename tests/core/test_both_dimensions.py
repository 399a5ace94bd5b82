"""A scene in 3D whose bodies stay at z = 0 is the scene in 2D, for every law that both dimensions have."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ninedisk.core import (
    BodyForce,
    ContactLaw,
    Disks,
    History,
    Numerics,
    PlaneSegment,
    PlaneWall,
    Rolling,
    Scene,
    Spheres,
    SphereScene,
    Wall,
    WallSegment,
    simulate,
)

LAW = ContactLaw(kn=1e4, ks=7e3, mu=0.4, slip_at="end")
SPRING = Rolling(model="elastic-plastic", mu=0.3, kr=40.0, beta=0.2)
LAWS: dict[str, dict[str, Any]] = {
    "smooth": {"ks": 0.0, "mu": 0.0},
    "friction": {},
    "arm R - overlap/2": {"lever_arm": "overlap"},
    "arm R - overlap/2 of the torque": {"lever_arm": "torque-overlap"},
    "constant rolling resistance": {"rolling": Rolling(model="constant", mu=0.05)},
    "viscous rolling resistance": {"rolling": Rolling(model="viscous", mu=0.02)},
    "rolling spring": {"rolling": SPRING},
    "cohesion": {"cohesion": 2.5e3, "beta": 0.1, "lever_arm": "overlap"},
    "Hertz": {"kn": 0.0, "ks": 0.0, "mu": 0.0, "e_star": 3e4, "beta": 0.1},
    "Hertz-Mindlin": {"kn": 0.0, "ks": 0.0, "e_star": 3e4, "g_star": 1.2e4, "beta": 0.1, "slip_at": "middle"},
    "Hertz-Mindlin, rolling spring": {
        "kn": 0.0,
        "ks": 0.0,
        "e_star": 3e4,
        "g_star": 1.2e4,
        "unloading": "rescale",
        "rolling": SPRING,
        "lever_arm": "overlap",
    },
    "cohesion and rolling": {"cohesion": 2.5e3, "rolling": SPRING},
}
DAMPED: dict[str, dict[str, Any]] = {
    "central damping": {"xi": 8.0},
    "lagged damping": {"xi": 8.0, "damping_form": "lagged"},
    "central damping, dashpots, rolling spring": {
        "xi": 3.0,
        "also": {"rolling": SPRING, "cohesion": 1e3, "beta": 0.05},
    },
    "central damping, viscous rolling resistance": {"xi": 3.0, "also": {"rolling": Rolling(model="viscous", mu=0.4)}},
    "forces": {"forces": True},
    "forces, lagged damping": {"forces": True, "xi": 2.0, "damping_form": "lagged"},
    "preload": {"preload": True},
    "preload, forces, damping": {"preload": True, "forces": True, "xi": 5.0},
    "held": {"held": True},
    "held, central damping, dashpots, rolling spring": {
        "held": True,
        "xi": 8.0,
        "also": {"rolling": SPRING, "cohesion": 1e3, "beta": 0.05},
    },
    "held, lagged damping": {"held": True, "xi": 8.0, "damping_form": "lagged"},
    "Hertz-Mindlin, preload, forces, held, damping": {
        "preload": True,
        "forces": True,
        "held": True,
        "at_rest": True,
        "xi": 5.0,
        "also": {"kn": 0.0, "ks": 0.0, "e_star": 3e4, "g_star": 1.2e4, "beta": 0.1},
    },
    "held, at rest": {"held": True, "at_rest": True, "xi": 2.0, "forces": True},
}
X = np.array([[0.0, 0.98], [1.7, 0.69], [0.85, 2.35], [-1.9, 1.2]])
V = np.array([[0.3, -0.1], [-0.2, 0.4], [0.1, -0.9], [1.1, 0.2]])
RADIUS, MASS, INERTIA = np.array([1.0, 0.7, 0.8, 0.6]), np.array([2.0, 1.1, 1.4, 0.9]), np.array([0.9, 0.3, 0.5, 0.2])
OMEGA = np.array([0.5, -1.0, 2.0, -3.0])
HELD = np.array([[True, False], [False, False], [False, True], [True, True]])
"""Components that bodies keep: across, none, upwards, both; they turn."""
PAIRS = [(0, 1), (0, 2), (0, 3), (0, 4), (1, 2), (1, 4), (3, 5)]
WALLS = (
    ("floor", (0.0, 0.0), (0.0, 1.0), {"velocity": (0.1, 0.05), "duration": 0.4}),
    (
        "side",
        (-2.6, 0.0),
        (1.0, 0.2),
        {"angular_velocity": 0.3, "amplitude": (0.02, 0.01), "frequency": 9.0, "phase": 0.4},
    ),
)
STEPS = 1_000


def both(law: ContactLaw, *, held: bool = False, at_rest: bool = False, **more: Any) -> tuple[Scene, SphereScene]:
    """The same scene in 2D and in 3D; ``held``: velocities are, and ``at_rest``: these are 0."""
    soft = replace(law, **{"e_star": 2e4} if law.hertz else {"kn": 6e3}, mu=0.7 * law.mu)
    flat = [
        Wall(name=name, point=point, normal=normal, law=soft, motion=(WallSegment(**motion),))
        for name, point, normal, motion in WALLS
    ]
    upright = [
        PlaneWall(
            name=name,
            point=(*point, 0.0),
            normal=(*normal, 0.0),
            law=soft,
            motion=(PlaneSegment(**{key: in_3d(key, value) for key, value in motion.items()}),),
        )
        for name, point, normal, motion in WALLS
    ]
    bodies = {"radius": RADIUS, "mass": MASS, "inertia": INERTIA}
    zero, keeps = np.zeros((len(X), 1)), HELD & held
    v = np.where(keeps & at_rest, 0.0, V)
    return (
        Scene(
            disks=Disks(x=X, v=v, omega=OMEGA, held=keeps, **bodies),
            disk_disk=law,
            walls=flat,
            gravity=(0.4, -9.0),
            **more,
        ),
        SphereScene(
            spheres=Spheres(
                x=np.hstack([X, zero]),
                v=np.hstack([v, zero]),
                omega=np.hstack([zero, zero, OMEGA[:, None]]),
                held=np.hstack([keeps, keeps.all(axis=1)[:, None]]),
                **bodies,
            ),
            sphere_sphere=law,
            walls=upright,
            gravity=(0.4, -9.0, 0.0),
            **more,
        ),
    )


def pushed(solid: bool) -> list[BodyForce]:
    """Forces and torques, which overlap in time and of which two act on one body; the second ends within a step."""
    loads = [
        (0, (30.0, -8.0), 2.0, 0.0, 0.1),
        (2, (-9.0, 5.0), -1.5, 0.01003, 0.15017),
        (0, (4.0, 7.0), 0.5, 0.05, np.inf),
    ]
    return [
        BodyForce(disk=disk, force=(*force, 0.0), torque=(0.0, 0.0, torque), begin=begin, end=end)
        if solid
        else BodyForce(disk=disk, force=force, torque=torque, begin=begin, end=end)
        for disk, force, torque, begin, end in loads
    ]


def preloaded(solid: bool) -> dict[tuple[int, int], Any]:
    """Shear forces at time 0: of two spheres, at a wall, and one beyond the limit of friction."""
    found: dict[tuple[int, int], Any] = {}
    for (i, j), fs in {(0, 2): 30.0, (0, 4): -20.0, (1, 4): 1e3}.items():
        n = (X[j] - X[i]) / np.linalg.norm(X[j] - X[i]) if j < len(X) else -np.array(WALLS[j - len(X)][2])
        found[i, j] = tuple(fs * np.array([-n[1], n[0], 0.0])) if solid else fs
    return found


def in_3d(key: str, value: Any) -> Any:
    if key == "angular_velocity":
        return (0.0, 0.0, value)
    return (*value, 0.0) if isinstance(value, tuple) else value


def differences(flat: History, solid: History) -> dict[str, float]:
    """Largest differences of motion and forces, each over the largest value."""
    tangent = np.stack([-normals(flat)[..., 1], normals(flat)[..., 0]], axis=-1)
    springs = ("elastic_normal", "elastic_shear", "elastic_rolling", "gravity", "translation", "rotation")
    pairs = {
        "x": (flat.x, solid.x[..., :2]),
        "v": (flat.v, solid.v[..., :2]),
        "omega": (flat.omega, solid.omega[..., 2]),
        "angle": (flat.angle, solid.angle[..., 2]),
        "gap": (flat.gap, solid.gap),
        "fn": (flat.fn, solid.fn),
        "fs": (flat.fs, np.sum(solid.fs[..., :2] * tangent, axis=-1)),
        "wall force": (flat.wall_force[..., :2], solid.wall_force[..., :2]),
        "out of z = 0": (np.zeros_like(solid.x[..., 2]), solid.x[..., 2]),
        **{name: (flat.energy.get(name, np.zeros(len(flat.t))), solid.energy[name]) for name in springs},
    }
    return {name: float(np.abs(one - two).max() / (np.abs(one).max() or 1.0)) for name, (one, two) in pairs.items()}


def drift(history: History) -> float:
    """Largest change of the energy budget [J]: what bodies and springs have, and have lost, less what walls have fed."""
    energy = history.energy
    lost = sum(energy[name] for name in ("friction_loss", "dashpot_loss", "rolling_loss", "damping_loss", "law_loss"))
    total = (
        energy["kinetic"] + energy["elastic"] + energy["gravity"] + lost - energy["wall_work"] - energy["force_work"]
    )
    return float(np.abs(total - total[0]).max())


def histories(law: ContactLaw, contact_dt: float = 2e-4, **more: Any) -> tuple[History, History]:
    """Runs of 0.2 s in 2D and 3D: four unequal bodies touch, part and slide between two walls that move."""
    numerics = Numerics(
        dt=2e-4,
        n_steps=STEPS,
        contact_dt=contact_dt,
        sample_every=50,
        energy_budget=more.get("at_rest", False) or not more.get("held", False),
        damping_form=more.pop("damping_form", "central"),
    )
    law = replace(law, **more.pop("also", {}))
    forces, preload = more.pop("forces", False), more.pop("preload", False)
    scenes = both(law, **more)
    if forces:
        scenes = scenes[0].replace(forces=pushed(False)), scenes[1].replace(forces=pushed(True))
    if preload:
        scenes = scenes[0].replace(initial_shear=preloaded(False)), scenes[1].replace(initial_shear=preloaded(True))
    flat, solid = (simulate(scene, numerics, PAIRS) for scene in scenes)
    return flat, solid


def normals(flat: History) -> Any:
    """Normals of `PAIRS` in 2D, shape (s, p, 2), from the places of the bodies and the walls' angles."""
    found = []
    for i, j in PAIRS:
        if j < len(X):
            between = flat.x[:, j] - flat.x[:, i]
            found.append(between / np.linalg.norm(between, axis=1)[:, None])
        else:
            turn = flat.wall_angle[:, j - len(X)]
            found.append(-np.column_stack([np.cos(turn), np.sin(turn)]))
    return np.stack(found, axis=1)


@pytest.mark.parametrize("law", LAWS)
def test_a_scene_at_rest_in_z_is_the_scene_in_2d(law: str) -> None:
    """1,000 contact steps; round-off of two ways to the same numbers."""
    flat, solid = histories(replace(LAW, **LAWS[law]))
    assert (flat.fn > 0.0).any(axis=0).sum() >= 4
    if LAWS[law].get("mu", LAW.mu) > 0.0:
        assert (flat.fs > 0.0).any()
        assert (flat.fs < 0.0).any()
    found = differences(flat, solid)
    assert max(found.values()) <= 1e-12, found


@pytest.mark.parametrize("loads", DAMPED)
def test_so_is_one_with_damping_forces_or_preload(loads: str) -> None:
    flat, solid = histories(LAW, **DAMPED[loads])
    found = differences(flat, solid)
    for name in ("damping_loss", "force_work"):
        zero = np.zeros(len(flat.t))
        one, two = flat.energy.get(name, zero), solid.energy.get(name, zero)
        found[name] = float(np.abs(one - two).max() / (np.abs(one).max() or 1.0))
    assert max(found.values()) <= 1e-12, found
    driven = DAMPED[loads].get("held", False) and not DAMPED[loads].get("at_rest", False)
    if "held" in DAMPED[loads]:
        keeps = HELD[None].repeat(len(flat.t), axis=0)
        assert np.array_equal(flat.v[keeps], flat.v[:1].repeat(len(flat.t), axis=0)[keeps])
        assert (flat.fn > 0.0).any(axis=0).sum() >= 3
    if "xi" in DAMPED[loads] and not driven:
        assert solid.energy["damping_loss"][-1] > 0.1
    if "forces" in DAMPED[loads]:
        assert abs(solid.energy["force_work"][-1]) > 0.1
    if "preload" in DAMPED[loads]:
        assert solid.energy["elastic_shear"][0] > 0.01


def test_the_middle_of_a_step_differs_to_second_order() -> None:
    """In 2D it has the normal at the mean place, in 3D the mean of the normals: a quarter of the difference with half the step."""
    coarse, fine = (max(differences(*histories(replace(LAW, slip_at="middle"), dt)).values()) for dt in (2e-4, 1e-4))
    assert 1e-10 < fine <= 0.3 * coarse <= 1e-7


@pytest.mark.parametrize("mu", [0.3, 1e9])
def test_what_springs_have_left_where_contacts_open_is_lost(mu: float) -> None:
    """Rolling springs that never yield have energy left. The budget of the scheme drifts to second order, in 3D as in 2D.

    The drift is 1e-3 of what is exchanged; its third order is below 2 % of it at these steps. Uncounted springs drift by 44 times as much.
    """
    law = replace(LAW, rolling=replace(SPRING, mu=mu))
    coarse, fine = ([drift(history) for history in histories(law, dt)] for dt in (2e-4, 1e-4))
    assert fine[1] == pytest.approx(fine[0], rel=1e-3)
    assert coarse == pytest.approx([4.0 * each for each in fine], rel=0.02)
