"""Known gaps of an engine: differences whose cause is known, expected to fail until they are closed.

A TOML file with one table a gap::

    [[gap]]
    id = "slip-to-roll[mu=0.3,*]"   # case[variant], * and ? as in file names; a bare case id means all of its variants
    quantity = "fs"                 # * and ? as well
    engine = "acme"                 # optional: every engine without it
    truth = "analytic"              # optional: every kind of truth without it
    reason = "shear springs are projected, not turned"

A gap explains a difference. It excuses neither a crash nor a missing number, and where the difference is gone the test fails, so
that the file stays true.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path

from ninedisk.harness.api.errors import UsageError


@dataclass(frozen=True, kw_only=True)
class KnownGap:
    """One entry of the file."""

    id: str
    quantity: str
    reason: str
    engine: str = "*"
    truth: str = "*"

    def explains(self, case: str, variant: str, engine: str, quantity: str, truth: str) -> bool:
        """Whether the gap is about this check."""
        place = f"{case}[{variant}]" if "[" in self.id else case
        pairs = ((self.id, place), (self.engine, engine), (self.quantity, quantity), (self.truth, truth))
        return all(matches(pattern, text) for pattern, text in pairs)


REQUIRED = ("id", "quantity", "reason")


def matches(pattern: str, text: str) -> bool:
    """Whether a pattern with ``*`` and ``?`` fits; brackets stand for themselves, since ids have them."""
    return re.fullmatch(re.escape(pattern).replace(r"\*", ".*").replace(r"\?", "."), text) is not None


def read_gaps(path: Path) -> tuple[KnownGap, ...]:
    """The gaps of a file.

    Raises
    ------
    UsageError
        Naming the file, the entry and what is wrong with it.
    """
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"--known-gaps {str(path)!r} cannot be read: {error}") from error
    except tomllib.TOMLDecodeError as error:
        raise UsageError(f"--known-gaps {str(path)!r} is no TOML: {error}") from error
    entries = data.pop("gap", [])
    if data or not isinstance(entries, list):
        raise UsageError(f"--known-gaps {str(path)!r}: write each gap as a table [[gap]], and nothing else")
    return tuple(_gap(f"--known-gaps {str(path)!r}, gap {k}", entry) for k, entry in enumerate(entries, start=1))


def _gap(where: str, entry: object) -> KnownGap:
    known = [field.name for field in fields(KnownGap)]
    if not isinstance(entry, dict):
        raise UsageError(f"{where}: write it as a table [[gap]]")
    if unknown := sorted(set(entry) - set(known)):
        raise UsageError(f"{where} has the unknown key(s) {', '.join(unknown)}: use {', '.join(known)}")
    for name in REQUIRED:
        if not entry.get(name):
            raise UsageError(f"{where} lacks {name!r}: it needs {', '.join(REQUIRED)}")
    for name, value in entry.items():
        if not isinstance(value, str):
            raise UsageError(f"{where}: {name} = {value!r} is not allowed: it must be a text in quotes")
    return KnownGap(**entry)


def gap_of(gaps: Sequence[KnownGap], place: tuple[str, str, str], quantity: str, truth: str) -> KnownGap | None:
    """The first gap that explains a check; ``place`` is case, variant and engine."""
    return next((gap for gap in gaps if gap.explains(*place, quantity, truth)), None)
