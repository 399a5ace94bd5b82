"""What the contact dynamics of ninedisk is known to do otherwise; see `ninedisk.harness.api.finding`."""

from ninedisk.harness.api.finding import Finding, Size

FINDINGS = (
    Finding(
        id="cd/sliding-lifts",
        versions="0.1.0",
        what=(
            "Under the source's associated rule a sliding particle leaves the surface, mu v dt high; sliding=coulomb does not."
        ),
        size=Size(
            table="headlines",
            case="sliding/dynamic",
            variant="dt=0.01,g0=0",
            quantity="lift of the sliding particle",
            over=1e-09,
            sign=1,
            over_why="under Coulomb's law friction lifts nothing; other engines leave the particle where it is, to round-off",
        ),
        documented="docs/reference/notation.md: the associated rule (A.2)",
    ),
    Finding(
        id="cd/restitution-depends-on-phase",
        versions="0.1.0",
        what=(
            "Under the theta scheme's own impact law the restitution depends on the moment of the impact within its step: e = 1 only "
            "where the gap is a whole number of v dt; impact=newton does not."
        ),
        size=Size(
            table="headlines",
            case="gas/elastic",
            variant="rows=3",
            quantity="energy kept",
            over=0.01,
            sign=-1,
            over_why="elastic impacts keep the energy: engines with rigid contacts to round-off, springs to 1e-3 by their step",
        ),
        documented="docs/reference/notation.md: Numerics.impact",
        command="ninedisk run gas/elastic --engine cd",
    ),
    Finding(
        id="cd/ratchet",
        versions="0.1.0",
        what=(
            "With slip_at=end a contact that goes to and fro on one path does not return to the shear force that it began with; "
            "slip_at=middle does."
        ),
        size=Size(
            case="contact/retraced-loop",
            variant="*slip_at=end*",
            column="value",
            quantity="drift",
            per="1",
            over=1e-05,
            over_why="net slip is 0; with slip_at=middle the solver's 2e-6 remain",
        ),
        documented="docs/reference/notation.md: slip_at",
    ),
)
