"""What LAMMPS is known to do otherwise; see `ninedisk.harness.api.finding`."""

from ninedisk.harness.api.finding import Finding, Size

FINDINGS = (
    Finding(
        id="lammps/ratchet",
        engine="lammps",
        versions="2025.7.22.4.0",
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
        documented="examples/granular/in.sync_verlet shows the remedy (synchronized_verlet), which is not the default",
        thread="https://github.com/lammps/lammps/pull/4351",
        command="ninedisk run contact/retraced-loop --engine lammps --set kind=pair --set slip_at=middle",
    ),
    Finding(
        id="lammps/classic-shear-projection",
        engine="lammps",
        versions="2025.7.22.4.0",
        what=(
            "gran/hooke/history projects the shear displacement on the new tangent: it shrinks by half the square of the normal's "
            "rotation in each step; pair_style granular does not."
        ),
        size=Size(
            case="contact/retraced-loop",
            variant="kind=pair,*arm=radius*",
            quantity="shear",
            truth="exact-step",
            over=1e-09,
            over_why="the exact steps of a law that turns the shear exactly; pair_style granular shows round-off",
        ),
        command="ninedisk run contact/retraced-loop --engine lammps --set kind=pair --set arm=radius",
    ),
    Finding(
        id="lammps/two-lever-arms",
        engine="lammps",
        versions="2025.7.22.4.0",
        what=(
            "pair_style granular uses R - overlap/2 as the arm of the torque, and R for the slip by rotation, so that work and slip do "
            "not belong together."
        ),
        size=Size(
            case="nine-disk/distortion",
            variant="*lever_arm=overlap",
            quantity="fs_up",
            truth="converged",
            over=0.01,
            over_why=(
                "the disks overlap by 8 % of the radius, half of which is the difference of the arms; the step's own error is at most 0.6"
                " %"
            ),
        ),
        command="ninedisk run nine-disk/distortion --engine lammps --set lever_arm=overlap",
    ),
    Finding(
        id="lammps/friction-while-pulled",
        engine="lammps",
        versions="2025.7.22.4.0",
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
        command="ninedisk run spheres/thornton --engine lammps --set law=linear --set incidence=9 --set restitution=0.5",
    ),
    Finding(
        id="lammps/plane-at-rest-at-first",
        engine="lammps",
        versions="2025.7.22.4.0",
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
        command=(
            "ninedisk run spheres/invariance/galilei --engine lammps --set scene=heap --set frame_vx=3 --set frame_vy=-2 "
            "--set frame_vz=1"
        ),
    ),
    Finding(
        id="lammps/samples-of-spheres-change-bits",
        engine="lammps",
        versions="2025.7.22.4.0",
        what="Spheres that are sampled less often move otherwise by round-off: each run command sets up its lists and sums anew.",
        size=Size(
            table="determinism",
            case="determinism",
            variant="spheres/sampled",
            column="difference",
            over=1e-16,
            over_why="looking at a run less often changes nothing of it: every bit should be the same",
        ),
        command="ninedisk determinism --engine lammps --spheres",
    ),
    Finding(
        id="lammps/shear-keeps-twist",
        engine="lammps",
        versions="2025.7.22.4.0",
        what=(
            "Shear forces of spheres turn with the normal and not about it: where bodies in contact turn as one about an axis along the "
            "normal, the force keeps a direction that both have left."
        ),
        size=Size(
            table="headlines",
            case="spheres/turned",
            variant="kind=plane,axis=skew",
            quantity="shear force that turned",
            over=0.02,
            over_why="forces turned to first order are off by half the square of each step's rotation, 1 % of the force in a turn",
        ),
        command="ninedisk run spheres/turned --engine lammps --set kind=plane --set axis=skew",
    ),
)
