"""Known differences of engines: what a case allows for them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ninedisk.core.numerics import Numerics
from ninedisk.harness.api.case import Check, KnownDifference, Setup
from ninedisk.harness.api.engine import Difference, EngineInfo

LIFTS = "sliding-lifts"
"""Words of the finding of engines whose sliding contacts open, see `follows_associated_rule`."""

FINDING_WORDS: Mapping[Difference, str] = {
    Difference.FIXED_WALL_SHEAR: "wall-shear-along-fixed-axes",
    Difference.KEEPS_OPENED_SHEAR: "opened-contact-keeps-shear",
    Difference.FRICTION_LAGS: "slides-without-friction-at-first",
    Difference.ARM_LESS_OVERLAP: "arm-less-the-overlap",
    Difference.DASHPOT_NEVER_PULLS: "dashpot-never-pulls",
    Difference.FRICTION_WHILE_PULLED: "friction-while-pulled",
    Difference.SPRINGS_TURN_WITH_TWIST: "springs-turn-with-twist",
    Difference.SHEAR_KEEPS_TWIST: "shear-keeps-twist",
    Difference.SHEAR_KEEPS_DIRECTION: "shear-keeps-direction",
    Difference.RESISTANCES_SHARE_CONE: "resistances-share-cone",
    Difference.NECK_PARTS_AT_LARGEST_PULL: "neck-parts-at-largest-pull",
    Difference.BOX_FRICTION_ASKEW: "friction-of-a-box-askew",
    Difference.MISSED_TOLERANCE_GIVES_PYRAMID: "missed-tolerance-gives-a-pyramid",
    Difference.FRICTION_PYRAMID: "friction-pyramid",
    Difference.FRICTION_AT_TWO_CORNERS: "box-turns-as-it-slides",
    Difference.IMPULSES_OF_OTHERS: "impulses-of-other-contacts",
    Difference.BOXES_ROCK: "boxes-rock",
    Difference.NORMAL_TURNS_IN_IMPACT: "elastic-gas-gains-energy",
}
"""Words by which the finding of an engine with such a difference is called: its id is ``<engine>/<words>``. The others are models of a
contact that choose the truth which binds the engine."""


def excused_checks(right: Sequence[Check], wide: Sequence[Check], finding: str) -> list[Check]:
    """Checks that a right engine has to meet, each with what a known difference explains beyond that.

    Parameters
    ----------
    right, wide : sequence of Check
        Of an engine without the difference, and with what the difference adds. A check that ``right`` alone has is left out, as nobody
        has derived what the difference does to it; one that ``wide`` alone has stays as it is.
    finding : str
        Id of the finding.
    """
    tight = {(check.quantity, check.norm, check.truth): check for check in right}
    found = []
    for check in wide:
        own = tight.get((check.quantity, check.norm, check.truth), check)
        size, least = _allowance(check), _allowance(own)
        found.append(
            replace(own, known=KnownDifference(finding=finding, size=size, why=check.why)) if size > least else own
        )
    return found


def _allowance(check: Check) -> float:
    known = np.abs(np.asarray(check.expected, dtype=np.float64))
    largest = float(known[np.isfinite(known)].max(initial=check.scale))
    return max(check.atol + check.rtol * largest, check.known.size if check.known else 0.0)


def checks_with_allowance(
    difference: Difference | str,
    setup: Setup,
    engine: EngineInfo,
    checks: Callable[[Setup, EngineInfo], Sequence[Check]],
) -> list[Check]:
    """``checks(setup, engine)``; where the engine has ``difference``, those of one without it, `excused_checks` by it.

    ``difference`` is a declared one, or `LIFTS`.
    """
    wide = checks(setup, engine)
    if isinstance(difference, Difference):
        if difference not in engine.differences:
            return list(wide)
        others = {each: why for each, why in engine.differences.items() if each is not difference}
        right, words = checks(setup, replace(engine, differences=others)), FINDING_WORDS[difference]
    else:
        if not follows_associated_rule(engine, setup.numerics):
            return list(wide)
        parallel = replace(setup, numerics=replace(setup.numerics, sliding="coulomb"))
        right, words = checks(parallel, replace(engine, dilates=False)), difference
    return excused_checks(right, wide, f"{engine.id}/{words}")


def follows_associated_rule(engine: EngineInfo, numerics: Numerics) -> bool:
    """Whether a sliding contact of this run opens: contact dynamics that is set so, and convex contact models."""
    return engine.dilates or (engine.contact == "cd" and numerics.sliding == "associated")
