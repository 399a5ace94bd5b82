"""A case's numbers in one script file: every stored sample exactly, each array once, compressed."""

from __future__ import annotations

import base64
import json
import math
import struct
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.reports.curves import Curve
from ninedisk.reports.figures import Looks, tolerances
from ninedisk.reports.model import CaseData, Panel
from ninedisk.reports.style import Look


class Arrays:
    """Float arrays by number; equal ones (times, truths that several engines share) are held once."""

    def __init__(self) -> None:
        self._number: dict[bytes, int] = {}

    def __call__(self, values: Any) -> int:
        """Number of the array that holds ``values``, flattened."""
        raw = np.asarray(values, dtype="<f8").tobytes()
        return self._number.setdefault(raw, len(self._number))

    @property
    def lengths(self) -> list[int]:
        """Numbers of values, in the order of `planes`."""
        return [len(raw) // 8 for raw in self._number]

    def planes(self) -> bytes:
        """All arrays, each with its first bytes together, then its second bytes and so on.

        Neighbouring samples share their leading bytes, so that this order compresses by a third better.
        """
        return b"".join(np.frombuffer(raw, np.uint8).reshape(-1, 8).T.tobytes() for raw in self._number)


def pack_case(panel: Panel, case: CaseData, looks: Looks, arrays: Arrays, more: dict[str, Any]) -> str:
    """Text of a case's data file.

    Parameters
    ----------
    panel, case
        What is packed.
    looks : Looks
        Looks of its engines and references.
    arrays : Arrays
        May hold arrays already; the curves' are added.
    more : dict
        Plain data that the page's scripts find in the head: moving scenes, folded tables.

    Returns
    -------
    str
        A call of ``ninedisk.load`` with the base64 text of zlib of: length of the head (uint32), head (JSON), arrays.
    """
    engines, variants, labels = list(looks.engines), list(case.variants), list(looks.references)
    limits = tolerances(case)

    def places(curve: Curve) -> list[int]:
        return [arrays(curve.step), arrays(curve.t), arrays(curve.value)]

    curves, references = [], []
    for (name, variant, engine, quantity), curve in panel.stored.series.items():
        if name == case.id and variant in case.variants and engine in looks.engines:
            limit = limits.get((variant, engine, quantity, curve.truth), math.nan)
            place = [variants.index(variant), engines.index(engine), quantity]
            known = limit if math.isfinite(limit) else None
            curves.append([*place, *places(curve), arrays(curve.expected), curve.truth, known])
    for (name, variant, quantity), found in panel.stored.references.items():
        if name == case.id and variant in case.variants:
            references += [[variants.index(variant), quantity, labels.index(c.label), *places(c)] for c in found]
    head = {
        "engines": [{"id": engine, **_plain(look)} for engine, look in looks.engines.items()],
        "labels": [_plain(looks.references[label]) for label in labels],
        "variants": variants,
        "curves": curves,
        "references": references,
        **more,
        "lengths": arrays.lengths,
    }
    text = json.dumps(head, allow_nan=False, separators=(",", ":")).encode()
    raw = zlib.compress(struct.pack("<I", len(text)) + text + arrays.planes(), 9)
    return f'ninedisk.load("{base64.b64encode(raw).decode()}");\n'


def unpack(text: str) -> tuple[dict[str, Any], list[NDArray[np.float64]]]:
    """Head and arrays of a data file: the inverse of `pack_case`, for checks."""
    raw = zlib.decompress(base64.b64decode(text[text.index('"') + 1 : text.rindex('"')]))
    (size,) = struct.unpack_from("<I", raw)
    head = json.loads(raw[4 : 4 + size])
    at, arrays = 4 + size, []
    for n in head["lengths"]:
        planes = np.frombuffer(raw, np.uint8, 8 * n, at).reshape(8, n)
        arrays.append(np.ascontiguousarray(planes.T).view("<f8").ravel())
        at += 8 * n
    return head, arrays


def _plain(look: Look) -> dict[str, Any]:
    return {
        "name": look.label, "colour": look.colour, "dash": list(look.dash), "width": look.width, "shape": look.shape,
        "phase": look.phase,
    }  # fmt: skip
