"""Driver that runs inside YADE (``yade -n -x -j1 driver.py``): a request on standard input, an answer file out.

It runs under the system's Python and knows the wire format only. One cycle is arranged so that the state between two
``O.step()`` is (positions t_n, forces t_n, velocities t_{n-1/2}): the engines are ordered NewtonIntegrator,
ForceResetter, collider, InteractionLoop. Global damping and wall motion are then plain Python between the steps.

Derivations used below, a = xi dt/2:

- central damping: ``v+ = ((1 - a) v- + dt F/m)/(1 + a)`` is an undamped step with mass ``m (1 + a)`` that starts from
  ``v- (1 - a)/(1 + a)``; gravity, an acceleration in YADE, is divided by ``1 + a`` likewise;
- lagged damping: ``v+ = v- + dt (F/m - xi v-)`` is an undamped step that starts from ``v- (1 - 2 a)``;
- synchronised velocity: central ``v_n = (v- + v+)/2 = (v- + dt F/(2 m))/(1 + a)``, lagged
  ``v_n = v- + dt/2 (F/m - xi v-)``;
- start: ``v_{1/2} = v_0 + dt/2 (F_0/m - xi v_0)``, by choosing the velocity from which the first step starts.
"""

import contextlib
import math
import os
import sys

import numpy as np
import yade

# YADE runs this file without a folder on the path.
sys.path.insert(0, os.path.dirname(os.path.abspath(sys.argv[0])))
sys.path.insert(1, os.path.join(sys.path[0], "..", "drivers"))
from driver_parts import SpringRun, clock, serve
from yade import (
    Bo1_Box_Aabb,
    Bo1_Sphere_Aabb,
    CohFrictMat,
    CohFrictPhys,
    ForceResetter,
    FrictMat,
    Ig2_Box_Sphere_ScGeom,
    Ig2_Box_Sphere_ScGeom6D,
    Ig2_Sphere_Sphere_ScGeom,
    Ig2_Sphere_Sphere_ScGeom6D,
    InsertionSortCollider,
    InteractionLoop,
    Ip2_CohFrictMat_CohFrictMat_CohFrictPhys,
    Ip2_FrictMat_FrictMat_FrictPhys,
    Ip2_ViscElMat_ViscElMat_ViscElPhys,
    Law2_ScGeom6D_CohFrictPhys_CohesionMoment,
    Law2_ScGeom_FrictPhys_CundallStrack,
    Law2_ScGeom_ViscElPhys_Basic,
    MatchMaker,
    NewtonIntegrator,
    O,
    Vector3,
    ViscElMat,
    ViscElPhys,
)
from yade.utils import sphere
from yade_parts import DISK_MASK, INTEGRATED, NOBODY, WALLS_APART, Law, Stepper, WallBox

SMALL_SCENE = 200  # bodies up to which the collider runs at every step: it costs nothing there
HALF_PLANE = 1e6  # half-length of a wall's box in units of the scene's size: only its face counts


class Run(SpringRun):
    """One simulation."""

    needs_a_disk = False

    def __init__(self, request):
        O.reset()  # what a run before has left in this process
        super().__init__(request)
        self.disks = request["scene"]["disks"]
        self.m = len(self.walls)
        self.made = sorted(set(self.material)) or [""]  # materials of disks; walls have one of their own each
        self.kinds = self._kinds_of_pairs()
        models = {law["rolling"]["model"] for law in self.all_laws if law["rolling"]}
        self.sprung = "elastic-plastic" in models
        self.viscous = not self.sprung and (self.damped or bool(models))
        self.now = 0  # step at which forces are computed
        self._bodies()
        self._engines()

    def version(self):
        return str(yade.config.version)

    def settings(self):
        return {"contact_law": type(self.contact_law).__name__}

    def _bodies(self):
        """Walls come first: YADE wants a box before a sphere, and cannot swap a pair that already has its physics."""
        disks, n = self.disks, self.n
        for _ in range(len(self.made) + self.m):
            O.materials.append((CohFrictMat if self.sprung else ViscElMat if self.viscous else FrictMat)())
        x, radius = self.x0, max(disks["radius"], default=1.0)
        middle = 0.5 * (x.min(axis=0) + x.max(axis=0)) if n else np.zeros(2)
        size = HALF_PLANE * (float(np.ptp(x, axis=0).max()) + radius if n else 1.0)
        self.boxes = [
            WallBox(self.path[0, w], middle, radius, size, O.materials[len(self.made) + w]) for w in range(self.m)
        ]
        for i in range(n):
            body = sphere(
                (*disks["x"][i], 0.0), disks["radius"][i], material=O.materials[self.made.index(self.material[i])]
            )
            body.mask = DISK_MASK
            state = body.state
            state.mass = disks["mass"][i] * self.inflate
            state.inertia = Vector3(1, 1, 1) * disks["inertia"][i] * self.inflate
            state.blockedDOFs = "zXY" if disks["rotating"][i] else "zXYZ"
            O.bodies.append(body)
        self.ids = [*range(self.m, self.m + n), *range(self.m)]  # YADE's number of each body of the scene
        self.states = [O.bodies[k].state for k in self.ids[:n]]

    def _kinds_of_pairs(self):
        """Laws by the numbers of two materials in YADE, those of disks before those of walls."""
        first = [self.material.index(name) if name in self.material else None for name in self.made]
        kinds = {}
        for a, i in enumerate(first):
            for b, j in enumerate(first[a:], start=a):
                kinds[a, b] = Law(self.law_of(i, j) if self.n else self.law)
            for w in range(self.m):
                law = self.law_of(i, self.n + w) if self.n else self.walls[w]["law"]
                kinds[a, len(self.made) + w] = Law(law)
        return kinds

    def _engines(self):
        six = self.sprung  # rolling springs need the geometry with six degrees of freedom
        spheres = (Ig2_Sphere_Sphere_ScGeom6D if six else Ig2_Sphere_Sphere_ScGeom)(avoidGranularRatcheting=False)
        geometry = [spheres, Ig2_Box_Sphere_ScGeom6D() if six else Ig2_Box_Sphere_ScGeom()]
        if self.sprung:
            self.contact_law = Law2_ScGeom6D_CohFrictPhys_CohesionMoment(
                useIncrementalForm=True, always_use_moment_law=True
            )
            loop = InteractionLoop(geometry, [Ip2_CohFrictMat_CohFrictMat_CohFrictPhys()], [self.contact_law])
        elif self.viscous:
            self.contact_law = Law2_ScGeom_ViscElPhys_Basic()
            loop = InteractionLoop(geometry, [Ip2_ViscElMat_ViscElMat_ViscElPhys()], [self.contact_law])
        else:
            self.contact_law = Law2_ScGeom_FrictPhys_CundallStrack()
            angle, kn, ks = (
                MatchMaker(matches=[(*pair, value(law)) for pair, law in self.kinds.items()])
                for value in (lambda law: math.atan(law.mu), lambda law: law.kn, lambda law: law.ks)
            )
            physics = Ip2_FrictMat_FrictMat_FrictPhys(frictAngle=angle, kn=kn, ks=ks)
            loop = InteractionLoop(geometry, [physics], [self.contact_law])
        gravity = Vector3(*self.gravity, 0.0) / self.inflate
        self.newton = NewtonIntegrator(damping=0, gravity=gravity, mask=INTEGRATED, warnNoForceReset=False)
        collider = InsertionSortCollider([Bo1_Sphere_Aabb(), Bo1_Box_Aabb()], avoidSelfInteractionMask=WALLS_APART)
        if self.n + self.m <= SMALL_SCENE:
            collider.verletDist = 0.0
        self.stepper = Stepper(
            [self.newton, ForceResetter()],
            collider,
            loop,
            self.give_physics if self.sprung or self.viscous else None,
            self.apply_loads if self.forces_on else None,
        )
        O.dt = self.dt

    def give_physics(self):
        """Stiffness, dashpot, rolling resistance of new pairs, before YADE derives them from materials (which it cannot pair by pair)."""
        for contact in O.interactions.all(onlyReal=False):
            if contact.phys is None:
                first, second = sorted((contact.id1, contact.id2))
                bodies = (second - self.m,) if first < self.m else (first - self.m, second - self.m)
                i, j = bodies[0], bodies[1] if len(bodies) == 2 else self.n + first
                law = Law(self.law_of(i, j))
                mass = 1.0 / sum(1.0 / self.disks["mass"][k] for k in bodies)
                radius = 1.0 / sum(1.0 / self.disks["radius"][k] for k in bodies)
                contact.phys = self._rolling_spring(law, radius) if self.sprung else self._viscous(law, mass, radius)

    def _viscous(self, law, mass, radius):
        """Springs and dashpots; mRtype 1 is the viscous torque ``mR fn omega``, as YADE drops the unit vector that it computes."""
        return ViscElPhys(
            kn=law.kn,
            cn=2.0 * law.beta * math.sqrt(mass * law.stiff),
            ks=law.ks,
            cs=0.0,
            tangensOfFrictionAngle=law.mu,
            mR=law.rolling["mu"] * law.repulsive * radius**2 if law.rolling else 0.0,
            mRtype=1,
        )

    def _rolling_spring(self, law, radius):
        return CohFrictPhys(
            kn=law.kn,
            ks=law.ks,
            tangensOfFrictionAngle=law.mu,
            kr=law.rolling["kr"] if law.rolling else 0.0,
            maxRollPl=law.rolling["mu"] * law.repulsive * radius if law.rolling else 0.0,
            momentRotationLaw=law.rolling is not None,
            cohesionBroken=True,
        )

    def apply_loads(self):
        """Forces and torques of the scene, in a step that has forgotten the last one's."""
        for i, (fx, fy, torque) in enumerate(self.loads_at(self.now).tolist()):
            O.forces.addF(self.ids[i], Vector3(fx, fy, 0.0))
            O.forces.addT(self.ids[i], Vector3(0.0, 0.0, torque))

    def start(self):
        """Step 0: contacts of the initial overlaps, preload, first sample, and the velocities of the first step."""
        # The integrator must run, if only on nobody: it makes YADE's per-thread forces ready to be reset. With
        # newton.dead the forces of both steps would add up.
        self.newton.mask = NOBODY
        O.dt = 0.0  # dashpots see v_0, but no slip accumulates
        v0, w0 = self.v0, self.omega0
        for i, state in enumerate(self.states):
            state.vel, state.angVel = Vector3(*v0[i], 0.0), Vector3(0.0, 0.0, w0[i])
        self.stepper.step()
        for i, j, fs in self.preload:
            self._set_shear(i, j, fs)
        self.stepper.step()  # bodies do not move yet: the same contacts again, now with the preload in their forces
        self.newton.mask, O.dt = INTEGRATED, self.dt
        self._sample(0, v0, w0)
        for i, state in enumerate(self.states):
            force, torque = O.forces.f(self.ids[i]), O.forces.t(self.ids[i])[2]
            gain = self.dt / self.disks["mass"][i]
            kick = [gain * (force[k] + self.disks["mass"][i] * self.gravity[k]) for k in (0, 1)]
            half = [(1.0 - self.a) * v0[i, k] + 0.5 * kick[k] for k in (0, 1)]
            state.vel = Vector3(*(half[k] - kick[k] / self.inflate for k in (0, 1)), 0.0)
            spin = w0[i]
            if self.disks["rotating"][i]:
                kick = self.dt * torque / self.disks["inertia"][i]
                spin = (1.0 - self.a) * spin + 0.5 * kick - kick / self.inflate
            state.angVel = Vector3(0.0, 0.0, spin)

    def _set_shear(self, i, j, fs):
        contact = self._touching(i, j)
        if contact is None:
            raise RuntimeError(
                f"initial_shear of pair ({i}, {j}) is {fs:g} N, but the two bodies do not overlap at time 0: a contact "
                f"that carries shear needs an initial overlap"
            )
        sign, t = self._tangent(contact, i)
        contact.phys.shearForce = Vector3(-sign * fs * t[0], -sign * fs * t[1], 0.0)

    def _touching(self, i, j):
        """YADE's contact of two bodies of the scene; None where they do not touch (a near pair is no contact yet)."""
        i, j = self.ids[i], self.ids[j]
        contact = O.interactions[i, j] if O.interactions.has(i, j) else None
        return contact if contact is not None and contact.isReal else None

    def _tangent(self, contact, i):
        """Sign (+1 where body ``i`` is YADE's first) and tangent t = (-n_y, n_x) with n from ``i`` to the other body."""
        sign = 1.0 if contact.id1 == self.ids[i] else -1.0
        normal = contact.geom.normal
        return sign, (-sign * normal[1], sign * normal[0])

    def advance(self, sampled):
        """All steps; returns the seconds spent on them, sampling apart, see `clock`."""
        wanted = {step * self.substeps for step in sampled}
        last, rest = max(wanted), len(self.path) - 1
        states, decay, step_once = self.states, self.decay, self.stepper.step
        turning = [states[i] for i in range(self.n) if self.disks["rotating"][i]]
        spent = 0.0
        begin = clock()
        for step in range(1, last + 1):
            if decay != 1.0 and step > 1:
                for state in states:
                    state.vel = state.vel * decay
                for state in turning:
                    state.angVel = state.angVel * decay
            if step <= rest:
                row = self.path[step]
                for w, box in enumerate(self.boxes):
                    box.place(row[w])
            self.now = step
            step_once()
            if step in wanted:
                now = clock()
                spent += now - begin
                self._sample(step // self.substeps)
                begin = clock()
        return spent + clock() - begin

    def _sample(self, step, v=None, omega=None):
        """Append one sample; velocities are synchronised with the forces unless they are given (step 0)."""
        states, forces = self.states, O.forces
        # Components one by one: iterating a Vector3 is slow.
        x = np.array([(p[0], p[1]) for p in (s.pos for s in states)]).reshape(-1, 2)
        force = np.array([(f[0], f[1]) for f in map(forces.f, self.ids)]).reshape(-1, 2)
        if v is None:
            half = np.array([(u[0], u[1]) for u in (s.vel for s in states)]).reshape(-1, 2)
            v = self._synchronised(half, force[: self.n] / self.mass[:, None] + self.gravity)
            spin = np.array([s.angVel[2] for s in states])
            torque = np.array([forces.t(b)[2] for b in self.ids[: self.n]])
            omega = np.where(self.rotating, self._synchronised(spin, torque / self.inertia), spin)
        angle = np.array([2.0 * math.atan2(q[2], q[3]) for q in (s.ori for s in states)])
        if self.samples:  # without jumps: whole turns are added as the mean spin since the last sample asks
            last, _, _, spun, turned, *_ = self.samples[-1]
            length = self.substeps * self.dt
            expected = turned + 0.5 * (spun + omega) * (step * length - last * length)
            angle = angle + 2.0 * math.pi * np.round((expected - angle) / (2.0 * math.pi))
        watched = [self._contact(*pair) for pair in self.pairs]
        pose = self.pose(step * self.substeps)
        self.sample(step, x, v, omega, angle, watched, pose, force[self.n :], self._elastic())

    def _synchronised(self, half, acceleration):
        """Velocities at the sampled time from those half a step before and the accelerations."""
        if self.central:
            return (half + 0.5 * self.dt * acceleration) / (1.0 + self.a)
        return half + 0.5 * self.dt * (acceleration - self.xi * half)

    def _contact(self, i, j):
        contact = self._touching(i, j)
        if contact is None:
            return 0.0, 0.0
        physics, normal = contact.phys, contact.geom.normal
        sign, t = self._tangent(contact, i)
        shear = physics.shearForce
        return physics.normalForce.dot(normal), -sign * (shear[0] * t[0] + shear[1] * t[1])

    def _elastic(self):
        if not (self.viscous or self.sprung):
            return self.contact_law.elasticEnergy()
        energy = 0.0
        for contact in O.interactions:
            physics = contact.phys
            energy += 0.5 * physics.kn * max(contact.geom.penetrationDepth, 0.0) ** 2
            energy += 0.5 * physics.shearForce.squaredNorm() / physics.ks
            if self.sprung and physics.kr > 0.0:
                energy += 0.5 * physics.moment_bending.squaredNorm() / physics.kr
        return energy


def remove_temporary_folder():
    """Remove YADE's own temporary folder (it heeds no TMPDIR) while it is empty: nobody would after a kill or a short exit."""
    folder = os.path.dirname(O.tmpFilename())
    with contextlib.suppress(OSError):
        os.rmdir(folder)
        print("removed", folder)


def make(request):
    """The run."""
    if request["scene"].get("dimension") == 3:
        import space_driver

        return space_driver.Run(request)
    return Run(request)


if __name__ == "__main__":
    remove_temporary_folder()
    serve(make)
    sys.stdout.flush()
    os._exit(0)  # YADE's own exit waits for its network threads
