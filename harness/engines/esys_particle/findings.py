"""What ESyS-Particle is known to do otherwise; see `ninedisk.harness.api.finding`."""

from ninedisk.harness.api.finding import Finding, Size

FINDINGS = (
    Finding(
        id="esys-particle/shear-keeps-direction",
        versions="2.3.4 (2.3.5 of Debian)",
        what=(
            "Shear forces of RotFriction are summed along fixed axes: they turn neither with the normal of their contact nor about it, and "
            "become normal forces where two spheres in contact circle each other. Its option `rigid`, documented to take such rotations "
            "into account, changes no bit: workers do not receive it."
        ),
        size=Size(
            table="headlines",
            case="spheres/turned",
            variant="kind=passed,axis=across",
            quantity="shear force that turned",
            over=0.02,
            over_why="forces turned to first order are off by half the square of each step's rotation, 1 % of the force in a turn",
        ),
        command="ninedisk run spheres/turned --engine esys-particle --set kind=passed",
    ),
)
