"""What the words BASE and HEAD of ``ninedisk compare`` mean: runs of a store, folders, exported files."""

from __future__ import annotations

import re
from pathlib import Path

from ninedisk.harness.api.errors import StoreError, UsageError, close_matches
from ninedisk.harness.results.export import FORMATS, read_export
from ninedisk.harness.results.snapshot import Snapshot, in_order, load_snapshot, moment, run_facts
from ninedisk.harness.results.store import read_about, run_ids

_LATEST = re.compile(r"latest(?:~(\d+))?")
MEANINGS = (
    "give a run id (see `ninedisk runs`), latest, latest~1, a range such as latest~9..latest~5, a folder with runs, "
    "or a file of `ninedisk export`"
)


def resolve(word: str, store: Path) -> list[Snapshot]:
    """Runs that a word names, oldest first, at least one.

    Parameters
    ----------
    word : str
        ``latest``, ``latest~N``, a run id or an unambiguous beginning of one, ``FROM..TO`` of these (both included), a
        store's or a run's folder, or a file that `ninedisk.harness.results.export` wrote.
    store : Path
        Where run ids are looked up.

    Raises
    ------
    UsageError
        If the word names nothing; StoreError if what it names cannot be read.
    """
    path = Path(word)
    if path.is_file():
        return _not_empty(read_export(path), word)
    if path.is_dir():
        return _folder(path)
    if word in run_ids(store):  # asked for by its full name, so that no other run can stand in the way
        return [load_snapshot(store, word)]
    first, dots, last = word.partition("..")
    ids = _ids_by_time(store)
    if dots:
        begin, end = (_index(part, ids, store) for part in (first, last))
        if begin > end:
            raise UsageError(f"{word!r} is empty: {first!r} is newer than {last!r}; write the older run first")
        wanted = ids[begin : end + 1]
    else:
        if path.suffix in FORMATS:
            raise UsageError(f"there is no file {word!r}: {MEANINGS}")
        wanted = [ids[_index(word, ids, store)]]
    return in_order(load_snapshot(store, run_id) for run_id in wanted)


def one_stored(word: str, store: Path) -> str:
    """Id of the one run of a store that a word names: ``latest``, ``latest~N``, an id or an unambiguous beginning of one.

    Raises
    ------
    UsageError
        If the word names nothing.
    """
    if word in run_ids(store):
        return word
    ids = _ids_by_time(store)
    return ids[_index(word, ids, store)]


def _folder(path: Path) -> list[Snapshot]:
    if (path / "run.json").is_file():
        if path.parent.name != "runs":
            raise StoreError(f"the run {str(path)!r} lies in no store: a store keeps it as runs/{path.name}")
        return [load_snapshot(path.parent.parent, path.name)]
    return _not_empty([load_snapshot(path, run_id) for run_id in run_ids(path)], str(path))


def _not_empty(runs: list[Snapshot], word: str) -> list[Snapshot]:
    if not runs:
        raise UsageError(f"{word!r} holds no finished run: {MEANINGS}")
    return in_order(runs)


def _ids_by_time(store: Path) -> list[str]:
    """Ids of the finished runs by their start, oldest first: an id from elsewhere need not sort by time."""
    facts = [run_facts(read_about(store, run_id)) for run_id in run_ids(store)]
    return [each.run_id for each in sorted(facts, key=lambda each: (moment(each.started), each.run_id))]


def _index(word: str, ids: list[str], store: Path) -> int:
    match = _LATEST.fullmatch(word)
    if match:
        back = int(match[1] or 0)
        if back >= len(ids):
            raise UsageError(f"{word!r} is too far back: the store {str(store)!r} has {len(ids)} finished run(s)")
        return len(ids) - 1 - back
    found = [k for k, run_id in enumerate(ids) if run_id == word or (word and run_id.startswith(word))]
    if len(found) == 1 or word in ids:
        return ids.index(word) if word in ids else found[0]
    if found:
        raise UsageError(f"{word!r} is the beginning of {len(found)} runs of {str(store)!r}: give more of it")
    raise UsageError(f"{word!r} names no run of the store {str(store)!r}: {MEANINGS}.{close_matches(word, ids)}")
