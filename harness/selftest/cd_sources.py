"""Defects planted in the sources of contact dynamics."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from ninedisk.harness.selftest.defect import planted

CONTACT, STEP = "cd.problem_kernels", "cd.step"
SHARED, BATCH = "cd.contact_kernels", "cd.batch_kernels"
"""What single steps and batches of steps share, and what is the batches' own."""

_kernel, _python = partial(planted, "cd", "kernel"), partial(planted, "cd", "python")

IN_SPACE, ITS_CONTACTS, ITS_BODIES = "cd.space.step", "cd.space.contacts", "cd.space.bodies"

STEPS = (
    _kernel("reaction", "the reaction on the second disk is a millionth too large", "hit",
            (CONTACT, "add_contact_force", "out[j, 0] -= weight[j, 0] * fx", "out[j, 0] -= 1.000001 * weight[j, 0] * fx")),
    _kernel("torque-one-body", "the second disk of a contact receives no torque", "press-rough",
            (CONTACT, "add_contact_force", "weight[j, 2] * (arms[k, 1] * p + arms[k, 3] * q)",
             "0.0 * weight[j, 2] * (arms[k, 1] * p + arms[k, 3] * q)")),
    _kernel("wall-turn", "walls turn the other way", "turn",
            ("scene.motion_kernels", "pose_at", "sin(motion.spin[k] * tau)", "-sin(motion.spin[k] * tau)")),
    _kernel("wall-late", "contacts see the walls where they were at the start of the step", "press",
            (SHARED, "dynamic_terms", "0.0 if touching else gap[k]", "0.0 if touching else gap_before[k]")),
    _kernel("wall-shift", "the tangential motion of walls is ignored", "shake",
            (SHARED, "measure_frames", "-(mx * ny - my * nx)", "-0.0 * (mx * ny - my * nx)"),
            (SHARED, "carry_springs", "(dx[i, 0] - wx) * uy - (dx[i, 1] - wy) * ux", "dx[i, 0] * uy - dx[i, 1] * ux")),
    _kernel("baumgarte", "a step closes a fifth of the gap only (Baumgarte)", "hit",
            (SHARED, "dynamic_terms", "0.0 if touching else gap[k]", "0.0 if touching else 0.2 * gap[k]")),
    _kernel("theta-of-positions", "positions move with 1 - theta for theta", "slide",
            (SHARED, "step_displacements", "theta * v[i, d] + (1.0 - theta) * start.kept[i, d]",
             "(1.0 - theta) * v[i, d] + theta * start.kept[i, d]")),
    _kernel("theta-impact", "the old velocity is left out of the impact condition", "hit",
            (SHARED, "dynamic_terms", "held_n / theta + (1.0 - theta) / theta * kept_n", "held_n / theta + 0.0 * kept_n"),
            (SHARED, "dynamic_terms", "held_t / theta + (1.0 - theta) / theta * kept_t", "held_t / theta + 0.0 * kept_t")),
    _kernel("damping-explicit", "global damping sees the old velocity", "press",
            (STEP, "dynamic_mass", "1.0 / dt + theta * bodies.xi", "1.0 / dt"),
            (SHARED, "start_step", "(1.0 - theta) * bodies.xi", "bodies.xi")),
    _kernel("compliance-series", "two springs in series replace each contact", "press",
            (SHARED, "contact_compliances", "1.0 / laws.kn[row[k]]", "2.0 / laws.kn[row[k]]"),
            (SHARED, "contact_compliances", "1.0 / laws.ks[row[k]]", "2.0 / laws.ks[row[k]]")),
    _kernel("compliance-theta", "the compliance lacks theta", "press",
            (SHARED, "dynamic_terms", "contact_compliances(frames.row, laws, theta * dt, compliance)",
             "contact_compliances(frames.row, laws, dt, compliance)")),
    _kernel("shear-memory", "elastic contacts forget their shear force", "press-rough",
            (STEP, "DynamicStep.problem", "forces[:, 1]", "0.0 * forces[:, 1]"),
            (BATCH, "begin_set", "state.shear[at]", "0.0 * state.shear[at]")),
    _python("turns-blocked-disks", "disks that cannot turn do", "stop",
            (STEP, "bodies_of", "disks.rotating", "np.ones_like(disks.rotating)")),
    _python("moves-held-disks", "prescribed motions are ignored", "push",
            (STEP, "bodies_of", "[~disks.held, disks.rotating]", "[np.ones_like(disks.held), disks.rotating]")),
    _kernel("lever-arm", "disks have half their lever arm at walls", "roll",
            (SHARED, "measure_frames", "arms[k, 2] = radius[i] - shorter", "arms[k, 2] = 0.5 * radius[i] - shorter")),
    _kernel("spin-of-second", "the spin of the second disk enters with the wrong sign", "press-rough",
            (SHARED, "measure_frames", "radius[j] - shorter if j < n else 0.0", "shorter - radius[j] if j < n else 0.0")),
    _kernel("restitution-twice", "Newton's restitution is applied twice", "hit-newton",
            (SHARED, "newton_offset", "e * before if before < 0.0 else before", "2.0 * e * before if before < 0.0 else before")),
    _kernel("restitution-threshold", "impacts slower than 2 m/s do not bounce", "hit-newton",
            (SHARED, "newton_offset", "e * before if before < 0.0 else before",
             "e * before * (before <= -2.0) if before < 0.0 else before")),
    _kernel("normal-tilted", "the normal between disks is off by a hundredth of a radian", "hit",
            (SHARED, "measure_frames", "ax / distance, ay / distance",
             "(ax - 0.01 * ay) / distance / sqrt(1.0001), (ay + 0.01 * ax) / distance / sqrt(1.0001)")),
    _kernel("gap-sign", "contacts see the gap with the wrong sign", "hit",
            (SHARED, "measure_frames", "distance - (radius[i] + radius[j])", "radius[i] + radius[j] - distance")),
    _python("static-half", "static steps make half the prescribed displacement", "push",
            ("cd.session", "CdSession._static_step", "self.dt * np.column_stack([disks.v, disks.omega])",
             "0.5 * self.dt * np.column_stack([disks.v, disks.omega])")),
    _python("static-balance", "static steps end with one part in a hundred unbalanced", "press-static",
            ("cd.step", "", "BALANCE = 1e-10", "BALANCE = 1e-2")),
    _kernel("dilation-search", "the search forgets that sliding contacts lift", "throw",
            (SHARED, "closing_gaps", "gap[k] + un - dilation[row[k]] * abs(shift[k] + ut)",
             "gap[k] + un + dilation[row[k]] * abs(shift[k] + ut)")),
    _kernel("batch-walls", "batches of steps measure wall motion from where the walls were before the first of them", "push-wall",
            (BATCH, "_accept", "state.wall[w, d] = scratch.after[w, d]", "state.wall[w, d] += 0.0 * scratch.after[w, d]")),
    _kernel("batch-shear", "batches of steps start from relaxed shear springs", "press-rough",
            (BATCH, "begin_set", "state.shear[at]", "0.0 * state.shear[at]")),
    _kernel("batch-list", "the list of pairs of batches of steps outlasts any motion", "hit",
            (BATCH, "covers", "for_disks <= near.reach[0] - 2.0 * moved and for_walls <= near.reach[1] - moved - turned",
             "for_disks <= near.reach[0] and for_walls <= near.reach[1]")),
    _kernel("parting-dead", "contacts that part are stopped dead where other impulses close them", "gas-newton",
            (SHARED, "newton_offset", "e * before if before < 0.0 else before", "e * before if before < 0.0 else 0.0")),
    _kernel("dashpot-overlap", "dashpots forget the overlap at the start of the step", "push-wall",
            (SHARED, "dynamic_terms", "viscous / stiff * min(0.0, gap_before[k])", "0.0 * viscous * min(0.0, gap_before[k])")),
    _kernel("dashpot-of-one-mass", "dashpots see twice the reduced mass", "push-wall",
            (SHARED, "damping_of_step", "inverse[i] + other", "0.5 * (inverse[i] + other)")),
    _kernel("friction-loss-of-all-slip", "the slip that shear springs give back counts as lost by friction", "budget",
            (SHARED, "note_losses", "losses[FRICTION] -= q * (slip + s_1 - s_0)", "losses[FRICTION] -= q * slip")),
    _kernel("impact-loss-at-the-end", "impacts lose the work of the velocity at the end of the step", "budget-rigid",
            (SHARED, "note_losses", "0.5 * dt * (n_0 + n_1)", "dt * n_1")),
    _python("materials-one-way", "a law of two materials holds in one order of the bodies alone", "materials",
            ("cd.laws", "rows_of_materials", "table[number[one], number[other]] = table[number[other], number[one]] = row",
             "table[number[one], number[other]] = row")),
    _kernel("force-all-step", "a force that acts in a part of a step acts in all of it", "forces",
            (SHARED, "place_loads", "share * loads.force[k, d]", "(share > 0.0) * loads.force[k, d]")),
    _kernel("adhesion-of-open-contacts", "contacts attract that are not closed", "hang",
            (SHARED, "pulls_of_step", "adhesion[law] if frames.gap_before[k] <= touching else 0.0", "adhesion[law]")),
    _python("cohesion-cone", "friction sees the force of spring and cohesion together", "cohesive-slide",
            ("cd.laws", "LawTable.__init__", "np.where(stiffer > 1.0, self.mu * stiffer, self.mu)", "1.0 * self.mu")),
    _python("rest-forgotten", "bodies at rest take any solution of Coulomb's law", "pyramid",
            ("cd.solvers.coulomb", "CoulombSearch.solve", "if at_rest:\n    found = self.swept(0) or self.equilibrium()",
             "if at_rest and not at_rest:\n    found = self.swept(0) or self.equilibrium()")),
)  # fmt: skip

HOLES = tuple(
    replace(defect, hole=f"{reason}; tests of the core look there")
    for reason, defect in (
        (
            "where cases need polish, what is not exact makes the step fail",
            _python("polish-unchecked", "the polish takes whatever the statuses give", "stick-coulomb",
                    ("cd.solvers.polish", "Polish.judged", "(inside, residuals) if residuals.reached(self.tolerance) else None",
                     "(inside, residuals)")),
        ),
        (
            "no case throws a disk through a wall",
            _python("behind-walls", "disks may get behind walls", "throw",
                    ("cd.session", "CdSession._check_walls", "not height.min() > 0.0", "np.isnan(height.min())")),
        ),
    )
)  # fmt: skip

SPACE = (
    _python("space-arm", "torques of contacts in space have the wrong sign", "box-tips",
            (ITS_CONTACTS, "ContactSearch._frames", "motion[:, 0, a, 3:] = sign * np.cross(first, axes[:, a])",
             "motion[:, 0, a, 3:] = -sign * np.cross(first, axes[:, a])")),
    _python("space-no-torque", "contact forces in space have no torque", "ball-rolls",
            (IN_SPACE, "ContactStep.solve", "impulse[:, 3:]", "0.0 * impulse[:, 3:]")),
    _python("space-not-turned", "bodies in space keep their orientation", "box-turns",
            (ITS_BODIES, "FreeStep.end", "product(exponential(turned), state.quaternion)", "state.quaternion")),
    _python("space-friction", "friction in space is a thousandth too small", "box-slides",
            (IN_SPACE, "ContactStep.solve", "DelassusProblem(w=self._with_stiff_tangents(w, b), b=b, mu=self._laws.mu[frames.row])",
             "DelassusProblem(w=self._with_stiff_tangents(w, b), b=b, mu=0.999 * self._laws.mu[frames.row])")),
    _python("space-restitution", "impacts in space return a thousandth less", "ball-bounces",
            (IN_SPACE, "ContactStep.velocities_without", "np.where(newton, e, 0.0) * before", "0.999 * np.where(newton, e, 0.0) * before")),
    _python("space-wall-turn", "walls in space that turn carry nothing along", "ball-on-table",
            (IN_SPACE, "ContactStep.velocities_without", "(frames.shift / dt + end[:, 1:])[newton]", "end[:, 1:][newton]")),
)  # fmt: skip
"""Of scenes in space."""

DEFECTS = (*STEPS, *SPACE, *HOLES)
