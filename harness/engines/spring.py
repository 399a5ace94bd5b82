"""Engines with contact springs in a process of their own: how they fit a scene, what their drivers get, what is on record."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ninedisk.core.history import Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Scene, Wall
from ninedisk.harness.api.capabilities import LEVER_ARMS, Capability, capabilities_needed
from ninedisk.harness.api.engine import EngineRun, Support, SupportLevel
from ninedisk.harness.api.support import NOTE_SLIP_END, OF_SLIP_AT, contact_steps
from ninedisk.harness.api.wall_path import wall_path
from ninedisk.harness.engines.process import ProcessEngine

ARMS = frozenset(LEVER_ARMS.values())


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
    """Adapter of an engine that integrates linear contact springs by central differences, as the in-house DEM does.

    A subclass gives what a `ProcessEngine` asks for, and `judge`.
    """

    chosen: Mapping[str, Any]
    """Settings of every run that are chosen on purpose, for the record."""
    dashpot_note = "dashpot with the velocity of t_{n-1/2}; never tension"

    @abstractmethod
    def judge(self, scene: Scene, numerics: Numerics, fit: Fit) -> None:
        """Add to ``fit`` what the capabilities do not tell, and take out what this very scene does not ask for."""

    def supports(self, scene: Scene, numerics: Numerics) -> Support:
        """How far the engine's conventions are the scene's.

        EQUIVALENT also where dashpots see v_{n-1/2} though the numerics ask for the central form, and where slip is asked for
        elsewhere in the step: the same physics, first order in the step.
        """
        own = self.facts.capabilities
        fit = Fit(set(capabilities_needed(scene, numerics) - own))
        if own & OF_SLIP_AT and fit.missing & OF_SLIP_AT:
            fit.missing -= OF_SLIP_AT
            fit.equivalent = True
            fit.notes.append(NOTE_SLIP_END)
        self.judge(scene, numerics, fit)
        if any(law.beta > 0.0 for law in scene.laws_in_use) and Capability.CONTACT_DAMPING not in fit.missing:
            fit.notes.append(self.dashpot_note)
            fit.equivalent = fit.equivalent or numerics.damping_form == "central"
        return fit.support()

    def extra(self, scene: Scene, numerics: Numerics, folder: Path) -> Mapping[str, Any]:
        """Contact step, and the walls' path at every contact step (a file: it can be long)."""
        count, contact_dt = contact_steps(scene, numerics)
        path = folder / "wall_path.npy"
        np.save(path, wall_path(scene, contact_dt, count * numerics.n_steps))
        return {"substeps": count, "contact_dt": contact_dt, "wall_path": str(path)}

    def run(self, scene: Scene, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:
        """Run the engine; raises as `ExternalEngine.run`."""
        done = super().run(scene, numerics, watch)
        count, contact_dt = contact_steps(scene, numerics)
        settings = {
            "contact_dt": contact_dt,
            "contact_steps_per_dt": count,
            "damping_form": numerics.damping_form,
            "start": "half kick: v(1/2) = v0 + dt/2 (F0/m - xi v0), set by the driver",
            **self.chosen,
            "threads": 1,
        }
        return EngineRun(history=done.history, timings=done.timings, settings={**settings, **done.settings})


def disk_laws(scene: Scene) -> list[ContactLaw]:
    """The laws that contacts between two disks of the scene have, each once."""
    members: dict[str, list[int]] = {}
    for i, name in enumerate(scene.disks.material):
        members.setdefault(name, []).append(i)
    pairs = [(a, b) for k, a in enumerate(members) for b in list(members)[k:]]
    return _once(scene.law((members[a][0], members[b][-1])) for a, b in pairs if a != b or len(members[a]) > 1)


def wall_laws(scene: Scene, wall: Wall) -> list[ContactLaw]:
    """The laws that contacts of the scene's disks with a wall have, each once."""
    number = len(scene.disks) + scene.walls.index(wall)
    first = {name: i for i, name in reversed(list(enumerate(scene.disks.material)))}
    return _once(scene.law((i, number)) for i in first.values())


def _once(laws: Iterable[ContactLaw]) -> list[ContactLaw]:
    return list(dict.fromkeys(laws))


def rough(law: ContactLaw) -> bool:
    """Whether a contact can carry shear."""
    return law.mu > 0.0 and law.ks > 0.0


def turns(wall_motion: Sequence[Any]) -> bool:
    """Whether a wall with this motion turns."""
    return any(segment.angular_velocity for segment in wall_motion)
