"""Shapes in space and where they touch: spheres, convex polyhedra and planes; contact points, normals and gaps."""

from __future__ import annotations

from ninedisk.core.shapes.contacts import find_contacts, pack, place
from ninedisk.core.shapes.polyhedron import ConvexPolyhedron
from ninedisk.core.shapes.search import near_pairs
from ninedisk.core.shapes.state import Contacts, Placed, Solids

__all__ = ["Contacts", "ConvexPolyhedron", "Placed", "Solids", "find_contacts", "near_pairs", "pack", "place"]
