"""Spheres of which none is like another: impacts, flights, a belt, a crowd, a pair that resists; each against its closed form.

The first sphere is never the one that is like the others: an engine that takes a value of the first body for all is off in each kind.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.law import Elastic, Rolling, SphereLaw, damping_ratio, moduli
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import PlaneSegment, PlaneWall, Spheres, SphereScene
from ninedisk.harness.api.case import (
    Check,
    FloatArray,
    Headline,
    KnownDifference,
    Observed,
    Parameter,
    SphereSetup,
    Value,
)
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.cases.common import (
    contact_softness,
    contact_step,
    phase_error,
    single,
    single_precision,
    slack_time,
    soft_reason,
)
from ninedisk.harness.cases.differences import FINDING_WORDS, LIFTS, checks_with_allowance, follows_associated_rule
from ninedisk.harness.cases.impact.sphere_impact import ROUND_OFF, parabola_peak, rebound_checks, rebound_within
from ninedisk.harness.cases.pyramid import slide_sphere
from ninedisk.harness.results.figures import Figure, Plotted
from ninedisk.references.analytic.impact.hertz import contact_moduli, hertz_shift
from ninedisk.references.hertz_mindlin import Contact, SpheresAfterImpact, rebound

ONE = np.array([2.0, -1.0, 2.0]) / 3.0
TWO = np.array([1.0, 2.0, 0.0]) / math.sqrt(5.0)
THREE = np.cross(ONE, TWO)
"""Three axes at right angles, along none of the scene's."""

G = 10.0
SOURCE = "Newton and Euler for spheres with Coulomb friction"

KINDS = ("impacts", "flight", "belt", "held", "crowd", "resisted")

# ---- impacts: two planes with a sphere each, two spheres that meet, one that flies by -------------------------------------------------

SOFT, STIFF, PLANE_STUFF = (1e8, 0.3), (4e8, 0.2), (1e9, 0.4)
"""Young's modulus [Pa] and Poisson's ratio: of the spheres, of the first plane, of the second."""

KN, PLANE_KN, KS_OVER_KN = 1e6, (4e6, 9e6), 0.8
AHEAD, SAMPLES, AFTER, SUBSTEPS = 3.3, 100, 8, 8
"""Samples before the touch, in the shortest elastic impact, and after the longest; contact steps in each."""

PEAK = 1e-7
"""Of the top of a parabola through samples a hundredth of the impact apart, see `ninedisk.harness.cases.impact.chung_ooi`."""

PHASE = 0.02
"""Of linear springs in a contact step, omega dt."""


@dataclass(frozen=True)
class Meeting:
    """Two bodies that meet: names, numbers in the scene, directions n and t of the touch, and the contact of the references."""

    name: str
    bodies: tuple[int, int]
    n: FloatArray
    t: FloatArray
    contact: Contact
    restitution: float


R_IMPACT, M_IMPACT = np.array([0.35, 0.5, 0.4, 0.7, 0.25]), np.array([1.2, 3.0, 1.0, 3.0, 0.5])
FLIES_V, FLIES_W = np.array([0.3, -0.5, 0.7]), np.array([40.0, -25.0, 30.0])
"""Velocity [m/s] and spin [rad/s] of the sphere that meets none."""


def _meetings(params: Mapping[str, Any]) -> tuple[Meeting, ...]:
    """Each with other numbers; of linear springs all slide through the impact, elastic ones."""
    hertz = params["law"] == "hertz"
    heavy = params["heavy"]
    # Restitution 1 and no friction leave Hertz' largest force, which goes with the reduced radius.
    # Springs stick where the slip is small; rigid impulses have a closed form where it is large.
    one, two = ((0.9, 0.3, 2.0), (-0.4, -0.1, -1.0)) if hertz else ((0.9, 1.0, 4.0), (-0.4, -1.2, 2.5))
    found = []
    for name, bodies, n, t, stuff, mu, e, first, second in (
        ("first_plane", (0, 5), -ONE, THREE, STIFF, 0.1, 0.6, (1.0, 1.5, 3.0), (0.0, 0.0, 0.0)),
        ("second_plane", (1, 6), -TWO, ONE, PLANE_STUFF, 0.3, 0.8 if heavy == 1.0 else 1.0, (0.8, -3.5, -2.0), (0.0, 0.0, 0.0)),
        ("pair", (2, 3), (ONE + 2.0 * TWO + 2.0 * THREE) / 3.0, (2.0 * ONE + TWO - 2.0 * THREE) / 3.0, SOFT,
         0.2 if heavy == 1.0 or not hertz else 0.0, 0.7 if heavy == 1.0 else 1.0, one, two),
    ):  # fmt: skip
        e_star, g_star = contact_moduli(SOFT, stuff)
        i, j = bodies
        flat = j > 4
        found.append(
            Meeting(name, bodies, n, t, Contact(
                radius=float(R_IMPACT[i]), mass=float(M_IMPACT[i]), radius_2=math.inf if flat else float(R_IMPACT[j]),
                mass_2=math.inf if flat else float(M_IMPACT[j]) * heavy, first=first, second=second, e_star=e_star, g_star=g_star,
                mu=mu, beta=-math.log(e) / math.hypot(math.pi, math.log(e)) if hertz else 0.0, unloading="force",
            ), e if hertz else 1.0)
        )  # fmt: skip
    return tuple(found)


def _impact_laws(params: Mapping[str, Any]) -> tuple[SphereLaw, SphereLaw, SphereLaw]:
    """Of the planes, and between spheres."""
    if params["law"] == "linear":
        first, second, pair = (
            SphereLaw(kn=kn, ks=KS_OVER_KN * kn, mu=each.contact.mu, restitution=1.0, regularised=True)
            for kn, each in zip((*PLANE_KN, KN), _meetings(params), strict=True)
        )
        return first, second, pair
    laws = []
    for each, stuff in zip(_meetings(params), (STIFF, PLANE_STUFF, SOFT), strict=True):
        e_star, g_star = moduli(Elastic(E=SOFT[0], nu=SOFT[1]), Elastic(E=stuff[0], nu=stuff[1]))
        laws.append(
            SphereLaw(
                e_star=e_star,
                g_star=g_star,
                mu=each.contact.mu,
                beta=damping_ratio(each.restitution),
                restitution=each.restitution,
            )
        )
    return laws[0], laws[1], laws[2]


def _impacts(params: Mapping[str, Any]) -> SphereSetup:
    meetings, (first, second, pair) = _meetings(params), _impact_laws(params)
    x, v, omega = np.zeros((5, 3)), np.zeros((5, 3)), np.zeros((5, 3))
    if params["law"] == "hertz":
        times = [each.contact.elastic.duration for each in meetings]
        dt = min(times) / SAMPLES
        contact_dt = dt / SUBSTEPS
        longest = max(time * (0.5 + 0.5 / each.restitution) for time, each in zip(times, meetings, strict=True))
    else:
        reduced = [each.contact.reduced[1] for each in meetings]
        rates = [math.sqrt(law.kn / mass) for law, mass in zip((first, second, pair), reduced, strict=True)]
        dt, longest = 1e-3, math.pi / min(rates)
        contact_dt = contact_step(dt, PHASE / max(rates))
    ahead = AHEAD * dt
    for each, place in zip(meetings, (10.0 * TWO, 10.0 * ONE, 10.0 * (ONE + TWO + THREE)), strict=True):
        i, j = each.bodies
        b, contact = np.cross(each.n, each.t), each.contact
        gap = ahead * contact.speed
        # Centres that slide past each other before the touch: the line of centres is n when they touch.
        x[i] = place - each.n * (contact.radius + gap) - (ahead * contact.first[1] * each.t if j < 5 else 0.0)
        v[i], omega[i] = contact.first[0] * each.n + contact.first[1] * each.t, contact.first[2] * b
        if j < 5:
            x[i] = place - each.n * contact.radius - ahead * v[i]
            v[j], omega[j] = contact.second[0] * each.n + contact.second[1] * each.t, contact.second[2] * b
            x[j] = place + each.n * contact.radius_2 - ahead * v[j]
    x[4], v[4], omega[4] = 10.0 * (ONE + TWO) - 10.0 * THREE, FLIES_V, FLIES_W
    # Planes that slide in the first sample and are at rest when they are met.
    walls = tuple(
        PlaneWall(name=name, point=(0.0, 0.0, 0.0), normal=_three_spheres(normal), law=law,
                  motion=(PlaneSegment(duration=dt, velocity=_three_spheres(before)),))
        for name, normal, law, before in (("first", ONE, first, 5.0 * THREE), ("second", TWO, second, -3.0 * ONE))
    )  # fmt: skip
    masses = M_IMPACT * np.array([1.0, 1.0, 1.0, params["heavy"], 1.0])
    scene = SphereScene(
        spheres=Spheres(x=x, v=v, omega=omega, radius=R_IMPACT, mass=masses), sphere_sphere=pair, walls=walls
    )
    numerics = Numerics(
        dt=dt,
        n_steps=math.ceil(AHEAD + longest / dt) + AFTER,
        contact_dt=contact_dt,
        impact="newton",
        sliding="coulomb",
    )
    return SphereSetup(scene=scene, numerics=numerics, watch=tuple(each.bodies for each in meetings),
                       labels={each.name: each.bodies for each in meetings})  # fmt: skip


def _rebound(params: Mapping[str, Any], each: Meeting) -> SpheresAfterImpact:
    """Of Hertz' law by integration; else both bodies slide: ``(1 + e) m v`` along n, mu times as much against the slip."""
    contact = each.contact
    if params["law"] == "hertz":
        return rebound(contact)
    _, mass = contact.reduced
    flat = math.isinf(contact.radius_2)
    slip = contact.first[1] + contact.radius * contact.first[2] - contact.second[1]
    slip += 0.0 if flat else contact.radius_2 * contact.second[2]
    normal = 2.0 * mass * contact.speed
    along = -math.copysign(contact.mu * normal, slip)

    def after(before: tuple[float, float, float], m: float, radius: float, sense: float) -> tuple[float, float, float]:
        if math.isinf(m):
            return before
        return before[0] - sense * normal / m, before[1] + sense * along / m, before[2] + 2.5 * along / (m * radius)

    return SpheresAfterImpact(
        after(contact.first, contact.mass, contact.radius, 1.0),
        after(contact.second, contact.mass_2, contact.radius_2, -1.0),
    )


def _impact_ends(params: Mapping[str, Any]) -> tuple[FloatArray, FloatArray]:
    v, omega = np.tile(FLIES_V, (5, 1)), np.tile(FLIES_W, (5, 1))
    for each in _meetings(params):
        truth, b = _rebound(params, each), np.cross(each.n, each.t)
        for body, (along_n, along_t, spin) in zip(each.bodies, truth, strict=True):
            if body < 5:
                v[body], omega[body] = along_n * each.n + along_t * each.t, spin * b
    return v, omega


def _impact_seen(params: Mapping[str, Any], history: History) -> tuple[dict[str, Any], dict[str, Any]]:
    """As `ninedisk.harness.cases.impact.sphere_impact.observed_of`, of each meeting."""
    series: dict[str, Any] = {}
    scalars: dict[str, Any] = {}
    v, w = history.v, history.omega
    for place, each in enumerate(_meetings(params)):
        (i, j), b = each.bodies, np.cross(each.n, each.t)
        approach = v[:, i] @ each.n - (v[:, j] @ each.n if j < 5 else 0.0)
        scalars |= {
            f"{each.name}_restitution_effective": ("1", -float(approach[-1]) / each.contact.speed),
            f"{each.name}_vt_final": ("m/s", float(v[-1, i] @ each.t)),
            f"{each.name}_spin_final": ("rad/s", float(w[-1, i] @ b)),
        }
        if params["law"] == "hertz" and each.restitution == 1.0:
            fn = history.fn[:, place]
            scalars[f"{each.name}_force_max"] = ("N", parabola_peak(fn))
        if j < 5:
            scalars[f"{each.name}_vt_second"] = ("m/s", float(v[-1, j] @ each.t))
            scalars[f"{each.name}_spin_second"] = ("rad/s", float(w[-1, j] @ b))
        others = [v[:, i] @ b, each.contact.radius * (w[:, i] @ each.n), each.contact.radius * (w[:, i] @ each.t)]
        series[f"{each.name}_off_plane"] = ("m/s", np.abs(others).max(axis=0))
    return series, scalars


def _impact_checks(params: Mapping[str, Any], setup: SphereSetup, engine: EngineInfo) -> list[Check]:
    found: list[Check] = []
    for each in _meetings(params):
        if params["law"] == "hertz":
            checks = [*rebound_checks(each.contact, setup, engine), *_force_checks(each, setup, engine)]
        elif engine.contact == "spring":
            checks = _linear_checks(params, each, setup, engine)
        else:
            checks = checks_with_allowance(
                LIFTS,
                setup,
                engine,
                lambda setup, engine, each=each: _linear_checks(params, each, setup, engine),  # type: ignore[misc]
            )
        found += [replace(check, quantity=f"{each.name}_{check.quantity}") for check in checks]
    return found


def _flung_share(contact: Contact) -> float:
    """Share of Hertz' largest force by which spheres that turn about each other, at u along the surface, push less.

    ``u^2/(R_1 + R_2)`` over the overlap takes ``2 u^2 overlap/((R_1 + R_2) v^2)`` of the energy, and the force goes with its power 3/5.
    """
    if math.isinf(contact.radius_2):
        return 0.0
    along = contact.first[1] - contact.second[1]
    return 1.2 * along**2 * contact.elastic.overlap / ((contact.radius + contact.radius_2) * contact.speed**2)


def _force_checks(each: Meeting, setup: SphereSetup, engine: EngineInfo) -> list[Check]:
    """Hertz' largest force, of elastic impacts; the normal of two spheres turns meanwhile."""
    if each.restitution < 1.0:
        return []
    contact, hertz = each.contact, each.contact.elastic
    phase = contact.speed * (setup.numerics.contact_dt or setup.numerics.dt) / hertz.overlap
    flung = _flung_share(contact)
    allowed = 2.0 * abs(hertz_shift(phase)[0]) + PEAK * (2.0 * hertz.duration / (SAMPLES * setup.numerics.dt)) ** 4
    allowed += 1.5 * flung + 1e-9
    return [
        Check(quantity="force_max", norm="scalar", truth="analytic", expected=hertz.force, source="Hertz (1881)",
              atol=allowed * hertz.force + single(engine, hertz.force, setup.numerics.n_steps),
              why=f"central differences, v dt/overlap = {phase:.3g}; turning about each other takes {flung:.2g}{single_precision(engine)}")
    ]  # fmt: skip


def _linear_checks(params: Mapping[str, Any], each: Meeting, setup: Any, engine: EngineInfo) -> list[Check]:
    """Impacts that slide; of springs the phase of the touch in a step, and arms that shrink by the overlap."""
    contact, truth = each.contact, _rebound(params, each)
    law = setup.scene.law(each.bodies)
    least = min(contact.radius, contact.radius_2)
    if engine.contact == "spring":
        phase = math.sqrt(law.kn / contact.reduced[1]) * (setup.numerics.contact_dt or setup.numerics.dt)
        normal = (phase_error(phase, 0.0) + ROUND_OFF) * contact.speed
        overlap = contact.speed * math.sqrt(contact.reduced[1] / law.kn)
        # The normal turns by the displacement along the surface in the impact.
        turned = math.pi * overlap / contact.speed * (abs(contact.first[1]) + abs(contact.second[1])) / least
        turned = 0.0 if math.isinf(contact.radius_2) else turned
        lost = 2.0 * (1.0 + contact.mu) * contact.speed
        along = contact.mu * normal + (2.0 * overlap / least + turned) * lost
        normal += turned * lost
        why = f"omega dt = {phase:.3g}; overlap/R = {overlap / least:.2g}; the normal turns by {turned:.2g}"
    else:
        soft, dt = contact_softness(engine), setup.numerics.dt
        turned = (
            0.0 if math.isinf(contact.radius_2) else 2.0 * dt * (abs(contact.first[1]) + abs(contact.second[1])) / least
        )
        lost = 2.0 * (1.0 + contact.mu) * contact.speed
        normal, along = lost * (soft + turned), lost * (soft + turned)
        if Difference.IMPACT_AS_SPRINGS in engine.differences:
            normal += contact.mu * soft * 5.0
        if follows_associated_rule(engine, setup.numerics):
            normal += 5.0 * contact.speed
            along += 5.0 * contact.speed
        if Difference.ARM_LESS_OVERLAP in engine.differences:
            along += lost * contact.speed * dt / least
        why = f"impulses of one step, whose normal is off by {turned:.2g}{soft_reason(engine)}"
    bound = np.array([normal, along, 2.5 * along / least])
    return rebound_within(contact, truth, bound, engine, setup, truth_kind="analytic", source="rigid impulses of surfaces that slide",
                          why=why)  # fmt: skip


# ---- flight ----------------------------------------------------------------------------------------------------------------------------

R_FLIGHT, M_FLIGHT = np.array([0.5, 0.2, 0.05]), np.array([5.0, 0.1, 0.002])
FAST = 3.0
"""Radii that the fastest sphere moves by in a step."""

FLIGHT_DT, FLIGHT_STEPS = 1e-3, 200
FLIGHT_G = -G * (ONE + TWO) / math.sqrt(2.0)


def _flight_start() -> tuple[FloatArray, FloatArray, FloatArray]:
    x = np.array([20.0 * ONE, -20.0 * TWO, 30.0 * THREE])
    v = np.array([2.0 * TWO, R_FLIGHT[1] / FLIGHT_DT * ONE, FAST * R_FLIGHT[2] / FLIGHT_DT * (0.6 * TWO + 0.8 * THREE)])
    omega = np.array([[1.0, -2.0, 0.5], [30.0, 20.0, -40.0], [-60.0, 25.0, 10.0]])
    return x, v, omega


def _flight(params: Mapping[str, Any]) -> SphereSetup:  # noqa: ARG001
    x, v, omega = _flight_start()
    law = SphereLaw(kn=KN, restitution=1.0, regularised=True)
    scene = SphereScene(
        spheres=Spheres(x=x, v=v, omega=omega, radius=R_FLIGHT, mass=M_FLIGHT),
        sphere_sphere=law,
        gravity=_three_spheres(FLIGHT_G),
    )
    numerics = Numerics(
        dt=FLIGHT_DT,
        n_steps=FLIGHT_STEPS,
        contact_dt=FLIGHT_DT,
        sample_every=FLIGHT_STEPS,
        allow_unstable=True,
        impact="newton",
        sliding="coulomb",
    )
    return SphereSetup(scene=scene, numerics=numerics, watch=(), labels={})


# ---- belt ------------------------------------------------------------------------------------------------------------------------------

R_BELT, M_BELT = np.array([0.3, 0.5, 0.8]), np.array([1.0, 6.0, 2.5])
BELT_KN, BELT_MU, LIFT = 1e6, 0.2, 0.5
LEG, LAST = 0.1, 0.08
"""Lengths of the segments [s]; in the last the plane rests and the spheres fly, for 2 LIFT/G = 0.1 s."""

BELT = (0.8 * TWO, 0.0 * TWO, -0.6 * THREE)
"""Velocity of the plane along itself in the three first segments [m/s]."""

BELT_DT, BELT_PHASE = 1e-3, 0.1


def _belt_start() -> tuple[FloatArray, FloatArray]:
    v = np.array([-1.5 * TWO + 0.5 * THREE, 1.2 * THREE + 2.5 * TWO, 2.0 * THREE]) + LIFT * ONE
    omega = np.array([1.0 * THREE + 0.7 * ONE, -2.0 * TWO - 1.5 * ONE, 1.5 * THREE + 0.5 * ONE])
    return v, omega


def _belt(params: Mapping[str, Any]) -> SphereSetup:  # noqa: ARG001
    v, omega = _belt_start()
    roof = SphereLaw(kn=3.0 * BELT_KN, ks=KS_OVER_KN * BELT_KN, mu=0.9, restitution=0.0, regularised=True)
    law = SphereLaw(kn=BELT_KN, ks=KS_OVER_KN * BELT_KN, mu=BELT_MU, restitution=0.0, regularised=True)
    motion = tuple(PlaneSegment(duration=LEG, velocity=_three_spheres(each + LIFT * ONE)) for each in BELT)
    place = 4.0 * np.array([TWO, -TWO, THREE]) + (R_BELT - M_BELT * G / BELT_KN)[:, None] * ONE
    walls = (
        PlaneWall(name="roof", point=_three_spheres(50.0 * ONE), normal=_three_spheres(-ONE + 0.1 * TWO), law=roof),
        PlaneWall(name="belt", point=(0.0, 0.0, 0.0), normal=_three_spheres(ONE), law=law, motion=motion),
    )
    scene = SphereScene(
        spheres=Spheres(x=place, v=v, omega=omega, radius=R_BELT, mass=M_BELT), sphere_sphere=roof, walls=walls,
        gravity=_three_spheres(-G * ONE),
    )  # fmt: skip
    swing = math.sqrt(3.5 * KS_OVER_KN * BELT_KN / M_BELT.min())
    numerics = Numerics(dt=BELT_DT, n_steps=round((3.0 * LEG + LAST) / BELT_DT), contact_dt=contact_step(BELT_DT, BELT_PHASE / swing),
                        sample_every=20, sliding="coulomb", impact="newton")  # fmt: skip
    return SphereSetup(scene=scene, numerics=numerics, watch=((0, 4), (1, 4), (2, 4)), labels={"contact": (0, 4)})


def _belt_ends() -> tuple[FloatArray, FloatArray, float]:
    """Velocities and spins after all segments, and the least slip that any sphere has [m/s]: friction is mu m g against it."""
    v, omega = _belt_start()
    least = math.inf
    for each in BELT:
        slip = v - LIFT * ONE - each - R_BELT[:, None] * np.cross(omega, ONE)
        size = np.linalg.norm(slip, axis=1)
        least = min(least, float((size - 3.5 * BELT_MU * G * LEG).min()))
        pull = -BELT_MU * G * LEG * slip / size[:, None]
        v = v + pull
        omega = omega - 2.5 * np.cross(ONE, pull) / R_BELT[:, None]
    return v - G * LAST * ONE, omega, least


def _belt_on_pyramid() -> tuple[float, float]:
    """Largest distance of a velocity [m/s] and a spin [rad/s] in the end where friction is a pyramid along the spheres' velocities."""
    v, omega = _belt_start()
    for each in BELT:
        for _ in range(round(LEG / BELT_DT)):
            moved = [
                slide_sphere(*now, each + LIFT * ONE, ONE, radius=float(radius), pull=BELT_MU * G, dt=BELT_DT)
                for now, radius in zip(zip(v, omega, strict=True), R_BELT, strict=True)
            ]
            v, omega = np.array([a for a, _ in moved]), np.array([b for _, b in moved])
    truth, spins, _ = _belt_ends()
    return float(np.abs(v - G * LAST * ONE - truth).max()), float(np.abs(omega - spins).max())


# ---- held ----------------------------------------------------------------------------------------------------------------------------

R_FIRST, M_FIRST = np.array([0.4, 0.6, 0.3]), np.array([2.0, 1.0, 3.0])
HELD_T = 0.2
"""Length of the run [s]; all that slide still do."""


def _held_start() -> tuple[FloatArray, FloatArray]:
    """A sphere that is free, one that keeps its spin, and one in flight that keeps its velocity along x."""
    return np.array([2.0 * TWO, 1.5 * THREE, [1.0, 0.0, 2.0]]), np.array(
        [0.5 * ONE, 4.0 * TWO + 1.0 * ONE, [0.0, 3.0, 1.0]]
    )


def _held_spheres(params: Mapping[str, Any]) -> SphereSetup:  # noqa: ARG001
    v, omega = _held_start()
    law = SphereLaw(kn=BELT_KN, ks=KS_OVER_KN * BELT_KN, mu=BELT_MU, restitution=0.0, regularised=True)
    x = np.array([4.0 * TWO, -4.0 * TWO, 4.0 * THREE + 5.0 * ONE])
    x[:2] += (R_FIRST - M_FIRST * G / BELT_KN)[:2, None] * ONE
    spheres = Spheres(
        x=x, v=v, omega=omega, radius=R_FIRST, mass=M_FIRST, rotating=np.array([True, False, True]),
        held=np.array([[False] * 3, [False] * 3, [True, False, False]]),
    )  # fmt: skip
    floor = PlaneWall(name="floor", point=(0.0, 0.0, 0.0), normal=_three_spheres(ONE), law=law)
    scene = SphereScene(spheres=spheres, sphere_sphere=law, walls=(floor,), gravity=_three_spheres(-G * ONE))
    swing = math.sqrt(3.5 * KS_OVER_KN * BELT_KN / M_FIRST.min())
    numerics = Numerics(dt=BELT_DT, n_steps=round(HELD_T / BELT_DT), contact_dt=contact_step(BELT_DT, BELT_PHASE / swing),
                        sample_every=20, sliding="coulomb", impact="newton")  # fmt: skip
    return SphereSetup(scene=scene, numerics=numerics, watch=((0, 3), (1, 3)), labels={"contact": (0, 3)})


def _held_ends() -> tuple[FloatArray, FloatArray, float]:
    """As of `_belt_ends`; a spin that is kept has its part in the slip and no change."""
    v, omega = _held_start()
    slip = v - R_FIRST[:, None] * np.cross(omega, ONE)
    size = np.linalg.norm(slip, axis=1)
    pull = -BELT_MU * G * HELD_T * slip / size[:, None]
    fall = -G * HELD_T * ONE * np.array([0.0, 1.0, 1.0])
    turn = -2.5 * np.cross(ONE, pull[0]) / R_FIRST[0]
    least = min(float(size[0]) - 3.5 * BELT_MU * G * HELD_T, float(size[1]) - BELT_MU * G * HELD_T)
    return v + np.array([pull[0], pull[1], fall]), omega + np.array([turn, np.zeros(3), np.zeros(3)]), least


# ---- crowd -----------------------------------------------------------------------------------------------------------------------------

R_CROWD, R_CENTRE, HEAVY, CROWD_V, CROWD_KN = 0.45, 0.5, 1e4, 1.0, 1e6
CROWD_DT, CROWD_PHASE = 1e-3, 0.02


def _crowd_lines() -> FloatArray:
    """Twelve directions from the centre: the corners of a cuboctahedron, opposite ones in turn."""
    axes = (ONE, TWO, THREE)
    half = [axes[i] + s * axes[j] for i, j in ((0, 1), (1, 2), (2, 0)) for s in (1.0, -1.0)]
    return np.array([sign * each for each in half for sign in (1.0, -1.0)]) / math.sqrt(2.0)


def _crowd_mass() -> FloatArray:
    """Opposite spheres are alike, so that the centre stays."""
    return np.repeat(1.0 + 0.2 * np.arange(6), 2)


def _crowd_scene(params: Mapping[str, Any]) -> SphereSetup:  # noqa: ARG001
    lines, mass = _crowd_lines(), _crowd_mass()
    gap = AHEAD * CROWD_DT * CROWD_V
    x = np.vstack([(R_CENTRE + R_CROWD + gap) * lines, np.zeros((1, 3))])
    v = np.vstack([-CROWD_V * lines, np.zeros((1, 3))])
    law = SphereLaw(kn=CROWD_KN, restitution=1.0, regularised=True)
    scene = SphereScene(
        spheres=Spheres(x=x, v=v, radius=np.append(np.full(12, R_CROWD), R_CENTRE), mass=np.append(mass, HEAVY)),
        sphere_sphere=law,
    )
    lasts = math.pi * math.sqrt(mass.max() / CROWD_KN)
    numerics = Numerics(dt=CROWD_DT, n_steps=math.ceil(AHEAD + lasts / CROWD_DT) + AFTER,
                        contact_dt=contact_step(CROWD_DT, CROWD_PHASE * math.sqrt(mass.min() / CROWD_KN)),
                        impact="newton", sliding="coulomb")  # fmt: skip
    return SphereSetup(scene=scene, numerics=numerics, watch=((0, 12), (7, 12), (11, 12)), labels={"contact": (0, 12)})


# ---- resisted --------------------------------------------------------------------------------------------------------------------------

R_HELD, M_HELD, SUNK, HELD_KN = np.array([0.3, 0.7]), np.array([2.0, 5.0]), 1e-3, 1e5
HELD_MU, HELD_DT, HELD_STEPS = 0.1, 1e-3, 200
SPINS = np.array([6.0 * ONE + 4.0 * TWO + 1.0 * THREE, -1.0 * ONE - 0.5 * TWO])


def _resistance() -> tuple[FloatArray, float, float]:
    """Normal, torque of a constant resistance [N m], and ``1/I_1 + 1/I_2`` [1/(kg m^2)]."""
    reduced = float(R_HELD.prod() / R_HELD.sum())
    return (
        (ONE + 2.0 * TWO + 2.0 * THREE) / 3.0,
        HELD_MU * reduced * HELD_KN * SUNK,
        float((2.5 / (M_HELD * R_HELD**2)).sum()),
    )


def _swing() -> float:
    """Angular frequency of the springs that resist [rad/s]: a third of a period in the run."""
    return 2.0 * math.pi / 3.0 / (HELD_DT * HELD_STEPS)


def _resisted_spheres(params: Mapping[str, Any]) -> SphereSetup:
    n, _, mobility = _resistance()
    spring = params["model"] == "elastic-plastic"
    resistance = Rolling(
        model=params["model"], mu=1e3 if spring else HELD_MU, kr=_swing() ** 2 / mobility if spring else 0.0
    )
    law = SphereLaw(kn=HELD_KN, rolling=resistance, twisting=resistance, slip_at="end")
    # A third sphere flies by: nothing acts on it.
    x = np.array([np.zeros(3), (R_HELD.sum() - SUNK) * n, 5.0 * THREE])
    spheres = Spheres(
        x=x, v=np.array([np.zeros(3), np.zeros(3), ONE]), omega=np.array([*SPINS, 2.0 * TWO]), radius=np.append(R_HELD, 0.5),
        mass=np.append(M_HELD, 1.0), held=np.array([[True] * 3, [True] * 3, [False] * 3]),
    )  # fmt: skip
    scene = SphereScene(spheres=spheres, sphere_sphere=law)
    numerics = Numerics(
        dt=HELD_DT,
        n_steps=HELD_STEPS,
        contact_dt=HELD_DT / 10.0,
        sample_every=20,
        allow_unstable=True,
        impact="newton",
        sliding="coulomb",
    )
    return SphereSetup(scene=scene, numerics=numerics, watch=((0, 1),), labels={"contact": (0, 1)})


def _resisted_ends(params: Mapping[str, Any]) -> FloatArray:
    """Spins in the end: ``I_1 w_1 + I_2 w_2`` stays; the rest of each part of ``w_1 - w_2`` falls or swings."""
    n, torque, mobility = _resistance()
    t, inertia = HELD_DT * HELD_STEPS, 0.4 * M_HELD * R_HELD**2
    relative = SPINS[0] - SPINS[1]
    about = (relative @ n) * n
    parts = (about, relative - about)
    if params["model"] == "constant":
        left = sum(part * max(1.0 - torque * mobility * t / float(np.linalg.norm(part)), 0.0) for part in parts)
    else:
        left = math.cos(_swing() * t) * relative
    mean = (inertia[:, None] * SPINS).sum(axis=0) / inertia.sum()
    return np.array([mean + inertia[1] / inertia.sum() * left, mean - inertia[0] / inertia.sum() * left])


def _turned_with_twist() -> float:
    """Spin across n [rad/s] that springs err by which turn with half of both spins about n."""
    n, _, _ = _resistance()
    t, inertia, relative = HELD_DT * HELD_STEPS, 0.4 * M_HELD * R_HELD**2, SPINS[0] - SPINS[1]
    mean = float((inertia[:, None] * SPINS).sum(axis=0) @ n) / float(inertia.sum())
    unlike = float(inertia[1] - inertia[0]) / float(inertia.sum())
    half = abs(mean) * t + 0.5 * abs(unlike * float(relative @ n)) / _swing()
    return float(np.linalg.norm(relative - (relative @ n) * n)) * half


def _three_spheres(vector: FloatArray) -> tuple[float, float, float]:
    x, y, z = vector.tolist()
    return x, y, z


class Unequal:
    """``impacts``: on two planes of other stuff, of two spheres, all with spin. ``flight``: up to 3 radii a step, turning many times.
    ``belt``: three spheres slide on a plane that lifts them, stops along itself, turns back, and then drops them. ``held``: one slides
    freely, one keeps its spin, one flies with a kept velocity along x. ``crowd``: twelve touch
    one at once. ``resisted``: a held pair that rolls and twists.
    """

    id = "spheres/unequal"
    version = 1
    title = "Spheres of which none is like another"
    beside_headlines = (("angle_*", "an angle that is reported moves nothing: spins are what spheres turn by"),)
    source = "Newton and Euler; Coulomb; Hertz and Mindlin"
    requirement = (
        "each body has its own mass, radius, inertia and weight, each contact its own law, each plane its own motion"
    )
    parameters: tuple[Parameter, ...] = (
        Parameter(name="kind", default="impacts", choices=KINDS, in_id=True, help="what the spheres do"),
        Parameter(name="law", default="hertz", choices=("hertz", "linear"), in_id=True, help="of impacts; linear: rigid engines, too"),
        Parameter(name="heavy", default=1.0, low=1.0, high=1e6, unit="-", in_id=True, help="of impacts: factor of the pair's second mass"),
        Parameter(name="model", default="constant", choices=("constant", "elastic-plastic"), in_id=True, help="of what resists spins"),
    )  # fmt: skip
    figures = (
        Figure(
            title="Distance from the truth",
            quantities=(Plotted("strayed", "largest velocity [m/s]"),),
            compare="kind",
            shows="Largest speed of any sphere over time.",
            allows="A guide for the eye: what counts is where the spheres end.",
        ),
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Each kind; impacts with both laws and on heavy partners; both models."""
        return [
            {"kind": "impacts"}, {"kind": "impacts", "law": "linear"}, {"kind": "impacts", "heavy": 100.0},
            {"kind": "impacts", "law": "linear", "heavy": 1e4}, {"kind": "flight"}, {"kind": "belt"}, {"kind": "held"}, {"kind": "crowd"},
            {"kind": "resisted"}, {"kind": "resisted", "model": "elastic-plastic"},
        ]  # fmt: skip

    def build(self, params: Mapping[str, Any]) -> SphereSetup:
        """The scene of a kind."""
        make = {
            "impacts": _impacts,
            "flight": _flight,
            "belt": _belt,
            "held": _held_spheres,
            "crowd": _crowd_scene,
            "resisted": _resisted_spheres,
        }
        return make[params["kind"]](params)

    def _ends(self, params: Mapping[str, Any], setup: SphereSetup) -> dict[str, FloatArray]:
        """Truth of the last sample, by quantity: x [m], v [m/s], angle [rad], omega [rad/s], each of shape (n, 3)."""
        kind, spheres = params["kind"], setup.scene.spheres
        t = setup.numerics.dt * setup.numerics.n_steps
        if kind == "impacts":
            v, omega = _impact_ends(params)
            return {"v": v, "omega": omega}
        if kind == "flight":
            return {"x": spheres.x + spheres.v * t + 0.5 * FLIGHT_G * t**2, "v": spheres.v + FLIGHT_G * t,
                    "angle": spheres.omega * t, "omega": spheres.omega}  # fmt: skip
        if kind == "belt":
            v, omega, _ = _belt_ends()
            return {"v": v, "omega": omega}
        if kind == "held":
            v, omega, _ = _held_ends()
            return {"v": v, "omega": omega}
        if kind == "crowd":
            v = np.vstack([CROWD_V * _crowd_lines(), np.zeros((1, 3))])
            return {"v": v, "omega": np.zeros((13, 3))}
        return {"v": spheres.v, "omega": np.array([*_resisted_ends(params), spheres.omega[2]])}

    def _scales(self, setup: SphereSetup) -> tuple[float, float]:
        """Speed [m/s] and spin [rad/s] that errors are relative to."""
        spheres = setup.scene.spheres
        v, omega = (float(np.linalg.norm(each, axis=1).max()) for each in (spheres.v, spheres.omega))
        return max(v, 1.0), max(omega, 1.0)

    def observe(self, params: Mapping[str, Any], setup: SphereSetup, history: History) -> Observed:
        """Components in the end, of the quantities that the kind has a truth of; ``off_v``, ``off_omega``: the largest errors."""
        ends, last = self._ends(params, setup), len(history.t) - 1
        series: dict[str, Any] = {"strayed": ("m/s", np.linalg.norm(history.v, axis=2).max(axis=1))}
        scalars: dict[str, tuple[str, float]] = {}
        if params["kind"] == "impacts":
            seen, reported = _impact_seen(params, history)
            series, scalars = series | seen, scalars | reported
        units = {"x": "m", "v": "m/s", "angle": "rad", "omega": "rad/s"}
        for name in ends:
            found = getattr(history, name)[last]
            for i in self._judged_spheres(params):
                scalars |= {f"{name}_{i}{axis}": (units[name], float(found[i, c])) for c, axis in enumerate("xyz")}
        for place, wall in enumerate(setup.scene.walls):
            if wall.motion:
                along = history.wall_point[last, place] - np.array(wall.point)
                scalars |= {f"plane_{axis}": ("m", float(along[c])) for c, axis in enumerate("xyz")}
        for name, size in zip(("v", "omega"), self._scales(setup), strict=True):
            off = np.linalg.norm(getattr(history, name)[last] - ends[name], axis=1).max()
            scalars[f"off_{name}"] = ("1", float(off) / size)
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def _judged_spheres(self, params: Mapping[str, Any]) -> Sequence[int]:
        """Spheres whose components are judged: of impacts the one that meets none, of a crowd one of each pair and the centre."""
        return {
            "impacts": (4,),
            "flight": (0, 1, 2),
            "belt": (0, 1, 2),
            "held": (0, 1, 2),
            "crowd": (*range(0, 12, 2), 11, 12),
        }.get(params["kind"], (0, 1))

    def headlines(self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """The largest errors of velocities and of spins."""
        return (
            Headline(name="velocities of unequal spheres", use="impacts", quantity="off_v", expected=0.0, source=SOURCE, scale=1.0,
                     scale_is="largest speed at the start"),
            Headline(name="spins of unequal spheres", use="impacts", quantity="off_omega", expected=0.0, source=SOURCE, scale=1.0,
                     scale_is="largest spin at the start, 1 rad/s at least"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed, engine: EngineInfo  # noqa: ARG002
    ) -> Sequence[Check]:  # fmt: skip
        """What each sphere has in the end; of impacts what each contact's law says."""
        kind, steps = params["kind"], setup.numerics.n_steps
        found = _impact_checks(params, setup, engine) if kind == "impacts" else []
        ends = self._ends(params, setup)

        def components(setup: Any, engine: EngineInfo) -> list[Check]:
            bound, why = self._tolerances(params, setup, engine)
            speed, spin = self._scales(setup)
            far = speed * setup.numerics.dt * steps
            scale = {"x": far, "v": speed, "angle": spin * setup.numerics.dt * steps, "omega": spin}
            return [
                Check(quantity=f"{name}_{i}{axis}", norm="scalar", truth="analytic", expected=float(ends[name][i, c]), source=SOURCE,
                      atol=bound[name], scale=scale[name], why=why)
                for name in ends
                for i in self._judged_spheres(params)
                for c, axis in enumerate("xyz")
            ]  # fmt: skip

        def turning(checks: list[Check]) -> list[Check]:
            """Springs against rolling that turn with half of the twist give their torque at that angle to the rolling."""
            if params["model"] == "constant" or Difference.SPRINGS_TURN_WITH_TWIST not in engine.differences:
                return checks
            size = _turned_with_twist()
            finding = f"{engine.id}/{FINDING_WORDS[Difference.SPRINGS_TURN_WITH_TWIST]}"
            why = "the rolling's part of the relative spin times half of the twist's angle"
            return [
                replace(check, known=KnownDifference(finding=finding, size=check.atol + size, why=why))
                if check.quantity.startswith("omega") else check
                for check in checks
            ]  # fmt: skip

        if kind in ("belt", "held"):
            pyramid = Difference.FRICTION_PYRAMID
            found += checks_with_allowance(
                pyramid if pyramid in engine.differences else LIFTS, setup, engine, components
            )
        else:
            found += turning(components(setup, engine)) if kind == "resisted" else components(setup, engine)
        if kind == "belt":
            path = sum((LEG * (each + LIFT * ONE) for each in BELT), np.zeros(3))
            found += [
                Check(quantity=f"plane_{axis}", norm="scalar", truth="analytic", expected=float(path[c]), source="prescribed motion",
                      atol=1e-12 + single(engine, 50.0, 1.0), why=f"round-off{single_precision(engine)}")
                for c, axis in enumerate("xyz")
            ]  # fmt: skip
        return found

    def _tolerances(
        self, params: Mapping[str, Any], setup: SphereSetup, engine: EngineInfo
    ) -> tuple[dict[str, float], str]:
        """Tolerances by quantity, and why."""
        kind, numerics = params["kind"], setup.numerics
        steps, dt = numerics.n_steps, numerics.dt
        speed, spin = self._scales(setup)
        own = (numerics.contact_dt or dt) if engine.contact == "spring" else dt
        v = 1e-11 * speed + single(engine, speed, steps)
        omega = 1e-11 * spin + single(engine, spin, steps)
        why = f"round-off{single_precision(engine)}"
        if kind == "flight":
            t = dt * steps
            lag = 0.5 * G * t * own * (1.0 + 1e-9)
            x = lag + 1e-11 * speed * t + single(engine, 30.0 + speed * t, steps)
            return {"x": x, "v": v, "angle": omega * t + single(engine, spin * t, steps), "omega": omega}, (
                f"g t dt/2: half a step's lag of first-order schemes; {why}"
            )
        if kind in ("belt", "held"):
            pull, least = BELT_MU * G, (_belt_ends if kind == "belt" else _held_ends)()[2]
            v += contact_softness(engine) * (speed + 3.0 * pull * dt + pull * dt * steps) + pull * slack_time(
                engine, dt
            )
            v += 2.0 * G * slack_time(engine, dt)
            if engine.contact == "spring":
                # A shear spring needs twice its cap's displacement to turn round, at the least slip, in each of three segments.
                back = 2.0 * pull * M_BELT.max() / (KS_OVER_KN * BELT_KN)
                sunk = M_BELT.max() * G / BELT_KN
                v += 3.0 * pull * back / least + 2.0 * G * (sunk / LIFT + own) + sunk / R_BELT.min() * speed
                why = "shear springs that reverse; springs that release over their overlap"
            else:
                # The plane has another velocity one step earlier or later; spheres leave it in that step.
                v += 3.0 * pull * dt + G * dt
                why = f"a step of each segment{soft_reason(engine)}{single_precision(engine)}"
            if follows_associated_rule(engine, numerics):
                v += speed
            omega += 2.5 * v / R_BELT.min()
            if kind == "belt" and Difference.FRICTION_PYRAMID in engine.differences:
                off, turned = _belt_on_pyramid()
                v, omega, why = v + off, omega + turned, f"{why}; friction of a pyramid along the velocities"
            return {"v": v, "omega": omega}, why
        if kind == "crowd":
            if engine.contact == "spring":
                phase = math.sqrt(CROWD_KN / _crowd_mass().min()) * own
                v += (phase_error(phase, 0.0) + 2.0 * _crowd_mass().max() / HEAVY * phase) * CROWD_V
                why = f"phase of the touch in a step, omega dt = {phase:.3g}"
            else:
                v += 2.0 * contact_softness(engine) * CROWD_V + 24.0 * _crowd_mass().max() / HEAVY * CROWD_V
                why = f"impulses one after the other, which the centre takes as 1/{HEAVY:g}{soft_reason(engine)}"
            return {"v": v, "omega": omega + v / R_CROWD}, why
        if kind == "resisted":
            _, torque, mobility = _resistance()
            if params["model"] == "constant":
                omega += 2.0 * torque * mobility * own
                why = "a torque that acts a step more or less"
            else:
                rate = _swing()
                omega += (
                    float(np.linalg.norm(SPINS[0] - SPINS[1])) * rate * own * max(1.0, rate * dt * steps) * rate * own
                )
                why = f"second order of a swing, rate dt = {rate * own:.2g}"
            return {"v": v, "omega": omega}, why
        return {"v": v, "omega": omega}, why


CASE = Unequal()
