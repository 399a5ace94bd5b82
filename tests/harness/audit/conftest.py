"""Trajectories as other programs write them, for the tests of this folder."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

NAME = "ninedisk_tests_written"

_spec = importlib.util.spec_from_file_location(NAME, Path(__file__).parent / "written.py")
assert _spec is not None
assert _spec.loader is not None
_module = importlib.util.module_from_spec(_spec)
sys.modules[NAME] = _module
_spec.loader.exec_module(_module)
