"""Claims of the source that measurements contradict: what it says, what follows instead, and what engines give."""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import median
from typing import Any

from ninedisk.reports.load import Row
from ninedisk.reports.model import CaseData, Panel
from ninedisk.reports.text import as_float, number, parameters

DERIVATIONS: dict[str, tuple[str, ...]] = {
    "contact-forces-match-mg": (
        "The block touches a plane inclined by theta. Along the plane's normal act the contact force p and gravity's "
        "component m g cos theta, and the block's acceleration in that direction vanishes up to the dilation, which the "
        "source itself calls negligible. Hence p = m g cos theta.",
        "While the block slides, Coulomb's law gives q = mu p = mu m g cos theta. While it sticks, equilibrium along the "
        "plane gives q = m g sin theta.",
        "The forces m g and mu m g belong to a horizontal plane. They are larger by 1/cos theta.",
    ),
    "critical-time-step": (
        "(A.3) has m du_y = p dt^2 with p >= 0. (A.4) gives du_y = (mu v_T dt - g0)/(1 + mu^2), which is negative for "
        "dt < dt_cr = g0/(mu v_T): the contact would have to pull. The step that satisfies p >= 0 is then p = q = 0 and "
        "du_y = 0, so that (A.4) holds for dt >= dt_cr only.",
        "Both statements belong to the associated sliding rule. Under Coulomb's rule nothing opens a contact by sliding: "
        "with a gap there is no force, and the gap keeps its size at every dt. An engine with Coulomb friction therefore "
        "contradicts the statement, as it should.",
    ),
    "quasistatic-dilates-once": (
        "The associated rule (A.2) sets the gap after every increment to mu times the slip of that increment: equal "
        "increments lift once and then no more.",
        "Coulomb's rule lifts by nothing, so a run with that rule contradicts the statement, as it should.",
    ),
    "rotations-limit-dilation": (
        "Under the associated rule the gap after a step is mu times the slip of the step, so it vanishes once the disk "
        "rolls. An engine whose disk keeps a larger gap than the one that cannot turn dilates for another reason.",
    ),
    "elastic-collision-conserves": (
        "Two equal disks that exchange their velocities keep momentum and energy exactly. With a time step, the impact "
        "falls inside a step: if the gap is no whole number of v dt, a scheme of positions closes it first and keeps "
        "only a part of the velocity, e_eff(phase).",
    ),
}  # fmt: skip
"""Why measurements differ from a claim, by the claim's id."""


@dataclass(frozen=True)
class Statement:
    """One quantity that the source states, beside what the better truth and the engines give."""

    quantity: str
    unit: str
    where: str
    stated: float
    follows: float
    middle: float
    lowest: float
    highest: float
    engines: int


@dataclass(frozen=True)
class Erratum:
    """A claim with at least one contradiction; ``everywhere``: no engine confirms it."""

    claim: Row
    case: CaseData
    contradicted: dict[str, list[str]]  # engines by evidence
    confirmed: list[str]
    undecided: list[str]
    everywhere: bool
    derivation: tuple[str, ...]
    statements: list[Statement]


def errata(panel: Panel) -> list[Erratum]:
    """Contradicted claims: those that no engine confirms first, then in the order of the records."""
    found = []
    for case in panel.cases.values():
        claims: dict[str, list[Row]] = {}
        for row in case.claims:
            claims.setdefault(row["claim"], []).append(row)
        for name, rows in claims.items():

            def engines(verdict: str, rows: list[Row] = rows) -> list[str]:
                held = [row["engine"] for row in rows if row["verdict"] == verdict]
                return [panel.engines[engine].name if engine in panel.engines else engine for engine in held]

            against = [row["evidence"] for row in rows if row["verdict"] == "contradicted"]
            if against:
                told: dict[str, list[str]] = {}
                for engine, evidence in zip(engines("contradicted"), against, strict=True):
                    told.setdefault(evidence, []).append(engine)
                confirmed = engines("confirmed")
                derivation = DERIVATIONS.get(name, ())
                stated = [] if confirmed else _statements(case)
                undecided = engines("undecided")
                found.append(Erratum(rows[0], case, told, confirmed, undecided, not confirmed, derivation, stated))
    return sorted(found, key=lambda erratum: not erratum.everywhere)


def _statements(case: CaseData) -> list[Statement]:
    """Published numbers of a case that the better truth of the same variant and quantity contradicts."""
    best: dict[tuple[str, str], float] = {}
    for row in case.measurements:
        if row["norm"] == "scalar" and row["truth"] == "analytic" and math.isfinite(as_float(row["expected"])):
            best[row["variant"], row["quantity"]] = as_float(row["expected"])
    held: dict[tuple[str, str, float, float], tuple[dict[str, Any], list[float], set[str]]] = {}
    for row in case.measurements:
        stated, follows = as_float(row["expected"]), best.get((row["variant"], row["quantity"]), math.nan)
        apart = abs(stated - follows) > max(as_float(row["uncertainty"]) or 0.0, 1e-9 * abs(follows))
        if row["truth"] == "published" and row["status"] == "known-gap" and math.isfinite(follows) and apart:
            mu = {k: v for k, v in case.variants[row["variant"]].items() if k == "mu"}
            key = row["quantity"], parameters(mu, mu), stated, follows
            _, values, engines = held.setdefault(key, (row, [], set()))
            if math.isfinite(as_float(row["value"])):
                values.append(as_float(row["value"]))
                engines.add(row["engine"])
    return [
        Statement(key[0], row["unit"], key[1], key[2], key[3], median(values), min(values), max(values), len(engines))
        for key, (row, values, engines) in held.items()
        if values
    ]


def measured(statement: Statement) -> str:
    """Median of what the engines gave, and its span."""
    low, high = number(statement.lowest), number(statement.highest)
    return low if low == high else f"{number(statement.middle)} ({low} … {high})"
