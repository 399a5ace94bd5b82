"""Which module may import what: our own packages by import-linter, third parties by the lists below."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
from collections.abc import Iterable
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

# First match wins. The core is meant to run where only a compiler of kernels exists; sparse algebra serves contact
# dynamics alone.
THIRD_PARTIES = (
    (
        r"ninedisk\.core\.(thread_kernels|dem\.space\.registers|cd\.solvers\.factorise_kernels)",
        {"numpy", "numba", "llvmlite.ir"},
    ),
    (r"ninedisk\.core\.cd\.solvers\.feasibility", {"numpy", "numba", "scipy.sparse", "scipy.optimize.linprog"}),
    (
        r"ninedisk\.core\.cd\.problem_files",
        {"numpy", "scipy.sparse", "h5py"},
    ),  # h5py where an HDF5 file is asked for only
    (r"ninedisk\.core\.cd(\..+)?", {"numpy", "numba", "scipy.sparse"}),
    (r"ninedisk\.core(\..+)?", {"numpy", "numba"}),
)
# A kernel works on arrays and numbers. Besides other kernels it may use modules that lay arrays out, as long as these
# import no more than a kernel may; the layer that checks and converts is out of reach.
KERNELS = re.compile(r"ninedisk\.core\..*kernel[^.]*")
KERNELS_MAY_IMPORT = {
    "__future__",
    "math",
    "typing",
    "collections.abc",
    "numpy",
    "numba",
    "llvmlite.ir",
    "ninedisk.core.compile",
}
PUBLIC_LAYER = {f"ninedisk.core.{name}" for name in ("scene", "numerics", "history", "errors", "simulate")}


@cache
def imported(path: Path) -> set[str]:
    """Dotted names that a module imports, at its top or in a function; ``from a.b import c`` counts as ``a.b.c``."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names.update(f"{node.module}.{alias.name}" for alias in node.names)
    return names


def within(name: str, packages: set[str]) -> bool:
    return any(name == package or name.startswith(f"{package}.") for package in packages)


def foreign(module: str, names: set[str]) -> set[str]:
    """Names among ``names`` that are third parties ``module`` may not import."""
    ours = {"ninedisk", *sys.stdlib_module_names}
    allowed = next((allowed for rule, allowed in THIRD_PARTIES if re.fullmatch(rule, module)), None)
    return set() if allowed is None else {name for name in names if not within(name, ours | allowed)}


@pytest.mark.long
def test_the_core_imports_only_its_third_parties(sources: dict[str, Path]) -> None:
    found = {module: foreign(module, imported(path)) for module, path in sources.items()}
    assert {module: names for module, names in found.items() if names} == {}


def cycle(sources: dict[str, Path]) -> list[str]:
    """Modules of which each is imported by the next, the first by the last: wherever the imports stand; empty if there are none."""
    named = {
        module: {name if name in sources else name.rpartition(".")[0] for name in imported(path)}
        for module, path in sources.items()
    }
    try:
        TopologicalSorter({module: names & sources.keys() for module, names in named.items()}).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


@pytest.mark.long
def test_no_module_imports_what_imports_it(sources: dict[str, Path]) -> None:
    """A cycle cannot be read from either end; one that a function's import hides is one all the same."""
    assert cycle(sources) == []


@pytest.mark.parametrize(
    "back",
    [
        "from ninedisk.core.first import one",
        "from ninedisk.core import first",
        "def late():\n    import ninedisk.core.first",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from ninedisk.core.first import One",
    ],
)
def test_a_cycle_is_found_wherever_its_import_stands(tmp_path: Path, back: str) -> None:
    (tmp_path / "first.py").write_text("from ninedisk.core.second import two")
    (tmp_path / "second.py").write_text("import ninedisk.core.third")
    (tmp_path / "third.py").write_text(back)
    (tmp_path / "user.py").write_text("import ninedisk.core.first")
    planted = {f"ninedisk.core.{path.stem}": path for path in tmp_path.iterdir()}
    assert set(cycle(planted)) == {f"ninedisk.core.{name}" for name in ("first", "second", "third")}


def beyond_kernels(sources: dict[str, Path]) -> set[str]:
    """Imports, as "module -> name", of kernels and of all that they reach, that no kernel may have."""
    waiting = [module for module in sources if KERNELS.fullmatch(module)]
    seen, wrong = set(waiting), set()
    while waiting:
        module = waiting.pop()
        for name in imported(sources[module]):
            if within(name, KERNELS_MAY_IMPORT):
                continue
            target = next((m for m in (name, name.rpartition(".")[0]) if m in sources), None)
            if target is None or target in PUBLIC_LAYER:
                wrong.add(f"{module} -> {name}")
            elif target not in seen:
                seen.add(target)
                waiting.append(target)
    return wrong


def test_kernels_reach_only_arrays_the_compiler_and_kernels(sources: dict[str, Path]) -> None:
    assert any(KERNELS.fullmatch(module) for module in sources), "no module of kernels: has their naming changed?"
    assert beyond_kernels(sources) == set()


@pytest.mark.parametrize(
    ("layout", "wrong"),
    [
        ("from numpy.typing import NDArray", set()),
        ("import scipy", {"ninedisk.core.layout -> scipy"}),
        ("from ninedisk.core.scene import Scene", {"ninedisk.core.layout -> ninedisk.core.scene.Scene"}),
    ],
)
def test_a_kernel_is_answerable_for_what_it_reaches(tmp_path: Path, layout: str, wrong: set[str]) -> None:
    (tmp_path / "a_kernels.py").write_text("from ninedisk.core.layout import Arrays")
    (tmp_path / "layout.py").write_text(layout)
    planted = {f"ninedisk.core.{path.stem}": path for path in tmp_path.iterdir()}
    assert beyond_kernels({**planted, "ninedisk.core.scene": tmp_path / "scene.py"}) == wrong


def test_drivers_import_names_that_exist(sources: dict[str, Path], tmp_path: Path) -> None:
    """Drivers run inside other programs, import their neighbours by plain names, and no checker of types reads them."""
    files = [path for path in sources.values() if {"engines", "bench"} & set(path.parts)]
    assert missing_names(files) == []
    (tmp_path / "one_parts.py").write_text("def here(): ...\n")
    (tmp_path / "one_driver.py").write_text("from one_parts import gone, here\n")
    assert missing_names(tmp_path.glob("*.py")) == ["one_driver.py: one_parts has no gone"]


def missing_names(files: Iterable[Path]) -> list[str]:
    """Names that files import from each other by plain module names, and that are not there."""
    trees = {path: ast.parse(path.read_text()) for path in files}
    named: dict[str, list[Path]] = {}
    for path in trees:
        named.setdefault(path.stem, []).append(path)
    found = []
    for path, tree in trees.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and node.level == 0 and len(named.get(node.module or "", ())) == 1:
                (other,) = named[node.module or ""]
                there = {part.name for part in trees[other].body if isinstance(part, ast.FunctionDef | ast.ClassDef)}
                for part in ast.walk(trees[other]):
                    if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store):
                        there.add(part.id)
                    elif isinstance(part, ast.Import | ast.ImportFrom):
                        there |= {alias.asname or alias.name for alias in part.names}
                found += [
                    f"{path.name}: {node.module} has no {alias.name}" for alias in node.names if alias.name not in there
                ]
    return found


def test_yade_is_imported_inside_yade_only(sources: dict[str, Path]) -> None:
    """A GPL engine is never loaded into our process."""
    loading = {module for module, path in sources.items() if any(within(name, {"yade"}) for name in imported(path))}
    users = {module for module in loading if ".bench.drivers." not in module}
    assert users == {f"ninedisk.harness.engines.yade.{part}" for part in ("driver", "yade_parts")}


@pytest.mark.parametrize(
    ("module", "name", "refused"),
    [
        ("ninedisk.core.dem.step", "scipy.sparse.csc_array", True),
        ("ninedisk.core.dem.step", "numpy.linalg.norm", False),
        ("ninedisk.core.cd.problem", "scipy.sparse.csc_array", False),
        ("ninedisk.core.cd.problem", "scipy.optimize.root", True),
        ("ninedisk.core.cdx", "scipy.sparse", True),
        ("ninedisk.harness.results.store", "pandas", False),
    ],
)
def test_the_rules_separate_right_from_wrong(module: str, name: str, refused: bool) -> None:
    assert bool(foreign(module, {name})) is refused


def linked(folder: Path, sources: dict[str, Path]) -> Path:
    """A folder of links to the installed sources in the shape of one package, which import-linter can read."""
    for module, path in sources.items():
        name = module.replace(".", "/") + ("/__init__.py" if path.name == "__init__.py" else ".py")
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).symlink_to(path)
    return folder


def lint_imports(root: Path, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run import-linter with the project's contracts on the package in ``folder``."""
    call = "from importlinter.cli import lint_imports_command; lint_imports_command()"
    command = [sys.executable, "-P", "-c", call, "--no-cache", "--config", str(root / "pyproject.toml")]
    environment = {**os.environ, "PYTHONPATH": str(folder)}
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=120)


def test_our_packages_depend_one_direction(root: Path, sources: dict[str, Path], tmp_path: Path) -> None:
    pytest.importorskip("importlinter", reason="import-linter comes with the extra `dev`")
    done = lint_imports(root, linked(tmp_path, sources))
    assert done.returncode == 0, done.stdout + done.stderr


def test_an_import_against_the_direction_is_found(root: Path, sources: dict[str, Path], tmp_path: Path) -> None:
    pytest.importorskip("importlinter", reason="import-linter comes with the extra `dev`")
    planted = tmp_path / "planted.py"
    planted.write_text("from ninedisk.harness.api import case\n")
    done = lint_imports(root, linked(tmp_path / "packages", {**sources, "ninedisk.core.planted": planted}))
    assert done.returncode == 1, done.stdout + done.stderr
    assert "ninedisk.core.planted -> ninedisk.harness.api.case" in done.stdout
