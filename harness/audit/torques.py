"""Torques that the file gives for each body, held against the change of its spin."""

from __future__ import annotations

import numpy as np

from ninedisk.core.array_types import FloatArray
from ninedisk.harness.audit.geometry import norm
from ninedisk.harness.audit.history import RESOLVED
from ninedisk.harness.audit.scene import AuditScene
from ninedisk.harness.audit.tally import Bodies, Tally
from ninedisk.harness.audit.touching import Interval

CURVED = 0.1
"""What a torque may differ from a straight line between two frames that resolve the contact, over its size.

A swing with w errs by (w h)^2/12. Six contacts with ks = kn turn a sphere with w^2 = 6 (5/2) kn/m; h = sqrt(m/kn)/4 gives 0.08.
"""


def judge_torques(tally: Tally, scene: AuditScene, bodies: Bodies, interval: Interval, clock: float) -> None:
    """Hold ``I (w_1 - w_0)`` against ``h (T_0 + T_1)/2`` where frames resolve contacts; ``clock`` is the error of h [s]."""
    b, c, h, dt, use = interval[:5]
    if b.torque is None or c.torque is None or b.omega is None or c.omega is None:
        lacking = "torque" if scene.dimension == 2 else "tqx, tqy, tqz"
        tally.skip(1, f"the file has no torques, or no spins: add {lacking}")
        return
    known = use & np.isfinite(b.torque + c.torque + b.omega + c.omega).all(axis=1)
    stiff, shear = (
        [each for each in (common, *walls) if each is not None]
        for common, walls in ((scene.kn, scene.wall_kn), (scene.ks, scene.wall_ks))
    )
    resolved = RESOLVED * np.sqrt(bodies.mass / max(stiff)) if stiff and shear else np.zeros(len(known))
    coarse = known & ~(h <= resolved)
    why = (
        "torques between frames follow from those of frames at most sqrt(m/kn)/4 apart: give kn and ks, or more frames"
    )
    tally.skip(int(coarse.sum()), why)
    moved = np.zeros(len(known), dtype=bool)
    moved[interval.touch.walled[:, 0]] = any(wall.motion for wall in scene.walls)
    tally.skip(int((known & ~coarse & moved).sum()), "slip at moving walls is not followed")
    coarse |= moved
    at = np.flatnonzero(known & ~coarse)
    inertia = bodies.inertia[at]
    one, two, before, after = b.torque[at], c.torque[at], b.omega[at], c.omega[at]
    gained = inertia[:, None] * (after - before + 0.5 * scene.damping * h * (before + after))
    value = norm(gained - 0.5 * h * (one + two))
    size = np.maximum(norm(one), norm(two))
    rounded = inertia * (b.eo[at] + c.eo[at] + 4.0 * interval.hidden * np.maximum(norm(before), norm(after)))
    rounded += 0.5 * h * (b.eq[at] + c.eq[at]) + clock * size
    rounded += norm(gained) * (bodies.em[at] / bodies.mass[at] + 2.0 * bodies.er[at] / bodies.radius[at])
    swept = 0.25 * h * h * max(shear, default=0.0) * bodies.radius[at] * _slips(bodies, interval)[at]
    parts = {
        "digits": rounded,
        "torque between frames": 0.5 * (h + dt) * norm(two - one) + CURVED * h * size,
        "shear springs between frames": swept,
    }
    tally.judge(
        c, value, parts, lambda k: f"{bodies.noun} {bodies.id[at[k]]}, whose torques should change its spin by "
        f"{norm(0.5 * h * (one + two) / inertia[:, None])[k]:.3g} rad/s and do so by {norm(after - before)[k]:.3g}",
        lambda k: at[k : k + 1],
    )  # fmt: skip


def _slips(bodies: Bodies, interval: Interval) -> FloatArray:
    """Most slip of all contacts that each body may have had [m/s]: as fast a shear force may sweep up and back within its limit."""
    found = np.zeros(len(bodies.id))
    pairs, walled = interval.touch.pairs, interval.touch.walled[:, 0]
    i, j = pairs[:, 0], pairs[:, 1]
    for state in (interval.b, interval.c):
        assert state.omega is not None
        rim = bodies.radius * np.nan_to_num(norm(state.omega))
        v = np.nan_to_num(state.v)
        each = norm(v[i] - v[j]) + rim[i] + rim[j]
        alone = norm(v[walled]) + rim[walled]
        at = np.concatenate([i, j, walled])
        sums = np.bincount(at, np.concatenate([each, each, alone]), len(found))
        found = np.maximum(found, sums)
    return found
