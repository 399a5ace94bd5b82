"""What Box2D is known to do otherwise; see `ninedisk.harness.api.finding`."""

from ninedisk.harness.api.finding import Finding, Size

FINDINGS = (
    Finding(
        id="box2d/elastic-bounces-grow",
        versions="2.3.10",
        what=(
            "A disk with restitution 1 bounces higher every time: the step of the impact adds gravity's whole step to the approach, and "
            "restitution gives it back."
        ),
        size=Size(
            case="impact/bouncing-disk",
            variant="restitution=1",
            quantity="energy",
            truth="analytic",
            over=0.02,
            over_why=(
                "a step's fall is g dt = 0.7 % of the speed of impact: 1.3 % of the energy, once; what exceeds that has grown from bounce"
                " to bounce"
            ),
        ),
        thread="https://github.com/erincatto/box2d/issues/167",
    ),
    Finding(
        id="box2d/single-precision",
        versions="2.3.10",
        what=(
            "Single precision: seen by an observer who moves along at three metres a second, a slow slide is right to four digits only."
        ),
        size=Size(
            case="invariance/galilei",
            variant="scene=slide,*",
            quantity="vx_final",
            truth="exact-step",
            over=1e-09,
            over_why="double precision leaves 1e-12 of the slide's speed beside the observer's",
        ),
        documented="the type float32 of its API",
    ),
    Finding(
        id="box2d/order-of-bodies",
        versions="2.3.10",
        what="Told in another order, the disks of a pile move otherwise from the first step on in which several touch each other.",
        size=Size(
            table="determinism",
            case="determinism",
            variant="bodies",
            column="difference",
            over=1.6e-4,
            over_why="what eight roundings of single precision in the step in which it begins can be, in radii",
        ),
    ),
)
