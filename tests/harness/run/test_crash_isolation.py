"""A matrix in which external engines crash, hang, babble or vanish: each such cell is a status, every other one is finished."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

import pytest

from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.run.plan import plan_case
from ninedisk.harness.run.workers import run_cells
from ninedisk.harness.wire.external import ExternalEngine

FAKE = Path(__file__).parents[1] / "wire" / "fake_engine.py"


class ThirdPartyEngine(ExternalEngine):
    """An engine in its own process; how it behaves is its id."""

    time_limit = 3.0

    def __init__(self, mode: str) -> None:
        self.id = mode

    def info(self) -> EngineInfo:
        return EngineInfo(
            id=self.id,
            name=f"Stranger, {self.id}",
            version="0.1",
            scheme="none",
            contact="impulse",
            licence="BSD-3-Clause",
            how_it_runs="subprocess",
            precision="float64",
            threads=1,
            install="nothing to install",
            capabilities=frozenset({Capability.GRAVITY}),
        )

    def command(self) -> Sequence[str]:
        return [sys.executable, str(FAKE), self.id]


BAD = {
    "segfault": ("error", "ended by SIGSEGV", "about to read address 0"),
    "abort": ("error", "ended by SIGABRT", "terminate called after something"),
    "killed": ("error", "ended by SIGKILL", "the machine runs out of memory"),
    "exit": ("error", "ended with status 7", "no licence found"),
    "hang": ("timeout", "time limit of 3 s", "about to hang"),
    "garbage": ("error", "the answer is not JSON", "Segmentation fault (core dumped)"),
    "truncated": ("error", "the answer is not JSON, or was cut off", ""),
    "nan": ("error", "the state stopped being finite", "at step 2"),
    "silent": ("error", "without a readable answer file", "Welcome to the fake engine"),
}


@pytest.mark.usefixtures("no_child_left")
def test_bad_engines_are_statuses_with_their_last_lines_and_the_others_finish(
    fakes: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    modes = ["honest", *BAD, "honest"]
    # Without gravity uniform motion, all that the third-party engine knows, is the right answer.
    results = run_cells([plan_case(fakes.CASE, ThirdPartyEngine(mode), {"a": 0.0}) for mode in modes])
    assert [result.status for result in results] == ["pass", *(status for status, _, _ in BAD.values()), "pass"]
    for result, (_, why, said) in zip(results[1:-1], BAD.values(), strict=True):
        assert why in result.reason, result.cell["engine"]
        assert said in result.reason, result.cell["engine"]
    assert list(tmp_path.iterdir()) == []  # no file stays behind
