"""A DEM of grains and standing walls in plain Python, written from the conventions: an oracle for `core.dem`.

Contacts come from `NurbsGrains`, which has its own tests. Everything else is derived here once more and differently: forces and
velocities are vectors at points, torques are cross products, and a contact is recognised by the position of its middle in the first body's
frame.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ninedisk.core import ContactLaw, Scene
from ninedisk.core.nurbs.intersect import NurbsGrains


def turned(v: np.ndarray) -> np.ndarray:
    return np.array([-v[1], v[0]])


def cross(a: np.ndarray, b: np.ndarray) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


@dataclass
class Contact:
    pair: tuple[int, int]
    place: np.ndarray  # in the first body's frame
    fs: float
    fn: float
    overlap: float
    normal: np.ndarray
    arms: np.ndarray  # from the bodies' positions to their own extreme points, along the normal


@dataclass
class GrainOracle:
    """Central differences with the extrapolated velocity in dashpots; no global damping; walls stand still.

    ``normal_torque`` = False plants the defect of forgetting the torque of normal forces.
    """

    scene: Scene
    dt: float
    normal_torque: bool = True
    step: int = 0
    contacts: list[Contact] = field(default_factory=list)

    def __post_init__(self) -> None:
        disks = self.scene.disks
        self.x, self.v, self.omega = disks.x.copy(), disks.v.copy(), disks.omega.copy()
        self.angle = disks.angle.copy()
        self.v_seen, self.omega_seen = self.v.copy(), self.omega.copy()
        self.grains = NurbsGrains(self.scene.outlines, disks.outline)
        self.force, self.torque = self.forces(0.0)

    def advance(self) -> None:
        disks = self.scene.disks
        gain = self.dt * (0.5 if self.step == 0 else 1.0)
        ahead = 1.0 if self.step == 0 else 0.5
        v, omega = self.v, self.omega
        self.v = v + gain * (self.force / disks.mass[:, None] + np.array(self.scene.gravity))
        self.omega = omega + gain * self.torque / disks.inertia
        self.v_seen, self.omega_seen = self.v + ahead * (self.v - v), self.omega + ahead * (self.omega - omega)
        self.x = self.x + self.dt * self.v
        self.angle = self.angle + self.dt * self.omega
        self.step += 1
        self.force, self.torque = self.forces(self.dt)

    def forces(self, slip_dt: float) -> tuple[np.ndarray, np.ndarray]:
        n = len(self.x)
        force, torque = np.zeros((n, 2)), np.zeros(n)
        found: list[Contact] = []
        every = np.array([(i, j) for i in range(n) for j in range(i + 1, n)]).reshape(-1, 2)
        index, rows = self.grains.pair_contacts(self.x, self.angle, every)
        for k, row in enumerate(zip(*(c for c in rows), strict=True)):
            i, j = (int(b) for b in every[index[k]])
            self.one(i, j, self.scene.disk_disk, row, slip_dt, force, torque, found)
        for w, wall in enumerate(self.scene.walls):
            index, rows = self.grains.wall_contacts(self.x, self.angle, wall.point, wall.normal)
            for k, row in enumerate(zip(*(c for c in rows), strict=True)):
                self.one(int(index[k]), n + w, wall.law, row, slip_dt, force, torque, found)
        self.contacts = found
        return force, torque

    def one(
        self,
        i: int,
        j: int,
        law: ContactLaw,
        row: tuple,
        slip_dt: float,
        force: np.ndarray,
        torque: np.ndarray,
        found: list,
    ) -> None:
        point, n, overlap, beyond = row[0], row[1], float(row[2]), float(row[3])
        t, wall = turned(n), j >= len(self.x)

        def velocity(body: int, at: np.ndarray, v: np.ndarray, omega: np.ndarray) -> np.ndarray:
            return np.zeros(2) if body >= len(self.x) else v[body] + omega[body] * turned(at - self.x[body])

        inv_mass = 1.0 / self.scene.disks.mass[i] + (0.0 if wall else 1.0 / self.scene.disks.mass[j])
        closing = velocity(i, point, self.v_seen, self.omega_seen) - velocity(j, point, self.v_seen, self.omega_seen)
        fn = max(0.0, law.kn * overlap + 2.0 * law.beta * np.sqrt(law.kn / inv_mass) * float(closing @ n))
        middle = point + (beyond - 0.5 * overlap) * n
        own = {"i": point + beyond * n, "j": point + (beyond - overlap) * n}
        slip_at = dict.fromkeys("ij", middle) if law.lever_arm == "overlap" else own
        acts_at = own if law.lever_arm == "radius" else dict.fromkeys("ij", middle)
        c, s = np.cos(self.angle[i]), np.sin(self.angle[i])
        place = np.array([[c, s], [-s, c]]) @ (point - self.x[i])
        fs, arms = 0.0, np.array([cross(turned(-n), own["i"] - self.x[i]), 0.0])
        if not wall:
            arms[1] = cross(turned(n), own["j"] - self.x[j])
        if law.mu > 0.0 and law.ks > 0.0:
            before = [old for old in self.contacts if old.pair == (i, j)]
            nearest = min(before, key=lambda old: float(np.hypot(*(old.place - place))), default=None)
            if nearest is not None and np.hypot(*(nearest.place - place)) < 0.2:
                fs = nearest.fs
            else:
                nearest = None
            if law.slip_at == "end":
                slip = velocity(i, slip_at["i"], self.v, self.omega) - velocity(j, slip_at["j"], self.v, self.omega)
                way = float(slip @ t) * slip_dt
            else:
                way = self.slip_of_middle(i, j, law, n, arms, nearest, slip_dt)
            fs = float(np.clip(fs - law.ks * way, -law.mu * fn, law.mu * fn))
        force[i] += -fn * n + fs * t
        lever = 1.0 if self.normal_torque else 0.0
        torque[i] += lever * cross(point - self.x[i], -fn * n) + cross(acts_at["i"] - self.x[i], fs * t)
        if not wall:
            force[j] -= -fn * n + fs * t
            torque[j] -= lever * cross(point - self.x[j], -fn * n) + cross(acts_at["j"] - self.x[j], fs * t)
        found.append(Contact((i, j), place, fs, fn, overlap, n, arms))

    def slip_of_middle(
        self, i: int, j: int, law: ContactLaw, n: np.ndarray, arms: np.ndarray, old: Contact | None, slip_dt: float
    ) -> float:
        """Slip of a step from displacements: normal weighted with the distances along it, arms the means of both ends of the step."""
        wall = j >= len(self.x)
        way_i, way_j = slip_dt * self.v[i], np.zeros(2) if wall else slip_dt * self.v[j]
        turn_i, turn_j = slip_dt * self.omega[i], 0.0 if wall else slip_dt * self.omega[j]
        mean = arms if old is None else 0.5 * (arms + old.arms)
        if wall:
            facing = np.array(self.scene.walls[j - len(self.x)].normal)
            deep = mean[0] - float((self.x[i] - 0.5 * way_i - self.scene.walls[j - len(self.x)].point) @ facing)
            middle = -facing
        else:
            now = self.x[j] - self.x[i]
            before = now - way_j + way_i
            last = (now @ n) * n
            first = last + before - now if old is None else (before @ old.normal) * old.normal
            middle = (first + last) / np.hypot(*(first + last))
            deep = float(mean.sum() - 0.5 * (before + now) @ middle)
        shorter = 0.5 * deep if law.lever_arm == "overlap" else 0.0
        slip = float((way_i - way_j) @ turned(middle)) + (mean[0] - shorter) * turn_i
        return slip + (0.0 if wall else (mean[1] - shorter) * turn_j)
