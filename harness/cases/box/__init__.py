"""Boxes on planes and in flight."""
