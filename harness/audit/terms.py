"""Compiled loops over bodies for the terms of one interval, and their sums by group; each is what its caller says, in one pass.

Arrays as in `ninedisk.harness.audit.tally.State` and `Bodies`: (n, d) vectors, (n, k) of turning, (n,) numbers; ``label`` (n,) is the group
of each body, ``use`` (n,) whether it counts.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.core.compile import inline_kernel, kernel

Ints = NDArray[np.int64]
Marks = NDArray[np.bool_]


@inline_kernel
def _length(vectors: FloatArray, k: int) -> float:
    square = 0.0
    for axis in range(vectors.shape[1]):
        square += vectors[k, axis] * vectors[k, axis]
    return math.sqrt(square)


@kernel
def interval_terms(
    x0: FloatArray, x1: FloatArray, v0: FloatArray, v1: FloatArray, h: float, damping: float, g: FloatArray,
    dv: FloatArray, r: FloatArray, speed: FloatArray, far: FloatArray, lag: FloatArray,
) -> None:  # fmt: skip
    """Change of velocity beyond gravity and damping, displacement beyond the mean velocity, larger speed and distance, damping's share."""
    for k in range(len(x0)):
        jump = 0.0
        for axis in range(x0.shape[1]):
            mean = 0.5 * (v0[k, axis] + v1[k, axis])
            change = v1[k, axis] - v0[k, axis]
            dv[k, axis] = change - g[axis] * h + damping * h * mean
            r[k, axis] = x1[k, axis] - x0[k, axis] - h * mean
            jump += change * change
        lag[k] = damping * h * np.sqrt(jump)
        speed[k] = max(_length(v0, k), _length(v1, k))
        far[k] = max(_length(x0, k), _length(x1, k))


@kernel
def bends(
    va: FloatArray, v0: FloatArray, v1: FloatArray, vd: FloatArray, before: float, after: float, g: FloatArray, h: float, chord: bool,
    step: bool, met: Marks, found: FloatArray,
) -> None:  # fmt: skip
    """How far the change of velocity of what met something differs from those before and after.

    ``before`` and ``after`` scale those to this interval; 0: there is none. ``chord``: the change beyond gravity counts twice; ``step``:
    the whole change does.
    """
    d = v0.shape[1]
    for k in range(len(v0)):
        if not met[k]:
            found[k] = 0.0
            continue
        one = two = whole = beyond = 0.0
        for axis in range(d):
            jump = v1[k, axis] - v0[k, axis]
            if before > 0.0:
                one += (jump - (v0[k, axis] - va[k, axis]) * before) ** 2
            if after > 0.0:
                two += ((vd[k, axis] - v1[k, axis]) * after - jump) ** 2
            whole += jump * jump
            beyond += (jump - g[axis] * h) ** 2
        one, two = np.sqrt(one), np.sqrt(two)
        bend = (one if np.isfinite(one) else 0.0) + (two if np.isfinite(two) else 0.0)
        if chord:
            bend = max(bend, 2.0 * np.sqrt(beyond))
        if step:
            bend = max(bend, 2.0 * np.sqrt(whole))
        found[k] = bend


@kernel
def clock_sums(
    x0: FloatArray, x1: FloatArray, v0: FloatArray, v1: FloatArray, r: FloatArray, ex: FloatArray, h: float, use: Marks, met: Marks,
    found: FloatArray,
) -> None:  # fmt: skip
    """Add to ``found`` (5,): displacement times h v, (h v)^2; of free bodies r times the change of velocity, its square, digits squared."""
    for k in range(len(x0)):
        if not use[k]:
            continue
        for axis in range(x0.shape[1]):
            said = h * 0.5 * (v0[k, axis] + v1[k, axis])
            found[0] += said * (x1[k, axis] - x0[k, axis])
            found[1] += said * said
            if not met[k]:
                jump = v1[k, axis] - v0[k, axis]
                found[2] += r[k, axis] * jump
                found[3] += jump * jump
                found[4] += (ex[k] * jump) ** 2


@kernel
def momentum_sums(
    use: Marks, label: Ints, m: FloatArray, em: FloatArray, dv: FloatArray, ev: FloatArray, degree: Ints, got: FloatArray,
    allowed: FloatArray, mass: FloatArray,
) -> None:  # fmt: skip
    """Sums by group: m dv, its digits (those of a mass count for what touched), m."""
    for k in range(len(use)):
        if not use[k]:
            continue
        group = label[k]
        for axis in range(dv.shape[1]):
            got[group, axis] += m[k] * dv[k, axis]
        allowed[group] += m[k] * ev[k]
        if degree[k] > 0:
            allowed[group] += em[k] * _length(dv, k)
        mass[group] += m[k]


@kernel
def body_energies(
    x: FloatArray, v: FloatArray, omega: FloatArray, ex: FloatArray, ev: FloatArray, eo: FloatArray, m: FloatArray, inertia: FloatArray,
    g: FloatArray, turns: bool, own: FloatArray, err: FloatArray,
) -> None:  # fmt: skip
    """Kinetic and potential energy of each body, and its error by the digits."""
    size = 0.0
    for axis in range(len(g)):
        size += g[axis] * g[axis]
    size = np.sqrt(size)
    for k in range(len(x)):
        fall = 0.0
        for axis in range(len(g)):
            fall += x[k, axis] * g[axis]
        speed = _length(v, k)
        own[k] = m[k] * (0.5 * speed**2 - fall)
        err[k] = m[k] * (speed * ev[k] + 0.5 * ev[k] ** 2 + size * ex[k])
        if turns:
            spin = _length(omega, k)
            own[k] += 0.5 * inertia[k] * spin**2
            err[k] += inertia[k] * (spin * eo[k] + 0.5 * eo[k] ** 2)


@kernel
def energy_sums(
    use: Marks, label: Ints, m: FloatArray, em: FloatArray, x1: FloatArray, v0: FloatArray, v1: FloatArray, own0: FloatArray,
    own1: FloatArray, squeeze: FloatArray, g: FloatArray, hidden: float, dt: float, mu: float, gain: FloatArray, digits: FloatArray,
    step: FloatArray, springs: FloatArray, fall: FloatArray,
) -> None:  # fmt: skip
    """Sums by group: energy gained, what digits and the engine's step make of it, errors of springs in a step, m dv along gravity."""
    for k in range(len(use)):
        if not use[k]:
            continue
        group = label[k]
        first, second, down, along = _length(v0, k), _length(v1, k), 0.0, 0.0
        for axis in range(len(g)):
            down += x1[k, axis] * g[axis]
            along += (v1[k, axis] - v0[k, axis]) * g[axis]
        gain[group] += own1[k] - own0[k]
        digits[group] += m[k] * 4.0 * hidden * (max(first, second) ** 2 + abs(down)) + em[k] / m[k] * abs(
            own1[k] - own0[k]
        )
        step[group] += 0.5 * dt * squeeze[k] * (first + second)
        springs[group] += dt * dt / 8.0 * squeeze[k] ** 2 * (1.0 + 3.0 * mu * mu) / m[k]
        fall[group] += m[k] * along


@inline_kernel
def _add_moment(arm: FloatArray, vector: FloatArray, factor: float, found: FloatArray) -> None:
    """Add ``factor`` times the moment of ``vector`` at ``arm``."""
    if len(arm) == 2:
        found[0] += factor * (arm[0] * vector[1] - arm[1] * vector[0])
    else:
        found[0] += factor * (arm[1] * vector[2] - arm[2] * vector[1])
        found[1] += factor * (arm[2] * vector[0] - arm[0] * vector[2])
        found[2] += factor * (arm[0] * vector[1] - arm[1] * vector[0])


@kernel
def spin_change(
    use: Marks, w0: FloatArray, w1: FloatArray, eo0: FloatArray, eo1: FloatArray, m: FloatArray, R: FloatArray, inertia: FloatArray,
    em: FloatArray, er: FloatArray, hidden: float, turned: FloatArray, err: FloatArray,
) -> None:  # fmt: skip
    """I dw of each body, 0 of one that is not used, and its digits."""
    for k in range(len(use)):
        err[k] = 0.0
        for axis in range(w0.shape[1]):
            turned[k, axis] = inertia[k] * (w1[k, axis] - w0[k, axis]) if use[k] else 0.0
        if use[k]:
            share = em[k] / m[k] + 2.0 * er[k] / R[k]
            spin = max(_length(w0, k), _length(w1, k))
            err[k] = _length(turned, k) * share + inertia[k] * (eo0[k] + eo1[k] + 4.0 * hidden * spin)


@kernel
def centre_sums(
    use: Marks, label: Ints, m: FloatArray, x: FloatArray, v: FloatArray, mass: FloatArray, X: FloatArray, V: FloatArray
) -> None:
    """Mass, centre and velocity of each group; no mass counts as 1e-300."""
    mass[:], X[:], V[:] = 0.0, 0.0, 0.0
    for k in range(len(use)):
        if use[k]:
            group = label[k]
            mass[group] += m[k]
            for axis in range(x.shape[1]):
                X[group, axis] += m[k] * x[k, axis]
                V[group, axis] += m[k] * v[k, axis]
    for group in range(len(mass)):
        mass[group] = max(mass[group], 1e-300)
        for axis in range(x.shape[1]):
            X[group, axis] /= mass[group]
            V[group, axis] /= mass[group]


@kernel
def moment_sums(
    use: Marks, label: Ints, m: FloatArray, em: FloatArray, x: FloatArray, v: FloatArray, ex: FloatArray, ev: FloatArray, dv: FloatArray,
    X: FloatArray, V: FloatArray, hidden: float, sign: float, xi: FloatArray, u: FloatArray, change: FloatArray, noise: FloatArray,
    arms: FloatArray,
) -> None:  # fmt: skip
    """Add the angular momentum of each group about its centre, ``sign`` times, and its digits; ``arms`` become the longest ones.

    ``xi`` and ``u`` (d,) are memory.
    """
    d = x.shape[1]
    for k in range(len(use)):
        if not use[k]:
            continue
        group = label[k]
        arm = rate = 0.0
        for axis in range(d):
            xi[axis] = x[k, axis] - X[group, axis]
            u[axis] = v[k, axis] - V[group, axis]
            arm += xi[axis] * xi[axis]
            rate += u[axis] * u[axis]
        arm, rate = np.sqrt(arm), np.sqrt(rate)
        _add_moment(xi, u, sign * m[k], change[group])
        noise[group] += em[k] * arm * _length(dv, k)
        noise[group] += m[k] * (arm * (ev[k] + hidden * _length(v, k)) + rate * (ex[k] + hidden * _length(x, k)))
        arms[k] = max(arms[k], arm)


@kernel
def arm_noise(
    use: Marks, label: Ints, m: FloatArray, arms: FloatArray, own: FloatArray, ev0: FloatArray, ev1: FloatArray, dv: FloatArray,
    x0: FloatArray, x1: FloatArray, squeeze: FloatArray, h: float, eps: float, noise: FloatArray,
) -> None:  # fmt: skip
    """Add by group what the engine's round-off of velocities makes at the arms, and of coordinates with the impulses."""
    for k in range(len(use)):
        if use[k]:
            far = max(_length(x0, k), _length(x1, k))
            passed = m[k] * _length(dv, k) + squeeze[k] * h
            noise[label[k]] += m[k] * arms[k] * max(own[k] - ev0[k] - ev1[k], 0.0) + 2.0 * eps * far * passed


@kernel
def state_totals(
    use: Marks, x: FloatArray, v: FloatArray, omega: FloatArray, m: FloatArray, inertia: FloatArray, g: FloatArray, turns: bool,
    P: FloatArray, L: FloatArray, energies: FloatArray,
) -> None:  # fmt: skip
    """Add momentum, angular momentum, kinetic and potential energy of all."""
    for k in range(len(use)):
        if not use[k]:
            continue
        speed = fall = spin = 0.0
        for axis in range(x.shape[1]):
            P[axis] += m[k] * v[k, axis]
            speed += v[k, axis] * v[k, axis]
            fall += x[k, axis] * g[axis]
        _add_moment(x[k], v[k], m[k], L)
        if turns:
            for axis in range(omega.shape[1]):
                L[axis] += inertia[k] * omega[k, axis]
                spin += omega[k, axis] * omega[k, axis]
        energies[0] += 0.5 * m[k] * speed + 0.5 * inertia[k] * spin
        energies[1] -= m[k] * fall
