"""Engines as people use them: at their own step and settings, with nothing set but the physics, or with single settings changed.

The profile ``tuned`` of an engine is what its adapter sets to come near to the physics. The profile ``stock`` leaves every setting at
the engine's own default: step, iterations, margins, cone, solver. Both are engines of their own here, ``mujoco`` and ``mujoco-stock``,
so that each has its rows, pages and history. Options of ``mujoco-stock`` are its step and the knobs of the adapter: a setting that is given
is changed, all others stay the engine's own (`ninedisk tune` looks for those that an accuracy takes).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ninedisk.core.history import Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.options import Option, read_options
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.engine import Difference, Engine, EngineInfo, EngineRun, Support, SupportLevel
from ninedisk.harness.api.knobs import Knob
from ninedisk.harness.api.registry import get_engine
from ninedisk.harness.results.schema import STOCK

MOST_STEPS = 100_000
"""Own steps of a run: minutes of the slowest engine. More of them mean a scene in units far from metres and seconds."""


@dataclass(frozen=True, kw_only=True)
class StockEngine:
    """An engine at its own settings.

    Parameters
    ----------
    of : str
        Id of the engine, whose adapter has the option ``profile``.
    step : float
        The engine's own step [s]; a run takes the longest steps up to it that divide the step ``dt`` of the case.
    step_from : str
        Where that step comes from.
    plastic : str
        Why no setting of the physics alone gives a restitution; "": one does.
    tuned_alone : tuple of Difference
        Differences that the tuned settings alone have.
    """

    of: str
    step: float
    step_from: str
    plastic: str = ""
    tuned_alone: tuple[Difference, ...] = ()

    @property
    def id(self) -> str:
        """Id of the engine and the profile."""
        return f"{self.of}{STOCK}"

    @cached_property
    def tuned(self) -> Engine:
        """The adapter."""
        return get_engine(self.of)

    def info(self) -> EngineInfo:
        """Facts about the engine; its options are the step and the adapter's knobs."""
        facts = self.tuned.info()
        differences = {each: why for each, why in facts.differences.items() if each not in self.tuned_alone}
        return replace(
            facts,
            id=self.id,
            name=f"{facts.name} (stock)",
            options=self._options,
            profile="stock",
            sweeps="",
            differences=differences,
        )

    @property
    def knobs(self) -> Mapping[str, Knob]:
        """Settings besides the step that a run may change."""
        found: Mapping[str, Knob] = getattr(self.tuned, "knobs", {})
        return found

    @cached_property
    def _options(self) -> Mapping[str, Option]:
        why = f"longest step [s] ({self.step_from}); a run takes the longest up to it that divide dt"
        return {"step": Option(default=self.step, low_open=True, why=why), **self.knobs}

    def supports(self, scene: Any, numerics: Numerics) -> Support:
        """As the adapter; never better than approximate."""
        support = self.tuned.supports(scene, numerics)
        if support.level is SupportLevel.NO:
            return support
        if self.plastic and any(law.restitution for law in scene.laws_in_use):
            return Support(SupportLevel.NO, (Capability.RESTITUTION,), (self.plastic,))
        steps = self._parts(numerics) * numerics.n_steps
        if steps > MOST_STEPS:
            return Support(
                SupportLevel.NO,
                notes=(f"it takes {steps:.2g} of the engine's own steps, at most {MOST_STEPS:g} are run",),
            )
        note = f"every setting is the engine's own, its step of {self.step:g} s included ({self.step_from})"
        if changed := [name for name in numerics.options if name.startswith(f"{self.id}.")]:
            note = f"every other setting than {', '.join(changed)} is the engine's own"
        if numerics.dt < self._longest(numerics):
            note += f"; samples each {numerics.dt:g} s ask for shorter steps"
        return Support(SupportLevel.APPROXIMATE, support.missing, (note, *support.notes))

    def run(self, scene: Any, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:
        """Run the scene; raises what the adapter raises."""
        read_options(self.id, self._options, numerics)
        parts = self._parts(numerics)
        until = numerics.sample_until
        # Options of the tuned engine, in a run of both, are not this one's.
        others = {
            name: value
            for name, value in numerics.options.items()
            if not name.startswith(f"{self.of}.") and name != f"{self.id}.step"
        }
        finer = numerics.replace(
            dt=numerics.dt / parts,
            n_steps=numerics.n_steps * parts,
            sample_every=numerics.sample_every * parts,
            sample_from=numerics.sample_from * parts,
            sample_until=None if until is None else until * parts,
            contact_dt=None,
            options={**others, f"{self.of}.profile": "stock"},
        )
        run = self.tuned.run(scene, finer, watch)
        history = replace(run.history, step=np.asarray(run.history.step) // parts)
        settings: Mapping[str, Any] = {**run.settings, "profile": "stock", "own step [s]": finer.dt}
        return replace(run, history=history, settings=settings)

    def _parts(self, numerics: Numerics) -> int:
        """Own steps in one ``dt``; round-off must not halve the engine's own step."""
        return max(1, math.ceil(numerics.dt / self._longest(numerics) * (1.0 - 1e-12)))

    def _longest(self, numerics: Numerics) -> float:
        return float(numerics.options.get(f"{self.id}.step", self.step))


ENGINES = (
    StockEngine(of="pymunk", step=0.02, step_from="the example in pymunk's documentation"),
    StockEngine(of="bullet", step=1.0 / 240.0, step_from="Bullet's fixedTimeStep"),
    StockEngine(of="dart", step=1e-3, step_from="DART's World"),
    StockEngine(of="box2d", step=1.0 / 60.0, step_from="the example in Box2D's manual"),
    StockEngine(
        of="mujoco",
        step=2e-3,
        step_from="MuJoCo's option timestep",
        plastic="MuJoCo has no coefficient of restitution: it asks for a tuned solref",
    ),
    StockEngine(of="drake-sap", step=1e-3, step_from="Drake's MultibodyPlantConfig"),
    StockEngine(of="drake-lagged", step=1e-3, step_from="Drake's MultibodyPlantConfig"),
    StockEngine(of="jolt", step=1.0 / 60.0, step_from="Jolt's HelloWorld example"),
    StockEngine(
        of="sapien",
        step=0.01,
        step_from="SAPIEN's PhysxCpuSystem",
        # Its own solver is TGS.
        tuned_alone=(
            Difference.FRICTION_PYRAMID,
            Difference.FRICTION_AT_TWO_CORNERS,
            Difference.IMPULSES_OF_OTHERS,
            Difference.BOXES_ROCK,
        ),
    ),
)
"""All of them."""
