"""What DART is known to do otherwise; see `ninedisk.harness.api.finding`."""

from ninedisk.harness.api.finding import Finding, Size

FINDINGS = (
    Finding(
        id="dart/contacts-give-way",
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
    ),
    Finding(
        id="dart/overlap-of-impact-stays",
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
    ),
    Finding(
        id="dart/creeps-at-rest",
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
    ),
    Finding(
        id="dart/arm-less-the-overlap",
        versions="6.20.0",
        what=(
            "Friction of a sphere on a plane acts at the plane, at an arm that the overlap shortens: after an impact, whose step made an "
            "overlap of up to the speed times dt, the sphere spins the less for it."
        ),
        size=Size(
            case="spheres/thornton",
            variant="law=linear,incidence=9",
            quantity="spin_final",
            truth="analytic",
            over=1e-4,
            over_why="contacts give way by 1e-5, twice in an elastic impact; Bullet and Siconos spin up to round-off",
        ),
    ),
    Finding(
        id="dart/friction-pyramid",
        versions="6.20.0",
        what=(
            "With DART's own solver, dantzig, friction is a pyramid along the axes of space: across its edges it is 1.41 times mu fn and "
            "up to 45 degrees off the slip."
        ),
        size=Size(
            case="spheres/thornton",
            variant="law=linear,incidence=9*dart.solver=dantzig*",
            quantity="vt_final",
            truth="analytic",
            over=1e-4,
            over_why="Coulomb's cone is the same in all directions: 1e-5 is left by the solver nsgs",
            fails=True,
        ),
        command="ninedisk run spheres/thornton --engine dart --set law=linear --set incidence=9 --option dart.solver=dantzig",
    ),
)
