"""How a scene is stepped, sampled and watched; shared by the DEM, the CD stepper and every external engine."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.errors import CoreError, InvalidNumericsError, InvalidSceneError
from ninedisk.core.history import Pair
from ninedisk.core.scene import Scene
from ninedisk.core.scene.base import AnyScene
from ninedisk.core.validate import at_least, body_numbers, flag, items_of, kind_of, one_of, short_repr, whole, within

DampingForm = Literal["central", "lagged"]
Impact = Literal["theta", "newton"]
Sliding = Literal["associated", "coulomb"]
Regime = Literal["dynamic", "quasi-static"]
_CHOICES = {
    "damping_form": ("central", "lagged"),
    "impact": ("theta", "newton"),
    "sliding": ("associated", "coulomb"),
    "regime": ("dynamic", "quasi-static"),
}

MOST_STEPS = 2**53
"""Steps of a run: beyond, doubles stop being whole numbers, and ``n dt`` is no time any more."""
MOST_SAMPLES = 10**8
"""Samples of a run: those of a single disk already fill gigabytes."""
MOST_SUBSTEPS = 1e15
"""Contact steps in one ``dt``, below where doubles stop being whole numbers; how many are run is limited elsewhere."""


@dataclass(frozen=True, kw_only=True)
class Numerics:
    """Time stepping and sampling.

    Parameters
    ----------
    dt : float
        Step of impulse and CD engines, and sampling interval of engines with contact springs [s], > 0.
    n_steps : int
        Number of steps ``dt``, >= 1.
    contact_dt : float or None
        Own step [s] of engines with contact springs; it must divide ``dt``. None: a fraction of the
        critical step that divides ``dt``.
    sample_every : int
        A sample each so many steps ``dt``.
    sample_from, sample_until : int, int or None
        Regular samples begin and end at these steps (None: at the last). Steps 0 and ``n_steps`` are always sampled.
    damping_form : {"central", "lagged"}
        Velocity that damping forces see: at ``t_n`` to second order, or ``v_{n-1/2}`` as an engine
        with a viscous force has it.
    theta : float
        Parameter of the theta scheme (contact dynamics), in [1/2, 1].
    impact : {"theta", "newton"}
        Impact law of contact dynamics: the theta scheme's own, or Newton's at velocity level.
    sliding : {"associated", "coulomb"}
        Sliding rule of contact dynamics.
    regime : {"dynamic", "quasi-static"}
        Motion with inertia, or a series of equilibria under prescribed motions (contact dynamics).
    solver : str
        Contact solver of contact dynamics; "auto" chooses by size and tolerance.
    allow_unstable : bool
        True: run although ``contact_dt`` exceeds the critical step.
    energy_budget : bool
        True: all channels of the energy are sampled (`History.energy`), not only those that the state reports.
    options : mapping
        Settings of one engine, named by that engine (e.g. ``{"pymunk.iterations": 100}``).

    Examples
    --------
    A second in 100 steps, each of 10 contact steps, sampled every half second:

    >>> numerics = Numerics(dt=0.01, n_steps=100, contact_dt=0.001, sample_every=50)
    >>> numerics.substeps(0.001), numerics.sampled_steps().tolist()
    (10, [0, 50, 100])
    """

    dt: float
    n_steps: int
    contact_dt: float | None = None
    sample_every: int = 1
    sample_from: int = 0
    sample_until: int | None = None
    damping_form: DampingForm = "central"
    theta: float = 1.0
    impact: Impact = "theta"
    sliding: Sliding = "associated"
    regime: Regime = "dynamic"
    solver: str = "auto"
    allow_unstable: bool = False
    energy_budget: bool = False
    options: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("dt", "contact_dt"):
            value = getattr(self, name)
            if value is None and name == "contact_dt":
                continue
            object.__setattr__(self, name, at_least(name, value, 0.0, strict=True, error=InvalidNumericsError))
        for name, low in (("n_steps", 1), ("sample_every", 1), ("sample_from", 0), ("sample_until", 0)):
            value = getattr(self, name)
            if value is None and name == "sample_until":
                continue
            object.__setattr__(self, name, whole(name, value, low, MOST_STEPS))
        object.__setattr__(self, "theta", within("theta", self.theta, 0.5, 1.0, error=InvalidNumericsError))
        for name in ("allow_unstable", "energy_budget"):
            object.__setattr__(self, name, flag(name, getattr(self, name), error=InvalidNumericsError))
        if not isinstance(self.solver, str):
            raise InvalidNumericsError(
                f"solver = {short_repr(self.solver)} is not allowed: it must be the name of a solver"
            )
        if not (isinstance(self.options, Mapping) and all(isinstance(name, str) for name in self.options)):
            raise InvalidNumericsError(
                f"options = {short_repr(self.options)} is not allowed: they must be a mapping from names to values"
            )
        object.__setattr__(self, "options", dict(self.options))  # a later change of the caller's is none of ours
        for name, choices in _CHOICES.items():
            one_of(name, getattr(self, name), choices, error=InvalidNumericsError)
        last = self.n_steps if self.sample_until is None else min(self.sample_until, self.n_steps)
        if (last - self.sample_from) // self.sample_every > MOST_SAMPLES:
            raise InvalidNumericsError(
                f"n_steps = {self.n_steps} with sample_every = {self.sample_every} is not allowed: a run has at most "
                f"{MOST_SAMPLES} samples; raise sample_every, or take fewer steps, of a larger dt"
            )
        if self.contact_dt is not None:
            self.substeps(self.contact_dt)

    def substeps(self, contact_dt: float) -> int:
        """Return the number of contact steps in one ``dt``.

        Raises
        ------
        InvalidNumericsError
            If ``contact_dt`` does not divide ``dt`` (relative tolerance 1e-9: the round-off of a decimal fraction).
        """
        ratio = self.dt / contact_dt
        if not ratio <= MOST_SUBSTEPS:
            raise InvalidNumericsError(
                f"contact_dt = {contact_dt:g} s is too small for dt = {self.dt:g} s: use at least dt / {MOST_SUBSTEPS:g}"
            )
        count = round(ratio)
        if count < 1 or abs(ratio - count) > 1e-9 * count:
            raise InvalidNumericsError(
                f"contact_dt = {contact_dt:g} s does not divide dt = {self.dt:g} s: use dt / k for a whole k, "
                f"for instance {self.dt / max(1, int(np.ceil(ratio))):g}"
            )
        if count * self.n_steps > MOST_STEPS:
            raise InvalidNumericsError(
                f"n_steps = {self.n_steps} with {count} contact steps in each (dt = {self.dt:g} s, contact_dt = {contact_dt:g} s) is not "
                f"allowed: a run has at most {MOST_STEPS} contact steps"
            )
        return count

    def sampled_steps(self) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
        """Return the steps ``dt`` at which a sample is taken, in order, shape (s,)."""
        last = self.n_steps if self.sample_until is None else min(self.sample_until, self.n_steps)
        regular = np.arange(min(self.sample_from, self.n_steps), last + 1, self.sample_every, dtype=np.int64)
        return np.union1d(regular, np.array([0, self.n_steps], dtype=np.int64))

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON; ``energy_budget`` is left out where it is not asked for."""
        plain = {**asdict(self), "options": dict(self.options)}
        if not self.energy_budget:
            del plain["energy_budget"]
        return plain

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Numerics:
        """Build numerics from `to_dict` data; raises `InvalidNumericsError` on unknown or missing keys."""
        try:
            return cls(**data)
        except CoreError:
            raise
        except (TypeError, ValueError, AttributeError) as error:
            raise InvalidNumericsError(f"the numerics' data have the wrong form: {error}") from error

    def replace(self, **changes: Any) -> Numerics:
        """Return a copy with some fields changed."""
        return replace(self, **changes)


def check_run(scene: Scene, numerics: Numerics, method: str = "", lacks: Collection[str] = ()) -> None:
    """Refuse what is no scene with a disk, or no numerics, or asks for what a method lacks.

    Parameters
    ----------
    scene, numerics
    method : str
        Its name in messages.
    lacks : collection of str
        Of "materials", "forces on disks", "a periodic cell", "cohesion", "adhesion", "Hertz' law", "rolling resistance" and "rolling
        resistance (MODEL)".

    Raises
    ------
    InvalidSceneError, InvalidNumericsError
    """
    kind_of("scene", scene, Scene)
    kind_of("numerics", numerics, Numerics, error=InvalidNumericsError)
    if len(scene.disks) == 0:
        raise InvalidSceneError("the scene has no disk: there is nothing to simulate")
    laws = scene.laws_in_use
    models = [law.rolling.model for law in laws if law.rolling is not None]
    asked = {
        "materials": bool(scene.laws),
        "forces on disks": bool(scene.forces),
        "a periodic cell": scene.cell is not None,
        "cohesion": any(law.cohesion > 0.0 for law in laws),
        "adhesion": any(law.adhesion > 0.0 for law in laws),
        "Hertz' law": any(law.hertz for law in laws),
        "rolling resistance": bool(models),
        **{f"rolling resistance ({model})": True for model in models},
    }
    missing = [name for name in lacks if asked.get(name)]
    if missing:
        raise InvalidSceneError(
            f"the scene has {missing[0]}, which {method} does not have: leave it out, or use another method"
        )


def check_progress(progress: object) -> None:
    """Raise `InvalidNumericsError` unless ``progress`` can be called or is None."""
    if not (progress is None or callable(progress)):
        raise InvalidNumericsError(
            f"progress = {short_repr(progress)} is not allowed: it must be a function of two numbers, or None"
        )


def watched_pairs(scene: AnyScene, watch: Sequence[Pair]) -> tuple[Pair, ...]:
    """Return the contacts to record, as body numbers.

    Raises
    ------
    InvalidSceneError
        If one does not exist.
    """
    pairs = items_of("watch", watch, "a sequence of pairs, () for none")
    return tuple(scene.check_pair(pair) for pair in pairs)


def chosen_particles(scene: AnyScene, particles: Sequence[int] | None) -> NDArray[np.int64]:
    """Body numbers, shape (k,); None means all.

    Raises
    ------
    InvalidSceneError
        If a body does not exist.
    """
    n = len(scene.bodies)
    if particles is None:
        return np.arange(n, dtype=np.int64)
    chosen: list[int] = []
    for particle in items_of(
        "particles", particles, f"a sequence of {scene.noun}s' numbers 0..{n - 1}, or None for all"
    ):
        try:
            chosen.append(*body_numbers("a particle is a whole number", (particle,)))
        except InvalidSceneError as error:
            raise InvalidSceneError(
                f"particle {short_repr(particle)} is no whole number: {scene.noun}s are numbered 0..{n - 1}"
            ) from error
        if not 0 <= chosen[-1] < n:
            raise InvalidSceneError(f"particle {particle} does not exist: {scene.noun}s are numbered 0..{n - 1}")
    return np.array(chosen, dtype=np.int64)


def check_memory(numerics: Numerics, n_chosen: int, n_walls: int, n_pairs: int) -> None:
    """Refuse a run whose samples this machine cannot hold.

    Raises
    ------
    InvalidNumericsError
        Before anything is allocated: the system would hand out the memory and end the process once it is written to.
    """
    samples = len(numerics.sampled_steps())
    needed = 8 * samples * (6 * n_chosen + 5 * n_walls + 3 * n_pairs + 10)  # numbers of a History, each 8 bytes
    here = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if needed > here:
        raise InvalidNumericsError(
            f"n_steps = {numerics.n_steps} with sample_every = {numerics.sample_every} is not allowed: {samples} samples of "
            f"{n_chosen} disks need {needed / 2**30:.3g} GiB, and this machine has {here / 2**30:.3g} GiB; raise sample_every, "
            "take fewer steps, of a larger dt, or record fewer particles"
        )
