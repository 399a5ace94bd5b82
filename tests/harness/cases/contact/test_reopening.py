"""A rough contact that opens and closes again: the matrix on both in-house engines, defects that must be seen."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from ninedisk.harness.api.case import ParameterError
from ninedisk.harness.api.engine import Difference
from ninedisk.harness.api.params import resolve
from ninedisk.harness.cases.contact.reopening import CASE
from ninedisk.harness.engines.cd.adapter import ENGINE as CD
from ninedisk.harness.engines.dem.adapter import ENGINE as DEM

DISKS, WALL = {"pair": "disks"}, {"pair": "wall", "arm": "overlap"}


@pytest.mark.parametrize("params", CASE.matrix(), ids=lambda params: resolve(CASE, params).id)
def test_the_matrix_passes(run_cell, params):
    for engine in (CD, DEM):
        cell = run_cell(CASE, engine, params)
        assert cell.failures == [], engine.id
        # Of a first-order scheme's forces the bounds say little after four contacts, and where they say nothing there is no check.
        assert len(cell.checks) >= (17 if engine is DEM else 2)
        assert "fs" in {check.quantity for check in cell.checks}


def test_the_contact_closes_twice_and_its_shear_force_starts_anew(run_cell):
    for params in (DISKS, WALL):
        fs = run_cell(CASE, DEM, params).observed.series["fs"][1]
        closed = fs != 0.0
        starts = np.flatnonzero(closed[1:] & ~closed[:-1]) + 1
        assert len(starts) == 2
        assert fs[starts[1]] == pytest.approx(fs[starts[0]], rel=1e-4)
        assert np.abs(fs).max() > 50.0 * abs(fs[starts[1]])


def kept(history):
    """The second contact goes on from where the first one ended."""
    column = history.fs[:, 0]
    last = np.flatnonzero(column)
    end = int(last[np.flatnonzero(np.diff(last) > 1)[0]])
    column[end + 1 :] += np.where(column[end + 1 :] != 0.0, column[end], 0.0)


@pytest.mark.parametrize(
    ("spoil", "names"),
    [
        (kept, {"fs"}),
        (lambda h: h.angle.__imul__(-1.0), {"angle_first", "angle_last"}),
        (lambda h: h.angle.__setitem__(slice(None), h.angle[:, ::-1].copy()), {"angle_first", "angle_last"}),
        (lambda h: h.wall_force.__imul__(-1.0), {"load_ceiling", "load_floor"}),
        (lambda h: [series.__imul__(2.0) for series in h.energy.values()], {"energy_kinetic", "energy_elastic"}),
        (lambda h: h.energy["elastic"].__setitem__(slice(None), np.nan), {"energy_elastic"}),
        (lambda h: h.fn.__imul__(1.0 + 1e-8), {"fn", "fn_smooth"}),
    ],
    ids=["kept", "turned-round", "exchanged", "loads", "energies", "untold", "scale"],
)
def test_defects_are_seen(run_cell, spoil, names):
    assert names <= run_cell(CASE, DEM, DISKS, spoil).seen


def test_shear_that_is_kept_is_seen_at_a_wall_and_on_engines_without_exact_steps(run_cell):
    assert "fs" in run_cell(CASE, DEM, WALL, kept).seen
    assert "fs" in run_cell(CASE, CD, DISKS, kept).seen


def test_what_another_engine_does_not_report_is_not_judged_and_what_it_is_known_to_keep_is_excused(
    run_cell, judge_history, scheme_info
):
    cell = run_cell(CASE, DEM, DISKS, kept)
    other = dataclasses.replace(
        scheme_info("central-difference", "spring"),
        capabilities=DEM.info().capabilities,
        differences={Difference.KEEPS_OPENED_SHEAR: "it keeps"},
    )
    silent = dataclasses.replace(cell.history, energy={})
    judged = judge_history(CASE, other, DISKS, silent)
    assert {text.split()[2] for text in judged.failures if text.startswith("energy")} == {"no-truth"}
    assert judged.known == {"fs": "imaginary/opened-contact-keeps-shear"}
    silent.fs[:] *= 1.5
    assert "fs" in judge_history(CASE, other, DISKS, silent).seen


def test_a_step_that_is_too_long_is_refused():
    with pytest.raises(ParameterError, match=r"dt = 0\.01 s is not allowed: a contact must last many steps"):
        CASE.build(resolve(CASE, {"dt": 0.01}).params)
