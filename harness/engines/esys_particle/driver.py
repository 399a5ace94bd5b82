"""Driver that runs inside ESyS-Particle (``mpirun -np 2 esysparticle driver.py``), under the system's Python.

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

import os
import sys
import time

# ESyS-Particle runs this file without a folder on the path.
sys.path.insert(0, os.path.dirname(os.path.abspath(sys.argv[0])))
sys.path.insert(1, os.path.join(sys.path[0], "..", "drivers"))

import numpy as np
from driver_parts import SpringRun, serve
from esys.lsm import GravityPrms, LsmMpi, NRotElasticPrms, NRotElasticWallPrms, NRotSphere
from esys.lsm.util import BoundingBox, Vec3

ROUND_OFF = 1e-9
ULPS = 16.0
"""Of the largest force so far, and of the momenta per step: agreement of contact forces with changes of momentum."""


class Run(SpringRun):
    """One simulation."""

    name = "ESyS-Particle"

    def __init__(self, engine, request):
        super().__init__(request)
        self.engine, self.largest = engine, 0.0
        self.rotating = np.zeros(self.n, dtype=bool)  # spheres without rotation
        self.kn = self.law["kn"]
        self._build(request["extra"]["reach"])

    def version(self):
        return self.engine.getLsmVersion().strip()

    def settings(self):
        return {"grid spacing [m]": self.spacing, "verlet distance [m]": self.skin}

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
            sampling = step in wanted
            if sampling or damped or step + 1 in wanted:
                before, (x_next, v_next) = (x, v), self.state()
                if sampling:
                    spent += time.perf_counter() - begin
                    self._sample(step, *before, started, v_next)
                    begin = time.perf_counter()
                x, v = x_next, v_next
        return spent + time.perf_counter() - begin

    def _move_walls(self, step):
        for w, displacement in enumerate(self.path[step, :, 0:2] - self.path[step - 1, :, 0:2]):
            if displacement.any():
                self.engine.moveWallBy(f"wall{w}", vector(displacement))

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
        pose = self.pose(step)
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
        _, elastic = self.sums({pair: (fn, 0.0, overlap) for pair, (fn, overlap, _) in found.items()}, pose)
        spin, mean = np.zeros(self.n), 0.5 * (v + after) if step else self.v0
        forces = [(found[pair][0] if pair in found else 0.0, 0.0) for pair in self.pairs]
        self.sample(step // self.substeps, x, mean, spin, spin, forces, pose, loads, elastic)


def vector(values):
    """A vector of ESyS-Particle in the plane z = 0."""
    return Vec3(float(values[0]), float(values[1]), 0.0)


def main():
    """One master process, one worker."""
    engine = LsmMpi(numWorkerProcesses=1, mpiDimList=[1, 1, 1])

    def make(request):
        if request["scene"].get("dimension") == 3:
            import space_driver

            return space_driver.Run(engine, request)
        return Run(engine, request)

    serve(make)
    engine.exit()  # without it the worker process waits for ever


main()
