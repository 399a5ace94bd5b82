"""Closed forms of collisions: one, rows of them, gases."""
