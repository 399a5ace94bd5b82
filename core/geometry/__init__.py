"""Geometry: walls and their motion, NURBS outlines."""
