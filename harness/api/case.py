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
    """A parameter that does not exist, or a value outside its range; the message names the way out."""


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A parameter of a case, settable by ``--set NAME=VALUE``.

    ``words`` are values that a number parameter accepts besides numbers (``wall_mu=mu``); ``optional`` admits
    ``none``; ``in_id`` puts the parameter into every variant's id, the others only where they differ from the default.
    ``only_for`` is the kind of contact (`EngineInfo.contact`) that alone has this setting, empty for all: a variant of the
    matrix that sets it means nothing to other engines and is not run on them.
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
        """One above 0, with the further fields of a parameter; where its default is None it is optional."""
        return cls(name=name, default=default, low=0.0, low_open=True, optional=default is None, **rest)


@dataclass(frozen=True)
class Variant:
    """A case with every parameter fixed; ``params`` is complete and validated."""

    id: str
    params: Mapping[str, Any]


@dataclass(frozen=True, kw_only=True)
class Setup:
    """What an engine needs: the scene, the numerics and the contacts to watch.

    ``labels`` names watched pairs and bodies for sketches.
    """

    scene: Scene
    numerics: Numerics
    watch: tuple[Pair, ...]
    labels: Mapping[str, Pair] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class SphereSetup(Setup):
    """What an engine needs of a case in space."""

    scene: SphereScene  # type: ignore[assignment]


@dataclass(frozen=True, kw_only=True)
class Observed:
    """Quantities of a run: series over the sampled steps, and single numbers. Both map name -> (unit, value)."""

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
        Truth at the sampled steps (NaN where it says nothing), or a number.
    uncertainty : float
        Half-width of the truth's own uncertainty, in the quantity's unit.
    source : str
        Where the truth comes from.
    atol, rtol : float
        The check passes if the error is at most ``atol + rtol max(|expected|, scale)``.
    why : str
        Reason of the tolerance.
    window : (int, int) or None
        First and last step that count.
    scale : float
        Physical size that errors are relative to where the truth is smaller, zero or nearly so: a radius for a gap, the weight
        for a force.
    known : KnownDifference or None
        A declared difference of this engine that explains an error beyond the tolerance, up to its own size.
    gap_reason : str
        Not empty: the truth itself is known to be off for this engine or contradicted by a better truth; a failure is
        then reported as ``known-gap`` with this reason, a success as ``gap-closed``.
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

    It is the same for every engine and every time step, and has no tolerance: it tells how far from the physics a result is.

    Parameters
    ----------
    name : str
        In a physicist's words ("restitution", "distance after 1 s"), the same in every variant.
    use : str
        What it matters for, one of `ninedisk.harness.results.schema.USES`.
    quantity : str
        Name in `Observed`; of a series the largest difference over ``window`` counts.
    expected : float or ndarray, shape (s,)
        Truth of the continuous problem at the sampled steps (NaN where it says nothing), or a number.
    source : str
        Where that comes from.
    scale : float
        Positive size, in the quantity's unit, that the error is relative to.
    scale_is : str
        What that size is ("weight of the block").
    window : (int, int) or None
        First and last step that count.
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
    """

    id: str
    version: int
    title: str
    source: str
    requirement: str
    parameters: tuple[Parameter, ...]

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Parameter overrides of the variants that run by default."""
        ...

    def build(self, params: Mapping[str, Any]) -> Setup:
        """Scene, numerics and watched contacts of one variant."""
        ...

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """Named quantities of a finished run."""
        ...

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Truths that bind this engine on this variant."""
        ...


def headlines_of(case: Case, params: Mapping[str, Any], setup: Setup, observed: Observed) -> tuple[Headline, ...]:
    """The headlines that a case declares of a variant; none where it has no such method."""
    declared = getattr(case, "headlines", None)
    return () if declared is None else tuple(declared(params, setup, observed))


def figures_of(case: Case) -> tuple[Figure, ...]:
    """The figures that a case declares; none where it has no such attribute."""
    return tuple(getattr(case, "figures", ()))
