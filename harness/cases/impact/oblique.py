"""Disk that hits a plane at an angle: normal restitution and Coulomb friction in one impact.

What binds an engine: rigid impulses, springs with Coulomb's cap, or the exact steps of its scheme.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall
from ninedisk.harness.api.case import (
    Check,
    FloatArray,
    Headline,
    Observed,
    Parameter,
    ParameterError,
    Setup,
    TruthKind,
    Value,
)
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.cases.common import (
    CONTACT_DT,
    CONTACT_DYNAMICS,
    EXACT_STEP_RTOL,
    around_contact,
    contact_softness,
    contact_step,
    last,
    numerics_of,
    phase_error,
    same_steps,
    series_and_final,
    single,
    soft_reason,
    whole_steps,
)
from ninedisk.harness.cases.differences import LIFTS, excused_checks, follows_associated_rule
from ninedisk.harness.cases.impact.binary import ROUND_OFF, beta_for
from ninedisk.harness.results.figures import Figure, Plotted
from ninedisk.references.analytic.impact.oblique_impact import Rebound, rigid_rebound, spring_rebound
from ninedisk.references.analytic.impact.spring_dashpot import contact_duration, restitution_of_beta
from ninedisk.references.analytic.on_plane.slip_to_roll import UNIFORM_DISK
from ninedisk.references.exact_steps.plane_contact import PlaneSteps, plane_contact_theta

RADIUS, MASS = 1.0, math.pi
"""Unit radius and density."""

PAIR = (0, 1)
PHASE = 0.01
"""Default resolution of the contact: ``omega dt <= PHASE``; the shear spring's stretch at touch is first order in it."""

DAMPED_PHASE = 0.05
"""Of a dashpot: ``beta omega dt <= DAMPED_PHASE``."""

AFTER = 4
"""Steps ``dt`` after the contact in a run of default length."""


AGREE = 0.01
"""Of the first speed: as near as springs must come to the rigid disk's speed along the plane for that to be a truth for all."""

ANGLES = (1.0, 1.8, 4.01, 11.43, 28.64)
"""Speeds along the plane, in those towards it, that represent 45, 61, 76, 85 and 88 degrees; at 1.8 a disk begins to slide through."""

NAMES = ("vx", "vy", "spin", "slip", "energy")


class ObliqueImpact:
    """A disk in free flight meets a plane; no gravity.

    Which regime a variant is in decides what it tests. Rigid engines stop the slip, or let the disk slide through the impact. With
    springs there is a third: the shear spring gives back what it has stored, and the disk leaves with its slip reversed. A stiff
    spring does not make that go away, since the outcome depends on ks/kn alone: in the regime that sticks, springs and rigid engines
    have different truths. Where a disk slides all the while, and e = 1, they have the same.
    """

    id = "impact/oblique"
    version = 1
    title = "Oblique impact on a plane"
    source = (
        "Coulomb's law for impulses (Walton 1993); linear springs: Di Maio & Di Renzo, Chem. Eng. Sci. 59 (2004) 3461"
    )
    requirement = (
        "a disk that slides through the impact loses mu (1 + e) vn along the plane, one that sticks a third of its slip; springs: "
        "their own exact rebound, phase by phase"
    )
    figures: tuple[Figure, ...] = (
        Figure(
            kind="places",
            title="Rebound from 17 to 88 degrees",
            quantities=(
                Plotted("tangential_restitution", "vx after over before [-]", at="incidence"),
                Plotted("rebound_spin", "R spin/(mu (1 + e) vn) [-]", at="incidence"),
            ),
            where={"restitution": (1.0,), "rotating": (True,), "spin": (0.0,)},
            compare="sliding",
            at_label="2 tan(angle)/(mu (1 + e))",
            log="x",
            shows="Tangential restitution and spin after the impact over the angle of incidence, "
            "scaled as Thornton does it, of every engine.",
            allows="From 6 on a disk slides through the impact, whatever its contact is like, and all engines lie on 1 - 2/x and on 2 (for "
            "spheres it is 7 and 5/2); below, rigid disks keep two thirds of their speed, and springs give back some of what they "
            "have stored, by ks/kn. "
            "What lies higher than the truth at grazing angles has taken too little along the plane, or gained.",
        ),
    )
    parameters: tuple[Parameter, ...] = (
        Parameter(
            name="vt", default=3.0, unit="m/s", in_id=True, help="velocity along the plane; slides through if vt > 3 mu (1 + e) vn"
        ),
        Parameter.positive("vn", 1.0, unit="m/s", help="velocity towards the plane"),
        Parameter(name="spin", default=0.0, unit="rad/s", help="initial spin, positive when rolling forward"),
        Parameter(name="mu", default=0.3, low=0.0, unit="-", help="friction coefficient"),
        Parameter(
            name="restitution", default=1.0, low=0.0, high=1.0, unit="-", in_id=True,
            help="of rigid engines; beta and theta follow from it",
        ),
        Parameter(
            name="gap", default=2e-3, low=0.0, unit="m", help="gap at time 0; theta's own impact law depends on gap/(vn dt)"
        ),
        Parameter.positive("dt", 1e-3, unit="s", help="step; sampling of spring engines"),
        Parameter(name="rotating", default=True, help="false: the disk cannot turn"),
        Parameter.positive("kn", 1e8, unit="N/m", help="stiffness of spring engines: a contact of 0.56 ms"),
        Parameter.positive("ks", None, unit="N/m", help="shear stiffness of spring engines; none: 2/3 kn"),
        CONTACT_DT,
        Parameter.positive("duration", None, unit="s", help="length of the run; none: the flight, the contact and some steps"),
        *CONTACT_DYNAMICS,
    )  # fmt: skip

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Sliding and sticking elastic, sticking dissipative, sliding plastic, no rotation; Newton's law with Coulomb's; to 88 degrees."""
        coulomb: dict[str, Value] = {"impact": "newton", "sliding": "coulomb"}
        return (
            {"vt": 3.0, "restitution": 1.0},
            {"vt": 0.3, "restitution": 1.0},
            {"vt": 0.5, "restitution": 0.5},
            {"vt": 3.0, "restitution": 0.0},
            {"vt": 0.3, "restitution": 1.0, "rotating": False},
            {"vt": 3.0, "restitution": 0.5, **coulomb},
            *({"vt": vt, "restitution": 1.0} for vt in ANGLES),
            {"vt": 11.43, "restitution": 0.5},
            *({"vt": vt, "restitution": 1.0, **coulomb} for vt in (1.0, *ANGLES[2:])),
        )

    def build(self, params: Mapping[str, Any]) -> Setup:
        """One disk above a horizontal plane."""
        kn, beta = params["kn"], beta_for(params["restitution"])
        ks = kn * 2.0 / 3.0 if params["ks"] is None else params["ks"]
        law = ContactLaw(kn=kn, ks=ks, mu=params["mu"], beta=beta, restitution=params["restitution"], regularised=True)
        omega = math.sqrt(kn / MASS)
        if params["vn"] / omega >= RADIUS:
            raise ParameterError(
                f"kn = {kn:g} N/m is not allowed: the disk would sink into the plane by its radius; "
                f"use kn > {MASS * (params['vn'] / RADIUS) ** 2:g}"
            )
        scene = Scene(
            disks=Disks(
                x=np.array([[0.0, RADIUS + params["gap"]]]),
                v=np.array([[params["vt"], -params["vn"]]]),
                omega=np.array([-params["spin"]]),
                radius=np.array([RADIUS]),
                mass=np.array([MASS]),
                rotating=np.array([params["rotating"]]),
            ),
            disk_disk=law,
            walls=(Wall(name="plane", point=(0.0, 0.0), normal=(0.0, 1.0), law=law),),
        )
        dt = params["dt"]
        swing = math.sqrt((1.0 + 1.0 / UNIFORM_DISK) * ks / kn) * omega
        target = min(PHASE / max(omega, swing), DAMPED_PHASE / (beta * omega) if beta > 0.0 else math.inf)
        flight = params["gap"] / params["vn"]
        end = flight + contact_duration(kn=kn, m_eff=MASS, beta=beta) + 2.0 * dt
        numerics = numerics_of(
            params,
            n_steps=whole_steps(params, end + AFTER * dt, at_least=end, event="the impact, spread over its steps,"),
            contact_dt=contact_step(dt, target),
            theta=1.0 / (1.0 + params["restitution"]),
        )
        return Setup(scene=scene, numerics=numerics, watch=(PAIR,), labels={"contact": PAIR})

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """Velocities, spin and slip (positive forward), kinetic energy; the ratio of the impulses along and normal to the plane."""
        disks = setup.scene.disks
        vx, vy, spin = history.v[:, 0, 0], history.v[:, 0, 1], 0.0 - history.omega[:, 0]
        series = {
            "x": ("m", history.x[:, 0, 0] - disks.x[0, 0]),
            "gap": ("m", history.gap[:, 0]),
            "vx": ("m/s", vx),
            "vy": ("m/s", vy),
            "spin": ("rad/s", spin),
            "slip": ("m/s", vx - RADIUS * spin),
            "energy": ("J", 0.5 * MASS * (vx**2 + vy**2) + 0.5 * float(disks.inertia[0]) * spin**2),
        }
        scalars = {f"{name}_final": (unit, last(values)) for name, (unit, values) in series.items()}
        scalars["restitution_effective"] = ("1", last(vy) / params["vn"])
        inertia = float(disks.inertia[0])
        about = MASS * RADIUS * (last(vx) - params["vt"]) + inertia * (last(spin) - params["spin"])
        scalars["about_contact_drift"] = ("kg m^2/s", about)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.divide(params["vt"] - last(vx), last(vy) + params["vn"])
        scalars["impulse_ratio"] = ("1", float(ratio))
        scalars |= {
            name: ("1", value)
            for name, value in _scaled(params, float(vx[0]), float(vy[0]), last(vx), last(spin)).items()
        }
        energy = series["energy"][1]
        scalars["energy_gain"] = ("1", float(np.maximum(energy.max() / energy[0] - 1.0, 0.0)))
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """Newton's restitution; speed along the plane and spin where the disk slides through the impact; and angular momentum.

        A disk that sticks for a while leaves with a speed that depends on the springs, ks/kn and the dashpot, however stiff they are:
        the law of rigid disks is the truth where the scene's springs agree with it to `AGREE`, and there is none elsewhere. Whatever the
        law, friction passes through the point of contact: the angular momentum about that point stays.
        """
        rigid, first = _on_impulses(params, dilates=False), math.hypot(params["vt"], params["vn"])
        agree = abs(rigid.vx - _on_springs(params, setup, setup.scene.walls[0].law.beta).vx) <= AGREE * first
        return (
            Headline(name="restitution", use="impacts", quantity="restitution_effective", expected=params["restitution"],
                     source="Newton's restitution", scale=1.0, scale_is="speed of approach"),
            Headline(name="speed along the plane", use="impacts", quantity="vx_final", expected=rigid.vx if agree else math.nan,
                     source="Coulomb's law for the impulses: mu (1 + e) vn is lost", scale=first, scale_is="initial speed"),
            Headline(name="spin after the impact", use="impacts", quantity="spin_final", expected=rigid.spin if agree else math.nan,
                     source="Coulomb's law for the impulses, with the arm R", scale=first / RADIUS,
                     scale_is="initial speed over the radius"),
            Headline(name="angular momentum about the contact", use="impacts", quantity="about_contact_drift",
                     expected=0.0 if params["rotating"] else math.nan, source="the impulse passes through the point of contact",
                     scale=MASS * RADIUS * first, scale_is="initial momentum times the radius"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Exact steps for contact dynamics, and the rebound for all whose restitution is normal alone: not theta's impact law.

        Whatever the law, energy does not grow.
        """
        found: list[Check] = []
        if engine.scheme == "theta":
            found += _stepped(params, setup, observed, engine)
            if setup.numerics.impact != "newton":
                return found
        rebound = _rebound(params, setup, observed, engine)
        if Difference.IMPACT_AS_SPRINGS in engine.differences:
            # Contacts of a convex problem: a sliding one is pushed open by mu times the part of its slip that it lets through.
            slip = abs(params["vt"] - RADIUS * params["spin"])
            wide = [_with_push(check, params, params["mu"] * contact_softness(engine) * slip) for check in rebound]
            rebound = excused_checks(rebound, wide, f"{engine.id}/{LIFTS}")
        return [*found, *rebound]


def _with_push(check: Check, params: Mapping[str, Any], speed: float) -> Check:
    """The check with room for a velocity away from the plane that is larger by ``speed`` [m/s]."""
    margin = {"vy": speed, "vy_final": speed, "restitution_effective": speed / params["vn"]}.get(check.quantity, 0.0)
    why = f"{check.why}; a convex contact model: mu times the slip that a soft contact lets through opens it, {speed:.3g} m/s"
    return replace(check, atol=check.atol + margin, why=why)


def _rebound(params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo) -> list[Check]:
    beta = setup.scene.walls[0].law.beta
    truth = binding_truth(params, setup, engine, beta)
    contact = contact_duration(kn=params["kn"], m_eff=MASS, beta=setup.scene.walls[0].law.beta)
    event = around_contact(observed.t, params["gap"] / params["vn"], contact, setup.numerics.dt)
    first, after = curves_of(approach_velocities(params), setup), curves_of(truth.rebound, setup)
    middle = params["gap"] / params["vn"]
    expected = {
        name: np.where(event, np.nan, np.where(observed.t < middle, first[name], after[name])) for name in NAMES
    }
    tolerance = {name: (truth.atol[name], 0.0, truth.why) for name in NAMES}
    sizes = _sizes(params)
    found = series_and_final(NAMES, expected, truth="analytic", source=truth.source, tolerance=tolerance, sizes=sizes)
    gained, lost = after["vy"] + params["vn"], params["vt"] - after["vx"]
    ratio = lost / gained
    atol = (truth.atol["vx"] + abs(ratio) * truth.atol["vy"]) / (gained - truth.atol["vy"])
    found += [
        Check(quantity="restitution_effective", norm="scalar", truth="analytic", expected=after["vy"] / params["vn"],
              source=truth.source, atol=truth.atol["vy"] / params["vn"], why=truth.why, scale=1.0),
        Check(quantity="impulse_ratio", norm="scalar", truth="analytic", expected=ratio,
              source=truth.source, atol=atol, why=truth.why),
    ]  # fmt: skip
    most = (after["energy"] + truth.atol["energy"]) / first["energy"] - 1.0
    gain = max(0.0, after["energy"] / first["energy"] - 1.0)
    rough = ROUND_OFF + single(engine, 1.0, 1)
    return [
        *found,
        *_scaled_checks(params, truth.rebound, truth.atol, "analytic", f"{_CONTACTS[engine.contact == 'spring']}: {truth.source}",
                        truth.why, rough),
        Check(quantity="energy_gain", norm="scalar", truth="analytic", expected=gain, source="friction takes energy",
              atol=max(most - gain, 0.0) + rough, scale=1.0,
              why="round-off, where friction takes more than the impact's speeds may be off by: " + truth.why),
    ]  # fmt: skip


_CONTACTS = ("rigid", "springs")


def _scaled(params: Mapping[str, Any], vx: float, vy: float, vx_after: float, spin_after: float) -> dict[str, float]:
    """Incidence ``2 tan(angle)/(mu (1 + e))`` and what is shown over it; of an impact whose disk does not spin before."""
    slide = params["mu"] * (1.0 + params["restitution"])
    with np.errstate(divide="ignore", invalid="ignore"):
        return {
            "incidence": float(np.float64(-2.0 * vx) / (slide * vy)),
            "tangential_restitution": float(np.float64(vx_after) / vx),
            "rebound_spin": float(np.float64(RADIUS * spin_after) / (slide * params["vn"])),
        }


def _scaled_checks(
    params: Mapping[str, Any],
    rebound: Rebound,
    atol: Mapping[str, float],
    truth: TruthKind,
    source: str,
    why: str,
    rough: float,
) -> list[Check]:
    """Of the quantities of `_scaled`; none where there is no friction, or no displacement along the plane."""
    if not params["mu"] or not params["vt"]:
        return []
    expected = _scaled(params, params["vt"], -params["vn"], rebound.vx, rebound.spin)
    off = _scaled(params, params["vt"], -params["vn"], atol["vx"], atol["spin"])
    at = Check(quantity="incidence", norm="scalar", truth=truth, expected=expected["incidence"], source="velocity at the start",
               rtol=rough, why="round-off")  # fmt: skip
    return [at] + [
        Check(
            quantity=name,
            norm="scalar",
            truth=truth,
            expected=expected[name],
            source=source,
            atol=abs(off[name]),
            scale=1.0,
            why=why,
        )
        for name in ("tangential_restitution", "rebound_spin")
    ]


def _stepped(params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo) -> list[Check]:
    curves = exact_curves(params, setup, observed)
    finals = {name: last(curve) for name, curve in curves.items()}
    if off := single(engine, RADIUS + params["gap"], setup.numerics.n_steps):
        # Where rounding decides in which step the impact falls the steps say nothing.
        near = [exact_curves({**params, "gap": params["gap"] + sign * off}, setup, observed) for sign in (-1.0, 1.0)]
        curves = {name: same_steps(curve, [each[name] for each in near]) for name, curve in curves.items()}
    numerics = setup.numerics
    source = (
        f"theta scheme, theta = {numerics.theta:g}, impact {numerics.impact}, sliding {numerics.sliding}: every step"
    )
    why = "exact solution of this very scheme: round-off of the steps and of the solver"
    largest = abs(params["vt"]) + params["vn"] + RADIUS * abs(params["spin"])
    floor = {"gap": 1e-12 * RADIUS, "spin": 1e-10 * largest / RADIUS}
    tolerance = {name: (floor.get(name, 1e-11 * largest), EXACT_STEP_RTOL, why) for name in curves}
    found = series_and_final(
        tuple(curves), curves, truth="exact-step", source=source, tolerance=tolerance, sizes=_sizes(params)
    )
    ends = Rebound(*(finals[name] for name in ("vx", "vy", "spin")))
    energy = exact_curves(params, setup, observed)["energy"]
    return [
        *found,
        *_scaled_checks(params, ends, {"vx": 1e-11 * largest, "spin": 1e-10 * largest / RADIUS}, "exact-step",
                        f"exact steps: {source}", why, EXACT_STEP_RTOL),
        Check(quantity="energy_gain", norm="scalar", truth="exact-step", expected=max(0.0, float(energy.max() / energy[0]) - 1.0),
              source=source, atol=EXACT_STEP_RTOL, scale=1.0, why=why),
    ]  # fmt: skip


def _sizes(params: Mapping[str, Any]) -> dict[str, float]:
    """Sizes of what an impact may leave at zero."""
    along = abs(params["vt"]) + RADIUS * abs(params["spin"])
    return {"spin": along / RADIUS, "slip": along, "vx": along, "vy": params["vn"]}


class Truth(NamedTuple):
    """Rebound that binds an engine, absolute tolerances of its velocities by name, and why."""

    rebound: Rebound
    atol: Mapping[str, float]
    source: str
    why: str


def inertia_ratio(params: Mapping[str, Any]) -> float:
    """``I/(m R^2)``; infinite for a disk that cannot turn."""
    return UNIFORM_DISK if params["rotating"] else math.inf


def curves_of(rebound: Rebound, setup: Setup) -> dict[str, float]:
    """Values of `NAMES` after the impact."""
    disks = setup.scene.disks
    radius, mass = float(disks.radius[0]), float(disks.mass[0])
    energy = 0.5 * mass * (rebound.vx**2 + rebound.vy**2) + 0.5 * float(disks.inertia[0]) * rebound.spin**2
    slip = rebound.vx - radius * rebound.spin
    return {"vx": rebound.vx, "vy": rebound.vy, "spin": rebound.spin, "slip": slip, "energy": energy}


def approach_velocities(params: Mapping[str, Any]) -> Rebound:
    """Velocities before the impact."""
    return Rebound(params["vt"], -params["vn"], params["spin"])


def binding_truth(params: Mapping[str, Any], setup: Setup, engine: EngineInfo, beta: float) -> Truth:
    """The rebound by the kind of the engine's contacts."""
    if engine.contact == "spring":
        return _spring(params, setup, beta)
    return _rigid(params, setup, engine)


def _on_impulses(params: Mapping[str, Any], *, dilates: bool) -> Rebound:
    return rigid_rebound(
        velocity=(params["vt"], -params["vn"]),
        spin=params["spin"],
        radius=RADIUS,
        inertia_ratio=inertia_ratio(params),
        mu=params["mu"],
        restitution=params["restitution"],
        dilates=dilates,
    )


def _on_springs(params: Mapping[str, Any], setup: Setup, beta: float) -> Rebound:
    law, disks = setup.scene.walls[0].law, setup.scene.disks
    return spring_rebound(
        velocity=(params["vt"], -params["vn"]),
        spin=params["spin"],
        radius=float(disks.radius[0]),
        inertia_ratio=inertia_ratio(params),
        mu=law.mu,
        mass=float(disks.mass[0]),
        kn=law.kn,
        ks=law.ks,
        beta=beta,
    )


def _rigid(params: Mapping[str, Any], setup: Setup, engine: EngineInfo) -> Truth:
    """Newton and Coulomb; the impulse of one step is exact but for round-off and what a soft contact lets through."""
    mu, radius = params["mu"], float(setup.scene.disks.radius[0])
    dilates = follows_associated_rule(engine, setup.numerics)
    found = _on_impulses(params, dilates=dilates)
    # A soft contact misses a part of each impulse; friction takes part of what the normal impulse misses.
    normal = found.vy + params["vn"]
    along = abs(found.vx - params["vt"])
    largest = max(abs(params["vt"]), params["vn"], abs(params["spin"]) * radius)
    floor = ROUND_OFF * largest + 2.0 * single(engine, largest, 1)
    vx, vy = floor + (along + mu * normal) * contact_softness(engine), floor + normal * contact_softness(engine)
    why = "impulses of one step at velocity level: round-off"
    why += (" of single precision" if engine.precision == "float32" else "") + soft_reason(engine)
    rule = "the associated sliding rule" if dilates else "Coulomb's law"
    return Truth(found, _tolerances(params, setup, vx, vy), f"Newton's restitution and {rule} for the impulses", why)


def _spring(params: Mapping[str, Any], setup: Setup, beta: float) -> Truth:
    """Springs, phase by phase.

    Normal restitution: as in `ninedisk.harness.cases.impact.binary.binding_impact`. Along the plane the contact of a scheme begins with
    a whole step's stretch of the shear spring whatever the part of the step in touch: ``ks u dt`` at most, which swings with Omega
    and so leaves ``Omega dt u``; a contact that slides from the start cuts it off. Where a contact begins to slide or to stick
    within a step, the force is off by what one step changes its slope by, for that step: second order. Where in the overlap
    friction acts is open: an arm R - overlap, or a slip so measured, changes both velocities by the overlap over R at most.
    """
    law, disks = setup.scene.walls[0].law, setup.scene.disks
    mass, radius = float(disks.mass[0]), float(disks.radius[0])
    found = _on_springs(params, setup, beta)
    e = restitution_of_beta(beta)
    contact_dt = setup.numerics.contact_dt or setup.numerics.dt
    phase = math.sqrt(law.kn / mass) * contact_dt
    normal = (e * phase_error(phase, beta) + ROUND_OFF) * params["vn"]
    ease = 1.0 + 1.0 / inertia_ratio(params)
    slip = abs(params["vt"] - radius * params["spin"])
    swing = math.sqrt(ease * law.ks / mass) * contact_dt
    overlap = params["vn"] * math.sqrt(mass / law.kn) / radius
    lost = abs(found.vx - params["vt"])
    slides = slip * law.ks > params["mu"] * params["vn"] * law.kn and beta == 0.0
    first = 0.0 if slides else swing
    along = params["mu"] * normal + (first + swing**2) * slip / ease + 2.0 * overlap * lost + ROUND_OFF * slip
    regime = f"{'slides' if slides else 'sticks'} at first, Omega dt = {swing:.3g}"
    why = f"phase of the impact in the contact step: omega dt = {phase:.3g}, beta = {beta:.4g}; {regime}; overlap/R = {overlap:.2g}"
    return Truth(
        found, _tolerances(params, setup, along, normal), "linear springs with Coulomb's cap, phase by phase", why
    )


def _tolerances(params: Mapping[str, Any], setup: Setup, vx: float, vy: float) -> dict[str, float]:
    """Of the quantities that follow from vx and vy: friction turns the disk by 1/(k R) for each unit of vx."""
    disks = setup.scene.disks
    mass, radius, turn = float(disks.mass[0]), float(disks.radius[0]), 1.0 / inertia_ratio(params)
    spin = turn * vx / radius
    fastest = {
        "vx": abs(params["vt"]) + radius * abs(params["spin"]),
        "vy": params["vn"],
        "spin": abs(params["spin"]) + turn * abs(params["vt"]) / radius,
    }
    inertia = float(disks.inertia[0]) if params["rotating"] else 0.0
    energy = mass * (vx * (fastest["vx"] + vx) + vy * (fastest["vy"] + vy)) + inertia * spin * (fastest["spin"] + spin)
    return {"vx": vx, "vy": vy, "spin": spin, "slip": (1.0 + turn) * vx, "energy": energy}


def exact_steps(params: Mapping[str, Any], setup: Setup) -> PlaneSteps:
    """Exact steps of the theta scheme on this variant."""
    disks, numerics = setup.scene.disks, setup.numerics
    return plane_contact_theta(
        radius=float(disks.radius[0]),
        inertia_ratio=inertia_ratio(params),
        gap=params["gap"],
        velocity=(params["vt"], -params["vn"]),
        spin=params["spin"],
        g=0.0,
        mu=params["mu"],
        dt=numerics.dt,
        theta=numerics.theta,
        restitution=params["restitution"] if numerics.impact == "newton" else None,
        dilates=numerics.sliding == "associated",
        n_steps=numerics.n_steps,
    )


def exact_curves(params: Mapping[str, Any], setup: Setup, observed: Observed) -> dict[str, FloatArray]:
    """Series of the exact steps at the samples, gap and way included."""
    steps, disks = exact_steps(params, setup), setup.scene.disks
    mass, inertia, radius = float(disks.mass[0]), float(disks.inertia[0]), float(disks.radius[0])
    energy = 0.5 * mass * (steps.vx**2 + steps.vy**2) + 0.5 * inertia * steps.spin**2
    curves = {**steps._asdict(), "slip": steps.vx - radius * steps.spin, "energy": energy}
    return {name: np.asarray(curve)[observed.step] for name, curve in curves.items()}


CASE = ObliqueImpact()
