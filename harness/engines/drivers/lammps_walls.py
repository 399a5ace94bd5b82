"""Prescribed wall motion as formulas of the step that LAMMPS evaluates itself.

A region of LAMMPS turns about a fixed point ``P`` and is then displaced: a material point ``X`` is at ``P + R(theta)(X - P) + d``.
Each segment of a wall's motion turns about a pivot of its own; with ``B`` the place of ``P`` when the segment begins, ``c`` the
pivot and ``u`` its displacement since then, ``d = c + u + R(rate tau)(B - c) - P``. ``P`` is chosen so that the first segment
that turns has ``B = c``; its translation is then all there is.
"""

import math


def number(value):
    """Shortest text that gives the same double back."""
    return repr(float(value))


def term(value):
    """`number` for use within a formula, in parentheses where it has a sign."""
    text = number(value)
    return f"({text})" if text.startswith("-") else text


class WallMotion:
    """Displacement and angle of one wall as texts of LAMMPS formulas in the time ``v_t``.

    Attributes
    ----------
    pivot : tuple of two floats
        ``P`` [m].
    formulas : tuple of three str
        Displacement x, y [m] and angle [rad].
    """

    def __init__(self, wall):
        self.point, self.normal = tuple(wall["point"]), tuple(wall["normal"])
        motion = [{**segment, "duration": float(segment["duration"])} for segment in wall["motion"]]
        self.turns = any(segment["angular_velocity"] for segment in motion)
        self.moves = self.turns or any(_translates(segment) for segment in motion)
        self.pivot = self._fixed_point(motion)
        self.formulas = self._formulas(motion)

    def _fixed_point(self, motion):
        """``P``: where the first pivot of a rotation was at time 0."""
        x, y = 0.0, 0.0
        for segment in motion:
            if segment["angular_velocity"]:
                cx, cy = segment["pivot"] or (self.point[0] + x, self.point[1] + y)
                return cx - x, cy - y
            if math.isinf(segment["duration"]):
                break
            dx, dy = _displacement(segment, segment["duration"])
            x, y = x + dx, y + dy
        return self.point

    def _formulas(self, motion):
        px, py = self.pivot
        begin, bx, by, angle = 0.0, px, py, 0.0
        pieces = []  # (end, x, y, angle)
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
            pieces.append((end, x, y, f"{term(angle)}+{term(rate)}*{tau}"))
            if math.isinf(end):
                break
            dx, dy = _displacement(segment, end - begin)
            c, s = math.cos(rate * (end - begin)), math.sin(rate * (end - begin))
            bx, by = (cx + dx + c * ax - s * ay, cy + dy + s * ax + c * ay) if rate else (bx + dx, by + dy)
            begin, angle = end, angle + rate * (end - begin)
        else:
            pieces.append((math.inf, term(bx - px), term(by - py), term(angle)))
        x, y, turned = pieces[-1][1:]
        for end, *piece in reversed(pieces[:-1]):
            x, y, turned = (
                f"ternary(v_t<{term(end)},{now},{later})" for now, later in zip(piece, (x, y, turned), strict=True)
            )
        return x, y, turned

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


def _translates(segment):
    wave = any(segment["amplitude"]) and segment["frequency"]
    ramp = any(segment["tan_lever"]) and segment["tan_rate"]
    return bool(any(segment["velocity"]) or wave or ramp)


def _displacement(segment, tau):
    """Displacement [m] of a segment's pivot ``tau`` seconds after its beginning."""
    wave = math.sin(segment["frequency"] * tau + segment["phase"]) - math.sin(segment["phase"])
    ramp = math.tan(segment["tan_rate"] * tau)
    return tuple(
        segment["velocity"][k] * tau + segment["amplitude"][k] * wave + segment["tan_lever"][k] * ramp for k in (0, 1)
    )


def _displacement_text(segment, axis, tau):
    """Formula of `_displacement` along one axis."""
    terms = [f"{term(segment['velocity'][axis])}*{tau}"]
    if segment["amplitude"][axis]:
        phase = segment["phase"]
        wave = f"sin({term(segment['frequency'])}*{tau}+{term(phase)})-{term(math.sin(phase))}"
        terms.append(f"{term(segment['amplitude'][axis])}*({wave})")
    if segment["tan_lever"][axis] and segment["tan_rate"]:
        terms.append(f"{term(segment['tan_lever'][axis])}*tan({term(segment['tan_rate'])}*{tau})")
    return "+".join(terms)
