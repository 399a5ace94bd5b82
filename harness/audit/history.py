"""Shear springs that lose their history, as at a restart: a shear force that falls by more than its contact can have slipped back."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.harness.audit.forces import force_parts
from ninedisk.harness.audit.geometry import norm, turning
from ninedisk.harness.audit.read import read_trajectory
from ninedisk.harness.audit.readers.columns import Frame, Trajectory
from ninedisk.harness.audit.scene import AuditScene
from ninedisk.harness.audit.states import States
from ninedisk.harness.audit.tally import Bodies, State, Tally

RESOLVED = 0.25
"""Time between two frames, over sqrt(m/kn), up to which slip between frames follows from its ends."""


class _Listed:
    """Contacts of one frame: bodies or walls, normal and shear force, digits of the shear force."""

    def __init__(self, scene: AuditScene, file: Trajectory, frame: Frame, bodies: Bodies) -> None:
        fn, fs, (_, es) = force_parts(scene, file, frame)
        i, j = (np.nan_to_num(frame.columns[name], nan=-1e9).astype(np.int64) for name in ("i", "j"))
        turned = (i < j) & (i >= 0)
        first, second = np.where(turned, j, i), np.where(turned, i, j)
        at = np.minimum(np.searchsorted(bodies.id, first), len(bodies.id) - 1)
        partner = np.minimum(np.searchsorted(bodies.id, np.maximum(second, 0)), len(bodies.id) - 1)
        wall = -1 - second
        known = (bodies.id[at] == first) & np.where(second < 0, wall < len(scene.walls), bodies.id[partner] == second)
        known &= np.isfinite(fn) & np.isfinite(fs) & (fn > 0.0)
        self.keys = np.stack([at, np.where(second < 0, -1 - wall, partner)], axis=1)[known]
        self.fn, self.fs, self.es = fn[known], np.abs(fs[known]), es[known]

    def shared(self, other: _Listed) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows of contacts that both have once."""
        rows = {tuple(key): k for k, key in enumerate(other.keys.tolist())}
        pairs = [(k, rows[tuple(key)]) for k, key in enumerate(self.keys.tolist()) if tuple(key) in rows]
        found = np.array(pairs, dtype=np.int64).reshape(-1, 2)
        return found[:, 0], found[:, 1]


def judge_history(trajectory: Trajectory, scene: AuditScene, progress: Callable[[int, int, str], None]) -> Tally:
    """Hold each shear force against the one before: it falls by ks times the slip at most, or to mu times the least normal force.

    Parameters
    ----------
    trajectory : Trajectory
        Read once more, beside the file of contacts.
    scene : AuditScene
    progress : function

    Returns
    -------
    Tally
    """
    tally = Tally("history")
    why = _undecidable(scene)
    if why:
        tally.skip(1, why)
        return tally
    assert scene.contacts is not None
    file = read_trajectory(scene.contacts, scene.contact_columns, ())
    states = States(trajectory, scene)
    before: tuple[State, _Listed] | None = None
    matched = 0
    for state, frame in _side_by_side(states, file, scene, progress):
        if frame is None or states.bodies is None or "i" not in frame.columns or "j" not in frame.columns:
            before = None
            continue
        if state.omega is None or not states.has_velocity:
            tally.skip(1, "slip needs velocities and spins of the bodies")
            return tally
        matched += 1
        listed = _Listed(scene, file, frame, states.bodies)
        if before is not None:
            _compare(tally, scene, states.bodies, before, (state, listed))
        before = state, listed
    if matched < 2:
        tally.skip(1, "frames of the contacts have other times than those of the trajectory, or no columns i and j")
    return tally


def _undecidable(scene: AuditScene) -> str:
    if scene.contacts is None:
        return 'no contact forces are given: [contacts] file = "..." with columns i, j, fn, fs'
    if lacking := [name for name in ("mu", "kn", "ks") if getattr(scene, name) is None]:
        return f"whether a shear force was lost needs contact.{lacking[0]}"
    return "cohesion carries shear beyond mu fn" if scene.cohesive else ""


def _side_by_side(
    states: States, file: Trajectory, scene: AuditScene, progress: Callable[[int, int, str], None]
) -> Iterator[tuple[State, Frame | None]]:
    """States with the contacts of the same time."""
    frames = file.frames(lambda *_: None)
    frame = next(frames, None)
    last = math.nan
    for state in states.all(progress):
        near = 1e-6 * (state.t - last if state.t > last else abs(state.t)) + 1e-300
        last = state.t

        def time_of(each: Frame) -> float:
            return each.t if np.isfinite(each.t) else each.step * (scene.dt or math.nan)

        while frame is not None and time_of(frame) < state.t - near:
            frame = next(frames, None)
        same = frame is not None and abs(time_of(frame) - state.t) <= near
        yield state, frame if same else None


def _slips(
    scene: AuditScene, bodies: Bodies, state: State, keys: NDArray[np.int64]
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Slip and speed along the normal of contacts, their gap (walls 0), and by how much other arms change the slip."""
    i, j = keys[:, 0], keys[:, 1]
    walled = j < 0
    other = np.where(walled, 0, j)
    assert state.omega is not None
    apart = state.x[other] - state.x[i]
    if walled.any():
        normals = np.array([wall.normal for wall in scene.walls], dtype=float)
        normals = normals / norm(normals)[:, None]
        apart = np.where(walled[:, None], -normals[np.where(walled, -1 - j, 0)], apart)
    n = apart / np.maximum(norm(apart), 1e-300)[:, None]
    R = bodies.radius
    own = state.v[i] + turning(state.omega[i], R[i, None] * n)
    theirs = state.v[other] + turning(state.omega[other], -R[other, None] * n)
    relative = own - np.where(walled[:, None], 0.0, theirs)
    along = (relative * n).sum(axis=1)
    reach = np.where(walled, 0.0, norm(state.x[other] - state.x[i]) - R[i] - R[other])
    overlap = np.maximum(-reach, 0.0)
    if walled.any():
        points = np.array([wall.point for wall in scene.walls], dtype=float)[np.where(walled, -1 - j, 0)]
        overlap = np.where(walled, np.maximum(R[i] + ((state.x[i] - points) * n).sum(axis=1), 0.0), overlap)
    # The slip of an engine has arms R less half the overlap (at a wall less the overlap), or R.
    spins = norm(state.omega)
    arms = overlap * np.where(walled, spins[i], 0.5 * (spins[i] + spins[other]))
    return relative - along[:, None] * n, np.abs(along), reach, arms


def _compare(
    tally: Tally, scene: AuditScene, bodies: Bodies, one: tuple[State, _Listed], two: tuple[State, _Listed]
) -> None:
    (b, earlier), (c, later) = one, two
    h = c.t - b.t
    k, m = earlier.shared(later)
    if not h > 0.0 or not len(k):
        return
    keys = earlier.keys[k]
    i, j = keys[:, 0], keys[:, 1]
    walled = j < 0
    at = np.where(walled, -1 - j, 0)

    def of_wall(given: tuple[float | None, ...], common: float | None) -> FloatArray:
        own = np.array([math.nan if each is None else each for each in given] or [math.nan])
        return np.where(walled, own[at], math.nan if common is None else common)

    mu, kn, ks = of_wall(scene.wall_mu, scene.mu), of_wall(scene.wall_kn, scene.kn), of_wall(scene.wall_ks, scene.ks)
    inverse = 1.0 / bodies.mass[i] + np.where(walled, 0.0, 1.0 / bodies.mass[np.maximum(j, 0)])
    coarse = ~(h <= RESOLVED / np.sqrt(np.nan_to_num(kn, nan=np.inf) * inverse))
    moving = walled & np.array([bool(wall.motion) for wall in scene.walls] or [False])[at]
    first, second = _slips(scene, bodies, b, keys), _slips(scene, bodies, c, keys)
    odd = ~np.isfinite(mu + kn + ks) | (np.maximum(first[2], second[2]) > 0.01 * bodies.radius[i])
    there = b.here[i] & c.here[i] & (walled | (b.here[np.maximum(j, 0)] & c.here[np.maximum(j, 0)]))
    tally.skip(
        int((coarse & there).sum()),
        "frames are more than sqrt(m/kn)/4 apart, so that contacts may slip back between them",
    )
    tally.skip(
        int(((moving | odd) & there & ~coarse).sum()),
        "contacts with moving walls, across periodic edges or of an unknown law",
    )
    use = np.flatnonzero(there & ~coarse & ~moving & ~odd)
    span = h + (scene.dt or 0.0)
    path = span * (np.maximum(norm(first[0]), norm(second[0])) + norm(second[0] - first[0]))
    arms = span * np.maximum(first[3], second[3])
    opened = kn * span * np.maximum(first[1], second[1])
    least = np.maximum(np.minimum(earlier.fn[k], later.fn[m]) - opened, 0.0)
    lost = np.minimum(earlier.fs[k], mu * least) - later.fs[m]

    def who(row: int) -> str:
        body, partner = i[use[row]], j[use[row]]
        other = f"wall {scene.walls[-1 - partner].name!r}" if partner < 0 else f"{bodies.noun} {bodies.id[partner]}"
        return (
            f"contact of {bodies.noun} {bodies.id[body]} with {other}, whose shear force falls from {earlier.fs[k[use[row]]]:.3g} to "
            f"{later.fs[m[use[row]]]:.3g} N (lost history, as at a restart?)"
        )

    def members(row: int) -> NDArray[np.int64]:
        return np.array([each for each in (i[use[row]], j[use[row]]) if each >= 0])

    parts = {
        "ks times the slip": ks * path,
        "arms of the slip, R or less the overlap": ks * arms,
        "digits of fs": earlier.es[k] + later.es[m],
    }
    tally.judge(c, np.maximum(lost, 0.0)[use], {why: part[use] for why, part in parts.items()}, who, members)
