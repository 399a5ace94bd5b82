"""The samples of a run inside YADE as the arrays of the wire format."""

import math

import numpy as np
from history_parts import gaps


def history(run):
    """All samples as the arrays of the wire format."""
    step, x, half, spin, turn, force, torque, contact, elastic, given = zip(*run.samples)  # noqa: B905
    steps, n, m = len(step), run.n, run.m
    mass, inertia, radius = (np.array(run.disks[key]) for key in ("mass", "inertia", "radius"))
    x, half = (np.array(rows).reshape(steps, n, 2) for rows in (x, half))
    force = np.array(force).reshape(steps, n + m, 2)
    v = synchronised(run, half, force[:, :n] / mass[:, None] + np.array(run.gravity))
    spin = np.array(spin).reshape(steps, n)
    omega = synchronised(run, spin, np.array(torque).reshape(steps, n) / inertia)
    turning = np.array(run.disks["rotating"], dtype=bool)
    omega = np.where(turning, omega, spin)
    v[0], omega[0] = given[0]
    t = np.array(step) * (run.substeps * run.dt)
    rows = np.minimum(np.array(step) * run.substeps, len(run.path) - 1)
    point, normal = run.path[rows, :, 0:2], run.path[rows, :, 2:4]
    contact = np.array(contact).reshape(steps, len(run.pairs), 2)
    # A blocked spin is prescribed: it exchanges no energy with the scene and is not counted, as in the in-house DEM.
    return {
        "step": list(step),
        "t": t.tolist(),
        "x": x.tolist(),
        "v": v.tolist(),
        "angle": unwrapped(np.array(turn).reshape(steps, n), omega, t).tolist(),
        "omega": omega.tolist(),
        "gap": gaps(run, x, radius, point, normal).tolist(),
        "fn": contact[:, :, 0].tolist(),
        "fs": contact[:, :, 1].tolist(),
        "force_meaning": "instantaneous",
        "wall_point": point.tolist(),
        "wall_angle": np.arctan2(normal[:, :, 1], normal[:, :, 0]).tolist(),
        "wall_force": force[:, n:].tolist(),
        "energy": {
            "kinetic": (0.5 * (v**2).sum(axis=2) @ mass + 0.5 * omega**2 @ np.where(turning, inertia, 0.0)).tolist(),
            "gravity": (-(x @ np.array(run.gravity)) @ mass).tolist(),
            "elastic": list(elastic),
        },
    }


def synchronised(run, half, acceleration):
    """Velocities at the sampled times from those half a step before and the accelerations."""
    if run.central:
        return (half + 0.5 * run.dt * acceleration) / (1.0 + run.a)
    return half + 0.5 * run.dt * (acceleration - run.xi * half)


def unwrapped(turn, omega, t):
    """Rotation angles without jumps: each wrapped angle plus the whole turns that the mean spin since the last sample asks."""
    angle = np.array(turn)
    for k in range(1, len(t)):
        expected = angle[k - 1] + 0.5 * (omega[k - 1] + omega[k]) * (t[k] - t[k - 1])
        angle[k] += 2.0 * math.pi * np.round((expected - angle[k]) / (2.0 * math.pi))
    return angle
