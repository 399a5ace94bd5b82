"""Two adhesive spheres that meet head on: JKR's force, its neck, and what one approach and separation loses."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.law import SphereLaw
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Spheres, SphereScene
from ninedisk.harness.api.case import Check, Headline, KnownDifference, Observed, Parameter, SphereSetup, Value
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.cases.differences import FINDING_WORDS
from ninedisk.harness.cases.impact.sphere_impact import SPHERES
from ninedisk.harness.results.figures import Figure, Plotted
from ninedisk.references.analytic.impact.hertz import hertz_impact
from ninedisk.references.analytic.impact.jkr import neck, restitution, stable_contact, sticking_speed

RADII, MASSES, E_STAR, ENERGY = (0.01, 0.02), (0.01, 0.05), 1e7, 0.05
REDUCED, M_EFF = RADII[0] * RADII[1] / sum(RADII), MASSES[0] * MASSES[1] / sum(MASSES)
ONE = {"e_star": E_STAR, "surface_energy": ENERGY, "radius": REDUCED}


class AdhesiveImpact:
    """Elastic spheres attract each other once they touch and hold until their neck breaks, beyond the touch.

    The force at every gap, the largest pull, the gap of the break and the energy lost have closed forms; below the sticking speed the
    spheres never part.
    """

    id = "spheres/jkr"
    version = 1
    title = "Adhesive impact of two spheres (JKR)"
    source = "Johnson, Kendall & Roberts (1971), Proc. R. Soc. A 324, 301; loss: Thornton & Ning (1998), Powder Technology 99, 154"
    requirement = "force, break of the neck and energy lost are JKR's closed forms"
    figures: tuple[Figure, ...] = (
        Figure(
            kind="places",
            title="Restitution over the speed of approach",
            quantities=(Plotted("restitution_effective", "restitution [-]", at="speed"),),
            at_label="speed of approach over the sticking speed",
            log="x",
            shows="Speed of separation over that of approach; 0: the spheres stay together.",
            allows="The neck takes one and the same work in every impact: sqrt(1 - 1/x^2). A contact that parts at its largest pull loses "
            "half of that.",
        ),
        Figure(
            title="Force and gap",
            quantities=(Plotted("force", "normal force [N]"), Plotted("gap", "gap [m]")),
            shows="Normal force and gap of each engine in time: the pull that begins with the touch, and the neck that holds beyond it.",
            allows="Where curves end their pull at different gaps, engines break the neck elsewhere, and lose other energies.",
        ),
    )
    parameters: tuple[Parameter, ...] = (
        Parameter(name="speed", default=2.0, low=0.1, high=100.0, unit="-", in_id=True, help="speed of approach over the sticking speed"),
        Parameter(
            name="way", default=0.01, low=0.0, low_open=True, high=0.1, unit="-",
            help="displacement in a step at the speed of approach over the gap of the break",
        ),
    )  # fmt: skip

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Both sides of the sticking speed."""
        return [{"speed": speed} for speed in (0.6, 0.9, 1.2, 2.0, 6.0)]

    def build(self, params: Mapping[str, Any]) -> SphereSetup:
        """The spheres apart by a third of the gap of the break; they touch within a step."""
        exact, v = neck(**ONE), _speed(params)
        dt = params["way"] * -exact.breaking_overlap / v
        gap = (round(1.0 / (3.0 * params["way"])) + 0.4) * v * dt
        hit = hertz_impact(e_star=E_STAR, radius=REDUCED, mass=M_EFF, speed=v)
        out = max(_rebound(params), 0.2) * v
        lasts = gap / v + 2.0 * hit.duration - 8.0 * exact.breaking_overlap / out
        law = SphereLaw(e_star=E_STAR, surface_energy=ENERGY, surface="jkr")
        first = v * MASSES[1] / sum(MASSES)
        scene = SphereScene(
            spheres=Spheres(
                x=SPHERES[:1] * np.array([[-RADII[0]], [RADII[1] + gap]]), radius=np.array(RADII), mass=np.array(MASSES),
                v=SPHERES[:1] * np.array([[first], [first - v]]),
            ),
            sphere_sphere=law,
        )  # fmt: skip
        numerics = Numerics(dt=dt, n_steps=math.ceil(lasts / dt), contact_dt=dt, impact="newton", sliding="coulomb")
        return SphereSetup(scene=scene, numerics=numerics, watch=((0, 1),), labels={"contact": (0, 1)})

    def observe(self, params: Mapping[str, Any], setup: SphereSetup, history: History) -> Observed:  # noqa: ARG002
        """Gap and force; how far this is from JKR's at the same gap while the contact holds; the break and the loss."""
        exact = neck(**ONE)
        apart = history.x[:, 1] - history.x[:, 0]
        gap, force = np.linalg.norm(apart, axis=1) - sum(RADII), history.fn[:, 0]
        held = np.isfinite(force) & (force != 0.0)
        off = np.zeros_like(force)
        inside = held & (-gap >= exact.breaking_overlap)
        off[inside] = force[inside] - stable_contact(-gap[inside], **ONE)[1]
        off[held & ~inside] = force[held & ~inside]
        off[~np.isfinite(force)] = np.nan
        v = (history.v[:, 0] - history.v[:, 1]) @ SPHERES[0]
        known = np.isfinite(force).all()
        lost = 0.5 * M_EFF * float(v[0] ** 2 - v[-1] ** 2)
        parted = known and not held[-1] and gap[-1] > -exact.breaking_overlap
        scalars = {
            "pull_off": ("N", -float(force.min())),
            "restitution_effective": ("1", (-float(v[-1]) / float(v[0]) if parted else 0.0) if known else math.nan),
        }
        if params["speed"] > 1.0:
            scalars["loss"] = ("J", lost)
            scalars["break_gap"] = ("m", float(gap[held].max()) if known and held.any() else math.nan)
        series = {"gap": ("m", gap), "force": ("N", force), "force_off": ("N", off)}
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """The rebound, 0 where spheres stick."""
        return (
            Headline(name="rebound of adhesive spheres", use="impacts", quantity="restitution_effective", expected=_rebound(params),
                     source="Johnson, Kendall & Roberts: e^2 = 1 - (v_s/v)^2", scale=1.0, scale_is="speed of approach"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:  # fmt: skip
        """Closed forms, to what a step moves meanwhile."""
        exact, path = neck(**ONE), _speed(params) * setup.numerics.dt
        source, rebound = "Johnson, Kendall & Roberts (1971)", _rebound(params)
        early = Difference.NECK_PARTS_AT_LARGEST_PULL in engine.differences

        def known(size: float) -> KnownDifference | None:
            if not early:
                return None
            words = FINDING_WORDS[Difference.NECK_PARTS_AT_LARGEST_PULL]
            return KnownDifference(
                finding=f"{engine.id}/{words}", size=size, why="the neck from the largest pull to the break"
            )

        # Around its largest the pull is a parabola in the overlap, of which the steps see a place at most half of a way aside.
        near = exact.pull_off + float(stable_contact(exact.pull_off_overlap + 0.5 * path, **ONE)[1])
        late = float(stable_contact(exact.pull_off_overlap + path, **ONE)[1]) + exact.pull_off
        # The contact begins with a pull, and ends with one, somewhere in a step.
        unsure = path * (exact.touching_force + exact.breaking_force)
        # Central differences change energies by the square of the phase of a step: of what the spheres exchange.
        hit = hertz_impact(e_star=E_STAR, radius=REDUCED, mass=M_EFF, speed=_speed(params))
        unsure += 0.5 * M_EFF * _speed(params) ** 2 * (math.pi * setup.numerics.dt / hit.duration) ** 2
        kinetic = 0.5 * M_EFF * _speed(params) ** 2
        sooner = math.sqrt(max(1.0 - exact.pull_off_loss / kinetic, 0.0))
        atol = unsure / (2.0 * kinetic * rebound) if rebound > 0.0 else 0.0
        found = [
            Check(quantity="force_off", norm="max", truth="analytic", expected=np.zeros(len(observed.step)), source=source,
                  atol=1e-9 * exact.pull_off, scale=exact.pull_off,
                  why="round-off: gaps of 1e-7 m are differences of places of 1e-2 m, 1e-11 of them, and the branch is steep at its end"),
            Check(quantity="restitution_effective", norm="scalar", truth="analytic", expected=rebound, source="e^2 = 1 - (v_s/v)^2",
                  atol=atol, scale=1.0,
                  known=known(sooner - rebound + 1.1 * unsure / (2.0 * kinetic * sooner)) if sooner > rebound else None,
                  why="the loss, see there, over that of the speed" if rebound else "spheres stay together: exactly 0"),
        ]  # fmt: skip
        if not rebound:
            return found
        gap = -exact.breaking_overlap
        return [
            *found,
            Check(quantity="pull_off", norm="scalar", truth="analytic", expected=exact.pull_off, source=source,
                  atol=late if early else near, scale=exact.pull_off, why="a parabola, seen half a step aside"),
            Check(quantity="break_gap", norm="scalar", truth="analytic", expected=gap - 0.5 * path, source=source, atol=0.5 * path,
                  scale=gap, known=known(gap + exact.pull_off_overlap + 1.5 * path), why="the last step before the break, anywhere in it"),
            Check(quantity="loss", norm="scalar", truth="analytic", expected=exact.loss, source="Thornton & Ning (1998)", atol=unsure,
                  scale=exact.loss, known=known(exact.loss - exact.pull_off_loss + unsure),
                  why="the first and the last pull act up to a step too long or too short; the square of a step's phase"),
        ]  # fmt: skip


def _speed(params: Mapping[str, Any]) -> float:
    return float(params["speed"]) * sticking_speed(m_eff=M_EFF, **ONE)


def _rebound(params: Mapping[str, Any]) -> float:
    return restitution(speed=_speed(params), m_eff=M_EFF, **ONE)


CASE = AdhesiveImpact()
