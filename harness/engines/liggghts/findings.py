"""What LIGGGHTS is known to do otherwise; see `ninedisk.harness.api.finding`."""

from ninedisk.harness.api.finding import Finding, Size

FINDINGS = (
    Finding(
        id="liggghts/ratchet",
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
    ),
    Finding(
        id="liggghts/shear-projection",
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
    ),
    Finding(
        id="liggghts/friction-while-pulled",
        versions="3.8.0",
        what=(
            "Friction is cut off at mu times the size of the normal force. A dashpot that pulls at the end of a contact therefore rubs as "
            "hard as one that pushes: an oblique rebound loses mu (e_0 - e) of the normal speed too much along the surface."
        ),
        size=Size(
            case="spheres/thornton",
            variant="law=linear,incidence=9*restitution=0.5*",
            quantity="vt_final",
            truth="analytic",
            over=0.004,
            over_why="the step's own error is at most 0.0098 m/s of the first 2.25 m/s along the plane and 1 m/s across it",
        ),
        command="ninedisk run spheres/thornton --engine liggghts --set law=linear --set incidence=9 --set restitution=0.5",
    ),
    Finding(
        id="liggghts/one-lever-arm",
        versions="3.8.0",
        what=(
            "The lever arm of shear forces on spheres is always R - overlap/2, at planes as well: an oblique impact turns the sphere by "
            "overlap/R less than with the arm R."
        ),
        size=Size(
            case="spheres/chung-ooi/4",
            variant="*angle=25,unloading=none*",
            quantity="spin_final",
            truth="converged",
            over=1e-5,
            over_why="the step's own error is 7e-3 rad/s of some 2,000",
        ),
    ),
    Finding(
        id="liggghts/plane-at-rest-at-first",
        versions="3.8.0",
        what=(
            "A plane that moves along its normal from the begin of a run, together with what rests on it, gives that a kick in the first "
            "step: the speed that its dashpots see is that of a plane at rest."
        ),
        size=Size(
            case="spheres/invariance/galilei",
            variant="scene=heap,frame_vx=3,frame_vy=-2,frame_vz=1",
            quantity="down",
            truth="analytic",
            over=1.6e-6,
            over_why="what springs that begin without shear move the heap by, 7.9e-7 m, over the radius",
            fails=True,
        ),
    ),
    Finding(
        id="liggghts/shear-keeps-twist",
        engine="liggghts",
        versions="3.8.0",
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
        command="ninedisk run spheres/turned --engine liggghts --set kind=spun",
    ),
)
