"""YADE (``yade -n -x -j1``) on one benchmark problem: all steps in a loop over ``O.step``.

``O.run`` with waiting looks every 40 ms whether the steps are done, which can double the time of a small problem; the loop costs less
than can be measured. The collider enlarges each box by half the skin that the peers are given; YADE's own choice, half the smallest
radius, lists half as many pairs again and is a tenth slower on a packing at rest.

Each contact that exists at the start has the scene's dashpot ``c = 2 beta sqrt(m_eff kn)``. One that forms later has what
YADE's own rule, ``a b/(a + b)``, makes of constants ``a, b`` of the two bodies: ``sqrt(8 m kn) beta`` of a disk of mass m is
exact for two equal ones and up to 2 % too much where one radius is 1.5 times the other; a wall's constant is exact for the
disk of mean mass. The engines are ordered so that between two steps the state is (positions t_n, forces t_n,
velocities t_{n-1/2}); a step of no length finds the contacts, and the velocities that follow make ``v_{1/2} = v_0 + dt/2 a_0``.

Spheres in space have MindlinPhys by YADE's own rule, with ``betan = sqrt(5/6) beta``. At a box it takes half the sphere's radius for the
reduced one: contacts with walls that exist at the start get the law's stiffnesses, later ones keep YADE's.
"""

import contextlib
import math
import os
import sys
import time

import numpy as np
import yade

sys.path.insert(0, os.path.dirname(os.path.abspath(sys.argv[0])))  # YADE runs this file without its folder on the path
sys.path.insert(1, os.path.join(sys.path[0], "..", "..", "engines", "yade"))
from dem_request import kinetic, read_request, resident, write_answer
from yade import (
    Bo1_Box_Aabb,
    Bo1_Sphere_Aabb,
    ForceResetter,
    FrictMat,
    Ig2_Box_Sphere_ScGeom,
    Ig2_Sphere_Sphere_ScGeom,
    InsertionSortCollider,
    InteractionLoop,
    Ip2_FrictMat_FrictMat_MindlinPhys,
    Ip2_ViscElMat_ViscElMat_ViscElPhys,
    Law2_ScGeom_MindlinPhys_Mindlin,
    Law2_ScGeom_ViscElPhys_Basic,
    NewtonIntegrator,
    O,
    Vector3,
    ViscElMat,
)
from yade.utils import box, sphere
from yade_parts import DISK_MASK, WALL_MASK, WALLS_APART, WallBox2D

FAR = 1e6
"""Half-length of a wall's box in units of the scene's size: only its face counts."""


NO_TIME = 1e-30
"""A step in which nothing moves, over the contact step: MindlinPhys divides by it."""

DISK, WALL = math.sqrt(8.0), 2.0 * math.sqrt(8.0) / (math.sqrt(8.0) - 2.0)
"""Dashpot constants over ``beta sqrt(m kn)`` with which a b/(a + b) is sqrt(2) between equal disks and 2 at a wall."""


def in_space(request):
    """Whether the bodies are spheres in space."""
    return request["x"].shape[1] == 3


def material(law, factor, mass):
    """Half of each spring in series gives a pair the whole law; spheres in space have that of the bodies."""
    if "young" in law:
        return FrictMat(young=law["young"], poisson=law["poisson"], frictionAngle=math.atan(law["mu"]))
    dashpot, angle = factor * law["beta"] * math.sqrt(mass * law["kn"]), math.atan(law["mu"])
    return ViscElMat(kn=2 * law["kn"], ks=2 * law["ks"], cn=dashpot, cs=0.0, frictionAngle=angle)


def build(request):
    """Bodies and engines; the disks' states in the scene's order."""
    x, radius, mass, inertia = (request[name] for name in ("x", "radius", "mass", "inertia"))
    middle, widest = 0.5 * (x.min(axis=0) + x.max(axis=0)), float(radius.max())
    size = FAR * (float(np.ptp(x, axis=0).max()) + widest)
    for wall in request["walls"]:  # YADE wants a box before a sphere
        own = material(wall["law"], WALL, float(mass.mean()))
        if in_space(request):
            plane(wall, middle, widest, size, own)
            continue
        row = np.array([*wall["point"], *wall["normal"], *wall["point"], 0.0, 0.0, 0.0])
        WallBox2D(row, middle, widest, size, own)
    for i in range(len(x)):
        own = material(request["law"], DISK, float(mass[i]))
        body = sphere((*x[i].tolist(), 0.0)[:3], float(radius[i]), material=own)
        body.mask = DISK_MASK
        body.state.mass = float(mass[i])
        body.state.inertia = Vector3(1, 1, 1) * float(inertia[i])
        body.state.blockedDOFs = "" if in_space(request) else "zXY"
        O.bodies.append(body)
    laws = [Ip2_ViscElMat_ViscElMat_ViscElPhys()], [Law2_ScGeom_ViscElPhys_Basic()]
    if in_space(request):
        betan = math.sqrt(5.0 / 6.0) * request["law"]["beta"]
        laws = [Ip2_FrictMat_FrictMat_MindlinPhys(betan=betan, betas=0.0)], [Law2_ScGeom_MindlinPhys_Mindlin()]
    geometry = [Ig2_Sphere_Sphere_ScGeom(avoidGranularRatcheting=False), Ig2_Box_Sphere_ScGeom()]
    O.engines = [
        NewtonIntegrator(damping=0, gravity=vector(request["gravity"]), mask=4),
        ForceResetter(),
        InsertionSortCollider(
            [Bo1_Sphere_Aabb(), Bo1_Box_Aabb()],
            avoidSelfInteractionMask=WALLS_APART,
            verletDist=0.5 * request["skin"],
        ),
        InteractionLoop(geometry, *laws),
    ]
    return [O.bodies[len(request["walls"]) + i].state for i in range(len(x))]


def stars(law):
    """``E*, G*`` of two bodies of the law's material."""
    young, poisson = law["young"], law["poisson"]
    return young / (2.0 * (1.0 - poisson**2)), young / (4.0 * (2.0 - poisson) * (1.0 + poisson))


def vector(values):
    """YADE's vector of two or three numbers."""
    return Vector3(*(*map(float, values), 0.0)[:3])


def plane(wall, middle, depth, size, material):
    """A plane along the axes as the face of a large fixed box opposite the middle of the spheres."""
    point, normal = np.array(wall["point"]), np.array(wall["normal"])
    centre = middle - ((middle - point) @ normal) * normal - depth * normal
    extents = np.where(normal == 0.0, size, depth)
    body = box(centre.tolist(), extents.tolist(), fixed=True, material=material)
    body.mask = WALL_MASK
    O.bodies.append(body)


def set_constants(request):
    """Give each contact that exists its own dashpot, and the law's stiffnesses to those of spheres in space with walls."""
    m, mass, walls = len(request["walls"]), request["mass"], request["walls"]
    if in_space(request):
        for contact in O.interactions:
            first, second = sorted((contact.id1, contact.id2))
            if first < m:
                e_star, g_star = stars(walls[first]["law"])
                root = math.sqrt(float(request["radius"][second - m]))
                contact.phys.kno, contact.phys.kso = 4.0 / 3.0 * e_star * root, 8.0 * g_star * root
        return
    for contact in O.interactions:
        first, second = sorted((contact.id1, contact.id2))
        own = float(mass[second - m])
        law = walls[first]["law"] if first < m else request["law"]
        pair = own if first < m else own * float(mass[first - m]) / (own + float(mass[first - m]))
        contact.phys.cn = 2.0 * law["beta"] * math.sqrt(pair * law["kn"])


def start(request, states):
    """Contacts of time 0, and the velocities from which the first step starts."""
    m, dt = len(request["walls"]), request["dt"]
    v, omega = request["v"], request["omega"]
    for i, each in enumerate(states):
        each.vel, each.angVel = vector(v[i]), vector(omega[i]) if in_space(request) else Vector3(0, 0, float(omega[i]))
    O.dt = NO_TIME * dt
    O.step()
    set_constants(request)
    O.step()
    for i, each in enumerate(states):
        pull = vector(request["gravity"]) + O.forces.f(m + i) / float(request["mass"][i])
        torque = O.forces.t(m + i) if in_space(request) else Vector3(0, 0, O.forces.t(m + i)[2])
        each.vel = each.vel - 0.5 * dt * pull
        each.angVel = each.angVel - 0.5 * dt / float(request["inertia"][i]) * torque
    O.dt = dt


def rows(vectors):
    """YADE's vectors as rows, shape (n, 3); component by component, as iterating one is slow."""
    return np.array([(u[0], u[1], u[2]) for u in vectors])


def main():
    """Run one request."""
    with contextlib.suppress(OSError):  # YADE's own temporary folder heeds no TMPDIR
        os.rmdir(os.path.dirname(O.tmpFilename()))
    request = read_request()
    try:
        before = resident()
        states = build(request)
        start(request, states)
        step = O.step
        begin = time.perf_counter()
        for _ in range(int(request["steps"])):
            step()
        seconds = time.perf_counter() - begin
        m, memory = len(request["walls"]), resident() - before
        x, half, spin = (rows(getattr(each, name) for each in states) for name in ("pos", "vel", "angVel"))
        force, torque = (rows(of(m + i) for i in range(len(states))) for of in (O.forces.f, O.forces.t))
        wide = 3 if in_space(request) else 2
        gravity = np.array(vector(request["gravity"]))
        v = half + 0.5 * request["dt"] * (force / request["mass"][:, None] + gravity)
        omega = spin + 0.5 * request["dt"] * torque / request["inertia"][:, None]
        x, v, omega = x[:, :wide], v[:, :wide], omega if wide == 3 else omega[:, 2]
        write_answer(
            request,
            x=x,
            kinetic=kinetic(request, v, omega),
            seconds=seconds,
            memory=memory,
            version=str(yade.config.version),
        )
    except Exception as error:  # the harness shows the text; a traceback would only bury it
        write_answer(request, error=f"{type(error).__name__}: {error}")
    sys.stdout.flush()
    os._exit(0)  # YADE's own exit waits for its network threads


main()
