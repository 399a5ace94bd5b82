"""What a run gives back: shapes, times, columns."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import KN, numerics

from ninedisk.core import ContactLaw, Disks, History, Numerics, Scene, Wall, simulate
from ninedisk.core.dem.session import DemSession

LAW = ContactLaw(kn=KN, ks=KN / 2, mu=0.5, beta=0.1)


def falling(n: int = 5, walls: int = 2) -> Scene:
    x = np.array([[1.9 * k, 0.95 + 0.1 * k] for k in range(n)])
    planes = [((0.0, 0.0), (0.0, 1.0)), ((-0.95, 0.0), (1.0, 0.0)), ((1.9 * n, 0.0), (-1.0, 0.0))]
    return Scene(
        disks=Disks(x=x, omega=3.0, radius=1.0, mass=1.0),
        disk_disk=LAW,
        walls=[Wall(name=str(k), point=p, normal=u, law=LAW) for k, (p, u) in enumerate(planes[:walls])],
        gravity=(1.0, -9.0),
    )


def assert_shapes(h: History, s: int, n: int, m: int, c: int) -> None:
    expected = {
        "step": (s,),
        "t": (s,),
        "x": (s, n, 2),
        "v": (s, n, 2),
        "angle": (s, n),
        "omega": (s, n),
        "gap": (s, c),
        "fn": (s, c),
        "fs": (s, c),
        "wall_point": (s, m, 2),
        "wall_angle": (s, m),
        "wall_force": (s, m, 2),
    }
    assert {name: getattr(h, name).shape for name in expected} == expected
    assert {value.shape for value in h.energy.values()} <= {(s,)}
    assert h.step.dtype == np.int64
    assert {getattr(h, name).dtype for name in expected if name != "step"} == {np.dtype(float)}
    assert len(h.pairs) == c


@pytest.mark.parametrize("n", [1, 5])
@pytest.mark.parametrize("walls", [0, 2])
@pytest.mark.parametrize("watch", [0, 1])
def test_shapes_and_values_that_are_never_left_out(n: int, walls: int, watch: int) -> None:
    scene = falling(n, walls)
    pairs = [(0, 1)] * watch if n + walls > 1 else []
    history = simulate(scene, Numerics(dt=1e-3, contact_dt=2.5e-4, n_steps=10, sample_every=4), pairs)
    assert_shapes(history, 4, n, walls, len(pairs))
    # Regular samples, and the last step though it is none of them.
    assert history.step.tolist() == [0, 4, 8, 10]
    np.testing.assert_array_equal(history.t, np.array([0, 16, 32, 40]) * 2.5e-4)
    assert history.particles == tuple(range(n))
    assert history.force_meaning == "instantaneous"
    arrays = [value for value in vars(history).values() if isinstance(value, np.ndarray)]
    assert all(np.isfinite(value).all() for value in (*arrays, *history.energy.values()))
    np.testing.assert_array_equal(history.x[0], scene.disks.x)
    np.testing.assert_array_equal(history.v[0], scene.disks.v)
    np.testing.assert_array_equal(history.omega[0], scene.disks.omega)
    np.testing.assert_array_equal(history.angle[0], 0.0)
    np.testing.assert_array_equal(history.wall_point[0], np.reshape([w.point for w in scene.walls], (walls, 2)))


@pytest.mark.parametrize(
    ("window", "expected"),
    [
        ({}, list(range(11))),
        ({"sample_every": 3}, [0, 3, 6, 9, 10]),
        ({"sample_from": 4, "sample_every": 3}, [0, 4, 7, 10]),
        ({"sample_from": 2, "sample_until": 4}, [0, 2, 3, 4, 10]),
        ({"sample_from": 7, "sample_until": 3}, [0, 10]),
        ({"sample_from": 99}, [0, 10]),
        ({"sample_until": 99, "sample_every": 99}, [0, 10]),
    ],
)
def test_sampled_steps(window: dict[str, int], expected: list[int]) -> None:
    history = simulate(falling(), Numerics(dt=1e-4, n_steps=10, **window))
    assert history.step.tolist() == expected
    assert_shapes(history, len(expected), 5, 2, 0)


def test_chosen_particles_and_watched_pairs_are_columns_of_the_full_run_to_the_bit() -> None:
    scene, how = falling(), numerics(1e-3, 40)
    full = simulate(scene, how, [(0, 1), (1, 2), (0, 5), (0, 6)])
    part = simulate(scene, how.replace(sample_every=8), [(0, 6), (1, 2)], particles=[3, 1])
    rows = part.step
    assert part.particles == (3, 1)
    for name in ("x", "v", "angle", "omega"):
        np.testing.assert_array_equal(getattr(part, name), getattr(full, name)[rows][:, [3, 1]])
    for name in ("gap", "fn", "fs"):
        np.testing.assert_array_equal(getattr(part, name), getattr(full, name)[rows][:, [3, 1]])
    np.testing.assert_array_equal(part.wall_force, full.wall_force[rows])
    for name, value in part.energy.items():
        np.testing.assert_array_equal(value, full.energy[name][rows])
    assert np.abs(full.fs).max() > 1.0


def test_no_particles() -> None:
    history = simulate(falling(), numerics(1e-3, 3), particles=[])
    assert history.particles == ()
    assert_shapes(history, 4, 0, 2, 0)


def test_column_of_a_pair() -> None:
    history = simulate(falling(), numerics(1e-3, 1), [(1, 2), (0, 5)])
    assert [history.contact(pair) for pair in history.pairs] == [0, 1]
    with pytest.raises(KeyError, match=r"pair \(0, 1\) was not watched; watched: \(\(1, 2\), \(0, 5\)\)"):
        history.contact((0, 1))


def test_history_of_an_unfinished_run_holds_what_was_sampled() -> None:
    session = DemSession(falling(), numerics(1e-3, 20))
    session._advance(7)
    assert_shapes(session.history(), 8, 5, 2, 0)
    assert session.history().step.tolist() == list(range(8))
    assert_shapes(session.run(), 21, 5, 2, 0)


def test_empty_history_is_all_nan_and_of_the_right_shapes() -> None:
    steps = np.arange(0, 9, 4)
    history = History.empty(
        steps,
        steps * 0.1,
        n_disks=3,
        n_walls=2,
        pairs=((0, 1),),
        force_meaning="step-mean",
        energies=("kinetic", "elastic"),
    )
    assert_shapes(history, 3, 3, 2, 1)
    assert history.force_meaning == "step-mean"
    assert history.particles is None
    assert list(history.energy) == ["kinetic", "elastic"]
    filled = [
        value for name, value in vars(history).items() if isinstance(value, np.ndarray) and name not in ("step", "t")
    ]
    assert all(np.isnan(value).all() and value.size for value in (*filled, *history.energy.values()))
    # Separate arrays: an engine writes one without touching another.
    history.fn[:] = 1.0
    assert np.isnan(history.fs).all()
    assert_shapes(History.empty(steps, steps * 0.1, n_disks=1, n_walls=0, pairs=()), 3, 1, 0, 0)
