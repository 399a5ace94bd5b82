"""Hard disks, or spheres, in a box with smooth elastic walls, from collision to collision: no time step, exact but for round-off."""

from __future__ import annotations

import heapq
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.references._validate import array, fraction, positive

FloatArray = NDArray[np.float64]


class Flight(NamedTuple):
    """State at the sampled times: ``x`` [m] and ``v`` [m/s], shape (s, n, d), and the collisions of pairs until then, shape (s,)."""

    x: FloatArray
    v: FloatArray
    collisions: NDArray[np.int64]


def hard_disks(
    *, x: ArrayLike, v: ArrayLike, radius: float, side: float, restitution: float, times: ArrayLike
) -> Flight:
    """Equal disks in the square ``0 <= x, y <= side``, or spheres in the cube; walls are elastic, disks lose ``1 + e`` of their approach.

    Parameters
    ----------
    x, v : array_like, shape (n, d)
        Centres [m], inside the box and apart from one another, and velocities [m/s]; d = 2 of disks, 3 of spheres.
    radius, side : float
        Of the disks and of the box [m], > 0.
    restitution : float
        Of two disks, in (0, 1].
    times : array_like, shape (s,)
        Times of the samples [s], ascending, >= 0.

    Raises
    ------
    ValueError
        If an argument is out of range or disks overlap.

    Notes
    -----
    Every collision that the present velocities lead to waits in a heap; those of disks that have collided since are void (Alder &
    Wainwright 1959, J. Chem. Phys. 31, 459). A difference between two such motions grows by about the free path over the radius
    in each collision of a disk: what is exact here is a truth for others until that has made it as large as the motion.
    """
    positive(radius=radius, side=side)
    fraction(restitution=restitution)
    place, speed, samples = np.array(array("x", x)), np.array(array("v", v)), array("times", times)
    if place.ndim != 2 or place.shape[1] not in (2, 3) or speed.shape != place.shape:
        raise ValueError(
            f"x and v of shapes {place.shape} and {speed.shape} are not allowed: both must be (n, 2) or (n, 3)"
        )
    if restitution == 0.0:
        raise ValueError(
            "restitution = 0 is not allowed: disks that stay together collide without end; use one above 0"
        )
    if samples.ndim != 1 or np.any(np.diff(samples, prepend=0.0) < 0.0):
        raise ValueError(
            f"times of shape {samples.shape} are not allowed to descend, to be < 0 or to be no row of numbers"
        )
    apart = np.hypot.reduce((place[:, None] - place[None]).transpose(2, 0, 1))[np.triu_indices(len(place), 1)]
    inside = np.all((place >= radius * (1.0 - 1e-12)) & (place <= side - radius * (1.0 - 1e-12)))
    if not inside or apart.min(initial=math.inf) < 2.0 * radius * (1.0 - 1e-12):
        raise ValueError("x is not allowed: disks must be inside the box and apart from one another")
    return _Box(place, speed, radius, side, restitution, float(samples[-1]) if len(samples) else 0.0).run(samples)


class _Box:
    def __init__(
        self, x: FloatArray, v: FloatArray, radius: float, side: float, restitution: float, end: float
    ) -> None:
        # A row for each axis: what is asked of all disks at once is then read in order.
        self.x, self.v = np.ascontiguousarray(x.T), np.ascontiguousarray(v.T)
        self.radius, self.side, self.e, self.end = radius, side, restitution, end
        self.n, self.t, self.pairs = len(x), 0.0, 0
        self.count = [0] * self.n  # collisions of each disk: what was foreseen before is void
        self.heap: list[tuple[float, int, int, int, int]] = []
        for i in range(self.n):
            self._foresee(i, after=i)

    def run(self, samples: FloatArray) -> Flight:
        xs, vs, collisions = [], [], []
        for t in samples.tolist():
            while self.heap and self.heap[0][0] <= t:
                at, i, j, of_i, of_j = heapq.heappop(self.heap)
                if of_i == self.count[i] and (j < 0 or of_j == self.count[j]):
                    self._move(at)
                    self._collide(i, j)
            self._move(t)
            xs.append(self.x.T.copy())
            vs.append(self.v.T.copy())
            collisions.append(self.pairs)
        shape = (len(xs), *self.x.T.shape)
        return Flight(np.array(xs).reshape(shape), np.array(vs).reshape(shape), np.array(collisions, dtype=np.int64))

    def _move(self, t: float) -> None:
        self.x += self.v * (t - self.t)
        self.t = t

    def _collide(self, i: int, j: int) -> None:
        self.count[i] += 1
        if j < 0:  # a wall: -1 and -2 across x, -3 and -4 across y, and so on
            self.v[(-1 - j) // 2, i] *= -1.0
            self._foresee(i)
            return
        self.count[j] += 1
        self.pairs += 1
        normal = self.x[:, j] - self.x[:, i]
        normal /= math.hypot(*normal)
        approach = float((self.v[:, j] - self.v[:, i]) @ normal)
        impulse = 0.5 * (1.0 + self.e) * approach * normal
        self.v[:, i] += impulse
        self.v[:, j] -= impulse
        self._foresee(i)
        self._foresee(j)

    def _foresee(self, i: int, after: int = -1) -> None:
        """Put the collisions of disk i with walls and with the disks numbered above ``after`` on the heap."""
        x, v = self.x[:, i, None], self.v[:, i, None]
        for axis, (place, speed) in enumerate(zip(x[:, 0].tolist(), v[:, 0].tolist(), strict=True)):
            if speed != 0.0:
                room = place - self.radius if speed < 0.0 else self.side - self.radius - place
                self._wait(self.t + max(room, 0.0) / abs(speed), i, -1 - 2 * axis - (speed > 0.0))
        dx, dv = self.x[:, after + 1 :] - x, self.v[:, after + 1 :] - v
        closing = np.einsum("dk,dk->k", dx, dv)
        near = np.flatnonzero(closing < 0.0)
        dx, dv, closing = dx.take(near, axis=1), dv.take(near, axis=1), closing[near]
        room2 = np.maximum(np.einsum("dk,dk->k", dx, dx) - 4.0 * self.radius**2, 0.0)
        root = closing**2 - np.einsum("dk,dk->k", dv, dv) * room2
        for k in np.flatnonzero(root > 0.0).tolist():
            self._wait(self.t + float(room2[k] / (math.sqrt(root[k]) - closing[k])), i, after + 1 + int(near[k]))

    def _wait(self, t: float, i: int, j: int) -> None:
        if t <= self.end:
            heapq.heappush(self.heap, (t, i, j, self.count[i], self.count[j] if j >= 0 else 0))
