"""Block on an incline, sliding or sticking (appendix A.3.4).

The truths are the continuous solution, with bounds derived for schemes and springs, and the exact steps of an engine's scheme.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.history import History
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall
from ninedisk.harness.api.case import Check, FloatArray, Headline, Observed, Parameter, Setup, Value
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.cases.common import (
    CONTACT_DT,
    CONTACT_DYNAMICS,
    EXACT_STEP_RTOL,
    GRAVITY,
    SHEAR_STIFFNESS,
    STEP,
    STIFFNESS,
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
from ninedisk.harness.cases.incline.figures import BLOCK_CLAIMS, BLOCK_FIGURES
from ninedisk.references.analytic.on_plane.incline import acceleration, critical_mu, incline
from ninedisk.references.exact_steps.incline import (
    associated_incline,
    coulomb_incline_theta,
    position_first_euler_incline,
    semi_implicit_euler_incline,
)
from ninedisk.references.exact_steps.sliding import SlidingSteps

RADIUS = 0.5
PAIR = (0, 1)
PHASE = 0.1
"""Default resolution of the contact: ``omega dt <= PHASE``; nothing but the start without preload depends on it."""

CONTACT_BETA = 1.0
"""The plane's dashpot is critical: without preload the block settles on the plane instead of bouncing for ever."""


NAMES = ("x", "vx", "gap", "fn", "fs")

SETTLING = 40.0
"""Time in units of 1/omega after which a critically damped contact is in equilibrium to round-off: 41 exp(-40) =
2e-16."""


class InclineBlock:
    """A disk that cannot turn, touching a plane under tilted gravity: x runs down the incline, y is its normal."""

    id = "incline-block"
    version = 1
    title = "Block on an incline"
    beside_headlines = (
        ("vx*", "a speed that is reported half a step late moves no place; the distance is what speeds add up to"),
        ("dilation", "the rate of the gap is reported half a step late as the speed is, and moves no place"),
        ("gap*", "the sign of an overlap that is reported moves nothing"),
    )
    source = "appendix A.3.4 of Lim's thesis, (A.7), figures A.17-A.26"
    requirement = "mu = 0.36 slides with a = g (sin - mu cos), mu = 0.4 stays; fn = m g cos; dilation shrinks with dt"
    figures = BLOCK_FIGURES
    claims = BLOCK_CLAIMS
    parameters: tuple[Parameter, ...] = (
        Parameter(name="mu", default=0.36, low=0.0, unit="-", in_id=True, help="friction coefficient"),
        STEP,
        Parameter.positive("angle_deg", 20.0, high=89.0, unit="deg", help="slope of the incline"),
        Parameter.positive("duration", 1.0, unit="s", help="length of the run"),
        Parameter(
            name="preload",
            default=True,
            help="spring engines start with the overlap and the shear force of equilibrium; "
            "rigid ones start touching anyway",
        ),
        GRAVITY,
        Parameter.positive("mass", 7.854, unit="kg", help="mass of the block"),
        STIFFNESS,
        SHEAR_STIFFNESS,
        CONTACT_DT,
        THETA,
        *CONTACT_DYNAMICS,
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """The source's two coefficients and three steps; springs without preload, stiff and soft."""
        rows: list[Mapping[str, Value]] = [{"mu": mu, "dt": dt} for mu in (0.36, 0.4) for dt in (0.01, 0.005, 0.0025)]
        rows += [{"mu": mu, "dt": 0.01, "preload": False} for mu in (0.36, 0.4)]
        rows += [{"mu": 0.36, "dt": dt, "sliding": "coulomb"} for dt in (0.01, 0.005, 0.0025)]
        rows += [{"mu": 0.4, "dt": 0.01, "sliding": "coulomb"}]
        return [*rows, {"mu": 0.4, "dt": 0.01, "preload": False, "kn": 1e6}]

    def build(self, params: Mapping[str, Any]) -> Setup:
        """One disk on a horizontal plane, gravity tilted."""
        angle = math.radians(params["angle_deg"])
        kn, mu, mass, g = params["kn"], params["mu"], params["mass"], params["g"]
        ks = kn if params["ks"] is None else params["ks"]
        law = ContactLaw(kn=kn, ks=ks, mu=mu, beta=CONTACT_BETA, restitution=0.0, regularised=True)
        normal, shear = mass * g * math.cos(angle), mass * g * math.sin(angle)
        overlap = normal / kn if params["preload"] else 0.0
        # The disk is body i and the plane's normal is +y, hence t = +x: friction up the incline is fs < 0.
        start = {PAIR: -min(mu * normal, shear)} if params["preload"] and mu > 0.0 else {}
        scene = Scene(
            disks=Disks(
                x=np.array([[0.0, RADIUS - overlap]]),
                radius=np.array([RADIUS]),
                mass=np.array([mass]),
                rotating=np.array([False]),
            ),
            disk_disk=law,
            walls=(Wall(name="incline", point=(0.0, 0.0), normal=(0.0, 1.0), law=law),),
            gravity=(g * math.sin(angle), -g * math.cos(angle)),
            initial_shear=start,
        )
        numerics = numerics_of(
            params,
            n_steps=whole_steps(params, params["duration"]),
            contact_dt=contact_step(params["dt"], PHASE / math.sqrt(max(kn, ks) / mass)),
            theta=params["theta"],
        )
        return Setup(scene=scene, numerics=numerics, watch=(PAIR,), labels={"contact": PAIR})

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """Displacement, velocity, gap and contact forces; ``fs`` is positive up the incline.

        ``lift`` is the largest gap of the run. ``fn_mean`` and ``fs_mean`` are means over its second half, and ``mu_crit`` the friction
        that would hold the block, from what the engine reports there: ``(fs + m dvx/dt)/fn``. ``dilation`` is the final rise of the gap
        over ``mu v dt``: 1 under the associated rule, 0 under Coulomb's. ``dilation_peak`` is the largest gap of that half over ``mu v
        dt``, v the velocity at the begin of the step. ``creep_rate`` is the mean velocity over that half, observed only where the
        block should stick.
        """
        x = history.x[:, 0, 0] - setup.scene.disks.x[0, 0]
        fn, fs = history.fn[:, 0], -history.fs[:, 0]
        series = {
            "x": ("m", x),
            "vx": ("m/s", history.v[:, 0, 0]),
            "gap": ("m", history.gap[:, 0]),
            "fn": ("N", fn),
            "fs": ("N", fs),
        }
        scalars = {f"{name}_final": (unit, last(values)) for name, (unit, values) in series.items()}
        half = second_half(history.t)
        elapsed = history.t[-1] - history.t[half]
        vx = series["vx"][1]
        inertial = params["mass"] * (vx[-1] - vx[half]) / elapsed
        scalars |= {
            "fn_mean": ("N", float(fn[half + 1 :].mean())),
            "fs_mean": ("N", float(fs[half + 1 :].mean())),
        }
        with np.errstate(divide="ignore", invalid="ignore"):  # an engine that loses the contact reports fn = 0
            held = np.float64(scalars["fs_mean"][1] + inertial) / scalars["fn_mean"][1]
        scalars["mu_crit"] = ("1", float(held))
        scalars["lift"] = ("m", float(np.maximum(series["gap"][1], 0.0).max()))
        if not block_sticks(params):
            lift = series["gap"][1][-1] - series["gap"][1][0]
            with np.errstate(divide="ignore", invalid="ignore"):
                scalars["dilation"] = (
                    "1",
                    float(lift / (params["mu"] * vx[-1] * params["dt"])) if params["mu"] else 0.0,
                )
                lifts = series["gap"][1][half + 1 :] / (params["mu"] * vx[half:-1] * params["dt"])
            scalars["dilation_peak"] = ("1", float(lifts.max()) if params["mu"] else 0.0)
        else:
            scalars["creep_rate"] = ("m/s", float((x[-1] - x[half]) / elapsed))
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """Coulomb's block on a rigid incline, at every step, with or without preload: way, lift, force on the incline, friction.

        Near the critical friction the block slides slowly; what counts is its own way, and where it sticks the way that it
        would make without friction.
        """
        angle, t_end = math.radians(params["angle_deg"]), float(observed.t[-1])
        truth = incline(observed.t, mu=params["mu"], angle=angle, g=params["g"], mass=params["mass"])
        path, scale_is = float(truth.x[-1]), "distance of the sliding block"
        free = 0.5 * params["g"] * math.sin(angle) * t_end**2
        scale, scale_is = (
            (free, "distance without friction") if block_sticks(params) else (path, "distance of the sliding block")
        )
        return (
            Headline(name="distance down the incline", use="rest" if block_sticks(params) else "sliding", quantity="x_final", expected=path,
                     source="(A.7)", scale=scale, scale_is=scale_is),
            Headline(name="lift of the block", use="sliding", quantity="lift", expected=0.0, source="Coulomb's law: no dilation",
                     scale=scale, scale_is=scale_is),
            Headline(name="force on the incline", use="rest" if block_sticks(params) else "sliding", quantity="fn",
                     expected=float(truth.fn[-1]), source="m g cos", scale=params["mass"] * params["g"], scale_is="weight",
                     window=(int(observed.step[second_half(observed.t)]), int(observed.step[-1]))),
            Headline(name="friction on the incline", use="rest" if block_sticks(params) else "sliding", quantity="fs_mean",
                     expected=float(truth.fs[-1]), source="mu m g cos, or m g sin at rest", scale=params["mass"] * params["g"],
                     scale_is="weight"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Exact steps of the engine's scheme where there are any, and the continuous solution for all."""
        exact = exact_step_checks(params, setup, observed, engine)

        def bounds(setup: Setup, engine: EngineInfo) -> Bounds:
            spring = engine.contact == "spring"
            return spring_bounds(params, setup, observed) if spring else first_order_bounds(params, setup, engine)

        def continuous(setup: Setup, engine: EngineInfo) -> list[Check]:
            return _analytic(params, observed, bounds(setup, engine))

        difference = LIFTS if follows_associated_rule(engine, setup.numerics) else Difference.FRICTION_LAGS
        return [
            *exact,
            *checks_with_allowance(difference, setup, engine, continuous),
            *_dilation(params, setup, observed, engine, bounds(setup, engine)),
        ]


def block_sticks(params: Mapping[str, Any]) -> bool:
    """Whether the block should stay where it is."""
    return bool(params["mu"] >= critical_mu(angle=math.radians(params["angle_deg"])))


def _dilation(
    params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo, bounds: Bounds
) -> list[Check]:
    """1 for the associated rule at theta = 1, where every sliding step ends with ``gap = mu v dt``; 0 for Coulomb's law.

    The final gap of a block that chatters is that of its last flight; its largest lift counts. A step from touch lifts it by
    ``mu v dt/(1 + mu^2)``, as (A.4) has it, and the velocity ``mu v`` carries it on by ``(mu v)^2/(2 g cos)`` at most.
    """
    mu = params["mu"]
    if block_sticks(params) or mu == 0.0:
        return []
    numerics = setup.numerics
    associated = follows_associated_rule(engine, numerics)
    if associated and numerics.theta != 1.0:
        return []
    angle = math.radians(params["angle_deg"])
    speed = float(incline(observed.t, mu=params["mu"], angle=angle, g=params["g"], mass=params["mass"]).vx[-1])
    length = mu * speed * numerics.dt
    if block_chatters(engine):
        flight = mu * speed / (2.0 * params["g"] * math.cos(angle) * numerics.dt)
        return [
            Check(quantity="dilation_peak", norm="scalar", truth="analytic", expected=1.0,
                  source="associated rule: a sliding step lifts by mu v dt", atol=mu**2 / (1.0 + mu**2) + flight,
                  why=f"a step from touch lifts by 1/(1 + mu^2) of that; flight after it: {flight:.3g}"),
        ]  # fmt: skip
    start = RADIUS - float(setup.scene.disks.x[0, 1])
    # Springs rest at the overlap of the weight, whatever they start with; an associated step is exact to the solver's residual.
    error = 1e-12 if associated else bounds.atol["gap"] + abs(bounds.rest_gap + start)
    atol = 2.0 * error / length + EXACT_STEP_RTOL
    if atol >= 0.5:
        return []  # such an engine's gap cannot distinguish the associated rule from Coulomb's
    return [
        Check(quantity="dilation", norm="scalar", truth="exact-step" if associated else "analytic", scale=1.0,
              expected=1.0 if associated else 0.0, source="(A.2): gap = mu v dt" if associated else "Coulomb's law: no dilation",
              atol=atol, why=bounds.why["gap"]),
    ]  # fmt: skip


def _analytic(params: Mapping[str, Any], observed: Observed, bounds: Bounds) -> list[Check]:
    angle = math.radians(params["angle_deg"])
    truth = incline(observed.t, mu=params["mu"], angle=angle, g=params["g"], mass=params["mass"])
    expected = {
        "x": truth.x,
        "vx": truth.vx,
        "gap": np.full_like(truth.x, bounds.rest_gap),
        "fn": np.where(bounds.forces_from, truth.fn, np.nan),
        "fs": np.where(bounds.forces_from, truth.fs, np.nan),
    }
    if bounds.settled_only:
        expected["gap"] = np.where(bounds.forces_from, expected["gap"], np.nan)
    tolerance = {name: (bounds.atol[name], 0.0, bounds.why[name]) for name in NAMES}
    source = "(A.7), equilibrium on the incline"
    sizes = _sizes(params, observed)
    found = series_and_final(NAMES, expected, truth="analytic", source=source, tolerance=tolerance, sizes=sizes)
    found += [
        Check(quantity=f"{name}_mean", norm="scalar", truth="analytic", expected=float(getattr(truth, name)[-1]),
              source=source, atol=atol, why=f"mean over half the run; {bounds.why[name]}")
        for name, atol in bounds.mean.items()
    ]  # fmt: skip
    elapsed = float(observed.t[-1] - observed.t[second_half(observed.t)])
    weight = params["mass"] * params["g"] * math.cos(angle)
    found.append(
        Check(quantity="mu_crit", norm="scalar", truth="analytic", expected=critical_mu(angle=angle),
              source="tan(angle)", atol=(bounds.force + 2.0 * params["mass"] * bounds.gain / elapsed) / weight,
              why=bounds.why["fs"]),
    )  # fmt: skip
    if block_sticks(params):
        found.append(
            Check(quantity="creep_rate", norm="scalar", truth="analytic", expected=0.0,
                  source="Coulomb: a stuck block rests", atol=bounds.creep / elapsed, why=bounds.why["creep"],
                  scale=params["g"] * math.sin(angle) * float(observed.t[-1])),
        )  # fmt: skip
    return found


def _sizes(params: Mapping[str, Any], observed: Observed) -> dict[str, float]:
    """Sizes of what is zero: a gap's is the radius; a block at rest may be off by a part of what it does without friction."""
    t_end = float(observed.t[-1])
    free = params["g"] * math.sin(math.radians(params["angle_deg"])) * t_end
    return {"gap": RADIUS} | ({"vx": free, "x": 0.5 * free * t_end} if block_sticks(params) else {})


class Bounds(NamedTuple):
    """Absolute tolerances by quantity with their reasons.

    ``rest_gap`` is the gap at rest [m]; ``forces_from`` marks the samples at which forces are compared, shape (s,), and
    ``settled_only`` says that the gap is compared at those only. Of the second half of the run, ``creep`` is the way
    [m] that a stuck block may make, ``force`` the error of fs and fn together [N] and ``gain`` that of vx [m/s]. ``mean`` has
    those of forces [N] as means over that half, where they are smaller.
    """

    atol: Mapping[str, float]
    why: Mapping[str, str]
    rest_gap: float
    forces_from: NDArray[np.bool_]
    settled_only: bool
    creep: float
    force: float
    gain: float
    mean: Mapping[str, float] = MappingProxyType({})


def spring_bounds(params: Mapping[str, Any], setup: Setup, observed: Observed) -> Bounds:
    """Engines with contact springs.

    With preload the scheme is exact for the block's constant acceleration; what remains is round-off. The overlap is
    the difference of the height and the radius, known to a few units in the last place of the radius, so that fn is
    uncertain by kn times that, and velocities by `round_off_speed`.
    """
    law, disks = setup.scene.walls[0].law, setup.scene.disks
    contact_dt = setup.numerics.contact_dt or setup.numerics.dt
    radius, mass = float(disks.radius[0]), params["mass"]
    angle = math.radians(params["angle_deg"])
    pull = params["g"] * math.sin(angle)
    normal = mass * params["g"] * math.cos(angle)
    t_end = float(observed.t[-1])
    steps = t_end / contact_dt
    length = 8.0 * float(np.spacing(radius))
    v_max = acceleration(mu=params["mu"], angle=angle, g=params["g"]) * t_end
    speed = (1.0 + params["mu"]) * round_off_speed(radius, contact_dt) + summed_round_off(v_max, steps)
    drift = speed * t_end + summed_round_off(v_max * t_end / 2.0, steps)
    force = law.kn * length + 1e-13 * normal
    atol = {"x": drift, "vx": speed, "gap": length, "fn": force, "fs": (params["mu"] + law.ks / law.kn) * force}
    exact = "constant acceleration, exact in the scheme; round-off of the overlap times kn"
    why = dict.fromkeys((*NAMES, "creep"), exact)
    after = np.asarray(observed.t > 0.0)
    settled_only = not params["preload"]
    exact_bounds = Bounds(
        atol, why, -normal / law.kn, after, settled_only, creep=drift, force=atol["fs"] + atol["fn"], gain=speed
    )
    return (
        exact_bounds if params["preload"] else _without_preload(params, exact_bounds, law.kn, law.ks, pull, observed.t)
    )


def _without_preload(
    params: Mapping[str, Any], exact: Bounds, kn: float, ks: float, pull: float, t: FloatArray
) -> Bounds:
    """Add what the start without preload does to the block.

    Two things delay friction. The shear spring has to be stretched: loaded at once by the driving force F it lets the
    block reach ``F/sqrt(m ks)``. The cap has to rise: a critically damped fn follows ``1 - exp(-tau)(1 - tau)``, tau =
    omega t, and the deficit lets the block gain ``(F/m omega) tau exp(-tau)``, at most 1/e of ``F/sqrt(m kn)``. Omega
    is the lower of the two contact frequencies. A sliding block keeps the velocity; one that should stick loses it at
    ``mu g cos - pull`` and then swings about its place without damping, its force between the cap and as far below the
    driving force.
    """
    mass, mu, angle = params["mass"], params["mu"], math.radians(params["angle_deg"])
    omega = math.sqrt(min(kn, ks) / mass)
    offset = (1.0 + math.exp(-1.0)) * pull / omega
    t_end = float(t[-1])
    settled = np.asarray(t >= SETTLING / omega)
    atol, why = dict(exact.atol), dict(exact.why)
    start = f"start without preload: velocity offset up to (1 + 1/e) F/sqrt(m k) = {offset:.3g} m/s"
    why |= {"x": start, "vx": start, "creep": start, "fs": start}
    atol["vx"] += offset
    spare = params["g"] * (mu * math.cos(angle) - math.sin(angle))
    if mu < critical_mu(angle=angle) or spare <= 0.0:
        atol["x"] += offset * t_end
        return exact._replace(atol=atol, why=why, forces_from=settled)
    stop = offset / spare
    swing = mass * spare
    atol["x"] += offset * min(stop, t_end) + 2.0 * mass * pull / ks
    atol["fs"] += swing
    why["fs"] = "start without preload: the stuck block swings on its shear spring, up to the cap"
    creep = exact.creep + 2.0 * swing / ks + offset * max(stop - t_end / 2.0, 0.0)
    # Momentum takes the swing out of the mean force. Of N samples at equal times a cosine leaves 1/(N sin(omega dt/2)) at most, of its
    # integral 2/(omega T).
    half, samples = t_end / 2.0, len(t) - 1 - second_half(t)
    stuck = math.sqrt(ks / mass)
    sampled = min(1.0, 1.0 / (samples * max(abs(math.sin(0.5 * stuck * float(t[1] - t[0]))), 1e-9))) + 2.0 / (
        stuck * half
    )
    return exact._replace(
        atol=atol,
        why=why,
        forces_from=settled,
        creep=creep,
        force=exact.force + swing * sampled,
        gain=exact.gain + (offset if stop > half else 0.0),
    )


def first_order_bounds(params: Mapping[str, Any], setup: Setup, engine: EngineInfo) -> Bounds:
    """Rigid contacts: positions off by ``a t dt/2``, and what the associated rule's lift adds.

    From the exact steps of the known schemes: position-first and semi-implicit Euler ``-+ a t dt/2``, theta scheme
    ``(2 theta - 1) a t dt/2``, associated rule ``a t dt (1/2 - mu^2)``, velocity ``-a mu^2 dt``, gap ``mu dt vx``,
    first force ``m mu a`` above its final value. See `chatter_bounds` for convex models that detect contacts by overlap.
    """
    numerics, mu, mass = setup.numerics, params["mu"], params["mass"]
    angle, dt = math.radians(params["angle_deg"]), setup.numerics.dt
    steps = setup.numerics.sampled_steps()
    t_end = float(steps[-1]) * dt
    a = acceleration(mu=mu, angle=angle, g=params["g"])
    weight, kn = mass * params["g"], setup.scene.walls[0].law.kn
    associated = engine.contact == "cd" and follows_associated_rule(engine, numerics)
    lift = 1.0 if associated else 0.0
    slack = slack_time(engine, dt)
    speed = params["g"] * slack + single(engine, params["g"] * t_end, numerics.n_steps)
    atol = {
        "x": a * t_end * dt * (0.5 + lift * mu**2) + 1e-12 * t_end + speed * t_end,
        "vx": a * mu**2 * dt * lift + 1e-12 + speed,
        "gap": mu * dt * a * t_end * lift + 1e-12 + speed * t_end,
        "fn": mass * mu * a * lift + 1e-10 * weight,
        "fs": mu * mass * mu * a * lift + 1e-10 * weight,
    }
    # An impulse of one step is the small difference of velocities that carry the round-off of one step.
    force = contact_softness(engine) * weight + single(engine, weight, 1)
    atol |= {"fn": atol["fn"] + force, "fs": atol["fs"] + force}
    rule = "; dilation of the associated rule" if associated else ""
    mean = dict(atol)
    if Difference.KEEPS_KN in engine.differences:
        atol["gap"] += weight / kn
        rule += "; overlap of the weight over kn"
        if not params["preload"]:
            landing = mass * weight / kn / dt**2
            mean = {"fn": atol["fn"] + 2.0 * landing * dt / t_end, "fs": atol["fs"] + 2.0 * mu * landing * dt / t_end}
            atol |= {"fn": atol["fn"] + landing, "fs": atol["fs"] + mu * landing}
            # Over the second half the momentum of sinking within one step is all that can be missing from the mean.
            rule += ", into which the block sinks within a step at the earliest"
    rule += soft_reason(engine) + single_precision(engine)
    why = {
        "x": "first order in dt: a t dt/2" + rule,
        "vx": "constant acceleration: exact velocities, round-off" + rule,
        "gap": "rigid contact: round-off" + rule,
        "fn": "equilibrium: round-off of the contact solver" + rule,
        "fs": "equilibrium: round-off of the contact solver" + rule,
        "creep": "a rigid contact that sticks does not move: round-off of the steps" + rule,
    }
    # Step-mean forces have no value before the first step.
    bounds = Bounds(
        atol,
        why,
        0.0,
        np.asarray(steps > 0),
        False,
        creep=(1e-12 + speed) * t_end,
        force=mean["fs"] + mean["fn"],
        gain=atol["vx"],
    )
    if Difference.FRICTION_LAGS in engine.differences and not params["preload"]:
        bounds = _first_step_smooth(params, bounds, dt, t_end)
    return chatter_bounds(params, setup, bounds, mean) if block_chatters(engine) and a > 0.0 else bounds


def _first_step_smooth(params: Mapping[str, Any], bounds: Bounds, dt: float, t_end: float) -> Bounds:
    """Add what a first step without friction does: an offset of the velocity, kept while sliding, braked where it should stick."""
    mu, angle, g = params["mu"], math.radians(params["angle_deg"]), params["g"]
    offset = min(mu * math.cos(angle), math.sin(angle)) * g * dt
    spare = g * (mu * math.cos(angle) - math.sin(angle))
    stop = offset / spare if spare > 0.0 else math.inf
    start = f"friction is bounded by the step before, which has none at the start: velocity offset {offset:.3g} m/s"
    why = {name: text if name in ("gap", "fn") else f"{text}; {start}" for name, text in bounds.why.items()}
    atol = dict(bounds.atol)
    atol["vx"] += offset
    atol["x"] += offset * (min(stop, t_end) + dt)
    late = max(stop - 0.5 * t_end, 0.0) if spare > 0.0 else 0.0
    # The first step has no friction; a block that should stick then slides until it has stopped, with mu fn instead of the driving force.
    atol["fs"] += params["mass"] * max(offset / dt, spare)
    return bounds._replace(
        atol=atol,
        why=why,
        creep=bounds.creep + offset * late,
        gain=bounds.gain + offset * (late > 0.0),
    )


def block_chatters(engine: EngineInfo) -> bool:
    """Whether a sliding block of this engine leaves the plane and lands again: a convex model that detects contacts by overlap."""
    return engine.dilates and engine.contact != "cd"


def chatter_bounds(params: Mapping[str, Any], setup: Setup, bounds: Bounds, mean: Mapping[str, float]) -> Bounds:
    """Add the flights of a sliding block that leaves the plane and lands again.

    A step in touch gives the block the normal velocity ``mu vx`` at most; one without contact lets it fall freely, by ``g cos
    dt``. As friction is mu times the normal force while the block slides, momentum gives ``vx = a t - mu vy`` at every step;
    a landing may stop the block, which takes from friction ``mu vy`` at most. With a bounded vy the error of vx does not grow,
    and means of the forces are off by the change of m vy alone. A single step's normal force is anything between none, in flight, and
    what turns the fastest fall, that of the fastest lift and a step more, into the fastest lift.
    """
    mu, dt = params["mu"], setup.numerics.dt
    angle = math.radians(params["angle_deg"])
    t_end = float(setup.numerics.n_steps) * dt
    fall = params["g"] * math.cos(angle) * dt
    lift = mu * (acceleration(mu=mu, angle=angle, g=params["g"]) * t_end + mu * fall)
    atol, why = dict(bounds.atol), dict(bounds.why)
    depth = (fall + lift) * dt + lift**2 / (2.0 * params["g"] * math.cos(angle))
    atol["vx"] += mu * (fall + 2.0 * lift)
    atol["x"] += mu * lift * t_end + mu * depth
    atol["gap"] += depth
    impulse = params["mass"] * (fall + lift)
    half = 0.5 * t_end
    mean = {name: mean[name] + impulse / half for name in ("fn", "fs")}
    turned = params["mass"] * (fall + 2.0 * lift) / dt
    atol |= {"fn": atol["fn"] + turned, "fs": atol["fs"] + mu * turned}
    chatter = f"a sliding contact opens and lands again: normal velocities from {-fall:.3g} to {lift:.3g} m/s"
    why = {name: f"{text}; {chatter}" for name, text in why.items()}
    return bounds._replace(atol=atol, why=why, force=2.0 * (bounds.force + impulse / half), gain=bounds.gain, mean=mean)


def exact_step_checks(params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo) -> list[Check]:
    """Every quantity against the exact steps of the engine's scheme; none where no closed form is known."""
    steps, scheme = _scheme_solution(params, setup, engine)
    if steps is None:
        return []
    expected = {name: getattr(steps, name)[observed.step] for name in NAMES}
    why = "exact solution of this very scheme: round-off of the steps"
    touch = "a length of a metre, rounded"
    speed = params["g"] * float(observed.t[-1])
    if engine.precision == "float32":
        why, touch = f"{why} in single precision", f"{touch} in single precision"
    count, weight = setup.numerics.n_steps, params["mass"] * params["g"]
    of_speed, of_force = single(engine, speed, count), single(engine, weight, 1)
    drift = of_speed * float(observed.t[-1])
    tolerance = {
        "x": (1e-15 * speed + drift, EXACT_STEP_RTOL, why),
        "vx": (1e-15 * speed + of_speed, EXACT_STEP_RTOL, why),
        "gap": (1e-12 + drift, EXACT_STEP_RTOL, touch),
        "fn": (of_force, EXACT_STEP_RTOL, why),
        "fs": (of_force, EXACT_STEP_RTOL, why),
    }
    sizes = _sizes(params, observed)
    return series_and_final(NAMES, expected, truth="exact-step", source=scheme, tolerance=tolerance, sizes=sizes)


def _scheme_solution(params: Mapping[str, Any], setup: Setup, engine: EngineInfo) -> tuple[SlidingSteps | None, str]:
    """Exact steps of the engine's scheme and their name; None where no closed form is known."""
    numerics = setup.numerics
    block = {
        "mu": params["mu"],
        "angle": math.radians(params["angle_deg"]),
        "g": params["g"],
        "mass": params["mass"],
        "dt": numerics.dt,
        "n_steps": numerics.n_steps,
    }
    if engine.contact == "spring":
        return None, ""
    if engine.scheme == "position-first-euler":
        return position_first_euler_incline(**block), "position-first Euler, x = (A.7)(1 - dt/t)"
    if engine.scheme == "semi-implicit-euler":
        return semi_implicit_euler_incline(**block), "semi-implicit Euler, x = (A.7)(1 + dt/t)"
    if engine.scheme == "moreau-jean":
        theta = engine.option("theta", numerics)
        return coulomb_incline_theta(**block, theta=theta), f"Moreau-Jean, theta = {theta:g}, Coulomb"
    if engine.scheme == "theta" and numerics.sliding == "coulomb":
        return coulomb_incline_theta(
            **block, theta=numerics.theta
        ), f"theta scheme, theta = {numerics.theta:g}, Coulomb"
    if engine.scheme == "theta" and numerics.theta == 1.0:
        return associated_incline(**block), "theta scheme, theta = 1, associated sliding rule"
    return None, ""


CASE = InclineBlock()
