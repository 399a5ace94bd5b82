"""Pushed row: the matrix on both in-house engines, defects that must be seen, contacts that would open."""

from __future__ import annotations

import numpy as np
import pytest

from ninedisk.harness.api.case import ParameterError
from ninedisk.harness.api.params import resolve
from ninedisk.harness.cases.chain.row_pushed import CASE
from ninedisk.harness.engines.cd.adapter import ENGINE as CD
from ninedisk.harness.engines.dem.adapter import ENGINE as DEM

WAVE, DAMPED = {"xi": 0.0, "g": 0.0}, {"xi": 300.0, "g": 10.0}


def test_substeps_and_the_other_form_have_exact_steps_too(run_cell):
    for extra in ({"substeps": 4}, {"damping_form": "lagged"}):
        cell = run_cell(CASE, DEM, {**DAMPED, "steps": 300, **extra})
        assert not [text for text in cell.failures if "exact-step" in text]


def test_the_wave_reaches_the_stop_when_it_should(run_cell):
    """At sqrt(kn/m) disks a second: nothing of the push before half of five disks' time, more than half of it at its double."""
    stop = run_cell(CASE, DEM, WAVE).observed.series["fn_stop"][1]
    assert abs(stop[25] - 100.0) < 0.2
    assert stop[80] > 110.0


@pytest.mark.long
@pytest.mark.parametrize(
    ("spoil", "seen"),
    [
        (lambda h: h.fn.__setitem__((slice(1, None), 2), h.fn[:-1, 2].copy()), {"fn_link_2"}),
        (lambda h: h.fn.__imul__(1 + 1e-7), {"fn_push", "fn_stop"}),
        (lambda h: h.x.__setitem__((-1, 2, 1), 1e-12), {"across"}),
        (lambda h: h.fn.__setitem__((100, 3), np.nan), {"fn_link_3"}),
    ],
    ids=["late", "scale", "across", "missing"],
)
@pytest.mark.parametrize("params", [WAVE, DAMPED], ids=["wave", "damped"])
def test_defects_are_seen(run_cell, spoil, seen, params):
    for engine in (CD, DEM):
        assert seen <= run_cell(CASE, engine, params, spoil).seen, engine.id


def test_a_lost_settled_force_is_seen(run_cell):
    cell = run_cell(CASE, DEM, DAMPED, lambda h: h.fn[-1:].__iadd__(1e-5))
    assert {"fn_push_settled", "fn_link_4_settled"} <= cell.seen


def test_contacts_that_would_open_are_refused():
    with pytest.raises(ParameterError, match="a contact would open"):
        CASE.build(resolve(CASE, {"speed": -1.0}).params)
