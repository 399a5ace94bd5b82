"""An engine that is a command: ``ENGINE describe`` and ``ENGINE run``, in whatever language.

``run`` reads the request from standard input and writes the answer to standard output, or into the request's
``answer_file``; see `ninedisk.harness.wire.protocol`. The command runs in the folder in which ninedisk was called, so that relative
paths in it mean what they mean in a shell.
"""

from __future__ import annotations

import shlex
import shutil
from collections.abc import Sequence
from pathlib import Path

from ninedisk.core.history import Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.options import read_options
from ninedisk.core.scene import Scene
from ninedisk.harness.api.capabilities import Capability, capabilities_needed
from ninedisk.harness.api.engine import EngineError, EngineInfo, EngineRun, EngineTimeoutError, Support, SupportLevel
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.engines.rigid import rigid_support, without_spring_preload
from ninedisk.harness.engines.spring import NOTE_SLIP_AT, OF_SLIP_AT, contact_steps, laws_in_use
from ninedisk.harness.run.isolation import Finished, run_isolated, time_limit_from_environment
from ninedisk.harness.wire.description import Description, read_description
from ninedisk.harness.wire.external import ExternalEngine
from ninedisk.harness.wire.wire_fields import WireError

MAX_OUTPUT = 1 << 26
"""Bytes of standard output that can be an answer, 64 MiB; larger ones go into the request's ``answer_file``."""

DESCRIBE_LIMIT = 30.0
"""Seconds for ``describe``, which computes nothing."""

NOTE_SPRINGS = "rigid contacts are replaced by springs kn, ks and a dashpot"


class CommandEngine(ExternalEngine):
    """Adapter of the engine behind a command line such as ``node my-engine.mjs``.

    Parameters
    ----------
    command_line : str
        Program and arguments, quoted as in a shell; no shell runs it.

    Raises
    ------
    UsageError
        If there is no such program, or the quotes do not match. Whatever else is wrong with the engine is an error of `info`.
    """

    keep_output = MAX_OUTPUT + 1

    def __init__(self, command_line: str) -> None:
        try:
            self._command = shlex.split(command_line)
        except ValueError as error:
            raise UsageError(f"--engine-cmd {command_line!r} cannot be read ({error}): mend its quotes") from error
        if not self._command or shutil.which(self._command[0]) is None:
            missing = self._command[0] if self._command else ""
            raise UsageError(
                f"--engine-cmd {command_line!r}: there is no program {missing!r}: give a program on PATH or its path, "
                f"for instance './my-engine' or 'python3 my_engine.py'"
            )
        self.command_line = command_line
        self._outcome = self._describe()
        if isinstance(self._outcome, Description):
            self.id = self._outcome.info.id
        else:  # its cells are errors, under a name made of the command
            self.id = f"cmd-{Path(self._command[-1]).name}"

    def info(self) -> EngineInfo:
        """What the engine said about itself when it was asked, once, at the beginning.

        Raises
        ------
        EngineError
            If it cannot be asked, or its answer breaks the schema.
        """
        return self._description.info

    def command(self) -> Sequence[str]:
        """The command with ``run``."""
        return [*self._command, "run"]

    def working_folder(self, folder: Path) -> Path:  # noqa: ARG002
        """The folder of the caller."""
        return Path.cwd()

    def supports(self, scene: Scene, numerics: Numerics) -> Support:
        """By contact: springs may stand in for rigid contacts, rigid ones never for springs."""
        near = self._description.approximations
        if self.info().contact != "spring":
            return rigid_support(scene, numerics, self.info().capabilities, approximations=near)
        missing = spring_needs(scene, numerics) - self.info().capabilities
        if missing - OF_SLIP_AT:
            return Support(SupportLevel.NO, tuple(sorted(missing - OF_SLIP_AT)), near)
        notes = (NOTE_SPRINGS, *near) if any(law.regularised for law in laws_in_use(scene)) else near
        level = SupportLevel.APPROXIMATE if notes else SupportLevel.EQUIVALENT if missing else SupportLevel.EXACT
        return Support(level, (), (*notes, NOTE_SLIP_AT) if missing else notes)

    def run(self, scene: Scene, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:
        """Run the command.

        Engines with springs get their contact step as a number, all others the scene without the preload of regularising
        springs. Raises as `ExternalEngine.run`, and `InvalidNumericsError` on an impossible option.
        """
        read_options(self.id, self.info().options, numerics)
        scene, numerics = self.asked(scene, numerics)
        try:
            run = super().run(scene, numerics, watch)
        except WireError as error:
            raise WireError(f"{error}; see: ninedisk schema answer") from error
        return EngineRun(
            history=run.history, timings=run.timings, settings={**run.settings, "engine_command": self.command_line}
        )

    def asked(self, scene: Scene, numerics: Numerics) -> tuple[Scene, Numerics]:
        """Scene and numerics as the request has them."""
        if self.info().contact == "spring":
            return scene, numerics.replace(contact_dt=contact_steps(scene, numerics)[1])
        return without_spring_preload(scene), numerics

    def answer_text(self, finished: Finished, answer_file: Path) -> str:
        """The answer file if the engine wrote one, else what it printed on standard output."""
        if answer_file.exists():
            return super().answer_text(finished, answer_file)
        if len(finished.stdout.encode()) > MAX_OUTPUT:
            raise WireError(
                f"it printed more than {MAX_OUTPUT >> 20} MiB on standard output: write the answer into the request's "
                f"answer_file, or its history into an NPZ file, and print nothing else"
            )
        if not finished.stdout.strip():
            said = f"; standard error ends with:\n{finished.last_lines()}" if finished.last_lines() else ""
            raise WireError(f"it ended well but printed no answer on standard output and wrote no answer_file{said}")
        return finished.stdout

    def _describe(self) -> Description | EngineError:
        """The description, or why there is none."""
        limit = min(DESCRIBE_LIMIT, time_limit_from_environment())
        try:
            done = run_isolated([*self._command, "describe"], time_limit=limit)
            return read_description(done.stdout, how_it_runs=f"command `{self.command_line}`, wire protocol")
        except EngineError as error:
            kind = type(error) if isinstance(error, EngineTimeoutError) else EngineError
            return kind(f"`{self.command_line} describe` gives no description of the engine: {error}")

    @property
    def _description(self) -> Description:
        if isinstance(self._outcome, EngineError):
            raise self._outcome
        return self._outcome


def spring_needs(scene: Scene, numerics: Numerics) -> frozenset[Capability]:
    """Capabilities that an engine with contact springs needs: also those of springs that stand in for rigid contacts."""
    need = set(capabilities_needed(scene, numerics))
    for law in laws_in_use(scene):
        if law.beta > 0.0:
            need.add(Capability.CONTACT_DAMPING)
        if law.mu > 0.0:
            need.add(Capability.SHEAR_SPRING)
    return frozenset(need)
