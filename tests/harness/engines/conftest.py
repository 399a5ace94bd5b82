"""Scenes for adapters of engines with rigid contacts."""

from __future__ import annotations

import importlib.util
import math
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall

G = 10.0


def _load(name: str) -> None:
    """Make a helper beside this file importable: test modules are imported by path and have no package."""
    if (full := f"ninedisk_tests_{name}") not in sys.modules:
        spec = importlib.util.spec_from_file_location(full, Path(__file__).with_name(f"{name}.py"))
        assert spec is not None
        assert spec.loader is not None
        sys.modules[full] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(sys.modules[full])


_load("comparison")
_load("plain_spheres")


def rigid(mu: float = 0.0, restitution: float | None = 0.0) -> ContactLaw:
    """Law of a contact whose springs only regularise it."""
    return ContactLaw(kn=1e8, ks=1e8, mu=mu, restitution=restitution, regularised=True)


def on_plane(
    law: ContactLaw,
    *,
    degrees: float = 0.0,
    slope: float = 0.0,
    height: float = 0.0,
    g: float = G,
    motion=(),
    rotating: bool = False,
    v=(0.0, 0.0),
    omega: float = 0.0,
) -> Scene:
    """A disk of radius 1/2 and mass 2, ``height`` above a plane; all turned by ``degrees``, gravity by ``slope`` [rad] more."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    turn = np.array([[c, -s], [s, c]])
    foot = np.array([3.0, 2.0]) if degrees else np.zeros(2)
    return Scene(
        disks=Disks(
            x=[foot + turn @ [0.0, 0.5 + height]],
            v=[turn @ np.array(v)],
            omega=omega,
            radius=0.5,
            mass=2.0,
            rotating=rotating,
        ),
        disk_disk=rigid(),
        walls=(Wall(name="plane", point=tuple(foot), normal=tuple(turn @ [0.0, 1.0]), law=law, motion=motion),),
        gravity=tuple(turn @ [g * math.sin(slope), -g * math.cos(slope)]),
    )


@pytest.fixture(name="rigid")
def _rigid() -> Callable[..., ContactLaw]:
    return rigid


@pytest.fixture(name="on_plane")
def _on_plane() -> Callable[..., Scene]:
    return on_plane
