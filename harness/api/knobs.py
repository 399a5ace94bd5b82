"""Accuracy settings that a user of an engine changes, from the engine's own value on: what `ninedisk tune` tries besides the step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from ninedisk.core.numerics import Numerics
from ninedisk.core.options import Option
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.results.schema import STOCK


@dataclass(frozen=True, kw_only=True)
class Knob(Option):
    """A setting of an engine at its own settings; ``default`` is the engine's own value.

    Parameters
    ----------
    ladder : tuple
        Further values, from the engine's own towards the most accurate one.
    dear : bool
        Whether a step takes longer with each value of the ladder.

    Examples
    --------
    >>> knob = Knob(default=10, low=1, high=1000, whole=True, why="iterations of the solver", ladder=(30, 100), dear=True)
    >>> knob.values
    (10, 30, 100)
    """

    ladder: tuple[Any, ...]
    dear: bool = False

    @property
    def values(self) -> tuple[Any, ...]:
        """The engine's own value and the ladder."""
        return (self.default, *self.ladder)


class AtOwnSettings(Protocol):
    """An engine at its own settings, of which single ones can be changed; see `ninedisk.harness.engines.stock`."""

    of: str
    """Id of the tuned engine."""
    step: float
    """Its own step [s]."""
    step_from: str
    """Where that comes from."""

    @property
    def id(self) -> str:
        """Id of the engine at its own settings."""

    @property
    def knobs(self) -> Mapping[str, Knob]:
        """Settings besides the step that a run may change."""

    def info(self) -> EngineInfo:
        """Facts about the engine."""


def given_knobs(engine: str, knobs: Mapping[str, Knob], numerics: Numerics) -> dict[str, Any]:
    """Values of the knobs that a run sets, by name; a stock run without any leaves all of them to the engine.

    Parameters
    ----------
    engine : str
        Id of the tuned engine, ``"mujoco"``.
    knobs : mapping from str to Knob
    numerics : Numerics
        Its options hold them as ``mujoco-stock.NAME``.

    Raises
    ------
    InvalidNumericsError
        If a value is not allowed.

    Examples
    --------
    >>> numerics = Numerics(dt=0.1, n_steps=1, options={"acme-stock.sweeps": 30, "other.sweeps": 5})
    >>> given_knobs("acme", {"sweeps": Knob(default=10, low=1, why="", ladder=(30,))}, numerics)
    {'sweeps': 30.0}
    """
    options = numerics.options
    full = {name: f"{engine}{STOCK}.{name}" for name in knobs}
    return {name: knobs[name].checked(key, options[key]) for name, key in full.items() if key in options}


def recorded_knobs(engine: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """Knobs that a run sets, as its settings name them."""
    return {f"{engine}{STOCK}.{name}": value for name, value in given.items()}
