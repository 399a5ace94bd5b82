"""A case with a closed form and engines that behave in every way an engine can; installed as a package by the tests."""

# ruff: noqa: ARG002  (the protocols fix the arguments)

import ctypes
import os
import signal
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ninedisk.core.errors import InvalidSceneError, UnstableTimeStepError
from ninedisk.core.history import History, Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.case import Check, Observed, Parameter, Setup
from ninedisk.harness.api.claims import Cells, Claim, Verdict, scalar
from ninedisk.harness.api.engine import (
    EngineError,
    EngineInfo,
    EngineNotInstalledError,
    EngineRun,
    EngineTimeoutError,
    Support,
    SupportLevel,
    Timings,
)
from ninedisk.harness.results.figures import Figure, Plotted
from ninedisk.harness.run.isolation import run_isolated

STUBBORN = """
import signal, subprocess, sys, time
for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
    signal.signal(number, signal.SIG_IGN)
quiet = dict(stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"], start_new_session=True, **quiet)
open("stubborn.started", "w").close()
time.sleep(600)
"""
"""An engine's process that ignores whoever asks it to end, and has a child in another session."""


def falls(cells: Cells) -> Verdict:
    way = min(scalar(cell, "x_final") for cell in cells)
    return way > 0.0, f"shortest way {way:g} m"


class FallingDisk:
    """One disk that is pulled by gravity: x = a t^2/2."""

    id = "fake/fall"
    version = 1
    title = "Falling disk"
    source = "mechanics"
    requirement = "x = a t^2/2"
    figures = (Figure(title="The fall", quantities=(Plotted("x", "way"),), shows="The way.", allows="It falls."),)
    claims = (
        Claim(
            id="it-falls",
            place="p. 1",
            text="What is heavy falls.",
            decided_by="The way is positive.",
            rule=falls,
            derivation=("Nothing else can follow.",),
        ),
    )
    parameters = (
        Parameter(name="a", default=1.0, help="acceleration", unit="m/s^2", low=0.0, in_id=True),
        Parameter(name="dt", default=0.1, help="step", unit="s", low=0.0, low_open=True),
        Parameter(name="steps", default=10, help="steps", whole=True, low=1),
        Parameter(
            name="truth", default="plain", help="which truths", choices=("plain", "gap", "nan", "none", "broken")
        ),
    )

    def matrix(self) -> Sequence[Mapping[str, Any]]:
        return [{"a": 1.0}, {"a": 2.0}]

    def build(self, params: Mapping[str, Any]) -> Setup:
        if params["a"] > 100.0:
            raise InvalidSceneError(f"a = {params['a']:g} is too much for this scene: use at most 100")
        scene = Scene(
            disks=Disks(x=[[0.0, 0.0]], radius=1.0, mass=1.0),
            disk_disk=ContactLaw(kn=1.0),
            gravity=(params["a"], 0.0),
        )
        return Setup(scene=scene, numerics=Numerics(dt=params["dt"], n_steps=params["steps"]), watch=())

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        x, v = history.x[:, 0, 0], history.v[:, 0, 0]
        return Observed(
            step=history.step,
            t=history.t,
            series={"x": ("m", x), "v": ("m/s", v)},
            scalars={"x_final": ("m", float(x[-1])), "v_final": ("m/s", float(v[-1]))},
        )

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        if params["truth"] == "broken":
            raise RuntimeError("a truth is broken")
        if params["truth"] == "none":
            return []
        exact = 0.5 * params["a"] * observed.t**2
        expected = np.full(len(observed.t), np.nan) if params["truth"] == "nan" else exact
        gap = "planted gap" if params["truth"] == "gap" else ""
        common: dict[str, Any] = {"truth": "analytic", "source": "mechanics", "gap_reason": gap}
        return [
            Check(quantity="x", norm="max", expected=expected, rtol=1e-9, why="round-off", **common),
            Check(quantity="x_final", norm="scalar", expected=exact[-1], atol=1e-9, why="round-off", **common),
        ]


CASE = FallingDisk()


class SpinningDisk(FallingDisk):
    """The same without the parameter ``a``."""

    id = "fake/spin"
    parameters = (
        Parameter(name="dt", default=0.1, help="step", unit="s", low=0.0, low_open=True),
        Parameter(name="steps", default=10, help="steps", whole=True, low=1),
    )

    def matrix(self) -> Sequence[Mapping[str, Any]]:
        return [{}]

    def build(self, params: Mapping[str, Any]) -> Setup:
        return super().build({**params, "a": 1.0})

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        return super().checks({**params, "a": 1.0, "truth": "plain"}, setup, observed, engine)


CASES = (CASE, SpinningDisk())


class FakeEngine:
    """Solves the fall exactly, then does what its name says."""

    def __init__(self, behaviour: str) -> None:
        self.id = f"fake-{behaviour}"
        self.behaviour = behaviour

    def info(self) -> EngineInfo:
        if self.behaviour == "shy":
            raise RuntimeError("no facts")
        return EngineInfo(
            id=self.id,
            name=f"Fake {self.behaviour}",
            version=None if self.behaviour == "absent" else "1.0",
            scheme="exact",
            contact="spring",
            licence="MIT",
            how_it_runs="in process",
            precision="float64",
            threads=2 if self.behaviour == "wide" else 1,
            install="pip install fake",
            capabilities=frozenset(),
            not_installed_because="it was never built" if self.behaviour == "absent" else "",
        )

    def supports(self, scene: Scene, numerics: Numerics) -> Support:
        if self.behaviour == "incapable":
            return Support(SupportLevel.NO, missing=(Capability.GRAVITY,), notes=("weightless",))
        return Support(SupportLevel.EXACT)

    def run(self, scene: Scene, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:
        steps = numerics.sampled_steps()
        history = History.empty(steps, steps * numerics.dt, n_disks=1, n_walls=0, pairs=())
        a = scene.gravity[0]
        history.x[:, 0, 0] = 0.5 * a * history.t**2
        history.v[:, 0, 0] = a * history.t
        self._misbehave(history, numerics)
        return EngineRun(
            history=history,
            timings=Timings(setup=0.1, warm_up=0.2, advance=1e300 if self.behaviour == "eternal" else 0.3),
            settings={"kind": "fake"},
        )

    def _misbehave(self, history: History, numerics: Numerics) -> None:
        if self.behaviour == "wrong":
            history.x[4:] += 1e-3
        elif self.behaviour == "nan":
            history.x[3] = np.nan
        elif self.behaviour == "blind":
            history.x[:] = np.nan
        elif self.behaviour == "infinite":
            history.x[2] = np.inf
        elif self.behaviour == "garbage":
            object.__setattr__(history, "x", history.x[:-1])
        elif self.behaviour == "crash":
            raise EngineError("\n".join(f"line {n}" for n in range(100)) + "\nsegmentation fault")
        elif self.behaviour == "leaving":
            sys.exit(5)
        elif self.behaviour == "bug":
            raise ZeroDivisionError("division by zero")
        elif self.behaviour == "timeout":
            raise EngineTimeoutError("stopped after 3 s")
        elif self.behaviour == "uninstalled":
            raise EngineNotInstalledError("its library is gone")
        elif self.behaviour == "unstable" and numerics.dt > 0.5:
            raise UnstableTimeStepError(f"dt = {numerics.dt:g} s exceeds the critical step 0.5 s: use a smaller one")
        elif self.behaviour == "slow":
            Path("slow.writing").write_text(str(os.getpid()))
            Path("slow.writing").rename("slow.started")
            time.sleep(300.0)
        elif self.behaviour == "stubborn":
            run_isolated([sys.executable, "-c", STUBBORN])
        elif self.behaviour == "segfault":
            ctypes.string_at(0)
        elif self.behaviour == "exit":
            os._exit(7)
        elif self.behaviour == "killed" or (self.behaviour == "killed-once" and not _marked("killed-once")):
            os.kill(os.getpid(), signal.SIGKILL)
        elif self.behaviour == "hog":
            held = [b"x" * 10_000_000 for _ in range(100)]  # no more, so that a limit that does not act harms nobody
            time.sleep(3.0)
            del held
        elif self.behaviour == "wide":
            with Path("alone").open("x"):
                time.sleep(0.5)
            Path("alone").unlink()


def _marked(name: str) -> bool:
    """Whether this was asked before, in any process that works in this folder."""
    marker = Path(name)
    known = marker.exists()
    marker.touch()
    return known


BEHAVIOURS = (
    "good", "wrong", "nan", "blind", "infinite", "garbage", "crash",
    "bug", "timeout", "uninstalled", "unstable", "slow", "absent", "incapable", "shy",
    "stubborn", "segfault", "exit", "killed", "killed-once", "wide", "hog", "eternal", "leaving",
)  # fmt: skip
ENGINES = tuple(FakeEngine(behaviour) for behaviour in BEHAVIOURS)
