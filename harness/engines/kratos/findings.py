"""What Kratos DEM is known to do otherwise; see `ninedisk.harness.api.finding`."""

from ninedisk.harness.api.finding import Finding, Size
from ninedisk.harness.api.shared_findings import dashpot_never_pulls, ratchet, shear_keeps_twist

FINDINGS = (
    ratchet("kratos", "10.4.4", variant="kind=pair,*"),
    Finding(
        id="kratos/arm-at-walls",
        versions="10.4.4",
        what="The lever arm at a wall is R - overlap, between disks R - overlap/2.",
        size=Size(
            case="contact/reopening",
            variant="pair=wall,arm=overlap",
            quantity="fs",
            truth="exact-step",
            over=0.0001,
            over_why=(
                "the arm differs by half of an overlap of 0.3 % of the radius; the exact steps of the asked arm agree to the integrator's"
                " start"
            ),
        ),
    ),
    Finding(
        id="kratos/wall-shear-along-fixed-axes",
        versions="10.4.4",
        what=(
            "Shear forces at a wall keep their direction in space: where the wall turns they gain the normal force times its rotation, up"
            " to the friction limit."
        ),
        size=Size(
            case="contact/retraced-loop",
            variant="kind=wall,*",
            quantity="shear",
            truth="exact-step",
            over=0.001,
            over_why=(
                "the exact steps of a shear force that turns with its wall; engines that turn it to first order differ by 8e-5"
            ),
        ),
    ),
    Finding(
        id="kratos/opened-contact-keeps-shear",
        versions="10.4.4",
        what=(
            "Disks that part and meet again go on from the shear force of their last contact, as long as they stay within the search "
            "tolerance."
        ),
        size=Size(
            case="contact/reopening",
            variant="pair=disks,*",
            quantity="fs",
            truth="analytic",
            over=0.05,
            over_why="a contact begins without shear; the step's own error is 0.4 %, an arm that differs adds 0.5 %",
        ),
    ),
    Finding(
        id="kratos/new-contact-not-listed",
        versions="10.4.4",
        what=(
            "The contacts that Kratos lists at a sample depend on the order in which disks are given: the motion is the same to the last"
            " bit, and the elastic energy of those listed is not."
        ),
        size=Size(
            table="determinism",
            case="determinism",
            variant="bodies",
            column="difference",
            over=1e-12,
            over_why="energies are sums over contacts: round-off",
        ),
    ),
    shear_keeps_twist("kratos", "10.4.4"),
    dashpot_never_pulls("kratos", "10.4.4", "Hertz_viscous_Coulomb, Linear_Custom_Constants"),
)
