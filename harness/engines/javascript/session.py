"""A scene in a world of an engine in JavaScript: `host.mjs` runs it, this module describes it and asks for steps.

Lengths are given in a unit that makes the mean radius about 1, a power of two: engines in single precision have lengths for furniture
compiled into them, and the change of units rounds nothing. A stock run has metres.

Bodies are larger and walls raised by half of ``touch`` each, some units of round-off, so that what touches is in contact whatever the
rounding of its coordinates. Engines let a gap close within a step: one of round-off would take a part of the load away.
"""

from __future__ import annotations

import json
import math
import subprocess
import weakref
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from ninedisk.core.history import History, Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.options import read_options
from ninedisk.core.validate import FloatArray
from ninedisk.harness.api.boxes import has_boxes
from ninedisk.harness.api.engine import EngineError
from ninedisk.harness.api.knobs import given_knobs, recorded_knobs
from ninedisk.harness.api.text import one_line
from ninedisk.harness.engines.boxes import ContactSums
from ninedisk.harness.engines.javascript.adapter import NodeEngine
from ninedisk.harness.engines.javascript.node import FOLDER
from ninedisk.harness.engines.lengths import largest_extent, longest_path, wall_reach
from ninedisk.harness.engines.world import (
    WorldSession,
    from_z,
    quaternion_of,
    signed_angle,
    three_components,
)

HERE = Path(__file__).parent

_TOUCH_ULPS = 8.0
"""A gap is a sum of a few coordinates, each rounded to half a unit in the last place."""


class NodeSession(WorldSession):
    """The `Session` of one run; a subclass gives `adapter` and `module`.

    Attributes
    ----------
    adapter : NodeEngine
    module : str
        The file beside this one that drives the engine.
    """

    adapter: NodeEngine
    module: str
    given: Mapping[str, Any] = MappingProxyType({})
    recorded: Mapping[str, Any] = MappingProxyType({})
    """Knobs that a stock run sets."""
    cpu_seconds = 0.0
    """Of the steps, in the engine's process."""

    def __init__(self, scene: Any, numerics: Numerics, pairs: tuple[Pair, ...]) -> None:
        self.engine = self.adapter.facts.name
        super().__init__(scene, numerics, pairs)
        name = self.adapter.id
        options = read_options(name, self.adapter.facts.options, numerics)
        self.stock = options[f"{name}.profile"] == "stock"
        if self.stock:
            self.given = given_knobs(name, self.adapter.knobs, numerics)
            options = {f"{name}.profile": "stock"}
            self.recorded = recorded_knobs(name, self.given)
        radii = scene.bodies.radius
        self.unit = 2.0 ** -round(math.log2(float(radii.mean()))) if len(radii) and not self.stock else 1.0
        self.solid = has_boxes(scene)
        self.process = subprocess.Popen(
            ["node", str(HERE / "host.mjs"), str(HERE / self.module), str(FOLDER)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        weakref.finalize(self, _end, self.process)
        extent = self.unit * (largest_extent(scene) + longest_path(scene, numerics))
        dtype = np.float32 if self.adapter.facts.precision == "float32" else np.float64
        self.touch = 0.0 if self.stock else _TOUCH_ULPS * float(np.spacing(dtype(extent)))
        world = self._world(scene, numerics, {key.rpartition(".")[2]: value for key, value in options.items()})
        made = self._ask(world)
        self.settings: dict[str, Any] = {
            **options,
            **self.recorded,
            **{f"{name}.{key}": value for key, value in made["settings"].items()},
            f"{name}.lengths_per_metre": self.unit,
            f"{name}.touch": world["touch"] / self.unit,
        }
        self.found = self._ask({"steps": 0})

    def advance(self, n_steps: int) -> None:
        """Step the world; before each step a moving wall gets its exact pose and the velocity that takes it to the next."""
        drives, loads = [], []
        moves = self.poses.moving or self.driven
        pushed = self.scene.forces
        for _ in range(n_steps if moves or pushed else 0):
            self.coming: list[Any] = []
            self.loads: list[Any] = []
            if self.scene.dimension == 2:
                self.prescribe()
            else:
                self.prescribe_3d()
            drives.append(self.coming)
            loads.append(self.loads)
            self.done += 1
        if not (moves or pushed):
            self.done += n_steps
        self.found = self._ask({"steps": n_steps, "drives": drives or None, "loads": loads or None})
        self.cpu_seconds += self.found["cpu"]

    def step(self, *, last: bool) -> None:  # noqa: ARG002
        """One step; `advance` asks for many at once."""
        self.advance(1)

    def copy(self, history: History, row: int) -> None:
        """Copy the state."""
        size = history.x.shape[2]
        for i, (x, v, q, w) in enumerate(self.found["state"]):
            history.x[row, i], history.v[row, i] = np.array([x[:size], v[:size]]) / self.unit
            history.omega[row, i] = w[2] if size == 2 else w
            turned = self.found["turned"][i]
            history.angle[row, i] = turned[2] if size == 2 else turned
            if history.quaternion is not None:
                history.quaternion[row, i] = q[3], *q[:3]

    def impulses(self) -> Mapping[Pair, FloatArray]:
        """Impulse [N s] of the last step on the first body of each touching pair."""
        sums, size = ContactSums(self.scene), self.scene.dimension
        centres = np.array([x for x, *_ in self.found["state"]]).reshape(-1, 3)
        for one, two, on_one, place in self.found["impulses"] or ():
            on_first = np.array(on_one[:size]) / self.unit
            if self.solid and place is not None:
                sums.add(one, two, on_first, np.array(place) / self.unit, centres / self.unit)
            else:
                sums.add(one, two, on_first)
        self.moments = sums.moments
        return sums.impulses

    def observe(self, history: History, row: int) -> None:
        """Copy the state, and of the contacts what the engine reports."""
        super().observe(history, row)
        reported = self.adapter.facts.contact_forces
        if reported != "all":
            history.fs[row] = history.wall_force[row] = np.nan
            if history.moment is not None:
                history.moment[row] = np.nan
        if reported == "none":
            history.fn[row] = np.nan

    def drive(self, k: int, here: FloatArray, there: FloatArray, facing: FloatArray, rate: float) -> None:
        """Set a wall's pose and its chord velocity over the coming step."""
        turned = signed_angle(self.scene.walls[k].normal, facing)
        self._drive(
            "wall",
            k,
            here + self._raised * facing,
            _turned(self._turn(k), turned),
            (there - here) / self.dt,
            [0.0, 0.0, rate],
        )

    def drive_3d(self, k: int, point: FloatArray, rotation: FloatArray, velocity: FloatArray, rate: FloatArray) -> None:
        """Set a wall's pose and its velocities over the coming step."""
        turn = _product(_last_real(quaternion_of(rotation)), self._turn(k))
        self._drive(
            "wall",
            k,
            point + self._raised * (rotation @ np.array(self.scene.walls[k].normal)),
            turn,
            velocity,
            rate.tolist(),
        )

    def drive_sphere(self, i: int, place: FloatArray) -> None:
        """Set a sphere's pose and velocities."""
        spheres = self.scene.spheres
        self._drive("body", i, place, [0.0, 0.0, 0.0, 1.0], spheres.v[i], spheres.omega[i].tolist())

    def push(self, i: int, load: FloatArray) -> None:
        """Engines forget forces after a step."""
        self.loads.append([i, (self.unit * load[:3]).tolist(), (self.unit**2 * load[3:]).tolist()])

    @property
    def _raised(self) -> float:
        """Length [m] by which walls are raised."""
        return 0.5 * self.touch / self.unit

    def _drive(self, kind: str, k: int, x: FloatArray, q: list[float], v: FloatArray, w: list[float]) -> None:
        self.coming.append([kind, k, three_components(self.unit * x), q, three_components(self.unit * v), w])

    def _turn(self, k: int) -> list[float]:
        """Rotation (x, y, z, w) of a wall whose normal was z."""
        return _last_real(from_z(np.array(three_components(self.scene.walls[k].normal))))

    def _world(self, scene: Any, numerics: Numerics, options: Mapping[str, Any]) -> dict[str, Any]:
        bodies, unit = scene.bodies, self.unit
        skin = 0.5 * self.touch
        radius = float(bodies.radius.max(initial=1.0))
        law = scene.law_of_bodies
        turns = bodies.quaternion.tolist() if self.solid else [[1.0, 0.0, 0.0, 0.0]] * len(bodies)
        return {
            "dimension": scene.dimension,
            "dt": self.dt,
            "gravity": three_components(unit * np.array(scene.gravity)),
            "stock": self.stock,
            "options": dict(options),
            "given": dict(self.given),
            "touch": self.touch,
            "reach": unit * wall_reach(scene, numerics, self.engine),
            "thickness": 10.0 * unit * radius,
            "between": {"mu": law.mu, "e": law.restitution or 0.0},
            "bodies": [
                {
                    "x": three_components(unit * bodies.x[i]),
                    "v": three_components(unit * bodies.v[i]),
                    "q": _last_real(turns[i]),
                    "w": three_components(bodies.omega[i]),
                    "turned": [0.0, 0.0, 0.0],
                    "radius": unit * float(bodies.radius[i]) + skin,
                    "half": (unit * bodies.half_sizes[i] + skin).tolist() if self.solid and bodies.boxes[i] else None,
                    "mass": float(bodies.mass[i]),
                    "inertia": (unit**2 * np.broadcast_to(bodies.inertia[i], 3)).tolist(),
                    "moves": "fixed" if self.fixed[i] else "driven" if i in self.driven else "free",
                    "rotating": bool(bodies.rotating[i]),
                }
                for i in range(len(bodies))
            ],
            "walls": [
                {
                    "point": three_components(unit * np.array(wall.point) + skin * np.array(wall.normal)),
                    "normal": three_components(wall.normal),
                    "turn": self._turn(k),
                    "mu": wall.law.mu,
                    "e": wall.law.restitution or 0.0,
                    "moving": bool(wall.motion),
                }
                for k, wall in enumerate(scene.walls)
            ],
        }

    def _ask(self, message: Mapping[str, Any]) -> dict[str, Any]:
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        try:
            self.process.stdin.write(json.dumps(message) + "\n")
            self.process.stdin.flush()
            text = self.process.stdout.readline()
        except BrokenPipeError:
            text = ""
        if not text.endswith("\n"):
            raise EngineError(
                f"{self.engine}: its process ended with status {self.process.wait()} at step {self.done} without an answer"
            )
        answer: dict[str, Any] = json.loads(text)
        if "error" in answer:
            raise EngineError(f"{self.engine}: {one_line(answer['error'])} (at step {self.done})")
        return answer


def _end(process: subprocess.Popen[str]) -> None:
    """End the engine's process: its input ends."""
    with process:
        process.kill()


def _last_real(quaternion: list[float]) -> list[float]:
    """(x, y, z, w) of (w, x, y, z)."""
    return [*quaternion[1:], quaternion[0]]


def _turned(quaternion: list[float], angle: float) -> list[float]:
    """A rotation (x, y, z, w) followed by one about z."""
    return _product([0.0, 0.0, math.sin(0.5 * angle), math.cos(0.5 * angle)], quaternion)


def _product(one: list[float], two: list[float]) -> list[float]:
    """Rotation ``two``, then ``one``, both (x, y, z, w)."""
    (a, b, c, d), (e, f, g, h) = one, two
    return [
        d * e + a * h + b * g - c * f,
        d * f - a * g + b * h + c * e,
        d * g + a * f - b * e + c * h,
        d * h - a * e - b * f - c * g,
    ]
