"""Closed forms of many bodies: rows, stacks, lattices, dense flows."""
