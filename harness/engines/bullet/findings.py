"""What Bullet is known to do otherwise; see `ninedisk.harness.api.finding`."""

from ninedisk.harness.api.finding import Finding, Size
from ninedisk.harness.api.shared_findings import elastic_bounces_grow, free_rotation_gains, overlap_of_impact_stays

FINDINGS = (
    elastic_bounces_grow("bullet", "3.2.7"),
    overlap_of_impact_stays("bullet", "3.2.7"),
    free_rotation_gains("bullet", "3.2.7"),
    Finding(
        id="bullet/friction-of-a-box-askew",
        versions="3.2.7",
        what=(
            "With the implicit cone friction on a box is not against its slip: it slides off a straight line by up to a tenth of its path, "
            "and turns. Spheres slide straight."
        ),
        size=Size(
            case="box/stop",
            variant="direction_deg=45,yaw_deg=20,mu=0.3",
            quantity="across",
            truth="analytic",
            over=1e-6,
            over_why="Coulomb's friction has no moment about the normal here: MuJoCo, DART and Drake go straight to 1e-6 of the path",
        ),
        command="ninedisk run box/stop --engine bullet --set direction_deg=45",
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
            sign=1,
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
            sign=-1,
            over_why="Coulomb's cone is the same in all directions: with it Bullet is right to round-off",
            fails=True,
        ),
        command="ninedisk run spheres/thornton --engine bullet --set law=linear --set incidence=9 --option bullet.friction=pyramid",
    ),
    Finding(
        id="bullet/order-of-walls",
        versions="3.2.7",
        what=(
            "Walls given in another order part spheres by a millionth of their radius within steps, spheres given in another order by a "
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
