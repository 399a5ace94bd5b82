"""What to change in an engine for an accuracy: from its own settings on, the step halved and its knobs turned, errors and times measured.

`Search` measures settings of one engine on one variant of a case; `cheapest` chooses among them, on plain numbers. The search takes the
engine's own knobs, those that cost no time at their best, and all at their best, each with fewer and fewer steps; of what reaches the
target it puts knob after knob back to the engine's own value, as long as the target is kept.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from ninedisk.core.errors import CoreError
from ninedisk.harness.api.case import Case, ParameterError
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.api.knobs import AtOwnSettings, Knob
from ninedisk.harness.api.registry import STOCK_ENGINES, get_engine
from ninedisk.harness.results.schema import STOCK
from ninedisk.harness.results.tables import CaseResult
from ninedisk.harness.run.plan import Cell, plan_case
from ninedisk.harness.run.runner import run_cell

Progress = Callable[[int, int, str], None]

FEWEST_HALVINGS, MOST_HALVINGS = 1, 10

TIE = 1.5
"""Times that differ by less are equal: that much those of single runs vary on a busy machine."""

SLACK = 1.005
"""What is shown as 1 % counts as 1 %, as on the pages: a scheme of first order is off by the next order."""

SAMPLED = 3
"""Halvings up to which samples are as close as steps: a peak between two is then missed by a sixty-fourth of what the own step misses."""

REPEATS = 3
"""Runs of an answer and of the engine's own settings in turn, whose least time counts."""

CLOSE = 1.05
"""Errors that differ by less are equal."""

BETTER = 0.9
"""Error over the one before from which on a change of one knob is kept."""

ROUNDS = 3
"""Changes of single knobs that the search tries in turn where no other way reaches the target."""


@dataclass(frozen=True)
class Setting:
    """An engine's own step halved ``halvings`` times, and the knobs that differ from the engine's own value, by name."""

    halvings: int = 0
    changed: tuple[tuple[str, Any], ...] = ()


@dataclass(frozen=True, kw_only=True)
class Point:
    """A measured setting.

    Parameters
    ----------
    setting : Setting
    step : float
        Step of the engine [s].
    errors : mapping from str to float
        Relative error of each headline that has a number.
    error : float
        The largest; NaN where one has no number that has one at the engine's own settings.
    seconds : float
        Time of stepping per simulated second.
    reason : str
        Why there is no error.
    """

    setting: Setting
    step: float
    errors: Mapping[str, float] = field(default_factory=dict)
    error: float = math.nan
    seconds: float = math.nan
    reason: str = ""

    @property
    def row(self) -> dict[str, Any]:
        """As plain data."""
        shown = {"step": self.step, "halvings": self.setting.halvings, "changed": dict(self.setting.changed)}
        return {
            **shown,
            "error": self.error,
            "errors": dict(self.errors),
            "seconds": self.seconds,
            "reason": self.reason,
        }


def keeps(points: Mapping[Setting, Point], setting: Setting, target: float, finest: int) -> bool:
    """Whether a setting is within the target, and not by chance: half the step with the same knobs must not leave it.

    Half a step without a number says nothing; a setting whose half was not measured does not count, but for the finest step.
    """
    point, half = points[setting], points.get(Setting(setting.halvings + 1, setting.changed))
    if not point.error <= SLACK * target:
        return False
    if half is None:
        return setting.halvings >= finest
    return not half.error > SLACK * target


def cheapest(points: Mapping[Setting, Point], target: float, finest: int) -> Point | None:
    """The setting within the target that takes the least time; None: none reaches it.

    A setting does not count beside one that makes only some of its changes, with no shorter step: that is the simpler one, whatever the
    clock says of a single run. Of equal times the fewest changes count.

    Examples
    --------
    >>> own, half = Setting(), Setting(1)
    >>> points = {own: Point(setting=own, step=0.02, error=0.03, seconds=1.0),
    ...           half: Point(setting=half, step=0.01, error=0.008, seconds=2.0)}
    >>> cheapest(points, 0.01, 1).step, cheapest(points, 0.001, 1)
    (0.01, None)
    """
    found = [point for setting, point in points.items() if keeps(points, setting, target, finest)]
    found = [point for point in found if not any(_simpler(other.setting, point.setting) for other in found)]
    least = min((point.seconds for point in found if not math.isnan(point.seconds)), default=math.nan)
    return min(found, key=lambda point: (not point.seconds <= TIE * least, *_changes(point)), default=None)


def _simpler(one: Setting, other: Setting) -> bool:
    return one != other and one.halvings <= other.halvings and set(one.changed) <= set(other.changed)


def _changes(point: Point) -> tuple[float, ...]:
    setting = point.setting
    return len(setting.changed) + (setting.halvings > 0), setting.halvings, point.error, point.seconds


class Search:
    """Measures settings of an engine on one variant of a case.

    Parameters
    ----------
    engine : AtOwnSettings
    cell_of : callable
        The cell of a number of halvings and options.
    steps : sequence of float
        Step of the engine for each number of halvings [s].
    headline : str
        The headline that counts; "": the worst of all.
    notify : callable
        Called with the number of settings so far and the one that is measured next.
    """

    def __init__(
        self,
        engine: AtOwnSettings,
        cell_of: Callable[[int, Mapping[str, Any]], Cell],
        steps: Sequence[float],
        headline: str = "",
        notify: Callable[[int, str], None] = lambda _done, _name: None,
    ) -> None:
        self.engine, self.cell_of, self.steps, self.headline, self.notify = engine, cell_of, steps, headline, notify
        self.knobs: Mapping[str, Knob] = engine.knobs
        self.finest = len(steps) - 1
        self.points: dict[Setting, Point] = {}
        self.rows: dict[str, Mapping[str, Any]] = {}
        self.needed: frozenset[str] = frozenset()

    def measure(self, halvings: int, knobs: Mapping[str, Any]) -> Point:
        """The point of a setting; each is run once."""
        changed = tuple(
            (name, knobs[name]) for name, knob in self.knobs.items() if knobs.get(name, knob.default) != knob.default
        )
        setting = Setting(halvings, changed)
        if setting not in self.points:
            step = self.steps[halvings]
            self.notify(len(self.points), words(step, dict(changed)))
            self.points[setting] = self.point(setting, step, self.run(setting))
        return self.points[setting]

    def point(self, setting: Setting, step: float, result: CaseResult) -> Point:
        """A run's errors and time."""
        if result.setup is None or result.observed is None:
            return Point(setting=setting, step=step, reason=f"{result.cell['status']}: {result.cell['reason']}")
        rows = {row["headline"]: row for row in result.headlines if self.headline in ("", row["headline"])}
        errors = {name: float(row["rel_error"]) for name, row in rows.items() if not math.isnan(row["rel_error"])}
        if not self.needed:
            self.needed, self.rows = frozenset(errors), {name: rows[name] for name in errors}
        lacking = [name for name in self.needed if name not in errors]
        reason = f"no number of: {', '.join(sorted(lacking))}" if lacking or not errors else ""
        return Point(
            setting=setting,
            step=step,
            errors=errors,
            error=math.nan if reason else max(errors.values()),
            seconds=_seconds(result),
            reason=reason,
        )

    def run(self, setting: Setting) -> CaseResult:
        """Run a setting."""
        options = {f"{self.engine.id}.{name}": value for name, value in setting.changed}
        return run_cell(self.cell_of(setting.halvings, options))

    def time_again(self, *settings: Setting) -> None:
        """Run measured settings in turn; of each the least time counts."""
        for setting in settings * REPEATS:
            point = self.points[setting]
            self.points[setting] = replace(point, seconds=min(_seconds(self.run(setting)), point.seconds))

    def search(self, target: float) -> Point | None:
        """Measure what may reach the target; the `cheapest` of all that does."""
        best = {name: knob.ladder[-1] for name, knob in self.knobs.items()}
        free = {name: value for name, value in best.items() if not self.knobs[name].dear}
        reached = [self._put_back(knobs, target) for knobs in ({}, free, best)]
        if not any(reached):
            self._put_back(self._by_turns(target), target)
        return cheapest(self.points, target, self.finest)

    def _keeps(self, halvings: int, knobs: Mapping[str, Any], target: float) -> bool:
        point = self.measure(halvings, knobs)
        if point.error <= SLACK * target and halvings < self.finest:
            self.measure(halvings + 1, knobs)
        return keeps(self.points, point.setting, target, self.finest)

    def _put_back(self, knobs: Mapping[str, Any], target: float) -> bool:
        """Put knobs back to the engine's own values at the longest step that reaches the target; whether one does."""
        halvings = next((k for k in range(self.finest + 1) if self._keeps(k, knobs, target)), None)
        if halvings is None:
            return False
        kept = dict(knobs)
        for name in sorted(kept, key=lambda name: not self.knobs[name].dear):
            values = self.knobs[name].values
            for value in values[: values.index(kept[name])]:
                if self._keeps(halvings, {**kept, name: value}, target):
                    kept[name] = value
                    break
        while halvings > 0 and self._keeps(
            halvings - 1, kept, target
        ):  # what was put back may have spoilt longer steps
            halvings -= 1
        return True

    def _by_turns(self, target: float) -> dict[str, Any]:
        """Knobs changed one by one at the shortest step, each time the one that helps most."""
        now = min(
            (point for setting, point in self.points.items() if setting.halvings == self.finest),
            key=lambda point: (math.isnan(point.error), point.error),
        )
        for _ in range(ROUNDS):
            knobs = dict(now.setting.changed)
            tried = [
                self.measure(self.finest, {**knobs, name: value})
                for name, knob in self.knobs.items()
                for value in knob.values
            ]
            best = min(tried, key=lambda point: (math.isnan(point.error), point.error), default=now)
            if not (best.error < BETTER * now.error or (math.isnan(now.error) and best.error >= 0.0)):
                break
            now = best
            if now.error <= SLACK * target:
                break
        return dict(now.setting.changed)


def words(step: float, changed: Mapping[str, Any]) -> str:
    """A setting in words."""
    return ", ".join([f"step = {step:.4g} s", *(f"{name} = {shown(value)}" for name, value in changed.items())])


def shown(value: Any) -> str:
    """A knob's value."""
    return f"{value:g}" if isinstance(value, float) else str(value)


def stock_engine(engine_id: str) -> AtOwnSettings:
    """The engine at its own settings, by its id or that of the tuned one.

    Raises
    ------
    UsageError
        If the engine has none here; the message names those that have.
    """
    get_engine(engine_id)
    found = engine_id if engine_id.endswith(STOCK) else f"{engine_id}{STOCK}"
    if found not in STOCK_ENGINES:
        has = ", ".join(sorted(name.removesuffix(STOCK) for name in STOCK_ENGINES))
        raise UsageError(
            f"{engine_id} has no stock settings here, from which changes could start; engines that have: {has}"
        )
    engine: Any = get_engine(found)
    own: AtOwnSettings = engine
    return own


STUDY: tuple[tuple[str, Mapping[str, Any], str], ...] = (
    ("incline-block", {}, "distance down the incline"),
    ("impact/bouncing-disk", {}, "height of the first bounce"),
    ("box/incline", {}, "distance of a box down the incline"),
    ("slip-to-roll", {}, "distance"),
    ("static/stack", {}, "contact forces at rest"),
)
"""Case, parameters and headline of what ``ninedisk tune --all`` measures: short scenes, one at least for each use that has one."""


def tune(
    case: Case | str,
    *,
    engine: str,
    params: Mapping[str, Any] | None = None,
    targets: Sequence[float] = (0.01,),
    headline: str = "",
    halvings: int = 6,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Measure what to change in an engine for an accuracy.

    Parameters
    ----------
    case, params
        As `ninedisk.harness.run.runner.run_case` takes them. The case's step ``dt`` is the engine's own one, unless ``params`` sets it
        or the case does not take that.
    engine : str
        Engine with stock settings, ``"mujoco"``.
    targets : sequence of float
        Relative errors of the headline, in (0, 1).
    headline : str
        The headline that counts, as `ninedisk.harness.cases` names it; "": the worst of all.
    halvings : int
        How often the engine's own step is halved at most, 1..10.
    progress : callable, optional
        Called with (settings measured, an estimate of all, setting that is measured next).

    Returns
    -------
    dict
        ``case, variant, headline, engine, engine_name, engine_version, headlines``; ``own_step`` [s], ``own_step_from`` and
        ``first_step``, the longest that the case takes; ``halvings``; ``knobs``; ``points`` (`Point.row`), the engine's own
        settings first; ``tuned``, the adapter's settings in the same columns; ``answers``: for each target ``target, reached``,
        the columns of the cheapest point, or else of the closest, and ``times``, its time over that of the engine's own settings.

    Raises
    ------
    UsageError, ParameterError, CoreError
        Unknown names, values out of range, an engine that is not installed or cannot express the scene.
    """
    _check_numbers(targets, halvings)
    stock, given = stock_engine(engine), dict(params or {})
    info = stock.info()
    if not info.installed:
        raise UsageError(f"{stock.of} is not installed; install it with: {info.install}")
    cells, steps = _levels(case, stock, given, halvings)
    cell = cells(0, {})
    expected = len(steps) * 3 + 2 * sum(len(knob.ladder) for knob in stock.knobs.values())

    def notify(done: int, name: str) -> None:
        if progress is not None:
            progress(done, max(done + 1, expected), f"{cell.case.id} on {stock.id}: {name}")

    search = Search(stock, cells, steps, headline, notify)
    first = search.run(Setting())
    tuned = run_cell(plan_case(case, stock.of, given))
    names = list(dict.fromkeys(row["headline"] for row in (*first.headlines, *tuned.headlines)))
    if headline and names and headline not in names:
        raise UsageError(
            f"{headline!r} is no headline of {cell.case.id} [{cell.variant.id}]: use one of {', '.join(map(repr, names))}"
        )
    search.points[Setting()] = search.point(Setting(), steps[0], first)
    ended = search.point(Setting(), math.nan, tuned)
    if not search.needed:
        raise UsageError(
            f"{cell.case.id} has no headline error on {stock.of}: {search.points[Setting()].reason}; tuned: {ended.reason}"
        )
    answers = [_answer(search, target) for target in targets]
    return {
        "case": cell.case.id,
        "variant": plan_case(case, stock.of, given).variant.id,
        "headline": headline,
        "engine": stock.of,
        "engine_name": get_engine(stock.of).info().name,
        "engine_version": info.version or "",
        "headlines": [
            {"name": name, "use": row["use"], "scale_is": row["scale_is"]} for name, row in search.rows.items()
        ],
        "own_step": stock.step,
        "own_step_from": stock.step_from,
        "first_step": steps[0],
        "halvings": halvings,
        "knobs": [
            {"name": name, "values": list(knob.values), "dear": knob.dear, "why": knob.why}
            for name, knob in stock.knobs.items()
        ],
        "points": [point.row for point in search.points.values()],
        "tuned": ended.row,
        "answers": answers,
    }


def _check_numbers(targets: Sequence[float], halvings: int) -> None:
    if not FEWEST_HALVINGS <= halvings <= MOST_HALVINGS:
        raise UsageError(f"halvings = {halvings} is not allowed: use {FEWEST_HALVINGS} to {MOST_HALVINGS}")
    for target in targets:
        if not 0.0 < target < 1.0:
            raise UsageError(f"target = {target:g} is not allowed: use a relative error between 0 and 1; 0.01 is 1 %")


def _answer(search: Search, target: float) -> dict[str, Any]:
    """The cheapest setting within a target, or else the closest one, with its time over that of the engine's own settings."""
    own = search.measure(0, {})
    refused = own.reason.startswith("unsupported")  # no knob makes a scene one that the engine can express
    found = None if refused else search.search(target)
    closest = found or _closest(search.points.values())
    if not own.reason:
        search.time_again(own.setting, closest.setting)
    own, closest = search.points[own.setting], search.points[closest.setting]
    times = closest.seconds / own.seconds if own.seconds > 0.0 else math.nan
    return {"target": target, "reached": found is not None, **closest.row, "times": times}


def _closest(points: Collection[Point]) -> Point:
    """Of the least errors, equal to a few per cent, the one with the fewest changes."""
    least = min((point.error for point in points if point.error >= 0.0), default=math.nan)
    return min(points, key=lambda point: (not point.error <= CLOSE * least, *_changes(point)))


def _seconds(result: CaseResult) -> float:
    """Time of stepping per simulated second: that of the processor, where the engine reports it."""
    if result.setup is None:
        return math.nan
    numerics, cell = result.setup.numerics, result.cell
    spent = cell["cpu_s"] if cell["cpu_of"] == "stepping" else cell["advance_s"]
    return float(spent) / (numerics.n_steps * numerics.dt)


def _levels(
    case: Case | str, stock: AtOwnSettings, given: Mapping[str, Any], halvings: int
) -> tuple[Callable[[int, Mapping[str, Any]], Cell], list[float]]:
    """Cells by halvings and options, and their steps: the case's own ``dt`` where it takes the engine's step, or steps within it."""
    plain = plan_case(case, stock.id, given)
    if isinstance(plain.setup, Exception):
        raise plain.setup
    known = {parameter.name for parameter in plain.case.parameters}
    numerics = plain.setup.numerics

    def by_dt(level: int, options: Mapping[str, Any]) -> Cell:
        sampled = stock.step / 2 ** min(level, SAMPLED)
        return plan_case(
            case, stock.id, {**given, "dt": sampled}, {**options, f"{stock.id}.step": stock.step / 2**level}
        )

    if "dt" in known and "dt" not in given and "steps" not in known and _takes(by_dt, halvings):
        return by_dt, [stock.step / 2**level for level in range(halvings + 1)]
    first = numerics.dt / max(1, math.ceil(numerics.dt / stock.step * (1.0 - 1e-12)))

    def within(level: int, options: Mapping[str, Any]) -> Cell:
        return plan_case(case, stock.id, given, {**options, f"{stock.id}.step": first / 2**level})

    return within, [first / 2**level for level in range(halvings + 1)]


def _takes(cell_of: Callable[[int, Mapping[str, Any]], Cell], halvings: int) -> bool:
    """Whether a case can be built with the longest and with the shortest step."""
    try:
        return not any(isinstance(cell_of(level, {}).setup, Exception) for level in (0, halvings))
    except (CoreError, ParameterError):
        return False
