"""Defects planted in the sources of the DEM."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from ninedisk.harness.selftest.defect import planted

LOADS = "dem.loads_kernels"
FORCES, KICK, STEP = "dem.plane.force_kernels", "dem.plane.kick_kernels", "dem.plane.step_kernels"
SEARCH, MOTION, IMAGES = "dem.plane.neighbour_kernels", "scene.motion_kernels", "dem.plane.image_kernels"

_kernel, _python = partial(planted, "dem", "kernel"), partial(planted, "dem", "python")

REBUILD = "dem.plane.rebuild_kernels"
PAIRS, WALLS = "_pair_forces.pair_forces", "disk_wall_forces"

_LIMIT = "min(0.5 * skin, skin - wall_drift(walls, skin))"
_NOTE = "note_pairs(disks, views, system.lists.pairs, system.law, system.laws)"
_KICK, _DRIFT = "kick(v, views.force, disks.inv_mass, step, begin, end)", "drift(x, v, step.dt, begin, end)"
_HALF_KICK = (
    "Kick(keep=(1.0 - a) / (1.0 + a) if central else 1.0 - 2.0 * a, gain=dt / (1.0 + a) if central else dt, "
    "ahead=0.5, drag=2.0 * a, seen=0.5 if central else 0.0, mean=0.5, **shared)"
)
_BORDERS = "far = farther(far, kick_borders(system, images, n, thread, threads))"

CONTACTS = (
    _kernel("shear-sign", "shear grows with the slip instead of against it", "slide",
            (FORCES, "shear_force", "before - ks * slip", "before + ks * slip")),
    _kernel("torque-one-body", "the second disk of a contact receives no torque", "unequal",
            (FORCES, "scatter", "torque[j] += on_j", "torque[j] += 0.0 * on_j")),
    _kernel("torque-both-bodies", "contacts between disks exert no torque", "unequal",
            (FORCES, "scatter", "torque[j] += on_j", "torque[j] += 0.0 * on_j"),
            (FORCES, "scatter", "torque[i] += on_i", "torque[i] += 0.0 * on_i")),
    _kernel("torque-at-walls", "walls exert no torque", "roll",
            (FORCES, WALLS, "disks.torque[i] += arm * fs", "disks.torque[i] += 0.0 * arm * fs")),
    _kernel("torque-sign", "the torque on the first disk of a contact is turned round", "unequal",
            (FORCES, "scatter", "torque[i] += on_i", "torque[i] -= on_i")),
    _kernel("arm-of-first", "the lever arm of the second disk of a pair is that of the first", "unequal",
            (FORCES, "scatter", "radius[i] * fs - loss, radius[j] * fs - loss", "radius[i] * fs - loss, radius[i] * fs - loss")),
    _kernel("slip-without-spin", "spins do not enter the slip between disks", "unequal",
            (FORCES, PAIRS, "scratch[ROLL + q] - half_slip * (scratch[REACH + q] - (mx * mx + my * my) * inv_m) * scratch[SPIN + q]",
             "0.0")),
    _kernel("slip-without-spin-at-walls", "spins do not enter the slip at walls", "roll",
            (FORCES, WALLS, "(disks.radius[i] - half_slip * sunk) * disks.omega[i]", "0.0")),
    _kernel("slip-without-dt", "the slip of a step is the slip velocity", "retrace",
            (FORCES, PAIRS, "shear_force(shear[k], vt * slip_dt, ks, mu * repulsive)",
             "shear_force(shear[k], vt, ks, mu * repulsive)"),
            (FORCES, WALLS, "shear_force(pairs.shear[k], vt * slip_dt, ks, mu * repulsive)",
             "shear_force(pairs.shear[k], vt, ks, mu * repulsive)")),
    _python("lever-arm", "lever arms R and R - overlap/2 are exchanged", "reopen-far",
            ("dem.arrays", "law_row", 'law.lever_arm != "radius", law.lever_arm == "overlap"',
             'law.lever_arm == "radius", law.lever_arm != "overlap"')),
    _kernel("no-cone", "shear forces are not clipped", "slide",
            (FORCES, "shear_force", "force > cap", "force > 1e300"),
            (FORCES, "shear_force", "force < -cap", "force < -1e300")),
    _kernel("cone-one-side", "shear forces are clipped on the positive side only", "slide",
            (FORCES, "shear_force", "force < -cap", "force < -1e300")),
    _kernel("cone-without-dashpot", "the cone has the spring's force, without the dashpot's", "land",
            (FORCES, WALLS, "mu * repulsive", "mu * kn * overlap")),
    _kernel("history-lost", "shear forces between disks are lost when the neighbour lists are rebuilt", "retrace",
            (SEARCH, "enter_pair", "new.shear[k] = old.shear[o]", "new.shear[k] = 0.0 * old.shear[o]")),
    _kernel("history-lost-at-walls", "shear forces at walls are lost when the neighbour lists are rebuilt", "slide",
            (SEARCH, "build_wall_pairs", "scratch[listed[i]]", "0.0 * scratch[listed[i]]")),
    _kernel("damping-half", "the dashpot has half its strength", "hit-damped",
            (FORCES, "dashpot", "2.0 * beta * sqrt(kn / inv_m_eff)", "beta * sqrt(kn / inv_m_eff)")),
    _kernel("dashpot-mass", "the dashpot between disks has one disk's mass for the effective one", "hit-damped",
            (FORCES, "note_pairs", "disks.inv_mass[i] + disks.inv_mass[j]", "disks.inv_mass[i]")),
    _kernel("dashpot-pulls", "the dashpot may pull", "hit-damped",
            (FORCES, PAIRS, "max(kn * overlap + damping[k] * rate, 0.0)", "max(kn * overlap + damping[k] * rate, -1e300)")),
    _kernel("wall-velocity", "the wall's velocity does not enter the slip", "shear-caps",
            (FORCES, WALLS, "(vx - disks.v[i, 0]) * tx + (vy - disks.v[i, 1]) * ty", "-disks.v[i, 0] * tx - disks.v[i, 1] * ty")),
    _kernel("reaction", "the reaction on the second disk is a millionth too large", "hit",
            (FORCES, "scatter", "force[jx] -= gx", "force[jx] -= 1.000001 * gx")),
    _kernel("normal-tilted", "the normal between disks is off by a hundredth of a radian", "hit",
            (FORCES, PAIRS, "dx * inv_d, dy * inv_d", "(dx - 0.01 * dy) * inv_d, (dy + 0.01 * dx) * inv_d")),
    _kernel("stale-contact", "forces between disks belong to the positions of the step before", "press",
            (FORCES, PAIRS, "scratch[DX + q], scratch[DY + q]",
             "scratch[DX + q] + slip_dt * scratch[VX + q], scratch[DY + q] + slip_dt * scratch[VY + q]")),
    _kernel("fifth-pair", "every fifth pair is missed by the contact search", "press",
            (SEARCH, "build_pairs", "dx * dx + dy * dy < limit * limit", "(i + j) % 5 != 0 and dx * dx + dy * dy < limit * limit")),
    _kernel("no-skin", "the contact search ignores the skin: contacts are missed until the next rebuild", "hit",
            (REBUILD, "rebuild", "build_pairs(disks.x, disks.radius, skin, cells, step.sorted, disks.listed, pairs, spare)",
             "build_pairs(disks.x, disks.radius, 0.0, cells, step.sorted, disks.listed, pairs, spare)")),
    _kernel("no-rebuild", "neighbour lists are never rebuilt", "hit",
            (STEP, "farthest_allowed", _LIMIT, "1e100")),
)  # fmt: skip

STEPPING = (
    _python("damping-lagged", "global damping sees the velocity of half a step before", "press",
            ("dem.arrays", "step_constants", 'numerics.damping_form == "central"', "False")),
    _python("first-kick", "the first kick is a whole one", "slide", ("dem.arrays", "step_constants", "0.5 * dt", "dt")),
    _kernel("no-spin-damping", "global damping leaves the spins alone", "shear-caps",
            (KICK, "turn", "keep * before + gain * (torque[i] * inv_inertia[i])", "before + dt * (torque[i] * inv_inertia[i])")),
    _kernel("explicit-euler", "positions move with the velocity of the step before", "hit",
            (KICK, "kick_and_drift", _DRIFT, ""), (KICK, "kick_and_drift", _KICK, f"{_DRIFT}\n{_KICK}")),
    _kernel("half-gravity", "half of gravity is left out of the vertical motion", "slide",
            (KICK, "kick", "weight * step.gravity_y", "0.5 * weight * step.gravity_y")),
    _kernel("single-precision", "positions are kept in single precision", "press",
            (KICK, "drift", "x[q] += dt * v[q]", "x[q] = np.float32(x[q] + dt * v[q])")),
    _kernel("unsynchronised", "velocities are reported at half steps", "slide",
            ("dem.plane.sample_kernels", "synchronised", "0.5 * (value + step.kick.keep * value + step.kick.gain * acceleration)",
             "value + 0.0 * acceleration")),
    _kernel("wall-late", "walls stand where they were a step before", "press",
            (STEP, "advance", "n * step.kick.dt, (n - 0.5) * step.kick.dt", "(n - 1) * step.kick.dt, (n - 0.5) * step.kick.dt")),
    _python("wall-pivot", "walls turn about their own point instead of the pivot", "shear",
            ("scene.motion", "_table", "point if seg.pivot is None else seg.pivot", "point")),
    _kernel("wall-turn", "walls turn the other way", "shear",
            (MOTION, "pose_at", "sin(motion.spin[k] * tau)", "-sin(motion.spin[k] * tau)")),
    _kernel("wall-straight", "caps that follow the side walls move at a constant rate", "shear-caps",
            (MOTION, "displacement", "tan(motion.tan_rate[k] * tau)", "motion.tan_rate[k] * tau"),
            (MOTION, "velocity_at", "motion.tan_rate[k] / (c * c)", "motion.tan_rate[k]")),
)  # fmt: skip

REOPENED = (
    _kernel("history-kept", "contacts between disks that opened keep their shear force", "reopen-disks",
            (FORCES, PAIRS, "shear[k] = fs", "shear[k] = fs if overlap > 0.0 else shear[k]")),
    _kernel("history-kept-at-walls", "contacts with walls that opened keep their shear force", "reopen-wall",
            (FORCES, WALLS, "pairs.shear[k] = 0.0", "pairs.shear[k] *= 1.0")),
    _kernel("dashpot-of-walls", "dashpots at walls do not see the wall's own motion", "push-wall",
            (FORCES, WALLS, "(rate_x - spin * qy - dashpot_v[i, 0]) * ux + (rate_y + spin * qx - dashpot_v[i, 1]) * uy",
             "-dashpot_v[i, 0] * ux - dashpot_v[i, 1] * uy")),
    _kernel("wall-shakes", "harmonic motions of walls have the wrong sign", "shake",
            (MOTION, "displacement", "sin(motion.frequency[k] * tau + motion.phase[k]) - sin(motion.phase[k])",
             "sin(motion.phase[k]) - sin(motion.frequency[k] * tau + motion.phase[k])")),
    _kernel("wall-shakes-rate", "dashpots see a shaken wall's velocity without its phase", "shake",
            (MOTION, "velocity_at", "motion.frequency[k] * tau + motion.phase[k]", "motion.frequency[k] * tau")),
    _python("dashpot-lagged", "dashpots see the velocity of half a step before", "push-wall",
            ("dem.arrays", "step_constants", _HALF_KICK, _HALF_KICK.replace("ahead=0.5", "ahead=0.0"))),
    _kernel("dashpot-stale", "dashpots are not found anew when the neighbour lists are rebuilt", "hit-damped",
            (STEP, "advance", _NOTE, f"noted = views.damping.copy()\n{_NOTE}\nviews.damping[:] = noted")),
)  # fmt: skip

RETRACED = (
    _python("slip-at", "slip is measured at the end of the step where it should be in the middle, and the other way round", "retrace",
            ("dem.arrays", "law_row", 'law.slip_at == "middle"', 'law.slip_at != "middle"')),
    _kernel("slip-at-the-begin", "slip between disks is measured with the normal of the step's begin", "retrace",
            (FORCES, PAIRS, "dx + back * vx, dy + back * vy", "dx + 2.0 * back * vx, dy + 2.0 * back * vy")),
    _kernel("slip-of-a-later-wall", "slip in the middle of the step is measured with the wall's pose of its end", "retrace-wall",
            (STEP, "advance", "place_walls(motion, t_half, t_half, t_half, walls.middle)",
             "place_walls(motion, t, t_half, t_half, walls.middle)")),
)  # fmt: skip

OPTIONS = (
    _python("held-mass", "the mass of a disk that is held counts in its dashpots", "held",
            ("dem.arrays", "disk_arrays", "disks.held.all(axis=1)", "disks.fixed")),
    _kernel("rolling-sign-at-walls", "walls turn disks on instead of holding them back", "resist-constant",
            (FORCES, WALLS, "disks.torque[i] -= bending", "disks.torque[i] += bending")),
    _kernel("rolling-one-body", "rolling resistance acts on one disk of a pair", "resist-pair",
            (FORCES, "scatter", "on_j += scratch[BENDING + q]", "on_j += 0.0 * scratch[BENDING + q]")),
    _kernel("rolling-first-radius", "rolling resistance between disks has the first one's radius for the reduced one", "resist-pair",
            (FORCES, "note_law", "ri * rj / (ri + rj)", "ri")),
    _kernel("rolling-history-lost", "rolling springs at walls are lost when the neighbour lists are rebuilt", "resist-spring",
            (SEARCH, "build_wall_pairs", "scratch[listed[new.other[m]]]", "0.0 * scratch[listed[new.other[m]]]")),
    _kernel("rolling-limit", "rolling springs have half their limit", "resist-spring",
            (FORCES, "wall_bending", "torque_reach(law, disks.radius[i])", "0.5 * torque_reach(law, disks.radius[i])")),
    _kernel("cohesion-clipped", "dashpots do not pull in spite of cohesion", "cohesive-damped",
            (FORCES, "normal_force", "cohesion == 0.0", "cohesion >= 0.0")),
    _kernel("material-of-the-first", "all disks have the first material at walls", "materials",
            (FORCES, "law_at_wall", "laws.material[disks.name[i]]", "0 * disks.name[i]")),
    _kernel("force-at-the-instant", "forces on disks are those at the step's time, not their mean over it", "forces",
            (LOADS, "share_of_kick", "float(max(min(time[1], last) - max(time[0], first), 0.0) / (last - first))",
             "1.0 if time[0] <= n * dt < time[1] else 0.0")),
    _kernel("rolling-uncapped", "rolling springs at walls never yield", "resist-spring",
            (FORCES, "wall_bending", "min(max(before + law[KR] * (slip_dt * turn), -limit), limit)",
             "before + law[KR] * (slip_dt * turn)")),
)  # fmt: skip

LISTS = (
    _kernel("skin-too-generous", "disks may move twenty times as far as the skin allows before the lists are rebuilt", "hit-near",
            (STEP, "farthest_allowed", _LIMIT, f"20.0 * {_LIMIT}")),
    _kernel("wall-unnoticed", "the lists do not notice that a wall comes closer", "push-wall",
            (STEP, "farthest_allowed", _LIMIT, "0.5 * skin")),
)  # fmt: skip

SORT_ALL = (("dem.arrays", "", "SORT_FROM = 2_000", "SORT_FROM = 1"), ("dem.arrays", "", "STRIPES = 64", "STRIPES = 4"))
"""Have every scene's disks sorted and divided into a few stripes, as only scenes of thousands of disks are: right in themselves."""

STRIPED = (
    _kernel("border-unmoved", "disks on the borders of stripes are not moved", "stack",
            *SORT_ALL, (STEP, "advance", _BORDERS, "far += 0.0")),
    _kernel("border-early", "disks on the borders of stripes move before the stripe below has acted on them", "stack",
            *SORT_ALL, (STEP, "stripe_forces", "team.border[s] if parity == 0 else stripe[s]", "stripe[s]"),
            (STEP, "advance", _BORDERS, "far += 0.0")),
    _kernel("border-narrow", "the border of a stripe ends one disk too early", "stack",
            *SORT_ALL, (SEARCH, "divide", "cells.start[(row + 1) * nx]", "cells.start[row * nx]")),
    _kernel("load-of-a-stripe", "the first stripe's load on the walls is lost", "stack",
            *SORT_ALL, (STEP, "gather_loads", "range(walls.share.shape[0])", "range(1, walls.share.shape[0])")),
    _kernel("order-of-samples", "samples have the disks in the order of the cells", "reopen-far",
            *SORT_ALL, ("dem.plane.sample_kernels", "record", "disks.place[samples.chosen[c]]", "samples.chosen[c]")),
    _kernel("order-of-spins", "spins stay behind when disks are brought into the order of the cells", "reopen-far",
            *SORT_ALL, (SEARCH, "put_in_order", "permute(disks.omega, order, one)", "")),
    _kernel("order-of-history", "shear forces follow the rows of the lists instead of the disks", "shear-caps",
            *SORT_ALL, (SEARCH, "put_in_order", "permute_numbers(disks.listed, order, one)", "")),
)  # fmt: skip

CELLS = (
    _kernel("image-at-rest", "images do not move with the cell's edges", "cell-shear",
            (IMAGES, "gather_images", "scratch[VX + q] -= mx\nscratch[VY + q] -= my", "")),
    _kernel("half-branch", "the stress has half of each contact's branch", "cell-press",
            (IMAGES, "gather_images", "bx, by, bx, by", "bx, by, 0.5 * bx, 0.5 * by")),
    _kernel("wrong-image", "pairs across the upper edge forget how far the cell leans", "cell-flow",
            (IMAGES, "build_image_pairs", "aside + home[i, 0] - home[j, 0] - tilt * across", "aside + home[i, 0] - home[j, 0]")),
    _kernel("history-of-another-image", "shear forces are lost when the lists of a cell are rebuilt", "cell-seen",
            (IMAGES, "build_image_pairs", "carried(old, images.shift, int(listed[i]), int(listed[j]), along, across)",
             "0.0 * carried(old, images.shift, int(listed[i]), int(listed[j]), along, across)")),
    _kernel("cell-late", "images are where the edges were a step before", "cell-press",
            (STEP, "advance", "if images is not None:\n    place_cell(images, n * step.kick.dt)",
             "if images is not None:\n    place_cell(images, (n - 1) * step.kick.dt)")),
    _kernel("no-work-of-the-cell", "the work of the cell has the last step's power alone", "cell-smooth",
            (IMAGES, "gather_shares", "images.work[0] += 0.5 * dt * (images.load[POWER] + before)",
             "images.work[0] = 0.5 * dt * (images.load[POWER] + before)")),
    _kernel("drift-beside-no-flow", "the lists do not notice that the cell deforms", "cell-flow",
            (STEP, "farthest_allowed", "displacement_limit(images, skin, widest)", "20.0 * skin")),
)  # fmt: skip

HOLES = tuple(
    replace(defect, hole=reason)
    for reason, defect in (
        (
            "no case has positions that stop being finite, and the session, which looks for them once more, says so a little later",
            _kernel("nan-forgotten", "a displacement that is not finite does not rebuild the lists", "hit",
                    (KICK, "farther", "d2 > far or d2 != d2", "d2 > far")),
        ),
    )
)  # fmt: skip

DEFECTS = (*CONTACTS, *STEPPING, *REOPENED, *RETRACED, *OPTIONS, *LISTS, *STRIPED, *CELLS, *HOLES)
