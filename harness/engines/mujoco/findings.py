"""What MuJoCo is known to do otherwise; see `ninedisk.harness.api.finding`."""

from ninedisk.harness.api.finding import Finding, Size

FINDINGS = (
    Finding(
        id="mujoco/soft-contacts",
        versions="4.0.0",
        what=(
            "Contacts are soft and take their load up over part of a step: a column that is put down touching presses less on the floor "
            "than it weighs at first."
        ),
        size=Size(
            case="static/stack",
            variant="arrangement=column,start=touching",
            quantity="fn_layer_2",
            truth="analytic",
            over=0.001,
            sign=-1,
            over_why="a rigid contact bears the load in the first step, to round-off or the solver's tolerance (DART 1.5e-4)",
        ),
        documented="https://mujoco.readthedocs.io/en/stable/computation/index.html",
    ),
    Finding(
        id="mujoco/impacts-share",
        versions="4.0.0",
        what=(
            "An impact is a spring's motion over half a step: a disk that hits two at once shares its speed as springs do, and collisions"
            " that follow each other overlap."
        ),
        size=Size(
            case="chain/newton-cradle",
            variant="*",
            quantity="handed_on",
            truth="analytic",
            over=0.001,
            over_why=(
                "one collision after the other hands the speed on to 1e-4 of springs of the scene's stiffness, to round-off of rigid "
                "contacts"
            ),
        ),
        documented="https://mujoco.readthedocs.io/en/stable/computation/index.html",
    ),
    Finding(
        id="mujoco/corner-rebounds",
        versions="4.0.0",
        what=(
            "A box that hits a plane with a corner rebounds, and friction does not end all slip of a corner that should stick: its normal "
            "impulse is a fifth too large here, and an eighth at MuJoCo's own settings with steps of 2 ms to 10 us."
        ),
        size=Size(
            case="box/corner-drop",
            variant="approach=turns,mu=0.8,*",
            quantity="impulse_z",
            truth="analytic",
            over=0.1,
            sign=1,
            over_why="a corner that sticks has one impulse, on whatever way it comes to it: DART gives 2e-5 of it, Bullet round-off",
        ),
        documented="https://mujoco.readthedocs.io/en/stable/computation/index.html",
    ),
    Finding(
        id="mujoco/creeps-at-rest",
        versions="4.0.0",
        what="Friction is a force that slip makes: a block that should stick creeps down the incline, the less the larger impratio is.",
        size=Size(
            table="headlines",
            case="incline-block",
            variant="mu=0.4,dt=0.01",
            quantity="distance down the incline",
            over=1e-9,
            sign=1,
            over_why="a stuck block rests; engines with rigid contacts or shear springs leave it where it is, to round-off",
        ),
        documented="https://mujoco.readthedocs.io/en/stable/computation/index.html",
        thread="https://github.com/google-deepmind/mujoco/issues/3328",
    ),
    Finding(
        id="mujoco/sliding-lifts",
        versions="4.0.0",
        what=(
            "The convex contact law pushes sliding contacts open: a disk that grazes a plane with restitution 0.5 leaves it the faster, "
            "the faster it slides."
        ),
        size=Size(
            case="impact/oblique",
            variant="vt=11.43,restitution=0.5",
            quantity="restitution_effective",
            truth="analytic",
            over=0.0075,
            sign=1,
            over_why="impulses are off by the part of them that contacts let through, 0.5 %; engines with Coulomb's law show round-off",
        ),
        documented="https://mujoco.readthedocs.io/en/stable/computation/index.html",
    ),
    Finding(
        id="mujoco/order-of-bodies",
        versions="4.0.0",
        what="Given in another order, the disks of a pile part by 1e-4 of a radius in the step in which they come to press on each other.",
        size=Size(
            table="determinism",
            case="determinism",
            variant="bodies",
            column="difference",
            over=4e-3,
            over_why="what eight roundings in each of its own steps can have grown to by then; the growth is measured on the same pile",
        ),
    ),
    Finding(
        id="mujoco/pyramid-has-no-friction-without-damping",
        versions="4.0.0",
        what=(
            "The edges of MuJoCo's own pyramidal cone take friction from the damping of the contact: an elastic impact, which has none, "
            "leaves the speed along the plane as it was."
        ),
        size=Size(
            case="spheres/thornton",
            variant="law=linear,incidence=9,mujoco.cone=pyramidal",
            quantity="vt_final",
            truth="analytic",
            over=0.01,
            sign=1,
            over_why="the elliptic cone, whose shear damper is its own, takes mu (1 + e) of the speed of impact to half a per cent",
            fails=True,
        ),
        documented="https://mujoco.readthedocs.io/en/stable/computation/index.html",
        command="ninedisk run spheres/thornton --engine mujoco --set law=linear --set incidence=9 --option mujoco.cone=pyramidal",
    ),
    Finding(
        id="mujoco/pyramid-slip-throws-up",
        versions="4.0.0",
        what=(
            "On the pyramidal cone the damping of an edge sees the slip as an approach: a ball that slides through an impact with "
            "restitution 0.5 rebounds at another speed than one that falls straight."
        ),
        size=Size(
            case="spheres/thornton",
            variant="law=linear,incidence=9,restitution=0.5,mujoco.cone=pyramidal",
            quantity="restitution_effective",
            truth="analytic",
            over=0.03,
            over_why="the elliptic cone is off by less than a per cent; so is an impact of half a step without slip",
            fails=True,
        ),
        documented="https://mujoco.readthedocs.io/en/stable/computation/index.html",
        command=(
            "ninedisk run spheres/thornton --engine mujoco --set law=linear --set incidence=9 --set restitution=0.5 "
            "--option mujoco.cone=pyramidal"
        ),
    ),
    Finding(
        id="mujoco/resistances-share-cone",
        versions="4.0.0",
        what=(
            "Resistances to rolling and twisting are one elliptic cone with the friction: a sphere that twists fast rolls on as if nothing "
            "resisted rolling, and the other way round."
        ),
        size=Size(
            case="spheres/rolling-resistance",
            variant="model=constant,plane=twisting",
            quantity="spin_z",
            truth="analytic",
            over=0.05,
            over_why="what two of the engine's steps at the full torque change: 0.019",
        ),
    ),
    Finding(
        id="mujoco/tolerance-has-a-unit",
        versions="4.0.0",
        what=(
            "The solver ends where an improvement, an acceleration squared, falls below a number that has no unit: in micrometres and "
            "microseconds, where g^2 is 1e-10, the default of 1e-14 leaves a heap of spheres with another friction than in metres."
        ),
        size=Size(
            case="spheres/invariance/units",
            variant="scene=heap,units=um-ug-us",
            quantity="top_s_mean",
            truth="analytic",
            over=0.02,
            over_why="in metres and in millimetres friction is right to 3e-6 N of 20 N",
            fails=True,
        ),
    ),
)
