"""Siconos."""
