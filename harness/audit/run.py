"""An audit: frames become states, checks judge them, and a record of plain data says what was found and why."""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.core.scene.motion import wall_poses
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.audit.checks import TITLES, Auditor, Bodies, State, Tally
from ninedisk.harness.audit.read import Frame, Rounding, Trajectory, read_trajectory
from ninedisk.harness.audit.scene import LARGEST, AuditScene, Fact

FORMAT = 1
VIOLATED, HOLDS, UNDECIDED = "violated", "holds", "not decidable"
POINTS = 1500
"""Instants of a curve that a record keeps; of more, the worst of each stretch."""
SHOWN = 3000
"""Disks that a picture of a violation has at most: those nearest to it."""


def audit(path: Path, scene: AuditScene, progress: Callable[[int, int, str], None]) -> dict[str, Any]:
    """Hold physics against a trajectory.

    Parameters
    ----------
    path : Path
        Any format of `ninedisk.harness.audit.read`.
    scene : AuditScene
    progress : function
        Called with what is done, the total and words.

    Returns
    -------
    dict
        Plain data: ``checks`` (worst first), ``totals``, ``pictures`` and what they were made of.

    Raises
    ------
    UsageError
        Naming file, line, column, what is allowed and the way out.
    """
    trajectory = read_trajectory(path, scene.columns)
    states = _States(trajectory, scene)
    auditor: Auditor | None = None
    kept: list[State] = []
    with np.errstate(over="ignore", invalid="ignore"):
        for state in _guarded_states(trajectory.path, states.all(progress)):
            if auditor is None:
                assert states.bodies is not None
                auditor = Auditor(
                    scene,
                    states.bodies,
                    has_velocity=states.has_velocity,
                    digits={name: rule.description() for name, rule in trajectory.rounding.items()},
                )
            auditor.feed(state)
            if scene.reverse is not None:
                kept.append(state)
        if auditor is None or auditor.frames < 2:
            needed = "two or more" if states.has_velocity else "three or more where it has no vx, vy"
            raise UsageError(f"{path} has too few frames: an audit compares frames, give {needed}")
        auditor.finish()
    tallies = auditor.tallies | states.tallies
    tallies["cone"] = _cone(scene, progress)
    tallies["reversal"] = _reversal(scene, auditor, kept, progress)
    found: dict[str, Any] = _json_value(_record(path, trajectory, scene, auditor, tallies))
    return found


def _guarded_states(path: Path, states: Iterator[State]) -> Iterator[State]:
    """The same states; a file that breaks off within is the user's to mend."""
    try:
        yield from states
    except (EOFError, OSError, zlib.error) as error:
        raise UsageError(f"{path} cannot be read to its end ({error}): copy or write it anew") from error


class _States:
    """Aligns frames with the ids of the first, and notes what is wrong with ids, times and numbers on the way."""

    def __init__(self, trajectory: Trajectory, scene: AuditScene) -> None:
        self.trajectory, self.scene = trajectory, scene
        self.tallies = {name: Tally(name) for name in ("finite", "particles", "time")}
        self.bodies: Bodies | None = None
        self.has_velocity = True
        self._before: float | None = None
        self._missing: NDArray[np.bool_] | None = None

    def all(self, progress: Callable[[int, int, str], None]) -> Iterator[State]:
        """States in the order of the file; where it has no velocities, with central differences."""
        made = (self._state(number, frame) for number, frame in enumerate(self.trajectory.frames(progress)))
        first = next(made, None)
        if first is None:
            return
        if self.has_velocity:
            yield first
            yield from made
            return
        window = [first]
        for state in made:
            window.append(state)
            if len(window) == 3:
                if window[0] is first:
                    yield _difference_velocities(window[0], window[1], window[0], self.scene.gravity, one_sided=True)
                yield _difference_velocities(window[0], window[2], window[1], self.scene.gravity)
                del window[0]
        if len(window) == 2:
            yield _difference_velocities(window[0], window[1], window[1], self.scene.gravity, one_sided=True)

    def _state(self, number: int, frame: Frame) -> State:
        columns = frame.columns
        ids = columns.get("id")
        n = len(columns["x"])
        if n == 0:
            raise UsageError(f"{self.trajectory.path}, {frame.place}: a frame without disks")
        here = np.arange(n) if ids is None else np.nan_to_num(ids, nan=-1.0).astype(np.int64)
        if self.bodies is None:
            self.bodies = _bodies(self.trajectory.path, self.scene, here, columns)
            self.has_velocity = "vx" in columns and "vy" in columns
        bodies = self.bodies
        unique, first = np.unique(here, return_index=True)
        place = np.searchsorted(bodies.id, unique)
        known = (place < len(bodies.id)) & (bodies.id[np.minimum(place, len(bodies.id) - 1)] == unique)
        rows, place = first[known], place[known]
        present = np.zeros(len(bodies.id), dtype=bool)
        present[place] = True

        def column(name: str) -> FloatArray | None:
            if name not in columns:
                return None
            found = np.full(len(bodies.id), np.nan)
            found[place] = columns[name][rows]
            return found

        def rounding(name: str, values: FloatArray | None) -> FloatArray:
            rule = self.trajectory.rounding.get(name, Rounding())
            if values is None:
                return np.zeros(len(bodies.id))
            found = rule.error(np.nan_to_num(values))
            return np.maximum(found, np.ldexp(np.abs(np.nan_to_num(values)), -24)) if self.scene.single else found

        x, y, vx, vy, omega, angle = (column(name) for name in ("x", "y", "vx", "vy", "omega", "angle"))
        assert x is not None
        assert y is not None
        t, et = self._time(number, frame)
        velocity = np.column_stack([np.zeros(len(x)) if each is None else each for each in (vx, vy)])
        state = State(
            step=frame.step, t=t, et=et, place=frame.place, x=np.column_stack([x, y]), v=velocity, omega=omega, angle=angle,
            ex=np.hypot(rounding("x", x), rounding("y", y)), ev=np.hypot(rounding("vx", vx), rounding("vy", vy)),
            eo=rounding("omega", omega), ea=rounding("angle", angle), here=present.copy(),
        )  # fmt: skip
        self._numbers(state, columns, present)
        self._check_ids(state, len(here) - len(unique), int((~known).sum()), present, here)
        self._check_times(state)
        return state

    def _time(self, number: int, frame: Frame) -> tuple[float, float]:
        scene, clock = self.scene, self.trajectory.clock
        if clock == "t":
            rule = self.trajectory.rounding.get("t", Rounding())
            return frame.t, float(rule.error(np.array([frame.t]))[0]) if np.isfinite(frame.t) else 0.0
        if clock == "index" and scene.interval is not None:
            return number * scene.interval, 0.0
        if scene.dt is None:
            way = "[time] dt = SECONDS, the engine's step" + (
                ", or interval = SECONDS between frames" if clock == "index" else ""
            )
            raise UsageError(f"{self.trajectory.path} has steps and no times: give them in the TOML by {way}")
        return frame.step * scene.dt, 0.0

    def _numbers(self, state: State, columns: Mapping[str, FloatArray], present: NDArray[np.bool_]) -> None:
        bad = {name: int((~(np.abs(column) < LARGEST)).sum()) for name, column in columns.items()}
        arrays = [state.x[:, 0], state.x[:, 1], state.v[:, 0], state.v[:, 1]]
        arrays += [each for each in (state.omega, state.angle) if each is not None]
        wrong = present & ~(np.abs(arrays) < LARGEST).all(axis=0)
        given = ", ".join(f"{count} in {name}" for name, count in bad.items() if count)
        self.tallies["finite"].judge(
            state,
            np.array([float(sum(bad.values()))]),
            {"none is allowed": np.zeros(1)},
            lambda _: given or "all",
            lambda _: np.flatnonzero(wrong),
        )
        state.here[wrong] = False

    def _check_ids(
        self, state: State, doubled: int, new: int, present: NDArray[np.bool_], here: NDArray[np.int64]
    ) -> None:
        assert self.bodies is not None
        before = np.ones(len(present), dtype=bool) if self._missing is None else ~self._missing
        lost = before & ~present
        self._missing = ~present
        twice = (
            [str(each) for each, count in zip(*np.unique(here, return_counts=True), strict=True) if count > 1][:5]
            if doubled
            else []
        )
        words = [
            f"lost: {', '.join(str(each) for each in self.bodies.id[lost][:8])}" if lost.any() else "",
            f"doubled: {', '.join(twice)}" if doubled else "",
            f"new: {', '.join(map(str, np.setdiff1d(here, self.bodies.id)[:8]))}" if new else "",
        ]
        wrong = (0 if self.scene.open else int(lost.sum())) + doubled + new
        self.tallies["particles"].judge(
            state, np.array([float(wrong)]), {"none is allowed": np.zeros(1)}, lambda _: "; ".join(filter(None, words)) or "all there",
            lambda _: np.flatnonzero(lost),
        )  # fmt: skip

    def _check_times(self, state: State) -> None:
        if self._before is not None:
            before = self._before
            back = before - state.t if np.isfinite(state.t) else np.inf
            wrong = not back < 0.0
            value = max(back, np.finfo(float).tiny) if wrong else 0.0
            self.tallies["time"].judge(
                state, np.array([value]), {"a frame is later than the one before": np.zeros(1)},
                lambda _: f"t = {state.t:.9g} after {before:.9g}", lambda _: np.empty(0, dtype=np.int64),
            )  # fmt: skip
        self._before = state.t


def _bodies(path: Path, scene: AuditScene, ids: NDArray[np.int64], columns: Mapping[str, FloatArray]) -> Bodies:
    unique, first = np.unique(ids, return_index=True)

    def fact(name: str, given: Fact | None) -> FloatArray | None:
        """What the TOML gives, else the file."""
        if given is None:
            return columns[name][first] if name in columns else None
        if isinstance(given, Mapping):
            if "type" not in columns:
                raise UsageError(
                    f"disks.{name} is given by type, and {path} has no column type: give a number or a list"
                )
            kinds = columns["type"][first].astype(int)
            if missing := sorted(set(kinds.tolist()) - set(given)):
                raise UsageError(f"disks.{name} has nothing for type {missing[0]}: it has {', '.join(map(str, given))}")
            return np.array([given[kind] for kind in kinds])
        array = np.broadcast_to(np.asarray(given, dtype=float), np.shape(given) or (len(unique),))
        if len(array) != len(unique):
            raise UsageError(
                f"disks.{name} has {len(array)} numbers, and {path} begins with {len(unique)} disks: give one for each, ids in order"
            )
        return np.array(array)

    radius = fact("radius", scene.radius)
    if radius is None:
        raise UsageError(
            f"{path} has no column radius: give [disks] radius in the TOML, a number, a list or a table by type"
        )
    density, mass = fact("density", scene.density), fact("mass", scene.mass)
    if density is not None:
        mass = density * np.pi * radius**2
    if mass is None:
        raise UsageError(f"{path} has no column mass: give [disks] mass, or density in kg/m^2, in the TOML")
    for name, values in (("radius", radius), ("mass", mass)):
        if wrong := np.flatnonzero(~(np.isfinite(values) & (values > 0.0))).tolist():
            raise UsageError(
                f"{path}: the {name} of disk {unique[wrong[0]]} is {values[wrong[0]]:g}; it must be > 0 (TOML: [disks] {name})"
            )
    if missing_ids := sorted(set(scene.fixed) - set(unique.tolist())):
        raise UsageError(f"disks.fixed names {missing_ids[0]}, which is no id of the first frame of {path}")
    return Bodies(unique, radius, mass, scene.inertia * mass * radius**2, np.isin(unique, scene.fixed))


def _difference_velocities(
    before: State, after: State, at: State, gravity: FloatArray, *, one_sided: bool = False
) -> State:
    """Velocity by differences: exact in free flight; elsewhere off by at most half of what the velocity changes in their span."""
    span = max(after.t - before.t, 1e-300)
    v = (after.x - before.x) / span
    err = (before.ex + after.ex) / span
    if one_sided:
        v = v + (at.t - 0.5 * (before.t + after.t)) * gravity
        jump = np.full(len(err), np.inf)  # nothing shows what the other side does
    else:
        change = 2.0 * (before.x - at.x) / (at.t - before.t) + 2.0 * (after.x - at.x) / (after.t - at.t)
        jump = 0.5 * np.sqrt(((0.5 * change - gravity * 0.5 * span) ** 2).sum(axis=1))
    ev = np.where(at.here, np.minimum(np.nan_to_num(err + jump), LARGEST), 0.0)
    return State(**(vars(at) | {"v": v, "ev": ev}))


def _cone(scene: AuditScene, progress: Callable[[int, int, str], None]) -> Tally:
    """Every contact force given: it pushes, and its shear part is at most mu times that."""
    tally = Tally("cone")
    if scene.contacts is None:
        tally.skip(1, 'no contact forces are given: [contacts] file = "..." with columns i, j, fn, fs')
        return tally
    file = read_trajectory(scene.contacts, scene.contact_columns, ("fn", "fs"))
    n_walls = len(scene.walls)
    for frame in file.frames(progress):
        columns = frame.columns
        fn, fs = columns["fn"], columns["fs"]
        j = columns.get("j", np.zeros(len(fn)))
        mu = np.full(len(fn), np.nan if scene.mu is None else scene.mu)
        for w in range(n_walls):
            given = scene.wall_mu[w]
            mu[j == -1 - w] = np.nan if given is None else given
        rules = {name: file.rounding.get(name, Rounding()) for name in ("fn", "fs")}
        en, es = rules["fn"].error(np.nan_to_num(fn)), rules["fs"].error(np.nan_to_num(fs))
        known = np.isfinite(mu) & np.isfinite(fn) & np.isfinite(fs)
        i = columns.get("i", np.arange(len(fn), dtype=float))
        t = frame.t if np.isfinite(frame.t) else frame.step * (scene.dt or math.nan)
        none = np.empty(0)
        state = State(
            step=frame.step, t=t, et=0.0, place=frame.place, x=none, v=none, omega=None, angle=None, ex=none, ev=none, eo=none,
            ea=none, here=np.empty(0, dtype=bool),
        )  # fmt: skip
        at = np.flatnonzero(known)

        def who(k: int, i: FloatArray = i, j: FloatArray = j, at: NDArray[np.int64] = at) -> str:
            other = (
                f"wall {scene.walls[int(-1 - j[at[k]])].name!r}" if -n_walls <= j[at[k]] < 0 else f"disk {j[at[k]]:.0f}"
            )
            return f"contact of disk {i[at[k]]:.0f} with {other}"

        pull = np.zeros(len(fn)) if scene.cohesive else np.maximum(-fn, 0.0)
        beyond = np.maximum(np.abs(fs) - np.nan_to_num(mu) * np.maximum(fn, 0.0), 0.0)
        if scene.cohesive:
            tally.skip(len(at), "cohesion carries shear beyond mu fn, by an unknown amount")
            continue
        value = np.maximum(pull, beyond)
        tally.judge(state, value[at], {"digits of fs": es[at], "mu times the digits of fn": (np.nan_to_num(mu) * en + en)[at]}, who,
                    lambda _: np.empty(0, dtype=np.int64))  # fmt: skip
        tally.skip(int((~known).sum()), "mu of the contact is not given")
        if (odd := int((~(np.isfinite(fn) & np.isfinite(fs))).sum())) and scene.mu is not None:
            bad = float(odd)
            tally.judge(state, np.array([bad]), {"none is allowed": np.zeros(1)}, lambda _: "a force that is no number",
                        lambda _: np.empty(0, dtype=np.int64))  # fmt: skip
    return tally


def _reversal(
    scene: AuditScene, auditor: Auditor, kept: list[State], progress: Callable[[int, int, str], None]
) -> Tally:
    """Compare the reversed path with the first one; an error at its start grows in flight, and by 2 v/R of a distance in each contact."""
    tally = Tally("reversal")
    if scene.reverse is None:
        tally.skip(1, 'no reversed run is given: reverse = "FILE", from the end with all velocities and spins reversed')
        return tally
    if not scene.conservative or any(wall.motion for wall in scene.walls):
        tally.skip(
            1, "the run takes or gives energy: only restitution = 1, mu = 0 and walls at rest go back as they came"
        )
        return tally
    back = _States(read_trajectory(scene.reverse, scene.columns), scene)
    forward = {round(state.t - kept[-1].t, 15): state for state in kept}
    span = max(auditor.intervals)
    begin: float | None = None
    times = np.array(sorted(forward))
    far = float(auditor.bodies.radius.min())
    ex = ev = 0.0
    number = 0
    growth = auditor._growth[::-1]
    for state in _guarded_states(scene.reverse, back.all(progress)):
        if begin is None:
            begin = state.t
            if not back.has_velocity or back.bodies is None or not np.array_equal(back.bodies.id, auditor.bodies.id):
                raise UsageError(f"{scene.reverse}: the run back needs vx, vy and the ids of the run there")
        k = int(np.argmin(np.abs(times + (state.t - begin))))
        there = forward[times[k]]
        if abs(times[k] + state.t - begin) > 1e-9 * span:
            tally.skip(1, "an instant that the run there has not")
            continue
        both = state.here & there.here
        ex = max(ex, float((state.ex + there.ex)[both].max(initial=0.0)))
        ev = max(ev, float((state.ev + there.ev)[both].max(initial=0.0)))
        while number < len(kept) - 1 - k if k >= 0 else False:
            h, amplify = growth[number]
            ex += h * ev
            ev += amplify * ex + 4.0 * 2.0**-53 * max(1.0, h / (scene.dt or h)) * float(np.nanmax(np.abs(there.v)))
            ex += 4.0 * 2.0**-53 * max(1.0, h / (scene.dt or h)) * float(np.nanmax(np.abs(there.x)))
            number += 1
        at = np.flatnonzero(both)
        off = np.sqrt(((state.x - there.x) ** 2).sum(axis=1))[at]
        if ex > far:
            tally.skip(1, "contacts have amplified the digits beyond a radius")
            continue
        words = {"digits, grown by flight and contacts": np.full(len(at), ex)}

        def who(k: int, at: NDArray[np.int64] = at) -> str:
            return f"disk {auditor.bodies.id[at[k]]}"

        def members(k: int, at: NDArray[np.int64] = at) -> NDArray[np.int64]:
            return at[k : k + 1]

        tally.judge(state, off, words, who, members)
    return tally


def _record(
    path: Path, trajectory: Trajectory, scene: AuditScene, auditor: Auditor, tallies: Mapping[str, Tally]
) -> dict[str, Any]:  # fmt: skip
    bodies = auditor.bodies
    checks = [_check(tallies[name], auditor) for name in TITLES]
    order = {VIOLATED: 0, HOLDS: 1, UNDECIDED: 2}
    checks.sort(
        key=lambda check: (order[check["verdict"]], -min(check["worst"]["ratio"], 1e300) if check["worst"] else 0.0)
    )
    pictures = {}
    for check in checks:
        state = tallies[check["id"]].scene
        if check["verdict"] == VIOLATED and state is not None and len(state.x) and state.here.any():
            pictures[check["id"]] = _picture(state, check["worst"]["disks"], bodies, auditor)
    totals = _thin([{name: float(np.nan_to_num(value)) for name, value in row.items()} for row in auditor.totals])
    steps = auditor.intervals
    return {
        "format": FORMAT, "file": path.name, "form": trajectory.form, "frames": auditor.frames, "disks": len(bodies.id),
        "t": [auditor.totals[0]["t"], auditor.totals[-1]["t"]], "interval": [min(steps), max(steps)] if steps else [0.0, 0.0],
        "dt": scene.dt, "digits": dict(auditor.digits), "walls": [wall.name for wall in scene.walls],
        "told": {
            "gravity": scene.gravity.tolist(), "mu": scene.mu, "kn": scene.kn, "ks": scene.ks, "restitution": scene.restitution,
            "rigid": scene.rigid, "slop": scene.slop, "damping": scene.damping,
        },
        "checks": checks, "totals": totals, "pictures": pictures,
    }  # fmt: skip


def _json_value(value: Any) -> Any:
    """The same data with None for what is no finite number."""
    if isinstance(value, dict):
        return {name: _json_value(each) for name, each in value.items()}
    if isinstance(value, list):
        return [_json_value(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _thin(rows: list[dict[str, float]]) -> list[dict[str, float]]:
    every = -(-len(rows) // POINTS)
    return rows if every <= 1 else [*rows[::every], *([rows[-1]] if (len(rows) - 1) % every else [])]


def _check(tally: Tally, auditor: Auditor) -> dict[str, Any]:
    title, unit = TITLES[tally.name]
    verdict = VIOLATED if tally.beyond else HOLDS if tally.judged else UNDECIDED
    why_not = [
        f"{why} ({count:,} of {tally.judged + tally.undecided:,})" for why, count in tally.why_not.most_common(3)
    ]
    worst = {} if tally.worst is None else {**tally.worst, "ratio": min(tally.worst["ratio"], 1e300)}
    hint = ""
    if tally.name == "motion" and verdict == VIOLATED:
        hint = auditor.clock_hint()
    if tally.name == "momentum" and verdict == VIOLATED and "walls gave" in worst["who"]:
        hint = "; walls that only push give what lies in the cone of their normals and friction"
    return {
        "id": tally.name, "title": title, "unit": unit, "verdict": verdict, "judged": tally.judged, "undecided": tally.undecided,
        "beyond": tally.beyond, "why_not": why_not, "first": tally.first or {}, "worst": worst,
        "said": _verdict_text(tally, verdict, unit, why_not) + hint,
        "series": _worst_ratio(tally.series),
    }  # fmt: skip


def _worst_ratio(series: list[tuple[float, float, float]]) -> list[list[float]]:
    """Of each stretch the instant with the largest value over its allowance."""
    by_time: dict[float, tuple[float, float, float]] = {}

    def ratio(row: tuple[float, float, float]) -> float:
        return row[1] / row[2] if row[2] > 0.0 else math.inf if row[1] > 0.0 else 0.0

    for row in series:
        if row[0] not in by_time or ratio(row) > ratio(by_time[row[0]]):
            by_time[row[0]] = row
    rows = [row for row in by_time.values() if all(map(math.isfinite, row))]
    every = max(1, -(-len(rows) // POINTS))
    found = [max(rows[k : k + every], key=ratio) for k in range(0, len(rows), every)]
    return [list(row) for row in found]


def _verdict_text(tally: Tally, verdict: str, unit: str, why_not: list[str]) -> str:
    """The verdict in words."""
    if verdict == UNDECIDED:
        return "not decidable: " + ("; ".join(why_not) or "nothing to compare")
    worst = tally.worst
    assert worst is not None
    parts = [f"{why} {size:.2g}" for why, size in worst["parts"].items() if size > 0.0]
    allowed = f"allowance {worst['allowance']:.3g} {unit}".rstrip() + (f" ({'; '.join(parts)})" if parts else "")
    if verdict == VIOLATED:
        first = tally.first
        assert first is not None
        where = f"at step {first['step']}, t = {first['t']:.6g} s ({first['place']})"
        if worst is first or worst["step"] == first["step"]:
            place = where
        else:
            place = f"first {where}, worst at step {worst['step']}, t = {worst['t']:.6g} s"
        size = f"by {worst['value']:.4g} {unit}".rstrip()
        return f"violated {place}, {size}: {worst['who']}; {allowed}" + (
            f"; {tally.beyond:,} times" if tally.beyond > 1 else ""
        )
    rest = f"; beyond that not decidable: {why_not[0]}" if why_not else ""
    if worst["value"] <= 0.0:
        return f"holds, {tally.judged:,} comparisons{rest}"
    return f"holds: at most {worst['value']:.3g} {unit} (step {worst['step']}, {worst['who']}), {allowed}{rest}"


def _picture(state: State, disks: list[int], bodies: Bodies, auditor: Auditor) -> dict[str, Any]:
    """Disks around a violation, those that it is about marked, walls as lines."""
    at = np.flatnonzero(state.here)
    chosen = [each for each in disks if state.here[each]]
    if len(at) > SHOWN and chosen:
        centre = state.x[chosen].mean(axis=0)
        at = at[np.argsort(((state.x[at] - centre) ** 2).sum(axis=1))[:SHOWN]]
    walls = []
    for wall, pose in zip(auditor.scene.walls, wall_poses(auditor.motion, state.t), strict=True):
        walls.append([wall.name, *(float(value) for value in pose[:4])])
    return {
        "x": state.x[at].round(12).tolist(), "radius": bodies.radius[at].tolist(), "id": bodies.id[at].tolist(),
        "marked": bodies.id[chosen].tolist() if len(chosen) < len(bodies.id) else [], "walls": walls, "t": state.t, "step": state.step,
    }  # fmt: skip
