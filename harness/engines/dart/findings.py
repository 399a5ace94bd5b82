"""What DART is known to do otherwise; see `ninedisk.harness.api.finding`."""

from ninedisk.harness.api.finding import Finding, Size

FINDINGS = (
    Finding(
        id="dart/contacts-give-way",
        engine="dart",
        versions="6.20.0",
        what=(
            "Every contact constraint is regularised (constraint force mixing): an elastic gas cools with every collision."
        ),
        size=Size(
            case="gas/elastic",
            variant="rows=3",
            quantity="kinetic_final",
            truth="analytic",
            over=1e-09,
            over_why="elastic impacts keep the energy to the round-off of some hundred collisions",
        ),
        command="ninedisk run gas/elastic --engine dart",
    ),
    Finding(
        id="dart/elastic-bounces-grow",
        engine="dart",
        versions="6.20.0",
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
        command="ninedisk run impact/bouncing-disk --engine dart --set restitution=1",
    ),
    Finding(
        id="dart/overlap-of-impact-stays",
        engine="dart",
        versions="6.20.0",
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
        command="ninedisk run impact/bouncing-disk --engine dart --set restitution=0",
    ),
    Finding(
        id="dart/creeps-at-rest",
        engine="dart",
        versions="6.20.0",
        what="Friction is regularised (constraint force mixing): a block that should stick creeps down the incline at a steady rate.",
        size=Size(
            table="headlines",
            case="incline-block",
            variant="mu=0.4,dt=0.01",
            quantity="distance down the incline",
            over=1e-9,
            over_why="a stuck block rests; engines with rigid contacts or shear springs leave it where it is, to round-off",
        ),
        command="ninedisk run incline-block --engine dart --set mu=0.4 --set dt=0.01",
    ),
)
