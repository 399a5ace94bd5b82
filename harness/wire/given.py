"""Engines of a run: ids of known ones, and commands."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.api.registry import engine_table

if TYPE_CHECKING:
    from ninedisk.harness.api.engine import Engine


def engines_given(ids: Sequence[str], commands: Sequence[str], *, everything: bool = False) -> list[str | Engine]:
    """What ``--engine`` and ``--engine-cmd`` ask for: both; all known engines where neither says anything.

    Parameters
    ----------
    ids, commands : sequence of str
    everything : bool
        All known engines beside the commands.

    Raises
    ------
    UsageError
        If a command cannot be started, or two engines have one id.
    """
    known = list(engine_table())
    found: list[str | Engine] = [*dict.fromkeys(ids)]
    if everything or not (ids or commands):
        found = [*known]
    if not commands:
        return found
    from ninedisk.harness.wire.command import CommandEngine

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
