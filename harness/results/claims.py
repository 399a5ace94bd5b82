"""Verdicts on the source's claims: confirmed, contradicted or undecided, for each engine of a run.

One rule a claim: what is measured, the threshold, and why it is there.

A rule takes the finished cells of one engine on the claim's case and returns whether they confirm it, with the
evidence; it raises `UndecidedError` where they cannot tell.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import combinations, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.harness.results.schema import Row
from ninedisk.harness.results.tables import CaseResult
from ninedisk.references.claims import Claim, load_claims

_RAN = frozenset({"pass", "fail", "known-gap", "gap-closed", "no-truth"})


def judge_claims(results: Sequence[CaseResult]) -> list[Row]:
    """A row of `schema.CLAIM_COLUMNS` for each claim and engine of the run.

    A claim whose case the run does not hold has one row without an engine, undecided, with that reason.
    """
    rows = []
    for claim in load_claims():
        cells = [result for result in results if result.cell["case"] == claim.case]
        engines = list(dict.fromkeys(str(result.cell["engine"]) for result in cells))
        if not engines:
            rows.append(_row(claim, "", "undecided", f"the case {claim.case!r} is not part of this run"))
        for engine in engines:
            rows.append(_judge(claim, engine, [cell for cell in cells if cell.cell["engine"] == engine]))
    return rows


def _judge(claim: Claim, engine: str, cells: Sequence[CaseResult]) -> Row:
    ran = [cell for cell in cells if cell.status in _RAN and cell.observed is not None]
    if not ran:
        return _row(claim, engine, "undecided", f"{cells[0].status}: {cells[0].reason}")
    if claim.id not in RULES:
        return _row(claim, engine, "undecided", "no rule decides this claim")
    try:
        confirmed, evidence = RULES[claim.id](ran)
    except UndecidedError as reason:
        return _row(claim, engine, "undecided", str(reason))
    return _row(claim, engine, "confirmed" if confirmed else "contradicted", evidence)


def _row(claim: Claim, engine: str, verdict: str, evidence: str) -> Row:
    return {
        "claim": claim.id,
        "place": claim.place,
        "text": claim.text,
        "case": claim.case,
        "engine": engine,
        "verdict": verdict,
        "evidence": evidence,
    }


Verdict = tuple[bool, str]
Cells = Sequence[CaseResult]

PERIOD_CYCLES = 23
"""The nine-disk row oscillates once in 22.2 cycles: a mean or an amplitude over this many spans a whole period."""

SAME_FORCE = 0.05
"""Spread that "roughly the same" allows: friction at the walls alone makes 1-3 %."""

NO_DILATION = 1e-9
"""Gap [m] up to which a sliding block of size 1 m has not dilated: round-off of the positions."""

SAME_OVERLAP = 1e-12
"""Difference of overlaps [m] that is round-off on grains of 1 m some ten metres from the origin: hundreds of last places."""

CONTACTS = ("fn_disk_disk_centre", "fn_disk_disk_edge", "fn_wall_mid", "fn_wall_corner")


class UndecidedError(Exception):
    """The cells at hand cannot decide the claim; the message says why."""


def _series(cell: CaseResult, quantity: str) -> NDArray[np.float64]:
    assert cell.observed is not None
    if quantity not in cell.observed.series:
        raise UndecidedError(f"the case does not observe {quantity}")
    values = np.asarray(cell.observed.series[quantity][1])
    if not np.isfinite(values[1:]).all():
        raise UndecidedError(f"the engine does not observe {quantity}")
    return values


def _scalar(cell: CaseResult, quantity: str) -> float:
    assert cell.observed is not None
    if quantity not in cell.observed.scalars:
        raise UndecidedError(f"the case does not observe {quantity}")
    value = cell.observed.scalars[quantity][1]
    if not math.isfinite(value):
        raise UndecidedError(f"the engine does not observe {quantity}")
    return value


def _groups(cells: Cells, varied: str) -> list[dict[Any, CaseResult]]:
    """Cells that differ in one parameter only, by its value."""
    groups: dict[str, dict[Any, CaseResult]] = {}
    for cell in cells:
        params = cell.params
        if varied not in params:
            raise UndecidedError(f"the case has no parameter {varied!r}")
        rest = {name: value for name, value in params.items() if name != varied}
        groups.setdefault(repr(sorted(rest.items())), {})[params[varied]] = cell
    return list(groups.values())


def same_settled_force(cells: Cells) -> Verdict:
    """Mean force over the last period, a1 to b2 at xi = 3; spread at each kind of contact at most `SAME_FORCE`."""
    damped = [cell for cell in cells if cell.params["xi"] == 3.0]
    groups = [group for group in _groups(damped, "load_case") if {"a1", "a2", "b1", "b2"} <= set(group)]
    if not groups:
        raise UndecidedError("it takes all four load cases with xi = 3")
    worst = 0.0
    for group in groups:
        for contact in CONTACTS:
            settled = [float(_series(cell, contact)[-PERIOD_CYCLES:].mean()) for cell in group.values()]
            worst = max(worst, (max(settled) - min(settled)) / float(np.mean(settled)))
    return (
        worst <= SAME_FORCE,
        f"largest spread of the settled force over a1, a2, b1, b2: {worst:.2%} (limit {SAME_FORCE:.0%})",
    )


def damping_reduces_oscillation(cells: Cells) -> Verdict:
    """Half the range of the force over the last period, xi = 3 against xi = 0, at each kind of contact."""
    pairs = [group for group in _groups(cells, "xi") if {0.0, 3.0} <= set(group)]
    if not pairs:
        raise UndecidedError("it takes the same variant with xi = 3 and xi = 0")
    ratios = []
    for pair in pairs:
        for contact in CONTACTS:
            damped, free = (float(np.ptp(_series(pair[xi], contact)[-PERIOD_CYCLES:])) for xi in (3.0, 0.0))
            ratios.append(damped / free if free > 0.0 else math.inf)
    return max(ratios) < 1.0, f"amplitude with xi = 3 over that with xi = 0: {min(ratios):.2g} to {max(ratios):.2g}"


def nurbs_overlap(cells: Cells) -> Verdict:
    """Overlaps of all pairs of circles given as NURBS outlines, against equation (2.5)."""
    circles = [cell for cell in cells if cell.params.get("shape") == "disk"]
    if not circles:
        raise UndecidedError("it takes the variant with disks")
    worst = max(float(_series(cell, "gap_error").max()) for cell in circles)
    return worst <= SAME_OVERLAP, f"largest difference of an overlap from Ri + Rj - |xj - xi|: {worst:.1e} m"


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
        for group in _groups(cells, varied):
            for low, high in combinations(sorted(group), 2):
                one, two = np.abs(_series(group[low], "fs_up")), np.abs(_series(group[high], "fs_up"))
                changes.append(float(np.abs(two - one).max() / max(one.max(), two.max())))
                rises &= varied != "phi_deg" or bool(two.max() > one.max())
        if not changes:
            raise UndecidedError(f"it takes two values of {varied}")
        least[varied] = min(changes)
    text = ", ".join(f"{name} changes Fs by at least {value:.1%}" for name, value in least.items())
    text += f"; the reference is uncertain by {uncertainty:.1e}; more friction gives {'a' if rises else 'no'} higher Fs"
    return min(least.values()) > uncertainty and rises, text


def _published(cells: Cells, quantities: Sequence[str], **wanted: Any) -> Verdict:
    """Whether the published values of some quantities are met in every variant that has them.

    A failed check contradicts. A known gap does not: there another truth says that this engine on this variant solves
    something else than the source did (a spring that is not quite plastic, a gap that is no whole number of steps).
    """
    found: dict[str, list[Row]] = {"fail": [], "known-gap": [], "pass": []}
    for cell in cells:
        if any(cell.params.get(name) != value for name, value in wanted.items()):
            continue
        for row in cell.rows:
            if row["truth"] == "published" and row["quantity"] in quantities and row["status"] != "no-truth":
                found["pass" if row["status"] == "gap-closed" else row["status"]].append(row)
    every = [row for rows in found.values() for row in rows]
    if not every:
        raise UndecidedError("no variant of this run has the published values")
    variants = {row["variant"] for row in every}
    missed = {row["variant"] for row in found["fail"] + found["known-gap"]}
    worst = max(found["fail"] or found["known-gap"] or found["pass"], key=lambda row: row["abs_error"])
    text = (
        f"holds in {len(variants - missed)} of {len(variants)} variants; largest error {worst['abs_error']:.1e} in "
        f"{worst['variant']}: {worst['quantity']} = {worst['value']:.9g} against {worst['expected']:.9g}"
    )
    if found["known-gap"] and not found["fail"]:
        raise UndecidedError(f"{text}; {worst['reason']}")
    return not found["fail"], text


def elastic_collision(cells: Cells) -> Verdict:
    """Energy, momentum and velocities after an elastic impact against the source's, with the checks' tolerances."""
    return _published(cells, ("energy_final", "momentum_x_final", "vx_1_final", "vx_2_final"), kind="elastic")


def plastic_collision(cells: Cells) -> Verdict:
    """The same for the plastic impact: momentum kept, energy halved, both disks at half the speed."""
    return _published(cells, ("energy_final", "momentum_x_final", "vx_1_final", "vx_2_final"), kind="plastic")


def _associated(cells: Cells) -> list[CaseResult]:
    """Cells that are not told to slide by Coulomb's law: the source's statements on dilation are about its own rule."""
    return [cell for cell in cells if cell.params.get("sliding", "associated") == "associated"]


def quasistatic_dilates_once(cells: Cells) -> Verdict:
    """The first increment lifts by mu du, the later ones by nothing, to 1e-9 of the lift (round-off of the solver)."""
    worst = 0.0
    for cell in _associated(cells):
        lift = cell.params["mu"] * abs(cell.params["increment"])
        gap = _series(cell, "gap")
        worst = max(worst, float(np.abs(gap[1:] - lift).max()) / lift if lift > 0.0 else 0.0)
    return worst <= 1e-9, f"largest difference of the gap after any increment from mu du, relative: {worst:.1e}"


def critical_time_step(cells: Cells) -> Verdict:
    """First rise: (A.4) above dt_cr, nothing below, to 1e-9 of mu v dt; both sides are needed."""
    worst, sides, lifted = 0.0, set(), False
    for cell in _associated(cells):
        p, rise = cell.params, _scalar(cell, "du_y_1")
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


def rotations_limit_dilation(cells: Cells) -> Verdict:
    """Gap of a disk that may rotate against one that may not: 0 at the end, and never larger."""
    pairs = [group for group in _groups(_associated(cells), "rotating") if {True, False} <= set(group)]
    if not pairs:
        raise UndecidedError("it takes the same throw with and without rotation")
    holds, largest = True, 0.0
    for pair in pairs:
        free, blocked = _series(pair[True], "gap"), _series(pair[False], "gap")
        if blocked.max() <= NO_DILATION:
            raise UndecidedError("this engine's sliding does not dilate, with or without rotation")
        largest = max(largest, float(free[-1]))
        holds &= bool((free <= blocked + NO_DILATION).all()) and abs(float(free[-1])) <= NO_DILATION
    return holds, f"final gap of the rotating disk: {largest:.2e} m; never above that of the non-rotating one: {holds}"


def dilation_shrinks(cells: Cells) -> Verdict:
    """At mu = 0.36 the gap grows, ends below 1 % of the distance slid, and falls in proportion to dt (within 5 %)."""
    groups = [
        group for group in _groups([c for c in _associated(cells) if c.params["mu"] == 0.36], "dt") if len(group) > 1
    ]
    if not groups:
        raise UndecidedError("it takes mu = 0.36 at two time steps at least")
    holds, share, ratios = True, 0.0, []
    for group in groups:
        ends = []
        for dt in sorted(group):
            gap, x = _series(group[dt], "gap"), _series(group[dt], "x")
            if gap[-1] <= NO_DILATION:
                raise UndecidedError("this engine's sliding does not dilate")
            holds &= bool((np.diff(gap) >= -NO_DILATION).all())
            share = max(share, float(gap[-1] / (x[-1] - x[0])))
            ends.append((dt, float(gap[-1])))
        ratios += [(two / one) / (b / a) for (a, one), (b, two) in pairwise(ends)]
    proportional = all(abs(ratio - 1.0) <= 0.05 for ratio in ratios)
    text = f"largest gap {share:.2%} of the distance slid; "
    text += f"gap over dt, from step to step: {min(ratios):.3f} to {max(ratios):.3f}"
    return holds and share < 0.01 and proportional, text


def contact_forces(cells: Cells) -> Verdict:
    """Mean forces over the second half at mu = 0.36 against m g (claimed) and m g cos (equilibrium), within 1 %.

    The two differ by 6 %, so 1 % tells them apart whatever the engine's scatter.
    """
    found = []
    for cell in cells:
        if cell.params["mu"] != 0.36 or cell.setup is None:
            continue
        scene = cell.setup.scene
        weight = float(scene.disks.mass[0] * np.hypot(*scene.gravity))
        normal = weight * math.cos(math.radians(cell.params["angle_deg"]))
        fn = _series(cell, "fn")
        mean = float(fn[len(fn) // 2 :].mean())
        found.append((mean, weight, normal))
    if not found:
        raise UndecidedError("it takes a variant with mu = 0.36")
    text = f"mean fn = {found[0][0]:.4f} N; m g = {found[0][1]:.4f} N, m g cos = {found[0][2]:.4f} N"
    if all(abs(mean - weight) <= 0.01 * weight for mean, weight, _ in found):
        return True, text
    if all(abs(mean - normal) <= 0.01 * normal for mean, _, normal in found):
        return False, text + ": the source's statement misses the factor cos(angle)"
    raise UndecidedError(f"neither within 1 %: {text}")


def block_stays(cells: Cells) -> Verdict:
    """Creep rate at mu = 0.4 against 0, with the tolerance of the engine's own check."""
    rows = [
        row for cell in cells if cell.params["mu"] == 0.4 for row in cell.rows
        if row["quantity"] == "creep_rate" and row["status"] != "no-truth"
    ]  # fmt: skip
    if not rows:
        raise UndecidedError("no variant with mu = 0.4 checks the creep rate")
    worst = max(rows, key=lambda row: row["abs_error"])
    text = f"largest creep rate {worst['value']:.2e} {worst['unit']} in {worst['variant']}"
    return all(row["status"] in ("pass", "gap-closed") for row in rows), text


RULES: Mapping[str, Callable[[Cells], Verdict]] = {
    "same-settled-force": same_settled_force,
    "damping-reduces-oscillation": damping_reduces_oscillation,
    "nurbs-overlap": nurbs_overlap,
    "friction-and-stiffness-ratio-shape-distortion": friction_and_stiffness_ratio,
    "elastic-collision-conserves": elastic_collision,
    "plastic-collision-conserves-momentum-only": plastic_collision,
    "quasistatic-dilates-once": quasistatic_dilates_once,
    "critical-time-step": critical_time_step,
    "rotations-limit-dilation": rotations_limit_dilation,
    "dilation-small-and-shrinks-with-dt": dilation_shrinks,
    "contact-forces-match-mg": contact_forces,
    "block-stays": block_stays,
}
"""Claim id -> rule."""
