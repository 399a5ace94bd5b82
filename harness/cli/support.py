"""What commands share: errors without tracebacks, progress that stays silent for two seconds, options, rows as JSON."""

from __future__ import annotations

import errno
import functools
import json
import os
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Annotated, Any, NoReturn, ParamSpec, TypeVar

import typer
from typer.core import TyperGroup

if TYPE_CHECKING:
    from rich.progress import Progress as Bar

    from ninedisk.harness.api.engine import Engine
    from ninedisk.harness.results.schema import Row

P = ParamSpec("P")
R = TypeVar("R")

Store = Annotated[Path, typer.Option("--store", metavar="DIR", help="Folder of the stored results.")]
"""Option of every command that reads or writes results."""

Commands = Annotated[
    list[str] | None,
    typer.Option(
        "--engine-cmd",
        metavar="COMMAND",
        help="Engine by its command, e.g. 'node my-engine.mjs' (docs/tutorials/your-own-engine.md); repeat for several.",
    ),
]
"""Option of every command that takes engines by their commands."""

Command = Annotated[
    str | None,
    typer.Option("--engine-cmd", metavar="COMMAND", help="Engine by its command, e.g. 'node my-engine.mjs'."),
]
"""The same of commands that take one engine."""

USAGE, FAILURE, INTERRUPTED = 2, 3, 130
QUIET_SECONDS = 2.0
LINE_SECONDS, LONG_SECONDS = 10.0, 10.0
"""Between two lines of progress; a piece that takes longer than the second is shown with its time."""
TRACEBACK_VARIABLE = "NINEDISK_TRACEBACK"
UNUSABLE = frozenset(
    {errno.ENAMETOOLONG, errno.ELOOP, errno.EACCES, errno.EPERM, errno.ENOTDIR, errno.EISDIR, errno.EROFS}
)
"""What the system says of a path that no command can use, whichever of them stumbles over it first."""


class Group(TyperGroup):
    """Commands that answer a misspelt name with names that come close, also those of commands one level below."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        from ninedisk.harness.api.errors import close_matches

        name = args[0] if args else ""
        if name and not name.startswith("-") and self.get_command(ctx, name) is None:
            below = {
                child: f"{parent} {child}"
                for parent, command in self.commands.items()
                for child in getattr(command, "commands", {})
            }
            near = close_matches(name, {**below, **dict.fromkeys(self.commands)}, below)
            ctx.fail(f"there is no command {name!r}.{near} `{ctx.command_path} --help` lists all")
        return super().resolve_command(ctx, args)


def guarded(command: Callable[P, R]) -> Callable[P, R]:
    """Turn mistakes of the user into a message and exit code 2, anything unforeseen into code 3, Ctrl-C into 130."""

    @functools.wraps(command)
    def run(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return command(*args, **kwargs)
        except (typer.Exit, typer.Abort):
            raise
        except KeyboardInterrupt:
            fail("interrupted: nothing was stored", INTERRUPTED)
        except Exception as error:
            if os.environ.get(TRACEBACK_VARIABLE):
                raise
            if _is_users_mistake(error):
                fail(str(error), USAGE)
            if _is_engines_failure(error):
                fail(str(error), FAILURE)
            if isinstance(error, OSError) and error.errno in UNUSABLE and error.filename is not None:
                fail(f"{str(error.filename)[:200]!r} cannot be used: {error.strerror}; give another path", USAGE)
            fail(f"internal error: {type(error).__name__}: {error} (set {TRACEBACK_VARIABLE}=1 to see where)", FAILURE)

    return run


def fail(message: str, code: int) -> NoReturn:
    """Print ``error: message`` on standard error and leave with ``code``."""
    typer.echo(message if code == INTERRUPTED else f"error: {message}", err=True)
    raise typer.Exit(code)


def _is_users_mistake(error: Exception) -> bool:
    from ninedisk.core.errors import CoreError
    from ninedisk.harness.api.case import ParameterError
    from ninedisk.harness.api.errors import UsageError
    from ninedisk.reports.folder import ReportError

    return isinstance(error, UsageError | ParameterError | CoreError | ReportError)


def _is_engines_failure(error: Exception) -> bool:
    from ninedisk.harness.api.engine import EngineError

    return isinstance(error, EngineError)


class CellProgress:
    """Progress on standard error: a bar in a terminal, a line every 10 s elsewhere, nothing for short runs.

    Parameters
    ----------
    before : int
        Pieces that were done before; the estimate of the remaining time leaves them out.
    """

    def __init__(self, before: int = 0) -> None:
        self._before = before
        self._begin = self._since = time.monotonic()
        self._terminal = sys.stderr.isatty()
        self._bar: Bar | None = None
        self._timer: threading.Timer | None = None
        self._state = (0, 0, "")
        self._lock = threading.Lock()
        self._closed = False

    def __enter__(self) -> CellProgress:
        self._after(*((QUIET_SECONDS, self._show) if self._terminal else (LINE_SECONDS, self._line)))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._lock:
            self._closed = True
            if self._timer is not None:
                self._timer.cancel()
            if self._bar is not None:
                self._bar.stop()

    def __call__(self, done: int, total: int, label: str = "") -> None:
        """Report that ``done`` of ``total`` pieces are finished and ``label`` begins."""
        with self._lock:
            if label != self._state[2]:
                self._since = time.monotonic()
            self._state = (done, total, label)
            if self._bar is not None:
                self._bar.update(self._bar.task_ids[0], completed=done, total=total or None, description=label)

    def _after(self, seconds: float, act: Callable[[], None]) -> None:
        self._timer = threading.Timer(seconds, act)
        self._timer.daemon = True
        self._timer.start()

    def _line(self) -> None:
        """One line, also while a single piece takes long, and the next one."""
        with self._lock:
            if self._closed:
                return
            typer.echo(self._text(), err=True)
            self._after(LINE_SECONDS, self._line)

    def _text(self) -> str:
        """How many pieces are done, how long the others take, and what is in hand, with its time where that is long."""
        done, total, label = self._state
        now = time.monotonic()
        if label and now - self._since >= LONG_SECONDS:
            label = f"{label} (for {duration(now - self._since)})"
        if not total:
            return label or "at work"
        fresh = done - self._before
        left = ""
        if fresh > 0 and done < total:
            left = f"about {duration((now - self._begin) * (total - done) / fresh)} left"
        return f"[{done}/{total}] {', '.join(part for part in (left, label) if part)}".rstrip()

    def _show(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

        columns = (
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("{task.description}", markup=False),
        )
        with self._lock:
            if self._closed:
                return
            done, total, label = self._state
            self._bar = Progress(*columns, console=Console(stderr=True), transient=True)
            self._bar.add_task(label, completed=done, total=total or None)
            self._bar.start()


def duration(seconds: float) -> str:
    """``40 s``, ``3 min``, ``2 h 10 min``."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60} min"


def refuse_not_installed(engines: Mapping[str, Engine | Exception]) -> None:
    """Refuse engines that were named, by their ids, and are not on this machine; one that cannot say so is left to its cells.

    Raises
    ------
    UsageError
        Naming each with the command that installs it.
    """
    from ninedisk.harness.api.errors import UsageError

    missing = []
    for name, engine in engines.items():
        if isinstance(engine, Exception):
            continue
        try:
            info = engine.info()
        except Exception:
            continue
        if not info.installed:
            why = info.not_installed_because or "it is not on this machine"
            missing.append(f"the engine {name!r} is not installed ({why}); install it with: {info.install}")
    if missing:
        raise UsageError("\n".join(missing))


def parse_settings(settings: Sequence[str], *, flag: str = "--set", example: str = "dt=0.01") -> dict[str, str]:
    """``NAME=VALUE`` texts as a mapping; a name given twice is refused, since only one of them could count."""
    from ninedisk.harness.api.errors import UsageError

    found: dict[str, str] = {}
    for text in settings:
        name, sign, value = text.partition("=")
        name, value = name.strip(), value.strip()
        if not sign or not name or not value:
            raise UsageError(f"{flag} {text!r} is not allowed: write NAME=VALUE, for instance {flag} {example}")
        if found.setdefault(name, value) != value:
            raise UsageError(f"{flag} gives {name!r} twice ({found[name]} and {value}): give it once")
    return found


def write_rows(path: Path, found: Sequence[Row]) -> None:
    """Write rows as a JSON list, NaN as null; the file appears whole or not at all.

    Raises
    ------
    StoreError
        If it cannot be written.
    """
    from ninedisk.harness.results.tables import plain_json
    from ninedisk.harness.results.whole_file import write_whole

    rows = json.loads(plain_json(list(found)))
    write_whole("--json", path, json.dumps(rows, indent=1) + "\n")
