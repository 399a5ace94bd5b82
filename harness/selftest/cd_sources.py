"""Defects planted in the sources of contact dynamics."""

from __future__ import annotations

from ninedisk.harness.selftest.defect import Defect, Kind
from ninedisk.harness.selftest.edits import Edit

CONTACT, STEP, FRAMES = "cd.contact_kernels", "cd.step", "cd.frames"


def _kernel(name: str, what: str, witness: str, *edits: tuple[str, str, str]) -> Defect:
    return _defect("kernel", name, what, witness, edits)


def _python(name: str, what: str, witness: str, *edits: tuple[str, str, str]) -> Defect:
    return _defect("python", name, what, witness, edits)


def _defect(kind: Kind, name: str, what: str, witness: str, edits: tuple[tuple[str, str, str], ...]) -> Defect:
    planted = tuple(Edit(*edit) for edit in edits)
    return Defect(name=name, engine="cd", kind=kind, what=what, witness=witness, edits=planted)


_OFFSET = "offset = np.column_stack([frames.gap, frames.shift]) / (theta * dt)"

DEFECTS = (
    _kernel("reaction", "the reaction on the second disk is a millionth too large", "hit",
            (CONTACT, "out[j, 0] -= weight[j, 0] * fx", "out[j, 0] -= 1.000001 * weight[j, 0] * fx")),
    _kernel("torque-one-body", "the second disk of a contact receives no torque", "shear-caps",
            (CONTACT, "out[j, 2] += weight[j, 2] * (arms[k, 1] * p + arms[k, 3] * q)",
             "out[j, 2] += 0.0 * weight[j, 2] * (arms[k, 1] * p + arms[k, 3] * q)")),
    _kernel("wall-turn", "walls turn the other way", "shear-caps",
            ("geometry.motion_kernels", "c, s = cos(motion.spin[k] * tau), sin(motion.spin[k] * tau)",
             "c, s = cos(motion.spin[k] * tau), -sin(motion.spin[k] * tau)")),
    _python("wall-late", "contacts see the walls where they were at the start of the step", "press",
            (STEP, _OFFSET, _OFFSET.replace("frames.gap,", "frames.gap_before,"))),
    _python("wall-shift", "the tangential motion of walls is ignored", "shear-caps",
            (FRAMES, "shift[wall] = -(moved", "shift[wall] = -0.0 * (moved")),
    _python("baumgarte", "a step closes a fifth of the gap only (Baumgarte)", "hit",
            (STEP, _OFFSET, _OFFSET.replace("[frames.gap,", "[0.2 * frames.gap,"))),
    _python("theta-of-positions", "positions move with 1 - theta for theta", "slide",
            (STEP, "free = theta * v + (1.0 - theta) * self._v0", "free = (1.0 - theta) * v + theta * self._v0")),
    _python("theta-impact", "the old velocity is left out of the impact condition", "hit",
            (STEP, "(1.0 - theta) / theta * before", "0.0 * (1.0 - theta) / theta * before")),
    _python("damping-explicit", "global damping sees the old velocity", "press",
            (STEP, "inertia = bodies.mass * (1.0 / dt + theta * bodies.xi)", "inertia = bodies.mass * (1.0 / dt)"),
            (STEP, "kept = bodies.mass * v0 * (1.0 / dt - (1.0 - theta) * bodies.xi)",
             "kept = bodies.mass * v0 * (1.0 / dt - bodies.xi)")),
    _python("compliance-series", "two springs in series stand for each contact", "press",
            (STEP, "np.column_stack([1.0 / laws.kn[row], 1.0 / shear])",
             "np.column_stack([2.0 / laws.kn[row], 2.0 / shear])")),
    _python("compliance-theta", "the compliance lacks theta", "press",
            (STEP, "compliance=compliances(frames, laws) / (theta * dt)", "compliance=compliances(frames, laws) / dt")),
    _python("shear-memory", "elastic contacts forget their shear force", "shear-caps",
            (STEP, "compliance=compliances(frames, laws) / (theta * dt),\n            shear_0=forces[:, 1],",
             "compliance=compliances(frames, laws) / (theta * dt),\n            shear_0=0.0 * forces[:, 1],")),
    _python("turns-blocked-disks", "disks that cannot turn do", "stop",
            (STEP, "free = np.column_stack([~disks.held, disks.rotating])",
             "free = np.column_stack([~disks.held, np.ones_like(disks.rotating)])")),
    _python("moves-held-disks", "prescribed motions are ignored", "push",
            (STEP, "free = np.column_stack([~disks.held, disks.rotating])",
             "free = np.column_stack([np.ones_like(disks.held), disks.rotating])")),
    _python("lever-arm", "disks have half their lever arm at walls", "roll",
            (FRAMES, "arms[:, 2] = radius[i] - shorter", "arms[:, 2] = 0.5 * radius[i] - shorter")),
    _python("spin-of-second", "the spin of the second disk enters with the wrong sign", "shear-caps",
            (FRAMES, "arms[~wall, 3] = radius[j[~wall]] - shorter[~wall]",
             "arms[~wall, 3] = shorter[~wall] - radius[j[~wall]]")),
    _python("restitution-twice", "Newton's restitution is applied twice", "hit-newton",
            (STEP, "wall[:, 0] += restitution * approach", "wall[:, 0] += 2.0 * restitution * approach")),
    _python("restitution-threshold", "impacts slower than 2 m/s do not bounce", "hit-newton",
            (STEP, "approach = np.minimum(0.0, wall[:, 0] + before[:, 0])",
             "approach = np.minimum(0.0, np.where(wall[:, 0] + before[:, 0] > -2.0, 0.0, wall[:, 0] + before[:, 0]))")),
    _python("normal-tilted", "the normal between disks is off by a hundredth of a radian", "hit",
            (FRAMES, "normal[~wall] = apart / distance[:, None]",
             "normal[~wall] = (apart + 0.01 * np.column_stack([-apart[:, 1], apart[:, 0]])) / (np.sqrt(1.0001) * distance[:, None])")),
    _python("gap-sign", "contacts see the gap with the wrong sign", "hit",
            (FRAMES, "gap[~wall] = gap_before[~wall] = distance - (radius[a] + radius[b])",
             "gap[~wall] = gap_before[~wall] = radius[a] + radius[b] - distance")),
    _python("static-half", "static steps make half the prescribed displacement", "push",
            ("cd.session", "given = self.dt * np.column_stack([disks.v, disks.omega])",
             "given = 0.5 * self.dt * np.column_stack([disks.v, disks.omega])")),
    _python("static-balance", "static steps end with one part in a hundred unbalanced", "press-static",
            ("cd.statics", "BALANCE = 1e-10", "BALANCE = 1e-2")),
    _python("dilation-search", "the search forgets that sliding contacts lift", "throw",
            ("cd.contact_set", "return frames.gap + u[:, 0] - rise", "return frames.gap + u[:, 0] + rise")),
)  # fmt: skip
