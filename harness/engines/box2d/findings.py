"""What Box2D is known to do otherwise; see `ninedisk.harness.api.finding`."""

from ninedisk.harness.api.finding import Finding, Size
from ninedisk.harness.api.shared_findings import elastic_bounces_grow

FINDINGS = (
    elastic_bounces_grow("box2d", "2.3.10", thread="https://github.com/erincatto/box2d/issues/167"),
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
        what="Given in another order, the disks of a pile move otherwise from the first step on in which several touch each other.",
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
