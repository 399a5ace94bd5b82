"""Spheres in space: scenes, laws, and a DEM of their own."""
