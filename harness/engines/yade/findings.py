"""What YADE is known to do otherwise; see `ninedisk.harness.api.finding`."""

from ninedisk.harness.api.finding import Finding, Size
from ninedisk.harness.api.shared_findings import dashpot_never_pulls, ratchet

FINDINGS = (
    Finding(
        id="yade/first-order-turn",
        versions="2023.02a",
        what=(
            "ScGeom::rotate turns a shear force with the contact normal to first order: it grows by half the square of the rotation in "
            "each step, whatever happens."
        ),
        size=Size(
            case="invariance/objectivity",
            variant="*",
            quantity="fs_bottom",
            truth="analytic",
            over=0.0001,
            sign=1,
            over_why="forces turn with the box unchanged: 1e-13 where the rotation is exact, 2e-6 of an iterative solver",
        ),
    ),
    ratchet("yade", "2023.02a", variant="kind=wall,slip_at=middle,*"),
    Finding(
        id="yade/one-lever-arm",
        versions="2023.02a",
        what=(
            "The lever arm of shear forces is always R - overlap/2: at dense packing it differs from a law with arm R by per cents of the"
            " shear force."
        ),
        size=Size(
            case="nine-disk/distortion",
            variant="*lever_arm=radius",
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
    dashpot_never_pulls("yade", "2023.02a", "MindlinPhys, ViscElPhys"),
    Finding(
        id="yade/springs-turn-with-twist",
        versions="2023.02a",
        what=(
            "Bending moments of a sphere that twists turn with half of its spin about the normal: the torque that resists rolling leaves "
            "the direction of rolling and drives the sphere aside."
        ),
        size=Size(
            case="spheres/rolling-resistance",
            variant="model=elastic-plastic,plane=twisting",
            quantity="beside",
            truth="analytic",
            over=0.01,
            over_why="swings of an unloaded shear spring: 0.0034 of 0.4 m/s",
        ),
    ),
)
