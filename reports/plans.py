"""Plans of the figures, as data: variants and quantities that a figure shows, and what it lets one conclude."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

Allowed = float | str | bool | None
"""A value of a parameter that a figure admits; None also stands for a parameter that the case does not have."""


@dataclass(frozen=True)
class Plotted:
    """A series quantity of a figure: its name in the records, axis label and the number of its figure in the source."""

    name: str
    label: str
    number: str = ""


@dataclass(frozen=True, kw_only=True)
class FigurePlan:
    """One figure of the source.

    Parameters
    ----------
    number, title : str
        Figure number in the source ("" for a figure of our own) and heading.
    quantities : tuple of Plotted
        Panels; empty means every series quantity of the variants.
    where : mapping from parameter to allowed values
        Variants that the figure shows. Numbers match to 1e-3 relative (2/3 is stored in full), words exactly.
    compare : str
        Parameter whose values stand side by side with a common scale; the other parameters that vary split the figure
        into titled groups.
    x : {"cycle", "time"}
        Horizontal axis.
    last : int or None
        Show the last so many steps, counted from their beginning.
    kind : {"history", "configuration"}
        Histories, or the stored configurations.
    shows, allows : str
        What is to be seen, and which conclusion it allows.
    """

    number: str
    title: str
    quantities: tuple[Plotted, ...] = ()
    where: Mapping[str, tuple[Allowed, ...]] = field(default_factory=dict)
    compare: str = ""
    x: Literal["cycle", "time"] = "time"
    last: int | None = None
    kind: Literal["history", "configuration"] = "history"
    shows: str = ""
    allows: str = ""

    def matches(self, params: Mapping[str, Any]) -> bool:
        """Whether a variant belongs to the figure."""
        return all(any(_same(params.get(name), value) for value in allowed) for name, allowed in self.where.items())


def _same(value: Any, wanted: Allowed) -> bool:
    if isinstance(wanted, str | bool) or wanted is None or isinstance(value, str | bool) or value is None:
        return bool(value == wanted)
    return bool(abs(float(value) - wanted) <= 1e-3 * abs(wanted))


_COMPRESSION = (
    Plotted("fn_disk_disk_centre", "Fn disk–disk, centre row"),
    Plotted("fn_disk_disk_edge", "Fn disk–disk, edge row"),
    Plotted("fn_wall_mid", "Fn wall–middle disk"),
    Plotted("fn_wall_corner", "Fn wall–corner disk"),
)
_DISTORTION = (
    Plotted("fn_up", "Fn, centre–upper disk"),
    Plotted("fs_up", "Fs, centre–upper disk"),
    Plotted("fn_right", "Fn, centre–right disk"),
    Plotted("fs_right", "Fs, centre–right disk"),
)


def _collision(first: int) -> tuple[Plotted, ...]:
    numbers = [f"A.{first + k}" for k in range(4)]
    return (
        Plotted("energy", "kinetic energy", numbers[0]),
        Plotted("momentum_x", "momentum along x", numbers[1]),
        Plotted("vx_1", "vx, disk 1", numbers[2]),
        Plotted("vx_2", "vx, disk 2", numbers[2]),
        Plotted("vy_1", "vy, disk 1", numbers[3]),
        Plotted("vy_2", "vy, disk 2", numbers[3]),
    )


def _incline(first: int) -> tuple[Plotted, ...]:
    names = (
        ("x", "displacement along x"),
        ("vx", "velocity along x"),
        ("gap", "gap (dilation)"),
        ("fs", "shear force"),
        ("fn", "normal force"),
    )
    return tuple(Plotted(name, label, f"A.{first + k}") for k, (name, label) in enumerate(names))


_BY_KIND: Mapping[str, tuple[Allowed, ...]] = {"restitution": (None,), "beta": (None,), "theta": (None,)}
"""Collisions that nothing but their kind describes, as in the source."""

PLANS: Mapping[str, tuple[FigurePlan, ...]] = {
    "nine-disk/compression": (
        FigurePlan(
            number="A.2",
            title="Normal force with and without global damping, load case a1",
            quantities=_COMPRESSION,
            where={"load_case": ("a1",), "xi": (3.0, 0.0)},
            compare="xi",
            x="cycle",
            shows="Normal force over 200 cycles at the four kinds of contact that the source's point C may be; the "
            "walls stop at cycle 40. Left and right differ in the global damping alone and share one scale.",
            allows="With xi = 3 the oscillation decays to the steady force; with xi = 0 it goes on unchanged. An "
            "engine that gives any other amplitude or phase damps differently.",
        ),
        FigurePlan(
            number="A.3",
            title="Normal force of all load cases, xi = 3",
            quantities=_COMPRESSION,
            where={"xi": (3.0,), "load_case": ("a1", "a2", "b1", "b2")},
            compare="load_case",
            x="cycle",
            shows="The four load cases side by side on one scale: two stiffnesses, walls that stop at cycle 40 or 120.",
            allows="All load cases settle at about the same force: exactly the same with smooth walls, within a few "
            "per cent with rough ones.",
        ),
    ),
    "nine-disk/distortion": (
        FigurePlan(
            number="A.4",
            title="Deformed configurations",
            where={"phi_deg": (30.0,), "ks_over_kn": (1.0,)},
            kind="configuration",
            last=500,
            shows="Disks and walls after compression and settlement, and after the distortion; each spoke turns with "
            "its disk.",
            allows="Whether all engines distort the assembly alike, and whether the disks turn with it or against it.",
        ),
        *(
            FigurePlan(
                number=f"A.5 ({letter})",
                title=f"Normal and shear force during distortion, friction angle {phi}°",
                quantities=_DISTORTION,
                where={"phi_deg": (float(phi),), "ks_over_kn": (1.0, 2.0 / 3.0)},
                compare="ks_over_kn",
                shows="Forces between the centre disk and its upper and right neighbour over the 500 cycles of "
                "distortion, with ks/kn = 1 and 2/3. The source does not say which contact is its point C.",
                allows="A softer shear spring delays the first slip; once a contact slides, Fs follows mu Fn.",
                x="cycle",
                last=500,
            )
            for letter, phi in (("a", 15), ("b", 30))
        ),
    ),
    "binary-collision": (
        FigurePlan(
            number="A.6–A.9",
            title="Elastic collision",
            quantities=_collision(6),
            where={"kind": ("elastic",), **_BY_KIND},
            shows="Energy, momentum and the velocities of both disks over time.",
            allows="Energy and momentum are conserved if both curves are level; disk 1 stops and disk 2 leaves "
            "at vx = 1 m/s.",
        ),
        FigurePlan(
            number="A.10–A.13",
            title="Plastic collision",
            quantities=_collision(10),
            where={"kind": ("plastic",), **_BY_KIND},
            shows="Energy, momentum and the velocities of both disks over time.",
            allows="Momentum is conserved, half of the energy is lost, and both disks move on together "
            "at vx = 0.5 m/s.",
        ),
    ),
    "incline-block": (
        FigurePlan(
            number="A.17–A.21",
            title="Block that slides, mu = 0.36",
            quantities=_incline(17),
            where={"mu": (0.36,), "dt": (0.01, 0.005, 0.0025), "preload": (True, None)},
            compare="dt",
            shows="Motion, gap and contact forces of a block that slides down, for three time steps on one scale.",
            allows="The associated sliding rule opens a gap of mu vx dt that halves with dt; Coulomb engines open "
            "none. The forces are m g cos and mu m g cos, not m g and mu m g.",
        ),
        FigurePlan(
            number="A.22–A.26",
            title="Block that sticks, mu = 0.4",
            quantities=_incline(22),
            where={"mu": (0.4,), "dt": (0.01, 0.005, 0.0025), "preload": (True, None)},
            compare="dt",
            shows="The same quantities with friction above the critical 0.364.",
            allows="The block stays put; any slope of x is creep of the engine's friction model.",
        ),
    ),
    "slip-to-roll": (
        FigurePlan(
            number="",
            title="From sliding to rolling",
            quantities=(
                Plotted("x", "displacement along x"),
                Plotted("vx", "velocity along x"),
                Plotted("spin", "spin"),
            ),
            compare="dt",
            shows="A disk thrown with slip and no spin onto a plane.",
            allows="It slides until t = v0/(3 mu g) and then rolls at 2 v0/3, if the engine has the inertia of a disk.",
        ),
    ),
    "spinning-disk": (
        FigurePlan(
            number="",
            title="From spinning to rolling",
            quantities=(
                Plotted("vx", "velocity along x"),
                Plotted("spin", "spin"),
                Plotted("energy", "kinetic energy"),
            ),
            compare="dt",
            shows="A disk put on a plane with a spin and no velocity; friction drives it.",
            allows="It rolls at R omega0/3 from t = R omega0/(3 mu g) on and has lost two thirds of its energy, whatever mu.",
        ),
    ),
}
"""Plans by case id; a case without a plan, and variants that no plan takes, get `GENERIC`."""

GENERIC = FigurePlan(
    number="",
    title="Every recorded quantity",
    shows="Each quantity over time, every engine overlaid.",
    allows="Where the engines part, and when: the lower axes show each engine's distance from the best truth.",
)


@dataclass(frozen=True, kw_only=True)
class ValuePlan:
    """A number whose value over the step size tells engines apart, and the levels that it is held against."""

    quantity: str
    label: str
    levels: tuple[tuple[str, float], ...]
    shows: str
    allows: str


VALUE_PLANS: Mapping[str, tuple[ValuePlan, ...]] = {
    "incline-block": (
        ValuePlan(
            quantity="dilation",
            label="gap/(mu v dt)",
            levels=(("associated rule: 1", 1.0), ("Coulomb: 0", 0.0)),
            shows="Gap of the sliding block over mu v dt, for each time step.",
            allows="Which sliding rule an engine has: 1 for the associated rule, which opens a gap by mu times the slip "
            "of a step, 0 for Coulomb's. Anything else is a gap that neither rule explains.",
        ),
    ),
}
"""Plans of numbers against the step size, by case id."""

SETUP_FIGURES: Mapping[str, str] = {
    "nine-disk/compression": "A.1",
    "nine-disk/distortion": "A.1",
    "sliding/quasistatic": "A.14",
    "sliding/dynamic": "A.15",
    "incline-block": "A.16",
}
"""Figures of the source that show a case's set-up."""
