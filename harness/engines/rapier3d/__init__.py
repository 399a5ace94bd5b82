"""Rapier, 3D."""
