"""The source's twelve claims are all there; a broken file is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from ninedisk.references._data import ReferenceDataError
from ninedisk.references.claims import load_claims


def test_claims_of_the_source() -> None:
    claims = load_claims()
    assert len(claims) == 12
    assert [claim.place[:3] for claim in claims] == sorted(claim.place[:3] for claim in claims)
    assert {claim.case for claim in claims} == {
        "nine-disk/compression", "nine-disk/distortion", "nurbs/overlap", "binary-collision", "sliding/quasistatic",
        "sliding/dynamic", "slip-to-roll", "incline-block",
    }  # fmt: skip


CLAIM = '[[claim]]\nid = "a"\nplace = "A.1"\ntext = "t"\ncase = "c"\ndecided_by = "d"\n'


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "'claim' is missing"),
        (CLAIM * 2, "claim 2: the id 'a' is used twice"),
        (CLAIM.replace('"d"', '""'), "decided_by is empty"),
        (CLAIM.replace('"c"', "3"), "case = 3 is not text"),
        (CLAIM + "verdict = 1\n", "unknown key 'verdict'"),
    ],
)
def test_broken_claims_are_refused(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "claims.toml"
    path.write_text(text)
    with pytest.raises(ReferenceDataError, match=words):
        load_claims(path)
