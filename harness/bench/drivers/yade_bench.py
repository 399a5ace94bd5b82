"""YADE (``yade -n -x -j1``) on one benchmark problem: all steps in a loop over ``O.step``.

``O.run`` with waiting looks every 40 ms whether the steps are done, which can double the time of a small problem; the loop costs less
than can be measured. The collider enlarges each box by half the skin that the peers are given; YADE's own choice, half the smallest
radius, lists half as many pairs again and is a tenth slower on a packing at rest.

Each contact that exists at the start has the scene's dashpot ``c = 2 beta sqrt(m_eff kn)``. One that forms later has what
YADE's own rule, ``a b/(a + b)``, makes of constants ``a, b`` of the two bodies: ``sqrt(8 m kn) beta`` of a disk of mass m is
exact for two equal ones and up to 2 % too much where one radius is 1.5 times the other; a wall's constant is exact for the
disk of mean mass. The engines are ordered so that between two steps the state is (positions t_n, forces t_n,
velocities t_{n-1/2}); a step of length 0 finds the contacts, and the velocities that follow make ``v_{1/2} = v_0 + dt/2 a_0``.
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
    Ig2_Box_Sphere_ScGeom,
    Ig2_Sphere_Sphere_ScGeom,
    InsertionSortCollider,
    InteractionLoop,
    Ip2_ViscElMat_ViscElMat_ViscElPhys,
    Law2_ScGeom_ViscElPhys_Basic,
    NewtonIntegrator,
    O,
    Vector3,
    ViscElMat,
)
from yade.utils import sphere
from yade_parts import DISK_MASK, WALLS_APART, WallBox

FAR = 1e6
"""Half-length of a wall's box in units of the scene's size: only its face counts."""


DISK, WALL = math.sqrt(8.0), 2.0 * math.sqrt(8.0) / (math.sqrt(8.0) - 2.0)
"""Dashpot constants over ``beta sqrt(m kn)`` with which a b/(a + b) is sqrt(2) between equal disks and 2 at a wall."""


def material(law, factor, mass):
    """Half of each spring in series gives a pair the whole law."""
    dashpot, angle = factor * law["beta"] * math.sqrt(mass * law["kn"]), math.atan(law["mu"])
    return ViscElMat(kn=2 * law["kn"], ks=2 * law["ks"], cn=dashpot, cs=0.0, frictionAngle=angle)


def build(request):
    """Bodies and engines; the disks' states in the scene's order."""
    x, radius, mass, inertia = (request[name] for name in ("x", "radius", "mass", "inertia"))
    middle, widest = 0.5 * (x.min(axis=0) + x.max(axis=0)), float(radius.max())
    size = FAR * (float(np.ptp(x, axis=0).max()) + widest)
    for wall in request["walls"]:  # YADE wants a box before a sphere
        row = np.array([*wall["point"], *wall["normal"], *wall["point"], 0.0, 0.0, 0.0])
        WallBox(row, middle, widest, size, material(wall["law"], WALL, float(mass.mean())))
    for i in range(len(x)):
        own = material(request["law"], DISK, float(mass[i]))
        body = sphere((float(x[i, 0]), float(x[i, 1]), 0.0), float(radius[i]), material=own)
        body.mask = DISK_MASK
        body.state.mass = float(mass[i])
        body.state.inertia = Vector3(1, 1, 1) * float(inertia[i])
        body.state.blockedDOFs = "zXY"
        O.bodies.append(body)
    geometry = [Ig2_Sphere_Sphere_ScGeom(avoidGranularRatcheting=False), Ig2_Box_Sphere_ScGeom()]
    O.engines = [
        NewtonIntegrator(damping=0, gravity=Vector3(*request["gravity"], 0.0), mask=4),
        ForceResetter(),
        InsertionSortCollider(
            [Bo1_Sphere_Aabb(), Bo1_Box_Aabb()],
            avoidSelfInteractionMask=WALLS_APART,
            verletDist=0.5 * request["skin"],
        ),
        InteractionLoop(geometry, [Ip2_ViscElMat_ViscElMat_ViscElPhys()], [Law2_ScGeom_ViscElPhys_Basic()]),
    ]
    return [O.bodies[len(request["walls"]) + i].state for i in range(len(x))]


def set_dashpots(request):
    """Give each contact that exists its own dashpot."""
    m, mass, walls = len(request["walls"]), request["mass"], request["walls"]
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
        each.vel, each.angVel = Vector3(*v[i], 0.0), Vector3(0.0, 0.0, float(omega[i]))
    O.dt = 0.0
    O.step()
    set_dashpots(request)
    O.step()
    for i, each in enumerate(states):
        force, torque = O.forces.f(m + i), O.forces.t(m + i)[2]
        pull = Vector3(*request["gravity"], 0.0) + force / float(request["mass"][i])
        each.vel = each.vel - 0.5 * dt * pull
        each.angVel = each.angVel - Vector3(0.0, 0.0, 0.5 * dt * torque / float(request["inertia"][i]))
    O.dt = dt


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
        x = np.array([(each.pos[0], each.pos[1]) for each in states])
        half = np.array([(each.vel[0], each.vel[1]) for each in states])
        force = np.array([(f[0], f[1]) for f in (O.forces.f(m + i) for i in range(len(states)))])
        torque = np.array([O.forces.t(m + i)[2] for i in range(len(states))])
        pull = force / request["mass"][:, None] + np.array(request["gravity"])
        v = half + 0.5 * request["dt"] * pull
        omega = np.array([each.angVel[2] for each in states]) + 0.5 * request["dt"] * torque / request["inertia"]
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
