"""Defects planted in the sources of contact dynamics."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from ninedisk.harness.selftest.defect import planted

CONTACT, STEP = "cd.problem_kernels", "cd.step"
SHARED, BATCH = "cd.contact_kernels", "cd.batch_kernels"
"""What single steps and batches of steps share, and what is the batches' own."""


_kernel, _python = partial(planted, "cd", "kernel"), partial(planted, "cd", "python")

_OPENING = "room = 0.0 if touching else gap[k]"

STEPS = (
    _kernel("reaction", "the reaction on the second disk is a millionth too large", "hit",
            (CONTACT, "out[j, 0] -= weight[j, 0] * fx", "out[j, 0] -= 1.000001 * weight[j, 0] * fx")),
    _kernel("torque-one-body", "the second disk of a contact receives no torque", "press-rough",
            (CONTACT, "out[j, 2] += weight[j, 2] * (arms[k, 1] * p + arms[k, 3] * q)",
             "out[j, 2] += 0.0 * weight[j, 2] * (arms[k, 1] * p + arms[k, 3] * q)")),
    _kernel("wall-turn", "walls turn the other way", "turn",
            ("scene.motion_kernels", "c, s = cos(motion.spin[k] * tau), sin(motion.spin[k] * tau)",
             "c, s = cos(motion.spin[k] * tau), -sin(motion.spin[k] * tau)")),
    _kernel("wall-late", "contacts see the walls where they were at the start of the step", "press",
            (SHARED, _OPENING, _OPENING.replace("gap[k]", "gap_before[k]"))),
    _kernel("wall-shift", "the tangential motion of walls is ignored", "shake",
            (SHARED, "shift[k] = -(mx * ny - my * nx)", "shift[k] = -0.0 * (mx * ny - my * nx)"),
            (SHARED, "middle = (dx[i, 0] - wx) * uy - (dx[i, 1] - wy) * ux", "middle = dx[i, 0] * uy - dx[i, 1] * ux")),
    _kernel("baumgarte", "a step closes a fifth of the gap only (Baumgarte)", "hit",
            (SHARED, _OPENING, _OPENING.replace("gap[k]", "0.2 * gap[k]"))),
    _kernel("theta-of-positions", "positions move with 1 - theta for theta", "slide",
            (SHARED, "rate = theta * v[i, d] + (1.0 - theta) * start.kept[i, d]",
             "rate = (1.0 - theta) * v[i, d] + theta * start.kept[i, d]")),
    _kernel("theta-impact", "the old velocity is left out of the impact condition", "hit",
            (SHARED, "(held_n / theta + (1.0 - theta) / theta * kept_n)", "(held_n / theta + 0.0 * kept_n)"),
            (SHARED, "(held_t / theta + (1.0 - theta) / theta * kept_t)", "(held_t / theta + 0.0 * kept_t)")),
    _kernel("damping-explicit", "global damping sees the old velocity", "press",
            (STEP, "bodies.mass * (1.0 / dt + theta * bodies.xi)", "bodies.mass * (1.0 / dt)"),
            (SHARED, "rate = 1.0 / dt - (1.0 - theta) * bodies.xi", "rate = 1.0 / dt - bodies.xi")),
    _kernel("compliance-series", "two springs in series stand for each contact", "press",
            (SHARED, "out[k, 0] = 1.0 / laws.kn[row[k]] / scale", "out[k, 0] = 2.0 / laws.kn[row[k]] / scale"),
            (SHARED, "out[k, 1] = 1.0 / laws.ks[row[k]] / scale", "out[k, 1] = 2.0 / laws.ks[row[k]] / scale")),
    _kernel("compliance-theta", "the compliance lacks theta", "press",
            (SHARED, "contact_compliances(frames.row, laws, theta * dt, compliance)",
             "contact_compliances(frames.row, laws, dt, compliance)")),
    _kernel("shear-memory", "elastic contacts forget their shear force", "press-rough",
            (STEP, "shear_0=forces[:, 1],\n            resolution=self._resolution,",
             "shear_0=0.0 * forces[:, 1],\n            resolution=self._resolution,"),
            (BATCH, "near.shear[k] = state.shear[at]", "near.shear[k] = 0.0 * state.shear[at]")),
    _python("turns-blocked-disks", "disks that cannot turn do", "stop",
            (STEP, "free = np.column_stack([~disks.held, disks.rotating])",
             "free = np.column_stack([~disks.held, np.ones_like(disks.rotating)])")),
    _python("moves-held-disks", "prescribed motions are ignored", "push",
            (STEP, "free = np.column_stack([~disks.held, disks.rotating])",
             "free = np.column_stack([np.ones_like(disks.held), disks.rotating])")),
    _kernel("lever-arm", "disks have half their lever arm at walls", "roll",
            (SHARED, "arms[k, 2] = radius[i] - shorter", "arms[k, 2] = 0.5 * radius[i] - shorter")),
    _kernel("spin-of-second", "the spin of the second disk enters with the wrong sign", "press-rough",
            (SHARED, "arms[k, 3] = radius[j] - shorter if j < n", "arms[k, 3] = shorter - radius[j] if j < n")),
    _kernel("restitution-twice", "Newton's restitution is applied twice", "hit-newton",
            (SHARED, "return e * before if", "return 2.0 * e * before if")),
    _kernel("restitution-threshold", "impacts slower than 2 m/s do not bounce", "hit-newton",
            (SHARED, "return e * before if", "return e * before * (before <= -2.0) if")),
    _kernel("normal-tilted", "the normal between disks is off by a hundredth of a radian", "hit",
            (SHARED, "normal[k, 0], normal[k, 1] = ax / distance, ay / distance",
             "normal[k, 0], normal[k, 1] = (ax - 0.01 * ay) / distance / sqrt(1.0001), (ay + 0.01 * ax) / distance / sqrt(1.0001)")),
    _kernel("gap-sign", "contacts see the gap with the wrong sign", "hit",
            (SHARED, "gap[k] = gap_before[k] = distance - (radius[i] + radius[j])",
             "gap[k] = gap_before[k] = radius[i] + radius[j] - distance")),
    _python("static-half", "static steps make half the prescribed displacement", "push",
            ("cd.session", "given = self.dt * np.column_stack([disks.v, disks.omega])",
             "given = 0.5 * self.dt * np.column_stack([disks.v, disks.omega])")),
    _python("static-balance", "static steps end with one part in a hundred unbalanced", "press-static",
            ("cd.step", "BALANCE = 1e-10", "BALANCE = 1e-2")),
    _kernel("dilation-search", "the search forgets that sliding contacts lift", "throw",
            (SHARED, "out[k] = gap[k] + un - dilation[row[k]] * abs(", "out[k] = gap[k] + un + dilation[row[k]] * abs(")),
    _kernel("batch-walls", "batches of steps measure wall motion from where the walls were before the first of them", "push-wall",
            (BATCH, "state.wall[w, d] = scratch.after[w, d]", "state.wall[w, d] += 0.0 * scratch.after[w, d]")),
    _kernel("batch-shear", "batches of steps start from relaxed shear springs", "press-rough",
            (BATCH, "near.shear[k] = state.shear[at]", "near.shear[k] = 0.0 * state.shear[at]")),
    _kernel("batch-list", "the list of pairs of batches of steps outlasts any motion", "hit",
            (BATCH, "for_disks <= near.reach[0] - 2.0 * moved and for_walls <= near.reach[1] - moved - turned",
             "for_disks <= near.reach[0] and for_walls <= near.reach[1]")),
    _kernel("parting-dead", "contacts that part are stopped dead where other impulses close them", "gas-newton",
            (SHARED, "if before < 0.0 else before", "if before < 0.0 else 0.0")),
    _kernel("dashpot-overlap", "dashpots forget the overlap at the start of the step", "push-wall",
            (SHARED, "room -= viscous / stiff * min(0.0, gap_before[k])", "room -= 0.0 * viscous * min(0.0, gap_before[k])")),
    _kernel("dashpot-of-one-mass", "dashpots see twice the reduced mass", "push-wall",
            (SHARED, "dashpot(laws.kn[law], laws.beta[law], inverse[i] + other) / dt",
             "dashpot(laws.kn[law], laws.beta[law], 0.5 * (inverse[i] + other)) / dt")),
    _kernel("friction-loss-of-all-slip", "the slip that shear springs give back counts as lost by friction", "budget",
            (SHARED, "losses[FRICTION] -= q * (slip + s_1 - s_0)", "losses[FRICTION] -= q * slip")),
    _kernel("impact-loss-at-the-end", "impacts lose the work of the velocity at the end of the step", "budget-rigid",
            (SHARED, "work_n = p * (given_n + 0.5 * dt * (n_0 + n_1))", "work_n = p * (given_n + dt * n_1)")),
    _python("materials-one-way", "a law of two materials holds in one order of the bodies alone", "materials",
            ("cd.laws", "table[number[one], number[other]] = table[number[other], number[one]] = row",
             "table[number[one], number[other]] = row")),
    _kernel("force-all-step", "a force that acts in a part of a step acts in all of it", "forces",
            (SHARED, "load[loads.disk[k], d] += share * loads.force[k, d]",
             "load[loads.disk[k], d] += (share > 0.0) * loads.force[k, d]")),
    _kernel("adhesion-of-open-contacts", "contacts attract that are not closed", "hang",
            (SHARED, "out[k] = adhesion[law] if frames.gap_before[k] <= touching else 0.0", "out[k] = adhesion[law]")),
    _python("cohesion-cone", "friction sees the force of spring and cohesion together", "cohesive-slide",
            ("cd.laws", "self.mu = np.where(stiffer > 1.0, self.mu * stiffer, self.mu)", "self.mu = 1.0 * self.mu")),
    _python("rest-forgotten", "bodies at rest take any solution of Coulomb's law", "pyramid",
            ("cd.solvers.coulomb", "if at_rest:", "if at_rest and not at_rest:")),
)  # fmt: skip

HOLES = tuple(
    replace(defect, hole=f"{reason}; tests of the core look there")
    for reason, defect in (
        (
            "where cases need polish, what is not exact makes the step fail",
            _python("polish-unchecked", "the polish takes whatever the statuses give", "stick-coulomb",
                    ("cd.solvers.polish", "return (inside, residuals) if residuals.reached(self.tolerance) else None",
                     "return (inside, residuals)")),
        ),
        (
            "no case throws a disk through a wall",
            _python("behind-walls", "disks may get behind walls", "throw",
                    ("cd.session", "if not height.min() > 0.0:", "if np.isnan(height.min()):")),
        ),
    )
)  # fmt: skip

DEFECTS = (*STEPS, *HOLES)
