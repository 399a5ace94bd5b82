"""Defects planted in the kernels of grains with outlines, in the DEM and in contact dynamics."""

from __future__ import annotations

from functools import partial

from ninedisk.harness.selftest.defect import planted

FORCES, LENS, WALL = "dem.plane.grain_kernels", "nurbs.lens_kernels", "nurbs.wall_kernels"
MEETINGS, FEATURES = "cd.contact_kernels", "nurbs.features_kernels"

_kernel, _cd_kernel = partial(planted, "dem", "kernel"), partial(planted, "cd", "kernel")

_PAIR_ARMS = "arm_a, arm_b = rx * nx + ry * ny + found.beyond[m], (dx - rx) * nx"

DEFECTS = (
    _kernel("grain-arm-of-normal", "the normal force turns the first grain of a contact the other way", "ovals",
            (FORCES, "disks.torque[i] += fn * side_a", "disks.torque[i] -= fn * side_a")),
    _kernel("grain-arm-of-normal-at-walls", "the normal force of walls turns grains the other way", "stand",
            (FORCES, "disks.torque[i] += fn * side +", "disks.torque[i] += -fn * side +")),
    _kernel("grain-beyond", "lever arms end at the chord instead of the outline", "press-outlines",
            (FORCES, _PAIR_ARMS, _PAIR_ARMS.replace("+ found.beyond[m]", ""))),
    _kernel("grain-beyond-at-walls", "lever arms at walls end at the wall instead of the outline", "stand",
            (FORCES, "arm, side = found.beyond[m] - rx", "arm, side = -rx")),
    _kernel("grain-memory", "contacts of grains forget their shear force in every step", "press-outlines",
            (FORCES, "carried[best] += contact[FS]", "carried[best] += 0.0 * contact[FS]")),
    _kernel("grain-chord-end", "contacts of grains are where the first outline enters, not in the chord's middle", "press-outlines",
            (LENS, "0.5 * (ax + bx + x), 0.5 * (ay + by + y)", "0.5 * (ax + bx), 0.5 * (ay + by)")),
    _kernel("grain-wall-chord-end", "contacts of grains with walls are where the outline enters the wall", "stand",
            (WALL, "x - off * mx - 0.5 * along * my, y - off * my + 0.5 * along * mx", "x - off * mx, y - off * my")),
    _kernel("grain-slip-at-walls", "spins enter the slip of grains at walls with the wrong sign", "oval-rolls",
            (FORCES, "vt += (slip_arm - 0.5 * walls.law[w, SLIP_OVERLAP] * sunk) * disks.omega[i]",
             "vt -= (slip_arm - 0.5 * walls.law[w, SLIP_OVERLAP] * sunk) * disks.omega[i]")),
    _kernel("grain-turn", "outlines turn clockwise", "lenses",
            (FORCES, "outlines.turn[k, 0], outlines.turn[k, 1] = cos(angle), sin(angle)",
             "outlines.turn[k, 0], outlines.turn[k, 1] = cos(angle), -sin(angle)")),
    _kernel("grain-wall-load", "walls feel the weight of grains upwards", "stand",
            (FORCES, "load[0, w, 1] -= gy", "load[0, w, 1] += gy")),
    _kernel("grain-area-exponent", "the energy of the common area is cubic in the overlap of disks", "ovals-area",
            (FORCES, "curvature) ** (1.0 / 3.0)", "curvature) ** (1.0 / 2.0)")),
    _kernel("grain-area-arc", "the common area lacks the second grain's part", "ovals-area",
            (FORCES, "common += segment_area(", "common += 0.0 * segment_area(")),
    _cd_kernel("grain-arm-of-normal", "the normal force turns the first grain of a contact the other way", "oval-rolls",
            (MEETINGS, "arms[k, 0], arms[k, 2] = nx * ry - ny * rx,", "arms[k, 0], arms[k, 2] = ny * rx - nx * ry,")),
    _cd_kernel("grain-arm-of-shear", "lever arms of shear forces lack the overlap's part", "press-outlines",
            (MEETINGS, "nx * rx + ny * ry + tip[k, 0] - shorter", "nx * rx + ny * ry - shorter")),
    _cd_kernel("grain-memory", "contacts of grains forget their shear force in every step", "rough-outlines",
            (MEETINGS, "forces[best, 1] += old_forces[m, 1]", "forces[best, 1] += 0.0 * old_forces[m, 1]")),
    _cd_kernel("grain-gap-at-walls", "grains sink a thousandth of a radius into walls", "rest",
            (FEATURES, "gap = nx * px + ny * py - line.height", "gap = nx * px + ny * py - line.height + 1e-3 * size")),
    _cd_kernel("grain-vertices", "the ends of faces are not seen by walls", "stand",
            (FEATURES, "for m in range(vertices.first[shape], vertices.first[shape + 1]):",
             "for m in range(vertices.first[shape], vertices.first[shape]):")),
)  # fmt: skip
