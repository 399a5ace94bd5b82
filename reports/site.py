"""A public site of any number of stores: scores by case and engine, and for each the address that stays, history, data and repeat.

An address is made of the names alone: ``engine/ENGINE/VERSION/CASE.html#QUANTITY``. A score is the largest error of a case's headlines
over the variants of the newest run of that engine in that version; every number that a page shows is one of a stored row.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
import re
import shlex
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from html import escape
from itertools import zip_longest
from pathlib import Path
from statistics import median
from typing import Any

from ninedisk.harness.results.reader import read_about, read_rows, run_facts, run_ids, run_time
from ninedisk.harness.results.schema import (
    EXCUSED,
    HEADLINE_COLUMNS,
    MEASUREMENT_COLUMNS,
    Row,
    RunFacts,
    row_tolerance,
    worst_status,
)
from ninedisk.harness.results.statuses import TABLE
from ninedisk.reports.folder import ReportError, fresh_folder
from ninedisk.reports.pages import environment, sheet
from ninedisk.reports.panel import text

MARKER = ".ninedisk-site"
"""File that says: this folder is a site and may be replaced."""

Progress = Callable[[str, int, int], None]
Place = tuple[str, str, str]
"""Engine, its version, case."""

CELL = (
    "case",
    "case_title",
    "case_version",
    "variant",
    "params",
    "engine",
    "engine_name",
    "engine_version",
    "status",
    "reason",
)
NOT_RUN = frozenset({"unsupported", "not-installed"})
OF_CHECK = tuple(
    name for name in MEASUREMENT_COLUMNS if name not in ("params", "support", "engine", "engine_version", "case")
)
OF_HEADLINE = tuple(
    name for name in HEADLINE_COLUMNS if name not in ("params", "support", "engine", "engine_version", "case")
)
WORDS = frozenset(
    {
        "source",
        "why",
        "reason",
        "finding",
        "known_size",
        "use",
        "scale_is",
        "worst_step",
        "first_divergence_step",
        "uncertainty",
        "case_version",
    }
)
LONGEST_NAME = 100


@dataclass(frozen=True)
class Outcome:
    """What one run says about an engine on a case."""

    run: RunFacts
    cells: list[Row]
    checks: list[Row]
    headlines: list[Row]

    @property
    def score(self) -> Row | None:
        """The headline with the largest error; None of a case without headlines, or where none could be measured."""
        rated = [row for row in self.headlines if math.isfinite(row["rel_error"])]
        return max(rated, key=lambda row: float(row["rel_error"]), default=None)

    @property
    def passes(self) -> tuple[int, int]:
        """Checks that pass, and all that were judged."""
        judged = [row["status"] for row in self.checks if row["status"] not in ("no-truth", "not-observed")]
        return judged.count("pass"), len(judged)

    @property
    def status(self) -> str:
        """The status that decides."""
        return worst_status(str(cell["status"]) for cell in self.cells)


@dataclass(frozen=True)
class Site:
    """All outcomes by place, oldest first; cells that the newest run of a place left out; names for people."""

    runs: list[RunFacts]
    outcomes: dict[Place, list[Outcome]] = field(default_factory=dict)
    left: dict[Place, int] = field(default_factory=dict)
    names: dict[str, str] = field(default_factory=dict)
    titles: dict[str, str] = field(default_factory=dict)

    def newest_version(self, engine: str) -> str:
        """The version of an engine that ran last."""
        mine = {place: held[-1].run for place, held in self.outcomes.items() if place[0] == engine}
        return max(mine.items(), key=lambda item: (_time(item[1]), item[0]))[0][1]


def address(name: str) -> str:
    """File name of an id: itself where a link can hold it, ``/`` as ``~``; no two ids have the same, whatever else a site holds."""
    held = (
        "".join(c if re.fullmatch(r"[A-Za-z0-9.+-]", c) else "~" if c == "/" else f"_{ord(c):x}_" for c in name) or "_"
    )
    held = f"_2e_{held[1:]}" if held.startswith(".") else held
    return held if len(held) <= LONGEST_NAME else f"{held[:60]}_{hashlib.sha256(name.encode()).hexdigest()[:16]}_"


def page_of(place: Place) -> str:
    """Address of a place's page below the site."""
    return "engine/" + "/".join(map(address, place)) + ".html"


def read_site(stores: Sequence[Path]) -> Site:
    """Every finished run of the stores; one that several stores hold counts once.

    Raises
    ------
    ReportError
        If a store holds no finished run, or two stores hold different runs of one id.
    StoreError
        If a run is damaged.
    """
    found: dict[str, tuple[Path, Row]] = {}
    for store in stores:
        ids = run_ids(store)
        if not ids:
            raise ReportError(f"{store} holds no finished run: run `ninedisk run --store {store}` first")
        for run_id in ids:
            about = read_about(store, run_id)
            if run_id in found and found[run_id][1] != about:
                raise ReportError(
                    f"{found[run_id][0]} and {store} hold different runs {run_id!r}: rename the folder of one"
                )
            found[run_id] = (store, about)
    order = sorted(found.values(), key=lambda item: _time(run_facts(item[1])))
    site = Site([run_facts(about) for _, about in order])
    for (store, about), run in zip(order, site.runs, strict=True):
        held: dict[Place, Outcome] = {}
        left: Counter[Place] = Counter()
        for cell in read_rows(store, about, "cells", CELL):
            left[_place(cell)] += cell["status"] in NOT_RUN
            if cell["status"] not in NOT_RUN:
                held.setdefault(_place(cell), Outcome(run, [], [], [])).cells.append(cell)
                site.names[cell["engine"]] = cell["engine_name"] or cell["engine"]
                site.titles[cell["case"]] = cell["case_title"] or cell["case"]
        for table in ("measurements", "headlines"):
            for row in read_rows(store, about, table):
                outcome = held.get(_place(row))
                if outcome is not None and row["quantity"]:
                    (outcome.checks if table == "measurements" else outcome.headlines).append(row)
        site.left.update(left)
        for place, outcome in held.items():
            site.outcomes.setdefault(place, []).append(outcome)
    if not site.outcomes:
        raise ReportError(f"{', '.join(map(str, stores))}: no cell of any run has run, so there is nothing to show")
    return site


def _place(row: Row) -> Place:
    return row["engine"], row["engine_version"], row["case"]


def _time(run: RunFacts) -> tuple[Any, str]:
    return run_time(run.started), run.run_id


def build_site(stores: Sequence[Path], out: Path, progress: Progress) -> Path:
    """Write the site of some stores into the folder ``out``, which is replaced as a whole; its first page.

    Raises
    ------
    ReportError, StoreError
        As `read_site`; or if ``out`` is something else than an earlier site, or cannot be written.
    """
    progress("reading runs", 0, 1)
    site = read_site(stores)
    with fresh_folder(out, MARKER, "site") as folder:
        _write(site, folder, progress)
    return Path(out).absolute() / "index.html"


def check_site(stores: Sequence[Path], out: Path, progress: Progress) -> str:
    """Derive every page, data file and badge anew from the stores; what differs first, or ``""``.

    Raises
    ------
    ReportError, StoreError
        As `read_site`; or if ``out`` is no site.
    """
    if not (out / MARKER).is_file():
        raise ReportError(f"{out} is no site: build it with `ninedisk site --out {out}` first")
    progress("reading runs", 0, 1)
    site = read_site(stores)
    with tempfile.TemporaryDirectory(prefix="ninedisk-site-") as name:
        fresh = Path(name)
        _write(site, fresh, progress)
        anew, held = (
            {path.relative_to(root): path for path in root.rglob("*") if path.is_file()} for root in (fresh, out)
        )
        held.pop(Path(MARKER), None)
        for path in sorted({*anew, *held}):
            if path not in held:
                return f"{path}: the stores have it, the site lacks it"
            if path not in anew:
                return f"{path}: no store has it"
            if said := _difference(anew[path], held[path]):
                return f"{path}: {said}"
    return ""


def _difference(anew: Path, held: Path) -> str:
    """What two files differ in first, in words; Parquet by its rows, since another version of its writer gives other bytes."""
    if anew.read_bytes() == held.read_bytes():
        return ""
    if anew.suffix == ".parquet":
        import pyarrow as pa
        import pyarrow.parquet as pq

        try:
            one, two = (pq.ParquetFile(io.BytesIO(path.read_bytes())).read() for path in (anew, held))
        except (OSError, pa.ArrowException) as error:
            return f"it cannot be read ({error})"
        # Row by row as text: a NaN equals no NaN, and every digit of a double is in its text.
        rows = zip_longest(map(repr, one.to_pylist()), map(repr, two.to_pylist()), fillvalue="nothing")
        return next((f"the stores give {a}, the site says {b}" for a, b in rows if a != b), "")
    one_text, two_text = (path.read_bytes().decode("utf-8", "replace") for path in (anew, held))
    for line, (a, b) in enumerate(zip_longest(one_text.splitlines(), two_text.splitlines(), fillvalue=""), 1):
        if a != b:
            begin = next((k for k, (x, y) in enumerate(zip(a, b, strict=False)) if x != y), min(len(a), len(b)))
            begin = max(a.rfind(">", 0, begin), a.rfind('"', 0, begin), begin - 60) + 1
            reported = [re.split(r"[<>\"]", part[begin : begin + 80])[0] for part in (a, b)]
            return f"line {line}: the stores give {reported[0]!r}, the site says {reported[1]!r}"
    return "line ends differ"


def _write(site: Site, folder: Path, progress: Progress) -> None:
    env = environment()
    env.filters |= {"address": address}
    env.globals |= {"page_of": page_of, "exact": _exact}
    engines = sorted({place[0] for place in site.outcomes}, key=lambda engine: site.names[engine].lower())
    newest = {engine: site.newest_version(engine) for engine in engines}
    versions = {
        engine: sorted({v for e, v, _ in site.outcomes if e == engine}, key=lambda v: v != newest[engine])
        for engine in engines
    }
    cases = list(site.titles)
    common = {"names": site.names, "titles": site.titles, "newest": newest, "versions": versions}

    def page(path: str, template: str, **values: Any) -> None:
        target = folder / path
        target.parent.mkdir(parents=True, exist_ok=True)
        root = "../" * path.count("/")
        target.write_text(env.get_template(template).render(root=root, **common, **values), encoding="utf-8")

    (folder / "style.css").write_text(sheet("site.css"), encoding="utf-8")
    total = len(site.outcomes) + len(engines) + len(cases) + 1
    latest = {
        (e, c): site.outcomes[e, newest[e], c][-1] for e in engines for c in cases if (e, newest[e], c) in site.outcomes
    }
    for done, (place, held) in enumerate(sorted(site.outcomes.items())):
        progress("writing pages", done, total)
        path = page_of(place)
        quantities = _by_quantity(held[-1].checks)
        page(
            path,
            "site/place.html",
            place=place,
            held=held,
            now=held[-1],
            quantities=quantities,
            tolerance=row_tolerance,
        )
        page(
            path.removesuffix(".html") + ".cite.html",
            "site/cite.html",
            place=place,
            now=held[-1],
            repeats=_repeats(held[-1]),
        )
        _write_data(folder / path, place, held)
    for engine in engines:
        rows = [(case, [site.outcomes.get((engine, version, case)) for version in versions[engine]]) for case in cases]
        rows = [(case, held) for case, held in rows if any(held)]
        page(f"engine/{address(engine)}/index.html", "site/engine.html", engine=engine, rows=rows)
        badge = folder / "badge" / f"{address(engine)}.svg"
        badge.parent.mkdir(exist_ok=True)
        ran = [latest[engine, case] for case in cases if (engine, case) in latest]
        left = sum(
            count for (name, version, _), count in site.left.items() if (name, version) == (engine, newest[engine])
        )
        badge.write_text(badge_svg(ran, left), encoding="utf-8")
    for case in cases:
        ranked = sorted(((engine, latest[engine, case]) for engine in engines if (engine, case) in latest), key=_rank)
        page(f"case/{address(case)}.html", "site/case.html", case=case, ranked=ranked)
    page("statuses.html", "statuses.html")
    page("index.html", "site/index.html", engines=engines, cases=cases, latest=latest, runs=site.runs[::-1])
    progress("writing pages", total, total)


def _rank(item: tuple[str, Outcome]) -> tuple[bool, float, str]:
    """Engines whose checks fail or whose cells break come last."""
    score = item[1].score
    return item[1].status not in EXCUSED, (float(score["rel_error"]) if score else math.inf), item[0]


def _exact(value: Any) -> str:
    """All digits of a number, the shortest text that gives the same double back."""
    return repr(float(value)) if math.isfinite(text.as_float(value)) else ""


def _by_quantity(checks: Iterable[Row]) -> dict[str, list[Row]]:
    """Checks by quantity, each and all with the largest share of its tolerance first."""

    def share(row: Row) -> float:
        allowed = row_tolerance(row)
        error = text.as_float(row["abs_error"])
        if math.isnan(error):
            return math.inf if row["status"] not in EXCUSED else -1.0
        return error / allowed if allowed > 0.0 else math.inf if error > 0.0 else 0.0

    found: dict[str, list[Row]] = {}
    for row in sorted(checks, key=lambda row: (-share(row), row["quantity"], row["variant"])):
        found.setdefault(row["quantity"], []).append(row)
    return found


def _repeats(now: Outcome) -> list[tuple[str, str]]:
    """Variant and the complete command that runs it again."""
    argv = shlex.split(now.run.command) if now.run.command.count("'") % 2 == 0 else []
    behind = [
        (word, argv[k + 1]) for k, word in enumerate(argv[:-1]) if word in ("--engine-cmd", "--option", "--published")
    ]
    found = []
    for cell in now.cells:
        words = ["ninedisk", "run", cell["case"], "--engine", cell["engine"]]
        words += [part for pair in behind for part in pair]
        for name, value in text.decoded(cell["params"], dict).items():
            words += ["--set", f"{name}={_setting(value)}"]
        found.append((str(cell["variant"]), shlex.join(words)))
    return found


def _setting(value: Any) -> str:
    """A parameter's stored value as ``--set`` reads it."""
    return (
        str(value).lower()
        if isinstance(value, bool) or value is None
        else value
        if isinstance(value, str)
        else repr(value)
    )


def _write_data(page: Path, place: Place, held: Sequence[Outcome]) -> None:
    """The rows behind a page, all runs: each column in ``.parquet``, numbers in ``.json``, a run there its place in ``runs``."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    rows: dict[str, list[Row]] = {
        "headlines": [_row(row, OF_HEADLINE, each.run) for each in held for row in each.headlines],
        "checks": [_row(row, OF_CHECK, each.run) for each in held for row in each.checks],
    }
    about: Row = dict(zip(("engine", "engine_version", "case"), place, strict=True))
    about["runs"] = [vars(each.run) | {"versions": dict(each.run.versions)} for each in held]
    # A table as columns: names stand once, and what repeats packs well.
    places = {each.run.run_id: k for k, each in enumerate(held)}
    tables: dict[str, dict[str, list[Any]]] = {}
    for name, table in rows.items():
        columns = [column for column in table[0] if column not in WORDS] if table else []
        tables[name] = {column: [row[column] for row in table] for column in columns}
        tables[name]["run"] = [places[row["run"]] for row in table]
    page.with_suffix(".json").write_text(
        json.dumps(about | tables, ensure_ascii=False, separators=(",", ":")) + "\n", encoding="utf-8"
    )
    both = [{"table": name, **row} for name, table in rows.items() for row in table]
    flat = {name: [row.get(name) for row in both] for name in dict.fromkeys(("table", "run", *OF_HEADLINE, *OF_CHECK))}
    with page.with_suffix(".parquet").open("wb") as stream:  # Arrow takes no path that is not UTF-8
        pq.write_table(pa.table(flat), stream, compression="zstd")


def _row(row: Row, columns: Sequence[str], run: RunFacts) -> Row:
    """Columns of a row with its run; what is no finite number is None, which JSON has."""
    kept = {name: row[name] for name in columns}
    return {"run": run.run_id} | {
        k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in kept.items()
    }


BADGE_COLOURS = {"green": "#1c6b41", "amber": "#8a5a00", "red": "#a3251b"}

BROKEN = frozenset({"error", "timeout"})
"""Statuses of cells that started and did not end; the badge names them."""

MOST_PASS, SOME_PASS, HALF_RUN, FEW_FAIL = 0.9, 0.6, 0.5, 0.01
"""Of a badge: share of judged checks that pass for green, and for amber; share of cells that run, for green; of checks that may fail,
for amber."""


def badge_colour(outcomes: Sequence[Outcome], left: int) -> str:
    """The colour of a badge, a key of `BADGE_COLOURS`.

    - green: at least `MOST_PASS` of the judged checks pass, none fails, no cell ends in an error, and at least `HALF_RUN` of the cells
      ran to their end;
    - red: fewer than `SOME_PASS` pass, or more than `FEW_FAIL` fail, or as many cells end in an error;
    - amber: all others.

    A check is judged where its truth says something. Known gaps and known differences are judged and do not pass. A timeout is no
    wrong answer: its cell counts as one that did not run, and the badge's text names it.

    Parameters
    ----------
    outcomes : sequence of Outcome
        One for each case.
    left : int
        Cells that the engine cannot run.
    """
    passed, judged = _sums(outcomes)
    statuses = [str(cell["status"]) for each in outcomes for cell in each.cells]
    failed = sum(row["status"] == "fail" for each in outcomes for row in each.checks)
    broken = statuses.count("error")
    covered = (len(statuses) - statuses.count("timeout") - broken) / (len(statuses) + left)
    if not judged or passed < SOME_PASS * judged or failed > FEW_FAIL * judged or broken > FEW_FAIL * len(statuses):
        return "red"
    return "green" if passed >= MOST_PASS * judged and not failed + broken and covered >= HALF_RUN else "amber"


def badge_svg(outcomes: Sequence[Outcome], left: int = 0) -> str:
    """A badge: checks that pass, cells that ran, what broke, and the median over cases of the headlines' largest errors.

    Parameters as of `badge_colour`, which chooses the colour.
    """
    passed, judged = _sums(outcomes)
    statuses = [str(cell["status"]) for each in outcomes for cell in each.cells]
    broken = sum(status in BROKEN for status in statuses)
    said = [f"{passed} of {judged} checks pass"]
    if failed := sum(row["status"] == "fail" for each in outcomes for row in each.checks):
        said.append(f"{failed} fail")
    if left or broken:
        said.append(f"{len(statuses) - broken} of {len(statuses) + left} cells run")
    said += [
        text.count_noun(count, status) for status in TABLE if status in BROKEN and (count := statuses.count(status))
    ]
    if scores := [float(each.score["rel_error"]) for each in outcomes if each.score]:
        said.append(f"median error {text.error(median(scores))}")
    words = ", ".join(said)
    name, right = 66, round(6.2 * len(words)) + 14  # text set to these lengths, whatever the font
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{name + right}" height="20" role="img" aria-label="ninedisk: {escape(words)}">'
        f"<title>ninedisk: {escape(words)}</title>"
        f'<rect width="{name}" height="20" rx="3" fill="#444"/>'
        f'<rect x="{name - 4}" width="{right + 4}" height="20" rx="3" fill="{BADGE_COLOURS[badge_colour(outcomes, left)]}"/>'
        f'<g fill="#fff" font-family="Verdana,DejaVu Sans,sans-serif" font-size="11">'
        f'<text x="7" y="14" textLength="{name - 16}">ninedisk</text>'
        f'<text x="{name + 5}" y="14" textLength="{right - 13}">{escape(words)}</text></g></svg>\n'
    )


def _sums(outcomes: Sequence[Outcome]) -> tuple[int, int]:
    passed, judged = (sum(numbers) for numbers in zip(*(each.passes for each in outcomes), strict=True))
    return passed, judged
