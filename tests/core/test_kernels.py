"""What the decorator of the kernels promises: no allocation, and machine code that is kept, found again and never stale."""

from __future__ import annotations

import importlib
import json
import os
import pkgutil
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest
from numba.core.registry import CPUDispatcher

import ninedisk
from ninedisk import core
from ninedisk.core.compile import FUSED, OPTIONS, fused_inline_kernel, inline_kernel, source_hash

compiled = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")


@compiled
def test_a_kernel_cannot_allocate() -> None:
    """An array that a kernel would make needs Numba's runtime, which kernels are compiled without."""

    @inline_kernel
    def total(n: int) -> float:
        made = np.zeros(n)
        return made.sum()

    with pytest.raises(numba.core.errors.NumbaError):
        total.compile((numba.int64,))


@compiled
def test_a_kernel_of_kernels_is_refused_to_python() -> None:
    """It has no wrapper; without a refusal Numba would jump to where none is, compiled or not."""

    @inline_kernel
    def half(x: float) -> float:
        return 0.5 * x

    with pytest.raises(TypeError, match="half is for kernels to call"):
        half(3.0)
    assert numba.njit(lambda x: half(x))(3.0) == 1.5
    with pytest.raises(TypeError, match="half is for kernels to call"):
        half(3.0)


@compiled
def test_every_function_of_dem_and_shapes_that_is_compiled_is_such_a_kernel() -> None:
    for package in ("dem.plane", "dem.space", "nurbs", "shapes"):
        found = 0
        folder = Path(core.__file__).parent.joinpath(*package.split("."))
        for module in pkgutil.iter_modules([str(folder)], f"ninedisk.core.{package}."):
            for value in vars(importlib.import_module(module.name)).values():
                if isinstance(value, CPUDispatcher):
                    options = {name: value.targetoptions.get(name) for name in OPTIONS}
                    assert options in (OPTIONS, OPTIONS | FUSED), value
                    found += 1
        assert found > 20, package


@compiled
def test_arithmetic_of_a_kernel_does_not_depend_on_who_calls_it_first() -> None:
    """Rounded twice, 1 - 2^-60 - 1 is 0; fused, as the first caller's arithmetic is, it would be -2^-60."""

    @inline_kernel
    def product_and_sum(a: float, b: float, c: float) -> float:
        return a * b + c

    @fused_inline_kernel
    def by_a_fused_one(a: float, b: float, c: float) -> float:
        return product_and_sum(a, b, c)

    @inline_kernel
    def by_a_plain_one(a: float, b: float, c: float) -> float:
        return product_and_sum(a, b, c)

    numbers = (1.0 + 2.0**-30, 1.0 - 2.0**-30, -1.0)
    assert numba.njit(lambda a, b, c: by_a_fused_one(a, b, c))(*numbers) == 0.0
    assert numba.njit(lambda a, b, c: by_a_plain_one(a, b, c))(*numbers) == 0.0


PROGRAM = """
import json
import sys
import numba
before = numba.config.CACHE_DIR
from ninedisk.core import ContactLaw, Wall
from ninedisk.core.scene.motion import compile_motion, wall_poses
from ninedisk.core.scene.motion_kernels import place_walls
wall = Wall(name="w", point=(3.0, 2.0), normal=(0.0, 1.0), law=ContactLaw(kn=1.0))
pose = wall_poses(compile_motion([wall]), 1.0)
stats = place_walls.stats
print(json.dumps({
    "hits": sum(stats.cache_hits.values()),
    "misses": sum(stats.cache_misses.values()),
    "path": stats.cache_path,
    "pose": pose[0, :4].tolist(),
    "numba": [before, numba.config.CACHE_DIR],
    "core": sys.modules[Wall.__module__].__file__,
}))
"""


def in_fresh_processes(count: int, **environment: str) -> list[dict[str, object]]:
    """Place a wall with the compiled kernel, in several processes at once, and report where its machine code came from."""
    clean = {name: value for name, value in os.environ.items() if name not in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")}
    command = [sys.executable, "-c", PROGRAM]
    begun = [
        subprocess.Popen(command, env={**clean, **environment}, stdout=subprocess.PIPE, text=True) for _ in range(count)
    ]
    said = [process.communicate(timeout=120)[0] for process in begun]
    assert [process.returncode for process in begun] == [0] * count
    answers: list[dict[str, object]] = [json.loads(text) for text in said]
    assert all(answer["pose"] == [3.0, 2.0, 0.0, 1.0] for answer in answers)
    return answers


def in_a_fresh_process(**environment: str) -> dict[str, object]:
    return in_fresh_processes(1, **environment)[0]


def assert_kept(base: Path, first: dict[str, object]) -> None:
    """In the folder of this very source, and nothing beside it."""
    own = base / source_hash(Path(core.__file__).parent)
    assert Path(str(first["path"])).is_relative_to(own)
    assert [path.name for path in base.iterdir()] == [own.name]
    assert list(own.rglob("*place_walls*.nbc"))
    # Numba's own setting is the user's: functions of others are not kept among ours.
    before, after = first["numba"]  # type: ignore[misc]
    assert before == after


@compiled
def test_machine_code_is_kept_among_the_users_caches(tmp_path: Path) -> None:
    first = in_a_fresh_process(XDG_CACHE_HOME=str(tmp_path))
    assert (first["hits"], first["misses"]) == (0, 1)
    assert_kept(tmp_path / "ninedisk" / "numba", first)


@compiled
def test_a_kernel_is_compiled_once_for_all_processes_and_copies(tmp_path: Path) -> None:
    """Of two processes that find nothing one compiles; the same sources elsewhere load what it left."""
    kept = {"NUMBA_CACHE_DIR": str(tmp_path / "kernels")}
    answers = in_fresh_processes(2, **kept)
    assert sorted((answer["hits"], answer["misses"]) for answer in answers) == [(0, 1), (1, 0)]
    assert_kept(tmp_path / "kernels", answers[0])
    copy = tmp_path / "elsewhere" / "ninedisk"
    shutil.copytree(Path(core.__file__).parent, copy / "core", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ninedisk.__file__, copy)
    answer = in_a_fresh_process(PYTHONPATH=str(copy.parent), **kept)
    assert (answer["hits"], answer["misses"]) == (1, 0)
    assert Path(str(answer["core"])).is_relative_to(copy)


@compiled
def test_where_nothing_can_be_kept_the_kernels_still_run(tmp_path: Path) -> None:
    """The cache's place is a file: a temporary folder serves, which nobody else can read or write."""
    taken, temporary = tmp_path / "taken", tmp_path / "tmp"
    taken.write_text("not a folder")
    temporary.mkdir()
    answer = in_a_fresh_process(NUMBA_CACHE_DIR=str(taken), TMPDIR=str(temporary))
    assert (answer["hits"], answer["misses"]) == (0, 1)
    assert Path(str(answer["path"])).is_relative_to(temporary)
    assert taken.read_text() == "not a folder"
    assert {stat.S_IMODE(path.stat().st_mode) for path in temporary.glob("ninedisk-numba-*")} == {0o700}


def test_key_of_the_cache_is_every_source_and_nothing_else(tmp_path: Path) -> None:
    """Numba looks at a function's own file only; one that it calls from another file may have changed as well."""
    (tmp_path / "a.py").write_text("x = 1")
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "b.py").write_text("y = 1")
    keys = [source_hash(tmp_path)]
    assert source_hash(tmp_path) == keys[0]
    (tmp_path / "a.pyc").write_text("compiled")
    assert source_hash(tmp_path) == keys[0]
    changes = (
        lambda: (tmp_path / "sub" / "b.py").write_text("y = 2"),
        lambda: (tmp_path / "sub" / "b.py").rename(tmp_path / "sub" / "c.py"),
        lambda: (tmp_path / "d.py").write_text(""),
        lambda: (tmp_path / "a.py").unlink(),
    )
    for change in changes:
        change()
        keys.append(source_hash(tmp_path))
    assert len(set(keys)) == 5
    assert all(len(key) == 16 for key in keys)
