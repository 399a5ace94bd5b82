"""The API reference as static pages: one for every module, and an index of all that is public."""

from __future__ import annotations

import posixpath
import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

from jinja2 import Environment
from markupsafe import Markup, escape

from ninedisk.reports.folder import ReportError
from ninedisk.reports.panel.text import Slugs

FOLDER = "reference/api"
"""Folder of these pages among those of the documentation."""

INDEX = f"{FOLDER}/index.html"

PLAIN = ("blockquote", "heading", "lheading", "hr", "emphasis", "code", "reference")
"""Rules of Markdown that docstrings do not use: there ``> 0`` is no quotation and ``E*`` no emphasis."""

LINKS = {"link_open": "href", "image": "src"}
"""Tokens of Markdown that lead to another file, and the attribute that says where."""


class Reference:
    """Where every public name of an API record is described.

    Parameters
    ----------
    record : sequence of mapping
        Modules, as `ninedisk docs` gathers them.
    """

    def __init__(self, record: Sequence[Mapping[str, Any]]) -> None:
        slug = Slugs()
        self.pages = [(f"{FOLDER}/{slug(module['name'])}.html", module) for module in record]
        self._places: dict[str, str] = {}
        self._short: set[str] = set()
        for page, module in self.pages:
            self._places[module["name"]] = page
            for each in module["objects"]:
                name = each["name"]
                parts = [item["name"] for item in parameters_of(each)] + [member["name"] for member in each["members"]]
                for inner in ("", *(f".{part}" for part in parts)):
                    place = f"{page}#{name}{inner}"
                    for known in (f"{name}{inner}", f"{module['name']}.{name}{inner}", f"{each['home']}{inner}"):
                        self._places.setdefault(known, place)
                self._short.add(name)

    def link(self, page: str, name: str, within: str = "") -> str | None:
        """Address of a name as seen from a page; None if it is not described. ``within`` is the object whose text says it."""
        place = self._places.get(f"{within}.{name}") or self._places.get(name)
        return None if place is None else posixpath.relpath(place, posixpath.dirname(page) or ".")

    def linked_type(self, page: str, text: str) -> Markup:
        """A type in words, in which public names are links."""

        def replaced(match: re.Match[str]) -> str:
            to = self.link(page, match[0]) if match[0] in self._short else None
            return match[0] if to is None else f'<a href="{escape(to)}">{match[0]}</a>'

        return Markup(re.sub(r"\b[A-Z]\w+", replaced, str(escape(text))))


def parameters_of(each: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the parameters and attributes that an object documents."""
    return [
        item
        for section in each["sections"]
        if section.get("title") in ("Parameters", "Attributes")
        for item in section["items"]
    ]


def write_reference(reference: Reference, folder: Path, env: Environment) -> None:
    """Write the pages of the API into the folder of the documentation.

    Parameters
    ----------
    reference : Reference
    folder : Path
    env : Environment
        Templates of the documentation.
    """
    (folder / FOLDER).mkdir(parents=True)
    for page, module in reference.pages:

        def text(source: str, within: str = "", page: str = page) -> Markup:
            link = partial(reference.link, page, within=within)
            return Markup(
                rendered(
                    page, source, lambda _: None, lambda name, ticks: link(name) if ticks == 1 else None, plain=True
                )
            )

        html = env.get_template("docs/api.html").render(
            root="../../",
            module=module,
            text=text,
            linked=partial(reference.linked_type, page),
        )
        (folder / page).write_text(html, encoding="utf-8")
    listed = [(posixpath.basename(page), module) for page, module in reference.pages]
    html = env.get_template("docs/api_index.html").render(root="../../", modules=listed, summary=summary)
    (folder / INDEX).write_text(html, encoding="utf-8")


def summary(each: Mapping[str, Any]) -> str:
    """Return the first paragraph of an object's docstring, without ticks; of another name of an object, that."""
    if each["alias"]:
        return f"Another name of {each['alias']}."
    first = next((section["text"] for section in each["sections"] if section["kind"] == "text"), "")
    return " ".join(first.partition("\n\n")[0].replace("`", "").split())


def rendered(
    name: str,
    text: str,
    page_of: Callable[[str], str | None],
    link_of: Callable[[str, int], str | None] = lambda *_: None,
    *,
    plain: bool = False,
) -> str:
    """Return Markdown as HTML; raw HTML in it is shown as text.

    Headings get the ids that code hosts give them, so that a link into a page works in both places.

    Parameters
    ----------
    name : str
        What the text is, in messages.
    text : str
    page_of : callable
        Where a relative link leads; None: nowhere, which is refused.
    link_of : callable
        Where code of some text between some number of ticks leads; None: it is no link.
    plain : bool
        True: a docstring, which has paragraphs, lists, code and links.

    Raises
    ------
    ReportError
        If a relative link leads nowhere.
    """
    from markdown_it import MarkdownIt
    from markdown_it.token import Token

    parser = MarkdownIt("commonmark", {"html": False}).enable("table")
    if plain:
        parser.disable(PLAIN)
    tokens = parser.parse(text)
    for opening, heading in pairwise(tokens):
        if opening.type == "heading_open":
            opening.attrSet("id", re.sub(r"[^\w -]", "", heading.content.lower()).replace(" ", "-"))
    for block in tokens:
        children: list[Token] = []
        inside = 0
        for token in block.children or ():
            attribute = LINKS.get(token.type, "")
            target = token.attrGet(attribute) if attribute else None
            if isinstance(target, str) and "://" not in target and not target.startswith("#"):
                page, hash_, place = target.partition("#")
                if (found := page_of(page)) is None:
                    raise ReportError(
                        f"the guide {name!r} links to {target!r}, which is no guide or file of its folder"
                    )
                token.attrSet(attribute, found + hash_ + place)
            inside += {"link_open": 1, "link_close": -1}.get(token.type, 0)
            to = link_of(token.content, len(token.markup)) if token.type == "code_inline" and not inside else None
            if to is not None:
                opened = Token("link_open", "a", 1, attrs={"href": to})
                children += [opened, token, Token("link_close", "a", -1)]
            else:
                children.append(token)
        if block.children is not None:
            block.children = children
    return str(parser.renderer.render(tokens, parser.options, {}))
