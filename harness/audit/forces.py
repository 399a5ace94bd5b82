"""Listed contact forces against the cone of friction: normal and shear parts, or vectors of which these are made."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.audit.geometry import norm
from ninedisk.harness.audit.read import read_trajectory
from ninedisk.harness.audit.readers.columns import Frame, Trajectory
from ninedisk.harness.audit.readers.mercury import MERCURY_CONTACTS
from ninedisk.harness.audit.readers.rounding import Rounding
from ninedisk.harness.audit.scene import AuditScene
from ninedisk.harness.audit.tally import State, Tally

ALIGNED = 0.999
"""Least cosine between a wall's normal and that of its contacts, which are printed with six digits or more."""
NEEDED = (
    "a contact needs fn and fs, or fn and the vector fsx, fsy, fsz, or the force fx, fy, fz with fn or with the normal nx, ny, nz, or "
    "fnx, fny, fnz with fsx, fsy, fsz"
)


def force_parts(
    scene: AuditScene, file: Trajectory, frame: Frame
) -> tuple[FloatArray, FloatArray, tuple[FloatArray, FloatArray]]:
    """Normal force (compression positive), size of the shear force, and the errors of both by the digits."""
    columns = frame.columns
    axes = "xy" if scene.dimension == 2 else "xyz"

    def error(*names: str) -> FloatArray:
        rules = [file.rounding.get(name, Rounding()).error(np.nan_to_num(columns[name])) for name in names]
        return np.asarray(norm(np.column_stack(rules)))

    def vector(name: str) -> tuple[FloatArray, FloatArray] | None:
        names = [f"{name}{axis}" for axis in axes]
        if any(each not in columns for each in names):
            return None
        return np.column_stack([columns[each] for each in names]), error(*names)

    shear, force, normal, push = (vector(name) for name in ("fs", "f", "n", "fn"))
    if "fn" in columns:
        fn, en = columns["fn"], error("fn")
        if shear is not None:
            return fn, norm(shear[0]), (en, shear[1])
        if "fs" in columns:
            return fn, columns["fs"], (en, error("fs"))
        if force is not None:
            total = norm(force[0])
            # A root of a difference: what the digits leave of it is their root as well.
            off = force[1] + en
            square = np.maximum(total**2 - fn**2, 0.0)
            fs = np.sqrt(square)
            return (
                fn,
                fs,
                (en, np.minimum(np.sqrt(2.0 * total * off + off**2), total * off / np.maximum(fs, 1e-300) + off)),
            )
    if push is not None and shear is not None:
        return norm(push[0]), norm(shear[0]), (push[1], shear[1])
    if force is not None and normal is not None:
        size = np.maximum(norm(normal[0]), 1e-300)
        n = normal[0] / size[:, None]
        along = (force[0] * n).sum(axis=1)
        off = force[1] + 2.0 * norm(force[0]) * normal[1] / size
        return np.abs(along), norm(force[0] - along[:, None] * n), (off, off)
    raise UsageError(f"{file.path}, {frame.place}: {NEEDED}; name columns in the TOML by [contacts.columns]")


def _check_walls(scene: AuditScene, file: Trajectory, frame: Frame) -> None:
    """Refuse walls in another order than MercuryDPM numbers them, seen by the normals of its contacts."""
    columns = frame.columns
    j = np.nan_to_num(columns["j"])
    normal = np.column_stack([columns[f"n{axis}"] for axis in "xyz"[: scene.dimension]])
    for k in np.flatnonzero(j < 0.0).tolist() if scene.walls_known else ():
        w = int(-1 - j[k])
        where = f"{file.path}, {frame.place}: body {columns['i'][k]:.0f} touches wall {j[k]:.0f}"
        if w >= len(scene.walls):
            raise UsageError(
                f'{where}, and the TOML has {len(scene.walls)} walls: write all of MercuryDPM\'s, in their order, or walls = "unknown"'
            )
        wall = scene.walls[w]
        if not wall.motion and float(normal[k] @ wall.normal) < ALIGNED:
            raise UsageError(
                f"{where} along {normal[k].round(3).tolist()}, and the TOML's wall {w + 1}, {wall.name!r}, has the normal "
                f"{np.round(wall.normal, 3).tolist()}: write the walls in MercuryDPM's order"
            )


def judge_contacts(scene: AuditScene, progress: Callable[[int, int, str], None]) -> Tally:
    """Every contact force given: it pushes, and its shear part is at most mu times that."""
    tally = Tally("cone")
    if scene.contacts is None:
        tally.skip(
            1,
            'no contact forces are given: [contacts] file = "..." with columns i, j, fn, fs (docs/how-to/audit-a-trajectory.md)',
        )
        return tally
    file = read_trajectory(scene.contacts, scene.contact_columns, ())
    noun = "disk" if scene.dimension == 2 else "sphere"
    n_walls = len(scene.walls)
    for frame in file.frames(progress):
        columns = frame.columns
        if file.form == MERCURY_CONTACTS:
            _check_walls(scene, file, frame)
        fn, fs, rules = force_parts(scene, file, frame)
        j = columns.get("j", np.zeros(len(fn)))
        mu = np.full(len(fn), np.nan if scene.mu is None else scene.mu)
        for w in range(n_walls):
            given = scene.wall_mu[w]
            mu[j == -1 - w] = np.nan if given is None else given
        en, es = rules
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
                f"wall {scene.walls[int(-1 - j[at[k]])].name!r}"
                if -n_walls <= j[at[k]] < 0
                else f"{noun} {j[at[k]]:.0f}"
            )
            return f"contact of {noun} {i[at[k]]:.0f} with {other}"

        pull = np.zeros(len(fn)) if scene.cohesive or scene.pull else np.maximum(-fn, 0.0)
        beyond = np.maximum(np.abs(fs) - np.nan_to_num(mu) * (np.abs(fn) if scene.pull else np.maximum(fn, 0.0)), 0.0)
        if scene.cohesive:
            tally.skip(len(at), "cohesion carries shear beyond mu fn, by an unknown amount")
            continue
        value = np.maximum(pull, beyond)
        if scene.pull:
            tally.skip(
                int((fn < 0.0).sum()), "dashpots may pull at the end of a contact: pull = false states that none does"
            )
        tally.judge(state, value[at], {"digits of fs": es[at], "mu times the digits of fn": (np.nan_to_num(mu) * en + en)[at]}, who,
                    lambda _: np.empty(0, dtype=np.int64))  # fmt: skip
        tally.skip(int((~known).sum()), "mu of the contact is not given")
        if (odd := int((~(np.isfinite(fn) & np.isfinite(fs))).sum())) and scene.mu is not None:
            bad = float(odd)
            tally.judge(state, np.array([bad]), {"none is allowed": np.zeros(1)}, lambda _: "a force that is no number",
                        lambda _: np.empty(0, dtype=np.int64))  # fmt: skip
    return tally
