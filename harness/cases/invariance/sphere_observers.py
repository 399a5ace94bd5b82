"""Laws that hold for every observer, in space: spheres in other units, turned about any axis, in a moving frame, in a mirror."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from ninedisk.harness.api.case import Headline, Observed, Parameter, Setup
from ninedisk.harness.cases.invariance.frames import SpaceFrame
from ninedisk.harness.cases.invariance.observers import UNIT, UNITS, Invariance, Scenes
from ninedisk.harness.cases.rolling import on_plane
from ninedisk.harness.cases.static import sphere_stack as stack

SEEN: Scenes = {
    "throw": (on_plane.ROLLING, {"mu": 0.3}, frozenset({"vx", "spin", "beside"})),
    "slope": (on_plane.INCLINE, {"duration": 0.15}, frozenset({"vx", "spin", "beside"})),
    "table": (on_plane.TURNTABLE, {"turn": 14.0}, frozenset({"vx", "vy", "rate"})),
    "heap": (
        stack.CASE,
        {"duration": 0.1},
        frozenset({"top_n_mean", "top_s_mean", "floor_n_mean", "floor_s_mean", "unlike", "down", "aside"}),
    ),
}
"""Case, its parameters, and the quantities that count, with their final values."""

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0), "skew": (2.0 / 3.0, 2.0 / 3.0, -1.0 / 3.0)}

PARAMETERS = (
    Parameter(name="scene", default="throw", choices=tuple(SEEN), in_id=True,
              help="sphere thrown along a plane, released on a slope, on a turntable; three spheres that bear one"),
    UNIT,
    Parameter(name="angle_deg", default=0.0, low=-360.0, high=360.0, unit="deg", help="rotation of the whole scene"),
    Parameter(name="axis", default="skew", choices=tuple(AXES), help="that it is turned about"),
    Parameter(name="mirror", default=False, help="whether the scene is mirrored at a plane along no axis, after that"),
    *(Parameter(name=f"frame_v{axis}", default=0.0, low=-1e3, high=1e3, unit="m/s", help=f"velocity of the whole scene along {axis}")
      for axis in "xyz"),
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class SpaceInvariance(Invariance):
    """A case of this family in space."""

    source: str = "dimensional analysis, Galilei's relativity, isotropy and parity; truths of the original cases"
    parameters: tuple[Parameter, ...] = PARAMETERS

    @property
    def scenes(self) -> Scenes:
        """What is seen, by name."""
        return SEEN

    def frame(self, params: Mapping[str, Any]) -> SpaceFrame:
        """The observer of a variant."""
        length, mass, time = UNITS[params["units"]]
        return SpaceFrame(
            length=length,
            mass=mass,
            time=time,
            angle=math.radians(params["angle_deg"]),
            axis=AXES[params["axis"]],
            mirror=params["mirror"],
            velocity=(params["frame_vx"], params["frame_vy"], params["frame_vz"]),
        )

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """The first headline of the original: its truth holds for every observer."""
        case, full, original = self.original(params)
        first, *_ = case.headlines(full, original, observed)  # type: ignore[attr-defined]
        return (replace(first, name="motion seen by the observer", use="invariance"),)


CASES = (
    SpaceInvariance(
        id="spheres/invariance/units",
        title="Spheres in other units",
        requirement="numbers in mm-g-ms and other units give the same physics to round-off: no absolute thresholds",
        variants=({"scene": "heap", "units": "mm-g-ms"},),
    ),
    SpaceInvariance(
        id="spheres/invariance/rotation",
        title="Spheres along turned axes",
        requirement="a scene turned about any axis gives the turned motion to round-off: no direction is special",
        variants=({"scene": "throw", "angle_deg": 77.0}, {"scene": "heap", "angle_deg": 200.0}),
    ),
    SpaceInvariance(
        id="spheres/invariance/galilei",
        title="Spheres in a moving frame",
        requirement="a scene that moves as a whole, planes and all, gives the same relative motion and forces to round-off",
        variants=({"scene": "table", "frame_vx": -1.0, "frame_vz": 2.0},),
    ),
    SpaceInvariance(
        id="spheres/invariance/mirror",
        title="Spheres in a mirror",
        requirement="the mirrored scene gives the mirrored motion, spins the other way round: no hand is special",
        variants=({"scene": "table", "mirror": True},),
    ),
)
