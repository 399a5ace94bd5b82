"""Engines with contact springs in their own process: how they fit a scene, what their drivers get, what is on record."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ninedisk.core.history import Pair
from ninedisk.core.law import SphereLaw
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, PlaneWall, Scene, SphereScene, Wall
from ninedisk.core.validate import FloatArray
from ninedisk.harness.api.capabilities import LEVER_ARMS, Capability, capabilities_needed
from ninedisk.harness.api.engine import EngineRun, Support, SupportLevel
from ninedisk.harness.api.support import NOTE_SLIP_END, OF_SLIP_AT, contact_steps
from ninedisk.harness.api.wall_path import wall_path
from ninedisk.harness.engines.process import ProcessEngine
from ninedisk.harness.engines.world import PlanePoses

AnyLaw = TypeVar("AnyLaw", ContactLaw, SphereLaw)
ARMS = frozenset(LEVER_ARMS.values())

SPRINGS_3D = frozenset(
    {
        Capability.SPHERES,
        Capability.LINEAR_CONTACT,
        Capability.HERTZ_MINDLIN,
        Capability.SHEAR_SPRING,
        Capability.FRICTION,
        Capability.CONTACT_DAMPING,
        Capability.MOVING_WALLS,
        Capability.CURVED_WALL_MOTION,
        Capability.GRAVITY,
        Capability.BLOCKED_ROTATION,
        Capability.FIXED_DISKS,
        Capability.SLIP_END,
        Capability.MATERIALS,
    }
)
"""What most of these engines have in 3D."""

NOTE_OVERDAMPED = "dashpots in space are given by the rebound e = exp(-pi beta/sqrt(1 - beta^2)): no beta of 1 and more"
NOTE_UNIFORM = "in space the engine knows uniform spheres only, I = (2/5) m R^2"
NOTE_MEAN = "friction and dashpots see a wall's mean velocity over the step (difference of its positions)"


def uniform(scene: SphereScene) -> bool:
    """Whether all bodies that can turn are uniform spheres."""
    spheres = scene.spheres
    inertia = spheres.inertia.reshape(len(spheres), -1)
    off = np.abs(inertia - 0.4 * (spheres.mass * spheres.radius**2)[:, None]) > 1e-12 * inertia
    return not (off.any(axis=1) & spheres.rotating).any()


def hertz(scene: SphereScene) -> bool:
    """Whether some contact of the scene has Hertz' law."""
    return any(law.hertz for law in scene.laws_in_use)


@dataclass
class Fit:
    """What keeps an engine from expressing a scene as it is.

    Attributes
    ----------
    missing : set of Capability
        What it lacks.
    near : set of Capability
        What it lacks and comes near to: lever arms.
    approximate, equivalent : bool
        Whether it only comes near to the scene for another reason; whether it discretises the same physics otherwise.
    notes : list of str
    """

    missing: set[Capability]
    near: set[Capability] = field(default_factory=set)
    approximate: bool = False
    equivalent: bool = False
    notes: list[str] = field(default_factory=list)

    def lacks(self, capability: Capability, note: str) -> None:
        """Note that a capability is missing for this very scene."""
        self.missing.add(capability)
        self.notes.append(note)

    def support(self) -> Support:
        """The answer of `Engine.supports`."""
        missing, notes = tuple(sorted(self.missing | self.near)), tuple(self.notes)
        if self.missing:
            return Support(SupportLevel.NO, missing, notes)
        if self.near or self.approximate:
            return Support(SupportLevel.APPROXIMATE, missing, notes)
        return Support(SupportLevel.EQUIVALENT if self.equivalent else SupportLevel.EXACT, (), notes)


class SpringEngine(ProcessEngine):
    """Adapter of an engine that integrates contact springs by central differences, as the in-house DEM does.

    A subclass gives what a `ProcessEngine` asks for, and of either dimension how it fits a scene and what is on record.
    """

    capabilities_3d: frozenset[Capability]
    """Capabilities in 3D; those in 2D are in `facts`."""
    chosen: Mapping[str, Any]
    """Settings of every run in 2D that are chosen deliberately, for the record."""
    chosen_3d: Mapping[str, Any]
    """The same in 3D."""
    dashpot_note = "dashpot with the velocity of t_{n-1/2}; never tension"
    dashpot_note_3d = ""

    @abstractmethod
    def fit(self, scene: Scene, numerics: Numerics, fit: Fit) -> None:
        """Add to ``fit`` what the capabilities do not report, and take out what this very scene does not ask for."""

    @abstractmethod
    def fit_3d(self, scene: SphereScene, numerics: Numerics, fit: Fit) -> None:
        """As `fit`, of a scene of 3D."""

    def supports(self, scene: Scene | SphereScene, numerics: Numerics) -> Support:
        """How far the engine's conventions are the scene's.

        EQUIVALENT also where dashpots see v_{n-1/2} though the numerics ask for the central form, and where slip is asked for
        elsewhere in the step: the same physics, first order in the step.
        """
        spheres = isinstance(scene, SphereScene)
        own = self.capabilities_3d if spheres else self.facts.capabilities
        fit = Fit(set(capabilities_needed(scene, numerics) - own))
        if own & OF_SLIP_AT and fit.missing & OF_SLIP_AT:
            fit.missing -= OF_SLIP_AT
            fit.equivalent = True
            fit.notes.append(NOTE_SLIP_END)
        if isinstance(scene, SphereScene):
            self.fit_3d(scene, numerics, fit)
        else:
            self.fit(scene, numerics, fit)
        if any(law.beta > 0.0 for law in scene.laws_in_use) and Capability.CONTACT_DAMPING not in fit.missing:
            fit.notes.append(self.dashpot_note_3d if spheres else self.dashpot_note)
            fit.equivalent = fit.equivalent or numerics.damping_form == "central"
        return fit.support()

    def extra(self, scene: Scene | SphereScene, numerics: Numerics, folder: Path) -> Mapping[str, Any]:
        """Contact step, and the walls' path at every contact step (a file: it can be long)."""
        count, contact_dt = contact_steps(scene, numerics)
        path, steps = folder / "wall_path.npy", count * numerics.n_steps
        if isinstance(scene, SphereScene):
            np.save(path, plane_path(scene, contact_dt, steps))
        else:
            np.save(path, wall_path(scene, contact_dt, steps))
        return {"substeps": count, "contact_dt": contact_dt, "wall_path": str(path)}

    def run(self, scene: Scene | SphereScene, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:
        """Run the engine; raises as `ExternalEngine.run`."""
        done = super().run(scene, numerics, watch)
        count, contact_dt = contact_steps(scene, numerics)
        settings = {
            "contact_dt": contact_dt,
            "contact_steps_per_dt": count,
            "damping_form": numerics.damping_form,
            "start": "half kick: v(1/2) = v0 + dt/2 (F0/m - xi v0), set by the driver",
            **(self.chosen_3d if isinstance(scene, SphereScene) else self.chosen),
            "threads": 1,
        }
        return EngineRun(history=done.history, timings=done.timings, settings={**settings, **done.settings})


def plane_path(scene: SphereScene, dt: float, n_steps: int) -> FloatArray:
    """Tables of the walls of 3D at the steps ``0 .. k``, after which none moves any more (``k <= n_steps``).

    Returns
    -------
    ndarray, shape (k + 1, m, 12)
        Row ``n``: surface point [m] and normal at ``n dt``; that point's velocity [m/s] and the wall's spin [rad/s], which follow from
        the pivot's velocity and the spin in the middle of the step that ends there (of row 0 at time 0), and the pivot's place at
        ``n dt``. The last row has no velocity if the motion ends before the run does.
    """
    ends = [sum(segment.duration for segment in wall.motion) for wall in scene.walls]
    last = int(min(float(n_steps), np.ceil(max(ends, default=0.0) / dt) + 1.0))
    poses = PlanePoses(scene)
    path = np.zeros(((last if poses.moving else 0) + 1, len(scene.walls), 12))
    motions = [_segments(wall, w, poses) for w, wall in enumerate(scene.walls)]
    for n, rows in enumerate(path):
        now, middle = poses(n * dt), max(0.0, (n - 0.5) * dt)
        rows[:, 0:3], rows[:, 3:6] = now.point, now.normal
        for w, motion in enumerate(motions):
            for segment, begin, velocity, amplitude, spin, pivot in motion:
                if middle < begin + segment.duration:
                    tau = n * dt - begin
                    wave = np.sin(segment.frequency * tau + segment.phase) - np.sin(segment.phase)
                    rate = segment.frequency * np.cos(segment.frequency * (middle - begin) + segment.phase)
                    arm = now.point[w] - (pivot + tau * velocity + wave * amplitude)
                    (p, q, r), (x, y, z) = spin, arm.tolist()
                    rows[w, 6:9] = velocity + rate * amplitude + (q * z - r * y, r * x - p * z, p * y - q * x)
                    rows[w, 9:12] = spin
                    break
    return path


def _segments(wall: PlaneWall, w: int, poses: PlanePoses) -> list[tuple[Any, ...]]:
    """Segments of a wall's motion, when each begins [s], and what the path has of it in every step: once, as arrays."""
    begin, found = 0.0, []
    for segment in wall.motion:
        pivot = poses(begin).point[w] if segment.pivot is None else np.array(segment.pivot)
        velocity, amplitude = np.array(segment.velocity), np.array(segment.amplitude)
        found.append((segment, begin, velocity, amplitude, segment.angular_velocity, pivot))
        begin += segment.duration
    return found


def sphere_laws(scene: SphereScene) -> list[SphereLaw]:
    """The laws that contacts between two spheres of the scene have, each once."""
    names = scene.spheres.material
    kinds = {name: names.count(name) for name in names}
    pairs = [(a, b) for a in kinds for b in kinds if a < b or (a == b and kinds[a] > 1)]
    place = {name: (names.index(name), len(names) - 1 - names[::-1].index(name)) for name in kinds}
    return _unique(scene.law(sorted_pair(place[a][0], place[b][1] if a == b else place[b][0])) for a, b in pairs)


def sorted_pair(i: int, j: int) -> Pair:
    """Two body numbers in order."""
    return (i, j) if i < j else (j, i)


def plane_laws(scene: SphereScene, wall: PlaneWall) -> list[SphereLaw]:
    """The laws that contacts of the scene's spheres with a wall have, each once."""
    number = len(scene.spheres) + scene.walls.index(wall)
    names = scene.spheres.material
    return _unique(scene.law((names.index(name), number)) for name in dict.fromkeys(names))


def fit_arms(scene: SphereScene, fit: Fit, between: str, at_walls: str) -> None:
    """Note the lever arms that rough contacts ask for and the engine only comes near to: it has one of spheres, and one of walls."""
    fit.missing -= ARMS
    if not scene.spheres.rotating.any():
        return
    asked = [(law, between) for law in sphere_laws(scene)]
    asked += [(law, at_walls) for wall in scene.walls for law in plane_laws(scene, wall)]
    fit.near |= {LEVER_ARMS[law.lever_arm] for law, own in asked if carries_shear(law) and law.lever_arm != own}


def uneven_planes(scene: SphereScene) -> bool:
    """Whether a wall of 3D that contacts feel moves otherwise than with one velocity and spin."""
    felt = [
        wall for wall in scene.walls if any(carries_shear(law) or law.beta > 0.0 for law in plane_laws(scene, wall))
    ]
    return any(any(segment.amplitude) for wall in felt for segment in wall.motion)


def disk_laws(scene: Scene) -> list[ContactLaw]:
    """The laws that contacts between two disks of the scene have, each once."""
    members: dict[str, list[int]] = {}
    for i, name in enumerate(scene.disks.material):
        members.setdefault(name, []).append(i)
    pairs = [(a, b) for k, a in enumerate(members) for b in list(members)[k:]]
    return _unique(scene.law((members[a][0], members[b][-1])) for a, b in pairs if a != b or len(members[a]) > 1)


def wall_laws(scene: Scene, wall: Wall) -> list[ContactLaw]:
    """The laws that contacts of the scene's disks with a wall have, each once."""
    number = len(scene.disks) + scene.walls.index(wall)
    first = {name: i for i, name in reversed(list(enumerate(scene.disks.material)))}
    return _unique(scene.law((i, number)) for i in first.values())


def _unique(laws: Iterable[AnyLaw]) -> list[AnyLaw]:
    return list(dict.fromkeys(laws))


def carries_shear(law: ContactLaw | SphereLaw) -> bool:
    """Whether a contact can carry shear."""
    return law.mu > 0.0 and (law.ks > 0.0 or (isinstance(law, SphereLaw) and law.g_star > 0.0))


def wall_turns(wall_motion: Sequence[Any]) -> bool:
    """Whether a wall with this motion turns."""
    return any(bool(np.any(segment.angular_velocity)) for segment in wall_motion)
