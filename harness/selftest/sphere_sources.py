"""Defects planted in the sources of the DEM of spheres."""

from __future__ import annotations

from functools import partial

from ninedisk.harness.selftest.defect import planted

KERNELS, LISTS, SESSION = "spheres.kernels", "spheres.neighbour_kernels", "spheres.session"

_kernel, _python = partial(planted, "spheres", "kernel"), partial(planted, "spheres", "python")

DEFECTS = (
    _python("shear-modulus-for-young", "the normal force has G* for E*", "oblique-damped",
            (SESSION, "4.0 / 3.0 * law.e_star if law.hertz", "4.0 / 3.0 * law.g_star if law.hertz")),
    _python("young-for-shear-modulus", "the shear stiffness has E* for G*", "oblique",
            (SESSION, "        8.0 * law.g_star if law.hertz else law.ks,", "        8.0 * law.e_star if law.hertz else law.ks,")),
    _python("hertz-without-third", "E* stands for 4/3 E*", "hit",
            (SESSION, "4.0 / 3.0 * law.e_star if law.hertz", "law.e_star if law.hertz")),
    _kernel("half-the-reduced-radius", "two spheres have half their reduced radius", "hit",
            (LISTS, "radius[i] * radius[j] / reach", "0.5 * radius[i] * radius[j] / reach")),
    _kernel("radius-of-the-first", "two spheres have the first one's radius", "hit",
            (LISTS, "radius[i] * radius[j] / reach", "radius[i]")),
    _kernel("dashpot-of-the-secant", "the dashpot has the secant stiffness for the tangent one", "rebound",
            (LISTS, "(1.5 * 5.0 / 6.0 if law[HERTZ]", "(5.0 / 6.0 if law[HERTZ]")),
    _kernel("dashpot-without-five-sixths", "the dashpot of Hertz' law is that of the linear one", "rebound",
            (LISTS, "(1.5 * 5.0 / 6.0 if law[HERTZ]", "(1.5 if law[HERTZ]")),
    _kernel("torque-of-the-first-alone", "the second sphere receives no torque", "spins",
            (KERNELS, "blend(torque, j, 1.0, torque, j, radius[j] - arm_loss,", "blend(torque, j, 1.0, torque, j, 0.0,")),
    _kernel("slip-of-one-spin", "the second sphere's spin does not enter the slip", "spins",
            (KERNELS, "radius[i], omega, i, radius[j], omega, j)", "radius[i], omega, i, 0.0, omega, j)")),
    _kernel("cap-without-dashpot", "friction is cut off at mu times the force of the spring", "oblique-damped",
            (KERNELS, "cap = law.mu * repulsive", "cap = law.mu * stiffness * overlap")),
    _kernel("rescale-lost", "a spring that should shrink with the contact keeps its displacement", "rescale",
            (KERNELS, "spring = scaled(spring, sqrt(overlap / overlap_before))", "spring = scaled(spring, 1.0)")),
    _kernel("cap-per-axis", "friction is capped axis by axis", "slides",
            (KERNELS, "    return scaled(q, limit / size if size > limit else 1.0)",
             "    return min(max(q[0], -limit), limit), min(max(q[1], -limit), limit), min(max(q[2], -limit), limit)")),
    _kernel("sphere-turns-as-disk", "friction changes a spin as of a disk", "slides",
            (KERNELS, "push, arm = vector(scratch, PUSH + q), radius[i]", "push, arm = vector(scratch, PUSH + q), 0.8 * radius[i]")),
    _kernel("pivot-lost", "a plane turns about its own point", "turntable",
            (KERNELS, "place = motion.row[k, PIVOT + d]", "place = motion.row[k, POINT + d]")),
    _kernel("plane-turns-and-does-not-drag", "a plane that turns has the velocity of its pivot everywhere", "turntable",
            (KERNELS, "return plus(velocity, 1.0, cross(row(table, w, 12), arm))",
             "return plus(velocity, 0.0, cross(row(table, w, 12), arm))")),
    _kernel("friction-as-in-x", "friction is half as large along y", "all-ways",
            (KERNELS, "        fs = spring", "        fs = (spring[0], 0.5 * spring[1], spring[2])")),
    _kernel("chain-both-push", "a contact pushes the first body alone", "chain",
            (KERNELS, "blend(force, j, 1.0, force, j, -1.0,", "blend(force, j, 1.0, force, j, -0.999,")),
)  # fmt: skip
