"""What Kratos DEM is known to do otherwise; see `ninedisk.harness.api.finding`."""

from ninedisk.harness.api.finding import Finding, Size

FINDINGS = (
    Finding(
        id="kratos/ratchet",
        engine="kratos",
        versions="10.4.4",
        what=(
            "A contact that goes to and fro on one path does not return to the shear force that it began with: slip of half steps is "
            "added along the normal of the step's end, an error of first order that grows with every cycle."
        ),
        size=Size(
            case="contact/retraced-loop",
            variant="kind=pair,*",
            column="value",
            quantity="drift",
            per="1",
            over=1e-05,
            over_why=(
                "net slip is 0; with the normal of the middle of a step O(dt^4) remains, 1e-10 of the amplitude here, and 2e-6 of an "
                "iterative solver"
            ),
        ),
        command="ninedisk run contact/retraced-loop --engine kratos --set kind=pair",
    ),
    Finding(
        id="kratos/arm-at-walls",
        engine="kratos",
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
        command="ninedisk run contact/reopening --engine kratos --set pair=wall --set arm=overlap",
    ),
    Finding(
        id="kratos/wall-shear-along-fixed-axes",
        engine="kratos",
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
        command="ninedisk run contact/retraced-loop --engine kratos --set kind=wall",
    ),
    Finding(
        id="kratos/opened-contact-keeps-shear",
        engine="kratos",
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
        command="ninedisk run contact/reopening --engine kratos --set pair=disks",
    ),
    Finding(
        id="kratos/new-contact-not-listed",
        engine="kratos",
        versions="10.4.4",
        what=(
            "The contacts that Kratos lists at a sample depend on the order in which disks are told: the motion is the same to the last"
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
        command="ninedisk determinism --engine kratos",
    ),
    Finding(
        id="kratos/shear-keeps-twist",
        engine="kratos",
        versions="10.4.4",
        what=(
            "Shear forces of spheres turn with the normal and not about it: where bodies in contact turn as one about an axis along the "
            "normal, the force keeps a direction that both have left."
        ),
        size=Size(
            table="headlines",
            case="spheres/turned",
            variant="kind=spun,axis=across",
            quantity="shear force that turned",
            over=0.02,
            over_why="forces turned to first order are off by half the square of each step's rotation, 1 % of the force in a turn",
        ),
        command="ninedisk run spheres/turned --engine kratos --set kind=spun",
    ),
)
