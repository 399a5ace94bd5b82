"""What LAMMPS is known to do otherwise; see `ninedisk.harness.api.finding`."""

from ninedisk.harness.api.finding import Finding, Size
from ninedisk.harness.api.shared_findings import (
    friction_while_pulled,
    plane_at_rest_at_first,
    ratchet,
    shear_keeps_twist,
)

FINDINGS = (
    ratchet(
        "lammps",
        "2025.7.22.4.0",
        variant="kind=pair,slip_at=middle,*",
        documented="examples/granular/in.sync_verlet shows the remedy (synchronized_verlet), which is not the default",
        thread="https://github.com/lammps/lammps/pull/4351",
    ),
    Finding(
        id="lammps/classic-shear-projection",
        versions="2025.7.22.4.0",
        what=(
            "gran/hooke/history projects the shear displacement on the new tangent: it shrinks by half the square of the normal's "
            "rotation in each step; pair_style granular does not."
        ),
        size=Size(
            case="contact/retraced-loop",
            variant="kind=pair,*arm=radius*",
            quantity="shear",
            truth="exact-step",
            over=1e-09,
            sign=-1,
            over_why="the exact steps of a law that turns the shear exactly; pair_style granular shows round-off",
        ),
    ),
    Finding(
        id="lammps/two-lever-arms",
        versions="2025.7.22.4.0",
        what=(
            "pair_style granular uses R - overlap/2 as the arm of the torque, and R for the slip by rotation, so that work and slip do "
            "not belong together."
        ),
        size=Size(
            case="nine-disk/distortion",
            variant="*lever_arm=overlap",
            quantity="fs_up",
            truth="converged",
            over=0.01,
            sign=1,
            over_why=(
                "the disks overlap by 8 % of the radius, half of which is the difference of the arms; the step's own error is at most 0.6"
                " %"
            ),
        ),
    ),
    friction_while_pulled("lammps", "2025.7.22.4.0"),
    Finding(
        id="lammps/neck-parts-at-largest-pull",
        engine="lammps",
        versions="2025.7.22.4.0",
        what=(
            "With jkr the neck parts where it pulls most, as it does under a dead load, and not at the end of its stable branch, where the "
            "distance is what is given, as between spheres in flight: an approach and separation loses 0.49 of the closed form, the speed "
            "below which spheres stick is 0.70 of it."
        ),
        size=Size(
            case="spheres/jkr",
            variant="speed=2*",
            quantity="loss",
            truth="analytic",
            over=0.1,
            sign=-1,
            over_why="the first step of the contact and the one in which it parts err by less than 0.02 of the loss",
        ),
        documented="https://docs.lammps.org/pair_granular.html",
        command="ninedisk run spheres/jkr --engine lammps --set speed=2",
    ),
    plane_at_rest_at_first("lammps", "2025.7.22.4.0"),
    Finding(
        id="lammps/samples-of-spheres-change-bits",
        versions="2025.7.22.4.0",
        what="Spheres that are sampled less often move otherwise by round-off: each run command sets up its lists and sums anew.",
        size=Size(
            table="determinism",
            case="determinism",
            variant="spheres/sampled",
            column="difference",
            over=1e-16,
            over_why="looking at a run less often changes nothing of it: every bit should be the same",
        ),
        command="ninedisk determinism --engine lammps --spheres",
    ),
    shear_keeps_twist("lammps", "2025.7.22.4.0", kind="plane", axis="skew"),
)
