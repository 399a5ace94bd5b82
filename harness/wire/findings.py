"""What engines that are known by their commands do otherwise (``docs/examples``); see `ninedisk.harness.api.finding`.

No registered engine stands behind these ids: they are measured where a store has cells that ``--engine-cmd`` ran.
"""

from ninedisk.harness.api.finding import Finding, Size

FINDINGS = (
    Finding(
        id="planck/elastic-bounces-grow",
        engine="planck",
        versions="1.5.0",
        what=(
            "A disk with restitution 1 bounces higher every time: the step of the impact adds gravity's whole step to the approach, "
            "and restitution gives it back."
        ),
        size=Size(
            case="impact/bouncing-disk",
            variant="restitution=1",
            quantity="energy",
            truth="analytic",
            over=0.02,
            over_why=(
                "a step's fall is g dt = 0.7 % of the speed of impact: 1.3 % of the energy, once; what exceeds that has grown from "
                "bounce to bounce"
            ),
        ),
        thread="https://github.com/piqnt/planck.js/issues/223",
        command="ninedisk run impact/bouncing-disk --engine-cmd 'node docs/examples/planck/planck_engine.mjs' --set restitution=1",
    ),
)
