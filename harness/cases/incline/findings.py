"""Errata of the source, block on the incline; see `ninedisk.harness.api.finding`."""

from ninedisk.harness.api.finding import Finding, Size

FINDINGS = (
    Finding(
        id="source/weight-for-normal-force",
        engine="dem",
        versions="appendix A.3.4",
        what=(
            "The source gives the normal force of the sliding block as m g; equilibrium gives m g cos(20 deg): the weight is not normal "
            "to the plane."
        ),
        size=Size(
            case="incline-block",
            variant="mu=0.36,dt=0.01",
            quantity="fn_final",
            truth="published",
            over=0.01,
            over_why="1 - cos(20 deg) = 6 % of m g lies between the two; no engine is off by 1 %",
        ),
    ),
    Finding(
        id="source/weight-in-friction",
        engine="siconos",
        versions="appendix A.3.4",
        what="The source gives the friction of the sliding block as mu m g; it is mu m g cos(20 deg).",
        size=Size(
            case="incline-block",
            variant="mu=0.36,dt=0.01",
            quantity="fs_final",
            truth="published",
            over=0.01,
            over_why="1 - cos(20 deg) = 6 % of mu m g lies between the two; no engine is off by 1 %",
        ),
    ),
)
