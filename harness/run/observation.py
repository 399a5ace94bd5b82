"""Histories as engines give them: blank ones for a dry run, checks of form, and frames for the reports."""

from __future__ import annotations

from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.harness.api.case import Setup
from ninedisk.harness.api.engine import EngineError

MAX_FRAMES = 12
"""Sampled configurations that a stored cell keeps: enough to see a motion, small enough for every cell."""


def blank_history(setup: Setup) -> History:
    """A history of the right shapes that holds no number at all."""
    steps = setup.numerics.sampled_steps()
    return History.empty(
        steps,
        np.asarray(steps * setup.numerics.dt, dtype=np.float64),
        n_disks=len(setup.scene.disks),
        n_walls=len(setup.scene.walls),
        pairs=tuple(setup.scene.check_pair(pair) for pair in setup.watch),
    )


def check_history(history: History, setup: Setup) -> None:
    """Refuse an answer of the wrong form, before anything is computed from it.

    Raises
    ------
    EngineError
        If an array's shape or the sampled steps are not those that were asked for, times are wrong, or a
        number is infinite.
    """
    wanted = blank_history(setup)
    for name in ("step", "t", "x", "v", "angle", "omega", "gap", "fn", "fs", "wall_point", "wall_angle", "wall_force"):
        array, want = np.asarray(getattr(history, name)), getattr(wanted, name)
        if array.shape != want.shape:
            raise EngineError(f"the engine answered {name} of shape {array.shape} instead of {want.shape}")
        if array.dtype.kind not in "iuf":
            raise EngineError(f"the engine answered {name} of type {array.dtype} instead of numbers")
        if np.isinf(array).any():
            row = int(np.argwhere(np.isinf(array))[0][0])
            raise EngineError(f"the engine answered an infinite {name} at step {int(wanted.step[row])}")
    if not np.array_equal(history.step, wanted.step):
        raise EngineError("the engine sampled other steps than it was asked for")
    # Engines may accumulate t by adding dt: round-off of n additions, far below a step.
    if not np.allclose(history.t, wanted.t, rtol=1e-6, atol=1e-6 * setup.numerics.dt):
        raise EngineError("the engine's times are not its steps times dt")
    if history.pairs != wanted.pairs:
        raise EngineError(f"the engine watched the contacts {history.pairs} instead of {wanted.pairs}")


def frames(history: History) -> dict[str, Any]:
    """At most `MAX_FRAMES` sampled configurations as plain data: first and last, and the first of the regular samples.

    Regular sampling may begin long after step 0 (``Numerics.sample_from``); what happened until then is one frame.
    """
    count = len(history.step)
    rows = np.linspace(min(1, count - 1), count - 1, min(count, MAX_FRAMES - 1)).round().astype(np.int64)
    rows = np.unique(np.append(rows, 0))
    picked: dict[str, Any] = {"step": history.step[rows].tolist(), "t": history.t[rows].tolist()}
    for name in ("x", "angle", "wall_point", "wall_angle"):
        picked[name] = np.asarray(getattr(history, name))[rows].tolist()
    return picked
