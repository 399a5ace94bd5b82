"""The scene: disks, half-plane walls and their motion, contact laws, gravity and damping.

A `Scene` says what is simulated; `ninedisk.core.numerics.Numerics` says how. Both are plain
frozen data that serialise to JSON, which is also the wire format to external engines.

Bodies are numbered: disks ``0 .. n-1``, walls ``n .. n+m-1``. A pair is ``(i, j)`` with ``i < j``.

Conventions (see ``docs/notation.md``)
--------------------------------------
- ``n`` is the unit normal from body ``i`` to body ``j``; ``t = (-n_y, n_x)``.
- the force of the contact on body ``i`` is ``-fn n + fs t``; ``fn >= 0`` is compression.
- ``gap`` is positive when open; ``overlap = -gap``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.core.errors import InvalidSceneError

FloatArray = NDArray[np.float64]
LeverArm = Literal["radius", "overlap"]
WallVelocityAt = Literal["surface", "mid-overlap"]

LEVER_ARMS: tuple[LeverArm, ...] = ("radius", "overlap")
WALL_VELOCITY_AT: tuple[WallVelocityAt, ...] = ("surface", "mid-overlap")


def _finite(name: str, value: ArrayLike, shape: tuple[int, ...]) -> FloatArray:
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidSceneError(f"{name} must be numbers, not {value!r}") from error
    if array.shape != shape:
        raise InvalidSceneError(f"{name} has shape {array.shape}; it must have shape {shape}")
    if not np.all(np.isfinite(array)):
        raise InvalidSceneError(f"{name} must be finite; it holds {array[~np.isfinite(array)][0]}")
    array.setflags(write=False)
    return array


def _at_least(name: str, value: float, low: float, *, strict: bool = False) -> None:
    bad = not np.isfinite(value) or (value <= low if strict else value < low)
    if bad:
        sign = ">" if strict else ">="
        raise InvalidSceneError(f"{name} = {value!r} is not allowed: it must be finite and {sign} {low:g}")


@dataclass(frozen=True, kw_only=True)
class ContactLaw:
    """Linear contact: normal spring, incremental shear spring, Coulomb cap, dashpot, impact law.

    Parameters
    ----------
    kn : float
        Normal contact stiffness [N/m], > 0.
    ks : float
        Shear contact stiffness [N/m], >= 0.
    mu : float
        Coulomb friction coefficient [-], >= 0; 0 means a smooth contact.
    beta : float
        Contact damping ratio [-], >= 0; the dashpot is ``c = 2 beta sqrt(m_eff kn)``.
    restitution : float or None
        Coefficient of restitution [-] in [0, 1] for engines that have an impact law.
        None: the scene prescribes none.
    lever_arm : {"radius", "overlap"}
        Arm of the shear torque: R (Cundall & Strack 1979) or R - overlap/2.
    wall_velocity_at : {"surface", "mid-overlap"}
        Point at which a wall's velocity enters the slip: on the wall's surface or in the middle
        of the overlap (no effect on disk-disk contacts, nor on walls that do not rotate).
    regularised : bool
        True if ``kn, ks, beta`` only regularise a contact that is meant to be rigid, so that an
        engine with rigid contacts and an impact law expresses the same physics.

    Raises
    ------
    InvalidSceneError
        If a value is outside its range.
    """

    kn: float
    ks: float = 0.0
    mu: float = 0.0
    beta: float = 0.0
    restitution: float | None = None
    lever_arm: LeverArm = "radius"
    wall_velocity_at: WallVelocityAt = "surface"
    regularised: bool = False

    def __post_init__(self) -> None:
        _at_least("kn", self.kn, 0.0, strict=True)
        _at_least("ks", self.ks, 0.0)
        _at_least("mu", self.mu, 0.0)
        _at_least("beta", self.beta, 0.0)
        if self.restitution is not None and not 0.0 <= self.restitution <= 1.0:
            raise InvalidSceneError(f"restitution = {self.restitution!r} is not allowed: it must lie in [0, 1]")
        if self.lever_arm not in LEVER_ARMS:
            raise InvalidSceneError(f"lever_arm = {self.lever_arm!r} is unknown: use one of {', '.join(LEVER_ARMS)}")
        if self.wall_velocity_at not in WALL_VELOCITY_AT:
            raise InvalidSceneError(
                f"wall_velocity_at = {self.wall_velocity_at!r} is unknown: use one of {', '.join(WALL_VELOCITY_AT)}"
            )


@dataclass(frozen=True, kw_only=True)
class Disks:
    """Rigid disks as a structure of arrays (copied and made read-only).

    Parameters
    ----------
    x : array_like, shape (n, 2)
        Centres [m].
    radius, mass : array_like, shape (n,) or scalar
        Radii [m] and masses [kg], > 0.
    inertia : array_like, shape (n,), scalar or None
        Moments of inertia [kg m^2], > 0; None means uniform disks, ``m R^2 / 2``.
    v : array_like, shape (n, 2), optional
        Velocities [m/s] at time 0.
    omega : array_like, shape (n,), optional
        Spins [rad/s] at time 0, counter-clockwise positive.
    rotating : array_like of bool, shape (n,) or scalar
        False: the disk keeps its spin whatever torque acts (a block in the shape of a disk).

    Raises
    ------
    InvalidSceneError
        If a shape or value is not allowed.
    """

    x: FloatArray
    radius: FloatArray
    mass: FloatArray
    inertia: FloatArray = None  # type: ignore[assignment]
    v: FloatArray = None  # type: ignore[assignment]
    omega: FloatArray = None  # type: ignore[assignment]
    rotating: NDArray[np.bool_] = True  # type: ignore[assignment]

    def __post_init__(self) -> None:
        x = np.asarray(self.x, dtype=np.float64)
        if x.ndim != 2 or x.shape[1] != 2:
            raise InvalidSceneError(f"disks.x has shape {x.shape}; it must have shape (n, 2)")
        n = x.shape[0]

        def column(name: str, value: ArrayLike, default: ArrayLike | None = None) -> FloatArray:
            given = default if value is None else value
            array = np.asarray(given, dtype=np.float64)
            return _finite(f"disks.{name}", np.full(n, array) if array.ndim == 0 else array, (n,))

        radius, mass = column("radius", self.radius), column("mass", self.mass)
        inertia = column("inertia", self.inertia, 0.5 * mass * radius**2)
        for name, array in (("radius", radius), ("mass", mass), ("inertia", inertia)):
            if n and array.min() <= 0.0:
                i = int(np.argmin(array))
                raise InvalidSceneError(f"disks.{name}[{i}] = {array[i]:g} is not allowed: it must be > 0")
        rotating = np.array(np.broadcast_to(np.asarray(self.rotating, dtype=np.bool_), (n,)))
        rotating.setflags(write=False)
        zeros = np.zeros((n, 2))
        object.__setattr__(self, "x", _finite("disks.x", x, (n, 2)))
        object.__setattr__(self, "v", _finite("disks.v", zeros if self.v is None else self.v, (n, 2)))
        object.__setattr__(self, "omega", column("omega", self.omega, 0.0))
        object.__setattr__(self, "radius", radius)
        object.__setattr__(self, "mass", mass)
        object.__setattr__(self, "inertia", inertia)
        object.__setattr__(self, "rotating", rotating)

    def __len__(self) -> int:
        return int(self.x.shape[0])


@dataclass(frozen=True, kw_only=True)
class WallSegment:
    """One piece of a wall's prescribed motion, exact in time.

    With ``tau`` the time since the segment began, the wall's pivot is displaced by

    ``velocity tau + amplitude (sin(frequency tau + phase) - sin(phase)) + tan_lever tan(tan_rate tau)``

    and the wall turns about that pivot by ``angular_velocity tau``. The last term is the exact motion of
    a cap that follows a side wall rotating at a constant rate.

    Parameters
    ----------
    duration : float
        Length of the segment [s], > 0; ``inf`` is allowed for the last one.
    velocity : (float, float)
        Translation velocity [m/s].
    angular_velocity : float
        Rotation rate [rad/s], counter-clockwise positive.
    pivot : (float, float) or None
        Centre of rotation [m] at the segment's beginning; None: the wall's own reference point.
    amplitude : (float, float)
        Amplitude of a harmonic translation [m].
    frequency, phase : float
        Angular frequency [rad/s] and phase [rad] of the harmonic translation.
    tan_lever : (float, float)
        Coefficient of the tangent term [m].
    tan_rate : float
        Rate of the tangent term [rad/s].
    """

    duration: float = float("inf")
    velocity: tuple[float, float] = (0.0, 0.0)
    angular_velocity: float = 0.0
    pivot: tuple[float, float] | None = None
    amplitude: tuple[float, float] = (0.0, 0.0)
    frequency: float = 0.0
    phase: float = 0.0
    tan_lever: tuple[float, float] = (0.0, 0.0)
    tan_rate: float = 0.0

    def __post_init__(self) -> None:
        if np.isnan(self.duration) or self.duration <= 0.0:
            raise InvalidSceneError(f"segment duration = {self.duration!r} is not allowed: it must be > 0")
        for name in ("velocity", "amplitude", "tan_lever"):
            array = _finite(f"segment {name}", getattr(self, name), (2,))
            object.__setattr__(self, name, (float(array[0]), float(array[1])))
        if self.pivot is not None:
            pivot = _finite("segment pivot", self.pivot, (2,))
            object.__setattr__(self, "pivot", (float(pivot[0]), float(pivot[1])))
        for name in ("angular_velocity", "frequency", "phase", "tan_rate"):
            _finite(f"segment {name}", getattr(self, name), ())
        if self.tan_rate and np.isfinite(self.duration) and abs(self.tan_rate * self.duration) >= np.pi / 2:
            raise InvalidSceneError(
                f"tan_rate * duration = {self.tan_rate * self.duration:g} is not allowed: it must stay below pi/2"
            )


@dataclass(frozen=True, kw_only=True)
class Wall:
    """A rigid half-plane with prescribed motion; disks live on the side its normal points to.

    Parameters
    ----------
    name : str
        Unique name, used in messages and figures.
    point : (float, float)
        A point of the surface [m] at time 0.
    normal : (float, float)
        Normal into the free side; normalised here.
    law : ContactLaw
        Contact of disks with this wall.
    motion : sequence of WallSegment
        Segments one after the other from time 0; the wall rests after the last one.
    """

    name: str
    point: tuple[float, float]
    normal: tuple[float, float]
    law: ContactLaw
    motion: tuple[WallSegment, ...] = ()

    def __post_init__(self) -> None:
        point = _finite(f"wall {self.name!r} point", self.point, (2,))
        normal = _finite(f"wall {self.name!r} normal", self.normal, (2,))
        length = float(np.hypot(normal[0], normal[1]))
        if length == 0.0:
            raise InvalidSceneError(f"wall {self.name!r} has a zero normal: give it a direction")
        motion = tuple(self.motion)
        for segment in motion[:-1]:
            if not np.isfinite(segment.duration):
                raise InvalidSceneError(
                    f"wall {self.name!r}: only the last segment may be endless, the others need a finite duration"
                )
        object.__setattr__(self, "point", (float(point[0]), float(point[1])))
        object.__setattr__(self, "normal", (float(normal[0] / length), float(normal[1] / length)))
        object.__setattr__(self, "motion", motion)


@dataclass(frozen=True, kw_only=True)
class Scene:
    """Everything that physics needs to know.

    Parameters
    ----------
    disks : Disks
    walls : sequence of Wall
    disk_disk : ContactLaw
        Law of every contact between two disks.
    gravity : (float, float)
        Acceleration [m/s^2].
    xi : float
        Global damping [1/s], >= 0: the equation of motion is ``m a + xi m v = F``, and likewise for spins.
    initial_shear : mapping from pair to float
        Shear forces ``fs`` [N] that contacts carry at time 0 (preload).

    Raises
    ------
    InvalidSceneError
        Naming the offending body, its value and the allowed range.
    """

    disks: Disks
    disk_disk: ContactLaw
    walls: tuple[Wall, ...] = ()
    gravity: tuple[float, float] = (0.0, 0.0)
    xi: float = 0.0
    initial_shear: Mapping[tuple[int, int], float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "walls", tuple(self.walls))
        gravity = _finite("gravity", self.gravity, (2,))
        object.__setattr__(self, "gravity", (float(gravity[0]), float(gravity[1])))
        _at_least("xi", self.xi, 0.0)
        names = [wall.name for wall in self.walls]
        if len(set(names)) != len(names):
            raise InvalidSceneError(f"wall names must be unique: {', '.join(names)}")
        self._check_walls()
        shear = {}
        for pair, force in dict(self.initial_shear).items():
            shear[self.check_pair(pair)] = float(_finite(f"initial shear of {pair}", force, ()))
        object.__setattr__(self, "initial_shear", shear)

    @property
    def n_bodies(self) -> int:
        """Number of disks and walls together."""
        return len(self.disks) + len(self.walls)

    def body_name(self, body: int) -> str:
        """Readable name of a body, for messages and figures."""
        n = len(self.disks)
        return f"disk {body}" if body < n else f"wall {self.walls[body - n].name!r}"

    def wall_index(self, name: str) -> int:
        """Body number of the wall called ``name``."""
        for k, wall in enumerate(self.walls):
            if wall.name == name:
                return len(self.disks) + k
        known = ", ".join(wall.name for wall in self.walls) or "none"
        raise InvalidSceneError(f"there is no wall {name!r}: the scene's walls are {known}")

    def check_pair(self, pair: Sequence[int]) -> tuple[int, int]:
        """Return ``pair`` as two body numbers in order, or raise `InvalidSceneError`."""
        if len(pair) != 2:
            raise InvalidSceneError(f"a pair is two body numbers, not {pair!r}")
        i, j = int(pair[0]), int(pair[1])
        if not (0 <= i < len(self.disks) and i < j < self.n_bodies):
            raise InvalidSceneError(
                f"pair {tuple(pair)} is not allowed: the first body is a disk (0..{len(self.disks) - 1}), the second a "
                f"later disk or a wall (up to {self.n_bodies - 1})"
            )
        return i, j

    def law(self, pair: tuple[int, int]) -> ContactLaw:
        """Contact law of a pair."""
        n = len(self.disks)
        return self.disk_disk if pair[1] < n else self.walls[pair[1] - n].law

    def _check_walls(self) -> None:
        for a, one in enumerate(self.walls):
            for two in self.walls[a + 1 :]:
                facing = one.normal[0] * two.normal[0] + one.normal[1] * two.normal[1]
                room = one.normal[0] * (two.point[0] - one.point[0]) + one.normal[1] * (two.point[1] - one.point[1])
                if facing <= -1.0 + 1e-12 and room <= 0.0:
                    raise InvalidSceneError(
                        f"walls {one.name!r} and {two.name!r} overlap: they face each other and the room between them is "
                        f"{room:g} m; it must be > 0 (move one of them or turn its normal)"
                    )
        x = self.disks.x
        for wall in self.walls:
            height = (x - np.array(wall.point)) @ np.array(wall.normal)
            if len(height) and height.min() <= 0.0:
                i = int(np.argmin(height))
                raise InvalidSceneError(
                    f"the centre of disk {i} lies {-height[i]:g} m behind wall {wall.name!r}: a centre must lie on the "
                    f"side that the wall's normal points to"
                )

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON; `from_dict` is its inverse, to the last bit."""
        disks = self.disks
        return {
            "disks": {
                "x": disks.x.tolist(),
                "v": disks.v.tolist(),
                "omega": disks.omega.tolist(),
                "radius": disks.radius.tolist(),
                "mass": disks.mass.tolist(),
                "inertia": disks.inertia.tolist(),
                "rotating": disks.rotating.tolist(),
            },
            "disk_disk": _plain(self.disk_disk),
            "walls": [
                {
                    "name": wall.name,
                    "point": list(wall.point),
                    "normal": list(wall.normal),
                    "law": _plain(wall.law),
                    "motion": [_plain(segment) for segment in wall.motion],
                }
                for wall in self.walls
            ],
            "gravity": list(self.gravity),
            "xi": self.xi,
            "initial_shear": [[i, j, force] for (i, j), force in self.initial_shear.items()],
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Scene:
        """Build a scene from `to_dict` data.

        Raises
        ------
        InvalidSceneError
            If a key is missing or unknown, or a value is not allowed.
        """
        try:
            walls = []
            for wall in data["walls"]:
                law = ContactLaw(**wall["law"])
                motion = tuple(
                    WallSegment(**{**seg, "duration": float(seg.get("duration", "inf"))}) for seg in wall["motion"]
                )
                walls.append(Wall(**{**wall, "law": law, "motion": motion}))
            scene = cls(
                disks=Disks(**data["disks"]),
                disk_disk=ContactLaw(**data["disk_disk"]),
                walls=tuple(walls),
                gravity=data["gravity"],
                xi=data["xi"],
                initial_shear={(i, j): force for i, j, force in data["initial_shear"]},
            )
        except KeyError as error:
            raise InvalidSceneError(f"the scene lacks the key {error.args[0]!r}") from error
        except (TypeError, AttributeError) as error:
            raise InvalidSceneError(f"the scene's data have the wrong form: {error}") from error
        unknown = set(data) - set(scene.to_dict())
        if unknown:
            raise InvalidSceneError(f"unknown key(s) in the scene: {', '.join(sorted(unknown))}")
        return scene

    def replace(self, **changes: Any) -> Scene:
        """Copy with some fields changed."""
        return replace(self, **changes)


def _plain(record: ContactLaw | WallSegment) -> dict[str, Any]:
    """Fields of a flat record as JSON data; an infinite duration becomes the string ``"inf"``."""
    plain: dict[str, Any] = {}
    for name, value in vars(record).items():
        if isinstance(value, tuple):
            plain[name] = list(value)
        elif isinstance(value, float) and np.isinf(value):
            plain[name] = "inf"
        else:
            plain[name] = value
    return plain
