"""The Case protocol: parameters, set-up, observed quantities, truths and checks."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.history import History, Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene, SphereScene
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.results.figures import Figure

FloatArray = NDArray[np.float64]
Norm = Literal["max", "scalar"]
TruthKind = Literal["exact-step", "analytic", "published", "converged", "consensus"]
Value = float | int | str | bool


class ParameterError(ValueError):
    """A parameter that does not exist, or a value outside its range; the message names the way out.

    Examples
    --------
    >>> from ninedisk.harness.api.params import parse
    >>> parse(Parameter.positive("speed", 3.0, unit="m/s", help="initial speed"), "-3 m/s")
    Traceback (most recent call last):
    ninedisk.harness.api.case.ParameterError: speed = -3 m/s is not allowed: it must be a number > 0
    """


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A parameter of a case, settable by ``--set NAME=VALUE``.

    Parameters
    ----------
    name : str
        Name in commands and in ids of variants.
    default : float, int, str, bool or None
        Its type is that of the parameter; None for an optional number.
    help : str
        Meaning, one line.
    unit : str
        Unit of the number; "" or "-" for none.
    choices : tuple
        All values that are allowed; empty: no such list.
    words : tuple of str
        Words that a number parameter accepts besides numbers (``wall_mu=mu``).
    low, high : float
        Range of a number, in ``unit``; both ends are allowed.
    low_open : bool
        True: ``low`` itself is not allowed.
    whole : bool
        True: only whole numbers are allowed.
    optional : bool
        True: ``none`` is allowed.
    in_id : bool
        True: the parameter is part of every variant's id. Others are where they differ from their default.
    only_for : str
        Kind of contact (`EngineInfo.contact`) that alone has this setting; "" for all. A variant of the matrix that sets it means
        nothing to other engines and is not run on them.

    Examples
    --------
    >>> speed = Parameter.positive("speed", 3.0, unit="m/s", help="initial speed")
    >>> speed.low, speed.low_open, speed.optional
    (0.0, True, False)
    """

    name: str
    default: Value | None
    help: str
    unit: str = ""
    choices: tuple[Value, ...] = ()
    words: tuple[str, ...] = ()
    low: float = -math.inf
    high: float = math.inf
    low_open: bool = False
    whole: bool = False
    optional: bool = False
    in_id: bool = False
    only_for: str = ""

    @classmethod
    def positive(cls, name: str, default: float | None, **rest: Any) -> Parameter:
        """Make a number parameter above 0; it is optional if its default is None.

        Parameters
        ----------
        name : str
        default : float or None
            In the unit of the parameter.
        **rest
            Further fields of the parameter.
        """
        return cls(name=name, default=default, low=0.0, low_open=True, optional=default is None, **rest)


@dataclass(frozen=True)
class Variant:
    """A case with every parameter fixed.

    Parameters
    ----------
    id : str
        ``name=value,...``, unique in the case.
    params : mapping from str to value
        All parameters, validated; numbers in the units of their `Parameter`.

    Examples
    --------
    >>> from ninedisk.harness.api.params import resolve
    >>> from ninedisk.harness.api.registry import get_case
    >>> variant = resolve(get_case("binary-collision"), {"speed": "36 km/h"})
    >>> variant.id, variant.params["speed"]
    ('kind=elastic,speed=10', 10.0)
    """

    id: str
    params: Mapping[str, Any]


@dataclass(frozen=True, kw_only=True)
class Setup:
    """What an engine needs: the scene, the numerics and the contacts to watch.

    Parameters
    ----------
    scene : Scene
    numerics : Numerics
    watch : tuple of pairs
        Contacts to record, as body numbers.
    labels : mapping from str to pair
        Names of watched pairs and bodies, for sketches.

    Examples
    --------
    Two disks with a gap of 1 m, of which one flies at 2 m/s, touch after half a second:

    >>> disks = Disks(x=[[0.0, 0.0], [3.0, 0.0]], v=[[2.0, 0.0], [0.0, 0.0]], radius=1.0, mass=1.0)
    >>> scene = Scene(disks=disks, disk_disk=ContactLaw(kn=1e6))
    >>> setup = Setup(scene=scene, numerics=Numerics(dt=0.01, n_steps=100), watch=((0, 1),), labels={"contact": (0, 1)})
    >>> setup.numerics.dt * setup.numerics.n_steps
    1.0
    """

    scene: Scene
    numerics: Numerics
    watch: tuple[Pair, ...]
    labels: Mapping[str, Pair] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class SphereSetup(Setup):
    """What an engine needs of a case in 3D.

    Parameters
    ----------
    scene : SphereScene
    numerics : Numerics
    watch : tuple of pairs
        Contacts to record, as body numbers.
    labels : mapping from str to pair
        Names of watched pairs and bodies, for sketches.

    Examples
    --------
    >>> spheres = Spheres(x=[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], radius=0.5, mass=2.0)
    >>> scene = SphereScene(spheres=spheres, sphere_sphere=ContactLaw(kn=1e6))
    >>> setup = SphereSetup(scene=scene, numerics=Numerics(dt=0.01, n_steps=100), watch=((0, 1),))
    >>> setup.scene.dimension, setup.scene.check_pair(setup.watch[0])
    (3, (0, 1))
    """

    scene: SphereScene  # type: ignore[assignment]


@dataclass(frozen=True, kw_only=True)
class Observed:
    """Quantities of a run: series over the sampled steps, and single numbers.

    Parameters
    ----------
    step : ndarray of int, shape (s,)
        Sampled steps.
    t : ndarray, shape (s,)
        Their times [s].
    series : mapping from str to (str, ndarray)
        By name: unit, and values of shape (s,).
    scalars : mapping from str to (str, float)
        By name: unit and value.

    Examples
    --------
    The height of a disk thrown upwards at 10 m/s, ``10 t - 5 t^2``:

    >>> t = np.array([0.0, 1.0, 2.0])
    >>> height = 10.0 * t - 5.0 * t**2
    >>> observed = Observed(step=np.arange(3), t=t, series={"y": ("m", height)}, scalars={"y_max": ("m", height.max())})
    >>> observed.series["y"][1].tolist()
    [0.0, 5.0, 0.0]
    """

    step: NDArray[np.int64]
    t: FloatArray
    series: Mapping[str, tuple[str, FloatArray]]
    scalars: Mapping[str, tuple[str, float]]


@dataclass(frozen=True, kw_only=True)
class KnownDifference:
    """What an engine is known to do otherwise, and how large an error that explains in one check.

    An error within the check's tolerance passes as ever; one beyond it and at most ``size`` is a ``known-difference``, counted apart
    from what passes; a larger one fails.

    Parameters
    ----------
    finding : str
        Id of the finding that describes the difference.
    size : float
        Largest error that it explains, in the quantity's unit.
    why : str
        How that size is derived.

    Examples
    --------
    An error of 0.03 that a finding explains up to 0.05 is no failure:

    >>> known = KnownDifference(finding="kratos/arm-at-walls", size=0.05, why="arm of R - overlap/2 at walls")
    >>> known.size >= 0.03
    True
    """

    finding: str
    size: float
    why: str


@dataclass(frozen=True, kw_only=True)
class Check:
    """One quantity against one truth.

    Parameters
    ----------
    quantity : str
        Name in `Observed`.
    norm : {"max", "scalar"}
        "max": largest absolute difference of a series over ``window``; "scalar": a single number.
    truth : {"exact-step", "analytic", "published", "converged", "consensus"}
    expected : float or ndarray, shape (s,)
        Truth at the sampled steps (NaN where it says nothing), or a number, in the quantity's unit.
    uncertainty : float
        Half-width of the truth's own uncertainty, in the quantity's unit.
    source : str
        Where the truth comes from.
    atol, rtol : float
        The check passes if the error is at most ``atol + rtol max(|expected|, scale)``; ``atol`` in the quantity's unit, ``rtol`` [-].
    why : str
        Reason of the tolerance.
    window : (int, int) or None
        First and last step that count.
    scale : float
        Physical size, in the quantity's unit, that errors are relative to where the truth is smaller, zero or nearly so: a radius for
        a gap, the weight for a force.
    known : KnownDifference or None
        A declared difference of this engine that explains an error beyond the tolerance, up to its own size.
    gap_reason : str
        Not empty: the truth itself is known to be off for this engine or contradicted by a better truth; a failure is
        then reported as ``known-gap`` with this reason, a success as ``gap-closed``.

    Examples
    --------
    Largest error that a check allows of a height of 2 m:

    >>> check = Check(
    ...     quantity="y_max", norm="scalar", truth="analytic", expected=2.0, source="v^2/(2 g)", rtol=0.01, atol=0.005,
    ...     why="positions are of first order in the step",
    ... )
    >>> round(check.atol + check.rtol * max(abs(check.expected), check.scale), 9)
    0.025
    """

    quantity: str
    norm: Norm
    truth: TruthKind
    expected: float | FloatArray
    source: str
    why: str
    atol: float = 0.0
    rtol: float = 0.0
    uncertainty: float = 0.0
    window: tuple[int, int] | None = None
    gap_reason: str = ""
    scale: float = 0.0
    known: KnownDifference | None = None


@dataclass(frozen=True, kw_only=True)
class Headline:
    """What one wants to know of an engine on a case: a quantity beside what the continuous problem says of it.

    It is the same for every engine and every time step, and has no tolerance: it shows how far from the physics a result is.

    Parameters
    ----------
    name : str
        In a physicist's words ("restitution", "distance after 1 s"), the same in every variant.
    use : str
        What it matters for, one of `ninedisk.harness.results.schema.USES`.
    quantity : str
        Name in `Observed`; of a series the largest difference over ``window`` counts.
    expected : float or ndarray, shape (s,)
        Truth of the continuous problem at the sampled steps (NaN where it says nothing), or a number, in the quantity's unit.
    source : str
        Where that comes from.
    scale : float
        Positive size, in the quantity's unit, that the error is relative to.
    scale_is : str
        What that size is ("weight of the block").
    window : (int, int) or None
        First and last step that count.

    Examples
    --------
    A rebound at 0.45 m/s where 0.5 m/s is right is off by 5 % of the speed of approach, 1 m/s:

    >>> restitution = Headline(
    ...     name="restitution", use="impacts", quantity="v_final", expected=0.5, source="Newton's law of impact", scale=1.0,
    ...     scale_is="speed of approach",
    ... )
    >>> round(abs(0.45 - restitution.expected) / restitution.scale, 9)
    0.05
    """

    name: str
    use: str
    quantity: str
    expected: float | FloatArray
    source: str
    scale: float
    scale_is: str
    window: tuple[int, int] | None = None


class Case(Protocol):
    """A verification problem.

    ``source`` says where the problem comes from, ``requirement`` what an engine must do to pass; ``version`` changes whenever
    results of the old and new definition must not be joined. A case may also have ``figures``, a tuple of `Figure`, which its
    report page shows before any other, ``claims``, a tuple of `ninedisk.harness.api.claims.Claim`, statements of its source
    that every engine confirms or contradicts, and a method ``headlines(params, setup, observed)`` that returns one to four `Headline`.
    A fault that a check catches should move one of them; ``beside_headlines`` pairs patterns of quantities with the
    reason why a fault that moves these alone need not (`ninedisk selftest` lists all others).

    Examples
    --------
    Two disks of which one flies at 4 m/s towards the other, which rests:

    >>> from ninedisk.harness.api.params import resolve
    >>> from ninedisk.harness.api.registry import get_case
    >>> case = get_case("binary-collision")
    >>> setup = case.build(resolve(case, {"speed": 4.0}).params)
    >>> setup.scene.disks.v.tolist()
    [[4.0, 0.0], [0.0, 0.0]]
    """

    id: str
    version: int
    title: str
    source: str
    requirement: str
    parameters: tuple[Parameter, ...]

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Return the parameter overrides of the variants that run by default."""
        ...

    def build(self, params: Mapping[str, Any]) -> Setup:
        """Build scene, numerics and watched contacts of one variant."""
        ...

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """Return the named quantities of a finished run."""
        ...

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Return the truths that bind this engine on this variant."""
        ...


def headlines_of(case: Case, params: Mapping[str, Any], setup: Setup, observed: Observed) -> tuple[Headline, ...]:
    """Return the headlines that a case declares of a variant; none if it has no such method.

    Parameters
    ----------
    case : Case
    params : mapping from str to value
        All parameters of the variant.
    setup : Setup
    observed : Observed

    Returns
    -------
    tuple of Headline

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> fall = Headline(
    ...     name="fall in 1 s", use="rest", quantity="y", expected=-5.0, source="-g t^2/2", scale=5.0, scale_is="height of fall"
    ... )
    >>> case = SimpleNamespace(headlines=lambda params, setup, observed: [fall])
    >>> headlines_of(case, {}, None, None)[0].expected, headlines_of(SimpleNamespace(), {}, None, None)
    (-5.0, ())
    """
    declared = getattr(case, "headlines", None)
    return () if declared is None else tuple(declared(params, setup, observed))


def figures_of(case: Case) -> tuple[Figure, ...]:
    """Return the figures that a case declares; none if it has no such attribute.

    Parameters
    ----------
    case : Case

    Returns
    -------
    tuple of Figure

    Examples
    --------
    >>> from ninedisk.harness.api.registry import get_case
    >>> [figure.title for figure in figures_of(get_case("binary-collision"))]
    ['Elastic collision', 'Plastic collision']
    """
    return tuple(getattr(case, "figures", ()))
