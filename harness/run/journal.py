"""The finished cells of a run, kept in the store until the run itself is written: an interrupted or killed run can go on.

Each cell that ended with a result is appended to ``STORE/interrupted/<run>.journal`` at once; the file is removed when the run is stored.
A cell is recognised by a digest of all that decides its result (`run_digest`, `cell_digest`): one of other code, versions, machine or
scene is never taken. Cells that ended as an error or a timeout are not kept: they run again.

A file is a sequence of records: length of the payload, digest of the cell, checksum, payload. The first has the digest of the run and no
cell. A record that a kill has cut off, and all after a damaged one, are ignored. Payloads are JSON and the bytes of arrays, compressed:
reading one executes nothing.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import secrets
import shlex
import shutil
import struct
import sys
import time
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import IO, Any

import numpy as np

from ninedisk.harness.api.case import Observed
from ninedisk.harness.api.engine import facts_of
from ninedisk.harness.results.store import BROKEN, INTERRUPTED
from ninedisk.harness.results.tables import CaseResult
from ninedisk.harness.run.plan import Cell, command_line
from ninedisk.harness.run.provenance import provenance
from ninedisk.harness.run.runner import planned_columns

KEPT = 4
"""Journals of earlier runs that a store keeps, the newest ones."""

FORMAT = "ninedisk journal 1"
SYNC_SECONDS = 1.0
"""Time between two writes to the disk itself; a record is out of this process at once, and only a crash of the machine loses it."""

LARGEST = 1 << 30
"""Bytes of a payload; a longer one is a sign of damage."""

_HEAD = struct.Struct("<Q32s16s")
_UNDECIDED = ("commit", "engines")
"""Facts of the provenance that decide nothing: the digest of the sources is sharper, and a cell's digest has its own engine."""


def run_digest(where: Mapping[str, Any], published: Path | None) -> bytes:
    """Digest of what decides the results of all cells of a run: sources, packages, machine, cells at once, digitised curves.

    Timings of a run are of one kind only if its cells ran under one load, so that ``where`` (the jobs) belongs to it.
    """
    facts = {name: value for name, value in (provenance() | dict(where)).items() if name not in _UNDECIDED}
    curves = [] if published is None else [_of_file(path) for path in sorted(published.rglob("*")) if path.is_file()]
    return _digest([FORMAT, facts, curves])


def cell_digest(cell: Cell) -> bytes | None:
    """Digest of what decides the result of a cell, beside `run_digest`; None where that cannot be known."""
    if isinstance(cell.setup, Exception) or isinstance(cell.engine, Exception):
        return None
    try:
        info, command = facts_of(cell.engine), command_line(cell)
        engine: list[Any] = [info.version, _of_code(type(cell.engine).__module__)]
        if command:
            engine += [command, asdict(info), _of_command(command)]
        return _digest([planned_columns(cell), cell.user_set, engine, _of_code(type(cell.case).__module__)])
    except Exception:  # what cannot be recognised runs again
        return None


def _digest(data: Any) -> bytes:
    def plain(value: Any) -> Any:
        return sorted(map(str, value)) if isinstance(value, set | frozenset) else str(value)

    return hashlib.sha256(json.dumps(data, sort_keys=True, default=plain).encode()).digest()


def _of_file(path: Path) -> str:
    with path.open("rb") as stream:
        return f"{path.name} {hashlib.file_digest(stream, 'sha256').hexdigest()}"


@cache
def _of_code(module: str) -> list[str]:
    """The files of another package's class; ours are in the digest of the sources."""
    top = module.partition(".")[0]
    if top == "ninedisk":
        return []
    file = Path(str(sys.modules[module].__file__))
    package = getattr(sys.modules.get(top), "__path__", None)
    return [_of_file(path) for path in (sorted(Path(package[0]).rglob("*.py")) if package else [file])]


@cache
def _of_command(command: str) -> list[str]:
    """The files that a command names, and of scripts those of their kind beside them, which they may import."""
    found: set[Path] = set()
    words = shlex.split(command)
    for word in [shutil.which(words[0]) or words[0], *words[1:]]:
        for path in (Path(word), Path(word.partition("=")[2] or word)):
            if path.is_file():
                found.add(path)
                if path.suffix:
                    found.update(each for each in path.parent.glob(f"*{path.suffix}") if each.is_file())
    return [_of_file(path) for path in sorted(found)]


def packed_result(result: CaseResult) -> bytes:
    """What is stored of a result, and what claims are judged by.

    Raises
    ------
    TypeError
        If it holds a value that is neither text, a number nor an array of numbers.
    """
    arrays: list[bytes] = []
    size = 0

    def plain(value: Any) -> Any:
        nonlocal size
        if isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
            data = np.ascontiguousarray(value).tobytes()
            arrays.append(data)
            size += len(data)
            return {"dtype": value.dtype.str, "shape": value.shape, "at": size - len(data)}
        if isinstance(value, np.generic) and value.dtype.kind in "biuf":
            return value.item()
        raise TypeError(f"a {type(value).__name__} is not kept")

    seen = result.observed
    text = json.dumps(
        {
            "cell": result.cell,
            "rows": result.rows,
            "headlines": list(result.headlines),
            "curves": [dict(curve) for curve in result.curves],
            "reference_curves": [dict(curve) for curve in result.reference_curves],
            "observed": None
            if seen is None
            else {"step": seen.step, "t": seen.t, "series": dict(seen.series), "scalars": dict(seen.scalars)},
        },
        default=plain,
    ).encode()
    return zlib.compress(b"".join([struct.pack("<Q", len(text)), text, *arrays]), 1)


def unpacked_result(payload: bytes, cell: Cell) -> CaseResult:
    """The result of ``cell``; ValueError, KeyError or `zlib.error` for other bytes."""
    data = zlib.decompress(payload)
    begin = 8 + struct.unpack_from("<Q", data)[0]

    def array(value: dict[str, Any]) -> Any:
        if value.keys() != {"dtype", "shape", "at"}:
            return value
        dtype, count = np.dtype(value["dtype"]), int(np.prod(value["shape"]))
        return np.frombuffer(data, dtype, count, begin + value["at"]).reshape(value["shape"])

    found = json.loads(data[8:begin], object_hook=array)
    seen = found.pop("observed")
    pairs = (
        {} if seen is None else {name: {k: tuple(v) for k, v in seen[name].items()} for name in ("series", "scalars")}
    )
    observed = None if seen is None else Observed(step=seen["step"], t=seen["t"], **pairs)
    setup = None if isinstance(cell.setup, Exception) else cell.setup
    return CaseResult(**found, setup=setup, observed=observed)


def _checksum(digest: bytes, payload: bytes) -> bytes:
    return hashlib.blake2b(digest + payload, digest_size=16).digest()


def _records(stream: IO[bytes], *, whole: bool) -> Iterator[tuple[bytes, bytes, int]]:
    """Digest, payload and end of each good record; the payload is empty, and unchecked, of all except the first unless ``whole``."""
    end = os.fstat(stream.fileno()).st_size
    stream.seek(0)
    while len(head := stream.read(_HEAD.size)) == _HEAD.size:
        length, digest, checksum = _HEAD.unpack(head)
        place = stream.tell() + length
        if length > LARGEST or place > end:
            return
        payload = b""
        if whole or digest == _NO_CELL:
            payload = stream.read(length)
            if checksum != _checksum(digest, payload):
                return
        else:
            stream.seek(place)
        yield digest, payload, place


_NO_CELL = bytes(32)


def _header(stream: IO[bytes]) -> bytes:
    """Digest of the run of a file; ValueError where it is no journal."""
    for digest, payload, _ in _records(stream, whole=False):
        about = json.loads(payload) if digest == _NO_CELL else {}
        if about.get("format") == FORMAT:
            return bytes.fromhex(about["run"])
        break
    raise ValueError("it is none of this version")


def _locked(stream: IO[bytes]) -> bool:
    """Whether another process writes it; else it is this one's from now on."""
    try:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:  # a file system without locks
        return False
    return False


def journals(store: Path) -> list[Path]:
    """Files of interrupted runs, and of those that run now; newest first."""
    return sorted((store / INTERRUPTED).glob("*.journal"), reverse=True)


@dataclass
class Journal:
    """Journal of one run.

    Attributes
    ----------
    cells : sequence of Cell
    run : bytes
        `run_digest`.
    kept : dict
        Results that an interrupted run has left, by the number of the cell.
    notes : list of str
        What there is to report to the user, a line each.
    """

    store: Path
    cells: Sequence[Cell]
    run: bytes
    kept: dict[int, CaseResult] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    notify: Callable[[str], None] = lambda _: None
    _path: Path | None = None
    _stream: IO[bytes] | None = None
    _count: int = 0
    _synced: float = 0.0
    _broken: bool = False

    @classmethod
    def start(
        cls, store: Path, cells: Sequence[Cell], run: bytes, *, resume: bool, notify: Callable[[str], None]
    ) -> Journal:
        """The journal of a run that begins; with ``resume`` it takes over the interrupted run that has most of its cells."""
        journal = cls(store, cells, run, notify=notify)
        found = journal._interrupted()
        best = max(found, key=lambda path: len(found[path]), default=None)
        if best is not None and resume:
            journal._take_over(best, found[best])
        elif best is not None:
            journal.notes.append(
                f"note: an interrupted run with {len(found[best])} of {len(cells)} cells is kept: --resume continues it"
            )
        elif resume:
            other = any(path not in journal._bad for path in journals(store))
            why = "what is kept is of other code, versions, cells or jobs" if other else "no interrupted run is kept"
            journal.notes.append(f"note: nothing to resume, {why}: every cell runs")
        journal._remove_old()
        return journal

    def __post_init__(self) -> None:
        self._bad: set[Path] = set()
        self._digests: dict[int, bytes | None] = {}

    def _close(self) -> None:
        """Write what is left to the disk, and give up the lock."""
        if self._stream is not None:
            with suppress(OSError, ValueError):
                self._stream.flush()
                os.fsync(self._stream.fileno())
            self._stream.close()
            self._stream = None

    def close_unfinished(self) -> str:
        """Close the journal of an interrupted run, whose file stays; return what to report of it."""
        self._close()
        if not self._count:
            return "interrupted: nothing was stored"
        kept = f"interrupted: {self._count} of {len(self.cells)} cells are kept in {self._path}"
        return f"{kept}; the same command with --resume runs the others"

    def after_failure(self) -> str:
        """What is added to an error where the run could not be stored; ``""`` where it was, or no cell is kept."""
        self._close()
        if self._path is None or not self._count or not self._path.exists():
            return ""
        return f"; {self._count} of {len(self.cells)} cells are kept in {self._path}: --resume takes them"

    def keep(self, number: int, result: CaseResult) -> None:
        """Append the result of a cell; what cannot be written, or recognised again, is left out."""
        if self._broken or result.status in BROKEN or (digest := self._digest(number)) is None:
            return
        try:
            payload = packed_result(result)
        except TypeError:
            return
        try:
            self._append(digest, payload)
        except OSError as error:
            self._broken = True
            self.notify(f"note: cells are no longer kept for --resume: {error.strerror or error}")
            return
        self._count += 1

    def done(self) -> None:
        """The run is stored: remove the file, and those of interrupted runs all of whose cells it has."""
        if self._path is not None:
            self._path.unlink(missing_ok=True)
        self._close()
        mine: set[bytes | None] | None = None
        for path in journals(self.store):
            with suppress(OSError, ValueError), path.open("rb+") as stream:
                if _locked(stream) or _header(stream) != self.run:
                    continue
                mine = mine or {self._digest(number) for number in range(len(self.cells))}
                if {digest for digest, _, _ in _records(stream, whole=False)} <= mine | {_NO_CELL}:
                    path.unlink(missing_ok=True)

    def _digest(self, number: int) -> bytes | None:
        if number not in self._digests:
            self._digests[number] = cell_digest(self.cells[number])
        return self._digests[number]

    def _append(self, digest: bytes, payload: bytes) -> None:
        if self._stream is None:
            folder = self.store / INTERRUPTED
            folder.mkdir(parents=True, exist_ok=True)
            self._path = folder / f"{datetime.now(UTC):%Y%m%dT%H%M%SZ}-{secrets.token_hex(3)}.journal"
            self._stream = self._path.open("xb", buffering=0)
            _locked(self._stream)
            about = json.dumps({"format": FORMAT, "run": self.run.hex()}).encode()
            self._stream.write(_HEAD.pack(len(about), _NO_CELL, _checksum(_NO_CELL, about)) + about)
        record = _HEAD.pack(len(payload), digest, _checksum(digest, payload)) + payload
        if self._stream.write(record) != len(record):
            raise OSError("the disk is full")
        if time.monotonic() > self._synced + SYNC_SECONDS:
            os.fsync(self._stream.fileno())
            self._synced = time.monotonic()

    def _interrupted(self) -> dict[Path, set[int]]:
        """Interrupted runs of the same code that have cells of this one, and which."""
        found: dict[Path, set[int]] = {}
        numbers: dict[bytes | None, int] = {}
        for path in journals(self.store):
            try:
                with path.open("rb+") as stream:
                    if _locked(stream):
                        continue
                    try:
                        if _header(stream) != self.run:
                            continue
                    except (ValueError, KeyError, AttributeError) as error:
                        self._bad.add(path)
                        self.notes.append(f"note: {path} is damaged and ignored: {error}")
                        continue
                    numbers = numbers or {self._digest(number): number for number in range(len(self.cells))}
                    have = {numbers[digest] for digest, _, _ in _records(stream, whole=False) if digest in numbers}
            except OSError:
                continue
            if have:
                found[path] = have
        return found

    def _take_over(self, path: Path, numbers: set[int]) -> None:
        stream = path.open("rb+", buffering=0)
        if _locked(stream):  # another run was faster
            stream.close()
            return
        places = {self._digests[number]: number for number in numbers}
        payloads: dict[bytes, bytes] = {}
        good, mine = 0, True
        for digest, payload, place in _records(stream, whole=True):
            number = places.get(digest)
            if number is not None:
                try:
                    self.kept[number] = unpacked_result(payload, self.cells[number])
                except (ValueError, KeyError, TypeError, zlib.error, struct.error):
                    break
                payloads[digest] = payload
            mine = mine and (number is not None or digest == _NO_CELL)
            good = place
        if mine:
            stream.truncate(good)  # a record that a kill has cut off would hide those behind it
            stream.seek(good)
            self._path, self._stream = path, stream
        else:  # it also has cells of which this run has none, and stays for them
            stream.close()
            for digest, payload in payloads.items():
                self._append(digest, payload)
        self._count = len(self.kept)
        lost = len(numbers) - len(self.kept)
        damaged = f"; {lost} more are damaged and run again" if lost > 0 else ""
        self.notes.append(
            f"resumed: {len(self.kept)} of {len(self.cells)} cells are kept of an interrupted run{damaged}"
        )

    def _remove_old(self) -> None:
        for path in [each for each in journals(self.store) if each != self._path][KEPT:]:
            with suppress(OSError), path.open("rb+") as stream:
                if not _locked(stream):
                    path.unlink(missing_ok=True)
