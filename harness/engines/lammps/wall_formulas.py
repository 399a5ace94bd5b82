"""Motion of planes as formulas of LAMMPS; see `WallMotion` of the plane's driver, whose derivation holds in space for one axis."""

import math

import numpy as np
from driver_parts import number


class PlaneMotion:
    """Displacement and angle of one plane as texts of LAMMPS formulas in the time ``v_t``.

    Attributes
    ----------
    axis, pivot : arrays, shape (3,)
        Unit vector of the axis that the plane turns about, and the point P of it [m]; no matter where it does not turn.
    formulas : tuple of four str
        Displacement x, y, z [m] and angle [rad].
    """

    def __init__(self, wall):
        motion = [
            {key: float(value) if key == "duration" else value for key, value in segment.items()}
            for segment in wall["motion"]
        ]
        spins = [np.array(segment["angular_velocity"]) for segment in motion]
        turning = [spin for spin in spins if spin.any()]
        self.turns = bool(turning)
        self.moves = self.turns or any(any(segment["velocity"]) or any(segment["amplitude"]) for segment in motion)
        self.axis = turning[0] / np.linalg.norm(turning[0]) if turning else np.array([0.0, 0.0, 1.0])
        point = np.array(wall["point"])
        self.pivot = self._fixed_point(motion, point)
        self.formulas = self._formulas(motion, point)

    def _fixed_point(self, motion, point):
        """``P``: where the first pivot of a rotation was at time 0."""
        away = np.zeros(3)
        for segment in motion:
            if any(segment["angular_velocity"]):
                return np.array(segment["pivot"]) - away if segment["pivot"] else point
            if math.isinf(segment["duration"]):
                break
            away = away + _displacement(segment, segment["duration"])
        return point

    def _turned(self, vector, angle):
        """A vector as it is after a rotation about the axis [rad]."""
        along = (vector @ self.axis) * self.axis
        across = vector - along
        return along + math.cos(angle) * across + math.sin(angle) * np.cross(self.axis, across)

    def _formulas(self, motion, point):
        pivot, begin, place, angle, pieces = self.pivot, 0.0, self.pivot, 0.0, []
        for segment in motion:
            rate = float(np.array(segment["angular_velocity"]) @ self.axis)
            own = place + self._turned(point - pivot, angle)
            centre = np.array(segment["pivot"]) if segment["pivot"] else own
            arm, tau = place - centre, f"(v_t-{number(begin)})"
            texts = []
            along = (arm @ self.axis) * self.axis
            across, sideways = arm - along, np.cross(self.axis, arm)
            for k in range(3):
                terms = [_term(place[k] - pivot[k]), _displacement_text(segment, k, tau)]
                if rate and np.abs(across).max() > 1e-12 * (np.abs(pivot).max() + np.abs(centre).max()):
                    turn = f"({_term(rate)}*{tau})"
                    terms += [f"{_term(across[k])}*(cos{turn}-1.0)", f"{_term(sideways[k])}*sin{turn}"]
                texts.append("+".join(terms))
            end = begin + segment["duration"]
            pieces.append((end, (*texts, f"{_term(angle)}+{_term(rate)}*{tau}")))
            if math.isinf(end):
                break
            length = segment["duration"]
            place = centre + self._turned(arm, rate * length) + _displacement(segment, length)
            begin, angle = end, angle + rate * length
        else:
            pieces.append((math.inf, tuple(map(_term, (*(place - pivot), angle)))))
        found = pieces[-1][1]
        for end, piece in reversed(pieces[:-1]):
            found = tuple(
                f"ternary(v_t<{number(end)},{now},{later})" for now, later in zip(piece, found, strict=True)
            )
        return found


def _displacement(segment, tau):
    """Displacement [m] of a segment's pivot ``tau`` seconds after its beginning."""
    wave = math.sin(segment["frequency"] * tau + segment["phase"]) - math.sin(segment["phase"])
    return tau * np.array(segment["velocity"]) + wave * np.array(segment["amplitude"])


def _displacement_text(segment, axis, tau):
    """Formula of `_displacement` along one axis."""
    text = f"{_term(segment['velocity'][axis])}*{tau}"
    if segment["amplitude"][axis]:
        phase = segment["phase"]
        wave = f"sin({_term(segment['frequency'])}*{tau}+{_term(phase)})-{_term(math.sin(phase))}"
        text += f"+{_term(segment['amplitude'][axis])}*({wave})"
    return text


def _term(value):
    """`number` for use within a formula, in parentheses where it has a sign."""
    text = number(value)
    return f"({text})" if text.startswith("-") else text
