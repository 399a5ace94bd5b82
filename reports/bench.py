"""The page of one benchmark record: charts over size and over accuracy, and every row as a table.

Charts of the suite ``dem``: rates over size and over threads, memory over size, accuracy against cost.

The roofline estimate of a benchmark page: what the DEM's step does, under the roofs that the same run measured.
"""

from __future__ import annotations

import base64
import math
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from markupsafe import Markup

from ninedisk.reports import pages, text
from ninedisk.reports.draw import Dots, PointChart, draw_points
from ninedisk.reports.pages import HERE
from ninedisk.reports.style import Look, engine_looks
from ninedisk.reports.text import as_float

Row = Mapping[str, Any]

SUITES = {
    "dem": "Many disks, contact springs",
    "cd": "Contact solvers on packings at rest",
    "flow": "Rigid disks in motion: time per simulated second beside the penetration",
    "harness": "The whole verification run",
}


def write_bench(record: Mapping[str, Any], path: Path) -> None:
    """Write the page of a record, one file that holds its style sheet and its figures.

    Parameters
    ----------
    record : mapping
        ``run_id``, ``provenance``, ``argv``, ``versions`` and ``rows``, as the benchmark writes them.
    path : Path
        File to write.
    """
    rows: Sequence[Row] = record["rows"]
    env = pages.environment()
    page = env.get_template("bench.html").render(
        record=record,
        facts=record["provenance"],
        suites={name: [row for row in rows if row["suite"] == name] for name in SUITES},
        titles=SUITES,
        checks={name: _checks(rows, name) for name in SUITES},
        figures={name: [embedded(chart) for chart in charts(rows, name)] for name in SUITES},
        rooflines=estimates([row for row in rows if row["suite"] == "dem"]),
        binds=BINDS,
        sheet=Markup((HERE / "assets" / "style.css").read_text(encoding="utf-8")),
    )
    path.write_text(page, encoding="utf-8")


def charts(rows: Sequence[Row], suite: str) -> list[PointChart]:
    """Charts of one suite: rates over size, time over the accuracy reached, roofs; none where nothing was timed."""
    timed = [row for row in rows if row["suite"] == suite and _finite(row["median_s"])]
    if suite == "dem":
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


def embedded(chart: PointChart) -> dict[str, Any]:
    """Title, text alternative, image as a data address and legend of a chart, for pages that are one file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "chart.svg"
        draw_points(chart, path)
        # As an image, not as part of the page: the classes of one figure would restyle the next.
        data = base64.b64encode(path.read_bytes()).decode("ascii")
    return {
        "title": chart.title,
        "alt": chart.alt(),
        "source": f"data:image/svg+xml;base64,{data}",
        "looks": chart.looks,
    }


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


Point = tuple[float, float, str]

FAMILIES = ("settled", "flowing")
"""Problems that come in several sizes, by the first part of their names."""
ACCURACY = "accuracy-"
SHORT = "-short"


def dem_charts(rows: Sequence[Row]) -> list[PointChart]:
    """Charts of the timed rows of the suite; those for which there is nothing to draw are left out."""
    accuracy = dict.fromkeys(row["problem"] for row in rows if row["problem"].startswith(ACCURACY))
    charts = [
        *(_scaling(rows, family) for family in FAMILIES),
        _threads(rows),
        _memory(rows),
        *(_accuracy_charts(problem, [row for row in rows if row["problem"] == problem]) for problem in accuracy),
        roofline_chart(estimates(rows)),
    ]
    return [chart for chart in charts if chart is not None]


def _scaling(rows: Sequence[Row], family: str) -> PointChart | None:
    dots = _lines(_by_size(rows, family), _engine_and_threads, lambda row: (row["disks"], row["rate"], row["problem"]))
    return PointChart(f"{family}: rate over size", "disks", "particle-steps / s", dots) if dots else None


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
    return PointChart(title, "threads", "particle-steps / s", dots, guides, limits=limits, labels_along=True)


def _memory(rows: Sequence[Row]) -> PointChart | None:
    """Arrays of a run of ours, growth of the resident memory of others."""
    dots = _lines(
        [row for row in _by_size(rows, FAMILIES[0]) if row["threads"] == 1 and _bytes(row) > 0.0],
        lambda row: f"{row['engine']} ({'arrays' if as_float(row['bytes_per_disk']) > 0.0 else 'resident'})",
        lambda row: (row["disks"], _bytes(row), row["problem"]),
    )
    return PointChart("settled: memory over size", "disks", "bytes / disk", dots) if dots else None


def _accuracy_charts(problem: str, rows: Sequence[Row]) -> PointChart:
    """Lines lead from coarse to fine steps."""
    dots = _lines(
        sorted(rows, key=lambda row: int(row["steps"])),
        lambda row: row["engine"],
        lambda row: (row["median_s"], row["check_value"], f"{row['steps']} steps"),
    )
    title = f"{problem.removeprefix(ACCURACY)}: error against cost"
    return PointChart(title, "time [s]", "error / largest force", dots, decades=True)


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


NEEDED = (
    "flops", "traffic", "working_set", "low_s", "bandwidth", "bandwidth_cached", "bandwidth_memory", "flop_rate",
    "flop_rate_single", "root_rate",
)  # fmt: skip
BINDS = 0.7
"""Of a roof: from there on it is said to bind, as it leaves less than a third of the time to everything else."""
GIGA = 1e9


@dataclass(frozen=True)
class Estimate:
    """One problem under its roofs; rates are those of its fastest repeat, as roofs are what probes reach at best.

    Attributes
    ----------
    problem : str
    flops, traffic : float
        Operations on floats and bytes of a particle-step.
    rate : float
        Particle-steps per second.
    of_bandwidth, of_vectors, of_single : float
        Parts of the bandwidth for this working set, and of the rates of multiply-adds on vectors and one by one.
    of_roots : float
        Part of the time that one root and one division for each listed pair, those with walls among them, take alone.
    row : mapping
        Where all this comes from.
    """

    problem: str
    flops: float
    traffic: float
    rate: float
    of_bandwidth: float
    of_vectors: float
    of_single: float
    of_roots: float
    row: Row

    @property
    def intensity(self) -> float:
        """Operations per byte."""
        return self.flops / self.traffic

    @property
    def bound(self) -> str:
        """What binds, in words: of arithmetic the roof of vectors, in which the kernels take what their loops allow."""
        if self.of_bandwidth >= BINDS:
            return "bandwidth"
        return "arithmetic" if self.of_vectors >= BINDS else "neither"


def estimates(rows: Sequence[Row]) -> list[Estimate]:
    """Estimates of the rows that carry one, smallest problem first."""
    able = [row for row in rows if all(as_float(row.get(name)) > 0.0 for name in NEEDED)]
    return [_estimate(row) for row in sorted(able, key=lambda row: int(row["disks"]))]


def _estimate(row: Row) -> Estimate:
    rate = row["disks"] * row["steps"] / row["low_s"]
    return Estimate(
        problem=row["problem"],
        flops=row["flops"],
        traffic=row["traffic"],
        rate=rate,
        of_bandwidth=rate * row["traffic"] / row["bandwidth"],
        of_vectors=rate * row["flops"] / row["flop_rate"],
        of_single=rate * row["flops"] / row["flop_rate_single"],
        of_roots=rate * row["listed_pairs"] / row["disks"] / row["root_rate"],
        row=row,
    )


def roofline_chart(found: Sequence[Estimate]) -> PointChart | None:
    """Rate of operations over operations per byte: roofs as lines, problems as dots, the roof of each one's working set above it."""
    if not found:
        return None
    looks = engine_looks({each.problem: each.problem for each in found})
    dots = [
        Dots(each.problem, looks[each.problem], (each.intensity,), (each.rate * each.flops / GIGA,), joined=False)
        for each in found
    ]
    # Roofs differ little between the problems of one run: the highest of each is what the machine can do.
    top, single, cached, memory = (
        max(each.row[name] for each in found) / GIGA
        for name in ("flop_rate", "flop_rate_single", "bandwidth_cached", "bandwidth_memory")
    )
    middle = [each.intensity for each in found]
    left = min(min(middle), single / cached) / 4.0
    right = 4.0 * max(*middle, top / memory)
    low = min(*(dot.y[0] for dot in dots), left * memory) / 2.0
    roofs = [
        (f"L2 cache {cached:.3g} GB/s", (left, top / cached), (left * cached, top)),
        (f"memory {memory:.3g} GB/s", (left, top / memory), (left * memory, top)),
        (f"multiply-adds, vectors: {top:.3g} Gflop/s", (top / cached, right), (top, top)),
        (f"one by one: {single:.3g} Gflop/s", (single / cached, right), (single, single)),
    ]
    own = [
        ("", (each.intensity,) * 2, (dot.y[0], min(top, each.intensity * each.row["bandwidth"] / GIGA)))
        for each, dot in zip(found, dots, strict=True)
    ]
    return PointChart(
        "roofline: the DEM's step, one thread",
        "operations per byte",
        "Gflop/s",
        tuple(dots),
        guides=(*roofs, *own),
        limits=((left, right), (low, 2.0 * top)),
        labels_along=True,
        decades=True,
    )
