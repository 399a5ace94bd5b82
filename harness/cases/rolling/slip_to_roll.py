"""Disk thrown with slip on a plane: it slides, then rolls (appendix A.3.3 with rotations), and how far engines may be off."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall
from ninedisk.harness.api.case import Check, FloatArray, Headline, Observed, Parameter, ParameterError, Setup, Value
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.cases.common import (
    CONTACT_DT,
    CONTACT_DYNAMICS,
    EXACT_STEP_RTOL,
    FRICTION,
    GRAVITY,
    PRELOAD,
    SHEAR_STIFFNESS,
    STEP,
    STIFFNESS,
    THETA,
    contact_step,
    last,
    numerics_of,
    round_off_speed,
    series_and_final,
    single,
    single_precision,
    slack_time,
    soft_reason,
    summed_round_off,
    whole_steps,
)
from ninedisk.harness.cases.differences import LIFTS, checks_with_allowance, follows_associated_rule
from ninedisk.harness.cases.rolling.figures import SLIP_TO_ROLL_CLAIMS, SLIP_TO_ROLL_FIGURES
from ninedisk.references.analytic.on_plane.slip_to_roll import (
    UNIFORM_DISK,
    slide_to_stop,
    slip_end,
    slip_to_roll,
    spring_overshoot,
    stop_time,
)
from ninedisk.references.exact_steps.rolling import associated_rolling

RADIUS, MASS = 1.0, math.pi
"""Unit radius and density."""

PAIR = (0, 1)
PHASE = 0.1
"""Default resolution of the contact: ``omega dt <= PHASE``, omega the higher of the normal and the shear frequency."""

CONTACT_BETA = 1.0
"""The plane's dashpot is critical: a landing (``start=dilated``) does not bounce for long."""

RUN = 3.0
"""Default duration in units of v0/(mu g), the time in which a disk that cannot turn stops; a rolling disk
rolls from a third of it on."""


NO_TURN = 1e30
"""Inertia ratio that represents a disk that cannot turn: 1 + 1/k is 1 to the last bit."""


class SlipToRoll:
    """A disk with forward velocity and no spin on a plane, under gravity."""

    id = "slip-to-roll"
    version = 1
    title = "Slip to roll"
    source = "appendix A.3.3 of Lim's thesis (rotations); classical rigid-body mechanics"
    requirement = "slides until v0/(3 mu g), then rolls at 2 v0/3; without rotation stops at v0/(mu g)"
    figures = SLIP_TO_ROLL_FIGURES
    claims = SLIP_TO_ROLL_CLAIMS
    parameters: tuple[Parameter, ...] = (
        FRICTION,
        STEP,
        Parameter.positive("speed", 1.0, unit="m/s", help="initial velocity"),
        GRAVITY,
        Parameter(name="rotating", default=True, help="false: the disk cannot turn"),
        Parameter(
            name="start",
            default="touching",
            choices=("touching", "dilated"),
            help="gap at time 0: none, or mu v0 dt, at which the associated rule (theta = 1) slides from the start",
        ),
        STIFFNESS,
        SHEAR_STIFFNESS,
        PRELOAD,
        CONTACT_DT,
        Parameter.positive(
            "duration",
            None,
            unit="s",
            help="length of the run; none: 3 v0/(mu g), and 4 times the fall from a dilated start",
        ),
        THETA,
        *CONTACT_DYNAMICS,
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Three steps, Coulomb's law, a disk that cannot turn, soft springs, and springs that start without a shear force."""
        rows: list[Mapping[str, Value]] = [{"mu": 0.3, "dt": dt} for dt in (0.01, 0.005, 0.0025)]
        rows += [{"mu": 0.3, "dt": 0.01, "rotating": rotating, "sliding": "coulomb"} for rotating in (True, False)]
        rows += [{"mu": 0.3, "dt": 0.01, "rotating": False}, {"mu": 0.3, "dt": 0.01, "kn": 1e6}]
        return [*rows, {"mu": 0.3, "dt": 0.01, "preload": False}]

    def build(self, params: Mapping[str, Any]) -> Setup:
        """One disk on a horizontal plane; springs start with the weight's overlap and, with preload, full sliding friction."""
        mu, g, kn, rotating = params["mu"], params["g"], params["kn"], params["rotating"]
        ks = kn if params["ks"] is None else params["ks"]
        law = ContactLaw(kn=kn, ks=ks, mu=mu, beta=CONTACT_BETA, restitution=0.0, regularised=True)
        touching = params["start"] == "touching"
        lift = 0.0 if touching else mu * params["speed"] * params["dt"]
        height = RADIUS - MASS * g / kn if touching else RADIUS + lift
        if height <= 0.0:
            raise ParameterError(
                f"kn = {kn:g} N/m is not allowed: the disk would sink into the plane "
                f"by its weight; use kn > {MASS * g / RADIUS:g}"
            )
        scene = Scene(
            disks=Disks(
                x=np.array([[0.0, height]]),
                v=np.array([[params["speed"], 0.0]]),
                radius=np.array([RADIUS]),
                mass=np.array([MASS]),
                rotating=np.array([rotating]),
            ),
            disk_disk=law,
            walls=(Wall(name="plane", point=(0.0, 0.0), normal=(0.0, 1.0), law=law),),
            gravity=(0.0, -g),
            initial_shear={PAIR: -mu * MASS * g} if touching and params["preload"] else {},
        )
        fastest = max(math.sqrt(kn / MASS), shear_frequency(ks, MASS, inertia_ratio(params)))
        numerics = numerics_of(
            params,
            n_steps=whole_steps(params, RUN * params["speed"] / (mu * g) + 4.0 * math.sqrt(2.0 * lift / g)),
            contact_dt=contact_step(params["dt"], PHASE / fastest),
            theta=params["theta"],
        )
        return Setup(scene=scene, numerics=numerics, watch=(PAIR,), labels={"contact": PAIR})

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """Motion, spin (positive when rolling forward), slip and ``lift``, the largest gap.

        ``slip_end`` is the first sample of lasting rolling. Slip counts as ended within `slip_tolerance`, which allows for the swing
        that a shear spring of the scene's stiffness leaves. NaN where the slip never ends.
        """
        vx, spin = history.v[:, 0, 0], 0.0 - history.omega[:, 0]
        slip = vx - RADIUS * spin
        series = {
            "x": ("m", history.x[:, 0, 0] - setup.scene.disks.x[0, 0]),
            "vx": ("m/s", vx),
            "spin": ("rad/s", spin),
            "slip": ("m/s", slip),
            "gap": ("m", history.gap[:, 0]),
        }
        scalars = {f"{name}_final": (unit, last(values)) for name, (unit, values) in series.items()}
        scalars["lift"] = ("m", float(np.maximum(series["gap"][1], 0.0).max()))
        # Written so that a NaN counts as slip.
        slips = np.flatnonzero(~(np.abs(slip) <= slip_tolerance(params, setup, inertia_ratio(params))))
        first = int(slips[-1]) + 1 if len(slips) else 0
        scalars["slip_end"] = ("s", float(history.t[first]) if first < len(history.t) else math.nan)
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """The rigid disk's way, its speed in the end, its spin all the while, and its lift, which Coulomb's law does not know.

        A disk that starts above the plane falls first: of its path there is no closed form.
        """
        truth_end = truth(params, observed.t[-1:], RADIUS, inertia_ratio(params)).curves
        falls, path = params["start"] == "dilated", float(truth_end["x"][0])
        source, spin = (
            "rigid disk with Coulomb friction",
            truth(params, observed.t, RADIUS, inertia_ratio(params)).curves["spin"],
        )
        return (
            Headline(name="distance", use="rolling", quantity="x_final", expected=math.nan if falls else path, source=source,
                     scale=path, scale_is="distance of the rigid disk"),
            Headline(name="final speed", use="rolling", quantity="vx_final", expected=float(truth_end["vx"][0]),
                     source=source, scale=params["speed"], scale_is="initial speed"),
            Headline(name="spin", use="rolling", quantity="spin", expected=np.full_like(observed.t, math.nan) if falls else spin,
                     source=source, scale=params["speed"] / RADIUS, scale_is="initial speed over the radius"),
            Headline(name="lift of the sliding disk", use="sliding", quantity="lift", expected=math.nan if falls else 0.0,
                     source="Coulomb's law: no dilation", scale=path, scale_is="distance of the rigid disk"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """History, end of slip and rolling speed; a start above the plane binds contact dynamics alone."""
        ratio = inertia_ratio(params)
        analytic = truth(params, observed.t, RADIUS, ratio)
        sizes = {"gap": RADIUS, "spin": params["speed"] / RADIUS}

        def continuous(setup: Setup, engine: EngineInfo) -> list[Check]:
            limit = bounds(params, setup, observed, engine, ratio)
            names = ("x", "vx", "spin", "slip", "gap")
            source = "rigid disk with Coulomb friction"
            tolerance = {name: (limit.atol[name], 0.0, limit.why[name]) for name in names}
            expected = {**analytic.curves, "gap": np.full_like(observed.t, limit.rest_gap)}
            end = end_of_slip(params, setup, observed, engine, limit, analytic.curves["slip"], ratio)
            return [
                *series_and_final(names, expected, truth="analytic", source=source, tolerance=tolerance, sizes=sizes),
                end,
            ]

        found = checks_with_allowance(LIFTS, setup, engine, continuous)
        if params["start"] == "dilated" and engine.contact != "cd":
            # The flight down to the plane is no part of the closed form; the rolling speed does not depend on it.
            return [check for check in found if check.quantity in ("vx_final", "spin_final", "slip_final")]
        exact = binding_history(params, setup, observed, engine, RADIUS, ratio)
        if exact is None:
            return found
        source = f"{engine.scheme}: sum of the exact velocities"
        why = "velocities at the steps are the rigid disk's own, positions their sum: round-off"
        if "gap" in exact.curves:
            source = f"{engine.scheme}, associated rule: (A.6) in every step"
            why = "exact solution of this very scheme: round-off of the steps and of the solver"
        t_end = float(observed.t[-1])
        # Velocities are round-off of the larger of what the disk has and of what gravity and the plane exchange in the run.
        rough = single(engine, max(params["speed"], params["g"] * t_end), setup.numerics.n_steps)
        if rough:
            why += " in single precision"
        floor = {
            "x": 1e-12 * params["speed"] * t_end + rough * t_end,
            "vx": rough,
            "spin": rough / (ratio * RADIUS),
            "gap": 1e-12 * RADIUS,
            "slip": 1e-11 * params["speed"],
        }
        stepped = series_and_final(
            tuple(exact.curves),
            exact.curves,
            truth="exact-step",
            source=source,
            tolerance={name: (floor.get(name, 0.0), EXACT_STEP_RTOL, why) for name in exact.curves},
            sizes=sizes,
        )
        return [*stepped, *found]


def end_of_slip(
    params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo, limit: SlipBounds, slip: FloatArray,
    inertia_ratio: float,
) -> Check:  # fmt: skip
    """The first sample of rolling: that at which the rigid disk's own ``slip`` is within `slip_tolerance`, or a neighbour.

    Where the error that an engine's slip may have takes the disk's across that tolerance at a sample, the next one counts as well.
    """
    allowed = slip_tolerance(params, setup, inertia_ratio)
    error = 0.0 if follows_associated_rule(engine, setup.numerics) else limit.atol["slip"]

    def first(level: float) -> float:
        rolls = np.flatnonzero(np.abs(slip) <= max(level, 0.0))
        return float(observed.t[rolls[0]]) if len(rolls) else math.nan

    expected = first(allowed)  # NaN, no truth, where the run ends before the slip does
    spread = float(np.nan_to_num(max(expected - first(allowed + error), first(allowed - error) - expected)))
    return Check(
        quantity="slip_end", norm="scalar", truth="analytic", expected=expected,
        source="rigid disk with Coulomb friction, first sample of rolling",
        atol=spread + limit.atol["slip_end"] + 1e-9 * float(observed.t[-1]), why=limit.why["slip_end"],
    )  # fmt: skip


def inertia_ratio(params: Mapping[str, Any]) -> float:
    """``I/(m R^2)``; `NO_TURN` for a disk that cannot turn."""
    return UNIFORM_DISK if params["rotating"] else NO_TURN


SAMPLED = "the sample at which slip has ended, or the next where its error takes it across the tolerance there"
"""Reason of the tolerance of slip's end."""


class Truth(NamedTuple):
    """Curves by quantity, each of shape (s,), and the end of slip [s]."""

    curves: Mapping[str, FloatArray]
    slip_end: float


class SlipBounds(NamedTuple):
    """Absolute tolerances by quantity with their reasons, and the gap at rest [m]."""

    atol: Mapping[str, float]
    why: Mapping[str, str]
    rest_gap: float


def truth(params: Mapping[str, Any], t: FloatArray, radius: float, inertia_ratio: float) -> Truth:
    """Rigid disk with Coulomb friction, at times ``t`` [s]; spin and slip positive when rolling forward."""
    mu, speed, g = params["mu"], params["speed"], params["g"]
    if inertia_ratio == NO_TURN:
        history, end = slide_to_stop(t, mu=mu, speed=speed, g=g), stop_time(mu=mu, speed=speed, g=g)
    else:
        history = slip_to_roll(t, mu=mu, speed=speed, g=g, radius=radius, inertia_ratio=inertia_ratio)
        end = slip_end(mu=mu, speed=speed, g=g, inertia_ratio=inertia_ratio)
    spin = 0.0 - history.spin
    slip = np.where(t < end, history.vx - radius * spin, 0.0)
    return Truth({"x": history.x, "vx": history.vx, "spin": spin, "slip": slip}, end)


def binding_history(
    params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo, radius: float, inertia_ratio: float
) -> Truth | None:
    """Exact steps of the theta scheme's associated rule, or of schemes whose velocities are exact. None for other schemes.

    Sliding friction is constant, and the step in which slip ends leaves the disk rolling, whatever its fraction that
    still slipped: the velocities at the steps are the continuous ones. Positions add the velocity at a step's begin
    (position-first), end, or a mean of the two (Moreau-Jean). Under the associated rule the gap belongs to the solution, and
    to the curves.
    """
    numerics = setup.numerics
    if engine.scheme == "theta" and numerics.sliding == "associated":
        if numerics.theta != 1.0 or numerics.impact != "theta":
            return None
        steps = associated_rolling(
            mu=params["mu"],
            g=params["g"],
            mass=float(setup.scene.disks.mass[0]),
            radius=radius,
            inertia_ratio=math.inf if inertia_ratio == NO_TURN else inertia_ratio,
            speed=params["speed"],
            dt=numerics.dt,
            n_steps=numerics.n_steps,
            gap_0=params["mu"] * params["speed"] * params["dt"] if params["start"] == "dilated" else 0.0,
        )
        stepped = {name: getattr(steps, name)[observed.step] for name in ("x", "vx", "spin", "slip", "gap")}
        return Truth(stepped, math.nan)
    ends = {"position-first-euler": 0.0, "semi-implicit-euler": 1.0}
    if engine.scheme == "theta" and numerics.theta == 1.0 and numerics.sliding == "coulomb":
        ends["theta"] = 1.0
    if engine.scheme == "moreau-jean":
        ends["moreau-jean"] = float(engine.option("theta", numerics))
    if engine.contact == "spring" or engine.scheme not in ends:
        return None
    times = np.arange(numerics.n_steps + 1, dtype=np.float64) * numerics.dt
    continuous = truth(params, times, radius, inertia_ratio)
    vx = continuous.curves["vx"]
    end = ends[engine.scheme]
    used = end * vx[1:] + (1.0 - end) * vx[:-1]
    x = np.concatenate(([0.0], np.cumsum(used) * numerics.dt))
    curves = {"x": x, "vx": vx, "spin": continuous.curves["spin"]}
    return Truth({name: curve[observed.step] for name, curve in curves.items()}, continuous.slip_end)


def shear_frequency(ks: float, mass: float, inertia_ratio: float) -> float:
    """Angular frequency [rad/s] of a disk that sticks to its shear spring."""
    return math.sqrt((1.0 + 1.0 / inertia_ratio) * ks / mass)


def slip_tolerance(params: Mapping[str, Any], setup: Setup, inertia_ratio: float) -> float:
    """Slip velocity [m/s] below which the disk counts as rolling: one and a half times what its shear spring leaves."""
    swing = _overshoot(params, setup, inertia_ratio)
    return 1.5 * swing * (1.0 + 1.0 / inertia_ratio) + 1e-9 * float(params["speed"])


def _overshoot(params: Mapping[str, Any], setup: Setup, inertia_ratio: float) -> float:
    """Amplitude [m/s] of the velocity that the shear spring leaves.

    The contact step in which slip ends adds nothing: the force never exceeds the cap, and central differences keep
    ``(F/ks)^2 omega^2 + u^2/(1 - (omega dt)^2/4)``, so that the slip u at the steps swings by no more than the spring's
    own amplitude.
    """
    law, mass = setup.scene.walls[0].law, float(setup.scene.disks.mass[0])
    return spring_overshoot(mu=params["mu"], g=params["g"], mass=mass, ks=law.ks, inertia_ratio=inertia_ratio)


def bounds(
    params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo, inertia_ratio: float
) -> SlipBounds:
    """Tolerances of the continuous solution for this engine."""
    if engine.contact == "spring":
        return _spring_bounds(params, setup, observed, inertia_ratio)
    return _rigid_bounds(params, setup, observed, engine, inertia_ratio)


def _per_velocity(setup: Setup, inertia_ratio: float) -> tuple[float, float]:
    """Changes of spin and slip that friction makes together with a unit change of vx."""
    radius = float(setup.scene.disks.radius[0])
    turning = inertia_ratio != NO_TURN
    return (1.0 / (inertia_ratio * radius) if turning else 0.0), (1.0 + 1.0 / inertia_ratio if turning else 1.0)


def _spring_bounds(params: Mapping[str, Any], setup: Setup, observed: Observed, inertia_ratio: float) -> SlipBounds:
    """Sliding is exact (constant force); what follows swings by the overshoot of the shear spring, undamped."""
    law, disks = setup.scene.walls[0].law, setup.scene.disks
    contact_dt = setup.numerics.contact_dt or setup.numerics.dt
    mass, radius = float(disks.mass[0]), float(disks.radius[0])
    weight, t_end = mass * params["g"], float(observed.t[-1])
    steps = t_end / contact_dt
    rounding = round_off_speed(radius, contact_dt) + summed_round_off(params["speed"], steps)
    swing = _overshoot(params, setup, inertia_ratio)
    spin, slip = _per_velocity(setup, inertia_ratio)
    omega = shear_frequency(law.ks, mass, inertia_ratio)
    # Where in the overlap the friction acts is open: an arm R - overlap/2 changes the rolling speed by v0 overlap/R at
    # most.
    arm = params["speed"] * weight / (law.kn * radius)
    late = 0.0 if params["preload"] else _friction_late(params, law.ks, mass, omega, contact_dt)
    vx = swing + rounding + arm + late
    why = f"overshoot of the shear spring, {swing:.3g} m/s; lever arm within the overlap, {arm:.3g} m/s"
    why += f"; friction that starts from zero, {late:.3g} m/s" if late else ""
    atol = {
        # The swing's way is its amplitude over omega, from one side to the other; the step in which slip ends shifts
        # the rest.
        "x": 2.0 * swing / omega
        + contact_dt * swing
        + (rounding + arm + late) * t_end
        + summed_round_off(params["speed"] * t_end, steps),
        "vx": vx,
        "spin": spin * vx,
        "slip": slip * vx,
        "gap": 8.0 * float(np.spacing(radius)),
        "slip_end": 0.0,
    }
    reasons = {
        "x": why,
        "vx": why,
        "spin": why,
        "slip": why,
        "gap": "weight over kn; round-off of the height",
        "slip_end": SAMPLED,
    }
    return SlipBounds(atol, reasons, -weight / law.kn)


def _friction_late(params: Mapping[str, Any], ks: float, mass: float, omega: float, contact_dt: float) -> float:
    """Velocity [m/s] that friction has not taken yet when a shear spring that starts without a force has reached the cap.

    The spring of a disk with the slip v0 carries ``ks v0/omega sin(omega t)``, which reaches ``mu m g`` after ``asin(mu m g omega/(ks
    v0))/omega``; until then, and for the step that notices it, at most ``mu g`` is lacking. A spring so soft that it never gets there
    lets the disk swing with all of its speed.
    """
    part = params["mu"] * mass * params["g"] * omega / (ks * params["speed"])
    time = math.asin(min(part, 1.0)) / omega + contact_dt
    return float(params["mu"] * params["g"] * time + (params["speed"] if part >= 1.0 else 0.0))


def _rigid_bounds(
    params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo, inertia_ratio: float
) -> SlipBounds:
    """Rigid contacts: exact velocities, positions summed from one end of each step.

    The sum of a velocity that falls by ``dv`` in all is off by ``dt dv/2``; the kink where slip ends adds at most ``mu
    g dt^2/8``. The associated rule lifts the disk by ``mu v0 dt``: from a start in touch the first step gives it ``vy =
    mu v0/(1 + mu^2)`` for ``mu`` times that in vx, and it flies for ``2 vy/g`` until friction goes on; at the end the
    speed is the same.
    """
    mu, speed, g, dt = params["mu"], params["speed"], params["g"], setup.numerics.dt
    t_end = float(observed.t[-1])
    spin, slip = _per_velocity(setup, inertia_ratio)
    lost = speed / slip
    associated = follows_associated_rule(engine, setup.numerics)
    lift_vy = mu * speed / (1.0 + mu**2) if associated and params["start"] == "touching" else 0.0
    flight = 2.0 * lift_vy / g
    # Friction of the lift's impulse and of the flight that it replaces, and a step's at the kinks. A convex engine may land
    # and lift again: momentum keeps vx at its truth less mu vy all the while, which this covers.
    let_through = slack_time(engine, dt)
    rough = g * let_through + single(engine, max(speed, g * t_end), setup.numerics.n_steps)
    vx = (mu * lift_vy + mu * g * (flight + dt) if associated else 0.0) + 1e-11 * speed + rough
    fall = g * dt**2 if associated and engine.contact != "cd" else 0.0
    weight_yields = (
        float(setup.scene.disks.mass[0]) * g / setup.scene.walls[0].law.kn
        if Difference.KEEPS_KN in engine.differences
        else 0.0
    )
    atol = {
        "x": 0.5 * dt * lost + mu * g * dt**2 / 8.0 + (vx * (lost / (mu * g) + flight) if associated else 0.0)
        + 1e-12 * speed * t_end + rough * t_end,
        "vx": vx,
        "spin": spin * vx,
        "slip": slip * vx,
        "gap": 1e-12 + (mu * speed * dt + lift_vy**2 / (2.0 * g) + fall if associated else 0.0) + rough * t_end + weight_yields,
        "slip_end": (dt + flight if associated else 0.0) + let_through / mu,
    }  # fmt: skip
    rule = "; lift of the associated rule" if associated else ""
    rule += soft_reason(engine) + single_precision(engine)
    exact = "constant friction: exact velocities, round-off" + rule
    why = {
        "x": "first order in dt: dt (v0 - v_final)/2" + rule,
        "vx": exact,
        "spin": exact,
        "slip": exact,
        "gap": "rigid contact: round-off of the height, more where an engine states a slop" + rule,
        "slip_end": SAMPLED + rule,
    }
    return SlipBounds(atol, why, 0.0)


CASE = SlipToRoll()
