"""What impacts of one sphere on a plane or on another one share: the scene, what is seen of it, and what a step may err by."""

from __future__ import annotations

import math

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.law import SphereLaw
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import PlaneWall, Spheres, SphereScene
from ninedisk.harness.api.capabilities import LEVER_ARMS
from ninedisk.harness.api.case import Check, FloatArray, KnownDifference, Observed, SphereSetup, TruthKind
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.cases.common import single, single_precision, sweeps_of
from ninedisk.references.analytic.impact.spring_dashpot import restitution_of_beta
from ninedisk.references.hertz_mindlin import Contact, SpheresAfterImpact, impact, scheme_errors

PLANE = np.array([[0.0, 0.0, -1.0], [0.8, 0.6, 0.0]])
SPHERES = np.array([[0.6, 0.0, 0.8], [0.0, 1.0, 0.0]])
"""Normal from the first body to the second, and direction along the surface: along no axis alone, and exact unit vectors."""

ROUND_OFF = 1e-11
"""Of a thousand steps on places that are 10,000 overlaps from the origin."""

MARGIN = 2.0
"""Over what central differences of one convention err by: the others' contact radius and slip are half a step from theirs."""


def frame_of(contact: Contact) -> FloatArray:
    """n, t and n x t of the touch, shape (3, 3)."""
    n, t = PLANE if math.isinf(contact.radius_2) else SPHERES
    return np.array([n, t, np.cross(n, t)])


def setup_of(
    contact: Contact, law: SphereLaw, *, dt: float, gap: float, n_steps: int, contact_dt: float
) -> SphereSetup:
    """The bodies ``gap`` [m] before they touch."""
    n, t, b = frame_of(contact)
    first, second = contact.first, contact.second
    bodies = [(-n * (contact.radius + gap), contact.radius, contact.mass, first)]
    walls: tuple[PlaneWall, ...] = ()
    if math.isinf(contact.radius_2):
        walls = (PlaneWall(name="plane", point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), law=law),)
    else:
        bodies.append((n * contact.radius_2, contact.radius_2, contact.mass_2, second))
    x, radius, mass, motion = zip(*bodies, strict=True)
    scene = SphereScene(
        spheres=Spheres(
            x=np.array(x),
            v=np.array([one[0] * n + one[1] * t for one in motion]),
            omega=np.array([one[2] * b for one in motion]),
            radius=np.array(radius),
            mass=np.array(mass),
        ),
        sphere_sphere=law,
        walls=walls,
    )
    numerics = Numerics(dt=dt, n_steps=n_steps, contact_dt=contact_dt, impact="newton", sliding="coulomb")
    return SphereSetup(scene=scene, numerics=numerics, watch=((0, 1),), labels={"contact": (0, 1)})


def observed_of(contact: Contact, history: History) -> Observed:
    """Velocities and spins in the frame of the touch, the overlap, force and duration of the contact, and what leaves the plane of motion.

    ``duration`` is the time between the touches that the free motions before and after the contact are extended to.
    """
    n, t, b = frame_of(contact)
    x, v, omega = history.x, history.v, history.omega
    flat = math.isinf(contact.radius_2)
    gap = (
        x[:, 0, 2] - contact.radius
        if flat
        else np.linalg.norm(x[:, 1] - x[:, 0], axis=1) - contact.radius - contact.radius_2
    )
    approach = v[:, 0] @ n - (0.0 if flat else v[:, 1] @ n)
    slip = v[:, 0] @ t + contact.radius * (omega[:, 0] @ b)
    if not flat:
        slip = slip - v[:, 1] @ t + contact.radius_2 * (omega[:, 1] @ b)
    series = {
        "gap": ("m", gap),
        "force": ("N", history.fn[:, 0]),
        "approach": ("m/s", approach),
        "vt": ("m/s", v[:, 0] @ t),
        "spin": ("rad/s", omega[:, 0] @ b),
        "slip": ("m/s", slip),
    }
    others = [v[:, 0] @ b, contact.radius * (omega[:, 0] @ n), contact.radius * (omega[:, 0] @ t)]
    series["off_plane"] = ("m/s", np.abs(others).max(axis=0))
    speed = contact.speed
    out = float(approach[-1])
    scalars = {
        "vt_final": ("m/s", float(series["vt"][1][-1])),
        "spin_final": ("rad/s", float(series["spin"][1][-1])),
        "slip_final": ("m/s", float(slip[-1])),
        "restitution_effective": ("1", 0.0 - out / speed),
        "overlap_max": ("m", parabola_peak(-gap)),
        "force_max": ("N", parabola_peak(history.fn[:, 0])),
    }
    with np.errstate(divide="ignore", invalid="ignore"):
        left = history.t[-1] - float(np.float64(gap[-1]) / -out)
    scalars["duration"] = ("s", left - float(gap[0]) / speed)
    if not flat:
        scalars["vt_second"] = ("m/s", float(v[-1, 1] @ t))
        scalars["spin_second"] = ("rad/s", float(omega[-1, 1] @ b))
    return Observed(step=history.step, t=history.t, series=series, scalars=scalars)


def parabola_peak(values: FloatArray) -> float:
    """Top of the parabola through the largest value and its neighbours; NaN where there is none."""
    if not np.isfinite(values).all():
        return math.nan
    k = int(np.argmax(values))
    if k in (0, len(values) - 1):
        return float(values[k])
    a, b, c = (float(each) for each in values[k - 1 : k + 2])
    bend = 2.0 * b - a - c
    return b + (a - c) ** 2 / (8.0 * bend) if bend > 0.0 else b


def _known_difference(
    name: str, atol: float, contact: Contact, engine: EngineInfo, setup: SphereSetup
) -> KnownDifference | None:
    """What a known difference of springs explains of one quantity after the impact, beside ``atol``.

    A dashpot pulls from where the force is 0, at ``e_0 v`` (`restitution_of_beta`), to where the overlap is, at ``e v``: without the pull
    spheres part at ``e_0 v``, with friction beside it the speed along the surface changes by mu times as much, and the spin by 5/2 of
    that over R. Arms shorter by half the overlap change slip and torque by ``overlap/(2 R)`` each, of either body, all through the
    contact; a shear spring that swings meanwhile comes out as much earlier or later: twice that of all there is to change.
    """
    normal = name == "restitution_effective"
    turn = 2.5 / contact.radius if name.startswith("spin") else 1.0
    e = math.exp(-math.pi * contact.beta / math.sqrt(1.0 - contact.beta**2))
    pulled = restitution_of_beta(contact.beta) - e
    known = []
    if Difference.DASHPOT_NEVER_PULLS in engine.differences and contact.beta > 0.0:
        known.append(("dashpot-never-pulls", (1.0 if normal else contact.mu * contact.speed * turn) * pulled))
    if Difference.FRICTION_WHILE_PULLED in engine.differences and contact.beta > 0.0 and not normal:
        known.append(("friction-while-pulled", contact.mu * contact.speed * turn * pulled))
    law = setup.scene.law((0, 1))
    arm = engine.contact == "spring" and LEVER_ARMS[law.lever_arm] not in engine.capabilities
    if arm and contact.mu > 0.0 and not normal:
        slip = abs(contact.first[1] - contact.second[1]) + contact.radius * (
            abs(contact.first[2]) + abs(contact.second[2])
        )
        known.append(("one-lever-arm", 4.0 * contact.elastic.overlap / contact.radius * slip * turn))
    if not known:
        return None
    words, _ = max(known, key=lambda each: each[1])
    size = atol + 1.1 * sum(each for _, each in known)
    why = "e_0 of a dashpot that never pulls less e, and overlap/R of the arms"
    return KnownDifference(finding=f"{engine.id}/{words}", size=size, why=why)


def rebound_checks(contact: Contact, setup: SphereSetup, engine: EngineInfo) -> list[Check]:
    """Velocities and spins after an impact on springs, within what central differences of this step err by."""
    truth, off = impact(contact)
    dt = setup.numerics.contact_dt or setup.numerics.dt
    errors = np.array(scheme_errors(contact, dt, lagged=not engine.second_order_dashpots))
    phase = contact.speed * dt / contact.elastic.overlap
    doubt: FloatArray = np.array([*off]).max(axis=0)
    atol = MARGIN * errors + doubt
    why = (
        f"{MARGIN:g} times what central differences themselves err by, touching anywhere in a step: v dt/overlap = {phase:.3g}; "
        f"uncertainty of the truth{single_precision(engine)}"
    )
    source = "Hertz-Mindlin law integrated to 1e-12"
    return rebound_within(contact, truth, atol, engine, setup, truth_kind="converged", source=source, why=why,
                          uncertainty=doubt)  # fmt: skip


def rebound_within(
    contact: Contact, truth: SpheresAfterImpact, atol: FloatArray, engine: EngineInfo, setup: SphereSetup, *, truth_kind: TruthKind,
    source: str, why: str, uncertainty: FloatArray | None = None,
) -> list[Check]:  # fmt: skip
    """Checks of a rebound; ``atol`` is that of velocities along n and t, and of spins."""
    fastest = (
        contact.speed + abs(contact.first[1]) + contact.radius * max(abs(contact.first[2]), abs(contact.second[2]))
    )
    steps = setup.numerics.n_steps + sweeps_of(engine, setup.numerics)
    rough = ROUND_OFF * fastest + single(engine, fastest, steps)
    bound = np.asarray(atol) + rough * np.array([1.0, 1.0, 2.5 / contact.radius])
    unsure = np.zeros(3) if uncertainty is None else uncertainty
    speed, turn = contact.speed, fastest / contact.radius
    parting = truth.second[0] - truth.first[0]
    flat = math.isinf(contact.radius_2)
    rows = [
        ("restitution_effective", parting / speed, 2.0 * bound[0] / speed, 1.0, unsure[0] / speed),
        ("vt_final", truth.first[1], bound[1], fastest, unsure[1]),
        ("spin_final", truth.first[2], bound[2], turn, unsure[2]),
    ]
    if not flat:
        rows += [
            ("vt_second", truth.second[1], bound[1], fastest, unsure[1]),
            ("spin_second", truth.second[2], bound[2], turn, unsure[2]),
        ]
    found = [
        Check(quantity=name, norm="scalar", truth=truth_kind, expected=float(expected), source=source, atol=float(each),
              scale=float(scale), uncertainty=float(wide), why=why, known=_known_difference(name, float(each), contact, engine, setup))
        for name, expected, each, scale, wide in rows
    ]  # fmt: skip
    if not flat and engine.contact in ("impulse", "soft"):
        # The line of centres is off by sqrt(3) units of a place in single precision.
        place = 0.25 * math.sqrt(3.0) * single(engine, float(np.abs(setup.scene.spheres.x).max()), 8)
        rough += 2.0 * (1.0 + contact.mu) * contact.speed * place / (contact.radius + contact.radius_2)
    found.append(
        Check(quantity="off_plane", norm="max", truth="analytic", expected=np.zeros(setup.numerics.sampled_steps().shape),
              source="mirror symmetry: nothing pushes out of the plane of motion", atol=rough, scale=fastest,
              why=f"round-off{single_precision(engine)}")
    )  # fmt: skip
    return found
