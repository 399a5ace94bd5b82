"""What Jolt is known to do otherwise; see `ninedisk.harness.api.finding`."""

from ninedisk.harness.api.finding import Finding, Size

VERSION = "1.1.0"

FINDINGS = (
    Finding(
        id="jolt/arm-less-the-overlap",
        versions=VERSION,
        what=(
            "Friction of a sphere acts midway in the overlap that the step of an impact makes, at an arm that is shorter by half of it: "
            "the sphere spins the less for it."
        ),
        size=Size(
            case="spheres/thornton",
            variant="law=linear,incidence=9",
            quantity="spin_final",
            truth="analytic",
            over=1e-5,
            sign=-1,
            over_why="round-off of single precision is 1.6e-6 here; Bullet spins up to round-off",
        ),
    ),
    Finding(
        id="jolt/friction-of-a-box-askew",
        versions=VERSION,
        what=(
            "Friction of a box with a long and a short side is not against its slip: it leaves its line by up to 4 % of its path "
            "without turning. A box with a square face goes straight."
        ),
        size=Size(
            case="box/stop",
            variant="direction_deg=15,yaw_deg=20,mu=0.7",
            quantity="across",
            truth="analytic",
            over=1e-5,
            over_why="Coulomb's friction has no moment about the normal here: MuJoCo, DART and Drake go straight to 1e-6 of the path",
        ),
        command="ninedisk run box/stop --engine jolt --set direction_deg=15",
    ),
    Finding(
        id="jolt/single-precision",
        versions=VERSION,
        what=(
            "Single precision: seen by an observer who moves along at three metres a second, a slow slide is right to two digits only."
        ),
        size=Size(
            case="invariance/galilei",
            variant="scene=slide,*",
            quantity="vx_final",
            truth="exact-step",
            over=1e-09,
            over_why="double precision leaves 1e-12 of the slide's speed beside the observer's",
        ),
        documented="the type float of its API",
    ),
    Finding(
        id="jolt/box-tips-in-single-precision",
        versions=VERSION,
        what=(
            "The spin of a box in its first step about its edge is off by 7e-5 of itself: its place and the corner's arm are rounded to "
            "single precision."
        ),
        size=Size(
            case="box/incline",
            variant="mu=0.8,slope_deg=20,aspect=0.35,turned_deg=0",
            quantity="spin",
            truth="exact-step",
            over=2e-8,
            over_why="the first step of Newton's laws, in double precision right to 1e-8",
        ),
    ),
)
