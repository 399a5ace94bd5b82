"""What LIGGGHTS is known to do otherwise; see `ninedisk.harness.api.finding`."""

from ninedisk.harness.api.finding import Finding, Size

FINDINGS = (
    Finding(
        id="liggghts/ratchet",
        engine="liggghts",
        versions="3.8.0",
        what=(
            "A contact that goes to and fro on one path does not return to the shear force that it began with: slip of half steps is "
            "added along the normal of the step's end, an error of first order that grows with every cycle."
        ),
        size=Size(
            case="contact/retraced-loop",
            variant="kind=pair,slip_at=middle,*",
            column="value",
            quantity="drift",
            per="1",
            over=1e-05,
            over_why=(
                "net slip is 0; with the normal of the middle of a step O(dt^4) remains, 1e-10 of the amplitude here, and 2e-6 of an "
                "iterative solver"
            ),
        ),
        thread="https://github.com/uob-positron-imaging-centre/PICI-LIGGGHTS/pull/4",
        command="ninedisk run contact/retraced-loop --engine liggghts --set kind=pair --set slip_at=middle",
    ),
    Finding(
        id="liggghts/shear-projection",
        engine="liggghts",
        versions="3.8.0",
        what=(
            "The tangential history is projected on the new tangent: it shrinks by half the square of the normal's rotation in each step."
        ),
        size=Size(
            case="contact/retraced-loop",
            variant="kind=pair,*arm=radius*",
            quantity="shear",
            truth="exact-step",
            over=1e-09,
            over_why="the exact steps of a law that turns the shear exactly; engines that do show round-off",
        ),
        command="ninedisk run contact/retraced-loop --engine liggghts --set kind=pair --set arm=radius",
    ),
)
