"""Rapier, 2D."""
