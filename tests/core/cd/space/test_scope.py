"""What contact dynamics in space refuses by name, and what a step that fails says and leaves behind."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from solids import FLOOR, on_floor, rigid, steps

from ninedisk.core import (
    BehindWallError,
    Cell,
    ContactLaw,
    CoreError,
    InvalidNumericsError,
    InvalidSceneError,
    PlaneSegment,
    PlaneWall,
    Rolling,
    Spheres,
    SphereScene,
    simulate,
)
from ninedisk.core.cd.problem_files import read_problem
from ninedisk.core.cd.space.session import SpaceSession
from ninedisk.core.errors import InterruptedRunError, NonFiniteStateError, SolverNotConvergedError
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.engine import SupportLevel
from ninedisk.harness.engines.cd.adapter import ENGINE

BALL = {"x": [[0.0, 0.0, 0.5]], "radius": 0.5, "mass": 1.0}
LAW = rigid(mu=0.3)


def scene(law: ContactLaw = LAW, **changes: Any) -> SphereScene:
    return on_floor(law, **BALL).replace(**changes)


@pytest.mark.parametrize(
    ("make", "options", "words", "missing"),
    [
        (lambda: scene(ContactLaw(kn=1e6)), {}, "elastic contacts", Capability.LINEAR_CONTACT),
        (lambda: scene(ContactLaw(e_star=1e6)), {}, "Hertz' law", Capability.HERTZ_MINDLIN),
        (lambda: scene(replace(LAW, rolling=Rolling(model="constant", mu=0.1))), {}, "rolling resistance", Capability.ROLLING_CONSTANT),
        (lambda: scene(replace(LAW, twisting=Rolling(model="constant", mu=0.1))), {}, "twisting resistance", Capability.TWISTING_CONSTANT),
        (lambda: scene(replace(LAW, cohesion=1.0)), {}, "cohesion", Capability.COHESION_3D),
        (lambda: scene(walls=(), cell=Cell(size=(3.0, 3.0, 3.0))), {}, "a periodic cell", Capability.PERIODIC_CELL_3D),
        (lambda: scene(), {"regime": "quasi-static"}, "regime = 'quasi-static'", Capability.QUASI_STATIC),
        (lambda: scene(), {"energy_budget": True}, "energy_budget = True", Capability.ENERGY_BUDGET),
        (lambda: on_floor(LAW, x=[[0.0, 0.0, 0.5], [0.0, 0.9, 0.5]], radius=0.5, mass=1.0), {}, "overlap", None),
        (lambda: scene(), {"solver": "gauss-seidel"}, "solver = 'gauss-seidel'", None),
        (lambda: scene(), {"options": {"cd.relaxation": 1.2}}, "cd.relaxation = 1.2", None),
        (lambda: scene(), {"options": {"cd.contacts": "elastic"}}, "cd.contacts = elastic", None),
    ],
)  # fmt: skip
def test_what_is_lacking_is_named_by_the_run_and_by_the_engine(
    make: Any, options: dict[str, Any], words: str, missing: Capability | None
) -> None:
    numerics = steps(0.01, 1, **options)
    with pytest.raises(CoreError, match=words):
        simulate(make(), numerics, method="cd")
    support = ENGINE.supports(make(), numerics)
    assert support.level is SupportLevel.NO
    assert missing in support.missing if missing else any(words in note for note in support.notes)


def test_rigid_contacts_are_expressed_exactly() -> None:
    boxes = Spheres(x=[[0.0, 0.0, 0.5]], half_sizes=[[0.5, 0.5, 0.5]], mass=1.0)
    assert ENGINE.supports(scene(spheres=boxes), steps(0.01, 1)).level is SupportLevel.EXACT
    run = ENGINE.run(scene(), steps(0.01, 3), [(0, 1)])
    assert run.history.fn[1:, 0] == pytest.approx(9.81)
    assert run.settings["cd.tolerance"] == 1e-8
    assert run.settings["largest relative error"] < 1e-8


def test_a_run_that_was_saved_goes_on_to_the_same_bits(tmp_path: Path) -> None:
    numerics = steps(0.01, 8)
    ENGINE.save(scene(), numerics, [(0, 1)], 3, str(tmp_path / "run"))
    resumed, whole = ENGINE.resume(str(tmp_path / "run")).history, ENGINE.run(scene(), numerics, [(0, 1)]).history
    assert resumed.x.tobytes() == whole.x.tobytes()
    assert resumed.fn.tobytes() == whole.fn.tobytes()


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: scene(spheres=Spheres(x=np.zeros((0, 3)), radius=1.0, mass=1.0)), "the scene has no sphere"),
        (lambda: scene(spheres=Spheres(**{**BALL, "x": [[0.0, 0.0, 0.4]]})), "sphere 0 and wall 'floor' overlap by 0.1 m"),
        (lambda: scene(initial_shear={(0, 1): (1.0, 0.0, 0.0)}), "the initial shear force .* belongs to sphere 0 and wall 'floor'"),
        (lambda: scene(rigid(e=0.5)), "restitution = 0.5, but impact = 'theta' with theta = 1 gives"),
    ],
)  # fmt: skip
def test_bad_scenes_are_named(make: Any, words: str) -> None:
    with pytest.raises(InvalidSceneError, match=words):
        simulate(make(), steps(0.01, 1), method="cd")


def test_newtons_law_needs_a_restitution() -> None:
    with pytest.raises(InvalidSceneError, match="impact = 'newton' needs a restitution"):
        simulate(scene(), steps(0.01, 1, impact="newton"), method="cd")


def test_prescribed_motions_that_drive_bodies_into_each_other_are_named() -> None:
    down = PlaneSegment(velocity=(0.0, 0.0, -1.0))
    roof = PlaneWall(name="roof", point=(0.0, 0.0, 1.0), normal=(0.0, 0.0, -1.0), law=LAW, motion=(down,))
    held = Spheres(**BALL, held=True)
    with pytest.raises(InvalidSceneError, match=r"^step 1 .*bodies 0 and 1 are driven into each other"):
        simulate(scene(spheres=held, walls=(roof,)), steps(0.01, 1), method="cd")


def test_a_step_that_fails_says_so_and_keeps_its_problem(tmp_path: Path) -> None:
    column = on_floor(
        LAW, x=[[0.0, 0.0, 0.5], [0.1, 0.0, 1.4949874371066198], [0.0, 0.1, 2.4899748742132395]], radius=0.5, mass=1.0
    )
    path = tmp_path / "failed.npz"
    options = {"cd.max_iterations": 2, "cd.tolerance": 1e-14, "cd.save_failed": str(path)}
    session = SpaceSession(column, steps(0.01, 2, options=options))
    with pytest.raises(SolverNotConvergedError, match=r"^step 1 \(t = 0.01 s\): .*largest relative error") as caught:
        session.run()
    assert caught.value.iterations >= 1
    assert caught.value.residuals is not None
    assert caught.value.residuals.worst > 1e-14
    assert read_problem(path).problem.dimension == 3
    with pytest.raises(SolverNotConvergedError):
        session.run()
    loose = SpaceSession(column, steps(0.01, 1, options={**options, "cd.accept": 0.9}))
    loose.run()
    assert [step for step, _ in loose.loose] == [1]
    assert "1 of 1 steps missed the tolerance 1e-14" in loose.remarks[-1]


def test_states_that_cannot_be_are_named() -> None:
    with pytest.raises(NonFiniteStateError, match=r"^step 1 .*sphere 0 is no finite number"):
        simulate(scene(gravity=(0.0, 0.0, 1e308)), steps(100.0, 3), method="cd")
    up = PlaneSegment(velocity=(0.0, 0.0, 1.0))
    floor = PlaneWall(**FLOOR, law=LAW, motion=(up,))  # type: ignore[arg-type]
    free = Spheres(x=[[0.0, 0.0, 0.5]], radius=0.5, mass=1.0, held=[[False, True, True]])
    with pytest.raises((BehindWallError, InvalidSceneError)):
        simulate(scene(spheres=free, walls=(floor,)), steps(1.0, 2), method="cd")
    with pytest.raises(InvalidNumericsError, match="so far from the origin that gaps are rounded"):
        simulate(scene(spheres=Spheres(**{**BALL, "x": [[1e9, 0.0, 0.5]]})), steps(1e-5, 1), method="cd")


def test_a_run_that_is_interrupted_is_over() -> None:
    session = SpaceSession(scene(), steps(0.01, 3))

    def stop(*_: Any) -> None:
        raise KeyboardInterrupt

    session._advance = stop  # type: ignore[method-assign]
    with pytest.raises(KeyboardInterrupt):
        session.run()
    with pytest.raises(InterruptedRunError, match="stopped inside a step after step 0"):
        session.run()
