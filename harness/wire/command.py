"""An engine that is a command: ``ENGINE describe`` and ``ENGINE run``, in whatever language.

``run`` reads the request from standard input and writes the answer to standard output, or into the request's
``answer_file``; see `ninedisk.harness.wire.protocol`. The command runs in the folder in which ninedisk was called, so that relative
paths in it mean what they mean in a shell.

What an engine says about itself on ``describe``, read and checked.

Engines of a run: ids of known ones, and commands.
"""

from __future__ import annotations

import shlex
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ninedisk.core.errors import InvalidNumericsError
from ninedisk.core.history import Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.options import Option, read_options
from ninedisk.core.scene import Scene, SphereScene
from ninedisk.harness.api.capabilities import Capability, capabilities_needed, wire_name
from ninedisk.harness.api.engine import (
    Difference,
    EngineError,
    EngineInfo,
    EngineRun,
    Support,
    SupportLevel,
)
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.api.registry import STOCK_ENGINES, engine_table
from ninedisk.harness.api.support import (
    NOTE_SLIP_AT,
    NOTE_SOFT,
    OF_SLIP_AT,
    AnyScene,
    contact_steps,
    rigid_support,
    without_spring_preload,
)
from ninedisk.harness.api.text import one_line
from ninedisk.harness.run.isolation import Finished, run_isolated
from ninedisk.harness.run.limits import time_limit_from_environment
from ninedisk.harness.wire.external import ExternalEngine
from ninedisk.harness.wire.protocol import WireError, parse_message
from ninedisk.harness.wire.schemas import fault

if TYPE_CHECKING:
    from ninedisk.harness.api.engine import Engine
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
        If there is no such program, the quotes do not match, or its description is not to be had or breaks the schema: one error
        for the whole engine, before anything runs.
    """

    keep_output = MAX_OUTPUT + 1

    def __init__(self, command_line: str) -> None:
        try:
            self._command = shlex.split(command_line)
        except ValueError as error:
            raise UsageError(f"--engine-cmd {command_line!r} cannot be read ({error}): mend its quotes") from error
        if not self._command or shutil.which(self._command[0]) is None:
            missing = self._command[0] if self._command else ""
            wrong = (
                f"{missing!r} is no program that may be run"
                if Path(missing).is_file()
                else f"there is no program {missing!r}"
            )
            raise UsageError(
                f"--engine-cmd {command_line!r}: {wrong}: give a program on PATH or its path, "
                f"for instance './my-engine' (after chmod +x) or 'python3 my_engine.py'"
            )
        self.command_line = command_line
        self._description = self._describe()
        self.id = self._description.info.id

    def info(self) -> EngineInfo:
        """What the engine said about itself when it was asked, once, at the beginning."""
        return self._description.info

    def command(self) -> Sequence[str]:
        """The command with ``run``."""
        return [*self._command, "run"]

    def working_folder(self, folder: Path) -> Path:  # noqa: ARG002
        """The folder of the caller."""
        return Path.cwd()

    def supports(self, scene: Scene | SphereScene, numerics: Numerics) -> Support:
        """By contact: springs may stand in for rigid contacts, rigid ones never for springs."""
        near = self._description.approximations
        if self.info().contact != "spring":
            return rigid_support(scene, numerics, self.info().capabilities, approximations=near)
        missing = spring_needs(scene, numerics) - self.info().capabilities
        if missing - OF_SLIP_AT:
            return Support(SupportLevel.NO, tuple(sorted(missing - OF_SLIP_AT)), near)
        notes = (NOTE_SPRINGS, *near) if any(law.regularised for law in scene.laws_in_use) else near
        level = SupportLevel.APPROXIMATE if notes else SupportLevel.EQUIVALENT if missing else SupportLevel.EXACT
        return Support(level, (), (*notes, NOTE_SLIP_AT) if missing else notes)

    def run(self, scene: Scene | SphereScene, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:
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

    def asked(self, scene: AnyScene, numerics: Numerics) -> tuple[AnyScene, Numerics]:
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

    def _describe(self) -> Description:
        limit = min(DESCRIBE_LIMIT, time_limit_from_environment())
        try:
            done = run_isolated([*self._command, "describe"], time_limit=limit)
            return read_description(done.stdout, how_it_runs=f"command `{self.command_line}`, wire protocol")
        except EngineError as error:
            raise UsageError(f"`{self.command_line} describe` gives no description of the engine: {error}") from error


def spring_needs(scene: Scene | SphereScene, numerics: Numerics) -> frozenset[Capability]:
    """Capabilities that an engine with contact springs needs: also those of springs that stand in for rigid contacts."""
    need = set(capabilities_needed(scene, numerics))
    for law in scene.laws_in_use:
        if law.beta > 0.0:
            need.add(Capability.CONTACT_DAMPING)
        if law.mu > 0.0:
            need.add(Capability.SHEAR_SPRING)
    return frozenset(need)


SCHEME_OPTIONS = {"moreau-jean": "theta", "runge-kutta-3": "phase"}
"""Schemes whose truths read an option of the engine."""

_TRAITS = (
    "plane",
    "turns_shear",
    "dilates",
    "softness",
    "softness_why",
    "slop",
    "second_order_dashpots",
    "sweeps",
    "precision",
    "threads",
    "contact_forces",
)

_ARMS = ("turns_exactly_with", "arms_at_walls")
"""Traits that are sets of lever arms."""


@dataclass(frozen=True)
class Description:
    """Facts about an engine, and in what it only comes near to any scene."""

    info: EngineInfo
    approximations: tuple[str, ...]


def read_description(text: str, *, how_it_runs: str) -> Description:
    """The description in what an engine printed.

    Parameters
    ----------
    text : str
        Standard output of ``ENGINE describe``.
    how_it_runs : str
        For reports; the command.

    Raises
    ------
    WireError
        Naming the key at fault and what was expected there.
    """
    data = parse_message(text, "description")
    if wrong := fault("describe", data):
        raise WireError(f"the description breaks its schema at {wrong}; see: ninedisk schema describe")
    options = {name: _option(f"{data['id']}.{name}", given) for name, given in data.get("options", {}).items()}
    asked = SCHEME_OPTIONS.get(data["scheme"])
    if asked is not None and asked not in options:
        raise WireError(
            f"the scheme {data['scheme']!r} needs the option {asked!r}: describe it, or name another scheme"
        )
    if (sweeps := data.get("sweeps")) is not None and sweeps not in options:
        raise WireError(f"the description's sweeps name the option {sweeps!r}: describe it, or leave sweeps out")
    names = {wire_name(capability): capability for capability in Capability}
    traits: dict[str, Any] = {"precision": "float64", "threads": 1}
    traits |= {trait: data[trait] for trait in _TRAITS if trait in data}
    traits |= {trait: frozenset(names[name] for name in data[trait]) for trait in _ARMS if trait in data}
    differences = {each: str(each) for each in Difference if data.get(each.name.lower())}
    out_of_scope = {names[name]: one_line(link) for name, link in data.get("out_of_scope", {}).items()}
    both = sorted(set(data["capabilities"]) & set(data.get("out_of_scope", {})))
    if both:
        raise WireError(
            f"the description has {both[0]!r} among capabilities and out_of_scope: leave it out of one of them"
        )
    if "softness" in data and data["contact"] != "soft":
        raise WireError(
            f"the description has a softness with contact = {data['contact']!r}: leave it out, or declare contact = 'soft'"
        )
    if data.get("slop") and data["contact"] not in ("impulse", "soft"):
        raise WireError(
            f"the description has a slop with contact = {data['contact']!r}: leave it out, or declare contact = 'impulse'"
        )
    info = EngineInfo(
        id=data["id"],
        name=one_line(data.get("name", data["id"])),
        version=None if data["version"] is None else one_line(data["version"]),
        scheme=one_line(data["scheme"]),
        contact=data["contact"],
        licence=one_line(data.get("licence", "not stated")),
        how_it_runs=how_it_runs,
        install=one_line(data.get("install", "given by --engine-cmd")),
        not_installed_because="its description gives no version" if data["version"] is None else "",
        capabilities=frozenset(names[name] for name in data["capabilities"]),
        differences=differences,
        options=options,
        out_of_scope=out_of_scope,
        **traits,
    )
    near = tuple(one_line(text) for text in data.get("approximations", ()))
    return Description(info, near or (NOTE_SOFT,) if info.contact == "soft" else near)


def _option(name: str, given: Mapping[str, Any]) -> Option:
    if "choices" in given:
        words: dict[str, Any] = {"choices": tuple(given["choices"]), "stock": given.get("stock")}
        option = Option(default=given["default"], why=one_line(given["why"]), **words)
    else:
        rest = {key: value for key, value in given.items() if key not in ("default", "why", "none")}
        meaning = one_line(given.get("none", ""))
        option = Option(default=given["default"], why=one_line(given["why"]), none=meaning, **rest)
    try:
        option.checked(name, option.default)
        if option.stock is not None:
            option.checked(name, option.stock)
    except InvalidNumericsError as error:
        raise WireError(f"the description's default does not fit: {error}") from error
    return option


def engines_given(
    ids: Sequence[str], commands: Sequence[str], *, everything: bool = False, profile: str = "tuned"
) -> list[str | Engine]:
    """What ``--engine`` and ``--engine-cmd`` ask for: both; all known engines where neither says anything.

    Parameters
    ----------
    ids, commands : sequence of str
    everything : bool
        All known engines beside the commands.
    profile : {"tuned", "stock", "both"}
        Settings of the known engines: those of their adapters, the engines' own, or both.

    Raises
    ------
    UsageError
        If a command cannot be started, two engines have one id, or a named engine has no stock settings here.
    """
    known = list(engine_table())
    named = list(dict.fromkeys(ids))
    found: list[str | Engine] = [*_of_profile(named, profile, named=True)]
    if everything or not (ids or commands):
        found = [*_of_profile(known, profile, named=False)]
    if not commands:
        return found

    owners = dict.fromkeys(known, "a known engine")
    for line in dict.fromkeys(commands):
        engine = CommandEngine(line)
        if (owner := owners.setdefault(engine.id, repr(line))) != repr(line):
            raise UsageError(
                f"--engine-cmd {line!r} calls itself {engine.id!r}, and so does {owner}: give it an id of its own in its "
                f"description"
            )
        found.append(engine)
    return found


def _of_profile(ids: Sequence[str], profile: str, *, named: bool) -> list[str]:
    """Ids of engines under a profile; where an engine has no stock settings, that is refused if it was ``named``."""
    if profile == "tuned":
        return [*ids]
    stock = {name: stock_id for name in ids if (stock_id := f"{name}-stock") in STOCK_ENGINES}
    lacking = [name for name in ids if name not in stock and name not in STOCK_ENGINES]
    if named and lacking and profile == "stock":
        has = ", ".join(sorted(name.removesuffix("-stock") for name in STOCK_ENGINES))
        raise UsageError(f"{lacking[0]} has no stock settings here; engines that have: {has}")
    own = [name for name in ids if name in STOCK_ENGINES]
    return list(dict.fromkeys([*(ids if profile == "both" else own), *stock.values()]))
