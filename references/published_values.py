"""What the source's text states in numbers or formulas, with its place and words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

from ninedisk.references._data import ReferenceDataError, check_keys, check_selector, check_type, read_toml, selects
from ninedisk.references.published_formulas import CONDITIONS, FORMULAS

SOURCE_FILE = Path(__file__).parent / "published" / "source.toml"
KINDS = ("result", "input")
_REQUIRED: dict[str, type] = {
    "id": str,
    "case": str,
    "quantity": str,
    "unit": str,
    "place": str,
    "quote": str,
    "precision": float,
}
_OPTIONAL: dict[str, type] = {
    "value": float,
    "formula": str,
    "kind": str,
    "when": str,
    "params": dict,
    "contradicted_by": str,
    "derivation": str,
}


@dataclass(frozen=True, kw_only=True)
class PublishedValue:
    """A number of the source, evaluated for one variant.

    Parameters
    ----------
    id, case, quantity, unit : str
        Unique name, case, quantity of the case and its SI unit.
    value : float
        The number, or the printed formula at the variant's parameters.
    precision : float
        Half a unit in the last printed digit, in the quantity's unit; 0 where the source states an exact result or a
        chosen input.
    place, quote : str
        Where it stands, and the words.
    kind : {"result", "input"}
        A result that an engine should show, or a number that the set-up is built from.
    contradicted_by : str
        Not empty: why a better truth says otherwise.
    derivation : str
        How the number follows from the words, where they do not print it.
    """

    id: str
    case: str
    quantity: str
    unit: str
    value: float
    precision: float
    place: str
    quote: str
    kind: Literal["result", "input"] = "result"
    contradicted_by: str = ""
    derivation: str = ""

    @property
    def source(self) -> str:
        """Place and words in one line, for a table."""
        return f'{self.place}: "{self.quote}"'


@dataclass(frozen=True)
class _Entry:
    fields: Mapping[str, Any]
    selector: Mapping[str, Any]
    when: str
    formula: str

    def applies(self, params: Mapping[str, Any]) -> bool:
        return selects(self.selector, params) and (not self.when or CONDITIONS[self.when](params))

    def evaluate(self, params: Mapping[str, Any]) -> PublishedValue:
        fields = dict(self.fields)
        if self.formula:
            fields["value"] = float(FORMULAS[self.formula](params))
        return PublishedValue(**fields)


def published_values(
    case: str,
    params: Mapping[str, Any],
    *,
    kind: Literal["result", "input"] = "result",
    path: Path = SOURCE_FILE,
) -> list[PublishedValue]:
    """Published values that apply to one variant of a case, in the source's order.

    Parameters
    ----------
    case : str
        Case id; a case of which the source says nothing gives an empty list.
    params : mapping
        The variant's complete parameters.
    kind : {"result", "input"}
        Results (the default) or numbers of the set-up.
    path : Path
        Data file.

    Raises
    ------
    ReferenceDataError
        If the file is not valid, or a formula needs a parameter that ``params`` lacks.
    """
    found = []
    for entry in load_entries(path):
        if entry.fields["case"] != case or entry.fields["kind"] != kind:
            continue
        try:
            if entry.applies(params):
                found.append(entry.evaluate(params))
        except KeyError as error:
            raise ReferenceDataError(
                f"published value {entry.fields['id']!r} needs the parameter {error}; the variant of {case!r} has "
                f"{', '.join(sorted(params)) or 'none'}"
            ) from None
    return found


@lru_cache(maxsize=8)
def load_entries(path: Path = SOURCE_FILE) -> tuple[_Entry, ...]:
    """Every entry of a data file, checked; raises `ReferenceDataError`."""
    data = check_keys(read_toml(path), required={"source": dict, "value": list}, optional={}, where=str(path))
    check_keys(data["source"], required={"title": str, "note": str}, optional={}, where=f"{path}: source")
    entries: list[_Entry] = []
    seen: set[str] = set()
    for number, raw in enumerate(data["value"], start=1):
        where = f"{path}: value {number} ({raw.get('id', 'without id') if isinstance(raw, dict) else raw!r})"
        entry = _checked(raw, where)
        if entry.fields["id"] in seen:
            raise ReferenceDataError(f"{where}: the id is used twice")
        seen.add(entry.fields["id"])
        entries.append(entry)
    return tuple(entries)


def _checked(raw: object, where: str) -> _Entry:
    data = dict(check_keys(raw, required=_REQUIRED, optional=_OPTIONAL, where=where))
    selector, when, formula = data.pop("params", {}), data.pop("when", ""), data.pop("formula", "")
    if ("value" in data) == bool(formula):
        raise ReferenceDataError(f"{where}: give either a value or a formula")
    if formula and formula not in FORMULAS:
        raise ReferenceDataError(f"{where}: formula {formula!r} is unknown; known: {', '.join(FORMULAS)}")
    if when and when not in CONDITIONS:
        raise ReferenceDataError(f"{where}: when = {when!r} is unknown; known: {', '.join(CONDITIONS)}")
    if data.setdefault("kind", "result") not in KINDS:
        raise ReferenceDataError(f"{where}: kind = {data['kind']!r} is unknown; use one of {', '.join(KINDS)}")
    if data["precision"] < 0.0:
        raise ReferenceDataError(f"{where}: precision = {data['precision']!r} must be >= 0")
    for key in ("id", "case", "quantity", "place", "quote"):
        if not data[key].strip():
            raise ReferenceDataError(f"{where}: {key} is empty")
    check_type(selector, dict, where=f"{where}: params")
    check_selector(selector, where=where)
    for key in ("value", "precision"):
        if key in data:
            data[key] = float(data[key])
    return _Entry(fields=data, selector=selector, when=when, formula=formula)
