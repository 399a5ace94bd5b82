"""The roofline estimate: work as the kernels really do it, roofs that probes really reach."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ninedisk.core import ContactLaw, Disks, Scene, Wall
from ninedisk.core.dem import force_kernels, kick_kernels
from ninedisk.core.dem import force_kernels as pair_kernels
from ninedisk.core.dem.session import DemSession
from ninedisk.core.numerics import Numerics
from ninedisk.harness.bench import dem_suite, roofline
from ninedisk.harness.bench.dem_problems import DemProblem
from ninedisk.harness.bench.dem_work import counted, mean_counts
from ninedisk.harness.bench.kernel_work import work_of

LAW = ContactLaw(kn=1e6, ks=8e5, mu=0.3, beta=0.2)
SMOOTH, UNDAMPED = replace(LAW, mu=0.0), replace(LAW, beta=0.0)
COLUMNS, ROWS = 10, 8


class Number(float):
    """A float that counts what is done with it."""

    done = 0

    @staticmethod
    def counting(name: str) -> Any:
        plain = getattr(float, name)

        def operation(self: Number, other: float) -> Number:
            Number.done += 1
            return Number(plain(self, other))

        return operation

    def __neg__(self) -> Number:
        return Number(-float(self))


for _name in ("add", "sub", "mul", "truediv"):
    setattr(Number, f"__{_name}__", Number.counting(f"__{_name}__"))
    setattr(Number, f"__r{_name}__", Number.counting(f"__r{_name}__"))


class Single(Number):
    """One in single precision, whose bits kernels read as a whole number."""

    dtype = np.dtype(np.float32)

    def __new__(cls, value: float) -> Single:
        return super().__new__(cls, np.float32(value))

    def view(self, kind: type) -> Any:
        return np.float32(self).view(kind)


def counted_root(value: float) -> Number:
    Number.done += 1
    return Number(math.sqrt(value))


def larger(a: float, b: float) -> Number:
    """What is done with a 0 that wins is counted, too."""
    return Number(max(a, b))


class Memory:
    """Entries of arrays, by the name of their memory: how often each has been read and written."""

    def __init__(self) -> None:
        self.kept: dict[str, list[Any]] = {}
        self.sizes: dict[str, int] = {}
        self.read: Counter[tuple[str, int]] = Counter()
        self.written: Counter[tuple[str, int]] = Counter()

    def array(self, name: str, values: np.ndarray) -> Watched:
        floats = values.dtype.kind == "f"
        self.kept.setdefault(name, [Number(v) if floats else int(v) for v in values.ravel()])
        self.sizes[name] = values.itemsize
        return Watched(self, name, values.shape)

    def group(self, prefix: str, arrays: Any) -> Any:
        return type(arrays)(**{name: self.array(prefix + name, value) for name, value in arrays._asdict().items()})

    def bytes(self, touched: Counter[tuple[str, int]]) -> int:
        """Of disks and lists, each entry once; the few numbers of the walls, pointers into the lists and the scratch are left out."""
        left_out = ("walls.", "wall_pairs.start", "pairs.start", "scratch")
        return sum(self.sizes[name] for name, _ in touched if not name.startswith(left_out))

    def times(self, touched: Counter[tuple[str, int]], name: str) -> int:
        """How often entries of ``name`` were touched."""
        return sum(count for (each, _), count in touched.items() if each == name)


class Watched:
    """An array in a `Memory`."""

    def __init__(self, memory: Memory, name: str, shape: tuple[int, ...]) -> None:
        self.memory, self.name, self.shape = memory, name, shape

    def _place(self, key: Any) -> int:
        keys = [int(k) for k in key] if isinstance(key, tuple) else [int(key)]
        return int(np.ravel_multi_index(keys, self.shape))

    def __getitem__(self, key: Any) -> Any:
        self.memory.read[self.name, self._place(key)] += 1
        return self.memory.kept[self.name][self._place(key)]

    def __setitem__(self, key: Any, value: Any) -> None:
        self.memory.written[self.name, self._place(key)] += 1
        self.memory.kept[self.name][self._place(key)] = Number(value) if isinstance(value, float) else value


def lattice(law: ContactLaw, gap: float) -> Scene:
    """Disks in rows and columns, with columns ``gap`` apart, in a corner; more pairs than a chunk takes."""
    x = np.array([((2.0 + gap) * i + 0.99, 1.98 * j + 0.99) for i in range(COLUMNS) for j in range(ROWS)])
    walls = [
        Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law),
        Wall(name="left", point=(0.0, 0.0), normal=(1.0, 0.0), law=law),
    ]
    return Scene(disks=Disks(x=x, radius=1.0, mass=1.0), disk_disk=law, walls=walls, gravity=(0.0, -10.0))


def step_by_hand(session: DemSession, monkeypatch: pytest.MonkeyPatch) -> Memory:
    """One step of the kernels' own sources on numbers that count."""
    for module in (force_kernels, pair_kernels, kick_kernels):
        for name, value in list(vars(module).items()):
            monkeypatch.setattr(module, name, getattr(value, "py_func", value))
    for module in (force_kernels, pair_kernels):
        monkeypatch.setattr(module, "sqrt", counted_root)
        monkeypatch.setattr(module, "max", larger, raising=False)
    numbers = SimpleNamespace(float32=Single, int32=np.int32, uint64=np.uint64)
    monkeypatch.setattr(kick_kernels, "np", numbers)
    memory, lists, views = Memory(), session._lists, session._views
    disks = memory.group("", session._disks)
    seen = "v_now" if len(session._disks.v_now) else "v"
    watched = type(views)(
        **{name: memory.array(seen if name == "dashpot_v" else name, value) for name, value in views._asdict().items()}
    )
    scratch = memory.array("scratch", session._team.scratch[0])
    walls = memory.group("walls.", session._walls)._replace(law=session._walls.law.astype(object))
    pairs, wall_pairs = memory.group("pairs.", lists.pairs), memory.group("wall_pairs.", lists.wall_pairs)
    n, dt, kick = len(session.scene.disks), session.contact_dt, session._step.kick
    Number.done = 0
    force_kernels.disk_wall_forces(disks, walls, wall_pairs, dt, 0, n, 0)
    pair_kernels.disk_disk_forces(disks, watched, pairs, session._law.astype(object), dt, 0, n, scratch)
    kick_kernels.kick_and_drift(disks, watched, type(kick)(*map(Number, kick)), 0, n)
    return memory


@pytest.mark.parametrize(
    ("law", "form", "gap"),
    [
        (LAW, "lagged", -0.02),
        (LAW, "lagged", 0.01),
        (LAW, "central", -0.02),
        (SMOOTH, "lagged", -0.02),
        (UNDAMPED, "central", 0.01),
    ],
)
def test_work_is_what_the_kernels_do(law: ContactLaw, form: Any, gap: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every operation and every byte of one step, counted while the kernels' sources run; some listed pairs do not touch."""
    scene, numerics = lattice(law, gap), Numerics(dt=1e-4, contact_dt=1e-4, n_steps=1, damping_form=form)
    session = DemSession(scene, numerics)
    counts, n = session.counts, len(scene.disks)
    upright, sideways = COLUMNS * (ROWS - 1), (COLUMNS - 1) * ROWS
    assert counts.pairs == upright + sideways > pair_kernels.CHUNK
    assert counts.contacts == upright + sideways * (gap < 0.0)
    assert counts.wall_pairs == counts.wall_contacts == COLUMNS + ROWS
    work = work_of(scene, numerics, counts)
    memory = step_by_hand(session, monkeypatch)
    assert Number.done == round(work.flops * n)
    if law is not SMOOTH:  # smooth walls leave the shear forces of their contacts alone
        assert memory.bytes(memory.read) == round(work.held * n)
        assert memory.bytes(memory.read) + memory.bytes(memory.written) == round(work.traffic * n)
    ahead = form == "central" and law.beta > 0.0
    assert memory.times(memory.written, "scratch") == (11 + 2 * ahead) * counts.pairs
    assert memory.times(memory.read, "scratch") == 14 * counts.pairs
    assert len({place for name, place in memory.written if name == "scratch"}) == (7 + 2 * ahead) * pair_kernels.CHUNK
    assert memory.times(memory.read, "pairs.start") == 2


def test_operations_and_bytes_too_many_are_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """Kernels that do one operation more for each pair, out of contact or not, and look at one array more."""
    scene, numerics = lattice(LAW, 0.01), Numerics(dt=1e-4, contact_dt=1e-4, n_steps=1, damping_form="lagged")
    session = DemSession(scene, numerics)
    work, n, pairs = work_of(scene, numerics, session.counts), len(scene.disks), session.counts.pairs
    shear_force, gather = force_kernels.shear_force.py_func, pair_kernels.gather.py_func

    def looks_at_names(disks: Any, *others: Any) -> None:
        gather(disks, *others)
        assert disks.name[0] + 1 > 0

    monkeypatch.setattr(pair_kernels, "shear_force", lambda before, *others: shear_force(before + 0.0, *others))
    monkeypatch.setattr(pair_kernels, "gather", looks_at_names)
    memory = step_by_hand(session, monkeypatch)
    assert Number.done == round(work.flops * n) + pairs
    assert memory.bytes(memory.read) == round(work.held * n) + 4


def test_counts_are_means_over_the_very_run(settled: DemProblem) -> None:
    problem = replace(settled, steps=200, short=False)
    session = DemSession(problem.scene, problem.numerics(), particles=[0])
    session.run()
    last = session.counts
    means = mean_counts(problem)
    assert means.rebuilds == last.rebuilds
    assert means.contacts == pytest.approx(last.contacts, rel=0.1)
    assert means.pairs >= means.contacts
    same, columns = counted(problem)
    assert same == means
    assert columns["listed_pairs"] == means.pairs + means.wall_pairs
    assert columns["contacts"] == means.contacts + means.wall_contacts


def test_packings_at_rest_have_the_estimate_and_flowing_ones_their_counts(settled: DemProblem) -> None:
    rest, flow = (replace(settled, short=False, steps=50, name=name) for name in ("settled-60", "flowing-60"))
    first, second = (
        dem_suite.run_problem(each, {}, repeats=1, time_limit=60.0, tell=lambda _: None)[0] for each in (rest, flow)
    )
    assert first["rebuilds"] == second["rebuilds"] == 0  # 50 steps at rest: the lists that the session began with
    assert first["listed_pairs"] >= first["contacts"] > 60
    assert first["working_set"] == pytest.approx(60 * 140, rel=0.2)
    assert first["rate"] * first["flops"] < first["flop_rate"]
    assert first["flop_rate_single"] < first["flop_rate"]
    assert first["rate"] * first["traffic"] < first["bandwidth"]
    assert math.isnan(second["flops"])
    assert math.isnan(second["bandwidth"])


def test_probes_compute_what_they_are_timed_for() -> None:
    """Each result against NumPy: nothing has been optimised away."""
    a, b = np.linspace(0.0, 1.0, 100), np.linspace(2.0, 3.0, 100)
    expected = a + 3 * 0.25 * b
    roofline.triad(a, b, 0.25, 3)
    np.testing.assert_allclose(a, expected, rtol=1e-15)
    x = np.linspace(1.0, 2.0, 9)
    fixed = x.copy()
    for _ in range(2 * roofline.CHAIN):
        fixed = 0.5 * fixed + 0.75
    roofline.multiply_add(x, 0.5, 0.75, 2)
    np.testing.assert_allclose(x, fixed, rtol=1e-15)
    y = np.linspace(1.0, 2.0, 8)
    expected = 0.25 * y + 0.5 * 0.75 + 0.75
    roofline.multiply_add_single(y, 0.5, 0.75, 2)
    np.testing.assert_allclose(y, expected, rtol=1e-15)
    expected = 0.5 + 1.0 / np.sqrt(0.5 + 1.0 / np.sqrt(b))
    roofline.roots(b, 0.5, 2)
    np.testing.assert_allclose(b, expected, rtol=1e-15)


@pytest.mark.timing
def test_roofs_lie_one_above_the_other() -> None:
    roofs = roofline.measure(1e5)
    assert roofs.flop_rate > roofs.flop_rate_single > roofs.root_rate > 1e7
    assert roofs.bandwidth_cached > roofs.bandwidth_memory > 1e8
    assert roofs.bandwidth > roofs.bandwidth_memory


def test_the_best_of_many_repeats_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    """A run of 2 ms now and then takes 5: others were at work."""
    clock = SimpleNamespace(now=0.0, calls=0)

    def run(rounds: int) -> None:
        clock.calls += 1
        clock.now += rounds * (5e-3 if clock.calls % 3 else 2e-3)

    monkeypatch.setattr(roofline.time, "perf_counter", lambda: clock.now)
    assert roofline.best(partial(run), 10.0) == pytest.approx(10.0 / 2e-3)
    assert 8 <= clock.calls <= 20


def test_cache_sizes_are_read_as_the_system_writes_them(tmp_path: Path) -> None:
    assert roofline.cache_sizes(tmp_path / "nowhere") == (roofline.LEVEL_2, roofline.LAST_LEVEL)
    for k, (level, size) in enumerate([("1", "48K"), ("1", "32K"), ("2", "1280K"), ("3", "54M"), ("x", "1K")]):
        folder = tmp_path / f"index{k}"
        folder.mkdir()
        (folder / "level").write_text(f"{level}\n")
        (folder / "size").write_text(f"{size}\n")
    assert roofline.cache_sizes(tmp_path) == (1280 << 10, 54 << 20)
