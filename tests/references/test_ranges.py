"""Every public function of the references checks its range: none answers outside of it, and none allocates by an argument without bound.

The functions are found by introspection, so that a new one fails here until it is in the table of right arguments.
"""

from __future__ import annotations

import importlib
import inspect
import math
import pkgutil
import resource
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from ninedisk.references import analytic, exact_steps
from ninedisk.references.analytic.contact.cluster import Touch
from ninedisk.references.analytic.contact.ellipse_contact import Ellipse
from ninedisk.references.analytic.impact.ellipse_collision import MovingEllipse
from ninedisk.references.analytic.impact.two_disks import Springs
from ninedisk.references.analytic.on_plane.rolling_grain import EllipseShape
from ninedisk.references.exact_steps.normal_contact import Plane

SHAPE = EllipseShape(2.0, 1.0)
MOVING = {"a": 1.0, "b": 0.5, "mass": 1.0, "inertia": 1.0, "angle": 0.1, "spin": 0.2}
LEFT, RIGHT = MovingEllipse(**MOVING, x=(0.0, 0.0), v=(1.0, 0.0)), MovingEllipse(**MOVING, x=(3.0, 0.1), v=(0.0, 0.0))
ONE, TWO = Ellipse(1.0, 0.5, (0.0, 0.0), 0.1), Ellipse(1.0, 0.5, (1.8, 0.1), 0.3)

RIGHT_VALUES: dict[str, Any] = {
    "elapsed": 1.0, "side": 1.0, "dimension": 3, "spread": 1.1, "top": 2.0, "each": 1.0, "mu_t": 0.1, "slip": 1.0,
    "ahead": 0.2, "amplitude": 1e-3, "angle": 0.3, "area": 100.0, "aside": -0.55, "beta": 0.1, "bounces": 3, "c_disk_disk": 1.0,
    "c_wall": 1.0, "chord": 1.0, "cycles": 3, "d": np.array([[0.2, -0.55], [0.19, -0.55], [0.2, -0.55]]), "damping": np.eye(2),
    "damping_ratio": 0.1, "dilates": False, "dt": 1e-3, "end": 0.6, "form": "central", "frequency": 3.0, "g": 9.81, "g0": 0.1, "gap": 0.1,
    "gap_0": 0.1, "gaps": [0.1, 0.2], "half": 5, "half_width": 0.7, "half_length": 0.3, "half_height": 0.5,
    "quaternion": (0.6, 0.0, 0.8, 0.0), "height": 0.5, "increment": 0.1, "inertia_ratio": 0.5, "kn": 1e4,
    "ks": 1e4, "length": 10.0, "m_eff": 1.0, "mass": 1.0, "mass_1": 1.0, "mass_2": 2.0, "mid_overlap": True, "mu": 0.1, "n": 5,
    "n_load": 5, "n_steps": 10, "normal_load": 1.0, "omega": 10.0, "omega_first": 10.0, "omega_second": 20.0, "one": LEFT,
    "overlap": 0.05, "part": np.array([0.0, 0.5, 1.0]), "period": 1.0, "phase": 0.1, "phi": np.array([0.5, 0.6]),
    "place": (-1.0, 0.05), "pull": 1.0, "rate": 1.0, "reach": 0.2,
    "radius": 0.1, "inertia": 0.01, "inertial_number": 0.1, "restitution": 0.5, "shape": SHAPE, "slip_at": "middle", "spacing": 0.19,
    "speed": 1.0, "spin": 1.0, "start": 0.4, "e_star": 1e9, "turn": 2.0, "first": (1e9, 0.3),
    "stiffness": 2.0 * np.eye(2), "t": np.array([0.0, 0.1]), "t_wall": 0.1, "thermal": 1.0, "theta": 0.75, "two": RIGHT, "until": 3.0,
    "v_1": 1.0, "v_2": 0.5, "v_wall": 0.1, "cohesion": 5e3, "surface_energy": 1.0, "kr": 1e2, "mu_r": 0.5,
    "arm": 1.3, "held_radius": 0.5, "reached": [0.5, 1.0],
    "force": 3.0, "inertia_1": 0.3, "inertia_2": 0.4, "radius_1": 0.5, "radius_2": 0.2,
    "motion": "shear-plastic", "dashpot": 1e3, "slip_arm": "overlap", "spring_turned": True, "spring_twisted": True,
    "spring_cut": True, "tension": False,
    "velocity": (1.0, -1.0), "vy": -1.0, "path": 0.5, "weight": 1.0, "weights": [1.0, 3.0], "xi": 0.1, "y": 1.0,
}  # fmt: skip
"""By the names of arguments, which mean the same thing everywhere."""

OWN: dict[str, dict[str, Any]] = {
    "rolling_off.rolled_off": {"mu": 2.0},
    "belt.belt_motion": {"segments": [(0.1, 0.5), (0.2, -0.5)], "ease": 3.0},
    "cluster.cluster_swing": {
        "velocity": np.array([[0.1, 0.0, 0.2], [0.0, 0.0, 0.0]]),
        "radius": np.array([0.5, 0.2]),
        "mass": np.array([1.0, 2.0]),
        "inertia": np.array([0.1, 0.04]),
        "touches": [Touch(0, 1, (1.0, 0.0), 1e-3, 1e4, 1e4, 0.1)],
    },
    "two_disks.two_disk_impact": {
        "direction": (1.0, 0.0),
        "velocity": np.array([[1.0, 0.2, 0.3], [0.0, 0.0, -0.5]]),
        "radius": np.array([0.5, 0.2]),
        "mass": np.array([1.0, 2.0]),
        "inertia": np.array([0.1, 0.04]),
        "springs": Springs(1e6, 1e6, 0.1),
    },
    "segments.under_segments": {"segments": [(0.0, 1.0, 2.0), (0.5, 2.0, -1.0)]},
    "compression.ramp_response": {"t": np.array([0.0, 0.1])},
    "critical_step.lagged_limit": {"mass": np.eye(2)},
    "ellipse_collision.gap_and_direction": {"t": 0.0},
    "ellipse_contact.ellipse_overlap": {"one": ONE, "two": TWO},
    "ellipse_contact.ellipse_separation": {"one": ONE, "two": TWO},
    "hard_disks.hard_disks": {"x": [(0.2, 0.2), (0.6, 0.2)], "v": [(1.0, 0.0), (0.0, 0.0)], "times": [0.1, 0.3]},
    "normal_contact.normal_contact_central": {"planes": [Plane(1, np.zeros(11), np.zeros(11), 1e4)]},
    "normal_contact.normal_contact_theta": {"planes": [Plane(1, np.zeros(11), np.zeros(11), 1e4)]},
    "rolling_grain.kinetic_of": {"spin": np.array([1.0, 2.0])},
    "rolling_incline.roll_down": {"rates": (1.0, 1.0, 1.0, 1.0, 1.0)},
    "prescribed_partner.struck_by_turning_wall": {"place": (0.5, 0.2)},
    "lattice.stretched": {"rate": (-0.1, 0.1)},
    "pushed_row.static_force": {"path": 0.01},
    "ball_on_plane.slide_and_roll": {"spin": (1.0, 2.0, 3.0)},
    "ball_on_plane.slip_of": {"spin": (1.0, 2.0, 3.0)},
    "turntable.turntable": {"start": (1.0, 2.0), "v": (0.7, 0.0)},
    "turned_shear.kept_shear": {"v": (0.1, 0.2, 0.0), "apart": (0.0, 0.0, 1.0), "roll": (1.0, 0.0, 0.0)},
    "turned_shear.turned_by": {"spin": (1.0, 2.0, 3.0), "vectors": [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0)]},
    "turned_shear.turned_shear": {
        "v": (0.1, 0.2, 0.0),
        "apart": (0.0, 0.0, 1.0),
        "roll": (1.0, 0.0, 0.0),
        "spin": (1.0, 2.0, 3.0),
    },
    "free_rotation.free_rotation": {"inertia": (1.0, 2.0, 3.0), "spin": (0.1, 2.0, 0.3)},
    "free_rotation.euler_steps": {"inertia": (1.0, 2.0, 3.0), "spin": (0.1, 2.0, 0.3)},
    "box.tipping_box": {"half_length": 0.1},
    "rocking_box.rocking_box": {"spin": 0.5, "half_length": 0.2, "t": np.array([0.0, 9.0])},
    "rocking_box.rocking_ratio": {"half_length": 0.2},
    "carried_balls.carried_balls": {"push": 9.0, "carried": 2.0},
    "pushed_box.push_start": {"push": 3.0, "height": 1.0, "half_length": 0.2, "half_height": 0.5},
    "pushed_box.toppling_box": {
        "push": 9.0,
        "height": 1.0,
        "half_length": 0.2,
        "half_height": 0.5,
        "t": np.array([0.0, 0.1]),
    },
    "box_tower.tower_forces": {"mass": (1.0, 2.0), "half_height": (0.1, 0.2), "place": [(0.0, 0.0), (0.1, 0.0)]},
    "corner_impact.corner_impact": {
        "inertia": (0.16, 0.29, 0.37),
        "axes": np.eye(3),
        "arm": (-0.1, -0.27, -0.57),
        "velocity": (1.0, 0.5, -1.0),
        "spin": (0.1, 0.2, 0.3),
    },
    "wedge.wedge": {"speed": 0.01, "half_width": 0.7, "t": np.array([0.0, 0.1])},
}
"""Right arguments of their own functions."""

OBJECTS = {"shape", "one", "two", "rates", "planes", "modes", "q", "wall", "x"}
"""Arguments that are made by another function or class of the references, which has checked them."""

INTERNAL = {"pushed_row.forces_of", "compression.closed_row"}
"""Functions that only other references call, with what they have computed."""

ANY_SIGN = {
    "ahead",
    "amplitude",
    "aside",
    "increment",
    "phase",
    "phi",
    "rate",
    "speed",
    "spin",
    "start",
    "reached",
    "end",
    "v_1",
    "v_2",
    "v_wall",
    "velocity",
    "vy",
    "path",
    "y",
}
"""Arguments that may be negative, here or there."""
COUNTS = {"bounces", "cycles", "dimension", "half", "n", "n_load", "n_steps"}
MOST_SECONDS, MOST_BYTES = 20.0, 400_000_000
"""Of a call that succeeds."""


def functions() -> Iterator[tuple[str, Callable[..., Any]]]:
    for package in (analytic, exact_steps):
        for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            module = importlib.import_module(found.name)
            for name, value in vars(module).items():
                if inspect.isfunction(value) and value.__module__ == module.__name__ and not name.startswith("_"):
                    yield f"{found.name.rpartition('.')[2]}.{name}", value


FUNCTIONS = dict(functions())
CHECKED = sorted(set(FUNCTIONS) - INTERNAL)


def right(name: str) -> dict[str, Any]:
    given = {**RIGHT_VALUES, **OWN.get(name, {})}
    if name == "rolling_incline.roll_down":
        from ninedisk.references.analytic.on_plane.rolling_incline import RollRates

        given["rates"] = RollRates(*given["rates"])
    return {
        argument: given[argument] for argument in inspect.signature(FUNCTIONS[name]).parameters if argument in given
    }


def finite(result: Any, *, unknown: bool = True) -> bool:
    """Whether a result holds finite numbers, but for the NaN that a first row or an unknown is filled with, if ``unknown``."""
    if result is None or isinstance(result, bool | str):
        return True
    if isinstance(result, tuple):
        return all(finite(part, unknown=unknown) for part in result)
    values = np.atleast_1d(np.asarray(result, dtype=np.float64))
    return not (np.isinf(values) if unknown else ~np.isfinite(values)).any()


def test_the_table_knows_every_function_and_no_other() -> None:
    assert len(FUNCTIONS) >= 60
    assert set(OWN) | INTERNAL <= set(FUNCTIONS)
    for name in CHECKED:
        for argument, parameter in inspect.signature(FUNCTIONS[name]).parameters.items():
            known = argument in right(name)
            assert known or parameter.default is not inspect.Parameter.empty, f"give {argument} of {name} a right value"


@pytest.mark.parametrize("name", CHECKED)
def test_right_arguments_are_taken(name: str) -> None:
    assert finite(FUNCTIONS[name](**right(name)))


def odd_values(argument: str) -> dict[str, Any]:
    """Values of an argument that have no meaning: each must be refused by name."""
    found: dict[str, Any] = {
        "nan": math.nan, "text": "wide", "None": None, "complex": 1j, "list": [[1.0], [1.0, 2.0]], "huge integer": 10**400, "mapping": {},
    }  # fmt: skip
    if argument not in ("t", "phi", "gap", "spin"):
        found |= {"inf": math.inf, "-inf": -math.inf}
    if argument not in ANY_SIGN and argument not in ("form", "dilates"):
        found |= {"negative": -1.0}
    if argument in COUNTS:
        found |= {"half": 1.5, "10**12": 10**12, "1e300": 1e300}
    if argument == "t":
        found |= {
            "negative": [-1.0],
            "one is nan": [0.0, math.nan],
            "one is inf": [math.inf],
            "text inside": ["0"],
            "truth values": [True],
        }
    if argument == "restitution":
        found |= {"1.5": 1.5}
    if argument == "theta":
        found |= {"0.4": 0.4, "1.1": 1.1}
    if argument in ("form", "dilates"):
        found |= {"other word": "mid", "number": 1}
    if argument == "slip_at":
        found |= {"other word": "mid", "number": 1}
    if argument == "aside":
        found |= {"0": 0.0}
    if argument == "part":
        found |= {"1.1": [0.5, 1.1]}
    if argument == "overlap":
        found |= {"the radius": RIGHT_VALUES["radius"]}
    if argument == "d":
        found |= {"one": [0.1, 0.2], "none": np.empty((0, 2)), "three": [[1.0, 2.0, 3.0]], "meet": [[0.0, 0.0]] * 2}
    if argument == "velocity":
        found |= {"away": (1.0, 1.0), "three": (1.0, 2.0, 3.0), "nan inside": (math.nan, -1.0)}
    if argument == "place":
        found |= {"behind": (1.0, 0.05), "passes": (-1.0, 0.3), "inside": (-0.1, 0.05), "three": (-1.0, 0.0, 0.0)}
    if argument == "gaps":
        found |= {"none": [], "nan inside": [0.1, math.nan], "negative inside": [0.1, -0.1], "many": [0.1] * 100_000}
    return found


TAKEN = {
    ("springs", "None"), ("restitution", "None"), ("kn", "inf"), ("inertia_ratio", "inf"), ("form", "mapping"),
    ("plane_contact.plane_contact_theta", "velocity", "away"), ("ball_on_plane.slide_and_roll", "velocity", "away"),
    ("ball_on_plane.slip_of", "velocity", "away"),
}  # fmt: skip
"""What means something to some: a rigid contact, a body that cannot turn, the scheme's own impact law, a disk that leaves."""


@pytest.mark.parametrize("name", CHECKED)
def test_what_is_out_of_range_is_refused_by_name(name: str) -> None:
    wrong = []
    for argument in inspect.signature(FUNCTIONS[name]).parameters:
        if argument in OBJECTS or argument not in right(name):
            continue
        for label, value in odd_values(argument).items():
            begun = time.perf_counter()
            try:
                result = FUNCTIONS[name](**{**right(name), argument: value})
            except ValueError as error:
                if argument not in str(error):
                    wrong.append(f"{argument} = {label}: the message does not name it: {error}")
            except Exception as error:
                wrong.append(f"{argument} = {label}: {type(error).__name__}: {error}")
            else:
                if (argument, label) not in TAKEN and (name, argument, label) not in TAKEN:
                    wrong.append(f"{argument} = {label}: taken, with the result {result!r:.100}")
            assert time.perf_counter() - begun < MOST_SECONDS, (argument, label)
    assert not wrong, "\n".join(wrong)


BOUNDED = {"chain.chain_of_springs", *(name for name in CHECKED if name.startswith("ellipse"))}
"""Functions whose work is bounded by a number of events or directions, each of which takes milliseconds: slow, and of no size."""
EXTREMES = (1e-100, 1e-6, 200.0, 1e30)
"""Sizes that parameters of cases may have."""


Identity = Callable[[dict[str, Any], Any], tuple[float, float]]


def turned(given: dict[str, Any], found: Any) -> tuple[float, float]:
    """An impact at the contact point changes no angular momentum about it: ``I domega = -m R dv_x``."""
    inertia = given["inertia_ratio"] * given["radius"] ** 2
    return inertia * found.spin + given["radius"] * found.vx, inertia * given["spin"] + given["radius"] * given[
        "velocity"
    ][0]


IDENTITIES: dict[str, Identity] = {
    "bouncing.landing_speed": lambda given, found: (found**2, 2.0 * given["g"] * given["height"]),
    "collision.final_velocities": lambda given, found: (
        given["mass_1"] * found[0] + given["mass_2"] * found[1],
        given["mass_1"] * given["v_1"] + given["mass_2"] * given["v_2"],
    ),
    "oblique_impact.rigid_rebound": turned,
    "oblique_impact.spring_rebound": turned,
    "rolling_incline.roll_rates": lambda given, found: (
        given["mass"] * found.along,
        given["mass"] * given["g"] * math.sin(given["angle"]) - found.fs,
    ),
    "sliding.critical_dt": lambda given, found: (given["mu"] * given["speed"] * found, given["g0"]),
    "slip_to_roll.stop_time": lambda given, found: (given["mu"] * given["g"] * found, given["speed"]),
    "stack.pyramid_forces": lambda given, found: (2.0 * found.side * math.cos(found.angle), given["weight"]),
}
"""Both sides of a balance that the closed form has to keep, whatever the size of its arguments."""


@pytest.mark.parametrize("name", IDENTITIES)
def test_closed_forms_keep_their_balances_at_extreme_sizes(name: str) -> None:
    kept = 0
    for argument, usual in right(name).items():
        for value in EXTREMES if isinstance(usual, float) else ():
            given = {**right(name), argument: value}
            try:
                left, expected = IDENTITIES[name](given, FUNCTIONS[name](**given))
            except ValueError:
                continue
            # Some hundred roundings: no balance has terms that are much larger than their sum.
            assert left == pytest.approx(expected, rel=1e-13, abs=0.0), (argument, value)
            kept += 1
    assert kept >= 2


@pytest.mark.parametrize("name", [name for name in CHECKED if name not in BOUNDED])
def test_extreme_sizes_cost_nothing(name: str) -> None:
    """One argument at a time: an answer without infinities, or an error that names it; never more memory or time than `MOST_BYTES`."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    unknown = not finite(FUNCTIONS[name](**right(name)), unknown=False)
    for argument, usual in right(name).items():
        if argument in OBJECTS or not isinstance(usual, float):
            continue
        for value in EXTREMES:
            begun = time.perf_counter()
            try:
                with np.errstate(all="ignore"):
                    found = FUNCTIONS[name](**{**right(name), argument: value})
            except ValueError:
                pass
            else:
                assert finite(found, unknown=unknown), (argument, value)
            assert time.perf_counter() - begun < MOST_SECONDS, (argument, value)
            used = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
            assert used < MOST_BYTES, (argument, value)
