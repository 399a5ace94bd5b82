"""A scene in space in Siconos' kernel: what `driver` does with one of the plane, with spheres.

- A sphere is a `LagrangianLinearTIDS` whose coordinates are its centre and the integral of its spin, which a sphere's moments of inertia
  allow; what is held or blocked has a mass or an inertia 2^200 times its own, and no weight. So has a plane that moves, with six
  coordinates, too: it is put on its path before each step and given the step's mean velocities.
- A contact is a `LagrangianLinearTIR` ``y = H q + b``, the gap and the slip along two tangents, whose H and b are set anew at the
  beginning of each step where its normal or its arms change: impulses act along the normal that restitution takes the approach along.
"""

import math

import numpy as np
import siconos
import siconos.kernel as sk
import siconos.numerics as sn
from driver_parts import clock
from space_parts import SpaceRun

PRESCRIBED = 2.0**200


class SiconosSpaceRun(SpaceRun):
    """One simulation; forces are means over the step that ends at a sample."""

    name = "Siconos"
    force_meaning = "step-mean"

    def __init__(self, request):
        super().__init__(request)
        options = request["extra"]["options"]
        self.unit = 2.0 ** round(math.log2(float(np.median(self.mass))))
        self.tolerance, self.worst = options["siconos.tolerance"], 0.0
        self.nsds = sk.NonSmoothDynamicalSystem(0.0, self.dt * (request["numerics"]["n_steps"] + 2))
        self.bodies = [self._sphere(i) for i in range(self.n)]
        self.moving = {w: self._plane(w) for w, wall in enumerate(self.walls) if wall["motion"]}
        self.contacts, self.turning = {}, []
        for i in range(self.n):
            for j in range(i + 1, self.n + len(self.walls)):
                self._link(i, j)
        self._simulation(options, request["extra"]["threshold"])

    def _sphere(self, i):
        held = self.held[i]
        mass = np.where(held, PRESCRIBED, 1.0) * self.mass[i] / self.unit
        inertia = (1.0 if self.rotating[i] else PRESCRIBED) * self.inertia[i] / self.unit
        q, v = [*self.x0[i], 0.0, 0.0, 0.0], [*self.v0[i], *self.omega0[i]]
        body = sk.LagrangianLinearTIDS(np.array(q), np.array(v), np.diag([*mass, inertia, inertia, inertia]))
        weight = np.where(held, 0.0, self.mass[i] / self.unit * self.gravity)
        body.setFExtPtr(np.array([*weight, 0.0, 0.0, 0.0]))
        self.nsds.insertDynamicalSystem(body)
        return body

    def _plane(self, w):
        row = self.pose(0)[w]
        q = np.array([*row[0:3], 0.0, 0.0, 0.0])
        body = sk.LagrangianLinearTIDS(q, row[6:12].copy(), PRESCRIBED * np.eye(6))
        self.nsds.insertDynamicalSystem(body)
        return body

    def _link(self, i, j):
        law, second = self.law_of(i, j), self.bodies[j] if j < self.n else self.moving.get(j - self.n)
        bodies = [self.bodies[i]] if second is None else [self.bodies[i], second]
        relation = sk.LagrangianLinearTIR(np.zeros((3, 6 * len(bodies))), np.zeros(3))
        impact = sk.NewtonImpactFrictionNSL(law.get("restitution") or 0.0, 0.0, law["mu"], 3)
        contact = sk.Interaction(impact, relation)
        self.nsds.link(contact, *bodies)
        self.contacts[i, j] = contact, relation, law
        self._orient(i, j, 0)
        if second is not None:
            self.turning.append((i, j))

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
        # (omega x a) t = omega (a x t), with the arm a from a centre, or a plane's point, to the place of the contact
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

    def _simulation(self, options, threshold):
        self.osi = sk.MoreauJeanOSI(options["siconos.theta"])
        self.osi.setConstraintActivationThreshold(threshold)
        self.problem = sk.FrictionContact(3, sn.SICONOS_FRICTION_3D_NSGS)
        solver = self.problem.numericsSolverOptions()
        solver.dparam[sn.SICONOS_DPARAM_TOL] = self.tolerance
        solver.iparam[sn.SICONOS_IPARAM_MAX_ITER] = options["siconos.max_iterations"]
        self.simulation = sk.TimeStepping(self.nsds, sk.TimeDiscretisation(0.0, self.dt), self.osi, self.problem)
        self.simulation.setNewtonOptions(sk.SICONOS_TS_LINEAR)
        self.simulation.setWarnOnNonConvergence(False)

    def version(self):
        return siconos.version

    def settings(self):
        return {"largest_solver_residual": self.worst}

    def start(self):
        """The sample of time 0; the rates of its contacts, which the first step's restitution is held against."""
        self.simulation.initialize()
        self._sample(0)

    def advance(self, sampled):
        """All steps; returns the seconds spent on them, sampling apart, see `clock`."""
        wanted, spent = set(sampled), 0.0
        begin = clock()
        for step in range(1, max(wanted) + 1):
            before = {pair: float(contact.y(1)[0]) for pair, (contact, _, _) in self.contacts.items()}
            self.simulation.computeOneStep()
            self._check_solver(step, before)
            if step in wanted:
                now = clock()
                spent += now - begin
                self._sample(step)
                begin = clock()
            for w, body in self.moving.items():
                row = self.pose(step)[w]
                body.q()[:] = [*row[0:3], 0.0, 0.0, 0.0]
                body.velocity()[:] = row[6:12]
            for pair in self.turning:
                self._orient(*pair, step)
            for level in (0, 1):
                self.nsds.updateOutput(step * self.dt, level)
            self.simulation.nextStep()  # keeps gaps and rates of the step's beginning for the restitution
        return spent + clock() - begin

    def _check_solver(self, step, before):
        """Hold impulses and rates against Coulomb's and Newton's laws: the solver's word is not enough.

        ``|r - P(r - (u_n + mu |u_t|, u_t))| / max(|r|, |u|)`` with the projection P on the cone and u the rates plus restitution.
        """
        error = size = 0.0
        for pair, (contact, _, law) in self.contacts.items():
            r = np.array(contact.lambda_(1))
            if not r.any():
                continue
            u, mu = np.array(contact.y(1)), law["mu"]
            u[0] += (law.get("restitution") or 0.0) * before[pair]
            u[0] += mu * math.hypot(u[1], u[2])
            if mu == 0.0:
                u[1:] = 0.0
            error += float(((r - _on_cone(r - u, mu)) ** 2).sum())
            size += max(float(r @ r), float(u @ u))
        if size == 0.0:
            return
        residual = math.sqrt(error / size)
        self.worst = max(self.worst, residual)
        if not residual <= 10.0 * self.tolerance:
            raise RuntimeError(
                f"the contact solver left the residual {residual:.3g} in step {step}; the limit is {10.0 * self.tolerance:.3g}: loosen "
                "siconos.tolerance or raise siconos.max_iterations"
            )

    def _sample(self, step):
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
