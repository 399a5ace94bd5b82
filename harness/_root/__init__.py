"""ninedisk: verification and benchmark harness for granular DEM and contact dynamics."""

__version__ = "0.1.0"
