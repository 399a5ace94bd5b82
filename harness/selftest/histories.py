"""Defects of what a right engine reports."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.history import History
from ninedisk.harness.selftest.defect import After, Defect

FloatArray = NDArray[np.float64]

STATE = ("x", "v", "angle", "omega", "gap", "fn", "fs")
"""Arrays of a history that describe disks and contacts, with samples as their first axis."""

WALLS = ("wall_point", "wall_angle", "wall_force")
"""Those that describe walls."""

SEED, NOISE = 1979, 1e-6

CREEP = 1e-7
"""Speed [m/s] of disks that should rest."""


def changed(change: Callable[[FloatArray], FloatArray], *names: str) -> After:
    """A report in which the named arrays are changed."""

    def after(history: History) -> History:
        new: dict[str, Any] = {name: change(getattr(history, name)) for name in names}
        return replace(history, **new)

    return after


def delayed(array: FloatArray) -> FloatArray:
    """Each sample is that of the sample before."""
    return np.concatenate([array[:1], array[:-1]])


def _mean(array: FloatArray) -> FloatArray:
    """Each sample is the mean of itself and the one before."""
    return np.concatenate([array[:1], 0.5 * (array[1:] + array[:-1])])


def _single(array: FloatArray) -> FloatArray:
    return array.astype(np.float32).astype(np.float64)


def _noisy(array: FloatArray) -> FloatArray:
    random = np.random.default_rng(SEED)
    noisy: FloatArray = array * (1.0 + NOISE * random.standard_normal(array.shape))
    return noisy


def _printed(array: FloatArray) -> FloatArray:
    """Six significant digits, as a table of text has them."""
    return np.array([float(f"{value:.5e}") for value in array.ravel()]).reshape(array.shape)


def _no_end(array: FloatArray) -> FloatArray:
    cut = array.copy()
    cut[-1] = np.nan
    return cut


def _backwards(array: FloatArray) -> FloatArray:
    """The columns of the watched pairs in the wrong order."""
    return array[:, ::-1]


def _impulses(history: History) -> History:
    step = history.t[-1] / float(history.step[-1])
    return replace(history, fn=step * history.fn, fs=step * history.fs)


def _half_step_positions(history: History) -> History:
    step = history.t[-1] / float(history.step[-1])
    return replace(history, x=history.x + 0.5 * step * history.v)


def _absolute(array: FloatArray) -> FloatArray:
    return np.abs(array)


def negated(array: FloatArray) -> FloatArray:
    """The other sign."""
    return -array


def _wrapped(array: FloatArray) -> FloatArray:
    return np.asarray(np.arctan2(np.sin(array), np.cos(array)))


def _degrees(array: FloatArray) -> FloatArray:
    return np.rad2deg(array)


def _without_tension(array: FloatArray) -> FloatArray:
    return np.maximum(array, 0.0)


def _creeping(history: History) -> History:
    x = history.x.copy()
    x[:, :, 0] += CREEP * history.t[:, None]
    return replace(history, x=x)


def _beyond(array: FloatArray) -> FloatArray:
    return (1.0 + NOISE) * array


def _double_energies(history: History) -> History:
    return replace(history, energy={name: 2.0 * series for name, series in history.energy.items()})


def _report(engine: str, name: str, what: str, witness: str, after: After, hole: str = "") -> Defect:
    return Defect(name=name, engine=engine, kind="history", what=what, witness=witness, after=after, hole=hole)


DEFECTS = (
    _report("dem", "samples-late", "every sample is that of the step before", "press", changed(delayed, *STATE)),
    _report("dem", "forces-late", "forces are those of the step before", "press", changed(delayed, "fn", "fs")),
    _report("dem", "forces-as-means", "forces are means over two samples", "press", changed(_mean, "fn", "fs")),
    _report("dem", "impulses", "impulses of a step are reported as forces", "press", _impulses),
    _report("dem", "wrong-pair", "forces belong to another contact", "press", changed(_backwards, "fn", "fs")),
    _report("dem", "spin-sign", "spins are counted clockwise", "roll", changed(negated, "angle", "omega")),
    _report("dem", "spin-in-degrees", "spins are in degrees a second", "roll", changed(_degrees, "omega")),
    _report("dem", "shear-unsigned", "shear forces have no sign", "slide", changed(_absolute, "fs")),
    _report("dem", "gap-sign", "overlaps are reported as gaps", "slide", changed(negated, "gap")),
    _report("dem", "gap-positive", "overlaps are reported as no gap", "slide", changed(_without_tension, "gap")),
    _report("dem", "noise", "one part in a million of noise on everything", "press", changed(_noisy, *STATE)),
    _report("dem", "printed", "six digits of everything are reported", "press", changed(_printed, *STATE)),
    _report("dem", "no-last-sample", "forces of the last sample are missing", "slide", changed(_no_end, "fn", "fs")),
    _report("dem", "wall-force-sign", "forces on walls have the wrong sign", "push-wall", changed(negated, "wall_force")),
    _report("dem", "wall-report-late", "walls are reported where they were a step before", "push-wall",
            changed(delayed, "wall_point", "wall_angle")),
    _report("dem", "angle-sign", "rotations, not spins, are counted clockwise", "reopen-disks",
            changed(negated, "angle")),
    _report("dem", "angle-wrapped", "rotations are reported between -pi and pi", "orbit", changed(_wrapped, "angle")),
    _report("cd", "angle-wrapped", "rotations are reported between -pi and pi", "orbit", changed(_wrapped, "angle")),
    _report("dem", "energies-twice", "all energies are twice what they are", "push-wall", _double_energies),
    _report("dem", "creep", "everything creeps by a ten-millionth of a metre a second", "hold", _creeping),
    _report("cd", "creep", "everything creeps by a ten-millionth of a metre a second", "hold", _creeping),
    _report("cd", "beyond-the-cone", "shear forces are a millionth too large", "hold", changed(_beyond, "fs")),
    _report("cd", "single-precision", "the report is in single precision", "slide", changed(_single, *STATE)),
    _report("cd", "velocity-late", "velocities are those of the step before", "slide", changed(delayed, "v", "omega")),
    _report("cd", "half-step-positions", "positions belong to half a step later", "slide", _half_step_positions),
    _report("cd", "shear-sign", "shear forces have the wrong sign", "slide", changed(negated, "fs")),
    _report("cd", "impulses", "impulses of a step are reported as forces", "slide", _impulses),
    _report("cd", "spin-sign", "spins are counted clockwise", "roll", changed(negated, "angle", "omega")),
    _report("cd", "noise", "one part in a million of noise on everything", "slide", changed(_noisy, *STATE)),
)  # fmt: skip
