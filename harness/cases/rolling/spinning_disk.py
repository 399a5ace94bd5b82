"""Disk put on a plane with a spin and no velocity: friction drives it until it rolls."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall
from ninedisk.harness.api.case import Check, FloatArray, Headline, Observed, Parameter, ParameterError, Setup, Value
from ninedisk.harness.api.engine import EngineInfo
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
    series_and_final,
    single,
    whole_steps,
)
from ninedisk.harness.cases.differences import LIFTS, checks_with_allowance
from ninedisk.harness.cases.rolling.figures import SPINNING_DISK_FIGURES
from ninedisk.harness.cases.rolling.slip_to_roll import (
    CONTACT_BETA,
    MASS,
    PAIR,
    PHASE,
    RADIUS,
    binding_history,
    bounds,
    end_of_slip,
    shear_frequency,
    slip_tolerance,
)
from ninedisk.references.analytic.on_plane.slip_to_roll import UNIFORM_DISK
from ninedisk.references.analytic.on_plane.spinning_disk import SpinHistory, energy_kept, slip_end, spinning_disk

TURN = 1.0 / (UNIFORM_DISK * RADIUS)
"""Change of spin that goes with a unit change of velocity [1/m]."""

RUN = 1.0
"""Default duration in units of R omega0/(mu g): the disk rolls from a third of it on."""


class SpinningDisk:
    """A spinning disk on a plane, under gravity: `ninedisk.harness.cases.rolling.slip_to_roll` seen from another frame.

    In a frame that moves with ``R omega0`` and turns with ``omega0`` the disk is the one that is thrown without spin, and the plane
    sees the same slip with the other sign. Truths, exact steps and tolerances are therefore those of that case, carried over; what
    is new for an engine is that friction has to speed a body up, that the spin comes first, and the energy that is lost on the way.
    """

    id = "spinning-disk"
    version = 1
    title = "Spinning disk"
    source = "classical rigid-body mechanics; mirror of appendix A.3.3 of Lim's thesis (rotations)"
    requirement = "gains mu g t until R omega0/(3 mu g), then rolls at R omega0/3; two thirds of the energy are lost"
    figures = SPINNING_DISK_FIGURES
    parameters: tuple[Parameter, ...] = (
        FRICTION,
        STEP,
        Parameter.positive("spin", 1.0, unit="rad/s", help="initial spin, forward"),
        GRAVITY,
        STIFFNESS,
        SHEAR_STIFFNESS,
        PRELOAD,
        CONTACT_DT,
        Parameter.positive(
            "duration", None, unit="s", help="length of the run; none: R omega0/(mu g), three times the slip"
        ),
        THETA,
        *CONTACT_DYNAMICS,
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Two steps, Coulomb's law, soft springs, and springs that start without a shear force."""
        return (
            {"mu": 0.3, "dt": 0.01},
            {"mu": 0.3, "dt": 0.005},
            {"mu": 0.3, "dt": 0.01, "sliding": "coulomb"},
            {"mu": 0.3, "dt": 0.01, "kn": 1e6},
            {"mu": 0.3, "dt": 0.01, "preload": False},
        )

    def build(self, params: Mapping[str, Any]) -> Setup:
        """One disk on a horizontal plane; springs start with the weight's overlap and, with preload, full sliding friction."""
        mu, g, kn = params["mu"], params["g"], params["kn"]
        ks = kn if params["ks"] is None else params["ks"]
        law = ContactLaw(kn=kn, ks=ks, mu=mu, beta=CONTACT_BETA, restitution=0.0, regularised=True)
        height = RADIUS - MASS * g / kn
        if height <= 0.0:
            raise ParameterError(
                f"kn = {kn:g} N/m is not allowed: the disk would sink into the plane "
                f"by its weight; use kn > {MASS * g / RADIUS:g}"
            )
        scene = Scene(
            disks=Disks(
                x=np.array([[0.0, height]]),
                omega=np.array([-params["spin"]]),
                radius=np.array([RADIUS]),
                mass=np.array([MASS]),
            ),
            disk_disk=law,
            walls=(Wall(name="plane", point=(0.0, 0.0), normal=(0.0, 1.0), law=law),),
            gravity=(0.0, -g),
            initial_shear={PAIR: mu * MASS * g} if params["preload"] else {},
        )
        fastest = max(math.sqrt(kn / MASS), shear_frequency(ks, MASS, UNIFORM_DISK))
        numerics = numerics_of(
            params,
            n_steps=whole_steps(params, RUN * RADIUS * params["spin"] / (mu * g)),
            contact_dt=contact_step(params["dt"], PHASE / fastest),
            theta=params["theta"],
        )
        return Setup(scene=scene, numerics=numerics, watch=(PAIR,), labels={"contact": PAIR})

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """Motion, spin (positive when rolling forward), slip (negative at first) and the kinetic energy of vx and spin.

        ``slip_end`` is the first sample of lasting rolling, within `slip_tolerance`; NaN where the slip never ends.
        """
        disks = setup.scene.disks
        vx, spin = history.v[:, 0, 0], 0.0 - history.omega[:, 0]
        slip = vx - RADIUS * spin
        series = {
            "x": ("m", history.x[:, 0, 0] - disks.x[0, 0]),
            "vx": ("m/s", vx),
            "spin": ("rad/s", spin),
            "slip": ("m/s", slip),
            "gap": ("m", history.gap[:, 0]),
            "energy": ("J", 0.5 * (disks.mass[0] * vx**2 + disks.inertia[0] * spin**2)),
        }
        scalars = {f"{name}_final": (unit, last(values)) for name, (unit, values) in series.items()}
        # Written so that a NaN counts as slip.
        slips = np.flatnonzero(~(np.abs(slip) <= slip_tolerance(_initial_motion(params), setup, UNIFORM_DISK)))
        first = int(slips[-1]) + 1 if len(slips) else 0
        scalars["slip_end"] = ("s", float(history.t[first]) if first < len(history.t) else math.nan)
        scalars["energy_kept"] = ("1", last(series["energy"][1]) / _first_energy(params, setup))
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:
        """The rigid disk's way, its speed in the end, and the energy that friction leaves it."""
        rim = RADIUS * params["spin"]
        history, _ = _truth(params, observed.t)
        energy = 0.5 * (history.vx[-1] ** 2 * MASS + history.spin[-1] ** 2 * float(setup.scene.disks.inertia[0]))
        source = "rigid disk with Coulomb friction"
        return (
            Headline(name="distance", use="rolling", quantity="x_final", expected=float(history.x[-1]), source=source,
                     scale=float(history.x[-1]), scale_is="distance of the rigid disk"),
            Headline(name="final speed", use="rolling", quantity="vx_final", expected=float(history.vx[-1]), source=source,
                     scale=rim, scale_is="initial speed of the rim"),
            Headline(name="energy kept", use="rolling", quantity="energy_kept", expected=float(energy) / _first_energy(params, setup),
                     source=source, scale=1.0, scale_is="initial energy"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """History, end of slip and energy kept; exact steps where the engine's scheme has them."""
        return [
            *_stepped(params, _initial_motion(params), setup, observed, engine),
            *checks_with_allowance(LIFTS, setup, engine, partial(self._continuous, params, observed)),
        ]

    def _continuous(
        self, params: Mapping[str, Any], observed: Observed, setup: Setup, engine: EngineInfo
    ) -> list[Check]:
        limit = bounds(_initial_motion(params), setup, observed, engine, UNIFORM_DISK)
        analytic, end = _truth(params, observed.t)
        # Velocity and spin are off by opposite parts of one momentum: dE = m v dv + I omega domega, at most at the start.
        first = _first_energy(params, setup)
        vx, spin = limit.atol["vx"], limit.atol["spin"]
        mass, inertia = float(setup.scene.disks.mass[0]), float(setup.scene.disks.inertia[0])
        gained = RADIUS * params["spin"] / 3.0
        of_energy = mass * vx * (gained + vx) + inertia * spin * (params["spin"] + spin) + 1e-13 * first
        names = ("x", "vx", "spin", "slip", "gap", "energy")
        atol = {**limit.atol, "energy": of_energy}
        why = {**limit.why, "energy": "m v dv + I omega domega: " + limit.why["vx"]}
        expected = {
            **analytic._asdict(),
            "slip": np.where(observed.t < end, analytic.vx - RADIUS * analytic.spin, 0.0),
            "gap": np.full_like(observed.t, limit.rest_gap),
            "energy": 0.5 * (mass * analytic.vx**2 + inertia * analytic.spin**2),
        }
        source = "rigid disk with Coulomb friction"
        tolerance = {name: (atol[name], 0.0, why[name]) for name in names}
        sizes = {"gap": RADIUS}
        found = series_and_final(names, expected, truth="analytic", source=source, tolerance=tolerance, sizes=sizes)
        found += [
            end_of_slip(_initial_motion(params), setup, observed, engine, limit, expected["slip"], UNIFORM_DISK),
            Check(quantity="energy_kept", norm="scalar", truth="analytic", expected=energy_kept(UNIFORM_DISK),
                  source=source, atol=atol["energy"] / first, why=why["energy"]),
        ]  # fmt: skip
        return found


def _stepped(
    params: Mapping[str, Any], thrown: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
) -> list[Check]:
    exact = binding_history(thrown, setup, observed, engine, RADIUS, UNIFORM_DISK)
    if exact is None:
        return []
    curves = _from_thrown(params, observed.t, exact.curves)
    source = f"{engine.scheme}: sum of the exact velocities"
    why = "velocities at the steps are the rigid disk's own, positions their sum: round-off"
    if "gap" in curves:
        source = f"{engine.scheme}, associated rule: (A.6) in every step"
        why = "exact solution of this very scheme: round-off of the steps and of the solver"
    t_end, rim = float(observed.t[-1]), RADIUS * params["spin"]
    # Velocities are round-off of the larger of what the rim has and of what gravity and the plane exchange in the run.
    rough = single(engine, max(rim, params["g"] * t_end), setup.numerics.n_steps)
    if rough:
        why += " in single precision"
    floor = {
        "x": 1e-12 * rim * t_end + rough * t_end,
        "vx": rough,
        "spin": rough * TURN,
        "gap": 1e-12 * RADIUS,
        "slip": 1e-11 * rim,
    }
    tolerance = {name: (floor[name], EXACT_STEP_RTOL, why) for name in curves}
    return series_and_final(tuple(curves), curves, truth="exact-step", source=source, tolerance=tolerance)


def _truth(params: Mapping[str, Any], t: FloatArray) -> tuple[SpinHistory, float]:
    """History of the rigid disk, and when its slip ends [s]."""
    case = {name: params[name] for name in ("mu", "spin", "g")} | {"radius": RADIUS}
    return spinning_disk(t, **case), slip_end(**case)


def _initial_motion(params: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters of the disk that is thrown at ``R omega0`` without spin."""
    return {**params, "speed": RADIUS * params["spin"], "start": "touching"}


def _from_thrown(params: Mapping[str, Any], t: FloatArray, thrown: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Curves of the spinning disk from those of the thrown one: the other frame, the other direction."""
    rim = RADIUS * params["spin"]
    curves = {"x": rim * t - thrown["x"], "vx": rim - thrown["vx"], "spin": params["spin"] - thrown["spin"]}
    if "slip" in thrown:
        curves["slip"] = 0.0 - thrown["slip"]
    if "gap" in thrown:
        curves["gap"] = thrown["gap"]
    return curves


def _first_energy(params: Mapping[str, Any], setup: Setup) -> float:
    return 0.5 * float(setup.scene.disks.inertia[0]) * float(params["spin"]) ** 2


CASE = SpinningDisk()
