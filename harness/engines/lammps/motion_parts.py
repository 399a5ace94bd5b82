"""Prescribed motion of LAMMPS' walls as formulas of the step; imported by the driver.

A region of LAMMPS turns about a fixed point ``P`` and is then displaced: a material point ``X`` is at ``P + R(theta)(X - P) + d``. Each
segment of a wall's motion turns about its own pivot; with ``B`` the place of ``P`` when the segment begins, ``c`` the pivot and ``u``
its displacement since then, ``d = c + u + R(rate tau)(B - c) - P``. ``P`` is chosen so that the first segment that turns has ``B = c``; its
translation is then all there is. In 3D a wall turns about one axis.
"""

import math

import numpy as np
from driver_parts import number


class WallMotion:
    """Displacement and angle of one wall as texts of LAMMPS formulas in the time ``v_t``; a subclass gives its dimension's.

    Attributes
    ----------
    point, normal : tuples
        Of the wall at time 0.
    turns, moves : bool
        Whether it turns; whether it turns or is displaced.
    pivot, axis : sequences
        ``P`` [m] and the unit vector about which the wall turns, three components; no matter where it does not turn.
    names : str
        Letters of the variables, of displacements and then of the angle.
    formulas : sequence of str
        Displacements [m] and angle [rad].
    """

    axis = np.array([0.0, 0.0, 1.0])

    def __init__(self, wall):
        self.point, self.normal = tuple(wall["point"]), tuple(wall["normal"])
        motion = [{**segment, "duration": float(segment["duration"])} for segment in wall["motion"]]
        self.turns = any(np.any(segment["angular_velocity"]) for segment in motion)
        self.moves = self.turns or any(_translates(segment) for segment in motion)
        self._set_pivot(motion)
        pieces = self._pieces(motion)  # (end, formulas)
        self.formulas = pieces[-1][1]
        for end, piece in reversed(pieces[:-1]):
            self.formulas = tuple(
                f"ternary(v_t<{term(end)},{now},{later})" for now, later in zip(piece, self.formulas, strict=True)
            )

    def _set_pivot(self, motion):
        """Set ``pivot``."""

    def _displacement_to_pivot(self, motion):
        """Displacement before the first rotation [m], and the segment that turns, None where there is none."""
        away = np.zeros(len(self.point))
        for segment in motion:
            if np.any(segment["angular_velocity"]):
                return away, segment
            if math.isinf(segment["duration"]):
                break
            away = away + _displacement(segment, segment["duration"])
        return away, None


class WallMotion2D(WallMotion):
    """`WallMotion` of a wall of 2D."""

    names = "xya"

    def _set_pivot(self, motion):
        away, turning = self._displacement_to_pivot(motion)
        self.pivot = self.point
        if turning is not None:
            x, y = away.tolist()
            cx, cy = turning["pivot"] or (self.point[0] + x, self.point[1] + y)
            self.pivot = cx - x, cy - y

    def _pieces(self, motion):
        px, py = self.pivot
        begin, bx, by, angle, pieces = 0.0, px, py, 0.0, []
        for segment in motion:
            cx, cy = segment["pivot"] or self.place(bx - px, by - py, angle)
            ax, ay, rate = bx - cx, by - cy, segment["angular_velocity"]
            tau = f"(v_t-{term(begin)})"
            ux, uy = (_displacement_text(segment, axis, tau) for axis in (0, 1))
            if rate and math.hypot(ax, ay) > 1e-12 * (math.hypot(px, py) + math.hypot(cx, cy)):
                turn = f"({term(rate)}*{tau})"
                x = f"{term(cx - px)}+{ux}+{term(ax)}*cos{turn}-{term(ay)}*sin{turn}"
                y = f"{term(cy - py)}+{uy}+{term(ax)}*sin{turn}+{term(ay)}*cos{turn}"
            else:
                x, y = f"{term(bx - px)}+{ux}", f"{term(by - py)}+{uy}"
            end = begin + segment["duration"]
            pieces.append((end, (x, y, f"{term(angle)}+{term(rate)}*{tau}")))
            if math.isinf(end):
                break
            dx, dy = _displacement(segment, end - begin).tolist()
            c, s = math.cos(rate * (end - begin)), math.sin(rate * (end - begin))
            bx, by = (cx + dx + c * ax - s * ay, cy + dy + s * ax + c * ay) if rate else (bx + dx, by + dy)
            begin, angle = end, angle + rate * (end - begin)
        else:
            pieces.append((math.inf, (term(bx - px), term(by - py), term(angle))))
        return pieces

    def place(self, dx, dy, angle):
        """Place of the wall's own point after a displacement [m] and a rotation [rad]."""
        ax, ay = self.point[0] - self.pivot[0], self.point[1] - self.pivot[1]
        if angle:
            c, s = math.cos(angle), math.sin(angle)
            ax, ay = c * ax - s * ay, s * ax + c * ay
        return self.pivot[0] + dx + ax, self.pivot[1] + dy + ay

    def turned_normal(self, angle):
        """The wall's normal after a rotation [rad]."""
        if not angle:
            return self.normal
        c, s, (nx, ny) = math.cos(angle), math.sin(angle), self.normal
        return c * nx - s * ny, s * nx + c * ny


class WallMotion3D(WallMotion):
    """`WallMotion` of a wall of 3D."""

    names = "xyza"

    def _set_pivot(self, motion):
        point = np.array(self.point)
        away, turning = self._displacement_to_pivot(motion)
        self.pivot = point
        if turning is not None:
            spin = np.array(turning["angular_velocity"])
            self.axis = spin / np.linalg.norm(spin)
            self.pivot = np.array(turning["pivot"]) - away if turning["pivot"] else point

    def _turned(self, vector, angle):
        """A vector as it is after a rotation about the axis [rad]."""
        along = (vector @ self.axis) * self.axis
        across = vector - along
        return along + math.cos(angle) * across + math.sin(angle) * np.cross(self.axis, across)

    def _pieces(self, motion):
        point, axis = np.array(self.point), self.axis
        pivot, begin, place, angle, pieces = self.pivot, 0.0, self.pivot, 0.0, []
        for segment in motion:
            rate = float(np.array(segment["angular_velocity"]) @ axis)
            own = place + self._turned(point - pivot, angle)
            centre = np.array(segment["pivot"]) if segment["pivot"] else own
            arm, tau = place - centre, f"(v_t-{term(begin)})"
            texts = []
            along = (arm @ axis) * axis
            across, sideways = arm - along, np.cross(axis, arm)
            for k in range(3):
                terms = [term(place[k] - pivot[k]), _displacement_text(segment, k, tau)]
                if rate and np.abs(across).max() > 1e-12 * (np.abs(pivot).max() + np.abs(centre).max()):
                    turn = f"({term(rate)}*{tau})"
                    terms += [f"{term(across[k])}*(cos{turn}-1.0)", f"{term(sideways[k])}*sin{turn}"]
                texts.append("+".join(terms))
            end = begin + segment["duration"]
            pieces.append((end, (*texts, f"{term(angle)}+{term(rate)}*{tau}")))
            if math.isinf(end):
                break
            length = segment["duration"]
            place = centre + self._turned(arm, rate * length) + _displacement(segment, length)
            begin, angle = end, angle + rate * length
        else:
            pieces.append((math.inf, tuple(map(term, (*(place - pivot), angle)))))
        return pieces


MOTIONS = {2: WallMotion2D, 3: WallMotion3D}


def term(value):
    """`number` for use within a formula, in parentheses where it has a sign."""
    text = number(value)
    return f"({text})" if text.startswith("-") else text


def _translates(segment):
    wave = any(segment["amplitude"]) and segment["frequency"]
    ramp = any(segment.get("tan_lever", ())) and segment["tan_rate"]
    return bool(any(segment["velocity"]) or wave or ramp)


def _displacement(segment, tau):
    """Displacement [m] of a segment's pivot ``tau`` seconds after its beginning."""
    wave = math.sin(segment["frequency"] * tau + segment["phase"]) - math.sin(segment["phase"])
    found = tau * np.array(segment["velocity"]) + wave * np.array(segment["amplitude"])
    if "tan_lever" in segment:
        found = found + math.tan(segment["tan_rate"] * tau) * np.array(segment["tan_lever"])
    return found


def _displacement_text(segment, axis, tau):
    """Formula of `_displacement` along one axis."""
    terms = [f"{term(segment['velocity'][axis])}*{tau}"]
    if segment["amplitude"][axis]:
        phase = segment["phase"]
        wave = f"sin({term(segment['frequency'])}*{tau}+{term(phase)})-{term(math.sin(phase))}"
        terms.append(f"{term(segment['amplitude'][axis])}*({wave})")
    if "tan_lever" in segment and segment["tan_lever"][axis] and segment["tan_rate"]:
        terms.append(f"{term(segment['tan_lever'][axis])}*tan({term(segment['tan_rate'])}*{tau})")
    return "+".join(terms)
