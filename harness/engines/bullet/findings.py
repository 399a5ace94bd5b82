"""What Bullet is known to do otherwise; see `ninedisk.harness.api.finding`."""

from ninedisk.harness.api.finding import Finding, Size

FINDINGS = (
    Finding(
        id="bullet/elastic-bounces-grow",
        versions="3.2.7",
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
    ),
    Finding(
        id="bullet/overlap-of-impact-stays",
        versions="3.2.7",
        what=(
            "An inelastic impact leaves the overlap that the step of the impact made, up to the speed times dt, for good: velocities "
            "alone are made to vanish."
        ),
        size=Size(
            case="impact/bouncing-disk",
            variant="restitution=0",
            column="abs_error",
            quantity="gap_final",
            per="gap",
            over=0.0001,
            over_why=(
                "at rest a spring of the scene's kn overlaps by m g/kn, 7e-5 of the height of fall, and a rigid contact by nothing"
            ),
        ),
    ),
    Finding(
        id="bullet/own-erp-adds-energy",
        versions="3.2.7",
        what=(
            "With Bullet's own error reduction (contact_erp 0.2) what takes an overlap out stays in the momentum: restitution 1 becomes "
            "more."
        ),
        size=Size(
            case="binary-collision",
            variant="kind=elastic,gap=0.5025*bullet.contact_erp=0.2*",
            quantity="restitution_effective",
            truth="analytic",
            over=1e-09,
            fails=True,
            over_why="an impact without gravity has the restitution that is asked for, to round-off, with contact_erp 0",
        ),
        thread="https://github.com/bulletphysics/bullet3/issues/3094",
        command=(
            "ninedisk run binary-collision --engine bullet --set kind=elastic --set gap=0.5025 --option bullet.contact_erp=0.2"
        ),
    ),
    Finding(
        id="bullet/friction-pyramid",
        versions="3.2.7",
        what=(
            "Without the implicit cone (enableConeFriction = 0) friction is a pyramid along the axes of space: across its edges it is 1.41 "
            "times mu fn and up to 45 degrees off the slip."
        ),
        size=Size(
            case="spheres/thornton",
            variant="law=linear,incidence=9*bullet.friction=pyramid*",
            quantity="vt_final",
            truth="analytic",
            over=1e-9,
            over_why="Coulomb's cone is the same in all directions: with it Bullet is right to round-off",
            fails=True,
        ),
        command="ninedisk run spheres/thornton --engine bullet --set law=linear --set incidence=9 --option bullet.friction=pyramid",
    ),
    Finding(
        id="bullet/order-of-walls",
        versions="3.2.7",
        what=(
            "Walls told in another order part spheres by a millionth of their radius within steps, spheres told in another order by a "
            "hundredth of that: sweeps over contacts end before their order does not matter. Disks of the plane keep within round-off."
        ),
        size=Size(
            table="determinism",
            case="determinism",
            variant="spheres/walls",
            column="difference",
            over=1e-8,
            over_why="what eight roundings in each step can have grown to when the difference shows is 6e-10, its growth measured",
        ),
        command="ninedisk determinism --engine bullet --spheres",
    ),
)
