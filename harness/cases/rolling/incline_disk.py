"""Uniform disk on an incline: it rolls, or slides and spins; how far an engine may be from that is derived."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall
from ninedisk.harness.api.case import Check, Headline, Observed, Parameter, Setup, Value
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.cases.common import (
    CONTACT_DT,
    CONTACT_DYNAMICS,
    EXACT_STEP_RTOL,
    GRAVITY,
    PRELOAD,
    THETA,
    contact_softness,
    contact_step,
    last,
    numerics_of,
    round_off_speed,
    second_half,
    series_and_final,
    single,
    single_precision,
    slack_time,
    soft_reason,
    summed_round_off,
    whole_steps,
)
from ninedisk.harness.cases.differences import LIFTS, checks_with_allowance, follows_associated_rule
from ninedisk.harness.cases.incline.block import block_chatters
from ninedisk.harness.cases.rolling.slip_to_roll import shear_frequency
from ninedisk.references.analytic.on_plane.rolling_incline import RollRates, roll_down, roll_rates, rolling_mu
from ninedisk.references.analytic.on_plane.slip_to_roll import UNIFORM_DISK
from ninedisk.references.exact_steps.rolling import associated_rolling

RADIUS, MASS = 0.5, 7.854
"""Of the block on an incline (appendix A.3.4), which this disk is when it may turn."""

PAIR = (0, 1)
PHASE = 0.1
"""Default resolution of the contact: ``omega dt <= PHASE``, omega the higher of the normal and the shear frequency."""

CONTACT_BETA = 1.0
"""The plane's dashpot is critical; the disk starts in equilibrium normal to the plane, so that it has nothing to do."""

NAMES = ("x", "vx", "spin", "slip", "gap", "fn", "fs")


PER_SLIP = 1.0 + 1.0 / UNIFORM_DISK
"""Change of the slip that friction makes together with a unit change of the velocity."""


class InclineDisk:
    """A uniform disk released in touch with a plane under tilted gravity: x runs down the incline, y is its normal."""

    id = "rolling/incline-disk"
    version = 1
    title = "Disk on an incline, rolling or sliding"
    source = "rigid-body mechanics: rolling body on an incline, Goldstein, Classical Mechanics, section 2.4"
    requirement = (
        "mu > tan(angle)/3 rolls with a = 2/3 g sin, fs = 1/3 m g sin; below it slides with a = g (sin - mu cos) and spins "
        "up at 2 mu g cos/R"
    )
    parameters: tuple[Parameter, ...] = (
        Parameter(name="mu", default=0.3, low=0.0, unit="-", in_id=True, help="friction coefficient"),
        Parameter.positive("angle_deg", 20.0, high=89.0, unit="deg", help="slope of the incline"),
        Parameter.positive("dt", 0.01, unit="s", help="step; sampling of spring engines"),
        Parameter.positive("duration", 1.0, unit="s", help="length of the run"),
        GRAVITY,
        Parameter(
            name="kn",
            default=1e8,
            low=1e4,
            unit="N/m",
            help="normal and shear stiffness of spring engines; they start with the overlap and shear force of the motion",
        ),
        PRELOAD,
        CONTACT_DT,
        THETA,
        *CONTACT_DYNAMICS,
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Either branch, with both sliding rules of contact dynamics, and from no shear force; tan(20 deg)/3 is 0.121."""
        rows: list[Mapping[str, Value]] = [
            {"mu": mu, "sliding": sliding} for mu in (0.3, 0.1) for sliding in ("associated", "coulomb")
        ]
        return [*rows, *({"mu": mu, "preload": False} for mu in (0.3, 0.1))]

    def build(self, params: Mapping[str, Any]) -> Setup:
        """One disk on a horizontal plane, gravity tilted; springs carry the forces of the motion from the start, if preloaded."""
        angle, kn, g = math.radians(params["angle_deg"]), params["kn"], params["g"]
        rates = _rates(params)
        law = ContactLaw(kn=kn, ks=kn, mu=params["mu"], beta=CONTACT_BETA, restitution=0.0, regularised=True)
        scene = Scene(
            disks=Disks(x=np.array([[0.0, RADIUS - rates.fn / kn]]), radius=np.array([RADIUS]), mass=np.array([MASS])),
            disk_disk=law,
            walls=(Wall(name="incline", point=(0.0, 0.0), normal=(0.0, 1.0), law=law),),
            gravity=(g * math.sin(angle), -g * math.cos(angle)),
            # The disk is body i and the plane's normal is +y, hence t = +x: friction up the incline is fs < 0.
            initial_shear={PAIR: -rates.fs} if rates.fs > 0.0 and params["preload"] else {},
        )
        numerics = numerics_of(
            params,
            n_steps=whole_steps(params, params["duration"]),
            contact_dt=contact_step(params["dt"], PHASE / shear_frequency(kn, MASS, UNIFORM_DISK)),
            theta=params["theta"],
        )
        return Setup(scene=scene, numerics=numerics, watch=(PAIR,), labels={"contact": PAIR})

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """Motion, spin and slip (positive forward), gap and forces (``fs`` positive up the incline).

        ``lift`` is the largest gap; ``acceleration`` and ``spin_rate`` are means over the second half of the run, as are ``fn_mean``
        and ``fs_mean``; ``dilation`` is the final gap over ``mu slip dt``: 1 under the associated rule, 0 under Coulomb's.
        """
        vx, spin = history.v[:, 0, 0], 0.0 - history.omega[:, 0]
        fn, fs = history.fn[:, 0], -history.fs[:, 0]
        series = {
            "x": ("m", history.x[:, 0, 0] - setup.scene.disks.x[0, 0]),
            "vx": ("m/s", vx),
            "spin": ("rad/s", spin),
            "slip": ("m/s", vx - RADIUS * spin),
            "gap": ("m", history.gap[:, 0]),
            "fn": ("N", fn),
            "fs": ("N", fs),
        }
        scalars = {f"{name}_final": (unit, last(values)) for name, (unit, values) in series.items()}
        half = second_half(history.t)
        elapsed = float(history.t[-1] - history.t[half])
        scalars |= {
            "acceleration": ("m/s^2", float(vx[-1] - vx[half]) / elapsed),
            "spin_rate": ("rad/s^2", float(spin[-1] - spin[half]) / elapsed),
            "fn_mean": ("N", float(fn[half + 1 :].mean())),
            "fs_mean": ("N", float(fs[half + 1 :].mean())),
            "lift": ("m", float(np.maximum(series["gap"][1], 0.0).max())),
        }
        if params["mu"] > 0.0 and not rolls(params):
            lift = series["gap"][1][-1] - series["gap"][1][0]
            with np.errstate(divide="ignore", invalid="ignore"):
                scalars["dilation"] = ("1", float(lift / (params["mu"] * series["slip"][1][-1] * params["dt"])))
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """The rigid disk's way, its lift, which Coulomb's law does not know, the friction that drives its spin, and that spin."""
        rates, t_end = _rates(params), float(observed.t[-1])
        path = 0.5 * rates.along * t_end**2
        use, source = "rolling" if rolls(params) else "sliding", "Newton and Euler with Coulomb friction"
        return (
            Headline(name="distance down the incline", use=use, quantity="x_final", expected=path, source=source,
                     scale=path, scale_is="distance of the rigid disk"),
            Headline(name="lift of the disk", use=use, quantity="lift", expected=0.0, source="Coulomb's law: no dilation",
                     scale=path, scale_is="distance of the rigid disk"),
            # The spring of a disk that rolls from no shear force swings between none and twice the friction, faster than the samples.
            Headline(name="friction force", use=use, quantity="fs_mean", expected=math.nan if swings(params) else rates.fs, source=source,
                     scale=MASS * params["g"], scale_is="weight"),
            Headline(name="spin down the incline", use=use, quantity="spin_final", expected=rates.spin * t_end, source=source,
                     scale=rates.spin * t_end, scale_is="spin of the rigid disk"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Exact steps of the engine's scheme where there are any, and the continuous solution for all."""
        rates = _rates(params)
        bounds = roll_bounds(params, setup, observed, engine, rates)

        def continuous(setup: Setup, engine: EngineInfo) -> list[Check]:
            return _analytic(observed, rates, roll_bounds(params, setup, observed, engine, rates), engine)

        return [
            *_exact_steps(params, setup, observed, engine, rates),
            *checks_with_allowance(LIFTS, setup, engine, continuous),
            *_dilation(params, setup, engine, rates, bounds),
        ]


def _rates(params: Mapping[str, Any]) -> RollRates:
    return roll_rates(mu=params["mu"], angle=math.radians(params["angle_deg"]), g=params["g"], mass=MASS, radius=RADIUS)


def _analytic(observed: Observed, rates: RollRates, bounds: RollBounds, engine: EngineInfo) -> list[Check]:
    truth = roll_down(observed.t, rates)
    loaded = np.ones_like(observed.t)
    if engine.contact != "spring":
        loaded[0] = np.nan  # step-mean forces have no value before the first step
    expected = {**truth._asdict(), "gap": np.full_like(observed.t, bounds.rest_gap)}
    expected |= {"fn": truth.fn * loaded, "fs": truth.fs * loaded}
    source = "Newton and Euler with Coulomb friction"
    tolerance = {
        name: (bounds.atol[name] + bounds.swing * (name in ("fn", "fs")), 0.0, bounds.why[name]) for name in NAMES
    }
    sizes = _sizes(observed, rates)
    if bounds.forces_from > 0.0:
        expected["fs"] = np.where(observed.t >= bounds.forces_from, expected["fs"], np.nan)
    names = NAMES[:-1] if bounds.forces_from == math.inf else NAMES
    found = series_and_final(names, expected, truth="analytic", source=source, tolerance=tolerance, sizes=sizes)
    elapsed = float(observed.t[-1] - observed.t[second_half(observed.t)])
    numbers = (
        ("acceleration", rates.along, 2.0 * bounds.atol["vx"] / elapsed, "vx"),
        ("spin_rate", rates.spin, 2.0 * bounds.atol["spin"] / elapsed, "spin"),
        ("fn_mean", rates.fn, bounds.atol["fn"], "fn"),
        ("fs_mean", rates.fs, bounds.atol["fs"], "fs"),
    )
    return found + [
        Check(quantity=name, norm="scalar", truth="analytic", expected=value, source=source, atol=atol,
              why=f"over half the run: {bounds.why[of]}")
        for name, value, atol, of in numbers
        if of in names
    ]  # fmt: skip


def _sizes(observed: Observed, rates: RollRates) -> dict[str, float]:
    """Sizes of what is zero: a gap's is the radius, that of slip the speed of the disk."""
    return {"gap": RADIUS, "slip": rates.along * float(observed.t[-1])}


def _dilation(
    params: Mapping[str, Any], setup: Setup, engine: EngineInfo, rates: RollRates, bounds: RollBounds
) -> list[Check]:
    """A convex model that leaves the plane and lands again has a final gap of its last flight, which no closed form gives."""
    numerics = setup.numerics
    associated = follows_associated_rule(engine, numerics)
    length = params["mu"] * rates.slip * numerics.dt**2 * numerics.n_steps
    if length <= 0.0 or (associated and (numerics.theta != 1.0 or engine.contact != "cd")):
        return []
    atol = 2.0 * (1e-12 if associated else bounds.atol["gap"]) / length + EXACT_STEP_RTOL
    if atol >= 0.5:
        return []  # such an engine's gap cannot distinguish the associated rule from Coulomb's
    return [
        Check(quantity="dilation", norm="scalar", truth="exact-step" if associated else "analytic", scale=1.0,
              expected=1.0 if associated else 0.0,
              source="(A.6): gap = mu slip dt" if associated else "Coulomb's law: no dilation",
              atol=atol,
              why="round-off of the height and of the slip" if associated else bounds.why["gap"]),
    ]  # fmt: skip


def _exact_steps(
    params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo, rates: RollRates
) -> list[Check]:
    """Rates are constant, so that every Coulomb scheme has exact velocities and ``x_n = a dt^2 n (n + offset)/2``."""
    numerics, angle = setup.numerics, math.radians(params["angle_deg"])
    if engine.contact == "spring":
        return []
    offsets = {"position-first-euler": -1.0, "semi-implicit-euler": 1.0}
    if engine.scheme == "moreau-jean":
        offsets["moreau-jean"] = 2.0 * engine.option("theta", numerics) - 1.0
    if engine.scheme == "theta" and numerics.sliding == "coulomb":
        offsets["theta"] = 2.0 * numerics.theta - 1.0
    if engine.scheme in offsets:
        exact = roll_down(observed.t, rates)._asdict()
        n = observed.step.astype(np.float64)
        exact["x"] = rates.along * numerics.dt**2 * n * (n + offsets[engine.scheme]) / 2.0
        exact["fn"], exact["fs"] = (np.where(n > 0, exact[name], np.nan) for name in ("fn", "fs"))
        exact["gap"] = np.zeros_like(n)
        source = f"{engine.scheme}: exact velocities, positions their sum"
    elif engine.scheme == "theta" and numerics.theta == 1.0 and numerics.impact == "theta":
        steps = associated_rolling(
            mu=params["mu"], g=params["g"] * math.cos(angle), pull=params["g"] * math.sin(angle), mass=MASS, radius=RADIUS,
            inertia_ratio=UNIFORM_DISK, speed=0.0, dt=numerics.dt, n_steps=numerics.n_steps,
        )  # fmt: skip
        exact = {name: getattr(steps, name)[observed.step] for name in NAMES}
        source = "theta scheme, theta = 1, associated rule: (A.6) in every step"
    else:
        return []
    t_end = float(observed.t[-1])
    why = "exact solution of this very scheme: round-off of the steps and of the solver"
    rough = single(engine, params["g"] * t_end, numerics.n_steps) + 1e-13 * params["g"] * t_end
    of_force = single(engine, MASS * params["g"], 1)
    of_shear = of_force + rolling_round_off(engine, rates, MASS, numerics.dt, t_end)
    if engine.precision == "float32":
        why += " in single precision"
    floor = {"x": rough * t_end, "vx": rough, "spin": rough / (UNIFORM_DISK * RADIUS), "slip": 3.0 * rough}
    floor |= {"gap": 1e-12 * RADIUS + rough * t_end, "fn": of_force, "fs": of_shear}
    tolerance = {name: (floor[name], EXACT_STEP_RTOL, why) for name in NAMES}
    return series_and_final(
        NAMES, exact, truth="exact-step", source=source, tolerance=tolerance, sizes=_sizes(observed, rates)
    )


def rolls(params: Mapping[str, Any]) -> bool:
    """Whether friction suffices for rolling."""
    return bool(params["mu"] >= rolling_mu(angle=math.radians(params["angle_deg"])))


def swings(params: Mapping[str, Any]) -> bool:
    """Whether a shear spring swings about the friction of the rolling disk, undamped."""
    return rolls(params) and not params["preload"]


class RollBounds(NamedTuple):
    """Absolute tolerances by quantity and their reasons, the gap at rest [m], what one step's force is off by beyond its mean [N], and
    the time [s] from which friction has its value; infinite: never."""

    atol: Mapping[str, float]
    why: Mapping[str, str]
    rest_gap: float
    swing: float = 0.0
    forces_from: float = 0.0


def roll_bounds(
    params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo, rates: RollRates
) -> RollBounds:
    """Tolerances of the continuous solution for this engine."""
    if engine.contact == "spring":
        return _springs(params, setup, observed, rates)
    return _rigid(params, setup, observed, engine, rates)


def _spread(setup: Setup, *, x: float, vx: float, gap: float, fn: float, fs: float) -> dict[str, float]:
    """Tolerances by quantity; what friction does to vx it does to spin and slip, by ``1/(k R)`` and ``1 + 1/k``."""
    radius = float(setup.scene.disks.radius[0])
    spin = vx / (UNIFORM_DISK * radius)
    return {"x": x, "vx": vx, "spin": spin, "slip": PER_SLIP * vx, "gap": gap, "fn": fn, "fs": fs}


def _springs(params: Mapping[str, Any], setup: Setup, observed: Observed, rates: RollRates) -> RollBounds:
    """Springs begin in the equilibrium of the accelerated disk, and central differences are exact for constant rates.

    What remains is round-off (see `ninedisk.harness.cases.incline.block.spring_bounds`) and the arm of the friction: R, or
    within the overlap. An arm ``R - overlap/2`` turns the disk, and so every rate, by overlap/R at most.
    """
    law, radius = setup.scene.walls[0].law, float(setup.scene.disks.radius[0])
    contact_dt = setup.numerics.contact_dt or setup.numerics.dt
    t_end = float(observed.t[-1])
    steps = t_end / contact_dt
    overlap = rates.fn / law.kn
    arm = overlap / radius
    v_max = rates.along * t_end
    rounding = (1.0 + params["mu"]) * round_off_speed(radius, contact_dt) + summed_round_off(v_max, steps)
    speed = rounding + arm * v_max
    length = 8.0 * float(np.spacing(radius))
    force = law.kn * length + 1e-13 * rates.fn
    atol = _spread(
        setup,
        x=speed * t_end + summed_round_off(v_max * t_end / 2.0, steps),
        vx=speed,
        gap=length,
        fn=force,
        # A rolling disk's shear spring keeps the sum of the slip's rounding errors, and swings about what the arm makes of it.
        fs=(params["mu"] + law.ks / law.kn) * force + 2.0 * arm * rates.fs + law.ks * rounding * contact_dt,
    )
    why = f"constant rates, exact in the scheme: round-off; lever arm within the overlap, {arm:.2g} of R"
    exact = RollBounds(atol, dict.fromkeys(atol, why), -overlap)
    return exact if params["preload"] else _without_shear(params, setup, exact, rates, t_end)


def _without_shear(
    params: Mapping[str, Any], setup: Setup, exact: RollBounds, rates: RollRates, t_end: float
) -> RollBounds:
    """Add what a shear spring does that starts without a force.

    As long as it sticks, ``F = F0 (1 - cos(omega t))`` with the friction F0 of rolling, and the slip is ``PER_SLIP F0/(m omega)
    sin(omega t)``: vx is off by ``F0/(m omega)`` at most, x by ``2 F0/(m omega^2)``; F swings for ever and is not compared. Where the
    cap is below ``2 F0`` the disk slips on the way, until friction has braked that slip. A disk that slides reaches the cap within a
    quarter of a period, and until then ``mu g cos`` is lacking at most. In steps the spring's energy is that of the swing less ``(omega
    h)^2/4`` of it, and the cap is noticed a step later.
    """
    law, mass = setup.scene.walls[0].law, float(setup.scene.disks.mass[0])
    omega, h = shear_frequency(law.ks, mass, UNIFORM_DISK), setup.numerics.contact_dt or setup.numerics.dt
    angle = math.radians(params["angle_deg"])
    rolling, cap = MASS * params["g"] * math.sin(angle) / PER_SLIP, params["mu"] * rates.fn
    if rolls(params):
        speed, spare = rolling / (mass * omega), (cap - rolling) / mass
        slid = min(0.5 * PER_SLIP * speed**2 / spare, speed * t_end) if 2.0 * rolling > cap and spare > 0.0 else 0.0
        length, start, after = (
            2.0 * speed / omega + slid,
            "the shear spring swings about the friction of rolling",
            math.inf,
        )
    else:
        after = math.acos(1.0 - cap / rolling) / omega + h
        speed, start = cap / mass * after, "the shear spring reaches the cap late"
        length = speed * t_end
    per = _spread(setup, x=length, vx=speed, gap=0.0, fn=0.0, fs=0.0)
    why = f"start without a shear force: {start}, {speed:.3g} m/s"
    return exact._replace(
        atol={name: size + per[name] for name, size in exact.atol.items()},
        why={name: f"{text}; {why}" if per[name] else text for name, text in exact.why.items()},
        forces_from=after,
    )


def _rigid(
    params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo, rates: RollRates
) -> RollBounds:
    """Rigid contacts: exact velocities, positions summed from one end of each step, and what dilation adds.

    The associated rule at theta = 1 ends every sliding step with ``gap = mu slip dt``. The normal velocity is then ``mu`` times
    the growth of the slip in a step; its momentum comes from the plane, mu times it from friction. A convex model that
    detects contacts by overlap leaves the plane and lands again: `ninedisk.harness.cases.incline.block.chatter_bounds`, the
    slip in place of the block's velocity.
    """
    mu, dt, mass = params["mu"], setup.numerics.dt, float(setup.scene.disks.mass[0])
    g, t_end, kn = params["g"], float(observed.t[-1]), setup.scene.walls[0].law.kn
    slip = rates.slip * t_end
    associated = engine.contact == "cd" and follows_associated_rule(engine, setup.numerics)
    lift = mu * rates.slip * dt if associated else 0.0
    speed = g * slack_time(engine, dt) + single(engine, g * t_end, setup.numerics.n_steps)
    weight = mass * g
    force = contact_softness(engine) * weight + single(engine, weight, 1) + 1e-10 * weight + mass * lift / dt
    # A contact that gives way lets the disk sink, and friction then acts on a shorter arm.
    yields = rates.fn / kn if Difference.KEEPS_KN in engine.differences else 0.0
    arm = (speed * t_end + yields) / float(setup.scene.disks.radius[0])
    vx = mu * lift + 1e-12 + speed + arm * rates.along * t_end
    depth = swing = 0.0
    chatter = block_chatters(engine) and rates.slip > 0.0
    if chatter:
        fall = g * math.cos(math.radians(params["angle_deg"])) * dt
        hop = mu * (slip + PER_SLIP * mu * fall)
        depth = (fall + hop) * dt + hop**2 / (2.0 * fall / dt)
        vx += mu * (fall + 2.0 * hop)
        force += 2.0 * mass * (fall + hop) / (0.5 * t_end)
        swing = mass * (fall + 2.0 * hop) / dt
    atol = _spread(
        setup,
        x=rates.along * t_end * dt / 2.0 + vx * t_end + mu * depth,
        vx=vx,
        gap=mu * slip * dt * associated + 1e-12 + speed * t_end + yields + depth,
        fn=force,
        fs=force + 2.0 * arm * rates.fs + rolling_round_off(engine, rates, mass, dt, t_end),
    )
    rule = "; dilation of the associated rule" if associated or chatter else ""
    rule += "; overlap of the weight over kn" if yields else ""
    rule += soft_reason(engine) + single_precision(engine)
    why = dict.fromkeys(atol, "constant rates: exact velocities, round-off" + rule)
    why |= {"x": "first order in dt: a t dt/2" + rule, "gap": "rigid contact: round-off" + rule}
    return RollBounds(atol, why, 0.0, swing)


def rolling_round_off(engine: EngineInfo, rates: RollRates, mass: float, dt: float, t_end: float) -> float:
    """Force [N] of the last bits of velocity and spin in a step, single precision: rolling takes the slip between them away.

    The slip is the difference of two velocities of the size that the disk has reached, each rounded, and the impulse is what it
    takes to end it, ``m/(1 + 1/k)`` times the slip.
    """
    if rates.slip > 0.0:
        return 0.0
    return single(engine, rates.along * t_end, 1) * mass / (PER_SLIP * dt)


CASE = InclineDisk()
