"""What a sound adapter does besides computing: form of its answers, its conduct, and whether `supports` is right."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import fields, replace

import numpy as np

from ninedisk.core.errors import CoreError
from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.options import Option
from ninedisk.core.scene import ContactLaw, Scene
from ninedisk.harness.api.capabilities import SLIP_AT, Capability, capabilities_needed
from ninedisk.harness.api.engine import EngineError, EngineInfo, EngineRun, Support, SupportLevel
from ninedisk.harness.api.support import NOTE_SOFT
from ninedisk.harness.cases.adapter.probes import COARSE, KN, OMEGA, Probe, on_floor, round_off
from ninedisk.harness.check_engine.outcomes import (
    MUST_BE_NUMBERS,
    PASS,
    REFUSED,
    UNSEEN,
    Bench,
    Outcome,
    outcome,
)
from ninedisk.harness.run.judge import check_history
from ninedisk.harness.wire.protocol import MEANINGS

REFUSAL = "raise CoreError or EngineError with a message that names the bad value and the way out"


def _run_again(bench: Bench, probe: Probe) -> EngineRun:
    """One more run of a probe, which is not kept."""
    return bench.run_anew(probe.setup.scene, probe.setup.numerics, probe.setup.watch)


def determinism(bench: Bench, probe: Probe) -> Outcome:
    """Two runs of a scene with contacts give the same bits."""
    one, two = bench.run_of(probe).history, _run_again(bench, probe).history
    differ = [
        field.name
        for field in fields(History)
        if isinstance(array := getattr(one, field.name), np.ndarray)
        and not np.array_equal(array, getattr(two, field.name), equal_nan=True)
    ]
    mend = "fix seeds, orders and threads; one thread is the rule"
    return outcome(
        "determinism", [(f"two runs differ in {', '.join(differ)}", mend)] if differ else [], "two runs, the same bits"
    )


def input_unchanged(bench: Bench, probe: Probe) -> Outcome:
    """A run, and the question whether it is supported, leave scene, numerics and watched pairs as they were."""
    setup = probe.setup
    scene, numerics = type(setup.scene).from_dict(setup.scene.to_dict()), Numerics.from_dict(setup.numerics.to_dict())
    watch = list(setup.watch)
    before = _text(scene, numerics, watch)
    bench.engine.supports(scene, numerics)
    bench.run_anew(scene, numerics, watch)
    mend = "Scene and Numerics are values: work on copies (Scene.replace)"
    faults = (
        []
        if _text(scene, numerics, watch) == before
        else [("the scene, the numerics or the watched pairs changed", mend)]
    )
    return outcome("input", faults, "scene, numerics and pairs as they were")


def _text(scene: Scene, numerics: Numerics, watch: list[tuple[int, int]]) -> str:
    return json.dumps([scene.to_dict(), numerics.to_dict(), watch], sort_keys=True)


def start(bench: Bench, probe: Probe) -> Outcome:
    """The first sample is the state that was given: neither the set-up nor the warm-up has moved it."""
    history, bodies = bench.run_of(probe).history, probe.setup.scene.bodies
    bound = round_off(bench.info())
    mend = "warm up on a copy of the state, or on a separate scene; observe step 0 before the first step"
    faults = []
    for name, wanted in (("x", bodies.x), ("v", bodies.v), ("omega", bodies.omega), ("angle", 0.0 * bodies.omega)):
        apart = np.abs(getattr(history, name)[0] - wanted)
        if apart.max(initial=0.0) > bound:  # NaN is not observed, and no larger than anything
            faults.append((f"{name} at step 0 is off by {apart.max():.3g}", mend))
    return outcome("warm-up", faults, "step 0 is the state that was given")


def impossible(bench: Bench, probe: Probe) -> Outcome:
    """Requests that cannot be met are refused with an error of ours, and not answered."""
    info, setup = bench.info(), probe.setup
    requests: dict[str, Request] = {
        "a watched pair of bodies that do not exist": (setup.scene, setup.numerics, ((0, 99),))
    }
    if info.options:
        wrong = setup.numerics.replace(options={f"{info.id}.no_such_option": 1})
        requests["an option that does not exist"] = (setup.scene, wrong, setup.watch)
    faults = [fault for what, request in requests.items() if (fault := _answer_fault(bench, what, request))]
    if info.contact == "spring":
        faults += _unstable(bench)
    return outcome("refusals", faults, f"{len(requests) + (info.contact == 'spring')} impossible requests refused")


Request = tuple[Scene, Numerics, tuple[tuple[int, int], ...]]


def _answer_fault(bench: Bench, what: str, request: Request) -> tuple[str, str] | None:
    """The fault of answering a request, or of refusing it by an error that is none of ours."""
    try:
        bench.run_anew(*request)
    except (CoreError, EngineError):
        return None
    except Exception as error:
        return f"{what} ends in {type(error).__name__}: {error}", REFUSAL
    return f"{what} is answered", REFUSAL


def _unstable(bench: Bench) -> list[tuple[str, str]]:
    """Refuse a contact step of ten over omega, five times the critical one, or take a smaller one: a rebound gains no speed."""
    speed = 0.1
    scene = on_floor(ContactLaw(kn=KN), gravity=(0.0, 0.0), v=[[0.0, -speed]])
    numerics = Numerics(dt=10.0 / OMEGA, contact_dt=10.0 / OMEGA, n_steps=20)
    if bench.supports(scene, numerics).level is SupportLevel.NO:
        return []
    try:
        fastest = float(np.abs(bench.run_anew(scene, numerics, ()).history.v).max())
    except (CoreError, EngineError):
        return []
    except Exception as error:
        return [(f"a contact step beyond the critical one ends in {type(error).__name__}: {error}", REFUSAL)]
    if fastest <= (1.0 + COARSE) * speed:
        return []
    return [
        (
            f"a contact step beyond the critical one is answered with a rebound of {fastest:.3g} from {speed:g} m/s",
            REFUSAL,
        )
    ]


CONTACTS = ("spring", "impulse", "cd", "soft")


def facts(engine_id: str, info: EngineInfo) -> Outcome:
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
    if info.sweeps and info.sweeps not in info.options:
        faults.append(
            (
                f"sweeps names {info.sweeps!r}, which is no option",
                "sweeps is the name of one of info().options, or empty",
            )
        )
    return outcome("facts", faults, f"{info.name} {info.version}, {info.contact} contacts, {info.precision}")


def form(bench: Bench, probe: Probe) -> Outcome:
    """Shapes, types, finite numbers, meaning of forces, timings."""
    run = bench.run_of(probe)
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
    return outcome("form", faults, "shapes, types, finite numbers, timings")


def sampling(bench: Bench, probe: Probe) -> Outcome:
    """The state at the steps that were asked for, which are neither all nor regular."""
    history = bench.run_of(probe).history
    wanted = probe.setup.numerics.sampled_steps()
    mend = "sample at numerics.sampled_steps(), and t = step dt"
    if not np.array_equal(history.step, wanted):
        return outcome("sampling", [(f"steps {history.step.tolist()} instead of {wanted.tolist()}", mend)])
    late = float(np.abs(history.t - wanted * probe.setup.numerics.dt).max())
    if late > 1e-9 * probe.setup.numerics.dt * wanted[-1]:
        return outcome("sampling", [(f"times are off by {late:.3g} s", mend)])
    faults = [replace(fault, mend=mend) for fault in bench.faults(probe)]
    return outcome("sampling", faults, f"steps {wanted.tolist()}")


def copies(bench: Bench, probe: Probe) -> Outcome:
    """Observations belong to the caller: no two share memory, and a later run does not change them."""
    history = bench.run_of(probe).history
    arrays = {f.name: a for f in fields(History) if isinstance(a := getattr(history, f.name), np.ndarray) and a.size}
    mend = "write copies of the state into History: history.x[row] = state, not history.x = state"
    names, faults = list(arrays), []
    for k, one in enumerate(names):
        for two in names[k + 1 :]:
            if np.shares_memory(arrays[one], arrays[two]):
                faults.append((f"{one} and {two} share memory", mend))
        if len(arrays[one]) > 1 and arrays[one].strides[0] == 0:
            faults.append((f"every sample of {one} is the same memory", mend))
        if np.shares_memory(arrays[one], probe.setup.scene.bodies.x):
            faults.append((f"{one} is the scene's own memory", mend))
    before = {name: array.copy() for name, array in arrays.items()}
    _run_again(bench, probe)
    changed = [name for name in names if not np.array_equal(arrays[name], before[name], equal_nan=True)]
    faults += [(f"{name} changed with the next run", mend) for name in changed]
    return outcome("copies", faults, "separate arrays, untouched by a second run")


def settings(bench: Bench, probe: Probe) -> Outcome:
    """What was chosen deliberately is on record, with the values that acted."""
    recorded, faults = dict(bench.run_of(probe).settings), []
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
    lacking = [name for name in bench.info().options if f"{bench.info().id}.{name}" not in recorded]
    faults += [(f"the option {name} is not recorded", mend) for name in lacking]
    if changed := _changed_option(bench.info()):
        name, value = changed
        numerics = probe.setup.numerics.replace(options={name: value})
        found = bench.run_anew(probe.setup.scene, numerics, probe.setup.watch).settings.get(name)
        if found != value:
            faults.append((f"{name} = {value!r} was asked for, {found!r} is recorded", mend))
    return outcome("settings", faults, f"{len(recorded)} recorded")


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


def capability(bench: Bench, probe: Probe, asked: Capability) -> Outcome:
    """One capability: refused for a reason, or matched by the run of its probe."""
    name = f"supports: {asked.name}"
    support = bench.supports(probe.setup.scene, probe.setup.numerics)
    if support.level is SupportLevel.NO:
        return _refusal(name, bench, support, asked)
    lacking = capabilities_needed(probe.setup.scene, probe.setup.numerics) - bench.info().capabilities
    if lacking and support.level is not SupportLevel.APPROXIMATE and not support.notes:
        lacks = ", ".join(sorted(each.name for each in lacking))
        mend = "declare it in info(), or answer NO or APPROXIMATE, or say in a note why this scene does not need it"
        return outcome(name, [(f"the scene is {support.level} although info() lacks {lacks}", mend)])
    # An engine may lack the place of the slip and run the scene all the same, if it says so: that place is no separate claim.
    may_lack = support.level is SupportLevel.APPROXIMATE or (
        asked in SLIP_AT.values() and support.level is SupportLevel.EQUIVALENT
    )
    return judge_probe(name, bench, probe, support, claimed=asked in bench.info().capabilities or not may_lack)


def judge_probe(
    name: str, bench: Bench, probe: Probe, support: Support, *, claimed: bool = True, strict: bool = False
) -> Outcome:
    """The run of a probe against its closed form, coarsely where it is graded approximate, unless its bounds hold for that too."""
    # Softness is in the bounds of contacts already, and what never touches has none.
    scene = probe.setup.scene
    touches = bool(scene.walls) or len(scene.bodies) > 1
    coarse = not strict and support.level is SupportLevel.APPROXIMATE and touches and NOTE_SOFT not in support.notes
    faults = bench.faults(probe, coarse=coarse)
    if not claimed:
        return Outcome(check=name, status=PASS, found=f"{probe.title}: not claimed, runs as {support.level}")
    unseen = tuple(bench.unseen(probe))
    found = f"{probe.title}: {support.level}" + (f"; not observed: {', '.join(unseen)}" if unseen else "")
    if not faults and len(unseen) == len(probe.closed_forms(bench.run_of(probe).history)):
        return Outcome(check=name, status=UNSEEN, found=found, unseen=unseen)
    reported = [replace(fault, found=f"{probe.title}: {fault.found}") for fault in faults]
    return replace(outcome(name, reported, found), unseen=unseen)


def _refusal(name: str, bench: Bench, support: Support, asked: Capability) -> Outcome:
    missing, claimed = ", ".join(each.name for each in support.missing), asked in bench.info().capabilities
    if not support.missing and not support.notes:
        mend = "a refusal names the missing capabilities, or says in a note what stands against this scene"
        return outcome(name, [("refused without a reason", mend)])
    declared = sorted(each.name for each in support.missing if each in bench.info().capabilities)
    if declared and not support.notes:
        mend = "take it out of info().capabilities, or say in a note what stands against this scene"
        return outcome(name, [(f"refused for {', '.join(declared)}, which info() declares", mend)])
    why = f"lacks {missing}" if missing else "; ".join(support.notes)
    found = f"{why} (declared, but not in this scene)" if claimed else why
    return Outcome(check=name, status=REFUSED, found=found, declared=claimed)
