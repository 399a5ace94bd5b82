"""What PhysX, by SAPIEN, is known to do otherwise; see `ninedisk.harness.api.finding`."""

from ninedisk.harness.api.finding import Finding, Size

VERSION = "3.0.3"

FINDINGS = (
    Finding(
        id="sapien/impulses-of-other-contacts",
        versions=VERSION,
        what=(
            "The solver PGS reports the impulses of one contact as those of another: of a disk between floor and wall, the floor's as the "
            "wall's. The motion is right. The scene flag enhanced determinism makes it more frequent; TGS reports each rightly."
        ),
        size=Size(
            case="static/stack",
            variant="arrangement=pyramid,*",
            quantity="fn_wall_right",
            truth="analytic",
            over=1e-4,
            sign=1,
            over_why="a hundred sweeps leave 1e-5 of the forces; Bullet and Box2D report each of them to that",
        ),
        command="ninedisk run static/stack --engine sapien --set arrangement=pyramid",
    ),
    Finding(
        id="sapien/friction-pyramid",
        versions=VERSION,
        what=(
            "The solver PGS has a pyramid of friction whose axes are those of the velocity of the centres: what slips aside to that, as it "
            "spins or hits with a corner, is braked by up to 1.41 mu times the load, at up to 45 degrees to the slip. What slides without "
            "spin is braked rightly."
        ),
        size=Size(
            case="spheres/top",
            variant="kind=thrown,*",
            quantity="vx",
            truth="analytic",
            over=1e-3,
            over_why="Coulomb's friction is against the slip: MuJoCo and DART are right to 1e-4 here",
        ),
        command="ninedisk run spheres/top --engine sapien --set kind=thrown",
    ),
    Finding(
        id="sapien/boxes-rock",
        versions=VERSION,
        what=(
            "The boxes of a tower, turned against each other, need not come to rest on PGS: corners lift by up to 0.001 of the boxes' "
            "size and fall back. Which towers do so depends on the sweeps: with 100 over positions two of three, with 255 the third "
            "one. Other lengths, and contacts that are found anew in each step, do not change that."
        ),
        size=Size(
            case="box/stack",
            variant="slope_deg=15,order=upwards,size=1",
            quantity="creep",
            truth="analytic",
            over=1e-5,
            sign=1,
            over_why="friction holds every box: Bullet, Jolt and DART move less than 1e-6 m",
        ),
        command="ninedisk run box/stack --engine sapien --set slope_deg=15",
    ),
    Finding(
        id="sapien/box-turns-as-it-slides",
        versions=VERSION,
        what=(
            "A box that slides along some directions turns by 3e-4 rad: its friction acts at two of its corners, whose places are rounded; "
            "where their line is nearly across the motion a large turn takes the rounding out."
        ),
        size=Size(
            case="box/stop",
            variant="direction_deg=70,yaw_deg=20,mu=0.3",
            quantity="turned",
            truth="analytic",
            over=1e-5,
            over_why="Coulomb's friction has no moment about the normal here: MuJoCo and DART turn by 1e-6 at most",
        ),
        command="ninedisk run box/stop --engine sapien --set direction_deg=70",
    ),
    Finding(
        id="sapien/single-precision",
        versions=VERSION,
        what=(
            "Single precision: the normal force of a block that slides on a plane turned by 217 degrees is off by 1e-6."
        ),
        size=Size(
            case="invariance/rotation",
            variant="scene=slide,*",
            quantity="fn",
            truth="exact-step",
            over=1e-9,
            over_why="double precision leaves 1e-12 of the force",
        ),
        documented="PxReal, its type of numbers, is float",
    ),
)
