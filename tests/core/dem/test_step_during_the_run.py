"""A contact step that later contacts make unstable ends the run; all others run as if nobody looked."""

from __future__ import annotations

import numpy as np
import pytest

from ninedisk.core import Cell, ContactLaw, Disks, Numerics, Scene, UnstableTimeStepError, Wall
from ninedisk.core.dem.critical import critical_time_step, packed_time_step
from ninedisk.core.dem.session import DemSession
from ninedisk.core.nurbs.mass import uniform_grain
from ninedisk.core.nurbs.shapes import ellipse

KN = 1e5
LAW = ContactLaw(kn=KN, ks=0.5 * KN, mu=0.5, beta=0.1)


def falling(law: ContactLaw = LAW, **changes: object) -> Scene:
    """60 disks that fall loosely into a box, where each has more contacts than at the start."""
    k = np.arange(60)
    x = np.column_stack([2.02 * (k % 6) + 0.1 * np.cos(k * k), 1.2 + 2.2 * (k // 6)])
    walls = tuple(
        Wall(name=name, point=point, normal=normal, law=law)
        for name, point, normal in (
            ("floor", (0.0, 0.0), (0.0, 1.0)),
            ("left", (-1.2, 0.0), (1.0, 0.0)),
            ("right", (11.5, 0.0), (-1.0, 0.0)),
        )
    )
    disks = Disks(x=x, radius=1.0, mass=1.0)
    return Scene(**{"disks": disks, "disk_disk": law, "walls": walls, "gravity": (0.0, -50.0), **changes})  # type: ignore[arg-type]


def session(scene: Scene, dt: float, steps: int = 2000, **changes: object) -> DemSession:
    every = {"sample_every": steps, **changes}
    return DemSession(scene, Numerics(dt=dt, contact_dt=dt, n_steps=steps, **every))  # type: ignore[arg-type]


@pytest.mark.parametrize("form", ["central", "lagged"])
def test_a_packing_that_the_first_step_does_not_bear_is_refused_during_the_run(form: str) -> None:
    scene = falling()
    critical = critical_time_step(scene, damping_form=form)  # type: ignore[arg-type]
    run = session(scene, 0.95 * critical, damping_form=form)
    with pytest.raises(UnstableTimeStepError) as caught:
        run.run()
    words = str(caught.value)
    for part in (
        f"contact_dt = {0.95 * critical:g} s",
        "exceeds the critical step",
        "at t = ",
        "stiffest at disk",
        "use at most",
    ):
        assert part in words
    assert float(words.split("critical step ")[1].split()[0]) < 0.95 * critical
    again = session(scene, 0.95 * critical, damping_form=form, allow_unstable=True)
    again.run()


def test_materials_rolling_springs_and_outlines_are_looked_at_too() -> None:
    """Outlines: ellipses in the place of the disks."""
    grain = uniform_grain(ellipse(1.0, 0.9), 1.0)
    plain = falling()
    grains = Disks(x=plain.disks.x, radius=grain.radius, mass=1.0, inertia=grain.inertia, outline=0)
    for scene in (
        falling(laws={("", ""): LAW}),
        falling(disks=grains, outlines=(ellipse(1.0, 0.9),)),
    ):
        with pytest.raises(UnstableTimeStepError, match="stiffest at disk"):
            session(scene, 0.95 * critical_time_step(scene)).run()


def test_a_cell_that_closes_on_its_disks_is_looked_at_too() -> None:
    x = 2.05 * np.array([[k % 6, k // 6] for k in range(36)], dtype=float) + 0.02 * np.cos(np.arange(72)).reshape(36, 2)
    scene = Scene(
        disks=Disks(x=x, radius=1.0, mass=1.0),
        disk_disk=LAW,
        cell=Cell(size=(12.3, 12.3), rate=((-1.0, 0.0), (0.0, -1.0))),
    )
    with pytest.raises(UnstableTimeStepError, match="stiffest at disk"):
        session(scene, 0.95 * critical_time_step(scene), 60).run()


def test_a_step_that_every_packing_bears_is_not_looked_at() -> None:
    scene = falling()
    packed = packed_time_step(scene)
    assert not session(scene, 0.999 * packed)._step.watched
    assert session(scene, 1.001 * packed)._step.watched
    assert not DemSession(scene, Numerics(dt=1e-2, n_steps=1))._step.watched


@pytest.mark.parametrize("threads", [1, 3])
def test_looking_changes_no_bit(threads: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """A step at which the bound fails and the packing is stable: each look goes on to the same bits as a run that nobody looks at."""
    monkeypatch.setattr("ninedisk.core.dem.session.SORT_FROM", 10)
    scene = falling()
    dt, looks = 0.55 * critical_time_step(scene), []
    look = DemSession._check_critical_step
    monkeypatch.setattr(DemSession, "_check_critical_step", lambda self: looks.append(1) or look(self))
    how = Numerics(dt=dt, contact_dt=dt, n_steps=600, sample_every=40)
    found = DemSession(scene, how, threads=threads).run()
    assert looks
    expected = DemSession(scene, how.replace(allow_unstable=True)).run()
    for name in ("x", "v", "angle", "omega"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
