"""One simulation in ESyS-Particle.

A step of ESyS-Particle takes (positions t_n, velocities v_{n-1/2}) and the walls where they are, computes the forces at t_n, and
ends with (positions t_{n+1}, velocities v_{n+1/2}). The walls are therefore put to their places of t_n before that step. With
a = xi dt/2:

- central damping ``v+ = ((1 - a) v- + dt F/m)/(1 + a)`` is an undamped step with mass ``m (1 + a)`` that starts from
  ``v- (1 - a)/(1 + a)``; gravity, an acceleration, is divided by ``1 + a``;
- lagged damping ``v+ = v- + dt (F/m - xi v-)`` is an undamped step that starts from ``v- (1 - 2 a)``;
- both have ``v_n = (v- + v+)/2``.

ESyS-Particle does not tell the forces of single contacts. They are computed here by its own law from its own positions, and every
sample is checked: the change of each disk's momentum in ESyS-Particle must be what these forces make of it, and its walls' forces
their sums.
"""

import time

import numpy as np
from esys.lsm import GravityPrms, NRotElasticPrms, NRotElasticWallPrms, NRotSphere
from esys.lsm.util import BoundingBox, Vec3

ROUND_OFF = 1e-9
ULPS = 16.0
"""Of the largest force so far, and of the momenta per step: agreement of contact forces with changes of momentum."""


class Run:
    """One simulation."""

    def __init__(self, engine, request):
        scene, extra = request["scene"], request["extra"]
        disks = scene["disks"]
        self.engine, self.n = engine, len(disks["radius"])
        if not self.n:
            raise ValueError("there is no disk: ESyS-Particle needs at least one")
        self.x0, self.v0 = (np.array(disks[key]).reshape(self.n, 2) for key in ("x", "v"))
        self.radius, self.mass, self.inertia = (np.array(disks[key]) for key in ("radius", "mass", "inertia"))
        self.rotating = np.zeros(self.n, dtype=bool)  # spheres without rotation
        self.gravity, self.xi = np.array(scene["gravity"]), scene["xi"]
        self.substeps, self.dt = extra["substeps"], extra["contact_dt"]
        a, central = 0.5 * self.xi * self.dt, request["numerics"]["damping_form"] == "central"
        self.inflate = 1.0 + a if central else 1.0
        self.decay = (1.0 - a) / (1.0 + a) if central else 1.0 - 2.0 * a
        self.kn, self.walls = scene["disk_disk"]["kn"], scene["walls"]
        self.path = np.load(extra["wall_path"])
        self.pairs = [tuple(pair) for pair in request["watch"]]
        self.samples, self.largest = [], 0.0
        self._build(extra["reach"])

    def _build(self, reach):
        engine, radius = self.engine, float(self.radius.max())
        self.spacing, self.skin = 2.5 * radius, 0.1 * float(self.radius.min())
        engine.initNeighbourSearch(particleType="NRotSphere", gridSpacing=self.spacing, verletDist=self.skin)
        engine.setTimeStepSize(self.dt)
        half = reach + 4.0 * self.spacing
        engine.setSpatialDomain(
            BoundingBox(Vec3(-half, -half, -2.0 * self.spacing), Vec3(half, half, 2.0 * self.spacing))
        )
        engine.force2dComputations(True)
        for i, (x, y) in enumerate(self.x0):
            engine.createParticle(
                NRotSphere(
                    id=i, posn=vector((x, y)), radius=float(self.radius[i]), mass=float(self.mass[i] * self.inflate)
                )
            )
        engine.createInteractionGroup(NRotElasticPrms(name="disks", normalK=self.kn, scaling=False))
        for w, wall in enumerate(self.walls):
            engine.createWall(name=f"wall{w}", posn=vector(wall["point"]), normal=vector(wall["normal"]))
            engine.createInteractionGroup(
                NRotElasticWallPrms(name=f"contact{w}", wallName=f"wall{w}", normalK=wall["law"]["kn"])
            )
        if self.gravity.any():
            engine.createInteractionGroup(GravityPrms(name="gravity", acceleration=vector(self.gravity / self.inflate)))

    def start(self):
        """Velocities from which the step at ``t_0`` makes ``v_{1/2} = v_0 + dt/2 (F_0/m - xi v_0)``."""
        rate = self.total(self.contacts(self.x0, self.path[0])) / self.mass[:, None]
        half = self.v0 + 0.5 * self.dt * (rate - self.xi * self.v0)
        self.first = half - self.dt * rate / self.inflate
        self.set_velocities(self.first)

    def set_velocities(self, v):
        for i in range(self.n):
            self.engine.setParticleVelocity(i, vector(v[i]))

    def state(self):
        """Positions [m] and velocities [m/s] that ESyS-Particle holds."""
        x, v = np.empty((self.n, 2)), np.empty((self.n, 2))
        particles = self.engine.getParticleList()
        if len(particles) != self.n:
            raise RuntimeError(f"ESyS-Particle holds {len(particles)} of {self.n} disks: the others left its domain")
        for particle in particles:
            i, place, velocity = particle.getId(), particle.getPosn(), particle.getVelocity()
            x[i], v[i] = (place[0], place[1]), (velocity[0], velocity[1])
        return x, v

    def advance(self, sampled):
        """All steps; returns the seconds that are not spent on samples."""
        wanted, last = {step * self.substeps for step in sampled}, max(sampled) * self.substeps
        damped, rest = self.decay != 1.0, len(self.path) - 1
        x, v = self.x0, self.first
        spent, begin = 0.0, time.perf_counter()
        for step in range(last + 1):
            if 0 < step <= rest:
                self._move_walls(step)
            started = v
            if damped and step:
                started = self.decay * v
                self.set_velocities(started)
            self.engine.runTimeStep()
            told = step in wanted
            if told or damped or step + 1 in wanted:
                before, (x_next, v_next) = (x, v), self.state()
                if told:
                    spent += time.perf_counter() - begin
                    self._sample(step, *before, started, v_next)
                    begin = time.perf_counter()
                x, v = x_next, v_next
        return spent + time.perf_counter() - begin

    def _move_walls(self, step):
        for w, way in enumerate(self.path[step, :, 0:2] - self.path[step - 1, :, 0:2]):
            if way.any():
                self.engine.moveWallBy(f"wall{w}", vector(way))

    def contacts(self, x, pose):
        """Touching pairs: ``{(i, j): (fn [N], overlap [m], normal from i to j)}``."""
        found = {}
        for i in range(self.n):
            d = x[i + 1 :] - x[i]
            distance = np.hypot(d[:, 0], d[:, 1])
            overlap = self.radius[i] + self.radius[i + 1 :] - distance
            for k in np.flatnonzero(overlap > 0.0):
                found[i, i + 1 + int(k)] = (float(self.kn * overlap[k]), float(overlap[k]), d[k] / distance[k])
        for w, wall in enumerate(self.walls):
            normal = pose[w, 2:4]
            overlap = self.radius - (x - pose[w, 0:2]) @ normal
            for i in np.flatnonzero(overlap > 0.0):
                found[int(i), self.n + w] = (float(wall["law"]["kn"] * overlap[i]), float(overlap[i]), -normal)
        return found

    def total(self, found):
        """Forces on the disks [N], gravity included, shape (n, 2); notes the largest one."""
        force = self.mass[:, None] * self.gravity
        for (i, j), (fn, _, normal) in found.items():
            force[i] -= fn * normal
            if j < self.n:
                force[j] += fn * normal
            self.largest = max(self.largest, fn)
        self.largest = max(self.largest, float(np.abs(force).max()))
        return force

    def _sample(self, step, x, v, started, after):
        """State at ``t_n``: ``v`` is ``v_{n-1/2}``, ``started`` the velocities of the step and ``after`` those at its end."""
        pose = self.path[min(step, len(self.path) - 1)]
        found = self.contacts(x, pose)
        made = (self.mass * self.inflate)[:, None] * (after - started) / self.dt
        unsure = ROUND_OFF * (self.largest + float((self.mass[:, None] * np.abs(after)).max()) / self.dt)
        # An overlap is known to some units of round-off of the coordinates: disks that just touch may do so for one only.
        unsure += (
            max([self.kn, *(wall["law"]["kn"] for wall in self.walls)]) * ULPS * float(np.spacing(np.abs(x).max()))
        )
        off = float(np.abs(made - self.total(found)).max())
        loads = np.zeros((len(self.walls), 2))
        for w in range(len(self.walls)):
            force = self.engine.getWallForce(f"wall{w}")  # on the disks
            loads[w] = -force[0], -force[1]
            mine = sum((fn * normal for (_, j), (fn, _, normal) in found.items() if j == self.n + w), np.zeros(2))
            off = max(off, float(np.abs(loads[w] - mine).max()))
        if not off <= unsure:
            raise RuntimeError(
                f"at step {step // self.substeps} the contact forces of ESyS-Particle's positions and the momenta that it "
                f"exchanged differ by {off:g} N (allowed {unsure:g} N): it missed or added a contact"
            )
        springs = [self.kn if j < self.n else self.walls[j - self.n]["law"]["kn"] for _, j in found]
        spin = np.zeros(self.n)
        self.samples.append(
            {
                "step": step // self.substeps,
                "x": x,
                "v": 0.5 * (v + after) if step else self.v0,
                "omega": spin,
                "angle": spin,
                "forces": [(found[pair][0] if pair in found else 0.0, 0.0) for pair in self.pairs],
                "elastic": sum(0.5 * kn * c[1] ** 2 for kn, c in zip(springs, found.values(), strict=True)),
                "wall_point": pose[:, 0:2],
                "wall_normal": pose[:, 2:4],
                "wall_force": loads,
            }
        )


def vector(values):
    """A vector of ESyS-Particle in the plane z = 0."""
    return Vec3(float(values[0]), float(values[1]), 0.0)
