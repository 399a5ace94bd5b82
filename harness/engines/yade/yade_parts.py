"""Contact laws and walls as YADE has them; imported by the driver inside YADE."""

import math

import numpy as np
from yade import O, Vector3
from yade.minieigenHP import Quaternion
from yade.utils import box

DISK_MASK, WALL_MASK, WALLS_APART, INTEGRATED, NOBODY = 5, 3, 2, 4, 8
"""Disks and walls share bit 1 (they collide), walls share bit 2 (they do not, among themselves), disks have bit 4."""


class Stepper:
    """Steps of YADE with functions of ours among its engines.

    ``physics`` is called between collider and contact loop, ``loads`` after the loop. Where there is one, ``O.step()`` runs the engines
    before the collider only and the others are called: a `PyRunner` compiles its command in each step, which takes ten times as long as
    the step of a few bodies.
    """

    def __init__(self, first, collider, loop, physics=None, loads=None):
        self.collider, self.loop, self.physics, self.loads = collider, loop, physics, loads
        if physics is None and loads is None:
            O.engines, self.step = [*first, collider, loop], O.step
        else:
            O.engines = first

    def step(self):
        """One step, from forces and contacts of ``t_n`` to those of ``t_{n+1}``."""
        O.step()
        self.collider()
        if self.physics is not None:
            self.physics()
        self.loop()
        if self.loads is not None:
            self.loads()


class Law:
    """Contact law of one kind of pair, with a shear spring only where it can carry a force.

    Linear cohesion is a softer spring ``kn``; what friction and rolling see is ``repulsive`` times its force. ``stiff`` is the scene's kn.
    """

    def __init__(self, law):
        self.stiff, self.beta = law["kn"], law["beta"]
        self.rolling, self.twisting = law["rolling"], law["twisting"]
        self.kn = law["kn"] - law["cohesion"]
        self.repulsive = law["kn"] / self.kn
        # A contact without friction or without shear spring carries no shear force; ks > 0 keeps YADE's energy defined.
        self.mu = law["mu"] * self.repulsive if law["ks"] > 0.0 else 0.0
        self.ks = law["ks"] if self.mu > 0.0 else law["kn"]


class WallBox:
    """A wall as the face of a large fixed box, opposite the middle of the bodies.

    The box is turned from the nearest axis by the shortest way, so that a wall along an axis has no rotation at all and its face is exact
    to the last bit. A subclass gives `place`.
    """

    def __init__(self, row, middle, depth, size, material):
        self.middle, self.depth, dimension = middle, depth, len(middle)
        normal = row[dimension : 2 * dimension]
        axis = int(np.argmax(np.abs(normal)))
        self.facing = np.zeros(dimension)
        self.facing[axis] = math.copysign(1.0, normal[axis])
        extents = [*[size] * dimension, depth][:3]
        extents[axis] = depth
        body = box((0, 0, 0), extents, fixed=True, material=material)
        body.mask = WALL_MASK
        O.bodies.append(body)
        self.state = body.state
        self.initialise(row)
        self.place(row)


class WallBox2D(WallBox):
    """A wall of 2D: it turns about z."""

    def initialise(self, row):
        px, py, nx, ny = row[:4]
        self.along = float((self.middle - (px, py)) @ (-ny, nx))
        self.normal, self.still = None, False

    def place(self, row):
        """Put the face where ``row`` says (see ``wall_path``) and give the box its velocity there."""
        px, py, nx, ny, cx, cy, vx, vy, spin = row.tolist()
        state = self.state
        still = not (vx or vy or spin)
        if self.still and still:
            return
        x = px - ny * self.along - nx * self.depth
        y = py + nx * self.along - ny * self.depth
        state.pos = (x, y, 0.0)
        if self.normal != (nx, ny):
            self.normal = (nx, ny)
            bx, by = self.facing.tolist()
            state.ori = Quaternion(Vector3(0, 0, 1), math.atan2(bx * ny - by * nx, bx * nx + by * ny))
        self.still = still
        state.vel = (vx - spin * (y - cy), vy + spin * (x - cx), 0.0)
        state.angVel = (0.0, 0.0, spin)


class WallBox3D(WallBox):
    """A wall of 3D. Its box does not turn about its own normal: only its velocity has such a spin."""

    def initialise(self, row):  # noqa: ARG002
        self.placed = b""

    def place(self, row):
        """Put the face where ``row`` says (see ``plane_path``) and give the box its velocity there."""
        text = row.tobytes()
        if text == self.placed:  # nothing else moves a wall
            return
        self.placed = text
        point, normal, velocity, spin = row.reshape(4, 3)
        along = self.middle - point
        centre = point + (along - (along @ normal) * normal) - self.depth * normal
        state = self.state
        state.pos = Vector3(*centre)
        turned = (normal != self.facing).any()
        state.ori = Quaternion(*quaternion(self.facing, normal)) if turned else Quaternion(1, 0, 0, 0)
        state.vel = Vector3(*(velocity + np.cross(spin, centre - point)))
        state.angVel = Vector3(*spin)


BOXES = {2: WallBox2D, 3: WallBox3D}


def quaternion(one, two):
    """Unit quaternion (w, x, y, z) of the shortest rotation from one direction to another, less than half a turn away."""
    values = np.array([1.0 + one @ two, *np.cross(one, two)])
    return (values / np.linalg.norm(values)).tolist()
