"""A TOML out of a trajectory alone: what its columns and its free bodies show, and by name what only its user knows."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.harness.audit.geometry import close_pairs, norm
from ninedisk.harness.audit.read import dimension_of, read_trajectory
from ninedisk.harness.audit.readers.columns import Frame, Trajectory
from ninedisk.harness.audit.readers.rounding import Rounding
from ninedisk.harness.audit.states import SPACE

FRAMES = 6
"""Frames that are looked at."""
AGREEING = 3
"""Accelerations that must agree for them to be gravity: with fewer, anything may have pushed."""
APART = 1.5
"""Distance of a body in free flight from all others, over what they could have moved."""


@dataclass(frozen=True)
class Inferred:
    """A TOML, and what it still lacks, as keys with reasons; empty: it is ready for a first audit."""

    text: str
    lacking: tuple[str, ...]


def infer_scene(path: Path) -> Inferred:
    """Infer what a trajectory shows.

    Raises
    ------
    UsageError
        If the file cannot be read.
    """
    trajectory = read_trajectory(path, {})
    d = dimension_of(trajectory)
    frames = list(islice(trajectory.frames(lambda *_: None), FRAMES))
    columns = frames[0].columns if frames else {}
    noun = "disks" if d == 2 else "spheres"
    lines = [f"# Inferred from {path.name} by `ninedisk audit`: check it, and write what it lacks.", f"dimension = {d}"]
    lines += [f"# {remark}" for remark in trajectory.remarks]
    lacking: list[str] = []
    times, dt, clock = _clock(trajectory, frames)
    if clock:
        lacking.append(clock)
    gravity = _gravity(trajectory, frames, times, d) if times is not None and "radius" in columns else None
    example = "[0.0, -9.81]" if d == 2 else "[0.0, 0.0, -9.81]"
    if gravity is not None:
        vector, count = gravity
        lines.append(
            f"gravity = [{', '.join(f'{each:.10g}' for each in vector)}]  # inferred: what {count} bodies in free flight show"
        )
    else:
        lines.append(f"# gravity = {example}  # MISSING")
        lacking.append(
            f"gravity = {example}: {_why_no_gravity(columns, times)}; {'[0, 0]' if d == 2 else '[0, 0, 0]'} where there is none"
        )
    lines.append(
        'walls = "unknown"  # MISSING: [[walls]] tables (--example shows them), or walls = [] where there are none'
    )
    lines += ["", "[time]"]
    if dt is not None:
        lines.append(f"dt = {dt:.12g}  # the engine's step: times over steps of the file")
    elif clock:
        lines.append(f"# {clock.partition(':')[0].rpartition('.')[2]}  # MISSING")
    else:
        lines.append(
            "# dt = 1e-5  # the engine's own step; without it the time between two frames is taken, which allows more"
        )
    lines += ["", f"[{noun}]"]
    for name, words in (("radius", "[m]"), ("mass", f"[kg]; or density = 2500.0, in kg/m^{d}")):
        if name in columns:
            values = columns[name]
            low, high = float(np.nanmin(values, initial=np.inf)), float(np.nanmax(values, initial=0.0))
            lines.append(f"# {name}: from the file, {low:.6g} to {high:.6g}")
        else:
            lines.append(f"# {name} = 0.1  # MISSING: {words}")
            lacking.append(f"[{noun}] {name} = ... {words}: the file has no column {name}")
    shape = "sphere" if d == 3 else _shape(columns)
    if shape is not None:
        why = "of uniform spheres: 2/5" if d == 3 else "inferred: masses grow as such bodies of one density do"
        lines.append(f'inertia = "{shape}"  # {why}; or I/(m R^2)')
    else:
        lines.append('# inertia = "disk"  # MISSING: "disk" 1/2, "sphere" 2/5, or I/(m R^2)')
        lacking.append(
            f'[{noun}] inertia = "disk" or "sphere": spheres that move in a plane have 2/5 m R^2, disks 1/2 m R^2'
        )
    lines += ["", "[contact]", "# Nothing here can be read off: what is not given is not judged."]
    lines += ["# mu = 0.3", "# kn = 1e6    # [N/m]; or rigid = true", "# ks = 8e5    # [N/m]", "# restitution = 0.7"]
    return Inferred("\n".join(lines) + "\n", tuple(lacking))


def _shape(columns: dict[str, FloatArray]) -> str | None:
    """Disk or sphere by how masses grow with radii; None: they do not show."""
    if "radius" not in columns or "mass" not in columns:
        return None
    radius, mass = columns["radius"], columns["mass"]
    if not len(radius) or not (np.isfinite(radius) & np.isfinite(mass) & (radius > 0.0) & (mass > 0.0)).all():
        return None
    if np.ptp(radius) < 0.01 * radius.max():
        return None
    for name, power in (("disk", 2), ("sphere", 3)):
        density = mass / radius**power
        if np.ptp(density) < 1e-3 * density.max():
            return name
    return None


def _clock(trajectory: Trajectory, frames: list[Frame]) -> tuple[FloatArray | None, float | None, str]:
    """Times, the engine's step if the file shows it, and what is lacking."""
    if trajectory.clock == "step":
        return None, None, "time.dt = 1e-5: the file has steps and no times; write the engine's step in seconds"
    if trajectory.clock in ("index", "record"):
        return None, None, "time.interval = 1e-3: the files have no times; write the seconds between two of them"
    t = np.array([frame.t for frame in frames])
    steps = np.array([frame.step for frame in frames], dtype=float)
    if (
        trajectory.form.startswith("LAMMPS dump")
        and len(t) > 1
        and (np.diff(steps) > 0).all()
        and (np.diff(t) > 0.0).all()
    ):
        each = np.diff(t) / np.diff(steps)
        if np.ptp(each) <= 1e-6 * each.mean():
            return t, float((t[-1] - t[0]) / (steps[-1] - steps[0])), ""
    return t, None, ""


def _why_no_gravity(columns: dict[str, FloatArray], times: FloatArray | None) -> str:
    if times is None:
        return "without times no acceleration is known"
    if "radius" not in columns:
        return "without radii nobody knows which bodies are in free flight"
    if "vx" not in columns:
        return "the file has no velocities"
    return f"fewer than {AGREEING} bodies in free flight agree on one, or velocities and times have too few digits"


def _gravity(trajectory: Trajectory, frames: list[Frame], times: FloatArray, d: int) -> tuple[list[float], int] | None:
    """The acceleration that most bodies away from others share, and how many do."""
    names = SPACE[d]
    found, errors = [], []
    fastest = 0.0
    for k in range(len(frames) - 1):
        one, two = frames[k].columns, frames[k + 1].columns
        h = float(times[k + 1] - times[k])
        need = (*names, *(f"v{axis}" for axis in names), "radius")
        if any(name not in part for part in (one, two) for name in need) or not h > 0.0:
            return None
        x, y = _by_id(one), _by_id(two)
        ids, at, to = np.intersect1d(x, y, return_indices=True)
        if len(ids) < len(x) or len(np.unique(x)) < len(x):
            continue
        places = [np.column_stack([part[axis] for axis in names])[order] for part, order in ((one, at), (two, to))]
        speeds = [
            np.column_stack([part[f"v{axis}"] for axis in names])[order] for part, order in ((one, at), (two, to))
        ]
        if not all(np.isfinite(each).all() for each in (*places, *speeds)):
            continue
        reach = one["radius"][at] + APART * h * np.maximum(norm(speeds[0]), norm(speeds[1]))
        alone = np.ones(len(ids), dtype=bool)
        alone[close_pairs(places[0], np.nan_to_num(reach))[0].ravel()] = False
        rules = [trajectory.rounding.get(f"v{axis}", Rounding()) for axis in names]
        # Even intervals are taken as exact, or no table with t = 0.001, 0.002 could be used.
        even = bool(np.ptp(np.diff(times)) <= 1e-9 * h)
        et = 0.0 if even else trajectory.rounding.get("t", Rounding()).error(np.array([times[k + 1]]))[0]
        error = np.column_stack(
            [rule.error(speeds[1][:, c]) + rule.error(speeds[0][:, c]) for c, rule in enumerate(rules)]
        )
        fastest = max(fastest, float(norm(speeds[1]).max()) / h)
        found.append(((speeds[1] - speeds[0]) / h)[alone])
        errors.append((error / h + np.abs(speeds[1] - speeds[0]) * 2.0 * et / h**2)[alone])
    if not found:
        return None
    a, e = np.concatenate(found), np.concatenate(errors)
    if len(a) < AGREEING:
        return None
    middle = np.median(a, axis=0)
    agree = (np.abs(a - middle) <= 3.0 * e + 1e-9 * np.abs(middle).max()).all(axis=1)
    if agree.sum() < AGREEING or agree.sum() < 0.5 * len(a):
        return None
    best = a[agree].mean(axis=0)
    size = float(norm(best))
    if float(norm(e[agree].min(axis=0))) > max(1e-3 * size, 1e-6 * fastest):
        return None
    width = np.maximum(e[agree].min(axis=0), 1e-12 * max(float(np.abs(best).max()), 1.0))
    return [_shortest(float(value), float(error)) for value, error in zip(best, width, strict=True)], int(agree.sum())


def _by_id(columns: dict[str, FloatArray]) -> NDArray[np.int64]:
    ids = columns.get("id")
    return np.arange(len(columns["x"])) if ids is None else np.nan_to_num(ids, nan=-1.0).astype(np.int64)


def _shortest(value: float, error: float) -> float:
    """The number with the fewest digits within the error."""
    if abs(value) <= error:
        return 0.0
    return next(
        (short for digits in range(1, 16) if abs((short := float(f"{value:.{digits}g}")) - value) <= error), value
    )
