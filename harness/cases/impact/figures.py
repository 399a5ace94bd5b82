"""The source's figures and claims of binary collisions: what is shown, what is claimed, and what decides a claim."""

from __future__ import annotations

from collections.abc import Mapping

from ninedisk.harness.api.claims import Cells, Claim, Verdict, published
from ninedisk.harness.results.figures import Allowed, Figure, Plotted


def _collision(first: int) -> tuple[Plotted, ...]:
    numbers = [f"A.{first + k}" for k in range(4)]
    return (
        Plotted("energy", "kinetic energy", numbers[0]),
        Plotted("momentum_x", "momentum along x", numbers[1]),
        Plotted("vx_1", "vx, disk 1", numbers[2]),
        Plotted("vx_2", "vx, disk 2", numbers[2]),
        Plotted("vy_1", "vy, disk 1", numbers[3]),
        Plotted("vy_2", "vy, disk 2", numbers[3]),
    )


_BY_KIND: Mapping[str, tuple[Allowed, ...]] = {"restitution": (None,), "beta": (None,), "theta": (None,)}
"""Collisions that nothing but their kind describes, as in the source."""


def elastic_collision(cells: Cells) -> Verdict:
    """Energy, momentum and velocities after an elastic impact against the source's, with the checks' tolerances."""
    return published(cells, ("energy_final", "momentum_x_final", "vx_1_final", "vx_2_final"), kind="elastic")


def plastic_collision(cells: Cells) -> Verdict:
    """The same for the plastic impact: momentum kept, energy halved, both disks at half the speed."""
    return published(cells, ("energy_final", "momentum_x_final", "vx_1_final", "vx_2_final"), kind="plastic")


BINARY_FIGURES: tuple[Figure, ...] = (
    Figure(
        number="A.6–A.9",
        title="Elastic collision",
        quantities=_collision(6),
        where={"kind": ("elastic",), **_BY_KIND},
        shows="Energy, momentum and the velocities of both disks over time.",
        allows="Energy and momentum are conserved if both curves are level; disk 1 stops and disk 2 leaves "
        "at vx = 1 m/s.",
    ),
    Figure(
        number="A.10–A.13",
        title="Plastic collision",
        quantities=_collision(10),
        where={"kind": ("plastic",), **_BY_KIND},
        shows="Energy, momentum and the velocities of both disks over time.",
        allows=("Momentum is conserved, half of the energy is lost, and both disks move on together at vx = 0.5 m/s."),
    ),
)

BINARY_CLAIMS: tuple[Claim, ...] = (
    Claim(
        id="elastic-collision-conserves",
        place="A.2",
        text=(
            "We see that both energy and momentum are conserved. After collision, Disk 1 becomes "
            "stationary and Disk 2 takes on the velocity v_x = 1."
        ),
        decided_by=(
            "Elastic collision: confirmed if final energy and momentum equal the initial ones, vx_1 = 0 "
            "and vx_2 = 1, within the engine's tolerance. With contact dynamics it depends on the gap: "
            "exact only if the gap is a whole number of v dt."
        ),
        rule=elastic_collision,
        derivation=(
            "Two equal disks that exchange their velocities keep momentum and energy exactly. With a time step, the impact "
            "falls inside a step: if the gap is no whole number of v dt, a scheme of positions closes it first and keeps "
            "only a part of the velocity, e_eff(phase).",
        ),
    ),
    Claim(
        id="plastic-collision-conserves-momentum-only",
        place="A.2",
        text=(
            "momentum is conserved, but energy is not. After collision, the Disk 1 and Disk 2 move "
            "together at v_x = 0.5"
        ),
        decided_by=(
            "Plastic collision: confirmed if momentum keeps its value, the energy falls, and both "
            "velocities are 0.5 within the engine's tolerance."
        ),
        rule=plastic_collision,
    ),
)
