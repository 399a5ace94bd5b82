"""Driver that runs inside ESyS-Particle (``mpirun -np 2 esysparticle driver.py``), under the system's Python.

A step of ESyS-Particle takes (positions t_n, velocities v_{n-1/2}) and the walls where they are, computes the forces at t_n, and
ends with (positions t_{n+1}, velocities v_{n+1/2}). The walls are therefore put to their places of t_n before that step. With
a = xi dt/2:

- central damping ``v+ = ((1 - a) v- + dt F/m)/(1 + a)`` is an undamped step with mass ``m (1 + a)`` that starts from
  ``v- (1 - a)/(1 + a)``; gravity, an acceleration, is divided by ``1 + a``;
- lagged damping ``v+ = v- + dt (F/m - xi v-)`` is an undamped step that starts from ``v- (1 - 2 a)``;
- both have ``v_n = (v- + v+)/2``.

ESyS-Particle does not give the forces of single contacts of disks. They are computed here by its own law from its own positions, and every
sample is checked: the change of each disk's momentum in ESyS-Particle must be what these forces make of it, and its walls' forces
their sums.

What contacts of spheres do is read from ESyS-Particle, which gives the forces on walls and, in its restart files, those on spheres and the
shear force of each contact, to the last bit. Normal forces are those along the normals of touching contacts that give the bodies these
forces; where that leaves several answers they are not observed. The first step gives the forces at time 0; half of what it adds makes
v_{1/2}.
"""

import os
import sys
import time

# ESyS-Particle runs this file without a folder on the path.
sys.path.insert(0, os.path.dirname(os.path.abspath(sys.argv[0])))
sys.path.insert(1, os.path.join(sys.path[0], "..", "drivers"))

import numpy as np
from driver_parts import SpringRun, carries_shear, in_3d, serve
from esys.lsm import (
    GravityPrms,
    HertzMindlinViscoPrms,
    LsmMpi,
    NRotElasticPrms,
    NRotElasticWallPrms,
    NRotSphere,
    RestartCheckPointPrms,
    RotFrictionPrms,
    RotSphere,
)
from esys.lsm.util import BoundingBox, Vec3

ROUND_OFF = 1e-9
"""Of the largest force, of disks also of the momenta per step: agreement of contact forces with what bodies feel."""
ULPS = 16.0
"""Round-off of an overlap in units of the coordinates' own."""

CELLS = 32.0
"""Cells of the neighbour search along an axis of 3D, at most: the domain is large, and a search goes through all of them."""

TOUCHING = 1e-13
"""Gap [radii] up to which a contact may touch for one only."""

FORCE, RECORD = slice(16, 19), 32
"""Numbers of a sphere in a restart file, and which of them are its force."""

SHEAR_RECORD = 15
"""Numbers of a contact: of its two spheres from the ninth on, of its shear force the last three."""

ITS_PI = 3.141592654
"""ESyS-Particle's."""

ALL_BITS = -1


class EsysRun(SpringRun):
    """One simulation; a subclass gives what only its dimension has.

    Attributes
    ----------
    particle : str
        ESyS-Particle's kind of particle.
    """

    name = "ESyS-Particle"
    particle = ""

    def __init__(self, engine, request):
        super().__init__(request)
        self.engine = engine
        self.prepare()
        self._build(request["extra"]["reach"])

    def version(self):
        return self.engine.getLsmVersion().strip()

    def settings(self):
        return {"grid spacing [m]": self.spacing, "verlet distance [m]": self.skin}

    def _build(self, reach):
        engine, flat = self.engine, self.dimension == 2
        self.spacing, self.skin = 2.5 * float(self.radius.max()), 0.1 * float(self.radius.min())
        if not flat:
            self.spacing = max(self.spacing, 2.0 * reach / CELLS)
        engine.initNeighbourSearch(particleType=self.particle, gridSpacing=self.spacing, verletDist=self.skin)
        engine.setTimeStepSize(self.dt)
        half = reach + 4.0 * self.spacing
        corner = Vec3(half, half, 2.0 * self.spacing if flat else half)
        engine.setSpatialDomain(BoundingBox(Vec3(-half, -half, -2.0 * self.spacing if flat else -half), corner))
        if flat:
            engine.force2dComputations(True)
        self.particles()
        for w, wall in enumerate(self.walls):
            engine.createWall(name=f"wall{w}", posn=vector(wall["point"]), normal=vector(wall["normal"]))
            self.contacts_at_wall(w)
        if self.gravity.any():
            engine.createInteractionGroup(GravityPrms(name="gravity", acceleration=vector(self.gravity / self.inflate)))

    def set_velocities(self, v, omega=None):
        for i in range(self.n):
            self.engine.setParticleVelocity(i, vector(v[i]))
            if omega is not None:
                self.engine.setParticleAngularVelocity(i, vector(omega[i]))

    def state(self):
        """Positions [m], velocities [m/s] and, of spheres, spins [rad/s] that ESyS-Particle holds."""
        particles = self.engine.getParticleList()
        if len(particles) != self.n:
            raise RuntimeError(
                f"ESyS-Particle holds {len(particles)} of {self.n} {self.noun}s: the others left its domain"
            )
        found = np.empty((self.dimension, self.n, self.dimension))
        for each in particles:
            rows = [each.getPosn(), each.getVelocity()]
            if self.dimension == 3:
                rows.append(each.getAngularVelocity())
            found[:, each.getId()] = [[row[k] for k in range(self.dimension)] for row in rows]
        return found


class DiskRun(EsysRun):
    """Disks as spheres without rotation on smooth walls."""

    particle = "NRotSphere"

    def prepare(self):
        self.largest, self.kn = 0.0, self.law["kn"]
        self.rotating = np.zeros(self.n, dtype=bool)

    def particles(self):
        for i, place in enumerate(self.x0):
            mass = float(self.mass[i] * self.inflate)
            self.engine.createParticle(NRotSphere(id=i, posn=vector(place), radius=float(self.radius[i]), mass=mass))
        self.engine.createInteractionGroup(NRotElasticPrms(name="disks", normalK=self.kn, scaling=False))

    def contacts_at_wall(self, w):
        kn = self.walls[w]["law"]["kn"]
        self.engine.createInteractionGroup(NRotElasticWallPrms(name=f"contact{w}", wallName=f"wall{w}", normalK=kn))

    def start(self):
        """Velocities from which the step at ``t_0`` makes ``v_{1/2} = v_0 + dt/2 (F_0/m - xi v_0)``."""
        rate = self.total(self.contacts(self.x0, self.path[0])) / self.mass[:, None]
        half = self.v0 + 0.5 * self.dt * (rate - self.xi * self.v0)
        self.first = half - self.dt * rate / self.inflate
        self.set_velocities(self.first)

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
        forces = {pair: (fn, 0.0) for pair, (fn, _, _) in found.items()}
        self.sample(step // self.substeps, x, mean, spin, spin, forces, loads, elastic)


class SphereRun(EsysRun):
    """Rotating spheres on smooth walls."""

    particle = "RotSphere"

    def prepare(self):
        self.steps_done = 0
        self.hertz = self.n > 1 and bool(self.law_of(0, 1)["e_star"])  # then there is no other law
        self.kinds()

    def settings(self):
        interactions = "HertzMindlinVisco without friction" if self.hertz else "RotFriction without scaling"
        return {**super().settings(), "interactions": interactions}

    def kinds(self):
        """Tags are the kinds of spheres: laws come by tags, so does what stays, and a wall's stiffness is by the radius."""
        material = np.unique(self.material, return_inverse=True)[1]
        rows = np.column_stack([self.radius, material, self.fixed, self.rotating])
        _, self.first, kind = np.unique(rows, axis=0, return_index=True, return_inverse=True)
        self.kind = kind.reshape(-1)

    def particles(self):
        for i, place in enumerate(self.x0):
            sphere = RotSphere(id=i, posn=vector(place), radius=float(self.radius[i]), mass=float(self.mass[i]))
            sphere.setTag(int(self.kind[i]) + 1)
            self.engine.createParticle(sphere)
        for k, i in enumerate(self.first):
            if self.fixed[i]:
                self.engine.setParticleNonDynamic(k + 1)
            if not self.rotating[i]:
                self.engine.setParticleNonRotational(k + 1)
        self._contacts()

    def contacts_at_wall(self, w):
        for k, i in enumerate(self.first):
            if self.fixed[i]:
                continue
            kn = self.law_of(int(i), self.n + w)["kn"] / (ITS_PI * self.radius[i])  # which it multiplies again
            contact = NRotElasticWallPrms(name=f"wall{w}-{k}", wallName=f"wall{w}", normalK=float(kn))
            self.engine.createInteractionGroupTagged(contact, k + 1, ALL_BITS)

    def _contacts(self):
        """Of spheres: Hertz' law, whose E is E* and whose nu without friction is nothing, or the linear one by tags."""
        if self.hertz:
            law = self.law_of(0, 1)
            contact = HertzMindlinViscoPrms(
                name="spheres",
                youngsModulus=law["e_star"],
                poissonsRatio=0.0,
                dynamicMu=0.0,
                restitution=self.rebound(law),
            )
            self.engine.createInteractionGroup(contact)
            return
        for k, i in enumerate(self.first):
            for other in range(k, len(self.first)):
                members = np.flatnonzero(self.kind == other)
                members = members[members != i]
                if not len(members):
                    continue
                law = self.law_of(int(i), int(members[0]))
                mu = law["mu"] if carries_shear(law) else 0.0
                contact = RotFrictionPrms(
                    name=f"spheres{k}-{other}",
                    normalK=law["kn"],
                    dynamicMu=mu,
                    staticMu=mu,
                    shearK=law["ks"] if mu else 0.0,
                    scaling=False,
                )
                self.engine.createInteractionGroupTagged(contact, k + 1, ALL_BITS, other + 1, ALL_BITS)

    def start(self):
        """The step at time 0: from rest, so that nothing slips, or with v_0, which Hertz' dashpots see, beside which nothing rubs."""
        begin = self.v0 if self.hertz else np.zeros((self.n, 3))
        self.set_velocities(begin, np.zeros((self.n, 3)))
        self.angle, self.moved = np.zeros((self.n, 3)), 0.0
        forces = self._step(True)
        _, v, omega = self.state()
        half, spin = self.v0 + 0.5 * (v - begin), self.omega0 + 0.5 * omega
        half[self.fixed], spin[~self.rotating] = 0.0, 0.0
        self.set_velocities(half, spin)
        for i, place in enumerate(self.x0 + self.dt * half):
            self.engine.moveParticleTo(i, vector(place))
        self._sample(0, self.x0, self.v0, self.omega0, forces)
        self.angle = self.dt * spin

    def advance(self, sampled):
        """All steps; returns the seconds that are not spent on samples."""
        wanted = {step * self.substeps for step in sampled} - {0}
        before, spent, begin = self.state(), 0.0, time.perf_counter()
        for step in range(1, max(sampled) * self.substeps + 1):
            if step < len(self.path):
                self._move_walls(step)
            sampling = step in wanted
            if sampling:
                spent += time.perf_counter() - begin
                forces = self._step(True)
                after = self.state()
                mean = 0.5 * (before[1:] + after[1:])
                self._sample(step, before[0], mean[0], mean[1], forces)
                begin = time.perf_counter()
            else:
                self._step(False)
                after = self.state()
            self.angle = self.angle + self.dt * after[2]
            before = after
        return spent + time.perf_counter() - begin

    def _move_walls(self, step):
        """Walls look for spheres where spheres move only: before one may come near unseen they must look again."""
        for w, (here, there) in enumerate(zip(self.path[step - 1], self.path[step], strict=True)):
            displacement, turn = there[0:3] - here[0:3], there[3:6] - here[3:6]
            if displacement.any():
                self.engine.moveWallBy(f"wall{w}", vector(displacement))
            if turn.any():
                self.engine.setWallNormal(f"wall{w}", vector(there[3:6]))
            self.moved += float(np.linalg.norm(displacement) + np.linalg.norm(turn) * self.spacing * CELLS)
        if self.moved > self.skin:
            self.engine.moveTaggedParticlesBy(len(self.first) + 1, vector(np.zeros(3)))
            self.moved = 0.0

    def _step(self, sampled):
        """One step; if it is sampled, the force on each sphere [N], gravity included, and ``{(i, j): shear force on i}``."""
        self.steps_done += 1
        if not sampled:
            self.engine.runTimeStep()
            return None
        at = self.steps_done
        self.engine.createRestartCheckPointer(
            RestartCheckPointPrms(
                fileNamePrefix="state", beginTimeStep=at, endTimeStep=at, timeStepIncr=1, Precision=17
            )
        )
        self.engine.runTimeStep()
        name = f"state_t={at}_1.txt"
        with open(name, encoding="ascii") as file:
            words = file.read().split()
        for each in (name, f"state_t={at}_0.txt"):
            os.remove(each)
        return self._read(words)

    def _read(self, words):
        """Forces of a restart file: two corners of the domain, the count of the spheres and their numbers, then groups of contacts."""
        force, shear, count = np.zeros((self.n, 3)), {}, int(words[6])
        rows = np.array(words[7 : 7 + RECORD * count], dtype=float).reshape(count, RECORD)
        force[rows[:, 4].astype(int)] = rows[:, FORCE]
        at = 7 + RECORD * count
        while not self.hertz and "RotFriction" in words[at:]:
            at = words.index("RotFriction", at) + 2
            for row in np.array(words[at : at + SHEAR_RECORD * int(words[at - 1])], dtype=float).reshape(
                -1, SHEAR_RECORD
            ):
                i, j = int(row[8]), int(row[9])
                shear[min(i, j), max(i, j)] = row[12:15] if i < j else -row[12:15]
        return force, shear

    def _sample(self, step, x, v, omega, forces):
        """State at ``t_n``, and the forces of the step that began there."""
        pose, (force, shear) = self.pose(step), forces
        loads = [-np.array(self.engine.getWallForce(f"wall{w}").toList()) for w in range(len(self.walls))]
        loads = np.array(loads).reshape(-1, 3)
        near = self._touching(x, pose)
        # Of all bodies, in their order: what they feel beside the contacts' normal forces, and what 1 N of each contact gives them.
        rest = np.concatenate([force - self.mass[:, None] * self.gravity, loads])
        push = np.zeros((len(rest), 3, len(near)))
        for c, (i, j, normal) in enumerate(near):
            for body, sign in ((i, 1.0), (j, -1.0)):
                push[body, :, c] -= sign * normal
                rest[body] -= sign * shear.get((i, j), np.zeros(3))
        # Fixed spheres push each other, too, which nobody feels.
        free = np.append(~self.fixed, np.ones(len(self.walls), dtype=bool))
        along = self._along(push[free].reshape(3 * int(free.sum()), len(near)), rest[free].reshape(-1), force, step)
        found = {}
        for (i, j, normal), fn in zip(near, along, strict=True):
            sheared = shear.get((i, j), np.zeros(3))  # not quite at right angles to the normal
            beside = float(sheared @ normal)
            found[i, j] = fn - beside, sheared - beside * normal
        self.sample(step // self.substeps, x, v, omega, self.angle.copy(), found, loads)

    def _touching(self, x, pose):
        """Contacts that touch, ``(i, j, normal from i to j)``; fixed spheres have none with each other and with walls."""
        near = []
        for i in range(self.n):
            d = x[i + 1 :] - x[i]
            distance, reach = np.linalg.norm(d, axis=1), self.radius[i] + self.radius[i + 1 :]
            touching = (distance < reach * (1.0 + TOUCHING)) & ~(self.fixed[i] & self.fixed[i + 1 :])
            near += [(i, i + 1 + int(k), d[k] / distance[k]) for k in np.flatnonzero(touching)]
        for w, row in enumerate(pose):
            touching = ((x - row[0:3]) @ row[3:6] < self.radius * (1.0 + TOUCHING)) & ~self.fixed
            near += [(int(i), self.n + w, -row[3:6]) for i in np.flatnonzero(touching)]
        return near

    def _along(self, push, rest, force, step):
        """Normal forces [N] that give the bodies what they feel; NaN where others would as well."""
        one, sizes, two = np.linalg.svd(push, full_matrices=True)
        rank = int((sizes > ROUND_OFF * sizes.max(initial=0.0)).sum())
        found = two[:rank].T @ ((one[:, :rank].T @ rest) / sizes[:rank])
        off = float(np.abs(push @ found - rest).max(initial=0.0))
        allowed = ROUND_OFF * max(float(np.abs(force).max()), float(self.mass.max() * np.abs(self.gravity).max()))
        if not off <= allowed:
            raise RuntimeError(
                f"at step {step // self.substeps} ESyS-Particle pushes spheres otherwise than its contacts can: {off:g} N are left "
                f"(allowed {allowed:g} N)"
            )
        found[(np.abs(two[rank:]) > ROUND_OFF).any(axis=0)] = np.nan
        return found


RUNS = {2: DiskRun, 3: SphereRun}


def vector(values):
    """A vector of ESyS-Particle."""
    return Vec3(*(float(value) for value in in_3d(values)))


def main():
    """One master process, one worker."""
    engine = LsmMpi(numWorkerProcesses=1, mpiDimList=[1, 1, 1])
    serve(lambda request: RUNS[request["scene"].get("dimension", 2)](engine, request))
    engine.exit()  # without it the worker process waits for ever


main()
