"""Closed forms of one body on a plane: it slides, rolls, spins."""
