"""Edits of the core's sources: an expression or some statements of one function, and what replaces it.

Edits are made while the core is imported: no file is copied and none is changed. This module imports nothing of the core, so that a
process can plant the edits before the core is loaded.
"""

from __future__ import annotations

import ast
import builtins
import copy
import importlib.util
import sys
import textwrap
import threading
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType

CORE = "ninedisk.core."


class StaleEditError(RuntimeError):
    """An edit no longer fits the source that it was written for."""


@dataclass(frozen=True)
class Edit:
    """Replace ``old`` by ``new`` in one function of the core.

    Syntax trees are compared, not texts: line breaks, comments and parentheses that change nothing do not matter.

    Parameters
    ----------
    module : str
        A module of the core, ``cd.step`` for instance.
    function : str
        A function, a class, or ``Class.method`` or ``function.inner``; "" is the module. Its own code is searched, not that of
        functions and classes within it.
    old, new : str
        Two expressions, or statements for statements; no statement (``""``) in ``new`` deletes. ``old`` must occur exactly once.

    Notes
    -----
    A renamed local does not break an edit. Names of ``old`` are matched as they are first. If ``old`` does not occur, those of its names
    that are unknown become placeholders: they occur nowhere in the function, are no names of its module and are not built in. A
    placeholder represents one local name (an argument, or a name that the function assigns), the same wherever it is written. Two
    placeholders never represent the same local name, and none represents a name that ``old`` also has. Exactly one place must fit.
    Placeholders in ``new`` are replaced as in ``old``. Attributes, keywords and names of modules are never placeholders.
    """

    module: str
    function: str
    old: str
    new: str

    @property
    def name(self) -> str:
        """Full name of the module."""
        return CORE + self.module

    @property
    def place(self) -> str:
        """Full name of the function, or of the module."""
        return f"{self.name}.{self.function}".rstrip(".")


_ONE_PARSER = threading.Lock()
"""CPython 3.11 counts the depth of a syntax tree once for all threads: two that parse at a time end with a `SystemError`."""


def edited(source: str, edits: Sequence[Edit]) -> ast.Module:
    """The syntax tree of one module after its edits, made one after the other.

    Raises
    ------
    StaleEditError
        If there is no such function, if what is to be replaced does not occur exactly once, if replacing it changes nothing, or if the
        replacement has a name that is unknown there.
    """
    with _ONE_PARSER:
        tree = ast.parse(source)
        for edit in edits:
            _apply(tree, edit)
    return tree


def check_edits(edits: Sequence[Edit]) -> None:
    """Try the edits on the sources as they are now.

    Raises
    ------
    StaleEditError
        As `edited` does, or if a module does not exist.
    """
    for name, chosen in by_module(edits).items():
        spec = importlib.util.find_spec(name)
        if spec is None or spec.origin is None:
            raise StaleEditError(f"a planted defect went stale: there is no module {name}")
        edited(Path(spec.origin).read_text(encoding="utf-8"), chosen)


def by_module(edits: Sequence[Edit]) -> dict[str, list[Edit]]:
    """Edits by the full name of their module."""
    found: dict[str, list[Edit]] = {}
    for edit in edits:
        found.setdefault(edit.name, []).append(edit)
    return found


_Scope = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef
_SCOPES = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)

_Binding = dict[str, str]
"""Local name by placeholder."""


@dataclass(frozen=True)
class _Place:
    """``count`` nodes of a list in a field of ``parent`` from ``first`` on; without ``first`` the node in the field."""

    parent: ast.AST
    field: str
    first: int | None
    count: int = 1

    @property
    def nodes(self) -> list[ast.AST]:
        here = getattr(self.parent, self.field)
        return [here] if self.first is None else here[self.first : self.first + self.count]

    def put(self, new: Sequence[ast.AST]) -> None:
        """Replace the nodes; what is new has the line of what was there."""
        line = self.nodes[0]
        for node in new:
            for each in ast.walk(node):
                ast.copy_location(each, line)
        if self.first is None:
            setattr(self.parent, self.field, new[0])
            return
        here = getattr(self.parent, self.field)
        here[self.first : self.first + self.count] = new
        if not here:
            here.append(ast.copy_location(ast.Pass(), line))


def _apply(tree: ast.Module, edit: Edit) -> None:
    old, new = _parsed(edit, edit.old), _parsed(edit, edit.new)
    if not old:
        raise _stale(edit, "there is nothing to replace")
    if isinstance(old[0], ast.expr) and not (len(new) == 1 and isinstance(new[0], ast.expr)):
        old = [ast.Expr(old[0])]
    if not isinstance(old[0], ast.expr):
        new = [ast.Expr(node) if isinstance(node, ast.expr) else node for node in new]
    what = "expression" if isinstance(old[0], ast.expr) else "code"
    if [ast.dump(node) for node in old] == [ast.dump(node) for node in new]:
        raise _stale(edit, f"the {what} {edit.old!r} is its own replacement")
    scope = _scope(tree, edit)
    outside = _assigned(tree) | vars(builtins).keys()
    inside = _names(scope) | outside
    places = list(_candidate_places(scope, old))
    found = _find_place(old, places, set(), set())
    names = {name for node in old for name in _names(node)}
    if not found and names - inside and isinstance(scope, ast.FunctionDef | ast.AsyncFunctionDef):
        found = _find_place(old, places, names - inside, _assigned(scope) - outside - names)
    if len(found) != 1:
        near = {"\n".join(map(ast.unparse, place.nodes)): None for place in places}
        close = get_close_matches("\n".join(map(ast.unparse, old)), near, n=3)
        hint = "; what is nearest there: " + ", ".join(map(repr, close)) if close and not found else ""
        raise _stale(edit, f"the {what} {edit.old!r} occurs {len(found)} times{hint}")
    ((place, bound),) = found
    new = [_renamed(node, bound) for node in new]
    names = {name for node in new for name in _names(node)}
    if strange := names - inside - {name for node in new for name in _assigned(node)}:
        raise _stale(
            edit, f"the replacement {edit.new!r} has names that are unknown there: {', '.join(sorted(strange))}"
        )
    place.put(new)


def _stale(edit: Edit, why: str) -> StaleEditError:
    return StaleEditError(
        f"a planted defect went stale: in {edit.place} {why}; write its edit anew for the source as it is now"
    )


def _parsed(edit: Edit, text: str) -> list[ast.AST]:
    """Statements, or the one expression."""
    try:
        body = ast.parse(textwrap.dedent(text)).body
    except SyntaxError as error:
        raise _stale(edit, f"the code {text!r} is neither an expression nor statements") from error
    return [body[0].value] if len(body) == 1 and isinstance(body[0], ast.Expr) else list(body)


def _scope(tree: ast.Module, edit: Edit) -> ast.Module | _Scope:
    scope: ast.Module | _Scope = tree
    for part in edit.function.split(".") if edit.function else ():
        inner = [node for node in _own(scope, whole=True) if isinstance(node, _SCOPES) and node is not scope]
        named = [node for node in inner if node.name == part]
        if len(named) != 1:
            close = get_close_matches(part, [node.name for node in inner])
            hint = f"; did you mean {' or '.join(close)}?" if close else ""
            raise _stale(edit, f"the function {part} is defined {len(named)} times{hint}")
        scope = named[0]
    return scope


def _own(scope: ast.AST, *, whole: bool = False) -> Iterator[ast.AST]:
    """The nodes of a scope, without those of functions and classes within it; with ``whole`` those themselves."""
    yield scope
    for node in ast.iter_child_nodes(scope):
        if not isinstance(node, _SCOPES):
            yield from _own(node, whole=whole)
        elif whole:
            yield node


def _candidate_places(scope: ast.AST, old: Sequence[ast.AST]) -> Iterator[_Place]:
    """Where as many statements stand, or an expression does."""
    kind, count = (ast.expr, 1) if isinstance(old[0], ast.expr) else (ast.stmt, len(old))
    for parent in _own(scope):
        for field, value in ast.iter_fields(parent):
            if isinstance(value, list):
                for first in range(len(value) - count + 1):
                    if all(isinstance(node, kind) for node in value[first : first + count]):
                        yield _Place(parent, field, first, count)
            elif isinstance(value, kind):
                yield _Place(parent, field, None)


def _find_place(
    old: list[ast.AST], places: Sequence[_Place], placeholders: set[str], local: set[str]
) -> list[tuple[_Place, _Binding]]:
    """Where ``old`` is, and what its placeholders represent there."""
    tried = [(place, dict.fromkeys(placeholders, "")) for place in places]
    return [(place, bound) for place, bound in tried if _same(old, place.nodes, bound, local)]


def _same(old: object, here: object, bound: _Binding, local: set[str]) -> bool:
    """Whether ``old`` is ``here``; ``bound`` has "" for placeholders that represent nothing yet, and is filled."""
    if isinstance(old, list):
        return (
            isinstance(here, list)
            and len(old) == len(here)
            and all(_same(one, two, bound, local) for one, two in zip(old, here, strict=True))
        )
    if type(old) is not type(here):
        return False
    if not isinstance(old, ast.AST):
        return old == here
    for field in old._fields:
        one, two = getattr(old, field, None), getattr(here, field, None)
        if field == _name_field(old) and one in bound:
            if not bound[one] and two in local and two not in bound.values():
                bound[one] = two
            if bound[one] != two:
                return False
        elif field not in ("kind", "type_comment") and not _same(one, two, bound, local):
            return False
    return True


def _name_field(node: object) -> str:
    """The field of a node that is a name of the scope."""
    return {ast.Name: "id", ast.arg: "arg"}.get(type(node), "")


def _names(node: ast.AST) -> set[str]:
    return {getattr(each, field) for each in ast.walk(node) if (field := _name_field(each))}


def _renamed(node: ast.AST, bound: _Binding) -> ast.AST:
    for each in ast.walk(node := copy.deepcopy(node)):
        if (field := _name_field(each)) and getattr(each, field) in bound:
            setattr(each, field, bound[getattr(each, field)])
    return node


def _assigned(scope: ast.AST) -> set[str]:
    """Names that the code of a scope binds: arguments, assignments, imports, functions and classes."""
    found = set()
    for node in _own(scope, whole=True):
        if isinstance(node, ast.Import | ast.ImportFrom):
            found |= {(each.asname or each.name).partition(".")[0] for each in node.names}
        elif isinstance(node, _SCOPES):
            found |= {node.name} - ({scope.name} if node is scope else set())
        elif isinstance(node, ast.arg):
            found.add(node.arg)
        elif isinstance(node, ast.Name) and not isinstance(node.ctx, ast.Load):
            found.add(node.id)
    return found


class _EditedLoader(SourceFileLoader):
    """Loads a module from its edited source, never from a file of compiled code."""

    def __init__(self, name: str, path: str, edits: Sequence[Edit]) -> None:
        super().__init__(name, path)
        self._edits = edits

    def get_code(self, fullname: str) -> CodeType:  # noqa: ARG002
        tree = edited(Path(self.path).read_text(encoding="utf-8"), self._edits)
        code: CodeType = compile(tree, self.path, "exec", dont_inherit=True)
        return code


class _EditingFinder(MetaPathFinder):
    def __init__(self, edits: Mapping[str, Sequence[Edit]]) -> None:
        self._edits = edits

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if fullname not in self._edits:
            return None
        for finder in sys.meta_path:
            spec = None if finder is self else finder.find_spec(fullname, path, target)
            if spec is not None and spec.origin is not None:
                spec.loader = _EditedLoader(fullname, spec.origin, self._edits[fullname])
                return spec
        return None


def plant(edits: Sequence[Edit]) -> None:
    """Have the modules of the core imported with their edits from now on.

    Raises
    ------
    RuntimeError
        If the core is loaded already.
    """
    loaded = [name for name in sys.modules if name.startswith(CORE[:-1])]
    if edits and loaded:
        raise RuntimeError(f"{loaded[0]} is loaded already: edits must be planted first")
    sys.meta_path.insert(0, _EditingFinder(by_module(edits)))
