"""The source's claims, each to be confirmed or contradicted by every engine."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ninedisk.references._data import ReferenceDataError, check_keys, read_toml

CLAIMS_FILE = Path(__file__).parent / "claims.toml"
_FIELDS: dict[str, type] = {"id": str, "place": str, "text": str, "case": str, "decided_by": str}


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A claim of the source.

    Parameters
    ----------
    id, place, text : str
        Name, place in the source and the source's own words.
    case : str
        Case that decides it.
    decided_by : str
        How, in words.
    """

    id: str
    place: str
    text: str
    case: str
    decided_by: str


def load_claims(path: Path = CLAIMS_FILE) -> tuple[Claim, ...]:
    """Every claim, in the source's order.

    Raises
    ------
    ReferenceDataError
        If the file is missing or not valid.
    """
    data = check_keys(read_toml(path), required={"claim": list}, optional={}, where=str(path))
    claims: dict[str, Claim] = {}
    for number, raw in enumerate(data["claim"], start=1):
        fields = check_keys(raw, required=_FIELDS, optional={}, where=f"{path}: claim {number}")
        empty = [key for key in _FIELDS if not fields[key].strip()]
        if empty:
            raise ReferenceDataError(f"{path}: claim {number}: {empty[0]} is empty")
        if fields["id"] in claims:
            raise ReferenceDataError(f"{path}: claim {number}: the id {fields['id']!r} is used twice")
        claims[fields["id"]] = Claim(**fields)
    return tuple(claims.values())
