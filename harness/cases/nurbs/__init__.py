"""Grains with outlines."""
