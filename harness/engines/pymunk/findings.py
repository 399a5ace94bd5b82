"""What pymunk is known to do otherwise; see `ninedisk.harness.api.finding`."""

from ninedisk.harness.api.finding import Finding, Size

FINDINGS = (
    Finding(
        id="pymunk/positions-first",
        engine="pymunk",
        versions="7.3.1",
        what=(
            "A step moves positions before velocities, so that a body that is pulled from rest lags behind by one step of its velocity: x"
            " is exact times (1 - dt/t)."
        ),
        size=Size(
            case="incline-block",
            variant="mu=0.36,dt=0.01",
            quantity="x_final",
            truth="analytic",
            over=0.001,
            over_why=(
                "the friction and the velocity are exact, and a scheme of second order has the way to round-off: dt/t = 1 % is all that "
                "differs"
            ),
        ),
        command="ninedisk run incline-block --engine pymunk --set mu=0.36 --set dt=0.01",
    ),
)
