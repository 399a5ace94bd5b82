"""Defects planted in the sources of the DEM of spheres."""

from __future__ import annotations

from functools import partial

from ninedisk.harness.selftest.defect import planted

KERNELS, SESSION = "spheres.kernels", "spheres.session"

_kernel, _python = partial(planted, "spheres", "kernel"), partial(planted, "spheres", "python")

DEFECTS = (
    _python("shear-modulus-for-young", "the normal force has G* for E*", "oblique-damped",
            (SESSION, "4.0 / 3.0 * law.e_star if law.hertz", "4.0 / 3.0 * law.g_star if law.hertz")),
    _python("young-for-shear-modulus", "the shear stiffness has E* for G*", "oblique",
            (SESSION, "        8.0 * law.g_star if law.hertz else law.ks,", "        8.0 * law.e_star if law.hertz else law.ks,")),
    _python("hertz-without-third", "E* stands for 4/3 E*", "hit",
            (SESSION, "4.0 / 3.0 * law.e_star if law.hertz", "law.e_star if law.hertz")),
    _kernel("half-the-reduced-radius", "two spheres have half their reduced radius", "hit",
            (KERNELS, "ri * state.radius[j] / reach", "0.5 * ri * state.radius[j] / reach")),
    _kernel("radius-of-the-first", "two spheres have the first one's radius", "hit",
            (KERNELS, "ri * state.radius[j] / reach", "ri")),
    _kernel("dashpot-of-the-secant", "the dashpot has the secant stiffness for the tangent one", "rebound",
            (KERNELS, "tangent = 1.5 * stiffness if hertz", "tangent = stiffness if hertz")),
    _kernel("dashpot-without-five-sixths", "the dashpot of Hertz' law is that of the linear one", "rebound",
            (KERNELS, "(sqrt(5.0 / 6.0) if hertz else 1.0)", "1.0")),
    _kernel("torque-of-the-first-alone", "the second sphere receives no torque", "spins",
            (KERNELS, "state.torque[j, c] += (state.radius[j] - arm) * twist[c] + m[c]",
             "state.torque[j, c] += 0.0 * (state.radius[j] - arm) * twist[c] + m[c]")),
    _kernel("slip-of-one-spin", "the second sphere's spin does not enter the slip", "spins",
            (KERNELS, "state.radius[j] - cut, cross(wj, shown)", "0.0, cross(wj, shown)")),
    _kernel("cap-without-dashpot", "friction is cut off at mu times the force of the spring", "oblique-damped",
            (KERNELS, "cap = law[MU] * repulsive", "cap = law[MU] * stiffness * overlap")),
    _kernel("rescale-lost", "a spring that should shrink with the contact keeps its displacement", "rescale",
            (KERNELS, "share = radius / radius_before", "share = 1.0")),
    _kernel("cap-per-axis", "friction is capped axis by axis", "slides",
            (KERNELS, "    return q[0] * limit / size, q[1] * limit / size, q[2] * limit / size",
             "    return min(max(q[0], -limit), limit), min(max(q[1], -limit), limit), min(max(q[2], -limit), limit)")),
    _kernel("sphere-turns-as-disk", "friction changes a spin as of a disk", "slides",
            (KERNELS, "state.torque[i, c] += (ri - arm) * twist[c] - m[c]", "state.torque[i, c] += 0.8 * (ri - arm) * twist[c] - m[c]")),
    _kernel("pivot-lost", "a plane turns about its own point", "turntable",
            (KERNELS, "place = motion.row[k, PIVOT + d]", "place = motion.row[k, POINT + d]")),
    _kernel("plane-turns-and-does-not-drag", "a plane that turns has the velocity of its pivot everywhere", "turntable",
            (KERNELS, "return plus(velocity, 1.0, cross(row(table, w, 12), arm))",
             "return plus(velocity, 0.0, cross(row(table, w, 12), arm))")),
    _kernel("friction-as-in-x", "friction is half as large along y", "all-ways",
            (KERNELS, "state.force[i, c] += f[c]", "state.force[i, c] += f[c] - (0.5 * fs[1] if c == 1 else 0.0)")),
    _kernel("chain-both-push", "a contact pushes the first body alone", "chain",
            (KERNELS, "state.force[j, c] -= f[c]", "state.force[j, c] -= 0.999 * f[c]")),
)  # fmt: skip
