"""Driver that runs Siconos' kernel under the system's Python: a request on standard input, an answer file out.

It knows the wire format only. The scene becomes

- a `LagrangianLinearTIDS` for each disk, ``q = (x, y, angle)``, with an explicit mass matrix and ``C = xi M``; a spin that
  is blocked has an inertia 2^200 times its own, which no double of the contact problem can tell from an infinite one, and
  therefore keeps its prescribed value;
- a `DiskDiskR` for each pair of disks, a `LagrangianLinearTIR` ``y = H q + b`` for each disk and wall, and a
  `NewtonImpactFrictionNSL` each; a wall that moves is a body of its own, 2^200 times heavier than the disks, which is put
  on its path before each step and given the step's mean velocity;
- one `TimeStepping` with `MoreauJeanOSI` and a two-dimensional `FrictionContact` problem. Positions advance by
  ``dt (theta v+ + (1 - theta) v-)``; contacts count as closed when ``gap + dt/2 d(gap)/dt`` is not above the threshold of
  round-off that the request gives.

All masses are divided by one power of two, so that the contact problem has numbers near 1: Siconos' residual mixes impulses
and velocities, and its Gauss-Seidel takes 1e-12 for 0 whatever the units. That changes no bit of the motion.
"""

import json
import math
import os
import sys
import time

import numpy as np
import siconos
import siconos.kernel as sk
import siconos.numerics as sn
from siconos.mechanics.collision.bodies import DiskDiskR
from siconos_error import natural_map
from siconos_history import history

PRESCRIBED = 2.0**200
SOLVERS = {"nsgs": sn.SICONOS_FRICTION_2D_NSGS, "lemke": sn.SICONOS_FRICTION_2D_LEMKE}


class Run:
    """One simulation."""

    def __init__(self, request):
        scene, options = request["scene"], request["extra"]["options"]
        self.dt, self.disks, self.gravity = request["numerics"]["dt"], scene["disks"], scene["gravity"]
        self.n, self.m = len(self.disks["radius"]), len(scene["walls"])
        self.pairs = [tuple(pair) for pair in request["watch"]]
        self.path = np.load(request["extra"]["wall_path"])
        self.unit = 2.0 ** round(math.log2(float(np.median(self.disks["mass"])))) if self.n else 1.0
        self.tolerance = options["siconos.tolerance"]
        self.samples, self.worst = [], 0.0
        self.nsds = sk.NonSmoothDynamicalSystem(0.0, self.dt * (request["numerics"]["n_steps"] + 2))
        self.bodies = [self._disk(i, scene["xi"]) for i in range(self.n)]
        self.walls = [self._wall(w) for w in range(self.m)]
        self.contacts = {}
        self._contacts(scene)
        self._simulation(options, request["extra"]["threshold"])

    def _disk(self, i, xi):
        disks = self.disks
        mass, inertia = disks["mass"][i] / self.unit, disks["inertia"][i] / self.unit
        if not disks["rotating"][i]:
            inertia *= PRESCRIBED
        matrix = np.diag([mass, mass, inertia])
        damping = xi * np.diag([mass, mass, inertia if disks["rotating"][i] else 0.0])
        q, v = [*disks["x"][i], 0.0], [*disks["v"][i], disks["omega"][i]]
        body = sk.LagrangianLinearTIDS(np.array(q), np.array(v), matrix, np.zeros((3, 3)), damping)
        body.setFExtPtr(np.array([mass * self.gravity[0], mass * self.gravity[1], 0.0]))
        self.nsds.insertDynamicalSystem(body)
        return body

    def _wall(self, w):
        """The body of a wall that moves; None for one at rest."""
        if not (self.path[:, w, 0:2] != self.path[0, w, 0:2]).any():
            return None
        body = sk.LagrangianLinearTIDS(self.path[0, w, 0:2].copy(), self._chord(w, 0), PRESCRIBED * np.eye(2))
        self.nsds.insertDynamicalSystem(body)
        return body

    def _place(self, step):
        """Row of the walls' path at a step; the last one lasts."""
        return min(step, len(self.path) - 1)

    def _chord(self, w, step):
        """Mean velocity of a wall over the step that begins at ``step``."""
        here, there = self.path[self._place(step), w, 0:2], self.path[self._place(step + 1), w, 0:2]
        return (there - here) / self.dt

    def _contacts(self, scene):
        radius = self.disks["radius"]
        for i in range(self.n):
            for j in range(i + 1, self.n):
                relation = DiskDiskR(radius[i], radius[j])
                self._link(i, j, scene["disk_disk"], relation, self.bodies[i], self.bodies[j])
            for w, wall in enumerate(scene["walls"]):
                bodies = [self.bodies[i]] if self.walls[w] is None else [self.bodies[i], self.walls[w]]
                self._link(i, self.n + w, wall["law"], self._half_plane(i, w), *bodies)

    def _half_plane(self, i, w):
        """``y = (gap, slip)`` of a disk on a wall: gap = N (x - p) - R; the slip is that of the disk against the wall."""
        (px, py), (nx, ny) = self.path[0, w, 0:2], self.path[0, w, 2:4]
        radius = self.disks["radius"][i]
        # The contact's normal n is -N, so that its tangent (-n_y, n_x) is (N_y, -N_x).
        rows = np.array([[nx, ny, 0.0], [ny, -nx, radius]])
        if self.walls[w] is not None:
            return sk.LagrangianLinearTIR(np.hstack([rows, -rows[:, 0:2]]), np.array([-radius, 0.0]))
        return sk.LagrangianLinearTIR(rows, np.array([-(nx * px + ny * py) - radius, 0.0]))

    def _link(self, i, j, law, relation, *bodies):
        impact = sk.NewtonImpactFrictionNSL(law["restitution"] or 0.0, 0.0, law["mu"], 2)
        contact = sk.Interaction(impact, relation)
        self.nsds.link(contact, *bodies)
        self.contacts[i, j] = contact

    def _simulation(self, options, threshold):
        self.osi = sk.MoreauJeanOSI(options["siconos.theta"])
        self.osi.setConstraintActivationThreshold(threshold)
        self.problem = sk.FrictionContact(2, SOLVERS[options["siconos.solver"]])
        self.solver = self.problem.numericsSolverOptions()
        self.solver.dparam[sn.SICONOS_DPARAM_TOL] = self.tolerance
        self.solver.iparam[sn.SICONOS_IPARAM_MAX_ITER] = options["siconos.max_iterations"]
        clock = sk.TimeDiscretisation(0.0, self.dt)
        self.simulation = sk.TimeStepping(self.nsds, clock, self.osi, self.problem)
        self.simulation.setNewtonOptions(sk.SICONOS_TS_LINEAR)
        self.simulation.setWarnOnNonConvergence(False)

    def advance(self, sampled):
        """All steps; returns the seconds spent on them, sampling apart."""
        wanted, spent = set(sampled), 0.0
        self._sample(0)
        moving = [(w, body) for w, body in enumerate(self.walls) if body is not None]
        begin = time.perf_counter()
        for step in range(1, max(wanted) + 1):
            self.simulation.computeOneStep()
            self._check_solver(step)
            if step in wanted:
                now = time.perf_counter()
                spent += now - begin
                self._sample(step)
                begin = time.perf_counter()
            for w, body in moving:  # nextStep() keeps these as the state at the beginning of the next step
                body.q()[:] = self.path[self._place(step), w, 0:2]
                body.velocity()[:] = self._chord(w, step)
            self.simulation.nextStep()
        return spent + time.perf_counter() - begin

    def _check_solver(self, step):
        """Hold the step's reactions against Siconos' own error function: its solvers' word is not enough.

        Their criteria are other norms, relative to ``|q|``; ten times the tolerance tells success from failure.
        """
        size = self.problem.getSizeOutput()
        if size == 0:
            return
        residual, _ = natural_map(self.problem.frictionContactProblemPtr(), self.problem.z()[:size])
        self.worst = max(self.worst, residual)
        limit = 10.0 * self.tolerance
        if not residual <= limit:
            raise RuntimeError(
                f"the contact solver left the residual {residual:.3g} in step {step}, after "
                f"{self.solver.iparam[sn.SICONOS_IPARAM_ITER_DONE]} iterations; the limit is {limit:.3g}: loosen "
                f"siconos.tolerance, raise siconos.max_iterations or try another siconos.solver"
            )

    def _sample(self, step):
        """Append one sample; forces are those of the step that ends here, none at step 0."""
        q = np.array([body.q() for body in self.bodies]).reshape(-1, 3)
        v = np.array([body.velocity() for body in self.bodies]).reshape(-1, 3)
        watched = np.array([self._force(pair) for pair in self.pairs]).reshape(-1, 2)
        on_walls = np.zeros((self.m, 2))
        normals = self.path[self._place(step), :, 2:4]
        for i, j in self.contacts:
            if j >= self.n:
                fn, fs = self._force((i, j))
                nx, ny = normals[j - self.n]
                on_walls[j - self.n] += (-fn * nx - fs * ny, -fn * ny + fs * nx)
        self.samples.append((step, q, v, watched, on_walls))

    def _force(self, pair):
        """``(fn, fs)`` [N], means over the step."""
        impulse = self.contacts[pair].lambda_(1)
        # DiskDiskR counts the tangent clockwise.
        sign = -1.0 if pair[1] < self.n else 1.0
        return self.unit * impulse[0] / self.dt, sign * self.unit * impulse[1] / self.dt


def main():
    """Read the request, run it, write the answer; any exception becomes an ``error`` answer."""
    begin = time.perf_counter()
    request = json.load(sys.stdin)
    try:
        run = Run(request)
        setup = time.perf_counter() - begin
        advance = run.advance(request["sampled_steps"])
        answer = {
            "wire_version": 1,
            "engine_version": siconos.version,
            "timings": {"setup": setup, "warm_up": 0.0, "advance": advance},
            "settings": {"largest_solver_residual": run.worst},
            "history": history(run),
        }
    except Exception as error:  # the harness shows the text; a traceback would only bury it
        answer = {"wire_version": 1, "error": f"{type(error).__name__}: {error}"}
    with open(request["answer_file"], "w", encoding="utf-8") as out:
        out.write(json.dumps(answer))
    sys.stdout.flush()
    os._exit(0)  # Siconos' objects and Python's may be destroyed in an order that crashes


main()
