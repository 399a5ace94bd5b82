"""Spheres in space in YADE, run by the plane's driver: the same cycle, planes as faces of large fixed boxes.

Hertz-Mindlin is MindlinPhys, whose constants this driver gives pair by pair: ``kno = (4/3) E* sqrt(R)``, ``kso = 8 G* sqrt(R)`` and
``betan = sqrt(5/6) beta``, as its dashpot is ``2 betan sqrt(m S)``. The linear law is ViscElPhys, or CohFrictPhys where a spring resists
spins.
"""

import math

import numpy as np
import yade
from driver_parts import clock
from space_parts import SpaceRun, rough
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
    Law2_ScGeom_MindlinPhys_Mindlin,
    Law2_ScGeom_ViscElPhys_Basic,
    MindlinPhys,
    NewtonIntegrator,
    O,
    Vector3,
    ViscElPhys,
)
from yade.minieigenHP import Quaternion
from yade.utils import box, sphere
from yade_parts import DISK_MASK, INTEGRATED, NOBODY, WALL_MASK, WALLS_APART, Stepper

SMALL_SCENE = 200  # bodies up to which the collider runs at every step: it costs nothing there
HALF_PLANE = 1e6  # half-length of a wall's box in units of the scene's size: only its face counts
NO_TIME = 1e-30  # of a step: dashpots see v_0, no slip accumulates, and YADE can divide by it


class Run(SpaceRun):
    """One simulation."""

    name = "YADE"

    def __init__(self, request):
        O.reset()  # what a run before has left in this process
        super().__init__(request)
        self.m = len(self.walls)
        laws = self.all_laws
        self.moments = any(law["rolling"] for law in laws if law["e_star"])
        self.six = any(law["rolling"] or law["twisting"] for law in laws if law["kn"])
        self._bodies()
        self._engines()

    def version(self):
        return str(yade.config.version)

    def settings(self):
        return {"contact_law": ", ".join(type(law).__name__ for law in self.contact_laws)}

    def _bodies(self):
        """Walls come first: YADE wants a box before a sphere, and cannot swap a pair that already has its physics."""
        O.materials.append(FrictMat())
        self.middle = 0.5 * (self.x0.min(axis=0) + self.x0.max(axis=0))
        size = float(np.ptp(self.x0, axis=0).max() + self.radius.max())
        self.boxes = [Plane(row, self.middle, float(self.radius.max()), HALF_PLANE * size) for row in self.path[0]]
        for i in range(self.n):
            body = sphere(self.x0[i].tolist(), float(self.radius[i]), material=O.materials[0])
            body.mask = WALL_MASK if self.fixed[i] else DISK_MASK
            state = body.state
            state.mass = float(self.mass[i])
            state.inertia = Vector3(1, 1, 1) * float(self.inertia[i])
            held = "".join(name for name, flag in zip("xyz", self.held[i], strict=True) if flag)
            state.blockedDOFs = held + ("" if self.rotating[i] else "XYZ")
            O.bodies.append(body)
        self.ids = [*range(self.m, self.m + self.n), *range(self.m)]  # YADE's number of each body of the scene
        self.states = [O.bodies[k].state for k in self.ids[: self.n]]

    def _engines(self):
        spheres = (Ig2_Sphere_Sphere_ScGeom6D if self.six else Ig2_Sphere_Sphere_ScGeom)(avoidGranularRatcheting=False)
        geometry = [spheres, Ig2_Box_Sphere_ScGeom6D() if self.six else Ig2_Box_Sphere_ScGeom()]
        adhesive = any(law["surface_energy"] for law in self.all_laws)
        self.contact_laws = [
            Law2_ScGeom_MindlinPhys_Mindlin(includeMoment=self.moments, includeAdhesion=adhesive),
            Law2_ScGeom_ViscElPhys_Basic(),
        ]
        if self.six:
            self.contact_laws.append(
                Law2_ScGeom6D_CohFrictPhys_CohesionMoment(useIncrementalForm=True, always_use_moment_law=True)
            )
        self.newton = NewtonIntegrator(
            damping=0, gravity=Vector3(*self.gravity), mask=INTEGRATED, warnNoForceReset=False
        )
        collider = InsertionSortCollider([Bo1_Sphere_Aabb(), Bo1_Box_Aabb()], avoidSelfInteractionMask=WALLS_APART)
        if self.n + self.m <= SMALL_SCENE:
            collider.verletDist = 0.0
        loop = InteractionLoop(geometry, [Ip2_FrictMat_FrictMat_FrictPhys()], self.contact_laws)
        self.stepper = Stepper([self.newton, ForceResetter()], collider, loop, self.give_physics)
        O.dt = self.dt

    def give_physics(self):
        """Constants of new pairs, before YADE derives them from materials."""
        for contact in O.interactions.all(onlyReal=False):
            if contact.phys is None:
                contact.phys = self._physics(*self._bodies_of(contact))

    def _bodies_of(self, contact):
        """Numbers of a contact's bodies in the scene, in order."""
        first, second = sorted((contact.id1, contact.id2))
        return (second - self.m, self.n + first) if first < self.m else (first - self.m, second - self.m)

    def _physics(self, i, j):
        law, (mass, radius) = self.law_of(i, j), self.reduced(i, j)
        mu = law["mu"] if rough(law) else 0.0
        if law["e_star"]:
            seen = mass  # by YADE's dashpot, which takes a sphere that nothing moves for an infinite mass
            if j < self.n:
                dynamic = [k for k in (i, j) if not self.held[k].all() or self.rotating[k]]
                seen = self.mass[dynamic[0]] if len(dynamic) == 1 else mass
            rolling = law["rolling"]
            return MindlinPhys(
                kno=4.0 / 3.0 * law["e_star"] * math.sqrt(radius),
                kso=8.0 * law["g_star"] * math.sqrt(radius),
                tangensOfFrictionAngle=mu,
                betan=math.sqrt(5.0 / 6.0 * mass / seen) * law["beta"],
                adhesionForce=4.0 * math.pi * law["surface_energy"] * radius,
                kr=rolling["kr"] if rolling else 0.0,
                maxBendPl=rolling["mu"] * radius if rolling else 0.0,
            )
        # A contact without friction or without shear spring carries no shear force; ks > 0 keeps YADE's energy defined.
        springs = {"kn": law["kn"], "ks": law["ks"] if mu else law["kn"], "tangensOfFrictionAngle": mu}
        if not self.six:
            return ViscElPhys(**springs, cn=2.0 * law["beta"] * math.sqrt(mass * law["kn"]), cs=0.0)
        rolling, twisting = law["rolling"], law["twisting"]
        return CohFrictPhys(
            **springs,
            kr=rolling["kr"] if rolling else 0.0,
            maxRollPl=rolling["mu"] * radius if rolling else 0.0,
            ktw=twisting["kr"] if twisting else 0.0,
            maxTwistPl=twisting["mu"] * radius if twisting else 0.0,
            momentRotationLaw=rolling is not None or twisting is not None,
            cohesionBroken=True,
        )

    def start(self):
        """Step 0: contacts of the initial overlaps, first sample, and the velocities of the first step."""
        # The integrator must run, if only on nobody: it makes YADE's per-thread forces ready to be reset.
        self.newton.mask = NOBODY
        O.dt = NO_TIME * self.dt
        for i, state in enumerate(self.states):
            state.vel, state.angVel = Vector3(*self.v0[i]), Vector3(*self.omega0[i])
        self.stepper.step()
        self.newton.mask, O.dt = INTEGRATED, self.dt
        self.angle = np.zeros((self.n, 3))
        self._sample(0, self.v0, self.omega0)
        force, torque = self._forces()
        v = self.v0 - np.where(self.held, 0.0, 0.5 * self.dt * (force / self.mass[:, None] + self.gravity))
        turning = self.rotating[:, None]
        omega = self.omega0 - np.where(turning, 0.5 * self.dt * torque / self.inertia[:, None], 0.0)
        for i, state in enumerate(self.states):
            state.vel, state.angVel = Vector3(*v[i]), Vector3(*omega[i])

    def advance(self, sampled):
        """All steps; returns the seconds spent on them, sampling apart, see `clock`."""
        wanted = {step * self.substeps for step in sampled}
        rest, spent, dt, step_once = len(self.path) - 1, 0.0, self.dt, self.stepper.step
        # Numbers, as rows of arrays take ten times as long.
        turned = [
            (i, self.states[i], [0.0, 0.0, 0.0])
            for i in np.flatnonzero(self.rotating | self.omega0.any(axis=1)).tolist()
        ]
        begin = clock()
        for step in range(1, max(wanted) + 1):
            if step <= rest:
                for wall, row in zip(self.boxes, self.path[step], strict=True):
                    wall.place(row)
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
        """Forces [N] and torques [N m] on the spheres, shape (n, 3)."""
        ids = self.ids[: self.n]
        return vectors(map(O.forces.f, ids)), vectors(map(O.forces.t, ids))

    def _sample(self, step, v=None, omega=None):
        """Append one sample; velocities are synchronised with the forces unless they are given (step 0)."""
        x = vectors(state.pos for state in self.states)
        if v is None:
            force, torque = self._forces()
            gain = 0.5 * self.dt * (force / self.mass[:, None] + self.gravity)
            v = vectors(state.vel for state in self.states) + np.where(self.held, 0.0, gain)
            turned = 0.5 * self.dt * torque / self.inertia[:, None]
            omega = vectors(state.angVel for state in self.states) + np.where(self.rotating[:, None], turned, 0.0)
        found = {}
        for pair in self.pairs:
            i, j = (self.ids[body] for body in pair)
            contact = O.interactions[i, j] if O.interactions.has(i, j) else None
            if contact is not None and contact.isReal:
                shear = np.array(list(contact.phys.shearForce))
                fn = contact.phys.normalForce.dot(contact.geom.normal)
                found[pair] = fn, -shear if contact.id1 == i else shear
        loads = vectors(map(O.forces.f, self.ids[self.n :]))
        self.sample(step, x, v, omega, self.angle.copy(), found, loads)


class Plane:
    """A plane as the face of a large fixed box, opposite the middle of the spheres.

    The box is turned from the nearest axis by the shortest way, so that a plane along axes is exact to the last bit. It does not turn
    about its own normal, only its velocity tells of such a spin.
    """

    def __init__(self, row, middle, depth, size):
        self.middle, self.depth = middle, depth
        axis = int(np.argmax(np.abs(row[3:6])))
        self.facing = np.zeros(3)
        self.facing[axis] = math.copysign(1.0, row[3 + axis])
        extents = np.full(3, size)
        extents[axis] = depth
        body = box((0, 0, 0), extents.tolist(), fixed=True, material=O.materials[0])
        body.mask = WALL_MASK
        O.bodies.append(body)
        self.state, self.placed = body.state, b""
        self.place(row)

    def place(self, row):
        """Put the face where a row of the path says, and give the box its velocity there."""
        text = row.tobytes()
        if text == self.placed:  # nothing else moves a plane
            return
        self.placed = text
        point, normal, velocity, spin = row.reshape(4, 3)
        along = self.middle - point
        centre = point + (along - (along @ normal) * normal) - self.depth * normal
        state = self.state
        state.pos = Vector3(*centre)
        if (normal != self.facing).any():
            state.ori = Quaternion(*quaternion(self.facing, normal))
        else:
            state.ori = Quaternion(1, 0, 0, 0)
        state.vel = Vector3(*(velocity + np.cross(spin, centre - point)))
        state.angVel = Vector3(*spin)


def quaternion(one, two):
    """Unit quaternion (w, x, y, z) of the shortest rotation from one direction to another, less than half a turn away."""
    values = np.array([1.0 + one @ two, *np.cross(one, two)])
    return (values / np.linalg.norm(values)).tolist()


def vectors(found):
    """YADE's vectors as an array, shape (n, 3); component by component, as iterating one is slow."""
    return np.array([(u[0], u[1], u[2]) for u in found]).reshape(-1, 3)
