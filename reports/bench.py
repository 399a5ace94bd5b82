"""The page of one benchmark record: charts over size, threads and accuracy, and every row as a table."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ninedisk.reports import pages
from ninedisk.reports.drawing.charts import Dots, Look, PointChart, engine_looks, on_page
from ninedisk.reports.drawing.race import TARGET, races
from ninedisk.reports.panel import text
from ninedisk.reports.panel.text import as_float

Row = Mapping[str, Any]
SUITES = {
    "dem": "Many disks, contact springs",
    "spheres": "Many spheres, Hertz-Mindlin",
    "cd": "Contact solvers on packings at rest",
    "coulomb": "The open set of contact problems: who solves what",
    "coulomb3d": "Contact problems in space: who solves what",
    "flow": "Rigid disks in motion: time per simulated second beside the penetration",
    "harness": "The whole verification run",
}
Point = tuple[float, float, str]
FAMILIES = ("settled", "flowing")
"""Problems that come in several sizes, by the first part of their names."""
MIXED = "mixed"
"""Problems of two sizes: ``mixed-RATIO-SMALL``."""
ACCURACY = "accuracy-"
SHORT = "-short"


def write_bench(record: Mapping[str, Any], path: Path) -> None:
    """Write the page of a record, one file that holds its style sheet, scripts and numbers.

    Parameters
    ----------
    record : mapping
        ``run_id``, ``provenance``, ``argv``, ``versions`` and ``rows``, as the benchmark writes them.
    path : Path
        File to write.
    """
    rows: Sequence[Row] = record["rows"]
    raced = {suite: races(rows, suite) for suite in ("coulomb", "coulomb3d")}
    env = pages.environment()
    page = env.get_template("bench.html").render(
        record=record,
        facts=record["provenance"],
        suites={name: [row for row in rows if row["suite"] == name] for name in SUITES},
        titles=SUITES,
        checks={name: _checks(rows, name) for name in SUITES},
        figures={name: [on_page(chart) for chart in charts(rows, name)] for name in SUITES}
        | {
            f"{suite}/{each.rule}": [on_page(chart) for chart in each.charts]
            for suite, its in raced.items()
            for each in its
        },
        races=raced,
        sizes=max((row["disks"] for row in rows if row["suite"] == "coulomb"), default=0),
        target=TARGET,
        **pages.single_file(),
    )
    path.write_text(page, encoding="utf-8")


def charts(rows: Sequence[Row], suite: str) -> list[PointChart]:
    """Charts of one suite: rates over size, time over the accuracy reached; none where nothing was timed."""
    timed = [row for row in rows if row["suite"] == suite and _finite(row["median_s"])]
    if suite in ("dem", "spheres"):
        return dem_charts(timed)
    if suite == "flow":
        return [
            _penetration(problem, [row for row in timed if row["problem"] == problem])
            for problem in dict.fromkeys(row["problem"] for row in timed)
        ]
    if suite != "cd":
        return []
    looks = engine_looks({row["engine"]: row["engine"] for row in timed})
    return [
        _accuracy(problem, start, chosen, looks)
        for problem in dict.fromkeys(row["problem"] for row in timed)
        for start in ("cold", "warm")
        if (chosen := [row for row in timed if (row["problem"], row["start"]) == (problem, start)])
    ]


def _accuracy(problem: str, start: str, rows: Sequence[Row], looks: Mapping[str, Look]) -> PointChart:
    dots = [
        line_of(
            look,
            [(row["median_s"], row["check_value"], f"{row['tolerance']:g}") for row in rows if row["engine"] == name],
        )
        for name, look in looks.items()
        if any(row["engine"] == name for row in rows)
    ]
    label = "larger of residual and gap"
    return PointChart(f"{problem}, {start}: accuracy against cost", "time [s]", label, tuple(dots))


def _penetration(problem: str, rows: Sequence[Row]) -> PointChart:
    families = {name: name for name in (row["engine"].partition(",")[0] for row in rows)}
    looks = engine_looks(families)
    dots = [
        line_of(
            look,
            sorted(
                (row["rate"], row["penetration"], row["engine"])
                for row in rows
                if row["engine"].partition(",")[0] == name
            ),
        )
        for name, look in looks.items()
    ]
    return PointChart(
        f"{problem}: penetration against cost", "s / simulated s", "overlap per disk / radii", tuple(dots)
    )


def _checks(rows: Sequence[Row], suite: str) -> dict[str, list[str]]:
    """Engines by the text of the check that they had to pass."""
    found: dict[str, list[str]] = {}
    for row in rows:
        engines = found.setdefault(row["check"], []) if row["suite"] == suite and row["check"] else []
        if row["engine"] not in engines:
            engines.append(row["engine"])
    return found


def _finite(value: Any) -> bool:
    return math.isfinite(text.as_float(value))


def dem_charts(rows: Sequence[Row]) -> list[PointChart]:
    """Charts of the timed rows of the suite; those for which there is nothing to draw are left out."""
    accuracy = dict.fromkeys(row["problem"] for row in rows if row["problem"].startswith(ACCURACY))
    charts = [
        *(_scaling(rows, family) for family in FAMILIES),
        _mixed(rows),
        _threads(rows),
        _memory(rows),
        *(_accuracy_charts(problem, [row for row in rows if row["problem"] == problem]) for problem in accuracy),
    ]
    return [chart for chart in charts if chart is not None]


def _scaling(rows: Sequence[Row], family: str) -> PointChart | None:
    dots = _lines(_by_size(rows, family), _engine_and_threads, lambda row: (row["disks"], row["rate"], row["problem"]))
    return PointChart(f"{family}: rate over size", f"{_size_noun(rows)}s", "particle-steps / s", dots) if dots else None


def _mixed(rows: Sequence[Row]) -> PointChart | None:
    """Rates over the ratio of large to small radii; ``settled``, of one size, is at 1."""
    mixed = [row for row in rows if row["problem"].startswith(f"{MIXED}-")]
    sizes = {row["problem"].split("-")[2] for row in mixed}
    one_size = [row for row in rows if any(row["problem"] == f"settled-{size}" for size in sizes)]

    def ratio(row: Row) -> int:
        return int(row["problem"].split("-")[1]) if row["problem"].startswith(MIXED) else 1

    dots = _lines(
        sorted([*one_size, *mixed], key=ratio),
        lambda row: f"{_engine_and_threads(row)}, {row['problem'].rpartition('-')[2]}",
        lambda row: (ratio(row), row["rate"], row["problem"]),
    )
    title, label = "two sizes: rate over the ratio of their radii", "radius of the large ones / that of the small ones"
    return PointChart(title, label, "particle-steps / s", dots) if mixed and dots else None


def _threads(rows: Sequence[Row]) -> PointChart | None:
    chosen = [row for row in rows if _family(row) in FAMILIES]
    shared = {(row["problem"], row["engine"]) for row in chosen if row["threads"] > 1}
    dots = _lines(
        sorted(
            (row for row in chosen if (row["problem"], row["engine"]) in shared), key=lambda row: int(row["threads"])
        ),
        lambda row: f"{row['engine']}, {row['problem']}",
        lambda row: (row["threads"], row["rate"], row["problem"]),
    )
    if not dots:
        return None
    most = max(x for line in dots for x in line.x)
    # As many times the rate of one thread as there are threads.
    guides = tuple(("", (1.0, most), (line.y[0], most * line.y[0])) for line in dots)
    heights = [y for _, _, ys in guides for y in ys] + [y for line in dots for y in line.y]
    limits = ((0.9, 1.1 * most), (0.5 * min(heights), 2.0 * max(heights)))
    title = "rate over threads (dashed: in proportion)"
    return PointChart(title, "threads", "particle-steps / s", dots, guides, limits=limits)


def _memory(rows: Sequence[Row]) -> PointChart | None:
    """Arrays of a run of ours, growth of the resident memory of others."""
    dots = _lines(
        [row for row in _by_size(rows, FAMILIES[0]) if row["threads"] == 1 and _bytes(row) > 0.0],
        lambda row: f"{row['engine']} ({'arrays' if as_float(row['bytes_per_disk']) > 0.0 else 'resident'})",
        lambda row: (row["disks"], _bytes(row), row["problem"]),
    )
    if not dots:
        return None
    noun = _size_noun(rows)
    return PointChart("settled: memory over size", f"{noun}s", f"bytes / {noun}", dots)


def _accuracy_charts(problem: str, rows: Sequence[Row]) -> PointChart:
    """Lines lead from coarse to fine steps."""
    dots = _lines(
        sorted(rows, key=lambda row: int(row["steps"])),
        lambda row: row["engine"],
        lambda row: (row["median_s"], row["check_value"], f"{row['steps']} steps"),
    )
    title = f"{problem.removeprefix(ACCURACY)}: error against cost"
    return PointChart(title, "time [s]", "error / largest force", dots, decades=True)


def _size_noun(rows: Sequence[Row]) -> str:
    """What the rows of one suite have many of."""
    return "sphere" if rows[0]["suite"] == "spheres" else "disk"


def _family(row: Row) -> str:
    return str(row["problem"]).partition("-")[0]


def _by_size(rows: Sequence[Row], family: str) -> list[Row]:
    """Rows of a family, small problems first; short runs only of engines that do no whole ones: they would say the same again."""
    chosen = [row for row in rows if _family(row) == family]
    whole = {(row["engine"], row["disks"]) for row in chosen if not row["problem"].endswith(SHORT)}
    kept = [row for row in chosen if not row["problem"].endswith(SHORT) or (row["engine"], row["disks"]) not in whole]
    return sorted(kept, key=lambda row: int(row["disks"]))


def _bytes(row: Row) -> float:
    own, resident = as_float(row["bytes_per_disk"]), as_float(row["resident_per_disk"])
    return own if own > 0.0 else resident


def _engine_and_threads(row: Row) -> str:
    threads = f", {row['threads']} threads" if row["threads"] > 1 else ""
    return f"{row['engine']}{threads}{' (short runs)' if row['problem'].endswith(SHORT) else ''}"


def _lines(rows: Sequence[Row], name_of: Callable[[Row], str], point_of: Callable[[Row], Point]) -> tuple[Dots, ...]:
    """A line for each name, its points in the order of the rows."""
    lines: dict[str, list[Point]] = {}
    for row in rows:
        lines.setdefault(name_of(row), []).append(point_of(row))
    looks = engine_looks({name: name for name in lines})
    return tuple(line_of(looks[name], points) for name, points in lines.items())


def line_of(look: Look, points: Sequence[Point]) -> Dots:
    """Points of one look; a logarithmic axis has no 0."""
    x, y, names = zip(*points, strict=True)
    floor = tuple(max(float(value), 1e-17) for value in y)
    return Dots(look.label, look, tuple(float(value) for value in x), floor, names=names)
