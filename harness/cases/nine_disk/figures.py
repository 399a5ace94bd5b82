"""The source's figures and claims of the nine-disk assembly: what is shown, what is claimed, and what decides a claim."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np

from ninedisk.harness.api.claims import Cells, Claim, UndecidedError, Verdict, by_value, series
from ninedisk.harness.results.figures import Figure, Plotted

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

PERIOD_CYCLES = 23
"""The nine-disk row oscillates once in 22.2 cycles: a mean or an amplitude over this many spans a whole period."""

SAME_FORCE = 0.05
"""Spread that "roughly the same" allows: friction at the walls alone makes 1-3 %."""

CONTACTS = ("fn_disk_disk_centre", "fn_disk_disk_edge", "fn_wall_mid", "fn_wall_corner")


def same_settled_force(cells: Cells) -> Verdict:
    """Mean force over the last period, a1 to b2 at xi = 3; spread at each kind of contact at most `SAME_FORCE`."""
    damped = [cell for cell in cells if cell.params["xi"] == 3.0]
    groups = [group for group in by_value(damped, "load_case") if {"a1", "a2", "b1", "b2"} <= set(group)]
    if not groups:
        raise UndecidedError("it takes all four load cases with xi = 3")
    worst = 0.0
    for group in groups:
        for contact in CONTACTS:
            settled = [float(series(cell, contact)[-PERIOD_CYCLES:].mean()) for cell in group.values()]
            worst = max(worst, (max(settled) - min(settled)) / float(np.mean(settled)))
    return (
        worst <= SAME_FORCE,
        f"largest spread of the settled force over a1, a2, b1, b2: {worst:.2%} (limit {SAME_FORCE:.0%})",
    )


def damping_reduces_oscillation(cells: Cells) -> Verdict:
    """Half the range of the force over the last period, xi = 3 against xi = 0, at each kind of contact."""
    pairs = [group for group in by_value(cells, "xi") if {0.0, 3.0} <= set(group)]
    if not pairs:
        raise UndecidedError("it takes the same variant with xi = 3 and xi = 0")
    ratios = []
    for pair in pairs:
        for contact in CONTACTS:
            damped, free = (float(np.ptp(series(pair[xi], contact)[-PERIOD_CYCLES:])) for xi in (3.0, 0.0))
            ratios.append(damped / free if free > 0.0 else math.inf)
    return max(ratios) < 1.0, f"amplitude with xi = 3 over that with xi = 0: {min(ratios):.2g} to {max(ratios):.2g}"


def friction_and_stiffness_ratio(cells: Cells) -> Verdict:
    """Both parameters move Fs by more than the reference is uncertain, and more friction gives the higher peak."""
    uncertainty = max(
        (row["uncertainty"] / row["scale"] for cell in cells for row in cell.rows
         if row["quantity"] == "fs_up" and row["truth"] == "converged" and row["scale"] > 0.0),
        default=0.0,
    )  # fmt: skip
    least: dict[str, float] = {}
    rises = True
    for varied in ("phi_deg", "ks_over_kn"):
        changes = []
        for group in by_value(cells, varied):
            for low, high in combinations(sorted(group), 2):
                one, two = np.abs(series(group[low], "fs_up")), np.abs(series(group[high], "fs_up"))
                changes.append(float(np.abs(two - one).max() / max(one.max(), two.max())))
                rises &= varied != "phi_deg" or bool(two.max() > one.max())
        if not changes:
            raise UndecidedError(f"it takes two values of {varied}")
        least[varied] = min(changes)
    text = ", ".join(f"{name} changes Fs by at least {value:.1%}" for name, value in least.items())
    text += f"; the reference is uncertain by {uncertainty:.1e}; more friction gives {'a' if rises else 'no'} higher Fs"
    return min(least.values()) > uncertainty and rises, text


COMPRESSION_FIGURES: tuple[Figure, ...] = (
    Figure(kind="setup", number="A.1"),
    Figure(
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
    Figure(
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
)

COMPRESSION_CLAIMS: tuple[Claim, ...] = (
    Claim(
        id="same-settled-force",
        place="A.1.1",
        text=(
            "all loading cases converge to roughly the same value of force after a number of cycles when "
            "steady equilibrium is achieved"
        ),
        decided_by=(
            "Settled disk-disk and wall forces of a1, a2, b1, b2 with xi = 3: confirmed if their spread, "
            "relative to the mean, is at most 5 % at every kind of contact."
        ),
        rule=same_settled_force,
    ),
    Claim(
        id="damping-reduces-oscillation",
        place="A.1.1",
        text="clearly show the effect of damping in reducing the amplitude of oscillations",
        decided_by=(
            "Amplitude of the force's oscillation over the last period of the 200 cycles, xi = 3 against "
            "xi = 0, same load case: confirmed if the damped one is smaller."
        ),
        rule=damping_reduces_oscillation,
    ),
)

DISTORTION_FIGURES: tuple[Figure, ...] = (
    Figure(kind="setup", number="A.1"),
    Figure(
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
        Figure(
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
)

DISTORTION_CLAIMS: tuple[Claim, ...] = (
    Claim(
        id="friction-and-stiffness-ratio-shape-distortion",
        place="A.1.2",
        text=(
            "show the importance of interparticle friction (particle roughness) and the role of contact "
            "stiffness as modeled by the ratio ks/kn"
        ),
        decided_by=(
            "Shear force histories for phi = 15 and 30 degrees and ks/kn = 1 and 2/3: confirmed if both "
            "the friction angle and the ratio change the curve by more than the reference's uncertainty, "
            "and the higher friction gives the higher plateau."
        ),
        rule=friction_and_stiffness_ratio,
    ),
)
