"""The DEM of spheres once more, in plain NumPy: whole vectors, rotation matrices, all pairs at every step, a dictionary for memory."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core import Numerics
from ninedisk.core.law import SphereLaw
from ninedisk.core.scene import PlaneWall, SphereScene

Vector = NDArray[np.float64]


def rotation(axis: Vector, angle: float) -> Vector:
    """Matrix of a turn about a unit axis: I + sin K + (1 - cos) K^2."""
    x, y, z = axis
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * k @ k


def turn(a: Vector, b: Vector) -> Vector:
    """Matrix that takes the unit vector a into b on the shortest way: I + K + K^2/(1 + a.b) with the matrix K of a x b."""
    x, y, z = np.cross(a, b)
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + k + k @ k / (1.0 + a @ b)


def unit(a: Vector) -> Vector:
    return a / np.linalg.norm(a)


def shortened(a: Vector, limit: float) -> Vector:
    size = float(np.linalg.norm(a))
    return a if size <= limit else a * (limit / size)


@dataclass
class Pose:
    """A plane at one time: a point, its normal, the pivot and its velocity, the spin."""

    point: Vector
    normal: Vector
    pivot: Vector
    velocity: Vector
    spin: Vector

    def velocity_at(self, place: Vector) -> Vector:
        return self.velocity + np.cross(self.spin, place - self.pivot)


def pose(wall: PlaneWall, t: float) -> Pose:
    """Motion of a plane, segment by segment."""
    point, normal = np.array(wall.point), np.array(wall.normal)
    for segment in wall.motion:
        tau = min(t, segment.duration)
        pivot = point if segment.pivot is None else np.array(segment.pivot)
        velocity, amplitude, spin = (
            np.array(each) for each in (segment.velocity, segment.amplitude, segment.angular_velocity)
        )
        phase = segment.frequency * tau + segment.phase
        to = pivot + velocity * tau + amplitude * (np.sin(phase) - np.sin(segment.phase))
        rate = float(np.linalg.norm(spin))
        matrix = rotation(spin / rate, rate * tau) if rate > 0.0 else np.eye(3)
        point, normal = to + matrix @ (point - pivot), matrix @ normal
        if t < segment.duration:
            return Pose(point, normal, to, velocity + amplitude * segment.frequency * np.cos(phase), spin)
        t -= segment.duration
    return Pose(point, normal, point, np.zeros(3), np.zeros(3))


@dataclass
class Touch:
    """What a contact remembers and shows."""

    n: Vector
    overlap: float
    radius: float
    spring: Vector
    rolled: Vector
    twisted: float
    fn: float = 0.0
    fs: Vector = None  # type: ignore[assignment]


class Twin:
    """The state of a run; `step` goes on by a contact step."""

    def __init__(self, scene: SphereScene, numerics: Numerics) -> None:
        assert numerics.contact_dt is not None
        s = scene.spheres
        self.scene, self.dt, self.lagged = scene, numerics.contact_dt, numerics.damping_form == "lagged"
        self.x, self.v, self.omega, self.angle = s.x.copy(), s.v.copy(), s.omega.copy(), np.zeros_like(s.x)
        self.steps, self.touches = 0, dict[tuple[int, int], Touch]()
        self.moves = ~s.held
        self.inv_mass = np.where(s.held.all(axis=1), 0.0, 1.0 / s.mass)
        self.inv_inertia = np.where(s.rotating, 1.0 / s.inertia, 0.0)
        self.forces(self.v, self.omega, 0.0)

    def step(self) -> None:
        kick = self.dt if self.steps else 0.5 * self.dt
        a = self.moves * (self.inv_mass[:, None] * self.force)
        alpha = self.inv_inertia[:, None] * self.torque
        self.v = self.v + kick * a
        self.omega = self.omega + kick * alpha
        self.x = self.x + self.dt * self.v
        self.angle = self.angle + self.dt * self.omega
        self.steps += 1
        # Velocities at the step's end, extrapolated by the force at its beginning.
        ahead = 0.0 if self.lagged else 0.5 * self.dt
        self.forces(self.v + ahead * a, self.omega + ahead * alpha, self.dt)

    def now(self) -> tuple[Vector, Vector]:
        """Velocities and spins at the present time."""
        half = 0.5 * self.dt if self.steps else 0.0
        return (
            self.v + half * self.moves * self.inv_mass[:, None] * self.force,
            self.omega + half * self.inv_inertia[:, None] * self.torque,
        )

    def forces(self, seen: Vector, seen_spin: Vector, dt: float) -> None:
        spheres, n, t = self.scene.spheres, len(self.x), self.steps * self.dt
        self.force = np.outer(np.where(self.inv_mass > 0.0, spheres.mass, 0.0), self.scene.gravity)
        self.torque, self.load = np.zeros((n, 3)), np.zeros((len(self.scene.walls), 3))
        poses = [pose(wall, t) for wall in self.scene.walls]
        middles = [pose(wall, max(t - 0.5 * self.dt, 0.0)) for wall in self.scene.walls]
        fixed, fresh = spheres.fixed, dict[tuple[int, int], Touch]()
        for i in range(n):
            for j in range(i + 1, n + len(poses)):
                if fixed[i] and (j >= n or fixed[j]):
                    continue
                there = (poses[j - n], middles[j - n]) if j >= n else None
                found = self.touch(i, j, there, (seen, seen_spin), dt)
                if found is not None:
                    fresh[i, j] = found
        self.touches = fresh

    def touch(
        self, i: int, j: int, planes: tuple[Pose, Pose] | None, by_dashpots: tuple[Vector, Vector], dt: float
    ) -> Touch | None:
        seen, seen_spin = by_dashpots
        spheres, law = self.scene.spheres, self.scene.law((i, j))
        x, ri = self.x[i], float(spheres.radius[i])
        if planes is None:
            rj = float(spheres.radius[j])
            n = unit(self.x[j] - x)
            overlap = ri + rj - float(np.linalg.norm(self.x[j] - x))
            reduced = 1.0 / (1.0 / ri + 1.0 / rj)
            inv_mass = self.inv_mass[i] + self.inv_mass[j]
        else:
            n = -planes[0].normal
            overlap, reduced, inv_mass, rj = ri - float((planes[0].point - x) @ n), ri, self.inv_mass[i], 0.0
        neck = 0.0
        if law.sticks:
            neck = (np.pi * law.surface_energy * reduced**2 / (4.0 * law.e_star)) ** (1.0 / 3.0)
        if overlap <= (-3.0 * neck**2 / reduced if (i, j) in self.touches else 0.0):
            return None
        a = np.sqrt(reduced * max(overlap, 0.0))
        if law.sticks:
            # overlap = a^2/R - 2 sqrt(pi g a/E*), the larger one of two real roots
            roots = np.roots([1.0, 0.0, 0.0, -4.0, -overlap * reduced / neck**2])
            a = neck * max(float(each.real) for each in roots if abs(each.imag) < 1e-9) ** 2
        old = self.touches.get((i, j)) or Touch(n, overlap, a, np.zeros(3), np.zeros(3), 0.0)
        foot = x + (ri - overlap) * n
        # Along the normal.
        if law.hertz:
            elastic = 4.0 / 3.0 * law.e_star * a**3 / reduced
            if law.sticks:
                elastic -= 4.0 * np.sqrt(np.pi * law.surface_energy * law.e_star * a**3)
            damping = 2.0 * np.sqrt(5.0 / 6.0) * law.beta * np.sqrt(2.0 * law.e_star * a / inv_mass)
            ks = 8.0 * law.g_star * a
        else:
            elastic, damping, ks = law.kn * overlap, 2.0 * law.beta * np.sqrt(law.kn / inv_mass), law.ks
        if planes is None:
            other = seen[j]
        elif not self.lagged:
            other = planes[0].velocity_at(foot)
        else:
            other = planes[1].velocity_at(foot - 0.5 * dt * planes[1].velocity)
        repulsive = elastic + damping * float((seen[i] - other) @ n)
        fn = repulsive - (0.0 if law.sticks else 4.0) * np.pi * law.surface_energy * reduced
        pulled = 3.0 * law.friction_pull if law.sticks else 4.0 * (law.friction_pull - 1.0)
        repulsive += pulled * np.pi * law.surface_energy * reduced
        limit = law.mu * max(repulsive, 0.0)
        # Along the surface.
        middle = law.slip_at == "middle"
        shown = unit(old.n + n) if middle else n
        depth = 0.5 * (overlap + old.overlap) if middle else overlap
        cut = 0.5 * depth if law.lever_arm == "overlap" else 0.0
        arm_i, arm_j = (ri - cut) * shown, -(rj - cut) * shown
        arm_middle = (ri - depth) * shown
        wi = self.omega[i]
        if planes is None:
            wj = self.omega[j]
            u = self.v[i] + np.cross(wi, arm_i) - self.v[j] - np.cross(wj, arm_j)
        else:
            wj = planes[1].spin
            place = x - 0.5 * dt * self.v[i] + arm_middle if middle else foot - 0.5 * dt * planes[1].velocity
            u = self.v[i] + np.cross(wi, arm_i) - planes[1].velocity_at(place)
        u = u - (u @ shown) * shown
        if middle:
            twist = 0.5 * dt * float((wi + wj) @ shown)
            half = np.eye(3) + 0.5 * twist * np.cross(n, np.eye(3)).T
            u = half @ turn(shown, n) @ u
            carry = rotation(n, twist) @ turn(old.n, n)
            spring, rolled = carry @ old.spring, carry @ old.rolled
        else:
            spring, rolled = (flattened(q, n) for q in (old.spring, old.rolled))
        if law.hertz and law.unloading != "force":
            if law.unloading == "rescale" and a < old.radius:
                spring = spring * (a / old.radius)
            spring = shortened(spring - dt * u, limit / ks)
            fs = ks * spring
        else:
            mean = 8.0 * law.g_star * 0.5 * (a + old.radius) if law.hertz and middle else ks
            fs = spring = shortened(spring - mean * dt * u, limit)
        # Resistances.
        spin = wi - wj
        about = float(spin @ n)
        moment, rolled, twisted = np.zeros(3), rolled, old.twisted
        across = spin - about * n
        other = seen_spin[j] if planes is None else planes[1 if self.lagged else 0].spin
        damped = seen_spin[i] - other
        inv_i = self.inv_inertia
        if (law_r := law.rolling) is not None:
            cap = law_r.mu * reduced * max(repulsive, 0.0)
            if law_r.model == "constant":
                rolled = moment = cap * unit(across)
            else:
                rolled = rolled + law_r.kr * dt * (half @ across if middle else across)
                slides = float(np.linalg.norm(rolled)) >= cap
                rolled = moment = shortened(rolled, cap)
                inverse = sum(self.about_contact(b) for b in ((i, j) if planes is None else (i,)))
                if not slides and inverse > 0.0:
                    moment = moment + 2.0 * law_r.beta * np.sqrt(law_r.kr / inverse) * (damped - (damped @ n) * n)
        if (law_t := law.twisting) is not None:
            cap = law_t.mu * reduced * max(repulsive, 0.0)
            if law_t.model == "constant":
                twist = twisted = cap * np.sign(about)
            else:
                twisted = twisted + law_t.kr * dt * about
                slides = abs(twisted) >= cap
                twist = twisted = float(np.clip(twisted, -cap, cap))
                inverse = inv_i[i] + (inv_i[j] if planes is None else 0.0)
                if not slides and inverse > 0.0:
                    twist += 2.0 * law_t.beta * np.sqrt(law_t.kr / inverse) * float(damped @ n)
            moment = moment + twist * n
        # On the bodies.
        push = fs - fn * n
        back = 0.5 * overlap if law.lever_arm != "radius" else 0.0
        self.force[i] += push
        self.torque[i] += np.cross((ri - back) * n, fs) - moment
        if planes is None:
            self.force[j] -= push
            self.torque[j] += np.cross(-(rj - back) * n, -fs) + moment
        else:
            self.load[j - len(self.x)] -= push
        return Touch(n, overlap, float(a), spring, rolled, float(twisted), float(fn), fs)

    def about_contact(self, i: int) -> float:
        """1/(I + m R^2); 0 for a body that does not give way."""
        if self.inv_mass[i] == 0.0 or self.inv_inertia[i] == 0.0:
            return 0.0
        radius = self.scene.spheres.radius[i]
        return float(1.0 / (1.0 / self.inv_inertia[i] + radius**2 / self.inv_mass[i]))


def flattened(q: Vector, n: Vector) -> Vector:
    """The part in the tangent plane, as long as the whole was."""
    flat = q - (q @ n) * n
    size = float(np.linalg.norm(flat))
    return flat if size == 0.0 else flat * (np.linalg.norm(q) / size)


def law_of(**changes: Any) -> SphereLaw:
    """Soft steel-like spheres, Hertz-Mindlin unless ``kn`` is given."""
    usual = {"kn": 0.0} if "kn" in changes else {"e_star": 5e6, "g_star": 1.5e6}
    return SphereLaw(**{**usual, "mu": 0.4, "beta": 0.15, **changes})
