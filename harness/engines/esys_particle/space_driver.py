"""Spheres in space in ESyS-Particle: rotating spheres on smooth planes; the cycle is that of the plane's driver.

What contacts do is read from ESyS-Particle, which tells the forces on planes and, in its restart files, those on spheres and the shear
force of each contact, to the last bit. Normal forces are those along the normals of touching contacts that give the bodies these forces;
where that leaves several answers they are not observed.

The first step gives the forces at time 0; half of what it adds makes v_{1/2}.
"""

import math
import os
import time

import numpy as np
from esys.lsm import (
    GravityPrms,
    HertzMindlinViscoPrms,
    NRotElasticWallPrms,
    RestartCheckPointPrms,
    RotFrictionPrms,
    RotSphere,
)
from esys.lsm.util import BoundingBox, Vec3
from space_parts import SpaceRun, rough

CELLS = 32.0
"""Cells of the neighbour search along an axis, at most: the domain is large, and a search goes through all of them."""

ROUND_OFF = 1e-9
"""Of the largest force: agreement of the spheres' forces with those along contacts."""

TOUCHING = 1e-13
"""Gap [radii] up to which a contact may touch for one only."""

FORCE, RECORD = slice(16, 19), 32
"""Numbers of a sphere in a restart file, and which of them are its force."""

SHEAR_RECORD = 15
"""Numbers of a contact: of its two spheres from the ninth on, of its shear force the last three."""

ITS_PI = 3.141592654
"""ESyS-Particle's."""

ALL_BITS = -1


class Run(SpaceRun):
    """One simulation."""

    name = "ESyS-Particle"

    def __init__(self, engine, request):
        super().__init__(request)
        self.engine, self.steps_done = engine, 0
        self.hertz = self.n > 1 and bool(self.law_of(0, 1)["e_star"])  # then there is no other law
        self.kinds()
        self._build(request["extra"]["reach"])

    def version(self):
        return self.engine.getLsmVersion().strip()

    def settings(self):
        return {
            "grid spacing [m]": self.spacing,
            "verlet distance [m]": self.skin,
            "interactions": "HertzMindlinVisco without friction" if self.hertz else "RotFriction without scaling",
        }

    def kinds(self):
        """Tags are the kinds of spheres: laws come by tags, so does what stays, and a plane's stiffness is by the radius."""
        material = np.unique(self.material, return_inverse=True)[1]
        rows = np.column_stack([self.radius, material, self.fixed, self.rotating])
        _, self.first, kind = np.unique(rows, axis=0, return_index=True, return_inverse=True)
        self.kind = kind.reshape(-1)

    def _build(self, reach):
        engine, radius = self.engine, float(self.radius.max())
        self.skin = 0.1 * float(self.radius.min())
        self.spacing = max(2.5 * radius, 2.0 * reach / CELLS)
        engine.initNeighbourSearch(particleType="RotSphere", gridSpacing=self.spacing, verletDist=self.skin)
        engine.setTimeStepSize(self.dt)
        half = reach + 4.0 * self.spacing
        engine.setSpatialDomain(BoundingBox(Vec3(-half, -half, -half), Vec3(half, half, half)))
        for i, place in enumerate(self.x0):
            sphere = RotSphere(id=i, posn=vector(place), radius=float(self.radius[i]), mass=float(self.mass[i]))
            sphere.setTag(int(self.kind[i]) + 1)
            engine.createParticle(sphere)
        for k, i in enumerate(self.first):
            if self.fixed[i]:
                engine.setParticleNonDynamic(k + 1)
            if not self.rotating[i]:
                engine.setParticleNonRotational(k + 1)
        self._contacts()
        for w, wall in enumerate(self.walls):
            engine.createWall(name=f"wall{w}", posn=vector(wall["point"]), normal=vector(wall["normal"]))
            for k, i in enumerate(self.first):
                if self.fixed[i]:
                    continue
                kn = self.law_of(int(i), self.n + w)["kn"] / (ITS_PI * self.radius[i])  # which it multiplies again
                contact = NRotElasticWallPrms(name=f"wall{w}-{k}", wallName=f"wall{w}", normalK=float(kn))
                engine.createInteractionGroupTagged(contact, k + 1, ALL_BITS)
        if self.gravity.any():
            engine.createInteractionGroup(GravityPrms(name="gravity", acceleration=vector(self.gravity)))

    def _contacts(self):
        """Of spheres: Hertz' law, whose E is E* and whose nu without friction is nothing, or the linear one by tags."""
        if self.hertz:
            law = self.law_of(0, 1)
            rebound = math.exp(-math.pi * law["beta"] / math.sqrt(1.0 - law["beta"] ** 2))
            contact = HertzMindlinViscoPrms(
                name="spheres", youngsModulus=law["e_star"], poissonsRatio=0.0, dynamicMu=0.0, restitution=rebound
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
                mu = law["mu"] if rough(law) else 0.0
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
        self._set(begin, np.zeros((self.n, 3)))
        self.angle, self.moved = np.zeros((self.n, 3)), 0.0
        forces = self._step(True)
        _, v, omega = self.state()
        half, spin = self.v0 + 0.5 * (v - begin), self.omega0 + 0.5 * omega
        half[self.fixed], spin[~self.rotating] = 0.0, 0.0
        self._set(half, spin)
        for i, place in enumerate(self.x0 + self.dt * half):
            self.engine.moveParticleTo(i, vector(place))
        self._sample(0, self.x0, self.v0, self.omega0, forces)
        self.angle = self.dt * spin

    def _set(self, v, omega):
        for i in range(self.n):
            self.engine.setParticleVelocity(i, vector(v[i]))
            self.engine.setParticleAngularVelocity(i, vector(omega[i]))

    def state(self):
        """Positions [m], velocities [m/s] and spins [rad/s] that ESyS-Particle holds."""
        particles = self.engine.getParticleList()
        if len(particles) != self.n:
            raise RuntimeError(f"ESyS-Particle holds {len(particles)} of {self.n} spheres: the others left its domain")
        found = np.empty((3, self.n, 3))
        for each in particles:
            rows = each.getPosn(), each.getVelocity(), each.getAngularVelocity()
            found[:, each.getId()] = [(row[0], row[1], row[2]) for row in rows]
        return found

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
        """Planes look for spheres where spheres move only: before one may come near unseen they are told to."""
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

    def _step(self, told):
        """One step; where it is to be told, the force on each sphere [N], gravity included, and ``{(i, j): shear force on i}``."""
        self.steps_done += 1
        if not told:
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
        told = np.append(~self.fixed, np.ones(len(self.walls), dtype=bool))
        along = self._along(push[told].reshape(3 * int(told.sum()), len(near)), rest[told].reshape(-1), force, step)
        found = {}
        for (i, j, normal), fn in zip(near, along, strict=True):
            sheared = shear.get((i, j), np.zeros(3))  # not quite at right angles to the normal
            beside = float(sheared @ normal)
            found[i, j] = fn - beside, sheared - beside * normal
        self.sample(step // self.substeps, x, v, omega, self.angle.copy(), found, loads)

    def _touching(self, x, pose):
        """Contacts that touch, ``(i, j, normal from i to j)``; fixed spheres have none with each other and with planes."""
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


def vector(values):
    """A vector of ESyS-Particle."""
    return Vec3(*(float(value) for value in values))
