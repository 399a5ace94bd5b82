"""The energy budget of a squeezed heap: what is judged, what is not, and what the judgement sees."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ninedisk.core.history import History
from ninedisk.harness.api.params import resolve
from ninedisk.harness.cases.energy.budget import CASE, LOSSES
from ninedisk.harness.engines.cd.adapter import ENGINE as CD
from ninedisk.harness.engines.dem.adapter import ENGINE as DEM

SHORT = {"duration": 0.25}


def run(engine: Any, **params: Any) -> History:
    setup = CASE.build(resolve(CASE, {**SHORT, **params}).params)
    return engine.run(setup.scene, setup.numerics, setup.watch).history


def failures(history: History, info: Any, **params: Any) -> set[str]:
    given = resolve(CASE, {**SHORT, **params}).params
    setup = CASE.build(given)
    observed = CASE.observe(given, setup, history)
    errors = {
        c.quantity: (np.abs(observed.series[c.quantity][1] - c.expected), c.atol)
        for c in CASE.checks(given, setup, observed, info)
    }
    return {name for name, (error, atol) in errors.items() if np.isfinite(error).any() and not np.nanmax(error) <= atol}


def changed(history: History, **energy: Any) -> History:
    return replace(history, energy={**history.energy, **energy})


@pytest.mark.parametrize("engine", [CD, DEM], ids=lambda engine: engine.id)
def test_every_channel_is_seen(engine: Any) -> None:
    """One part in fifty more or less in a channel opens the balance; a loss that turns round is named."""
    history, info = run(engine), engine.info()
    assert failures(history, info) == set()
    energy = history.energy
    for name in ("kinetic", "elastic", "gravity", "friction_loss", "dashpot_loss", "damping_loss", "wall_work"):
        assert failures(changed(history, **{name: 1.02 * energy[name]}), info) == {"energy_balance"}, name
    for name in ("friction_loss", "dashpot_loss", "damping_loss"):
        turned = changed(history, **{name: -energy[name]})
        assert failures(turned, info) == {"energy_balance", f"energy_{name}_fed"}, name


def test_the_balance_of_the_dem_is_of_second_order() -> None:
    off = []
    for dt in (2e-4, 1e-4, 5e-5):
        given = resolve(CASE, {**SHORT, "dt": dt}).params
        observed = CASE.observe(given, CASE.build(given), run(DEM, dt=dt))
        off.append(float(np.abs(observed.series["energy_balance"][1]).max()))
    # Paths of a heap are chaotic: the steps' errors are others, not only smaller.
    assert off[2] < off[0] / 16.0 * 2.0


@pytest.mark.parametrize("reported", [(), ("kinetic",), ("kinetic", "elastic", "gravity", "friction_loss")])
def test_engines_that_do_not_report_are_not_judged(reported: tuple[str, ...]) -> None:
    """No balance without all channels; a single loss that is given is held to it."""
    history = run(CD, contacts="rigid")
    silent = replace(history, energy={name: history.energy[name] for name in reported})
    info = replace(DEM.info(), id="other", reference=False)
    given = resolve(CASE, {**SHORT, "contacts": "rigid"}).params
    setup = CASE.build(given)
    observed = CASE.observe(given, setup, silent)
    bound = {c.quantity for c in CASE.checks(given, setup, observed, info) if np.isfinite(c.expected).any()}
    assert bound == {f"energy_{name}_fed" for name in LOSSES if name in reported}
    if "friction_loss" in reported:
        fed = replace(silent, energy={**silent.energy, "friction_loss": -silent.energy["friction_loss"]})
        assert failures(fed, info, contacts="rigid") == {"energy_friction_loss_fed"}
