"""Histories of drivers: lists in the answer and a file beside it hold the same."""

import math
from pathlib import Path

import numpy as np
import pytest

from ninedisk.harness.engines.drivers import driver_parts
from ninedisk.harness.wire.protocol import float_array, read_history_file


@pytest.mark.parametrize("steps", [3, driver_parts.MANY])
def test_a_long_history_is_a_file_with_the_same_numbers(tmp_path: Path, steps: int) -> None:
    x = np.random.default_rng(1).normal(size=(steps, 1, 2)) / 3.0
    energy = np.append(math.nan, x[1:, 0, 0])
    history = {"step": np.arange(steps), "x": x, "force_meaning": "instantaneous", "energy": {"elastic": energy}}
    told = driver_parts.encoded_history(history, str(tmp_path / "answer.json"))
    assert told["force_meaning"] == "instantaneous"
    assert ("file" in told) == (steps == driver_parts.MANY)
    found = read_history_file(told["file"], tmp_path, ("x",)) if "file" in told else told
    assert list(found["step"]) == list(range(steps))
    np.testing.assert_array_equal(float_array(found["x"], "x", x.shape), x)
    np.testing.assert_array_equal(float_array(found["energy"]["elastic"], "elastic", (steps,)), energy)
