"""Right engines in single precision: our own, whose state is rounded to 24 bits after each of their own steps.

Positions, velocities, angles, spins and what contacts remember are rounded, and so is all that is reported. What a step computes in
between stays in double precision: an engine of third parties that computes in single precision rounds more often, by a small factor,
which the tolerances allow for (`ninedisk.harness.cases.rounding`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd.session import CdSession
from ninedisk.core.dem import state
from ninedisk.core.dem.session import DemSession
from ninedisk.core.dem.space.session import SphereSession
from ninedisk.core.dem.space.step_kernels import STEP
from ninedisk.core.history import History, Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene, SphereScene
from ninedisk.harness.api.engine import Engine, EngineInfo, EngineRun, Stopwatch, Support, timings_of
from ninedisk.harness.engines.cd.adapter import ENGINE as CD
from ninedisk.harness.engines.cd.adapter import expressible_scene
from ninedisk.harness.engines.dem.adapter import ENGINE as DEM
from ninedisk.harness.selftest.declared import DECLARED, Declared, as_rigid

ROUNDED = ("dem", "cd", *DECLARED)
"""Engines that can be rounded: our own, and contact dynamics declared as an engine with rigid contacts."""


class Rounded:
    """One of `ROUNDED`, rounded after each step and declared as ``precision="float32"``."""

    def __init__(self, kind: str) -> None:
        self.id = f"{kind}-single"
        self._kind = kind
        self._right: Engine = Declared(kind) if kind in DECLARED else DEM if kind == "dem" else CD

    def info(self) -> EngineInfo:
        """Facts of the engine that is rounded, but for its precision; nobody is held against its runs."""
        info = self._right.info()
        return replace(info, id=self.id, name=f"{info.name}, rounded", precision="float32", reference=False, options={})

    def supports(self, scene: Scene, numerics: Numerics) -> Support:
        """As the engine that is rounded."""
        return self._right.supports(scene, numerics)

    def run(self, scene: Scene | SphereScene, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:
        """Run to the last step, a step at a time."""
        setup, stepping = Stopwatch(), Stopwatch()
        with setup:
            if isinstance(scene, SphereScene):
                session: Any = SphereSession(scene, numerics, watch)
                run: Callable[[Any], History] = _run_spheres
            elif self._kind == "dem":
                session, run = DemSession(scene, numerics, watch), _run_disks
            else:
                given = (
                    as_rigid(scene, numerics)
                    if self._kind in DECLARED
                    else (expressible_scene(scene, numerics), numerics)
                )
                session, run = CdSession(*given, watch), _run_rigid
        with stepping:
            history = in_single(run(session))
        return EngineRun(history=history, timings=timings_of(setup, Stopwatch(), stepping))


def in_single(history: History) -> History:
    """The history with all floating-point numbers rounded to single precision, but for times."""
    fields = dict(vars(history))
    fields |= {name: _single(value) for name, value in fields.items() if name != "t" and _floats(value)}
    fields["energy"] = {name: _single(value) for name, value in history.energy.items()}
    return History(**fields)


def _single(array: NDArray[np.float64]) -> NDArray[np.float64]:
    return array.astype(np.float32).astype(np.float64)


def _floats(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.dtype == np.float64


def _round(arrays: Iterator[NDArray[np.float64]]) -> None:
    for array in arrays:
        array[...] = array.astype(np.float32)


def _run_disks(session: DemSession) -> History:
    for step in range(session.numerics.n_steps * session.substeps):
        session._advance(step + 1)
        _round(_state_of_disks(session))
    return session.history()


def _state_of_disks(session: DemSession) -> Iterator[NDArray[np.float64]]:
    disks, lists = session._disks, session._lists
    yield from (disks.x, disks.v, disks.angle, disks.omega, disks.v_now, disks.omega_now)
    for pairs in (lists.pairs, lists.wall_pairs):
        yield from (pairs.shear, pairs.bending)
    if session._outlines is not None:
        yield session._outlines.memory.contact[:, :, state.FS]


def _run_spheres(session: SphereSession) -> History:
    steps = session.numerics.n_steps * session.substeps
    while session._clock[STEP] < steps:
        step = int(session._clock[STEP])
        if session._row < len(session._samples) and step == session._samples[session._row] * session.substeps:
            session._sample(session._row)
            session._row += 1
        session._to(step + 1)
        bodies = session._state
        memory = (session._pairs[0].memory, session._at_planes[0].memory)
        _round(iter((bodies.x, bodies.v, bodies.omega, bodies.angle, bodies.v_now, bodies.omega_now, *memory)))
    session.advance(1)  # the last sample
    return session.history()


def _run_rigid(session: CdSession) -> History:
    """Velocities that a step has changed are off by up to a unit in the last place before they are rounded, as a sum of impulses is."""
    steps = session.numerics.n_steps * session.substeps
    stops = set(session._recorder.stops(session.numerics.n_steps))
    random = np.random.default_rng(0)
    while session._done < steps:
        before = session._v.copy()
        session._take_steps(session._done + 1)
        memory, changed = session._memory, session._v != before
        session._v[changed] *= 1.0 + 2.0**-23 * random.uniform(-1.0, 1.0, int(changed.sum()))
        _round(iter((session._x, session._v, memory.forces, memory.shear, memory.spring, memory.acting)))
        step = session._done // session.substeps
        if session._done == step * session.substeps and step in stops:
            session._recorder.sample(step, session._x, session._v, session._wall, memory, session._totals())
    return session._recorder.history
