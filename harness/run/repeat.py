"""The commands that do one cell again: complete, to be pasted into a shell in the same folder."""

from __future__ import annotations

import shlex

from ninedisk.harness.api.params import format_value, parse
from ninedisk.harness.run.plan import Cell


def run_command(cell: Cell) -> str:
    """The command that runs this cell and no other."""
    command = command_line(cell)
    engine = ["--engine-cmd", command] if command else ["--engine", cell.engine_id]
    return shlex.join(["ninedisk", "run", cell.case.id, *engine, *_settings(cell), *_options(cell)])


def request_command(cell: Cell) -> str:
    """The commands that print what the cell's engine is asked, and let it answer; ``""`` where it is no engine behind a command."""
    command = command_line(cell)
    if not command:
        return ""
    words = ["ninedisk", "request", cell.case.id, "--engine-cmd", command, *_settings(cell), *_options(cell)]
    return f"{shlex.join(words)} | {command} run"


def command_line(cell: Cell) -> str:
    """What ``--engine-cmd`` gave; ``""`` for an engine that is known by its id."""
    return str(getattr(cell.engine, "command_line", ""))


def _settings(cell: Cell) -> list[str]:
    """Every parameter that is not its default, and those that the case's matrix varies, so that one variant is left of it."""
    varied = {name for row in cell.case.matrix() for name in row}
    words = []
    for parameter in cell.case.parameters:
        value = cell.variant.params[parameter.name]
        if parameter.name in varied or value != parse(parameter, parameter.default):
            words += ["--set", f"{parameter.name}={value if isinstance(value, str) else format_value(value)}"]
    return words


def _options(cell: Cell) -> list[str]:
    given = {} if isinstance(cell.setup, Exception) else cell.setup.numerics.options
    own = {name: value for name, value in given.items() if name.startswith(f"{cell.engine_id}.")}
    texts = {name: value if isinstance(value, str) else format_value(value) for name, value in own.items()}
    return [word for name, text in texts.items() for word in ("--option", f"{name}={text}")]
