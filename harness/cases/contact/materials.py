"""Bodies of three materials in one scene: every contact obeys the law of its own pair."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall
from ninedisk.harness.api.case import Check, Headline, Observed, Parameter, Setup, Value
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import (
    contact_softness,
    contact_step,
    numerics_of,
    phase_error,
    round_off_speed,
    single,
    single_precision,
    slack_time,
    soft_reason,
    whole_steps,
)
from ninedisk.harness.cases.impact.binary import beta_for
from ninedisk.harness.results.figures import Figure, Plotted
from ninedisk.references.analytic.impact.collision import final_velocities
from ninedisk.references.analytic.on_plane.slip_to_roll import slide_to_stop

RADIUS, MASS, GRAVITY, SPEED = 0.5, 1.0, 10.0, 2.0
"""Of each disk [m], [kg]; gravity [m/s^2]; speed of all that are thrown or fly [m/s]."""

SLIDERS = (("steel", 0.1, 1.0), ("rubber", 0.4, 0.5), ("wood", 0.25, 0.2))
"""Material, friction coefficient with the ground, kn with it over the scene's. Nothing is said of wood, which has the wall's own law."""

PAIRS = ((("steel", "steel"), 0.8, 1.0), (("steel", "rubber"), 0.3, 0.5), (("rubber", "rubber"), 0.6, 0.2))
"""Materials of two disks that meet in the air, their restitution, and kn over the scene's."""

APART, HEIGHT, STARTS = 4.0, 6.0, 0.02
"""Between neighbours on the floor and between pairs [m], height of the pairs above the floor [m], and the way to their impacts [m]."""

DT_MOST = 0.01
PHASE = 0.05
"""Resolution of a contact, omega dt."""


class Materials:
    """Three disks slide to unlike ends on one floor; three pairs of disks, falling together, rebound from each other with unlike speeds."""

    id = "contact/materials"
    version = 1
    title = "Three materials in one scene"
    source = "Coulomb's law and Newton's restitution, each with the coefficients of the pair"
    requirement = "a contact obeys the law of its two materials, and the wall's or the disks' own where the table has none for them"
    parameters: tuple[Parameter, ...] = (
        Parameter.positive("dt", 2e-3, high=DT_MOST, unit="s", help="step; sampling of spring engines"),
        Parameter(name="duration", default=0.3, low=0.1, high=0.45, unit="s", help="length of the run; all slide until 0.5 s"),
        Parameter(name="kn", default=1e8, low=1e6, unit="N/m", help="largest stiffness of spring engines"),
    )  # fmt: skip
    figures = (
        Figure(
            title="Three materials on one floor",
            quantities=(
                Plotted("v_steel", "velocity of steel"),
                Plotted("v_rubber", "velocity of rubber"),
                Plotted("v_wood", "velocity of wood"),
            ),
            shows="Three disks that cannot turn, thrown along one floor.",
            allows="Each slows by mu g of its own pair; an engine that mixes coefficients of bodies shows others.",
        ),
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """One scene."""
        return [{}]

    def build(self, params: Mapping[str, Any]) -> Setup:
        """Disks on the floor first, then the pairs high above it; all of one radius and mass."""
        kn = params["kn"]
        law = _floor_law(kn, SLIDERS[-1])
        laws = {(name, "ground"): _floor_law(kn, (name, mu, part)) for name, mu, part in SLIDERS[:-1]}
        laws |= {
            pair: ContactLaw(kn=part * kn, beta=beta_for(e), restitution=e, regularised=True) for pair, e, part in PAIRS
        }
        x = [[APART * k, RADIUS - MASS * GRAVITY / (part * kn)] for k, (_, _, part) in enumerate(SLIDERS)]
        v, material = [[SPEED, 0.0]] * len(SLIDERS), [name for name, _, _ in SLIDERS]
        for k, (pair, _, _) in enumerate(PAIRS):
            x += [[APART * k, HEIGHT], [APART * k + 2.0 * RADIUS + STARTS, HEIGHT]]
            v += [[SPEED, 0.0], [-SPEED, 0.0]]
            material += list(pair)
        scene = Scene(
            disks=Disks(
                x=np.array(x),
                v=np.array(v),
                radius=np.full(len(x), RADIUS),
                mass=np.full(len(x), MASS),
                rotating=np.full(len(x), False),
                material=tuple(material),
            ),
            disk_disk=ContactLaw(kn=kn, beta=beta_for(0.5), restitution=0.5, regularised=True),
            walls=(Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law, material="ground"),),
            gravity=(0.0, -GRAVITY),
            laws=laws,
        )
        numerics = numerics_of(
            params,
            n_steps=whole_steps(params, params["duration"]),
            contact_dt=contact_step(params["dt"], PHASE / math.sqrt(2.0 * kn / MASS)),
        )
        n = len(x)
        watch = tuple((k, n) for k in range(len(SLIDERS)))
        return Setup(
            scene=scene, numerics=numerics, watch=watch, labels={SLIDERS[k][0]: pair for k, pair in enumerate(watch)}
        )

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:  # noqa: ARG002
        """Ways, velocities and gaps of the sliders; mean speeds at which pairs part."""
        start, series = setup.scene.disks.x, {}
        for k, (name, _, _) in enumerate(SLIDERS):
            series[f"x_{name}"] = ("m", history.x[:, k, 0] - start[k, 0])
            series[f"v_{name}"] = ("m/s", history.v[:, k, 0])
            series[f"gap_{name}"] = ("m", history.gap[:, k])
        scalars = {f"{name}_final": (unit, float(values[-1])) for name, (unit, values) in series.items()}
        for k, (pair, _, _) in enumerate(PAIRS):
            one = len(SLIDERS) + 2 * k
            scalars[f"parting_{'_'.join(pair)}"] = ("m/s", float(history.v[-1, one + 1, 0] - history.v[-1, one, 0]))
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """How far rubber gets, and how fast steel and rubber part."""
        truth = _slides(observed.t, SLIDERS[1][1])
        return (
            Headline(name="distance of the second material", use="sliding", quantity="x_rubber_final", expected=float(truth.x[-1]),
                     source=self.source, scale=float(truth.x[-1]), scale_is="distance of the rigid disk"),
            Headline(name="rebound of unlike materials", use="impacts", quantity="parting_steel_rubber", expected=_parting(PAIRS[1][1]),
                     source=self.source, scale=2.0 * SPEED, scale_is="speed of approach"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Constant rates and one impact each; first order in the engine's own step."""
        numerics, t, kn = setup.numerics, observed.t, params["kn"]
        spring = engine.contact == "spring"
        h = (numerics.contact_dt or numerics.dt) if spring else numerics.dt
        t_end = float(t[-1])
        found: list[Check] = []
        for name, mu, part in SLIDERS:
            truth = _slides(t, mu)
            rest = MASS * GRAVITY / (part * kn) if spring else 0.0
            slow = mu * GRAVITY
            error = slow * h + round_off_speed(APART * len(SLIDERS), h) * (1.0 + mu) if spring else slow * numerics.dt
            # Until the shear spring has stretched to mu fn, friction builds up.
            error += 2.0 * slow * MASS * GRAVITY * mu / (part * kn) / SPEED if spring else 0.0
            soft = GRAVITY * slack_time(engine, numerics.dt) + single(engine, SPEED, numerics.n_steps)
            error += soft + 1e-9 * SPEED
            why = "friction may act one step less, in the first" + soft_reason(engine) + single_precision(engine)
            sinks = soft * t_end + single(engine, APART * len(SLIDERS), numerics.n_steps)
            common: dict[str, Any] = {"truth": "analytic", "source": self.source, "why": why}
            curves = {
                "x": (truth.x, error * t_end + 0.5 * slow * t_end * h, SPEED * t_end),
                "v": (truth.vx, error, SPEED),
                "gap": (np.full_like(t, -rest), 0.01 * rest + 1e-9 * RADIUS + sinks, RADIUS),
            }
            for kind, (curve, atol, scale) in curves.items():
                found += [
                    Check(quantity=f"{kind}_{name}", norm="max", expected=curve, atol=atol, scale=scale, **common),
                    Check(quantity=f"{kind}_{name}_final", norm="scalar", expected=float(curve[-1]), atol=atol, scale=scale, **common),
                ]  # fmt: skip
        for pair, e, part in PAIRS:
            phase = math.sqrt(2.0 * part * kn / MASS) * h
            off = phase_error(phase, beta_for(e)) * e if spring else (1.0 + e) * contact_softness(engine)
            atol = (off + 1e-9) * 2.0 * SPEED + 2.0 * single(engine, 2.0 * SPEED, numerics.n_steps)
            why = (
                "impulse of one step"
                if not spring
                else f"phase of the impact in the contact step, omega dt = {phase:.2g}"
            )
            found.append(
                Check(quantity=f"parting_{'_'.join(pair)}", norm="scalar", truth="analytic", expected=_parting(e), atol=atol,
                      source=self.source, why=why + soft_reason(engine) + single_precision(engine), scale=2.0 * SPEED),
            )  # fmt: skip
        return found


def _floor_law(kn: float, kind: tuple[str, float, float]) -> ContactLaw:
    _, mu, part = kind
    return ContactLaw(kn=part * kn, ks=part * kn, mu=mu, restitution=0.0, regularised=True)


def _slides(t: np.ndarray[Any, Any], mu: float) -> Any:
    """A disk that cannot turn."""
    return slide_to_stop(t, mu=mu, speed=SPEED, g=GRAVITY)


def _parting(restitution: float) -> float:
    one, two = final_velocities(mass_1=MASS, mass_2=MASS, v_1=SPEED, v_2=-SPEED, restitution=restitution)
    return two - one


CASE = Materials()
