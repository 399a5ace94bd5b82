"""What LIGGGHTS is known to do otherwise; see `ninedisk.harness.api.finding`."""

from ninedisk.harness.api.finding import Finding, Size
from ninedisk.harness.api.shared_findings import (
    friction_while_pulled,
    plane_at_rest_at_first,
    ratchet,
    shear_keeps_twist,
)

FINDINGS = (
    ratchet(
        "liggghts",
        "3.8.0",
        variant="kind=pair,slip_at=middle,*",
        thread="https://github.com/uob-positron-imaging-centre/PICI-LIGGGHTS/pull/4",
    ),
    Finding(
        id="liggghts/shear-projection",
        versions="3.8.0",
        what=(
            "The tangential history is projected on the new tangent: it shrinks by half the square of the normal's rotation in each step."
        ),
        size=Size(
            case="contact/retraced-loop",
            variant="kind=pair,*arm=radius*",
            quantity="shear",
            truth="exact-step",
            over=1e-09,
            sign=-1,
            over_why="the exact steps of a law that turns the shear exactly; engines that do show round-off",
        ),
    ),
    friction_while_pulled("liggghts", "3.8.0"),
    Finding(
        id="liggghts/one-lever-arm",
        versions="3.8.0",
        what=(
            "The lever arm of shear forces on spheres is always R - overlap/2, at planes as well: an oblique impact turns the sphere by "
            "overlap/R less than with the arm R."
        ),
        size=Size(
            case="spheres/chung-ooi/4",
            variant="*angle=25,unloading=none*",
            quantity="spin_final",
            truth="converged",
            over=1e-5,
            sign=-1,
            over_why="the step's own error is 7e-3 rad/s of some 2,000",
        ),
    ),
    plane_at_rest_at_first("liggghts", "3.8.0"),
    shear_keeps_twist("liggghts", "3.8.0"),
)
