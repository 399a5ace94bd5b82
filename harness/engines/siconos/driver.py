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

import math
import os
import sys

sys.path.insert(1, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "drivers"))

import numpy as np
import siconos
import siconos.kernel as sk
import siconos.numerics as sn
from driver_parts import Run, clock, serve
from siconos.mechanics.collision.bodies import DiskDiskR
from solver_driver import SOLVERS, natural_map
from space_driver import SiconosSpaceRun

PRESCRIBED = 2.0**200


class SiconosRun(Run):
    """One simulation; forces are means over the step that ends at a sample."""

    force_meaning = "step-mean"

    def __init__(self, request):
        super().__init__(request, request["numerics"]["dt"])
        scene, options = request["scene"], request["extra"]["options"]
        self.disks = scene["disks"]
        self.unit = 2.0 ** round(math.log2(float(np.median(self.disks["mass"])))) if self.n else 1.0
        self.tolerance = options["siconos.tolerance"]
        self.worst = 0.0
        self.nsds = sk.NonSmoothDynamicalSystem(0.0, self.dt * (request["numerics"]["n_steps"] + 2))
        self.bodies = [self._disk(i, scene["xi"]) for i in range(self.n)]
        self.wall_bodies = [self._wall(w) for w in range(len(self.walls))]
        self.contacts = {}
        self._contacts()
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

    def _contacts(self):
        radius = self.disks["radius"]
        for i in range(self.n):
            for j in range(i + 1, self.n):
                relation = DiskDiskR(radius[i], radius[j])
                self._link(i, j, self.law_of(i, j), relation, self.bodies[i], self.bodies[j])
            for w in range(len(self.walls)):
                bodies = [self.bodies[i]] if self.wall_bodies[w] is None else [self.bodies[i], self.wall_bodies[w]]
                self._link(i, self.n + w, self.law_of(i, self.n + w), self._half_plane(i, w), *bodies)

    def _half_plane(self, i, w):
        """``y = (gap, slip)`` of a disk on a wall: gap = N (x - p) - R; the slip is that of the disk against the wall."""
        (px, py), (nx, ny) = self.path[0, w, 0:2], self.path[0, w, 2:4]
        radius = self.disks["radius"][i]
        # The contact's normal n is -N, so that its tangent (-n_y, n_x) is (N_y, -N_x).
        rows = np.array([[nx, ny, 0.0], [ny, -nx, radius]])
        if self.wall_bodies[w] is not None:
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

    def version(self):
        return siconos.version

    def settings(self):
        return {"largest_solver_residual": self.worst}

    def start(self):
        """The sample of time 0."""
        self._sample(0)

    def advance(self, sampled):
        """All steps; returns the seconds spent on them, sampling apart, see `clock`."""
        wanted, spent = set(sampled), 0.0
        moving = [(w, body) for w, body in enumerate(self.wall_bodies) if body is not None]
        begin = clock()
        for step in range(1, max(wanted) + 1):
            if self.forces_on:
                self._push(step)
            self.simulation.computeOneStep()
            self._check_solver(step)
            if step in wanted:
                now = clock()
                spent += now - begin
                self._sample(step)
                begin = clock()
            for w, body in moving:  # nextStep() keeps these as the state at the beginning of the next step
                body.q()[:] = self.path[self._place(step), w, 0:2]
                body.velocity()[:] = self._chord(w, step)
            self.simulation.nextStep()
        return spent + clock() - begin

    def _push(self, step):
        """Gravity and the mean forces of the step that ends at ``step``."""
        loads = self.loads((step - 1) * self.dt, step * self.dt)
        for i, body in enumerate(self.bodies):
            body.fExt()[:] = (loads[i] + self.mass[i] * np.array([*self.gravity, 0.0])) / self.unit

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
        on_walls = np.zeros((len(self.walls), 2))
        pose = self.pose(step)
        for i, j in self.contacts:
            if j >= self.n:
                fn, fs = self._force((i, j))
                nx, ny = pose[j - self.n, 2:4]
                on_walls[j - self.n] += (-fn * nx - fs * ny, -fn * ny + fs * nx)
        if step == 0:
            watched, on_walls = np.full_like(watched, np.nan), np.full_like(on_walls, np.nan)
        omega = np.where(self.rotating, v[:, 2], self.omega0)
        self.sample(step, q[:, 0:2], v[:, 0:2], omega, q[:, 2], watched, pose, on_walls)

    def _force(self, pair):
        """``(fn, fs)`` [N], means over the step."""
        impulse = self.contacts[pair].lambda_(1)
        # DiskDiskR counts the tangent clockwise.
        sign = -1.0 if pair[1] < self.n else 1.0
        return self.unit * impulse[0] / self.dt, sign * self.unit * impulse[1] / self.dt


if __name__ == "__main__":
    serve(lambda request: (SiconosSpaceRun if request["scene"].get("dimension") == 3 else SiconosRun)(request))
    sys.stdout.flush()
    os._exit(0)  # Siconos' objects and Python's may be destroyed in an order that crashes
