"""Checks of an answer's form: shapes and types, sampling, copies, what is recorded."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.options import Option
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.engine import EngineError, EngineInfo
from ninedisk.harness.check_engine.claims import Probe
from ninedisk.harness.check_engine.findings import Bench, Finding, finding
from ninedisk.harness.run.observation import check_history
from ninedisk.harness.wire.protocol import MEANINGS

CONTACTS = ("spring", "impulse", "cd", "soft")
MUST_BE_NUMBERS = ("step", "t", "x", "v")
"""Arrays that no engine may leave unobserved."""


def facts(engine_id: str, info: EngineInfo) -> Finding:
    """`info` says what reports and references need, in the words that they know."""
    faults = []
    if info.id != engine_id:
        faults.append((f"info().id is {info.id!r}, the engine's is {engine_id!r}", "one id everywhere"))
    if info.contact not in CONTACTS:
        faults.append((f"contact is {info.contact!r}", f"use one of {', '.join(CONTACTS)}"))
    for name in ("name", "version", "scheme", "licence", "how_it_runs", "precision", "install"):
        value = getattr(info, name)
        if not (isinstance(value, str) and value.strip()):
            faults.append((f"{name} is {value!r}", f"info().{name} is a text for the reports"))
    strange = [each for each in info.capabilities if not isinstance(each, Capability)]
    if strange:
        faults.append((f"capabilities hold {strange!r}", "capabilities are members of Capability"))
    for name, option in info.options.items():
        if not isinstance(option, Option):
            faults.append((f"option {name!r} is {option!r}", "options are Option(...)"))
    return finding("facts", faults, f"{info.name} {info.version}, {info.contact} contacts, {info.precision}")


def form(bench: Bench, probe: Probe) -> Finding:
    """Shapes, types, finite numbers, meaning of forces, timings."""
    run = bench.run(probe)
    history, faults = run.history, []
    for field in fields(History):
        array = getattr(history, field.name)
        if not isinstance(array, np.ndarray):
            continue
        wanted = np.int64 if field.name == "step" else np.float64
        if array.dtype != wanted:
            faults.append((f"{field.name} is of type {array.dtype}", f"{field.name} is an array of {np.dtype(wanted)}"))
        if field.name in MUST_BE_NUMBERS and array.dtype.kind == "f" and not np.isfinite(array).all():
            faults.append((f"{field.name} is not finite", "steps, times, positions and velocities are always numbers"))
    try:
        check_history(history, probe.setup)
    except EngineError as error:
        faults.append((str(error), "History.empty makes arrays of the right shapes from numerics.sampled_steps()"))
    if history.force_meaning not in MEANINGS:
        faults.append((f"force_meaning is {history.force_meaning!r}", f"use one of {', '.join(MEANINGS)}"))
    for name in ("setup", "warm_up", "advance"):
        seconds = getattr(run.timings, name)
        if not (isinstance(seconds, float) and math.isfinite(seconds) and seconds >= 0.0):
            faults.append((f"timings.{name} is {seconds!r}", "timings are seconds of wall-clock time, >= 0"))
    return finding("form", faults, "shapes, types, finite numbers, timings")


def sampling(bench: Bench, probe: Probe) -> Finding:
    """The state at the steps that were asked for, which are neither all nor regular."""
    history = bench.run(probe).history
    wanted = probe.setup.numerics.sampled_steps()
    mend = "sample at numerics.sampled_steps(), and t = step dt"
    if not np.array_equal(history.step, wanted):
        return finding("sampling", [(f"steps {history.step.tolist()} instead of {wanted.tolist()}", mend)])
    late = float(np.abs(history.t - wanted * probe.setup.numerics.dt).max())
    faults = [] if late <= 1e-9 * probe.setup.numerics.dt * wanted[-1] else [(f"times are off by {late:.3g} s", mend)]
    faults += [(claim.text(), mend) for claim in probe.claims(history) if not claim.holds()]
    return finding("sampling", faults, f"steps {wanted.tolist()}")


def copies(bench: Bench, probe: Probe) -> Finding:
    """Observations belong to the caller: no two share memory, and a later run does not change them."""
    history = bench.run(probe).history
    arrays = {f.name: a for f in fields(History) if isinstance(a := getattr(history, f.name), np.ndarray) and a.size}
    mend = "write copies of the state into History: history.x[row] = state, not history.x = state"
    names, faults = list(arrays), []
    for k, one in enumerate(names):
        for two in names[k + 1 :]:
            if np.shares_memory(arrays[one], arrays[two]):
                faults.append((f"{one} and {two} share memory", mend))
        if len(arrays[one]) > 1 and arrays[one].strides[0] == 0:
            faults.append((f"every sample of {one} is the same memory", mend))
        if np.shares_memory(arrays[one], probe.setup.scene.disks.x):
            faults.append((f"{one} is the scene's own memory", mend))
    before = {name: array.copy() for name, array in arrays.items()}
    bench.run(probe, again=True)
    changed = [name for name in names if not np.array_equal(arrays[name], before[name], equal_nan=True)]
    faults += [(f"{name} changed with the next run", mend) for name in changed]
    return finding("copies", faults, "arrays of their own, untouched by a second run")


def settings(bench: Bench, probe: Probe) -> Finding:
    """What was chosen on purpose is on record, with the values that acted."""
    recorded, faults = dict(bench.run(probe).settings), []
    if not recorded:
        faults.append(
            ("the run has no settings", "record every setting that the adapter chooses: steps, solver, tolerances")
        )
    strange = [name for name, value in recorded.items() if not _plain(value)]
    faults += [
        (f"the setting {name!r} is {recorded[name]!r:.80}", "settings are texts, numbers, true or false")
        for name in strange
    ]
    mend = "record each option by its full name, ENGINE.OPTION, with the value that acted"
    lacking = [name for name in bench.info.options if f"{bench.info.id}.{name}" not in recorded]
    faults += [(f"the option {name} is not recorded", mend) for name in lacking]
    if changed := _changed_option(bench.info):
        name, value = changed
        numerics = probe.setup.numerics.replace(options={name: value})
        found = bench.engine.run(probe.setup.scene, numerics, probe.setup.watch).settings.get(name)
        if found != value:
            faults.append((f"{name} = {value!r} was asked for, {found!r} is recorded", mend))
    return finding("settings", faults, f"{len(recorded)} recorded")


def _plain(value: object) -> bool:
    if isinstance(value, Mapping):
        return all(isinstance(key, str) and _plain(each) for key, each in value.items())
    if isinstance(value, list | tuple):
        return all(_plain(each) for each in value)
    return value is None or isinstance(value, str | int | float | bool | np.generic)


def _changed_option(info: EngineInfo) -> tuple[str, float] | None:
    """Full name of the engine's first number among its options, and an allowed value beside the default."""
    for name, option in info.options.items():
        if option.choices or not isinstance(option.default, int | float):
            continue
        twice, middle = 2.0 * option.default, 0.5 * (option.default + min(option.high, 1.0))
        allowed = (value for value in (twice, middle, option.low) if option.low <= value <= option.high)
        value = next(value for value in allowed if value != option.default)
        return f"{info.id}.{name}", int(value) if option.whole else float(value)
    return None
