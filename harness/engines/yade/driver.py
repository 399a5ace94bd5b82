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

Disks are spheres whose motion along z and turns about x and y are blocked. The linear law is FrictPhys, ViscElPhys where there is a
dashpot or a viscous rolling resistance and always in 3D, or CohFrictPhys where a spring resists spins. Hertz-Mindlin is MindlinPhys, whose
constants this driver gives pair by pair: ``kno = (4/3) E* sqrt(R)``, ``kso = 8 G* sqrt(R)`` and ``betan = sqrt(5/6) beta``, as its dashpot
is ``2 betan sqrt(m S)``.
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
from driver_parts import SpringRun, carries_shear, clock, in_3d, serve, spin_in_3d
from yade import (
    Bo1_Box_Aabb,
    Bo1_Sphere_Aabb,
    CohFrictPhys,
    ForceResetter,
    FrictMat,
    Ig2_Box_Sphere_ScGeom,
    Ig2_Box_Sphere_ScGeom6D,
    Ig2_Sphere_Sphere_ScGeom,
    Ig2_Sphere_Sphere_ScGeom6D,
    InsertionSortCollider,
    InteractionLoop,
    Ip2_FrictMat_FrictMat_FrictPhys,
    Law2_ScGeom6D_CohFrictPhys_CohesionMoment,
    Law2_ScGeom_FrictPhys_CundallStrack,
    Law2_ScGeom_MindlinPhys_Mindlin,
    Law2_ScGeom_ViscElPhys_Basic,
    MatchMaker,
    MindlinPhys,
    NewtonIntegrator,
    O,
    Vector3,
    ViscElPhys,
)
from yade.utils import sphere
from yade_parts import BOXES, DISK_MASK, INTEGRATED, NOBODY, WALL_MASK, WALLS_APART, Law, Stepper

SMALL_SCENE = 200  # bodies up to which the collider runs at every step: it costs nothing there
HALF_LENGTH = 1e6  # of a wall's box in units of the scene's size: only its face counts
NO_TIME = 1e-30  # of a step: dashpots see v_0, no slip accumulates, and YADE can divide by it


class Run(SpringRun):
    """One simulation."""

    name = "YADE"
    needs_a_disk = False

    def __init__(self, request):
        O.reset()  # what a run before has left in this process
        super().__init__(request)
        self.m = len(self.walls)
        self.made = sorted(set(self.material)) or [""]  # materials of bodies; walls have one of their own each
        resistances = [law[key] for law in self.all_laws if law["kn"] for key in ("rolling", "twisting") if law[key]]
        self.six = any(
            each["model"] == "elastic-plastic" for each in resistances
        )  # which asks for a geometry with six degrees of freedom
        self.given = (
            self.dimension == 3 or self.damped or bool(resistances)
        )  # whether pairs get their constants from `give_physics`
        self.now = 0  # step at which forces are computed
        self._bodies()
        self._engines()

    def version(self):
        return str(yade.config.version)

    def settings(self):
        return {"contact_law": ", ".join(type(law).__name__ for law in self.contact_laws)}

    def _bodies(self):
        """Walls come first: YADE wants a box before a sphere, and cannot swap a pair that already has its physics."""
        n, m, x = self.n, self.m, self.x0
        for _ in range(len(self.made) + m):
            O.materials.append(FrictMat())
        radius = float(self.radius.max()) if n else 1.0
        middle = 0.5 * (x.min(axis=0) + x.max(axis=0)) if n else np.zeros(2)
        size = HALF_LENGTH * (float(np.ptp(x, axis=0).max()) + radius if n else 1.0)
        make = BOXES[self.dimension]
        self.boxes = [make(self.path[0, w], middle, radius, size, O.materials[len(self.made) + w]) for w in range(m)]
        for i, place in enumerate(in_3d(x).tolist()):
            body = sphere(place, float(self.radius[i]), material=O.materials[self.made.index(self.material[i])])
            body.mask = WALL_MASK if self.fixed[i] else DISK_MASK
            state = body.state
            state.mass = float(self.mass[i] * self.inflate)
            state.inertia = Vector3(1, 1, 1) * float(self.inertia[i] * self.inflate)
            held = "".join(name for name, flag in zip("xyz", self.held[i]) if flag)  # noqa: B905
            blocked = "zXY" if self.dimension == 2 else held
            state.blockedDOFs = "".join(dict.fromkeys(blocked + ("" if self.rotating[i] else "XYZ")))
            O.bodies.append(body)
        self.ids = [*range(m, m + n), *range(m)]  # YADE's number of each body of the scene
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
        spheres = (Ig2_Sphere_Sphere_ScGeom6D if self.six else Ig2_Sphere_Sphere_ScGeom)(avoidGranularRatcheting=False)
        geometry = [spheres, Ig2_Box_Sphere_ScGeom6D() if self.six else Ig2_Box_Sphere_ScGeom()]
        physics, self.contact_laws = Ip2_FrictMat_FrictMat_FrictPhys(), []
        if self.dimension == 3:
            moments = any(law["rolling"] for law in self.all_laws if law["e_star"])
            adhesive = any(law["surface_energy"] for law in self.all_laws)
            self.contact_laws += [Law2_ScGeom_MindlinPhys_Mindlin(includeMoment=moments, includeAdhesion=adhesive)]
        if self.given and not (self.six and self.dimension == 2):
            self.contact_laws += [Law2_ScGeom_ViscElPhys_Basic()]
        if self.six:
            springs = {"useIncrementalForm": True, "always_use_moment_law": True}
            self.contact_laws += [Law2_ScGeom6D_CohFrictPhys_CohesionMoment(**springs)]
        if not self.given:
            self.contact_laws += [Law2_ScGeom_FrictPhys_CundallStrack()]
            kinds = self._kinds_of_pairs()
            angle, kn, ks = (
                MatchMaker(matches=[(*pair, value(law)) for pair, law in kinds.items()])
                for value in (lambda law: math.atan(law.mu), lambda law: law.kn, lambda law: law.ks)
            )
            physics = Ip2_FrictMat_FrictMat_FrictPhys(frictAngle=angle, kn=kn, ks=ks)
        gravity = Vector3(*in_3d(self.gravity)) / self.inflate
        self.newton = NewtonIntegrator(damping=0, gravity=gravity, mask=INTEGRATED, warnNoForceReset=False)
        collider = InsertionSortCollider([Bo1_Sphere_Aabb(), Bo1_Box_Aabb()], avoidSelfInteractionMask=WALLS_APART)
        if self.n + self.m <= SMALL_SCENE:
            collider.verletDist = 0.0
        self.stepper = Stepper(
            [self.newton, ForceResetter()],
            collider,
            InteractionLoop(geometry, [physics], self.contact_laws),
            self.give_physics if self.given else None,
            self.apply_loads if self.forces_on else None,
        )
        O.dt = self.dt

    def give_physics(self):
        """Constants of new pairs, before YADE derives them from materials (which it cannot pair by pair)."""
        for contact in O.interactions.all(onlyReal=False):
            if contact.phys is None:
                first, second = sorted((contact.id1, contact.id2))
                i, j = (second, self.n + first + self.m) if first < self.m else (first, second)
                contact.phys = self._physics(i - self.m, j - self.m)

    def _physics(self, i, j):
        wanted, (mass, radius) = self.law_of(i, j), self.reduced(i, j)
        if wanted["e_star"]:
            return self._hertz(i, j, wanted, mass, radius)
        law = Law(wanted)
        springs = {"kn": law.kn, "ks": law.ks, "tangensOfFrictionAngle": law.mu}
        rolling, twisting = law.rolling, law.twisting
        if not self.six:  # mRtype 1 is the viscous torque mR fn omega, as YADE drops the unit vector that it computes
            resisted = rolling["mu"] * law.repulsive * radius**2 if rolling else 0.0
            damping = 2.0 * law.beta * math.sqrt(mass * law.stiff)
            return ViscElPhys(**springs, cn=damping, cs=0.0, mR=resisted, mRtype=1)
        return CohFrictPhys(
            **springs,
            kr=rolling["kr"] if rolling else 0.0,
            maxRollPl=rolling["mu"] * law.repulsive * radius if rolling else 0.0,
            ktw=twisting["kr"] if twisting else 0.0,
            maxTwistPl=twisting["mu"] * radius if twisting else 0.0,
            momentRotationLaw=rolling is not None or twisting is not None,
            cohesionBroken=True,
        )

    def _hertz(self, i, j, law, mass, radius):
        seen = mass  # by YADE's dashpot, which takes a sphere that nothing moves for an infinite mass
        if j < self.n:
            dynamic = [k for k in (i, j) if not self.held[k].all() or self.rotating[k]]
            seen = self.mass[dynamic[0]] if len(dynamic) == 1 else mass
        rolling = law["rolling"]
        return MindlinPhys(
            kno=4.0 / 3.0 * law["e_star"] * math.sqrt(radius),
            kso=8.0 * law["g_star"] * math.sqrt(radius),
            tangensOfFrictionAngle=law["mu"] if carries_shear(law) else 0.0,
            betan=math.sqrt(5.0 / 6.0 * mass / seen) * law["beta"],
            adhesionForce=4.0 * math.pi * law["surface_energy"] * radius,
            kr=rolling["kr"] if rolling else 0.0,
            maxBendPl=rolling["mu"] * radius if rolling else 0.0,
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
        O.dt = 0.0 if self.dimension == 2 else NO_TIME * self.dt  # dashpots see v_0, but no slip accumulates
        self._set_velocities(self.v0, self.omega0)
        self.stepper.step()
        for i, j, fs in self.preload:
            self._set_shear(i, j, fs)
        if self.preload:
            self.stepper.step()  # bodies do not move yet: the same contacts again, now with the preload in their forces
        self.newton.mask, O.dt = INTEGRATED, self.dt
        self.angle = np.zeros((self.n, 3))
        self._sample(0, self.v0, self.omega0)
        force, torque = self._forces()
        if self.dimension == 3:
            v = self.v0 - np.where(self.held, 0.0, 0.5 * self.dt * (force / self.mass[:, None] + self.gravity))
            omega = self.omega0 - self._gain(torque)
        else:
            mass = self.mass[:, None]
            v = self._before(self.v0, self.dt / mass * (force + mass * self.gravity))
            turned = self._before(self.omega0, self.dt * torque / self.inertia)
            omega = np.where(self.rotating, turned, self.omega0)
        self._set_velocities(v, omega)

    def _before(self, v, kick):
        """Velocities from which the first step, which adds ``kick``, comes to those of t_{1/2}."""
        return (1.0 - self.a) * v + 0.5 * kick - kick / self.inflate

    def _set_velocities(self, v, omega):
        for state, velocity, spin in zip(self.states, in_3d(v), spin_in_3d(omega)):  # noqa: B905
            state.vel, state.angVel = Vector3(*velocity), Vector3(*spin)

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
        rest, spent, dt = len(self.path) - 1, 0.0, self.dt
        states, decay, step_once = self.states, self.decay, self.stepper.step
        turning = [states[i] for i in np.flatnonzero(self.rotating).tolist()]
        turned = []  # of spheres: numbers, as rows of arrays take ten times as long
        if self.dimension == 3:
            spinning = np.flatnonzero(self.rotating | self.omega0.any(axis=1)).tolist()
            turned = [(i, states[i], [0.0, 0.0, 0.0]) for i in spinning]
        begin = clock()
        for step in range(1, max(wanted) + 1):
            if decay != 1.0 and step > 1:
                for state in states:
                    state.vel = state.vel * decay
                for state in turning:
                    state.angVel = state.angVel * decay
            if step <= rest:
                for wall, row in zip(self.boxes, self.path[step]):  # noqa: B905
                    wall.place(row)
            self.now = step
            step_once()
            for _, state, angle in turned:
                spin = state.angVel
                angle[0] += spin[0] * dt
                angle[1] += spin[1] * dt
                angle[2] += spin[2] * dt
            if step in wanted:
                spent += clock() - begin
                for i, _, angle in turned:
                    self.angle[i] = angle
                self._sample(step // self.substeps)
                begin = clock()
        return spent + clock() - begin

    def _forces(self):
        """Forces [N] and torques [N m] on the bodies, in the scene's components."""
        bodies = self.ids[: self.n]
        return self._own(map(O.forces.f, bodies)), self._own_spins(map(O.forces.t, bodies))

    def _own(self, found):
        return vectors(found)[:, : self.dimension]

    def _own_spins(self, found):
        return vectors(found)[:, 2] if self.dimension == 2 else vectors(found)

    def _sample(self, step, v=None, omega=None):
        """Append one sample; velocities are synchronised with the forces unless they are given (step 0)."""
        if v is None:
            force, torque = self._forces()
            half, spin = self._own(s.vel for s in self.states), self._own_spins(s.angVel for s in self.states)
            v = np.where(self.held, half, self._synchronised(half, force / self.mass[:, None] + self.gravity))
            if self.dimension == 3:
                omega = spin + self._gain(torque)
            else:
                omega = np.where(self.rotating, self._synchronised(spin, torque / self.inertia), spin)
        found = {}
        for pair in self.pairs:
            contact = self._touching(*pair)
            if contact is not None:
                found[pair] = self._contact(contact, pair[0])
        angle = self.angle.copy() if self.dimension == 3 else self._angles(step, omega)
        loads = self._own(map(O.forces.f, self.ids[self.n :]))
        elastic = self._elastic() if self.dimension == 2 else None
        self.sample(step, self._own(s.pos for s in self.states), v, omega, angle, found, loads, elastic)

    def _synchronised(self, half, acceleration):
        """Velocities at the sampled time from those half a step before and the accelerations."""
        if self.central:
            return (half + 0.5 * self.dt * acceleration) / (1.0 + self.a)
        return half + 0.5 * self.dt * (acceleration - self.xi * half)

    def _gain(self, torque):
        """What half a step adds to the spins of spheres."""
        return np.where(self.rotating[:, None], 0.5 * self.dt * torque / self.inertia[:, None], 0.0)

    def _angles(self, step, omega):
        """Angles of disks without jumps: whole turns are added as the mean spin since the last sample asks."""
        angle = np.array([2.0 * math.atan2(q[2], q[3]) for q in (s.ori for s in self.states)])
        if self.samples:
            last, _, _, spun, turned, *_ = self.samples[-1]
            length = self.substeps * self.dt
            expected = turned + 0.5 * (spun + omega) * (step * length - last * length)
            angle = angle + 2.0 * math.pi * np.round((expected - angle) / (2.0 * math.pi))
        return angle

    def _contact(self, contact, i):
        """(fn, fs) [N] of a contact of body ``i``."""
        physics, normal = contact.phys, contact.geom.normal
        fn, shear = physics.normalForce.dot(normal), physics.shearForce
        if self.dimension == 3:
            shear = np.array(list(shear))
            return fn, -shear if contact.id1 == self.ids[i] else shear
        sign, t = self._tangent(contact, i)
        return fn, -sign * (shear[0] * t[0] + shear[1] * t[1])

    def _elastic(self):
        if not self.given:
            return self.contact_laws[0].elasticEnergy()
        energy = 0.0
        for contact in O.interactions:
            physics = contact.phys
            energy += 0.5 * physics.kn * max(contact.geom.penetrationDepth, 0.0) ** 2
            energy += 0.5 * physics.shearForce.squaredNorm() / physics.ks
            if self.six and physics.kr > 0.0:
                energy += 0.5 * physics.moment_bending.squaredNorm() / physics.kr
        return energy


def vectors(found):
    """YADE's vectors as an array, shape (n, 3); component by component, as iterating one is slow."""
    return np.array([(u[0], u[1], u[2]) for u in found]).reshape(-1, 3)


def remove_temporary_folder():
    """Remove YADE's own temporary folder (it heeds no TMPDIR) while it is empty: nobody would after a kill or a short exit."""
    folder = os.path.dirname(O.tmpFilename())
    with contextlib.suppress(OSError):
        os.rmdir(folder)
        print("removed", folder)


if __name__ == "__main__":
    remove_temporary_folder()
    serve(Run)
    sys.stdout.flush()
    os._exit(0)  # YADE's own exit waits for its network threads
