"""What Siconos is known to do otherwise; see `ninedisk.harness.api.finding`."""

from ninedisk.harness.api.finding import Finding, Size

FINDINGS = (
    Finding(
        id="siconos/elastic-gas-gains-energy",
        versions="4.5.0",
        what=(
            "An elastic gas gains energy: restitution takes the approach along the line of centres at the begin of a step, the impulse "
            "acts along that at its end."
        ),
        size=Size(
            table="headlines",
            case="gas/elastic",
            variant="rows=3",
            quantity="energy kept",
            over=0.01,
            over_why="elastic impacts keep the energy: engines with rigid contacts to round-off, springs to 1e-3 by their step",
        ),
        command="ninedisk run gas/elastic --engine siconos",
    ),
    Finding(
        id="siconos/lemke-takes-another-contacts-friction",
        versions="4.5.0",
        what=(
            "Lemke's method (fc2d_lemke) sets its problem up with the wrong contact's friction coefficient where coefficients differ, and"
            " reports success; the adapter refuses what then misses the tolerance."
        ),
        size=Size(
            table="cells",
            case="strength/hexagonal",
            variant="speed=0.01*siconos.solver=lemke*",
            column="broken",
            over=0.0,
            over_why="the share of cells that end without an answer; Gauss-Seidel (nsgs) answers in each",
        ),
        command="ninedisk run strength/hexagonal --engine siconos --set speed=0.01 --option siconos.solver=lemke",
    ),
    Finding(
        id="siconos/overlap-of-impact-stays",
        versions="4.5.0",
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
)
