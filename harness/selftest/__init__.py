"""Mutants: deliberately wrong engines, and whether the suite names a failing check for each of them."""
