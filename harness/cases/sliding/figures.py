"""The source's figures and claims of a sliding particle: what is shown, what is claimed, and what decides a claim."""

from __future__ import annotations

import numpy as np

from ninedisk.harness.api.claims import NO_DILATION, Cells, Claim, UndecidedError, Verdict, associated, scalar, series
from ninedisk.harness.results.figures import Figure


def quasistatic_dilates_once(cells: Cells) -> Verdict:
    """The first increment lifts by mu du, the later ones by nothing, to 1e-9 of the lift (round-off of the solver)."""
    worst = 0.0
    for cell in associated(cells):
        lift = cell.params["mu"] * abs(cell.params["increment"])
        gap = series(cell, "gap")
        worst = max(worst, float(np.abs(gap[1:] - lift).max()) / lift if lift > 0.0 else 0.0)
    return worst <= 1e-9, f"largest difference of the gap after any increment from mu du, relative: {worst:.1e}"


def critical_time_step(cells: Cells) -> Verdict:
    """First rise: (A.4) above dt_cr, nothing below, to 1e-9 of mu v dt; both sides are needed."""
    worst, sides, lifted = 0.0, set(), False
    for cell in associated(cells):
        p, rise = cell.params, scalar(cell, "du_y_1")
        reach = p["mu"] * p["speed"] * p["dt"]
        above = reach > p["g0"]
        expected = (reach - p["g0"]) / (1.0 + p["mu"] ** 2) if above else 0.0
        worst = max(worst, abs(rise - expected) / reach)
        sides.add(above)
        lifted |= above and rise > NO_DILATION
    if len(sides) < 2:
        raise UndecidedError("it takes time steps on both sides of dt_cr")
    if not lifted:
        raise UndecidedError("this engine's sliding does not dilate")
    return worst <= 1e-9, f"largest difference of the first rise from (A.4) or 0, relative to mu v dt: {worst:.1e}"


QUASISTATIC_FIGURES: tuple[Figure, ...] = (Figure(kind="setup", number="A.14"),)

QUASISTATIC_CLAIMS: tuple[Claim, ...] = (
    Claim(
        id="quasistatic-dilates-once",
        place="A.3.1",
        text=(
            "no further dilation occurs and the particle slides parallel to the surface at a distance mu "
            "Delta u_T above it"
        ),
        decided_by=(
            "Gap after every increment: confirmed if the first lifts by mu times the increment and later "
            "ones by nothing, to round-off."
        ),
        rule=quasistatic_dilates_once,
        derivation=(
            "The associated rule (A.2) sets the gap after every increment to mu times the slip of that increment: equal "
            "increments lift once and then no more.",
            "Coulomb's rule lifts by nothing, so a run with that rule contradicts the statement, as it should.",
        ),
    ),
)

DYNAMIC_FIGURES: tuple[Figure, ...] = (Figure(kind="setup", number="A.15"),)

DYNAMIC_CLAIMS: tuple[Claim, ...] = (
    Claim(
        id="critical-time-step",
        place="A.3.2",
        text=(
            "the initial gap will not grow any further for Delta t <= Delta t_cr while it will increase "
            "for Delta t > Delta t_cr"
        ),
        decided_by=(
            "Rise of the first step on both sides of dt_cr = g0/(mu v_T): confirmed if it is (A.4) above "
            "and 0 below; (A.4) itself is negative below, where the contact would need tension."
        ),
        rule=critical_time_step,
        derivation=(
            "(A.3) has m du_y = p dt^2 with p >= 0. (A.4) gives du_y = (mu v_T dt - g0)/(1 + mu^2), which is negative for "
            "dt < dt_cr = g0/(mu v_T): the contact would have to pull. The step that satisfies p >= 0 is then p = q = 0 and "
            "du_y = 0, so that (A.4) holds for dt >= dt_cr only.",
            "Both statements belong to the associated sliding rule. Under Coulomb's rule nothing opens a contact by sliding: "
            "with a gap there is no force, and the gap keeps its size at every dt. An engine with Coulomb friction therefore "
            "contradicts the statement, as it should.",
        ),
    ),
)
