"""The scheme of spheres once more, in plain NumPy, one contact at a time: no lists of neighbours, no tables, whole vectors."""

from __future__ import annotations

from math import cos, pi, sin, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.spheres.law import SphereLaw
from ninedisk.core.spheres.scene import PlaneWall, SphereScene

Vector = NDArray[np.float64]
STEEP = 1e30


def rotation(axis: Vector, angle: float) -> NDArray[np.float64]:
    """Matrix of a turn about a unit axis."""
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.asarray(np.eye(3) + sin(angle) * k + (1 - cos(angle)) * k @ k)


def plane_at(wall: PlaneWall, t: float) -> tuple[Vector, Vector, Vector, Vector, Vector]:
    """Point, normal, pivot, its velocity and the spin of a plane with one endless segment at most."""
    point, normal, zero = np.array(wall.point), np.array(wall.normal), np.zeros(3)
    if not wall.motion:
        return point, normal, point, zero, zero
    (segment,) = wall.motion
    pivot = point if segment.pivot is None else np.array(segment.pivot)
    spin, amplitude = np.array(segment.angular_velocity), np.array(segment.amplitude)
    wave = sin(segment.frequency * t + segment.phase) - sin(segment.phase)
    now = pivot + np.array(segment.velocity) * t + amplitude * wave
    rate = float(np.linalg.norm(spin))
    turn = rotation(spin / rate, rate * t) if rate else np.eye(3)
    velocity = np.array(segment.velocity) + amplitude * segment.frequency * cos(segment.frequency * t + segment.phase)
    return now + turn @ (point - pivot), turn @ normal, now, velocity, spin


def shortened(q: Any, limit: float) -> Any:
    size = np.linalg.norm(q)
    return q * (limit / size) if size > limit else q


class Twin:
    """Places, velocities at half steps and memories of all contacts."""

    def __init__(self, scene: SphereScene, dt: float, *, central: bool) -> None:
        self.scene, self.dt, self.central, self.step = scene, dt, central, 0
        s = scene.spheres
        self.x, self.v, self.omega = s.x.copy(), s.v.copy(), s.omega.copy()
        self.v_now = self.v.copy()
        self.memory: dict[tuple[int, int], dict[str, Any]] = {}
        self.fn: dict[tuple[int, int], float] = {}
        self.fs: dict[tuple[int, int], Vector] = {}
        self.forces(0.0)

    def advance(self) -> None:
        s = self.scene.spheres
        kick = self.dt if self.step else 0.5 * self.dt
        gain = kick * self.force / s.mass[:, None] * ~s.held
        turn = kick * self.torque / s.inertia[:, None] * s.rotating[:, None]
        self.v, self.omega = self.v + gain, self.omega + turn
        self.v_now = self.v + 0.5 * self.dt / kick * gain
        self.x = self.x + self.dt * self.v
        self.step += 1
        self.forces(self.dt)

    def forces(self, slip_dt: float) -> None:
        scene, s, n = self.scene, self.scene.spheres, len(self.scene.spheres)
        self.force = s.mass[:, None] * np.array(scene.gravity)
        self.torque = np.zeros((n, 3))
        for i in range(n):
            for j in range(i + 1, n + len(scene.walls)):
                if s.fixed[i] and (j >= n or s.fixed[j]):
                    continue
                self.contact(i, j, scene.law((i, j)), slip_dt)

    def contact(self, i: int, j: int, law: SphereLaw, slip_dt: float) -> None:
        s, n_spheres, t = self.scene.spheres, len(self.scene.spheres), self.step * self.dt
        at_wall, ri = j >= n_spheres, s.radius[i]
        if at_wall:
            wall = self.scene.walls[j - n_spheres]
            point, normal, *_ = plane_at(wall, t)
            n, overlap = -normal, ri - (self.x[i] - point) @ normal
            reduced, rj = ri, 0.0
        else:
            d, rj = self.x[j] - self.x[i], s.radius[j]
            n, overlap, reduced = d / np.linalg.norm(d), ri + rj - np.linalg.norm(d), ri * rj / (ri + rj)
        if overlap <= 0.0:
            self.memory.pop((i, j), None)
            self.fn[i, j], self.fs[i, j] = 0.0, np.zeros(3)
            return
        a = sqrt(reduced * overlap)
        old = self.memory.get((i, j)) or {
            "n": n,
            "a": a,
            "overlap": overlap,
            "spring": np.zeros(3),
            "roll": np.zeros(3),
            "twist": 0.0,
        }
        inv_mass = sum(0.0 if s.held[b].all() else 1.0 / s.mass[b] for b in ((i,) if at_wall else (i, j)))
        stiffness = 4.0 / 3.0 * law.e_star * a if law.hertz else law.kn
        tangent = 2.0 * law.e_star * a if law.hertz else law.kn
        c = 2.0 * law.beta * sqrt(tangent / inv_mass) * (sqrt(5 / 6) if law.hertz else 1.0) if inv_mass else 0.0
        foot = self.x[i] + (ri - overlap) * n
        seen = self.v_now if self.central else self.v

        def wall_velocity(time: float, place: Vector) -> Vector:
            _, _, pivot, velocity, spin = plane_at(wall, time)
            return np.asarray(velocity + np.cross(spin, place - pivot))

        vj = wall_velocity(t, foot) if at_wall else seen[j]
        pull = 4.0 * pi * law.surface_energy * reduced
        fn = stiffness * overlap + c * float((seen[i] - vj) @ n) - pull
        repulsive = max(fn + pull, 0.0)
        middle = law.slip_at == "middle"
        m = (old["n"] + n) / np.linalg.norm(old["n"] + n) if middle else n
        depth = 0.5 * (overlap + old["overlap"]) if middle else overlap
        cut = 0.5 * depth if law.lever_arm == "overlap" else 0.0
        when = max(t - 0.5 * self.dt, 0.0) if middle else t
        wj = plane_at(wall, when)[4] if at_wall else self.omega[j]
        touched = self.x[i] - 0.5 * slip_dt * self.v[i] + (ri - depth) * m if middle else foot
        u = (
            self.v[i]
            - (wall_velocity(when, touched) if at_wall else self.v[j])
            + (ri - cut) * np.cross(self.omega[i], m)
        )
        if not at_wall:
            u = u + (rj - cut) * np.cross(wj, m)
        u = u - (u @ m) * m

        def carry(q: Vector, before: Vector) -> Vector:
            return np.asarray(q - (q @ n) / (1.0 + before @ n) * (before + n))

        spring, roll, twist = old["spring"], old["roll"], old["twist"]
        if middle:
            u = carry(u, m)
            turn = rotation(n, 0.5 * slip_dt * float((self.omega[i] + wj) @ m))
            spring, roll = turn @ carry(spring, old["n"]), turn @ carry(roll, old["n"])
        else:

            def flat(q: Vector) -> Vector:
                part = q - (q @ n) * n
                return np.asarray(part * (np.linalg.norm(q) / np.linalg.norm(part))) if np.linalg.norm(part) else part

            spring, roll = flat(spring), flat(roll)
        ks = 8.0 * law.g_star * a if law.hertz else law.ks
        if not law.hertz or law.unloading == "force":
            gain = 8.0 * law.g_star * 0.5 * (a + old["a"]) if law.hertz and middle else ks
            spring = shortened(spring - gain * slip_dt * u, law.mu * repulsive)
            fs = spring
        else:
            shrink = min(1.0, a / old["a"]) if law.unloading == "rescale" else 1.0
            spring = shortened(shrink * spring - slip_dt * u, law.mu * repulsive / ks if ks else 0.0)
            fs = ks * spring
        relative = self.omega[i] - wj
        about = float(relative @ n)
        across = relative - about * n
        moment = np.zeros(3)
        inv = 0.0
        for b in (i,) if at_wall else (i, j):
            if s.rotating[b] and not s.held[b].all():
                inv += 1.0 / (s.inertia[b] + s.mass[b] * s.radius[b] ** 2)
        if law.rolling is not None:
            limit = law.rolling.mu * reduced * repulsive
            spun = STEEP * across if law.rolling.model == "constant" else roll + law.rolling.kr * slip_dt * across
            roll = shortened(spun, limit)
            moment = moment + roll
            if law.rolling.model != "constant" and np.linalg.norm(spun) < limit and inv:
                moment = moment + 2.0 * law.rolling.beta * sqrt(law.rolling.kr / inv) * across
        if law.twisting is not None:
            limit = law.twisting.mu * reduced * repulsive
            spun = STEEP * about if law.twisting.model == "constant" else twist + law.twisting.kr * slip_dt * about
            twist = float(np.clip(spun, -limit, limit))
            torque = twist
            inv = sum(1.0 / s.inertia[b] for b in ((i,) if at_wall else (i, j)) if s.rotating[b])
            if law.twisting.model != "constant" and abs(spun) < limit and inv:
                torque += 2.0 * law.twisting.beta * sqrt(law.twisting.kr / inv) * about
            moment = moment + torque * n
        arm = 0.0 if law.lever_arm == "radius" else 0.5 * overlap
        self.force[i] += fs - fn * n
        self.torque[i] += (ri - arm) * np.cross(n, fs) - moment
        if not at_wall:
            self.force[j] -= fs - fn * n
            self.torque[j] += (rj - arm) * np.cross(n, fs) + moment
        self.memory[i, j] = {"n": n, "a": a, "overlap": overlap, "spring": spring, "roll": roll, "twist": twist}
        self.fn[i, j], self.fs[i, j] = fn, fs
