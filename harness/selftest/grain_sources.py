"""Defects planted in the kernels of grains with outlines, in the DEM and in contact dynamics."""

from __future__ import annotations

from functools import partial

from ninedisk.harness.selftest.defect import planted

FORCES, LENS, WALL = "dem.plane.grain_kernels", "nurbs.lens_kernels", "nurbs.wall_kernels"
MEETINGS, FEATURES = "cd.contact_kernels", "nurbs.features_kernels"

_kernel, _cd_kernel = partial(planted, "dem", "kernel"), partial(planted, "cd", "kernel")

DEFECTS = (
    _kernel("grain-arm-of-normal", "the normal force turns the first grain of a contact the other way", "ovals",
            (FORCES, "pair_forces", "disks.torque[i] += fn * side_a + fs * (arm_a - back)",
             "disks.torque[i] -= fn * side_a + fs * (arm_a - back)")),
    _kernel("grain-arm-of-normal-at-walls", "the normal force of walls turns grains the other way", "stand",
            (FORCES, "wall_forces", "fn * side + fs * (arm - 0.5 * walls.law[w, TORQUE_OVERLAP] * overlap)",
             "-fn * side + fs * (arm - 0.5 * walls.law[w, TORQUE_OVERLAP] * overlap)")),
    _kernel("grain-beyond", "lever arms end at the chord instead of the outline", "press-outlines",
            (FORCES, "pair_forces", "rx * nx + ry * ny + found.beyond[m]", "rx * nx + ry * ny")),
    _kernel("grain-beyond-at-walls", "lever arms at walls end at the wall instead of the outline", "stand",
            (FORCES, "wall_forces", "found.beyond[m] - rx * ux", "-rx * ux")),
    _kernel("grain-memory", "contacts of grains forget their shear force in every step", "press-outlines",
            (FORCES, "inherit", "carried[best] += contact[FS]", "carried[best] += 0.0 * contact[FS]")),
    _kernel("grain-chord-end", "contacts of grains are where the first outline enters, not in the chord's middle", "press-outlines",
            (LENS, "chord", "x, y, 0.5 * (ax + bx + x), 0.5 * (ay + by + y)", "x, y, 0.5 * (ax + bx), 0.5 * (ay + by)")),
    _kernel("grain-wall-chord-end", "contacts of grains with walls are where the outline enters the wall", "stand",
            (WALL, "wall_contacts", "x - off * mx - 0.5 * along * my, y - off * my + 0.5 * along * mx", "x - off * mx, y - off * my")),
    _kernel("grain-slip-at-walls", "spins enter the slip of grains at walls with the wrong sign", "oval-rolls",
            (FORCES, "wall_forces", "vt += (slip_arm - 0.5 * walls.law[w, SLIP_OVERLAP] * sunk) * disks.omega[i]",
             "vt -= (slip_arm - 0.5 * walls.law[w, SLIP_OVERLAP] * sunk) * disks.omega[i]")),
    _kernel("grain-turn", "outlines turn clockwise", "lenses",
            (FORCES, "begin_pass", "cos(angle), sin(angle)", "cos(angle), -sin(angle)")),
    _kernel("grain-wall-load", "walls feel the weight of grains upwards", "stand",
            (FORCES, "wall_forces", "load[0, w, 1] -= gy", "load[0, w, 1] += gy")),
    _kernel("grain-area-exponent", "the energy of the common area is cubic in the overlap of disks", "ovals-area",
            (FORCES, "spring", "(9.0 / 32.0 * common * common * curvature) ** (1.0 / 3.0)",
             "(9.0 / 32.0 * common * common * curvature) ** (1.0 / 2.0)")),
    _kernel("grain-area-arc", "the common area lacks the second grain's part", "ovals-area",
            (FORCES, "spring", "segment_area(outlines.table, outlines.shape[b], place[m, 3], place[m, 1])",
             "0.0 * segment_area(outlines.table, outlines.shape[b], place[m, 3], place[m, 1])")),
    _cd_kernel("grain-arm-of-normal", "the normal force turns the first grain of a contact the other way", "oval-rolls",
            (MEETINGS, "complete_frames", "nx * ry - ny * rx, nx * rx + ny * ry + tip[k, 0] - shorter",
             "ny * rx - nx * ry, nx * rx + ny * ry + tip[k, 0] - shorter")),
    _cd_kernel("grain-arm-of-shear", "lever arms of shear forces lack the overlap's part", "press-outlines",
            (MEETINGS, "complete_frames", "nx * rx + ny * ry + tip[k, 0]", "nx * rx + ny * ry")),
    _cd_kernel("grain-memory", "contacts of grains forget their shear force in every step", "rough-outlines",
            (MEETINGS, "carry_over", "forces[best, 1] += old_forces[m, 1]", "forces[best, 1] += 0.0 * old_forces[m, 1]")),
    _cd_kernel("grain-gap-at-walls", "grains sink a thousandth of a radius into walls", "rest",
            (FEATURES, "wall_feature", "nx * px + ny * py - line.height", "nx * px + ny * py - line.height + 1e-3 * size")),
    _cd_kernel("grain-vertices", "the ends of faces are not seen by walls", "stand",
            (FEATURES, "features_at_wall", "vertices.first[shape + 1]", "vertices.first[shape]")),
)  # fmt: skip
