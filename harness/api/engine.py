"""The Engine protocol: what an adapter implements and what it gives back."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any, Protocol, runtime_checkable

import numpy as np

from ninedisk.core.history import History, Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.options import Option
from ninedisk.core.scene import Scene, SphereScene
from ninedisk.harness.api.boxes import has_boxes
from ninedisk.harness.api.capabilities import Capability


class SupportLevel(StrEnum):
    """How faithfully an engine expresses a scene.

    Examples
    --------
    >>> [level.value for level in SupportLevel]
    ['exact', 'equivalent', 'approximate', 'no']
    """

    EXACT = "exact"
    EQUIVALENT = "equivalent"
    APPROXIMATE = "approximate"
    NO = "no"


@dataclass(frozen=True)
class Support:
    """Answer of `Engine.supports`.

    Parameters
    ----------
    level : SupportLevel
    missing : tuple of Capability
        What the scene needs and the engine lacks.
    notes : tuple of str
        Remarks for the report.

    Examples
    --------
    >>> from ninedisk.harness.api.capabilities import Capability
    >>> answer = Support(SupportLevel.NO, missing=(Capability.FRICTION,))
    >>> answer.level.value, [capability.value for capability in answer.missing]
    ('no', ['Coulomb friction'])
    """

    level: SupportLevel
    missing: tuple[Capability, ...] = ()
    notes: tuple[str, ...] = ()


class Difference(StrEnum):
    """A known difference of an engine from what a scene commonly means; cases allow for it, by a size that they derive.

    Examples
    --------
    >>> Difference.KEEPS_KN.value
    "contacts are soft, and a load at rest overlaps by load/kn, kn the scene's"
    """

    FIXED_WALL_SHEAR = "shear forces at a wall keep their direction in space while the wall turns"
    KEEPS_OPENED_SHEAR = "a contact between disks that opens and closes again goes on from its old shear force"
    FRICTION_LAGS = (
        "friction is bounded by the normal force of the step before: a contact that begins has none in its first step"
    )
    KEEPS_KN = "contacts are soft, and a load at rest overlaps by load/kn, kn the scene's"
    IMPACT_AS_SPRINGS = (
        "contacts are soft, and an impact is a spring's motion over several of the engine's own steps: contacts that are hit at "
        "one time share it as springs do"
    )
    ARM_LESS_OVERLAP = (
        "shear impulses of a sphere on a plane act at the plane: their arm is the radius less the overlap that the step of an "
        "impact makes"
    )
    DASHPOT_NEVER_PULLS = (
        "dashpots of spheres are cut off where they would pull, at the end of a contact: spheres part faster than their damping "
        "ratio says, in every rebound"
    )
    FRICTION_WHILE_PULLED = (
        "friction of spheres is cut off at mu times the size of the normal force: a dashpot that pulls at the end of a contact rubs "
        "as hard as one that pushes"
    )
    SPRINGS_TURN_WITH_TWIST = (
        "what a contact of spheres remembers turns with half of their spin about the normal where slip is that of a step's end: the "
        "torque that resists rolling leaves the direction of rolling"
    )
    SHEAR_KEEPS_TWIST = (
        "shear forces of spheres turn with the normal and not about it: where spheres spin about their normal the force keeps a direction "
        "that the bodies have left"
    )
    SHEAR_KEEPS_DIRECTION = (
        "shear forces of spheres keep their direction in space: they turn neither with the normal nor about it"
    )
    RESISTANCES_SHARE_CONE = (
        "resistances to rolling and twisting share one cone: both together are as large as one alone"
    )
    NECK_PARTS_AT_LARGEST_PULL = (
        "the neck of JKR's contact parts where it pulls most, as under a dead load, and not where its branch ends: spheres that come "
        "apart lose half as much, and some part that should stick"
    )
    BOX_FRICTION_ASKEW = (
        "friction at the corners of a box is not against their slip: its direction is off by up to 0.3 rad, and differs from corner to "
        "corner"
    )
    MISSED_TOLERANCE_GIVES_PYRAMID = (
        "a step in which the solver misses its tolerance is solved by another one, whose friction is a pyramid: for that step friction of "
        "boxes is off by up to 0.3 of its bound"
    )
    FRICTION_PYRAMID = (
        "friction of bodies is bounded along the velocity of their centres and across it, by mu times the load each: off that velocity it "
        "is up to 1.41 times as strong and up to 45 degrees off the slip"
    )
    FRICTION_AT_TWO_CORNERS = (
        "friction of a face acts at two of its corners: where their line is across the motion, next to nothing keeps a box from "
        "turning"
    )
    IMPULSES_OF_OTHERS = (
        "the impulses of one contact are now and then reported as those of another; the motion is right"
    )
    BOXES_ROCK = (
        "boxes that lie on boxes need not come to rest: corners lift by up to 0.002 of their size and fall back"
    )
    NORMAL_TURNS_IN_IMPACT = (
        "restitution takes the approach along the line of centres at the begin of a step, the impulse acts along that at its "
        "end: e = 1 gains energy, first order in the step"
    )


SOFTEST = 1e-2
"""Largest softness that an engine may state, and what counts where it states none: more would not distinguish a right law from one that
is off by the few per cent that matter."""


SLOPPIEST = 1e-2
"""Largest slop [m] that an engine may state: a hundredth of the radius of most disks here."""


@dataclass(frozen=True, kw_only=True)
class EngineInfo:
    """Facts about an engine.

    Parameters
    ----------
    id : str
        Name in commands.
    name : str
        Name in reports.
    version : str or None
        None: it is not installed.
    scheme : str
        The time discretisation, so that an exact time-discrete reference binds only engines of that very scheme:

        - ``"central-difference"``: velocities at half steps, forces at positions and walls of t_n;
        - ``"theta"``: implicit theta scheme of `ninedisk.core.cd`, ``Numerics.theta`` its parameter;
        - ``"semi-implicit-euler"``: velocities first, positions with the new ones;
        - ``"position-first-euler"``: positions with the old velocities, then velocities;
        - ``"moreau-jean"``: velocities first, positions with ``theta v_1 + (1 - theta) v_0``, theta the engine's option of that name;
        - ``"runge-kutta-3"``: third order, steps so small that omega times a step is at most the engine's option ``phase``.

        Any other name binds no exact steps.
    contact : {"spring", "impulse", "cd", "soft"}
        Linear contact springs; rigid at velocity level; contact dynamics; or soft in a way of the engine's own.
    licence : str
        Of the engine's code.
    how_it_runs : str
        In this process, in another, behind a command.
    precision : {"float64", "float32"}
        Of its arithmetic.
    threads : int
        Threads that it runs on.
    install : str
        How to install it.
    not_installed_because : str
        Why it is not installed; "" where it is.
    capabilities : frozenset of Capability
    plane : bool
        Whether it runs scenes of the plane; those in space are asked of engines with `Capability.SPHERES`.
    turns_shear : {"exactly", "to first order"}
        How a shear force follows the contact's rotation; to first order its size changes by half the square of the rotation in
        each step.
    turns_exactly_with : frozenset of Capability
        Lever arms with which that is exact all the same.
    arms_at_walls : frozenset of Capability or None
        Lever arms of contacts with walls, where they are not those among ``capabilities``.
    dilates : bool
        Whether a sliding contact opens, as the associated rule of convex contact models has it.
    softness : float or None
        Of engines whose contacts are soft: fraction [-] of the approach velocity that a contact does not remove in one step, by the
        engine's own regularisation; from 0 to `SOFTEST`. None: no such figure, judged as `SOFTEST`.
    softness_why : str
        Where that figure comes from.
    slop : float
        Of engines with ``"impulse"`` or ``"soft"`` contacts: largest overlap [m] that a contact leaves as it is, for good or while it goes
        away slowly; from 0 to `SLOPPIEST`. It loosens gaps and heights above what bears a body, nothing else.
    second_order_dashpots : bool
        Whether dashpots see the velocity of t_n to second order, as the exact steps of central differences have it; others
        extrapolate it by their own rules, to first order.
    sweeps : str
        Of engines with ``"impulse"`` contacts: the option that counts the sweeps of Gauss-Seidel kind, from zero, over the contacts in a
        step; ``""``: none. Cases allow for what so few leave of a load (`ninedisk.harness.cases.static.stack`), for no other engine.
    reference : bool
        Whether other engines of its scheme are held against this one's runs; it has to report all that a history has room for.
    contact_forces : {"all", "normal", "none"}
        Of contacts with rigid bodies, the forces that the engine can report. Where they are not all, a check whose quantity has no number
        at any step is ``not-observed``, which is no failure.
    profile : {"tuned", "stock"}
        Settings that the adapter chose to come near to the physics, or the engine's own.
    differences : mapping from Difference to str
        Known differences of the engine, each with its reason.
    options : mapping from str to Option
        Settings that ``Numerics.options`` may hold as ``<id>.<name>``.
    out_of_scope : mapping from Capability to str
        Where the engine's own documentation says that it is not meant to have a capability.

    Raises
    ------
    ValueError
        If ``softness`` or ``slop`` is out of its range, or given for contacts of another kind.

    Examples
    --------
    >>> from ninedisk.harness.api.capabilities import Capability
    >>> info = EngineInfo(
    ...     id="acme", name="Acme DEM", version="1.0", scheme="central-difference", contact="spring", licence="MIT",
    ...     how_it_runs="in this process", install="pip install acme", capabilities=frozenset({Capability.LINEAR_CONTACT}),
    ... )
    >>> info.installed, info.slop
    (True, 0.0)
    """

    id: str
    name: str
    version: str | None = None
    scheme: str
    contact: str
    licence: str
    how_it_runs: str
    precision: str = "float64"
    threads: int = 1
    install: str
    capabilities: frozenset[Capability]
    not_installed_because: str = ""
    plane: bool = True
    turns_shear: str = "exactly"
    turns_exactly_with: frozenset[Capability] = frozenset()
    arms_at_walls: frozenset[Capability] | None = None
    dilates: bool = False
    softness: float | None = None
    softness_why: str = ""
    slop: float = 0.0
    second_order_dashpots: bool = False
    sweeps: str = ""
    reference: bool = False
    contact_forces: str = "all"
    profile: str = "tuned"
    differences: Mapping[Difference, str] = field(default_factory=dict)
    options: Mapping[str, Option] = field(default_factory=dict)
    out_of_scope: Mapping[Capability, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not 0.0 <= self.slop <= SLOPPIEST or (self.slop and self.contact not in ("impulse", "soft")):
            raise ValueError(
                f"engine {self.id!r}: slop = {self.slop!r} m is not allowed with contact = {self.contact!r}: it must lie between 0 and "
                f"{SLOPPIEST:g} m, and be 0 unless contact is 'impulse' or 'soft'; set a smaller one in the engine"
            )
        if self.softness is None:
            return
        if self.contact != "soft":
            raise ValueError(
                f"engine {self.id!r}: softness = {self.softness!r} is not allowed where contact is {self.contact!r}: leave it out, "
                "or declare contact = 'soft'"
            )
        if not 0.0 <= self.softness <= SOFTEST:
            raise ValueError(
                f"engine {self.id!r}: softness = {self.softness!r} is not allowed: it must lie between 0 and {SOFTEST:g}; give "
                f"{SOFTEST:g} where a contact lets through more, and declare the checks that it then fails as known"
            )

    @property
    def installed(self) -> bool:
        """Whether the engine can run on this machine."""
        return self.version is not None

    def option(self, name: str, numerics: Numerics) -> Any:
        """Return the value of one of the engine's `options` in a run with these numerics."""
        return numerics.options.get(f"{self.id}.{name}", self.options[name].default)


@dataclass(frozen=True, kw_only=True)
class Timings:
    """Seconds by the clock on the wall, and of the processor, which stands still while other work holds the machine.

    Parameters
    ----------
    setup, warm_up, advance : float
        Wall-clock time [s]; ``advance`` is that of the steps alone.
    cpu : float or None
        CPU time [s] of all threads: comparisons of speed use it. None: the engine does not report it.
    cpu_of : {"stepping", "whole process"}
        What ``cpu`` was spent on. An engine behind a command that does not report it has that of its whole process.

    Examples
    --------
    Two threads that keep two cores busy for 3 s:

    >>> timings = Timings(setup=0.1, warm_up=0.5, advance=3.0, cpu=6.0)
    >>> timings.cpu / timings.advance
    2.0
    """

    setup: float
    warm_up: float
    advance: float
    cpu: float | None = None
    cpu_of: str = "stepping"


class Stopwatch:
    """Sum the seconds of ``with`` blocks.

    Attributes
    ----------
    wall : float
        Wall-clock time [s].
    cpu : float
        CPU time [s] of all threads of this process.

    Examples
    --------
    >>> watch = Stopwatch()
    >>> with watch:
    ...     total = sum(range(1000))
    >>> watch.wall > 0.0, watch.cpu >= 0.0
    (True, True)
    """

    def __init__(self) -> None:
        self.wall = self.cpu = 0.0

    def __enter__(self) -> Stopwatch:
        self._begin = time.perf_counter(), time.process_time()
        return self

    def __exit__(self, *_: object) -> None:
        self.cpu += time.process_time() - self._begin[1]
        self.wall += time.perf_counter() - self._begin[0]


@dataclass(frozen=True, kw_only=True)
class EngineRun:
    """A finished run.

    Parameters
    ----------
    history : History
    timings : Timings
    settings : mapping from str to value
        Every setting that was chosen deliberately.

    Examples
    --------
    >>> empty = History.empty(np.array([0]), np.array([0.0]), n_disks=1, n_walls=0, pairs=())
    >>> run = EngineRun(history=empty, timings=Timings(setup=0.0, warm_up=0.0, advance=0.0), settings={"iterations": 10})
    >>> run.history.t.tolist(), run.settings
    ([0.0], {'iterations': 10})
    """

    history: History
    timings: Timings
    settings: Mapping[str, Any] = field(default_factory=dict)


class EngineError(RuntimeError):
    """The engine failed, crashed or answered nonsense; the message carries its last output lines.

    Examples
    --------
    >>> try:
    ...     raise EngineError("the state is no longer finite at step 7; reduce dt")
    ... except RuntimeError as error:
    ...     print(error)
    the state is no longer finite at step 7; reduce dt
    """


class EngineTimeoutError(EngineError):
    """The engine was stopped at its limit of CPU time or of idle time.

    Examples
    --------
    >>> issubclass(EngineTimeoutError, EngineError)
    True
    """


class EngineNotInstalledError(EngineError):
    """The engine is not on this machine; the message says how to install it.

    Examples
    --------
    >>> try:
    ...     raise EngineNotInstalledError("MuJoCo is not installed: pip install mujoco")
    ... except EngineError as error:
    ...     print(error)
    MuJoCo is not installed: pip install mujoco
    """


class EngineUnsupportedError(EngineError):
    """The engine found, once it had the scene, that it cannot express it; the message says why.

    Examples
    --------
    >>> try:
    ...     raise EngineUnsupportedError("walls 'left' and 'right' are closer than a diameter, 1 m")
    ... except EngineError as error:
    ...     print(error)
    walls 'left' and 'right' are closer than a diameter, 1 m
    """


@runtime_checkable
class Engine(Protocol):
    """What the harness asks of an engine.

    Examples
    --------
    >>> from ninedisk.harness.api.registry import get_engine
    >>> engine = get_engine("dem")
    >>> isinstance(engine, Engine), engine.info().scheme
    (True, 'central-difference')
    """

    id: str

    def info(self) -> EngineInfo:
        """Return facts about the engine; must be cheap and must not fail where it is not installed."""
        ...

    def supports(self, scene: Scene, numerics: Numerics) -> Support:
        """Report how faithfully this engine expresses the scene; NO names the missing capabilities."""
        ...

    def run(self, scene: Scene, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:
        """Run the scene and return the observations at ``numerics.sampled_steps()``.

        Raises
        ------
        EngineError
            On any failure of the engine; `ninedisk.core.errors.CoreError` on a scene that the user got wrong.
        """
        ...


def facts_of(engine: Engine) -> EngineInfo:
    """Return `Engine.info`; a failure of it becomes a message.

    Parameters
    ----------
    engine : Engine

    Returns
    -------
    EngineInfo

    Raises
    ------
    EngineError
        If it fails, by whatever exception; that of an engine behind a command is raised as it is.

    Examples
    --------
    >>> from ninedisk.harness.api.registry import get_engine
    >>> facts_of(get_engine("dem")).contact
    'spring'
    """
    try:
        return engine.info()
    except EngineError:
        raise
    except (Exception, SystemExit) as error:
        raise EngineError(
            f"info() of the engine {engine.id!r} must not fail, it says {type(error).__name__}: {error}; mend its adapter"
        ) from error


class Session(Protocol):
    """What an in-process adapter writes; `run_session` turns it into `Engine.run`.

    Examples
    --------
    Free flight at 2 m/s:

    >>> class Flight:
    ...     x = 0.0
    ...     def warm_up(self): pass
    ...     def advance(self, n_steps): self.x += n_steps * 0.1 * 2.0
    ...     def observe(self, history, row): history.x[row, 0] = self.x, 0.0
    >>> flight = Flight()
    >>> flight.advance(5)
    >>> flight.x
    1.0
    """

    def warm_up(self) -> None:
        """Compile and fill caches; the state stays unchanged; not counted."""
        ...

    def advance(self, n_steps: int) -> None:
        """Advance by ``n_steps`` steps ``Numerics.dt``: the only timed call."""
        ...

    def observe(self, history: History, row: int) -> None:
        """Write copies of the current state into row ``row`` of ``history``."""
        ...


def run_session(
    make: Any,
    scene: Scene | SphereScene,
    numerics: Numerics,
    watch: Sequence[Pair],
    *,
    force_meaning: Any = "step-mean",
) -> EngineRun:
    """Drive a `Session` over the sampled steps and time it.

    Parameters
    ----------
    make : callable
        Makes the session: ``make(scene, numerics, pairs)``.
    scene : Scene or SphereScene
    numerics : Numerics
    watch : sequence of pairs
        Contacts to record, as body numbers.
    force_meaning : {"step-mean", "instantaneous"}
        As in `History`.

    Returns
    -------
    EngineRun

    Examples
    --------
    An adapter that moves a disk at its velocity, 2 m/s for 1 s:

    >>> class Flight:
    ...     def __init__(self, scene, numerics, pairs):
    ...         self.x, self.v, self.dt = scene.disks.x.copy(), scene.disks.v, numerics.dt
    ...     def warm_up(self): pass
    ...     def advance(self, n_steps): self.x += n_steps * self.dt * self.v
    ...     def observe(self, history, row): history.x[row] = self.x
    >>> disk = Disks(x=[[0.0, 0.0]], v=[[2.0, 0.0]], radius=0.5, mass=1.0)
    >>> run = run_session(Flight, Scene(disks=disk, disk_disk=ContactLaw(kn=1e6)), Numerics(dt=0.5, n_steps=2), ())
    >>> run.history.x[:, 0, 0].tolist()
    [0.0, 1.0, 2.0]
    """
    pairs = tuple(scene.check_pair(pair) for pair in watch)
    steps = numerics.sampled_steps()
    history = History.empty(
        steps,
        np.multiply(steps, numerics.dt, dtype=np.float64),
        n_disks=len(scene.bodies),
        n_walls=len(scene.walls),
        pairs=pairs,
        force_meaning=force_meaning,
        dimension=scene.dimension,
        boxes=has_boxes(scene),
    )
    setup, warm_up, stepping = Stopwatch(), Stopwatch(), Stopwatch()
    with setup:
        session = make(scene, numerics, pairs)
    with warm_up:
        session.warm_up()
    done = 0
    for row, step in enumerate(steps):
        if step > done:
            with stepping:
                session.advance(int(step) - done)
        done = int(step)
        session.observe(history, row)
    settings = getattr(session, "settings", {})
    timings = timings_of(setup, warm_up, stepping)
    if (elsewhere := getattr(session, "cpu_seconds", 0.0)) and timings.cpu is not None:  # of another process
        timings = replace(timings, cpu=timings.cpu + elsewhere)
    return EngineRun(history=history, timings=timings, settings=dict(settings))


def timings_of(setup: Stopwatch, warm_up: Stopwatch, stepping: Stopwatch) -> Timings:
    """Return the timings of a run in this process.

    Parameters
    ----------
    setup, warm_up, stepping : Stopwatch

    Returns
    -------
    Timings

    Examples
    --------
    >>> idle, busy = Stopwatch(), Stopwatch()
    >>> busy.wall, busy.cpu = 2.0, 1.5
    >>> timings = timings_of(idle, idle, busy)
    >>> timings.advance, timings.cpu
    (2.0, 1.5)
    """
    return Timings(setup=setup.wall, warm_up=warm_up.wall, advance=stepping.wall, cpu=stepping.cpu)
