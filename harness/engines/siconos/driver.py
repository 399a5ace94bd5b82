"""Driver that runs Siconos' kernel under the system's Python: a request on standard input, an answer file out.

It knows the wire format only. A scene of 2D becomes

- a `LagrangianLinearTIDS` for each disk, ``q = (x, y, angle)``, with an explicit mass matrix and ``C = xi M``; a spin that
  is blocked has an inertia 2^200 times its own, which no double of the contact problem distinguishes from an infinite one, and
  therefore keeps its prescribed value;
- a `DiskDiskR` for each pair of disks, a `LagrangianLinearTIR` ``y = H q + b`` for each disk and wall, and a
  `NewtonImpactFrictionNSL` each; a wall that moves is a separate body, 2^200 times heavier than the disks, which is put
  on its path before each step and given the step's mean velocity;
- one `TimeStepping` with `MoreauJeanOSI` and a two-dimensional `FrictionContact` problem. Positions advance by
  ``dt (theta v+ + (1 - theta) v-)``; contacts count as closed when ``gap + dt/2 d(gap)/dt`` is not above the threshold of
  round-off that the request gives.

A scene of 3D becomes

- a `LagrangianLinearTIDS` for each sphere, whose coordinates are its centre and the integral of its spin, which a sphere's moments of
  inertia allow; what is held or blocked has a mass or an inertia 2^200 times its own, and no weight. So has a wall that moves, with six
  coordinates, too: it is put on its path before each step and given the step's mean velocities;
- a `LagrangianLinearTIR` ``y = H q + b`` for each contact, the gap and the slip along two tangents, whose H and b are set anew at the
  beginning of each step where its normal or its arms change: impulses act along the normal that restitution takes the approach along;
- the same `TimeStepping` with a three-dimensional problem.

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

PRESCRIBED = 2.0**200


class SiconosRun(Run):
    """One simulation; forces are means over the step that ends at a sample. A subclass gives what only its dimension has."""

    name = "Siconos"
    force_meaning = "step-mean"
    needs_a_disk = False

    def __init__(self, request):
        super().__init__(request)
        options = request["extra"]["options"]
        self.unit = 2.0 ** round(math.log2(float(np.median(self.mass)))) if self.n else 1.0
        self.tolerance, self.worst = options["siconos.tolerance"], 0.0
        self.nsds = sk.NonSmoothDynamicalSystem(0.0, self.dt * (request["numerics"]["n_steps"] + 2))
        self.bodies = [self.body(i) for i in range(self.n)]
        self.moving = {w: self.wall_body(w) for w in range(len(self.walls)) if self.moves(w)}
        self.contacts = {}
        for i in range(self.n):
            for j in range(i + 1, self.n + len(self.walls)):
                self.link(i, j)
        self._simulation(options, request["extra"]["threshold"])

    def _simulation(self, options, threshold):
        self.osi = sk.MoreauJeanOSI(options["siconos.theta"])
        self.osi.setConstraintActivationThreshold(threshold)
        solver = SOLVERS[options["siconos.solver"]] if self.dimension == 2 else sn.SICONOS_FRICTION_3D_NSGS
        self.problem = sk.FrictionContact(self.dimension, solver)
        self.solver = self.problem.numericsSolverOptions()
        self.solver.dparam[sn.SICONOS_DPARAM_TOL] = self.tolerance
        self.solver.iparam[sn.SICONOS_IPARAM_MAX_ITER] = options["siconos.max_iterations"]
        self.simulation = sk.TimeStepping(self.nsds, sk.TimeDiscretisation(0.0, self.dt), self.osi, self.problem)
        self.simulation.setNewtonOptions(sk.SICONOS_TS_LINEAR)
        self.simulation.setWarnOnNonConvergence(False)

    def version(self):
        return siconos.version

    def settings(self):
        return {"largest_solver_residual": self.worst}

    def insert(self, q, v, *matrices):
        """A body with these coordinates, velocities, and matrices of mass and more."""
        body = sk.LagrangianLinearTIDS(np.array(q), np.array(v), *matrices)
        self.nsds.insertDynamicalSystem(body)
        return body

    def second(self, j):
        """Siconos' body of a contact's second one; None for a wall at rest."""
        return self.bodies[j] if j < self.n else self.moving.get(j - self.n)

    def interact(self, i, j, relation):
        """Link two bodies by a relation; returns the interaction."""
        law, second = self.law_of(i, j), self.second(j)
        impact = sk.NewtonImpactFrictionNSL(law["restitution"] or 0.0, 0.0, law["mu"], self.dimension)
        contact = sk.Interaction(impact, relation)
        self.nsds.link(contact, *([self.bodies[i]] if second is None else [self.bodies[i], second]))
        return contact

    def start(self):
        """The sample of time 0."""
        self.sample_at(0)

    def advance(self, sampled):
        """All steps; returns the seconds spent on them, sampling apart, see `clock`."""
        wanted, spent = set(sampled), 0.0
        begin = clock()
        for step in range(1, max(wanted) + 1):
            self.before(step)
            self.simulation.computeOneStep()
            self.check_solver(step)
            if step in wanted:
                now = clock()
                spent += now - begin
                self.sample_at(step)
                begin = clock()
            self.after(step)
            self.simulation.nextStep()  # keeps what `after` has set as the state, gaps and rates at the beginning of the next step
        return spent + clock() - begin

    def check_residual(self, step, residual, hint):
        """Hold a step's residual against the tolerance: the criteria of Siconos' solvers are other norms, relative to ``|q|``.

        Ten times the tolerance separates success from failure.
        """
        self.worst = max(self.worst, residual)
        limit = 10.0 * self.tolerance
        if not residual <= limit:
            raise RuntimeError(
                f"the contact solver left the residual {residual:.3g} in step {step}{hint.format(limit=f'{limit:.3g}')}"
            )


class DiskRun(SiconosRun):
    """Disks."""

    def body(self, i):
        turning = self.rotating[i]
        mass, inertia = self.mass[i] / self.unit, self.inertia[i] / self.unit
        if not turning:
            inertia = inertia * PRESCRIBED
        matrix = np.diag([mass, mass, inertia])
        damping = self.xi * np.diag([mass, mass, inertia if turning else 0.0])
        q, v = [*self.x0[i], 0.0], [*self.v0[i], self.omega0[i]]
        body = self.insert(q, v, matrix, np.zeros((3, 3)), damping)
        body.setFExtPtr(np.array([mass * self.gravity[0], mass * self.gravity[1], 0.0]))
        return body

    def moves(self, w):
        return (self.path[:, w, 0:2] != self.path[0, w, 0:2]).any()

    def wall_body(self, w):
        return self.insert(self.path[0, w, 0:2], self._chord(w, 0), PRESCRIBED * np.eye(2))

    def _chord(self, w, step):
        """Mean velocity of a wall over the step that begins at ``step``."""
        return (self.pose(step + 1)[w, 0:2] - self.pose(step)[w, 0:2]) / self.dt

    def link(self, i, j):
        relation = DiskDiskR(self.radius[i], self.radius[j]) if j < self.n else self._at_wall(i, j - self.n)
        self.contacts[i, j] = self.interact(i, j, relation)

    def _at_wall(self, i, w):
        """``y = (gap, slip)`` of a disk on a wall: gap = N (x - p) - R; the slip is that of the disk against the wall."""
        (px, py), (nx, ny) = self.path[0, w, 0:2], self.path[0, w, 2:4]
        radius = self.radius[i]
        # The contact's normal n is -N, so that its tangent (-n_y, n_x) is (N_y, -N_x).
        rows = np.array([[nx, ny, 0.0], [ny, -nx, radius]])
        if w in self.moving:
            return sk.LagrangianLinearTIR(np.hstack([rows, -rows[:, 0:2]]), np.array([-radius, 0.0]))
        return sk.LagrangianLinearTIR(rows, np.array([-(nx * px + ny * py) - radius, 0.0]))

    def before(self, step):
        """Gravity and the mean forces of the step that ends at ``step``."""
        if not self.forces_on:
            return
        loads = self.loads((step - 1) * self.dt, step * self.dt)
        for i, body in enumerate(self.bodies):
            body.fExt()[:] = (loads[i] + self.mass[i] * np.array([*self.gravity, 0.0])) / self.unit

    def after(self, step):
        for w, body in self.moving.items():
            body.q()[:] = self.pose(step)[w, 0:2]
            body.velocity()[:] = self._chord(w, step)

    def check_solver(self, step):
        """Hold the step's reactions against Siconos' own error function: its solvers' word is not enough."""
        size = self.problem.getSizeOutput()
        if size == 0:
            return
        residual, _ = natural_map(self.problem.frictionContactProblemPtr(), self.problem.z()[:size])
        hint = (
            f", after {self.solver.iparam[sn.SICONOS_IPARAM_ITER_DONE]} iterations; the limit is {{limit}}: loosen "
            f"siconos.tolerance, raise siconos.max_iterations or try another siconos.solver"
        )
        self.check_residual(step, residual, hint)

    def sample_at(self, step):
        """Append one sample; forces are those of the step that ends here, none at step 0."""
        q = np.array([body.q() for body in self.bodies]).reshape(-1, 3)
        v = np.array([body.velocity() for body in self.bodies]).reshape(-1, 3)
        watched = {pair: self._force(pair) for pair in self.pairs}
        on_walls = np.zeros((len(self.walls), 2))
        pose = self.pose(step)
        for i, j in self.contacts:
            if j >= self.n:
                fn, fs = self._force((i, j))
                nx, ny = pose[j - self.n, 2:4]
                on_walls[j - self.n] += (-fn * nx - fs * ny, -fn * ny + fs * nx)
        if step == 0:
            watched, on_walls = dict.fromkeys(watched, (math.nan, math.nan)), np.full_like(on_walls, np.nan)
        omega = np.where(self.rotating, v[:, 2], self.omega0)
        self.sample(step, q[:, 0:2], v[:, 0:2], omega, q[:, 2], watched, on_walls)

    def _force(self, pair):
        """``(fn, fs)`` [N], means over the step."""
        impulse = self.contacts[pair].lambda_(1)
        # DiskDiskR counts the tangent clockwise.
        sign = -1.0 if pair[1] < self.n else 1.0
        return self.unit * impulse[0] / self.dt, sign * self.unit * impulse[1] / self.dt


class SphereRun(SiconosRun):
    """Spheres."""

    def body(self, i):
        held = self.held[i]
        mass = np.where(held, PRESCRIBED, 1.0) * self.mass[i] / self.unit
        inertia = (1.0 if self.rotating[i] else PRESCRIBED) * self.inertia[i] / self.unit
        q, v = [*self.x0[i], 0.0, 0.0, 0.0], [*self.v0[i], *self.omega0[i]]
        body = self.insert(q, v, np.diag([*mass, inertia, inertia, inertia]))
        weight = np.where(held, 0.0, self.mass[i] / self.unit * self.gravity)
        body.setFExtPtr(np.array([*weight, 0.0, 0.0, 0.0]))
        return body

    def moves(self, w):
        return bool(self.walls[w]["motion"])

    def wall_body(self, w):
        row = self.pose(0)[w]
        return self.insert([*row[0:3], 0.0, 0.0, 0.0], row[6:12], PRESCRIBED * np.eye(6))

    def link(self, i, j):
        relation = sk.LagrangianLinearTIR(np.zeros((3, 6 if self.second(j) is None else 12)), np.zeros(3))
        self.contacts[i, j] = self.interact(i, j, relation), relation, self.law_of(i, j)
        self._orient(i, j, 0)

    def _frame(self, i, j, step):
        """Unit vector from the second body to the first, two tangents, and the gap."""
        x = np.array(self.bodies[i].q()[:3])
        if j < self.n:
            apart = x - np.array(self.bodies[j].q()[:3])
            distance = float(np.linalg.norm(apart))
            normal, gap = apart / distance, distance - self.radius[i] - self.radius[j]
        else:
            row = self.pose(step)[j - self.n]
            normal = row[3:6]
            gap = float((x - row[0:3]) @ normal - self.radius[i])
        first = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
        first = first / np.linalg.norm(first)
        return np.array([normal, first, np.cross(normal, first)]), gap

    def _orient(self, i, j, step):
        """Set H and b of a contact by the state at a step: rates of the first body's surface against the second's."""
        _, relation, _ = self.contacts[i, j]
        frame, gap = self._frame(i, j, step)
        # (omega x a) t = omega (a x t), with the arm a from a centre, or a wall's point, to the place of the contact
        arm = -self.radius[i] * frame[0]
        rows = [frame, np.cross(arm, frame)]
        q = [np.array(self.bodies[i].q())]
        if j < self.n:
            rows += [-frame, -np.cross(self.radius[j] * frame[0], frame)]
            q.append(np.array(self.bodies[j].q()))
        elif j - self.n in self.moving:
            row = self.pose(step)[j - self.n]
            rows += [-frame, -np.cross(q[0][:3] + arm - row[0:3], frame)]
            q.append(np.array(self.moving[j - self.n].q()))
        h = np.hstack(rows)
        relation.C()[:] = h
        relation.e()[:] = np.array([gap, 0.0, 0.0]) - h @ np.concatenate(q)

    def start(self):
        """The sample of time 0; the rates of its contacts, which the first step's restitution is held against."""
        self.simulation.initialize()
        super().start()

    def before(self, step):  # noqa: ARG002
        """Note the rates at which contacts approach."""
        self.rates = {pair: float(contact.y(1)[0]) for pair, (contact, _, _) in self.contacts.items()}

    def after(self, step):
        for w, body in self.moving.items():
            row = self.pose(step)[w]
            body.q()[:] = [*row[0:3], 0.0, 0.0, 0.0]
            body.velocity()[:] = row[6:12]
        for i, j in self.contacts:
            if self.second(j) is not None:
                self._orient(i, j, step)
        for level in (0, 1):
            self.nsds.updateOutput(step * self.dt, level)

    def check_solver(self, step):
        """Hold impulses and rates against Coulomb's and Newton's laws: the solver's word is not enough.

        ``|r - P(r - (u_n + mu |u_t|, u_t))| / max(|r|, |u|)`` with the projection P on the cone and u the rates plus restitution.
        """
        error = size = 0.0
        for pair, (contact, _, law) in self.contacts.items():
            r = np.array(contact.lambda_(1))
            if not r.any():
                continue
            u, mu = np.array(contact.y(1)), law["mu"]
            u[0] += (law["restitution"] or 0.0) * self.rates[pair]
            u[0] += mu * math.hypot(u[1], u[2])
            if mu == 0.0:
                u[1:] = 0.0
            error += float(((r - _on_cone(r - u, mu)) ** 2).sum())
            size += max(float(r @ r), float(u @ u))
        if size == 0.0:
            return
        hint = "; the limit is {limit}: loosen siconos.tolerance or raise siconos.max_iterations"
        self.check_residual(step, math.sqrt(error / size), hint)

    def sample_at(self, step):
        """Append one sample; forces are those of the step that ends here, in the frames of its beginning, none at step 0."""
        state = np.array([[body.q(), body.velocity()] for body in self.bodies]).reshape(self.n, 12)
        v = np.where(self.held, self.v0, state[:, 6:9])  # of what moves a sphere 2^-200 is left
        found, on_walls = {}, np.zeros((len(self.walls), 3))
        for (i, j), (contact, relation, _) in self.contacts.items():
            frame = relation.C()[:, :3]  # rows: from the second body to the first, two tangents
            impulse = self.unit / self.dt * np.array(contact.lambda_(1)) if step else np.full(3, np.nan)
            found[i, j] = impulse[0], impulse[1:] @ frame[1:]
            if j >= self.n:
                on_walls[j - self.n] -= impulse @ frame
        self.sample(step, state[:, 0:3], v, state[:, 9:12], state[:, 3:6], found, on_walls)


def _on_cone(r, mu):
    """Nearest point of the cone ``|r_t| <= mu r_n``."""
    size = math.hypot(r[1], r[2])
    if size <= mu * r[0]:
        return r
    if mu * size <= -r[0] or (mu == 0.0 and r[0] <= 0.0):
        return np.zeros(3)
    normal = (r[0] + mu * size) / (1.0 + mu * mu)
    return np.array([normal, *(mu * normal / size * r[1:])])


RUNS = {2: DiskRun, 3: SphereRun}

if __name__ == "__main__":
    serve(lambda request: RUNS[request["scene"].get("dimension", 2)](request))
    sys.stdout.flush()
    os._exit(0)  # Siconos' objects and Python's may be destroyed in an order that crashes
