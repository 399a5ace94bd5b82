"""Checks of an adapter's conduct: the same answer twice, its input left alone, impossible requests refused."""

from __future__ import annotations

import json
from dataclasses import fields

import numpy as np

from ninedisk.core.errors import CoreError
from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Scene
from ninedisk.harness.api.engine import EngineError, SupportLevel
from ninedisk.harness.check_engine.claims import COARSE, Probe, round_off
from ninedisk.harness.check_engine.contacts import OMEGA
from ninedisk.harness.check_engine.findings import Bench, Finding, finding
from ninedisk.harness.check_engine.scenes import KN, on_floor

REFUSAL = "raise CoreError or EngineError with a message that names the bad value and the way out"


def determinism(bench: Bench, probe: Probe) -> Finding:
    """Two runs of a scene with contacts give the same bits."""
    one, two = bench.run(probe).history, bench.run(probe, again=True).history
    differ = [
        field.name
        for field in fields(History)
        if isinstance(array := getattr(one, field.name), np.ndarray)
        and not np.array_equal(array, getattr(two, field.name), equal_nan=True)
    ]
    mend = "fix seeds, orders and threads; one thread is the rule"
    return finding(
        "determinism", [(f"two runs differ in {', '.join(differ)}", mend)] if differ else [], "two runs, the same bits"
    )


def input_unchanged(bench: Bench, probe: Probe) -> Finding:
    """A run, and the question whether it is supported, leave scene, numerics and watched pairs as they were."""
    setup = probe.setup
    scene, numerics = Scene.from_dict(setup.scene.to_dict()), Numerics.from_dict(setup.numerics.to_dict())
    watch = list(setup.watch)
    before = _text(scene, numerics, watch)
    bench.engine.supports(scene, numerics)
    bench.engine.run(scene, numerics, watch)
    mend = "Scene and Numerics are values: work on copies (Scene.replace)"
    faults = (
        []
        if _text(scene, numerics, watch) == before
        else [("the scene, the numerics or the watched pairs changed", mend)]
    )
    return finding("input", faults, "scene, numerics and pairs as they were")


def _text(scene: Scene, numerics: Numerics, watch: list[tuple[int, int]]) -> str:
    return json.dumps([scene.to_dict(), numerics.to_dict(), watch], sort_keys=True)


def start(bench: Bench, probe: Probe) -> Finding:
    """The first sample is the state that was given: neither the set-up nor the warm-up has moved it."""
    history, disks = bench.run(probe).history, probe.setup.scene.disks
    bound = round_off(bench.info)
    mend = "warm up on a copy of the state, or on a scene of its own; observe step 0 before the first step"
    faults = []
    for name, wanted in (("x", disks.x), ("v", disks.v), ("omega", disks.omega), ("angle", 0.0 * disks.omega)):
        apart = np.abs(getattr(history, name)[0] - wanted)
        if apart.max(initial=0.0) > bound:  # NaN is not observed, and no larger than anything
            faults.append((f"{name} at step 0 is off by {apart.max():.3g}", mend))
    return finding("warm-up", faults, "step 0 is the state that was given")


def impossible(bench: Bench, probe: Probe) -> Finding:
    """Requests that cannot be met are refused with an error of ours, and not answered."""
    info, setup = bench.info, probe.setup
    requests: dict[str, Request] = {
        "a watched pair of bodies that do not exist": (setup.scene, setup.numerics, ((0, 99),))
    }
    if info.options:
        wrong = setup.numerics.replace(options={f"{info.id}.no_such_option": 1})
        requests["an option that does not exist"] = (setup.scene, wrong, setup.watch)
    faults = [fault for what, request in requests.items() if (fault := _answered(bench, what, request))]
    if info.contact == "spring":
        faults += _unstable(bench)
    return finding("refusals", faults, f"{len(requests) + (info.contact == 'spring')} impossible requests refused")


Request = tuple[Scene, Numerics, tuple[tuple[int, int], ...]]


def _answered(bench: Bench, what: str, request: Request) -> tuple[str, str] | None:
    """The fault of answering a request, or of refusing it by an error that is none of ours."""
    try:
        bench.engine.run(*request)
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
    if bench.engine.supports(scene, numerics).level is SupportLevel.NO:
        return []
    try:
        fastest = float(np.abs(bench.engine.run(scene, numerics, ()).history.v).max())
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
