"""What rounding in single precision does to the results of engines with springs and of contact dynamics, check by check.

A quantity that is kept in single precision is off by half a unit in the last place after each of the engine's own steps, all of one sign
at worst: positions whose displacement in a step is no whole number of units are cut off or rounded up in every step alike. With ``dx``,
``dv`` half a unit of the largest coordinate and speed, ``h`` the own step and ``T`` the length of the run:

- a rate of displacement ``b = dx/h`` [m/s] and an acceleration ``a = dv/h`` [m/s^2] that no force has made;
- free motion: speeds off by ``a T``, positions by ``b T + a T^2/2``;
- a contact of stiffness k that lasts swings about a place that moves at ``b``: its speed is off by b, its force by ``m w b + m a``, with
  ``w = sqrt(k/m)``, and by ``k dx`` since it sees rounded places. Contact dynamics finds forces anew in each step: ``w = 1/h``;
- a shear spring sums speeds, whose integral is not the rounded displacement: it is off by ``ks b T``, by twice Coulomb's limit at most;
- energies: ``m v`` times the error of the speed, weight and contact force times that of the place.

Engines with impulses or soft contacts have neither springs nor a theta scheme, and steps that are long: their cases state what rounding
does (`ninedisk.harness.cases.common.single`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ninedisk.harness.api.case import Check, Observed, Setup
from ninedisk.harness.api.engine import EngineInfo

IMPACT = 4.0
"""Changes of the rate b in a contact: places of two bodies where it begins and where it ends; of bodies of one mass."""

GAP = 2.0 * math.sqrt(2.0)
"""Roundings in a gap from the start: two coordinates of two bodies."""

CONTACTS = 12.0
"""Roundings in the force of a contact and of those that push on: places of two bodies, speeds, products; four in each of three contacts.
More bodies make longer chains, along which roundings add up as the root of their number."""

SOLVED = 3.0
"""Half units by which a velocity is off that a contact solver finds: a sum of impulses is off by a unit before it is rounded."""

SWING = 0.2
"""Frequency of a contact times the own step where no stiffness is given: what contact steps of Hertz' law are chosen by."""

BLIND = 0.5
"""A check says nothing where rounding alone moves its quantity by this part of its size."""

SINGLE = "float32"


@dataclass(frozen=True)
class Roundings:
    """Errors of a run in single precision by kind of quantity, each in its unit; ``share`` is relative.

    ``fastest`` [m/s] is the largest speed of a body: faster waves are off by the same share.
    """

    place: float
    speed: float
    angle: float
    spin: float
    force: float
    torque: float
    energy: float
    momentum: float
    angular_momentum: float
    share: float
    time: float
    acceleration: float
    fastest: float

    def of(self, unit: str, size: float) -> float:
        """Error of a quantity of this unit and size.

        Which of several nearly equal swings is the largest, a number of cycles, is decided by rounding.
        """
        waves = self.share * size if size > self.fastest else 0.0
        known = {
            "m": self.place, "m/s": max(self.speed, waves), "rad": self.angle, "deg": math.degrees(self.angle), "rad/s": self.spin,
            "N": self.force, "N m": self.torque, "J": self.energy, "kg m/s": self.momentum, "N s": self.momentum,
            "kg m^2/s": self.angular_momentum, "N m s": self.angular_momentum, "s": self.time, "m/s^2": self.acceleration,
            "cycle": math.inf,
        }  # fmt: skip
        return known.get(unit, self.share * size)


def in_single_precision(
    checks: Sequence[Check], setup: Setup, observed: Observed, engine: EngineInfo, drift: float = 0.0
) -> list[Check]:
    """The checks of an engine with what rounding in single precision may add; unchanged where nothing of it applies.

    Sizes are those of the scene and of the truths, never of the engine's results. A check whose quantity rounding alone moves by `BLIND`
    of its size says nothing.

    Parameters
    ----------
    checks : sequence of Check
    setup : Setup
        In the units of the truths.
    observed : Observed
        Of it the units alone.
    engine : EngineInfo
    drift : float
        Speed of the observer whose numbers the engine is given [m/s].
    """
    if engine.precision != SINGLE or engine.contact not in ("spring", "cd"):
        return list(checks)
    units = {name: unit for name, (unit, _) in (*observed.series.items(), *observed.scalars.items())}
    wrong = roundings(setup, checks, units, engine, drift)
    found = []
    for check in checks:
        if check.gap_reason:  # what is known to be off stays so
            found.append(check)
            continue
        size = max(_largest(check), check.scale)
        error = wrong.of(units[check.quantity], size)
        why = f"{check.why}; single precision: {error:.2g} by its roundings"
        if error > BLIND * size > 0.0:
            nothing = np.full_like(np.asarray(check.expected, dtype=np.float64), np.nan)
            found.append(replace(check, expected=nothing if nothing.ndim else math.nan, why=why))
        else:
            found.append(replace(check, atol=check.atol + error, why=why))
    return found


def roundings(
    setup: Setup, checks: Sequence[Check], units: Mapping[str, str], engine: EngineInfo, drift: float
) -> Roundings:
    """Errors by kind of quantity, from the scene and from the largest truths of each unit."""
    scene, numerics = setup.scene, setup.numerics
    bodies = scene.bodies
    # Contact dynamics takes contact steps where all its contacts are elastic.
    elastic = engine.contact == "spring" or not any(getattr(law, "regularised", False) for law in scene.laws_in_use)
    own = numerics.contact_dt if elastic and numerics.contact_dt else numerics.dt
    duration = numerics.dt * numerics.n_steps
    known = {unit: max(map(_largest, held), default=0.0) for unit, held in _by_unit(checks, units).items()}
    radius, mass, count = float(bodies.radius.min()), float(bodies.mass.max()), len(bodies)
    gravity = math.hypot(*scene.gravity)
    speed = max(_most(bodies.v), known.get("m/s", 0.0), *(_wall_speed(wall) for wall in scene.walls), 0.0)
    own_speed = max(_most(bodies.v), *(_wall_speed(wall) for wall in scene.walls), 0.0) or speed
    speed += drift
    length = _most(bodies.x) + drift * duration + min(known.get("m", 0.0), speed * duration + gravity * duration**2)
    spin = max(_most(bodies.omega), known.get("rad/s", 0.0), speed / radius)
    angle = max(known.get("rad", 0.0), min(spin * duration, 2.0 * math.pi))
    dx, dv, dw, da = (0.5 * _unit(size) for size in (length, speed, spin, angle))
    if engine.contact == "cd":
        dv, dw = SOLVED * dv, SOLVED * dw
    b, a = dx / own, dv / own
    stiff = [
        float(law.kn)
        for law in scene.laws_in_use
        if getattr(law, "kn", None) and not (engine.contact == "cd" and law.regularised)
    ]
    w = math.sqrt(max(stiff) / float(bodies.mass[bodies.mass > 0.0].min())) if stiff else SWING / own
    w = min(w, 1.0 / own) if engine.contact == "spring" else 1.0 / own
    steps = duration / own
    heavy, light = mass, float(bodies.mass[bodies.mass > 0.0].min())
    # In an impact a body's speed changes by m2/(m1 + m2) of that of approach, twice that of equal masses at most.
    of_speed = steps * dv + IMPACT * b * 2.0 * heavy / (heavy + light)
    place = (steps + GAP) * dx + 0.5 * duration * steps * dv
    contact = known.get("N", 0.0)
    force = CONTACTS * max(1.0, math.sqrt(count / 3.0)) * (
        mass * (w * b + a) + (max(stiff) * dx if stiff else 0.0)
    ) + steps * 0.5 * _unit(contact)
    force += _of_shear(scene.laws_in_use, steps * dx, contact)
    of_spin = steps * dw + of_speed / radius
    energy = count * mass * (speed * of_speed + gravity * place) + contact * (b / w + place)
    return Roundings(
        place=place,
        speed=of_speed,
        angle=steps * da + duration * of_spin,
        spin=of_spin,
        force=force,
        torque=force * radius,
        energy=energy,
        momentum=count * mass * of_speed,
        angular_momentum=count * mass * (length * of_speed + speed * place),
        share=(2.0 * of_speed / own_speed if own_speed else 0.0) + steps * 2.0**-24,
        time=(place / speed if speed else 0.0),
        acceleration=a + b / own,
        fastest=own_speed,
    )


def _of_shear(laws: Sequence[object], slip: float, contact: float) -> float:
    """Error [N] of shear springs whose slip is off by ``slip`` [m], under normal forces of up to ``contact`` [N]."""
    return max(
        (min(ks * slip, 2.0 * getattr(law, "mu", 0.0) * contact) for law in laws if (ks := getattr(law, "ks", None))),
        default=0.0,
    )


def _unit(size: float) -> float:
    return float(np.spacing(np.float32(size)))


def _most(values: object) -> float:
    return float(np.abs(np.asarray(values, dtype=np.float64)).max(initial=0.0))


def _largest(check: Check) -> float:
    known = np.asarray(check.expected, dtype=np.float64)
    return _most(known[np.isfinite(known)])


def _by_unit(checks: Sequence[Check], units: Mapping[str, str]) -> dict[str, list[Check]]:
    held: dict[str, list[Check]] = {}
    for check in checks:
        held.setdefault(units[check.quantity], []).append(check)
    return held


def _wall_speed(wall: object) -> float:
    segments = getattr(wall, "motion", ())
    return max(
        (_most(s.velocity) + _most(getattr(s, "amplitude", 0.0)) * abs(getattr(s, "frequency", 0.0)) for s in segments),
        default=0.0,
    )
