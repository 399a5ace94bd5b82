"""Errata of the source, grains that are no disks; see `ninedisk.harness.api.finding`."""

from ninedisk.harness.api.finding import Finding, Size

FINDINGS = (
    Finding(
        id="source/a6-torque-of-the-normal-force",
        engine="cd",
        versions="appendix A.3.3, (A.6)",
        what=(
            "Suspected misprint: (A.6) has the normal force's torque R^p in its tangential row, virtual work puts it into the "
            "normal one. As printed, nothing balances the torque of friction on a grain that rests on its face, and it would "
            "roll. No disk shows it: there R^p = 0."
        ),
        size=Size(
            case="nurbs/rolling",
            variant="*steepness=0.95",
            column="value",
            quantity="fs_final",
            truth="analytic",
            per="fn_final",
            over=0.01,
            over_why=(
                "friction at rest over the normal force, the incline's tangent: what the normal force's torque balances; a grain "
                "that it did not hold would roll, and its friction fall below"
            ),
        ),
    ),
)
