"""Grains with outlines: closed rational B-spline curves, their mass, their contacts with each other and with walls."""
