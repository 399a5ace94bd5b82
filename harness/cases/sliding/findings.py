"""Errata of the source, sliding particle; see `ninedisk.harness.api.finding`."""

from ninedisk.harness.api.finding import Finding, Size

FINDINGS = (
    Finding(
        id="source/a4-needs-tension",
        engine="cd",
        versions="appendix A.3.2, (A.4)",
        what=(
            "Below the critical step (A.4) makes the rise of the particle negative: the contact would have to pull; the step that "
            "satisfies p >= 0 leaves it where it is."
        ),
        size=Size(
            case="sliding/dynamic",
            variant="dt=0.001,g0=0.001",
            quantity="du_y_1",
            truth="published",
            over=0.01,
            over_why="either the rise is the printed one, to round-off, or it is 0 and all of it is wrong",
        ),
    ),
    Finding(
        id="source/critical-step-under-coulomb",
        engine="siconos",
        versions="appendix A.3.2, (A.5)",
        what=(
            '"The initial gap will increase for dt > dt_cr" holds for the associated rule alone: under Coulomb\'s law nothing opens a '
            "contact by sliding, at any step."
        ),
        size=Size(
            case="sliding/dynamic",
            variant="dt=0.01,g0=0",
            quantity="du_y_1",
            truth="published",
            over=0.01,
            over_why="either the rise is the printed one, to round-off, or it is 0 and all of it is wrong",
        ),
    ),
)
