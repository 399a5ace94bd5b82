"""Base of every engine that runs in its own process and speaks the wire format."""

from __future__ import annotations

import os
import tempfile
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ninedisk.core.history import Pair
from ninedisk.core.numerics import Numerics
from ninedisk.harness.api.capabilities import capabilities_needed
from ninedisk.harness.api.engine import (
    EngineError,
    EngineInfo,
    EngineNotInstalledError,
    EngineRun,
    Support,
    SupportLevel,
    Timings,
)
from ninedisk.harness.run.isolation import KEEP_BYTES, Finished, run_isolated
from ninedisk.harness.wire.protocol import Request, decode_answer, encode_request


class ExternalEngine(ABC):
    """Adapter of an out-of-process engine; a subclass gives `id`, `info` and `command`.

    Each run has its own temporary folder, which is its working directory and ``TMPDIR`` and is removed at the end.
    Everything else is optional: `supports` (by default: every capability that is needed is among those of `info`),
    `extra` (additions to the request), `environment`, `working_folder`, `answer_text` and `time_limit`. A scene is a `Scene`, or
    a `SphereScene` where `info` has `Capability.SPHERES`.
    """

    id: str = ""
    keep_output: int = KEEP_BYTES
    """Bytes of the end of each output stream that are kept."""
    copied: Path | None = None
    """Part of the command that is a Python script which acts as ``__main__`` only, so that workers may run it in copies of one process."""
    time_limit: float | None = None
    """Seconds of CPU time, and of idle time; None: the environment variable ``NINEDISK_TIME_LIMIT``, or 120."""

    @abstractmethod
    def info(self) -> EngineInfo:
        """Facts about the engine; ``version`` is None where it is not installed."""

    @abstractmethod
    def command(self) -> Sequence[str]:
        """Program and arguments; it reads the request from standard input and writes the answer file."""

    def supports(self, scene: Any, numerics: Numerics) -> Support:
        """EXACT if the engine has every capability that is needed, else NO with the missing ones."""
        missing = tuple(sorted(capabilities_needed(scene, numerics) - self.info().capabilities))
        return Support(SupportLevel.NO, missing) if missing else Support(SupportLevel.EXACT)

    def extra(self, scene: Any, numerics: Numerics, folder: Path) -> Mapping[str, Any]:  # noqa: ARG002
        """Additions to the request for the engine's own driver; files belong into ``folder``."""
        return {}

    def environment(self, folder: Path) -> Mapping[str, str]:
        """Environment of the process."""
        return {**os.environ, "TMPDIR": str(folder)}

    def working_folder(self, folder: Path) -> Path:
        """Folder in which the command runs; ``folder`` is the run's own."""
        return folder

    def answer_text(self, finished: Finished, answer_file: Path) -> str:
        """The answer of a command that has ended well; raises `EngineError` where there is none."""
        try:
            return answer_file.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            said = finished.last_lines() or "(it printed nothing)"
            raise EngineError(
                f"{self.info().name} ended without a readable answer file ({error}); its last output:\n{said}"
            ) from error

    def run(self, scene: Any, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:
        """Run the engine in its own process.

        ``timings.setup`` is everything but warm-up and advance: the start of the process, or of its copy, and the transport included.

        Raises
        ------
        EngineNotInstalledError, EngineTimeoutError, EngineError
            With the last output lines of the engine.
        """
        info = self.info()
        if not info.installed:
            raise EngineNotInstalledError(
                f"{info.name} is not installed ({info.not_installed_because}): {info.install}"
            )
        pairs = tuple(scene.check_pair(pair) for pair in watch)
        with tempfile.TemporaryDirectory(prefix=f"ninedisk-{self.id}-", ignore_cleanup_errors=True) as name:
            folder = Path(name)
            answer_file = folder / "answer.json"
            request = Request(
                scene=scene,
                numerics=numerics,
                watch=pairs,
                answer_file=str(answer_file),
                extra=self.extra(scene, numerics, folder),
            )
            finished = run_isolated(
                self.command(),
                stdin=encode_request(request),
                time_limit=self.time_limit,
                cwd=self.working_folder(folder),
                env=self.environment(folder),
                keep=self.keep_output,
                driver=self.copied,
            )
            text = self.answer_text(finished, answer_file)
            answer = decode_answer(text, scene=scene, numerics=numerics, watch=pairs, folder=folder)
        timings = answer.run.timings
        setup = max(0.0, finished.seconds - timings.warm_up - timings.advance)
        cpu = (finished.cpu, "whole process") if timings.cpu is None else (timings.cpu, timings.cpu_of)
        return EngineRun(
            history=answer.run.history,
            timings=Timings(setup=setup, warm_up=timings.warm_up, advance=timings.advance, cpu=cpu[0], cpu_of=cpu[1]),
            settings={**answer.run.settings, "engine_version": answer.engine_version},
        )
