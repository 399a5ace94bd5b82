"""Solvers of contact problems that are given by their Delassus matrix: 2D and the choice in solve, 3D in cone."""
