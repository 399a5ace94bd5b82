"""The source's figures and claims of a thrown or spun disk: what is shown, what is claimed, and what decides a claim."""

from __future__ import annotations

from ninedisk.harness.api.claims import NO_DILATION, Cells, Claim, UndecidedError, Verdict, associated, by_value, series
from ninedisk.harness.results.figures import Figure, Plotted


def rotations_limit_dilation(cells: Cells) -> Verdict:
    """Gap of a disk that may rotate against one that may not: 0 at the end, and never larger."""
    pairs = [group for group in by_value(associated(cells), "rotating") if {True, False} <= set(group)]
    if not pairs:
        raise UndecidedError("it takes the same throw with and without rotation")
    holds, largest = True, 0.0
    for pair in pairs:
        free, blocked = series(pair[True], "gap"), series(pair[False], "gap")
        if blocked.max() <= NO_DILATION:
            raise UndecidedError("this engine's sliding does not dilate, with or without rotation")
        largest = max(largest, float(free[-1]))
        holds &= bool((free <= blocked + NO_DILATION).all()) and abs(float(free[-1])) <= NO_DILATION
    return holds, f"final gap of the rotating disk: {largest:.2e} m; never above that of the non-rotating one: {holds}"


SLIP_TO_ROLL_FIGURES: tuple[Figure, ...] = (
    Figure(
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
)

SLIP_TO_ROLL_CLAIMS: tuple[Claim, ...] = (
    Claim(
        id="rotations-limit-dilation",
        place="A.3.3",
        text=(
            "the inclusion of rotations further limits dilation in the sense that tangential motion can "
            "be accommodated not only by sliding [...], but also by rolling [...]"
        ),
        decided_by=(
            "Gap of a disk that may rotate and of one that may not, same throw: confirmed if the rotating"
            " disk's gap is 0 once it rolls and never exceeds the other's while that one slides."
        ),
        rule=rotations_limit_dilation,
        derivation=(
            "Under the associated rule the gap after a step is mu times the slip of the step, so it vanishes once the disk "
            "rolls. An engine whose disk keeps a larger gap than the one that cannot turn dilates for another reason.",
        ),
    ),
)

SPINNING_DISK_FIGURES: tuple[Figure, ...] = (
    Figure(
        title="From spinning to rolling",
        quantities=(
            Plotted("vx", "velocity along x"),
            Plotted("spin", "spin"),
            Plotted("energy", "kinetic energy"),
        ),
        compare="dt",
        shows="A disk put on a plane with a spin and no velocity; friction drives it.",
        allows=(
            "It rolls at R omega0/3 from t = R omega0/(3 mu g) on and has lost two thirds of its energy, whatever mu."
        ),
    ),
)
