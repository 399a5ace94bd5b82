"""Frames as states: bodies in the order of the first frame's ids, places that go on across periodic edges, velocities by differences."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.audit.readers.columns import Frame, Trajectory
from ninedisk.harness.audit.readers.lammps_data import BodyData, read_data_file
from ninedisk.harness.audit.readers.rounding import Rounding
from ninedisk.harness.audit.scene import LARGEST, AuditScene, Fact
from ninedisk.harness.audit.tally import Bodies, State, Tally

SPACE = {2: ("x", "y"), 3: ("x", "y", "z")}
NOUN = {2: "disk", 3: "sphere"}
TURNS = {2: ("{}",), 3: ("{}x", "{}y", "{}")}
"""Columns of a vector, and of what turns."""
OTHER = 1e-4
"""Share by which a number of a data file may differ from that of the trajectory, which may be printed with five digits."""


class States:
    """Aligns frames with the ids of the first, and notes what is wrong with ids, times and numbers on the way."""

    def __init__(self, trajectory: Trajectory, scene: AuditScene) -> None:
        self.trajectory, self.scene = trajectory, scene
        self.tallies = {name: Tally(name) for name in ("finite", "particles", "time")}
        self.bodies: Bodies | None = None
        self.has_velocity = True
        self._before: float | None = None
        self._missing: NDArray[np.bool_] | None = None
        self._last: State | None = None
        self._edges: FloatArray | None = None

    def all(self, progress: Callable[[int, int, str], None]) -> Iterator[State]:
        """States in the order of the file; where it has no velocities, with central differences."""
        made = self._each(progress)
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
                    yield difference_velocities(window[0], window[1], window[0], self.scene.gravity, one_sided=True)
                yield difference_velocities(window[0], window[2], window[1], self.scene.gravity)
                del window[0]
        if len(window) == 2:
            yield difference_velocities(window[0], window[1], window[1], self.scene.gravity, one_sided=True)

    def _each(self, progress: Callable[[int, int, str], None]) -> Iterator[State]:
        frames = self.trajectory.frames(progress)
        number = 0
        while (frame := next(frames, None)) is not None:
            state = self._state(number, frame)
            frame = None  # or two would be in memory while the next one is read
            number += 1
            yield state

    def _state(self, number: int, frame: Frame) -> State:
        """A frame in the order of the first one's ids."""
        columns = frame.columns
        ids = columns.get("id")
        n = len(columns["x"])
        if n == 0:
            raise UsageError(
                f"{self.trajectory.path}, {frame.place}: a frame without {NOUN[self.scene.dimension]}s: cut it out of the file"
            )
        here = np.arange(n) if ids is None else np.nan_to_num(ids, nan=-1.0).astype(np.int64)
        if self.bodies is None:
            self.bodies = _bodies(self.trajectory.path, self.scene, here, columns, self.trajectory.rounding)
            self.has_velocity = all(f"v{axis}" in columns for axis in SPACE[self.scene.dimension])
        bodies = self.bodies
        row, doubled, new = _rows_of(bodies.id, here)
        present = row >= 0
        single = 2.0**-24 if self.scene.single else 0.0

        def vector(names: Sequence[str]) -> tuple[FloatArray | None, FloatArray]:
            """Components side by side and the error of the vector; None where one is not in the file."""
            error = np.zeros(len(bodies.id))
            if any(name not in columns for name in names):
                return None, error
            found = np.empty((len(bodies.id), len(names)))
            for axis, name in enumerate(names):
                rule = self.trajectory.rounding.get(name, Rounding())
                values = np.asarray(columns[name], dtype=float)[row]
                values[~present] = np.nan
                rule.place(values, axis, single, found, error)
            return found, np.sqrt(error, out=error)

        space, turns = SPACE[self.scene.dimension], TURNS[self.scene.dimension]
        x, ex = vector(space)
        if x is None:
            raise UsageError(f"{self.trajectory.path}, {frame.place}: a place needs the columns {', '.join(space)}")
        v, ev = vector([f"v{axis}" for axis in space])
        omega, eo = vector([each.format("omega") for each in turns])
        angle, ea = vector([each.format("angle") for each in turns])
        torque, eq = vector(("torque",) if self.scene.dimension == 2 else ("tqx", "tqy", "torque"))
        t, et = self._time(number, frame)
        velocity = np.zeros_like(x) if v is None else v
        cell = self._cell(frame)
        if cell is not None:
            x = self._going_on(x, velocity, t, cell)
        if frame.domain is not None:
            self._check_domain(frame, x, velocity, t)
        state = State(
            step=frame.step, t=t, et=et, place=frame.place, x=x, v=velocity, omega=omega, angle=angle, ex=ex, ev=ev, eo=eo, ea=ea,
            here=present.copy(), cell=cell, torque=torque, eq=eq,
        )  # fmt: skip
        self._last = state
        self._numbers(state, columns, present)
        self._check_ids(state, doubled, new, present, here)
        self._check_times(state)
        return state

    def _cell(self, frame: Frame) -> FloatArray | None:
        """Periodic edges of the dimension; None: there are none."""
        d = self.scene.dimension
        edges = frame.cell
        if self.scene.periodic:
            if frame.domain is None:
                raise UsageError(
                    f"{self.trajectory.path} ({self.trajectory.form}) has no domain that may repeat, as MercuryDPM's: take periodic out "
                    "of the TOML"
                )
            repeats = np.array([axis in self.scene.periodic for axis in "xyz"])
            edges = np.where(repeats[:, None], frame.domain, np.nan)
        if edges is None:
            return None
        cell = edges[:d, :d]
        cell = cell[np.isfinite(cell).all(axis=1)]
        if not len(cell):
            return None
        if self._edges is None:
            self._edges = cell
        elif self._edges.shape != cell.shape or not np.allclose(self._edges, cell, rtol=1e-9, atol=0.0):
            raise UsageError(
                f"{self.trajectory.path}, {frame.place}: the periodic box differs from that of the first frame: an audit takes no box that "
                "changes its size or shape"
            )
        if (np.abs(np.linalg.det(cell @ cell.T)) if len(cell) else 1.0) == 0.0:
            raise UsageError(f"{self.trajectory.path}, {frame.place}: the periodic box is empty")
        return cell

    def _check_domain(self, frame: Frame, x: FloatArray, v: FloatArray, t: float) -> None:
        """Ask whether the domain repeats where a body leaps by its length, but for a tenth."""
        last = self._last
        if last is None or frame.domain is None:
            return
        with np.errstate(invalid="ignore", divide="ignore"):
            for k, axis in enumerate(SPACE[self.scene.dimension]):
                leap = (
                    np.abs(x[:, k] - last.x[:, k] - 0.5 * (t - last.t) * (last.v[:, k] + v[:, k])) / frame.domain[k, k]
                )
                if axis not in self.scene.periodic and (at := np.flatnonzero(np.abs(leap - 1.0) < 0.1)).size:
                    assert self.bodies is not None
                    who = f"{NOUN[self.scene.dimension]} {self.bodies.id[at[0]]}"
                    raise UsageError(
                        f"{self.trajectory.path}, {frame.place}: {who} leaps along {axis} by the length of the domain, "
                        f'{frame.domain[k, k]:g}: if the domain repeats, write periodic = ["{axis}"] in the TOML'
                    )

    def _going_on(self, x: FloatArray, v: FloatArray, t: float, cell: FloatArray) -> FloatArray:
        """Places by the image that is nearest to where the last ones would have gone."""
        last = self._last
        if last is None:
            return x
        h = t - last.t if np.isfinite(t - last.t) else 0.0
        with np.errstate(invalid="ignore"):
            off = x - (last.x + 0.5 * h * (np.nan_to_num(last.v) + np.nan_to_num(v)))
            images = np.round(np.nan_to_num(off) @ np.linalg.pinv(cell))
        return np.asarray(x - images @ cell)

    def _time(self, number: int, frame: Frame) -> tuple[float, float]:
        scene, clock = self.scene, self.trajectory.clock
        if clock == "t":
            rule = self.trajectory.rounding.get("t", Rounding())
            return frame.t, float(rule.error(np.array([frame.t]))[0]) if np.isfinite(frame.t) else 0.0
        if clock in ("index", "record") and scene.interval is not None:
            return number * scene.interval, 0.0
        if clock == "record":
            raise UsageError(
                f"{self.trajectory.path} numbers its frames and has no times: give [time] interval = SECONDS between frames; 1 if its "
                "numbers are seconds"
            )
        if scene.dt is None:
            way = "[time] dt = SECONDS, the engine's step" + (
                ", or interval = SECONDS between frames" if clock == "index" else ""
            )
            raise UsageError(f"{self.trajectory.path} has steps and no times: give them in the TOML by {way}")
        return frame.step * scene.dt, 0.0

    def _numbers(self, state: State, columns: Mapping[str, FloatArray], present: NDArray[np.bool_]) -> None:
        from ninedisk.harness.audit.sums import mark_large

        any_row = np.zeros(len(columns["x"]), dtype=bool)
        bad = {
            name: mark_large(np.ascontiguousarray(column, dtype=float), LARGEST, any_row)
            for name, column in columns.items()
        }
        wrong = np.zeros(len(present), dtype=bool)
        for array in (state.x, state.v, state.omega, state.angle):
            if array is not None:
                for each in array.T:
                    mark_large(np.ascontiguousarray(each), LARGEST, wrong)
        wrong &= present
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
        finite = bool(np.isfinite(state.t))
        if self._before is not None or not finite:
            before = -np.inf if self._before is None else self._before
            wrong = not (finite and state.t > before)
            value = max(before - state.t, np.finfo(float).tiny) if finite else np.inf
            after = f" after {before:.9g}" if np.isfinite(before) else ""
            self.tallies["time"].judge(
                state, np.array([value if wrong else 0.0]), {"a frame is later than the one before": np.zeros(1)},
                lambda _: f"t = {state.t:.9g}{after}", lambda _: np.empty(0, dtype=np.int64),
            )  # fmt: skip
        if finite:
            self._before = state.t


def _bodies(
    path: Path, scene: AuditScene, ids: NDArray[np.int64], columns: Mapping[str, FloatArray], rounding: Mapping[str, Rounding]
) -> Bodies:  # fmt: skip
    unique, first = np.unique(ids, return_index=True)
    noun = NOUN[scene.dimension]

    def fact(name: str, given: Fact | None, written: FloatArray | None = None) -> FloatArray | None:
        """What the TOML gives, else its data file, else the file."""
        if given is None and written is not None:
            return written
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
                f"disks.{name} has {len(array)} numbers, and {path} begins with {len(unique)} {noun}s: give one for each, ids in order"
            )
        return np.array(array)

    data = None if scene.data is None else _data_of(scene.data, scene.data_style, path, unique)
    if data is not None:
        _compare(scene, data, path, {name: columns[name][first] for name in ("radius", "mass") if name in columns})
    radius = fact("radius", scene.radius, None if data is None else data.radius)
    if radius is None:
        raise UsageError(
            f"{path} has no column radius: give [disks] radius in the TOML, a number, a list or a table by type; or a data file "
            "of LAMMPS, [data] file"
        )
    density, mass = fact("density", scene.density), fact("mass", scene.mass, None if data is None else data.mass)
    if density is not None:
        mass = density * (np.pi * radius**2 if scene.dimension == 2 else 4.0 / 3.0 * np.pi * radius**3)
    if mass is None:
        raise UsageError(
            f"{path} has no column mass: give [disks] mass, or density in kg/m^{scene.dimension}, in the TOML"
        )
    for name, values in (("radius", radius), ("mass", mass)):
        if wrong := np.flatnonzero(~(np.isfinite(values) & (values > 0.0))).tolist():
            raise UsageError(
                f"{path}: the {name} of {noun} {unique[wrong[0]]} is {values[wrong[0]]:g}; it must be > 0 (TOML: [disks] {name})"
            )
    if missing_ids := sorted(set(scene.fixed) - set(unique.tolist())):
        raise UsageError(f"disks.fixed names {missing_ids[0]}, which is no id of the first frame of {path}")
    read = {
        name: rule
        for name, rule in rounding.items()
        if getattr(scene, name, 0) is None and (name == "radius" or density is None)
    }
    er, em = (
        read[name].error(values) if name in read else np.zeros(len(unique))
        for name, values in (("radius", radius), ("mass", mass))
    )
    if data is not None:
        er = data.radius_error if scene.radius is None else er
        em = data.mass_error if scene.mass is None else em
    if density is not None:
        em = scene.dimension * mass * er / radius
    return Bodies(
        unique,
        radius,
        mass,
        scene.inertia * mass * radius**2,
        np.isin(unique, scene.fixed),
        NOUN[scene.dimension],
        er,
        em,
    )


def _data_of(file: Path, style: str | None, path: Path, ids: NDArray[np.int64]) -> BodyData:
    """Radii and masses of a data file, of these bodies."""
    data = read_data_file(file, style)
    at = np.searchsorted(data.id, ids)
    known = data.id[np.minimum(at, len(data.id) - 1)] == ids if len(data.id) else np.zeros(len(ids), dtype=bool)
    if not known.all():
        raise UsageError(
            f"{file} has no atom {ids[~known][0]}, which the first frame of {path} has: give the data file of that run"
        )
    rows = {name: values[at] for name, values in vars(data).items()}
    return BodyData(**rows)


def _compare(scene: AuditScene, data: BodyData, path: Path, columns: Mapping[str, FloatArray]) -> None:
    """Refuse a data file of another run: its radii or masses are not those of the trajectory."""
    for name, values in columns.items():
        written = getattr(data, name)
        with np.errstate(invalid="ignore"):
            odd = np.flatnonzero(np.abs(values - written) > OTHER * written)
        if odd.size:
            k = int(odd[0])
            raise UsageError(
                f"{scene.data}: {name} of atom {data.id[k]} is {written[k]:g}, and {values[k]:g} in {path}: give the file of that run"
            )


def _rows_of(known: NDArray[np.int64], ids: NDArray[np.int64]) -> tuple[NDArray[np.int64], int, int]:
    """First row of each known body, -1 where it has none; how many rows repeat an id; how many ids are new."""
    from ninedisk.harness.audit.sums import rows_of_bodies

    row = np.empty(len(known), dtype=np.int64)
    if known[-1] - known[0] == len(known) - 1 and rows_of_bodies(ids, int(known[0]), row):
        return row, 0, 0
    unique, first = np.unique(ids, return_index=True)
    place = np.searchsorted(known, unique)
    found = (place < len(known)) & (known[np.minimum(place, len(known) - 1)] == unique)
    row[:] = -1
    row[place[found]] = first[found]
    return row, len(ids) - len(unique), int((~found).sum())


def difference_velocities(
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
