"""The documentation as static pages: one for every case, one for every guide, the API reference, and an index."""

from __future__ import annotations

import posixpath
import re
import shutil
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from markupsafe import Markup

from ninedisk.reports import pages
from ninedisk.reports.drawing.draw import Projection, draw_projection, draw_sketch, numeral, read_scene, read_space
from ninedisk.reports.folder import fresh_folder
from ninedisk.reports.pages import HERE
from ninedisk.reports.panel.text import Slugs
from ninedisk.reports.reference import INDEX, Reference, rendered, write_reference

MARKER = ".ninedisk-docs"
KINDS = {"tutorials": "Tutorials", "how-to": "How-to guides", "reference": "Reference", "explanation": "Explanation"}
"""Headings of the index for folders of guides, in this order; any other folder has its own name, and comes last."""


def write_docs(
    record: Sequence[Mapping[str, Any]],
    guides: Sequence[tuple[str, str]],
    out: Path,
    beside: Path | None = None,
    api: Sequence[Mapping[str, Any]] = (),
) -> Path:
    """Write the pages; the first of them.

    Parameters
    ----------
    record : sequence of mapping
        Cases, as `ninedisk docs` gathers them.
    guides : sequence of (str, str)
        Paths (with ``/``, from the folder of the guides) and texts of Markdown files.
    out : Path
        Folder, replaced as a whole.
    beside : Path, optional
        Folder of the guides: files in it that they link to or show are copied to the pages.
    api : sequence of mapping
        Modules of the API, as `ninedisk docs` gathers them; empty: no reference.

    Raises
    ------
    ReportError
        If the folder holds foreign files or cannot be written, or a guide links to a page that is not there.
    """
    env, slug, folders = pages.environment(), Slugs(), Slugs()
    env.filters["numeral"] = numeral
    slug("/index")  # these two names are taken
    folders("/cases")
    names = {name: _page_name(name, folders, slug) for name, _ in guides}
    listed: dict[str, list[tuple[str, str]]] = {}
    for name, text in guides:
        listed.setdefault(posixpath.dirname(name), []).append((names[name], _heading(name, text)))
    order = ["", *KINDS]
    groups = [
        (KINDS.get(kind, kind or "Guides"), listed[kind])
        for kind in sorted(listed, key=lambda kind: (order.index(kind) if kind in order else len(order), kind))
    ]
    reference = Reference(api)
    cases = [(f"cases/{slug(case['id'])}.html", case) for case in record]
    with fresh_folder(out, MARKER, "documentation") as folder:
        (folder / "cases").mkdir()
        shutil.copy(HERE / "assets" / "style.css", folder / "style.css")
        for path, case in cases:
            page = env.get_template("docs/case.html").render(
                root="../",
                case=case,
                about=Markup(rendered(case["id"], case["about"], lambda _: None, _dotted(reference, path))),
                sketch=_sketch(case),
            )
            (folder / path).write_text(page, encoding="utf-8")
        for name, text in guides:
            page_of = partial(_page_of, name, names=names, beside=beside, folder=folder)
            body = Markup(rendered(name, text, page_of, _dotted(reference, names[name])))
            root = "../" * names[name].count("/") or "./"
            page = env.get_template("docs/guide.html").render(root=root, title=_heading(name, text), body=body)
            (folder / names[name]).parent.mkdir(parents=True, exist_ok=True)
            (folder / names[name]).write_text(page, encoding="utf-8")
        if api:
            write_reference(reference, folder, env)
        page = env.get_template("docs/index.html").render(
            root="", cases=cases, guides=groups, modules=reference.pages, reference=INDEX
        )
        (folder / "index.html").write_text(page, encoding="utf-8")
    return Path(out) / "index.html"


def _dotted(reference: Reference, page: str) -> Callable[[str, int], str | None]:
    """Links of full names, ``ninedisk.core.Scene``, in a text that is no docstring."""
    return lambda name, _: reference.link(page, name) if name.startswith("ninedisk.") else None


def _sketch(case: Mapping[str, Any]) -> dict[str, Any] | None:
    """Sketch of the scene as inline SVG, with the labels of its marks."""
    view = read_scene(case["setup"])
    if view is not None:
        return {"svg": Markup(draw_sketch(view)), "marks": [label for label, _ in view.marks]}
    space = read_space(case["setup"])
    if space is None:
        return None
    both = "".join(draw_projection(Projection(space, above)) for above in (False, True))
    return {"svg": Markup(both), "marks": [label for label, _ in space.marks]}


def _heading(name: str, text: str) -> str:
    found = re.search(r"^# (.+)$", text, re.MULTILINE)
    return found[1].strip() if found else Path(name).stem


def _page_name(name: str, folders: Slugs, slug: Slugs) -> str:
    """Page of a guide, in a folder as the guide is; no two guides share one."""
    return "/".join([*map(folders, Path(name).parent.parts), f"{slug(Path(name).stem)}.html"])


def _page_of(name: str, target: str, names: Mapping[str, str], beside: Path | None, folder: Path) -> str | None:
    """Where a guide's link leads among the pages: to another guide, or to a copy of a file; None: nowhere."""
    path = posixpath.normpath(posixpath.join(posixpath.dirname(name), target))
    found = names.get(path)
    if found is None:
        source = None if beside is None else (beside / path).resolve()
        if source is None or not source.is_file() or not source.is_relative_to(Path(str(beside)).resolve()):
            return None
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(source, folder / path)
        found = path
    return posixpath.relpath(found, posixpath.dirname(names[name]) or ".")
