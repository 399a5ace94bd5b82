"""A disk in a periodic cell that is narrower than the disk: it touches its own image."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene
from ninedisk.core.scene.cell import Cell
from ninedisk.harness.api.case import Check, Headline, Observed, Parameter, Setup, Value
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import at_observed

RADIUS, MASS, KN = 0.5, 1.0, 1e4
HEIGHT, VELOCITY, SPIN = 1.5, (0.3, -0.2), 0.7
"""Height of the cell [m], in which there is no contact, velocity [m/s] and spin [rad/s] of the disk."""

STEP, STEPS = 1e-3, 50
AXES = (("xx", 0, 0), ("xy", 0, 1), ("yx", 1, 0), ("yy", 1, 1))


class OwnImage:
    """Both contacts of the disk are with its images at its left and right: they press it equally, and nothing moves beside the flight."""

    id = "cell/own-image"
    version = 1
    title = "Disk that touches its own image"
    source = "the spring between a disk and its image: stress kn (2R - L)/Ly"
    requirement = "the cell is pressed along the contact, and the disk flies on as if there were none"
    parameters: tuple[Parameter, ...] = (
        Parameter(
            name="edge",
            default=0.95,
            low=0.55,
            high=0.999,
            unit="m",
            in_id=True,
            help="length of the cell, between R and 2R",
        ),
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """A shallow and a deep overlap."""
        return ({"edge": 0.95}, {"edge": 0.75})

    def build(self, params: Mapping[str, Any]) -> Setup:
        """One disk, which flies."""
        scene = Scene(
            disks=Disks(
                x=np.array([[0.2, 0.3]]), v=np.array([VELOCITY]), omega=np.array([SPIN]), radius=np.array([RADIUS]), mass=np.array([MASS])
            ),
            disk_disk=ContactLaw(kn=KN),
            cell=Cell(size=(params["edge"], HEIGHT)),
        )  # fmt: skip
        return Setup(scene=scene, numerics=Numerics(dt=STEP, n_steps=STEPS, contact_dt=STEP), watch=())

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:  # noqa: ARG002
        """Stress of the contacts, and how far the disk is from its flight."""
        t = history.t
        stress = np.full((len(t), 2, 2), np.nan) if history.stress is None else history.stress[:, 0]
        flown = setup.scene.disks.x[0] + t[:, None] * np.array(VELOCITY)
        series = {f"stress_{name}": ("N/m", stress[:, a, b]) for name, a, b in AXES}
        series |= {
            "astray": ("m", np.abs(history.x[:, 0] - flown).max(axis=1)),
            "omega": ("rad/s", history.omega[:, 0]),
        }
        return Observed(step=history.step, t=t, series=series, scalars={})

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """The stress along the contact."""
        stress = _stress(params)
        return (
            Headline(name="stress of a disk on its own image", use="rest", quantity="stress_xx", expected=stress, source=self.source,
                     scale=stress, scale_is="that stress"),
        )  # fmt: skip

    def checks(
        self,
        params: Mapping[str, Any],
        setup: Setup,
        observed: Observed,
        engine: EngineInfo,
    ) -> Sequence[Check]:
        """Closed forms to round-off: the branch of the contact is the edge, whatever the place of the disk."""
        t, size = observed.t, _stress(params)
        rough = KN * 8.0 * float(np.spacing(2.0)) / HEIGHT
        far = 8.0 * float(np.spacing(2.0)) * (1.0 + setup.numerics.n_steps)
        common: dict[str, Any] = {"norm": "max", "truth": "analytic", "source": self.source}
        stress = {f"stress_{name}": np.full_like(t, size if name == "xx" else 0.0) for name, _, _ in AXES}
        found = [
            Check(quantity=name, expected=at_observed(observed, engine, name, expected),
                  atol=rough, scale=size, why="round-off of the gap as a force", **common)
            for name, expected in stress.items()
        ]  # fmt: skip
        return [
            *found,
            Check(
                quantity="astray",
                expected=0.0,
                atol=far,
                scale=RADIUS,
                why="forces cancel: round-off of places",
                **common,
            ),
            Check(quantity="omega", expected=SPIN, atol=1e-12, why="no force has a moment", **common),
        ]


def _stress(params: Mapping[str, Any]) -> float:
    return float(KN * (2.0 * RADIUS - params["edge"]) / HEIGHT)


CASE = OwnImage()
