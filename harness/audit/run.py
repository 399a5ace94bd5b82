"""An audit: frames become states, checks judge them, and a record of plain data says what was found and why."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.audit.checks import Auditor
from ninedisk.harness.audit.forces import judge_contacts
from ninedisk.harness.audit.hints import inertia_hint, radius_hints, stiffness_hint
from ninedisk.harness.audit.history import judge_history
from ninedisk.harness.audit.read import dimension_of, in_plane, read_trajectory
from ninedisk.harness.audit.readers.columns import Trajectory
from ninedisk.harness.audit.scene import AuditScene
from ninedisk.harness.audit.states import States
from ninedisk.harness.audit.tally import TITLES, Bodies, State, Tally

FORMAT = 1
VIOLATED, HOLDS, UNDECIDED = "violated", "holds", "not decidable"
BY_WALLS = ("free", "momentum", "spin", "energy", "kept", "motion", "turning")
"""Checks that a wall or body nobody gave may violate."""
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
    if not scene.stated_dimension:
        scene = scene.in_dimension(dimension_of(trajectory))
    trajectory = in_dimension(trajectory, scene)
    states, auditor, kept = _judged(trajectory, scene, progress, even_clock=True)
    if auditor.clock_is_rounded:
        trajectory = in_dimension(read_trajectory(path, scene.columns), scene)
        states, auditor, kept = _judged(trajectory, scene, progress, even_clock=False)
    remarks = {"spin": auditor.settle_arms()} | radius_hints(auditor)
    tallies = auditor.tallies | states.tallies
    for unknown, words in (
        (not scene.walls_known, "walls are not given, and {}: write [[walls]], or walls = [] where there are none"),
        (scene.partial, "bodies are missing (partial = true), and {}"),
    ):
        if unknown:
            tallies |= {
                name: _without(tallies[name], words.replace("{}", "{}" + inertia_hint(auditor, name)))
                for name in BY_WALLS
            }
    tallies["cone"] = judge_contacts(scene, progress)
    tallies["history"] = judge_history(trajectory, scene, progress)
    tallies["reversal"] = _reversal(scene, auditor, kept, progress)
    found: dict[str, Any] = _json_value(_record(path, states, scene, auditor, tallies, remarks))
    return found


def _judged(
    trajectory: Trajectory, scene: AuditScene, progress: Callable[[int, int, str], None], *, even_clock: bool
) -> tuple[States, Auditor, list[State]]:
    """Read all frames and judge them; the states are kept where a reversed run is compared with them."""
    states = States(trajectory, scene)
    auditor: Auditor | None = None
    kept: list[State] = []
    with np.errstate(over="ignore", invalid="ignore"):
        for state in _ahead(states.all(progress)):
            if auditor is None:
                assert states.bodies is not None
                auditor = Auditor(
                    scene,
                    states.bodies,
                    has_velocity=states.has_velocity,
                    digits={name: rule.description() for name, rule in trajectory.rounding.items()},
                    even_clock=even_clock,
                )
            auditor.feed(state)
            if scene.reverse is not None:
                kept.append(state)
        if auditor is None or auditor.frames < 2:
            needed = "two or more" if states.has_velocity else "three or more where it has no vx, vy"
            raise UsageError(f"{trajectory.path} has too few frames: an audit compares frames, give {needed}")
        auditor.finish()
    return states, auditor, kept


def _ahead(states: Iterator[State]) -> Iterator[State]:
    """The same states in the same order; a thread makes the next one while one is judged."""

    def following() -> State | None:
        with np.errstate(over="ignore", invalid="ignore"):
            return next(states, None)

    with ThreadPoolExecutor(1) as pool:
        made = pool.submit(following)
        while (state := made.result()) is not None:
            made = pool.submit(following)
            yield state


def _without(tally: Tally, words: str) -> Tally:
    """What a wall or body that nobody gave may have caused is not decidable; the place shows where one may be."""
    if not tally.beyond:
        return tally
    first = tally.first
    assert first is not None
    found = Tally(tally.name, undecided=tally.undecided, why_not=tally.why_not)
    pushed = f"something pushed {first['who']} at t = {first['t']:.6g} s ({first['place']})"
    found.skip(tally.beyond, words.format(pushed))
    return found


def in_dimension(trajectory: Trajectory, scene: AuditScene) -> Trajectory:
    """The trajectory, held to the scene's dimension."""
    if scene.dimension == 2:
        return in_plane(trajectory)
    if trajectory.names and "z" not in trajectory.names:
        raise UsageError(
            f"{trajectory.path} has no column z, and the TOML is of space: write vectors of two numbers (dimension = 2), or name the "
            'column by [columns] z = "NAME"'
        )
    return trajectory


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
    back = States(in_dimension(read_trajectory(scene.reverse, scene.columns), scene), scene)
    forward = {round(state.t - kept[-1].t, 15): state for state in kept}
    span = max(auditor.intervals)
    begin: float | None = None
    times = np.array(sorted(forward))
    far = float(auditor.bodies.radius.min())
    ex = ev = 0.0
    number = 0
    growth = auditor._growth[::-1]
    for state in back.all(progress):
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
            return f"{auditor.bodies.noun} {auditor.bodies.id[at[k]]}"

        def members(k: int, at: NDArray[np.int64] = at) -> NDArray[np.int64]:
            return at[k : k + 1]

        tally.judge(state, off, words, who, members)
    return tally


def _record(
    path: Path, states: States, scene: AuditScene, auditor: Auditor, tallies: Mapping[str, Tally], remarks: Mapping[str, str]
) -> dict[str, Any]:  # fmt: skip
    bodies, trajectory = auditor.bodies, states.trajectory
    checks = [_check(tallies[name], auditor, remarks.get(name, "")) for name in TITLES]
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
        "t": _span([row["t"] for row in auditor.totals]), "interval": [min(steps), max(steps)] if steps else [0.0, 0.0],
        "dt": scene.dt, "dimension": scene.dimension,
        "noun": bodies.noun, "digits": dict(auditor.digits),
        "remarks": [*trajectory.remarks, *states.remarks, *filter(None, [auditor.velocity_remark()])],
        "walls": [wall.name for wall in scene.walls],
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


def _span(times: list[float]) -> list[float]:
    """First and last time that is a number; 0 where none is."""
    finite = [t for t in times if math.isfinite(t)] or [0.0]
    return [finite[0], finite[-1]]


def _thin(rows: list[dict[str, float]]) -> list[dict[str, float]]:
    every = -(-len(rows) // POINTS)
    return rows if every <= 1 else [*rows[::every], *([rows[-1]] if (len(rows) - 1) % every else [])]


def _check(tally: Tally, auditor: Auditor, hint: str) -> dict[str, Any]:
    title, unit = TITLES[tally.name]
    verdict = VIOLATED if tally.beyond else HOLDS if tally.judged else UNDECIDED
    why_not = [
        f"{why} ({count:,} of {tally.judged + tally.undecided:,})" for why, count in tally.why_not.most_common(3)
    ]
    worst = {} if tally.worst is None else {**tally.worst, "ratio": min(tally.worst["ratio"], 1e300)}
    if tally.name == "particles" and verdict == VIOLATED and not auditor.scene.open:
        hint = "; if bodies are meant to come or leave, write open = true in the TOML"
    if tally.name == "motion" and verdict == VIOLATED:
        hint = auditor.clock_hint()
    if verdict == VIOLATED:
        hint += inertia_hint(auditor, tally.name) or stiffness_hint(auditor, tally.name, hint)
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
    rows = sorted(row for row in by_time.values() if all(map(math.isfinite, row)))
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
    poses = auditor.track.at(state.t)
    for k, wall in enumerate(auditor.scene.walls):
        walls.append([wall.name, *poses.point[k].tolist(), *poses.normal[k].tolist()])
    return {
        "x": state.x[at].round(12).tolist(), "radius": bodies.radius[at].tolist(), "id": bodies.id[at].tolist(),
        "marked": bodies.id[chosen].tolist() if len(chosen) < len(bodies.id) else [], "walls": walls, "t": state.t, "step": state.step,
    }  # fmt: skip
