"""A box with balls on it is pushed along the floor: it slides under them, and they roll."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.law import SphereLaw
from ninedisk.core.scene import BodyForce, PlaneWall, Spheres, SphereScene
from ninedisk.harness.api.case import (
    Check,
    FloatArray,
    Headline,
    Observed,
    Parameter,
    ParameterError,
    SphereSetup,
    Value,
)
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.box.scene import (
    KN,
    OFF,
    SOLVED,
    askew_of,
    box_checks,
    corner_response,
    frame_at,
    spring_step,
)
from ninedisk.harness.cases.common import (
    EXACT_STEP_RTOL,
    last,
    numerics_of,
    single,
    single_precision,
    slack_time,
    soft_reason,
    whole_steps,
)
from ninedisk.harness.results.figures import Figure, Plotted
from ninedisk.references.analytic.on_plane.carried_balls import Carried, carried_balls

MASS, CARRIED, G = 10.0, 25.0, 9.81
"""Mass of the box and of all balls together [kg], and gravity [m/s^2]."""

HALF = np.array([0.6, 0.5, 0.1])
"""Half the edges of the box of size 1 [m]."""

OUTER = np.array([0.4, 0.32])
"""Place of the outer balls on the box of size 1, along its edges [m]."""

MARGIN = float((HALF[:2] - OUTER).min())
"""From there to the edge [m]."""

SOURCE = "Newton and Euler: a ball that rolls on a box follows with 2/7 of its acceleration"


class _Load(NamedTuple):
    """Balls of the box of size 1: places on it [m], shape (n, 2), radii [m] and masses [kg]. Opposite balls are alike."""

    place: FloatArray
    radius: FloatArray
    mass: FloatArray


class BoxCarriesBalls:
    """SimBenchmark's 10 kg box with 25 balls of 1 kg, pushed by 150 N. All balls move alike, whatever their radii and masses.

    Friction bears 137.3 N, whatever the direction of the push: a pyramid of friction with edges along x and y bears 194 N at 45 degrees,
    and turns the motion elsewhere. The load is centred on the line of the motion, so that nothing turns the box.
    """

    id = "box/carries-balls"
    version = 1
    title = "A box slides under balls that roll on it"
    source = SOURCE
    requirement = (
        "the box moves with (F - mu (M + m) g)/(M + 2 m/7), straight, and every ball with 2/7 of that; both rest below the friction, "
        "in every direction"
    )
    parameters: tuple[Parameter, ...] = (
        Parameter(name="push", default=150.0, low=0.0, high=1000.0, unit="N", in_id=True, help="force on the box"),
        Parameter(name="direction_deg", default=45.0, low=-360.0, high=360.0, unit="deg", in_id=True,
                  help="direction of the push to the x axis, along which the box is longest"),
        Parameter(name="rows", default=5, low=2, high=5, whole=True, in_id=True,
                  help="rows of balls, and balls in each; together they have 25 kg"),
        Parameter(name="balls", default="equal", choices=("equal", "unequal"), in_id=True, help="of one radius and mass, or of several"),
        Parameter(name="order", default="listed", choices=("listed", "shuffled"), in_id=True,
                  help="the box first, or somewhere among the balls"),
        Parameter(name="mu", default=0.4, low=0.05, high=1.0, unit="-", help="friction coefficient, of the floor and of the balls"),
        Parameter.positive("size", 1.0, high=100.0, unit="-", in_id=True, help="factor of all lengths; the masses stay"),
        Parameter.positive("dt", 0.005, high=0.01, unit="s", help="step"),
        Parameter.positive("duration", 0.06, unit="s", help="length of the run"),
    )  # fmt: skip
    figures = (
        Figure(
            title="The box and its balls",
            quantities=(Plotted("speed", "speed of the box"), Plotted("balls", "mean speed of the balls")),
            compare="direction_deg",
            shows="Speeds along the push.",
            allows="They are the same in all directions; a pyramid of friction holds the box at 45 degrees.",
        ),
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """SimBenchmark's; three directions, three sizes, unequal balls among which the box is, and a push that does not move it."""
        return [
            {},
            {"rows": 2, "direction_deg": 0.0},
            {"rows": 3, "direction_deg": 20.0, "balls": "unequal", "order": "shuffled"},
            {"rows": 2, "push": 130.0},
            {"rows": 2, "size": 0.1},
            {"rows": 2, "size": 10.0},
        ]

    def build(self, params: Mapping[str, Any]) -> SphereSetup:
        """A box on a plane, and balls on the box."""
        moves, size = _moves(params), float(params["size"])
        n_steps = whole_steps(params, params["duration"])
        t_end = n_steps * params["dt"]
        drift = 0.5 * (moves.box - moves.balls) * t_end * (t_end + params["dt"])
        if moves.needed > 0.95 * params["mu"]:
            raise ParameterError(
                f"push = {params['push']:g} N is not allowed with mu = {params['mu']:g}: the balls would slip; use less"
            )
        if drift > 0.95 * MARGIN * size:
            raise ParameterError(
                f"duration = {t_end:g} s is not allowed with push = {params['push']:g} N, mu = {params['mu']:g} and size = {size:g}: "
                f"the balls would move by {drift:.3g} m and leave the box; use a shorter one"
            )  # fmt: skip
        load, order, n = _load(params), _order(params), params["rows"] ** 2
        frame = frame_at(math.radians(params["direction_deg"]))
        x = np.zeros((1 + n, 3))
        x[0, 2] = size * HALF[2]
        x[1:, :2] = size * load.place
        x[1:, 2] = size * (2.0 * HALF[2] + load.radius)
        half = np.zeros_like(x)
        half[0] = size * HALF
        law = SphereLaw(kn=KN, ks=KN, mu=params["mu"], restitution=0.0, regularised=True)
        radius = np.concatenate([[float(np.linalg.norm(half[0]))], size * load.radius])
        mass = np.concatenate([[MASS], load.mass])
        bodies = Spheres(
            x=x[order], radius=radius[order], mass=mass[order], half_sizes=half[order],
            quaternion=np.tile([1.0, 0.0, 0.0, 0.0], (1 + n, 1)),
        )  # fmt: skip
        box, floor = _box(params), PlaneWall(name="floor", point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), law=law)
        fx, fy, fz = (params["push"] * frame.along).tolist()
        scene = SphereScene(
            spheres=bodies,
            sphere_sphere=law,
            walls=(floor,),
            gravity=(0.0, 0.0, -G),
            forces=(BodyForce(disk=box, force=(fx, fy, fz)),),
        )
        watch = (box, 1 + n)
        return SphereSetup(
            scene=scene,
            numerics=numerics_of(
                params, n_steps=n_steps, contact_dt=spring_step(params["dt"], HALF, float(load.mass.min()))
            ),
            watch=(watch,),
            labels={"floor": watch},
        )

    def observe(self, params: Mapping[str, Any], setup: SphereSetup, history: History) -> Observed:
        """Motion of the box and of the mean ball; the largest slip of a ball, and how far from the mean one moves."""
        frame, box = frame_at(math.radians(params["direction_deg"])), _box(params)
        v, omega = np.delete(history.v, box, axis=1), np.delete(history.omega, box, axis=1)
        radius = np.delete(setup.scene.spheres.radius, box)
        mean = v.mean(axis=1)
        surface = v - radius[:, None] * np.cross(omega, frame.up) - history.v[:, box, None]
        moved = history.x[:, box] - history.x[0, box]
        series = {
            "distance": ("m", moved @ frame.along),
            "across": ("m", moved @ frame.across),
            "speed": ("m/s", history.v[:, box] @ frame.along),
            "balls": ("m/s", mean @ frame.along),
            "rolling": ("m/s", ((omega @ frame.across) * radius).mean(axis=1)),
            "slip": ("m/s", np.linalg.norm(surface, axis=2).max(axis=1)),
            "unlike": ("m/s", np.linalg.norm(v - mean[:, None], axis=2).max(axis=1)),
            "turning": ("rad/s", np.linalg.norm(history.omega[:, box], axis=1)),
            "gap": ("m", history.gap[:, 0]),
        }
        scalars = {f"{name}_final": (series[name][0], last(series[name][1])) for name in ("distance", "balls")}
        scalars["aside"] = ("m", float(np.abs(series["across"][1]).max()))
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """How far the box gets, to the side as well, and how fast the balls."""
        t_end, moves = float(observed.t[-1]), _moves(params)
        free = _moves({**params, "mu": 0.0}).box * t_end
        way = 0.5 * free * t_end
        return (
            Headline(name="distance of a box under balls", use="sliding" if moves.box else "rest", quantity="distance_final",
                     expected=0.5 * moves.box * t_end**2, source=SOURCE, scale=way or 1.0, scale_is="distance without friction"),
            Headline(name="speed of balls on a box", use="rolling", quantity="balls_final", expected=moves.balls * t_end, source=SOURCE,
                     scale=free or 1.0, scale_is="speed of the box without friction"),
            Headline(name="displacement aside of a box under balls", use="sliding", quantity="aside", expected=0.0,
                     source="friction against the slip", scale=way or 1.0, scale_is="distance without friction"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """The motion in continuous time for all engines; exact steps where the scheme has them."""
        return box_checks((_exact, _continuous), params, setup, observed, engine)


def _moves(params: Mapping[str, Any]) -> Carried:
    return carried_balls(push=params["push"], mass=MASS, carried=CARRIED, mu=params["mu"], g=G)


def _load(params: Mapping[str, Any]) -> _Load:
    rows = params["rows"]
    line = np.linspace(-1.0, 1.0, rows)
    place = np.column_stack([np.repeat(line, rows), np.tile(line, rows)]) * OUTER
    if params["balls"] == "equal":
        return _Load(place, np.full(rows**2, 0.06), np.full(rows**2, CARRIED / rows**2))
    number = np.arange(rows**2)
    pattern = np.minimum(number, number[::-1]) * 7 % 13 / 12.0
    mass = 0.5 + pattern
    return _Load(place, 0.04 + 0.03 * (1.0 - pattern), CARRIED * mass / mass.sum())


def _order(params: Mapping[str, Any]) -> Any:
    """Numbers of the bodies, the box 0, in the order of the scene."""
    order = np.arange(1 + params["rows"] ** 2)
    return order if params["order"] == "listed" else np.roll(order[::-1], 4)


def _box(params: Mapping[str, Any]) -> int:
    """Number of the box in the scene."""
    return int(np.flatnonzero(_order(params) == 0)[0])


def _slack(params: Mapping[str, Any], setup: Any, engine: EngineInfo) -> tuple[float, float]:
    """Round-off and what soft contacts let through: a speed of the box and of the balls [m/s], an overlap [m].

    The box bears the balls, so that its contacts let through that much more of its free motion; a ball has that of its own besides.
    """
    numerics, half = setup.numerics, params["size"] * HALF
    t_end, loaded = numerics.dt * numerics.n_steps, (MASS + CARRIED) / MASS
    pressed = G * loaded + params["push"] / MASS
    speed = (corner_response(half) * pressed + G) * slack_time(engine, numerics.dt)
    speed += SOLVED * pressed * t_end + single(engine, pressed * t_end, numerics.n_steps)
    # What is in single precision touches with an overlap of some units in the last place of the coordinates.
    return speed, speed * t_end + 1e-12 * params["size"] + single(engine, float(half.max()), numerics.n_steps)


def _exact(params: Mapping[str, Any], setup: Any, observed: Observed, engine: EngineInfo) -> list[Check]:
    """Speeds grow by the same in each step; places are their sums."""
    numerics, t, moves = setup.numerics, observed.t, _moves(params)
    if engine.scheme == "semi-implicit-euler":
        lag = numerics.dt
    elif engine.scheme == "theta" and numerics.sliding == "coulomb":
        lag = (2.0 * numerics.theta - 1.0) * numerics.dt
    else:
        return []
    t_end, (speed, sunk) = float(t[-1]), _slack(params, setup, engine)
    aside = _askew(params) * t_end if askew_of(engine) else 0.0
    why = f"exact solution of this very scheme: round-off and the solver's tolerance{single_precision(engine)}"
    free = _moves({**params, "mu": 0.0}).box * t_end
    rows = (
        ("distance", 0.5 * moves.box * t * (t + lag), sunk + 0.5 * aside * t_end, 0.5 * free * t_end),
        ("speed", moves.box * t, speed + aside, free),
        ("balls", moves.balls * t, speed + aside, free),
        ("rolling", (moves.balls - moves.box) * t, speed + aside, free),
    )
    return [
        Check(quantity=name, norm="max", truth="exact-step", expected=expected, source=f"{engine.scheme}: sum of the exact speeds",
              rtol=EXACT_STEP_RTOL, atol=atol, scale=scale or 1.0, why=why)
        for name, expected, atol, scale in rows
    ]  # fmt: skip


def _askew(params: Mapping[str, Any]) -> float:
    """Acceleration [m/s^2] by which friction that is askew may change that of the box."""
    return float(OFF * params["mu"] * (MASS + CARRIED) * G / (MASS + 2.0 / 7.0 * CARRIED))


def _continuous(params: Mapping[str, Any], setup: Any, observed: Observed, engine: EngineInfo) -> list[Check]:
    numerics, t, moves, size = setup.numerics, observed.t, _moves(params), float(params["size"])
    dt, t_end, (speed, sunk) = numerics.dt, float(t[-1]), _slack(params, setup, engine)
    lever = size * float(HALF.min())
    atol = {
        "distance": sunk + 0.5 * moves.box * t_end * dt,
        "across": sunk,
        "speed": speed,
        "balls": speed,
        "rolling": speed,
        "slip": speed,
        "unlike": speed,
        "turning": speed / lever,
        "gap": sunk,
    }
    why = f"first order in the step{soft_reason(engine)}{single_precision(engine)}"
    if engine.contact == "soft":
        # A ball that the box leaves by more than round-off has no contact in a step, and the floor so much less to bear.
        dropped = G * dt
        missing = (params["mu"] * CARRIED * dropped) / (MASS + 2.0 / 7.0 * CARRIED)
        for name, part in (
            ("slip", dropped + missing),
            ("unlike", dropped),
            ("speed", missing),
            ("balls", missing),
            ("rolling", missing),
        ):
            atol[name] += part
        atol["distance"] += missing * t_end
        atol["turning"] += missing / lever
        why += f"; a ball may be without contact in a step: {dropped:.3g} m/s"
    if askew_of(engine):
        # So much of the friction acts across the path and turns the box, and the balls on it follow.
        gained = _askew(params) * t_end
        for name, part in (
            ("distance", 0.5 * t_end),
            ("across", 0.5 * t_end),
            ("gap", 5e-3 * t_end),
            ("turning", 1.0 / lever),
        ):
            atol[name] += gained * part
        for name in ("speed", "balls", "rolling", "slip", "unlike"):
            atol[name] += gained
        why += f"; friction is off by up to {OFF:g} of its bound"
    zero, free = np.zeros_like(t), _moves({**params, "mu": 0.0}).box * t_end or 1.0
    rows: list[tuple[str, FloatArray, float]] = [
        ("distance", 0.5 * moves.box * t**2, 0.5 * free * t_end),
        ("across", zero, 0.5 * free * t_end),
        ("speed", moves.box * t, free),
        ("balls", moves.balls * t, free),
        ("rolling", (moves.balls - moves.box) * t, free),
        ("slip", zero, free),
        ("unlike", zero, free),
        ("turning", zero, free / lever),
        ("gap", zero, size * float(HALF[2])),
    ]
    return [
        Check(quantity=name, norm="max", truth="analytic", expected=expected, source=SOURCE, atol=atol[name], scale=scale, why=why)
        for name, expected, scale in rows
    ]  # fmt: skip


CASE = BoxCarriesBalls()
