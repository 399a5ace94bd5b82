"""Defects planted in the sources of the DEM."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from ninedisk.harness.selftest.defect import planted

FORCES, KICK, STEP = "dem.plane.force_kernels", "dem.plane.kick_kernels", "dem.plane.step_kernels"
SEARCH, MOTION, IMAGES = "dem.plane.neighbour_kernels", "scene.motion_kernels", "dem.plane.image_kernels"


_kernel, _python = partial(planted, "dem", "kernel"), partial(planted, "dem", "python")

_DISK_SLIP = (
    "vt += scratch[ROLL + q] - half_slip * (scratch[REACH + q] - (mx * mx + my * my) * inv_m) * scratch[SPIN + q]\n"
)
_LIMIT = "return min(0.5 * skin, skin - wall_drift(walls, skin))"
_WALL_SLIP = "vt += (disks.radius[i] - half_slip * sunk) * disks.omega[i]\n"
_DISK_SHEAR = "            fs = shear_force(shear[k], vt * slip_dt, ks, mu * repulsive)"
_WALL_SHEAR = "                fs = shear_force(pairs.shear[k], vt * slip_dt, ks, mu * repulsive)"
_NOTE = "note_pairs(disks, views, system.lists.pairs, system.law, system.laws)"
_KICK = "    kick(v, views.force, disks.inv_mass, step, begin, end)\n"
_DRIFT = "    drift(x, v, step.dt, begin, end)\n"

CONTACTS = (
    _kernel("shear-sign", "shear grows with the slip instead of against it", "slide",
            (FORCES, "force = before - ks * slip", "force = before + ks * slip")),
    _kernel("torque-one-body", "the second disk of a contact receives no torque", "unequal",
            (FORCES, "torque[j] += on_j", "torque[j] += 0.0 * on_j")),
    _kernel("torque-both-bodies", "contacts between disks exert no torque", "unequal",
            (FORCES, "torque[j] += on_j", "torque[j] += 0.0 * on_j"),
            (FORCES, "torque[i] += on_i", "torque[i] += 0.0 * on_i")),
    _kernel("torque-at-walls", "walls exert no torque", "roll",
            (FORCES, "disks.torque[i] += arm * fs", "disks.torque[i] += 0.0 * arm * fs")),
    _kernel("torque-sign", "the torque on the first disk of a contact is turned round", "unequal",
            (FORCES, "torque[i] += on_i", "torque[i] -= on_i")),
    _kernel("arm-of-first", "the lever arm of the second disk of a pair is that of the first", "unequal",
            (FORCES, "radius[j] * fs - loss", "radius[i] * fs - loss")),
    _kernel("slip-without-spin", "spins do not enter the slip between disks", "unequal",
            (FORCES, _DISK_SLIP, "vt += 0.0\n")),
    _kernel("slip-without-spin-at-walls", "spins do not enter the slip at walls", "roll",
            (FORCES, _WALL_SLIP, "vt += 0.0\n")),
    _kernel("slip-without-dt", "the slip of a step is the slip velocity", "retrace",
            (FORCES, _DISK_SLIP + _DISK_SHEAR, _DISK_SLIP + _DISK_SHEAR.replace("vt * slip_dt", "vt")),
            (FORCES, _WALL_SLIP + _WALL_SHEAR, _WALL_SLIP + _WALL_SHEAR.replace("vt * slip_dt", "vt"))),
    _python("lever-arm", "lever arms R and R - overlap/2 are exchanged", "reopen-far",
            ("dem.arrays", 'law.lever_arm != "radius", law.lever_arm == "overlap"',
             'law.lever_arm == "radius", law.lever_arm != "overlap"')),
    _kernel("no-cone", "shear forces are not clipped", "slide",
            (FORCES, "if force > cap:", "if force > 1e300:"), (FORCES, "if force < -cap:", "if force < -1e300:")),
    _kernel("cone-one-side", "shear forces are clipped on the positive side only", "slide",
            (FORCES, "if force < -cap:", "if force < -1e300:")),
    _kernel("cone-without-dashpot", "the cone has the spring's force, without the dashpot's", "land",
            (FORCES, _WALL_SLIP + _WALL_SHEAR, _WALL_SLIP + _WALL_SHEAR.replace("mu * repulsive", "mu * kn * overlap"))),
    _kernel("history-lost", "shear forces between disks are lost when the neighbour lists are rebuilt", "retrace",
            (SEARCH, "new.shear[k] = old.shear[o]", "new.shear[k] = 0.0 * old.shear[o]")),
    _kernel("history-lost-at-walls", "shear forces at walls are lost when the neighbour lists are rebuilt", "slide",
            (SEARCH, "new.shear[k] = scratch[listed[i]]", "new.shear[k] = 0.0 * scratch[listed[i]]")),
    _kernel("damping-half", "the dashpot has half its strength", "hit-damped",
            (FORCES, "return 2.0 * beta * sqrt(kn / inv_m_eff)", "return beta * sqrt(kn / inv_m_eff)")),
    _kernel("dashpot-mass", "the dashpot between disks has one disk's mass for the effective one", "hit-damped",
            (FORCES, "dashpot(law[KN], law[BETA], disks.inv_mass[i] + disks.inv_mass[j])",
             "dashpot(law[KN], law[BETA], disks.inv_mass[i])")),
    _kernel("dashpot-pulls", "the dashpot may pull", "hit-damped",
            (FORCES, "fn = max(kn * overlap + damping[k] * rate, 0.0)", "fn = max(kn * overlap + damping[k] * rate, -1e300)")),
    _kernel("wall-velocity", "the wall's velocity does not enter the slip", "shear-caps",
            (FORCES, "(vx - disks.v[i, 0]) * tx + (vy - disks.v[i, 1]) * ty", "-disks.v[i, 0] * tx - disks.v[i, 1] * ty")),
    _kernel("reaction", "the reaction on the second disk is a millionth too large", "hit",
            (FORCES, "force[jx] -= gx", "force[jx] -= 1.000001 * gx")),
    _kernel("normal-tilted", "the normal between disks is off by a hundredth of a radian", "hit",
            (FORCES, "nx, ny = dx * inv_d, dy * inv_d",
             "nx, ny = (dx - 0.01 * dy) * inv_d, (dy + 0.01 * dx) * inv_d")),
    _kernel("stale-contact", "forces between disks belong to the positions of the step before", "press",
            (FORCES, "dx, dy = scratch[DX + q], scratch[DY + q]",
             "dx, dy = scratch[DX + q] + slip_dt * scratch[VX + q], scratch[DY + q] + slip_dt * scratch[VY + q]")),
    _kernel("fifth-pair", "every fifth pair is missed by the contact search", "press",
            (SEARCH, "if dx * dx + dy * dy < limit * limit:",
             "if (i + j) % 5 != 0 and dx * dx + dy * dy < limit * limit:")),
    _kernel("no-skin", "the contact search ignores the skin: contacts are missed until the next rebuild", "hit",
            ("dem.plane.neighbour_kernels", "code = build_pairs(disks.x, disks.radius, skin, cells",
             "code = build_pairs(disks.x, disks.radius, 0.0, cells")),
    _kernel("no-rebuild", "neighbour lists are never rebuilt", "hit",
            (STEP, _LIMIT, "return 1e100")),
)  # fmt: skip

STEPPING = (
    _python("damping-lagged", "global damping sees the velocity of half a step before", "press",
            ("dem.arrays", 'central = numerics.damping_form == "central"', "central = False")),
    _python("first-kick", "the first kick is a whole one", "slide", ("dem.arrays", "gain=0.5 * dt", "gain=dt")),
    _kernel("no-spin-damping", "global damping leaves the spins alone", "shear-caps",
            (KICK, "spin = keep * before + gain * (", "spin = before + dt * (")),
    _kernel("explicit-euler", "positions move with the velocity of the step before", "hit",
            (KICK, _DRIFT, ""), (KICK, _KICK, _DRIFT + _KICK)),
    _kernel("half-gravity", "half of gravity is left out of the vertical motion", "slide",
            (KICK, "inv_mass[i] + weight * step.gravity_y)", "inv_mass[i] + 0.5 * weight * step.gravity_y)")),
    _kernel("single-precision", "positions are kept in single precision", "press",
            (KICK, "x[q] += dt * v[q]", "x[q] = np.float32(x[q] + dt * v[q])")),
    _kernel("unsynchronised", "velocities are reported at half steps", "slide",
            ("dem.plane.sample_kernels", "return 0.5 * (value + step.kick.keep * value + step.kick.gain * acceleration)",
             "return value + 0.0 * acceleration")),
    _kernel("wall-late", "walls stand where they were a step before", "press",
            (STEP, "t, t_half = n * step.kick.dt, (n - 0.5) * step.kick.dt",
             "t, t_half = (n - 1) * step.kick.dt, (n - 0.5) * step.kick.dt")),
    _python("wall-pivot", "walls turn about their own point instead of the pivot", "shear",
            ("scene.motion", "point if seg.pivot is None else seg.pivot", "point")),
    _kernel("wall-turn", "walls turn the other way", "shear",
            (MOTION, "c, s = cos(motion.spin[k] * tau), sin(motion.spin[k] * tau)",
             "c, s = cos(motion.spin[k] * tau), -sin(motion.spin[k] * tau)")),
    _kernel("wall-straight", "caps that follow the side walls move at a constant rate", "shear-caps",
            (MOTION, "ramp = tan(motion.tan_rate[k] * tau)", "ramp = motion.tan_rate[k] * tau"),
            (MOTION, "rate = motion.tan_rate[k] / (c * c)", "rate = motion.tan_rate[k]")),
)  # fmt: skip

REOPENED = (
    _kernel("history-kept", "contacts between disks that opened keep their shear force", "reopen-disks",
            (FORCES, "            shear[k] = fs\n", "            shear[k] = fs if overlap > 0.0 else shear[k]\n")),
    _kernel("history-kept-at-walls", "contacts with walls that opened keep their shear force", "reopen-wall",
            (FORCES, "                pairs.shear[k] = 0.0\n                if laws",
             "                pairs.shear[k] *= 1.0\n                if laws")),
    _kernel("dashpot-of-walls", "dashpots at walls do not see the wall's own motion", "push-wall",
            (FORCES, "rate = (rate_x - spin * qy - dashpot_v[i, 0]) * ux + (rate_y + spin * qx - dashpot_v[i, 1]) * uy",
             "rate = -dashpot_v[i, 0] * ux - dashpot_v[i, 1] * uy")),
    _kernel("wall-shakes", "harmonic motions of walls have the wrong sign", "shake",
            (MOTION, "wave = sin(motion.frequency[k] * tau + motion.phase[k]) - sin(motion.phase[k])",
             "wave = sin(motion.phase[k]) - sin(motion.frequency[k] * tau + motion.phase[k])")),
    _kernel("wall-shakes-rate", "dashpots see a shaken wall's velocity without its phase", "shake",
            (MOTION, "rate = motion.frequency[k] * cos(motion.frequency[k] * tau + motion.phase[k])",
             "rate = motion.frequency[k] * cos(motion.frequency[k] * tau)")),
    _python("dashpot-lagged", "dashpots see the velocity of half a step before", "push-wall",
            ("dem.arrays", "ahead=0.5", "ahead=0.0")),
    _kernel("dashpot-stale", "dashpots are not found anew when the neighbour lists are rebuilt", "hit-damped",
            (STEP, _NOTE, f"noted = views.damping.copy(); {_NOTE}; views.damping[:] = noted")),
)  # fmt: skip

RETRACED = (
    _python("slip-at", "slip is measured at the end of the step where it should be in the middle, and the other way round", "retrace",
            ("dem.arrays", 'law.slip_at == "middle"', 'law.slip_at != "middle"')),
    _kernel("slip-at-the-begin", "slip between disks is measured with the normal of the step's begin", "retrace",
            (FORCES, "mx, my = dx + back * vx, dy + back * vy", "mx, my = dx + 2.0 * back * vx, dy + 2.0 * back * vy")),
    _kernel("slip-of-a-later-wall", "slip in the middle of the step is measured with the wall's pose of its end", "retrace-wall",
            (STEP, "place_walls(motion, t_half, t_half, t_half, walls.middle)",
             "place_walls(motion, t, t_half, t_half, walls.middle)")),
)  # fmt: skip

OPTIONS = (
    _kernel("rolling-sign-at-walls", "walls turn disks on instead of holding them back", "resist-constant",
            (FORCES, "disks.torque[i] -= bending", "disks.torque[i] += bending")),
    _kernel("rolling-one-body", "rolling resistance acts on one disk of a pair", "resist-pair",
            (FORCES, "on_j += scratch[BENDING + q]", "on_j += 0.0 * scratch[BENDING + q]")),
    _kernel("rolling-first-radius", "rolling resistance between disks has the first one's radius for the reduced one", "resist-pair",
            (FORCES, "torque_reach(law, ri * rj / (ri + rj))", "torque_reach(law, ri)")),
    _kernel("rolling-history-lost", "rolling springs at walls are lost when the neighbour lists are rebuilt", "resist-spring",
            (SEARCH, "new.bending[m] = scratch[listed[new.other[m]]]", "new.bending[m] = 0.0 * scratch[listed[new.other[m]]]")),
    _kernel("rolling-limit", "rolling springs have half their limit", "resist-spring",
            (FORCES, "limit = torque_reach(law, disks.radius[i]) * repulsive",
             "limit = 0.5 * torque_reach(law, disks.radius[i]) * repulsive")),
    _kernel("cohesion-clipped", "dashpots do not pull in spite of cohesion", "cohesive-damped",
            (FORCES, "if cohesion == 0.0:\n            force = max(force, 0.0)",
             "if cohesion >= 0.0:\n            force = max(force, 0.0)")),
    _kernel("material-of-the-first", "all disks have the first material at walls", "materials",
            (FORCES, "laws.of_wall[w, laws.material[disks.name[i]]]", "laws.of_wall[w, 0 * disks.name[i]]")),
    _kernel("force-at-the-instant", "forces on disks are those at the step's time, not their mean over it", "forces",
            (STEP, "return float(max(min(loads.time[k, 1], last) - max(loads.time[k, 0], first), 0.0) / (last - first))",
             "return 1.0 if loads.time[k, 0] <= n * dt < loads.time[k, 1] else 0.0")),
    _kernel("rolling-uncapped", "rolling springs at walls never yield", "resist-spring",
            (FORCES, "held = min(max(before + law[KR] * (slip_dt * turn), -limit), limit)", "held = before + law[KR] * (slip_dt * turn)")),
)  # fmt: skip

LISTS = (
    _kernel("skin-too-generous", "disks may move twenty times as far as the skin allows before the lists are rebuilt", "hit-near",
            (STEP, _LIMIT, _LIMIT.replace("min(", "20.0 * min("))),
    _kernel("wall-unnoticed", "the lists do not notice that a wall comes closer", "push-wall",
            (STEP, _LIMIT, "return 0.5 * skin")),
)  # fmt: skip

SORT_ALL = (("dem.arrays", "SORT_FROM = 2_000", "SORT_FROM = 1"), ("dem.arrays", "STRIPES = 64", "STRIPES = 4"))
"""Have every scene's disks sorted and divided into a few stripes, as only scenes of thousands of disks are: right in themselves."""

STRIPED = (
    _kernel("border-unmoved", "disks on the borders of stripes are not moved", "stack",
            *SORT_ALL, (STEP, "far = farther(far, kick_borders(system, images, n, thread, threads))", "far += 0.0")),
    _kernel("border-early", "disks on the borders of stripes move before the stripe below has acted on them", "stack",
            *SORT_ALL, (STEP, "kicked_from = team.border[s] if parity == 0 else stripe[s]", "kicked_from = stripe[s]"),
            (STEP, "far = farther(far, kick_borders(system, images, n, thread, threads))", "far += 0.0")),
    _kernel("border-narrow", "the border of a stripe ends one disk too early", "stack",
            *SORT_ALL, ("dem.plane.neighbour_kernels", "cells.start[(row + 1) * nx]", "cells.start[row * nx]")),
    _kernel("load-of-a-stripe", "the first stripe's load on the walls is lost", "stack",
            *SORT_ALL, (STEP, "for s in range(walls.share.shape[0]):", "for s in range(1, walls.share.shape[0]):")),
    _kernel("order-of-samples", "samples have the disks in the order of the cells", "reopen-far",
            *SORT_ALL, ("dem.plane.sample_kernels", "i = disks.place[samples.chosen[c]]", "i = samples.chosen[c]")),
    _kernel("order-of-spins", "spins stay behind when disks are brought into the order of the cells", "reopen-far",
            *SORT_ALL, ("dem.plane.neighbour_kernels", "    permute(disks.omega, order, one)\n", "")),
    _kernel("order-of-history", "shear forces follow the rows of the lists instead of the disks", "shear-caps",
            *SORT_ALL, ("dem.plane.neighbour_kernels", "    permute_numbers(disks.listed, order, one)\n", "")),
)  # fmt: skip

CELLS = (
    _kernel("image-at-rest", "images do not move with the cell's edges", "cell-shear",
            (IMAGES, "        scratch[VX + q] -= mx\n        scratch[VY + q] -= my\n", "")),
    _kernel("half-branch", "the stress has half of each contact's branch", "cell-press",
            (IMAGES, "bx, by, bx, by\n", "bx, by, 0.5 * bx, 0.5 * by\n")),
    _kernel("wrong-image", "pairs across the upper edge forget how far the cell leans", "cell-flow",
            (IMAGES, "along = aside + home[i, 0] - home[j, 0] - tilt * across", "along = aside + home[i, 0] - home[j, 0]")),
    _kernel("history-of-another-image", "shear forces are lost when the lists of a cell are rebuilt", "cell-seen",
            (IMAGES, "new.shear[k] = carried(old,", "new.shear[k] = 0.0 * carried(old,")),
    _kernel("cell-late", "images are where the edges were a step before", "cell-press",
            (STEP, "                    place_cell(images, n * step.kick.dt)\n",
             "                    place_cell(images, (n - 1) * step.kick.dt)\n")),
    _kernel("no-work-of-the-cell", "the work of the cell has the last step's power alone", "cell-smooth",
            (IMAGES, "images.work[0] += 0.5 * dt", "images.work[0] = 0.5 * dt")),
    _kernel("drift-beside-no-flow", "the lists do not notice that the cell deforms", "cell-flow",
            (STEP, "return room_left(images, skin, widest)", "return 20.0 * skin")),
)  # fmt: skip

HOLES = tuple(
    replace(defect, hole=reason)
    for reason, defect in (
        (
            "no case has positions that stop being finite, and the session, which looks for them once more, says so a little later",
            _kernel("nan-forgotten", "a displacement that is not finite does not rebuild the lists", "hit",
                    (KICK, "return d2 if d2 > far or d2 != d2 else far", "return d2 if d2 > far else far")),
        ),
    )
)  # fmt: skip

DEFECTS = (*CONTACTS, *STEPPING, *REOPENED, *RETRACED, *OPTIONS, *LISTS, *STRIPED, *CELLS, *HOLES)
