"""Edits fit code, not its text: however it is laid out and whatever its locals are called; a doubtful place is an error."""

from __future__ import annotations

import ast
import gc
import importlib.util
import pickle
import time
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from ninedisk.harness.selftest.defect import Defect
from ninedisk.harness.selftest.edits import Edit, StaleEditError, by_module, edited, plant
from ninedisk.harness.selftest.mutants import CLEAN, MUTANTS

SOURCE = '''
"""A module."""
import numpy as np
LIMIT = 2_000

def force(before, ks, slip):
    # Against the slip.
    trial = (before
             - (ks * slip))
    trial = max(trial, 0.0)
    return trial

def scatter(out, i, j, fx, fy):
    out[i] += fx
    out[j] += fy
    if fx > 0.0:
        out[i] -= fy

def outer(a):
    def inner(b):
        return 2.0 * b
    return inner(a) + 1.0

class Law:
    sign = 1.0
    def value(self, x):
        return self.sign * x
'''


def edit(function: str, old: str, new: str) -> Edit:
    return Edit("dem.plane.force_kernels", function, old, new)


def result(function: str, old: str, new: str, source: str = SOURCE) -> str:
    return ast.unparse(edited(source, [edit(function, old, new)]))


def plain(source: str) -> str:
    return ast.unparse(ast.parse(source))


@pytest.mark.parametrize(
    ("function", "old", "new", "was", "becomes"),
    [
        ("force", "before - ks * slip", "before + ks * slip", "- (ks * slip)", "+ (ks * slip)"),
        ("force", "trial=max(trial , 0.)", "", "    trial = max(trial, 0.0)\n", ""),
        ("scatter", "out[i] -= fy", "", "out[i] -= fy", "pass"),
        ("scatter", "out[i] += fx\nout[j] += fy", "out[j] += fy", "    out[i] += fx\n", ""),
        ("scatter", "out[j] += fy", "out[j] += fy\n\nkept = fx\nout[j] += kept", "fy\n    if", "fy; kept = fx; out[j] += kept\n    if"),
        ("", "LIMIT = 2000", "LIMIT = 1", "2_000", "1"),
        ("outer.inner", "2.0 * b", "b", "2.0 * b", "b"),
        ("outer", "inner(a)", "inner(2.0 * a)", "inner(a)", "inner(2.0 * a)"),
        ("Law", "sign = 1.0", "sign = -1.0", "1.0\n    def", "-1.0\n    def"),
        ("Law.value", "self.sign * x", "np.sqrt(x)", "self.sign * x", "np.sqrt(x)"),
    ],
    ids=["expression", "deletion", "empty block", "two", "more", "module", "inner", "outer", "class", "method"],
)  # fmt: skip
def test_an_edit_changes_one_place(function: str, old: str, new: str, was: str, becomes: str) -> None:
    assert SOURCE.count(was) == 1
    assert result(function, old, new) == plain(SOURCE.replace(was, becomes))


@pytest.mark.parametrize(
    ("function", "old", "new", "said"),
    [
        ("force", "before - kn / slip", "before", "occurs 0 times.*nearest there: 'before - ks . slip'"),
        ("scatter", "fy", "0.0", "the expression 'fy' occurs 2 times"),
        ("scatter", "LIMIT", "1", "occurs 0 times"),
        ("outer", "2.0 * b", "b", "occurs 0 times"),
        ("forse", "trial", "0.0", "the function forse is defined 0 times; did you mean force"),
        ("force", "before - (ks * slip)", "before - ks*slip", "is its own replacement"),
        ("force", "return trial", "return trail", "has names that are unknown there: trail"),
        ("force", "if ks:", "", "is neither an expression nor statements"),
        ("force", "", "return 1.0", "there is nothing to replace"),
    ],
)
def test_what_does_not_fit_once_is_reported(function: str, old: str, new: str, said: str) -> None:
    with pytest.raises(StaleEditError, match=rf"went stale: in ninedisk\.core\.dem\.plane\.force_kernels.*{said}"):
        result(function, old, new)


def test_locals_may_be_called_otherwise() -> None:
    renamed = SOURCE.replace("slip", "u").replace("before", "was")
    assert result("force", "before - ks * slip", "before + ks * slip", renamed) == plain(
        renamed.replace("- (ks * u)", "+ (ks * u)")
    )


@pytest.mark.parametrize(
    ("function", "old", "new", "count"),
    [
        ("scatter", "out[n] += f", "out[n] -= f", 2),
        ("scatter", "out[j] += f; g(f)", "", 0),
        ("scatter", "out[j] -= f", "out[j] += f", 0),  # j is still there, and the one difference is at i
        ("scatter", "a[b] += a", "pass", 0),  # one name, two locals
        ("force", "lowest(trial, 0.0)", "trial", 0),  # max is no local
        ("Law.value", "self.size * x", "x", 0),  # attributes keep their names
    ],
)
def test_a_doubtful_place_is_refused(function: str, old: str, new: str, count: int) -> None:
    with pytest.raises(StaleEditError, match=f"occurs {count} times"):
        result(function, old, new)


def test_two_placeholders_are_two_locals() -> None:
    source = "def f(a, b):\n    g(a, a)\n    g(a, b)\n"
    assert result("f", "g(x, y)", "g(y, x)", source) == plain(source.replace("g(a, b)", "g(b, a)"))
    assert result("f", "g(x, x)", "", source) == plain(source.replace("    g(a, a)\n", ""))
    with pytest.raises(StaleEditError, match="occurs 0 times"):
        result("f", "g(b, x)", "", source)


def test_edits_are_made_one_after_the_other() -> None:
    first, then = edit("force", "ks * slip", "ks"), edit("force", "before - ks", "before + ks")
    assert ast.unparse(edited(SOURCE, [first, then])) == plain(SOURCE.replace("- (ks * slip)", "+ ks"))
    with pytest.raises(StaleEditError, match="occurs 0 times"):
        edited(SOURCE, [then, first])


class _Litter:
    """Garbage that lets another thread run while it is collected."""

    def __init__(self) -> None:
        self.itself = self

    def __del__(self) -> None:
        time.sleep(1e-4)


def test_threads_may_edit_at_the_same_time() -> None:
    source = SOURCE * 40
    change = Edit("m", "", "LIMIT = 2_000", "LIMIT = 1\n" * 2)

    def parse(_: int) -> int:
        for _ in range(5):
            _Litter()
        with pytest.raises(StaleEditError, match="occurs 40 times"):
            edited(source, [change])
        return 1

    before = gc.get_threshold()
    gc.set_threshold(50)
    try:
        with ThreadPoolExecutor(4) as pool:
            assert sum(pool.map(parse, range(40))) == 40
    finally:
        gc.set_threshold(*before)


def test_what_is_new_has_the_line_of_what_was_there() -> None:
    line = next(number for number, text in enumerate(SOURCE.splitlines(), 1) if "out[j]" in text)
    tree = edited(SOURCE, [edit("scatter", "out[j] += fy", "pass\nraise ValueError(fx)")])
    space: dict[str, Any] = {}
    exec(compile(tree, "file", "exec"), space)
    with pytest.raises(ValueError, match=r"7\.0") as caught:
        space["scatter"]([0.0], 0, 0, 7.0, 1.0)
    assert caught.traceback[-1].lineno + 1 == line


def test_edits_come_before_the_core() -> None:
    with pytest.raises(RuntimeError, match="is loaded already"):
        plant([edit("shear_force", "before", "0.0")])


# The mutants, on sources that say the same otherwise.


@cache
def source_of(module: str) -> str:
    spec = importlib.util.find_spec(module)
    assert spec is not None
    assert spec.origin is not None
    return Path(spec.origin).read_text(encoding="utf-8")


@cache
def one_function(module: str, function: str) -> bytes:
    """The module with the code of this function, and of no other function or class."""
    tree = ast.parse(source_of(module))
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name != function.partition(".")[0]:
            node.body = [ast.Pass()]
    return pickle.dumps(tree)


def function_in(tree: ast.Module, function: str) -> ast.AST:
    scope: ast.AST = tree
    for part in function.split("."):
        (scope,) = (
            node for node in ast.walk(scope) if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name == part
        )
    return scope


def locals_in(scope: ast.AST, module: ast.Module) -> set[str]:
    stored = {node.id for node in ast.walk(scope) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
    inner = {node.name for node in ast.walk(module) if isinstance(node, ast.FunctionDef)}
    return stored | {node.arg for node in ast.walk(scope) if isinstance(node, ast.arg)} - inner


def with_other_names(source: str, function: str, names: set[str]) -> str:
    tree = ast.parse(source)
    for node in ast.walk(function_in(tree, function)):
        if isinstance(node, ast.Name) and node.id in names:
            node.id += "_"
        elif isinstance(node, ast.arg) and node.arg in names:
            node.arg += "_"
    return ast.unparse(tree)


EDITED = [defect for defect in (*CLEAN, *MUTANTS) if defect.edits]


@pytest.mark.parametrize("defect", EDITED, ids=lambda defect: defect.id)
def test_another_layout_makes_no_edit_stale(defect: Defect) -> None:
    for module, edits in by_module(defect.edits).items():
        source = source_of(module)
        assert ast.dump(edited(plain(source), edits)) == ast.dump(edited(source, edits))


@pytest.mark.sampled(30)
@pytest.mark.parametrize("defect", EDITED, ids=lambda defect: defect.id)
def test_a_renamed_local_makes_no_edit_stale(defect: Defect) -> None:
    """One local after the other; where only the replacement has it, the edit is stale and says which."""
    for edit in defect.edits:
        if not edit.function or edit != next(each for each in defect.edits if each.place == edit.place):
            continue  # the second edit of a function is of code that the first may have changed
        tree = pickle.loads(one_function(edit.name, edit.function))
        source = ast.unparse(tree)
        right = ast.unparse(edited(source, [edit]))
        old, new = (
            {node.id for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Name)}
            for text in (edit.old, edit.new)
        )
        for name in sorted((old | new) & locals_in(function_in(tree, edit.function), tree)):
            renamed = with_other_names(source, edit.function, {name})
            if name in old:
                assert ast.unparse(edited(renamed, [edit])) == with_other_names(right, edit.function, {name}), name
            else:
                with pytest.raises(StaleEditError, match=rf"unknown there: {name}\b"):
                    edited(renamed, [edit])
