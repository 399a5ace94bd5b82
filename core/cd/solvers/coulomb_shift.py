"""Interior point for Coulomb's law in De Saxce's form: the associated rule with its dilation taken back step by step.

With a shift s added to the normal velocities the associated rule ``u_n + s >= mu |u_t|`` becomes Coulomb's law once
``s = mu |u_t|``. For a given s it is a convex program, whose path Newton's method follows without safeguards; and the velocities that
belong to it are unique, so that ``ds/dt = mu |u_t(s)| - s`` is a well-defined motion, bounded and with Coulomb's solutions as its points
of rest. A step of the interior point takes an implicit step h of this time together with one along the path::

    ds = theta (mu (|u_t| + d|u_t|) - s),    theta = h / (1 + h)

theta = 0 is the convex program, theta = 1 Newton's method on Coulomb's law. Where Coulomb's own path turns back (it does, once for
some hundred contacts that slide) the motion leads to another branch, which a step towards smaller products alone cannot reach.
"""

from __future__ import annotations

import numpy as np

from ninedisk.core.array_types import FloatArray
from ninedisk.core.cd.problem import ContactProblem
from ninedisk.core.cd.solvers.factorise import UnsymmetricMatrix, times

Direction = tuple[FloatArray, FloatArray, FloatArray, FloatArray]

STIFF = 1e-2
"""Compliance over ``1/rho`` of the contacts that give the first forces: so stiff that these carry the weight above them."""
LIFT = 0.1
"""Least first force and slip over their root mean square: the start lies inside."""
SOFT = 1e-9
"""Compliance over ``1/rho`` that acts on the change of the forces: against round-off where forces are not unique."""
FIRST_DILATING = 0.5
"""``1 - theta`` of the first step: what is left of the dilation."""
EASIER, HARDER = 0.5, 2.0
"""Factors of ``1 - theta`` after long and short steps."""
SHORT, LONG = 0.1, 0.5
LEAST_CENTRING = 1e-3
"""Products aimed at, over their mean, at least."""
LAG = 0.05
"""Work of the forces on what the shift lacks, over the sum of the products, from which on the path is not followed further down."""
LAG_OF_VELOCITIES = 0.1
"""Relative error of the contact velocities over relative mean product from which on it is not, either."""
CORRECTORS = 4
"""Centrality correctors of an iteration: a solve each."""
ENOUGH, WORTH = 0.95, 1.02
"""Step length that needs no corrector; factor by which a corrector has to lengthen the step."""
SPREAD = 0.1
"""Products between this fraction of the goal and its inverse count as central."""
WEIGHTS = (0.1, 0.3, 1.0)
"""Weights of the second-order term that are tried besides 0: the predictor gets only a part of the way."""
CENTRAL, BACK = 1e-2, 0.8
"""No product falls below this fraction of their mean; factor by which a step that would is shortened."""


class ShiftedPath:
    """One solve: velocities ``v``, forces ``r``, shift, and the pairs ``x``, ``y`` of every contact as in `coulomb_interior_point`.

    Parameters
    ----------
    problem : ContactProblem
    matrix : UnsymmetricMatrix
        Of the problem.

    Attributes
    ----------
    v : ndarray, shape (3 b,)
    r : ndarray, shape (c, 2)
        Contact forces, inside the cones.
    """

    def __init__(self, problem: ContactProblem, matrix: UnsymmetricMatrix) -> None:
        self.problem, self._matrix = problem, matrix
        self._rough = problem.mu > 0.0
        self._live = np.column_stack([np.ones_like(self._rough), self._rough, self._rough])
        self._count = int(self._live.sum())
        self._speed = float(np.abs(problem.b[:, 0]).max())
        self._mass = np.where(problem.free > 0.0, problem.mass, 0.0).ravel()
        self._load = (problem.force * problem.free).ravel()
        self._dilating = FIRST_DILATING
        self.v, self.r = np.zeros(3 * problem.n_bodies), np.zeros((problem.n_contacts, 2))
        self._begin()

    def _begin(self) -> None:
        """Forces of stiff contacts without limits, moved inside."""
        problem = self.problem
        d = np.zeros((problem.n_contacts, 2, 2))
        stiff = 1.0 / (STIFF / problem.rho[:, None] + problem.compliance)
        d[:, 0, 0], d[:, 1, 1] = stiff[:, 0], np.where(self._rough, stiff[:, 1], 0.0)
        rest = problem.contact_velocity(np.zeros_like(problem.force), np.zeros_like(self.r))
        if self._matrix.factorise(d):
            self.v = self._matrix.solve(self._load - self._matrix.h.T @ times(d, rest).ravel())
            self.r = -times(d, rest + (self._matrix.h @ self.v).reshape(-1, 2))
        u = problem.contact_velocity(self.v.reshape(-1, 3), self.r)
        mu = np.where(self._rough, problem.mu, np.inf)
        p = np.maximum(np.maximum(self.r[:, 0], 0.0), np.abs(self.r[:, 1]) / mu)
        p += LIFT * (float(np.sqrt((p * p).mean())) or self._speed * float(problem.rho.mean()))
        self.r = np.column_stack([p, np.where(self._rough, self.r[:, 1], 0.0)])
        self._x = np.where(self._live, self._margins(self.r), 1.0)
        size = max(float(np.sqrt((u * u).mean())), LIFT * self._speed)
        y = size + np.maximum(np.column_stack([u[:, 0], u[:, 1], -u[:, 1]]), 0.0)
        self._y = np.where(self._live, y, 1.0)
        self._shift = self._friction(self._y)
        self._first = self._mean(self._x, self._y)

    def iterate(self) -> bool:
        """One step; False if the matrix could not be factorised or the numbers ran over."""
        problem, x, y, dilating = self.problem, self._x, self._y, self._dilating
        ratio = np.where(self._live, y / x, 0.0)
        d = self._blocks(ratio)
        if not self._matrix.factorise(d):
            return False
        u = problem.contact_velocity(self.v.reshape(-1, 3), self.r)
        lack = self._friction(y) - self._shift
        off = np.column_stack([y[:, 0] + lack - u[:, 0], np.where(self._rough, y[:, 1] - y[:, 2] - u[:, 1], 0.0)])
        error_u = off - np.column_stack([(1.0 - dilating) * lack, np.zeros_like(lack)])
        error_v = self._load + self._matrix.h.T @ self.r.ravel() - self._mass * self.v
        no_u, no_v = np.zeros_like(error_u), np.zeros_like(error_v)

        def direction(target: FloatArray, error_u: FloatArray, error_v: FloatArray) -> Direction:
            k = np.where(self._live, target / x, 0.0)
            b = error_u + np.column_stack([k[:, 0] + dilating * problem.mu * (k[:, 1] + k[:, 2]), k[:, 1] - k[:, 2]])
            dv = self._matrix.solve(error_v + self._matrix.h.T @ times(d, b).ravel())
            dr = times(d, b - (self._matrix.h @ dv).reshape(-1, 2))
            dx = np.where(self._live, self._margins(dr), 0.0)
            return dv, dr, dx, np.where(self._live, k - ratio * dx, 0.0)

        mean = self._mean(x, y)
        predicted = direction(-x * y, error_u, error_v)
        goal = mean * self._centring(predicted, lack, off, mean)
        second = direction(-predicted[2] * predicted[3], no_u, no_v)
        chosen = plain = _sum(predicted, direction(np.full_like(x, goal), no_u, no_v))
        step = self._reach(plain)
        for weight in WEIGHTS:
            tried = _sum(plain, second, weight)
            if (longer := self._reach(tried)) > step:
                step, chosen = longer, tried
        for _ in range(CORRECTORS):
            if step > ENOUGH:
                break
            ahead = min(1.0, 1.5 * step + 0.1)
            wrong = (x + ahead * chosen[2]) * (y + ahead * chosen[3])
            target = np.maximum(np.clip(wrong, SPREAD * goal, goal / SPREAD) - wrong, -goal / SPREAD)
            tried = _sum(chosen, direction(target, no_u, no_v))
            longer = self._reach(tried)
            if longer <= WORTH * step:
                break
            step, chosen = longer, tried
        return self._take(chosen, min(1.0, max(0.9, 1.0 - mean / self._first) * step))

    def _blocks(self, ratio: FloatArray) -> FloatArray:
        """Change of the forces per change of the contact velocities, shape (c, 2, 2)."""
        problem, mu, dilating = self.problem, self.problem.mu, self._dilating
        both, apart = ratio[:, 1] + ratio[:, 2], ratio[:, 1] - ratio[:, 2]
        soft = problem.compliance + (SOFT / problem.rho)[:, None]
        nn, nt = ratio[:, 0] + dilating * mu * mu * both + soft[:, 0], dilating * mu * apart
        tn, tt = mu * apart, np.where(self._rough, both + soft[:, 1], 1.0)
        d = np.empty((problem.n_contacts, 2, 2))
        determinant = nn * tt - nt * tn
        d[:, 0, 0], d[:, 0, 1] = tt / determinant, -nt / determinant
        d[:, 1, 0] = -tn / determinant
        d[:, 1, 1] = np.where(self._rough, nn / determinant, 0.0)
        return d

    def _centring(self, predicted: Direction, lack: FloatArray, off: FloatArray, mean: float) -> float:
        """Mean product to aim at, over the present one: 1 where shift or velocities lag behind."""
        step = self._reach(predicted)
        ahead = max(self._mean(self._x + step * predicted[2], self._y + step * predicted[3]), 0.0) / mean
        work = float((self._x[:, 0] * np.abs(lack)).sum())
        lag = float(np.sqrt((off * off).mean())) / self._speed
        if work > LAG * mean * self._count or lag > LAG_OF_VELOCITIES * mean / self._first:
            return 1.0
        return max(0.2 * (1.0 - step) ** 3, 0.2 * ahead**3, LEAST_CENTRING)

    def _take(self, chosen: Direction, step: float) -> bool:
        dv, dr, dx, dy = chosen
        for _ in range(20):
            products = ((self._x + step * dx) * (self._y + step * dy))[self._live]
            if products.min() >= CENTRAL * products.mean():
                break
            step *= BACK
        wanted = self._friction(self._y + dy)
        self.v, self.r = self.v + step * dv, self.r + step * dr
        self._x, self._y = self._x + step * dx, self._y + step * dy
        self._shift = self._shift + step * (1.0 - self._dilating) * (wanted - self._shift)
        if step < SHORT:
            self._dilating = min(self._dilating * HARDER, 1.0)
        elif step > LONG:
            self._dilating *= EASIER
        return bool(np.isfinite(self._x).all() and np.isfinite(self._y).all())

    def _friction(self, y: FloatArray) -> FloatArray:
        """``mu |u_t|`` of slips either way."""
        friction: FloatArray = np.where(self._rough, self.problem.mu * (y[:, 1] + y[:, 2]), 0.0)
        return friction

    def _margins(self, r: FloatArray) -> FloatArray:
        p, q, mu = r[:, 0], r[:, 1], self.problem.mu
        return np.column_stack([p, mu * p + q, mu * p - q])

    def _mean(self, x: FloatArray, y: FloatArray) -> float:
        return float((x * y)[self._live].sum()) / self._count

    def _reach(self, direction: Direction) -> float:
        """Largest step up to 1 that keeps both factors of every product."""
        pairs = ((self._x, direction[2]), (self._y, direction[3]))
        falling = [-z[dz < 0.0] / dz[dz < 0.0] for z, dz in pairs]
        return min(1.0, *(float(each.min()) for each in falling if each.size), 1.0)


def _sum(one: Direction, other: Direction, weight: float = 1.0) -> Direction:
    dv, dr, dx, dy = (a + weight * b for a, b in zip(one, other, strict=True))
    return dv, dr, dx, dy
