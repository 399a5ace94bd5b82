"""What Drake is known to do otherwise; see `ninedisk.harness.api.finding`."""

from ninedisk.harness.api.finding import Finding, Size
from ninedisk.harness.api.shared_findings import creeps_at_rest, free_rotation_gains, overlap_of_impact_stays

FINDINGS = (
    Finding(
        id="drake-sap/sliding-lifts",
        versions="1.51.1",
        what=(
            "A sliding body leaves the surface: the convex model (SAP) couples slip and opening, and the body glides about mu v dt high."
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
    ),
    Finding(
        id="drake-sap/slips-on-in-flight",
        versions="1.51.1",
        what=(
            "A thrown disk takes off and flies: what does not touch is not slowed down, and it slips on where friction would have taken a "
            "quarter of its speed more."
        ),
        size=Size(
            case="slip-to-roll",
            variant="*",
            quantity="slip",
            truth="analytic",
            over=0.02,
            sign=1,
            over_why="engines with Coulomb's law agree with the closed form at every sample: rigid contacts to round-off, springs to 1 %",
        ),
        command="ninedisk run slip-to-roll --engine drake-sap --set mu=0.3",
    ),
    Finding(
        id="drake-lagged/slides-without-friction-at-first",
        versions="1.51.1",
        what=(
            "The bound of friction is mu times the normal force of the step before: a block that is put down without load slides freely "
            "for its first step, and so goes almost three times as far as it should."
        ),
        size=Size(
            case="incline-block",
            variant="mu=0.36,dt=0.01,preload=false",
            quantity="x_final",
            truth="analytic",
            over=0.1,
            sign=1,
            over_why="first order in the step changes the displacement by dt/t = 1 %; a spring that loads first by 3.5 %",
        ),
        command="ninedisk run incline-block --engine drake-lagged --set mu=0.36 --set dt=0.01 --set preload=false --set kn=1e8",
    ),
    overlap_of_impact_stays("drake-lagged", "1.51.1"),
    free_rotation_gains("drake-sap", "1.51.1"),
    free_rotation_gains("drake-lagged", "1.51.1"),
    creeps_at_rest(
        "drake-sap",
        "1.51.1",
        "Friction is a regularised function of the slip velocity",
        documented="https://drake.mit.edu/doxygen_cxx/group__stribeck__approximation.html",
    ),
    creeps_at_rest(
        "drake-lagged",
        "1.51.1",
        "Friction is a regularised function of the slip velocity",
        documented="https://drake.mit.edu/doxygen_cxx/group__stribeck__approximation.html",
    ),
    Finding(
        id="drake-sap/forces-chatter",
        versions="1.51.1",
        what="A sliding block flies and lands again: the contact force swings between nothing and twice the load, right only on average.",
        size=Size(
            table="headlines",
            case="incline-block",
            variant="mu=0.36*",
            quantity="force on the incline",
            over=1e-3,
            over_why="the normal force of a sliding block is m g cos at every step, in other engines to 1e-7",
        ),
    ),
    Finding(
        id="drake-lagged/friction-of-a-heap-fades",
        versions="1.51.1",
        what=(
            "A heap of spheres that slides comes down a fifth farther than it should in a quarter of a second: friction over the normal "
            "force falls with the speed, by an amount that is of first order in the step."
        ),
        size=Size(
            case="spheres/stack",
            variant="heap=tetrahedron,share=0.8",
            quantity="down",
            truth="analytic",
            over=0.001,
            sign=1,
            over_why="first order in the step moves the top by 3e-4 m, 6e-4 of a radius",
        ),
        command="ninedisk run spheres/stack --engine drake-lagged --set share=0.8",
    ),
)
