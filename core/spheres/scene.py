"""Names of before."""

from ninedisk.core.scene import PlaneSegment, PlaneWall, Spheres, SphereScene

__all__ = ["PlaneSegment", "PlaneWall", "SphereScene", "Spheres"]
