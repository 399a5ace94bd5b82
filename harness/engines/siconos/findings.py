"""What Siconos is known to do otherwise; see `ninedisk.harness.api.finding`."""

from ninedisk.harness.api.finding import Finding, Size
from ninedisk.harness.api.shared_findings import overlap_of_impact_stays

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
            sign=1,
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
    overlap_of_impact_stays("siconos", "4.5.0"),
)
