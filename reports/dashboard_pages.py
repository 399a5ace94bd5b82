"""The dashboard's HTML: what each kind of page shows."""

from __future__ import annotations

from collections import Counter
from typing import Any

from markupsafe import Markup

from ninedisk.harness.results.schema import History, Line, RunFacts
from ninedisk.reports import studies as compare_page
from ninedisk.reports import text
from ninedisk.reports.dashboard_chart import SPARK, chart, value
from ninedisk.reports.dashboard_marks import SEVERITIES, Group, Mark, groups, marks

Place = tuple[str, str]
"""Case and engine."""

SHOWN = 40
"""Groups of marks that the overview lists before the rest is folded."""


class Pages:
    """All pages of one history."""

    def __init__(self, history: History) -> None:
        self._history = history
        self._marks = marks(history)
        self.places: dict[Place, list[Line]] = {}
        for line in history.lines:
            self.places.setdefault((line.case, line.engine), []).append(line)
        self._by_machine: dict[str, list[int]] = {}
        for number, run in enumerate(history.runs):
            self._by_machine.setdefault(run.machine, []).append(number)
        self._columns = {m: {run: k for k, run in enumerate(runs)} for m, runs in self._by_machine.items()}
        self._slug = text.Slugs()
        self._env = compare_page.environment()
        self._env.globals |= {
            "severities": SEVERITIES,
            "file": self.file,
            "anchor": self._anchor,
            "compare_file": self.compare_file,
            "draw": self._draw,
            "spark": self._spark,
            "run_of": self._run_of,
            "n_machines": len(self._by_machine),
            "newest_value": self._newest_value,
        }

    def file(self, place: Place) -> str:
        """Path of the page of a case and engine."""
        return f"lines/{self._slug('--'.join(part or 'every engine' for part in place))}.html"

    def compare_file(self, around: tuple[int, int]) -> str:
        """Path of the comparison of two runs."""
        return f"compare/{self._slug('--'.join(self._history.runs[number].run_id for number in around))}.html"

    def index(self) -> str:
        """The overview."""
        standing = [mark for mark in self._marks if mark.shift.open]
        past = [m for m in self._marks if not m.shift.open and m.shift.verdict == "worse"]
        better = [mark for mark in self._marks if mark.shift.verdict == "better"]
        lines = [line for line in self._history.lines if line.kind != "cell"]
        return self._env.get_template("dashboard.html").render(
            root="",
            standing=groups(standing),
            past=groups(past),
            better=groups(better),
            shown=SHOWN,
            n_lines=len(lines),
            n_timings=sum(line.kind == "timing" for line in lines),
            matrix=self._matrix(standing),
            engines=self._engines(),
            machines={machine: len(runs) for machine, runs in self._by_machine.items()},
            runs=[self._run(number) for number in reversed(range(len(self._history.runs)))],
            newest=self._history.runs[-1],
            rules=self._history.rules,
            ended=[line for line in lines if self._ends(line)],
            whole_runs=[line for line in self._history.lines if not line.engine],
        )

    def lines(self, place: Place) -> str:
        """The page of a case and engine: every line, those with marks first."""
        held = self.places[place]
        found = [mark for mark in self._marks if (mark.line.case, mark.line.engine) == place]
        by_machine: dict[tuple[str, int], list[Line]] = {}
        for line in sorted(
            held, key=lambda line: (not line.shifts, line.kind == "timing", line.variant, line.quantity)
        ):
            by_machine.setdefault((line.machine, line.case_version), []).append(line)
        return self._env.get_template("dashboard_lines.html").render(
            root="../",
            place=place,
            engine_name=held[0].engine_name,
            groups=groups(found),
            by_machine=by_machine,
            versions={version for _, version in by_machine},
            runs=[self._run(number) for number in range(len(self._history.runs))],
            rules=self._history.rules,
        )

    def compare(self, around: tuple[int, int]) -> str:
        """The comparison of the two runs around a mark."""
        values = compare_page.values(self._history.comparisons[around]) | {"root": "../"}
        return self._env.get_template("compare.html").render(**values)

    def _engines(self) -> dict[str, str]:
        return {line.engine: line.engine_name for line in self._history.lines if line.engine}

    def _matrix(self, standing: list[Mark]) -> list[tuple[str, list[dict[str, Any] | None]]]:
        """Rows of cases, worst first; for each engine the worst standing severity with the counts of all."""
        order = {severity: k for k, severity in enumerate(SEVERITIES)}
        found: dict[Place, Counter[str]] = {}
        for mark in standing:
            found.setdefault((mark.line.case, mark.line.engine), Counter())[mark.severity] += 1
        rows = []
        for case in dict.fromkeys(line.case for line in self._history.lines if line.engine):
            squares: list[dict[str, Any] | None] = []
            for engine in self._engines():
                held = self.places.get((case, engine))
                counts = found.get((case, engine), Counter())
                worst = min(counts, key=order.__getitem__, default=None)
                squares.append(None if held is None else {"place": (case, engine), "worst": worst, "counts": counts,
                                                          "lines": sum(line.kind != "cell" for line in held)})  # fmt: skip
            rank = min((order[s["worst"]] for s in squares if s and s["worst"]), default=len(order))
            rows.append((rank, case, squares))
        rows.sort(key=lambda row: (row[0], row[1]))
        return [(case, squares) for _, case, squares in rows]

    def _run(self, number: int) -> dict[str, Any]:
        """Facts of a run, with the versions that changed since the one before on the same machine."""
        facts = self._history.runs[number]
        before = [k for k in self._by_machine[facts.machine] if k < number]
        changed = _changed(self._history.runs[before[-1]], facts) if before else ["first run on this machine"]
        return {"id": facts.run_id, "date": facts.started[:16].replace("T", " "), "commit": facts.commit[:12],
                "machine": facts.machine, "changed": changed, "ninedisk": facts.versions.get("ninedisk", "")}  # fmt: skip

    def _ends(self, line: Line) -> bool:
        """Whether the newest run of the line's machine has nothing of it."""
        return line.points[-1].run != self._by_machine[line.machine][-1]

    def _newest_value(self, line: Line) -> str:
        point = line.points[-1]
        when = f"last seen {self._run(point.run)['date'][:10]}" if self._ends(line) else "now"
        return f"{when}: {value(line, point)}"

    def _run_of(self, group: Group) -> dict[str, Any]:
        return self._run(group.since)

    def _anchor(self, line: Line) -> str:
        parts = (line.kind, str(line.case_version), line.variant, line.quantity, line.truth, line.machine)
        return self._slug("/".join(("anchor", line.case, line.engine, *parts)))

    def _draw(self, line: Line) -> Markup:
        runs = self._by_machine[line.machine]
        dates = [self._history.runs[number].started[:10] for number in (runs[0], runs[-1])]
        return chart(line, self._columns[line.machine], dates)

    def _spark(self, group: Group) -> Markup:
        line = group.worst.line
        return chart(line, self._columns[line.machine], ("", ""), SPARK)


def _changed(before: RunFacts, after: RunFacts) -> list[str]:
    names = sorted({*before.versions, *after.versions})
    old, new = before.versions, after.versions
    return [
        f"{name} {old.get(name, text.NOTHING)} → {new.get(name, text.NOTHING)}"
        for name in names
        if old.get(name) != new.get(name)
    ]
