"""A slow twin of the central-difference DEM, written from the formulas and not from the kernels.

All pairs are visited, vectors are explicit, shear forces live in a dictionary, walls are functions of time. One cycle:
positions of disks and walls at ``t_n``, forces at ``t_n``, velocities at ``t_{n+1/2}``, positions at ``t_{n+1}``.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from math import cos, hypot, sin, sqrt, tan

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import BodyForce, ContactLaw, Scene, Wall, WallSegment

Vector = np.ndarray


def turn(angle: float, vector: Vector) -> Vector:
    """Rotate a vector counter-clockwise."""
    return np.array([[cos(angle), -sin(angle)], [sin(angle), cos(angle)]]) @ vector


def cross(a: Vector, b: Vector) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


def perpendicular(n: Vector) -> Vector:
    """The tangent t = (-n_y, n_x)."""
    return np.array([-n[1], n[0]])


def slid_against(before: float, after: float, path: float, stiffness: float) -> float:
    """What resisting forces take along a way: their mean work less what the spring keeps, or, if they turned, that of the last one."""
    kept = (after**2 - before**2) / (2.0 * stiffness) if stiffness > 0.0 else 0.0
    lost = 0.5 * (before + after) * path - kept
    slid = path - ((after - before) / stiffness if stiffness > 0.0 else 0.0)
    return lost if 0.5 * (before + after) * slid > 0.0 else max(after * slid, 0.0)


@dataclass
class WallState:
    """A wall at one time: a point of its surface, normal, pivot, velocity of the pivot, rotation rate."""

    point: Vector
    normal: Vector
    pivot: Vector
    pivot_velocity: Vector
    spin: float
    rate_velocity: Vector | None = None

    def velocity(self, q: Vector) -> Vector:
        return self.pivot_velocity + self.spin * perpendicular(q - self.pivot)

    def velocity_for_dashpots(self, q: Vector) -> Vector:
        return self.rate_velocity + self.spin * perpendicular(q - self.pivot)


def wall_at(wall: Wall, t: float, segment_of: float | None = None) -> WallState:
    """Exact state at time ``t``.

    The segment is the one that holds at the time ``segment_of`` (default: ``t``); where one ends and the next begins, it
    is the later one.
    """
    holds = t if segment_of is None else segment_of
    point, normal, begin = np.array(wall.point), np.array(wall.normal), 0.0
    for segment in (*wall.motion, WallSegment()):
        pivot = np.array(segment.pivot) if segment.pivot is not None else point
        if holds < begin + segment.duration:
            return _moved(segment, point, normal, pivot, t - begin)
        end = _moved(segment, point, normal, pivot, segment.duration)
        point, normal, begin = end.point, end.normal, begin + segment.duration
    raise AssertionError("the closing segment of rest is endless")


def _moved(segment: WallSegment, point: Vector, normal: Vector, pivot: Vector, tau: float) -> WallState:
    phase = segment.frequency * tau + segment.phase
    shift = np.array(segment.velocity) * tau
    shift = shift + np.array(segment.amplitude) * (sin(phase) - sin(segment.phase))
    shift = shift + np.array(segment.tan_lever) * tan(segment.tan_rate * tau)
    rate = np.array(segment.velocity) + np.array(segment.amplitude) * segment.frequency * cos(phase)
    rate = rate + np.array(segment.tan_lever) * segment.tan_rate / cos(segment.tan_rate * tau) ** 2
    angle = segment.angular_velocity * tau
    return WallState(
        point=pivot + shift + turn(angle, point - pivot),
        normal=turn(angle, normal),
        pivot=pivot + shift,
        pivot_velocity=rate,
        spin=segment.angular_velocity,
    )


class Oracle:
    """State of a run; `run` gives back a `History` with every pair watched.

    ``events`` counts what happened to contacts: ``close, open, stick, slip, no-tension``.
    """

    def __init__(self, scene: Scene, numerics: Numerics) -> None:
        assert numerics.contact_dt is not None
        self.scene, self.numerics, self.dt = scene, numerics, numerics.contact_dt
        self.n_disks = len(scene.disks)
        self.x, self.v, self.omega = (np.array(getattr(scene.disks, name)) for name in ("x", "v", "omega"))
        self.v_before = self.v.copy()
        self.angle = np.zeros(self.n_disks)
        self.omega_before = self.omega.copy()
        self.shear = dict(scene.initial_shear)
        self.bending: dict[tuple[int, int], float] = {}
        self.fed, self.rate_losses = 0.0, Counter[str]()
        self.losses: Counter[str] = Counter()
        self.normal: dict[tuple[int, int], float] = {}
        self.gap: dict[tuple[int, int], float] = {}
        self.step, self.wall_work = 0, 0.0
        self.loads_before: list[tuple[Vector, float]] = []
        self.events: Counter[str] = Counter()
        self.pairs = [(i, j) for i in range(self.n_disks) for j in range(i + 1, scene.n_bodies)]

    def place(self) -> None:
        """Walls at ``t_n``; their velocities are those of the middle of the step that ends there, about the pivot at ``t_n``.

        Dashpots see the pivot's velocity at ``t_n`` in the central form.
        """
        t, middle = self.step * self.dt, max(self.step - 0.5, 0.0) * self.dt
        self.walls, self.walls_midway = [], []
        for wall in self.scene.walls:
            pose, mean, about = wall_at(wall, t), wall_at(wall, middle), wall_at(wall, t, segment_of=middle)
            self.walls_midway.append(mean)
            seen = mean if self.numerics.damping_form == "lagged" else about
            self.walls.append(
                WallState(pose.point, pose.normal, about.pivot, mean.pivot_velocity, mean.spin, seen.pivot_velocity)
            )

    def find_forces(self) -> None:
        """Forces, torques and wall loads at ``t_n``."""
        self.place()
        self.force, self.torque = np.zeros((self.n_disks, 2)), np.zeros(self.n_disks)
        self.loads = [(np.zeros(2), 0.0) for _ in self.walls]
        self.rate_losses = Counter()
        self._push()
        for pair in self.pairs:
            if pair[1] < self.n_disks:
                self._disk_disk(*pair)
            else:
                self._disk_wall(*pair)
        for state, before, now in zip(self.walls, self.loads_before, self.loads, strict=False):
            force, torque = 0.5 * (before[0] + now[0]), 0.5 * (before[1] + now[1])
            power = force @ state.pivot_velocity + (torque - cross(state.pivot, force)) * state.spin
            self.wall_work -= self.dt * power
        self.loads_before = self.loads

    def _push(self) -> None:
        """Forces of the scene, as means over the time of the kick; their work as what they do while they are constant."""
        for load in self.scene.forces:
            i, path, turn = load.disk, self.dt * self.v[load.disk], self.dt * self.omega[load.disk]
            shares = [self._share(load, self.step), self._share(load, self.step - 1)]
            if self.step > 0:
                self.fed += 0.5 * sum(shares) * (float(np.array(load.force) @ path) + load.torque * float(turn))
            self.force[i] += shares[0] * np.array(load.force)
            self.torque[i] += shares[0] * load.torque

    def _share(self, load: BodyForce, step: int) -> float:
        begin, end = max(step - 0.5, 0.0) * self.dt, (step + 0.5) * self.dt
        if step < 0:
            return 0.0
        return max(min(end, load.end) - max(begin, load.begin), 0.0) / (end - begin)

    def seen(self, i: int) -> Vector:
        """Velocity of a disk that dashpots see: v_n extrapolated from the last two half steps, or v_{n-1/2}."""
        if self.step == 0 or self.numerics.damping_form == "lagged":
            return self.v[i]
        change = self.v[i] - self.v_before[i]
        return self.v[i] + (change if self.step == 1 else 0.5 * change)

    def spin_seen(self, i: int) -> float:
        """Spin of a disk that rolling resistance sees."""
        if self.step == 0 or self.numerics.damping_form == "lagged":
            return float(self.omega[i])
        change = self.omega[i] - self.omega_before[i]
        return float(self.omega[i] + (change if self.step == 1 else 0.5 * change))

    def _bend(self, pair: tuple[int, int], law: ContactLaw, fn: float, overlap: float) -> float:
        """Torque of rolling resistance on the second body of a pair."""
        (i, j), disks, rolling = pair, self.scene.disks, law.rolling
        before, self.bending[pair] = self.bending.get(pair, 0.0), 0.0
        if rolling is None:
            return 0.0
        of_wall = j >= self.n_disks
        spin = self.walls[j - self.n_disks].spin if of_wall else None
        omega = self.omega[i] - (spin if of_wall else self.omega[j])
        turned = omega * self.dt if self.step > 0 else 0.0
        if overlap <= 0.0:
            # What is lost at walls after the last step in contact is left out.
            self.losses["rolling"] += slid_against(before, 0.0, 0.0 if of_wall else turned, rolling.kr)
            return 0.0
        seen = self.spin_seen(i) - (spin if of_wall else self.spin_seen(j))
        reduced = disks.radius[i] if of_wall else 1.0 / (1.0 / disks.radius[i] + 1.0 / disks.radius[j])
        most = rolling.mu * reduced * max(fn + law.cohesion * overlap, 0.0)
        inverse = sum(
            1.0 / (disks.inertia[k] + disks.mass[k] * disks.radius[k] ** 2)
            for k in pair
            if k < self.n_disks and disks.rotating[k]
        )
        damped = 0.0
        if rolling.model == "constant":
            spring = most * float(np.sign(omega))
        elif rolling.model == "viscous":
            spring = most * abs(seen) * reduced * float(np.sign(seen))
        else:
            spring = float(np.clip(before + rolling.kr * turned, -most, most))
            if abs(spring) < most:
                damped = 2.0 * rolling.beta * sqrt(rolling.kr / inverse) * seen if inverse > 0.0 else 0.0
        self.events["bend" if abs(spring) < most else "roll"] += 1
        self.losses["rolling"] += slid_against(before, spring, turned, rolling.kr)
        self.rate_losses["rolling"] += damped * seen
        self.bending[pair] = spring
        return spring + damped

    def x_for_slip(self, i: int, law: ContactLaw) -> Vector:
        """Centre of a disk where the slip of the step is measured."""
        if law.slip_at == "end" or self.step == 0:
            return self.x[i]
        return self.x[i] - 0.5 * self.dt * self.v[i]

    def _idle(self, pair: tuple[int, int], overlap: float) -> bool:
        """Whether a pair is apart and remembers nothing: there is its gap to note and nothing else."""
        if overlap > 0.0 or self.normal.get(pair) or self.shear.get(pair) or self.bending.get(pair):
            return False
        self.gap[pair], self.normal[pair], self.shear[pair] = -overlap, 0.0, 0.0
        return True

    def _disk_disk(self, i: int, j: int) -> None:
        radius, mass = self.scene.disks.radius, self.scene.disks.mass
        between = self.x[j] - self.x[i]
        distance = hypot(*between)
        overlap = radius[i] + radius[j] - distance
        if self._idle((i, j), overlap):
            return
        n = between / distance
        law = self.scene.law((i, j))
        shorter = 0.5 * overlap if law.lever_arm != "radius" else 0.0
        arm_i, arm_j = radius[i] - shorter, radius[j] - shorter
        apart = self.x_for_slip(j, law) - self.x_for_slip(i, law)
        n_slip = apart / hypot(*apart)
        less_slip = 0.5 * (radius[i] + radius[j] - hypot(*apart)) if law.lever_arm == "overlap" else 0.0
        at_i = self.v[i] + self.omega[i] * (radius[i] - less_slip) * perpendicular(n_slip)
        at_j = self.v[j] + self.omega[j] * (radius[j] - less_slip) * perpendicular(-n_slip)
        m_eff = 1.0 / (1.0 / mass[i] + 1.0 / mass[j])
        closing = (self.seen(i) - self.seen(j)) @ n
        slip = (at_i - at_j) @ perpendicular(n_slip)
        deep = radius[i] + radius[j] - hypot(*apart)
        more = (less_slip - 0.5 * deep * (law.lever_arm != "radius")) * (self.omega[i] + self.omega[j])
        closed = self._contact((i, j), law, overlap, closing, slip, m_eff, more)
        bending = self._bend((i, j), law, self.normal[i, j], overlap)
        if not closed:
            return
        self.torque[i] -= bending
        self.torque[j] += bending
        on_i = -self.normal[i, j] * n + self.shear[i, j] * perpendicular(n)
        self.force[i] += on_i
        self.force[j] -= on_i
        self.torque[i] += arm_i * cross(n, on_i)
        self.torque[j] += arm_j * cross(-n, -on_i)

    def _disk_wall(self, i: int, body: int) -> None:
        wall = self.walls[body - self.n_disks]
        radius = self.scene.disks.radius[i]
        height = (self.x[i] - wall.point) @ wall.normal
        overlap = radius - height
        if self._idle((i, body), overlap):
            return
        law, n = self.scene.law((i, body)), -wall.normal
        foot = self.x[i] + height * n
        q = foot + 0.5 * overlap * n if law.wall_velocity_at == "mid-overlap" else foot
        arm = radius - (0.5 * overlap if law.lever_arm != "radius" else 0.0)
        closing = (self.seen(i) - wall.velocity_for_dashpots(q)) @ n
        midway = self.walls_midway[body - self.n_disks] if law.slip_at == "middle" else wall
        slip = self._wall_slip(i, midway, law)
        # The force on the wall acts on its surface, that on the disk at the arm of its torque.
        surface = replace(
            law, lever_arm="radius" if law.lever_arm == "radius" else "overlap", wall_velocity_at="surface"
        )
        more = self._wall_slip(i, midway, surface) - slip
        closed = self._contact((i, body), law, overlap, closing, slip, float(self.scene.disks.mass[i]), more)
        bending = self._bend((i, body), law, self.normal[i, body], overlap)
        if not closed:
            return
        self.torque[i] -= bending
        on_i = -self.normal[i, body] * n + self.shear[i, body] * perpendicular(n)
        self.force[i] += on_i
        self.torque[i] += arm * cross(n, on_i)
        load, torque = self.loads[body - self.n_disks]
        self.loads[body - self.n_disks] = (load - on_i, torque - cross(foot, on_i) + bending)

    def _wall_slip(self, i: int, wall: WallState, law: ContactLaw) -> float:
        """Slip velocity at a wall that is there where the slip of the step is measured."""
        radius, x, n = self.scene.disks.radius[i], self.x_for_slip(i, law), -wall.normal
        foot = x + ((x - wall.point) @ wall.normal) * n
        overlap = radius - hypot(*(foot - x))
        q = foot + 0.5 * overlap * n if law.wall_velocity_at == "mid-overlap" else foot
        arm = radius - (0.5 * overlap if law.lever_arm == "overlap" else 0.0)
        return float((self.v[i] + self.omega[i] * arm * perpendicular(n) - wall.velocity(q)) @ perpendicular(n))

    def _contact(
        self,
        pair: tuple[int, int],
        law: ContactLaw,
        overlap: float,
        closing: float,
        slip: float,
        m_eff: float,
        more: float,
    ) -> bool:
        """Update ``normal``, ``shear`` and ``gap`` of a pair, whose shear force does its work at a rate of slip that is higher by ``more``;
        False if it is open."""
        was_closed = self.normal.get(pair, 0.0) > 0.0
        before, slid = self.shear.get(pair, 0.0), slip * self.dt if self.step > 0 else 0.0
        self.gap[pair], self.normal[pair] = -overlap, 0.0
        if overlap <= 0.0:
            self.shear[pair] = 0.0
            if pair[1] < self.n_disks:
                self._slide_loss(law, before, 0.0, slid, more)
            else:
                self._slide_loss(law, before, 0.0, 0.0, 0.0)
            self.events["open"] += was_closed
            return False
        self.events["close"] += not was_closed and self.step > 0
        spring = (law.kn - law.cohesion) * overlap
        fn = spring + 2.0 * law.beta * sqrt(m_eff * law.kn) * closing
        self.events["no-tension"] += fn < 0.0 and law.cohesion == 0.0
        self.events["pull"] += fn < 0.0 and law.cohesion > 0.0
        self.normal[pair] = fn = max(fn, 0.0) if law.cohesion == 0.0 else fn
        self.rate_losses["dashpot"] += (fn - spring) * closing
        trial = before - law.ks * slid
        cap = law.mu * max(fn + law.cohesion * overlap, 0.0)
        self.shear[pair] = float(np.clip(trial, -cap, cap))
        if cap > 0.0 and law.ks > 0.0:
            self.events["slip" if abs(trial) > cap else "stick"] += 1
        self._slide_loss(law, before, self.shear[pair], slid, more)
        return True

    def _slide_loss(self, law: ContactLaw, before: float, after: float, slid: float, more: float) -> None:
        """What friction takes from a shear spring, and what the law takes, whose force works on more than the slip."""
        if self.step > 0 and law.shear_stiffness > 0.0:
            self.losses["law"] -= 0.5 * (before + after) * more * self.dt
            self.losses["friction"] += slid_against(-before, -after, slid, law.ks)

    def kicked(self, old: Vector, acceleration: Vector) -> Vector:
        """Velocity half a step later than ``t_n`` from the one before (from ``v_0`` at the start)."""
        xi, dt = self.scene.xi, self.dt
        if self.step == 0:
            return old + 0.5 * dt * (acceleration - xi * old)
        if self.numerics.damping_form == "central":
            return ((1.0 - 0.5 * xi * dt) * old + dt * acceleration) / (1.0 + 0.5 * xi * dt)
        return old + dt * (acceleration - xi * old)

    def new_velocities(self) -> tuple[Vector, Vector]:
        disks = self.scene.disks
        v = self.kicked(self.v, self.force / disks.mass[:, None] + np.array(self.scene.gravity))
        omega = np.where(disks.rotating, self.kicked(self.omega, self.torque / disks.inertia), self.omega)
        return v, omega

    def move(self) -> None:
        """To ``t_{n+1}``."""
        v, omega = self.new_velocities()
        self._note_rates(0.5 if self.step == 0 else 1.0, v, omega)
        self.v_before, self.v, self.omega_before, self.omega = self.v, v, self.omega, omega
        self.x, self.angle = self.x + self.dt * v, self.angle + self.dt * omega
        self.step += 1

    def _note_rates(self, share: float, v: Vector, omega: Vector) -> None:
        """Add a share of a step's losses by forces that depend on velocities; global damping acts along the path of the step's kick."""
        for name, power in self.rate_losses.items():
            self.losses[name] += share * self.dt * power
        self.losses["damping"] += self._damping(v, omega, 1.0 if self.step == 0 else 0.5) * share

    def _damping(self, v: Vector, omega: Vector, mean: float) -> float:
        """Work against global damping in a step about ``t_n`` [J], its path being a mean of the velocities before and after."""
        disks, central = self.scene.disks, self.numerics.damping_form == "central" and self.step > 0
        total = 0.0
        for weight, old, new in (
            (disks.mass[:, None], self.v, v),
            (np.where(disks.rotating, disks.inertia, 0.0), self.omega, omega),
        ):
            seen = 0.5 * (old + new) if central else old
            total += float(np.sum(weight * seen * (old + mean * (new - old))))
        return self.scene.xi * self.dt * total

    def run(self) -> History:
        """Run ``n_steps`` contact steps and record all of them."""
        count = self.numerics.n_steps
        steps = np.arange(count + 1)
        names = ("kinetic", "elastic", "gravity", "wall_work", "elastic_rolling", "force_work")
        names += ("friction_loss", "dashpot_loss", "rolling_loss", "damping_loss", "law_loss")
        history = History.empty(
            steps,
            steps * self.dt,
            n_disks=self.n_disks,
            n_walls=len(self.scene.walls),
            pairs=tuple(self.pairs),
            energies=names,
        )
        for row in range(count + 1):
            self.find_forces()
            self._record(history, row)
            self.move()
        return history

    def _record(self, h: History, row: int) -> None:
        disks = self.scene.disks
        v, omega = (
            (self.v, self.omega)
            if row == 0
            else (0.5 * (a + b) for a, b in zip((self.v, self.omega), self.new_velocities(), strict=True))
        )
        h.x[row], h.v[row], h.angle[row], h.omega[row] = self.x, v, self.angle, omega
        elastic, rolling = 0.0, 0.0
        for c, pair in enumerate(self.pairs):
            h.gap[row, c], h.fn[row, c], h.fs[row, c] = self.gap[pair], self.normal[pair], self.shear[pair]
            if self.gap[pair] >= 0.0:
                continue
            law = self.scene.law(pair)
            elastic += 0.5 * (law.kn - law.cohesion) * max(-self.gap[pair], 0.0) ** 2
            if law.rolling is not None and law.rolling.kr > 0.0:
                rolling += 0.5 * self.bending.get(pair, 0.0) ** 2 / law.rolling.kr
            elastic += 0.5 * self.shear[pair] ** 2 / law.ks if law.ks > 0.0 else 0.0
        for w, (wall, (load, _)) in enumerate(zip(self.walls, self.loads, strict=True)):
            h.wall_point[row, w], h.wall_force[row, w] = wall.point, load
            h.wall_angle[row, w] = np.arctan2(wall.normal[1], wall.normal[0])
        h.energy["kinetic"][row] = 0.5 * np.sum(disks.mass * np.sum(v**2, axis=1))
        h.energy["kinetic"][row] += 0.5 * np.sum((disks.inertia * omega**2)[disks.rotating])
        h.energy["elastic"][row], h.energy["elastic_rolling"][row] = elastic + rolling, rolling
        h.energy["force_work"][row] = self.fed
        half = 0.0 if row == 0 else 0.5 * self.dt
        for name in ("friction", "dashpot", "rolling", "law"):
            h.energy[f"{name}_loss"][row] = self.losses[name] + half * self.rate_losses[name]
        h.energy["damping_loss"][row] = self.losses["damping"]
        if row > 0:
            h.energy["damping_loss"][row] += 0.5 * self._damping(*self.new_velocities(), 0.0)
        h.energy["gravity"][row] = -np.sum(disks.mass * (self.x @ np.array(self.scene.gravity)))
        h.energy["wall_work"][row] = self.wall_work
