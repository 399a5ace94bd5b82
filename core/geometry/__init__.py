"""Geometry: walls and their motion."""
