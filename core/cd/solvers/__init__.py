"""Solvers of one contact problem, and the factorisation that they rest on."""
