"""The eight impacts by which Chung and Ooi judge DEM codes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.spheres.law import Elastic, SphereLaw, damping_ratio, moduli
from ninedisk.harness.api.case import Check, Headline, Observed, Parameter, SphereSetup, Value
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import single
from ninedisk.harness.cases.spheres.impact import ROUND_OFF, observed_of, rebound_checks, setup_of
from ninedisk.harness.results.schema import Figure, Plotted
from ninedisk.references.analytic.hertz import contact_moduli, hertz_shift
from ninedisk.references.hertz_mindlin import UNLOADING, Contact, impact

AHEAD = 3.3
"""Samples before the touch, which so falls on none."""

SAMPLES = 100
"""In the time of the elastic impact."""

AFTER = 8
"""Samples after the impact."""

PEAK = 1e-7
"""Of the top of a parabola through three samples a hundredth of the impact apart: ``F''''/24`` times their distance, 0.0294 overlaps over
the speed, to the fourth; F'''' is 7 there in units of the impact, and the remainder at most 3/16 of that."""

RIGID: tuple[tuple[float, float], ...] = ()
"""A body that gives no way."""


class Material(NamedTuple):
    """Young's modulus [Pa], Poisson's ratio, density [kg/m^3] of a sphere, and (E, nu) of what it hits."""

    E: float
    nu: float
    density: float
    partner: tuple[tuple[float, float], ...] = RIGID


GLASS, LIMESTONE = (4.8e10, 0.2, 2800.0), (2e10, 0.25, 2500.0)
ALUMINIUM, NYLON = (7e10, 0.33, 2700.0), (2.5e9, 0.4, 1000.0)


class Test(NamedTuple):
    """One of the tests: what it is of, what it varies, and what its figures show over what."""

    title: str
    requirement: str
    radius: float
    speed: float
    materials: Mapping[str, Material]
    varied: Parameter | None
    matrix: tuple[Value, ...]
    shown: tuple[tuple[str, str], ...]
    at: str = ""
    at_label: str = ""
    mu: float = 0.0
    restitution: float = 1.0
    second: float = 0.0
    """Radius of the second sphere over that of the first; 0: a plane."""
    denser: float = 1.0


def _angle(help_text: str) -> Parameter:
    return Parameter(name="angle", default=25.0, low=0.0, high=89.0, unit="deg", in_id=True, help=help_text)


def _spin(default: float) -> Parameter:
    return Parameter(
        name="spin",
        default=default,
        unit="rad/s",
        in_id=True,
        help="of the first sphere, about the axis across its way",
    )


ELASTIC = (("force_max", "largest force [N]"), ("overlap_max", "largest overlap [m]"), ("duration", "duration [s]"))
SPUN = (("surface_restitution", "slip after over before [-]"), ("recoil", "slip after over vn after [-]"))

TESTS: Mapping[int, Test] = {
    1: Test(
        "Elastic impact of two equal spheres", "force, overlap and duration are Hertz'", 0.01, 20.0,
        {"glass": Material(*GLASS, (GLASS[:2],)), "limestone": Material(*LIMESTONE, (LIMESTONE[:2],))}, None, (), (), second=1.0,
    ),
    2: Test(
        "Elastic impact of a sphere on a rigid plane", "force, overlap and duration are Hertz'", 0.1, 0.2,
        {"aluminium": Material(7e10, 0.3, 2699.0), "magnesium": Material(4e10, 0.35, 1800.0)}, None, (), (),
    ),
    3: Test(
        "Rebound of a sphere with a dashpot", "it rebounds with the restitution that is asked for", 0.0025, 3.9,
        {"alumina": Material(3.8e11, 0.23, 4000.0), "iron": Material(1e11, 0.25, 7000.0)},
        Parameter(name="restitution", default=0.6, low=0.05, high=1.0, unit="-", in_id=True, help="coefficient of restitution"),
        (0.2, 0.6, 0.9, 1.0), (("restitution_effective", "restitution [-]"),), "restitution", "restitution that is asked for",
    ),
    4: Test(
        "Oblique impact on a plane, the same speed at all angles", "spin and velocity after the impact are those of the law integrated",
        0.0025, 3.9, {"alumina": Material(3.8e11, 0.23, 4000.0, (ALUMINIUM[:2],))}, _angle("of incidence, from the normal"),
        (3.0, 10.0, 25.0, 50.0, 80.0),
        (("tangential_restitution", "vt after over before [-]"), ("spin_after", "spin after [rad/s]"),
         ("rebound_angle", "angle of rebound [deg]")),
        "angle", "angle of incidence [deg]", mu=0.092, restitution=0.98,
    ),
    5: Test(
        "Oblique impact on a plane, the same normal speed", "spin and velocity after the impact are those of the law integrated",
        1e-5, 5.0, {"steel": Material(2.08e11, 0.3, 7850.0), "polyethylene": Material(1e9, 0.4, 1400.0)},
        _angle("of incidence, from the normal"), (10.0, 30.0, 60.0),
        (("slip_scaled", "slip after over mu vn after [-]"), ("spin_scaled", "R spin after over mu vn [-]")),
        "incidence_scaled", "slip before over mu vn [-]", mu=0.3,
    ),
    6: Test(
        "Spinning sphere on a plane", "spin and velocity after the impact are those of the law integrated", 0.1, 0.2,
        {"aluminium": Material(*ALUMINIUM), "nylon": Material(*NYLON)}, _spin(2.0), (0.5, 2.0, 7.0, 20.0), SPUN, "incidence",
        "slip before over vn [-]", mu=0.4, restitution=0.5,
    ),
    7: Test(
        "Two equal spheres that spin", "without slip no friction acts; with slip both spins are those of the law integrated", 0.1, 0.4,
        {"aluminium": Material(*ALUMINIUM, (ALUMINIUM[:2],)), "nylon": Material(*NYLON, (NYLON[:2],))}, _spin(5.0), (5.0, 20.0),
        (("vt_final", "vt after [m/s]"), ("spin_after", "spin after [rad/s]")), "spin", "spin before [rad/s]", mu=0.4, restitution=0.5,
        second=1.0,
    ),
    8: Test(
        "Spinning sphere on a large and heavy one", "as on a plane, but for the second's radius", 0.1, 0.2,
        {"aluminium": Material(*ALUMINIUM, (ALUMINIUM[:2],)), "nylon": Material(*NYLON, (NYLON[:2],))}, _spin(2.0), (0.5, 2.0, 20.0), SPUN,
        "incidence", "slip before over vn [-]", mu=0.4, restitution=0.5, second=5.0, denser=1000.0,
    ),
}  # fmt: skip


class ChungOoi:
    """One of the tests; parameters are those of the paper as scripts of YADE, Kratos and PySPH have them.

    Truths are Hertz' closed form for the elastic impacts along the normal, and elsewhere the law itself, integrated: the paper's own
    curves were made by other laws and finite elements, and are no truth of this one.
    """

    version = 1
    source = "Chung & Ooi (2011), Granular Matter 13, 643"

    def __init__(self, number: int) -> None:
        self.number, self.test = number, TESTS[number]
        self.id = f"spheres/chung-ooi/{number}"
        self.title = f"Chung and Ooi {number}: {self.test.title}"
        self.requirement = self.test.requirement
        names = tuple(self.test.materials)
        varied = () if self.test.varied is None else (self.test.varied,)
        friction = (
            Parameter(
                name="unloading", default="force", choices=UNLOADING, help="shear spring while the contact shrinks"
            ),
        )
        self.parameters: tuple[Parameter, ...] = (
            Parameter(name="material", default=names[0], choices=names, in_id=len(names) > 1, help="of the sphere"),
            *varied,
            *(friction if self.test.mu else ()),
            *((Parameter(name="partner", default="opposite", choices=("opposite", "same"),
                         help="spin of the second sphere: opposite leaves no slip"),) if number == 7 else ()),
            Parameter(name="substeps", default=8, low=1, high=1000, whole=True, unit="-", only_for="spring",
                      help="contact steps in a sample, of which the elastic impact takes 100"),
        )  # fmt: skip
        self.figures: tuple[Figure, ...] = (self._figure(),)

    def _figure(self) -> Figure:
        if self.test.varied is None:
            return Figure(
                title="Force and overlap",
                quantities=(Plotted("force", "force [N]"), Plotted("gap", "gap [m]")),
                shows="Force and gap over time.",
                allows="The curves are Hertz' where they reach the largest force and overlap of the table, in the time told there.",
            )
        return Figure(
            kind="places",
            title=self.test.title,
            quantities=tuple(Plotted(name, label, at=self.test.at) for name, label in self.test.shown),
            compare="material" if len(self.test.materials) > 1 else "",
            at_label=self.test.at_label,
            shows=f"The paper's figure of this test, of every engine: {', '.join(label for _, label in self.test.shown)}.",
            allows="All engines that take the law of the scene lie on the law integrated, which is the truth; one apart from the others "
            "has another stiffness, arm, dashpot or friction.",
        )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Both materials; what varies; the other rules of unloading once, in test 4."""
        test, found = self.test, []
        for material in test.materials:
            for value in test.matrix or (None,):
                each: dict[str, Value] = {"material": material} if len(test.materials) > 1 else {}
                if test.varied is not None and value is not None:
                    each[test.varied.name] = value
                found.append(each)
        if self.number == 1:
            found.append({"material": "glass", "substeps": 40})
        if self.number == 4:
            found += [{"angle": 25.0, "unloading": rule} for rule in ("none", "rescale")]
        if self.number == 7:
            found.append({"material": "aluminium", "spin": 5.0, "partner": "same"})
        return found

    def contact(self, params: Mapping[str, Any]) -> Contact:
        """The two bodies, before they meet, and the law by the references' formulas."""
        test, material = self.test, self.test.materials[params["material"]]
        e_star, g_star = contact_moduli((material.E, material.nu), *material.partner)
        e = params.get("restitution", test.restitution)
        angle, spin, vn, vt = math.radians(params.get("angle", 0.0)), params.get("spin", 0.0), test.speed, 0.0
        if self.number == 4:
            vn, vt = test.speed * math.cos(angle), test.speed * math.sin(angle)
        elif self.number == 5:
            vt = vn * math.tan(angle)
        mass = 4.0 / 3.0 * math.pi * test.radius**3 * material.density
        first, second = (vn, vt, spin), (0.0, 0.0, 0.0)
        if self.number in (1, 7):
            turn = -spin if params.get("partner", "opposite") == "opposite" else spin
            first, second = (0.5 * vn, 0.0, spin), (-0.5 * vn, 0.0, turn)
        return Contact(
            radius=test.radius, mass=mass,
            radius_2=test.radius * test.second if test.second else math.inf,
            mass_2=mass * test.second**3 * test.denser if test.second else math.inf,
            first=first, second=second, e_star=e_star, g_star=g_star if test.mu else 0.0, mu=test.mu,
            beta=-math.log(e) / math.hypot(math.pi, math.log(e)), unloading=params.get("unloading", "force"),
        )  # fmt: skip

    def build(self, params: Mapping[str, Any]) -> SphereSetup:
        """The bodies a few samples before they touch."""
        test, material, contact = self.test, self.test.materials[params["material"]], self.contact(params)
        other = Elastic(E=material.partner[0][0], nu=material.partner[0][1]) if material.partner else None
        e_star, g_star = moduli(Elastic(E=material.E, nu=material.nu), other)
        e = params.get("restitution", test.restitution)
        law = SphereLaw(
            e_star=e_star, g_star=g_star if test.mu else 0.0, mu=test.mu, beta=damping_ratio(e), unloading=params.get("unloading", "force"),
            restitution=e,
        )  # fmt: skip
        dt = contact.elastic.duration / SAMPLES
        return setup_of(
            contact, law, dt=dt, gap=AHEAD * dt * contact.speed, contact_dt=dt / params["substeps"],
            n_steps=math.ceil(AHEAD + SAMPLES * (0.5 + 0.5 / e)) + AFTER,  # a dashpot makes it longer
        )  # fmt: skip

    def observe(self, params: Mapping[str, Any], setup: SphereSetup, history: History) -> Observed:  # noqa: ARG002
        """What `observed_of` sees, and the scaled quantities of the paper's figures."""
        contact, seen = self.contact(params), observed_of(self.contact(params), history)
        value = {name: number for name, (_, number) in seen.scalars.items()}
        arm = contact.radius + (0.0 if math.isinf(contact.radius_2) or self.number != 7 else contact.radius_2)
        slip = contact.first[1] + arm * contact.first[2]
        out, mu = value["restitution_effective"] * contact.speed, contact.mu
        with np.errstate(divide="ignore", invalid="ignore"):
            shown = {
                "tangential_restitution": ("1", np.float64(value["vt_final"]) / contact.first[1]),
                "spin_after": ("rad/s", abs(value["spin_final"])),
                "rebound_angle": ("deg", math.degrees(math.atan2(value["vt_final"], out))),
                "surface_restitution": ("1", np.float64(value["slip_final"]) / slip),
                "recoil": ("1", np.float64(value["slip_final"]) / out),
                "incidence": ("1", slip / contact.speed),
                "incidence_scaled": ("1", np.float64(slip) / (mu * contact.speed)),
                "slip_scaled": ("1", np.float64(value["slip_final"]) / (mu * out)),
                "spin_scaled": ("1", abs(contact.radius * value["spin_final"]) / np.float64(mu * contact.speed)),
            }
        wanted = {name for name, _ in self.test.shown} | {self.test.at}
        extra = {name: (unit, float(number)) for name, (unit, number) in shown.items() if name in wanted}
        return Observed(step=seen.step, t=seen.t, series=seen.series, scalars={**seen.scalars, **extra})

    def headlines(self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """Hertz' force and duration; elsewhere restitution, and the spin where there is friction."""
        contact = self.contact(params)
        if self.number <= 2:
            hertz, source = contact.elastic, "Hertz (1881)"
            return (
                Headline(name="largest force", use="impacts", quantity="force_max", expected=hertz.force, source=source,
                         scale=hertz.force, scale_is="largest force"),
                Headline(name="duration", use="impacts", quantity="duration", expected=hertz.duration, source=source,
                         scale=hertz.duration, scale_is="duration"),
            )  # fmt: skip
        truth, _ = impact(contact)
        source = "Hertz-Mindlin law integrated to 1e-12"
        found = [
            Headline(name="restitution", use="impacts", quantity="restitution_effective",
                     expected=(truth.second[0] - truth.first[0]) / contact.speed, source=source, scale=1.0, scale_is="speed of approach")
        ]  # fmt: skip
        if contact.mu:
            surface = (contact.speed + abs(contact.first[1])) / contact.radius + abs(contact.first[2])
            found.append(
                Headline(name="spin after the impact", use="impacts", quantity="spin_final", expected=truth.first[2], source=source,
                         scale=surface, scale_is="speed before over the radius")
            )  # fmt: skip
        return found

    def checks(
        self, params: Mapping[str, Any], setup: SphereSetup, observed: Observed, engine: EngineInfo  # noqa: ARG002
    ) -> Sequence[Check]:  # fmt: skip
        """The rebound; of elastic impacts along the normal also Hertz' force, overlap and duration."""
        contact = self.contact(params)
        found = rebound_checks(contact, setup, engine)
        if self.number > 2:
            return found
        hertz = contact.elastic
        phase = contact.speed * (setup.numerics.contact_dt or setup.numerics.dt) / hertz.overlap
        why = f"central differences, v dt/overlap = {phase:.3g}: twice the term of second order; the samples' parabola"
        rough = {"force_max": PEAK, "overlap_max": PEAK, "duration": ROUND_OFF}
        return [
            *found,
            *(
                Check(quantity=name, norm="scalar", truth="analytic", expected=expected, source="Hertz (1881)",
                      atol=(2.0 * abs(shift) + rough[name] + 100.0 * ROUND_OFF + single(engine, 1.0, setup.numerics.n_steps)
                            * contact.radius / hertz.overlap) * expected, why=why)
                for name, expected, shift in zip(("force_max", "overlap_max", "duration"), hertz, hertz_shift(phase), strict=True)
            ),
        ]  # fmt: skip


ONE, TWO, THREE, FOUR, FIVE, SIX, SEVEN, EIGHT = (ChungOoi(number) for number in TESTS)
