"""Out-of-process engines, third-party ones: an honest one works in a few lines, a bad one ends as a clear error."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.engine import (
    Engine,
    EngineError,
    EngineInfo,
    EngineNotInstalledError,
    EngineTimeoutError,
    SupportLevel,
)
from ninedisk.harness.wire.external import ExternalEngine

FAKE = Path(__file__).with_name("fake_engine.py")
NUMERICS = Numerics(dt=0.1, n_steps=4)


class Fake(ExternalEngine):
    id = "fake"

    def __init__(self, *arguments: str, version: str | None = "0.1", time_limit: float = 60.0) -> None:
        self.arguments, self.version, self.time_limit = arguments, version, time_limit

    def info(self) -> EngineInfo:
        return EngineInfo(
            id=self.id,
            name="Fake",
            version=self.version,
            scheme="none",
            contact="impulse",
            licence="BSD-3-Clause",
            how_it_runs="subprocess",
            precision="float64",
            threads=1,
            install="nothing to install",
            capabilities=frozenset({Capability.LINEAR_CONTACT}),
            not_installed_because="" if self.version else "it was never written",
        )

    def command(self) -> Sequence[str]:
        return [sys.executable, str(FAKE), *self.arguments]


def scene(**law: float) -> Scene:
    disks = Disks(x=[(0.0, 0.0), (9.0, 1.0)], radius=1.0, mass=1.0, v=[(1.0, 0.0), (0.0, -0.5)])
    return Scene(disks=disks, disk_disk=ContactLaw(kn=1.0, **law))


def test_honest_engine_in_a_few_lines() -> None:
    engine = Fake("honest")
    assert isinstance(engine, Engine)
    run = engine.run(scene(), NUMERICS, [(0, 1)])
    np.testing.assert_array_equal(run.history.x[:, 0, 0], np.arange(5) * 0.1)
    assert np.isnan(run.history.fn).all()
    assert run.settings == {"note": "uniform motion", "engine_version": "0.1"}
    assert 0.0 < run.timings.setup < 60.0


def test_default_support_is_by_capabilities() -> None:
    assert Fake("honest").supports(scene(), NUMERICS).level is SupportLevel.EXACT
    refused = Fake("honest").supports(scene(mu=0.5, ks=1.0), NUMERICS)
    assert refused.level is SupportLevel.NO
    assert Capability.FRICTION in refused.missing


@pytest.mark.parametrize(
    ("mode", "message"),
    [
        ("abort", r"ended by SIGABRT .*\nterminate called after something"),
        ("exit", r"ended with status 7 .*\nno licence found"),
        ("silent", r"Fake ended without a readable answer file .*\nWelcome to the fake engine"),
        ("garbage", r"the answer is not JSON, .* begins with 'Segmentation fault"),
        ("truncated", r"the answer is not JSON, or was cut off"),
        ("nan", r"the state stopped being finite: history.x of disk 1 .* at step 2 "),
        ("gives-up", r"the engine gave up: cannot do walls"),
    ],
)
def test_bad_engines_end_as_clear_errors(mode: str, message: str) -> None:
    with pytest.raises(EngineError, match=message):
        Fake(mode).run(scene(), NUMERICS, [(0, 1)])


def test_hanging_engine_is_stopped() -> None:
    with pytest.raises(EngineTimeoutError, match=r"time limit of 3 s .*\nabout to hang"):
        Fake("hang", time_limit=3.0).run(scene(), NUMERICS, [])


def test_flooding_engine_and_orphans_do_no_harm(tmp_path: Path, dies: Callable[[int], bool]) -> None:
    Fake("flood").run(scene(), NUMERICS, [])
    Fake("orphan", str(tmp_path / "pid")).run(scene(), NUMERICS, [])
    assert dies(int((tmp_path / "pid").read_text()))


def test_nothing_stays_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    Fake("honest").run(scene(), NUMERICS, [])
    with pytest.raises(EngineError):
        Fake("abort").run(scene(), NUMERICS, [])
    assert list(tmp_path.iterdir()) == []


def test_missing_engine_says_how_to_install_it() -> None:
    with pytest.raises(
        EngineNotInstalledError, match=r"Fake is not installed \(it was never written\): nothing to install"
    ):
        Fake("honest", version=None).run(scene(), NUMERICS, [])
